//! The impulse balance of an impact \[1–7\], and what all rebound models share: motion before and after, regimes, the impulse
//! of friction at its limit. See [`super`] for the axes and symbols.

use nalgebra::{Vector2, Vector3};

/// Inertia factor k = I / (m R²) of a homogeneous sphere.
pub const SOLID_SPHERE: f64 = 0.4;

/// Inertia factor k of a thin spherical shell.
pub const THIN_SHELL: f64 = 2.0 / 3.0;

/// How a ball moves: velocity of its centre, and the surface speed from its spin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigidMotion {
    /// Velocity of the centre, m/s; before an impact its z component is negative.
    pub velocity_m_s: Vector3<f64>,
    /// R ω, m/s.
    pub surface_spin_m_s: Vector3<f64>,
}

impl RigidMotion {
    /// Slip velocity of the contact point in the floor plane, m/s: c = (v_x − R ω_y, v_y + R ω_x) \[5\].
    #[must_use]
    pub fn slip_m_s(&self) -> Vector2<f64> {
        Vector2::new(
            self.velocity_m_s.x - self.surface_spin_m_s.y,
            self.velocity_m_s.y + self.surface_spin_m_s.x,
        )
    }

    /// Energy per mass of translation and rotation, J/kg: (v² + k (R ω)²) / 2.
    #[must_use]
    pub fn energy_j_kg(&self, inertia_factor: f64) -> f64 {
        0.5 * (self.velocity_m_s.norm_squared() + inertia_factor * self.surface_spin_m_s.norm_squared())
    }

    /// Direction from the vertical of the motion in the x-z plane, rad: positive for a motion along +x, between −π/2
    /// and π/2 whichever way it goes vertically.
    #[must_use]
    pub fn angle_rad(&self) -> f64 {
        self.velocity_m_s.x.atan2(self.velocity_m_s.z.abs())
    }
}

/// What the contact point did during an impact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Regime {
    /// Friction at its limit throughout: P = μ (1 + e) |v_oz|, the ball still slips when it leaves.
    Sliding,
    /// The ball leaves rolling: no slip at the end, v_x = R ω_y (e_x = 0).
    Nonsliding,
    /// e-e model, e_x < 0: slip is slowed but keeps its direction.
    Ordinary,
    /// e_x > 0: slip is reversed, R ω_y > v_x (superball).
    Grip,
    /// Compliant contact: slides at the touch, sticks, slides again before it leaves.
    SlipStickSlip,
    /// Compliant contact: sticks at the touch, slides before it leaves.
    StickSlip,
}

impl Regime {
    /// Its name in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Sliding => "sliding",
            Self::Nonsliding => "nonsliding",
            Self::Ordinary => "ordinary",
            Self::Grip => "grip",
            Self::SlipStickSlip => "slip_stick_slip",
            Self::StickSlip => "stick_slip",
        }
    }
}

/// s = k / (1 + k), 2/7 for a solid sphere: the share of a slip velocity that the centre loses when slip stops.
#[must_use]
pub fn slip_share(inertia_factor: f64) -> f64 {
    inertia_factor / (1.0 + inertia_factor)
}

/// The impulse balance \[1–7\]: `incoming` after a tangential impulse per mass `tangential_m_s` and a rebound with
/// `restitution`.
#[must_use]
pub fn apply_impulse(
    incoming: &RigidMotion,
    restitution: f64,
    tangential_m_s: Vector2<f64>,
    inertia_factor: f64,
) -> RigidMotion {
    let (v, w) = (incoming.velocity_m_s, incoming.surface_spin_m_s);
    let spin_gain = tangential_m_s / inertia_factor;
    RigidMotion {
        velocity_m_s: Vector3::new(
            v.x + tangential_m_s.x,
            v.y + tangential_m_s.y,
            restitution * v.z.abs(),
        ),
        surface_spin_m_s: Vector3::new(w.x + spin_gain.y, w.y - spin_gain.x, w.z),
    }
}

