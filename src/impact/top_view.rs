//! Impacts seen from above.
//!
//! A camera far away sees straight paths over the floor. One that is near, at a known distance, sees them bent by the rise and
//! fall of the ball, which is taken out. Near and at a distance that is not known, it sees them bent, and what that does to
//! directions is not known either. Whatever needs the vertical speed is not reported of a top view.

use super::motion::{DIRECTION_SIGMAS, MeasuredMotion};
use super::{Bounce, CentreVelocity};
use crate::calibration::View;
use crate::flight::SpotUse;
use crate::flight::parabola::own_fall;
use crate::flight::segment::TrackSample;
use crate::quantity::Quantity;

/// A bend shows when it stands out by this many standard uncertainties,
const BEND_SIGMAS: f64 = 5.0;

/// and matters when the velocity changes by this part of itself over an arc: a degree.
const LEAST_BEND: f64 = 0.02;

/// Fewer points of an arc tell no bend.
const LEAST_BEND_POINTS: usize = 8;

impl MeasuredMotion<'_> {
    /// In a top view x is the direction of incidence: speeds along it, and the rebound's turn from it, to the left
    /// (towards +y, seen from above) positive.
    pub(super) fn top_bounce(&self, k: usize) -> Bounce {
        let out = self.inputs.outputs(|p| {
            let (t, a, b) = self.impact(p, k);
            // Mirrored back, so that a turn to the left stays one for a launch to the left.
            let (ax, bx) = (self.x_sign * a.vr, self.x_sign * b.vr);
            let speed = ax.hypot(a.vh);
            let along = (bx * ax + b.vh * a.vh) / speed;
            let across = (ax * b.vh - a.vh * bx) / speed;
            vec![
                t,
                0.5 * (a.r + b.r),
                speed,
                along,
                along / speed,
                across.atan2(along),
            ]
        });
        let moving = out.stands_out(2, DIRECTION_SIGMAS);
        let flat = |along| CentreVelocity {
            vx_m_s: out.quantity(along),
            vz_m_s: None,
            angle_rad: None,
        };
        Bounce {
            time_s: out.quantity(0),
            x_m: out.quantity(1),
            incident: flat(2),
            rebound: flat(3),
            tangential_ratio: moving.then(|| out.quantity(4)).flatten(),
            azimuth_rad: moving.then(|| out.quantity(5)).flatten(),
            ..Bounce::default()
        }
    }

    /// The part of itself by which the velocity changes most over an arc beyond what drag does, where the path was fitted as one without a fall and
    /// shows to be bent; `None` where it does not.
    #[must_use]
    pub fn bend(&self) -> Option<f64> {
        if self.calibration.view != View::Top || !self.flight.fit.model.is_straight() {
            return None;
        }
        let bends = (0..self.arcs()).filter_map(|k| self.bend_of(k));
        bends.max_by(f64::total_cmp)
    }

    fn bend_of(&self, k: usize) -> Option<f64> {
        let samples = |turned: bool| -> Vec<TrackSample> {
            let used = self.flight.points.iter().filter(|p| p.use_ == SpotUse::Used(k));
            used.map(|p| {
                // What is left of the bend once drag has its part.
                let m = self.flight.fit.motion(k, p.spot.time_s);
                let (right, up) = (p.spot.place.right - m.r, p.spot.place.up - m.h);
                let place = if turned { (up, right) } else { (right, up) };
                // What else centres scatter by is here the bend itself.
                TrackSample::new(p.spot.time_s, place, 1.0 / (p.spot.std * p.spot.std))
            })
            .collect()
        };
        let (up, right) = (samples(false), samples(true));
        if up.len() < LEAST_BEND_POINTS {
            return None;
        }
        let ((along_h, std), (along_r, _)) = (own_fall(&up)?, own_fall(&right)?);
        let change = along_h.hypot(along_r);
        let m = self.flight.fit.motion(k, self.flight.fit.times[k]);
        let seconds = up.last()?.t - up.first()?.t;
        let part = change * seconds / m.vr.hypot(m.vh);
        // Errors that last from frame to frame could pass for a bend: autocorrelated residuals ask for more.
        let inflation = self.flight.fit.autocorrelation_inflation.min(MOST_INFLATION);
        (change > BEND_SIGMAS * std * inflation.sqrt() && part > LEAST_BEND).then_some(part)
    }
}

/// Beyond this the bend itself makes the residuals hang together.
const MOST_INFLATION: f64 = 4.0;

/// The same with its uncertainty not determined.
pub(super) fn undetermined(q: Quantity) -> Option<Quantity> {
    Quantity::undetermined(q.value)
}

/// A bounce of whose numbers no uncertainty is known.
pub(super) fn without_uncertainties(bounce: &Bounce) -> Bounce {
    let of = |q: Option<Quantity>| q.and_then(undetermined);
    let leg = |l: CentreVelocity| CentreVelocity {
        vx_m_s: of(l.vx_m_s),
        vz_m_s: of(l.vz_m_s),
        angle_rad: of(l.angle_rad),
    };
    Bounce {
        time_s: of(bounce.time_s),
        x_m: of(bounce.x_m),
        incident: leg(bounce.incident),
        rebound: leg(bounce.rebound),
        tangential_ratio: of(bounce.tangential_ratio),
        azimuth_rad: of(bounce.azimuth_rad),
        ..bounce.clone()
    }
}
