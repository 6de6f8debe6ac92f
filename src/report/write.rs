//! Files that appear whole or not at all.
//!
//! A file is written under a temporary name in its own folder, forced to the disk, and renamed: whoever looks sees the
//! old file or the new one, never half of one, and a failure leaves nothing behind.

use super::{cost_json, cost_page, csv, json, page, series_json, series_page};
use crate::cost::CostReport;
use crate::cost::recordings::Check;
use crate::pipeline::Measurement;
use crate::rebound::fit::{Series, SeriesFit};
use std::fs;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use tempfile::{NamedTempFile, TempPath};
use thiserror::Error;

/// Why an output could not be written: where, what happened, what to try.
#[derive(Debug, Error)]
pub enum WriteError {
    /// No space left, or over the user's quota.
    #[error("cannot write {}: the disk is full; free some space, or give another folder with --out", path.display())]
    Full {
        /// What was to be written.
        path: PathBuf,
        /// As the system says it.
        source: io::Error,
    },
    /// Not allowed, or mounted read-only.
    #[error(
        "cannot write {}: this user may not write there; give another folder with --out, or change its permissions",
        path.display()
    )]
    Denied {
        /// What was to be written.
        path: PathBuf,
        /// As the system says it.
        source: io::Error,
    },
    /// The folder does not exist.
    #[error("cannot write {}: its folder does not exist; create it, or give another with --out", path.display())]
    MissingFolder {
        /// What was to be written.
        path: PathBuf,
        /// As the system says it.
        source: io::Error,
    },
    /// A part of the path that should be a folder is a file.
    #[error(
        "cannot use {} as the output folder: there is a file where a folder is needed; give another folder with --out",
        path.display()
    )]
    NotAFolder {
        /// What was to be written or created.
        path: PathBuf,
        /// As the system says it.
        source: io::Error,
    },
    /// A folder has the name that the file should get.
    #[error(
        "cannot write {}: a folder has that name; rename or remove it, or give another folder with --out",
        path.display()
    )]
    IsAFolder {
        /// What was to be written.
        path: PathBuf,
    },
    /// Anything else of the file system.
    #[error("cannot write {}: the file system refused; check the disk, or give another folder with --out", path.display())]
    Other {
        /// What was to be written.
        path: PathBuf,
        /// As the system says it.
        source: io::Error,
    },
    /// The contents could not be made. Nothing was written.
    #[error("cannot write {}: its contents could not be put together (a fault of track, please report it)", path.display())]
    Contents {
        /// What was to be written.
        path: PathBuf,
        /// What failed.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}

impl WriteError {
    /// The error for people from the system's own.
    pub(crate) fn new(path: &Path, source: io::Error) -> Self {
        let path = path.to_owned();
        match source.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => Self::Full { path, source },
            io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
                Self::Denied { path, source }
            }
            io::ErrorKind::NotFound => Self::MissingFolder { path, source },
            // `AlreadyExists` is what creating a folder gives where a file stands.
            io::ErrorKind::NotADirectory | io::ErrorKind::AlreadyExists => Self::NotAFolder { path, source },
            io::ErrorKind::IsADirectory => Self::IsAFolder { path },
            _ => Self::Other { path, source },
        }
    }
}

/// Where [`write_reports`] put its files.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReportPaths {
    /// `<stem>.result.json`.
    pub result_json: PathBuf,
    /// `<stem>.points.csv`.
    pub points_csv: PathBuf,
    /// `<stem>.report.html`.
    pub report_html: PathBuf,
    /// `<stem>.overlay.mp4`, if there is one.
    pub overlay_mp4: Option<PathBuf>,
}

/// The folders that [`check_output_dir`] made. Dropping it takes those back in which nothing has come to lie.
#[derive(Debug)]
#[must_use = "dropped at once, it takes the output folder back at once"]
pub struct NewFolders {
    /// From the outermost to the innermost.
    made: Vec<PathBuf>,
}

impl Drop for NewFolders {
    fn drop(&mut self) {
        for folder in self.made.iter().rev() {
            // One that holds something refuses, and so it should.
            let _ = fs::remove_dir(folder);
        }
    }
}

