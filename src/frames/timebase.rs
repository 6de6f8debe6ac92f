//! When each frame was taken: by the file's stamps, or by the true capture rate of the calibration.

/// Times of all frames and what was noticed about their spacing.
#[derive(Debug, Clone, PartialEq)]
pub struct TimeBase {
    /// Time of each frame, s; the first frame is 0.
    pub times_s: Vec<f64>,
    /// Time from one distinct frame to the next, s; `None` with fewer than two.
    pub interval_s: Option<f64>,
    /// Places where the stamps leave out at least one stored frame.
    pub gaps: usize,
    /// Stored frames missing in those gaps.
    pub missing: usize,
    /// Frames missing without a trace in the stamps, by what moves; their time is in `times_s`.
    pub skipped: usize,
    /// Whether distinct frames stand evenly, though their stamps do not.
    pub evened: bool,
}

/// Stamps further apart than this many intervals leave a frame out; jitter of variable-rate phones stays below.
const GAP_INTERVALS: f64 = 1.6;

impl TimeBase {
    /// The time base of frames with `stamps_s` (increasing), of which `repeats` show nothing new. With
    /// `frame_rate_hz`, the true rate at which distinct frames were taken, stamps only tell how many frame periods
    /// lie between two frames.
    #[must_use]
    pub fn new(stamps_s: &[f64], repeats: &[bool], frame_rate_hz: Option<f64>) -> Self {
        let distinct: Vec<usize> = (0..stamps_s.len())
            .filter(|&i| !repeats.get(i).copied().unwrap_or(false))
            .collect();
        let steps = || distinct.windows(2).map(|w| stamps_s[w[1]] - stamps_s[w[0]]);
        // Among repeats, a short step may be one that was not recognised.
        let stored = if distinct.len() < stamps_s.len() {
            median_step(steps())
        } else {
            typical_step(steps())
        };
        let Some(stored) = stored else {
            return Self {
                times_s: vec![0.0; stamps_s.len()],
                interval_s: None,
                gaps: 0,
                missing: 0,
                skipped: 0,
                evened: false,
            };
        };
        let (gaps, missing) = gaps(stamps_s);
        let Some(rate) = frame_rate_hz else {
            return Self {
                times_s: stamps_s.to_vec(),
                interval_s: Some(stored),
                gaps,
                missing,
                skipped: 0,
                evened: false,
            };
        };
        let mut times_s = Vec::with_capacity(stamps_s.len());
        let (mut periods, mut last_stamp, mut any) = (0.0, 0.0, false);
        for (i, &stamp) in stamps_s.iter().enumerate() {
            let repeat = repeats.get(i).copied().unwrap_or(false);
            if any && !repeat {
                periods += ((stamp - last_stamp) / stored).round().max(1.0);
            }
            if !repeat || !any {
                last_stamp = stamp;
                any = true;
            }
            times_s.push(periods / rate);
        }
        Self {
            times_s,
            interval_s: Some(1.0 / rate),
            gaps,
            missing,
            skipped: 0,
            evened: false,
        }
    }

