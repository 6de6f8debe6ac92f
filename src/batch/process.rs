//! A recording in a process of its own: this program once more, with the command of a single recording.
//!
//! A codec that crashes, a decoder that hangs, a file that asks for more memory than there is: each costs its own process and
//! one recording. The process
//!
//! * works in a folder of its own, from which only whole sets of files are taken;
//! * gets no more memory than its limit ([`bind`], by `RLIMIT_DATA`), and its share of the cores;
//! * is killed after the time limit;
//! * ends with ours, however that ends: the system kills it when the thread that started it is gone
//!   (`PR_SET_PDEATHSIG`, Linux), and a batch that follows waits for it (`super::result_store`).

use super::{BatchRecording, BatchSettings, CalibrationChanges, LaunchSpin};
use std::ffi::OsString;
use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::os::unix::process::ExitStatusExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use wait_timeout::ChildExt as _;

/// The command by which the program is started for a single recording of a batch.
pub const COMMAND: &str = "batch-recording";

/// How often a process is looked at while it runs: this long the whole takes to stop when it has to.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// Where a process writes its errors, in its folder.
const ERRORS: &str = "errors.txt";

/// A recording, ready to be measured.
#[derive(Debug)]
pub struct RecordingProcess<'a> {
    /// The program.
    pub program: &'a Path,
    /// What is measured.
    pub recording: &'a BatchRecording,
    /// Its calibration.
    pub calib: &'a Path,
    /// The process's own folder, empty.
    pub work_dir: PathBuf,
    /// Held by the process as long as it lives.
    pub lock: File,
    /// Limits, and how centres are found.
    pub settings: &'a BatchSettings,
    /// Threads it may use.
    pub threads: usize,
}

/// How a process ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ProcessExit {
    /// It says that its result is written.
    Done,
    /// It did not come to a result, and why.
    Failed(String),
    /// It was stopped because the batch was.
    Stopped,
}

impl RecordingProcess<'_> {
    /// Runs the process to its end, or to that of its time, or until `stop`.
    pub fn run(self, stop: &AtomicBool) -> ProcessExit {
        let errors = self.work_dir.join(ERRORS);
        let limit = self.settings.time_limit;
        let memory_bytes = self.settings.memory_bytes;
        let child = match self.start(&errors) {
            Ok(child) => child,
            Err(e) => return ProcessExit::Failed(format!("its process could not be started: {e}")),
        };
        match wait(child, limit, stop) {
            Ok(WaitOutcome::Ended(status)) => match status.code() {
                Some(0 | 1) => ProcessExit::Done,
                _ => ProcessExit::Failed(why(status, &tail(&errors), memory_bytes)),
            },
            Ok(WaitOutcome::TooLong) => ProcessExit::Failed(format!(
                "it was not done after {} s and was stopped; if it is only long, give it more with --timeout-s",
                limit.as_secs_f64()
            )),
            Ok(WaitOutcome::Stopped) => ProcessExit::Stopped,
            Err(e) => ProcessExit::Failed(format!("its process was lost: {e}")),
        }
    }

    fn start(self, errors: &Path) -> io::Result<Child> {
        let threads = self.threads.to_string();
        Command::new(self.program)
            .args(self.arguments())
            .env("RAYON_NUM_THREADS", &threads)
            .env("OPENCV_FOR_THREADS_NUM", &threads)
            // A trace of calls needs memory: where that was what ran out, std waits for its own lock for ever.
            .env("RUST_BACKTRACE", "0")
            .stdin(Stdio::from(self.lock))
            .stdout(Stdio::null())
            .stderr(Stdio::from(File::create(errors)?))
            .spawn()
    }

    /// What `cli` reads: `batch-recording --out DESK ... -- VIDEO`.
    fn arguments(&self) -> Vec<OsString> {
        let CalibrationChanges {
            spin,
            frame_rate_hz,
            ball_radius_m,
        } = self.recording.changes;
        let mut arguments: Vec<OsString> = vec![COMMAND.into()];
        let mut give = |name: &str, value: OsString| {
            let mut argument = OsString::from(name);
            argument.push("=");
            argument.push(value);
            arguments.push(argument);
        };
        give("--parent", std::process::id().to_string().into());
        give("--out", self.work_dir.clone().into());
        give("--name", self.recording.name.clone().into());
        give("--calib", self.calib.into());
        if let Some(edits) = &self.recording.edits {
            give("--edits", edits.into());
        }
        give("--accuracy", self.settings.accuracy.name().into());
        give("--spin", self.settings.spin.name().into());
        match spin {
            LaunchSpin::AsCalibrated => {}
            LaunchSpin::Ratio(ratio) => give("--spin-ratio", ratio.to_string().into()),
            LaunchSpin::Unknown => give("--spin-ratio", "unknown".into()),
        }
        for (name, number) in [
            ("--frame-rate-hz", frame_rate_hz),
            ("--ball-radius-m", ball_radius_m),
        ] {
            if let Some(number) = number {
                give(name, number.to_string().into());
            }
        }
        if let Some(bytes) = self.settings.memory_bytes {
            give("--memory-bytes", bytes.to_string().into());
        }
        arguments.push("--".into());
        arguments.push(self.recording.video.clone().into());
        arguments
    }
}

