//! The flight from its fit: how long each arc lasts, the impacts where arcs meet, and the spots in contact then.

use super::extra_variance::ExtraVariance;
use super::free_flight::{Flight, FlightPoint, SpotUse};
use super::linking::Spot;
use super::motion_model::ArcFit;

/// The flight of a track's `spots` with their `uses`.
pub(super) fn flight_from_fit(
    spots: &[Spot],
    mut uses: Vec<SpotUse>,
    (fit, extra): (ArcFit, ExtraVariance),
    interval_s: f64,
) -> Flight {
    let mut spans = vec![(f64::INFINITY, f64::NEG_INFINITY); fit.arcs()];
    for (spot, u) in spots.iter().zip(&uses) {
        if let SpotUse::Used(k) = u {
            spans[*k] = (spans[*k].0.min(spot.time_s), spans[*k].1.max(spot.time_s));
        }
    }
    let impact_after = |k: usize| {
        let met = fit.model.impact_between(&fit, &spans, k, interval_s);
        met.filter(|t| !goes_elsewhere(&uses, k) && !is_unseen(spots, &uses, &fit, (k, *t)))
    };
    let impacts: Vec<Option<f64>> = (1..fit.arcs()).map(|k| impact_after(k - 1)).collect();
    for (spot, u) in spots.iter().zip(&mut uses) {
        let near = |t: &f64| (spot.time_s - t).abs() < 1.5 * interval_s;
        if matches!(u, SpotUse::Outlier(_) | SpotUse::NotFree) && impacts.iter().flatten().any(near) {
            *u = SpotUse::Contact;
        }
    }
    let points = spots.iter().zip(uses);
    Flight {
        points: points.map(|(&spot, use_)| FlightPoint { spot, use_ }).collect(),
        fit,
        extra,
        spans,
        impacts,
        interval_s,
        launch: None,
    }
}

/// Points between two arcs that are on neither, at most: frames of a contact and what shadow and smear spoil, ...
const MOST_BETWEEN: usize = 4;

/// ... or one to so many points of both arcs.
const ARC_POINTS_FOR_ONE: usize = 4;

/// Frames around an impact without the ball, at most, ...
const MOST_UNSEEN: usize = 4;

/// ... or this part of the flights beside it.
const UNSEEN_PART: f64 = 0.125;

/// Whether the ball was not seen around the impact at `t` between arcs `k` and `k + 1` for so long that another thing may have been there:
/// frames that the recording does not hold do not count.
fn is_unseen(spots: &[Spot], uses: &[SpotUse], fit: &ArcFit, (k, t): (usize, f64)) -> bool {
    let at = |i: Option<usize>| i.map(|i| &spots[i]);
    let last = at(uses.iter().rposition(|u| *u == SpotUse::Used(k)));
    let first = at(uses.iter().position(|u| *u == SpotUse::Used(k + 1)));
    let (Some(last), Some(first)) = (last, first) else {
        return false;
    };
    let seen =
        spots.partition_point(|s| s.frame < first.frame) - spots.partition_point(|s| s.frame <= last.frame);
    let unseen = first.frame.saturating_sub(last.frame + 1).saturating_sub(seen);
    // Up and down again, the longer of both; where nothing falls in the plane only the frames count.
    let fastest = fit.motion(k, t).vh.abs().max(fit.motion(k + 1, t).vh.abs());
    let flight_s = 2.0 * fastest / fit.gravity().abs();
    unseen > MOST_UNSEEN && !(first.time_s - last.time_s < UNSEEN_PART * flight_s)
}

/// Whether the ball was seen between arcs `k` and `k + 1` where neither has it: then they do not meet there.
fn goes_elsewhere(uses: &[SpotUse], k: usize) -> bool {
    let on = |arc: usize| uses.iter().filter(|u| **u == SpotUse::Used(arc)).count();
    let last = uses.iter().rposition(|u| *u == SpotUse::Used(k));
    let first = uses.iter().position(|u| *u == SpotUse::Used(k + 1));
    let (Some(last), Some(first)) = (last, first) else {
        return false;
    };
    let between = first.saturating_sub(last + 1);
    between > MOST_BETWEEN.max((on(k) + on(k + 1)) / ARC_POINTS_FOR_ONE)
}
