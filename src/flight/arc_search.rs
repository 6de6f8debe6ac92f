//! From a track and a first idea of its fall to the flight: the track is cut into arcs of parabolas or straight lines, these
//! are joined, chosen, fitted and judged, until they hold together.

use super::arc_selection::{
    LEAST_END_POINTS, is_free_flight, longest_chain, points_in, richest_run, without_straight_ends,
    without_weak_arc,
};
use super::free_flight::Flight;
use super::impacts::flight_from_fit;
use super::launch;
use super::linking::Spot;
use super::merge_arcs::merge;
use super::motion_model::MotionModel;
use super::outliers::{LEAST_FIT_POINTS, arc_of_outliers, emptied_arc, fit_without_outliers, uses_of};
use super::parabola::{self, Fall, Gravity};
use super::samples::{fine_sigma, samples_of, scatter_seen, segment_sigma, shows_fall};
use super::segment::{Stretch, StretchKind, TrackSample};
use std::ops::Range;

/// Arcs that are fitted together, at most: a ball that bounces more often is measured on this many successive arcs.
const MOST_ARCS: usize = 40;

/// A line is better than a fall by so many squared standard deviations.
const ROLLS_BETTER: f64 = 16.0;

/// Times that the first arc is made to begin at the edge of a bench that it shows.
const EDGE_ROUNDS: usize = 6;

/// The flight along a track (its `spots`) whose fall is known; `None` where its arcs are none of a ball.
pub(super) fn flight_along(
    spots: &[Spot],
    gravity: Gravity,
    model: &dyn MotionModel,
    interval_s: f64,
) -> Option<Flight> {
    let search = ArcSearch::new(spots, gravity, model, interval_s);
    let mut ranges = search.first_arcs()?;
    let mut untrimmed: Option<Flight> = None;
    let mut edge_rounds = EDGE_ROUNDS;
    // Arcs that do not meet as a ball's do are two flights, or none: the longer part is tried again.
    while !ranges.is_empty() {
        let mut flight = match search.fitted(&ranges) {
            Ok(flight) => flight,
            Err(no_arc) => {
                ranges.remove(no_arc?);
                continue;
            }
        };
        if let Some(no_arc) = search.arc_of_no_flight(&flight, &ranges) {
            ranges.remove(no_arc);
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
        if let Some(cut) = flight.impacts.iter().position(Option::is_none) {
            // A flight that falls apart without its unsure points is better off with them.
            if let Some(whole) = untrimmed {
                return search.convincing(whole, &ranges);
            }
            ranges = without_weak_arc(&search.samples, ranges, cut, gravity.down, search.sigma);
        } else if let Some(sure) = without_unsure_ends(&flight, &ranges) {
            ranges = sure;
            untrimmed = Some(flight);
        } else {
            let sure = search.convincing(flight, &ranges);
            return sure.or_else(|| search.convincing(untrimmed?, &ranges));
        }
    }
    None
}

/// A track to be divided into arcs.
struct ArcSearch<'a> {
    spots: &'a [Spot],
    samples: Vec<TrackSample>,
    /// Standard deviation for segmentation, plane units.
    sigma: f64,
    gravity: Gravity,
    model: &'a dyn MotionModel,
    interval_s: f64,
}

impl<'a> ArcSearch<'a> {
    fn new(spots: &'a [Spot], gravity: Gravity, model: &'a dyn MotionModel, interval_s: f64) -> Self {
        let sigma = segment_sigma(spots, model.segmentation_part_of_radius());
        Self {
            spots,
            samples: samples_of(spots, sigma),
            sigma,
            gravity,
            model,
            interval_s,
        }
    }

    /// The arcs by segmentation alone.
    fn first_arcs(&self) -> Option<Vec<Range<usize>>> {
        let (samples, fall, falls) = (
            &self.samples,
            Fall::Known(self.gravity),
            self.model.falls_in_plane(),
        );
        let g = self.gravity.down;
        let chain = |flight: &[Stretch]| {
            let mut ranges: Vec<_> = flight.iter().map(|s| s.range.clone()).collect();
            ranges.retain(|r| is_free_flight(&samples[r.clone()], g, falls));
            longest_chain(samples, merge(samples, ranges, self.gravity), self.interval_s)
        };
        // A ball that rolls in between was launched once more.
        let stretches = parabola::stretches(samples, fall);
        let flights = stretches.split(|s| s.kind == StretchKind::Straight).map(chain);
        let ranges = richest_run(flights.max_by_key(|ranges| points_in(ranges))?, MOST_ARCS);
        let shows = |r: &Range<usize>| shows_fall(samples, r, g, self.sigma);
        let least = if ranges.iter().any(shows) {
            self.sigma
        } else {
            fine_sigma(self.spots, self.sigma)
        };
        Some(without_straight_ends(samples, ranges, g, least, falls))
    }

