//! The ball's centre in one frame.
//!
//! | file | |
//! |---|---|
//! | [`outline`] | a first circle where nothing is known yet |
//! | [`ball`] | what a ball looks like: the model that the likelihood fits share |
//! | [`appearance`] | what this recording's ball looks like, learned from many frames |
//! | [`known_ball`] | the likelihood fit of a centre once that is known |
//! | [`affine_patch`] | the ellipse that perspective and lens make of a ball, as a circle |
//! | [`fast`], [`standard`], [`fine`] | the methods behind `--accuracy`, each with its cost and error |

pub mod affine_patch;
pub mod appearance;
pub mod ball;
pub mod fast;
pub mod fine;
pub mod known_ball;
pub mod outline;
pub mod standard;

use super::blobs::Crop;
use crate::geometry::PixelPoint;
use affine_patch::AffinePatch;

/// How much time to spend on accuracy.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Accuracy {
    /// For screening: see [`fast`].
    Fast,
    /// What most need: see [`standard`].
    #[default]
    Standard,
    /// The most exact: see [`fine`].
    Fine,
}

/// A cut-out of a frame beside the background that it covers.
#[derive(Debug, Clone)]
pub struct Patch<'a> {
    /// The pixels and where they stand in the frame.
    pub crop: &'a Crop,
    /// The background behind each pixel, grey levels.
    pub background: Vec<f32>,
    /// Standard deviation of a pixel's noise, grey levels.
    pub noise_grey: f64,
    /// How perspective and lens draw the ball out here; `None` where it is as round as can be seen. The centre methods then
    /// have their discs and centres in the round picture.
    pub affine: Option<AffinePatch>,
}

/// The outline of a ball that moves by `swept` while the shutter is open: a disc, or a capsule.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disc {
    /// Centre at mid-exposure, in the frame's picture.
    pub centre: PixelPoint,
    /// RadiusSource, px.
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
