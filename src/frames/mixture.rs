//! A plane mixed from luma and chroma, for a ball that luma alone hardly tells from what is behind it.
//!
//! Chroma has fewer samples than luma, and they lie where the file says (`chroma_location`): with H.264's custom each stands at the left one of
//! its two columns and between its two rows, with JPEG's in the middle of its four pixels. To take one for the other moves every edge by
//! half a pixel, so each sample is put where it lies, as the file is stored (before the picture is turned upright). Between
//! samples chroma is interpolated linearly: an edge keeps its place and gets a little softer.

use super::Luma;
use super::av::{AvError, ColourLayout, Picture};
use super::colour::yuv_from_rgb;

/// Grey = `offset` + `luma` Y + `u` (U − 128) + `v` (V − 128), of code values, rounded and kept within 0 to 255.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColourMix {
    /// Of luma.
    pub luma: f64,
    /// Of blue-yellow chroma.
    pub u: f64,
    /// Of red-cyan chroma.
    pub v: f64,
    /// Added, grey levels.
    pub offset: f64,
}

/// How the samples of chroma lie among the pixels of the upright picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChromaGrid {
    /// Columns and rows of pixels that share a sample; 1 for a picture whose chroma is as fine as its luma.
    pub step: (usize, usize),
    /// Mean square of the weights with which a pixel gets its chroma from samples near it: what linear interpolation leaves of a sample's
    /// variance.
    pub variance_kept: f64,
    /// Standard uncertainty of where the samples lie along the upright picture's columns and rows, px.
    pub place_std_px: (f64, f64),
}

/// A file that says by custom or by a tag where chroma lies may be wrong: many cameras take the mean of two columns and have H.264 say that it
/// stands at the left one. One in six is allowed for: 0.5 px √(1/6).
const PLACE_STD_PX: f64 = 0.2;
/// In the other direction, or where the custom is the only one there is, px.
const SURE_PLACE_STD_PX: f64 = 0.05;

/// Where the first sample lies, as parts of the way over the pixels that share it, where the stream does not say: MPEG-2's custom, which H.264 and all
/// after it took over.
const USUAL_PLACE: (f64, f64) = (0.0, 0.5);

/// The samples of a picture's chroma along one direction.
#[derive(Debug, Clone, Copy)]
struct SampleLine {
    step: usize,
    first_px: f64,
    count: usize,
}

impl SampleLine {
    fn new(shift: u32, place: f64, pixels: usize) -> Self {
        let step = 1 << shift;
        Self {
            step,
            first_px: place * count(step - 1),
            count: pixels.div_ceil(step),
        }
    }

    /// The two samples beside pixel `x` and the weight of the second.
    fn beside(&self, x: usize) -> (usize, usize, f32) {
        let at = (count(x) - self.first_px) / count(self.step);
        let last = count(self.count - 1);
        let at = at.clamp(0.0, last);
        let low = at.floor();
        let low_index = low as usize;
        (low_index, (low_index + 1).min(self.count - 1), (at - low) as f32)
    }

    /// Mean square of those weights.
    fn variance_kept(&self) -> f64 {
        let squares = (0..self.step).map(|x| {
            let part = ((count(x) - self.first_px) / count(self.step)).rem_euclid(1.0);
            part * part + (1.0 - part) * (1.0 - part)
        });
        squares.sum::<f64>() / count(self.step)
    }
}

#[allow(clippy::cast_precision_loss, reason = "pixels of a picture's side")]
fn count(n: usize) -> f64 {
    n as f64
}

fn lines(picture: &Picture, layout: &ColourLayout) -> [SampleLine; 2] {
    let place = picture.chroma_place().unwrap_or(USUAL_PLACE);
    [
        SampleLine::new(layout.chroma_shift.0, place.0, picture.width().max(1)),
        SampleLine::new(layout.chroma_shift.1, place.1, picture.height().max(1)),
    ]
}

/// How the chroma of `picture` lies, which is `transposed` to be upright; `None` where it has none.
pub(super) fn chroma_grid(picture: &Picture, transposed: bool) -> Option<ChromaGrid> {
    let layout = picture.colour()?;
    let [across, down] = lines(picture, &layout);
    let alone = layout.is_rgb || layout.chroma_shift == (0, 0);
    let is_centred = picture.chroma_place() == Some((0.5, 0.5));
    let std = |line: &SampleLine, centred_by_custom: bool| match line.step {
        1 => 0.0,
        _ if centred_by_custom => SURE_PLACE_STD_PX,
        step => PLACE_STD_PX * count(step - 1),
    };
    let grid = ChromaGrid {
        step: (across.step, down.step),
        variance_kept: across.variance_kept() * down.variance_kept(),
        place_std_px: (std(&across, is_centred), std(&down, down.first_px > 0.0)),
    };
    let turned = |(a, b)| if transposed { (b, a) } else { (a, b) };
    Some(if alone {
        ChromaGrid {
            step: (1, 1),
            variance_kept: 1.0,
            place_std_px: (0.0, 0.0),
        }
    } else {
        ChromaGrid {
            step: if transposed {
                (grid.step.1, grid.step.0)
            } else {
                grid.step
            },
            place_std_px: turned(grid.place_std_px),
            ..grid
        }
    })
}

