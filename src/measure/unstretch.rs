//! A ball off the optical axis has an outline drawn out by perspective. Its surroundings are drawn together again, so that
//! it is a circle and can be fitted as one.
//!
//! With S the stretch and c the expected centre, the new picture's point w shows the old one's c + S (w − w0). Between
//! pixels by cubic convolution (Keys 1981), which blurs least among what needs four pixels a row; picture and background
//! alike.

use crate::detect::blobs::Crop;
use crate::detect::centre::edge_band::{self, Freedom};
use crate::detect::centre::{Centre, Disc, Patch};
use crate::frames::Luma;
use crate::geometry::PixelPoint;
use nalgebra::{Matrix2, Vector2};

/// Pixels kept around the outline, as a part of the radius and px: what the fit's band and a wrong start need.
const AROUND: (f64, f64) = (0.6, 6.0);

/// The surroundings of a ball, drawn together.
pub struct Rounded {
    crop: Crop,
    background: Vec<f32>,
    noise_grey: f64,
    stretch: Matrix2<f64>,
    centre: Vector2<f64>,
    middle: f64,
}

impl Rounded {
    /// Around `start` in `patch`; `None` where the outline reaches beyond the patch.
    #[must_use]
    pub fn new(patch: &Patch<'_>, start: &Disc, stretch: Matrix2<f64>) -> Option<Self> {
        let centre = Vector2::new(start.centre.u_px, start.centre.v_px);
        let swept = start.swept_px[0].hypot(start.swept_px[1]);
        let whole = start.radius_px * stretch.norm() / std::f64::consts::SQRT_2 + 0.5 * swept;
        // Two pixels for the blur.
        if !patch.crop.contains(start.centre, whole + 2.0) {
            return None;
        }
        let half = ((1.0 + AROUND.0) * start.radius_px + 0.5 * swept + AROUND.1).ceil();
        let size = 2 * half as usize + 1;
        let source = Source::new(patch);
        let (mut data, mut background) = (Vec::with_capacity(size * size), Vec::with_capacity(size * size));
        for j in 0..size {
            for i in 0..size {
                let from = centre + stretch * Vector2::new(i as f64 - half, j as f64 - half);
                let (grey, behind) = source.at(from);
                data.push(grey.round().clamp(0.0, 255.0) as u8);
                background.push(behind as f32);
            }
        }
        Some(Self {
            crop: Crop {
                u: 0,
                v: 0,
                luma: Luma {
                    width: size,
                    height: size,
                    data,
                },
            },
            background,
            noise_grey: patch.noise_grey,
            stretch,
            centre,
            middle: half,
        })
    }

    /// The centre in the frame's picture; the radius is that of the circle.
    #[must_use]
    pub fn centre(&self, start: &Disc, freedom: Freedom) -> Option<Centre> {
        let back = self.stretch.try_inverse()?;
        let swept = back * Vector2::from(start.swept_px);
        let patch = Patch {
            crop: &self.crop,
            background: self.background.clone(),
            noise_grey: self.noise_grey,
        };
        let round = Disc {
            centre: PixelPoint::new(self.middle, self.middle),
            radius_px: start.radius_px,
            swept_px: [swept.x, swept.y],
        };
        let found = edge_band::refine(&patch, &round, freedom)?;
        let off = Vector2::new(
            found.disc.centre.u_px - self.middle,
            found.disc.centre.v_px - self.middle,
        );
        let (at, swept) = (
            self.centre + self.stretch * off,
            self.stretch * Vector2::from(found.disc.swept_px),
        );
        let [[uu, uv], [vu, vv]] = found.covariance_px2;
        let covariance = self.stretch * Matrix2::new(uu, uv, vu, vv) * self.stretch.transpose();
        Some(Centre {
            disc: Disc {
                centre: PixelPoint::new(at.x, at.y),
                radius_px: found.disc.radius_px,
                swept_px: [swept.x, swept.y],
            },
            covariance_px2: [
                [covariance[(0, 0)], covariance[(0, 1)]],
                [covariance[(1, 0)], covariance[(1, 1)]],
            ],
            ..found
        })
    }
}

/// A patch between its pixels.
struct Source<'a> {
    patch: &'a Patch<'a>,
    width: isize,
    height: isize,
}

impl<'a> Source<'a> {
    fn new(patch: &'a Patch<'a>) -> Self {
        Self {
            patch,
            width: patch.crop.luma.width as isize,
            height: patch.crop.luma.height as isize,
        }
    }

