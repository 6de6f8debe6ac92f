//! Which recordings a series may trust as a whole.
//!
//! * Identical recordings (the same SHA-256) count once: of each the first by name, `duplicate_recording` the others. Counted
//!   twice, a launch would seem to confirm itself.
//! * Recordings whose fall contradicts gravity, or whose scale contradicts the ball's size, are refuted: their lengths and
//!   speeds are wrong by an unknown factor. They are left out unless [`RefutedRecordings::Kept`] is asked for.
//! * Results of different builds of the program may differ without the ball having a part in it; that is said.

pub use crate::rebound::fit::csv::RefutedRecordings;

use crate::rebound::fit::Note;
use crate::rebound::fit::csv::KEPT_ON_REQUEST;
use std::collections::{BTreeMap, HashMap};

/// The code of a recording that is a copy of another.
pub const DUPLICATE: &str = "duplicate_recording";
/// The code of a batch whose results come from different builds.
pub const SEVERAL_BUILDS: &str = "several_builds";

/// What refutes a recording, the codes of its warnings that say so, and what is wrong with it.
const REFUTATIONS: [Refutation; 2] = [
    Refutation {
        codes: &["gravity_mismatch", "refuted_calibration"],
        witness: "g",
        reason: "its fall contradicts g (gravity_mismatch), so its scale or frame rate is wrong",
    },
    Refutation {
        codes: &["ball_size_mismatch"],
        witness: "the ball's size",
        reason: "its scale contradicts the ball's size (ball_size_mismatch), so its scale or the radius is wrong",
    },
];

struct Refutation {
    codes: &'static [&'static str],
    witness: &'static str,
    reason: &'static str,
}

impl Refutation {
    fn of(&self, recording: &VettedRecording<'_>) -> bool {
        recording
            .warnings
            .iter()
            .any(|code| self.codes.contains(&code.as_str()))
    }
}

/// What of a recording tells whether it can be trusted.
#[derive(Debug, Clone, Copy, Default)]
pub struct VettedRecording<'a> {
    /// Its name.
    pub name: &'a str,
    /// SHA-256 of the recording; `None` without a result.
    pub sha256: Option<&'a str>,
    /// Codes of its warnings.
    pub warnings: &'a [String],
    /// The build that measured it; `None` without a result.
    pub build: Option<&'a str>,
    /// Bounces that it has.
    pub bounces: usize,
}

/// What is said of a batch as a whole.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Vetting {
    /// For each recording why it is no part of the fit; `None` where it is.
    pub left_out: Vec<Option<LeftOut>>,
    /// What to know, at the top of the page.
    pub notes: Vec<Note>,
}

/// Why a recording is no part of the fit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum LeftOut {
    /// It is the same as the one of this name.
    Duplicate(String),
    /// Gravity or the ball's size contradicts it.
    Refuted(&'static str),
}

impl LeftOut {
    /// In a sentence, for the table.
    #[must_use]
    pub fn reason(&self) -> String {
        match self {
            Self::Duplicate(of) => {
                format!("the recording is the same as {of}, which counts once ({DUPLICATE})")
            }
            Self::Refuted(reason) => format!("{reason}; {KEPT_ON_REQUEST}"),
        }
    }
}

