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
    /// Frames that repeat the one before and took no time: somebody put them in.
    pub put_in: usize,
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
                put_in: 0,
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
                put_in: 0,
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
            put_in: 0,
            evened: false,
        }
    }

    /// The even clock that stamps jitter about, by least squares, and the largest jitter, s; `None` where frames are missing by the stamps, or
    /// they stand further from an even clock than half of its step.
    #[must_use]
    pub fn even(stamps_s: &[f64]) -> Option<(Self, f64)> {
        let stored = Self::new(stamps_s, &[], None);
        let count = stamps_s.len() as f64;
        if stored.gaps > 0 || stamps_s.len() < LEAST_EVEN {
            return None;
        }
        let middle = 0.5 * (count - 1.0);
        let mean = stamps_s.iter().sum::<f64>() / count;
        let numbered = || {
            stamps_s
                .iter()
                .enumerate()
                .map(|(k, s)| (k as f64 - middle, s - mean))
        };
        let step = numbered().map(|(k, s)| k * s).sum::<f64>() / numbered().map(|(k, _)| k * k).sum::<f64>();
        let jitter = numbered().map(|(k, s)| (s - step * k).abs()).fold(0.0, f64::max);
        // Jitter hides the last digits of a usual camera's rate.
        let squares = numbered().map(|(k, s)| (s - step * k).powi(2)).sum::<f64>();
        let step_std = (squares / count / numbered().map(|(k, _)| k * k).sum::<f64>()).sqrt();
        let off = |hz: &f64| (1.0 / hz - step).abs();
        let usual = USUAL_RATES_HZ
            .into_iter()
            .min_by(|a, b| off(a).total_cmp(&off(b)));
        let step = usual
            .filter(|hz| off(hz) < STEP_SIGMAS * step_std)
            .map_or(step, |hz| 1.0 / hz);
        // Times count from the first stamp.
        let first = mean - step * middle - stamps_s[0];
        (step > 0.0 && jitter < 0.5 * step).then(|| {
            let times_s = (0..stamps_s.len()).map(|k| first + step * k as f64).collect();
            let interval_s = Some(step);
            (
                Self {
                    times_s,
                    interval_s,
                    ..stored
                },
                jitter,
            )
        })
    }

    /// The same clock slower by a `factor`, its frames numbered anew.
    #[must_use]
    pub fn stretched(mut self, factor: f64) -> Self {
        self.times_s.iter_mut().for_each(|t| *t *= factor);
        self.interval_s = self.interval_s.map(|i| i * factor);
        self.evened = false;
        self
    }

    /// The same with the time of frames that are missing without a trace in the stamps: `skips` are the first frame after
    /// each gap and the frames missing in it; below 0, those that an earlier skip has too many.
    #[must_use]
    pub fn with_skips(mut self, skips: &[(usize, isize)]) -> Self {
        let Some(interval_s) = self.interval_s else {
            return self;
        };
        for &(frame, missing) in skips {
            for time in self.times_s.iter_mut().skip(frame) {
                *time += missing as f64 * interval_s;
            }
            self.skipped = self.skipped.saturating_add_signed(missing);
        }
        self
    }
}

impl TimeBase {
    /// The same where the `repeats` were put in: no time passed at them, and all later frames were numbered too high.
    #[must_use]
    pub fn with_put_in(mut self, repeats: &[bool]) -> Self {
        let Some(interval_s) = self.interval_s else {
            return self;
        };
        for (time, repeat) in self.times_s.iter_mut().zip(repeats) {
            self.put_in += usize::from(*repeat);
            *time -= self.put_in as f64 * interval_s;
        }
        self
    }
}

/// Stamps that stand evenly: those of a recording whose frames may have been chosen from pictures of another rate.
#[derive(Debug, Clone)]
pub struct EvenStamps {
    /// The place of each in the even clock, from 0.
    numbers: Vec<f64>,
    /// That clock's step, s.
    step_s: f64,
}

impl EvenStamps {
    /// `stamps_s`, increasing; `None` where they do not stand evenly, or leave frames out.
    #[must_use]
    pub fn of(stamps_s: &[f64]) -> Option<Self> {
        let step_s = typical_step(stamps_s.windows(2).map(|w| w[1] - w[0]))?;
        let first = *stamps_s.first()?;
        if gaps(stamps_s).0 > 0 {
            return None;
        }
        let mut numbers = Vec::with_capacity(stamps_s.len());
        for stamp in stamps_s {
            let number = (stamp - first) / step_s;
            if (number - number.round()).abs() > EVEN_PART {
                return None;
            }
            numbers.push(number.round());
        }
        // Over all of them it is better known than from one step.
        let whole = stamps_s
            .iter()
            .zip(&numbers)
            .next_back()
            .filter(|(_, n)| **n > 0.0);
        let step_s = whole.map_or(step_s, |(last, number)| (last - first) / number);
        Some(Self { numbers, step_s })
    }

