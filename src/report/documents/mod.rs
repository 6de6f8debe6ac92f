//! The JSON documents that the program writes, as types, a file each: the keys in their order, their units, what may be
//! `null`.
//!
//! Angles are degrees here and radians everywhere else. What is unknown is `null`; a number that is not finite becomes
//! `null` too, as JSON has no word for it.

pub mod board;
pub mod cost;
pub mod fit;
pub mod result;

use crate::quantity::Quantity;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::ser::{Serialize, Serializer};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// What the program says of a measurement beside its numbers.
#[derive(Debug, serde::Serialize, JsonSchema)]
pub struct WarningDocument<'a> {
    /// The kind of warning, for programs.
    pub code: &'a str,
    /// The warning, for people.
    pub message: &'a str,
}

/// A JSON object whose keys are data (names of parameters, of settings), in an order of its own.
#[derive(Debug)]
pub struct OrderedObject<K, V>(pub Vec<(K, V)>);

impl<K: Serialize, V: Serialize> Serialize for OrderedObject<K, V> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(key, value)| (key, value)))
    }
}

impl<K, V: JsonSchema> JsonSchema for OrderedObject<K, V> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        format!("ObjectOf{}", V::schema_name()).into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        BTreeMap::<String, V>::json_schema(generator)
    }
}

impl<K, V> FromIterator<(K, V)> for OrderedObject<K, V> {
    fn from_iter<I: IntoIterator<Item = (K, V)>>(entries: I) -> Self {
        Self(entries.into_iter().collect())
    }
}

/// A quantity as a file may hold it. Both numbers are checked again, as the fields of [`Quantity`] are public: files
/// contain neither NaN nor an uncertainty of 0.
fn quantity(quantity: Option<Quantity>) -> Option<Quantity> {
    quantity.filter(|q| q.value.is_finite()).map(|q| Quantity {
        std_uncertainty: q.std_uncertainty.filter(|std| std.is_finite() && *std > 0.0),
        ..q
    })
}

/// An angle in radians as a quantity in degrees.
fn degrees(radians: Option<Quantity>) -> Option<Quantity> {
    quantity(radians.map(|angle| angle.scaled(1_f64.to_degrees())))
}

/// A document as it stands in a file: indented, with a newline at its end.
///
/// # Errors
/// Whatever `serde_json` refuses; of the documents here it refuses nothing.
pub fn json_text(document: &impl Serialize) -> Result<Vec<u8>, serde_json::Error> {
    let mut text = serde_json::to_vec_pretty(document)?;
    text.push(b'\n');
    Ok(text)
}

/// A calibration as it stands in a file: as [`json_text`], but rows of numbers on one line each, as people write them.
///
/// # Errors
/// As [`json_text`].
pub fn calib_text(value: &serde_json::Value) -> Result<String, serde_json::Error> {
    let pretty = serde_json::to_string_pretty(value)?;
    let mut text = String::with_capacity(pretty.len());
    let mut rest = pretty.as_str();
    while let Some(open) = rest.find('[') {
        let (before, from) = rest.split_at(open);
        text.push_str(before);
        // Strings hold no brackets in this file; a row ends before anything that is not a number.
        match from[1..].find(|c: char| "[]{}\"".contains(c)) {
            Some(end) if from.as_bytes()[end + 1] == b']' => {
                let numbers: Vec<&str> = from[1..=end].split(',').map(str::trim).collect();
                text.push('[');
                text.push_str(&numbers.join(", "));
                text.push(']');
                rest = &from[end + 2..];
            }
            _ => {
                text.push('[');
                rest = &from[1..];
            }
        }
    }
    text.push_str(rest);
    text.push('\n');
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_calibration_has_its_rows_of_numbers_on_one_line_each() {
        let value = serde_json::json!({
            "size": [1280, 720], "matrix": [[1.5, 0.0], [0.0, -2e-7]], "empty": [], "list": [{"a": [1]}], "text": "x, y",
            "unknown": [null, 1.0]
        });
        let text = calib_text(&value).unwrap();
        assert!(text.contains("\"size\": [1280, 720],\n"), "{text}");
        assert!(text.contains("[1.5, 0.0],\n    [0.0, -2e-7]\n"), "{text}");
        assert!(
            text.contains("[null, 1.0]") && text.contains("\"a\": [1]"),
            "{text}"
        );
        assert_eq!(serde_json::from_str::<serde_json::Value>(&text).unwrap(), value);
    }
}
