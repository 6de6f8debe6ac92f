//! What arcs show of a cause that moves all their points at once, by so much each for one unit of it: a readout ([`super::row_delays`]), a lens that bends
//! lines.
//!
//! One number more in the fit for each cause: what of its shifts the arcs (with gravity, "up" and drag as freely as the flight's model has them) do not
//! follow is left in the residuals. Two others bend paths as well and are taken out, so that neither passes for the cause: a plane seen at a slant, by h² and r h,
//! and a spin, by a lift square to the velocity of each arc.
//!
//! Assumed: shifts so small that what the arcs make of them is linear.

use super::free_flight::Flight;
use super::motion_model::{FitPoint, autocorrelation_inflation};
use super::refit::whitened;
use super::samples::middle_and_extent;
use crate::quantity::Quantity;
use nalgebra::{DMatrix, DVector};

/// How far each of a flight's points is moved to the right and upward, plane units.
pub type Shifts = Vec<(f64, f64)>;

/// Distances of a path from a slanted plane's along r and h.
type Slant = fn(f64, f64) -> (f64, f64);

/// What a plane seen at a slant does to a place, from the middle of the path: the scale grows along h, along r.
const SLANTS: [Slant; 2] = [|r, h| (r * h, h * h), |r, h| (r * r, r * h)];

/// A change of scale over the path that is known to be less than this part is none.
const LEAST_SLANT: f64 = 1e-6;

/// Turn rate, 1/s, with which its response is worked out: small enough for the arcs to be linear in.
const PROBE: f64 = 1e-4;

/// How much there is of the cause that moves the points by `unit` for each unit of it, with its standard uncertainty; `None` where the flight's points do
/// not determine it. Nothing is known of a slant; the points may be off by `known` as well, each times a number known to be 0 ± 1.
#[must_use]
pub fn estimate(flight: &Flight, unit: Shifts, known: Vec<Shifts>) -> Option<Quantity> {
    let mut directions = vec![unit];
    directions.extend(lifts(flight));
    directions.extend(slants(flight, 1.0));
    let free = directions.len();
    directions.extend(known);
    let left = LeftOver::new(flight, &directions)?;
    let (best, inverse, variance) = left.solved(free)?;
    Quantity::new(best[0], (variance * inverse[(0, 0)]).sqrt())
}

/// What there is of causes that may not be there at all, as likely as a flight makes it.
#[derive(Debug, Clone, PartialEq)]
pub struct Likely {
    /// That each is there, from 0 to 1.
    pub probabilities: DVector<f64>,
    /// Mean products of how much there is of them.
    pub products: DMatrix<f64>,
}

/// What there is of causes by the points of a `flight`, each in its `units`: of each it is as likely beforehand that it is not there at all as that it is
/// 0 ± 1. The scale may change over the path by a part of `slant_std`; the points may be off by `known` as well, each times a number known to be 0 ± 1.
/// Where the points tell nothing, what is known beforehand.
#[must_use]
pub fn likely(flight: &Flight, units: &[Shifts], slant_std: f64, known: Vec<Shifts>) -> Likely {
    told(flight, units, slant_std, known).unwrap_or_else(|| Likely {
        probabilities: DVector::repeat(units.len(), 0.5),
        products: DMatrix::identity(units.len(), units.len()) * 0.5,
    })
}

fn told(flight: &Flight, units: &[Shifts], slant_std: f64, known: Vec<Shifts>) -> Option<Likely> {
    let mut directions = lifts(flight);
    let free = directions.len();
    directions.extend(units.iter().cloned());
    if slant_std > LEAST_SLANT {
        directions.extend(slants(flight, slant_std));
    }
    directions.extend(known);
    let left = LeftOver::new(flight, &directions)?;
    let (_, _, variance) = left.solved(free)?;
    let (normal, right) = (left.normal() / variance, left.right() / variance);
    let is_there = |there: usize, unit: usize| there >> unit & 1 == 1;
    let mut readings = Vec::new();
    for there in 0..1_usize << units.len() {
        let is_out = |i: usize| (free..free + units.len()).contains(&i) && !is_there(there, i - free);
        let kept: Vec<usize> = (0..directions.len()).filter(|&i| !is_out(i)).collect();
        let mut own = normal.select_rows(&kept).select_columns(&kept);
        for (i, _) in kept.iter().enumerate().filter(|(_, k)| **k >= free) {
            own[(i, i)] += 1.0;
        }
        let right = right.select_rows(&kept);
        let (inverse, ln_determinant) = inverse(own)?;
        let best = &inverse * &right;
        let products = &inverse + &best * best.transpose();
        let place = |unit: usize| kept.iter().position(|&k| k == free + unit);
        let of = |a: usize, b: usize| place(a).zip(place(b)).map_or(0.0, |at| products[at]);
        let products = DMatrix::from_fn(units.len(), units.len(), of);
        readings.push((there, 0.5 * (best.dot(&right) - ln_determinant), products));
    }
    let most = readings.iter().map(|r| r.1).fold(f64::NEG_INFINITY, f64::max);
    let mut sum = 0.0;
    let mut likely = Likely {
        probabilities: DVector::zeros(units.len()),
        products: DMatrix::zeros(units.len(), units.len()),
    };
    for (there, ln_likelihood, products) in readings {
        let weight = (ln_likelihood - most).exp();
        sum += weight;
        likely.products += weight * products;
        for (unit, probability) in likely.probabilities.iter_mut().enumerate() {
            *probability += if is_there(there, unit) { weight } else { 0.0 };
        }
    }
    likely.products /= sum;
    likely.probabilities /= sum;
    sum.is_finite().then_some(likely)
}

