//! The search for a model's parameters: least χ² over a set of rows.
//!
//! Levenberg-Marquardt of [`crate::numeric::least_squares`] as an [`argmin`] solver, on the R factor of
//! [`crate::numeric::r_factor`] in place of normal equations. Its ends are scale-free, its number of steps is limited, and
//! a point at which χ² is not a finite number is never accepted. Where rows have exact incidence, χ² has kinks (a row changes sides at once) at which a smooth method stops too early:
//! there argmin's Nelder-Mead goes on.

use super::group_data::GroupData;
use super::observation::Observation;
use super::row_law::averaged::averaged;
use super::row_law::{self, NearestMotion, PARAMETERS, Theta, Variant};
use crate::numeric::least_squares::{self, Damping, Descent, Easing, Outlook, Termination, Trial};
use crate::numeric::r_factor::RFactor;
use argmin::core::{
    CostFunction, Error, Executor, IterState, KV, Problem, Solver, State as _, TerminationReason,
    TerminationStatus,
};
use argmin::solver::neldermead::NelderMead;
use rayon::prelude::*;
use std::cmp::Ordering;

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

/// More rows than this: a kink is the work of one row, and one of so many has no weight.
const MOST_ROWS_WITH_KINKS: usize = 2000;

/// Rows, a model, and which of its parameters may move.
#[derive(Clone)]
pub(super) struct Task<'a> {
    /// All rows, heaviest first.
    pub rows: &'a [Observation],
    /// Which of them count; `None` for all.
    pub chosen: Option<&'a [usize]>,
    pub variant: Variant,
    /// [`Incidence::table_error`](crate::rebound::model::Incidence) by the rows' index in the series, where they are known.
    pub table_errors: Option<&'a [f64]>,
}

/// χ² and its R factor at some parameters.
#[derive(Debug, Clone, Copy)]
pub(super) struct Linearised {
    pub chi2: f64,
    pub r_factor: RFactor<PARAMETERS>,
}

/// Where a search ended.
#[derive(Debug, Clone, Copy)]
pub(super) struct Minimum {
    pub theta: Theta,
    pub chi2: f64,
    pub r_factor: RFactor<PARAMETERS>,
    pub converged: bool,
}

/// Minima from the lowest up, each once. Of two as low the one at the smaller parameters is first, the last (κ) before the others.
pub(super) fn distinct(mut found: Vec<Minimum>) -> Vec<Minimum> {
    const AS_LOW: f64 = 1e-6;
    found.sort_by(|a, b| a.chi2.total_cmp(&b.chi2));
    let Some(lowest) = found.first().map(|m| m.chi2) else {
        return found;
    };
    let as_low = found.partition_point(|m| m.chi2 <= lowest + AS_LOW * (1.0 + lowest));
    let from_the_last = |theta: &Theta| theta.iter().rev().copied().collect::<Vec<f64>>();
    found[..as_low].sort_by(|a, b| {
        from_the_last(&a.theta)
            .partial_cmp(&from_the_last(&b.theta))
            .unwrap_or(Ordering::Equal)
    });
    let mut kept: Vec<Minimum> = Vec::new();
    for minimum in found {
        let same = |other: &Minimum| {
            let lengths = other.r_factor.lengths();
            (0..PARAMETERS).all(|j| {
                let apart = (minimum.theta[j] - other.theta[j]).abs();
                apart * lengths[j] <= 0.01 || apart <= 1e-4 * other.theta[j].abs()
            })
        };
        if !kept.iter().any(same) {
            kept.push(minimum);
        }
    }
    kept
}

/// The rows that count, or a part of them.
#[derive(Clone)]
pub(super) struct ChosenRows<'a> {
    rows: &'a [Observation],
    chosen: Option<&'a [usize]>,
    at: usize,
    end: usize,
}

impl<'a> Iterator for ChosenRows<'a> {
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
    /// The rows of a group, or the `chosen` ones, in a model's variant.
    pub fn of(data: &'a GroupData, variant: Variant, chosen: Option<&'a [usize]>) -> Self {
        Self {
            rows: &data.rows,
            chosen,
            variant,
            table_errors: None,
        }
    }

