//! The measurement put together from what the stages give.

use super::camera::CalibratedCamera;
use super::clock::Clocked;
use super::drawing;
use super::in_metres::Impacts;
use super::measurement::{
    CalibrationFacts, CameraSeen, Measurement, Outcome, PointUse, Strobe, TimeSource, Track, TrackPoint,
    VideoFacts, Warning,
};
use super::refine::Refined;
use super::spots::with_id;
use super::warnings::{of_launches, rejection};
use crate::flight::FlightPoint;
use crate::impact::Distances;
use crate::numeric::robust::median;
use crate::quantity::Quantity;
use std::path::Path;

/// What a measurement says of its recording, whatever was found in it.
#[derive(Debug, Clone)]
pub struct RecordingFacts<'a> {
    video: VideoFacts,
    /// What messages call the calibration.
    calibration_name: &'a str,
}

impl<'a> RecordingFacts<'a> {
    /// Of `video`, of which so many `frames` were read, and of the calibration that messages call `calibration_name`.
    pub fn new(
        (video, frames): (&Path, u64),
        calibration_name: &'a str,
        camera: &CalibratedCamera<'_>,
        clocked: &Clocked,
    ) -> Self {
        let (width_px, height_px) = camera.size_px;
        Self {
            video: VideoFacts {
                path: video.to_owned(),
                sha256: None,
                width_px,
                height_px,
                frames,
                frame_rate_hz: clocked.base.interval_s.map(|i| 1.0 / i),
                duration_s: clocked.base.times_s.last().copied().unwrap_or(0.0),
                time_source: if camera.calibration.frame_rate_hz.is_some() {
                    TimeSource::Calibration
                } else {
                    TimeSource::Stamps
                },
                camera: camera.shown_motion.map(|shown_motion| CameraSeen {
                    stands_still: camera.stands_still,
                    shown_motion,
                }),
            },
            calibration_name,
        }
    }

    /// The calibration of the `camera`, with the length of a pixel as far as anything told it.
    fn calibration(
        &self,
        camera: &CalibratedCamera<'_>,
        metres_per_pixel: Option<Quantity>,
    ) -> CalibrationFacts {
        let calibration = camera.calibration;
        CalibrationFacts {
            name: self.calibration_name.to_owned(),
            sha256: None,
            metres_per_pixel,
            origin_px: calibration.origin_px,
            up_px: calibration.up_px,
            frame_rate_hz: calibration.frame_rate_hz,
        }
    }
}

/// A launch that was measured, or a flight without a bounce. `before` are the warnings of the recording; one of the flight with
/// the same code says nothing new.
pub fn measured(
    recording: &RecordingFacts<'_>,
    camera: &CalibratedCamera<'_>,
    refined: &Refined,
    impacts: Impacts,
    strobe: Option<Strobe>,
    before: &[Warning],
) -> Measurement {
    let outcome = if impacts.bounces.is_empty() {
        Outcome::Rejected {
            reason: rejection::no_bounce(&impacts.flight, impacts.walls, camera.calibration),
        }
    } else {
        Outcome::Measured
    };
    let track = track(camera, refined, &impacts);
    let mut new = impacts.warnings;
    new.retain(|new| before.iter().all(|w| w.code != new.code));
    Measurement {
        video: recording.video.clone(),
        calibration: recording.calibration(camera, impacts.metres_per_px),
        view: camera.calibration.view,
        outcome,
        track,
        gravity_m_s2: impacts.gravity_m_s2,
        up: impacts.up,
        floor: impacts.floor,
        launch: impacts.launch,
        distances: impacts.distances,
        readings: impacts.readings,
        bounces: impacts.bounces.into_iter().map(|(_, b)| b).collect(),
        arcs: drawing::arcs(&impacts.flight, &camera.map, &impacts.frame, &impacts.spins),
        drag_per_m: impacts.drag_per_m,
        edits: None,
        strobe,
        warnings: [new, refined.warnings.clone()].concat(),
        launches: Vec::new(),
    }
}

/// A recording without a flight, and why.
pub fn rejected(
    recording: RecordingFacts<'_>,
    camera: &CalibratedCamera<'_>,
    method: &'static str,
    reason: String,
    strobe: Option<Strobe>,
    warnings: Vec<Warning>,
) -> Measurement {
    let told = camera.metres_per_unit_before_flight();
    let calibration = recording.calibration(camera, told.map(|s| s.scaled(camera.units_per_px())));
    Measurement {
        video: recording.video,
        calibration,
        view: camera.calibration.view,
        outcome: Outcome::Rejected { reason },
        track: Track {
            method: method.to_owned(),
            detected: 0,
            centre_std_px: None,
            radius_px: None,
            points: Vec::new(),
        },
        gravity_m_s2: None,
        up: None,
        floor: None,
        launch: None,
        bounces: Vec::new(),
        distances: Distances::default(),
        readings: None,
        warnings,
        arcs: Vec::new(),
        drag_per_m: None,
        edits: None,
        strobe,
        launches: Vec::new(),
    }
}

/// The launches of a recording as one measurement: the `first`, with the warnings of the recording (`before`) and of all launches,
/// and each by itself where there are `later` ones. `left_out`: flights that are no launches.
pub fn of_launches(
    mut first: Measurement,
    later: Vec<Measurement>,
    left_out: usize,
    before: Vec<Warning>,
) -> Measurement {
    if later.is_empty() {
        first.warnings = [before, first.warnings].concat();
        return first;
    }
    let launches = [vec![first.clone()], later].concat();
    Measurement {
        warnings: [before, of_launches::of_several(&launches, left_out)].concat(),
        launches,
        ..first
    }
}

fn track(camera: &CalibratedCamera<'_>, refined: &Refined, impacts: &Impacts) -> Track {
    let (flight, frame) = (&impacts.flight, &impacts.frame);
    let tracked = &refined.tracked;
    let point = |p: &FlightPoint| {
        let c = with_id(&tracked.centres, p.spot.id)?;
        // Where the camera's angles are known the ball's centre is not that of its outline.
        let of_ball = tracked.optics.and(camera.map.pixel_from_plane(p.spot.place));
        Some(TrackPoint {
            frame: p.spot.frame,
            time_s: p.spot.time_s,
            pixel: of_ball.map_or(c.centre.disc.centre, |reference| {
                c.registration.frame_from_reference(reference)
            }),
            std_px: Some(c.centre.std_px() * flight.std(&p.spot) / p.spot.std),
            world: flight.place_of(p).map(|place| frame.world(place.right, place.up)),
            use_: drawing::use_of(p, frame),
            residual_m: drawing::residual(flight, p, frame),
        })
    };
    let points: Vec<TrackPoint> = flight.points.iter().filter_map(point).collect();
    let used = points.iter().filter(|p| matches!(p.use_, PointUse::Used(_)));
    let mut stds: Vec<f64> = used.filter_map(|p| p.std_px).collect();
    Track {
        method: refined.method.to_owned(),
        detected: points.len(),
        centre_std_px: median(&mut stds),
        radius_px: impacts.radius_px,
        points,
    }
}
