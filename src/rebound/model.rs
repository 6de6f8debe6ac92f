//! What the program asks of a rebound model. Each model's own file answers it; [`super::models`] lists the models.
//!
//! [`ReboundLaw`] is the model with its coefficients: what becomes of an incident motion. [`ReboundModel`] is what is true of it
//! whatever they are: names, coefficients of a scene, how series of bounces are fitted, what a single bounce shows.
//!
//! Everything here is pure: the fits import the models, never the other way round, and the simulator imports no fit.

use super::impulse::{Regime, RigidMotion};
use super::parameter::{E_X, PARAMETERS, Parameter, Theta};
use crate::config::NumberRange;
use crate::quantity::Quantity;

/// A model with its coefficients.
pub trait ReboundLaw {
    /// The motion after an impact, and its regime.
    fn impact(&self, incoming: &RigidMotion, inertia_factor: f64) -> (RigidMotion, Regime);

    /// The same of several: a model whose work they may share overrides it.
    fn impacts(&self, incoming: &[RigidMotion], inertia_factor: f64) -> Vec<(RigidMotion, Regime)> {
        incoming
            .iter()
            .map(|one| self.impact(one, inertia_factor))
            .collect()
    }

    /// e.
    fn restitution(&self) -> f64;

    /// How the contact goes on while ball and floor touch; `None` of a model in which they do so for no time.
    fn contact_path(&self, _incoming: &RigidMotion, _inertia_factor: f64) -> Option<Vec<ContactMoment>> {
        None
    }

    /// Incident angle above which the ball slides, rad; `None` of a model, or with a friction, that never lets it.
    fn transition_rad(&self, spin_ratio: f64, inertia_factor: f64) -> Option<f64>;
}

/// A moment of a contact, in units of the greatest compression d of an elastic impact and of d over the speed at the touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactMoment {
    /// Since the touch.
    pub time: f64,
    /// How far the two are pressed together.
    pub compression: f64,
    /// Its rate: 1 at the touch, −e at the end.
    pub rate: f64,
    /// Share of the whole tangential impulse that was given so far; it may exceed 1 on the way.
    pub tangential_share: f64,
}

/// Of a coefficient of restitution.
pub const RESTITUTION_RANGE: NumberRange = NumberRange {
    accepted: "a number from 0 to 1",
    holds: |x| (0.0..=1.0).contains(&x),
    hint: "a coefficient of restitution or a share cannot exceed 1: no rebound gains energy",
};

/// Of a tangential restitution.
pub const TANGENTIAL_RANGE: NumberRange = NumberRange {
    accepted: "a number from -1 to 1",
    holds: |x| (-1.0..=1.0).contains(&x),
    hint: "-1 is no friction, 0 leaves rolling, 1 is the ideal superball",
};

/// Of a friction.
pub const FRICTION_RANGE: NumberRange = NumberRange {
    accepted: "0 or a positive number (to 1e15)",
    holds: |x| (0.0..=1e15).contains(&x),
    hint: "give 0 to leave it out",
};

/// A coefficient as a scene gives it.
#[derive(Debug, Clone, Copy)]
pub struct Coefficient {
    /// Its key.
    pub key: &'static str,
    /// What it may be.
    pub range: NumberRange,
    /// The key of the coefficient whose value it takes where it is absent; `None`: it has to be there.
    pub same_as: Option<&'static str>,
}

impl Coefficient {
    /// One that has to be there.
    #[must_use]
    pub const fn required(key: &'static str, range: NumberRange) -> Self {
        Self {
            key,
            range,
            same_as: None,
        }
    }

    /// One that takes the value of another where it is absent.
    #[must_use]
    pub const fn like(same_as: &'static str, key: &'static str, range: NumberRange) -> Self {
        Self {
            key,
            range,
            same_as: Some(same_as),
        }
    }
}

/// Coefficients that cannot go together.
#[derive(Debug, Clone, PartialEq)]
pub struct Contradiction {
    /// The key of the one to blame.
    pub key: &'static str,
    /// What it would have to be.
    pub accepted: String,
    /// What may have been meant.
    pub hint: &'static str,
}

/// The coefficients that a fit found; those that it does not have, or that do not limit anything, are `None`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FittedCoefficients {
    /// The parameters as searched.
    pub theta: Theta,
    /// μ, where some row slides.
    pub friction: Option<f64>,
    /// μ_o, where some row slides.
    pub static_friction: Option<f64>,
}

/// How friction ends grip in a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrictionLimit {
    /// It does not: one law holds at any incidence.
    Never,
    /// Where the impulse of grip exceeds μ (1 + e) |v_oz|; the outcome is continuous there.
    AtFriction,
    /// Where it exceeds μ_o (1 + e) |v_oz|, which may be more than sliding gives: the outcome may jump.
    AtStaticFriction,
}

/// An incident state as the tangential impulse depends on it, in the x-z plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Incidence {
    /// c = v_ox − R ω_oy, m/s.
    pub slip_m_s: f64,
    /// |v_oz|, m/s.
    pub normal_m_s: f64,
    /// s = k / (1 + k).
    pub slip_share: f64,
    /// κ, where it is given and not fitted.
    pub stiffness_ratio: Option<f64>,
    /// What a model that reads e_x from a table has it too large by here, where that is known ([`ReboundModel::table_errors`]).
    pub table_error: f64,
}

