//! From a track of spots to the flight of a ball seen from above.

use super::camera::{NearTopView, SpatialMotion};
use super::segment_sums::{SpatialSums, divided};
use crate::flight::arc_selection::{larger_part, longest_chain, longest_run, richest_run};
use crate::flight::flight_search::TrackCandidate;
use crate::flight::free_flight::{Flight, SpotUse};
use crate::flight::impacts::flight_from_fit;
use crate::flight::linking::{LinkedSpots, Spot, Track, median_radius};
use crate::flight::merge_arcs::{LEAST_JUMP, merge_by};
use crate::flight::motion_model::{ArcFit, MotionModel};
use crate::flight::outliers::{fit_without_outliers, uses_of};
use crate::flight::parabola::{Fall, Gravity};
use crate::flight::plausibility::MOST_SCATTER;
use crate::flight::samples::segment_sigma;
use crate::flight::segment::{ArcSums, TrackSample, falling};
use crate::numeric::robust::median;
use std::ops::Range;

/// A first centre's radius is known to about this part; it also changes by a part of this with the light and the
/// background.
const RADIUS_STD_PART: f64 = 0.03;

/// The ball on the floor is about the smallest of its track: this part of its sightings is smaller by chance.
const SMALLEST_PART: f64 = 0.05;

/// Points of the first and of the last arc, at least: one impact holds it, and its rise is free.
const LEAST_END_POINTS: usize = 5;

/// Arcs are fitted together, which takes time as the cube of their number.
const MOST_ARCS: usize = 16;

/// An impact is on the floor when the arcs meet no higher than this part of the camera's height, as the radius tells it.
const FLOOR_PART: f64 = 0.15;

/// A track (its `spots`) to be divided into arcs.
struct SpatialTrack {
    samples: Vec<TrackSample>,
    /// Standard deviation for segmentation, plane units.
    sigma: f64,
    /// The camera with what the track's ball tells of it.
    view: NearTopView,
}

impl SpatialTrack {
    /// `None` of no spots.
    fn new(spots: &[Spot], view: &NearTopView) -> Option<Self> {
        let sigma = segment_sigma(spots, view.segmentation_part_of_radius());
        let mut radii: Vec<f64> = spots.iter().map(|s| s.radius).collect();
        radii.sort_by(f64::total_cmp);
        let last = radii.len().checked_sub(1)?;
        let smallest = radii[(SMALLEST_PART * last as f64).round() as usize];
        let view = view.for_ball(smallest);
        let sample = |s: &Spot| {
            let radius_std = RADIUS_STD_PART.max(s.std / s.radius);
            TrackSample {
                zeta: 1.0 - (1.0 - view.touching()) * smallest / s.radius,
                zeta_weight: 1.0 / (radius_std * radius_std),
                ..TrackSample::of_spot(s, 1.0 / (sigma * sigma + s.std * s.std))
            }
        };
        Some(Self {
            samples: spots.iter().map(sample).collect(),
            sigma,
            view,
        })
    }

    /// The arcs that fall as they should, none cut in two.
    fn arcs(&self) -> Vec<Range<usize>> {
        let (samples, view) = (&self.samples, self.view);
        let fall = Fall::Known(Gravity::upright(view.fall_per_s2));
        let mut found = falling(divided(samples, view).0);
        // What its own bend and size contradict does not fall: it rolls, or is carried.
        found.retain(|r| {
            let own = || SpatialSums::of(view, &samples[r.clone()]).own_fall();
            r.len() < 5 || own().is_none_or(|(own, std)| fall.agrees(own, std))
        });
        merge_by(
            samples,
            found,
            |part| SpatialSums::of(view, part).residual(),
            |a, b| parts_ways(a, b, &view),
        )
    }
}

