//! The rotation vector of an arc by likelihood over all its pixels, with a map of the ball that turns and one of the light that stays.
//!
//! ```text
//! ln brightness of pixel p in frame i = gain_i + light(place of p) + albedo(exp(−[ω] t_i) n_p) + noise
//! ```
//!
//! Gain, light and albedo are linear ([`map_fit`](super::map_fit)), with a prior that holds nodes that few pixels see. ω takes Gauss-Newton steps by the
//! curvature that is left when the maps go along, and takes them along.
//!
//! A gain free in every frame would take the marks' own share, of halves of two colours most of it: the gain is a parabola in time.
//!
//! A frame's own rotation from the fitted motion is then fitted frame by frame. How these scatter against what the pixels promise says
//! what codec, centres and light add: the covariance is multiplied by that. What is wrong alike in all frames, a radius or a light, frames
//! do not show, but parts of the disc do, which then disagree: what they differ by beyond noise is added (errors clustered by frames
//! and by places: Cameron, Gelbach and Miller, J. Bus. Econ. Stat. 29, 238, 2011).

use super::LEAST_TURNS;
use super::cube_map::{AT_ONCE, CubeGrid, GridCell, NodeWeights, across, value_at};
use super::disc_map::DiscGrid;
use super::map_fit::{BallMaps, GainTerms, MapChange, MapProblem, OnMap};
use super::map_value::Three;
use super::view::{BallSamples, Directions};
use nalgebra::{Cholesky, Matrix3, Rotation3, SMatrix, SVector, U3, Vector3};
use std::f64::consts::{PI, TAU};
use std::slice;
use std::sync::{Arc, OnceLock};

/// Steps of the rate at most, and after how many the curvature is taken anew.
const ROUNDS: usize = 16;
const FAR_ROUNDS: usize = 6;

/// The curvature stands for rates that turn the ends of the arc by no more of the map's spacing.
const NEAR_SPACINGS: f64 = 0.5;

/// Steps of a candidate at most; they end at one that turns the ends of the arc by no more than this part of the map's spacing.
const ROUGH_ROUNDS: usize = 5;
const ROUGH_SPACINGS: f64 = 0.1;

/// Rounds of maps end at one that makes Σ of squares less by no more than this part ([`MapProblem::least_part`]): for a fit, and for a rate that may be far from one.
pub(super) const EXACT: f32 = 1e-3;
const ROUGH: f32 = 1e-2;

/// Steps to the rate of samples that are hardly others, at most; they end at one that is this part of the way.
const OTHER_ROUNDS: usize = 16;
const SMALL_STEP: f64 = 0.1;

/// Correlation of neighbouring frames' errors, at most.
const MOST_ALIKE: f64 = 0.9;

/// Rounds of a light alone.
const STILL_ROUNDS: usize = 6;

/// Parts in which errors are thought alike: sectors of the disc, and spans of the arc.
const SECTORS: usize = 8;
const SPANS: usize = 4;

/// Products that are summed in single precision before they go into a sum in double.
const SUMMED: usize = 1024;

/// A step below this part of the standard uncertainty ends the fit.
const SETTLED: f64 = 0.07;

/// A fitted rotation.
#[derive(Debug, Clone)]
pub struct RotationFit {
    /// Rotation vector, rad/s, camera axes (right, down, away).
    pub rate_rad_s: Vector3<f64>,
    /// Its covariance, (rad/s)², as frames have it that err each by itself.
    pub covariance: Matrix3<f64>,
    /// What parts of the disc, which err alike in many frames, scatter by beyond noise, (rad/s)²: no covariance, it may be negative along an axis.
    pub by_parts: Matrix3<f64>,
    /// The maps.
    pub maps: BallMaps,
    /// Each frame's rotation beyond the fitted one, rad, camera axes.
    pub off_rad: Vec<Vector3<f64>>,
    /// Standard uncertainties of those by the pixels, times `scatter`.
    pub off_std_rad: Vec<Vector3<f64>>,
    /// Scatter of the frames over what the pixels promise; at least 1.
    pub scatter: f64,
    /// Σ of squared residuals over their weights.
    pub sum_squares: f64,
    /// The same as if each pixel had no part in the map that it is held against.
    pub cross_validated: f64,
    /// Root mean square residual, logarithm of brightness.
    pub residual: f64,
    /// Pixels that it is by.
    pub pixels: usize,
}

impl RotationFit {
    /// Turns in `duration_s`.
    #[must_use]
    pub fn turns(&self, duration_s: f64) -> f64 {
        self.rate_rad_s.norm() * duration_s / TAU
    }

    /// Whether it makes so few turns in `duration_s` that the marks are not told from a light that is free.
    #[must_use]
    pub fn turns_too_little(&self, duration_s: f64) -> bool {
        self.turns(duration_s) < LEAST_TURNS
    }

    /// How far from this rate that of other `samples` is, which take the same pixels for other places on the ball.
    #[must_use]
    pub fn distance_to_rate_of(&self, samples: &BallSamples, grids: &FitGrids, lit: bool) -> Vector3<f64> {
        let (mut maps, mut rate) = (self.maps.on(grids.grid), self.rate_rad_s);
        let mut inverse = self.inverse_for(self.part_of(samples));
        let mut before: Option<(Vector3<f64>, Vector3<f64>)> = None;
        for _ in 0..OTHER_ROUNDS {
            let found = evaluated(samples, grids, &maps, &rate, lit, EXACT);
            if let Some((step, downhill)) = before {
                inverse = with_step(inverse, step, downhill - found.downhill);
            }
            let step = no_longer(grids.longest_step(samples), inverse * found.downhill);
            rate += step;
            if step.norm() < SMALL_STEP * (rate - self.rate_rad_s).norm() {
                break;
            }
            before = Some((step, found.downhill));
            maps = found.maps;
        }
        rate - self.rate_rad_s
    }

