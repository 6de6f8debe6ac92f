//! Stamps that are those of an even clock, written down to a tick.
//!
//! A container stores times as whole ticks, rounded or cut: 1/600 s, 1 ms. Frames of an even clock then have stamps s_i with
//! s_i = a + k_i T to within one tick, one interval T for all, k_i whole. Two hypotheses compete: an even clock with stamps
//! written to a tick says all of n stamps by two numbers; stamps that are right as they stand need a jitter of their own in each.
//! Where all stamps lie within a tick of one line the first is likelier by (jitter over tick) to the power n − 2 for any
//! jitter that is larger than the tick, and for a smaller one the two do not differ by more than that; where one does not, the
//! first is impossible, and stamps stand as they are. So the width of a tick alone decides.
//!
//! A file may have had its stamps from a coarser one: where all of them are whole numbers of a coarser tick, that is the tick.
//!
//! What is cut instead of rounded shifts all stamps alike; the first frame is 0 either way. A tick of half an interval or more
//! does not tell a dropped frame from a late one: then stamps stand as well.

use crate::numeric::robust::median;

/// An even clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EvenClock {
    /// From frame to frame, s.
    pub interval_s: f64,
    /// What the file stores times in, s.
    pub tick_s: f64,
    /// By how much a stamp was moved at most, s.
    pub moved_s: f64,
}

/// Stamps of a container that rounds twice (from its clock to a tick, from that to another) may be off by a little more than a
/// tick.
const SLACK: f64 = 1.01;

/// Fewer frames than this are no row.
const LEAST_FRAMES: usize = 6;

/// Stamps that lie on a line to this part of a tick are even as they stand.
const EXACT_PART: f64 = 1e-3;

/// The times of frames with these `stamps_s` (increasing, in ticks of `tick_s`), where they are those of an even clock, with that
/// clock; `nominal_rate_hz` is what the container says, and is believed where the stamps allow it. `None` where they are no even
/// clock's, or are even as they stand.
#[must_use]
pub fn evened(stamps_s: &[f64], tick_s: f64, nominal_rate_hz: Option<f64>) -> Option<(Vec<f64>, EvenClock)> {
    let first = *stamps_s
        .first()
        .filter(|_| stamps_s.len() >= LEAST_FRAMES && tick_s > 0.0)?;
    let steps = || stamps_s.windows(2).map(|w| w[1] - w[0]);
    let usual = median(&mut steps().collect::<Vec<f64>>())?;
    let single: Vec<f64> = steps().filter(|d| *d <= 1.5 * usual).collect();
    let tick_s = written_to(stamps_s, &single, tick_s);
    let about = single.iter().sum::<f64>() / single.len() as f64;
    if !(2.0 * tick_s < about) {
        return None;
    }
    let mut places = vec![0.0];
    let mut place = 0.0;
    for step in steps() {
        place += (step / about).round().max(1.0);
        places.push(place);
    }
    // How far stamps are spread about the line with this interval: convex in it.
    let spread = |interval_s: f64| {
        let off = places
            .iter()
            .zip(stamps_s)
            .map(|(k, s)| s - first - k * interval_s);
        let (low, high) = off.fold((0.0_f64, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)));
        high - low
    };
    let reach = 2.0 * tick_s / place;
    let mean = (stamps_s.last()? - first) / place;
    let best = least(&spread, (mean - reach, mean + reach));
    let width = spread(best);
    if width > SLACK * tick_s || width < EXACT_PART * tick_s {
        return None;
    }
    let allows = |interval_s: f64| spread(interval_s) <= SLACK * tick_s;
    let range = (
        boundary(&allows, best, best - 2.0 * reach),
        boundary(&allows, best, best + 2.0 * reach),
    );
    let interval_s = nominal_rate_hz
        .map(|rate| 1.0 / rate)
        .filter(|&t| allows(t))
        .or_else(|| whole_rate(range))
        .unwrap_or(0.5 * (range.0 + range.1));
    let times_s: Vec<f64> = places.iter().map(|k| first + k * interval_s).collect();
    let moved_s = times_s
        .iter()
        .zip(stamps_s)
        .fold(0.0_f64, |most, (t, s)| most.max((t - s).abs()));
    let clock = EvenClock {
        interval_s,
        tick_s,
        moved_s,
    };
    Some((times_s, clock))
}

/// The tick that `stamps_s`, whose steps from frame to frame are `single_s` where none is missing, were written to before they
/// were stored in ticks of `tick_s`: an even clock's steps are then of two lengths, a tick apart, and all stamps whole ticks.
fn written_to(stamps_s: &[f64], single_s: &[f64], tick_s: f64) -> f64 {
    let (shortest, longest) = single_s.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), &d| {
        (low.min(d), high.max(d))
    });
    let middle = 0.5 * (shortest + longest);
    let mean = |longer: bool| {
        let of = || single_s.iter().filter(|d| (**d > middle) == longer);
        of().sum::<f64>() / of().count() as f64
    };
    let mut coarse_s = mean(true) - mean(false);
    if !(coarse_s >= FINER * tick_s) {
        return tick_s;
    }
    // The later a stamp, the better it tells the tick.
    for s in stamps_s {
        let ticks = (s / coarse_s).round();
        if ticks > 0.0 {
            coarse_s = s / ticks;
        }
    }
    let off = |s: &f64| (s - (s / coarse_s).round() * coarse_s).abs();
    let whole = stamps_s.iter().all(|s| off(s) <= SLACK * tick_s);
    if whole { coarse_s + tick_s } else { tick_s }
}

