//! The variance of the centres beyond their own uncertainty: a codec that leaves the ball where it was predicted, a camera
//! that shakes, a path that is not quite an arc.
//!
//! Each frame's own uncertainty comes from its pixels; a displacement of the whole ball is not seen there. It is seen in
//! the distances to the arcs, and it has nothing to do with the pixels' noise, so it is a variance to add, not a factor.
//! Frames that are coded differently have each their own: interpolated (B) frames are displaced by several times what
//! predicted (P) frames are, those by more than whole ones, and the arcs should lean on the better.
//!
//! Centres may also be better than they say (what is not known of the light beforehand enters each one's uncertainty,
//! and may turn out to be the same in all). Then the distances to the arcs say by how much.

use super::linking::Spot;
use super::motion_model::FitPoint;
use super::segment::TrackSample;
use crate::frames::Coded;
use crate::numeric::robust::median;

/// A point's distance to its arc.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArcDistance {
    /// Squared, plane units².
    pub square: f64,
    /// Variance of each coordinate by the frame's own pixels, plane units².
    pub own: f64,
    /// How the frame is stored.
    pub coded: Coded,
    /// Part of the point's own error that its arc follows, 0..1.
    pub leverage: f64,
}

/// The centres' variances by what they scatter, for each kind of frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ExtraVariance {
    whole: KindVariance,
    predicted: KindVariance,
    interpolated: KindVariance,
}

/// The variance of the frames of one kind.
#[derive(Debug, Clone, Copy, PartialEq)]
struct KindVariance {
    /// Part of the centres' own variance, at most 1.
    own_part: f64,
    /// Variance beyond their own, plane units².
    more: f64,
}

impl Default for KindVariance {
    fn default() -> Self {
        Self {
            own_part: 1.0,
            more: 0.0,
        }
    }
}

/// Variances that differ by less than this part weigh points alike.
const CLOSE_PART: f64 = 1e-6;

/// Fewer points of a kind do not tell its variance; that of all kinds together has to do.
const LEAST_POINTS: usize = 12;

/// Median of the squared length of a plane vector whose coordinates are normal with variance 1.
const MEDIAN_SQUARE: f64 = 2.0 * std::f64::consts::LN_2;

impl ExtraVariance {
    /// The variance of a centre's coordinate whose own is `own`, plane units².
    #[must_use]
    pub fn variance(&self, own: f64, coded: Coded) -> f64 {
        let seen = self.of(coded);
        seen.own_part * own + seen.more
    }

    /// Whether both weigh points alike.
    #[must_use]
    pub fn is_close_to(&self, other: &Self) -> bool {
        let close = |a: f64, b: f64| (a - b).abs() <= CLOSE_PART * a.abs();
        [Coded::Whole, Coded::Predicted, Coded::Interpolated]
            .into_iter()
            .all(|coded| {
                let (a, b) = (self.of(coded), other.of(coded));
                close(a.own_part, b.own_part) && close(a.more, b.more)
            })
    }

    /// The variance of a spot's coordinate, plane units².
    #[must_use]
    pub fn variance_of(&self, spot: &Spot) -> f64 {
        self.variance(spot.std * spot.std, spot.coded)
    }

    /// A spot of an arc with its weight.
    #[must_use]
    pub fn fit_point(&self, spot: &Spot, arc: usize) -> FitPoint {
        let sample = TrackSample::of_spot(spot, 1.0 / self.variance_of(spot));
        FitPoint { arc, sample }
    }

    /// The variance beyond the own one, of frames of a kind, plane units².
    #[must_use]
    pub fn more(&self, coded: Coded) -> f64 {
        self.of(coded).more
    }

    fn of(&self, coded: Coded) -> KindVariance {
        match coded {
            Coded::Whole => self.whole,
            Coded::Predicted => self.predicted,
            Coded::Interpolated => self.interpolated,
        }
    }

    /// By medians: right also when a quarter of the points are somewhere else.
    #[must_use]
    pub fn robust(distances: &[ArcDistance]) -> Self {
        Self::by_kind(distances, false, |part, extra| {
            let mut squares: Vec<f64> = part
                .iter()
                .map(|d| d.square / ((1.0 - d.leverage) * (d.own + extra)))
                .collect();
            median(&mut squares).unwrap_or(0.0) / MEDIAN_SQUARE
        })
    }

    /// By mean squares: the most exact, once the outliers are out.
    #[must_use]
    pub fn efficient(distances: &[ArcDistance]) -> Self {
        Self::by_kind(distances, true, |part, extra| {
            let sum: f64 = part
                .iter()
                .map(|d| d.square / (2.0 * (1.0 - d.leverage) * (d.own + extra)))
                .sum();
            sum / part.len().max(1) as f64
        })
    }

