//! The division of a track into arcs, by dynamic programming, whatever moves along an arc ([`ArcSums`]).
//!
//! A track of n points is cut into arcs of free fall, stretches of straight motion at constant speed (a ball that rolls on
//! a bench or on the floor) and single points that belong to none, such that Σ squared residuals / σ² + a price a stretch +
//! a price a dropped point is least. All cuts are tried: best(j) = min over i of best(i) + cost(i..j).

use super::linking::Spot;
use std::ops::Range;

/// A point of a track: time, place along r (right) and h (up), 1/σ² of each coordinate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackSample {
    /// s.
    pub t: f64,
    /// Plane units.
    pub r: f64,
    /// Plane units.
    pub h: f64,
    /// 1 / plane units².
    pub weight: f64,
    /// ζ by the apparent radius r, 1 − r0/r, camera heights: only a camera near above uses it.
    pub zeta: f64,
    /// 1 / camera heights².
    pub zeta_weight: f64,
}

impl TrackSample {
    /// A point of the plane at `time_s` that says nothing of its height above it.
    #[must_use]
    pub const fn new(time_s: f64, (r, h): (f64, f64), weight: f64) -> Self {
        Self {
            t: time_s,
            r,
            h,
            weight,
            zeta: 0.0,
            zeta_weight: 0.0,
        }
    }

    /// A spot's time and place with a weight.
    #[must_use]
    pub const fn of_spot(spot: &Spot, weight: f64) -> Self {
        Self::new(spot.time_s, (spot.place.right, spot.place.up), weight)
    }
}

/// What a new arc costs, in squared standard deviations: its four or five parameters and a margin.
pub const ARC_COST: f64 = 24.0;

/// What it costs to leave a point out: four standard deviations.
pub const DROP_COST: f64 = 16.0;

/// A residual's share of the cost ends here for a whole arc's mean, which bounds the search: an arc that fits worse
/// than all its points dropped is never best, nor is one that continues it by much.
const HOPELESS: f64 = 3.0;

/// A straight stretch has to be as long as this, and fit better by this many squared standard deviations than free fall
/// does: what a few points do not tell apart counts as flight until their centres are known better.
const LEAST_STRAIGHT_POINTS: usize = 5;
const STRAIGHT_COST: f64 = 16.0;

/// What a stretch of a track is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StretchKind {
    /// Free fall.
    Falling,
    /// At constant velocity, where other stretches fall: on a bench, on the floor.
    Straight,
}

/// A part of a track with one kind of motion: a half-open range of its samples.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Stretch {
    /// Which samples.
    pub range: Range<usize>,
    /// How they move.
    pub kind: StretchKind,
}

/// Running sums of a stretch of samples, and how badly the best arc through them fits.
pub trait ArcSums {
    /// One more sample.
    fn add(&mut self, sample: &TrackSample);
    /// Squared residuals of the best arc, in variances.
    fn residual(&self) -> f64;
    /// The same of the best straight stretch; `None` where arcs themselves may be straight.
    fn straight_residual(&self) -> Option<f64> {
        None
    }
}

/// The cheapest division of `samples` (in time order) into stretches, in time order, and what it costs: squared residuals in
/// variances, and the prices of arcs and dropped points. An arc has at least `least` points; `begin` are its sums before the
/// first of them.
pub fn divide<S: ArcSums>(
    samples: &[TrackSample],
    least: usize,
    begin: impl Fn(&TrackSample) -> S,
) -> (Vec<Stretch>, f64) {
    let n = samples.len();
    let mut best = vec![f64::INFINITY; n + 1];
    let mut from: Vec<Option<(usize, StretchKind)>> = vec![None; n + 1];
    best[0] = 0.0;
    for i in 0..n {
        let dropped = best[i] + DROP_COST;
        if dropped < best[i + 1] {
            best[i + 1] = dropped;
            from[i + 1] = None;
        }
        let mut sums = begin(&samples[i]);
        for (j, sample) in samples.iter().enumerate().skip(i) {
            sums.add(sample);
            let count = j + 1 - i;
            if count < least {
                continue;
            }
            let mut cost = sums.residual();
            let mut kind = StretchKind::Falling;
            if count >= LEAST_STRAIGHT_POINTS
                && let Some(straight) = sums.straight_residual().map(|s| s + STRAIGHT_COST)
                && straight < cost
            {
                (cost, kind) = (straight, StretchKind::Straight);
            }
            let total = best[i] + cost + ARC_COST;
            if total < best[j + 1] {
                best[j + 1] = total;
                from[j + 1] = Some((i, kind));
            }
            if count > 12 && cost > HOPELESS * DROP_COST * count as f64 {
                break;
            }
        }
    }
    let mut found = Vec::new();
    let mut j = n;
    while j > 0 {
        match from[j] {
            Some((i, kind)) => {
                found.push(Stretch { range: i..j, kind });
                j = i;
            }
            None => j -= 1,
        }
    }
    found.reverse();
    (found, best[n])
}

/// The stretches that fall.
pub(super) fn falling(stretches: Vec<Stretch>) -> Vec<Range<usize>> {
    let falling = stretches.into_iter().filter(|s| s.kind == StretchKind::Falling);
    falling.map(|s| s.range).collect()
}
