//! What `track cost` prints: tables that people read and that a README takes as they are (Markdown; what is said beside them is quoted,
//! so that it is taken along).

use super::words::NO_VALUE;
use crate::cost::recording_metrics::{DECODING, LIGHT, QUANTITIES, SECONDS, STORAGE};
use crate::cost::recordings::{Check, RecordingSetting};
use crate::cost::{CostReport, Run, Subject, centres};
use std::fmt::Write as _;

/// The tables of centres and of whole recordings, what was observed of the rest, and the recommendation.
#[must_use]
pub fn cost_table(report: &CostReport, check: Option<&Check>) -> String {
    let mut text = format!(
        "> track {}, {}, {:.0} s on {}\n",
        env!("CARGO_PKG_VERSION"),
        if report.quick { "quick" } else { "full" },
        report.took_s,
        report.machine.words()
    );
    if let Some(section) = report.section("centres") {
        centres_table(&mut text, section);
    }
    if let Some(section) = report.section("whole") {
        whole_table(&mut text, section, &report.whole_settings, report.quick);
    }
    for name in ["integrator", "effects", "fits"] {
        if let Some(section) = report.section(name) {
            rest(&mut text, section);
        }
    }
    let _ = writeln!(text, "\n> {}", report.recommendation.words);
    if let Some(check) = check {
        let _ = writeln!(text, "> {}", check_words(check));
    }
    text
}

/// How the recommended setting did on new recordings.
#[must_use]
pub fn check_words(check: &Check) -> String {
    let part = 100.0 * check.inside as f64 / check.recordings.max(1) as f64;
    let miss = check
        .first_miss
        .as_ref()
        .map_or(String::new(), |why| format!(" The first that did not: {why}."));
    format!(
        "Run again on {} new recordings, {} of them ({part:.0} %) reach all that was wanted.{miss}",
        check.recordings, check.inside
    )
}

fn centres_table(text: &mut String, section: &Subject) {
    text.push_str(
        "\n| centres: light, codec | noise, grey | R, px | method | rms, px | bias, px | 95 %, px | bound, px | analysis, µs a frame | decoding, µs a frame |\n\
         |---|---|---|---|---|---|---|---|---|---|\n",
    );
    for run in &section.runs {
        let of = |name: &str| run.setting(name).unwrap_or(NO_VALUE);
        let bound = of("radius_px")
            .parse()
            .ok()
            .zip(of("noise_grey").parse().ok())
            .map_or(NO_VALUE.to_owned(), |(r, n)| significant(centres::bound_px(r, n)));
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {bound} | {} | {} |",
            of("light_and_codec"),
            of("noise_grey"),
            of("radius_px"),
            of("method"),
            errors(run, centres::CENTRE.name),
            work(run, centres::ANALYSIS.name),
            work(run, centres::DECODING.name),
        );
    }
}

/// rms, bias, 95 %, or why there is nothing.
fn errors(run: &Run, quantity: &str) -> String {
    match (run.error(quantity), &run.failed) {
        (Some(e), _) => format!(
            "{} | {} | {}",
            significant(e.rms),
            significant(e.bias),
            significant(e.p95)
        ),
        (None, _) => format!("failed | {NO_VALUE} | {NO_VALUE}"),
    }
}

fn work(run: &Run, name: &str) -> String {
    run.work(name)
        .map_or(NO_VALUE.to_owned(), |s| significant(s.median))
}

