//! How the ball turns: its orientation is a rotation that takes directions fixed to the ball into the world, q(t).
//!
//! With the angular velocity ω in the axes of the world, q' = ω × q. Within a phase of the path ω is constant, or changes evenly
//! (while ball and floor touch; on a slope), and
//!
//! ```text
//! q(t) = exp(ω t + α t²/2) q(0)
//! ```
//!
//! which is exact where ω and α have the same direction. Where an impact turns the axis, what is left out is of the order of
//! |ω × α| τ³/12 for a contact of τ: 0.001 rad for 100 rad/s turned by 90 degrees within 3 ms.

use nalgebra::{UnitQuaternion, Vector3};

/// How the ball turns in a phase of its path.
#[derive(Debug, Clone, Copy)]
pub(super) struct Turning {
    /// World from ball, when the phase begins.
    pub start: UnitQuaternion<f64>,
    /// ω then, rad/s.
    pub spin_rad_s: Vector3<f64>,
    /// α, rad/s².
    pub change_rad_s2: Vector3<f64>,
}

impl Turning {
    /// World from ball, `time_s` after the phase's beginning.
    pub fn at(&self, time_s: f64) -> UnitQuaternion<f64> {
        let turned_rad = self.spin_rad_s * time_s + self.change_rad_s2 * (0.5 * time_s * time_s);
        UnitQuaternion::from_scaled_axis(turned_rad) * self.start
    }

    /// ω then, rad/s.
    pub fn spin_at(&self, time_s: f64) -> Vector3<f64> {
        self.spin_rad_s + self.change_rad_s2 * time_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_positive_spin_about_y_takes_the_top_of_the_ball_along_x() {
        let turning = Turning {
            start: UnitQuaternion::identity(),
            spin_rad_s: Vector3::y() * 10.0,
            change_rad_s2: Vector3::zeros(),
        };
        let top = turning.at(0.01) * Vector3::z();
        assert!((top - Vector3::new(0.1_f64.sin(), 0.0, 0.1_f64.cos())).norm() < 1e-15);
    }

    #[test]
    fn a_change_of_spin_adds_the_mean_of_both() {
        let turning = Turning {
            start: UnitQuaternion::from_scaled_axis(Vector3::x()),
            spin_rad_s: Vector3::y() * 10.0,
            change_rad_s2: Vector3::y() * 400.0,
        };
        assert!((turning.spin_at(0.02) - Vector3::y() * 18.0).norm() < 1e-12);
        let turned = turning.at(0.02) * turning.start.inverse();
        assert!((turned.scaled_axis() - Vector3::y() * 0.28).norm() < 1e-14);
    }
}
