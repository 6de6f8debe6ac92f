//! How long ball and floor touch: by Hertz (Johnson 1985, 11.1), T = 2.87 (m²/(R E² v))^(1/5) without loss.
//!
//! Assumed: a hard ball on a hard floor. Of a soft one nothing tells the time; it is said what that would change.

use super::error_budget::{
    CONTACT_TIME_RELATIVE_STD, HALF_CONTACT_S, HALF_CONTACT_STD_S, HARD_MODULUS_PA, SOFT_DENSITY_KG_M3,
    SOFT_MODULUS_PA,
};
use crate::calibration::Ball;

/// Half of the time of a contact without loss, s, with its standard deviation; by Hertz where the ball is known.
pub fn half_contact_s(ball: &Ball, speed_m_s: f64) -> (f64, f64) {
    match (ball.radius_m, ball.mass_kg) {
        (Some(radius_m), Some(mass_kg)) if speed_m_s > 0.0 => {
            let stiffness = radius_m * HARD_MODULUS_PA.powi(2) * speed_m_s;
            let half_s = 0.5 * 2.87 * (mass_kg * mass_kg / stiffness).powf(0.2);
            (half_s, CONTACT_TIME_RELATIVE_STD * half_s)
        }
        _ => (HALF_CONTACT_S, HALF_CONTACT_STD_S),
    }
}

/// A ball that may be soft, for which the time of contact does not stand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SoftBall {
    /// Density, kg/m³.
    pub density_kg_m3: f64,
    /// How much earlier than said a superball of its size and mass would touch, s.
    pub earlier_s: f64,
    /// By what part its restitution would then be off, at most.
    pub restitution_part: f64,
}

impl SoftBall {
    /// What changes if `ball`, which comes at `speed_m_s`, is soft; `None` where it is too dense for that, or not known.
    pub fn of(ball: &Ball, speed_m_s: f64, gravity_m_s2: f64) -> Option<Self> {
        let (radius_m, mass_kg) = (ball.radius_m?, ball.mass_kg?);
        let density_kg_m3 = mass_kg / (4.0 / 3.0 * std::f64::consts::PI * radius_m.powi(3));
        let (hard_s, _) = half_contact_s(ball, speed_m_s);
        // T goes as E^(-2/5).
        let earlier_s = hard_s * ((HARD_MODULUS_PA / SOFT_MODULUS_PA).powf(0.4) - 1.0);
        (density_kg_m3 < SOFT_DENSITY_KG_M3).then_some(Self {
            density_kg_m3,
            earlier_s,
            restitution_part: 2.0 * gravity_m_s2 * earlier_s / speed_m_s,
        })
    }
}
