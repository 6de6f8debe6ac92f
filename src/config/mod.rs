//! Reading the files that a person writes: `calib.json` and scenes (JSON), manifests and series (CSV).
//!
//! | file | what it does |
//! |---|---|
//! | `problem` | a value that cannot be used: where, found, accepted, what to try; the errors of a file |
//! | `json` | text to JSON, with what a person may have got wrong |
//! | `section` | an object of a JSON file, read key by key; every problem is noted, none stops the reading |
//! | [`schema`] | types of values, for the JSON Schemas |
//! | [`table`] | a CSV file: columns by name, rows by line |
//! | [`made_by`] | which files the program made itself, and may replace |
//! | `nearest` | the known name that a misspelt one may have meant |
//!
//! What is read knows nothing of balls and cameras: the keys, their ranges and what they mean together stand with the types
//! that they become (`calibration::file`, `simulate::scene`, `batch::manifest`, `rebound::fit::csv`).

mod json;
pub mod made_by;
mod nearest;
mod problem;
pub mod schema;
mod section;
pub mod table;

pub use nearest::{Closeness, nearest};
pub use problem::{FileError, FileKind, FileProblem};
pub(crate) use problem::{clipped, open_file, read_bytes};
pub use section::NumberRange;
pub(crate) use section::{Document, FINITE, PAIR, POSITIVE, Section, array, text};
