//! Files that appear whole or not at all.
//!
//! A file is written under a temporary name in its own folder, forced to the disk, and renamed: whoever looks sees the
//! old file or the new one, never half of one, and a failure leaves nothing behind.

use crate::frames::RecodeError;
use crate::frames::temporary::{PREFIX, file_beside, folder_of};
use std::fs;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use tempfile::TempPath;
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
    /// A video of the recording could not be made.
    #[error("the overlay video {} could not be made", path.display())]
    Video {
        /// What was to be written.
        path: PathBuf,
        /// What failed.
        source: RecodeError,
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

/// The folders that [`check_output_dir`] made. Dropping it takes those back in which nothing has come to lie.
#[derive(Debug)]
#[must_use = "dropped at once, it takes the output folder back at once"]
pub struct NewFolders {
    /// From the outermost to the innermost.
    made: Vec<PathBuf>,
}

impl NewFolders {
    /// Lets the folders stay, whether or not something comes to lie in them: others may be about to write there.
    pub fn keep(mut self) {
        self.made.clear();
    }
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
    let mut proof = file_beside(&dir.join("proof"), SUFFIX).map_err(refused)?;
    // More than the few bytes that some file systems keep beside the name, and forced out: a full disk shows now.
    proof
        .write_all(&[0; 1 << 16])
        .and_then(|()| proof.as_file().sync_all())
        .and_then(|()| proof.close())
        .map_err(refused)?;
    Ok(folders)
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
    let staged = files.iter().map(|&(path, bytes)| stage(path.to_owned(), bytes));
    place_together(staged.collect::<Result<_, _>>()?).map(drop)
}

/// What a file of an output folder is called, and its bytes or why there are none.
pub(super) type MadeFile<N> = (N, Result<Vec<u8>, Box<dyn std::error::Error + Send + Sync>>);

/// Writes several files into `dir`: all of them, or none. Their paths.
pub(super) fn write_into<N: AsRef<Path>>(
    dir: &Path,
    files: Vec<MadeFile<N>>,
) -> Result<Vec<PathBuf>, WriteError> {
    let paths: Vec<PathBuf> = files.iter().map(|(name, _)| dir.join(name)).collect();
    let staged = paths.iter().zip(files).map(|(path, (_, bytes))| match bytes {
        Ok(bytes) => stage(path.clone(), &bytes),
        Err(source) => Err(WriteError::Contents {
            path: path.clone(),
            source,
        }),
    });
    place_together(staged.collect::<Result<_, _>>()?)?;
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
        if name.starts_with(PREFIX.as_bytes()) && name.ends_with(SUFFIX.as_bytes()) {
            fs::remove_file(entry.path()).map_err(refused)?;
        }
    }
    Ok(())
}

/// Gives several files their names so that either all appear or none does: every byte is on the disk before. Only a
/// rename that fails after another succeeded can break this; then those already there are taken back, since one new
/// file among old ones would mislead.
pub(super) fn place_together(staged: Vec<StagedFile>) -> Result<Vec<PathBuf>, WriteError> {
    let mut placed: Vec<PathBuf> = Vec::with_capacity(staged.len());
    for (temporary, path) in staged {
        if let Err(error) = temporary.persist(&path) {
            for path in placed {
                // The first error is the one to tell.
                let _ = fs::remove_file(path);
            }
            return Err(WriteError::new(&path, error.error));
        }
        placed.push(path);
    }
    if let Some(path) = placed.first() {
        sync_folder(folder_of(path));
    }
    Ok(placed)
}

/// A whole file under a temporary name, and what it is to be called.
pub(super) type StagedFile = (TempPath, PathBuf);

/// `bytes` on the disk under a temporary name beside `path`.
pub(super) fn stage(path: PathBuf, bytes: &[u8]) -> Result<StagedFile, WriteError> {
    refuse_folder(&path)?;
    let refused = |source| WriteError::new(&path, source);
    let mut temporary = file_beside(&path, SUFFIX).map_err(refused)?;
    temporary.write_all(bytes).map_err(refused)?;
    temporary.as_file().sync_all().map_err(refused)?;
    Ok((temporary.into_temp_path(), path))
}

/// A video under a temporary name beside `path`, written there by `recode`.
pub(super) fn stage_video(
    path: PathBuf,
    recode: impl FnOnce(&Path) -> Result<(), RecodeError>,
) -> Result<StagedFile, WriteError> {
    let temporary = file_beside(&path, SUFFIX).map_err(|source| WriteError::new(folder_of(&path), source))?;
    let temporary = temporary.into_temp_path();
    match recode(&temporary) {
        Ok(()) => refuse_folder(&path).map(|()| (temporary, path)),
        Err(source) => Err(WriteError::Video { path, source }),
    }
}

fn refuse_folder(path: &Path) -> Result<(), WriteError> {
    if path.is_dir() {
        return Err(WriteError::IsAFolder {
            path: path.to_owned(),
        });
    }
    Ok(())
}

/// What temporary names end with.
const SUFFIX: &str = ".tmp";

/// Makes the names last through a power cut, where the system lets a folder be synced. The files are whole without it.
fn sync_folder(dir: &Path) {
    if let Ok(folder) = fs::File::open(dir) {
        let _ = folder.sync_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
