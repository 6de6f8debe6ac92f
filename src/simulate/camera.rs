//! From the world to the picture: the ideal view, and the steps that warp it.
//!
//! The ideal picture is that of parallel light: u = u_0 + x/q, v = v_0 − z/q in a side view (y for z in a top view),
//! q metres a pixel. Perspective and lens distortion are steps on top ([`super::effects::Warp`]).

use super::effects::{Acting, Warp};
use super::scene::{Camera, Scene, View};
use crate::geometry::PixelPoint;
use nalgebra::{Matrix2, Vector2, Vector3};

/// An ellipse of the picture: the unit circle, times `axes`, plus `centre`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ellipse {
    /// px.
    pub centre: Vector2<f64>,
    /// px; columns are the images of (1, 0) and (0, 1).
    pub axes: Matrix2<f64>,
}

impl Ellipse {
    /// A circle.
    #[must_use]
    pub fn circle(centre: Vector2<f64>, radius_px: f64) -> Self {
        Self {
            centre,
            axes: Matrix2::identity() * radius_px,
        }
    }

    /// Half the width and half the height of the box around it, px.
    #[must_use]
    pub fn reach(&self) -> Vector2<f64> {
        Vector2::new(self.axes.row(0).norm(), self.axes.row(1).norm())
    }
}

/// The ball in the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outline {
    /// Image of the ball's centre; with perspective it is not the centre of the ellipse.
    pub centre: PixelPoint,
    /// Its edge.
    pub ellipse: Ellipse,
}

/// The way from the world into the picture.
pub struct PictureOf {
    camera: Camera,
    radius_m: f64,
    warps: Vec<Acting<dyn Warp>>,
}

impl PictureOf {
    /// The camera of `scene`, with `warps` in their order.
    #[must_use]
    pub fn new(scene: &Scene, warps: Vec<Acting<dyn Warp>>) -> Self {
        Self {
            camera: scene.camera.clone(),
            radius_m: scene.ball.radius_m,
            warps,
        }
    }

    /// The camera.
    #[must_use]
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The ball with its centre at `ball_m`.
    #[must_use]
    pub fn outline(&self, ball_m: &Vector3<f64>) -> Outline {
        let at = ideal_pixel(&self.camera, ball_m);
        let circle = Outline {
            centre: PixelPoint::new(at.x, at.y),
            ellipse: Ellipse::circle(at, self.radius_m / self.camera.metres_per_pixel),
        };
        self.warps
            .iter()
            .fold(circle, |outline, warp| warp.apply().warp(ball_m, &outline))
    }

    /// Whether a disc of `radius_px` around `centre` meets the picture.
    #[must_use]
    pub fn shows(&self, centre: PixelPoint, radius_px: f64) -> bool {
        let near = |x: f64, size: usize| x > -0.5 - radius_px && x < size as f64 - 0.5 + radius_px;
        near(centre.u_px, self.camera.width_px) && near(centre.v_px, self.camera.height_px)
    }

    /// Row of the floor line, px; `None` in a top view.
    #[must_use]
    pub fn floor_row_px(&self) -> Option<f64> {
        (self.camera.view == View::Side).then_some(self.camera.origin_px[1])
    }
}

/// Where a point of the world is in the ideal picture, px.
#[must_use]
pub fn ideal_pixel(camera: &Camera, point_m: &Vector3<f64>) -> Vector2<f64> {
    let plane = in_plane(camera.view, point_m) / camera.metres_per_pixel;
    Vector2::new(camera.origin_px[0] + plane.x, camera.origin_px[1] - plane.y)
}

/// The components along the picture: right and up.
#[must_use]
pub fn in_plane(view: View, vector: &Vector3<f64>) -> Vector2<f64> {
    match view {
        View::Side => Vector2::new(vector.x, vector.z),
        View::Top => Vector2::new(vector.x, vector.y),
    }
}

/// How much nearer to the camera than the calibrated plane a point is, m.
#[must_use]
pub fn nearness_m(camera: &Camera, point_m: &Vector3<f64>) -> f64 {
    match camera.view {
        // x right and z up leave y pointing away from the camera.
        View::Side => camera.plane_offset_m - point_m.y,
        View::Top => point_m.z,
    }
}

/// Where the optical axis goes through the picture: the lens's principal point, without a lens the middle, px.
#[must_use]
pub fn axis_px(camera: &Camera) -> Vector2<f64> {
    camera.lens.map_or_else(
        || Vector2::new(camera.width_px as f64 - 1.0, camera.height_px as f64 - 1.0) * 0.5,
        |lens| Vector2::new(lens.camera_matrix[0][2], lens.camera_matrix[1][2]),
    )
}

/// The component along the optical axis.
#[must_use]
pub fn along_axis(view: View, vector: &Vector3<f64>) -> f64 {
    match view {
        View::Side => vector.y,
        View::Top => vector.z,
    }
}

/// How far a small displacement (m) of a point moves its image, px, at most: δ/q in the plane, and with perspective
/// δ_axis ρ/Z besides. Of a velocity (m/s) it gives the speed in the picture, px/s.
#[must_use]
pub fn picture_shift_px(camera: &Camera, at_m: &Vector3<f64>, displacement: &Vector3<f64>) -> f64 {
    let along_px = in_plane(camera.view, displacement).norm() / camera.metres_per_pixel;
    let Some(distance_m) = camera.distance_m else {
        return along_px;
    };
    let depth = distance_m - nearness_m(camera, at_m);
    let magnification = distance_m / depth;
    let off_axis_px = (ideal_pixel(camera, at_m) - axis_px(camera)).norm() * magnification;
    along_px * magnification + off_axis_px * (along_axis(camera.view, displacement) / depth).abs()
}
