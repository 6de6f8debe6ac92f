//! Read noise: the same Gaussian spread at every grey level.

use super::{Action, Effect, EffectEstimate, Ideal, SensorNoise};
use crate::simulate::scene::Scene;

/// Read noise.
pub(super) struct ReadNoise;

impl Effect for ReadNoise {
    fn name(&self) -> &'static str {
        "noise"
    }

    fn estimate(&self, scene: &Scene, _ideal: &Ideal) -> EffectEstimate {
        EffectEstimate::grey(scene.camera.noise_grey, "standard deviation as given")
    }

    fn action(&self, scene: &Scene) -> Action {
        if scene.camera.noise_grey > 0.0 {
            Action::SensorNoise(Box::new(Constant(scene.camera.noise_grey.powi(2))))
        } else {
            Action::Nothing
        }
    }
}

struct Constant(f64);

impl SensorNoise for Constant {
    fn variance(&self, _grey: f64) -> f64 {
        self.0
    }
}
