//! One launch of a recording, from its first centres to its impacts.

use super::ball_rotation;
use super::camera::CalibratedCamera;
use super::clock::Clocked;
use super::decode::Decoded;
use super::impacts;
use super::in_metres::Impacts;
use super::launches::{self, TrackedLaunch};
use super::refine::{self, Refined, Refinement};
use super::spots::BallCentre;
use super::track::{self, Tracked};
use crate::calibration::{CalibrationError, Optics};
use crate::detect::centre::Accuracy;
use crate::flight::continuation::is_same_ball;
use crate::flight::{NoFlight, dropped_frames};
use std::ops::Range;

/// A recording whose launches are measured.
#[derive(Debug, Clone, Copy)]
pub struct LaunchMeasurement<'a> {
    /// By what it was taken.
    pub camera: &'a CalibratedCamera<'a>,
    /// Its pixels.
    pub decoded: &'a Decoded,
    /// The first centres of all that moves.
    pub centres: &'a [BallCentre],
    /// The centre method asked for.
    pub accuracy: Accuracy,
    /// Whether the ball's marks are asked for its spin.
    pub looks_at_marks: bool,
    /// Times at which a person says that there is no impact, s.
    pub not_impacts_s: &'a [f64],
}

/// A launch, measured.
#[derive(Debug)]
pub struct MeasuredLaunch {
    /// The flight by the best centres.
    pub refined: Refined,
    /// In metres.
    pub impacts: Impacts,
}

/// The launches of a recording, measured.
#[derive(Debug)]
pub struct MeasuredLaunches {
    /// The first in time, or the only one.
    pub first: MeasuredLaunch,
    /// Those after it.
    pub later: Vec<MeasuredLaunch>,
    /// Flights of the same ball beside them that show no bounce, or could not be measured.
    pub left_out: usize,
}

/// Why a launch could not be measured.
#[derive(Debug)]
pub enum NotMeasured {
    /// What was tracked shows to be no ball's flight.
    NoFlight(NoFlight),
    /// The calibration's scale rests on what was not measured.
    NoScale(CalibrationError),
}

impl MeasuredLaunches {
    /// The ball's best centres in all launches, in the order of their ids: launches share no frame.
    pub fn centres(&self) -> Vec<BallCentre> {
        let launches = [&self.first].into_iter().chain(&self.later);
        let of_all = launches.flat_map(|l| l.refined.tracked.centres.iter().copied());
        of_all.collect()
    }

    /// The one of `found` with the most evidence, as if nothing else moved in the recording, measured by `of`.
    ///
    /// # Errors
    /// See [`NotMeasured`].
    pub fn alone(
        found: &[TrackedLaunch],
        of: impl FnOnce(&TrackedLaunch) -> Result<MeasuredLaunch, NotMeasured>,
    ) -> Result<Self, NotMeasured> {
        let best = found.iter().find(|l| l.is_best).or(found.first());
        let best = best.ok_or(NotMeasured::NoFlight(NoFlight::NothingFalls { longest: 0 }))?;
        let whole = TrackedLaunch {
            frames: launches::ALL_FRAMES,
            ..best.clone()
        };
        Ok(Self {
            first: of(&whole)?,
            later: Vec::new(),
            left_out: 0,
        })
    }

    /// Those of `found` launches that were `measured` and bounce, each with whether it is the one with the most evidence; `None` where no other is
    /// left beside that.
    pub fn several(measured: impl Iterator<Item = (bool, MeasuredLaunch)>, found: usize) -> Option<Self> {
        let mut kept: Vec<(bool, MeasuredLaunch)> =
            measured.filter(|(_, l)| !l.impacts.bounces.is_empty()).collect();
        // With the best centres a size or a fall may show to be another one.
        let reference = kept.iter().find(|(is_best, _)| *is_best).or(kept.first());
        let reference = reference.map(|(_, l)| l.refined.tracked.flight.clone())?;
        kept.retain(|(_, l)| is_same_ball(&reference, &l.refined.tracked.flight));
        if kept.iter().all(|(is_best, _)| *is_best) {
            return None;
        }
        let left_out = found - kept.len();
        let mut launches = kept.into_iter().map(|(_, launch)| launch);
        Some(Self {
            first: launches.next()?,
            later: launches.collect(),
            left_out,
        })
    }
}

impl<'a> LaunchMeasurement<'a> {
    /// The same, by another `camera`.
    pub fn by<'b>(self, camera: &'b CalibratedCamera<'b>) -> LaunchMeasurement<'b>
    where
        'a: 'b,
    {
        LaunchMeasurement { camera, ..self }
    }

