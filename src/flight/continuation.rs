//! Whether one flight is the rest of another, or the same ball set free once more.
//!
//! After it is let go a ball only loses energy: to the floor, to walls, to the air. A flight that begins with more than the
//! one before it left with was given it by a hand: that is another launch. So is one that begins where what is left of the
//! one before cannot be: further away than its speed allows, behind it though it moves on in the same direction, or when it
//! would long lie still. All else may be the same launch, lost from sight for a while, and is taken for it.
//!
//! Assumed: both flights fall in the calibrated plane, and the floor is the lowest place at which the first was seen. Where
//! the ball gains energy from its surroundings (a bat, a wheel, stairs below the floor) its next flight counts as a launch.

use super::free_flight::Flight;
use super::planar::{GRAVITY, Motion};

/// A perspective that is not corrected, or a camera that moves, changes energies by less than this part.
const ENERGY_PART: f64 = 0.15;

/// What stands out by this many standard uncertainties is there.
const SIGMAS: f64 = 4.0;

/// Flights of one ball before one camera have falls that differ by less than this part, ...
const SAME_FALL_PART: f64 = 0.15;

/// ... known to this part, so that another fall would show, ...
const KNOWN_FALL_PART: f64 = 0.1;

/// ... and radii that differ by less than this part.
const SAME_RADIUS_PART: f64 = 0.25;

/// Places that are as near as this are one, in radii of the ball.
const NEAR_RADII: f64 = 4.0;

/// A ball lies still after the sum of all its bounces, times this.
const REST_TIMES: f64 = 1.5;

/// Whether `other` may be a flight of the ball that flew in `reference`: its size and its fall are the same, and known well
/// enough for that to say something.
#[must_use]
pub fn is_same_ball(reference: &Flight, other: &Flight) -> bool {
    let (g, own) = (reference.fit.gravity(), other.fit.gravity());
    let std = other.fit.covariance[(GRAVITY, GRAVITY)].max(0.0).sqrt();
    let size = other.radius() / reference.radius();
    (own / g - 1.0).abs() < SAME_FALL_PART
        && std < KNOWN_FALL_PART * g
        && (size - 1.0).abs() < SAME_RADIUS_PART
}

/// Whether `after` may be what is left of `before`, which ended before it began.
#[must_use]
pub fn may_continue(before: &Flight, after: &Flight) -> bool {
    let (left, found) = (End::last(before), End::first(after));
    let floor = left.place.h.min(found.place.h).min(lowest(before));
    let energy = left.energy(floor);
    let noise = left.energy_std().hypot(found.energy_std());
    if found.energy(floor) > (1.0 + ENERGY_PART) * energy + SIGMAS * noise {
        return false;
    }
    let near = NEAR_RADII * before.radius().max(after.radius());
    let (waited, way) = (found.time_s - left.time_s, found.place.r - left.place.r);
    let fastest = (2.0 * (1.0 + ENERGY_PART) * energy).sqrt() + SIGMAS * left.speed_std;
    if way.abs() > fastest * waited.max(0.0) + near {
        return false;
    }
    let moves = |end: &End| end.place.vr.abs() > SIGMAS * end.speed_std;
    let same_way = left.place.vr * found.place.vr > 0.0;
    if moves(&left) && moves(&found) && same_way && way * left.place.vr.signum() < -near {
        return false;
    }
    rest_after(before, &left, floor).is_none_or(|rests| waited < rests)
}

/// A flight where it was first or last seen.
struct End {
    time_s: f64,
    place: Motion,
    gravity: f64,
    /// Of each component.
    speed_std: f64,
}

impl End {
    fn first(flight: &Flight) -> Self {
        Self::of(flight, 0, flight.spans[0].0)
    }

    fn last(flight: &Flight) -> Self {
        let last = flight.fit.arcs() - 1;
        Self::of(flight, last, flight.spans[last].1)
    }

    fn of(flight: &Flight, arc: usize, time_s: f64) -> Self {
        let on_arc = || flight.used_points().filter(|p| p.arc() == Some(arc));
        let (from, to) = flight.spans[arc];
        let mean_std = on_arc().map(|p| flight.std(&p.spot)).sum::<f64>() / on_arc().count().max(1) as f64;
        // Of a straight line's slope; at the end of a parabola it is four times that.
        let slope_std = mean_std * 12_f64.sqrt() / ((to - from) * (on_arc().count().max(1) as f64).sqrt());
        let speed_std = 4.0 * slope_std;
        Self {
            time_s,
            place: flight.fit.motion(arc, time_s),
            gravity: flight.fit.gravity(),
            speed_std: if speed_std.is_finite() { speed_std } else { 0.0 },
        }
    }

    /// Of unit mass, over the floor.
    fn energy(&self, floor: f64) -> f64 {
        let m = &self.place;
        0.5 * (m.vr * m.vr + m.vh * m.vh) + self.gravity * (m.h - floor)
    }

    fn energy_std(&self) -> f64 {
        self.place.vr.hypot(self.place.vh) * self.speed_std
    }
}

