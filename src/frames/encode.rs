//! From luma planes to a video file: rendered scenes and overlays.
//!
//! A file appears whole or not at all: frames go to a temporary file beside the wanted one, which
//! [`VideoWriter::finish`] renames. Code values are written as they are and flagged full range, so that grey 0..=255
//! comes back. The same frames give the same bytes, on every x86-64 with AVX: of libx264 only what is exact is used. Its look ahead
//! is not: its "mbtree" takes reciprocals as roughly as the processor has them, and where that has AVX-512 (core 164) reads memory that
//! nobody wrote, so that a clip depended on what the process had done before.

use super::av::{Encoder, EncoderSettings, Failure, Picture, PixelFormat, Rational};
use super::{Luma, Yuv420, temporary};
use std::io;
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;
use thiserror::Error;

/// Largest side of a picture, px; what decoding accepts, too.
pub(super) const MAX_SIDE_PX: usize = 16384;

/// Above this rate frames of a Matroska file share their time stamps, and its header holds no rate.
const MKV_MOST_HZ: f64 = 1000.0;

/// How frames are coded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coding {
    /// H.264 by libx264, 4:2:0, 8 bits.
    H264 {
        /// Constant rate factor: 0 is the best, 18 looks like the original, 51 is the worst.
        crf: u8,
        /// Frames from one key frame to the next.
        gop: u32,
        /// B-frames between two reference frames, 0 to 16.
        b_frames: u32,
    },
    /// FFmpeg's variant of HuffYUV, grey, 8 bits; for a `.mkv`, which keeps times to 1 ms (our own decoding restores the constant rate).
    Lossless,
    /// The same in colour, 4:2:0.
    LosslessColour,
}

impl Coding {
    /// Whether it is without loss, in a `.mkv`.
    fn is_lossless(self) -> bool {
        !matches!(self, Self::H264 { .. })
    }
}

/// Where the samples of 4:2:0 chroma lie: between two rows, and ...
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ChromaSiting {
    /// ... at the left of two columns, as H.264 has it by custom.
    #[default]
    Left,
    /// ... between two columns, as JPEG has it.
    Centre,
}

/// Where times come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Timing {
    /// Frame i stands at i / rate.
    #[default]
    Constant,
    /// Each frame has a time of its own, to a microsecond ([`VideoWriter::write_at`]).
    Stamped,
}

/// How much work H.264 may take at the same quality.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Effort {
    /// Small files.
    #[default]
    SmallFile,
    /// Less time for files several times as large: for what is looked at once.
    Quick,
}

impl Effort {
    /// x264's name of it.
    fn preset(self) -> &'static str {
        match self {
            Self::SmallFile => "veryfast",
            Self::Quick => "ultrafast",
        }
    }

    /// Whether x264's threads share a picture rather than take one each, which would be a picture more in memory (50 MB of 3840 × 2160).
    fn shares_pictures(self) -> bool {
        self == Self::Quick
    }

    /// What is added to the constant rate factor. With its look ahead x264 adds 5.4 itself (13.5 (1 − qcomp)) and takes off what later frames
    /// refer to: by 3 more without it, clips of nine rendered scenes are 0.3 to 1.7 times as large, and centres of balls scatter 1.0 to 1.5 times as much.
    fn more_crf(self) -> f64 {
        match self {
            Self::SmallFile => 3.0,
            Self::Quick => 0.0,
        }
    }
}

/// What to write; [`VideoOptions::new`] gives the usual.
#[derive(Debug, Clone, PartialEq)]
pub struct VideoOptions {
    /// Frames a second, Hz: the time base of constant timing, a hint otherwise.
    pub frame_rate_hz: f64,
    /// How frames are coded.
    pub coding: Coding,
    /// How much work that may take, of H.264.
    pub effort: Effort,
    /// Where times come from.
    pub timing: Timing,
    /// The rotation tag: degrees clockwise that a player has to turn the stored picture by.
    pub rotation_deg: f64,
    /// Puts an mp4's index before the frames, so that a file cut short can still be read up to the cut.
    pub index_first: bool,
    /// Where chroma is to be said to lie; `None`: nothing is said.
    pub chroma_siting: Option<ChromaSiting>,
}

impl VideoOptions {
    /// Constant timing, no rotation tag, the index where it comes to lie.
    #[must_use]
    pub fn new(frame_rate_hz: f64, coding: Coding) -> Self {
        Self {
            frame_rate_hz,
            coding,
            effort: Effort::default(),
            timing: Timing::Constant,
            rotation_deg: 0.0,
            index_first: false,
            chroma_siting: None,
        }
    }
}

