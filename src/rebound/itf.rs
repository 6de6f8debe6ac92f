//! ITF court pace rating (CS 01/02).
//!
//! ```text
//! e = v_z / |v_oz|      μ = (v_ox − v_x) / [|v_oz| (1 + e)]      e_T = e + 0.003 (23 − T)
//! CPR = 100 (1 − μ) + 150 (0.81 − e_T)
//! ```
//!
//! It assumes that the ball slides throughout.

/// Temperature at which the rating is defined, °C.
const REFERENCE_TEMPERATURE_C: f64 = 23.0;
/// Change of e for each °C below the reference temperature (CS 01/02).
const RESTITUTION_PER_C: f64 = 0.003;
/// Weights of friction and restitution, and the restitution of a neutral court (CS 01/02).
const FRICTION_WEIGHT: f64 = 100.0;
const RESTITUTION_WEIGHT: f64 = 150.0;
const NEUTRAL_RESTITUTION: f64 = 0.81;

/// The five classes of courts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Pace {
    /// CPR up to 29.
    Slow,
    /// 30 to 34.
    MediumSlow,
    /// 35 to 39.
    Medium,
    /// 40 to 44.
    MediumFast,
    /// 45 and above.
    Fast,
}

/// CPR from the friction and restitution measured at `temperature_c` (°C).
#[must_use]
pub fn court_pace_rating(restitution: f64, friction: f64, temperature_c: f64) -> f64 {
    let corrected = restitution + RESTITUTION_PER_C * (REFERENCE_TEMPERATURE_C - temperature_c);
    FRICTION_WEIGHT * (1.0 - friction) + RESTITUTION_WEIGHT * (NEUTRAL_RESTITUTION - corrected)
}

/// The class of a rating, which is rounded to a whole number first, as the classes are given.
#[must_use]
pub fn pace(court_pace_rating: f64) -> Pace {
    let rounded = court_pace_rating.round();
    if rounded <= 29.0 {
        Pace::Slow
    } else if rounded <= 34.0 {
        Pace::MediumSlow
    } else if rounded <= 39.0 {
        Pace::Medium
    } else if rounded <= 44.0 {
        Pace::MediumFast
    } else {
        Pace::Fast
    }
}
