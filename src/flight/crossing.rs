//! Meetings of two arcs that are no impact: two things cross in the picture, and each goes on as it came.
//!
//! Where the paths of two balls cross, the arc of the one before and that of the other behind meet as at an impact. But a ball that bounces is not seen to go
//! on along the arc by which it came, nor to have come along the arc by which it leaves. Where things are seen on both of these, the meeting joins two
//! things, and belongs to neither.
//!
//! Assumed: both are seen for some frames apart from each other, on both sides of the crossing. A reflection in the floor crosses its ball at every impact, too, and
//! leaves the arc by which the ball came only as it loses speed and falls the other way round: frames in which it would still be there are not asked.

use super::free_flight::{Flight, SpotUse};
use super::linking::Spot;

/// Frames on each side that are looked at, and of these how many have to show the thing that goes on.
const FRAMES: usize = 6;
const LEAST_SEEN: usize = 4;

/// Frames are looked at as far from the meeting as this, in frame intervals.
const FURTHEST: f64 = 40.0;

/// Things whose centres are so many radii apart are seen each by itself.
const APART_RADII: f64 = 2.2;

/// A thing is on an arc within this part of its radius.
const ON_ARC_RADII: f64 = 0.35;

/// The first meeting of arcs `k` and `k + 1` of `flight` where two of the `spots`' things cross.
#[must_use]
pub fn first_crossing(flight: &Flight, spots: &[Spot]) -> Option<usize> {
    let own: Vec<usize> = flight
        .points
        .iter()
        .filter(|p| p.use_ != SpotUse::NotFree)
        .map(|p| p.spot.id)
        .collect();
    let others: Vec<&Spot> = spots.iter().filter(|s| !own.contains(&s.id)).collect();
    (0..flight.impacts.len()).find(|&k| {
        flight.impacts[k].is_some_and(|t| {
            goes_on(flight, &others, t, 1.0, (k, k + 1)) && goes_on(flight, &others, t, -1.0, (k + 1, k))
        })
    })
}

/// Whether something is seen beyond `t` (the `side` of it: later +1, earlier −1) on arc `from`, which ended there, apart from the ball on arc `to`.
fn goes_on(flight: &Flight, others: &[&Spot], t: f64, side: f64, (from, to): (usize, usize)) -> bool {
    let since = |s: &Spot| side * (s.time_s - t);
    let mut near: Vec<&Spot> = others
        .iter()
        .filter(|s| since(s) > 0.0 && since(s) < FURTHEST * flight.interval_s)
        .copied()
        .collect();
    near.sort_by(|a, b| since(a).total_cmp(&since(b)));
    let radius = flight.radius();
    let floor = flight.fit.motion(to, t).h;
    let (mut looked_at, mut seen) = (0, 0);
    for frame in near.chunk_by(|a, b| a.frame == b.frame) {
        let (gone_on, ball) = (
            flight.fit.motion(from, frame[0].time_s),
            flight.fit.motion(to, frame[0].time_s),
        );
        let reflected = 2.0 * floor - ball.h;
        let is_mirrored = flight.fit.falls_in_plane()
            && (gone_on.r - ball.r).hypot(gone_on.h - reflected) < 2.0 * ON_ARC_RADII * radius;
        if (gone_on.r - ball.r).hypot(gone_on.h - ball.h) < APART_RADII * radius || is_mirrored {
            continue;
        }
        let on_arc =
            |s: &&Spot| (s.place.right - gone_on.r).hypot(s.place.up - gone_on.h) < ON_ARC_RADII * radius;
        looked_at += 1;
        seen += usize::from(frame.iter().any(on_arc));
        if looked_at == FRAMES {
            break;
        }
    }
    seen >= LEAST_SEEN
}
