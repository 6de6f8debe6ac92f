//! What a shell and its manual need to know of the command line: `track completions SHELL`, `track man DIR`, and the word for a mistyped
//! command.

use super::{Cli, Status, answer, say};
use crate::config::{Closeness, nearest};
use crate::report::write::write_atomically;
use anyhow::Context;
use clap::{Args, CommandFactory};
use clap_complete::Shell;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// For which shell.
#[derive(Debug, Args)]
pub struct CompletionsArgs {
    /// The shell that is to complete commands and options.
    #[arg(value_enum)]
    pub shell: Shell,
}

/// Prints what the shell reads.
///
/// # Errors
/// Where stdout cannot be written.
pub fn completions(args: &CompletionsArgs) -> anyhow::Result<Status> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "track", &mut text);
    answer(&String::from_utf8_lossy(&text))?;
    Ok(Status::Done)
}

/// Where to.
#[derive(Debug, Args)]
pub struct ManArgs {
    /// The folder for track.1, track-batch.1 and so on; it is made where there is none.
    #[arg(value_name = "DIR")]
    pub dir: PathBuf,
}

/// Writes a manual page for each command.
///
/// # Errors
/// Where the folder cannot be written.
pub fn man(args: &ManArgs) -> anyhow::Result<Status> {
    let dir = &args.dir;
    std::fs::create_dir_all(dir).with_context(|| format!("{} could not be made", dir.display()))?;
    let mut command = Cli::command();
    command.build();
    let pages = pages(&command)?;
    for (name, text) in &pages {
        write_atomically(&dir.join(name), text)?;
    }
    let first = dir.join("track.1");
    say(&format!(
        "{} manual pages in {}: man {}",
        pages.len(),
        dir.display(),
        first.display()
    ));
    Ok(Status::Done)
}

/// File name and text of the pages of a command and of those below it.
fn pages(command: &clap::Command) -> anyhow::Result<Vec<(String, Vec<u8>)>> {
    let name = command.get_display_name().unwrap_or_else(|| command.get_name());
    let mut text = Vec::new();
    clap_mangen::Man::new(command.clone()).render(&mut text)?;
    let mut all = vec![(format!("{name}.1"), text)];
    for below in shown(command) {
        all.extend(pages(below)?);
    }
    Ok(all)
}

/// The commands below a command that a person calls.
fn shown(command: &clap::Command) -> impl Iterator<Item = &clap::Command> {
    command
        .get_subcommands()
        .filter(|c| !c.is_hide_set() && c.get_name() != "help")
}

/// The command that the first argument may have been meant to be, where it is no recording that exists.
pub fn mistyped_command(arguments: &[OsString]) -> Option<String> {
    let word = arguments.get(1)?.to_str()?;
    if word.starts_with('-') || word.contains(['.', '/', '\\']) || Path::new(word).exists() {
        return None;
    }
    let command = Cli::command();
    if command.find_subcommand(word).is_some() || word == "help" {
        return None;
    }
    let known: Vec<&str> = shown(&command).map(clap::Command::get_name).collect();
    let meant = match nearest(word, known.iter().copied(), Closeness::Guess) {
        Some(meant) => format!("did you mean {meant}?"),
        None => format!("commands: {}", known.join(", ")),
    };
    Some(format!(
        "there is no command {word:?}, and no recording of that name; {meant}"
    ))
}
