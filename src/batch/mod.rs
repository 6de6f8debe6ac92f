//! Many recordings, unattended: what to measure, each in a process of its own, what stands already, the series of all.
//!
//! | file | what it does |
//! |---|---|
//! | [`plan`] | from paths and a manifest to the list of recordings, each with its name and calibration |
//! | [`manifest`] | the table of recordings that a user writes |
//! | `names` | what recordings are called |
//! | `key` | what a result depends on, so that only what has changed is measured again |
//! | `result_store` | the folder of results: which of them are up to date, and storing new ones |
//! | [`process`] | a recording in a process of its own: limits, time, why it ended |
//! | `schedule` | as many processes at once as were asked for |
//! | [`series`] | the table of all bounces |
//! | [`vetting`] | copies, and recordings that gravity or the ball's size refutes, are no part of the fit |
//! | [`shard`] | the part of a batch that one machine measures, and the record that it leaves |
//! | [`session`] | the order of the steps |
//! | [`merge`] | the series of all shards |
//!
//! Whatever is written depends on the recordings, their calibrations and the settings alone: not on the time, on the number of
//! processes or on which of them ends first. So a run that is killed and started again leaves the same bytes as one that
//! was not.
//!
//! The clock is read in [`process`] only, for the time limit.

mod key;
pub mod manifest;
pub mod merge;
mod names;
pub mod plan;
pub mod process;
mod result_store;
mod schedule;
pub mod series;
pub mod session;
pub mod shard;
pub mod vetting;

pub use plan::{BatchPlan, BatchRequest, PlanError};
pub use session::{BatchEvent, BatchSummary, ShardSummary, run, run_shard};
pub use shard::Shard;
pub use vetting::RefutedRecordings;

use crate::calibration::Calibration;
use crate::detect::centre::Accuracy;
use crate::pipeline::{MeasureSettings, SpinSearch};
use crate::report::page::PageError;
use crate::report::write::WriteError;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Duration;

/// A recording of a batch.
#[derive(Debug, Clone, PartialEq)]
pub struct BatchRecording {
    /// What its results are called; no other recording of the batch has the same.
    pub name: String,
    /// The file, or folder of numbered images.
    pub video: PathBuf,
    /// Its calibration; `None` where there is none.
    pub calib: Option<PathBuf>,
    /// What a person said of it: `<stem>.edits.json` beside it, where there is one.
    pub edits: Option<PathBuf>,
    /// Which rows of the series it belongs to.
    pub group: String,
    /// What the manifest puts in place of the calibration's.
    pub changes: CalibrationChanges,
}

/// What a manifest puts in place of the calibration's.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CalibrationChanges {
    /// `launch.spin_ratio`.
    pub spin: LaunchSpin,
    /// `frame_rate_hz`, Hz.
    pub frame_rate_hz: Option<f64>,
    /// `ball.radius_m`, m.
    pub ball_radius_m: Option<f64>,
}

/// R ω_oy / u_o at the launch.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum LaunchSpin {
    /// What the calibration says.
    #[default]
    AsCalibrated,
    /// This much.
    Ratio(f64),
    /// Nobody knows.
    Unknown,
}

impl CalibrationChanges {
    /// The calibration with the changes in it.
    #[must_use]
    pub fn applied(&self, mut calibration: Calibration) -> Calibration {
        match self.spin {
            LaunchSpin::AsCalibrated => {}
            LaunchSpin::Ratio(ratio) => calibration.launch.spin_ratio = Some(ratio),
            LaunchSpin::Unknown => calibration.launch.spin_ratio = None,
        }
        if self.frame_rate_hz.is_some() {
            calibration.frame_rate_hz = self.frame_rate_hz;
        }
        if self.ball_radius_m.is_some() {
            calibration.ball.radius_m = self.ball_radius_m;
            // That was of the other radius.
            calibration.ball.radius_std_m = None;
        }
        calibration
    }
}

