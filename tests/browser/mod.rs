//! Pages in a real browser: headless Chromium, in which a script presses keys, clicks and reads what the page makes of it.

use assert_cmd::Command;
use base64::Engine as _;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use tempfile::tempdir;

/// The browser; `None`, with a word, where there is none: it is too much to install for a test.
pub fn chromium() -> Option<PathBuf> {
    if let Some(named) = std::env::var_os("TRACK_CHROMIUM") {
        return Some(named.into());
    }
    let path = std::env::var_os("PATH")?;
    let names = [
        "chromium",
        "chromium-browser",
        "google-chrome",
        "google-chrome-stable",
    ];
    let found = std::env::split_paths(&path)
        .flat_map(|dir| names.map(|name| dir.join(name)))
        .find(|p| p.is_file());
    if found.is_none() {
        println!(
            "skipped: there is no chromium in PATH (apt-get install chromium), and TRACK_CHROMIUM names none"
        );
    }
    found
}

/// What the body of a function returns that runs on `page`, in a window so many pixels wide, once it is loaded. It has `by(id)`.
pub fn on_page(browser: &Path, width: u32, page: &Path, script: &str) -> Value {
    let dir = tempdir().unwrap();
    let html = std::fs::read_to_string(page).unwrap();
    let test = format!(
        "<script>\nconst errors = [];\nwindow.addEventListener(\"error\", (e) => errors.push(String(e.message)));\n\
         const by = (id) => document.getElementById(id);\nwindow.addEventListener(\"load\", async () => {{\n\
         let out;\ntry {{ out = await (async () => {{ {script} }})(); }} catch (e) {{ out = {{ thrown: String(e) }}; }}\n\
         out.errors = errors;\nconst box = document.createElement(\"div\");\nbox.id = \"outcome\";\n\
         box.textContent = btoa(unescape(encodeURIComponent(JSON.stringify(out))));\ndocument.body.appendChild(box);\n}});\n</script></body>"
    );
    let tested = dir.path().join("tested.html");
    std::fs::write(&tested, html.replace("</body>", &test)).unwrap();
    let output = Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-quic",
            "--no-first-run",
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
            "--virtual-time-budget=5000",
            "--dump-dom",
        ])
        .arg(format!("--window-size={width},900"))
        .arg(format!(
            "--user-data-dir={}",
            dir.path().join("profile").display()
        ))
        .arg(format!("file://{}", tested.display()))
        .timeout(std::time::Duration::from_secs(120))
        .output()
        .unwrap();
    let dom = String::from_utf8_lossy(&output.stdout);
    let outcome = dom
        .split_once("id=\"outcome\">")
        .and_then(|(_, rest)| rest.split_once('<'));
    let outcome = outcome.unwrap_or_else(|| {
        panic!(
            "the page's script did not end: {}",
            String::from_utf8_lossy(&output.stderr)
        )
    });
    let bytes = base64::engine::general_purpose::STANDARD
        .decode(outcome.0.trim())
        .unwrap();
    let value: Value = serde_json::from_slice(&bytes).unwrap();
    assert_eq!(value["errors"], json!([]), "{value}");
    assert_eq!(value.get("thrown"), None, "{value}");
    value
}
