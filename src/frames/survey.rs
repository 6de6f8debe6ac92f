//! A few frames spread over the whole recording, quickly: for the background and the noise.

use super::av::Input;
use super::error::FrameError;
use super::folder::ImageList;
use super::mixture::ColourMix;
use super::pixels::{ColouredPlane, PixelReader, Pixels, has_room_for_several};
use super::video::{
    PictureStream, WantedPictures, checked_size, count, ffmpeg, no_frames, open_error, open_input,
    orientation,
};
use super::{Coded, Frame};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::path::Path;

/// What frames that are held together may take, bytes.
const HELD_BYTES: usize = 84 << 20;

/// So few are held whatever they take, 3 or 4 of them between two frames: fewer have no median that is free of what moves.
const LEAST_HELD: usize = 5;

/// So many key frames spread over a recording of large pictures are scene enough to begin with: a ball is in one place in most of them only where
/// it lies, and the scene of the whole tells that.
const LEAST_KEY_FRAMES: usize = 3;

/// How many frames of this size, with their chroma at half of the columns and rows, may be held together.
#[must_use]
pub fn held_together(width: usize, height: usize) -> usize {
    let bytes = width.saturating_mul(height).max(1).saturating_mul(3) / 2;
    (HELD_BYTES / bytes.max(1)).max(LEAST_HELD)
}

/// Up to `at_most` frames spread evenly over the recording, in order, by the quickest way: key frames alone where
/// the file has enough of them, otherwise a pass over all frames. Never more than 2 `at_most` frames are held, nor more than
/// [`held_together`] has it, so that of large pictures there are fewer.
///
/// Indices are only those of a full reading when every frame was decoded, and times are approximate.
///
/// # Errors
/// Whatever makes the recording unreadable, as for [`open`](super::open).
pub fn open_sparse(path: &Path, at_most: usize) -> Result<Vec<Frame>, FrameError> {
    open_sparse_mixed(path, at_most, None)
}

/// The same with a mixture of luma and chroma in the place of luma.
///
/// # Errors
/// As for [`open_sparse`].
pub fn open_sparse_mixed(
    path: &Path,
    at_most: usize,
    mix: Option<ColourMix>,
) -> Result<Vec<Frame>, FrameError> {
    match at_once(path, at_most, Wanted::Enough, mix)? {
        Some(found) => Ok(found.frames),
        None => all_frames(path, at_most, mix),
    }
}

/// The same without a look at key frames, of which [`open_sparse_at_once`] found too few: by a pass over all frames of a video.
///
/// # Errors
/// As for [`open_sparse`].
pub fn open_sparse_by_pass(path: &Path, at_most: usize) -> Result<Vec<Frame>, FrameError> {
    if path.is_dir() {
        open_sparse(path, at_most)
    } else {
        all_frames(path, at_most, None)
    }
}

/// Frames spread over a recording, found without a pass over all of them.
#[derive(Debug)]
pub struct SparseFrames {
    /// The frames, in order.
    pub frames: Vec<Frame>,
    /// Whether they are enough ([`Wanted::Enough`]), or all there are.
    pub are_enough: bool,
}

/// How many frames a look at key frames alone is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wanted {
    /// At least half as many as are asked for, or as may be held together; three where that is less.
    Enough,
    /// At least three.
    Few,
}

/// The same where it takes no pass over all frames; `None` where it would, as fewer key frames than `wanted` are spread over the recording.
///
/// # Errors
/// As for [`open_sparse`].
pub fn open_sparse_at_once(
    path: &Path,
    at_most: usize,
    wanted: Wanted,
) -> Result<Option<SparseFrames>, FrameError> {
    at_once(path, at_most, wanted, None)
}

fn at_once(
    path: &Path,
    at_most: usize,
    wanted: Wanted,
    mix: Option<ColourMix>,
) -> Result<Option<SparseFrames>, FrameError> {
    let all = |frames| SparseFrames {
        frames,
        are_enough: true,
    };
    if at_most == 0 {
        return Ok(Some(all(Vec::new())));
    }
    if path.is_dir() {
        let listing = ImageList::of(path)?;
        let first = listing.frame(0, mix)?;
        let at_most = at_most.min(held_together(first.luma.width, first.luma.height) - 1);
        let chosen = evenly(listing.len(), at_most).into_iter();
        let frame = |i: usize| {
            if i == 0 {
                Ok(first.clone())
            } else {
                listing.frame(i, mix)
            }
        };
        let frames = chosen.map(frame).collect::<Result<_, _>>()?;
        return Ok(Some(all(frames)));
    }
    key_frames(path, at_most, wanted, mix)
}

