//! Rates of rotation that a row of pictures of a ball may show, from all up to the alias limit, coarse to fine.
//!
//! What turns by the rotation vector φ between two frames brings the part of the ball seen in cell j of the first into cell k(j; φ) of the
//! second. Whether two cells show the same spot, of a prior scatter τ over noise σ, is a ratio of likelihoods that is a sum of products
//! of cells: with the products of all pairs of cells summed over all frames at each lag beforehand, a rotation costs one look-up a cell,
//! whatever the number of frames. At a lag of one frame a grid over all rotations is scored; the best are followed to twice
//! the lag at half the step, again and again, to the length of the arc. In the end all axes near the best are scored.
//!
//! Assumed: frames at nearly even times (the fit that follows knows their own), a ball that turns steadily, and an axis that stays.

use super::disc_map::DiscGrid;
use super::view::BallSamples;
use nalgebra::{Matrix3, Rotation3, Vector3};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Least size of a cell, radii.
const CELL: f64 = 0.15;

/// Part of τ² by which cells of the same spot differ on the coarse grids, beside noise: marks have edges.
const GRID_NOISE: f64 = 0.2;

/// Step of the first grid, rad.
const FIRST_STEP: f64 = 0.17;

/// Turns that differ by less over the arc are one, rad.
const PEAK: f64 = 0.6;

/// Turns a frame that differ by less belong to one peak, rad, and how many of them are followed and kept.
const ONE_PEAK: f64 = 0.2;
const FOLLOWED_OF_PEAK: usize = 6;
const MOST_OF_PEAK: usize = 2;

/// Step between the axes about which the ball may turn as fast as about the best, rad. A mark that comes back after a turn tells how fast it goes
/// round, whatever the axis; the first grids, which see it move by a little, may have led to a wrong one.
const AXIS_STEP: f64 = 0.1;

/// No cell of those in use.
const NO_CELL: u32 = u32::MAX;

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
    /// Directions of the cells in use.
    towards: Vec<Vector3<f32>>,
    /// Place among those of each node of the grid; [`NO_CELL`] where nothing is seen.
    index: Vec<u32>,
    side: usize,
    /// A lag each, from 1.
    lags: Vec<LagSums>,
    /// Scatter of the cells over the frames, and of that what is noise.
    pub signal_variance: f64,
    same: [f64; 3],
}

struct LagSums {
    /// Σ of products: row j (earlier), column k (later).
    products: Vec<f32>,
    /// Σ of squares of the earlier and the later.
    squares: [Vec<f32>; 2],
    pairs: f64,
}

impl LagProducts {
    /// Of the `residuals` of `samples`, whose light is taken away, at steps of `interval_s`, with pixels of `pixel` radii. Unless the ball is
    /// known to be `lit` so, each place's mean is taken away, too. `None` for a ball of too few pixels.
    pub fn new(
        samples: &BallSamples,
        residuals: &[f64],
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
                sums[at] += residuals[p];
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
        let mut index = vec![NO_CELL; grid.nodes()];
        let mut values = Vec::with_capacity(used.len());
        for (n, &k) in used.iter().enumerate() {
            index[k] = n as u32;
            let row = k * slots..(k + 1) * slots;
            let mut row: Vec<f32> = sums[row.clone()]
                .iter()
                .zip(&counts[row])
                .map(|(s, c)| if *c > 0.0 { (s / c) as f32 } else { 0.0 })
                .collect();
            let mean = if lit {
                0.0
            } else {
                row.iter().sum::<f32>() / seen(k) as f32
            };
            for v in row.iter_mut().filter(|v| **v != 0.0) {
                *v -= mean;
            }
            values.push(row);
        }
        let cells = used.len();
        if cells < 8 {
            return None;
        }
        let square: f64 = values.iter().flatten().map(|v| f64::from(v * v)).sum();
        let signal_variance = square / (cells as f64 * frames);
        let pixels_a_cell = samples.values.len() as f64 / (cells as f64 * frames);
        let noise = samples.noise.powi(2) / pixels_a_cell.max(1.0) + GRID_NOISE * signal_variance;
        let l = noise / signal_variance;
        let same = [
            2.0 / (noise * (2.0 + l)),
            (1.0 / (1.0 + l) - 1.0 / (2.0 + l)) / noise,
            (1.0 + 2.0 / l).ln() - 2.0 * (1.0 + 1.0 / l).ln(),
        ];
        let present: Vec<bool> = (0..slots)
            .map(|s| samples.times_s.iter().any(|&t| slot(t) == s))
            .collect();
        let lags = (1..slots).into_par_iter().map(|lag| {
            let mut products = vec![0.0f32; cells * cells];
            let n = slots - lag;
            for j in 0..cells {
                let early = &values[j][..n];
                for k in 0..cells {
                    let late = &values[k][lag..];
                    products[j * cells + k] = early.iter().zip(late).map(|(a, b)| a * b).sum();
                }
            }
            let both: Vec<bool> = (0..n).map(|i| present[i] && present[i + lag]).collect();
            let squares = |from: usize| -> Vec<f32> {
                let of = |v: &Vec<f32>| {
                    let row = v[from..from + n].iter().zip(&both);
                    row.map(|(v, b)| if *b { v * v } else { 0.0 }).sum()
                };
                values.iter().map(of).collect()
            };
            LagSums {
                products,
                squares: [squares(0), squares(lag)],
                pairs: both.iter().filter(|b| **b).count() as f64,
            }
        });
        let towards = used.iter().map(|&k| {
            let [a, b] = grid.place(k);
            Vector3::new(a as f32, b as f32, -(1.0 - a * a - b * b).max(0.0).sqrt() as f32)
        });
        Some(Self {
            interval_s,
            towards: towards.collect(),
            index,
            side: grid.side(),
            lags: lags.collect(),
            signal_variance,
            same,
        })
    }

