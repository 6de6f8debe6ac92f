//! The rebound relations of Domenech 2005 (Am. J. Phys. 73, 28, "the paper"): pure functions of
//! vectors.
//!
//! # Axes and symbols
//!
//! x along the launch, y sideways, z up, right-handed; the floor is z = 0. A sphere of mass m, radius R and moment of
//! inertia I = k m R² (k = 2/5 solid, 2/3 thin shell), s = k / (1 + k). `R ω` is the surface speed from spin, a
//! vector in m/s, so that the radius itself never appears.
//!
//! The contact point slips with c = (v_x − R ω_y, v_y + R ω_x) \[5\]; friction acts along −c. Where c = 0 there is no
//! friction: the code uses c/|c| and never the tangent of its direction.
//!
//! # Impulse balance \[1–7\]
//!
//! With P = (tangential impulse)/m and the normal impulse/m = (1 + e)|v_oz|:
//!
//! ```text
//! v_x = v_ox + P_x              v_y = v_oy + P_y              v_z = e |v_oz|
//! R ω_x = R ω_ox + P_y / k      R ω_y = R ω_oy − P_x / k      ω_z unchanged
//! ```
//!
//! Each model is one file and says only what P is: [`mu_e`], [`e_e`], [`grip_slide`].
//!
//! # Limits
//!
//! Coefficients are constants and the normal force passes through the centre, as in the paper. Real balls have a
//! tangential elastic compliance (Maw, Barber, Fawcett 1976) and an offset normal force (Cross 2002).

pub mod e_e;
pub mod grip_slide;
pub mod itf;
pub mod launch;
pub mod mu_e;

use nalgebra::{Vector2, Vector3};

/// Inertia factor k = I / (m R²) of a homogeneous sphere.
pub const SOLID_SPHERE: f64 = 0.4;

/// Inertia factor k of a thin spherical shell.
pub const THIN_SHELL: f64 = 2.0 / 3.0;

/// How a ball moves: velocity of its centre, and the surface speed from its spin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Velocity of the centre, m/s; before an impact its z component is negative.
    pub velocity_m_s: Vector3<f64>,
    /// R ω, m/s.
    pub surface_spin_m_s: Vector3<f64>,
}

impl Motion {
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
    incoming: &Motion,
    restitution: f64,
    tangential_m_s: Vector2<f64>,
    inertia_factor: f64,
) -> Motion {
    let (v, w) = (incoming.velocity_m_s, incoming.surface_spin_m_s);
    let spin_gain = tangential_m_s / inertia_factor;
    Motion {
        velocity_m_s: Vector3::new(
            v.x + tangential_m_s.x,
            v.y + tangential_m_s.y,
            restitution * v.z.abs(),
        ),
        surface_spin_m_s: Vector3::new(w.x + spin_gain.y, w.y - spin_gain.x, w.z),
    }
}

/// Tangential impulse per mass of friction at its limit, m/s: −μ (1 + e) |v_oz| c/|c|, zero without slip.
#[must_use]
pub fn sliding_impulse_m_s(incoming: &Motion, restitution: f64, friction: f64) -> Vector2<f64> {
    incoming
        .slip_m_s()
        .try_normalize(0.0)
        .map_or_else(Vector2::zeros, |along| {
            -along * friction * normal_impulse_m_s(incoming, restitution)
        })
}

/// Normal impulse per mass, m/s: (1 + e) |v_oz|.
#[must_use]
pub fn normal_impulse_m_s(incoming: &Motion, restitution: f64) -> f64 {
    (1.0 + restitution) * incoming.velocity_m_s.z.abs()
}

/// Azimuthal deviation of the rebound from the incident vertical plane, rad \[9, 23\]: tan α = v_y / v_x in axes whose
/// x lies along the incident horizontal velocity, positive to the left of it (towards +y for a ball that moves along
/// +x). `None` where either has no horizontal velocity. A ball that bounces straight back has α = π.
#[must_use]
pub fn azimuth_rad(incoming: &Motion, outgoing: &Motion) -> Option<f64> {
    let (before, after) = (incoming.velocity_m_s.xy(), outgoing.velocity_m_s.xy());
    (before.norm() > 0.0 && after.norm() > 0.0).then(|| before.perp(&after).atan2(before.dot(&after)))
}

/// Angle whose tangent is `limit / |1 − spin_ratio|`, rad: π/2 for a ball that rolls already, which never slips.
fn limiting_angle_rad(limit: f64, spin_ratio: f64) -> f64 {
    let slip_per_speed = (1.0 - spin_ratio).abs();
    if slip_per_speed == 0.0 {
        std::f64::consts::FRAC_PI_2
    } else {
        limit.atan2(slip_per_speed)
    }
}