/// How far a lift of the turn rate 1/s takes the points of each arc from their paths: the acceleration is the velocity turned by a right angle.
fn lifts(flight: &Flight) -> Vec<Shifts> {
    let planar = flight.fit.planar(flight.fit.parameters.as_slice());
    let points = flight.fit_points();
    let lift = |p: &FitPoint, k: usize| {
        if p.arc != k {
            return (0.0, 0.0);
        }
        let pushed = planar.pushed_by(k, p.sample.t, |vr, vh| (-PROBE * vh, PROBE * vr));
        (pushed.r / PROBE, pushed.h / PROBE)
    };
    let of_arc = |k: usize| points.iter().map(|p| lift(p, k)).collect();
    (0..flight.fit.arcs()).map(of_arc).collect()
}

/// How far the points of a plane are moved whose scale grows by `part` over the path, upward and to the right.
fn slants(flight: &Flight, part: f64) -> [Shifts; 2] {
    let points = flight.fit_points();
    let middle = |of: fn(&FitPoint) -> f64| points.iter().map(of).sum::<f64>() / points.len() as f64;
    let (r0, h0) = (middle(|p| p.sample.r), middle(|p| p.sample.h));
    let extent = |of: fn(&FitPoint) -> f64| middle_and_extent(points.iter().map(of)).1;
    let path = extent(|p| p.sample.r).max(extent(|p| p.sample.h));
    SLANTS.map(|slant| {
        let shift = |p: &FitPoint| {
            let (r, h) = slant(p.sample.r - r0, p.sample.h - h0);
            (part * r / path, part * h / path)
        };
        points.iter().map(shift).collect()
    })
}

/// Shifts of a flight's points, whitened, with what of them its arcs do not follow.
struct LeftOver {
    points: Vec<FitPoint>,
    arcs: usize,
    residuals: DVector<f64>,
    columns: DMatrix<f64>,
    left_over: DMatrix<f64>,
}

impl LeftOver {
    fn new(flight: &Flight, directions: &[Shifts]) -> Option<Self> {
        let points = flight.fit_points();
        let columns: Vec<DVector<f64>> = directions
            .iter()
            .map(|d| whitened(&points, d.iter().copied()))
            .collect();
        let left_over: Option<Vec<DVector<f64>>> =
            directions.iter().map(|d| flight.left_over(&points, d)).collect();
        Some(Self {
            residuals: flight.whitened_residuals(&points),
            arcs: flight.fit.arcs(),
            columns: DMatrix::from_columns(&columns),
            left_over: DMatrix::from_columns(&left_over?),
            points,
        })
    }

    /// Products of the shifts with what is left of them. What is known of "up" and drag has rows of its own in the arcs' fit: what is left over is square
    /// to all that the arcs follow, those rows included, so that products with the shifts themselves have their share.
    fn normal(&self) -> DMatrix<f64> {
        let normal = self.columns.transpose() * &self.left_over;
        0.5 * (&normal + normal.transpose())
    }

    fn right(&self) -> DVector<f64> {
        self.columns.transpose() * &self.residuals
    }

    /// How much there is of each shift, where those from `free` on are known to be 0 ± 1, with the covariance that noise of variance 1 makes, and the noise's
    /// variance.
    fn solved(&self, free: usize) -> Option<(DVector<f64>, DMatrix<f64>, f64)> {
        let mut normal = self.normal();
        for known in free..normal.nrows() {
            normal[(known, known)] += 1.0;
        }
        let (inverse, _) = inverse(normal)?;
        let best = &inverse * self.right();
        let left = &self.residuals - &self.left_over * &best;
        let freedom = left
            .len()
            .checked_sub(4 * self.arcs + 2 + best.len())
            .filter(|f| *f > 0)?;
        let reduced = left.norm_squared() / freedom as f64;
        let variance = reduced * autocorrelation_inflation(&self.points, &left);
        Some((best, inverse, variance))
    }
}

