//! The lens from views of a board: camera and poses together by least squares, and which of the lens's terms the views
//! determine.
//!
//! The start is OpenCV's `calibrateCamera`. It is continued here in double precision, because what is needed beside the
//! optimum is not in it: corners weighted by how well they were seen, models with and without each term compared, and
//! the whole covariance (OpenCV 4.6 gives deviations only, without correlations, and scales them by the number of points
//! in place of that of coordinates: √2 too large). With the normal equations
//!
//! ```text
//! | A    B_i |          S = A − Σ B_i C_i⁻¹ B_iᵀ
//! | B_iᵀ C_i |          cov(camera) = S⁻¹,   cov(camera, pose i) = −S⁻¹ B_i C_i⁻¹,
//!                       cov(pose i) = C_i⁻¹ + C_i⁻¹ B_iᵀ S⁻¹ B_i C_i⁻¹
//! ```
//!
//! times the mean squared residual, and a factor for what the corners of one view have in common ([`SHARED_PX`]).
//!
//! **Which terms.** A term that the views do not show costs nothing in the fit and much in the far corners of the picture;
//! one that is left out although it is there does as much harm. So every combination of 0 to 3 radial terms, tangential
//! terms or none, and one focal length or two is fitted, and the results are averaged with Akaike's weights
//! exp(−ΔAICc/2) (Burnham and Anderson 2002, section 4.3), among those that can be inverted all over the picture. The
//! covariance holds what the models differ by. What the views determine has one answer in all that count; what they do
//! not is drawn towards zero, and its uncertainty says so. Taking the best one alone was tried: as accurate within 5 % at the
//! picture's rim, but on corners off by 0.05 px (real boards are uneven by 0.1 px) its 95 % regions hold only 80 % (4
//! views) to 89 % (10 views) of true places, the mean's 92 % to 96 %, and it calls a term exact that it left out.

use super::bundle::{Bundle, BundleEquations, BundleStep, JointCovariance, SMALLEST_PX2};
use super::error::BoardError;
use super::projection::{CameraParameters, CornerObservation, POSE, Pose, project};
use crate::calibration::Lens;
use crate::geometry::PixelPoint;
use crate::numeric::least_squares::{Acceptance, Damping, Easing, Problem, Termination, Trial, minimise};
use nalgebra::{DMatrix, Rotation3, SMatrix, SVector, Vector3};
use opencv::calib3d;
use opencv::core::{Mat, MatTraitConst as _, Point2f, Point3f, Size, TermCriteria, Vector};

/// The terms of a lens that are fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LensTerms {
    /// k1, k2, k3: how many of them.
    pub radial: usize,
    /// p1 and p2.
    pub tangential: bool,
    /// Two focal lengths, or one for both directions.
    pub two_focal_lengths: bool,
}

impl LensTerms {
    const ALL: Self = Self {
        radial: 3,
        tangential: true,
        two_focal_lengths: true,
    };

    fn every() -> impl Iterator<Item = Self> {
        (0..16).map(|i| Self {
            radial: i / 4,
            tangential: i & 1 == 1,
            two_focal_lengths: i & 2 == 2,
        })
    }

    /// The nine parameters of a camera from those that are fitted.
    fn basis(self) -> DMatrix<f64> {
        let mut columns: Vec<[f64; 9]> = Vec::new();
        let unit = |at: &[usize]| {
            let mut column = [0.0; 9];
            at.iter().for_each(|&i| column[i] = 1.0);
            column
        };
        if self.two_focal_lengths {
            columns.extend([unit(&[0]), unit(&[1])]);
        } else {
            columns.push(unit(&[0, 1]));
        }
        columns.extend([unit(&[2]), unit(&[3])]);
        columns.extend([4, 5, 8].iter().take(self.radial).map(|&i| unit(&[i])));
        if self.tangential {
            columns.extend([unit(&[6]), unit(&[7])]);
        }
        DMatrix::from_fn(9, columns.len(), |i, j| columns[j][i])
    }

    /// A camera with what is not fitted at rest.
    fn held(self, camera: &CameraParameters) -> CameraParameters {
        let mut camera = *camera;
        if !self.two_focal_lengths {
            let mean = 0.5 * (camera[0] + camera[1]);
            (camera[0], camera[1]) = (mean, mean);
        }
        for &i in &[4, 5, 8][self.radial..] {
            camera[i] = 0.0;
        }
        if !self.tangential {
            (camera[6], camera[7]) = (0.0, 0.0);
        }
        camera
    }
}

