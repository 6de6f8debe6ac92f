//! `report.html`: the page of a series.
//!
//! The paper's figures from the user's rows, each with every model's curve, the transition, error bars and residuals; what
//! was found and why; the parameters once more as plain numbers to copy; every row with what became of it, and a link to its
//! recording's page where there is one. One file, no address outside; it prints in grey.

use super::chart::Key;
use super::figure::PlotError;
use super::figure::PlotUse;
use super::page::{PageError, document, sorting, symbol_html, warning};
use super::series_figures::{self, GroupDrawing, SeriesFigure, group_marker};
use super::series_rows::{rows_table, to_copy};
use super::series_table::{self, missing, model_rows, preferred};
use super::words::{counted, format_quantity};
use super::{chart::LineStyle, chart::PointMarker};
use crate::rebound::fit::{GroupFit, ModelFit, ModelName, Parameter, Preferred, Series, SeriesFit};
use maud::{Markup, PreEscaped, html};

/// The page, complete. Links of rows are relative to where it lies.
///
/// # Errors
/// See [`PageError`].
pub fn report_html(series: &Series, fit: &SeriesFit) -> Result<String, PageError> {
    let name = short_name(&fit.name);
    let body = html! {
        (header(fit, name))
        (sections(series, fit)?)
        (sorting())
        footer { p { "track " (env!("CARGO_PKG_VERSION")) "; ± is one standard uncertainty (k = 1)." } }
    };
    Ok(document(name, "", &body))
}

/// So many groups are shown unfolded; of more, the overview and a line each.
const OPEN_GROUPS: usize = 3;

/// What a folded group says of itself.
fn in_short(group: &GroupFit) -> String {
    let used = counted(group.rows_used.len() as u64, "row");
    match group.preferred {
        Preferred::Model(model) => format!("{used}, preferred: {}", model.name()),
        Preferred::Undetermined => format!("{used}, no model preferred"),
    }
}

