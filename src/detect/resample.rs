//! Pictures between their pixels.

use crate::frames::Luma;
use crate::geometry::PixelPoint;
use rayon::prelude::*;
use std::sync::LazyLock;

/// `out(u, v) = luma(u + du, v + dv)`, bilinear, edges repeated.
#[must_use]
pub fn shifted(luma: &Luma, du: f64, dv: f64) -> Luma {
    let (w, h) = (luma.width, luma.height);
    let (iu, iv) = (du.floor(), dv.floor());
    // Weights in 1/256; the four sum to 65536 exactly.
    let fu = ((du - iu) * 256.0).round() as u32;
    let fv = ((dv - iv) * 256.0).round() as u32;
    let clamp = |x: i64, n: usize| x.clamp(0, n as i64 - 1) as usize;
    let columns: Vec<usize> = (0..=w).map(|u| clamp(u as i64 + iu as i64, w)).collect();
    let mut data = Vec::with_capacity(w * h);
    for v in 0..h as i64 {
        let top = luma.row(clamp(v + iv as i64, h));
        let bottom = luma.row(clamp(v + iv as i64 + 1, h));
        for pair in columns.windows(2) {
            let (a, b) = (pair[0], pair[1]);
            let upper = u32::from(top[a]) * (256 - fu) + u32::from(top[b]) * fu;
            let lower = u32::from(bottom[a]) * (256 - fu) + u32::from(bottom[b]) * fu;
            data.push(((upper * (256 - fv) + lower * fv + 32_768) >> 16) as u8);
        }
    }
    Luma {
        width: w,
        height: h,
        data,
    }
}

/// `out(p) = luma(from(p))`, bilinear, edges repeated.
#[must_use]
pub fn taken(luma: &Luma, from: impl Fn(PixelPoint) -> PixelPoint + Sync) -> Luma {
    let (w, h) = (luma.width, luma.height);
    let (last_u, last_v) = ((w - 1) as f64, (h - 1) as f64);
    let mut data = vec![0; w * h];
    data.par_chunks_mut(w).enumerate().for_each(|(v, row)| {
        for (u, out) in row.iter_mut().enumerate() {
            let p = from(PixelPoint::new(u as f64, v as f64));
            let (u, v) = (p.u_px.clamp(0.0, last_u), p.v_px.clamp(0.0, last_v));
            *out = bilinear(&luma.data, (w, h), u, v).map_or(0, |grey| grey.round() as u8);
        }
    });
    Luma {
        width: w,
        height: h,
        data,
    }
}

/// Bilinear value at (u, v) of a picture of this width and height; `None` outside.
#[must_use]
pub fn bilinear<T: Copy + Into<f32>>(
    rows: &[T],
    (width, height): (usize, usize),
    u: f64,
    v: f64,
) -> Option<f64> {
    let inside = u >= 0.0 && v >= 0.0 && u <= (width - 1) as f64 && v <= (height - 1) as f64;
    if !inside {
        return None;
    }
    let (iu, iv) = (u as usize, v as usize);
    let (ju, jv) = ((iu + 1).min(width - 1), (iv + 1).min(height - 1));
    let (fu, fv) = (u - iu as f64, v - iv as f64);
    let at = |a: usize, b: usize| f64::from(rows[b * width + a].into());
    let top = at(iu, iv) * (1.0 - fu) + at(ju, iv) * fu;
    let bottom = at(iu, jv) * (1.0 - fu) + at(ju, jv) * fu;
    Some(top * (1.0 - fv) + bottom * fv)
}

/// Value at (u, v) by Catmull and Rom's cubic; beyond the rim its pixels are repeated.
#[must_use]
pub fn cubic(luma: &Luma, u: f64, v: f64) -> f64 {
    let (iu, iv) = (u.floor(), v.floor());
    let weights = |t: f64| {
        [
            ((-0.5 * t + 1.0) * t - 0.5) * t,
            (1.5 * t - 2.5) * t * t + 1.0,
            ((-1.5 * t + 2.0) * t + 0.5) * t,
            (0.5 * t - 0.5) * t * t,
        ]
    };
    let (wu, wv) = (weights(u - iu), weights(v - iv));
    let (width, height) = (luma.width as i32, luma.height as i32);
    let at = |i: i32, j: i32| {
        let (u, v) = (
            (iu as i32 + i - 1).clamp(0, width - 1),
            (iv as i32 + j - 1).clamp(0, height - 1),
        );
        f64::from(luma.data[(v * width + u) as usize])
    };
    (0..4)
        .map(|j| wv[j as usize] * (0..4).map(|i| wu[i as usize] * at(i, j)).sum::<f64>())
        .sum()
}

/// Pixels along each side that tell a smooth value between them.
const SMOOTH_PIXELS: usize = 8;

/// Standard deviation of the smoothing, px.
const SMOOTH_PX: f64 = 1.0;

/// What smoothing leaves of the noise of single pixels: 1/(2 √π σ) for both axes together.
pub const SMOOTH_NOISE_PART: f64 = 0.282 / SMOOTH_PX;

/// Of these, pixels before the one that is shifted to.
const SMOOTH_BEFORE: i64 = SMOOTH_PIXELS as i64 / 2 - 1;

/// Weights of the pixels along one side for a value this part of a pixel beyond one of them.
fn smooth_weights(part: f64) -> [f32; SMOOTH_PIXELS] {
    let at = |i: usize| ((i as i64 - SMOOTH_BEFORE) as f64 - part) / SMOOTH_PX;
    let of = |i: usize| (-0.5 * at(i) * at(i)).exp();
    let sum: f64 = (0..SMOOTH_PIXELS).map(of).sum();
    std::array::from_fn(|i| (of(i) / sum) as f32)
}

