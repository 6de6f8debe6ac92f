//! The measured motion in metres, for any values of its inputs: places and velocities on the arcs, and where they meet.

use super::BounceSurface;
use super::contact::SoftBall;
use super::inputs::{ImpactMotions, InputValues, MotionInputs};
use super::spin_candidates::SpinCandidates;
use super::spin_lift::SpinLift;
use crate::calibration::{Ball, Calibration, View};
use crate::flight::Flight;
use crate::flight::drag::AIR_DENSITY_KG_M3;
use crate::flight::motion_model::lean_rad;
use crate::flight::planar::{DRAG, Motion, closest_approach};
use crate::geometry::PlanePoint;
use crate::quantity::Quantity;
use nalgebra::DVector;

/// The measured motion with everything that turns it into metres.
#[derive(Debug)]
pub struct MeasuredMotion<'a> {
    pub(super) flight: &'a Flight,
    pub(super) calibration: &'a Calibration,
    pub(super) inputs: MotionInputs,
    /// +1 when the launch goes to the right in the picture, −1 to the left.
    pub x_sign: f64,
    pub(super) lift: SpinLift,
    /// How the arcs' parameters follow where lift is twice as much.
    pub(super) by_lift: Option<DVector<f64>>,
    /// Speed of the first impact, for which the time of contact stands, m/s.
    pub(super) contact_speed_m_s: Option<f64>,
    /// Whether the first arc may be the one that began at the launch, whose spin the calibration has.
    pub(super) launch_seen: bool,
    /// Metres a plane unit.
    pub metres_per_unit: Quantity,
    /// Where x = 0 lies.
    pub(super) zero: Zero,
    /// Whether the camera stands still.
    pub(super) steady: bool,
    /// How the floor's slope follows from impacts and calibration.
    pub(super) slope_sources: SlopeSources,
    /// What pictures show of the spin, arc by arc; empty where nobody looked.
    pub(super) seen_spins: Vec<SpinCandidates>,
}

/// Where x = 0 and the height 0 lie.
#[derive(Debug, Clone, Copy)]
pub(super) enum Zero {
    /// At the calibration's origin, which the picture shows against this point of the plane.
    Mark(PlanePoint),
    /// Where the ball was, in its plane of motion.
    Seen(PlanePoint),
}

/// How the slope follows from its sources: weights that add up to 1.
#[derive(Debug, Clone, Default)]
pub(super) struct SlopeSources {
    /// Arc before each touch, and its weight in the line through them.
    pub(super) touches: Vec<(usize, f64)>,
    pub(super) by_touches: f64,
    /// Direction of the line in the plane, rad, and its weight.
    pub(super) line: (f64, f64),
    /// Slope against gravity, rad, and its weight.
    pub(super) level: (f64, f64),
    /// A source that was left out as it contradicts the others: its slope and standard uncertainty, rad.
    pub(super) contradicted: Option<(f64, f64)>,
    pub(super) given: bool,
}

/// What kind of impact lies between two arcs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImpactKind {
    /// On a floor (the ball came down and went up) or a ceiling (it came up and went down).
    On(BounceSurface),
    /// On something upright, or an edge.
    Wall,
}

/// A velocity has a direction when it stands out from none by this many standard uncertainties.
pub(super) const DIRECTION_SIGMAS: f64 = 3.0;

/// With what part of gravity a ball falls in air: less by buoyancy and by the mass of air that it drags along (Lamb, Hydrodynamics, art. 92),
/// (1 − b)/(1 + b/2) with b the air's mass over the ball's; 1 where the ball's size and mass are not known.
#[must_use]
pub fn falling_share(ball: &Ball) -> f64 {
    let air_share = match (ball.radius_m, ball.mass_kg) {
        (Some(r), Some(m)) => AIR_DENSITY_KG_M3 * 4.0 / 3.0 * std::f64::consts::PI * r.powi(3) / m,
        _ => 0.0,
    };
    (1.0 - air_share) / (1.0 + 0.5 * air_share)
}

