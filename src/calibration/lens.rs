//! Lens distortion and its inverse.
//!
//! OpenCV's model ("Camera Calibration and 3D Reconstruction", `cv::projectPoints`). With the undistorted point
//! x = (u − cx)/fx, y = (v − cy)/fy and s = x² + y², the distorted one is
//!
//! ```text
//! q  = 1 + k1 s + k2 s² + k3 s³
//! x' = x q + 2 p1 x y + p2 (s + 2 x²)
//! y' = y q + p1 (s + 2 y²) + 2 p2 x y
//! ```
//!
//! Undistorted pixels use the same camera matrix. The map (x, y) → (x', y') is the gradient of a potential, so its
//! Jacobian is symmetric, and the map is one to one wherever the Jacobian is positive definite on a convex region.
//! That is where this module works: on the disk s < s_fold around the principal point, s_fold being where the
//! radial part d(r q)/dr first vanishes, as far as the Jacobian stays positive definite. Beyond it a barrel lens
//! folds the picture back over itself and one distorted point has several originals; there every function returns
//! `None`. A distorted point that has no original in the region (the far corner of a strongly distorted picture)
//! is `None` as well.

use super::json::rows_text;
use crate::config::FileProblem;
use crate::geometry::PixelPoint;
use nalgebra::{Matrix2, Matrix3, Vector2};

/// The smallest eigenvalue of the Jacobian that still counts as invertible. At 1e-6 a rounding error of 1e-16 in
/// normalised coordinates stays below 1e-6 px for any real focal length.
const SMALLEST_EIGENVALUE: f64 = 1e-6;
/// s_fold is looked for up to r = 100, i.e. 89.4 degrees off the axis.
const LARGEST_S: f64 = 1e4;
/// A Newton step below this, in px, ends the inversion.
const STEP_PX: f64 = 1e-9;
/// What the inversion promises, px: near the fold rounding may keep the step from getting smaller.
const PROMISED_PX: f64 = 1e-6;
/// Newton needs 3 to 8 iterations for real lenses; near the fold it converges slowly.
const MAX_ITERATIONS: usize = 100;
/// Halvings of one Newton step before the point counts as unreachable.
const MAX_HALVINGS: usize = 40;

/// A camera matrix and OpenCV's five distortion coefficients, checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Lens {
    camera_matrix: Matrix3<f64>,
    distortion: [f64; 5],
    s_fold: f64,
}

impl Lens {
    /// The lens with `camera_matrix` [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] in px and `distortion`
    /// [k1, k2, p1, p2, k3].
    ///
    /// # Errors
    /// Focal lengths that are not above 0, another shape of matrix (skew included), numbers that are not finite:
    /// all that is wrong, keys beginning with `lens.`.
    pub fn new(camera_matrix: Matrix3<f64>, distortion: [f64; 5]) -> Result<Self, Vec<FileProblem>> {
        let mut problems = Vec::new();
        problems.extend(camera_matrix_problem(&camera_matrix));
        if !distortion.iter().all(|k| k.is_finite() && k.abs() < 1e9) {
            problems.push(FileProblem::new(
                "lens.distortion",
                format!("{distortion:?}"),
                "five finite numbers [k1, k2, p1, p2, k3]",
                "copy the coefficients from the lens calibration in OpenCV's order",
            ));
        }
        if !problems.is_empty() {
            return Err(problems);
        }
        let [k1, k2, _, _, k3] = distortion;
        let s_fold = first_fold(3.0 * k1, 5.0 * k2, 7.0 * k3);
        Ok(Self {
            camera_matrix,
            distortion,
            s_fold,
        })
    }

    /// The camera matrix, px.
    #[must_use]
    pub const fn camera_matrix(&self) -> &Matrix3<f64> {
        &self.camera_matrix
    }

    /// k1, k2, p1, p2, k3.
    #[must_use]
    pub const fn distortion(&self) -> [f64; 5] {
        self.distortion
    }

    /// Where the picture shows a point that an ideal camera would show at `ideal`; `None` beyond the region in
    /// which the model is one to one (see the module's head).
    #[must_use]
    pub fn distort(&self, ideal: PixelPoint) -> Option<PixelPoint> {
        let x = self.normalised(ideal);
        self.invertible_at(&x)
            .then(|| self.pixel(&self.distort_normalised(&x)))
    }

