//! `report.html`: the page of a series.
//!
//! The paper's figures from the user's rows, each with every model's curve, the transition, error bars and residuals; what
//! was found and why; the parameters once more as plain numbers to copy; every row with what became of it, and a link to its
//! recording's page where there is one. One file, no script, no address outside; it prints in grey.

use super::page::{self, PageError, escape, symbol_html};
use super::series_figures::{self, GroupDrawing, SeriesFigure, group_marker};
use super::series_rows::{rows_table, to_copy};
use super::series_table::{self, missing, model_rows, preferred};
use super::track_plots::PlotError;
use super::words::{counted, format_quantity};
use super::{chart::LineStyle, chart::PointMarker};
use crate::rebound::fit::{GroupFit, ModelFit, ModelName, Note, Parameter, Preferred, Series, SeriesFit};
use std::fmt::Write as _;

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
    sections(&mut page, series, fit)?;
    let _ = writeln!(
        page,
        "<footer><p>track {}; ± is one standard uncertainty (k = 1).</p></footer>\n</body>\n</html>",
        env!("CARGO_PKG_VERSION")
    );
    Ok(page)
}

/// Everything between the head of the page and its foot.
pub(super) fn sections(page: &mut String, series: &Series, fit: &SeriesFit) -> Result<(), PageError> {
    notes(page, &fit.notes, "");
    for group in &fit.groups {
        let prefix = if fit.groups.len() > 1 {
            format!("group {}: ", group.name)
        } else {
            String::new()
        };
        notes(page, &group.notes, &prefix);
    }
    let drawings: Vec<GroupDrawing<'_>> = fit
        .groups
        .iter()
        .map(|group| GroupDrawing::new(series, group))
        .collect();
    if fit.groups.len() > 1 {
        overview(page, fit, &drawings)?;
    }
    for (group, drawing) in fit.groups.iter().zip(&drawings) {
        group_section(page, series, fit, group, drawing)?;
    }
    to_copy(page, fit);
    Ok(())
}