/// Everything between the head of the page and its foot.
pub(super) fn sections(series: &Series, fit: &SeriesFit) -> Result<Markup, PageError> {
    let drawings = fit.groups.iter().map(|group| GroupDrawing::new(series, group));
    let drawings: Vec<GroupDrawing<'_>> = drawings.collect();
    let several = fit.groups.len() > 1;
    Ok(html! {
        @for note in &fit.notes { (warning(note.code, &note.message)) }
        @for group in &fit.groups {
            @let of_group = if several { format!("group {}: ", group.name) } else { String::new() };
            @for note in &group.notes { (warning(note.code, format!("{of_group}{}", note.message))) }
        }
        @if several { (overview(fit, &drawings)?) }
        @for (group, drawing) in fit.groups.iter().zip(&drawings) {
            @let content = html! {
                (verdict(group))
                @if !group.models.is_empty() {
                    (models_table(group))
                    (figures(drawing)?)
                }
                (rows_table(series, fit, group))
            };
            @if several {
                details.group open[fit.groups.len() <= OPEN_GROUPS] {
                    summary { h2 { "Group " (group.name) " " span.soft { "— " (in_short(group)) } } }
                    (content)
                }
            } @else {
                section { h2 { "The fit" } (content) }
            }
        }
        (to_copy(fit))
    })
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

fn header(fit: &SeriesFit, name: &str) -> Markup {
    let rows: usize = fit.groups.iter().map(|g| g.rows).sum();
    let used: usize = fit.groups.iter().map(|g| g.rows_used.len()).sum();
    let rows = counted(rows as u64, "row");
    html! {
        header {
            h1 { (name) }
            @if used == 0 {
                div.rejected {
                    strong { "✗ Not fitted" }
                    p { "None of " (rows) " can be used; see why below." }
                }
            } @else {
                p {
                    span.status { "✓ fitted" } " — " (used) " of " (rows) " in "
                    (counted(fit.groups.len() as u64, "group")) ", by " (fit.set.name())
                }
            }
        }
    }
}

fn overview(fit: &SeriesFit, drawings: &[GroupDrawing<'_>]) -> Result<Markup, PageError> {
    let cell = |group: &GroupFit, parameter| {
        let shown = group.shown();
        format_quantity(shown.and_then(|fit| fit.parameter(parameter).quantity()), "")
    };
    let angle = |group: &GroupFit| {
        let shown = group.shown();
        let angle = shown.and_then(|fit| fit.transition.angle_rad.quantity());
        format_quantity(super::words::degrees(angle), "°")
    };
    Ok(html! {
        section {
            h2 { "All groups" }
            div.scroll {
                table.bounces {
                    thead {
                        tr {
                            @for head in ["", "group", "rows", "preferred"] { th scope="col" { (head) } }
                            @for symbol in ["e", "μ", "e_x", "θ_L"] { th scope="col" { (symbol_html(symbol)) } }
                        }
                    }
                    tbody {
                        @for (i, group) in fit.groups.iter().enumerate() {
                            tr {
                                td { (marker_key(group_marker(i))) }
                                th scope="row" { (group.name) }
                                td.v { (group.rows_used.len()) }
                                td.symbol { (group.preferred.name()) }
                                @for parameter in [
                                    Parameter::Restitution,
                                    Parameter::Friction,
                                    Parameter::TangentialRestitution,
                                ] {
                                    td.symbol { (cell(group, parameter)) }
                                }
                                td.symbol { (angle(group)) }
                            }
                        }
                    }
                }
            }
            @for figure in series_figures::OF_ALL_GROUPS {
                @if let Some(chart) = series_figures::overview(drawings, figure) {
                    figure.scroll {
                        (PreEscaped(chart.svg(PlotUse::Page)?))
                        figcaption {
                            (figure.title()) ": all groups, markers as in the table; lines: the model of each."
                        }
                    }
                }
            }
        }
    })
}

fn verdict(group: &GroupFit) -> Markup {
    let mark = match group.preferred {
        Preferred::Model(_) => "✓ preferred: ",
        Preferred::Undetermined => "",
    };
    let facts = group.shown().map(|shown| {
        let missing = missing(shown).into_iter();
        let mut facts: Vec<Markup> = missing
            .map(|(symbol, reason)| html! { (symbol_or_words(symbol)) ": " (reason) })
            .collect();
        facts.extend(transition_fact(shown).map(|fact| html! { (fact) }));
        facts
    });
    html! {
        p { span.status { (mark) (preferred(group.preferred)) } }
        p { (sentence(&group.reason)) }
        @if let Some(facts) = facts.filter(|facts| !facts.is_empty()) {
            p.soft { @for (i, fact) in facts.iter().enumerate() { @if i > 0 { br; } (fact) } }
        }
        @if let Some(pace) = &group.court_pace {
            p { b { "Court pace rating" } " (ITF CS 01/02): " (series_table::court_pace(pace)) }
        }
    }
}

/// What is one word is a symbol with its index, or an acronym.
fn symbol_or_words(text: &str) -> Markup {
    if text.contains(' ') || text == "AICc" {
        html! { (text) }
    } else {
        symbol_html(text)
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

/// Words with their symbols as symbols: "if μ_o = μ".
fn typeset(words: &str) -> Markup {
    let is_symbol = |word: &str| word.contains('_') || word == "μ";
    html! {
        @for (i, word) in words.split(' ').enumerate() {
            @if i > 0 { " " }
            @if is_symbol(word) { (symbol_html(word)) } @else { (word) }
        }
    }
}

fn models_table(group: &GroupFit) -> Markup {
    let preferred = |name| group.preferred == Preferred::Model(name);
    html! {
        div.scroll {
            table.bounces {
                thead {
                    tr {
                        th scope="row" colspan="2" { "model" }
                        @for fit in &group.models {
                            th scope="col" { @if preferred(fit.name) { "✓ " } (fit.name.name()) }
                        }
                    }
                }
                tbody {
                    @for (name, symbol, cell) in model_rows(group) {
                        tr {
                            th scope="row" { (typeset(name.trim())) }
                            td.symbol { (symbol_or_words(symbol)) }
                            @for fit in &group.models { td.symbol { (cell(fit)) } }
                        }
                    }
                }
            }
        }
        @for fit in &group.models {
            @if let Some(why) = &fit.impossible { p.soft { (fit.name.name()) " cannot be: " (why) "." } }
        }
    }
}

fn figures(drawing: &GroupDrawing<'_>) -> Result<Markup, PlotError> {
    Ok(html! {
        @for figure in SeriesFigure::ALL {
            @if let Some(chart) = drawing.figure(figure) {
                figure.scroll {
                    h3 { (figure.title()) }
                    (PreEscaped(chart.svg(PlotUse::Page)?))
                    figcaption { (caption(figure, &chart, drawing)) }
                }
            }
        }
    })
}

fn caption(figure: SeriesFigure, chart: &super::chart::Chart, drawing: &GroupDrawing<'_>) -> Markup {
    html! {
        @for (i, (key, words)) in chart.legend.iter().enumerate() {
            @if i > 0 { " \u{a0} " }
            @match *key {
                Key::Marker(marker) => { (marker_key(marker)) }
                Key::Line(stroke) => { (stroke_key(stroke)) }
            }
            " " (words)
        }
        br;
        @if figure == SeriesFigure::Regimes {
            "Lines: where sliding begins, by the models that slide. A ball that rolls already (1) never slides."
        } @else {
            "Bars: one standard uncertainty. Below: measured minus the preferred (else the best) model."
            @if drawing.spins_differ() {
                " The rows differ in spin before the bounce: curves are for the commonest, residuals for each its own."
            }
        }
        @if figure == SeriesFigure::Master {
            " κ and μ are those of the compliant model. It is meant for like, elastic bodies: for rubber and hollow balls κ is what fits, \
             not a number of the material."
        }
        @if drawing.every > 1 { " One row in " (drawing.every) " is drawn." }
    }
}

/// A marker for a legend.
fn marker_key(marker: PointMarker) -> Markup {
    let shape = match marker {
        PointMarker::Disc => r##"<circle cx="8" cy="8" r="5" fill="#222"/>"##,
        PointMarker::Ring => {
            r##"<circle cx="8" cy="8" r="5" fill="#fff" stroke="#222" stroke-width="1.6"/>"##
        }
        PointMarker::Triangle => r##"<path d="M8 3 13 13H3Z" fill="#222"/>"##,
        PointMarker::OpenTriangle => {
            r##"<path d="M8 3 13 13H3Z" fill="#fff" stroke="#222" stroke-width="1.5"/>"##
        }
        PointMarker::Block => r##"<path d="M3 3H13V13H3Z" fill="#222"/>"##,
        PointMarker::Square => r##"<path d="M3 3H13V13H3Z" fill="#fff" stroke="#222" stroke-width="1.5"/>"##,
        PointMarker::Cross => r##"<path d="M3 3 13 13M13 3 3 13" stroke="#777" stroke-width="1.8"/>"##,
    };
    html! { svg.key viewBox="0 0 16 16" aria-hidden="true" { (PreEscaped(shape)) } }
}

/// A line for a legend: its colour, width and dashes.
fn stroke_key(stroke: LineStyle) -> Markup {
    let (colour, width, dashes) = match stroke {
        LineStyle::Solid => ("#2660b0", "1.6", None),
        LineStyle::Dashed => ("#222", "1.6", Some("9 5")),
        LineStyle::Broad => ("#bababa", "5", None),
        LineStyle::Dotted => ("#222", "1.8", Some("3 4")),
        LineStyle::Fine => ("#9c1c1c", "1.4", Some("2 4")),
    };
    html! {
        svg.key.line viewBox="0 0 34 16" aria-hidden="true" {
            path d="M1 8H33" fill="none" stroke=(colour) stroke-width=(width) stroke-dasharray=[dashes] {}
        }
    }
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
                let mut row = Row::new(number, *group)
                    .with(Column::IncidentAngle, tangent.atan().to_degrees(), Some(0.1))
                    .with(Column::ReboundAngle, rebound.atan().to_degrees(), Some(0.1))
                    .with(Column::SpinRatio, 0.0, None);
                row.set_recording(format!("clip {number} <b>.mp4"));
                row.set_page(match i {
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
                stiffness_ratio: None,
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
            assert_eq!(page.matches("<script>").count(), 1, "the one that sorts tables");
            for forbidden in [
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
            "if <i>μ</i><span class=\"sub\">o</span> = <i>μ</i>",
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
        assert_eq!(shown, 2 + 2 * 5, "two of all groups, five of each");
    }

    #[test]
    fn many_groups_are_folded() {
        for (names, folded) in [(&["a", "b"][..], 0), (&["a", "b", "c", "d"], 4), (&["a"], 0)] {
            let (series, fit) = made(names);
            let page = report_html(&series, &fit).unwrap();
            assert_well_formed(&page);
            assert_eq!(
                page.matches("<details class=\"group\">").count(),
                folded,
                "{names:?}"
            );
            let all = if names.len() > 1 { names.len() } else { 0 };
            assert_eq!(page.matches("<details class=\"group\"").count(), all, "{names:?}");
        }
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

    /// Writes pages to look at, as that of recordings: `TRACK_PAGES=/tmp/x cargo test --lib show_ -- --ignored`.
    #[test]
    #[ignore = "writes files to look at"]
    fn show_series_page() {
        let dir = std::path::PathBuf::from(std::env::var("TRACK_PAGES").unwrap());
        let (series, fit) = made(&["a", "b"]);
        std::fs::write(dir.join("series.html"), report_html(&series, &fit).unwrap()).unwrap();
    }
}
