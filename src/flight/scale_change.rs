//! A scale that is not the same everywhere: the camera looks at the plane of motion at a slant, or the ball nears it.
//!
//! With d the way from the place P on the camera's axis, G = (b, a) the slant's tangent over the camera's distance D, along r and h:
//!
//! ```text
//! seen = P + p / (S s)     p = d − G (G·d) (1 − cos θ)/|G|²     s = 1 + G·p + c (t − t₀)     tan θ = D |G|
//! ```
//!
//! That is a pinhole's picture of a plane that is turned by θ: p is d without the part of it that points away from the camera, so that lengths along
//! the slant are seen shorter by cos θ. c is that of a ball which leaves the plane at a constant speed. S is 1 where the calibrated
//! length was measured at P, and else tells where it was.
//!
//! The bend of the path under one constant fall tells G and c, and so does the ball's own width, which goes as 1/s. S and D it does not tell: they are known
//! beforehand ([`ScaleChange::known`]), and by gravity, where its size is known ([`ScaleChange::fall`]): the arcs must fall with it.
//!
//! Assumed: the ball leaves the plane, if it does, at one speed for the whole flight; an impact may change that, and then it is a bend
//! ([`super::bend`]).

use super::planar::Motion;
use nalgebra::{Matrix2, Vector2};

/// Numbers of a change of scale: a along h, b along r, c in time, ln S, and the logarithm of the camera's distance over the one it is taken
/// to have.
pub const SCALE_CHANGES: usize = 5;

/// Index of ln S among them.
pub const WHOLE: usize = 3;
/// Index of the camera's distance.
pub const DISTANCE: usize = 4;

/// A change of scale about the middle of a flight, and what is known of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScaleChange {
    /// r₀, h₀ of P, plane units.
    pub place: (f64, f64),
    /// t₀, s.
    pub time_s: f64,
    /// The camera's distance as far as it is known, plane units.
    pub distance: f64,
    /// a, b (1 / plane unit), c (1/s), ln S and that of the distance over [`Self::distance`], each with its standard uncertainty.
    pub known: [(f64, f64); SCALE_CHANGES],
    /// Gravity with its standard uncertainty, plane units/s²; `None` where it is not to tell lengths.
    pub fall: Option<(f64, f64)>,
}

/// The slant at some numbers: what is seen of a way in the plane.
struct Slant {
    /// G, along (r, h).
    tangent: Vector2<f64>,
    /// (1 − cos θ)/|G|², its derivative by |G|², and (1/cos θ − 1)/|G|².
    less: f64,
    less_rate: f64,
    more: f64,
}

impl Slant {
    fn new([up, right, _, _, farther]: [f64; SCALE_CHANGES], distance: f64) -> Self {
        let tangent = Vector2::new(right, up);
        let squared_distance = (distance * farther.exp()).powi(2);
        // 1 / cos θ
        let secant = (1.0 + squared_distance * tangent.norm_squared()).sqrt();
        let part = 1.0 / (secant * (secant + 1.0));
        Self {
            tangent,
            less: squared_distance * part,
            less_rate: -squared_distance * squared_distance * part * part * (2.0 * secant + 1.0)
                / (2.0 * secant),
            more: squared_distance / (secant + 1.0),
        }
    }

    /// From a way in the plane to that across the camera's axis.
    fn across(&self) -> Matrix2<f64> {
        Matrix2::identity() - self.less * self.tangent * self.tangent.transpose()
    }

    /// And back.
    fn in_plane(&self) -> Matrix2<f64> {
        Matrix2::identity() + self.more * self.tangent * self.tangent.transpose()
    }
}

/// A way across the camera's axis and by what it is divided to be seen.
struct Seen {
    slant: Slant,
    /// From P, in the plane and across the axis.
    way: Vector2<f64>,
    across: Vector2<f64>,
    /// s
    divisor: f64,
    /// S
    whole: f64,
}

impl ScaleChange {
    fn at(&self, now: [f64; SCALE_CHANGES], t: f64, m: &Motion) -> Seen {
        let slant = Slant::new(now, self.distance);
        let way = Vector2::new(m.r - self.place.0, m.h - self.place.1);
        let across = slant.across() * way;
        Seen {
            divisor: 1.0 + slant.tangent.dot(&across) + now[2] * (t - self.time_s),
            slant,
            way,
            across,
            whole: now[3].exp(),
        }
    }

