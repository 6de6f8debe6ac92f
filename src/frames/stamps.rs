//! From a file's stamps to times: the first frame is 0, every frame is later than the one before.
//!
//! A stamp that is missing or does not increase is replaced by an even spacing between its neighbours, which needs a
//! short wait for the next good one. Matroska stores times to 1 ms only, half a frame at 500 Hz: where the header
//! declares a constant rate and a stamp agrees with it to its last digit, the time is that of the rate. Where frames
//! come so fast that several places of that rate agree with a stamp, or several frames have the same one, the next place
//! counts.

use std::collections::VecDeque;

/// Frames that may wait for a good stamp before times are guessed by going on as before.
const MAX_WAITING: usize = 8;

/// Slack, in ticks, for a stamp on the declared grid: the first stamp and this one are each rounded by half a tick
/// (or cut by one, in the same direction).
const GRID_SLACK_TICKS: f64 = 1.01;

/// Only ticks at least this long are worth mending, s.
const COARSE_TICK_S: f64 = 5e-4;

/// Gives items (frames) their times, in order.
pub(super) struct StampClock<T> {
    tick_s: f64,
    /// Frame spacing to assume before any is seen, s.
    usual_step_s: f64,
    /// Declared rate, where stamps are too coarse for it.
    grid_hz: Option<f64>,
    first_stamp: Option<i64>,
    /// Time of the last item given out or ready.
    last_s: Option<f64>,
    last_step_s: Option<f64>,
    /// Longest step between good stamps, s.
    pub longest_step_s: f64,
    waiting: Vec<T>,
    ready: VecDeque<(f64, T)>,
    /// Stamps that had to be replaced.
    pub repaired: u64,
}

impl<T> StampClock<T> {
    pub(super) fn new(tick_s: f64, nominal_rate_hz: Option<f64>, declared_rate_hz: Option<f64>) -> Self {
        let usual_step_s = nominal_rate_hz.map_or(1.0 / 30.0, |rate| 1.0 / rate);
        Self {
            tick_s,
            usual_step_s,
            grid_hz: declared_rate_hz.filter(|_| tick_s >= COARSE_TICK_S),
            first_stamp: None,
            last_s: None,
            last_step_s: None,
            longest_step_s: usual_step_s,
            waiting: Vec::new(),
            ready: VecDeque::new(),
            repaired: 0,
        }
    }

    /// The next item in presentation order, with its stamp if it has one.
    pub(super) fn push(&mut self, stamp: Option<i64>, item: T) {
        match stamp.map(|s| self.time_of(s)) {
            Some(time) if self.last_s.is_none_or(|last| time > last + self.waiting_margin()) => {
                self.accept(time, item);
            }
            _ => {
                self.waiting.push(item);
                if self.waiting.len() >= MAX_WAITING {
                    self.go_on();
                }
            }
        }
    }

    /// No item follows.
    pub(super) fn end(&mut self) {
        self.go_on();
    }

    /// The next item whose time is settled.
    pub(super) fn pop(&mut self) -> Option<(f64, T)> {
        self.ready.pop_front()
    }

    /// Whether no item has a settled time.
    pub(super) fn is_empty(&self) -> bool {
        self.ready.is_empty()
    }

    /// Time of the last item, s.
    pub(super) fn last_s(&self) -> Option<f64> {
        self.last_s
    }

