//! Texture of the background: value noise of four octaves (Perlin 1985), fixed in the picture.

use super::{Action, BackdropPattern, Effect, EffectEstimate, Ideal};
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
    fn add_to_row(&self, u_px: &[f64], v_px: f64, row: &mut [f64]) {
        let mut sums = vec![0.0; u_px.len()];
        for ((grain, weight), seed) in OCTAVES.iter().zip(self.seed..) {
            let mut octave = OctaveRow::new(v_px / grain, seed);
            for (sum, u_px) in sums.iter_mut().zip(u_px) {
                *sum += weight * octave.value(u_px / grain);
            }
        }
        for (grey, sum) in row.iter_mut().zip(sums) {
            *grey += self.amplitude * sum;
        }
    }
}

/// One octave along a row, in grains.
struct OctaveRow {
    seed: u64,
    /// Of the lattice's row above, and the weight of the one below.
    above: i64,
    below_weight: f64,
    /// The column of the lattice to the left, and the values of the two to the left and to the right: above, below.
    left: i64,
    values: [[f64; 2]; 2],
}

impl OctaveRow {
    fn new(y: f64, seed: u64) -> Self {
        let (above, t) = whole_and_rest(y);
        Self {
            seed,
            above,
            below_weight: smooth(t),
            // No picture goes so far.
            left: i64::MIN,
            values: [[0.0; 2]; 2],
        }
    }

    fn value(&mut self, x: f64) -> f64 {
        let (left, s) = whole_and_rest(x);
        if left != self.left {
            self.left = left;
            self.values =
                [0, 1].map(|column| [0, 1].map(|row| lattice(left + column, self.above + row, self.seed)));
        }
        let s = smooth(s);
        let [top, bottom] = [0, 1].map(|row| self.values[0][row] * (1.0 - s) + self.values[1][row] * s);
        top * (1.0 - self.below_weight) + bottom * self.below_weight
    }
}

/// The whole number below `x`, and what is left. (`f64::floor` is a call where a processor is not known to have it.)
fn whole_and_rest(x: f64) -> (i64, f64) {
    let towards_zero = x as i64;
    let whole = towards_zero - i64::from(towards_zero as f64 > x);
    (whole, x - whole as f64)
}

fn smooth(t: f64) -> f64 {
    t * t * (3.0 - 2.0 * t)
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