    /// The point an ideal camera would show at, for the point `seen` of the picture, to 1e-6 px; `None` where the
    /// model cannot be inverted.
    #[must_use]
    pub fn undistort(&self, seen: PixelPoint) -> Option<PixelPoint> {
        self.undistort_normalised(&self.normalised(seen))
            .map(|x| self.pixel(&x))
    }

    /// The undistorted point and d(undistorted)/d(seen), px/px: rows (u, v) of the undistorted, columns of the seen.
    pub(super) fn undistort_with_jacobian(&self, seen: PixelPoint) -> Option<(PixelPoint, Matrix2<f64>)> {
        let x = self.undistort_normalised(&self.normalised(seen))?;
        let inverse = self.jacobian_normalised(&x).try_inverse()?;
        let (fx, fy) = self.focal_px();
        let jacobian = Matrix2::new(
            inverse[(0, 0)],
            inverse[(0, 1)] * fx / fy,
            inverse[(1, 0)] * fy / fx,
            inverse[(1, 1)],
        );
        Some((self.pixel(&x), jacobian))
    }

    /// Damped Newton on F(x) = distort(x) − target, from the principal point. A step is halved until it stays in
    /// the invertible region and lowers |F|, so it cannot jump across the fold to a false original.
    fn undistort_normalised(&self, target: &Vector2<f64>) -> Option<Vector2<f64>> {
        let (fx, fy) = self.focal_px();
        let focal_px = fx.max(fy);
        let mut x = Vector2::zeros();
        let mut residual = self.distort_normalised(&x) - target;
        if !(self.invertible_at(&x) && residual.norm().is_finite()) {
            return None;
        }
        for _ in 0..MAX_ITERATIONS {
            let step = -(self.jacobian_normalised(&x).try_inverse()? * residual);
            if step.norm() * focal_px <= STEP_PX {
                return Some(x);
            }
            let better = (0..MAX_HALVINGS).find_map(|halvings| {
                let candidate = x + step * 0.5_f64.powi(i32::try_from(halvings).unwrap_or(i32::MAX));
                let its_residual = self.distort_normalised(&candidate) - target;
                (self.invertible_at(&candidate) && its_residual.norm() < residual.norm())
                    .then_some((candidate, its_residual))
            });
            match better {
                Some(next) => (x, residual) = next,
                None => return (step.norm() * focal_px <= PROMISED_PX).then_some(x),
            }
        }
        None
    }

    /// Whether the model is one to one around x: inside the fold, with a positive definite Jacobian.
    fn invertible_at(&self, x: &Vector2<f64>) -> bool {
        let j = self.jacobian_normalised(x);
        let mean = 0.5 * (j[(0, 0)] + j[(1, 1)]);
        let smallest = mean - (0.5 * (j[(0, 0)] - j[(1, 1)])).hypot(j[(0, 1)]);
        x.norm_squared() < self.s_fold && smallest > SMALLEST_EIGENVALUE
    }

    fn distort_normalised(&self, x: &Vector2<f64>) -> Vector2<f64> {
        let [k1, k2, p1, p2, k3] = self.distortion;
        let (a, b, s) = (x[0], x[1], x.norm_squared());
        let q = 1.0 + s * (k1 + s * (k2 + s * k3));
        Vector2::new(
            a * q + 2.0 * p1 * a * b + p2 * (s + 2.0 * a * a),
            b * q + p1 * (s + 2.0 * b * b) + 2.0 * p2 * a * b,
        )
    }

    /// d(x', y')/d(x, y), symmetric.
    fn jacobian_normalised(&self, x: &Vector2<f64>) -> Matrix2<f64> {
        let [k1, k2, p1, p2, k3] = self.distortion;
        let (a, b, s) = (x[0], x[1], x.norm_squared());
        let q = 1.0 + s * (k1 + s * (k2 + s * k3));
        let dq_ds = k1 + s * (2.0 * k2 + s * 3.0 * k3);
        let mixed = 2.0 * a * b * dq_ds + 2.0 * p1 * a + 2.0 * p2 * b;
        Matrix2::new(
            q + 2.0 * a * a * dq_ds + 2.0 * p1 * b + 6.0 * p2 * a,
            mixed,
            mixed,
            q + 2.0 * b * b * dq_ds + 6.0 * p1 * b + 2.0 * p2 * a,
        )
    }

    pub(super) fn focal_px(&self) -> (f64, f64) {
        (self.camera_matrix[(0, 0)], self.camera_matrix[(1, 1)])
    }

