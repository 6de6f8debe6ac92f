//! `NAME.edits.json`: what a person says of a recording (schema `track.edits/1`), as the page of `track review` saves it or as it is
//! written by hand.
//!
//! Every key is optional. Places are pixels of the named frame's own picture, times those of the result that the person looked at.

use crate::config::{
    Document, FINITE, FileError, FileKind, NumberRange, PAIR, POSITIVE, Section, read_bytes, text,
};
use crate::frames::digest;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// The schema of a file of edits.
pub const SCHEMA: &str = "track.edits/1";

/// What a person says of a recording.
#[derive(Debug, Clone, Default, PartialEq, Serialize, JsonSchema)]
pub struct Edits {
    /// SHA-256 of the recording that was looked at, as its result has it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub video_sha256: Option<String>,
    /// What lies before and after these times is not looked at, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_range_s: Option<[f64; 2]>,
    /// What has its centre outside of this part of the picture is not looked at: left, top, right, bottom, px.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region_px: Option<[f64; 4]>,
    /// Which of several things is the ball.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ball: Option<ChosenBall>,
    /// Frames whose centres are not used.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub exclude_frames: Vec<usize>,
    /// Centres that the person gives, in place of what was found in their frames.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub points: Vec<EditedPoint>,
    /// What was taken for an impact at about these times is none, s.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub not_impacts_s: Vec<f64>,
}

/// A thing in one frame that is the ball.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct ChosenBall {
    /// The frame in presentation order, from 0.
    pub frame: usize,
    /// A point on the ball there.
    pub centre_px: [f64; 2],
    /// The ball's radius; without it that of the thing nearest to the point.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius_px: Option<f64>,
}

/// The ball's centre in one frame, as a person has it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct EditedPoint {
    /// The frame in presentation order, from 0.
    pub frame: usize,
    /// Column.
    pub u_px: f64,
    /// Row.
    pub v_px: f64,
    /// Standard uncertainty of each coordinate; 0.5 without it ([`EDITED_POINT_STD_PX`]).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub std_px: Option<f64>,
}

/// Standard uncertainty of each coordinate of a centre that a person sets with the mouse and says no more of, px: a ball's rim is a
/// pixel or two wide, and the eye halves it.
pub const EDITED_POINT_STD_PX: f64 = 0.5;

const KIND: FileKind = FileKind {
    what: "file of edits",
    form: "one JSON object as the page of track review saves it",
    source: "make the page with track review, and save there",
    least: r#"{"schema": "track.edits/1"}"#,
};

const KEYS: [&str; 8] = [
    "schema",
    "video_sha256",
    "time_range_s",
    "region_px",
    "ball",
    "exclude_frames",
    "points",
    "not_impacts_s",
];

/// No file of edits comes near, bytes.
const MOST_BYTES: u64 = 16 << 20;

/// No recording has more frames.
const MOST_FRAMES: u64 = 1 << 32;

/// Why edits could not be used.
#[derive(Debug, thiserror::Error)]
pub enum EditsError {
    /// The file.
    #[error(transparent)]
    File(#[from] FileError),
    /// They are of another recording.
    #[error(
        "{}: these edits were made for another recording (SHA-256 {}..., that of {} is {}...); give the recording they were made for, or, \
         if they are meant for this one all the same, remove video_sha256 from the file",
        edits.display(), clip(told), video.display(), clip(found)
    )]
    AnotherRecording {
        /// The file of edits.
        edits: PathBuf,
        /// The recording.
        video: PathBuf,
        /// What the edits say.
        told: String,
        /// What the recording has.
        found: String,
    },
    /// The recording could not be read through.
    #[error("{}: cannot be read through to compare it with the edits", video.display())]
    Recording {
        /// The recording.
        video: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
}

fn clip(digest: &str) -> &str {
    digest.get(..12).unwrap_or(digest)
}

impl Edits {
    /// The edits in the file at `path`, made for `video`.
    ///
    /// # Errors
    /// See [`EditsError`].
    pub fn read(path: &Path, video: &Path) -> Result<Self, EditsError> {
        let bytes = read_bytes(path, &KIND, MOST_BYTES)?;
        let edits = Self::from_bytes(&bytes, &path.display().to_string())?;
        if let Some(told) = &edits.video_sha256 {
            let found = digest::of_recording(video).map_err(|source| EditsError::Recording {
                video: video.to_owned(),
                source,
            })?;
            if !found.eq_ignore_ascii_case(told) {
                return Err(EditsError::AnotherRecording {
                    edits: path.to_owned(),
                    video: video.to_owned(),
                    told: told.clone(),
                    found,
                });
            }
        }
        Ok(edits)
    }

