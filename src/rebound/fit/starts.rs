//! Where a search begins: what single rows would give for each parameter, combined.
//!
//! χ² of a model with a transition has several local minima, one for each way to part the rows into those that grip and those
//! that slide. So searches begin from many places: friction such that a tenth, a quarter, a half ... of the rows slide, e_x
//! as these rows read it, and so on; restitution from the velocities, or from a grid where the columns hold it only
//! together with the rest.

use super::group_data::GroupData;
use super::observation::{Observation, Spin};
use super::row_law::{E_X, KAPPA, MU, PARAMETERS, RATIO, Theta, WITHOUT_LIMIT};
use super::search::Task;
use super::series::ColumnSet;
use std::collections::HashSet;

/// Starts that are followed to their end.
pub(super) const FOLLOWED: usize = 8;

/// Which quantiles of the rows' own readings are tried.
const QUANTILES: [f64; 5] = [0.05, 0.25, 0.5, 0.75, 0.95];

/// Rows on which starts are compared.
const ROWS: usize = 120;

/// Combinations of start values for the parameters in `free`.
pub(super) fn candidates(data: &GroupData, chosen: &[usize], free: &[bool; PARAMETERS]) -> Vec<Theta> {
    let rows: Vec<&Observation> = thinned(chosen).iter().map(|&i| &data.rows[i]).collect();
    let mut starts = Vec::new();
    let kappas = stiffness_ratios(&rows, free[KAPPA]);
    for e in restitutions(&rows) {
        let ratios = if free[RATIO] {
            spin_ratios(&rows, e)
        } else {
            vec![0.0]
        };
        for ratio in ratios {
            let frictions = if free[MU] {
                frictions(&rows, e, ratio)
            } else {
                vec![0.0]
            };
            let e_xs = if free[E_X] {
                e_xs(&rows, e, ratio)
            } else {
                vec![0.0]
            };
            for &mu in &frictions {
                for &e_x in &e_xs {
                    for &kappa in &kappas {
                        starts.push([e, e_x, mu, ratio, kappa]);
                    }
                }
            }
        }
    }
    starts
}

/// The `count` best of the starts by the sum of the `kept` smallest shares of χ² (all of them for 1), and some more.
pub(super) fn best(task: &Task<'_>, starts: Vec<Theta>, kept: f64, count: usize) -> Vec<Theta> {
    let all: Vec<usize> = (0..task.rows.len()).collect();
    let thin = thinned(task.chosen.unwrap_or(&all));
    let task = Task {
        chosen: Some(&thin),
        ..task.clone()
    };
    let mut scored: Vec<(f64, usize, Theta)> = starts
        .into_iter()
        .map(|theta| {
            let (score, sliding) = trimmed(&task, &theta, kept);
            (score, sliding, theta)
        })
        .filter(|(score, ..)| score.is_finite())
        .collect();
    scored.sort_by(|a, b| a.0.total_cmp(&b.0));
    // The best of each way to part the rows, as each may lead to a local minimum of its own; then the best of what is left.
    let mut ways = HashSet::new();
    let (firsts, rest): (Vec<_>, Vec<_>) = scored
        .into_iter()
        .partition(|(_, sliding, _)| ways.insert(*sliding));
    let other = rest.into_iter().take(count / 3);
    firsts
        .into_iter()
        .take(count)
        .chain(other)
        .map(|(.., theta)| theta)
        .collect()
}

/// The sum of the smallest shares of χ², of `kept` of the rows, and how many of them slide.
fn trimmed(task: &Task<'_>, theta: &Theta, kept: f64) -> (f64, usize) {
    let mut sliding = 0;
    let mut shares: Vec<f64> = task
        .rows()
        .map(|row| {
            task.nearest(row, theta).map_or(f64::INFINITY, |n| {
                sliding += usize::from(n.slides);
                n.chi2
            })
        })
        .collect();
    let keep = ((kept * shares.len() as f64).ceil() as usize).min(shares.len());
    if keep < shares.len() {
        shares.sort_by(f64::total_cmp);
    }
    (shares[..keep].iter().sum(), sliding)
}

fn thinned(chosen: &[usize]) -> Vec<usize> {
    let step = chosen.len().div_ceil(ROWS).max(1);
    chosen.iter().copied().step_by(step).collect()
}

