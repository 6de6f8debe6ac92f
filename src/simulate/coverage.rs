//! How much of a rectangle an ellipse covers: exact, not sampled.
//!
//! The ellipse's own coordinates turn it into the unit circle and the rectangle into a parallelogram. The area of a
//! circle ∩ polygon is the sum over the polygon's edges of the signed area between the edge and the centre: a triangle
//! where the edge runs inside the circle, a sector where it runs outside.

use super::camera::Ellipse;
use nalgebra::{Matrix2, Vector2};
use std::ops::RangeInclusive;

/// An ellipse ready to be asked.
pub(super) struct EllipseCoverage {
    centre: Vector2<f64>,
    to_unit: Matrix2<f64>,
    /// Area of the ellipse over area of the unit circle, px².
    scale: f64,
    reach: Vector2<f64>,
    /// Height of its rightmost point above its centre, px.
    rightmost_dy: f64,
}

/// Columns of a row: those the ellipse touches, and those it covers altogether (empty where first > last).
pub(super) struct ColumnSpan {
    pub touched: (f64, f64),
    pub covered: (f64, f64),
}

impl EllipseCoverage {
    /// `None` for an ellipse without area.
    pub fn new(ellipse: &Ellipse) -> Option<Self> {
        let reach = ellipse.reach();
        // Its rightmost point is axes · (a, b) with (a, b) along the first row of `axes`.
        let rightmost = ellipse.axes.row(0).transpose() / reach.x;
        Some(Self {
            centre: ellipse.centre,
            to_unit: ellipse.axes.try_inverse()?,
            scale: ellipse.axes.determinant().abs(),
            reach,
            rightmost_dy: (ellipse.axes * rightmost).y,
        })
    }

    /// A point in the ellipse's own coordinates: inside is within 1 of the origin.
    pub fn unit(&self, point: Vector2<f64>) -> Vector2<f64> {
        self.to_unit * (point - self.centre)
    }

    /// Top and bottom, px.
    pub fn rows(&self) -> RangeInclusive<f64> {
        self.centre.y - self.reach.y..=self.centre.y + self.reach.y
    }

    /// What the ellipse does between the heights `top` and `bottom`; `None` where it does not reach them.
    pub fn span(&self, top: f64, bottom: f64) -> Option<ColumnSpan> {
        let rows = self.rows();
        if bottom <= *rows.start() || top >= *rows.end() {
            return None;
        }
        let (above, below) = (self.chord(top), self.chord(bottom));
        let widest = |side: f64| {
            let row = self.centre.y + side * self.rightmost_dy;
            (top..bottom)
                .contains(&row)
                .then_some(self.centre.x + side * self.reach.x)
        };
        let ends = [above, below];
        let left = ends
            .iter()
            .flatten()
            .map(|c| c.0)
            .chain(widest(-1.0))
            .fold(f64::INFINITY, f64::min);
        let right = ends
            .iter()
            .flatten()
            .map(|c| c.1)
            .chain(widest(1.0))
            .fold(f64::NEG_INFINITY, f64::max);
        let covered = match (above, below) {
            (Some(a), Some(b)) => (a.0.max(b.0), a.1.min(b.1)),
            _ => (f64::INFINITY, f64::NEG_INFINITY),
        };
        Some(ColumnSpan {
            touched: (left, right),
            covered,
        })
    }

    /// Where the ellipse crosses the height `y`.
    fn chord(&self, y: f64) -> Option<(f64, f64)> {
        // |to_unit (x, y)|² = 1 is a quadratic in x.
        let fixed = self.to_unit.column(1) * (y - self.centre.y);
        let along = self.to_unit.column(0);
        let (a, half_b, c) = (
            along.norm_squared(),
            along.dot(&fixed),
            fixed.norm_squared() - 1.0,
        );
        let discriminant = half_b * half_b - a * c;
        (discriminant > 0.0).then(|| {
            let root = discriminant.sqrt();
            (
                self.centre.x + (-half_b - root) / a,
                self.centre.x + (-half_b + root) / a,
            )
        })
    }

    /// The share of the square of side `side` px around `centre` that the ellipse covers, 0 to 1.
    pub fn of_square(&self, centre: Vector2<f64>, side: f64) -> f64 {
        let half = 0.5 * side;
        let corner = |x: f64, y: f64| self.unit(centre + Vector2::new(x * half, y * half));
        let corners = [
            corner(-1.0, -1.0),
            corner(1.0, -1.0),
            corner(1.0, 1.0),
            corner(-1.0, 1.0),
        ];
        let area: f64 = (0..4).map(|i| edge_area(corners[i], corners[(i + 1) % 4])).sum();
        (area.abs() * self.scale / (side * side)).min(1.0)
    }
}