    /// fy / fx: 1 for square pixels.
    pub(super) fn aspect(&self) -> f64 {
        let (fx, fy) = self.focal_px();
        fy / fx
    }

    pub(super) fn principal_point(&self) -> PixelPoint {
        PixelPoint::new(self.camera_matrix[(0, 2)], self.camera_matrix[(1, 2)])
    }

    fn normalised(&self, p: PixelPoint) -> Vector2<f64> {
        let ((fx, fy), c) = (self.focal_px(), self.principal_point());
        Vector2::new((p.u_px - c.u_px) / fx, (p.v_px - c.v_px) / fy)
    }

    fn pixel(&self, x: &Vector2<f64>) -> PixelPoint {
        let ((fx, fy), c) = (self.focal_px(), self.principal_point());
        PixelPoint::new(fx * x[0] + c.u_px, fy * x[1] + c.v_px)
    }
}

fn camera_matrix_problem(m: &Matrix3<f64>) -> Option<FileProblem> {
    let focal = |f: f64| f > 0.0 && f < 1e9;
    let centre = |c: f64| c.is_finite() && c.abs() < 1e9;
    let shape = [(0, 1), (1, 0), (2, 0), (2, 1)].iter().all(|&at| m[at] == 0.0) && m[(2, 2)] == 1.0;
    let sound = focal(m[(0, 0)]) && focal(m[(1, 1)]) && centre(m[(0, 2)]) && centre(m[(1, 2)]) && shape;
    (!sound).then(|| {
        FileProblem::new(
            "lens.camera_matrix",
            rows_text(m),
            "[[fx, 0, cx], [0, fy, cy], [0, 0, 1]] with fx and fy above 0, in px",
            "copy the camera matrix of OpenCV's calibrateCamera row by row, for the picture size of the recording",
        )
    })
}

/// The smallest s > 0 with 1 + a s + b s² + c s³ = 0, up to [`LARGEST_S`]; infinite where there is none.
fn first_fold(a: f64, b: f64, c: f64) -> f64 {
    let value = |s: f64| 1.0 + s * (a + s * (b + s * c));
    // Between the extremes of the cubic it is monotonic, so a sign change at their ends is the only way to a root.
    let mut ends = extremes(a, b, c);
    ends.push(LARGEST_S);
    let mut low = 0.0;
    for high in ends {
        if value(high) > 0.0 {
            low = high;
            continue;
        }
        let (mut positive, mut other) = (low, high);
        for _ in 0..200 {
            let middle = 0.5 * (positive + other);
            if value(middle) > 0.0 {
                positive = middle
            } else {
                other = middle
            }
        }
        return positive;
    }
    f64::INFINITY
}

/// Where a + 2 b s + 3 c s² = 0 within (0, [`LARGEST_S`]), ascending.
fn extremes(a: f64, b: f64, c: f64) -> Vec<f64> {
    let (half, lead) = (b, 3.0 * c);
    let discriminant = half * half - lead * a;
    if discriminant < 0.0 {
        return Vec::new();
    }
    // The form without cancellation; a zero divisor gives an infinity or NaN, which the filter drops.
    let t = -(half + discriminant.sqrt().copysign(half));
    let mut roots: Vec<f64> = [t / lead, a / t]
        .into_iter()
        .filter(|s| *s > 0.0 && *s < LARGEST_S)
        .collect();
    roots.sort_by(f64::total_cmp);
    roots
}

#[cfg(test)]
mod tests {
    use super::*;
    use opencv::core::{
        Mat, Point2d, Point3d, TermCriteria, TermCriteria_EPS, TermCriteria_MAX_ITER, Vector,
    };
    use proptest::prelude::*;

    const NO_DISTORTION: [f64; 5] = [0.0; 5];
    const PHONE: [f64; 5] = [0.081, -0.214, 0.0004, -0.0003, 0.147];
    const BARREL: [f64; 5] = [-0.32, 0.11, 0.001, -0.0007, -0.01];
    /// q = 1 − 0.5 s: the fold is at s = 2/3, in the seen picture at r = 0.816 · 2/3 = 0.544.
    const FOLDING: [f64; 5] = [-0.5, 0.0, 0.0, 0.0, 0.0];

    fn camera(fx: f64, fy: f64) -> Matrix3<f64> {
        Matrix3::new(fx, 0.0, 642.0, 0.0, fy, 357.5, 0.0, 0.0, 1.0)
    }

    fn lens(distortion: [f64; 5]) -> Lens {
        Lens::new(camera(900.0, 905.0), distortion).unwrap()
    }