    /// For each kind the variances for which `ratio` (of seen to expected squares) is 1. `all_count`: whether all distances
    /// enter it, so that it also tells of centres that are better than they say.
    fn by_kind(
        distances: &[ArcDistance],
        all_count: bool,
        ratio: impl Fn(&[ArcDistance], f64) -> f64,
    ) -> Self {
        let seen = |part: &[ArcDistance]| KindVariance {
            own_part: if all_count {
                better(ratio(part, 0.0), part.len())
            } else {
                1.0
            },
            more: balance(part, &ratio),
        };
        let all = seen(distances);
        let of = |coded: Coded| {
            let part: Vec<ArcDistance> = distances.iter().filter(|d| d.coded == coded).copied().collect();
            if part.len() < LEAST_POINTS {
                all
            } else {
                seen(&part)
            }
        };
        Self {
            whole: of(Coded::Whole),
            predicted: of(Coded::Predicted),
            interpolated: of(Coded::Interpolated),
        }
    }
}

/// The part of their own variance that `count` centres have, by the `ratio` of seen to expected squares: a mean of 2 n squares
/// is itself uncertain by its 1/√n, and what it could be by that is believed.
fn better(ratio: f64, count: usize) -> f64 {
    let relative_std = 1.0 / (count.max(1) as f64).sqrt();
    (ratio * (1.0 + relative_std)).clamp(LEAST_PART, 1.0)
}

/// No centre is better than by this part of its own variance.
const LEAST_PART: f64 = 0.25;

/// The least variance of at least 0 for which `ratio`, which falls as it grows, is no more than 1.
fn balance(part: &[ArcDistance], ratio: impl Fn(&[ArcDistance], f64) -> f64) -> f64 {
    if !(ratio(part, 0.0) > 1.0) {
        return 0.0;
    }
    let mut high = part.iter().map(|d| d.square).fold(0.0, f64::max);
    while ratio(part, high) > 1.0 && high.is_finite() {
        high *= 2.0;
    }
    let mut low = 0.0;
    // 40 halvings: to a millionth of a millionth of the largest.
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if ratio(part, middle) > 1.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::TestNoise;

    fn distances(count: usize, own: f64, extra: impl Fn(Coded) -> f64) -> Vec<ArcDistance> {
        let mut noise = TestNoise(1);
        (0..count)
            .map(|i| {
                let coded = if i % 3 == 0 {
                    Coded::Predicted
                } else {
                    Coded::Interpolated
                };
                let std = (own + extra(coded)).sqrt();
                let square = (std * noise.normal()).powi(2) + (std * noise.normal()).powi(2);
                ArcDistance {
                    square,
                    own,
                    coded,
                    leverage: 0.0,
                }
            })
            .collect()
    }

    #[test]
    fn each_kind_gets_the_variance_it_shows() {
        let true_extra = |c: Coded| if c == Coded::Predicted { 0.5 } else { 4.0 };
        let seen = distances(3000, 0.1, true_extra);
        for found in [ExtraVariance::robust(&seen), ExtraVariance::efficient(&seen)] {
            assert!(
                (found.more(Coded::Predicted) / 0.5 - 1.0).abs() < 0.15,
                "{found:?}"
            );
            assert!(
                (found.more(Coded::Interpolated) / 4.0 - 1.0).abs() < 0.15,
                "{found:?}"
            );
        }
    }

    #[test]
    fn centres_as_good_as_they_say_get_nothing_added() {
        let seen = distances(3000, 1.0, |_| 0.0);
        let found = ExtraVariance::efficient(&seen);
        assert!(
            found.more(Coded::Predicted) < 0.1 && found.more(Coded::Interpolated) < 0.1,
            "{found:?}"
        );
    }

    #[test]
    fn centres_that_are_better_than_they_say_are_believed_to_be_so() {
        let mut seen = distances(400, 1.0, |_| 0.0);
        for d in &mut seen {
            d.square *= 0.6;
        }
        let variance = ExtraVariance::efficient(&seen).variance(1.0, Coded::Interpolated);
        assert!((0.55..0.75).contains(&variance), "{variance}");
        // The fewer they are, the more is left for chance.
        assert!(better(0.6, 12) > better(0.6, 400) && better(0.6, 400) > 0.6);
        assert_eq!(ExtraVariance::robust(&seen).variance(1.0, Coded::Predicted), 1.0);
    }

    #[test]
    fn points_somewhere_else_do_not_fool_the_medians() {
        let mut seen = distances(300, 1.0, |_| 0.0);
        for d in seen.iter_mut().step_by(5) {
            d.square = 1e6;
        }
        assert!(ExtraVariance::robust(&seen).more(Coded::Interpolated) < 1.0);
    }

    #[test]
    fn nothing_seen_adds_nothing() {
        assert_eq!(ExtraVariance::robust(&[]), ExtraVariance::default());
    }
}
