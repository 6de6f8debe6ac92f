//! A bounce on floor or ceiling, seen from the side: angles, restitution, friction, spin.

use super::floor::turned;
use super::inputs::InputValues;
use super::motion::{DIRECTION_SIGMAS, MeasuredMotion};
use super::relations::ImpactVelocities;
use super::seen_spin::{SPIN_CHANGE_SIGMAS, SpinSource};
use super::{AlongFloor, Bounce, BounceSurface, CentreVelocity, Correlation, Impossible, Speed, reading};
use crate::flight::planar::Motion;
use crate::numeric::propagation::OutputQuantities;

use crate::rebound::Regime;
use SideOutput as Out;

/// A slip that does not stand out by this many standard uncertainties gives no e_x: it would be noise over noise.
const SLIP_SIGMAS: f64 = 3.0;

/// Nor does one so small (a ball that all but rolls already, and its spin known exactly) that e_x, which lies between −1 and 1,
/// would be this uncertain.
const NO_E_X_STD: f64 = 1.0;

/// Nor does one that the change of speed tells to no better than this part of what stops it: e_x + 1 is that change over it.
const LEAST_RESOLVED: f64 = 0.5;

/// What no contact does stands out by this many standard uncertainties.
const IMPOSSIBLE_SIGMAS: f64 = 3.0;

/// What a side view tells of an impact, in the order of [`MeasuredMotion::side_outputs`].
#[derive(Debug, Clone, Copy)]
enum SideOutput {
    Time,
    Place,
    BeforeX,
    BeforeZ,
    IncidentAngle,
    AfterX,
    AfterZ,
    ReboundAngle,
    Restitution,
    TangentialRatio,
    Friction,
    TangentialRestitution,
    SpinIn,
    SpinOut,
    SlipIn,
    Lost,
    BeforeTangent,
    BeforeNormal,
    AfterTangent,
    AfterNormal,
    MeasuredSpinIn,
    MeasuredSpinOut,
    MeasuredSpinChange,
    InertiaFactor,
}

