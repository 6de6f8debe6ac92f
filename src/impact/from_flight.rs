//! From a flight and its calibration to the measured motion, with the covariance of everything that it depends on.

use super::BounceSurface;
use super::bench_edge;
use super::contact::half_contact_s;
use super::error_budget::{SPHERE_LAW_STD, SQUARE_LAW_STD, USUAL_IMPACT_M_S};
use super::inputs::{MotionInputs, SystematicErrors};
use super::motion::{DIRECTION_SIGMAS, MeasuredMotion, SlopeSources, Zero};
use super::spin_lift::SpinLift;
use crate::calibration::{Calibration, View};
use crate::flight::Flight;
use crate::flight::planar::ARCS;
use crate::geometry::PlanePoint;
use crate::quantity::Quantity;

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

impl<'a> MeasuredMotion<'a> {
    /// The motion of `flight`, whose points `lift` was [taken from](SpinLift::taken_from).
    #[must_use]
    pub fn new(
        flight: &'a Flight,
        calibration: &'a Calibration,
        metres_per_unit: Quantity,
        imaging: ImagingErrors,
        lift: SpinLift,
    ) -> Self {
        let ImagingErrors {
            units_per_px,
            common_std_px,
            places_std_px,
            steady,
        } = imaging;
        let fit = &flight.fit;
        let relative = if calibration.scale.rests_on_fall() {
            // The fall's own share comes with the arcs' parameters.
            Some(calibration.gravity_uncertainty_m_s2() / calibration.gravity_m_s2)
        } else {
            metres_per_unit.std_uncertainty.map(|s| s / metres_per_unit.value)
        };
        let drag_law = match fit.model.drag_law().air() {
            Some(_) => SPHERE_LAW_STD,
            None => SQUARE_LAW_STD,
        };
        let common = common_std_px * units_per_px;
        let origin = calibration.origin_std_px.unwrap_or(0.0) * units_per_px;
        let stds = SystematicErrors {
            ln_scale: relative.unwrap_or(0.0),
            // Where the ball falls in the plane its arcs have what is known of "up".
            up_rad: if fit.falls_in_plane() {
                0.0
            } else {
                calibration.up_std_rad.unwrap_or(0.0)
            },
            zero_right: common.hypot(origin),
            zero_up: common.hypot(origin),
            // In units of the standard uncertainty of each arc's lift.
            lift_in: 1.0,
            lift_out: 1.0,
            drag_in: drag_law,
            drag_out: drag_law,
            place_right: places_std_px * units_per_px,
            place_up: places_std_px * units_per_px,
            ahead: places_std_px * units_per_px,
            lift_times_law: lift.times_law().1,
            // In units of their own.
            spin_in: 1.0,
            spin_out: 1.0,
            bench_rate: flight.launch.map_or(0.0, |l| l.rate.1),
            // Set below, from the motion.
            half_contact_s: 0.0,
            floor_line_rad: 0.0,
            floor_level_rad: 0.0,
        };
        let vr = fit.in_plane(fit.parameters.as_slice(), 0, fit.times[0]).vr;
        let std = fit.covariance[(ARCS + 1, ARCS + 1)].max(0.0).sqrt();
        let x_sign = if vr < -DIRECTION_SIGMAS * std { -1.0 } else { 1.0 };
        let zero = if calibration.has_origin() {
            Zero::Mark(PlanePoint::new(0.0, 0.0))
        } else {
            let seen = bench_edge::place(flight).or_else(|| flight.first_place());
            Zero::Seen(seen.unwrap_or_default())
        };
        let motion = Self {
            flight,
            calibration,
            inputs: MotionInputs::new(&fit.parameters, &fit.covariance, stds),
            x_sign,
            by_lift: lift.response(flight),
            lift,
            contact_speed_m_s: None,
            launch_seen: true,
            metres_per_unit,
            zero,
            steady,
            slope_sources: SlopeSources::default(),
            seen_spins: Vec::new(),
        };
        motion
            .in_contact()
            .since_launch()
            .on_floor()
            .with_origin_as_shown()
    }

    /// The same with an origin that is no better known along the floor than the first impact shows it to be above it.
    fn with_origin_as_shown(mut self) -> Self {
        if let Some(off_m) = self.floor_mismatch_m() {
            let off = off_m / self.scale(&self.inputs.best());
            self.inputs.set(|_, stds| {
                stds.zero_right = stds.zero_right.hypot(off);
                stds.zero_up = stds.zero_up.hypot(off);
            });
        }
        self
    }

    /// By how much the ball's centre touches higher than its radius above the calibration's origin, which lies on the floor; `None`
    /// where that is no more than half a radius and three pixels, as a ruler laid by hand allows, or where no origin is given.
    #[must_use]
    pub fn floor_mismatch_m(&self) -> Option<f64> {
        let calibration = self.calibration;
        let impacts = 0..self.flight.impacts.len();
        let mut below = impacts
            .filter(|&k| self.flight.impacts[k].is_some() && self.surface(k) != Some(BounceSurface::Ceiling));
        let first = below.next()?;
        if !calibration.has_origin() || calibration.view == View::Top {
            return None;
        }
        let p = self.inputs.best();
        let radius_m = (calibration.ball.radius_m).unwrap_or(self.flight.radius() * self.scale(&p));
        let off_m = self.impact(&p, first).1.h - radius_m;
        (off_m.abs() > 0.5 * radius_m + 3.0 * self.metres_per_unit.value).then_some(off_m)
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
        let p = self.inputs.best();
        let impacts = (0..self.arcs().saturating_sub(1)).filter(|&k| self.flight.impacts[k].is_some());
        self.contact_speed_m_s = match self.calibration.view {
            View::Side => impacts
                .map(|k| self.impact(&p, k).1.vh.abs())
                .find(|&v| v.is_finite() && v > 0.0),
            // Nothing in the picture is the speed against the floor.
            View::Top => Some(USUAL_IMPACT_M_S),
        };
        let (half_s, std_s) = half_contact_s(&self.calibration.ball, self.contact_speed_m_s.unwrap_or(0.0));
        self.inputs
            .set(|errors, stds| (errors.half_contact_s, stds.half_contact_s) = (half_s, std_s));
        self
    }
}
