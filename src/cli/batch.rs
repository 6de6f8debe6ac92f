//! `track batch PATH... --out DIR`: many recordings, and the process of a single one of them.

use super::measure::{accuracy_levels, spin_searches};
use super::messages::{is_verbose, progress_bar, set_style};
use super::{Status, answer, detail, note, say};
use crate::batch::plan::{self, BatchPlan, BatchRequest};
use crate::batch::process::{bind, machine_memory_bytes};
use crate::batch::{
    self, BatchEvent, BatchSettings, BatchSummary, CalibrationChanges, LaunchSpin, RecordingOutcome,
    RefutedRecordings, Shard,
};
use crate::calibration::Calibration;
use crate::detect::centre::Accuracy;
use crate::edits::Edits;
use crate::pipeline::{MeasureSettings, SpinSearch, measure_edited};
use crate::rebound::fit::csv;
use crate::report::escape::on_one_line;
use crate::report::formats::series::{SeriesFormat, write_fit};
use crate::report::formats::{batch_formats, write_recording};
use crate::report::series_table;
use clap::Args;
use indicatif::ProgressBar;
use std::fmt::Write as _;
use std::io::IsTerminal as _;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// What to measure, and how.
#[derive(Debug, Args)]
pub struct BatchArgs {
    /// Recordings: files, folders of them, patterns ("day*/*.mp4").
    #[arg(value_name = "PATH")]
    pub paths: Vec<PathBuf>,
    /// Folder for results/, series.csv, fit.json and report.html.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// The calibration of every recording to which the manifest gives none. Without it: <stem>.calib.json beside each.
    #[arg(long)]
    pub calib: Option<PathBuf>,
    /// A table of recordings: video, and any of calib, group, spin_ratio, frame_rate_hz, ball_radius_m.
    #[arg(long, value_name = "CSV")]
    pub manifest: Option<PathBuf>,
    /// Recordings at once; by default as many as there are cores.
    #[arg(long, value_name = "N")]
    pub jobs: Option<NonZeroUsize>,
    /// What to spend time on: fast for screening, fine for the last hundredth of a pixel.
    #[arg(long, value_name = "LEVEL", default_value_t, value_parser = accuracy_levels())]
    pub accuracy: Accuracy,
    /// Whether the ball's marks are asked for its spin: auto looks whether it has any.
    #[arg(long, value_name = "HOW", default_value = "auto", value_parser = spin_searches())]
    pub spin: SpinSearch,
    /// Stop a recording that is not done after so many seconds.
    #[arg(long, value_name = "SECONDS", default_value = "1800", value_parser = seconds)]
    pub timeout_s: Duration,
    /// Most memory for a recording, MB; by default its share of the machine's.
    #[arg(long, value_name = "MB", value_parser = clap::value_parser!(u64).range(1..=1 << 30))]
    pub memory_mb: Option<u64>,
    /// Measure everything again, also what stands.
    #[arg(long)]
    pub again: bool,
    /// Keep recordings in the fit whose fall contradicts g, or whose scale contradicts the ball's size.
    #[arg(long)]
    pub keep_refuted: bool,
    /// Write these of the series, too: svg is each figure as a file. fit.json and report.html always are.
    #[arg(long, value_name = "FORMATS", value_delimiter = ',', conflicts_with = "shard")]
    pub formats: Vec<SeriesFormat>,
    /// Measure this part only, as 2/16 the second of 16; the parts run on any machines that share the folder. Then --merge.
    #[arg(long, value_name = "I/N", conflicts_with = "keep_refuted")]
    pub shard: Option<Shard>,
    /// Measure nothing: write the series, fit and page of all shards in --out.
    #[arg(
        long,
        conflicts_with_all = ["shard", "calib", "jobs", "accuracy", "timeout_s", "memory_mb", "again", "spin"]
    )]
    pub merge: bool,
}

/// A time for which somebody waits.
fn seconds(text: &str) -> Result<Duration, String> {
    match text.parse::<f64>() {
        Ok(s) if s > 0.0 && s <= 1e7 => Ok(Duration::from_secs_f64(s)),
        _ => Err("a number of seconds above 0".to_owned()),
    }
}

