//! FFmpeg's C structs behind a safe face: the only place of this crate with `unsafe`.
//!
//! The safe wrappers of `ffmpeg-next` lack what `frames` needs (index entries, display matrices, one's own output
//! sink, planes with negative strides, decode error flags), so this folder talks to the bindings themselves. Every
//! pointer is owned by one struct that frees it on drop, and is checked for null where it is made.
#![allow(
    unsafe_code,
    reason = "FFmpeg is a C library; each block relies only on a pointer owned by the struct it stands in"
)]

mod input;
mod output;

pub(super) use input::{Decoder, DecoderSettings, DecoderThreads, Input, OpenFailure, StreamFacts};
pub(super) use output::{Encoder, EncoderSettings, Failure};

use crate::frames::Coded;
use ffmpeg_next::ffi;
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::fmt;
use std::ptr;
use std::sync::Once;
use std::sync::atomic::{AtomicU64, Ordering};

/// A negative result of an FFmpeg call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AvError(c_int);

impl AvError {
    /// The end of the stream, not an error as such.
    pub(super) fn is_end(self) -> bool {
        self.0 == ffi::AVERROR_EOF
    }

    /// More input (or output) is needed first.
    pub(super) fn is_again(self) -> bool {
        self.0 == ffi::AVERROR(ffi::EAGAIN)
    }

    /// An allocation that failed.
    fn out_of_memory() -> Self {
        Self(ffi::AVERROR(ffi::ENOMEM))
    }

    /// An argument that cannot be.
    pub(super) fn invalid() -> Self {
        Self(ffi::AVERROR(ffi::EINVAL))
    }
}

impl fmt::Display for AvError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut words = [0; 128];
        // SAFETY: the buffer is as long as it says; av_strerror ends it with a NUL.
        let text = unsafe {
            ffi::av_strerror(self.0, words.as_mut_ptr(), words.len());
            CStr::from_ptr(words.as_ptr())
        };
        write!(f, "{}", text.to_string_lossy())
    }
}

impl std::error::Error for AvError {}

/// The result of an FFmpeg call as a `Result`.
fn check(code: c_int) -> Result<c_int, AvError> {
    if code < 0 { Err(AvError(code)) } else { Ok(code) }
}

/// Keeps FFmpeg from writing to stderr: people hear of trouble through our errors and [`super::StreamHealth`] only.
///
/// The log is also where FFmpeg tells reliably that it concealed errors in a picture: the flags of the frame itself
/// are copied from another thread when decoding frames in parallel, sometimes before they are set. So the log is
/// listened to, see [`listen`].
pub(super) fn silence() {
    type Listener = unsafe extern "C" fn(*mut c_void, c_int, *const c_char, *mut c_void);
    static ONCE: Once = Once::new();
    #[allow(
        clippy::missing_transmute_annotations,
        reason = "the type of a va_list differs between machines"
    )]
    // SAFETY: a va_list arrives as one pointer on x86-64 and aarch64, and is not touched, so the listener may be
    // declared without naming its type.
    ONCE.call_once(|| unsafe {
        ffi::av_log_set_callback(std::mem::transmute::<Option<Listener>, _>(Some(listen)));
    });
}

/// Blocks of memory from this size on are pictures, ours or the decoder's, bytes.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const PICTURE_BYTES: c_int = 3 << 19;

/// From here on memory of pictures goes back to the system when they are let go. As it is by default, the C library keeps it for blocks to come
/// once pictures of that size were freed, in pieces which threads leave between each other: a fifth more at 3840 × 2160.
pub(super) fn give_back_pictures() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: it takes numbers, and changes only how later blocks are found.
    unsafe {
        libc::mallopt(libc::M_MMAP_THRESHOLD, PICTURE_BYTES);
    }
}

