//! What the rebound models make of a recording's bounces: regimes, and which model describes them better.
//!
//! Grip is beyond some models. Otherwise one bounce fits all of them, and two tell: under the right one both bounces have the same
//! coefficient (friction under μ-e, tangential restitution under e-e).

use super::compliant_reading::{self, KnownContact};
use super::{Bounce, Readings};
use crate::quantity::Quantity;
use crate::rebound::model::{BounceNumbers, BounceReading, CoefficientChange};
use crate::rebound::{ModelName, Preferred, Regime};

/// e_x counts as zero within this, whatever its uncertainty: no model claims more of a real ball.
const ROLLING_TOLERANCE: f64 = 0.02;

/// e_x differs from zero when it is this many standard uncertainties away.
const REGIME_SIGMAS: f64 = 2.5;

/// An e_x less certain than this does not tell a regime, unless it stands out all the same.
const VAGUE_STD: f64 = 0.15;

/// A coefficient that differs between two bounces by more standard uncertainties than this is not the same.
const DIFFERENT_SIGMAS: f64 = 3.0;

/// The models' readings of the first bounce, with the compliant one's where its `contact` is known; the later ones help to prefer a model. `None` without a restitution.
#[must_use]
pub fn read(bounces: &[Bounce], contact: Option<KnownContact>) -> Option<Readings> {
    let first = bounces.first()?;
    first.restitution?;
    let numbers: Vec<BounceNumbers> = bounces.iter().map(numbers).collect();
    let read = |name: ModelName| Some((name, name.model().read(&numbers[0])?));
    let models: Vec<(ModelName, BounceReading)> = ModelName::ALL.into_iter().filter_map(read).collect();
    let preferred = prefer(&models, &numbers).map_or(Preferred::Undetermined, Preferred::Model);
    Some(Readings {
        restitution: first.restitution,
        models,
        compliant: contact.and_then(|contact| compliant_reading::read(bounces, contact)),
        preferred,
    })
}

fn numbers(bounce: &Bounce) -> BounceNumbers {
    BounceNumbers {
        friction: bounce.friction,
        friction_at_least: bounce.friction_at_least,
        tangential_restitution: bounce.tangential_restitution,
        slip: bounce.slip,
    }
}

/// What became of the slip, by the sign of e_x as far as its uncertainty tells.
#[must_use]
pub fn slip(e_x: Option<Quantity>) -> Option<Regime> {
    let Quantity {
        value,
        std_uncertainty: Some(std),
    } = e_x?
    else {
        return None;
    };
    let limit = (REGIME_SIGMAS * std).max(ROLLING_TOLERANCE);
    if value > limit {
        Some(Regime::Grip)
    } else if value < -limit {
        Some(Regime::Ordinary)
    } else {
        (std < VAGUE_STD).then_some(Regime::Nonsliding)
    }
}

