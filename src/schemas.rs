//! JSON Schemas of the files that the program reads and writes, generated from their types.
//!
//! They stand in `docs/schemas/`; `tests/schemas.rs` checks that they are those of the types, `make schemas` writes them.

use crate::batch::manifest::ManifestColumns;
use crate::calibration::ruler::{MARKS_SCHEMA, MarksFile};
use crate::calibration::{self, CalibrationKeys};
use crate::edits::{self, Edits};
use crate::rebound::fit::csv::SeriesColumns;
use crate::report::documents::board::{self, BoardDocument};
use crate::report::documents::cost::{self, CostDocument};
use crate::report::documents::fit::{self, FitDocument};
use crate::report::documents::result::{self, ResultDocument};
use crate::simulate::SceneKeys;
use crate::simulate::scene;
use crate::simulate::truth::{self, Truth};
use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde_json::{Value, json};

/// The schema of a kind of file.
#[derive(Debug, Clone, PartialEq)]
pub struct FileSchema {
    /// The value of the file's key `schema`, such as `track.truth/1`.
    pub id: &'static str,
    /// The JSON Schema (draft 2020-12).
    pub schema: Value,
}

impl FileSchema {
    /// The name of its file in `docs/schemas/`: `truth.schema.json` for `track.truth/1`.
    #[must_use]
    pub fn file_name(&self) -> String {
        let kind = self.id.trim_start_matches("track.");
        format!("{}.schema.json", kind.split('/').next().unwrap_or(kind))
    }
}

/// Those of all files. A new kind of file is a new line here.
#[must_use]
pub fn all() -> Vec<FileSchema> {
    vec![
        written::<Truth>(truth::SCHEMA),
        written::<ResultDocument<'_>>(result::SCHEMA),
        written::<FitDocument<'_>>(fit::SCHEMA),
        written::<BoardDocument<'_>>(board::SCHEMA),
        written::<CostDocument<'_>>(cost::SCHEMA),
        read::<CalibrationKeys>(calibration::SCHEMA),
        read::<SceneKeys>(scene::SCHEMA),
        read::<MarksFile>(MARKS_SCHEMA),
        edits(),
        table::<ManifestColumns>(
            "track.manifest",
            "A manifest, each row of the CSV file an object by column names; an empty cell is null.",
        ),
        table::<SeriesColumns>(
            "track.series",
            "A series, each row of the CSV file an object by column names; an empty cell is null.",
        ),
    ]
}

/// A file that the program writes: every key is there.
fn written<T: JsonSchema>(id: &'static str) -> FileSchema {
    of_type::<T>(id, SchemaSettings::draft2020_12().for_serialize())
}

/// A file that a person writes: what is left out takes its default.
fn read<T: JsonSchema>(id: &'static str) -> FileSchema {
    of_type::<T>(id, SchemaSettings::draft2020_12())
}

/// What a person says of a recording; results hold the same without the key `schema`.
fn edits() -> FileSchema {
    let mut file = read::<Edits>(edits::SCHEMA);
    file.schema["properties"]["schema"] = json!({"const": edits::SCHEMA});
    file.schema["required"] = json!(["schema"]);
    file
}

/// A table that a person writes, as an array of its rows.
fn table<T: JsonSchema>(id: &'static str, description: &str) -> FileSchema {
    let mut file = read::<Vec<T>>(id);
    file.schema["description"] = description.into();
    file
}

fn of_type<T: JsonSchema>(id: &'static str, settings: SchemaSettings) -> FileSchema {
    let generated = settings.into_generator().into_root_schema_for::<T>().to_value();
    // What the file is stands first; keys that are there already keep their place.
    let mut schema =
        json!({"$schema": generated["$schema"], "title": id, "description": generated["description"]});
    if let (Some(all), Value::Object(generated)) = (schema.as_object_mut(), generated) {
        all.extend(generated.into_iter().filter(|(key, _)| key != "title"));
    }
    if schema["properties"]["schema"].is_object() {
        schema["properties"]["schema"] = json!({"const": id});
    }
    FileSchema { id, schema }
}
