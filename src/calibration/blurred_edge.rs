//! A straight edge as a camera shows it: the step blurred by the optics and averaged over a pixel.

use std::f64::consts::{FRAC_2_SQRT_PI, SQRT_2};

/// An edge's grey from −1 to 1 and its derivatives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shade {
    /// −1 far on the negative side, 1 on the positive.
    pub value: f64,
    /// By the distance, 1/px.
    pub by_distance: f64,
    /// By the blur, 1/px.
    pub by_blur: f64,
}

/// The mean over a pixel whose centre is `distance_px` from the edge, along its normal: ∫ erf(t / √2 σ) dt over
/// d − ½ .. d + ½, with σ the blur's standard deviation.
pub(super) fn shade(distance_px: f64, blur_px: f64) -> Shade {
    // ∫ erf(t/√2σ) dt = t erf(t/√2σ) + σ √(2/π) exp(−t²/2σ²).
    let integral = |d: f64| {
        let t = d / (SQRT_2 * blur_px);
        let erf = libm::erf(t);
        let by_blur = SQRT_2 * 0.5 * FRAC_2_SQRT_PI * (-t * t).exp();
        (d * erf + blur_px * by_blur, erf, by_blur)
    };
    let (far, near) = (integral(distance_px + 0.5), integral(distance_px - 0.5));
    Shade {
        value: far.0 - near.0,
        by_distance: far.1 - near.1,
        by_blur: far.2 - near.2,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shade_is_the_mean_of_a_blurred_step() {
        for (distance, blur) in [(0.0, 0.7), (0.4, 0.3), (-1.3, 0.9), (2.0, 5.0)] {
            let mean: f64 = (0..2000)
                .map(|i| {
                    let t = distance - 0.5 + (f64::from(i) + 0.5) / 2000.0;
                    libm::erf(t / (SQRT_2 * blur)) / 2000.0
                })
                .sum();
            assert!((shade(distance, blur).value - mean).abs() < 1e-6);
        }
    }

    #[test]
    fn derivatives_are_the_limits_of_differences() {
        let (d, b, h) = (0.3, 0.8, 1e-6);
        let s = shade(d, b);
        let by_d = (shade(d + h, b).value - shade(d - h, b).value) / (2.0 * h);
        let by_b = (shade(d, b + h).value - shade(d, b - h).value) / (2.0 * h);
        assert!((s.by_distance - by_d).abs() < 1e-8 && (s.by_blur - by_b).abs() < 1e-8);
    }
}
