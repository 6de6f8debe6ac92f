//! A ball off the optical axis has an outline drawn out by perspective: an ellipse. Seen in a picture that is drawn together
//! again about some point, it is a circle and can be fitted as one.
//!
//! With S the stretch and c the point that stays, what the round picture has at w the frame has at c + S (w − c). Only the
//! places of pixels are changed, none is computed anew, so that their noise stays what it is. (The blur is then an ellipse
//! the other way, which pulls no centre.)

use super::{Centre, Disc};
use crate::geometry::PixelPoint;
use nalgebra::{Matrix2, Vector2};

/// How round things are drawn out around a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DrawnOut {
    fixed: Vector2<f64>,
    stretch: Matrix2<f64>,
    back: Matrix2<f64>,
}

impl DrawnOut {
    /// By `stretch` about `fixed`; `None` where that cannot be undone.
    #[must_use]
    pub fn new(fixed: PixelPoint, stretch: Matrix2<f64>) -> Option<Self> {
        Some(Self {
            fixed: Vector2::new(fixed.u_px, fixed.v_px),
            stretch,
            back: stretch.try_inverse()?,
        })
    }

    /// How many times farther than in the round picture a thing may reach.
    #[must_use]
    pub fn most(&self) -> f64 {
        self.stretch.norm()
    }

    /// Where a point of the frame is in the round picture.
    #[must_use]
    pub fn round(&self, u: f64, v: f64) -> (f64, f64) {
        let w = self.fixed + self.back * (Vector2::new(u, v) - self.fixed);
        (w.x, w.y)
    }

    /// Where a point of the round picture is in the frame.
    #[must_use]
    pub fn frame(&self, w: PixelPoint) -> PixelPoint {
        let p = self.fixed + self.stretch * (Vector2::new(w.u_px, w.v_px) - self.fixed);
        PixelPoint::new(p.x, p.y)
    }

    /// The circle that `disc`, drawn out, is in the round picture.
    #[must_use]
    pub fn round_disc(&self, disc: &Disc) -> Disc {
        let (u, v) = self.round(disc.centre.u_px, disc.centre.v_px);
        let swept = self.back * Vector2::from(disc.swept_px);
        Disc {
            centre: PixelPoint::new(u, v),
            swept_px: [swept.x, swept.y],
            ..*disc
        }
    }

    /// A centre of the round picture in the frame; its radius stays that of the circle.
    #[must_use]
    pub fn frame_centre(&self, found: &Centre) -> Centre {
        let swept = self.stretch * Vector2::from(found.disc.swept_px);
        let [[uu, uv], [vu, vv]] = found.covariance_px2;
        let covariance = self.stretch * Matrix2::new(uu, uv, vu, vv) * self.stretch.transpose();
        Centre {
            disc: Disc {
                centre: self.frame(found.disc.centre),
                swept_px: [swept.x, swept.y],
                ..found.disc
            },
            covariance_px2: [
                [covariance[(0, 0)], covariance[(0, 1)]],
                [covariance[(1, 0)], covariance[(1, 1)]],
            ],
            ..*found
        }
    }
}
