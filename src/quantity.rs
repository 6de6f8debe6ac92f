//! A measured number and how sure it is.

use serde::Serialize;

/// The middle one of `values`, which are reordered (the upper of two); `None` for none.
pub fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
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

/// A measured quantity: value and standard uncertainty (k = 1), both in the unit that the field's name says.
///
/// The uncertainty is `None` where it was not determined; it is never 0, negative or NaN.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quantity {
    /// The best estimate.
    pub value: f64,
    /// Its standard uncertainty, `None` where not determined.
    pub std_uncertainty: Option<f64>,
}

impl Quantity {
    /// `value` with `std_uncertainty`; `None` unless the value is finite. An uncertainty that is not finite and
    /// positive becomes "not determined".
    #[must_use]
    pub fn new(value: f64, std_uncertainty: f64) -> Option<Self> {
        value.is_finite().then(|| Self {
            value,
            std_uncertainty: (std_uncertainty.is_finite() && std_uncertainty > 0.0)
                .then_some(std_uncertainty),
        })
    }

    /// `value` with an uncertainty that nobody determined; `None` unless finite.
    #[must_use]
    pub fn undetermined(value: f64) -> Option<Self> {
        value.is_finite().then_some(Self {
            value,
            std_uncertainty: None,
        })
    }

    /// The same quantity in another unit: both numbers times `factor`.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            value: self.value * factor,
            std_uncertainty: self.std_uncertainty.map(|s| s * factor.abs()),
        }
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
}
