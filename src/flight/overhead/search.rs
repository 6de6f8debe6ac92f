//! From a track of spots to the flight of a ball seen from above.

use super::segment_sums::OverheadSums;
use super::{Overhead, OverheadLayout, SpatialMotion};
use crate::flight::arc_selection::{larger_part, longest_chain};
use crate::flight::fit::{ArcFit, Forces};
use crate::flight::impacts::flight_from_fit;
use crate::flight::linking::{Spot, Track};
use crate::flight::merge_arcs::LEAST_JUMP;
use crate::flight::outliers::fit_without_outliers;
use crate::flight::plausibility::MOST_SCATTER;
use crate::flight::segment::{self, Fall, TrackSample};
use crate::flight::{Flight, SpotUse, median};
use crate::quantity::Quantity;
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

/// Squared residuals, in variances, that a cut must save: its parameters and a margin.
const CUT_GAIN: f64 = 36.0;

/// The samples of a track, and `known` with what its ball tells.
fn samples_of(spots: &[Spot], track: &Track, sigma: f64, known: Overhead) -> (Vec<TrackSample>, Overhead) {
    let mut radii: Vec<f64> = track.iter().map(|&i| spots[i].radius).collect();
    radii.sort_by(f64::total_cmp);
    let smallest = radii[(SMALLEST_PART * (radii.len() - 1) as f64).round() as usize];
    let known = known.for_ball(smallest);
    let of_radius = track.iter().map(|&i| {
        let s = &spots[i];
        let radius_std = RADIUS_STD_PART.max(s.std / s.radius);
        TrackSample {
            zeta: 1.0 - (1.0 - known.touching()) * smallest / s.radius,
            zeta_weight: 1.0 / (radius_std * radius_std),
            ..TrackSample::of_spot(s, 1.0 / (sigma * sigma + s.std * s.std))
        }
    });
    (of_radius.collect(), known)
}

/// How much speaks for a track being the ball's: points on its arcs times their way, in standard deviations; `None`
/// when it hardly moves.
pub(in crate::flight) fn evidence(spots: &[Spot], track: &Track, sigma: f64, known: Overhead) -> Option<f64> {
    let (samples, known) = samples_of(spots, track, sigma, known);
    let found = arcs(&samples, known);
    let covered: usize = found.iter().map(ExactSizeIterator::len).sum();
    let way: f64 = found
        .iter()
        .map(|r| {
            let (a, b) = (&samples[r.start], &samples[r.end - 1]);
            (b.r - a.r).hypot(b.h - a.h)
        })
        .sum();
    let moves = covered >= 6 && way > 10.0 * sigma;
    (moves && !another_fall_is_better(&samples, known)).then_some(covered as f64 * way / sigma)
}

