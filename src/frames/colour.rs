//! The colours of a frame: where the decoder left them, read only where somebody asks.
//!
//! Chroma is given at half the columns and rows whatever the file has: of pictures in RGB, or with more chroma, it is averaged. For people and
//! for surveys; what is measured on is a [`mixture`](super::mixture), which knows where each sample lies.

use super::Luma;
use super::av::{AvError, ColourLayout, ComponentLayout, Picture};
use super::orientation::Orientation;
use std::fmt;
use std::ops::Range;
use std::sync::Arc;

/// Chroma at half the columns and rows of a picture (rounded up), code values around 128.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Chroma {
    /// Blue-yellow.
    pub u: Luma,
    /// Red-cyan.
    pub v: Luma,
}

/// A chroma that is so near to 128 shows as grey.
const COLOURLESS: u8 = 2;

impl Chroma {
    /// Whether some of it can be told from grey.
    #[must_use]
    pub fn shows(&self) -> bool {
        let any = |plane: &Luma| plane.data.iter().any(|c| c.abs_diff(128) > COLOURLESS);
        any(&self.u) || any(&self.v)
    }

    /// The colour `[u, v]` of a pixel of the whole picture; that of the nearest one outside.
    #[must_use]
    pub fn at(&self, column: usize, row: usize) -> [u8; 2] {
        let x = (column / 2).min(self.u.width.saturating_sub(1));
        let y = (row / 2).min(self.u.height.saturating_sub(1));
        [&self.u, &self.v].map(|plane| plane.data.get(y * plane.width + x).copied().unwrap_or(128))
    }

    /// The same with 16..240 stretched to 0..255 where the recording is of limited range.
    #[must_use]
    pub fn stretched(&self, range: super::LumaRange) -> Self {
        let chroma = |&c: &u8| {
            let part = 255.0 / if range.white == 255 { 255.0 } else { 224.0 };
            (128.0 + part * (f64::from(c) - 128.0)).round().clamp(0.0, 255.0) as u8
        };
        let plane = |p: &Luma| Luma {
            data: p.data.iter().map(chroma).collect(),
            ..*p
        };
        Self {
            u: plane(&self.u),
            v: plane(&self.v),
        }
    }
}

/// A rectangle of a frame in its colours, for people.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ColourCut {
    /// Its luma, where frames are given with another plane in its place.
    pub luma: Option<Luma>,
    /// Column and row of the first sample of chroma among those of the frame.
    pub first: (usize, usize),
    /// Chroma.
    pub chroma: Chroma,
}

/// The colours of a decoded frame. A clone shares them.
#[derive(Clone)]
pub struct FrameColour(ColourStore);

#[derive(Clone)]
enum ColourStore {
    /// As the decoder has it: the whole picture stays in memory.
    Decoded(Arc<DecodedColour>),
    /// Chroma alone.
    Chroma(Arc<Chroma>),
}

struct DecodedColour {
    picture: Picture,
    layout: ColourLayout,
    orientation: Orientation,
}

impl fmt::Debug for FrameColour {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("FrameColour")
    }
}

impl PartialEq for FrameColour {
    fn eq(&self, other: &Self) -> bool {
        self.chroma() == other.chroma()
    }
}

impl FrameColour {
    /// The colours of `picture`, which `orientation` sets upright; `None` where it has none.
    pub(super) fn of(picture: &Picture, orientation: Orientation) -> Result<Option<Self>, AvError> {
        let Some(layout) = picture.colour() else {
            return Ok(None);
        };
        let decoded = DecodedColour {
            picture: picture.share()?,
            layout,
            orientation,
        };
        Ok(Some(Self(ColourStore::Decoded(Arc::new(decoded)))))
    }

    /// Chroma of the whole frame.
    #[must_use]
    pub fn chroma(&self) -> Arc<Chroma> {
        match &self.0 {
            ColourStore::Chroma(chroma) => Arc::clone(chroma),
            ColourStore::Decoded(decoded) => Arc::new(decoded.chroma()),
        }
    }

    /// The same with the decoder's picture let go: a third of its memory.
    #[must_use]
    pub fn detached(&self) -> Self {
        Self(ColourStore::Chroma(self.chroma()))
    }

