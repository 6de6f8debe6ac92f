//! How well a clock suits what moves: between impacts three successive places tell the fourth.
//!
//! For any four times the third divided difference of a parabola is 0. With Σ c_i y_i that difference and σ a place's
//! standard deviation, r = Σ c_i y_i / (σ √Σ c_i²) is normal of variance 1 under the right clock; an impact makes some of
//! them large under any clock, so that the likelihood is Cauchy's.

use super::linking::{LinkedSpots, Spot};

/// Shorter tracks are not looked at.
const LEAST_TRACK: usize = 12;

/// A place is not known better than to this part of the radius: shading, texture, drag.
const PART_OF_RADIUS: f64 = 0.02;

/// A clock must be better than another by this in the logarithm of the likelihood.
const CLEAR: f64 = 30.0;

/// Whether the ball's places suit the times in `these` spots clearly better than those in `others`, the same spots by
/// another clock.
#[must_use]
pub fn suits_better(these: &LinkedSpots, others: &LinkedSpots) -> bool {
    let ((a, n), (b, m)) = (log_likelihood(these), log_likelihood(others));
    let windows = n.min(m) as f64;
    // The longer the clip, the more has to speak for it.
    n > 0 && m > 0 && (a / n as f64 - b / m as f64) * windows > CLEAR.max(LEAST_A_WINDOW * windows)
}

/// Gain in the logarithm of the likelihood that a wrong clock leaves at least, a window: a third of the windows, off by three
/// standard deviations.
const LEAST_A_WINDOW: f64 = 0.75;

/// Logarithm of the likelihood of all windows of four successive spots, and their number.
fn log_likelihood(linked: &LinkedSpots) -> (f64, usize) {
    let (mut sum, mut count) = (0.0, 0);
    for track in linked.tracks.iter().filter(|t| t.len() >= LEAST_TRACK) {
        for w in track.windows(4) {
            let s = [0, 1, 2, 3].map(|k| &linked.spots[w[k]]);
            if let Some(square) = misfit(s) {
                // Of two coordinates.
                sum -= 1.5 * (1.0 + square).ln();
                count += 1;
            }
        }
    }
    (sum, count)
}

/// Squared third difference in variances, of both coordinates; `None` where times do not increase.
fn misfit(s: [&Spot; 4]) -> Option<f64> {
    if s.windows(2).any(|p| !(p[1].time_s > p[0].time_s)) {
        return None;
    }
    let (mut right, mut up, mut squares) = (0.0, 0.0, 0.0);
    for (i, p) in s.iter().enumerate() {
        let others = s.iter().enumerate().filter(|(j, _)| *j != i);
        let c = 1.0 / others.map(|(_, q)| p.time_s - q.time_s).product::<f64>();
        let std = p.std.max(PART_OF_RADIUS * p.radius);
        right += c * p.place.right;
        up += c * p.place.up;
        squares += (c * std).powi(2);
    }
    let square = (right * right + up * up) / squares;
    square.is_finite().then_some(square)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::PlanePoint;

    /// A bouncing ball at the times of its frames, which are given the times `stamped`.
    fn clip(taken: impl Fn(usize) -> f64, stamped: impl Fn(usize) -> f64) -> LinkedSpots {
        let spots = (0..60).map(|frame| {
            let t = taken(frame);
            let phase = (t + 0.25) % 0.5;
            Spot {
                coded: crate::frames::Coded::Whole,
                id: frame,
                frame,
                time_s: stamped(frame),
                place: PlanePoint::new(300.0 * t, 4000.0 * 0.5 * phase * (0.5 - phase)),
                std: 0.05,
                radius: 8.0,
                contrast_grey: 100.0,
            }
        });
        LinkedSpots::new(spots.collect())
    }

    #[test]
    fn the_clock_of_the_flight_suits_better() {
        let even = |i: usize| i as f64 / 240.0;
        let stored = |i: usize| (i + i / 4) as f64 / 300.0;
        for (taken, other) in [
            (&even as &dyn Fn(usize) -> f64, &stored as &dyn Fn(usize) -> f64),
            (&stored, &even),
        ] {
            let (right, wrong) = (clip(taken, taken), clip(taken, other));
            assert!(suits_better(&right, &wrong));
            assert!(!suits_better(&wrong, &right) && !suits_better(&right, &right));
        }
    }
}
