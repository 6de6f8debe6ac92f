//! The horizontal launch experiment \[25–31\]: a ball leaves the edge of a bench with speed u_o, lands at x_o and again
//! x further on.
//!
//! It lands with |v_oz| = g x_o / u_o and flies for 2 e x_o / u_o, so that every model gives x as a function of x_o.

use super::slip_share;

/// Direction of the slip velocity at the first impact: the sign of v_ox − R ω_oy.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Slip {
    /// R ω_oy < v_ox: friction slows the ball.
    Forward,
    /// R ω_oy > v_ox: friction speeds it up.
    Backward,
    /// R ω_oy = v_ox: no friction.
    None,
}

impl Slip {
    /// Of a ball launched with `spin_ratio` = R ω_oy / u_o.
    #[must_use]
    pub fn of_spin_ratio(spin_ratio: f64) -> Self {
        if spin_ratio < 1.0 {
            Self::Forward
        } else if spin_ratio > 1.0 {
            Self::Backward
        } else {
            Self::None
        }
    }

    /// 1, −1 or 0.
    #[must_use]
    pub fn sign(self) -> f64 {
        match self {
            Self::Forward => 1.0,
            Self::Backward => -1.0,
            Self::None => 0.0,
        }
    }
}

/// x of a ball that slides, m \[25\]: 2 e x_o [1 ∓ μ (1 + e)(g / u_o²) x_o], of a launch with a speed (u_o > 0).
#[must_use]
pub fn sliding_distance_m(
    x0_m: f64,
    launch_speed_m_s: f64,
    restitution: f64,
    friction: f64,
    slip: Slip,
    gravity_m_s2: f64,
) -> f64 {
    let loss = friction * (1.0 + restitution) * (gravity_m_s2 / launch_speed_m_s) * (x0_m / launch_speed_m_s);
    2.0 * restitution * x0_m * (1.0 - slip.sign() * loss)
}

/// x by the e-e model, m \[26\]: 2 e x_o [(1 − s) − s e_x + s (1 + e_x) R ω_oy/u_o].
#[must_use]
pub fn e_e_distance_m(
    x0_m: f64,
    restitution: f64,
    tangential_restitution_x: f64,
    spin_ratio: f64,
    inertia_factor: f64,
) -> f64 {
    let s = slip_share(inertia_factor);
    let ratio = (1.0 - s) - s * tangential_restitution_x + s * (1.0 + tangential_restitution_x) * spin_ratio;
    2.0 * restitution * x0_m * ratio
}

/// x of a ball that leaves rolling, m \[27\]: 2 e x_o [(1 − s) + s R ω_oy/u_o].
#[must_use]
pub fn nonsliding_distance_m(x0_m: f64, restitution: f64, spin_ratio: f64, inertia_factor: f64) -> f64 {
    e_e_distance_m(x0_m, restitution, 0.0, spin_ratio, inertia_factor)
}

/// x of a ball launched in pure rolling, m: 2 e x_o.
#[must_use]
pub fn rolling_distance_m(x0_m: f64, restitution: f64) -> f64 {
    2.0 * restitution * x0_m
}

/// R ω_oy / u_o of a ball that rolls on a track of width a: R / R_e, R_e = sqrt(R² − a²/4). `None` where the track is
/// as wide as the ball.
#[must_use]
pub fn track_spin_ratio(radius_m: f64, track_width_m: f64) -> Option<f64> {
    // (R − a/2)(R + a/2) keeps the digits that R² − a²/4 loses on a track nearly as wide as the ball.
    let half_m = 0.5 * track_width_m;
    let (less, more) = (radius_m - half_m, radius_m + half_m);
    (less > 0.0 && more > 0.0).then(|| radius_m / (less.sqrt() * more.sqrt()))
}

/// Two launches of the same ball at the same speed: the ball as it is, and in pure rolling (starred in the paper).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DistancePair {
    /// x_o, m.
    pub x0_m: f64,
    /// x, m.
    pub x_m: f64,
    /// x_o* in pure rolling, m.
    pub rolling_x0_m: f64,
    /// x* in pure rolling, m.
    pub rolling_x_m: f64,
}

/// Velocity, spin and impulse after the first impact, from distances alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrictionFreeReading {
    /// v_x, m/s \[28\].
    pub vx_m_s: f64,
    /// v_z, m/s \[29\].
    pub vz_m_s: f64,
    /// R ω_y, m/s \[30\].
    pub surface_spin_m_s: f64,
    /// Tangential impulse per mass, m/s, negative where the ball was slowed \[31\].
    pub tangential_impulse_m_s: f64,
}

/// Eqs. 28–31: what two distances tell of the rebound, whatever friction did. `None` where a distance or the speed that
/// something is divided by is zero (or k = 0, where spin and impulse have nothing to do with each other).
///
/// ```text
/// v_x = u_o (x/x_o)(x_o*/x*)        v_z = (g x_o / 2 u_o)(x*/x_o*)
/// R ω_y = R ω_oy + (1/k)(u_o − v_x)        tangential impulse / m = v_x − u_o
/// ```
#[must_use]
pub fn friction_free_reading(
    distances: &DistancePair,
    launch_speed_m_s: f64,
    spin_ratio: f64,
    inertia_factor: f64,
    gravity_m_s2: f64,
) -> Option<FrictionFreeReading> {
    let rolling = distances.rolling_x_m / distances.rolling_x0_m;
    let vx_m_s = launch_speed_m_s * distances.x_m / distances.x0_m / rolling;
    let reading = FrictionFreeReading {
        vx_m_s,
        vz_m_s: 0.5 * gravity_m_s2 * distances.x0_m / launch_speed_m_s * rolling,
        surface_spin_m_s: spin_ratio * launch_speed_m_s + (launch_speed_m_s - vx_m_s) / inertia_factor,
        tangential_impulse_m_s: vx_m_s - launch_speed_m_s,
    };
    let numbers = [reading.vx_m_s, reading.vz_m_s, reading.surface_spin_m_s];
    numbers.iter().all(|x| x.is_finite()).then_some(reading)
}
