//! From a file (or a folder of numbered images) to frames: the luma plane with each frame's own time.
//!
//! | file | what it does |
//! |---|---|
//! | `av/` | FFmpeg's C structs behind a safe face; the only `unsafe` |
//! | [`colour`] | a frame's chroma, read where somebody asks |
//! | [`digest`] | SHA-256 of files |
//! | [`encode`] | frames to a video file |
//! | [`even_clock`] | stamps that an even clock was rounded to |
//! | [`error`] | why a recording could not be read |
//! | `folder` | a folder of numbered images |
//! | [`mixture`] | a plane mixed from luma and chroma |
//! | `orientation` | how a stored picture is turned to be upright |
//! | `pixels` | from a decoded picture to upright planes of 8 bits |
//! | [`readahead`] | decoding in a thread of its own |
//! | [`recode`](mod@recode) | a recording drawn over |
//! | `stamps` | from a file's stamps to times |
//! | [`timebase`] | when each frame was taken: stamps or the true capture rate |
//! | [`survey`] | a few frames spread over the whole |
//! | [`video`] | a video file, frame by frame |

use std::path::PathBuf;

mod av;
pub mod colour;
pub mod digest;
pub mod encode;
pub mod error;
pub mod even_clock;
mod folder;
pub mod mixture;
mod orientation;
mod pixels;
pub mod readahead;
pub mod recode;
mod reduced;
mod stamps;
pub mod stills;
pub mod survey;
pub mod temporary;
pub mod timebase;
pub mod video;

pub use colour::{Chroma, ColourCut, FrameColour};
pub use encode::{ChromaSiting, Coding, EncodeError, Timing, VideoOptions, VideoWriter};
pub use error::FrameError;
pub use folder::{is_picture, open_picture, pictures_in};
pub use mixture::{ChromaGrid, ColourMix};
pub use pixels::has_room_for_several;
pub use readahead::ReadAhead;
pub use recode::{RecodeError, drawn_smaller, recode};
pub use survey::{
    EvenSample, SparseFrames, Wanted, evenly_of, open_sparse, open_sparse_at_once, open_sparse_by_pass,
    open_sparse_mixed,
};
pub use video::FrameSource;

use folder::FolderReader;
use pixels::ColouredPlane;
use reduced::reduced_plane;
use std::path::Path;
use video::VideoReader;

/// Has the memory of pictures go back to the system as soon as they are let go, in all of this process: for a program to call as it starts.
pub fn give_back_pictures() {
    av::give_back_pictures();
}

/// Opens a recording: a video file, or a folder of numbered images.
///
/// # Errors
/// Whatever makes it unreadable, see [`FrameError`].
pub fn open(path: &Path) -> Result<Box<dyn FrameSource + Send>, FrameError> {
    open_mixed(path, None)
}

/// The same with a mixture of luma and chroma as [`Frame::luma`], where there is one and the recording has colours.
///
/// # Errors
/// As for [`open`].
pub fn open_mixed(path: &Path, mix: Option<ColourMix>) -> Result<Box<dyn FrameSource + Send>, FrameError> {
    if path.is_dir() {
        Ok(Box::new(FolderReader::<ColouredPlane>::open(path)?.mixing(mix)))
    } else {
        Ok(Box::new(VideoReader::<ColouredPlane>::open_mixed(path, mix)?))
    }
}

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
    /// The picture that has `grey(u, v)` at column u of row v; asked row by row.
    #[must_use]
    pub fn from_fn(width: usize, height: usize, mut grey: impl FnMut(usize, usize) -> u8) -> Self {
        let mut data = Vec::with_capacity(width * height);
        for v in 0..height {
            data.extend((0..width).map(|u| grey(u, v)));
        }
        Self { width, height, data }
    }

    /// Row `v` as a slice.
    #[must_use]
    pub fn row(&self, v: usize) -> &[u8] {
        &self.data[v * self.width..(v + 1) * self.width]
    }

    /// The same at 1/`times` of its size, each pixel the mean of those that it replaces; `None` where it is less than `times` (or nothing) pixels wide or high.
    #[must_use]
    pub fn reduced(&self, times: usize) -> Option<Self> {
        let (width, height) = (self.width.checked_div(times)?, self.height / times);
        let data = reduced_plane(&self.data, self.width, times, (width, height))?;
        Some(Self { width, height, data })
    }
}

/// A colour picture: luma, and chroma at half the columns and rows (rounded up), code values of full range.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Yuv420 {
    /// Columns of luma.
    pub width: usize,
    /// Rows of luma.
    pub height: usize,
    /// Luma, 0 black to 255 white.
    pub y: Vec<u8>,
    /// Blue-yellow, 128 is colourless.
    pub u: Vec<u8>,
    /// Red-cyan, 128 is colourless.
    pub v: Vec<u8>,
}

impl Yuv420 {
    /// A black picture.
    #[must_use]
    pub fn black(width: usize, height: usize) -> Self {
        let chroma = width.div_ceil(2) * height.div_ceil(2);
        Self {
            width,
            height,
            y: vec![0; width * height],
            u: vec![128; chroma],
            v: vec![128; chroma],
        }
    }

    /// Columns of chroma.
    #[must_use]
    pub fn chroma_width(&self) -> usize {
        self.width.div_ceil(2)
    }

