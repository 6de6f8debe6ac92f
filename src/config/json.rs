//! From the text of a file to JSON, with words for what a person may have got wrong.

use super::problem::{FileError, FileKind, clipped};
use serde::de::{Deserialize, Deserializer, Error as _, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Number, Value};
use std::fmt;

/// The JSON of a file's bytes.
pub(super) fn from_bytes(bytes: &[u8], name: &str, kind: &'static FileKind) -> Result<Value, FileError> {
    let text = std::str::from_utf8(bytes).map_err(|error| FileError::WrongForm {
        name: name.to_owned(),
        kind,
        found: format!("bytes that are not UTF-8 text, from byte {}", error.valid_up_to()),
        hint: if bytes.starts_with(&[0xFF, 0xFE]) || bytes.starts_with(&[0xFE, 0xFF]) {
            "the file is UTF-16: save it as UTF-8".into()
        } else {
            format!(
                "name the {}, not a video or picture, or save it as UTF-8",
                kind.what
            )
        },
    })?;
    from_text(text, name, kind)
}

/// The JSON of `source`; what is not JSON, and objects that name a key twice, are refused.
pub(super) fn from_text(source: &str, name: &str, kind: &'static FileKind) -> Result<Value, FileError> {
    // Windows editors begin a file with a byte order mark.
    let source = source.strip_prefix('\u{feff}').unwrap_or(source);
    let wrong = |found: String, hint: String| FileError::WrongForm {
        name: name.to_owned(),
        kind,
        found,
        hint,
    };
    if source.trim().is_empty() {
        return Err(wrong(
            "an empty file".into(),
            format!("write at least {}", kind.least),
        ));
    }
    serde_json::from_str::<NoRepeats>(source)
        .map(|checked| checked.0)
        .map_err(|error| {
            wrong(
                format!("not readable as JSON: {error}"),
                hint_for(source, &error).into(),
            )
        })
}

/// What the offending line suggests.
fn hint_for(source: &str, error: &serde_json::Error) -> &'static str {
    let line = source
        .lines()
        .nth(error.line().saturating_sub(1))
        .unwrap_or_default();
    let has = |word: &str| line.contains(word);
    if has("NaN") || has("nan") || has("Infinity") || has("inf") {
        "JSON has neither NaN nor Infinity: leave the key out, or write null, where the value is not known"
    } else if error.to_string().contains("out of range") {
        "the number is too large for a double: check its exponent"
    } else if has("//") || has("#") || has("/*") {
        "JSON has no comments: remove them"
    } else if error.to_string().contains("trailing comma") {
        "remove the comma after the last entry"
    } else if error.to_string().contains("twice") {
        "keep one of the two"
    } else {
        "look at that line and the one before for a missing quote, comma or bracket"
    }
}

/// A JSON value none of whose objects has a key twice (serde_json would keep the last without a word).
struct NoRepeats(Value);

impl<'de> Deserialize<'de> for NoRepeats {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NoRepeatsVisitor).map(Self)
    }
}

struct NoRepeatsVisitor;

impl<'de> Visitor<'de> for NoRepeatsVisitor {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON value")
    }

    fn visit_bool<E>(self, b: bool) -> Result<Value, E> {
        Ok(Value::Bool(b))
    }

    fn visit_i64<E>(self, n: i64) -> Result<Value, E> {
        Ok(n.into())
    }

    fn visit_u64<E>(self, n: u64) -> Result<Value, E> {
        Ok(n.into())
    }

    fn visit_f64<E>(self, n: f64) -> Result<Value, E> {
        Ok(Number::from_f64(n).map_or(Value::Null, Value::Number))
    }

    fn visit_str<E>(self, s: &str) -> Result<Value, E> {
        Ok(s.into())
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut elements: A) -> Result<Value, A::Error> {
        let mut array = Vec::new();
        while let Some(NoRepeats(element)) = elements.next_element()? {
            array.push(element);
        }
        Ok(Value::Array(array))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Value, A::Error> {
        let mut object = Map::new();
        while let Some(key) = entries.next_key::<String>()? {
            if object.contains_key(&key) {
                return Err(A::Error::custom(format!(
                    "the key \"{}\" stands twice",
                    clipped(&key)
                )));
            }
            let NoRepeats(value) = entries.next_value()?;
            object.insert(key, value);
        }
        Ok(Value::Object(object))
    }
}
