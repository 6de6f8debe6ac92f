//! Perspective: what is nearer than the calibrated plane looks larger, and a ball off the optical axis has an elliptical
//! outline whose centre is not the image of the ball's centre.
//!
//! A pinhole at distance D from the calibrated plane, axis through the lens's principal point (without a lens, the
//! middle of the picture). A sphere of radius R whose centre is at depth Z and ρ off the axis has, with the focal length
//! f = D/q px,
//!
//! ```text
//! image of its centre      f ρ / Z
//! centre of the outline    f ρ Z / (Z² − R²)
//! half axes                f R sqrt(Z² + ρ² − R²) / (Z² − R²) along ρ,    f R / sqrt(Z² − R²) across
//! ```
//!
//! (the cone of tangents to the sphere, cut by the picture plane; e.g. Wong et al., IEEE TPAMI 2008).

use super::{Action, Effect, EffectEstimate, Ideal, Warp};
use crate::geometry::PixelPoint;
use crate::simulate::camera::{BallOutline, Ellipse, Facing, axis_px, ideal_pixel, nearness_m};
use crate::simulate::scene::{Camera, Scene};
use nalgebra::{Matrix2, Vector2, Vector3};

/// Perspective.
pub(super) struct Perspective;

impl Effect for Perspective {
    fn name(&self) -> &'static str {
        "perspective"
    }

    fn estimate(&self, scene: &Scene, ideal: &Ideal) -> EffectEstimate {
        let Some(distance_m) = scene.camera.distance_m else {
            return EffectEstimate::px(0.0, "ρ h/(D − h) + ρ (R/Z)²: camera infinitely far");
        };
        let middle = axis_px(&scene.camera);
        let shift = ideal.largest(|s| {
            let off_axis_px = (Vector2::new(s.pixel.u_px, s.pixel.v_px) - middle).norm();
            let nearness = nearness_m(&scene.camera, &s.state.position_m);
            // What spin or air may do to it besides.
            let farthest = nearness.abs() + ideal.wander_m;
            let depth = distance_m - nearness;
            off_axis_px * farthest / depth + off_axis_px * (scene.ball.radius_m / depth).powi(2)
        });
        EffectEstimate::px(
            shift,
            "ρ h/(D − h) for a ball h nearer than the calibrated plane, + ρ (R/Z)² for its outline; pinhole",
        )
    }

    fn action(&self, scene: &Scene) -> Action {
        scene.camera.distance_m.map_or(Action::Nothing, |distance_m| {
            Action::Warp(Box::new(Pinhole {
                camera: scene.camera.clone(),
                radius_m: scene.ball.radius_m,
                distance_m,
            }))
        })
    }
}

struct Pinhole {
    camera: Camera,
    radius_m: f64,
    distance_m: f64,
}

impl Warp for Pinhole {
    fn warp(&self, ball_m: &Vector3<f64>, outline: &BallOutline) -> BallOutline {
        let middle = axis_px(&self.camera);
        let depth = self.distance_m - nearness_m(&self.camera, ball_m);
        let off_axis = Vector2::new(outline.centre.u_px, outline.centre.v_px) - middle;
        let focal_px = self.distance_m / self.camera.metres_per_pixel;
        let rho_m = off_axis.norm() * self.camera.metres_per_pixel;
        let free = depth * depth - self.radius_m * self.radius_m;
        let along = off_axis.try_normalize(0.0).unwrap_or_else(Vector2::x);
        let across = Vector2::new(-along.y, along.x);
        let radial = focal_px * self.radius_m * (free + rho_m * rho_m).sqrt() / free;
        let tangential = focal_px * self.radius_m / free.sqrt();
        let turn = Matrix2::from_columns(&[along, across]);
        let centre = middle + off_axis * (self.distance_m / depth);
        BallOutline {
            centre: PixelPoint::new(centre.x, centre.y),
            ellipse: Ellipse {
                centre: middle + along * (focal_px * rho_m * depth / free),
                // Turned back at the end, so that the axes' first column still points right: shading needs that.
                axes: turn * Matrix2::from_diagonal(&Vector2::new(radial, tangential)) * turn.transpose(),
            },
        }
    }

    fn facing(&self, ball_m: &Vector3<f64>) -> Option<Facing> {
        let (middle, q) = (axis_px(&self.camera), self.camera.metres_per_pixel);
        let ideal = ideal_pixel(&self.camera, ball_m);
        let before = BallOutline {
            centre: PixelPoint::new(ideal.x, ideal.y),
            ellipse: Ellipse::circle(ideal, self.radius_m / q),
        };
        let seen = self.warp(ball_m, &before).ellipse;
        let across_m = (ideal - middle) * q;
        let depth_m = self.distance_m - nearness_m(&self.camera, ball_m);
        // A pixel is 1/f of the ray's length along the axis.
        let per_px = q / self.distance_m;
        Some(Facing::Pinhole {
            outline: Ellipse {
                centre: (seen.centre - middle) * per_px,
                axes: seen.axes * per_px,
            },
            centre: Vector3::new(across_m.x, -across_m.y, -depth_m) / self.radius_m,
        })
    }
}
