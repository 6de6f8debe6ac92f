//! One recording, from file to result: the order of the steps, nothing else.
//!
//! observe → repeats, skips → time base → flight → shared radius, blur, exposure → centres again → flight again → scale →
//! bounces → readings → warnings → drawing.

mod camera;
mod doubt;
mod drawing;
mod observe;
mod refine;
mod result;
mod warn;
mod world;

pub use result::*;

use crate::bounce::air::Lift;
use crate::bounce::impacts::{ImpactKind, Picture, Scene};
use crate::bounce::reading;
use crate::calibration::{Calibration, CalibrationError, Optics, Rectification, ScaleEvidence};
use crate::detect::centre::appearance::Radius;
use crate::detect::centre::{Accuracy, Centre};
use crate::flight::fit::{Forces, GRAVITY};
use crate::flight::linking::Spot;
use crate::flight::{self, Flight, NoFlight, SpotUse};
use crate::frames::timebase::TimeBase;
use crate::frames::{FrameError, FrameSource, LumaRange};
use crate::geometry::PixelPoint;
use crate::quantity::{Quantity, median};
use camera::in_plane;
use observe::Observation;
use refine::{Found, Shared};
use std::path::{Path, PathBuf};
use world::WorldFrame;

/// How far the work has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// Frames for the background are being read.
    Survey,
    /// This frame was looked at.
    Frame {
        /// Its index, from 0.
        index: usize,
        /// Frames in all, by the container.
        expected: Option<u64>,
    },
    /// Arcs are being fitted.
    Fit,
}

/// What keeps a recording from being measured at all. A recording that can be read but holds no measurement is not an
/// error but [`Outcome::Rejected`].
#[derive(Debug, thiserror::Error)]
pub enum MeasureError {
    /// The recording cannot be read.
    #[error(transparent)]
    Frames(#[from] FrameError),
    /// The calibration does not fit the recording.
    #[error("{name} does not fit {video}")]
    Calibration {
        /// The calibration file.
        name: String,
        /// The recording.
        video: String,
        /// In what.
        #[source]
        source: CalibrationError,
    },
    /// Too few frames.
    #[error(
        "{}: {frames} frame(s) in it; a measurement needs a moving ball, at least 6 frames. Is this the right file?",
        path.display()
    )]
    NothingToSee {
        /// The recording.
        path: PathBuf,
        /// Frames read.
        frames: usize,
    },
    /// Images without a clock.
    #[error(
        "{}: this has no time stamps, so times are unknown; give the capture rate as \"frame_rate_hz\" in {calibration}",
        path.display()
    )]
    NoClock {
        /// The recording.
        path: PathBuf,
        /// The calibration file.
        calibration: String,
    },
}

/// Name of the centre method.
fn method_name(accuracy: Accuracy) -> &'static str {
    match accuracy {
        Accuracy::Fast => "fast: circle through edge points",
        Accuracy::Standard => "standard: likelihood of the edge, learned appearance",
        Accuracy::Fine => "fine: likelihood of every edge pixel, learned appearance",
    }
}

/// Part of the first look's points that must be found again for the second look to count.
const KEPT_PART: f64 = 0.75;

/// Part of the first look's points that must be found again for the thing to be a ball.
const BALL_PART: f64 = 0.5;

/// Balls smaller than this may be measured by their outline alone, px.
const SMALL_BALL_PX: f64 = 6.0;

/// Fewer frames than this hold no impact: three on one side of it, three on the other.
const LEAST_FRAMES: usize = 6;

