//! The search for a model's parameters: least χ² over a set of rows.
//!
//! Levenberg-Marquardt as an [`argmin`] solver, on the triangle of [`super::triangle`] in place of normal equations. Its
//! ends are scale-free, its number of steps is limited, and a point at which χ² is not a finite number is never accepted.
//! Where rows have exact incidence, χ² has creases (a row changes sides at once) at which a smooth method stops too early:
//! there argmin's Nelder-Mead goes on.

use super::law::{self, Nearest, PARAMETERS, Regimes, Theta};
use super::observation::Observation;
use super::triangle::Triangle;
use argmin::core::{
    CostFunction, Error, Executor, IterState, KV, Problem, Solver, State as _, TerminationReason, TerminationStatus,
};
use argmin::solver::neldermead::NelderMead;

/// Most steps. From a start within the basin six are usual; what needs more than this has no least value nearby.
const MOST_STEPS: u64 = 200;

/// A step that moves all residuals together by less than this part of their own length (or of one standard deviation,
/// where they are smaller) is the last.
const SETTLED: f64 = 1e-8;

/// Nor does a change of every parameter by less than this matter, absolute or relative.
const STILL: f64 = 1e-13;

/// Damping beyond which a step no longer gets anywhere.
const MOST_DAMPING: f64 = 1e12;

/// Rows, a model, and which of its parameters may move.
#[derive(Clone)]
pub(super) struct Task<'a> {
    /// All rows, heaviest first.
    pub rows: &'a [Observation],
    /// Which of them count; `None` for all.
    pub chosen: Option<&'a [usize]>,
    pub regimes: Regimes,
    pub free: [bool; PARAMETERS],
}

/// χ² and its triangle at some parameters.
#[derive(Debug, Clone, Copy)]
pub(super) struct Linear {
    pub chi2: f64,
    pub triangle: Triangle,
}

/// Where a search ended.
#[derive(Debug, Clone, Copy)]
pub(super) struct Found {
    pub theta: Theta,
    pub chi2: f64,
    pub triangle: Triangle,
    pub converged: bool,
}

impl<'a> Task<'a> {
    /// The rows that count.
    pub fn rows(&self) -> impl Iterator<Item = &'a Observation> + use<'a> {
        let (rows, chosen) = (self.rows, self.chosen);
        let count = chosen.map_or(rows.len(), <[usize]>::len);
        (0..count).map(move |i| chosen.map_or(&rows[i], |c| &rows[c[i]]))
    }

    /// The nearest motion to a row.
    pub fn nearest(&self, row: &Observation, theta: &Theta) -> Option<Nearest> {
        law::nearest(row, self.regimes, theta)
    }

    /// χ² and its derivatives; `None` where χ² is not finite.
    pub fn linear(&self, theta: &Theta) -> Option<Linear> {
        let mut linear = Linear {
            chi2: 0.0,
            triangle: Triangle::new(),
        };
        for row in self.rows() {
            let near = self.nearest(row, theta)?;
            linear.chi2 += near.chi2;
            for i in 0..near.equations {
                linear.triangle.push(self.masked(near.jacobian[i]), near.residuals[i]);
            }
        }
        linear.chi2.is_finite().then_some(linear)
    }

    /// χ² alone, infinite where it is not finite.
    pub fn chi2(&self, theta: &Theta) -> f64 {
        let mut sum = 0.0;
        for row in self.rows() {
            match self.nearest(row, theta) {
                Some(near) => sum += near.chi2,
                None => return f64::INFINITY,
            }
        }
        if sum.is_finite() { sum } else { f64::INFINITY }
    }

