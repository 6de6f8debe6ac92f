//! The arcs of a flight seen from above, fitted together with the impacts between them.
//!
//! Parameters by [`OverheadLayout`]. Beside the points there are rows of what is known:
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

mod priors;

use super::lift::{self, LiftPrior};
use super::{Overhead, OverheadLayout, flying, seen};
use crate::flight::drag::LIGHTEST_DRAG;
use crate::flight::fit::{ACROSS, DRAG, FitPoint, GRAVITY, autocorrelation_inflation, mean_times, solve};
use crate::flight::segment::TrackSample;
use nalgebra::{DMatrix, DVector};

/// The result, in the terms of [`crate::flight::fit::ArcFit`].
#[derive(Debug, Clone)]
pub struct OverheadSolution {
    /// Mean time of each arc, s.
    pub times: Vec<f64>,
    /// By [`OverheadLayout`].
    pub parameters: DVector<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// Reduced chi: root mean square residual over stated uncertainty.
    pub reduced_chi: f64,
    /// Factor for errors that last from point to point.
    pub autocorrelation_inflation: f64,
}

/// How much a centre's error (the light's side, a highlight) changes over an arc without showing in its residuals, as a
/// part of the radius.
const LASTING_PART: f64 = 0.0005;

/// Steps at most.
const STEPS: usize = 200;

/// Damping of a step, as a part of each parameter's own information: at first, and where it is of no more use.
const FIRST_DAMPING: f64 = 1e-8;
const MOST_DAMPING: f64 = 1e4;

/// The fit has settled when a step would lower the squares by less than this part: parameters then move by less than a
/// thousandth of their uncertainties.
const SETTLED: f64 = 1e-8;

/// Parameters that one arc's points depend on: r, vr, h, vh, ζ, ω, lift's three; drag, the nadir's two, the fall's, the
/// shadow's two.
const LOCAL: usize = 15;

/// Fits `arcs` arcs to `points` (in time order). `None` when an arc has too few points or the fit does not converge.
#[must_use]
pub fn fit(points: &[FitPoint], arcs: usize, known: &Overhead) -> Option<OverheadSolution> {
    if let Some(drag) = known.drag {
        return fit_with(points, arcs, known, (drag.beta, drag.std), drag.beta);
    }
    let light = LIGHTEST_DRAG / known.radius();
    let open = fit_with(points, arcs, known, (0.0, light), light)?;
    // Lift may be a part of as much drag as there can be by what the flight shows.
    let most = open.parameters[DRAG].max(0.0) + 2.0 * open.covariance[(DRAG, DRAG)].max(0.0).sqrt();
    fit_with(points, arcs, known, (0.0, light), most.min(light))
}

/// The fit with a prior of drag, and lifts that are parts of `lift_drag`.
fn fit_with(
    points: &[FitPoint],
    arcs: usize,
    known: &Overhead,
    drag: (f64, f64),
    lift_drag: f64,
) -> Option<OverheadSolution> {
    let mut problem = OverheadProblem::new(points, arcs, known, drag)?;
    let start = problem.start()?;
    problem.update_prior_widths(&start, lift_drag);
    let (settled, _) = problem.minimise(start)?;
    problem.update_prior_widths(&settled, lift_drag);
    let residuals = problem.residuals(&settled);
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
            1.0 / (common + information * (LASTING_PART * known.radius()).powi(2)).sqrt()
        })
        .collect();
    let (mut parameters, mut covariance) = problem.minimise(settled)?;
    // There is no fall in the plane; what rounding leaves of it would have a direction.
    for i in [GRAVITY, ACROSS] {
        parameters[i] = 0.0;
        covariance[(i, i)] = 0.0;
    }
    reduced_chi.is_finite().then_some(OverheadSolution {
        times: problem.times,
        parameters,
        covariance,
        reduced_chi,
        autocorrelation_inflation,
    })
}

/// How `parameters`, fitted to `points`, follow to first order when each point moves by its shift along r and h.
#[must_use]
pub fn response(
    points: &[FitPoint],
    arcs: usize,
    known: &Overhead,
    parameters: &DVector<f64>,
    shifts: &[(f64, f64)],
) -> Option<DVector<f64>> {
    let light = LIGHTEST_DRAG / known.radius();
    let drag = known.drag.map_or((0.0, light), |d| (d.beta, d.std));
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
        let mut problem = OverheadProblem::new(points, arcs, known, drag)?;
        problem.update_prior_widths(
            parameters,
            known
                .drag
                .map_or(parameters[DRAG].clamp(0.1 * light, light), |d| d.beta),
        );
        Some(problem.system(parameters))
    };
    // The slopes are the same; what is left to explain differs by the shifts alone.
    let ((matrix, here), (_, there)) = (system(points)?, system(&moved)?);
    solve(&matrix, &(there - here)).map(|(change, _)| change)
}

