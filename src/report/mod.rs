//! The only place that knows the shapes of output files.
//!
//! | file | form |
//! |---|---|
//! | [`table`] | the table for people on stdout; how a quantity with its uncertainty is written |
//! | [`json`] | `<stem>.result.json` and `--json`, schema `track.result/1` |
//! | [`csv`] | `<stem>.points.csv` |
//! | [`page`] | `<stem>.report.html`: picture, numbers and plots in one file |
//! | [`strobe`] | the stroboscopic picture of that page |
//! | [`track_plots`] | the plots of that page |
//! | [`calibrate_page`] | the page on which a calibration's marks are dragged |
//! | [`marked_frame`] | a frame with the marks of a calibration drawn in |
//! | [`board`] | the table and JSON of a lens from pictures of a board |
//! | [`overlay`] | the drawing on each frame of `<stem>.overlay.mp4` |
//! | [`batch_page`] | `report.html` of a batch: the same with a list of its recordings |
//! | [`series_table`] | the table of a fit for people on stdout |
//! | [`series_json`] | `fit.json`, schema `track.fit/1` |
//! | [`series_page`] | `report.html`: the paper's figures from a series, its parameters, its rows |
//! | `chart`, `series_figures`, `series_rows` | its figures and tables |
//! | [`cost_json`], [`cost_table`] | `cost.json`, schema `track.cost/1`, and `cost.csv`; the tables on stdout |
//! | [`cost_page`] | `cost.html`: work-precision diagrams (`work_precision`); `cost.svg` |
//! | [`write`](mod@write) | files that appear whole or not at all |

pub mod batch_page;
pub mod board;
pub mod calibrate_page;
mod chart;
pub mod cost_json;
pub mod cost_page;
pub mod cost_table;
pub mod csv;
mod drawing_geometry;
mod jpeg;
pub mod json;
pub mod marked_frame;
pub mod overlay;
pub mod page;
mod series_figures;
pub mod series_json;
pub mod series_page;
mod series_rows;
pub mod series_table;
pub mod strobe;
pub mod table;
pub mod track_plots;
mod words;
mod work_precision;
pub mod write;

#[cfg(test)]
mod test_measurements;
