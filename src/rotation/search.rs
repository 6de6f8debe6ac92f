//! Rates of rotation that a row of pictures of a ball may show, from all up to the alias limit, coarse to fine.
//!
//! What turns by the rotation vector φ between two frames brings the part of the ball seen in cell j of the first into cell k(j; φ) of the
//! second. Whether two cells show the same spot, of a prior scatter τ over noise σ, is a ratio of likelihoods that is a sum of products
//! of cells: with the products of all pairs of cells summed over all frames at each lag beforehand, a rotation costs one look-up a cell,
//! whatever the number of frames. At a lag of one frame a grid over all rotations is scored; the best are followed to twice
//! the lag at half the step, again and again, to the length of the arc. In the end all axes near the best are scored.
//!
//! Assumed: frames at nearly even times (the fit that follows knows their own), a ball that turns steadily, and an axis that stays.

use super::cube_map::AT_ONCE;
use super::disc_map::DiscGrid;
use super::view::BallSamples;
use nalgebra::{Matrix3, Rotation3, Vector3};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};
use std::sync::OnceLock;

/// Least size of a cell, radii.
const CELL: f64 = 0.15;

/// Part of τ² by which cells of the same spot differ on the coarse grids, beside noise: marks have edges.
const GRID_NOISE: f64 = 0.2;

/// Step of the first grid, rad.
const FIRST_STEP: f64 = 0.17;

/// Turns that differ by less over the arc are one, rad.
const PEAK: f64 = 0.6;

/// Turns a frame that differ by less belong to one peak, rad, and how many of them are followed and kept.
pub const ONE_PEAK: f64 = 0.2;
const FOLLOWED_OF_PEAK: usize = 6;
const MOST_OF_PEAK: usize = 2;

/// Step between the axes about which the ball may turn as fast as about the best, rad. A mark that comes back after a turn tells how fast it goes
/// round, whatever the axis; the first grids, which see it move by a little, may have led to a wrong one.
const AXIS_STEP: f64 = 0.1;

/// A number of 24 bits has no places behind the point: added to a small one and taken away again, it rounds that to the nearest whole number.
const WHOLE: f32 = 8_388_608.0;

/// Candidates followed from one grid to the next.
const FOLLOWED: usize = 96;

/// One in so many cells scores a grid; all of them score what is left in the end.
const SOME_CELLS: usize = 2;

/// Lags that a grid is scored by, at most.
const LAGS: usize = 6;

/// A rotation vector per frame and its score: twice the logarithm of its likelihood over that of independent frames.
#[derive(Debug, Clone, Copy)]
pub struct RotationCandidate {
    /// Rate, rad/s.
    pub rate_rad_s: Vector3<f64>,
    /// Score.
    pub score: f64,
}

/// The pictures of an arc on one grid, and what all pairs of cells have in common.
pub struct LagProducts {
    /// Time between frames, s.
    interval_s: f64,
    /// Components of the directions of the cells in use, of which the first [`Self::some`] are spread over the ball.
    towards: [Vec<f32>; 3],
    some: usize,
    /// The cells' nodes on the grid.
    nodes: Vec<usize>,
    side: usize,
    /// Frame by frame, a value a cell; 0 where the frame is missing.
    frames: Vec<Vec<f32>>,
    is_present: Vec<bool>,
    /// A lag each, from 1; made when it is asked for.
    lags: Vec<OnceLock<LagScores>>,
    /// What a product, a square and a pair add to the score.
    same: [f32; 3],
}

/// What each cell's being the same spot as each node of the grid, a lag later, adds to the score: row of the cell (earlier), column of the node
/// (later); nothing for a node that is not in use, nor for the last column, which stands for the ball's far side.
struct LagScores(Vec<f32>);