/// A step shortened most in what the rows say least about.
fn damped(matrix: &DMatrix<f64>, right: &DVector<f64>, damping: f64) -> Option<DVector<f64>> {
    let (m, n) = matrix.shape();
    let mut rows = matrix.clone().resize_vertically(m + n, 0.0);
    for (j, column) in matrix.column_iter().enumerate() {
        rows[(m + j, j)] = damping.sqrt() * column.norm();
    }
    let (step, _) = solve(&rows, &right.clone().resize_vertically(m + n, 0.0))?;
    Some(step)
}

struct OverheadProblem<'a> {
    known: Overhead,
    /// β and its standard deviation.
    drag: (f64, f64),
    layout: OverheadLayout,
    times: Vec<f64>,
    parts: Vec<&'a [FitPoint]>,
    /// Factor on the whitened rows of each arc's points.
    weights: Vec<f64>,
    /// How well the arcs before and after each impact meet: along the floor (plane units) and in height (ζ).
    impact_stds: Vec<(f64, f64)>,
    /// What is known of each arc's lift.
    lifts: Vec<LiftPrior>,
}

impl<'a> OverheadProblem<'a> {
    /// `None` where an arc has too few points.
    fn new(points: &'a [FitPoint], arcs: usize, known: &Overhead, drag: (f64, f64)) -> Option<Self> {
        let times = mean_times(points, arcs)?;
        let parts: Vec<&[FitPoint]> = points.chunk_by(|a, b| a.arc == b.arc).collect();
        let in_order = parts.len() == arcs && parts.iter().enumerate().all(|(k, p)| p[0].arc == k);
        in_order.then(|| Self {
            known: *known,
            drag,
            layout: OverheadLayout::new(arcs),
            times,
            parts,
            weights: vec![1.0; arcs],
            impact_stds: Vec::new(),
            lifts: Vec::new(),
        })
    }

    /// How large lifts may be and how well arcs meet, by the speeds that `p` has.
    fn update_prior_widths(&mut self, p: &DVector<f64>, lift_drag: f64) {
        self.lifts = lift::expected(&self.known, p.as_slice(), &self.times, lift_drag);
        self.impact_stds = (1..self.arcs()).map(|k| self.impact_std(p, k - 1)).collect();
    }

    fn arcs(&self) -> usize {
        self.times.len()
    }

