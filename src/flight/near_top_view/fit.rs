//! The arcs of a flight seen from above, fitted together with the impacts between them.
//!
//! Parameters by [`SpatialLayout`]. Beside the points there are rows of what is known:
//!
//! * At the time of an impact both arcs are over one point of the floor, and their balls touch it, ζ = R/D: the one before
//!   half a contact earlier, the one after half a contact later. That half is fitted, with a wide prior: a soft ball
//!   takes milliseconds, a steel ball a tenth of one.
//! * The camera's nadir and γ, each as sure as the calibration says, and drag where the ball's mass and size tell it. A
//!   ball of unknown mass may be as light as a table tennis ball, or as heavy as the flight says. Lift is a part of drag, of
//!   which the impacts tell something (`lift`).
//! * Close to the floor the ball's shadow pulls its centre by a small part of its radius, the same way at every impact.
//! * No ball below the camera is out of its reach, nor faster than a fall from its height: a prior so wide that it
//!   matters only where a far camera shows nothing of the fall.
//!
//! Levenberg-Marquardt. Each arc's points are first reduced to a few rows by QR, so that
//! many frames cost nothing. Before the last steps the points' weights are lowered by the reduced chi of their residuals, by their
//! autocorrelation and by the error that all points of an arc may share; the priors keep their weight.

use super::camera::NearTopView;
use super::problem::{LOCAL, SpatialProblem};
use crate::flight::drag::LIGHTEST_DRAG;
use crate::flight::motion_model::{ArcFit, FitPoint, autocorrelation_inflation};
use crate::flight::planar::{ACROSS, DRAG, GRAVITY};
use crate::flight::segment::TrackSample;
use crate::numeric::least_squares::{self, Acceptance, Damping, Residuals, StopRule};
use crate::numeric::linear::solve;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// How much a centre's error (the light's side, a highlight) changes over an arc without showing in its residuals, as a
/// part of the radius.
const LASTING_PART: f64 = 0.0005;

/// Damped by Nielsen's rule, hardly at first; a damping of more than `most` is of no more use.
const DAMPING: Damping = Damping {
    first: 1e-8,
    least: 0.0,
    most: 1e4,
    acceptance: Acceptance::NotHigher(1e-12),
    ..Damping::NIELSEN
};

/// Parameters then move by less than a thousandth of their uncertainties.
const STOP: StopRule = StopRule {
    steps: 200,
    settled: 1e-8,
};

/// Fits `arcs` arcs to `points` (in time order). `None` when an arc has too few points or the fit does not converge.
pub(super) fn fit(points: &[FitPoint], arcs: usize, view: &NearTopView) -> Option<ArcFit> {
    if let Some(drag) = view.drag {
        return fit_with(points, arcs, view, (drag.beta, drag.std), drag.beta);
    }
    let light = LIGHTEST_DRAG / view.radius();
    let open = fit_with(points, arcs, view, (0.0, light), light)?;
    // Lift may be a part of as much drag as there can be by what the flight shows.
    let most = open.parameters[DRAG].max(0.0) + 2.0 * open.covariance[(DRAG, DRAG)].max(0.0).sqrt();
    fit_with(points, arcs, view, (0.0, light), most.min(light))
}

