//! What the program says on stderr, and the result on stdout.
//!
//! | what | by default | `--quiet` | `--verbose` |
//! |---|---|---|---|
//! | errors, warnings, why a recording was rejected ([`say`]) | yes | yes | yes |
//! | progress, files that were written, what stands ([`note`], [`progress_bar`]) | yes | no | yes |
//! | what is read and with which settings, each step with its time ([`detail`]) | no | no | yes |
//!
//! Colours are clap's: on a terminal that knows them, and off where NO_COLOR is set.

use anstyle::{AnsiColor, Style};
use anyhow::anyhow;
use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::fmt::Write as _;
use std::io::Write as _;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::Instant;

/// How much is said.
#[derive(Debug, Clone, Copy, Default, Args)]
pub struct Loudness {
    /// Say nothing but the result, warnings and errors: no progress, no names of files.
    #[arg(long, short, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Say also what is read, with which settings, and how long each step takes.
    #[arg(long, short, global = true)]
    pub verbose: bool,
}

impl Loudness {
    /// As they are written.
    pub const FLAGS: [&'static str; 4] = ["-q", "--quiet", "-v", "--verbose"];
}

/// As [`set_loudness`] was told: 0 quiet, 1 usual, 2 verbose.
static LOUDNESS: AtomicU8 = AtomicU8::new(1);
static BEGUN: OnceLock<Instant> = OnceLock::new();

/// From now on, says so much.
pub fn set_loudness(loudness: Loudness) {
    let level = if loudness.quiet {
        0
    } else {
        1 + u8::from(loudness.verbose)
    };
    LOUDNESS.store(level, Ordering::Relaxed);
    BEGUN.get_or_init(Instant::now);
}

/// Whether everything is said.
pub fn is_verbose() -> bool {
    LOUDNESS.load(Ordering::Relaxed) > 1
}

fn is_quiet() -> bool {
    LOUDNESS.load(Ordering::Relaxed) == 0
}

/// An error, a warning or a rejection: a line on stderr. A closed stderr is no reason to fail.
pub fn say(line: &str) {
    let _ = writeln!(anstream::stderr().lock(), "{}", coloured(&one_line(line)));
}

/// A line on stderr that --quiet leaves out.
pub fn note(line: &str) {
    if !is_quiet() {
        say(line);
    }
}

/// A line on stderr that --verbose asks for, with the time since the program began.
pub fn detail(line: impl FnOnce() -> String) {
    if is_verbose() {
        let gone_s = BEGUN.get_or_init(Instant::now).elapsed().as_secs_f64();
        say(&format!("{gone_s:8.2} s  {}", line()));
    }
}

/// The result on stdout, whole or an error. A reader that closed the pipe has what it wanted.
pub fn answer(text: &str) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(anyhow!(e).context("the result could not be written to stdout"))
        }
        _ => Ok(()),
    }
}

/// A bar on a terminal; nothing elsewhere and with --quiet. Without a `length` it is set later.
pub fn progress_bar(length: Option<u64>, template: &str) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(
        length,
        if is_quiet() {
            ProgressDrawTarget::hidden()
        } else {
            ProgressDrawTarget::stderr()
        },
    );
    set_style(&bar, template);
    bar
}

/// What a bar looks like.
pub fn set_style(bar: &ProgressBar, template: &str) {
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
}

/// The first word in the colour that clap gives it.
fn coloured(line: &str) -> String {
    let bold = |colour: AnsiColor| colour.on_default().bold();
    let styles: [(&str, Style); 3] = [
        ("error:", bold(AnsiColor::Red)),
        ("rejected:", bold(AnsiColor::Red)),
        ("warning:", bold(AnsiColor::Yellow)),
    ];
    for (word, style) in styles {
        if let Some(rest) = line.strip_prefix(word) {
            return format!("{style}{word}{style:#}{rest}");
        }
    }
    line.to_owned()
}

/// `text` without what would move the cursor: a name of a file may hold line feeds and escape sequences, and a message is told apart by
/// its line. They are shown as `\n`, `\u{1b}` and so on. Lists within a message stay as they are: their lines begin with two spaces, which
/// no other message does.
fn one_line(text: &str) -> String {
    let mut line = String::with_capacity(text.len());
    for (at, c) in text.char_indices() {
        if c.is_control() && !text[at..].starts_with("\n  ") {
            // Writing into a String cannot fail.
            let _ = write!(line, "{}", c.escape_default());
        } else {
            line.push(c);
        }
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_is_one_line_whatever_a_name_holds() {
        assert_eq!(one_line("2 problems\n  one\n  two"), "2 problems\n  one\n  two");
        assert_eq!(
            one_line("cannot read a\nb\u{1b}[2J\tµ.mp4"),
            "cannot read a\\nb\\u{1b}[2J\\tµ.mp4"
        );
    }

    #[test]
    fn the_first_word_has_its_colour() {
        assert_eq!(coloured("warning: x"), "\u{1b}[1m\u{1b}[33mwarning:\u{1b}[0m x");
        assert_eq!(coloured("an error: x"), "an error: x");
    }
}
