//! The linear part of a rotation's fit: the maps that suit the pixels best at one rate, and what they take of a change of the rate.
//!
//! ```text
//! minimum of Σ (residual − light − albedo − gain)² + HELD Σ albedo²
//! ```
//!
//! over the nodes of both maps and a gain that is a parabola in time, by conjugate gradients (Hestenes and Stiefel, J. Res. Nat. Bur. Stand. 49, 409, 1952),
//! each node over what pixels weigh there. Where a ball turns little, its marks are hardly told from its light, and what tells them apart comes
//! last: rounds that end before that make a rate seem surer than it is, and its steps too short.

use super::cube_map::{CubeGrid, GridCell, value_at};
use super::disc_map::DiscGrid;
use super::map_value::{MapValue, Three, sum_of_products};
use super::view::BallSamples;
use nalgebra::{Matrix3, Vector3};

/// Rounds at most.
const ROUNDS: usize = 40;

/// The part of others in a pixel's value, at least: of a ball that is all nodes, nothing is left.
const LEAST_OTHERS: f64 = 0.1;

/// A node that pixels of more than this weight have seen is fitted to these more than to its neighbours.
const BY_ITSELF: f32 = 0.5;

/// Weight of the prior that a node of the ball's map is like the rest, in pixels: marks stand far above the noise.
const HELD: f32 = 0.05;

/// The maps of a ball.
#[derive(Debug, Clone)]
pub struct BallMaps {
    /// The ball's grid.
    pub grid: CubeGrid,
    /// Logarithm of the albedo at its nodes.
    pub albedo: Vec<f32>,
    /// Weight of the pixels that each node has seen.
    pub seen: Vec<f32>,
    /// The light's grid.
    pub disc: DiscGrid,
    /// Logarithm of the light at its nodes.
    pub light: Vec<f32>,
    /// Of each frame's brightness.
    pub gains: Vec<f32>,
}

impl BallMaps {
    /// The same with the ball on another grid.
    #[must_use]
    pub fn on(&self, grid: CubeGrid) -> Self {
        let there = |k: usize| value_at(&self.albedo, &self.grid.corners(&grid.direction(k)));
        Self {
            grid,
            albedo: (0..grid.nodes()).map(there).collect(),
            ..self.clone()
        }
    }

    /// Root mean square of the albedo's logarithm about its mean, where the ball was seen.
    #[must_use]
    pub fn contrast(&self) -> f64 {
        let as_f64 = |(a, w): (&f32, &f32)| (f64::from(*a), f64::from(*w));
        let all = || self.albedo.iter().zip(&self.seen).map(as_f64);
        let weight = all().map(|(_, w)| w).sum::<f64>().max(f64::MIN_POSITIVE);
        let mean = all().map(|(a, w)| w * a).sum::<f64>() / weight;
        (all().map(|(a, w)| w * (a - mean).powi(2)).sum::<f64>() / weight).sqrt()
    }
}

/// A change of a ball's maps.
pub struct MapChange<T> {
    albedo: Vec<T>,
    light: Vec<T>,
    gains: [T; 3],
}

impl<T: MapValue> MapChange<T> {
    fn each(&mut self, other: &Self, change: impl Fn(&mut T, T)) {
        let pairs = self.albedo.iter_mut().zip(&other.albedo);
        let pairs = pairs.chain(self.light.iter_mut().zip(&other.light));
        let pairs = pairs.chain(self.gains.iter_mut().zip(&other.gains));
        pairs.for_each(|(own, other)| change(own, *other));
    }

    fn dot(&self, other: &Self) -> T {
        sum_of_products(&self.albedo, &other.albedo)
            + sum_of_products(&self.light, &other.light)
            + sum_of_products(&self.gains, &other.gains)
    }
}

impl MapChange<Three> {
    /// What goes with a `step` of the rate, so that what the pixels show stays; of a change by each component of the rate.
    #[must_use]
    pub fn against(&self, step: &Vector3<f64>) -> MapChange<f32> {
        let step = Three::of(step);
        let against = |taken: &[Three]| taken.iter().map(|t| -t.dot(step)).collect();
        MapChange {
            albedo: against(&self.albedo),
            light: against(&self.light),
            gains: self.gains.map(|t| -t.dot(step)),
        }
    }
}

impl MapChange<f32> {
    /// Changes the `maps` of a ball seen in frames whose gains have these `terms`.
    pub fn apply(&self, maps: &mut BallMaps, gains: &GainTerms) {
        maps.albedo
            .iter_mut()
            .zip(&self.albedo)
            .for_each(|(m, d)| *m += d);
        maps.light.iter_mut().zip(&self.light).for_each(|(m, d)| *m += d);
        let frames = maps.gains.iter_mut().zip(&gains.terms);
        frames.for_each(|(gain, x)| *gain += at(&self.gains, x));
    }
}

