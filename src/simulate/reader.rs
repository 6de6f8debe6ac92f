//! Reading a scene's JSON by hand, so that every error names the key, what was found, what is accepted and what to
//! try; serde's own messages know none of that.

use super::scene::SceneError;
use crate::calibration;
use serde_json::{Map, Value};

/// An object of the scene with the keys it may have. Keys are checked when it is opened.
pub(super) struct Section<'a> {
    path: String,
    map: Option<&'a Map<String, Value>>,
}

/// What a number must be, in words for the error and as a test.
#[derive(Clone, Copy)]
pub(super) struct NumberRange {
    pub words: &'static str,
    pub test: fn(f64) -> bool,
    pub hint: &'static str,
}

// The ranges are those of the calibration, which is written beside the recording and has to be accepted.
pub(super) const POSITIVE: NumberRange = NumberRange {
    words: calibration::POSITIVE.accepted,
    test: calibration::POSITIVE.holds,
    hint: "give the size without a sign, in the unit the key ends in",
};
pub(super) const NOT_NEGATIVE: NumberRange = NumberRange {
    words: "0 or a positive number (to 1e15)",
    test: |x| (0.0..=1e15).contains(&x),
    hint: "give 0 to leave it out",
};
pub(super) const FACTOR: NumberRange = NumberRange {
    words: "a number from 0 to 10",
    test: |x| (0.0..=10.0).contains(&x),
    hint: "1 is the law as it stands",
};
pub(super) const ANY: NumberRange = NumberRange {
    words: calibration::FINITE.accepted,
    test: calibration::FINITE.holds,
    hint: "write it without quotes",
};
pub(super) const FRACTION: NumberRange = NumberRange {
    words: "a number from 0 to 1",
    test: |x| (0.0..=1.0).contains(&x),
    hint: "a coefficient of restitution or a share cannot exceed 1: no rebound gains energy",
};
pub(super) const GREY: NumberRange = NumberRange {
    words: "a grey level from 0 to 255",
    test: |x| (0.0..=255.0).contains(&x),
    hint: "0 is black, 255 white",
};

impl<'a> Section<'a> {
    /// The whole file.
    pub fn root(value: &'a Value, known: &[&str]) -> Result<Self, SceneError> {
        Self::open(String::new(), Some(value), known)
    }

