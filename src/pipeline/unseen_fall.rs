//! The share of a result's uncertainty that comes from a fall that is not seen: a distant camera above the floor, or one at an unknown distance, shows
//! the ball's way over the floor alone.
//!
//! ```text
//! h(t)    height over the floor, by the times of the impacts and g: a bounce before and one after the arc tell it, else the arc is taken to
//!         begin at its highest point, or to rise for three quarters as long as the ball fell
//! v(t)    the whole speed, √(u² + g² (t − t_top)²), u being the speed along the floor
//! air     drag differs from the model's mean over the flight by −β (v − q u) u; lift is up to a part of drag, along the way and across
//! camera  at a distance D a place p is drawn h/D further from the point below the camera: 1/D is 0 ± 1 /m, and what the points show beside that
//! ```
//!
//! Each of these moves every point of the flight from where the model without it has the ball. How the arcs follow is, to first order, the same least squares
//! as their fit; the outer products of what the parameters change by add to their covariance. The air is taken from each impact on, whose velocities are what
//! counts.
//!
//! Assumed: a launch from rest in height, and a camera above the middle of its picture. Nothing is corrected: the share is as large as what is not known.

use super::camera::CalibratedCamera;
use crate::flight::Flight;
use crate::flight::drag::USUAL_LIGHT_DRAG;
use crate::flight::motion_model::FitPoint;
use crate::impact::error_budget::UNKNOWN_SPIN_LIFT_STD;

/// A rise after a bounce lasts this part of the fall before it.
const RISE_OVER_FALL: f64 = 0.75;

/// Standard deviation of 1/D, of whose distance D nothing is known: no camera that sees a whole launch is nearer than a metre or so.
const NEAREST_PER_M: f64 = 1.0;

/// Steps of the integrals over time.
const STEPS: usize = 16;

/// The fall on one arc, by its impacts.
struct UnseenFall {
    /// When the ball is highest, s.
    top_s: f64,
    /// An impact that the arc has, s.
    impact_s: f64,
    gravity_m_s2: f64,
}

impl UnseenFall {
    /// Of each arc that has an impact.
    fn of_arcs(flight: &Flight, gravity_m_s2: f64) -> Vec<Option<Self>> {
        let mut falls: Vec<Option<Self>> = Vec::new();
        for (k, span) in flight.spans.iter().enumerate() {
            let impact = |k: Option<usize>| flight.impacts.get(k?).copied().flatten();
            let (before, after) = (impact(k.checked_sub(1)), impact(Some(k)));
            let last_fall_s = match (before, falls.last()) {
                (Some(at), Some(Some(fall))) => at - fall.top_s,
                _ => 0.0,
            };
            let place = match (before, after) {
                (Some(a), Some(b)) => Some((0.5 * (a + b), a)),
                (None, Some(b)) => Some((span.0, b)),
                (Some(a), None) => Some((a + (RISE_OVER_FALL * last_fall_s).max(0.5 * (span.1 - a)), a)),
                (None, None) => None,
            };
            falls.push(place.map(|(top_s, impact_s)| Self {
                top_s,
                impact_s,
                gravity_m_s2,
            }));
        }
        falls
    }

    fn speed_m_s(&self, t: f64) -> f64 {
        self.gravity_m_s2 * (t - self.top_s)
    }

    fn height_m(&self, t: f64) -> f64 {
        let (impact, here) = (self.impact_s - self.top_s, t - self.top_s);
        (0.5 * self.gravity_m_s2 * (impact * impact - here * here)).max(0.0)
    }
}

/// `flight` with what an unseen fall may have done to it in its covariance, where its model sees none from above.
pub fn widened(mut flight: Flight, camera: &CalibratedCamera<'_>, metres_per_unit: f64) -> Flight {
    if !flight.fit.model.is_straight() {
        return flight;
    }
    let falls = UnseenFall::of_arcs(&flight, camera.calibration.gravity_m_s2);
    let points = flight.fit_points();
    let mut all = air(&flight, &points, &falls, camera, metres_per_unit);
    all.extend(perspective(&flight, &points, &falls, camera));
    // A ball that stands has no direction, and points without a ball no radius.
    all.retain(|shifts| shifts.iter().all(|(r, h)| r.is_finite() && h.is_finite()));
    for shifts in all {
        flight.fit.widen(&points, &shifts);
    }
    flight
}

/// What the air does to the ball on one arc, in plane units.
struct ArcAir<'a> {
    fall: &'a UnseenFall,
    metres_per_unit: f64,
    speed_along_floor: f64,
    /// Drag β at a whole speed.
    beta: &'a dyn Fn(f64) -> f64,
    /// What the model has for it along the floor.
    model_beta: f64,
}

impl ArcAir<'_> {
    fn whole_speed(&self, t: f64) -> f64 {
        let fall = self.fall.speed_m_s(t) / self.metres_per_unit;
        self.speed_along_floor.hypot(fall)
    }

    /// The deceleration by drag beyond the model's.
    fn drag_beyond_model(&self, t: f64) -> f64 {
        let (u, whole) = (self.speed_along_floor, self.whole_speed(t));
        ((self.beta)(whole) * whole - self.model_beta * u) * u
    }

    /// The acceleration by lift in any direction, one standard deviation.
    fn lift(&self, t: f64) -> f64 {
        let whole = self.whole_speed(t);
        UNKNOWN_SPIN_LIFT_STD * (self.beta)(whole) * whole * whole
    }
}