/// A tangential impulse per mass against the slip, m/s, with its derivatives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TangentialImpulse {
    /// P, positive where it slows the slip.
    pub value: f64,
    /// By the slip.
    pub by_slip: f64,
    /// By |v_oz|.
    pub by_normal: f64,
    /// By each of the parameters.
    pub by_parameter: Theta,
}

/// What a model makes of a single bounce.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BounceReading {
    /// The model's own coefficient beside e.
    pub parameter: Parameter,
    /// What the bounce says of it.
    pub quantity: Option<Quantity>,
    /// What the contact point did, in the model's terms; `None` where the bounce does not tell.
    pub regime: Option<Regime>,
}

/// What was measured of a single bounce, before any model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BounceNumbers {
    /// μ, where the ball slid.
    pub friction: Option<Quantity>,
    /// What μ is at least, where it did not.
    pub friction_at_least: Option<Quantity>,
    /// e_x.
    pub tangential_restitution: Option<Quantity>,
    /// What became of the slip, as far as its uncertainty tells: slowed, stopped or reversed.
    pub slip: Option<Regime>,
}

/// A coefficient at a second bounce against the first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoefficientChange {
    /// Second less first, in standard uncertainties of the difference.
    pub sigmas: f64,
    /// Whether the model holds with one coefficient for both.
    pub agrees: bool,
}

/// Names and kind of a model.
#[derive(Debug, Clone, Copy)]
pub struct ModelFacts {
    /// Its name in files.
    pub name: &'static str,
    /// What people call it.
    pub label: &'static str,
    /// What it is, in a few words.
    pub summary: &'static str,
    /// The coefficients that a scene gives, in the order in which they are taken.
    pub coefficients: &'static [Coefficient],
    /// How friction ends grip.
    pub friction_limit: FrictionLimit,
    /// The names of the models that it holds as special cases.
    pub special_cases: &'static [&'static str],
    /// Its own parameters; the spin before a bounce is of any.
    pub parameters: &'static [Parameter],
}

/// A rebound model, whatever its coefficients.
pub trait ReboundModel: Sync {
    /// What does not depend on anything.
    fn facts(&self) -> &'static ModelFacts;

    /// Why it does not have a parameter; `None` where it does.
    fn lacks(&self, parameter: Parameter) -> Option<&'static str> {
        let has = parameter == Parameter::SpinRatio || self.facts().parameters.contains(&parameter);
        (!has).then(|| self.without(parameter).unwrap_or(parameter.absent()))
    }

    /// Why it does not have a parameter, where it has better words for it than any model.
    fn without(&self, _parameter: Parameter) -> Option<&'static str> {
        None
    }

    /// The parameters that results tell of, also to say that the model lacks them.
    fn reported(&self) -> &'static [Parameter] {
        &Parameter::ALL
    }

    /// Whether [`Self::grip`] is in proportion to the slip, so that one step finds the nearest motion to a row.
    fn grip_is_linear(&self) -> bool {
        true
    }

    /// Whether the ball slides throughout under [`Self::grip`]: with a limit of friction it never does, as it is beyond the
    /// limit then.
    fn slides_within_grip(&self, _at: &Incidence, _theta: &Theta) -> bool {
        false
    }

    /// For a model without a limit of friction that lets a ball slide all the same: tan θ |1 − R ω_oy/u_o| beyond which it
    /// does; k comes as s.
    fn sliding_tangent(&self, _theta: &Theta, _slip_share: f64) -> Option<f64> {
        None
    }

    /// What [`Self::grip`] has e_x too large by at each of these motions; `None` of a model that reads it from no table.
    fn table_errors(&self, _at: &[Incidence], _theta: &Theta) -> Option<Vec<f64>> {
        None
    }

    /// The impulse below the limit of friction: s (1 + e_x) c, unless the model has another.
    fn grip(&self, at: &Incidence, theta: &Theta) -> TangentialImpulse {
        let by_slip = at.slip_share * (1.0 + theta[E_X]);
        let mut by_parameter = [0.0; PARAMETERS];
        by_parameter[E_X] = at.slip_share * at.slip_m_s;
        TangentialImpulse {
            value: by_slip * at.slip_m_s,
            by_slip,
            by_normal: 0.0,
            by_parameter,
        }
    }

    /// The name of a model that says the same where no row slides, and in what sense, for the reason of a choice.
    fn same_without_sliding(&self) -> Option<(&'static str, &'static str)> {
        None
    }

    /// What a single bounce says; `None` of a model that one bounce cannot tell from others.
    fn read(&self, _bounce: &BounceNumbers) -> Option<BounceReading> {
        None
    }

    /// Whether a single bounce may do this.
    fn allows(&self, _slip: Regime) -> bool {
        true
    }

    /// Whether two bounces have its coefficient in common; `None` where that cannot be told.
    fn change(&self, _first: &BounceNumbers, _second: &BounceNumbers) -> Option<CoefficientChange> {
        None
    }

    /// A regime of a single bounce in plain words.
    fn regime_words(&self, _regime: Option<Regime>) -> &'static str {
        ""
    }

    /// That it describes the bounces of a recording better, as a sentence without its full stop.
    fn preferred_words(&self) -> &'static str {
        ""
    }
}

/// (second − first) in standard uncertainties of the difference, taking them as independent.
#[must_use]
pub fn sigmas_apart(first: Option<Quantity>, second: Option<Quantity>) -> Option<f64> {
    let (a, b) = (first?, second?);
    Some((b.value - a.value) / a.std_uncertainty?.hypot(b.std_uncertainty?))
}
