//! Neighbouring stretches of samples, before anything is fitted: whether they are one arc that was cut in two, or an impact
//! stands between them.

use super::parabola::{self, Fall, Gravity};
use super::segment::TrackSample;
use std::ops::Range;

/// Squared residuals, in variances, that a cut must save: its parameters and a margin.
const CUT_GAIN: f64 = 36.0;

/// Joins neighbouring arcs that are one flight: by their `misfit` (squared residuals in variances) their points lie on one arc,
/// or no impact stands between them (an outlier, a gap, air drag or an error that lasts for some frames had cut them).
pub(super) fn merge_by(
    samples: &[TrackSample],
    ranges: Vec<Range<usize>>,
    misfit: impl Fn(&[TrackSample]) -> f64,
    is_impact: impl Fn(&[TrackSample], &[TrackSample]) -> bool,
) -> Vec<Range<usize>> {
    let mut joined: Vec<Range<usize>> = Vec::new();
    for r in ranges {
        if let Some(last) = joined.last_mut() {
            let (a, b) = (&samples[last.clone()], &samples[r.clone()]);
            let both: Vec<TrackSample> = a.iter().chain(b).copied().collect();
            if misfit(&both) - (misfit(a) + misfit(b)) < CUT_GAIN || !is_impact(a, b) {
                *last = last.start..r.end;
                continue;
            }
        }
        joined.push(r);
    }
    joined
}

/// The same of parabolas with the fall `g`.
pub(super) fn merge(samples: &[TrackSample], ranges: Vec<Range<usize>>, g: Gravity) -> Vec<Range<usize>> {
    merge_by(
        samples,
        ranges,
        |part| parabola::misfit(part, Fall::Known(g)),
        |a, b| impact_stands_between(a, b, g),
    )
}

/// An impact changes the velocity by more than this part of it, or turns a fall into a rise.
pub(super) const LEAST_JUMP: f64 = 0.25;

/// Parts of one flight miss each other by no more than this many standard deviations, and a part of their way (drag).
const MOST_APART_SIGMAS: f64 = 6.0;

/// Points on each side of a seam that tell what happens there.
const SEAM_POINTS: usize = 12;

/// Way covered by the shorter of two stretches.
fn shorter_way(a: &[TrackSample], b: &[TrackSample]) -> f64 {
    let way = |s: &[TrackSample]| (s[s.len() - 1].h - s[0].h).hypot(s[s.len() - 1].r - s[0].r);
    way(a).min(way(b))
}

/// Whether the velocities of two neighbouring stretches differ as by an impact where they meet.
fn impact_stands_between(a: &[TrackSample], b: &[TrackSample], g: Gravity) -> bool {
    // Near the seam: over a long stretch drag or perspective would pass for a jump.
    let (a, b) = (
        &a[a.len().saturating_sub(SEAM_POINTS)..],
        &b[..b.len().min(SEAM_POINTS)],
    );
    let (Some(end), Some(start)) = (a.last(), b.first()) else {
        return false;
    };
    let t = 0.5 * (end.t + start.t);
    let (Some(before), Some(after)) = (parabola::velocity(a, g, t), parabola::velocity(b, g, t)) else {
        return true;
    };
    let jump = (after.0 - before.0).hypot(after.1 - before.1);
    // One flight is in one place where its parts meet; else they are two things.
    if let (Some(p), Some(q)) = (parabola::place(a, g, t), parabola::place(b, g, t)) {
        let sigma = 1.0 / end.weight.sqrt();
        if (p.0 - q.0).hypot(p.1 - q.1) > MOST_APART_SIGMAS * sigma + 0.02 * shorter_way(a, b) {
            return true;
        }
    }
    // Against the fastest that either is: at an apex every jump is large against the speed there.
    let fast = |part: &[TrackSample], t: f64| parabola::velocity(part, g, t).map_or(0.0, |v| v.0.hypot(v.1));
    let speed = [
        fast(a, a[0].t),
        fast(a, end.t),
        fast(b, start.t),
        fast(b, b[b.len() - 1].t),
    ]
    .into_iter()
    .fold(0.0, f64::max);
    // Near an apex cut in two the sign of the rise is noise: the turn must be worth the gap's fall at least.
    let turn = if g.down > 0.0 {
        let least = 2.0 * g.down * (start.t - end.t) + 0.5 * LEAST_JUMP * speed;
        before.1 < 0.0 && after.1 > 0.0 && after.1 - before.1 > least
    } else {
        // Where nothing falls, nothing bends a path but an impact.
        g.down == 0.0
    };
    jump > LEAST_JUMP * speed || turn
}
