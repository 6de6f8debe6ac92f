//! The table of a fit for people on stdout.

use super::documents::fit::pace_name;
use super::escape::on_one_line;
use super::table::line;
use super::words::{self, NO_VALUE, counted, format_quantity};
use crate::rebound::fit::{CourtPace, Fitted, GroupFit, ModelFit, Parameter, Preferred, SeriesFit, Weights};
use std::fmt::Write as _;

/// Columns of the names at the left.
const LABEL: usize = 27;

/// Rows of a group that are named one by one.
const MOST_ROWS: usize = 12;

/// The table, ready to print, with a newline at its end.
#[must_use]
pub fn fit_table(fit: &SeriesFit) -> String {
    let mut text = String::new();
    line(&mut text, "series", &on_one_line(&fit.name));
    let rows: usize = fit.groups.iter().map(|group| group.rows).sum();
    let weights = match fit.weights {
        Weights::Stated => "weighted by their standard deviations",
        Weights::Unit => "all weighted the same",
    };
    let groups = counted(fit.groups.len() as u64, "group");
    line(
        &mut text,
        "",
        &format!(
            "{} in {groups}, by {}, {weights}",
            counted(rows as u64, "row"),
            fit.set.name()
        ),
    );
    for group in &fit.groups {
        group_lines(&mut text, group);
    }
    text
}

fn group_lines(text: &mut String, group: &GroupFit) {
    let _ = writeln!(
        text,
        "\ngroup       {}: {}, {} in the fit",
        on_one_line(&group.name),
        counted(group.rows as u64, "row"),
        group.rows_used.len()
    );
    if !group.models.is_empty() {
        text.push('\n');
        model_columns(text, group);
    }
    text.push('\n');
    line(text, "preferred", &preferred(group.preferred));
    line(text, "", &group.reason);
    why_not(text, group);
    for aside in group.rows_set_aside.iter().take(MOST_ROWS) {
        line(text, "set aside", &format!("row {}: {}", aside.row, aside.reason));
    }
    let more = group.rows_set_aside.len().saturating_sub(MOST_ROWS);
    if more > 0 {
        line(
            text,
            "set aside",
            &format!("and {} more; --json lists them", counted(more as u64, "row")),
        );
    }
    if let Some(pace) = &group.court_pace {
        line(text, "court pace", &court_pace(pace));
    }
}

/// In words, without a full stop.
pub(super) fn preferred(preferred: Preferred) -> String {
    match preferred {
        Preferred::Model(name) => {
            let facts = name.facts();
            format!("{}: {}", facts.label, facts.summary)
        }
        Preferred::Undetermined => "undetermined: these rows do not tell".to_owned(),
    }
}

/// The rating in words.
pub(super) fn court_pace(pace: &CourtPace) -> String {
    match (&pace.rating, pace.class) {
        (Fitted::Determined(estimate), Some(class)) => {
            let class = match pace.class_interval_95 {
                Some((low, high)) if low != high => {
                    format!(
                        "{} (95 %: {} to {})",
                        pace_name(class),
                        pace_name(low),
                        pace_name(high)
                    )
                }
                _ => pace_name(class).to_owned(),
            };
            format!(
                "{} at {} °C, {class}; from e = {}, μ = {}, every bounce taken as sliding",
                format_quantity(Some(estimate.quantity), ""),
                words::trimmed(pace.temperature_c, 2),
                format_quantity(pace.restitution, ""),
                format_quantity(pace.friction, ""),
            )
        }
        (fitted, _) => format!("not determined: {}", fitted.reason().unwrap_or("no number")),
    }
}

/// A row of the table of models: name, symbol, cell.
pub(super) type ModelRow = (&'static str, &'static str, Box<dyn Fn(&ModelFit) -> String>);

