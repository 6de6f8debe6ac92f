//! Scenes to recordings in a temporary folder, as many at once as there are cores: nothing is timed meanwhile.

use super::study::CostError;
use crate::calibration::Calibration;
use crate::frames::{self, FrameError};
use crate::simulate::truth::Truth;
use crate::simulate::{Scene, SimulatedRecording, write};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// A rendered recording; its file lives as long as the folder that it was rendered into.
pub(super) struct Rendered {
    pub video: PathBuf,
    pub calibration: Calibration,
    pub truth: Truth,
    pub bytes: u64,
    pub frames: usize,
}

/// A folder for recordings, deleted when dropped.
pub(super) fn folder() -> Result<tempfile::TempDir, CostError> {
    tempfile::Builder::new()
        .prefix("track-cost-")
        .tempdir()
        .map_err(CostError::Folder)
}

/// Renders all of `scenes` into `dir`.
pub(super) fn render(scenes: &[Scene], dir: &Path) -> Result<Vec<Rendered>, CostError> {
    scenes
        .par_iter()
        .enumerate()
        .map(|(i, scene)| one(scene, &i.to_string(), dir))
        .collect()
}

fn one(scene: &Scene, stem: &str, dir: &Path) -> Result<Rendered, CostError> {
    let recording = SimulatedRecording::new(scene)?;
    let written = write(&recording, stem, dir, |_| {})?;
    Ok(Rendered {
        calibration: Calibration::read(&written.calib)?,
        truth: recording.truth(),
        bytes: std::fs::metadata(&written.video).map_or(0, |m| m.len()),
        frames: written.frames,
        video: written.video,
    })
}

/// Decodes a recording and does nothing with it.
pub(super) fn decode(video: &Path) -> Result<(), FrameError> {
    let mut source = frames::open(video)?;
    while let Some(frame) = source.next_frame()? {
        source.recycle(frame);
    }
    Ok(())
}