    fn cv_camera(lens: &Lens) -> Mat {
        let m = lens.camera_matrix();
        let rows: Vec<[f64; 3]> = (0..3).map(|i| [m[(i, 0)], m[(i, 1)], m[(i, 2)]]).collect();
        Mat::from_slice_2d(&rows).unwrap()
    }

    fn cv_distort(lens: &Lens, ideal: PixelPoint) -> PixelPoint {
        let x = lens.normalised(ideal);
        let object = Vector::<Point3d>::from_iter([Point3d::new(x[0], x[1], 1.0)]);
        let zero = Vector::<f64>::from_iter([0.0; 3]);
        let mut seen = Vector::<Point2d>::new();
        let coefficients = Vector::<f64>::from_iter(lens.distortion());
        opencv::calib3d::project_points_def(
            &object,
            &zero,
            &zero,
            &cv_camera(lens),
            &coefficients,
            &mut seen,
        )
        .unwrap();
        let p = seen.get(0).unwrap();
        PixelPoint::new(p.x, p.y)
    }

    fn cv_undistort(lens: &Lens, seen: PixelPoint) -> PixelPoint {
        let from = Vector::<Point2d>::from_iter([Point2d::new(seen.u_px, seen.v_px)]);
        let mut to = Vector::<Point2d>::new();
        let camera = cv_camera(lens);
        let coefficients = Vector::<f64>::from_iter(lens.distortion());
        let criteria = TermCriteria::new(TermCriteria_MAX_ITER + TermCriteria_EPS, 1000, 1e-14).unwrap();
        opencv::calib3d::undistort_points_iter(
            &from,
            &mut to,
            &camera,
            &coefficients,
            &opencv::core::no_array(),
            &camera,
            criteria,
        )
        .unwrap();
        let p = to.get(0).unwrap();
        PixelPoint::new(p.x, p.y)
    }

    fn grid() -> impl Iterator<Item = PixelPoint> {
        (0..=16).flat_map(|i| (0..=9).map(move |j| PixelPoint::new(f64::from(i) * 80.0, f64::from(j) * 80.0)))
    }

    #[test]
    fn val_distort_is_opencvs_project_points() {
        for coefficients in [NO_DISTORTION, PHONE, BARREL] {
            let lens = lens(coefficients);
            for p in grid() {
                let ours = lens.distort(p).unwrap();
                assert!(
                    ours.distance_px(cv_distort(&lens, p)) < 1e-9,
                    "{coefficients:?} at {p:?}"
                );
            }
        }
    }

    #[test]
    fn val_undistort_is_opencvs_undistort_points() {
        for coefficients in [NO_DISTORTION, PHONE, BARREL] {
            let lens = lens(coefficients);
            for p in grid() {
                let ours = lens.undistort(p).unwrap();
                assert!(
                    ours.distance_px(cv_undistort(&lens, p)) < 1e-6,
                    "{coefficients:?} at {p:?}"
                );
            }
        }
    }

