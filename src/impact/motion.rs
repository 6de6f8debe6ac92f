//! From fitted arcs and the calibration to bounces and distances, with uncertainties.

use super::error_budget::{
    CONTACT_TIME_RELATIVE_STD, HALF_CONTACT_S, HALF_CONTACT_STD_S, HARD_MODULUS_PA, KNOWN_SPIN_LIFT_STD,
    SOFT_DENSITY_KG_M3, SOFT_MODULUS_PA, SPHERE_LAW_STD, SQUARE_LAW_STD,
};
use super::propagation::{InputQuantities, OutputQuantities};
use super::relations::ImpactVelocities;
use super::spin_lift::SpinLift;
use super::{
    AlongFloor, Bounce, CentreVelocity, Correlation, Distances, EERegime, Impossible, Speed, XSource, reading,
};
use crate::calibration::{Ball, Calibration, Scale, View};
use crate::flight::Flight;
use crate::flight::drag::AIR_DENSITY_KG_M3;
use crate::flight::fit::{ACROSS, ARCS, DRAG, Forces, GRAVITY, Motion, lean_rad};
use crate::flight::planar::closest_approach;
use crate::geometry::PlanePoint;
use crate::quantity::Quantity;
use nalgebra::{DMatrix, DVector};

mod bench_edge;
mod floor;
mod top_view;

use floor::SlopeSources;

/// The measured motion with everything that turns it into metres.
#[derive(Debug)]
pub struct MeasuredMotion<'a> {
    flight: &'a Flight,
    calibration: &'a Calibration,
    inputs: InputQuantities,
    /// +1 when the launch goes to the right in the picture, −1 to the left.
    pub x_sign: f64,
    lift: SpinLift,
    /// How the arcs' parameters follow where lift is twice as much.
    by_lift: Option<DVector<f64>>,
    /// Speed of the first impact, for which the time of contact stands, m/s.
    contact_speed_m_s: Option<f64>,
    /// Whether the first arc may be the one that began at the launch, whose spin the calibration has.
    launch_seen: bool,
    /// Metres a plane unit.
    pub metres_per_unit: Quantity,
    /// Where x = 0 lies in the plane.
    pub zero: PlanePoint,
    /// Whether the camera stands still.
    steady: bool,
    /// How the floor's slope follows from impacts and calibration.
    slope: SlopeSources,
}

/// Extra entries of the inputs after the arcs' parameters: ln scale, "up" beyond the fall's direction, origin and centre
/// along right and up, half the time of contact, lift before and after, drag beyond its law before and after, centre errors
/// that differ between two impacts (along right and up), by what part all lift of known spins is more, the bench's slope, the
/// floor's line in the picture, the floor's slope by calibration or custom.
const EXTRAS: usize = 15;
const SCALE: usize = 0;
const UP: usize = 1;
const ZERO_RIGHT: usize = 2;
const ZERO_UP: usize = 3;
const CONTACT: usize = 4;
const LIFT_IN: usize = 5;
const LIFT_OUT: usize = 6;
const DRAG_IN: usize = 7;
const DRAG_OUT: usize = 8;
const PLACES: usize = 9;
const LIFT_PART: usize = 10;
const BENCH_RATE: usize = 11;
const FLOOR_LINE: usize = 12;
const FLOOR_LEVEL: usize = 13;
const PLACES_UP: usize = 14;

/// One of the extra entries.
fn extra(p: &[f64], which: usize) -> f64 {
    p[p.len() - EXTRAS + which]
}

/// How well the picture tells places.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImagingErrors {
    /// The length of a pixel near the ball, plane units.
    pub units_per_px: f64,
    /// Standard deviation of a centre's error that all frames share (the light's side, the edge's shape), px: it does not
    /// average out.
    pub common_std_px: f64,
    /// Standard deviation of what differs of that error between the places of two impacts, px.
    pub places_std_px: f64,
    /// Whether the camera stands still.
    pub steady: bool,
}

