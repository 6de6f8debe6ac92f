//! Parabolas through stretches of a track, by running sums: the arcs of a ball seen from the side or from far above.
//!
//! While the fall is not known, an arc has its own along h (and along r, where the camera may lean); a straight stretch is
//! then an arc without one. Sums run over times and places relative to the arc's first point, so that no digits are lost at
//! late times.

use super::segment::{ArcSums, Stretch, TrackSample, divide, falling};
use std::ops::Range;

/// The acceleration of a free fall as the plane shows it, plane units/s².
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gravity {
    /// Against h: h'' = −down.
    pub down: f64,
    /// Along r, where the picture's "up" is not the plane's.
    pub across: f64,
}

impl Gravity {
    /// None: a top view.
    pub const NONE: Self = Self {
        down: 0.0,
        across: 0.0,
    };

    /// Against h alone.
    #[must_use]
    pub const fn upright(down: f64) -> Self {
        Self { down, across: 0.0 }
    }
}

/// Acceleration that the arcs have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fall {
    /// Each arc its own along h; along r, too, where the fall may lean.
    Free {
        /// Whether it may.
        leaning: bool,
    },
    /// The same for all.
    Known(Gravity),
}

impl Fall {
    /// Whether an arc's own fall `g` ± `std` may be this one; drag and a tilted camera change it by a part.
    #[must_use]
    pub fn agrees(self, g: f64, std: f64) -> bool {
        match self {
            Self::Free { .. } => true,
            Self::Known(Gravity { down: 0.0, .. }) => g.abs() < 5.0 * std,
            Self::Known(common) => (g - common.down).abs() < 5.0 * std + 0.25 * common.down.abs(),
        }
    }
}

/// The stretches of a track, in time order, and what that division costs; see [`divide`]. `samples` are in time order.
#[must_use]
pub fn division(samples: &[TrackSample], fall: Fall) -> (Vec<Stretch>, f64) {
    let least = match fall {
        Fall::Free { .. } => 5,
        Fall::Known(_) => 3,
    };
    divide(samples, least, |first| ParabolaSums::new(*first, fall))
}

/// The stretches of a track, in time order. `samples` are in time order.
#[must_use]
pub fn stretches(samples: &[TrackSample], fall: Fall) -> Vec<Stretch> {
    division(samples, fall).0
}

/// The arcs of a track: those of its stretches that fall.
#[must_use]
pub fn arcs(samples: &[TrackSample], fall: Fall) -> Vec<Range<usize>> {
    falling(stretches(samples, fall))
}

/// A bench or a floor rises by no more than this part of the way along it.
const LEVEL_PART: f64 = 0.2;

/// Own fall of a stretch of samples: (g, its standard deviation), from a free parabola; `None` below 4 points.
#[must_use]
pub fn own_fall(samples: &[TrackSample]) -> Option<(f64, f64)> {
    own_gravity(samples).map(|(g, std)| (g.down, std))
}

/// Own acceleration of a stretch of samples along both axes, and the standard deviation of each, from a free parabola;
/// `None` below 4 points.
#[must_use]
pub fn own_gravity(samples: &[TrackSample]) -> Option<(Gravity, f64)> {
    if samples.len() < 4 {
        return None;
    }
    ParabolaSums::of(samples, Fall::Free { leaning: true })?.own_gravity()
}

/// Squared residuals of a stretch, in variances, with the best arc through it.
#[must_use]
pub fn misfit(samples: &[TrackSample], fall: Fall) -> f64 {
    ParabolaSums::of(samples, fall).map_or(0.0, |sums| sums.residual())
}

/// Place (r, h) at `t` of the best arc with fall `g` through a stretch; `None` below two times.
#[must_use]
pub fn place(samples: &[TrackSample], g: Gravity, t: f64) -> Option<(f64, f64)> {
    let (vr, vh) = velocity(samples, g, t)?;
    let mean = |f: fn(&TrackSample) -> f64| samples.iter().map(f).sum::<f64>() / samples.len() as f64;
    let (tm, rm, hm) = (mean(|s| s.t), mean(|s| s.r), mean(|s| s.h));
    // The best arc goes through the mean point, but for the curve's own mean.
    let bend = samples.iter().map(|s| (s.t - tm).powi(2)).sum::<f64>() / samples.len() as f64;
    let dt = t - tm;
    let at = |mean: f64, v: f64, a: f64| mean - 0.5 * a * bend + (v - 0.5 * a * dt) * dt;
    Some((at(rm, vr, g.across), at(hm, vh, -g.down)))
}

