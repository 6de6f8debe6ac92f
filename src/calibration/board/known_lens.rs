//! The plane of motion from one picture of the board, where the lens is known already.

use super::error::BoardError;
use super::lens_fit;
use super::pattern::{Pattern, no_board_in_plane};
use super::plane_fit::PosedBoard;
use super::plane_fit::{MotionPlane, PlaneMarks};
use super::projection::{CameraParameters, CornerObservation, Pose};
use super::views::{BoardView, ViewUse};
use crate::calibration::{Calibration, Lens, Scale};
use crate::frames::Luma;
use nalgebra::{Rotation3, SMatrix, Vector3};
use opencv::calib3d::{SOLVEPNP_ITERATIVE, solve_pnp};
use opencv::core::{Mat, MatTraitConst as _, Point2d, Point3d, Vector};

/// The plane of the board in `picture`, its calibration with the lens of `known` (a calibration called `lens_name`), and
/// what became of the picture.
///
/// # Errors
/// [`BoardError::NoLens`], [`BoardError::PlaneSize`], [`BoardError::NoBoardInPlane`], [`BoardError::Askew`],
/// [`BoardError::Mark`].
pub fn plane_with_lens(
    (name, picture): (&str, &Luma),
    pattern: &Pattern,
    (lens_name, known): (&str, &Calibration),
    marks: &PlaneMarks,
) -> Result<(MotionPlane, Calibration, BoardView), BoardError> {
    let size_px = (picture.width, picture.height);
    let lens = known.lens.as_ref().ok_or_else(|| BoardError::NoLens {
        name: lens_name.to_owned(),
    })?;
    if let Some(expected) = known.image_size_px.filter(|&s| s != size_px) {
        return Err(BoardError::PlaneSize {
            name: name.to_owned(),
            found: size_px,
            expected,
        });
    }
    let seen = match pattern.search(picture)?.outcome {
        Ok(seen) => seen,
        Err(reason) => {
            return Err(no_board_in_plane(pattern, name.to_owned(), picture, &reason)?);
        }
    };
    let camera = camera_of(lens);
    let covariance: SMatrix<f64, 9, 9> = known
        .deviations
        .iter()
        .map(|d| CameraParameters::from(d.lens))
        .map(|d| d * d.transpose())
        .sum();
    let undetermined = || BoardError::not_determined(None, 1);
    let start = first_pose(lens, &seen)?;
    let (pose, joint, rms_px) =
        lens_fit::pose(&camera, &covariance, start, &seen).ok_or_else(undetermined)?;
    let board = PosedBoard {
        camera,
        lens,
        size_px,
        pose,
        joint: &joint,
    };
    let plane = MotionPlane::new(name, &board, pattern, marks)?;
    let calibration = Calibration {
        image_size_px: Some(size_px),
        lens: Some(lens.clone()),
        lens_std: known.lens_std,
        deviations: plane.deviations.clone(),
        ..Calibration::new(Scale::Homography(plane.homography.clone()))
    };
    let view = BoardView {
        name: name.to_owned(),
        use_: ViewUse::Used {
            rms_px,
            tilt_rad: pose.tilt_rad(),
        },
        seen,
    };
    Ok((plane, calibration, view))
}

fn camera_of(lens: &Lens) -> CameraParameters {
    let m = lens.camera_matrix();
    let [k1, k2, p1, p2, k3] = lens.distortion();
    CameraParameters::from([m[(0, 0)], m[(1, 1)], m[(0, 2)], m[(1, 2)], k1, k2, p1, p2, k3])
}

fn first_pose(lens: &Lens, seen: &[CornerObservation]) -> Result<Pose, BoardError> {
    let objects: Vector<Point3d> = seen
        .iter()
        .map(|s| Point3d::new(s.board_m.x, s.board_m.y, 0.0))
        .collect();
    let images: Vector<Point2d> = seen.iter().map(|s| Point2d::new(s.at.u_px, s.at.v_px)).collect();
    let m = lens.camera_matrix();
    let rows: Vec<[f64; 3]> = (0..3).map(|i| [m[(i, 0)], m[(i, 1)], m[(i, 2)]]).collect();
    let matrix = Mat::from_slice_2d(&rows)?;
    let distortion = Vector::<f64>::from_slice(&lens.distortion());
    let (mut turn, mut shift) = (Mat::default(), Mat::default());
    let found = solve_pnp(
        &objects,
        &images,
        &matrix,
        &distortion,
        &mut turn,
        &mut shift,
        false,
        SOLVEPNP_ITERATIVE,
    )?;
    if !found {
        return Err(BoardError::not_determined(None, 1));
    }
    let three = |m: &Mat| -> opencv::Result<Vector3<f64>> {
        Ok(Vector3::new(*m.at::<f64>(0)?, *m.at::<f64>(1)?, *m.at::<f64>(2)?))
    };
    Ok(Pose {
        rotation: Rotation3::new(three(&turn)?),
        shift_m: three(&shift)?,
    })
}
