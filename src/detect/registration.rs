//! How a frame differs from the reference picture as a whole: where the camera looks, and the light.

use super::resample::{shifted, taken};
use crate::frames::Luma;
use crate::geometry::PixelPoint;
use nalgebra::Vector3;

/// The shift, the turn and the light of a frame against the reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Registration {
    /// The scene point in the [`middle`](Self::middle) appears so many columns to the right.
    pub shift_u_px: f64,
    /// And so many rows below.
    pub shift_v_px: f64,
    /// The point about which the picture turns; of no matter where it does not.
    pub middle: PixelPoint,
    /// By how much, from columns towards rows (clockwise as shown).
    pub turn_rad: f64,
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
        middle: PixelPoint::new(0.0, 0.0),
        turn_rad: 0.0,
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

    /// The same frame against the reference turned as `other`'s frame is.
    #[must_use]
    pub fn against_turn_of(&self, other: &Self) -> Self {
        Self {
            turn_rad: self.turn_rad - other.turn_rad,
            ..*self
        }
    }

    /// How the points of the picture move, px: by the shift to the right and downwards, and by the turn, root mean square over them.
    #[must_use]
    pub fn motion_px(&self) -> Vector3<f64> {
        let turned_px = reach_px(self.middle) * self.turn_rad;
        Vector3::new(self.shift_u_px, self.shift_v_px, turned_px)
    }

    /// The same frame if it did not shift.
    #[must_use]
    pub fn unshifted(&self) -> Self {
        Self {
            shift_u_px: 0.0,
            shift_v_px: 0.0,
            ..*self
        }
    }

    /// Brightness of what is `grey` in the reference over that.
    #[must_use]
    pub fn brightness(&self, grey: f64) -> f64 {
        self.gain + self.offset_grey / grey
    }

    /// The same in a picture `by` times as large.
    #[must_use]
    pub fn scaled(&self, by: f64) -> Self {
        // The picture's corner is half a pixel before the middle of its first pixel.
        let scaled = |px: f64| by * (px + 0.5) - 0.5;
        Self {
            shift_u_px: by * self.shift_u_px,
            shift_v_px: by * self.shift_v_px,
            middle: PixelPoint::new(scaled(self.middle.u_px), scaled(self.middle.v_px)),
            ..*self
        }
    }

    /// Whether it turns.
    #[must_use]
    pub fn turns(&self) -> bool {
        self.turn_rad != 0.0
    }

    /// Whether the picture needs no resampling.
    #[must_use]
    pub fn is_still(&self) -> bool {
        self.shift_u_px == 0.0 && self.shift_v_px == 0.0 && !self.turns()
    }

    /// The place in the reference picture of a point of this frame.
    #[must_use]
    pub fn reference_from_frame(&self, p: PixelPoint) -> PixelPoint {
        self.place_in_reference()(p)
    }

    /// The same for many points.
    fn place_in_reference(&self) -> impl Fn(PixelPoint) -> PixelPoint + Sync + use<> {
        let back = self.turned(-self.turn_rad);
        let (du, dv) = (-self.shift_u_px, -self.shift_v_px);
        move |p| back(p.shifted(du, dv))
    }

    /// The place in this frame of a point of the reference picture.
    #[must_use]
    pub fn frame_from_reference(&self, p: PixelPoint) -> PixelPoint {
        self.place_in_frame()(p)
    }

    /// The same for many points.
    pub fn place_in_frame(&self) -> impl Fn(PixelPoint) -> PixelPoint + Sync + use<> {
        let turned = self.turned(self.turn_rad);
        let (du, dv) = (self.shift_u_px, self.shift_v_px);
        move |p| turned(p).shifted(du, dv)
    }

    /// A point turned by so much about the middle.
    fn turned(&self, by_rad: f64) -> impl Fn(PixelPoint) -> PixelPoint + Sync + use<> {
        let (turns, middle, (sin, cos)) = (self.turns(), self.middle, by_rad.sin_cos());
        move |p| {
            if !turns {
                return p;
            }
            let (x, y) = (p.u_px - middle.u_px, p.v_px - middle.v_px);
            middle.shifted(cos * x - sin * y, sin * x + cos * y)
        }
    }

    /// `frame` moved into the reference's place (brightness as it is).
    #[must_use]
    pub fn aligned(&self, frame: &Luma) -> Luma {
        if self.turns() {
            return taken(frame, self.place_in_frame());
        }
        shifted(frame, self.shift_u_px, self.shift_v_px)
    }

    /// The `reference` as this frame's camera sees it (brightness as it is).
    #[must_use]
    pub fn seen(&self, reference: &Luma) -> Luma {
        if self.turns() {
            return taken(reference, self.place_in_reference());
        }
        shifted(reference, -self.shift_u_px, -self.shift_v_px)
    }
}

/// The middle of a picture.
#[must_use]
pub fn middle_of(picture: &Luma) -> PixelPoint {
    PixelPoint::new(
        (picture.width as f64 - 1.0) / 2.0,
        (picture.height as f64 - 1.0) / 2.0,
    )
}

/// Root mean square distance of a picture's points from its `middle`, px.
#[must_use]
pub fn reach_px(middle: PixelPoint) -> f64 {
    middle.u_px.hypot(middle.v_px) / 3.0_f64.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TURNED: Registration = Registration {
        shift_u_px: 3.0,
        shift_v_px: -2.0,
        middle: PixelPoint::new(319.5, 239.5),
        turn_rad: 0.02,
        ..Registration::IDENTITY
    };

    #[test]
    fn a_frame_that_turns_is_taken_back() {
        let middle = TURNED.frame_from_reference(TURNED.middle);
        assert!(middle.distance_px(PixelPoint::new(322.5, 237.5)) < 1e-12);
        let right = TURNED.frame_from_reference(PixelPoint::new(419.5, 239.5));
        let (sin, cos) = 0.02_f64.sin_cos();
        let expected = PixelPoint::new(322.5 + 100.0 * cos, 237.5 + 100.0 * sin);
        assert!(right.distance_px(expected) < 1e-12);
        for p in [PixelPoint::new(0.0, 0.0), PixelPoint::new(600.0, 17.0)] {
            let back = TURNED.reference_from_frame(TURNED.frame_from_reference(p));
            assert!(back.distance_px(p) < 1e-10, "{back:?}");
        }
    }

    #[test]
    fn against_its_own_turn_a_frame_is_only_shifted() {
        assert!(!TURNED.against_turn_of(&TURNED).turns());
        let other = Registration {
            turn_rad: -0.005,
            ..TURNED
        };
        // From the turned reference to the one before, and on to the frame.
        let turned = TURNED.unshifted();
        let p = PixelPoint::new(100.0, 50.0);
        let by_both = other.frame_from_reference(turned.reference_from_frame(p));
        let at_once = other.against_turn_of(&TURNED).frame_from_reference(p);
        assert!(by_both.distance_px(at_once) < 1e-10);
    }

    #[test]
    fn a_smaller_picture_turns_alike() {
        let half = TURNED.scaled(0.5);
        // The middle of a small pixel lies between those of its four.
        let small = |p: PixelPoint| PixelPoint::new((p.u_px - 0.5) / 2.0, (p.v_px - 0.5) / 2.0);
        let p = PixelPoint::new(100.5, 50.5);
        let there = half.frame_from_reference(small(p));
        assert!(there.distance_px(small(TURNED.frame_from_reference(p))) < 1e-10);
    }
}
