//! A second ball in the picture: another launch, at another time and place, of the same or another size.
//!
//! It has the contact, the floor, the camera and the effects of the first, but no bench, no spin, and neither shadow nor reflection. It
//! lies still where it is launched from until then, and passes behind the first without touching it. The recording ends with the first.

use super::{Action, Effect, EffectEstimate, Ideal};
use crate::simulate::scene::Scene;

/// Second ball.
pub(super) struct SecondBall;

impl Effect for SecondBall {
    fn name(&self) -> &'static str {
        "second_ball"
    }

    fn estimate(&self, scene: &Scene, _ideal: &Ideal) -> EffectEstimate {
        let contrast =
            |ball_grey: f64| (ball_grey - scene.look.background_grey).abs() + scene.look.highlight_grey;
        EffectEstimate::grey(
            scene.second_ball.map_or(0.0, |second| contrast(second.ball_grey)),
            "its contrast + highlight",
        )
    }

    fn action(&self, scene: &Scene) -> Action {
        scene.second_ball.map_or(Action::Nothing, Action::SecondBall)
    }
}