/// The file's name, with its folder where it is a batch's `series.csv`.
fn short_name(name: &str) -> &str {
    let mut parts = name.rsplit('/');
    let last = parts.next().unwrap_or(name);
    match parts.next() {
        Some(folder) if last == crate::rebound::fit::csv::BATCH_SERIES => {
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

fn overview(page: &mut String, fit: &SeriesFit, drawings: &[GroupDrawing<'_>]) -> Result<(), PageError> {
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
    for figure in [SeriesFigure::Angles, SeriesFigure::Distances, SeriesFigure::Spin] {
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
    drawing: &GroupDrawing<'_>,
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
    if ModelName::ALL.iter().any(|model| text.starts_with(model.name())) {
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

fn figures(page: &mut String, drawing: &GroupDrawing<'_>) -> Result<(), PlotError> {
    for figure in SeriesFigure::ALL {
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

fn caption(figure: SeriesFigure, chart: &super::chart::Chart, drawing: &GroupDrawing<'_>) -> String {
    let mut parts = Vec::new();
    let has = |marker: PointMarker| chart.dots.iter().any(|dot| dot.marker == marker);
    for (marker, words) in [
        (PointMarker::Disc, "slides"),
        (PointMarker::Ring, "grips, or leaves rolling"),
        (PointMarker::Cross, "set aside"),
    ] {
        if has(marker) {
            parts.push(format!("{} {words}", marker_key(marker)));
        }
    }
    for (stroke, words) in [
        (LineStyle::Solid, "μ-e"),
        (LineStyle::Dashed, "e-e"),
        (LineStyle::Broad, "grip-slide"),
    ] {
        if chart.curves.iter().any(|(s, _)| *s == stroke) {
            parts.push(format!("{} {words}", stroke_key(stroke)));
        }
    }
    if !chart.transitions.is_empty() {
        parts.push(format!("{} sliding begins", stroke_key(LineStyle::Fine)));
    }
    let mut text = parts.join(" &nbsp; ");
    if figure == SeriesFigure::Regimes {
        text.push_str("<br>Lines: where sliding begins, by the models that slide. A ball that rolls already (1) never slides.");
    } else {
        text.push_str(
            "<br>Bars: one standard uncertainty. Below: measured minus the preferred (else the best) model.",
        );
        if drawing.spins_differ() {
            text.push_str(" The rows differ in spin before the bounce: curves are for the commonest, residuals for each its own.");
        }
    }
    if drawing.every > 1 {
        let _ = write!(text, " One row in {} is drawn.", drawing.every);
    }
    text
}

/// A marker for a legend.
fn marker_key(marker: PointMarker) -> String {
    let shape = match marker {
        PointMarker::Disc => "<circle cx=\"8\" cy=\"8\" r=\"5\" fill=\"#222\"/>",
        PointMarker::Ring => {
            "<circle cx=\"8\" cy=\"8\" r=\"5\" fill=\"#fff\" stroke=\"#222\" stroke-width=\"1.6\"/>"
        }
        PointMarker::Triangle => "<path d=\"M8 3 13 13H3Z\" fill=\"#222\"/>",
        PointMarker::OpenTriangle => {
            "<path d=\"M8 3 13 13H3Z\" fill=\"#fff\" stroke=\"#222\" stroke-width=\"1.5\"/>"
        }
        PointMarker::Block => "<path d=\"M3 3H13V13H3Z\" fill=\"#222\"/>",
        PointMarker::Square => {
            "<path d=\"M3 3H13V13H3Z\" fill=\"#fff\" stroke=\"#222\" stroke-width=\"1.5\"/>"
        }
        PointMarker::Cross => "<path d=\"M3 3 13 13M13 3 3 13\" stroke=\"#777\" stroke-width=\"1.8\"/>",
    };
    format!("<svg class=\"key\" viewBox=\"0 0 16 16\" aria-hidden=\"true\">{shape}</svg>")
}

/// A line for a legend.
fn stroke_key(stroke: LineStyle) -> String {
    let style = match stroke {
        LineStyle::Solid => "stroke=\"#2660b0\" stroke-width=\"1.6\"",
        LineStyle::Dashed => "stroke=\"#222\" stroke-width=\"1.6\" stroke-dasharray=\"9 5\"",
        LineStyle::Broad => "stroke=\"#bababa\" stroke-width=\"5\"",
        LineStyle::Fine => "stroke=\"#9c1c1c\" stroke-width=\"1.4\" stroke-dasharray=\"2 4\"",
    };
    format!(
        "<svg class=\"key line\" viewBox=\"0 0 34 16\" aria-hidden=\"true\"><path d=\"M1 8H33\" fill=\"none\" {style}/></svg>"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rebound::fit::{self, Column, Options, Row};
    use crate::report::page::tests::assert_well_formed;

    /// A steel ball by angles and a superball by the same, two rows off, in two groups with links.
    fn made(groups: &[&str]) -> (Series, SeriesFit) {
        let mut rows = Vec::new();
        for (g, group) in groups.iter().enumerate() {
            for i in 0..12 {
                let tangent = 0.2 + 0.12 * f64::from(i);
                let slid = (tangent - 0.125) / 0.78;
                let rebound = slid.max(tangent * 5.0 / 7.0 / 0.78) + if i == 5 && g == 0 { 0.2 } else { 0.0 };
                let number = rows.len() + 1;
                let mut row = Row::new(number, group)
                    .with(Column::IncidentAngle, tangent.atan().to_degrees(), Some(0.1))
                    .with(Column::ReboundAngle, rebound.atan().to_degrees(), Some(0.1))
                    .with(Column::SpinRatio, 0.0, None);
                row.recording = Some(format!("clip {number} <b>.mp4"));
                row.page = Some(match i {
                    0 => "results/clip 1 <b>.report.html".to_owned(),
                    1 => "javascript:alert(1)".to_owned(),
                    2 => "//host/page".to_owned(),
                    _ => format!("results/clip{number}.report.html"),
                });
                rows.push(row);
            }
        }
        let series = Series::new("folder/series <x>.csv", rows, Vec::new()).unwrap();
        let fit = fit::fit(
            &series,
            &Options {
                court_temperature_c: Some(20.0),
            },
        );
        (series, fit)
    }

    #[test]
    fn a_page_is_whole_and_needs_nothing_from_outside() {
        for groups in [&["all"][..], &["steel & <co>", "other"]] {
            let (series, fit) = made(groups);
            let page = report_html(&series, &fit).unwrap();
            assert_well_formed(&page);
            for forbidden in [
                "<script",
                "href=\"http",
                "src=",
                "url(",
                "@import",
                "NaN",
                "<b>.",
                "<co>",
                "javascript",
                "//host",
            ] {
                assert!(!page.contains(forbidden), "{forbidden}");
            }
        }
    }

    #[test]
    fn figures_tables_and_links_are_there() {
        let (series, fit) = made(&["a", "b"]);
        let page = report_html(&series, &fit).unwrap();
        for expected in [
            "Rebound against incidence",
            "Spin after the bounce",
            "Where the ball grips and where it slides",
            "All groups",
            "Group a",
            "Parameters, to copy",
            "1 row set aside",
            "sliding begins",
            "set aside",
            "Court pace rating",
            "<a href=\"results/clip%201%20%3Cb%3E.report.html\">clip 1 &lt;b&gt;.mp4</a>",
            "<a href=\"results/clip4.report.html\">",
            "transition_angle_deg",
        ] {
            assert!(page.contains(expected), "{expected}");
        }
        // Angles hold no distances.
        assert!(!page.contains("<h3>Distances"));
        let shown = page.matches("class=\"plot\"").count();
        assert_eq!(shown, 2 + 2 * 3, "two of all groups, three of each");
    }

    #[test]
    fn a_page_of_many_rows_stays_small() {
        let rows = (0..5000)
            .map(|i| {
                let angle = 10.0 + 0.01 * f64::from(i);
                Row::new(i as usize + 1, "all")
                    .with(Column::IncidentAngle, angle, Some(0.1))
                    .with(Column::ReboundAngle, 0.9 * angle, Some(0.1))
                    .with(Column::SpinRatio, 0.0, None)
            })
            .collect();
        let series = Series::new("many", rows, Vec::new()).unwrap();
        let fit = fit::fit(&series, &Options::default());
        let page = report_html(&series, &fit).unwrap();
        assert_well_formed(&page);
        assert!(page.contains("One row in 13 is drawn"));
        assert!(page.len() < 1_500_000, "{}", page.len());
    }
}
