//! `track calibrate check CALIB [VIDEO]`: exit status 0 fine, 1 problems, 2 it could not be read.

use super::{Status, answer};
use crate::calibration::check::check;
use crate::calibration::{Finding, Severity};
use clap::Args;
use std::fmt::Write as _;
use std::path::PathBuf;

/// Which calibration, against which recording.
#[derive(Debug, Args)]
pub(super) struct CheckArgs {
    /// The calibration.
    calib: PathBuf,
    /// The recording it is for.
    video: Option<PathBuf>,
}

pub(super) fn run(args: &CheckArgs) -> anyhow::Result<Status> {
    let recording = args.video.as_deref().map(super::facts).transpose()?;
    let findings = check(&args.calib, recording.as_ref())?;
    answer(&text(args, &findings))?;
    let grave = findings.iter().any(|f| f.severity == Severity::Problem);
    Ok(if grave { Status::Rejected } else { Status::Done })
}

fn text(args: &CheckArgs, findings: &[Finding]) -> String {
    let count = |severity: Severity| findings.iter().filter(|f| f.severity == severity).count();
    let counted = |n: usize, what: &str| match n {
        0 => format!("no {what}s"),
        1 => format!("1 {what}"),
        n => format!("{n} {what}s"),
    };
    let against = args
        .video
        .as_ref()
        .map_or(String::new(), |v| format!(" with {}", v.display()));
    let mut text = format!(
        "{}{against}: {}, {}\n",
        args.calib.display(),
        counted(count(Severity::Problem), "problem"),
        counted(count(Severity::Remark), "remark")
    );
    for finding in findings {
        // Writing into a String cannot fail.
        let _ = writeln!(text, "{finding}");
    }
    text
}
