//! What is known of a flight besides its points, as rows for the fit; see [`super`].

use super::super::flying;
use super::Job;
use crate::flight::fit::{ACROSS, DRAG, GRAVITY};
use nalgebra::DVector;

/// Half of the contact time is 0 ± this, s: tennis balls take 5 ms, steel balls 0.1 ms.
const HALF_CONTACT_STD_S: f64 = 1e-3;

/// The arcs meet in the middle of the contact to about this, s: a tenth of a soft ball's, as it leaves more slowly than
/// it came.
const MIDDLE_STD_S: f64 = 1e-4;

/// Close to the floor the ball's own shadow lies against its outline and pulls its centre by 0 ± this part of its radius in
/// each direction: a shadow a third darker than the floor does so by that.
const SHADE_PART: f64 = 0.01;

/// A row of what is known besides the points: derivatives by some parameters, what is left to explain.
pub(super) struct Row {
    pub(super) by: Vec<(usize, f64)>,
    pub(super) left: f64,
}

impl Row {
    /// That parameter `i`, now `value`, is `expected` ± `std`.
    fn prior(i: usize, value: f64, expected: f64, std: f64) -> Self {
        Self {
            by: vec![(i, 1.0 / std)],
            left: (expected - value) / std,
        }
    }
}

impl Job<'_> {
    /// Everything that is known besides the points.
    pub(super) fn knowledge(&self, p: &DVector<f64>) -> Vec<Row> {
        let (known, layout) = (&self.known, self.layout);
        // There is no gravity in the plane.
        let mut rows: Vec<Row> = [GRAVITY, ACROSS].map(|i| Row::prior(i, p[i], 0.0, 1.0)).into();
        for (i, expected) in [known.foot.right, known.foot.up].into_iter().enumerate() {
            rows.push(Row::prior(
                layout.foot() + i,
                p[layout.foot() + i],
                expected,
                known.foot_std,
            ));
        }
        rows.push(Row::prior(
            layout.fall(),
            p[layout.fall()],
            0.0,
            known.fall_relative_std,
        ));
        rows.push(Row::prior(DRAG, p[DRAG], self.drag.0, self.drag.1));
        for i in layout.shade()..layout.shade() + 2 {
            rows.push(Row::prior(i, p[i], 0.0, SHADE_PART * known.radius()));
        }
        let half = layout.half_contact();
        rows.push(Row::prior(half, p[half], 0.0, HALF_CONTACT_STD_S));
        for k in 0..self.arcs() {
            let rise = layout.rise(k);
            rows.push(Row::prior(rise, p[rise], known.touching(), 1.0));
            rows.push(Row::prior(rise + 1, p[rise + 1], 0.0, known.fastest_per_s()));
        }
        for (k, lift) in self.lifts.iter().enumerate() {
            let first = layout.lift(k);
            rows.extend((0..3).map(|i| Row::prior(first + i, p[first + i], lift.mean[i], lift.std[i])));
        }
        for k in 0..self.arcs() - 1 {
            self.impact(p, k, &mut rows);
        }
        rows
    }

    /// How far the ball gets in the doubt about the contact's middle; at least what the slowest of falls makes.
    pub(super) fn impact_std(&self, p: &DVector<f64>, k: usize) -> (f64, f64) {
        let t = p[self.layout.impact(k)];
        let a = flying(&self.known, p.as_slice(), &self.times, k, t);
        let b = flying(&self.known, p.as_slice(), &self.times, k + 1, t);
        let turn = (b.ground.vr - a.ground.vr).hypot(b.ground.vh - a.ground.vh);
        let slow = 0.1 * self.known.fastest_per_s();
        (
            MIDDLE_STD_S * turn.max(slow * self.known.camera_height()),
            MIDDLE_STD_S * a.rate.abs().max(b.rate.abs()).max(slow),
        )
    }

    /// Arcs `k` and `k + 1` are in one place in the middle of the contact, and touch the floor when it begins and ends.
    fn impact(&self, p: &DVector<f64>, k: usize, rows: &mut Vec<Row>) {
        let layout = self.layout;
        let (along, up) = self.impact_stds[k];
        let left = |p: &DVector<f64>| -> [f64; 4] {
            let (t, half) = (p[layout.impact(k)], p[layout.half_contact()]);
            let at = |k: usize, t: f64| flying(&self.known, p.as_slice(), &self.times, k, t);
            let (a, b) = (at(k, t).ground, at(k + 1, t).ground);
            [
                (a.r - b.r) / along,
                (a.h - b.h) / along,
                (self.known.touching() - at(k, t - half).zeta) / up,
                (self.known.touching() - at(k + 1, t + half).zeta) / up,
            ]
        };
        let here = left(p);
        let mut new = here.map(|left| Row { by: Vec::new(), left });
        let (g, v, l) = (layout.ground(k), layout.rise(k), layout.lift(k));
        let others = [DRAG, layout.fall(), layout.half_contact(), layout.impact(k)];
        let mut moved = p.clone();
        for i in (g..g + 8).chain(v..v + 4).chain(l..l + 6).chain(others) {
            let step = self.step(i);
            moved[i] += step;
            for ((row, there), here) in new.iter_mut().zip(left(&moved)).zip(here) {
                row.by.push((i, (here - there) / step));
            }
            moved[i] = p[i];
        }
        rows.extend(new);
    }
}
