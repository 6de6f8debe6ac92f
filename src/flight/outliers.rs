//! The fit of a track's arcs without its outliers, and the extra variance that the centres show beyond their own.
//!
//! Outliers are points further from their arc than [`OUTLIER_SIGMAS`] of a scale that medians give; a point that lies on its
//! arc again comes back. The weights are then those of the mean squares of the points in use.

use super::extra_variance::{ArcDistance, ExtraVariance};
use super::free_flight::SpotUse;
use super::linking::Spot;
use super::motion_model::{ArcFit, FitPoint, MotionModel};
use super::planar::BEND_POWERS;
use std::ops::Range;

/// Points further off than this many (robust) standard deviations are outliers.
pub(super) const OUTLIER_SIGMAS: f64 = 4.5;

/// Fits, leaves out what does not fit, and fits again until nothing changes; with the centres' extra variance.
pub(super) fn fit_without_outliers(
    spots: &[Spot],
    uses: &mut [SpotUse],
    arcs: usize,
    model: &dyn MotionModel,
) -> Option<(ArcFit, ExtraVariance)> {
    let mut extra = ExtraVariance::default();
    for _ in 0..OUTLIER_ROUNDS {
        let now = model.fit(&fit_points(spots, uses, &extra), arcs)?;
        extra = ExtraVariance::robust(&distances(spots, uses, &now, &extra));
        let residuals = arc_residuals(spots, uses, &now, &extra);
        // Of few points one that is off draws its arc along, and the others seem to be: the worst goes first.
        let mut counts = vec![0_usize; arcs];
        let mut worst = vec![0.0_f64; arcs];
        for residual in residuals.iter().flatten().filter(|l| l.used) {
            counts[residual.arc] += 1;
            worst[residual.arc] = worst[residual.arc].max(residual.sigmas);
        }
        let mut changed = false;
        for (use_, residual) in uses.iter_mut().zip(&residuals) {
            let Some(residual) = residual else { continue };
            let spared =
                residual.used && counts[residual.arc] < FEW_POINTS && residual.sigmas < worst[residual.arc];
            let off = residual.sigmas > OUTLIER_SIGMAS && !spared;
            changed |= off == residual.used;
            *use_ = if off {
                SpotUse::Outlier(residual.distance)
            } else {
                SpotUse::Used(residual.arc)
            };
        }
        if !changed {
            break;
        }
    }
    // The last verdicts enter.
    refitted(spots, uses, arcs, model, extra)
}

/// The fit to the points in use, which tell their own scatter.
pub(super) fn refitted(
    spots: &[Spot],
    uses: &[SpotUse],
    arcs: usize,
    model: &dyn MotionModel,
    mut extra: ExtraVariance,
) -> Option<(ArcFit, ExtraVariance)> {
    let mut fit = model.fit(&fit_points(spots, uses, &extra), arcs)?;
    for _ in 0..SCATTER_ROUNDS {
        let told = ExtraVariance::efficient(&distances(spots, uses, &fit, &extra));
        if told.is_close_to(&extra) {
            break;
        }
        extra = told;
        fit = model.fit(&fit_points(spots, uses, &extra), arcs)?;
    }
    Some((fit, extra))
}

/// Times that the points are asked for their scatter, at most.
const SCATTER_ROUNDS: usize = 4;

/// Times that outliers are looked for.
const OUTLIER_ROUNDS: usize = 12;

/// On an arc of fewer points than this, those that are off are left out one by one.
const FEW_POINTS: usize = 12;

/// A spot against its arc.
struct ArcResidual {
    arc: usize,
    used: bool,
    /// Distance to the arc, plane units.
    distance: f64,
    /// The same in standard deviations of what such a distance should be: less for a point that the arc follows, more for
    /// one that it was not fitted to.
    sigmas: f64,
}