    /// The rectangle of these columns and rows in colour; with luma on request, where the decoder's picture is still held.
    #[must_use]
    pub fn cut(&self, columns: Range<usize>, rows: Range<usize>, with_luma: bool) -> ColourCut {
        let halves = |r: &Range<usize>| r.start / 2..r.end.div_ceil(2).max(r.start / 2);
        let (across, down) = (halves(&columns), halves(&rows));
        let first = (across.start, down.start);
        match &self.0 {
            ColourStore::Decoded(decoded) => ColourCut {
                luma: with_luma.then(|| decoded.luma(columns, rows)),
                first,
                chroma: decoded.chroma_of(across, down),
            },
            ColourStore::Chroma(chroma) => {
                let part = |plane: &Luma| {
                    let (xs, ys) = (
                        across.start.min(plane.width)..across.end.min(plane.width),
                        down.start.min(plane.height)..down.end.min(plane.height),
                    );
                    let (width, height) = (xs.len(), ys.len());
                    let data = ys
                        .flat_map(|y| plane.row(y)[xs.clone()].iter().copied())
                        .collect();
                    Luma { width, height, data }
                };
                ColourCut {
                    luma: None,
                    first,
                    chroma: Chroma {
                        u: part(&chroma.u),
                        v: part(&chroma.v),
                    },
                }
            }
        }
    }
}

/// Luma shares of red and blue in what RGB pictures are turned into (BT.601, full range).
const RED_BLUE: (f64, f64) = (0.299, 0.114);

/// The rows of luma, U and V over red, green, blue; U and V without their 128.
pub(super) fn yuv_from_rgb() -> [[f64; 3]; 3] {
    let (red, blue) = RED_BLUE;
    let y = [red, 1.0 - red - blue, blue];
    let u = [-y[0], -y[1], 1.0 - blue].map(|c| 0.5 * c / (1.0 - blue));
    let v = [1.0 - red, -y[1], -y[2]].map(|c| 0.5 * c / (1.0 - red));
    [y, u, v]
}

impl ComponentLayout {
    /// The value at place `x` of a row, in units of 8 bits; 0 beyond the row.
    pub(super) fn value(&self, row: &[u8], x: usize) -> f32 {
        let at = x * self.step + self.offset;
        if self.depth == 8 {
            return row.get(at).map_or(0.0, |&b| f32::from(b));
        }
        let Some(&[a, b]) = row
            .get(at..at + 2)
            .and_then(|pair| <&[u8; 2]>::try_from(pair).ok())
        else {
            return 0.0;
        };
        let word = if self.big_endian {
            u16::from_be_bytes([a, b])
        } else {
            u16::from_le_bytes([a, b])
        };
        let value = (u32::from(word) >> self.shift) & ((1_u32 << self.depth) - 1);
        #[allow(clippy::cast_precision_loss, reason = "16 bits")]
        let value = value as f32;
        value / f32::from(1_u16 << (self.depth - 8))
    }
}

impl DecodedColour {
    /// Columns and rows of the stored picture.
    fn stored(&self) -> (usize, usize) {
        (self.picture.width(), self.picture.height())
    }

    fn chroma(&self) -> Chroma {
        let (w, h) = self.stored();
        let half = (w.div_ceil(2), h.div_ceil(2));
        let is_planar = |c: &ComponentLayout| c.step == 1 && c.depth == 8;
        if self.layout.is_rgb || self.layout.chroma_shift != (1, 1) {
            if !self.layout.is_rgb
                && (w % 2, h % 2) == (0, 0)
                && self.layout.components[1..].iter().all(is_planar)
                && let [Some(u), Some(v)] = [1, 2].map(|i| self.halved(i))
            {
                return Chroma { u, v };
            }
            let (width, height) = self.orientation.shown(half);
            return self.chroma_of(0..width, 0..height);
        }
        // The usual: planes of the right size, copied as they lie.
        let plane = |i: usize| {
            let component = self.layout.components[i];
            let mut data = Vec::new();
            if is_planar(&component) {
                let row = |y| {
                    let row = self.picture.row(component.plane, y);
                    if row.len() < half.0 { &[][..] } else { row }
                };
                if (0..half.1).all(|y| !row(y).is_empty()) {
                    self.orientation.place(half, row, &mut data);
                }
            } else {
                let packed: Vec<u8> = (0..half.1)
                    .flat_map(|y| {
                        let row = self.picture.row(component.plane, y);
                        (0..half.0).map(move |x| (component.value(row, x) + 0.5) as u8)
                    })
                    .collect();
                self.orientation
                    .place(half, |y| &packed[y * half.0..][..half.0], &mut data);
            }
            let (width, height) = self.orientation.shown(half);
            data.resize(width * height, 128);
            Luma { width, height, data }
        };
        Chroma {
            u: plane(1),
            v: plane(2),
        }
    }

