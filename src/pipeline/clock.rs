//! When each frame was taken: by the file's stamps or the calibration's rate, less the frames that show nothing new, with
//! the time of frames that are missing without a trace in the stamps.

use super::camera::CalibratedCamera;
use super::decode::Decoded;
use super::measurement::Warning;
use super::spots::{BallCentre, FrameTimes, first_spots};
use super::warnings::of_clock;
use crate::calibration::Optics;
use crate::flight::linking::LinkedSpots;
use crate::flight::{self, Flight, dropped_frames};
use crate::frames::timebase::TimeBase;

/// The recording with its clock.
#[derive(Debug)]
pub struct Clocked {
    /// Times of all frames.
    pub base: TimeBase,
    /// Frames that show the one before once more.
    pub duplicates: Vec<bool>,
    /// What is odd about the clock.
    pub warnings: Vec<Warning>,
}

/// The clock of `decoded`, whose things have the `centres`.
pub fn clocked(
    camera: &CalibratedCamera<'_>,
    decoded: &Decoded,
    centres: &[BallCentre],
    optics: Option<Optics>,
) -> Clocked {
    let (stamps_s, rate_hz) = (&decoded.stamps_s, camera.calibration.frame_rate_hz);
    // Each list of spots is linked once: all who ask it share its tracks.
    let linked = |base: &TimeBase, duplicates: &[bool]| {
        let times_s = &base.times_s;
        let frames = FrameTimes { times_s, duplicates };
        LinkedSpots::new(first_spots(camera, centres, frames, optics))
    };
    let all = TimeBase::new(stamps_s, &[], rate_hz);
    let by_stamps = linked(&all, &vec![false; stamps_s.len()]);
    let duplicates =
        flight::duplicate_frames::find(&by_stamps, &decoded.changes, camera.units_per_px()).frames;
    let base = TimeBase::new(stamps_s, &duplicates, rate_hz);
    let distinct = if duplicates.contains(&true) {
        linked(&base, &duplicates)
    } else {
        by_stamps
    };
    // Where duplicates come regularly, the clock of distinct frames may be even, and the stamps be those of another: the one
    // that the ball's places suit counts.
    let even = base.evenly(stamps_s, &duplicates).filter(|_| rate_hz.is_none());
    let even = even.map(|(base, duplicates)| (linked(&base, &duplicates), base, duplicates));
    let even = even.filter(|even| flight::clock::suits_better(&even.0, &distinct));
    let (linked, base, duplicates) = even.unwrap_or((distinct, base, duplicates));
    let missing = base
        .interval_s
        .map_or_else(Vec::new, |interval_s| dropped_frames::find(&linked, interval_s));
    Clocked::new(base.with_skips(&pairs(&missing)), duplicates, camera, decoded)
}

impl Clocked {
    fn new(base: TimeBase, duplicates: Vec<bool>, camera: &CalibratedCamera<'_>, decoded: &Decoded) -> Self {
        let warnings = of_clock::of_clock(decoded, &base, &duplicates, camera.calibration);
        Self {
            base,
            duplicates,
            warnings,
        }
    }

    /// Times and duplicates.
    pub fn frames(&self) -> FrameTimes<'_> {
        FrameTimes {
            times_s: &self.base.times_s,
            duplicates: &self.duplicates,
        }
    }

    /// The clock with the time of the frames that are missing at the impacts of `flight`; `None` where none are.
    pub fn with_frames_missing_at_impacts(
        &self,
        flight: &Flight,
        camera: &CalibratedCamera<'_>,
        decoded: &Decoded,
    ) -> Option<Self> {
        let missing = dropped_frames::at_impacts(flight);
        let base = || self.base.clone().with_skips(&pairs(&missing));
        (!missing.is_empty()).then(|| Self::new(base(), self.duplicates.clone(), camera, decoded))
    }
}

/// The first frame after each gap, and the frames missing in it.
fn pairs(skips: &[dropped_frames::DroppedFrames]) -> Vec<(usize, usize)> {
    skips.iter().map(|s| (s.frame, s.missing)).collect()
}
