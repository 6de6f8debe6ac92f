//! Coding and muxing into a file that Rust opened, so that a full disk is Rust's own error.

use super::{AvError, DictionaryOptions, Packet, Picture, PixelFormat, Rational, check, ffi};
use crate::frames::encode::ChromaSiting;
use std::ffi::{CString, c_int, c_void};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::ptr;

/// What to make.
pub(in crate::frames) struct EncoderSettings<'a> {
    /// FFmpeg's name of the encoder.
    pub codec: &'a str,
    /// FFmpeg's name of the container.
    pub container: &'a str,
    pub width: usize,
    pub height: usize,
    pub format: PixelFormat,
    pub chroma_siting: Option<ChromaSiting>,
    /// Unit of the stamps.
    pub time_base: Rational,
    /// Frames a second, for rate control.
    pub rate: Rational,
    /// Whether every frame lasts 1 / rate.
    pub constant_rate: bool,
    pub gop: i32,
    pub b_frames: i32,
    pub options: Vec<(&'a str, String)>,
    pub container_options: Vec<(&'a str, String)>,
    pub display_matrix: Option<[i32; 9]>,
    /// How FFmpeg may open the output again to move its index to the front.
    pub url: String,
}

/// Why coding failed.
#[derive(Debug)]
pub(in crate::frames) enum Failure {
    /// The file could not be written.
    Io(io::Error),
    /// This FFmpeg has no such encoder or container.
    Missing(String),
    /// FFmpeg refused.
    Av(AvError),
}

impl From<AvError> for Failure {
    fn from(error: AvError) -> Self {
        Self::Av(error)
    }
}

/// The open file, and the first error it gave: FFmpeg passes on only a number.
struct OutputSink {
    file: File,
    error: Option<io::Error>,
}

impl OutputSink {
    fn keep<T>(&mut self, result: io::Result<T>) -> Option<T> {
        result.map_err(|e| self.error.get_or_insert(e)).ok()
    }
}

const IO_ERROR: c_int = ffi::AVERROR(ffi::EIO);

unsafe extern "C" fn sink_write(opaque: *mut c_void, data: *mut u8, size: c_int) -> c_int {
    // SAFETY: opaque is the Sink that Encoder owns while the context lives; data holds size bytes.
    let (sink, data) = unsafe {
        (
            &mut *opaque.cast::<OutputSink>(),
            std::slice::from_raw_parts(data, usize::try_from(size).unwrap_or(0)),
        )
    };
    let result = sink.file.write_all(data);
    sink.keep(result).map_or(IO_ERROR, |()| size)
}

unsafe extern "C" fn sink_read(opaque: *mut c_void, data: *mut u8, size: c_int) -> c_int {
    // SAFETY: as in sink_write; FFmpeg's buffer is initialised memory.
    let (sink, data) = unsafe {
        (
            &mut *opaque.cast::<OutputSink>(),
            std::slice::from_raw_parts_mut(data, usize::try_from(size).unwrap_or(0)),
        )
    };
    let result = sink.file.read(data);
    match sink.keep(result) {
        Some(0) => ffi::AVERROR_EOF,
        Some(n) => c_int::try_from(n).unwrap_or(IO_ERROR),
        None => IO_ERROR,
    }
}

unsafe extern "C" fn sink_seek(opaque: *mut c_void, offset: i64, whence: c_int) -> i64 {
    // SAFETY: as in sink_write.
    let sink = unsafe { &mut *opaque.cast::<OutputSink>() };
    let result = match whence & !ffi::AVSEEK_FORCE {
        ffi::AVSEEK_SIZE => sink.file.metadata().map(|m| m.len()),
        0 => u64::try_from(offset)
            .map_err(|_| io::Error::from(io::ErrorKind::InvalidInput))
            .and_then(|at| sink.file.seek(SeekFrom::Start(at))),
        1 => sink.file.seek(SeekFrom::Current(offset)),
        _ => sink.file.seek(SeekFrom::End(offset)),
    };
    sink.keep(result)
        .and_then(|at| i64::try_from(at).ok())
        .unwrap_or(i64::from(IO_ERROR))
}

/// An encoder and the container it writes to.
pub(in crate::frames) struct Encoder {
    codec: *mut ffi::AVCodecContext,
    format: *mut ffi::AVFormatContext,
    io: *mut ffi::AVIOContext,
    /// From `Box::into_raw`: FFmpeg holds the same address.
    sink: *mut OutputSink,
    stream: *mut ffi::AVStream,
    packet: Packet,
    time_base: Rational,
    /// Ticks that a packet lasts when nothing else is known.
    ticks_a_frame: i64,
}

// SAFETY: all pointers have one owner; FFmpeg's own threads are behind the encoder.
unsafe impl Send for Encoder {}

impl Encoder {
    /// Opens the encoder and writes the container's header to `file`.
    pub(in crate::frames) fn open(file: File, settings: &EncoderSettings<'_>) -> Result<Self, Failure> {
        super::silence();
        let rate = f64::from(settings.rate.num) / f64::from(settings.rate.den);
        let tick = f64::from(settings.time_base.num) / f64::from(settings.time_base.den);
        #[allow(
            clippy::cast_possible_truncation,
            reason = "ticks of a frame are few, and positive"
        )]
        let ticks_a_frame = ((1.0 / (rate * tick)).round() as i64).max(1);
        let mut encoder = Self {
            codec: ptr::null_mut(),
            format: ptr::null_mut(),
            io: ptr::null_mut(),
            sink: Box::into_raw(Box::new(OutputSink { file, error: None })),
            stream: ptr::null_mut(),
            packet: Packet::new()?,
            time_base: settings.time_base,
            ticks_a_frame,
        };
        encoder.make_container(settings)?;
        encoder.make_codec(settings)?;
        encoder.make_stream(settings)?;
        let mut options = DictionaryOptions::new(&settings.container_options)?;
        // SAFETY: the container has its stream and its output.
        let code = unsafe { ffi::avformat_write_header(encoder.format, &raw mut options.0) };
        encoder.outcome(code)?;
        Ok(encoder)
    }

    fn make_container(&mut self, settings: &EncoderSettings<'_>) -> Result<(), Failure> {
        const BUFFER: c_int = 1 << 18;
        let container = CString::new(settings.container).map_err(|_| AvError::invalid())?;
        let url = CString::new(settings.url.as_str()).map_err(|_| AvError::invalid())?;
        // SAFETY: every pointer is checked before use and stored where drop frees it.
        unsafe {
            let code = ffi::avformat_alloc_output_context2(
                &raw mut self.format,
                ptr::null(),
                container.as_ptr(),
                url.as_ptr(),
            );
            if code < 0 || self.format.is_null() {
                return Err(Failure::Missing(format!("container {}", settings.container)));
            }
            let buffer = ffi::av_malloc(usize::try_from(BUFFER).unwrap_or(0)).cast::<u8>();
            if buffer.is_null() {
                return Err(AvError::out_of_memory().into());
            }
            self.io = ffi::avio_alloc_context(
                buffer,
                BUFFER,
                1,
                self.sink.cast(),
                Some(sink_read),
                Some(sink_write),
                Some(sink_seek),
            );
            if self.io.is_null() {
                ffi::av_free(buffer.cast());
                return Err(AvError::out_of_memory().into());
            }
            (*self.format).pb = self.io;
            // Bit-exact: no library version, no random identifiers, so that the same frames give the same bytes.
            (*self.format).flags |= ffi::AVFMT_FLAG_CUSTOM_IO | ffi::AVFMT_FLAG_BITEXACT;
        }
        Ok(())
    }

    fn make_codec(&mut self, settings: &EncoderSettings<'_>) -> Result<(), Failure> {
        let name = CString::new(settings.codec).map_err(|_| AvError::invalid())?;
        let mut options = DictionaryOptions::new(&settings.options)?;
        // SAFETY: null is checked; the fields are set before the context is opened.
        unsafe {
            let codec = ffi::avcodec_find_encoder_by_name(name.as_ptr());
            if codec.is_null() {
                return Err(Failure::Missing(format!("encoder {}", settings.codec)));
            }
            self.codec = ffi::avcodec_alloc_context3(codec);
            if self.codec.is_null() {
                return Err(AvError::out_of_memory().into());
            }
            let c = &mut *self.codec;
            c.width = c_int::try_from(settings.width).map_err(|_| AvError::invalid())?;
            c.height = c_int::try_from(settings.height).map_err(|_| AvError::invalid())?;
            c.pix_fmt = settings.format.raw();
            c.color_range = ffi::AVColorRange::AVCOL_RANGE_JPEG;
            match settings.chroma_siting {
                Some(ChromaSiting::Left) => {
                    c.chroma_sample_location = ffi::AVChromaLocation::AVCHROMA_LOC_LEFT;
                }
                Some(ChromaSiting::Centre) => {
                    c.chroma_sample_location = ffi::AVChromaLocation::AVCHROMA_LOC_CENTER;
                }
                None => {}
            }
            c.sample_aspect_ratio = ffi::AVRational { num: 1, den: 1 };
            c.time_base = settings.time_base.raw();
            c.framerate = settings.rate.raw();
            c.gop_size = settings.gop;
            c.max_b_frames = settings.b_frames;
            c.flags |= ffi::AV_CODEC_FLAG_BITEXACT.cast_signed();
            if (*(*self.format).oformat).flags & ffi::AVFMT_GLOBALHEADER != 0 {
                c.flags |= ffi::AV_CODEC_FLAG_GLOBAL_HEADER.cast_signed();
            }
            check(ffi::avcodec_open2(self.codec, codec, &raw mut options.0))?;
        }
        Ok(())
    }

    fn make_stream(&mut self, settings: &EncoderSettings<'_>) -> Result<(), Failure> {
        // SAFETY: null is checked; the stream belongs to the container and is freed with it.
        unsafe {
            self.stream = ffi::avformat_new_stream(self.format, ptr::null());
            let Some(stream) = self.stream.as_mut() else {
                return Err(AvError::out_of_memory().into());
            };
            check(ffi::avcodec_parameters_from_context(stream.codecpar, self.codec))?;
            stream.time_base = settings.time_base.raw();
            if settings.constant_rate {
                stream.avg_frame_rate = settings.rate.raw();
            }
            if let Some(matrix) = settings.display_matrix {
                let kind = ffi::AVPacketSideDataType::AV_PKT_DATA_DISPLAYMATRIX;
                let data = ffi::av_stream_new_side_data(stream, kind, size_of_val(&matrix));
                if data.is_null() {
                    return Err(AvError::out_of_memory().into());
                }
                ptr::copy_nonoverlapping(matrix.as_ptr().cast::<u8>(), data, size_of_val(&matrix));
            }
        }
        Ok(())
    }

    /// Codes one picture.
    pub(in crate::frames) fn send(&mut self, picture: &Picture) -> Result<(), Failure> {
        // SAFETY: both are owned and open.
        let code = unsafe { ffi::avcodec_send_frame(self.codec, picture.0) };
        self.outcome(code)?;
        self.drain()
    }

    /// Codes what is still held back and closes the container.
    pub(in crate::frames) fn finish(&mut self) -> Result<(), Failure> {
        // SAFETY: a null frame means the end; the header was written by `open`.
        let code = unsafe { ffi::avcodec_send_frame(self.codec, ptr::null()) };
        self.outcome(code)?;
        self.drain()?;
        // SAFETY: as above.
        let code = unsafe { ffi::av_write_trailer(self.format) };
        self.outcome(code)?;
        // SAFETY: owned and not null.
        unsafe { ffi::avio_flush(self.io) };
        self.outcome(0)
    }

    fn drain(&mut self) -> Result<(), Failure> {
        loop {
            // SAFETY: all owned; the muxer takes the packet's content and leaves it blank.
            let code = unsafe {
                match check(ffi::avcodec_receive_packet(self.codec, self.packet.0)) {
                    Err(e) if e.is_again() || e.is_end() => return self.outcome(0),
                    Err(e) => return Err(e.into()),
                    Ok(_) => {}
                }
                let packet = &mut *self.packet.0;
                packet.stream_index = (*self.stream).index;
                packet.duration = self.ticks_a_frame;
                ffi::av_packet_rescale_ts(packet, self.time_base.raw(), (*self.stream).time_base);
                ffi::av_interleaved_write_frame(self.format, packet)
            };
            self.outcome(code)?;
        }
    }

    /// An FFmpeg result, with an error of the file before it: FFmpeg may notice that later, or not at all.
    fn outcome(&mut self, code: c_int) -> Result<(), Failure> {
        // SAFETY: the sink lives as long as self, and FFmpeg uses it only inside calls made through self.
        if let Some(error) = unsafe { (*self.sink).error.take() } {
            return Err(Failure::Io(error));
        }
        check(code).map(|_| ()).map_err(Failure::Av)
    }
}

impl Drop for Encoder {
    fn drop(&mut self) {
        // SAFETY: all owned, and freed once, users before what they use. The io buffer may have been replaced by
        // FFmpeg, so it is freed through the context.
        unsafe {
            ffi::avcodec_free_context(&raw mut self.codec);
            ffi::avformat_free_context(self.format);
            if !self.io.is_null() {
                ffi::av_freep((&raw mut (*self.io).buffer).cast());
                ffi::avio_context_free(&raw mut self.io);
            }
            drop(Box::from_raw(self.sink));
        }
    }
}