    /// The first step on that way, roughly.
    #[must_use]
    pub fn step_to_rate_of(&self, samples: &BallSamples, grids: &FitGrids, lit: bool) -> Vector3<f64> {
        let maps = self.maps.on(grids.grid);
        let found = evaluated(samples, grids, &maps, &self.rate_rad_s, lit, ROUGH);
        self.inverse_for(self.part_of(samples)) * found.downhill
    }

    /// How many times as many pixels `samples` have as the fit is by.
    fn part_of(&self, samples: &BallSamples) -> f64 {
        samples.values.len() as f64 / self.pixels as f64
    }

    /// Inverse of the curvature that this `part` of the pixels has that the fit is by, each as much as any.
    fn inverse_for(&self, part: f64) -> Matrix3<f64> {
        let unit = part * (self.scatter * self.residual).powi(2).max(f64::MIN_POSITIVE);
        self.covariance / unit
    }

    /// Whether `start`, found in the same samples, lies in the valley of this minimum: by its curvature they are left there no more than they are.
    #[must_use]
    pub fn has_in_valley(&self, start: &RoughFit) -> bool {
        let off = start.rate_rad_s - self.rate_rad_s;
        let rise = |c: Cholesky<f64, U3>| off.dot(&c.solve(&off)) * self.scatter.powi(2) / self.pixels as f64;
        let risen = self.covariance.cholesky().map(|c| 1.0 + rise(c));
        risen.is_some_and(|risen| risen * self.cross_validated <= start.cross_validated)
    }

    /// Whether the rates differ by more than their uncertainties: three standard ones of both.
    #[must_use]
    pub fn differs_from(&self, other: &Self) -> bool {
        let off = self.rate_rad_s - other.rate_rad_s;
        let both = self.covariance + other.covariance;
        both.cholesky()
            .is_none_or(|c| off.dot(&c.solve(&off)) > 3.0 * 9.0)
    }
}

/// A rotation near a minimum, without uncertainties.
#[derive(Debug, Clone)]
pub struct RoughFit {
    /// Rotation vector, rad/s, camera axes.
    pub rate_rad_s: Vector3<f64>,
    /// The maps.
    pub maps: BallMaps,
    /// Σ of squared residuals over their weights, as if each pixel had no part in the map that it is held against.
    pub cross_validated: f64,
}

/// What a fit needs beside the samples.
#[derive(Debug, Clone)]
pub struct FitGrids {
    /// The ball's.
    pub grid: CubeGrid,
    /// The light's.
    pub disc: DiscGrid,
    /// Where each sample lies in the light's grid, and what all of them weigh at its nodes.
    lit: Vec<GridCell>,
    lit_weights: Vec<f32>,
    /// The samples' brightness.
    gains: GainTerms,
    /// What the slopes at the nodes of the ball's grid are taken from, made when they are asked for: a plain ball has no need of them.
    around: Arc<OnceLock<Vec<NodeSurroundings>>>,
}

/// Two tangents at a node, and the places a little ahead and back along each.
#[derive(Debug, Clone)]
struct NodeSurroundings {
    tangents: [Three; 2],
    ahead: [GridCell; 2],
    back: [GridCell; 2],
}

impl NodeSurroundings {
    fn new(grid: CubeGrid, node: usize) -> Self {
        let h = 0.5 * grid.spacing_rad();
        let d = grid.direction(node);
        let one = across(&d);
        let tangents = [one, d.cross(&one)];
        Self {
            tangents: tangents.map(|t| Three::of(&t)),
            ahead: tangents.map(|t| grid.cell(&(d + h * t))),
            back: tangents.map(|t| grid.cell(&(d - h * t))),
        }
    }
}

impl FitGrids {
    /// For `samples` with pixels of `pixel` radii.
    #[must_use]
    pub fn new(samples: &BallSamples, pixel: f64) -> Self {
        let disc = DiscGrid::with_spacing((2.0 * pixel).max(0.1));
        let grid = CubeGrid::with_spacing(1.2 * pixel);
        Self::with(grid, disc, Arc::default(), samples)
    }

    /// Those for a part of the samples, one in `step`: with as many for each node of the ball.
    #[must_use]
    pub fn coarser(&self, samples: &BallSamples, step: usize) -> Self {
        if step == 1 {
            return self.of_samples(samples);
        }
        let grid = CubeGrid::with_spacing((step as f64).sqrt() * self.grid.spacing_rad());
        Self::with(grid, self.disc, Arc::default(), samples)
    }

    /// The same grids for other samples.
    #[must_use]
    pub fn of_samples(&self, samples: &BallSamples) -> Self {
        Self::with(self.grid, self.disc, Arc::clone(&self.around), samples)
    }

    fn with(
        grid: CubeGrid,
        disc: DiscGrid,
        around: Arc<OnceLock<Vec<NodeSurroundings>>>,
        samples: &BallSamples,
    ) -> Self {
        let lit: Vec<GridCell> = samples.places.iter().map(|&p| disc.cell(p)).collect();
        Self {
            grid,
            disc,
            lit_weights: weights_of(slice::from_ref(&lit), disc.nodes(), disc.side()),
            lit,
            gains: GainTerms::new(samples),
            around,
        }
    }

