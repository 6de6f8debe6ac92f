//! A folder of numbered images as a recording.
//!
//! Images stand in the order of the last number in their names. There is no clock: `time_s` is the difference of the
//! numbers, so that a missing number is a missing frame, and the user states the rate. Each image goes straight to the
//! decoder that its first bytes call for; no demuxer, and no other file, takes part.

use super::av::{AvError, Decoder, Packet, Picture};
use super::error::FrameError;
use super::mixture::{ColourMix, chroma_grid};
use super::orientation::Orientation;
use super::pixels::{ColouredPlane, PixelReader, Pixels, luma_range};
use super::video::{PictureReader, TimedPicture, checked_size, count, ffmpeg, turn};
use super::{Coded, Frame, Luma, SourceInfo, SourceNote, StreamHealth};
use std::ffi::{CStr, OsStr};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Extensions of images.
const EXTENSIONS: [&str; 8] = ["png", "jpg", "jpeg", "tif", "tiff", "bmp", "pgm", "webp"];

/// Largest image file; it is read whole.
const MAX_IMAGE_BYTES: u64 = 1 << 30;

/// An image and its number.
#[derive(Debug, Clone, PartialEq, Eq)]
struct NumberedImage {
    number: u64,
    path: PathBuf,
}

/// The images of a folder in order, and what is to be said of them.
pub(super) struct ImageList {
    images: Vec<NumberedImage>,
    /// Frames if no number were missing.
    expected: u64,
    notes: Vec<SourceNote>,
}

impl ImageList {
    /// Lists the images of `folder` by the last number in their names.
    pub(super) fn of(folder: &Path) -> Result<Self, FrameError> {
        let paths = pictures_in(folder)?;
        let mut notes = Vec::new();
        let images = numbered(folder, paths, &mut notes)?;
        let expected = expected(&images, &mut notes);
        Ok(Self {
            images,
            expected,
            notes,
        })
    }

    /// How many images there are.
    pub(super) fn len(&self) -> usize {
        self.images.len()
    }

    /// The image at `index` as a frame of its own, at its time.
    pub(super) fn frame(&self, index: usize, mix: Option<ColourMix>) -> Result<Frame, FrameError> {
        let image = &self.images[index];
        let mut notes = Vec::new();
        let mut reader: Option<PixelReader> = None;
        let (_, ColouredPlane { plane, colour }) = decoded(image, |picture| {
            let upright = PixelReader::upright(turn(picture.display_matrix(), &mut notes));
            ColouredPlane::read(reader.insert(upright.mixing(mix)), picture, None)
        })?;
        Ok(Frame {
            index,
            time_s: self.time(index),
            luma: plane,
            coded: Coded::Whole,
            colour: colour.map(|c| c.detached()),
        })
    }

    fn time(&self, index: usize) -> f64 {
        let periods = self.images[index].number - self.images[0].number;
        count(usize::try_from(periods).unwrap_or(usize::MAX))
    }
}

/// A single picture, upright.
///
/// # Errors
/// A file that is missing, empty, or no image.
pub fn open_picture(path: &Path) -> Result<Luma, FrameError> {
    let image = NumberedImage {
        number: 0,
        path: path.to_owned(),
    };
    if !path.exists() {
        return Err(FrameError::Missing {
            path: path.to_owned(),
        });
    }
    let (_, luma) = decoded(&image, |picture| {
        let mut reader = PixelReader::upright(turn(picture.display_matrix(), &mut Vec::new()));
        Luma::read(&mut reader, picture, None)
    })?;
    Ok(luma)
}

/// Whether a file is an image by its name, as [`open_picture`] reads it.
#[must_use]
pub fn is_picture(path: &Path) -> bool {
    is_image(path)
}

/// The images of a folder by name, whether they have numbers or not.
///
/// # Errors
/// A folder that cannot be read.
pub fn pictures_in(folder: &Path) -> Result<Vec<PathBuf>, FrameError> {
    let io = |source| FrameError::Io {
        path: folder.to_owned(),
        source,
    };
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder).map_err(io)? {
        let path = entry.map_err(io)?.path();
        if is_image(&path) {
            paths.push(path);
        }
    }
    paths.sort();
    if paths.is_empty() {
        return Err(FrameError::NoImages {
            path: folder.to_owned(),
            accepted: EXTENSIONS.join(", "),
        });
    }
    Ok(paths)
}

fn is_image(path: &Path) -> bool {
    let extension = path
        .extension()
        .and_then(OsStr::to_str)
        .map(str::to_ascii_lowercase);
    let hidden = path
        .file_name()
        .is_some_and(|n| n.as_encoded_bytes().starts_with(b"."));
    !hidden && extension.is_some_and(|e| EXTENSIONS.contains(&e.as_str())) && path.is_file()
}

/// The last run of digits in the name without its extension.
fn number_of(path: &Path) -> Option<u64> {
    let stem = path.file_stem()?.to_string_lossy();
    let head = stem.trim_end_matches(|c: char| !c.is_ascii_digit());
    let digits = head.len() - head.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    head[head.len() - digits..].parse().ok()
}

