//! What a compliant contact of known stiffness makes of a recording's first bounce, beside what was measured.
//!
//! κ, e and k are known; friction is not, unless another bounce of the recording tells it: then the first bounce is foretold, and how far
//! it is off shows whether the model holds. With one bounce alone friction is chosen to suit it, and only an e_x that no friction
//! gives speaks against the model. Often several frictions suit one bounce, as e_x rises and falls with the incidence: then friction is not
//! known, and foretells nothing.

use super::Bounce;
use crate::numeric::parabola::Parabola;
use crate::quantity::Quantity;
use crate::rebound::Regime;
use crate::rebound::compliant::{Parameters, table};
use crate::rebound::slip_share;

/// What is known of a contact beforehand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownContact {
    /// κ.
    pub stiffness_ratio: f64,
    /// k.
    pub inertia_factor: f64,
}

/// Where the friction of a prediction is from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrictionSource {
    /// The recording's other bounces: the first one tests the model.
    OtherBounces,
    /// The bounce itself.
    ThisBounce,
}

/// A number as the model has it, beside the measured one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Foretold {
    /// By the model.
    pub predicted: Option<Quantity>,
    /// Measured.
    pub measured: Option<Quantity>,
}

impl Foretold {
    /// Measured less predicted, in standard uncertainties of the difference.
    #[must_use]
    pub fn sigmas(&self) -> Option<f64> {
        let (predicted, measured) = (self.predicted?, self.measured?);
        let std = measured.std_uncertainty?.hypot(predicted.std_uncertainty?);
        Some((measured.value - predicted.value) / std).filter(|sigmas| sigmas.is_finite())
    }
}

/// The compliant model's reading of a bounce.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CompliantReading {
    /// κ.
    pub stiffness_ratio: f64,
    /// μ.
    pub friction: Option<Quantity>,
    /// Whose.
    pub source: FrictionSource,
    /// ψ₁.
    pub incidence: Option<Quantity>,
    /// What the contact point did.
    pub regime: Option<Regime>,
    /// e_x.
    pub tangential_restitution: Foretold,
    /// Along the floor after, m/s.
    pub tangential_m_s: Foretold,
    /// R ω_y after, m/s.
    pub spin_out_m_s: Foretold,
}

/// Least and largest friction that is looked at: ice on ice, rubber on rubber.
const FRICTION: (f64, f64) = (0.003, 6.0);

/// Steps between them, in their logarithm.
const STEPS: usize = 300;

/// Friction that is less certain than this part of itself is not known.
const VAGUE: f64 = 0.5;

/// The reading of the first of `bounces`; `None` where what came in is not known, or is no slip.
#[must_use]
pub fn read(bounces: &[Bounce], contact: KnownContact) -> Option<CompliantReading> {
    let first = Incoming::new(bounces.first()?, contact)?;
    let others: Vec<Incoming> = bounces[1..]
        .iter()
        .filter_map(|bounce| Incoming::new(bounce, contact))
        .collect();
    let vague = |friction: &Quantity| {
        friction
            .std_uncertainty
            .is_none_or(|s| s >= VAGUE * friction.value)
    };
    let told =
        |bounces: &[Incoming]| best_friction(bounces).filter(|best| !best.known.as_ref().is_none_or(vague));
    let (best, source) = match told(&others) {
        Some(best) => (best, FrictionSource::OtherBounces),
        None => (
            best_friction(std::slice::from_ref(&first))?,
            FrictionSource::ThisBounce,
        ),
    };
    let friction_std = best.known.and_then(|friction| friction.std_uncertainty);
    let friction = best.value;
    let bounce = bounces.first()?;
    let measured_m_s = bounce
        .along_floor
        .as_ref()
        .map_or(bounce.rebound.vx_m_s, |along| along.rebound_m_s.0);
    // Friction that was made to suit this bounce brings the bounce's own error, once.
    let brought = match source {
        FrictionSource::OtherBounces => friction_std,
        FrictionSource::ThisBounce => Some(0.0),
    };
    let foretold = |of: &dyn Fn(&Incoming, f64) -> Option<f64>, measured| Foretold {
        predicted: first.propagated(friction, brought, of),
        measured,
    };
    let psi = |i: &Incoming, mu: f64| Some(i.law(mu).incidence(i.slip_m_s(), i.normal_m_s));
    let incidence = first.propagated(friction, friction_std, &psi);
    Some(CompliantReading {
        stiffness_ratio: contact.stiffness_ratio,
        friction: best.known,
        source,
        incidence,
        regime: incidence.map(|psi| {
            if psi.value >= first.law(friction).sliding_incidence(contact.inertia_factor) {
                Regime::Sliding
            } else if psi.value > 1.0 {
                Regime::SlipStickSlip
            } else {
                Regime::StickSlip
            }
        }),
        tangential_restitution: foretold(&Incoming::e_x, bounce.tangential_restitution),
        tangential_m_s: foretold(&Incoming::tangential_m_s, measured_m_s),
        spin_out_m_s: foretold(&Incoming::spin_out_m_s, bounce.spin_out_m_s),
    })
}

