//! Which of a track's arcs are one flight: those that are free, follow each other closely and show the fall.

use super::parabola::{Fall, Gravity, own_fall};
use super::samples::shows_fall;
use super::segment::TrackSample;
use std::ops::Range;

/// An arc whose own curvature contradicts the common fall is carried, not thrown.
pub(super) fn is_free_flight(samples: &[TrackSample], gravity: f64, falls: bool) -> bool {
    if samples.len() < 5 || !falls {
        return true;
    }
    own_fall(samples).is_none_or(|(g, std)| Fall::Known(Gravity::upright(gravity)).agrees(g, std))
}

/// How many points the arcs of `run` hold.
pub(super) fn points_in(run: &[Range<usize>]) -> usize {
    run.iter().map(ExactSizeIterator::len).sum()
}

/// The successive arcs, at most `most`, that hold the most points: arcs are fitted together, which takes memory and time as a
/// power of their number.
pub(super) fn richest_run(ranges: Vec<Range<usize>>, most: usize) -> Vec<Range<usize>> {
    match ranges.windows(most).max_by_key(|run| points_in(run)) {
        Some(run) => run.to_vec(),
        None => ranges,
    }
}

/// The run of arcs with the most points in which each `follows` the last.
pub(super) fn longest_run(
    ranges: Vec<Range<usize>>,
    follows: impl Fn(&Range<usize>, &Range<usize>) -> bool,
) -> Vec<Range<usize>> {
    let runs = ranges.chunk_by(follows);
    runs.max_by_key(|run| points_in(run)).unwrap_or_default().to_vec()
}

/// The run of arcs with the most points in which each follows the last within a second or ten frames.
pub(super) fn longest_chain(
    samples: &[TrackSample],
    ranges: Vec<Range<usize>>,
    interval_s: f64,
) -> Vec<Range<usize>> {
    let patience_s = (10.0 * interval_s).max(1.0);
    longest_run(ranges, |last, next| {
        samples[next.start].t - samples[last.end - 1].t < patience_s
    })
}

/// Points of the first and of the last arc, at least.
pub(super) const LEAST_END_POINTS: usize = 4;

/// The arcs from the first to the last that shows the fall, those next to them that go far up or down (a fast ball bends little), and one
/// more at each end: a short stretch after the last impact is a rebound, a row of them is a ball that rolls or shivers.
pub(super) fn without_straight_ends(
    samples: &[TrackSample],
    ranges: Vec<Range<usize>>,
    gravity: f64,
    sigma: f64,
    falls: bool,
) -> Vec<Range<usize>> {
    let shows = |r: &Range<usize>| shows_fall(samples, r, gravity, sigma);
    if !falls {
        return ranges;
    }
    let (Some(mut first), Some(mut last)) = (ranges.iter().position(shows), ranges.iter().rposition(shows))
    else {
        return Vec::new();
    };
    let far = |r: &Range<usize>| goes_far(&samples[r.clone()], sigma);
    while first > 0 && far(&ranges[first - 1]) {
        first -= 1;
    }
    while last + 1 < ranges.len() && far(&ranges[last + 1]) {
        last += 1;
    }
    let end = (last + 2).min(ranges.len());
    let mut kept = ranges[first.saturating_sub(1)..end].to_vec();
    // An arc at the end, which only one impact holds, needs a point to spare.
    if kept.first().is_some_and(|r| r.len() < LEAST_END_POINTS) {
        kept.remove(0);
    }
    if kept.last().is_some_and(|r| r.len() < LEAST_END_POINTS) {
        kept.pop();
    }
    kept
}

/// Whether an arc goes so far up or down that it is no bench and no floor, however little it bends.
pub(super) fn goes_far(arc: &[TrackSample], sigma: f64) -> bool {
    let (Some(a), Some(b)) = (arc.first(), arc.last()) else {
        return false;
    };
    let rise = (b.h - a.h).abs();
    arc.len() >= WEAK_POINTS && rise > (STEEP_PART * (b.r - a.r).abs()).max(FAR_SIGMAS * sigma)
}

/// What goes far up or down rises by more than this part of its way along, which no bench or floor does, and by so many standard deviations.
const STEEP_PART: f64 = 0.3;
const FAR_SIGMAS: f64 = 30.0;

/// Arcs `cut` and `cut + 1` do not meet: the weaker goes, if it is a short stretch that may be anything (points on
/// both sides of an impact that happen to lie on a parabola); else the flight ends there, and the larger part stays.
pub(super) fn without_weak_arc(
    samples: &[TrackSample],
    mut ranges: Vec<Range<usize>>,
    cut: usize,
    gravity: f64,
    sigma: f64,
) -> Vec<Range<usize>> {
    let weaker = if ranges[cut].len() < ranges[cut + 1].len() {
        cut
    } else {
        cut + 1
    };
    let range = &ranges[weaker];
    if range.len() <= WEAK_POINTS || !shows_fall(samples, range, gravity, sigma) {
        ranges.remove(weaker);
        return ranges;
    }
    larger_part(ranges, cut + 1)
}

/// An arc of this many points or fewer may be chance.
pub(super) const WEAK_POINTS: usize = 5;

/// The part before or from `cut`, whichever holds more points.
pub(super) fn larger_part(mut ranges: Vec<Range<usize>>, cut: usize) -> Vec<Range<usize>> {
    let tail = ranges.split_off(cut);
    if points_in(&tail) > points_in(&ranges) {
        tail
    } else {
        ranges
    }
}
