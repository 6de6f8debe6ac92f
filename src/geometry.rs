//! Points of three frames, as three types, so that one cannot be taken for another.
//!
//! picture ([`PixelPoint`]) → plane of motion, unscaled ([`PlanePoint`]) → world ([`WorldPoint`]).
//! The first step (lens, homography, "up") and the second (metres per unit) belong to
//! [`crate::calibration`]; every other module sees only their results.

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
#[derive(Debug, Clone, Copy, PartialEq)]
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