/// Arguments of the process of a single recording.
#[derive(Debug, Args)]
pub struct RecordingArgs {
    /// The recording.
    pub video: PathBuf,
    /// The process of the batch.
    #[arg(long)]
    pub parent: u32,
    /// Where its files go.
    #[arg(long)]
    pub out: PathBuf,
    /// What they are called.
    #[arg(long)]
    pub name: String,
    /// Its calibration.
    #[arg(long)]
    pub calib: PathBuf,
    /// What a person said of it.
    #[arg(long)]
    pub edits: Option<PathBuf>,
    /// How centres are found.
    #[arg(long, value_parser = accuracy_levels())]
    pub accuracy: Accuracy,
    /// Whether marks are asked for spin.
    #[arg(long, default_value = "auto", value_parser = spin_searches())]
    pub spin: SpinSearch,
    /// In place of the calibration's.
    #[arg(long, value_parser = spin)]
    pub spin_ratio: Option<LaunchSpin>,
    /// In place of the calibration's.
    #[arg(long)]
    pub frame_rate_hz: Option<f64>,
    /// In place of the calibration's.
    #[arg(long)]
    pub ball_radius_m: Option<f64>,
    /// Most memory.
    #[arg(long)]
    pub memory_bytes: Option<u64>,
}

fn spin(text: &str) -> Result<LaunchSpin, String> {
    if text == "unknown" {
        return Ok(LaunchSpin::Unknown);
    }
    text.parse()
        .map(LaunchSpin::Ratio)
        .map_err(|_| "a number, or unknown".to_owned())
}

/// A machine shared by more than so many recordings gives each of them no less than this, bytes.
const LEAST_MEMORY_BYTES: u64 = 1 << 30;

/// Measures a single recording of a batch.
///
/// # Errors
///
/// Whatever keeps the recording from being read, or the results from being written.
pub fn run_recording(args: &RecordingArgs) -> anyhow::Result<Status> {
    bind(args.parent, args.memory_bytes)?;
    let changes = CalibrationChanges {
        spin: args.spin_ratio.unwrap_or_default(),
        frame_rate_hz: args.frame_rate_hz,
        ball_radius_m: args.ball_radius_m,
    };
    let calibration = changes.applied(Calibration::read(&args.calib)?);
    let name = args.calib.display().to_string();
    let edits = match &args.edits {
        Some(path) => Edits::read(path, &args.video)?,
        None => Edits::default(),
    };
    let mut measurement = measure_edited(
        &args.video,
        &calibration,
        &name,
        MeasureSettings {
            accuracy: args.accuracy,
            spin: args.spin,
        },
        &edits,
        &mut |_| {},
    )?;
    measurement.note_digests(&args.video, &args.calib);
    write_recording(&measurement, &args.out, &args.name, batch_formats())?;
    Ok(match measurement.outcome {
        crate::pipeline::Outcome::Measured => Status::Done,
        crate::pipeline::Outcome::Rejected { .. } => Status::Rejected,
    })
}

/// Measures all and reports.
///
/// # Errors
///
/// Whatever keeps the batch from being run, or its results from being written.
pub fn run(args: &BatchArgs) -> anyhow::Result<Status> {
    let plan = || {
        plan::make(&BatchRequest {
            paths: args.paths.clone(),
            manifest: args.manifest.clone(),
            calib: args.calib.clone(),
        })
    };
    let refuted = if args.keep_refuted {
        RefutedRecordings::Kept
    } else {
        RefutedRecordings::LeftOut
    };
    if args.merge {
        let named = !args.paths.is_empty() || args.manifest.is_some();
        let given = named.then(plan).transpose()?;
        let (plan, finished) = batch::merge::run(given.as_ref(), refuted, &args.out)?;
        return report(&plan, &finished, args, refuted);
    }
    let plan = plan()?;
    let cores = std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
    let jobs = args.jobs.unwrap_or(cores);
    let share = |whole: u64| (whole / jobs.get() as u64).max(LEAST_MEMORY_BYTES);
    let settings = BatchSettings {
        accuracy: args.accuracy,
        spin: args.spin,
        jobs,
        time_limit: args.timeout_s,
        memory_bytes: args
            .memory_mb
            .map(|mb| mb << 20)
            .or_else(|| machine_memory_bytes().map(share)),
        again: args.again,
        refuted,
    };
    tell_plan(&plan, &settings);
    if let Some(shard) = args.shard {
        return run_shard(&plan, shard, &settings, &args.out);
    }
    let mut watcher = Watcher::new(plan.recordings.len());
    let finished = batch::run(&plan, &settings, &args.out, &mut |p| watcher.see(p))?;
    watcher.bar.finish_and_clear();
    report(&plan, &finished, args, refuted)
}