/// A bounce before it happens, with what it came to.
#[derive(Debug, Clone, Copy)]
struct Incoming {
    contact: KnownContact,
    restitution: f64,
    tangential_m_s: f64,
    normal_m_s: f64,
    spin_m_s: f64,
    /// Standard uncertainties of these three.
    stds: [f64; 3],
    e_x: (f64, f64),
}

impl Incoming {
    fn new(bounce: &Bounce, contact: KnownContact) -> Option<Self> {
        let (tangential, normal) = bounce
            .along_floor
            .as_ref()
            .map_or((bounce.incident.vx_m_s, bounce.incident.vz_m_s), |along| {
                along.incident_m_s
            });
        let (tangential, normal, spin) = (tangential?, normal?, bounce.spin_in_m_s?);
        let e_x = bounce.tangential_restitution?;
        let std = |quantity: Quantity| quantity.std_uncertainty.unwrap_or(0.0);
        let incoming = Self {
            contact,
            restitution: bounce.restitution?.value.clamp(0.1, 1.0),
            tangential_m_s: tangential.value,
            normal_m_s: normal.value.abs(),
            spin_m_s: spin.value,
            stds: [std(tangential), std(normal), std(spin)],
            e_x: (e_x.value, e_x.std_uncertainty?),
        };
        (incoming.slip_m_s() != 0.0 && incoming.normal_m_s > 0.0).then_some(incoming)
    }

    fn slip_m_s(&self) -> f64 {
        self.tangential_m_s - self.spin_m_s
    }

    fn law(&self, friction: f64) -> Parameters {
        Parameters {
            restitution: self.restitution,
            friction,
            stiffness_ratio: self.contact.stiffness_ratio,
        }
    }

    /// e_x by the model.
    fn e_x(&self, friction: f64) -> Option<f64> {
        let (law, k) = (self.law(friction), self.contact.inertia_factor);
        let psi = law.incidence(self.slip_m_s(), self.normal_m_s);
        Some(law.tangential_restitution(psi, k))
    }

    /// The same by the table, good enough to choose between frictions in steps of 2.5 %.
    fn tabled_e_x(&self, friction: f64) -> Option<f64> {
        let (law, k) = (self.law(friction), self.contact.inertia_factor);
        let psi = law.incidence(self.slip_m_s(), self.normal_m_s);
        if psi >= law.sliding_incidence(k) {
            return Some(law.tangential_restitution(psi, k));
        }
        // (The table's reach; beyond it the springs themselves.)
        let found = table::interpolated(psi, law.stiffness(k), self.restitution).map(|found| found.e_x);
        Some(found.unwrap_or_else(|| law.tangential_restitution(psi, k)))
    }

    fn tangential_m_s(&self, friction: f64) -> Option<f64> {
        let share = slip_share(self.contact.inertia_factor);
        Some(self.tangential_m_s - share * (1.0 + self.e_x(friction)?) * self.slip_m_s())
    }