/// Creates `dir` if it is missing and proves that a file can be written into it, before the work starts.
///
/// # Errors
/// See [`WriteError`]; the proof's own file is gone either way, and so are the folders made for it.
pub fn check_output_dir(dir: &Path) -> Result<NewFolders, WriteError> {
    let refused = |source| WriteError::new(dir, source);
    let missing = dir.ancestors().filter(|d| !d.as_os_str().is_empty());
    let mut made: Vec<PathBuf> = missing.take_while(|d| !d.exists()).map(Path::to_owned).collect();
    made.reverse();
    let folders = NewFolders { made };
    fs::create_dir_all(dir).map_err(refused)?;
    let mut proof = temporary_in(dir).map_err(refused)?;
    // More than the few bytes that some file systems keep beside the name, and forced out: a full disk shows now.
    proof
        .write_all(&[0; 1 << 16])
        .and_then(|()| proof.as_file().sync_all())
        .and_then(|()| proof.close())
        .map_err(refused)?;
    Ok(folders)
}

/// A temporary name in `dir` for a file that is made elsewhere, such as the overlay; gone when it is dropped.
///
/// # Errors
/// See [`WriteError`].
pub fn temporary_name(dir: &Path) -> Result<TempPath, WriteError> {
    temporary_in(dir)
        .map(NamedTempFile::into_temp_path)
        .map_err(|source| WriteError::new(dir, source))
}

/// Writes `bytes` to `path`, which then holds all of them, or what it held before.
///
/// # Errors
/// See [`WriteError`]; nothing remains of the attempt.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    write_together(&[(path, bytes)])
}

/// Writes several files: all of them, or none.
///
/// # Errors
/// See [`WriteError`]; nothing remains of the attempt.
pub fn write_together(files: &[(&Path, &[u8])]) -> Result<(), WriteError> {
    let staged = files
        .iter()
        .map(|&(path, bytes)| Ok((stage(path, bytes)?, path)))
        .collect::<Result<Vec<_>, WriteError>>()?;
    place_together(staged)
}

/// Writes `<stem>.result.json`, `<stem>.points.csv` and `<stem>.report.html` into `dir`, and gives `overlay`, made
/// under a [`temporary_name`] there, its own as `<stem>.overlay.mp4`: all of them, or none.
///
/// # Errors
/// See [`WriteError`].
pub fn write_reports(
    measurement: &Measurement,
    dir: &Path,
    stem: &str,
    overlay: Option<TempPath>,
) -> Result<ReportPaths, WriteError> {
    let paths = ReportPaths {
        result_json: dir.join(format!("{stem}.result.json")),
        points_csv: dir.join(format!("{stem}.points.csv")),
        report_html: dir.join(format!("{stem}.report.html")),
        overlay_mp4: overlay.is_some().then(|| dir.join(format!("{stem}.overlay.mp4"))),
    };
    let result = json_text(&json::result_json(measurement)).map_err(|e| contents(&paths.result_json, e))?;
    let points = csv::points_csv(measurement).map_err(|e| contents(&paths.points_csv, e))?;
    let page = page::report_html(measurement).map_err(|e| contents(&paths.report_html, e))?;
    let mut staged = vec![
        (stage(&paths.result_json, &result)?, paths.result_json.as_path()),
        (stage(&paths.points_csv, &points)?, &paths.points_csv),
        (stage(&paths.report_html, page.as_bytes())?, &paths.report_html),
    ];
    if let (Some(overlay), Some(path)) = (overlay, &paths.overlay_mp4) {
        refuse_folder(path)?;
        staged.push((overlay, path));
    }
    place_together(staged)?;
    Ok(paths)
}

/// Gives a whole file of this disk another name, which then stands for it, or for what it stood for before.
///
/// # Errors
/// See [`WriteError`].
pub fn rename(from: &Path, to: &Path) -> Result<(), WriteError> {
    refuse_folder(to)?;
    fs::rename(from, to).map_err(|source| WriteError::new(to, source))
}

/// Takes away what writers that were killed have left in `dir` under temporary names. Only for a folder in which nobody
/// else is writing.
///
/// # Errors
/// See [`WriteError`].
pub fn clear_temporary_files(dir: &Path) -> Result<(), WriteError> {
    let refused = |source| WriteError::new(dir, source);
    for entry in fs::read_dir(dir).map_err(refused)? {
        let entry = entry.map_err(refused)?;
        let name = entry.file_name();
        let name = name.as_encoded_bytes();
        if name.starts_with(TEMPORARY.0.as_bytes()) && name.ends_with(TEMPORARY.1.as_bytes()) {
            fs::remove_file(entry.path()).map_err(refused)?;
        }
    }
    Ok(())
}

