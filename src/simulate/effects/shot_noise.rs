//! Shot noise: electrons arrive at random, n ± √n of them (Poisson; Gaussian for the many of a frame).

use super::{Action, Effect, EffectEstimate, Ideal, SensorNoise};
use crate::simulate::scene::Scene;

/// Shot noise.
pub(super) struct ShotNoise;

impl Effect for ShotNoise {
    fn name(&self) -> &'static str {
        "shot_noise"
    }

    fn estimate(&self, scene: &Scene, _ideal: &Ideal) -> EffectEstimate {
        let brightest = scene.look.ball_grey.max(scene.look.background_grey);
        let spread = scene
            .camera
            .electrons_per_grey
            .map_or(0.0, |n| (brightest / n).sqrt());
        EffectEstimate::grey(spread, "√(brightest grey / electrons_per_grey), Poisson")
    }

    fn action(&self, scene: &Scene) -> Action {
        scene.camera.electrons_per_grey.map_or(Action::Nothing, |n| {
            Action::SensorNoise(Box::new(Poisson {
                per_electron: 1.0 / n,
            }))
        })
    }
}

struct Poisson {
    /// Grey levels an electron.
    per_electron: f64,
}

impl SensorNoise for Poisson {
    fn variance(&self, grey: f64) -> f64 {
        grey.max(0.0) * self.per_electron
    }
}
