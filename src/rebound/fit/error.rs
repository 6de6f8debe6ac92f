//! What keeps a series from being fitted at all. A row that cannot be used is no error: it is set aside with its reason.

use crate::config::FileError;
use std::path::PathBuf;
use thiserror::Error;

/// Why a series could not be read.
#[derive(Debug, Error)]
pub enum FitError {
    /// The file cannot be read, is no table, or has columns that cannot be used.
    #[error(transparent)]
    File(#[from] FileError),
    /// A folder without a series in it.
    #[error(
        "{}: no series.csv in this folder; give the folder that `track batch` wrote with --out, or a series CSV",
        path.display()
    )]
    NoSeriesInFolder {
        /// The folder.
        path: PathBuf,
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
    /// Column names and nothing below them.
    #[error("{name}: no rows below the column names; a series has one row a bounce")]
    NoRows {
        /// The file.
        name: String,
    },
}
