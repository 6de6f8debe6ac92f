//! What can be wrong with a calibration, said so that it can be put right.

use std::fmt;
use std::path::PathBuf;

/// Why a calibration could not be read or used.
#[derive(Debug, thiserror::Error)]
pub enum CalibrationError {
    /// The file could not be read at all.
    #[error("{}: cannot read the calibration: {hint}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
        /// What that means and what to try.
        hint: &'static str,
    },
    /// The file is not text in JSON.
    #[error("{name}: {found}; a calibration is one JSON object as in calib/README.md; {hint}")]
    NotJson {
        /// The file.
        name: String,
        /// What was found, with line and column where there is one.
        found: String,
        /// What to try.
        hint: String,
    },
    /// Values that cannot be used: every one that was found, in the order of the file's description.
    #[error("{name}: {}", list(problems))]
    Invalid {
        /// The file.
        name: String,
        /// At least one.
        problems: Vec<Problem>,
    },
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
    pub(super) fn of(problem: Problem) -> Self {
        Self::Invalid {
            name: "calibration".into(),
            problems: vec![problem],
        }
    }

    /// The problems of an invalid file, none for the other errors.
    #[must_use]
    pub fn problems(&self) -> &[Problem] {
        match self {
            Self::Invalid { problems, .. } => problems,
            _ => &[],
        }
    }
}

/// One value that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// Dotted path of the key, such as `scale.metres_per_pixel`; empty for the whole file.
    pub key: String,
    /// What the file says.
    pub found: String,
    /// What it may say.
    pub accepted: String,
    /// What to try.
    pub hint: String,
}

impl Problem {
    pub(super) fn new(
        key: impl Into<String>,
        found: impl Into<String>,
        accepted: impl Into<String>,
        hint: impl Into<String>,
    ) -> Self {
        Self {
            key: key.into(),
            found: found.into(),
            accepted: accepted.into(),
            hint: hint.into(),
        }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let key = if self.key.is_empty() { "(file)" } else { &self.key };
        write!(
            f,
            "{key}: found {}; accepted: {}; try: {}",
            self.found, self.accepted, self.hint
        )
    }
}

/// One problem on the line of the file's name, several a line each.
fn list(problems: &[Problem]) -> String {
    match problems {
        [one] => one.to_string(),
        many => many.iter().fold(format!("{} problems", many.len()), |text, p| {
            format!("{text}\n  {p}")
        }),
    }
}
