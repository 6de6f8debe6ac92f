//! What the arcs themselves show of a table that is bumped by the impact: right after it, and for some hundredths of a second,
//! the ball seems to leave its arc, along both axes as the picture swings.
//!
//! Hypotheses compete for the points behind each impact: a smooth path, or that with a swing exp(−t/τ) (a sin ωt + b cos ωt) along both axes, t being
//! the time since the impact, ω and τ the same after all. The path is the arc and a cubic in time, so that neither drag nor a scale that changes is taken for a swing;
//! or one with two powers more, as many numbers as a swing has: what a view at a slant leaves of a long arc is as smooth as a slow swing. The
//! likelihood tells, with the centres' scatter found anew for each and a price for every number. Then points after every impact are as unsure as the
//! swing is large and young: they stay in the fit with what they are worth, and a last arc that is hardly longer than the swing has the uncertainty
//! that it deserves.
//!
//! Assumed: a swing begins with an impact and has one frequency and one decay. One that has more is found by the strongest, and is as unsure as that.
//!
//! This is for what no edge of the scene shows ([`crate::detect::camera_swing`]).

use super::free_flight::{Flight, FlightPoint, SpotUse};
use nalgebra::{DMatrix, DVector};

/// The swing after impacts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shake {
    /// How far the ball seems to be off its arc at most, plane units.
    pub size: f64,
    /// After which impact it was seen, s.
    pub impact_s: f64,
    /// It dies away by a factor e in so long, s.
    pub decay_s: f64,
    /// Swings a second.
    pub frequency_hz: f64,
}

/// Frequencies that are tried, Hz: those of tables and tripods.
const FREQUENCIES_HZ: [f64; 9] = [6.0, 8.0, 11.0, 15.0, 20.0, 27.0, 36.0, 48.0, 64.0];

/// The same for the time in which it dies away by a factor e, s.
const DECAYS_S: [f64; 6] = [0.008, 0.012, 0.018, 0.027, 0.04, 0.06];

/// A camera that takes fewer frames than this a swing, or a decay, does not show it.
const LEAST_FRAMES: f64 = 2.5;

/// An arc shows a swing against what it is afterwards, and lasts so many times the decay at least, with so many points.
const LEAST_DECAYS: f64 = 3.0;
const LEAST_POINTS: usize = 12;

/// Points that were left out for being off their arc may be those of a swing for so many decays.
const LEFT_OUT_DECAYS: f64 = 3.0;

/// By how much a swing must be likelier than none, in −2 ln L beside the price of its numbers: odds of a hundred and fifty to one.
const LEAST_GAIN: f64 = 10.0;

/// Powers of time in a smooth path, and in one that has as many numbers as a swing more.
const PATH: usize = 4;
const SMOOTH_PATH: usize = PATH + SWING;

/// Numbers of a swing along one axis.
const SWING: usize = 2;

/// The swing that the arcs of `flight` show after their impacts; `None` where they show none.
#[must_use]
pub fn find(flight: &Flight) -> Option<Shake> {
    if !flight.fit.falls_in_plane() {
        return None;
    }
    let frames = |period_s: f64| period_s / flight.interval_s;
    let frequencies = FREQUENCIES_HZ.iter().filter(|&&f| frames(1.0 / f) > LEAST_FRAMES);
    let tried = frequencies.flat_map(|&f| DECAYS_S.map(|decay_s| (f, decay_s)));
    let tried = tried.filter(|(_, decay_s)| frames(*decay_s) > LEAST_FRAMES);
    let seen = tried.filter_map(|(f, decay_s)| swing(flight, f, decay_s));
    let (gain, shake) = seen.max_by(|a, b| a.0.total_cmp(&b.0))?;
    let price = LEAST_GAIN + 2.0 * ((FREQUENCIES_HZ.len() * DECAYS_S.len()) as f64).ln();
    (gain > price).then_some(shake)
}

