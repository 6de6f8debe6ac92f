//! A camera rolled about its optical axis: the picture turns about the point where the axis goes through it. Positive where
//! the world's "up" leans to the right: `up_px` = (sin r, −cos r).
//!
//! After perspective and before the lens, whose distortion belongs to the sensor. What hangs in the world turns with it (floor
//! line, bench, shadow, the ball's lamp); texture and uneven light, which are given in the picture, stay.

use super::{Action, Effect, EffectEstimate, Ideal, Warp};
use crate::geometry::PixelPoint;
use crate::simulate::camera::{BallOutline, Ellipse, PictureEdge, axis_px, rolled};
use crate::simulate::scene::Scene;
use nalgebra::{Matrix2, Vector2, Vector3};

/// Camera roll.
pub(super) struct CameraRoll;

impl Effect for CameraRoll {
    fn name(&self) -> &'static str {
        "camera_roll"
    }

    fn is_of_the_ideal(&self) -> bool {
        true
    }

    fn estimate(&self, scene: &Scene, ideal: &Ideal) -> EffectEstimate {
        let axis = axis_px(&scene.camera);
        let chord = 2.0 * (0.5 * scene.camera.roll_rad).sin().abs();
        let shift = ideal.largest(|s| chord * (Vector2::new(s.pixel.u_px, s.pixel.v_px) - axis).norm());
        EffectEstimate::px(shift, "2 ρ sin(r/2), ρ off the optical axis")
    }

    fn action(&self, scene: &Scene) -> Action {
        if scene.camera.roll_rad == 0.0 {
            return Action::Nothing;
        }
        Action::Warp(Box::new(Turn {
            axis_px: axis_px(&scene.camera),
            turn: rolled(scene.camera.roll_rad),
        }))
    }
}

struct Turn {
    axis_px: Vector2<f64>,
    turn: Matrix2<f64>,
}

impl Turn {
    fn point(&self, at: Vector2<f64>) -> Vector2<f64> {
        self.axis_px + self.turn * (at - self.axis_px)
    }
}

impl Warp for Turn {
    fn warp(&self, _ball_m: &Vector3<f64>, outline: &BallOutline) -> BallOutline {
        let centre = self.point(Vector2::new(outline.centre.u_px, outline.centre.v_px));
        BallOutline {
            centre: PixelPoint::new(centre.x, centre.y),
            ellipse: Ellipse {
                centre: self.point(outline.ellipse.centre),
                // The ball's own axes turn with it, so that its lamp stays where it is in the world.
                axes: self.turn * outline.ellipse.axes,
            },
        }
    }

    fn warp_line(&self, line: &PictureEdge) -> PictureEdge {
        PictureEdge {
            at: self.point(line.at),
            normal: self.turn * line.normal,
        }
    }
}