/// Measures `video`. `calibration_name` is what messages call the calibration.
///
/// # Errors
///
/// [`MeasureError`] where there is nothing to measure on; a [`Measurement`] with [`Outcome::Rejected`] where the
/// recording was read but shows no flight with a bounce.
pub fn measure(
    video: &Path,
    calibration: &Calibration,
    calibration_name: &str,
    accuracy: Accuracy,
    progress: &mut dyn FnMut(Progress),
) -> Result<Measurement, MeasureError> {
    let misfit = |source| MeasureError::Calibration {
        name: calibration_name.to_owned(),
        video: video.display().to_string(),
        source,
    };
    calibration.rectification().map_err(misfit)?;
    let source = opened(video, calibration, calibration_name, &misfit)?;
    let seen = observe::observe(video, source, progress)?;
    if seen.stamps_s.len() < LEAST_FRAMES {
        return Err(MeasureError::NothingToSee {
            path: video.to_owned(),
            frames: seen.stamps_s.len(),
        });
    }
    progress(Progress::Fit);
    // Where a camera moves, the calibration is that of the first frame; all is measured in the reference picture.
    let first = seen.registrations.first().filter(|r| !r.is_still());
    let moved = first.map(|r| calibration.shifted(-r.shift_u_px, -r.shift_v_px));
    let calibration = moved.as_ref().unwrap_or(calibration);
    let map = calibration.rectification().map_err(misfit)?;
    let mut work = Work::new(video, calibration, map, seen, accuracy);
    match work.find_flight() {
        Ok(flight) => work.measured(&flight).map_err(misfit),
        Err(reason) => Ok(work.rejected(warn::no_flight(&reason, &work.seen, &work.base, calibration))),
    }
}

/// The recording, where nothing speaks against it before it is decoded.
fn opened(
    video: &Path,
    calibration: &Calibration,
    calibration_name: &str,
    misfit: &impl Fn(CalibrationError) -> MeasureError,
) -> Result<Box<dyn FrameSource + Send>, MeasureError> {
    let source = crate::frames::open(video)?;
    let info = source.info();
    calibration
        .check_image_size(info.width_px, info.height_px)
        .map_err(misfit)?;
    calibration
        .viewpoint(1.0, (info.width_px, info.height_px))
        .map_err(misfit)?;
    if !info.has_time_base && calibration.frame_rate_hz.is_none() {
        return Err(MeasureError::NoClock {
            path: video.to_owned(),
            calibration: calibration_name.to_owned(),
        });
    }
    Ok(source)
}

/// A recording under measurement.
struct Work<'a> {
    video: &'a Path,
    calibration: &'a Calibration,
    accuracy: Accuracy,
    map: Rectification,
    seen: Observation,
    repeats: Vec<bool>,
    base: TimeBase,
    found: Vec<Found>,
    shared: Option<Shared>,
    /// The camera's angles, where its lens, or its distance and the scale are known.
    optics: Option<Optics>,
    warnings: Vec<Warning>,
}

impl<'a> Work<'a> {
    fn new(
        video: &'a Path,
        calibration: &'a Calibration,
        map: Rectification,
        seen: Observation,
        accuracy: Accuracy,
    ) -> Self {
        let mut work = Self {
            video,
            calibration,
            accuracy,
            map,
            repeats: vec![false; seen.stamps_s.len()],
            base: TimeBase::new(&seen.stamps_s, &[], calibration.frame_rate_hz),
            seen,
            found: Vec::new(),
            shared: None,
            optics: None,
            warnings: Vec::new(),
        };
        // A scale that rests on the recording itself has to wait for the ball.
        let scale = calibration.metres_per_unit(&ScaleEvidence::default());
        work.optics = work.optics_at(scale.ok());
        let repeats = flight::repeats::find(&work.first_spots(), &work.seen.changes, work.units_per_px());
        work.repeats = repeats.frames;
        work.base = TimeBase::new(&work.seen.stamps_s, &work.repeats, calibration.frame_rate_hz);
        if calibration.frame_rate_hz.is_none() {
            work.even_clock();
        }
        let skips = work.base.interval_s.map_or_else(Vec::new, |interval_s| {
            pairs(&flight::skips::find(&work.first_spots(), interval_s))
        });
        work.base = work.base.with_skips(&skips);
        work.note_file();
        work
    }

    /// Where repeats come regularly, the clock of distinct frames may be even, and the stamps be those of another: the one
    /// that the ball's places suit counts.
    fn even_clock(&mut self) {
        let Some((even, repeats)) = self.base.evenly(&self.seen.stamps_s, &self.repeats) else {
            return;
        };
        let by_stamps = self.first_spots();
        let before = (
            std::mem::replace(&mut self.base, even),
            std::mem::replace(&mut self.repeats, repeats),
        );
        if !flight::clock::suits_better(&self.first_spots(), &by_stamps) {
            (self.base, self.repeats) = before;
        }
    }

    /// What is odd about the file and its clock.
    fn note_file(&mut self) {
        self.warnings = warn::file(&self.seen, &self.base, &self.repeats, self.calibration);
        self.warnings.extend(warn::perspective(self.calibration));
    }

    fn falls(&self) -> bool {
        self.calibration.view == View::Side
    }

