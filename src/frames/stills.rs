//! Stills of a recording in its colours, for people to look at.

use super::folder::FolderReader;
use super::survey::EvenSample;
use super::video::{PictureReader, TimedPicture, VideoReader};
use super::{FrameError, Yuv420};
use std::path::Path;

/// A frame, and what was made of it.
#[derive(Debug, Clone)]
pub struct Still<T> {
    /// The frame's number, from 0, as in [`Frame::index`](super::Frame::index).
    pub index: usize,
    /// Its time, s.
    pub time_s: f64,
    /// What was made of its picture.
    pub picture: T,
}

/// What `make` makes of up to `at_most` frames, evenly spread over the recording (a video or a folder of images), upright and in
/// colour; all of them where there are no more. Every frame is decoded, so that the numbers are those of a full reading; one is held at
/// a time.
///
/// # Errors
/// What makes the recording unreadable, and what `make` refuses.
pub fn stills<T, E: From<FrameError>>(
    path: &Path,
    at_most: usize,
    mut make: impl FnMut(&Yuv420) -> Result<T, E>,
) -> Result<Vec<Still<T>>, E> {
    if path.is_dir() {
        chosen(&mut FolderReader::open(path)?, at_most, &mut make)
    } else {
        chosen(&mut VideoReader::open(path)?, at_most, &mut make)
    }
}

fn chosen<T, E: From<FrameError>>(
    reader: &mut impl PictureReader<Yuv420>,
    at_most: usize,
    make: &mut impl FnMut(&Yuv420) -> Result<T, E>,
) -> Result<Vec<Still<T>>, E> {
    let mut kept = EvenSample::new(at_most);
    while let Some(TimedPicture {
        index,
        time_s,
        pixels,
        ..
    }) = reader.next()?
    {
        if kept.wants_next() {
            kept.add(Still {
                index,
                time_s,
                picture: make(&pixels)?,
            });
        }
        reader.recycle(pixels);
    }
    Ok(kept.into_frames())
}
