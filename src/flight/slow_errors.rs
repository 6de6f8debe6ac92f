//! Errors of the centres that change slowly along an arc.
//!
//! A codec keeps what it has drawn of the ball from frame to frame, and light and background change little between neighbouring places. Such an
//! error draws places, velocities and curvatures of an arc as a true motion would: it leaves residuals that look like noise, with
//! a little more in their slow parts than in their fast ones. By the first of these alone uncertainties would be too small.
//!
//! Model: along an arc each coordinate has white noise and, of a variance of its own, an error with the correlation exp(−|Δt|/τ). Seen in
//! orthogonal polynomials over the arc's points, the coefficient of order k has the variance
//!
//! ```text
//! λ_k = w (1 + a κ_k(τ)),    κ_k = q_kᵀ K q_k,    K_ij = exp(−|t_i − t_j| / τ)
//! ```
//!
//! Arcs take orders 0 to 2 (place, velocity, curvature) for motion; those above tell a and τ: their likelihood, coefficients taken as independent, over
//! a grid of τ and of a, with the white level w of the greatest likelihood for each. Beforehand, no such error is as likely as some, and all sizes on the grid are alike;
//! the noise of the pixels is white, so that the sizes are parts of the scatter beyond it.
//! What orders 0 to 2 are then expected to have beyond what the fit's covariance says is added to it.
//!
//! Assumed: one size and one duration for all arcs and both coordinates. Arcs of a few frames have no higher orders; where there are none at all, nothing is added.

use super::Flight;
use super::motion_model::FitPoint;
use nalgebra::{DMatrix, DVector};

/// Orders that the arcs take for motion.
const MOTION_ORDERS: usize = 3;

/// Orders looked at one by one; those above are taken together.
const MOST_ORDERS: usize = 16;

/// Durations of slow errors, frames.
const DURATIONS: [f64; 5] = [1.5, 3.0, 6.0, 12.0, 24.0];

/// What slow errors add to the variance of an arc's velocity, in parts of what white noise gives it, where nothing of the centres' scatter is by the pixels' own noise.
const SIZES: [f64; 7] = [0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0];

/// Coefficients above the motion's that a likelihood needs.
const LEAST_COEFFICIENTS: usize = 4;

/// The points of one arc in orthogonal polynomials.
struct ArcSpectrum {
    /// Which of the flight's points.
    points: Vec<usize>,
    /// Orthonormal columns of whitened coordinates, an order each.
    orders: DMatrix<f64>,
    /// κ of each order, for each of [`DURATIONS`], and the mean of those above.
    kappas: Vec<(Vec<f64>, f64)>,
    /// Squares of each coordinate's coefficients, and the sum of those above all orders.
    energies: [(Vec<f64>, f64); 2],
}

