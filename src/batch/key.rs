//! What a result depends on. A result whose key is the one of today need not be measured again.
//!
//! The key holds SHA-256 digests of the recording, of its calibration and of the edits beside it, the settings that have a part in the result, and
//! the program's version and commit: another build may measure another result. Times of files and their places have none in it, so a copied or touched recording is not measured
//! again.

use super::{BatchRecording, LaunchSpin};
use crate::Build;
use crate::frames::digest::{of_bytes, of_file, of_recording};
use crate::pipeline::MeasureSettings;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::io;
use std::path::Path;

/// The schema of the file that holds a key.
const SCHEMA: &str = "track.key/1";

/// What a result depends on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ResultKey(Value);

impl ResultKey {
    /// Of a recording as it is now. `None` where it cannot be read through; then its process will tell why.
    pub fn of(recording: &BatchRecording, calib: &[u8], settings: MeasureSettings) -> Option<Self> {
        Self::of_build(Build::THIS, recording, calib, settings)
    }

    /// As `build` of the program makes it.
    fn of_build(
        build: Build,
        recording: &BatchRecording,
        calib: &[u8],
        settings: MeasureSettings,
    ) -> Option<Self> {
        let changes = &recording.changes;
        let edits = recording.edits.as_ref().map(std::fs::read).transpose().ok()?;
        Some(Self(json!({
            "schema": SCHEMA,
            "version": build.version,
            "commit": build.commit,
            "input_sha256": of_recording(&recording.video).ok()?,
            "calibration_sha256": of_bytes(calib),
            "edits_sha256": edits.as_deref().map(of_bytes),
            "settings": {
                "accuracy": settings.accuracy.name(),
                "spin": settings.spin.name(),
                "spin_ratio": match changes.spin {
                    LaunchSpin::AsCalibrated => json!("as_calibrated"),
                    LaunchSpin::Ratio(ratio) => json!(ratio),
                    LaunchSpin::Unknown => Value::Null,
                },
                "frame_rate_hz": changes.frame_rate_hz,
                "ball_radius_m": changes.ball_radius_m,
            },
        })))
    }

    /// The key with the digests of the files that were measured with it.
    pub fn with_files(&self, files: &[(&str, &Path)]) -> io::Result<Value> {
        let mut whole = self.0.clone();
        let mut digests = serde_json::Map::new();
        for (name, path) in files {
            digests.insert((*name).to_owned(), json!(of_file(path)?));
        }
        whole["files_sha256"] = Value::Object(digests);
        Ok(whole)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::CalibrationChanges;
    use crate::detect::centre::Accuracy;
    use crate::pipeline::SpinSearch;
    use std::fs;

    fn recording(video: &Path) -> BatchRecording {
        BatchRecording {
            name: "a".to_owned(),
            video: video.to_owned(),
            edits: None,
            calib: None,
            group: "all".to_owned(),
            changes: CalibrationChanges::default(),
        }
    }

    #[test]
    fn a_key_changes_with_what_a_result_depends_on_and_with_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let video = dir.path().join("a.mp4");
        fs::write(&video, "frames").unwrap();
        let r = recording(&video);
        let with = |accuracy, spin| MeasureSettings { accuracy, spin };
        let auto = |accuracy| with(accuracy, SpinSearch::Auto);
        let key = |r: &BatchRecording, calib: &str, accuracy| {
            ResultKey::of(r, calib.as_bytes(), auto(accuracy)).unwrap()
        };
        let first = key(&r, "{}", Accuracy::Standard);
        let copy = dir.path().join("b.mp4");
        fs::copy(&video, &copy).unwrap();
        let mut other = recording(&copy);
        (other.name, other.group) = ("b".to_owned(), "steel".to_owned());
        assert_eq!(key(&other, "{}", Accuracy::Standard), first);
        assert_ne!(key(&r, "{ }", Accuracy::Standard), first);
        assert_ne!(key(&r, "{}", Accuracy::Fine), first);
        let off = with(Accuracy::Standard, SpinSearch::Off);
        assert_ne!(ResultKey::of(&r, b"{}", off).unwrap(), first);
        for changes in [
            CalibrationChanges {
                spin: LaunchSpin::Unknown,
                ..CalibrationChanges::default()
            },
            CalibrationChanges {
                spin: LaunchSpin::Ratio(0.0),
                ..CalibrationChanges::default()
            },
            CalibrationChanges {
                frame_rate_hz: Some(240.0),
                ..CalibrationChanges::default()
            },
            CalibrationChanges {
                ball_radius_m: Some(0.02),
                ..CalibrationChanges::default()
            },
        ] {
            let changed = BatchRecording { changes, ..r.clone() };
            assert_ne!(key(&changed, "{}", Accuracy::Standard), first, "{changes:?}");
        }
        for build in [
            Build {
                version: "0.0.1",
                ..Build::THIS
            },
            Build {
                commit: "0123456789ab",
                ..Build::THIS
            },
        ] {
            let built = ResultKey::of_build(build, &r, b"{}", auto(Accuracy::Standard)).unwrap();
            assert_ne!(built, first, "{build:?}");
        }
        fs::write(&video, "frame5").unwrap();
        assert_ne!(key(&r, "{}", Accuracy::Standard), first);
    }

    #[test]
    fn a_folder_is_its_pictures_and_a_device_is_nothing() {
        let dir = tempfile::tempdir().unwrap();
        for (name, text) in [("1.png", "a"), ("2.png", "b"), ("notes.txt", "c")] {
            fs::write(dir.path().join(name), text).unwrap();
        }
        let digest = || of_recording(dir.path()).unwrap();
        let first = digest();
        fs::write(dir.path().join("notes.txt"), "d").unwrap();
        assert_eq!(digest(), first);
        fs::rename(dir.path().join("2.png"), dir.path().join("3.png")).unwrap();
        assert_ne!(digest(), first);
        assert!(of_recording(Path::new("/dev/zero")).is_err());
        assert!(of_recording(Path::new("/no/such")).is_err());
        assert_eq!(of_bytes(b"abc")[..8], *"ba7816bf");
    }
}
