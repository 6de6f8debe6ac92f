//! Compliant contact (Maw, Barber, Fawcett 1976): ball and floor give way sideways as they do when pressed together, and friction
//! holds at each place of the contact up to its own limit.
//!
//! ```text
//! ψ₁ = κ |c| / (μ |v_oz|)        κ = G*/E*, sideways stiffness over that against being pressed together
//! e_x = e_x(ψ₁; λ, e)            λ = κ (1 + 1/k) = κ/s          P = −s (1 + e_x) c
//!
//! ψ₁ >= ψ* = λ (1 + e) − e³      sliding throughout, P = −μ (1 + e) |v_oz| c/|c|  (at least λ and 1)
//! 1 < ψ₁ < ψ*                    slides at the touch, sticks, slides at the end
//! ψ₁ <= 1                        sticks first, slides at the end
//! μ → ∞                          ψ₁ = 0, one e_x whatever the incidence
//! κ → ∞                          μ-e with μ_o = μ: leaves rolling, or slides
//! ```
//!
//! e_x is what the springs of [`springs`] make of the contact; the master curve of the field is ψ₂ = −e_x ψ₁ against ψ₁. For e = 1,
//! ψ* = 4χ − 1 and ψ₂ = ψ₁ − 4χ beyond, χ = λ/2.
//!
//! # Limits
//!
//! Meant for like, elastic bodies (κ then follows from Poisson's number, [`stiffness`]). What a rubber or a hollow ball loses, it loses sideways as
//! well, and bending is no contact: κ is a number to be fitted then, not one of the material.

pub mod springs;
pub mod stiffness;
pub mod table;

use super::impulse::{
    Regime, RigidMotion, apply_grip, apply_impulse, length, limiting_angle_rad, sliding_impulse_m_s,
    slip_share,
};
use super::model::{
    Coefficient, ContactMoment, FRICTION_RANGE, FittedCoefficients, FrictionLimit, Incidence, ModelFacts,
    RESTITUTION_RANGE, ReboundLaw, ReboundModel, TangentialImpulse,
};
use super::mu_e;
use super::parameter::{E, KAPPA, MU, PARAMETERS, Parameter, Theta};
use crate::config::NumberRange;
use nalgebra::Vector2;
use rayon::prelude::*;
use table::{Interpolated, Marks};

/// λ beyond which a contact counts as rigid sideways: what is left of its swing moves v_x by 1e-5 of the speed (`a_stiff_contact_is_mu_e`).
const RIGID: f64 = 1e4;

/// Coefficients of the compliant model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameters {
    /// e, normal coefficient of restitution.
    pub restitution: f64,
    /// μ.
    pub friction: f64,
    /// κ = G*/E*.
    pub stiffness_ratio: f64,
}

impl Parameters {
    /// λ = κ/s.
    #[must_use]
    pub fn stiffness(&self, inertia_factor: f64) -> f64 {
        self.stiffness_ratio / slip_share(inertia_factor)
    }

    /// ψ₁ of a slip and a normal speed, both m/s; infinite without friction.
    #[must_use]
    pub fn incidence(&self, slip_m_s: f64, normal_m_s: f64) -> f64 {
        let slip = self.stiffness_ratio * slip_m_s.abs();
        if slip == 0.0 {
            0.0
        } else {
            slip / (self.friction * normal_m_s)
        }
    }

    /// ψ* of a ball with this inertia factor.
    #[must_use]
    pub fn sliding_incidence(&self, inertia_factor: f64) -> f64 {
        Marks::new(self.stiffness(inertia_factor), self.restitution).sliding()
    }

    /// e_x at ψ₁, of a ball with this inertia factor.
    #[must_use]
    pub fn tangential_restitution(&self, incidence: f64, inertia_factor: f64) -> f64 {
        let lambda = self.stiffness(inertia_factor);
        if incidence >= self.sliding_incidence(inertia_factor) {
            return lambda * (1.0 + self.restitution) / incidence - 1.0;
        }
        springs::tangential_restitutions(&[incidence], lambda, self.restitution)[0]
    }
}

/// The motion after an impact, and its regime. A ball without slip sticks.
#[must_use]
pub fn impact(incoming: &RigidMotion, parameters: &Parameters, inertia_factor: f64) -> (RigidMotion, Regime) {
    impacts(std::slice::from_ref(incoming), parameters, inertia_factor)[0]
}

