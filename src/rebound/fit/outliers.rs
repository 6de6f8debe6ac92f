//! Rows that no model can explain.
//!
//! A row is set aside only if it lies beyond chance in *every* model that describes the bulk of the rows, each fitted
//! robustly, the jumping variant of μ-e among them; so a row that merely tells the models apart stays, since the right model
//! explains it. Where no model describes the bulk (two thirds of the rows), none is set aside: then it is the models that
//! fail, and the test of fit says so. Nor is any set aside where those that stick out stand side by side on the same side
//! of the model more than chance would have it: that is a law which the models lack, not a mishap.

use super::criteria::{self, MEDIANS, TAIL_RATIOS, chi2_quantile, f_quantile};
use super::group_data::GroupData;
use super::least_trimmed_squares::{self, FALSE_ALARM, RobustFit};
use super::observation::Observation;
use super::outlier_runs::{side, side_by_side};
use super::row_law::{E, MU, NearestMotion, RATIO, Theta, incidence};
use super::series::{ColumnSet, Series, Weights};
use super::variants::Solution;
use crate::numeric::robust::median;
use crate::rebound::ModelName;

/// Fewer rows have no bulk that one could stand out from.
const LEAST_ROWS: usize = 5;

/// What was found.
#[derive(Debug, Default)]
pub(super) struct Outliers {
    /// Index into the data, and why.
    pub out: Vec<(usize, String)>,
    /// Indices that stick out but stay, as they stand side by side.
    pub systematic: Vec<usize>,
}

/// Looks for rows that no model explains. `solutions` are the plain fits to all rows, or to the sample.
pub(super) fn find(series: &Series, data: &GroupData, solutions: &[Solution]) -> Outliers {
    if data.rows.len() < LEAST_ROWS || solutions.iter().any(|s| describes_all(data, s)) {
        return Outliers::default();
    }
    let Some((fits, spread)) = least_trimmed_squares::best_fits(data) else {
        return Outliers::default();
    };
    let mut described: Vec<(RobustFit, Vec<bool>)> = Vec::new();
    for mut fit in fits {
        if let Some(out) = least_trimmed_squares::outlying_rows(data, &mut fit, spread) {
            described.push((fit, out));
        }
    }
    let Some((fit, common)) = agreed(described) else {
        return Outliers::default();
    };
    let found: Vec<usize> = (0..data.rows.len()).filter(|&i| common[i]).collect();
    if found.is_empty() {
        return Outliers::default();
    }
    let task = fit.task(data, None);
    if side_by_side(data, &task, &fit.theta, &found) {
        return Outliers {
            out: Vec::new(),
            systematic: found,
        };
    }
    let out = found
        .into_iter()
        .map(|i| (i, reason(series, data, &fit, i, spread)))
        .collect();
    Outliers {
        out,
        systematic: Vec::new(),
    }
}

/// The rows that stick out of every model that describes the bulk, with a model that describes all others. `None` where
/// there is no such model: each then describes the bulk at the cost of rows that another one explains, and the rows are not
/// to blame.
fn agreed(described: Vec<(RobustFit, Vec<bool>)>) -> Option<(RobustFit, Vec<bool>)> {
    // Of very many rows, some lie so near to the limit that models differ on them.
    const NEAR_THE_LIMIT: usize = 300;
    let rows = described.first()?.1.len();
    let common: Vec<bool> = (0..rows)
        .map(|i| described.iter().all(|(_, out)| out[i]))
        .collect();
    let count = |out: &[bool]| out.iter().filter(|o| **o).count();
    let (fit, out) = described.into_iter().min_by_key(|(_, out)| count(out))?;
    (count(&out) - count(&common) <= rows / NEAR_THE_LIMIT).then_some((fit, common))
}