/// `at_most` of the numbers below `count`, evenly spread, first and last included where there are two.
fn evenly(count: usize, at_most: usize) -> Vec<usize> {
    let taken = at_most.min(count);
    match taken {
        0 => Vec::new(),
        1 => vec![count / 2],
        _ => (0..taken).map(|i| i * (count - 1) / (taken - 1)).collect(),
    }
}

/// `at_most` of these, evenly spread, first and last included where there are two.
#[must_use]
pub fn evenly_of<T>(all: impl ExactSizeIterator<Item = T>, at_most: usize) -> Vec<T> {
    let chosen = evenly(all.len(), at_most);
    all.enumerate()
        .filter(|(position, _)| chosen.binary_search(position).is_ok())
        .map(|(_, one)| one)
        .collect()
}

/// Key frames alone, when the index shows as many as are `wanted`, evenly spread in time.
fn key_frames(
    path: &Path,
    at_most: usize,
    wanted: Wanted,
    mix: Option<ColourMix>,
) -> Result<Option<SparseFrames>, FrameError> {
    let (mut input, _) = open_input(path)?;
    let facts = input.facts();
    // Other containers have an index only of what was read so far: it would show nothing but the beginning.
    let whole_index = facts.frames.is_some() && (facts.container.contains("mp4") || facts.container == "avi");
    let matroska = facts.container.starts_with("matroska");
    let tick_s = facts.time_base.positive().unwrap_or(1.0);
    #[allow(clippy::cast_possible_truncation, reason = "saturates")]
    let by_header = facts.duration_s.map_or(0, |s| (s / tick_s) as i64);
    let side = |px: i64| usize::try_from(px).unwrap_or(0);
    let size = (side(facts.width), side(facts.height));
    let at_most = at_most.min(held_together(size.0, size.1) - 1);
    let enough = at_most.div_ceil(2).max(LEAST_KEY_FRAMES.min(at_most));
    let at_least = match wanted {
        Wanted::Enough => enough,
        Wanted::Few => LEAST_KEY_FRAMES.min(at_most),
    };
    // Matroska reads its index when it is first asked to seek.
    if !(whole_index || matroska && input.seek(0).is_ok()) {
        return Ok(None);
    }
    let stamps: Vec<i64> = input
        .index()
        .filter(|e| e.key && !e.discarded)
        .map(|e| e.stamp)
        .collect();
    let last = input.index().map(|e| e.stamp).max().unwrap_or(0).max(by_header);
    let chosen = spread_in_time(&stamps, last, at_most);
    if chosen.len() < at_least {
        return Ok(None);
    }
    // Key frames stand alone, but a decoder takes them one after the other: one for each core, where memory has room for a picture of each.
    let decoders = if has_room_for_several(size) {
        rayon::current_num_threads()
    } else {
        1
    };
    let share = chosen.len().div_ceil(decoders).max(1);
    let shares = chosen.chunks(share);
    let others: Vec<Input> = (1..shares.len())
        .map(|_| input.again(path).map_err(|failure| open_error(path, failure)))
        .collect::<Result<_, _>>()?;
    let inputs: Vec<(&[i64], Input)> = shares.zip(others.into_iter().chain([input])).collect();
    let parts: Vec<Vec<(i64, ColouredPlane)>> = inputs
        .into_par_iter()
        .map(|(stamps, input)| these_key_frames(path, input, stamps, mix))
        .collect::<Result<_, _>>()?;
    let size = |p: &ColouredPlane| (p.plane.width, p.plane.height);
    let first = parts
        .iter()
        .flatten()
        .next()
        .map(|(stamp, pixels)| (*stamp, size(pixels)));
    let mut all: Vec<(i64, ColouredPlane)> = parts.into_iter().flatten().collect();
    // An index that tells stamps wrongly leads to one key frame twice.
    all.dedup_by_key(|(stamp, _)| *stamp);
    let frames: Vec<Frame> = all
        .into_iter()
        .filter(|(_, pixels)| first.is_some_and(|(_, s)| s == size(pixels)))
        .enumerate()
        .map(|(index, (stamp, pixels))| Frame {
            index,
            #[allow(clippy::cast_precision_loss, reason = "approximate")]
            time_s: stamp.saturating_sub(first.map_or(0, |f| f.0)) as f64 * tick_s,
            luma: pixels.plane,
            coded: Coded::Whole,
            colour: pixels.colour,
        })
        .collect();
    Ok((frames.len() >= at_least).then(|| SparseFrames {
        are_enough: frames.len() >= enough,
        frames,
    }))
}

