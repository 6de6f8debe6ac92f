//! Spin that the pictures show, arc by arc, and what tells rivals apart.
//!
//! Where several rates suit an arc's pictures, those count that a ball from a bench or a hand can have: R ω up to [`MOST_SPEEDS`](super::spin_candidates::MOST_SPEEDS) times the
//! fastest speed at which it is seen (one that rolls has 1). Of what is left the bounce between the arc and its neighbour decides: the tangential impulse changes the spin by
//!
//! ```text
//! R ω' − R ω = (v_t − v_t') / k        k the inertia factor, from 0.2 (a heavy core) to 2/3 (a thin shell)
//! ```
//!
//! Assumed: no ball is outside of these ranges; a reason beside the rate says that they decided. A pair of rates that it allows may be the wrong one still where two are: then neither is chosen.

use super::inputs::InputValues;
use super::motion::MeasuredMotion;
use super::spin_candidates::{ChosenSpin, SpinCandidates};
use crate::quantity::Quantity;

/// Inertia factors that balls have.
const INERTIA_FACTORS: std::ops::RangeInclusive<f64> = 0.2..=0.67;

/// A pair of spins is against a bounce by more than this many standard uncertainties.
const AGAINST_SIGMAS: f64 = 4.0;

/// A difference of spins tells an inertia factor where it stands out by this many standard uncertainties.
pub(super) const SPIN_CHANGE_SIGMAS: f64 = 5.0;

/// The surface spin that the pictures of one arc show, m/s, positive where the ball rolls to the right in the calibrated plane.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SeenSpin {
    /// First and last time of the pictures, s.
    pub span_s: (f64, f64),
    /// The spins that suit them, the most likely first; one where it is sure.
    pub candidates_m_s: Vec<Quantity>,
}

/// Where the spin before an impact comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SpinSource {
    /// The ball's marks in the pictures.
    Measured,
    /// The calibration's spin at the launch.
    Launch,
    /// The spin before an earlier bounce, and what that made of it.
    PreviousBounce,
}

impl MeasuredMotion<'_> {
    /// The same with the spins that pictures show.
    #[must_use]
    pub fn with_seen_spins(mut self, seen: &[SeenSpin]) -> Self {
        let middle = |k: usize| 0.5 * (self.flight.spans[k].0 + self.flight.spans[k].1);
        let fastest_m_s = self.fastest_m_s();
        let of = |k: usize| {
            let here = seen
                .iter()
                .find(|s| (s.span_s.0..=s.span_s.1).contains(&middle(k)));
            let to_world = |q: &Quantity| q.scaled(self.x_sign);
            SpinCandidates::new(
                here.map_or(Vec::new(), |s| s.candidates_m_s.iter().map(to_world).collect()),
                fastest_m_s,
            )
        };
        self.seen_spins = (0..self.arcs()).map(of).collect();
        // Once forwards and once back: what one bounce decided may decide the next.
        let impacts = self.arcs().saturating_sub(1);
        for k in (0..impacts).chain((0..impacts).rev()) {
            self.tell_apart(k);
        }
        self
    }

    /// Leaves of the spins around the impact between arcs `k` and `k + 1` those that it allows.
    fn tell_apart(&mut self, k: usize) {
        let (before, after) = (&self.seen_spins[k], &self.seen_spins[k + 1]);
        let is_open = before.possible().len() > 1 || after.possible().len() > 1;
        if !is_open
            || before.possible().is_empty()
            || after.possible().is_empty()
            || self.surface(k).is_none()
        {
            return;
        }
        let lost = self.inputs.quantity(|p| self.spin_gained(p, self.slope(p), k));
        let Some(lost) = lost else { return };
        let mut left = (Vec::new(), Vec::new());
        for (i, before) in before.possible_m_s() {
            for (j, after) in after.possible_m_s() {
                if may_follow(before, after, lost) {
                    left.0.push(i);
                    left.1.push(j);
                }
            }
        }
        if left.0.is_empty() {
            return;
        }
        left.0.dedup();
        left.1.sort_unstable();
        left.1.dedup();
        self.seen_spins[k].leave(left.0);
        self.seen_spins[k + 1].leave(left.1);
    }

    /// Speed of the centre at the ends of the arcs, at most, m/s.
    fn fastest_m_s(&self) -> f64 {
        let p = self.inputs.best();
        let ends = self
            .flight
            .spans
            .iter()
            .enumerate()
            .flat_map(|(k, s)| [(k, s.0), (k, s.1)]);
        let speed = |(k, t): (usize, f64)| {
            let m = self.world(&p, k, t);
            m.vr.hypot(m.vh)
        };
        ends.map(speed).fold(0.0, f64::max)
    }

    /// Which of the spins that suit the pictures of arc `k` it is; `None` where that is open, or nothing was seen.
    #[must_use]
    pub fn seen_spin(&self, k: usize) -> Option<ChosenSpin> {
        let arc = self.seen_spins.get(k)?;
        Some(ChosenSpin {
            index: arc.chosen()?,
            told_by: arc.told_by(),
        })
    }

    /// R ω_y on arc `k` as the pictures show it, m/s, `error` standard uncertainties off; NaN where they do not.
    pub(super) fn seen_spin_m_s(&self, k: usize, error: f64) -> f64 {
        let seen = || {
            let arc = self.seen_spins.get(k)?;
            let q = arc.chosen_m_s()?;
            Some(q.value + error * q.std_uncertainty.unwrap_or(0.0))
        };
        seen().unwrap_or(f64::NAN)
    }

    /// The last arc up to `k` whose spin was seen, with that spin before the impact after it.
    pub(super) fn last_seen_spin(&self, p: &InputValues<'_>, k: usize) -> Option<(usize, f64)> {
        let seen = |j: usize| Some((j, self.seen_spin_m_s(j, p.errors.spin_in)));
        (0..=k).rev().filter_map(seen).find(|(_, spin)| spin.is_finite())
    }
}

/// Whether a ball whose bounce took `lost` from its speed along the floor, m/s, may have turned by `before` and `after`.
fn may_follow(before: Quantity, after: Quantity, lost: Quantity) -> bool {
    let gained = after.value - before.value;
    let (one, two) = (
        lost.value / INERTIA_FACTORS.start(),
        lost.value / INERTIA_FACTORS.end(),
    );
    let std = |q: Quantity| q.std_uncertainty.unwrap_or(0.0);
    let known = (std(lost) / INERTIA_FACTORS.start())
        .hypot(std(before))
        .hypot(std(after));
    let margin = AGAINST_SIGMAS * known;
    gained > one.min(two) - margin && gained < one.max(two) + margin
}

#[cfg(test)]
mod tests {
    use super::*;

    fn q(value: f64, std: f64) -> Quantity {
        Quantity::new(value, std).unwrap()
    }

    #[test]
    fn a_bounce_allows_the_spins_of_balls_alone() {
        let lost = q(0.2, 0.002);
        for (after, allowed) in [
            (0.5, true),
            (0.3, true),
            (1.0, true),
            (0.25, false),
            (1.1, false),
            (-0.5, false),
        ] {
            assert_eq!(
                may_follow(q(0.0, 0.001), q(after, 0.001), lost),
                allowed,
                "{after}"
            );
        }
        // A bounce without friction leaves the spin.
        assert!(may_follow(q(0.4, 0.001), q(0.401, 0.001), q(0.0, 0.001)));
        assert!(!may_follow(q(0.4, 0.001), q(0.6, 0.001), q(0.0, 0.001)));
    }
}
