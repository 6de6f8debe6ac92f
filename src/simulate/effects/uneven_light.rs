//! Uneven light: it falls off along the diagonal from the upper left corner, linearly.

use super::{Action, Effect, EffectEstimate, Ideal, LightField};
use crate::geometry::PixelPoint;
use crate::simulate::scene::Scene;

/// Uneven light.
pub(super) struct UnevenLight;

impl Effect for UnevenLight {
    fn name(&self) -> &'static str {
        "uneven_light"
    }

    fn estimate(&self, scene: &Scene, _ideal: &Ideal) -> EffectEstimate {
        let brightest = scene.look.ball_grey.max(scene.look.background_grey);
        EffectEstimate::grey(
            scene.look.unevenness * brightest,
            "share × brightest grey, corner to corner",
        )
    }

    fn action(&self, scene: &Scene) -> Action {
        if scene.look.unevenness > 0.0 {
            Action::LightField(Box::new(Slope {
                fall: scene.look.unevenness,
                width_px: scene.camera.width_px as f64,
                height_px: scene.camera.height_px as f64,
            }))
        } else {
            Action::Nothing
        }
    }
}

struct Slope {
    fall: f64,
    width_px: f64,
    height_px: f64,
}

impl LightField for Slope {
    fn gain(&self, at: PixelPoint) -> f64 {
        1.0 - self.fall * 0.5 * ((at.u_px + 0.5) / self.width_px + (at.v_px + 0.5) / self.height_px)
    }
}
