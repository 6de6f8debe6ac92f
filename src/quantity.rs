//! A measured number and how sure it is.

use schemars::JsonSchema;
use serde::Serialize;

/// A measured quantity: value and standard uncertainty (k = 1), both in the unit that the field's name says.
///
/// The uncertainty is `None` where it was not determined; it is never 0, negative or NaN.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
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

    /// The same with one more error, of this standard uncertainty, independent of what it has.
    #[must_use]
    pub fn with_more_std(self, std: f64) -> Self {
        Self {
            std_uncertainty: self.std_uncertainty.map(|s| s.hypot(std)),
            ..self
        }
    }
}