/// Counts pictures in which a decoder of ours concealed errors; FFmpeg writes one such line a picture.
///
/// # Safety
/// As FFmpeg calls it: `from` is null or a struct that begins with its class, `format` a C string or null.
unsafe extern "C" fn listen(from: *mut c_void, _: c_int, format: *const c_char, _: *mut c_void) {
    if from.is_null() || format.is_null() {
        return;
    }
    // SAFETY: by the caller's promise; a codec context holds in `opaque` null or the counter that a Decoder owns until
    // the context, and with it all its threads, are gone.
    unsafe {
        if *from.cast::<*const ffi::AVClass>() != ffi::avcodec_get_class()
            || !CStr::from_ptr(format).to_bytes().starts_with(b"concealing ")
        {
            return;
        }
        if let Some(counter) = (*from.cast::<ffi::AVCodecContext>())
            .opaque
            .cast::<AtomicU64>()
            .as_ref()
        {
            counter.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// A fraction as FFmpeg has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Rational {
    pub num: i32,
    pub den: i32,
}

impl Rational {
    /// The fraction nearest to `value` with terms up to `max`.
    pub(super) fn near(value: f64, max: i32) -> Self {
        // SAFETY: a pure function of numbers.
        let q = unsafe { ffi::av_d2q(value, max) };
        Self::of(q)
    }

    fn of(q: ffi::AVRational) -> Self {
        Self {
            num: q.num,
            den: q.den,
        }
    }

    fn raw(self) -> ffi::AVRational {
        ffi::AVRational {
            num: self.num,
            den: self.den,
        }
    }

    /// One over it.
    pub(super) fn inverse(self) -> Self {
        Self {
            num: self.den,
            den: self.num,
        }
    }

    /// As a number, `None` when unset (0/0, 0/1) or negative.
    pub(super) fn positive(self) -> Option<f64> {
        (self.num > 0 && self.den > 0).then(|| f64::from(self.num) / f64::from(self.den))
    }
}

/// Options by name for an FFmpeg call that takes an `AVDictionary`.
struct DictionaryOptions(*mut ffi::AVDictionary);

impl DictionaryOptions {
    fn new(pairs: &[(&str, String)]) -> Result<Self, AvError> {
        let mut options = Self(ptr::null_mut());
        for (key, value) in pairs {
            let key = CString::new(*key).map_err(|_| AvError::invalid())?;
            let value = CString::new(value.as_str()).map_err(|_| AvError::invalid())?;
            // SAFETY: both strings live through the call, which copies them.
            check(unsafe { ffi::av_dict_set(&raw mut options.0, key.as_ptr(), value.as_ptr(), 0) })?;
        }
        Ok(options)
    }
}

impl Drop for DictionaryOptions {
    fn drop(&mut self) {
        // SAFETY: owned; FFmpeg replaces the pointer by what it did not use.
        unsafe { ffi::av_dict_free(&raw mut self.0) };
    }
}

/// A piece of the coded stream.
pub(super) struct Packet(*mut ffi::AVPacket);

// SAFETY: a packet is plain data with one owner.
unsafe impl Send for Packet {}

impl Packet {
    pub(super) fn new() -> Result<Self, AvError> {
        // SAFETY: allocates; null is checked.
        let packet = unsafe { ffi::av_packet_alloc() };
        if packet.is_null() {
            Err(AvError::out_of_memory())
        } else {
            Ok(Self(packet))
        }
    }

    /// A whole image file as one packet.
    pub(super) fn holding(bytes: &[u8]) -> Result<Self, AvError> {
        let packet = Self::new()?;
        let size = c_int::try_from(bytes.len()).map_err(|_| AvError::invalid())?;
        // SAFETY: av_new_packet gives `size` bytes and the zeroed padding that decoders ask for.
        unsafe {
            check(ffi::av_new_packet(packet.0, size))?;
            ptr::copy_nonoverlapping(bytes.as_ptr(), (*packet.0).data, bytes.len());
        }
        Ok(packet)
    }

    /// Whether the container marks it as a key frame.
    pub(super) fn is_key(&self) -> bool {
        // SAFETY: owned and not null.
        unsafe { (*self.0).flags & ffi::AV_PKT_FLAG_KEY != 0 }
    }

    /// Whether it is decoded or shown at this stamp.
    pub(super) fn is_at(&self, stamp: i64) -> bool {
        // SAFETY: owned and not null.
        unsafe { (*self.0).dts == stamp || (*self.0).pts == stamp }
    }

    /// By how much it is shown later than decoded; `None` where it does not say.
    pub(super) fn delay(&self) -> Option<i64> {
        // SAFETY: owned and not null.
        let (shown, decoded) = unsafe { ((*self.0).pts, (*self.0).dts) };
        let known = shown != ffi::AV_NOPTS_VALUE && decoded != ffi::AV_NOPTS_VALUE;
        known.then(|| shown.saturating_sub(decoded))
    }

    /// Whether the demuxer says that it is damaged (a packet cut short, a lost transport packet).
    pub(super) fn is_corrupt(&self) -> bool {
        // SAFETY: owned and not null.
        unsafe { (*self.0).flags & ffi::AV_PKT_FLAG_CORRUPT != 0 }
    }

    /// Whether its frame is decoded only for others: the edit list leaves it out.
    pub(super) fn is_discarded(&self) -> bool {
        // SAFETY: owned and not null.
        unsafe { (*self.0).flags & ffi::AV_PKT_FLAG_DISCARD != 0 }
    }

    fn clear(&mut self) {
        // SAFETY: owned and not null.
        unsafe { ffi::av_packet_unref(self.0) };
    }
}

impl Drop for Packet {
    fn drop(&mut self) {
        // SAFETY: owned.
        unsafe { ffi::av_packet_free(&raw mut self.0) };
    }
}

/// The pixel formats that this crate makes itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PixelFormat {
    /// One byte a pixel.
    Gray8,
    /// Luma, and chroma at half the columns and rows.
    Yuv420,
}

impl PixelFormat {
    fn raw(self) -> ffi::AVPixelFormat {
        match self {
            Self::Gray8 => ffi::AVPixelFormat::AV_PIX_FMT_GRAY8,
            Self::Yuv420 => ffi::AVPixelFormat::AV_PIX_FMT_YUV420P,
        }
    }
}

/// How the first component (luma, or red) of a picture lies in memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ComponentLayout {
    /// The plane that holds it.
    pub plane: usize,
    /// Bytes from one pixel to the next.
    pub step: usize,
    /// Bytes before the first pixel's value.
    pub offset: usize,
    /// Bits below the value.
    pub shift: u32,
    /// Bits of the value.
    pub depth: u32,
    /// Most significant byte first.
    pub big_endian: bool,
}

