//! The plane of motion from the board standing in it.
//!
//! With the pose (R, t) of the board and the camera's matrix K, a point (X, Y) of the board is at the undistorted pixel
//! K [r₁ r₂ t] (X, Y, 1)ᵀ. The inverse of that homography, turned so that the board's upright edge is "up" and moved to
//! the marked origin, is `world_from_pixel`. It rests on six numbers of the pose beside the lens, where a homography
//! fitted freely would have eight: beyond the board's rim that tells.

use super::bundle::JointCovariance;
use super::error::BoardError;
use super::lens_fit::lens;
use super::pattern::Pattern;
use super::principal_deviations;
use super::projection::{CameraParameters, POSE, Pose};
use crate::calibration::{Calibration, Deviation, Homography, Lens, Scale};
use crate::geometry::PixelPoint;
use nalgebra::{DMatrix, DVector, Matrix3, SVector, Vector2, Vector3};

/// The board may lean this far from "up"; nearer to half a right angle another edge may be meant.
const LARGEST_LEAN_RAD: f64 = 30.0 * std::f64::consts::PI / 180.0;
/// Columns and rows of points over which deviations are judged.
const GRID: (usize, usize) = (9, 6);

/// What is marked in the picture of the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneMarks {
    /// Roughly "up" in the picture, to tell the board's upright edge; (0, −1) for a camera held upright.
    pub up_px: [f64; 2],
    /// A point at the height of the floor, as the picture shows it.
    pub floor: Option<PixelPoint>,
    /// A point at the x of the launch edge.
    pub edge: Option<PixelPoint>,
}

impl Default for PlaneMarks {
    fn default() -> Self {
        Self {
            up_px: [0.0, -1.0],
            floor: None,
            edge: None,
        }
    }
}

/// The plane of motion.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionPlane {
    /// World from undistorted pixels. Without a mark for the floor its origin is the board's lower left inner corner.
    pub homography: Homography,
    /// Angle between the board and the picture, rad: 0 for a camera that looks at the plane squarely.
    pub tilt_rad: f64,
    /// Angle between the board's upright edge and `up_px` in the picture, rad; clockwise positive.
    pub lean_rad: f64,
    /// From the camera along its optical axis to the plane, m: what [`Calibration::distance_m`](crate::calibration::Calibration::distance_m)
    /// is.
    pub distance_m: f64,
    /// How lens and homography may be off together.
    pub deviations: Vec<Deviation>,
}

/// A board as a camera of known lens sees it.
#[derive(Clone, Copy)]
pub(super) struct PosedBoard<'a> {
    /// The lens's nine numbers.
    pub camera: CameraParameters,
    /// The same as a lens.
    pub lens: &'a Lens,
    /// Width and height of the picture.
    pub size_px: (usize, usize),
    /// Where the board is.
    pub pose: Pose,
    /// Covariance of camera and pose.
    pub joint: &'a JointCovariance,
}

/// The board's axes as the world's: unit vectors on the board, and the world's origin there.
#[derive(Debug, Clone, Copy)]
struct BoardAxes {
    right: Vector2<f64>,
    up: Vector2<f64>,
}

impl MotionPlane {
    /// From the board's pose in the picture `name` and its covariance together with the camera's.
    pub(super) fn new(
        name: &str,
        seen: &PosedBoard<'_>,
        pattern: &Pattern,
        marks: &PlaneMarks,
    ) -> Result<Self, BoardError> {
        let PosedBoard {
            camera,
            lens,
            size_px,
            pose,
            joint,
        } = *seen;
        let middle = 0.5 * pattern.place_m(pattern.corners.0 * pattern.corners.1 - 1);
        let (axes, lean_rad) = upright(&camera, &pose, &middle, marks.up_px);
        if lean_rad.abs() > LARGEST_LEAN_RAD {
            return Err(BoardError::Askew {
                name: name.to_owned(),
                lean_deg: lean_rad.abs().to_degrees(),
            });
        }
        let setting = PlaneGeometry {
            axes,
            corner_m: lower_left(pattern, &axes),
            marks: *marks,
            size: size_px,
        };
        let known = marks.floor.is_some();
        let world_from_pixel = setting.world_from_pixel(&camera, lens, &pose)?;
        let homography = Homography {
            world_from_pixel,
            relative_std: pattern.square_std_m.map(|s| s / pattern.square_m),
            origin_known: known,
        };
        let deviations = setting.deviations(&camera, &pose, joint).unwrap_or_default();
        let normal = pose.rotation * Vector3::z();
        Ok(Self {
            homography,
            tilt_rad: pose.tilt_rad(),
            lean_rad,
            // Along the board's normal it is n · t; the axis meets the plane 1/n_z further on.
            distance_m: (normal.dot(&pose.shift_m) / normal.z).abs(),
            deviations,
        })
    }
}

