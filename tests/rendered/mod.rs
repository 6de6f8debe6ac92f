//! Rendered recordings: written as `track simulate` does, with their calibration and truth.

use serde_json::Value;
use std::path::{Path, PathBuf};
use track::calibration::Calibration;
use track::detect::centre::Accuracy;
use track::frames::{self, Coding, VideoWriter};
use track::geometry::PixelPoint;
use track::pipeline::{Measurement, measure};
use track::simulate::{Scene, SimulatedRecording, write};

/// A recording on disk, as long as this lives.
pub struct Rendered {
    pub video: PathBuf,
    pub calibration_file: PathBuf,
    pub calibration: Calibration,
    pub truth: Value,
    pub dir: tempfile::TempDir,
}

impl Rendered {
    pub fn new(scene: &Value) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let recording = SimulatedRecording::new(&Scene::from_json(&scene.to_string()).unwrap()).unwrap();
        let written = write(&recording, "scene", dir.path(), |_| {}).unwrap();
        Self {
            calibration: Calibration::read(&written.calib).unwrap(),
            calibration_file: written.calib,
            truth: serde_json::from_str(&std::fs::read_to_string(&written.truth).unwrap()).unwrap(),
            video: written.video,
            dir,
        }
    }

    /// Every frame and the calibration's origin, mirrored.
    pub fn mirrored(&self) -> (PathBuf, Calibration) {
        let path = self.dir.path().join("mirrored.mkv");
        let mut source = frames::open(&self.video).unwrap();
        let (w, h) = (source.info().width_px, source.info().height_px);
        let mut writer = VideoWriter::create(&path, w, h, 240.0, Coding::Lossless).unwrap();
        while let Some(mut frame) = source.next_frame().unwrap() {
            frame.luma.data.chunks_exact_mut(w).for_each(<[u8]>::reverse);
            writer.write(&frame.luma).unwrap();
        }
        writer.finish().unwrap();
        let mut calibration = self.calibration.clone();
        let origin = calibration.origin_px.unwrap();
        calibration.origin_px = Some(PixelPoint::new(w as f64 - 1.0 - origin.u_px, origin.v_px));
        (path, calibration)
    }
}

/// What `standard` makes of a recording.
pub fn standard(video: &Path, calibration: &Calibration) -> Measurement {
    measure(video, calibration, "calib.json", Accuracy::Standard, &mut |_| {}).unwrap()
}
