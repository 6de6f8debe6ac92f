//! A batch from beginning to end: which results are up to date, which recordings have to be measured, and the series of all
//! bounces, written anew as it grows.

use super::key::ResultKey;
use super::process::{ProcessExit, RecordingProcess};
use super::result_store::{RESULTS, ResultStore, build_in};
use super::series::{self, BounceRows, CalibrationNumbers, RowSource};
use super::shard::{GivenRecordings, Shard, ShardRecord, ShardRecording};
use super::vetting::{self, LeftOut, RefutedRecordings, VettedRecording};
use super::{BatchError, BatchPlan, BatchRecording, BatchSettings, RecordingOutcome, schedule};
use crate::calibration::Calibration;
use crate::error_chain;
use crate::rebound::fit::{self, ColumnSet, Note, Options, Series, SeriesFit, Weights};
use crate::report::batch_page::{self, RecordingEntry, RecordingState};
use crate::report::documents::fit::FitDocument;
use crate::report::{documents, write};
use rayon::prelude::*;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::thread::available_parallelism;

/// What happens, for whoever watches.
#[derive(Debug)]
pub enum BatchEvent<'a> {
    /// It is known what has to be measured.
    Begin {
        /// Results that are up to date.
        up_to_date: usize,
        /// Bytes of each recording that has to be measured.
        to_do_bytes: Vec<u64>,
        /// Names of results in the folder that belong to none of the recordings.
        others: &'a [String],
        /// That results in the folder come from different builds of the program.
        builds: Option<Note>,
    },
    /// A recording has ended.
    Ended {
        /// Which.
        recording: &'a BatchRecording,
        /// How.
        outcome: &'a RecordingOutcome,
        /// Bytes of it; `None` where it was not measured now.
        bytes: Option<u64>,
    },
}

/// A batch that has ended.
#[derive(Debug)]
pub struct BatchSummary {
    /// How each recording of the plan ended, in its order.
    pub outcomes: Vec<RecordingOutcome>,
    /// How many of them were measured now, well or not.
    pub now: usize,
    /// Bounces in the series.
    pub rows: usize,
    /// What to know of the recordings: copies, those that gravity or the ball's size refutes.
    pub notes: Vec<Note>,
    /// The fit of the series; without a group where there is no bounce.
    pub fit: SeriesFit,
    /// The files that were written for all.
    pub files: [PathBuf; 3],
}

/// The files for all recordings, by name.
const SERIES: &str = fit::csv::BATCH_SERIES;
const FIT: &str = "fit.json";
const PAGE: &str = "report.html";

/// The series is put together again when there is so much more of it than the last time: a fit of thousands of rows after
/// each recording would take longer than the recordings.
const PUBLISH_GROWTH: f64 = 1.15;

/// A shard that has ended.
#[derive(Debug)]
pub struct ShardSummary {
    /// Its recordings, by name.
    pub plan: BatchPlan,
    /// How each of them ended.
    pub outcomes: Vec<RecordingOutcome>,
    /// How many of them were measured now, well or not.
    pub now: usize,
    /// The record that it has left for the merge.
    pub record: PathBuf,
}