    /// The object under `key`; all its keys take their defaults where it is absent.
    pub fn section(&self, key: &str, known: &[&str]) -> Result<Section<'a>, SceneError> {
        Self::open(self.name(key), self.get(key), known)
    }

    fn open(path: String, value: Option<&'a Value>, known: &[&str]) -> Result<Self, SceneError> {
        let map = match value {
            None => None,
            Some(Value::Object(map)) => Some(map),
            Some(other) => {
                return Err(SceneError::Invalid {
                    key: if path.is_empty() { "the scene".into() } else { path },
                    found: shown(other),
                    accepted: format!("an object with any of {}", known.join(", ")),
                    hint: "write {\"key\": value, ...}".into(),
                });
            }
        };
        let section = Self { path, map };
        if let Some(unknown) = map.and_then(|m| m.keys().find(|k| !known.contains(&k.as_str()))) {
            return Err(SceneError::UnknownKey {
                key: section.name(unknown),
                nearest: nearest(unknown, known),
                known: known.join(", "),
            });
        }
        Ok(section)
    }

    /// The dotted name of `key`.
    pub fn name(&self, key: &str) -> String {
        if self.path.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.path)
        }
    }

    /// The value under `key`; `null` counts as absent.
    pub fn get(&self, key: &str) -> Option<&'a Value> {
        self.map.and_then(|m| m.get(key)).filter(|v| !v.is_null())
    }

    /// A number, or `default` where the key is absent.
    pub fn number(&self, key: &str, default: f64, accept: NumberRange) -> Result<f64, SceneError> {
        Ok(self.optional_number(key, accept)?.unwrap_or(default))
    }

    /// A number that must be there.
    pub fn required_number(&self, key: &str, accept: NumberRange) -> Result<f64, SceneError> {
        self.optional_number(key, accept)?
            .ok_or_else(|| SceneError::Missing {
                key: self.name(key),
                accepted: accept.words.into(),
            })
    }

    /// A number, `None` where the key is absent or `null`.
    pub fn optional_number(&self, key: &str, accept: NumberRange) -> Result<Option<f64>, SceneError> {
        let Some(value) = self.get(key) else {
            return Ok(None);
        };
        match value.as_f64() {
            Some(x) if x.is_finite() && (accept.test)(x) => Ok(Some(x)),
            _ => Err(self.invalid(key, value, accept.words, accept.hint)),
        }
    }

    /// A whole number in `1..=most` (or from 0 with `from`).
    pub fn whole(&self, key: &str, default: u64, from: u64, most: u64) -> Result<u64, SceneError> {
        let Some(value) = self.get(key) else {
            return Ok(default);
        };
        match value.as_u64() {
            Some(n) if (from..=most).contains(&n) => Ok(n),
            _ => Err(self.invalid(
                key,
                value,
                &format!("a whole number from {from} to {most}"),
                "write it without a decimal point",
            )),
        }
    }

    /// `N` numbers, or `default`.
    pub fn numbers<const N: usize>(
        &self,
        key: &str,
        default: [f64; N],
        accept: NumberRange,
    ) -> Result<[f64; N], SceneError> {
        let Some(value) = self.get(key) else {
            return Ok(default);
        };
        let read = || -> Option<[f64; N]> {
            let list = value.as_array()?;
            let numbers: Vec<f64> = list.iter().filter_map(Value::as_f64).collect();
            let fine = list.len() == N && numbers.iter().all(|x| x.is_finite() && (accept.test)(*x));
            fine.then_some(numbers)?.try_into().ok()
        };
        read().ok_or_else(|| {
            self.invalid(
                key,
                value,
                &format!("a list of {N} numbers, each {}", accept.words),
                accept.hint,
            )
        })
    }

    /// One of `choices`, or the first of them.
    pub fn choice<T: Copy>(&self, key: &str, choices: &[(&str, T)]) -> Result<T, SceneError> {
        match self.get(key) {
            None => Ok(choices[0].1),
            Some(value) => value
                .as_str()
                .and_then(|word| choices.iter().find(|(name, _)| *name == word))
                .map(|(_, choice)| *choice)
                .ok_or_else(|| {
                    let words: Vec<&str> = choices.iter().map(|(name, _)| *name).collect();
                    let hint = value.as_str().and_then(|word| nearest(word, &words)).map_or_else(
                        || "take one of these words".to_owned(),
                        |n| format!("did you mean {n:?}?"),
                    );
                    self.invalid(key, value, &format!("one of {}", words.join(", ")), &hint)
                }),
        }
    }

    /// The error about `key`.
    pub fn invalid(&self, key: &str, found: &Value, accepted: &str, hint: &str) -> SceneError {
        SceneError::Invalid {
            key: self.name(key),
            found: shown(found),
            accepted: accepted.to_owned(),
            hint: hint.to_owned(),
        }
    }
}

/// A value as the message shows it, cut where it is long.
pub(super) fn shown(value: &Value) -> String {
    const LONGEST: usize = 60;
    let text = value.to_string();
    if text.chars().count() <= LONGEST {
        text
    } else {
        text.chars().take(LONGEST).chain("...".chars()).collect()
    }
}

/// The known key most like `key`, where one is near enough to have been meant.
pub(super) fn nearest(key: &str, known: &[&str]) -> Option<String> {
    const LIKE: f64 = 0.5;
    known
        .iter()
        .map(|k| (strsim::normalized_damerau_levenshtein(key, k), k))
        .filter(|(likeness, _)| *likeness >= LIKE)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, k)| (*k).to_owned())
}