/// Half of the time of a contact without loss, s, with its standard deviation: by Hertz
/// T = 2.87 (m²/(R E² v))^(1/5) (Johnson 1985, 11.1), where the ball is known.
fn half_contact_s(ball: &Ball, speed_m_s: f64) -> (f64, f64) {
    match (ball.radius_m, ball.mass_kg) {
        (Some(radius_m), Some(mass_kg)) if speed_m_s > 0.0 => {
            let stiffness = radius_m * HARD_MODULUS_PA.powi(2) * speed_m_s;
            let half_s = 0.5 * 2.87 * (mass_kg * mass_kg / stiffness).powf(0.2);
            (half_s, CONTACT_TIME_RELATIVE_STD * half_s)
        }
        _ => (HALF_CONTACT_S, HALF_CONTACT_STD_S),
    }
}

/// A ball that may be soft, for which the time of contact does not stand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SoftBall {
    /// Density, kg/m³.
    pub density_kg_m3: f64,
    /// How much earlier than said a superball of its size and mass would touch, s.
    pub earlier_s: f64,
    /// By what part its restitution would then be off, at most.
    pub restitution_part: f64,
}

/// What kind of impact lies between two arcs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImpactKind {
    /// On the floor: the ball came down and went up.
    Floor,
    /// On something upright, or an edge.
    Wall,
}

/// Incidence is too steep to have a direction below this many standard uncertainties of vx.
const DIRECTION_SIGMAS: f64 = 3.0;

/// A restitution above 1 by this many standard uncertainties is no restitution.
const GAIN_SIGMAS: f64 = 3.0;

/// Whether the ball left the floor faster than it came, by more than its uncertainty.
fn gains(bounce: &Bounce) -> bool {
    bounce.restitution.is_some_and(|e| {
        let std = e.std_uncertainty.unwrap_or(f64::INFINITY);
        e.value - 1.0 > GAIN_SIGMAS * std
    })
}

/// A slip that does not stand out by this many standard uncertainties gives no e_x: it would be noise over noise.
const SLIP_SIGMAS: f64 = 3.0;

/// Nor does one so small (a ball that all but rolls already, and its spin known exactly) that e_x, which lies between −1 and 1,
/// would be this uncertain.
const NO_E_X_STD: f64 = 1.0;

/// Nor does one that the change of speed tells to no better than this part of what stops it: e_x + 1 is that change over it.
const LEAST_RESOLVED: f64 = 0.5;

