//! Points of three frames, as three types, so that one cannot be taken for another.
//!
//! picture ([`PixelPoint`]) → plane of motion, unscaled ([`PlanePoint`]) → world ([`WorldPoint`]).
//! The first step (lens, homography, "up") and the second (metres per unit) belong to
//! [`crate::calibration`]; every other module sees only their results.

use nalgebra::{Matrix2, Vector2};
use serde::Serialize;

/// A point of the picture: pixel (0, 0) is the centre of the top-left pixel, u right, v down.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PixelPoint {
    /// Column, px.
    pub u_px: f64,
    /// Row, px.
    pub v_px: f64,
}

impl PixelPoint {
    /// The point in column `u_px` and row `v_px`.
    #[must_use]
    pub const fn new(u_px: f64, v_px: f64) -> Self {
        Self { u_px, v_px }
    }

    /// The point `du_px` columns to the right and `dv_px` rows below.
    #[must_use]
    pub const fn shifted(self, du_px: f64, dv_px: f64) -> Self {
        Self::new(self.u_px + du_px, self.v_px + dv_px)
    }

    /// Euclidean distance to `other`, px.
    #[must_use]
    pub fn distance_px(self, other: Self) -> f64 {
        (self.u_px - other.u_px).hypot(self.v_px - other.v_px)
    }
}

/// A point of the plane of motion before its scale is applied: `right` and `up` as the picture shows them, in units
/// of [`crate::calibration::Rectification::unit`] (undistorted pixels, or metres where a homography gives them),
/// measured from the calibration's origin (or the picture's pixel (0, 0) where there is none).
///
/// In a top view `up` is the sideways direction y.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PlanePoint {
    /// Perpendicular to "up", to the right in the picture, plane units.
    pub right: f64,
    /// Along "up", plane units.
    pub up: f64,
}

impl PlanePoint {
    /// The point at `right`, `up`.
    #[must_use]
    pub const fn new(right: f64, up: f64) -> Self {
        Self { right, up }
    }
}

/// A point of the world: `x_m` along the launch; `up_m` is z above the floor (side view) or y sideways (top view).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorldPoint {
    /// Along the launch, m.
    pub x_m: f64,
    /// Height z in a side view, y in a top view, m.
    pub up_m: f64,
}

/// Places on a curve from which its ellipse is found: enough for curves without a fifth harmonic.
const RIM: u32 = 8;

/// The ellipse nearest to the closed curve that `rim` makes of the unit circle, and which is one but for small departures:
/// its centre, and the matrix that makes it of the unit circle around that. `None` where the curve has gaps or no area.
#[must_use]
pub fn nearest_ellipse(
    rim: impl Fn(Vector2<f64>) -> Option<Vector2<f64>>,
) -> Option<(Vector2<f64>, Matrix2<f64>)> {
    let share = 1.0 / f64::from(RIM);
    let places: Vec<(Vector2<f64>, Vector2<f64>)> = (0..RIM)
        .map(|i| {
            let (sin, cos) = (f64::from(i) * std::f64::consts::TAU * share).sin_cos();
            let d = Vector2::new(cos, sin);
            Some((d, rim(d)?))
        })
        .collect::<Option<_>>()?;
    let middle = share * places.iter().map(|(_, p)| p).sum::<Vector2<f64>>();
    let axes = 2.0
        * share
        * places
            .iter()
            .map(|(d, p)| p * d.transpose())
            .sum::<Matrix2<f64>>();
    let back = axes.try_inverse()?;
    // Of a departure only what goes outwards shows; what of that is like cos φ or sin φ is a shift of the whole.
    let outwards = |(d, p): &(Vector2<f64>, Vector2<f64>)| d * d.dot(&(back * (p - middle)));
    let shift = 2.0 * share * places.iter().map(outwards).sum::<Vector2<f64>>();
    Some((middle + axes * shift, axes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_ellipse_is_its_own_nearest() {
        let (centre, axes) = (Vector2::new(3.0, -4.0), Matrix2::new(2.0, 0.3, 0.1, 1.5));
        let (c, a) = nearest_ellipse(|d| Some(centre + axes * d)).unwrap();
        assert!((c - centre).norm() < 1e-12 && (a - axes).norm() < 1e-12);
        assert_eq!(nearest_ellipse(|d| (d.x > 0.0).then_some(d)), None);
        assert_eq!(nearest_ellipse(|_| Some(Vector2::zeros())), None);
    }

    /// The middle of the area within a circle seen through x → x (1 + k x²): that of the nearest ellipse.
    #[test]
    fn a_bent_circle_has_the_middle_of_its_area() {
        let (at, radius, k) = (Vector2::new(0.3, 0.2), 0.01, -0.3);
        let bend = |p: Vector2<f64>| p * (1.0 + k * p.norm_squared());
        let (centre, _) = nearest_ellipse(|d| Some(bend(at + radius * d))).unwrap();
        let corners: Vec<Vector2<f64>> = (0..10_000)
            .map(|i| {
                let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 1e4).sin_cos();
                bend(at + radius * Vector2::new(cos, sin)) - centre
            })
            .collect();
        let (mut area, mut moment) = (0.0, Vector2::zeros());
        for (a, b) in corners.iter().zip(corners.iter().cycle().skip(1)) {
            let triangle = 0.5 * (a.x * b.y - a.y * b.x);
            area += triangle;
            moment += triangle / 3.0 * (a + b);
        }
        let off = (moment / area).norm();
        let first_order = (centre - bend(at)).norm();
        assert!(off < 0.02 * first_order, "{off} {first_order}");
    }
}
