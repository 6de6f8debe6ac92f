//! What overexposure hides of the radius and the place of a ball.
//!
//! A pixel shows no more than white. The edge of a rim that is brighter is cut off from above: what is left of it looks like the sharper edge of a
//! dimmer ball that reaches further out; before a wall that is white, of a smaller one. By how much depends on how bright ball or wall are, which
//! cannot be seen. (A fit of min(model, white) was tried, with white free: brightness, blur and radius can hardly be told apart then, frame by
//! frame least of all.) So centres are found as if white were the brightness itself, which repeats from frame to frame, and what is hidden is a
//! standard uncertainty of the radius and of the shift that all centres share, in proportion to the blur.
//!
//! Assumed: a codec leaves half of what is cut off at white a little below it. The uncertainties are larger than need be where a camera goes on above
//! what the file calls white (limited range, used beyond 235), and where a highlight is cut off among the pixels that are fitted. Not seen are a
//! camera whose brightest pixels stay levels below white, a colour of which one channel alone is cut off, and a ball of a radius below two blurs, which
//! has no pixel that is clear of the edge.

use super::ball::{self, BandPixel, norm};
use super::disc::Disc;

/// By this part of the blur the radius of a ball is off whose rim is white, root mean square. (44 rendered recordings, R 6 to 33 px, ball or wall
/// overexposed by factors of 1.05 to 2, H.264; the largest: 2.0.)
const RADIUS_BLURS: f64 = 0.8;

/// By this part of the blur the centres are off together, along each axis, root mean square. (The same; the largest: 0.5.)
const SHIFT_BLURS: f64 = 0.2;

/// From so many blurs away from the outline on a pixel shows the ball without the wall, or the wall without the ball. (The outline of a white ball is up to
/// two blurs too far out, and its blur looks small: a ring close to it shows that edge.)
const CLEAR_BLURS: f64 = 1.5;

/// A pixel that is this little below white is white for what rounding and codecs leave, grey levels.
const ABOUT_WHITE_GREY: f64 = 1.0;

/// How much of a ball or of the wall is overexposed, and the blur of the edge between them.
#[derive(Debug, Clone, Copy, Default)]
pub struct Overexposure {
    /// Part of the pixels within the outline that are fitted, or of those beyond it, that are white: the larger of the two.
    pub white_part: f64,
    blur_px: f64,
}

impl Overexposure {
    /// Of the ball that is in these frames at these discs, in a recording whose white is `white_grey`.
    #[must_use]
    pub fn of(frames: &[(Disc, &[BandPixel])], blur_px: f64, white_grey: u8) -> Self {
        let white_from = f64::from(white_grey) - ABOUT_WHITE_GREY;
        // Pixels within the outline and beyond it: all, and those that are white.
        let mut sides = [[0_usize; 2]; 2];
        for (disc, pixels) in frames {
            for p in *pixels {
                let (x, y) = ball::nearest_offset(disc, p.u, p.v);
                let beyond_px = norm(x, y) - disc.radius_px;
                if beyond_px.abs() > CLEAR_BLURS * blur_px {
                    let [all, white] = &mut sides[usize::from(beyond_px > 0.0)];
                    *all += 1;
                    *white += usize::from(p.grey >= white_from);
                }
            }
        }
        let part = |[all, white]: [usize; 2]| white as f64 / all.max(1) as f64;
        Self {
            white_part: part(sides[0]).max(part(sides[1])),
            blur_px,
        }
    }

    /// The blur times the part of the rim that is cut off, px.
    fn hidden_px(&self) -> f64 {
        (2.0 * self.white_part).min(1.0) * self.blur_px
    }

    /// Standard uncertainty of a shift that all centres share, root mean square of the two coordinates, px.
    #[must_use]
    pub fn shift_std_px(&self) -> f64 {
        SHIFT_BLURS * self.hidden_px()
    }

    /// Standard uncertainty of the radius, px.
    #[must_use]
    pub fn radius_std_px(&self) -> f64 {
        RADIUS_BLURS * self.hidden_px()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::PixelPoint;

    /// Of a ball of R 10 px with a blur of 1 px whose pixels are as bright as `grey` says, `beyond_px` from the outline.
    fn of_ball(grey: impl Fn(f64) -> f64) -> Overexposure {
        let disc = Disc {
            centre: PixelPoint::new(0.0, 0.0),
            radius_px: 10.0,
            swept_px: [0.0; 2],
            bent_px: [0.0; 2],
        };
        let pixels: Vec<BandPixel> = (-15..=15)
            .flat_map(|v| (-15..=15).map(move |u| (f64::from(u), f64::from(v))))
            .map(|(u, v)| BandPixel {
                u,
                v,
                grey: grey(norm(u, v) - 10.0),
                background: 40.0,
                sector: 0,
                at_edge: false,
            })
            .collect();
        Overexposure::of(&[(disc, &pixels)], 1.0, 235)
    }

    #[test]
    fn a_white_ball_and_a_white_wall_count_and_the_edge_between_does_not() {
        let ball = of_ball(|beyond_px| if beyond_px < 0.0 { 236.0 } else { 40.0 });
        let wall = of_ball(|beyond_px| if beyond_px < 0.0 { 40.0 } else { 234.0 });
        for white in [ball, wall] {
            assert_eq!(white.white_part, 1.0);
            assert_eq!(
                (white.radius_std_px(), white.shift_std_px()),
                (RADIUS_BLURS, SHIFT_BLURS)
            );
        }
        let edge = of_ball(|beyond_px| if beyond_px.abs() < 1.0 { 255.0 } else { 180.0 });
        assert_eq!(edge.white_part, 0.0);
        assert_eq!(edge.radius_std_px(), 0.0);
    }
}