/// Velocity (r, h) at `t` of the best arc with fall `g` through a stretch; `None` below two times.
#[must_use]
pub fn velocity(samples: &[TrackSample], g: Gravity, t: f64) -> Option<(f64, f64)> {
    let sums = ParabolaSums::of(samples, Fall::Known(g))?;
    let [s0, s1, s2, s3, _] = sums.t;
    let det = s0 * s2 - s1 * s1;
    // Without the curve the rest is a straight line.
    let slope = |y: &[f64; 3], a: f64| {
        let (y0, y1) = (y[0] - 0.5 * a * s2, y[1] - 0.5 * a * s3);
        (s0 * y1 - s1 * y0) / det + a * (t - sums.origin.t)
    };
    (det > 0.0).then(|| (slope(&sums.r, g.across), slope(&sums.h, -g.down)))
}

/// Weighted sums relative to the first sample.
struct ParabolaSums {
    fall: Fall,
    origin: TrackSample,
    /// From the first sample to the last, s.
    duration: f64,
    count: f64,
    t: [f64; 5],
    r: [f64; 3],
    rr: f64,
    h: [f64; 3],
    hh: f64,
}

impl ArcSums for ParabolaSums {
    fn add(&mut self, s: &TrackSample) {
        let t = s.t - self.origin.t;
        let (r, h, w) = (s.r - self.origin.r, s.h - self.origin.h, s.weight);
        self.duration = t;
        self.count += 1.0;
        let mut power = w;
        for k in 0..5 {
            self.t[k] += power;
            if k < 3 {
                self.r[k] += power * r;
                self.h[k] += power * h;
            }
            power *= t;
        }
        self.rr += w * r * r;
        self.hh += w * h * h;
    }

    fn residual(&self) -> f64 {
        match self.fall {
            Fall::Known(g) => self.residual_under(g),
            Fall::Free { leaning } => {
                let along = if leaning {
                    self.free_residual(&self.r, self.rr)
                } else {
                    self.known_residual(&self.r, self.rr, 0.0)
                };
                along + self.free_residual(&self.h, self.hh)
            }
        }
    }

    fn straight_residual(&self) -> Option<f64> {
        let Fall::Known(g) = self.fall else { return None };
        let size = g.down.hypot(g.across);
        if !(size > 0.0) {
            return None;
        }
        let (vr, vh) = self.line_velocity()?;
        let rise = (vr * g.across - vh * g.down) / size;
        let along = (vr * g.down + vh * g.across) / size;
        // To three standard deviations of a point: a ball that is held moves neither way.
        let slack = 3.0 / (self.t[0] / self.count).sqrt();
        let level = rise.abs() * self.duration <= LEVEL_PART * along.abs() * self.duration + slack;
        level.then(|| self.residual_under(Gravity::NONE))
    }
}

impl ParabolaSums {
    fn new(origin: TrackSample, fall: Fall) -> Self {
        Self {
            fall,
            origin,
            duration: 0.0,
            count: 0.0,
            t: [0.0; 5],
            r: [0.0; 3],
            rr: 0.0,
            h: [0.0; 3],
            hh: 0.0,
        }
    }

    /// Of all `samples`; `None` where there are none.
    fn of(samples: &[TrackSample], fall: Fall) -> Option<Self> {
        let mut sums = Self::new(*samples.first()?, fall);
        samples.iter().for_each(|s| sums.add(s));
        Some(sums)
    }

    /// Squared residuals of the best arc with this fall.
    fn residual_under(&self, g: Gravity) -> f64 {
        self.known_residual(&self.r, self.rr, g.across) + self.known_residual(&self.h, self.hh, -g.down)
    }

    /// Squared residuals of a coordinate whose acceleration is `a`: y − a t²/2 is a straight line.
    fn known_residual(&self, y: &[f64; 3], yy: f64, a: f64) -> f64 {
        let half = 0.5 * a;
        let line = [y[0] - half * self.t[2], y[1] - half * self.t[3]];
        linear_residual(&self.t, line, yy - 2.0 * half * y[2] + half * half * self.t[4])
    }

    /// Squared residuals of a coordinate with an acceleration of its own.
    fn free_residual(&self, y: &[f64; 3], yy: f64) -> f64 {
        let line = linear_residual(&self.t, [y[0], y[1]], yy);
        self.bend(y)
            .map_or(line, |(b, information)| line - b * b * information)
            .max(0.0)
    }

    /// A coordinate's coefficient of t² after the straight line is taken out, and its information (1/variance).
    fn bend(&self, y: &[f64; 3]) -> Option<(f64, f64)> {
        let [s0, s1, s2, s3, s4] = self.t;
        let det = s0 * s2 - s1 * s1;
        if !(det > 0.0) {
            return None;
        }
        // t² projected on 1 and t.
        let p = (s2 * s2 - s1 * s3) / det;
        let q = (s0 * s3 - s1 * s2) / det;
        let information = s4 - p * s2 - q * s3;
        let product = y[2] - p * y[0] - q * y[1];
        (information > 1e-12 * s4 && information > 0.0).then(|| (product / information, information))
    }

