//! Spin that the pictures show, arc by arc, and what tells rivals apart.
//!
//! Where several rates suit an arc's pictures, those count that a ball from a bench or a hand can have: R ω up to [`MOST_SPEEDS`] times the
//! fastest speed at which it is seen (one that rolls has 1); faster ones come as a number alone. Of what is left the bounce between the arc and its neighbour decides: the tangential impulse changes the spin by
//!
//! ```text
//! R ω' − R ω = (v_t − v_t') / k        k the inertia factor, from 0.2 (a heavy core) to 2/3 (a thin shell)
//! ```
//!
//! but for a normal force that acts beside the centre (`NORMAL_FORCE_OFFSET`). About the normal it changes by what friction in the area of contact
//! drills (`MOST_DRILLED`).
//!
//! A bounce that allows no pair of rates says that the pictures of the one arc or the other show a wrong one: neither is stated. One that allows a
//! single pair chooses it, where it would hardly have allowed as many pairs as there are if all of them were wrong (`MOST_BY_CHANCE`).
//!
//! Assumed: no ball is outside of these ranges; a reason beside the rate says that they decided.

use super::floor::turned;
use super::inputs::InputValues;
use super::motion::MeasuredMotion;
use super::spin_candidates::{ChosenSpin, FastestSpin, MOST_SPEEDS, SpinCandidates, SpinUntold, SurfaceSpin};
use crate::quantity::Quantity;

/// Inertia factors that balls have.
const INERTIA_FACTORS: std::ops::RangeInclusive<f64> = 0.2..=0.67;

/// The normal force acts beside the centre (Cross, Am. J. Phys. 70, 1093, 2002); thought to be by this part of the radius at most.
const NORMAL_FORCE_OFFSET: f64 = 0.05;

/// R |Δω| about the normal is at most this part of what the bounce changes in the speed along it: 2 μ a / (3 k R) for an area of contact of radius a, here
/// R / 2, with friction 0.6 and k = 0.4.
const MOST_DRILLED: f64 = 0.5;

/// Wrong pairs of rates that a bounce allows by chance, on average, where it may choose a pair. The right rate is missing among three in a hundred arcs'
/// (docs/accuracy.md): so one choice in a hundred is wrong.
const MOST_BY_CHANCE: f64 = 0.3;

/// A pair of spins is against a bounce by more than this many standard uncertainties.
const AGAINST_SIGMAS: f64 = 4.0;

/// A difference of spins tells an inertia factor where it stands out by this many standard uncertainties.
pub(super) const SPIN_CHANGE_SIGMAS: f64 = 5.0;