/// The fit with a prior of drag, and lifts that are parts of `lift_drag`.
fn fit_with(
    points: &[FitPoint],
    arcs: usize,
    view: &NearTopView,
    drag: (f64, f64),
    lift_drag: f64,
) -> Option<ArcFit> {
    let mut problem = SpatialProblem::new(points, arcs, view, drag)?;
    let start = problem.start()?;
    problem.update_prior_widths(&start, lift_drag);
    let (settled, _) = minimum(&problem, start)?;
    problem.update_prior_widths(&settled, lift_drag);
    let residuals = problem.point_residuals(&settled);
    let priors = problem.priors(&settled);
    let squares =
        residuals.norm_squared() + priors.iter().map(|row| row.residual * row.residual).sum::<f64>();
    let freedom = (residuals.len() + priors.len()).saturating_sub(settled.len());
    let reduced_chi = if freedom > 0 {
        (squares / freedom as f64).sqrt()
    } else {
        1.0
    };
    let autocorrelation_inflation = autocorrelation_inflation(points, &residuals);
    let common = reduced_chi.max(1.0).powi(2) * autocorrelation_inflation;
    problem.weights = problem
        .parts
        .iter()
        .map(|part| {
            // As much as all points of the arc off by that: many points do not average out what they share.
            let information: f64 = part.iter().map(|p| p.sample.weight).sum();
            1.0 / (common + information * (LASTING_PART * view.radius()).powi(2)).sqrt()
        })
        .collect();
    let (mut parameters, mut covariance) = minimum(&problem, settled)?;
    // There is no fall in the plane; what rounding leaves of it would have a direction.
    for i in [GRAVITY, ACROSS] {
        parameters[i] = 0.0;
        covariance[(i, i)] = 0.0;
    }
    reduced_chi.is_finite().then_some(ArcFit {
        times: problem.times,
        parameters,
        covariance,
        reduced_chi,
        autocorrelation_inflation,
        model: Arc::new(*view),
        deviance: None,
    })
}

/// How `parameters`, fitted to `points`, follow to first order when each point moves by its shift along r and h.
pub(super) fn response(
    points: &[FitPoint],
    arcs: usize,
    view: &NearTopView,
    parameters: &DVector<f64>,
    shifts: &[(f64, f64)],
) -> Option<DVector<f64>> {
    let light = LIGHTEST_DRAG / view.radius();
    let drag = view.drag.map_or((0.0, light), |d| (d.beta, d.std));
    let moved: Vec<FitPoint> = points
        .iter()
        .zip(shifts)
        .map(|(p, (dr, dh))| {
            let sample = TrackSample {
                r: p.sample.r + dr,
                h: p.sample.h + dh,
                ..p.sample
            };
            FitPoint { sample, ..*p }
        })
        .collect();
    let system = |points: &[FitPoint]| {
        let mut problem = SpatialProblem::new(points, arcs, view, drag)?;
        problem.update_prior_widths(
            parameters,
            view.drag
                .map_or(parameters[DRAG].clamp(0.1 * light, light), |d| d.beta),
        );
        Some(problem.system(parameters))
    };
    // The slopes are the same; what is left to explain differs by the shifts alone.
    let ((matrix, here), (_, there)) = (system(points)?, system(&moved)?);
    solve(&matrix, &(there - here)).map(|(change, _)| change)
}

/// The local minimum near `start`, with its covariance. Points that are not of these arcs make a minimum that is approached
/// slowly along a bend: the place reached is good enough to find those points, and their reduced chi goes into the covariance.
fn minimum(problem: &SpatialProblem<'_>, start: DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let found = least_squares::fit(problem, start, &DAMPING, &STOP);
    Some((
        found.parameters,
        found.covariance.filter(|_| found.cost.is_finite())?,
    ))
}

impl Residuals for SpatialProblem<'_> {
    fn residuals(&self, p: &DVector<f64>) -> DVector<f64> {
        let mut all: Vec<f64> = self.point_residuals(p).as_slice().to_vec();
        let weights = self
            .parts
            .iter()
            .zip(&self.weights)
            .flat_map(|(part, w)| std::iter::repeat_n(w, 2 * part.len()));
        for (residual, weight) in all.iter_mut().zip(weights) {
            *residual *= weight;
        }
        all.extend(self.priors(p).iter().map(|row| row.residual));
        DVector::from_vec(all)
    }

    /// Summed arc by arc. Minima are flat along lift and drag: with another order of rounding some fits end 1e-5 standard
    /// uncertainties away.
    fn cost(&self, p: &DVector<f64>) -> f64 {
        let residuals = self.point_residuals(p);
        let mut first = 0;
        let mut points = 0.0;
        for (part, weight) in self.parts.iter().zip(&self.weights) {
            points += weight * weight * residuals.rows(first, 2 * part.len()).norm_squared();
            first += 2 * part.len();
        }
        points
            + self
                .priors(p)
                .iter()
                .map(|row| row.residual * row.residual)
                .sum::<f64>()
    }

    /// All whitened rows and what is left to explain: each arc's points reduced to [`LOCAL`] rows, then the priors.
    fn system(&self, p: &DVector<f64>) -> (DMatrix<f64>, DVector<f64>) {
        let priors = self.priors(p);
        let rows = LOCAL * self.arcs() + priors.len();
        let mut matrix = DMatrix::zeros(rows, p.len());
        let mut right = DVector::zeros(rows);
        for k in 0..self.arcs() {
            let (local, left) = self.reduced(p, k);
            let columns = self.local(k);
            for i in 0..local.nrows() {
                right[LOCAL * k + i] = left[i];
                for (j, column) in columns.iter().enumerate() {
                    matrix[(LOCAL * k + i, *column)] = local[(i, j)];
                }
            }
        }
        let first = LOCAL * self.arcs();
        for (i, row) in priors.iter().enumerate() {
            right[first + i] = row.residual;
            for &(j, by) in &row.by {
                matrix[(first + i, j)] = by;
            }
        }
        (matrix, right)
    }
}