/// Measures a shard and says how its recordings ended.
fn run_shard(plan: &BatchPlan, shard: Shard, settings: &BatchSettings, out: &Path) -> anyhow::Result<Status> {
    let ours = plan.recordings.iter().filter(|r| shard.has(&r.name)).count();
    let mut watcher = Watcher::new(ours);
    let finished = batch::run_shard(plan, shard, settings, out, &mut |p| watcher.see(p))?;
    watcher.bar.finish_and_clear();
    note(&format!("wrote {}", finished.record.display()));
    let of_all = format!("shard {shard}, of {} recordings: ", plan.recordings.len());
    let text = of_all + &summary(&finished.plan, &finished.outcomes, finished.now);
    answer(&text)?;
    let all_measured = finished.outcomes.iter().all(|e| *e == RecordingOutcome::Measured);
    Ok(if all_measured {
        Status::Done
    } else {
        Status::Rejected
    })
}

/// What there is to know of a series that was written.
fn report(
    plan: &BatchPlan,
    finished: &BatchSummary,
    args: &BatchArgs,
    refuted: RefutedRecordings,
) -> anyhow::Result<Status> {
    for note in &finished.notes {
        say(&on_one_line(&format!("warning: {}: {}", note.code, note.message)));
    }
    super::fit::warn(&finished.fit);
    for path in &finished.files {
        note(&format!("wrote {}", path.display()));
    }
    if finished.rows > 0 && args.formats.contains(&SeriesFormat::Svg) {
        let series = csv::read_with(&args.out, refuted)?;
        for path in write_fit(&series, &finished.fit, &args.out, &[SeriesFormat::Svg])? {
            note(&format!("wrote {}", path.display()));
        }
    }
    let mut text = summary(plan, &finished.outcomes, finished.now);
    if finished.rows > 0 {
        text.push('\n');
        text.push_str(&series_table::fit_table(&finished.fit));
    }
    answer(&text)?;
    let all_measured = finished.outcomes.iter().all(|e| *e == RecordingOutcome::Measured);
    Ok(match super::fit::status(&finished.fit) {
        Status::Done if all_measured => Status::Done,
        _ => Status::Rejected,
    })
}

/// Each recording with its calibration, and how they are run.
fn tell_plan(plan: &BatchPlan, settings: &BatchSettings) {
    for recording in &plan.recordings {
        let calib = recording
            .calib
            .as_ref()
            .map_or_else(|| "no calibration".to_owned(), |c| c.display().to_string());
        detail(|| {
            format!(
                "{}: {}, group {}, {calib}",
                recording.name,
                recording.video.display(),
                recording.group
            )
        });
    }
    detail(|| {
        let memory = settings
            .memory_bytes
            .map_or_else(|| "any".to_owned(), |bytes| (bytes >> 20).to_string());
        format!(
            "accuracy {}, {} at once, up to {:.0} s and {memory} MB each",
            settings.accuracy.name(),
            settings.jobs,
            settings.time_limit.as_secs_f64()
        )
    });
}