    /// Grey and background at a point of the frame; beyond the patch as at its rim.
    fn at(&self, p: Vector2<f64>) -> (f64, f64) {
        let (u, v) = (p.x - self.patch.crop.u as f64, p.y - self.patch.crop.v as f64);
        let (wu, wv) = (weights(u - u.floor()), weights(v - v.floor()));
        let (u0, v0) = (u.floor() as isize - 1, v.floor() as isize - 1);
        let (mut grey, mut behind) = (0.0, 0.0);
        for (j, wv) in (0..).zip(wv) {
            let row = (v0 + j).clamp(0, self.height - 1) * self.width;
            for (i, wu) in (0..).zip(wu) {
                let k = (row + (u0 + i).clamp(0, self.width - 1)) as usize;
                grey += wu * wv * f64::from(self.patch.crop.luma.data[k]);
                behind += wu * wv * f64::from(self.patch.background[k]);
            }
        }
        (grey, behind)
    }
}

/// Of the four pixels around a point `x` beyond the second: Keys's kernel with a = −1/2.
fn weights(x: f64) -> [f64; 4] {
    let (x2, x3) = (x * x, x * x * x);
    [
        -0.5 * x + x2 - 0.5 * x3,
        1.0 - 2.5 * x2 + 1.5 * x3,
        0.5 * x + 2.0 * x2 - 1.5 * x3,
        -0.5 * x2 + 0.5 * x3,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::centre::edge_band::Effort;

    /// An elliptical disc, brighter on one side, on a grey ground; seen through a lens that blurs over 2.4 px, by
    /// 16 × 16 samples.
    fn picture(centre: Vector2<f64>, radius: f64, stretch: Matrix2<f64>) -> Crop {
        let (width, height) = (120, 110);
        let back = stretch.try_inverse().unwrap();
        let mut data = Vec::new();
        for v in 0..height {
            for u in 0..width {
                let mut grey = 0.0;
                for k in 0..256 {
                    let at = |i: i32| 2.4 * ((f64::from(i) + 0.5) / 16.0 - 0.5);
                    let p = back
                        * (Vector2::new(f64::from(u) + at(k % 16), f64::from(v) + at(k / 16)) - centre)
                        / radius;
                    grey += if p.norm() < 1.0 { 180.0 + 40.0 * p.x } else { 60.0 };
                }
                data.push((grey / 256.0_f64).round() as u8);
            }
        }
        let (width, height) = (width as usize, height as usize);
        Crop {
            u: 300,
            v: 200,
            luma: Luma { width, height, data },
        }
    }

    #[test]
    fn the_centre_of_a_drawn_out_ball_is_found() {
        let d = Vector2::new(0.8_f64, -0.6);
        let stretch = Matrix2::identity() + 0.12 * d * d.transpose();
        for (x, y) in [(55.3, 52.8), (58.0, 50.5), (56.1, 51.7)] {
            let centre = Vector2::new(x, y);
            let crop = picture(centre, 22.0, stretch);
            let patch = Patch {
                crop: &crop,
                background: vec![60.0; crop.luma.data.len()],
                noise_grey: 0.5,
            };
            let start = Disc {
                centre: PixelPoint::new(x + 300.6, y + 199.5),
                radius_px: 21.5,
                swept_px: [0.0; 2],
            };
            let freedom = Freedom {
                radius: true,
                blur_px: None,
                swept: false,
                effort: Effort::Measure,
            };
            let found = Rounded::new(&patch, &start, stretch)
                .unwrap()
                .centre(&start, freedom)
                .unwrap();
            let off = found
                .disc
                .centre
                .distance_px(PixelPoint::new(x + 300.0, y + 200.0));
            assert!(off < 0.02, "{off} px off");
            assert!(
                (found.disc.radius_px - 22.0).abs() < 0.05,
                "{}",
                found.disc.radius_px
            );
        }
    }

    #[test]
    fn a_ball_cut_by_the_rim_is_none() {
        let crop = picture(Vector2::new(12.0, 50.0), 22.0, Matrix2::identity());
        let patch = Patch {
            crop: &crop,
            background: vec![60.0; crop.luma.data.len()],
            noise_grey: 0.5,
        };
        let start = Disc {
            centre: PixelPoint::new(312.0, 250.0),
            radius_px: 22.0,
            swept_px: [0.0; 2],
        };
        assert!(Rounded::new(&patch, &start, Matrix2::identity()).is_none());
    }
}
