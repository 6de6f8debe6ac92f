//! The parts of the picture that an exposure changes: which pixels, their cells on the fine grid, and the light of those brought
//! back to the pixels.
//!
//! A ball, its shadow and its image in the floor may lie far from each other. What lies between them does not change, so that
//! each has a region of its own; things whose regions overlap share one, as there the order in which they are painted counts.

use super::fine_grid::{CellPlaces, FineGrid};
use super::{Backdrop, gaussian_below};
use nalgebra::Vector2;
use std::ops::Range;

/// Standard deviations after which blur is over.
const BLUR_REACH: f64 = 5.0;

/// A box of the picture, px.
#[derive(Debug, Clone, Copy)]
pub(super) struct PictureBox {
    /// Its smallest corner.
    pub low: Vector2<f64>,
    /// Its largest corner.
    pub high: Vector2<f64>,
}

impl PictureBox {
    /// The smallest box around both.
    pub fn with(self, other: Self) -> Self {
        Self {
            low: self.low.inf(&other.low),
            high: self.high.sup(&other.high),
        }
    }

    /// The smallest box around all of `boxes`; `None` of none.
    pub fn around(boxes: impl Iterator<Item = Self>) -> Option<Self> {
        boxes.reduce(Self::with)
    }
}

/// Pixels that an exposure changes, and by what.
pub(super) struct ExposedRegion {
    /// First and one past the last pixel.
    pub columns: Range<usize>,
    pub rows: Range<usize>,
    /// What is in it, as numbers of things in the order in which they are painted.
    pub things: Vec<usize>,
    /// Where they are during the exposure.
    reached: PictureBox,
}

impl ExposedRegion {
    /// The regions of things that are in `boxes` during the exposure (`None` where a thing is nowhere), whose pixels are
    /// `shift_px` beside that. Things outside the picture have none.
    pub fn all(
        boxes: impl Iterator<Item = Option<PictureBox>>,
        blur_px: f64,
        shift_px: Vector2<f64>,
        backdrop: &Backdrop,
    ) -> Vec<Self> {
        let margin = (BLUR_REACH * blur_px + 0.5).ceil() + 1.0;
        let clip = |from: f64, to: f64, size: usize| {
            let from = (from - margin).floor().max(0.0);
            let to = (to + margin).ceil().min(size as f64 - 1.0);
            (from <= to).then_some(from as usize..to as usize + 1)
        };
        let mut regions: Vec<Self> = Vec::new();
        for (thing, reached) in boxes.enumerate() {
            let Some(reached) = reached else { continue };
            let seen = PictureBox {
                low: reached.low + shift_px,
                high: reached.high + shift_px,
            };
            let (Some(columns), Some(rows)) = (
                clip(seen.low.x, seen.high.x, backdrop.width),
                clip(seen.low.y, seen.high.y, backdrop.height),
            ) else {
                continue;
            };
            let mut region = Self {
                columns,
                rows,
                things: vec![thing],
                reached,
            };
            // One that has grown may overlap another that it did not before.
            while let Some(other) = regions.iter().position(|other| region.overlaps(other)) {
                region.take_in(regions.swap_remove(other));
            }
            regions.push(region);
        }
        regions
    }

    fn overlaps(&self, other: &Self) -> bool {
        let meet = |a: &Range<usize>, b: &Range<usize>| a.start < b.end && b.start < a.end;
        meet(&self.columns, &other.columns) && meet(&self.rows, &other.rows)
    }

    fn take_in(&mut self, other: Self) {
        let hull = |a: &Range<usize>, b: &Range<usize>| a.start.min(b.start)..a.end.max(b.end);
        self.columns = hull(&self.columns, &other.columns);
        self.rows = hull(&self.rows, &other.rows);
        self.reached = self.reached.with(other.reached);
        self.things.extend(other.things);
        self.things.sort_unstable();
    }

    /// The empty scene on the fine grid where the things are, by the points that a picture shifted by `shift_px` shows there:
    /// whole pixels, and none that are too far from the region for their light to reach it.
    pub fn patch(&self, backdrop: &Backdrop, weights: &CellWeights, shift_px: Vector2<f64>) -> FineGrid {
        let cells = weights.cells;
        let side = 1.0 / cells as f64;
        let origin = Vector2::repeat(0.5 * side - 0.5) - shift_px;
        // Pixels that the cells of the things, and one more on each side, are in.
        let near = |low: f64, high: f64, seen: &Range<usize>| -> Range<i64> {
            let from = ((low - side).round() as i64).max(seen.start as i64 - weights.reach as i64);
            let to = ((high + side).round() as i64).min((seen.end + weights.reach) as i64 - 1);
            from..(to + 1).max(from)
        };
        let (low, high) = (self.reached.low + shift_px, self.reached.high + shift_px);
        let (columns, rows) = (
            near(low.x, high.x, &self.columns),
            near(low.y, high.y, &self.rows),
        );
        // Beyond the picture its edge goes on.
        let pixel = |i: i64, size: usize| i.clamp(0, size as i64 - 1) as usize;
        let width = (columns.end - columns.start) as usize * cells;
        let height = (rows.end - rows.start) as usize * cells;
        let mut grey = Vec::with_capacity(width * height);
        for v in rows.clone() {
            let start = grey.len();
            let first = pixel(v, backdrop.height) * backdrop.width;
            for u in columns.clone() {
                let seen = backdrop.grey[first + pixel(u, backdrop.width)];
                grey.extend(std::iter::repeat_n(seen, cells));
            }
            let row = start..grey.len();
            for _ in 1..cells {
                grey.extend_from_within(row.clone());
            }
        }
        let places = CellPlaces {
            origin,
            first: [columns.start * cells as i64, rows.start * cells as i64],
            side,
            columns: width,
            rows: height,
        };
        FineGrid { cells: places, grey }
    }