    /// All launches of those `found` by `clock` that bounce, in time order; without one the flight with the most evidence. A
    /// recording in which only that one is left is measured as if nothing else moved in it.
    ///
    /// # Errors
    /// See [`NotMeasured`]: of the flight with the most evidence, where no other one could be measured.
    pub fn each(
        &self,
        clock: &mut Clocked,
        found: &[TrackedLaunch],
    ) -> Result<MeasuredLaunches, NotMeasured> {
        let alone = |clock: &mut Clocked| MeasuredLaunches::alone(found, |whole| self.of(clock, whole));
        if found.len() < 2 {
            return alone(clock);
        }
        let mut later = clock.clone();
        let measured = found
            .iter()
            .filter_map(|l| Some((l.is_best, self.of(&mut later, l).ok()?)));
        match MeasuredLaunches::several(measured, found.len()) {
            Some(several) => {
                *clock = later;
                Ok(several)
            }
            None => alone(clock),
        }
    }

    /// The `launch` that was found by `clock`, which becomes the clock with the frames that are missing at its impacts.
    ///
    /// # Errors
    /// See [`NotMeasured`].
    pub fn of(&self, clock: &mut Clocked, launch: &TrackedLaunch) -> Result<MeasuredLaunch, NotMeasured> {
        let frames = &launch.frames;
        // Launches before it may have moved its times.
        let first = launch.tracked.flight.points.first();
        let moved = first.is_some_and(|p| clock.base.times_s[p.spot.frame] != p.spot.time_s);
        let tracked = if moved {
            self.tracked(clock, frames, launch.tracked.optics)
        } else {
            let mut tracked = launches::only_within(launch.tracked.clone(), frames);
            tracked.flight.deny_impacts(self.not_impacts_s);
            Ok(tracked)
        };
        let first = tracked
            .and_then(|tracked| self.refined(clock, tracked, frames))
            .map_err(NotMeasured::NoFlight)?;
        let (later, refined) = self.with_frames_missing_at_impacts(clock, first, frames);
        if let Some(later) = later {
            *clock = later;
        }
        let rotations = if self.looks_at_marks {
            ball_rotation::of_arcs(self.camera, self.decoded, &refined)
        } else {
            Vec::new()
        };
        let impacts =
            impacts::impacts(self.camera, clock, &refined, &rotations).map_err(NotMeasured::NoScale)?;
        Ok(MeasuredLaunch { refined, impacts })
    }

    /// The flight with the most evidence by `clock`, with the best centres.
    ///
    /// # Errors
    /// [`NoFlight`] where nothing flies.
    pub fn most_evident(&self, clock: &Clocked, optics: Option<Optics>) -> Result<Refined, NoFlight> {
        let tracked = self.tracked(clock, &launches::ALL_FRAMES, optics)?;
        self.refined(clock, tracked, &launches::ALL_FRAMES)
    }

    /// The impacts may show frames to be missing that no stamp does: then once more on the clock with them. Where that is what
    /// was missing, the impacts are where they were, and their arcs meet.
    fn with_frames_missing_at_impacts(
        &self,
        clock: &Clocked,
        first: Refined,
        frames: &Range<usize>,
    ) -> (Option<Clocked>, Refined) {
        let again = || {
            let first = &first.tracked;
            let later = clock.with_frames_missing_at_impacts(&first.flight, self.camera, self.decoded)?;
            let tracked = self.tracked(&later, frames, first.optics).ok()?;
            let refined = self.refined(&later, tracked, frames).ok()?;
            let flight = &refined.tracked.flight;
            let meets = flight.used() >= first.flight.used() && dropped_frames::at_impacts(flight).is_empty();
            meets.then_some((later, refined))
        };
        match again() {
            Some((later, refined)) => (Some(later), refined),
            None => (None, first),
        }
    }

    fn tracked(
        &self,
        clock: &Clocked,
        frames: &Range<usize>,
        optics: Option<Optics>,
    ) -> Result<Tracked, NoFlight> {
        let own = self.centres.iter().filter(|c| frames.contains(&c.frame));
        let own: Vec<BallCentre> = own.copied().collect();
        let mut tracked = track::tracked(self.camera, clock, &own, optics)?;
        tracked.flight.deny_impacts(self.not_impacts_s);
        Ok(tracked)
    }

    fn refined(&self, clock: &Clocked, tracked: Tracked, within: &Range<usize>) -> Result<Refined, NoFlight> {
        let recording = Refinement {
            camera: self.camera,
            decoded: self.decoded,
            clocked: clock,
            accuracy: self.accuracy,
            within,
            not_impacts_s: self.not_impacts_s,
        };
        refine::refined(&recording, tracked)
    }
}
