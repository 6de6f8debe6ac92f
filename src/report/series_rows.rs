//! The tables of a series' page: every row with what became of it, every number plain.

use super::page::escape;
use super::words::{NO_VALUE, counted, trimmed};
use crate::rebound::fit::coordinates::Coordinates;
use crate::rebound::fit::{
    Estimate, Fitted, GroupFit, ModelFit, Parameter, Preferred, Row, RowRegime, Series, SeriesFit, Weights,
};
use std::collections::HashMap;
use std::fmt::Write as _;

/// Rows listed of a group; `fit.json` has all of them.
const MOST_ROWS: usize = 300;

/// The rows that were set aside, and those in the fit.
pub(super) fn rows_table(page: &mut String, series: &Series, fit: &SeriesFit, group: &GroupFit) {
    if !group.rows_set_aside.is_empty() {
        let _ = writeln!(
            page,
            "<h3>{} set aside</h3>\n<table class=\"facts\">",
            counted(group.rows_set_aside.len() as u64, "row")
        );
        let names: HashMap<usize, &Row> = series.rows.iter().map(|row| (row.number, row)).collect();
        for aside in group.rows_set_aside.iter().take(MOST_ROWS) {
            let label = names
                .get(&aside.row)
                .map_or_else(String::new, |row| recording(row));
            let _ = writeln!(
                page,
                "<tr><th scope=\"row\">row {}</th><td>{label} {}</td></tr>",
                aside.row,
                escape(&aside.reason)
            );
        }
        page.push_str("</table>\n");
        more(page, group.rows_set_aside.len());
    }
    let Some(shown) = group.shown() else { return };
    page.push_str(
        "<h3>Rows in the fit</h3>\n<div class=\"scroll\"><table class=\"bounces rows\">\n<thead><tr>",
    );
    let labelled = group
        .row_indices
        .iter()
        .any(|&i| series.rows[i].recording.is_some() || series.rows[i].page.is_some());
    let mut heads = vec!["row"];
    if labelled {
        heads.push("recording");
    }
    heads.extend(["θ", "regime", "distance from the model"]);
    for head in heads {
        let _ = write!(page, "<th scope=\"col\">{head}</th>");
    }
    page.push_str("</tr></thead>\n<tbody>\n");
    for (place, &index) in group.row_indices.iter().enumerate().take(MOST_ROWS) {
        let row = &series.rows[index];
        let _ = write!(page, "<tr><td class=\"v\">{}</td>", row.number);
        if labelled {
            let _ = write!(page, "<td class=\"symbol\">{}</td>", recording(row));
        }
        let angle = Coordinates::new(row, fit.set, fit.weights, shown.curve.restitution(), None).map_or_else(
            || NO_VALUE.to_owned(),
            |c| format!("{:.2}°", c.incident_rad.value.to_degrees()),
        );
        let (regime, distance) = shown.rows.get(place).map_or((NO_VALUE, String::new()), |r| {
            let regime = match r.regime {
                RowRegime::Sliding => "slides",
                RowRegime::Gripping => "grips",
            };
            (regime, distance(fit, shown, r.chi2))
        });
        let _ = writeln!(
            page,
            "<td class=\"v\">{angle}</td><td class=\"symbol\">{regime}</td><td class=\"symbol\">{distance}</td></tr>"
        );
    }
    page.push_str("</tbody></table></div>\n");
    more(page, group.row_indices.len());
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

fn more(page: &mut String, count: usize) {
    if count > MOST_ROWS {
        let _ = writeln!(
            page,
            "<p class=\"soft\">The first {MOST_ROWS} of {count}; fit.json has all of them.</p>"
        );
    }
}

/// The recording's name, linked to its page where that lies beside or below this one.
fn recording(row: &Row) -> String {
    let name = row
        .recording
        .as_deref()
        .or(row.page.as_deref())
        .unwrap_or_default();
    match row.page.as_deref().filter(|page| is_relative(page)) {
        Some(page) => format!("<a href=\"{}\">{}</a>", escape(&encoded(page)), escape(name)),
        None => escape(name),
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
pub(super) fn to_copy(page: &mut String, fit: &SeriesFit) {
    page.push_str(
        "<section>\n<h2>Parameters, to copy</h2>\n<div class=\"scroll\"><table class=\"copy\">\n<thead><tr><th>group</th>\
         <th>model</th><th>preferred</th><th>parameter</th><th>value</th><th>std_uncertainty</th><th>from (95 %)</th>\
         <th>to (95 %)</th></tr></thead>\n<tbody>\n",
    );
    for group in &fit.groups {
        for model in &group.models {
            let preferred = if group.preferred == Preferred::Model(model.name) {
                "yes"
            } else {
                "no"
            };
            let mut line = |name: &str, fitted: &Fitted, factor: f64| {
                let Some(Estimate {
                    quantity,
                    interval_95,
                }) = fitted.estimate()
                else {
                    return;
                };
                let cell = |x: Option<f64>| x.map_or_else(String::new, |x| plain(factor * x));
                let _ = writeln!(
                    page,
                    "<tr><td>{}</td><td>{}</td><td>{preferred}</td><td>{name}</td><td>{}</td><td>{}</td><td>{}</td>\
                     <td>{}</td></tr>",
                    escape(&group.name),
                    model.name.name(),
                    cell(Some(quantity.value)),
                    cell(quantity.std_uncertainty),
                    cell(interval_95.0),
                    cell(interval_95.1),
                );
            };
            for parameter in Parameter::ALL {
                line(parameter.name(), model.parameter(parameter), 1.0);
            }
            line(
                "transition_angle_deg",
                &model.transition.angle_rad,
                1_f64.to_degrees(),
            );
        }
    }
    page.push_str("</tbody></table></div>\n</section>\n");
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
