//! The arcs of a ball in the calibrated plane fitted together: each with its own place and velocity, all with the same
//! gravity and drag.
//!
//! ```text
//! r'' = a - β |v| r'          h'' = -g - β |v| h'          |v| = √(r'² + h'²)
//! ```
//!
//! with place and velocity of arc k at its mean time t_k ([`PlanarArcs`]). a, the acceleration along r, is what gravity has
//! there where "up" of the picture is not quite the plane's: the fall leans by atan(a/g). Without drag (β = 0) an arc is the
//! exact parabola and the fit is linear. With drag (β = ρ C_D π R² / 2m), a small part, Gauss-Newton settles in three steps.
//!
//! Weighted least squares by QR of the whitened rows; times are centred, so nothing is lost at late times. The
//! covariance is that of the QR, times the reduced chi squared (never below 1) and the autocorrelation inflation.

use super::drag::{Drag, DragLaw};
use super::motion_model::{
    ArcFit, FitPoint, MotionModel, VerticalPrior, autocorrelation_inflation, mean_times,
};
use super::planar::{ACROSS, ARCS, BEND_POWERS, BENDS, DRAG, GRAVITY, Motion, PlanarArcs};
use super::samples::middle_and_extent;
use super::scale_change::{SCALE_CHANGES, ScaleChange};
use super::segment::TrackSample;
use crate::numeric::linear::solve;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// A step of Gauss-Newton that changes no residual by more than this part of its uncertainty is the last.
const SETTLED: f64 = 1e-6;

/// Times that a step is halved, at most, and the part by which rounding changes a sum of squares.
const MOST_HALVINGS: usize = 12;
const ROUNDING: f64 = 1e-12;

/// What is known beforehand of the forces in the plane.
#[derive(Debug, Clone, Copy)]
pub(super) struct PlanarPriors {
    /// Of "up"; `None` where nothing falls in the plane.
    pub(super) vertical: Option<VerticalPrior>,
    /// Of drag; `None` where nothing is.
    pub(super) drag: Option<Drag>,
    /// How far arcs may be bent, a part of their way.
    pub(super) bend: Option<f64>,
    /// How the scale changes, where it does.
    pub(super) scale_change: Option<ScaleChange>,
}

impl PlanarPriors {
    fn law(&self) -> DragLaw {
        self.drag.map_or_else(DragLaw::default, |d| d.law)
    }

    /// The common parameters that keep their value.
    fn held(&self, drag_is_fitted: bool) -> [bool; ARCS] {
        let mut held = [false; ARCS];
        held[GRAVITY] = self.vertical.is_none();
        held[DRAG] = !drag_is_fitted;
        held[ACROSS] = self.vertical.is_none_or(|v| v.std_rad == 0.0);
        held
    }

    /// Which parameter is known, its value, its standard uncertainty.
    fn rows(
        &self,
        points: &[FitPoint],
        times: &[f64],
        parameters: &DVector<f64>,
        held: [bool; ARCS],
    ) -> Vec<(usize, f64, f64)> {
        let mut rows = self
            .bend
            .map_or_else(Vec::new, |part| bend_rows(points, times, part));
        if let Some(change) = self.scale_change {
            let from = parameters.len() - SCALE_CHANGES;
            let known = change.known.iter().enumerate();
            rows.extend(known.map(|(i, (value, std))| (from + i, *value, *std)));
            rows.extend(change.fall.map(|(g, std)| (GRAVITY, g, std)));
        }
        if let Some(drag) = self.drag.filter(|_| !held[DRAG]) {
            rows.push((DRAG, drag.beta, drag.std));
        }
        let lean = self.vertical.map(|v| v.std_rad * parameters[GRAVITY].abs());
        // Before gravity is known there is no scale for it; the round that follows has it.
        if let Some(std) = lean.filter(|&std| std > 0.0 && std.is_finite() && !held[ACROSS]) {
            rows.push((ACROSS, 0.0, std));
        }
        rows
    }
}

