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
//! 7. Two flights of one recording are parts of one launch, or two launches ([`continuation`]).
//! 8. What centres err by for many frames on end enters the arcs' covariance (`slow_errors`).
//!
//! The same tracks show what is wrong with the clock: [`duplicate_frames`], [`dropped_frames`], [`clock`].
//!
//! Types that files share stand below them ([`free_flight`], [`motion_model`], [`segment`], [`linking`]): no two files import
//! each other.

mod arc_ends;
mod arc_search;
mod arc_selection;
pub mod bend;
pub mod clock;
pub mod continuation;
pub mod crossing;
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
pub mod path;
pub mod planar;
mod planar_fit;
mod plausibility;
mod refit;
pub mod row_delays;
mod samples;
pub mod scale_change;
pub mod segment;
pub mod shake;
pub mod shown_shifts;
pub mod side_view;
mod slow_errors;

use flight_search::{FlightSearch, TrackCandidate, flight_with_its_fall};
pub use free_flight::{Flight, FlightPoint, NoFlight, OtherFlight, SpotUse};
use linking::{LinkedSpots, Spot, Track};
use rayon::prelude::*;

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
    find_through(linked, model, None)
}

/// The same; the flight that uses the spot with the id `chosen`, where one is.
///
/// # Errors
/// [`NoFlight`] with what was found instead.
pub fn find_through(
    linked: &LinkedSpots,
    model: &dyn FlightSearch,
    chosen: Option<usize>,
) -> Result<Flight, NoFlight> {
    let upright = find_leaning(linked, model, false, chosen);
    let leans = |f: &Flight| f.fit.lean_rad().abs() > LEAST_LEAN_RAD;
    if !model.falls_in_plane() || upright.as_ref().is_ok_and(|f| !leans(f)) {
        return upright;
    }
    // A camera that is rolled by degrees bends every path along r, too: arcs then have a curve of their own there.
    match (find_leaning(linked, model, true, chosen), upright) {
        (Ok(leaning), Ok(upright)) if leaning.used() <= upright.used() => Ok(upright),
        (Ok(leaning), _) => Ok(leaning),
        (Err(_), upright) => upright,
    }
}

/// The flight where the fall may lean or not: of the track with the most evidence that bounces, or else of one that falls.
fn find_leaning(
    linked: &LinkedSpots,
    model: &dyn FlightSearch,
    leaning: bool,
    chosen: Option<usize>,
) -> Result<Flight, NoFlight> {
    let longest = linked.tracks.first().map_or(0, Vec::len);
    if longest < LEAST_TRACK {
        return Err(NoFlight::NothingRound {
            spots: linked.spots.len(),
        });
    }
    let mut fallen = None;
    for (track, candidate) in candidates(linked, model, leaning, chosen) {
        let Some(flight) = flight_of(linked, track, &candidate, model, leaning, chosen) else {
            continue;
        };
        if flight.impacts.iter().any(Option::is_some) {
            return Ok(flight);
        }
        fallen = fallen.or(Some(flight));
    }
    fallen.ok_or(NoFlight::NothingFalls { longest })
}

/// Tracks that are tried for a flight, at most.
const MOST_CANDIDATES: usize = 8;

/// The tracks on which something moves as a ball does, the one with the most evidence first; those that hold the spot with the id `chosen`, where one is.
fn candidates<'a>(
    linked: &'a LinkedSpots,
    model: &dyn FlightSearch,
    leaning: bool,
    chosen: Option<usize>,
) -> Vec<(&'a Track, TrackCandidate)> {
    let holds = |t: &&Track| chosen.is_none_or(|id| t.iter().any(|&i| linked.spots[i].id == id));
    let long = linked
        .tracks
        .iter()
        .filter(|t| t.len() >= LEAST_TRACK)
        .filter(holds);
    let mut all: Vec<_> = long
        .filter_map(|t| Some((t, model.candidate(&linked.of(t), leaning)?)))
        .collect();
    all.sort_by(|a, b| b.1.evidence.total_cmp(&a.1.evidence));
    all.truncate(MOST_CANDIDATES);
    all
}

