//! From the world to the picture: the ideal view, and the steps that warp it.
//!
//! The ideal picture is that of parallel light: u = u_0 + x/q, v = v_0 − z/q in a side view (y for z in a top view),
//! q metres a pixel. Perspective and lens distortion are steps on top ([`super::effects::Warp`]).
//!
//! A camera that does not look at the plane squarely is turned about the picture's vertical by τ: with d the way to the right
//! and n that towards the camera from the point of the plane in the picture's middle, it sees d cos τ − n sin τ and
//! d sin τ + n cos τ in their place. One that is pitched is then turned about the picture's horizontal by ψ: in place of the way up h
//! and n it sees h cos ψ − n sin ψ and h sin ψ + n cos ψ, so that for ψ > 0 (it looks down) the top of the plane is the nearer.
//!
//! The ball moves in a vertical plane of its own. Where `launch.azimuth_deg` turns that by a from the calibrated one, about the
//! vertical through x = y = 0, a way d along the ball's plane is d cos a along the calibrated one and d sin a nearer to the camera.

use super::effects::{Acting, Plane, Warp};
use super::scene::{Camera, Scene, View};
use crate::geometry::PixelPoint;
use nalgebra::{Matrix2, Matrix3, Rotation3, Vector2, Vector3};

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

/// A straight edge in the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PictureEdge {
    /// A point of it, px.
    pub at: Vector2<f64>,
    /// Across it, of length 1: towards what is beyond.
    pub normal: Vector2<f64>,
}

impl PictureEdge {
    /// Through two points, with `inside` not beyond it; `None` where the points are the same.
    #[must_use]
    pub fn through(from: Vector2<f64>, to: Vector2<f64>, inside: Vector2<f64>) -> Option<Self> {
        let along = (to - from).try_normalize(0.0)?;
        let across = Vector2::new(-along.y, along.x);
        let outward = if across.dot(&(inside - from)) > 0.0 {
            -across
        } else {
            across
        };
        Some(Self {
            at: from,
            normal: outward,
        })
    }

    /// How far a point is beyond it, px; below 0 on the near side.
    #[must_use]
    pub fn beyond_px(&self, point: Vector2<f64>) -> f64 {
        self.normal.dot(&(point - self.at))
    }
}

/// The ball in the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BallOutline {
    /// Image of the ball's centre; with perspective it is not the centre of the ellipse.
    pub centre: PixelPoint,
    /// Its edge.
    pub ellipse: Ellipse,
}

/// How the surface of a ball lies in its outline.
#[derive(Debug, Clone, Copy)]
pub enum Facing {
    /// In parallel light: an orthographic view.
    Parallel,
    /// A pinhole sees less than half of it, around the line of sight to the ball.
    Pinhole {
        /// The outline, before the picture is rolled and distorted, in lengths of the ray from the pinhole that goes 1 towards the
        /// picture: (right, down).
        outline: Ellipse,
        /// The ball's centre from the pinhole (right, up, towards the camera), over its radius.
        centre: Vector3<f64>,
    },
}

impl Facing {
    /// The direction from the ball to the camera, along the same axes as [`Facing::normal`].
    #[must_use]
    pub fn towards(&self) -> Vector3<f64> {
        match self {
            Self::Parallel => Vector3::z(),
            Self::Pinhole { centre, .. } => -centre.normalize(),
        }
    }

    /// Outward normal (right, up, towards the camera) of what is seen at a place in the ball's outline (right, down; the rim at 1). It is
    /// along the axes of the camera before that is rolled.
    #[must_use]
    pub fn normal(&self, unit: Vector2<f64>) -> Vector3<f64> {
        let unit = if unit.norm_squared() > 1.0 {
            unit.normalize()
        } else {
            unit
        };
        match self {
            Self::Parallel => Vector3::new(unit.x, -unit.y, (1.0 - unit.norm_squared()).max(0.0).sqrt()),
            Self::Pinhole { outline, centre } => {
                let at = outline.centre + outline.axes * unit;
                let ray = Vector3::new(at.x, -at.y, -1.0);
                // Where |s ray − centre| = 1 first; 0 under the root at the rim.
                let (squared, along) = (ray.norm_squared(), ray.dot(centre));
                let root = (along * along - squared * (centre.norm_squared() - 1.0))
                    .max(0.0)
                    .sqrt();
                (ray * ((along - root) / squared) - centre).normalize()
            }
        }
    }
}

/// The way from the world into the picture.
pub struct PictureOf {
    camera: Camera,
    radius_m: f64,
    floor: Plane,
    warps: Vec<Acting<dyn Warp>>,
}

impl PictureOf {
    /// The camera of `scene`, with `warps` in their order, before a level floor.
    #[must_use]
    pub fn new(scene: &Scene, warps: Vec<Acting<dyn Warp>>) -> Self {
        Self {
            camera: scene.camera.clone(),
            radius_m: scene.ball.radius_m,
            floor: Plane::LEVEL,
            warps,
        }
    }

