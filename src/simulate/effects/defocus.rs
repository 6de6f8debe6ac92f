//! Optical blur: a Gaussian of standard deviation `blur_px`, which stands for defocus and diffraction together.

use super::{Action, Effect, EffectEstimate, Ideal};
use crate::simulate::scene::Scene;

/// Optical blur.
pub(super) struct Defocus;

impl Effect for Defocus {
    fn name(&self) -> &'static str {
        "defocus"
    }

    fn estimate(&self, scene: &Scene, _ideal: &Ideal) -> EffectEstimate {
        EffectEstimate::px(
            scene.camera.blur_px,
            "standard deviation of the blur: how far it moves an edge's foot",
        )
    }

    fn action(&self, scene: &Scene) -> Action {
        if scene.camera.blur_px > 0.0 {
            Action::Blur(scene.camera.blur_px)
        } else {
            Action::Nothing
        }
    }
}