impl<'a> MeasuredMotion<'a> {
    /// The motion of `flight`, whose points `lift` was [taken from](SpinLift::taken_from); `first` is where the ball was first seen.
    #[must_use]
    pub fn new(
        flight: &'a Flight,
        calibration: &'a Calibration,
        metres_per_unit: Quantity,
        picture: ImagingErrors,
        first: PlanePoint,
        lift: SpinLift,
    ) -> Self {
        let ImagingErrors {
            units_per_px,
            common_std_px,
            places_std_px,
            steady,
        } = picture;
        let fit = &flight.fit;
        let n = fit.parameters.len();
        let mut values = DVector::zeros(n + EXTRAS);
        values.rows_mut(0, n).copy_from(&fit.parameters);
        let mut covariance = DMatrix::zeros(n + EXTRAS, n + EXTRAS);
        covariance.view_mut((0, 0), (n, n)).copy_from(&fit.covariance);
        let relative = match calibration.scale {
            // The fall's own share comes with the arcs' parameters.
            Scale::Gravity => Some(calibration.gravity_uncertainty_m_s2() / calibration.gravity_m_s2),
            _ => metres_per_unit.std_uncertainty.map(|s| s / metres_per_unit.value),
        };
        let drag_law = match fit.forces.drag_law().air() {
            Some(_) => SPHERE_LAW_STD,
            None => SQUARE_LAW_STD,
        };
        let common = common_std_px * units_per_px;
        let origin = calibration.origin_std_px.unwrap_or(0.0) * units_per_px;
        for (i, std) in [
            (SCALE, relative.unwrap_or(0.0)),
            // Where the ball falls in the plane its arcs have what is known of "up".
            (
                UP,
                if fit.forces.falls() {
                    0.0
                } else {
                    calibration.up_std_rad.unwrap_or(0.0)
                },
            ),
            (ZERO_RIGHT, common.hypot(origin)),
            (ZERO_UP, common.hypot(origin)),
            // In units of the standard uncertainty of each arc's lift.
            (LIFT_IN, 1.0),
            (LIFT_OUT, 1.0),
            (DRAG_IN, drag_law),
            (DRAG_OUT, drag_law),
            (PLACES, places_std_px * units_per_px),
            (PLACES_UP, places_std_px * units_per_px),
            (LIFT_PART, KNOWN_SPIN_LIFT_STD),
            (BENCH_RATE, flight.launch.map_or(0.0, |l| l.rate.1)),
        ] {
            covariance[(n + i, n + i)] = std * std;
        }
        let vr = fit.in_plane(fit.parameters.as_slice(), 0, fit.times[0]).vr;
        let std = fit.covariance[(ARCS + 1, ARCS + 1)].max(0.0).sqrt();
        let x_sign = if vr < -DIRECTION_SIGMAS * std { -1.0 } else { 1.0 };
        let zero = if calibration.has_origin() {
            PlanePoint::new(0.0, 0.0)
        } else {
            bench_edge::place(flight).unwrap_or(first)
        };
        let scene = Self {
            flight,
            calibration,
            inputs: InputQuantities { values, covariance },
            x_sign,
            by_lift: lift.response(flight),
            lift,
            contact_speed_m_s: None,
            launch_seen: true,
            metres_per_unit,
            zero,
            steady,
            slope: SlopeSources::default(),
        };
        scene.in_contact().since_launch().on_floor()
    }

    /// The same with whether the first arc can have begun at the launch: after an impact that was missed the spin is no
    /// longer the launch's.
    fn since_launch(mut self) -> Self {
        let edge_m = self.calibration.launch.edge_x_m;
        let impact = self.flight.impacts.first().is_some_and(Option::is_some);
        self.launch_seen = edge_m.is_none_or(|edge_m| !impact || self.comes_from(edge_m, 0));
        self
    }

    /// The same with the time that the first impact on the floor takes.
    fn in_contact(mut self) -> Self {
        let p = self.inputs.values.as_slice();
        let impacts = (0..self.arcs().saturating_sub(1)).filter(|&k| self.flight.impacts[k].is_some());
        self.contact_speed_m_s = impacts
            .map(|k| self.impact(p, k).1.vh.abs())
            .find(|&v| v.is_finite() && v > 0.0);
        let (half_s, std_s) = half_contact_s(&self.calibration.ball, self.contact_speed_m_s.unwrap_or(0.0));
        self.set_extra(CONTACT, half_s, std_s);
        self
    }

    fn set_extra(&mut self, which: usize, value: f64, std: f64) {
        let i = self.inputs.values.len() - EXTRAS + which;
        self.inputs.values[i] = value;
        self.inputs.covariance[(i, i)] = std * std;
    }

    /// What changes if the ball is soft; `None` where it is too dense for that, is not known, or seen from above.
    #[must_use]
    pub fn may_be_soft(&self) -> Option<SoftBall> {
        let ball = &self.calibration.ball;
        let (radius_m, mass_kg) = (ball.radius_m?, ball.mass_kg?);
        let speed_m_s = self
            .contact_speed_m_s
            .filter(|_| self.calibration.view == View::Side)?;
        let density_kg_m3 = mass_kg / (4.0 / 3.0 * std::f64::consts::PI * radius_m.powi(3));
        let (hard_s, _) = half_contact_s(ball, speed_m_s);
        // T goes as E^(-2/5).
        let earlier_s = hard_s * ((HARD_MODULUS_PA / SOFT_MODULUS_PA).powf(0.4) - 1.0);
        (density_kg_m3 < SOFT_DENSITY_KG_M3).then(|| SoftBall {
            density_kg_m3,
            earlier_s,
            restitution_part: 2.0 * self.calibration.gravity_m_s2 * earlier_s / speed_m_s,
        })
    }

