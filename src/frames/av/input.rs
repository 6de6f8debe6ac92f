//! Demuxing and decoding of local files.
//!
//! What a file holds is decided by its content, never by its name, and only containers on a list are opened: the
//! playlists and scripts that FFmpeg also takes for videos can name other files and hosts. The protocol is `file`
//! alone, for the file itself and for whatever a demuxer might open besides.

use super::{AvError, DictionaryOptions, Packet, Picture, Rational, check, ffi, matrix_from};
use std::ffi::{CStr, CString, c_int};
use std::path::Path;
use std::ptr;
use std::sync::atomic::{AtomicU64, Ordering};

/// Containers of video, by FFmpeg's names: none of them makes FFmpeg open a second file (external references of mov,
/// `enable_drefs`, are off unless asked for).
const CONTAINERS: [&str; 30] = [
    "mov,mp4,m4a,3gp,3g2,mj2",
    "matroska,webm",
    "avi",
    "gif",
    "apng",
    "mpegts",
    "mpeg",
    "flv",
    "asf",
    "asf_o",
    "ogg",
    "mxf",
    "nut",
    "ivf",
    "yuv4mpegpipe",
    "dv",
    "rm",
    "wtv",
    "cine",
    "h261",
    "h263",
    "h264",
    "hevc",
    "m4v",
    "mpegvideo",
    "mjpeg",
    "obu",
    "av1",
    "vc1",
    "cavsvideo",
];

/// Of these, the bare streams: they have no time stamps at all.
const WITHOUT_STAMPS: [&str; 10] = [
    "h261",
    "h263",
    "h264",
    "hevc",
    "m4v",
    "mpegvideo",
    "mjpeg",
    "obu",
    "vc1",
    "cavsvideo",
];

/// Containers of sound: not opened, but told apart from what is no recording at all.
const SOUND: [&str; 14] = [
    "wav", "w64", "mp3", "aac", "flac", "aiff", "amr", "ac3", "eac3", "ape", "caf", "au", "dts", "wv",
];

/// Below this score (of 100) FFmpeg itself would want to see more before it decides.
const LEAST_SCORE: c_int = 25;

/// Decoders allocate by what the coded stream claims; a picture of more pixels than this is not a lab video.
const MAX_PIXELS: &str = "268435456"; // 16384²

/// Why a file was not opened.
#[derive(Debug)]
pub(in crate::frames) enum OpenFailure {
    /// The content is of no kind that FFmpeg knows.
    Unknown,
    /// A single picture.
    Still(String),
    /// A container without moving pictures.
    Sound(String),
    /// Something else that is not on the list.
    Refused(String),
    /// A container on the list that cannot be read.
    Broken { format: String, error: AvError },
    /// FFmpeg's own trouble.
    Av(AvError),
}

impl From<AvError> for OpenFailure {
    fn from(error: AvError) -> Self {
        Self::Av(error)
    }
}

/// What a container says of its video stream.
#[derive(Debug, Clone)]
pub(in crate::frames) struct StreamFacts {
    /// FFmpeg's name of the container.
    pub container: String,
    /// Name of the codec, for people.
    pub codec: String,
    pub width: i64,
    pub height: i64,
    pub time_base: Rational,
    /// Frame rate written in the container's header.
    pub declared_rate: Option<f64>,
    /// Frame rate by the header or by FFmpeg's look at the first frames.
    pub nominal_rate: Option<f64>,
    /// Frames by the header.
    pub frames: Option<u64>,
    /// How long the video is by the header, s.
    pub duration_s: Option<f64>,
    pub display_matrix: Option<[i32; 9]>,
    pub pixel_aspect: Option<f64>,
    /// Video streams in the file, cover pictures left out.
    pub video_streams: usize,
    /// Whether stamps are the file's own.
    pub has_stamps: bool,
}

/// An entry of a container's index.
#[derive(Debug, Clone, Copy)]
pub(in crate::frames) struct IndexEntry {
    /// Byte after the packet's last one.
    pub end: i64,
    /// Stamp to seek to, in the stream's time base.
    pub stamp: i64,
    pub key: bool,
    /// Decoded for others, but not shown: the edit list leaves it out.
    pub discarded: bool,
}

/// A container opened for reading.
pub(in crate::frames) struct Input {
    format: *mut ffi::AVFormatContext,
    stream: *mut ffi::AVStream,
    facts: StreamFacts,
}

// SAFETY: a demuxer has one owner and no thread of its own.
unsafe impl Send for Input {}

/// The container while its stream is not chosen yet; frees it when something fails.
struct OpenedContainer(*mut ffi::AVFormatContext);

