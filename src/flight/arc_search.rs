//! From a track and a first idea of its fall to the flight: the track is cut into arcs, these are joined, chosen, fitted and
//! judged, until they hold together.

use super::arc_selection::{
    LEAST_END_POINTS, is_free_flight, longest_chain, points_in, richest_run, without_straight_ends,
    without_weak_arc,
};
use super::fit::Forces;
use super::impacts::flight_from_fit;
use super::linking::{Spot, Track};
use super::merge_arcs::merge;
use super::outliers::{LEAST_FIT_POINTS, arc_of_outliers, emptied_arc, fit_point, fit_without_outliers};
use super::samples::{fine_sigma, samples_of, segment_sigma, shows_fall};
use super::segment::{self, Fall, Gravity, Stretch, StretchKind, TrackSample};
use super::{Flight, SpotUse, launch, overhead};

/// The flight along the track, from a first idea of the fall: where the arcs then show another fall, they are cut again
/// with that.
pub(super) fn build(
    spots: &[Spot],
    track: &Track,
    gravity: Gravity,
    forces: Forces,
    interval_s: f64,
) -> Option<Flight> {
    let mut flight = cut_and_fit(spots, track, gravity, forces, interval_s)?;
    let mut known = gravity;
    for _ in 0..FALL_ROUNDS {
        let shown = flight.fit.acceleration();
        let change = (shown.down - known.down).hypot(shown.across - known.across);
        if change <= SAME_FALL * known.down.abs() {
            break;
        }
        known = shown;
        match cut_and_fit(spots, track, known, forces, interval_s) {
            Some(again) if again.used() >= flight.used() => flight = again,
            _ => break,
        }
    }
    Some(flight)
}

/// Falls that differ by less than this part cut a track alike: half a second of fall, 1.2 m, then ends within 2 mm.
const SAME_FALL: f64 = 0.002;

/// Whether the points of the first arc lie on a straight line rather than on a fall, by what the other arcs say of the fall and of
/// the centres' scatter: a ball on its bench. (Its own misfit would pass for scatter.)
fn rolls_first(spots: &[Spot], track: &Track, ranges: &[std::ops::Range<usize>], forces: Forces) -> bool {
    let mut uses = vec![SpotUse::NotFree; track.len()];
    for (k, r) in ranges[1..].iter().enumerate() {
        uses[r.clone()].fill(SpotUse::Used(k));
    }
    let Some((fit, extra)) = fit_without_outliers(spots, track, &mut uses, ranges.len() - 1, forces) else {
        return false;
    };
    let samples: Vec<TrackSample> = ranges[0]
        .clone()
        .map(|i| fit_point(&spots[track[i]], 0, &extra).sample)
        .collect();
    let off = |gravity: Gravity| segment::misfit(&samples, Fall::Known(gravity));
    off(fit.acceleration()) - off(Gravity::NONE) > ROLLS_BETTER * fit.autocorrelation_inflation.max(1.0)
}

/// A line is better than a fall by so many squared standard deviations.
const ROLLS_BETTER: f64 = 16.0;

/// Times that the first arc is made to begin at the edge of a bench that it shows.
const EDGE_ROUNDS: usize = 6;

/// Times that a track is cut again.
const FALL_ROUNDS: usize = 4;

/// Cuts the track with the fall known, joins arcs that are one flight, fits, sets points aside, finds impacts.
fn cut_and_fit(
    spots: &[Spot],
    track: &Track,
    gravity: Gravity,
    forces: Forces,
    interval_s: f64,
) -> Option<Flight> {
    let falls = forces.falls();
    let sigma = segment_sigma(spots, track, forces);
    if let Forces::Overhead(known) = forces {
        return overhead::search::build(spots, track, sigma, known, interval_s);
    }
    let samples = samples_of(spots, track, sigma);
    let fall = Fall::Known(gravity);
    let stretches = segment::stretches(&samples, fall);
    let gravity = gravity.down;
    let chain = |flight: &[Stretch]| {
        let mut ranges: Vec<_> = flight.iter().map(|s| s.range.clone()).collect();
        ranges.retain(|r| is_free_flight(&samples[r.clone()], gravity, falls));
        longest_chain(&samples, merge(&samples, ranges, fall), interval_s)
    };
    // A ball that rolls in between was launched once more.
    let flights = stretches.split(|s| s.kind == StretchKind::Straight).map(chain);
    let ranges = richest_run(flights.max_by_key(|ranges| points_in(ranges))?);
    let shows = |least: f64| ranges.iter().any(|r| shows_fall(&samples, r, gravity, least));
    let least = if shows(sigma) {
        sigma
    } else {
        fine_sigma(spots, track, sigma)
    };
    let mut ranges = without_straight_ends(&samples, ranges, gravity, least, falls);
    let mut untrimmed: Option<Flight> = None;
    let mut edge_rounds = EDGE_ROUNDS;
    // Arcs that do not meet as a ball's do are two flights, or none: the longer part is tried again.
    while !ranges.is_empty() {
        let mut uses = vec![SpotUse::NotFree; track.len()];
        for (k, r) in ranges.iter().enumerate() {
            uses[r.clone()].fill(SpotUse::Used(k));
        }
        let Some(fit) = fit_without_outliers(spots, track, &mut uses, ranges.len(), forces) else {
            // An arc that loses its points one by one was none: bounces too small for the frames, a ball that stays down.
            ranges.remove(emptied_arc(&uses, ranges.len())?);
            continue;
        };
        if let Some(no_arc) = arc_of_outliers(&uses, &ranges) {
            ranges.remove(no_arc);
            continue;
        }
        let mut flight = flight_from_fit(spots, track, uses, fit, interval_s);
        let shows = |k: usize| shows_fall(&samples, &ranges[k], gravity, sigma);
        if let Some(chance) = (1..ranges.len().saturating_sub(1)).find(|&k| flight.is_detour(k)) {
            ranges.remove(chance);
            continue;
        }
        let last = ranges.len() - 1;
        let rolls = || rolls_first(spots, track, &ranges, forces);
        if last > 0 && !shows(0) && (flight.is_carried(0, ranges[0].len()) || rolls()) {
            ranges.remove(0);
            continue;
        }
        if last > 0 && !shows(last) && flight.is_carried(last, ranges[last].len()) {
            ranges.pop();
            continue;
        }
        flight.launch = launch::find(&flight);
        if let Some(start) = flight.first_after_edge(&ranges[0])
            && edge_rounds > 0
        {
            edge_rounds -= 1;
            ranges[0].start = start;
            continue;
        }
        let Some(cut) = flight.impacts.iter().position(Option::is_none) else {
            let mut sure = ranges.clone();
            if flight.trim_unsure_ends(&mut sure) {
                if sure.last().is_some_and(|r| r.len() < LEAST_END_POINTS) {
                    sure.pop();
                }
                if !sure.is_empty() && sure.iter().all(|r| r.len() >= LEAST_FIT_POINTS) {
                    ranges = sure;
                    untrimmed = Some(flight);
                    continue;
                }
            }
            return flight.is_convincing(&samples, &ranges, sigma).then_some(flight);
        };
        // A flight that falls apart without its unsure points is better off with them.
        if let Some(whole) = untrimmed {
            return whole.is_convincing(&samples, &ranges, sigma).then_some(whole);
        }
        ranges = without_weak_arc(&samples, ranges, cut, gravity, sigma);
    }
    None
}