    /// The longest step of a rate, rad/s: one that turns the ends of the arc by more than the map is fine leads astray.
    #[must_use]
    pub fn longest_step(&self, samples: &BallSamples) -> f64 {
        2.0 * self.grid.spacing_rad() / samples.longest_s()
    }
}

impl BallMaps {
    fn dark(samples: &BallSamples, grids: &FitGrids) -> Self {
        Self {
            grid: grids.grid,
            albedo: vec![0.0; grids.grid.nodes()],
            seen: vec![0.0; grids.grid.nodes()],
            disc: grids.disc,
            light: vec![0.0; grids.disc.nodes()],
            gains: vec![0.0; samples.frames()],
        }
    }
}

/// Gain alone, in the light of `known`: what that leaves over, and maps to go on from.
#[must_use]
pub fn lit_as(samples: &BallSamples, grids: &FitGrids, known: &BallMaps) -> (Vec<f32>, BallMaps) {
    let mut maps = BallMaps::dark(samples, grids);
    for (k, light) in maps.light.iter_mut().enumerate() {
        *light = value_at(&known.light, &known.disc.corners(grids.disc.place(k)));
    }
    let lit = samples.values.iter().zip(&grids.lit);
    let next = grids.disc.side();
    let mut residuals: Vec<f32> = lit.map(|(v, c)| v - c.value(&maps.light, next)).collect();
    grids.gains.take(samples, &mut residuals, &mut maps.gains);
    (residuals, maps)
}

/// By how much Σ of squares of the residuals `left` by a still light is less if that drifts: at each place a parabola in time.
#[must_use]
pub fn explained_by_drift(samples: &BallSamples, grids: &FitGrids, left: &[f32]) -> f64 {
    let longest_s = samples.longest_s().max(f64::MIN_POSITIVE);
    let mut matrices = vec![1e-6 * Matrix3::<f64>::identity(); grids.disc.nodes()];
    let mut rights = vec![Vector3::<f64>::zeros(); grids.disc.nodes()];
    for (i, t) in samples.times_s.iter().map(|t| t / longest_s).enumerate() {
        let x = Vector3::new(1.0, t, t * t);
        for p in samples.of_frame(i) {
            let [a, b, c, d]: NodeWeights = grids.lit[p].corners(grids.disc.side());
            let nearest = [b, c, d]
                .into_iter()
                .fold(a, |best, n| if n.1 > best.1 { n } else { best });
            matrices[nearest.0 as usize] += x * x.transpose();
            rights[nearest.0 as usize] += f64::from(left[p]) * x;
        }
    }
    let explained = matrices
        .iter()
        .zip(&rights)
        .filter_map(|(m, r)| Some(r.dot(&m.cholesky()?.solve(r))));
    explained.sum()
}

/// Gain and light alone: as if nothing turned.
#[must_use]
pub fn still(samples: &BallSamples, grids: &FitGrids) -> (Vec<f32>, BallMaps) {
    let mut maps = BallMaps::dark(samples, grids);
    let mut residuals = samples.values.clone();
    for _ in 0..STILL_ROUNDS {
        grids.gains.take(samples, &mut residuals, &mut maps.gains);
        grids.take_light(&mut residuals, &mut maps.light);
    }
    (residuals, maps)
}

/// Powers of the place in a smooth light.
const SMOOTH: [(i32, i32); SMOOTH_TERMS] = [
    (0, 0),
    (1, 0),
    (0, 1),
    (2, 0),
    (1, 1),
    (0, 2),
    (3, 0),
    (2, 1),
    (1, 2),
    (0, 3),
    (4, 0),
    (3, 1),
    (2, 2),
    (1, 3),
    (0, 4),
];
const SMOOTH_TERMS: usize = 15;

/// The light alone, a polynomial of the fourth degree as a matt ball has it: what is sharper is left to the marks, however slowly they turn.
#[must_use]
pub fn smooth_light(samples: &BallSamples, grids: &FitGrids) -> BallMaps {
    let mut maps = BallMaps::dark(samples, grids);
    let terms = |[a, b]: [f64; 2]| {
        SVector::<f64, SMOOTH_TERMS>::from_fn(|k, _| a.powi(SMOOTH[k].0) * b.powi(SMOOTH[k].1))
    };
    let mut matrix = 1e-9 * SMatrix::<f64, SMOOTH_TERMS, SMOOTH_TERMS>::identity();
    for &place in &samples.places {
        let x = terms(place);
        matrix += x * x.transpose();
    }
    let Some(chol) = matrix.cholesky() else {
        return maps;
    };
    let mut residuals = samples.values.clone();
    for _ in 0..STILL_ROUNDS {
        grids.gains.take(samples, &mut residuals, &mut maps.gains);
        let mut right = SVector::<f64, SMOOTH_TERMS>::zeros();
        for (r, &place) in residuals.iter().zip(&samples.places) {
            right += f64::from(*r) * terms(place);
        }
        let found = chol.solve(&right);
        for (r, &place) in residuals.iter_mut().zip(&samples.places) {
            *r -= found.dot(&terms(place)) as f32;
        }
        for (k, light) in maps.light.iter_mut().enumerate() {
            *light += found.dot(&terms(grids.disc.place(k))) as f32;
        }
    }
    maps
}