/// Looks through `recordings`, which are in the order of their names.
#[must_use]
pub fn vet(recordings: &[VettedRecording<'_>], refuted: RefutedRecordings) -> Vetting {
    let mut left_out: Vec<Option<LeftOut>> = recordings
        .iter()
        .map(|recording| match refuted {
            RefutedRecordings::Kept => None,
            RefutedRecordings::LeftOut => REFUTATIONS
                .iter()
                .find(|refutation| refutation.of(recording))
                .map(|refutation| LeftOut::Refuted(refutation.reason)),
        })
        .collect();
    // A copy with a calibration that is refuted does not stand for one with a calibration that is not.
    let mut first: HashMap<&str, &str> = HashMap::new();
    let mut copies = Vec::new();
    for (recording, left_out) in recordings.iter().zip(&mut left_out) {
        let Some(sha256) = recording
            .sha256
            .filter(|_| recording.bounces > 0 && left_out.is_none())
        else {
            continue;
        };
        match first.get(sha256) {
            Some(of) => {
                copies.push(format!("{} is {of}", recording.name));
                *left_out = Some(LeftOut::Duplicate((*of).to_owned()));
            }
            None => {
                first.insert(sha256, recording.name);
            }
        }
    }
    let mut notes: Vec<Note> = REFUTATIONS
        .iter()
        .filter_map(|refutation| contradiction(refutation, recordings, refuted))
        .collect();
    notes.extend(duplicates(&copies));
    notes.extend(several_builds(
        recordings.iter().filter_map(|r| Some((r.name, r.build?))),
    ));
    Vetting { left_out, notes }
}

/// The recordings that one witness refutes.
fn contradiction(
    refutation: &Refutation,
    recordings: &[VettedRecording<'_>],
    refuted: RefutedRecordings,
) -> Option<Note> {
    let names: Vec<&str> = recordings
        .iter()
        .filter(|recording| refutation.of(recording))
        .map(|recording| recording.name)
        .collect();
    let (verb, whose) = match names.len() {
        0 => return None,
        1 => ("recording contradicts", "Its page says"),
        _ => ("recordings contradict", "Their pages say"),
    };
    let fate = match refuted {
        RefutedRecordings::LeftOut => "left out of the fit; --keep-refuted keeps such recordings",
        RefutedRecordings::Kept => "in the fit all the same, as --keep-refuted asks",
    };
    Some(Note {
        code: refutation.codes[0],
        message: format!(
            "{} {verb} {}: {} ({fate}). {whose} which scale, rate or radius would mend it.",
            names.len(),
            refutation.witness,
            listed(&names)
        ),
    })
}

fn duplicates(copies: &[String]) -> Option<Note> {
    let what = match copies.len() {
        0 => return None,
        1 => "recording is a copy of another",
        _ => "recordings are copies of others",
    };
    Some(Note {
        code: DUPLICATE,
        message: format!(
            "{} {what} and left out of the fit: {}. Remove the copies, or record the launch again.",
            copies.len(),
            listed(copies)
        ),
    })
}

/// That results, each with its recording's name and its build, come from different builds.
#[must_use]
pub fn several_builds<'a>(results: impl Iterator<Item = (&'a str, &'a str)>) -> Option<Note> {
    let mut of_build: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for (name, build) in results {
        of_build.entry(build).or_default().push(name);
    }
    let parts: Vec<String> = of_build
        .iter()
        .map(|(build, names)| format!("track {build} measured {} ({})", names.len(), listed(names)))
        .collect();
    (parts.len() > 1).then(|| Note {
        code: SEVERAL_BUILDS,
        message: format!(
            "the results of this folder come from different builds: {}. What differs between them may be the program's work: \
             measure all with one build (--again).",
            parts.join("; ")
        ),
    })
}

/// The first few of them.
fn listed<S: AsRef<str>>(names: &[S]) -> String {
    const MOST: usize = 10;
    let mut some: Vec<&str> = names.iter().map(AsRef::as_ref).take(MOST).collect();
    if names.len() > MOST {
        some.push("...");
    }
    some.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recording<'a>(name: &'a str, sha256: &'a str, warnings: &'a [String]) -> VettedRecording<'a> {
        VettedRecording {
            name,
            sha256: Some(sha256),
            warnings,
            build: Some("0.2.0 (0123456789ab)"),
            bounces: 1,
        }
    }

    fn codes(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| (*name).to_owned()).collect()
    }

    #[test]
    fn identical_recordings_count_once_the_first_by_name() {
        let all = [
            recording("a", "1", &[]),
            recording("b", "2", &[]),
            recording("c", "1", &[]),
        ];
        let vetting = vet(&all, RefutedRecordings::LeftOut);
        let duplicate = Some(LeftOut::Duplicate("a".to_owned()));
        assert_eq!(vetting.left_out, [None, None, duplicate]);
        assert_eq!(vetting.notes[0].code, DUPLICATE);
        assert!(vetting.notes[0].message.contains("c is a"));
    }

    #[test]
    fn what_gravity_or_the_ball_refutes_is_left_out_unless_it_is_kept() {
        let (fall, size, other) = (
            codes(&["gravity_mismatch", "refuted_calibration"]),
            codes(&["ball_size_mismatch"]),
            codes(&["camera_moved"]),
        );
        let all = [
            recording("a", "1", &fall),
            recording("b", "2", &size),
            recording("c", "3", &other),
            recording("d", "4", &fall),
        ];
        let vetting = vet(&all, RefutedRecordings::LeftOut);
        let fate: Vec<bool> = vetting.left_out.iter().map(Option::is_some).collect();
        assert_eq!(fate, [true, true, false, true]);
        assert!(
            vetting.notes[0]
                .message
                .starts_with("2 recordings contradict g: a, d (left out")
        );
        assert!(
            vetting.notes[1]
                .message
                .starts_with("1 recording contradicts the ball's size: b")
        );
        let kept = vet(&all, RefutedRecordings::Kept);
        assert_eq!(kept.left_out, [None, None, None, None]);
        assert!(kept.notes[0].message.contains("a, d (in the fit all the same"));
    }

    #[test]
    fn a_copy_whose_calibration_is_refuted_does_not_stand_for_the_other() {
        let fall = codes(&["gravity_mismatch"]);
        let all = [recording("a", "1", &fall), recording("b", "1", &[])];
        let vetting = vet(&all, RefutedRecordings::LeftOut);
        assert!(matches!(vetting.left_out[0], Some(LeftOut::Refuted(_))));
        assert_eq!(vetting.left_out[1], None);
    }

    #[test]
    fn a_copy_without_bounces_is_no_duplicate() {
        let mut all = [recording("a", "1", &[]), recording("b", "1", &[])];
        all[0].bounces = 0;
        assert_eq!(
            vet(&all, RefutedRecordings::LeftOut),
            Vetting {
                left_out: vec![None, None],
                notes: Vec::new()
            }
        );
    }

    #[test]
    fn different_builds_are_said_with_what_each_measured() {
        let mut all = [recording("a", "1", &[]), recording("b", "2", &[])];
        all[1].build = Some("0.1.0 (ba9876543210)");
        let notes = vet(&all, RefutedRecordings::LeftOut).notes;
        assert_eq!((notes.len(), notes[0].code), (1, SEVERAL_BUILDS));
        assert!(
            notes[0]
                .message
                .contains("track 0.1.0 (ba9876543210) measured 1 (b)")
        );
    }
}
