//! Frames that are missing without a trace in the time stamps: dropped by a camera or an editor that then numbered the
//! rest anew.
//!
//! They show in what moves: one step is a whole number of times as long as the steps before and after it, in the same
//! direction. On a parabola the step over a gap of k frames is k + 1 times the mean of its two neighbours exactly. An
//! impact cannot look like that: its step lies between the velocities before and after.
//!
//! Frames that are missing at an impact show in its arcs. Numbered too early by τ, the arc after it runs past the one
//! before it, by τ (v × v')/|v' − v| where they are nearest: they meet only when it is moved back by that time. A τ of
//! whole frames is of frames that are missing; where the ball falls straight down, v × v' is 0 and nothing shows.

use super::free_flight::Flight;
use super::linking::{LinkedSpots, Spot};
use super::planar::PlanarArcs;
use crate::numeric::propagation::InputQuantities;
use nalgebra::Vector2;

/// A place where frames are missing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DroppedFrames {
    /// The first frame after the gap.
    pub frame: usize,
    /// How many are missing.
    pub missing: usize,
}

/// Steps around a gap differ from each other by less than this part of their mean: no impact, no jerk of a hand.
const ALIKE_PART: f64 = 0.35;

/// And the gap's from the whole multiple by less than this part of a step.
const WHOLE_PART: f64 = 0.25;

/// What is missing must stand out by this many (robust) standard deviations of what such steps scatter by.
const LEAST_SIGMAS: f64 = 10.0;

/// Frames next to each other on the time base lie within this part of the frame interval.
const EVEN_PART: f64 = 0.1;

/// More than this is no dropped frame but a cut.
const MOST_MISSING: f64 = 30.0;

/// Shorter tracks do not tell what their steps scatter by.
const LEAST_TRACK: usize = 12;

/// Finds gaps from the `linked` spots of all frames (in time order, duplicates left out), whose frames stand `interval_s` apart.
#[must_use]
pub fn find(linked: &LinkedSpots, interval_s: f64) -> Vec<DroppedFrames> {
    let spots = &linked.spots;
    let frames = spots.iter().map(|s| s.frame + 1).max().unwrap_or(0);
    // For each frame, how many frames are missing before it by each thing's track; 0 counts against a gap.
    let mut votes: Vec<Vec<usize>> = vec![Vec::new(); frames];
    let foreign = foreign_frames(spots, interval_s);
    for track in linked.tracks.iter().filter(|t| t.len() >= LEAST_TRACK) {
        let windows: Vec<StepWindow> = track
            .windows(6)
            .filter_map(|w| StepWindow::new([0, 1, 2, 3, 4, 5].map(|k| &spots[w[k]]), interval_s))
            .collect();
        let scatter = scatter(windows.iter().map(|w| w.beyond(0).norm()).collect());
        for w in &windows {
            votes[w.frame].push(w.missing(scatter));
        }
    }
    votes
        .iter()
        .enumerate()
        .filter_map(|(frame, votes)| {
            let missing = *votes.iter().max()?;
            // Whatever else moves has to agree.
            let agree = votes.iter().filter(|&&n| n == missing).count();
            let misplaced = foreign.iter().any(|f| f.abs_diff(frame) <= MISPLACED_FRAMES);
            (missing > 0 && 2 * agree > votes.len() && !misplaced).then_some(DroppedFrames { frame, missing })
        })
        .collect()
}

/// What is missing at an impact is whole frames to this part of one, with so many standard uncertainties of it.
const WHOLE_FRAME_PART: f64 = 0.2;
const WHOLE_FRAME_SIGMAS: f64 = 3.0;

/// And differs from none by this many.
const LEAST_LATE_SIGMAS: f64 = 12.0;

/// Finds gaps at the impacts on the floor of a `flight`.
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
        let clear = periods > LEAST_LATE_SIGMAS * std && periods < MOST_MISSING;
        let first = flight.points.iter().find(|p| p.arc() == Some(k + 1))?;
        let (frame, missing) = (first.spot.frame, periods.round() as usize);
        (whole && clear && missing >= 1).then_some(DroppedFrames { frame, missing })
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

/// Frames that do not belong where they are: across each a thing moves on by one step, not by two. What is missing near
/// one is the same frame in another place, and no time is lost. (Tracks may end at such a frame, so all spots are tried.)
fn foreign_frames(spots: &[Spot], interval_s: f64) -> Vec<usize> {
    let frames = spots.iter().map(|s| s.frame + 1).max().unwrap_or(0);
    let mut by_frame: Vec<Vec<&Spot>> = vec![Vec::new(); frames];
    for s in spots {
        if by_frame[s.frame].len() < MOST_SPOTS {
            by_frame[s.frame].push(s);
        }
    }
    let crosses = |w: &[Vec<&Spot>]| {
        w[0].iter().any(|a| {
            w[1].iter().any(|b| {
                w[3].iter()
                    .any(|c| w[4].iter().any(|d| moves_on_by_one([a, b, c, d], interval_s)))
            })
        })
    };
    (2..frames.saturating_sub(2))
        .filter(|&f| crosses(&by_frame[f - 2..f + 3]))
        .collect()
}

/// Spots of a frame that are tried; a picture with more has something else in motion.
const MOST_SPOTS: usize = 4;

