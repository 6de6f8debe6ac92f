//! `report.html` of a batch: what of it failed, the page of its series, and every recording with a link to its own page.

use super::page::{PageError, document, warning};
use super::words::{NO_VALUE, counted};
use super::{series_page, series_rows};
use crate::rebound::fit::{Note, Series, SeriesFit};
use maud::{Markup, html};

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
    /// Why it is no part of the fit as a whole; `None` where it is.
    pub left_out: Option<String>,
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

/// The page, complete; `notes`: what to know of the recordings.
///
/// # Errors
/// See [`PageError`].
pub fn report_html(
    entries: &[RecordingEntry<'_>],
    notes: &[Note],
    series: &Series,
    fit: &SeriesFit,
) -> Result<String, PageError> {
    let title = format!("A series of {}", counted(entries.len() as u64, "recording"));
    let body = html! {
        (header(&title, entries, fit))
        @for note in notes { (warning(note.code, &note.message)) }
        (not_measured(entries))
        (series_page::sections(series, fit)?)
        (recordings(entries))
        footer {
            p {
                "track " (env!("CARGO_PKG_VERSION")) "; ± is one standard uncertainty (k = 1). The table: "
                a href="series.csv" { "series.csv" } "; the fit: " a href="fit.json" { "fit.json" } "."
            }
        }
    };
    Ok(document(&title, "", &body))
}

fn header(title: &str, entries: &[RecordingEntry<'_>], fit: &SeriesFit) -> Markup {
    let count = |word: &str| entries.iter().filter(|e| e.state.word() == word).count();
    let states: Vec<String> = ["measured", "rejected", "failed", "not yet measured"]
        .into_iter()
        .filter(|word| count(word) > 0)
        .map(|word| format!("{} {word}", count(word)))
        .collect();
    let rows: usize = fit.groups.iter().map(|g| g.rows).sum();
    let used: usize = fit.groups.iter().map(|g| g.rows_used.len()).sum();
    let bounces = counted(rows as u64, "bounce");
    html! {
        header {
            h1 { (title) }
            p { (states.join(", ")) }
            @if used == 0 {
                div.rejected {
                    strong { "✗ Not fitted" }
                    p {
                        @if rows == 0 { "No bounce was measured." }
                        @else { "None of " (bounces) " can be used; see why below." }
                    }
                }
            } @else {
                p {
                    span.status { "✓ fitted" } " — " (used) " of " (bounces) " in "
                    (counted(fit.groups.len() as u64, "group"))
                }
            }
        }
    }
}

/// What was not measured, and why.
fn not_measured(entries: &[RecordingEntry<'_>]) -> Markup {
    let reasons: Vec<(&RecordingEntry<'_>, &str)> = entries
        .iter()
        .filter_map(|e| match e.state {
            RecordingState::Rejected(reason) | RecordingState::Failed(reason) => Some((e, reason)),
            RecordingState::Waiting | RecordingState::Measured => None,
        })
        .collect();
    html! {
        @if !reasons.is_empty() {
            section {
                h2 { (counted(reasons.len() as u64, "recording")) " not measured" }
                table.facts {
                    @for (entry, reason) in &reasons {
                        tr { th scope="row" { (name(entry)) } td { (entry.state.word()) ": " (reason) } }
                    }
                }
            }
        }
    }
}

fn recordings(entries: &[RecordingEntry<'_>]) -> Markup {
    html! {
        section {
            h2 { "Recordings" }
            div.scroll {
                table.bounces.rows {
                    thead {
                        tr {
                            th scope="row" { "recording" }
                            @for head in ["group", "bounces", "", "warnings"] { th scope="col" { (head) } }
                        }
                    }
                    tbody {
                        @for entry in entries {
                            tr {
                                th scope="row" { (name(entry)) }
                                td.symbol { (entry.group) }
                                td.v { @if entry.state.has_page() { (entry.bounces) } @else { (NO_VALUE) } }
                                td.symbol { (entry.state.word()) @if entry.left_out.is_some() { ", left out" } }
                                td.symbol {
                                    (entry.warnings.join(", "))
                                    @if let Some(reason) = &entry.left_out { " (" (reason) ")" }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// The recording's name, linked to its page if it has one.
fn name(entry: &RecordingEntry<'_>) -> Markup {
    html! {
        @if entry.state.has_page() { a href=(series_rows::encoded(&entry.page)) { (entry.name) } }
        @else { (entry.name) }
    }
}
