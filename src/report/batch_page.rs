//! `report.html` of a batch: what of it failed, the page of its series, and every recording with a link to its own page.

use super::page::{PageError, document, sorting, warning};
use super::words::{NO_VALUE, counted};
use super::{series_page, series_rows};
use crate::rebound::fit::{Note, Series, SeriesFit};
use maud::{Markup, html};

/// Recordings listed; of more, first those of which there is something to say. `series.csv` has the bounces of all.
const MOST_RECORDINGS: usize = 1000;

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
        (sorting())
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
                    @for (entry, reason) in reasons.iter().take(MOST_RECORDINGS) {
                        tr { th scope="row" { (name(entry)) } td { (entry.state.word()) ": " (reason) } }
                    }
                }
                @if reasons.len() > MOST_RECORDINGS {
                    p.soft { "The first " (MOST_RECORDINGS) "; the console named each." }
                }
            }
        }
    }
}

/// All, or of many those of which there is something to say, then others.
fn listed<'a, 'b>(entries: &'a [RecordingEntry<'b>]) -> Vec<&'a RecordingEntry<'b>> {
    let mut listed: Vec<_> = entries.iter().collect();
    if entries.len() > MOST_RECORDINGS {
        let is_plain = |e: &RecordingEntry<'_>| {
            e.state == RecordingState::Measured && e.left_out.is_none() && e.warnings.is_empty()
        };
        listed.sort_by_key(|entry| is_plain(entry));
        listed.truncate(MOST_RECORDINGS);
    }
    listed
}

fn recordings(entries: &[RecordingEntry<'_>]) -> Markup {
    let listed = listed(entries);
    html! {
        section {
            h2 { "Recordings" }
            @if listed.len() < entries.len() {
                p.soft {
                    (listed.len()) " of " (entries.len())
                    ", those first of which there is something to say; series.csv has the bounces of all."
                }
            }
            div.scroll {
                table.bounces.rows.sortable {
                    thead {
                        tr {
                            th scope="row" { "recording" }
                            @for head in ["group", "bounces", "state", "warnings"] { th scope="col" { (head) } }
                        }
                    }
                    tbody {
                        @for entry in listed {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::page::tests::assert_well_formed;

    #[test]
    fn of_ten_thousand_recordings_those_are_listed_that_ask_for_it() {
        let names: Vec<String> = (0..10_000).map(|i| format!("clip-{i:05}")).collect();
        let warned = vec!["scale_from_gravity".to_owned()];
        let entries: Vec<RecordingEntry<'_>> = names
            .iter()
            .enumerate()
            .map(|(i, name)| RecordingEntry {
                name,
                group: "all",
                page: format!("results/{name}.report.html"),
                state: if i == 7000 {
                    RecordingState::Rejected("nothing flies")
                } else {
                    RecordingState::Measured
                },
                bounces: 2,
                left_out: (i == 8000).then(|| "its fall contradicts g".to_owned()),
                warnings: if i == 9000 { &warned } else { &[] },
            })
            .collect();
        let page = recordings(&entries).into_string();
        assert!(page.len() < 400_000, "{}", page.len());
        assert!(page.contains("1000 of 10000"));
        for i in [0, 7000, 8000, 9000] {
            assert!(page.contains(&names[i]), "{i}");
        }
        assert!(!page.contains("clip-00999"));
        assert!(page.find("clip-09000") < page.find("clip-00000"));

        let few = recordings(&entries[..1000]).into_string();
        assert!(few.contains("clip-00999"));
        assert!(!few.contains("something to say"));
        assert_well_formed(&document("x", "", &recordings(&entries[..3])));
    }
}
