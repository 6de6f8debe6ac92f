//! `<stem>.trk`: for Tracker (physlets.org/tracker), with the recording beside it.
//!
//! The ball's centres in use as a point mass, with scale, origin, "up" and the time from frame to frame. Tracker knows one such time for a whole clip:
//! where frames do not stand evenly its times are not those of the result.

use super::{Contents, OutputFormat};
use crate::geometry::PixelPoint;
use crate::pipeline::{Measurement, PointUse};
use crate::points::tracker::{TrackerFile, TrackerMass};
use std::error::Error;

/// The track, for Tracker.
pub struct Trk;

impl OutputFormat for Trk {
    fn name(&self) -> &'static str {
        "trk"
    }

    fn suffix(&self) -> &'static str {
        "trk"
    }

    fn is_extra(&self) -> bool {
        true
    }

    fn contents<'a>(
        &self,
        measurement: &'a Measurement,
    ) -> Result<Contents<'a>, Box<dyn Error + Send + Sync>> {
        Ok(Contents::Bytes(tracker_file(measurement).to_xml().into_bytes()))
    }
}

/// Frames stand evenly where their times are off an even step by no more than this part of it.
const EVEN_PART: f64 = 0.02;

/// What Tracker does not know of a measurement's times; `None` where frames stand evenly.
#[must_use]
pub fn uneven(measurement: &Measurement) -> Option<String> {
    let step_s = 1.0 / measurement.video.frame_rate_hz?;
    let launches = measurement.each_launch().iter();
    let points: Vec<_> = launches.flat_map(|l| &l.track.points).collect();
    let first = points.first()?;
    let off = |p: &&crate::pipeline::TrackPoint| {
        let even = first.time_s + (p.frame as f64 - first.frame as f64) * step_s;
        (p.time_s - even).abs()
    };
    let most = points.iter().map(off).fold(0.0, f64::max);
    (most > EVEN_PART * step_s).then(|| {
        format!(
            "Tracker takes frames as even, {:.4} ms apart; they are off that by up to {:.2} ms: its speeds and times are not those of the result",
            1000.0 * step_s,
            1000.0 * most
        )
    })
}

fn tracker_file(measurement: &Measurement) -> TrackerFile {
    let (video, calibration) = (&measurement.video, &measurement.calibration);
    let (width, height) = (video.width_px as f64, video.height_px as f64);
    let scale = calibration.metres_per_pixel.map_or(1.0, |s| 1.0 / s.value);
    let [right, down] = calibration.up_px;
    let mass = |(i, launch): (usize, &Measurement)| TrackerMass {
        name: if measurement.launches.is_empty() {
            "ball".to_owned()
        } else {
            format!("ball, launch {}", i + 1)
        },
        mass_kg: None,
        places: launch
            .track
            .points
            .iter()
            .filter(|p| matches!(p.use_, PointUse::Used(_)))
            .map(|p| (p.frame, p.pixel))
            .collect(),
    };
    TrackerFile {
        size_px: Some((width, height)),
        step_s: video.frame_rate_hz.map(|hz| 1.0 / hz),
        start: (0, 0.0),
        origin: calibration
            .origin_px
            .unwrap_or(PixelPoint::new(0.5 * (width - 1.0), 0.5 * (height - 1.0))),
        // Straight up is 0, not -0.
        angle_rad: (-right).atan2(-down) + 0.0,
        scale_px: (scale, scale),
        length_unit: calibration.metres_per_pixel.map(|_| "m".to_owned()),
        masses: measurement.each_launch().iter().enumerate().map(mass).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::tracker::parse;
    use crate::report::test_measurements;

    #[test]
    fn what_tracker_gets_is_what_was_measured() {
        let measurement = test_measurements::two_bounces();
        let file = parse(&tracker_file(&measurement).to_xml(), "clip.trk").unwrap();
        let used = measurement
            .track
            .points
            .iter()
            .filter(|p| matches!(p.use_, PointUse::Used(_)));
        let used: Vec<_> = used.collect();
        assert_eq!(file.masses[0].places.len(), used.len());
        for ((frame, place), point) in file.masses[0].places.iter().zip(used) {
            assert!(*frame == point.frame && place.distance_px(point.pixel) < 1e-9);
        }
        let scale = measurement.calibration.metres_per_pixel.unwrap().value;
        assert!((file.scale_px.0 * scale - 1.0).abs() < 1e-12 && file.angle_rad == 0.0);
        assert!(uneven(&measurement).is_none());
        let mut jittered = measurement;
        jittered.track.points[3].time_s += 1e-3;
        assert!(uneven(&jittered).is_some_and(|words| words.contains("1.00 ms")));
    }
}