/// How the three components of a colour picture lie in memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ColourLayout {
    /// Luma, blue-yellow, red-cyan; or red, green, blue.
    pub components: [ComponentLayout; 3],
    /// Whether they are red, green and blue.
    pub is_rgb: bool,
    /// Binary logarithms of the columns and rows of pixels that share a sample of chroma.
    pub chroma_shift: (u32, u32),
}

/// What kind of picture a pixel format holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PictureKind {
    /// The first component is luma, as integers of 8 to 16 bits.
    Luma(ComponentLayout),
    /// Anything else: RGB, palette, bits, floats, Bayer.
    Other,
}

/// A decoded picture, or one to be coded.
pub(super) struct Picture(*mut ffi::AVFrame);

// SAFETY: a frame is plain data with one owner; its buffers are reference-counted atomically.
unsafe impl Send for Picture {}
// SAFETY: through a shared reference a frame is only read; whatever changes it takes `&mut self`.
unsafe impl Sync for Picture {}

impl Picture {
    pub(super) fn new() -> Result<Self, AvError> {
        // SAFETY: allocates; null is checked.
        let frame = unsafe { ffi::av_frame_alloc() };
        if frame.is_null() {
            Err(AvError::out_of_memory())
        } else {
            Ok(Self(frame))
        }
    }

    /// A picture with planes of its own, full range.
    pub(super) fn blank(width: usize, height: usize, format: PixelFormat) -> Result<Self, AvError> {
        let picture = Self::new()?;
        // SAFETY: owned and not null; the fields that av_frame_get_buffer asks for are set before it is called.
        unsafe {
            (*picture.0).width = c_int::try_from(width).map_err(|_| AvError::invalid())?;
            (*picture.0).height = c_int::try_from(height).map_err(|_| AvError::invalid())?;
            (*picture.0).format = format.raw() as c_int;
            (*picture.0).color_range = ffi::AVColorRange::AVCOL_RANGE_JPEG;
            check(ffi::av_frame_get_buffer(picture.0, 0))?;
        }
        Ok(picture)
    }

    pub(super) fn width(&self) -> usize {
        // SAFETY: owned and not null.
        usize::try_from(unsafe { (*self.0).width }).unwrap_or(0)
    }

    pub(super) fn height(&self) -> usize {
        // SAFETY: owned and not null.
        usize::try_from(unsafe { (*self.0).height }).unwrap_or(0)
    }

