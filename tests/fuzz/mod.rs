//! Damaged input of every kind that `track` reads, and what is right to make of it: an error that says something, or numbers
//! that are numbers and come back when they are written and read.
//!
//! Inputs are mutated with a knowledge of their structure (a key, a cell, a value, a block of bytes) from the samples in
//! `calib/` and `fixtures/`, from a seed, so that every run is the same. A few hundred of each kind run with the tests.
//! As long as you like, one kind or all:
//!
//! ```text
//! TRACK_FUZZ=100000 cargo test --release --test all fuzz::calibrations
//! TRACK_FUZZ=10000 TRACK_FUZZ_SEED=7 cargo test --release --test all fuzz::
//! ```
//!
//! An input that fails is written to `target/tmp/fuzz` and named; it becomes a test where it belongs. Not cargo-fuzz: its
//! instrumented build of OpenCV's and FFmpeg's bindings needs a nightly compiler and takes longer than a million inputs
//! here, and what these formats need is a valid file with one thing wrong, which coverage alone is slow to find.
#![allow(
    clippy::print_stderr,
    reason = "the input that hangs has to be named before the end"
)]

mod dice;
mod harness;
mod mutate;

use dice::Dice;
use harness::{fuzz, sound_json};
use mutate::{mutated_bytes, mutated_csv, mutated_json};
use serde_json::Value;
use std::path::{Path, PathBuf};
use track::calibration::{Calibration, ScaleEvidence, Silhouettes};
use track::geometry::PixelPoint;
use track::quantity::Quantity;
use track::rebound::fit::{self, Options};
use track::simulate::{Scene, SimulatedRecording};

fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The files of a folder whose names end so, in order.
fn samples(folder: &str, ending: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found: Vec<(PathBuf, Vec<u8>)> = std::fs::read_dir(repository().join(folder))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.to_string_lossy().ends_with(ending))
        .map(|path| (path.clone(), std::fs::read(&path).unwrap()))
        .collect();
    found.sort();
    assert!(!found.is_empty(), "{folder}");
    found
}

fn json_samples(folder: &str, ending: &str) -> Vec<Value> {
    let files = samples(folder, ending);
    files
        .iter()
        .map(|(_, bytes)| serde_json::from_slice(bytes).unwrap())
        .collect()
}

fn number(x: f64, what: &str) {
    assert!(x.is_finite(), "{what} is {x}");
}

fn said(message: &str) {
    assert!(
        message.trim().len() > 10,
        "an error that says nothing: {message:?}"
    );
}

#[test]
fn calibrations() {
    let seeds = [
        json_samples("calib", ".json"),
        json_samples("fixtures/real", ".calib.json"),
    ]
    .concat();
    fuzz(
        "calib.json",
        300,
        |dice: &mut Dice| mutated_json(dice, &seeds),
        calibration_holds,
    );
}

/// Whether it is accepted; then everything that it offers has to be sound.
fn calibration_holds(bytes: &[u8]) -> bool {
    // As a file: what is not UTF-8 is refused when it is read.
    let Ok(text) = std::str::from_utf8(bytes) else {
        return false;
    };
    let calibration = match Calibration::parse(text, "lab.json") {
        Ok(calibration) => calibration,
        Err(error) => {
            said(&error.to_string());
            return false;
        }
    };
    let written = calibration.to_json();
    sound_json(&written);
    let again = Calibration::parse(&written.to_string(), "again.json");
    // A decimal fraction may be rounded once when an angle changes its unit, and never again.
    let twice = again.expect("its own writing is not read").to_json();
    assert!(
        alike(&written, &twice),
        "written, read, written:\n{written}\n{twice}"
    );
    used(&calibration);
    true
}

/// The same but for the last digits of numbers.
fn alike(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Object(x), Value::Object(y)) => {
            x.len() == y.len() && x.iter().all(|(key, v)| y.get(key).is_some_and(|w| alike(v, w)))
        }
        (Value::Array(x), Value::Array(y)) => x.len() == y.len() && x.iter().zip(y).all(|(v, w)| alike(v, w)),
        (Value::Number(x), Value::Number(y)) => {
            let (x, y) = (x.as_f64().unwrap(), y.as_f64().unwrap());
            (x - y).abs() <= 1e-12 * x.abs().max(y.abs())
        }
        _ => a == b,
    }
}

