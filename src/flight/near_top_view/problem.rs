//! The points of a flight seen from above as a least-squares problem: what the picture shows of them under any parameters.

use super::camera::{NearTopView, SpatialMotion};
use super::kinematics::{SpatialLayout, seen, spatial_motion};
use super::lift::LiftPrior;
use crate::flight::motion_model::{FitPoint, mean_times};
use crate::flight::planar::{DRAG, Motion};
use nalgebra::{DMatrix, DVector};

/// Parameters that one arc's points depend on: r, vr, h, vh, ζ, ω, lift's three; drag, the nadir's two, the fall's, the
/// shadow's two.
pub(super) const LOCAL: usize = 15;

/// Arcs with their points, and what is known of them.
pub(super) struct SpatialProblem<'a> {
    pub(super) view: NearTopView,
    /// β and its standard deviation.
    pub(super) drag: (f64, f64),
    pub(super) layout: SpatialLayout,
    pub(super) times: Vec<f64>,
    pub(super) parts: Vec<&'a [FitPoint]>,
    /// Factor on the whitened rows of each arc's points.
    pub(super) weights: Vec<f64>,
    /// How well the arcs before and after each impact meet: along the floor (plane units) and in height (ζ).
    pub(super) impact_stds: Vec<(f64, f64)>,
    /// What is known of each arc's lift.
    pub(super) lifts: Vec<LiftPrior>,
}

impl<'a> SpatialProblem<'a> {
    /// `None` where an arc has too few points.
    pub(super) fn new(
        points: &'a [FitPoint],
        arcs: usize,
        view: &NearTopView,
        drag: (f64, f64),
    ) -> Option<Self> {
        let times = mean_times(points, arcs)?;
        let parts: Vec<&[FitPoint]> = points.chunk_by(|a, b| a.arc == b.arc).collect();
        let in_order = parts.len() == arcs && parts.iter().enumerate().all(|(k, p)| p[0].arc == k);
        in_order.then(|| Self {
            view: *view,
            drag,
            layout: SpatialLayout::new(arcs),
            times,
            parts,
            weights: vec![1.0; arcs],
            impact_stds: Vec::new(),
            lifts: Vec::new(),
        })
    }

    pub(super) fn arcs(&self) -> usize {
        self.times.len()
    }

    /// Motion on arc `k` at time `t`.
    pub(super) fn motion(&self, p: &DVector<f64>, k: usize, t: f64) -> SpatialMotion {
        spatial_motion(&self.view, p.as_slice(), &self.times, k, t)
    }

    /// The same, and as the picture shows it.
    fn seen(&self, p: &DVector<f64>, k: usize, t: f64) -> (SpatialMotion, Motion) {
        let motion = self.motion(p, k, t);
        (motion, seen(&self.view, p.as_slice(), &self.times, &motion))
    }

    /// Whitened residuals of all points, two each.
    pub(super) fn point_residuals(&self, p: &DVector<f64>) -> DVector<f64> {
        let all = self.parts.iter().flat_map(|part| part.iter()).flat_map(|point| {
            let s = &point.sample;
            let ((m, seen), w) = (self.seen(p, point.arc, s.t), s.weight.sqrt());
            // Beyond the camera there is no picture.
            let w = if m.zeta < 1.0 { w } else { f64::INFINITY };
            [w * (s.r - seen.r), w * (s.h - seen.h)]
        });
        DVector::from_iterator(2 * self.parts.iter().map(|part| part.len()).sum::<usize>(), all)
    }

    /// The rows of arc `k`'s points by their own parameters, by QR no more than there are parameters.
    pub(super) fn reduced(&self, p: &DVector<f64>, k: usize) -> (DMatrix<f64>, DVector<f64>) {
        let points = self.parts[k];
        let columns = self.local(k);
        let seen = |p: &DVector<f64>| -> Vec<[f64; 2]> {
            let seen = points.iter().map(|point| self.seen(p, k, point.sample.t).1);
            seen.map(|m| [m.r, m.h]).collect()
        };
        let here = seen(p);
        let mut matrix = DMatrix::zeros(2 * points.len(), LOCAL);
        let mut right = DVector::zeros(2 * points.len());
        for (i, (point, at)) in points.iter().zip(&here).enumerate() {
            let s = &point.sample;
            let w = self.weights[k] * s.weight.sqrt();
            right[2 * i] = w * (s.r - at[0]);
            right[2 * i + 1] = w * (s.h - at[1]);
        }
        let mut moved = p.clone();
        for (j, column) in columns.into_iter().enumerate() {
            let step = self.difference_step(column);
            moved[column] += step;
            for (i, ((point, at), there)) in points.iter().zip(&here).zip(seen(&moved)).enumerate() {
                let w = self.weights[k] * point.sample.weight.sqrt() / step;
                matrix[(2 * i, j)] = w * (there[0] - at[0]);
                matrix[(2 * i + 1, j)] = w * (there[1] - at[1]);
            }
            moved[column] = p[column];
        }
        if matrix.nrows() <= LOCAL {
            return (matrix, right);
        }
        let qr = matrix.qr();
        qr.q_tr_mul(&mut right);
        (qr.r(), right.rows(0, LOCAL).into_owned())
    }

    /// The parameters that arc `k`'s points depend on, [`LOCAL`] of them.
    pub(super) fn local(&self, k: usize) -> Vec<usize> {
        let (ground, rise, lift) = (self.layout.ground(k), self.layout.rise(k), self.layout.lift(k));
        let (nadir, pull) = (self.layout.nadir(), self.layout.shadow_pull());
        let own = (ground..ground + 4).chain(rise..rise + 2).chain(lift..lift + 3);
        let shared = [DRAG, nadir, nadir + 1, self.layout.fall(), pull, pull + 1];
        own.chain(shared).collect()
    }

    /// A step of parameter `i` for differences: a millionth of what matters in it, far above rounding.
    pub(super) fn difference_step(&self, i: usize) -> f64 {
        const PART: f64 = 1e-6;
        let height = self.view.camera_height();
        let (layout, fast) = (self.layout, self.view.fastest_per_s());
        if i == DRAG {
            PART / height
        } else if i < layout.rise(0) {
            // Place and speed by turns.
            let speed = (i - layout.ground(0)) % 2 == 1;
            PART * height * if speed { fast } else { 1.0 }
        } else if i < layout.lift(0) {
            let rate = (i - layout.rise(0)) % 2 == 1;
            PART * if rate { fast } else { 1.0 }
        } else if i < layout.nadir() {
            // s is what turns the path in a second.
            PART * fast
        } else if i < layout.fall() || i == layout.shadow_pull() || i == layout.shadow_pull() + 1 {
            PART * height
        } else if i == layout.fall() {
            PART
        } else {
            // Times.
            PART / fast
        }
    }
}