impl LagProducts {
    /// Of the `residuals` of `samples`, whose light is taken away, at steps of `interval_s`, with pixels of `pixel` radii. Unless the ball is
    /// known to be `lit` so, each place's mean is taken away, too. `None` for a ball of too few pixels.
    pub fn new(
        samples: &BallSamples,
        residuals: &[f32],
        interval_s: f64,
        pixel: f64,
        lit: bool,
    ) -> Option<Self> {
        let grid = DiscGrid::with_spacing(CELL.max(pixel));
        let first_s = *samples.times_s.first()?;
        let slot = |t: f64| ((t - first_s) / interval_s).round() as usize;
        let slots = slot(*samples.times_s.last()?) + 1;
        let mut sums = vec![0.0f64; grid.nodes() * slots];
        let mut counts = vec![0.0f64; grid.nodes() * slots];
        for i in 0..samples.frames() {
            let s = slot(samples.times_s[i]);
            for p in samples.of_frame(i) {
                let corners = grid.corners(samples.places[p]);
                let nearest = corners.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
                let at = nearest.0 as usize * slots + s;
                sums[at] += f64::from(residuals[p]);
                counts[at] += 1.0;
            }
        }
        let frames = samples.frames() as f64;
        let seen = |k: usize| {
            counts[k * slots..(k + 1) * slots]
                .iter()
                .filter(|c| **c > 0.0)
                .count() as f64
        };
        let used: Vec<usize> = (0..grid.nodes()).filter(|&k| seen(k) >= 0.7 * frames).collect();
        // First one in so many, which are spread over the ball.
        let rest = (0..used.len()).filter(|n| n % SOME_CELLS != 0);
        let order = (0..used.len()).step_by(SOME_CELLS).chain(rest);
        let used: Vec<usize> = order.map(|n| used[n]).collect();
        let cells = used.len();
        if cells < 8 {
            return None;
        }
        let mut by_frame = vec![vec![0.0f32; cells]; slots];
        for (n, &k) in used.iter().enumerate() {
            let row = k * slots..(k + 1) * slots;
            let mean_of = |(s, c): (&f64, &f64)| if *c > 0.0 { (s / c) as f32 } else { 0.0 };
            let row: Vec<f32> = sums[row.clone()].iter().zip(&counts[row]).map(mean_of).collect();
            let mean = if lit {
                0.0
            } else {
                row.iter().sum::<f32>() / seen(k) as f32
            };
            for (frame, v) in by_frame.iter_mut().zip(row).filter(|(_, v)| *v != 0.0) {
                frame[n] = v - mean;
            }
        }
        let square: f64 = by_frame.iter().flatten().map(|v| f64::from(v * v)).sum();
        let signal_variance = square / (cells as f64 * frames);
        let pixels_a_cell = samples.values.len() as f64 / (cells as f64 * frames);
        let noise = samples.noise.powi(2) / pixels_a_cell.max(1.0) + GRID_NOISE * signal_variance;
        let l = noise / signal_variance;
        let same = [
            2.0 / (noise * (2.0 + l)),
            (1.0 / (1.0 + l) - 1.0 / (2.0 + l)) / noise,
            (1.0 + 2.0 / l).ln() - 2.0 * (1.0 + 1.0 / l).ln(),
        ];
        let is_present = (0..slots).map(|s| samples.times_s.iter().any(|&t| slot(t) == s));
        let direction = |k: usize| {
            let [a, b] = grid.place(k);
            [a, b, -(1.0 - a * a - b * b).max(0.0).sqrt()]
        };
        Some(Self {
            interval_s,
            towards: std::array::from_fn(|c| used.iter().map(|&k| direction(k)[c] as f32).collect()),
            some: cells.div_ceil(SOME_CELLS),
            nodes: used,
            side: grid.side(),
            frames: by_frame,
            is_present: is_present.collect(),
            lags: (1..slots).map(|_| OnceLock::new()).collect(),
            same: same.map(|x| x as f32),
        })
    }

    fn cells(&self) -> usize {
        self.nodes.len()
    }

    /// The scores of pairs of cells `lag` frames apart; `None` beyond the arc.
    fn of_lag(&self, lag: usize) -> Option<&LagScores> {
        Some(self.lags.get(lag - 1)?.get_or_init(|| self.scores_at_lag(lag)))
    }

    fn scores_at_lag(&self, lag: usize) -> LagScores {
        let cells = self.cells();
        let (mut products, mut squares) = (
            vec![0.0f32; cells * cells],
            [vec![0.0f32; cells], vec![0.0; cells]],
        );
        let mut pairs = 0.0f32;
        for t in (0..self.frames.len() - lag).filter(|t| self.is_present[*t] && self.is_present[t + lag]) {
            let (early, late) = (&self.frames[t], &self.frames[t + lag]);
            pairs += 1.0;
            for (row, &e) in products.chunks_exact_mut(cells).zip(early) {
                for (sum, l) in row.iter_mut().zip(late) {
                    *sum += e * l;
                }
            }
            for (sums, values) in squares.iter_mut().zip([early, late]) {
                for (sum, v) in sums.iter_mut().zip(values) {
                    *sum += v * v;
                }
            }
        }
        let [product, square, pair] = self.same;
        let columns = self.columns();
        let mut scores = vec![0.0f32; cells * columns];
        for (j, row) in scores.chunks_exact_mut(columns).enumerate() {
            for (k, &node) in self.nodes.iter().enumerate() {
                let both = squares[0][j] + squares[1][k];
                row[node] = product * products[j * cells + k] - square * both - pair * pairs;
            }
        }
        LagScores(scores)
    }

