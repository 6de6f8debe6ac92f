//! The launches of a recording: the ball set free several times before one camera.
//!
//! The flight with the most evidence comes first. Then the frames before and after it are searched for other flights, and those
//! between what was found, until nothing falls there. A flight at the time of another one (a second ball, a shadow, a reflection)
//! is none of another launch, nor is one with another fall or of a ball of another size ([`is_same_ball`]). Flights that may be
//! what is left of the one before ([`may_continue`]) belong to the same launch, which is measured on the one with the most
//! points, or on the one with the most evidence of the recording.
//!
//! Assumed: the camera and the ball's size are the same in all launches, and the flights fall in the picture. In a view from
//! above a ball that is carried back in straight lines looks like one that bounces: there one launch is measured.
//!
//! A search costs a look at the tracks of the frames that are left; only what counts as a launch is refined.

use super::camera::CalibratedCamera;
use super::clock::Clocked;
use super::spots::BallCentre;
use super::track::{self, Tracked};
use crate::calibration::Optics;
use crate::flight::continuation::{is_same_ball, may_continue};
use crate::flight::{Flight, NoFlight, SpotUse};
use std::collections::BTreeSet;
use std::ops::Range;

/// A launch as the first look has it.
#[derive(Debug, Clone)]
pub struct TrackedLaunch {
    /// Its flight.
    pub tracked: Tracked,
    /// The frames that are its own: from the end of the launch before to the start of the next.
    pub frames: Range<usize>,
    /// Whether it is the one with the most evidence.
    pub is_best: bool,
}

/// All frames of a recording that holds one launch.
pub const ALL_FRAMES: Range<usize> = 0..usize::MAX;

/// Fewer frames than this hold no impact: three on one side of it, three on the other.
const LEAST_FRAMES: usize = 6;

/// The launches among `centres`, which may be of anything, in time order.
///
/// # Errors
/// [`NoFlight`] with what was found instead.
pub fn tracked(
    camera: &CalibratedCamera<'_>,
    clocked: &Clocked,
    centres: &[BallCentre],
    optics: Option<Optics>,
) -> Result<Vec<TrackedLaunch>, NoFlight> {
    let best = track::tracked(camera, clocked, centres, optics)?;
    let mut search = LaunchSearch {
        camera,
        clocked,
        centres,
        optics,
        taken: ids_in_flight(&best.flight).collect(),
        found: vec![FoundFlight::new(best)],
    };
    if camera.falls() {
        search.all();
    }
    Ok(launches(search.found))
}

/// The `tracked` of one launch, with the frames that are its own.
pub fn only_within(mut tracked: Tracked, frames: &Range<usize>) -> Tracked {
    let within = |frame: usize| frames.contains(&frame);
    tracked.flight.points.retain(|p| within(p.spot.frame));
    tracked.centres.retain(|c| within(c.frame));
    tracked.first_look.retain(|s| within(s.frame));
    tracked
}

/// A flight and the frames from its first to its last point in use.
struct FoundFlight {
    tracked: Tracked,
    frames: Range<usize>,
}

impl FoundFlight {
    fn new(tracked: Tracked) -> Self {
        let frames = frames_of(&tracked.flight);
        Self { tracked, frames }
    }
}

/// The search for flights, and what it found; the one with the most evidence first.
struct LaunchSearch<'a> {
    camera: &'a CalibratedCamera<'a>,
    clocked: &'a Clocked,
    centres: &'a [BallCentre],
    optics: Option<Optics>,
    /// Ids of centres that belong to a flight, or to what is none of a launch.
    taken: BTreeSet<usize>,
    found: Vec<FoundFlight>,
}

impl LaunchSearch<'_> {
    /// Every flight of the ball, one at a time.
    fn all(&mut self) {
        let best = self.found[0].frames.clone();
        let mut open = vec![0..best.start, best.end..usize::MAX];
        while let Some(frames) = open.pop() {
            if let Some(flight) = self.within(&frames) {
                open.push(frames.start..flight.frames.start);
                open.push(flight.frames.end..frames.end);
                self.found.push(flight);
            }
        }
    }

    /// The flight with the most evidence in `frames`, between flights that were found.
    fn within(&mut self, frames: &Range<usize>) -> Option<FoundFlight> {
        // Another thing that flies shows itself by its flight at the time of the ball's.
        if frames.len() < LEAST_FRAMES {
            return None;
        }
        let before = self.found.iter().find(|f| f.frames.end == frames.start);
        let after = self.found.iter().find(|f| f.frames.start == frames.end);
        let reach =
            before.map_or(frames.start, |f| f.frames.start)..after.map_or(frames.end, |f| f.frames.end);
        let mut here: Vec<BallCentre> = self
            .centres
            .iter()
            .filter(|c| reach.contains(&c.frame))
            .copied()
            .collect();
        loop {
            here.retain(|c| !self.taken.contains(&c.id));
            let tracked = track::tracked(self.camera, self.clocked, &here, self.optics).ok()?;
            self.taken.extend(ids_in_flight(&tracked.flight));
            let flight = FoundFlight::new(tracked);
            let apart = flight.frames.start >= frames.start && flight.frames.end <= frames.end;
            // What flew beside another launch goes on after it.
            let (from_s, to_s) = flight.tracked.flight.time_span();
            let mut beside = self.found.iter().flat_map(|f| &f.tracked.others);
            let was_beside = beside.any(|o| o.from_s < to_s && o.to_s > from_s);
            if apart && !was_beside && is_same_ball(&self.found[0].tracked.flight, &flight.tracked.flight) {
                return Some(flight);
            }
        }
    }
}

/// Ids of the points in a flight's time that are of its ball. There is one at least.
fn ids_in_flight(flight: &Flight) -> impl Iterator<Item = usize> {
    let frames = frames_of(flight);
    let of_ball = flight
        .points
        .iter()
        .filter(move |p| frames.contains(&p.spot.frame) && p.use_ != SpotUse::NotFree);
    of_ball.map(|p| p.spot.id)
}

/// From the first to the last frame of a point in use.
fn frames_of(flight: &Flight) -> Range<usize> {
    let frames = || flight.used_points().map(|p| p.spot.frame);
    frames().min().unwrap_or(0)..frames().max().map_or(0, |last| last + 1)
}

/// The launches that the flights `found` are of, the one with the most evidence first.
fn launches(mut found: Vec<FoundFlight>) -> Vec<TrackedLaunch> {
    let best = found[0].frames.start;
    found.sort_by_key(|f| f.frames.start);
    let parts = found.chunk_by(|a, b| may_continue(&a.tracked.flight, &b.tracked.flight));
    let parts: Vec<&[FoundFlight]> = parts.collect();
    let end_before = |i: usize| i.checked_sub(1).map_or(0, |i| last_frame(parts[i]));
    let start_after = |i: usize| parts.get(i + 1).map_or(usize::MAX, |next| next[0].frames.start);
    let of = |(i, flights): (usize, &&[FoundFlight])| {
        let is_best = |f: &&FoundFlight| f.frames.start == best;
        let most = || flights.iter().max_by_key(|f| f.tracked.flight.used());
        let flight = flights.iter().find(is_best).or_else(most)?;
        Some(TrackedLaunch {
            tracked: flight.tracked.clone(),
            frames: end_before(i)..start_after(i),
            is_best: is_best(&flight),
        })
    };
    parts.iter().enumerate().filter_map(of).collect()
}

/// The frame after the last of the flights of a launch.
fn last_frame(flights: &[FoundFlight]) -> usize {
    flights.last().map_or(0, |f| f.frames.end)
}
