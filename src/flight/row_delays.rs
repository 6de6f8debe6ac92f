//! A shutter that exposes one row after the other: each point is later (or earlier) than its frame by the same time ρ times its place among the rows.
//!
//! Moving the times of all points by ρ sᵢ moves the points along their own velocities. With h the height, that is h h', cubic in time on a parabola: it
//! has the sign of the velocity, which neither a slant nor a lift has ([`super::shown_shifts`]).

use super::free_flight::Flight;
use super::linking::Spot;
use super::shown_shifts::Shifts;

/// How far each of the flight's points is ahead of its place, plane units, where it is seen later by `delay_s`.
#[must_use]
pub fn ahead(flight: &Flight, delay_s: impl Fn(&Spot) -> f64) -> Shifts {
    let points = flight.fit_points();
    let delays_s = flight.used_points().map(|used| delay_s(&used.spot));
    let moved = points.iter().zip(delays_s).map(|(p, delay_s)| {
        let m = flight.fit.motion(p.arc, p.sample.t);
        (delay_s * m.vr, delay_s * m.vh)
    });
    moved.collect()
}