/// What speaks for a track (its `spots`) being the ball's: points on its arcs times their way, in standard deviations; `None`
/// when it hardly moves.
pub(super) fn candidate(spots: &[Spot], view: &NearTopView) -> Option<TrackCandidate> {
    let track = SpatialTrack::new(spots, view)?;
    let arcs = track.arcs();
    let covered: usize = arcs.iter().map(ExactSizeIterator::len).sum();
    let way = |r: &Range<usize>| {
        let (a, b) = (&track.samples[r.start], &track.samples[r.end - 1]);
        (b.r - a.r).hypot(b.h - a.h)
    };
    let way: f64 = arcs.iter().map(way).sum();
    let moves = covered >= 6 && way > 10.0 * track.sigma;
    (moves && !another_fall_is_better(&track)).then_some(TrackCandidate {
        gravity: Gravity::NONE,
        evidence: covered as f64 * way / track.sigma,
        span: (spots.first()?.time_s, spots.last()?.time_s),
    })
}

/// Whether the track is explained far better by quite another fall than the given one. Enough short arcs fit anything: a
/// camera said to be much too near would see a ball that hops about.
fn another_fall_is_better(track: &SpatialTrack) -> bool {
    let cost = |factor: f64| {
        let fall_per_s2 = factor * track.view.fall_per_s2;
        let view = NearTopView {
            fall_per_s2,
            ..track.view
        };
        divided(&track.samples, view).1
    };
    let given = cost(1.0);
    OTHER_FALLS
        .iter()
        .any(|&factor| cost(factor) + FAR_BETTER < given)
}

/// Factors on the fall: what is nearer than these may be a distance that is somewhat off, of which a warning tells.
const OTHER_FALLS: [f64; 4] = [1.0 / 16.0, 1.0 / 4.0, 4.0, 16.0];

/// By as much as three arcs and their margins cost.
const FAR_BETTER: f64 = 108.0;

/// The track with others before and after it that may be the same ball: lost at an impact, where its shadow lies against
/// it. What is something else makes no arc, or none that meets the ball's.
pub(super) fn with_continuations(linked: &LinkedSpots, track: &Track) -> Track {
    let mut whole = track.clone();
    let frame = |i: Option<&usize>| i.map(|&i| linked.spots[i].frame);
    let radius = median_radius(&linked.of(track));
    for other in linked.tracks.iter().filter(|t| t.len() >= LEAST_END_POINTS) {
        let alike = (median_radius(&linked.of(other)) / radius - 1.0).abs() < ALIKE_PART;
        if alike && frame(other.last()) < frame(whole.first()) {
            whole.splice(0..0, other.iter().copied());
        } else if alike && frame(other.first()) > frame(whole.last()) {
            whole.extend(other);
        }
    }
    whole
}

/// Tracks whose radii differ by less than this part may be one ball, nearer to the camera and farther from it.
const ALIKE_PART: f64 = 0.35;

/// Both arcs in the middle of the gap between them.
fn at_the_gap(
    a: &[TrackSample],
    b: &[TrackSample],
    view: &NearTopView,
) -> Option<(SpatialMotion, SpatialMotion)> {
    let t = 0.5 * (a.last()?.t + b.first()?.t);
    Some((
        SpatialSums::of(*view, a).motion_at(t)?,
        SpatialSums::of(*view, b).motion_at(t)?,
    ))
}

/// Whether the velocities of two neighbouring stretches differ as by an impact.
fn parts_ways(a: &[TrackSample], b: &[TrackSample], view: &NearTopView) -> bool {
    let Some((before, after)) = at_the_gap(a, b, view) else {
        return true;
    };
    let height = view.camera_height();
    let turn = (after.ground.vr - before.ground.vr).hypot(after.ground.vh - before.ground.vh);
    let jump = turn.hypot((after.rate - before.rate) * height);
    jump > LEAST_JUMP * before.speed(height).max(after.speed(height))
}

/// Whether two neighbouring stretches can be before and after an impact on the floor: near it between them, and rising
/// after it faster than before.
fn may_meet(a: &[TrackSample], b: &[TrackSample], view: &NearTopView) -> bool {
    at_the_gap(a, b, view).is_none_or(|(before, after)| {
        let low = 0.5 * (before.zeta + after.zeta) - view.touching() < FLOOR_PART;
        low && after.rate > before.rate
    })
}

