//! The ball as the scale: its radius in metres against the radius that the recording shows.

use super::kind::{NoScale, ScaleContext, ScaleEvidence, ScaleKeys, ScaleKind, ratio, usable};
use crate::config::Section;
use crate::quantity::Quantity;
use serde_json::{Value, json};

/// `{"ball": true}`.
#[derive(Debug)]
pub(super) struct BallScale;

pub(super) static KEYS: ScaleKeys = ScaleKeys {
    name: "ball",
    marks: &["ball"],
    beside: &[],
    example: "{\"ball\": true}",
};

impl BallScale {
    pub(super) fn read(section: &Section<'_>) -> Option<Self> {
        let hint = "to use another scale, replace the key; the ball's facts belong in ball, at the top level";
        section.flag("ball", hint).map(|()| Self)
    }
}

impl ScaleKind for BallScale {
    fn keys(&self) -> &'static ScaleKeys {
        &KEYS
    }

    fn metres_per_unit(
        &self,
        context: &ScaleContext<'_>,
        evidence: &ScaleEvidence,
    ) -> Result<Option<Quantity>, NoScale> {
        let radius_m = context.ball.radius_m.ok_or(NoScale::NoEvidence(
            "the ball is the scale, but ball.radius_m is not given",
        ))?;
        let seen = usable(evidence.ball_radius_units).ok_or(NoScale::NoEvidence(
            "the ball is the scale, but its radius could not be measured on this recording",
        ))?;
        let given = context.ball.radius_std_m.map(|s| s / radius_m);
        Ok(ratio(radius_m, given, seen))
    }

    fn to_json(&self) -> Value {
        json!({"ball": true})
    }

    fn rests_on_ball(&self) -> bool {
        true
    }

    fn in_words(&self) -> Option<&'static str> {
        Some("the ball's radius against the one seen")
    }
}
