//! A scale that is not the same everywhere: the camera looks at the plane of motion at a slant, or the ball nears it.
//!
//! A length in the plane is seen divided by
//!
//! ```text
//! s = 1 + a (h − h₀) + b (r − r₀) + c (t − t₀)
//! ```
//!
//! about the place on the camera's axis and the middle of the flight's time: a and b are those of a slant, exact for a pinhole; c is that of a ball which leaves the
//! plane at a constant speed. The ball's own width goes as 1/s, which tells the three beside the path: under one constant fall only one s
//! makes parabolas of it.
//!
//! Assumed: the ball leaves the plane, if it does, at one speed for the whole flight; an impact may change that, and then it is a bend
//! ([`super::bend`]).

use super::planar::Motion;
use nalgebra::Matrix2;

/// Numbers of a change of scale: along h, along r, in time.
pub const SCALE_CHANGES: usize = 3;

/// A change of scale about the middle of a flight, and what is known of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScaleChange {
    /// r₀, h₀, plane units.
    pub place: (f64, f64),
    /// t₀, s.
    pub time_s: f64,
    /// a, b (1 / plane unit) and c (1/s), each with its standard uncertainty.
    pub known: [(f64, f64); SCALE_CHANGES],
}

impl ScaleChange {
    fn divisor(&self, [up, right, time]: [f64; SCALE_CHANGES], t: f64, m: &Motion) -> f64 {
        1.0 + up * (m.h - self.place.1) + right * (m.r - self.place.0) + time * (t - self.time_s)
    }

    /// How a motion in the plane is seen.
    #[must_use]
    pub fn seen(&self, change: [f64; SCALE_CHANGES], t: f64, m: &Motion) -> Motion {
        let s = self.divisor(change, t, m);
        let (dr, dh) = (m.r - self.place.0, m.h - self.place.1);
        let rate = change[0] * m.vh + change[1] * m.vr + change[2];
        Motion {
            r: self.place.0 + dr / s,
            h: self.place.1 + dh / s,
            vr: m.vr / s - dr * rate / (s * s),
            vh: m.vh / s - dh * rate / (s * s),
        }
    }

    /// The place (r, h) in the plane that is seen at (r, h).
    #[must_use]
    pub fn place_in_plane(
        &self,
        [up, right, time]: [f64; SCALE_CHANGES],
        t: f64,
        (r, h): (f64, f64),
    ) -> (f64, f64) {
        let (dr, dh) = (r - self.place.0, h - self.place.1);
        let s = (1.0 + time * (t - self.time_s)) / (1.0 - up * dh - right * dr);
        (self.place.0 + dr * s, self.place.1 + dh * s)
    }

    /// How the place seen follows the place in the plane: rows and columns r, h.
    #[must_use]
    pub fn jacobian(&self, change: [f64; SCALE_CHANGES], t: f64, m: &Motion) -> Matrix2<f64> {
        let s = self.divisor(change, t, m);
        let (dr, dh) = (m.r - self.place.0, m.h - self.place.1);
        let [up, right, _] = change;
        Matrix2::new(s - dr * right, -dr * up, -dh * right, s - dh * up) / (s * s)
    }

    /// How the place seen (r, h) follows each of the three numbers.
    #[must_use]
    pub fn slopes(&self, change: [f64; SCALE_CHANGES], t: f64, m: &Motion) -> [(f64, f64); SCALE_CHANGES] {
        let s = self.divisor(change, t, m);
        let (dr, dh) = (m.r - self.place.0, m.h - self.place.1);
        [dh, dr, t - self.time_s].map(|x| (-dr * x / (s * s), -dh * x / (s * s)))
    }

    /// The numbers in a vector of parameters, whose last they are.
    #[must_use]
    pub fn of(parameters: &[f64]) -> [f64; SCALE_CHANGES] {
        let from = parameters.len() - SCALE_CHANGES;
        std::array::from_fn(|k| parameters[from + k])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_are_those_of_what_is_seen() {
        let change = ScaleChange {
            place: (3.0, -2.0),
            time_s: 0.2,
            known: [(0.0, 1.0); 3],
        };
        let m = Motion {
            r: 5.0,
            h: 4.0,
            vr: 1.5,
            vh: -2.5,
        };
        let now = [0.01, -0.02, 0.1];
        let (t, step) = (0.7, 1e-6);
        let at = |now, m: &Motion, t| change.seen(now, t, m);
        let here = at(now, &m, t);
        for (k, (dr, dh)) in change.slopes(now, t, &m).into_iter().enumerate() {
            let mut moved = now;
            moved[k] += step;
            let there = at(moved, &m, t);
            assert!(
                ((there.r - here.r) / step - dr).abs() < 1e-3
                    && ((there.h - here.h) / step - dh).abs() < 1e-3
            );
        }
        let jacobian = change.jacobian(now, t, &m);
        let right = at(now, &Motion { r: m.r + step, ..m }, t);
        let up = at(now, &Motion { h: m.h + step, ..m }, t);
        assert!(((right.r - here.r) / step - jacobian[(0, 0)]).abs() < 1e-6);
        assert!(((right.h - here.h) / step - jacobian[(1, 0)]).abs() < 1e-6);
        assert!(((up.r - here.r) / step - jacobian[(0, 1)]).abs() < 1e-6);
        assert!(((up.h - here.h) / step - jacobian[(1, 1)]).abs() < 1e-6);
        let (r, h) = change.place_in_plane(now, t, (here.r, here.h));
        assert!((r - m.r).abs() < 1e-12 && (h - m.h).abs() < 1e-12);
        // The velocity seen is the rate of the place seen.
        let later = Motion {
            r: m.r + step * m.vr,
            h: m.h + step * m.vh,
            ..m
        };
        let there = at(now, &later, t + step);
        assert!(((there.r - here.r) / step - here.vr).abs() < 1e-5);
        assert!(((there.h - here.h) / step - here.vh).abs() < 1e-5);
    }
}