/// Whether the track is explained far better by quite another fall than the given one. Enough short arcs fit anything: a
/// camera said to be much too near would see a ball that hops about.
fn another_fall_is_better(samples: &[TrackSample], known: Overhead) -> bool {
    let cost = |factor: f64| {
        let fall_per_s2 = factor * known.fall_per_s2;
        segment::cost(samples, Fall::Overhead(Overhead { fall_per_s2, ..known }))
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
pub(in crate::flight) fn with_continuations(spots: &[Spot], tracks: &[Track], mut whole: Track) -> Track {
    let mut radii: Vec<f64> = whole.iter().map(|&i| spots[i].radius).collect();
    let radius = median(&mut radii);
    for track in tracks.iter().filter(|t| t.len() >= LEAST_END_POINTS) {
        let mut radii: Vec<f64> = track.iter().map(|&i| spots[i].radius).collect();
        let alike = (median(&mut radii) / radius - 1.0).abs() < ALIKE_PART;
        let (Some(&first), Some(&last)) = (track.first(), track.last()) else {
            continue;
        };
        let (Some(&from), Some(&to)) = (whole.first(), whole.last()) else {
            continue;
        };
        if alike && spots[last].frame < spots[from].frame {
            whole.splice(0..0, track.iter().copied());
        } else if alike && spots[first].frame > spots[to].frame {
            whole.extend(track);
        }
    }
    whole
}

/// Tracks whose radii differ by less than this part may be one ball, nearer to the camera and farther from it.
const ALIKE_PART: f64 = 0.35;

/// The arcs that fall as they should, none cut in two.
fn arcs(samples: &[TrackSample], known: Overhead) -> Vec<Range<usize>> {
    let fall = Fall::Overhead(known);
    let mut found = segment::arcs(samples, fall);
    // What its own bend and size contradict does not fall: it rolls, or is carried.
    found.retain(|r| {
        r.len() < 5
            || OverheadSums::of(known, &samples[r.clone()])
                .own_fall()
                .is_none_or(|(own, std)| fall.agrees(own, std))
    });
    let mut joined: Vec<Range<usize>> = Vec::new();
    for r in found {
        if let Some(last) = joined.last_mut() {
            let (a, b) = (&samples[last.clone()], &samples[r.clone()]);
            let both: Vec<TrackSample> = a.iter().chain(b).copied().collect();
            let apart = segment::misfit(a, fall) + segment::misfit(b, fall);
            if segment::misfit(&both, fall) - apart < CUT_GAIN || !parts_ways(a, b, &known) {
                *last = last.start..r.end;
                continue;
            }
        }
        joined.push(r);
    }
    joined
}

/// Both arcs in the middle of the gap between them.
fn at_the_gap(
    a: &[TrackSample],
    b: &[TrackSample],
    known: &Overhead,
) -> Option<(SpatialMotion, SpatialMotion)> {
    let t = 0.5 * (a.last()?.t + b.first()?.t);
    Some((
        OverheadSums::of(*known, a).flying(t)?,
        OverheadSums::of(*known, b).flying(t)?,
    ))
}

/// Whether the velocities of two neighbouring stretches differ as by an impact.
fn parts_ways(a: &[TrackSample], b: &[TrackSample], known: &Overhead) -> bool {
    let Some((before, after)) = at_the_gap(a, b, known) else {
        return true;
    };
    let height = known.camera_height();
    let turn = (after.ground.vr - before.ground.vr).hypot(after.ground.vh - before.ground.vh);
    let jump = turn.hypot((after.rate - before.rate) * height);
    jump > LEAST_JUMP * before.speed(height).max(after.speed(height))
}

/// Whether two neighbouring stretches can be before and after an impact on the floor: near it between them, and rising
/// after it faster than before.
fn may_meet(a: &[TrackSample], b: &[TrackSample], known: &Overhead) -> bool {
    at_the_gap(a, b, known).is_none_or(|(before, after)| {
        let low = 0.5 * (before.zeta + after.zeta) - known.touching() < FLOOR_PART;
        low && after.rate > before.rate
    })
}

/// Cuts the track, fits, sets points aside, finds impacts.
pub(in crate::flight) fn build(
    spots: &[Spot],
    track: &Track,
    sigma: f64,
    known: Overhead,
    interval_s: f64,
) -> Option<Flight> {
    if track.is_empty() {
        return None;
    }
    let (samples, known) = samples_of(spots, track, sigma, known);
    let ranges = longest_chain(&samples, arcs(&samples, known), interval_s);
    let ranges = met_chain(&samples, ranges, &known);
    let mut ranges = richest(ranges);
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
        let mut uses = vec![SpotUse::NotFree; track.len()];
        for (k, r) in ranges.iter().enumerate() {
            uses[r.clone()].fill(SpotUse::Used(k));
        }
        let forces = Forces::Overhead(known);
        let (mut fit, mut extra) = fit_without_outliers(spots, track, &mut uses, ranges.len(), forces)?;
        for _ in 0..REASSIGN_ROUNDS {
            if !reassign_near_impacts(&samples, &mut uses, &fit, interval_s) {
                break;
            }
            (fit, extra) = fit_without_outliers(spots, track, &mut uses, ranges.len(), forces)?;
        }
        let flight = flight_from_fit(spots, track, uses, (fit, extra), interval_s);
        let cut = flight
            .impacts
            .iter()
            .position(Option::is_none)
            .or_else(|| misfit(&flight, &samples, &ranges, sigma));
        match cut {
            None => return flight.is_convincing(&samples, &ranges, sigma).then_some(flight),
            Some(cut) => ranges = larger_part(ranges, cut + 1),
        }
    }
}

/// The fall γ as the flight itself shows it, over the one given: a check on the camera's distance and the clock. `None`
/// where the flight was not seen from above, or does not tell.
#[must_use]
pub fn fall_seen(flight: &Flight) -> Option<Quantity> {
    let Forces::Overhead(known) = flight.fit.forces else {
        return None;
    };
    let open = Overhead {
        fall_relative_std: OPEN_FALL,
        ..known
    };
    let fit = ArcFit::new(&flight.fit_points(), flight.fit.arcs(), Forces::Overhead(open))?;
    let i = OverheadLayout::new(fit.arcs()).fall();
    let (ratio, std) = (fit.parameters[i].exp(), fit.covariance[(i, i)].max(0.0).sqrt());
    // Hardly better than what was assumed: the flight does not tell.
    (std < 0.5 * OPEN_FALL)
        .then(|| Quantity::new(ratio, ratio * std))
        .flatten()
}

/// Relative standard deviation of a fall that is as good as unknown.
const OPEN_FALL: f64 = 1.0;

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

/// The run of arcs with the most points in which each may meet the next on the floor.
fn met_chain(samples: &[TrackSample], ranges: Vec<Range<usize>>, known: &Overhead) -> Vec<Range<usize>> {
    let mut runs: Vec<Vec<Range<usize>>> = Vec::new();
    for r in ranges {
        match runs.last_mut() {
            Some(run)
                if run
                    .last()
                    .is_some_and(|l| may_meet(&samples[l.clone()], &samples[r.clone()], known)) =>
            {
                run.push(r);
            }
            _ => runs.push(vec![r]),
        }
    }
    let points = |run: &[Range<usize>]| run.iter().map(ExactSizeIterator::len).sum::<usize>();
    runs.into_iter().max_by_key(|run| points(run)).unwrap_or_default()
}

/// The successive arcs, at most [`MOST_ARCS`], that hold the most points.
fn richest(ranges: Vec<Range<usize>>) -> Vec<Range<usize>> {
    let points = |run: &[Range<usize>]| run.iter().map(ExactSizeIterator::len).sum::<usize>();
    match ranges.windows(MOST_ARCS).max_by_key(|run| points(run)) {
        Some(run) => run.to_vec(),
        None => ranges,
    }
}

/// Where the chain breaks: beside the arc whose points lie worst about the common fit, if they lie worse than an arc's
/// do; `None` where all fit.
fn misfit(flight: &Flight, samples: &[TrackSample], ranges: &[Range<usize>], sigma: f64) -> Option<usize> {
    let mut worst: Option<(usize, f64)> = None;
    for (k, r) in ranges.iter().enumerate() {
        let mut offs: Vec<f64> = samples[r.clone()]
            .iter()
            .map(|s| {
                let m = flight.fit.motion(k, s.t);
                (s.r - m.r).hypot(s.h - m.h)
            })
            .collect();
        let off = median(&mut offs);
        if off > MOST_SCATTER * sigma && worst.is_none_or(|w| off > w.1) {
            worst = Some((k, off));
        }
    }
    let last = ranges.len().checked_sub(2)?;
    worst.map(|(k, _)| k.min(last))
}
