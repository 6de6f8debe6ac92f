//! Where a camera shows a point of a board, with the derivatives that a least-squares fit needs.
//!
//! The lens is that of [`crate::calibration::Lens`]; a point (X, Y) of the board is at R · (X, Y, 0) + t in the camera's
//! axes (x right, y down, z forward). A pose is varied by a small turn δ of the camera's axes, R ← exp([δ]×) R.

use crate::geometry::PixelPoint;
use nalgebra::{Matrix2, Matrix2x3, Matrix3, Rotation3, SMatrix, SVector, UnitQuaternion, Vector2, Vector3};

/// Parameters of a camera, in this order: fx, fy, cx, cy (px), k1, k2, p1, p2, k3.
pub type CameraParameters = SVector<f64, 9>;
/// Number of parameters of a pose: turn (rad), then shift (m).
pub const POSE: usize = 6;

/// A board's place in the camera's axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Camera from board.
    pub rotation: Rotation3<f64>,
    /// The board's first corner, m.
    pub shift_m: Vector3<f64>,
}

impl Pose {
    /// The pose changed by a step of its six parameters.
    pub fn stepped(&self, step: &SVector<f64, POSE>) -> Self {
        Self {
            rotation: Rotation3::new(step.fixed_rows::<3>(0).into_owned()) * self.rotation,
            shift_m: self.shift_m + step.fixed_rows::<3>(3),
        }
    }

    /// The step that leads from `other` to this pose.
    pub fn step_from(&self, other: &Self) -> SVector<f64, POSE> {
        let mut step = SVector::<f64, POSE>::zeros();
        // By the quaternion: the angle of a matrix that is almost none comes from an arc cosine.
        let turn =
            UnitQuaternion::from_rotation_matrix(&(self.rotation * other.rotation.inverse())).scaled_axis();
        step.fixed_rows_mut::<3>(0).copy_from(&turn);
        step.fixed_rows_mut::<3>(3)
            .copy_from(&(self.shift_m - other.shift_m));
        step
    }

    /// A point of the board in the camera's axes, m.
    pub fn point_m(&self, board_m: &Vector2<f64>) -> Vector3<f64> {
        self.rotation * Vector3::new(board_m.x, board_m.y, 0.0) + self.shift_m
    }

    /// The homography from the board's plane (X, Y, 1), m, to undistorted pixels.
    pub fn pixel_from_board(&self, camera: &CameraParameters) -> Matrix3<f64> {
        let r = self.rotation.matrix();
        let plane = Matrix3::from_columns(&[r.column(0).into(), r.column(1).into(), self.shift_m]);
        camera_matrix(camera) * plane
    }

    /// Angle between the board's normal and the line of sight to its first corner's plane, rad: 0 seen square.
    pub fn tilt_rad(&self) -> f64 {
        let normal = self.rotation * Vector3::z();
        normal.x.hypot(normal.y).atan2(normal.z.abs())
    }
}

/// The matrix of the camera's first four parameters.
pub fn camera_matrix(c: &CameraParameters) -> Matrix3<f64> {
    Matrix3::new(c[0], 0.0, c[2], 0.0, c[1], c[3], 0.0, 0.0, 1.0)
}

/// A point of the board in the picture, and how that depends on camera and pose.
#[derive(Debug, Clone, Copy)]
pub struct Projected {
    /// px.
    pub at: Vector2<f64>,
    /// d(u, v)/d(camera).
    pub by_camera: SMatrix<f64, 2, 9>,
    /// d(u, v)/d(pose).
    pub by_pose: SMatrix<f64, 2, POSE>,
}