/// Whether spots of the frames −2, −1, 1, 2 are of one thing that moves by one step from −1 to 1.
fn moves_on_by_one([a, b, c, d]: [&Spot; 4], interval_s: f64) -> bool {
    let lasts = |p: &Spot, q: &Spot, frames: f64| {
        (q.time_s - p.time_s - frames * interval_s).abs() < EVEN_PART * interval_s
    };
    let (before, here, after) = (step(a, b), step(b, c), step(c, d));
    let usual = 0.5 * (before + after);
    let size = usual.norm();
    let stands_out = size > LEAST_STEP_SIGMAS * a.std.max(b.std).max(c.std).max(d.std);
    lasts(a, b, 1.0)
        && lasts(b, c, 2.0)
        && lasts(c, d, 1.0)
        && stands_out
        && (before - after).norm() < ALIKE_PART * size
        && (here - usual).norm() < WHOLE_PART * size
}

/// Steps that stand out from what rough centres are off by, in their standard uncertainties.
const LEAST_STEP_SIGMAS: f64 = 3.0;

/// A frame stored in another place is not further from it than this.
const MISPLACED_FRAMES: usize = 30;

/// Standard deviation of a coordinate of plane vectors of these lengths, by their lower quartile: a gap spoils the windows
/// around it, too. (Of normal vectors a quarter are shorter than √(2 ln 4/3) = 0.7585 standard deviations.)
fn scatter(mut lengths: Vec<f64>) -> f64 {
    lengths.sort_by(f64::total_cmp);
    lengths
        .get(lengths.len() / 4)
        .map_or(f64::INFINITY, |quartile| quartile / 0.7585)
}

/// From one spot to the next, plane units.
fn step(p: &Spot, q: &Spot) -> Vector2<f64> {
    Vector2::new(q.place.right - p.place.right, q.place.up - p.place.up)
}

/// Five successive steps of a track, the middle one under suspicion.
struct StepWindow {
    steps: [Vector2<f64>; 5],
    /// The frame after the middle step.
    frame: usize,
}

impl StepWindow {
    /// `None` where the spots are not of successive frames on the time base.
    fn new(spots: [&Spot; 6], interval_s: f64) -> Option<Self> {
        let even = spots
            .windows(2)
            .all(|p| (p[1].time_s - p[0].time_s - interval_s).abs() < EVEN_PART * interval_s);
        even.then(|| Self {
            steps: [0, 1, 2, 3, 4].map(|k| step(spots[k], spots[k + 1])),
            frame: spots[3].frame,
        })
    }

    /// Mean of the neighbours of the middle step.
    fn usual(&self) -> Vector2<f64> {
        0.5 * (self.steps[1] + self.steps[3])
    }

    /// What the middle step has beyond that with `missing` frames.
    fn beyond(&self, missing: usize) -> Vector2<f64> {
        self.steps[2] - (missing as f64 + 1.0) * self.usual()
    }

    /// How many frames are missing at the middle step, 0 where it does not tell.
    fn missing(&self, scatter: f64) -> usize {
        let usual = self.usual().norm();
        let ratio = self.steps[2].norm() / usual;
        if !(ratio > 1.5 && ratio < MOST_MISSING + 1.0) {
            return 0;
        }
        let missing = (ratio - 1.0).round() as usize;
        let [first, before, _, after, last] = self.steps;
        let smooth = [(first, before), (before, after), (after, last)]
            .iter()
            .all(|(a, b)| (a - b).norm() < ALIKE_PART * usual);
        let whole = self.beyond(missing).norm() < WHOLE_PART * usual;
        let clear = missing as f64 * usual > LEAST_SIGMAS * scatter;
        if smooth && whole && clear { missing } else { 0 }
    }
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
            let found = find(&LinkedSpots::new(clip(&dropped, 0.1)), 1.0 / RATE_HZ);
            assert_eq!(found, [DroppedFrames { frame: gap, missing }]);
        }
    }

    #[test]
    fn a_gap_in_every_seventh_place_is_one() {
        let dropped: Vec<usize> = (0..140).filter(|i| i % 7 == 3).collect();
        let found = find(&LinkedSpots::new(clip(&dropped, 0.05)), 1.0 / RATE_HZ);
        assert!(
            found.len() > 12 && found.iter().all(|s| s.missing == 1),
            "{found:?}"
        );
    }

    #[test]
    fn a_whole_clip_with_its_impacts_misses_nothing() {
        for noise in [0.0, 0.1, 0.5, 2.0] {
            assert_eq!(find(&LinkedSpots::new(clip(&[], noise)), 1.0 / RATE_HZ), []);
        }
    }

    #[test]
    fn a_frame_in_another_place_is_no_gap() {
        for (from, to) in [(60, 54), (30, 36)] {
            let whole = clip(&[], 0.1);
            let mut spots = whole.clone();
            let misplaced = spots.remove(from);
            spots.insert(to, misplaced);
            for (s, w) in spots.iter_mut().zip(&whole) {
                (s.frame, s.time_s) = (w.frame, w.time_s);
            }
            assert_eq!(find(&LinkedSpots::new(spots), 1.0 / RATE_HZ), []);
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
        assert_eq!(find(&LinkedSpots::new(spots), 1.0 / RATE_HZ), []);
    }
}
