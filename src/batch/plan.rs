//! From paths and a manifest to the list of recordings: which files, what each is called, which calibration it has.

use super::manifest::{self, ManifestRow};
use super::names::{names, stem, whole};
use super::{BatchRecording, CalibrationChanges};
use crate::config::FileError;
use crate::edits;
use crate::frames::pictures_in;
use crate::rebound::fit::series::DEFAULT_GROUP;
use std::collections::HashMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Extensions by which a folder's videos are known. A file that is named itself may have any.
const EXTENSIONS: [&str; 24] = [
    "mp4", "mov", "avi", "mkv", "gif", "m4v", "webm", "mpg", "mpeg", "mp2v", "mts", "m2ts", "wmv", "asf",
    "flv", "3gp", "3g2", "ogv", "mxf", "dv", "y4m", "h264", "hevc", "mjpeg",
];

/// What `track` writes beside a recording, which is none itself.
const OVERLAY: &str = ".overlay.mp4";

/// What a user asks for.
#[derive(Debug, Clone, Default)]
pub struct BatchRequest {
    /// Files, folders, patterns.
    pub paths: Vec<PathBuf>,
    /// The manifest.
    pub manifest: Option<PathBuf>,
    /// The calibration of every recording to which the manifest gives none.
    pub calib: Option<PathBuf>,
}

/// The recordings of a batch, by name.
#[derive(Debug, Clone, PartialEq)]
pub struct BatchPlan {
    /// At least one.
    pub recordings: Vec<BatchRecording>,
}

/// Why there is nothing to measure.
#[derive(Debug, Error)]
pub enum PlanError {
    /// Neither paths nor a manifest.
    #[error(
        "no recordings given: name files, folders or patterns (\"day*/*.mp4\"), or a table with --manifest"
    )]
    Nothing,
    /// A path that leads nowhere.
    #[error("cannot read {}: there is no such file or folder; check the spelling of the path", path.display())]
    Missing {
        /// As the user gave it.
        path: PathBuf,
    },
    /// A pattern that no file has.
    #[error("{pattern}: no file or folder has such a name; accepted are *, ?, [abc] and ** for any folders")]
    NoMatch {
        /// As the user gave it.
        pattern: String,
    },
    /// A pattern that is none.
    #[error(
        "{pattern}: not a pattern of file names: {found}; accepted are *, ?, [abc] and ** for any folders"
    )]
    BadPattern {
        /// As the user gave it.
        pattern: String,
        /// What is wrong with it.
        found: String,
    },
    /// A folder without recordings.
    #[error(
        "{}: no recording in this folder; accepted are videos ({}), or folders of numbered images. Folders in it are not \
         searched for videos: give \"{}/**/*.mp4\" for that",
        path.display(), EXTENSIONS[..5].join(", "), path.display()
    )]
    EmptyFolder {
        /// The folder.
        path: PathBuf,
    },
    /// A folder that cannot be listed.
    #[error("cannot read the folder {}; check that you may read it (ls -l)", path.display())]
    Unreadable {
        /// The folder.
        path: PathBuf,
        /// As the system says it.
        source: std::io::Error,
    },
    /// The manifest cannot be used.
    #[error(transparent)]
    Manifest(#[from] FileError),
    /// A recording that the manifest names twice.
    #[error(
        "the manifest {}: lines {first} and {second} name the same recording, {}; keep one of them",
        manifest.display(), video.display()
    )]
    Twice {
        /// The manifest.
        manifest: PathBuf,
        /// The recording.
        video: PathBuf,
        /// A line.
        first: u64,
        /// Another.
        second: u64,
    },
    /// Two recordings that would share their results.
    #[error(
        "{} and {} would both be called {name}; give one of them another name, or another --out",
        a.display(), b.display()
    )]
    SameName {
        /// One.
        a: PathBuf,
        /// The other.
        b: PathBuf,
        /// What both would be called.
        name: String,
    },
}

