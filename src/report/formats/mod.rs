//! The files that a measured recording is written as, a format each in a file of its own.
//!
//! A new format is a file here and its line in [`FORMATS`]; `track --help` names it in `cli::measure`.

pub mod cost;
mod csv;
mod html;
mod json;
mod overlay;
pub mod series;
mod svg;
pub mod trk;

use super::write::{self, WriteError};
use crate::frames::RecodeError;
use crate::pipeline::Measurement;
use std::error::Error;
use std::path::{Path, PathBuf};

/// Writes a video to a path.
pub type VideoMaker<'a> = dyn FnOnce(&Path) -> Result<(), RecodeError> + 'a;

/// What a file is filled with.
pub enum Contents<'a> {
    /// These bytes.
    Bytes(Vec<u8>),
    /// There is nothing of it in the measurement: no file.
    Nothing,
    /// A video, which FFmpeg writes to a path by itself.
    Video(Box<VideoMaker<'a>>),
}

/// A form in which a measurement is written.
pub trait OutputFormat: Sync {
    /// What it is called where it is asked for (`--formats`).
    fn name(&self) -> &'static str;

    /// What follows the recording's name and a dot in the name of the file.
    fn suffix(&self) -> &'static str;

    /// Whether it is made from the recording's frames once more. A batch leaves such files out.
    fn needs_frames(&self) -> bool {
        false
    }

    /// Whether it is written only where it is asked for by name.
    fn is_extra(&self) -> bool {
        false
    }

    /// The contents of the file.
    ///
    /// # Errors
    /// What keeps them from being put together, which is a fault of the program.
    fn contents<'a>(
        &self,
        measurement: &'a Measurement,
    ) -> Result<Contents<'a>, Box<dyn Error + Send + Sync>>;
}

/// Every format, in the order in which their files are told.
pub const FORMATS: [&dyn OutputFormat; 8] = [
    &html::Page,
    &json::Json,
    &csv::Points,
    &overlay::OverlayVideo,
    &svg::FigureFile::Picture,
    &svg::FigureFile::X,
    &svg::FigureFile::Z,
    &trk::Trk,
];

/// Those that are written where nobody asks for others.
pub fn usual_formats() -> impl DoubleEndedIterator<Item = &'static &'static dyn OutputFormat> {
    FORMATS.iter().filter(|format| !format.is_extra())
}

/// Those that a batch writes of every recording, and keeps.
pub fn batch_formats() -> impl DoubleEndedIterator<Item = &'static &'static dyn OutputFormat> {
    usual_formats().filter(|format| !format.needs_frames())
}

/// Writes `measurement` into `dir` as `<stem>` with the suffix of each of the formats: all files, or none. Their paths.
///
/// # Errors
/// See [`WriteError`].
pub fn write_recording<'f>(
    measurement: &Measurement,
    dir: &Path,
    stem: &str,
    formats: impl DoubleEndedIterator<Item = &'f &'f dyn OutputFormat>,
) -> Result<Vec<PathBuf>, WriteError> {
    // The largest file first: where it does not fit, no other is left without it.
    let staged = formats.rev().filter_map(|format| {
        let path = dir.join(format!("{stem}.{}", format.suffix()));
        Some(match format.contents(measurement) {
            Ok(Contents::Nothing) => return None,
            Ok(Contents::Bytes(bytes)) => write::stage(path, &bytes),
            Ok(Contents::Video(recode)) => write::stage_video(path, recode),
            Err(source) => Err(WriteError::Contents { path, source }),
        })
    });
    let mut staged = staged.collect::<Result<Vec<_>, WriteError>>()?;
    staged.reverse();
    write::place_together(staged)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::test_measurements;
    use std::fs;

    fn names(dir: &Path) -> Vec<String> {
        let entries = fs::read_dir(dir).unwrap();
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    /// A video of text.
    struct TestVideo;

    impl OutputFormat for TestVideo {
        fn name(&self) -> &'static str {
            "overlay"
        }

        fn suffix(&self) -> &'static str {
            "overlay.mp4"
        }

        fn contents<'a>(&self, _: &'a Measurement) -> Result<Contents<'a>, Box<dyn Error + Send + Sync>> {
            Ok(Contents::Video(Box::new(|to| {
                fs::write(to, "moving pictures").unwrap();
                Ok(())
            })))
        }
    }

    #[test]
    fn an_overlay_appears_with_the_reports_or_not_at_all() {
        let video: &dyn OutputFormat = &TestVideo;
        let mut formats: Vec<&'static dyn OutputFormat> = batch_formats().copied().collect();
        formats.push(video);
        let measurement = test_measurements::two_bounces();
        let dir = tempfile::tempdir().unwrap();
        let paths = write_recording(&measurement, dir.path(), "clip", formats.iter()).unwrap();
        assert_eq!(names(dir.path()).len(), 4);
        assert_eq!(fs::read(paths.last().unwrap()).unwrap(), b"moving pictures");

        let dir = tempfile::tempdir().unwrap();
        fs::create_dir(dir.path().join("clip.overlay.mp4")).unwrap();
        let error = write_recording(&measurement, dir.path(), "clip", formats.iter()).unwrap_err();
        assert!(matches!(error, WriteError::IsAFolder { .. }), "{error:?}");
        assert_eq!(names(dir.path()), ["clip.overlay.mp4"]);
    }

    #[test]
    fn all_reports_appear_together() {
        let dir = tempfile::tempdir().unwrap();
        let measurement = test_measurements::two_bounces();
        write_recording(&measurement, dir.path(), "clip", batch_formats()).unwrap();
        assert_eq!(
            names(dir.path()),
            ["clip.points.csv", "clip.report.html", "clip.result.json"]
        );
        let read = |name: &str| fs::read_to_string(dir.path().join(name)).unwrap();
        let json: serde_json::Value = serde_json::from_str(&read("clip.result.json")).unwrap();
        assert_eq!(json["status"], "measured");
        assert!(read("clip.points.csv").starts_with("frame,"));
        assert!(read("clip.report.html").starts_with("<!DOCTYPE html>"));
    }

    #[test]
    fn when_one_report_cannot_be_placed_none_is() {
        let dir = tempfile::tempdir().unwrap();
        fs::create_dir(dir.path().join("clip.report.html")).unwrap();
        let rejected = test_measurements::rejected();
        let error = write_recording(&rejected, dir.path(), "clip", batch_formats()).unwrap_err();
        assert!(matches!(error, WriteError::IsAFolder { .. }), "{error:?}");
        assert_eq!(names(dir.path()), ["clip.report.html"]);
    }
}