    /// The cell in which a direction is seen.
    #[inline]
    fn cell(&self, d: &Vector3<f32>) -> Option<usize> {
        if d.z > 0.0 {
            return None;
        }
        let scale = 0.5 * (self.side - 1) as f32;
        let column = ((d.x + 1.0) * scale + 0.5) as u32;
        let row = ((d.y + 1.0) * scale + 0.5) as u32;
        let cell = self.index[row as usize * self.side + column as usize];
        (cell != NO_CELL).then_some(cell as usize)
    }

    /// Score of the rotation by `vector` a frame, by one lag and one in `every` cells.
    fn score_at(&self, vector: &Vector3<f64>, lag: usize, every: usize) -> f64 {
        let Some(of_lag) = self.lags.get(lag - 1) else {
            return 0.0;
        };
        let turn: Matrix3<f32> = Rotation3::new(lag as f64 * vector).into_inner().cast();
        let cells = self.towards.len();
        let [product, square, pair] = self.same;
        let (mut products, mut squares, mut pairs) = (0.0f32, 0.0f32, 0u32);
        let early = of_lag.products.chunks_exact(cells).zip(&of_lag.squares[0]);
        for ((row, early), d) in early.zip(&self.towards).step_by(every) {
            let Some(k) = self.cell(&(turn * d)) else {
                continue;
            };
            products += row[k];
            squares += early + of_lag.squares[1][k];
            pairs += 1;
        }
        product * f64::from(products) - square * f64::from(squares) - pair * of_lag.pairs * f64::from(pairs)
    }

    fn score(&self, vector: &Vector3<f64>, lags: &[usize], every: usize) -> f64 {
        lags.iter().map(|&lag| self.score_at(vector, lag, every)).sum()
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
        let mut found = self.scored(grid, &[1], SOME_CELLS);
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
            found = self.scored(around, &lags, SOME_CELLS);
        }
        let all: Vec<usize> = (1..=longest).collect();
        let mut found = self.scored(found.into_iter().map(|(v, _)| v).collect(), &all, 1);
        let others = found.first().into_iter().flat_map(|(v, _)| other_axes(v));
        let mut others = self.scored(others.collect(), &spread(longest), SOME_CELLS);
        others.truncate(FOLLOWED);
        found.extend(self.scored(others.into_iter().map(|(v, _)| v).collect(), &all, 1));
        found.sort_by(|a, b| b.1.total_cmp(&a.1));
        varied(found, PEAK / longest as f64, most, MOST_OF_PEAK)
            .into_iter()
            .map(|(v, score)| RotationCandidate {
                rate_rad_s: v / self.interval_s,
                score,
            })
            .collect()
    }

    fn scored(&self, vectors: Vec<Vector3<f64>>, lags: &[usize], every: usize) -> Vec<(Vector3<f64>, f64)> {
        let scored = vectors.into_par_iter().map(|v| (v, self.score(&v, lags, every)));
        let mut scored: Vec<(Vector3<f64>, f64)> = scored.collect();
        scored.sort_by(|a, b| b.1.total_cmp(&a.1));
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