    /// The triangle of rows brought to unit length each, for the test of what they determine.
    pub fn unit_triangle(&self, theta: &Theta) -> Triangle {
        let mut triangle = Triangle::new();
        for row in self.rows() {
            let Some(near) = self.nearest(row, theta) else {
                continue;
            };
            for line in &near.jacobian[..near.equations] {
                let line = self.masked(*line);
                let length = line.iter().map(|x| x * x).sum::<f64>().sqrt();
                if length > 0.0 && length.is_finite() {
                    triangle.push(line.map(|x| x / length), 0.0);
                }
            }
        }
        triangle
    }

    fn masked(&self, mut line: [f64; PARAMETERS]) -> [f64; PARAMETERS] {
        for (x, free) in line.iter_mut().zip(&self.free) {
            if !free {
                *x = 0.0;
            }
        }
        line
    }

    /// The least χ² near `start`; `None` where χ² is not finite at the start itself.
    pub fn search(&self, start: Theta) -> Option<Found> {
        self.linear(&start)?;
        let solver = LevenbergMarquardt::default();
        let result = Executor::new(self.clone(), solver)
            .configure(|state| state.param(start.to_vec()).max_iters(MOST_STEPS))
            .ctrlc(false)
            .run()
            .ok()?;
        let settled = matches!(
            result.state().get_termination_status(),
            TerminationStatus::Terminated(TerminationReason::SolverConverged)
        );
        let creased = result.solver.creased;
        let theta = array(result.state().get_best_param()?)?;
        let smooth = self.found(theta, settled)?;
        if creased {
            Some(self.across_creases(smooth).unwrap_or(smooth))
        } else {
            Some(smooth)
        }
    }

    fn found(&self, theta: Theta, converged: bool) -> Option<Found> {
        let Linear { chi2, triangle } = self.linear(&theta)?;
        Some(Found {
            theta,
            chi2,
            triangle,
            converged,
        })
    }

    /// Nelder-Mead from a point at which no smooth step gets down.
    fn across_creases(&self, from: Found) -> Option<Found> {
        let lengths = from.triangle.lengths();
        let moving: Vec<usize> = (0..PARAMETERS)
            .filter(|&j| self.free[j] && lengths[j] > 0.0)
            .collect();
        if moving.is_empty() {
            return None;
        }
        let reduced = Reduced {
            task: self,
            from: from.theta,
            moving: moving.clone(),
        };
        let origin: Vec<f64> = moving.iter().map(|&j| from.theta[j]).collect();
        let mut simplex = vec![origin.clone()];
        for (place, &j) in moving.iter().enumerate() {
            let mut corner = origin.clone();
            // A tenth of a standard deviation, were the others known.
            corner[place] += 0.1 / lengths[j];
            simplex.push(corner);
        }
        let solver = NelderMead::new(simplex)
            .with_sd_tolerance(1e-13 * (1.0 + from.chi2))
            .ok()?;
        let result = Executor::new(reduced.clone(), solver)
            .configure(|state| state.max_iters(400))
            .ctrlc(false)
            .run()
            .ok()?;
        let best = result.state().get_best_param()?;
        let found = self.found(reduced.theta(best), true)?;
        (found.chi2 <= from.chi2).then_some(found)
    }
}

fn array(v: &[f64]) -> Option<Theta> {
    v.try_into().ok()
}

/// The parameters that move, for a method without derivatives.
#[derive(Clone)]
struct Reduced<'a, 'b> {
    task: &'b Task<'a>,
    from: Theta,
    moving: Vec<usize>,
}

impl Reduced<'_, '_> {
    fn theta(&self, moved: &[f64]) -> Theta {
        let mut theta = self.from;
        for (&j, x) in self.moving.iter().zip(moved) {
            theta[j] = *x;
        }
        theta
    }
}

impl CostFunction for Reduced<'_, '_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, moved: &Self::Param) -> Result<f64, Error> {
        Ok(self.task.chi2(&self.theta(moved)))
    }
}

/// Levenberg-Marquardt with Nielsen's damping.
struct LevenbergMarquardt {
    here: Option<Linear>,
    damping: f64,
    growth: f64,
    ended: bool,
    /// It stopped although the derivatives promised more.
    creased: bool,
}