    /// Length of a pixel in the middle of the picture, plane units.
    fn units_per_px(&self) -> f64 {
        let info = &self.seen.info;
        let middle = PixelPoint::new(info.width_px as f64 / 2.0, info.height_px as f64 / 2.0);
        self.map
            .jacobian(middle)
            .map_or(1.0, |j| j.determinant().abs().sqrt())
    }

    /// Length of a pixel of the usual ball's radius, plane units.
    fn ball_units_per_px(&self) -> f64 {
        self.silhouettes().units_per_px().unwrap_or(1.0)
    }

    /// Spots of everything round, by the first centres, repeats left out.
    fn first_spots(&self) -> Vec<Spot> {
        self.seen
            .sightings
            .iter()
            .enumerate()
            .filter(|(_, s)| !self.repeats[s.frame])
            .filter_map(|(i, s)| self.first_spot(i, &s.centre?))
            .collect()
    }

    /// The flight, with the time of frames that its impacts show to be missing.
    fn find_flight(&mut self) -> Result<Flight, NoFlight> {
        let flight = self.find_flight_as_timed()?;
        let skips = flight::skips::at_impacts(&flight);
        if skips.is_empty() {
            return Ok(flight);
        }
        let before = (
            self.base.clone(),
            self.found.clone(),
            self.shared.clone(),
            self.optics,
        );
        self.base = self.base.clone().with_skips(&pairs(&skips));
        self.found.clear();
        let moved = self.find_flight_as_timed();
        // Where that is what was missing, the impacts are where they were, and their arcs meet.
        match moved {
            Ok(moved) if moved.used() >= flight.used() && flight::skips::at_impacts(&moved).is_empty() => {
                self.note_file();
                Ok(moved)
            }
            _ => {
                (self.base, self.found, self.shared, self.optics) = before;
                Ok(flight)
            }
        }
    }

    /// The flight: first with centres found freely, then with what the recording has in common held.
    fn find_flight_as_timed(&mut self) -> Result<Flight, NoFlight> {
        let spots = self.first_spots();
        let forces = if self.falls() {
            Forces::Fall
        } else {
            self.overhead(None, None).map_or(Forces::None, Forces::Overhead)
        };
        let flight = flight::find(&spots, forces)?;
        for p in &flight.points {
            if let Some(centre) = self.seen.sightings[p.spot.id].centre {
                self.found.push(Found {
                    sighting: p.spot.id,
                    centre,
                });
            }
        }
        let first_found = self.found.clone();
        // A radius that the pixels seem to tell may be a false one, and a ball that looks too different from frame to frame
        // has no one appearance: the outlines' radius has to do, or the outline itself.
        let looks = [
            (self.accuracy, Radius::Fitted),
            (self.accuracy, Radius::Outlines),
            (Accuracy::Fast, Radius::Outlines),
        ];
        let looks = if self.accuracy == Accuracy::Fast {
            &looks[2..]
        } else {
            &looks[..]
        };
        let mut as_first_seen = Err(NoFlight::NothingFalls {
            longest: flight.points.len(),
        });
        for &(accuracy, radius) in looks {
            if as_first_seen.is_ok() && accuracy != self.accuracy {
                break;
            }
            match self.refined(&flight, accuracy, radius) {
                Ok(better) if self.shared.is_some() => return Ok(better),
                outcome => {
                    as_first_seen = as_first_seen.or(outcome);
                    self.found.clone_from(&first_found);
                    self.shared = None;
                }
            }
        }
        as_first_seen
    }