/// The key frames of `input` with these stamps, of one size; a damaged one is one frame less, nothing worse.
fn these_key_frames(
    path: &Path,
    input: Input,
    stamps: &[i64],
    mix: Option<ColourMix>,
) -> Result<Vec<(i64, ColouredPlane)>, FrameError> {
    let mut collector = PlaneCollector::open(path, input, WantedPictures::Key, mix)?;
    let mut found = Vec::with_capacity(stamps.len());
    for &stamp in stamps {
        if collector.stream.key_frame(stamp)
            && let Some(pixels) = collector.pixels()?
        {
            found.push((collector.stream.picture.stamp().unwrap_or(stamp), pixels));
        }
    }
    Ok(found)
}

/// For each of `at_most` instants, evenly spread over 0 to `last`, the nearest stamp; none of them twice.
fn spread_in_time(stamps: &[i64], last: i64, at_most: usize) -> Vec<i64> {
    let Some(&first) = stamps.iter().min() else {
        return Vec::new();
    };
    let sorted: BTreeSet<i64> = stamps.iter().copied().collect();
    let span = i128::from(last.max(first)) - i128::from(first);
    let steps = i128::try_from(at_most.max(2) - 1).unwrap_or(1);
    let nearest = |i: usize| {
        let wanted = i128::from(first) + span * i128::try_from(i).unwrap_or(0) / steps;
        let wanted = i64::try_from(wanted).unwrap_or(i64::MAX);
        let below = sorted.range(..=wanted).next_back();
        let above = sorted.range(wanted..).next();
        below
            .into_iter()
            .chain(above)
            .min_by_key(|s| s.abs_diff(wanted))
            .copied()
    };
    let chosen: BTreeSet<i64> = (0..at_most).filter_map(nearest).collect();
    chosen.into_iter().collect()
}

/// One pass over the frames that others refer to, keeping every n-th; n doubles when too many are kept.
fn all_frames(path: &Path, at_most: usize, mix: Option<ColourMix>) -> Result<Vec<Frame>, FrameError> {
    let (input, _) = open_input(path)?;
    let mut collector = PlaneCollector::open(path, input, WantedPictures::Referenced, mix)?;
    let mut kept: Option<EvenSample> = None;
    let mut index = 0;
    while collector.stream.next() {
        let kept = match &mut kept {
            Some(kept) => kept,
            None => {
                let size = checked_size(path, &collector.stream.picture)?;
                kept.insert(EvenSample::for_pictures(at_most, size))
            }
        };
        if kept.wants_next() {
            let time_s = collector
                .stream
                .picture
                .stamp()
                .map_or(count(index), |s| collector.time(s));
            if let Some(pixels) = collector.pixels()? {
                kept.add(Frame {
                    index,
                    time_s,
                    luma: pixels.plane,
                    coded: Coded::Whole,
                    colour: pixels.colour,
                });
            }
        }
        // The decoder gets its picture back before it makes the next.
        collector.stream.picture.clear();
        index += 1;
    }
    if index == 0 {
        return Err(no_frames(path, &collector.stream));
    }
    Ok(kept.map_or_else(Vec::new, EvenSample::into_frames))
}

/// Decodes pictures to upright planes with their colours, all of one size.
struct PlaneCollector<'a> {
    mix: Option<ColourMix>,
    path: &'a Path,
    stream: PictureStream,
    reader: Option<PixelReader>,
    size: (usize, usize),
    tick_s: f64,
    first: Option<i64>,
}

impl<'a> PlaneCollector<'a> {
    fn open(
        path: &'a Path,
        input: Input,
        wanted: WantedPictures,
        mix: Option<ColourMix>,
    ) -> Result<Self, FrameError> {
        let tick_s = input.facts().time_base.positive().unwrap_or(1.0);
        let stream = PictureStream::open(path, input, wanted)?;
        Ok(Self {
            mix,
            path,
            stream,
            reader: None,
            size: (0, 0),
            tick_s,
            first: None,
        })
    }

    /// The stream's picture; `None` when it is not of the first one's size.
    fn pixels(&mut self) -> Result<Option<ColouredPlane>, FrameError> {
        let picture = &self.stream.picture;
        let size = checked_size(self.path, picture)?;
        let reader = match &mut self.reader {
            Some(reader) => reader,
            None => {
                self.size = size;
                let turn = orientation(self.stream.input.facts(), picture, &mut Vec::new());
                self.reader.insert(PixelReader::upright(turn).mixing(self.mix))
            }
        };
        if size != self.size {
            return Ok(None);
        }
        let mut pixels = ColouredPlane::read(reader, picture, None)
            .map_err(|e| ffmpeg(self.path, "convert a frame to grey", e))?;
        // These are many at a time: the decoder gets its pictures back.
        pixels.colour = pixels.colour.map(|c| c.detached());
        Ok(Some(pixels))
    }

