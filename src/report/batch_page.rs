//! `report.html` of a batch: what of it failed, the page of its series, and every recording with a link to its own page.

use super::page::{self, PageError, escape};
use super::words::{NO_VALUE, counted};
use super::{series_page, series_rows};
use crate::rebound::fit::{Series, SeriesFit};
use std::fmt::Write as _;

/// A recording of the batch.
#[derive(Debug, Clone)]
pub struct RecordingEntry<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its group.
    pub group: &'a str,
    /// Its own page, relative to this one.
    pub page: String,
    /// How it ended.
    pub state: RecordingState<'a>,
    /// Bounces in the series.
    pub bounces: usize,
    /// Codes of its warnings.
    pub warnings: &'a [String],
}

/// How a recording ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecordingState<'a> {
    /// Not yet.
    Waiting,
    /// It has bounces.
    Measured,
    /// It was read but shows nothing to trust, and why. It has a page.
    Rejected(&'a str),
    /// It was not measured, and why.
    Failed(&'a str),
}

impl RecordingState<'_> {
    fn word(self) -> &'static str {
        match self {
            Self::Waiting => "not yet measured",
            Self::Measured => "measured",
            Self::Rejected(_) => "rejected",
            Self::Failed(_) => "failed",
        }
    }

    fn has_page(self) -> bool {
        matches!(self, Self::Measured | Self::Rejected(_))
    }
}

/// The page, complete.
///
/// # Errors
/// See [`PageError`].
pub fn report_html(
    entries: &[RecordingEntry<'_>],
    series: &Series,
    fit: &SeriesFit,
) -> Result<String, PageError> {
    let mut html = String::new();
    let title = format!("A series of {}", counted(entries.len() as u64, "recording"));
    let _ = write!(
        html,
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title}</title>\n<style>\n{}</style>\n</head>\n<body>\n",
        page::STYLE
    );
    header(&mut html, &title, entries, fit);
    troubles(&mut html, entries);
    series_page::sections(&mut html, series, fit)?;
    recordings(&mut html, entries);
    let _ = writeln!(
        html,
        "<footer><p>track {}; ± is one standard uncertainty (k = 1). The table: <a href=\"series.csv\">series.csv</a>; the \
         fit: <a href=\"fit.json\">fit.json</a>.</p></footer>\n</body>\n</html>",
        env!("CARGO_PKG_VERSION")
    );
    Ok(html)
}

fn header(html: &mut String, title: &str, entries: &[RecordingEntry<'_>], fit: &SeriesFit) {
    let count = |word: &str| entries.iter().filter(|e| e.state.word() == word).count();
    let states: Vec<String> = ["measured", "rejected", "failed", "not yet measured"]
        .into_iter()
        .filter(|word| count(word) > 0)
        .map(|word| format!("{} {word}", count(word)))
        .collect();
    let rows: usize = fit.groups.iter().map(|g| g.rows).sum();
    let used: usize = fit.groups.iter().map(|g| g.rows_used.len()).sum();
    let _ = writeln!(html, "<header>\n<h1>{title}</h1>\n<p>{}</p>", states.join(", "));
    if used == 0 {
        let why = if rows == 0 {
            "No bounce was measured.".to_owned()
        } else {
            format!(
                "None of {} can be used; see why below.",
                counted(rows as u64, "bounce")
            )
        };
        let _ = writeln!(
            html,
            "<div class=\"rejected\"><strong>✗ Not fitted</strong>\n<p>{why}</p></div>"
        );
    } else {
        let _ = writeln!(
            html,
            "<p><span class=\"status\">✓ fitted</span> — {used} of {} in {}</p>",
            counted(rows as u64, "bounce"),
            counted(fit.groups.len() as u64, "group")
        );
    }
    html.push_str("</header>\n");
}

/// What was not measured, and why.
fn troubles(html: &mut String, entries: &[RecordingEntry<'_>]) {
    let not_measured: Vec<(&RecordingEntry<'_>, &str)> = entries
        .iter()
        .filter_map(|e| match e.state {
            RecordingState::Rejected(reason) | RecordingState::Failed(reason) => Some((e, reason)),
            RecordingState::Waiting | RecordingState::Measured => None,
        })
        .collect();
    if not_measured.is_empty() {
        return;
    }
    let _ = writeln!(
        html,
        "<section>\n<h2>{} not measured</h2>\n<table class=\"facts\">",
        counted(not_measured.len() as u64, "recording")
    );
    for (entry, reason) in not_measured {
        let _ = writeln!(
            html,
            "<tr><th scope=\"row\">{}</th><td>{}: {}</td></tr>",
            name(entry),
            entry.state.word(),
            escape(reason)
        );
    }
    html.push_str("</table>\n</section>\n");
}

fn recordings(html: &mut String, entries: &[RecordingEntry<'_>]) {
    html.push_str(
        "<section>\n<h2>Recordings</h2>\n<div class=\"scroll\"><table class=\"bounces rows\">\n<thead><tr><th scope=\"row\">\
         recording</th><th scope=\"col\">group</th><th scope=\"col\">bounces</th><th scope=\"col\"></th><th scope=\"col\">\
         warnings</th></tr></thead>\n<tbody>\n",
    );
    for entry in entries {
        let _ = writeln!(
            html,
            "<tr><th scope=\"row\">{}</th><td class=\"symbol\">{}</td><td class=\"v\">{}</td><td class=\"symbol\">{}</td>\
             <td class=\"symbol\">{}</td></tr>",
            name(entry),
            escape(entry.group),
            if entry.state.has_page() {
                entry.bounces.to_string()
            } else {
                NO_VALUE.to_owned()
            },
            entry.state.word(),
            escape(&entry.warnings.join(", ")),
        );
    }
    html.push_str("</tbody></table></div>\n</section>\n");
}

/// The recording's name, linked to its page if it has one.
fn name(entry: &RecordingEntry<'_>) -> String {
    if entry.state.has_page() {
        format!(
            "<a href=\"{}\">{}</a>",
            escape(&series_rows::encoded(&entry.page)),
            escape(entry.name)
        )
    } else {
        escape(entry.name)
    }
}
