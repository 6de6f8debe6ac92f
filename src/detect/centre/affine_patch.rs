//! The affine patch: coordinates in which the ellipse that perspective and lens make of a ball is a circle.
//!
//! With S the stretch and c a fixed point, the place w of the patch is the place c + S (w − c) of the frame. Only the places
//! of pixels change, no pixel is interpolated, so that their noise stays what it is. (The blur becomes an ellipse the other
//! way, which pulls no centre.)

use super::disc::{Centre, Disc};
use crate::geometry::PixelPoint;
use nalgebra::{Matrix2, Vector2};

/// The stretch of the picture around a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AffinePatch {
    fixed: Vector2<f64>,
    stretch: Matrix2<f64>,
    inverse: Matrix2<f64>,
}

impl AffinePatch {
    /// The frame is the patch stretched by `stretch` about `fixed`; `None` where that has no inverse.
    #[must_use]
    pub fn new(fixed: PixelPoint, stretch: Matrix2<f64>) -> Option<Self> {
        Some(Self {
            fixed: Vector2::new(fixed.u_px, fixed.v_px),
            stretch,
            inverse: stretch.try_inverse()?,
        })
    }

    /// How many times longer than in the patch a length in the frame may be.
    #[must_use]
    pub fn largest_stretch(&self) -> f64 {
        self.stretch.norm()
    }

    /// The place in the patch of a point of the frame.
    #[must_use]
    pub fn patch_from_frame(&self, u: f64, v: f64) -> (f64, f64) {
        let w = self.fixed + self.inverse * (Vector2::new(u, v) - self.fixed);
        (w.x, w.y)
    }

    /// The place in the frame of a point of the patch.
    #[must_use]
    pub fn frame_from_patch(&self, w: PixelPoint) -> PixelPoint {
        let p = self.fixed + self.stretch * (Vector2::new(w.u_px, w.v_px) - self.fixed);
        PixelPoint::new(p.x, p.y)
    }

    /// A `disc` of the frame, whose radius is that of the circle, in the patch.
    #[must_use]
    pub fn disc_in_patch(&self, disc: &Disc) -> Disc {
        let (u, v) = self.patch_from_frame(disc.centre.u_px, disc.centre.v_px);
        let swept = self.inverse * Vector2::from(disc.swept_px);
        let bent = self.inverse * Vector2::from(disc.bent_px);
        Disc {
            centre: PixelPoint::new(u, v),
            swept_px: [swept.x, swept.y],
            bent_px: [bent.x, bent.y],
            ..*disc
        }
    }

    /// A centre found in the patch, in the frame; its radius stays that of the circle.
    #[must_use]
    pub fn centre_in_frame(&self, found: &Centre) -> Centre {
        let swept = self.stretch * Vector2::from(found.disc.swept_px);
        let bent = self.stretch * Vector2::from(found.disc.bent_px);
        let covariance = self.stretch * Matrix2::from(found.covariance_px2) * self.stretch.transpose();
        Centre {
            disc: Disc {
                centre: self.frame_from_patch(found.disc.centre),
                swept_px: [swept.x, swept.y],
                bent_px: [bent.x, bent.y],
                ..found.disc
            },
            covariance_px2: covariance.into(),
            ..*found
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::centre::appearance::{AppearanceFrame, Estimation, RadiusSource};
    use crate::detect::centre::{Patch, edge_likelihood, standard};
    use crate::detect::crop::Crop;
    use crate::frames::Luma;

    /// A disc of `radius` stretched by `stretch`, brighter on one side, on a grey ground, by 16 × 16 samples over 2.4 px.
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
    fn stretched_balls_of_many_sizes_are_found_as_one() {
        let d = Vector2::new(0.8_f64, -0.6);
        let stretch = Matrix2::identity() + 0.12 * d * d.transpose();
        let balls: Vec<(Vector2<f64>, f64)> = (0..8)
            .map(|i| {
                let i = f64::from(i);
                (Vector2::new(55.0 + 0.37 * i, 52.0 - 0.23 * i), 1.0 + 0.06 * i)
            })
            .collect();
        let radius_px = 22.0;
        let crops: Vec<Crop> = balls
            .iter()
            .map(|&(at, m)| picture(at, m * radius_px, stretch))
            .collect();
        // Half a pixel off, and of a first guess of the size.
        let start = |i: usize, larger: f64| Disc {
            centre: PixelPoint::new(balls[i].0.x + 300.4, balls[i].0.y + 199.7),
            radius_px: balls[i].1 * radius_px + larger,
            swept_px: [0.0; 2],
            bent_px: [0.0; 2],
        };
        let patch = |i: usize, disc: &Disc| Patch {
            crop: &crops[i],
            background: vec![60.0; crops[i].luma.data.len()],
            noise_grey: 0.5,
            affine: AffinePatch::new(disc.centre, stretch),
        };
        let frames: Vec<AppearanceFrame<'_>> = (0..balls.len())
            .map(|i| AppearanceFrame {
                patch: patch(i, &start(i, -0.5)),
                disc: start(i, -0.5),
                velocity_px_s: [0.0; 2],
                acceleration_px_s2: [0.0; 2],
                gain: 1.0,
                magnification: balls[i].1,
            })
            .collect();
        let ball = Estimation::begun(
            frames,
            0.01,
            Some(crate::frames::LumaRange::FULL),
            &standard::METHOD.appearance,
        )
        .and_then(|begun| begun.by(RadiusSource::Fitted))
        .unwrap();
        assert!((ball.radius_px - radius_px).abs() < 0.05, "{}", ball.radius_px);
        let mut squares = 0.0;
        for (i, &(at, m)) in balls.iter().enumerate() {
            let sized = ball.magnified(m, &standard::METHOD.appearance.fit);
            let start = start(i, 0.0);
            let patch = patch(i, &start);
            let found =
                edge_likelihood::fit(&patch, &sized, &start, 1.0, &standard::METHOD.appearance.fit).unwrap();
            let centre = patch.affine.unwrap().centre_in_frame(&found.centre);
            let off = centre
                .disc
                .centre
                .distance_px(PixelPoint::new(at.x + 300.0, at.y + 200.0));
            // A box blurred these edges, not the Gaussian of the model.
            assert!(off < 0.05, "{off} px off at {m} times");
            squares += off * off;
        }
        assert!((squares / 8.0).sqrt() < 0.02, "{squares}");
    }

    #[test]
    fn the_patch_and_back_is_the_same_place() {
        let stretch = Matrix2::new(1.1, 0.05, 0.05, 1.02);
        let d = AffinePatch::new(PixelPoint::new(300.0, 200.0), stretch).unwrap();
        let (u, v) = d.patch_from_frame(317.0, 180.5);
        let p = d.frame_from_patch(PixelPoint::new(u, v));
        assert!((p.u_px - 317.0).hypot(p.v_px - 180.5) < 1e-12);
        assert_eq!(d.patch_from_frame(300.0, 200.0), (300.0, 200.0));
        assert!(AffinePatch::new(p, Matrix2::zeros()).is_none());
    }
}
