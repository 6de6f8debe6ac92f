//! Rolling shutter: the camera reads its picture row by row, so that each row has its own time.
//!
//! A place p of the picture is exposed s(p) ρ after the frame's time, ρ the readout time of the whole picture and s the share of
//! the stored rows before it, from −1/2 at the first row to 1/2 past the last: the frame's time is that of the middle row. A
//! ball of velocity v (px/s) is seen where its own row's time has it, and drawn out around that place: the picture is p = c + d
//! for a shutter that is open to all rows at once, and p = c + (1 − v gᵀ)⁻¹ d with g the gradient of s ρ. That is an affine
//! patch, the same on both sides of the centre, so that it shifts no centre; what acceleration leaves (half of g (ρ R/H)²) is
//! below 0.001 px for any ball in free fall.

use crate::frames::RowOrder;
use crate::geometry::PixelPoint;
use nalgebra::{Matrix2, Vector2};

/// When the rows of a camera's pictures are exposed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Readout {
    /// ρ: from the first row of the stored picture to the last, s; 0 for a global shutter.
    pub whole_s: f64,
    /// Standard uncertainty of it, s.
    pub std_s: f64,
    /// How s grows with a pixel to the right and down.
    per_px: Vector2<f64>,
    /// Where s is 0.
    middle: Vector2<f64>,
}

impl Readout {
    /// A global shutter, for pictures of `size_px` whose stored rows run in `order`.
    pub fn global((width, height): (usize, usize), order: RowOrder) -> Self {
        let per_px = match order {
            RowOrder::Down => Vector2::new(0.0, 1.0 / height as f64),
            RowOrder::Up => Vector2::new(0.0, -1.0 / height as f64),
            RowOrder::Right => Vector2::new(1.0 / width as f64, 0.0),
            RowOrder::Left => Vector2::new(-1.0 / width as f64, 0.0),
        };
        Self {
            whole_s: 0.0,
            std_s: 0.0,
            per_px,
            middle: 0.5 * Vector2::new(width as f64 - 1.0, height as f64 - 1.0),
        }
    }

    /// The same for a readout of `whole_s` ± `std_s`.
    #[must_use]
    pub fn of(self, whole_s: f64, std_s: f64) -> Self {
        Self {
            whole_s,
            std_s,
            ..self
        }
    }

    /// Share of the readout between the frame's time and the exposure of a place `p`.
    pub fn share(&self, p: PixelPoint) -> f64 {
        self.per_px.dot(&(Vector2::new(p.u_px, p.v_px) - self.middle))
    }

    /// How much later than the frame's time a place `p` is exposed, s.
    pub fn delay_s(&self, p: PixelPoint) -> f64 {
        self.whole_s * self.share(p)
    }

    /// How a thing that moves with `velocity_px_s` is drawn out; `None` where the shutter shows no such thing: one that keeps up
    /// with the rows.
    pub fn stretch(&self, velocity_px_s: [f64; 2]) -> Option<Matrix2<f64>> {
        let gradient = self.whole_s * self.per_px;
        (Matrix2::identity() - Vector2::from(velocity_px_s) * gradient.transpose()).try_inverse()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_exposed_in_the_order_in_which_they_are_stored() {
        let size = (40, 20);
        let at = |order, u, v| {
            let readout = Readout::global(size, order).of(0.01, 0.0);
            readout.delay_s(PixelPoint::new(u, v))
        };
        for (order, first, last) in [
            (RowOrder::Down, (7.0, -0.5), (7.0, 19.5)),
            (RowOrder::Up, (7.0, 19.5), (7.0, -0.5)),
            (RowOrder::Right, (-0.5, 3.0), (39.5, 3.0)),
            (RowOrder::Left, (39.5, 3.0), (-0.5, 3.0)),
        ] {
            assert!((at(order, first.0, first.1) + 0.005).abs() < 1e-15, "{order:?}");
            assert!((at(order, last.0, last.1) - 0.005).abs() < 1e-15, "{order:?}");
            assert_eq!(at(order, 19.5, 9.5), 0.0);
        }
    }

    #[test]
    fn a_falling_thing_is_drawn_out_by_the_rows_that_follow_it() {
        // 1000 px/s down, 1000 rows in 0.1 s: a tenth of a row's way in a row's time.
        let readout = Readout::global((10, 1000), RowOrder::Down).of(0.1, 0.0);
        let stretch = readout.stretch([500.0, 1000.0]).unwrap();
        assert!((stretch[(1, 1)] - 1.0 / 0.9).abs() < 1e-12);
        assert!((stretch[(0, 1)] - 0.05 / 0.9).abs() < 1e-12);
        assert_eq!((stretch[(0, 0)], stretch[(1, 0)]), (1.0, 0.0));
        assert_eq!(readout.stretch([0.0, 10_000.0]), None);
    }
}
