//! What can be wrong with a calibration, said so that it can be put right.

use crate::config::{FileError, FileProblem};

/// Why a calibration could not be read or used.
#[derive(Debug, thiserror::Error)]
pub enum CalibrationError {
    /// The file could not be read, or values in it cannot be used.
    #[error(transparent)]
    File(#[from] FileError),
    /// The calibration belongs to pictures of another size.
    #[error(
        "image_size_px: the calibration is for pictures of {}x{} px, the recording has {}x{} px; {hint}",
        calibrated.0, calibrated.1, found.0, found.1
    )]
    ImageSize {
        /// Width and height in the calibration.
        calibrated: (usize, usize),
        /// Width and height of the recording.
        found: (usize, usize),
        /// What may have happened and what to try.
        hint: String,
    },
    /// A place in the world that the camera cannot see.
    #[error(
        "a place of the table is in no picture that this calibration's camera takes; check that x_m and z_m are metres, and \"origin_px\""
    )]
    NotInPicture,
    /// The scale rests on something that was not measured on this recording.
    #[error("scale: {missing}; give one of the other scales ({others})")]
    NoEvidence {
        /// What the scale needs and does not have.
        missing: &'static str,
        /// The scales that remain.
        others: String,
    },
}

impl CalibrationError {
    /// One problem of a calibration that was not read from a file.
    pub(super) fn of(problem: FileProblem) -> Self {
        Self::File(FileError::Invalid {
            name: "calibration".into(),
            problems: vec![problem],
        })
    }

    /// The problems of an invalid file, none for the other errors.
    #[must_use]
    pub fn problems(&self) -> &[FileProblem] {
        match self {
            Self::File(error) => error.problems(),
            _ => &[],
        }
    }
}
