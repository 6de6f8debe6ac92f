//! From a file (or a folder of numbered images) to frames: the luma plane with each frame's own time.

use std::path::PathBuf;

/// One channel, 8 bits, rows top to bottom without padding.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Luma {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `height * width` code values, row by row.
    pub data: Vec<u8>,
}

impl Luma {
    /// Row `v` as a slice.
    #[must_use]
    pub fn row(&self, v: usize) -> &[u8] {
        &self.data[v * self.width..(v + 1) * self.width]
    }
}

/// A decoded frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Position in presentation order, from 0.
    pub index: usize,
    /// Presentation time by the file's own stamp, from the first frame on (the first is 0), s.
    pub time_s: f64,
    /// The luma plane, turned upright by the file's rotation tag.
    pub luma: Luma,
}

/// The code values that mean black and white.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LumaRange {
    /// Code value of black: 0 (full range) or 16 (limited).
    pub black: u8,
    /// Code value of white: 255 (full range) or 235 (limited).
    pub white: u8,
}

/// What is known of a recording before its first frame.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceInfo {
    /// As the user named it.
    pub path: PathBuf,
    /// Columns after rotation.
    pub width_px: usize,
    /// Rows after rotation.
    pub height_px: usize,
    /// Frame rate by the container, Hz.
    pub nominal_rate_hz: Option<f64>,
    /// Frames by the container's own count.
    pub frames_expected: Option<u64>,
    /// Code values of black and white.
    pub luma_range: LumaRange,
    /// Codec or image format, for people.
    pub codec: String,
}

/// What went wrong while reading, known in full once the last frame is read.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StreamHealth {
    /// Frames given so far.
    pub frames_read: u64,
    /// Frames by the container's own count.
    pub frames_expected: Option<u64>,
    /// Packets or frames that the decoder called damaged.
    pub damaged: u64,
    /// Frames stored as two fields.
    pub interlaced: u64,
    /// Frames whose stamp was missing or did not increase; their time was interpolated.
    pub stamps_repaired: u64,
    /// The stream ended with an error of the container (a file cut short), in words.
    pub ended_early: Option<String>,
}