/// Restitution as single rows read it from velocities; as they do if they left rolling, and as pairs of them do if they
/// slid, where the columns hold it only together with the rest; and some from all over.
fn restitutions(rows: &[&Observation]) -> Vec<f64> {
    if rows.first().is_none_or(|row| row.set == ColumnSet::Velocities) {
        return quantiles(rows.iter().map(|r| r.z[3] / r.z[1]), &[0.3, 0.5, 0.7]);
    }
    let possible = |e: &f64| *e > 0.02 && *e < 1.5;
    let rolling = rows.iter().map(|row| {
        let k = row.kinematics(&row.z, 0.0);
        let kept = k.a - row.slip_share * (k.a - k.w);
        // rebound_vx goes with e for angles, with 1/e for distances.
        let at_one = row.rebound_vx(1.0);
        if row.set == ColumnSet::Angles {
            kept / at_one
        } else {
            at_one / kept
        }
    });
    let mut found = quantiles(rolling.filter(possible), &QUANTILES);
    let mut order: Vec<&&Observation> = rows.iter().collect();
    order.sort_by(|a, b| a.kinematics(&a.z, 0.0).b.total_cmp(&b.kinematics(&b.z, 0.0).b));
    let mut pairs = Vec::new();
    for apart in [1, 2, rows.len().div_ceil(3)] {
        let both = order.iter().zip(order.iter().skip(apart));
        pairs.extend(both.filter_map(|(a, b)| sliding_pair(a, b)).filter(possible));
    }
    found.extend(quantiles(pairs.into_iter(), &[0.1, 0.3, 0.5, 0.7, 0.9]));
    found.extend((1..=5).map(|i| 0.2 * f64::from(i)));
    found
}

/// e of two rows that slide the same way: v'x = a ∓ μ (1 + e) b of both, v'x in proportion to e or 1/e.
fn sliding_pair(first: &Observation, second: &Observation) -> Option<f64> {
    let read = |row: &Observation| {
        let k = row.kinematics(&row.z, 0.0);
        let sign = if k.a < k.w { -1.0 } else { 1.0 };
        (sign * k.a / k.b, sign * row.rebound_vx(1.0) / k.b)
    };
    let ((a, after_a), (b, after_b)) = (read(first), read(second));
    let slope = (a - b) / (after_a - after_b);
    let e = if first.set == ColumnSet::Angles {
        slope
    } else {
        1.0 / slope
    };
    e.is_finite().then_some(e)
}

/// ρ as each row reads it if it left rolling, and of a ball without spin or with much.
fn spin_ratios(rows: &[&Observation], e: f64) -> Vec<f64> {
    let readings = rows.iter().filter(|row| row.spin == Spin::Shared).map(|row| {
        let a = row.kinematics(&row.z, 0.0).a;
        let s = row.slip_share;
        (row.rebound_vx(e) / a - (1.0 - s)) / s
    });
    let mut ratios = quantiles(readings, &QUANTILES);
    ratios.extend([0.0, 2.0]);
    ratios
}

/// μ as each row reads it if it slid, and one that lets all of them grip.
fn frictions(rows: &[&Observation], e: f64, ratio: f64) -> Vec<f64> {
    let readings = rows.iter().map(|row| {
        let k = row.kinematics(&row.z, ratio);
        let change = (k.a - row.rebound_vx(e)) * if k.a < k.w { -1.0 } else { 1.0 };
        change / (k.b * (1.0 + e))
    });
    // What decides which rows slide is worth a finer comb.
    let comb: Vec<f64> = (0..7).map(|i| f64::from(i) / 6.0).collect();
    let mut frictions = quantiles(readings, &comb);
    let needs = rows.iter().map(|row| {
        let k = row.kinematics(&row.z, ratio);
        row.slip_share * (k.a - k.w).abs() / (k.b * (1.0 + e))
    });
    frictions.push(2.0 * needs.fold(0.0, f64::max));
    frictions
}

/// From rubber to as good as rigid, past the ratios of like elastic bodies; or the one that is given.
fn stiffness_ratios(rows: &[&Observation], free: bool) -> Vec<f64> {
    if free {
        return vec![0.1, 0.4, 0.9, 2.5, 8.0, WITHOUT_LIMIT];
    }
    let mut given = rows.iter().filter_map(|row| row.stiffness_ratio);
    vec![given.next().unwrap_or(0.0)]
}

/// e_x as each row reads it if it gripped.
fn e_xs(rows: &[&Observation], e: f64, ratio: f64) -> Vec<f64> {
    let readings = rows.iter().map(|row| {
        let k = row.kinematics(&row.z, ratio);
        (k.a - row.rebound_vx(e)) / (row.slip_share * (k.a - k.w)) - 1.0
    });
    let mut found = quantiles(readings.filter(|e_x| e_x.abs() < 10.0), &QUANTILES);
    if found.is_empty() {
        found.push(0.0);
    }
    found
}

fn quantiles(values: impl Iterator<Item = f64>, at: &[f64]) -> Vec<f64> {
    let mut sorted: Vec<f64> = values.filter(|v| v.is_finite()).collect();
    if sorted.is_empty() {
        return Vec::new();
    }
    sorted.sort_by(f64::total_cmp);
    let last = (sorted.len() - 1) as f64;
    let mut found: Vec<f64> = at.iter().map(|q| sorted[(q * last).round() as usize]).collect();
    found.dedup();
    found
}