    /// The same if distinct frames were taken at even times, and repeats fill them up to a faster clock (24 Hz stored as 30 Hz);
    /// with the repeats that this makes. `None` where repeats do not come regularly.
    #[must_use]
    pub fn evenly(&self, stamps_s: &[f64], repeats: &[bool]) -> Option<(Self, Vec<bool>)> {
        let distinct: Vec<f64> = stamps_s
            .iter()
            .zip(repeats)
            .filter(|(_, repeat)| !**repeat)
            .map(|(&s, _)| s)
            .collect();
        if self.gaps > 0 || distinct.len() == stamps_s.len() || stamps_s.len() != repeats.len() {
            return None;
        }
        let stored_s = (stamps_s.last()? - stamps_s.first()?) / (stamps_s.len() - 1) as f64;
        // The most regular; of those the shortest pattern.
        let (interval_s, _) = (2..=MOST_PATTERN)
            .rev()
            .filter_map(|n| even_interval(&distinct, n, stored_s))
            .max_by(|a, b| a.1.total_cmp(&b.1))?;
        // Each stamp is late by less than a stored frame: to which tick it belongs, counted from their mean lag.
        let turn = |s: f64| std::f64::consts::TAU * s / interval_s;
        let (sin, cos) = distinct.iter().fold((0.0, 0.0), |(sin, cos), &s| {
            (sin + turn(s).sin(), cos + turn(s).cos())
        });
        let lag = f64::atan2(sin, cos) / std::f64::consts::TAU;
        let tick = |s: f64| (s / interval_s - lag).round();
        let start = tick(*distinct.first()?);
        let (mut times_s, mut repeated) = (Vec::new(), Vec::new());
        for (&s, &repeat) in stamps_s.iter().zip(repeats) {
            let last = times_s.last().copied();
            let time = ((tick(s) - start) * interval_s).max(0.0);
            let again = last.is_some_and(|last| repeat || time <= last);
            times_s.push(if again { last.unwrap_or(time) } else { time });
            repeated.push(again);
        }
        let even = Self {
            times_s,
            interval_s: Some(interval_s),
            evened: true,
            ..self.clone()
        };
        Some((even, repeated))
    }

    /// The same with the time of frames that are missing without a trace in the stamps: `skips` are the first frame after
    /// each gap and the frames missing in it.
    #[must_use]
    pub fn with_skips(mut self, skips: &[(usize, usize)]) -> Self {
        let Some(interval_s) = self.interval_s else {
            return self;
        };
        for &(frame, missing) in skips {
            for time in self.times_s.iter_mut().skip(frame) {
                *time += missing as f64 * interval_s;
            }
            self.skipped += missing;
        }
        self
    }
}

/// Distinct frames after which repeats come round again, at most: 24 Hz in a file of 25 Hz.
const MOST_PATTERN: usize = 24;

/// Part of the clip that must follow the pattern; a repeat of a ball at rest is not told.
const LEAST_REGULAR: f64 = 0.75;

/// The even interval that makes `n` successive of the `distinct` stamps span a whole number of stored frames, always the same,
/// and the part of the clip where they do; `None` where they do not, or that is the stored interval itself.
fn even_interval(distinct: &[f64], n: usize, stored_s: f64) -> Option<(f64, f64)> {
    let mut spans: Vec<f64> = distinct
        .iter()
        .zip(distinct.iter().skip(n))
        .map(|(a, b)| ((b - a) / stored_s).round())
        .collect();
    let frames = crate::numeric::robust::median(&mut spans)?;
    let regular = spans.iter().filter(|s| **s == frames).count() as f64 / spans.len() as f64;
    let enough = spans.len() >= 2 * n && regular >= LEAST_REGULAR;
    (enough && frames > n as f64 && frames % n as f64 != 0.0).then(|| (frames * stored_s / n as f64, regular))
}

/// Places where the stamps leave frames out, and how many frames. Repeats count as frames here: one that fills the place
/// of a dropped frame is told as a repeat, and its place is no gap in the stamps.
fn gaps(stamps_s: &[f64]) -> (usize, usize) {
    let steps = || stamps_s.windows(2).map(|w| w[1] - w[0]);
    let Some(step) = typical_step(steps()) else {
        return (0, 0);
    };
    let wide = steps()
        .map(|d| d / step)
        .filter(|&periods| periods > GAP_INTERVALS);
    wide.fold((0, 0), |(gaps, missing), periods| {
        (gaps + 1, missing + (periods.round() as usize).saturating_sub(1))
    })
}