/// What is known of the arcs' bends: none, to the `part` of the arc's way at its ends.
fn bend_rows(points: &[FitPoint], times: &[f64], part: f64) -> Vec<(usize, f64, f64)> {
    let mut rows = Vec::new();
    for (k, time) in times.iter().enumerate() {
        let arc = || points.iter().filter(move |p| p.arc == k).map(|p| &p.sample);
        let extent = |of: fn(&TrackSample) -> f64| middle_and_extent(arc().map(of)).1;
        let way = extent(|s| s.r).hypot(extent(|s| s.h));
        let half_s = arc().map(|s| (s.t - time).abs()).fold(0.0, f64::max);
        for (i, power) in BEND_POWERS.iter().chain(&BEND_POWERS).enumerate() {
            let std = part * way / half_s.powi(*power);
            rows.push((ARCS + 4 * times.len() + BENDS * k + i, 0.0, std));
        }
    }
    rows
}

/// The fit without drag, or with drag from the fit `without_drag`.
pub(super) fn fit(
    points: &[FitPoint],
    arcs: usize,
    priors: &PlanarPriors,
    without_drag: Option<&ArcFit>,
    model: Arc<dyn MotionModel>,
) -> Option<ArcFit> {
    let times = mean_times(points, arcs)?;
    let held = priors.held(without_drag.is_some());
    let bends = priors.bend.map_or(0, |_| BENDS * arcs);
    let changes = priors.scale_change.map_or(0, |_| SCALE_CHANGES);
    let zeros = || DVector::zeros(ARCS + 4 * arcs + bends + changes);
    let mut parameters = match (without_drag, priors.scale_change) {
        (Some(fit), None) => fit.parameters.clone(),
        (None, None) => zeros(),
        // A scale that changes bends arcs much as drag does: one that was found without drag would be a false start.
        (_, Some(change)) => {
            let one_scale = PlanarPriors {
                scale_change: None,
                ..*priors
            };
            let fitted = |start: Option<&ArcFit>| fit(points, arcs, &one_scale, start, model.clone());
            let plain = fitted(None)?;
            let plain = match without_drag {
                Some(_) => fitted(Some(&plain))?,
                None => plain,
            };
            let known = change.known.map(|(value, _)| value);
            let all = plain.parameters.iter().copied().chain(known);
            DVector::from_iterator(plain.parameters.len() + changes, all)
        }
    };
    let mut covariance = None;
    // Linear without drag: one step is the solution. A prior of the lean goes with gravity, which the first step finds.
    let rounds = match (without_drag, priors.vertical) {
        _ if changes > 0 => 20,
        (Some(_), _) => 8,
        (None, Some(vertical)) if vertical.std_rad.is_finite() => 2,
        (None, _) => 1,
    };
    for _ in 0..rounds {
        let (matrix, right) = system(points, &times, &parameters, priors, held);
        let (mut step, inverse) = solve_by_arcs(&matrix, &right, points, arcs)?;
        keep(&mut step, held);
        if changes > 0 {
            shorten(&mut step, &right, |step| {
                system(points, &times, &(&parameters + step), priors, held).1
            });
        }
        parameters += &step;
        covariance = Some(inverse);
        if (&matrix * &step).amax() < SETTLED {
            break;
        }
    }
    let (_, residuals) = system(points, &times, &parameters, priors, held);
    // Bends are held by what is known of them, and take from the points' freedom no more than their part.
    let fitted = parameters.len() - bends - changes - held.iter().filter(|&&h| h).count();
    let freedom = (2 * points.len()).saturating_sub(fitted);
    let reduced_chi = if freedom > 0 {
        (residuals.norm_squared() / freedom as f64).sqrt()
    } else {
        1.0
    };
    let autocorrelation_inflation = autocorrelation_inflation(points, &residuals);
    let inverse = covariance?;
    let deviance = deviance(
        points,
        &residuals,
        &inverse,
        &priors.rows(points, &times, &parameters, held),
    );
    let mut covariance = inverse * (reduced_chi.max(1.0).powi(2) * autocorrelation_inflation);
    for (i, _) in held.iter().enumerate().filter(|(_, h)| **h) {
        covariance[(i, i)] = 0.0;
    }
    let finite = residuals.iter().all(|x| x.is_finite()) && reduced_chi.is_finite();
    finite.then_some(ArcFit {
        times,
        parameters,
        covariance,
        reduced_chi,
        autocorrelation_inflation,
        model,
        deviance,
    })
}

/// Halves a `step` from where the residuals are `now` until it makes them no larger.
fn shorten(step: &mut DVector<f64>, now: &DVector<f64>, residuals: impl Fn(&DVector<f64>) -> DVector<f64>) {
    for _ in 0..MOST_HALVINGS {
        if residuals(step).norm_squared() <= now.norm_squared() * (1.0 + ROUNDING) {
            break;
        }
        *step *= 0.5;
    }
}

