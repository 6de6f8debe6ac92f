//! Which build of the program this is: its version, and the git commit that it was built from.

use schemars::JsonSchema;
use serde::Serialize;
use std::fmt;

/// Version and commit, as every result carries them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Build {
    /// Version of the program.
    pub version: &'static str,
    /// Git commit of the source, 12 hexadecimal digits; `unknown` where it was built outside git.
    pub commit: &'static str,
}

impl Build {
    /// This one.
    pub const THIS: Self = Self {
        version: env!("CARGO_PKG_VERSION"),
        commit: env!("TRACK_COMMIT"),
    };
}

impl fmt::Display for Build {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({})", self.version, self.commit)
    }
}
