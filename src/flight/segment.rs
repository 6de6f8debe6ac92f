//! Where a track falls freely: its division into arcs, by dynamic programming.
//!
//! A track of n points is cut into arcs (h quadratic in time, r linear) and single points that belong to none, such
//! that Σ squared residuals / σ² + a price an arc + a price a dropped point is least. All cuts are tried:
//! best(j) = min over i of best(i) + cost(i..j).
//!
//! Sums run over times and places relative to the arc's first point, so that no digits are lost at late times.

use super::overhead::{self, Overhead};

/// A point of a track: time, place along r (right) and h (up), 1/σ² of each coordinate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// s.
    pub t: f64,
    /// Plane units.
    pub r: f64,
    /// Plane units.
    pub h: f64,
    /// 1 / plane units².
    pub weight: f64,
    /// Of a camera above: how near the ball is by its apparent radius, 1 − r0/r, camera heights. Not looked at elsewhere.
    pub near: f64,
    /// 1 / camera heights².
    pub near_weight: f64,
}

/// Acceleration along h that the arcs have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fall {
    /// Each arc its own.
    Free,
    /// The same for all: h'' = −g, plane units/s² (0 in a top view).
    Known(f64),
    /// Towards the floor that a camera above looks at.
    Overhead(Overhead),
}

impl Fall {
    /// Whether an arc's own fall `g` ± `std` may be this one; drag and a tilted camera change it by a part.
    #[must_use]
    pub fn agrees(self, g: f64, std: f64) -> bool {
        match self {
            Self::Free => true,
            Self::Known(0.0) => g.abs() < 5.0 * std,
            Self::Known(common) => (g - common).abs() < 5.0 * std + 0.25 * common.abs(),
            Self::Overhead(o) => Self::Known(o.fall_per_s2).agrees(g, std),
        }
    }
}

/// What a new arc costs, in squared standard deviations: its four or five parameters and a margin.
const ARC_COST: f64 = 24.0;

/// What it costs to leave a point out: four standard deviations.
const DROP_COST: f64 = 16.0;

/// A residual's share of the cost ends here for a whole arc's mean, which bounds the search: an arc that fits worse
/// than all its points dropped is never best, nor is one that continues it by much.
const HOPELESS: f64 = 3.0;

/// The arcs of a track: half-open index ranges, in time order. `samples` are in time order.
#[must_use]
pub fn arcs(samples: &[Sample], fall: Fall) -> Vec<std::ops::Range<usize>> {
    divided(samples, fall).0
}

/// What the best division of a track costs: squared residuals in variances, and the prices of arcs and dropped points.
#[must_use]
pub fn cost(samples: &[Sample], fall: Fall) -> f64 {
    divided(samples, fall).1
}

fn divided(samples: &[Sample], fall: Fall) -> (Vec<std::ops::Range<usize>>, f64) {
    let falling = |first: &Sample| FallSums {
        sums: Sums::new(*first),
        fall,
    };
    match fall {
        Fall::Free => cut(samples, 5, falling),
        Fall::Known(_) => cut(samples, 3, falling),
        Fall::Overhead(known) => cut(samples, 4, |first| overhead::segment::Sums::new(known, first.t)),
    }
}

/// Running sums of a stretch of samples, and how badly the best arc through them fits.
pub trait ArcSums {
    /// One more sample.
    fn add(&mut self, sample: &Sample);
    /// Squared residuals of the best arc, in variances.
    fn residual(&self) -> f64;
}

struct FallSums {
    sums: Sums,
    fall: Fall,
}

impl ArcSums for FallSums {
    fn add(&mut self, sample: &Sample) {
        self.sums.add(sample);
    }

    fn residual(&self) -> f64 {
        self.sums.residual(self.fall)
    }
}

fn cut<S: ArcSums>(
    samples: &[Sample],
    least: usize,
    begin: impl Fn(&Sample) -> S,
) -> (Vec<std::ops::Range<usize>>, f64) {
    let n = samples.len();
    let mut best = vec![f64::INFINITY; n + 1];
    let mut from: Vec<Option<usize>> = vec![None; n + 1];
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
            let cost = sums.residual();
            let total = best[i] + cost + ARC_COST;
            if total < best[j + 1] {
                best[j + 1] = total;
                from[j + 1] = Some(i);
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
            Some(i) => {
                found.push(i..j);
                j = i;
            }
            None => j -= 1,
        }
    }
    found.reverse();
    (found, best[n])
}

