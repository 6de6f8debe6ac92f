//! An object of a JSON file, read key by key. A value that cannot be used is noted as a problem and read as if it were not
//! there, so that all problems of a file are found in one go.

use super::json;
use super::nearest::{Closeness, nearest};
use super::problem::{FileError, FileKind, FileProblem, clipped};
use crate::geometry::PixelPoint;
use serde_json::{Map, Value};
use std::cell::RefCell;

/// Numbers that a key accepts.
#[derive(Debug, Clone, Copy)]
pub struct NumberRange {
    /// In words.
    pub accepted: &'static str,
    /// As a test.
    pub holds: fn(f64) -> bool,
    /// What to try where it does not hold.
    pub hint: &'static str,
}

impl NumberRange {
    /// The same range with another hint.
    #[must_use]
    pub const fn or_try(self, hint: &'static str) -> Self {
        Self { hint, ..self }
    }
}

/// Wide enough for any laboratory, narrow enough that no product of a few such numbers overflows.
pub(crate) const POSITIVE: NumberRange = NumberRange {
    accepted: "a number above 0 (1e-15 to 1e15)",
    holds: |x| (1e-15..=1e15).contains(&x),
    hint: "give the size without a sign, in the unit the key ends in",
};
/// A coordinate or matrix element.
pub(crate) const FINITE: NumberRange = NumberRange {
    accepted: "a finite number (to 1e9)",
    holds: |x| x.abs() <= 1e9,
    hint: "write a plain number in the unit of the key's ending",
};

/// What a point of the picture looks like in a file.
pub(crate) const PAIR: &str = "two numbers [u, v]";

/// The problems of a file so far.
#[derive(Default)]
pub(crate) struct Problems(RefCell<Vec<FileProblem>>);

impl Problems {
    /// One more.
    pub fn add(&self, problem: FileProblem) {
        self.0.borrow_mut().push(problem);
    }

    /// Several more.
    pub fn extend(&self, problems: Vec<FileProblem>) {
        self.0.borrow_mut().extend(problems);
    }

    /// Whether there is one whose key begins so.
    pub fn any_of(&self, key: &str) -> bool {
        self.0.borrow().iter().any(|p| p.key.starts_with(key))
    }

    /// All of them.
    pub fn into_vec(self) -> Vec<FileProblem> {
        self.0.into_inner()
    }
}

/// A JSON file whose top is an object.
pub(crate) struct Document {
    keys: Map<String, Value>,
    /// What is wrong in it.
    pub problems: Problems,
    /// Where a key that stands in the wrong place belongs, by its name.
    home_of: fn(&str) -> Option<String>,
    what: &'static str,
}

impl Document {
    /// Of a file's bytes.
    pub fn from_bytes(
        bytes: &[u8],
        name: &str,
        kind: &'static FileKind,
        home_of: fn(&str) -> Option<String>,
    ) -> Result<Self, FileError> {
        match json::from_bytes(bytes, name, kind)? {
            Value::Object(keys) => Ok(Self {
                keys,
                problems: Problems::default(),
                home_of,
                what: kind.what,
            }),
            other => Err(FileError::WrongForm {
                name: name.to_owned(),
                kind,
                found: format!("{}, which is not an object", text(&other)),
                hint: "put the keys in braces".into(),
            }),
        }
    }

    /// The top of the file, its keys checked against `known`.
    pub fn top(&self, known: &[&str]) -> Section<'_> {
        let top = Section {
            path: String::new(),
            keys: Some(&self.keys),
            document: self,
        };
        top.check_keys(known);
        top
    }
}

/// An object of the file and its dotted path.
#[derive(Clone)]
pub(crate) struct Section<'a> {
    path: String,
    /// `None`: the file has no such object, and no key is given.
    keys: Option<&'a Map<String, Value>>,
    document: &'a Document,
}

impl<'a> Section<'a> {
    /// The dotted path of a key in this section.
    pub fn key(&self, name: &str) -> String {
        if self.path.is_empty() {
            name.to_owned()
        } else {
            format!("{}.{name}", self.path)
        }
    }

