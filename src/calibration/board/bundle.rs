//! The normal equations of a camera and the poses of its views: the step that makes the misfit least, and covariances. See
//! [`super::lens_fit`] for their form.

use super::projection::{CameraParameters, CornerObservation, POSE, Pose, project};
use nalgebra::{DMatrix, DVector, SMatrix, SVector};

/// Covariance of camera and one pose, 15 by 15.
pub type JointCovariance = SMatrix<f64, 15, 15>;

/// Corners are known to no better than this, whatever a fit to exact data says, px².
pub(super) const SMALLEST_PX2: f64 = 1e-10;

/// A camera and the poses of its views.
#[derive(Debug, Clone)]
pub(super) struct Bundle {
    pub camera: CameraParameters,
    pub poses: Vec<Pose>,
}

/// A change of camera and poses.
pub(super) struct BundleStep {
    pub camera: CameraParameters,
    pub poses: Vec<SVector<f64, POSE>>,
}

impl Bundle {
    /// The bundle after a step.
    pub fn stepped(&self, step: &BundleStep) -> Self {
        let poses = self.poses.iter().zip(&step.poses);
        Self {
            camera: self.camera + step.camera,
            poses: poses.map(|(pose, step)| pose.stepped(step)).collect(),
        }
    }
}

/// A view's part of the normal equations.
#[derive(Debug, Clone, Copy)]
pub(super) struct ViewBlock {
    cross: SMatrix<f64, 9, POSE>,
    pub own: SMatrix<f64, POSE, POSE>,
}

impl ViewBlock {
    /// Covariance of camera and pose, where the camera's is known; `scale` is the mean squared residual.
    pub fn joint(&self, camera: &SMatrix<f64, 9, 9>, scale: f64) -> Option<JointCovariance> {
        let inverse = self.own.cholesky()?.inverse();
        let lever = inverse * self.cross.transpose();
        let mixed = -camera * lever.transpose();
        let mut joint = JointCovariance::zeros();
        joint.fixed_view_mut::<9, 9>(0, 0).copy_from(camera);
        joint.fixed_view_mut::<9, POSE>(0, 9).copy_from(&mixed);
        joint
            .fixed_view_mut::<POSE, 9>(9, 0)
            .copy_from(&mixed.transpose());
        joint
            .fixed_view_mut::<POSE, POSE>(9, 9)
            .copy_from(&(inverse * scale + lever * camera * lever.transpose()));
        Some(joint)
    }
}

/// The normal equations, weighted.
pub(super) struct BundleEquations {
    camera: SMatrix<f64, 9, 9>,
    camera_right: SVector<f64, 9>,
    /// Of each view, with its right-hand side.
    pub parts: Vec<(ViewBlock, SVector<f64, POSE>)>,
    /// Weighted sum of squared residuals, px².
    pub chi2: f64,
    /// Coordinates of corners in it.
    pub coordinates: usize,
}

impl BundleEquations {
    /// `None` where a corner comes to lie behind the camera.
    pub fn at(state: &Bundle, views: &[Vec<CornerObservation>], weights: &[Vec<f64>]) -> Option<Self> {
        let mut normal = Self {
            camera: SMatrix::zeros(),
            camera_right: SVector::zeros(),
            parts: Vec::with_capacity(views.len()),
            chi2: 0.0,
            coordinates: 0,
        };
        for ((view, weights), pose) in views.iter().zip(weights).zip(&state.poses) {
            let mut part = ViewBlock {
                cross: SMatrix::zeros(),
                own: SMatrix::zeros(),
            };
            let mut right = SVector::zeros();
            for (seen, &w) in view.iter().zip(weights) {
                let p = project(&state.camera, pose, &seen.board_m)?;
                let rest = seen.pixel() - p.at;
                normal.chi2 += w * rest.norm_squared();
                normal.coordinates += 2;
                let (by_camera, by_pose) = (p.by_camera.transpose() * w, p.by_pose.transpose() * w);
                normal.camera += by_camera * p.by_camera;
                normal.camera_right += by_camera * rest;
                part.cross += by_camera * p.by_pose;
                part.own += by_pose * p.by_pose;
                right += by_pose * rest;
            }
            normal.parts.push((part, right));
        }
        normal.chi2.is_finite().then_some(normal)
    }

    /// The step of Levenberg and Marquardt in the parameters of `basis`: of the camera and of each pose.
    pub fn step(&self, basis: &DMatrix<f64>, damping: f64) -> Option<BundleStep> {
        let (mut matrix, mut right) = (self.camera, self.camera_right);
        for i in 0..9 {
            matrix[(i, i)] *= 1.0 + damping;
        }
        let mut levers = Vec::with_capacity(self.parts.len());
        for (part, part_right) in &self.parts {
            let mut own = part.own;
            for i in 0..POSE {
                own[(i, i)] *= 1.0 + damping;
            }
            let own = own.cholesky()?;
            let lever = own.solve(&part.cross.transpose());
            let alone = own.solve(part_right);
            matrix -= part.cross * lever;
            right -= part.cross * alone;
            levers.push((lever, alone));
        }
        let reduced = basis.transpose() * matrix * basis;
        let solution = solve_scaled(reduced, &(basis.transpose() * right))?;
        let camera = CameraParameters::from_iterator((basis * solution).iter().copied());
        let poses = levers
            .iter()
            .map(|(lever, alone)| alone - lever * camera)
            .collect();
        Some(BundleStep { camera, poses })
    }

    /// Inverse of the camera's part of the whole matrix, in the terms of `basis`.
    pub fn camera_inverse(&self, basis: &DMatrix<f64>) -> Option<SMatrix<f64, 9, 9>> {
        let mut matrix = self.camera;
        for (part, _) in &self.parts {
            matrix -= part.cross * part.own.cholesky()?.solve(&part.cross.transpose());
        }
        let reduced = basis.transpose() * matrix * basis;
        let inverse = inverse_scaled(reduced)?;
        let whole = basis * inverse * basis.transpose();
        Some(SMatrix::from_fn(|i, j| whole[(i, j)]))
    }

    /// Akaike's criterion, corrected for few data.
    pub fn aicc(&self, parameters: usize) -> f64 {
        let (n, k) = (self.coordinates as f64, parameters as f64 + 1.0);
        let mean_square = (self.chi2 / n).max(SMALLEST_PX2);
        n * mean_square.ln() + 2.0 * k + 2.0 * k * (k + 1.0) / (n - k - 1.0).max(1.0)
    }
}

/// Focal lengths in px and k3 differ by orders of magnitude: columns of one size first.
fn scaled(matrix: &DMatrix<f64>) -> Option<(DMatrix<f64>, DVector<f64>)> {
    let scale = matrix.diagonal().map(|d| 1.0 / d.sqrt());
    let fine = scale.iter().all(|s| s.is_finite() && *s > 0.0);
    fine.then(|| {
        let diagonal = DMatrix::from_diagonal(&scale);
        (&diagonal * matrix * &diagonal, scale)
    })
}

fn solve_scaled(matrix: DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    let (unit, scale) = scaled(&matrix)?;
    let solution = unit.cholesky()?.solve(&right.component_mul(&scale));
    Some(solution.component_mul(&scale))
}

fn inverse_scaled(matrix: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let (unit, scale) = scaled(&matrix)?;
    // Below this rounding decides: not determined.
    let smallest = unit.symmetric_eigenvalues().min();
    let diagonal = DMatrix::from_diagonal(&scale);
    (smallest > 1e-13).then_some(())?;
    Some(&diagonal * unit.cholesky()?.inverse() * &diagonal)
}
