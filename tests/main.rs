//! The tests that use the library from outside, and the program as a user calls it: one executable, so that it is built once and no
//! processor waits for the last test of each file. `cargo test --test all hard_time::` runs those of one file.

#![allow(clippy::unwrap_used, reason = "a test may fail where it stands")]
#![allow(
    clippy::print_stdout,
    reason = "what was found or skipped, for those who read along"
)]

mod batch;
mod batch_paper;
mod calibrate_board;
mod calibrate_page;
mod calibrate_ruler;
mod calibration;
mod cli;
mod colour;
mod command_line;
mod compliant;
mod compliant_batch;
mod compliant_fit;
mod cost;
mod coverage;
mod edits;
mod exact;
mod fit;
mod fit_cli;
mod fit_tables;
mod frames;
mod fuzz;
mod golden;
mod hard_fits;
mod hard_geometry;
mod hard_impacts;
mod hard_lab;
mod hard_launches;
mod hard_pictures;
mod hard_time;
mod house;
mod invariance;
mod invariance_video;
mod marked_balls;
mod memory;
mod models;
mod paper;
mod points;
mod real_clips;
mod schemas;
mod simulate;
mod simulate_wild;
mod spin;
mod spin_coverage;
mod top_view;
mod truth;
mod wild;

// What several of them use.
mod boards;
mod browser;
mod drawn;
mod exactly;
mod flown;
mod hard;
mod noise;
mod rendered;
mod series;
mod small;
