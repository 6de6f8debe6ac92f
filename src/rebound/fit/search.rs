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
    CostFunction, Error, Executor, IterState, KV, Problem, Solver, State as _, TerminationReason,
    TerminationStatus,
};
use argmin::solver::neldermead::NelderMead;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Most steps. From a start within the basin six are usual; what needs more than this has no least value nearby.
const MOST_STEPS: u64 = 200;

/// A step that would move all residuals together by no more than this part of the scatter of one is not taken: parameters
/// move by no more than this part of their uncertainty then.
pub(super) const SETTLED: f64 = 1e-6;

/// The same where rows are so many that a step takes its time.
const SETTLED_OF_MANY: f64 = 1e-3;

/// More rows than this are gone through in parts, at once where there are processors.
const PART: usize = 8192;

/// Nor does a change of every parameter by less than this matter, absolute or relative.
const STILL: f64 = 1e-13;

/// More rows than this: a crease is the work of one row, and one of so many has no weight.
const MOST_CREASED: usize = 2000;

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

/// The rows that count, or a part of them.
#[derive(Clone)]
pub(super) struct Rows<'a> {
    rows: &'a [Observation],
    chosen: Option<&'a [usize]>,
    at: usize,
    end: usize,
}

impl<'a> Iterator for Rows<'a> {
    type Item = &'a Observation;

    fn next(&mut self) -> Option<&'a Observation> {
        let at = self.at;
        self.at += 1;
        (at < self.end).then(|| {
            self.chosen
                .map_or(&self.rows[at], |chosen| &self.rows[chosen[at]])
        })
    }
}

