//! As many processes at once as were asked for.

use super::process::ProcessExit;
use std::num::NonZeroUsize;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;

/// Runs `measure` on each of `work`, `jobs` at once, and hands each ending to `ended` on this thread, in the order in which
/// they come. The first error of `ended` stops the rest, which `measure` learns from its flag.
pub fn run<T: Sync, E>(
    work: &[T],
    jobs: NonZeroUsize,
    measure: impl Fn(&T, &AtomicBool) -> ProcessExit + Sync,
    mut ended: impl FnMut(&T, ProcessExit) -> Result<(), E>,
) -> Result<(), E> {
    let stop = AtomicBool::new(false);
    let next = Mutex::new(work.iter());
    let (sender, receiver) = mpsc::channel();
    std::thread::scope(|scope| {
        for _ in 0..jobs.get().min(work.len()) {
            let sender = sender.clone();
            let (stop, next, measure) = (&stop, &next, &measure);
            // A process ends with the thread that started it, so a thread stays until its process has ended.
            scope.spawn(move || {
                let take = || next.lock().ok().and_then(|mut left| left.next());
                while let Some(item) = take().filter(|_| !stop.load(Ordering::Relaxed)) {
                    let exit = measure(item, stop);
                    if sender.send((item, exit)).is_err() {
                        break;
                    }
                }
            });
        }
        drop(sender);
        let mut outcome = Ok(());
        for (item, exit) in receiver {
            if outcome.is_ok() {
                outcome = ended(item, exit);
                stop.store(outcome.is_err(), Ordering::Relaxed);
            }
        }
        outcome
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicUsize;

    #[test]
    fn every_item_is_done_once_and_no_more_than_so_many_at_once() {
        let work: Vec<usize> = (0..50).collect();
        let (now, most) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let mut done = Vec::new();
        let outcome: Result<(), ()> = run(
            &work,
            NonZeroUsize::new(3).unwrap(),
            |_, _| {
                most.fetch_max(now.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
                std::thread::yield_now();
                now.fetch_sub(1, Ordering::SeqCst);
                ProcessExit::Done
            },
            |i, _| {
                done.push(*i);
                Ok(())
            },
        );
        assert_eq!(outcome, Ok(()));
        done.sort_unstable();
        assert_eq!(done, work);
        assert!(most.load(Ordering::SeqCst) <= 3);
    }

    #[test]
    fn an_error_stops_what_runs_and_what_waits() {
        let work: Vec<usize> = (0..1000).collect();
        let begun = AtomicUsize::new(0);
        let outcome = run(
            &work,
            NonZeroUsize::new(2).unwrap(),
            |i, stop| {
                begun.fetch_add(1, Ordering::SeqCst);
                while *i > 0 && !stop.load(Ordering::Relaxed) {
                    std::thread::yield_now();
                }
                ProcessExit::Stopped
            },
            |i, _| if *i == 0 { Err("full") } else { Ok(()) },
        );
        assert_eq!(outcome, Err("full"));
        assert!(begun.load(Ordering::SeqCst) <= 4);
    }
}
