//! Parse, run, exit status.

use std::process::ExitCode;

fn main() -> ExitCode {
    track::frames::give_back_pictures();
    track::cli::run()
}