/// Images in the order of their numbers. Images without one are left out, unless none has one: then names sort them.
fn numbered(
    folder: &Path,
    paths: Vec<PathBuf>,
    notes: &mut Vec<SourceNote>,
) -> Result<Vec<NumberedImage>, FrameError> {
    let (with, without): (Vec<_>, Vec<_>) = paths.into_iter().partition(|p| number_of(p).is_some());
    let code = "images_without_number";
    if with.is_empty() {
        let message = format!(
            "no image name has a number; the {} images are taken in order of name",
            without.len()
        );
        notes.push(SourceNote { code, message });
        return Ok((0..)
            .zip(without)
            .map(|(number, path)| NumberedImage { number, path })
            .collect());
    }
    if let Some(first) = without.first() {
        let message = format!(
            "{} images without a number are left out, {} first",
            without.len(),
            name(first)
        );
        notes.push(SourceNote { code, message });
    }
    let mut images: Vec<_> = with
        .into_iter()
        .filter_map(|path| {
            Some(NumberedImage {
                number: number_of(&path)?,
                path,
            })
        })
        .collect();
    images.sort_by_key(|image| image.number); // stable: equal numbers stay in order of name
    match images.windows(2).find(|pair| pair[0].number == pair[1].number) {
        Some(pair) => Err(FrameError::SameNumber {
            path: folder.to_owned(),
            first: name(&pair[0].path),
            second: name(&pair[1].path),
            number: pair[0].number,
        }),
        None => Ok(images),
    }
}

/// Frames if no number were missing; a note when some are. Numbers may go up by any constant step.
fn expected(images: &[NumberedImage], notes: &mut Vec<SourceNote>) -> u64 {
    let steps = || images.windows(2).map(|pair| pair[1].number - pair[0].number);
    let Some(step) = steps().min() else { return 1 };
    let missing = |gap: u64| gap.div_ceil(step) - 1;
    let total: u64 = steps().map(missing).fold(0, u64::saturating_add);
    let gap = images
        .windows(2)
        .find(|pair| pair[1].number - pair[0].number > step);
    if let Some(pair) = gap {
        let message = format!(
            "{total} numbers are missing among the images, the first of them between {} and {}; times leave room for them",
            name(&pair[0].path),
            name(&pair[1].path)
        );
        notes.push(SourceNote {
            code: "image_numbers_missing",
            message,
        });
    }
    total.saturating_add(images.len() as u64)
}

fn name(path: &Path) -> String {
    path.file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned()
}

/// FFmpeg's decoder for an image, by its first bytes.
fn decoder_for(bytes: &[u8]) -> Option<&'static CStr> {
    match bytes {
        [0x89, b'P', b'N', b'G', ..] => Some(c"png"),
        [0xFF, 0xD8, ..] => Some(c"mjpeg"),
        [b'I', b'I', 42, 0, ..] | [b'M', b'M', 0, 42, ..] => Some(c"tiff"),
        [b'B', b'M', ..] => Some(c"bmp"),
        [b'P', b'2' | b'5', ..] => Some(c"pgm"),
        [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'E', b'B', b'P', ..] => Some(c"webp"),
        _ => None,
    }
}

/// Decodes an image and hands the picture to `read`; gives the codec's name with what that makes of it.
fn decoded<T>(
    image: &NumberedImage,
    read: impl FnOnce(&Picture) -> Result<T, AvError>,
) -> Result<(&'static str, T), FrameError> {
    let failed = |message: String| FrameError::Image {
        path: image.path.clone(),
        message,
        accepted: EXTENSIONS.join(", "),
    };
    let io = |source: io::Error| FrameError::Io {
        path: image.path.clone(),
        source,
    };
    let length = fs::metadata(&image.path).map_err(io)?.len();
    if length > MAX_IMAGE_BYTES {
        return Err(failed(format!(
            "it has {length} bytes, more than {MAX_IMAGE_BYTES}"
        )));
    }
    let bytes = fs::read(&image.path).map_err(io)?;
    let Some(codec) = decoder_for(&bytes) else {
        let found = if bytes.is_empty() {
            "the file is empty"
        } else {
            "its content is no such image"
        };
        return Err(failed(found.to_owned()));
    };
    let name = codec.to_str().unwrap_or("image");
    let picture = decode(codec, &bytes)
        .map_err(|e| failed(e.to_string()))?
        .ok_or_else(|| failed(format!("this FFmpeg has no decoder for {name}")))?;
    checked_size(&image.path, &picture)?;
    let read = read(&picture).map_err(|e| ffmpeg(&image.path, "convert the image", e))?;
    Ok((name, read))
}

fn decode(codec: &CStr, bytes: &[u8]) -> Result<Option<Picture>, AvError> {
    let Some(mut decoder) = Decoder::for_image(codec)? else {
        return Ok(None);
    };
    let mut picture = Picture::new()?;
    decoder.send(&Packet::holding(bytes)?)?;
    decoder.send_end()?;
    decoder.receive(&mut picture)?;
    Ok(Some(picture))
}