    /// Time since the first frame, on the declared grid where stamps are coarse.
    fn time_of(&mut self, stamp: i64) -> f64 {
        let first = *self.first_stamp.get_or_insert_with(|| {
            // Frames before the first good stamp come before it.
            let step = self.usual_step_s;
            #[allow(clippy::cast_precision_loss, reason = "8 at most")]
            let waiting = self.waiting.len() as f64 * step;
            let before_s = self.last_s.map_or(waiting, |last| last + step + waiting);
            #[allow(
                clippy::cast_possible_truncation,
                reason = "saturates, and is then no good stamp"
            )]
            let before = (before_s / self.tick_s).round() as i64;
            stamp.saturating_sub(before)
        });
        #[allow(clippy::cast_precision_loss, reason = "exact up to 2^53 ticks")]
        let raw = stamp.saturating_sub(first) as f64 * self.tick_s;
        self.grid_hz
            .and_then(|rate| self.on_grid(raw, rate))
            .unwrap_or(raw)
    }

    /// The time on the grid of `rate` that a stamp of `raw` stands for: the next place if the stamp agrees with it, else
    /// (frames were left out) the nearest.
    fn on_grid(&self, raw: f64, rate: f64) -> Option<f64> {
        #[allow(clippy::cast_precision_loss, reason = "8 at most")]
        let waiting = self.waiting.len() as f64;
        let next = self.last_s.map(|last| (last * rate).round() + 1.0 + waiting);
        next.into_iter()
            .chain([(raw * rate).round()])
            .map(|place| place / rate)
            .find(|time| {
                let agrees = (time - raw).abs() <= GRID_SLACK_TICKS * self.tick_s;
                agrees && self.last_s.is_none_or(|last| *time > last)
            })
    }

    /// Room that waiting frames need between the last time and the next: a nanosecond each.
    fn waiting_margin(&self) -> f64 {
        #[allow(clippy::cast_precision_loss, reason = "8 at most")]
        let waiting = self.waiting.len() as f64;
        waiting * 1e-9
    }

    #[allow(clippy::cast_precision_loss, reason = "few items wait")]
    fn accept(&mut self, time: f64, item: T) {
        let waiting = std::mem::take(&mut self.waiting);
        let gaps = waiting.len() as f64;
        match self.last_s {
            Some(last) => {
                let step = (time - last) / (gaps + 1.0);
                self.last_step_s = Some(step);
                self.longest_step_s = self.longest_step_s.max(step);
                self.replace(waiting, |i| last + step * (i + 1.0));
            }
            None => {
                let step = time / gaps.max(1.0);
                self.replace(waiting, |i| step * i);
            }
        }
        self.last_s = Some(time);
        self.ready.push_back((time, item));
    }

    /// Gives the waiting items times by going on at the last spacing.
    fn go_on(&mut self) {
        let waiting = std::mem::take(&mut self.waiting);
        let step = self.last_step_s.unwrap_or(self.usual_step_s);
        let start = self.last_s.map_or(0.0, |last| last + step);
        self.replace(waiting, |i| start + step * i);
    }

    #[allow(clippy::cast_precision_loss, reason = "few items wait")]
    fn replace(&mut self, items: Vec<T>, time: impl Fn(f64) -> f64) {
        for (i, item) in items.into_iter().enumerate() {
            let time = time(i as f64);
            self.last_s = Some(time);
            self.repaired += 1;
            self.ready.push_back((time, item));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(mut clock: StampClock<()>, stamps: &[Option<i64>]) -> (Vec<f64>, u64) {
        let mut out = Vec::new();
        for &stamp in stamps {
            clock.push(stamp, ());
            out.extend(std::iter::from_fn(|| clock.pop()).map(|(t, ())| (t * 1e6).round() / 1e6));
        }
        clock.end();
        out.extend(std::iter::from_fn(|| clock.pop()).map(|(t, ())| (t * 1e6).round() / 1e6));
        (out, clock.repaired)
    }

    fn plain() -> StampClock<()> {
        StampClock::new(0.01, Some(10.0), None)
    }

    #[test]
    fn frames_faster_than_the_stamps_are_counted_on_a_declared_rate() {
        for rate in [480.0, 1000.0, 2000.0, 10_000.0] {
            let stamps: Vec<_> = (0..400)
                .map(|i| Some((f64::from(i) / rate * 1e3).round() as i64))
                .collect();
            let (times, repaired) = times(StampClock::new(1e-3, Some(rate), Some(rate)), &stamps);
            assert_eq!(repaired, 0, "{rate} Hz");
            for (i, t) in times.iter().enumerate() {
                assert!((t - i as f64 / rate).abs() < 2e-6, "{rate} Hz: frame {i} at {t}");
            }
        }
        // A second of frames left out is not counted over.
        let stamps: Vec<_> = (0..20).chain(1020..1040).map(|ms| Some(ms / 2)).collect();
        let (times, _) = times(StampClock::new(1e-3, Some(2000.0), Some(2000.0)), &stamps);
        assert!((times[20] - times[19] - 0.5005).abs() < 1.1e-3, "{times:?}");
    }

    #[test]
    fn good_stamps_count_from_the_first() {
        let stamps = [500, 510, 525, 530].map(Some);
        assert_eq!(times(plain(), &stamps), (vec![0.0, 0.1, 0.25, 0.3], 0));
    }

    #[test]
    fn missing_and_repeated_stamps_are_spaced_evenly_between_neighbours() {
        let stamps = [Some(0), Some(10), None, Some(10), Some(40), Some(50)];
        assert_eq!(times(plain(), &stamps), (vec![0.0, 0.1, 0.2, 0.3, 0.4, 0.5], 2));
    }

    #[test]
    fn frames_before_the_first_stamp_and_after_the_last_are_spaced_as_usual() {
        let stamps = [None, Some(100), Some(110), None, None];
        assert_eq!(times(plain(), &stamps), (vec![0.0, 0.1, 0.2, 0.3, 0.4], 3));
    }

    #[test]
    fn a_clock_that_jumps_back_goes_on_at_the_last_spacing() {
        let stamps: Vec<_> = (0..5).chain(0..20).map(|i| Some(i * 10)).collect();
        let (times, repaired) = times(plain(), &stamps);
        assert_eq!(times.len(), 25);
        assert!(times.windows(2).all(|w| w[1] > w[0]), "{times:?}");
        assert!((5..=20).contains(&repaired));
    }

    #[test]
    fn without_any_stamp_the_nominal_rate_counts() {
        assert_eq!(times(plain(), &[None; 3]), (vec![0.0, 0.1, 0.2], 3));
    }

    #[test]
    fn milliseconds_on_a_declared_rate_become_the_rate() {
        let clock = || StampClock::new(1e-3, Some(240.0), Some(240.0));
        let rounded: Vec<_> = (0..100)
            .map(|i| Some(((i as f64) / 0.24).round() as i64 + 7))
            .collect();
        let cut: Vec<_> = (0..100).map(|i| Some(((i as f64) / 0.24) as i64)).collect();
        for stamps in [rounded, cut] {
            let (times, repaired) = times(clock(), &stamps);
            assert_eq!(repaired, 0);
            assert!(
                times
                    .iter()
                    .enumerate()
                    .all(|(i, t)| (t - i as f64 / 240.0).abs() < 2e-6),
                "{times:?}"
            );
        }
        // A frame that is truly late keeps its stamp.
        let (times, _) = times(clock(), &[Some(0), Some(4), Some(6), Some(13)]);
        assert!((times[2] - 0.006).abs() < 1e-9, "{times:?}");
    }
}