impl Drop for OpenedContainer {
    fn drop(&mut self) {
        // SAFETY: owned; null is allowed.
        unsafe { ffi::avformat_close_input(&raw mut self.0) };
    }
}

impl Input {
    /// Opens a local file that has a video stream.
    pub(in crate::frames) fn open(path: &Path) -> Result<Self, OpenFailure> {
        let (mut opened, container) = opened(path)?;
        let header = ContainerHeader::of(&opened);
        find_stream_info(&opened).map_err(|error| OpenFailure::Broken {
            format: container.clone(),
            error,
        })?;
        let Some(stream) = best_video(&opened) else {
            return Err(OpenFailure::Sound(container));
        };
        let facts = facts_of(&opened, stream, container, &header);
        Ok(Self::of(&mut opened, stream, facts))
    }

    /// Opens its file, which is at `path`, once more, for a decoder of its own. What took frames to find out is not found out again, where the
    /// container's header alone tells of the stream.
    pub(in crate::frames) fn again(&self, path: &Path) -> Result<Self, OpenFailure> {
        let (mut opened, _) = opened(path)?;
        // SAFETY: a stream is never null.
        let index = usize::try_from(unsafe { (*self.stream).index }).unwrap_or(usize::MAX);
        let Some(stream) = streams(&opened).nth(index).filter(|&s| is_video(s)) else {
            return Self::open(path);
        };
        // SAFETY: streams and their parameters are never null.
        check(unsafe { ffi::avcodec_parameters_copy((*stream).codecpar, (*self.stream).codecpar) })?;
        Ok(Self::of(&mut opened, stream, self.facts.clone()))
    }

    /// Takes over the container `opened`, of which only `stream` is read.
    fn of(opened: &mut OpenedContainer, stream: *mut ffi::AVStream, facts: StreamFacts) -> Self {
        discard_others(opened, stream);
        Self {
            format: std::mem::replace(&mut opened.0, ptr::null_mut()),
            stream,
            facts,
        }
    }

    pub(in crate::frames) fn facts(&self) -> &StreamFacts {
        &self.facts
    }

    /// The next packet of the video stream; an error with `is_end` at the end.
    pub(in crate::frames) fn read(&mut self, packet: &mut Packet) -> Result<(), AvError> {
        loop {
            packet.clear();
            // SAFETY: all owned.
            unsafe {
                check(ffi::av_read_frame(self.format, packet.0))?;
                if (*packet.0).stream_index == (*self.stream).index {
                    return Ok(());
                }
            }
        }
    }

    /// Goes to the key frame at or before `stamp`.
    pub(in crate::frames) fn seek(&mut self, stamp: i64) -> Result<(), AvError> {
        // SAFETY: all owned.
        check(unsafe {
            ffi::av_seek_frame(
                self.format,
                (*self.stream).index,
                stamp,
                ffi::AVSEEK_FLAG_BACKWARD,
            )
        })
        .map(|_| ())
    }

    /// The container's index as far as it is known.
    pub(in crate::frames) fn index(&self) -> impl Iterator<Item = IndexEntry> + '_ {
        // SAFETY: owned; the entries do not move while no packet is read, which the borrow of self rules out.
        let count = unsafe { ffi::avformat_index_get_entries_count(self.stream) };
        (0..count).filter_map(|i| unsafe {
            let entry = ffi::avformat_index_get_entry(self.stream, i).as_ref()?;
            Some(IndexEntry {
                end: entry.pos.saturating_add(i64::from(entry.size())),
                stamp: entry.timestamp,
                key: entry.flags() & ffi::AVINDEX_KEYFRAME != 0,
                discarded: entry.flags() & ffi::AVINDEX_DISCARD_FRAME != 0,
            })
        })
    }
}

impl Drop for Input {
    fn drop(&mut self) {
        // SAFETY: owned.
        unsafe { ffi::avformat_close_input(&raw mut self.format) };
    }
}

/// The container of a local file, with FFmpeg's name of its kind; its header is read, none of its frames.
fn opened(path: &Path) -> Result<(OpenedContainer, String), OpenFailure> {
    super::silence();
    let url = local_url(path)?;
    let (kind, format) = probed(&url)?;
    let options = [
        ("protocol_whitelist", "file".to_owned()),
        ("format_whitelist", CONTAINERS.join(",")),
    ];
    let mut options = DictionaryOptions::new(&options)?;
    let mut opened = OpenedContainer(ptr::null_mut());
    // SAFETY: url and options live through the call; on failure FFmpeg frees the context and nulls the pointer.
    let code = unsafe { ffi::avformat_open_input(&raw mut opened.0, url.as_ptr(), kind, &raw mut options.0) };
    match check(code) {
        Ok(_) => Ok((opened, format)),
        Err(error) => Err(OpenFailure::Broken { format, error }),
    }
}

