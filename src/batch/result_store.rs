//! The folder of results, `DIR/results`, and the folder of the processes' work directories, `DIR/.work`.
//!
//! A recording has four files in `results`: its result, points and page, and its key, which is written last and holds the
//! digests of the others. So a set of files that is incomplete, or that somebody has changed, is not taken for a result.

use super::key::ResultKey;
use super::{BatchError, BatchRecording};
use crate::report::documents;
use crate::report::formats::batch_formats;
use crate::report::write::{self, WriteError};
use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;
use serde_json::Value;
use std::collections::HashSet;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// What the file of a recording's result ends in, and that of its key.
const RESULT: &str = "result.json";
const KEY: &str = "key.json";

/// The folder of results, by name.
pub const RESULTS: &str = "results";
/// The folder of the processes' work directories.
const WORK: &str = ".work";

/// The folder of a batch, locked against other batches.
#[derive(Debug)]
pub struct ResultStore {
    results: PathBuf,
    work: PathBuf,
    /// Open as long as the folder is locked. Every process of the batch inherits it, so that a batch that is started after
    /// another was killed waits until the last process of that one has ended.
    lock: File,
    _folders: write::NewFolders,
}

impl ResultStore {
    /// Locks `out`, makes its folders, and removes what a killed run has left unfinished.
    pub fn open(out: &Path) -> Result<Self, BatchError> {
        let results = out.join(RESULTS);
        let folders = write::check_output_dir(&results)?;
        let lock = File::open(out).map_err(|source| WriteError::new(out, source))?;
        lock_folder(&lock, out)?;
        let store = Self {
            work: out.join(WORK),
            results,
            lock,
            _folders: folders,
        };
        store.clear_work_dirs()?;
        write::clear_temporary_files(out)?;
        write::clear_temporary_files(&store.results)?;
        Ok(store)
    }

    /// The lock of the folder, for a process that works in it to share.
    pub fn lock(&self) -> io::Result<File> {
        self.lock.try_clone()
    }

    /// The work directory of a recording's process.
    pub fn work_dir(&self, recording: &BatchRecording) -> PathBuf {
        self.work.join(&recording.name)
    }

    /// The recording's result, if it was measured with `key` and every file is as it was written.
    pub fn up_to_date(&self, recording: &BatchRecording, key: &ResultKey) -> Option<Value> {
        let stored: Value = serde_json::from_slice(&fs::read(self.path(recording, KEY)).ok()?).ok()?;
        let now = self.key_with_files(recording, key, &self.results).ok()?;
        if stored != now {
            return None;
        }
        self.result(recording).ok()
    }

    /// The stored result of a recording, whatever it was measured with.
    pub fn result(&self, recording: &BatchRecording) -> io::Result<Value> {
        let bytes = fs::read(self.path(recording, RESULT))?;
        serde_json::from_slice(&bytes).map_err(io::Error::from)
    }

    /// The build that measured the result of this name, as its key has it.
    pub fn build(&self, name: &str) -> Option<String> {
        let key = fs::read(self.results.join(format!("{name}.{KEY}"))).ok()?;
        build_in(&serde_json::from_slice(&key).ok()?)
    }

    /// Moves the files that the recording's process has made into the folder of results, the key last.
    pub fn store(&self, recording: &BatchRecording, key: &ResultKey) -> Result<(), WriteError> {
        let work_dir = self.work_dir(recording);
        let key_path = self.path(recording, KEY);
        let contents = |path: &Path, source: Box<dyn std::error::Error + Send + Sync>| WriteError::Contents {
            path: path.to_owned(),
            source,
        };
        let whole = self
            .key_with_files(recording, key, &work_dir)
            .map_err(|e| contents(&key_path, Box::new(e)))?;
        let text = documents::json_text(&whole).map_err(|e| contents(&key_path, Box::new(e)))?;
        for file in files() {
            write::rename(&file_of(&work_dir, recording, file), &self.path(recording, file))?;
        }
        write::write_atomically(&key_path, &text)
    }

    /// Whether the recording's process has left a complete set of files in its work directory.
    pub fn is_complete(&self, recording: &BatchRecording) -> bool {
        let work_dir = self.work_dir(recording);
        files().all(|file| file_of(&work_dir, recording, file).is_file())
    }