/// The same of several, whose springs go through at once.
fn impacts(
    incoming: &[RigidMotion],
    parameters: &Parameters,
    inertia_factor: f64,
) -> Vec<(RigidMotion, Regime)> {
    let Parameters {
        restitution,
        friction,
        ..
    } = *parameters;
    let lambda = parameters.stiffness(inertia_factor);
    // (Positively, for k = 0, where s = 0.)
    if !(lambda <= RIGID) {
        let rigid = mu_e::Parameters {
            restitution,
            friction,
            static_friction: friction,
        };
        let rigid = |one: &RigidMotion| mu_e::impact(one, &rigid, inertia_factor);
        return incoming.iter().map(rigid).collect();
    }
    let sliding = parameters.sliding_incidence(inertia_factor);
    let psi = |one: &RigidMotion| {
        let slip = length(&one.slip_m_s());
        parameters.incidence(slip, one.velocity_m_s.z.abs())
    };
    let psi: Vec<f64> = incoming.iter().map(psi).collect();
    let below: Vec<f64> = psi.iter().copied().filter(|psi| !(*psi >= sliding)).collect();
    let mut e_x = springs::tangential_restitutions(&below, lambda, restitution).into_iter();
    let after = |(one, psi): (&RigidMotion, &f64)| {
        if *psi >= sliding {
            let tangential = sliding_impulse_m_s(one, restitution, friction);
            let slides = apply_impulse(one, restitution, tangential, inertia_factor);
            return (slides, Regime::Sliding);
        }
        let e_x = e_x.next().expect("there is one for each below ψ*");
        let sticks = apply_grip(one, restitution, &Vector2::x(), (e_x, e_x), inertia_factor);
        (sticks, regime(*psi))
    };
    incoming.iter().zip(&psi).map(after).collect()
}

/// What the contact point does below ψ*.
fn regime(psi: f64) -> Regime {
    if psi > 1.0 {
        Regime::SlipStickSlip
    } else {
        Regime::StickSlip
    }
}

impl ReboundLaw for Parameters {
    fn impact(&self, incoming: &RigidMotion, inertia_factor: f64) -> (RigidMotion, Regime) {
        impact(incoming, self, inertia_factor)
    }

    fn impacts(&self, incoming: &[RigidMotion], inertia_factor: f64) -> Vec<(RigidMotion, Regime)> {
        impacts(incoming, self, inertia_factor)
    }

    fn restitution(&self) -> f64 {
        self.restitution
    }

    fn contact_path(&self, incoming: &RigidMotion, inertia_factor: f64) -> Option<Vec<ContactMoment>> {
        let lambda = self.stiffness(inertia_factor);
        let normal = incoming.velocity_m_s.z.abs();
        if !(lambda <= RIGID && normal > 0.0) {
            return None;
        }
        // Beyond ψ* the share is that of the normal force; so it is of a ball without slip.
        let sliding = self.sliding_incidence(inertia_factor);
        let psi = self.incidence(length(&incoming.slip_m_s()), normal);
        let psi = if psi > 0.0 { psi.min(sliding) } else { sliding };
        Some(springs::path(psi, lambda, self.restitution))
    }

    /// tan θ = μ ψ* / (κ |1 − R ω_oy/u_o|).
    fn transition_rad(&self, spin_ratio: f64, inertia_factor: f64) -> Option<f64> {
        let limit = self.friction * self.sliding_incidence(inertia_factor) / self.stiffness_ratio;
        limit
            .is_finite()
            .then(|| limiting_angle_rad(limit, 1.0, spin_ratio))
    }
}

impl Parameters {
    /// From the coefficients of [`FACTS`].
    pub(super) fn from_scene([restitution, friction, stiffness_ratio]: [f64; 3]) -> Self {
        Self {
            restitution,
            friction,
            stiffness_ratio,
        }
    }

    /// As fitted.
    pub(super) fn from_fit(fitted: &FittedCoefficients) -> Self {
        let theta = &fitted.theta;
        Self::from_scene([theta[E], theta[MU].max(0.0), theta[KAPPA]])
    }
}

/// Of a stiffness ratio.
pub const STIFFNESS_RATIO_RANGE: NumberRange = NumberRange {
    accepted: "a number from 0.05 to 1e6",
    holds: |x| (0.05..=1e6).contains(&x),
    hint: "2 (1 - nu)/(2 - nu) for bodies of Poisson number nu: 0.82 for 0.3; a contact that is rigid sideways is the mu_e model",
};

const FACTS: ModelFacts = ModelFacts {
    name: "compliant",
    label: "compliant",
    summary: "a contact that gives way sideways",
    coefficients: &[
        Coefficient::required("restitution", RESTITUTION_RANGE),
        Coefficient::required("friction", FRICTION_RANGE),
        Coefficient::required("stiffness_ratio", STIFFNESS_RATIO_RANGE),
    ],
    friction_limit: FrictionLimit::Never,
    // κ → ∞; μ → ∞.
    special_cases: &["mu_e", "e_e"],
    parameters: &[
        Parameter::Restitution,
        Parameter::Friction,
        Parameter::StiffnessRatio,
    ],
};

/// The compliant model, whatever its coefficients.
pub struct CompliantModel;

