//! The μ-e model: Amontons-Coulomb friction \[8–16\].
//!
//! ```text
//! impulse that stops the slip    P_stop = s |c|
//! nonsliding where               s |c| <= μ_o (1 + e) |v_oz|      P = −s c
//! sliding otherwise              P = −μ (1 + e) |v_oz| c/|c|
//! ```

use super::impulse::{
    Regime, RigidMotion, apply_grip, apply_impulse, length, limiting_angle_rad, normal_impulse_m_s,
    rebound_tangent, sliding_impulse_m_s, slip_share,
};
use super::model::{
    BounceNumbers, BounceReading, Coefficient, CoefficientChange, Contradiction, FRICTION_RANGE,
    FittedCoefficients, FrictionLimit, ModelFacts, RESTITUTION_RANGE, ReboundLaw, ReboundModel, sigmas_apart,
};
use super::parameter::{E, Parameter};
use nalgebra::Vector2;

/// Coefficients of the μ-e model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameters {
    /// e, normal coefficient of restitution.
    pub restitution: f64,
    /// μ, of a ball that slides.
    pub friction: f64,
    /// μ_o ≥ μ, which decides whether it slides.
    pub static_friction: f64,
}

/// The motion after an impact, and its regime. A ball without slip counts as nonsliding.
#[must_use]
pub fn impact(incoming: &RigidMotion, parameters: &Parameters, inertia_factor: f64) -> (RigidMotion, Regime) {
    let Parameters {
        restitution,
        friction,
        static_friction,
    } = *parameters;
    let slip = incoming.slip_m_s();
    let stop = length(&slip) * slip_share(inertia_factor);
    if stop <= static_friction * normal_impulse_m_s(incoming, restitution) {
        let rolls = apply_grip(incoming, restitution, &Vector2::x(), (0.0, 0.0), inertia_factor);
        (rolls, Regime::Nonsliding)
    } else {
        let tangential = sliding_impulse_m_s(incoming, restitution, friction);
        let slides = apply_impulse(incoming, restitution, tangential, inertia_factor);
        (slides, Regime::Sliding)
    }
}

/// Incident angle above which the ball slides, rad \[16\]: tan θ_L = (1/s) μ_o (1 + e) / |1 − R ω_oy/u_o|, where
/// `spin_ratio` = R ω_oy / u_o at the impact. π/2 for a ball that rolls already (or has no inertia, k = 0).
#[must_use]
pub fn transition_angle_rad(parameters: &Parameters, spin_ratio: f64, inertia_factor: f64) -> f64 {
    let limit = parameters.static_friction * (1.0 + parameters.restitution);
    limiting_angle_rad(limit, slip_share(inertia_factor), spin_ratio)
}

/// tan φ of a ball that slides \[14\], for motion in the x-z plane: (tan θ − σ μ (1 + e)) / e, where σ is the sign of
/// the slip v_ox − R ω_oy (0 for a ball that rolls already). `None` for a ball that stays down (e = 0).
#[must_use]
pub fn sliding_rebound_tangent(
    parameters: &Parameters,
    incident_tangent: f64,
    spin_ratio: f64,
) -> Option<f64> {
    let slip = incident_tangent * (1.0 - spin_ratio);
    let direction = if slip == 0.0 { 0.0 } else { slip.signum() };
    let e = parameters.restitution;
    rebound_tangent(incident_tangent - direction * parameters.friction * (1.0 + e), e)
}

/// tan φ of a ball that leaves rolling \[15\]: ((1 − s) + s R ω_oy/u_o) tan θ / e; `None` where e = 0.
#[must_use]
pub fn nonsliding_rebound_tangent(
    restitution: f64,
    incident_tangent: f64,
    spin_ratio: f64,
    inertia_factor: f64,
) -> Option<f64> {
    let s = slip_share(inertia_factor);
    rebound_tangent(((1.0 - s) + s * spin_ratio) * incident_tangent, restitution)
}

impl ReboundLaw for Parameters {
    fn impact(&self, incoming: &RigidMotion, inertia_factor: f64) -> (RigidMotion, Regime) {
        impact(incoming, self, inertia_factor)
    }

    fn restitution(&self) -> f64 {
        self.restitution
    }

