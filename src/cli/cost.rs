//! `track cost [--out DIR] [--quick] [--want NAME=VALUE] [--check N] [--json]`: what accuracy costs in time.

use super::messages::progress_bar;
use super::{Status, answer, detail, note, say};
use crate::cost::recommendation::{Requirement, default_requirements};
use crate::cost::recordings::{self, Check};
use crate::cost::{self, CostPlan, CostProgress, CostReport, Stopwatch};
use crate::report::documents::cost::CostDocument;
use crate::report::documents::json_text;
use crate::report::formats::cost::write_cost;
use crate::report::{cost_table, write};
use clap::Args;
use std::path::PathBuf;
use std::time::Instant;

/// What to run, and where to put it.
#[derive(Debug, Args)]
pub struct CostArgs {
    /// Write cost.html, cost.svg, cost.json and cost.csv into this folder.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// A coarse version in half a minute; the full one takes about ten minutes on two cores.
    #[arg(long)]
    pub quick: bool,
    /// Name the cheapest measured setting with which 95 % of the recordings are this exact, e.g. restitution=0.002. May be
    /// given several times: restitution, friction, incident_angle_deg, rebound_angle_deg, x0_m, x_m.
    #[arg(long, value_name = "NAME=VALUE", allow_hyphen_values = true)]
    pub want: Vec<Requirement>,
    /// Run that setting again on so many new recordings, and say how many of them are so exact.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=10_000))]
    pub check: Option<u64>,
    /// Print cost.json in place of the tables.
    #[arg(long)]
    pub json: bool,
}

/// Runs and reports.
///
/// # Errors
///
/// Whatever keeps recordings from being rendered and measured, or the results from being written.
pub fn run(args: &CostArgs) -> anyhow::Result<Status> {
    // Kept to the end: a folder that nothing came into goes again.
    let _folders = args.out.as_deref().map(write::check_output_dir).transpose()?;
    let plan = if args.quick {
        CostPlan::quick()
    } else {
        CostPlan::full()
    };
    let requirements = if args.want.is_empty() {
        default_requirements()
    } else {
        args.want.clone()
    };
    let start = Instant::now();
    let clock = || start.elapsed().as_secs_f64();
    // Of 1000: the bar's own unit.
    let bar = progress_bar(Some(1000), "{msg:27} {wide_bar} {percent} % {elapsed} {eta} left");
    let mut what = "";
    let mut show = |step: CostProgress| {
        if step.what != what {
            what = step.what;
            bar.suspend(|| detail(|| what.to_owned()));
        }
        bar.set_message(step.what);
        bar.set_position((1000.0 * step.done) as u64);
    };
    let report = cost::run(&plan, &requirements, &clock, &mut show)?;
    let check = checked(args, &report, &mut Stopwatch::new(1.0, &clock, &mut show))?;
    bar.finish_and_clear();
    if let Some(dir) = &args.out {
        for path in write_cost(&report, check.as_ref(), dir)? {
            note(&format!("wrote {}", path.display()));
        }
    }
    if args.json {
        let document = CostDocument::new(&report, check.as_ref());
        answer(&String::from_utf8_lossy(&json_text(&document)?))?;
    } else {
        answer(&cost_table::cost_table(&report, check.as_ref()))?;
    }
    if report.recommendation.chosen.is_some() {
        return Ok(Status::Done);
    }
    say("rejected: no setting that was measured reaches the wanted error; the last lines say what is best");
    Ok(Status::Rejected)
}

/// The recommended setting on new recordings, where that is asked for and there is one.
fn checked(
    args: &CostArgs,
    report: &CostReport,
    stopwatch: &mut Stopwatch<'_>,
) -> anyhow::Result<Option<Check>> {
    let chosen = report.recommendation.chosen;
    let setting = chosen.and_then(|i| report.whole_settings.get(i));
    match (args.check, setting) {
        (Some(count), Some(setting)) => Ok(Some(recordings::check(
            setting,
            &report.recommendation.requirements,
            count,
            stopwatch,
        )?)),
        _ => Ok(None),
    }
}