/// The recordings that `request` means, sorted by name.
///
/// # Errors
/// See [`PlanError`]. A recording of the manifest that is not there is none: it costs itself only.
pub fn make(request: &BatchRequest) -> Result<BatchPlan, PlanError> {
    if request.paths.is_empty() && request.manifest.is_none() {
        return Err(PlanError::Nothing);
    }
    let mut found = RecordingList::default();
    for path in &request.paths {
        for video in expanded(path)? {
            found.add(video, None);
        }
    }
    if let Some(path) = &request.manifest {
        for row in manifest::read(path)? {
            found.add_row(path, row)?;
        }
    }
    let paths: Vec<&Path> = found.videos.iter().map(|v| v.path.as_path()).collect();
    let named = names(&paths)?;
    let mut recordings: Vec<BatchRecording> = found
        .videos
        .into_iter()
        .zip(named)
        .map(|(video, name)| recording(video, name, request.calib.as_deref()))
        .collect();
    recordings.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(BatchPlan { recordings })
}

fn recording(video: ListedRecording, name: String, calib: Option<&Path>) -> BatchRecording {
    let row = video.row;
    let given = row.as_ref().and_then(|row| row.calib.clone());
    let beside = || Some(calib_beside(&video.path)).filter(|path| path.is_file());
    BatchRecording {
        name,
        edits: Some(edits::beside(&video.path)).filter(|path| path.is_file()),
        calib: given.or_else(|| calib.map(Path::to_owned)).or_else(beside),
        group: row
            .as_ref()
            .and_then(|row| row.group.clone())
            .unwrap_or_else(|| DEFAULT_GROUP.to_owned()),
        changes: row.map_or_else(CalibrationChanges::default, |row| row.changes),
        video: video.path,
    }
}

/// Where a recording's own calibration lies: `<stem>.calib.json` beside it.
#[must_use]
pub fn calib_beside(video: &Path) -> PathBuf {
    let whole = whole(video);
    whole.with_file_name(format!("{}.calib.json", stem(&whole)))
}

/// A recording as it was found.
struct ListedRecording {
    path: PathBuf,
    row: Option<ManifestRow>,
}

/// Recordings, each once, in whichever ways it was named.
#[derive(Default)]
struct RecordingList {
    videos: Vec<ListedRecording>,
    places: HashMap<PathBuf, usize>,
}

impl RecordingList {
    /// The place of `path` in the list, where it comes to stand if it is new.
    fn add(&mut self, path: PathBuf, row: Option<ManifestRow>) -> usize {
        let identity = path.canonicalize().unwrap_or_else(|_| path.clone());
        *self.places.entry(identity).or_insert_with(|| {
            self.videos.push(ListedRecording { path, row });
            self.videos.len() - 1
        })
    }

    fn add_row(&mut self, manifest: &Path, row: ManifestRow) -> Result<(), PlanError> {
        let place = self.add(row.video.clone(), None);
        let video = &mut self.videos[place];
        if let Some(first) = &video.row {
            return Err(PlanError::Twice {
                manifest: manifest.to_owned(),
                video: row.video,
                first: first.line,
                second: row.line,
            });
        }
        video.row = Some(row);
        Ok(())
    }
}

/// The recordings that a path of the command line means.
fn expanded(path: &Path) -> Result<Vec<PathBuf>, PlanError> {
    if path.is_dir() {
        return in_folder(path);
    }
    // A name that is there is no pattern, whatever characters it has. A dangling link is for its own process to refuse.
    if path.symlink_metadata().is_ok() {
        return Ok(vec![path.to_owned()]);
    }
    let pattern = path.to_string_lossy().into_owned();
    if !pattern.contains(['*', '?', '[']) {
        return Err(PlanError::Missing {
            path: path.to_owned(),
        });
    }
    let options = glob::MatchOptions {
        case_sensitive: true,
        require_literal_separator: true,
        require_literal_leading_dot: true,
    };
    let matches = glob::glob_with(&pattern, options).map_err(|e| PlanError::BadPattern {
        pattern: pattern.clone(),
        found: e.msg.to_owned(),
    })?;
    let mut videos = Vec::new();
    // What may not be looked into has no names to match.
    for found in matches.flatten() {
        if found.is_dir() {
            videos.extend(in_folder(&found)?);
        } else if !is_overlay(&found) {
            videos.push(found);
        }
    }
    if videos.is_empty() {
        return Err(PlanError::NoMatch { pattern });
    }
    Ok(videos)
}