/// What samples that lie in `cells`, each in one of every list, weigh at the nodes.
pub(super) fn weights_of(cells: &[Vec<GridCell>], nodes: usize, next: usize) -> Vec<f32> {
    let mut weights = vec![0.0; nodes];
    for cell in cells.iter().flatten() {
        cell.add(&mut weights, next, 1.0 / cells.len() as f32);
    }
    weights
}

impl FitGrids {
    /// Moves what the residuals have in common at the nodes of the light into it.
    fn take_light(&self, residuals: &mut [f32], light: &mut [f32]) {
        let next = self.disc.side();
        let mut sums = vec![0.0; light.len()];
        for (cell, r) in self.lit.iter().zip(residuals.iter()) {
            cell.add(&mut sums, next, *r);
        }
        for ((sum, w), m) in sums.iter_mut().zip(&self.lit_weights).zip(light.iter_mut()) {
            *sum /= w.max(1e-9);
            *m += *sum;
        }
        for (cell, r) in self.lit.iter().zip(residuals.iter_mut()) {
            *r -= cell.value(&sums, next);
        }
    }

    /// The linear problem of the maps of `samples` that see the ball in `turned`, where they have `seen` so much of it, unless the light is known.
    pub(super) fn map_problem<'a>(
        &'a self,
        samples: &'a BallSamples,
        turned: &'a TurnedBall,
        seen: &'a [f32],
        lit: bool,
        least_part: f32,
    ) -> MapProblem<'a> {
        let light = OnMap {
            cells: slice::from_ref(&self.lit),
            weights: &self.lit_weights,
            next: self.disc.side(),
        };
        MapProblem {
            samples,
            ball: OnMap {
                cells: &turned.cells,
                weights: seen,
                next: self.grid.side(),
            },
            light: (!lit).then_some(light),
            gains: &self.gains,
            least_part,
        }
    }

    /// Slopes of a map of the ball at its nodes: the tangent vector along which it grows.
    fn slopes(&self, map: &[f32]) -> Vec<Three> {
        let (next, across) = (self.grid.side(), 1.0 / self.grid.spacing_rad() as f32);
        let slope = |near: &NodeSurroundings| {
            let along = |k: usize| near.ahead[k].value(map, next) - near.back[k].value(map, next);
            near.tangents[0] * (across * along(0)) + near.tangents[1] * (across * along(1))
        };
        let nodes = 0..self.grid.nodes();
        let around = || nodes.map(|k| NodeSurroundings::new(self.grid, k)).collect();
        self.around.get_or_init(around).iter().map(slope).collect()
    }
}

/// ∫ of the turning: by what a frame at `t` turns for a change of the rate, and how the left Jacobian of the rotations has it.
fn left_jacobian(v: &Vector3<f64>) -> Matrix3<f64> {
    let angle = v.norm();
    if angle < 1e-8 {
        return Matrix3::identity();
    }
    let axis = v / angle;
    let (s, c) = angle.sin_cos();
    Matrix3::identity() * (s / angle)
        + axis * axis.transpose() * (1.0 - s / angle)
        + axis.cross_matrix() * ((1.0 - c) / angle)
}

/// What a frame says of a rotation of its own: J^T W J and J^T W r.
#[derive(Clone, Copy)]
struct OwnRotation {
    matrix: Matrix3<f64>,
    right: Vector3<f64>,
}

pub(super) struct TurnedBall {
    turns: Vec<Rotation3<f64>>,
    /// Of each sample, in the ball's grid: a list for each of its directions.
    pub(super) cells: Vec<Vec<GridCell>>,
}

pub(super) fn turned(samples: &BallSamples, grid: CubeGrid, rate: &Vector3<f64>) -> TurnedBall {
    let turns: Vec<Rotation3<f64>> = samples
        .times_s
        .iter()
        .map(|&t| Rotation3::new(t * rate))
        .collect();
    let of_list = |towards: &Directions| {
        let mut cells = Vec::with_capacity(samples.values.len());
        for (i, turn) in turns.iter().enumerate() {
            let back: Matrix3<f32> = turn.inverse().into_inner().cast();
            let mut rest = samples.of_frame(i);
            while !rest.is_empty() {
                let some = rest.start..rest.end.min(rest.start + AT_ONCE);
                let [x, y, z] = towards.components(some.clone()).map(filled);
                cells.extend_from_slice(&grid.cells(&back, [&x, &y, &z])[..some.len()]);
                rest.start = some.end;
            }
        }
        cells
    };
    let cells = samples.towards.iter().map(of_list).collect();
    TurnedBall { turns, cells }
}

/// As many as are looked up together, with the first in place of those that lack.
#[inline]
fn filled(some: &[f32]) -> [f32; AT_ONCE] {
    some.try_into()
        .unwrap_or_else(|_| std::array::from_fn(|k| some[if k < some.len() { k } else { 0 }]))
}

impl TurnedBall {
    /// By what each pixel of frame `i` grows if the frame's ball is turned on, by the rotation vector; of a map with these `slopes` at its nodes.
    fn slopes_by_rotation<'a>(
        &'a self,
        samples: &'a BallSamples,
        next: usize,
        slopes: &'a [Three],
        i: usize,
    ) -> impl Iterator<Item = Three> + 'a {
        let turn = Linear::new(self.turns[i].matrix() / self.cells.len() as f64);
        samples.of_frame(i).map(move |p| {
            let mut sum = Three::default();
            for (cells, towards) in self.cells.iter().zip(&samples.towards) {
                sum += turn.of(cells[p].value(slopes, next)).cross(towards.at(p));
            }
            sum
        })
    }
}

