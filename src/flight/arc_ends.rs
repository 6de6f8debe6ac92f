//! The ends of arcs, where a point may be of the other side of an impact (or of a launch) without its distance showing it.

use super::arc_selection::LEAST_END_POINTS;
use super::free_flight::Flight;
use super::outliers::OUTLIER_SIGMAS;
use std::ops::Range;

/// So many standard deviations from its arc a point of it may be without being an outlier.
const UNDETECTED_SIGMAS: f64 = OUTLIER_SIGMAS * std::f64::consts::SQRT_2;

/// Rough centres make no point unsure that is further from an impact than this part of the frame interval.
const NEAR_PART: f64 = 0.25;

/// Points at the end of an arc that may be behind the next impact without its distance showing it.
const UNDETECTED_POINTS: usize = 2;

/// A floor is level to this part of the ball's radius from one impact to the next.
const LEVEL_PART: f64 = 0.1;

impl Flight {
    /// Takes from `ranges` the ends of arcs that may be of the other side of an impact, or in contact, and whose distance
    /// would not show it: such a point draws a short arc along. Whether there were any.
    pub(super) fn trim_unsure_ends(&self, ranges: &mut [Range<usize>]) -> bool {
        if !self.fit.falls_in_plane() {
            return false;
        }
        let before = ranges.to_vec();
        let near = |i: usize, jump: f64| {
            let std = self.std(&self.points[i].spot);
            (UNDETECTED_SIGMAS * std / jump).min(NEAR_PART * self.interval_s)
        };
        let time = |i: usize| self.points[i].spot.time_s;
        for (k, t) in self.impacts.iter().enumerate() {
            let Some(t) = *t else { continue };
            let (m, n) = (self.fit.motion(k, t), self.fit.motion(k + 1, t));
            let jump = (n.vr - m.vr).hypot(n.vh - m.vh);
            // A short arc that would be lost by it keeps its point.
            let end = ranges[k].clone().find(|&i| time(i) > t - near(i, jump));
            if let Some(end) = end.filter(|&end| end >= ranges[k].start + LEAST_END_POINTS) {
                ranges[k].end = end;
            }
            let after = &mut ranges[k + 1];
            let start = after.clone().rev().find(|&i| time(i) < t + near(i, jump));
            if let Some(last) = start.filter(|&last| last + 1 + LEAST_END_POINTS <= after.end) {
                after.start = last + 1;
            }
        }
        if let (Some(last), Some((t, floor, speed))) = (ranges.last_mut(), self.lands_again()) {
            // Where the ball is clearly below, there is no floor as high as the last.
            let undetected = |i: usize| {
                let spot = &self.points[i].spot;
                let lowest = UNDETECTED_SIGMAS * self.std(spot) + LEVEL_PART * spot.radius;
                time(i) > t - near(i, speed) && spot.place.up > floor - lowest
            };
            // More of them than this would show by their distance: then it is another floor, or none.
            let end = last.clone().find(|&i| undetected(i));
            if let Some(end) = end.filter(|end| last.end - end <= UNDETECTED_POINTS) {
                last.end = end;
            }
        }
        ranges != before
    }

    /// The first point of the first arc `range` by the launch, where that is another than the arc has: in front of the edge the
    /// ball is on its bench. `None` where there was none, or the arc would be lost by it.
    pub(super) fn first_after_edge(&self, range: &Range<usize>) -> Option<usize> {
        let edge_s = self.launch?.time_s;
        let start = self.points[..range.end].partition_point(|p| p.spot.time_s < edge_s);
        (start != range.start && start + LEAST_END_POINTS <= range.end).then_some(start)
    }

    /// When the last arc is back at the height of the impact before it, that height and the speed then: there is the next
    /// impact, of which nothing was found. `None` where the ball did not rise.
    fn lands_again(&self) -> Option<(f64, f64, f64)> {
        let last = self.fit.arcs() - 1;
        let t = (*self.impacts.last()?)?;
        let up = self
            .fit
            .planar(self.fit.parameters.as_slice())
            .return_time(last, t);
        let speed = self.fit.motion(last, t + up).vh.abs();
        (speed > 0.0).then(|| (t + up, self.fit.motion(last, t).h, speed))
    }
}