    /// FFmpeg's number of the pixel format, to see whether it changes.
    pub(super) fn format_number(&self) -> i32 {
        // SAFETY: owned and not null.
        unsafe { (*self.0).format }
    }

    /// The stamp in the stream's time base, by FFmpeg's best effort.
    pub(super) fn stamp(&self) -> Option<i64> {
        // SAFETY: owned and not null.
        let stamp = unsafe { (*self.0).best_effort_timestamp };
        (stamp != ffi::AV_NOPTS_VALUE).then_some(stamp)
    }

    pub(super) fn is_interlaced(&self) -> bool {
        // SAFETY: owned and not null.
        unsafe { (*self.0).interlaced_frame != 0 }
    }

    /// How the picture was coded.
    pub(super) fn coded(&self) -> Coded {
        // SAFETY: owned and not null.
        match unsafe { (*self.0).pict_type } {
            ffi::AVPictureType::AV_PICTURE_TYPE_P | ffi::AVPictureType::AV_PICTURE_TYPE_S => Coded::Predicted,
            ffi::AVPictureType::AV_PICTURE_TYPE_B | ffi::AVPictureType::AV_PICTURE_TYPE_BI => {
                Coded::Interpolated
            }
            _ => Coded::Whole,
        }
    }

    /// Whether the decoder says that something of the picture was lost; not all of them do, and with threads not
    /// always ([`Decoder::concealed`] counts reliably).
    pub(super) fn is_damaged(&self) -> bool {
        // SAFETY: owned and not null.
        unsafe { (*self.0).flags & ffi::AV_FRAME_FLAG_CORRUPT != 0 || (*self.0).decode_error_flags != 0 }
    }

    /// Width of a pixel over its height, by the coded stream.
    pub(super) fn pixel_aspect(&self) -> Option<f64> {
        // SAFETY: owned and not null.
        Rational::of(unsafe { (*self.0).sample_aspect_ratio }).positive()
    }

    /// The display matrix that came with the picture itself (an SEI message, an EXIF tag).
    pub(super) fn display_matrix(&self) -> Option<[i32; 9]> {
        // SAFETY: owned and not null; the side data is read only as far as its size says.
        unsafe {
            let side =
                ffi::av_frame_get_side_data(self.0, ffi::AVFrameSideDataType::AV_FRAME_DATA_DISPLAYMATRIX);
            if side.is_null() {
                return None;
            }
            matrix_from((*side).data, (*side).size)
        }
    }

