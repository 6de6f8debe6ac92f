//! The folder of results: `DIR/results`, and the folder in which the processes work, `DIR/.work`.
//!
//! A recording has four files there: its result, points and page, and its key, which is written last and holds the digests of
//! the others: a set that is not whole, or that somebody has changed, does not stand.

use super::key::Key;
use super::{BatchError, Recording};
use crate::report::write::{self, WriteError};
use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;
use serde_json::Value;
use std::collections::HashSet;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// What each file of a recording ends in.
const FILES: [&str; 3] = ["result.json", "points.csv", "report.html"];
const KEY: &str = "key.json";

/// The folder of results, by name.
pub const RESULTS: &str = "results";
/// The folder in which the processes work.
const WORK: &str = ".work";

/// The folder of a batch, held against other batches.
#[derive(Debug)]
pub struct Shelf {
    results: PathBuf,
    work: PathBuf,
    /// Open as long as the folder is held. Every process of the batch gets it too, so that a batch that follows a killed one
    /// waits for the last of them.
    lock: File,
    _folders: write::NewFolders,
}

impl Shelf {
    /// Holds `out`, makes its folders, and takes away what a killed run has left half done.
    pub fn open(out: &Path) -> Result<Self, BatchError> {
        let results = out.join(RESULTS);
        let folders = write::check_output_dir(&results)?;
        let lock = File::open(out).map_err(|source| WriteError::new(out, source))?;
        hold(&lock, out)?;
        let shelf = Self {
            work: out.join(WORK),
            results,
            lock,
            _folders: folders,
        };
        shelf.clear_work()?;
        write::clear_temporary_files(out)?;
        write::clear_temporary_files(&shelf.results)?;
        Ok(shelf)
    }

    /// The hold on the folder, for a process that works in it.
    pub fn hold(&self) -> io::Result<File> {
        self.lock.try_clone()
    }

    /// The folder of a recording's process.
    pub fn desk(&self, recording: &Recording) -> PathBuf {
        self.work.join(&recording.name)
    }

    /// The recording's result, if it stands: measured with `key`, every file as it was written.
    pub fn standing(&self, recording: &Recording, key: &Key) -> Option<Value> {
        let told: Value = serde_json::from_slice(&fs::read(self.path(recording, KEY)).ok()?).ok()?;
        let now = self.whole_key(recording, key, &self.results).ok()?;
        if told != now {
            return None;
        }
        self.result(recording).ok()
    }

    /// The result that lies there.
    pub fn result(&self, recording: &Recording) -> io::Result<Value> {
        let bytes = fs::read(self.path(recording, FILES[0]))?;
        serde_json::from_slice(&bytes).map_err(io::Error::from)
    }

    /// Takes over what the recording's process has made, the key last.
    pub fn take(&self, recording: &Recording, key: &Key) -> Result<(), WriteError> {
        let desk = self.desk(recording);
        let key_path = self.path(recording, KEY);
        let contents = |path: &Path, source: Box<dyn std::error::Error + Send + Sync>| WriteError::Contents {
            path: path.to_owned(),
            source,
        };
        let whole = self
            .whole_key(recording, key, &desk)
            .map_err(|e| contents(&key_path, Box::new(e)))?;
        let text = write::json_text(&whole).map_err(|e| contents(&key_path, Box::new(e)))?;
        for file in FILES {
            write::rename(&file_of(&desk, recording, file), &self.path(recording, file))?;
        }
        write::write_atomically(&key_path, &text)
    }

    /// Whether the recording's process has left a whole set on its desk.
    pub fn is_whole(&self, recording: &Recording) -> bool {
        let desk = self.desk(recording);
        FILES.iter().all(|file| file_of(&desk, recording, file).is_file())
    }

    /// Takes away a result that no longer belongs to its recording. Whether there was one.
    pub fn discard(&self, recording: &Recording) -> Result<bool, WriteError> {
        let mut any = false;
        for file in [KEY].into_iter().chain(FILES) {
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
    pub fn others(&self, recordings: &[Recording]) -> Vec<String> {
        let ours: HashSet<&str> = recordings.iter().map(|r| r.name.as_str()).collect();
        let ending = format!(".{}", FILES[0]);
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

    /// Takes the folder of a recording's process away.
    pub fn clear_desk(&self, recording: &Recording) -> Result<(), WriteError> {
        remove_folder(&self.desk(recording))
    }

    /// Takes the processes' folders away.
    pub fn clear_work(&self) -> Result<(), WriteError> {
        remove_folder(&self.work)
    }

    /// Makes an empty desk for the recording's process.
    pub fn make_desk(&self, recording: &Recording) -> Result<PathBuf, WriteError> {
        let desk = self.desk(recording);
        remove_folder(&desk)?;
        fs::create_dir_all(&desk).map_err(|source| WriteError::new(&desk, source))?;
        Ok(desk)
    }

    fn whole_key(&self, recording: &Recording, key: &Key, folder: &Path) -> io::Result<Value> {
        let paths = FILES.map(|file| file_of(folder, recording, file));
        let files: Vec<(&str, &Path)> = FILES
            .iter()
            .zip(&paths)
            .map(|(&file, path)| (file, path.as_path()))
            .collect();
        key.with_files(&files)
    }

    fn path(&self, recording: &Recording, file: &str) -> PathBuf {
        file_of(&self.results, recording, file)
    }
}

impl Drop for Shelf {
    fn drop(&mut self) {
        // Whoever comes next does it otherwise.
        let _ = self.clear_work();
    }
}

fn file_of(folder: &Path, recording: &Recording, file: &str) -> PathBuf {
    folder.join(format!("{}.{file}", recording.name))
}

fn remove_folder(path: &Path) -> Result<(), WriteError> {
    match fs::remove_dir_all(path) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => Err(WriteError::new(path, e)),
        _ => Ok(()),
    }
}

/// Holds the folder. The processes of a batch that was just killed end within moments: they are waited for.
fn hold(lock: &File, out: &Path) -> Result<(), BatchError> {
    const ATTEMPTS: usize = 60;
    for _ in 0..ATTEMPTS {
        match flock(lock, FlockOperation::NonBlockingLockExclusive) {
            Err(Errno::WOULDBLOCK | Errno::INTR) => std::thread::sleep(Duration::from_millis(50)),
            // A file system that knows no locks: then the user has to see to it.
            Ok(()) | Err(_) => return Ok(()),
        }
    }
    Err(BatchError::InUse { out: out.to_owned() })
}