/// A linear map of vectors, by its columns.
#[derive(Clone, Copy)]
struct Linear([Three; 3]);

impl Linear {
    fn new(matrix: Matrix3<f64>) -> Self {
        Self([0, 1, 2].map(|k| Three::of(&matrix.column(k).into_owned())))
    }

    #[inline(always)]
    fn of(&self, Three([x, y, z, _]): Three) -> Three {
        self.0[0] * x + self.0[1] * y + self.0[2] * z
    }
}

/// Σ of the squares of the residuals.
#[must_use]
pub fn sum_of_squares(residuals: &[f32]) -> f64 {
    residuals.iter().map(|r| f64::from(*r).powi(2)).sum()
}

/// A sum of a bᵀ, by its rows.
#[derive(Clone, Copy, Default)]
struct OuterProducts([Three; 3]);

impl OuterProducts {
    #[inline]
    fn add(&mut self, Three(a): Three, b: Three) {
        for (row, a) in self.0.iter_mut().zip(a) {
            *row += b * a;
        }
    }

    fn matrix(&self) -> Matrix3<f64> {
        Matrix3::from_fn(|i, j| f64::from(self.0[i].0[j]))
    }

    /// Of all pairs.
    fn sum(a: &[Three], b: &[Three]) -> Matrix3<f64> {
        let some = a.chunks(SUMMED).zip(b.chunks(SUMMED)).map(|(a, b)| {
            let mut products = Self::default();
            a.iter().zip(b).for_each(|(a, b)| products.add(*a, *b));
            products.matrix()
        });
        some.sum()
    }
}

fn frame_equations(
    samples: &BallSamples,
    next: usize,
    turned: &TurnedBall,
    slopes: &[Three],
    residuals: &[f32],
) -> Vec<OwnRotation> {
    let of_frame = |i: usize| {
        let (mut products, mut right) = (OuterProducts::default(), Three::default());
        let rows = turned.slopes_by_rotation(samples, next, slopes, i);
        for (row, residual) in rows.zip(&residuals[samples.of_frame(i)]) {
            products.add(row, row);
            right += row * *residual;
        }
        OwnRotation {
            matrix: products.matrix(),
            right: right.vector(),
        }
    };
    (0..samples.frames()).map(of_frame).collect()
}

/// The maps fitted for one rate, and what is left.
struct MapsAtRate {
    turned: TurnedBall,
    maps: BallMaps,
    equations: Vec<OwnRotation>,
    /// Slope of half of χ² (times the variance) downwards, by the rate.
    downhill: Vector3<f64>,
    residuals: Vec<f32>,
    sum_squares: f64,
}

/// The maps from `maps` on, for `rate`.
fn evaluated(
    samples: &BallSamples,
    grids: &FitGrids,
    maps: &BallMaps,
    rate: &Vector3<f64>,
    lit: bool,
    least_part: f32,
) -> MapsAtRate {
    let mut maps = maps.clone();
    let next = grids.grid.side();
    let turned = turned(samples, grids.grid, rate);
    maps.seen = weights_of(&turned.cells, grids.grid.nodes(), next);
    let mut residuals = Vec::new();
    // What two directions show is not linear in the map.
    for _ in &turned.cells {
        residuals = residuals_of(samples, grids, &maps, &turned);
        let problem = grids.map_problem(samples, &turned, &maps.seen, lit, least_part);
        let change = problem.solve(&mut residuals, &maps.albedo);
        change.apply(&mut maps, &grids.gains);
    }
    let sum_squares = sum_of_squares(&residuals);
    let slopes = grids.slopes(&maps.albedo);
    let equations = frame_equations(samples, next, &turned, &slopes, &residuals);
    let downhill = equations
        .iter()
        .zip(&samples.times_s)
        .fold(Vector3::zeros(), |sum, (e, &t)| {
            sum + t * left_jacobian(&(t * rate)).transpose() * e.right
        });
    MapsAtRate {
        turned,
        maps,
        equations,
        downhill,
        residuals,
        sum_squares,
    }
}

/// The light of `maps` alone, with the gains that it leaves.
fn unmarked(samples: &BallSamples, grids: &FitGrids, maps: &BallMaps) -> BallMaps {
    let mut maps = BallMaps {
        light: maps.light.clone(),
        ..BallMaps::dark(samples, grids)
    };
    let next = grids.disc.side();
    let lit_by = samples.values.iter().zip(&grids.lit);
    let mut unlit: Vec<f32> = lit_by.map(|(v, c)| v - c.value(&maps.light, next)).collect();
    grids.gains.take(samples, &mut unlit, &mut maps.gains);
    maps
}

/// The light that the pixels show where the ball's `fit` is taken away, with what it weighs at each node.
#[must_use]
pub fn light_beside(samples: &BallSamples, grids: &FitGrids, fit: &RoughFit) -> (Vec<f32>, Vec<f32>) {
    let turned = turned(samples, grids.grid, &fit.rate_rad_s);
    let dark = BallMaps {
        light: vec![0.0; grids.disc.nodes()],
        ..fit.maps.on(grids.grid)
    };
    let mut residuals = residuals_of(samples, grids, &dark, &turned);
    let mut light = dark.light;
    for _ in 0..STILL_ROUNDS {
        grids.take_light(&mut residuals, &mut light);
    }
    (light, grids.lit_weights.clone())
}

