//! Flicker of the light: 1 + a sin(2π f t), averaged over the exposure.

use super::{Action, Effect, EffectEstimate, Ideal, Lamp};
use crate::simulate::scene::Scene;
use std::f64::consts::PI;

/// Flicker.
pub(super) struct Flicker;

impl Effect for Flicker {
    fn name(&self) -> &'static str {
        "flicker"
    }

    fn estimate(&self, scene: &Scene, _ideal: &Ideal) -> EffectEstimate {
        let mains = Mains::new(scene);
        let brightest = scene.look.ball_grey.max(scene.look.background_grey);
        EffectEstimate::grey(
            brightest * mains.amplitude * mains.attenuation(scene.camera.exposure_s).abs(),
            "amplitude × brightest grey × sin(π f T)/(π f T)",
        )
    }

    fn action(&self, scene: &Scene) -> Action {
        if scene.look.flicker > 0.0 {
            Action::Lamp(Box::new(Mains::new(scene)))
        } else {
            Action::Nothing
        }
    }
}

struct Mains {
    amplitude: f64,
    frequency_hz: f64,
}

impl Mains {
    fn new(scene: &Scene) -> Self {
        Self {
            amplitude: scene.look.flicker,
            frequency_hz: scene.look.flicker_hz,
        }
    }

    /// What an exposure leaves of the amplitude.
    fn attenuation(&self, exposure_s: f64) -> f64 {
        let half = PI * self.frequency_hz * exposure_s;
        if half == 0.0 { 1.0 } else { half.sin() / half }
    }
}

impl Lamp for Mains {
    fn gain(&self, time_s: f64, exposure_s: f64) -> f64 {
        1.0 + self.amplitude * self.attenuation(exposure_s) * (2.0 * PI * self.frequency_hz * time_s).sin()
    }
}
