//! Exposure blur: a frame is the time average over the exposure, whose middle is the frame's time.

use super::{Action, Effect, EffectEstimate, Ideal};
use crate::simulate::scene::Scene;

/// Exposure blur.
pub(super) struct ExposureBlur;

impl Effect for ExposureBlur {
    fn name(&self) -> &'static str {
        "exposure_blur"
    }

    fn estimate(&self, scene: &Scene, ideal: &Ideal) -> EffectEstimate {
        EffectEstimate::px(
            0.5 * ideal.top_speed_px_s(scene) * scene.camera.exposure_s,
            "v T/2, how far the smear moves an edge (a centre it moves by g T²/24, and by an impact within it)",
        )
    }

    fn action(&self, scene: &Scene) -> Action {
        if scene.camera.exposure_s > 0.0 {
            Action::Exposure(scene.camera.exposure_s)
        } else {
            Action::Nothing
        }
    }
}
