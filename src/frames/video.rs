//! A video file, frame by frame, by FFmpeg.
//!
//! Times are the file's own: presentation stamps after its edit list, from the first frame on, so that variable frame
//! rate and B-frames come out right. Pictures are turned upright by the rotation tag. Nothing but the named local
//! file is ever opened.

use super::av::{Decoder, DecoderSettings, DecoderThreads, Input, OpenFailure, Packet, Picture, StreamFacts};
use super::encode::MAX_SIDE_PX;
use super::error::FrameError;
use super::mixture::{ColourMix, chroma_grid};
use super::orientation::Orientation;
use super::pixels::{ColouredPlane, PixelReader, Pixels, has_room_for_several, luma_range};
use super::stamps::StampClock;
use super::{Coded, Frame, SourceInfo, SourceNote, StreamHealth};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

/// Frames of a recording, in presentation order.
pub trait FrameSource {
    /// What is known before the first frame.
    fn info(&self) -> &SourceInfo;

    /// The next frame, `None` after the last.
    ///
    /// # Errors
    /// What makes it impossible to go on; damage that can be skipped is counted in [`health`](Self::health) instead.
    fn next_frame(&mut self) -> Result<Option<Frame>, FrameError>;

    /// What went wrong so far; complete once [`next_frame`](Self::next_frame) gave `None`.
    fn health(&self) -> StreamHealth;

    /// Does what can be done of the next frame without memory for it. Never necessary.
    fn prepare(&mut self) {}

    /// Takes a used frame, so that its memory serves for one to come. Never necessary.
    fn recycle(&mut self, frame: Frame) {
        drop(frame);
    }
}

/// Pictures that only wait for others may take about so much memory, bytes: each thread of a decoder has one of its own.
const WAITING_BYTES: usize = 8 << 20;

/// Threads to decode pictures of this size with. Each waits for parts of the picture before it, so that twice as many as run at once (all
/// there are, or a job's share) keep those busy; of large pictures memory has no room for more than run at once, of the largest
/// ([`has_room_for_several`]) for one.
fn threads((width_px, height_px): (usize, usize)) -> DecoderThreads {
    let running = rayon::current_num_threads().min(16);
    if !has_room_for_several((width_px, height_px)) {
        return DecoderThreads::OfOnePicture(running);
    }
    let bytes = width_px.saturating_mul(height_px).max(1).saturating_mul(3) / 2;
    DecoderThreads::APictureEach(running + running.min(WAITING_BYTES / bytes.max(1)))
}

/// A decoded frame before it is known as what.
pub(super) struct TimedPicture<P> {
    pub index: usize,
    pub time_s: f64,
    pub pixels: P,
    pub coded: Coded,
}

/// Gives the pictures of a recording as `P`, one after the other.
pub(super) trait PictureReader<P> {
    /// What is known before the first picture.
    fn info(&self) -> &SourceInfo;

    /// The next picture with its time.
    fn next(&mut self) -> Result<Option<TimedPicture<P>>, FrameError>;

    /// What went wrong so far.
    fn health(&self) -> StreamHealth;

    /// Decodes the next picture, but takes no pixels of it.
    fn prepare(&mut self) {}

    /// Gives back pixels for later use.
    fn recycle(&mut self, pixels: P);
}

impl<R: PictureReader<ColouredPlane>> FrameSource for R {
    fn info(&self) -> &SourceInfo {
        self.info()
    }

    fn next_frame(&mut self) -> Result<Option<Frame>, FrameError> {
        Ok(self.next()?.map(TimedPicture::into_frame))
    }

    fn health(&self) -> StreamHealth {
        self.health()
    }

    fn prepare(&mut self) {
        PictureReader::prepare(self);
    }

    fn recycle(&mut self, frame: Frame) {
        self.recycle(ColouredPlane {
            plane: frame.luma,
            colour: None,
        });
    }
}

