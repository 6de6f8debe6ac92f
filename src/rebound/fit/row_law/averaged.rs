//! A row's likelihood with its true incidence averaged over both sides of the transition.

use super::equations::{MOST, dot, forward};
use super::{Regimes, RowLaw, RowState, Theta, Variant, by_slot, nearest};
use crate::rebound::fit::observation::{Observation, Slots};
use statrs::function::erf::erfc;
use std::f64::consts::{FRAC_1_SQRT_2, TAU};

/// −2 ln of a row's likelihood, in units of χ², with its true incidence averaged over both sides of the transition in place
/// of the better one.
///
/// A jump gives a row near it two ends to be near to, and so always fits better than none: by a little for each row, which
/// grows with their number whatever the truth is. Averaged, the two ends share one row's likelihood. Along each side the
/// average is e^(−χ²/2) times the part of a Gaussian that lies on that side. `spread` is what χ² is to be divided by.
pub(in crate::rebound::fit) fn averaged(
    row: &Observation,
    variant: &Variant,
    theta: &Theta,
    spread: f64,
) -> Option<f64> {
    let (law, here) = RowLaw::new(row, variant, theta);
    let (margin, variance) = law.margin(&here);
    let one_sided = matches!(variant.regimes, Regimes::Grip | Regimes::Slide);
    if one_sided || !(variance > 0.0 && spread > 0.0) {
        return nearest(row, variant, theta, 0.0).map(|n| n.chi2);
    }
    let first = if margin <= 0.0 {
        RowState::Grip
    } else {
        RowState::Slide
    };
    let second = if margin <= 0.0 {
        RowState::Slide
    } else {
        RowState::Grip
    };
    let here = law.log_share(first, spread)?;
    // The other side costs at least what the measured incidence is away from the edge.
    if -0.5 * margin * margin / (variance * spread) < here - NOTHING {
        return Some(-2.0 * spread * here);
    }
    let there = law.log_share(second, spread)?;
    let (least, most) = (here.min(there), here.max(there));
    let sum = most + (least - most).exp().ln_1p();
    sum.is_finite().then_some(-2.0 * spread * sum)
}

/// Difference of logarithms beyond which the lesser adds nothing.
const NOTHING: f64 = 36.0;

/// ln Φ(x).
fn log_normal_cdf(x: f64) -> f64 {
    if x > -10.0 {
        (0.5 * erfc(-x * FRAC_1_SQRT_2)).ln()
    } else {
        // The first terms of its expansion far out, good to 1e-6 there.
        let square = x * x;
        -0.5 * square - (-x * TAU.sqrt()).ln() - 1.0 / square
    }
}

impl RowLaw<'_> {
    /// ln of the share of the row's likelihood that lies on the side of `state`, χ² being in units of `spread`.
    fn log_share(&self, state: RowState, spread: f64) -> Option<f64> {
        self.closest(state, |at| {
            let k = at.kinematics;
            let (sign, limit) = (self.sign_at(state, k), self.limit.value);
            let grip = by_slot(&self.grip(k), k);
            let slope: Slots = std::array::from_fn(|i| sign * grip[i] - limit * k.db[i]);
            // What is left of the margin's variance once the equations hold.
            let mut bound = [0.0; MOST];
            for (entry, spread) in bound.iter_mut().zip(at.spread).take(at.equations.count) {
                *entry = dot(&slope, spread);
            }
            let bound = forward(at.lower, bound, at.equations.count);
            let whole = dot(&slope, &self.row.covariance_times(&slope));
            let left = whole - bound.iter().map(|b| b * b).sum::<f64>();
            let side = if state.slides() { 1.0 } else { -1.0 };
            let inside = side * self.margin_at(state, k);
            let share = if left > 1e-12 * whole {
                log_normal_cdf(inside / (spread * left).sqrt())
            } else if inside >= 0.0 {
                0.0
            } else {
                f64::NEG_INFINITY
            };
            let log = share - 0.5 * at.chi2() / spread;
            (!log.is_nan()).then_some(log)
        })
    }
}
