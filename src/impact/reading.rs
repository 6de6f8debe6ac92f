//! What both rebound models make of a recording's bounces: regimes, and which model describes them better.

use super::{Bounce, EERegime, MuERegime, Preferred, Readings};
use crate::quantity::Quantity;

/// e_x counts as zero within this, whatever its uncertainty: neither model claims more of a real ball.
const ROLLING_TOLERANCE: f64 = 0.02;

/// e_x differs from zero when it is this many standard uncertainties away.
const REGIME_SIGMAS: f64 = 2.5;

/// An e_x less certain than this does not tell a regime, unless it stands out all the same.
const VAGUE_STD: f64 = 0.15;

/// Both models' readings of the first bounce; the later ones help to prefer a model. `None` without a restitution.
#[must_use]
pub fn read(bounces: &[Bounce]) -> Option<Readings> {
    let first = bounces.first()?;
    first.restitution?;
    let e_e_regime = first.regime;
    let mu_e_regime = match e_e_regime {
        EERegime::Ordinary => MuERegime::Sliding,
        EERegime::Nonsliding => MuERegime::Nonsliding,
        // More tangential impulse than stops the slip: Coulomb friction cannot give it.
        EERegime::Grip | EERegime::Undetermined => MuERegime::Undetermined,
    };
    Some(Readings {
        restitution: first.restitution,
        // Without sliding, friction is only known to be enough.
        friction: first.friction,
        mu_e_regime,
        tangential_restitution: first.tangential_restitution,
        e_e_regime,
        preferred: prefer(bounces),
    })
}

/// What the contact point did, by the sign of e_x as far as its uncertainty tells.
#[must_use]
pub fn regime(e_x: Option<Quantity>) -> EERegime {
    let Some(Quantity {
        value,
        std_uncertainty: Some(std),
    }) = e_x
    else {
        return EERegime::Undetermined;
    };
    let limit = (REGIME_SIGMAS * std).max(ROLLING_TOLERANCE);
    if value > limit {
        EERegime::Grip
    } else if value < -limit {
        EERegime::Ordinary
    } else if std < VAGUE_STD {
        EERegime::Nonsliding
    } else {
        EERegime::Undetermined
    }
}

/// Grip is beyond the μ-e model. Otherwise one bounce fits both, and two tell: under μ-e the friction of sliding
/// bounces is one number, under e-e the tangential restitution of all.
fn prefer(bounces: &[Bounce]) -> Preferred {
    let regimes: Vec<EERegime> = bounces.iter().map(|b| b.regime).collect();
    if regimes.first() == Some(&EERegime::Grip) {
        return Preferred::EE;
    }
    let (Some(a), Some(b)) = (bounces.first(), bounces.get(1)) else {
        return Preferred::Undetermined;
    };
    if regimes[0] != EERegime::Ordinary {
        return Preferred::Undetermined;
    }
    let Some(e_x_apart) = apart(a.tangential_restitution, b.tangential_restitution) else {
        return Preferred::Undetermined;
    };
    let Some(mu_apart) = apart(a.friction, b.friction.or(b.friction_at_least)) else {
        return Preferred::Undetermined;
    };
    // A second bounce that rolls off needs less friction than sliding would give.
    let mu_agrees = match regimes[1] {
        EERegime::Ordinary => mu_apart.abs() < 2.0,
        EERegime::Nonsliding => mu_apart < 2.0,
        EERegime::Grip | EERegime::Undetermined => false,
    };
    match (mu_agrees, e_x_apart.abs() < 2.0) {
        (true, false) if e_x_apart.abs() > 3.0 => Preferred::MuE,
        (false, true) if mu_apart.abs() > 3.0 => Preferred::EE,
        _ => Preferred::Undetermined,
    }
}

/// (second − first) in standard uncertainties of the difference, taking them as independent.
fn apart(first: Option<Quantity>, second: Option<Quantity>) -> Option<f64> {
    let (a, b) = (first?, second?);
    Some((b.value - a.value) / a.std_uncertainty?.hypot(b.std_uncertainty?))
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
        let slid = regime(Quantity::new(e_x, std)) == EERegime::Ordinary;
        Bounce {
            time_s: None,
            x_m: None,
            incident: leg,
            rebound: leg,
            restitution: Quantity::new(0.8, 0.001),
            tangential_ratio: None,
            regime: regime(Quantity::new(e_x, std)),
            friction: Quantity::new(friction, std).filter(|_| slid),
            friction_at_least: Quantity::new(friction, std).filter(|_| !slid),
            tangential_restitution: Quantity::new(e_x, std),
            spin_in_m_s: None,
            spin_out_m_s: None,
            azimuth_rad: None,
            correlations: Vec::new(),
            along_floor: None,
            impossible: None,
        }
    }

    #[test]
    fn regimes_follow_the_sign_of_e_x_and_its_uncertainty() {
        let regime = |e_x, std| read(&[bounce(0.1, e_x, std)]).unwrap().e_e_regime;
        assert_eq!(regime(-0.5, 0.01), EERegime::Ordinary);
        assert_eq!(regime(0.5, 0.01), EERegime::Grip);
        assert_eq!(regime(0.01, 0.01), EERegime::Nonsliding);
        assert_eq!(regime(0.1, 0.3), EERegime::Undetermined);
        assert_eq!(regime(2.0, 0.3), EERegime::Grip);
    }

    #[test]
    fn friction_is_a_number_only_where_the_ball_slid() {
        assert!(read(&[bounce(0.1, -0.5, 0.01)]).unwrap().friction.is_some());
        assert!(read(&[bounce(0.1, 0.0, 0.01)]).unwrap().friction.is_none());
        assert!(read(&[bounce(0.1, 0.5, 0.01)]).unwrap().friction.is_none());
    }

    #[test]
    fn two_bounces_tell_the_models_apart() {
        let preferred = |a, b| read(&[a, b]).unwrap().preferred;
        assert_eq!(
            preferred(bounce(0.07, -0.6, 0.01), bounce(0.07, -0.3, 0.01)),
            Preferred::MuE
        );
        assert_eq!(
            preferred(bounce(0.10, -0.5, 0.01), bounce(0.20, -0.5, 0.01)),
            Preferred::EE
        );
        assert_eq!(
            preferred(bounce(0.07, -0.6, 0.01), bounce(0.07, -0.6, 0.01)),
            Preferred::Undetermined
        );
        assert_eq!(
            preferred(bounce(0.2, 0.5, 0.01), bounce(0.2, 0.5, 0.01)),
            Preferred::EE
        );
        assert_eq!(
            preferred(bounce(0.12, -0.4, 0.01), bounce(0.05, 0.0, 0.01)),
            Preferred::MuE
        );
    }
}