/// The frames' brightness as a parabola in time: light changes smoothly along a path. (A gain free in every frame would take the marks' own share, of halves
/// of two colours most of it.)
#[derive(Debug, Clone)]
pub struct GainTerms {
    /// Of each frame: 1, its time and the square of that, in units of the longest.
    terms: Vec<Vector3<f32>>,
    /// Inverse of the normal matrix of a parabola through all pixels.
    inverse: Matrix3<f32>,
}

impl GainTerms {
    /// Of the frames of `samples`.
    #[must_use]
    pub fn new(samples: &BallSamples) -> Self {
        let longest_s = samples.longest_s().max(f64::MIN_POSITIVE);
        let term = |t_s: &f64| {
            let t = t_s / longest_s;
            Vector3::new(1.0, t, t * t)
        };
        let terms: Vec<Vector3<f64>> = samples.times_s.iter().map(term).collect();
        let mut matrix: Matrix3<f64> = 1e-6 * Matrix3::identity();
        for (i, x) in terms.iter().enumerate() {
            matrix += samples.of_frame(i).len() as f64 * x * x.transpose();
        }
        Self {
            terms: terms.into_iter().map(|x| x.cast()).collect(),
            inverse: matrix.try_inverse().unwrap_or_else(Matrix3::zeros).cast(),
        }
    }

    /// Moves what the residuals have in common with a parabola into the frames' gains.
    pub fn take(&self, samples: &BallSamples, residuals: &mut [f32], gains: &mut [f32]) {
        let mut sums = [0.0; 3];
        for (i, x) in self.terms.iter().enumerate() {
            let sum: f32 = residuals[samples.of_frame(i)].iter().sum();
            sums.iter_mut().zip(x).for_each(|(own, x)| *own += sum * x);
        }
        let found = self.fitted(&sums);
        for (i, (gain, x)) in gains.iter_mut().zip(&self.terms).enumerate() {
            let part = at(&found, x);
            *gain += part;
            for r in &mut residuals[samples.of_frame(i)] {
                *r -= part;
            }
        }
    }

    fn fitted<T: MapValue>(&self, sums: &[T; 3]) -> [T; 3] {
        [0, 1, 2].map(|k| at(sums, &self.inverse.column(k).into_owned()))
    }
}

/// The parabola of these coefficients at a frame.
fn at<T: MapValue>(coefficients: &[T; 3], x: &Vector3<f32>) -> T {
    coefficients[0] * x[0] + coefficients[1] * x[1] + coefficients[2] * x[2]
}

/// Where samples lie in the grid of a map, and what they weigh at its nodes.
#[derive(Clone, Copy)]
pub struct OnMap<'a> {
    /// Of each sample: a list for each of its directions.
    pub cells: &'a [Vec<GridCell>],
    /// At each node.
    pub weights: &'a [f32],
    /// Nodes in a row.
    pub next: usize,
}

/// Pixels of a frame that are added to a map's nodes one after the other lie this part of the frame apart: a sum that was only just stored is not at hand.
const APART: usize = 4;

/// Adds `part` of each of the `values` at the `cells` to the nodes of `sums`.
fn add_all<T: MapValue>(sums: &mut [T], next: usize, cells: &[GridCell], values: &[T], part: f32) {
    let step = cells.len() / APART;
    let (even, rest) = cells.split_at(APART * step);
    let (even_values, rest_values) = values.split_at(APART * step);
    for k in 0..step {
        for i in 0..APART {
            let p = i * step + k;
            even[p].add(sums, next, even_values[p] * part);
        }
    }
    for (cell, r) in rest.iter().zip(rest_values) {
        cell.add(sums, next, *r * part);
    }
}

/// The maps that pixels are held against.
pub struct MapProblem<'a> {
    /// The pixels.
    pub samples: &'a BallSamples,
    /// The ball's map.
    pub ball: OnMap<'a>,
    /// The light's, or that it is known.
    pub light: Option<OnMap<'a>>,
    /// Their brightness.
    pub gains: &'a GainTerms,
    /// A round that makes the sum of squares less by no more than this part is the last.
    pub least_part: f32,
}

