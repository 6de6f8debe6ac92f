//! What is known of a flight besides its points, as rows for the fit; see [`super::fit`].

use super::lift;
use super::problem::SpatialProblem;
use crate::flight::planar::{ACROSS, DRAG, GRAVITY};
use nalgebra::DVector;

/// Half of the contact time is 0 ± this, s: tennis balls take 5 ms, steel balls 0.1 ms.
const HALF_CONTACT_STD_S: f64 = 1e-3;

/// The arcs meet in the middle of the contact to about this, s: a tenth of a soft ball's, as it leaves more slowly than
/// it came.
const MIDDLE_STD_S: f64 = 1e-4;

/// Close to the floor the ball's own shadow lies against its outline and pulls its centre by 0 ± this part of its radius in
/// each direction: a shadow a third darker than the floor does so by that.
const SHADOW_PULL_PART: f64 = 0.01;

/// One equation of what is known beside the points: its derivatives by some parameters, and its whitened residual.
pub(super) struct PriorRow {
    pub(super) by: Vec<(usize, f64)>,
    pub(super) residual: f64,
}

impl SpatialProblem<'_> {
    /// How large lifts may be and how well arcs meet, by the speeds that `p` has.
    pub(super) fn update_prior_widths(&mut self, p: &DVector<f64>, lift_drag: f64) {
        self.lifts = lift::expected(&self.view, p.as_slice(), &self.times, lift_drag);
        self.impact_stds = (1..self.arcs()).map(|k| self.impact_std(p, k - 1)).collect();
    }

    /// Everything that is known besides the points.
    pub(super) fn priors(&self, p: &DVector<f64>) -> Vec<PriorRow> {
        let (view, layout) = (&self.view, self.layout);
        let mut rows = Vec::new();
        // That parameter `i` is `expected` ± `std`.
        let mut prior = |i: usize, expected: f64, std: f64| {
            rows.push(PriorRow {
                by: vec![(i, 1.0 / std)],
                residual: (expected - p[i]) / std,
            });
        };
        // There is no gravity in the plane.
        prior(GRAVITY, 0.0, 1.0);
        prior(ACROSS, 0.0, 1.0);
        prior(layout.nadir(), view.nadir.right, view.nadir_std);
        prior(layout.nadir() + 1, view.nadir.up, view.nadir_std);
        prior(layout.fall(), 0.0, view.fall_relative_std);
        prior(DRAG, self.drag.0, self.drag.1);
        prior(layout.shadow_pull(), 0.0, SHADOW_PULL_PART * view.radius());
        prior(layout.shadow_pull() + 1, 0.0, SHADOW_PULL_PART * view.radius());
        prior(layout.half_contact(), 0.0, HALF_CONTACT_STD_S);
        for k in 0..self.arcs() {
            prior(layout.rise(k), view.touching(), 1.0);
            prior(layout.rise(k) + 1, 0.0, view.fastest_per_s());
        }
        for (k, lift) in self.lifts.iter().enumerate() {
            for (i, (mean, std)) in lift.mean.into_iter().zip(lift.std).enumerate() {
                prior(layout.lift(k) + i, mean, std);
            }
        }
        for k in 0..self.arcs() - 1 {
            self.impact(p, k, &mut rows);
        }
        rows
    }

    /// Standard deviations of how well two arcs meet, along the floor and in height: the way of the ball in the time by which
    /// the contact's middle is uncertain, at least that of the slowest fall.
    fn impact_std(&self, p: &DVector<f64>, k: usize) -> (f64, f64) {
        let t = p[self.layout.impact(k)];
        let a = self.motion(p, k, t);
        let b = self.motion(p, k + 1, t);
        let turn = (b.ground.vr - a.ground.vr).hypot(b.ground.vh - a.ground.vh);
        let slow = 0.1 * self.view.fastest_per_s();
        (
            MIDDLE_STD_S * turn.max(slow * self.view.camera_height()),
            MIDDLE_STD_S * a.rate.abs().max(b.rate.abs()).max(slow),
        )
    }

    /// Arcs `k` and `k + 1` are in one place in the middle of the contact, and touch the floor when it begins and ends.
    fn impact(&self, p: &DVector<f64>, k: usize, rows: &mut Vec<PriorRow>) {
        let layout = self.layout;
        let (along, up) = self.impact_stds[k];
        let residual = |p: &DVector<f64>| -> [f64; 4] {
            let (t, half) = (p[layout.impact(k)], p[layout.half_contact()]);
            let (a, b) = (self.motion(p, k, t).ground, self.motion(p, k + 1, t).ground);
            [
                (a.r - b.r) / along,
                (a.h - b.h) / along,
                (self.view.touching() - self.motion(p, k, t - half).zeta) / up,
                (self.view.touching() - self.motion(p, k + 1, t + half).zeta) / up,
            ]
        };
        let here = residual(p);
        let mut new = here.map(|residual| PriorRow {
            by: Vec::new(),
            residual,
        });
        let (g, v, l) = (layout.ground(k), layout.rise(k), layout.lift(k));
        let others = [DRAG, layout.fall(), layout.half_contact(), layout.impact(k)];
        let mut moved = p.clone();
        for i in (g..g + 8).chain(v..v + 4).chain(l..l + 6).chain(others) {
            let step = self.difference_step(i);
            moved[i] += step;
            for ((row, there), here) in new.iter_mut().zip(residual(&moved)).zip(here) {
                row.by.push((i, (here - there) / step));
            }
            moved[i] = p[i];
        }
        rows.extend(new);
    }
}
