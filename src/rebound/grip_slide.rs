//! Grip until the friction limit, then sliding: the e-e impulse where friction can supply it, the Coulomb limit
//! where it cannot.
//!
//! ```text
//! grip where     s (1 + e_x) |c| <= μ (1 + e) |v_oz|      P = −s (1 + e_x) c
//! sliding        otherwise                                P = −μ (1 + e) |v_oz| c/|c|
//! ```
//!
//! One e_x for both horizontal directions: both branches act along −c, so the model is continuous at the transition
//! and looks the same from every side. With e_x = 0 and μ_o = μ it is the μ-e model.

use super::e_e;
use super::impulse::{
    Regime, RigidMotion, apply_grip, apply_impulse, length, normal_impulse_m_s, sliding_impulse_m_s,
    slip_share,
};
use super::model::{
    Coefficient, FRICTION_RANGE, FittedCoefficients, FrictionLimit, ModelFacts, RESTITUTION_RANGE,
    ReboundLaw, ReboundModel, TANGENTIAL_RANGE,
};
use super::parameter::{E, E_X, Parameter};
use nalgebra::Vector2;

/// Coefficients of the grip-slide model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameters {
    /// e_z.
    pub restitution: f64,
    /// e_x while friction holds.
    pub tangential_restitution_x: f64,
    /// μ, the limit of friction.
    pub friction: f64,
}

/// The motion after an impact, and its regime: sliding, or that of e_x by its sign.
#[must_use]
pub fn impact(incoming: &RigidMotion, parameters: &Parameters, inertia_factor: f64) -> (RigidMotion, Regime) {
    let Parameters {
        restitution,
        tangential_restitution_x,
        friction,
    } = *parameters;
    let e_x = tangential_restitution_x;
    let grip = slip_share(inertia_factor) * (1.0 + e_x) * length(&incoming.slip_m_s());
    if grip <= friction * normal_impulse_m_s(incoming, restitution) {
        let grips = apply_grip(incoming, restitution, &Vector2::x(), (e_x, e_x), inertia_factor);
        (grips, e_e::regime(e_x))
    } else {
        let tangential = sliding_impulse_m_s(incoming, restitution, friction);
        let slides = apply_impulse(incoming, restitution, tangential, inertia_factor);
        (slides, Regime::Sliding)
    }
}

/// Incident angle above which the ball slides, rad; see [`e_e::grip_limit_angle_rad`].
#[must_use]
pub fn transition_angle_rad(parameters: &Parameters, spin_ratio: f64, inertia_factor: f64) -> f64 {
    e_e::grip_limit_angle_rad(
        parameters.restitution,
        parameters.tangential_restitution_x,
        parameters.friction,
        spin_ratio,
        inertia_factor,
    )
}

impl ReboundLaw for Parameters {
    fn impact(&self, incoming: &RigidMotion, inertia_factor: f64) -> (RigidMotion, Regime) {
        impact(incoming, self, inertia_factor)
    }

    fn restitution(&self) -> f64 {
        self.restitution
    }

    fn transition_rad(&self, spin_ratio: f64, inertia_factor: f64) -> Option<f64> {
        self.friction
            .is_finite()
            .then(|| transition_angle_rad(self, spin_ratio, inertia_factor))
    }
}

impl Parameters {
    /// From the coefficients of [`FACTS`].
    pub(super) fn from_scene([restitution, friction, x]: [f64; 3]) -> Self {
        Self {
            restitution,
            tangential_restitution_x: x,
            friction,
        }
    }

    /// As fitted; where no row slides, friction is enough for any.
    pub(super) fn from_fit(fitted: &FittedCoefficients) -> Self {
        let friction = fitted.friction.unwrap_or(f64::INFINITY);
        Self::from_scene([fitted.theta[E], friction, fitted.theta[E_X]])
    }
}

const FACTS: ModelFacts = ModelFacts {
    name: "grip_slide",
    label: "grip-slide",
    summary: "restitution sideways up to the limit of friction",
    coefficients: &[
        Coefficient::required("restitution", RESTITUTION_RANGE),
        Coefficient::required("friction", FRICTION_RANGE),
        Coefficient::required("tangential_restitution_x", TANGENTIAL_RANGE),
    ],
    friction_limit: FrictionLimit::AtFriction,
    // e_x = 0; friction never reached.
    special_cases: &["mu_e", "e_e"],
    parameters: &[
        Parameter::Restitution,
        Parameter::Friction,
        Parameter::TangentialRestitution,
    ],
};

/// The grip-slide model, whatever its coefficients.
pub struct GripSlideModel;

impl ReboundModel for GripSlideModel {
    fn facts(&self) -> &'static ModelFacts {
        &FACTS
    }

    fn without(&self, parameter: Parameter) -> Option<&'static str> {
        (parameter == Parameter::StaticFriction)
            .then_some("the grip_slide model has no static friction of its own")
    }
}
