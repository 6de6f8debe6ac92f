//! Gives the program the git commit that it is built from, as `TRACK_COMMIT`: 12 hex digits, or `unknown` outside git.
//!
//! Cargo runs this again when one of the files that move with HEAD has changed, and builds the program again only where
//! the commit is then another.

use std::path::{Path, PathBuf};
use std::process::Command;

fn main() {
    // A file that is named here but does not exist would make every build run this again.
    println!("cargo::rerun-if-changed=build.rs");
    let commit = commit();
    if commit.is_some() {
        for path in files_that_move_with_head() {
            println!("cargo::rerun-if-changed={}", path.display());
        }
    }
    println!(
        "cargo::rustc-env=TRACK_COMMIT={}",
        commit.as_deref().unwrap_or("unknown")
    );
}

/// The commit, if this folder is the top of a repository and not merely inside one of something else.
fn commit() -> Option<String> {
    let top = PathBuf::from(git(&["rev-parse", "--show-toplevel"])?);
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    (top.canonicalize().ok()? == here.canonicalize().ok()?).then_some(())?;
    git(&["rev-parse", "--short=12", "HEAD"]).map(|commit| commit.chars().take(12).collect())
}

/// HEAD itself (another branch), its log (a line a commit, also where the branch has only a line in `packed-refs`), and
/// the branch's file where no log is kept.
fn files_that_move_with_head() -> Vec<PathBuf> {
    let branch = git(&["symbolic-ref", "--quiet", "HEAD"]);
    let names = ["HEAD", "logs/HEAD", "packed-refs"];
    names
        .into_iter()
        .chain(branch.as_deref())
        .filter_map(|name| git(&["rev-parse", "--git-path", name]))
        .map(PathBuf::from)
        .filter(|path| path.exists())
        .collect()
}

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git")
        .args(arguments)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}
