//! A batch in parts: which recordings belong to a shard, and the record that a shard leaves in `DIR/shards` for the merge.
//!
//! The first eight bytes of the SHA-256 of a recording's name (UTF-8), read as a number with the most significant byte first,
//! leave a remainder r when divided by N: the recording belongs to shard r + 1 of N. So a recording stays in its shard
//! whatever other recordings are added, and every machine comes to the same parts without asking another.
//!
//! A shard writes one record, `shards/I-of-N.json`: when it begins, as not finished, with the names of its recordings; when it
//! has ended, with how each of them ended and the key of its result. No other shard writes that file.

use super::key::ResultKey;
use super::series::CalibrationNumbers;
use super::{BatchError, BatchRecording};
use crate::report::documents;
use crate::report::write::{self, WriteError};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};
use std::fmt;
use std::fs;
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// The folder of the records.
pub const SHARDS: &str = "shards";

/// The schema of a record.
const SCHEMA: &str = "track.shard/1";

/// Part `index` of `count`, from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Shard {
    /// Which part, from 1 to `count`.
    pub index: NonZeroU32,
    /// How many parts there are.
    pub count: NonZeroU32,
}

impl Shard {
    /// Whether the recording of this name belongs to the shard.
    #[must_use]
    pub fn has(self, name: &str) -> bool {
        Self::of(name, self.count).index == self.index
    }

    /// The one of `count` shards to which the recording of this name belongs.
    #[must_use]
    pub fn of(name: &str, count: NonZeroU32) -> Self {
        let digest = Sha256::digest(name.as_bytes());
        let first = digest.iter().take(8);
        let number = first.fold(0_u64, |number, byte| number << 8 | u64::from(*byte));
        let remainder = u32::try_from(number % u64::from(count.get())).unwrap_or(0);
        Self {
            index: NonZeroU32::MIN.saturating_add(remainder),
            count,
        }
    }

    /// As in the names of its files: `2-of-3`.
    pub(super) fn file_word(self) -> String {
        format!("{}-of-{}", self.index, self.count)
    }

    /// The shard whose files have this word.
    pub(super) fn from_file_word(word: &str) -> Option<Self> {
        let (index, count) = word.split_once("-of-")?;
        format!("{index}/{count}").parse().ok()
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text
            .split_once('/')
            .and_then(|(index, count)| Some((index.parse::<u32>().ok()?, count.parse::<u32>().ok()?)));
        let Some((index, count)) = numbers else {
            return Err("accepted is I/N, two whole numbers, as in 2/16: part 2 of 16".to_owned());
        };
        match (NonZeroU32::new(index), NonZeroU32::new(count)) {
            (_, None) => Err("there is no part of 0; N is 1 or more, as in 1/16".to_owned()),
            (Some(index), Some(count)) if index <= count => Ok(Self { index, count }),
            (_, Some(count)) => Err(format!(
                "I is from 1 to N, here from 1 to {count}; an array of tasks that counts from 0 needs 1 added"
            )),
        }
    }
}

/// What a shard has left for the merge.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct ShardRecord {
    schema: String,
    /// Which one.
    pub shard: Shard,
    /// Whether it has ended; otherwise it runs, or was killed.
    pub finished: bool,
    /// All recordings that were given, of whatever shard.
    pub given: GivenRecordings,
    /// Its own, by name.
    pub recordings: Vec<ShardRecording>,
}

/// The list from which a shard took its part.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct GivenRecordings {
    /// How many.
    pub count: usize,
    /// SHA-256 of their names and groups.
    pub sha256: String,
}

impl GivenRecordings {
    pub fn of(recordings: &[BatchRecording]) -> Self {
        let lines = recordings
            .iter()
            .map(|r| format!("{:?}\t{:?}\n", r.name, r.group));
        Self {
            count: recordings.len(),
            sha256: crate::frames::digest::of_bytes(lines.collect::<String>().as_bytes()),
        }
    }
}

/// A recording of a shard.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct ShardRecording {
    /// What its results are called.
    pub name: String,
    /// Which rows of the series it belongs to.
    pub group: String,
    /// What its result was measured with; `null` where there is no result.
    pub key: Option<ResultKey>,
    /// What of its calibration stands in the series.
    pub calibration: Option<CalibrationNumbers>,
    /// Why it has no result; `null` where it has one, or is not done.
    pub failed: Option<String>,
}

