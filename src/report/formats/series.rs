//! The files of a fitted series: `fit.json` and `report.html`.

use crate::rebound::fit::{Series, SeriesFit};
use crate::report::documents::fit::FitDocument;
use crate::report::documents::json_text;
use crate::report::series_page;
use crate::report::write::{WriteError, write_into};
use std::path::{Path, PathBuf};

/// Writes `fit.json` and `report.html` into `dir`: both, or none; their paths. Links of rows are relative to `dir`.
///
/// # Errors
/// See [`WriteError`].
pub fn write_fit(series: &Series, fit: &SeriesFit, dir: &Path) -> Result<[PathBuf; 2], WriteError> {
    let page = series_page::report_html(series, fit);
    write_into(
        dir,
        [
            ("fit.json", json_text(&FitDocument::new(fit)).map_err(Into::into)),
            ("report.html", page.map(String::into_bytes).map_err(Into::into)),
        ],
    )
}
