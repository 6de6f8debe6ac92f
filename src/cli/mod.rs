//! The command line: a file a command; the only place that prints or draws progress.

mod batch;
mod calibrate;
mod cost;
mod fit;
mod measure;
mod points;
mod shell;
mod simulate;

use crate::error_chain;
use crate::simulate::EffectsChoice;
use crate::simulate::scene::Switch;
use clap::{Parser, Subcommand, ValueEnum};
use std::ffi::OsString;
use std::io::Write;
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
    /// Fits a series of bounces with the three rebound models: e, μ, e_x, where sliding begins, and which model it is.
    Fit(fit::FitArgs),
    /// Writes manual pages: track.1 and one for each command.
    Man(shell::ManArgs),
    /// Measures centres that another program found (Tracker, trackpy, Kinovea, a script).
    Points(points::PointsArgs),
    /// Renders a recording with known truth from a scene file.
    Simulate {
        /// The scene (JSON, schema track.scene/1).
        scene: PathBuf,
        /// Folder for <name>.mp4 (or .mkv), .truth.json and .calib.json.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
        /// Which effects to simulate, in place of the scene's own choice.
        #[arg(long, value_enum)]
        effects: Option<Effects>,
        /// Print each effect with its estimate, the tolerance, and whether it is simulated.
        #[arg(long)]
        explain: bool,
    },
}

/// Which effects a scene is rendered with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Effects {
    /// Those that move a centre by more than the scene's tolerance.
    Auto,
    /// Every one.
    All,
    /// None beyond the parabola, the rigid impact and the disc.
    None,
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
    let arguments: Vec<OsString> = std::env::args_os().collect();
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
    let outcome = match (cli.command, cli.measure) {
        (Some(Command::Batch(args)), _) => batch::run(&args),
        (Some(Command::BatchRecording(args)), _) => batch::run_recording(&args),
        (Some(Command::Fit(args)), _) => fit::run(&args),
        (Some(Command::Points(args)), _) => points::run(&args),
        (
            Some(Command::Simulate {
                scene,
                out,
                effects,
                explain,
            }),
            _,
        ) => {
            let choice = effects.map(|e| {
                EffectsChoice::all(match e {
                    Effects::Auto => Switch::Auto,
                    Effects::All => Switch::On,
                    Effects::None => Switch::Off,
                })
            });
            simulate::run(&scene, &out, choice, explain, &mut answer).map(|()| Status::Done)
        }
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

/// A line on stderr. A closed stderr is no reason to fail.
fn say(line: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}

/// The result on stdout, whole or an error. A reader that closed the pipe has what it wanted.
fn answer(text: &str) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(anyhow::Error::new(e).context("the result could not be written to stdout"))
        }
        _ => Ok(()),
    }
}