/// Why a video could not be written. Nothing of it is left on disk.
#[derive(Debug, Error)]
pub enum EncodeError {
    /// A size that cannot be coded.
    #[error(
        "cannot write {}: the picture is {width}x{height} px; accepted are 1 to {MAX_SIDE_PX} px a side{}",
        path.display(), if *even { ", both even for H.264 and in colour: crop or pad by a pixel, or write lossless grey (.mkv)" } else { "" }
    )]
    Size {
        /// The file.
        path: PathBuf,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Whether the coding needs even sides.
        even: bool,
    },
    /// A setting out of range.
    #[error("cannot write {}: {key} is {found}; accepted is {accepted}", path.display())]
    Setting {
        /// The file.
        path: PathBuf,
        /// The setting.
        key: &'static str,
        /// Its value.
        found: String,
        /// What it may be.
        accepted: &'static str,
    },
    /// A frame that does not fit the video.
    #[error("cannot write frame {frame} of {}: found {found}; accepted is {accepted}", path.display())]
    Frame {
        /// The file.
        path: PathBuf,
        /// The frame, from 0.
        frame: usize,
        /// What came.
        found: String,
        /// What was to come.
        accepted: String,
    },
    /// The folder, disk or file refuses.
    #[error(
        "cannot write {}: {source}; check that the folder exists, may be written to and has space left", path.display()
    )]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// FFmpeg was built without what is needed.
    #[error(
        "cannot write {}: this FFmpeg has no {what}; install a complete FFmpeg (Debian: apt install libavcodec-extra)",
        path.display()
    )]
    Missing {
        /// The file.
        path: PathBuf,
        /// The encoder or container.
        what: String,
    },
    /// FFmpeg refuses for a reason of its own.
    #[error("cannot write {} at frame {frame}: FFmpeg's encoder says: {message}", path.display())]
    Codec {
        /// The file.
        path: PathBuf,
        /// The frame, from 0.
        frame: usize,
        /// What FFmpeg said.
        message: String,
    },
}

/// Writes a video frame by frame.
///
/// Dropping it without [`finish`](Self::finish) leaves nothing behind.
pub struct VideoWriter {
    path: PathBuf,
    temporary: NamedTempFile,
    encoder: Encoder,
    picture: Picture,
    width: usize,
    height: usize,
    coding: Coding,
    timing: Timing,
    rate: f64,
    frames: usize,
    last_tick: Option<i64>,
}

impl VideoWriter {
    /// A video at constant rate; frame i stands at i / `frame_rate_hz`.
    ///
    /// # Errors
    /// A size or rate that cannot be coded, or a file that cannot be made.
    pub fn create(
        path: &Path,
        width: usize,
        height: usize,
        frame_rate_hz: f64,
        coding: Coding,
    ) -> Result<Self, EncodeError> {
        Self::create_with(path, width, height, &VideoOptions::new(frame_rate_hz, coding))
    }

    /// A video with all that can be set.
    ///
    /// # Errors
    /// As for [`create`](Self::create).
    pub fn create_with(
        path: &Path,
        width: usize,
        height: usize,
        options: &VideoOptions,
    ) -> Result<Self, EncodeError> {
        let io = |source| EncodeError::Io {
            path: path.to_owned(),
            source,
        };
        check_settings(path, width, height, options)?;
        if path.is_dir() {
            return Err(io(io::ErrorKind::IsADirectory.into()));
        }
        let temporary = temporary::file_beside(path, ".part").map_err(io)?;
        let file = temporary.as_file().try_clone().map_err(io)?;
        let settings = settings(width, height, options, &temporary);
        let encoder = Encoder::open(file, &settings).map_err(|e| explained(path, 0, e))?;
        let picture =
            Picture::blank(width, height, settings.format).map_err(|e| explained(path, 0, Failure::Av(e)))?;
        let mut writer = Self {
            path: path.to_owned(),
            temporary,
            encoder,
            picture,
            width,
            height,
            coding: options.coding,
            timing: options.timing,
            rate: options.frame_rate_hz,
            frames: 0,
            last_tick: None,
        };
        if options.coding != Coding::Lossless {
            let (columns, rows) = (width.div_ceil(2), height.div_ceil(2));
            let grey = vec![128; columns * rows];
            writer.fill(1, columns, &grey)?;
            writer.fill(2, columns, &grey)?;
        }
        Ok(writer)
    }

    /// Frames written so far.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Writes a grey frame at its turn: frame i at i / rate.
    ///
    /// # Errors
    /// A frame of another size, a full disk, an encoder that refuses.
    pub fn write(&mut self, luma: &Luma) -> Result<(), EncodeError> {
        self.put_luma(luma)?;
        self.send_next()
    }