    /// How a motion in the plane is seen.
    #[must_use]
    pub fn seen(&self, now: [f64; SCALE_CHANGES], t: f64, m: &Motion) -> Motion {
        let s = self.at(now, t, m);
        let place = s.across / (s.divisor * s.whole);
        let velocity =
            s.jacobian() * Vector2::new(m.vr, m.vh) - s.across * (now[2] / (s.divisor * s.divisor * s.whole));
        Motion {
            r: self.place.0 + place.x,
            h: self.place.1 + place.y,
            vr: velocity.x,
            vh: velocity.y,
        }
    }

    /// The place (r, h) in the plane that is seen at (r, h).
    #[must_use]
    pub fn place_in_plane(&self, now: [f64; SCALE_CHANGES], t: f64, (r, h): (f64, f64)) -> (f64, f64) {
        let slant = Slant::new(now, self.distance);
        let seen = Vector2::new(r - self.place.0, h - self.place.1) * now[3].exp();
        let divisor = (1.0 + now[2] * (t - self.time_s)) / (1.0 - slant.tangent.dot(&seen));
        let way = slant.in_plane() * (seen * divisor);
        (self.place.0 + way.x, self.place.1 + way.y)
    }

    /// How the place seen follows the place in the plane: rows and columns r, h.
    #[must_use]
    pub fn jacobian(&self, now: [f64; SCALE_CHANGES], t: f64, m: &Motion) -> Matrix2<f64> {
        self.at(now, t, m).jacobian()
    }

    /// How much larger the ball itself is seen than at P in the plane.
    #[must_use]
    pub fn magnification(&self, now: [f64; SCALE_CHANGES], t: f64, m: &Motion) -> f64 {
        let s = self.at(now, t, m);
        1.0 / (s.divisor * s.whole)
    }

    /// How the place seen (r, h) follows each of the numbers.
    #[must_use]
    pub fn slopes(&self, now: [f64; SCALE_CHANGES], t: f64, m: &Motion) -> [(f64, f64); SCALE_CHANGES] {
        let s = self.at(now, t, m);
        let (tangent, along) = (s.slant.tangent, s.slant.tangent.dot(&s.way));
        let of = |across: Vector2<f64>, divisor: f64| {
            let slope = (across - s.across * (divisor / s.divisor)) / (s.divisor * s.whole);
            (slope.x, slope.y)
        };
        let of_tangent = |i: usize| {
            let mut unit = Vector2::zeros();
            unit[i] = 1.0;
            let across = -2.0 * tangent[i] * s.slant.less_rate * along * tangent
                - s.slant.less * (unit * along + tangent * s.way[i]);
            of(across, s.across[i] + tangent.dot(&across))
        };
        // By ln D at a fixed tangent: `less` is D² times a function of D²|G|².
        let farther = 2.0 * (s.slant.less + s.slant.less_rate * tangent.norm_squared());
        let by_distance = -farther * along * tangent;
        let seen = s.across / (s.divisor * s.whole);
        [
            of_tangent(1),
            of_tangent(0),
            of(Vector2::zeros(), t - self.time_s),
            (-seen.x, -seen.y),
            of(by_distance, tangent.dot(&by_distance)),
        ]
    }

    /// The numbers in a vector of parameters, whose last they are.
    #[must_use]
    pub fn of(parameters: &[f64]) -> [f64; SCALE_CHANGES] {
        let from = parameters.len() - SCALE_CHANGES;
        std::array::from_fn(|k| parameters[from + k])
    }
}

impl Seen {
    fn jacobian(&self) -> Matrix2<f64> {
        let across = self.slant.across();
        let divisor = self.slant.tangent.transpose() * across;
        (across - self.across * divisor / self.divisor) / (self.divisor * self.whole)
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
            distance: 20.0,
            known: [(0.0, 1.0); SCALE_CHANGES],
            fall: None,
        };
        let m = Motion {
            r: 5.0,
            h: 4.0,
            vr: 1.5,
            vh: -2.5,
        };
        let now = [0.01, -0.02, 0.1, 0.03, -0.2];
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
