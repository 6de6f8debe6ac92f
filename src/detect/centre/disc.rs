//! The outline of a ball, and a centre with its uncertainty.

use crate::geometry::PixelPoint;

/// The outline of a ball that moves while the shutter is open: a disc, or a capsule.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disc {
    /// Centre at mid-exposure.
    pub centre: PixelPoint,
    /// Radius, px.
    pub radius_px: f64,
    /// Displacement during the exposure, px (u, v); its sign does not matter.
    pub swept_px: [f64; 2],
}

/// A refined centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Centre {
    /// The outline found.
    pub disc: Disc,
    /// Covariance of (u, v), px², from the fit's own residuals.
    pub covariance_px2: [[f64; 2]; 2],
    /// Part of the outline that was used, 0..1; the rest is hidden, an outlier or outside the picture.
    pub outline_used: f64,
    /// Typical residual, grey levels.
    pub residual_grey: f64,
    /// Mean brightness step across the edge, grey levels (negative: darker than the background).
    pub contrast_grey: f64,
}

impl Centre {
    /// Root mean square of the two coordinates' standard uncertainties, px.
    #[must_use]
    pub fn std_px(&self) -> f64 {
        (0.5 * (self.covariance_px2[0][0] + self.covariance_px2[1][1])).sqrt()
    }
}