impl MeasuredMotion<'_> {
    /// The impact between arcs `k` and `k + 1`, for any inputs. `history` are the bounces through which the launch's spin came;
    /// `along` and `pull` the signs of angles and friction. What happens on a ceiling is told as on a floor, z and spin turned round.
    fn side_outputs(
        &self,
        p: &InputValues<'_>,
        (k, surface): (usize, BounceSurface),
        history: Option<&[usize]>,
        (along, pull): (f64, f64),
    ) -> Vec<f64> {
        let up = surface.sign();
        let (t, a, b) = self.impact(p, k);
        // Both arcs come to the surface earlier by as much as they are ahead.
        let t = t - 2.0 * p.errors.ahead * self.scale(p) / (up * (b.vh - a.vh));
        let slope = self.slope(p);
        let upright = |m: &Motion| {
            let m = turned(m, slope);
            Motion { vh: up * m.vh, ..m }
        };
        let (before, after) = (upright(&a), upright(&b));
        let seen_in = up * self.seen_spin_m_s(k, p.errors.spin_in);
        let seen_out = up * self.seen_spin_m_s(k + 1, p.errors.spin_out);
        let velocities = ImpactVelocities {
            before_m_s: (before.vr, before.vh),
            after_m_s: (after.vr, after.vh),
            spin_in_m_s: match history {
                Some(history) => up * self.spin_in(p, k, history),
                None => seen_in,
            },
            measured_spin_out_m_s: if seen_in.is_finite() { seen_out } else { f64::NAN },
            inertia_factor: self.calibration.ball.inertia_factor,
        };
        vec![
            t,
            a.r - self.edge_shift(p),
            a.vr,
            a.vh,
            velocities.incident_angle_rad(along),
            b.vr,
            b.vh,
            velocities.rebound_angle_rad(along),
            velocities.restitution(),
            velocities.tangential_ratio(),
            pull * velocities.friction(),
            velocities.tangential_restitution(),
            up * velocities.spin_in_m_s,
            up * velocities.spin_out_m_s(),
            velocities.slip_in_m_s(),
            velocities.lost_m_s(),
            before.vr,
            before.vh,
            after.vr,
            after.vh,
            up * seen_in,
            up * seen_out,
            seen_out - seen_in,
            velocities.lost_m_s() / (seen_out - seen_in),
        ]
    }

    pub(super) fn side_bounce(
        &self,
        (k, surface): (usize, BounceSurface),
        history: Option<&[usize]>,
    ) -> Bounce {
        let tangent = self.inputs.outputs(|p| {
            let (_, before, after) = self.impact(p, k);
            let slope = self.slope(p);
            vec![turned(&before, slope).vr, turned(&after, slope).vr]
        });
        // Angles count along the incident motion; straight down, along the launch.
        let along = if tangent.stands_out(0, DIRECTION_SIGMAS) {
            tangent.value(0).signum()
        } else {
            1.0
        };
        let pull = if tangent.value(0) >= tangent.value(1) {
            1.0
        } else {
            -1.0
        };
        let out = self
            .inputs
            .outputs(|p| self.side_outputs(p, (k, surface), history, (along, pull)));
        let quantity = |which: Out| out.quantity(which as usize);
        let stands_out = |which: Out, sigmas: f64| out.stands_out(which as usize, sigmas);
        let slips = out.value(Out::SpinIn as usize).is_finite() && stands_out(Out::SlipIn, SLIP_SIGMAS);
        // Of a slip that the change of speed cannot resolve e_x is noise over noise.
        let slip_share = crate::rebound::slip_share(self.calibration.ball.inertia_factor);
        let stops_m_s = slip_share * out.value(Out::SlipIn as usize).abs();
        let resolved = slips && out.std(Out::Lost as usize) < LEAST_RESOLVED * stops_m_s;
        let impossible = slips.then(|| impossible(&out)).flatten();
        let possible = |which: Out| quantity(which).filter(|_| impossible.is_none());
        let e_x = possible(Out::TangentialRestitution)
            .filter(|_| resolved && out.std(Out::TangentialRestitution as usize) < NO_E_X_STD);
        let slip = reading::slip(e_x);
        let friction = possible(Out::Friction);
        let slid = slip == Some(Regime::Ordinary);
        let moves_along = stands_out(Out::BeforeTangent, DIRECTION_SIGMAS);
        let velocity = |x: Out, z: Out, angle: Out| CentreVelocity {
            vx_m_s: quantity(x),
            vz_m_s: quantity(z),
            angle_rad: quantity(angle),
        };
        Bounce {
            surface,
            time_s: quantity(Out::Time),
            x_m: quantity(Out::Place),
            incident: velocity(Out::BeforeX, Out::BeforeZ, Out::IncidentAngle),
            rebound: velocity(Out::AfterX, Out::AfterZ, Out::ReboundAngle),
            restitution: quantity(Out::Restitution),
            tangential_ratio: quantity(Out::TangentialRatio).filter(|_| moves_along),
            slip,
            friction: friction.filter(|_| slid),
            friction_at_least: friction.filter(|_| !slid),
            tangential_restitution: e_x,
            spin_in_m_s: possible(Out::SpinIn),
            spin_out_m_s: possible(Out::SpinOut),
            measured_spin_in_m_s: quantity(Out::MeasuredSpinIn),
            measured_spin_out_m_s: quantity(Out::MeasuredSpinOut),
            spin_in_source: possible(Out::SpinIn).and(self.spin_source(k, history)),
            inertia_factor: quantity(Out::InertiaFactor)
                .filter(|_| stands_out(Out::MeasuredSpinChange, SPIN_CHANGE_SIGMAS)),
            azimuth_rad: None,
            correlations: correlations(
                &out,
                [Out::BeforeX, Out::BeforeZ, Out::AfterX, Out::AfterZ, Out::SpinIn],
            ),
            along_floor: Some(AlongFloor {
                incident_m_s: (quantity(Out::BeforeTangent), quantity(Out::BeforeNormal)),
                rebound_m_s: (quantity(Out::AfterTangent), quantity(Out::AfterNormal)),
                correlations: correlations(
                    &out,
                    [
                        Out::BeforeTangent,
                        Out::BeforeNormal,
                        Out::AfterTangent,
                        Out::AfterNormal,
                        Out::SpinIn,
                    ],
                ),
            }),
            impossible,
        }
    }
}

impl MeasuredMotion<'_> {
    /// Where the spin before the impact at the end of arc `k` comes from.
    fn spin_source(&self, k: usize, history: Option<&[usize]>) -> Option<SpinSource> {
        if self.seen_spin(k).is_ok() {
            return Some(SpinSource::Measured);
        }
        Some(if history?.is_empty() {
            SpinSource::Launch
        } else {
            SpinSource::PreviousBounce
        })
    }
}

/// Friction works against the slip, and no contact gives back more than the slip it stopped: what of that the outputs
/// contradict.
fn impossible(out: &OutputQuantities) -> Option<Impossible> {
    let forward = out.value(Out::SlipIn as usize).signum();
    let lost = out.quantity(Out::Lost as usize)?;
    let e_x = out.quantity(Out::TangentialRestitution as usize)?;
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

/// Of the outputs `of`, in the order of [`Speed::ALL`].
fn correlations(out: &OutputQuantities, of: [Out; Speed::ALL.len()]) -> Vec<Correlation> {
    let all = || Speed::ALL.into_iter().zip(of).enumerate();
    all()
        .flat_map(|(i, (a, at))| {
            all()
                .skip(i + 1)
                .filter_map(move |(_, (b, bt))| Some(((a, b), out.correlation(at as usize, bt as usize)?)))
        })
        .map(|(of, value)| Correlation { of, value })
        .collect()
}
