//! The tables of a series' page: every row with what became of it, every number plain.

use super::words::{NO_VALUE, counted, trimmed};
use crate::rebound::fit::coordinates::Coordinates;
use crate::rebound::fit::{
    Estimate, GroupFit, ModelFit, Parameter, Preferred, Row, RowRegime, Series, SeriesFit, Weights,
};
use maud::{Markup, html};
use std::collections::HashMap;
use std::fmt::Write as _;

/// Rows listed of a group, of more those farthest from the model; `fit.json` has all of them.
const MOST_ROWS: usize = 300;

/// The rows that were set aside, and those in the fit.
pub(super) fn rows_table(series: &Series, fit: &SeriesFit, group: &GroupFit) -> Markup {
    html! {
        @if !group.rows_set_aside.is_empty() { (rows_set_aside(series, group)) }
        @if let Some(shown) = group.shown() { (rows_in_fit(series, fit, group, shown)) }
    }
}

fn rows_set_aside(series: &Series, group: &GroupFit) -> Markup {
    let names: HashMap<usize, &Row> = series.rows.iter().map(|row| (row.number, row)).collect();
    html! {
        h3 { (counted(group.rows_set_aside.len() as u64, "row")) " set aside" }
        table.facts {
            @for aside in group.rows_set_aside.iter().take(MOST_ROWS) {
                tr {
                    th scope="row" { "row " (aside.row) }
                    td { @if let Some(row) = names.get(&aside.row) { (recording(row)) } " " (aside.reason) }
                }
            }
        }
        @if group.rows_set_aside.len() > MOST_ROWS {
            p.soft { "The first " (MOST_ROWS) " of " (group.rows_set_aside.len()) "; fit.json has all of them." }
        }
    }
}

fn rows_in_fit(series: &Series, fit: &SeriesFit, group: &GroupFit, shown: &ModelFit) -> Markup {
    let row = |place: usize| &series.rows[group.row_indices[place]];
    let all = group.row_indices.len();
    let labelled = group
        .row_indices
        .iter()
        .map(|&i| &series.rows[i])
        .any(|row| row.recording().is_some() || row.page().is_some());
    let angle = |row: &Row| {
        Coordinates::new(row, fit.set, fit.weights, shown.curve.restitution(), None).map_or_else(
            || NO_VALUE.to_owned(),
            |c| format!("{:.2}°", c.incident_rad.value.to_degrees()),
        )
    };
    let mut places: Vec<usize> = (0..all).collect();
    if all > MOST_ROWS {
        let chi2 = |place: &usize| shown.rows.get(*place).map_or(f64::NEG_INFINITY, |row| row.chi2);
        places.sort_by(|a, b| chi2(b).total_cmp(&chi2(a)));
        places.truncate(MOST_ROWS);
    }
    html! {
        h3 { "Rows in the fit" }
        @if all > MOST_ROWS {
            p.soft { "The " (MOST_ROWS) " of " (all) " that lie farthest from the model; fit.json has all of them." }
        }
        div.scroll {
            table.bounces.rows.sortable {
                thead {
                    tr {
                        th scope="col" { "row" }
                        @if labelled { th scope="col" { "recording" } }
                        @for head in ["θ", "regime", "distance from the model"] { th scope="col" { (head) } }
                    }
                }
                tbody {
                    @for place in places {
                        @let row = row(place);
                        @let (regime, distance) = regime_and_distance(fit, shown, place);
                        tr {
                            td.v { (row.number) }
                            @if labelled { td.symbol { (recording(row)) } }
                            td.v { (angle(row)) }
                            td.symbol { (regime) }
                            td.symbol { (distance) }
                        }
                    }
                }
            }
        }
    }
}

/// What the row does in the model, and how far from it it lies.
fn regime_and_distance(fit: &SeriesFit, shown: &ModelFit, place: usize) -> (&'static str, String) {
    let Some(row) = shown.rows.get(place) else {
        return (NO_VALUE, String::new());
    };
    let regime = match row.regime {
        RowRegime::Sliding => "slides",
        RowRegime::Gripping => "grips",
    };
    (regime, distance(fit, shown, row.chi2))
}

/// How far a row lies from its model, in its own standard deviations, or (without) in the scatter of all rows.
fn distance(fit: &SeriesFit, shown: &ModelFit, chi2: f64) -> String {
    match fit.weights {
        Weights::Stated => format!("{:.2} σ", chi2.sqrt()),
        Weights::Unit if shown.scatter > 0.0 => {
            format!("{:.2} × scatter", chi2.sqrt() / shown.scatter)
        }
        Weights::Unit => NO_VALUE.to_owned(),
    }
}

/// The recording's name, linked to its page where that lies beside or below this one.
fn recording(row: &Row) -> Markup {
    let name = row.recording().or(row.page()).unwrap_or_default();
    html! {
        @match row.page().filter(|page| is_relative(page)) {
            Some(page) => a href=(encoded(page)) { (name) },
            None => (name),
        }
    }
}

/// Whether a link stays on the user's own disk: no scheme, no host, no root.
fn is_relative(link: &str) -> bool {
    !link.is_empty() && !link.starts_with(['/', '\\']) && !link.contains(':')
}

/// A path as a link: what has a meaning of its own in an address is written by its number.
pub(super) fn encoded(path: &str) -> String {
    let mut link = String::with_capacity(path.len());
    for byte in path.bytes() {
        if byte.is_ascii_alphanumeric() || b"-._~/".contains(&byte) {
            link.push(char::from(byte));
        } else {
            let _ = write!(link, "%{byte:02X}");
        }
    }
    link
}

/// Every number of every model, plain, to be copied into a sheet.
pub(super) fn to_copy(fit: &SeriesFit) -> Markup {
    let heads = [
        "group",
        "model",
        "preferred",
        "parameter",
        "value",
        "std_uncertainty",
        "from (95 %)",
        "to (95 %)",
    ];
    html! {
        section {
            h2 { "Parameters, to copy" }
            div.scroll {
                table.copy {
                    thead { tr { @for head in heads { th { (head) } } } }
                    tbody {
                        @for group in &fit.groups {
                            @for model in &group.models {
                                @for (name, estimate, factor) in estimates(model) {
                                    tr {
                                        td { (group.name) }
                                        td { (model.name.name()) }
                                        td { @if group.preferred == Preferred::Model(model.name) { "yes" } @else { "no" } }
                                        td { (name) }
                                        @for number in [
                                            Some(estimate.quantity.value),
                                            estimate.quantity.std_uncertainty,
                                            estimate.interval_95.0,
                                            estimate.interval_95.1,
                                        ] {
                                            td { @if let Some(x) = number { (plain(factor * x)) } }
                                        }
                                    }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// What a model determines: name, number, and the factor that brings it to the unit in its name.
fn estimates(model: &ModelFit) -> impl Iterator<Item = (&'static str, &Estimate, f64)> {
    let transition = (
        "transition_angle_deg",
        &model.transition.angle_rad,
        1_f64.to_degrees(),
    );
    Parameter::ALL
        .into_iter()
        .map(|parameter| (parameter.name(), model.parameter(parameter), 1.0))
        .chain([transition])
        .filter_map(|(name, fitted, factor)| Some((name, fitted.estimate()?, factor)))
}

/// Seven digits, with a plain minus and point, as a spreadsheet reads them.
fn plain(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return "0".to_owned();
    }
    let places = 6.0 - x.abs().log10().floor();
    if (0.0..=15.0).contains(&places) {
        trimmed(x, places as usize)
    } else {
        format!("{x:.6e}")
    }
}