/// Everything that a calibration that was accepted offers.
fn used(calibration: &Calibration) {
    let map = calibration
        .rectification()
        .expect("accepted, but it maps nothing");
    let evidence = ScaleEvidence {
        ball_radius_units: Quantity::new(25.0, 0.1),
        gravity_units_s2: Quantity::new(9000.0, 10.0),
    };
    let scale = calibration
        .metres_per_unit(&evidence)
        .expect("accepted, but it has no scale");
    assert!(scale.value.is_finite() && scale.value > 0.0, "{scale:?}");
    assert!(
        scale.std_uncertainty.is_none_or(|s| s.is_finite() && s > 0.0),
        "{scale:?}"
    );
    let size = calibration.image_size_px.unwrap_or((1280, 720));
    let viewpoint = calibration.viewpoint(scale.value, size).ok().flatten();
    let middle = PixelPoint::new(0.5 * size.0 as f64, 0.5 * size.1 as f64);
    let outlines = Silhouettes::new(&map, viewpoint.map(|v| v.optics), middle);
    for (u, v) in [
        (0.0, 0.0),
        (0.5, 0.5),
        (1.0, 1.0),
        (0.3, 0.9),
        (-5.0, 7.0),
        (1e7, -1e7),
    ] {
        let p = PixelPoint::new(u * size.0 as f64, v * size.1 as f64);
        if let Some(q) = map.plane_from_pixel(p) {
            number(q.right, "right");
            number(q.up, "up");
            if let Some(back) = map.pixel_from_plane(q) {
                number(back.u_px, "u");
                number(back.v_px, "v");
            }
        }
        if let Some(c) = outlines.centre_of_outline(p, 20.0) {
            number(c.right, "right of an outline");
            number(c.up, "up of an outline");
        }
        if let Some(j) = map.jacobian(p) {
            j.iter().for_each(|&d| number(d, "a derivative"));
        }
    }
}

#[test]
fn scenes() {
    let seeds = json_samples("fixtures/scenes", ".scene.json");
    fuzz(
        "scene.json",
        100,
        |dice: &mut Dice| mutated_json(dice, &seeds),
        scene_holds,
    );
}

/// Whether it is accepted; then flight, truth, calibration and a frame of it have to be sound.
fn scene_holds(bytes: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return false;
    };
    let recording = Scene::from_json(text).and_then(|scene| SimulatedRecording::new(&scene));
    let recording = match recording {
        Ok(recording) => recording,
        Err(error) => {
            said(&error.to_string());
            return false;
        }
    };
    let truth = recording.truth();
    let impacts = &truth.bounces;
    assert!(!impacts.is_empty(), "a recording without an impact");
    for c in &truth.centres {
        for x in [c.time_s, c.x_m, c.y_m, c.z_m, c.u_px, c.v_px] {
            number(x, "a centre");
        }
    }
    let written = serde_json::to_value(&truth).unwrap();
    sound_json(&written);
    // What it writes beside the video has to be accepted.
    let calib = track::simulate::calibration(&recording);
    sound_json(&calib);
    Calibration::parse(&calib.to_string(), "written.calib.json").expect("its own calibration is refused");
    for decision in recording.decisions() {
        number(decision.estimate.amount, decision.name);
    }
    // A picture, where it is none of a wall.
    let camera = &recording.scene().camera;
    if camera.width_px * camera.height_px <= 100_000 {
        let frame = recording.frame(recording.frame_count() / 2);
        assert_eq!((frame.width, frame.height), (camera.width_px, camera.height_px));
    }
    true
}

#[test]
fn manifests() {
    let table = b"video,calib,group,spin_ratio,frame_rate_hz,ball_radius_m\n\
        s1-01.mp4,lab.calib.json,S1,1.60,240,0.0064\nclips/s1-02.mp4,,S1,1.60,,\n\"a, b.mp4\",lab.calib.json,Sr,0,240,0.0125\n\
        # a comment\nu.mp4,,,unknown,1e3,1.25e-2\n";
    let other = b"video;spin_ratio;group\nx.avi;-0,21;\"a;b\"\ny.avi;;\n";
    let seeds = vec![table.to_vec(), other.to_vec()];
    fuzz(
        "manifest",
        300,
        |dice: &mut Dice| mutated_csv(dice, &seeds),
        manifest_holds,
    );
}