    /// Writes a grey frame at `time_s` (from 0, increasing by a microsecond at least); needs [`Timing::Stamped`].
    ///
    /// # Errors
    /// As for [`write`](Self::write), and a time that is not after the frame before.
    pub fn write_at(&mut self, luma: &Luma, time_s: f64) -> Result<(), EncodeError> {
        let tick = self.tick_of(time_s)?;
        self.put_luma(luma)?;
        self.send(tick)
    }

    /// Writes a colour frame at its turn; not for [`Coding::Lossless`].
    ///
    /// # Errors
    /// As for [`write`](Self::write).
    pub fn write_yuv(&mut self, yuv: &Yuv420) -> Result<(), EncodeError> {
        self.put_yuv(yuv)?;
        self.send_next()
    }

    /// Writes a colour frame at `time_s`; not for [`Coding::Lossless`], needs [`Timing::Stamped`].
    ///
    /// # Errors
    /// As for [`write_at`](Self::write_at).
    pub fn write_yuv_at(&mut self, yuv: &Yuv420, time_s: f64) -> Result<(), EncodeError> {
        let tick = self.tick_of(time_s)?;
        self.put_yuv(yuv)?;
        self.send(tick)
    }

    /// Writes what is held back and gives the file its name.
    ///
    /// # Errors
    /// A full disk, or no frame at all.
    pub fn finish(mut self) -> Result<(), EncodeError> {
        if self.frames == 0 {
            return Err(self.refused("no frame at all", "one or more"));
        }
        let (path, frame) = (self.path, self.frames);
        self.encoder.finish().map_err(|e| explained(&path, frame, e))?;
        drop(self.encoder);
        match self.temporary.persist(&path) {
            Ok(_) => Ok(()),
            Err(e) => Err(EncodeError::Io {
                path,
                source: e.error,
            }),
        }
    }

    fn put_luma(&mut self, luma: &Luma) -> Result<(), EncodeError> {
        self.check_size(
            luma.width,
            luma.height,
            luma.data.len() == luma.width * luma.height,
        )?;
        self.fill(0, luma.width, &luma.data)
    }

    fn put_yuv(&mut self, yuv: &Yuv420) -> Result<(), EncodeError> {
        if self.coding == Coding::Lossless {
            return Err(self.refused("a colour frame", "grey (this lossless coding has no colour)"));
        }
        let chroma = yuv.chroma_width() * yuv.chroma_height();
        let whole = yuv.y.len() == yuv.width * yuv.height && yuv.u.len() == chroma && yuv.v.len() == chroma;
        self.check_size(yuv.width, yuv.height, whole)?;
        self.fill(0, yuv.width, &yuv.y)?;
        self.fill(1, yuv.chroma_width(), &yuv.u)?;
        self.fill(2, yuv.chroma_width(), &yuv.v)
    }

    fn check_size(&self, width: usize, height: usize, whole: bool) -> Result<(), EncodeError> {
        if (width, height) == (self.width, self.height) && whole {
            return Ok(());
        }
        let found = format!(
            "{width}x{height} px{}",
            if whole {
                ""
            } else {
                " with planes of another length"
            }
        );
        Err(self.refused(
            &found,
            &format!("{}x{} px, like the video", self.width, self.height),
        ))
    }

    fn refused(&self, found: &str, accepted: &str) -> EncodeError {
        EncodeError::Frame {
            path: self.path.clone(),
            frame: self.frames,
            found: found.to_owned(),
            accepted: accepted.to_owned(),
        }
    }

    fn fill(&mut self, plane: usize, width: usize, data: &[u8]) -> Result<(), EncodeError> {
        self.picture
            .fill(plane, width, data)
            .map_err(|e| explained(&self.path, self.frames, Failure::Av(e)))
    }

    fn tick_of(&self, time_s: f64) -> Result<i64, EncodeError> {
        if self.timing == Timing::Constant {
            return Err(self.refused("a time of its own", "none: this video has a constant rate"));
        }
        if !(0.0..1e9).contains(&time_s) {
            return Err(self.refused(&format!("time {time_s} s"), "0 or more, and less than 1e9 s"));
        }
        #[allow(clippy::cast_possible_truncation, reason = "below 1e15 by the check above")]
        let tick = (time_s * TICKS_A_SECOND).round() as i64;
        match self.last_tick {
            Some(last) if tick <= last => {
                Err(self.refused(&format!("time {time_s} s"), "later than the frame before"))
            }
            _ => Ok(tick),
        }
    }