/// Reads a video file as pictures of kind `P`.
pub(super) struct VideoReader<P> {
    info: SourceInfo,
    facts: StreamFacts,
    stream: PictureStream,
    reader: PixelReader,
    clock: StampClock<(P, Coded)>,
    spare: Vec<P>,
    /// Columns and rows as stored.
    size: (usize, usize),
    pictures: usize,
    given: usize,
    /// Whether the stream has another picture, where it stands at that already.
    next_is_decoded: Option<bool>,
    interlaced: u64,
    damaged_frames: u64,
    /// What is wrong with the index of an mp4 that can be read all the same.
    index_fault: Option<String>,
    /// Byte after the last one that the index names, and the length of the file.
    index_end: Option<u64>,
    file_bytes: u64,
    notes: Vec<SourceNote>,
    ended: bool,
}

impl<P: Pixels> VideoReader<P> {
    pub(super) fn open(path: &Path) -> Result<Self, FrameError> {
        Self::open_mixed(path, None)
    }

    /// The same with this in the place of luma.
    pub(super) fn open_mixed(path: &Path, mix: Option<ColourMix>) -> Result<Self, FrameError> {
        let (input, file_bytes) = open_input(path)?;
        let facts = input.facts().clone();
        let (expected, index_end) = expectations(&input);
        let mut stream = PictureStream::open(path, input, WantedPictures::Every)?;
        if !stream.next() {
            return Err(no_frames(path, &stream));
        }
        let size = checked_size(path, &stream.picture)?;
        let index_fault = is_mp4(&facts.container)
            .then(|| index_box(path).ok().flatten())
            .flatten();
        let mut notes = notes_on(&facts);
        let orientation = orientation(&facts, &stream.picture, &mut notes);
        let info = info(path, &facts, expected, &stream.picture, orientation, &mut notes);
        let tick_s = facts.time_base.positive().unwrap_or(1.0);
        let mut reader = Self {
            clock: StampClock::new(tick_s, facts.nominal_rate, declared_rate(&facts)),
            info,
            facts,
            stream,
            reader: PixelReader::upright(orientation).mixing(mix),
            spare: Vec::new(),
            size,
            pictures: 0,
            given: 0,
            next_is_decoded: None,
            interlaced: 0,
            damaged_frames: 0,
            index_fault,
            index_end,
            file_bytes,
            notes,
            ended: false,
        };
        reader.take_picture()?;
        Ok(reader)
    }

    /// Reads the picture that the stream stands at into the clock.
    fn take_picture(&mut self) -> Result<(), FrameError> {
        let picture = &self.stream.picture;
        let found = (picture.width(), picture.height());
        if found != self.size {
            self.ended = true;
            let o = &self.reader;
            return Err(FrameError::SizeChanged {
                path: self.info.path.clone(),
                frame: self.pictures,
                expected: o.shown(self.size),
                found: o.shown(found),
            });
        }
        self.pictures += 1;
        self.interlaced += u64::from(picture.is_interlaced());
        self.damaged_frames += u64::from(picture.is_damaged());
        let pixels = P::read(&mut self.reader, picture, self.spare.pop())
            .map_err(|e| ffmpeg(&self.info.path, "convert a frame to grey", e))?;
        self.clock.push(picture.stamp(), (pixels, picture.coded()));
        self.stream.picture.clear();
        Ok(())
    }

    /// How long an avi is by its header's count of frames, s; FFmpeg's duration is that of the data left.
    fn counted_duration_s(&self) -> Option<f64> {
        let frames = usize::try_from(self.facts.frames?).ok()?;
        Some(count(frames) / self.facts.nominal_rate?)
    }

    /// Whether the file holds less than its own header says.
    fn ended_early(&self) -> Option<String> {
        if let Some(error) = &self.stream.read_error {
            return Some(format!(
                "the file cannot be read on after frame {}: {error}",
                self.given
            ));
        }
        if let Some(fault) = &self.index_fault {
            return Some(format!(
                "the index (the moov box) is {fault}: frames may be missing"
            ));
        }
        if let Some(end) = self.index_end.filter(|&end| end > self.file_bytes) {
            return Some(format!(
                "the index names data up to byte {end}, but the file ends at byte {}: it was cut short",
                self.file_bytes
            ));
        }
        if let Some(expected) = self.info.frames_expected.filter(|_| self.index_end.is_some())
            && self.stream.packets < expected
        {
            return Some(format!(
                "the index names {expected} frames, but {} came",
                self.stream.packets
            ));
        }
        if self.index_end.is_some() {
            return None; // an index knows better than a duration
        }
        let duration = if self.facts.container == "avi" {
            self.counted_duration_s()?
        } else {
            self.facts.duration_s?
        };
        let last = self.clock.last_s()?;
        // A long step may be missing without any harm in a recording of variable rate.
        (self.facts.has_stamps && last + 3.0 * self.clock.longest_step_s < duration).then(|| {
            format!(
                "the header says {duration:.3} s, but the last frame stands at {last:.3} s: it was cut short"
            )
        })
    }
}