    /// Removes a result that no longer belongs to its recording. Whether there was one.
    pub fn discard(&self, recording: &BatchRecording) -> Result<bool, WriteError> {
        let mut any = false;
        for file in [KEY].into_iter().chain(files()) {
            let path = self.path(recording, file);
            match fs::remove_file(&path) {
                Ok(()) => any = true,
                Err(e) if e.kind() == io::ErrorKind::NotFound => {}
                Err(source) => return Err(WriteError::new(&path, source)),
            }
        }
        Ok(any)
    }

    /// Names of results that belong to none of `recordings`.
    pub fn others(&self, recordings: &[BatchRecording]) -> Vec<String> {
        let ours: HashSet<&str> = recordings.iter().map(|r| r.name.as_str()).collect();
        let ending = format!(".{RESULT}");
        let mut others: Vec<String> = fs::read_dir(&self.results)
            .into_iter()
            .flatten()
            .flatten()
            .filter_map(|entry| Some(entry.file_name().to_str()?.strip_suffix(&ending)?.to_owned()))
            .filter(|name| !ours.contains(name.as_str()))
            .collect();
        others.sort();
        others
    }

    /// Removes the work directory of a recording's process.
    pub fn clear_work_dir(&self, recording: &BatchRecording) -> Result<(), WriteError> {
        remove_folder(&self.work_dir(recording))
    }

    /// Removes all work directories.
    pub fn clear_work_dirs(&self) -> Result<(), WriteError> {
        remove_folder(&self.work)
    }

    /// Makes an empty work directory for the recording's process.
    pub fn make_work_dir(&self, recording: &BatchRecording) -> Result<PathBuf, WriteError> {
        let work_dir = self.work_dir(recording);
        remove_folder(&work_dir)?;
        fs::create_dir_all(&work_dir).map_err(|source| WriteError::new(&work_dir, source))?;
        Ok(work_dir)
    }

    fn key_with_files(
        &self,
        recording: &BatchRecording,
        key: &ResultKey,
        folder: &Path,
    ) -> io::Result<Value> {
        let paths: Vec<(&str, PathBuf)> = files()
            .map(|file| (file, file_of(folder, recording, file)))
            .collect();
        let files: Vec<(&str, &Path)> = paths.iter().map(|(file, path)| (*file, path.as_path())).collect();
        key.with_files(&files)
    }

    fn path(&self, recording: &BatchRecording, file: &str) -> PathBuf {
        file_of(&self.results, recording, file)
    }
}

impl Drop for ResultStore {
    fn drop(&mut self) {
        // Where it fails, the next batch in this folder does it.
        let _ = self.clear_work_dirs();
    }
}

/// The build that a result or a key names.
pub fn build_in(document: &Value) -> Option<String> {
    let text = |key: &str| document[key].as_str();
    Some(format!("{} ({})", text("version")?, text("commit")?))
}

/// What each file of a recording ends in.
fn files() -> impl Iterator<Item = &'static str> {
    batch_formats().map(|format| format.suffix())
}

fn file_of(folder: &Path, recording: &BatchRecording, file: &str) -> PathBuf {
    folder.join(format!("{}.{file}", recording.name))
}

fn remove_folder(path: &Path) -> Result<(), WriteError> {
    match fs::remove_dir_all(path) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => Err(WriteError::new(path, e)),
        _ => Ok(()),
    }
}

/// Locks the folder. The processes of a batch that was just killed end within moments: they are waited for.
fn lock_folder(lock: &File, out: &Path) -> Result<(), BatchError> {
    const ATTEMPTS: usize = 60;
    for _ in 0..ATTEMPTS {
        match flock(lock, FlockOperation::NonBlockingLockExclusive) {
            Err(Errno::WOULDBLOCK | Errno::INTR) => std::thread::sleep(Duration::from_millis(50)),
            // A file system without locks: there, not to run two batches in one folder is left to the user.
            Ok(()) | Err(_) => return Ok(()),
        }
    }
    Err(BatchError::InUse { out: out.to_owned() })
}
