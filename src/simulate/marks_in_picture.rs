//! Marks as a camera sees them: the mean albedo over each cell of the fine grid.
//!
//! A lens's distortion is that of the outline: over the ball it is taken as linear, so that in the corner of a barrel lens marks are off by as
//! much as the outline's own middle is (0.02 px).
//!
//! Cells that no edge comes near have one albedo. The others are cut into squares, whose corners' directions say what share of the
//! square is beyond the edge ([`super::marks`]); more of them where the ball's surface turns away, near its rim.

use super::camera::{Ellipse, Facing};
use super::marks::{BallMarks, SquareCorners};
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use std::borrow::Cow;

/// Marks of a ball at a moment.
pub struct SeenMarks<'a> {
    marks: Cow<'a, BallMarks>,
    edge_level: f64,
    /// What the direction of the ball is in which the camera sees one of its own (right, up, towards it); a mirror may be in it.
    ball_from_camera: Matrix3<f64>,
    facing: Facing,
    /// Sides of a cell in the outline's own coordinates, as columns: along, down.
    cell: Matrix2<f64>,
    /// Half the longer diagonal of that.
    half_diagonal: f64,
}

/// Squares along a side of a cell, and of one that is nearer to the rim than [`RIM`] of the radius.
const SQUARES: usize = 2;
const SQUARES_AT_RIM: usize = 5;
const RIM: f64 = 0.06;
/// A pinhole sees directions change a little faster with the place than parallel light.
const PINHOLE_MARGIN: f64 = 1.5;
/// Corners of [`SQUARES_AT_RIM`].
const MOST_CORNERS: usize = (SQUARES_AT_RIM + 1) * (SQUARES_AT_RIM + 1);

impl<'a> SeenMarks<'a> {
    /// For a ball with this outline on a grid whose cells are `side_px` wide.
    pub fn new(
        marks: &'a BallMarks,
        ball_from_camera: Matrix3<f64>,
        facing: Facing,
        outline: &Ellipse,
        side_px: f64,
    ) -> Self {
        // An ellipse without area is not painted.
        let to_unit = outline.axes.try_inverse().unwrap_or_else(Matrix2::zeros);
        let cell = to_unit * side_px;
        let (along, down) = (cell.column(0), cell.column(1));
        Self {
            edge_level: marks.edge_level(),
            marks: marks.seen_from(&(ball_from_camera * facing.towards())),
            ball_from_camera,
            facing,
            cell,
            half_diagonal: 0.5 * (along + down).norm().max((along - down).norm()),
        }
    }

    /// The mean over the cell around `unit`, a place in the outline's own coordinates (right, down; the rim at 1).
    pub fn albedo(&self, unit: Vector2<f64>) -> f64 {
        let direction = self.direction(unit);
        if let Some(plain) = self
            .marks
            .plain_albedo(&direction, self.reach(unit.norm()), self.edge_level)
        {
            return plain;
        }
        let is_at_rim = unit.norm() + self.half_diagonal > 1.0 - RIM;
        let squares = if is_at_rim && !self.marks.is_picture() {
            SQUARES_AT_RIM
        } else {
            SQUARES
        };
        self.mean(unit, squares)
            .unwrap_or_else(|| self.marks.mean_albedo(&[direction; 4], self.edge_level))
    }

    /// The direction of the ball that is seen at `unit`.
    fn direction(&self, unit: Vector2<f64>) -> Vector3<f64> {
        self.ball_from_camera * self.facing.normal(unit)
    }

    /// How far directions in a cell are from that of its middle, `from_centre` from the outline's, at most.
    fn reach(&self, from_centre: f64) -> f64 {
        let height = |r: f64| (1.0 - r.clamp(0.0, 1.0).powi(2)).sqrt();
        let turned = height(from_centre - self.half_diagonal) - height(from_centre + self.half_diagonal);
        let margin = match self.facing {
            Facing::Parallel => 1.0,
            Facing::Pinhole { .. } => PINHOLE_MARGIN,
        };
        margin * (turned * turned + self.half_diagonal * self.half_diagonal).sqrt()
    }

    /// The mean over those of `squares` × `squares` parts of a cell whose middle is inside the outline; `None` where none is.
    fn mean(&self, unit: Vector2<f64>, squares: usize) -> Option<f64> {
        let corners = squares + 1;
        let at = |i: usize, j: usize| {
            let share = Vector2::new(i as f64, j as f64) / squares as f64 - Vector2::repeat(0.5);
            unit + self.cell * share
        };
        let mut directions = [Vector3::zeros(); MOST_CORNERS];
        for j in 0..corners {
            for i in 0..corners {
                directions[j * corners + i] = self.direction(at(i, j));
            }
        }
        let (mut sum, mut inside) = (0.0, 0_u32);
        for j in 0..squares {
            for i in 0..squares {
                let middle = 0.5 * (at(i, j) + at(i + 1, j + 1));
                if middle.norm_squared() > 1.0 {
                    continue;
                }
                let first = j * corners + i;
                let square: SquareCorners =
                    [first, first + 1, first + corners, first + corners + 1].map(|k| directions[k]);
                sum += self.marks.mean_albedo(&square, self.edge_level);
                inside += 1;
            }
        }
        (inside > 0).then(|| sum / f64::from(inside))
    }
}