    fn time(&mut self, stamp: i64) -> f64 {
        let first = *self.first.get_or_insert(stamp);
        #[allow(clippy::cast_precision_loss, reason = "approximate")]
        let ticks = stamp.saturating_sub(first) as f64;
        ticks * self.tick_s
    }
}

/// Keeps frames evenly spread over a stream of unknown length: every `stride`-th, where the stride doubles whenever
/// so many are kept as there is room for.
#[derive(Debug)]
pub struct EvenSample<T = Frame> {
    at_most: usize,
    room: usize,
    stride: usize,
    offered: usize,
    /// With their number among those offered.
    kept: Vec<(usize, T)>,
}

impl<T> EvenSample<T> {
    /// For `at_most` frames in the end, and less than twice as many meanwhile.
    #[must_use]
    pub fn new(at_most: usize) -> Self {
        Self::within(at_most, 2 * at_most)
    }

    /// For `at_most` pictures of this width and height in the end, and no more meanwhile than may be held together.
    #[must_use]
    pub fn for_pictures(at_most: usize, (width, height): (usize, usize)) -> Self {
        Self::within(at_most, held_together(width, height).min(2 * at_most))
    }

    /// For `at_most` frames in the end, and less than `room` meanwhile: where that is less than twice as many, so may be the end's,
    /// down to half of it.
    fn within(at_most: usize, room: usize) -> Self {
        Self {
            at_most,
            room: room.max(2),
            stride: 1,
            offered: 0,
            kept: Vec::new(),
        }
    }

    /// Counts one more frame that could be had; whether it is to be added. Makes room for it before it is read.
    pub fn wants_next(&mut self) -> bool {
        let number = self.offered;
        self.offered += 1;
        if number.is_multiple_of(self.stride) && self.kept.len() + 1 >= self.room {
            self.stride *= 2;
            let stride = self.stride;
            self.kept.retain(|(number, _)| number.is_multiple_of(stride));
        }
        number.is_multiple_of(self.stride)
    }

    /// Adds the frame that was wanted.
    pub fn add(&mut self, frame: T) {
        self.kept.push((self.offered.saturating_sub(1), frame));
    }

    /// Those kept, at most as many as wanted.
    #[must_use]
    pub fn frames(&self) -> Vec<&T> {
        evenly_of(self.kept.iter().map(|(_, frame)| frame), self.at_most)
    }

    /// The same for good.
    #[must_use]
    pub fn into_frames(self) -> Vec<T> {
        evenly_of(self.kept.into_iter().map(|(_, frame)| frame), self.at_most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::Luma;

    #[test]
    fn even_choices_take_in_both_ends() {
        assert_eq!(evenly(10, 4), [0, 3, 6, 9]);
        assert_eq!(evenly(3, 8), [0, 1, 2]);
        assert_eq!(evenly(9, 1), [4]);
        assert!(evenly(0, 5).is_empty());
    }

    #[test]
    fn a_spread_stays_even_and_small() {
        for (total, at_most) in [(1, 8), (15, 8), (16, 8), (1000, 8), (1001, 1), (777, 20)] {
            let mut kept = EvenSample::new(at_most);
            for index in 0..total {
                if kept.wants_next() {
                    let luma = Luma {
                        width: 0,
                        height: 0,
                        data: Vec::new(),
                    };
                    kept.add(Frame {
                        index,
                        time_s: 0.0,
                        luma,
                        coded: Coded::Whole,
                        colour: None,
                    });
                }
                assert!(kept.kept.len() < 2 * at_most.max(2));
            }
            let frames = kept.into_frames();
            assert_eq!(frames.len(), at_most.min(total), "{total} {at_most}");
            let steps: Vec<_> = frames.windows(2).map(|w| w[1].index - w[0].index).collect();
            if let (Some(low), Some(high)) = (steps.iter().min(), steps.iter().max()) {
                assert!(high <= &(2 * low), "{total} {at_most} {steps:?}");
            }
        }
    }

    #[test]
    fn little_room_holds_few_frames() {
        for total in [1, 9, 10, 100, 1003] {
            let mut kept = EvenSample::within(15, 10);
            for index in 0..total {
                if kept.wants_next() {
                    kept.add(index);
                }
                assert!(kept.kept.len() < 10);
            }
            assert!(kept.frames().len() >= total.min(5), "{total}");
        }
    }

    #[test]
    fn key_frames_bunched_in_one_place_count_as_few() {
        let bunched: Vec<i64> = (0..100).collect();
        assert!(spread_in_time(&bunched, 100_000, 20).len() <= 2);
        let even: Vec<i64> = (0..100).map(|i| i * 1000).collect();
        assert_eq!(spread_in_time(&even, 99_000, 20).len(), 20);
        assert!(spread_in_time(&[], 5, 20).is_empty());
    }
}
