//! Drag of a sphere in air, and how it changes with the speed.

/// Air at 20 °C and sea level, kg/m³.
pub const AIR_DENSITY_KG_M3: f64 = 1.204;

/// The same air's viscosity, Pa s.
const AIR_VISCOSITY_PA_S: f64 = 1.81e-5;

/// Drag β of the lightest ball, times its radius: 3 ρ_air C_d/(8 ρ_ball) with C_d = 0.45 and a table tennis ball's 84 kg/m³.
pub const LIGHTEST_DRAG: f64 = 0.0024;

/// The same of a light ball, a tennis ball with its 370 kg/m³ and C_d = 0.6: of balls of which nothing is said most are heavier,
/// and a table tennis ball is three times that.
pub const USUAL_LIGHT_DRAG: f64 = 0.0008;

/// Below this Reynolds number a ball all but stands, and what drag it has moves nothing.
const LEAST_REYNOLDS: f64 = 1.0;

/// Reynolds number of a sphere of `radius_m` at `speed_m_s` in air.
fn reynolds(radius_m: f64, speed_m_s: f64) -> f64 {
    2.0 * radius_m * speed_m_s * AIR_DENSITY_KG_M3 / AIR_VISCOSITY_PA_S
}

/// Drag coefficient of a smooth sphere: within 4 % for Reynolds numbers below 2·10⁵, where balls of 1 to 10 cm at 0.5 to
/// 20 m/s are (Brown and Lawler 2003, J. Environ. Eng. 129, 222). With its slope times the Reynolds number.
fn coefficient(reynolds: f64) -> (f64, f64) {
    let reynolds = reynolds.max(LEAST_REYNOLDS);
    let stokes = 24.0 / reynolds;
    let between = 0.15 * stokes * reynolds.powf(0.681);
    let newton = 0.407 / (1.0 + 8710.0 / reynolds);
    let slope = (0.681 - 1.0) * between - stokes + newton * 8710.0 / (reynolds + 8710.0);
    (stokes + between + newton, slope)
}

/// What is known of the drag −β(v) v **v** on a ball.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drag {
    /// β at the flight's usual speed, 1 / plane unit.
    pub beta: f64,
    /// Its standard uncertainty.
    pub std: f64,
    /// How it changes with the speed.
    pub law: DragLaw,
}

/// β(v)/β: 1 at the usual speed, for a sphere in air as its drag coefficient goes. The default is Newton's drag, the same at
/// every speed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DragLaw(Option<Sphere>);

#[derive(Debug, Clone, Copy, PartialEq)]
struct Sphere {
    /// Reynolds number a plane unit a second.
    reynolds_s: f64,
    /// Drag coefficient at the usual speed.
    usual: f64,
    /// ρ π R²/(2 m), 1 / plane unit.
    air: f64,
}

impl DragLaw {
    /// ρ π R²/(2 m), 1 / plane unit, which times a force coefficient and v² is an acceleration; `None` for Newton's drag, which
    /// has no body.
    #[must_use]
    pub fn air(&self) -> Option<f64> {
        self.0.map(|s| s.air)
    }

    /// β(v)/β at `speed`, plane units a second.
    #[must_use]
    pub fn at(&self, speed: f64) -> f64 {
        self.at_and_slope(speed).0
    }

    /// The same with its slope times the speed.
    #[must_use]
    pub fn at_and_slope(&self, speed: f64) -> (f64, f64) {
        self.0.map_or((1.0, 0.0), |s| {
            let (at, slope) = coefficient(s.reynolds_s * speed);
            (at / s.usual, slope / s.usual)
        })
    }
}

impl Drag {
    /// None, or up to about `most`: nothing is known of the ball.
    #[must_use]
    pub fn unknown(most: f64) -> Self {
        Self {
            beta: 0.0,
            std: most,
            law: DragLaw::default(),
        }
    }

    /// That of a sphere of `radius_m` and `mass_kg`, usually at `speed` plane units a second, known to the part
    /// `relative_std`.
    #[must_use]
    pub fn of_sphere(
        (radius_m, mass_kg): (f64, f64),
        metres_per_unit: f64,
        speed: f64,
        relative_std: f64,
    ) -> Self {
        let reynolds_s = reynolds(radius_m, metres_per_unit);
        let (usual, _) = coefficient(reynolds_s * speed);
        let area_m2 = std::f64::consts::PI * radius_m * radius_m;
        // Metres a unit turn 1/m into 1/unit.
        let air = AIR_DENSITY_KG_M3 * area_m2 / (2.0 * mass_kg) * metres_per_unit;
        let beta = usual * air;
        let sphere = Sphere {
            reynolds_s,
            usual,
            air,
        };
        Self {
            beta,
            std: relative_std * beta,
            law: DragLaw(Some(sphere)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_drag_of_a_sphere_is_the_standard_curves() {
        // Reynolds number and C_D: Lapple's table in Clift, Grace and Weber 1978.
        for (reynolds, expected) in [(100.0, 1.09), (1e3, 0.46), (3e3, 0.40), (1e4, 0.41), (1e5, 0.48)] {
            let (found, _) = coefficient(reynolds);
            assert!((found / expected - 1.0).abs() < 0.1, "{reynolds}: {found}");
        }
    }

    #[test]
    fn a_slower_ball_has_more_of_its_drag() {
        let drag = Drag::of_sphere((0.02, 0.0027), 0.001, 2000.0, 0.15);
        // ρ C_D π R²/(2 m) = 0.113 /m with C_D = 0.40 at a Reynolds number of 5300.
        assert!((drag.beta / 0.113e-3 - 1.0).abs() < 0.05, "{}", drag.beta);
        assert!((drag.law.at(2000.0) - 1.0).abs() < 1e-12);
        assert!(drag.law.at(400.0) > 1.1 && drag.law.at(0.0).is_finite());
        assert_eq!(DragLaw::default().at(7.0), 1.0);
        for speed in [4.0, 400.0, 9000.0] {
            let (at, slope) = drag.law.at_and_slope(speed);
            let found = (drag.law.at(1.001 * speed) - drag.law.at(0.999 * speed)) / 0.002;
            assert!((slope - found).abs() < 1e-4 * at, "{speed}: {slope} {found}");
        }
    }
}
