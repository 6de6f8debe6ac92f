//! From a decoded picture to planes of our own: upright, 8 bits, without padding.

use super::av::{AvError, ComponentLayout, Converter, Picture, PictureKind, PixelFormat};
use super::colour::FrameColour;
use super::mixture::{self, ColourMix};
use super::orientation::Orientation;
use super::{Luma, LumaRange, Yuv420};

/// Pixels that a recording can be read as.
pub(super) trait Pixels: Sized + Send + 'static {
    /// Out of a decoded picture; `spare` is a used one whose memory may be taken.
    fn read(reader: &mut PixelReader, picture: &Picture, spare: Option<Self>) -> Result<Self, AvError>;
}

/// Reads pictures of one recording: keeps the converter, and the upright turn.
pub(super) struct PixelReader {
    orientation: Orientation,
    converter: Option<Converter>,
    row: Vec<u8>,
    /// What stands in the place of luma.
    mix: Option<ColourMix>,
}

/// A frame's plane, luma or a mixture, with its colours.
pub(super) struct ColouredPlane {
    pub plane: Luma,
    pub colour: Option<FrameColour>,
}

/// Pictures of more pixels are large ([`has_room_for_several`]).
const MOST_HELD_PX: usize = 16 << 20;

/// Whether memory has room for more pictures of this size than it must. Larger ones are decoded one at a time, by threads that share a picture's
/// slices where it has several; and the chroma is copied at once, so that the decoder gets its picture back: holding it takes three times
/// the memory, and spares the copy of what no thing covers.
#[must_use]
pub fn has_room_for_several((width_px, height_px): (usize, usize)) -> bool {
    width_px.saturating_mul(height_px) <= MOST_HELD_PX
}

impl PixelReader {
    /// For pictures that `orientation` sets upright.
    pub(super) fn upright(orientation: Orientation) -> Self {
        Self {
            orientation,
            converter: None,
            row: Vec::new(),
            mix: None,
        }
    }

    /// The same with this in the place of luma.
    pub(super) fn mixing(self, mix: Option<ColourMix>) -> Self {
        Self { mix, ..self }
    }

    /// What stands in the place of luma.
    pub(super) fn mix(&self) -> Option<ColourMix> {
        self.mix
    }

    /// Columns and rows as shown of a picture as stored.
    pub(super) fn shown(&self, stored: (usize, usize)) -> (usize, usize) {
        self.orientation.shown(stored)
    }

    fn converted(&mut self, picture: &Picture, to: PixelFormat) -> Result<&Picture, AvError> {
        let converter = match self.converter.take() {
            Some(converter) if converter.fits(picture, to) => converter,
            _ => Converter::new(picture, to)?,
        };
        self.converter.insert(converter).convert(picture)
    }
}

impl Pixels for Luma {
    fn read(reader: &mut PixelReader, picture: &Picture, spare: Option<Self>) -> Result<Self, AvError> {
        let stored = (picture.width(), picture.height());
        let orientation = reader.orientation;
        let mut data = spare.map(|s| s.data).unwrap_or_default();
        match picture.kind() {
            PictureKind::Luma(layout) if layout.step == 1 && layout.depth == 8 => {
                require_rows(picture, layout, stored)?;
                orientation.place(stored, |y| picture.row(layout.plane, y), &mut data);
            }
            PictureKind::Luma(layout) => {
                require_rows(picture, layout, stored)?;
                let packed = &mut reader.row;
                packed.clear();
                (0..stored.1)
                    .for_each(|y| append_8_bits(picture.row(layout.plane, y), layout, stored.0, packed));
                orientation.place(stored, |y| &packed[y * stored.0..][..stored.0], &mut data);
            }
            PictureKind::Other => {
                let grey = reader.converted(picture, PixelFormat::Gray8)?;
                orientation.place(stored, |y| grey.row(0, y), &mut data);
            }
        }
        let (width, height) = orientation.shown(stored);
        Ok(Self { width, height, data })
    }
}