    fn send_next(&mut self) -> Result<(), EncodeError> {
        #[allow(clippy::cast_precision_loss, reason = "frames are far fewer than 2^52")]
        let tick = match self.timing {
            Timing::Constant => i64::try_from(self.frames).unwrap_or(i64::MAX),
            Timing::Stamped => self.tick_of(self.frames as f64 / self.rate)?,
        };
        self.send(tick)
    }

    fn send(&mut self, tick: i64) -> Result<(), EncodeError> {
        self.picture.set_stamp(tick);
        self.encoder
            .send(&self.picture)
            .map_err(|e| explained(&self.path, self.frames, e))?;
        self.last_tick = Some(tick);
        self.frames += 1;
        Ok(())
    }
}

impl std::fmt::Debug for VideoWriter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("VideoWriter")
            .field("path", &self.path)
            .field("frames", &self.frames)
            .finish_non_exhaustive()
    }
}

const TICKS_A_SECOND: f64 = 1e6;

fn check_settings(
    path: &Path,
    width: usize,
    height: usize,
    options: &VideoOptions,
) -> Result<(), EncodeError> {
    let even = options.coding != Coding::Lossless;
    let sides = [width, height];
    if sides
        .iter()
        .any(|&s| s == 0 || s > MAX_SIDE_PX || (even && s % 2 == 1))
    {
        return Err(EncodeError::Size {
            path: path.to_owned(),
            width,
            height,
            even,
        });
    }
    let setting = |key, found: String, accepted| {
        Err(EncodeError::Setting {
            path: path.to_owned(),
            key,
            found,
            accepted,
        })
    };
    let rate = options.frame_rate_hz;
    if !(rate.is_finite() && (1e-3..=1e6).contains(&rate)) {
        return setting("frame_rate_hz", rate.to_string(), "0.001 to 1e6 Hz");
    }
    if options.coding.is_lossless() && options.timing == Timing::Constant && rate > MKV_MOST_HZ {
        return setting(
            "frame_rate_hz",
            rate.to_string(),
            "up to 1000 Hz without loss, for a .mkv keeps times to 1 ms only and would lose them; write H.264 (.mp4)",
        );
    }
    if !options.rotation_deg.is_finite() {
        return setting(
            "rotation_deg",
            options.rotation_deg.to_string(),
            "a finite number of degrees",
        );
    }
    match options.coding {
        Coding::H264 { crf, .. } if crf > 51 => setting("crf", crf.to_string(), "0 to 51"),
        Coding::H264 { gop, .. } if !(1..=1_000_000).contains(&gop) => {
            setting("gop", gop.to_string(), "1 to 1000000")
        }
        Coding::H264 { b_frames, .. } if b_frames > 16 => {
            setting("b_frames", b_frames.to_string(), "0 to 16")
        }
        _ => Ok(()),
    }
}

fn settings<'a>(
    width: usize,
    height: usize,
    options: &VideoOptions,
    temporary: &NamedTempFile,
) -> EncoderSettings<'a> {
    // 1001 is in the terms of the television rates (30000/1001 Hz).
    let rate = Rational::near(options.frame_rate_hz, 1_001_000);
    let time_base = match options.timing {
        Timing::Constant => rate.inverse(),
        Timing::Stamped => Rational {
            num: 1,
            den: 1_000_000,
        },
    };
    let small = |n: u32| i32::try_from(n).unwrap_or(i32::MAX);
    let shared_pictures = options.effort.shares_pictures().then_some("sliced-threads=1");
    let (codec, container, format, gop, b_frames, codec_options) = match options.coding {
        Coding::H264 { crf, gop, b_frames } => (
            "libx264",
            "mp4",
            PixelFormat::Yuv420,
            small(gop),
            small(b_frames),
            [
                ("preset", options.effort.preset()),
                ("crf", &(f64::from(crf) + options.effort.more_crf()).to_string()),
                // x264's output depends on the number of threads, so that is not left to the machine.
                ("threads", "2"),
                ("b_strategy", "0"),
                ("sc_threshold", "0"),
                ("rc-lookahead", "0"),
            ]
            .into_iter()
            .chain(shared_pictures.map(|share| ("x264-params", share)))
            .map(|(k, v)| (k, v.to_owned()))
            .collect(),
        ),
        Coding::Lossless | Coding::LosslessColour => (
            "ffvhuff",
            "matroska",
            if options.coding == Coding::Lossless {
                PixelFormat::Gray8
            } else {
                PixelFormat::Yuv420
            },
            1,
            0,
            // Each frame has its own table of codes. With noise of 2 grey levels files are 5 % larger than FFV1's, made in a tenth and read in a
            // sixth of its time; without noise many times as large. No checksums tell damage.
            [("pred", "left"), ("context", "1"), ("threads", "1")]
                .map(|(k, v)| (k, v.to_owned()))
                .to_vec(),
        ),
    };
    let mut container_options = Vec::new();
    if options.index_first && container == "mp4" {
        container_options.push(("movflags", "+faststart".to_owned()));
    }
    EncoderSettings {
        codec,
        container,
        width,
        height,
        format,
        chroma_siting: options.chroma_siting,
        time_base,
        rate,
        constant_rate: options.timing == Timing::Constant,
        gop,
        b_frames,
        options: codec_options,
        container_options,
        display_matrix: display_matrix(options.rotation_deg),
        url: format!("file:{}", temporary.path().display()),
    }
}