/// See [`ArcFit::deviance`]: `known` are the parameters with a prior.
fn deviance(
    points: &[FitPoint],
    residuals: &DVector<f64>,
    inverse: &DMatrix<f64>,
    known: &[(usize, f64, f64)],
) -> Option<f64> {
    let factor = inverse.clone().cholesky()?;
    let determined: f64 = factor.l_dirty().diagonal().iter().map(|d| 2.0 * d.ln()).sum();
    let weights: f64 = points.iter().map(|p| 2.0 * p.sample.weight.ln()).sum();
    let priors: f64 = known.iter().map(|(_, _, std)| 2.0 * std.ln()).sum();
    let all = residuals.norm_squared() - weights + priors - determined;
    all.is_finite().then_some(all)
}

/// See [`MotionModel::response`].
pub(super) fn response(
    fit: &ArcFit,
    points: &[FitPoint],
    shifts: &[(f64, f64)],
    priors: &PlanarPriors,
) -> Option<DVector<f64>> {
    // What was held has no variance.
    let held = [GRAVITY, DRAG, ACROSS].map(|i| fit.covariance[(i, i)] == 0.0);
    let (matrix, mut right) = system(points, &fit.times, &fit.parameters, priors, held);
    right.fill(0.0);
    for (i, (p, (dr, dh))) in points.iter().zip(shifts).enumerate() {
        let w = p.sample.weight.sqrt();
        right[2 * i] = w * dr;
        right[2 * i + 1] = w * dh;
    }
    let (mut change, _) = solve_by_arcs(&matrix, &right, points, fit.times.len())?;
    keep(&mut change, held);
    Some(change)
}

/// Of each point, its arc's motion and what a unit of drag adds to the place.
fn motions(planar: &PlanarArcs<'_>, points: &[FitPoint]) -> Vec<(Motion, (f64, f64))> {
    let mut found = vec![None; points.len()];
    for k in 0..planar.times.len() {
        let own: Vec<usize> = (0..points.len()).filter(|&i| points[i].arc == k).collect();
        let times: Vec<f64> = own.iter().map(|&i| points[i].sample.t).collect();
        for (i, motion) in own.into_iter().zip(planar.motions(k, &times)) {
            found[i] = Some(motion);
        }
    }
    let all = found.into_iter();
    all.map(|m| m.expect("every point is on an arc")).collect()
}

/// Whitened Jacobian and residuals at `parameters`; a parameter that is held gets a row of its own.
fn system(
    points: &[FitPoint],
    times: &[f64],
    parameters: &DVector<f64>,
    priors: &PlanarPriors,
    held: [bool; ARCS],
) -> (DMatrix<f64>, DVector<f64>) {
    let known = priors.rows(points, times, parameters, held);
    let planar = PlanarArcs {
        parameters: parameters.as_slice(),
        times,
        law: priors.law(),
        bent: priors.bend.is_some(),
    };
    let rows = 2 * points.len() + held.iter().filter(|&&h| h).count() + known.len();
    let mut matrix = DMatrix::zeros(rows, parameters.len());
    let mut right = DVector::zeros(rows);
    let motions = motions(&planar, points);
    for (i, (p, (m, drag_shift))) in points.iter().zip(motions).enumerate() {
        let t = p.sample.t - times[p.arc];
        let w = p.sample.weight.sqrt();
        let c = ARCS + 4 * p.arc;
        let seen = priors.scale_change.map_or(m, |change| {
            change.seen(ScaleChange::of(parameters.as_slice()), p.sample.t, &m)
        });
        right[2 * i] = w * (p.sample.r - seen.r);
        right[2 * i + 1] = w * (p.sample.h - seen.h);
        matrix[(2 * i, c)] = w;
        matrix[(2 * i, c + 1)] = w * t;
        matrix[(2 * i + 1, c + 2)] = w;
        matrix[(2 * i + 1, c + 3)] = w * t;
        if priors.bend.is_some() {
            let b = ARCS + 4 * times.len() + BENDS * p.arc;
            for (n, power) in BEND_POWERS.iter().enumerate() {
                matrix[(2 * i, b + n)] = w * t.powi(*power);
                matrix[(2 * i + 1, b + BEND_POWERS.len() + n)] = w * t.powi(*power);
            }
        }
        if !held[GRAVITY] {
            matrix[(2 * i + 1, GRAVITY)] = -0.5 * w * t * t;
        }
        if !held[ACROSS] {
            matrix[(2 * i, ACROSS)] = 0.5 * w * t * t;
        }
        if !held[DRAG] {
            let (dr, dh) = drag_shift;
            matrix[(2 * i, DRAG)] = w * dr;
            matrix[(2 * i + 1, DRAG)] = w * dh;
        }
        if let Some(change) = priors.scale_change {
            let now = ScaleChange::of(parameters.as_slice());
            let jacobian = change.jacobian(now, p.sample.t, &m);
            let in_plane = matrix.rows(2 * i, 2).into_owned();
            matrix.rows_mut(2 * i, 2).copy_from(&(jacobian * in_plane));
            let from = parameters.len() - SCALE_CHANGES;
            for (k, (dr, dh)) in change.slopes(now, p.sample.t, &m).into_iter().enumerate() {
                matrix[(2 * i, from + k)] = w * dr;
                matrix[(2 * i + 1, from + k)] = w * dh;
            }
        }
    }
    let mut row = 2 * points.len();
    for (i, _) in held.iter().enumerate().filter(|(_, h)| **h) {
        matrix[(row, i)] = 1.0;
        row += 1;
    }
    for (i, value, std) in known {
        matrix[(row, i)] = 1.0 / std;
        right[row] = (value - parameters[i]) / std;
        row += 1;
    }
    (matrix, right)
}

