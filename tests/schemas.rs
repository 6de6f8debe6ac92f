//! The JSON Schemas in `docs/schemas/` are those of the program's types.
//!
//! ```sh
//! cargo test --test schemas       # compares
//! make schemas                    # writes them anew
//! ```

#![allow(clippy::unwrap_used, reason = "a test may fail where it stands")]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use track::schemas;

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
