//! The list of the rebound models, and the only place that names them all: a new model gets its lines here.

use super::impulse::{Regime, RigidMotion};
use super::model::{
    ContactMoment, Contradiction, FittedCoefficients, FrictionLimit, ModelFacts, ReboundLaw, ReboundModel,
};
use super::parameter::{PARAMETERS, RATIO, SEARCHED};
use super::{compliant, e_e, grip_slide, mu_e};

/// A rebound model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ModelName {
    /// Coulomb friction: leaves rolling, or slides.
    MuE,
    /// Horizontal restitution e_x, at any angle.
    EE,
    /// e_x up to the limit of friction, sliding beyond.
    GripSlide,
    /// A contact that gives way sideways.
    Compliant,
}

/// A rebound model with its coefficients.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Contact {
    /// Coulomb friction.
    MuE(mu_e::Parameters),
    /// Constant coefficients of restitution.
    EE(e_e::Parameters),
    /// Grip until the friction limit.
    GripSlide(grip_slide::Parameters),
    /// A contact that gives way sideways.
    Compliant(compliant::Parameters),
}

/// Which model is preferred.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Preferred {
    /// This one.
    Model(ModelName),
    /// The data do not tell.
    Undetermined,
}

impl Preferred {
    /// Its name in results.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Model(model) => model.name(),
            Self::Undetermined => "undetermined",
        }
    }
}

impl ModelName {
    /// All of them, in the order of the results.
    pub const ALL: [Self; 4] = [Self::MuE, Self::EE, Self::GripSlide, Self::Compliant];

    /// The model.
    #[must_use]
    pub fn model(self) -> &'static dyn ReboundModel {
        match self {
            Self::MuE => &mu_e::MuEModel,
            Self::EE => &e_e::EEModel,
            Self::GripSlide => &grip_slide::GripSlideModel,
            Self::Compliant => &compliant::CompliantModel,
        }
    }

    /// The model with coefficients as a scene gives them, in the order of [`ModelFacts::coefficients`].
    ///
    /// # Errors
    ///
    /// Coefficients that cannot go together.
    pub fn with_coefficients(self, values: &[f64]) -> Result<Contact, Contradiction> {
        Ok(match self {
            Self::MuE => Contact::MuE(mu_e::Parameters::from_scene(first(values))?),
            Self::EE => Contact::EE(e_e::Parameters::from_scene(first(values))),
            Self::GripSlide => Contact::GripSlide(grip_slide::Parameters::from_scene(first(values))),
            Self::Compliant => Contact::Compliant(compliant::Parameters::from_scene(first(values))),
        })
    }

    /// The model with coefficients as a fit found them.
    #[must_use]
    pub fn with_fitted(self, fitted: &FittedCoefficients) -> Contact {
        match self {
            Self::MuE => Contact::MuE(mu_e::Parameters::from_fit(fitted)),
            Self::EE => Contact::EE(e_e::Parameters::from_fit(fitted)),
            Self::GripSlide => Contact::GripSlide(grip_slide::Parameters::from_fit(fitted)),
            Self::Compliant => Contact::Compliant(compliant::Parameters::from_fit(fitted)),
        }
    }

    /// Its names and kind.
    #[must_use]
    pub fn facts(self) -> &'static ModelFacts {
        self.model().facts()
    }

    /// Its name in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.facts().name
    }

    /// The model of that name in files.
    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|model| model.name() == name)
    }

    /// Which parameters a search moves, with the spin before where rows share one that is not known.
    #[must_use]
    pub fn searched(self, shared_spin: bool) -> [bool; PARAMETERS] {
        let mut free = SEARCHED.map(|parameter| self.model().lacks(parameter).is_none());
        free[RATIO] = shared_spin;
        free
    }

    /// Whether rows may slide, as friction ends grip.
    #[must_use]
    pub fn has_friction_limit(self) -> bool {
        self.facts().friction_limit != FrictionLimit::Never
    }

    /// The models that it holds as special cases.
    pub fn special_cases(self) -> impl Iterator<Item = Self> {
        let names = self.facts().special_cases.iter();
        names.filter_map(|name| Self::of_name(name))
    }
}

/// As many of `values` as a model takes; one that is missing is no number.
fn first<const N: usize>(values: &[f64]) -> [f64; N] {
    std::array::from_fn(|i| values.get(i).copied().unwrap_or(f64::NAN))
}

impl Contact {
    /// The model's law.
    fn law(&self) -> &dyn ReboundLaw {
        match self {
            Self::MuE(parameters) => parameters,
            Self::EE(parameters) => parameters,
            Self::GripSlide(parameters) => parameters,
            Self::Compliant(parameters) => parameters,
        }
    }

