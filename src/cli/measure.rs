//! `track VIDEO --calib CALIB`: one recording.

use super::messages::{is_verbose, progress_bar};
use super::{Status, answer, detail, interrupt, note, say};
use crate::calibration::Calibration;
use crate::detect::centre::Accuracy;
use crate::edits::{self, Edits};
use crate::pipeline::{MeasureSettings, SpinSearch};
use crate::pipeline::{Measurement, Outcome, PointUse, Progress, measure_edited};
use crate::report::documents::json_text;
use crate::report::documents::result::ResultDocument;
use crate::report::formats::{FORMATS, OutputFormat, trk, usual_formats, write_recording};
use crate::report::{table, write};
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use indicatif::ProgressBar;
use std::collections::BTreeMap;
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
    /// Whether the ball's marks are asked for its spin: auto looks whether it has any.
    #[arg(long, value_name = "HOW", default_value = "auto", value_parser = spin_searches())]
    pub spin: SpinSearch,
    /// What you say of the recording: the edits that the page of track review saved (<name>.edits.json).
    #[arg(long, value_name = "FILE")]
    pub edits: Option<PathBuf>,
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

/// Reads whether marks are looked at.
pub fn spin_searches() -> impl TypedValueParser<Value = SpinSearch> {
    PossibleValuesParser::new(SpinSearch::ALL.map(SpinSearch::name)).map(|name| {
        let named = |search: &SpinSearch| search.name() == name;
        SpinSearch::ALL.into_iter().find(named).unwrap_or_default()
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
    if let Some(out) = &args.out {
        interrupt::clear_when_told_to_end(out);
    }
    detail(|| {
        let level = args.accuracy.name();
        format!(
            "reading {} with {}, accuracy {level}",
            args.video.display(),
            args.calib.display()
        )
    });
    let edits = match &args.edits {
        Some(path) => Edits::read(path, &args.video)?,
        None => Edits::default(),
    };
    let bar = progress_bar(None, "{msg:9} {wide_bar} {pos}/{len} {eta}");
    let mut step = "";
    let mut measurement = measure_edited(
        &args.video,
        &calibration,
        &args.calib.display().to_string(),
        MeasureSettings {
            accuracy: args.accuracy,
            spin: args.spin,
        },
        &edits,
        &mut |p| {
            let before = step;
            step = show(&bar, p);
            if step != before {
                bar.suspend(|| detail(|| step.to_owned()));
            }
        },
    )?;
    bar.finish_and_clear();
    detail(|| "measured".to_owned());
    let beside = edits::beside(&args.video);
    if args.edits.is_none() && beside.is_file() {
        note(&format!(
            "note: {} lies beside the recording and was not used; measure with --edits {} to use it",
            beside.display(),
            beside.display()
        ));
    }
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
    if is_verbose() {
        tell_points(measurement);
    }
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
            note(&format!("wrote {}", path.display()));
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

/// What is being done, which the bar then shows.
pub(super) fn show(bar: &ProgressBar, progress: Progress) -> &'static str {
    let step = match progress {
        Progress::Survey => "surveying",
        Progress::Frame { index, expected } => {
            if let Some(n) = expected {
                bar.set_length(n);
            }
            bar.set_position(index as u64 + 1);
            "tracking"
        }
        Progress::Fit => "fitting",
    };
    bar.set_message(step);
    step
}

/// How many frames were used, and which were not for which reason.
fn tell_points(measurement: &Measurement) {
    let mut reasons: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    let launches = measurement.each_launch();
    let mut used = 0;
    for point in launches.iter().flat_map(|launch| &launch.track.points) {
        match &point.use_ {
            PointUse::Used(_) => used += 1,
            PointUse::Unused(reason) => reasons.entry(reason.code()).or_default().push(point.frame),
        }
    }
    detail(|| format!("centres: {used} frames in use"));
    for (code, frames) in reasons {
        detail(|| format!("centres: {} frames {code}: {}", frames.len(), runs(&frames)));
    }
}

/// `0-3, 7, 9-12`: increasing numbers, runs of them drawn together.
fn runs(numbers: &[usize]) -> String {
    let mut runs: Vec<(usize, usize)> = Vec::new();
    for &n in numbers {
        match runs.last_mut() {
            Some((_, last)) if *last + 1 == n => *last = n,
            _ => runs.push((n, n)),
        }
    }
    let text = runs
        .iter()
        .map(|&(a, b)| if a == b { a.to_string() } else { format!("{a}-{b}") });
    text.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_of_frames_are_drawn_together() {
        assert_eq!(runs(&[0, 1, 2, 3, 7, 9, 10]), "0-3, 7, 9-10");
        assert_eq!(runs(&[]), "");
    }
}
