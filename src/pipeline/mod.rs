//! One recording, from file to result: the order of the stages, nothing else.
//!
//! | stage | what it does | gives |
//! |---|---|---|
//! | `decode` | every frame looked at once: what moves, and its first centre | `decode::Decoded` |
//! | `clock` | when each frame was taken; duplicate and missing frames | `clock::Clocked` |
//! | `launches` | the ball among all that moves, each time that it is set free (`track`, by first centres or given ones) | `launches::TrackedLaunch` |
//! | `launch` | one launch after the other, `refine`: appearance, centres, scale and flight in turn | `refine::Refined` |
//! | | `ball_rotation`: how the ball turns on each arc, by its marks | `ball_rotation::ArcRotation` |
//! | | and `impacts`, in metres: bounces, distances, the checks | `in_metres::Impacts` |
//! | `result` | all of it put together | [`Measurement`] |
//!
//! A stage takes values and gives a value, with its warnings. From `track` on none needs pixels but `refine`, so centres
//! that come from elsewhere enter there ([`measure_points`]): `track::tracked` takes any `spots::BallCentre`s and times.

mod ball_model;
mod ball_rotation;
mod calibration_uncertainty;
mod camera;
mod centres;
mod clock;
mod decode;
mod drawing;
mod edited;
mod error;
mod given;
mod impacts;
mod in_metres;
mod launch;
mod launches;
mod look_through;
mod measurement;
mod readout;
mod refine;
mod result;
mod rolling_shutter;
mod scaled;
mod scene_colours;
mod sighting_store;
mod spots;
mod track;
mod unseen_fall;
mod unseen_motion;
mod untold_camera;
mod untold_lens;
mod warnings;

pub use decode::Progress;
pub use error::MeasureError;
pub use given::measure_points;
pub use look_through::{LookedThrough, RoundThing, look_through};
pub use measurement::*;

use crate::calibration::{Calibration, CalibrationError};
use crate::detect::centre::Accuracy;
use crate::edits::Edits;
use crate::frames::FrameSource;
use camera::CalibratedCamera;
use launch::{LaunchMeasurement, MeasuredLaunch, MeasuredLaunches, NotMeasured};
use result::RecordingFacts;
use spots::BallCentre;
use std::path::Path;
use warnings::{of_file, of_launches, rejection};

/// How a recording is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MeasureSettings {
    /// How centres are found.
    pub accuracy: Accuracy,
    /// Whether the ball's marks are asked for its spin.
    pub spin: SpinSearch,
}

/// Whether the ball's marks are asked for its spin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SpinSearch {
    /// Where it has any.
    #[default]
    Auto,
    /// No.
    Off,
}

impl SpinSearch {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Auto, Self::Off];

    /// Its name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Off => "off",
        }
    }
}

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
    measure_edited(
        video,
        calibration,
        calibration_name,
        MeasureSettings {
            accuracy,
            spin: SpinSearch::Auto,
        },
        &Edits::default(),
        progress,
    )
}

