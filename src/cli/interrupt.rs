//! Ctrl-C, and being told to end: what stands under a temporary name goes, then the process ends as it would have by itself.

use crate::frames::temporary;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use signal_hook::low_level::emulate_default_handler;
use std::path::Path;

/// From now on, takes this process's temporary files in `folder` along when it is told to end.
///
/// Where the signals cannot be had, such files stay behind, as after a kill.
pub fn clear_when_told_to_end(folder: &Path) {
    let folder = folder.to_owned();
    let heard: Vec<i32> = [SIGINT, SIGTERM]
        .into_iter()
        .filter(|s| !is_ignored(*s))
        .collect();
    let Ok(mut signals) = Signals::new(&heard) else {
        return;
    };
    std::thread::spawn(move || {
        if let Some(signal) = signals.forever().next() {
            temporary::clear_own(&folder);
            // Whoever started this process sees that a signal ended it.
            let _ = emulate_default_handler(signal);
        }
    });
}

/// Whether the process was started so that a signal does nothing (`nohup`, a shell's background): that stays so.
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|text| u64::from_str_radix(text.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}
