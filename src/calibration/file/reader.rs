//! Reading JSON by hand, so that every problem names its key, and all of them are found in one go.

use crate::calibration::error::{CalibrationError, Problem};
use crate::geometry::PixelPoint;
use serde::de::{Deserialize, Deserializer, Error as _, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Number, Value};
use std::fmt;

/// Numbers a key accepts.
#[derive(Clone, Copy)]
pub(crate) struct Range {
    pub accepted: &'static str,
    pub holds: fn(f64) -> bool,
}

/// Wide enough for any laboratory, narrow enough that no product of a few such numbers overflows.
pub(crate) const POSITIVE: Range = Range {
    accepted: "a number above 0 (1e-15 to 1e15)",
    holds: |x| (1e-15..=1e15).contains(&x),
};
/// A coordinate or matrix element.
pub(crate) const FINITE: Range = Range {
    accepted: "a finite number (to 1e9)",
    holds: |x| x.abs() <= 1e9,
};

/// What a point of the picture looks like in the file.
pub(in crate::calibration) const PAIR: &str = "two numbers [u, v]";

/// The problems so far.
#[derive(Default)]
pub(in crate::calibration) struct Reader {
    pub problems: Vec<Problem>,
}

/// An object of the file and its dotted path.
pub(in crate::calibration) struct Section<'a> {
    path: String,
    keys: &'a Map<String, Value>,
}

impl<'a> Section<'a> {
    pub fn top(keys: &'a Map<String, Value>) -> Self {
        Self {
            path: String::new(),
            keys,
        }
    }

    /// The dotted path of a key in this section.
    pub fn key(&self, name: &str) -> String {
        if self.path.is_empty() {
            name.to_owned()
        } else {
            format!("{}.{name}", self.path)
        }
    }

    /// An object inside this section.
    pub fn inner(&self, name: &str, keys: &'a Map<String, Value>) -> Self {
        Self {
            path: self.key(name),
            keys,
        }
    }

    /// The value, where there is one that is not null: null means "not given".
    pub fn get(&self, name: &str) -> Option<&'a Value> {
        self.keys.get(name).filter(|v| !v.is_null())
    }

    pub fn is_explicit_null(&self, name: &str) -> bool {
        self.keys.get(name).is_some_and(Value::is_null)
    }

    pub fn names(&self) -> impl Iterator<Item = &'a str> {
        self.keys.keys().map(String::as_str)
    }
}

impl Reader {
    pub fn refuse(
        &mut self,
        key: String,
        found: impl Into<String>,
        accepted: impl Into<String>,
        hint: impl Into<String>,
    ) {
        self.problems.push(Problem::new(key, found, accepted, hint));
    }