    fn descriptor(&self) -> Option<&'static ffi::AVPixFmtDescriptor> {
        // SAFETY: av_pix_fmt_desc_get is called through an integer argument that FFmpeg itself wrote; it gives a
        // static table entry, or null for a number out of range.
        unsafe {
            let number = (*self.0).format;
            if number < 0 || number >= ffi::AVPixelFormat::AV_PIX_FMT_NB as c_int {
                return None;
            }
            ffi::av_pix_fmt_desc_get(std::mem::transmute::<c_int, ffi::AVPixelFormat>(number)).as_ref()
        }
    }

    /// Name of the pixel format.
    pub(super) fn format_name(&self) -> String {
        self.descriptor().map_or_else(
            || "unknown".to_owned(),
            // SAFETY: names in FFmpeg's table are static C strings.
            |d| unsafe { CStr::from_ptr(d.name) }.to_string_lossy().into_owned(),
        )
    }

    /// Where the luma is, if it can be read as it lies.
    pub(super) fn kind(&self) -> PictureKind {
        let Some(d) = self.descriptor() else {
            return PictureKind::Other;
        };
        let refused = [
            ffi::AV_PIX_FMT_FLAG_PAL,
            ffi::AV_PIX_FMT_FLAG_BITSTREAM,
            ffi::AV_PIX_FMT_FLAG_HWACCEL,
            ffi::AV_PIX_FMT_FLAG_RGB,
            ffi::AV_PIX_FMT_FLAG_BAYER,
            ffi::AV_PIX_FMT_FLAG_FLOAT,
        ];
        let c = d.comp[0];
        let layout = (|| {
            Some(ComponentLayout {
                plane: usize::try_from(c.plane).ok()?,
                step: usize::try_from(c.step).ok()?,
                offset: usize::try_from(c.offset).ok()?,
                shift: u32::try_from(c.shift).ok()?,
                depth: u32::try_from(c.depth).ok()?,
                big_endian: d.flags & flag(ffi::AV_PIX_FMT_FLAG_BE) != 0,
            })
        })();
        match layout {
            Some(layout)
                if refused.iter().all(|&bit| d.flags & flag(bit) == 0)
                    && !self.format_name().starts_with("xyz")
                    && layout.step >= 1
                    && (8..=16).contains(&layout.depth)
                    && (layout.depth > 8 || layout.shift == 0) =>
            {
                PictureKind::Luma(layout)
            }
            _ => PictureKind::Other,
        }
    }

    /// Whether black and white are 0 and 255 (scaled to 8 bits): by the frame's own tag, by its pixel format, and
    /// for untagged frames by custom: YUV limited, grey full.
    pub(super) fn is_full_range(&self) -> bool {
        let grey = self.descriptor().is_some_and(|d| d.nb_components <= 2);
        // SAFETY: owned and not null.
        match unsafe { (*self.0).color_range } {
            ffi::AVColorRange::AVCOL_RANGE_JPEG => true,
            ffi::AVColorRange::AVCOL_RANGE_MPEG => false,
            _ => grey || self.format_name().starts_with("yuvj"),
        }
    }

    /// Where the three components of a colour picture are; `None` for a grey one, and for palettes and the like.
    pub(super) fn colour(&self) -> Option<ColourLayout> {
        let d = self.descriptor()?;
        let refused = [
            ffi::AV_PIX_FMT_FLAG_PAL,
            ffi::AV_PIX_FMT_FLAG_BITSTREAM,
            ffi::AV_PIX_FMT_FLAG_HWACCEL,
            ffi::AV_PIX_FMT_FLAG_BAYER,
            ffi::AV_PIX_FMT_FLAG_FLOAT,
        ];
        if d.nb_components < 3
            || refused.iter().any(|&bit| d.flags & flag(bit) != 0)
            || self.format_name().starts_with("xyz")
        {
            return None;
        }
        let big_endian = d.flags & flag(ffi::AV_PIX_FMT_FLAG_BE) != 0;
        let layout = |i: usize| {
            let c = d.comp[i];
            let layout = ComponentLayout {
                plane: usize::try_from(c.plane).ok()?,
                step: usize::try_from(c.step).ok()?,
                offset: usize::try_from(c.offset).ok()?,
                shift: u32::try_from(c.shift).ok()?,
                depth: u32::try_from(c.depth).ok()?,
                big_endian,
            };
            let plain = layout.step >= 1
                && (8..=16).contains(&layout.depth)
                && (layout.depth > 8 || layout.shift == 0);
            plain.then_some(layout)
        };
        Some(ColourLayout {
            components: [layout(0)?, layout(1)?, layout(2)?],
            is_rgb: d.flags & flag(ffi::AV_PIX_FMT_FLAG_RGB) != 0,
            chroma_shift: (u32::from(d.log2_chroma_w), u32::from(d.log2_chroma_h)),
        })
    }

    /// Where the first sample of chroma lies among the pixels that share it, as parts of the way from the first to the last of
    /// them, along columns and rows; `None` where the stream does not say.
    pub(super) fn chroma_place(&self) -> Option<(f64, f64)> {
        // SAFETY: owned and not null.
        match unsafe { (*self.0).chroma_location } {
            ffi::AVChromaLocation::AVCHROMA_LOC_LEFT => Some((0.0, 0.5)),
            ffi::AVChromaLocation::AVCHROMA_LOC_CENTER => Some((0.5, 0.5)),
            ffi::AVChromaLocation::AVCHROMA_LOC_TOPLEFT => Some((0.0, 0.0)),
            ffi::AVChromaLocation::AVCHROMA_LOC_TOP => Some((0.5, 0.0)),
            ffi::AVChromaLocation::AVCHROMA_LOC_BOTTOMLEFT => Some((0.0, 1.0)),
            ffi::AVChromaLocation::AVCHROMA_LOC_BOTTOM => Some((0.5, 1.0)),
            _ => None,
        }
    }

    /// The shares of red and blue in luma; those of BT.709 for a large picture that does not say, of BT.601 for a small one.
    pub(super) fn luma_shares(&self) -> (f64, f64) {
        const BT601: (f64, f64) = (0.299, 0.114);
        const BT709: (f64, f64) = (0.2126, 0.0722);
        // SAFETY: owned and not null.
        match unsafe { (*self.0).colorspace } {
            ffi::AVColorSpace::AVCOL_SPC_BT709 => BT709,
            ffi::AVColorSpace::AVCOL_SPC_BT2020_NCL | ffi::AVColorSpace::AVCOL_SPC_BT2020_CL => {
                (0.2627, 0.0593)
            }
            ffi::AVColorSpace::AVCOL_SPC_UNSPECIFIED if self.height() >= 720 => BT709,
            _ => BT601,
        }
    }

    /// The same picture once more: its pixels are shared, not copied.
    pub(super) fn share(&self) -> Result<Self, AvError> {
        // SAFETY: owned and not null; gives a frame of its own, or null, which is checked.
        let frame = unsafe { ffi::av_frame_clone(self.0) };
        if frame.is_null() {
            Err(AvError::out_of_memory())
        } else {
            Ok(Self(frame))
        }
    }

    /// The bytes of one row of one plane, without padding; empty when there is no such row.
    pub(super) fn row(&self, plane: usize, row: usize) -> &[u8] {
        let Some((start, length)) = self.row_place(plane, row) else {
            return &[];
        };
        // SAFETY: row_place gives a row inside the plane.
        unsafe { std::slice::from_raw_parts(start, length) }
    }

    fn row_mut(&mut self, plane: usize, row: usize) -> &mut [u8] {
        let Some((start, length)) = self.row_place(plane, row) else {
            return &mut [];
        };
        // SAFETY: as above, and the buffer is writable: only pictures made by `blank` come here.
        unsafe { std::slice::from_raw_parts_mut(start, length) }
    }

    /// Address and length of a row.
    fn row_place(&self, plane: usize, row: usize) -> Option<(*mut u8, usize)> {
        let d = self.descriptor()?;
        let chroma_rows = |rows: usize| rows.div_ceil(1 << d.log2_chroma_h);
        let rows = if (plane == 1 || plane == 2) && d.nb_components >= 3 {
            chroma_rows(self.height())
        } else {
            self.height()
        };
        if plane >= 4 || row >= rows {
            return None;
        }
        // SAFETY: owned and not null; FFmpeg promises `linesize` bytes (negative: upwards) from row to row, and
        // av_image_get_linesize of them in use. A plane that does not exist is null.
        unsafe {
            let data = (*self.0).data[plane];
            let format = std::mem::transmute::<c_int, ffi::AVPixelFormat>((*self.0).format);
            let length = ffi::av_image_get_linesize(format, (*self.0).width, c_int::try_from(plane).ok()?);
            if data.is_null() || length <= 0 {
                return None;
            }
            let stride = isize::try_from((*self.0).linesize[plane]).ok()?;
            Some((
                data.offset(isize::try_from(row).ok()? * stride),
                usize::try_from(length).ok()?,
            ))
        }
    }

    /// Writes one plane from packed rows of `width` bytes.
    pub(super) fn fill(&mut self, plane: usize, width: usize, data: &[u8]) -> Result<(), AvError> {
        // SAFETY: owned and not null; copies the buffer if the encoder still holds it.
        check(unsafe { ffi::av_frame_make_writable(self.0) })?;
        for (y, from) in data.chunks_exact(width).enumerate() {
            let to = self.row_mut(plane, y);
            if to.len() != width {
                return Err(AvError::invalid());
            }
            to.copy_from_slice(from);
        }
        Ok(())
    }

    /// Sets the stamp to code it with.
    pub(super) fn set_stamp(&mut self, stamp: i64) {
        // SAFETY: owned and not null.
        unsafe { (*self.0).pts = stamp };
    }

    /// Gives back the buffers.
    pub(super) fn clear(&mut self) {
        // SAFETY: owned and not null.
        unsafe { ffi::av_frame_unref(self.0) };
    }
}

