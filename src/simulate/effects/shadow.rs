//! The ball's shadow on the floor: dark and sharp where it touches, fainter, wider and further from the lamp as it rises.
//!
//! Depth S exp(−h/4R) for a ball h above the floor. In a side view the floor is seen at a grazing angle, so that the
//! shadow is a flat ellipse just below the floor line. The outline is soft over 0.5 to 1.5 of its size.

use super::{Action, BallMoment, Effect, EffectEstimate, Ideal, Layer};
use crate::simulate::camera::{Ellipse, PictureEdge};
use crate::simulate::render::{Backdrop, FineGrid};
use crate::simulate::scene::Scene;
use nalgebra::{Matrix2, Vector2, Vector3};
use std::ops::Range;

/// Cast shadow.
pub(super) struct Shadow;

/// How far the shadow moves for each metre of height: away from a lamp at the upper left.
const DRIFT: Vector3<f64> = Vector3::new(0.5, -0.35, 0.0);
/// Height over width of the shadow in a side view.
const FLATNESS: f64 = 0.16;
/// Where the soft outline ends, in sizes.
const OUTER: f64 = 1.5;

impl Effect for Shadow {
    fn name(&self) -> &'static str {
        "shadow"
    }

    fn estimate(&self, scene: &Scene, _ideal: &Ideal) -> EffectEstimate {
        EffectEstimate::grey(
            scene.look.shadow * scene.look.floor_grey,
            "share of the floor's grey below a ball at rest",
        )
    }

    fn action(&self, scene: &Scene) -> Action {
        if scene.look.shadow > 0.0 {
            Action::Layer(Box::new(Cast {
                depth: scene.look.shadow,
                radius_m: scene.ball.radius_m,
                metres_per_pixel: scene.camera.metres_per_pixel,
            }))
        } else {
            Action::Nothing
        }
    }
}

struct Cast {
    depth: f64,
    radius_m: f64,
    metres_per_pixel: f64,
}

impl Cast {
    /// Its outer edge.
    fn ellipse(&self, moment: &BallMoment<'_>) -> Ellipse {
        let height_m = self.height_m(moment);
        let floor = moment.picture.floor();
        let on_floor =
            floor.with_normal(&moment.ball_m, self.radius_m) + floor.out_of_frame(&DRIFT) * height_m;
        let below = moment.picture.outline(&on_floor).centre;
        let below = Vector2::new(below.u_px, below.v_px);
        let size_px = OUTER * (self.radius_m + 0.3 * height_m) / self.metres_per_pixel;
        let Some(PictureEdge { normal: into, .. }) = moment.picture.floor_line() else {
            return Ellipse::circle(below, size_px);
        };
        let touch_px = self.radius_m / self.metres_per_pixel;
        let along = Vector2::new(into.y, -into.x);
        Ellipse {
            centre: below + into * touch_px + into * (FLATNESS * size_px),
            axes: Matrix2::from_columns(&[along * size_px, into * (FLATNESS * size_px)]),
        }
    }

    fn height_m(&self, moment: &BallMoment<'_>) -> f64 {
        (moment.picture.floor().along_normal(&moment.ball_m) - self.radius_m).max(0.0)
    }
}

impl Layer for Cast {
    fn extent(&self, moment: &BallMoment<'_>) -> Option<(Vector2<f64>, Vector2<f64>)> {
        let ellipse = self.ellipse(moment);
        Some((ellipse.centre - ellipse.reach(), ellipse.centre + ellipse.reach()))
    }

    fn paint(&self, moment: &BallMoment<'_>, backdrop: &Backdrop, patch: &mut FineGrid, rows: Range<usize>) {
        let depth = (self.depth * (-self.height_m(moment) / (4.0 * self.radius_m)).exp()) as f32;
        let floor = backdrop.floor_line;
        patch.paint(&self.ellipse(moment), rows, |unit, at, grey| {
            if floor.is_some_and(|line| line.beyond_px(at) < 0.0) {
                return grey;
            }
            // 1 within 0.5 of the size, 0 beyond 1.5, a smooth step between.
            let t = ((OUTER * unit.norm() - 0.5) / (OUTER - 0.5)).clamp(0.0, 1.0) as f32;
            grey * (1.0 - depth * (1.0 - t * t * (3.0 - 2.0 * t)))
        });
    }
}