/// The matrix of a clockwise turn, as containers store it: 16.16 numbers, (p, q, 1) times it is the shown place.
fn display_matrix(clockwise_deg: f64) -> Option<[i32; 9]> {
    #[allow(clippy::cast_possible_truncation, reason = "sines times 65536")]
    let fixed = |x: f64| (x * 65536.0).round() as i32;
    let (sin, cos) = clockwise_deg.to_radians().sin_cos();
    let matrix = [
        fixed(cos),
        fixed(sin),
        0,
        -fixed(sin),
        fixed(cos),
        0,
        0,
        0,
        1 << 30,
    ];
    (clockwise_deg.rem_euclid(360.0) != 0.0).then_some(matrix)
}

fn explained(path: &Path, frame: usize, failure: Failure) -> EncodeError {
    let path = path.to_owned();
    match failure {
        Failure::Io(source) => EncodeError::Io { path, source },
        Failure::Missing(what) => EncodeError::Missing { path, what },
        Failure::Av(error) => EncodeError::Codec {
            path,
            frame,
            message: error.to_string(),
        },
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    /// /dev/full takes every seek and refuses every byte, like a full disk.
    #[test]
    fn a_full_disk_is_an_error_of_the_system() {
        let options = VideoOptions::new(
            30.0,
            Coding::H264 {
                crf: 0,
                gop: 1,
                b_frames: 0,
            },
        );
        let temporary = NamedTempFile::new().unwrap();
        let settings = settings(64, 48, &options, &temporary);
        let full = std::fs::OpenOptions::new()
            .read(true)
            .write(true)
            .open("/dev/full")
            .unwrap();
        let outcome = Encoder::open(full, &settings).and_then(|mut encoder| {
            let mut picture = Picture::blank(64, 48, PixelFormat::Yuv420)?;
            picture.set_stamp(0);
            encoder.send(&picture)?;
            encoder.finish()
        });
        let error = explained(Path::new("out.mp4"), 0, outcome.unwrap_err()).to_string();
        assert!(
            error.contains("out.mp4") && error.contains("No space left"),
            "{error}"
        );
    }

    /// A texture that moves, written as H.264: the file's bytes.
    fn coded() -> Result<Vec<u8>, Box<dyn std::error::Error>> {
        let (width, height) = (360, 240);
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("a.mp4");
        let coding = Coding::H264 {
            crf: 14,
            gop: 12,
            b_frames: 2,
        };
        let mut writer = VideoWriter::create(&path, width, height, 30.0, coding)?;
        for frame in 0..16 {
            let grey = |i: usize| {
                let (u, v) = (i % width + 2 * frame, i / width + frame);
                let speckle = ((u * 7919) ^ (v * 104_729)).wrapping_mul(2_654_435_761) >> 13;
                100.0 + 40.0 * (0.07 * u as f64).sin() + (speckle % 16) as f64
            };
            let data = (0..width * height).map(|i| grey(i) as u8).collect();
            writer.write(&Luma { width, height, data })?;
        }
        writer.finish()?;
        Ok(std::fs::read(path)?)
    }

    #[test]
    fn what_memory_held_before_does_not_change_a_file() {
        let first = coded().unwrap();
        for byte in [0x55, 0xa5, 0xff] {
            // (What is freed as a whole goes back to the system, and comes again as zeros; after a first such block less does.)
            drop(vec![byte; 24 << 20]);
            let blocks: Vec<Vec<u8>> = (0..200).map(|_| vec![byte; 200_000]).collect();
            drop(blocks);
            assert!(coded().unwrap() == first);
        }
    }

    #[test]
    fn display_matrices_are_those_of_phones() {
        assert_eq!(display_matrix(0.0), None);
        assert_eq!(
            display_matrix(90.0),
            Some([0, 65536, 0, -65536, 0, 0, 0, 0, 1 << 30])
        );
    }
}
