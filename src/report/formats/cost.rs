//! The files of a study of what accuracy costs: `cost.html`, `cost.svg`, `cost.json` and `cost.csv`.

use crate::cost::CostReport;
use crate::cost::recordings::Check;
use crate::report::documents::cost::CostDocument;
use crate::report::documents::json_text;
use crate::report::write::{WriteError, write_into};
use crate::report::{cost_csv, cost_page};
use std::path::{Path, PathBuf};

/// Writes the four files into `dir`: all, or none; their paths.
///
/// # Errors
/// See [`WriteError`].
pub fn write_cost(
    report: &CostReport,
    check: Option<&Check>,
    dir: &Path,
) -> Result<Vec<PathBuf>, WriteError> {
    let page = cost_page::cost_html(report, check);
    let svg = cost_page::cost_svg(report);
    let json = json_text(&CostDocument::new(report, check));
    write_into(
        dir,
        vec![
            ("cost.html", page.map(String::into_bytes).map_err(Into::into)),
            ("cost.svg", svg.map(String::into_bytes).map_err(Into::into)),
            ("cost.json", json.map_err(Into::into)),
            ("cost.csv", cost_csv::cost_csv(report).map_err(Into::into)),
        ],
    )
}