/// The one model that allows what the first bounce did; or whose coefficient two bounces share, where that of every other
/// differs.
fn prefer(models: &[(ModelName, BounceReading)], bounces: &[BounceNumbers]) -> Option<ModelName> {
    let only = |names: &[ModelName]| match names {
        [name] => Some(*name),
        _ => None,
    };
    let slip = bounces.first()?.slip?;
    let names = || models.iter().map(|(name, _)| *name);
    let allow: Vec<ModelName> = names().filter(|name| name.model().allows(slip)).collect();
    if allow.len() < models.len() {
        return only(&allow);
    }
    let [first, second, ..] = bounces else {
        return None;
    };
    // Of a ball that left rolling the first time, friction is not known.
    if slip != Regime::Ordinary {
        return None;
    }
    let changes: Vec<(ModelName, CoefficientChange)> = names()
        .map(|name| Some((name, name.model().change(first, second)?)))
        .collect::<Option<_>>()?;
    let (agree, differ): (Vec<_>, Vec<_>) = changes.into_iter().partition(|(_, change)| change.agrees);
    let all_differ = differ
        .iter()
        .all(|(_, change)| change.sigmas.abs() > DIFFERENT_SIGMAS);
    let agree: Vec<ModelName> = agree.into_iter().map(|(name, _)| name).collect();
    only(&agree).filter(|_| all_differ)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::impact::CentreVelocity;

    fn bounce(friction: f64, e_x: f64, std: f64) -> Bounce {
        let leg = CentreVelocity {
            vx_m_s: None,
            vz_m_s: None,
            angle_rad: None,
        };
        let slip = slip(Quantity::new(e_x, std));
        let slid = slip == Some(Regime::Ordinary);
        Bounce {
            time_s: None,
            x_m: None,
            incident: leg,
            rebound: leg,
            restitution: Quantity::new(0.8, 0.001),
            tangential_ratio: None,
            slip,
            friction: Quantity::new(friction, std).filter(|_| slid),
            friction_at_least: Quantity::new(friction, std).filter(|_| !slid),
            tangential_restitution: Quantity::new(e_x, std),
            spin_in_m_s: None,
            spin_out_m_s: None,
            ..Bounce::default()
        }
    }

    #[test]
    fn regimes_follow_the_sign_of_e_x_and_its_uncertainty() {
        let regime = |e_x, std| {
            let readings = read(&[bounce(0.1, e_x, std)], None).unwrap();
            readings.of(ModelName::EE).unwrap().regime
        };
        assert_eq!(regime(-0.5, 0.01), Some(Regime::Ordinary));
        assert_eq!(regime(0.5, 0.01), Some(Regime::Grip));
        assert_eq!(regime(0.01, 0.01), Some(Regime::Nonsliding));
        assert_eq!(regime(0.1, 0.3), None);
        assert_eq!(regime(2.0, 0.3), Some(Regime::Grip));
    }

    #[test]
    fn friction_is_a_number_only_where_the_ball_slid() {
        let friction = |e_x| {
            let readings = read(&[bounce(0.1, e_x, 0.01)], None).unwrap();
            readings.of(ModelName::MuE).unwrap().quantity
        };
        assert!(friction(-0.5).is_some());
        assert!(friction(0.0).is_none());
        assert!(friction(0.5).is_none());
    }

    #[test]
    fn two_bounces_tell_the_models_apart() {
        let preferred = |a, b| read(&[a, b], None).unwrap().preferred;
        assert_eq!(
            preferred(bounce(0.07, -0.6, 0.01), bounce(0.07, -0.3, 0.01)),
            Preferred::Model(ModelName::MuE)
        );
        assert_eq!(
            preferred(bounce(0.10, -0.5, 0.01), bounce(0.20, -0.5, 0.01)),
            Preferred::Model(ModelName::EE)
        );
        assert_eq!(
            preferred(bounce(0.07, -0.6, 0.01), bounce(0.07, -0.6, 0.01)),
            Preferred::Undetermined
        );
        assert_eq!(
            preferred(bounce(0.2, 0.5, 0.01), bounce(0.2, 0.5, 0.01)),
            Preferred::Model(ModelName::EE)
        );
        assert_eq!(
            preferred(bounce(0.12, -0.4, 0.01), bounce(0.05, 0.0, 0.01)),
            Preferred::Model(ModelName::MuE)
        );
    }

    #[test]
    fn a_second_bounce_that_may_have_slid_or_not_says_that_friction_was_enough_for_it_and_no_more() {
        let vague = |at_least| Bounce {
            friction_at_least: Quantity::new(at_least, 0.001),
            ..bounce(at_least, -0.02, 0.18)
        };
        assert_eq!(vague(0.01).slip, None);
        let first = || bounce(0.07, -0.1, 0.01);
        let preferred = |second| read(&[first(), second], None).unwrap().preferred;
        assert_eq!(preferred(vague(0.01)), Preferred::Undetermined);
        assert_eq!(preferred(vague(0.2)), Preferred::Model(ModelName::EE));
    }
}