impl ArcSpectrum {
    /// `None` where the points are no more than the motion takes.
    fn new(points: &[FitPoint], own: Vec<usize>, residuals: &[(f64, f64)], interval_s: f64) -> Option<Self> {
        let count = own.len();
        if count <= MOTION_ORDERS || !(interval_s > 0.0) {
            return None;
        }
        let times: Vec<f64> = own.iter().map(|&i| points[i].sample.t).collect();
        let weights: Vec<f64> = own.iter().map(|&i| points[i].sample.weight).collect();
        let mean_weight = weights.iter().sum::<f64>() / count as f64;
        let whitened: Vec<f64> = weights.iter().map(|w| (w / mean_weight).sqrt()).collect();
        let (first, last) = (times[0], times[count - 1]);
        let columns = count.min(MOST_ORDERS);
        let mut legendre = DMatrix::zeros(count, columns);
        for (row, (t, w)) in times.iter().zip(&whitened).enumerate() {
            let x = (2.0 * t - first - last) / (last - first).max(f64::MIN_POSITIVE);
            let (mut before, mut now) = (0.0, 1.0);
            for order in 0..columns {
                legendre[(row, order)] = w * now;
                let k = order as f64;
                (before, now) = (now, ((2.0 * k + 1.0) * x * now - k * before) / (k + 1.0));
            }
        }
        let orders = legendre.qr().q();
        let kappas = DURATIONS
            .iter()
            .map(|frames| {
                let of = |k: usize| {
                    let x: Vec<f64> = orders
                        .column(k)
                        .iter()
                        .zip(&whitened)
                        .map(|(q, w)| q * w)
                        .collect();
                    correlated(&times, &x, frames * interval_s)
                };
                let all: Vec<f64> = (0..columns).map(of).collect();
                let trace: f64 = whitened.iter().map(|w| w * w).sum();
                let above = (trace - all.iter().sum::<f64>()).max(0.0);
                let mean_above = above / (count - columns).max(1) as f64;
                (all, mean_above)
            })
            .collect();
        let energy = |coordinate: fn(&(f64, f64)) -> f64| {
            let whole = DVector::from_iterator(count, own.iter().map(|&i| coordinate(&residuals[i])));
            let coefficients = orders.tr_mul(&whole);
            let squares: Vec<f64> = coefficients.iter().map(|c| c * c).collect();
            let above = whole.norm_squared() - squares.iter().sum::<f64>();
            (squares, above.max(0.0))
        };
        let energies = [energy(|r| r.0), energy(|r| r.1)];
        let finite = orders
            .iter()
            .chain(&energies[0].0)
            .chain(&energies[1].0)
            .all(|x| x.is_finite());
        finite.then_some(Self {
            points: own,
            orders,
            kappas,
            energies,
        })
    }

    /// Number of coefficients of one coordinate above the motion's, those looked at one by one and the rest.
    fn coefficients(&self) -> (usize, usize) {
        let columns = self.orders.ncols();
        (columns - MOTION_ORDERS, self.points.len() - columns)
    }

    /// Of each order above the motion's: how many coefficients, their energy, κ for the duration `d`.
    fn above(&self, d: usize) -> impl Iterator<Item = (f64, f64, f64)> {
        let (kappas, rest_kappa) = &self.kappas[d];
        let rest = self.coefficients().1 as f64;
        self.energies.iter().flat_map(move |(squares, rest_energy)| {
            let single = squares.iter().zip(kappas).skip(MOTION_ORDERS);
            let single = single.map(|(energy, kappa)| (1.0, *energy, *kappa));
            single.chain((rest > 0.0).then_some((rest, *rest_energy, *rest_kappa)))
        })
    }
}

/// xᵀ K x with K_ij = exp(−|t_i − t_j| / τ), in one pass.
fn correlated(times: &[f64], x: &[f64], tau_s: f64) -> f64 {
    let (mut before, mut sum) = (0.0, 0.0);
    for (i, value) in x.iter().enumerate() {
        if i > 0 {
            before *= (-(times[i] - times[i - 1]).abs() / tau_s).exp();
        }
        sum += value * value + 2.0 * value * before;
        before += value;
    }
    sum
}

/// A duration and a size of slow errors, the white level that goes with them, and how likely they are.
struct Candidate {
    duration: usize,
    /// a.
    part: f64,
    white: f64,
    ln_likelihood: f64,
}

impl Candidate {
    fn new(arcs: &[ArcSpectrum], duration: usize, part: f64, ln_prior: f64) -> Self {
        let all = || arcs.iter().flat_map(move |arc| arc.above(duration));
        let count: f64 = all().map(|(n, _, _)| n).sum();
        let white = all().map(|(_, e, kappa)| e / (1.0 + part * kappa)).sum::<f64>() / count;
        let spread: f64 = all().map(|(n, _, kappa)| n * (part * kappa).ln_1p()).sum();
        Self {
            duration,
            part,
            white,
            ln_likelihood: ln_prior - 0.5 * (spread + count * white.max(f64::MIN_POSITIVE).ln()),
        }
    }
}

