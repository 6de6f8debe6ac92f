//! The freely falling path among all that moves; its arcs, and the impacts between them.
//!
//! 1. [`linking`]: round things of successive frames become tracks.
//! 2. Each track is cut into arcs ([`segment`]) of the [motion model](motion_model) of the view: parabolas with one fall
//!    ([`side_view`]), straight lines ([`distant_top_view`]), or what a near camera above sees of a fall ([`near_top_view`]).
//!    The track with the most evidence of such a motion is the ball's ([`flight_search`]).
//! 3. With its fall known the track is cut again (`arc_search`), and arcs that are one flight are joined (`merge_arcs`,
//!    `arc_selection`).
//! 4. All arcs are fitted together ([`motion_model::ArcFit`]). Outliers are left out, with the reason (`outliers`).
//!    What moves straight in between (on a bench, on the floor) is no arc; where it leads into the first one the ball was
//!    launched ([`launch`]).
//! 5. Two arcs that meet between the last point of one and the first of the next are an impact (`impact_test`, `impacts`).
//! 6. What is no ball's flight is refused (`plausibility`), and so are points at the ends of arcs that may be another's
//!    (`arc_ends`).
//!
//! The same tracks show what is wrong with the clock: [`duplicate_frames`], [`dropped_frames`], [`clock`].
//!
//! Types that files share stand below them ([`free_flight`], [`motion_model`], [`segment`], [`linking`]): no two files import
//! each other.

mod arc_ends;
mod arc_search;
mod arc_selection;
pub mod clock;
pub mod distant_top_view;
pub mod drag;
pub mod dropped_frames;
pub mod duplicate_frames;
pub mod extra_variance;
pub mod flight_search;
pub mod free_flight;
mod impact_test;
mod impacts;
pub mod launch;
pub mod linking;
mod merge_arcs;
pub mod motion_model;
pub mod near_top_view;
mod outliers;
pub mod parabola;
pub mod planar;
mod planar_fit;
mod plausibility;
mod refit;
mod samples;
pub mod segment;
pub mod shake;
pub mod side_view;

use flight_search::{FlightSearch, flight_with_its_fall};
pub use free_flight::{Flight, FlightPoint, NoFlight, SpotUse};
use linking::{LinkedSpots, Spot};

/// A fall that leans by more than this is looked for as one, rad.
const LEAST_LEAN_RAD: f64 = 0.035;

/// Fewer spots than this are no track of a ball.
const LEAST_TRACK: usize = 4;

/// Finds the flight of `model` among what moves.
///
/// # Errors
///
/// [`NoFlight`] with what was found instead.
pub fn find(linked: &LinkedSpots, model: &dyn FlightSearch) -> Result<Flight, NoFlight> {
    let upright = find_leaning(linked, model, false);
    let leans = |f: &Flight| f.fit.lean_rad().abs() > LEAST_LEAN_RAD;
    if !model.falls_in_plane() || upright.as_ref().is_ok_and(|f| !leans(f)) {
        return upright;
    }
    // A camera that is rolled by degrees bends every path along r, too: arcs then have a curve of their own there.
    match (find_leaning(linked, model, true), upright) {
        (Ok(leaning), Ok(upright)) if leaning.used() <= upright.used() => Ok(upright),
        (Ok(leaning), _) => Ok(leaning),
        (Err(_), upright) => upright,
    }
}

/// The flight where the fall may lean or not.
fn find_leaning(linked: &LinkedSpots, model: &dyn FlightSearch, leaning: bool) -> Result<Flight, NoFlight> {
    let longest = linked.tracks.first().map_or(0, Vec::len);
    if longest < LEAST_TRACK {
        return Err(NoFlight::NothingRound {
            spots: linked.spots.len(),
        });
    }
    let nothing = NoFlight::NothingFalls { longest };
    let long = linked.tracks.iter().filter(|t| t.len() >= LEAST_TRACK);
    let (track, best) = long
        .filter_map(|t| Some((t, model.candidate(&linked.of(t), leaning)?)))
        .max_by(|a, b| a.1.evidence.total_cmp(&b.1.evidence))
        .ok_or_else(|| nothing.clone())?;
    let whole = model.with_continuations(linked, track, &best, leaning);
    let interval_s = linking::interval_s(&linked.of(track));
    flight_with_its_fall(model, &linked.of(&whole), best.gravity, interval_s).ok_or(nothing)
}

/// Finds the arcs of a flight again with its fall known, in `spots` with better places, and any that were found since.
#[must_use]
pub fn find_again(spots: &[Spot], flight: &Flight, model: &dyn FlightSearch) -> Option<Flight> {
    flight_with_its_fall(model, spots, flight.fit.acceleration(), flight.interval_s)
}

#[cfg(test)]
mod tests;