impl<P: Pixels> PictureReader<P> for VideoReader<P> {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next(&mut self) -> Result<Option<TimedPicture<P>>, FrameError> {
        loop {
            if let Some((time_s, (pixels, coded))) = self.clock.pop() {
                let index = self.given;
                self.given += 1;
                let time_s = if self.facts.has_stamps {
                    time_s
                } else {
                    count(index)
                };
                return Ok(Some(TimedPicture {
                    index,
                    time_s,
                    pixels,
                    coded,
                }));
            }
            if self.ended {
                return Ok(None);
            }
            let is_another = self.next_is_decoded.take();
            if is_another.unwrap_or_else(|| self.stream.next()) {
                self.take_picture()?;
            } else {
                self.ended = true;
                self.clock.end();
            }
        }
    }

    fn health(&self) -> StreamHealth {
        StreamHealth {
            frames_read: self.given as u64,
            frames_expected: self.info.frames_expected,
            damaged: self.stream.damaged(self.damaged_frames),
            interlaced: self.interlaced,
            stamps_repaired: if self.facts.has_stamps {
                self.clock.repaired
            } else {
                0
            },
            ended_early: if self.ended { self.ended_early() } else { None },
            notes: self.notes.clone(),
        }
    }

    fn prepare(&mut self) {
        if !self.ended && self.next_is_decoded.is_none() && self.clock.is_empty() {
            self.next_is_decoded = Some(self.stream.next());
        }
    }

    fn recycle(&mut self, pixels: P) {
        if self.spare.len() < 4 {
            self.spare.push(pixels);
        }
    }
}

impl TimedPicture<ColouredPlane> {
    pub(super) fn into_frame(self) -> Frame {
        Frame {
            index: self.index,
            time_s: self.time_s,
            luma: self.pixels.plane,
            coded: self.coded,
            colour: self.pixels.colour,
        }
    }
}

/// Which pictures of a stream are to be decoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum WantedPictures {
    /// All.
    Every,
    /// Those that others refer to.
    Referenced,
    /// Single key frames, by [`PictureStream::key_frame`].
    Key,
}

/// Pictures out of a stream, one after the other, past whatever is damaged.
pub(super) struct PictureStream {
    pub input: Input,
    decoder: Decoder,
    packet: Packet,
    /// The picture that [`next`](Self::next) found.
    pub picture: Picture,
    /// Packets read.
    pub packets: u64,
    corrupt_packets: u64,
    decode_errors: u64,
    /// What the container said when it could not be read on.
    pub read_error: Option<String>,
    draining: bool,
}

impl PictureStream {
    pub(super) fn open(path: &Path, input: Input, wanted: WantedPictures) -> Result<Self, FrameError> {
        let failed = |e| ffmpeg(path, "start the decoder", e);
        let settings = DecoderSettings {
            // A key frame is decoded alone: more threads would wait, each with pictures of its own.
            threads: if wanted == WantedPictures::Key {
                DecoderThreads::APictureEach(1)
            } else {
                let facts = input.facts();
                let side_px = |px: i64| usize::try_from(px).unwrap_or(0);
                threads((side_px(facts.width), side_px(facts.height)))
            },
            skip_unreferenced: wanted == WantedPictures::Referenced,
        };
        let decoder = Decoder::open(&input, settings).map_err(failed)?;
        let Some(decoder) = decoder else {
            let codec = input.facts().codec.clone();
            return Err(FrameError::NoDecoder {
                path: path.to_owned(),
                codec,
            });
        };
        Ok(Self {
            decoder,
            input,
            packet: Packet::new().map_err(failed)?,
            picture: Picture::new().map_err(failed)?,
            packets: 0,
            corrupt_packets: 0,
            decode_errors: 0,
            read_error: None,
            draining: false,
        })
    }

