//! Arcs of a ball seen from above, for the division of a track: linear least squares on running sums.
//!
//! With P = p − A the equation of [`super`] is linear in what an arc does not share with others (times t from the arc's
//! first point):
//!
//! ```text
//! P (1 + γ t²/2) = c0 + c1 t + ζ0 P + ω P t          and, of the apparent radius,    1 − r0/r + γ t²/2 = ζ0 + ω t
//! ```
//!
//! All columns are P t^k, so that sums of P t^k, P² t^k and t^k hold everything. The path alone does not tell ζ0 from the
//! scale of c0 and c1; the radius, rough as it is, does. It also tells a rise from a fall where the path is straight: near
//! the camera's nadir.

use super::camera::{NearTopView, SpatialMotion};
use crate::flight::planar::Motion;
use crate::flight::segment::{ArcSums, Stretch, TrackSample, divide};
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

/// An arc has at least so many points.
const LEAST_ARC_POINTS: usize = 4;

/// The cheapest division of a track into arcs, and what it costs.
pub(super) fn divided(samples: &[TrackSample], view: NearTopView) -> (Vec<Stretch>, f64) {
    divide(samples, LEAST_ARC_POINTS, |first| SpatialSums::new(view, first.t))
}

/// Sums over a stretch of samples.
pub struct SpatialSums {
    view: NearTopView,
    start: f64,
    /// Σ w t^k.
    t: [f64; 3],
    /// Σ w P t^k, right and up.
    p: [[f64; 4]; 2],
    /// Σ w P² t^k.
    pp: [f64; 5],
    /// Σ w_ζ t^k.
    n: [f64; 5],
    /// Σ w_ζ ζ t^k.
    z: [f64; 3],
    /// Σ w_ζ ζ².
    zz: f64,
}

impl SpatialSums {
    /// None yet, of a stretch that begins at time `start`.
    #[must_use]
    pub fn new(view: NearTopView, start: f64) -> Self {
        Self {
            view,
            start,
            t: [0.0; 3],
            p: [[0.0; 4]; 2],
            pp: [0.0; 5],
            n: [0.0; 5],
            z: [0.0; 3],
            zz: 0.0,
        }
    }

    /// Those of `samples`.
    #[must_use]
    pub fn of(view: NearTopView, samples: &[TrackSample]) -> Self {
        let mut sums = Self::new(view, samples.first().map_or(0.0, |s| s.t));
        samples.iter().for_each(|s| sums.add(s));
        sums
    }

    /// Products of the columns P t^i and P t^j, what 1 and t explain taken out.
    fn products(&self) -> Option<Matrix3<f64>> {
        let inverse = self.lines()?;
        Some(Matrix3::from_fn(|i, j| {
            let explained: f64 = (0..2)
                .map(|c| self.pair(c, i).dot(&(inverse * self.pair(c, j))))
                .sum();
            self.pp[i + j] - explained
        }))
    }

    /// Inverse of the normal matrix of 1 and t.
    fn lines(&self) -> Option<Matrix2<f64>> {
        Matrix2::new(self.t[0], self.t[1], self.t[1], self.t[2]).try_inverse()
    }

    fn pair(&self, coordinate: usize, power: usize) -> Vector2<f64> {
        Vector2::new(self.p[coordinate][power], self.p[coordinate][power + 1])
    }

    /// Normal matrix and right side for ζ0 and ω, and the squares to explain.
    fn normal(&self) -> Option<(Matrix2<f64>, Vector2<f64>, f64)> {
        let k = self.products()?;
        let (n, z, a) = (&self.n, &self.z, 0.5 * self.view.fall_per_s2);
        let matrix = Matrix2::new(
            k[(0, 0)] + n[0],
            k[(0, 1)] + n[1],
            k[(0, 1)] + n[1],
            k[(1, 1)] + n[2],
        );
        let right = Vector2::new(
            k[(0, 0)] + a * k[(0, 2)] + z[0] + a * n[2],
            k[(0, 1)] + a * k[(1, 2)] + z[1] + a * n[3],
        );
        let squares =
            k[(0, 0)] + 2.0 * a * k[(0, 2)] + a * a * k[(2, 2)] + self.zz + 2.0 * a * z[2] + a * a * n[4];
        Some((matrix, right, squares))
    }

    /// ζ0 and ω at the start.
    fn rise(&self) -> Option<Vector2<f64>> {
        let (matrix, right, _) = self.normal()?;
        Some(matrix.try_inverse()? * right)
    }

    /// The arc at time `t`; `None` below two times.
    #[must_use]
    pub fn motion_at(&self, t: f64) -> Option<SpatialMotion> {
        let rise = self.rise()?;
        let inverse = self.lines()?;
        let fall = self.view.fall_per_s2;
        let line = |c: usize| {
            let left = self.pair(c, 0) * (1.0 - rise[0]) - self.pair(c, 1) * rise[1]
                + self.pair(c, 2) * (0.5 * fall);
            inverse * left
        };
        let (r, h) = (line(0), line(1));
        let dt = t - self.start;
        Some(SpatialMotion {
            ground: Motion {
                r: self.view.nadir.right + r[0] + r[1] * dt,
                h: self.view.nadir.up + h[0] + h[1] * dt,
                vr: r[1],
                vh: h[1],
            },
            zeta: rise[0] + (rise[1] - 0.5 * fall * dt) * dt,
            rate: rise[1] - fall * dt,
        })
    }