    /// The first guess: impacts in the middle of the gaps, where the ball touches the floor; then each arc is linear
    /// but for its rate of rise, and that enters linearly, too.
    fn start(&self) -> Option<DVector<f64>> {
        let layout = self.layout;
        let mut p = DVector::zeros(layout.count());
        p[DRAG] = self.drag.0;
        p[layout.nadir()] = self.known.nadir.right;
        p[layout.nadir() + 1] = self.known.nadir.up;
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
        let (known, fall) = (&self.known, self.known.fall_per_s2);
        let contact = known.touching();
        let points = self.parts[k];
        // c0r, c1r, c0h, c1h, ω at `touch`.
        let mut matrix = DMatrix::zeros(2 * points.len() + 1, 5);
        let mut right = DVector::zeros(2 * points.len() + 1);
        for (i, point) in points.iter().enumerate() {
            let s = &point.sample;
            let (t, w) = (s.t - touch, s.weight.sqrt());
            for (c, place) in [s.r - known.nadir.right, s.h - known.nadir.up]
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
        let (expected, std) = flight.map_or((0.0, known.fastest_per_s()), |t| {
            (0.5 * fall * t, 0.01 * fall * t)
        });
        matrix[(2 * points.len(), 4)] = 1.0 / std;
        right[2 * points.len()] = expected / std;
        let (found, _) = solve(&matrix, &right)?;
        let dt = self.times[k] - touch;
        let ground = self.layout.ground(k);
        p[ground] = known.nadir.right + found[0] + found[1] * dt;
        p[ground + 1] = found[1];
        p[ground + 2] = known.nadir.up + found[2] + found[3] * dt;
        p[ground + 3] = found[3];
        let rise = self.layout.rise(k);
        // A first guess at the camera or behind it would have no way back.
        p[rise] = (contact + (found[4] - 0.5 * fall * dt) * dt).clamp(-0.5, 0.8);
        p[rise + 1] = found[4] - fall * dt;
        Some(())
    }

    /// Whitened residuals of all points, two each.
    fn residuals(&self, p: &DVector<f64>) -> DVector<f64> {
        let all = self.parts.iter().flat_map(|part| part.iter()).flat_map(|point| {
            let s = &point.sample;
            let m = flying(&self.known, p.as_slice(), &self.times, point.arc, s.t);
            let (seen, w) = (seen(&self.known, p.as_slice(), &self.times, &m), s.weight.sqrt());
            // Beyond the camera there is no picture.
            let w = if m.zeta < 1.0 { w } else { f64::INFINITY };
            [w * (s.r - seen.r), w * (s.h - seen.h)]
        });
        DVector::from_iterator(2 * self.parts.iter().map(|part| part.len()).sum::<usize>(), all)
    }

    /// What there is to minimise.
    fn squares(&self, p: &DVector<f64>) -> f64 {
        let residuals = self.residuals(p);
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

    /// Levenberg-Marquardt from `p`, damped by Nielsen's rule (1999); the parameters and their covariance.
    fn minimise(&self, mut p: DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let mut squares = self.squares(&p);
        let (mut damping, mut harder) = (FIRST_DAMPING, 2.0);
        let (mut matrix, mut right) = self.system(&p);
        for _ in 0..STEPS {
            let step = damped(&matrix, &right, damping)?;
            let gain = (&matrix * &step).norm_squared();
            // Without damping the same, or it is only the damping that holds it.
            if gain < SETTLED * squares.max(1.0) {
                let (free, covariance) = solve(&matrix, &right)?;
                if (&matrix * free).norm_squared() < SETTLED * squares.max(1.0) {
                    return Some((p, covariance));
                }
                damping *= 0.1;
            }
            let next = &p + &step;
            let now = self.squares(&next);
            if now.is_finite() && now <= squares * (1.0 + 1e-12) {
                let as_expected = (squares - now) / gain;
                damping *= (1.0 - (2.0 * as_expected - 1.0).powi(3)).clamp(0.1, 2.0);
                harder = 2.0;
                (p, squares) = (next, now);
                (matrix, right) = self.system(&p);
            } else {
                damping *= harder;
                harder *= 2.0;
                if damping > MOST_DAMPING {
                    break;
                }
            }
        }
        // Points that are not of these arcs make a minimum that is approached slowly along a bend. The place reached is good enough
        // to find those points, and their reduced chi goes into the covariance.
        let (_, covariance) = solve(&matrix, &right)?;
        squares.is_finite().then_some((p, covariance))
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
                for (j, column) in columns.into_iter().enumerate() {
                    matrix[(LOCAL * k + i, column)] = local[(i, j)];
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

    /// The rows of arc `k`'s points by their own parameters, by QR no more than there are parameters.
    fn reduced(&self, p: &DVector<f64>, k: usize) -> (DMatrix<f64>, DVector<f64>) {
        let points = self.parts[k];
        let columns = self.local(k);
        let seen = |p: &DVector<f64>| -> Vec<[f64; 2]> {
            let p = p.as_slice();
            points
                .iter()
                .map(|point| {
                    let m = flying(&self.known, p, &self.times, k, point.sample.t);
                    let m = seen(&self.known, p, &self.times, &m);
                    [m.r, m.h]
                })
                .collect()
        };
        let here = seen(p);
        let mut matrix = DMatrix::zeros(2 * points.len(), LOCAL);
        let mut right = DVector::zeros(2 * points.len());
        for (i, (point, at)) in points.iter().zip(&here).enumerate() {
            let s = &point.sample;
            let w = self.weights[k] * s.weight.sqrt();
            right[2 * i] = w * (s.r - at[0]);
            right[2 * i + 1] = w * (s.h - at[1]);
        }
        let mut moved = p.clone();
        for (j, column) in columns.into_iter().enumerate() {
            let step = self.step(column);
            moved[column] += step;
            for (i, ((point, at), there)) in points.iter().zip(&here).zip(seen(&moved)).enumerate() {
                let w = self.weights[k] * point.sample.weight.sqrt() / step;
                matrix[(2 * i, j)] = w * (there[0] - at[0]);
                matrix[(2 * i + 1, j)] = w * (there[1] - at[1]);
            }
            moved[column] = p[column];
        }
        if matrix.nrows() <= LOCAL {
            return (matrix, right);
        }
        let qr = matrix.qr();
        qr.q_tr_mul(&mut right);
        (qr.r(), right.rows(0, LOCAL).into_owned())
    }

    /// The parameters that arc `k`'s points depend on.
    fn local(&self, k: usize) -> [usize; LOCAL] {
        let (g, v, l) = (self.layout.ground(k), self.layout.rise(k), self.layout.lift(k));
        let (f, fall, shadow_pull) = (self.layout.nadir(), self.layout.fall(), self.layout.shadow_pull());
        [
            g,
            g + 1,
            g + 2,
            g + 3,
            v,
            v + 1,
            l,
            l + 1,
            l + 2,
            DRAG,
            f,
            f + 1,
            fall,
            shadow_pull,
            shadow_pull + 1,
        ]
    }

    /// A step of parameter `i` for differences: a millionth of what matters in it, far above rounding.
    fn step(&self, i: usize) -> f64 {
        const PART: f64 = 1e-6;
        let height = self.known.camera_height();
        let (layout, fast) = (self.layout, self.known.fastest_per_s());
        if i == DRAG {
            PART / height
        } else if i < layout.rise(0) {
            // Place and speed by turns.
            let speed = (i - layout.ground(0)) % 2 == 1;
            PART * height * if speed { fast } else { 1.0 }
        } else if i < layout.lift(0) {
            let rate = (i - layout.rise(0)) % 2 == 1;
            PART * if rate { fast } else { 1.0 }
        } else if i < layout.nadir() {
            // s is what turns the path in a second.
            PART * fast
        } else if i < layout.fall() || i == layout.shadow_pull() || i == layout.shadow_pull() + 1 {
            PART * height
        } else if i == layout.fall() {
            PART
        } else {
            // Times.
            PART / fast
        }
    }
}
