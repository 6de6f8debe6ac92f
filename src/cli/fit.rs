//! `track fit PATH [--out DIR] [--json] [--itf TEMPERATURE_C]`: a series of bounces.

use super::{Status, answer, detail, note, say};
use crate::rebound::compliant::STIFFNESS_RATIO_RANGE;
use crate::rebound::fit::csv::RefutedRecordings;
use crate::rebound::fit::{self, Options, SeriesFit};
use crate::report::documents::fit::FitDocument;
use crate::report::documents::json_text;
use crate::report::formats::series::{SeriesFormat, write_fit};
use crate::report::{series_table, write};
use clap::Args;
use std::path::PathBuf;

/// What to fit, and where to put it.
#[derive(Debug, Args)]
pub struct FitArgs {
    /// A series: a CSV file, or the folder that `track batch` wrote (then its series.csv).
    pub path: PathBuf,
    /// Write fit.json and report.html (or what --formats asks for) into this folder.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// What to write into the folder of --out.
    #[arg(long, value_name = "FORMATS", value_delimiter = ',', requires = "out", default_values = ["json", "html"])]
    pub formats: Vec<SeriesFormat>,
    /// Print the result as one JSON document in place of the table.
    #[arg(long)]
    pub json: bool,
    /// Rate the court's pace (ITF CS 01/02) at this temperature, in °C.
    #[arg(long, value_name = "TEMPERATURE_C", allow_negative_numbers = true, value_parser = temperature)]
    pub itf: Option<f64>,
    /// How stiff the contact is sideways against being pressed together, G*/E*, for rows without a column `stiffness_ratio`: the
    /// compliant model's; 2(1-nu)/(2-nu) for bodies of Poisson number nu. Without it, it is fitted.
    #[arg(long, value_name = "K", value_parser = stiffness_ratio)]
    pub stiffness_ratio: Option<f64>,
    /// Keep bounces of recordings that gravity or the ball's size refutes: `track batch` writes them into series.csv with the reason in
    /// `left_out`, and they are not fitted without this.
    #[arg(long)]
    pub keep_refuted: bool,
}

/// A contact's stiffness ratio.
fn stiffness_ratio(text: &str) -> Result<f64, String> {
    let range = STIFFNESS_RATIO_RANGE;
    match text.parse::<f64>() {
        Ok(kappa) if (range.holds)(kappa) => Ok(kappa),
        _ => Err(format!("{}; {}", range.accepted, range.hint)),
    }
}

/// A temperature at which somebody plays.
fn temperature(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(t) if (-60.0..=80.0).contains(&t) => Ok(t),
        _ => Err("a temperature in °C, from -60 to 80".to_owned()),
    }
}

/// Fits and reports.
///
/// # Errors
///
/// Whatever keeps the series from being read, or the results from being written.
pub fn run(args: &FitArgs) -> anyhow::Result<Status> {
    let refuted = if args.keep_refuted {
        RefutedRecordings::Kept
    } else {
        RefutedRecordings::LeftOut
    };
    let series = fit::csv::read_with(&args.path, refuted)?;
    // Kept to the end: a folder that nothing came into goes again.
    let _folders = args.out.as_deref().map(write::check_output_dir).transpose()?;
    let options = Options {
        court_temperature_c: args.itf,
        stiffness_ratio: args.stiffness_ratio,
    };
    let fitted = fit::fit(&series, &options);
    warn(&fitted);
    tell_rows(&fitted);
    if let Some(dir) = &args.out {
        for path in write_fit(&series, &fitted, dir, &args.formats)? {
            note(&format!("wrote {}", path.display()));
        }
    }
    if args.json {
        answer(&String::from_utf8_lossy(&json_text(&FitDocument::new(&fitted))?))?;
    } else {
        answer(&series_table::fit_table(&fitted))?;
    }
    Ok(status(&fitted))
}

/// A group without a row that can be used is no measurement; it says so.
pub(super) fn status(fitted: &SeriesFit) -> Status {
    let empty: Vec<&str> = fitted
        .groups
        .iter()
        .filter(|group| group.models.is_empty())
        .map(|group| group.name.as_str())
        .collect();
    if empty.is_empty() {
        return Status::Done;
    }
    say(&format!(
        "rejected: no row can be used in group {}; see the reasons of each",
        empty.join(", ")
    ));
    Status::Rejected
}

/// Which rows are not in the fit, and why.
fn tell_rows(fitted: &SeriesFit) {
    for group in &fitted.groups {
        let (name, used) = (&group.name, group.rows_used.len());
        detail(|| format!("group {name}: {used} of {} rows in the fit", group.rows));
        for aside in &group.rows_set_aside {
            detail(|| format!("group {name}: row {} set aside: {}", aside.row, aside.reason));
        }
    }
}

/// The warnings of a fit, on stderr.
pub(super) fn warn(fitted: &SeriesFit) {
    for note in &fitted.notes {
        say(&format!("warning: {}: {}", note.code, note.message));
    }
    for group in &fitted.groups {
        let named = if fitted.groups.len() > 1 {
            format!("group {}: ", group.name)
        } else {
            String::new()
        };
        for note in &group.notes {
            say(&format!("warning: {named}{}: {}", note.code, note.message));
        }
    }
}
