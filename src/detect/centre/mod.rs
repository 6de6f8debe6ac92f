//! The ball's centre in one frame: found coarsely on its outline, then refined on the pixels of its edge.

pub mod edge_band;
pub mod outline;

use super::blobs::Crop;
use crate::geometry::PixelPoint;

/// A cut-out of a frame beside the background that it covers.
#[derive(Debug, Clone)]
pub struct Patch<'a> {
    /// The pixels and where they stand in the frame.
    pub crop: &'a Crop,
    /// The background behind each pixel, grey levels.
    pub background: Vec<f32>,
    /// Standard deviation of a pixel's noise, grey levels.
    pub noise_grey: f64,
}

/// The outline of a ball that moves by `swept` while the shutter is open: a disc, or a capsule.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disc {
    /// Centre at mid-exposure, in the frame's picture.
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
    /// Standard uncertainty of the radius, px; `None` where it was given.
    pub radius_std_px: Option<f64>,
    /// Standard deviation of the edge's blur (optics and pixel together), px.
    pub blur_px: f64,
    /// Part of the outline that was used, 0..1; the rest is hidden, spoilt or outside the picture.
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
