//! `report.html`: the page of a series.
//!
//! The paper's figures from the user's rows, each with every model's curve, the transition, error bars and residuals; what
//! was found and why; the parameters once more as plain numbers to copy; every row with what became of it, and a link to its
//! recording's page where there is one. One file, no script, no address outside; it prints in grey.

use super::page::{self, PageError, escape, symbol_html};
use super::plots::PlotError;
use super::series_figures::{self, Drawing, Figure, group_marker};
use super::series_table::{self, missing, model_rows, preferred};
use super::words::{NO_VALUE, counted, format_quantity, trimmed};
use super::{chart::Marker, chart::Stroke};
use crate::fit::coordinates::Coordinates;
use crate::fit::{
    Estimate, Fitted, GroupFit, ModelFit, Note, Parameter, Preferred, RowRegime, Series, SeriesFit,
};
use std::collections::HashMap;
use std::fmt::Write as _;

/// Rows listed of a group; `fit.json` has all of them.
const MOST_ROWS: usize = 300;

/// The page, complete. Links of rows are relative to where it lies.
///
/// # Errors
/// See [`PageError`].
pub fn report_html(series: &Series, fit: &SeriesFit) -> Result<String, PageError> {
    let name = escape(short_name(&fit.name));
    let mut page = String::new();
    let _ = write!(
        page,
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{name}</title>\n<style>\n{}</style>\n</head>\n<body>\n",
        page::STYLE
    );
    header(&mut page, fit, &name);
    notes(&mut page, &fit.notes, "");
    for group in &fit.groups {
        let prefix = if fit.groups.len() > 1 {
            format!("group {}: ", group.name)
        } else {
            String::new()
        };
        notes(&mut page, &group.notes, &prefix);
    }
    let drawings: Vec<Drawing<'_>> = fit
        .groups
        .iter()
        .map(|group| Drawing::new(series, group))
        .collect();
    if fit.groups.len() > 1 {
        overview(&mut page, fit, &drawings)?;
    }
    for (group, drawing) in fit.groups.iter().zip(&drawings) {
        group_section(&mut page, series, fit, group, drawing)?;
    }
    to_copy(&mut page, fit);
    let _ = writeln!(
        page,
        "<footer><p>track {}; ± is one standard uncertainty (k = 1).</p></footer>\n</body>\n</html>",
        env!("CARGO_PKG_VERSION")
    );
    Ok(page)
}

/// The file's name, with its folder where it is a batch's `series.csv`.
fn short_name(name: &str) -> &str {
    let mut parts = name.rsplit('/');
    let last = parts.next().unwrap_or(name);
    match parts.next() {
        Some(folder) if last == crate::fit::csv::BATCH_SERIES => {
            &name[name.len() - folder.len() - last.len() - 1..]
        }
        _ => last,
    }
}

fn header(page: &mut String, fit: &SeriesFit, name: &str) {
    let rows: usize = fit.groups.iter().map(|g| g.rows).sum();
    let used: usize = fit.groups.iter().map(|g| g.rows_used.len()).sum();
    let _ = writeln!(page, "<header>\n<h1>{name}</h1>");
    if used == 0 {
        let _ = writeln!(
            page,
            "<div class=\"rejected\"><strong>✗ Not fitted</strong>\n<p>None of {} can be used; see why below.</p></div>",
            counted(rows as u64, "row")
        );
    } else {
        let _ = writeln!(
            page,
            "<p><span class=\"status\">✓ fitted</span> — {used} of {} in {}, by {}</p>",
            counted(rows as u64, "row"),
            counted(fit.groups.len() as u64, "group"),
            fit.set.name()
        );
    }
    page.push_str("</header>\n");
}

fn notes(page: &mut String, notes: &[Note], prefix: &str) {
    for note in notes {
        let _ = writeln!(
            page,
            "<p class=\"warning\"><code>⚠ {}</code><br>{}{}</p>",
            escape(note.code),
            escape(prefix),
            escape(&note.message)
        );
    }
}