    fn transition_rad(&self, spin_ratio: f64, inertia_factor: f64) -> Option<f64> {
        self.static_friction
            .is_finite()
            .then(|| transition_angle_rad(self, spin_ratio, inertia_factor))
    }
}

impl Parameters {
    /// From the coefficients of [`FACTS`].
    ///
    /// # Errors
    ///
    /// Static friction below friction.
    pub(super) fn from_scene(
        [restitution, friction, static_friction]: [f64; 3],
    ) -> Result<Self, Contradiction> {
        if static_friction < friction {
            return Err(Contradiction {
                key: "static_friction",
                accepted: format!("at least friction, {friction}"),
                hint: "a surface that holds worse than it slides has no transition; exchange the two",
            });
        }
        Ok(Self {
            restitution,
            friction,
            static_friction,
        })
    }

    /// As fitted; where no row slides, friction is enough for any.
    pub(super) fn from_fit(fitted: &FittedCoefficients) -> Self {
        let friction = fitted.friction.unwrap_or(f64::INFINITY);
        Self {
            restitution: fitted.theta[E],
            friction,
            static_friction: fitted
                .static_friction
                .map_or(f64::INFINITY, |limit| limit.max(friction)),
        }
    }
}

const FACTS: ModelFacts = ModelFacts {
    name: "mu_e",
    label: "μ-e",
    summary: "Coulomb friction",
    coefficients: &[
        Coefficient::required("restitution", RESTITUTION_RANGE),
        Coefficient::required("friction", FRICTION_RANGE),
        Coefficient::like("friction", "static_friction", FRICTION_RANGE),
    ],
    friction_limit: FrictionLimit::AtStaticFriction,
    special_cases: &[],
    parameters: &[
        Parameter::Restitution,
        Parameter::Friction,
        Parameter::StaticFriction,
    ],
};

/// The μ-e model, whatever its coefficients.
pub struct MuEModel;

impl ReboundModel for MuEModel {
    fn facts(&self) -> &'static ModelFacts {
        &FACTS
    }

    fn without(&self, parameter: Parameter) -> Option<&'static str> {
        (parameter == Parameter::TangentialRestitution)
            .then_some("the mu_e model has none: a ball that does not slide leaves rolling, which is e_x = 0")
    }

    fn same_without_sliding(&self) -> Option<(&'static str, &'static str)> {
        Some((
            "e_e",
            "no row slides, and none needs an e_x other than 0, with which e_e says what mu_e says",
        ))
    }

    fn read(&self, bounce: &BounceNumbers) -> Option<BounceReading> {
        Some(BounceReading {
            parameter: Parameter::Friction,
            // Without sliding, friction is only known to be enough.
            quantity: bounce.friction,
            regime: match bounce.slip {
                Some(Regime::Ordinary | Regime::Sliding) => Some(Regime::Sliding),
                Some(Regime::Nonsliding) => Some(Regime::Nonsliding),
                // More tangential impulse than stops the slip: Coulomb friction cannot give it.
                _ => None,
            },
        })
    }

    fn allows(&self, slip: Regime) -> bool {
        slip != Regime::Grip
    }

    fn change(&self, first: &BounceNumbers, second: &BounceNumbers) -> Option<CoefficientChange> {
        let sigmas = sigmas_apart(first.friction, second.friction.or(second.friction_at_least))?;
        Some(CoefficientChange {
            sigmas,
            agrees: match second.slip {
                Some(Regime::Ordinary) => sigmas.abs() < 2.0,
                // A second bounce that rolls off needs less friction than sliding would give; and of one that may have slid or not no more is known.
                Some(Regime::Nonsliding) | None => sigmas < 2.0,
                Some(_) => false,
            },
        })
    }

    fn regime_words(&self, regime: Option<Regime>) -> &'static str {
        match regime {
            Some(Regime::Sliding) => {
                "the ball slid on the floor for the whole contact, with friction at its limit: the change of \
                 horizontal speed gives μ"
            }
            Some(_) => {
                "friction stopped the slip before the ball left: it leaves rolling, and the bounce gives only a lower \
                 limit for μ"
            }
            None => {
                "the uncertainties do not tell whether the ball slid to the end of the contact or left rolling"
            }
        }
    }

    fn preferred_words(&self) -> &'static str {
        "the μ-e model (Coulomb friction) describes the bounces of this recording better"
    }
}
