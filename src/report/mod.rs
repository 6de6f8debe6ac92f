//! The only place that knows the shapes of output files.
//!
//! | file | form |
//! |---|---|
//! | [`table`] | the table for people on stdout; how a quantity with its uncertainty is written |
//! | [`json`] | `<stem>.result.json` and `--json`, schema `track.result/1` |
//! | [`csv`] | `<stem>.points.csv` |
//! | [`page`] | `<stem>.report.html`: picture, numbers and plots in one file |
//! | [`strobe`] | the stroboscopic picture of that page |
//! | [`plots`] | the plots of that page |
//! | [`calibrate_page`] | the page on which a calibration's marks are dragged |
//! | [`marks`] | a frame with the marks of a calibration drawn in |
//! | [`board`] | the table and JSON of a lens from pictures of a board |
//! | [`overlay`] | the drawing on each frame of `<stem>.overlay.mp4` |
//! | [`batch_page`] | `report.html` of a batch: the same with a list of its recordings |
//! | [`series_table`] | the table of a fit for people on stdout |
//! | [`series_json`] | `fit.json`, schema `track.fit/1` |
//! | [`series_page`] | `report.html`: the paper's figures from a series, its parameters, its rows |
//! | `chart`, `series_figures`, `series_rows` | its figures and tables |
//! | [`write`](mod@write) | files that appear whole or not at all |

pub mod batch_page;
pub mod board;
pub mod calibrate_page;
mod chart;
pub mod csv;
pub mod json;
pub mod marks;
pub mod overlay;
pub mod page;
mod photograph;
mod places;
pub mod plots;
mod series_figures;
pub mod series_json;
pub mod series_page;
mod series_rows;
pub mod series_table;
pub mod strobe;
pub mod table;
mod words;
pub mod write;

#[cfg(test)]
mod fake;
