//! What keeps a recording from being measured at all.

use crate::calibration::CalibrationError;
use crate::frames::FrameError;
use std::path::PathBuf;

/// What keeps a recording from being measured at all. A recording that can be read but holds no measurement is not an
/// error but [`Outcome::Rejected`](super::Outcome::Rejected).
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
        source: Box<CalibrationError>,
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
    /// What a person said of it does not fit.
    #[error("{}: the edits name {found}", video.display())]
    Edits {
        /// The recording.
        video: PathBuf,
        /// What they name, and what there is.
        found: String,
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