impl<'a> Task<'a> {
    /// The rows that count.
    pub fn rows(&self) -> Rows<'a> {
        Rows {
            rows: self.rows,
            chosen: self.chosen,
            at: 0,
            end: self.chosen.map_or(self.rows.len(), <[usize]>::len),
        }
    }

    /// The nearest motion to a row.
    pub fn nearest(&self, row: &Observation, theta: &Theta) -> Option<Nearest> {
        law::nearest(row, self.regimes, theta)
    }

    /// χ² and its derivatives; `None` where χ² is not finite.
    pub fn linear(&self, theta: &Theta) -> Option<Linear> {
        let parts = self.in_parts(|rows| {
            let mut linear = Linear {
                chi2: 0.0,
                triangle: Triangle::new(),
            };
            for row in rows {
                let near = self.nearest(row, theta)?;
                linear.chi2 += near.chi2;
                for i in 0..near.equations {
                    linear
                        .triangle
                        .push(self.masked(near.jacobian[i]), near.residuals[i]);
                }
            }
            Some(linear)
        });
        let mut parts = parts.into_iter();
        let mut linear = parts.next()??;
        for part in parts {
            let part = part?;
            linear.chi2 += part.chi2;
            linear.triangle.take_in(&part.triangle);
        }
        linear.chi2.is_finite().then_some(linear)
    }

    /// χ² alone, infinite where it is not finite.
    pub fn chi2(&self, theta: &Theta) -> f64 {
        self.sum(|row| self.nearest(row, theta).map(|near| near.chi2))
    }

    /// χ² with each row's true incidence averaged over both sides of the transition, see [`law::averaged`]; infinite
    /// where it is not finite.
    pub fn averaged(&self, theta: &Theta, spread: f64) -> f64 {
        self.sum(|row| law::averaged(row, self.regimes, theta, spread))
    }

    fn sum(&self, of: impl Fn(&Observation) -> Option<f64> + Sync) -> f64 {
        let parts = self.in_parts(|rows| rows.map(|row| of(row).unwrap_or(f64::INFINITY)).sum::<f64>());
        let sum: f64 = parts.into_iter().sum();
        if sum.is_finite() { sum } else { f64::INFINITY }
    }

    /// The nearest motion of every row.
    pub fn all_nearest(&self, theta: &Theta) -> Option<Vec<Nearest>> {
        let parts = self.in_parts(|rows| {
            rows.map(|row| self.nearest(row, theta))
                .collect::<Option<Vec<_>>>()
        });
        let parts: Option<Vec<Vec<Nearest>>> = parts.into_iter().collect();
        Some(parts?.concat())
    }

    /// `work` on all rows, many of them in parts of a size of their own, so that sums do not depend on the machine.
    fn in_parts<T: Send>(&self, work: impl Fn(Rows<'a>) -> T + Sync) -> Vec<T> {
        let count = self.chosen.map_or(self.rows.len(), <[usize]>::len);
        let rows = |from: usize, to: usize| Rows {
            rows: self.rows,
            chosen: self.chosen,
            at: from,
            end: to,
        };
        if count <= PART {
            return vec![work(rows(0, count))];
        }
        let parts = count.div_ceil(PART);
        let threads = std::thread::available_parallelism()
            .map_or(1, usize::from)
            .min(parts);
        let next = AtomicUsize::new(0);
        let mut done: Vec<(usize, T)> = std::thread::scope(|scope| {
            let worker = || {
                let mut done = Vec::new();
                loop {
                    let part = next.fetch_add(1, Ordering::Relaxed);
                    if part >= parts {
                        return done;
                    }
                    done.push((part, work(rows(part * PART, ((part + 1) * PART).min(count)))));
                }
            };
            let others: Vec<_> = (1..threads).map(|_| scope.spawn(worker)).collect();
            let mut done = worker();
            for other in others {
                match other.join() {
                    Ok(more) => done.extend(more),
                    Err(panic) => std::panic::resume_unwind(panic),
                }
            }
            done
        });
        done.sort_by_key(|(part, _)| *part);
        done.into_iter().map(|(_, result)| result).collect()
    }

    /// The triangle of rows brought to unit length each, for the test of what they determine.
    pub fn unit_triangle(&self, theta: &Theta) -> Triangle {
        let parts = self.in_parts(|rows| {
            let mut triangle = Triangle::new();
            for row in rows {
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
        });
        let mut parts = parts.into_iter();
        let mut triangle = parts.next().unwrap_or_else(Triangle::new);
        for part in parts {
            triangle.take_in(&part);
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
        self.search_to(start, SETTLED).map(|(found, _)| found)
    }

    /// As [`Self::search`], to `settled` in place of [`SETTLED`]; and how many steps it tried.
    pub fn search_to(&self, start: Theta, settled: f64) -> Option<(Found, u64)> {
        let method = LevenbergMarquardt {
            settled,
            ..LevenbergMarquardt::default()
        };
        let result = Executor::new(self.clone(), method)
            .configure(|state| state.param(start.to_vec()).max_iters(MOST_STEPS))
            .ctrlc(false)
            .run()
            .ok()?;
        let LevenbergMarquardt {
            here, theta, creased, ..
        } = result.solver;
        let Linear { chi2, triangle } = here?;
        let smooth = Found {
            theta,
            chi2,
            triangle,
            converged: matches!(
                result.state.get_termination_status(),
                TerminationStatus::Terminated(TerminationReason::SolverConverged)
            ),
        };
        let steps = result.state.get_iter();
        if creased && self.rows.len() <= MOST_CREASED {
            Some((self.across_creases(smooth).unwrap_or(smooth), steps))
        } else {
            Some((smooth, steps))
        }
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
        let theta = reduced.theta(best);
        let Linear { chi2, triangle } = self.linear(&theta)?;
        (chi2 <= from.chi2).then_some(Found {
            theta,
            chi2,
            triangle,
            converged: true,
        })
    }
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
    settled: f64,
    here: Option<Linear>,
    theta: Theta,
    rows: usize,
    damping: f64,
    growth: f64,
    ended: bool,
    /// It stopped although the derivatives promised more.
    creased: bool,
}

impl Default for LevenbergMarquardt {
    fn default() -> Self {
        Self {
            settled: SETTLED,
            here: None,
            theta: [0.0; PARAMETERS],
            rows: 1,
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

    fn init(
        &mut self,
        problem: &mut Problem<Task<'_>>,
        mut state: Step,
    ) -> Result<(Step, Option<KV>), Error> {
        self.theta = state
            .take_param()
            .and_then(|start| start.try_into().ok())
            .ok_or_else(|| Error::msg("a search starts at four parameters"))?;
        self.here = problem.problem("linear_count", |task| {
            self.rows = task.chosen.map_or(task.rows.len(), <[usize]>::len).max(1);
            Ok(task.linear(&self.theta))
        })?;
        Ok((self.report(state), None))
    }

    fn next_iter(
        &mut self,
        problem: &mut Problem<Task<'_>>,
        state: Step,
    ) -> Result<(Step, Option<KV>), Error> {
        let Some(here) = self.here else {
            self.ended = true;
            return Ok((self.report(state), None));
        };
        let lengths = here.triangle.lengths();
        let damping = lengths.map(|length| self.damping.sqrt() * length);
        let step = here.triangle.step(&damping);
        // The best that any step can do.
        let best = here
            .triangle
            .effect(&here.triangle.step(&lengths.map(|length| 1e-12 * length)));
        let size = (here.chi2 / self.rows as f64).sqrt();
        let still = (0..PARAMETERS).all(|j| step[j].abs() <= STILL * self.theta[j].abs().max(1.0));
        // Many rows: a step takes its time.
        let settled = if self.rows > PART {
            self.settled.max(SETTLED_OF_MANY)
        } else {
            self.settled
        };
        if best <= settled * size || (still && self.damping < 1.0) {
            self.ended = true;
            return Ok((self.report(state), None));
        }
        let theta: Theta = std::array::from_fn(|j| self.theta[j] + step[j]);
        let there = problem.problem("linear_count", |task| Ok(task.linear(&theta)))?;
        // Of a linear model: |r|² − |r + J δ|² = |J δ|² + 2 |D δ|².
        let damped: f64 = (0..PARAMETERS).map(|j| (damping[j] * step[j]).powi(2)).sum();
        let promised = here.triangle.effect(&step).powi(2) + 2.0 * damped;
        if let Some(there) = there.filter(|there| there.chi2 < here.chi2) {
            let gain = (here.chi2 - there.chi2) / promised;
            self.damping *= (1.0 - (2.0 * gain - 1.0).powi(3)).clamp(0.05, 3.0);
            self.damping = self.damping.max(1e-14);
            self.growth = 4.0;
            (self.theta, self.here) = (theta, Some(there));
        } else {
            self.damping *= self.growth;
            self.growth *= 2.0;
            // What rounding hides was not promised in earnest.
            let hidden = promised <= 1e-14 * here.chi2;
            self.ended = hidden || self.damping > MOST_DAMPING;
            self.creased = self.ended && !hidden && best > 1e-4 * size;
        }
        Ok((self.report(state), None))
    }

    fn terminate(&mut self, _state: &Step) -> TerminationStatus {
        if self.ended {
            TerminationStatus::Terminated(TerminationReason::SolverConverged)
        } else {
            TerminationStatus::NotTerminated
        }
    }
}

impl LevenbergMarquardt {
    /// The state as argmin keeps it.
    fn report(&self, state: Step) -> Step {
        let chi2 = self.here.map_or(f64::INFINITY, |here| here.chi2);
        state.param(self.theta.to_vec()).cost(chi2)
    }
}