    /// The value, where there is one that is not null: null means "not given".
    pub fn get(&self, name: &str) -> Option<&'a Value> {
        self.keys?.get(name).filter(|v| !v.is_null())
    }

    /// Whether the file says null.
    pub fn is_explicit_null(&self, name: &str) -> bool {
        self.keys
            .and_then(|keys| keys.get(name))
            .is_some_and(Value::is_null)
    }

    /// All keys of the object.
    pub fn names(&self) -> impl Iterator<Item = &'a str> + use<'a> {
        self.keys.into_iter().flat_map(Map::keys).map(String::as_str)
    }

    /// The problems of the file.
    pub fn problems(&self) -> &'a Problems {
        &self.document.problems
    }

    /// Notes a problem; `key` is the whole dotted path.
    pub fn refuse(
        &self,
        key: impl Into<String>,
        found: impl Into<String>,
        accepted: impl Into<String>,
        hint: impl Into<String>,
    ) {
        self.problems().add(FileProblem::new(key, found, accepted, hint));
    }

    /// Notes a problem with what stands under `name`.
    pub fn refuse_value(&self, name: &str, accepted: impl Into<String>, hint: impl Into<String>) {
        let found = self.get(name).map_or("nothing".to_owned(), text);
        self.refuse(self.key(name), found, accepted, hint);
    }

    /// The object under `name`, its keys checked against `known`; `None` where there is none.
    pub fn section(&self, name: &str, known: &[&str]) -> Option<Self> {
        let value = self.get(name)?;
        let Value::Object(keys) = value else {
            self.refuse_value(
                name,
                format!("an object with keys {}", known.join(", ")),
                format!("write {{\"{}\": ...}}", known[0]),
            );
            return None;
        };
        let section = self.inner(self.key(name), keys);
        section.check_keys(known);
        Some(section)
    }

    /// As [`section`](Self::section), one without keys where there is none: then everything takes its default.
    pub fn section_or_empty(&self, name: &str, known: &[&str]) -> Self {
        self.section(name, known).unwrap_or_else(|| Self {
            path: self.key(name),
            keys: None,
            document: self.document,
        })
    }

    /// An object somewhere inside, its keys not checked.
    pub fn inner(&self, path: impl Into<String>, keys: &'a Map<String, Value>) -> Self {
        Self {
            path: path.into(),
            keys: Some(keys),
            document: self.document,
        }
    }

    /// Every key that is not in `known` is a problem that names the nearest one.
    pub fn check_keys(&self, known: &[&str]) {
        for name in self.names().filter(|name| !known.contains(name)) {
            let near = nearest(name, known.iter().copied(), Closeness::Guess).map(|near| self.key(near));
            let hint = match (self.document.home_of)(name).or(near) {
                Some(meant) => format!("did you mean {meant}?"),
                None => format!("remove it; a {} has no such key", self.document.what),
            };
            let place = if self.path.is_empty() {
                "the file"
            } else {
                self.path.as_str()
            };
            self.refuse(
                self.key(&clipped(name)),
                "an unknown key",
                format!("in {place}: {}", known.join(", ")),
                hint,
            );
        }
    }

    /// A number; `None` where there is none.
    pub fn number(&self, name: &str, range: NumberRange) -> Option<f64> {
        let value = self.get(name)?;
        let number = value.as_f64().filter(|&x| (range.holds)(x));
        if number.is_none() {
            let hint = if value.is_string() {
                "write the number without quotes"
            } else {
                range.hint
            };
            self.refuse_value(name, range.accepted, hint);
        }
        number
    }

    /// A number that must be there.
    pub fn required_number(&self, name: &str, range: NumberRange) -> Option<f64> {
        if self.get(name).is_none() {
            self.refuse_value(name, range.accepted, range.hint);
        }
        self.number(name, range)
    }

    /// A whole number.
    pub fn whole(&self, name: &str, range: std::ops::RangeInclusive<u64>) -> Option<u64> {
        let number = self.get(name)?.as_u64().filter(|n| range.contains(n));
        if number.is_none() {
            self.refuse_value(
                name,
                format!("a whole number from {} to {}", range.start(), range.end()),
                "write it without a decimal point",
            );
        }
        number
    }

    /// An array of exactly N numbers, in words `form`.
    pub fn numbers<const N: usize>(&self, name: &str, range: NumberRange, form: &str) -> Option<[f64; N]> {
        let value = self.get(name)?;
        let numbers = array(value, |x| x.as_f64().filter(|&x| (range.holds)(x)));
        if numbers.is_none() {
            self.refuse_value(name, format!("{form}, each {}", range.accepted), range.hint);
        }
        numbers
    }

    /// An array of exactly N numbers that must be there.
    pub fn required_numbers<const N: usize>(
        &self,
        name: &str,
        range: NumberRange,
        form: &str,
    ) -> Option<[f64; N]> {
        if self.get(name).is_none() {
            self.refuse_value(name, form, range.hint);
        }
        self.numbers(name, range, form)
    }

    /// Three rows of three numbers.
    pub fn required_matrix(&self, name: &str, form: &str, hint: &str) -> Option<nalgebra::Matrix3<f64>> {
        // A homography's rows may differ by any factor, so that only overflow is excluded here.
        let element = |x: &Value| x.as_f64().filter(|x| x.is_finite() && x.abs() < 1e150);
        let value = self.get(name);
        let rows = value.and_then(|v| array::<_, 3>(v, |row| array::<_, 3>(row, element)));
        if rows.is_none() {
            self.refuse_value(name, form, hint);
        }
        rows.map(|rows| nalgebra::Matrix3::from_fn(|i, j| rows[i][j]))
    }

    /// A point of the picture.
    pub fn pixel(&self, name: &str) -> Option<PixelPoint> {
        let range = FINITE.or_try("read the pixel off a picture: u right, v down");
        let [u, v] = self.numbers(name, range, PAIR)?;
        Some(PixelPoint::new(u, v))
    }

    /// A standard uncertainty: above 0 and below the value it belongs to.
    pub fn std_uncertainty(&self, name: &str, of: Option<f64>) -> Option<f64> {
        let hint = "leave it out, or write null, where it is not known; 0 would claim an exact number";
        let std = self.number(name, POSITIVE.or_try(hint))?;
        if of.is_none_or(|value| std < value) {
            return Some(std);
        }
        self.refuse(
            self.key(name),
            format!("{std}, not below the value it belongs to"),
            "a standard uncertainty (k = 1) in the unit of the value",
            "check the unit: it is not a percentage",
        );
        None
    }

    /// `true`; anything else is a problem.
    pub fn flag(&self, name: &str, hint: &str) -> Option<()> {
        if self.get(name) == Some(&Value::Bool(true)) {
            return Some(());
        }
        self.refuse_value(name, "true", hint);
        None
    }

    /// One of the words of `choices`.
    pub fn choice<T: Copy>(&self, name: &str, choices: &[(&str, T)], hint: &str) -> Option<T> {
        let word = self.get(name)?.as_str().unwrap_or_default();
        let chosen = choices.iter().find(|(choice, _)| *choice == word);
        if chosen.is_none() {
            let words = || choices.iter().map(|(word, _)| *word);
            let quoted: Vec<String> = words().map(|word| format!("{word:?}")).collect();
            let hint = nearest(word, words(), Closeness::Guess)
                .map_or_else(|| hint.to_owned(), |meant| format!("did you mean {meant:?}?"));
            self.refuse_value(name, quoted.join(" or "), hint);
        }
        chosen.map(|(_, choice)| *choice)
    }
}

/// The elements of a JSON array of exactly N, each as `element` reads it.
pub(crate) fn array<T, const N: usize>(
    value: &Value,
    element: impl Fn(&Value) -> Option<T>,
) -> Option<[T; N]> {
    let elements: Vec<T> = value.as_array()?.iter().map(element).collect::<Option<_>>()?;
    elements.try_into().ok()
}

/// A value as the file has it, cut where it is long.
pub(crate) fn text(value: &Value) -> String {
    clipped(&value.to_string())
}