/// The solution and covariance of the `matrix` that [`system`] makes of these points: an arc's rows are empty in the columns of the other
/// arcs, so that each arc is factorised by itself, and all of them once more by what that leaves, a row for each column that is not empty.
fn solve_by_arcs(
    matrix: &DMatrix<f64>,
    right: &DVector<f64>,
    points: &[FitPoint],
    arcs: usize,
) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let mut rows_of: Vec<Vec<usize>> = vec![Vec::new(); arcs];
    for (i, p) in points.iter().enumerate() {
        rows_of[p.arc].extend([2 * i, 2 * i + 1]);
    }
    let count = matrix.ncols();
    let mut left: Vec<(DMatrix<f64>, Vec<usize>)> = Vec::with_capacity(arcs);
    for rows in &rows_of {
        let used = |j: &usize| rows.iter().any(|&i| matrix[(i, *j)] != 0.0);
        let columns: Vec<usize> = (0..count).filter(used).collect();
        // The right side as a column of its own: what remains of it below is no equation.
        let of_arc = DMatrix::from_fn(rows.len(), columns.len() + 1, |i, j| {
            columns
                .get(j)
                .map_or_else(|| right[rows[i]], |&column| matrix[(rows[i], column)])
        });
        left.push((of_arc.qr().unpack_r(), columns));
    }
    let of_points = 2 * points.len();
    let equations = |(r, columns): &(DMatrix<f64>, Vec<usize>)| r.nrows().min(columns.len());
    let all = left.iter().map(equations).sum::<usize>() + matrix.nrows() - of_points;
    let mut reduced = DMatrix::zeros(all, count);
    let mut reduced_right = DVector::zeros(all);
    let mut row = 0;
    for part in &left {
        let (r, columns) = part;
        for i in 0..equations(part) {
            for (j, &column) in columns.iter().enumerate().skip(i) {
                reduced[(row, column)] = r[(i, j)];
            }
            reduced_right[row] = r[(i, columns.len())];
            row += 1;
        }
    }
    let rest = matrix.nrows() - of_points;
    reduced
        .rows_mut(row, rest)
        .copy_from(&matrix.rows(of_points, rest));
    reduced_right
        .rows_mut(row, rest)
        .copy_from(&right.rows(of_points, rest));
    solve(&reduced, &reduced_right)
}

/// Takes from a step what rounding puts into a parameter that is held. The others do not feel its row; but a drag of
/// 1e-11 in place of none, times the square of a ball's speed in pixels, is a force.
fn keep(step: &mut DVector<f64>, held: [bool; ARCS]) {
    for (i, _) in held.iter().enumerate().filter(|(_, held)| **held) {
        step[i] = 0.0;
    }
}
