//! What a camera adds to edges before it stores a picture: sharpening (unsharp mask).
//!
//! Phones and most cameras add a part a of what a picture differs by from a softer one ([`Edge`](crate::detect::centre::ball::Edge)). A ball's edge is
//! steeper then and overshoots on both sides, and of that the light on the ball takes the inner half for its own, while the wall is what it is: the
//! ball seems smaller by up to 0.2 px. Centres do not move, as it is alike all around.
//!
//! Pixels tell a by how well the ball is fitted with it. The mask's width, which they hardly tell, is a usual one, and a codec takes a part of the
//! overshoot: in 13 rendered recordings with masks of 0.8 to 2 px and a of 0.3 to 1.2 the fit with the best a brings the radius back by about half of
//! what the mask moves it. So the radius is as uncertain as that moves it.
//!
//! Assumed: the same in all frames, and linear in grey levels. A camera that sharpens less where edges are strong is taken for one that sharpens less.

use crate::numeric::parabola::Parabola;
use crate::quantity::Quantity;

/// a of the fits that tell how cost and radius depend on it.
pub const TRIED: [f64; 3] = [0.0, 0.4, 0.8];

/// No camera sharpens more.
const MOST: f64 = 1.5;

/// One parameter more costs so many noise variances (Akaike's criterion).
const PARAMETER_COST: f64 = 2.0;

/// By how much the radius is another than that of the fit without where fits with [`TRIED`] have these costs, in noise variances, and differ by so much from
/// the first, px; `None` where no sharpening is likelier than any.
#[must_use]
pub fn by_sharpening(costs: [f64; 3], larger_px: [f64; 3]) -> Option<Quantity> {
    let cost = Parabola::through(TRIED, costs);
    let likeliest = cost.minimum().map_or(TRIED[2], |a| a.min(MOST));
    let gain = costs[0] - cost.at(likeliest);
    // (Positively: costs that are no numbers speak for nothing.)
    if !(likeliest > 0.0 && gain > 0.0) {
        return None;
    }
    // Akaike's weight of it against none.
    let weight = 1.0 / (1.0 + (-0.5 * (gain - PARAMETER_COST)).exp());
    let whole = Parabola::through(TRIED, larger_px).at(likeliest);
    // Of what it moves by, another half may be missing; and whether it does is uncertain by itself.
    Quantity::new(weight * whole, weight.sqrt() * whole.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn costs(part: f64, std: f64) -> [f64; 3] {
        TRIED.map(|a| 100.0 + ((a - part) / std).powi(2))
    }

    #[test]
    fn the_radius_moves_as_far_as_the_pixels_speak_for_sharpening() {
        let larger_px = TRIED.map(|a| 0.1 * a);
        let of = |costs| {
            let found = by_sharpening(costs, larger_px)?;
            Some((found.value, found.std_uncertainty?))
        };
        // As good as certain.
        let (value, std) = of(costs(0.6, 0.01)).unwrap();
        assert!((value - 0.06).abs() < 1e-9 && (std - 0.06).abs() < 1e-9);
        // Hardly: a parameter more is not worth it.
        let (value, std) = of(costs(0.6, 1.0)).unwrap();
        assert!(value < 0.03 && std < 0.06 && value < std);
        // Softer than none is none, and no numbers are none.
        assert_eq!(of(costs(-0.3, 0.01)), None);
        assert_eq!(of([f64::NAN; 3]), None);
        assert_eq!(of([100.0; 3]), None);
    }
}