/// The usual step from frame to frame: the median positive one, or, where more than half of the frames are missing, the
/// part of it that the steps are multiples of. Image numbers are whole: theirs is what they all are multiples of.
fn typical_step(steps: impl Iterator<Item = f64>) -> Option<f64> {
    let mut steps: Vec<f64> = steps.filter(|d| *d > 0.0).collect();
    let median = crate::numeric::robust::median(&mut steps)?;
    if steps.iter().all(|d| d.fract() == 0.0 && *d < MOST_NUMBER) {
        return Some(steps.iter().fold(0.0, |a, &b| common_divisor(a, b)));
    }
    let part =
        |of: &dyn Fn(f64) -> bool| steps.iter().filter(|&&d| of(d)).count() as f64 / steps.len() as f64;
    let mut finer = (2..=MOST_PERIODS).rev().map(|n| median / f64::from(n));
    let found = finer.find(|&period| {
        let single = part(&|d| (d / period - 1.0).abs() < WHOLE_PART);
        let whole = part(&|d| (d / period - (d / period).round()).abs() < WHOLE_PART);
        single > LEAST_SINGLE && whole > LEAST_WHOLE
    });
    Some(found.unwrap_or(median))
}

/// The median positive step.
fn median_step(steps: impl Iterator<Item = f64>) -> Option<f64> {
    let mut steps: Vec<f64> = steps.filter(|d| *d > 0.0).collect();
    crate::numeric::robust::median(&mut steps)
}

/// Whole numbers below this are exact.
const MOST_NUMBER: f64 = 9e15;

/// Of two whole numbers.
fn common_divisor(a: f64, b: f64) -> f64 {
    let (mut a, mut b) = (a, b);
    while b > 0.0 {
        (a, b) = (b, a % b);
    }
    a
}

/// A median step of more frames than this is no row of dropped frames.
const MOST_PERIODS: u32 = 4;

/// A step is a whole number of periods to this part of one.
const WHOLE_PART: f64 = 0.12;

