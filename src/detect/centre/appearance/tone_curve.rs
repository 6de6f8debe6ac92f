//! What a camera makes of light before it stores it: a tone curve.
//!
//! Lens, pixels and shutter mix the light of ball and wall; grey levels are stored after a curve that is steep in the dark (about the power 1/2.2, or
//! a maker's own). The model of [`ball`](crate::detect::centre::ball) mixes grey levels. For centres that is as good: what it is off by is alike all
//! around the ball. But half of the way from wall to ball in grey levels is less than half in light, so that a bright ball's edge is taken for up to
//! half a blur further out than it is, and a dark one's further in. With L the light of a grey level,
//!
//! ```text
//! L(grey) = P ((grey - black)/P)^γ             grey = L⁻¹( L(B) (1 - c) + m )
//! ```
//!
//! which is the model of grey levels for γ = 1. P, where light and grey level are the same number, is the brighter one of ball and wall.
//!
//! γ shows in how the edge's two halves differ, and so does what a codec takes from an edge: of lossless recordings γ comes out to a few hundredths, of
//! H.264's by a factor of 1.3 to 1.5 off. So the pixels' γ only says which kind of camera it is likely to be, and the radius is as unsure as that leaves γ.
//!
//! Assumed: a power stands for the curve between the grey levels of ball and wall, the same in all frames. Sharpening is taken for a part of the curve as
//! far as it looks like one.

use crate::quantity::Quantity;

/// ln γ of the fits that tell how cost and radius depend on it: no curve, and two on.
pub const LOG_GAMMAS: [f64; 3] = [0.0, 0.4, 0.8];

/// What is known of ln γ before pixels are looked at: mean and standard deviation, of cameras that store light as it is (machines' and most that are
/// fast; rendered scenes) and of those with the curve of video and photographs. Either is as likely.
const PRIOR: [(f64, f64); 2] = [(0.0, 0.05), (0.75, 0.2)];

/// What codec and lens make of an edge is alike in all frames: together they tell ln γ no better than so much of one frame with noise alone would. (24
/// rendered recordings of balls of R 6 to 25 px by H.264, with γ = 1 and 2.2: ln γ is off by 0.24 and 0.38, root mean square, 8 times what noise leaves 32
/// frames.)
const WORTH_FRAMES: f64 = 0.5;

/// Pixels that have ln γ further than this outside of the fits' tell no camera's curve, but what else is at the edge.
const BEYOND: f64 = 0.3;

/// The radius where three fits to `frames` with [`LOG_GAMMAS`] have these costs, in noise variances, and radii, px. `None` where they are no numbers; no
/// uncertainty where all radii are the same.
#[must_use]
pub fn by_tone(costs: [f64; 3], radii_px: [f64; 3], frames: usize) -> Option<Quantity> {
    let step = LOG_GAMMAS[1] - LOG_GAMMAS[0];
    // Parabolas through the three: slope in the middle, and second derivative.
    let parabola = |[a, b, c]: [f64; 3]| (0.5 * (c - a) / step, (c - 2.0 * b + a) / (step * step));
    let (slope, bend) = parabola(costs);
    // A cost is twice a likelihood's logarithm. One that has no minimum tells nothing.
    let (seen, variance) = if bend > 0.0 {
        let seen = (LOG_GAMMAS[1] - slope / bend).clamp(LOG_GAMMAS[0] - BEYOND, LOG_GAMMAS[2] + BEYOND);
        (seen, 2.0 / bend * frames as f64 / WORTH_FRAMES)
    } else {
        (0.0, f64::INFINITY)
    };
    let (log_gamma, std) = posterior(seen, variance);
    let off = log_gamma - LOG_GAMMAS[1];
    let (slope, bend) = parabola(radii_px);
    let radius_px = radii_px[1] + off * (slope + 0.5 * off * bend);
    Quantity::new(radius_px, (slope + off * bend).abs() * std)
}

/// Mean and standard deviation of ln γ where the pixels have it at `seen` with this variance.
fn posterior(seen: f64, variance: f64) -> (f64, f64) {
    // Each kind of camera by how well it explains what is seen, and where that puts it.
    let kinds = PRIOR.map(|(mean, std)| {
        let both = std * std + variance;
        let towards = std * std / both;
        let (weight, mean) = if variance.is_finite() {
            let off = seen - mean;
            (
                (-0.5 * off * off / both).exp() / both.sqrt(),
                mean + towards * off,
            )
        } else {
            (1.0, mean)
        };
        (weight, mean, std * std * (1.0 - towards))
    });
    let all: f64 = kinds.iter().map(|kind| kind.0).sum();
    let mean = kinds.iter().map(|(weight, mean, _)| weight * mean).sum::<f64>() / all;
    let square = |(weight, at, variance): &(f64, f64, f64)| weight * (variance + (at - mean).powi(2));
    (mean, (kinds.iter().map(square).sum::<f64>() / all).sqrt())
}

/// Darker than this is not told from black, grey levels: the curve is too steep there.
const LEAST_GREY: f64 = 2.0;

/// A tone curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToneCurve {
    gamma: f64,
    /// The grey level of no light.
    black_grey: f64,
    /// P, above black.
    pivot_grey: f64,
}

