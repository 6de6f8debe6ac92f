//! The only place that knows the shapes of output files.
//!
//! | file | form |
//! |---|---|
//! | [`formats`] | the files of a recording (`<stem>.result.json`, `.points.csv`, `.report.html`, `.overlay.mp4`), a format each; those of a series and of a cost study |
//! | [`documents`] | the JSON documents as types: `track.result/1`, `track.fit/1`, `track.board/1`, `track.cost/1` |
//! | [`write`](mod@write) | files that appear whole or not at all |
//! | [`table`], [`series_table`], [`board`], [`cost_table`] | the tables for people on stdout |
//! | [`escape`] | names and words from outside as they may stand on a line or a page |
//! | `words` | numbers with their uncertainties, and findings, in words |
//! | [`page`] | what every page shares |
//! | [`recording_page`] | `<stem>.report.html`: picture, numbers and plots in one file |
//! | [`figure`] | the figure layer over plotters that every plot is made of |
//! | [`strobe`], [`track_plots`] | the stroboscopic picture of that page, its plots |
//! | `spin_section` | how the ball turned: its part of that page |
//! | [`series_page`] | `report.html`: the paper's figures from a series, its parameters, its rows (`chart`, `series_figures`, `series_rows`) |
//! | [`batch_page`] | `report.html` of a batch: the same with a list of its recordings |
//! | [`cost_page`] | `cost.html`: work-precision diagrams (`work_precision`); `cost.svg` |
//! | [`cost_csv`] | `cost.csv` |
//! | [`overlay`] | the drawing on each frame of `<stem>.overlay.mp4` |
//! | [`calibrate_page`] | the page on which a calibration's marks are dragged |
//! | [`photograph`] | a frame in its colours, for a page |
//! | [`marked_frame`] | a frame with the marks of a calibration drawn in |

pub mod batch_page;
pub mod board;
pub mod calibrate_page;
mod chart;
pub mod cost_csv;
pub mod cost_page;
pub mod cost_table;
pub mod documents;
mod drawing_geometry;
pub mod escape;
pub mod figure;
pub mod formats;
mod jpeg;
pub mod marked_frame;
pub mod overlay;
pub mod page;
pub mod photograph;
pub mod recording_page;
pub mod review_page;
mod series_figures;
pub mod series_page;
mod series_rows;
pub mod series_table;
pub mod spin_section;
pub mod strobe;
pub mod table;
pub mod track_plots;
mod words;
mod work_precision;
pub mod write;

#[cfg(test)]
mod test_measurements;
