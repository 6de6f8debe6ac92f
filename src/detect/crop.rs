//! A rectangle of a frame.

use crate::frames::Luma;
use crate::geometry::PixelPoint;

/// A rectangle cut out of a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Crop {
    /// Column of the left-most pixel in the frame.
    pub u: usize,
    /// Row of the top-most pixel in the frame.
    pub v: usize,
    /// The pixels.
    pub luma: Luma,
}

impl Crop {
    /// One whose pixels nobody keeps.
    #[must_use]
    pub fn without_pixels(u: usize, v: usize) -> Self {
        let luma = Luma {
            width: 0,
            height: 0,
            data: Vec::new(),
        };
        Self { u, v, luma }
    }

    /// The part of `frame` within the half-open ranges, clipped to the frame.
    #[must_use]
    pub fn of(frame: &Luma, us: std::ops::Range<usize>, vs: std::ops::Range<usize>) -> Self {
        let (u0, u1) = (us.start.min(frame.width), us.end.min(frame.width));
        let (v0, v1) = (vs.start.min(frame.height), vs.end.min(frame.height));
        let mut data = Vec::with_capacity((u1 - u0) * (v1 - v0));
        for v in v0..v1 {
            data.extend_from_slice(&frame.row(v)[u0..u1]);
        }
        Self {
            u: u0,
            v: v0,
            luma: Luma {
                width: u1 - u0,
                height: v1 - v0,
                data,
            },
        }
    }

    /// Whether the pixel nearest to `p` lies inside, at least `margin_px` from the rim.
    #[must_use]
    pub fn contains(&self, p: PixelPoint, margin_px: f64) -> bool {
        let (u, v) = (p.u_px - self.u as f64, p.v_px - self.v as f64);
        u >= margin_px
            && v >= margin_px
            && u <= self.luma.width as f64 - 1.0 - margin_px
            && v <= self.luma.height as f64 - 1.0 - margin_px
    }
}
