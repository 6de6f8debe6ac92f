//! `track VIDEO --calib CALIB`: one recording.

use super::{Status, answer, say};
use crate::calibration::Calibration;
use crate::detect::centre::Accuracy;
use crate::pipeline::{Measurement, Outcome, Progress, measure};
use crate::report::documents::json_text;
use crate::report::documents::result::ResultDocument;
use crate::report::formats::{FORMATS, OutputFormat, trk, usual_formats, write_recording};
use crate::report::{table, write};
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use indicatif::{ProgressBar, ProgressStyle};
use std::path::{Path, PathBuf};

/// What to measure, and where to put it.
#[derive(Debug, Args)]
pub struct MeasureArgs {
    /// The recording: anything FFmpeg decodes, or a folder of numbered images.
    pub video: PathBuf,
    /// The calibration (calib.json): scale, origin, up, frame rate, ball.
    #[arg(long)]
    pub calib: PathBuf,
    /// What to spend time on: fast for screening, fine for the last hundredth of a pixel.
    #[arg(long, value_name = "LEVEL", default_value_t, value_parser = accuracy_levels())]
    pub accuracy: Accuracy,
    /// Write <name>.result.json, .points.csv, .report.html and .overlay.mp4 into this folder.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// What to write there: html, json, csv, overlay (all of these without this option), svg (each figure a file), trk (for Tracker).
    #[arg(long, value_name = "NAMES", value_delimiter = ',', requires = "out", value_parser = format_names())]
    pub formats: Option<Vec<String>>,
    /// Print the result as one JSON document in place of the table.
    #[arg(long)]
    pub json: bool,
}

/// Reads the name of a format.
pub fn format_names() -> PossibleValuesParser {
    let mut names: Vec<&str> = FORMATS.map(OutputFormat::name).to_vec();
    names.dedup();
    PossibleValuesParser::new(names)
}

/// The formats of these names, in their own order; without names the `usual` ones.
pub fn formats_named(
    names: Option<&[String]>,
    usual: impl Iterator<Item = &'static &'static dyn OutputFormat>,
) -> Vec<&'static dyn OutputFormat> {
    match names {
        None => usual.copied().collect(),
        Some(names) => {
            let asked = |format: &&dyn OutputFormat| names.iter().any(|name| name == format.name());
            FORMATS.into_iter().filter(asked).collect()
        }
    }
}

/// Reads a level of accuracy by name.
pub fn accuracy_levels() -> impl TypedValueParser<Value = Accuracy> {
    let levels = Accuracy::ALL.map(|level| {
        let words = level.method().words();
        PossibleValue::new(words.name).help(words.help)
    });
    PossibleValuesParser::new(levels).map(|name| {
        let named = |level: &Accuracy| level.name() == name;
        Accuracy::ALL.into_iter().find(named).unwrap_or_default()
    })
}

/// Measures and reports.
///
/// # Errors
///
/// Whatever keeps the recording from being read, or the results from being written.
pub fn run(args: &MeasureArgs) -> anyhow::Result<Status> {
    let calibration = Calibration::read(&args.calib)?;
    // Kept to the end: a folder that nothing came into goes again.
    let _folders = args.out.as_deref().map(write::check_output_dir).transpose()?;
    let bar = progress_bar();
    let mut measurement = measure(
        &args.video,
        &calibration,
        &args.calib.display().to_string(),
        args.accuracy,
        &mut |p| {
            show(&bar, p);
        },
    )?;
    bar.finish_and_clear();
    measurement.note_digests(&args.video, &args.calib);
    finish(
        &measurement,
        &args.video,
        args.out.as_deref(),
        args.json,
        &formats_named(args.formats.as_deref(), usual_formats()),
    )
}

/// Tells the `measurement` of `input`, and writes it into the folder `out` in some `formats`.
///
/// # Errors
/// Whatever keeps the results from being written.
pub fn finish(
    measurement: &Measurement,
    input: &Path,
    out: Option<&Path>,
    json: bool,
    formats: &[&'static dyn OutputFormat],
) -> anyhow::Result<Status> {
    for w in &measurement.warnings {
        say(&format!("warning: {}: {}", w.code, w.message));
    }
    if formats.iter().any(|format| format.name() == "trk")
        && let Some(words) = trk::uneven(measurement)
    {
        say(&format!("warning: {words}"));
    }
    if let Some(dir) = out {
        for path in write_recording(measurement, dir, &stem(input), formats.iter())? {
            say(&format!("wrote {}", path.display()));
        }
    }
    if json {
        answer(&String::from_utf8_lossy(&json_text(&ResultDocument::new(
            measurement,
        ))?))?;
    } else {
        answer(&table::table(measurement))?;
    }
    match &measurement.outcome {
        Outcome::Measured => Ok(Status::Done),
        Outcome::Rejected { reason } => {
            say(&format!("rejected: {reason}"));
            Ok(Status::Rejected)
        }
    }
}

/// The recording's name without its extension; for a folder, the folder's.
fn stem(video: &Path) -> String {
    let whole = video.canonicalize().unwrap_or_else(|_| video.to_owned());
    let name = if whole.is_dir() {
        whole.file_name()
    } else {
        whole.file_stem()
    };
    name.map_or_else(|| "recording".to_owned(), |n| n.to_string_lossy().into_owned())
}

/// A bar on a terminal; nothing elsewhere.
fn progress_bar() -> ProgressBar {
    let bar = ProgressBar::no_length();
    if let Ok(style) = ProgressStyle::with_template("{msg:9} {wide_bar} {pos}/{len} {eta}") {
        bar.set_style(style);
    }
    bar
}

fn show(bar: &ProgressBar, progress: Progress) {
    match progress {
        Progress::Survey => bar.set_message("surveying"),
        Progress::Frame { index, expected } => {
            bar.set_message("tracking");
            if let Some(n) = expected {
                bar.set_length(n);
            }
            bar.set_position(index as u64 + 1);
        }
        Progress::Fit => bar.set_message("fitting"),
    }
}
