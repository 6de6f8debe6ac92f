//! A shift of the whole picture by its edges alone, whatever the light does: each field of the scene may be brighter or darker by
//! itself.
//!
//! A soft shadow, or a lamp that dims on one side, changes the brightness over large parts of the scene, and no one gain and
//! offset describes that; what is left over may be fitted better by a shift than by none. But a camera that moves moves all edges
//! of the scene, and a soft shadow moves none. So the mean of each field is taken out, and what is left of it are edges. The fields
//! have to be smaller than the shadow is soft, and hold some edges each.

use crate::numeric::robust::{STD_OF_MEDIAN, TUKEY, lower_median, tukey_weight};
use nalgebra::{SMatrix, SVector};

/// A pixel of the scene as a frame shows it with some shift, or another motion of so many parameters.
#[derive(Debug, Clone, Copy)]
pub struct LitPixel<const N: usize> {
    /// The field of the scene.
    pub field: usize,
    /// Grey of the frame beyond what the scene is there, grey levels.
    pub residual: f64,
    /// How the scene's grey grows along each parameter, grey levels a pixel.
    pub gradient: SVector<f64, N>,
}

/// Residuals are not smaller than this, grey levels: those of rounding.
const LEAST_SPREAD_GREY: f64 = 0.3;

/// The step of Gauss-Newton for the motion, px, and what the edges tell of it, Σ g gᵀ; `None` where they tell nothing.
pub fn step<const N: usize>(
    pixels: &[LitPixel<N>],
    fields: usize,
) -> Option<(SVector<f64, N>, SMatrix<f64, N, N>)> {
    let mut of_field: Vec<Vec<f32>> = vec![Vec::new(); fields];
    for p in pixels {
        of_field[p.field].push(p.residual as f32);
    }
    let middles: Vec<f64> = of_field
        .iter_mut()
        .map(|r| {
            if r.is_empty() {
                0.0
            } else {
                f64::from(lower_median(r))
            }
        })
        .collect();
    let mut sizes: Vec<f32> = pixels
        .iter()
        .map(|p| (p.residual - middles[p.field]).abs() as f32)
        .collect();
    if sizes.is_empty() {
        return None;
    }
    let spread = (STD_OF_MEDIAN * f64::from(lower_median(&mut sizes))).max(LEAST_SPREAD_GREY);
    let weight = |p: &LitPixel<N>| tukey_weight(p.residual - middles[p.field], TUKEY * spread);
    // Σw, Σw r, Σw g of each field.
    let mut sums = vec![(0.0_f64, 0.0_f64, SVector::<f64, N>::zeros()); fields];
    for p in pixels {
        let (w, sum) = (weight(p), &mut sums[p.field]);
        *sum = (sum.0 + w, sum.1 + w * p.residual, sum.2 + w * p.gradient);
    }
    let (mut information, mut right) = (SMatrix::<f64, N, N>::zeros(), SVector::<f64, N>::zeros());
    for p in pixels {
        let (w, sum) = (weight(p), &sums[p.field]);
        if w > 0.0 {
            let (r, g) = (p.residual - sum.1 / sum.0, p.gradient - sum.2 / sum.0);
            information += w * g * g.transpose();
            right -= w * r * g;
        }
    }
    Some((information.try_inverse()? * right, information))
}

/// Two readings of a field's pixels: the scene's grey, the frame's without a shift, the frame's with one.
pub type FieldReadings = Vec<[f64; 3]>;

/// Logarithm of how much likelier the shift makes the frame than none, with gain and offset of each field as they fit it. No field
/// counts for more than a residual that is halved: a hand, a ball fill few.
pub fn ln_likelihood_ratio(fields: &[FieldReadings], noise_grey: f64) -> f64 {
    let of_field = |readings: &FieldReadings| {
        let n = readings.len() as f64;
        let mean = |k: usize| readings.iter().map(|r| r[k]).sum::<f64>() / n;
        let means = [0, 1, 2].map(mean);
        let product = |a: usize, b: usize| {
            readings
                .iter()
                .map(|r| (r[a] - means[a]) * (r[b] - means[b]))
                .sum::<f64>()
        };
        // Scene and frame have noise each.
        let floor = 2.0 * n * noise_grey * noise_grey;
        let left = |k: usize| {
            let (own, both) = (product(0, 0), product(0, k));
            let explained = if own > 0.0 && both > 0.0 {
                both * both / own
            } else {
                0.0
            };
            (product(k, k) - explained).max(0.0) + floor
        };
        0.5 * n * (left(1) / left(2)).ln().clamp(-MOST_LN, MOST_LN)
    };
    fields
        .iter()
        .filter(|f| f.len() >= LEAST_READINGS)
        .map(of_field)
        .sum()
}

/// ln 4: a residual that is halved.
const MOST_LN: f64 = 1.386;

/// A field of fewer pixels has no gain of its own.
const LEAST_READINGS: usize = 5;
