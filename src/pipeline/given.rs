//! Centres that another program found, on the way that a video's go from `track` on.
//!
//! Times are the file's, or its frames' by the calibration's rate: no clock is doubted, for nothing of the recording is seen. A centre's standard
//! uncertainty is the file's, and what the centres scatter by about the arcs beyond that; where the file tells none, the scatter alone. The ball's radius is the
//! calibration's; where it gives none, no radius is reported.
//!
//! Assumed: the camera stood still, and errors that all centres share are those of an outline
//! ([`OUTLINE_COMMON_STD_PX`](crate::impact::error_budget::OUTLINE_COMMON_STD_PX)).

use super::camera::CalibratedCamera;
use super::clock::Clocked;
use super::error::MeasureError;
use super::impacts::impacts;
use super::launch::{MeasuredLaunch, MeasuredLaunches, NotMeasured};
use super::launches::{self, TrackedLaunch};
use super::measurement::{Measurement, Warning};
use super::refine::Refined;
use super::result::{self, RecordingFacts};
use super::spots::BallCentre;
use super::warnings::{of_track, rejection};
use crate::calibration::{Calibration, CalibrationError};
use crate::detect::centre::Centre;
use crate::detect::registration::Registration;
use crate::frames::{Coded, RowOrder};
use crate::geometry::{PixelPoint, PlanePoint};
use crate::impact::error_budget::LEAST_CENTRE_STD_PX;
use crate::numeric::robust::median;
use crate::points::{GivenPlace, GivenPoint, GivenPoints};
use std::path::Path;

/// How a page says where the centres are from.
const METHOD: &str = "given: the centres of another program";

/// A ball of unknown size is taken to be as large as this for linking its centres, px, or as half of its usual step, whichever is more.
const LEAST_RADIUS_PX: f64 = 3.0;

/// Measures the centres in the file at `path`. `calibration_name` is what messages call the calibration.
///
/// # Errors
/// [`MeasureError`] where there is nothing to measure on; a [`Measurement`] that is rejected where the centres show no flight with a bounce.
pub fn measure_points(
    path: &Path,
    given: &GivenPoints,
    calibration: &Calibration,
    calibration_name: &str,
) -> Result<Measurement, MeasureError> {
    let misfit = |source| MeasureError::Calibration {
        name: calibration_name.to_owned(),
        video: path.display().to_string(),
        source: Box::new(source),
    };
    let times_s = times(given, calibration).ok_or_else(|| MeasureError::NoClock {
        path: path.to_owned(),
        calibration: calibration_name.to_owned(),
    })?;
    let camera = |size_px| CalibratedCamera::new(calibration, size_px, RowOrder::Down, true).map_err(misfit);
    let size_px = calibration.image_size_px;
    let pixels = pixels(&camera(size_px.unwrap_or((1, 1)))?, given).map_err(misfit)?;
    let camera = camera(size_px.unwrap_or_else(|| extent(&pixels)))?;
    let camera = &camera;

    let known_px = camera
        .ball_radius()
        .map(|units| units / camera.ball_units_per_px());
    let radius_px = known_px
        .unwrap_or_else(|| 0.5 * usual_step(given, &pixels))
        .max(LEAST_RADIUS_PX);
    let centres: Vec<BallCentre> = given
        .points
        .iter()
        .zip(&pixels)
        .enumerate()
        .map(|(id, (point, &pixel))| ball_centre(id, point, pixel, radius_px))
        .collect();
    let clocked = Clocked::given(&times_s);
    let found = launches::tracked(camera, &clocked, &centres, None);
    let measured = found.map_err(NotMeasured::NoFlight).and_then(|found| {
        let each = |launch: &TrackedLaunch| -> Result<MeasuredLaunch, NotMeasured> {
            let tracked = launches::only_within(launch.tracked.clone(), &launch.frames);
            let warnings: Vec<Warning> = of_track::others(&tracked.others, camera).into_iter().collect();
            let refined = Refined {
                tracked,
                ball: None,
                radius_is_seen: known_px.is_some(),
                method: METHOD,
                warnings,
            };
            let impacts = impacts(camera, &clocked, &refined, &[]).map_err(NotMeasured::NoScale)?;
            Ok(MeasuredLaunch { refined, impacts })
        };
        let measured = found.iter().filter_map(|l| Some((l.is_best, each(l).ok()?)));
        let several = || MeasuredLaunches::several(measured, found.len());
        if let Some(several) = (found.len() > 1).then(several).flatten() {
            return Ok(several);
        }
        MeasuredLaunches::alone(&found, each)
    });
    let facts = RecordingFacts::new(
        (path, clocked.base.times_s.len() as u64),
        calibration_name,
        camera,
        &clocked,
    );
    let put_together =
        |launch: MeasuredLaunch| result::measured(&facts, camera, &launch.refined, launch.impacts, None, &[]);
    match measured {
        Ok(MeasuredLaunches {
            first,
            later,
            left_out,
        }) => {
            let later = later.into_iter().map(put_together).collect();
            Ok(result::of_launches(
                put_together(first),
                later,
                left_out,
                camera.warnings(),
            ))
        }
        Err(NotMeasured::NoScale(source)) => Err(misfit(source)),
        Err(NotMeasured::NoFlight(reason)) => {
            let seen = rejection::SeenThings {
                frames: clocked.base.times_s.len(),
                moving: centres.len(),
                what: "centres in the table",
            };
            let reason = rejection::no_flight(&reason, seen, &clocked.base, calibration);
            Ok(result::rejected(
                facts,
                camera,
                METHOD,
                reason,
                None,
                camera.warnings(),
            ))
        }
    }
}