/// A lens fitted to views.
#[derive(Debug, Clone)]
pub struct LensFit {
    /// The camera.
    pub camera: CameraParameters,
    /// Akaike's weight of each combination of terms that counts, largest first.
    pub terms: Vec<(LensTerms, f64)>,
    /// Covariance of the camera's nine parameters.
    pub covariance: SMatrix<f64, 9, 9>,
    /// The pose of each view.
    pub poses: Vec<Pose>,
    /// Root mean square residual of each view, px (both coordinates together).
    pub view_rms_px: Vec<f64>,
    /// Reduced chi of each view: root mean square of its residuals over their standard uncertainty; 1 is usual.
    pub view_reduced_chi: Vec<f64>,
    /// Root mean square residual over all views, px.
    pub rms_px: f64,
    /// Of camera and pose of each view.
    joint: Vec<JointCovariance>,
    /// Mean square of a coordinate's residual beside the picture's noise, px².
    common_px2: f64,
}

impl LensFit {
    /// The lens.
    pub fn lens(&self) -> Option<Lens> {
        lens(&self.camera)
    }

    /// Covariance of the camera with the pose of view `index`.
    pub fn joint_covariance(&self, index: usize) -> Option<&JointCovariance> {
        self.joint.get(index)
    }

    /// The standard uncertainty of a corner's own that makes it scatter `times` as much as its noise `std_px` and what all corners share
    /// would let it, px.
    pub fn scattered_std_px(&self, std_px: f64, times: f64) -> f64 {
        (times * times * (self.common_px2 + std_px * std_px) - self.common_px2)
            .max(0.0)
            .sqrt()
    }

    /// Residuals of a view's corners: px, and over the expected deviation of such a distance.
    pub fn residuals(&self, index: usize, view: &[CornerObservation]) -> Vec<(f64, f64)> {
        view.iter()
            .map(
                |seen| match project(&self.camera, &self.poses[index], &seen.board_m) {
                    Some(p) => {
                        let px = (p.at - seen.pixel()).norm();
                        (
                            px,
                            px / (2.0 * (self.common_px2 + seen.std_px * seen.std_px)).sqrt(),
                        )
                    }
                    None => (f64::INFINITY, f64::INFINITY),
                },
            )
            .collect()
    }
}

/// The lens of nine parameters.
pub fn lens(camera: &CameraParameters) -> Option<Lens> {
    let distortion = [camera[4], camera[5], camera[6], camera[7], camera[8]];
    Lens::new(super::projection::camera_matrix(camera), distortion).ok()
}

/// A step that moves no corner by more than this, px, is the last.
const SETTLED_PX: f64 = 1e-7;
const ITERATIONS: usize = 40;

/// Fits the lens of pictures of `size` (width, height) to `views`.
///
/// # Errors
/// [`BoardError::NotDetermined`] where the views do not fix a lens, [`BoardError::OpenCv`].
pub fn fit(size: (usize, usize), views: &[Vec<CornerObservation>]) -> Result<LensFit, BoardError> {
    let (camera, poses) = start(size, views)?;
    let undetermined = || BoardError::not_determined(None, views.len());
    // Unweighted first: only the residuals tell what there is beside the pictures' noise.
    let plain: Vec<Vec<f64>> = views.iter().map(|v| vec![1.0; v.len()]).collect();
    let full = Bundle { camera, poses };
    let (full, normal) = descend(full, views, &plain, LensTerms::ALL).ok_or_else(undetermined)?;
    let mean_square = (normal.chi2 / normal.coordinates as f64).max(SMALLEST_PX2);
    let common_px2 = common(views, mean_square);
    let weights = weights(views, mean_square, common_px2);
    let candidates: Vec<CandidateLens> = LensTerms::every()
        .filter_map(|terms| CandidateLens::new(terms, &full, views, &weights, size))
        .collect();
    average(candidates, views, common_px2).ok_or_else(undetermined)
}

/// Mean square of a coordinate's residual that the pictures' noise does not explain (the board's own unevenness, the
/// lens's), at least a tenth of the whole `mean_square`, px².
fn common(views: &[Vec<CornerObservation>], mean_square: f64) -> f64 {
    let count: usize = views.iter().map(Vec::len).sum();
    let noise: f64 = views.iter().flatten().map(|s| s.std_px * s.std_px).sum::<f64>() / count as f64;
    (mean_square - noise).max(0.1 * mean_square)
}