/// Own fall of a stretch of samples: (g, its standard deviation), from a free parabola; `None` below 4 points.
#[must_use]
pub fn own_fall(samples: &[Sample]) -> Option<(f64, f64)> {
    if samples.len() < 4 {
        return None;
    }
    let mut sums = Sums::new(samples[0]);
    samples.iter().for_each(|s| sums.add(s));
    sums.own_fall()
}

/// Squared residuals of a stretch, in variances, with the best arc through it.
#[must_use]
pub fn misfit(samples: &[Sample], fall: Fall) -> f64 {
    let Some(first) = samples.first() else { return 0.0 };
    if let Fall::Overhead(known) = fall {
        return overhead::segment::Sums::of(known, samples).residual();
    }
    let mut sums = Sums::new(*first);
    samples.iter().for_each(|s| sums.add(s));
    sums.residual(fall)
}

/// Place (r, h) at `t` of the best arc through a stretch; `None` below two times.
#[must_use]
pub fn place(samples: &[Sample], fall: Fall, t: f64) -> Option<(f64, f64)> {
    let (vr, vh) = velocity(samples, fall, t)?;
    let mean = |f: fn(&Sample) -> f64| samples.iter().map(f).sum::<f64>() / samples.len() as f64;
    let (tm, rm, hm) = (mean(|s| s.t), mean(|s| s.r), mean(|s| s.h));
    let g = match fall {
        Fall::Known(g) => g,
        Fall::Free => own_fall(samples)?.0,
        Fall::Overhead(_) => return None,
    };
    // The best arc goes through the mean point, but for the curve's own mean.
    let bend = mean_square(samples, tm);
    let dt = t - tm;
    Some((rm + vr * dt, hm + 0.5 * g * bend + (vh + 0.5 * g * dt) * dt))
}

/// Mean of (t - tm)².
fn mean_square(samples: &[Sample], tm: f64) -> f64 {
    samples.iter().map(|s| (s.t - tm).powi(2)).sum::<f64>() / samples.len() as f64
}

/// Velocity (r, h) at `t` of the best arc through a stretch; `None` below two times.
#[must_use]
pub fn velocity(samples: &[Sample], fall: Fall, t: f64) -> Option<(f64, f64)> {
    let mut sums = Sums::new(*samples.first()?);
    samples.iter().for_each(|s| sums.add(s));
    let g = match fall {
        Fall::Known(g) => g,
        Fall::Free => sums.own_fall()?.0,
        Fall::Overhead(_) => return None,
    };
    let [s0, s1, s2, s3, _] = sums.t;
    let det = s0 * s2 - s1 * s1;
    let slope = |y0: f64, y1: f64| (s0 * y1 - s1 * y0) / det;
    let r = slope(sums.r[0], sums.r[1]);
    let h = slope(sums.h[0] + 0.5 * g * s2, sums.h[1] + 0.5 * g * s3) - g * (t - sums.origin.t);
    (det > 0.0).then_some((r, h))
}

/// Weighted sums relative to the first sample.
struct Sums {
    origin: Sample,
    t: [f64; 5],
    r: [f64; 2],
    rr: f64,
    h: [f64; 3],
    hh: f64,
}

impl Sums {
    fn new(origin: Sample) -> Self {
        Self {
            origin,
            t: [0.0; 5],
            r: [0.0; 2],
            rr: 0.0,
            h: [0.0; 3],
            hh: 0.0,
        }
    }

    fn add(&mut self, s: &Sample) {
        let t = s.t - self.origin.t;
        let (r, h, w) = (s.r - self.origin.r, s.h - self.origin.h, s.weight);
        let mut power = w;
        for k in 0..5 {
            self.t[k] += power;
            if k < 2 {
                self.r[k] += power * r;
            }
            if k < 3 {
                self.h[k] += power * h;
            }
            power *= t;
        }
        self.rr += w * r * r;
        self.hh += w * h * h;
    }