impl Pixels for ColouredPlane {
    fn read(reader: &mut PixelReader, picture: &Picture, spare: Option<Self>) -> Result<Self, AvError> {
        let orientation = reader.orientation;
        let colour = FrameColour::of(picture, orientation)?;
        // (A cut with luma is asked for where a mixture stands in its place.)
        let lets_go = reader.mix.is_none() && !has_room_for_several((picture.width(), picture.height()));
        let colour = colour.map(|c| if lets_go { c.detached() } else { c });
        let mixed = match &reader.mix {
            Some(mix) => mixture::mixed(picture, mix)?,
            None => None,
        };
        let plane = match mixed {
            Some(stored) => {
                let size = (stored.width, stored.height);
                let (width, height) = orientation.shown(size);
                let mut data = spare.map(|s| s.plane.data).unwrap_or_default();
                orientation.place(size, |y| stored.row(y), &mut data);
                Luma { width, height, data }
            }
            None => Luma::read(reader, picture, spare.map(|s| s.plane))?,
        };
        Ok(Self { plane, colour })
    }
}

/// Whether every row holds what the layout promises.
fn require_rows(
    picture: &Picture,
    layout: ComponentLayout,
    (width, height): (usize, usize),
) -> Result<(), AvError> {
    let bytes = if layout.depth > 8 { 2 } else { 1 };
    let least = (width.max(1) - 1) * layout.step + layout.offset + bytes;
    let short = |y: usize| picture.row(layout.plane, y).len() < least;
    if width == 0 || height == 0 || short(0) || short(height - 1) {
        Err(AvError::invalid())
    } else {
        Ok(())
    }
}

/// A row of 8-bit luma between other components, or of 9 to 16 bits, which are rounded to 8.
fn append_8_bits(row: &[u8], layout: ComponentLayout, width: usize, out: &mut Vec<u8>) {
    let values = row[layout.offset..].chunks(layout.step).take(width);
    if layout.depth == 8 {
        out.extend(values.map(|bytes| bytes[0]));
        return;
    }
    let excess = layout.depth - 8;
    let half = 1 << (excess - 1);
    let mask = (1_u32 << layout.depth) - 1;
    out.extend(values.map(|bytes| {
        let pair = [bytes[0], bytes[1]];
        let word = if layout.big_endian {
            u16::from_be_bytes(pair)
        } else {
            u16::from_le_bytes(pair)
        };
        let value = (u32::from(word) >> layout.shift) & mask;
        u8::try_from((value + half) >> excess).unwrap_or(u8::MAX)
    }));
}

impl Pixels for Yuv420 {
    fn read(reader: &mut PixelReader, picture: &Picture, spare: Option<Self>) -> Result<Self, AvError> {
        let (width, height) = (picture.width(), picture.height());
        let orientation = reader.orientation;
        let mut out = spare.unwrap_or_else(|| Self::black(0, 0));
        let yuv = reader.converted(picture, PixelFormat::Yuv420)?;
        let half = (width.div_ceil(2), height.div_ceil(2));
        orientation.place((width, height), |y| yuv.row(0, y), &mut out.y);
        orientation.place(half, |y| yuv.row(1, y), &mut out.u);
        orientation.place(half, |y| yuv.row(2, y), &mut out.v);
        (out.width, out.height) = orientation.shown((width, height));
        Ok(out)
    }
}

/// What the code values of a picture mean once it is read as [`Luma`].
pub(super) fn luma_range(picture: &Picture) -> LumaRange {
    // What swscale converts comes out in full range; the rest is copied.
    if picture.kind() == PictureKind::Other || picture.is_full_range() {
        LumaRange::FULL
    } else {
        LumaRange {
            black: 16,
            white: 235,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deep_values_are_rounded_to_the_nearest_of_8_bits() {
        let layout = ComponentLayout {
            plane: 0,
            step: 2,
            offset: 0,
            shift: 0,
            depth: 10,
            big_endian: false,
        };
        let row: Vec<u8> = [0_u16, 1, 2, 64, 66, 940, 1023]
            .iter()
            .flat_map(|v| v.to_le_bytes())
            .collect();
        let mut out = Vec::new();
        append_8_bits(&row, layout, 7, &mut out);
        assert_eq!(out, [0, 0, 1, 16, 17, 235, 255]);
        let p010 = ComponentLayout {
            shift: 6,
            big_endian: true,
            ..layout
        };
        let row: Vec<u8> = [0_u16, 512, 1023]
            .iter()
            .flat_map(|v| (v << 6).to_be_bytes())
            .collect();
        out.clear();
        append_8_bits(&row, p010, 3, &mut out);
        assert_eq!(out, [0, 128, 255]);
    }
}