    /// The edits in a file's bytes; `name` stands for the file in messages.
    ///
    /// # Errors
    /// [`FileError`] with every value that cannot be used.
    pub fn from_bytes(bytes: &[u8], name: &str) -> Result<Self, FileError> {
        let document = Document::from_bytes(bytes, name, &KIND, |_| None)?;
        let top = document.top(&KEYS);
        if top.get("schema").and_then(Value::as_str) != Some(SCHEMA) {
            top.refuse_value(
                "schema",
                format!("{SCHEMA:?}"),
                "save the edits again with track review",
            );
        }
        let edits = Self {
            video_sha256: digest_of(&top),
            time_range_s: range(&top),
            region_px: region(&top),
            ball: ball(&top),
            exclude_frames: list(
                &top,
                "exclude_frames",
                "frames from 0, such as [55, 56]",
                frame_number,
            ),
            points: points(&top),
            not_impacts_s: list(&top, "not_impacts_s", "times in s, such as [0.83]", Value::as_f64),
        };
        let problems = document.problems.into_vec();
        if problems.is_empty() {
            Ok(edits)
        } else {
            Err(FileError::Invalid {
                name: name.to_owned(),
                problems,
            })
        }
    }

    /// Whether nothing is said.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        *self
            == Self {
                video_sha256: self.video_sha256.clone(),
                ..Self::default()
            }
    }

    /// The highest frame that is named.
    #[must_use]
    pub fn last_frame(&self) -> Option<usize> {
        let named = self.exclude_frames.iter().copied();
        let given = self.points.iter().map(|p| p.frame);
        named.chain(given).chain(self.ball.map(|b| b.frame)).max()
    }

    /// What was said, in words: "3 frames excluded, 1 centre given".
    #[must_use]
    pub fn words(&self) -> String {
        let counted = |n: usize, one: &str, more: &str| match n {
            0 => None,
            1 => Some(format!("1 {one}")),
            n => Some(format!("{n} {more}")),
        };
        let said = [
            self.ball.map(|b| format!("the ball chosen in frame {}", b.frame)),
            self.time_range_s
                .map(|[from, to]| format!("only {from} s to {to} s looked at")),
            self.region_px
                .map(|_| "only a part of the picture looked at".to_owned()),
            counted(self.exclude_frames.len(), "frame excluded", "frames excluded"),
            counted(self.points.len(), "centre given", "centres given"),
            counted(self.not_impacts_s.len(), "impact denied", "impacts denied"),
        ];
        let said: Vec<String> = said.into_iter().flatten().collect();
        if said.is_empty() {
            "nothing".to_owned()
        } else {
            said.join(", ")
        }
    }
}

/// `NAME.edits.json` beside a recording.
#[must_use]
pub fn beside(video: &Path) -> PathBuf {
    let name = if video.is_dir() {
        video.file_name()
    } else {
        video.file_stem()
    };
    let name = name.unwrap_or_default().to_string_lossy();
    video.with_file_name(format!("{name}.edits.json"))
}

fn frame_number(value: &Value) -> Option<usize> {
    let number = value.as_u64().filter(|n| *n < MOST_FRAMES)?;
    usize::try_from(number).ok()
}

fn digest_of(top: &Section<'_>) -> Option<String> {
    let value = top.get("video_sha256")?;
    let is_digest = |s: &&str| s.len() == 64 && s.bytes().all(|b| b.is_ascii_hexdigit());
    let digest = value.as_str().filter(is_digest);
    if digest.is_none() {
        top.refuse_value(
            "video_sha256",
            "64 hexadecimal digits",
            "take it from the result (video.sha256), or remove it",
        );
    }
    digest.map(str::to_owned)
}

fn range(top: &Section<'_>) -> Option<[f64; 2]> {
    let hint = "give the time that it begins and the time that it ends, in s";
    let range = top.numbers::<2>("time_range_s", FINITE.or_try(hint), "two times [from, to]")?;
    if range[0] < range[1] {
        return Some(range);
    }
    top.refuse_value(
        "time_range_s",
        "two times [from, to], the first before the second",
        hint,
    );
    None
}

fn region(top: &Section<'_>) -> Option<[f64; 4]> {
    let hint = "read the two corners off a picture: u right, v down";
    let form = "four numbers [left, top, right, bottom]";
    let region = top.numbers::<4>("region_px", FINITE.or_try(hint), form)?;
    if region[0] < region[2] && region[1] < region[3] {
        return Some(region);
    }
    top.refuse_value(
        "region_px",
        format!("{form}, left before right and top before bottom"),
        hint,
    );
    None
}

fn ball(top: &Section<'_>) -> Option<ChosenBall> {
    let ball = top.section("ball", &["frame", "centre_px", "radius_px"])?;
    let range = FINITE.or_try("read the pixel off a picture: u right, v down");
    let frame = required_frame(&ball);
    let centre_px = ball.required_numbers::<2>("centre_px", range, PAIR);
    let radius_px = ball.number("radius_px", POSITIVE);
    Some(ChosenBall {
        frame: frame?,
        centre_px: centre_px?,
        radius_px,
    })
}