    fn residual(&self, fall: Fall) -> f64 {
        let along = linear_residual(&self.t, self.r, self.rr);
        let up = match fall {
            Fall::Known(g) => {
                // h + g t²/2 is a straight line.
                let a = 0.5 * g;
                let h = [self.h[0] + a * self.t[2], self.h[1] + a * self.t[3]];
                let hh = self.hh + 2.0 * a * self.h[2] + a * a * self.t[4];
                linear_residual(&self.t, h, hh)
            }
            // An overhead arc has sums of its own.
            Fall::Free | Fall::Overhead(_) => {
                let line = linear_residual(&self.t, [self.h[0], self.h[1]], self.hh);
                self.bend()
                    .map_or(line, |(b, information)| line - b * b * information)
            }
        };
        along + up.max(0.0)
    }

    /// Coefficient of t² after the straight line is taken out, and its information (1/variance).
    fn bend(&self) -> Option<(f64, f64)> {
        let [s0, s1, s2, s3, s4] = self.t;
        let det = s0 * s2 - s1 * s1;
        if !(det > 0.0) {
            return None;
        }
        // t² projected on 1 and t.
        let p = (s2 * s2 - s1 * s3) / det;
        let q = (s0 * s3 - s1 * s2) / det;
        let information = s4 - p * s2 - q * s3;
        let product = self.h[2] - p * self.h[0] - q * self.h[1];
        (information > 1e-12 * s4 && information > 0.0).then(|| (product / information, information))
    }

    fn own_fall(&self) -> Option<(f64, f64)> {
        self.bend()
            .map(|(b, information)| (-2.0 * b, 2.0 / information.sqrt()))
    }
}

fn linear_residual(t: &[f64; 5], y: [f64; 2], yy: f64) -> f64 {
    let det = t[0] * t[2] - t[1] * t[1];
    if !(det > 0.0) {
        return (yy - if t[0] > 0.0 { y[0] * y[0] / t[0] } else { 0.0 }).max(0.0);
    }
    let a = (t[2] * y[0] - t[1] * y[1]) / det;
    let b = (t[0] * y[1] - t[1] * y[0]) / det;
    (yy - a * y[0] - b * y[1]).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bounce(n: usize, t0: f64) -> Vec<Sample> {
        // 240 Hz, falls from h = 100 with v = 0, meets the floor at t = 0.4515, e = 0.8, g = 981.
        let hit = (2.0 * 100.0_f64 / 981.0).sqrt();
        (0..n)
            .map(|i| {
                let t = i as f64 / 240.0;
                let h = if t < hit {
                    100.0 - 490.5 * t * t
                } else {
                    let s = t - hit;
                    0.8 * 981.0 * hit * s - 490.5 * s * s
                };
                Sample {
                    t: t + t0,
                    r: 100.0 * t,
                    h,
                    weight: 400.0,
                    near: 0.0,
                    near_weight: 0.0,
                }
            })
            .collect()
    }

    #[test]
    fn a_bounce_is_two_arcs_at_any_time_of_day() {
        for t0 in [0.0, 3600.0, 1e6] {
            let samples = bounce(200, t0);
            for fall in [Fall::Free, Fall::Known(981.0)] {
                let found = arcs(&samples, fall);
                assert_eq!(found.len(), 2, "{fall:?} at {t0}: {found:?}");
                assert!((108..=109).contains(&found[0].end), "{found:?}");
            }
            let (g, std) = own_fall(&samples[..108]).unwrap();
            assert!((g - 981.0).abs() < 1e-2, "{g} at {t0}");
            assert!(std > 0.0);
        }
    }

    #[test]
    fn a_wild_point_is_dropped_and_does_not_split_the_arc_for_long() {
        let mut samples = bounce(200, 0.0);
        samples[50].h += 30.0;
        let found = arcs(&samples, Fall::Known(981.0));
        let covered: usize = found.iter().map(ExactSizeIterator::len).sum();
        assert_eq!(covered, 199, "{found:?}");
    }
}
