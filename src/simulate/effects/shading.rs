//! Shading of the ball by a lamp at the upper left, with a highlight.
//!
//! Half-Lambert, grey = G [1 − a (1 − (1 + n·l)/2)]: Lambert's cosine law softened by the light that walls return, so
//! that there is no hard terminator. The highlight is Blinn and Phong's, H (n·h)^p with h halfway to the camera.

use super::{Action, Effect, EffectEstimate, Ideal, Surface};
use crate::simulate::scene::Scene;
use nalgebra::Vector3;

/// Shading and highlight.
pub(super) struct Shading;

/// Towards the lamp: right, up, towards the camera.
const LAMP: Vector3<f64> = Vector3::new(-0.46, 0.64, 0.615);
/// What the highlight's brightness goes with, of the cosine: its 40th power, a polished ball under a soft box.
#[inline]
fn gloss(cosine: f64) -> f64 {
    // By squaring: `powi` calls a loop, which took a quarter of all rendering.
    let squared = cosine * cosine;
    let fourth = squared * squared;
    let eighth = fourth * fourth;
    let sixteenth = eighth * eighth;
    eighth * (sixteenth * sixteenth)
}

impl Effect for Shading {
    fn name(&self) -> &'static str {
        "shading"
    }

    fn estimate(&self, scene: &Scene, _ideal: &Ideal) -> EffectEstimate {
        let look = &scene.look;
        EffectEstimate::grey(
            look.ball_grey * look.shading + look.highlight_grey,
            "fall of a half-Lambert ball from pole to pole, + highlight (Blinn 1977)",
        )
    }

    fn action(&self, scene: &Scene) -> Action {
        let lamp = LAMP.normalize();
        Action::Surface(Box::new(Lit {
            ball_grey: scene.look.ball_grey,
            shading: scene.look.shading,
            highlight_grey: scene.look.highlight_grey,
            lamp,
            halfway: (lamp + Vector3::z()).normalize(),
        }))
    }
}

struct Lit {
    ball_grey: f64,
    shading: f64,
    highlight_grey: f64,
    lamp: Vector3<f64>,
    halfway: Vector3<f64>,
}

impl Surface for Lit {
    #[inline]
    fn grey(&self, normal: &Vector3<f64>) -> f64 {
        let away = 0.5 * (1.0 - normal.dot(&self.lamp));
        let gloss = gloss(normal.dot(&self.halfway).max(0.0));
        self.ball_grey * (1.0 - self.shading * away) + self.highlight_grey * gloss
    }
}
