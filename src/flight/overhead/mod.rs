//! Flight seen from above by a camera near enough to matter: three dimensions from two.
//!
//! The camera is a pinhole at height D over the floor, straight above the floor's point A (its nadir). A ball above the
//! floor's point q, with its centre at height z = ζ D, is seen against the floor at
//!
//! ```text
//! p = A + (q − A)/(1 − ζ)          (q, D ζ)'' = −(0, 0, g) − β |v| v + s × v          γ = g/D
//! ```
//!
//! ζ, in camera heights, needs no scale: γ is known in 1/s² whatever a pixel measures. So a straight path bends, by
//! (q − A) γ/2 t² for the fall, and by the product of its own speed and the ball's rise. The bend tells the vertical
//! speed of each arc; so does the time between two impacts, at both of which the ball's centre is at z = R.
//!
//! * [`segment_sums`] cuts a track into arcs of that shape, helped by the apparent radius, which goes as 1/(1 − ζ).
//! * [`fit`] fits all arcs together with the impacts between them.
//! * [`search`] is the way from a track to a [`super::Flight`]; `impact_test` tells where its arcs meet.
//!
//! Drag β (Newton's) is taken as known where the ball's mass and size are, and fitted elsewhere: it slows the ball along its
//! path and hardly turns it. Lift s × v (Magnus; s along the spin) does turn it: each arc has an s of its own, about what drag
//! and the spin that the impacts tell say; see `lift`.

pub mod fit;
pub(super) mod impact_test;
mod lift;
pub mod search;
mod seen;
pub mod segment_sums;

use super::drag::{Drag, DragLaw};
use super::fit::{ARCS, DRAG, Motion};
use crate::geometry::PlanePoint;

/// What is known of the camera above and of the ball.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Overhead {
    /// A: the floor's point straight below the camera, plane units.
    pub nadir: PlanePoint,
    /// Standard uncertainty of each of its coordinates, plane units.
    pub nadir_std: f64,
    /// γ = g/D, 1/s².
    pub fall_per_s2: f64,
    /// Relative standard uncertainty of γ.
    pub fall_relative_std: f64,
    /// D, plane units; `None` where the ball is the scale and has not been seen yet.
    pub height: Option<f64>,
    /// R/D; `None` where only the picture tells R.
    pub contact: Option<f64>,
    /// Drag, where the ball's mass and size are known.
    pub drag: Option<Drag>,
    /// I/(m R²).
    pub inertia_factor: f64,
}

impl Overhead {
    /// The same with what a ball of `radius` plane units (seen on the floor) fills in.
    #[must_use]
    pub fn for_ball(self, radius: f64) -> Self {
        Self {
            height: self.height.or(self.contact.map(|c| radius / c)),
            contact: self.contact.or(self.height.map(|h| radius / h)),
            ..self
        }
    }

    /// D, plane units; 1 where nothing tells it.
    fn camera_height(&self) -> f64 {
        self.height.unwrap_or(1.0)
    }

    /// Speed, plane units a second.
    #[must_use]
    pub fn speed(&self, flying: &SpatialMotion) -> f64 {
        flying.speed(self.camera_height())
    }

    /// R, plane units.
    fn radius(&self) -> f64 {
        self.touching() * self.camera_height()
    }

    /// ζ of the ball's centre when it touches the floor.
    fn touching(&self) -> f64 {
        self.contact.unwrap_or(0.0)
    }

    /// No fall from below the camera reaches the floor faster: √(2γ), camera heights a second.
    fn fastest_per_s(&self) -> f64 {
        (2.0 * self.fall_per_s2).sqrt()
    }
}

/// Place and velocity in three dimensions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpatialMotion {
    /// Over the floor: plane units, plane units a second.
    pub ground: Motion,
    /// ζ, camera heights.
    pub zeta: f64,
    /// Its rate, camera heights a second.
    pub rate: f64,
}

impl SpatialMotion {
    /// The motion of what the floor shows: the ball seen against it.
    #[must_use]
    pub fn seen(&self, nadir: PlanePoint) -> Motion {
        let m = 1.0 / (1.0 - self.zeta);
        let g = &self.ground;
        let (dr, dh) = (g.r - nadir.right, g.h - nadir.up);
        Motion {
            r: nadir.right + dr * m,
            h: nadir.up + dh * m,
            vr: (g.vr + dr * m * self.rate) * m,
            vh: (g.vh + dh * m * self.rate) * m,
        }
    }

    /// Speed in plane units a second, D being `height` of them.
    #[must_use]
    pub fn speed(&self, height: f64) -> f64 {
        // Not `hypot`: this is the inner loop, and speeds neither over- nor underflow.
        let (vr, vh, vz) = (self.ground.vr, self.ground.vh, self.rate * height);
        (vr * vr + vh * vh + vz * vz).sqrt()
    }
}

/// Where the parameters of a fit of `arcs` arcs stand. The first are those of [`super::fit::ArcFit`]: no gravity in
/// the plane, drag, then r, vr, h, vh of each arc at its mean time.
#[derive(Debug, Clone, Copy)]
pub struct OverheadLayout {
    arcs: usize,
}

impl OverheadLayout {
    /// For `arcs` arcs.
    #[must_use]
    pub const fn new(arcs: usize) -> Self {
        Self { arcs }
    }

    /// First of arc `k`'s four on the floor.
    #[must_use]
    pub const fn ground(self, k: usize) -> usize {
        ARCS + 4 * k
    }

    /// ζ of arc `k` at its mean time; its rate follows.
    #[must_use]
    pub const fn rise(self, k: usize) -> usize {
        ARCS + 4 * self.arcs + 2 * k
    }

