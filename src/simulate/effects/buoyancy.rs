//! Buoyancy, and the air that a ball has to move along (added mass).
//!
//! Archimedes: + ρ V g. Added mass of a sphere: ρ V / 2 (Lamb, Hydrodynamics, art. 92). A light ball falls with
//! (1 − β) g / (1 + β/2), β = ρ V / m: about 1.5 β less than g.

use super::deviation::Disturbance;
use super::{Action, Effect, EffectEstimate, Force, Ideal, Loads};
use crate::simulate::flight::BallState;
use crate::simulate::scene::Scene;
use nalgebra::Vector3;
use std::f64::consts::PI;

/// Buoyancy with added mass.
pub(super) struct Buoyancy;

impl Effect for Buoyancy {
    fn name(&self) -> &'static str {
        "buoyancy"
    }

    fn estimate(&self, scene: &Scene, ideal: &Ideal) -> EffectEstimate {
        let law = BuoyancyForce::new(scene);
        let share = law.air_kg / law.mass_kg;
        // What added mass takes from other forces, β/2, is within the coupling by its share of the speed, some 1.5 β.
        EffectEstimate::path(
            scene,
            ideal,
            &law,
            format!("first-order shift by 1.5 β g, β = ρV/m = {share:.2e}, Archimedes and Lamb art. 92"),
        )
    }

    fn disturbance(&self, scene: &Scene) -> Option<Box<dyn Disturbance>> {
        Some(Box::new(BuoyancyForce::new(scene)))
    }

    fn action(&self, scene: &Scene) -> Action {
        Action::Force(Box::new(BuoyancyForce::new(scene)))
    }
}

struct BuoyancyForce {
    /// ρ V, kg.
    air_kg: f64,
    mass_kg: f64,
    gravity_m_s2: f64,
}

impl BuoyancyForce {
    fn new(scene: &Scene) -> Self {
        Self {
            air_kg: scene.air.density_kg_m3 * 4.0 / 3.0 * PI * scene.ball.radius_m.powi(3),
            mass_kg: scene.ball.mass_kg,
            gravity_m_s2: scene.gravity_m_s2,
        }
    }
}

impl Force for BuoyancyForce {
    fn act(&self, _state: &BallState, _spin_m_s: &Vector3<f64>, loads: &mut Loads) {
        loads.force_n.z += self.air_kg * self.gravity_m_s2;
        loads.added_mass_kg += 0.5 * self.air_kg;
    }
}

impl Disturbance for BuoyancyForce {
    fn acceleration(&self, _state: &BallState, _spin_m_s: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(0.0, 0.0, 1.5 * self.air_kg / self.mass_kg * self.gravity_m_s2)
    }
}