/// The default and what differs from it in one thing; of a quick run, which has few, all.
fn whole_table(text: &mut String, section: &Subject, settings: &[RecordingSetting], quick: bool) {
    text.push_str("\n| whole recording: accuracy | Hz | picture | exposure, ms | crf |");
    for q in QUANTITIES {
        let unit = if q.unit.is_empty() {
            String::new()
        } else {
            format!(", {}", q.unit)
        };
        let _ = write!(text, " {}{unit} |", q.words.trim_start_matches("rms error of "));
    }
    text.push_str(" s a recording | of it decoding alone | MB | lx |\n|---|---|---|---|---|");
    text.push_str(&"---|".repeat(QUANTITIES.len() + 4));
    text.push('\n');
    for (run, setting) in section.runs.iter().zip(settings) {
        if !quick && setting.differences(&RecordingSetting::DEFAULT) > 1 {
            continue;
        }
        let _ = write!(
            text,
            "| {} | {} | {} | {} | {} |",
            setting.method.name(),
            setting.frame_rate_hz,
            setting.picture(),
            significant(1e3 * setting.exposure_s),
            setting.crf
        );
        for q in QUANTITIES {
            let error = run.error(q.name).map(|e| significant(e.rms));
            let mark = if run.failed.is_some() { " ×" } else { "" };
            let _ = write!(text, " {}{mark} |", error.unwrap_or(NO_VALUE.to_owned()));
        }
        let _ = writeln!(
            text,
            " {} | {} | {} | {} |",
            work(run, SECONDS.name),
            work(run, DECODING.name),
            work(run, STORAGE.name),
            work(run, LIGHT.name)
        );
    }
    let failed = section.runs.iter().filter(|r| r.failed.is_some()).count();
    let _ = writeln!(
        text,
        "\n> rms over the recordings of each setting; × where some of them could not be measured. {failed} of {} settings \
         failed on at least one recording.",
        section.runs.len()
    );
}

/// A line a run.
fn rest(text: &mut String, section: &Subject) {
    let _ = write!(text, "\n| {} |", section.name);
    for m in section.errors.iter().chain(&section.works) {
        let _ = write!(
            text,
            " {}{}{} |",
            m.name,
            if m.unit.is_empty() { "" } else { ", " },
            m.unit
        );
    }
    let columns = 1 + section.errors.len() + section.works.len();
    let _ = writeln!(text, "\n|{}", "---|".repeat(columns));
    for run in &section.runs {
        let settings: Vec<String> = run
            .settings
            .iter()
            .map(|(k, v)| {
                if matches!(*k, "ball" | "effects" | "parameters") {
                    v.clone()
                } else {
                    format!("{k} {v}")
                }
            })
            .collect();
        let _ = write!(
            text,
            "| {}{} |",
            settings.join(", "),
            if run.is_default { " (default)" } else { "" }
        );
        for m in &section.errors {
            let error = run.error(m.name).map(|e| significant(e.rms));
            let _ = write!(text, " {} |", error.unwrap_or(NO_VALUE.to_owned()));
        }
        for m in &section.works {
            let _ = write!(text, " {} |", work(run, m.name));
        }
        text.push('\n');
    }
    if section.name == "integrator"
        && let Some(first) = section.words.first()
    {
        let _ = writeln!(text, "\n{first}");
    }
}

/// Three significant digits; a power of ten where a person would write one.
pub(super) fn significant(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return if x == 0.0 {
            "0".to_owned()
        } else {
            NO_VALUE.to_owned()
        };
    }
    let decimals = 2.0 - x.abs().log10().floor();
    if !(-4.0..=6.0).contains(&decimals) {
        format!("{x:.1e}")
    } else {
        format!("{x:.*}", decimals.max(0.0) as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits() {
        for (x, expected) in [
            (0.0, "0"),
            (0.003_412, "0.00341"),
            (12.34, "12.3"),
            (12_345.0, "12345"),
            (3.2e-9, "3.2e-9"),
            (f64::NAN, NO_VALUE),
        ] {
            assert_eq!(significant(x), expected);
        }
    }

    #[test]
    fn a_check_says_how_many_and_why_not() {
        let check = Check {
            recordings: 40,
            inside: 39,
            first_miss: Some("restitution off by 3e-3".to_owned()),
        };
        let words = check_words(&check);
        assert!(
            words.contains("39 of them (98 %)") && words.contains("off by"),
            "{words}"
        );
    }
}