    /// What `change`, on the cells of a patch, adds to the region's pixels, row by row: first along rows, then along columns.
    pub fn light(&self, change: &[f32], patch: &CellPlaces, weights: &CellWeights) -> Vec<f32> {
        let cells = weights.cells;
        let width = self.columns.len();
        // Pixels from the first of the patch to the first that the first pixel's light comes from.
        let from_patch =
            |start: usize, first: i64| start as i64 - weights.reach as i64 - first / cells as i64;
        let lead = from_patch(self.columns.start, patch.first[0]);
        let pixels = patch.columns / cells;
        let mut narrowed = vec![0.0_f32; patch.rows * width];
        // The cells of a row, those that are the first of their pixel first: then neighbouring pixels take neighbouring cells.
        let mut parted = vec![0.0_f32; patch.columns];
        for (row, sums) in change
            .chunks_exact(patch.columns.max(1))
            .zip(narrowed.chunks_exact_mut(width))
        {
            if row.iter().all(|c| *c == 0.0) {
                continue;
            }
            for (pixel, of_pixel) in row.chunks_exact(cells).enumerate() {
                for (k, cell) in of_pixel.iter().enumerate() {
                    parted[k * pixels + pixel] = *cell;
                }
            }
            for (k, weight) in weights.taps.iter().enumerate() {
                // Pixel i takes this cell from pixel i + ahead of the patch.
                let ahead = lead + (k / cells) as i64;
                let from = (-ahead).clamp(0, width as i64) as usize;
                let to = (pixels as i64 - ahead).clamp(from as i64, width as i64) as usize;
                if from == to {
                    continue;
                }
                let start = (k % cells) * pixels + (from as i64 + ahead) as usize;
                add_scaled(&mut sums[from..to], &parted[start..start + to - from], *weight);
            }
        }
        let lead = from_patch(self.rows.start, patch.first[1]) * cells as i64;
        let mut light = vec![0.0_f32; self.rows.len() * width];
        for (sums, j) in light.chunks_exact_mut(width).zip(0_i64..) {
            for (weight, k) in weights.taps.iter().zip(0_i64..) {
                let row = lead + j * cells as i64 + k;
                if (0..patch.rows as i64).contains(&row) {
                    let row = row as usize * width;
                    add_scaled(sums, &narrowed[row..row + width], *weight);
                }
            }
        }
        light
    }
}

/// sums += weight × values, one by one: as many at once as the machine can.
fn add_scaled(sums: &mut [f32], values: &[f32], weight: f32) {
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum += weight * value;
    }
}

/// How much of each cell's light a pixel gets, along one axis: box ∗ Gaussian at the cell's centre, times its side.
pub(super) struct CellWeights {
    /// Cells along a pixel.
    cells: usize,
    /// Pixels on either side that matter.
    reach: usize,
    taps: Vec<f32>,
}

impl CellWeights {
    pub fn new(cells: usize, blur_px: f64) -> Self {
        let side = 1.0 / cells as f64;
        let sigma = (blur_px * blur_px - side * side / 12.0).max(0.0).sqrt();
        let reach = (BLUR_REACH * blur_px + 0.5).ceil() as usize;
        let taps = (0..(2 * reach + 1) * cells)
            .map(|k| {
                let d = (k as f64 + 0.5) * side - reach as f64 - 0.5;
                let weight = if sigma > 0.0 {
                    gaussian_below((d + 0.5) / sigma) - gaussian_below((d - 0.5) / sigma)
                } else if d.abs() < 0.5 {
                    1.0
                } else {
                    0.0
                };
                (weight * side) as f32
            })
            .collect();
        Self { cells, reach, taps }
    }

    /// What the cells of `places` add to the pixel in this column and row, summed one by one.
    #[cfg(test)]
    pub fn around(&self, pixel: [usize; 2], change: &[f64], places: &CellPlaces) -> f64 {
        let first = [0, 1]
            .map(|axis| (pixel[axis] as i64 - self.reach as i64) * self.cells as i64 - places.first[axis]);
        let mut sum = 0.0;
        for (down, row) in self.taps.iter().zip(first[1]..) {
            for (along, column) in self.taps.iter().zip(first[0]..) {
                if (0..places.rows as i64).contains(&row) && (0..places.columns as i64).contains(&column) {
                    let cell = row as usize * places.columns + column as usize;
                    sum += f64::from(down * along) * change[cell];
                }
            }
        }
        sum
    }
}