/// Measures what has to be measured of `plan` and writes everything into `out`.
///
/// # Errors
/// See [`BatchError`]; what was measured until then stands.
pub fn run(
    plan: &BatchPlan,
    settings: &BatchSettings,
    out: &Path,
    watch: &mut dyn FnMut(&BatchEvent<'_>),
) -> Result<BatchSummary, BatchError> {
    let store = ResultStore::open(out)?;
    let mut batch = RunningBatch {
        out,
        plan,
        store: &store,
        refuted: settings.refuted,
        progress: assess_all(plan, &store, settings),
    };
    let work = batch.work();
    batch.report_what_is_known(&work, &plan.recordings, watch)?;
    let mut published = batch.publish()?;
    let mut last = 0_usize;
    batch.measure(&work, settings, watch, &mut |batch, done| {
        if done as f64 >= last as f64 * PUBLISH_GROWTH || done == work.len() {
            published = batch.publish()?;
            last = done;
        }
        Ok(())
    })?;
    Ok(batch.summary(work.len(), published))
}

/// Measures what has to be measured of the recordings of `plan` that belong to `shard`, and leaves a record of them in `out`.
/// Others may measure other shards at the same time.
///
/// # Errors
/// See [`BatchError`]; what was measured until then stands.
pub fn run_shard(
    plan: &BatchPlan,
    shard: Shard,
    settings: &BatchSettings,
    out: &Path,
    watch: &mut dyn FnMut(&BatchEvent<'_>),
) -> Result<ShardSummary, BatchError> {
    let ours = plan
        .recordings
        .iter()
        .filter(|recording| shard.has(&recording.name));
    let part = BatchPlan {
        recordings: ours.cloned().collect(),
    };
    let store = ResultStore::open_for_shard(out, shard)?;
    ShardRecord::remove_of_other_counts(out, shard.count)?;
    let given = GivenRecordings::of(&plan.recordings);
    let waiting = part.recordings.iter().map(ShardRecording::waiting).collect();
    ShardRecord::new(shard, false, given.clone(), waiting).write(out)?;
    let mut batch = RunningBatch {
        out,
        plan: &part,
        store: &store,
        refuted: settings.refuted,
        progress: assess_all(&part, &store, settings),
    };
    let work = batch.work();
    batch.report_what_is_known(&work, &plan.recordings, watch)?;
    batch.measure(&work, settings, watch, &mut |_, _| Ok(()))?;
    let recordings = part.recordings.iter().zip(&batch.progress);
    let recordings = recordings
        .map(|(recording, progress)| progress.record(recording))
        .collect();
    let record = ShardRecord::new(shard, true, given, recordings).write(out)?;
    let outcomes = batch.progress.into_iter().filter_map(RecordingProgress::outcome);
    Ok(ShardSummary {
        outcomes: outcomes.collect(),
        now: work.len(),
        plan: part,
        record,
    })
}

/// Writes the files for all recordings of `plan`, which have ended as `recorded` says; both are by name. Nothing is measured.
/// The recordings of which the result is not there, or not the one that was recorded, are given back.
pub(super) fn publish_recorded(
    plan: &BatchPlan,
    recorded: &[&ShardRecording],
    refuted: RefutedRecordings,
    store: &ResultStore,
    out: &Path,
) -> Result<Result<BatchSummary, Vec<String>>, BatchError> {
    let progress: Vec<Option<RecordingProgress>> = plan
        .recordings
        .par_iter()
        .zip(recorded)
        .map(
            |(recording, recorded)| match (&recorded.failed, &recorded.key, recorded.calibration) {
                (Some(reason), _, _) => Some(RecordingProgress::failed(reason.clone())),
                (None, Some(key), Some(calibration)) => {
                    let result = store.up_to_date(recording, key)?;
                    Some(ended(recording, calibration, Some(key), &result))
                }
                _ => None,
            },
        )
        .collect();
    let missing = plan
        .recordings
        .iter()
        .zip(&progress)
        .filter(|(_, progress)| progress.is_none());
    let missing: Vec<String> = missing.map(|(recording, _)| recording.name.clone()).collect();
    if !missing.is_empty() {
        return Ok(Err(missing));
    }
    let batch = RunningBatch {
        out,
        plan,
        store,
        refuted,
        progress: progress.into_iter().flatten().collect(),
    };
    let published = batch.publish()?;
    Ok(Ok(batch.summary(0, published)))
}

/// What is known of each recording of `plan`.
fn assess_all(plan: &BatchPlan, store: &ResultStore, settings: &BatchSettings) -> Vec<RecordingProgress> {
    let recordings = plan.recordings.par_iter();
    recordings
        .map(|recording| assess(recording, store, settings))
        .collect()
}

/// A recording that has to be measured: its place in the plan, and with what.
type Work = (usize, Arc<MeasurementInputs>);

/// What is known of a recording.
enum RecordingProgress {
    /// It has to be measured.
    ToDo(Arc<MeasurementInputs>),
    /// It has ended, now or before.
    Ended {
        outcome: RecordingOutcome,
        rows: BounceRows,
        /// Codes of its warnings.
        warnings: Vec<String>,
        /// SHA-256 of the recording, as its result has it.
        sha256: Option<String>,
        /// The build that measured it.
        build: Option<String>,
        /// What its result was measured with; `None` without a result.
        measured_with: Option<Box<(ResultKey, CalibrationNumbers)>>,
    },
}

impl RecordingProgress {
    fn failed(reason: String) -> Self {
        Self::Ended {
            outcome: RecordingOutcome::Failed { reason },
            rows: BounceRows::default(),
            warnings: Vec::new(),
            sha256: None,
            build: None,
            measured_with: None,
        }
    }

    /// For the merge.
    fn record(&self, recording: &BatchRecording) -> ShardRecording {
        let waiting = ShardRecording::waiting(recording);
        match self {
            Self::ToDo(_) => waiting,
            Self::Ended {
                outcome,
                measured_with,
                ..
            } => ShardRecording {
                key: measured_with.as_ref().map(|with| with.0.clone()),
                calibration: measured_with.as_ref().map(|with| with.1),
                failed: match outcome {
                    RecordingOutcome::Failed { reason } => Some(reason.clone()),
                    RecordingOutcome::Measured | RecordingOutcome::Rejected { .. } => None,
                },
                ..waiting
            },
        }
    }

    fn outcome(self) -> Option<RecordingOutcome> {
        match self {
            Self::Ended { outcome, .. } => Some(outcome),
            Self::ToDo(_) => None,
        }
    }
}

/// The inputs with which a recording is measured.
#[derive(Debug)]
struct MeasurementInputs {
    calib: PathBuf,
    calibration: CalibrationNumbers,
    /// `None` where the recording cannot be read through.
    key: Option<ResultKey>,
    bytes: u64,
}

/// Whether a recording can be measured, and whether it has to be.
fn assess(recording: &BatchRecording, store: &ResultStore, settings: &BatchSettings) -> RecordingProgress {
    // Paths of the command line were looked for when the plan was made: what is missing now, a manifest names.
    if let Err(error) = recording.video.symlink_metadata()
        && error.kind() == std::io::ErrorKind::NotFound
    {
        return RecordingProgress::failed(format!(
            "there is no recording {}; check its name in the manifest, where paths count from the manifest's own folder",
            recording.video.display()
        ));
    }
    let Some(calib) = &recording.calib else {
        return RecordingProgress::failed(format!(
            "it has no calibration: there is no {} beside it; give one for all with --calib, or one for each in the \
             column calib of a manifest",
            super::plan::calib_beside(&recording.video).display()
        ));
    };
    let read = || -> Result<(Vec<u8>, Calibration), String> {
        if !calib.is_file() {
            return Err(format!(
                "its calibration {} is no file; check the path",
                calib.display()
            ));
        }
        let calibration = Calibration::read(calib).map_err(|e| error_chain(&e))?;
        let bytes = std::fs::read(calib).map_err(|e| format!("cannot read {}: {e}", calib.display()))?;
        Ok((bytes, recording.changes.applied(calibration)))
    };
    let (bytes, calibration) = match read() {
        Ok(read) => read,
        Err(reason) => return RecordingProgress::failed(reason),
    };
    let inputs = MeasurementInputs {
        calib: calib.clone(),
        calibration: (&calibration).into(),
        key: ResultKey::of(recording, &bytes, settings.measuring()),
        bytes: size(&recording.video),
    };
    let up_to_date = inputs.key.as_ref().filter(|_| !settings.again);
    match up_to_date.and_then(|key| store.up_to_date(recording, key)) {
        Some(result) => ended(recording, inputs.calibration, inputs.key.as_ref(), &result),
        None => RecordingProgress::ToDo(Arc::new(inputs)),
    }
}

/// A recording with a result.
fn ended(
    recording: &BatchRecording,
    calibration: CalibrationNumbers,
    key: Option<&ResultKey>,
    result: &Value,
) -> RecordingProgress {
    let page = page_of(recording);
    let source = RowSource {
        recording,
        calibration,
        page: &page,
    };
    RecordingProgress::Ended {
        outcome: if result["status"] == "measured" {
            RecordingOutcome::Measured
        } else {
            RecordingOutcome::Rejected {
                reason: result["reason"].as_str().unwrap_or_default().to_owned(),
            }
        },
        rows: BounceRows::of(result, &source),
        warnings: series::warning_codes(result),
        sha256: result["video"]["sha256"].as_str().map(str::to_owned),
        build: build_in(result),
        measured_with: key.map(|key| Box::new((key.clone(), calibration))),
    }
}

/// A recording's page, from where the report lies.
fn page_of(recording: &BatchRecording) -> String {
    format!("{RESULTS}/{}.report.html", recording.name)
}

/// Bytes of a recording: what its time is estimated by.
fn size(video: &Path) -> u64 {
    if !video.is_dir() {
        return video.metadata().map_or(0, |m| m.len());
    }
    let pictures = crate::frames::pictures_in(video).unwrap_or_default();
    pictures
        .iter()
        .filter_map(|p| Some(p.metadata().ok()?.len()))
        .sum()
}

/// A batch at work.
struct RunningBatch<'a> {
    out: &'a Path,
    plan: &'a BatchPlan,
    store: &'a ResultStore,
    refuted: RefutedRecordings,
    progress: Vec<RecordingProgress>,
}

/// The series as far as it was written.
struct PublishedSeries {
    rows: usize,
    notes: Vec<Note>,
    fit: SeriesFit,
}

impl RunningBatch<'_> {
    /// What has to be measured.
    fn work(&self) -> Vec<Work> {
        let progress = self.progress.iter().enumerate();
        progress
            .filter_map(|(i, progress)| match progress {
                RecordingProgress::ToDo(inputs) => Some((i, Arc::clone(inputs))),
                RecordingProgress::Ended { .. } => None,
            })
            .collect()
    }

    /// Measures `work`; `after` each of them is told how many are done.
    fn measure(
        &mut self,
        work: &[Work],
        settings: &BatchSettings,
        watch: &mut dyn FnMut(&BatchEvent<'_>),
        after: &mut dyn FnMut(&Self, usize) -> Result<(), BatchError>,
    ) -> Result<(), BatchError> {
        let program = std::env::current_exe().map_err(BatchError::NoProgram)?;
        let (plan, store) = (self.plan, self.store);
        let cores = available_parallelism().map_or(1, usize::from);
        let threads = (cores / settings.jobs.get().min(work.len().max(1))).max(1);
        let measure = |(i, inputs): &Work, stop: &AtomicBool| {
            let recording = &plan.recordings[*i];
            match store
                .make_work_dir(recording)
                .map(|work_dir| (work_dir, store.lock()))
            {
                Ok((work_dir, Ok(lock))) => RecordingProcess {
                    program: &program,
                    recording,
                    calib: &inputs.calib,
                    work_dir,
                    lock,
                    settings,
                    threads,
                }
                .run(stop),
                Ok((_, Err(e))) => ProcessExit::Failed(format!("its process could not be started: {e}")),
                Err(e) => ProcessExit::Failed(error_chain(&e)),
            }
        };
        let mut done = 0_usize;
        schedule::run(work, settings.jobs, measure, |(i, inputs), exit| {
            self.end(*i, inputs, exit)?;
            done += 1;
            self.report(*i, Some(inputs.bytes), watch);
            after(self, done)
        })
    }

    /// After the series was written for the last time.
    fn summary(self, now: usize, published: PublishedSeries) -> BatchSummary {
        let PublishedSeries { rows, notes, fit } = published;
        BatchSummary {
            now,
            rows,
            notes,
            fit,
            files: self.files(),
            outcomes: self
                .progress
                .into_iter()
                .filter_map(RecordingProgress::outcome)
                .collect(),
        }
    }

    /// `given`: all recordings, also those of other shards.
    fn report_what_is_known(
        &self,
        work: &[Work],
        given: &[BatchRecording],
        watch: &mut dyn FnMut(&BatchEvent<'_>),
    ) -> Result<(), BatchError> {
        let others = self.store.others(given);
        let up_to_date = self.progress.iter().filter(|progress| {
            matches!(
                progress,
                RecordingProgress::Ended {
                    outcome: RecordingOutcome::Measured | RecordingOutcome::Rejected { .. },
                    ..
                }
            )
        });
        watch(&BatchEvent::Begin {
            up_to_date: up_to_date.count(),
            to_do_bytes: work.iter().map(|(_, inputs)| inputs.bytes).collect(),
            others: &others,
            builds: self.builds(&others),
        });
        for (i, progress) in self.progress.iter().enumerate() {
            let RecordingProgress::Ended { outcome, .. } = progress else {
                continue;
            };
            if matches!(outcome, RecordingOutcome::Failed { .. }) {
                self.store.discard(&self.plan.recordings[i])?;
            }
            if *outcome != RecordingOutcome::Measured {
                self.report(i, None, watch);
            }
        }
        Ok(())
    }

    /// That results in the folder come from different builds, before any is measured again.
    fn builds(&self, others: &[String]) -> Option<Note> {
        let ours = self.plan.recordings.iter().map(|recording| &recording.name);
        let builds: Vec<(&str, String)> = ours
            .chain(others)
            .filter_map(|name| Some((name.as_str(), self.store.build(name)?)))
            .collect();
        vetting::several_builds(builds.iter().map(|(name, build)| (*name, build.as_str())))
    }

    fn report(&self, i: usize, bytes: Option<u64>, watch: &mut dyn FnMut(&BatchEvent<'_>)) {
        if let RecordingProgress::Ended { outcome, .. } = &self.progress[i] {
            watch(&BatchEvent::Ended {
                recording: &self.plan.recordings[i],
                outcome,
                bytes,
            });
        }
    }

    /// Takes over what a process has made.
    fn end(&mut self, i: usize, inputs: &MeasurementInputs, exit: ProcessExit) -> Result<(), BatchError> {
        let recording = &self.plan.recordings[i];
        let failed = match (exit, &inputs.key) {
            (ProcessExit::Done, Some(key)) if self.store.is_complete(recording) => {
                self.store.store(recording, key)?;
                match self.store.result(recording) {
                    Ok(result) => {
                        self.progress[i] = ended(recording, inputs.calibration, Some(key), &result);
                        self.store.clear_work_dir(recording)?;
                        return Ok(());
                    }
                    Err(e) => format!("its result cannot be read back: {e}"),
                }
            }
            (ProcessExit::Done, Some(_)) => "its process ended without its results".to_owned(),
            (ProcessExit::Done, None) => "it changed, or cannot be read through".to_owned(),
            (ProcessExit::Failed(reason), _) => reason,
            (ProcessExit::Stopped, _) => "the batch was stopped".to_owned(),
        };
        // What may lie there is of another input, calibration or setting.
        self.store.discard(recording)?;
        self.store.clear_work_dir(recording)?;
        self.progress[i] = RecordingProgress::failed(failed);
        Ok(())
    }

    fn files(&self) -> [PathBuf; 3] {
        [SERIES, FIT, PAGE].map(|name| self.out.join(name))
    }

    /// Writes the series as far as it is known, its fit and the page of all.
    fn publish(&self) -> Result<PublishedSeries, BatchError> {
        let recordings = || self.plan.recordings.iter().zip(&self.progress);
        let vetted: Vec<VettedRecording<'_>> = recordings().map(vetted).collect();
        let vetting = vetting::vet(&vetted, self.refuted);
        let rows = self.progress.iter().zip(&vetting.left_out);
        let rows = rows.filter_map(|(progress, left_out)| match progress {
            RecordingProgress::Ended { rows, .. } => Some((rows, left_out.as_ref())),
            RecordingProgress::ToDo(_) => None,
        });
        let count = rows.clone().map(|(rows, _)| rows.len()).sum();
        let table = series::table(rows)?;
        let (series, fitted) = if count == 0 {
            nothing()
        } else {
            let series = fit::csv::parse(&table, SERIES)?;
            let fitted = fit::fit(&series, &Options::default());
            (series, fitted)
        };
        let entries: Vec<RecordingEntry<'_>> = recordings()
            .zip(&vetting.left_out)
            .map(|(recording, left_out)| entry(recording, left_out.as_ref()))
            .collect();
        let page = batch_page::report_html(&entries, &vetting.notes, &series, &fitted)?;
        let [series_csv, fit_json, report_html] = self.files();
        let json =
            documents::json_text(&FitDocument::new(&fitted)).map_err(|e| write::WriteError::Contents {
                path: fit_json.clone(),
                source: Box::new(e),
            })?;
        write::write_together(&[
            (&series_csv, table.as_slice()),
            (&fit_json, json.as_slice()),
            (&report_html, page.as_bytes()),
        ])?;
        Ok(PublishedSeries {
            rows: count,
            notes: vetting.notes,
            fit: fitted,
        })
    }
}

/// The series of no bounce at all.
fn nothing() -> (Series, SeriesFit) {
    let mut series = Series::of_set(SERIES, ColumnSet::Velocities, Vec::new(), Vec::new());
    series.notes.clear();
    let fitted = SeriesFit {
        name: SERIES.to_owned(),
        set: ColumnSet::Velocities,
        weights: Weights::Stated,
        groups: Vec::new(),
        notes: Vec::new(),
    };
    (series, fitted)
}

/// What tells whether a recording can be trusted.
fn vetted<'a>((recording, progress): (&'a BatchRecording, &'a RecordingProgress)) -> VettedRecording<'a> {
    let of_name = VettedRecording {
        name: &recording.name,
        ..VettedRecording::default()
    };
    match progress {
        RecordingProgress::ToDo(_) => of_name,
        RecordingProgress::Ended {
            rows,
            warnings,
            sha256,
            build,
            ..
        } => VettedRecording {
            sha256: sha256.as_deref(),
            warnings,
            build: build.as_deref(),
            bounces: rows.len(),
            ..of_name
        },
    }
}

fn entry<'a>(
    (recording, progress): (&'a BatchRecording, &'a RecordingProgress),
    left_out: Option<&'a LeftOut>,
) -> RecordingEntry<'a> {
    let (state, bounces, warnings): (_, _, &[String]) = match progress {
        RecordingProgress::ToDo(_) => (RecordingState::Waiting, 0, &[]),
        RecordingProgress::Ended {
            outcome,
            rows,
            warnings,
            ..
        } => {
            let state = match outcome {
                RecordingOutcome::Measured => RecordingState::Measured,
                RecordingOutcome::Rejected { reason } => RecordingState::Rejected(reason),
                RecordingOutcome::Failed { reason } => RecordingState::Failed(reason),
            };
            (state, rows.len(), warnings)
        }
    };
    RecordingEntry {
        name: &recording.name,
        group: &recording.group,
        page: page_of(recording),
        state,
        bounces,
        left_out: left_out.map(LeftOut::reason),
        warnings,
    }
}