    /// The flight with its points moved back by what the lift of the bounces' spins did to them, and that lift. Where those have
    /// no arcs it stays in the flight.
    #[must_use]
    pub fn without_lift(&self) -> (Flight, SpinLift) {
        let lift = SpinLift::new(self.spins());
        match lift.taken_from(self.flight) {
            Some(free) => (free, lift),
            None => (self.flight.clone(), SpinLift::default()),
        }
    }

    /// Spin R ω on each arc, plane units/s, positive where it rolls along +r: the launch's, and what each bounce on the
    /// floor made of it.
    fn spins(&self) -> Vec<Option<f64>> {
        if self.calibration.view == View::Top {
            return Vec::new();
        }
        let p = self.inputs.values.as_slice();
        let unit = self.x_sign / self.scale(p);
        let inertia = self.calibration.ball.inertia_factor;
        let mut spin = Some(self.spin_in(p, &[]) * unit).filter(|s| s.is_finite());
        let mut spins = vec![spin];
        let slope = self.slope(p);
        for k in 0..self.arcs().saturating_sub(1) {
            let gained = self.spin_gained(p, slope, k) / inertia * unit;
            spin = spin
                .filter(|_| self.kind(k) == Some(ImpactKind::Floor))
                .map(|s| s + gained)
                .filter(|s| s.is_finite());
            spins.push(spin);
        }
        spins
    }

    fn arcs(&self) -> usize {
        self.flight.fit.arcs()
    }

    fn scale(&self, p: &[f64]) -> f64 {
        let more = extra(p, SCALE).exp();
        match self.calibration.scale {
            Scale::Gravity => self.calibration.gravity_m_s2 / fall_of(p) * more,
            _ => self.metres_per_unit.value * more,
        }
    }

    /// Motion on arc `k` at `t` with lift, plane units.
    fn in_plane(&self, p: &[f64], k: usize, t: f64) -> Motion {
        let fit = &self.flight.fit;
        let more = extra(p, LIFT_PART);
        let mut moved = Vec::new();
        let arcs = match &self.by_lift {
            Some(by_lift) if more != 0.0 => {
                moved.extend_from_slice(p);
                for (m, change) in moved.iter_mut().zip(by_lift.iter()) {
                    *m += more * change;
                }
                &moved
            }
            _ => p,
        };
        let (free, lift) = (
            fit.in_plane(arcs, k, t),
            self.lift.motion(&fit.planar(arcs), k, t),
        );
        let lifted = 1.0 + more;
        Motion {
            r: free.r + lifted * lift.r,
            h: free.h + lifted * lift.h,
            vr: free.vr + lifted * lift.vr,
            vh: free.vh + lifted * lift.vh,
        }
    }

    /// By how much "up" of the world is turned from that of the plane, towards −r, rad: the fall leans by as much.
    fn lean(&self, p: &[f64]) -> f64 {
        lean_rad(p) + extra(p, UP)
    }

    /// Angle from the calibration's "up" to the fall's, rad, positive to the right in the picture; `None` where nothing falls in
    /// the plane.
    #[must_use]
    pub fn tilt_rad(&self) -> Option<Quantity> {
        let falls = self.calibration.view == View::Side && self.flight.fit.forces.falls();
        let out = falls.then(|| self.inputs.outputs(|p| vec![-self.lean(p)]))?;
        out.quantity(0)
    }

    /// By how much "up" of the world is turned from that of the plane, towards −r, rad.
    #[must_use]
    pub fn lean_rad(&self) -> f64 {
        self.lean(self.inputs.values.as_slice())
    }

