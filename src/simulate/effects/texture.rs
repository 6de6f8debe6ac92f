//! Texture of the background: value noise of four octaves (Perlin 1985), fixed in the picture.

use super::{Action, BackdropPattern, Effect, EffectEstimate, Ideal};
use crate::geometry::PixelPoint;
use crate::simulate::scene::Scene;

/// Texture of the background.
pub(super) struct Texture;

/// Sizes of the octaves' grains, px, and their weights; not multiples of each other, so that no grid shows.
const OCTAVES: [(f64, f64); 4] = [(4.3, 0.5), (11.0, 0.7), (37.0, 1.0), (131.0, 1.0)];
/// Standard deviation of the sum above, by its weights: smoothly interpolated uniform values have 0.36 each in the
/// mean over a cell.
const SPREAD: f64 = 0.60;

impl Effect for Texture {
    fn name(&self) -> &'static str {
        "texture"
    }

    fn estimate(&self, scene: &Scene, _ideal: &Ideal) -> EffectEstimate {
        EffectEstimate::grey(scene.look.texture_grey, "standard deviation as given")
    }

    fn action(&self, scene: &Scene) -> Action {
        if scene.look.texture_grey > 0.0 {
            Action::BackdropPattern(Box::new(ValueNoise {
                seed: scene.seed,
                amplitude: scene.look.texture_grey / SPREAD,
            }))
        } else {
            Action::Nothing
        }
    }
}

struct ValueNoise {
    seed: u64,
    amplitude: f64,
}

impl BackdropPattern for ValueNoise {
    fn grey(&self, at: PixelPoint) -> f64 {
        let sum: f64 = OCTAVES
            .iter()
            .zip(self.seed..)
            .map(|((grain, weight), seed)| weight * octave(at.u_px / grain, at.v_px / grain, seed))
            .sum();
        self.amplitude * sum
    }
}

fn octave(x: f64, y: f64, seed: u64) -> f64 {
    let (i, j) = (x.floor(), y.floor());
    let smooth = |t: f64| t * t * (3.0 - 2.0 * t);
    let (s, t) = (smooth(x - i), smooth(y - j));
    let value = |di: i64, dj: i64| lattice(i as i64 + di, j as i64 + dj, seed);
    let top = value(0, 0) * (1.0 - s) + value(1, 0) * s;
    let bottom = value(0, 1) * (1.0 - s) + value(1, 1) * s;
    top * (1.0 - t) + bottom * t
}

/// A value in −1..1 for each lattice point (the finaliser of SplitMix64: Steele, Lea, Flood 2014).
fn lattice(i: i64, j: i64, seed: u64) -> f64 {
    let mut h = seed
        .wrapping_mul(0x9E37_79B9_7F4A_7C15)
        .wrapping_add((i as u64).wrapping_mul(0xD1B5_4A32_D192_ED03))
        .wrapping_add((j as u64).wrapping_mul(0x8CB9_2BA7_2F3D_8DD7));
    h = (h ^ (h >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    h = (h ^ (h >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    h ^= h >> 31;
    (h >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}