/// Weights of corners: 1 for the typical one, less for those that noise or blur makes worse than what is common to all.
fn weights(views: &[Vec<CornerObservation>], mean_square: f64, common_px2: f64) -> Vec<Vec<f64>> {
    let weigh = |s: &CornerObservation| mean_square / (common_px2 + s.std_px * s.std_px);
    views
        .iter()
        .map(|view| view.iter().map(weigh).collect())
        .collect()
}

/// Whether the lens can be inverted over the whole picture. Its reach is convex, so the rim decides.
fn covers(lens: &Lens, (width, height): (usize, usize)) -> bool {
    let (right, bottom) = (width as f64 - 0.5, height as f64 - 0.5);
    (0..=16).all(|i| {
        let part = f64::from(i) / 16.0;
        let (u, v) = (part * (right + 0.5) - 0.5, part * (bottom + 0.5) - 0.5);
        [(u, -0.5), (u, bottom), (-0.5, v), (right, v)]
            .iter()
            .all(|&(u, v)| lens.undistort(PixelPoint::new(u, v)).is_some())
    })
}

/// Camera and poses by OpenCV, all terms free.
fn start(
    size: (usize, usize),
    views: &[Vec<CornerObservation>],
) -> Result<(CameraParameters, Vec<Pose>), BoardError> {
    let mut objects = Vector::<Vector<Point3f>>::new();
    let mut images = Vector::<Vector<Point2f>>::new();
    for view in views {
        let object = view
            .iter()
            .map(|s| Point3f::new(s.board_m.x as f32, s.board_m.y as f32, 0.0));
        let image = view
            .iter()
            .map(|s| Point2f::new(s.at.u_px as f32, s.at.v_px as f32));
        objects.push(object.collect());
        images.push(image.collect());
    }
    let side = |n: usize| i32::try_from(n).unwrap_or(i32::MAX);
    let (mut matrix, mut distortion) = (Mat::default(), Mat::default());
    let (mut turns, mut shifts) = (Vector::<Mat>::new(), Vector::<Mat>::new());
    // k3 first stays out: with few views the search runs away along it.
    let criteria = TermCriteria::new(3, 100, 1e-12)?;
    let found = calib3d::calibrate_camera(
        &objects,
        &images,
        Size::new(side(size.0), side(size.1)),
        &mut matrix,
        &mut distortion,
        &mut turns,
        &mut shifts,
        calib3d::CALIB_FIX_K3,
        criteria,
    );
    // What it asserts on the way fails where the views are too much alike.
    found.map_err(|_| BoardError::not_determined(None, views.len()))?;
    let mut camera = CameraParameters::zeros();
    for (i, at) in [(0, 0), (1, 1), (0, 2), (1, 2)].into_iter().enumerate() {
        camera[i] = *matrix.at_2d::<f64>(at.0, at.1)?;
    }
    for i in 0..5 {
        camera[4 + i] = *distortion.at::<f64>(side(i))?;
    }
    let three = |m: &Mat| -> opencv::Result<Vector3<f64>> {
        Ok(Vector3::new(*m.at::<f64>(0)?, *m.at::<f64>(1)?, *m.at::<f64>(2)?))
    };
    let poses = turns
        .iter()
        .zip(shifts.iter())
        .map(|(turn, shift)| {
            Ok(Pose {
                rotation: Rotation3::new(three(&turn)?),
                shift_m: three(&shift)?,
            })
        })
        .collect::<opencv::Result<_>>()?;
    Ok((camera, poses))
}