/// How a batch is run. Only accuracy and spin have a part in the results, and what becomes of refuted ones in the fit.
#[derive(Debug, Clone, Copy)]
pub struct BatchSettings {
    /// How centres are found.
    pub accuracy: Accuracy,
    /// Whether the ball's marks are asked for its spin.
    pub spin: SpinSearch,
    /// Processes at once.
    pub jobs: NonZeroUsize,
    /// Longest time for a recording.
    pub time_limit: Duration,
    /// Most memory for a recording, bytes; `None` leaves it to the system.
    pub memory_bytes: Option<u64>,
    /// Whether results that stand are measured again.
    pub again: bool,
    /// What becomes of recordings that gravity or the ball's size refutes.
    pub refuted: RefutedRecordings,
}

impl BatchSettings {
    /// What of them a result depends on.
    #[must_use]
    pub const fn measuring(&self) -> MeasureSettings {
        MeasureSettings {
            accuracy: self.accuracy,
            spin: self.spin,
        }
    }
}

/// How a recording ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum RecordingOutcome {
    /// It has bounces.
    Measured,
    /// It was read, but shows nothing to trust. The result stands.
    Rejected {
        /// Why, and what to try.
        reason: String,
    },
    /// It could not be read, or its process broke off. There is no result, and the next run tries again.
    Failed {
        /// Why, and what to try.
        reason: String,
    },
}

impl RecordingOutcome {
    /// In a word.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::Rejected { .. } => "rejected",
            Self::Failed { .. } => "failed",
        }
    }

    /// Why it is not measured.
    #[must_use]
    pub fn reason(&self) -> Option<&str> {
        match self {
            Self::Measured => None,
            Self::Rejected { reason } | Self::Failed { reason } => Some(reason),
        }
    }
}

/// What stops a whole batch.
#[derive(Debug, thiserror::Error)]
pub enum BatchError {
    /// A result cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// Another batch is writing into the folder.
    #[error(
        "{}: another track batch is writing into this folder; wait until it has ended, or give another folder with --out",
        out.display()
    )]
    InUse {
        /// The folder.
        out: PathBuf,
    },
    /// The same shard is running.
    #[error(
        "{}: shard {shard} is being measured in this folder by another process; wait until it has ended, or stop it",
        out.display()
    )]
    ShardInUse {
        /// The folder.
        out: PathBuf,
        /// Which.
        shard: Shard,
    },
    /// Shards of another division are running.
    #[error(
        "{}: shard {other} is being measured in this folder, and shares recordings with shard {shard}; all shards that run at \
         the same time need the same N: give --shard I/{}, or wait until the others have ended",
        out.display(), other.count
    )]
    OtherShards {
        /// The folder.
        out: PathBuf,
        /// Which was to be measured.
        shard: Shard,
        /// Which is.
        other: Shard,
    },
    /// A record that no shard has written.
    #[error(
        "cannot read {}: not the record of a shard of this version of track ({found}); run that shard again, or remove the file",
        path.display()
    )]
    BadShardRecord {
        /// The record.
        path: PathBuf,
        /// What is wrong with it.
        found: String,
    },
    /// Not everything that is to be merged is there.
    #[error("{}: cannot merge, nothing was written:\n{}", out.display(), missing.join("\n"))]
    ShardsMissing {
        /// The folder.
        out: PathBuf,
        /// What is missing, and what to do, a line each.
        missing: Vec<String>,
    },
    /// The series of our own making cannot be read back.
    #[error("the series of the batch cannot be fitted (a fault of track, please report it)")]
    Series(#[from] crate::rebound::fit::FitError),
    /// The page cannot be made.
    #[error("the page of the batch cannot be made (a fault of track, please report it)")]
    Page(#[from] PageError),
    /// The table cannot be made.
    #[error("the series of the batch cannot be put together (a fault of track, please report it)")]
    Table(#[from] ::csv::Error),
    /// The program cannot find itself, so it cannot start the process of a recording.
    #[error("track cannot start itself for the single recordings; start it by its full path")]
    NoProgram(#[source] std::io::Error),
}