enum WaitOutcome {
    Ended(ExitStatus),
    TooLong,
    Stopped,
}

fn wait(mut child: Child, limit: Duration, stop: &AtomicBool) -> io::Result<WaitOutcome> {
    let started = Instant::now();
    loop {
        let left = limit.saturating_sub(started.elapsed());
        if let Some(status) = child.wait_timeout(left.min(LOOK_EVERY))? {
            return Ok(WaitOutcome::Ended(status));
        }
        let ending = if stop.load(Ordering::Relaxed) {
            WaitOutcome::Stopped
        } else if left.is_zero() {
            WaitOutcome::TooLong
        } else {
            continue;
        };
        child.kill()?;
        child.wait()?;
        return Ok(ending);
    }
}

/// What the process said last.
fn tail(path: &Path) -> String {
    const MOST_BYTES: u64 = 4096;
    let read = || -> io::Result<String> {
        let mut file = File::open(path)?;
        let length = file.metadata()?.len();
        file.seek(SeekFrom::Start(length.saturating_sub(MOST_BYTES)))?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    };
    read().unwrap_or_default()
}

/// What Rust, FFmpeg, OpenCV and the system say when memory (or a thread's share of it) is refused.
const STARVED: [&str; 5] = [
    "memory allocation of",
    "Cannot allocate memory",
    "Resource temporarily unavailable",
    "Insufficient memory",
    "bad_alloc",
];

/// Why a process ended without a result, from how it ended and what it said.
fn why(status: ExitStatus, said: &str, memory_bytes: Option<u64>) -> String {
    let limit = memory_bytes.map_or(String::new(), |bytes| {
        format!(" (its limit is {} MB: --memory-mb)", bytes >> 20)
    });
    let starved = STARVED.iter().any(|words| said.contains(words));
    if let Some(at) = said.rfind("error: ").filter(|_| status.code() == Some(2)) {
        let message = one_line(&said[at + "error: ".len()..]);
        return if starved {
            format!("{message}. It seems to have run out of memory{limit}")
        } else {
            message
        };
    }
    if starved {
        let lines = said.lines().map(str::trim);
        let line = lines
            .rev()
            .find(|line| STARVED.iter().any(|words| line.contains(words)));
        return format!(
            "it ran out of memory{limit}: {}",
            one_line(line.unwrap_or_default())
        );
    }
    let ending = match (status.signal(), status.code()) {
        (Some(9), _) => {
            format!("its process was killed (signal 9), as the system does when memory runs out{limit}")
        }
        (Some(signal), _) => format!("its process crashed ({})", signal_name(signal)),
        (None, Some(101)) => "its process broke off (a fault of track, please report it)".to_owned(),
        (None, code) => format!("its process ended with status {}", code.unwrap_or(-1)),
    };
    // A panic names its thread by a number that is never the same.
    let last = match said.find("panicked at ") {
        Some(at) => one_line(&said[at..]),
        None => one_line(
            said.lines()
                .rfind(|line| !line.trim().is_empty())
                .unwrap_or_default(),
        ),
    };
    if last.is_empty() {
        ending
    } else {
        format!("{ending}; it said: {last}")
    }
}

/// The first lines as one, cut where they are long.
fn one_line(text: &str) -> String {
    const MOST_CHARACTERS: usize = 600;
    let words: Vec<&str> = text.split_whitespace().collect();
    let whole = words.join(" ");
    if whole.chars().count() <= MOST_CHARACTERS {
        whole
    } else {
        whole.chars().take(MOST_CHARACTERS).chain("...".chars()).collect()
    }
}

