//! A batch from beginning to end: what stands, what has to be measured, and after each recording what there is of the series.

use super::key::Key;
use super::process::{Exit, Job};
use super::series::{self, Rows, Source};
use super::shelf::{RESULTS, Shelf};
use super::{BatchError, Ending, Plan, Recording, Settings, schedule};
use crate::calibration::Calibration;
use crate::rebound::fit::{self, ColumnSet, Options, Series, SeriesFit, Weights};
use crate::report::batch_page::{self, RecordingEntry, RecordingState};
use crate::report::{series_json, write};
use rayon::prelude::*;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::thread::available_parallelism;

/// What happens, for whoever watches.
#[derive(Debug)]
pub enum Progress<'a> {
    /// It is known what has to be measured.
    Begin {
        /// Results that stand.
        standing: usize,
        /// Bytes of each recording that has to be measured.
        to_do_bytes: Vec<u64>,
        /// Names of results in the folder that belong to none of the recordings.
        others: &'a [String],
    },
    /// A recording has ended.
    Ended {
        /// Which.
        recording: &'a Recording,
        /// How.
        ending: &'a Ending,
        /// Bytes of it; `None` where it was not measured now.
        bytes: Option<u64>,
    },
}

/// A batch that has ended.
#[derive(Debug)]
pub struct Finished {
    /// How each recording of the plan ended, in its order.
    pub endings: Vec<Ending>,
    /// How many of them were measured now, well or not.
    pub now: usize,
    /// Bounces in the series.
    pub rows: usize,
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

/// Measures what has to be measured of `plan` and writes everything into `out`.
///
/// # Errors
/// See [`BatchError`]; what was measured until then stands.
pub fn run(
    plan: &Plan,
    settings: &Settings,
    out: &Path,
    watch: &mut dyn FnMut(&Progress<'_>),
) -> Result<Finished, BatchError> {
    let program = std::env::current_exe().map_err(BatchError::NoProgram)?;
    let shelf = Shelf::open(out)?;
    let places: Vec<Place> = plan
        .recordings
        .par_iter()
        .map(|r| look(r, &shelf, settings))
        .collect();
    let work: Vec<(usize, Arc<Ready>)> = places
        .iter()
        .enumerate()
        .filter_map(|(i, place)| match place {
            Place::ToDo(ready) => Some((i, Arc::clone(ready))),
            Place::Ended { .. } => None,
        })
        .collect();
    let mut batch = Batch {
        out,
        plan,
        shelf: &shelf,
        places,
    };
    batch.tell_what_is_known(&work, watch)?;
    let mut published = batch.publish()?;
    let cores = available_parallelism().map_or(1, usize::from);
    let threads = (cores / settings.jobs.get().min(work.len().max(1))).max(1);
    let measure = |(i, ready): &(usize, Arc<Ready>), stop: &AtomicBool| {
        let recording = &plan.recordings[*i];
        match shelf.make_desk(recording).map(|desk| (desk, shelf.hold())) {
            Ok((desk, Ok(hold))) => Job {
                program: &program,
                recording,
                calib: &ready.calib,
                desk,
                hold,
                settings,
                threads,
            }
            .run(stop),
            Ok((_, Err(e))) => Exit::Failed(format!("its process could not be started: {e}")),
            Err(e) => Exit::Failed(chain(&e)),
        }
    };
    let (mut done, mut last) = (0_usize, 0_usize);
    schedule::run(&work, settings.jobs, measure, |(i, ready), exit| {
        batch.end(*i, ready, exit)?;
        done += 1;
        batch.tell(*i, Some(ready.bytes), watch);
        if done as f64 >= last as f64 * PUBLISH_GROWTH || done == work.len() {
            published = batch.publish()?;
            last = done;
        }
        Ok::<(), BatchError>(())
    })?;
    let (rows, fit) = published;
    Ok(Finished {
        now: done,
        rows,
        fit,
        files: batch.files(),
        endings: batch.places.into_iter().filter_map(Place::ending).collect(),
    })
}

/// What is known of a recording.
enum Place {
    /// It has to be measured.
    ToDo(Arc<Ready>),
    /// It has ended, now or before.
    Ended {
        ending: Ending,
        rows: Rows,
        /// Codes of its warnings.
        warnings: Vec<String>,
    },
}

impl Place {
    fn failed(reason: String) -> Self {
        Self::Ended {
            ending: Ending::Failed { reason },
            rows: Rows::default(),
            warnings: Vec::new(),
        }
    }

    fn ending(self) -> Option<Ending> {
        match self {
            Self::Ended { ending, .. } => Some(ending),
            Self::ToDo(_) => None,
        }
    }
}

/// What a recording is measured with.
#[derive(Debug)]
struct Ready {
    calib: PathBuf,
    calibration: Calibration,
    /// `None` where the recording cannot be read through.
    key: Option<Key>,
    bytes: u64,
}

/// Whether a recording can be measured, and whether it has to be.
fn look(recording: &Recording, shelf: &Shelf, settings: &Settings) -> Place {
    let Some(calib) = &recording.calib else {
        return Place::failed(format!(
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
        let calibration = Calibration::read(calib).map_err(|e| chain(&e))?;
        let bytes = std::fs::read(calib).map_err(|e| format!("cannot read {}: {e}", calib.display()))?;
        Ok((bytes, recording.changes.applied(calibration)))
    };
    let (bytes, calibration) = match read() {
        Ok(read) => read,
        Err(reason) => return Place::failed(reason),
    };
    let ready = Ready {
        calib: calib.clone(),
        calibration,
        key: Key::of(recording, &bytes, settings.accuracy),
        bytes: size(&recording.video),
    };
    let standing = ready.key.as_ref().filter(|_| !settings.again);
    match standing.and_then(|key| shelf.standing(recording, key)) {
        Some(result) => ended(recording, &ready.calibration, &result),
        None => Place::ToDo(Arc::new(ready)),
    }
}

/// A recording with a result.
fn ended(recording: &Recording, calibration: &Calibration, result: &Value) -> Place {
    let page = page_of(recording);
    let source = Source {
        recording,
        calibration,
        page: &page,
    };
    let codes = result["warnings"].as_array().into_iter().flatten();
    Place::Ended {
        ending: if result["status"] == "measured" {
            Ending::Measured
        } else {
            Ending::Rejected {
                reason: result["reason"].as_str().unwrap_or_default().to_owned(),
            }
        },
        rows: Rows::of(result, &source),
        warnings: codes
            .filter_map(|w| Some(w["code"].as_str()?.to_owned()))
            .collect(),
    }
}

/// A recording's page, from where the report lies.
fn page_of(recording: &Recording) -> String {
    format!("{RESULTS}/{}.report.html", recording.name)
}

/// An error with its causes, each said once.
fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let more = error.to_string();
        if !text.contains(&more) {
            text = format!("{text}: {more}");
        }
        cause = error.source();
    }
    text
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
struct Batch<'a> {
    out: &'a Path,
    plan: &'a Plan,
    shelf: &'a Shelf,
    places: Vec<Place>,
}

impl Batch<'_> {
    fn tell_what_is_known(
        &self,
        work: &[(usize, Arc<Ready>)],
        watch: &mut dyn FnMut(&Progress<'_>),
    ) -> Result<(), BatchError> {
        let others = self.shelf.others(&self.plan.recordings);
        let standing = self.places.iter().filter(|place| {
            matches!(
                place,
                Place::Ended {
                    ending: Ending::Measured | Ending::Rejected { .. },
                    ..
                }
            )
        });
        watch(&Progress::Begin {
            standing: standing.count(),
            to_do_bytes: work.iter().map(|(_, ready)| ready.bytes).collect(),
            others: &others,
        });
        for (i, place) in self.places.iter().enumerate() {
            let Place::Ended { ending, .. } = place else {
                continue;
            };
            if matches!(ending, Ending::Failed { .. }) {
                self.shelf.discard(&self.plan.recordings[i])?;
            }
            if *ending != Ending::Measured {
                self.tell(i, None, watch);
            }
        }
        Ok(())
    }

    fn tell(&self, i: usize, bytes: Option<u64>, watch: &mut dyn FnMut(&Progress<'_>)) {
        if let Place::Ended { ending, .. } = &self.places[i] {
            watch(&Progress::Ended {
                recording: &self.plan.recordings[i],
                ending,
                bytes,
            });
        }
    }

    /// Takes over what a process has made.
    fn end(&mut self, i: usize, ready: &Ready, exit: Exit) -> Result<(), BatchError> {
        let recording = &self.plan.recordings[i];
        let failed = match (exit, &ready.key) {
            (Exit::Done, Some(key)) if self.shelf.is_whole(recording) => {
                self.shelf.take(recording, key)?;
                match self.shelf.result(recording) {
                    Ok(result) => {
                        self.places[i] = ended(recording, &ready.calibration, &result);
                        self.shelf.clear_desk(recording)?;
                        return Ok(());
                    }
                    Err(e) => format!("its result cannot be read back: {e}"),
                }
            }
            (Exit::Done, Some(_)) => "its process ended without its results".to_owned(),
            (Exit::Done, None) => "it changed, or cannot be read through".to_owned(),
            (Exit::Failed(reason), _) => reason,
            (Exit::Stopped, _) => "the batch was stopped".to_owned(),
        };
        // What may lie there is of another input, calibration or setting.
        self.shelf.discard(recording)?;
        self.shelf.clear_desk(recording)?;
        self.places[i] = Place::failed(failed);
        Ok(())
    }

    fn files(&self) -> [PathBuf; 3] {
        [SERIES, FIT, PAGE].map(|name| self.out.join(name))
    }

    /// Writes the series as far as it is known, its fit and the page of all. How many rows, and the fit.
    fn publish(&self) -> Result<(usize, SeriesFit), BatchError> {
        let rows = self.places.iter().filter_map(|place| match place {
            Place::Ended { rows, .. } => Some(rows),
            Place::ToDo(_) => None,
        });
        let count = rows.clone().map(Rows::len).sum();
        let table = series::table(rows)?;
        let (series, fitted) = if count == 0 {
            nothing()
        } else {
            let series = fit::csv::parse(&table, SERIES)?;
            let fitted = fit::fit(&series, &Options::default());
            (series, fitted)
        };
        let entries: Vec<RecordingEntry<'_>> =
            self.plan.recordings.iter().zip(&self.places).map(entry).collect();
        let page = batch_page::report_html(&entries, &series, &fitted)?;
        let [series_csv, fit_json, report_html] = self.files();
        let json =
            write::json_text(&series_json::fit_json(&fitted)).map_err(|e| write::WriteError::Contents {
                path: fit_json.clone(),
                source: Box::new(e),
            })?;
        write::write_together(&[
            (&series_csv, table.as_slice()),
            (&fit_json, json.as_slice()),
            (&report_html, page.as_bytes()),
        ])?;
        Ok((count, fitted))
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

fn entry<'a>((recording, place): (&'a Recording, &'a Place)) -> RecordingEntry<'a> {
    let (state, bounces, warnings): (_, _, &[String]) = match place {
        Place::ToDo(_) => (RecordingState::Waiting, 0, &[]),
        Place::Ended {
            ending,
            rows,
            warnings,
        } => {
            let state = match ending {
                Ending::Measured => RecordingState::Measured,
                Ending::Rejected { reason } => RecordingState::Rejected(reason),
                Ending::Failed { reason } => RecordingState::Failed(reason),
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
        warnings,
    }
}
