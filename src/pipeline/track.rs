//! The ball among all that moves: the flight by the centres as they were first seen, or were given.

use super::camera::CalibratedCamera;
use super::clock::Clocked;
use super::spots::{BallCentre, first_spots, with_id};
use crate::calibration::Optics;
use crate::flight::crossing::first_crossing;
use crate::flight::flight_search::FlightSearch;
use crate::flight::linking::{LinkedSpots, Spot};
use crate::flight::{self, Flight, NoFlight, OtherFlight, SpotUse};
use crate::numeric::robust::median;

/// A flight and the centres that it is made of.
#[derive(Debug, Clone)]
pub struct Tracked {
    /// The arcs and their points.
    pub flight: Flight,
    /// The ball in each frame, in the order of their ids.
    pub centres: Vec<BallCentre>,
    /// The camera's angles that the spots were made with.
    pub optics: Option<Optics>,
    /// The ball as it was first seen in its flight, each sighting with its own size.
    pub first_look: Vec<Spot>,
    /// What else flies meanwhile.
    pub others: Vec<OtherFlight>,
}

/// A thing that keeps its place beside another and stands out from what is behind it by this factor less is its shadow, or its reflection.
const SHADOW_CONTRAST: f64 = 1.5;

/// Whether of two things that move along, with these contrasts, the first is the shadow or the reflection of the other: no shadow is brighter than
/// what it falls on.
fn is_shadow_of(own_grey: f64, other_grey: f64) -> bool {
    if own_grey * other_grey < 0.0 {
        own_grey < 0.0
    } else {
        other_grey.abs() > SHADOW_CONTRAST * own_grey.abs()
    }
}

/// Shadows that are set aside before the ball, at most.
const MOST_SHADOWS: usize = 3;

/// The ball among `centres`, which may be of anything.
///
/// # Errors
/// [`NoFlight`] with what was found instead.
pub fn tracked(
    camera: &CalibratedCamera<'_>,
    clocked: &Clocked,
    centres: &[BallCentre],
    optics: Option<Optics>,
) -> Result<Tracked, NoFlight> {
    let mut linked = LinkedSpots::new(first_spots(camera, centres, clocked.frames(), optics));
    let model = camera.motion_model(None, None);
    let chosen = centres.iter().find(|c| c.is_chosen).map(|c| c.id);
    let mut flight = flight::find_through(&linked, &*model, chosen)?;
    if let Some((rest, alone)) = of_one_thing(&linked, &flight, &*model, chosen) {
        (linked, flight) = (rest, alone);
    }
    // Linked anew without it: a ball and its shadow beside it may be taken for each other from frame to frame.
    let mut others = flight::others(&without(&linked, &flight), &flight, &*model);
    // What was found may be the shadow of the ball, where no person says which it is.
    let shadows = if chosen.is_some() { 0 } else { MOST_SHADOWS };
    for _ in 0..shadows {
        let mut contrasts: Vec<f64> = flight.used_points().map(|p| p.spot.contrast_grey).collect();
        let own = median(&mut contrasts).unwrap_or(0.0);
        let casts = |o: &OtherFlight| o.moves_along && is_shadow_of(own, o.contrast_grey);
        if !others.iter().any(casts) {
            break;
        }
        let rest = without(&linked, &flight);
        let Ok(ball) = flight::find(&rest, &*model) else {
            break;
        };
        others = flight::others(&linked, &ball, &*model);
        (linked, flight) = (rest, ball);
    }
    let of_ball = flight.points.iter().filter_map(|p| with_id(centres, p.spot.id));
    Ok(Tracked {
        centres: of_ball.copied().collect(),
        first_look: flight.used_points().map(|p| p.spot).collect(),
        flight,
        optics,
        others,
    })
}

/// Crossings that are taken apart, at most.
const MOST_CROSSINGS: usize = 3;

/// Of a flight that goes from one thing over to another where they cross, the flight of the one that it has more points of, among what is left without the
/// other; `None` where it crosses nothing.
fn of_one_thing(
    linked: &LinkedSpots,
    flight: &Flight,
    model: &dyn FlightSearch,
    chosen: Option<usize>,
) -> Option<(LinkedSpots, Flight)> {
    let mut found: Option<(LinkedSpots, Flight)> = None;
    // What goes on behind a crossing may have been taken away before.
    let all = &linked.spots;
    for _ in 0..MOST_CROSSINGS {
        let (linked, flight) = found.as_ref().map_or((linked, flight), |(l, f)| (l, f));
        let Some(k) = first_crossing(flight, all) else {
            break;
        };
        let arc_of = |use_: SpotUse| match use_ {
            SpotUse::Used(arc) => Some(arc),
            _ => None,
        };
        let sides = flight
            .points
            .iter()
            .filter_map(|p| Some((arc_of(p.use_)? <= k, p.spot.id)));
        let (before, after): (Vec<_>, Vec<_>) = sides.partition(|(is_before, _)| *is_before);
        let is_chosen = |side: &[(bool, usize)]| side.iter().any(|(_, id)| Some(*id) == chosen);
        let keeps_after = is_chosen(&after) || (!is_chosen(&before) && after.len() > before.len());
        let other = if keeps_after { before } else { after };
        let is_left = |s: &&Spot| other.iter().all(|(_, id)| *id != s.id);
        let rest = LinkedSpots::new(linked.spots.iter().filter(is_left).copied().collect());
        let alone = flight::find_through(&rest, model, chosen).ok()?;
        found = Some((rest, alone));
    }
    found
}

/// All that was seen but the thing that flies.
fn without(linked: &LinkedSpots, flight: &Flight) -> LinkedSpots {
    let own: Vec<usize> = flight.points.iter().map(|p| p.spot.id).collect();
    let others = linked.spots.iter().filter(|s| !own.contains(&s.id));
    LinkedSpots::new(others.copied().collect())
}

/// The spots of `centres` in the plane.
pub fn spots_of(
    camera: &CalibratedCamera<'_>,
    clocked: &Clocked,
    centres: &[BallCentre],
    optics: Option<Optics>,
) -> Vec<Spot> {
    let spot = |c: &BallCentre| c.spot(camera, optics, &clocked.base.times_s);
    centres.iter().filter_map(spot).collect()
}
