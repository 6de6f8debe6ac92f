//! Lens distortion by OpenCV's model (Brown 1966), from the ideal picture to the real one:
//!
//! ```text
//! x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²)        y' likewise with p1 and p2 exchanged
//! ```
//!
//! The outline is the ellipse nearest to the warped one: over a ball the magnification changes a little, and the middle of
//! the outline lies elsewhere than the image of its middle (by 0.02 px for a ball of 15 px in the corner of a barrel
//! lens). What is left out, bulges of a third of the circumference each, pulls no centre.

use super::{Action, Effect, EffectEstimate, Ideal, Warp};
use crate::geometry::{PixelPoint, nearest_ellipse};
use crate::simulate::camera::{BallOutline, Ellipse};
use crate::simulate::scene::{Scene, SceneLens};
use nalgebra::{Vector2, Vector3};

/// Lens distortion.
pub(super) struct LensDistortion;

impl Effect for LensDistortion {
    fn name(&self) -> &'static str {
        "lens"
    }

    fn estimate(&self, scene: &Scene, ideal: &Ideal) -> EffectEstimate {
        let formula = "largest displacement along the flight, Brown's model with k1, k2, p1, p2, k3";
        let shift = scene.camera.lens.map_or(0.0, |lens| {
            ideal.largest(|s| {
                let at = Vector2::new(s.pixel.u_px, s.pixel.v_px);
                (lens.distort(at) - at).norm()
            })
        });
        EffectEstimate::px(shift, formula)
    }

    fn action(&self, scene: &Scene) -> Action {
        scene
            .camera
            .lens
            .map_or(Action::Nothing, |lens| Action::Warp(Box::new(lens)))
    }
}

impl SceneLens {
    /// Where a point of the picture without distortion (px) is in the real one.
    fn distort(&self, at: Vector2<f64>) -> Vector2<f64> {
        let [[fx, _, cx], [_, fy, cy], _] = self.camera_matrix;
        let [k1, k2, p1, p2, k3] = self.distortion;
        let (x, y) = ((at.x - cx) / fx, (at.y - cy) / fy);
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        Vector2::new(
            cx + fx * (x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)),
            cy + fy * (y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y),
        )
    }
}

impl Warp for SceneLens {
    fn warp(&self, _ball_m: &Vector3<f64>, outline: &BallOutline) -> BallOutline {
        let centre = self.distort(Vector2::new(outline.centre.u_px, outline.centre.v_px));
        let ellipse = outline.ellipse;
        let rim = |d: Vector2<f64>| Some(self.distort(ellipse.centre + ellipse.axes * d));
        BallOutline {
            centre: PixelPoint::new(centre.x, centre.y),
            ellipse: nearest_ellipse(rim).map_or(ellipse, |(centre, axes)| Ellipse { centre, axes }),
        }
    }
}