    /// Decodes up to the next picture; `false` at the end.
    pub(super) fn next(&mut self) -> bool {
        // A decoder that gives nothing but errors between two packets would otherwise be asked for ever.
        const MOST_ERRORS: u32 = 256;
        let mut errors = 0;
        loop {
            match self.decoder.receive(&mut self.picture) {
                Ok(()) => return true,
                Err(e) if e.is_end() => return false,
                Err(e) if e.is_again() && !self.draining => {
                    self.feed();
                    errors = 0;
                }
                Err(e) => {
                    self.decode_errors += 1;
                    errors += 1;
                    if errors > MOST_ERRORS || e.is_again() {
                        self.read_error = Some(format!("the decoder cannot go on: {e}"));
                        return false;
                    }
                }
            }
        }
    }

    /// Gives the decoder the next packet, or the end.
    fn feed(&mut self) {
        match self.input.read(&mut self.packet) {
            Ok(()) => {
                self.packets += u64::from(!self.packet.is_discarded());
                self.corrupt_packets += u64::from(self.packet.is_corrupt());
                if self.decoder.send(&self.packet).is_err() {
                    self.decode_errors += 1;
                }
            }
            Err(error) => {
                if !error.is_end() {
                    self.read_error = Some(error.to_string());
                }
                self.draining = true;
                // Like any packet, the end may bring up what was wrong with one before.
                if self.decoder.send_end().is_err() {
                    self.decode_errors += 1;
                }
            }
        }
    }

    /// Decodes the key frame at or before `stamp` alone; `false` when nothing comes of it.
    pub(super) fn key_frame(&mut self, stamp: i64) -> bool {
        self.decoder.flush();
        let mut found = self.key_packet(stamp);
        if found && !self.packet.is_at(stamp) {
            // An index is by decoding time; MP4 is searched by presentation time, which is later by the stream's delay.
            let delay = self.packet.delay().unwrap_or(0);
            found = self.key_packet(stamp.saturating_add(delay));
        }
        found
            && self.decoder.send(&self.packet).is_ok()
            && self.decoder.send_end().is_ok()
            && self.decoder.receive(&mut self.picture).is_ok()
    }

    /// Reads the key frame's packet at or before `stamp`.
    fn key_packet(&mut self, stamp: i64) -> bool {
        self.input.seek(stamp).is_ok()
            && (0..MAX_PACKETS_TO_KEY)
                .any(|_| self.input.read(&mut self.packet).is_err() || self.packet.is_key())
            && self.packet.is_key()
    }

    /// Packets or frames that were damaged, each counted once: a corrupt packet ends in an error, or in a damaged
    /// frame, or in a frame that only looks sound.
    pub(super) fn damaged(&self, damaged_frames: u64) -> u64 {
        let pictures = damaged_frames.max(self.decoder.concealed());
        self.corrupt_packets.max(self.decode_errors + pictures)
    }
}

/// After a seek the key frame comes at once, or a few packets later in containers with a coarse index.
const MAX_PACKETS_TO_KEY: usize = 1000;

/// Opens the container, with an answer of its own for each way in which that fails. Also gives the file's length.
pub(super) fn open_input(path: &Path) -> Result<(Input, u64), FrameError> {
    let bytes = readable_bytes(path)?;
    let input = Input::open(path).map_err(|failure| open_error(path, failure))?;
    let (width, height) = (input.facts().width, input.facts().height);
    check_side(path, width, height)?;
    Ok((input, bytes))
}

/// What a container that was not opened is to people.
pub(super) fn open_error(path: &Path, failure: OpenFailure) -> FrameError {
    let owned = path.to_owned();
    match failure {
        OpenFailure::Unknown => FrameError::NotVideo { path: owned },
        OpenFailure::Still(found) => FrameError::StillImage { path: owned, found },
        OpenFailure::Sound(found) => {
            index_error(path, &found).unwrap_or(FrameError::NoVideoStream { path: owned, found })
        }
        OpenFailure::Refused(found) => FrameError::Refused { path: owned, found },
        OpenFailure::Broken { format, error } => index_error(path, &format).unwrap_or(FrameError::Broken {
            path: owned,
            container: format,
            message: error.to_string(),
        }),
        OpenFailure::Av(error) => ffmpeg(path, "open the file", error),
    }
}