/// The surface spin that the pictures of one arc show, m/s, positive where the ball rolls to the right in the calibrated plane.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SeenSpin {
    /// First and last time of the pictures, s.
    pub span_s: (f64, f64),
    /// The spins that suit them and that the ball may have, the most likely first; one where it is sure.
    pub candidates: Vec<SurfaceSpin>,
    /// How many others suit them that are too fast for a ball of this speed ([`MOST_SPEEDS`]).
    pub too_fast: usize,
    /// The fastest that its frames show, m/s.
    pub fastest_m_s: f64,
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
            let to_world = |spin: &SurfaceSpin| SurfaceSpin {
                y_m_s: spin.y_m_s.scaled(self.x_sign),
                ..*spin
            };
            SpinCandidates::new(
                here.map_or(Vec::new(), |s| s.candidates.iter().map(to_world).collect()),
                here.map_or(0, |s| s.too_fast),
                FastestSpin {
                    y_m_s: here.map_or(0.0, |s| s.fastest_m_s.min(MOST_SPEEDS * fastest_m_s)),
                    z_m_s: here.map_or(0.0, |s| s.fastest_m_s),
                },
            )
        };
        self.seen_spins = (0..self.arcs()).map(of).collect();
        // Once forwards and once back: what one bounce decided may decide the next.
        let impacts = self.arcs().saturating_sub(1);
        let changes: Vec<Option<SpinChange>> = (0..impacts).map(|k| self.spin_change(k)).collect();
        for k in (0..impacts).chain((0..impacts).rev()) {
            let (before, after) = self.seen_spins.split_at_mut(k + 1);
            let (before, after) = (&mut before[k], &mut after[0]);
            if let Some(change) = changes[k].filter(|_| before.is_seen() && after.is_seen()) {
                change.tell_apart(before, after);
            }
        }
        self
    }

    /// What the impact between arcs `k` and `k + 1` may have made of the ball's spin; `None` where it is not seen on both, or nothing is known of it.
    fn spin_change(&self, k: usize) -> Option<SpinChange> {
        let is_seen = self.seen_spins[k].is_seen() && self.seen_spins[k + 1].is_seen();
        self.surface(k).filter(|_| is_seen)?;
        let found = self.inputs.outputs(|p| {
            let (slope, (_, before, after)) = (self.slope(p), self.impact(p, k));
            let pushed = turned(&after, slope).vh - turned(&before, slope).vh;
            vec![self.spin_gained(p, slope, k), pushed.abs()]
        });
        Some(SpinChange {
            lost_m_s: found.quantity(0)?,
            pushed_m_s: found.quantity(1)?,
        })
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

    /// Which of the spins that suit the pictures of arc `k` it is.
    ///
    /// # Errors
    /// Why it is none of them.
    pub fn seen_spin(&self, k: usize) -> Result<ChosenSpin, SpinUntold> {
        let arc = self.seen_spins.get(k).ok_or(SpinUntold::Unseen)?;
        arc.chosen()
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

/// What a bounce may make of a ball's spin.
#[derive(Debug, Clone, Copy)]
struct SpinChange {
    /// What it took from the ball's speed along the floor, m/s.
    lost_m_s: Quantity,
    /// What it changed in the speed along the normal, m/s.
    pushed_m_s: Quantity,
}

impl SpinChange {
    /// Leaves of the spins before and after it, some of each, those that it allows.
    fn tell_apart(&self, before: &mut SpinCandidates, after: &mut SpinCandidates) {
        let fastest = after.fastest();
        let mut by_chance = 0.0;
        let mut left = (Vec::new(), Vec::new());
        for (i, one) in before.possible_spins() {
            for (j, other) in after.possible_spins() {
                by_chance += self.allows_by_chance(one, other, fastest);
                if self.allows(one, other) {
                    left.0.push(i);
                    left.1.push(j);
                }
            }
        }
        if left.0.is_empty() {
            before.contradict();
            after.contradict();
        } else if by_chance <= MOST_BY_CHANCE {
            left.0.dedup();
            left.1.sort_unstable();
            left.1.dedup();
            before.leave(left.0);
            after.leave(left.1);
        }
    }

    /// The least and the most that R ω_y may grow by, m/s.
    fn about_y(&self, before: SurfaceSpin, after: SurfaceSpin) -> (f64, f64) {
        let offset = NORMAL_FORCE_OFFSET * self.pushed_m_s.value;
        let (lost, gained) = (self.lost_m_s.value - offset, self.lost_m_s.value + offset);
        let (light, heavy) = (INERTIA_FACTORS.start(), INERTIA_FACTORS.end());
        let known = (std(self.lost_m_s) / light)
            .hypot(std(before.y_m_s))
            .hypot(std(after.y_m_s));
        let margin = AGAINST_SIGMAS * known;
        (
            (lost / light).min(lost / heavy) - margin,
            (gained / light).max(gained / heavy) + margin,
        )
    }

    /// By how much R ω_z may change at most, m/s.
    fn about_z(&self, before: SurfaceSpin, after: SurfaceSpin) -> f64 {
        let known = std(self.pushed_m_s)
            .hypot(std(before.z_m_s))
            .hypot(std(after.z_m_s));
        AGAINST_SIGMAS * known + MOST_DRILLED * self.pushed_m_s.value
    }

    /// Whether a ball may have turned by `before` and `after`.
    fn allows(&self, before: SurfaceSpin, after: SurfaceSpin) -> bool {
        let (least, most) = self.about_y(before, after);
        let (about_y, about_z) = (
            after.y_m_s.value - before.y_m_s.value,
            after.z_m_s.value - before.z_m_s.value,
        );
        (least..=most).contains(&about_y) && about_z.abs() <= self.about_z(before, after)
    }

    /// The part of all spins up to the `fastest`, as sure as `after`, that it allows after `before`.
    fn allows_by_chance(&self, before: SurfaceSpin, after: SurfaceSpin, fastest: FastestSpin) -> f64 {
        let (least, most) = self.about_y(before, after);
        let part = |allowed: f64, fastest: f64| (allowed / (2.0 * fastest)).min(1.0);
        part(most - least, fastest.y_m_s) * part(2.0 * self.about_z(before, after), fastest.z_m_s)
    }
}

fn std(q: Quantity) -> f64 {
    q.std_uncertainty.unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spin(y_m_s: f64, z_m_s: f64, std_m_s: f64) -> SurfaceSpin {
        let q = |value| Quantity::new(value, std_m_s).unwrap();
        SurfaceSpin {
            y_m_s: q(y_m_s),
            z_m_s: q(z_m_s),
        }
    }

    fn change(lost_m_s: f64, pushed_m_s: f64) -> SpinChange {
        let q = |value| Quantity::new(value, 0.002).unwrap();
        SpinChange {
            lost_m_s: q(lost_m_s),
            pushed_m_s: q(pushed_m_s),
        }
    }

    #[test]
    fn a_bounce_allows_the_spins_of_balls_alone() {
        // A solid ball, a thin shell, a heavy core; the normal force within 0.02 m/s of the centre.
        for (after, allowed) in [
            (0.5, true),
            (0.3, true),
            (1.0, true),
            (0.22, false),
            (1.2, false),
            (-0.5, false),
        ] {
            let [before, after] = [0.0, after].map(|y| spin(y, 0.1, 0.001));
            assert_eq!(change(0.2, 0.2).allows(before, after), allowed, "{after:?}");
        }
        // A bounce without friction leaves the spin.
        let before = spin(0.4, 0.1, 0.001);
        assert!(change(0.0, 0.2).allows(before, spin(0.401, 0.1, 0.001)));
        assert!(!change(0.0, 0.2).allows(before, spin(0.6, 0.1, 0.001)));
        // What drills cannot turn a ball about the normal by more than it pushes it.
        assert!(change(0.0, 0.2).allows(before, spin(0.4, 0.18, 0.001)));
        assert!(!change(0.0, 0.2).allows(before, spin(0.4, 0.25, 0.001)));
    }

    const FASTEST: FastestSpin = FastestSpin {
        y_m_s: 5.0,
        z_m_s: 10.0,
    };

    /// Spins about y and their standard uncertainties, of a ball that may have 5 m/s.
    fn candidates(spins: &[(f64, f64)]) -> SpinCandidates {
        let spins = spins.iter().map(|&(y, std)| spin(y, 0.0, std));
        SpinCandidates::new(spins.collect(), 0, FASTEST)
    }

    /// What a bounce makes of those that the pictures before and after it show.
    fn told(before: &[(f64, f64)], after: &[(f64, f64)]) -> [Result<usize, SpinUntold>; 2] {
        let (mut before, mut after) = (candidates(before), candidates(after));
        change(0.1, 1.0).tell_apart(&mut before, &mut after);
        [before, after].map(|c| c.chosen().map(|c| c.index))
    }

    #[test]
    fn a_bounce_tells_spins_apart_where_chance_hardly_would() {
        let sure = 0.001;
        assert_eq!(told(&[(0.0, sure)], &[(4.0, sure), (0.3, sure)]), [Ok(0), Ok(1)]);
        let any = 3.0;
        let several = Err(SpinUntold::Several);
        assert_eq!(
            told(&[(-4.9, sure), (0.0, any)], &[(4.9, sure)]),
            [several, Ok(0)]
        );
    }

    #[test]
    fn spins_that_no_bounce_allows_beside_each_other_are_neither() {
        let contradicted = Err(SpinUntold::Contradicted);
        let sure = 0.001;
        assert_eq!(told(&[(0.0, sure)], &[(4.0, sure)]), [contradicted; 2]);
        assert_eq!(
            told(&[(0.0, sure)], &[(4.0, sure), (-3.0, sure)]),
            [contradicted; 2]
        );
        // Several that are all too fast are no evidence against another: nothing asks a bounce about them.
        let too_fast = SpinCandidates::new(Vec::new(), 2, FASTEST);
        assert!(!too_fast.is_seen());
        assert_eq!(too_fast.chosen(), Err(SpinUntold::Several));
    }

    #[test]
    fn a_spin_that_may_be_any_is_allowed_by_chance() {
        let sure =
            |std| change(0.1, 1.0).allows_by_chance(spin(0.0, 0.0, 0.001), spin(0.0, 0.0, std), FASTEST);
        assert!(sure(0.001) < 0.03, "{}", sure(0.001));
        assert!((sure(10.0) - 1.0).abs() < 1e-12);
    }
}