    /// Rows of chroma.
    #[must_use]
    pub fn chroma_height(&self) -> usize {
        self.height.div_ceil(2)
    }

    /// The same at 1/`times` of its size with even sides, each pixel the mean of those that it replaces; `None` where it is less than 2 `times` (or nothing)
    /// pixels wide or high.
    #[must_use]
    pub fn reduced(&self, times: usize) -> Option<Self> {
        let half = (self.width.checked_div(times)? / 2, self.height / times / 2);
        let (width, height) = (2 * half.0, 2 * half.1);
        Some(Self {
            width,
            height,
            y: reduced_plane(&self.y, self.width, times, (width, height))?,
            u: reduced_plane(&self.u, self.chroma_width(), times, half)?,
            v: reduced_plane(&self.v, self.chroma_width(), times, half)?,
        })
    }

    /// Paints one pixel `[y, u, v]`; its three neighbours in the same 2x2 block take on the colour, not the
    /// brightness. A pixel outside the picture is left out.
    pub fn put(&mut self, x: i64, y: i64, [luma, u, v]: [u8; 3]) {
        let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else {
            return;
        };
        if x >= self.width || y >= self.height {
            return;
        }
        let chroma = (y / 2) * self.chroma_width() + x / 2;
        self.y[y * self.width + x] = luma;
        self.u[chroma] = u;
        self.v[chroma] = v;
    }
}

/// How a frame is stored. A frame that is predicted from others holds what the encoder thought worth adding to the
/// prediction, so that a ball in it is a little where it was expected: more so in one that is interpolated between
/// two others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Coded {
    /// By itself, or losslessly, or it is not known how.
    #[default]
    Whole,
    /// From a frame before (a P frame).
    Predicted,
    /// From frames before and behind (a B frame).
    Interpolated,
}

/// A decoded frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Position in presentation order, from 0.
    pub index: usize,
    /// Presentation time by the file's own stamp, from the first frame on (the first is 0), s.
    pub time_s: f64,
    /// The luma plane (or the mixture that it was asked to be), turned upright by the file's rotation tag.
    pub luma: Luma,
    /// How the file stores it.
    pub coded: Coded,
    /// Its colours; `None` for a grey recording.
    pub colour: Option<FrameColour>,
}

/// The code values that mean black and white.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LumaRange {
    /// Code value of black: 0 (full range) or 16 (limited).
    pub black: u8,
    /// Code value of white: 255 (full range) or 235 (limited).
    pub white: u8,
}

impl LumaRange {
    /// All that eight bits hold.
    pub const FULL: Self = Self { black: 0, white: 255 };

    /// A picture with black..white stretched to 0..=255, for people.
    #[must_use]
    pub fn stretched(self, luma: &Luma) -> Luma {
        let (black, white) = (f64::from(self.black), f64::from(self.white));
        let stretch = |&value: &u8| {
            let part = (f64::from(value) - black) / (white - black);
            (255.0 * part).round().clamp(0.0, 255.0) as u8
        };
        Luma {
            width: luma.width,
            height: luma.height,
            data: luma.data.iter().map(stretch).collect(),
        }
    }
}

/// In which direction of the upright picture the rows of the stored one follow each other: what a rolling shutter exposes first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RowOrder {
    /// As the upright picture's.
    #[default]
    Down,
    /// The upright picture is the stored one turned by 180 degrees.
    Up,
    /// It is the stored one turned by 90 degrees: stored rows are columns, the first to the left.
    Right,
    /// The same with the first to the right.
    Left,
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
    /// Whether [`Frame::time_s`] counts seconds. A folder of images and a bare stream (.h264) have no clock: their
    /// `time_s` is the number of frame periods since the first frame, and the user has to give `frame_rate_hz`.
    pub has_time_base: bool,
    /// The unit that the file stores times in, s: no stamp is better than this. `None` without a time base.
    pub time_resolution_s: Option<f64>,
    /// How the file's rotation tag turns its rows.
    pub row_order: RowOrder,
    /// Width of a pixel over its height, as shown; 1 for square pixels.
    pub pixel_aspect: f64,
    /// How chroma lies among the pixels; `None` for a grey recording.
    pub chroma_grid: Option<ChromaGrid>,
    /// The shares of red and blue in luma.
    pub luma_shares: (f64, f64),
}

/// What went wrong while reading, known in full once the last frame is read.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StreamHealth {
    /// Frames given so far.
    pub frames_read: u64,
    /// Frames by the container's own count.
    pub frames_expected: Option<u64>,
    /// Packets or frames that were damaged: lost, or decoded with errors concealed (those are given, for the decoder
    /// cannot say reliably which they are).
    pub damaged: u64,
    /// Frames stored as two fields.
    pub interlaced: u64,
    /// Frames whose stamp was missing or did not increase; their time was interpolated.
    pub stamps_repaired: u64,
    /// The stream ended with an error of the container (a file cut short), in words.
    pub ended_early: Option<String>,
    /// What else the user has to know of the file, in order of appearance.
    pub notes: Vec<SourceNote>,
}

/// A word on the file that stops nothing: a stable code and a sentence.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SourceNote {
    /// Stable, lower case with underscores: `rotation_ignored`, `pixels_not_square`, `several_video_streams`,
    /// `no_time_stamps`, `image_numbers_missing`, `images_without_number`.
    pub code: &'static str,
    /// What was noticed, with numbers, and what to do.
    pub message: String,
}
