//! A series of bounces fitted with the rebound models: coefficients, where sliding begins, and which model it is.
//!
//! ```no_run
//! # fn main() -> Result<(), track::rebound::fit::FitError> {
//! use track::rebound::fit::{self, Options};
//! let series = fit::csv::read("series.csv".as_ref())?;
//! let fitted = fit::fit(&series, &Options::default());
//! for group in &fitted.groups {
//!     println!("{}: {}", group.name, group.preferred.name());
//! }
//! # Ok(())
//! # }
//! ```
//!
//! # How
//!
//! * Every number of a row has an error: a row's true values are profiled out, so that χ² is the least distance to what a
//!   model allows, in units of the errors and with their correlations (`law`, `observation`).
//! * χ² over the rows has one local minimum for each way to part them into those that grip and those that slide: it is searched from
//!   many starts by Levenberg-Marquardt (`starts`, `search`), on a QR of the whitened Jacobian (`r_factor`).
//! * Where the outcome jumps at the transition (static friction above friction), the limit is found by going through the
//!   order of the rows, and its interval by profile likelihood (`transition`).
//! * Rows that no model explains are set aside with a reason (`outliers`).
//! * Intervals come from the covariance where χ² is a parabola, and from its profile where rows change sides within reach.
//!   What the rows do not determine has no number but a reason (`estimate`).
//! * Models are compared by AICc (`criteria`, `choice`).
//! * A table that looks as if its units or columns were mistaken is told (`wrong_table`).
//!
//! # Limits
//!
//! Coefficients are constants over a group, errors Gaussian and independent from row to row: what a whole series shares (a
//! scale that is off by 1 %) widens no interval here. Motion is in the x-z plane.

pub mod coordinates;
pub mod csv;
pub mod error;
pub mod result;
pub mod series;
pub mod single_search;

mod columns;
mod court_pace;
mod criteria;
mod estimate;
mod group_data;
mod least_trimmed_squares;
mod model_choice;
mod observation;
mod outlier_runs;
mod outliers;
mod row_law;
mod search;
mod springs_of_rows;
mod starts;
mod stuck_contact;
mod transition;
mod variants;
mod wrong_table;

pub use crate::rebound::{ModelName, Parameter, Preferred};
pub use criteria::LEAST_PROBABILITY;
pub use error::FitError;
pub use result::{CourtPace, Estimate, Fitted, GroupFit, ModelFit, RowFit, RowRegime, SeriesFit, Transition};
pub use series::{Column, ColumnSet, Note, Reading, Row, Series, SetAside, Weights};

use group_data::GroupData;
use std::collections::HashMap;
use variants::Solution;

/// What is asked for beside the models.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Options {
    /// A court pace rating at this temperature, °C.
    pub court_temperature_c: Option<f64>,
    /// κ of the rows that do not give their own.
    pub stiffness_ratio: Option<f64>,
}

/// Fits every group of the series.
#[must_use]
pub fn fit(series: &Series, options: &Options) -> SeriesFit {
    let mut rows: HashMap<&str, Vec<usize>> = HashMap::new();
    for (i, row) in series.rows.iter().enumerate() {
        rows.entry(&row.group).or_default().push(i);
    }
    let mut set_aside: HashMap<&str, Vec<SetAside>> = HashMap::new();
    for aside in &series.set_aside {
        set_aside
            .entry(aside.group.as_str())
            .or_default()
            .push(aside.clone());
    }
    SeriesFit {
        name: series.name.clone(),
        set: series.set,
        weights: series.weights,
        groups: series
            .groups
            .iter()
            .map(|name| {
                let rows = rows.remove(name.as_str()).unwrap_or_default();
                let aside = set_aside.remove(name.as_str()).unwrap_or_default();
                fit_group(series, name, &rows, aside, options)
            })
            .collect(),
        notes: series.notes.clone(),
    }
}

fn fit_group(
    series: &Series,
    name: &str,
    indices: &[usize],
    mut set_aside: Vec<SetAside>,
    options: &Options,
) -> GroupFit {
    let rows = indices.len() + set_aside.len();
    let (data, unweighable) = GroupData::new(series, indices, options.stiffness_ratio);
    set_aside.extend(unweighable);
    let mut notes = wrong_table::look(series, indices);
    let (data, solutions) = without_outliers(series, name, data, &mut set_aside, &mut notes);
    set_aside.sort_by_key(|s| s.row);
    let mut order: Vec<usize> = (0..data.rows.len()).collect();
    order.sort_by_key(|&i| data.rows[i].row);
    let models: Vec<ModelFit> = solutions
        .iter()
        .filter(|_| !data.rows.is_empty())
        .map(|solution| estimate::model_fit(&data, solution, &order))
        .collect();
    let row_indices: Vec<usize> = order.iter().map(|&i| data.rows[i].row).collect();
    let mut group = GroupFit {
        name: name.to_owned(),
        rows,
        models,
        preferred: Preferred::Undetermined,
        reason: "no row can be used; see the reasons of each.".to_owned(),
        rows_used: row_indices.iter().map(|&i| series.rows[i].number).collect(),
        row_indices,
        rows_set_aside: set_aside,
        notes,
        court_pace: None,
    };
    if data.rows.is_empty() {
        return group;
    }
    let (preferred, reason, more) = model_choice::choose(&data, &solutions, &group.models);
    group.preferred = preferred;
    group.reason = reason;
    group.notes.extend(more);
    if let Some(temperature_c) = options.court_temperature_c {
        let (pace, note) = court_pace::rate(&data, &group, temperature_c);
        group.court_pace = Some(pace);
        group.notes.extend(note);
    }
    group
}

/// The rows that stay and every model fitted to them; those that no model explains go to `set_aside`.
fn without_outliers(
    series: &Series,
    name: &str,
    data: GroupData,
    set_aside: &mut Vec<SetAside>,
    notes: &mut Vec<Note>,
) -> (GroupData, Vec<Solution>) {
    // Many rows are fitted all together only once it is known which.
    let preview = data.preview();
    let solutions = variants::all(preview.as_ref().unwrap_or(&data));
    let outliers = outliers::find(series, &data, &solutions);
    if !outliers.systematic.is_empty() {
        notes.push(rows_off_together(series, &data, &outliers.systematic));
    }
    if outliers.out.is_empty() {
        let solutions = preview.map_or(solutions, |_| variants::all(&data));
        return (data, solutions);
    }
    let mut out = vec![false; data.rows.len()];
    for (i, reason) in outliers.out {
        out[i] = true;
        set_aside.push(SetAside {
            row: series.rows[data.rows[i].row].number,
            group: name.to_owned(),
            reason,
        });
    }
    let mut data = data;
    data.leave_out(&out);
    let solutions = variants::all(&data);
    (data, solutions)
}

/// The note about rows that stick out side by side.
fn rows_off_together(series: &Series, data: &GroupData, systematic: &[usize]) -> Note {
    let mut numbers: Vec<usize> = systematic
        .iter()
        .map(|&i| series.rows[data.rows[i].row].number)
        .collect();
    numbers.sort_unstable();
    let listed: Vec<String> = numbers.iter().take(20).map(usize::to_string).collect();
    Note {
        code: "rows_stick_out_together",
        message: format!(
            "{} rows lie off every model, but next to each other and to the same side ({}), as a law would have it that no \
             model here has. They stay in the fit.",
            numbers.len(),
            listed.join(", ")
        ),
    }
}
