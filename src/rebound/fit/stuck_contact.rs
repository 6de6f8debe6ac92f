//! The valley of χ² that runs on to a friction without limit, for a law that bends (the compliant one): rows that hardly slip.
//!
//! There χ² changes with 1/√μ, so that a search in all parameters at once either leaps below zero or creeps. In place of that μ
//! is held: without limit first, where κ and e are found in a few steps, then less and less, each time from the minimum before. The
//! lowest of these, or one between its neighbours (argmin's Brent), is the minimum of the valley.

use super::group_data::GroupData;
use super::row_law::{MU, Theta, Variant, WITHOUT_LIMIT};
use super::search::{Minimum, Task, distinct};
use super::starts::{self, FOLLOWED};
use argmin::core::{CostFunction, Error, Executor};
use argmin::solver::brent::BrentOpt;
use std::cell::RefCell;

/// μ at which slip is next to nothing: the first below none at all.
const HARDLY_SLIPS: f64 = 1e4;

/// Steps of μ inwards, and their factor: to where every bounce slides.
const STEPS: i32 = 12;
const FACTOR: f64 = 5.0;

/// χ² above that of the lowest in which a valley is not gone through: no interval reaches there.
const OUT_OF_REACH: f64 = 30.0;

/// χ² is told to this part: a valley that is no lower than at its far end has no minimum of its own.
const LOWER: f64 = 1e-6;

/// Of the `chosen` rows, one for each valley.
pub(super) fn minima(data: &GroupData, chosen: &[usize], variant: Variant) -> Vec<Minimum> {
    let mut held = Task::of(data, variant, Some(chosen));
    let free = held.clone();
    held.variant.free[MU] = false;
    let candidates = starts::candidates(data, chosen, &held.variant.free)
        .into_iter()
        .map(|start| at_friction(start, WITHOUT_LIMIT))
        .collect();
    let ends: Vec<Minimum> = starts::best(&held, candidates, 1.0, FOLLOWED / 2)
        .into_iter()
        .filter_map(|start| held.search(start))
        .collect();
    let ends = distinct(ends);
    let lowest = ends.first().map_or(f64::INFINITY, |end| end.chi2);
    ends.into_iter()
        .filter(|end| end.chi2 < lowest + OUT_OF_REACH)
        .filter_map(|end| along(&held, &free, &end))
        .collect()
}

/// The lowest of the valley that goes inwards from `end`.
fn along(held: &Task<'_>, free: &Task<'_>, end: &Minimum) -> Option<Minimum> {
    let mut frictions = vec![WITHOUT_LIMIT];
    let mut path = vec![*end];
    let mut friction = HARDLY_SLIPS;
    for _ in 0..STEPS {
        let before = path.last()?;
        let Some(found) = held.search(at_friction(before.theta, friction)) else {
            break;
        };
        frictions.push(friction);
        path.push(found);
        friction /= FACTOR;
    }
    let lowest = (0..path.len()).min_by(|&a, &b| path[a].chi2.total_cmp(&path[b].chi2))?;
    let theta = if path[lowest].chi2 > end.chi2 - LOWER * (1.0 + end.chi2) {
        end.theta
    } else {
        let least = frictions[(lowest + 1).min(path.len() - 1)];
        let most = frictions[lowest.saturating_sub(1)].min(HARDLY_SLIPS * FACTOR);
        between(held, &path[lowest], least, most).unwrap_or(path[lowest].theta)
    };
    let as_found = free.linear(&theta).map(|linear| Minimum {
        theta,
        chi2: linear.chi2,
        r_factor: linear.r_factor,
        converged: true,
    });
    // Nearby a search in all parameters settles the rest.
    let settled = (theta[MU] < WITHOUT_LIMIT).then(|| free.search(theta)).flatten();
    settled
        .filter(|found| found.converged && as_found.is_none_or(|a| found.chi2 <= a.chi2))
        .or(as_found)
}

/// Where χ² is least between two values of μ.
fn between(held: &Task<'_>, from: &Minimum, least: f64, most: f64) -> Option<Theta> {
    let along = AlongFriction {
        held,
        last: RefCell::new(*from),
        best: RefCell::new(*from),
    };
    let solver = BrentOpt::new(least.ln(), most.ln()).set_tolerance(1e-7, 1e-7);
    Executor::new(&along, solver)
        .configure(|state| state.max_iters(60))
        .ctrlc(false)
        .run()
        .ok()?;
    Some(along.best.into_inner().theta)
}

/// χ² with μ held, as a function of ln μ.
struct AlongFriction<'a, 'b> {
    held: &'b Task<'a>,
    last: RefCell<Minimum>,
    best: RefCell<Minimum>,
}

impl CostFunction for &AlongFriction<'_, '_> {
    type Param = f64;
    type Output = f64;

    fn cost(&self, log_friction: &f64) -> Result<f64, Error> {
        let from = at_friction(self.last.borrow().theta, log_friction.exp());
        let Some(found) = self.held.search(from) else {
            return Ok(f64::INFINITY);
        };
        self.last.replace(found);
        if found.chi2 < self.best.borrow().chi2 {
            self.best.replace(found);
        }
        Ok(found.chi2)
    }
}

fn at_friction(mut theta: Theta, friction: f64) -> Theta {
    theta[MU] = friction;
    theta
}
