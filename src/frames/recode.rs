//! A recording drawn over: every frame is decoded in colour, painted on, and coded again.

use super::Yuv420;
use super::encode::{Coding, Effort, EncodeError, Timing, VideoOptions, VideoWriter};
use super::error::FrameError;
use super::folder::FolderReader;
use super::pixels::has_room_for_several;
use super::video::{PictureReader, TimedPicture, VideoReader};
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Quality of overlays: looks like the original.
const CODING: Coding = Coding::H264 {
    crf: 20,
    gop: 60,
    b_frames: 0,
};

/// Rate at which a recording without a time base is shown, Hz.
const RATE_WITHOUT_CLOCK_HZ: f64 = 25.0;

/// How many times smaller, along each side, a recording of pictures of this size is drawn over: 1, but where memory has no room for several
/// ([`has_room_for_several`]), as an encoder holds a dozen.
#[must_use]
pub fn drawn_smaller(size_px: (usize, usize)) -> usize {
    if has_room_for_several(size_px) { 1 } else { 4 }
}

/// Why a recording could not be drawn over.
#[derive(Debug, Error)]
pub enum RecodeError {
    /// The input cannot be read.
    #[error(transparent)]
    Read(#[from] FrameError),
    /// The output cannot be written.
    #[error(transparent)]
    Write(#[from] EncodeError),
    /// The output would replace the recording itself.
    #[error(
        "cannot write {}: that is the recording itself; accepted is another name: choose another output folder",
        path.display()
    )]
    SameFile {
        /// The file.
        path: PathBuf,
    },
    /// There is no room for a frame of 2x2 pixels.
    #[error("cannot write {}: the picture of the recording is {width}x{height} px; accepted are 2 px a side or more", path.display())]
    TooSmall {
        /// The output.
        path: PathBuf,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
}

/// Decodes every frame of `input` (a video or a folder of images) upright and in colour, lets `draw` paint on it, and
/// writes an H.264 mp4 with the same time stamps. `draw` gets the frame's index, as in
/// [`Frame::index`](super::Frame::index), and the picture; code values are of full range. An odd last column or row is
/// cut off, for H.264 wants even sides; very large pictures are made smaller ([`drawn_smaller`]) before `draw` gets them. A folder of images is shown at 25 Hz. One frame is held at a time.
///
/// # Errors
/// What makes the input unreadable or the output unwritable; nothing of the output is left then.
pub fn recode(
    input: &Path,
    output: &Path,
    draw: &mut dyn FnMut(usize, &mut Yuv420),
) -> Result<(), RecodeError> {
    if same_file(input, output).unwrap_or(false) {
        return Err(RecodeError::SameFile {
            path: output.to_owned(),
        });
    }
    if input.is_dir() {
        copy(&mut FolderReader::open(input)?, output, draw)
    } else {
        copy(&mut VideoReader::open(input)?, output, draw)
    }
}

fn same_file(a: &Path, b: &Path) -> io::Result<bool> {
    Ok(a.canonicalize()? == b.canonicalize()?)
}

fn copy(
    reader: &mut impl PictureReader<Yuv420>,
    output: &Path,
    draw: &mut dyn FnMut(usize, &mut Yuv420),
) -> Result<(), RecodeError> {
    let info = reader.info();
    let size_px = (info.width_px, info.height_px);
    let times = drawn_smaller(size_px);
    let [width, height] = [size_px.0, size_px.1].map(|side| (side / times) & !1);
    let too_small = || RecodeError::TooSmall {
        path: output.to_owned(),
        width: size_px.0,
        height: size_px.1,
    };
    if width == 0 || height == 0 {
        return Err(too_small());
    }
    // Only a hint for rate control here: a nonsensical one must not stop the work.
    let rate_hz = info
        .nominal_rate_hz
        .unwrap_or(RATE_WITHOUT_CLOCK_HZ)
        .clamp(1.0, 10_000.0);
    let options = VideoOptions {
        timing: Timing::Stamped,
        effort: Effort::Quick,
        ..VideoOptions::new(rate_hz, CODING)
    };
    let mut writer = VideoWriter::create_with(output, width, height, &options)?;
    let seconds = if info.has_time_base {
        1.0
    } else {
        1.0 / RATE_WITHOUT_CLOCK_HZ
    };
    while let Some(TimedPicture {
        index,
        time_s,
        pixels: mut picture,
        ..
    }) = reader.next()?
    {
        let mut smaller = None;
        if times > 1 {
            smaller = Some(picture.reduced(times).ok_or_else(too_small)?);
        }
        let drawn = match &mut smaller {
            Some(smaller) => smaller,
            None => {
                crop(&mut picture, width, height);
                &mut picture
            }
        };
        draw(index, drawn);
        writer.write_yuv_at(drawn, time_s * seconds)?;
        reader.recycle(picture);
    }
    writer.finish()?;
    Ok(())
}

/// Cuts off the last column and row of an odd picture; chroma, which is rounded up, keeps its own.
fn crop(picture: &mut Yuv420, width: usize, height: usize) {
    if (picture.width, picture.height) == (width, height) {
        return;
    }
    let chroma_width = picture.chroma_width();
    keep(&mut picture.y, picture.width, width, height);
    keep(&mut picture.u, chroma_width, width / 2, height / 2);
    keep(&mut picture.v, chroma_width, width / 2, height / 2);
    (picture.width, picture.height) = (width, height);
}

/// Keeps the first `width` of `stride` columns, and the first `height` rows.
fn keep(plane: &mut Vec<u8>, stride: usize, width: usize, height: usize) {
    for y in 0..height {
        plane.copy_within(y * stride..y * stride + width, y * width);
    }
    plane.truncate(width * height);
}