    fn spin_out_m_s(&self, friction: f64) -> Option<f64> {
        let lost = self.tangential_m_s - self.tangential_m_s(friction)?;
        Some(self.spin_m_s + lost / self.contact.inertia_factor)
    }

    /// A function of what comes in and of friction, with the uncertainty that all of them give it.
    fn propagated(
        &self,
        friction: f64,
        friction_std: Option<f64>,
        of: &dyn Fn(&Self, f64) -> Option<f64>,
    ) -> Option<Quantity> {
        let value = of(self, friction)?;
        let mut variance = 0.0;
        for (place, std) in self.stds.into_iter().enumerate() {
            let at = |sign: f64| {
                let mut moved = *self;
                let number = [
                    &mut moved.tangential_m_s,
                    &mut moved.normal_m_s,
                    &mut moved.spin_m_s,
                ];
                *number.into_iter().nth(place)? += sign * std;
                of(&moved, friction)
            };
            variance += (0.5 * (at(1.0)? - at(-1.0)?)).powi(2);
        }
        let std = friction_std?;
        let by_friction = of(self, friction + std)? - of(self, (friction - std).max(0.1 * friction))?;
        variance += (0.5 * by_friction).powi(2);
        Quantity::new(value, variance.sqrt())
    }

    /// (measured − model)²/variance of e_x.
    fn chi2(&self, friction: f64) -> Option<f64> {
        let found = self.propagated(friction, Some(0.0), &Self::tabled_e_x)?;
        let std = self.e_x.1.hypot(found.std_uncertainty.unwrap_or(0.0));
        Some(((self.e_x.0 - found.value) / std).powi(2))
    }
}

/// A friction that suits.
#[derive(Debug, Clone, Copy)]
struct SuitableFriction {
    /// The best.
    value: f64,
    /// `None` where others suit as well, apart from it or without an end.
    known: Option<Quantity>,
}

/// χ² above its least within which a friction is not out of question: two standard uncertainties.
const SUITS: f64 = 4.0;