    /// The object under `name`, its keys checked against `known`.
    pub fn section<'a>(&mut self, parent: &Section<'a>, name: &str, known: &[&str]) -> Option<Section<'a>> {
        let value = parent.get(name)?;
        let Value::Object(keys) = value else {
            self.refuse(
                parent.key(name),
                text(value),
                format!("an object with keys {}", known.join(", ")),
                format!("write {{\"{}\": ...}}", known[0]),
            );
            return None;
        };
        let section = Section {
            path: parent.key(name),
            keys,
        };
        self.check_keys(&section, known);
        Some(section)
    }

    /// Every key that is not in `known` is a problem that names the nearest one.
    pub fn check_keys(&mut self, section: &Section<'_>, known: &[&str]) {
        for name in section.names().filter(|name| !known.contains(name)) {
            let near = nearest(name, known).map(|near| section.key(near));
            let hint = match super::home_of(name).or(near) {
                Some(meant) => format!("did you mean {meant}?"),
                None => "remove it; a calibration has no such key".to_owned(),
            };
            let place = if section.path.is_empty() {
                "the file"
            } else {
                section.path.as_str()
            };
            self.refuse(
                section.key(&clipped(name)),
                "an unknown key",
                format!("in {place}: {}", known.join(", ")),
                hint,
            );
        }
    }

    pub fn number(&mut self, section: &Section<'_>, name: &str, range: Range, hint: &str) -> Option<f64> {
        let value = section.get(name)?;
        let number = value.as_f64().filter(|&x| (range.holds)(x));
        if number.is_none() {
            let hint = if value.is_string() {
                "write the number without quotes"
            } else {
                hint
            };
            self.refuse(section.key(name), text(value), range.accepted, hint);
        }
        number
    }

    pub fn required_number(
        &mut self,
        section: &Section<'_>,
        name: &str,
        range: Range,
        hint: &str,
    ) -> Option<f64> {
        if section.get(name).is_none() {
            self.refuse(section.key(name), "nothing", range.accepted, hint);
        }
        self.number(section, name, range, hint)
    }

    /// An array of exactly N numbers.
    pub fn numbers<const N: usize>(
        &mut self,
        section: &Section<'_>,
        name: &str,
        range: Range,
        form: &str,
        hint: &str,
    ) -> Option<[f64; N]> {
        let value = section.get(name)?;
        let numbers = array(value, |x| x.as_f64().filter(|&x| (range.holds)(x)));
        if numbers.is_none() {
            let accepted = format!("{form}, each {}", range.accepted);
            self.refuse(section.key(name), text(value), accepted, hint);
        }
        numbers
    }

    pub fn required_numbers<const N: usize>(
        &mut self,
        section: &Section<'_>,
        name: &str,
        range: Range,
        form: &str,
        hint: &str,
    ) -> Option<[f64; N]> {
        if section.get(name).is_none() {
            self.refuse(section.key(name), "nothing", form, hint);
        }
        self.numbers(section, name, range, form, hint)
    }

    /// Three rows of three numbers.
    pub fn required_matrix(
        &mut self,
        section: &Section<'_>,
        name: &str,
        form: &str,
        hint: &str,
    ) -> Option<nalgebra::Matrix3<f64>> {
        let value = section.get(name);
        // A homography's rows may differ by any factor, so that only overflow is excluded here.
        let element = |x: &Value| x.as_f64().filter(|x| x.is_finite() && x.abs() < 1e150);
        let rows = value.and_then(|v| array::<_, 3>(v, |row| array::<_, 3>(row, element)));
        if rows.is_none() {
            self.refuse(
                section.key(name),
                value.map_or("nothing".to_owned(), text),
                form,
                hint,
            );
        }
        rows.map(|rows| nalgebra::Matrix3::from_fn(|i, j| rows[i][j]))
    }

    /// A point of the picture.
    pub fn pixel(&mut self, section: &Section<'_>, name: &str) -> Option<PixelPoint> {
        let hint = "read the pixel off a picture: u right, v down";
        let [u, v] = self.numbers(section, name, FINITE, PAIR, hint)?;
        Some(PixelPoint::new(u, v))
    }

    /// A standard uncertainty: above 0 and below the value it belongs to.
    pub fn std_uncertainty(&mut self, section: &Section<'_>, name: &str, of: Option<f64>) -> Option<f64> {
        let hint = "leave it out, or write null, where it is not known; 0 would claim an exact number";
        let std = self.number(section, name, POSITIVE, hint)?;
        if of.is_none_or(|value| std < value) {
            return Some(std);
        }
        self.refuse(
            section.key(name),
            format!("{std}, not below the value it belongs to"),
            "a standard uncertainty (k = 1) in the unit of the value",
            "check the unit: it is not a percentage",
        );
        None
    }

    /// `true`; anything else is a problem.
    pub fn flag(&mut self, section: &Section<'_>, name: &str, hint: &str) -> Option<()> {
        match section.get(name) {
            Some(Value::Bool(true)) => Some(()),
            other => {
                self.refuse(
                    section.key(name),
                    other.map_or("nothing".to_owned(), text),
                    "true",
                    hint,
                );
                None
            }
        }
    }
}

/// The elements of a JSON array of exactly N, each as `element` reads it.
pub(super) fn array<T, const N: usize>(
    value: &Value,
    element: impl Fn(&Value) -> Option<T>,
) -> Option<[T; N]> {
    let elements: Vec<T> = value.as_array()?.iter().map(element).collect::<Option<_>>()?;
    elements.try_into().ok()
}

/// The known word nearest to `word`, where it is near enough to be a slip.
fn nearest<'a>(word: &str, known: &[&'a str]) -> Option<&'a str> {
    let word = word.to_lowercase();
    // A unit left out or a word too many ("radius", "fps_frame_rate_hz") is a slip as well.
    let likeness = |known: &str| {
        let part = word.len() > 2 && (known.starts_with(&word) || word.starts_with(known));
        strsim::jaro_winkler(&word, known).max(if part { 0.9 } else { 0.0 })
    };
    known
        .iter()
        .map(|&k| (likeness(k), k))
        .filter(|(likeness, _)| *likeness > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, k)| k)
}

/// A value as the file has it, cut where it is long.
pub(super) fn text(value: &Value) -> String {
    clipped(&value.to_string())
}

fn clipped(text: &str) -> String {
    const LONGEST: usize = 80;
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}

/// The JSON of `source`; what is not JSON, and objects that name a key twice, are refused.
pub(super) fn json(source: &str, name: &str) -> Result<Value, CalibrationError> {
    // Windows editors begin a file with a byte order mark.
    let source = source.strip_prefix('\u{feff}').unwrap_or(source);
    if source.trim().is_empty() {
        return Err(CalibrationError::NotJson {
            name: name.to_owned(),
            found: "an empty file".into(),
            hint: "write at least {\"schema\": \"track.calib/1\", \"scale\": {\"gravity\": true}}".into(),
        });
    }
    serde_json::from_str::<NoRepeats>(source)
        .map(|checked| checked.0)
        .map_err(|error| CalibrationError::NotJson {
            name: name.to_owned(),
            found: format!("not readable as JSON: {error}"),
            hint: hint_for(source, &error),
        })
}

/// What the offending line suggests.
fn hint_for(source: &str, error: &serde_json::Error) -> String {
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
    .to_owned()
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