impl SpatialProblem<'_> {
    /// The first guess: impacts in the middle of the gaps, where the ball touches the floor; then each arc is linear
    /// but for its rate of rise, and that enters linearly, too.
    fn start(&self) -> Option<DVector<f64>> {
        let layout = self.layout;
        let mut p = DVector::zeros(layout.count());
        p[DRAG] = self.drag.0;
        p[layout.nadir()] = self.view.nadir.right;
        p[layout.nadir() + 1] = self.view.nadir.up;
        let gap = |k: usize| -> Option<f64> {
            Some(0.5 * (self.parts[k].last()?.sample.t + self.parts.get(k + 1)?.first()?.sample.t))
        };
        for k in 0..self.arcs() {
            let (before, after) = (k.checked_sub(1).and_then(gap), gap(k));
            if let Some(t) = after {
                p[layout.impact(k)] = t;
            }
            let touch = before.or(after).unwrap_or(self.parts[k][0].sample.t);
            let flight = before.zip(after).map(|(a, b)| b - a);
            self.start_arc(&mut p, k, touch, flight)?;
        }
        Some(p)
    }

    /// Arc `k`, which touches the floor at `touch`, and `flight` later again.
    fn start_arc(&self, p: &mut DVector<f64>, k: usize, touch: f64, flight: Option<f64>) -> Option<()> {
        let (view, fall) = (&self.view, self.view.fall_per_s2);
        let contact = view.touching();
        let points = self.parts[k];
        // c0r, c1r, c0h, c1h, ω at `touch`.
        let mut matrix = DMatrix::zeros(2 * points.len() + 1, 5);
        let mut right = DVector::zeros(2 * points.len() + 1);
        for (i, point) in points.iter().enumerate() {
            let s = &point.sample;
            let (t, w) = (s.t - touch, s.weight.sqrt());
            for (c, place) in [s.r - view.nadir.right, s.h - view.nadir.up]
                .into_iter()
                .enumerate()
            {
                matrix[(2 * i + c, 2 * c)] = w;
                matrix[(2 * i + c, 2 * c + 1)] = w * t;
                matrix[(2 * i + c, 4)] = w * place * t;
                right[2 * i + c] = w * place * (1.0 - contact + 0.5 * fall * t * t);
            }
        }
        // Between two impacts as fast as the time of flight says; else slower than a fall from the camera.
        let (expected, std) =
            flight.map_or((0.0, view.fastest_per_s()), |t| (0.5 * fall * t, 0.01 * fall * t));
        matrix[(2 * points.len(), 4)] = 1.0 / std;
        right[2 * points.len()] = expected / std;
        let (found, _) = solve(&matrix, &right)?;
        let dt = self.times[k] - touch;
        let ground = self.layout.ground(k);
        p[ground] = view.nadir.right + found[0] + found[1] * dt;
        p[ground + 1] = found[1];
        p[ground + 2] = view.nadir.up + found[2] + found[3] * dt;
        p[ground + 3] = found[3];
        let rise = self.layout.rise(k);
        // A first guess at the camera or behind it would have no way back.
        p[rise] = (contact + (found[4] - 0.5 * fall * dt) * dt).clamp(-0.5, 0.8);
        p[rise + 1] = found[4] - fall * dt;
        Some(())
    }
}