/// Whether a plain fit already describes every row: as its deviations say, or, without those, with no more in the tails
/// than its own bulk leads one to expect.
fn describes_all(data: &GroupData, solution: &Solution) -> bool {
    const ENOUGH_FOR_TAILS: usize = 50;
    let freedom = solution.criteria.equations.saturating_sub(solution.rank);
    let tail = FALSE_ALARM / data.rows.len() as f64;
    let mean = solution.best.chi2 / freedom.max(1) as f64;
    let limit = match data.weights {
        Weights::Stated => {
            let probability = criteria::chi2_tail(solution.best.chi2, freedom);
            if probability.is_some_and(|p| p < criteria::LEAST_PROBABILITY) {
                return false;
            }
            chi2_quantile(tail, 1)
        }
        Weights::Unit if data.rows.len() < ENOUGH_FOR_TAILS => return false,
        Weights::Unit => mean * f_quantile(tail, 1, freedom),
    };
    let chi2 = solution
        .task(data)
        .of_nearest(&solution.best.theta, |row, near| (near.chi2, row.equations()));
    let Some(chi2) = chi2 else {
        return false;
    };
    if !chi2
        .iter()
        .all(|(chi2, equations)| chi2 / TAIL_RATIOS[equations - 1] <= limit)
    {
        return false;
    }
    if data.weights == Weights::Stated {
        return true;
    }
    let mut shares: Vec<f64> = chi2
        .iter()
        .map(|(chi2, equations)| chi2 / MEDIANS[equations - 1])
        .collect();
    let typical = median(&mut shares).unwrap_or(0.0);
    // Chance moves this ratio by some per cent for 50 rows; outliers that matter move it by more.
    mean <= 1.3 * typical
}

/// Why the row at `index` is set aside, with numbers.
fn reason(series: &Series, data: &GroupData, fit: &RobustFit, index: usize, spread: f64) -> String {
    let row = &data.rows[index];
    let task = fit.task(data, None);
    let Some(near) = task.nearest(row, &fit.theta) else {
        return "no model gives its numbers".to_owned();
    };
    let far = (near.chi2 / spread).sqrt();
    let others = match data.weights {
        Weights::Stated => {
            format!("it lies {far:.1} standard deviations from every model that describes the other rows")
        }
        Weights::Unit => format!(
            "it lies {far:.1} times the scatter of the other rows from every model that describes them"
        ),
    };
    let (equation, _) = side(&near);
    match expected(series, row, &near, (fit.variant.model, &fit.theta), equation) {
        Some(text) => format!("{others}: {text} by {}", fit.variant.model.name()),
        None => others,
    }
}

/// What was measured, and what the model expects for the measured incidence.
fn expected(
    series: &Series,
    row: &Observation,
    near: &NearestMotion,
    (model, theta): (ModelName, &Theta),
    equation: usize,
) -> Option<String> {
    let e = theta[E];
    let k = row.kinematics(&row.z, theta[RATIO]);
    let slip = k.a - k.w;
    let impulse = if near.slides {
        slip.signum() * theta[MU] * (1.0 + e) * k.b
    } else {
        model.model().grip(&incidence(row, &k), theta).value
    };
    let after = k.a - impulse;
    let (name, unit, measured, expected) = match (series.set, equation) {
        (ColumnSet::Velocities, 0) => ("rebound_vz_m_s", "m/s", row.z[3], e * k.b),
        (ColumnSet::Velocities, 1) => ("rebound_vx_m_s", "m/s", row.z[2], after),
        (ColumnSet::Velocities, _) => (
            "spin_out_m_s",
            "m/s",
            row.z[5],
            k.w + impulse / row.inertia_factor,
        ),
        (ColumnSet::Angles, _) => (
            "rebound_angle_deg",
            "degrees",
            row.z[1].to_degrees(),
            after.atan2(e * k.b).to_degrees(),
        ),
        (ColumnSet::Distances, _) => ("x_m", "m", row.z[1], 2.0 * e * row.z[0] / row.z[2] * after),
    };
    expected
        .is_finite()
        .then(|| format!("{name} is {measured:.4} {unit}, expected {expected:.4}"))
}
