//! What overexposure hides of the radius and the place of a ball.
//!
//! A pixel shows no more than white. The edge of a rim that is brighter is cut off from above: what is left of it looks like the sharper edge of a
//! dimmer ball that reaches further out; before a wall that is white, of a smaller one. By how much depends on how bright ball or wall are, which
//! cannot be seen. (A fit of min(model, white) was tried, with white free: brightness, blur and radius can hardly be told apart then, frame by
//! frame least of all.) So centres are found as if white were the brightness itself, which repeats from frame to frame, and what is hidden is a
//! standard uncertainty of the radius and of the shift that all centres share, in proportion to the blur.
//!
//! Assumed: a codec leaves half of what is cut off at white a little below it. A camera that goes on above what the file calls white (limited range,
//! used beyond 235) has its ball taken for overexposed there, and larger uncertainties than need be.

use super::ball::{self, BandPixel, norm};
use super::disc::Disc;

/// By this part of the blur the radius of a ball is off whose rim is white, and the shift of its centres along each axis, root mean square. (44 rendered
/// recordings, R 6 to 33 px, ball or wall overexposed by factors of 1.05 to 2, H.264; the largest: 2.0 and 0.5.)
const RADIUS_BLURS: f64 = 0.8;
const SHIFT_BLURS: f64 = 0.2;

/// So many blurs away from the outline a pixel shows the ball alone, or the wall.
const CLEAR_BLURS: f64 = 1.5;

/// How much of a ball is overexposed, and how far its edges reach.
#[derive(Debug, Clone, Copy, Default)]
pub struct Overexposure {
    /// Part of the ball next to its outline, or of what is behind it there, that is white: the larger of the two.
    pub white_part: f64,
    blur_px: f64,
}

impl Overexposure {
    /// Of the ball that is in these frames at these discs, in a recording whose white is `white_grey`.
    #[must_use]
    pub fn of(frames: &[(Disc, &[BandPixel])], blur_px: f64, white_grey: u8) -> Self {
        // Pixels within the outline and beyond it: all, and those that are white.
        let mut sides = [[0_usize; 2]; 2];
        for (disc, pixels) in frames {
            for p in *pixels {
                let (x, y) = ball::nearest_offset(disc, p.u, p.v);
                let beyond_px = norm(x, y) - disc.radius_px;
                if beyond_px.abs() > CLEAR_BLURS * blur_px {
                    let [all, white] = &mut sides[usize::from(beyond_px > 0.0)];
                    *all += 1;
                    *white += usize::from(p.grey >= f64::from(white_grey));
                }
            }
        }
        let part = |[all, white]: [usize; 2]| (2.0 * white as f64 / all.max(1) as f64).min(1.0);
        Self {
            white_part: part(sides[0]).max(part(sides[1])),
            blur_px,
        }
    }

    /// Standard uncertainty of a shift that all centres share, root mean square of the two coordinates, px.
    #[must_use]
    pub fn shift_std_px(&self) -> f64 {
        SHIFT_BLURS * self.white_part * self.blur_px
    }

    /// Standard uncertainty of the radius, px.
    #[must_use]
    pub fn radius_std_px(&self) -> f64 {
        RADIUS_BLURS * self.white_part * self.blur_px
    }
}