    /// The same before another floor.
    #[must_use]
    pub fn before(self, floor: Plane) -> Self {
        Self { floor, ..self }
    }

    /// The floor.
    #[must_use]
    pub fn floor(&self) -> &Plane {
        &self.floor
    }

    /// The camera.
    #[must_use]
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The ball with its centre at `ball_m`.
    #[must_use]
    pub fn outline(&self, ball_m: &Vector3<f64>) -> BallOutline {
        let at = ideal_pixel(&self.camera, ball_m);
        let circle = BallOutline {
            centre: PixelPoint::new(at.x, at.y),
            ellipse: Ellipse::circle(at, self.radius_m / self.camera.metres_per_pixel),
        };
        self.warps
            .iter()
            .fold(circle, |outline, warp| warp.apply().warp(ball_m, &outline))
    }

    /// How a ball with its centre at `ball_m` lies in its outline.
    #[must_use]
    pub fn facing(&self, ball_m: &Vector3<f64>) -> Facing {
        let facings = self.warps.iter().map(|warp| warp.apply().facing(ball_m));
        facings.flatten().next().unwrap_or(Facing::Parallel)
    }

    /// Whether a disc of `radius_px` around `centre` meets the picture.
    #[must_use]
    pub fn shows(&self, centre: PixelPoint, radius_px: f64) -> bool {
        let near = |x: f64, size: usize| x > -0.5 - radius_px && x < size as f64 - 0.5 + radius_px;
        near(centre.u_px, self.camera.width_px) && near(centre.v_px, self.camera.height_px)
    }

    /// The direction in which the floor meets the calibrated plane, in the ball's own plane of motion and its normal.
    fn floor_along(&self, camera: &Camera) -> Vector3<f64> {
        if camera.motion_azimuth_rad == 0.0 {
            return self.floor.out_of_frame(&Vector3::x());
        }
        let (sin, cos) = camera.motion_azimuth_rad.sin_cos();
        Vector3::new(cos, sin, self.floor.slope_rad().tan() * cos)
    }

    /// The floor line, with the floor beyond it; `None` in a top view.
    #[must_use]
    pub fn floor_line(&self) -> Option<PictureEdge> {
        let camera = &self.camera;
        let ideal = match camera.view {
            View::Top => return None,
            View::Side if self.floor.is_level() && camera.pitch_rad == 0.0 => PictureEdge {
                at: Vector2::from(camera.origin_px),
                normal: Vector2::y(),
            },
            View::Side => {
                let along = seen(camera, &self.floor_along(camera));
                PictureEdge {
                    at: ideal_pixel(camera, &origin_m(camera)),
                    // Downhill of (right, down) turned by a quarter; never 0, as a camera is turned by less than that.
                    normal: Vector2::new(along.y, along.x).normalize(),
                }
            }
        };
        let warped = |line: PictureEdge, warp: &Acting<dyn Warp>| warp.apply().warp_line(&line);
        let line = self.warps.iter().fold(ideal, warped);
        if camera.pitch_rad == 0.0 {
            return Some(line);
        }
        // Perspective moves a line of a plane that is not looked at squarely.
        let origin = self.outline(&origin_m(camera)).centre;
        let at = Vector2::new(origin.u_px, origin.v_px);
        Some(PictureEdge { at, ..line })
    }
}

/// Where a point of the world is in the ideal picture, px.
#[must_use]
pub fn ideal_pixel(camera: &Camera, point_m: &Vector3<f64>) -> Vector2<f64> {
    let seen = turned(camera, &from_middle(camera, point_m)) / camera.metres_per_pixel;
    axis_px(camera) + Vector2::new(seen.x, -seen.y)
}

/// The way from the point of the calibrated plane in the picture's middle: right, up and towards the camera, before that
/// is turned, m.
fn from_middle(camera: &Camera, point_m: &Vector3<f64>) -> Vector3<f64> {
    let point_m = along_calibrated(camera, point_m);
    let plane = in_plane(camera.view, &point_m) - axis_m(camera);
    let towards = match camera.view {
        // x right and z up leave y pointing away from the camera.
        View::Side => camera.plane_offset_m - point_m.y,
        View::Top => point_m.z,
    };
    Vector3::new(plane.x, plane.y, towards)
}

/// The point of the calibrated plane in the picture's middle: right and up of the origin, m.
#[must_use]
pub fn axis_m(camera: &Camera) -> Vector2<f64> {
    let from_origin = axis_px(camera) - Vector2::from(camera.origin_px);
    Vector2::new(from_origin.x, -from_origin.y) * camera.metres_per_pixel
}

