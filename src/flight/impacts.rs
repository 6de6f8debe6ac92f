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
        met.filter(|_| !goes_elsewhere(&uses, k))
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