    /// First of arc `k`'s three of s (right, up, towards the camera), 1/s.
    #[must_use]
    pub const fn lift(self, k: usize) -> usize {
        ARCS + 6 * self.arcs + 3 * k
    }

    /// The nadir's right and up.
    #[must_use]
    pub const fn nadir(self) -> usize {
        self.lift(self.arcs)
    }

    /// ln of the fall's γ over what is given.
    #[must_use]
    pub const fn fall(self) -> usize {
        self.nadir() + 2
    }

    /// Half the time of contact, s.
    #[must_use]
    pub const fn half_contact(self) -> usize {
        self.nadir() + 3
    }

    /// How far the shadow of a ball that touches the floor pulls its centre: right, then up, plane units.
    #[must_use]
    pub const fn shadow_pull(self) -> usize {
        self.nadir() + 4
    }

    /// Time of the impact between arcs `k` and `k + 1`, s.
    #[must_use]
    pub const fn impact(self, k: usize) -> usize {
        self.nadir() + 6 + k
    }

    /// Number of parameters.
    #[must_use]
    pub const fn count(self) -> usize {
        self.impact(self.arcs - 1)
    }
}

/// Motion on arc `k` at time `t` for any parameter vector of [`OverheadLayout`].
#[must_use]
pub fn flying(known: &Overhead, parameters: &[f64], times: &[f64], k: usize, t: f64) -> SpatialMotion {
    let layout = OverheadLayout::new(times.len());
    let (g, v) = (
        &parameters[layout.ground(k)..layout.ground(k) + 4],
        &parameters[layout.rise(k)..layout.rise(k) + 2],
    );
    let fall = known.fall_per_s2 * parameters[layout.fall()].exp();
    let start = SpatialMotion {
        ground: Motion {
            r: g[0],
            vr: g[1],
            h: g[2],
            vh: g[3],
        },
        zeta: v[0],
        rate: v[1],
    };
    let dt = t - times[k];
    let l = layout.lift(k);
    let air = AirForces {
        drag: parameters[DRAG],
        law: known.drag.map(|d| d.law).unwrap_or_default(),
        lift: [parameters[l], parameters[l + 1], parameters[l + 2]],
        height: known.camera_height(),
    };
    if air.drag == 0.0 && air.lift == [0.0; 3] {
        return SpatialMotion {
            ground: Motion {
                r: g[0] + g[1] * dt,
                h: g[2] + g[3] * dt,
                ..start.ground
            },
            zeta: v[0] + (v[1] - 0.5 * fall * dt) * dt,
            rate: v[1] - fall * dt,
        };
    }
    integrate(start, fall, &air, dt)
}

/// What the air does: β, s, and D to make lengths of ζ.
struct AirForces {
    drag: f64,
    law: DragLaw,
    lift: [f64; 3],
    height: f64,
}

/// What the picture shows of `flying`: seen from where the parameters have the camera, with the pull of the shadow.
#[must_use]
pub fn seen(known: &Overhead, parameters: &[f64], times: &[f64], flying: &SpatialMotion) -> Motion {
    let at = OverheadLayout::new(times.len()).shadow_pull();
    let m = flying.seen(nadir(parameters, times));
    // Height over the floor in the ball's size.
    let contact = known.touching();
    let height = (flying.zeta - contact) / (SHADOW_RADII * contact).max(f64::MIN_POSITIVE);
    let pull = 1.0 / (1.0 + height * height);
    Motion {
        r: m.r + parameters[at] * pull,
        h: m.h + parameters[at + 1] * pull,
        ..m
    }
}

/// The shadow lets go of the outline when the ball is some of its radii up: half at this many.
const SHADOW_RADII: f64 = 3.0;

/// The nadir as the parameters have it.
#[must_use]
pub fn nadir(parameters: &[f64], times: &[f64]) -> PlanePoint {
    let at = OverheadLayout::new(times.len()).nadir();
    PlanePoint::new(parameters[at], parameters[at + 1])
}

/// Runge-Kutta of fourth order over `dt` in four steps: exact but for the air, whose error is a millionth of the way.
fn integrate(start: SpatialMotion, fall: f64, air: &AirForces, dt: f64) -> SpatialMotion {
    const PARTS: usize = 4;
    let rate = |m: &SpatialMotion| {
        let speed = m.speed(air.height);
        let slow = -air.drag * air.law.at(speed) * speed;
        let (vr, vh, vz) = (m.ground.vr, m.ground.vh, m.rate * air.height);
        let [sr, sh, sz] = air.lift;
        SpatialMotion {
            ground: Motion {
                r: vr,
                h: vh,
                vr: slow * vr + sh * vz - sz * vh,
                vh: slow * vh + sz * vr - sr * vz,
            },
            zeta: m.rate,
            rate: slow * m.rate - fall + (sr * vh - sh * vr) / air.height,
        }
    };
    let along = |m: &SpatialMotion, d: &SpatialMotion, s: f64| SpatialMotion {
        ground: Motion {
            r: m.ground.r + s * d.ground.r,
            h: m.ground.h + s * d.ground.h,
            vr: m.ground.vr + s * d.ground.vr,
            vh: m.ground.vh + s * d.ground.vh,
        },
        zeta: m.zeta + s * d.zeta,
        rate: m.rate + s * d.rate,
    };
    let s = dt / PARTS as f64;
    let mut m = start;
    for _ in 0..PARTS {
        let a = rate(&m);
        let b = rate(&along(&m, &a, 0.5 * s));
        let c = rate(&along(&m, &b, 0.5 * s));
        let d = rate(&along(&m, &c, s));
        for (part, slope) in [(1.0, &a), (2.0, &b), (2.0, &c), (1.0, &d)] {
            m = along(&m, slope, s * part / 6.0);
        }
    }
    m
}

#[cfg(test)]
mod tests;