    /// The rows that count.
    pub fn rows(&self) -> ChosenRows<'a> {
        ChosenRows {
            rows: self.rows,
            chosen: self.chosen,
            at: 0,
            end: self.count(),
        }
    }

    /// The nearest motion to a row.
    pub fn nearest(&self, row: &Observation, theta: &Theta) -> Option<NearestMotion> {
        // (Rows that were set aside have none that is known.)
        let known = self.table_errors.and_then(|errors| errors.get(row.row));
        let table_error = known.copied().unwrap_or(0.0);
        row_law::nearest(row, &self.variant, theta, table_error)
    }

    /// χ² and its derivatives; `None` where χ² is not finite.
    pub fn linear(&self, theta: &Theta) -> Option<Linearised> {
        let parts = self.in_parts(|rows| {
            let mut linear = Linearised {
                chi2: 0.0,
                r_factor: RFactor::default(),
            };
            for row in rows {
                let near = self.nearest(row, theta)?;
                linear.chi2 += near.chi2;
                for i in 0..near.equations {
                    linear
                        .r_factor
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
            linear.r_factor.take_in(&part.r_factor);
        }
        linear.chi2.is_finite().then_some(linear)
    }

    /// χ² alone, infinite where it is not finite.
    pub fn chi2(&self, theta: &Theta) -> f64 {
        self.sum(|row| self.nearest(row, theta).map(|near| near.chi2))
    }

    /// χ² with each row's true incidence averaged over both sides of the transition, see [`averaged`]; infinite
    /// where it is not finite.
    pub fn averaged(&self, theta: &Theta, spread: f64) -> f64 {
        self.sum(|row| averaged(row, &self.variant, theta, spread))
    }

    fn sum(&self, of: impl Fn(&Observation) -> Option<f64> + Sync) -> f64 {
        let parts = self.in_parts(|rows| rows.map(|row| of(row).unwrap_or(f64::INFINITY)).sum::<f64>());
        let sum: f64 = parts.into_iter().sum();
        if sum.is_finite() { sum } else { f64::INFINITY }
    }

    /// What `of` makes of the nearest motion of every row: a motion itself takes hundreds of bytes, which times a million rows
    /// no machine has to spare.
    pub fn of_nearest<T: Send>(
        &self,
        theta: &Theta,
        of: impl Fn(&Observation, &NearestMotion) -> T + Sync,
    ) -> Option<Vec<T>> {
        // So many parts at once, so that no more of what is made is there twice.
        const TOGETHER: usize = 16;
        let count = self.count();
        let mut all = Vec::with_capacity(count);
        let work = |rows: ChosenRows<'a>| {
            rows.map(|row| Some(of(row, &self.nearest(row, theta)?)))
                .collect::<Option<Vec<_>>>()
        };
        for from in (0..count.div_ceil(PART)).step_by(TOGETHER) {
            let parts = from..(from + TOGETHER).min(count.div_ceil(PART));
            let made: Vec<Option<Vec<T>>> = parts.into_par_iter().map(|i| work(self.part(i))).collect();
            for part in made {
                all.extend(part?);
            }
        }
        Some(all)
    }

    /// How many rows count.
    fn count(&self) -> usize {
        self.chosen.map_or(self.rows.len(), <[usize]>::len)
    }

    /// A part of a size of its own, so that sums do not depend on the machine.
    fn part(&self, i: usize) -> ChosenRows<'a> {
        ChosenRows {
            rows: self.rows,
            chosen: self.chosen,
            at: i * PART,
            end: ((i + 1) * PART).min(self.count()),
        }
    }

    /// `work` on all rows, many of them in parts.
    fn in_parts<T: Send>(&self, work: impl Fn(ChosenRows<'a>) -> T + Sync) -> Vec<T> {
        let count = self.count();
        if count <= PART {
            return vec![work(self.part(0))];
        }
        let part = |i: usize| work(self.part(i));
        (0..count.div_ceil(PART)).into_par_iter().map(part).collect()
    }

    /// The R factor of rows brought to unit length each, for the test of what they determine.
    pub fn unit_r_factor(&self, theta: &Theta) -> RFactor<PARAMETERS> {
        let parts = self.in_parts(|rows| {
            let mut r_factor = RFactor::default();
            for row in rows {
                let Some(near) = self.nearest(row, theta) else {
                    continue;
                };
                for line in &near.jacobian[..near.equations] {
                    let line = self.masked(*line);
                    let length = line.iter().map(|x| x * x).sum::<f64>().sqrt();
                    if length > 0.0 && length.is_finite() {
                        r_factor.push(line.map(|x| x / length), 0.0);
                    }
                }
            }
            r_factor
        });
        let mut parts = parts.into_iter();
        let mut r_factor = parts.next().unwrap_or_default();
        for part in parts {
            r_factor.take_in(&part);
        }
        r_factor
    }

    fn masked(&self, mut line: [f64; PARAMETERS]) -> [f64; PARAMETERS] {
        for (x, free) in line.iter_mut().zip(&self.variant.free) {
            if !free {
                *x = 0.0;
            }
        }
        line
    }

    /// The least χ² near `start`; `None` where χ² is not finite at the start itself.
    pub fn search(&self, start: Theta) -> Option<Minimum> {
        self.search_to(start, SETTLED).map(|(found, _)| found)
    }

    /// As [`Self::search`], to `settled` in place of [`SETTLED`]; and how many steps it tried.
    pub fn search_to(&self, start: Theta, settled: f64) -> Option<(Minimum, u64)> {
        let result = Executor::new(self.clone(), LevenbergMarquardt::to(settled))
            .configure(|state| state.param(start.to_vec()).max_iters(MOST_STEPS))
            .ctrlc(false)
            .run()
            .ok()?;
        let LevenbergMarquardt { descent, ended, .. } = result.solver;
        let (theta, linear) = descent?.state;
        let smooth = Minimum {
            theta,
            chi2: linear.chi2,
            r_factor: linear.r_factor,
            converged: ended.is_some(),
        };
        // It stopped although the derivatives promised more.
        let (effect, scatter) = ScaleFreeRows::new(self, settled).best_effect(&linear);
        let at_kink = ended == Some(Termination::NoBetterStep) && effect > 1e-4 * scatter;
        let steps = result.state.get_iter();
        if at_kink && self.rows.len() <= MOST_ROWS_WITH_KINKS {
            Some((self.across_kinks(smooth).unwrap_or(smooth), steps))
        } else {
            Some((smooth, steps))
        }
    }

    /// Nelder-Mead from a point at which no smooth step gets down.
    fn across_kinks(&self, from: Minimum) -> Option<Minimum> {
        let lengths = from.r_factor.lengths();
        let moving: Vec<usize> = (0..PARAMETERS)
            .filter(|&j| self.variant.free[j] && lengths[j] > 0.0)
            .collect();
        if moving.is_empty() {
            return None;
        }
        let reduced = FreeParameters {
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
        let Linearised { chi2, r_factor } = self.linear(&theta)?;
        (chi2 <= from.chi2).then_some(Minimum {
            theta,
            chi2,
            r_factor,
            converged: true,
        })
    }
}

/// The parameters that move, for a method without derivatives.
#[derive(Clone)]
struct FreeParameters<'a, 'b> {
    task: &'b Task<'a>,
    from: Theta,
    moving: Vec<usize>,
}

impl FreeParameters<'_, '_> {
    fn theta(&self, moved: &[f64]) -> Theta {
        let mut theta = self.from;
        for (&j, x) in self.moving.iter().zip(moved) {
            theta[j] = *x;
        }
        theta
    }
}

impl CostFunction for FreeParameters<'_, '_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, moved: &Self::Param) -> Result<f64, Error> {
        Ok(self.task.chi2(&self.theta(moved)))
    }
}