/// Length of a file that can be opened.
fn readable_bytes(path: &Path) -> Result<u64, FrameError> {
    let owned = path.to_owned();
    let io = |source: io::Error| match source.kind() {
        io::ErrorKind::NotFound => FrameError::Missing {
            path: path.to_owned(),
        },
        _ => FrameError::Io {
            path: path.to_owned(),
            source,
        },
    };
    // Before opening: a pipe without a writer would block.
    let metadata = std::fs::metadata(path).map_err(io)?;
    if !metadata.is_file() {
        return Err(FrameError::NotAFile { path: owned });
    }
    File::open(path).map_err(io)?;
    if metadata.len() == 0 {
        Err(FrameError::Empty { path: owned })
    } else {
        Ok(metadata.len())
    }
}

/// Why an mp4 or mov cannot be used, if it is for its index.
fn index_error(path: &Path, container: &str) -> Option<FrameError> {
    let found = is_mp4(container).then(|| index_box(path).ok().flatten())??;
    Some(FrameError::MissingIndex {
        path: path.to_owned(),
        found,
    })
}

fn is_mp4(container: &str) -> bool {
    container.split(',').any(|name| name == "mp4")
}

/// The answer for a file that gave no picture.
pub(super) fn no_frames(path: &Path, stream: &PictureStream) -> FrameError {
    index_error(path, &stream.input.facts().container).unwrap_or_else(|| FrameError::NoFrames {
        path: path.to_owned(),
        damaged: stream.damaged(0),
    })
}

/// What is wrong with the index of an mp4 or mov: it is missing, or cut short. `None` when it is whole.
///
/// The file is a chain of boxes: 4 bytes length, 4 letters, then (for length 1) 8 bytes of true length; length 0
/// reaches to the end.
fn index_box(path: &Path) -> io::Result<Option<String>> {
    const MAX_BOXES: usize = 10_000;
    let mut file = File::open(path)?;
    let end = file.metadata()?.len();
    let mut at = 0;
    for _ in 0..MAX_BOXES {
        let mut head = [0; 16];
        file.seek(SeekFrom::Start(at))?;
        let got = file.by_ref().take(16).read(&mut head)?;
        if got < 8 {
            break;
        }
        let [a, b, c, d, name @ ..] = head;
        let length = match u32::from_be_bytes([a, b, c, d]) {
            0 => end.saturating_sub(at),
            1 => {
                let [_, _, _, _, long @ ..] = name;
                u64::from_be_bytes(long)
            }
            short => u64::from(short),
        };
        if name.starts_with(b"moov") {
            let missing = at.saturating_add(length).saturating_sub(end);
            return Ok((missing > 0).then(|| format!("cut short by {missing} bytes")));
        }
        at = at.saturating_add(length.max(8));
        if at >= end {
            break;
        }
    }
    Ok(Some("missing".to_owned()))
}

/// Frames that the container itself counts, and the byte after the last one that its index names.
fn expectations(input: &Input) -> (Option<u64>, Option<u64>) {
    let facts = input.facts();
    // A fragmented mp4 counts no frames in its header, and its index grows while it is read.
    if !is_mp4(&facts.container) || facts.frames.is_none() {
        return (facts.frames, None);
    }
    let (mut shown, mut end) = (0, 0);
    for entry in input.index() {
        shown += u64::from(!entry.discarded);
        end = end.max(u64::try_from(entry.end).unwrap_or(0));
    }
    (Some(shown), Some(end))
}

fn check_side(path: &Path, width: i64, height: i64) -> Result<(), FrameError> {
    let accepted = MAX_SIDE_PX;
    let most = i64::try_from(accepted).unwrap_or(i64::MAX);
    if width > most || height > most {
        return Err(FrameError::TooLarge {
            path: path.to_owned(),
            width,
            height,
            accepted,
        });
    }
    Ok(())
}

