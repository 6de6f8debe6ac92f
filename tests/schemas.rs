//! The JSON Schemas in `docs/schemas/` are those of the program's types.
//!
//! ```sh
//! cargo test --test all schemas::    # compares
//! make schemas                       # writes them anew
//! ```

use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use track::calibration::Calibration;
use track::config::{FileError, FileProblem};
use track::edits::Edits;
use track::schemas;
use track::simulate::{Scene, SceneError};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/schemas")
}

/// What should lie in the folder, by file name.
fn wanted() -> BTreeMap<String, String> {
    let text = |schema| serde_json::to_string_pretty(schema).unwrap() + "\n";
    let all = schemas::all();
    let files: BTreeMap<_, _> = all.iter().map(|s| (s.file_name(), text(&s.schema))).collect();
    assert_eq!(files.len(), all.len(), "two kinds of files share a name");
    files
}

#[test]
fn the_schemas_in_docs_are_current() {
    let wanted = wanted();
    if std::env::var_os("TRACK_SCHEMAS").is_some_and(|v| v == "refresh") {
        let _ = fs::remove_dir_all(folder());
        fs::create_dir_all(folder()).unwrap();
        for (name, text) in &wanted {
            fs::write(folder().join(name), text).unwrap();
        }
        return;
    }
    let there: BTreeMap<String, String> = fs::read_dir(folder())
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .map(|path| {
            let name = path.file_name().unwrap().to_str().unwrap().to_owned();
            (name, fs::read_to_string(path).unwrap())
        })
        .collect();
    let names = |files: &BTreeMap<String, String>| files.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&there), names(&wanted), "run: make schemas");
    for (name, text) in &wanted {
        assert_eq!(
            &there[name], text,
            "docs/schemas/{name} is not current; run: make schemas"
        );
    }
}

/// What of `value` is not as `schema` says; the few words of JSON Schema that ours use, and no others.
fn violations(schema: &Value, value: &Value, root: &Value, at: &str, out: &mut Vec<String>) {
    let mut fail = |what: String| out.push(format!("{at}: {what}"));
    let Some(words) = schema.as_object() else {
        if schema == &Value::Bool(false) {
            fail("nothing may stand here".to_owned());
        }
        return;
    };
    let number = value.as_f64();
    for (word, wanted) in words {
        let limit = wanted.as_f64();
        let forms = || wanted.as_array().unwrap().iter();
        let fits = |form: &Value| {
            let mut found = Vec::new();
            violations(form, value, root, at, &mut found);
            found.is_empty()
        };
        let holds = match word.as_str() {
            "$schema"
            | "$defs"
            | "title"
            | "description"
            | "format"
            | "default"
            | "items"
            | "prefixItems"
            | "properties"
            | "patternProperties"
            | "additionalProperties" => true,
            "$ref" => fits(root.pointer(&wanted.as_str().unwrap()[1..]).unwrap()),
            "type" => match wanted {
                Value::Array(types) => types.iter().any(|t| is_of(t, value)),
                one => is_of(one, value),
            },
            "const" => value == wanted,
            "enum" => forms().any(|v| v == value),
            "anyOf" => forms().any(fits),
            "oneOf" => forms().filter(|form| fits(form)).count() == 1,
            "required" => value.is_null() || forms().all(|key| value.get(key.as_str().unwrap()).is_some()),
            "minimum" => number.is_none_or(|x| x >= limit.unwrap()),
            "exclusiveMinimum" => number.is_none_or(|x| x > limit.unwrap()),
            "maximum" => number.is_none_or(|x| x <= limit.unwrap()),
            "minItems" => value.as_array().is_none_or(|a| a.len() as f64 >= limit.unwrap()),
            "maxItems" => value.as_array().is_none_or(|a| a.len() as f64 <= limit.unwrap()),
            other => panic!("the schemas now use {other:?}: teach the test what it means"),
        };
        if !holds {
            fail(format!("{value} is not {word} {wanted}"));
        }
    }
    let none = Map::new();
    let object = value.as_object().unwrap_or(&none);
    for (key, inner) in object {
        let at = format!("{at}.{key}");
        let named = schema["properties"].get(key);
        // Ours are patterns of endings: "_corr$".
        let patterns = schema["patternProperties"].as_object().unwrap_or(&none);
        let by_ending = patterns
            .iter()
            .find(|(p, _)| key.ends_with(p.trim_end_matches('$')));
        let other = words.get("additionalProperties");
        if let Some(form) = named.or(by_ending.map(|(_, form)| form)).or(other) {
            violations(form, inner, root, &at, out);
        }
    }
    if let (Some(form), Some(items)) = (words.get("items"), value.as_array()) {
        for (i, item) in items.iter().enumerate() {
            violations(form, item, root, &format!("{at}[{i}]"), out);
        }
    }
}

