//! A bounce seen from the side: angles, restitution, friction, spin.

use super::floor::turned;
use super::motion::{DIRECTION_SIGMAS, MeasuredMotion};
use super::propagation::OutputQuantities;
use super::relations::ImpactVelocities;
use super::{AlongFloor, Bounce, CentreVelocity, Correlation, Impossible, Speed, reading};
use crate::quantity::Quantity;
use crate::rebound::Regime;

/// A slip that does not stand out by this many standard uncertainties gives no e_x: it would be noise over noise.
const SLIP_SIGMAS: f64 = 3.0;

/// Nor does one so small (a ball that all but rolls already, and its spin known exactly) that e_x, which lies between −1 and 1,
/// would be this uncertain.
const NO_E_X_STD: f64 = 1.0;

/// Nor does one that the change of speed tells to no better than this part of what stops it: e_x + 1 is that change over it.
const LEAST_RESOLVED: f64 = 0.5;

/// What no contact does stands out by this many standard uncertainties.
const IMPOSSIBLE_SIGMAS: f64 = 3.0;

impl MeasuredMotion<'_> {
    pub(super) fn side_bounce(&self, k: usize, history: Option<&[usize]>) -> Bounce {
        let inertia = self.calibration.ball.inertia_factor;
        let p = &self.inputs.best();
        let (best, slope) = (self.impact(p, k), self.slope(p));
        let (before, after) = (turned(&best.1, slope), turned(&best.2, slope));
        let spin0 = history.map_or(f64::NAN, |h| self.spin_in(p, h));
        let speed = self
            .inputs
            .outputs(|p| vec![turned(&self.impact(p, k).1, self.slope(p)).vr]);
        // Angles count along the incident motion; straight down, along the launch.
        let along = if speed.stands_out(0, DIRECTION_SIGMAS) {
            before.vr.signum()
        } else {
            1.0
        };
        let pull = if before.vr >= after.vr { 1.0 } else { -1.0 };
        let out = self.inputs.outputs(|p| {
            let (t, a, b) = self.impact(p, k);
            let slope = self.slope(p);
            let (before, after) = (turned(&a, slope), turned(&b, slope));
            let crossing = ImpactVelocities {
                before_m_s: (before.vr, before.vh),
                after_m_s: (after.vr, after.vh),
                spin_in_m_s: history.map_or(f64::NAN, |h| self.spin_in(p, h)),
                inertia_factor: inertia,
            };
            let mut all = [0.0; out::COUNT];
            all[out::TIME] = t;
            all[out::PLACE] = a.r - self.edge_shift(p);
            all[out::BEFORE] = a.vr;
            all[out::BEFORE + 1] = a.vh;
            all[out::BEFORE + 2] = crossing.incident_angle_rad(along);
            all[out::AFTER] = b.vr;
            all[out::AFTER + 1] = b.vh;
            all[out::AFTER + 2] = crossing.rebound_angle_rad(along);
            all[out::RESTITUTION] = crossing.restitution();
            all[out::RATIO] = crossing.tangential_ratio();
            all[out::FRICTION] = pull * crossing.friction();
            all[out::E_X] = crossing.tangential_restitution();
            all[out::SPIN_IN] = crossing.spin_in_m_s;
            all[out::SPIN_OUT] = crossing.spin_out_m_s();
            all[out::SLIP] = crossing.slip_in_m_s();
            all[out::LOST] = crossing.lost_m_s();
            all[out::ALONG_FLOOR..].copy_from_slice(&[before.vr, before.vh, after.vr, after.vh]);
            all.to_vec()
        });
        let ratio = out
            .stands_out(out::ALONG_FLOOR, DIRECTION_SIGMAS)
            .then(|| out.quantity(out::RATIO))
            .flatten();
        let slips = spin0.is_finite() && out.stands_out(out::SLIP, SLIP_SIGMAS);
        // Of a slip that the change of speed cannot resolve e_x is noise over noise.
        let stops_m_s = crate::rebound::slip_share(inertia) * out.value(out::SLIP).abs();
        let resolved = slips && out.std(out::LOST) < LEAST_RESOLVED * stops_m_s;
        let impossible = slips.then(|| impossible(&out)).flatten();
        let possible = |q: Option<Quantity>| q.filter(|_| impossible.is_none());
        let e_x = possible(out.quantity(out::E_X)).filter(|_| resolved && out.std(out::E_X) < NO_E_X_STD);
        let slip = reading::slip(e_x);
        let friction = possible(out.quantity(out::FRICTION));
        let slid = slip == Some(Regime::Ordinary);
        Bounce {
            time_s: out.quantity(out::TIME),
            x_m: out.quantity(out::PLACE),
            incident: leg(&out, out::BEFORE),
            rebound: leg(&out, out::AFTER),
            restitution: out.quantity(out::RESTITUTION),
            tangential_ratio: ratio,
            slip,
            friction: friction.filter(|_| slid),
            friction_at_least: friction.filter(|_| !slid),
            tangential_restitution: e_x,
            spin_in_m_s: possible(out.quantity(out::SPIN_IN)),
            spin_out_m_s: possible(out.quantity(out::SPIN_OUT)),
            azimuth_rad: None,
            correlations: correlations(
                &out,
                [
                    out::BEFORE,
                    out::BEFORE + 1,
                    out::AFTER,
                    out::AFTER + 1,
                    out::SPIN_IN,
                ],
            ),
            along_floor: Some(AlongFloor {
                incident_m_s: (out.quantity(out::ALONG_FLOOR), out.quantity(out::ALONG_FLOOR + 1)),
                rebound_m_s: (
                    out.quantity(out::ALONG_FLOOR + 2),
                    out.quantity(out::ALONG_FLOOR + 3),
                ),
                correlations: correlations(
                    &out,
                    [
                        out::ALONG_FLOOR,
                        out::ALONG_FLOOR + 1,
                        out::ALONG_FLOOR + 2,
                        out::ALONG_FLOOR + 3,
                        out::SPIN_IN,
                    ],
                ),
            }),
            impossible,
        }
    }
}