impl Default for LevenbergMarquardt {
    fn default() -> Self {
        Self {
            here: None,
            damping: 1e-6,
            growth: 4.0,
            ended: false,
            creased: false,
        }
    }
}

type Step = IterState<Vec<f64>, (), (), (), (), f64>;

impl Solver<Task<'_>, Step> for LevenbergMarquardt {
    fn name(&self) -> &str {
        "Levenberg-Marquardt"
    }

    fn init(&mut self, problem: &mut Problem<Task<'_>>, mut state: Step) -> Result<(Step, Option<KV>), Error> {
        let theta = parameters(&mut state)?;
        self.here = problem.problem("linear_count", |task| Ok(task.linear(&theta)))?;
        let chi2 = self.here.as_ref().map_or(f64::INFINITY, |l| l.chi2);
        Ok((state.param(theta.to_vec()).cost(chi2), None))
    }

    fn next_iter(
        &mut self,
        problem: &mut Problem<Task<'_>>,
        mut state: Step,
    ) -> Result<(Step, Option<KV>), Error> {
        let theta = parameters(&mut state)?;
        let Some(here) = self.here else {
            self.ended = true;
            return Ok((state.param(theta.to_vec()), None));
        };
        let lengths = here.triangle.lengths();
        let damping = lengths.map(|length| self.damping.sqrt() * length);
        let step = here.triangle.step(&damping);
        let undamped = here.triangle.effect(&here.triangle.step(&lengths.map(|l| 1e-12 * l)));
        let effect = here.triangle.effect(&step);
        let still = (0..PARAMETERS).all(|j| step[j].abs() <= STILL * theta[j].abs().max(1.0));
        // Before the step is taken: the best that a step can do is already too little.
        if undamped <= SETTLED * here.chi2.sqrt().min(1.0) || undamped == 0.0 || (still && self.damping < 1.0) {
            self.ended = true;
            return Ok((state.param(theta.to_vec()).cost(here.chi2), None));
        }
        let there_theta: Theta = std::array::from_fn(|j| theta[j] + step[j]);
        let there = problem.problem("linear_count", |task| Ok(task.linear(&there_theta)))?;
        // Of a linear model: |r|² − |r + J δ|² = |J δ|² + 2 |D δ|².
        let promised = effect.powi(2)
            + 2.0 * (0..PARAMETERS).map(|j| (damping[j] * step[j]).powi(2)).sum::<f64>();
        match there.filter(|there| there.chi2 < here.chi2) {
            Some(there) => {
                let gain = (here.chi2 - there.chi2) / promised;
                self.damping *= (1.0 - (2.0 * gain - 1.0).powi(3)).clamp(0.05, 3.0);
                self.damping = self.damping.max(1e-14);
                self.growth = 4.0;
                self.here = Some(there);
                Ok((state.param(there_theta.to_vec()).cost(there.chi2), None))
            }
            None => {
                self.damping *= self.growth;
                self.growth *= 2.0;
                if self.damping > MOST_DAMPING || promised <= 1e-15 * here.chi2 {
                    self.ended = true;
                    // What rounding hides was not promised in earnest.
                    self.creased = undamped > 1e-4 * here.chi2.sqrt().min(1.0) && promised > 1e-15 * here.chi2;
                    self.creased |= undamped > 1e-3;
                }
                Ok((state.param(theta.to_vec()).cost(here.chi2), None))
            }
        }
    }

    fn terminate(&mut self, _state: &Step) -> TerminationStatus {
        if self.ended {
            TerminationStatus::Terminated(TerminationReason::SolverConverged)
        } else {
            TerminationStatus::NotTerminated
        }
    }
}

fn parameters(state: &mut Step) -> Result<Theta, Error> {
    state
        .take_param()
        .as_deref()
        .and_then(array)
        .ok_or_else(|| Error::msg("the search lost its parameters"))
}
