//! Runs inputs, and names those that fail.

use super::dice::Dice;
use serde_json::Value;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// No input of some kilobytes may take longer: a hang, for a user who waits. Far above what the slowest takes.
const LONGEST: Duration = Duration::from_secs(60);

/// Inputs that fail before the rest is left.
const ENOUGH: usize = 10;

/// The input that runs now: since when, the file it would be kept in, and itself.
type Running = Arc<Mutex<Option<(Instant, PathBuf, Vec<u8>)>>>;

fn variable(name: &str) -> Option<u64> {
    std::env::var(name).ok().and_then(|text| text.parse().ok())
}

fn kept(kind: &str, number: usize) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("fuzz");
    std::fs::create_dir_all(&folder).unwrap();
    folder.join(format!("{number}.{kind}"))
}

/// Makes `usual` inputs (or TRACK_FUZZ), and checks each; `check` tells whether it was accepted.
pub fn fuzz(
    kind: &str,
    usual: usize,
    mut make: impl FnMut(&mut Dice) -> Vec<u8>,
    mut check: impl FnMut(&[u8]) -> bool,
) {
    let times = variable("TRACK_FUZZ").map_or(usual, |n| usize::try_from(n).unwrap());
    let first = variable("TRACK_FUZZ_SEED").unwrap_or(0);
    let running: Running = Arc::default();
    watch(&running);
    let (mut accepted, mut failed, mut slowest) = (0, Vec::new(), (Duration::ZERO, 0));
    for i in 0..times {
        let mut dice = Dice::new(first.wrapping_add(i as u64));
        let input = make(&mut dice);
        let start = Instant::now();
        *running.lock().unwrap() = Some((start, kept(kind, i), input.clone()));
        let outcome = catch_unwind(AssertUnwindSafe(|| check(&input)));
        running.lock().unwrap().take();
        slowest = slowest.max((start.elapsed(), i));
        match outcome {
            Ok(taken) => accepted += usize::from(taken),
            Err(_) => {
                let path = kept(kind, i);
                std::fs::write(&path, &input).unwrap();
                println!("failed on {}", path.display());
                failed.push(path);
                if failed.len() >= ENOUGH {
                    break;
                }
            }
        }
    }
    println!(
        "{kind}: {times} inputs from seed {first}, {accepted} accepted, slowest {:?}: number {}",
        slowest.0, slowest.1
    );
    assert!(failed.is_empty(), "{kind}: {failed:?}");
    // Mutations that leave nothing valid test the reader's first line only.
    assert!(
        times < 100 || accepted * 50 >= times,
        "{kind}: only {accepted} of {times} accepted"
    );
}

/// Ends the process when an input takes too long, after it was named.
fn watch(running: &Running) {
    let running = Arc::downgrade(running);
    std::thread::spawn(move || {
        while let Some(running) = running.upgrade() {
            if let Some((start, path, input)) = running.lock().unwrap().as_ref()
                && start.elapsed() > LONGEST
            {
                let _ = std::fs::write(path, input);
                eprintln!("no end after {LONGEST:?}: {}", path.display());
                std::process::exit(101);
            }
            drop(running);
            std::thread::sleep(Duration::from_millis(200));
        }
    });
}

/// That the document comes back as it is when it is printed and read, and that no `value` stands without a number: serde_json
/// writes what is not finite as null.
pub fn sound_json(value: &Value) {
    let again: Value = serde_json::from_str(&value.to_string()).expect("it does not reparse");
    assert_eq!(&again, value, "it does not come back");
    quantities(value);
}

fn quantities(value: &Value) {
    match value {
        Value::Object(map) => {
            if let (Some(number), Some(std)) = (map.get("value"), map.get("std_uncertainty")) {
                assert!(number.is_number(), "a quantity without a number: {value}");
                assert!(std.is_null() || std.as_f64().is_some_and(|s| s > 0.0), "{value}");
            }
            map.values().for_each(quantities);
        }
        Value::Array(all) => all.iter().for_each(quantities),
        Value::Number(number) => assert!(number.as_f64().is_some_and(f64::is_finite), "{number}"),
        _ => {}
    }
}
