//! The launch from a bench in metres: where and when the ball left it, how fast, and from what height.

use super::BenchLaunch;
use super::inputs::InputValues;
use super::motion::MeasuredMotion;
use crate::flight::Flight;
use crate::flight::free_flight::PlaneLaunch;
use crate::flight::motion_model::lean_rad;
use crate::flight::planar::Motion;
use crate::geometry::PlanePoint;

/// Line and arc that miss each other by more than this many standard uncertainties, and this part of the ball's radius, do not
/// meet as on an edge.
const GAP_SIGMAS: f64 = 5.0;
const GAP_PART: f64 = 0.03;

/// Where the first arc of `flight` leaves the bench, in the plane; `None` where it shows none.
pub(super) fn place(flight: &Flight) -> Option<PlanePoint> {
    let launch = flight.launch.filter(PlaneLaunch::is_rolled)?;
    let m = flight.fit.motion(0, launch.time_s);
    Some(PlanePoint::new(m.r, m.h))
}

impl MeasuredMotion<'_> {
    /// Motion at the edge, m, by any parameters; `None` where no bench is seen.
    pub(super) fn edge_place(&self, p: &InputValues<'_>) -> Option<Motion> {
        Some(self.world(p, 0, self.edge_s(p)?))
    }

    pub(super) fn edge_s(&self, p: &InputValues<'_>) -> Option<f64> {
        let launch = self.flight.launch.filter(PlaneLaunch::is_rolled)?;
        Some(self.parting_s(p, launch.rate.0 + p.errors.bench_rate))
    }

    /// By how much the edge is elsewhere than the best parameters have it, m, where x counts from there; 0 elsewhere.
    pub(super) fn edge_shift(&self, p: &InputValues<'_>) -> f64 {
        if self.calibration.has_origin() {
            return 0.0;
        }
        let place = |p: &InputValues<'_>| self.edge_place(p).map_or(0.0, |m| m.r);
        place(p) - place(&self.inputs.best())
    }

    /// When the first arc is at its highest, against gravity, s.
    pub(super) fn vertex_s(&self, p: &InputValues<'_>) -> f64 {
        self.parting_s(p, 0.0)
    }

    /// When the rate of y (along gravity) is `rate` on the first arc, s.
    fn parting_s(&self, p: &InputValues<'_>, rate: f64) -> f64 {
        let (sin, cos) = lean_rad(p.arcs).sin_cos();
        let mut t = self.flight.fit.times[0];
        // Without air the first step is exact, and air is a small part.
        for _ in 0..4 {
            let m = self.in_plane(p, 0, t);
            t -= (m.vr * sin - m.vh * cos - rate) / p.fall();
        }
        t
    }

    /// The launch from a bench; `None` where none is seen.
    #[must_use]
    pub fn bench_launch(&self) -> Option<BenchLaunch> {
        let launch = self.flight.launch.filter(PlaneLaunch::is_rolled)?;
        let lands = self.flight.impacts.first().is_some_and(Option::is_some);
        let out = self.inputs.outputs(|p| {
            let t = self.edge_s(p).unwrap_or(f64::NAN);
            let m = self.world(p, 0, t);
            let touch = if lands { self.impact(p, 0).1.h } else { f64::NAN };
            let seen = self.in_plane(p, 0, t);
            let (sin, cos) = lean_rad(p.arcs).sin_cos();
            let above = (seen.h * cos - seen.r * sin - launch.height.0) * self.scale(p);
            vec![m.r, t, m.vr.hypot(m.vh), m.h - touch, above]
        });
        let scale = self.scale(&self.inputs.best());
        let gap_std = out.std(4).hypot(launch.gap.1 * scale);
        let gap = crate::quantity::Quantity::new(out.value(4), gap_std);
        let radius = self.flight.points.first().map_or(0.0, |p| p.spot.radius) * scale;
        let meets = out.value(4).abs() <= GAP_SIGMAS * gap_std + GAP_PART * radius;
        Some(BenchLaunch {
            edge_x_m: out.quantity(0).filter(|_| meets),
            time_s: out.quantity(1).filter(|_| meets),
            speed_m_s: out.quantity(2),
            rolled_s: launch.time_s - launch.from_s,
            drop_height_m: out.quantity(3).filter(|_| meets),
            gap_m: gap,
        })
    }
}