fn signal_name(signal: i32) -> String {
    let name = match signal {
        4 => "SIGILL, an instruction that this machine does not know",
        6 => "SIGABRT, it gave up",
        7 => "SIGBUS, a file that shrank while it was read, or bad memory",
        8 => "SIGFPE, an impossible division",
        11 => "SIGSEGV, memory that is not its own: a fault of a codec or of track",
        15 => "SIGTERM, asked to end",
        24 => "SIGXCPU, the system's limit of computing time",
        25 => "SIGXFSZ, the system's limit of file sizes",
        _ => return format!("signal {signal}"),
    };
    format!("signal {signal}, {name}")
}

/// Binds this process, the one of a single recording: it ends with its batch, the process `parent`, and gets no more than
/// `memory_bytes`.
///
/// # Errors
/// The batch is gone already, or the system refuses a limit.
pub fn bind(parent: u32, memory_bytes: Option<u64>) -> io::Result<()> {
    #[cfg(target_os = "linux")]
    {
        use rustix::process::{Resource, Rlimit, Signal, set_parent_process_death_signal, setrlimit};
        set_parent_process_death_signal(Some(Signal::KILL))?;
        // It may have gone before that was asked for.
        if std::os::unix::process::parent_id() != parent {
            return Err(io::Error::other("the batch that started this has ended"));
        }
        if let Some(bytes) = memory_bytes {
            let limit = Rlimit {
                current: Some(bytes),
                maximum: Some(bytes),
            };
            // Not the address space: that is mostly reserved, never used.
            setrlimit(Resource::Data, limit)?;
        }
    }
    #[cfg(not(target_os = "linux"))]
    let _ = (parent, memory_bytes);
    Ok(())
}

/// Memory of this machine, bytes, where the system tells.
#[must_use]
pub fn machine_memory_bytes() -> Option<u64> {
    #[cfg(target_os = "linux")]
    {
        let info = rustix::system::sysinfo();
        let total = u64::from(info.mem_unit).checked_mul(info.totalram as u64)?;
        Some(total).filter(|bytes| *bytes > 0)
    }
    #[cfg(not(target_os = "linux"))]
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ended(code: i32) -> ExitStatus {
        ExitStatus::from_raw(code << 8)
    }

    #[test]
    fn an_error_of_the_program_is_told_in_its_own_words() {
        let said = "warning: x\nerror: cannot read a.mp4: the file is empty (0 bytes);\n copy it again\n";
        assert_eq!(
            why(ended(2), said, None),
            "cannot read a.mp4: the file is empty (0 bytes); copy it again"
        );
    }

    #[test]
    fn a_crash_a_panic_and_a_lack_of_memory_are_told_apart() {
        let crash = why(ExitStatus::from_raw(11), "[h264] bad\n\n", None);
        assert!(crash.contains("crashed (signal 11, SIGSEGV"), "{crash}");
        assert!(crash.ends_with("it said: [h264] bad"), "{crash}");
        let panic = why(
            ended(101),
            "\nthread 'main' (4711) panicked at src/a.rs:1:2:\nindex out\n",
            None,
        );
        assert!(
            !panic.contains("4711") && panic.contains("panicked at src/a.rs:1:2: index out"),
            "{panic}"
        );
        let memory = why(
            ExitStatus::from_raw(6),
            "memory allocation of 1000 bytes failed\n",
            Some(512 << 20),
        );
        assert!(
            memory.contains("out of memory") && memory.contains("512 MB"),
            "{memory}"
        );
        let killed = why(ExitStatus::from_raw(9), "", Some(1 << 30));
        assert!(
            killed.contains("memory runs out") && killed.contains("1024 MB"),
            "{killed}"
        );
        assert_eq!(why(ended(3), "", None), "its process ended with status 3");
        assert!(one_line(&"x".repeat(700)).ends_with("x..."));
    }

    #[test]
    fn a_process_that_takes_too_long_or_has_to_stop_is_killed() {
        let sleeper = || Command::new("sleep").arg("60").spawn().unwrap();
        let (never, at_once) = (AtomicBool::new(false), AtomicBool::new(true));
        let wait_for = |child, limit, stop| wait(child, Duration::from_millis(limit), stop).unwrap();
        assert!(matches!(wait_for(sleeper(), 50, &never), WaitOutcome::TooLong));
        assert!(matches!(
            wait_for(sleeper(), 60_000, &at_once),
            WaitOutcome::Stopped
        ));
        let quick = Command::new("true").spawn().unwrap();
        assert!(matches!(wait_for(quick, 60_000, &never), WaitOutcome::Ended(status) if status.success()));
    }
}