/// Where a side view's outputs stand.
mod out {
    pub const TIME: usize = 0;
    pub const PLACE: usize = 1;
    /// Along x, up, angle.
    pub const BEFORE: usize = 2;
    pub const AFTER: usize = 5;
    pub const RESTITUTION: usize = 8;
    pub const RATIO: usize = 9;
    pub const FRICTION: usize = 10;
    pub const E_X: usize = 11;
    pub const SPIN_IN: usize = 12;
    pub const SPIN_OUT: usize = 13;
    pub const SLIP: usize = 14;
    pub const LOST: usize = 15;
    /// Along the floor and away from it, before and after.
    pub const ALONG_FLOOR: usize = 16;
    pub const COUNT: usize = 20;
}

/// Friction works against the slip, and no contact gives back more than the slip it stopped: what of that the outputs
/// contradict.
fn impossible(out: &OutputQuantities) -> Option<Impossible> {
    let forward = out.value(out::SLIP).signum();
    let (lost, e_x) = (out.quantity(out::LOST)?, out.quantity(out::E_X)?);
    let lost_std = lost.std_uncertainty.unwrap_or(f64::INFINITY);
    let e_x_std = e_x.std_uncertainty.unwrap_or(f64::INFINITY);
    if forward * lost.value < -IMPOSSIBLE_SIGMAS * lost_std {
        Some(Impossible::Driven(lost.scaled(-forward)))
    } else if e_x.value - 1.0 > IMPOSSIBLE_SIGMAS * e_x_std {
        Some(Impossible::Reversed(e_x))
    } else {
        None
    }
}

/// Of the outputs at `places`, in the order of [`Speed::ALL`].
fn correlations(out: &OutputQuantities, places: [usize; Speed::ALL.len()]) -> Vec<Correlation> {
    let all = || Speed::ALL.into_iter().zip(places).enumerate();
    all()
        .flat_map(|(i, (a, at))| {
            all()
                .skip(i + 1)
                .filter_map(move |(_, (b, bt))| Some(((a, b), out.correlation(at, bt)?)))
        })
        .map(|(of, value)| Correlation { of, value })
        .collect()
}

fn leg(out: &OutputQuantities, i: usize) -> CentreVelocity {
    CentreVelocity {
        vx_m_s: out.quantity(i),
        vz_m_s: out.quantity(i + 1),
        angle_rad: out.quantity(i + 2),
    }
}
