//! Compression with loss (H.264).

use super::{Action, Effect, EffectEstimate, Ideal};
use crate::simulate::scene::{Codec, Scene};

/// Compression with loss.
pub(super) struct Compression;

impl Effect for Compression {
    fn name(&self) -> &'static str {
        "codec"
    }

    fn estimate(&self, scene: &Scene, _ideal: &Ideal) -> EffectEstimate {
        let error = match scene.camera.codec {
            Codec::Lossless => 0.0,
            // Qstep doubles every 6 and is 0.625 at 0 (ITU-T H.264, 8.5.9); rounding spreads by Qstep/√12.
            Codec::H264 { crf } => 0.625 * (f64::from(crf) / 6.0).exp2() / 12.0_f64.sqrt(),
        };
        EffectEstimate::grey(
            error,
            "Qstep/√12, Qstep = 0.625 · 2^(QP/6), ITU-T H.264, QP ≈ crf",
        )
    }

    fn action(&self, scene: &Scene) -> Action {
        match scene.camera.codec {
            Codec::Lossless => Action::Nothing,
            Codec::H264 { crf } => Action::Lossy(crf),
        }
    }
}