    /// The stretch's own fall γ and its standard deviation; `None` where it does not show.
    #[must_use]
    pub fn own_fall(&self) -> Option<(f64, f64)> {
        let k = self.products()?;
        let (n, z) = (&self.n, &self.z);
        // The third column is −P t²/2, or −t²/2.
        let sign = [1.0, 1.0, -0.5];
        let matrix = Matrix3::from_fn(|i, j| sign[i] * sign[j] * (k[(i, j)] + n[i + j]));
        let right = Vector3::from_fn(|i, _| sign[i] * (k[(0, i)] + z[i]));
        let inverse = matrix.try_inverse()?;
        let (fall, variance) = ((inverse * right)[2], inverse[(2, 2)]);
        (variance > 0.0 && fall.is_finite()).then(|| (fall, variance.sqrt()))
    }
}

impl ArcSums for SpatialSums {
    fn add(&mut self, s: &TrackSample) {
        let t = s.t - self.start;
        let place = [s.r - self.view.nadir.right, s.h - self.view.nadir.up];
        let square = place[0] * place[0] + place[1] * place[1];
        let mut power = 1.0;
        for k in 0..5 {
            self.pp[k] += s.weight * square * power;
            self.n[k] += s.zeta_weight * power;
            if k < 4 {
                self.p[0][k] += s.weight * place[0] * power;
                self.p[1][k] += s.weight * place[1] * power;
            }
            if k < 3 {
                self.t[k] += s.weight * power;
                self.z[k] += s.zeta_weight * s.zeta * power;
            }
            power *= t;
        }
        self.zz += s.zeta_weight * s.zeta * s.zeta;
    }

    fn residual(&self) -> f64 {
        let Some((matrix, right, squares)) = self.normal() else {
            return 0.0;
        };
        let explained = matrix
            .try_inverse()
            .map_or(0.0, |inverse| right.dot(&(inverse * right)));
        (squares - explained).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::segment::falling;
    use crate::geometry::PlanePoint;

    const KNOWN: NearTopView = NearTopView {
        nadir: PlanePoint::new(540.0, 60.0),
        nadir_std: 1.0,
        fall_per_s2: 4.9,
        fall_relative_std: 0.01,
        height: Some(2500.0),
        contact: Some(0.006),
        drag: None,
        inertia_factor: 0.4,
    };

    /// Falls from 0.15 camera heights with `v`, bounces with e = 0.8 without any turn; 240 Hz.
    fn bounce(v: [f64; 2], from: [f64; 2]) -> Vec<TrackSample> {
        let hit = (2.0 * 0.144_f64 / 4.9).sqrt();
        (0..110)
            .map(|i| {
                let t = f64::from(i) / 240.0;
                let zeta = if t < hit {
                    0.15 - 2.45 * t * t
                } else {
                    0.006 + 0.8 * 4.9 * hit * (t - hit) - 2.45 * (t - hit).powi(2)
                };
                let at = |k: usize, nadir: f64| nadir + (from[k] + v[k] * t - nadir) / (1.0 - zeta);
                TrackSample {
                    t: t + 3600.0,
                    r: at(0, 540.0),
                    h: at(1, 60.0),
                    weight: 4.0,
                    zeta,
                    zeta_weight: 1000.0,
                }
            })
            .collect()
    }

    #[test]
    fn a_bounce_that_does_not_turn_is_two_arcs_all_the_same() {
        // The second goes straight through the camera's nadir, where the path is a straight line.
        for (v, from) in [([1500.0, 100.0], [0.0, 0.0]), ([1500.0, 0.0], [100.0, 60.0])] {
            let samples = bounce(v, from);
            let found = falling(divided(&samples, KNOWN).0);
            assert_eq!(found.len(), 2, "{found:?}");
            assert!((57..=60).contains(&found[0].end), "{found:?}");
            let a = SpatialSums::of(KNOWN, &samples[..58]).motion_at(3600.1).unwrap();
            assert!(
                (a.ground.vr - v[0]).abs() < 0.1 && (a.ground.vh - v[1]).abs() < 0.1,
                "{a:?}"
            );
            assert!((a.ground.r - from[0] - 0.1 * v[0]).abs() < 0.1, "{a:?}");
            assert!(
                (a.rate + 0.49).abs() < 1e-3 && (a.zeta - 0.1255).abs() < 1e-3,
                "{a:?}"
            );
            let (fall, std) = SpatialSums::of(KNOWN, &samples[..58]).own_fall().unwrap();
            assert!((fall - 4.9).abs() < 0.01 && std > 0.0, "{fall} {std}");
        }
    }
}
