//! The ball's spin on each arc, from the launch through every bounce, and the lift that it makes.

use super::floor::turned;
use super::inputs::InputValues;
use super::motion::MeasuredMotion;
use super::spin_lift::SpinLift;
use crate::calibration::View;
use crate::flight::Flight;

impl MeasuredMotion<'_> {
    /// The flight with its points moved back by what the lift of the bounces' spins did to them, and that lift. Where those have
    /// no arcs it stays in the flight.
    #[must_use]
    pub fn without_lift(&self) -> (Flight, SpinLift) {
        let lift = SpinLift::new(self.spins()).told_by(self.flight);
        match lift.taken_from(self.flight) {
            Some(free) => (free, lift),
            None => (self.flight.clone(), SpinLift::default()),
        }
    }

    /// Spin R ω on each arc, plane units/s, positive where it rolls along +r: the launch's, and what each bounce made of it.
    fn spins(&self) -> Vec<Option<f64>> {
        if self.calibration.view == View::Top {
            return Vec::new();
        }
        let p = &self.inputs.best();
        let unit = self.x_sign / self.scale(p);
        let inertia = self.calibration.ball.inertia_factor;
        let seen = |k: usize| Some(self.seen_spin_m_s(k, 0.0) * unit).filter(|s| s.is_finite());
        let mut spin = Some(self.spin_in(p, 0, &[]) * unit).filter(|s| s.is_finite());
        let mut spins = vec![spin];
        let slope = self.slope(p);
        for k in 0..self.arcs().saturating_sub(1) {
            let gained = self.spin_gained(p, slope, k) / inertia * unit;
            spin = spin
                .filter(|_| self.surface(k).is_some())
                .map(|s| s + gained)
                .filter(|s| s.is_finite());
            spin = seen(k + 1).or(spin);
            spins.push(spin);
        }
        spins
    }

    /// R ω_y before the impact at the end of arc `k`, m/s: as the pictures show it on that arc, or on an earlier one or at the launch,
    /// changed at each bounce of the `history` since (spin stays in flight); NaN where none is known, or the launch was not seen.
    pub(super) fn spin_in(&self, p: &InputValues<'_>, k: usize, history: &[usize]) -> f64 {
        if let Some((seen, spin)) = self.last_seen_spin(p, k)
            && (seen == k || history.contains(&seen))
        {
            let since = history.iter().filter(|&&j| j >= seen);
            return spin + self.spin_gained_at(p, since);
        }
        let Some(ratio) = self.calibration.launch.spin_ratio.filter(|_| self.launch_seen) else {
            return f64::NAN;
        };
        // A ball that rolls off its bench has the spin of its speed there, which the air then slows; a number is of the first impact.
        let rolls_until = || self.edge_s(p).unwrap_or(self.flight.spans[0].0);
        let since = if self.calibration.launch.rolling {
            rolls_until()
        } else {
            self.impact_time(p, 0)
        };
        let launch = self.world(p, 0, since).vr;
        if history.is_empty() {
            return ratio * launch;
        }
        ratio * launch + self.spin_gained_at(p, history.iter())
    }

    /// What the impacts at the ends of these arcs add to R ω, m/s.
    fn spin_gained_at<'k>(&self, p: &InputValues<'_>, impacts: impl Iterator<Item = &'k usize>) -> f64 {
        let (slope, inertia) = (self.slope(p), self.calibration.ball.inertia_factor);
        impacts.map(|&j| self.spin_gained(p, slope, j) / inertia).sum()
    }

    /// k times what the impact between arcs k and k + 1 adds to R ω, m/s: what the ball loses along the floor, or gains along a ceiling, where
    /// friction acts on its top.
    pub(super) fn spin_gained(&self, p: &InputValues<'_>, slope: f64, k: usize) -> f64 {
        let (_, before, after) = self.impact(p, k);
        let up = (after.vh - before.vh).signum();
        up * (turned(&before, slope).vr - turned(&after, slope).vr)
    }
}