fn overview(page: &mut String, fit: &SeriesFit, drawings: &[Drawing<'_>]) -> Result<(), PageError> {
    page.push_str(
        "<section>\n<h2>All groups</h2>\n<div class=\"scroll\"><table class=\"bounces\">\n<thead><tr>",
    );
    for head in ["", "group", "rows", "preferred", "e", "μ", "e_x", "θ_L"] {
        let _ = write!(page, "<th scope=\"col\">{}</th>", symbol_or_text(head));
    }
    page.push_str("</tr></thead>\n<tbody>\n");
    for (i, group) in fit.groups.iter().enumerate() {
        let shown = group.shown();
        let cell = |p: Parameter| format_quantity(shown.and_then(|fit| fit.parameter(p).quantity()), "");
        let angle = shown.and_then(|fit| fit.transition.angle_rad.quantity());
        let _ = writeln!(
            page,
            "<tr><td>{}</td><th scope=\"row\">{}</th><td class=\"v\">{}</td><td class=\"symbol\">{}</td><td \
             class=\"symbol\">{}</td><td class=\"symbol\">{}</td><td class=\"symbol\">{}</td><td \
             class=\"symbol\">{}</td></tr>",
            marker_key(group_marker(i)),
            escape(&group.name),
            group.rows_used.len(),
            escape(group.preferred.name()),
            cell(Parameter::Restitution),
            cell(Parameter::Friction),
            cell(Parameter::TangentialRestitution),
            format_quantity(super::words::degrees(angle), "°"),
        );
    }
    page.push_str("</tbody></table></div>\n");
    for figure in [Figure::Angles, Figure::Distances, Figure::Spin] {
        if let Some(chart) = series_figures::overview(drawings, figure) {
            let _ = writeln!(
                page,
                "<figure class=\"scroll\">\n{}<figcaption>{}: all groups, markers as in the table; lines: the model of \
                 each.</figcaption></figure>",
                chart.svg()?,
                figure.title()
            );
        }
    }
    page.push_str("</section>\n");
    Ok(())
}

fn symbol_or_text(head: &str) -> String {
    match head {
        "e" | "μ" | "e_x" | "θ_L" => symbol_html(head),
        other => escape(other),
    }
}

fn group_section(
    page: &mut String,
    series: &Series,
    fit: &SeriesFit,
    group: &GroupFit,
    drawing: &Drawing<'_>,
) -> Result<(), PageError> {
    let title = if fit.groups.len() > 1 {
        format!("Group {}", escape(&group.name))
    } else {
        "The fit".to_owned()
    };
    let _ = writeln!(page, "<section>\n<h2>{title}</h2>");
    verdict(page, group);
    if !group.models.is_empty() {
        models_table(page, group);
        figures(page, drawing)?;
    }
    rows_table(page, series, fit, group);
    page.push_str("</section>\n");
    Ok(())
}

fn verdict(page: &mut String, group: &GroupFit) {
    let mark = match group.preferred {
        Preferred::Model(_) => "✓ preferred: ",
        Preferred::Undetermined => "",
    };
    let _ = writeln!(
        page,
        "<p><span class=\"status\">{mark}{}</span></p>\n<p>{}</p>",
        escape(&preferred(group.preferred)),
        escape(&sentence(&group.reason))
    );
    if let Some(shown) = group.shown() {
        let mut facts: Vec<String> = missing(shown)
            .into_iter()
            .map(|(symbol, reason)| format!("{}: {}", symbol_words(symbol), escape(reason)))
            .collect();
        facts.extend(transition_fact(shown));
        if !facts.is_empty() {
            let _ = writeln!(page, "<p class=\"soft\">{}</p>", facts.join("<br>\n"));
        }
    }
    if let Some(pace) = &group.court_pace {
        let _ = writeln!(
            page,
            "<p><b>Court pace rating</b> (ITF CS 01/02): {}</p>",
            escape(&series_table::court_pace(pace))
        );
    }
}

fn symbol_words(symbol: &str) -> String {
    if symbol.contains(' ') {
        escape(symbol)
    } else {
        symbol_html(symbol)
    }
}

fn transition_fact(shown: &ModelFit) -> Option<String> {
    let estimate = shown.transition.angle_rad.estimate()?;
    let (low, high) = estimate.interval_95;
    let (low, high) = (low?.to_degrees(), high?.to_degrees());
    let without = shown.transition.without_jump_rad.map(|angle| {
        format!(
            "; {} if static friction equals friction",
            format_quantity(super::words::degrees(Some(angle)), "°")
        )
    });
    Some(format!(
        "Sliding begins between {low:.2}° and {high:.2}° (95 %){}",
        without.unwrap_or_default()
    ))
}

/// With a capital letter.
fn sentence(text: &str) -> String {
    // Names of models stay as they are.
    if text.starts_with("mu_e") || text.starts_with("e_e") || text.starts_with("grip_slide") {
        return text.to_owned();
    }
    let mut letters = text.chars();
    letters
        .next()
        .map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

fn models_table(page: &mut String, group: &GroupFit) {
    page.push_str(
        "<div class=\"scroll\"><table class=\"bounces\">\n<thead><tr><th scope=\"row\" colspan=\"2\">model</th>",
    );
    for fit in &group.models {
        let mark = if group.preferred == Preferred::Model(fit.name) {
            "✓ "
        } else {
            ""
        };
        let _ = write!(page, "<th scope=\"col\">{mark}{}</th>", fit.name.name());
    }
    page.push_str("</tr></thead>\n<tbody>\n");
    for (name, symbol, cell) in model_rows(group) {
        let symbol = if symbol == "AICc" {
            escape(symbol)
        } else {
            symbol_html(symbol)
        };
        let _ = write!(
            page,
            "<tr><th scope=\"row\">{}</th><td class=\"symbol\">{symbol}</td>",
            escape(name.trim())
        );
        for fit in &group.models {
            let _ = write!(page, "<td class=\"symbol\">{}</td>", escape(&cell(fit)));
        }
        page.push_str("</tr>\n");
    }
    page.push_str("</tbody></table></div>\n");
    for fit in &group.models {
        if let Some(why) = &fit.impossible {
            let _ = writeln!(
                page,
                "<p class=\"soft\">{} cannot be: {}.</p>",
                fit.name.name(),
                escape(why)
            );
        }
    }
}

fn figures(page: &mut String, drawing: &Drawing<'_>) -> Result<(), PlotError> {
    for figure in Figure::ALL {
        let Some(chart) = drawing.figure(figure) else {
            continue;
        };
        let _ = writeln!(
            page,
            "<figure class=\"scroll\">\n<h3>{}</h3>\n{}<figcaption>{}</figcaption></figure>",
            figure.title(),
            chart.svg()?,
            caption(figure, &chart, drawing)
        );
    }
    Ok(())
}

fn caption(figure: Figure, chart: &super::chart::Chart, drawing: &Drawing<'_>) -> String {
    let mut parts = Vec::new();
    let has = |marker: Marker| chart.dots.iter().any(|dot| dot.marker == marker);
    for (marker, words) in [
        (Marker::Disc, "slides"),
        (Marker::Ring, "grips, or leaves rolling"),
        (Marker::Cross, "set aside"),
    ] {
        if has(marker) {
            parts.push(format!("{} {words}", marker_key(marker)));
        }
    }
    for (stroke, words) in [
        (Stroke::Solid, "μ-e"),
        (Stroke::Dashed, "e-e"),
        (Stroke::Broad, "grip-slide"),
    ] {
        if chart.curves.iter().any(|(s, _)| *s == stroke) {
            parts.push(format!("{} {words}", stroke_key(stroke)));
        }
    }
    if !chart.transitions.is_empty() {
        parts.push(format!("{} sliding begins", stroke_key(Stroke::Fine)));
    }
    let mut text = parts.join(" &nbsp; ");
    if figure == Figure::Regimes {
        text.push_str("<br>Lines: where sliding begins, by the models that slide. A ball that rolls already (1) never slides.");
    } else {
        text.push_str(
            "<br>Bars: one standard uncertainty. Below: measured minus the preferred (else the best) model.",
        );
        if drawing.spins_differ() {
            text.push_str(" The rows differ in spin before the bounce: curves are for their median, residuals for each its own.");
        }
    }
    if drawing.every > 1 {
        let _ = write!(text, " One row in {} is drawn.", drawing.every);
    }
    text
}

/// A marker for a legend.
fn marker_key(marker: Marker) -> String {
    let shape = match marker {
        Marker::Disc => "<circle cx=\"8\" cy=\"8\" r=\"5\" fill=\"#222\"/>",
        Marker::Ring => {
            "<circle cx=\"8\" cy=\"8\" r=\"5\" fill=\"#fff\" stroke=\"#222\" stroke-width=\"1.6\"/>"
        }
        Marker::Triangle => "<path d=\"M8 3 13 13H3Z\" fill=\"#222\"/>",
        Marker::OpenTriangle => {
            "<path d=\"M8 3 13 13H3Z\" fill=\"#fff\" stroke=\"#222\" stroke-width=\"1.5\"/>"
        }
        Marker::Block => "<path d=\"M3 3H13V13H3Z\" fill=\"#222\"/>",
        Marker::Square => "<path d=\"M3 3H13V13H3Z\" fill=\"#fff\" stroke=\"#222\" stroke-width=\"1.5\"/>",
        Marker::Cross => "<path d=\"M3 3 13 13M13 3 3 13\" stroke=\"#777\" stroke-width=\"1.8\"/>",
    };
    format!("<svg class=\"key\" viewBox=\"0 0 16 16\" aria-hidden=\"true\">{shape}</svg>")
}

/// A line for a legend.
fn stroke_key(stroke: Stroke) -> String {
    let style = match stroke {
        Stroke::Solid => "stroke=\"#2660b0\" stroke-width=\"1.6\"",
        Stroke::Dashed => "stroke=\"#222\" stroke-width=\"1.6\" stroke-dasharray=\"9 5\"",
        Stroke::Broad => "stroke=\"#bababa\" stroke-width=\"5\"",
        Stroke::Fine => "stroke=\"#9c1c1c\" stroke-width=\"1.4\" stroke-dasharray=\"2 4\"",
    };
    format!(
        "<svg class=\"key line\" viewBox=\"0 0 34 16\" aria-hidden=\"true\"><path d=\"M1 8H33\" fill=\"none\" {style}/></svg>"
    )
}

fn rows_table(page: &mut String, series: &Series, fit: &SeriesFit, group: &GroupFit) {
    if !group.rows_set_aside.is_empty() {
        let _ = writeln!(
            page,
            "<h3>{} set aside</h3>\n<table class=\"facts\">",
            counted(group.rows_set_aside.len() as u64, "row")
        );
        let names: HashMap<usize, &crate::fit::Row> =
            series.rows.iter().map(|row| (row.number, row)).collect();
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
        crate::fit::Weights::Stated => format!("{:.2} σ", chi2.sqrt()),
        crate::fit::Weights::Unit if shown.scatter > 0.0 => {
            format!("{:.2} × scatter", chi2.sqrt() / shown.scatter)
        }
        crate::fit::Weights::Unit => NO_VALUE.to_owned(),
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
fn recording(row: &crate::fit::Row) -> String {
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
fn encoded(path: &str) -> String {
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
fn to_copy(page: &mut String, fit: &SeriesFit) {
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
