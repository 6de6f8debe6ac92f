//! The folder of results, `DIR/results`, and the folder of the processes' work directories, `DIR/.work`.
//!
//! A recording has four files in `results`: its result, points and page, and its key, which is written last and holds the
//! digests of the others. So a set of files that is incomplete, or that somebody has changed, is not taken for a result.
//!
//! One batch at a time works in the folder, or any number of shards. A shard writes files of its own recordings only: results,
//! its record, and below `DIR/.work/I-of-N`, a folder that it locks.

use super::key::ResultKey;
use super::shard::Shard;
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
    /// Open as long as the folder is locked (a shard's: that of its work directories). Every process of the batch inherits
    /// it, so that a batch that is started after another was killed waits until the last process of that one has ended.
    lock: File,
    /// That of the whole folder, which shards share.
    shared_lock: Option<File>,
    _folders: Option<write::NewFolders>,
}

impl ResultStore {
    /// Locks `out`, makes its folders, and removes what a killed run has left unfinished.
    pub fn open(out: &Path) -> Result<Self, BatchError> {
        let results = out.join(RESULTS);
        let folders = write::check_output_dir(&results)?;
        let lock = File::open(out).map_err(|source| WriteError::new(out, source))?;
        let in_use = || BatchError::InUse { out: out.to_owned() };
        if !lock_folder(&lock, FlockOperation::NonBlockingLockExclusive) {
            return Err(in_use());
        }
        let store = Self {
            work: out.join(WORK),
            results,
            lock,
            shared_lock: None,
            _folders: Some(folders),
        };
        // Processes of shards that were just killed.
        for folder in folders_in(&store.work) {
            if let Ok(lock) = File::open(folder)
                && !lock_folder(&lock, FlockOperation::NonBlockingLockExclusive)
            {
                return Err(in_use());
            }
        }
        store.clear_work_dirs()?;
        for folder in [out, &store.results, &out.join(super::shard::SHARDS)] {
            if folder.is_dir() {
                write::clear_temporary_files(folder)?;
            }
        }
        Ok(store)
    }

    /// The same for a shard, beside which others may work in the folder.
    pub fn open_for_shard(out: &Path, shard: Shard) -> Result<Self, BatchError> {
        let results = out.join(RESULTS);
        write::check_output_dir(&results)?.keep();
        let whole = File::open(out).map_err(|source| WriteError::new(out, source))?;
        if !lock_folder(&whole, FlockOperation::NonBlockingLockShared) {
            return Err(BatchError::InUse { out: out.to_owned() });
        }
        let all_work = out.join(WORK);
        let work = all_work.join(shard.file_word());
        fs::create_dir_all(&work).map_err(|source| WriteError::new(&work, source))?;
        let lock = File::open(&work).map_err(|source| WriteError::new(&work, source))?;
        if !lock_folder(&lock, FlockOperation::NonBlockingLockExclusive) {
            return Err(BatchError::ShardInUse {
                out: out.to_owned(),
                shard,
            });
        }
        // Parts of another count share recordings with this one.
        for folder in folders_in(&all_work) {
            let word = folder.file_name().and_then(|name| name.to_str());
            let other = word.and_then(Shard::from_file_word);
            if let Some(other) = other.filter(|other| other.count != shard.count)
                && let Ok(lock) = File::open(&folder)
                && !lock_folder(&lock, FlockOperation::NonBlockingLockShared)
            {
                return Err(BatchError::OtherShards {
                    out: out.to_owned(),
                    shard,
                    other,
                });
            }
        }
        let store = Self {
            work,
            results,
            lock,
            shared_lock: Some(whole),
            _folders: None,
        };
        store.clear_work_dirs()?;
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
        // Not written in the folder of results: what a killed shard leaves there under a temporary name would stay.
        write::write_atomically(&file_of(&work_dir, recording, KEY), &text)?;
        for file in files().chain([KEY]) {
            write::rename(&file_of(&work_dir, recording, file), &self.path(recording, file))?;
        }
        Ok(())
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

    /// Removes all work directories; a shard only its own, and not the folder that it has locked.
    pub fn clear_work_dirs(&self) -> Result<(), WriteError> {
        if self.shared_lock.is_none() {
            return remove_folder(&self.work);
        }
        folders_in(&self.work)
            .iter()
            .try_for_each(|dir| remove_folder(dir))
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

/// The folders in `dir`; none where it cannot be read.
fn folders_in(dir: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(dir).into_iter().flatten().flatten();
    entries
        .map(|entry| entry.path())
        .filter(|path| path.is_dir())
        .collect()
}

/// Locks the folder; whether nobody else has. The processes of a batch that was just killed end within moments: they are
/// waited for.
fn lock_folder(lock: &File, how: FlockOperation) -> bool {
    const ATTEMPTS: usize = 60;
    for _ in 0..ATTEMPTS {
        match flock(lock, how) {
            Err(Errno::WOULDBLOCK | Errno::INTR) => std::thread::sleep(Duration::from_millis(50)),
            // A file system without locks: there, not to run two batches in one folder is left to the user.
            Ok(()) | Err(_) => return true,
        }
    }
    false
}
