//! Rolling shutter: row v is exposed (v − H/2)/H of the readout time after the middle of the picture.

use super::{Action, Effect, EffectEstimate, Ideal};
use crate::simulate::camera::picture_shift_px;
use crate::simulate::scene::Scene;

/// Rolling shutter.
pub(super) struct RollingShutter;

impl Effect for RollingShutter {
    fn name(&self) -> &'static str {
        "rolling_shutter"
    }

    fn estimate(&self, scene: &Scene, ideal: &Ideal) -> EffectEstimate {
        let height = scene.camera.height_px as f64;
        let shift = ideal.largest(|s| {
            let speed = picture_shift_px(&scene.camera, &s.state.position_m, &s.state.velocity_m_s);
            speed * scene.camera.readout_s * ((s.pixel.v_px + 0.5) / height - 0.5).abs()
        });
        EffectEstimate::px(
            shift,
            "speed × readout × distance from the middle row, as a share of the picture",
        )
    }

    fn action(&self, scene: &Scene) -> Action {
        if scene.camera.readout_s > 0.0 {
            Action::Readout(scene.camera.readout_s)
        } else {
            Action::Nothing
        }
    }
}