/// Parts of a pixel of which the weights are kept.
const NEAR_STEPS: usize = 256;

/// The weights for these parts of a pixel, 0 and 1 included.
static NEAR_WEIGHTS: LazyLock<[[f32; SMOOTH_PIXELS]; NEAR_STEPS + 1]> =
    LazyLock::new(|| std::array::from_fn(|k| smooth_weights(k as f64 / NEAR_STEPS as f64)));

/// A picture shifted by parts of a pixel and smoothed by a Gaussian.
///
/// Bilinear weights see waves of four pixels up to 0.05 px beside their place, and as much in every place of a scene: a camera that drifts would seem
/// to go in steps. A Gaussian of a pixel sees all waves where they are, and little of the shortest ones, which are a codec's more than the scene's.
#[derive(Debug, Clone, Copy)]
pub struct SmoothShift {
    /// From a pixel to the first of those that tell its value.
    first: (i64, i64),
    columns: [f32; SMOOTH_PIXELS],
    rows: [f32; SMOOTH_PIXELS],
    /// In whole and parts of pixels.
    shift: (f64, f64),
}

impl SmoothShift {
    /// By (du, dv).
    #[must_use]
    pub fn new(du: f64, dv: f64) -> Self {
        Self::by_weights(du, dv, smooth_weights)
    }

    /// The same to a few thousandths of a pixel, quickly: for shifts that differ from pixel to pixel.
    #[must_use]
    pub fn near(du: f64, dv: f64) -> Self {
        Self::by_weights(du, dv, |part| {
            NEAR_WEIGHTS[(part * NEAR_STEPS as f64).round() as usize]
        })
    }

    fn by_weights(du: f64, dv: f64, weights: impl Fn(f64) -> [f32; SMOOTH_PIXELS]) -> Self {
        Self {
            first: (
                du.floor() as i64 - SMOOTH_BEFORE,
                dv.floor() as i64 - SMOOTH_BEFORE,
            ),
            columns: weights(du - du.floor()),
            rows: weights(dv - dv.floor()),
            shift: (du, dv),
        }
    }

    /// The value of `luma` beside its pixel (u, v); `None` where that is outside. Beyond the rim its pixels are repeated.
    #[must_use]
    pub fn value(&self, luma: &Luma, u: usize, v: usize) -> Option<f64> {
        let (w, h) = (luma.width, luma.height);
        let is_inside = |at: f64, n: usize| at >= 0.0 && at <= (n - 1) as f64;
        if !is_inside(u as f64 + self.shift.0, w) || !is_inside(v as f64 + self.shift.1, h) {
            return None;
        }
        let clamp = |x: i64, n: usize| x.clamp(0, n as i64 - 1) as usize;
        let (u, v) = (u as i64 + self.first.0, v as i64 + self.first.1);
        let is_whole = u >= 0 && u + SMOOTH_PIXELS as i64 <= w as i64;
        let sums = self.rows.iter().enumerate().map(|(j, weight)| {
            let row = luma.row(clamp(v + j as i64, h));
            let sum: f32 = if is_whole {
                let part = &row[u as usize..u as usize + SMOOTH_PIXELS];
                part.iter()
                    .zip(&self.columns)
                    .map(|(&p, w)| f32::from(p) * w)
                    .sum()
            } else {
                let column = |i: usize| f32::from(row[clamp(u + i as i64, w)]);
                self.columns.iter().enumerate().map(|(i, w)| column(i) * w).sum()
            };
            weight * sum
        });
        Some(f64::from(sums.sum::<f32>()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waves_are_seen_where_they_are() {
        let (width, height) = (64, 48);
        for (length_px, most_px) in [(3.0, 0.01), (4.0, 0.006), (8.0, 0.006)] {
            let wave = |u: f64| (std::f64::consts::TAU * u / length_px).sin();
            let luma = Luma::from_fn(width, height, |u, _| {
                (127.5 + 120.0 * wave(u as f64)).round() as u8
            });
            for part in [0.0, 0.25, 0.4, 0.7] {
                let shift = SmoothShift::new(2.0 + part, -1.3);
                // The phase of what is seen, from a sum over whole waves.
                let (mut sine, mut cosine) = (0.0, 0.0);
                for u in 8..56 {
                    let seen = shift.value(&luma, u, 20).unwrap() - 127.5;
                    let phase = std::f64::consts::TAU * u as f64 / length_px;
                    sine += seen * phase.sin();
                    cosine += seen * phase.cos();
                }
                let found = cosine.atan2(sine) * length_px / std::f64::consts::TAU;
                let off = (found - (2.0 + part) + 0.5 * length_px).rem_euclid(length_px) - 0.5 * length_px;
                assert!(off.abs() < most_px, "{length_px} px, {part}: {off}");
            }
        }
    }

    #[test]
    fn a_plain_picture_stays_what_it_is_and_outside_is_none() {
        let luma = Luma::from_fn(20, 10, |_, _| 77);
        let shift = SmoothShift::new(-2.0, 1.0);
        assert!((shift.value(&luma, 2, 8).unwrap() - 77.0).abs() < 1e-4);
        assert_eq!(shift.value(&luma, 1, 8), None);
        assert_eq!(shift.value(&luma, 2, 9), None);
    }
}