impl Drop for Picture {
    fn drop(&mut self) {
        // SAFETY: owned.
        unsafe { ffi::av_frame_free(&raw mut self.0) };
    }
}

/// A flag of a pixel format descriptor, whose constants are `c_int` and whose field is `u64`.
fn flag(bit: c_int) -> u64 {
    u64::from(bit.unsigned_abs())
}

/// A display matrix out of side data.
///
/// # Safety
/// `data` points to `size` readable bytes.
unsafe fn matrix_from(data: *const u8, size: usize) -> Option<[i32; 9]> {
    if data.is_null() || size < 36 {
        return None;
    }
    let mut matrix = [0; 9];
    for (i, cell) in matrix.iter_mut().enumerate() {
        // SAFETY: 36 bytes are readable; the address need not be aligned.
        *cell = unsafe { ptr::read_unaligned(data.cast::<i32>().add(i)) };
    }
    Some(matrix)
}

/// Converts pictures of any format to one of ours, full range, at the same size.
pub(super) struct Converter {
    context: *mut ffi::SwsContext,
    source: (i32, usize, usize),
    to: PixelFormat,
    out: Picture,
}

// SAFETY: a scaling context has one owner and no thread of its own.
unsafe impl Send for Converter {}

impl Converter {
    /// For pictures like `sample`.
    pub(super) fn new(sample: &Picture, to: PixelFormat) -> Result<Self, AvError> {
        let (width, height) = (sample.width(), sample.height());
        let out = Picture::blank(width, height, to)?;
        sample.descriptor().ok_or(AvError::invalid())?;
        // SAFETY: null is checked; drop frees the context when a step fails.
        let converter = unsafe {
            let context = ffi::sws_alloc_context();
            if context.is_null() {
                return Err(AvError::out_of_memory());
            }
            Self {
                context,
                source: (sample.format_number(), width, height),
                to,
                out,
            }
        };
        converter.start(sample)?;
        Ok(converter)
    }