    /// Motion on arc `k` at `t` in metres: x along the launch, "up" against the fall.
    fn world(&self, p: &[f64], k: usize, t: f64) -> Motion {
        let m = self.in_plane(p, k, t);
        let s = self.scale(p);
        let (sin, cos) = self.lean(p).sin_cos();
        let right = m.r - self.zero.right - extra(p, ZERO_RIGHT);
        let up = m.h - self.zero.up - extra(p, ZERO_UP);
        let x = self.x_sign * s;
        Motion {
            r: x * (right * cos + up * sin),
            h: s * (up * cos - right * sin),
            vr: x * (m.vr * cos + m.vh * sin),
            vh: s * (m.vh * cos - m.vr * sin),
        }
    }

    /// When arcs `k` and `k + 1` meet, lift included, s.
    fn impact_time(&self, p: &[f64], k: usize) -> f64 {
        let Some(mut t) = self.flight.fit.impact_time(p, k) else {
            return f64::NAN;
        };
        for _ in 0..if self.lift.acts() { 3 } else { 0 } {
            let step = closest_approach(&self.in_plane(p, k, t), &self.in_plane(p, k + 1, t));
            t += step.map_or(0.0, |s| s.0);
        }
        t
    }

    /// (time, motion before, motion after) of the impact between arcs k and k + 1.
    fn impact(&self, p: &[f64], k: usize) -> (f64, Motion, Motion) {
        let t = self.impact_time(p, k);
        let (down, up) = (self.world(p, k, t).vh, self.world(p, k + 1, t).vh);
        let half_s = extra(p, CONTACT) * self.slower_contact(down.abs());
        let kept = (-up / down).clamp(0.0, 1.0);
        let is_known = kept.is_finite() && self.calibration.view == View::Side;
        let kept = if is_known { kept } else { 1.0 };
        // What comes back more slowly takes longer to let go, up to twice as long; and a ball that touches at 0 and leaves at
        // T with e of its speed has arcs that meet at e T/(1 + e): from e = 1/2 up just half of a contact without loss.
        let contact_s = half_s * (1.0 + (1.0 / kept).min(2.0));
        let (touch_s, release_s) = (contact_s * kept / (1.0 + kept), contact_s / (1.0 + kept));
        let before = self.pushed(p, k, (LIFT_IN, DRAG_IN), self.world(p, k, t - touch_s));
        let after = self.pushed(
            p,
            k + 1,
            (LIFT_OUT, DRAG_OUT),
            self.world(p, k + 1, t + release_s),
        );
        (t - touch_s, before, after)
    }

    /// How many times longer than the first a contact at this speed takes: as v^(-1/5), by Hertz.
    fn slower_contact(&self, speed_m_s: f64) -> f64 {
        let times = (self.contact_speed_m_s.unwrap_or(speed_m_s) / speed_m_s).powf(0.2);
        if times.is_finite() {
            times.clamp(0.5, 2.0)
        } else {
            1.0
        }
    }

    /// The motion with what lift beyond its law may have changed in the speed along x, and drag beyond its law in both: a
    /// constant push a over an arc of duration T leaves about a T/4 in the speed at its end.
    /// (Seen from above by a near camera, the arcs have a lift of their own.)
    fn pushed(&self, p: &[f64], arc: usize, (lift, drag): (usize, usize), m: Motion) -> Motion {
        if matches!(self.flight.fit.forces, Forces::Overhead(_)) {
            return m;
        }
        let drag_per_m = p[DRAG] / self.scale(p);
        let (from, to) = self.flight.spans[arc];
        let speed = m.vr.hypot(m.vh);
        let push = drag_per_m * speed * (to - from) / 4.0;
        let lift = extra(p, lift) * self.lift.std_over_drag(arc);
        let drag = extra(p, drag);
        Motion {
            vr: m.vr + push * (lift * speed - drag * m.vr),
            vh: m.vh - push * drag * m.vh,
            ..m
        }
    }