/// The path as FFmpeg's URL of a local file, so that a file named `http:` or `concat:` is just that file.
fn local_url(path: &Path) -> Result<CString, AvError> {
    #[cfg(unix)]
    let bytes = std::os::unix::ffi::OsStrExt::as_bytes(path.as_os_str());
    #[cfg(not(unix))]
    let text = path.to_string_lossy();
    #[cfg(not(unix))]
    let bytes = text.as_bytes();
    CString::new([b"file:", bytes].concat()).map_err(|_| AvError::invalid())
}

/// The kind of container by the file's first bytes.
fn probed(url: &CStr) -> Result<(*const ffi::AVInputFormat, String), OpenFailure> {
    const PROBE_BYTES: u32 = 1 << 20;
    let mut options = DictionaryOptions::new(&[("protocol_whitelist", "file".to_owned())])?;
    let mut kind: *const ffi::AVInputFormat = ptr::null();
    // SAFETY: the io context is closed below; the format is a static entry or null. The name given to the probe is
    // empty, so that only content counts.
    let (score, name, long) = unsafe {
        let mut io = ptr::null_mut();
        check(ffi::avio_open2(
            &raw mut io,
            url.as_ptr(),
            ffi::AVIO_FLAG_READ,
            ptr::null(),
            &raw mut options.0,
        ))?;
        let score =
            ffi::av_probe_input_buffer2(io, &raw mut kind, c"".as_ptr(), ptr::null_mut(), 0, PROBE_BYTES);
        ffi::avio_closep(&raw mut io);
        // Not knowing the content is an answer; having no memory to look at it, or not being able to read it, is none.
        if score != ffi::AVERROR_INVALIDDATA {
            check(score)?;
        }
        let Some(kind) = kind.as_ref() else {
            return Err(OpenFailure::Unknown);
        };
        (score, text(kind.name), text(kind.long_name))
    };
    let found = format!("{long} ({name})");
    if CONTAINERS.contains(&name.as_str()) {
        if score < LEAST_SCORE {
            Err(OpenFailure::Unknown)
        } else {
            Ok((kind, name))
        }
    } else if name.ends_with("_pipe") || name == "image2" || name == "ico" {
        Err(OpenFailure::Still(found))
    } else if score < LEAST_SCORE {
        Err(OpenFailure::Unknown)
    } else if SOUND.contains(&name.as_str()) {
        Err(OpenFailure::Sound(found))
    } else {
        Err(OpenFailure::Refused(found))
    }
}

/// A static C string of FFmpeg.
fn text(name: *const std::ffi::c_char) -> String {
    if name.is_null() {
        return String::new();
    }
    // SAFETY: not null, and FFmpeg's names are static C strings.
    unsafe { CStr::from_ptr(name) }.to_string_lossy().into_owned()
}

fn find_stream_info(opened: &OpenedContainer) -> Result<(), AvError> {
    // SAFETY: the array has a dictionary for each stream known now, as FFmpeg asks; what it leaves is freed.
    unsafe {
        let streams = (*opened.0).nb_streams as usize;
        let mut each = (0..streams)
            .map(|_| {
                DictionaryOptions::new(&[("max_pixels", MAX_PIXELS.to_owned()), ("threads", "1".to_owned())])
            })
            .collect::<Result<Vec<_>, _>>()?;
        let mut pointers: Vec<_> = each.iter().map(|o| o.0).collect();
        let code = ffi::avformat_find_stream_info(opened.0, pointers.as_mut_ptr());
        for (options, left) in each.iter_mut().zip(pointers) {
            options.0 = left;
        }
        check(code).map(|_| ())
    }
}

fn streams(opened: &OpenedContainer) -> impl Iterator<Item = *mut ffi::AVStream> {
    // SAFETY: FFmpeg keeps nb_streams pointers there.
    (0..unsafe { (*opened.0).nb_streams } as usize).map(|i| unsafe { *(*opened.0).streams.add(i) })
}

/// A moving picture, not the cover of a record.
fn is_video(stream: *mut ffi::AVStream) -> bool {
    // SAFETY: streams and their parameters are never null.
    unsafe {
        (*(*stream).codecpar).codec_type == ffi::AVMediaType::AVMEDIA_TYPE_VIDEO
            && (*stream).disposition & ffi::AV_DISPOSITION_ATTACHED_PIC == 0
    }
}

