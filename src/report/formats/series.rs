//! The files of a fitted series: `fit.json`, `report.html`, and a file for each figure (`svg`, for a thesis: 8 cm wide, words of 8 points):
//! `angles.svg` ..., `GROUP.angles.svg` of each group where there are several, `overview.angles.svg` of all of them.

use super::svg::svg_file;
use crate::rebound::fit::{Series, SeriesFit};
use crate::report::documents::fit::FitDocument;
use crate::report::documents::json_text;
use crate::report::figure::{PlotError, PlotUse};
use crate::report::series_figures::{self, GroupDrawing, OF_ALL_GROUPS, SeriesFigure};
use crate::report::series_page;
use crate::report::write::{WriteError, write_into};
use std::path::{Path, PathBuf};

/// A kind of file of a fitted series.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum SeriesFormat {
    /// fit.json
    Json,
    /// report.html
    Html,
    /// Each figure, a file each
    Svg,
}

/// Writes the files of some `formats` into `dir`: all, or none; their paths. Links of rows are relative to `dir`.
///
/// # Errors
/// See [`WriteError`].
pub fn write_fit(
    series: &Series,
    fit: &SeriesFit,
    dir: &Path,
    formats: &[SeriesFormat],
) -> Result<Vec<PathBuf>, WriteError> {
    let mut files = Vec::new();
    if formats.contains(&SeriesFormat::Json) {
        let json = json_text(&FitDocument::new(fit)).map_err(Into::into);
        files.push(("fit.json".to_owned(), json));
    }
    if formats.contains(&SeriesFormat::Html) {
        let page = series_page::report_html(series, fit).map(String::into_bytes);
        files.push(("report.html".to_owned(), page.map_err(Into::into)));
    }
    if formats.contains(&SeriesFormat::Svg) {
        for (name, svg) in figures(series, fit) {
            files.push((name, svg.map_err(Into::into)));
        }
    }
    write_into(dir, files)
}

/// The names of the figures' files, and what they hold.
fn figures(series: &Series, fit: &SeriesFit) -> Vec<(String, Result<Vec<u8>, PlotError>)> {
    let drawings = fit.groups.iter().map(|group| GroupDrawing::new(series, group));
    let drawings: Vec<GroupDrawing<'_>> = drawings.collect();
    let of_all = OF_ALL_GROUPS
        .into_iter()
        .filter(|_| drawings.len() > 1)
        .filter_map(|figure| {
            let chart = series_figures::overview(&drawings, figure)?;
            Some((format!("overview.{}.svg", figure.file_word()), chart))
        });
    let words = group_words(fit);
    let of_groups = drawings.iter().zip(&words).flat_map(|(drawing, word)| {
        let several = drawings.len() > 1;
        let named = move |figure: SeriesFigure| match several {
            false => format!("{}.svg", figure.file_word()),
            true => format!("{word}.{}.svg", figure.file_word()),
        };
        SeriesFigure::ALL
            .into_iter()
            .filter_map(move |figure| Some((named(figure), drawing.figure(figure)?)))
    });
    let charts = of_all.chain(of_groups);
    charts
        .map(|(name, chart)| (name, chart.svg(PlotUse::Column).map(|svg| svg_file(&svg))))
        .collect()
}

/// The groups' names as parts of names of files, each its own.
fn group_words(fit: &SeriesFit) -> Vec<String> {
    let mut words: Vec<String> = vec!["overview".to_owned()];
    for group in &fit.groups {
        let plain: String = group
            .name
            .chars()
            .map(|c| if c.is_alphanumeric() || c == '-' { c } else { '_' })
            .collect();
        let mut word = plain.clone();
        let mut number = 2;
        // Not told apart by their case either: some file systems do not.
        while words.iter().any(|w| w.to_lowercase() == word.to_lowercase()) {
            word = format!("{plain}_{number}");
            number += 1;
        }
        words.push(word);
    }
    words.remove(0);
    words
}
