//! `cost.html`: work-precision diagrams and the runs behind them; and `cost.svg`, a diagram of each subject.
//!
//! One file, no script, no address outside; it prints in grey.

use super::cost_table::{self, significant};
use super::page::{PageError, document};
use super::words::NO_VALUE;
use super::work_precision;
use crate::cost::recordings::Check;
use crate::cost::{CostReport, Diagram, Run, Subject};
use maud::{Markup, PreEscaped, html};

/// What this page has beyond the others.
const STYLE: &str = "body { max-width: 1500px; }\n\
    .pairs { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 600px), 1fr)); gap: 6px 18px; }\n\
    .pairs figure { margin: .3rem 0; }\n\
    .runs { font-size: .8rem; } .runs th, .runs td { padding: .1rem .7rem .1rem 0; text-align: right; white-space: nowrap; }\n\
    .runs th { border-bottom: 2px solid var(--ink); vertical-align: bottom; } .runs td { border-bottom: 1px solid var(--line); }\n\
    .runs .text { text-align: left; } .runs tr.default td { font-weight: 700; }\n\
    details { margin: .8rem 0; } summary { cursor: pointer; color: var(--accent); }\n\
    @media print { .pairs { grid-template-columns: 1fr 1fr; } }\n";

/// The page, complete.
///
/// # Errors
/// See [`PageError`].
pub fn cost_html(report: &CostReport, check: Option<&Check>) -> Result<String, PageError> {
    let body = html! {
        (header(report))
        @for section in &report.sections { (section_html(section)?) }
        (recommendation(report, check))
        footer { p { "track " (env!("CARGO_PKG_VERSION")) "; " (report.machine.words()) "." } }
    };
    Ok(document("What accuracy costs", STYLE, &body))
}

/// A diagram of each subject, two in a row: for a place where a page is too much.
///
/// # Errors
/// See [`PageError`].
pub fn cost_svg(report: &CostReport) -> Result<String, PageError> {
    let shown: Vec<(&Diagram, &[Run], String)> = report
        .sections
        .iter()
        .flat_map(|section| {
            let shown = section.diagrams.iter().filter(|d| d.overview);
            shown.map(|d| (d, section.runs.as_slice(), short(section, d)))
        })
        .collect();
    Ok(work_precision::overview(&shown)?)
}

/// What stands above a diagram.
fn short(section: &Subject, diagram: &Diagram) -> String {
    if section.name == "centres" {
        let what = diagram.title.split_once(';');
        return what.map_or(diagram.title.as_str(), |(first, _)| first).to_owned();
    }
    let what = diagram.error.words;
    let what = what.strip_prefix("rms error of ").unwrap_or(what);
    if section.name == "whole" {
        return format!("{what} against {}", diagram.work.words);
    }
    format!("{}: {what}", section.title)
}

fn header(report: &CostReport) -> Markup {
    let kind = if report.quick {
        "coarse version (--quick)"
    } else {
        "full version"
    };
    html! {
        header {
            h1 { "What accuracy costs" }
            p {
                "Error against work on scenes with known truth, both logarithmic: further down is more exact, further left \
                 is cheaper. track " (env!("CARGO_PKG_VERSION")) ", " (kind) ", made in " (format!("{:.0}", report.took_s))
                " s on " (report.machine.words()) "."
            }
            p.soft {
                "Broad grey line: the Pareto front, what no other setting in the diagram beats in both. Ring: what the \
                 program takes by itself. Dashed and named: floors. Bars: quartiles of the repeats, the marker being their \
                 median. Cross at the edge: a setting that failed, wholly or on some recordings."
            }
        }
    }
}

fn section_html(section: &Subject) -> Result<Markup, PageError> {
    Ok(html! {
        section {
            h2 { (section.title) }
            @for paragraph in &section.words { p { (paragraph) } }
            div.pairs {
                @for diagram in &section.diagrams {
                    figure {
                        div.scroll {
                            (PreEscaped(work_precision::svg(diagram, &section.runs, &short(section, diagram))?))
                        }
                        figcaption { (diagram.title) }
                    }
                }
            }
            (runs_table(section))
        }
    })
}

/// Every run; defaults in bold.
fn runs_table(section: &Subject) -> Markup {
    let names: Vec<&str> = all_names(section, |r| r.settings.iter().map(|(k, _)| *k).collect());
    let counts: Vec<&str> = all_names(section, |r| r.counts.iter().map(|(k, _)| *k).collect());
    html! {
        details {
            summary { "All " (section.runs.len()) " runs in numbers" }
            div.scroll {
                table.runs {
                    thead {
                        tr {
                            @for name in &names { th.text { (name) } }
                            @for error in &section.errors {
                                @for part in ["rms", "|bias|", "95 %"] { th { (error.name) br; (part) } }
                            }
                            @for work in &section.works { th { (work.name) br; "median (min)" } }
                            @for count in &counts { th { (count) } }
                            th.text { "failed" }
                        }
                    }
                    tbody { @for run in &section.runs { (row(section, run, &names, &counts)) } }
                }
            }
        }
    }
}

/// The names of a kind over all runs, in the order in which they first appear.
fn all_names<'a>(section: &'a Subject, of: impl Fn(&'a Run) -> Vec<&'static str>) -> Vec<&'static str> {
    let mut names = Vec::new();
    for name in section.runs.iter().flat_map(of) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