    /// The flight of these arcs; otherwise the one that is none, if it is one.
    fn fitted(&self, ranges: &[Range<usize>]) -> Result<Flight, Option<usize>> {
        let mut uses = uses_of(ranges, self.spots.len());
        // An arc that loses its points one by one was none: bounces too small for the frames, a ball that stays down.
        let Some(fit) = fit_without_outliers(self.spots, &mut uses, ranges.len(), self.model) else {
            return Err(emptied_arc(&uses, ranges.len()));
        };
        match arc_of_outliers(&uses, ranges) {
            Some(no_arc) => Err(Some(no_arc)),
            None => Ok(flight_from_fit(self.spots, uses, fit, self.interval_s)),
        }
    }

    /// An arc that is fitted well and yet is no ball's free flight.
    fn arc_of_no_flight(&self, flight: &Flight, ranges: &[Range<usize>]) -> Option<usize> {
        let last = ranges.len() - 1;
        let shows = |k: usize| shows_fall(&self.samples, &ranges[k], self.gravity.down, self.sigma);
        let carried = |k: usize| flight.is_carried(k, ranges[k].len());
        if let Some(chance) = (1..last).find(|&k| flight.is_detour(k)) {
            Some(chance)
        } else if last > 0
            && !shows(0)
            && (carried(0)
                || flight.hardly_turns(0)
                || self.rolls_first(ranges)
                || self.rolls_on(flight, ranges))
        {
            Some(0)
        } else {
            (last > 0 && !shows(last) && carried(last)).then_some(last)
        }
    }

    /// Whether the points of the first arc lie on a straight line rather than on a fall: a ball on its bench. The fall is that of the other
    /// arcs (its own misfit would pass for scatter); the scatter is theirs, or, where a view at a slant or a moving camera makes
    /// theirs large, that from point to point.
    fn rolls_first(&self, ranges: &[Range<usize>]) -> bool {
        let mut uses = uses_of(&ranges[1..], self.spots.len());
        let Some((fit, extra)) = fit_without_outliers(self.spots, &mut uses, ranges.len() - 1, self.model)
        else {
            return false;
        };
        let spots = || self.spots[ranges[0].clone()].iter();
        let worse = |samples: &[TrackSample]| {
            let off = |gravity: Gravity| parabola::misfit(samples, Fall::Known(gravity));
            off(fit.acceleration()) - off(Gravity::NONE)
        };
        let scattered: Vec<TrackSample> = spots().map(|s| extra.fit_point(s, 0).sample).collect();
        if worse(&scattered) > ROLLS_BETTER * fit.autocorrelation_inflation.max(1.0) {
            return true;
        }
        // Third differences are blind to what bends a path slowly.
        let Some(scatter) = scatter_seen(self.spots) else {
            return false;
        };
        worse(&self.scattered_by(scatter, ranges[0].clone())) > 2.0 * ROLLS_BETTER
    }

    /// Whether the first arc and the rise after it lie on one straight line about as well as on two falls: a ball that is on its bench up to what
    /// would be the top of the second arc. Where a view at a slant makes scatter large, the first arc alone does not show it. A hop that is no more
    /// than the centres' scatter is not told from a bench, and taken for one.
    fn rolls_on(&self, flight: &Flight, ranges: &[Range<usize>]) -> bool {
        let (fall, rise) = (flight.fit.acceleration(), ranges[1].clone());
        let from_s = self.spots[rise.start].time_s;
        let m = flight.fit.motion(1, from_s);
        let size = fall.down.hypot(fall.across);
        let top_s = from_s + (m.vh * fall.down - m.vr * fall.across) / (size * size);
        let risen = self.spots[rise.clone()].partition_point(|s| s.time_s < top_s);
        let Some(scatter) = scatter_seen(self.spots).filter(|_| risen > 0) else {
            return false;
        };
        let first = self.scattered_by(scatter, ranges[0].clone());
        let second = self.scattered_by(scatter, rise.start..rise.start + risen);
        let falls: f64 = [&first, &second]
            .into_iter()
            .map(|s| parabola::misfit(s, Fall::Known(fall)))
            .sum();
        let line = parabola::misfit(&[first, second].concat(), Fall::Known(Gravity::NONE));
        line - falls < ROLLS_BETTER
    }

    /// The points of `range`, each uncertain by `scatter` at least.
    fn scattered_by(&self, scatter: f64, range: Range<usize>) -> Vec<TrackSample> {
        let std = |s: &Spot| s.std.max(scatter);
        let sample = |s: &Spot| TrackSample::of_spot(s, 1.0 / (std(s) * std(s)));
        self.spots[range].iter().map(sample).collect()
    }

    fn convincing(&self, flight: Flight, ranges: &[Range<usize>]) -> Option<Flight> {
        let convincing = flight.is_convincing(&self.samples, ranges, self.sigma);
        convincing.then_some(flight)
    }
}

/// The arcs without points at their ends that may be on the other side of an impact; `None` where there are none, or too few
/// points would be left.
fn without_unsure_ends(flight: &Flight, ranges: &[Range<usize>]) -> Option<Vec<Range<usize>>> {
    let mut sure = ranges.to_vec();
    if !flight.trim_unsure_ends(&mut sure) {
        return None;
    }
    if sure.last().is_some_and(|r| r.len() < LEAST_END_POINTS) {
        sure.pop();
    }
    let enough = !sure.is_empty() && sure.iter().all(|r| r.len() >= LEAST_FIT_POINTS);
    enough.then_some(sure)
}
