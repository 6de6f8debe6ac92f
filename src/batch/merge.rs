//! The series, fit and page of all shards, from the records that they have left: what a run that was not divided writes.
//!
//! Nothing is measured, and no recording is read: the records say what each result was measured with, and the results are
//! checked against that. A merge of less than everything would look like the series and be another one, so it writes nothing.

use super::result_store::ResultStore;
use super::session::{self, BatchSummary};
use super::shard::{GivenRecordings, SHARDS, Shard, ShardRecord, ShardRecording};
use super::{BatchError, BatchPlan, BatchRecording, CalibrationChanges, RefutedRecordings};
use std::collections::{BTreeMap, HashSet};
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};

/// Merges the shards in `out`. `given`: the recordings that should be there, where the user names them.
///
/// # Errors
/// See [`BatchError`]; where something is missing, nothing is written.
pub fn run(
    given: Option<&BatchPlan>,
    refuted: RefutedRecordings,
    out: &Path,
) -> Result<(BatchPlan, BatchSummary), BatchError> {
    let incomplete = |missing: Vec<String>| BatchError::ShardsMissing {
        out: out.to_owned(),
        missing,
    };
    let none = format!(
        "there is no record of a shard in {}; measure the recordings first: track batch PATH... --out {} --shard 1/N, 2/N, ... N/N",
        out.join(SHARDS).display(),
        out.display()
    );
    // Before the folder is locked, which would make it.
    if !out.join(SHARDS).is_dir() {
        return Err(incomplete(vec![none]));
    }
    let store = ResultStore::open(out)?;
    let records = ShardRecord::read_all(out)?;
    let Some(first) = records.first() else {
        return Err(incomplete(vec![none]));
    };
    let count = first.shard.count;
    let mut missing = missing_shards(&records, count, given);
    missing.extend(other_lists(&records, given));
    if !missing.is_empty() {
        return Err(incomplete(missing));
    }
    let mut recorded: Vec<&ShardRecording> = records.iter().flat_map(|r| &r.recordings).collect();
    recorded.sort_by(|a, b| a.name.cmp(&b.name));
    let plan = BatchPlan {
        recordings: recorded.iter().map(|r| of_record(r)).collect(),
    };
    match session::publish_recorded(&plan, &recorded, refuted, &store, out)? {
        Ok(summary) => Ok((plan, summary)),
        Err(names) => {
            let mut of_shard: BTreeMap<Shard, Vec<&str>> = BTreeMap::new();
            for name in &names {
                of_shard.entry(Shard::of(name, count)).or_default().push(name);
            }
            let lines = of_shard.into_iter().map(|(shard, names)| {
                format!(
                    "results of shard {shard} are gone or have changed since it ended: {}; run it again",
                    listed(&names)
                )
            });
            Err(incomplete(lines.collect()))
        }
    }
}

/// Shards that have not been run, or have not ended.
fn missing_shards(records: &[ShardRecord], count: NonZeroU32, given: Option<&BatchPlan>) -> Vec<String> {
    let mut missing = Vec::new();
    for record in records.iter().filter(|record| record.shard.count != count) {
        missing.push(format!(
            "shard {} is of another division than shards of {count}; run all with the same N",
            record.shard
        ));
    }
    for index in 1..=count.get() {
        let record = records.iter().find(|r| r.shard.index.get() == index);
        if record.is_some_and(|record| record.finished) {
            continue;
        }
        let state = match record {
            Some(_) => "was begun and has not ended (it runs, or was stopped)",
            None => "has not been run",
        };
        let in_shard = |name: &str| Shard::of(name, count).index.get() == index;
        let names: Option<Vec<&str>> = match (record, given) {
            (Some(record), _) => Some(record.recordings.iter().map(|r| r.name.as_str()).collect()),
            (None, Some(plan)) => {
                let names = plan.recordings.iter().map(|r| r.name.as_str());
                Some(names.filter(|name| in_shard(name)).collect())
            }
            (None, None) => None,
        };
        let recordings = match names {
            Some(names) if names.is_empty() => "it has no recording, but its record is needed".to_owned(),
            Some(names) => format!("its recordings are {}", listed(&names)),
            None => "name the recordings with --merge as well to see which are its own".to_owned(),
        };
        missing.push(format!(
            "shard {index}/{count} {state}: {recordings}; run it with --shard {index}/{count}"
        ));
    }
    missing
}

/// Shards that took their part of another list of recordings.
fn other_lists(records: &[ShardRecord], given: Option<&BatchPlan>) -> Vec<String> {
    let ended = records.iter().filter(|record| record.finished);
    let mut lists: Vec<(&GivenRecordings, Vec<String>)> = Vec::new();
    for record in ended {
        let shard = record.shard.to_string();
        match lists.iter_mut().find(|(list, _)| **list == record.given) {
            Some((_, shards)) => shards.push(shard),
            None => lists.push((&record.given, vec![shard])),
        }
    }
    let mut lines = Vec::new();
    if let [_, _, ..] = lists.as_slice() {
        let sides = lists.iter().map(|(list, shards)| {
            let shards: Vec<&str> = shards.iter().map(String::as_str).collect();
            format!("{} of {} recordings", listed(&shards), list.count)
        });
        lines.push(format!(
            "the shards were given different recordings or groups ({}); run all again with the same paths and manifest: \
             what is measured stands",
            sides.collect::<Vec<_>>().join("; ")
        ));
    }
    if let Some(plan) = given {
        let known: HashSet<&str> = records
            .iter()
            .flat_map(|record| record.recordings.iter().map(|r| r.name.as_str()))
            .collect();
        for record in records.iter().filter(|record| record.finished) {
            let names = plan.recordings.iter().map(|r| r.name.as_str());
            let new: Vec<&str> = names
                .filter(|name| record.shard.has(name) && !known.contains(name))
                .collect();
            if !new.is_empty() {
                lines.push(format!(
                    "shard {} was run without {}; run it again",
                    record.shard,
                    listed(&new)
                ));
            }
        }
    }
    lines
}

/// The recording as far as the series needs it.
fn of_record(recorded: &ShardRecording) -> BatchRecording {
    BatchRecording {
        name: recorded.name.clone(),
        video: PathBuf::new(),
        calib: None,
        edits: None,
        group: recorded.group.clone(),
        changes: CalibrationChanges::default(),
    }
}

/// How many, and the first few of them.
fn listed(names: &[&str]) -> String {
    const MOST: usize = 10;
    let more = names.len().saturating_sub(MOST);
    let mut text = names.iter().take(MOST).copied().collect::<Vec<_>>().join(", ");
    if more > 0 {
        text.push_str(&format!(" and {more} more"));
    }
    text
}
