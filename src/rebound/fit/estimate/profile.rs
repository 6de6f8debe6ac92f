//! Intervals by profile: how far each parameter may go while the others make up for it.
//!
//! Where rows change sides as a parameter moves, χ² is no parabola: steep while every row stays on its side, nearly flat once
//! one has crossed. The covariance at the least χ² knows of neither. So each parameter is moved away, the others fitted
//! anew, until χ² is beyond what chance allows. Where it comes out as the covariance has it, one step to either side shows it.

use super::estimation::{ConfidenceRegion, ModelEstimation};
use crate::rebound::fit::row_law::{PARAMETERS, Regimes, Theta};
use crate::rebound::fit::search::Task;
use crate::rebound::fit::variants::FEW;
use crate::rebound::parameter::SEARCHED;

/// χ² at the end that the covariance gives may be off by this part before the end is looked for.
const AS_EXPECTED: f64 = 0.1;

/// To what part of the level an end is found.
const CLOSE: f64 = 0.05;

/// Steps outwards, and steps to an end once it lies between two.
const STEPS: usize = 12;

/// Around the least χ², of the parameters that the rows determine.
pub(super) fn region(estimation: &ModelEstimation<'_>) -> ConfidenceRegion {
    let mut region = ConfidenceRegion::default();
    let solution = estimation.solution;
    let level = (estimation.factor * estimation.scatter.unwrap_or(0.0)).powi(2);
    let bends = solution.variant.regimes == Regimes::Continuous || !solution.name().model().grip_is_linear();
    if !bends || estimation.data.rows.len() > FEW || !(level > 0.0) {
        return region;
    }
    let at_once =
        |j: usize| solution.determined[j] && estimation.covariance[(j, j)].sqrt() <= SEARCHED[j].vague_std();
    for j in (0..PARAMETERS).filter(|&j| at_once(j)) {
        let [low, high] = [-1.0, 1.0].map(|sign| end(estimation, &mut region.ends, level, j, sign));
        region.open[j] = (low, high);
    }
    region
}

/// Goes to the end of a parameter to one side, noting in `ends` where it comes by; whether there is none.
fn end(estimation: &ModelEstimation<'_>, ends: &mut Vec<Theta>, level: f64, j: usize, sign: f64) -> bool {
    let mut path = ProfilePath::new(estimation, j);
    let best = estimation.theta[j];
    let mut reach = estimation.factor * estimation.covariance[(j, j)].sqrt();
    let mut rise = path.rise(best + sign * reach);
    if (rise - level).abs() <= AS_EXPECTED * level {
        return false;
    }
    let mut inside = 0.0;
    let mut outside = None;
    for _ in 0..STEPS {
        if rise > level {
            outside = Some(reach);
            break;
        }
        ends.push(path.theta);
        inside = reach;
        reach *= 1.6;
        if reach > estimation.factor * SEARCHED[j].vague_std() {
            return true;
        }
        rise = path.rise(best + sign * reach);
    }
    let Some(mut outside) = outside else {
        return true;
    };
    for _ in 0..STEPS {
        let middle = 0.5 * (inside + outside);
        let rise = path.rise(best + sign * middle);
        if rise > level {
            outside = middle;
        } else {
            inside = middle;
            ends.push(path.theta);
        }
        if (rise - level).abs() <= CLOSE * level || outside - inside <= CLOSE * outside {
            break;
        }
    }
    false
}

/// Least χ² along one parameter.
struct ProfilePath<'a> {
    estimation: &'a ModelEstimation<'a>,
    task: Task<'a>,
    j: usize,
    /// Where it went last.
    theta: Theta,
}

impl<'a> ProfilePath<'a> {
    fn new(estimation: &'a ModelEstimation<'a>, j: usize) -> Self {
        let mut task = estimation.solution.task(estimation.data);
        task.variant.free[j] = false;
        Self {
            estimation,
            task,
            j,
            theta: estimation.theta,
        }
    }

    /// By how much the least χ² rises with the parameter at `value`; infinite where there is none.
    fn rise(&mut self, value: f64) -> f64 {
        let (estimation, j) = (self.estimation, self.j);
        let at = |theta: &Theta| {
            let by = (value - theta[j]) / estimation.covariance[(j, j)];
            let mut moved: Theta = std::array::from_fn(|i| theta[i] + by * estimation.covariance[(i, j)]);
            moved[j] = value;
            moved
        };
        let straight = |theta: &Theta| {
            let mut moved = *theta;
            moved[j] = value;
            moved
        };
        let others = estimation
            .solution
            .local_minima
            .iter()
            .map(|minimum| straight(&minimum.theta));
        let starts = [at(&estimation.theta), straight(&self.theta)];
        let found = starts
            .into_iter()
            .chain(others)
            .filter_map(|start| self.task.search(start))
            .min_by(|a, b| a.chi2.total_cmp(&b.chi2));
        match found {
            Some(found) => {
                self.theta = found.theta;
                found.chi2 - estimation.solution.best.chi2
            }
            None => f64::INFINITY,
        }
    }
}