/// The time of each frame, s: as the file has them, those between and before by an even step; by the calibration's rate where it has frames alone, or numbers them
/// and the calibration has a rate. `None` where neither tells.
fn times(given: &GivenPoints, calibration: &Calibration) -> Option<Vec<f64>> {
    let count = given.points.last()?.frame + 1;
    if let Some(rate_hz) = calibration.frame_rate_hz.filter(|_| given.has_frames) {
        return Some((0..count).map(|frame| frame as f64 / rate_hz).collect());
    }
    let mut known: Vec<(usize, f64)> = Vec::new();
    for p in &given.points {
        let time_s = p.time_s?;
        if known.last().is_none_or(|(frame, _)| *frame < p.frame) {
            known.push((p.frame, time_s));
        }
    }
    let mut steps: Vec<f64> = known
        .windows(2)
        .map(|w| (w[1].1 - w[0].1) / (w[1].0 - w[0].0) as f64)
        .collect();
    let step_s = median(&mut steps).filter(|s| *s > 0.0)?;
    let mut times_s = Vec::with_capacity(count);
    let (mut from, mut next) = ((known[0].0, known[0].1), 0);
    for frame in 0..count {
        while next < known.len() && known[next].0 <= frame {
            from = known[next];
            next += 1;
        }
        let apart = |(known, _): (usize, f64)| frame as f64 - known as f64;
        // Between two known frames in even steps.
        let step = known
            .get(next)
            .filter(|_| next > 0)
            .map_or(step_s, |to| (to.1 - from.1) / (to.0 - from.0) as f64);
        times_s.push(from.1 + apart(from) * step);
    }
    Some(times_s)
}

/// The places in the picture.
fn pixels(camera: &CalibratedCamera<'_>, given: &GivenPoints) -> Result<Vec<PixelPoint>, CalibrationError> {
    let metres_per_unit = || -> Result<f64, CalibrationError> {
        let scale = camera
            .calibration
            .metres_per_unit(&crate::calibration::ScaleEvidence::default())?;
        Ok(scale.value)
    };
    let pixel = |p: &GivenPoint| match p.place {
        GivenPlace::Picture(pixel) => Ok(pixel),
        GivenPlace::World(world) => {
            let unit_m = metres_per_unit()?;
            let place = PlanePoint::new(world.x_m / unit_m, world.up_m / unit_m);
            camera
                .map
                .pixel_from_plane(place)
                .ok_or(CalibrationError::NotInPicture)
        }
    };
    given.points.iter().map(pixel).collect()
}

/// A picture in which all lie.
fn extent(pixels: &[PixelPoint]) -> (usize, usize) {
    let most = |of: fn(&PixelPoint) -> f64| pixels.iter().map(of).fold(1.0, f64::max).ceil() as usize + 1;
    (most(|p| p.u_px), most(|p| p.v_px))
}

/// From a frame to the next, px.
fn usual_step(given: &GivenPoints, pixels: &[PixelPoint]) -> f64 {
    let pairs = given.points.windows(2).zip(pixels.windows(2));
    let steps = pairs.filter(|(p, _)| p[1].frame == p[0].frame + 1);
    let mut steps: Vec<f64> = steps.map(|(_, w)| w[0].distance_px(w[1])).collect();
    median(&mut steps).unwrap_or(0.0)
}

fn ball_centre(id: usize, point: &GivenPoint, centre: PixelPoint, radius_px: f64) -> BallCentre {
    BallCentre {
        id,
        frame: point.frame,
        coded: Coded::Whole,
        registration: Registration::IDENTITY,
        centre: Centre::told(
            centre,
            point.std_px.unwrap_or(LEAST_CENTRE_STD_PX),
            radius_px,
            100.0,
        ),
        is_chosen: false,
    }
}