impl MapProblem<'_> {
    /// Moves what the `residuals` have in common at the nodes of the maps into a change of these, which goes on from the ball's map `held` at 0.
    pub fn solve<T: MapValue>(&self, residuals: &mut [T], held: &[T]) -> MapChange<T> {
        let (mut change, mut direction) = (self.nothing(), self.nothing());
        let mut shown = vec![T::default(); residuals.len()];
        let mut before = None;
        for _ in 0..ROUNDS {
            let downhill = self.downhill(residuals, held, &change);
            let by_weight = self.over_weights(&downhill);
            let slope = downhill.dot(&by_weight);
            let kept = before.map_or_else(T::default, |before| slope.over(before));
            direction.each(&by_weight, |own, new| *own = new + own.times(kept));
            let squares = self.show(&direction, &mut shown);
            let prior = sum_of_products(&direction.albedo, &direction.albedo);
            let step = slope.over(squares + prior * HELD);
            change.each(&direction, |own, d| *own += d.times(step));
            let of_pixels = residuals.iter_mut().zip(&shown);
            of_pixels.for_each(|(r, d)| *r -= d.times(step));
            let left = sum_of_products(residuals, residuals);
            if slope.times(step).is_at_most(self.least_part, left) {
                break;
            }
            before = Some(slope);
        }
        change
    }

    /// The part that other pixels have in the maps' values at a pixel, on average: what is left of noise when the maps are fitted to it. (Within 0.03 of what
    /// fits to noise leave; of maps with a node for every second pixel, within 0.1.)
    #[must_use]
    pub fn others_part(&self) -> f64 {
        let maps = self.light.iter().chain([&self.ball]);
        let own: f64 = maps
            .flat_map(|map| map.weights)
            .map(|w| f64::from(w / (w + BY_ITSELF)))
            .sum();
        (1.0 - own / self.samples.values.len() as f64).max(LEAST_OTHERS)
    }

    fn nothing<T: MapValue>(&self) -> MapChange<T> {
        let of = |map: &OnMap<'_>| vec![T::default(); map.weights.len()];
        MapChange {
            albedo: of(&self.ball),
            light: self.light.as_ref().map_or_else(Vec::new, of),
            gains: [T::default(); 3],
        }
    }

    /// What the pixels show of a change, and Σ of the squares of that.
    fn show<T: MapValue>(&self, change: &MapChange<T>, shown: &mut [T]) -> T {
        let mut squares = T::default();
        for (i, x) in self.gains.terms.iter().enumerate() {
            let frame = self.samples.of_frame(i);
            let of_frame = &mut shown[frame.clone()];
            of_frame.fill(at(&change.gains, x));
            let of_light = self.light.iter().zip([&change.light]);
            for (map, values) in of_light.chain([(&self.ball, &change.albedo)]) {
                let part = 1.0 / map.cells.len() as f32;
                for cells in map.cells {
                    for (s, cell) in of_frame.iter_mut().zip(&cells[frame.clone()]) {
                        *s += cell.value(values, map.next) * part;
                    }
                }
            }
            squares += sum_of_products(of_frame, of_frame);
        }
        squares
    }

    /// Half the slope of the sum of squares, downwards.
    fn downhill<T: MapValue>(&self, residuals: &[T], held: &[T], change: &MapChange<T>) -> MapChange<T> {
        let mut sums = self.nothing();
        for (i, x) in self.gains.terms.iter().enumerate() {
            let frame = self.samples.of_frame(i);
            let of_frame = &residuals[frame.clone()];
            let sum = of_frame.iter().fold(T::default(), |sum, r| sum + *r);
            sums.gains.iter_mut().zip(x).for_each(|(own, x)| *own += sum * *x);
            let of_light = self.light.iter().zip([&mut sums.light]);
            for (map, sums) in of_light.chain([(&self.ball, &mut sums.albedo)]) {
                let part = 1.0 / map.cells.len() as f32;
                for cells in map.cells {
                    add_all(sums, map.next, &cells[frame.clone()], of_frame, part);
                }
            }
        }
        let prior = held.iter().zip(&change.albedo);
        for (sum, (held, change)) in sums.albedo.iter_mut().zip(prior) {
            *sum -= (*held + *change) * HELD;
        }
        sums
    }

    fn over_weights<T: MapValue>(&self, sums: &MapChange<T>) -> MapChange<T> {
        let over = |sums: &[T], map: &OnMap<'_>, held: f32| -> Vec<T> {
            let each = sums.iter().zip(map.weights);
            each.map(|(s, w)| *s * (1.0 / (w + held).max(1e-9))).collect()
        };
        let light = self.light.as_ref();
        MapChange {
            albedo: over(&sums.albedo, &self.ball, HELD),
            light: light.map_or_else(Vec::new, |map| over(&sums.light, map, 0.0)),
            gains: self.gains.fitted(&sums.gains),
        }
    }
}
