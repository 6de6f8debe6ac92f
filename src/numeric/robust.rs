//! Robust statistics: what the bulk of the numbers says, whatever some of them do.
//!
//! Tukey's biweight (Beaton and Tukey 1974): a residual r has the weight (1 − (r/c)²)² within the cut c, none beyond it. With
//! c = 4.685 standard deviations it is 95 % as efficient as least squares on normal residuals. The standard deviation comes
//! from the median of the magnitudes, of which half may be wrong. Where a distribution is not symmetric about 0, the median of
//! the magnitudes is not 0.6745 standard deviations, and [`STD_OF_MEDIAN`] does not hold.

/// Tukey's cut in standard deviations: 95 % efficiency for normal residuals.
pub const TUKEY: f64 = 4.685;

/// Standard deviation of the median of many normal values over that of their mean, √(π/2).
pub const MEDIAN_STD_OVER_MEAN_STD: f64 = 1.2533;

/// Standard deviation of a normal variable over the median of its magnitude (the MAD).
pub const STD_OF_MEDIAN: f64 = 1.4826;

/// Tukey's weight of a residual; `cut` is [`TUKEY`] standard deviations.
#[inline]
#[must_use]
pub fn tukey_weight(residual: f64, cut: f64) -> f64 {
    let x = residual / cut;
    if x.abs() < 1.0 { (1.0 - x * x).powi(2) } else { 0.0 }
}

/// What a residual costs by the same rule: (r/σ)², its term of χ², for a small one, levelling off at 4.685²/3 beyond the cut.
#[inline]
#[must_use]
pub fn tukey_cost(residual: f64, cut: f64) -> f64 {
    let x = 1.0 - (residual / cut).powi(2).min(1.0);
    TUKEY * TUKEY / 3.0 * (1.0 - x * x * x)
}

/// The middle one of `values`, which are reordered (the upper of two); `None` for none.
pub fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// The lower median of `values`, which are reordered; 0 for none. Linear in their number: for pixels.
pub fn lower_median(values: &mut [f32]) -> f32 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = (values.len() - 1) / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}

/// Standard deviation of normal residuals from the median of their `magnitudes`, which are reordered; `None` for none.
pub fn std_from_magnitudes(magnitudes: &mut [f64]) -> Option<f64> {
    median(magnitudes).map(|m| STD_OF_MEDIAN * m)
}

/// The value that most of `values` have to within `reach` to either side (the median of those), where that is a third of them
/// or more; otherwise the median of all. `values` are reordered.
pub fn commonest(values: &mut [f64], reach: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let (mut from, mut to) = (0, 0);
    let mut best = 0..0;
    for &middle in values.iter() {
        while middle - values[from] > reach {
            from += 1;
        }
        while to < values.len() && values[to] - middle <= reach {
            to += 1;
        }
        if to - from > best.len() {
            best = from..to;
        }
    }
    if 3 * best.len() >= values.len() {
        median(&mut values[best])
    } else {
        median(values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_commonest_is_where_most_are_close_together() {
        assert_eq!(commonest(&mut [], 0.1), None);
        assert_eq!(commonest(&mut [5.0], 0.1), Some(5.0));
        assert_eq!(commonest(&mut [0.0, 0.3, 0.0, 0.5, 0.7, 0.0], 0.1), Some(0.0));
        assert_eq!(commonest(&mut [1.6, 1.0, 0.9, 1.59, 0.4, 1.61], 0.05), Some(1.6));
        // No two alike.
        assert_eq!(commonest(&mut [4.0, 1.0, 2.0, 3.0, 5.0], 0.1), Some(3.0));
    }

    #[test]
    fn the_weight_follows_from_the_slope_of_the_cost() {
        let (cut, h) = (TUKEY, 1e-5);
        for r in [0.1, 1.0, 3.0, 4.6, 5.0] {
            let slope = (tukey_cost(r + h, cut) - tukey_cost(r - h, cut)) / (2.0 * h);
            assert!((slope - 2.0 * r * tukey_weight(r, cut)).abs() < 1e-8, "{r}");
        }
    }

    #[test]
    fn medians_of_even_counts() {
        assert_eq!(median(&mut [4.0, 1.0, 3.0, 2.0]), Some(3.0));
        assert_eq!(lower_median(&mut [4.0, 1.0, 3.0, 2.0]), 2.0);
        assert_eq!((median(&mut []), lower_median(&mut [])), (None, 0.0));
    }
}