/// The point of the board in the picture; `None` behind the camera.
pub fn project(camera: &CameraParameters, pose: &Pose, board_m: &Vector2<f64>) -> Option<Projected> {
    let turned = pose.point_m(board_m) - pose.shift_m;
    let p = turned + pose.shift_m;
    if !(p.z > 1e-9) {
        return None;
    }
    let (x, y) = (p.x / p.z, p.y / p.z);
    let (fx, fy) = (camera[0], camera[1]);
    let [k1, k2, p1, p2, k3] = [camera[4], camera[5], camera[6], camera[7], camera[8]];
    let s = x * x + y * y;
    let q = 1.0 + s * (k1 + s * (k2 + s * k3));
    let q_s = k1 + s * (2.0 * k2 + s * 3.0 * k3);
    let seen = Vector2::new(
        x * q + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x),
        y * q + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y,
    );
    let mixed = 2.0 * x * y * q_s + 2.0 * p1 * x + 2.0 * p2 * y;
    let by_xy = Matrix2::new(
        fx * (q + 2.0 * x * x * q_s + 2.0 * p1 * y + 6.0 * p2 * x),
        fx * mixed,
        fy * mixed,
        fy * (q + 2.0 * y * y * q_s + 6.0 * p1 * y + 2.0 * p2 * x),
    );
    let xy_by_point = Matrix2x3::new(1.0, 0.0, -x, 0.0, 1.0, -y) / p.z;
    let by_point = by_xy * xy_by_point;
    let mut by_camera = SMatrix::<f64, 2, 9>::zeros();
    let (s2, s3) = (s * s, s * s * s);
    by_camera.row_mut(0).copy_from_slice(&[
        seen.x,
        0.0,
        1.0,
        0.0,
        fx * x * s,
        fx * x * s2,
        fx * 2.0 * x * y,
        fx * (s + 2.0 * x * x),
        fx * x * s3,
    ]);
    by_camera.row_mut(1).copy_from_slice(&[
        0.0,
        seen.y,
        0.0,
        1.0,
        fy * y * s,
        fy * y * s2,
        fy * (s + 2.0 * y * y),
        fy * 2.0 * x * y,
        fy * y * s3,
    ]);
    let mut by_pose = SMatrix::<f64, 2, POSE>::zeros();
    // d(exp([δ]×) a)/dδ = −[a]×.
    by_pose
        .fixed_columns_mut::<3>(0)
        .copy_from(&(by_point * -turned.cross_matrix()));
    by_pose.fixed_columns_mut::<3>(3).copy_from(&by_point);
    let at = Vector2::new(fx * seen.x + camera[2], fy * seen.y + camera[3]);
    at.iter().all(|x| x.is_finite()).then_some(Projected {
        at,
        by_camera,
        by_pose,
    })
}

/// A corner as seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CornerObservation {
    /// Where on the board, m.
    pub board_m: Vector2<f64>,
    /// Where in the picture.
    pub at: PixelPoint,
    /// Standard uncertainty of each coordinate from the picture's noise, px.
    pub std_px: f64,
}

impl CornerObservation {
    /// Its place in the picture, px.
    pub(super) fn pixel(&self) -> Vector2<f64> {
        Vector2::new(self.at.u_px, self.at.v_px)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> CameraParameters {
        CameraParameters::from([900.0, 905.0, 642.0, 357.0, -0.3, 0.1, 0.001, -0.002, -0.01])
    }

    fn pose() -> Pose {
        Pose {
            rotation: Rotation3::from_euler_angles(0.3, -0.4, 1.1),
            shift_m: Vector3::new(-0.05, 0.02, 0.4),
        }
    }

    #[test]
    fn a_point_is_where_the_lens_shows_it() {
        let (camera, pose, board) = (camera(), pose(), Vector2::new(0.1, 0.07));
        let seen = project(&camera, &pose, &board).unwrap().at;
        let lens = crate::calibration::Lens::new(
            camera_matrix(&camera),
            [camera[4], camera[5], camera[6], camera[7], camera[8]],
        )
        .unwrap();
        let ideal = pose.pixel_from_board(&camera) * Vector3::new(board.x, board.y, 1.0);
        let expected = lens
            .distort(PixelPoint::new(ideal.x / ideal.z, ideal.y / ideal.z))
            .unwrap();
        assert!((seen.x - expected.u_px).hypot(seen.y - expected.v_px) < 1e-9);
    }

    #[test]
    fn derivatives_are_the_limits_of_differences() {
        let board = Vector2::new(0.1, 0.07);
        let exact = project(&camera(), &pose(), &board).unwrap();
        for i in 0..9 {
            let h = 1e-5 * camera()[i].abs().max(0.01);
            let at = |h: f64| {
                let mut c = camera();
                c[i] += h;
                project(&c, &pose(), &board).unwrap().at
            };
            let slope = (at(h) - at(-h)) / (2.0 * h);
            assert!(
                (slope - exact.by_camera.column(i)).norm() < 1e-5 * (1.0 + slope.norm()),
                "{i}"
            );
        }
        for i in 0..POSE {
            let at = |h: f64| {
                let mut step = SVector::<f64, POSE>::zeros();
                step[i] = h;
                project(&camera(), &pose().stepped(&step), &board).unwrap().at
            };
            let slope = (at(1e-6) - at(-1e-6)) / 2e-6;
            assert!(
                (slope - exact.by_pose.column(i)).norm() < 1e-5 * (1.0 + slope.norm()),
                "{i}"
            );
        }
    }

    #[test]
    fn a_step_leads_from_one_pose_to_the_other() {
        let step = SVector::from([0.1, -0.2, 0.05, 0.01, 0.02, -0.03]);
        let there = pose().stepped(&step);
        assert!((there.step_from(&pose()) - step).norm() < 1e-12);
    }

    #[test]
    fn behind_the_camera_there_is_nothing() {
        let mut behind = pose();
        behind.shift_m.z = -1.0;
        assert!(project(&camera(), &behind, &Vector2::zeros()).is_none());
    }
}