/// FFmpeg's choice among the video streams; the first one when its choice is a cover picture.
fn best_video(opened: &OpenedContainer) -> Option<*mut ffi::AVStream> {
    let kind = ffi::AVMediaType::AVMEDIA_TYPE_VIDEO;
    // SAFETY: owned; no decoder is asked for.
    let best = unsafe { ffi::av_find_best_stream(opened.0, kind, -1, -1, ptr::null_mut(), 0) };
    let best = usize::try_from(best).ok()?;
    streams(opened)
        .nth(best)
        .filter(|&s| is_video(s))
        .or_else(|| streams(opened).find(|&s| is_video(s)))
}

fn discard_others(opened: &OpenedContainer, chosen: *mut ffi::AVStream) {
    for stream in streams(opened).filter(|&s| s != chosen) {
        // SAFETY: streams are never null.
        unsafe { (*stream).discard = ffi::AVDiscard::AVDISCARD_ALL };
    }
}

/// What the header says before FFmpeg's look at the first frames fills in guesses.
struct ContainerHeader {
    duration: i64,
    streams: Vec<(Rational, i64, i64)>,
}

impl ContainerHeader {
    fn of(opened: &OpenedContainer) -> Self {
        let streams = streams(opened)
            // SAFETY: streams are never null.
            .map(|s| unsafe { (Rational::of((*s).avg_frame_rate), (*s).duration, (*s).nb_frames) })
            .collect();
        // SAFETY: owned and not null.
        Self {
            duration: unsafe { (*opened.0).duration },
            streams,
        }
    }
}

fn facts_of(
    opened: &OpenedContainer,
    stream: *mut ffi::AVStream,
    container: String,
    header: &ContainerHeader,
) -> StreamFacts {
    // SAFETY: streams and their parameters are never null; side data is read as far as its size says.
    let (s, parameters, display_matrix) = unsafe {
        let mut size = 0;
        let kind = ffi::AVPacketSideDataType::AV_PKT_DATA_DISPLAYMATRIX;
        let data = ffi::av_stream_get_side_data(stream, kind, &raw mut size);
        (&*stream, &*(*stream).codecpar, matrix_from(data, size))
    };
    let time_base = Rational::of(s.time_base);
    let own = usize::try_from(s.index)
        .ok()
        .and_then(|i| header.streams.get(i).copied());
    let (declared_rate, duration, frames) = own.unwrap_or((Rational { num: 0, den: 1 }, 0, 0));
    #[allow(clippy::cast_precision_loss, reason = "durations in ticks are far below 2^52")]
    let seconds = |ticks: i64, tick: f64| (ticks > 0).then_some(ticks as f64 * tick);
    // A container's duration is that of its longest stream: sound may go on after the picture.
    let alone = header.streams.len() == 1;
    let duration_s = time_base
        .positive()
        .and_then(|tick| seconds(duration, tick))
        .or_else(|| alone.then(|| seconds(header.duration, 1e-6)).flatten());
    let rates = [s.avg_frame_rate, s.r_frame_rate];
    StreamFacts {
        // SAFETY: avcodec_get_name never gives null.
        codec: text(unsafe { ffi::avcodec_get_name(parameters.codec_id) }),
        width: i64::from(parameters.width),
        height: i64::from(parameters.height),
        time_base,
        declared_rate: declared_rate.positive(),
        nominal_rate: rates.iter().find_map(|&r| Rational::of(r).positive()),
        frames: u64::try_from(frames).ok().filter(|&n| n > 0),
        duration_s,
        display_matrix,
        // SAFETY: owned; no frame is given.
        pixel_aspect: Rational::of(unsafe {
            ffi::av_guess_sample_aspect_ratio(opened.0, stream, ptr::null_mut())
        })
        .positive(),
        video_streams: streams(opened).filter(|&s| is_video(s)).count(),
        has_stamps: !WITHOUT_STAMPS.contains(&container.as_str()),
        container,
    }
}

/// How many threads decode, and what each does where the codec allows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::frames) enum DecoderThreads {
    /// Each a picture of its own, which takes the memory of as many.
    APictureEach(usize),
    /// All slices of one picture.
    OfOnePicture(usize),
}

/// How to decode.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::frames) struct DecoderSettings {
    /// Threads.
    pub threads: DecoderThreads,
    /// Leaves out frames that no other refers to (quicker, for a survey).
    pub skip_unreferenced: bool,
}

/// A decoder.
pub(in crate::frames) struct Decoder {
    context: *mut ffi::AVCodecContext,
    /// Counted up by the log listener; the context's `opaque` points here.
    concealed: Box<AtomicU64>,
}

