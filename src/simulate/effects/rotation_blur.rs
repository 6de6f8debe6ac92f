//! The ball turns during the exposure, which smears its marks. Without it they stand as they are at the frame's time.

use super::{Action, Effect, EffectEstimate, Ideal};
use crate::simulate::scene::Scene;

/// Rotation blur.
pub(super) struct RotationBlur;

impl Effect for RotationBlur {
    fn name(&self) -> &'static str {
        "rotation_blur"
    }

    fn estimate(&self, scene: &Scene, ideal: &Ideal) -> EffectEstimate {
        let formula = "R ω T/2, how far the smear moves the edge of a mark";
        if scene.look.marks.is_none() {
            return EffectEstimate::px(0.0, formula);
        }
        let launched = scene.launch.spin_rad_s(scene.ball.radius_m).norm();
        let fastest_rad_s = (ideal.trajectory.arcs())
            .map(|arc| arc.spin_rad_s.norm())
            .fold(launched, f64::max);
        let radius_px = scene.ball.radius_m / scene.camera.metres_per_pixel;
        EffectEstimate::px(0.5 * radius_px * fastest_rad_s * scene.camera.exposure_s, formula)
    }

    fn action(&self, scene: &Scene) -> Action {
        if scene.camera.exposure_s > 0.0 && scene.look.marks.is_some() {
            Action::RotationBlur(scene.camera.exposure_s)
        } else {
            Action::Nothing
        }
    }
}