/// Of a pixel coordinate.
const COORDINATE: NumberRange = FINITE.or_try("read the pixel off a picture: u right, v down");

fn points(top: &Section<'_>) -> Vec<EditedPoint> {
    const FORM: &str = r#"a list of {"frame": N, "u_px": U, "v_px": V}"#;
    let Some(value) = top.get("points") else {
        return Vec::new();
    };
    let Value::Array(items) = value else {
        top.refuse_value("points", FORM, "put them in brackets");
        return Vec::new();
    };
    let mut points: Vec<EditedPoint> = Vec::new();
    for (i, item) in items.iter().enumerate() {
        let path = format!("points[{i}]");
        let Value::Object(keys) = item else {
            top.refuse(path, text(item), FORM, "put it in braces");
            continue;
        };
        let section = top.inner(path.clone(), keys);
        section.check_keys(&["frame", "u_px", "v_px", "std_px"]);
        let frame = required_frame(&section);
        let u_px = section.required_number("u_px", COORDINATE);
        let v_px = section.required_number("v_px", COORDINATE);
        let std_px = section.number("std_px", POSITIVE);
        let (Some(frame), Some(u_px), Some(v_px)) = (frame, u_px, v_px) else {
            continue;
        };
        if points.iter().any(|p| p.frame == frame) {
            top.refuse(
                path,
                format!("frame {frame} once more"),
                "one centre a frame",
                "keep one of the two",
            );
            continue;
        }
        points.push(EditedPoint {
            frame,
            u_px,
            v_px,
            std_px,
        });
    }
    points.sort_by_key(|p| p.frame);
    points
}

fn required_frame(section: &Section<'_>) -> Option<usize> {
    let frame = section.get("frame").and_then(frame_number);
    if frame.is_none() {
        section.refuse_value(
            "frame",
            "a frame's number, from 0",
            "take it from the page or from points.csv",
        );
    }
    frame
}

/// The elements of a list, each as `element` reads it.
fn list<T>(top: &Section<'_>, name: &str, form: &str, element: impl Fn(&Value) -> Option<T>) -> Vec<T> {
    let Some(value) = top.get(name) else {
        return Vec::new();
    };
    let elements = value
        .as_array()
        .and_then(|list| list.iter().map(element).collect());
    elements.unwrap_or_else(|| {
        top.refuse_value(
            name,
            format!("a list of {form}"),
            "put them in brackets, without quotes",
        );
        Vec::new()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_keys_are_read_and_written_as_the_contract_has_them() {
        let text = r#"{"schema": "track.edits/1", "time_range_s": [0.2, 1.4], "region_px": [1, 2, 300, 400],
            "ball": {"frame": 31, "centre_px": [412.0, 207.5], "radius_px": 14.0}, "exclude_frames": [55, 56],
            "points": [{"frame": 57, "u_px": 1, "v_px": 2, "std_px": 0.3}], "not_impacts_s": [0.83]}"#;
        let edits = Edits::from_bytes(text.as_bytes(), "x").unwrap();
        assert_eq!(edits.last_frame(), Some(57));
        let mut again = serde_json::to_value(&edits).unwrap();
        again["schema"] = SCHEMA.into();
        assert_eq!(
            Edits::from_bytes(again.to_string().as_bytes(), "x").unwrap(),
            edits
        );
        assert_eq!(
            edits.words(),
            "the ball chosen in frame 31, only 0.2 s to 1.4 s looked at, only a part of the picture looked at, 2 frames excluded, \
             1 centre given, 1 impact denied"
        );
        assert!(!edits.is_empty());
        assert!(
            Edits::from_bytes(br#"{"schema": "track.edits/1"}"#, "x")
                .unwrap()
                .is_empty()
        );
    }

    #[test]
    fn every_wrong_value_is_told_with_its_place() {
        let text = r#"{"schema": "track.edits/1", "time_range_s": [2, 1], "region_px": [1, 2, 0, 4], "ball": {"frame": -1},
            "exclude_frame": [1], "exclude_frames": ["a"], "points": [{"frame": 1, "u_px": 2}, 5], "video_sha256": "abc"}"#;
        let error = Edits::from_bytes(text.as_bytes(), "x").unwrap_err();
        let keys: Vec<&str> = error.problems().iter().map(|p| p.key.as_str()).collect();
        for key in [
            "exclude_frame",
            "video_sha256",
            "time_range_s",
            "region_px",
            "ball.frame",
            "ball.centre_px",
            "exclude_frames",
            "points[0].v_px",
            "points[1]",
        ] {
            assert!(keys.contains(&key), "{key} in {keys:?}");
        }
    }
}
