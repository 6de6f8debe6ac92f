//! The fall as the scale: the acceleration of free fall in m/s² against the fall that the recording shows.

use super::kind::{NoScale, ScaleContext, ScaleEvidence, ScaleKeys, ScaleKind, ratio, usable};
use crate::calibration::finding::Finding;
use crate::config::Section;
use crate::quantity::Quantity;
use serde_json::{Value, json};

/// `{"gravity": true}`.
#[derive(Debug)]
pub(super) struct GravityScale;

pub(super) static KEYS: ScaleKeys = ScaleKeys {
    name: "gravity",
    marks: &["gravity"],
    beside: &[],
    example: "{\"gravity\": true}",
};

impl GravityScale {
    pub(super) fn read(section: &Section<'_>) -> Option<Self> {
        let hint =
            "to use another scale, replace the key; the number belongs in gravity_m_s2, at the top level";
        section.flag("gravity", hint).map(|()| Self)
    }
}

impl ScaleKind for GravityScale {
    fn keys(&self) -> &'static ScaleKeys {
        &KEYS
    }

    fn metres_per_unit(
        &self,
        context: &ScaleContext<'_>,
        evidence: &ScaleEvidence,
    ) -> Result<Option<Quantity>, NoScale> {
        let seen = usable(evidence.gravity_units_s2).ok_or(NoScale::NoEvidence(
            "gravity is the scale, but no fall could be measured on this recording",
        ))?;
        let given = context.gravity_std_m_s2 / context.gravity_m_s2;
        Ok(ratio(context.gravity_m_s2, Some(given), seen))
    }

    fn to_json(&self) -> Value {
        json!({"gravity": true})
    }

    fn rests_on_fall(&self) -> bool {
        true
    }

    fn in_words(&self) -> Option<&'static str> {
        Some("the fall, with the times of the file (or --frame-rate-hz)")
    }

    fn findings(&self, context: &ScaleContext<'_>) -> Vec<Finding> {
        let of_time = Finding::remark(
            "scale",
            "lengths come from the fall, so they are right only where the file's time stamps are those of the capture; give frame_rate_hz for slow motion",
        );
        context
            .frame_rate_hz
            .is_none()
            .then_some(of_time)
            .into_iter()
            .collect()
    }
}
