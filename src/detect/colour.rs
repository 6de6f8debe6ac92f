//! Whether luma is enough to measure a ball on, and if not, which mixture of luma and chroma.
//!
//! The survey's frames are taken apart into blocks, in each of which Y, U and V have a mean. What differs from the median over all frames by
//! much more than noise is a thing; one that is small and full may be the ball. Where such things stand out in luma alone, as is usual, luma it is,
//! untouched. Where there are more frames that show one which luma hardly tells from what is behind it, and all three planes together do, the
//! plane to measure on is their linear discriminant: weights w = S⁻¹ d, with S the covariance of the blocks' noise and d the thing's
//! difference from what is behind it (Fisher 1936). Of all combinations it has the largest contrast against noise; noise of a block counts, not that
//! of a pixel, since chroma's is shared by the four pixels of a sample.
//!
//! Limits: things are looked for against the median of the survey, as the empty scene is; a picture that changes as a whole (a camera that
//! moves before a textured scene) has none, and stays with luma.

use super::background::{block_side_px, sum_blocks};
use super::noise::frame_noise_grey;
use crate::frames::{Chroma, ChromaGrid, ColourMix, Frame, Luma};
use crate::numeric::robust::{STD_OF_MEDIAN, lower_median, median};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use std::sync::Arc;

/// A plane to measure on, with what the centres found on it have to know.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColourChoice {
    /// The mixture.
    pub mix: ColourMix,
    /// What the ball differs by from what is behind it in luma, U and V, code values.
    pub difference: [f64; 3],
    /// What it differs by in the mixture, grey levels.
    pub contrast_grey: f64,
    /// Part of that which comes of chroma.
    pub chroma_share: f64,
    /// Variance of the mean of many pixels over what it would be were their noise independent.
    pub noise_area: f64,
    /// Standard uncertainty of where chroma lies, as far as it moves the mixture's edges: along columns and rows of the picture, px.
    pub place_std_px: (f64, f64),
}

/// Fewer frames have no median that is free of what moves.
const LEAST_FRAMES: usize = 5;

/// A block differs where one of its planes does by so many standard deviations, and ...
const BLOCK_SIGMAS: f32 = 8.0;
/// ... by so many code values.
const LEAST_CHANGE: f32 = 3.0;

/// Means of blocks are wrong by this at least, code values: quantisation by a codec.
const LEAST_BLOCK_STD: f64 = 0.3;

/// A picture in which more than this part of the blocks differs changes as a whole.
const MOST_CHANGED: f64 = 0.25;

/// Luma is enough where an edge stands out by so many of a pixel's standard deviations: on a ball of 10 px its noise then places a centre to some
/// hundredths of a pixel, which is what else is unknown of it; and ...
const ENOUGH_SIGMAS: f64 = 10.0;
/// ... by so many code values, for a codec's errors are larger than what it leaves of the noise.
const ENOUGH_GREY: f64 = 15.0;

/// Below that chroma is taken where it makes the contrast against noise so many times larger: its edges are half again as soft.
const LEAST_GAIN: f64 = 2.0;

/// Where a difference in chroma is smaller, code values, it may be the trace of a shadow, or a codec's.
const LEAST_COLOUR: f64 = 15.0;

/// Frames that have to agree.
const LEAST_AGREEING: usize = 2;

/// Frames that need colour for each that has a thing in luma.
const AGAINST_LUMA: usize = 2;

/// Things are of one colour where their differences, in units of noise, point the same way to this cosine.
const SAME_COLOUR: f64 = 0.85;

/// What the ball differs by in the mixture, grey levels, where noise and range allow: as in a good grey recording.
const WANTED_CONTRAST: f64 = 100.0;
/// Range of the mixture's scene and ball, grey levels.
const WANTED_RANGE: (f64, f64) = (12.0, 243.0);
/// Standard deviation of a block's noise in the mixture at most, grey levels.
const MOST_BLOCK_NOISE: f64 = 1.0;

/// Y, U and V of the blocks of a frame.
type BlockMeans = [Vec<f32>; 3];

