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
    /// Half of the acceleration times the exposure squared, px: by four times less the ends of the path are off a straight one.
    pub bent_px: [f64; 2],
}

/// What an acceleration does to the path of an exposure: [`Disc::bent_px`]. One that takes no end of the path further than
/// centres are known to (`UNSEEN_PX`) is left out.
#[must_use]
pub fn bent_px(acceleration_px_s2: [f64; 2], exposure_s: f64) -> [f64; 2] {
    let bent = acceleration_px_s2.map(|a| 0.5 * a * exposure_s * exposure_s);
    if 0.25 * bent[0].hypot(bent[1]) < UNSEEN_PX {
        [0.0; 2]
    } else {
        bent
    }
}

/// No centre is known to better, px.
const UNSEEN_PX: f64 = 0.002;

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
    /// One that was not fitted but told, to `std_px` in each coordinate, of a ball at rest.
    #[must_use]
    pub fn told(centre: PixelPoint, std_px: f64, radius_px: f64, contrast_grey: f64) -> Self {
        let variance = std_px * std_px;
        Self {
            disc: Disc {
                centre,
                radius_px,
                swept_px: [0.0; 2],
                bent_px: [0.0; 2],
            },
            covariance_px2: [[variance, 0.0], [0.0, variance]],
            outline_used: 1.0,
            residual_grey: 0.0,
            contrast_grey,
        }
    }

    /// Root mean square of the two coordinates' standard uncertainties, px.
    #[must_use]
    pub fn std_px(&self) -> f64 {
        (0.5 * (self.covariance_px2[0][0] + self.covariance_px2[1][1])).sqrt()
    }
}