    /// A component that lies in a plane of its own, in bytes, as means of 2 by 2 pixels of a picture of even sides; `None` where rows are missing, or
    /// where more than two pixels of a row or a column share a sample.
    fn halved(&self, i: usize) -> Option<Luma> {
        let (w, h) = self.stored();
        let (right, down) = self.layout.shift(i);
        if right.max(down) > 1 {
            return None;
        }
        let half = (w / 2, h / 2);
        let row = |y: usize| {
            let row = self.picture.row(self.layout.components[i].plane, y >> down);
            (row.len() >= w >> right).then_some(row)
        };
        let mut means = Vec::with_capacity(half.0 * half.1);
        for y in 0..half.1 {
            let (above, below) = (row(2 * y)?, row(2 * y + 1)?);
            let mean = |values: [u8; 4]| ((values.map(u16::from).iter().sum::<u16>() + 2) / 4) as u8;
            if right == 0 {
                let pairs = above.as_chunks::<2>().0.iter().zip(below.as_chunks::<2>().0);
                means.extend(pairs.take(half.0).map(|([a, b], [c, d])| mean([*a, *b, *c, *d])));
            } else {
                let pairs = above.iter().zip(below);
                means.extend(pairs.take(half.0).map(|(&a, &b)| mean([a, a, b, b])));
            }
        }
        let mut data = Vec::new();
        self.orientation
            .place(half, |y| &means[y * half.0..][..half.0], &mut data);
        let (width, height) = self.orientation.shown(half);
        Some(Luma { width, height, data })
    }

    /// The luma of a rectangle.
    fn luma(&self, columns: Range<usize>, rows: Range<usize>) -> Luma {
        let stored = self.stored();
        let shown = self.orientation.shown(stored);
        let (columns, rows) = (
            columns.start.min(shown.0)..columns.end.min(shown.0),
            rows.start.min(shown.1)..rows.end.min(shown.1),
        );
        let [weights, ..] = yuv_from_rgb();
        let held = self.rows_of(&columns, &rows);
        Luma::from_fn(columns.len(), rows.len(), |u, v| {
            let shown = (columns.start + u, rows.start + v);
            let (x, y) = self.orientation.stored_place(shown, stored);
            let grey = if self.layout.is_rgb {
                held.sum(weights, x, y)
            } else {
                held.value(0, x, y)
            };
            (grey + 0.5) as u8
        })
    }

    /// The chroma of a rectangle of 2 by 2 pixels a sample.
    fn chroma_of(&self, across: Range<usize>, down: Range<usize>) -> Chroma {
        let stored = self.stored();
        let (width, height) = self.orientation.shown(stored);
        let (across, down) = (
            across.start.min(width.div_ceil(2))..across.end.min(width.div_ceil(2)),
            down.start.min(height.div_ceil(2))..down.end.min(height.div_ceil(2)),
        );
        let pixels = |halves: &Range<usize>, most: usize| 2 * halves.start..(2 * halves.end).min(most);
        let held = self.rows_of(&pixels(&across, width), &pixels(&down, height));
        let [_, of_u, of_v] = yuv_from_rgb();
        // Four pixels that share a sample have its value.
        let shared = !self.layout.is_rgb && self.layout.chroma_shift == (1, 1);
        let plane = |i: usize, weights: [f64; 3]| {
            Luma::from_fn(across.len(), down.len(), |column, row| {
                let (u, v) = (2 * (across.start + column), 2 * (down.start + row));
                let at = |u: usize, v: usize| {
                    let shown = (u.min(width - 1), v.min(height - 1));
                    let (x, y) = self.orientation.stored_place(shown, stored);
                    if self.layout.is_rgb {
                        128.0 + held.sum(weights, x, y)
                    } else {
                        held.value(i, x, y)
                    }
                };
                let mean = if shared {
                    at(u, v)
                } else {
                    0.25 * (at(u, v) + at(u + 1, v) + at(u, v + 1) + at(u + 1, v + 1))
                };
                (mean + 0.5) as u8
            })
        };
        Chroma {
            u: plane(1, of_u),
            v: plane(2, of_v),
        }
    }