    /// The kind of impact between arcs k and k + 1, `None` where they do not meet.
    #[must_use]
    pub fn kind(&self, k: usize) -> Option<ImpactKind> {
        self.flight.impacts[k]?;
        if self.calibration.view == View::Top {
            return Some(ImpactKind::Floor);
        }
        let (_, before, after) = self.impact(self.inputs.values.as_slice(), k);
        let (dx, dz) = (after.vr - before.vr, after.vh - before.vh);
        // A floor pushes up; friction adds at most about its own size sideways.
        let floor = before.vh < 0.0 && after.vh > -0.05 * before.vh.abs() && dz > 0.8 * dx.abs();
        Some(if floor {
            ImpactKind::Floor
        } else {
            ImpactKind::Wall
        })
    }

    /// Fitted gravity, m/s²; `None` where it cannot be checked (top view, or a scale taken from it). Where the ball's
    /// size and mass are known, the air's buoyancy with the mass it drags along (Lamb, Hydrodynamics, art. 92) is
    /// taken out: the ball falls with g (1 − b)/(1 + b/2), b the air's mass over the ball's.
    #[must_use]
    pub fn gravity_m_s2(&self) -> Option<Quantity> {
        let is_checkable = self.calibration.view == View::Side && self.calibration.scale != Scale::Gravity;
        let ball = &self.calibration.ball;
        let air_share = match (ball.radius_m, ball.mass_kg) {
            (Some(r), Some(m)) => AIR_DENSITY_KG_M3 * 4.0 / 3.0 * std::f64::consts::PI * r.powi(3) / m,
            _ => 0.0,
        };
        let lift = (1.0 - air_share) / (1.0 + 0.5 * air_share);
        if !(is_checkable && lift > 0.0) {
            return None;
        }
        // Drag beyond its law passes for gravity by a part of its own mean over the arcs.
        let top = self.flight.spans.iter().enumerate().map(|(k, s)| {
            let m = self.world(self.inputs.values.as_slice(), k, s.1);
            m.vr * m.vr + m.vh * m.vh
        });
        let speed2 = top.fold(0.0, f64::max);
        let out = self.inputs.outputs(|p| {
            let beyond = extra(p, DRAG_IN) * p[DRAG] / self.scale(p) * speed2;
            vec![fall_of(p) * self.scale(p) / lift + beyond]
        });
        out.quantity(0)
    }

    /// The floor impacts as bounces, in time order, with the index of the arc before each.
    #[must_use]
    pub fn bounces(&self) -> Vec<(usize, Bounce)> {
        let floors: Vec<usize> = (0..self.arcs().saturating_sub(1))
            .filter(|&k| self.kind(k) == Some(ImpactKind::Floor))
            .collect();
        let mut bounces = Vec::new();
        let mut unbroken = true;
        for (i, &k) in floors.iter().enumerate() {
            // Spin is known along an unbroken row of bounces from the first.
            unbroken &= k == i;
            let history = unbroken.then(|| &floors[..i]);
            let bounce = match self.calibration.view {
                View::Side => self.side_bounce(k, history),
                View::Top if self.bend().is_some() => top_view::without_uncertainties(&self.top_bounce(k)),
                View::Top => self.top_bounce(k),
            };
            if gains(&bounce) {
                unbroken = false;
                continue;
            }
            // What is impossible has no spin to go on with.
            unbroken &= bounce.impossible.is_none();
            bounces.push((k, bounce));
        }
        bounces
    }

    /// How many floor impacts are not among the [`bounces`](Self::bounces): the ball would have left faster than it came,
    /// so something else (a shadow, a hand) was followed on one side of them.
    #[must_use]
    pub fn impossible(&self, bounces: &[(usize, Bounce)]) -> usize {
        let floors = (0..self.arcs().saturating_sub(1)).filter(|&k| self.kind(k) == Some(ImpactKind::Floor));
        floors.count() - bounces.len()
    }

