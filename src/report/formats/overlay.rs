//! `<stem>.overlay.mp4`: the recording with what was measured drawn over it.

use super::{Contents, OutputFormat};
use crate::frames;
use crate::pipeline::Measurement;
use crate::report::overlay::Overlay;
use std::error::Error;

/// The video to check a measurement by.
pub struct OverlayVideo;

impl OutputFormat for OverlayVideo {
    fn name(&self) -> &'static str {
        "overlay"
    }

    fn suffix(&self) -> &'static str {
        "overlay.mp4"
    }

    fn needs_frames(&self) -> bool {
        true
    }

    fn contents<'a>(
        &self,
        measurement: &'a Measurement,
    ) -> Result<Contents<'a>, Box<dyn Error + Send + Sync>> {
        let overlay = Overlay::new(measurement);
        Ok(Contents::Video(Box::new(move |to| {
            frames::recode(&measurement.video.path, to, &mut |frame, picture| {
                overlay.draw(frame, picture);
            })
        })))
    }
}