/// Least part of the steps that are single periods, and that are whole ones, for the period to be one: jitter makes a
/// quarter of them so by chance.
const LEAST_SINGLE: f64 = 0.1;
const LEAST_WHOLE: f64 = 0.95;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_stand_where_no_rate_is_given() {
        let stamps = [0.0, 0.033, 0.067, 0.1, 0.2];
        let base = TimeBase::new(&stamps, &[false; 5], None);
        assert_eq!(base.times_s, stamps);
        assert_eq!((base.gaps, base.missing), (1, 2));
    }

    #[test]
    fn a_capture_rate_counts_periods_not_stamps() {
        // 120 Hz stored as a jittering 30 Hz with one frame lost.
        let stamps = [0.0, 0.034, 0.066, 0.1, 0.1667, 0.2];
        let base = TimeBase::new(&stamps, &[false; 6], Some(120.0));
        let expected = [0, 1, 2, 3, 5, 6].map(|k| f64::from(k) / 120.0);
        for (a, b) in base.times_s.iter().zip(expected) {
            assert!((a - b).abs() < 1e-12);
        }
    }

    #[test]
    fn repeats_do_not_count_as_periods() {
        let stamps: Vec<f64> = (0..8).map(|i| f64::from(i) / 60.0).collect();
        let repeats: Vec<bool> = (0..8).map(|i| i % 2 == 1).collect();
        let by_rate = TimeBase::new(&stamps, &repeats, Some(30.0));
        for i in [0, 2, 4, 6] {
            assert!((by_rate.times_s[i] - stamps[i]).abs() < 1e-12);
        }
        assert_eq!(by_rate.gaps, 0);
        assert!((TimeBase::new(&stamps, &repeats, None).interval_s.unwrap() - 1.0 / 30.0).abs() < 1e-12);
    }

    #[test]
    fn a_repeat_in_place_of_a_dropped_frame_is_no_gap() {
        let stamps: Vec<f64> = (0..9).map(|i| f64::from(i) / 30.0).collect();
        let mut repeats = [false; 9];
        repeats[4] = true;
        let base = TimeBase::new(&stamps, &repeats, None);
        assert_eq!((base.gaps, base.missing), (0, 0));
    }

    #[test]
    fn a_gap_among_repeats_is_one() {
        // Each frame twice at 60 Hz; the third pair is missing.
        let stamps: Vec<f64> = [0, 1, 2, 3, 6, 7, 8, 9].map(|i| f64::from(i) / 60.0).into();
        let repeats: Vec<bool> = (0..8).map(|i| i % 2 == 1).collect();
        let base = TimeBase::new(&stamps, &repeats, Some(30.0));
        assert_eq!((base.gaps, base.missing), (1, 2));
        assert!((base.times_s[4] - 3.0 / 30.0).abs() < 1e-12);
    }

    #[test]
    fn the_period_is_found_where_most_frames_are_missing() {
        let mut at = 0.0;
        let stamps: Vec<f64> = [0, 2, 3, 1, 2, 2, 3, 1, 2, 4, 2, 1, 2, 2]
            .iter()
            .map(|&n| {
                at += f64::from(n) / 240.0;
                at
            })
            .collect();
        let base = TimeBase::new(&stamps, &[], Some(240.0));
        assert!((base.times_s[13] - 27.0 / 240.0).abs() < 1e-12, "{base:?}");
        assert_eq!((base.gaps, base.missing), (10, 14));
        // Numbers of images are whole, whichever are left.
        let numbers = [2.0, 4.0, 7.0, 9.0, 12.0, 14.0];
        assert_eq!(TimeBase::new(&numbers, &[], Some(10.0)).times_s[5], 1.2);
        // Steps of two lengths are what a player makes of film (3:2), not dropped frames.
        let stamps: Vec<f64> = (0..20)
            .map(|i| 0.04 * f64::from(i) + 0.008 * f64::from(i % 2))
            .collect();
        assert_eq!(TimeBase::new(&stamps, &[], None).gaps, 0);
    }

    #[test]
    fn regular_repeats_may_stand_for_an_even_clock() {
        for (pattern, stored_hz, true_hz) in [
            (&[1, 1, 1, 2][..], 30.0, 24.0),
            (&[2, 3], 60.0, 24.0),
            (&[1, 1, 1, 1, 2], 30.0, 25.0),
        ] {
            let mut repeats = vec![false];
            for i in 0..60 {
                let stored: usize = pattern[i % pattern.len()];
                repeats.extend((1..=stored).map(|k| k < stored));
            }
            let stamps: Vec<f64> = (0..repeats.len()).map(|i| i as f64 / stored_hz).collect();
            // One repeat that nothing shows, as of a ball at rest.
            let hidden = repeats.iter().skip(40).position(|&r| r).unwrap() + 40;
            let truth = repeats.clone();
            repeats[hidden] = false;
            let base = TimeBase::new(&stamps, &repeats, None);
            let (even, repeated) = base.evenly(&stamps, &repeats).unwrap();
            let (mut k, first) = (0, even.times_s[0]);
            assert!(first == 0.0 && even.evened);
            for (i, &repeat) in truth.iter().enumerate().skip(1) {
                k += usize::from(!repeat);
                let off = (even.times_s[i] - k as f64 / true_hz).abs();
                assert!(off < 1e-9 || (i == hidden && off < 1.01 / true_hz), "{i}: {off}");
            }
            assert_eq!(
                repeated.iter().filter(|r| **r).count(),
                truth.iter().filter(|r| **r).count()
            );
        }
        // Every frame twice is even as it stands; repeats here and there have no pattern.
        let stamps: Vec<f64> = (0..40).map(f64::from).collect();
        for repeats in [
            (0..40).map(|i| i % 2 == 1).collect::<Vec<bool>>(),
            (0..40).map(|i| [3, 4, 11, 26, 31].contains(&i)).collect(),
        ] {
            assert_eq!(
                TimeBase::new(&stamps, &repeats, None).evenly(&stamps, &repeats),
                None
            );
        }
    }

    #[test]
    fn skips_move_what_follows() {
        let stamps: Vec<f64> = (0..8).map(f64::from).collect();
        let base = TimeBase::new(&stamps, &[], None).with_skips(&[(3, 1), (5, 2)]);
        assert_eq!(base.times_s, [0.0, 1.0, 2.0, 4.0, 5.0, 8.0, 9.0, 10.0]);
        assert_eq!(base.skipped, 3);
    }

    #[test]
    fn nothing_and_one_frame_have_no_interval() {
        assert_eq!(TimeBase::new(&[], &[], None).interval_s, None);
        assert_eq!(TimeBase::new(&[0.0], &[false], Some(30.0)).interval_s, None);
    }
}