/// The crate's Levenberg-Marquardt as argmin asks for it: argmin counts and limits the steps.
struct LevenbergMarquardt {
    settled: f64,
    descent: Option<Descent<(Theta, Linearised)>>,
    ended: Option<Termination>,
}

impl LevenbergMarquardt {
    const DAMPING: Damping = Damping {
        easing: Easing::Nielsen {
            least: 0.05,
            most: 3.0,
        },
        growth: 4.0,
        ..Damping::NIELSEN
    };

    fn to(settled: f64) -> Self {
        Self {
            settled,
            descent: None,
            ended: None,
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
        let theta: Theta = state
            .take_param()
            .and_then(|start| start.try_into().ok())
            .ok_or_else(|| Error::msg("a search starts with a value of every parameter"))?;
        let linear = problem.problem("linear_count", |task| Ok(task.linear(&theta)))?;
        self.descent = linear.map(|linear| Descent::new((theta, linear), &Self::DAMPING));
        Ok((self.report(state), None))
    }

    fn next_iter(
        &mut self,
        problem: &mut Problem<Task<'_>>,
        state: Step,
    ) -> Result<(Step, Option<KV>), Error> {
        let settled = self.settled;
        self.ended = match &mut self.descent {
            None => Some(Termination::Singular),
            Some(descent) => problem.problem("linear_count", |task| {
                Ok(descent.advance(&mut ScaleFreeRows::new(task, settled)))
            })?,
        };
        Ok((self.report(state), None))
    }

    fn terminate(&mut self, _state: &Step) -> TerminationStatus {
        match self.ended {
            Some(_) => TerminationStatus::Terminated(TerminationReason::SolverConverged),
            None => TerminationStatus::NotTerminated,
        }
    }
}

impl LevenbergMarquardt {
    /// The state as argmin keeps it; without χ² at the start there is none.
    fn report(&self, state: Step) -> Step {
        match &self.descent {
            Some(Descent {
                state: (theta, linear),
                ..
            }) => state.param(theta.to_vec()).cost(linear.chi2),
            None => state,
        }
    }
}

/// The rows as the least-squares loop sees them, with ends that do not depend on units.
struct ScaleFreeRows<'a, 'b> {
    task: &'b Task<'a>,
    rows: f64,
    settled: f64,
}

impl<'a, 'b> ScaleFreeRows<'a, 'b> {
    fn new(task: &'b Task<'a>, settled: f64) -> Self {
        let rows = task.chosen.map_or(task.rows.len(), <[usize]>::len).max(1);
        Self {
            task,
            rows: rows as f64,
            // Many rows: a step takes its time.
            settled: if rows > PART {
                settled.max(SETTLED_OF_MANY)
            } else {
                settled
            },
        }
    }