/// The mixture of `picture`, as it is stored; `None` where that has no colour.
pub(super) fn mixed(picture: &Picture, mix: &ColourMix) -> Result<Option<Luma>, AvError> {
    let (width, height) = (picture.width(), picture.height());
    let Some(layout) = picture.colour() else {
        return Ok(None);
    };
    let rows_hold = (0..3).all(|i| {
        let c = layout.components[i];
        let (across, down) = if i == 0 || layout.is_rgb {
            (0, 0)
        } else {
            layout.chroma_shift
        };
        let (columns, rows) = (width.div_ceil(1 << across), height.div_ceil(1 << down));
        let bytes = if c.depth > 8 { 2 } else { 1 };
        let least = (columns.max(1) - 1) * c.step + c.offset + bytes;
        columns > 0
            && rows > 0
            && picture.row(c.plane, 0).len() >= least
            && picture.row(c.plane, rows - 1).len() >= least
    });
    if !rows_hold {
        return Err(AvError::invalid());
    }
    let data = if layout.is_rgb {
        of_rgb(picture, &layout, mix)
    } else {
        of_yuv(picture, &layout, mix)
    };
    Ok(Some(Luma { width, height, data }))
}

fn of_rgb(picture: &Picture, layout: &ColourLayout, mix: &ColourMix) -> Vec<u8> {
    let [y, u, v] = yuv_from_rgb();
    let weights: [f32; 3] = std::array::from_fn(|i| (mix.luma * y[i] + mix.u * u[i] + mix.v * v[i]) as f32);
    let offset = mix.offset as f32 + 0.5;
    let mut data = Vec::with_capacity(picture.width() * picture.height());
    for row in 0..picture.height() {
        let rows = [0, 1, 2].map(|i| picture.row(layout.components[i].plane, row));
        data.extend((0..picture.width()).map(|x| {
            let sum: f32 = (0..3)
                .map(|i| weights[i] * layout.components[i].value(rows[i], x))
                .sum();
            (sum + offset) as u8
        }));
    }
    data
}

fn of_yuv(picture: &Picture, layout: &ColourLayout, mix: &ColourMix) -> Vec<u8> {
    let (width, height) = (picture.width(), picture.height());
    let [across, down] = lines(picture, layout);
    let columns: Vec<(usize, usize, f32)> = (0..width).map(|x| across.beside(x)).collect();
    let [of_luma, of_u, of_v] = layout.components;
    let (wy, wu, wv) = (mix.luma as f32, mix.u as f32, mix.v as f32);
    let offset = mix.offset as f32 + 0.5 - 128.0 * (wu + wv);
    // One row of samples, spread over the pixels of a row.
    let mut samples = vec![0.0_f32; across.count];
    let mut spread = |row: usize, out: &mut Vec<f32>| {
        let (us, vs) = (picture.row(of_u.plane, row), picture.row(of_v.plane, row));
        if of_u.step == 1 && of_u.depth == 8 && of_v.step == 1 && of_v.depth == 8 {
            for (s, (&u, &v)) in samples.iter_mut().zip(us.iter().zip(vs)) {
                *s = wu * f32::from(u) + wv * f32::from(v);
            }
        } else {
            for (x, s) in samples.iter_mut().enumerate() {
                *s = wu * of_u.value(us, x) + wv * of_v.value(vs, x);
            }
        }
        out.clear();
        out.extend(
            columns
                .iter()
                .map(|&(low, high, part)| samples[low] + part * (samples[high] - samples[low])),
        );
    };
    let (mut above, mut below) = ((usize::MAX, Vec::new()), (usize::MAX, Vec::new()));
    let mut data = Vec::with_capacity(width * height);
    for y in 0..height {
        let (low, high, part) = down.beside(y);
        if above.0 != low {
            std::mem::swap(&mut above, &mut below);
            if above.0 != low {
                spread(low, &mut above.1);
                above.0 = low;
            }
        }
        if below.0 != high {
            spread(high, &mut below.1);
            below.0 = high;
        }
        let row = picture.row(of_luma.plane, y);
        let chroma = above.1.iter().zip(&below.1).map(|(a, b)| a + part * (b - a));
        if of_luma.step == 1 && of_luma.depth == 8 {
            let pixels = row.iter().zip(chroma);
            data.extend(pixels.map(|(&p, c)| (wy * f32::from(p) + c + offset) as u8));
        } else {
            let pixels = chroma.enumerate();
            data.extend(pixels.map(|(x, c)| (wy * of_luma.value(row, x) + c + offset) as u8));
        }
    }
    data
}