/// The edge of the board nearest to `up_px` as the picture shows it, and how far it leans from there.
fn upright(
    camera: &CameraParameters,
    pose: &Pose,
    middle: &Vector2<f64>,
    up_px: [f64; 2],
) -> (BoardAxes, f64) {
    let h = pose.pixel_from_board(camera);
    let pixel = |p: Vector2<f64>| {
        let q = h * Vector3::new(p.x, p.y, 1.0);
        Vector2::new(q.x / q.z, q.y / q.z)
    };
    let step = 1e-3 * middle.norm();
    let seen = |direction: Vector2<f64>| (pixel(middle + direction * step) - pixel(*middle)).normalize();
    let hint = Vector2::new(up_px[0], up_px[1]).normalize();
    let edges = [Vector2::x(), Vector2::y(), -Vector2::x(), -Vector2::y()];
    let up = edges
        .into_iter()
        .max_by(|a, b| seen(*a).dot(&hint).total_cmp(&seen(*b).dot(&hint)))
        .unwrap_or(Vector2::y());
    // Clockwise from "up" in the picture is right: of the two directions across, the one that the picture shows there.
    let across = Vector2::new(up.y, -up.x);
    let clockwise = |a: Vector2<f64>, b: Vector2<f64>| a.x * b.y - a.y * b.x;
    let right = if clockwise(seen(up), seen(across)) > 0.0 {
        across
    } else {
        -across
    };
    let lean = clockwise(hint, seen(up)).atan2(hint.dot(&seen(up)));
    (BoardAxes { right, up }, lean)
}

fn lower_left(pattern: &Pattern, axes: &BoardAxes) -> Vector2<f64> {
    let (columns, rows) = pattern.corners;
    let low = |p: &Vector2<f64>| p.dot(&axes.right) + p.dot(&axes.up);
    [0, columns - 1, columns * (rows - 1), columns * rows - 1]
        .map(|i| pattern.place_m(i))
        .into_iter()
        .min_by(|a, b| low(a).total_cmp(&low(b)))
        .unwrap_or_else(Vector2::zeros)
}

/// What turns a pose into a homography, beside the numbers that are fitted.
struct PlaneGeometry {
    axes: BoardAxes,
    corner_m: Vector2<f64>,
    marks: PlaneMarks,
    size: (usize, usize),
}