    /// By how much the best that any step can do moves the residuals; and the scatter of one.
    fn best_effect(&self, here: &Linearised) -> (f64, f64) {
        let free = here.r_factor.lengths().map(|length| 1e-12 * length);
        let effect = here.r_factor.effect(&here.r_factor.step(&free));
        (effect, (here.chi2 / self.rows).sqrt())
    }
}

/// D of the damping: the lengths of the Jacobian's columns.
fn damping_rows(here: &Linearised, damping: f64) -> Theta {
    here.r_factor.lengths().map(|length| damping.sqrt() * length)
}

impl least_squares::Problem for ScaleFreeRows<'_, '_> {
    type State = (Theta, Linearised);
    type Step = Theta;

    fn step(&mut self, (_, here): &Self::State, damping: f64) -> Option<Theta> {
        Some(here.r_factor.step(&damping_rows(here, damping)))
    }

    fn moved(&mut self, (theta, _): &Self::State, step: &Theta) -> Option<Self::State> {
        let theta = std::array::from_fn(|j| theta[j] + step[j]);
        self.task.linear(&theta).map(|linear| (theta, linear))
    }

    fn cost(&self, (_, of): &Self::State, _here: &Self::State) -> f64 {
        of.chi2
    }

    /// Of a linear model: |r|² − |r + J δ|² = |J δ|² + 2 |D δ|².
    fn predicted_fall(&self, (_, here): &Self::State, step: &Theta, damping: f64) -> f64 {
        let rows = damping_rows(here, damping);
        let damped: f64 = rows.iter().zip(step).map(|(d, s)| (d * s).powi(2)).sum();
        here.r_factor.effect(step).powi(2) + 2.0 * damped
    }

    fn outlook(&self, (theta, here): &Self::State, step: &Theta, damping: f64) -> Outlook {
        let still = (0..PARAMETERS).all(|j| step[j].abs() <= STILL * theta[j].abs().max(1.0));
        let (effect, scatter) = self.best_effect(here);
        if effect <= self.settled * scatter || (still && damping < 1.0) {
            Outlook::Settled
        } else {
            Outlook::Open
        }
    }

    /// What rounding hides was not promised in earnest.
    fn is_settled(&self, here: &Self::State, trial: &Trial<'_, Theta>) -> bool {
        !trial.taken && self.predicted_fall(here, trial.step, trial.damping) <= 1e-14 * here.1.chi2
    }
}