    fn columns(&self) -> usize {
        self.side * self.side + 1
    }

    /// Score of the rotation by `vector` between the frames of `scores`, by the first `cells` cells.
    fn score_of_turn(&self, scores: &LagScores, vector: &Vector3<f64>, cells: usize) -> f64 {
        let turn: Matrix3<f32> = Rotation3::new(*vector).into_inner().cast();
        let scale = 0.5 * (self.side - 1) as f32;
        let (side, columns) = (self.side as f32, self.columns());
        let far = (columns - 1) as f32;
        let [x, y, z] = self.towards.each_ref().map(|c| &c[..cells]);
        // In steps of some cells: their places side by side first, then the look-ups.
        let mut nodes = [0u32; AT_ONCE];
        let mut scored = [0.0f32; AT_ONCE];
        let parts = x.chunks(AT_ONCE).zip(y.chunks(AT_ONCE)).zip(z.chunks(AT_ONCE));
        for (((x, y), z), rows) in parts.zip(scores.0.chunks(AT_ONCE * columns)) {
            for (((node, x), y), z) in nodes.iter_mut().zip(x).zip(y).zip(z) {
                let along = |row: usize| turn[(row, 0)] * x + turn[(row, 1)] * y + turn[(row, 2)] * z;
                let at = |along: f32| (along + 1.0) * scale + WHOLE - WHOLE;
                let seen = at(along(1)) * side + at(along(0));
                let node_or_far = if along(2) > 0.0 { far } else { seen };
                *node = (node_or_far + WHOLE).to_bits().wrapping_sub(WHOLE.to_bits());
            }
            let here = nodes[..x.len()].iter().zip(rows.chunks_exact(columns));
            for (scored, (node, row)) in scored.iter_mut().zip(here) {
                *scored += row[*node as usize];
            }
        }
        f64::from(scored.iter().sum::<f32>())
    }

    /// The rates with the best scores, best first, no two closer than the arc tells apart; none where independent frames are likelier than any.
    pub fn best(&self, most: usize) -> Vec<RotationCandidate> {
        let longest = self.lags.len();
        let mut step = FIRST_STEP;
        let steps = (PI / step).ceil() as i32;
        let axis = -steps..=steps;
        let grid: Vec<Vector3<f64>> = axis
            .clone()
            .flat_map(|i| axis.clone().map(move |j| (i, j)))
            .flat_map(|(i, j)| {
                axis.clone()
                    .map(move |k| step * Vector3::new(i.into(), j.into(), k.into()))
            })
            .filter(|v| v.norm() <= PI + step)
            .collect();
        let mut found = self.scored(grid, &[1], self.some);
        let mut lag = 1;
        loop {
            found = varied(found, 0.9 * step, FOLLOWED, FOLLOWED_OF_PEAK);
            // Of the longest lags there are few pairs of frames, which may say little.
            if 2 * lag <= longest && found.first().is_none_or(|(_, score)| *score <= 0.0) {
                return Vec::new();
            }
            if lag >= longest && step * longest as f64 <= FIRST_STEP {
                break;
            }
            lag = (2 * lag).min(longest);
            step *= 0.5;
            let lags = spread(lag);
            // All of them lie on one lattice, and neighbours of neighbours are the same.
            let on_lattice = |v: Vector3<f64>| (v / step).map(|x| x.round() as i32);
            let mut around: Vec<Vector3<f64>> = found
                .iter()
                .flat_map(|(v, _)| neighbours(*v, step))
                .filter(|v| v.norm() <= PI + 2.0 * step)
                .collect();
            around.sort_by_key(|v| <[i32; 3]>::from(on_lattice(*v)));
            around.dedup_by_key(|v| on_lattice(*v));
            found = self.scored(around, &lags, self.some);
        }
        let all: Vec<usize> = (1..=longest).collect();
        let by_all = |some: Vec<(Vector3<f64>, f64)>| {
            let vectors = some.into_iter().map(|(v, _)| v).collect();
            self.scored(vectors, &all, self.cells())
        };
        let mut found = by_all(varied(found, 0.9 * step, FOLLOWED, FOLLOWED_OF_PEAK));
        let others = found.first().into_iter().flat_map(|(v, _)| other_axes(v));
        let mut others = self.scored(others.collect(), &spread(longest), self.some);
        others.truncate(FOLLOWED);
        found.extend(by_all(others));
        found.sort_by(|a, b| b.1.total_cmp(&a.1));
        varied(found, PEAK / longest as f64, most, MOST_OF_PEAK)
            .into_iter()
            .map(|(v, score)| RotationCandidate {
                rate_rad_s: v / self.interval_s,
                score,
            })
            .collect()
    }

