//! `track`: a lab video of a bouncing ball, turned into measured physics.
//!
//! # The map
//!
//! A recording flows one way, and the modules stand in that order: each imports only from those above it in this table
//! (`tests/house.rs` holds that), and nothing imports [`cli`]. `docs/architecture.md` has the life of a frame and of a
//! centre, and what to touch to add something.
//!
//! | module | what it does | gives |
//! |---|---|---|
//! | [`quantity`] | a number with its standard uncertainty | [`quantity::Quantity`] |
//! | [`numeric`] | least squares with covariance, robust statistics: one of each | |
//! | [`geometry`] | points of the picture, of the plane of motion, of the world: three types | |
//! | [`config`] | one reader for every file that a person writes: all problems at once, the nearest known name, what to try | [`config::FileError`] |
//! | [`frames`] | decoding: the luma plane and time of each frame, what is wrong with the file | [`frames::Frame`] |
//! | [`edits`] | what a person says of a recording: which thing is the ball, which points not to use | [`edits::Edits`] |
//! | [`points`] | centres that another program found: tables of it, Tracker's files | [`points::GivenPoints`] |
//! | [`rebound`] | the rebound models of Domenech 2005: pure functions; [`rebound::fit`]: their coefficients from a series of bounces, where sliding begins, which model it is | [`rebound::fit::SeriesFit`] |
//! | [`calibration`] | `calib.json`, made from a board or a ruler, read, checked; the only place where a pixel becomes a metre | [`calibration::Calibration`] |
//! | [`detect`] | background, moving blobs, the sub-pixel centre of the ball | centres |
//! | [`flight`] | the freely falling path among all that moves; arcs and the impacts between them | arcs |
//! | [`rotation`] | how the ball turns in a flight, by the marks on it | [`rotation::RotationFit`] |
//! | [`impact`] | an impact's angles, restitution, spin; x0 and x | [`impact::Bounce`] |
//! | [`pipeline`] | one recording from file to result: the order of the steps, nothing else | [`pipeline::Measurement`] |
//! | [`simulate`] | scenes rendered with known truth; never imports `detect`, `flight`, `impact` or `rebound::fit` | |
//! | [`cost`] | accuracy against time: scenes with known truth, measured at many settings | [`cost::CostReport`] |
//! | [`report`] | table, JSON, CSV, page, overlay: the only place that knows the shapes of output files | |
//! | [`batch`] | many recordings, each in a process of its own; what stands already; the series of all | [`batch::BatchSummary`] |
//! | [`schemas`] | JSON Schemas of all files that are read or written, from their types | `docs/schemas/` |
//! | [`cli`] | a file a command; the only place that prints or draws progress | |
//!
//! # Conventions
//!
//! * Lengths are metres, times seconds, angles radians (degrees only in files and on the page); a raw `f64` carries
//!   its unit in its name.
//! * Pixel (0, 0) is the centre of the top-left pixel, u right, v down.
//! * World: x along the launch, z up, the floor at z = 0 (the ball's centre touches at z = R).
//! * A measured number is a [`quantity::Quantity`]; what could not be measured is `None`, never 0 or NaN.
//! * Core code neither prints nor reads the clock (but for the time limit of a batch's processes).
//! * OpenCV types stay in `detect`, `calibration`, the renderer, and the two files of `report` that make images (`jpeg`,
//!   `marked_frame`); FFmpeg's in `frames`.

pub mod batch;
pub mod calibration;
pub mod cli;
pub mod config;
pub mod cost;
pub mod detect;
pub mod edits;
mod error_chain;
pub mod flight;
pub mod frames;
pub mod geometry;
pub mod impact;
pub mod numeric;
pub mod pipeline;
pub mod points;
pub mod quantity;
pub mod rebound;
pub mod report;
pub mod rotation;
pub mod schemas;
pub mod simulate;

#[cfg(test)]
mod test_noise;
mod version;

pub use error_chain::error_chain;
pub use version::Build;
