//! How a frame differs from the reference picture as a whole: the camera's shift and the light.

use super::resample::shifted;
use crate::frames::Luma;
use crate::geometry::PixelPoint;

/// The shift and the light of a frame against the reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Registration {
    /// A scene point at column u of the reference appears at u + `shift_u_px`.
    pub shift_u_px: f64,
    /// The same for rows.
    pub shift_v_px: f64,
    /// Brightness over the reference's.
    pub gain: f64,
    /// Added brightness, grey levels.
    pub offset_grey: f64,
}

impl Registration {
    /// No difference.
    pub const IDENTITY: Self = Self {
        shift_u_px: 0.0,
        shift_v_px: 0.0,
        gain: 1.0,
        offset_grey: 0.0,
    };

    /// The same frame's brightness against another picture of the unmoved scene, which has that of `other` against this
    /// one's reference.
    #[must_use]
    pub fn relative_to(&self, other: &Self) -> Self {
        let gain = self.gain / other.gain;
        Self {
            gain,
            offset_grey: self.offset_grey - gain * other.offset_grey,
            ..*self
        }
    }

    /// Length of the shift, px.
    #[must_use]
    pub fn shift_px(&self) -> f64 {
        self.shift_u_px.hypot(self.shift_v_px)
    }

    /// Brightness of what is `grey` in the reference over that.
    #[must_use]
    pub fn brightness(&self, grey: f64) -> f64 {
        self.gain + self.offset_grey / grey
    }

    /// The same in a picture `by` times as large.
    #[must_use]
    pub fn scaled(&self, by: f64) -> Self {
        Self {
            shift_u_px: by * self.shift_u_px,
            shift_v_px: by * self.shift_v_px,
            ..*self
        }
    }

    /// Whether the picture needs no resampling.
    #[must_use]
    pub fn is_still(&self) -> bool {
        self.shift_u_px == 0.0 && self.shift_v_px == 0.0
    }

    /// The place in the reference picture of a point of this frame.
    #[must_use]
    pub fn reference_from_frame(&self, p: PixelPoint) -> PixelPoint {
        PixelPoint::new(p.u_px - self.shift_u_px, p.v_px - self.shift_v_px)
    }

    /// The place in this frame of a point of the reference picture.
    #[must_use]
    pub fn frame_from_reference(&self, p: PixelPoint) -> PixelPoint {
        PixelPoint::new(p.u_px + self.shift_u_px, p.v_px + self.shift_v_px)
    }

    /// `frame` moved into the reference's place (brightness as it is).
    #[must_use]
    pub fn aligned(&self, frame: &Luma) -> Luma {
        shifted(frame, self.shift_u_px, self.shift_v_px)
    }

    /// The `reference` as this frame's camera sees it (brightness as it is).
    #[must_use]
    pub fn seen(&self, reference: &Luma) -> Luma {
        shifted(reference, -self.shift_u_px, -self.shift_v_px)
    }
}
