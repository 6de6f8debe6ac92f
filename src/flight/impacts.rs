//! The flight from its fit: how long each arc lasts, the impacts where arcs meet, and the spots in contact then.

use super::extra_variance::ExtraVariance;
use super::fit::{ArcFit, Forces};
use super::linking::{Spot, Track};
use super::{Flight, FlightPoint, SpotUse, impact_test, overhead};

pub(super) fn flight_from_fit(
    spots: &[Spot],
    track: &Track,
    mut uses: Vec<SpotUse>,
    (fit, extra): (ArcFit, ExtraVariance),
    interval_s: f64,
) -> Flight {
    let mut spans = vec![(f64::INFINITY, f64::NEG_INFINITY); fit.arcs()];
    for (&i, u) in track.iter().zip(&uses) {
        if let SpotUse::Used(k) = u {
            spans[*k].0 = spans[*k].0.min(spots[i].time_s);
            spans[*k].1 = spans[*k].1.max(spots[i].time_s);
        }
    }
    let impacts: Vec<Option<f64>> = (1..fit.arcs())
        .map(|k| impact_after(&fit, &spans, k - 1, interval_s).filter(|_| !goes_elsewhere(&uses, k - 1)))
        .collect();
    for (&i, u) in track.iter().zip(&mut uses) {
        let near = |t: &f64| (spots[i].time_s - t).abs() < 1.5 * interval_s;
        if matches!(u, SpotUse::Outlier(_) | SpotUse::NotFree) && impacts.iter().flatten().any(near) {
            *u = SpotUse::Contact;
        }
    }
    let points = track
        .iter()
        .zip(uses)
        .map(|(&i, use_)| FlightPoint { spot: spots[i], use_ })
        .collect();
    Flight {
        points,
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

/// The impact in which arcs `k` and `k + 1` meet, as its forces have it.
fn impact_after(fit: &ArcFit, spans: &[(f64, f64)], k: usize, interval_s: f64) -> Option<f64> {
    match &fit.forces {
        Forces::Overhead(known) => overhead::impact_test::impact_between(fit, known, spans, k, interval_s),
        _ => impact_test::impact_between(fit, spans, k, k + 1, interval_s),
    }
}
