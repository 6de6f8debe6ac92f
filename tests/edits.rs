//! What a person says of a recording: edits by hand, through the built binary, and the page of `track review` in a real browser.
//!
//! The browser's part runs where there is a Chromium in PATH, or where `TRACK_CHROMIUM` names one; elsewhere it says so and passes.

use crate::browser;
use crate::rendered::Rendered;
use assert_cmd::Command;
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// Two balls that fly towards each other.
static TWO: LazyLock<Rendered> = LazyLock::new(|| {
    Rendered::new(&json!({
        "schema": "track.scene/1", "seed": 5, "ball": {"radius_m": 0.0125, "mass_kg": 0.06},
        "contact": {"model": "mu_e", "restitution": 0.85, "friction": 0.1},
        "launch": {"speed_m_s": 0.9, "drop_height_m": 0.25},
        "camera": {"image_size_px": [960, 540], "frame_rate_hz": 240, "metres_per_pixel": 0.001, "origin_px": [80, 500],
                   "codec": "lossless"},
        "stop": {"bounces": 2, "tail_s": 0.08},
        "second_ball": {"start_s": 0.02, "x_m": 0.75, "drop_height_m": 0.2, "speed_m_s": -0.5, "radius_m": 0.011}
    }))
});

/// What was made of a recording.
struct Run {
    status: i32,
    result: Value,
    /// Rows of `points.csv`.
    points: Vec<Vec<String>>,
    words: String,
}

/// Measures the recording of two balls with `edits`.
fn measured(edits: &Value) -> Run {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("said.edits.json");
    fs::write(&file, edits.to_string()).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_track"))
        .arg(&TWO.video)
        .arg("--calib")
        .arg(&TWO.calibration_file)
        .arg("--edits")
        .arg(&file)
        .args(["--formats", "json,csv,html", "--out"])
        .arg(dir.path())
        .output()
        .unwrap();
    let read = |name: &str| fs::read_to_string(dir.path().join(name)).unwrap_or_default();
    let page = read("scene.report.html");
    let result = serde_json::from_str(&read("scene.result.json")).unwrap_or_default();
    let points = csv::Reader::from_reader(read("scene.points.csv").as_bytes())
        .records()
        .map(|r| r.unwrap().iter().map(str::to_owned).collect())
        .collect();
    if output.status.code() == Some(0) && edits.as_object().unwrap().len() > 1 {
        assert!(
            page.contains("edited"),
            "the page does not say that it was edited"
        );
    }
    Run {
        status: output.status.code().unwrap(),
        result,
        points,
        words: String::from_utf8_lossy(&output.stderr).into_owned(),
    }
}

fn said(more: Value) -> Value {
    let mut edits = json!({"schema": "track.edits/1"});
    for (key, value) in more.as_object().unwrap() {
        edits[key] = value.clone();
    }
    edits
}

/// (measured − true) in standard uncertainties.
fn sigmas(quantity: &Value, truth: f64) -> f64 {
    (quantity["value"].as_f64().unwrap() - truth) / quantity["std_uncertainty"].as_f64().unwrap()
}

/// Where the ball (or the other one) truly is in a frame.
fn centre(of: &Value, frame: u64) -> (f64, f64) {
    let all = of["centres"].as_array().unwrap();
    let c = all.iter().find(|c| c["frame"] == frame).unwrap();
    (c["u_px"].as_f64().unwrap(), c["v_px"].as_f64().unwrap())
}

fn assert_bounces_are_those_of(result: &Value, truth: &Value) {
    for (bounce, truth) in result["bounces"]
        .as_array()
        .unwrap()
        .iter()
        .zip(truth["bounces"].as_array().unwrap())
    {
        for (place, key) in [("/time_s", "time_s"), ("/restitution", "restitution")] {
            let off = sigmas(bounce.pointer(place).unwrap(), truth[key].as_f64().unwrap());
            assert!(off.abs() < 4.0, "{place}: {off} std");
        }
    }
}

#[test]
fn the_ball_that_a_person_chooses_is_measured() {
    let plain = measured(&said(json!({})));
    assert_bounces_are_those_of(&plain.result, &TWO.truth);
    assert!(plain.result.get("edits").is_none());
    let other = &TWO.truth["second_ball"];
    let (u, v) = centre(other, 30);
    let run = measured(&said(
        json!({"ball": {"frame": 30, "centre_px": [u + 4.0, v - 3.0]}}),
    ));
    assert_eq!(run.status, 0, "{}", run.words);
    assert_bounces_are_those_of(&run.result, other);
    assert_eq!(run.result["edits"]["ball"]["frame"], 30);
    let codes: Vec<&str> = run.result["warnings"]
        .as_array()
        .unwrap()
        .iter()
        .map(|w| w["code"].as_str().unwrap())
        .collect();
    assert!(codes.contains(&"edited"), "{codes:?}");
}