/// Columns and rows of a picture as stored.
pub(super) fn checked_size(path: &Path, picture: &Picture) -> Result<(usize, usize), FrameError> {
    let (width, height) = (picture.width(), picture.height());
    let wide = |n: usize| i64::try_from(n).unwrap_or(i64::MAX);
    check_side(path, wide(width), wide(height))?;
    Ok((width, height))
}

/// The rotation tag, with a note when it cannot be followed.
pub(super) fn orientation(facts: &StreamFacts, first: &Picture, notes: &mut Vec<SourceNote>) -> Orientation {
    let matrix = facts.display_matrix.or_else(|| first.display_matrix());
    turn(matrix, notes)
}

/// The turn of a display matrix, with a note when it is no right angle.
pub(super) fn turn(matrix: Option<[i32; 9]>, notes: &mut Vec<SourceNote>) -> Orientation {
    match matrix.map(|m| Orientation::of(&m)) {
        None => Orientation::default(),
        Some(Ok(orientation)) => orientation,
        Some(Err(degrees)) => {
            let message = format!(
                "the file's rotation tag says {degrees:.1} degrees, which is no multiple of 90; frames are used as \
                 stored: state the true vertical as up_px in the calibration"
            );
            notes.push(SourceNote {
                code: "rotation_ignored",
                message,
            });
            Orientation::default()
        }
    }
}

fn notes_on(facts: &StreamFacts) -> Vec<SourceNote> {
    let mut notes = Vec::new();
    if facts.video_streams > 1 {
        let message = format!(
            "the file holds {} video streams; the one of {}x{} px (as stored) is read",
            facts.video_streams, facts.width, facts.height
        );
        notes.push(SourceNote {
            code: "several_video_streams",
            message,
        });
    }
    if !facts.has_stamps {
        let message = format!(
            "a bare {} stream has no time stamps; state the capture rate as frame_rate_hz in the calibration",
            facts.container
        );
        notes.push(SourceNote {
            code: "no_time_stamps",
            message,
        });
    }
    notes
}

fn info(
    path: &Path,
    facts: &StreamFacts,
    frames_expected: Option<u64>,
    first: &Picture,
    orientation: Orientation,
    notes: &mut Vec<SourceNote>,
) -> SourceInfo {
    let (width_px, height_px) = orientation.shown((first.width(), first.height()));
    let stored = facts.pixel_aspect.or_else(|| first.pixel_aspect()).unwrap_or(1.0);
    let pixel_aspect = if orientation.transposed {
        1.0 / stored
    } else {
        stored
    };
    if (pixel_aspect - 1.0).abs() > 1e-3 {
        let message = format!(
            "pixels are not square: each is {pixel_aspect:.4} times as wide as high, so one scale cannot hold for \
             both directions; convert to square pixels first (ffmpeg -i in -vf scale=iw*sar:ih,setsar=1 out.mp4)"
        );
        notes.push(SourceNote {
            code: "pixels_not_square",
            message,
        });
    }
    SourceInfo {
        path: path.to_owned(),
        width_px,
        height_px,
        nominal_rate_hz: facts.nominal_rate.filter(|_| facts.has_stamps),
        frames_expected,
        luma_range: luma_range(first),
        codec: format!("{} ({})", facts.codec, first.format_name()),
        has_time_base: facts.has_stamps,
        time_resolution_s: facts.time_base.positive().filter(|_| facts.has_stamps),
        row_order: orientation.row_order(),
        pixel_aspect,
        chroma_grid: chroma_grid(first, orientation.transposed),
        luma_shares: first.luma_shares(),
    }
}

/// The rate in the header of a container that rounds its stamps.
fn declared_rate(facts: &StreamFacts) -> Option<f64> {
    facts
        .declared_rate
        .filter(|_| facts.container.starts_with("matroska"))
}

pub(super) fn ffmpeg(path: &Path, step: &'static str, error: super::av::AvError) -> FrameError {
    FrameError::Ffmpeg {
        path: path.to_owned(),
        step,
        message: error.to_string(),
    }
}

/// A count as a number.
#[allow(clippy::cast_precision_loss, reason = "counts of frames are far below 2^52")]
pub(super) fn count(n: usize) -> f64 {
    n as f64
}
