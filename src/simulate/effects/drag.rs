//! Air drag on a sphere.
//!
//! F = −½ ρ C_D π R² v v⃗ with the standard drag curve of Clift and Gauvin (1970), within 6 % for Re < 3·10⁵:
//!
//! ```text
//! C_D = 24/Re (1 + 0.15 Re^0.687) + 0.42 / (1 + 42500 Re^−1.16)        Re = 2 R v ρ / η
//! ```
//!
//! Limits: a smooth ball; the drag crisis of rough balls above Re of some 10⁵ is not in the curve.

use super::deviation::Disturbance;
use super::{Action, Effect, EffectEstimate, Force, Ideal, Loads};
use crate::simulate::flight::BallState;
use crate::simulate::scene::Scene;
use nalgebra::Vector3;
use std::f64::consts::PI;

/// Air drag.
pub(super) struct AirDrag;

impl Effect for AirDrag {
    fn name(&self) -> &'static str {
        "drag"
    }

    fn estimate(&self, scene: &Scene, ideal: &Ideal) -> EffectEstimate {
        let law = DragForce::new(scene);
        let reynolds = ideal.largest(|s| law.reynolds(s.state.velocity_m_s.norm()));
        EffectEstimate::path(
            scene,
            ideal,
            &law,
            format!(
                "first-order shift by ½ρC_D(Re)πR²v²/m, Clift-Gauvin 1970 (K h²/3 in a fall); Re up to {reynolds:.0}"
            ),
        )
    }

    fn disturbance(&self, scene: &Scene) -> Option<Box<dyn Disturbance>> {
        Some(Box::new(DragForce::new(scene)))
    }

    fn action(&self, scene: &Scene) -> Action {
        Action::Force(Box::new(DragForce::new(scene)))
    }
}

struct DragForce {
    radius_m: f64,
    mass_kg: f64,
    density_kg_m3: f64,
    viscosity_pa_s: f64,
    /// Times the law of a smooth sphere.
    factor: f64,
}

impl DragForce {
    fn new(scene: &Scene) -> Self {
        Self {
            radius_m: scene.ball.radius_m,
            mass_kg: scene.ball.mass_kg,
            density_kg_m3: scene.air.density_kg_m3,
            viscosity_pa_s: scene.air.viscosity_pa_s,
            factor: scene.ball.drag_factor,
        }
    }

    fn reynolds(&self, speed_m_s: f64) -> f64 {
        2.0 * self.radius_m * speed_m_s * self.density_kg_m3 / self.viscosity_pa_s
    }

    /// −F / v⃗, kg/s: Stokes' 6πηR times its correction, plus the inertial part; finite at rest.
    fn resistance_kg_s(&self, speed_m_s: f64) -> f64 {
        let reynolds = self.reynolds(speed_m_s);
        let viscous = 6.0 * PI * self.viscosity_pa_s * self.radius_m * (1.0 + 0.15 * reynolds.powf(0.687));
        let area_m2 = PI * self.radius_m.powi(2);
        self.factor * (viscous + 0.5 * self.density_kg_m3 * area_m2 * speed_m_s * inertial_part(reynolds))
    }
}

impl Force for DragForce {
    fn act(&self, state: &BallState, _spin_m_s: &Vector3<f64>, loads: &mut Loads) {
        let v = state.velocity_m_s;
        loads.force_n -= v * self.resistance_kg_s(v.norm());
    }
}

impl Disturbance for DragForce {
    fn acceleration(&self, state: &BallState, _spin_m_s: &Vector3<f64>) -> Vector3<f64> {
        let v = state.velocity_m_s;
        -v * (self.resistance_kg_s(v.norm()) / self.mass_kg)
    }
}

fn inertial_part(reynolds: f64) -> f64 {
    // At rest Re^−1.16 is infinite and the term 0.
    0.42 / (1.0 + 42_500.0 * reynolds.powf(-1.16))
}

/// C_D of a smooth sphere by Clift and Gauvin 1970, for 0 < `reynolds` < 3·10⁵.
#[must_use]
pub fn drag_coefficient(reynolds: f64) -> f64 {
    24.0 / reynolds * (1.0 + 0.15 * reynolds.powf(0.687)) + inertial_part(reynolds)
}