/// The recordings in a folder: its videos and its folders of images; or, where there are none, itself as one of images.
fn in_folder(folder: &Path) -> Result<Vec<PathBuf>, PlanError> {
    let unreadable = |source| PlanError::Unreadable {
        path: folder.to_owned(),
        source,
    };
    let mut videos = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        let hidden = path
            .file_name()
            .is_some_and(|name| name.as_encoded_bytes().starts_with(b"."));
        let takes_part = (path.is_file() && is_video(&path)) || (path.is_dir() && is_series_of_images(&path));
        if takes_part && !hidden {
            videos.push(path);
        }
    }
    videos.sort();
    if videos.is_empty() && is_series_of_images(folder) {
        videos.push(folder.to_owned());
    }
    if videos.is_empty() {
        return Err(PlanError::EmptyFolder {
            path: folder.to_owned(),
        });
    }
    Ok(videos)
}

fn is_video(path: &Path) -> bool {
    let extension = path
        .extension()
        .and_then(OsStr::to_str)
        .map(str::to_ascii_lowercase);
    extension.is_some_and(|e| EXTENSIONS.contains(&e.as_str())) && !is_overlay(path)
}

fn is_overlay(path: &Path) -> bool {
    path.file_name()
        .is_some_and(|name| name.as_encoded_bytes().ends_with(OVERLAY.as_bytes()))
}