    /// R ω_y before the impact at `k`, m/s: the launch's spin, changed at each bounce before (spin stays in flight); NaN
    /// where the launch's is not known, or the launch was not seen.
    fn spin_in(&self, p: &[f64], history: &[usize]) -> f64 {
        let Some(ratio) = self.calibration.launch.spin_ratio.filter(|_| self.launch_seen) else {
            return f64::NAN;
        };
        let inertia = self.calibration.ball.inertia_factor;
        // A ball that rolls off its bench has the spin of its speed there, which the air then slows; a number is of the first impact.
        let rolls_until = || self.edge_s(p).unwrap_or(self.flight.spans[0].0);
        let since = if self.calibration.launch.rolling {
            rolls_until()
        } else {
            self.impact_time(p, 0)
        };
        let launch = self.world(p, 0, since).vr;
        if history.is_empty() {
            return ratio * launch;
        }
        let slope = self.slope(p);
        let gained = |&j: &usize| self.spin_gained(p, slope, j) / inertia;
        ratio * launch + history.iter().map(gained).sum::<f64>()
    }

    /// k times what the impact between arcs k and k + 1 adds to R ω, m/s: what the ball loses along the floor.
    fn spin_gained(&self, p: &[f64], slope: f64, k: usize) -> f64 {
        let (_, before, after) = self.impact(p, k);
        floor::turned(&before, slope).vr - floor::turned(&after, slope).vr
    }

