//! Marks on the ball, which turn with it: the brightness of its surface is that of a plain ball times their albedo, the highlight
//! too. Light and shade stay where they are.

use super::{Action, Effect, EffectEstimate, Ideal};
use crate::simulate::scene::Scene;

/// Marks.
pub(super) struct MarkedBall;

impl Effect for MarkedBall {
    fn name(&self) -> &'static str {
        "marks"
    }

    fn estimate(&self, scene: &Scene, _ideal: &Ideal) -> EffectEstimate {
        let look = &scene.look;
        let contrast = look.marks.as_ref().map_or(0.0, |marks| marks.contrast());
        EffectEstimate::grey(
            contrast * (look.ball_grey + look.highlight_grey),
            "|1 − albedo| × (ball + highlight)",
        )
    }

    fn action(&self, scene: &Scene) -> Action {
        match &scene.look.marks {
            Some(marks) => Action::Marks(Box::new(marks.clone())),
            None => Action::Nothing,
        }
    }
}
