//! Centres that another program found, or a person clicked: tables and Tracker's own files.
//!
//! | file | what it does |
//! |---|---|
//! | [`table`] | CSV: `track`'s own points, trackpy's, what Tracker and Kinovea export, a student's script |
//! | [`tracker`] | Tracker's `.trk` and `.trz`: calibration and point masses |
//!
//! What is read says nothing of pixels but where they lie; from there on a recording of centres goes the way of a video
//! ([`crate::pipeline::measure_points`]).

pub mod table;
pub mod tracker;

use crate::geometry::{PixelPoint, WorldPoint};

/// Where a centre lies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum GivenPlace {
    /// In the picture.
    Picture(PixelPoint),
    /// In the world, by a scale that the other program knew: x to the right, z up, m.
    World(WorldPoint),
}

/// A centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GivenPoint {
    /// Frame in presentation order, from 0; where the file numbers none, the rank of its time.
    pub frame: usize,
    /// When, s; `None` where the file numbers frames alone.
    pub time_s: Option<f64>,
    /// Where.
    pub place: GivenPlace,
    /// Standard uncertainty of each coordinate, px; `None` where the file does not tell.
    pub std_px: Option<f64>,
}

/// The centres of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct GivenPoints {
    /// In the order of their frames; several of one frame are of several things.
    pub points: Vec<GivenPoint>,
    /// Whether the file itself numbers the frames.
    pub has_frames: bool,
}