/// The likeliest swing of this frequency and decay, and by how much it is likelier than none, or a smooth path, in −2 ln L less the price of its numbers.
fn swing(flight: &Flight, frequency_hz: f64, decay_s: f64) -> Option<(f64, Shake)> {
    let (mut coordinates, mut numbers) = (0, 0);
    let (mut plain, mut smooth, mut swinging) = (0.0, 0.0, 0.0);
    let mut largest: Option<(f64, f64)> = None;
    let mut lasting = Lasting::default();
    for (k, impact) in flight.impacts.iter().enumerate() {
        let Some(impact_s) = *impact else { continue };
        let points = points_after(flight, k + 1, impact_s, LEFT_OUT_DECAYS * decay_s);
        let Some(last) = points.last() else { continue };
        let lasts_s = last.spot.time_s - impact_s;
        if points.len() < LEAST_POINTS || lasts_s < LEAST_DECAYS * decay_s {
            continue;
        }
        let since = |i: usize| points[i].spot.time_s - impact_s;
        let weight = |i: usize| 1.0 / flight.extra.variance_of(&points[i].spot).sqrt();
        let path = DMatrix::from_fn(points.len(), SMOOTH_PATH, |i, power| {
            weight(i) * (since(i) / lasts_s).powi(power as i32)
        });
        let turn = |i: usize| std::f64::consts::TAU * frequency_hz * since(i);
        let dies = |i: usize| (-since(i) / decay_s).exp();
        let swings = DMatrix::from_fn(points.len(), SWING, |i, which| {
            weight(i) * dies(i) * if which == 0 { turn(i).sin() } else { turn(i).cos() }
        });
        // The first columns are those of the first powers.
        let along_smooth = path.qr().q();
        let along = along_smooth.columns(0, PATH);
        let beside = |m: DMatrix<f64>| &m - along * (along.transpose() * &m);
        let places = DMatrix::from_fn(points.len(), 2, |i, axis| {
            let (place, arc) = (
                points[i].spot.place,
                flight.fit.motion(k + 1, points[i].spot.time_s),
            );
            weight(i)
                * if axis == 0 {
                    place.right - arc.r
                } else {
                    place.up - arc.h
                }
        });
        smooth += (&places - &along_smooth * (along_smooth.transpose() * &places)).norm_squared();
        let (places, basis) = (beside(places), beside(swings));
        let amplitudes = (basis.transpose() * &basis).try_inverse()? * basis.transpose() * &places;
        let left = &places - &basis * &amplitudes;
        plain += places.norm_squared();
        swinging += left.norm_squared();
        coordinates += 2 * points.len();
        numbers += 2 * SWING;
        lasting.take(&left);
        let off = |i: usize| {
            let wave = DVector::from_vec(vec![turn(i).sin(), turn(i).cos()]);
            dies(i) * (amplitudes.transpose() * wave).norm()
        };
        let most = (0..points.len()).map(off).fold(0.0, f64::max);
        if largest.is_none_or(|(size, _)| most > size) {
            largest = Some((most, impact_s));
        }
    }
    let (size, impact_s) = largest?;
    let count = coordinates as f64;
    let than = |other: f64| count * (other / swinging).ln() / lasting.inflation();
    let gain = (than(plain) - numbers as f64 * count.ln()).min(than(smooth));
    gain.is_finite().then_some((
        gain,
        Shake {
            size,
            impact_s,
            decay_s,
            frequency_hz,
        },
    ))
}

/// The points of arc `k` behind its impact, and those that were left out for no longer than `left_out_s`; frames of the contact itself are on no arc.
fn points_after(flight: &Flight, k: usize, impact_s: f64, left_out_s: f64) -> Vec<&FlightPoint> {
    let (_, to) = flight.spans[k];
    let is_behind = |p: &&FlightPoint| {
        let since = p.spot.time_s - impact_s;
        match p.use_ {
            SpotUse::Used(arc) => arc == k,
            SpotUse::Outlier(_) | SpotUse::NotFree => {
                since > 0.5 * flight.interval_s && since < left_out_s && p.spot.time_s <= to
            }
            SpotUse::Contact => false,
        }
    };
    flight.points.iter().filter(is_behind).collect()
}

/// What lasts of residuals from point to point.
#[derive(Default)]
struct Lasting {
    product: f64,
    square: f64,
}

impl Lasting {
    fn take(&mut self, residuals: &DMatrix<f64>) {
        for column in residuals.column_iter() {
            self.square += column.norm_squared();
            let pairs = column.iter().zip(column.iter().skip(1));
            self.product += pairs.map(|(a, b)| a * b).sum::<f64>();
        }
    }

    /// So many points count for one.
    fn inflation(&self) -> f64 {
        let rho = (self.product / self.square).clamp(0.0, MOST_CORRELATED);
        (1.0 + rho) / (1.0 - rho)
    }
}

/// At this correlation ten points count for one.
const MOST_CORRELATED: f64 = 0.8;