/// Signed area between the origin and the edge from `a` to `b`, within the unit circle.
fn edge_area(a: Vector2<f64>, b: Vector2<f64>) -> f64 {
    let along = b - a;
    let squared = along.norm_squared();
    if squared == 0.0 {
        return 0.0;
    }
    // The part of the edge inside the circle, as shares s of its length.
    let half_b = a.dot(&along);
    let discriminant = half_b * half_b - squared * (a.norm_squared() - 1.0);
    if discriminant <= 0.0 {
        return sector(a, b);
    }
    let root = discriminant.sqrt();
    let enter = ((-half_b - root) / squared).clamp(0.0, 1.0);
    let leave = ((-half_b + root) / squared).clamp(0.0, 1.0);
    let (p, q) = (a + along * enter, a + along * leave);
    if enter >= leave {
        return sector(a, b);
    }
    sector(a, p) + 0.5 * p.perp(&q) + sector(q, b)
}

/// Signed area of the unit circle's sector between the directions of `a` and `b`.
fn sector(a: Vector2<f64>, b: Vector2<f64>) -> f64 {
    let (across, along) = (a.perp(&b), a.dot(&b));
    // Most edges are inside from end to end, so that there is nothing on either side of that.
    if across == 0.0 && along > 0.0 {
        return 0.0;
    }
    0.5 * across.atan2(along)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn total(ellipse: &Ellipse, side: f64) -> f64 {
        let cover = EllipseCoverage::new(ellipse).unwrap();
        let reach = (ellipse.reach().max() / side).ceil() as i64 + 1;
        let mut sum = 0.0;
        for j in -reach..=reach {
            for i in -reach..=reach {
                let at = ellipse.centre.map(f64::round) + Vector2::new(i as f64, j as f64) * side;
                sum += cover.of_square(at, side) * side * side;
            }
        }
        sum
    }

    #[test]
    fn pixels_of_a_disc_add_up_to_its_area() {
        for radius in [0.3, 1.0, 4.7, 15.625] {
            let disc = Ellipse::circle(Vector2::new(10.37, 20.81), radius);
            assert!(
                (total(&disc, 1.0) / (PI * radius * radius) - 1.0).abs() < 1e-12,
                "{radius}"
            );
        }
    }

    #[test]
    fn pixels_of_an_ellipse_add_up_to_its_area() {
        let ellipse = Ellipse {
            centre: Vector2::new(-3.2, 7.9),
            axes: Matrix2::new(9.0, 2.0, -1.0, 5.0),
        };
        assert!((total(&ellipse, 1.0) / (PI * 47.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_square_cut_by_a_straight_edge_is_half_covered() {
        // A circle so large that its edge is straight: sagitta 1/(8 R).
        let disc = Ellipse::circle(Vector2::new(-1e5, 0.0), 1e5);
        let share = EllipseCoverage::new(&disc)
            .unwrap()
            .of_square(Vector2::zeros(), 1.0);
        assert!((share - 0.5).abs() < 1e-5);
    }

    #[test]
    fn spans_bound_what_is_touched_and_covered() {
        let ellipse = Ellipse {
            centre: Vector2::new(0.3, -0.4),
            axes: Matrix2::new(6.0, 2.5, -1.5, 4.0),
        };
        let cover = EllipseCoverage::new(&ellipse).unwrap();
        for j in -8..=8 {
            let y = f64::from(j);
            let span = cover.span(y - 0.5, y + 0.5);
            for i in -12..=12 {
                let x = f64::from(i);
                let share = cover.of_square(Vector2::new(x, y), 1.0);
                let touched = span
                    .as_ref()
                    .is_some_and(|s| x + 0.5 > s.touched.0 && x - 0.5 < s.touched.1);
                let covered = span
                    .as_ref()
                    .is_some_and(|s| x - 0.5 >= s.covered.0 && x + 0.5 <= s.covered.1);
                assert!(share < 1e-12 || touched, "{i} {j} {share}");
                assert!(!covered || share > 1.0 - 1e-12, "{i} {j} {share}");
            }
        }
    }
}
