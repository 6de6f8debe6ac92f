//! `cost.html`: work-precision diagrams and the runs behind them; and `cost.svg`, a diagram of each subject.
//!
//! One file, no script, no address outside; it prints in grey.

use super::page::{self, PageError, escape};
use super::words::NO_VALUE;
use super::{cost_table, work_precision};
use crate::cost::recordings::Check;
use crate::cost::{CostReport, Diagram, Run, Subject};
use std::fmt::Write as _;

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
    let mut page = String::new();
    let _ = write!(
        page,
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>What accuracy costs</title>\n<style>\n{}{STYLE}</style>\n</head>\n<body>\n",
        page::STYLE
    );
    header(&mut page, report);
    for section in &report.sections {
        section_html(&mut page, section)?;
    }
    recommendation(&mut page, report, check);
    let _ = writeln!(
        page,
        "<footer><p>track {}; {}.</p></footer>\n</body>\n</html>",
        env!("CARGO_PKG_VERSION"),
        escape(&report.machine.words())
    );
    Ok(page)
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

fn header(page: &mut String, report: &CostReport) {
    let kind = if report.quick {
        "coarse version (--quick)"
    } else {
        "full version"
    };
    let _ = write!(
        page,
        "<header>\n<h1>What accuracy costs</h1>\n<p>Error against work on scenes with known truth, both logarithmic: further \
         down is more exact, further left is cheaper. track {}, {kind}, made in {:.0} s on {}.</p>\n\
         <p class=\"soft\">Broad grey line: the Pareto front, what no other setting in the diagram beats in both. Ring: what \
         the program takes by itself. Dashed and named: floors. Bars: quartiles of the repeats, the marker being their \
         median. Cross at the edge: a setting that failed, wholly or on some recordings.</p>\n</header>\n",
        env!("CARGO_PKG_VERSION"),
        report.took_s,
        escape(&report.machine.words())
    );
}

fn section_html(page: &mut String, section: &Subject) -> Result<(), PageError> {
    let _ = writeln!(page, "<section>\n<h2>{}</h2>", escape(section.title));
    for paragraph in &section.words {
        let _ = writeln!(page, "<p>{}</p>", escape(paragraph));
    }
    page.push_str("<div class=\"pairs\">\n");
    for diagram in &section.diagrams {
        let svg = work_precision::svg(diagram, &section.runs, &short(section, diagram))?;
        let _ = writeln!(
            page,
            "<figure><div class=\"scroll\">{svg}</div><figcaption>{}</figcaption></figure>",
            escape(&diagram.title)
        );
    }
    page.push_str("</div>\n");
    runs_table(page, section);
    page.push_str("</section>\n");
    Ok(())
}

/// Every run; defaults in bold.
fn runs_table(page: &mut String, section: &Subject) {
    let names: Vec<&str> = longest(section, |r| r.settings.iter().map(|(k, _)| *k).collect());
    let counts: Vec<&str> = longest(section, |r| r.counts.iter().map(|(k, _)| *k).collect());
    let _ = write!(
        page,
        "<details><summary>All {} runs in numbers</summary>\n<div class=\"scroll\"><table class=\"runs\">\n<thead><tr>",
        section.runs.len()
    );
    for name in &names {
        let _ = write!(page, "<th class=\"text\">{}</th>", escape(name));
    }
    for error in &section.errors {
        for part in ["rms", "|bias|", "95 %"] {
            let _ = write!(page, "<th>{}<br>{part}</th>", escape(error.name));
        }
    }
    for work in &section.works {
        let _ = write!(page, "<th>{}<br>median (min)</th>", escape(work.name));
    }
    for count in &counts {
        let _ = write!(page, "<th>{}</th>", escape(count));
    }
    page.push_str("<th class=\"text\">failed</th></tr></thead>\n<tbody>\n");
    for run in &section.runs {
        row(page, section, run, &names, &counts);
    }
    page.push_str("</tbody></table></div></details>\n");
}

/// The names of a kind over all runs, in the order in which they first appear.
fn longest<'a>(section: &'a Subject, of: impl Fn(&'a Run) -> Vec<&'static str>) -> Vec<&'static str> {
    let mut names = Vec::new();
    for name in section.runs.iter().flat_map(of) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

fn row(page: &mut String, section: &Subject, run: &Run, names: &[&str], counts: &[&str]) {
    page.push_str(if run.is_default {
        "<tr class=\"default\">"
    } else {
        "<tr>"
    });
    for name in names {
        let value = run.setting(name).unwrap_or(NO_VALUE);
        let _ = write!(page, "<td class=\"text\">{}</td>", escape(value));
    }
    for error in &section.errors {
        match run.error(error.name) {
            Some(e) => {
                let _ = write!(
                    page,
                    "<td>{}</td><td>{}</td><td>{}</td>",
                    number(e.rms),
                    number(e.bias),
                    number(e.p95)
                );
            }
            None => {
                let _ = write!(page, "<td>{NO_VALUE}</td><td>{NO_VALUE}</td><td>{NO_VALUE}</td>");
            }
        }
    }
    for work in &section.works {
        let text = run.work(work.name).map_or(NO_VALUE.to_owned(), |s| {
            if s.repeats > 1 {
                format!("{} ({})", number(s.median), number(s.min))
            } else {
                number(s.median)
            }
        });
        let _ = write!(page, "<td>{text}</td>");
    }
    for count in counts {
        let value = run.counts.iter().find(|(name, _)| name == count);
        let text = value.map_or(NO_VALUE.to_owned(), |(_, c)| format!("{}", c.round()));
        let _ = write!(page, "<td>{text}</td>");
    }
    let _ = writeln!(
        page,
        "<td class=\"text\">{}</td></tr>",
        escape(run.failed.as_deref().unwrap_or(""))
    );
}

fn number(x: f64) -> String {
    cost_table::significant(x)
}

fn recommendation(page: &mut String, report: &CostReport, check: Option<&Check>) {
    let _ = writeln!(
        page,
        "<section>\n<h2>What to take</h2>\n<p>{}</p>",
        escape(&report.recommendation.words)
    );
    if let Some(check) = check {
        let _ = writeln!(page, "<p>{}</p>", escape(&cost_table::check_words(check)));
    }
    page.push_str(
        "<p class=\"soft\">“95 % of all within” is a bound: with errors that are normal about 0 it holds with 95 % confidence, \
         and no error that was seen is above it. It is wider the fewer recordings there are.</p>\n</section>\n",
    );
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
        page::tests::assert_well_formed(&page);
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
}
