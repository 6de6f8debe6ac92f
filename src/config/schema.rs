//! Types of values for the JSON Schemas of the files that a person writes.
//!
//! Those files are read key by key, so that every problem can be told ([`super`]); the types of their keys serve their
//! schemas only. `tests/schemas.rs` holds the two against each other.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use std::borrow::Cow;

/// A number above 0.
#[derive(Debug, Clone, Copy)]
pub struct Positive(pub f64);

impl JsonSchema for Positive {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Positive".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({"type": "number", "exclusiveMinimum": 0})
    }
}

/// `true`, and nothing else.
#[derive(Debug, Clone, Copy)]
pub struct True;

impl JsonSchema for True {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "True".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({"type": "boolean", "const": true})
    }
}
