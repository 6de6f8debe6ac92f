//! Noise of a pixel, as frames show it.

use crate::frames::Luma;
use crate::numeric::robust::STD_OF_MEDIAN;

/// Quantum of an 8-bit picture: rounding alone has this standard deviation, grey levels.
pub const ROUNDING_STD_GREY: f64 = 0.29;

/// Standard deviation of a pixel's noise by the differences of successive frames: the median of those is of pixels
/// where nothing moves.
#[must_use]
pub fn frame_noise_grey(survey: &[&Luma]) -> f64 {
    let mut histogram = [0_u64; 256];
    for pair in survey.windows(2) {
        let step = (pair[0].data.len() / 20_000).max(1);
        for (a, b) in pair[0].data.iter().zip(&pair[1].data).step_by(step) {
            histogram[usize::from(a.abs_diff(*b))] += 1;
        }
    }
    (STD_OF_MEDIAN * interpolated_median(&histogram) / std::f64::consts::SQRT_2).max(ROUNDING_STD_GREY)
}

/// Standard deviation of a pixel's noise within one picture, by the median of the mask 1 −2 1 / −2 4 −2 / 1 −2 1, which
/// smooth scenes leave at 0 and white noise at 6 standard deviations (Immerkær 1996).
#[must_use]
pub fn spatial_noise_grey(luma: &Luma) -> f64 {
    let mut histogram = [0_u64; 256];
    let step = (luma.width * luma.height / 20_000).max(1);
    let mut turn = 0;
    for v in 1..luma.height.saturating_sub(1) {
        let rows = [luma.row(v - 1), luma.row(v), luma.row(v + 1)];
        for u in 1..luma.width.saturating_sub(1) {
            turn += 1;
            if turn % step != 0 {
                continue;
            }
            let across = |row: &[u8]| i32::from(row[u - 1]) - 2 * i32::from(row[u]) + i32::from(row[u + 1]);
            let mask = across(rows[0]) - 2 * across(rows[1]) + across(rows[2]);
            histogram[mask.unsigned_abs().min(255) as usize] += 1;
        }
    }
    (STD_OF_MEDIAN * interpolated_median(&histogram) / 6.0).max(ROUNDING_STD_GREY)
}

/// Median of absolute integer differences, interpolated within its bin: a bin at `d` holds |difference| between
/// d − ½ and d + ½ (the bin at 0: between 0 and ½).
#[must_use]
pub fn interpolated_median(histogram: &[u64; 256]) -> f64 {
    let total: u64 = histogram.iter().sum();
    if total == 0 {
        return 0.0;
    }
    let half = total as f64 / 2.0;
    let mut below = 0.0;
    for (d, &n) in histogram.iter().enumerate() {
        let n = n as f64;
        if below + n >= half && n > 0.0 {
            let share = (half - below) / n;
            return if d == 0 {
                0.5 * share
            } else {
                d as f64 - 0.5 + share
            };
        }
        below += n;
    }
    255.0
}