/// Every duration and size, of a scatter of which `beyond_noise` is not by the pixels' own noise, weighted by how likely it is; weights sum to 1.
fn candidates(arcs: &[ArcSpectrum], beyond_noise: f64) -> Vec<(Candidate, f64)> {
    let ln_prior = -((DURATIONS.len() * SIZES.len()) as f64).ln();
    let mut all = vec![Candidate::new(arcs, 0, 0.0, 0.0)];
    for d in 0..DURATIONS.len() {
        let of_velocity = arcs.iter().map(|arc| arc.kappas[d].0[1]).sum::<f64>() / arcs.len() as f64;
        let parts = SIZES.iter().map(|size| size * beyond_noise / of_velocity);
        all.extend(parts.map(|part| Candidate::new(arcs, d, part, ln_prior)));
    }
    let best = all
        .iter()
        .map(|c| c.ln_likelihood)
        .fold(f64::NEG_INFINITY, f64::max);
    let weight = |c: &Candidate| (c.ln_likelihood - best).exp();
    let sum: f64 = all.iter().map(weight).sum();
    all.into_iter()
        .map(|c| {
            let part = weight(&c) / sum;
            (c, part)
        })
        .collect()
}

impl Flight {
    /// The part of the centres' variance that is not by the pixels' own noise.
    fn scatter_beyond_noise(&self) -> f64 {
        let by_noise = self.used_points().map(|p| {
            let own = p.spot.std * p.spot.std;
            own * self.extra.fit_point(&p.spot, 0).sample.weight
        });
        (1.0 - by_noise.sum::<f64>() / self.used().max(1) as f64).clamp(0.0, 1.0)
    }