/// The rotation near `start`, from the light of `maps`, which stays if the ball is known to be `lit` so; `None` where the pixels do not
/// hold it.
#[must_use]
pub fn fit(
    samples: &BallSamples,
    grids: &FitGrids,
    maps: &BallMaps,
    start: Vector3<f64>,
    lit: bool,
) -> Option<RotationFit> {
    fit_from(samples, grids, &unmarked(samples, grids, maps), start, lit)
}

/// The same from a rotation of the same frames by some of the `samples`, with its maps.
#[must_use]
pub fn fit_on(samples: &BallSamples, grids: &FitGrids, from: &RotationFit, lit: bool) -> Option<RotationFit> {
    fit_from(samples, grids, &from.maps.on(grids.grid), from.rate_rad_s, lit)
}

/// A fit by some of a ball's pixels brought on by all of these `samples`, on the same grid: a step from a rate that is a few of its standard
/// uncertainties off, by the curvature that it has for each pixel that is not taken up by the map.
#[must_use]
pub fn brought_on(samples: &BallSamples, grids: &FitGrids, from: &RotationFit, lit: bool) -> RotationFit {
    let mut found = evaluated(samples, grids, &from.maps, &from.rate_rad_s, lit, EXACT);
    let others = found.others_part(samples, grids, lit);
    let others_before = (from.sum_squares / from.cross_validated).sqrt();
    let inverse = from.inverse_for(from.part_of(samples) * others / others_before);
    let step = no_longer(grids.longest_step(samples), inverse * found.downhill);
    for (own, &t) in found.equations.iter_mut().zip(&samples.times_s) {
        own.right -= own.matrix * (t * left_jacobian(&(t * from.rate_rad_s)) * step);
    }
    let by_rate = found.slopes_by_rate(samples, grids, &from.rate_rad_s);
    let by_parts = found.scatter_of_parts(samples, &by_rate, &inverse);
    found.with_scatter(samples, from.rate_rad_s + step, inverse, by_parts, others)
}

/// Σ of squares that the rate of a rotation of the same frames leaves of `samples`.
#[must_use]
pub fn left_at(samples: &BallSamples, grids: &FitGrids, from: &RotationFit, lit: bool) -> f64 {
    evaluated(
        samples,
        grids,
        &from.maps.on(grids.grid),
        &from.rate_rad_s,
        lit,
        EXACT,
    )
    .sum_squares
}

/// The `inverse` of a curvature that is known better by a `step` on which the slope became `less` by so much (Broyden, Fletcher, Goldfarb and Shanno, 1970).
fn with_step(inverse: Matrix3<f64>, step: Vector3<f64>, less: Vector3<f64>) -> Matrix3<f64> {
    let along = step.dot(&less);
    if !(along > 0.0) {
        return inverse;
    }
    let others = Matrix3::identity() - step * less.transpose() / along;
    others * inverse * others.transpose() + step * step.transpose() / along
}

/// A step of the same direction, no longer than `most`.
fn no_longer(most: f64, step: Vector3<f64>) -> Vector3<f64> {
    (most / step.norm().max(f64::MIN_POSITIVE)).min(1.0) * step
}

fn fit_from(
    samples: &BallSamples,
    grids: &FitGrids,
    maps: &BallMaps,
    start: Vector3<f64>,
    lit: bool,
) -> Option<RotationFit> {
    let mut rate = start;
    let count = samples.values.len() as f64;
    let longest_s = samples.longest_s();
    let most = grids.longest_step(samples);
    let mut found = evaluated(samples, grids, maps, &rate, lit, EXACT);
    let others = found.others_part(samples, grids, lit);
    let mut bend: Option<FreeCurvature> = None;
    let (mut inverse, mut by_steps) = (Matrix3::zeros(), Matrix3::zeros());
    let mut since_rad = 0.0;
    for round in 0..ROUNDS {
        if bend.is_none() || round == FAR_ROUNDS {
            let by_rate = found.slopes_by_rate(samples, grids, &rate);
            bend = found.curvature(samples, grids, &by_rate, lit);
            since_rad = 0.0;
            // Far from the minimum the curvature may have the wrong sign; with the maps held it never has.
            let matrix = match &bend {
                Some(bend) => bend.matrix,
                None => found.held_curvature(samples, &rate),
            };
            inverse = matrix.cholesky()?.inverse();
            by_steps = inverse;
        }
        let gain = found.downhill.dot(&(inverse * found.downhill)) * count / found.sum_squares;
        if gain < (SETTLED * found.frames_scatter(samples, others).scatter).powi(2) && bend.is_some() {
            break;
        }
        let step = no_longer(most, by_steps * found.downhill);
        rate += step;
        since_rad += step.norm() * longest_s;
        let mut maps = found.maps;
        if let Some(bend) = &bend {
            bend.taken.against(&step).apply(&mut maps, &grids.gains);
        }
        let there = evaluated(samples, grids, &maps, &rate, lit, EXACT);
        by_steps = with_step(by_steps, step, found.downhill - there.downhill);
        found = there;
    }
    // Nearby the curvature stands.
    let stands = bend.filter(|_| since_rad < NEAR_SPACINGS * grids.grid.spacing_rad());
    let by_rate = found.slopes_by_rate(samples, grids, &rate);
    let bend = stands.or_else(|| found.curvature(samples, grids, &by_rate, lit))?;
    let inverse = bend.matrix.cholesky()?.inverse();
    let by_parts = found.scatter_of_parts(samples, &by_rate, &inverse);
    let others = found.others_part(samples, grids, lit);
    Some(found.with_scatter(samples, rate, inverse, by_parts, others))
}