    /// The stored rows that hold these columns and rows of the upright picture, found once: that takes longer than to read a value.
    fn rows_of(&self, columns: &Range<usize>, rows: &Range<usize>) -> HeldRows<'_> {
        let of_corner = |u: usize, v: usize| self.orientation.stored_place((u, v), self.stored()).1;
        let corners = if columns.is_empty() || rows.is_empty() {
            0..0
        } else {
            let (a, b) = (
                of_corner(columns.start, rows.start),
                of_corner(columns.end - 1, rows.end - 1),
            );
            a.min(b)..a.max(b) + 1
        };
        let first = corners.start;
        let rows = std::array::from_fn(|i| {
            let (_, down) = self.layout.shift(i);
            let plane = self.layout.components[i].plane;
            let lines = corners.clone();
            let of_line = lines.map(|y| y >> down).collect::<Vec<usize>>();
            let mut found: Vec<&[u8]> = Vec::with_capacity(of_line.len());
            for (k, &y) in of_line.iter().enumerate() {
                let same = k > 0 && of_line[k - 1] == y;
                let row = if same {
                    found[k - 1]
                } else {
                    self.picture.row(plane, y)
                };
                found.push(row);
            }
            found
        });
        HeldRows {
            layout: &self.layout,
            first,
            rows,
        }
    }
}

impl ColourLayout {
    /// Binary logarithms of the columns and rows that share a sample of component `i`.
    fn shift(&self, i: usize) -> (u32, u32) {
        if i == 0 || self.is_rgb {
            (0, 0)
        } else {
            self.chroma_shift
        }
    }
}

/// Rows of a stored picture, by component.
struct HeldRows<'a> {
    layout: &'a ColourLayout,
    first: usize,
    rows: [Vec<&'a [u8]>; 3],
}

impl HeldRows<'_> {
    /// Component `i` of the pixel at column x, row y as stored.
    fn value(&self, i: usize, x: usize, y: usize) -> f64 {
        let row = self.rows[i].get(y - self.first).copied().unwrap_or_default();
        f64::from(self.layout.components[i].value(row, x >> self.layout.shift(i).0))
    }

    fn sum(&self, weights: [f64; 3], x: usize, y: usize) -> f64 {
        (0..3).map(|i| weights[i] * self.value(i, x, y)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::super::av::PixelFormat;
    use super::*;
    use crate::test_noise::TestNoise;

    /// Chroma of the whole picture is taken row by row, and of a part pixel by pixel.
    #[test]
    fn chroma_of_a_whole_picture_is_that_of_its_parts() {
        const SIZE: (usize, usize) = (12, 8);
        let mut random = TestNoise(3);
        let noise: Vec<u8> = (0..SIZE.0 * SIZE.1).map(|_| random.below(255)).collect();
        let mut picture = Picture::blank(SIZE.0, SIZE.1, PixelFormat::Yuv420).unwrap();
        picture.fill(0, SIZE.0, &noise).unwrap();
        let component = ComponentLayout {
            plane: 0,
            step: 1,
            offset: 0,
            shift: 0,
            depth: 8,
            big_endian: false,
        };
        let turned = Orientation::of(&[0, 1 << 16, 0, -(1 << 16), 0, 0, 0, 0, 1 << 30]).unwrap();
        for chroma_shift in [(0, 0), (1, 0), (0, 1), (1, 1), (2, 0)] {
            for orientation in [Orientation::default(), turned] {
                let decoded = DecodedColour {
                    picture: picture.share().unwrap(),
                    layout: ColourLayout {
                        components: [component; 3],
                        is_rgb: false,
                        chroma_shift,
                    },
                    orientation,
                };
                let (width, height) = orientation.shown((SIZE.0 / 2, SIZE.1 / 2));
                let by_pixels = decoded.chroma_of(0..width, 0..height);
                assert_eq!(decoded.chroma(), by_pixels, "{chroma_shift:?}");
            }
        }
    }
}
