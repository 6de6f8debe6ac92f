//! The command line: a file a command; the only place that prints or draws progress.

mod batch;
mod calibrate;
mod cost;
mod fit;
mod interrupt;
mod measure;
mod messages;
mod points;
mod review;
mod shell;
mod simulate;

use crate::error_chain;
use clap::{Parser, Subcommand};
use messages::{Loudness, answer, detail, note, say};
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::LazyLock;

/// Measures a bouncing ball in a lab video: impacts, angles, restitution, friction, spin, distances, and what two
/// rebound models make of them.
#[derive(Debug, Parser)]
#[command(
    name = "track",
    version = version(),
    about,
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    arg_required_else_help = true
)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    measure: Option<measure::MeasureArgs>,
    #[command(flatten)]
    loudness: Loudness,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Measures many recordings, each in a process of its own, and fits the series of their bounces.
    Batch(batch::BatchArgs),
    /// One recording of a batch: `batch` starts the program with this.
    #[command(name = crate::batch::process::COMMAND, hide = true)]
    BatchRecording(batch::RecordingArgs),
    /// Makes, shows or checks a calibration (calib.json): from a chessboard, a ruler, or marks on a page.
    Calibrate(Box<calibrate::CalibrateArgs>),
    /// Prints what a shell needs to complete commands and options (bash, zsh, fish, elvish, powershell).
    Completions(shell::CompletionsArgs),
    /// Shows what accuracy costs: error against time on scenes with known truth, and the cheapest setting that is exact enough.
    Cost(cost::CostArgs),
    /// Fits a series of bounces with the four rebound models: e, μ, e_x, where sliding begins, and which model it is.
    Fit(fit::FitArgs),
    /// Writes manual pages: track.1 and one for each command.
    Man(shell::ManArgs),
    /// Measures centres that another program found (Tracker, trackpy, Kinovea, a script).
    Points(points::PointsArgs),
    /// Makes a page to look a recording through: choose the ball, reject or move points; it saves <name>.edits.json.
    Review(review::ReviewArgs),
    /// Renders a recording with known truth from a scene file.
    Simulate(simulate::SimulateArgs),
}

/// What `--version` says behind the name.
fn version() -> &'static str {
    static TEXT: LazyLock<String> = LazyLock::new(|| crate::Build::THIS.to_string());
    &TEXT
}

/// How a command ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Status {
    /// Everything was done.
    Done,
    /// It ran, but a measurement was rejected.
    Rejected,
}

/// Runs the command line of this process.
///
/// Exit status: 0 measured; 1 it ran, but the measurement was rejected; 2 it could not run.
#[must_use]
pub fn run() -> ExitCode {
    let arguments = command_first(std::env::args_os().collect());
    let cli = match Cli::try_parse_from(&arguments) {
        Ok(cli) => cli,
        Err(error) => {
            if error.use_stderr()
                && let Some(words) = shell::mistyped_command(&arguments)
            {
                say(&format!("error: {words}"));
                return ExitCode::from(2);
            }
            error.exit()
        }
    };
    messages::set_loudness(cli.loudness);
    detail(|| format!("track {}", crate::Build::THIS));
    let outcome = match (cli.command, cli.measure) {
        (Some(Command::Batch(args)), _) => batch::run(&args),
        (Some(Command::BatchRecording(args)), _) => batch::run_recording(&args),
        (Some(Command::Fit(args)), _) => fit::run(&args),
        (Some(Command::Points(args)), _) => points::run(&args),
        (Some(Command::Review(args)), _) => review::run(&args),
        (Some(Command::Simulate(args)), _) => simulate::run(&args, &mut answer),
        (Some(Command::Calibrate(args)), _) => calibrate::run(&args),
        (Some(Command::Completions(args)), _) => shell::completions(&args),
        (Some(Command::Man(args)), _) => shell::man(&args),
        (Some(Command::Cost(args)), _) => cost::run(&args),
        (None, Some(args)) => measure::run(&args),
        (None, None) => Err(anyhow::anyhow!("no recording given; see track --help")),
    };
    match outcome {
        Ok(Status::Done) => ExitCode::SUCCESS,
        Ok(Status::Rejected) => ExitCode::from(1),
        Err(error) => {
            say(&format!("error: {}", error_chain(error.as_ref())));
            ExitCode::from(2)
        }
    }
}

/// The arguments with `--quiet` and `--verbose` behind the command: clap takes options before a command for those of `track VIDEO`.
fn command_first(mut arguments: Vec<OsString>) -> Vec<OsString> {
    let is_flag = |a: &OsString| Loudness::FLAGS.iter().any(|flag| a == flag);
    let flags = arguments.iter().skip(1).take_while(|a| is_flag(a)).count();
    let next = arguments.get(1 + flags);
    if next.is_some_and(|word| !word.as_encoded_bytes().starts_with(b"-")) {
        arguments[1..=1 + flags].rotate_right(1);
    }
    arguments
}

/// Refuses where files that somebody else made would be replaced.
fn refuse_foreign(files: &[PathBuf]) -> anyhow::Result<()> {
    if files.is_empty() {
        return Ok(());
    }
    let names: Vec<String> = files.iter().map(|path| path.display().to_string()).collect();
    let them = if names.len() == 1 { "it" } else { "them" };
    anyhow::bail!(
        "{} would be replaced, but track did not make {them}, or somebody has changed {them} since; give another name, or --force to \
         replace {them}",
        names.join(", ")
    )
}