/// A rate nearer to the minimum than `start`, by a few steps with the maps held: enough to see which of many
/// candidates are worth a fit.
#[must_use]
pub fn rough(
    samples: &BallSamples,
    grids: &FitGrids,
    maps: &BallMaps,
    start: Vector3<f64>,
    lit: bool,
) -> RoughFit {
    let mut rate = start;
    let most = grids.longest_step(samples);
    let shortest = ROUGH_SPACINGS * grids.grid.spacing_rad() / samples.longest_s();
    let mut found = evaluated(samples, grids, &unmarked(samples, grids, maps), &rate, lit, ROUGH);
    for _ in 0..ROUGH_ROUNDS {
        let Some(chol) = found.held_curvature(samples, &rate).cholesky() else {
            break;
        };
        let step = chol.solve(&found.downhill);
        let next = rate + no_longer(most, step);
        let there = evaluated(samples, grids, &found.maps, &next, lit, ROUGH);
        if there.sum_squares > found.sum_squares {
            break;
        }
        (rate, found) = (next, there);
        if step.norm() <= shortest {
            break;
        }
    }
    RoughFit {
        rate_rad_s: rate,
        cross_validated: found.cross_validated(samples, grids, lit),
        maps: found.maps,
    }
}

impl MapsAtRate {
    /// Σ of squares as if each pixel had no part in the map that it is held against (generalised cross-validation, Craven and Wahba 1979): a rate that
    /// brings more of the ball into view has more of a map to suit the pixels, and must not win by that.
    fn cross_validated(&self, samples: &BallSamples, grids: &FitGrids, lit: bool) -> f64 {
        self.sum_squares / self.others_part(samples, grids, lit).powi(2)
    }

    /// The part that other pixels have in the maps' values at a pixel, on average.
    fn others_part(&self, samples: &BallSamples, grids: &FitGrids, lit: bool) -> f64 {
        let problem = grids.map_problem(samples, &self.turned, &self.maps.seen, lit, EXACT);
        problem.others_part()
    }

    /// By what each pixel's model grows with the rate, the maps held.
    fn slopes_by_rate(&self, samples: &BallSamples, grids: &FitGrids, rate: &Vector3<f64>) -> Vec<Three> {
        let (next, slopes) = (grids.grid.side(), grids.slopes(&self.maps.albedo));
        let mut by_rate = Vec::with_capacity(samples.values.len());
        for (i, &t) in samples.times_s.iter().enumerate() {
            let turn = Linear::new((t * left_jacobian(&(t * rate))).transpose());
            let rows = self.turned.slopes_by_rotation(samples, next, &slopes, i);
            by_rate.extend(rows.map(|row| turn.of(row)));
        }
        by_rate
    }

    /// Curvature of half of χ² (times the variance) by the rate, the maps fitted along: what they can take of a change of the rate is taken out.
    /// `None` where nothing is left.
    fn curvature(
        &self,
        samples: &BallSamples,
        grids: &FitGrids,
        by_rate: &[Three],
        lit: bool,
    ) -> Option<FreeCurvature> {
        let mut left = by_rate.to_vec();
        let problem = grids.map_problem(samples, &self.turned, &self.maps.seen, lit, EXACT);
        let held = vec![Three::default(); self.maps.albedo.len()];
        let taken = problem.solve(&mut left, &held);
        let matrix = OuterProducts::sum(by_rate, &left);
        let even = 0.5 * (matrix + matrix.transpose());
        even.cholesky().map(|_| FreeCurvature { matrix: even, taken })
    }

    /// Curvature of half of χ² (times the variance) by the rate, the maps held.
    fn held_curvature(&self, samples: &BallSamples, rate: &Vector3<f64>) -> Matrix3<f64> {
        let held = self.equations.iter().zip(&samples.times_s);
        held.fold(Matrix3::zeros(), |sum, (e, &t)| {
            let jacobian = t * left_jacobian(&(t * rate));
            sum + jacobian.transpose() * e.matrix * jacobian
        })
    }

