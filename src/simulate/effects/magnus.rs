//! Magnus lift of a spinning ball.
//!
//! F = ½ ρ π R² C_L v² along ω × v, with C_L = 1 / (2 + v/(Rω)) measured on tennis balls (Štěpánek 1988, rounded;
//! Cross and Lindsey 2014 give the same form). Written without division: ½ ρ π R² (Rω × v) v / (v + 2 Rω).
//!
//! Limits: smooth balls can show a reversed lift near the drag crisis. The spin is not slowed by the air.

use super::deviation::Disturbance;
use super::{Action, Effect, EffectEstimate, Force, Ideal, Loads};
use crate::simulate::flight::BallState;
use crate::simulate::scene::Scene;
use nalgebra::Vector3;
use std::f64::consts::PI;

/// Magnus lift.
pub(super) struct Magnus;

impl Effect for Magnus {
    fn name(&self) -> &'static str {
        "magnus"
    }

    fn estimate(&self, scene: &Scene, ideal: &Ideal) -> EffectEstimate {
        EffectEstimate::path(
            scene,
            ideal,
            &MagnusForce::new(scene),
            "first-order shift by ½ρπR²C_L v²/m, C_L = 1/(2 + v/Rω), Štěpánek 1988",
        )
    }

    fn disturbance(&self, scene: &Scene) -> Option<Box<dyn Disturbance>> {
        Some(Box::new(MagnusForce::new(scene)))
    }

    fn action(&self, scene: &Scene) -> Action {
        Action::Force(Box::new(MagnusForce::new(scene)))
    }
}

struct MagnusForce {
    /// ½ ρ π R² times the ball's factor, kg/m.
    strength_kg_m: f64,
    mass_kg: f64,
}

impl MagnusForce {
    fn new(scene: &Scene) -> Self {
        Self {
            strength_kg_m: scene.ball.lift_factor
                * 0.5
                * scene.air.density_kg_m3
                * PI
                * scene.ball.radius_m.powi(2),
            mass_kg: scene.ball.mass_kg,
        }
    }

    fn force_n(&self, state: &BallState, spin_m_s: &Vector3<f64>) -> Vector3<f64> {
        let speed = state.velocity_m_s.norm();
        let share = speed + 2.0 * spin_m_s.norm();
        if share == 0.0 {
            return Vector3::zeros();
        }
        spin_m_s.cross(&state.velocity_m_s) * (self.strength_kg_m * speed / share)
    }
}

impl Force for MagnusForce {
    fn act(&self, state: &BallState, spin_m_s: &Vector3<f64>, loads: &mut Loads) {
        loads.force_n += self.force_n(state, spin_m_s);
    }
}

impl Disturbance for MagnusForce {
    fn acceleration(&self, state: &BallState, spin_m_s: &Vector3<f64>) -> Vector3<f64> {
        self.force_n(state, spin_m_s) / self.mass_kg
    }
}