    /// The motion after an impact, and its regime.
    #[must_use]
    pub fn impact(&self, incoming: &RigidMotion, inertia_factor: f64) -> (RigidMotion, Regime) {
        self.law().impact(incoming, inertia_factor)
    }

    /// The same of several, which together take less time than one by one.
    #[must_use]
    pub fn impacts(&self, incoming: &[RigidMotion], inertia_factor: f64) -> Vec<(RigidMotion, Regime)> {
        self.law().impacts(incoming, inertia_factor)
    }

    /// How the contact goes on while ball and floor touch; `None` of a model in which they do so for no time.
    #[must_use]
    pub fn contact_path(&self, incoming: &RigidMotion, inertia_factor: f64) -> Option<Vec<ContactMoment>> {
        self.law().contact_path(incoming, inertia_factor)
    }

    /// e.
    #[must_use]
    pub fn restitution(&self) -> f64 {
        self.law().restitution()
    }

    /// Incident angle at which a ball with `spin_ratio` begins to slide, rad; `None` where it never does.
    #[must_use]
    pub fn transition_rad(&self, spin_ratio: f64, inertia_factor: f64) -> Option<f64> {
        let angle = self.law().transition_rad(spin_ratio, inertia_factor);
        angle.filter(|angle| angle.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rebound::impulse::{SOLID_SPHERE, slip_share};
    use crate::rebound::model::Incidence;
    use crate::rebound::parameter::{E, E_X, KAPPA, MU, Theta};
    use nalgebra::Vector3;

    #[test]
    fn names_and_keys_refer_to_what_is_there() {
        for name in ModelName::ALL {
            assert_eq!(ModelName::of_name(name.name()), Some(name));
            assert_eq!(name.special_cases().count(), name.facts().special_cases.len());
            if let Some((other, _)) = name.model().same_without_sliding() {
                assert!(ModelName::of_name(other).is_some());
            }
            let coefficients = name.facts().coefficients;
            for (i, coefficient) in coefficients.iter().enumerate() {
                let earlier = |key| coefficients[..i].iter().any(|c| c.key == key);
                assert!(coefficient.same_as.is_none_or(earlier), "{}", coefficient.key);
            }
        }
    }

    /// Below the limit of friction the impulse that the fits take is that of the model's own law, with its derivatives.
    #[test]
    fn the_law_of_the_fits_is_the_law_of_the_model() {
        const STEP: f64 = 1e-6;
        for name in ModelName::ALL {
            let mut theta: Theta = [0.0; PARAMETERS];
            (theta[E], theta[MU]) = (0.8, 5.0);
            theta[E_X] = if name.searched(false)[E_X] { 0.3 } else { 0.0 };
            theta[KAPPA] = 0.85;
            // A model whose fits interpolate what its law works out.
            let within = if name.model().grip_is_linear() {
                1e-12
            } else {
                1e-3
            };
            let incoming = RigidMotion {
                velocity_m_s: Vector3::new(1.0, 0.0, -2.0),
                surface_spin_m_s: Vector3::new(0.0, 0.2, 0.0),
            };
            let contact = name.with_fitted(&FittedCoefficients {
                theta,
                friction: Some(theta[MU]),
                static_friction: Some(theta[MU]),
            });
            let (after, _) = contact.impact(&incoming, SOLID_SPHERE);
            let at = |slip_m_s: f64, normal_m_s: f64, theta: &Theta| {
                let slip_share = slip_share(SOLID_SPHERE);
                name.model().grip(
                    &Incidence {
                        slip_m_s,
                        normal_m_s,
                        slip_share,
                        stiffness_ratio: None,
                        table_error: 0.0,
                    },
                    theta,
                )
            };
            let here = at(0.8, 2.0, &theta);
            let lost = incoming.velocity_m_s.x - after.velocity_m_s.x;
            assert!(
                (here.value - lost).abs() < within,
                "{name:?}: {} {lost}",
                here.value
            );
            let slope = |ahead: f64, behind: f64| (ahead - behind) / (2.0 * STEP);
            let by_slip = slope(
                at(0.8 + STEP, 2.0, &theta).value,
                at(0.8 - STEP, 2.0, &theta).value,
            );
            let by_normal = slope(
                at(0.8, 2.0 + STEP, &theta).value,
                at(0.8, 2.0 - STEP, &theta).value,
            );
            assert!((by_slip - here.by_slip).abs() < 1e-7 && (by_normal - here.by_normal).abs() < 1e-7);
            for j in 0..PARAMETERS {
                let moved = |by: f64| {
                    let mut theta = theta;
                    theta[j] += by;
                    at(0.8, 2.0, &theta).value
                };
                assert!((slope(moved(STEP), moved(-STEP)) - here.by_parameter[j]).abs() < 1e-7);
            }
        }
    }
}