impl MeasuredMotion<'_> {
    /// The same where gravity refutes scale or clock by this `part`: until it is known which of them is wrong, lengths and speeds may be off by as much.
    #[must_use]
    pub fn with_doubted_scale(mut self, part: f64) -> Self {
        self.inputs
            .set(|_, stds| stds.ln_scale = stds.ln_scale.hypot(part));
        self
    }

    pub(super) fn arcs(&self) -> usize {
        self.flight.fit.arcs()
    }

    pub(super) fn scale(&self, p: &InputValues<'_>) -> f64 {
        let more = p.errors.ln_scale.exp();
        if self.calibration.scale.rests_on_fall() {
            self.calibration.gravity_m_s2 / p.fall() * more
        } else {
            self.metres_per_unit.value * more
        }
    }

    /// Motion on arc `k` at `t` with lift, plane units.
    pub(super) fn in_plane(&self, p: &InputValues<'_>, k: usize, t: f64) -> Motion {
        let fit = &self.flight.fit;
        let more = p.errors.lift_times_law;
        let mut moved = Vec::new();
        let arcs = match &self.by_lift {
            Some(by_lift) if more != 0.0 => {
                moved.extend_from_slice(p.arcs);
                for (m, change) in moved.iter_mut().zip(by_lift.iter()) {
                    *m += more * change;
                }
                &moved
            }
            _ => p.arcs,
        };
        let times = self.lift.times_law().0 + more;
        let lift = self.lift.motion(&fit.planar(arcs), k, t, times);
        fit.in_plane(arcs, k, t).along(&lift, 1.0)
    }

    /// By how much "up" of the world is turned from that of the plane, towards −r, rad: the fall leans by as much.
    pub(super) fn lean(&self, p: &InputValues<'_>) -> f64 {
        lean_rad(p.arcs) + p.errors.up_rad
    }

    /// Where x = 0 lies in the plane of motion.
    #[must_use]
    pub fn zero(&self) -> PlanePoint {
        self.zero_of(self.inputs.best().arcs)
    }

    fn zero_of(&self, arcs: &[f64]) -> PlanePoint {
        match self.zero {
            // The ball passed it as it was launched.
            Zero::Mark(place) => {
                let launch_s = self.flight.spans.first().map_or(0.0, |s| s.0);
                self.flight.fit.model.mark_in_plane(arcs, place, launch_s)
            }
            Zero::Seen(place) => place,
        }
    }

    /// Angle from the calibration's "up" to the fall's, rad, positive to the right in the picture; `None` where nothing falls in
    /// the plane.
    #[must_use]
    pub fn tilt_rad(&self) -> Option<Quantity> {
        let falls = self.calibration.view == View::Side && self.flight.fit.falls_in_plane();
        falls.then(|| self.inputs.quantity(|p| -self.lean(p))).flatten()
    }

    /// By how much "up" of the world is turned from that of the plane, towards −r, rad.
    #[must_use]
    pub fn lean_rad(&self) -> f64 {
        self.lean(&self.inputs.best())
    }

    /// Motion on arc `k` at `t` in metres: x along the launch, "up" against the fall.
    pub(super) fn world(&self, p: &InputValues<'_>, k: usize, t: f64) -> Motion {
        let m = self.in_plane(p, k, t);
        let s = self.scale(p);
        let (sin, cos) = self.lean(p).sin_cos();
        let zero = self.zero_of(p.arcs);
        let right = m.r - zero.right - p.errors.zero_right;
        let up = m.h - zero.up - p.errors.zero_up;
        let x = self.x_sign * s;
        Motion {
            r: x * (right * cos + up * sin),
            h: s * (up * cos - right * sin),
            vr: x * (m.vr * cos + m.vh * sin),
            vh: s * (m.vh * cos - m.vr * sin),
        }
    }

    /// When arcs `k` and `k + 1` meet, lift included, s.
    pub(super) fn impact_time(&self, p: &InputValues<'_>, k: usize) -> f64 {
        let Some(mut t) = self.flight.fit.impact_time(p.arcs, k) else {
            return f64::NAN;
        };
        for _ in 0..if self.lift.acts() { 3 } else { 0 } {
            let step = closest_approach(&self.in_plane(p, k, t), &self.in_plane(p, k + 1, t));
            t += step.map_or(0.0, |s| s.0);
        }
        t
    }

    /// (time, motion before, motion after) of the impact between arcs k and k + 1.
    pub(super) fn impact(&self, p: &InputValues<'_>, k: usize) -> ImpactMotions {
        p.impact(k, || self.find_impact(p, k))
    }

    fn find_impact(&self, p: &InputValues<'_>, k: usize) -> ImpactMotions {
        let t = self.impact_time(p, k);
        let (down, up) = (self.world(p, k, t).vh, self.world(p, k + 1, t).vh);
        let (kept, times) = match self.calibration.view {
            View::Side => ((-up / down).clamp(0.0, 1.0), self.slower_contact(down.abs())),
            View::Top => (1.0, 1.0),
        };
        let kept = if kept.is_finite() { kept } else { 1.0 };
        let half_s = p.errors.half_contact_s * times;
        // What comes back more slowly takes longer to let go, up to twice as long; and a ball that touches at 0 and leaves at
        // T with e of its speed has arcs that meet at e T/(1 + e): from e = 1/2 up just half of a contact without loss.
        let contact_s = half_s * (1.0 + (1.0 / kept).min(2.0));
        let (touch_s, release_s) = (contact_s * kept / (1.0 + kept), contact_s / (1.0 + kept));
        let before = self.pushed(
            p,
            k,
            (p.errors.lift_in, p.errors.drag_in),
            self.world(p, k, t - touch_s),
        );
        let after = self.pushed(
            p,
            k + 1,
            (p.errors.lift_out, p.errors.drag_out),
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
    /// (Seen from above by a near camera, the arcs have a lift of their own; by a distant one, what is not known of the air is in their covariance.)
    fn pushed(&self, p: &InputValues<'_>, arc: usize, (lift, drag): (f64, f64), m: Motion) -> Motion {
        let model = &self.flight.fit.model;
        if model.resolves_height() || model.is_straight() {
            return m;
        }
        let drag_per_m = p.arcs[DRAG] / self.scale(p);
        let (from, to) = self.flight.spans[arc];
        let speed = m.vr.hypot(m.vh);
        let push = drag_per_m * speed * (to - from) / 4.0;
        let lift = lift * self.lift.std_over_drag(arc);
        Motion {
            vr: m.vr + push * (lift * speed - drag * m.vr),
            vh: m.vh - push * drag * m.vh,
            ..m
        }
    }

    /// What the impact between arcs k and k + 1 is on; `None` where they do not meet, or on something upright.
    pub(super) fn surface(&self, k: usize) -> Option<BounceSurface> {
        match self.kind(k)? {
            ImpactKind::On(surface) => Some(surface),
            ImpactKind::Wall => None,
        }
    }

    /// The arcs that end on a floor or a ceiling, with which it is.
    pub(super) fn surfaces(&self) -> impl Iterator<Item = (usize, BounceSurface)> {
        let gaps = 0..self.arcs().saturating_sub(1);
        gaps.filter_map(|k| Some((k, self.surface(k)?)))
    }

    /// The kind of impact between arcs k and k + 1, `None` where they do not meet, or are not there.
    #[must_use]
    pub fn kind(&self, k: usize) -> Option<ImpactKind> {
        (*self.flight.impacts.get(k)?)?;
        if self.calibration.view == View::Top {
            return Some(ImpactKind::On(BounceSurface::Floor));
        }
        let (_, before, after) = self.impact(&self.inputs.best(), k);
        let (dx, dz) = (after.vr - before.vr, after.vh - before.vh);
        // A floor pushes up, a ceiling down; friction adds at most about its own size sideways.
        let is_on = |surface: &BounceSurface| {
            let up = surface.sign();
            up * before.vh < 0.0 && up * after.vh > -0.05 * before.vh.abs() && up * dz > 0.8 * dx.abs()
        };
        let surface = [BounceSurface::Floor, BounceSurface::Ceiling]
            .into_iter()
            .find(is_on);
        Some(surface.map_or(ImpactKind::Wall, ImpactKind::On))
    }

    /// Fitted gravity, m/s²; `None` where it cannot be checked (top view, or a scale taken from it). What the air takes from the fall
    /// ([`falling_share`]) is given back.
    #[must_use]
    pub fn gravity_m_s2(&self) -> Option<Quantity> {
        let is_checkable = self.calibration.view == View::Side && !self.calibration.scale.rests_on_fall();
        let lift = falling_share(&self.calibration.ball);
        if !(is_checkable && lift > 0.0) {
            return None;
        }
        // Where gravity told lengths, the fall without it.
        if let Some(ratio) = self.flight.fall_ratio() {
            let scale = self.metres_per_unit;
            let relative = scale.std_uncertainty.unwrap_or(0.0) / scale.value;
            let gravity = ratio.scaled(self.calibration.gravity_m_s2);
            let std = gravity.std_uncertainty?.hypot(relative * gravity.value);
            return Quantity::new(gravity.value, std);
        }
        // Drag beyond its law passes for gravity by a part of its own mean over the arcs.
        let top = self.flight.spans.iter().enumerate().map(|(k, s)| {
            let m = self.world(&self.inputs.best(), k, s.1);
            m.vr * m.vr + m.vh * m.vh
        });
        let speed2 = top.fold(0.0, f64::max);
        self.inputs.quantity(|p| {
            let beyond = p.errors.drag_in * p.arcs[DRAG] / self.scale(p) * speed2;
            p.fall() * self.scale(p) / lift + beyond
        })
    }

    /// Place of arc `k` at time `t` in the world: (x, up), m.
    #[must_use]
    pub fn place_m(&self, k: usize, t: f64) -> (f64, f64) {
        let m = self.world(&self.inputs.best(), k, t);
        (m.r, m.h)
    }

    /// What changes if the ball is soft; `None` where it is too dense for that, is not known, or seen from above.
    #[must_use]
    pub fn may_be_soft(&self) -> Option<SoftBall> {
        let c = self.calibration;
        let speed_m_s = self.contact_speed_m_s.filter(|_| c.view == View::Side)?;
        SoftBall::of(&c.ball, speed_m_s, c.gravity_m_s2)
    }
}
