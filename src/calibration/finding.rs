//! What is wrong with a calibration, or odd about it.

use std::fmt;

/// How much a finding matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// It makes results wrong, or keeps the calibration from being used.
    Problem,
    /// It is worth knowing.
    Remark,
}

/// Something that is wrong or odd.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// How much it matters.
    pub severity: Severity,
    /// Dotted path of the key; empty for the whole file.
    pub key: String,
    /// What was found, and what to do.
    pub message: String,
}

impl Finding {
    pub(super) fn problem(key: &str, message: impl Into<String>) -> Self {
        Self::new(Severity::Problem, key, message)
    }

    pub(super) fn remark(key: &str, message: impl Into<String>) -> Self {
        Self::new(Severity::Remark, key, message)
    }

    fn new(severity: Severity, key: &str, message: impl Into<String>) -> Self {
        Self {
            severity,
            key: key.to_owned(),
            message: message.into(),
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let severity = match self.severity {
            Severity::Problem => "problem",
            Severity::Remark => "remark ",
        };
        let key = if self.key.is_empty() { "(file)" } else { &self.key };
        write!(f, "{severity}  {key}: {}", self.message)
    }
}