#[test]
fn excluded_frames_are_not_used_and_say_so() {
    let run = measured(&said(json!({"exclude_frames": [10, 11, 70]})));
    let reasons: Vec<(&str, &str, &str)> = run
        .points
        .iter()
        .map(|r| (r[0].as_str(), r[7].as_str(), r[9].as_str()))
        .filter(|(_, _, why)| why.contains("excluded"))
        .collect();
    assert_eq!(
        reasons.iter().map(|r| r.0).collect::<Vec<_>>(),
        ["10", "11", "70"]
    );
    assert!(reasons.iter().all(|r| r.1 == "false"));
    assert_bounces_are_those_of(&run.result, &TWO.truth);
}

#[test]
fn a_centre_that_a_person_gives_stands_in_place_of_the_one_found() {
    let (u, v) = centre(&TWO.truth, 60);
    let point = json!({"frame": 60, "u_px": u + 0.2, "v_px": v - 0.1, "std_px": 0.3});
    let run = measured(&said(json!({"points": [point]})));
    let row = run.points.iter().find(|r| r[0] == "60").unwrap();
    assert_eq!(
        (row[2].parse::<f64>().unwrap(), row[3].parse::<f64>().unwrap()),
        (u + 0.2, v - 0.1)
    );
    assert_eq!(row[7], "true");
    assert!(row[4].parse::<f64>().unwrap() > 0.25, "{row:?}");
    assert_bounces_are_those_of(&run.result, &TWO.truth);
    // One that is far off is set aside like any other.
    let wrong = json!({"frame": 60, "u_px": u + 6.0, "v_px": v, "std_px": 0.3});
    let run = measured(&said(json!({"points": [wrong]})));
    assert!(run.points.iter().all(|r| r[0] != "60" || r[7] == "false"));
    assert_bounces_are_those_of(&run.result, &TWO.truth);
}

#[test]
fn times_region_and_impacts_are_as_said() {
    let first_s = TWO.truth["bounces"][0]["time_s"].as_f64().unwrap();
    let run = measured(&said(json!({"time_range_s": [0.0, first_s + 0.25]})));
    assert_eq!(run.result["bounces"].as_array().unwrap().len(), 1);
    assert!(
        run.points
            .iter()
            .all(|r| r[1].parse::<f64>().unwrap() <= first_s + 0.25)
    );
    assert_bounces_are_those_of(&run.result, &TWO.truth);
    // The other ball's way, right of where the first comes to.
    let run = measured(&said(json!({"region_px": [540, 0, 959, 539]})));
    assert_bounces_are_those_of(&run.result, &TWO.truth["second_ball"]);
    let run = measured(&said(json!({"not_impacts_s": [first_s + 0.003]})));
    let times: Vec<f64> = run.result["bounces"]
        .as_array()
        .unwrap()
        .iter()
        .map(|b| b["time_s"]["value"].as_f64().unwrap())
        .collect();
    let second_s = TWO.truth["bounces"][1]["time_s"].as_f64().unwrap();
    assert!(
        times.len() == 1 && (times[0] - second_s).abs() < 1e-3,
        "{times:?}"
    );
    // Without the impact before it the second is not where a launch from the edge comes down, and no third was seen.
    assert!(run.result["x0_m"].is_null());
    assert_eq!(run.result["x_source"], "extrapolated");
}

#[test]
fn edits_that_do_not_fit_are_refused_in_words() {
    for (edits, words) in [
        (json!({"exclude_frames": [9000]}), "frames 0 to"),
        (
            json!({"ball": {"frame": 30, "centre_px": [500, 20]}}),
            "the nearest round thing is at",
        ),
        (json!({"video_sha256": "0".repeat(64)}), "another recording"),
        (json!({"exclude": [1]}), "did you mean exclude_frames"),
    ] {
        let run = measured(&said(edits));
        assert!(run.status == 2 && run.words.contains(words), "{}", run.words);
        assert!(run.points.is_empty());
    }
}

#[test]
fn a_batch_takes_the_edits_beside_a_recording() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    fs::copy(&TWO.video, path("two.mkv")).unwrap();
    fs::copy(&TWO.calibration_file, path("two.calib.json")).unwrap();
    let batch = || {
        let output = Command::new(env!("CARGO_BIN_EXE_track"))
            // The other ball has another size than the calibration says.
            .args(["batch", "two.mkv", "--out", "lab", "--keep-refuted"])
            .current_dir(dir.path())
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        let mut table = csv::Reader::from_path(path("lab/series.csv")).unwrap();
        let names = table.headers().unwrap().clone();
        let column = |name: &str| names.iter().position(|n| n == name).unwrap();
        let (edited, time) = (column("edited"), column("time_s"));
        let first = table.records().next().unwrap().unwrap();
        (first[edited].to_owned(), first[time].parse::<f64>().unwrap())
    };
    let (edited, first_s) = batch();
    assert_eq!(edited, "false");
    let (u, v) = centre(&TWO.truth["second_ball"], 30);
    let edits = said(json!({"ball": {"frame": 30, "centre_px": [u, v]}}));
    fs::write(path("two.edits.json"), edits.to_string()).unwrap();
    let (edited, other_s) = batch();
    assert_eq!(edited, "true");
    let truth_s = TWO.truth["second_ball"]["bounces"][0]["time_s"].as_f64().unwrap();
    assert!((other_s - truth_s).abs() < 1e-3 && (first_s - truth_s).abs() > 1e-3);
}

