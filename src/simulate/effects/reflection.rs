//! The floor mirrors the ball: its image below the floor line, mixed in with the floor's reflectance.
//!
//! In a side view only; a camera that looks down sees the reflection behind the ball. The mirrored ball is painted
//! where it is below the floor line.

use super::{Action, BallMoment, Effect, EffectEstimate, Ideal, Layer};
use crate::simulate::camera::BallOutline;
use crate::simulate::render::{Backdrop, FineGrid, normal};
use crate::simulate::scene::{Scene, View};
use nalgebra::{Vector2, Vector3};
use std::ops::Range;

/// Floor reflection.
pub(super) struct Reflection;

impl Effect for Reflection {
    fn name(&self) -> &'static str {
        "reflection"
    }

    fn estimate(&self, scene: &Scene, _ideal: &Ideal) -> EffectEstimate {
        let seen = if scene.camera.view == View::Side {
            scene.look.reflection
        } else {
            0.0
        };
        let contrast = (scene.look.ball_grey - scene.look.floor_grey).abs() + scene.look.highlight_grey;
        EffectEstimate::grey(
            seen * contrast,
            "reflectance × (contrast + highlight); side view only",
        )
    }

    fn action(&self, scene: &Scene) -> Action {
        if scene.camera.view == View::Side && scene.look.reflection > 0.0 {
            Action::Layer(Box::new(Mirror {
                share: scene.look.reflection as f32,
            }))
        } else {
            Action::Nothing
        }
    }
}

struct Mirror {
    share: f32,
}

impl Mirror {
    fn image(&self, moment: &BallMoment<'_>) -> BallOutline {
        moment
            .picture
            .outline(&moment.picture.floor().mirrored(&moment.ball_m))
    }
}

impl Layer for Mirror {
    fn extent(&self, moment: &BallMoment<'_>) -> Option<(Vector2<f64>, Vector2<f64>)> {
        let ellipse = self.image(moment).ellipse;
        Some((ellipse.centre - ellipse.reach(), ellipse.centre + ellipse.reach()))
    }

    fn paint(&self, moment: &BallMoment<'_>, backdrop: &Backdrop, patch: &mut FineGrid, rows: Range<usize>) {
        let Some(floor) = backdrop.floor_line else {
            return;
        };
        // Away from the floor (right, down), in the ball's axes.
        let away = moment.picture.floor().out_of_frame(&Vector3::z());
        let away = Vector2::new(away.x, -away.z);
        let image = self.image(moment).ellipse;
        let marks = moment.mirrored_marks(&image, patch.side_px());
        patch.paint(&image, rows, |unit, at, grey| {
            if floor.beyond_px(at) < 0.0 {
                return grey;
            }
            // What the mirror shows below is above on the ball.
            let upright = normal(unit - away * (2.0 * unit.dot(&away)));
            let albedo = marks.as_ref().map_or(1.0, |marks| marks.albedo(unit));
            grey + self.share * ((albedo * moment.surface.grey(&upright)) as f32 - grey)
        });
    }
}