/// A picture or two beside the videos (of the board, of the table) are no recording.
fn is_series_of_images(folder: &Path) -> bool {
    const FEWEST: usize = 6;
    pictures_in(folder).is_ok_and(|pictures| pictures.len() >= FEWEST)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::LaunchSpin;
    use std::fs;

    /// A folder with empty files of these names.
    fn folder(files: &[&str]) -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        for file in files {
            let path = dir.path().join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, "").unwrap();
        }
        dir
    }

    fn plan(paths: &[PathBuf]) -> Result<BatchPlan, PlanError> {
        make(&BatchRequest {
            paths: paths.to_vec(),
            ..BatchRequest::default()
        })
    }

    fn named(paths: &[PathBuf]) -> Vec<String> {
        plan(paths)
            .unwrap()
            .recordings
            .into_iter()
            .map(|r| r.name)
            .collect()
    }

    #[test]
    fn a_folder_holds_its_videos_and_its_folders_of_images() {
        let images: Vec<String> = (0..6).map(|i| format!("tennis/{i:03}.png")).collect();
        let mut files: Vec<&str> = images.iter().map(String::as_str).collect();
        files.extend([
            "b.MP4",
            "a.mkv",
            "a.overlay.mp4",
            "a.calib.json",
            "notes.txt",
            ".hidden.mp4",
            "photos/board.jpg",
            "later/c.mp4",
            "table.jpg",
        ]);
        let dir = folder(&files);
        assert_eq!(named(&[dir.path().to_owned()]), ["a", "b", "tennis"]);
        assert_eq!(named(&[dir.path().join("tennis")]), ["tennis"]);
        assert_eq!(named(&[dir.path().join("**/*.mp4")]), ["c"]);
        assert_eq!(
            named(&[dir.path().join("[ab].*[4v]"), dir.path().join("a.mkv")]),
            ["a", "b"]
        );
        let recordings = plan(&[dir.path().to_owned()]).unwrap().recordings;
        assert_eq!(recordings[0].calib, Some(dir.path().join("a.calib.json")));
        assert_eq!(recordings[1].calib, None);
    }

    #[test]
    fn recordings_of_one_stem_are_told_apart_by_extension_or_folders() {
        let dir = folder(&["x/day1/a.mp4", "x/day2/a.mp4", "y/day2/a.mp4", "y/day2/b.mp4"]);
        let at = |path: &str| dir.path().join(path);
        assert_eq!(
            named(&[at("x/day1/a.mp4"), at("y/day2")]),
            ["b", "day1-a", "day2-a"]
        );
        assert_eq!(
            named(&[at("**/*.mp4")]),
            ["b", "x-day1-a", "x-day2-a", "y-day2-a"]
        );
        let dir = folder(&["a.mp4", "a.mov", "c/a.mp4"]);
        assert_eq!(named(&[dir.path().join("a.*")]), ["a.mov", "a.mp4"]);
        let here = dir.path().file_name().unwrap().to_string_lossy().into_owned();
        assert_eq!(
            named(&[dir.path().join("c"), dir.path().to_owned()]),
            [
                format!("{here}-a.mov"),
                format!("{here}-a.mp4"),
                "c-a.mp4".to_owned()
            ]
        );
        let dir = folder(&["day1/a.mp4", "day2/a.mp4", "day1-a.mp4"]);
        let error = plan(&[dir.path().join("**/*.mp4")]).unwrap_err().to_string();
        assert!(error.contains("would both be called day1-a"), "{error}");
    }

    #[test]
    fn a_recording_named_in_several_ways_is_one() {
        let dir = folder(&["a.mp4"]);
        let a = dir.path().join("a.mp4");
        assert_eq!(
            named(&[a.clone(), dir.path().to_owned(), dir.path().join("./a.mp4")]),
            ["a"]
        );
        std::os::unix::fs::symlink(&a, dir.path().join("link.mp4")).unwrap();
        assert_eq!(named(&[a, dir.path().join("link.mp4")]), ["a"]);
    }

    #[test]
    fn the_manifest_adds_recordings_and_says_more_of_those_given() {
        let dir = folder(&["a.mp4", "b.mp4", "b.calib.json", "own.json", "all.json"]);
        let manifest = dir.path().join("m.csv");
        fs::write(
            &manifest,
            "video,group,calib,spin_ratio\na.mp4,steel,own.json,0.5\ngone.mp4,,,unknown\n",
        )
        .unwrap();
        let mut request = BatchRequest {
            paths: vec![dir.path().to_owned()],
            manifest: Some(manifest.clone()),
            calib: None,
        };
        let all = make(&request).unwrap().recordings;
        let names: Vec<&str> = all.iter().map(|r| r.name.as_str()).collect();
        assert_eq!(names, ["a", "b", "gone"]);
        assert_eq!(all[0].group, "steel");
        assert_eq!(all[0].calib, Some(dir.path().join("own.json")));
        assert_eq!(all[0].changes.spin, LaunchSpin::Ratio(0.5));
        assert_eq!(
            (all[1].group.as_str(), all[1].calib.clone()),
            ("all", Some(dir.path().join("b.calib.json")))
        );
        assert_eq!(all[2].calib, None);
        request.calib = Some(dir.path().join("all.json"));
        let all = make(&request).unwrap().recordings;
        assert_eq!(
            all[0].calib,
            Some(dir.path().join("own.json")),
            "the manifest's goes first"
        );
        assert_eq!(all[1].calib, request.calib, "then the one for all");
        fs::write(&manifest, "video\na.mp4\n./a.mp4\n").unwrap();
        let error = make(&request).unwrap_err().to_string();
        assert!(error.contains("lines 2 and 3 name the same recording"), "{error}");
    }

    #[test]
    fn what_leads_nowhere_is_told() {
        let dir = folder(&["notes.txt"]);
        assert!(plan(&[]).unwrap_err().to_string().contains("--manifest"));
        let error = |path: PathBuf| plan(&[path]).unwrap_err().to_string();
        assert!(error(dir.path().join("no.mp4")).contains("no.mp4: there is no such file"));
        assert!(error(dir.path().join("*.mp4")).contains("no file or folder has such a name"));
        assert!(error(dir.path().join("***")).contains("not a pattern"));
        assert!(error(dir.path().to_owned()).contains("no recording in this folder"));
    }
}
