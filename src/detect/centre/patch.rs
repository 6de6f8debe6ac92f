//! The pixels around a ball.

use super::affine_patch::AffinePatch;
use crate::detect::crop::Crop;

/// A cut-out of a frame beside the background that it covers.
#[derive(Debug, Clone)]
pub struct Patch<'a> {
    /// The pixels and where they stand in the frame.
    pub crop: &'a Crop,
    /// The background behind each pixel, grey levels.
    pub background: Vec<f32>,
    /// Standard deviation of a pixel's noise, grey levels.
    pub noise_grey: f64,
    /// How perspective and lens stretch the ball here; `None` where it is as round as can be seen. Discs and centres that a
    /// method is given and gives back are then in the patch's own coordinates.
    pub affine: Option<AffinePatch>,
}