// SAFETY: one owner; FFmpeg's own threads are behind the context.
unsafe impl Send for Decoder {}

impl Decoder {
    /// For the video stream of `input`. `Ok(None)`: this FFmpeg has no decoder for it.
    pub(in crate::frames) fn open(input: &Input, settings: DecoderSettings) -> Result<Option<Self>, AvError> {
        // SAFETY: the stream's parameters are never null; the codec is a static entry or null.
        unsafe {
            let parameters = (*input.stream).codecpar;
            let codec = ffi::avcodec_find_decoder((*parameters).codec_id);
            Self::with(codec, settings, |context| {
                check(ffi::avcodec_parameters_to_context(context, parameters))?;
                (*context).pkt_timebase = (*input.stream).time_base;
                Ok(())
            })
        }
    }

    /// For single pictures, by FFmpeg's name of the decoder.
    pub(in crate::frames) fn for_image(name: &CStr) -> Result<Option<Self>, AvError> {
        super::silence();
        // SAFETY: the codec is a static entry or null.
        unsafe {
            let codec = ffi::avcodec_find_decoder_by_name(name.as_ptr());
            Self::with(
                codec,
                DecoderSettings {
                    threads: DecoderThreads::APictureEach(1),
                    skip_unreferenced: false,
                },
                |_| Ok(()),
            )
        }
    }

    /// # Safety
    /// `codec` is null or one of FFmpeg's own.
    unsafe fn with(
        codec: *const ffi::AVCodec,
        settings: DecoderSettings,
        prepare: impl FnOnce(*mut ffi::AVCodecContext) -> Result<(), AvError>,
    ) -> Result<Option<Self>, AvError> {
        if codec.is_null() {
            return Ok(None);
        }
        let (threads, kind) = match settings.threads {
            DecoderThreads::APictureEach(n) => (n, "frame+slice"),
            DecoderThreads::OfOnePicture(n) => (n, "slice"),
        };
        let mut options = vec![
            ("threads", threads.max(1).to_string()),
            ("thread_type", kind.to_owned()),
            ("max_pixels", MAX_PIXELS.to_owned()),
            ("err_detect", "crccheck".to_owned()),
            // Crops exactly where the stream says, not at the next address that suits vector code.
            ("flags", "+unaligned".to_owned()),
        ];
        if settings.skip_unreferenced {
            options.push(("skip_frame", "noref".to_owned()));
        }
        let mut options = DictionaryOptions::new(&options)?;
        // SAFETY: by the caller's promise; null is checked; drop frees the context when a step fails.
        unsafe {
            let context = ffi::avcodec_alloc_context3(codec);
            let decoder = Self {
                context,
                concealed: Box::default(),
            };
            if context.is_null() {
                return Err(AvError::out_of_memory());
            }
            (*context).opaque = ptr::from_ref::<AtomicU64>(&decoder.concealed).cast_mut().cast();
            prepare(context)?;
            check(ffi::avcodec_open2(context, codec, &raw mut options.0))?;
            Ok(Some(decoder))
        }
    }

    /// Pictures so far in which errors were concealed.
    pub(in crate::frames) fn concealed(&self) -> u64 {
        self.concealed.load(Ordering::Relaxed)
    }

    /// Gives the decoder a packet.
    pub(in crate::frames) fn send(&mut self, packet: &Packet) -> Result<(), AvError> {
        // SAFETY: both owned.
        check(unsafe { ffi::avcodec_send_packet(self.context, packet.0) }).map(|_| ())
    }

    /// Tells the decoder that no packet follows.
    pub(in crate::frames) fn send_end(&mut self) -> Result<(), AvError> {
        // SAFETY: owned; null means the end.
        check(unsafe { ffi::avcodec_send_packet(self.context, ptr::null()) }).map(|_| ())
    }

    /// The next picture, in presentation order.
    pub(in crate::frames) fn receive(&mut self, picture: &mut Picture) -> Result<(), AvError> {
        // SAFETY: both owned.
        check(unsafe { ffi::avcodec_receive_frame(self.context, picture.0) }).map(|_| ())
    }

    /// Forgets everything, for packets from elsewhere in the file.
    pub(in crate::frames) fn flush(&mut self) {
        // SAFETY: owned and open.
        unsafe { ffi::avcodec_flush_buffers(self.context) };
    }
}

impl Drop for Decoder {
    fn drop(&mut self) {
        // SAFETY: owned. This ends the context's threads, before the counter goes.
        unsafe { ffi::avcodec_free_context(&raw mut self.context) };
    }
}
