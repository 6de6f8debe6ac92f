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
        let Some(stored) = typical_step(distinct.windows(2).map(|w| stamps_s[w[1]] - stamps_s[w[0]])) else {
            return Self {
                times_s: vec![0.0; stamps_s.len()],
                interval_s: None,
                gaps: 0,
                missing: 0,
            };
        };
        let (gaps, missing) = gaps(stamps_s);
        let Some(rate) = frame_rate_hz else {
            return Self {
                times_s: stamps_s.to_vec(),
                interval_s: Some(stored),
                gaps,
                missing,
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
        }
    }
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

/// The median positive step.
fn typical_step(steps: impl Iterator<Item = f64>) -> Option<f64> {
    let mut steps: Vec<f64> = steps.filter(|d| *d > 0.0).collect();
    crate::quantity::median(&mut steps)
}

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
    fn nothing_and_one_frame_have_no_interval() {
        assert_eq!(TimeBase::new(&[], &[], None).interval_s, None);
        assert_eq!(TimeBase::new(&[0.0], &[false], Some(30.0)).interval_s, None);
    }
}