/// The lowest place of a flight's impacts and ends.
fn lowest(flight: &Flight) -> f64 {
    let at_impacts = flight.impacts.iter().enumerate();
    let impacts = at_impacts.filter_map(|(k, t)| Some(flight.fit.motion(k, (*t)?).h));
    let spans = flight.spans.iter().enumerate();
    let ends = spans.flat_map(|(k, s)| [s.0, s.1].map(|t| flight.fit.motion(k, t).h));
    impacts.chain(ends).fold(f64::INFINITY, f64::min)
}

/// How long a ball that was `left` so goes on bouncing at most, s, by the best rebound that it showed before; `None` where it
/// showed none.
fn rest_after(flight: &Flight, left: &End, floor: f64) -> Option<f64> {
    let at_impacts = flight.impacts.iter().enumerate();
    let rebounds = at_impacts.filter_map(|(k, t)| {
        let (before, after) = (flight.fit.motion(k, (*t)?), flight.fit.motion(k + 1, (*t)?));
        let e = -after.vh / before.vh;
        (e > 0.0).then_some(e)
    });
    let best = rebounds.max_by(f64::total_cmp).filter(|e| *e < 1.0)?;
    let m = &left.place;
    let impact_speed = (m.vh * m.vh + 2.0 * left.gravity * (m.h - floor)).max(0.0).sqrt();
    Some(REST_TIMES * 2.0 * impact_speed / (left.gravity * (1.0 - best)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::linking::{LinkedSpots, Spot};
    use crate::flight::motion_model::VerticalPrior;
    use crate::flight::{self, side_view::SideView};
    use crate::frames::Coded;
    use crate::geometry::PlanePoint;

    const RATE_HZ: f64 = 120.0;
    const G: f64 = 1000.0;

    /// A ball that begins at `time_s` at (`right`, `up`) and moves along at `speed`, with restitution 0.8, over two impacts.
    fn flight(time_s: f64, right: f64, up: f64, speed: f64) -> Flight {
        let (mut spots, mut h, mut v, mut bounces) = (Vec::new(), up, 0.0, 0);
        let mut noise = crate::test_noise::TestNoise(7);
        for i in 0..400 {
            let t = i as f64 / RATE_HZ;
            let mut place = || 0.05 * (2.0 * noise.uniform() - 1.0);
            spots.push(Spot {
                id: i,
                frame: i,
                time_s: time_s + t,
                place: PlanePoint::new(right + speed * t + place(), h + place()),
                std: 0.05,
                coded: Coded::Whole,
                radius: 8.0,
                contrast_grey: 100.0,
            });
            let dt = 1.0 / RATE_HZ;
            let next = h + v * dt - 0.5 * G * dt * dt;
            if next < 0.0 {
                // To the impact and away from it.
                let hit = (v + (v * v + 2.0 * G * h).sqrt()) / G;
                let away = 0.8 * (G * hit - v);
                h = away * (dt - hit) - 0.5 * G * (dt - hit).powi(2);
                v = away - G * (dt - hit);
                bounces += 1;
                if bounces == 3 {
                    break;
                }
            } else {
                (h, v) = (next, v - G * dt);
            }
        }
        flight::find(
            &LinkedSpots::new(spots),
            &SideView::new(VerticalPrior::LEVEL_CAMERA),
        )
        .unwrap()
    }

    #[test]
    fn what_has_less_energy_further_on_is_the_rest_of_it() {
        let first = flight(0.0, 0.0, 120.0, 60.0);
        let (_, end) = first.time_span();
        let later = flight(end + 0.2, 60.0 * (end + 0.2), 40.0, 60.0);
        assert!(is_same_ball(&first, &later) && may_continue(&first, &later));
        // Back from a wall.
        assert!(may_continue(
            &first,
            &flight(end + 0.5, 60.0 * end - 20.0, 40.0, -40.0)
        ));
    }

    #[test]
    fn what_gains_energy_or_begins_behind_or_too_late_is_launched_anew() {
        let first = flight(0.0, 0.0, 120.0, 60.0);
        let (_, end) = first.time_span();
        let higher = flight(end + 1.0, 60.0 * end, 120.0, 60.0);
        let behind = flight(end + 1.0, 0.0, 30.0, 50.0);
        let far = flight(end + 0.1, 400.0, 40.0, 60.0);
        let late = flight(end + 30.0, 60.0 * end, 40.0, 60.0);
        for (what, other) in [
            ("higher", higher),
            ("behind", behind),
            ("far", far),
            ("late", late),
        ] {
            assert!(!may_continue(&first, &other), "{what}");
        }
    }

    #[test]
    fn another_size_is_another_ball() {
        let first = flight(0.0, 0.0, 120.0, 60.0);
        let mut other = first.clone();
        for p in &mut other.points {
            p.spot.radius *= 1.5;
        }
        assert!(!is_same_ball(&first, &other) && is_same_ball(&first, &first));
    }
}