    /// The rotation `vectors` a frame with their scores by some `lags` and the first `cells` cells, best first.
    fn scored(&self, vectors: Vec<Vector3<f64>>, lags: &[usize], cells: usize) -> Vec<(Vector3<f64>, f64)> {
        let of_lags: Vec<(f64, &LagScores)> = lags
            .par_iter()
            .filter_map(|&lag| Some((lag as f64, self.of_lag(lag)?)))
            .collect();
        let score = |v: &Vector3<f64>| -> f64 {
            of_lags
                .iter()
                .map(|(lag, scores)| self.score_of_turn(scores, &(*lag * v), cells))
                .sum()
        };
        let scored = vectors.into_par_iter().map(|v| (v, score(&v)));
        let mut scored: Vec<(Vector3<f64>, f64)> = scored.collect();
        scored.par_sort_by(|a, b| b.1.total_cmp(&a.1));
        scored
    }
}

/// Rotations by as much as `v` about axes within a right angle of its own.
fn other_axes(v: &Vector3<f64>) -> impl Iterator<Item = Vector3<f64>> + use<> {
    let angle = v.norm();
    let half_turn = || Rotation3::from_axis_angle(&Vector3::x_axis(), PI);
    let to_axis = Rotation3::rotation_between(&Vector3::z(), v).unwrap_or_else(half_turn);
    let rings = (0.5 * PI / AXIS_STEP) as usize;
    let ring = move |i: usize| {
        let polar = AXIS_STEP * i as f64;
        let around = (TAU * polar.sin() / AXIS_STEP).ceil() as usize;
        let place = move |k: usize| {
            let azimuth = TAU * k as f64 / around as f64;
            Vector3::new(
                polar.sin() * azimuth.cos(),
                polar.sin() * azimuth.sin(),
                polar.cos(),
            )
        };
        (0..around).map(place)
    };
    (1..=rings).flat_map(ring).map(move |d| angle * (to_axis * d))
}

/// Up to [`LAGS`] lags from 1 to `longest`, denser at the long end.
fn spread(longest: usize) -> Vec<usize> {
    let mut lags: Vec<usize> = (0..LAGS)
        .map(|i| (longest as f64 * (1.0 - i as f64 / LAGS as f64)).round().max(1.0) as usize)
        .collect();
    lags.dedup();
    lags
}

/// `v` and the 26 around it.
fn neighbours(v: Vector3<f64>, step: f64) -> impl Iterator<Item = Vector3<f64>> {
    let axis = -1..=1;
    axis.clone()
        .flat_map(move |i| axis.clone().map(move |j| (i, j)))
        .flat_map(|(i, j)| (-1..=1).map(move |k| (i, j, k)))
        .map(move |(i, j, k)| v + step * Vector3::new(f64::from(i), f64::from(j), f64::from(k)))
}

/// The best of `sorted` candidates that are more than `least` from better ones, no more than `of_peak` of each peak: a flat one must not
/// fill the list.
fn varied(
    sorted: Vec<(Vector3<f64>, f64)>,
    least: f64,
    most: usize,
    of_peak: usize,
) -> Vec<(Vector3<f64>, f64)> {
    let mut kept: Vec<(Vector3<f64>, f64)> = Vec::new();
    for (v, score) in sorted {
        let within = |distance: f64| kept.iter().filter(|(k, _)| (v - k).norm() < distance).count();
        if within(least) == 0 && within(ONE_PEAK) < of_peak {
            kept.push((v, score));
            if kept.len() == most {
                break;
            }
        }
    }
    kept
}