    /// How the frames' own rotations scatter.
    fn frames_scatter(&self, samples: &BallSamples, others_part: f64) -> FramesScatter {
        let frames = samples.frames();
        let variance = self.sum_squares / samples.values.len() as f64;
        // A frame has its part in the map that it is held against.
        let own = 1.0 / others_part;
        let mut off_rad = Vec::with_capacity(frames);
        let mut off_std_rad = Vec::with_capacity(frames);
        let mut whitened: Vec<Option<Vector3<f64>>> = Vec::with_capacity(frames);
        for e in &self.equations {
            let prior = Matrix3::identity() * (1e-9 * e.matrix.trace().max(f64::MIN_POSITIVE));
            let chol = (e.matrix + prior).cholesky();
            off_rad.push(chol.map_or(Vector3::zeros(), |c| own * c.solve(&e.right)));
            off_std_rad.push(chol.map_or(Vector3::repeat(f64::NAN), |c| {
                (variance * c.inverse().diagonal()).map(f64::sqrt)
            }));
            whitened.push(chol.and_then(|c| {
                let white = c.l().solve_lower_triangular(&e.right)?;
                Some(own / variance.sqrt() * white)
            }));
        }
        let chi2: f64 = whitened.iter().flatten().map(Vector3::norm_squared).sum();
        let freedom = ((3 * frames) as f64 - 6.0).max(1.0);
        // Neighbouring frames whose codec errs alike are fewer than they are. What a line was taken from seems less alike than it is by
        // (2 + 4 ρ) / n (Kendall, Biometrika 41, 403, 1954).
        let pairs = whitened.windows(2).filter_map(|w| Some(w[0]?.dot(&w[1]?)));
        let seems = pairs.sum::<f64>() / chi2.max(f64::MIN_POSITIVE);
        let count = (frames as f64).max(8.0);
        let alike = ((seems + 2.0 / count) / (1.0 - 4.0 / count)).clamp(0.0, MOST_ALIKE);
        let fewer = (1.0 + alike) / (1.0 - alike);
        FramesScatter {
            off_rad,
            off_std_rad,
            scatter: ((chi2 / freedom).max(1.0) * fewer).sqrt(),
        }
    }

    /// By what the rates that parts of the disc show, in spans of the arc, scatter beyond noise; with `inverse` of the curvature.
    fn scatter_of_parts(
        &self,
        samples: &BallSamples,
        by_rate: &[Three],
        inverse: &Matrix3<f64>,
    ) -> Matrix3<f64> {
        let longest_s = samples.longest_s().max(f64::MIN_POSITIVE);
        let part = |sum: f64, of: f64, parts: usize| ((sum / of * parts as f64) as usize).min(parts - 1);
        let mut sums = vec![Three::default(); SECTORS * SPANS];
        for (i, &t) in samples.times_s.iter().enumerate() {
            let span = part(t + longest_s, 2.0 * longest_s, SPANS);
            for p in samples.of_frame(i) {
                let [a, b] = samples.places[p];
                let sector = part(b.atan2(a) + PI, TAU, SECTORS);
                sums[span * SECTORS + sector] += by_rate[p] * self.residuals[p];
            }
        }
        let parts = sums.len() as f64;
        let squares = OuterProducts::sum(&sums, &sums);
        let scattered = parts / (parts - 3.0) * inverse * squares * inverse;
        let variance = self.sum_squares / samples.values.len() as f64;
        scattered - variance * inverse
    }

    /// The fit that ended here, with `inverse` of its curvature: the covariance is what the frames' own scatter makes of that.
    fn with_scatter(
        self,
        samples: &BallSamples,
        rate: Vector3<f64>,
        inverse: Matrix3<f64>,
        by_parts: Matrix3<f64>,
        others_part: f64,
    ) -> RotationFit {
        let cross_validated = self.sum_squares / others_part.powi(2);
        let variance = self.sum_squares / samples.values.len() as f64;
        let FramesScatter {
            off_rad,
            off_std_rad,
            scatter,
        } = self.frames_scatter(samples, others_part);
        RotationFit {
            rate_rad_s: rate,
            covariance: scatter * scatter * variance * inverse,
            by_parts,
            maps: self.maps,
            off_std_rad: off_std_rad.into_iter().map(|s| scatter * s).collect(),
            off_rad,
            scatter,
            sum_squares: self.sum_squares,
            cross_validated,
            residual: variance.sqrt(),
            pixels: samples.values.len(),
        }
    }
}

/// Curvature of half of χ² (times the variance) by the rate, the maps fitted along.
struct FreeCurvature {
    matrix: Matrix3<f64>,
    /// What the maps take of a change of the rate.
    taken: MapChange<Three>,
}

/// What the frames show beyond a fitted rotation.
struct FramesScatter {
    off_rad: Vec<Vector3<f64>>,
    /// By the pixels alone.
    off_std_rad: Vec<Vector3<f64>>,
    /// Over what the pixels promise; at least 1.
    scatter: f64,
}

/// What pixels show that see the ball in `cells`, a list for each direction: the logarithm of their mean brightness.
fn seen_in(albedo: &[f32], cells: &[Vec<GridCell>], next: usize) -> Vec<f32> {
    let value = |cell: &GridCell| cell.value(albedo, next);
    match cells {
        [one, two] => {
            let both = one.iter().map(value).zip(two.iter().map(value));
            both.map(|(a, b)| 0.5 * (a + b) + ln_cosh(0.5 * (a - b)))
                .collect()
        }
        _ => cells.iter().flatten().map(value).collect(),
    }
}

/// ln cosh, to single precision.
fn ln_cosh(x: f32) -> f32 {
    let x = x.abs();
    if x < 0.1 {
        let square = x * x;
        return square * (0.5 - square * (1.0 / 12.0 - square * (1.0 / 45.0)));
    }
    x + (-2.0 * x).exp().ln_1p() - std::f32::consts::LN_2
}

fn residuals_of(samples: &BallSamples, grids: &FitGrids, maps: &BallMaps, turned: &TurnedBall) -> Vec<f32> {
    let (next, lit_next) = (grids.grid.side(), grids.disc.side());
    let mut residuals = seen_in(&maps.albedo, &turned.cells, next);
    for (i, gain) in maps.gains.iter().enumerate() {
        for p in samples.of_frame(i) {
            let light = grids.lit[p].value(&maps.light, lit_next);
            residuals[p] = samples.values[p] - gain - light - residuals[p];
        }
    }
    residuals
}