/// The plane to measure on, by a survey of frames of which chroma lies as `grid` says; `None` for luma.
#[must_use]
pub fn choose(survey: &[&Frame], grid: Option<ChromaGrid>) -> Option<ColourChoice> {
    let grid = grid?;
    let chroma: Vec<Arc<Chroma>> = survey
        .iter()
        .map(|f| f.colour.as_ref().map(|c| c.chroma()))
        .collect::<Option<_>>()?;
    if survey.len() < LEAST_FRAMES || !chroma.iter().any(|c| c.shows()) {
        return None;
    }
    let lumas: Vec<&Luma> = survey.iter().map(|f| &f.luma).collect();
    let scene = BlockScene::new(&lumas, &chroma)?;
    let luma_noise = frame_noise_grey(&lumas);
    let things: Vec<Vec<Thing>> = scene.changes.par_iter().map(|c| scene.things(c)).collect();
    let enough = (ENOUGH_SIGMAS * luma_noise).max(ENOUGH_GREY);
    let inverse = scene.covariance.try_inverse()?;
    let luma_std = scene.covariance[(0, 0)].sqrt();
    let gains = |t: &Thing| {
        let whole = (t.difference.transpose() * inverse * t.difference)[(0, 0)].sqrt();
        whole > LEAST_GAIN * t.luma_size / luma_std
    };
    let is_coloured = |t: &Thing| t.difference[1].hypot(t.difference[2]) > LEAST_COLOUR;
    let needs_colour = |t: &&Thing| t.luma_size < enough && is_coloured(t) && gains(t);
    // What a codec leaves of a coloured thing where that was a moment ago shows in chroma alone.
    let seen_in_luma = f64::from(LEAST_CHANGE).max(f64::from(BLOCK_SIGMAS) * luma_std);
    let is_of_luma = |t: &Thing| t.luma_size > seen_in_luma && !needs_colour(&t);
    let by_luma = things.iter().filter(|f| f.iter().any(is_of_luma)).count();
    let difference = common_difference(&things, needs_colour, &inverse, by_luma)?;
    scene.choice(difference, &inverse, (&lumas, &chroma), luma_noise, grid)
}

/// The difference that the things of most frames have in common which need colour; `None` where there are not clearly more such frames than those with a
/// thing that luma shows.
fn common_difference(
    things: &[Vec<Thing>],
    needs_colour: impl Fn(&&Thing) -> bool,
    inverse: &Matrix3<f64>,
    by_luma: usize,
) -> Option<Vector3<f64>> {
    let root = inverse.cholesky()?.l().transpose();
    let of_frames: Vec<Vec<(Vector3<f64>, Vector3<f64>)>> = things
        .iter()
        .map(|frame| {
            let chosen = frame.iter().filter(&needs_colour);
            chosen
                .map(|t| (t.difference, (root * t.difference).normalize()))
                .collect()
        })
        .collect();
    let alike = |like: &Vector3<f64>| -> Vec<Vector3<f64>> {
        let of_frame = |frame: &Vec<(Vector3<f64>, Vector3<f64>)>| {
            let near = frame.iter().find(|(_, way)| way.dot(like) > SAME_COLOUR);
            near.map(|(difference, _)| *difference)
        };
        of_frames.iter().filter_map(of_frame).collect()
    };
    let groups = of_frames.iter().flatten().map(|(_, way)| alike(way));
    let group = groups.max_by_key(Vec::len)?;
    if group.len() < LEAST_AGREEING || group.len() <= AGAINST_LUMA * by_luma {
        return None;
    }
    let middle = |k: usize| {
        let mut values: Vec<f64> = group.iter().map(|d| d[k]).collect();
        median(&mut values).unwrap_or(0.0)
    };
    Some(Vector3::new(middle(0), middle(1), middle(2)))
}

/// A small, full region that differs from the scene.
#[derive(Debug, Clone, Copy)]
struct Thing {
    /// Median difference of its blocks in Y, U, V, code values.
    difference: Vector3<f64>,
    /// Median size of the difference in luma.
    luma_size: f64,
}

/// The scene and its changes, in blocks.
struct BlockScene {
    columns: usize,
    rows: usize,
    /// Medians over the frames.
    means: BlockMeans,
    /// Of each frame against them.
    changes: Vec<BlockMeans>,
    /// Of the noise of a block's Y, U and V.
    covariance: Matrix3<f64>,
}