/// A stamp is near a whole number of units so many times coarser by chance in two of so many cases.
const FINER: f64 = 4.0;

/// The interval of the one rate of whole hertz (or that over 1.001, as television has it) within `range`; `None` of none or several.
fn whole_rate((shortest_s, longest_s): (f64, f64)) -> Option<f64> {
    let mut found = [1.0, 1.001].into_iter().filter_map(|slower| {
        let rate = (slower / longest_s).ceil();
        (rate <= slower / shortest_s && rate > 0.0).then_some(slower / rate)
    });
    found.next().filter(|_| found.next().is_none())
}

/// Where the convex `f` is least within `range`.
fn least(f: &impl Fn(f64) -> f64, (mut low, mut high): (f64, f64)) -> f64 {
    for _ in 0..SEARCH_STEPS {
        let third = (high - low) / 3.0;
        if f(low + third) < f(high - third) {
            high -= third;
        } else {
            low += third;
        }
    }
    0.5 * (low + high)
}

/// How far from `inside` towards `outside` it `allows`.
fn boundary(allows: &impl Fn(f64) -> bool, inside: f64, outside: f64) -> f64 {
    let (mut inside, mut outside) = (inside, outside);
    for _ in 0..SEARCH_STEPS {
        let middle = 0.5 * (inside + outside);
        if allows(middle) {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    inside
}

/// Steps of a search: a third off each time leaves 1e-12 of the range.
const SEARCH_STEPS: usize = 70;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::TestNoise;

    /// Stamps of frames at `rate_hz`, but for some that are missing, written to `tick_s` by `write`.
    fn stamps(rate_hz: f64, tick_s: f64, missing: &[usize], write: fn(f64) -> f64) -> Vec<f64> {
        let kept = (0..150).filter(|k| !missing.contains(k));
        let all: Vec<f64> = kept
            .map(|k| write((k as f64 / rate_hz + 0.3371) / tick_s) * tick_s)
            .collect();
        all.iter().map(|s| s - all[0]).collect()
    }

    #[test]
    fn stamps_rounded_or_cut_are_those_of_their_clock() {
        for (rate_hz, tick_s) in [
            (240.0, 1e-3),
            (480.0, 1e-3),
            (240.0, 1.0 / 600.0),
            (59.94, 1e-3),
            (30.0, 0.01),
            (119.3, 1e-3),
        ] {
            for write in [f64::round, f64::floor, f64::ceil] {
                for missing in [&[][..], &[40, 41, 90]] {
                    let rough = stamps(rate_hz, tick_s, missing, write);
                    let (times, clock) = evened(&rough, tick_s, None).unwrap();
                    assert_eq!(times[0], 0.0);
                    let off = (times[times.len() - 1] * rate_hz - 149.0).abs();
                    assert!(off < 0.03, "{rate_hz} Hz in {tick_s} s: {off} frames, {clock:?}");
                    assert!(clock.moved_s <= 1.02 * tick_s);
                }
            }
        }
    }

    #[test]
    fn milliseconds_in_a_finer_file_are_milliseconds() {
        let cut = stamps(119.88, 1e-3, &[], f64::floor);
        let stored: Vec<f64> = cut.iter().map(|s| (s * 16_000.0).round() / 16_000.0).collect();
        let (times, clock) = evened(&stored, 1.0 / 16_000.0, None).unwrap();
        assert!(
            (times[149] - 149.0 / 119.88).abs() < 2e-4 && clock.tick_s > 1e-3,
            "{clock:?}"
        );
    }

    #[test]
    fn stamps_of_an_uneven_clock_stand() {
        let mut noise = TestNoise(3);
        let jitter: Vec<f64> = (0..150)
            .map(|k| (1e3 * (k as f64 / 30.0 + 0.002 * noise.normal())).round() / 1e3)
            .collect();
        assert_eq!(evened(&jitter, 1e-3, Some(30.0)), None);
        // Even as they stand; too coarse; too few.
        assert_eq!(
            evened(&stamps(250.0, 1e-3, &[], f64::round), 1e-3, Some(250.0)),
            None
        );
        assert_eq!(evened(&stamps(700.0, 1e-3, &[], f64::round), 1e-3, None), None);
        assert_eq!(evened(&[0.0, 0.033, 0.067], 1e-3, None), None);
        // A rate that drifts: a phone's exposure changed in the middle.
        let drift: Vec<f64> = (0..150)
            .map(|k| (1e3 * (f64::from(k) / 30.0 + 1e-6 * f64::from(k * k))).floor() / 1e3)
            .collect();
        assert_eq!(evened(&drift, 1e-3, None), None);
    }
}
