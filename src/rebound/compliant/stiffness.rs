//! How stiff a contact is sideways against how stiff it is to being pressed together, from what the two bodies are made of
//! (Johnson, Contact Mechanics, 1985, 4.2 and 7.4).
//!
//! ```text
//! 1/E* = Σ (1 − ν²)/E        1/G* = Σ (2 − ν)/(4 G),  G = E / (2 (1 + ν))        κ = G*/E*
//! ```
//!
//! Of two bodies with the same ν that is 2 (1 − ν)/(2 − ν): 1 for ν = 0, 0.82 for 0.3, 2/3 for 0.5. The model is meant for like bodies:
//! with unlike ones, pressing together itself moves the surfaces sideways, which it leaves out.

/// An elastic material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// E, Pa.
    pub youngs_modulus_pa: f64,
    /// ν.
    pub poisson_ratio: f64,
}

impl Material {
    /// (1 − ν²)/E and (2 − ν)/(4 G), 1/Pa.
    fn compliances(&self) -> (f64, f64) {
        let nu = self.poisson_ratio;
        let normal = (1.0 - nu * nu) / self.youngs_modulus_pa;
        (normal, (2.0 - nu) * (1.0 + nu) / (2.0 * self.youngs_modulus_pa))
    }
}

/// κ of a contact of two materials.
#[must_use]
pub fn stiffness_ratio(ball: &Material, floor: &Material) -> f64 {
    let (a, b) = (ball.compliances(), floor.compliances());
    (a.0 + b.0) / (a.1 + b.1)
}

/// E* of a contact of two materials, Pa.
#[must_use]
pub fn contact_modulus_pa(ball: &Material, floor: &Material) -> f64 {
    1.0 / (ball.compliances().0 + floor.compliances().0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn like_bodies_have_the_ratio_of_their_poisson_number() {
        for nu in [0.0, 0.23, 0.3, 0.5] {
            let body = Material {
                youngs_modulus_pa: 7e10,
                poisson_ratio: nu,
            };
            let ratio = stiffness_ratio(&body, &body);
            assert!(
                (ratio - 2.0 * (1.0 - nu) / (2.0 - nu)).abs() < 1e-12,
                "{nu}: {ratio}"
            );
        }
    }

    /// Kharaz, Gorham and Salman 2001: alumina on glass.
    #[test]
    fn val_alumina_on_glass() {
        let alumina = Material {
            youngs_modulus_pa: 3.8e11,
            poisson_ratio: 0.23,
        };
        let glass = Material {
            youngs_modulus_pa: 7e10,
            poisson_ratio: 0.22,
        };
        assert!((stiffness_ratio(&alumina, &glass) - 0.875).abs() < 0.001);
        let modulus_pa = contact_modulus_pa(&alumina, &glass);
        assert!((modulus_pa / 6.2e10 - 1.0).abs() < 0.01, "{modulus_pa}");
    }
}