    /// The clock of a recording whose frames were chosen from pictures of another, even rate, as players and editors do: frame k
    /// shows the picture ⌊ratio k + phase⌋. Below a ratio of 1 frames repeat the one before, above 1 pictures are missing.
    /// With the frames that are repeats by that.
    ///
    /// With `frame_rate_hz` pictures come at that rate; else they span the time that the stamps span.
    #[must_use]
    pub fn resampled(&self, frame_rate_hz: Option<f64>, by: Resampling) -> (TimeBase, Vec<bool>) {
        let numbers = &self.numbers;
        let interval_s = match frame_rate_hz {
            Some(rate) => 1.0 / rate,
            None => self.step_s / by.ratio,
        };
        let first = by.picture(0.0);
        let pictures: Vec<f64> = numbers.iter().map(|&k| by.picture(k) - first).collect();
        let repeats = (0..pictures.len()).map(|i| i > 0 && pictures[i] == pictures[i - 1]);
        let lost = |i: usize| (pictures[i] - pictures[i - 1]) - (numbers[i] - numbers[i - 1]);
        let skipped: f64 = (1..pictures.len()).map(|i| lost(i).max(0.0)).sum();
        let base = TimeBase {
            times_s: pictures.iter().map(|p| p * interval_s).collect(),
            interval_s: Some(interval_s),
            gaps: 0,
            missing: 0,
            skipped: skipped as usize,
            put_in: 0,
            evened: frame_rate_hz.is_none(),
        };
        (base, repeats.collect())
    }
}

/// How the frames of a recording were chosen from pictures of another rate; see [`EvenStamps::resampled`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resampling {
    /// Pictures a stored frame.
    pub ratio: f64,
    /// Of the first frame, pictures, 0 to 1.
    pub phase: f64,
}

/// Rates at which cameras take pictures, Hz.
const USUAL_RATES_HZ: [f64; 22] = [
    12.0, 15.0, 20.0, 24.0, 25.0, 30.0, 48.0, 50.0, 60.0, 90.0, 100.0, 120.0, 150.0, 180.0, 200.0, 240.0,
    250.0, 300.0, 480.0, 500.0, 960.0, 1000.0,
];

/// The same in the countries of NTSC.
const NTSC: f64 = 1000.0 / 1001.0;

impl Resampling {
    /// The picture that stored frame `k` shows.
    fn picture(self, k: f64) -> f64 {
        (self.ratio * k + self.phase + ROUNDING).floor()
    }

    /// The ratios of cameras of usual rates for frames stored at `stored_hz`: of those in whole Hz, and of those in the countries of NTSC.
    #[must_use]
    pub fn of_usual_cameras(stored_hz: f64) -> [Vec<f64>; 2] {
        [1.0, NTSC].map(|factor| USUAL_RATES_HZ.iter().map(|hz| hz * factor / stored_hz).collect())
    }
}

/// A usual rate is that of the stamps where their mean step is no further from it than so many standard uncertainties.
const STEP_SIGMAS: f64 = 4.0;

/// Fewer stamps than this tell no even clock.
const LEAST_EVEN: usize = 12;

/// Stamps are even where they stand within this part of a stored frame's time of an even clock.
const EVEN_PART: f64 = 0.2;

/// Of a sum of products by whole numbers.
const ROUNDING: f64 = 1e-9;

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
    fn frames_chosen_from_pictures_of_another_rate_have_their_times() {
        let by = |ratio: f64, phase: f64| Resampling { ratio, phase };
        // 24 Hz in a file of 30 Hz: every fifth frame is a repeat.
        let stamps: Vec<f64> = (0..31).map(|i| f64::from(i) / 30.0).collect();
        let (base, repeats) = EvenStamps::of(&stamps).unwrap().resampled(None, by(0.8, 0.0));
        assert_eq!(repeats.iter().filter(|r| **r).count(), 6);
        assert!((base.times_s[30] - 1.0).abs() < 1e-12 && base.evened && base.skipped == 0);
        assert!((base.interval_s.unwrap() - 1.0 / 24.0).abs() < 1e-12);
        // 30 Hz in one of 25: every sixth picture is missing, whenever it comes first.
        let stamps: Vec<f64> = (0..26).map(|i| f64::from(i) / 25.0).collect();
        for phase in [0.0, 0.2, 0.8] {
            let (base, repeats) = EvenStamps::of(&stamps).unwrap().resampled(None, by(1.2, phase));
            assert!(!repeats.contains(&true) && base.skipped == 5);
            let steps: Vec<f64> = base.times_s.windows(2).map(|w| (w[1] - w[0]) * 30.0).collect();
            assert!(
                steps
                    .iter()
                    .all(|s| (s - 1.0).abs() < 1e-9 || (s - 2.0).abs() < 1e-9)
            );
            assert!((base.times_s[25] - 1.0).abs() < 1e-12);
        }
        // By a known rate, or as the frames were numbered anew.
        let (known, _) = EvenStamps::of(&stamps)
            .unwrap()
            .resampled(Some(300.0), by(1.2, 0.0));
        assert!((known.times_s[25] - 0.1).abs() < 1e-12);
        let (base, _) = EvenStamps::of(&stamps).unwrap().resampled(None, by(1.2, 0.0));
        assert!((base.stretched(1.2).times_s[25] - 30.0 / 25.0).abs() < 1e-12);
        // Uneven stamps are of no such recording.
        let stamps = [0.0, 0.1, 0.2, 0.345, 0.4, 0.5, 0.6];
        assert!(EvenStamps::of(&stamps).is_none());
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