    /// Sets the context up. Ranges go in before it is initialised: by then swscale has chosen how to convert, and a
    /// change of range alone would be passed over by plain copying.
    fn start(&self, sample: &Picture) -> Result<(), AvError> {
        let flags = ffi::SWS_BICUBIC | ffi::SWS_ACCURATE_RND | ffi::SWS_FULL_CHR_H_INP | ffi::SWS_BITEXACT;
        let side = |n: usize| i64::try_from(n).map_err(|_| AvError::invalid());
        let (width, height) = (side(sample.width())?, side(sample.height())?);
        let full = i32::from(sample.is_full_range());
        let options = [
            (c"srcw", width),
            (c"srch", height),
            (c"dstw", width),
            (c"dsth", height),
            (c"src_format", i64::from(sample.format_number())),
            (c"dst_format", i64::from(self.to.raw() as c_int)),
            (c"src_range", i64::from(full)),
            (c"dst_range", 1),
            (c"sws_flags", i64::from(flags)),
        ];
        // SAFETY: the context is owned, not null and a struct with options; names and tables are static. Formats
        // without a notion of range make the last call fail, which changes nothing.
        unsafe {
            for (name, value) in options {
                check(ffi::av_opt_set_int(self.context.cast(), name.as_ptr(), value, 0))?;
            }
            check(ffi::sws_init_context(
                self.context,
                ptr::null_mut(),
                ptr::null_mut(),
            ))?;
            let table = ffi::sws_getCoefficients((*sample.0).colorspace as c_int);
            ffi::sws_setColorspaceDetails(self.context, table, full, table, 1, 0, 1 << 16, 1 << 16);
        }
        Ok(())
    }

    /// Whether it was made for pictures like this one.
    pub(super) fn fits(&self, picture: &Picture, to: PixelFormat) -> bool {
        self.source == (picture.format_number(), picture.width(), picture.height()) && self.to == to
    }

    /// `picture` in our format, valid until the next call.
    pub(super) fn convert(&mut self, picture: &Picture) -> Result<&Picture, AvError> {
        if !self.fits(picture, self.to) {
            return Err(AvError::invalid());
        }
        // SAFETY: source and destination have the size and formats that the context was made for.
        check(unsafe {
            ffi::sws_scale(
                self.context,
                (&raw const (*picture.0).data).cast(),
                (&raw const (*picture.0).linesize).cast(),
                0,
                (*picture.0).height,
                (&raw const (*self.out.0).data).cast(),
                (&raw const (*self.out.0).linesize).cast(),
            )
        })?;
        Ok(&self.out)
    }
}

impl Drop for Converter {
    fn drop(&mut self) {
        // SAFETY: owned.
        unsafe { ffi::sws_freeContext(self.context) };
    }
}
