//! The e-e model: three coefficients of restitution \[17–24\].
//!
//! ```text
//! slip after = −e_x, −e_y times slip before, component by component      P = −s (1 + e_x, 1 + e_y) c
//! v_x   = [(1 − s) − s e_x] v_ox + s (1 + e_x) R ω_oy                    [19]
//! R ω_y = (1 − s)(1 + e_x) v_ox + [s − (1 − s) e_x] R ω_oy               [21]
//! ```
//!
//! x is the direction of the incident horizontal velocity, as in the paper; of a ball that falls straight, the
//! direction of its slip.

use super::impulse::{
    Regime, RigidMotion, apply_grip, direction, limiting_angle_rad, rebound_tangent as over, slip_share,
};
use super::model::{
    BounceNumbers, BounceReading, Coefficient, CoefficientChange, FittedCoefficients, FrictionLimit,
    ModelFacts, RESTITUTION_RANGE, ReboundLaw, ReboundModel, TANGENTIAL_RANGE, sigmas_apart,
};
use super::parameter::{E, E_X, Parameter};
use nalgebra::Vector2;

/// Coefficients of the e-e model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameters {
    /// e_z.
    pub restitution: f64,
    /// e_x: −1 no friction, 0 leaves rolling, 1 Garwin's ideal superball.
    pub tangential_restitution_x: f64,
    /// e_y, across the incident direction.
    pub tangential_restitution_y: f64,
}

/// The motion after an impact, and its regime by the sign of e_x.
#[must_use]
pub fn impact(incoming: &RigidMotion, parameters: &Parameters, inertia_factor: f64) -> (RigidMotion, Regime) {
    // Without a direction there is neither motion nor slip to change.
    let along = direction(&incoming.velocity_m_s.xy())
        .or_else(|| direction(&incoming.slip_m_s()))
        .unwrap_or_else(Vector2::x);
    let each = (
        parameters.tangential_restitution_x,
        parameters.tangential_restitution_y,
    );
    (
        apply_grip(incoming, parameters.restitution, &along, each, inertia_factor),
        regime(parameters.tangential_restitution_x),
    )
}

/// Ordinary e_x < 0, nonsliding e_x = 0, grip e_x > 0.
#[must_use]
pub fn regime(tangential_restitution_x: f64) -> Regime {
    if tangential_restitution_x > 0.0 {
        Regime::Grip
    } else if tangential_restitution_x < 0.0 {
        Regime::Ordinary
    } else {
        Regime::Nonsliding
    }
}

/// tan φ of a ball without sidespin \[24\]: ([(1 − s) − s e_x] + s (1 + e_x) R ω_oy/u_o) tan θ / e_z.
/// `None` where e_z = 0.
#[must_use]
pub fn rebound_tangent(
    parameters: &Parameters,
    incident_tangent: f64,
    spin_ratio: f64,
    inertia_factor: f64,
) -> Option<f64> {
    let s = slip_share(inertia_factor);
    let e_x = parameters.tangential_restitution_x;
    let kept = (1.0 - s) - s * e_x + s * (1.0 + e_x) * spin_ratio;
    over(kept * incident_tangent, parameters.restitution)
}

/// Incident angle at which grip would need more than the friction `friction`, rad:
/// tan θ_G = (1/s) μ (1 + e) / [(1 + e_x) |1 − R ω_oy/u_o|]. π/2 for a ball that rolls already or feels no friction.
#[must_use]
pub fn grip_limit_angle_rad(
    restitution: f64,
    tangential_restitution_x: f64,
    friction: f64,
    spin_ratio: f64,
    inertia_factor: f64,
) -> f64 {
    let grip = slip_share(inertia_factor) * (1.0 + tangential_restitution_x);
    limiting_angle_rad(friction * (1.0 + restitution), grip, spin_ratio)
}

impl ReboundLaw for Parameters {
    fn impact(&self, incoming: &RigidMotion, inertia_factor: f64) -> (RigidMotion, Regime) {
        impact(incoming, self, inertia_factor)
    }

    fn restitution(&self) -> f64 {
        self.restitution
    }

    fn transition_rad(&self, _spin_ratio: f64, _inertia_factor: f64) -> Option<f64> {
        None
    }
}

impl Parameters {
    /// From the coefficients of [`FACTS`].
    pub(super) fn from_scene([restitution, x, y]: [f64; 3]) -> Self {
        Self {
            restitution,
            tangential_restitution_x: x,
            tangential_restitution_y: y,
        }
    }

    /// As fitted.
    pub(super) fn from_fit(fitted: &FittedCoefficients) -> Self {
        Self::from_scene([fitted.theta[E], fitted.theta[E_X], fitted.theta[E_X]])
    }
}

const FACTS: ModelFacts = ModelFacts {
    name: "e_e",
    label: "e-e",
    summary: "restitution sideways, too",
    coefficients: &[
        Coefficient::required("restitution", RESTITUTION_RANGE),
        Coefficient::required("tangential_restitution_x", TANGENTIAL_RANGE),
        Coefficient::like(
            "tangential_restitution_x",
            "tangential_restitution_y",
            TANGENTIAL_RANGE,
        ),
    ],
    friction_limit: FrictionLimit::Never,
    special_cases: &[],
    parameters: &[Parameter::Restitution, Parameter::TangentialRestitution],
};

/// The e-e model, whatever its coefficients.
pub struct EEModel;

impl ReboundModel for EEModel {
    fn facts(&self) -> &'static ModelFacts {
        &FACTS
    }

    fn without(&self, parameter: Parameter) -> Option<&'static str> {
        match parameter {
            Parameter::Friction => Some("the e_e model has no friction"),
            Parameter::StaticFriction => Some("the e_e model has no static friction of its own"),
            _ => None,
        }
    }

    fn read(&self, bounce: &BounceNumbers) -> Option<BounceReading> {
        Some(BounceReading {
            parameter: Parameter::TangentialRestitution,
            quantity: bounce.tangential_restitution,
            regime: bounce.slip,
        })
    }

    fn change(&self, first: &BounceNumbers, second: &BounceNumbers) -> Option<CoefficientChange> {
        let sigmas = sigmas_apart(first.tangential_restitution, second.tangential_restitution)?;
        Some(CoefficientChange {
            sigmas,
            agrees: sigmas.abs() < 2.0,
        })
    }

    fn regime_words(&self, regime: Option<Regime>) -> &'static str {
        match regime {
            Some(Regime::Ordinary | Regime::Sliding) => {
                "e_x below 0: the ball's lowest point was still slipping forward when it left"
            }
            Some(Regime::Nonsliding) => {
                "e_x equal to 0 within its uncertainty: the ball left rolling, its lowest point at rest on the floor"
            }
            Some(Regime::Grip) => {
                "e_x above 0: the contact gripped and sprang back sideways, as a superball does; the ball leaves \
                 spinning faster than it would roll"
            }
            _ => "the uncertainty of e_x does not tell its sign (or the spin before the bounce is not known)",
        }
    }

    fn preferred_words(&self) -> &'static str {
        "the e-e model (horizontal restitution) describes the bounces of this recording better"
    }
}