/// The friction that suits the bounces best.
fn best_friction(bounces: &[Incoming]) -> Option<SuitableFriction> {
    if bounces.is_empty() {
        return None;
    }
    let step = (FRICTION.1 / FRICTION.0).ln() / STEPS as f64;
    let friction = |i: usize| FRICTION.0 * (step * i as f64).exp();
    let chi2: Vec<f64> = (0..=STEPS)
        .map(|i| bounces.iter().map(|b| b.chi2(friction(i))).sum::<Option<f64>>())
        .collect::<Option<_>>()?;
    let best = (0..=STEPS).min_by(|&a, &b| chi2[a].total_cmp(&chi2[b]))?;
    // The lowest point of the parabola through it and its neighbours.
    let at = if (1..STEPS).contains(&best) {
        let [low, middle, high] = [best - 1, best, best + 1].map(|i| (i as f64, chi2[i]));
        let around = Parabola::through([low.0, middle.0, high.0], [low.1, middle.1, high.1]);
        FRICTION.0 * (step * around.minimum().unwrap_or(middle.0)).exp()
    } else {
        friction(best)
    };
    let within: Vec<usize> = (0..=STEPS).filter(|&i| chi2[i] <= chi2[best] + SUITS).collect();
    let (low, high) = (*within.first()?, *within.last()?);
    let one = low > 0 && high < STEPS && high - low + 1 == within.len();
    // To either side, to the next step, of two standard uncertainties.
    let half = 0.25 * (friction(high + 1) - friction(low.saturating_sub(1)));
    Some(SuitableFriction {
        value: at,
        known: Quantity::new(at, half).filter(|_| one),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::impact::CentreVelocity;
    use crate::rebound::RigidMotion;
    use nalgebra::Vector3;

    const CONTACT: KnownContact = KnownContact {
        stiffness_ratio: 0.85,
        inertia_factor: 0.4,
    };

    /// A bounce as the springs have it.
    fn bounce(incoming: &RigidMotion, friction: f64, e_x_off: f64) -> Bounce {
        let law = Parameters {
            restitution: 0.95,
            friction,
            stiffness_ratio: CONTACT.stiffness_ratio,
        };
        let after = crate::rebound::compliant::impact(incoming, &law, CONTACT.inertia_factor).0;
        let e_x = -after.slip_m_s().x / incoming.slip_m_s().x;
        let known = |value: f64| Quantity::new(value, 0.002);
        let leg = |motion: &RigidMotion| CentreVelocity {
            vx_m_s: known(motion.velocity_m_s.x),
            vz_m_s: known(motion.velocity_m_s.z),
            angle_rad: None,
        };
        Bounce {
            time_s: None,
            x_m: None,
            incident: leg(incoming),
            rebound: leg(&after),
            restitution: Quantity::new(0.95, 0.001),
            tangential_ratio: None,
            slip: None,
            friction: None,
            friction_at_least: None,
            tangential_restitution: Quantity::new(e_x + e_x_off, 0.01),
            spin_in_m_s: known(incoming.surface_spin_m_s.y),
            spin_out_m_s: known(after.surface_spin_m_s.y),
            ..Bounce::default()
        }
    }

    fn launch(angle_deg: f64) -> RigidMotion {
        RigidMotion {
            velocity_m_s: Vector3::new(angle_deg.to_radians().tan(), 0.0, -1.0),
            surface_spin_m_s: Vector3::zeros(),
        }
    }

    #[test]
    fn one_bounce_tells_its_own_friction_and_no_more() {
        let first = bounce(&launch(60.0), 0.12, 0.0);
        let reading = read(&[first], CONTACT).unwrap();
        assert_eq!(reading.source, FrictionSource::ThisBounce);
        assert_eq!(reading.regime, Some(Regime::Sliding));
        assert!(
            (reading.friction.unwrap().value - 0.12).abs() < 4e-3,
            "{reading:?}"
        );
        assert!(reading.tangential_restitution.sigmas().unwrap().abs() < 0.1);
    }

    #[test]
    fn a_second_bounce_foretells_the_first() {
        // A flat one, which slides, tells friction; the steep one is foretold.
        let sliding = bounce(&launch(60.0), 0.12, 0.0);
        for (off, agrees) in [(0.0, true), (0.1, false), (-0.1, false)] {
            let first = bounce(&launch(20.0), 0.12, off);
            let reading = read(&[first, sliding.clone()], CONTACT).unwrap();
            assert_eq!(reading.source, FrictionSource::OtherBounces);
            let sigmas = reading.tangential_restitution.sigmas().unwrap();
            assert_eq!(sigmas.abs() < 2.5, agrees, "{off}: {reading:?}");
            let speed = reading.tangential_m_s;
            assert!((speed.predicted.unwrap().value - speed.measured.unwrap().value).abs() < 0.01);
        }
    }

    #[test]
    fn a_bounce_that_several_frictions_suit_tells_none() {
        let first = bounce(&launch(30.0), 0.12, 0.0);
        let other = bounce(&launch(40.0), 0.12, 0.0);
        let reading = read(&[first, other], CONTACT).unwrap();
        assert_eq!(reading.source, FrictionSource::ThisBounce, "{reading:?}");
        assert_eq!((reading.friction, reading.regime), (None, None), "{reading:?}");
        assert!(reading.tangential_restitution.sigmas().unwrap().abs() < 1.0);
    }

    #[test]
    fn what_no_friction_gives_speaks_against_the_model() {
        let mut first = bounce(&launch(25.0), 0.12, 0.0);
        first.tangential_restitution = Quantity::new(0.8, 0.01);
        let reading = read(&[first], CONTACT).unwrap();
        assert!(
            reading.tangential_restitution.sigmas().unwrap() > 10.0,
            "{reading:?}"
        );
    }
}
