//! What arcs show of a shutter that exposes one row after the other: each point is later (or earlier) than its frame by the same
//! time ρ times its place among the rows.
//!
//! One number more in the fit: moving the times of all points by ρ sᵢ moves the points along their own velocities, and what of
//! that the arcs (with gravity, "up" and drag as freely as the flight's model has them) do not follow is left in the residuals.
//! With h the height, that is h h', cubic in time on a parabola: it has the sign of the velocity. A plane seen at a slant bends
//! paths by h² and r h, which have not; a spin bends each arc by a lift square to its velocity, which has. These directions are taken
//! out as well, so that neither passes for a readout.

use super::free_flight::Flight;
use super::linking::Spot;
use super::motion_model::{FitPoint, autocorrelation_inflation};
use super::refit::whitened;
use super::samples::middle_and_extent;
use crate::quantity::Quantity;
use nalgebra::{DMatrix, DVector};

/// Distances of a path from a slanted plane's along r and h.
type Shift = fn(f64, f64) -> (f64, f64);

/// What a plane seen at a slant does to a place, from the middle of the path: the scale grows along h, along r.
const SLANTS: [Shift; 2] = [|r, h| (r * h, h * h), |r, h| (r * r, r * h)];

/// A change of scale over the path that is known to be less than this part is none.
const LEAST_SLANT: f64 = 1e-6;

/// Turn rate, 1/s, with which its response is worked out: small enough for the arcs to be linear in.
const PROBE: f64 = 1e-4;

/// The time ρ, s, by which points are later for each unit of `share`, with its standard uncertainty; `None` where the flight's
/// points do not determine it. The scale may change over the path by a part known to be 0 ± `slant_std`, and the points may be off by `shifts` as well, each
/// times a number known to be 0 ± 1. Nothing is known of a `slant_std` that is infinite.
#[must_use]
pub fn estimate(
    flight: &Flight,
    share: impl Fn(&Spot) -> f64,
    slant_std: f64,
    shifts: Vec<Vec<(f64, f64)>>,
) -> Option<Quantity> {
    let points = flight.fit_points();
    let shares: Vec<f64> = flight.used_points().map(|p| share(&p.spot)).collect();
    let middle = |of: fn(&FitPoint) -> f64| points.iter().map(of).sum::<f64>() / points.len() as f64;
    let (r0, h0) = (middle(|p| p.sample.r), middle(|p| p.sample.h));
    let along = points.iter().zip(&shares).map(|(p, s)| along_path(flight, p, *s));
    let mut directions: Vec<Vec<(f64, f64)>> = vec![along.collect()];
    directions.extend((0..flight.fit.arcs()).map(|k| points.iter().map(|p| lift(flight, p, k)).collect()));
    let extent = |of: fn(&FitPoint) -> f64| middle_and_extent(points.iter().map(of)).1;
    let path = extent(|p| p.sample.r).max(extent(|p| p.sample.h));
    let part = if slant_std.is_finite() { slant_std } else { 1.0 };
    let slants = SLANTS.map(|slant| -> Vec<(f64, f64)> {
        let shift = |p: &FitPoint| {
            let (r, h) = slant(p.sample.r - r0, p.sample.h - h0);
            (part * r / path, part * h / path)
        };
        points.iter().map(shift).collect()
    });
    let slants = slants.into_iter().filter(|_| part > LEAST_SLANT);
    let (open, known): (Vec<_>, Vec<_>) = slants.partition(|_| !slant_std.is_finite());
    directions.extend(open);
    let free = directions.len();
    directions.extend(known);
    directions.extend(shifts);
    let residuals = flight.whitened_residuals(&points);
    let columns: Vec<DVector<f64>> = directions
        .iter()
        .map(|d| whitened(&points, d.iter().copied()))
        .collect();
    let left_over: Option<Vec<DVector<f64>>> =
        directions.iter().map(|d| flight.left_over(&points, d)).collect();
    let (columns, left_over) = (
        DMatrix::from_columns(&columns),
        DMatrix::from_columns(&left_over?),
    );
    // What is known of "up" and drag has rows of its own in the arcs' fit. What is left over is square to all that the arcs
    // follow, those rows included, so that products with the directions themselves have their share.
    let lengths = DVector::from_iterator(
        columns.ncols(),
        (0..columns.ncols()).map(|i| columns.column(i).dot(&left_over.column(i)).max(0.0).sqrt()),
    );
    let mut normal = columns.transpose() * &left_over;
    for known in free..normal.nrows() {
        normal[(known, known)] += 1.0;
    }
    let normal = normal.component_div(&(&lengths * lengths.transpose()));
    let inverse = (0.5 * (&normal + normal.transpose())).cholesky()?.inverse();
    let inverse = inverse.component_div(&(&lengths * lengths.transpose()));
    let best = &inverse * (columns.transpose() * &residuals);
    let left = residuals - &left_over * &best;
    let freedom = left
        .len()
        .checked_sub(4 * flight.fit.arcs() + 2 + best.len())
        .filter(|f| *f > 0)?;
    let reduced = left.norm_squared() / freedom as f64;
    let variance = inverse[(0, 0)] * reduced * autocorrelation_inflation(&points, &left);
    Quantity::new(best[0], variance.sqrt())
}

/// How far each of the flight's points is behind its place, plane units, where it is later by `delay_s`.
#[must_use]
pub fn shifts(flight: &Flight, delay_s: impl Fn(&Spot) -> f64) -> Vec<(f64, f64)> {
    let points = flight.fit_points();
    let delays_s = flight.used_points().map(|used| delay_s(&used.spot));
    let behind = points.iter().zip(delays_s).map(|(p, delay_s)| {
        let (r, h) = along_path(flight, p, delay_s);
        (-r, -h)
    });
    behind.collect()
}

/// How far a point is further on its path, plane units, a second of readout.
fn along_path(flight: &Flight, p: &FitPoint, share: f64) -> (f64, f64) {
    let m = flight.fit.motion(p.arc, p.sample.t);
    (share * m.vr, share * m.vh)
}

/// How far a lift of the turn rate 1/s takes a point of arc `k` from its path: the acceleration is the velocity turned by a right
/// angle.
fn lift(flight: &Flight, p: &FitPoint, k: usize) -> (f64, f64) {
    if p.arc != k {
        return (0.0, 0.0);
    }
    let planar = flight.fit.planar(flight.fit.parameters.as_slice());
    let pushed = planar.pushed_by(k, p.sample.t, |vr, vh| (-PROBE * vh, PROBE * vr));
    (pushed.r / PROBE, pushed.h / PROBE)
}