/// Whether it is accepted; then its rows have to make calibrations that are.
fn manifest_holds(bytes: &[u8]) -> bool {
    let rows = match track::batch::manifest::parse(bytes, Path::new("/lab/launches.csv")) {
        Ok(rows) => rows,
        Err(error) => {
            said(&error.to_string());
            return false;
        }
    };
    for row in &rows {
        assert!(row.video.file_name().is_some() || row.video.components().count() > 0);
        let base =
            Calibration::parse(r#"{"schema": "track.calib/1", "scale": {"gravity": true}}"#, "x").unwrap();
        let recording = row.changes.applied(base);
        // What the manifest puts in place of the file's has to be what the file may hold.
        Calibration::parse(&recording.to_json().to_string(), "x")
            .expect("a row makes a calibration that is refused");
    }
    true
}

#[test]
fn series() {
    let mut seeds: Vec<Vec<u8>> = samples("fixtures/series", ".csv")
        .into_iter()
        .map(|s| s.1)
        .collect();
    seeds.push(
        b"group,incident_angle_deg,incident_angle_deg_std,rebound_angle_deg,rebound_angle_deg_std,spin_ratio\n\
        a,20,0.1,18,0.1,0\na,40,0.1,44,0.1,0\na,60,0.1,64,0.1,\nb,30,0.1,-12,0.1,-2.5\n"
            .to_vec(),
    );
    seeds.push(
        b"incident_vx_m_s;incident_vx_m_s_std;incident_vz_m_s;incident_vz_m_s_std;rebound_vx_m_s;rebound_vx_m_s_std;\
        rebound_vz_m_s;rebound_vz_m_s_std;spin_in_m_s;incident_vx_m_s__rebound_vx_m_s_corr;inertia_factor\n\
        1;0,001;-2;0,001;0,8;0,001;1,6;0,001;0;0,5;0,4\n1;0,001;-1;0,001;0,9;0,001;0,8;0,001;;-0,2;0,667\n"
            .to_vec(),
    );
    fuzz(
        "series.csv",
        150,
        |dice: &mut Dice| mutated_csv(dice, &seeds),
        series_holds,
    );
}

/// Whether it is accepted; then every row has to be accounted for, and its fit, table and page sound.
fn series_holds(bytes: &[u8]) -> bool {
    let series = match fit::csv::parse(bytes, "series.csv") {
        Ok(series) => series,
        Err(error) => {
            said(&error.to_string());
            return false;
        }
    };
    let fitted = fit::fit(
        &series,
        &Options {
            stiffness_ratio: None,
            court_temperature_c: Some(21.0),
        },
    );
    let json =
        serde_json::to_value(track::report::documents::fit::FitDocument::new(&fitted)).expect("no JSON");
    sound_json(&json);
    let rows: usize = fitted
        .groups
        .iter()
        .map(|g| g.rows_used.len() + g.rows_set_aside.len())
        .sum();
    assert_eq!(
        rows,
        series.rows.len() + series.set_aside.len(),
        "a row was lost, or told twice"
    );
    for group in &fitted.groups {
        assert!(group.rows_set_aside.iter().all(|a| a.reason.len() > 5));
        assert!(group.reason.len() > 5);
    }
    let table = track::report::series_table::fit_table(&fitted);
    let page = track::report::series_page::report_html(&series, &fitted).expect("no page");
    for (what, text) in [("table", &table), ("page", &page)] {
        // "NaN" may stand in a name that the input gave; a number it must not be.
        let spilt = text
            .lines()
            .find(|l| l.contains("=\"NaN\"") || l.contains(" NaN") && !contains(bytes, b"NaN"));
        assert!(spilt.is_none(), "the {what} says {spilt:?}");
    }
    true
}

fn contains(haystack: &[u8], needle: &[u8]) -> bool {
    haystack
        .windows(needle.len())
        .any(|w| w.eq_ignore_ascii_case(needle))
}

#[test]
fn inputs_that_once_failed() {
    // Came back as 0, which is refused.
    let calib = br#"{"schema": "track.calib/1", "scale": {"gravity": true}, "up_std_deg": 5e-324}"#;
    assert!(!calibration_holds(calib));
    // Took the place of a calibration's number that would have been refused.
    for row in ["a.mp4,1e19,", "a.mp4,,1e17"] {
        assert!(!manifest_holds(
            format!("video,spin_ratio,ball_radius_m\n{row}\n").as_bytes()
        ));
    }
    // Wrote a calibration that was refused; or pressed the ball flat, and its centres were NaN.
    for key in [
        r#""ball": {"inertia_factor": 0.93}"#,
        r#""ball": {"inertia_factor": 1e-14}"#,
        r#""ball": {"contact_modulus_pa": 1.4e-5}"#,
        r#""launch": {"spin_ratio": [0, 1e19, 0]}"#,
        r#""camera": {"metres_per_pixel": 1e154}"#,
        r#""camera": {"distance_m": 3.5e19}"#,
    ] {
        let contact = r#""contact": {"model": "mu_e", "restitution": 0.8, "friction": 0.1}"#;
        let scene = format!(r#"{{"schema": "track.scene/1", {contact}, {key}}}"#);
        assert!(!scene_holds(scene.as_bytes()), "{key}");
    }
}

/// Videos go through the program itself, as a process, so that a crash inside a decoder is seen as one.
#[test]
fn videos() {
    let folder = tempfile::tempdir().unwrap();
    let scene = r#"{"schema": "track.scene/1", "contact": {"model": "mu_e", "restitution": 0.7, "friction": 0.07},
        "camera": {"image_size_px": [160, 120], "frame_rate_hz": 120, "metres_per_pixel": 0.002, "origin_px": [10, 110]},
        "launch": {"drop_height_m": 0.1, "speed_m_s": 0.6}, "stop": {"bounces": 1, "tail_s": 0.1}}"#;
    let recording = SimulatedRecording::new(&Scene::from_json(scene).unwrap()).unwrap();
    let written = track::simulate::write(&recording, "clip", folder.path(), |_| {}).unwrap();
    let seed = std::fs::read(&written.video).unwrap();
    let input = folder.path().join("damaged.mp4");
    let out = folder.path().join("out");
    fuzz(
        "video",
        12,
        |dice: &mut Dice| mutated_bytes(dice, &seed),
        |bytes| {
            std::fs::write(&input, bytes).unwrap();
            let _ = std::fs::remove_dir_all(&out);
            let ran = std::process::Command::new(env!("CARGO_BIN_EXE_track"))
                .arg(&input)
                .arg("--calib")
                .arg(&written.calib)
                .args(["--json", "--accuracy", "fast", "--out"])
                .arg(&out)
                .output()
                .unwrap();
            let message = String::from_utf8_lossy(&ran.stderr);
            let status = ran
                .status
                .code()
                .unwrap_or_else(|| panic!("it crashed: {:?}\n{message}", ran.status));
            assert!([0, 1, 2].contains(&status), "exit status {status}: {message}");
            assert!(!message.contains("panicked"), "{message}");
            if status == 2 {
                said(&message);
                assert!(ran.stdout.is_empty(), "a result with status 2");
            } else {
                let result: Value = serde_json::from_slice(&ran.stdout).expect("stdout is no JSON");
                sound_json(&result);
                assert_eq!(result["status"] == "measured", status == 0, "{result}");
                assert_eq!(result["reason"].is_null(), status == 0, "{result}");
            }
            // Whole files or none: every one that is there can be read.
            for entry in std::fs::read_dir(&out).into_iter().flatten() {
                let path = entry.unwrap().path();
                let name = path.file_name().unwrap().to_string_lossy().into_owned();
                assert!(
                    !name.starts_with('.') && !name.ends_with(".tmp"),
                    "a file half written: {name}"
                );
                if name.ends_with(".json") {
                    sound_json(&serde_json::from_slice(&std::fs::read(&path).unwrap()).expect("no JSON"));
                }
            }
            status == 0
        },
    );
}
