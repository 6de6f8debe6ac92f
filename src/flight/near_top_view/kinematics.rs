//! The parameters of arcs in three dimensions, and the motion that they are.

use super::camera::{NearTopView, SpatialMotion};
use crate::flight::drag::DragLaw;
use crate::flight::planar::{ARCS, DRAG, Motion, runge_kutta_step};
use crate::geometry::PlanePoint;

/// Where the parameters of a fit of `arcs` arcs stand. The first are those of [`crate::flight::motion_model::ArcFit`]: no gravity in
/// the plane, drag, then r, vr, h, vh of each arc at its mean time.
#[derive(Debug, Clone, Copy)]
pub struct SpatialLayout {
    arcs: usize,
}

impl SpatialLayout {
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

/// Motion on arc `k` at time `t` for any parameter vector of [`SpatialLayout`].
#[must_use]
pub fn spatial_motion(
    view: &NearTopView,
    parameters: &[f64],
    times: &[f64],
    k: usize,
    t: f64,
) -> SpatialMotion {
    let layout = SpatialLayout::new(times.len());
    let (g, v) = (
        &parameters[layout.ground(k)..layout.ground(k) + 4],
        &parameters[layout.rise(k)..layout.rise(k) + 2],
    );
    let fall = view.fall_per_s2 * parameters[layout.fall()].exp();
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
        law: view.drag.map(|d| d.law).unwrap_or_default(),
        lift: [parameters[l], parameters[l + 1], parameters[l + 2]],
        height: view.camera_height(),
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
pub fn seen(view: &NearTopView, parameters: &[f64], times: &[f64], flying: &SpatialMotion) -> Motion {
    let at = SpatialLayout::new(times.len()).shadow_pull();
    let m = flying.seen(nadir(parameters, times));
    // Height over the floor in the ball's size.
    let contact = view.touching();
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
    let at = SpatialLayout::new(times.len()).nadir();
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
        ground: m.ground.along(&d.ground, s),
        zeta: m.zeta + s * d.zeta,
        rate: m.rate + s * d.rate,
    };
    let step = |m, _| runge_kutta_step(&m, dt / PARTS as f64, rate, along);
    (0..PARTS).fold(start, step)
}