fn is_of(name: &Value, value: &Value) -> bool {
    match name.as_str().unwrap() {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "number" => value.is_number(),
        "integer" => value.as_f64().is_some_and(|x| x.fract() == 0.0),
        "string" => value.is_string(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        other => panic!("no type {other}"),
    }
}

/// What of `value` is not as the schema of its key `schema` says.
fn check(value: &Value) -> Vec<String> {
    let id = value["schema"].as_str().unwrap();
    let all = schemas::all();
    let schema = &all.iter().find(|s| s.id == id).unwrap().schema;
    let mut out = Vec::new();
    violations(schema, value, schema, "", &mut out);
    out
}

/// The JSON files below `folder` whose name ends so.
fn files(folder: &str, ending: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join(folder)];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.to_str().unwrap().ends_with(ending) {
                found.push(path);
            }
        }
    }
    found
}

#[test]
fn what_the_program_reads_and_wrote_is_as_its_schema_says() {
    let samples = [
        files("calib", ".calib.json"),
        files("fixtures/golden", "calib.json"),
        files("fixtures/scenes", ".scene.json"),
    ];
    for path in samples.iter().flatten() {
        let value: Value = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
        assert_eq!(check(&value), [""; 0], "{}", path.display());
    }
    assert!(
        samples.iter().all(|files| !files.is_empty()),
        "the samples are elsewhere now"
    );
}

#[test]
fn a_schema_refuses_what_is_wrong() {
    let calib = |more: Value| {
        let mut value = json!({"schema": "track.calib/1", "scale": {"metres_per_pixel": 0.001}});
        value
            .as_object_mut()
            .unwrap()
            .extend(more.as_object().unwrap().clone());
        check(&value)
    };
    assert_eq!(
        calib(json!({"ball": {"radius_m": null}, "launch": {"spin_ratio": "rolling"}})),
        [""; 0]
    );
    for wrong in [
        json!({"bal": {}}),
        json!({"ball": {"radius": 1}}),
        json!({"ball": {"radius_m": 0}}),
        json!({"ball": {"inertia_factor": 1}}),
        json!({"view": "front"}),
        json!({"scale": {"ball": false}}),
        json!({"origin_px": [1]}),
        json!({"launch": {"spin_ratio": "fast"}}),
        json!({"schema": "track.calib/1", "scale": null}),
    ] {
        assert_ne!(calib(wrong.clone()), [""; 0], "{wrong}");
    }
    let scene = |contact: Value| check(&json!({"schema": "track.scene/1", "contact": contact}));
    assert_eq!(scene(json!({"restitution": 0.8, "friction": 0.1})), [""; 0]);
    assert_ne!(
        scene(json!({"model": "e_e", "restitution": 0.8, "friction": 0.1})),
        [""; 0]
    );
}

/// The keys that a reader accepts, by what it says about one that it does not know.
fn accepted_keys(problems: &[FileProblem], unknown: &str) -> Vec<String> {
    let problem = problems.iter().find(|p| p.key == unknown).unwrap();
    let keys = problem.accepted.split_once(": ").unwrap().1;
    let mut keys: Vec<String> = keys.split(", ").map(str::to_owned).collect();
    keys.sort();
    keys
}

#[test]
fn readers_and_schemas_know_the_same_keys() {
    let schemas = schemas::all();
    for (id, sections) in [
        (
            "track.calib/1",
            &["", "scale", "lens", "ball", "launch", "floor"][..],
        ),
        (
            "track.scene/1",
            &[
                "",
                "ball",
                "floor",
                "launch",
                "launch.bench",
                "air",
                "camera",
                "camera.bump",
                "camera.lens",
                "look",
                "stop",
                "effects",
            ],
        ),
        ("track.edits/1", &["", "ball"]),
    ] {
        let schema = &schemas.iter().find(|s| s.id == id).unwrap().schema;
        for section in sections {
            let names: Vec<&str> = section.split('.').filter(|name| !name.is_empty()).collect();
            let mut file = json!({"zzz": 0});
            let mut form = schema;
            for name in names.iter().rev() {
                file = json!({*name: file});
            }
            for name in &names {
                form = &form["properties"][name];
                let inner = form["anyOf"].as_array().and_then(|forms| {
                    forms
                        .iter()
                        .find(|f| f.get("$ref").is_some() || f.get("properties").is_some())
                });
                form = inner.unwrap_or(form);
                if let Some(place) = form["$ref"].as_str() {
                    form = schema.pointer(&place[1..]).unwrap();
                }
            }
            file["schema"] = id.into();
            let text = file.to_string();
            let unknown = names
                .iter()
                .chain(&["zzz"])
                .copied()
                .collect::<Vec<_>>()
                .join(".");
            let accepted = match id {
                "track.calib/1" => {
                    accepted_keys(Calibration::parse(&text, "x").unwrap_err().problems(), &unknown)
                }
                "track.edits/1" => match Edits::from_bytes(text.as_bytes(), "x").unwrap_err() {
                    FileError::Invalid { problems, .. } => accepted_keys(&problems, &unknown),
                    other => panic!("{other}"),
                },
                _ => match Scene::from_json(&text).unwrap_err() {
                    SceneError::File(error) => accepted_keys(error.problems(), &unknown),
                    other => panic!("{other}"),
                },
            };
            let mut described: Vec<&String> = form["properties"].as_object().unwrap().keys().collect();
            described.sort();
            assert_eq!(accepted.iter().collect::<Vec<_>>(), described, "{id} {section}");
        }
    }
}