/// `incoming` after a rebound with `restitution` that turns its slip c into −e c, with the first of two e along the unit
/// vector `along` of the floor plane and the second across it \[19–22\].
///
/// Not by way of the impulse: P/k is 0/0 where all mass is in the middle (k = 0), and R ω + P/k loses all digits of a spin
/// that friction nearly ends.
pub(super) fn apply_grip(
    incoming: &RigidMotion,
    restitution: f64,
    along: &Vector2<f64>,
    (e_along, e_across): (f64, f64),
    inertia_factor: f64,
) -> RigidMotion {
    let (v, w) = (incoming.velocity_m_s, incoming.surface_spin_m_s);
    // Velocity that rolling with this spin would have: c = v − rolling.
    let rolling = Vector2::new(w.y, -w.x);
    let across = Vector2::new(-along.y, along.x);
    let slip = incoming.slip_m_s();
    let (lost, rolling) = if e_along == e_across {
        // The same in every direction: no axes to lose digits by.
        let x = gripped(v.x, rolling.x, slip.x, e_along, inertia_factor);
        let y = gripped(v.y, rolling.y, slip.y, e_along, inertia_factor);
        (Vector2::new(x.0, y.0), Vector2::new(x.1, y.1))
    } else {
        let part = |axis: &Vector2<f64>, e| {
            let on = |u: &Vector2<f64>| u.dot(axis);
            gripped(on(&v.xy()), on(&rolling), on(&slip), e, inertia_factor)
        };
        let (a, b) = (part(along, e_along), part(&across, e_across));
        (along * a.0 + across * b.0, along * a.1 + across * b.1)
    };
    RigidMotion {
        velocity_m_s: Vector3::new(v.x - lost.x, v.y - lost.y, restitution * v.z.abs()),
        surface_spin_m_s: Vector3::new(-rolling.y, rolling.x, w.z),
    }
}

/// What velocity v loses in one direction when its slip c = v − R ω becomes −e c, and R ω after: s (1 + e) c and
/// ((1 + e) v + (k − e) R ω) / (1 + k).
fn gripped(v: f64, rolling: f64, slip: f64, e: f64, inertia_factor: f64) -> (f64, f64) {
    let stopped = 1.0 + e;
    if slip == 0.0 || stopped == 0.0 {
        return (0.0, rolling);
    }
    (
        slip_share(inertia_factor) * stopped * slip,
        (stopped * v + (inertia_factor - e) * rolling) / (1.0 + inertia_factor),
    )
}

/// Length of a vector, without the squares that overflow above 1e154 and vanish below 1e-162.
pub(super) fn length(v: &Vector2<f64>) -> f64 {
    v.x.hypot(v.y)
}

/// Its direction; `None` of the zero vector.
pub(super) fn direction(v: &Vector2<f64>) -> Option<Vector2<f64>> {
    let length = length(v);
    (length > 0.0).then(|| v / length)
}

/// Tangential impulse per mass of friction at its limit, m/s: −μ (1 + e) |v_oz| c/|c|, zero without slip.
#[must_use]
pub fn sliding_impulse_m_s(incoming: &RigidMotion, restitution: f64, friction: f64) -> Vector2<f64> {
    direction(&incoming.slip_m_s()).map_or_else(Vector2::zeros, |along| {
        -along * friction * normal_impulse_m_s(incoming, restitution)
    })
}

/// Normal impulse per mass, m/s: (1 + e) |v_oz|.
#[must_use]
pub fn normal_impulse_m_s(incoming: &RigidMotion, restitution: f64) -> f64 {
    (1.0 + restitution) * incoming.velocity_m_s.z.abs()
}

/// Azimuthal deviation of the rebound from the incident vertical plane, rad \[9, 23\]: tan α = v_y / v_x in axes whose
/// x lies along the incident horizontal velocity, positive to the left of it (towards +y for a ball that moves along
/// +x). `None` where either has no horizontal velocity. A ball that bounces straight back has α = π.
#[must_use]
pub fn azimuth_rad(incoming: &RigidMotion, outgoing: &RigidMotion) -> Option<f64> {
    let before = direction(&incoming.velocity_m_s.xy())?;
    let after = direction(&outgoing.velocity_m_s.xy())?;
    Some(before.perp(&after).atan2(before.dot(&after)))
}

/// tan φ = v_x / (e |v_oz|) from v_x / |v_oz|; `None` for a ball that stays down (e = 0), which leaves at no angle, and where
/// the tangent is beyond all numbers.
pub(super) fn rebound_tangent(kept: f64, restitution: f64) -> Option<f64> {
    Some(kept / restitution).filter(|tangent| tangent.is_finite())
}

/// Angle whose tangent is `limit / (share |1 − spin_ratio|)`, rad: π/2 where nothing is to be stopped (a ball that rolls
/// already; one without inertia, or whose slip stays as it is), whatever the limit.
pub(super) fn limiting_angle_rad(limit: f64, share: f64, spin_ratio: f64) -> f64 {
    let needed = share * (1.0 - spin_ratio).abs();
    if needed == 0.0 {
        std::f64::consts::FRAC_PI_2
    } else {
        limit.atan2(needed)
    }
}