impl BlockScene {
    fn new(lumas: &[&Luma], chroma: &[Arc<Chroma>]) -> Option<Self> {
        let first = lumas.first()?;
        let side = block_side_px(first.width, first.height);
        let (columns, rows) = (first.width / side, first.height / side);
        let blocks_of = |plane: &Luma, side: usize| {
            let across = plane.width / side;
            let sums = sum_blocks(plane, side);
            let part = 1.0 / (side * side) as f32;
            let lines =
                (0..rows).flat_map(|y| sums.get(y * across..y * across + columns).unwrap_or(&[]).to_vec());
            let means: Vec<f32> = lines.map(|s| part * f32::from(s)).collect();
            (means.len() == columns * rows).then_some(means)
        };
        let frames: Vec<BlockMeans> = lumas
            .par_iter()
            .zip(chroma)
            .map(|(luma, c)| {
                Some([
                    blocks_of(luma, side)?,
                    blocks_of(&c.u, side / 2)?,
                    blocks_of(&c.v, side / 2)?,
                ])
            })
            .collect::<Option<_>>()?;
        let median_of_block = |column: &mut Vec<f32>, k: usize, block: usize| {
            column.clear();
            column.extend(frames.iter().map(|f| f[k][block]));
            lower_median(column)
        };
        let means: BlockMeans = std::array::from_fn(|k| {
            let blocks = (0..columns * rows).into_par_iter();
            blocks
                .map_init(Vec::new, |column, block| median_of_block(column, k, block))
                .collect()
        });
        let changes: Vec<BlockMeans> = frames
            .into_par_iter()
            .map(|mut f| {
                for (now, scene) in f.iter_mut().zip(&means) {
                    now.iter_mut().zip(scene).for_each(|(n, s)| *n -= s);
                }
                f
            })
            .collect();
        let covariance = covariance(&changes)?;
        Some(Self {
            columns,
            rows,
            means,
            changes,
            covariance,
        })
    }

    /// The small, full things of a frame.
    fn things(&self, changes: &BlockMeans) -> Vec<Thing> {
        let limits: [f32; 3] =
            std::array::from_fn(|k| (BLOCK_SIGMAS * self.covariance[(k, k)].sqrt() as f32).max(LEAST_CHANGE));
        let differs = |block: usize| (0..3).any(|k| changes[k][block].abs() > limits[k]);
        let mut left: Vec<bool> = (0..self.columns * self.rows).map(differs).collect();
        let changed = left.iter().filter(|&&m| m).count();
        if changed as f64 > MOST_CHANGED * left.len() as f64 {
            return Vec::new();
        }
        let mut things = Vec::new();
        for seed in 0..left.len() {
            if left[seed] {
                let region = self.connected(seed, &mut left);
                if self.is_small_and_full(&region) {
                    things.push(Thing::of(&region, changes));
                }
            }
        }
        things
    }

    /// The blocks of `left` connected with `seed`, which are taken out.
    fn connected(&self, seed: usize, left: &mut [bool]) -> Vec<usize> {
        left[seed] = false;
        let mut region = vec![seed];
        let mut next = 0;
        while next < region.len() {
            let (x, y) = (region[next] % self.columns, region[next] / self.columns);
            next += 1;
            for row in y.saturating_sub(1)..(y + 2).min(self.rows) {
                for column in x.saturating_sub(1)..(x + 2).min(self.columns) {
                    let block = row * self.columns + column;
                    if std::mem::take(&mut left[block]) {
                        region.push(block);
                    }
                }
            }
        }
        region
    }

    /// Whether a region may be a ball, smeared perhaps: it is away from the border and fills what it spans.
    fn is_small_and_full(&self, region: &[usize]) -> bool {
        const LEAST_BLOCKS: usize = 4;
        const LONGEST: usize = 4;
        let of = |f: &dyn Fn(usize) -> usize| {
            let low = region.iter().map(|&b| f(b)).min().unwrap_or(0);
            let high = region.iter().map(|&b| f(b)).max().unwrap_or(0);
            (low, high, high - low + 1)
        };
        let (left, right, wide) = of(&|b| b % self.columns);
        let (top, bottom, high) = of(&|b| b / self.columns);
        let inside = left > 0 && top > 0 && right + 1 < self.columns && bottom + 1 < self.rows;
        let shape = wide.max(high) <= LONGEST * wide.min(high) && 2 * region.len() >= wide * high;
        let small = 2 * wide <= self.columns && 2 * high <= self.rows;
        inside && shape && small && region.len() >= LEAST_BLOCKS
    }

