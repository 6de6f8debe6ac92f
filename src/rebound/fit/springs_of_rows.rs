//! The minimum of a model that reads e_x from a table, settled on what the table stands for.
//!
//! A table that serves thousands of evaluations is good to 2e-5 in half of its places and to 1e-3 beside its bends. The minimum of χ² is found with it; there
//! e_x of each row is worked out by the springs themselves, the difference is taken off the table's at that row, and the search goes on from where it
//! is (deferred correction). The differences hardly change over the last bit of the way: after two or three rounds table and springs agree to
//! [`AGREES`] at every row, and χ², parameters and intervals are those of the springs.
//!
//! Assumed: the last bit is short. Where a row lies on a bend and goes to and fro across it, rounds end after [`ROUNDS`] with what the last one found.

use super::row_law::PARAMETERS;
use super::search::{Minimum, Task};

/// Table and springs agree to this, in e_x.
const AGREES: f64 = 1e-6;

/// Rounds at most.
const ROUNDS: usize = 6;

/// The minimum `best` of `task` as the springs have it, with the table's errors by the rows' index in the series; `None` of a model without a table, and
/// where nothing is found. Only the parameters that the rows have `determined` move: along the others a search would creep.
pub(super) fn settled(
    task: &Task<'_>,
    mut best: Minimum,
    determined: &[bool; PARAMETERS],
) -> Option<(Minimum, Vec<f64>)> {
    let mut known = Vec::new();
    for _ in 0..ROUNDS {
        let (errors, change) = errors_at(task, &best, &known)?;
        known = errors;
        if change <= AGREES {
            break;
        }
        let corrected = Task {
            table_errors: Some(&known),
            ..task.clone()
        };
        best = search(&corrected, &best, determined)?;
    }
    Some((best, known))
}

/// The table's errors at the nearest motions to the rows, and by how much the farthest is off what is `known` of it.
fn errors_at(task: &Task<'_>, best: &Minimum, known: &[f64]) -> Option<(Vec<f64>, f64)> {
    let corrected = Task {
        table_errors: Some(known),
        ..task.clone()
    };
    let motions = corrected.of_nearest(&best.theta, |row, near| (row.row, near.incidence))?;
    let (rows, at): (Vec<usize>, Vec<_>) = motions.into_iter().unzip();
    let found = task.variant.model.model().table_errors(&at, &best.theta)?;
    let mut errors = vec![0.0; rows.iter().max()? + 1];
    let mut change = 0.0_f64;
    for (&row, error) in rows.iter().zip(found) {
        change = change.max((error - known.get(row).copied().unwrap_or(0.0)).abs());
        errors[row] = error;
    }
    Some((errors, change))
}

fn search(task: &Task<'_>, from: &Minimum, determined: &[bool; PARAMETERS]) -> Option<Minimum> {
    let mut held = task.clone();
    for (free, determined) in held.variant.free.iter_mut().zip(determined) {
        *free &= determined;
    }
    let found = held.search(from.theta).filter(|found| found.converged);
    let theta = found.map_or(from.theta, |found| found.theta);
    let linear = task.linear(&theta)?;
    Some(Minimum {
        theta,
        chi2: linear.chi2,
        r_factor: linear.r_factor,
        converged: from.converged,
    })
}