/// The flight along a track, with what continues it or without: the fullest of those that bounce, and use the spot with the id `chosen`, where one is.
fn flight_of(
    linked: &LinkedSpots,
    track: &Track,
    candidate: &TrackCandidate,
    model: &dyn FlightSearch,
    leaning: bool,
    chosen: Option<usize>,
) -> Option<Flight> {
    let interval_s = linking::interval_s(&linked.of(track));
    let along = |t: Track| flight_with_its_fall(model, &linked.of(&t), candidate.gravity, interval_s);
    // Where two things cross, a track may begin as one and end as the other.
    let is_chosen = |f: &Flight| chosen.is_none_or(|id| f.used_points().any(|p| p.spot.id == id));
    let stages = model.with_continuations(linked, track, candidate, leaning);
    let bounces = |f: &Flight| f.impacts.iter().any(Option::is_some);
    let flights: Vec<Option<Flight>> = stages.into_par_iter().map(along).collect();
    let flights = flights.into_iter().flatten().filter(is_chosen);
    flights.max_by_key(|f| (bounces(f), f.used()))
}

/// What else flies at some time of `flight`: the first place of each such thing, and whether it moves with the ball, as a
/// shadow or a reflection does.
#[must_use]
pub fn others(linked: &LinkedSpots, flight: &Flight, model: &dyn FlightSearch) -> Vec<OtherFlight> {
    let ball: Vec<&Spot> = flight.used_points().map(|p| &p.spot).collect();
    let mut found: Vec<(Vec<usize>, OtherFlight)> = Vec::new();
    let candidates = candidates(linked, model, false, None).into_par_iter();
    let flight_of = |(track, candidate)| flight_of(linked, track, &candidate, model, false, None);
    let flights: Vec<Option<Flight>> = candidates.map(flight_of).collect();
    for other in flights.into_iter().flatten() {
        let spots: Vec<&Spot> = other.used_points().map(|p| &p.spot).collect();
        let ids: Vec<usize> = spots.iter().map(|s| s.id).collect();
        let shares = |known: &[usize]| 2 * ids.iter().filter(|id| known.contains(id)).count() > ids.len();
        let is_ball = shares(&ball.iter().map(|s| s.id).collect::<Vec<_>>());
        if is_ball || found.iter().any(|(known, _)| shares(known)) {
            continue;
        }
        let beside: Vec<(&Spot, &Spot)> = spots
            .iter()
            .filter_map(|s| Some((*s, *ball.iter().find(|b| b.frame == s.frame)?)))
            .collect();
        if beside.len() < LEAST_TRACK {
            continue;
        }
        let (from_s, to_s) = other.time_span();
        let seen = OtherFlight {
            from_s,
            to_s,
            place: spots[0].place,
            moves_along: moves_along(&beside),
            contrast_grey: linking::median_contrast(&spots),
        };
        found.push((ids, seen));
    }
    found.into_iter().map(|(_, seen)| seen).collect()
}

/// Things move together where the line between them changes by less than this part of their way.
const TOGETHER_PART: f64 = 0.15;

/// Whether pairs of sightings in the same frames keep their distance and direction.
fn moves_along(pairs: &[(&Spot, &Spot)]) -> bool {
    let spread = |of: &dyn Fn(&(&Spot, &Spot)) -> f64| {
        let mean = pairs.iter().map(of).sum::<f64>() / pairs.len() as f64;
        pairs.iter().map(|p| (of(p) - mean).powi(2)).sum::<f64>()
    };
    let apart = spread(&|(a, b)| a.place.right - b.place.right) + spread(&|(a, b)| a.place.up - b.place.up);
    let way = spread(&|(_, b)| b.place.right) + spread(&|(_, b)| b.place.up);
    apart < TOGETHER_PART * TOGETHER_PART * way
}

/// Finds the arcs of a flight again with its fall known, in `spots` with better places, and any that were found since.
#[must_use]
pub fn find_again(spots: &[Spot], flight: &Flight, model: &dyn FlightSearch) -> Option<Flight> {
    flight_with_its_fall(model, spots, flight.fit.acceleration(), flight.interval_s)
}

#[cfg(test)]
mod tests;
