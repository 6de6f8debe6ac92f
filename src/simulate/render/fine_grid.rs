//! The grid of cells, finer than pixels, that a scene is painted on.

use super::exposed_region::PictureBox;
use super::normal;
use crate::simulate::camera::Ellipse;
use crate::simulate::coverage::EllipseCoverage;
use crate::simulate::effects::Surface;
use nalgebra::Vector2;
use std::ops::Range;

/// A part of the picture on the fine grid.
pub struct FineGrid {
    pub(super) cells: CellPlaces,
    /// Row by row.
    pub(super) grey: Vec<f32>,
}

/// Where the cells of a part are.
#[derive(Clone, Copy)]
pub(super) struct CellPlaces {
    /// Centre of the first cell of the picture's first pixel, px: cells are at the same places in every part.
    pub origin: Vector2<f64>,
    /// Column and row of the part's first cell, counted from there.
    pub first: [i64; 2],
    /// Side of a cell, px.
    pub side: f64,
    pub columns: usize,
    pub rows: usize,
}

impl CellPlaces {
    /// Centre of a cell, px.
    fn centre(&self, column: usize, row: usize) -> Vector2<f64> {
        Vector2::new(self.column_px(column), self.row_px(row))
    }

    /// Middle of a column of cells, px.
    fn column_px(&self, column: usize) -> f64 {
        self.origin.x + (self.first[0] + column as i64) as f64 * self.side
    }

    /// Middle of a row of cells, px.
    fn row_px(&self, row: usize) -> f64 {
        self.origin.y + (self.first[1] + row as i64) as f64 * self.side
    }

    /// Columns and rows of the cells that a box touches, with one more on each side.
    pub fn window(&self, within: &PictureBox) -> (Range<usize>, Range<usize>) {
        let (low, high) = (within.low, within.high);
        let range = |low: f64, high: f64, first: f64, cells: usize| {
            let from = ((low - first) / self.side).floor().max(1.0) as usize - 1;
            let to = ((high - first) / self.side).ceil().max(0.0) as usize + 2;
            from.min(cells)..to.min(cells)
        };
        (
            range(low.x, high.x, self.column_px(0), self.columns),
            range(low.y, high.y, self.row_px(0), self.rows),
        )
    }

    /// The cells of the rows `rows` that an ellipse touches.
    fn touched_rows<'a>(
        &'a self,
        cover: &'a EllipseCoverage,
        rows: Range<usize>,
    ) -> impl Iterator<Item = TouchedRow> + use<'a> {
        let half = 0.5 * self.side;
        let (first_x, first_y) = (self.column_px(0), self.row_px(0));
        let to_row = |y: f64| ((y - first_y) / self.side).round().max(0.0) as usize;
        let reached = cover.rows();
        let rows = rows.start.max(to_row(*reached.start()))..rows.end.min(to_row(*reached.end()) + 1);
        rows.filter_map(move |row| {
            let y = self.row_px(row);
            let span = cover.span(y - half, y + half)?;
            let to_column = |x: f64| ((x - first_x) / self.side).round().max(0.0) as usize;
            let columns = to_column(span.touched.0)..(to_column(span.touched.1) + 1).min(self.columns);
            Some(TouchedRow {
                row,
                columns,
                covered: span.covered,
            })
        })
    }
}

impl FineGrid {
    /// Side of a cell, px.
    #[must_use]
    pub fn side_px(&self) -> f64 {
        self.cells.side
    }

    /// Height of a row of cells, px.
    #[must_use]
    pub fn row_px(&self, row: usize) -> f64 {
        self.cells.row_px(row)
    }

    /// Paints an ellipse over the rows `rows`: `paint` gives the grey of a cell from its place in the ellipse (inside is
    /// within 1 of the origin; right, down), its place in the picture and its grey so far. Cells at the edge are
    /// mixed by the exact share that is covered.
    pub fn paint(
        &mut self,
        ellipse: &Ellipse,
        rows: Range<usize>,
        mut paint: impl FnMut(Vector2<f64>, Vector2<f64>, f32) -> f32,
    ) {
        let Some(cover) = EllipseCoverage::new(ellipse) else {
            return;
        };
        let cells = self.cells;
        for touched in cells.touched_rows(&cover, rows) {
            for column in touched.columns.clone() {
                let at = cells.centre(column, touched.row);
                let share = if touched.covers(at.x, cells.side) {
                    1.0
                } else {
                    cover.of_square(at, cells.side) as f32
                };
                let cell = &mut self.grey[touched.row * cells.columns + column];
                *cell += share * (paint(cover.unit(at), at, *cell) - *cell);
            }
        }
    }

    /// Paints a ball without marks, whose outline is an ellipse, over the rows `rows`: as [`FineGrid::paint`] would with the surface's
    /// grey at each cell, bit for bit, but with the cells of a row that are inside at a time.
    pub(super) fn paint_surface(&mut self, ellipse: &Ellipse, rows: Range<usize>, surface: &dyn Surface) {
        let Some(cover) = EllipseCoverage::new(ellipse) else {
            return;
        };
        let mut run = InsideRun::default();
        let cells = self.cells;
        for touched in cells.touched_rows(&cover, rows) {
            run.clear();
            for column in touched.columns.clone() {
                let at = cells.centre(column, touched.row);
                let unit = cover.unit(at);
                if touched.covers(at.x, cells.side) {
                    run.push(column, unit);
                    continue;
                }
                let share = cover.of_square(at, cells.side) as f32;
                let cell = &mut self.grey[touched.row * cells.columns + column];
                *cell += share * (surface.grey(&normal(unit)) as f32 - *cell);
            }
            let first = touched.row * cells.columns + run.first;
            let greys = run.shaded(surface);
            for (cell, grey) in self.grey[first..first + greys.len()].iter_mut().zip(greys) {
                *cell += grey - *cell;
            }
        }
    }
}

/// What an ellipse touches of a row of cells.
struct TouchedRow {
    row: usize,
    columns: Range<usize>,
    /// Between these it covers the row's cells altogether, px.
    covered: (f64, f64),
}

impl TouchedRow {
    /// Whether it covers the cell whose middle is at `x`.
    fn covers(&self, x: f64, side: f64) -> bool {
        let half = 0.5 * side;
        x - half >= self.covered.0 && x + half <= self.covered.1
    }
}

/// Neighbouring cells of a row that are inside the ball's outline.
#[derive(Default)]
struct InsideRun {
    /// Column of the first.
    first: usize,
    /// Their places in the outline (right, down; the rim at 1).
    right: Vec<f64>,
    down: Vec<f64>,
    greys: Vec<f32>,
}

impl InsideRun {
    fn clear(&mut self) {
        self.right.clear();
        self.down.clear();
    }

    fn push(&mut self, column: usize, unit: Vector2<f64>) {
        if self.right.is_empty() {
            self.first = column;
        }
        self.right.push(unit.x);
        self.down.push(unit.y);
    }

    fn shaded(&mut self, surface: &dyn Surface) -> &[f32] {
        self.greys.resize(self.right.len(), 0.0);
        surface.greys_inside(&self.right, &self.down, &mut self.greys);
        &self.greys
    }
}