/// The rows of the table of models that hold something.
pub(super) fn model_rows(group: &GroupFit) -> Vec<ModelRow> {
    let spin_fitted = group.models.iter().any(|m| m.shared_spin_ratio.is_some());
    let mut rows: Vec<ModelRow> = Parameter::ALL
        .into_iter()
        .filter(|which| *which != Parameter::SpinRatio || spin_fitted)
        .map(|which| -> ModelRow {
            let symbol = match which {
                Parameter::SpinRatio => "Rω_o/v_ox",
                other => other.symbol(),
            };
            let cell = move |fit: &ModelFit| format_quantity(fit.parameter(which).quantity(), "");
            (which.label(), symbol, Box::new(cell))
        })
        .collect();
    rows.push((
        "sliding begins at",
        "θ_L",
        Box::new(|fit| {
            let angle = fit.transition.angle_rad.quantity();
            format_quantity(words::degrees(angle), "°")
        }),
    ));
    if group
        .models
        .iter()
        .any(|m| m.transition.without_jump_rad.is_some())
    {
        rows.push((
            "  if μ_o = μ",
            "θ_L",
            Box::new(|fit| format_quantity(words::degrees(fit.transition.without_jump_rad), "°")),
        ));
    }
    rows.push((
        "rows: slide, grip",
        "",
        Box::new(|fit| format!("{}, {}", fit.sliding, fit.gripping)),
    ));
    rows.push((
        "χ², deg. of freedom",
        "χ²",
        Box::new(|fit| format!("{}, {}", significant(fit.chi2), fit.degrees_of_freedom)),
    ));
    if group.models.iter().any(|m| m.p_value.is_some()) {
        rows.push((
            "probability of that",
            "p",
            Box::new(|fit| fit.p_value.map_or_else(|| NO_VALUE.to_owned(), probability)),
        ));
    }
    rows.push((
        "Akaike's criterion",
        "AICc",
        Box::new(|fit| {
            fit.aicc.map_or_else(
                || NO_VALUE.to_owned(),
                |aicc| words::trimmed(aicc, 1).replace('-', "−"),
            )
        }),
    ));
    rows
}

fn model_columns(text: &mut String, group: &GroupFit) {
    let rows = model_rows(group);
    let cells: Vec<Vec<String>> = group
        .models
        .iter()
        .map(|fit| rows.iter().map(|row| (row.2)(fit)).collect())
        .collect();
    let widths: Vec<usize> = cells
        .iter()
        .map(|column| {
            column
                .iter()
                .map(|c| c.chars().count())
                .max()
                .unwrap_or(0)
                .max(10)
        })
        .collect();
    let mut heading = String::new();
    for (fit, width) in group.models.iter().zip(&widths) {
        let _ = write!(heading, "  {:<width$}", fit.name.name());
    }
    let _ = writeln!(text, "{:<LABEL$}{}", "", heading.trim_end());
    for (i, (name, symbol, _)) in rows.iter().enumerate() {
        let mut values = String::new();
        for (column, width) in cells.iter().zip(&widths) {
            let _ = write!(values, "  {:<width$}", column[i]);
        }
        let _ = writeln!(text, "{name:<20}{symbol:<7}{}", values.trim_end());
    }
}

/// Why parameters of the shown model have no number, those that the model has.
fn why_not(text: &mut String, group: &GroupFit) {
    let Some(fit) = group.shown() else { return };
    for (name, reason) in missing(fit) {
        line(text, "", &format!("{name}: {reason}"));
    }
    if let Some((Some(low), Some(high))) = fit.transition.angle_rad.estimate().map(|e| e.interval_95) {
        line(
            text,
            "",
            &format!(
                "θ_L lies between {:.2}° and {:.2}° (95 %), whatever μ_o is",
                low.to_degrees(),
                high.to_degrees()
            ),
        );
    }
}

/// The parameters of a model that are not determined, and why; not those that it does not have.
pub(super) fn missing(fit: &ModelFit) -> Vec<(&'static str, &str)> {
    let has = |parameter: Parameter| {
        fit.name.model().lacks(parameter).is_none()
            && (parameter != Parameter::SpinRatio || fit.shared_spin_ratio.is_some())
    };
    Parameter::ALL
        .into_iter()
        .filter(|p| has(*p))
        .filter_map(|p| Some((p.symbol(), fit.parameter(p).reason()?)))
        .collect()
}

/// Three significant digits.
pub(super) fn significant(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return "0".to_owned();
    }
    let decimals = 2.0 - x.abs().log10().floor();
    if !(-5.0..=7.0).contains(&decimals) {
        format!("{x:.2e}")
    } else {
        format!("{x:.*}", decimals.max(0.0) as usize)
    }
}

/// A probability.
pub(super) fn probability(p: f64) -> String {
    if p < 1e-4 {
        "< 0.0001".to_owned()
    } else {
        significant(p)
    }
}
