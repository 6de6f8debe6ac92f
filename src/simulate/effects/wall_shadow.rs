//! The ball's shadow on a wall behind it: a soft dark disc that goes with the ball, always as far aside.
//!
//! Light from far away on a wall parallel to the plane of motion throws a shadow of the ball's size at a constant offset; a lamp that
//! is not a point softens its edge. The wall ends at the floor line, and so does the shadow. Depth times the share of the
//! lamp that the ball hides, for which the profile of a straight edge stands: right for an edge that is soft over less than R.

use super::{Action, BallMoment, Effect, EffectEstimate, Ideal, Layer};
use crate::simulate::camera::Ellipse;
use crate::simulate::render::{Backdrop, FineGrid, gaussian_below};
use crate::simulate::scene::{Scene, SceneWallShadow, View};
use nalgebra::Vector2;
use std::ops::Range;

/// Shadow on the wall.
pub(super) struct WallShadow;

/// Standard deviations after which the soft edge is over.
const REACH: f64 = 3.5;

impl Effect for WallShadow {
    fn name(&self) -> &'static str {
        "wall_shadow"
    }

    fn estimate(&self, scene: &Scene, _ideal: &Ideal) -> EffectEstimate {
        let depth = scene.look.wall_shadow.map_or(0.0, |shadow| shadow.depth_grey);
        EffectEstimate::grey(
            depth,
            "how much darker the wall is where no light of the lamp falls",
        )
    }

    fn action(&self, scene: &Scene) -> Action {
        match scene.look.wall_shadow {
            Some(shadow) if shadow.depth_grey > 0.0 && scene.camera.view == View::Side => {
                Action::Layer(Box::new(OnWall { shadow }))
            }
            _ => Action::Nothing,
        }
    }
}

struct OnWall {
    shadow: SceneWallShadow,
}

impl OnWall {
    /// The outline of the ball, moved, and how much larger the ellipse is in which anything is dark.
    fn outline(&self, moment: &BallMoment<'_>) -> (Ellipse, f64, f64) {
        let ball = &moment.outline.ellipse;
        let radius_px = ball.axes.determinant().abs().sqrt();
        let larger = 1.0 + REACH * self.shadow.blur_px / radius_px;
        let ellipse = Ellipse {
            centre: ball.centre + self.shadow.offset_px,
            axes: ball.axes * larger,
        };
        (ellipse, larger, radius_px)
    }
}

impl Layer for OnWall {
    fn extent(&self, moment: &BallMoment<'_>) -> Option<(Vector2<f64>, Vector2<f64>)> {
        let (ellipse, ..) = self.outline(moment);
        Some((ellipse.centre - ellipse.reach(), ellipse.centre + ellipse.reach()))
    }

    fn paint(&self, moment: &BallMoment<'_>, backdrop: &Backdrop, patch: &mut FineGrid, rows: Range<usize>) {
        let (ellipse, larger, radius_px) = self.outline(moment);
        let floor = backdrop.floor_line;
        patch.paint(&ellipse, rows, |unit, at, grey| {
            if floor.is_some_and(|line| line.beyond_px(at) > 0.0) {
                return grey;
            }
            let inside_px = radius_px * (1.0 - larger * unit.norm());
            let dark = if self.shadow.blur_px > 0.0 {
                gaussian_below(inside_px / self.shadow.blur_px)
            } else {
                1.0
            };
            (grey - (self.shadow.depth_grey * dark) as f32).max(0.0)
        });
    }
}