impl ReboundModel for CompliantModel {
    fn facts(&self) -> &'static ModelFacts {
        &FACTS
    }

    fn without(&self, parameter: Parameter) -> Option<&'static str> {
        match parameter {
            Parameter::TangentialRestitution => {
                Some("the compliant model has none of its own: e_x follows from μ, κ and the incidence")
            }
            Parameter::StaticFriction => Some("the compliant model has no static friction of its own"),
            _ => None,
        }
    }

    fn grip_is_linear(&self) -> bool {
        false
    }

    fn slides_within_grip(&self, at: &Incidence, theta: &Theta) -> bool {
        below_sliding(at, theta).is_none()
    }

    fn sliding_tangent(&self, theta: &Theta, slip_share: f64) -> Option<f64> {
        let sliding = Marks::new(theta[KAPPA] / slip_share, theta[E]).sliding();
        Some(theta[MU] * sliding / theta[KAPPA])
    }

    fn table_errors(&self, at: &[Incidence], theta: &Theta) -> Option<Vec<f64>> {
        // ψ₁ and λ of those that neither slide throughout nor are as good as rigid.
        let mut read: Vec<(usize, f64, f64)> = at
            .iter()
            .enumerate()
            .filter_map(|(i, at)| {
                let lambda = stiffness_ratio(at, theta) / at.slip_share;
                let psi = below_sliding(at, theta)?;
                table::STIFFNESS.contains(&lambda).then_some((i, psi, lambda))
            })
            .collect();
        read.sort_by(|a, b| a.2.total_cmp(&b.2).then(a.1.total_cmp(&b.1)));
        let e = theta[E];
        let of_some = |some: &[(usize, f64, f64)]| -> Vec<(usize, f64)> {
            let psi: Vec<f64> = some.iter().map(|row| row.1).collect();
            // The table has no e beyond 1 either.
            let exact = springs::tangential_restitutions(&psi, some[0].2, e.min(1.0));
            let each = some.iter().zip(exact);
            each.filter_map(|(&(i, psi, lambda), exact)| {
                Some((i, table::interpolated(psi, lambda, e)?.e_x - exact))
            })
            .collect()
        };
        let alike: Vec<&[(usize, f64, f64)]> = read
            .chunk_by(|a, b| a.2 == b.2)
            .flat_map(|same| same.chunks(AT_ONCE))
            .collect();
        let mut errors = vec![0.0; at.len()];
        let found: Vec<Vec<(usize, f64)>> = alike.into_par_iter().map(of_some).collect();
        for (i, error) in found.into_iter().flatten() {
            errors[i] = error;
        }
        Some(errors)
    }

    fn grip(&self, at: &Incidence, theta: &Theta) -> TangentialImpulse {
        let (e, mu, kappa) = (theta[E], theta[MU], stiffness_ratio(at, theta));
        let (b, s) = (at.normal_m_s, at.slip_share);
        let mut by_parameter = [0.0; PARAMETERS];
        if !(kappa > 0.0) {
            return NO_SUCH_CONTACT;
        }
        let Some(psi) = below_sliding(at, theta) else {
            let sign = if at.slip_m_s < 0.0 { -1.0 } else { 1.0 };
            by_parameter[E] = sign * mu * b;
            by_parameter[MU] = sign * (1.0 + e) * b;
            let by_normal = sign * mu * (1.0 + e);
            return TangentialImpulse {
                value: by_normal * b,
                by_slip: 0.0,
                by_normal,
                by_parameter,
            };
        };
        let grip = s * at.slip_m_s;
        if kappa / s >= table::STIFFNESS.end {
            return TangentialImpulse {
                value: grip,
                by_slip: s,
                by_normal: 0.0,
                by_parameter,
            };
        }
        let Some(Interpolated {
            e_x,
            by_log_psi,
            by_stiffness,
            by_restitution,
        }) = table::interpolated(psi, kappa / s, e)
        else {
            return NO_SUCH_CONTACT;
        };
        let e_x = e_x - at.table_error;
        by_parameter[E] = grip * by_restitution;
        by_parameter[MU] = -grip * by_log_psi / mu;
        if at.stiffness_ratio.is_none() {
            by_parameter[KAPPA] = grip * (by_log_psi / kappa + by_stiffness / s);
        }
        TangentialImpulse {
            value: grip * (1.0 + e_x),
            by_slip: s * (1.0 + e_x + by_log_psi),
            by_normal: -grip * by_log_psi / b,
            by_parameter,
        }
    }
}

/// Rows whose springs are worked out by one processor at once.
const AT_ONCE: usize = 256;

/// What a search comes to that leaves the range of κ and e: no χ².
const NO_SUCH_CONTACT: TangentialImpulse = TangentialImpulse {
    value: f64::NAN,
    by_slip: f64::NAN,
    by_normal: f64::NAN,
    by_parameter: [f64::NAN; PARAMETERS],
};

/// κ of a bounce.
fn stiffness_ratio(at: &Incidence, theta: &Theta) -> f64 {
    at.stiffness_ratio.unwrap_or(theta[KAPPA])
}

/// ψ₁, where it is below ψ*. A friction that pushes, which a search may try, has no limit to be below.
fn below_sliding(at: &Incidence, theta: &Theta) -> Option<f64> {
    let (mu, kappa) = (theta[MU], stiffness_ratio(at, theta));
    let lambda = kappa / at.slip_share;
    let psi = kappa * at.slip_m_s.abs() / (mu * at.normal_m_s);
    let sliding = if lambda >= table::STIFFNESS.end {
        lambda * (1.0 + theta[E])
    } else {
        Marks::new(lambda, theta[E]).sliding()
    };
    (mu > 0.0 && psi < sliding).then_some(psi)
}
