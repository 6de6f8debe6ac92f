//! What keeps a series from being fitted at all. A row that cannot be used is no error: it is set aside with its reason.

use std::path::PathBuf;
use thiserror::Error;

/// Why a series could not be read.
#[derive(Debug, Error)]
pub enum FitError {
    /// The file cannot be opened or read.
    #[error("cannot read the series {}; check the path, or give the folder that `track batch` wrote", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// As the system says it.
        source: std::io::Error,
    },
    /// A folder without a series in it.
    #[error(
        "{}: no series.csv in this folder; give the folder that `track batch` wrote with --out, or a series CSV",
        path.display()
    )]
    NoSeriesInFolder {
        /// The folder.
        path: PathBuf,
    },
    /// Not text in columns.
    #[error("{name}: {found}; a series is a CSV file in UTF-8 with one line of column names; {hint}")]
    NotCsv {
        /// The file.
        name: String,
        /// What was found, and where.
        found: String,
        /// What to try.
        hint: &'static str,
    },
    /// The columns do not hold one of the three sets.
    #[error(
        "{name}: {missing} (found: {found}); a series needs one of these sets of columns: {}",
        super::columns::SETS
    )]
    Columns {
        /// The file.
        name: String,
        /// The set that comes nearest, and what it lacks.
        missing: String,
        /// The columns that are there.
        found: String,
    },
    /// A column that is there twice, or a correlation of a column that is not there.
    #[error("{name}: column {column}: {problem}")]
    Column {
        /// The file.
        name: String,
        /// Its name as it stands there.
        column: String,
        /// What is wrong, what is accepted, what to try.
        problem: String,
    },
    /// Column names and nothing below them.
    #[error("{name}: no rows below the column names; a series has one row a bounce")]
    NoRows {
        /// The file.
        name: String,
    },
}