impl ShardRecording {
    /// One that is not done.
    pub fn waiting(recording: &BatchRecording) -> Self {
        Self {
            name: recording.name.clone(),
            group: recording.group.clone(),
            key: None,
            calibration: None,
            failed: None,
        }
    }
}

impl ShardRecord {
    pub fn new(
        shard: Shard,
        finished: bool,
        given: GivenRecordings,
        recordings: Vec<ShardRecording>,
    ) -> Self {
        Self {
            schema: SCHEMA.to_owned(),
            shard,
            finished,
            given,
            recordings,
        }
    }

    /// Where it lies.
    pub fn path(out: &Path, shard: Shard) -> PathBuf {
        out.join(SHARDS).join(format!("{}.json", shard.file_word()))
    }

    pub fn write(&self, out: &Path) -> Result<PathBuf, WriteError> {
        let path = Self::path(out, self.shard);
        let folder = out.join(SHARDS);
        fs::create_dir_all(&folder).map_err(|source| WriteError::new(&folder, source))?;
        let text = documents::json_text(self).map_err(|e| WriteError::Contents {
            path: path.clone(),
            source: Box::new(e),
        })?;
        write::write_atomically(&path, &text)?;
        Ok(path)
    }

    fn read(path: &Path) -> Result<Self, BatchError> {
        let unreadable = |found: String| BatchError::BadShardRecord {
            path: path.to_owned(),
            found,
        };
        let bytes = fs::read(path).map_err(|e| unreadable(e.to_string()))?;
        let record: Self = serde_json::from_slice(&bytes).map_err(|e| unreadable(e.to_string()))?;
        if record.schema != SCHEMA || Self::path(Path::new(""), record.shard).file_name() != path.file_name()
        {
            return Err(unreadable(format!(
                "schema {}, shard {}",
                record.schema, record.shard
            )));
        }
        Ok(record)
    }

    /// The records in the folder, by shard.
    pub fn read_all(out: &Path) -> Result<Vec<Self>, BatchError> {
        let shards = recorded(out).into_iter();
        shards.map(|shard| Self::read(&Self::path(out, shard))).collect()
    }

    /// Removes the records of a division into other than `count` parts. How many there were.
    pub fn remove_of_other_counts(out: &Path, count: NonZeroU32) -> Result<usize, WriteError> {
        let others: Vec<Shard> = recorded(out).into_iter().filter(|s| s.count != count).collect();
        for shard in &others {
            let path = Self::path(out, *shard);
            match fs::remove_file(&path) {
                // Another shard, begun at the same time, removes them as well.
                Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(WriteError::new(&path, e)),
                _ => {}
            }
        }
        Ok(others.len())
    }
}

/// The shards that have left a record, in their order.
fn recorded(out: &Path) -> Vec<Shard> {
    let entries = fs::read_dir(out.join(SHARDS)).into_iter().flatten().flatten();
    let mut shards: Vec<Shard> = entries
        .filter_map(|entry| Shard::from_file_word(entry.file_name().to_str()?.strip_suffix(".json")?))
        .collect();
    shards.sort();
    shards
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_belongs_to_one_shard_the_same_in_every_version() {
        let count = NonZeroU32::new(3).unwrap();
        // sha256sum: printf a | sha256sum gives ca978112ca1bbdca...
        let expected = 0xca97_8112_ca1b_bdca_u64 % 3 + 1;
        assert_eq!(u64::from(Shard::of("a", count).index.get()), expected);
        let mut sizes = [0; 3];
        for i in 0..3000 {
            let name = format!("clip-{i}");
            let of: Vec<u32> = (1..=3)
                .filter(|index| format!("{index}/3").parse::<Shard>().unwrap().has(&name))
                .collect();
            assert_eq!(of.len(), 1);
            sizes[of[0] as usize - 1] += 1;
        }
        assert!(sizes.iter().all(|size| (900..1100).contains(size)), "{sizes:?}");
    }

    #[test]
    fn what_is_no_part_is_told() {
        let error = |text: &str| text.parse::<Shard>().unwrap_err();
        for text in ["", "2", "a/b", "1/", "/3", "-1/3", "1/2/3", "1.5/3"] {
            assert!(error(text).contains("I/N"), "{text}");
        }
        assert!(error("1/0").contains("N is 1 or more"));
        assert!(error("0/3").contains("from 1 to 3") && error("0/3").contains("from 0"));
        assert!(error("4/3").contains("from 1 to 3"));
        let shard: Shard = "2/16".parse().unwrap();
        assert_eq!(Shard::from_file_word(&shard.file_word()), Some(shard));
    }
}