impl Flight {
    /// The flight with its points after impacts as unsure as `shake` makes them.
    ///
    /// What is off in one direction for a quarter of a swing counts as much as so many frames that are each off by themselves.
    #[must_use]
    pub fn shaken_by(&self, shake: &Shake) -> Option<Self> {
        let together = (0.25 / (shake.frequency_hz * self.interval_s)).max(1.0).sqrt();
        let mut points = self.points.clone();
        for p in &mut points {
            let since = |t: &f64| p.spot.time_s - t;
            let young = self.impacts.iter().flatten().map(since).filter(|s| *s >= 0.0);
            if let Some(since) = young.min_by(f64::total_cmp) {
                let more = together * shake.size * (-since / shake.decay_s).exp();
                p.spot.std = p.spot.std.hypot(more);
            }
        }
        self.refitted(points, &*self.fit.model)
    }
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

    /// A ball that bounces at 0.2025 s with e = 0.8, filmed at 240 Hz for 0.45 s; the picture swings by `size` from then on.
    fn spots(size: f64, seed: u64) -> Vec<Spot> {
        spots_to(0.03, size, seed)
    }

    /// The same with centres that scatter by `std`.
    fn spots_to(std: f64, size: f64, seed: u64) -> Vec<Spot> {
        let mut random = TestNoise(seed);
        let mut noise = || std * random.normal();
        let g = 12_000.0;
        (0..108)
            .map(|frame| {
                let time_s = frame as f64 / 240.0;
                let s = time_s - 0.2025;
                let h = if s < 0.0 {
                    -2430.0 * s - 0.5 * g * s * s
                } else {
                    1944.0 * s - 0.5 * g * s * s
                };
                let swing = if s < 0.0 {
                    0.0
                } else {
                    size * (125.0 * s).sin() * (-s / 0.015).exp()
                };
                Spot {
                    id: frame,
                    frame,
                    time_s,
                    place: PlanePoint::new(1000.0 * time_s + 0.5 * swing + noise(), h + swing + noise()),
                    std,
                    coded: Coded::Whole,
                    radius: 15.0,
                    contrast_grey: 100.0,
                }
            })
            .collect()
    }

    fn flight(size: f64, seed: u64) -> Flight {
        crate::flight::find(
            &LinkedSpots::new(spots(size, seed)),
            &SideView::new(VerticalPrior::LEVEL_CAMERA),
        )
        .unwrap()
    }

    #[test]
    fn a_swing_after_the_impact_is_seen_and_a_steady_picture_has_none() {
        for seed in 0..20 {
            assert_eq!(find(&flight(0.0, 3 + seed)), None);
            let found = find(&flight(2.0, 3 + seed)).expect("a swing");
            assert!((0.4..2.5).contains(&found.size), "{found:?}");
        }
    }

    /// The same seen with a scale that grows by 3 % as the ball goes to the right.
    fn slanted(size: f64, seed: u64) -> Flight {
        let mut spots = spots(size, seed);
        for s in &mut spots {
            let scale = 1.0 + 0.03 * s.place.right / 450.0;
            s.place = PlanePoint::new(s.place.right * scale, s.place.up * scale);
        }
        let side = SideView::new(VerticalPrior::LEVEL_CAMERA);
        crate::flight::find(&LinkedSpots::new(spots), &side).unwrap()
    }

    #[test]
    fn a_scale_that_changes_is_no_swing_and_hides_none() {
        for seed in 0..20 {
            assert_eq!(find(&slanted(0.0, 70 + seed)), None);
            assert!(find(&slanted(1.5, 70 + seed)).is_some());
        }
    }

    #[test]
    fn what_a_steep_slant_leaves_of_exact_centres_is_no_swing() {
        for seed in 0..10 {
            let mut spots = spots_to(0.005, 0.0, 90 + seed);
            for s in &mut spots {
                // A camera three widths of the path away that looks at the plane 30 degrees from square.
                let scale = 1.0 / (1.0 + 0.5 * (s.place.right - 225.0) / 1350.0);
                s.place = PlanePoint::new(s.place.right * scale, s.place.up * scale);
            }
            let side = SideView::new(VerticalPrior::LEVEL_CAMERA);
            let flight = crate::flight::find(&LinkedSpots::new(spots), &side).unwrap();
            assert_eq!(find(&flight), None);
        }
    }

    #[test]
    fn with_its_shaken_points_less_sure_the_restitution_is_right() {
        for seed in 0..20 {
            let shaken = flight(2.0, 40 + seed);
            let better = shaken.shaken_by(&find(&shaken).unwrap()).unwrap();
            let t = better
                .fit
                .impact_time(better.fit.parameters.as_slice(), 0)
                .unwrap();
            let e = -better.fit.motion(1, t).vh / better.fit.motion(0, t).vh;
            assert!((e - 0.8).abs() < 1.5e-3, "{e}");
        }
    }
}