/// What a camera rolled by `roll_rad` about its axis does to directions (right, down) of the picture.
#[must_use]
pub fn rolled(roll_rad: f64) -> Matrix2<f64> {
    let (sin, cos) = roll_rad.sin_cos();
    Matrix2::new(cos, -sin, sin, cos)
}

/// A vector (right, up, towards the camera) as the turned camera sees it.
fn turned(camera: &Camera, v: &Vector3<f64>) -> Vector3<f64> {
    let mut v = *v;
    if camera.tilt_rad != 0.0 {
        let (sin, cos) = camera.tilt_rad.sin_cos();
        v = Vector3::new(v.x * cos - v.z * sin, v.y, v.x * sin + v.z * cos);
    }
    if camera.pitch_rad != 0.0 {
        let (sin, cos) = camera.pitch_rad.sin_cos();
        v = Vector3::new(v.x, v.y * cos - v.z * sin, v.y * sin + v.z * cos);
    }
    v
}

/// A vector of the ball's own plane of motion (x along the launch, y, z) by its components along the calibrated plane, away from
/// the camera, and up.
#[must_use]
pub fn along_calibrated(camera: &Camera, v: &Vector3<f64>) -> Vector3<f64> {
    if camera.motion_azimuth_rad == 0.0 {
        return *v;
    }
    let (sin, cos) = camera.motion_azimuth_rad.sin_cos();
    Vector3::new(v.x * cos + v.y * sin, v.y * cos - v.x * sin, v.z)
}

/// The origin of the calibrated plane, in the ball's own plane of motion and its normal, m.
#[must_use]
pub fn origin_m(camera: &Camera) -> Vector3<f64> {
    let offset_m = match camera.view {
        View::Side => camera.plane_offset_m,
        View::Top => 0.0,
    };
    let (sin, cos) = camera.motion_azimuth_rad.sin_cos();
    // 0 and not -0 where nothing is turned.
    Vector3::new(0.0 - offset_m * sin, offset_m * cos, 0.0)
}

/// The components along the picture: right and up.
#[must_use]
pub fn in_plane(view: View, vector: &Vector3<f64>) -> Vector2<f64> {
    match view {
        View::Side => Vector2::new(vector.x, vector.z),
        View::Top => Vector2::new(vector.x, vector.y),
    }
}

/// How much nearer to the camera a point is than the calibrated plane in the picture's middle, m.
#[must_use]
pub fn nearness_m(camera: &Camera, point_m: &Vector3<f64>) -> f64 {
    turned(camera, &from_middle(camera, point_m)).z
}

/// Where the optical axis goes through the picture: the lens's principal point, without a lens the middle, px.
#[must_use]
pub fn axis_px(camera: &Camera) -> Vector2<f64> {
    camera.lens.map_or_else(
        || Vector2::new(camera.width_px as f64 - 1.0, camera.height_px as f64 - 1.0) * 0.5,
        |lens| Vector2::new(lens.camera_matrix[0][2], lens.camera_matrix[1][2]),
    )
}

/// The component of a displacement towards the camera.
#[must_use]
pub fn along_axis(camera: &Camera, vector: &Vector3<f64>) -> f64 {
    seen(camera, vector).z
}

/// A displacement of the world as the camera sees it: right, up and towards it.
fn seen(camera: &Camera, vector: &Vector3<f64>) -> Vector3<f64> {
    let vector = &along_calibrated(camera, vector);
    let plane = in_plane(camera.view, vector);
    let towards = match camera.view {
        View::Side => -vector.y,
        View::Top => vector.z,
    };
    turned(camera, &Vector3::new(plane.x, plane.y, towards))
}

/// The rotation from the axes of the ball's own plane of motion (x along the launch, z up) into those of the camera (right, up, towards
/// it), before it is rolled.
#[must_use]
pub fn camera_from_motion(camera: &Camera) -> Rotation3<f64> {
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| seen(camera, &axis));
    Rotation3::from_matrix_unchecked(Matrix3::from_columns(&axes))
}

/// How far a small displacement (m) of a point moves its image, px, at most: δ/q in the plane, and with perspective
/// δ_axis ρ/Z besides. Of a velocity (m/s) it gives the speed in the picture, px/s.
#[must_use]
pub fn picture_shift_px(camera: &Camera, at_m: &Vector3<f64>, displacement: &Vector3<f64>) -> f64 {
    let displacement = seen(camera, displacement);
    let along_px = displacement.xy().norm() / camera.metres_per_pixel;
    let Some(distance_m) = camera.distance_m else {
        return along_px;
    };
    let depth = distance_m - nearness_m(camera, at_m);
    let magnification = distance_m / depth;
    let off_axis_px = (ideal_pixel(camera, at_m) - axis_px(camera)).norm() * magnification;
    along_px * magnification + off_axis_px * (displacement.z / depth).abs()
}