/// The page of a recording, with its result and without.
fn page(result: Option<&Path>, dir: &Path) -> PathBuf {
    let out = dir.join("page.review.html");
    let mut command = Command::new(env!("CARGO_BIN_EXE_track"));
    command
        .arg("review")
        .arg(&TWO.video)
        .args(result)
        .arg("--out")
        .arg(&out);
    command.assert().success().stdout(format!("{}\n", out.display()));
    out
}

#[test]
fn what_is_said_on_the_page_measures_as_edits_by_hand_do() {
    let Some(chromium) = browser::chromium() else {
        return;
    };
    let dir = tempfile::tempdir().unwrap();
    Command::new(env!("CARGO_BIN_EXE_track"))
        .arg(&TWO.video)
        .arg("--calib")
        .arg(&TWO.calibration_file)
        .args(["--formats", "json,csv", "--out"])
        .arg(dir.path())
        .assert()
        .success();
    let page = page(Some(&dir.path().join("scene.result.json")), dir.path());
    let (u, v) = centre(&TWO.truth["second_ball"], 30);
    let script = format!(
        r##"
        const press = (key, more = {{}}) => document.dispatchEvent(new KeyboardEvent("keydown", {{ key, bubbles: true, cancelable: true, ...more }}));
        const stage = by("stage");
        const box = stage.getBoundingClientRect(), scale = Math.min(box.width / 960, box.height / 540);
        const at = (u, v) => [box.left + 0.5 * (box.width - 959 * scale) + u * scale, box.top + 0.5 * (box.height - 539 * scale) + v * scale];
        const point = (type, [x, y]) => stage.dispatchEvent(new PointerEvent(type, {{ bubbles: true, clientX: x, clientY: y }}));
        const click = (u, v) => {{ point("pointerdown", at(u, v)); point("pointerup", at(u, v)); }};
        press("Home");
        press("ArrowRight", {{ shiftKey: true }});
        press("x"); press("ArrowRight"); press("x"); press("ArrowRight"); press("x");
        press("ArrowRight"); press("x"); press("x");
        by("slider").value = 30;
        by("slider").dispatchEvent(new Event("input", {{ bubbles: true }}));
        press("b");
        click({u} + 2, {v} - 2);
        press("Escape");
        const shown = by("where").textContent, said = by("said").textContent;
        by("save").click();
        return {{ edits: by("result").textContent, shown, said, impacts: by("impacts").children.length,
                  dots: document.querySelectorAll("#plots circle").length, done: by("done").textContent }};
        "##
    );
    let out = browser::on_page(&chromium, 1300, &page, &script);
    assert!(out["shown"].as_str().unwrap().starts_with("frame 30 of"), "{out}");
    assert_eq!(out["impacts"], 2);
    assert!(out["dots"].as_u64().unwrap() > 400, "{out}");
    let saved: Value = serde_json::from_str(out["edits"].as_str().unwrap()).unwrap();
    assert_eq!(saved["exclude_frames"], json!([10, 11, 12]));
    assert_eq!(saved["ball"]["frame"], 30);
    let by_page = measured(&saved);
    let by_hand = measured(&said(json!({
        "exclude_frames": [10, 11, 12], "ball": {"frame": 30, "centre_px": [u.round(), v.round()]}
    })));
    assert_eq!(by_page.result["bounces"], by_hand.result["bounces"]);
    assert_bounces_are_those_of(&by_page.result, &TWO.truth["second_ball"]);
}

#[test]
fn a_recording_without_a_result_has_a_page_too() {
    let Some(chromium) = browser::chromium() else {
        return;
    };
    let dir = tempfile::tempdir().unwrap();
    let page = page(None, dir.path());
    let script = r##"
        const svg = document.querySelector("#plots svg"), box = svg.getBoundingClientRect();
        const point = (type, part) => svg.dispatchEvent(new PointerEvent(type, { bubbles: true, clientX: box.left + part * box.width, clientY: box.top + 30 }));
        point("pointerdown", 0.3); point("pointermove", 0.5); point("pointermove", 0.8); point("pointerup", 0.8);
        const edits = JSON.parse(by("result").textContent);
        by("clear").click();
        return { edits, cleared: JSON.parse(by("result").textContent), status: by("status").textContent, command: by("command").textContent };
    "##;
    let out = browser::on_page(&chromium, 1300, &page, script);
    let range = out["edits"]["time_range_s"].as_array().unwrap();
    assert!(range[0].as_f64().unwrap() < range[1].as_f64().unwrap());
    assert!(out["cleared"].get("time_range_s").is_none());
    assert!(
        out["status"].as_str().unwrap().starts_with("Not measured yet"),
        "{out}"
    );
    assert!(out["command"].as_str().unwrap().contains("--edits"), "{out}");
}