/// Every spot that is or may be used, against its arc.
fn arc_residuals(
    spots: &[Spot],
    uses: &[SpotUse],
    fit: &ArcFit,
    extra: &ExtraVariance,
) -> Vec<Option<ArcResidual>> {
    // Σw, Σw t, Σw t² of each arc, times from its mean one.
    let mut sums = vec![[0.0_f64; 3]; fit.arcs()];
    for (spot, k) in used(spots, uses) {
        let (w, t) = (1.0 / extra.variance_of(spot), spot.time_s - fit.times[k]);
        for (sum, power) in sums[k].iter_mut().zip([1.0, t, t * t]) {
            *sum += w * power;
        }
    }
    let residual = |(i, spot): (usize, &Spot)| -> Option<ArcResidual> {
        let (arc, used) = match uses[i] {
            SpotUse::Used(k) => (k, true),
            SpotUse::Outlier(_) => (nearest_arc(uses, i)?, false),
            _ => return None,
        };
        let (m, own) = (fit.motion(arc, spot.time_s), extra.variance_of(spot));
        let distance = (spot.place.right - m.r).hypot(spot.place.up - m.h);
        let [s0, s1, s2] = sums[arc];
        let t = spot.time_s - fit.times[arc];
        // Variance of a straight line's place at t, over the point's own.
        let line = (s2 - 2.0 * t * s1 + t * t * s0) / (s0 * s2 - s1 * s1) / own;
        let line = if line.is_finite() { line } else { 0.0 };
        let share = if used {
            1.0 - line.clamp(0.0, MOST_FOLLOWED)
        } else {
            1.0 + line
        };
        Some(ArcResidual {
            arc,
            used,
            distance,
            sigmas: distance / (2.0 * own * share).sqrt(),
        })
    };
    spots.iter().enumerate().map(residual).collect()
}

/// The spots in use, each with its arc.
fn used<'a>(spots: &'a [Spot], uses: &'a [SpotUse]) -> impl Iterator<Item = (&'a Spot, usize)> {
    let pairs = spots.iter().zip(uses);
    pairs.filter_map(|(spot, use_)| Some((spot, use_.arc()?)))
}

/// Part of a point's error that its arc follows, at most: of three points, 5/6 at the ends.
const MOST_FOLLOWED: f64 = 0.85;

/// The arc that too few points are left on to be fitted, `None` where each has enough.
pub(super) fn emptied_arc(uses: &[SpotUse], arcs: usize) -> Option<usize> {
    let left = |k: usize| uses.iter().filter(|u| **u == SpotUse::Used(k)).count();
    (0..arcs)
        .min_by_key(|&k| left(k))
        .filter(|&k| left(k) < LEAST_FIT_POINTS)
}

/// Fewer points than this have no arc: two coordinates with a place and a velocity each, and a point that checks them.
pub(super) const LEAST_FIT_POINTS: usize = 3;

/// The first arc most of whose points do not lie on it, once it is fitted to the last digit: a few points on the floor, behind
/// an impact that left the ball there, pass for a short rebound as long as only their cut is asked for.
pub(super) fn arc_of_outliers(uses: &[SpotUse], ranges: &[Range<usize>]) -> Option<usize> {
    let off = |range: &Range<usize>| {
        let used = uses[range.clone()].iter().filter_map(|u| u.arc());
        2 * used.count() < range.len()
    };
    ranges.iter().position(off)
}

/// The used points' distances to their arcs. An arc of n points with weights w follows each by about 2 w/Σw (two
/// unknowns a coordinate; five where arcs are bent).
fn distances(spots: &[Spot], uses: &[SpotUse], fit: &ArcFit, extra: &ExtraVariance) -> Vec<ArcDistance> {
    let unknowns = if fit.model.bend().is_some() {
        2 + BEND_POWERS.len()
    } else {
        2
    };
    let mut weights = vec![0.0; fit.arcs()];
    for (s, k) in used(spots, uses) {
        weights[k] += 1.0 / extra.variance_of(s);
    }
    let distance = |(s, k): (&Spot, usize)| {
        let m = fit.motion(k, s.time_s);
        ArcDistance {
            square: (s.place.right - m.r).powi(2) + (s.place.up - m.h).powi(2),
            own: s.std * s.std,
            coded: s.coded,
            leverage: (unknowns as f64 / (extra.variance_of(s) * weights[k])).min(0.9),
        }
    };
    used(spots, uses).map(distance).collect()
}

/// The arc of the nearest used points before and after, where it is the same.
fn nearest_arc(uses: &[SpotUse], i: usize) -> Option<usize> {
    let before = uses[..i].iter().rev().find_map(|u| u.arc());
    let after = uses[i + 1..].iter().find_map(|u| u.arc());
    before.filter(|_| before == after)
}

fn fit_points(spots: &[Spot], uses: &[SpotUse], extra: &ExtraVariance) -> Vec<FitPoint> {
    used(spots, uses)
        .map(|(spot, k)| extra.fit_point(spot, k))
        .collect()
}

/// The uses of `count` spots of which those in `ranges` are on an arc each.
pub(super) fn uses_of(ranges: &[Range<usize>], count: usize) -> Vec<SpotUse> {
    let mut uses = vec![SpotUse::NotFree; count];
    for (k, r) in ranges.iter().enumerate() {
        uses[r.clone()].fill(SpotUse::Used(k));
    }
    uses
}
