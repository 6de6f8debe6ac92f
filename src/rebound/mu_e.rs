//! The μ-e model: Amontons-Coulomb friction \[8–16\].
//!
//! ```text
//! impulse that stops the slip    P_stop = s |c|
//! nonsliding where               s |c| <= μ_o (1 + e) |v_oz|      P = −s c
//! sliding otherwise              P = −μ (1 + e) |v_oz| c/|c|
//! ```

use super::{
    Motion, Regime, apply_grip, apply_impulse, length, limiting_angle_rad, normal_impulse_m_s,
    rebound_tangent, sliding_impulse_m_s, slip_share,
};
use nalgebra::Vector2;

/// Coefficients of the μ-e model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameters {
    /// e, normal coefficient of restitution.
    pub restitution: f64,
    /// μ, of a ball that slides.
    pub friction: f64,
    /// μ_o ≥ μ, which decides whether it slides.
    pub static_friction: f64,
}

/// The motion after an impact, and its regime. A ball without slip counts as nonsliding.
#[must_use]
pub fn impact(incoming: &Motion, parameters: &Parameters, inertia_factor: f64) -> (Motion, Regime) {
    let Parameters {
        restitution,
        friction,
        static_friction,
    } = *parameters;
    let slip = incoming.slip_m_s();
    let stop = length(&slip) * slip_share(inertia_factor);
    if stop <= static_friction * normal_impulse_m_s(incoming, restitution) {
        let rolls = apply_grip(incoming, restitution, &Vector2::x(), (0.0, 0.0), inertia_factor);
        (rolls, Regime::Nonsliding)
    } else {
        let tangential = sliding_impulse_m_s(incoming, restitution, friction);
        let slides = apply_impulse(incoming, restitution, tangential, inertia_factor);
        (slides, Regime::Sliding)
    }
}

/// Incident angle above which the ball slides, rad \[16\]: tan θ_L = (1/s) μ_o (1 + e) / |1 − R ω_oy/u_o|, where
/// `spin_ratio` = R ω_oy / u_o at the impact. π/2 for a ball that rolls already (or has no inertia, k = 0).
#[must_use]
pub fn transition_angle_rad(parameters: &Parameters, spin_ratio: f64, inertia_factor: f64) -> f64 {
    let limit = parameters.static_friction * (1.0 + parameters.restitution);
    limiting_angle_rad(limit, slip_share(inertia_factor), spin_ratio)
}

/// tan φ of a ball that slides \[14\], for motion in the x-z plane: (tan θ − σ μ (1 + e)) / e, where σ is the sign of
/// the slip v_ox − R ω_oy (0 for a ball that rolls already). `None` for a ball that stays down (e = 0).
#[must_use]
pub fn sliding_rebound_tangent(
    parameters: &Parameters,
    incident_tangent: f64,
    spin_ratio: f64,
) -> Option<f64> {
    let slip = incident_tangent * (1.0 - spin_ratio);
    let direction = if slip == 0.0 { 0.0 } else { slip.signum() };
    let e = parameters.restitution;
    rebound_tangent(incident_tangent - direction * parameters.friction * (1.0 + e), e)
}

/// tan φ of a ball that leaves rolling \[15\]: ((1 − s) + s R ω_oy/u_o) tan θ / e; `None` where e = 0.
#[must_use]
pub fn nonsliding_rebound_tangent(
    restitution: f64,
    incident_tangent: f64,
    spin_ratio: f64,
    inertia_factor: f64,
) -> Option<f64> {
    let s = slip_share(inertia_factor);
    rebound_tangent(((1.0 - s) + s * spin_ratio) * incident_tangent, restitution)
}