/// Reads a folder of images as pictures of kind `P`.
pub(super) struct FolderReader<P> {
    info: SourceInfo,
    listing: ImageList,
    reader: PixelReader,
    orientation: Orientation,
    spare: Option<P>,
    given: usize,
    damaged: u64,
    failed: bool,
}

impl<P: Pixels> FolderReader<P> {
    pub(super) fn open(folder: &Path) -> Result<Self, FrameError> {
        let mut listing = ImageList::of(folder)?;
        let (codec, (size, range, orientation, format, grid, luma_shares)) =
            decoded(&listing.images[0], |picture| {
                let orientation = turn(picture.display_matrix(), &mut listing.notes);
                let size = orientation.shown((picture.width(), picture.height()));
                let grid = chroma_grid(picture, orientation.transposed);
                // The chroma of RGB pictures is made by us, and a JPEG's is BT.601's by its standard.
                let shares = (0.299, 0.114);
                Ok((
                    size,
                    luma_range(picture),
                    orientation,
                    picture.format_name(),
                    grid,
                    shares,
                ))
            })?;
        let info = SourceInfo {
            path: folder.to_owned(),
            width_px: size.0,
            height_px: size.1,
            nominal_rate_hz: None,
            frames_expected: Some(listing.expected),
            luma_range: range,
            codec: format!("{codec} images ({format})"),
            has_time_base: false,
            time_resolution_s: None,
            row_order: orientation.row_order(),
            pixel_aspect: 1.0,
            chroma_grid: grid,
            luma_shares,
        };
        Ok(Self {
            info,
            listing,
            reader: PixelReader::upright(orientation),
            orientation,
            spare: None,
            given: 0,
            damaged: 0,
            failed: false,
        })
    }

    /// The same with this in the place of luma.
    pub(super) fn mixing(self, mix: Option<ColourMix>) -> Self {
        Self {
            reader: self.reader.mixing(mix),
            ..self
        }
    }

    fn read(&mut self, index: usize) -> Result<P, FrameError> {
        let image = &self.listing.images[index];
        let expected = (self.info.width_px, self.info.height_px);
        let spare = self.spare.take();
        let (reader, usual) = (&mut self.reader, self.orientation);
        let (_, (found, damaged, pixels)) = decoded(image, |picture| {
            // A phone may have been turned between two pictures: each has a tag of its own.
            let orientation = turn(picture.display_matrix(), &mut Vec::new());
            if orientation != usual {
                *reader = PixelReader::upright(orientation).mixing(reader.mix());
            }
            let found = orientation.shown((picture.width(), picture.height()));
            let pixels = (found == expected)
                .then(|| P::read(reader, picture, spare))
                .transpose()?;
            Ok((found, picture.is_damaged(), pixels))
        })?;
        self.damaged += u64::from(damaged);
        pixels.ok_or_else(|| FrameError::ImageSize {
            path: image.path.clone(),
            expected,
            found,
        })
    }
}

impl<P: Pixels> PictureReader<P> for FolderReader<P> {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next(&mut self) -> Result<Option<TimedPicture<P>>, FrameError> {
        let index = self.given;
        if self.failed || index >= self.listing.len() {
            return Ok(None);
        }
        let read = self.read(index);
        self.failed = read.is_err();
        let pixels = read?;
        self.given += 1;
        Ok(Some(TimedPicture {
            index,
            time_s: self.listing.time(index),
            pixels,
            coded: Coded::Whole,
        }))
    }

    fn health(&self) -> StreamHealth {
        StreamHealth {
            frames_read: self.given as u64,
            frames_expected: self.info.frames_expected,
            damaged: self.damaged,
            notes: self.listing.notes.clone(),
            ..StreamHealth::default()
        }
    }

    fn recycle(&mut self, pixels: P) {
        self.spare = Some(pixels);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_number_of_the_name_counts() {
        let number = |name: &str| number_of(Path::new(name));
        assert_eq!(number("frame_0012.png"), Some(12));
        assert_eq!(number("run2_7b.png"), Some(7));
        assert_eq!(number("3.tar.png"), Some(3));
        assert_eq!(number("background.png"), None);
        assert_eq!(number("99999999999999999999999.png"), None);
    }

    #[test]
    fn numbers_may_go_up_by_any_step_and_gaps_are_counted() {
        let images = |numbers: &[u64]| -> Vec<_> {
            numbers
                .iter()
                .map(|&number| NumberedImage {
                    number,
                    path: format!("{number}.png").into(),
                })
                .collect()
        };
        let mut notes = Vec::new();
        assert_eq!(expected(&images(&[5]), &mut notes), 1);
        assert_eq!(expected(&images(&[0, 10, 20]), &mut notes), 3);
        assert!(notes.is_empty());
        assert_eq!(expected(&images(&[1, 2, 5, 6, 8]), &mut notes), 8);
        assert_eq!(notes[0].code, "image_numbers_missing");
        assert!(notes[0].message.contains("3 numbers") && notes[0].message.contains("2.png and 5.png"));
        let far = [0, 1, u64::MAX];
        assert_eq!(expected(&images(&far), &mut notes), u64::MAX);
    }
}
