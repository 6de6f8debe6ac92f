//! The list of the rebound models, and the only place that names them all: a new model gets its lines here.

use super::impulse::{Regime, RigidMotion};
use super::model::{Contradiction, FittedCoefficients, FrictionLimit, ModelFacts, ReboundLaw, ReboundModel};
use super::parameter::{PARAMETERS, RATIO, SEARCHED};
use super::{e_e, grip_slide, mu_e};

/// A rebound model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ModelName {
    /// Coulomb friction: leaves rolling, or slides.
    MuE,
    /// Horizontal restitution e_x, at any angle.
    EE,
    /// e_x up to the limit of friction, sliding beyond.
    GripSlide,
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
    pub const ALL: [Self; 3] = [Self::MuE, Self::EE, Self::GripSlide];

    /// The model.
    #[must_use]
    pub fn model(self) -> &'static dyn ReboundModel {
        match self {
            Self::MuE => &mu_e::Model,
            Self::EE => &e_e::Model,
            Self::GripSlide => &grip_slide::Model,
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
        })
    }

    /// The model with coefficients as a fit found them.
    #[must_use]
    pub fn with_fitted(self, fitted: &FittedCoefficients) -> Contact {
        match self {
            Self::MuE => Contact::MuE(mu_e::Parameters::from_fit(fitted)),
            Self::EE => Contact::EE(e_e::Parameters::from_fit(fitted)),
            Self::GripSlide => Contact::GripSlide(grip_slide::Parameters::from_fit(fitted)),
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
        }
    }

    /// The motion after an impact, and its regime.
    #[must_use]
    pub fn impact(&self, incoming: &RigidMotion, inertia_factor: f64) -> (RigidMotion, Regime) {
        self.law().impact(incoming, inertia_factor)
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
