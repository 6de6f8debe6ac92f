//! Frames that are missing without a trace in the time stamps: dropped by a camera or an editor that then numbered the
//! rest anew.
//!
//! They show in what moves: on a parabola the step over n missing frames is n + 1 times the mean of the steps before and after it,
//! whatever the fall, and no step without a gap is. At 20 Hz neighbouring steps differ by half of themselves, so they need not be
//! alike. Noise and impacts look like that now and then: [`proposed`] names places, the likelihood of the clock
//! ([`super::clock`]) decides.
//!
//! Frames that are missing at an impact show in its arcs. Numbered too early by τ, the arc after it runs past the one
//! before it, by τ (v × v')/|v' − v| where they are nearest: they meet only when it is moved back by that time. A τ of
//! whole frames is of frames that are missing; where the ball falls straight down, v × v' is 0 and nothing shows.

use super::free_flight::{Flight, FlightPoint};
use super::linking::{LinkedSpots, Spot};
use super::path;
use super::planar::PlanarArcs;
use super::samples::scatter_seen;
use crate::numeric::propagation::InputQuantities;
use crate::numeric::robust::median;
use nalgebra::Vector2;

/// A place where frames are missing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DroppedFrames {
    /// The first frame after the gap.
    pub frame: usize,
    /// How many are missing; below 0, how many fewer than the clock has put in there.
    pub missing: isize,
}

/// A step is a whole number of steps to this many standard deviations, and not one step by as many.
const CLEAR_SIGMAS: f64 = 4.0;

/// More than this is no dropped frame but a cut.
const MOST_MISSING: f64 = 30.0;

/// Spots that scatter by less than this part of what they say are lucky ones.
const LEAST_PART_SEEN: f64 = 0.1;

/// Shorter tracks are not asked.
const LEAST_TRACK: usize = 6;

