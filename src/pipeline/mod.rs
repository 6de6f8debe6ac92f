//! One recording, from file to result: the order of the stages, nothing else.
//!
//! | stage | what it does | gives |
//! |---|---|---|
//! | `decode` | every frame looked at once: what moves, and its first centre | `decode::Decoded` |
//! | `clock` | when each frame was taken; duplicate and missing frames | `clock::Clocked` |
//! | `track` | the ball among all that moves, by first centres or given ones | `track::Tracked` |
//! | `refine` | appearance, centres, scale and flight in turn | `refine::Refined` |
//! | `impacts` | metres: bounces, distances, the checks | `in_metres::Impacts` |
//! | `result` | all of it put together | [`Measurement`] |
//!
//! A stage takes values and gives a value, with its warnings. From `track` on none needs pixels but `refine`, so centres
//! that come from elsewhere enter there: `track::tracked` takes any `spots::BallCentre`s and times.

mod ball_model;
mod calibration_uncertainty;
mod camera;
mod centres;
mod clock;
mod decode;
mod drawing;
mod error;
mod impacts;
mod in_metres;
mod measurement;
mod refine;
mod result;
mod spots;
mod track;
mod warnings;

pub use decode::Progress;
pub use error::MeasureError;
pub use measurement::*;

use crate::calibration::{Calibration, CalibrationError};
use crate::detect::centre::Accuracy;
use crate::flight::dropped_frames;
use crate::frames::FrameSource;
use camera::CalibratedCamera;
use clock::Clocked;
use refine::Refinement;
use std::path::Path;
use warnings::rejection;

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
        source: Box::new(source),
    };
    calibration.rectification().map_err(misfit)?;
    let source = opened(video, calibration, calibration_name, misfit)?;
    let decoded = decode::decode(video, source, progress)?;
    progress(Progress::Fit);
    let calibration = decoded.calibration_of_reference(calibration);
    let size_px = (decoded.info.width_px, decoded.info.height_px);
    let camera = CalibratedCamera::new(&calibration, size_px, decoded.camera_stands_still());
    let camera = &camera.map_err(misfit)?;

    let centres = spots::first_centres(&decoded.sightings);
    let optics = camera.optics(camera.metres_per_unit_before_flight());
    let clocked = clock::clocked(camera, &decoded, &centres, optics);
    let follow = |clocked: &Clocked, optics| {
        let tracked = track::tracked(camera, clocked, &centres, optics)?;
        let recording = Refinement {
            camera,
            decoded: &decoded,
            clocked,
            accuracy,
        };
        refine::refined(&recording, tracked)
    };
    let first = follow(&clocked, optics);
    // The impacts may show frames to be missing that no stamp does: then once more on the clock with them. Where that is what
    // was missing, the impacts are where they were, and their arcs meet.
    let later = first.as_ref().ok().and_then(|first| {
        let first = &first.tracked;
        let later = clocked.with_frames_missing_at_impacts(&first.flight, camera, &decoded)?;
        let refined = follow(&later, first.optics).ok()?;
        let flight = &refined.tracked.flight;
        let meets = flight.used() >= first.flight.used() && dropped_frames::at_impacts(flight).is_empty();
        meets.then_some((later, Ok(refined)))
    });
    let (clocked, refined) = later.unwrap_or((clocked, first));

    let facts = result::video_facts(video, decoded.health.frames_read, camera, &clocked);
    let before = [
        &decoded.warnings[..],
        &clocked.warnings,
        camera.warnings().as_slice(),
    ]
    .concat();
    match refined {
        Ok(refined) => {
            let impacts = impacts::impacts(camera, &clocked, &refined).map_err(misfit)?;
            let strobe = drawing::strobe(&decoded, &refined.tracked.centres, &impacts.flight);
            Ok(result::measured(
                facts,
                camera,
                &refined,
                impacts,
                Some(strobe),
                before,
            ))
        }
        Err(reason) => {
            let reason = rejection::no_flight(&reason, &decoded, &clocked.base, &calibration);
            let strobe = drawing::empty_strobe(&decoded);
            Ok(result::rejected(
                facts,
                camera,
                accuracy,
                reason,
                Some(strobe),
                before,
            ))
        }
    }
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
