//! Which files the program made, so that it may replace them without asking.
//!
//! A JSON file that it makes carries [`KEY`]: the program, a digest of everything else in the file, and digests of the files that were
//! made with it and cannot say so themselves (a video, a picture). A file that somebody has changed since, or written by hand, has no
//! digest that fits: it is theirs. How the JSON is laid out does not matter, and neither does which version made it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use sha2::{Digest as _, Sha256};
use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

/// The key that says so.
pub const KEY: &str = "made_by";

/// The line by which a page says so.
pub const PAGE_MARK: &str = "<meta name=\"generator\" content=\"track ";

/// That the program made a file, and digests by which it knows whether somebody has changed it since.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct MadeBy {
    /// The program and its version.
    pub program: String,
    /// SHA-256 of the rest of the file, as JSON without spaces.
    pub sha256: String,
    /// SHA-256 of the files that were made with it, by their names.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub files: BTreeMap<String, String>,
}

/// `content` with the key that says that this program made it, and with it `files` (their names, without folders, and digests).
#[must_use]
pub fn signed(content: Value, files: &[(String, String)]) -> Value {
    let Value::Object(mut content) = content else {
        return content;
    };
    content.remove(KEY);
    let mark = MadeBy {
        program: concat!("track ", env!("CARGO_PKG_VERSION")).to_owned(),
        sha256: digest(&content),
        files: files.iter().cloned().collect(),
    };
    // A struct of strings is always an object.
    content.insert(KEY.to_owned(), serde_json::to_value(mark).unwrap_or_default());
    Value::Object(content)
}

/// Those of `files` that are there and that the program did not make, or somebody has changed since. `signer` is the JSON file that
/// names the others' digests.
#[must_use]
pub fn foreign(signer: &Path, files: &[PathBuf]) -> Vec<PathBuf> {
    let sign = unchanged(signer);
    let named = |path: &Path| {
        let name = path.file_name()?.to_str()?;
        Some(of_file(path).ok()? == *sign.as_ref()?.files.get(name)?)
    };
    let made = |path: &PathBuf| match path.extension().and_then(|e| e.to_str()) {
        Some("json") => unchanged(path).is_some(),
        Some("html") => is_page(path),
        _ => named(path).unwrap_or(false),
    };
    // A folder is for who writes to refuse; a pipe or a device is nobody's file, and reading it might never end.
    let there = |path: &&PathBuf| path.symlink_metadata().is_ok() && !path.is_dir();
    let ours = |path: &PathBuf| path.is_file() && made(path);
    files
        .iter()
        .filter(there)
        .filter(|path| !ours(path))
        .cloned()
        .collect()
}

fn of_file(path: &Path) -> io::Result<String> {
    let mut hash = Sha256::new();
    io::copy(&mut File::open(path)?, &mut hash)?;
    Ok(format!("{:x}", hash.finalize()))
}

/// What the key of a JSON file holds, where its digest is that of the rest.
fn unchanged(path: &Path) -> Option<MadeBy> {
    if !path.is_file() {
        return None;
    }
    let mut content: Map<String, Value> = serde_json::from_slice(&std::fs::read(path).ok()?).ok()?;
    let mark: MadeBy = serde_json::from_value(content.remove(KEY)?).ok()?;
    (mark.sha256 == digest(&content)).then_some(mark)
}

fn digest(content: &Map<String, Value>) -> String {
    // Of the content, not of its layout: numbers are read as they were written.
    let text = Value::Object(content.clone()).to_string();
    format!("{:x}", Sha256::digest(text))
}

fn is_page(path: &Path) -> bool {
    std::fs::read_to_string(path).is_ok_and(|text| text.contains(PAGE_MARK))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use std::fs;

    #[test]
    fn a_file_is_ours_until_somebody_changes_it() {
        let dir = tempfile::tempdir().unwrap();
        let path = |name: &str| dir.path().join(name);
        let (calib, video, other) = (path("a.calib.json"), path("a.mp4"), path("b.mp4"));
        let all = [calib.clone(), video.clone(), other.clone()];
        assert!(foreign(&calib, &all).is_empty(), "nothing is there");
        fs::write(&video, "frames").unwrap();
        fs::write(&other, "frames").unwrap();
        let content =
            json!({"schema": "track.calib/1", "scale": {"metres_per_pixel": 1.5e-3}, "rate": 240, "z": 1e22});
        let files = [("a.mp4".to_owned(), of_file(&video).unwrap())];
        let sealed = signed(content.clone(), &files);
        assert_eq!(signed(sealed.clone(), &files), sealed, "signed anew, not twice");
        fs::write(&calib, serde_json::to_string_pretty(&sealed).unwrap()).unwrap();
        assert_eq!(foreign(&calib, &all), std::slice::from_ref(&other));
        // Laid out anew it says the same.
        fs::write(&calib, sealed.to_string()).unwrap();
        assert_eq!(foreign(&calib, &all), std::slice::from_ref(&other));
        fs::write(&video, "other frames").unwrap();
        assert_eq!(foreign(&calib, &all), [video.clone(), other.clone()]);
        fs::write(&calib, sealed.to_string().replace("240", "120")).unwrap();
        assert_eq!(foreign(&calib, &all), all);
        fs::write(&calib, content.to_string()).unwrap();
        assert_eq!(foreign(&calib, &all), all, "written by hand");
    }

    #[test]
    fn a_page_is_known_by_its_generator() {
        let dir = tempfile::tempdir().unwrap();
        let page = dir.path().join("a.html");
        fs::write(&page, format!("<head>{PAGE_MARK}0.2.0\"></head>")).unwrap();
        assert!(foreign(&page, std::slice::from_ref(&page)).is_empty());
        fs::write(&page, "<p>mine").unwrap();
        assert_eq!(foreign(&page, std::slice::from_ref(&page)), [page]);
    }
}