/// Cuts the track, fits without outliers, finds impacts.
pub(super) fn flight_along(spots: &[Spot], view: &NearTopView, interval_s: f64) -> Option<Flight> {
    let track = SpatialTrack::new(spots, view)?;
    let (samples, view) = (&track.samples, &track.view);
    let close = longest_chain(samples, track.arcs(), interval_s);
    let met = longest_run(close, |last, next| {
        may_meet(&samples[last.clone()], &samples[next.clone()], view)
    });
    let mut ranges = richest_run(met, MOST_ARCS);
    loop {
        while ranges.first().is_some_and(|r| r.len() < LEAST_END_POINTS) {
            ranges.remove(0);
        }
        while ranges.last().is_some_and(|r| r.len() < LEAST_END_POINTS) {
            ranges.pop();
        }
        if ranges.is_empty() {
            return None;
        }
        let mut uses = uses_of(&ranges, spots.len());
        let mut found = fit_without_outliers(spots, &mut uses, ranges.len(), view)?;
        for _ in 0..REASSIGN_ROUNDS {
            if !reassign_near_impacts(samples, &mut uses, &found.0, interval_s) {
                break;
            }
            found = fit_without_outliers(spots, &mut uses, ranges.len(), view)?;
        }
        let flight = flight_from_fit(spots, uses, found, interval_s);
        let unmet = flight.impacts.iter().position(Option::is_none);
        match unmet.or_else(|| worst_break(&flight, samples, &ranges, track.sigma)) {
            None => {
                let convincing = flight.is_convincing(samples, &ranges, track.sigma);
                return convincing.then_some(flight);
            }
            Some(cut) => ranges = larger_part(ranges, cut + 1),
        }
    }
}

/// Times that the points beside an impact may change hands.
const REASSIGN_ROUNDS: usize = 4;

/// Frames this near to an impact serve neither arc, frame intervals: the shutter may have been open during the contact.
const CONTACT_INTERVALS: f64 = 0.5;

/// Gives the points between the middles of neighbouring arcs to the arc on whose side of the impact they are: seen from
/// above the path may hardly turn there, and segmentation is a frame off now and then. Whether any changed hands.
fn reassign_near_impacts(
    samples: &[TrackSample],
    uses: &mut [SpotUse],
    fit: &ArcFit,
    interval_s: f64,
) -> bool {
    let mut changed = false;
    for (s, use_) in samples.iter().zip(uses) {
        let gap = (1..fit.arcs()).find(|&k| s.t > fit.times[k - 1] && s.t < fit.times[k]);
        let Some((k, t)) = gap.and_then(|k| Some((k, fit.impact_time(fit.parameters.as_slice(), k - 1)?)))
        else {
            continue;
        };
        let share = if (s.t - t).abs() < CONTACT_INTERVALS * interval_s {
            SpotUse::NotFree
        } else {
            SpotUse::Used(if s.t < t { k - 1 } else { k })
        };
        let stays = *use_ == share || matches!(use_, SpotUse::Outlier(_));
        if !stays {
            *use_ = share;
            changed = true;
        }
    }
    changed
}

/// Where the chain breaks: beside the arc whose points lie worst about the common fit, if they lie worse than an arc's
/// do; `None` where all fit.
fn worst_break(
    flight: &Flight,
    samples: &[TrackSample],
    ranges: &[Range<usize>],
    sigma: f64,
) -> Option<usize> {
    let mut worst: Option<(usize, f64)> = None;
    for (k, r) in ranges.iter().enumerate() {
        let mut offs: Vec<f64> = samples[r.clone()]
            .iter()
            .map(|s| {
                let m = flight.fit.motion(k, s.t);
                (s.r - m.r).hypot(s.h - m.h)
            })
            .collect();
        let off = median(&mut offs).unwrap_or(0.0);
        if off > MOST_SCATTER * sigma && worst.is_none_or(|w| off > w.1) {
            worst = Some((k, off));
        }
    }
    let last = ranges.len().checked_sub(2)?;
    worst.map(|(k, _)| k.min(last))
}
