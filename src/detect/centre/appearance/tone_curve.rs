//! What a camera makes of light before it stores it: a tone curve.
//!
//! Lens, pixels and shutter mix the light of ball and wall; grey levels are stored after a curve that is steep in the dark (about the power 1/2.2, or
//! a maker's own). The model of [`ball`](crate::detect::centre::ball) mixes grey levels. For centres that is nearly as good: what it is off by is nearly
//! alike all around the ball (docs/limits.md). But half of the way from wall to ball in grey levels is less than half in light, so that a bright ball's
//! edge is taken for up to half a blur further out than it is, and a dark one's further in. With L the light of a grey level,
//!
//! ```text
//! L(grey) = ((grey - black)/(white - black))^γ             grey = L⁻¹( L(B) (1 - c) + m )
//! ```
//!
//! (times white - black, so that terms keep their order), which is the model of grey levels for γ = 1. Below [`TOE`] the curve goes on straight, as those
//! of video do.
//!
//! γ shows in how the edge's two halves differ, and so does what a codec takes from an edge: of lossless recordings γ comes out to a few hundredths, of
//! H.264's by a factor of 1.3 to 1.5 off. So the pixels' γ only says which kind of camera it is likely to be, and the radius is as unsure as that leaves γ.
//!
//! Assumed: a power stands for the curve between the grey levels of ball and wall, the same in all frames. Sharpening is taken for a part of the curve as
//! far as it looks like one; what it does beside that is `sharpening`'s.

use crate::frames::LumaRange;
use crate::numeric::parabola::Parabola;
use crate::quantity::Quantity;

/// ln γ of the fits that tell how cost and radius depend on it: γ = 1, 1.5 and 2.2.
pub const LOG_GAMMAS: [f64; 3] = [0.0, 0.4, 0.8];

/// What is known of ln γ before pixels are looked at: mean and standard deviation, of cameras that store light as it is (of machine vision, and most of
/// high speed; rendered scenes) and of those with the curve of video and photographs. Either is as likely.
const PRIOR: [(f64, f64); 2] = [(0.0, 0.05), (0.75, 0.2)];

/// What codec and lens make of an edge is alike in all frames: together they tell ln γ no better than so much of one frame with noise alone would. (24
/// rendered recordings of balls of R 6 to 25 px by H.264, with γ = 1 and 2.2: ln γ is off by 0.24 and 0.38, root mean square, 8 times what noise leaves 32
/// frames.)
const WORTH_FRAMES: f64 = 0.5;

/// Pixels that have ln γ further than this outside of the fits' tell no camera's curve, but what else is at the edge.
const BEYOND: f64 = 0.3;

/// By how much the radius differs from that of the first fit where three fits to `frames` with [`LOG_GAMMAS`] have these costs, in noise variances, and
/// differ by so much from the first, px. `None` where they are no numbers; no uncertainty where it would be 0.
#[must_use]
pub fn by_tone(costs: [f64; 3], larger_px: [f64; 3], frames: usize) -> Option<Quantity> {
    let cost = Parabola::through(LOG_GAMMAS, costs);
    // A cost is -2 times a likelihood's logarithm. One without a minimum has no room for a parabola, and is taken to tell nothing.
    let (seen, variance) = cost.minimum().map_or((0.0, f64::INFINITY), |minimum| {
        let seen = minimum.clamp(LOG_GAMMAS[0] - BEYOND, LOG_GAMMAS[2] + BEYOND);
        (
            seen,
            2.0 / cost.bend() * frames as f64 / WORTH_FRAMES + (minimum - seen).powi(2),
        )
    });
    let (log_gamma, std) = posterior(seen, variance);
    let larger = Parabola::through(LOG_GAMMAS, larger_px);
    // Where the slope vanishes the bend is left.
    Quantity::new(
        larger.at(log_gamma),
        std * larger
            .slope_at(log_gamma)
            .hypot(std::f64::consts::FRAC_1_SQRT_2 * larger.bend() * std),
    )
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

/// From this part of the range on down a curve is straight.
const TOE: f64 = 0.04;

/// A tone curve, for a ball of some brightness.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToneCurve {
    gamma: f64,
    /// The grey level of no light, and how far white is above it.
    black_grey: f64,
    range_grey: f64,
    /// The ball's own, mean of its disc, and how its light changes with the grey level there.
    ball_grey: f64,
    slope: f64,
}

impl ToneCurve {
    /// Of this γ, for a ball whose light has these `terms`, in grey levels.
    #[must_use]
    pub fn new(gamma: f64, range: LumaRange, terms: &[f64]) -> Self {
        let black_grey = f64::from(range.black);
        let mut tone = Self {
            gamma,
            black_grey,
            range_grey: f64::from(range.white) - black_grey,
            // (The other terms cancel around the ball; √(1 - ρ²) is 2/3, mean of the disc.)
            ball_grey: terms[0] + 2.0 / 3.0 * terms.get(1).unwrap_or(&0.0),
            slope: 1.0,
        };
        tone.slope = 1.0 / tone.grey(tone.light(tone.ball_grey)).1;
        tone
    }

    /// Light at the end of the straight part, and its slope there, as parts of the range.
    fn toe(&self) -> (f64, f64) {
        (TOE.powf(self.gamma), self.gamma * TOE.powf(self.gamma - 1.0))
    }