    /// The mixture for a ball that differs by `difference`.
    fn choice(
        &self,
        difference: Vector3<f64>,
        inverse: &Matrix3<f64>,
        (lumas, chroma): (&[&Luma], &[Arc<Chroma>]),
        luma_noise: f64,
        grid: ChromaGrid,
    ) -> Option<ColourChoice> {
        let way = (inverse * difference).normalize();
        let contrast = way.dot(&difference);
        let mixed = |k: usize| {
            let block = [&self.means[0], &self.means[1], &self.means[2]].map(|m| f64::from(m[k]));
            way.dot(&Vector3::from(block))
        };
        let mut levels: Vec<f64> = (0..self.means[0].len()).step_by(7).map(mixed).collect();
        levels.sort_by(f64::total_cmp);
        let at = |part: f64| levels.get((part * (levels.len() as f64 - 1.0)) as usize).copied();
        // The scene but for its rarest places, and the ball before the brightest and the darkest of them.
        let (low, high) = (at(0.005)?, at(0.995)? + contrast);
        let block_noise = (way.transpose() * self.covariance * way)[(0, 0)].sqrt();
        let scale = (WANTED_CONTRAST / contrast)
            .min((WANTED_RANGE.1 - WANTED_RANGE.0) / (high - low))
            .min(MOST_BLOCK_NOISE / block_noise);
        let weights = scale * way;
        let (u, v) = (weights[1], weights[2]);
        let mix = ColourMix {
            luma: weights[0],
            u,
            v,
            // Chroma's 128 is no part of the mixture.
            offset: 0.5 * (WANTED_RANGE.0 + WANTED_RANGE.1) - scale * 0.5 * (low + high) + 128.0 * (u + v),
        };
        let chroma_share = ((u * difference[1] + v * difference[2]) / (scale * contrast)).clamp(0.0, 1.0);
        let chroma_noise = chroma_noise(chroma, (u, v));
        let luma_variance = (weights[0] * luma_noise).powi(2);
        let samples = (grid.step.0 * grid.step.1) as f64;
        let noise_area = (luma_variance + samples * chroma_noise * chroma_noise)
            / (luma_variance + grid.variance_kept * chroma_noise * chroma_noise);
        let _ = lumas;
        let place = |std_px: f64| chroma_share * std_px;
        (scale.is_finite() && scale > 0.0).then_some(ColourChoice {
            mix,
            difference: difference.into(),
            contrast_grey: scale * contrast,
            chroma_share,
            noise_area: if noise_area.is_finite() {
                noise_area.max(1.0)
            } else {
                1.0
            },
            place_std_px: (place(grid.place_std_px.0), place(grid.place_std_px.1)),
        })
    }
}

impl Thing {
    fn of(region: &[usize], changes: &BlockMeans) -> Self {
        let middle = |k: usize, size: bool| {
            let values = region.iter().map(|&b| f64::from(changes[k][b]));
            let mut values: Vec<f64> = values.map(|x| if size { x.abs() } else { x }).collect();
            median(&mut values).unwrap_or(0.0)
        };
        Self {
            difference: Vector3::new(middle(0, false), middle(1, false), middle(2, false)),
            luma_size: middle(0, true),
        }
    }
}

/// Covariance of the noise of a block's three means, robustly: of blocks that stay within three standard deviations in each.
fn covariance(changes: &[BlockMeans]) -> Option<Matrix3<f64>> {
    const REACH: f32 = 3.0;
    let blocks = changes.first()?[0].len();
    let step = (blocks * changes.len() / 60_000).max(1);
    let chosen = || {
        changes.iter().flat_map(move |f| {
            (0..blocks)
                .step_by(step)
                .map(move |b| [f[0][b], f[1][b], f[2][b]])
        })
    };
    let stds: [f32; 3] = std::array::from_fn(|k| {
        let mut sizes: Vec<f32> = chosen().map(|c| c[k].abs()).collect();
        (STD_OF_MEDIAN as f32 * lower_median(&mut sizes)).max(LEAST_BLOCK_STD as f32)
    });
    let mut sum = Matrix3::zeros();
    let mut count = 0.0;
    for c in chosen() {
        if (0..3).all(|k| c[k].abs() <= REACH * stds[k]) {
            let c = Vector3::from(c.map(f64::from));
            sum += c * c.transpose();
            count += 1.0;
        }
    }
    let floor = Matrix3::identity() * LEAST_BLOCK_STD * LEAST_BLOCK_STD;
    (count > 10.0).then(|| sum / count + floor)
}

/// Standard deviation of a chroma sample's noise with these weights of U and V, by the differences of successive frames.
fn chroma_noise(chroma: &[Arc<Chroma>], (of_u, of_v): (f64, f64)) -> f64 {
    let mut sizes: Vec<f64> = Vec::new();
    for pair in chroma.windows(2) {
        let count = pair[0].u.data.len().min(pair[1].u.data.len());
        let step = (count / 5_000).max(1);
        sizes.extend((0..count).step_by(step).map(|i| {
            let change = |plane: fn(&Chroma) -> &Luma| {
                f64::from(plane(&pair[1]).data[i]) - f64::from(plane(&pair[0]).data[i])
            };
            (of_u * change(|c| &c.u) + of_v * change(|c| &c.v)).abs()
        }));
    }
    // Whole code values: below one of them the median says nothing.
    let rounding = 0.29 * of_u.hypot(of_v);
    (STD_OF_MEDIAN * median(&mut sizes).unwrap_or(0.0) / std::f64::consts::SQRT_2).max(rounding)
}