/// Where [`write_fit`] put its files.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FitPaths {
    /// `fit.json`.
    pub fit_json: PathBuf,
    /// `report.html`.
    pub report_html: PathBuf,
}

/// Writes `fit.json` and `report.html` into `dir`: both, or none. Links of rows are relative to `dir`.
///
/// # Errors
/// See [`WriteError`].
pub fn write_fit(series: &Series, fit: &SeriesFit, dir: &Path) -> Result<FitPaths, WriteError> {
    let paths = FitPaths {
        fit_json: dir.join("fit.json"),
        report_html: dir.join("report.html"),
    };
    let result = json_text(&series_json::fit_json(fit)).map_err(|e| contents(&paths.fit_json, e))?;
    let page = series_page::report_html(series, fit).map_err(|e| contents(&paths.report_html, e))?;
    place_together(vec![
        (stage(&paths.fit_json, &result)?, paths.fit_json.as_path()),
        (stage(&paths.report_html, page.as_bytes())?, &paths.report_html),
    ])?;
    Ok(paths)
}

/// Writes `cost.html`, `cost.svg`, `cost.json` and `cost.csv` into `dir`: all, or none; their paths.
///
/// # Errors
/// See [`WriteError`].
pub fn write_cost(
    report: &CostReport,
    check: Option<&Check>,
    dir: &Path,
) -> Result<[PathBuf; 4], WriteError> {
    let paths = ["cost.html", "cost.svg", "cost.json", "cost.csv"].map(|name| dir.join(name));
    let page = cost_page::cost_html(report, check).map_err(|e| contents(&paths[0], e))?;
    let svg = cost_page::cost_svg(report).map_err(|e| contents(&paths[1], e))?;
    let json = json_text(&cost_json::cost_json(report, check)).map_err(|e| contents(&paths[2], e))?;
    let csv = cost_json::cost_csv(report).map_err(|e| contents(&paths[3], e))?;
    let bytes: [&[u8]; 4] = [page.as_bytes(), svg.as_bytes(), &json, &csv];
    let files: Vec<(&Path, &[u8])> = paths.iter().map(PathBuf::as_path).zip(bytes).collect();
    write_together(&files)?;
    Ok(paths)
}

/// A JSON document as it stands in a file: indented, with a newline at its end.
///
/// # Errors
/// Whatever `serde_json` refuses; of a [`serde_json::Value`] it refuses nothing.
pub fn json_text(value: &serde_json::Value) -> Result<Vec<u8>, serde_json::Error> {
    let mut text = serde_json::to_vec_pretty(value)?;
    text.push(b'\n');
    Ok(text)
}

/// A calibration as it stands in a file: as [`json_text`], but rows of numbers on one line each, as people write them.
///
/// # Errors
/// As [`json_text`].
pub fn calib_text(value: &serde_json::Value) -> Result<String, serde_json::Error> {
    let pretty = serde_json::to_string_pretty(value)?;
    let mut text = String::with_capacity(pretty.len());
    let mut rest = pretty.as_str();
    while let Some(open) = rest.find('[') {
        let (before, from) = rest.split_at(open);
        text.push_str(before);
        // Strings hold no brackets in this file; a row ends before anything that is not a number.
        match from[1..].find(|c: char| "[]{}\"".contains(c)) {
            Some(end) if from.as_bytes()[end + 1] == b']' => {
                let numbers: Vec<&str> = from[1..=end].split(',').map(str::trim).collect();
                text.push('[');
                text.push_str(&numbers.join(", "));
                text.push(']');
                rest = &from[end + 2..];
            }
            _ => {
                text.push('[');
                rest = &from[1..];
            }
        }
    }
    text.push_str(rest);
    text.push('\n');
    Ok(text)
}