    fn scenery(&self) -> refine::Scenery<'_> {
        refine::Scenery {
            seen: &self.seen,
            map: &self.map,
            silhouettes: self.silhouettes(),
        }
    }

    fn frames(&self) -> refine::Frames<'_> {
        refine::Frames {
            times_s: &self.base.times_s,
            skip: &self.repeats,
        }
    }

    /// The flight once more with centres by the method of `accuracy`: first where the first flight leads, then where
    /// the better arcs do.
    fn refined(&mut self, first: &Flight, accuracy: Accuracy, radius: Radius) -> Result<Flight, NoFlight> {
        let mut flight = first.clone();
        let above = matches!(first.fit.forces, Forces::Overhead(_));
        self.shared = None;
        for round in 0..2 {
            // Seen from above, a better flight is a better size of the ball in every frame.
            let again = accuracy == Accuracy::Fine || above;
            let learned = self.shared.clone().filter(|_| !again);
            let scenery = self.scenery();
            let learn = || refine::shared(&scenery, &self.found, &flight, accuracy, radius);
            let Some(shared) = learned.or_else(learn) else {
                break;
            };
            // What was found with the same appearance stays; a new one is a new measurement.
            let known: &[Found] = if round > 0 && !again { &self.found } else { &[] };
            let found = refine::centres(&scenery, &flight, &shared, &self.frames(), known, accuracy);
            let scale = self.metres_per_unit(&flight, Some(shared.radius_px)).ok();
            self.optics = self.optics_at(scale);
            let forces = self.forces(&flight, &shared);
            let refitted = flight::again(&self.spots_of(&found), &flight, forces);
            let kept = self.kept_part(&found, first);
            match refitted {
                Some(better) if kept >= KEPT_PART && is_as_full(&better, first) => {
                    (flight, self.found) = if above {
                        (better, found)
                    } else {
                        self.extended(better, found, &shared, forces, accuracy)
                    };
                    self.shared = Some(shared);
                }
                // A ball of a few pixels may be too blurred for its edge to be fitted: its outline has to do. A
                // larger thing without the outline of a ball is no ball.
                refitted
                    if shared.radius_px.value > SMALL_BALL_PX && (refitted.is_none() || kept < BALL_PART) =>
                {
                    return Err(NoFlight::NothingFalls {
                        longest: first.points.len(),
                    });
                }
                _ => break,
            }
        }
        Ok(flight)
    }

    /// The part of the points used in `first` in whose frames the ball was found again.
    fn kept_part(&self, found: &[Found], first: &Flight) -> f64 {
        let frames: Vec<usize> = found
            .iter()
            .map(|f| self.seen.sightings[f.sighting].frame)
            .collect();
        let again = first
            .points
            .iter()
            .filter(|p| is_used(p.use_) && frames.binary_search(&p.spot.frame).is_ok());
        again.count() as f64 / first.used().max(1) as f64
    }

    /// The flight with arcs before and after it, that the first look had too few points for, now that the ball's size
    /// is known.
    fn extended(
        &self,
        flight: Flight,
        mut found: Vec<Found>,
        shared: &Shared,
        forces: Forces,
        accuracy: Accuracy,
    ) -> (Flight, Vec<Found>) {
        let (from, to) = flight.time_span();
        let within = |t: f64| t >= from && t <= to;
        let times_s = &self.base.times_s;
        found.retain(|f| within(times_s[self.seen.sightings[f.sighting].frame]));
        found.extend(refine::of_that_size(
            &self.scenery(),
            &flight,
            shared,
            &self.frames(),
            accuracy,
            within,
        ));
        found.sort_by_key(|f| f.sighting);
        match flight::find(&self.spots_of(&found), forces) {
            Ok(longer) if longer.used() >= flight.used() => (longer, found),
            _ => {
                found.retain(|f| within(times_s[self.seen.sightings[f.sighting].frame]));
                (flight, found)
            }
        }
    }

    /// Gravity, and drag where the ball's size and mass tell it.
    fn forces(&self, flight: &Flight, shared: &Shared) -> Forces {
        let scale = self.metres_per_unit(flight, Some(shared.radius_px)).ok();
        let scale = scale.map(|s| s.value);
        if !self.falls() {
            return self
                .overhead(scale, Some(flight))
                .map_or(Forces::None, Forces::Overhead);
        }
        self.drag(scale, flight.usual_speed())
            .map_or(Forces::Fall, Forces::FallWithDrag)
    }

    fn spots_of(&self, found: &[Found]) -> Vec<Spot> {
        found
            .iter()
            .filter_map(|f| self.spot(f.sighting, &f.centre))
            .collect()
    }

    /// The ball's radius: common to all frames, or (a ball of a few pixels) the outlines' median.
    fn radius_px(&self) -> Option<Quantity> {
        let outlines = || {
            let silhouettes = self.silhouettes();
            let usual = |f: &Found| {
                let disc = &f.centre.disc;
                let registration = &self.seen.sightings[f.sighting].registration;
                let drawn = silhouettes.at(registration.reference_from_frame(disc.centre));
                disc.radius_px / drawn.map_or(1.0, |drawn| drawn.size)
            };
            let mut radii: Vec<f64> = self.found.iter().map(usual).collect();
            Quantity::undetermined(median(&mut radii)?)
        };
        self.shared.as_ref().map(|s| s.radius_px).or_else(outlines)
    }

    /// Metres a plane unit, from whatever scale the calibration names.
    fn metres_per_unit(
        &self,
        flight: &Flight,
        radius_px: Option<Quantity>,
    ) -> Result<Quantity, CalibrationError> {
        let units = self.ball_units_per_px();
        let g = flight.fit.gravity();
        self.calibration.metres_per_unit(&ScaleEvidence {
            ball_radius_units: radius_px.map(|r| r.scaled(units)),
            gravity_units_s2: (g > 0.0)
                .then(|| Quantity::new(g, flight.fit.covariance[(GRAVITY, GRAVITY)].max(0.0).sqrt()))
                .flatten(),
        })
    }

    fn measured(mut self, flight: &Flight) -> Result<Measurement, CalibrationError> {
        let metres_per_unit = self.metres_per_unit(flight, self.radius_px())?;
        let (free, lift) = self
            .scene(flight, metres_per_unit, Lift::default())
            .without_lift();
        let flight = &Flight {
            extra: free.extra,
            ..flight.clone()
        };
        let free = doubt::widened(&free, self.calibration, &self.map);
        let scene = self.scene(&free, metres_per_unit, lift);
        let bounces = scene.bounces();
        let distances = scene.distances(&bounces);
        let gravity = scene.gravity_m_s2();
        let radius_m = self.radius_m(metres_per_unit);
        let frame = WorldFrame::new(&scene, &bounces, metres_per_unit, radius_m, self.calibration);
        let walls = (0..flight.impacts.len())
            .filter(|&k| scene.kind(k) == Some(ImpactKind::Wall))
            .count();
        let judged = warn::Judged {
            calibration: self.calibration,
            flight,
            scene: &scene,
            bounces: &bounces,
            gravity,
            radius_m,
            radius_units: self.radius_px().map(|r| r.value * self.ball_units_per_px()),
            walls,
            impossible: scene.impossible(&bounces),
            x0_missing: distances.x0_m.is_none(),
            interval_s: self.base.interval_s.unwrap_or(flight.interval_s),
        };
        self.warnings.extend(warn::measured(&judged));
        self.warnings
            .extend(warn::unlearned(self.accuracy, self.method()));
        self.warnings.extend(self.light(flight));
        self.warnings
            .extend(warn::lingering(flight, self.seen.stamps_s.len()));
        let outcome = if bounces.is_empty() {
            Outcome::Rejected {
                reason: warn::no_bounce(flight, walls, self.calibration),
            }
        } else {
            Outcome::Measured
        };
        let bounces: Vec<_> = bounces.into_iter().map(|(_, b)| b).collect();
        Ok(Measurement {
            video: self.video_facts(),
            view: self.calibration.view,
            outcome,
            track: self.track(flight, &frame),
            gravity_m_s2: gravity,
            distances,
            readings: self.falls().then(|| reading::read(&bounces)).flatten(),
            bounces,
            arcs: drawing::arcs(flight, &self.map, &frame),
            strobe: Some(drawing::strobe(&self.seen, &self.found, flight)),
            warnings: self.warnings,
        })
    }

    /// The flight in metres; `lift` is what its points were taken from.
    fn scene<'f>(&'f self, flight: &'f Flight, metres_per_unit: Quantity, lift: Lift) -> Scene<'f> {
        let first = match flight.fit.forces {
            Forces::Overhead(_) => flight.points.iter().find(|p| is_used(p.use_)),
            _ => flight.points.first(),
        };
        let first_right = first
            .and_then(|p| in_plane(flight, p))
            .map_or(0.0, |place| place.right);
        let units_per_px = self.units_per_px();
        let displaced_px = flight.displaced_std() / units_per_px;
        let picture = Picture {
            units_per_px,
            common_std_px: refine::common_std_px(self.shared.as_ref(), displaced_px),
            places_std_px: refine::places_std_px(displaced_px),
        };
        Scene::new(
            flight,
            self.calibration,
            metres_per_unit,
            picture,
            first_right,
            lift,
        )
    }

    /// That the light changes during the flight.
    fn light(&self, flight: &Flight) -> Option<Warning> {
        let used = flight.points.iter().filter(|p| is_used(p.use_));
        let flown: Vec<usize> = used.map(|p| p.spot.frame).collect();
        warn::light(&self.seen, &flown)
    }

    fn rejected(&self, reason: String) -> Measurement {
        Measurement {
            video: self.video_facts(),
            view: self.calibration.view,
            outcome: Outcome::Rejected { reason },
            track: Track {
                method: method_name(self.accuracy).to_owned(),
                detected: 0,
                centre_std_px: None,
                radius_px: None,
                points: Vec::new(),
            },
            gravity_m_s2: None,
            bounces: Vec::new(),
            distances: crate::bounce::Distances::default(),
            readings: None,
            warnings: self.warnings.clone(),
            arcs: Vec::new(),
            strobe: Some(drawing::empty_strobe(&self.seen)),
        }
    }

    /// The method that the centres are by: where the ball's appearance could not be learned, its outline had to do.
    fn method(&self) -> Accuracy {
        let learned = self.shared.as_ref().is_some_and(|s| s.appearance.is_some());
        if learned { self.accuracy } else { Accuracy::Fast }
    }

    /// The ball's radius: as given, or as seen.
    fn radius_m(&self, metres_per_unit: Quantity) -> Option<f64> {
        self.calibration
            .ball
            .radius_m
            .or_else(|| Some(self.radius_px()?.value * self.ball_units_per_px() * metres_per_unit.value))
    }

    fn video_facts(&self) -> VideoFacts {
        let times = &self.base.times_s;
        VideoFacts {
            path: self.video.to_owned(),
            width_px: self.seen.info.width_px,
            height_px: self.seen.info.height_px,
            frames: self.seen.health.frames_read,
            frame_rate_hz: self.base.interval_s.map(|i| 1.0 / i),
            duration_s: times.last().copied().unwrap_or(0.0),
            time_source: if self.calibration.frame_rate_hz.is_some() {
                TimeSource::Calibration
            } else {
                TimeSource::Stamps
            },
        }
    }

    fn track(&self, flight: &Flight, frame: &WorldFrame) -> Track {
        let centre =
            |id: usize| -> Option<&Centre> { refine::of_sighting(&self.found, id).map(|f| &f.centre) };
        let points: Vec<TrackPoint> = flight
            .points
            .iter()
            .filter_map(|p| {
                let c = centre(p.spot.id)?;
                Some(TrackPoint {
                    frame: p.spot.frame,
                    time_s: p.spot.time_s,
                    pixel: self.centre_px(p).unwrap_or(c.disc.centre),
                    std_px: Some(c.std_px() * flight.std(&p.spot) / p.spot.std),
                    world: in_plane(flight, p).map(|place| frame.world(place.right, place.up)),
                    use_: drawing::use_of(p, frame),
                    residual_m: drawing::residual(flight, p, frame),
                })
            })
            .collect();
        let mut stds: Vec<f64> = points
            .iter()
            .filter(|p| matches!(p.use_, PointUse::Used(_)))
            .filter_map(|p| p.std_px)
            .collect();
        Track {
            method: method_name(self.method()).to_owned(),
            detected: points.len(),
            centre_std_px: median(&mut stds),
            radius_px: self.radius_px(),
            points,
        }
    }
}

/// A code value stretched from black..white to 0..255.
fn stretched(value: u8, range: LumaRange) -> u8 {
    let (black, white) = (f64::from(range.black), f64::from(range.white));
    ((f64::from(value) - black) * 255.0 / (white - black))
        .round()
        .clamp(0.0, 255.0) as u8
}

/// Whether `better` uses the points of `first` within its own time: at the ends better centres may show that what looked
/// like an arc was a ball that rolls.
fn is_as_full(better: &Flight, first: &Flight) -> bool {
    let (from, to) = better.time_span();
    let within = |p: &&flight::FlightPoint| is_used(p.use_) && p.spot.time_s >= from && p.spot.time_s <= to;
    better.used() as f64 >= KEPT_PART * first.points.iter().filter(within).count() as f64
}

/// The first frame after each gap, and the frames missing in it.
fn pairs(skips: &[flight::skips::Skip]) -> Vec<(usize, usize)> {
    skips.iter().map(|s| (s.frame, s.missing)).collect()
}

/// Used for an arc?
fn is_used(use_: SpotUse) -> bool {
    matches!(use_, SpotUse::Used(_))
}