    /// The light of a grey level.
    #[must_use]
    pub fn light(&self, grey: f64) -> f64 {
        let part = (grey - self.black_grey) / self.range_grey;
        let light = if part > TOE {
            part.powf(self.gamma)
        } else {
            let (light, slope) = self.toe();
            light + slope * (part - TOE)
        };
        self.range_grey * light
    }

    /// The grey level of a light, and how that changes with the light.
    #[must_use]
    pub fn grey(&self, light: f64) -> (f64, f64) {
        let light = light / self.range_grey;
        let (least, steep) = self.toe();
        let (part, slope) = if light > least {
            let part = light.powf(1.0 / self.gamma);
            (part, part / (self.gamma * light))
        } else {
            (TOE + (light - least) / steep, 1.0 / steep)
        };
        (self.black_grey + self.range_grey * part, slope)
    }

    /// The terms of a ball's light whose `terms` are grey levels: of the first order around its mean.
    #[must_use]
    pub fn terms(&self, terms: &[f64]) -> Vec<f64> {
        let mut light: Vec<f64> = terms.iter().map(|t| t * self.slope).collect();
        light[0] = self.light(self.ball_grey) + self.slope * (terms[0] - self.ball_grey);
        light
    }

    /// What multiplies the ball's light where its grey levels are multiplied by `strength`.
    #[must_use]
    pub fn strength(&self, strength: f64) -> f64 {
        1.0 + (self.light(strength * self.ball_grey) - self.light(self.ball_grey))
            / self.light(self.ball_grey).max(self.toe().0 * self.range_grey)
    }

    /// The light of a tilt in grey levels.
    #[must_use]
    pub fn tilt(&self, tilt_grey: f64) -> f64 {
        self.slope * tilt_grey
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TERMS: [f64; 4] = [150.0, 20.0, 30.0, -10.0];
    const LIMITED: LumaRange = LumaRange {
        black: 16,
        white: 235,
    };

    #[test]
    fn the_radius_is_that_of_the_kinds_of_cameras_which_the_pixels_speak_for() {
        let costs = |log_gamma: f64, std: f64| LOG_GAMMAS.map(|x| 100.0 + ((x - log_gamma) / std).powi(2));
        let larger_px = LOG_GAMMAS.map(|x| -0.3 * x);
        let at = |costs| {
            let found = by_tone(costs, larger_px, 12).unwrap();
            (found.value, found.std_uncertainty.unwrap())
        };
        // Pixels that tell nothing leave the prior: in the middle of both kinds.
        let [straight, video] = PRIOR;
        for unknown in [[5.0; 3], [1.0, 2.0, 1.0]] {
            let (larger_px, std_px) = at(unknown);
            assert!((larger_px + 0.3 * 0.5 * (straight.0 + video.0)).abs() < 1e-12);
            assert!(std_px > 0.3 * 0.5 * (video.0 - straight.0));
        }
        // Sharp ones have their kind, and their place in it.
        let (larger_px, std_px) = at(costs(0.0, 1e-3));
        assert!(larger_px.abs() < 1e-3 && std_px < 0.3 * 0.01);
        let (larger_px, std_px) = at(costs(0.9, 1e-3));
        assert!((larger_px + 0.3 * 0.9).abs() < 1e-3 && std_px < 0.3 * 0.01);
        // Those that run away are no cameras', and not sharp for it.
        let (larger_px, std_px) = at(costs(2.5, 1e-3));
        assert!(
            larger_px > -0.3 * 1.1 && std_px > 0.3 * 0.1,
            "{larger_px} {std_px}"
        );
        assert_eq!(by_tone([f64::NAN; 3], [f64::NAN; 3], 12), None);
    }

    #[test]
    fn a_straight_curve_leaves_grey_levels_as_they_are() {
        let tone = ToneCurve::new(1.0, LIMITED, &TERMS);
        for grey in [5.0, 20.0, 60.0, 160.0, 240.0] {
            assert!((tone.light(grey) - (grey - 16.0)).abs() < 1e-9);
            let (same, slope) = tone.grey(tone.light(grey));
            assert!((same - grey).abs() < 1e-9 && (slope - 1.0).abs() < 1e-9);
        }
        let terms = tone.terms(&TERMS);
        assert!((terms[0] - (150.0 - 16.0)).abs() < 1e-9);
        assert!(
            terms[1..]
                .iter()
                .zip(&TERMS[1..])
                .all(|(a, b)| (a - b).abs() < 1e-9)
        );
    }

    #[test]
    fn grey_levels_come_back_and_slopes_are_those_of_small_changes() {
        let tone = ToneCurve::new(2.2, LIMITED, &TERMS);
        for grey in [5.0, 16.0, 22.0, 60.0, 160.0] {
            let light = tone.light(grey);
            let (same, slope) = tone.grey(light);
            assert!((same - grey).abs() < 1e-9);
            let step = 1e-6 / slope;
            assert!((tone.grey(light + step).0 - grey - 1e-6).abs() < 1e-9);
        }
        // All of a ball is brighter by a little.
        let more = ToneCurve::new(2.2, LIMITED, &TERMS.map(|t| 1.001 * t));
        let mean = |tone: &ToneCurve, terms: &[f64]| {
            let light = tone.terms(terms);
            light[0] + 2.0 / 3.0 * light[1]
        };
        let times = mean(&more, &TERMS.map(|t| 1.001 * t)) / mean(&tone, &TERMS);
        assert!((times - tone.strength(1.001)).abs() < 1e-9);
    }
}