fn contents(path: &Path, source: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> WriteError {
    WriteError::Contents {
        path: path.to_owned(),
        source: source.into(),
    }
}

/// Gives several files their names so that either all appear or none does: every byte is on the disk before. Only a
/// rename that fails after another succeeded can break this; then those already there are taken back, since one new
/// file among old ones would mislead.
fn place_together(staged: Vec<(TempPath, &Path)>) -> Result<(), WriteError> {
    let mut placed: Vec<&Path> = Vec::with_capacity(staged.len());
    for (temporary, path) in staged {
        if let Err(error) = temporary.persist(path) {
            for path in placed {
                // The first error is the one to tell.
                let _ = fs::remove_file(path);
            }
            return Err(WriteError::new(path, error.error));
        }
        placed.push(path);
    }
    if let Some(path) = placed.first() {
        sync_folder(folder_of(path));
    }
    Ok(())
}

/// `bytes` on the disk under a temporary name beside `path`.
fn stage(path: &Path, bytes: &[u8]) -> Result<TempPath, WriteError> {
    refuse_folder(path)?;
    let refused = |source| WriteError::new(path, source);
    let mut temporary = temporary_in(folder_of(path)).map_err(refused)?;
    temporary.write_all(bytes).map_err(refused)?;
    temporary.as_file().sync_all().map_err(refused)?;
    Ok(temporary.into_temp_path())
}

fn refuse_folder(path: &Path) -> Result<(), WriteError> {
    if path.is_dir() {
        return Err(WriteError::IsAFolder {
            path: path.to_owned(),
        });
    }
    Ok(())
}

/// The folder that `path` lies in; of a bare file name that is the current one.
fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// What temporary names begin and end with.
const TEMPORARY: (&str, &str) = (".track-", ".tmp");

fn temporary_in(dir: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(TEMPORARY.0).suffix(TEMPORARY.1);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        // As any file that the user creates (the umask takes its part), not closed to others as temporaries are.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(dir)
}

/// Makes the names last through a power cut, where the system lets a folder be synced. The files are whole without it.
fn sync_folder(dir: &Path) {
    if let Ok(folder) = fs::File::open(dir) {
        let _ = folder.sync_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::test_measurements;

    fn names(dir: &Path) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(dir)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_is_written_and_overwritten_whole() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.json");
        write_atomically(&path, b"a long first text").unwrap();
        write_atomically(&path, b"short").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"short");
        assert_eq!(names(dir.path()), ["a.json"]);
    }

    #[test]
    fn a_calibration_has_its_rows_of_numbers_on_one_line_each() {
        let value = serde_json::json!({
            "size": [1280, 720], "matrix": [[1.5, 0.0], [0.0, -2e-7]], "empty": [], "list": [{"a": [1]}], "text": "x, y",
            "unknown": [null, 1.0]
        });
        let text = calib_text(&value).unwrap();
        assert!(text.contains("\"size\": [1280, 720],\n"), "{text}");
        assert!(text.contains("[1.5, 0.0],\n    [0.0, -2e-7]\n"), "{text}");
        assert!(
            text.contains("[null, 1.0]") && text.contains("\"a\": [1]"),
            "{text}"
        );
        assert_eq!(serde_json::from_str::<serde_json::Value>(&text).unwrap(), value);
    }

    #[cfg(unix)]
    #[test]
    fn others_may_read_the_file_as_far_as_the_umask_allows() {
        use std::os::unix::fs::PermissionsExt as _;
        let dir = tempfile::tempdir().unwrap();
        let (ours, plain) = (dir.path().join("a"), dir.path().join("b"));
        write_atomically(&ours, b"x").unwrap();
        fs::write(&plain, b"x").unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
    }

    #[test]
    fn a_missing_folder_is_named_and_nothing_is_created() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("no/such/a.json");
        let error = write_atomically(&path, b"x").unwrap_err();
        assert!(matches!(error, WriteError::MissingFolder { .. }), "{error:?}");
        assert!(error.to_string().contains("no/such/a.json"));
        assert!(error.to_string().contains("--out"));
        assert!(names(dir.path()).is_empty());
    }

    #[test]
    fn a_file_in_place_of_the_folder_is_told() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("file");
        fs::write(&file, b"mine").unwrap();
        for error in [
            check_output_dir(&file).unwrap_err(),
            check_output_dir(&file.join("below")).unwrap_err(),
            write_atomically(&file.join("a.json"), b"x").unwrap_err(),
        ] {
            assert!(matches!(error, WriteError::NotAFolder { .. }), "{error:?}");
            assert!(error.to_string().contains("file"));
        }
        assert_eq!(fs::read(&file).unwrap(), b"mine");
    }

    #[test]
    fn the_output_folder_is_created_and_left_empty() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("deep/er");
        let made = check_output_dir(&out).unwrap();
        drop(check_output_dir(&out).unwrap());
        assert!(out.is_dir() && names(&out).is_empty(), "made by another");
        drop(made);
        assert!(names(dir.path()).is_empty(), "nothing came into it");
    }

    #[test]
    fn an_output_folder_with_something_in_it_stays() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("deep/er");
        let made = check_output_dir(&out).unwrap();
        write_atomically(&out.join("a.json"), b"x").unwrap();
        drop(made);
        assert_eq!(names(&out), ["a.json"]);
    }

    #[test]
    fn an_overlay_appears_with_the_reports_or_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        let overlay = temporary_name(dir.path()).unwrap();
        fs::write(&overlay, "moving pictures").unwrap();
        let paths = write_reports(
            &test_measurements::two_bounces(),
            dir.path(),
            "clip",
            Some(overlay),
        )
        .unwrap();
        assert_eq!(names(dir.path()).len(), 4);
        assert_eq!(fs::read(paths.overlay_mp4.unwrap()).unwrap(), b"moving pictures");

        let dir = tempfile::tempdir().unwrap();
        fs::create_dir(dir.path().join("clip.overlay.mp4")).unwrap();
        let overlay = temporary_name(dir.path()).unwrap();
        let error = write_reports(
            &test_measurements::two_bounces(),
            dir.path(),
            "clip",
            Some(overlay),
        )
        .unwrap_err();
        assert!(matches!(error, WriteError::IsAFolder { .. }), "{error:?}");
        assert_eq!(names(dir.path()), ["clip.overlay.mp4"]);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn where_nobody_may_write_it_says_so() {
        // The kernel's own tree refuses new files even to root.
        let error = check_output_dir(Path::new("/proc/track-out")).unwrap_err();
        assert!(
            matches!(
                error,
                WriteError::MissingFolder { .. } | WriteError::Denied { .. }
            ),
            "{error:?}"
        );
        assert!(error.to_string().contains("/proc/track-out"));
    }

    #[test]
    fn a_full_disk_and_a_denial_have_their_own_words() {
        let path = Path::new("out/a.json");
        let full = WriteError::new(path, io::Error::from_raw_os_error(28));
        assert!(full.to_string().contains("disk is full"), "{full}");
        let denied = WriteError::new(path, io::Error::from_raw_os_error(13));
        assert!(denied.to_string().contains("may not write"), "{denied}");
        let read_only = WriteError::new(path, io::Error::from_raw_os_error(30));
        assert!(matches!(read_only, WriteError::Denied { .. }));
        for error in [full, denied, read_only] {
            assert!(error.to_string().contains("out/a.json"));
        }
    }

    #[test]
    fn all_reports_appear_together() {
        let dir = tempfile::tempdir().unwrap();
        let paths = write_reports(&test_measurements::two_bounces(), dir.path(), "clip", None).unwrap();
        assert_eq!(
            names(dir.path()),
            ["clip.points.csv", "clip.report.html", "clip.result.json"]
        );
        let json: serde_json::Value = serde_json::from_slice(&fs::read(paths.result_json).unwrap()).unwrap();
        assert_eq!(json["status"], "measured");
        assert!(
            fs::read_to_string(paths.points_csv)
                .unwrap()
                .starts_with("frame,")
        );
        assert!(
            fs::read_to_string(paths.report_html)
                .unwrap()
                .starts_with("<!DOCTYPE html>")
        );
    }

    #[test]
    fn when_one_report_cannot_be_placed_none_is() {
        let dir = tempfile::tempdir().unwrap();
        fs::create_dir(dir.path().join("clip.report.html")).unwrap();
        let error = write_reports(&test_measurements::rejected(), dir.path(), "clip", None).unwrap_err();
        assert!(matches!(error, WriteError::IsAFolder { .. }), "{error:?}");
        assert_eq!(names(dir.path()), ["clip.report.html"]);
    }
}
