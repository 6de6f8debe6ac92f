//! Metres per pixel as the file gives them.

use super::kind::{NoScale, ScaleContext, ScaleEvidence, ScaleKeys, ScaleKind, quantity};
use crate::calibration::finding::Finding;
use crate::calibration::json::object;
use crate::config::{POSITIVE, Section};
use crate::quantity::Quantity;
use serde_json::Value;

/// `{"metres_per_pixel": ..., "std_uncertainty": ...}`, of undistorted pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct MetresPerPixel {
    /// m/px, above 0.
    pub value: f64,
    /// Standard uncertainty, m/px.
    pub std: Option<f64>,
}

pub(super) static KEYS: ScaleKeys = ScaleKeys {
    name: "metres_per_pixel",
    marks: &["metres_per_pixel"],
    beside: &["std_uncertainty"],
    example: "{\"metres_per_pixel\": m}",
};

impl MetresPerPixel {
    pub(super) fn read(section: &Section<'_>) -> Option<Self> {
        let hint = "a known length in metres over its length in pixels";
        let value = section.number("metres_per_pixel", POSITIVE.or_try(hint));
        let std = section.std_uncertainty("std_uncertainty", value);
        Some(Self { value: value?, std })
    }
}

impl ScaleKind for MetresPerPixel {
    fn keys(&self) -> &'static ScaleKeys {
        &KEYS
    }

    fn metres_per_unit(
        &self,
        _context: &ScaleContext<'_>,
        _evidence: &ScaleEvidence,
    ) -> Result<Option<Quantity>, NoScale> {
        Ok(quantity(self.value, &[self.std.map(|s| s / self.value)]))
    }

    fn to_json(&self) -> Value {
        object([
            ("metres_per_pixel", Some(self.value.into())),
            ("std_uncertainty", self.std.map(Value::from)),
        ])
    }

    fn findings(&self, _context: &ScaleContext<'_>) -> Vec<Finding> {
        let unknown = Finding::remark(
            "scale.std_uncertainty",
            "not given: lengths and speeds will have the tracking's uncertainty only",
        );
        self.std.is_none().then_some(unknown).into_iter().collect()
    }
}
