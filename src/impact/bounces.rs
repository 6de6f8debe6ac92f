//! The impacts on floors and ceilings, as bounces.

use super::motion::MeasuredMotion;
use super::top_view;
use super::{Bounce, BounceSurface};
use crate::calibration::View;

/// A restitution above 1 by this many standard uncertainties is no restitution.
const GAIN_SIGMAS: f64 = 3.0;

/// Whether the ball left the floor faster than it came, by more than its uncertainty.
fn gains(bounce: &Bounce) -> bool {
    bounce.restitution.is_some_and(|e| {
        let std = e.std_uncertainty.unwrap_or(f64::INFINITY);
        e.value - 1.0 > GAIN_SIGMAS * std
    })
}

impl MeasuredMotion<'_> {
    /// The impacts on floor or ceiling as bounces, in time order, with the index of the arc before each.
    #[must_use]
    pub fn bounces(&self) -> Vec<(usize, Bounce)> {
        let (before, surfaces): (Vec<usize>, Vec<BounceSurface>) = self.surfaces().unzip();
        let mut bounces = Vec::new();
        let mut unbroken = true;
        for (i, (&k, &surface)) in before.iter().zip(&surfaces).enumerate() {
            // Spin is known along an unbroken row of bounces from the first.
            unbroken &= k == i;
            let history = unbroken.then(|| &before[..i]);
            let bounce = match self.calibration.view {
                View::Side => self.side_bounce((k, surface), history),
                View::Top if self.bend().is_some() => top_view::without_uncertainties(&self.top_bounce(k)),
                View::Top => self.top_bounce(k),
            };
            if gains(&bounce) {
                unbroken = false;
                continue;
            }
            // What is impossible has no spin to go on with.
            unbroken &= bounce.impossible.is_none();
            bounces.push((k, bounce));
        }
        bounces
    }

    /// How many impacts on floor or ceiling are not among the [`bounces`](Self::bounces): the ball would have left faster than it came,
    /// so something else (a shadow, a hand) was followed on one side of them.
    #[must_use]
    pub fn impossible(&self, bounces: &[(usize, Bounce)]) -> usize {
        self.surfaces().count() - bounces.len()
    }
}