/// The inverse of a positive matrix whose numbers are of any sizes, and the logarithm of its determinant.
fn inverse(matrix: DMatrix<f64>) -> Option<(DMatrix<f64>, f64)> {
    let lengths = matrix.diagonal().map(|d| d.max(0.0).sqrt());
    let sizes = &lengths * lengths.transpose();
    let factor = matrix.component_div(&sizes).cholesky()?;
    let diagonal = factor.l_dirty().diagonal();
    let ln_determinant = 2.0 * (diagonal.map(f64::ln).sum() + lengths.map(f64::ln).sum());
    Some((factor.inverse().component_div(&sizes), ln_determinant))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::linking::{LinkedSpots, Spot};
    use crate::flight::motion_model::VerticalPrior;
    use crate::flight::side_view::SideView;
    use crate::frames::Coded;
    use crate::geometry::PlanePoint;
    use crate::test_noise::TestNoise;

    /// An arc that lasts so long, whose place at each time (right, up) is moved by `moved`.
    fn arc(lasts_s: f64, moved: impl Fn(f64, f64) -> (f64, f64)) -> Flight {
        let mut random = TestNoise(7);
        let count = 60;
        let spots = (0..=count).map(|i| {
            let t = lasts_s * f64::from(i) / f64::from(count);
            let (right, up) = (100.0 + 500.0 * t, 2000.0 * t - 4900.0 * t * t);
            let (r, h) = moved(right, up);
            let noise = 0.02;
            Spot {
                id: i as usize,
                frame: i as usize,
                time_s: t,
                place: PlanePoint::new(
                    right + r + noise * random.normal(),
                    up + h + noise * random.normal(),
                ),
                std: noise,
                coded: Coded::Whole,
                radius: 10.0,
                contrast_grey: 80.0,
            }
        });
        let spots = LinkedSpots::new(spots.collect());
        crate::flight::find(&spots, &SideView::new(VerticalPrior::UNKNOWN)).expect("a ball flies")
    }

    /// A cause that neither an arc nor a slant nor a lift takes for itself.
    fn cause(right: f64, up: f64) -> (f64, f64) {
        let square = ((right - 200.0).powi(2) + (up - 100.0).powi(2)) / 300.0_f64.powi(2);
        (
            2.0 * square * (right - 200.0) / 300.0,
            2.0 * square * (up - 100.0) / 300.0,
        )
    }

    fn units(flight: &Flight) -> Shifts {
        let points = flight.fit_points();
        points.iter().map(|p| cause(p.sample.r, p.sample.h)).collect()
    }

    #[test]
    fn what_points_leave_of_a_cause_that_nobody_tells_of() {
        let of = |flight: &Flight| {
            let likely = likely(flight, &[units(flight)], 0.0, Vec::new());
            (likely.probabilities[0], likely.products[(0, 0)].sqrt())
        };
        // A long arc tells whether it is there, and how much.
        let (there, size) = of(&arc(0.4, |r, h| {
            let (a, b) = cause(r, h);
            (1.5 * a, 1.5 * b)
        }));
        assert!(there > 0.999 && (size - 1.5).abs() < 0.15, "{there} {size}");
        let (there, size) = of(&arc(0.4, |_, _| (0.0, 0.0)));
        assert!(there < 0.25 && size < 0.1, "{there} {size}");
        // A short one hardly does: either is as likely.
        let (there, size) = of(&arc(0.03, |_, _| (0.0, 0.0)));
        assert!((there - 0.5).abs() < 0.05, "{there}");
        assert!((size - std::f64::consts::FRAC_1_SQRT_2).abs() < 0.05, "{size}");
    }

    #[test]
    fn two_causes_that_look_alike_share_what_is_seen() {
        let flight = arc(0.4, cause);
        let both = likely(&flight, &[units(&flight), units(&flight)], 0.0, Vec::new());
        let sum = both.products.sum();
        assert!((sum - 1.0).abs() < 0.2, "{sum}");
        for k in 0..2 {
            assert!(
                (0.5..0.9).contains(&both.probabilities[k]),
                "{}",
                both.probabilities
            );
        }
        assert!(both.products[(0, 1)] < 0.2 * both.products[(0, 0)]);
    }

    #[test]
    fn an_estimate_is_what_there_is() {
        let flight = arc(0.4, cause);
        let found = estimate(&flight, units(&flight), Vec::new()).unwrap();
        let std = found.std_uncertainty.unwrap();
        assert!((found.value - 1.0).abs() < 3.0 * std && std < 0.3, "{found:?}");
    }
}