/// How many ended how, and what was not measured with its reason.
fn summary(plan: &BatchPlan, outcomes: &[RecordingOutcome], now: usize) -> String {
    let mut text = String::new();
    let all = outcomes.len();
    if all == 0 {
        return "no recording belongs to it\n".to_owned();
    }
    let count = |word: &str| outcomes.iter().filter(|e| e.word() == word).count();
    let counts: Vec<String> = ["measured", "rejected", "failed"]
        .into_iter()
        .filter(|word| count(word) > 0)
        .map(|word| format!("{} {word}", count(word)))
        .collect();
    let _ = writeln!(
        text,
        "{all} recording{}: {}; {now} of them now",
        if all == 1 { "" } else { "s" },
        counts.join(", "),
    );
    for (recording, outcome) in plan.recordings.iter().zip(outcomes) {
        if let Some(reason) = outcome.reason() {
            let name = on_one_line(&recording.name);
            let _ = writeln!(text, "{} {name}: {}", outcome.word(), on_one_line(reason));
        }
    }
    text
}

/// Tells how the batch goes: a bar with the time left on a terminal, a line a recording elsewhere.
struct Watcher {
    bar: ProgressBar,
    terminal: bool,
    all: usize,
    to_do: usize,
    done: usize,
}

impl Watcher {
    fn new(all: usize) -> Self {
        let bar = progress_bar(None, "{msg} {wide_bar} {elapsed} gone");
        bar.set_message("looking for results that stand");
        Self {
            bar,
            terminal: std::io::stderr().is_terminal(),
            all,
            to_do: 0,
            done: 0,
        }
    }

    /// A line above the bar, or on its own.
    fn line(&self, text: &str) {
        self.bar.suspend(|| say(text));
    }

    /// The same, of what goes well.
    fn note(&self, text: &str) {
        self.bar.suspend(|| note(text));
    }

    fn see(&mut self, progress: &BatchEvent<'_>) {
        match progress {
            BatchEvent::Begin {
                up_to_date,
                to_do_bytes,
                others,
                builds,
            } => {
                self.begin(*up_to_date, to_do_bytes, others);
                if let Some(note) = builds {
                    let text = format!("warning: {}: {}", note.code, note.message);
                    self.line(&on_one_line(&text));
                }
            }
            BatchEvent::Ended {
                recording,
                outcome,
                bytes,
            } => {
                let counted = bytes.map(|bytes| {
                    self.done += 1;
                    self.count(bytes, outcome);
                    self.bar.set_message(format!("{}/{}", self.done, self.to_do));
                    format!("[{}/{}] ", self.done, self.to_do)
                });
                let counted = counted.unwrap_or_default();
                match outcome.reason() {
                    Some(reason) => {
                        self.line(&format!(
                            "{counted}{} {}: {reason}",
                            outcome.word(),
                            recording.name
                        ));
                    }
                    None if !self.terminal || is_verbose() => {
                        self.note(&format!("{counted}measured {}", recording.name))
                    }
                    None => {}
                }
            }
        }
    }

    /// Counts a recording that was measured now, or failed.
    fn count(&self, bytes: u64, outcome: &RecordingOutcome) {
        if matches!(outcome, RecordingOutcome::Failed { .. }) {
            // What fails does so at once, mostly: it tells nothing of the time that the others take.
            self.bar.dec_length(bytes.max(1));
        } else {
            self.bar.inc(bytes.max(1));
            set_style(&self.bar, "{msg} {wide_bar} {elapsed} gone, about {eta} left");
        }
    }

    fn begin(&mut self, up_to_date: usize, to_do_bytes: &[u64], others: &[String]) {
        self.to_do = to_do_bytes.len();
        // Long recordings take longer: the time left goes by their bytes.
        self.bar
            .set_length(to_do_bytes.iter().map(|bytes| (*bytes).max(1)).sum());
        self.bar.set_message(format!("0/{}", self.to_do));
        self.bar.reset_eta();
        self.bar.enable_steady_tick(Duration::from_secs(1));
        if up_to_date > 0 {
            self.note(&format!(
                "{up_to_date} of {} results stand: recording, calibration and settings are those they were measured with",
                self.all
            ));
        }
        if !others.is_empty() {
            const MOST: usize = 5;
            let mut names: Vec<&str> = others.iter().map(String::as_str).take(MOST).collect();
            if others.len() > MOST {
                names.push("...");
            }
            self.line(&format!(
                "warning: other_results: the folder has {} results of recordings that were not given this time ({}): they \
                 are left as they are, and are not in the series. Give them too, or remove their files",
                others.len(),
                names.join(", ")
            ));
        }
    }
}