    /// The same with errors that change slowly along an arc in the covariance of its arcs.
    #[must_use]
    pub fn with_slow_errors(mut self) -> Self {
        let points = self.fit_points();
        let residuals: Vec<(f64, f64)> = points
            .iter()
            .map(|p| {
                let (m, w) = (self.fit.motion(p.arc, p.sample.t), p.sample.weight.sqrt());
                (w * (p.sample.r - m.r), w * (p.sample.h - m.h))
            })
            .collect();
        let own = |k: usize| (0..points.len()).filter(|&i| points[i].arc == k).collect();
        let arcs: Vec<ArcSpectrum> = (0..self.fit.arcs())
            .filter_map(|k| ArcSpectrum::new(&points, own(k), &residuals, self.interval_s))
            .collect();
        let coefficients = arcs
            .iter()
            .map(|arc| 2 * (arc.coefficients().0 + arc.coefficients().1));
        if coefficients.sum::<usize>() < LEAST_COEFFICIENTS {
            return self;
        }
        let likely = candidates(&arcs, self.scatter_beyond_noise());
        let known = self.fit.reduced_chi.max(1.0).powi(2) * self.fit.autocorrelation_inflation;
        for arc in &arcs {
            for order in 0..MOTION_ORDERS {
                let variance: f64 = likely
                    .iter()
                    .map(|(c, part)| part * c.white * (1.0 + c.part * arc.kappas[c.duration].0[order]))
                    .sum();
                if variance <= known {
                    continue;
                }
                let std = (variance - known).sqrt();
                for along_r in [true, false] {
                    let mut shifts = vec![(0.0, 0.0); points.len()];
                    for (row, &i) in arc.points.iter().enumerate() {
                        let shift = std * arc.orders[(row, order)] / points[i].sample.weight.sqrt();
                        shifts[i] = if along_r { (shift, 0.0) } else { (0.0, shift) };
                    }
                    self.fit.widen(&points, &shifts);
                }
            }
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight;
    use crate::flight::linking::{LinkedSpots, Spot};
    use crate::flight::motion_model::VerticalPrior;
    use crate::flight::planar::ARCS;
    use crate::flight::segment::TrackSample;
    use crate::flight::side_view::SideView;
    use crate::frames::Coded;
    use crate::geometry::PlanePoint;
    use crate::test_noise::TestNoise;

    const FRAMES: usize = 40;
    const STD: f64 = 0.2;
    const SPEED: (f64, f64) = (90.0, -20.0);

    /// An arc of a ball at 100 frames a second, 980 units/s², with white noise, of which the pixels know `known`, and an error that lasts `frames` of the standard
    /// deviation `slow`.
    fn arc(slow: f64, frames: f64, known: f64, random: &mut TestNoise) -> Flight {
        let stays = (-1.0 / frames).exp();
        let mut drift = [slow * random.normal(), slow * random.normal()];
        let spots = (0..FRAMES).map(|i| {
            let t = (i as f64 - 0.5 * (FRAMES - 1) as f64) / 100.0;
            let right = SPEED.0 * t + drift[0] + STD * random.normal();
            let up = SPEED.1 * t - 490.0 * t * t + drift[1] + STD * random.normal();
            for d in &mut drift {
                *d = stays * *d + slow * (1.0 - stays * stays).sqrt() * random.normal();
            }
            Spot {
                id: i,
                frame: i,
                time_s: i as f64 / 100.0,
                place: PlanePoint::new(500.0 + right, 300.0 + up),
                std: known * STD,
                coded: Coded::Whole,
                radius: 10.0,
                contrast_grey: 80.0,
            }
        });
        let view = SideView::new(VerticalPrior::UNKNOWN);
        flight::find(&LinkedSpots::new(spots.collect()), &view).expect("a ball flies")
    }

    /// Mean squares of what the velocities are off by over their standard uncertainties, without and with slow errors.
    fn squared_pulls(slow: f64, frames: f64, known: f64) -> [f64; 2] {
        let mut random = TestNoise(17);
        let mut sums = [0.0; 2];
        for _ in 0..120 {
            let found = arc(slow, frames, known, &mut random);
            for (sum, flight) in sums.iter_mut().zip([found.clone(), found.with_slow_errors()]) {
                for (place, truth) in [(ARCS + 1, SPEED.0), (ARCS + 3, SPEED.1)] {
                    let off = flight.fit.parameters[place] - truth;
                    *sum += off * off / flight.fit.covariance[(place, place)] / 240.0;
                }
            }
        }
        sums
    }

    #[test]
    fn noise_of_the_pixels_stays_what_it_is() {
        let [before, after] = squared_pulls(0.0, 1.0, 1.0);
        assert!((before - 1.0).abs() < 0.3, "{before}");
        assert!(after > 0.9 * before, "{after} of {before}");
    }

    #[test]
    fn of_white_scatter_half_the_variance_may_be_doubted() {
        let [before, after] = squared_pulls(0.0, 1.0, 0.3);
        assert!(after > 0.5 * before, "{after} of {before}");
    }

    #[test]
    fn errors_that_last_are_in_the_uncertainty() {
        for (frames, most) in [(6.0, 1.6), (15.0, 2.5)] {
            let [before, after] = squared_pulls(0.12, frames, 0.3);
            assert!(before > 1.8, "{before}: the test's errors do not matter");
            assert!(
                after < 0.65 * before && (0.5..most).contains(&after),
                "{after} of {before}"
            );
        }
    }

    #[test]
    fn arcs_of_few_frames_stay_as_they_are() {
        let times: Vec<f64> = (0..3).map(f64::from).collect();
        let point = |t: &f64| FitPoint {
            arc: 0,
            sample: TrackSample::new(*t, (0.0, 0.0), 1.0),
        };
        let points: Vec<FitPoint> = times.iter().map(point).collect();
        assert!(ArcSpectrum::new(&points, vec![0, 1, 2], &[(0.0, 0.0); 3], 1.0).is_none());
    }

    #[test]
    fn the_sum_over_all_pairs_is_taken_in_one_pass() {
        let (times, x) = ([0.0, 0.1, 0.25, 0.7], [0.4, -1.0, 2.0, 0.3]);
        let pair = |i: usize, j: usize| x[i] * x[j] * (-f64::abs(times[i] - times[j]) / 0.2).exp();
        let all: f64 = (0..4)
            .flat_map(|i| (0..4).map(move |j| (i, j)))
            .map(|(i, j)| pair(i, j))
            .sum();
        assert!((correlated(&times, &x, 0.2) - all).abs() < 1e-12);
    }
}