/// By how much each point moves by what the air may do beyond the model, from each impact on.
fn air(
    flight: &Flight,
    points: &[FitPoint],
    falls: &[Option<UnseenFall>],
    camera: &CalibratedCamera<'_>,
    metres_per_unit: f64,
) -> Vec<Vec<(f64, f64)>> {
    let unknown = USUAL_LIGHT_DRAG / flight.radius();
    let beta = |whole: f64| {
        camera
            .drag(Some(metres_per_unit), whole)
            .map_or(unknown, |d| d.beta)
    };
    let mut all = Vec::new();
    for (k, fall) in falls.iter().enumerate() {
        let Some(fall) = fall else { continue };
        let m = flight.fit.motion(k, flight.fit.times[k]);
        let speed_along_floor = m.vr.hypot(m.vh);
        let along = (m.vr / speed_along_floor, m.vh / speed_along_floor);
        let across = (-along.1, along.0);
        let air = ArcAir {
            fall,
            metres_per_unit,
            speed_along_floor,
            beta: &beta,
            model_beta: flight.fit.drag(),
        };
        let impacts = [k.checked_sub(1), Some(k)].into_iter().flatten();
        for from_s in impacts.filter_map(|k| flight.impacts.get(k).copied().flatten()) {
            let shifts = |acceleration: &dyn Fn(f64) -> f64, towards: (f64, f64)| -> Vec<(f64, f64)> {
                let shift = |p: &FitPoint| {
                    if p.arc != k {
                        return (0.0, 0.0);
                    }
                    let way = way_since(from_s, p.sample.t, acceleration);
                    (way * towards.0, way * towards.1)
                };
                points.iter().map(shift).collect()
            };
            all.push(shifts(&|t| air.drag_beyond_model(t), along));
            all.push(shifts(&|t| air.lift(t), along));
            all.push(shifts(&|t| air.lift(t), across));
        }
    }
    all
}

/// The way that an acceleration makes from `from_s` on, where both place and velocity are as without it.
fn way_since(from_s: f64, t: f64, acceleration: &dyn Fn(f64) -> f64) -> f64 {
    let step_s = (t - from_s) / STEPS as f64;
    let middle = |i: usize| from_s + (i as f64 + 0.5) * step_s;
    (0..STEPS)
        .map(|i| (t - middle(i)) * acceleration(middle(i)) * step_s)
        .sum()
}

/// By how much each point moves by one standard uncertainty of the camera's distance.
fn perspective(
    flight: &Flight,
    points: &[FitPoint],
    falls: &[Option<UnseenFall>],
    camera: &CalibratedCamera<'_>,
) -> Option<Vec<(f64, f64)>> {
    let below = camera.map.plane_from_pixel(camera.middle())?;
    // For 1/D of 1 /m.
    let shift = |p: &FitPoint| {
        let height_m = falls[p.arc]
            .as_ref()
            .map_or(0.0, |fall| fall.height_m(p.sample.t));
        (
            height_m * (p.sample.r - below.right),
            height_m * (p.sample.h - below.up),
        )
    };
    let shifts: Vec<(f64, f64)> = points.iter().map(shift).collect();
    // What of that the arcs do not follow shows in the residuals.
    let left_over = flight.left_over(points, &shifts)?;
    let told = left_over.dot(&flight.whitened_residuals(points));
    let scatter = flight.fit.reduced_chi.max(1.0).powi(2) * flight.fit.autocorrelation_inflation;
    let information = left_over.norm_squared() / scatter + NEAREST_PER_M.powi(-2);
    let per_m = (told / scatter / information).hypot(information.powf(-0.5));
    per_m
        .is_finite()
        .then(|| shifts.iter().map(|(r, h)| (per_m * r, per_m * h)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_acceleration_makes_half_of_it_times_the_square_of_time() {
        for t in [0.1, -0.2] {
            let way = way_since(0.3, 0.3 + t, &|_| 5.0);
            assert!((way - 2.5 * t * t).abs() < 1e-12, "{way}");
        }
        // One that grows with the time since: t³/6.
        let way = way_since(0.3, 0.5, &|s| s - 0.3);
        assert!((way - 0.2_f64.powi(3) / 6.0).abs() < 0.002 * way, "{way}");
    }

    #[test]
    fn a_fall_is_on_the_floor_at_its_impact_and_highest_at_its_top() {
        let fall = UnseenFall {
            top_s: 0.5,
            impact_s: 0.7,
            gravity_m_s2: 9.81,
        };
        assert_eq!(fall.height_m(0.7), 0.0);
        assert!((fall.height_m(0.5) - 0.5 * 9.81 * 0.04).abs() < 1e-12);
        assert!((fall.height_m(0.3)).abs() < 1e-12);
        assert!((fall.speed_m_s(0.7) - 0.2 * 9.81).abs() < 1e-12);
    }
}