    /// Velocity of the best straight line.
    fn line_velocity(&self) -> Option<(f64, f64)> {
        let [s0, s1, s2, ..] = self.t;
        let det = s0 * s2 - s1 * s1;
        let slope = |y: &[f64; 3]| (s0 * y[1] - s1 * y[0]) / det;
        (det > 0.0).then(|| (slope(&self.r), slope(&self.h)))
    }

    fn own_gravity(&self) -> Option<(Gravity, f64)> {
        let (across, _) = self.bend(&self.r)?;
        let (up, information) = self.bend(&self.h)?;
        let gravity = Gravity {
            down: -2.0 * up,
            across: 2.0 * across,
        };
        Some((gravity, 2.0 / information.sqrt()))
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
    use crate::flight::segment::StretchKind;

    fn bounce(n: usize, t0: f64) -> Vec<TrackSample> {
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
                TrackSample::new(t + t0, (100.0 * t, h), 400.0)
            })
            .collect()
    }

    #[test]
    fn a_bounce_is_two_arcs_at_any_time_of_day() {
        for t0 in [0.0, 3600.0, 1e6] {
            let samples = bounce(200, t0);
            for fall in [
                Fall::Free { leaning: false },
                Fall::Known(Gravity::upright(981.0)),
            ] {
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
    fn a_ball_that_rolls_before_it_falls_and_after_it_bounced_is_no_arc() {
        // On a bench at h = 100 for 40 frames, then as `bounce`, then along the floor.
        let falls = bounce(200, 0.0);
        let end = falls[199];
        let rolls = |i: f64, h: f64| TrackSample {
            t: end.t + i / 240.0,
            r: end.r + 100.0 * i / 240.0,
            h,
            ..end
        };
        let before = (-40..0).map(|i| rolls(f64::from(i) - 199.0, 100.0));
        let after = (1..41).map(|i| rolls(f64::from(i), 0.0));
        let samples: Vec<TrackSample> = before.chain(falls).chain(after).collect();
        let found = stretches(&samples, Fall::Known(Gravity::upright(981.0)));
        let kinds: Vec<StretchKind> = found.iter().map(|s| s.kind).collect();
        let (f, s) = (StretchKind::Falling, StretchKind::Straight);
        assert_eq!(kinds, [s, f, f, s], "{found:?}");
        assert!((38..=46).contains(&found[0].range.end), "{found:?}");
    }

    #[test]
    fn a_leaning_fall_is_cut_as_an_upright_one() {
        let mut samples = bounce(200, 0.0);
        let (sin, cos) = 0.1_f64.sin_cos();
        for s in &mut samples {
            (s.r, s.h) = (s.r * cos + s.h * sin, s.h * cos - s.r * sin);
        }
        let fall = Gravity {
            down: 981.0 * cos,
            across: -981.0 * sin,
        };
        for fall in [Fall::Free { leaning: true }, Fall::Known(fall)] {
            let found = arcs(&samples, fall);
            assert_eq!(found.len(), 2, "{found:?}");
            let g = match fall {
                Fall::Known(g) => g,
                Fall::Free { .. } => own_gravity(&samples[..100]).unwrap().0,
            };
            let (v, w) = (
                velocity(&samples[..100], g, 0.2).unwrap(),
                place(&samples[..100], g, 0.2).unwrap(),
            );
            let (vr, vh) = (100.0 * cos - 196.2 * sin, -196.2 * cos - 100.0 * sin);
            assert!((v.0 - vr).abs() < 1e-6 && (v.1 - vh).abs() < 1e-6, "{v:?}");
            let (r, h) = (20.0, 100.0 - 490.5 * 0.04);
            assert!((w.0 - (r * cos + h * sin)).abs() < 1e-6 && (w.1 - (h * cos - r * sin)).abs() < 1e-6);
        }
        let (own, _) = own_gravity(&samples[..100]).unwrap();
        assert!((own.across - fall.across).abs() < 1e-5, "{own:?}");
    }

    #[test]
    fn a_wild_point_is_dropped_and_does_not_split_the_arc_for_long() {
        let mut samples = bounce(200, 0.0);
        samples[50].h += 30.0;
        let found = arcs(&samples, Fall::Known(Gravity::upright(981.0)));
        let covered: usize = found.iter().map(ExactSizeIterator::len).sum();
        assert_eq!(covered, 199, "{found:?}");
    }
}
