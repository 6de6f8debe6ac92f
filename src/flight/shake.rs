//! What the arcs themselves show of a table that is bumped by the impact: right after it, and for some hundredths of a second,
//! the ball seems to leave its arc, along both axes as the picture swings.
//!
//! The end of each arc, long after its impact, says where its beginning should be. Points near the impact that are off that by
//! far more than the others scatter, while the end of an arc, said by its beginning, is not, are of a swing (a path that is no
//! parabola is off at both ends). Then points after every impact are as unsure as the swing is large and young: they stay in
//! the fit with what they are worth, and a last arc that is hardly longer than the swing has the uncertainty that it deserves.
//!
//! This is for what no edge of the scene shows ([`crate::detect::camera_swing`]).

use super::free_flight::{Flight, FlightPoint, SpotUse};
use crate::numeric::robust::std_from_magnitudes;

/// The swing after impacts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shake {
    /// How far the ball seems to be off its arc at most, plane units.
    pub size: f64,
    /// After which impact it was seen, s.
    pub impact_s: f64,
}

/// A swing is over after this, s.
const LASTS_S: f64 = 0.06;

/// It dies away by a factor e in so long, s: slower than most, so that its rest is not taken for the ball.
const DECAY_S: f64 = 0.03;

/// Points and time that the rest of an arc needs, to say where its beginning should be.
const LEAST_POINTS: usize = 8;
const LEAST_REST_S: f64 = 0.05;

/// Points in the swing.
const LEAST_EARLY: usize = 3;

/// A swing makes points scatter so many times more than the rest does, and more than they do at the other end of their arc, ...
const TIMES: f64 = 4.0;

/// ... and by this part of the ball's radius.
const LEAST_PART: f64 = 0.007;

/// The swing that the arcs of `flight` show after their impacts; `None` where they show none.
#[must_use]
pub fn find(flight: &Flight) -> Option<Shake> {
    if !flight.fit.falls_in_plane() {
        return None;
    }
    let least = LEAST_PART * flight.radius();
    let of_arc = |k: usize| -> Option<Shake> {
        let impact_s = (*flight.impacts.get(k.checked_sub(1)?)?)?;
        let mut after = offsets(flight, k, |t| t - impact_s);
        after.sort_by(|a, b| a.0.total_cmp(&b.0));
        let begins = beginning(&after)?;
        // The same from the other end, where there is no impact to swing after.
        let (_, end_s) = flight.spans[k];
        let mut before = offsets(flight, k, |t| end_s - t);
        before.retain(|p| end_s - p.0 > impact_s + LASTS_S);
        before.sort_by(|a, b| a.0.total_cmp(&b.0));
        let ends = beginning(&before).map_or(begins.noise, |b| b.rms.max(b.noise));
        let shows = begins.rms > TIMES * begins.noise && begins.rms > TIMES * ends && begins.rms > least;
        shows.then_some(Shake {
            size: begins.most,
            impact_s,
        })
    };
    (1..flight.fit.arcs())
        .filter_map(of_arc)
        .max_by(|a, b| a.size.total_cmp(&b.size))
}

/// The points of an arc with their distance in time by `since`, and how far they are off the fitted arc (along r, h).
fn offsets(flight: &Flight, k: usize, since: impl Fn(f64) -> f64) -> Vec<(f64, [f64; 2])> {
    let (from, to) = flight.spans[k];
    let impact = k.checked_sub(1).and_then(|i| flight.impacts[i]);
    // Frames of the contact itself are on no arc.
    let start = impact.map_or(from, |t| t + 0.5 * flight.interval_s);
    let of_arc = |p: &&FlightPoint| match p.use_ {
        SpotUse::Used(arc) => arc == k,
        SpotUse::Outlier(_) | SpotUse::Contact => p.spot.time_s > start && p.spot.time_s <= to,
        SpotUse::NotFree => false,
    };
    let off = |p: &FlightPoint| {
        let m = flight.fit.motion(k, p.spot.time_s);
        (
            since(p.spot.time_s),
            [p.spot.place.right - m.r, p.spot.place.up - m.h],
        )
    };
    let points = flight.points.iter().filter(of_arc).map(off);
    points.filter(|p| p.0 >= 0.0).collect()
}

/// How far the first points are off what the rest says.
struct StartOffsets {
    rms: f64,
    most: f64,
    noise: f64,
}

/// Of points in order of time from an end; `None` where the rest is too short to say.
fn beginning(points: &[(f64, [f64; 2])]) -> Option<StartOffsets> {
    let split = points.partition_point(|p| p.0 < LASTS_S);
    let (early, late) = points.split_at(split);
    let long = late.last()?.0 - late.first()?.0 > LEAST_REST_S;
    if early.len() < LEAST_EARLY || late.len() < LEAST_POINTS || !long {
        return None;
    }
    let n = late.len() as f64;
    let mean_t = late.iter().map(|p| p.0).sum::<f64>() / n;
    let spread = late.iter().map(|p| (p.0 - mean_t).powi(2)).sum::<f64>();
    let mut residuals = Vec::new();
    let mut off: Vec<[f64; 2]> = vec![[0.0; 2]; early.len()];
    for axis in 0..2 {
        let mean = late.iter().map(|p| p.1[axis]).sum::<f64>() / n;
        let slope = late
            .iter()
            .map(|p| (p.0 - mean_t) * (p.1[axis] - mean))
            .sum::<f64>()
            / spread;
        let line = |t: f64| mean + slope * (t - mean_t);
        residuals.extend(late.iter().map(|p| (p.1[axis] - line(p.0)).abs()));
        for (o, p) in off.iter_mut().zip(early) {
            // What the line itself does not know of that place counts for less.
            let unsure = (1.0 + 1.0 / n + (p.0 - mean_t).powi(2) / spread).sqrt();
            o[axis] = (p.1[axis] - line(p.0)) / unsure;
        }
    }
    let noise = std_from_magnitudes(&mut residuals).unwrap_or(0.0);
    let sizes: Vec<f64> = off.iter().map(|o| o[0].hypot(o[1])).collect();
    let square = sizes.iter().map(|s| s * s).sum::<f64>() / sizes.len() as f64;
    Some(StartOffsets {
        rms: (0.5 * square).sqrt(),
        most: sizes.iter().copied().fold(0.0, f64::max),
        noise,
    })
}

impl Flight {
    /// The flight with its points after impacts as unsure as `shake` makes them.
    #[must_use]
    pub fn shaken_by(&self, shake: &Shake) -> Option<Self> {
        let mut points = self.points.clone();
        for p in &mut points {
            let since = |t: &f64| p.spot.time_s - t;
            let young = self.impacts.iter().flatten().map(since).filter(|s| *s >= 0.0);
            if let Some(since) = young.min_by(f64::total_cmp) {
                let more = shake.size * (-since / DECAY_S).exp();
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
        let mut random = TestNoise(seed);
        let mut noise = || 0.03 * random.normal();
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
                    std: 0.03,
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