    #[test]
    fn every_seen_point_comes_back_to_a_millionth_of_a_pixel_or_is_none() {
        for coefficients in [
            PHONE,
            BARREL,
            FOLDING,
            [0.0, 0.0, 0.0, 0.0, -3.0],
            [2.0, -9.0, 0.01, 0.02, 5.0],
        ] {
            let lens = lens(coefficients);
            for p in grid() {
                if let Some(ideal) = lens.undistort(p) {
                    assert!(
                        lens.distort(ideal).unwrap().distance_px(p) < 1e-6,
                        "{coefficients:?} at {p:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn beyond_the_fold_there_is_no_answer() {
        let lens = Lens::new(camera(900.0, 900.0), FOLDING).unwrap();
        assert!((lens.s_fold - 2.0 / 3.0).abs() < 1e-12);
        let centre = lens.principal_point();
        let at = |r: f64| PixelPoint::new(centre.u_px - 900.0 * 0.6 * r, centre.v_px + 900.0 * 0.8 * r);
        let fold = (2.0_f64 / 3.0).sqrt();
        let rim = fold * 2.0 / 3.0;
        assert!(lens.undistort(at(rim * 0.999_99)).is_some());
        assert_eq!(lens.undistort(at(rim * 1.000_01)), None);
        assert_eq!(lens.undistort(at(10.0)), None);
        assert!(lens.distort(at(fold * 0.999)).is_some());
        assert_eq!(lens.distort(at(fold * 1.001)), None);
        // Far outside, the cubic comes back into the picture: the silently wrong number this guards against.
        assert_eq!(lens.distort(at(2.0_f64.sqrt())), None);
    }

    #[test]
    fn beyond_a_fold_that_unfolds_again_there_is_no_answer_either() {
        // d(r q)/dr = (1 − s)(1 − s/2): negative between s = 1 and 2, positive again after.
        let lens = Lens::new(camera(900.0, 900.0), [-0.5, 0.1, 0.0, 0.0, 0.0]).unwrap();
        let centre = lens.principal_point();
        let at = |r: f64| PixelPoint::new(centre.u_px + 900.0 * r, centre.v_px);
        // r q at the fold, r = 1.
        let rim = 0.6;
        assert!(lens.undistort(at(rim - 1e-6)).is_some());
        for r in [rim + 1e-6, 0.7, 2.0] {
            assert_eq!(lens.undistort(at(r)), None);
        }
        for r in [1.2, 1.6, 5.0] {
            assert_eq!(lens.distort(at(r)), None);
        }
    }

    #[test]
    fn fold_of_polynomials_with_known_roots() {
        // (1 − s/2)(1 − s/3)(1 − s/5) and its like, from their expanded coefficients.
        let expanded = |a: f64, b: f64, c: f64| (-(a + b + c), a * b + b * c + a * c, -a * b * c);
        let (p, q, r) = expanded(1.0 / 2.0, 1.0 / 3.0, 1.0 / 5.0);
        assert!((first_fold(p, q, r) - 2.0).abs() < 1e-12);
        let (p, q, r) = expanded(-1.0, 1.0 / 7.0, -0.5);
        assert!((first_fold(p, q, r) - 7.0).abs() < 1e-12);
        assert_eq!(first_fold(1.0, 1.0, 1.0), f64::INFINITY);
        assert_eq!(first_fold(0.0, 0.0, 0.0), f64::INFINITY);
        assert!((first_fold(-1.0, 0.0, 0.0) - 1.0).abs() < 1e-12);
        // A dip that reaches below zero between two positive stretches.
        assert!((first_fold(-1.5, 0.5, 0.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn lenses_that_are_none_are_refused_with_their_key() {
        let mut skew = camera(900.0, 900.0);
        skew[(0, 1)] = 1.0;
        let bad = [
            camera(0.0, 900.0),
            camera(900.0, -1.0),
            camera(f64::NAN, 900.0),
            camera(f64::INFINITY, 900.0),
            skew,
            Matrix3::zeros(),
        ];
        for matrix in bad {
            assert_eq!(
                Lens::new(matrix, NO_DISTORTION).unwrap_err()[0].key,
                "lens.camera_matrix"
            );
        }
        let problems = Lens::new(Matrix3::zeros(), [f64::NAN; 5]).unwrap_err();
        assert_eq!(problems[1].key, "lens.distortion");
    }

    proptest! {
        #[test]
        fn ideal_points_come_back(
            k in (-0.4..0.4, -0.3..0.3, -0.01..0.01, -0.01..0.01, -0.2..0.2),
            u in -200.0..1500.0, v in -200.0..900.0,
        ) {
            let lens = lens([k.0, k.1, k.2, k.3, k.4]);
            let ideal = PixelPoint::new(u, v);
            if let Some(seen) = lens.distort(ideal) {
                let smallest = lens.jacobian_normalised(&lens.normalised(ideal)).symmetric_eigenvalues().min();
                match lens.undistort(seen) {
                    Some(back) => prop_assert!(back.distance_px(ideal) < 1e-6 / smallest.min(1.0)),
                    // Strong tangential terms bend the region near the fold, where a straight search may end at its rim.
                    None => prop_assert!(smallest < 0.02, "{smallest}"),
                }
            }
        }

        #[test]
        fn any_coefficients_and_points_give_an_honest_answer(
            k in prop::array::uniform5(-1e9..1e9_f64), scale in -12..1_i32, u in -1e9..1e9_f64, v in -1e9..1e9_f64,
        ) {
            let lens = lens(k.map(|k| k * 10_f64.powi(scale)));
            let p = PixelPoint::new(u, v);
            if let Some(ideal) = lens.undistort(p) {
                let back = lens.distort(ideal).unwrap();
                prop_assert!(back.distance_px(p) <= 1e-6 * (1.0 + u.hypot(v)));
            }
        }
    }
}