/// Measures `video` as [`measure`] does, with what a person said of it.
///
/// # Errors
/// Those of [`measure`], and [`MeasureError::Edits`] where the edits name what is not in the recording.
pub fn measure_edited(
    video: &Path,
    calibration: &Calibration,
    calibration_name: &str,
    settings: MeasureSettings,
    edits: &Edits,
    progress: &mut dyn FnMut(Progress),
) -> Result<Measurement, MeasureError> {
    let MeasureSettings { accuracy, spin } = settings;
    let misfit = |source| MeasureError::Calibration {
        name: calibration_name.to_owned(),
        video: video.display().to_string(),
        source: Box::new(source),
    };
    calibration.rectification().map_err(misfit)?;
    let source = opened(video, calibration, calibration_name, misfit)?;
    let mut decoded = decode::decode(video, source, progress)?;
    let excluded = edited::apply(&mut decoded, edits, video)?;
    progress(Progress::Fit);
    let calibration = decoded.calibration_of_reference(calibration);
    let size_px = (decoded.info.width_px, decoded.info.height_px);
    let row_order = decoded.info.row_order;
    let camera = CalibratedCamera::new(&calibration, size_px, row_order, decoded.camera_stands_still());
    let camera = camera.map_err(misfit)?.seen_by(&decoded.detector.background);
    let camera = &camera.with_colour(decoded.colour.as_ref());

    let mut centres = spots::first_centres(&decoded.sightings);
    let optics = camera.optics(camera.metres_per_unit_before_flight());
    let mut clock = clock::clocked(camera, &decoded, &centres, optics);
    if let Some(range_s) = edits.time_range_s {
        edited::keep_times(&mut decoded, range_s, &clock.base.times_s);
        centres = spots::first_centres(&decoded.sightings);
        clock = clock::clocked(camera, &decoded, &centres, optics);
    }
    edited::mark_chosen(&mut centres, edits, &clock.duplicates);
    let better_centres: Vec<BallCentre>;
    let mut seen = LaunchMeasurement {
        camera,
        decoded: &decoded,
        centres: &centres,
        accuracy,
        looks_at_marks: spin == SpinSearch::Auto,
        not_impacts_s: &edits.not_impacts_s,
    };
    let launches_of = |seen: &LaunchMeasurement<'_>, clock: &clock::Clocked| {
        let mut clock = clock.clone();
        let found = launches::tracked(seen.camera, &clock, seen.centres, optics);
        let found = found.map_err(NotMeasured::NoFlight);
        let measured = found.and_then(|found| seen.each(&mut clock, &found));
        (clock, measured)
    };
    let (mut clocked, mut measured) = launches_of(&seen, &clock);
    // The best centres may tell another clock than the first ones did: then once more by that and by them.
    let best = measured.as_ref().map(|m| m.centres()).unwrap_or_default();
    if let Some(better) = clock.by_best_centres(camera, &decoded, (&best, &centres), optics) {
        clock = better;
        better_centres = spots::with_better(&centres, &best);
        seen.centres = &better_centres;
        (clocked, measured) = launches_of(&seen, &clock);
    }
    // The arcs may show that rows have times of their own: then once more by those.
    let rolling = {
        let by_rows = |rolling: &CalibratedCamera<'_>| seen.by(rolling).most_evident(&clocked, optics);
        let first = measured.as_ref().ok().map(|m| &m.first.refined);
        rolling_shutter::found(camera, first, &clock.base, by_rows)
    };
    let camera = rolling.as_ref().unwrap_or(camera);
    if rolling.is_some() {
        (clocked, measured) = launches_of(&seen.by(camera), &clock);
    }

    let frames = decoded.health.frames_read;
    let facts = RecordingFacts::new((video, frames), calibration_name, camera, &clocked);
    let by_colour = decoded.colour.as_ref().map(of_file::by_colour);
    let before = [
        &decoded.warnings[..],
        by_colour.as_slice(),
        &clocked.warnings,
        &camera.warnings(),
    ]
    .concat();
    let empty = drawing::empty_strobe(&decoded);
    let put_together = |launch: MeasuredLaunch| {
        let MeasuredLaunch { refined, impacts } = launch;
        let strobe = drawing::strobe(empty.clone(), &decoded, &refined.tracked.centres, &impacts.flight);
        result::measured(&facts, camera, &refined, impacts, Some(strobe), &before)
    };
    let mut measurement = match measured {
        Ok(MeasuredLaunches {
            first,
            later,
            left_out,
        }) => {
            let cuts = of_launches::cut_out(&first, &later, (&decoded, &clocked.base), camera);
            let before = [&before[..], cuts.as_slice()].concat();
            let later = later.into_iter().map(put_together).collect();
            result::of_launches(put_together(first), later, left_out, before)
        }
        Err(NotMeasured::NoScale(source)) => return Err(misfit(source)),
        Err(NotMeasured::NoFlight(reason)) => {
            let seen = rejection::SeenThings {
                frames: decoded.stamps_s.len(),
                moving: decoded.moving,
                what: "moving regions",
            };
            let reason = rejection::no_flight(&reason, seen, &clocked.base, &calibration);
            let method = accuracy.method().words().description;
            result::rejected(facts, camera, method, reason, Some(empty), before)
        }
    };
    edited::note(&mut measurement, edits, &excluded, &clocked.base.times_s);
    Ok(measurement)
}

/// The recording, where nothing speaks against it before it is decoded.
fn opened(
    video: &Path,
    calibration: &Calibration,
    calibration_name: &str,
    misfit: impl Fn(CalibrationError) -> MeasureError,
) -> Result<Box<dyn FrameSource + Send>, MeasureError> {
    let source = crate::frames::open(video)?;
    let info = source.info();
    calibration
        .check_image_size(info.width_px, info.height_px)
        .map_err(&misfit)?;
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
