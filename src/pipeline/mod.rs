//! One recording, from file to result: the order of the steps, nothing else.
//!
//! decode → repeats, skips → time base → flight → shared radius, blur, exposure → centres again → flight again → scale →
//! bounces → readings → warnings → drawing.

mod assemble;
mod calibration_uncertainty;
mod camera;
mod decode;
mod drawing;
mod refine;
mod result;
mod search;
mod warnings;
mod world_frame;

pub use result::*;

use crate::calibration::{Calibration, CalibrationError, Optics, Rectification, ScaleEvidence};
use crate::detect::centre::Accuracy;
use crate::flight::fit::GRAVITY;
use crate::flight::linking::Spot;
use crate::flight::{self, Flight, SpotUse};
use crate::frames::timebase::TimeBase;
use crate::frames::{FrameError, FrameSource};
use crate::geometry::PixelPoint;
use crate::quantity::{Quantity, median};
use decode::Decoded;
use refine::{BallCentre, BallModel};
use std::path::{Path, PathBuf};

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
    let seen = decode::decode(video, source, progress)?;
    if seen.stamps_s.len() < LEAST_FRAMES {
        return Err(MeasureError::NothingToSee {
            path: video.to_owned(),
            frames: seen.stamps_s.len(),
        });
    }
    progress(Progress::Fit);
    // Where a camera moves, the calibration is that of the first frame; all is measured in the reference picture.
    // (A swing of a fixed camera is none of that.)
    let follows = !seen.detector.background.registrar.fixed;
    let first = seen.registrations.first().filter(|r| follows && !r.is_still());
    let moved = first.map(|r| calibration.shifted(-r.shift_u_px, -r.shift_v_px));
    let calibration = moved.as_ref().unwrap_or(calibration);
    let map = calibration.rectification().map_err(misfit)?;
    let mut work = Recording::new(video, calibration, map, seen, accuracy);
    match work.find_flight() {
        Ok(flight) => work.measured(flight).map_err(misfit),
        Err(reason) => Ok(work.rejected(warnings::no_flight(&reason, &work.seen, &work.base, calibration))),
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

/// Where the rim of a ball is in its blurred edge depends on the lens's line spread, on focus and on the light: the radius is
/// no better known than this, px, however many frames agree.
const EDGE_STD_PX: f64 = 0.05;

/// A recording under measurement.
struct Recording<'a> {
    video: &'a Path,
    calibration: &'a Calibration,
    accuracy: Accuracy,
    map: Rectification,
    seen: Decoded,
    repeats: Vec<bool>,
    base: TimeBase,
    found: Vec<BallCentre>,
    shared: Option<BallModel>,
    /// The camera's angles, where its lens, or its distance and the scale are known.
    optics: Option<Optics>,
    warnings: Vec<Warning>,
}

impl<'a> Recording<'a> {
    fn new(
        video: &'a Path,
        calibration: &'a Calibration,
        map: Rectification,
        seen: Decoded,
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
        let repeats =
            flight::duplicate_frames::find(&work.first_spots(), &work.seen.changes, work.units_per_px());
        work.repeats = repeats.frames;
        work.base = TimeBase::new(&work.seen.stamps_s, &work.repeats, calibration.frame_rate_hz);
        if calibration.frame_rate_hz.is_none() {
            work.even_clock();
        }
        let skips = work.base.interval_s.map_or_else(Vec::new, |interval_s| {
            pairs(&flight::dropped_frames::find(&work.first_spots(), interval_s))
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
        self.warnings = warnings::file(&self.seen, &self.base, &self.repeats, self.calibration);
        self.warnings.extend(warnings::perspective(self.calibration));
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

    /// The ball's radius: common to all frames, or (a ball of a few pixels) the outlines' median.
    fn radius_px(&self) -> Option<Quantity> {
        let outlines = || {
            let silhouettes = self.silhouettes();
            let usual = |f: &BallCentre| {
                let disc = &f.centre.disc;
                let registration = &self.seen.sightings[f.sighting].registration;
                let drawn = silhouettes.at(registration.reference_from_frame(disc.centre));
                disc.radius_px / drawn.map_or(1.0, |drawn| drawn.size)
            };
            let mut radii: Vec<f64> = self.found.iter().map(usual).collect();
            Quantity::undetermined(median(&mut radii)?)
        };
        let radius = self.shared.as_ref().map(|s| s.radius_px).or_else(outlines)?;
        let std = radius.std_uncertainty.map_or(f64::NAN, |s| s.hypot(EDGE_STD_PX));
        Quantity::new(radius.value, std)
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
}

/// The first frame after each gap, and the frames missing in it.
fn pairs(skips: &[flight::dropped_frames::DroppedFrames]) -> Vec<(usize, usize)> {
    skips.iter().map(|s| (s.frame, s.missing)).collect()
}

/// Used for an arc?
fn is_used(use_: SpotUse) -> bool {
    matches!(use_, SpotUse::Used(_))
}