/// Pose of a board seen by a known camera, from `start` on, and the covariance of camera and pose.
pub fn pose(
    camera: &CameraParameters,
    covariance: &SMatrix<f64, 9, 9>,
    start: Pose,
    view: &[CornerObservation],
) -> Option<(Pose, JointCovariance, f64)> {
    let views = [view.to_vec()];
    let weights = [vec![1.0; view.len()]];
    let mut problem = BundleProblem {
        views: &views,
        weights: &weights,
        // The camera stays as it is.
        basis: DMatrix::zeros(9, 0),
        is_last: |step, taken| !taken && step.poses.iter().all(|p| p.norm() < 1e-12),
    };
    let policy = Damping {
        first: 1e-6,
        most: 2e4,
        easing: Easing::Factor(0.1),
        growth: 20.0,
        acceptance: Acceptance::Lower,
        ..Damping::NONE
    };
    let bundle = Bundle {
        camera: *camera,
        poses: vec![start],
    };
    let first = problem.evaluated(bundle)?;
    let ((bundle, normal), end) = minimise(&mut problem, first, &policy, ITERATIONS);
    if end == Termination::Singular {
        return None;
    }
    let pose = *bundle.poses.first()?;
    let freedom = normal.coordinates.checked_sub(POSE).filter(|&f| f > 0)?;
    let scale = normal.chi2 / freedom as f64;
    let joint = normal.parts.first()?.0.joint(covariance, scale)?;
    Some((
        pose,
        joint,
        (2.0 * normal.chi2 / normal.coordinates as f64).sqrt(),
    ))
}

/// The least-squares problem of a camera and its views' poses, its camera in the terms of `basis`.
struct BundleProblem<'a> {
    views: &'a [Vec<CornerObservation>],
    weights: &'a [Vec<f64>],
    basis: DMatrix<f64>,
    /// Whether a step, taken or not, is the last one worth trying.
    is_last: fn(&BundleStep, bool) -> bool,
}

impl BundleProblem<'_> {
    fn evaluated(&self, bundle: Bundle) -> Option<(Bundle, BundleEquations)> {
        let equations = BundleEquations::at(&bundle, self.views, self.weights)?;
        Some((bundle, equations))
    }
}

impl Problem for BundleProblem<'_> {
    type State = (Bundle, BundleEquations);
    type Step = BundleStep;

    fn step(&mut self, here: &Self::State, damping: f64) -> Option<BundleStep> {
        here.1.step(&self.basis, damping)
    }

    fn moved(&mut self, (bundle, _): &Self::State, step: &BundleStep) -> Option<Self::State> {
        self.evaluated(bundle.stepped(step))
    }

    fn cost(&self, (_, equations): &Self::State, _here: &Self::State) -> f64 {
        equations.chi2
    }

    fn is_settled(&self, _here: &Self::State, trial: &Trial<'_, BundleStep>) -> bool {
        (self.is_last)(trial.step, trial.taken)
    }
}

/// The optimum from `start` on, and the normal equations there.
fn descend(
    start: Bundle,
    views: &[Vec<CornerObservation>],
    weights: &[Vec<f64>],
    terms: LensTerms,
) -> Option<(Bundle, BundleEquations)> {
    let mut problem = BundleProblem {
        views,
        weights,
        basis: terms.basis(),
        is_last: |step, _| [0, 2, 3].iter().all(|&i| step.camera[i].abs() < SETTLED_PX),
    };
    let policy = Damping {
        first: 1e-6,
        most: 1e6,
        easing: Easing::Factor(0.1),
        growth: 20.0,
        where_singular: Some(100.0),
        acceptance: Acceptance::NotHigher(0.0),
        ..Damping::NONE
    };
    let first = problem.evaluated(start)?;
    let ((bundle, normal), end) = minimise(&mut problem, first, &policy, ITERATIONS);
    let sound = end != Termination::Singular && bundle.camera[0] > 0.0 && bundle.camera[1] > 0.0;
    sound.then_some((bundle, normal))
}

/// A combination of terms, fitted.
struct CandidateLens {
    terms: LensTerms,
    criterion: f64,
    state: Bundle,
    joint: Vec<JointCovariance>,
}

impl CandidateLens {
    /// `None` where it has no solution, or one that cannot be inverted over the picture.
    fn new(
        terms: LensTerms,
        full: &Bundle,
        views: &[Vec<CornerObservation>],
        weights: &[Vec<f64>],
        size: (usize, usize),
    ) -> Option<Self> {
        let held = Bundle {
            camera: terms.held(&full.camera),
            poses: full.poses.clone(),
        };
        let (state, normal) = descend(held, views, weights, terms)?;
        lens(&state.camera).filter(|lens| covers(lens, size))?;
        let basis = terms.basis();
        let parameters = basis.ncols() + POSE * views.len();
        let freedom = normal.coordinates.checked_sub(parameters).filter(|&f| f > 0)?;
        let scale = normal.chi2 / freedom as f64;
        let covariance = normal.camera_inverse(&basis)? * scale;
        let joint = normal
            .parts
            .iter()
            .map(|(part, _)| part.joint(&covariance, scale))
            .collect::<Option<_>>()?;
        Some(Self {
            terms,
            criterion: normal.aicc(parameters),
            state,
            joint,
        })
    }