fn row(section: &Subject, run: &Run, names: &[&str], counts: &[&str]) -> Markup {
    let none = || NO_VALUE.to_owned();
    let error = |name| {
        let error = run.error(name);
        error.map_or([none(), none(), none()], |e| {
            [e.rms, e.bias, e.p95].map(significant)
        })
    };
    let work = |name| {
        run.work(name).map_or_else(none, |s| {
            if s.repeats > 1 {
                format!("{} ({})", significant(s.median), significant(s.min))
            } else {
                significant(s.median)
            }
        })
    };
    let count = |name: &str| {
        let count = run.counts.iter().find(|(known, _)| *known == name);
        count.map_or_else(none, |(_, c)| format!("{}", c.round()))
    };
    html! {
        tr class=[run.is_default.then_some("default")] {
            @for name in names { td.text { (run.setting(name).unwrap_or(NO_VALUE)) } }
            @for metric in &section.errors { @for number in error(metric.name) { td { (number) } } }
            @for metric in &section.works { td { (work(metric.name)) } }
            @for name in counts { td { (count(name)) } }
            td.text { (run.failed.as_deref().unwrap_or("")) }
        }
    }
}

fn recommendation(report: &CostReport, check: Option<&Check>) -> Markup {
    html! {
        section {
            h2 { "What to take" }
            p { (report.recommendation.words) }
            @if let Some(check) = check { p { (cost_table::check_words(check)) } }
            p.soft {
                "“95 % of all within” is a bound: with errors that are normal about 0 it holds with 95 % confidence, and no \
                 error that was seen is above it. It is wider the fewer recordings there are."
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::recommendation::{Recommendation, default_requirements};
    use crate::cost::recording_metrics::{QUANTITIES, SECONDS};
    use crate::cost::recordings::RecordingSetting;
    use crate::cost::stats::{ErrorStatistics, Quartiles};
    use crate::cost::{ErrorFloor, Machine, SettingCurve};
    use crate::report::cost_csv;
    use crate::report::documents::cost::CostDocument;

    fn report() -> CostReport {
        let run = |error: Option<f64>| Run {
            settings: vec![("accuracy", "<b>fast</b>".to_owned())],
            errors: error
                .and_then(|e| ErrorStatistics::of(&[e, -e]))
                .map(|e| ("restitution", e))
                .into_iter()
                .collect(),
            work: vec![(SECONDS.name, Quartiles::of(&[1.0, 1.5]).unwrap())],
            counts: vec![("frames", 12.0)],
            failed: error.is_none().then(|| "no <flight> & no bounce".to_owned()),
            is_default: error.is_some(),
        };
        CostReport {
            machine: Machine {
                processor: Some("CPU <1> & co".to_owned()),
                cores: 2,
                system: "linux",
                debug_build: true,
            },
            quick: true,
            took_s: 12.3,
            sections: vec![Subject {
                name: "whole",
                title: "Whole",
                words: vec!["a < b".to_owned()],
                errors: QUANTITIES.to_vec(),
                works: vec![SECONDS],
                runs: vec![run(Some(1e-3)), run(None)],
                diagrams: vec![Diagram {
                    title: "e < s".to_owned(),
                    error: QUANTITIES[0],
                    work: SECONDS,
                    floors: vec![ErrorFloor {
                        name: "floor".to_owned(),
                        error: 1e-4,
                    }],
                    curves: vec![SettingCurve {
                        name: "one".to_owned(),
                        runs: vec![0, 1],
                    }],
                    alternatives: true,
                    overview: true,
                    less_is_better: true,
                }],
            }],
            whole_settings: vec![RecordingSetting::DEFAULT; 2],
            recommendation: Recommendation {
                set_aside: Vec::new(),
                requirements: default_requirements(),
                chosen: None,
                words: "none & nothing".to_owned(),
            },
        }
    }

    #[test]
    fn the_page_is_whole_escaped_and_needs_nothing_from_outside() {
        let page = cost_html(&report(), None).unwrap();
        crate::report::page::tests::assert_well_formed(&page);
        for forbidden in [
            "<b>fast",
            "<flight>",
            "CPU <1>",
            "NaN",
            "<script",
            "src=\"http",
            "url(",
        ] {
            assert!(!page.contains(forbidden), "{forbidden}");
        }
        for expected in [
            "CPU &lt;1&gt; &amp; co, 2 cores",
            "no &lt;flight&gt;",
            "dev build",
            "time a recording / s",
        ] {
            assert!(page.contains(expected), "{expected}");
        }
    }

    #[test]
    fn json_and_csv_hold_every_run_and_what_failed_has_no_numbers() {
        let report = report();
        let json = serde_json::to_value(CostDocument::new(&report, None)).unwrap();
        let runs = json["sections"][0]["runs"].as_array().unwrap();
        assert_eq!(runs.len(), 2);
        assert_eq!(runs[0]["errors"]["restitution"]["rms"], 1e-3);
        assert_eq!(runs[1]["errors"], serde_json::json!({}));
        assert_eq!(
            json["sections"][0]["diagrams"][0]["fronts"],
            serde_json::json!([[0]])
        );
        let csv = String::from_utf8(cost_csv::cost_csv(&report).unwrap()).unwrap();
        assert_eq!(csv.lines().count(), 3, "{csv}");
        assert!(csv.lines().nth(2).unwrap().ends_with("no <flight> & no bounce"));
    }

    /// Writes a page to look at: `TRACK_PAGES=/tmp/x cargo test --lib show_ -- --ignored`.
    #[test]
    #[ignore = "writes files to look at"]
    fn show_cost_page() {
        let dir = std::path::PathBuf::from(std::env::var("TRACK_PAGES").unwrap());
        std::fs::write(dir.join("cost.html"), cost_html(&report(), None).unwrap()).unwrap();
    }
}
