//! The minimum of a model that reads e_x from a table, settled on what the table stands for.
//!
//! A table that serves thousands of evaluations is good to 2e-5 in half of its places and to 1e-3 beside its bends. The minimum of χ² is found with it; there
//! e_x of each row is worked out by the springs themselves, the difference is taken off the table's at that row, and the search goes on from where it
//! is (deferred correction). The differences hardly change over the last bit of the way: after two or three rounds table and springs agree to
//! [`AGREES`] at every row, and χ², parameters and intervals are those of the springs.
//!
//! Assumed: the last bit is short. Where a row lies on a bend and goes to and fro across it, rounds end after [`ROUNDS`] with what the last one found.

use super::criteria::InformationCriteria;
use super::group_data::GroupData;
use super::search::{Minimum, Task};
use super::variants::Solution;

/// Table and springs agree to this, in e_x.
pub(super) const AGREES: f64 = 1e-6;

/// Rounds at most.
const ROUNDS: usize = 6;

/// `solution` as the springs have it; as it was of a model without a table, and where the search finds nothing there.
pub(super) fn settled(data: &GroupData, solution: Solution) -> Solution {
    let mut settled = solution.clone();
    for _ in 0..ROUNDS {
        let Some((errors, change)) = errors_of(data, &settled) else {
            return solution;
        };
        settled.table_errors = Some(errors.into());
        if change <= AGREES {
            break;
        }
        let task = settled.task(data);
        let Some(best) = search(&task, &settled) else {
            return solution;
        };
        settled.best = best;
    }
    let parameters = settled.criteria.parameters;
    settled.criteria = InformationCriteria::new(data, settled.best.chi2, parameters, 1.0);
    settled
}

/// The table's errors at the nearest motions to the rows, and by how much the farthest is off what was known of it. `None` of a model without a table.
fn errors_of(data: &GroupData, solution: &Solution) -> Option<(Vec<f64>, f64)> {
    let task = solution.task(data);
    let theta = &solution.best.theta;
    let motions = task.of_nearest(theta, |row, near| (row.row, near.incidence))?;
    let (rows, at): (Vec<usize>, Vec<_>) = motions.into_iter().unzip();
    let found = solution.variant.model.model().table_errors(&at, theta)?;
    let known = |row: usize| solution.table_errors.as_ref().map_or(0.0, |errors| errors[row]);
    let mut errors = vec![0.0; rows.iter().max()? + 1];
    let mut change = 0.0_f64;
    for (&row, error) in rows.iter().zip(found) {
        change = change.max((error - known(row)).abs());
        errors[row] = error;
    }
    Some((errors, change))
}

/// From where the solution is, in what the rows determine: along the rest the search would creep.
fn search(task: &Task<'_>, solution: &Solution) -> Option<Minimum> {
    let theta = solution.best.theta;
    let mut held = task.clone();
    for (free, determined) in held.variant.free.iter_mut().zip(solution.determined) {
        *free &= determined;
    }
    let found = held.search(theta).filter(|found| found.converged);
    let theta = found.map_or(theta, |found| found.theta);
    let linear = task.linear(&theta)?;
    Some(Minimum {
        theta,
        chi2: linear.chi2,
        r_factor: linear.r_factor,
        converged: solution.best.converged,
    })
}