    /// Camera and the pose of view `index` as differences from `reference`.
    fn difference(&self, reference: &Bundle, index: usize) -> SVector<f64, 15> {
        let mut all = SVector::<f64, 15>::zeros();
        all.fixed_rows_mut::<9>(0)
            .copy_from(&(self.state.camera - reference.camera));
        let step = self.state.poses[index].step_from(&reference.poses[index]);
        all.fixed_rows_mut::<POSE>(9).copy_from(&step);
        all
    }
}

/// An error that the corners of a view share, so that their number does not help: the fit of a corner takes no account
/// of the exact shape of pixel and blur under a slanted view. On renderings without noise corners are off by 0.001 to
/// 0.004 px rms, and this much of it is common (with it, lenses from rendered boards have pulls of width 1). On real
/// boards, which are uneven by 0.1 px, it does not matter.
const SHARED_PX: f64 = 0.0008;

/// Combinations that count less than this are left out.
const LEAST_WEIGHT: f64 = 1e-3;

/// The candidates' mean by Akaike's weights, with what they differ by in the covariance.
fn average(
    mut candidates: Vec<CandidateLens>,
    views: &[Vec<CornerObservation>],
    common_px2: f64,
) -> Option<LensFit> {
    candidates.sort_by(|a, b| a.criterion.total_cmp(&b.criterion));
    let best = candidates.first()?.criterion;
    candidates.retain(|c| (0.5 * (best - c.criterion)).exp() > LEAST_WEIGHT);
    let raw: Vec<f64> = candidates
        .iter()
        .map(|c| (0.5 * (best - c.criterion)).exp())
        .collect();
    let sum: f64 = raw.iter().sum();
    let weights: Vec<f64> = raw.iter().map(|w| w / sum).collect();
    let reference = candidates[0].state.clone();
    let weighted = || candidates.iter().zip(&weights);
    let mut mean = reference.clone();
    let mut joint = Vec::with_capacity(views.len());
    let mut covariance = SMatrix::zeros();
    let corners: f64 = views.iter().map(Vec::len).sum::<usize>() as f64;
    let noise_px2 = views.iter().flatten().map(|s| s.std_px * s.std_px).sum::<f64>() / corners;
    let shared = 1.0 + corners / views.len() as f64 * SHARED_PX * SHARED_PX / (common_px2 + noise_px2);
    for index in 0..views.len() {
        let shift: SVector<f64, 15> = weighted()
            .map(|(c, w)| c.difference(&reference, index) * *w)
            .sum();
        mean.poses[index] = reference.poses[index].stepped(&shift.fixed_rows::<POSE>(9).into_owned());
        mean.camera = reference.camera + shift.fixed_rows::<9>(0);
        let whole: JointCovariance = weighted()
            .map(|(c, w)| {
                let off = c.difference(&reference, index) - shift;
                (c.joint[index] + off * off.transpose()) * *w
            })
            .sum::<JointCovariance>()
            * shared;
        covariance = whole.fixed_view::<9, 9>(0, 0).into_owned();
        joint.push(whole);
    }
    let mut fit = LensFit {
        camera: mean.camera,
        terms: weighted().map(|(c, w)| (c.terms, *w)).collect(),
        covariance,
        poses: mean.poses,
        view_rms_px: Vec::new(),
        view_reduced_chi: Vec::new(),
        rms_px: 0.0,
        joint,
        common_px2,
    };
    let rms = |values: &[f64]| (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt();
    let mut all = Vec::new();
    for (index, view) in views.iter().enumerate() {
        let (px, relative): (Vec<f64>, Vec<f64>) = fit.residuals(index, view).into_iter().unzip();
        fit.view_rms_px.push(rms(&px));
        fit.view_reduced_chi.push(rms(&relative));
        all.extend(px);
    }
    fit.rms_px = rms(&all);
    Some(fit)
}

/// Standard deviations of the camera's parameters; `None` for those that were not fitted.
pub fn deviations(fit: &LensFit) -> [Option<f64>; 9] {
    std::array::from_fn(|i| Some(fit.covariance[(i, i)].sqrt()).filter(|s| *s > 0.0))
}

#[cfg(test)]
mod tests;