impl ToneCurve {
    /// Of this γ, for a ball whose light has these `terms`, in grey levels, before a wall of `wall_grey`.
    #[must_use]
    pub fn new(gamma: f64, terms: &[f64], wall_grey: f64, black_grey: f64) -> Self {
        Self {
            gamma,
            black_grey,
            pivot_grey: (terms[0].max(wall_grey) - black_grey).max(LEAST_GREY),
        }
    }

    /// A grey level as a part of P.
    fn part(&self, grey: f64) -> f64 {
        (grey - self.black_grey).max(LEAST_GREY) / self.pivot_grey
    }

    /// The light of a grey level.
    #[must_use]
    pub fn light(&self, grey: f64) -> f64 {
        self.pivot_grey * self.part(grey).powf(self.gamma)
    }

    /// The grey level of a light, and how that changes with the light.
    #[must_use]
    pub fn grey(&self, light: f64) -> (f64, f64) {
        let least = self.pivot_grey * (LEAST_GREY / self.pivot_grey).powf(self.gamma);
        let light = light.max(least);
        let above_black = self.pivot_grey * (light / self.pivot_grey).powf(1.0 / self.gamma);
        (self.black_grey + above_black, above_black / (self.gamma * light))
    }

    /// The terms of the light of a ball whose `terms` are grey levels, and by how much more light a grey level is at its rim. Exact at the rim (that
    /// is the first term: the others are 0 there or cancel all around), of the first order elsewhere.
    #[must_use]
    pub fn of_ball(&self, terms: &[f64]) -> (Vec<f64>, f64) {
        let rim = self.light(terms[0]);
        let slope = self.gamma * rim / (self.part(terms[0]) * self.pivot_grey);
        let mut light: Vec<f64> = terms.iter().map(|t| t * slope).collect();
        light[0] = rim;
        (light, slope)
    }

    /// What multiplies a ball's light where its grey levels are multiplied by `strength`.
    #[must_use]
    pub fn strength(&self, strength: f64, terms: &[f64]) -> f64 {
        (self.part(strength * terms[0]) / self.part(terms[0])).powf(self.gamma)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TERMS: [f64; 4] = [150.0, 20.0, 30.0, -10.0];

    #[test]
    fn the_radius_is_that_of_the_kinds_of_cameras_which_the_pixels_speak_for() {
        let costs = |log_gamma: f64, std: f64| LOG_GAMMAS.map(|x| 100.0 + ((x - log_gamma) / std).powi(2));
        let radii_px = LOG_GAMMAS.map(|x| 10.0 - 0.3 * x);
        let at = |costs| {
            let found = by_tone(costs, radii_px, 12).unwrap();
            (found.value, found.std_uncertainty.unwrap())
        };
        // Pixels that tell nothing leave the prior: in the middle of both kinds.
        let [straight, video] = PRIOR;
        for unknown in [[5.0; 3], [1.0, 2.0, 1.0]] {
            let (radius_px, std_px) = at(unknown);
            assert!((radius_px - (10.0 - 0.3 * 0.5 * (straight.0 + video.0))).abs() < 1e-12);
            assert!(std_px > 0.3 * 0.5 * (video.0 - straight.0));
        }
        // Sharp ones have their kind, and their place in it.
        let (radius_px, std_px) = at(costs(0.0, 1e-3));
        assert!((10.0 - radius_px).abs() < 1e-3 && std_px < 0.3 * 0.01);
        let (radius_px, std_px) = at(costs(0.9, 1e-3));
        assert!((radius_px - (10.0 - 0.3 * 0.9)).abs() < 1e-3 && std_px < 0.3 * 0.01);
        // Those that run away are no cameras'.
        let (far_px, _) = at([3e4, 2e4, 1.01e4]);
        assert!(far_px > 10.0 - 0.3 * 1.1);
        assert_eq!(by_tone([f64::NAN; 3], [f64::NAN; 3], 12), None);
    }

    #[test]
    fn a_straight_curve_leaves_grey_levels_as_they_are() {
        let tone = ToneCurve::new(1.0, &TERMS, 60.0, 16.0);
        for grey in [20.0, 60.0, 160.0, 230.0] {
            assert!((tone.light(grey) - (grey - 16.0)).abs() < 1e-9);
            assert!((tone.grey(tone.light(grey)).0 - grey).abs() < 1e-9);
        }
        let (terms, slope) = tone.of_ball(&TERMS);
        assert!((terms[0] - (150.0 - 16.0)).abs() < 1e-9 && slope == 1.0);
        assert_eq!(terms[1..], TERMS[1..]);
    }

    #[test]
    fn grey_levels_come_back_and_slopes_are_those_of_small_changes() {
        let tone = ToneCurve::new(2.2, &TERMS, 60.0, 16.0);
        for grey in [30.0, 60.0, 160.0] {
            let light = tone.light(grey);
            let (same, slope) = tone.grey(light);
            assert!((same - grey).abs() < 1e-9);
            assert!((tone.grey(light + 1e-6).0 - grey - 1e-6 * slope).abs() < 1e-9);
        }
        // A little more of all of the ball's grey levels at its rim.
        let (terms, slope) = tone.of_ball(&TERMS);
        let (more, _) = tone.of_ball(&TERMS.map(|t| t + 1e-6));
        assert!((more[0] - terms[0] - 1e-6 * slope).abs() < 1e-9);
        let times = tone.strength(1.1, &TERMS);
        assert!((tone.grey(times * terms[0]).0 - 1.1 * 150.0).abs() < 1e-9);
    }
}