impl PlaneGeometry {
    fn world_from_pixel(
        &self,
        camera: &CameraParameters,
        lens: &Lens,
        pose: &Pose,
    ) -> Result<Matrix3<f64>, BoardError> {
        let board_from_pixel = pose
            .pixel_from_board(camera)
            .try_inverse()
            .ok_or_else(|| BoardError::not_determined(None, 1))?;
        let middle = PixelPoint::new(0.5 * (self.size.0 as f64 - 1.0), 0.5 * (self.size.1 as f64 - 1.0));
        // The side of the horizon that the picture's middle is on.
        let side = (board_from_pixel * Vector3::new(middle.u_px, middle.v_px, 1.0))
            .z
            .signum();
        let place = |mark: &'static str, seen: PixelPoint| {
            let wrong = |why| BoardError::Mark {
                mark,
                u: seen.u_px,
                v: seen.v_px,
                why,
            };
            let p = lens
                .undistort(seen)
                .ok_or_else(|| wrong("the lens has no place for it; mark a point inside the picture"))?;
            let q = board_from_pixel * Vector3::new(p.u_px, p.v_px, 1.0);
            if !(q.z * side > 0.0) {
                return Err(wrong("it is beyond the horizon of that plane"));
            }
            Ok(Vector2::new(q.x / q.z, q.y / q.z))
        };
        let BoardAxes { right, up } = self.axes;
        let PlaneMarks { floor, edge, .. } = self.marks;
        // Both in one is how --origin says it.
        let (of_floor, of_edge) = if floor == edge {
            ("--origin", "--origin")
        } else {
            ("--floor", "--edge")
        };
        let floor = floor.map(|p| place(of_floor, p)).transpose()?;
        let edge = edge.map(|p| place(of_edge, p)).transpose()?;
        let low = floor.unwrap_or(self.corner_m);
        let left = edge.unwrap_or(low);
        let world_from_board = Matrix3::new(
            right.x,
            right.y,
            -right.dot(&left),
            up.x,
            up.y,
            -up.dot(&low),
            0.0,
            0.0,
            1.0,
        );
        let h = world_from_board * board_from_pixel;
        // w = 1 in the picture's middle: numbers of a readable size.
        Ok(h / (h.row(2) * Vector3::new(middle.u_px, middle.v_px, 1.0))[0])
    }

    /// θ: the camera's nine numbers, the pose's six.
    fn deviations(
        &self,
        camera: &CameraParameters,
        pose: &Pose,
        joint: &JointCovariance,
    ) -> Option<Vec<Deviation>> {
        let covariance = DMatrix::from_fn(15, 15, |i, j| joint[(i, j)]);
        let numbers = |theta: &DVector<f64>| {
            let camera = camera + CameraParameters::from_iterator(theta.rows(0, 9).iter().copied());
            let pose = pose.stepped(&SVector::from_iterator(theta.rows(9, POSE).iter().copied()));
            let h = self.world_from_pixel(&camera, &lens(&camera)?, &pose).ok()?;
            Some((camera, Some(h)))
        };
        // Pixels that a metre has in the picture's middle make the effect one in pixels.
        let best = self.places(&numbers(&DVector::zeros(15))?)?;
        let width: Vec<f64> = best.iter().step_by(2).copied().collect();
        let spread = |x: &[f64]| {
            x.iter().copied().fold(f64::NEG_INFINITY, f64::max)
                - x.iter().copied().fold(f64::INFINITY, f64::min)
        };
        let px_per_m = self.size.0 as f64 / spread(&width);
        principal_deviations::principal(&covariance, numbers, |n| {
            Some(self.places(n)?.iter().map(|x| x * px_per_m).collect())
        })
    }

    /// World places of a grid of pixels, as far as the plane reaches, m.
    fn places(&self, (camera, h): &principal_deviations::LensAndHomography) -> Option<Vec<f64>> {
        let mut calibration = Calibration::new(Scale::Homography((*h.as_ref()?).into()));
        calibration.lens = Some(lens(camera)?);
        calibration.image_size_px = Some(self.size);
        let map = calibration.rectification().ok()?;
        let cells = (0..GRID.1).flat_map(|j| (0..GRID.0).map(move |i| (i, j)));
        let mut places = Vec::new();
        for (i, j) in cells {
            let at =
                |k: usize, cells: usize, size: usize| (k as f64 + 0.5) / cells as f64 * size as f64 - 0.5;
            let p = PixelPoint::new(at(i, GRID.0, self.size.0), at(j, GRID.1, self.size.1));
            // A cell beyond the horizon is 0 in all: it has no say.
            let place = map.plane_from_pixel(p);
            places.extend(place.map_or([0.0, 0.0], |p| [p.right, p.up]));
        }
        Some(places)
    }
}

/// Deviations of a lens alone, by what they do to the directions of sight over the picture (px at the focal length).
pub(super) fn lens_deviations(fit: &super::lens_fit::LensFit, size: (usize, usize)) -> Vec<Deviation> {
    let covariance = DMatrix::from_fn(9, 9, |i, j| fit.covariance[(i, j)]);
    let numbers = |theta: &DVector<f64>| {
        let camera = fit.camera + CameraParameters::from_iterator(theta.iter().copied());
        Some((camera, None))
    };
    let focal = fit.camera[0];
    let effect = |(camera, _): &principal_deviations::LensAndHomography| {
        let lens = lens(camera)?;
        let mut directions = Vec::new();
        for k in 0..GRID.0 * GRID.1 {
            let at =
                |k: usize, cells: usize, size: usize| (k as f64 + 0.5) / cells as f64 * size as f64 - 0.5;
            let p = PixelPoint::new(at(k % GRID.0, GRID.0, size.0), at(k / GRID.0, GRID.1, size.1));
            let ideal = lens.undistort(p)?;
            directions.push(focal * (ideal.u_px - camera[2]) / camera[0]);
            directions.push(focal * (ideal.v_px - camera[3]) / camera[1]);
        }
        Some(directions)
    };
    principal_deviations::principal(&covariance, numbers, effect).unwrap_or_default()
}