    fn side_bounce(&self, k: usize, history: Option<&[usize]>) -> Bounce {
        let inertia = self.calibration.ball.inertia_factor;
        let p = self.inputs.values.as_slice();
        let (best, slope) = (self.impact(p, k), self.slope(p));
        let (before, after) = (floor::turned(&best.1, slope), floor::turned(&best.2, slope));
        let spin0 = history.map_or(f64::NAN, |h| self.spin_in(p, h));
        let speed = self
            .inputs
            .outputs(|p| vec![floor::turned(&self.impact(p, k).1, self.slope(p)).vr]);
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
            let (before, after) = (floor::turned(&a, slope), floor::turned(&b, slope));
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
        let regime = reading::regime(e_x);
        let friction = possible(out.quantity(out::FRICTION));
        let slid = regime == EERegime::Ordinary;
        Bounce {
            time_s: out.quantity(out::TIME),
            x_m: out.quantity(out::PLACE),
            incident: leg(&out, out::BEFORE),
            rebound: leg(&out, out::AFTER),
            restitution: out.quantity(out::RESTITUTION),
            tangential_ratio: ratio,
            regime,
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

    /// x0 from the edge to the first bounce, x from the first to the second (seen, or where the rebound's arc comes
    /// down to the first impact's height). `bounces` by [`Self::bounces`].
    #[must_use]
    pub fn distances(&self, bounces: &[(usize, Bounce)]) -> Distances {
        let found = self.distances_of(bounces);
        if self.bend().is_some() {
            return Distances {
                x0_m: found.x0_m.and_then(top_view::undetermined),
                x_m: found.x_m.and_then(top_view::undetermined),
                ..found
            };
        }
        found
    }

    fn distances_of(&self, bounces: &[(usize, Bounce)]) -> Distances {
        let Some(&(first, _)) = bounces.first() else {
            return Distances::default();
        };
        // Where the ball touches, as the time is when it does.
        let place = |p: &[f64], k: usize| self.impact(p, k).1.r;
        let x0_m = self.edge_distance(first, &place);
        let apart = |p: &[f64]| extra(p, PLACES) * self.scale(p);
        // Seen, when the very next impact is on the floor too.
        let (x_m, x_source) = match bounces.get(1) {
            Some(&(second, _)) if second == first + 1 => {
                let out = self
                    .inputs
                    .outputs(|p| vec![place(p, second) - place(p, first) + apart(p)]);
                (out.quantity(0), XSource::Observed)
            }
            _ if self.calibration.view == View::Top => {
                return Distances {
                    x0_m,
                    x_m: None,
                    x_source: None,
                };
            }
            _ => {
                let out = self.inputs.outputs(|p| {
                    let (t, touch, _) = self.impact(p, first);
                    let down = self.back_at(p, first + 1, t, (touch.r, touch.h));
                    vec![self.world(p, first + 1, down).r - touch.r + apart(p)]
                });
                (out.quantity(0), XSource::Extrapolated)
            }
        };
        Distances {
            x0_m,
            x_m,
            x_source: x_m.map(|_| x_source),
        }
    }

    /// When arc `k`, rising about `t`, comes down to the floor through the place (x, z) of the touch before, lift included: the
    /// rebound's own arc is still below that then, as the ball stays down for a while.
    fn back_at(&self, p: &[f64], k: usize, t: f64, (x, z): (f64, f64)) -> f64 {
        let slope = self.slope(p).tan();
        let mut down = t + self.flight.fit.planar(p).return_time(k, t);
        for _ in 0..5 {
            let m = self.world(p, k, down);
            down -= (m.h - z - slope * (m.r - x)) / (m.vh - slope * m.vr);
        }
        down
    }

    /// Whether the arc before the first impact can have begun at the edge: followed back to there, it is not below the
    /// floor. If it is, an impact before was missed.
    fn comes_from(&self, edge_m: f64, first: usize) -> bool {
        if self.calibration.view == View::Top {
            return true;
        }
        let p = self.inputs.values.as_slice();
        let (t, before, _) = self.impact(p, first);
        if first != 0 || !(before.vr.abs() > 1e-9) {
            return first == 0;
        }
        let back_s = (before.r - edge_m) / before.vr;
        let there = self.world(p, 0, t - back_s);
        // A tenth of the fall's height for what extrapolation and drag make of it.
        let fall_m = before.vh * before.vh / (2.0 * fall_of(p) * self.scale(p));
        !(back_s > 0.0) || there.h > before.h - 0.1 * fall_m
    }

    fn edge_distance(&self, first: usize, place: &impl Fn(&[f64], usize) -> f64) -> Option<Quantity> {
        if let Some(edge_m) = self.calibration.launch.edge_x_m {
            if !self.comes_from(edge_m, first) {
                return None;
            }
            return self
                .inputs
                .outputs(|p| vec![place(p, first) - edge_m])
                .quantity(0);
        }
        if self.calibration.has_origin() || self.calibration.view == View::Top || first != 0 {
            return None;
        }
        if self.flight.launch.is_some() {
            // Both places are the ball's: what all centres share is in neither.
            let seen = self.inputs.outputs(|p| {
                let apart = extra(p, PLACES) * self.scale(p);
                vec![place(p, first) - self.edge_place(p).map_or(f64::NAN, |e| e.r) + apart]
            });
            return self
                .bench_launch()
                .and_then(|l| l.edge_x_m)
                .and_then(|_| seen.quantity(0));
        }
        // A horizontal launch is level where it begins: the apex is the edge.
        let apex = |p: &[f64]| self.vertex_s(p);
        let start = self.flight.spans[0].0;
        let best = apex(self.inputs.values.as_slice());
        let level = (best - start).abs() < 2.0 * self.flight.interval_s;
        let out = self
            .inputs
            .outputs(|p| vec![place(p, first) - self.world(p, 0, apex(p)).r]);
        level.then(|| out.quantity(0)).flatten()
    }

    /// Place of arc `k` at time `t` in the world: (x, up), m.
    #[must_use]
    pub fn place_m(&self, k: usize, t: f64) -> (f64, f64) {
        let m = self.world(self.inputs.values.as_slice(), k, t);
        (m.r, m.h)
    }
}

/// Size of the common acceleration, plane units/s².
fn fall_of(p: &[f64]) -> f64 {
    if p[ACROSS] == 0.0 {
        p[GRAVITY]
    } else {
        p[GRAVITY].hypot(p[ACROSS])
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

/// What no contact does stands out by this many standard uncertainties.
const IMPOSSIBLE_SIGMAS: f64 = 3.0;

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