/// Where frames may be missing by the `linked` spots of all frames (in time order, duplicates left out), whose frames stand `interval_s`
/// apart: the clearest first, no place twice.
#[must_use]
pub fn proposed(linked: &LinkedSpots, interval_s: f64) -> Vec<DroppedFrames> {
    let mut found: Vec<(f64, DroppedFrames)> = Vec::new();
    for track in linked.tracks.iter().filter(|t| t.len() >= LEAST_TRACK) {
        let part = part_seen(&linked.of(track));
        let missing = |w: &[usize]| missing([0, 1, 2, 3].map(|k| &linked.spots[w[k]]), interval_s, part);
        found.extend(track.windows(4).filter_map(missing));
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut places: Vec<DroppedFrames> = Vec::new();
    for (_, place) in found {
        if places.iter().all(|p| p.frame != place.frame) {
            places.push(place);
        }
    }
    places
}

/// What the spots of a track scatter by over what they say, where that is less.
fn part_seen(track: &[Spot]) -> f64 {
    let mut stds: Vec<f64> = track.iter().map(|s| path::variance(s).sqrt()).collect();
    let parts = median(&mut stds).zip(scatter_seen(track));
    parts.map_or(1.0, |(stated, seen)| (seen / stated).clamp(LEAST_PART_SEEN, 1.0))
}

/// The frames that the middle step of four spots in a row lacks, with the standard deviations by which it is no single step. The spots scatter
/// by `part` of what they say.
fn missing(s: [&Spot; 4], interval_s: f64, part: f64) -> Option<(f64, DroppedFrames)> {
    let steps = [0, 1, 2].map(|k| step(s[k], s[k + 1]));
    let lasts = |k: usize| ((s[k + 1].time_s - s[k].time_s) / interval_s).round();
    if [0, 1, 2].iter().any(|&k| lasts(k) != 1.0) {
        return None;
    }
    let usual = 0.5 * (steps[0] + steps[2]);
    let std = s
        .map(|p| path::variance(p).sqrt())
        .into_iter()
        .fold(0.0, f64::max)
        * part;
    // By least squares along both axes.
    let times = steps[1].dot(&usual) / usual.norm_squared();
    let lost = (times - 1.0).round();
    if !(1.0..=MOST_MISSING).contains(&lost) {
        return None;
    }
    // Of b − m (a + c)/2 for independent places: two of m/2, two of 1 + m/2.
    let off = |m: f64| {
        let share = 0.5 * m;
        (steps[1] - m * usual).norm() / (std * (2.0 * (share * share + (1.0 + share).powi(2))).sqrt())
    };
    let (whole, single) = (off(lost + 1.0), off(1.0));
    let place = DroppedFrames {
        frame: s[2].frame,
        missing: lost as isize,
    };
    (whole < CLEAR_SIGMAS && single > CLEAR_SIGMAS).then_some((single, place))
}

/// What is missing at an impact is whole frames to this part of one, with so many standard uncertainties of it.
const WHOLE_FRAME_PART: f64 = 0.2;
const WHOLE_FRAME_SIGMAS: f64 = 3.0;

/// And differs from none by this many.
const LEAST_LATE_SIGMAS: f64 = 12.0;

/// Finds gaps at the impacts on the floor of a `flight`, and those that hold fewer frames than its clock has put in.
#[must_use]
pub fn at_impacts(flight: &Flight) -> Vec<DroppedFrames> {
    if !flight.fit.falls_in_plane() {
        return Vec::new();
    }
    let gap = |k: usize| {
        let (late_s, std_s) = late(flight, k)?;
        let (periods, std) = (late_s / flight.interval_s, std_s / flight.interval_s);
        let whole = (periods - periods.round()).abs() < WHOLE_FRAME_PART
            && WHOLE_FRAME_SIGMAS * std < WHOLE_FRAME_PART;
        let clear = periods.abs() > LEAST_LATE_SIGMAS * std && periods.abs() < MOST_MISSING;
        let missing = periods.round() as isize;
        if !(whole && clear && missing != 0) {
            return None;
        }
        let first = flight.points.iter().position(|p| p.arc() == Some(k + 1))?;
        if missing > 0 {
            let frame = flight.points[first].spot.frame;
            return Some(DroppedFrames { frame, missing });
        }
        // What was put in too many was put in between the two arcs, or it is not that.
        let last = flight.points.iter().rposition(|p| p.arc() == Some(k))?;
        let put_in = |w: &&[FlightPoint]| {
            let [from, to] = [&w[0].spot, &w[1].spot];
            let steps = (to.time_s - from.time_s) / flight.interval_s;
            steps - (to.frame - from.frame) as f64 > -periods - WHOLE_FRAME_PART
        };
        let frame = flight.points[last..=first].windows(2).find(put_in)?[1].spot.frame;
        Some(DroppedFrames { frame, missing })
    };
    (0..flight.impacts.len()).filter_map(gap).collect()
}

/// Time by which arc `k + 1` must be moved back for it to meet arc `k`, and its standard uncertainty, s; `None` where that is
/// no impact on the floor, or nothing tells.
fn late(flight: &Flight, k: usize) -> Option<(f64, f64)> {
    let t = flight.impacts[k]?;
    let fit = &flight.fit;
    let (m, n) = (fit.motion(k, t), fit.motion(k + 1, t));
    if !(m.vh < 0.0 && n.vh > 0.0) {
        return None;
    }
    let inputs = InputQuantities {
        values: fit.parameters.clone(),
        covariance: fit.covariance.clone(),
    };
    let late = inputs
        .outputs(|p| vec![meets_after(&fit.planar(p), k, t)])
        .quantity(0)?;
    Some((late.value, late.std_uncertainty?))
}

/// τ such that arc k at some time is where arc k + 1 is τ earlier, from near `t`; NaN where their velocities have one direction.
fn meets_after(arcs: &PlanarArcs<'_>, k: usize, t: f64) -> f64 {
    let (mut at, mut late) = (t, 0.0);
    for _ in 0..STEPS {
        let (m, n) = (arcs.motion(k, at), arcs.motion(k + 1, at - late));
        let (dr, dh) = (n.r - m.r, n.h - m.h);
        // Newton: d + (v' − v) δt − v' δτ = 0.
        let (jr, jh) = (n.vr - m.vr, n.vh - m.vh);
        let cross = m.vr * n.vh - m.vh * n.vr;
        at += (dr * n.vh - dh * n.vr) / cross;
        late += (dr * jh - dh * jr) / cross;
    }
    late
}

/// Newton's steps: the arcs are all but straight over some frames.
const STEPS: usize = 6;

/// From one spot to the next, plane units.
fn step(p: &Spot, q: &Spot) -> Vector2<f64> {
    Vector2::new(q.place.right - p.place.right, q.place.up - p.place.up)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::PlanePoint;
    use crate::test_noise::TestNoise;

    const RATE_HZ: f64 = 240.0;

    /// A bouncing ball at 240 Hz, its stored frames numbered anew without those in `dropped`.
    fn clip(dropped: &[usize], noise: f64) -> Vec<Spot> {
        let mut lcg = TestNoise(1);
        let mut random = || 2.0 * lcg.uniform() - 1.0;
        (0..140)
            .filter(|i| !dropped.contains(i))
            .enumerate()
            .map(|(frame, i)| {
                let t = i as f64 / RATE_HZ;
                let phase = if t < 0.2 { 0.2 + t } else { (t - 0.2) % 0.4 };
                let up = 6540.0 * 0.5 * phase * (0.4 - phase);
                Spot {
                    coded: crate::frames::Coded::Whole,
                    id: frame,
                    frame,
                    time_s: frame as f64 / RATE_HZ,
                    place: PlanePoint::new(400.0 * t + noise * random(), up + noise * random()),
                    std: 0.3,
                    radius: 8.0,
                    contrast_grey: 100.0,
                }
            })
            .collect()
    }

    #[test]
    fn dropped_frames_are_counted_where_they_are_missing() {
        for (dropped, missing) in [(60..61, 1), (60..63, 3), (20..25, 5)] {
            let gap = dropped.start;
            let dropped: Vec<usize> = dropped.collect();
            let found = proposed(&LinkedSpots::new(clip(&dropped, 0.1)), 1.0 / RATE_HZ);
            assert_eq!(found.first(), Some(&DroppedFrames { frame: gap, missing }));
        }
    }

    #[test]
    fn a_gap_in_every_seventh_place_is_one() {
        let dropped: Vec<usize> = (0..140).filter(|i| i % 7 == 3).collect();
        let found = proposed(&LinkedSpots::new(clip(&dropped, 0.05)), 1.0 / RATE_HZ);
        let single = found
            .iter()
            .filter(|s| s.missing == 1 && s.frame % 6 == 3)
            .count();
        assert!(single > 8 && single + 3 > found.len(), "{found:?}");
    }

    #[test]
    fn a_whole_clip_with_its_impacts_shows_next_to_none() {
        for noise in [0.0, 0.1, 0.5] {
            let found = proposed(&LinkedSpots::new(clip(&[], noise)), 1.0 / RATE_HZ);
            assert!(found.len() < 4, "{found:?}");
        }
    }

    #[test]
    fn a_gap_that_the_stamps_show_is_none() {
        let mut spots = clip(&[60, 61], 0.1);
        for s in &mut spots {
            if s.frame >= 60 {
                s.time_s += 2.0 / RATE_HZ;
            }
        }
        let found = proposed(&LinkedSpots::new(spots), 1.0 / RATE_HZ);
        assert!(found.iter().all(|d| d.frame != 60), "{found:?}");
    }
}
