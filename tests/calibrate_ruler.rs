//! `track calibrate ruler|show|check` through the binary: from a clip without a calibration to a result, exit statuses,
//! messages, and what is left on the disk.

use assert_cmd::Command;
use predicates::prelude::*;
use predicates::str::{contains, is_empty};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use tempfile::tempdir;
use track::calibration::{Calibration, Scale};
use track::simulate::{Scene, SimulatedRecording};

/// 2.5 mm a pixel, the launch edge at column 20, the floor at row 220.
const SCENE: &str = r#"{"schema": "track.scene/1", "seed": 7,
    "ball": {"radius_m": 0.02, "mass_kg": 0.2, "inertia_factor": 0.4},
    "contact": {"model": "mu_e", "restitution": 0.78, "friction": 0.07},
    "launch": {"drop_height_m": 0.2, "speed_m_s": 1.2},
    "camera": {"image_size_px": [320, 240], "frame_rate_hz": 120, "exposure_s": 0.0005,
               "metres_per_pixel": 0.0025, "origin_px": [20, 220], "noise_grey": 2},
    "look": {"floor_grey": 120},
    "stop": {"bounces": 2, "tail_s": 0.1}}"#;

fn track() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_track"));
    command.timeout(std::time::Duration::from_secs(300));
    command
}

fn clip() -> &'static PathBuf {
    static CLIP: OnceLock<PathBuf> = OnceLock::new();
    CLIP.get_or_init(|| {
        let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join("calibrate_ruler");
        let recording = SimulatedRecording::new(&Scene::from_json(SCENE).unwrap()).unwrap();
        track::simulate::write(&recording, "ball", &dir, |_| ())
            .unwrap()
            .video
    })
}

fn names(dir: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(dir)
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// `track calibrate ruler CLIP ARGS`.
fn ruler(args: &[&str]) -> Command {
    let mut command = track();
    command.args(["calibrate", "ruler"]).arg(clip()).args(args);
    command
}

const MARKS: [&str; 6] = ["--from", "20,100", "--to", "300,100", "--length-m", "0.7"];

fn refused(args: &[&str], words: &[&str]) {
    let dir = tempdir().unwrap();
    let out = dir.path().join("never.calib.json");
    let mut assert = ruler(args)
        .arg("--out")
        .arg(&out)
        .assert()
        .code(2)
        .stdout(is_empty())
        .stderr(contains("panicked").not());
    for word in words {
        assert = assert.stderr(contains(*word));
    }
    assert_eq!(names(dir.path()), [""; 0], "something is left");
}

#[test]
fn two_marks_and_a_length_lead_from_a_clip_to_a_result() {
    let dir = tempdir().unwrap();
    let calib = dir.path().join("my.calib.json");
    ruler(&MARKS)
        .args([
            "--floor",
            "200,216",
            "--snap",
            "--edge",
            "20,150",
            "--ball-radius-m",
            "0.02",
            "--out",
        ])
        .arg(&calib)
        .assert()
        .code(2)
        .stderr(contains("no edge within 10 px"));
    // Nothing in this scene has an edge but the floor: the others are as read.
    ruler(&MARKS)
        .args([
            "--floor",
            "200,220",
            "--edge",
            "20,150",
            "--ball-radius-m",
            "0.02",
            "--out",
        ])
        .arg(&calib)
        .assert()
        .success()
        .stdout(contains("2.500 ± 0.013 mm a pixel").and(contains("uncertain by 0.51 %")))
        .stderr(contains("my.marks.png").and(contains("my.calib.json")));
    assert_eq!(names(dir.path()), ["my.calib.json", "my.marks.png"]);
    assert_eq!(&fs::read(dir.path().join("my.marks.png")).unwrap()[1..4], b"PNG");
    let result = track()
        .arg(clip())
        .arg("--calib")
        .arg(&calib)
        .arg("--json")
        .assert()
        .success();
    let result: Value = serde_json::from_slice(&result.get_output().stdout).unwrap();
    let (gravity, x0) = (&result["gravity_m_s2"], &result["x0_m"]);
    let of = |q: &Value, key: &str| q[key].as_f64().unwrap();
    let pull = (of(gravity, "value") - 9.81) / of(gravity, "std_uncertainty");
    assert!(
        pull.abs() < 3.0 && (of(gravity, "std_uncertainty") / 9.81 - 0.005).abs() < 0.002,
        "{gravity}"
    );
    // The origin's doubt, one pixel, is in x0.
    assert!((of(x0, "std_uncertainty") - 0.0025).abs() < 0.001, "{x0}");
}

#[test]
fn a_floor_is_snapped_to_its_edge() {
    let c = ruler(&["--gravity", "--floor", "200,214", "--snap=12", "--json"])
        .assert()
        .success();
    let c = Calibration::parse(&String::from_utf8_lossy(&c.get_output().stdout), "out").unwrap();
    let v = c.origin_px.unwrap().v_px;
    assert!((v - 220.0).abs() < 0.1, "{v}");
    assert!(c.origin_std_px.unwrap() < 0.1);
    assert_eq!((c.launch.edge_x_m, c.scale), (None, Scale::Gravity));
}

#[test]
fn a_line_along_the_floor_tells_its_slope() {
    let dir = tempdir().unwrap();
    let calib = dir.path().join("my.calib.json");
    // 4 px up in 280: 0.82 degrees, each end read to half a pixel.
    let line = [
        "--gravity",
        "--floor-line",
        "20,220",
        "300,216",
        "--point-std-px",
        "0.5",
    ];
    ruler(&line).arg("--out").arg(&calib).assert().success().stdout(
        contains("floor line rises by 0.82 ± 0.14° to the right, against the picture's own")
            .and(contains("[300.00, 216.00] px, as given"))
            .and(contains("up         not given: the fall tells")),
    );
    assert_eq!(names(dir.path()), ["my.calib.json", "my.marks.png"]);
    let file: Value = serde_json::from_str(&fs::read_to_string(&calib).unwrap()).unwrap();
    assert_eq!(
        file["floor"],
        json!({"line_px": [[20.0, 220.0], [300.0, 216.0]], "line_std_px": 0.5})
    );
    // What nobody said is not in the file.
    for key in ["up_px", "up_std_deg", "gravity_m_s2", "origin_px"] {
        assert!(file.get(key).is_none(), "{key}: {file}");
    }
    // Against a given "up" its own doubt comes in: 0.3 degrees where none is given.
    ruler(&[&line[..], &["--up", "0,-1", "--gravity-m-s2", "9.803", "--out"]].concat())
        .arg(&calib)
        .assert()
        .success()
        .stdout(
            contains("rises by 0.82 ± 0.33° to the right, against \"up\"")
                .and(contains("up         0.00 ± 0.30° clockwise")),
        );
    let c = Calibration::read(&calib).unwrap();
    assert!(c.up_given && c.gravity_given && !c.floor.given);
    // Snapped to the floor's edge, which is level.
    let snapped = ruler(&[
        "--gravity",
        "--floor-line",
        "60,214",
        "300,225",
        "--snap=12",
        "--json",
    ])
    .assert()
    .success();
    let c = Calibration::parse(&String::from_utf8_lossy(&snapped.get_output().stdout), "out").unwrap();
    let line = c.floor.line.unwrap();
    assert!(
        (line.from.v_px - 220.0).abs() < 0.1 && (line.to.v_px - 220.0).abs() < 0.1,
        "{line:?}"
    );
    assert!(line.std_px < 0.1, "{line:?}");
}

#[test]
fn one_flag_is_enough_and_without_a_file_the_calibration_is_the_answer() {
    for (args, scale) in [
        (vec!["--gravity"], Scale::Gravity),
        (vec!["--ball-radius-m", "0.02"], Scale::Ball),
        (vec!["--gravity", "--ball-radius-m", "0.02"], Scale::Gravity),
    ] {
        let out = ruler(&args).assert().success();
        let c = Calibration::parse(&String::from_utf8_lossy(&out.get_output().stdout), "out").unwrap();
        assert_eq!((c.scale, c.image_size_px), (scale, Some((320, 240))));
    }
    let c = ruler(&MARKS)
        .args([
            "--held",
            "level",
            "--up-std-deg",
            "0.2",
            "--frame-rate-hz",
            "480",
            "--frame",
            "3",
            "--view",
            "top",
        ])
        .args([
            "--length-std-m",
            "0.001",
            "--point-std-px",
            "0.4",
            "--gravity-m-s2",
            "9.8",
        ])
        .assert()
        .success();
    let c = Calibration::parse(&String::from_utf8_lossy(&c.get_output().stdout), "out").unwrap();
    let std = c.up_std_rad.unwrap().to_degrees();
    let read = (0.4 * 2.0_f64.sqrt() / 280.0).to_degrees();
    assert!((std - 0.2_f64.hypot(read)).abs() < 1e-6, "{std}");
    assert_eq!((c.frame_rate_hz, c.gravity_m_s2), (Some(480.0), 9.8));
    assert_eq!(c.view, track::calibration::View::Top);
}

#[test]
fn marks_that_make_no_sense_are_refused_without_a_trace() {
    let with = |more: &[&'static str]| -> Vec<&str> { [&MARKS[..], more].concat() };
    refused(
        &["--from", "20,100", "--to", "20,100", "--length-m", "0.7"],
        &["same point", "far apart"],
    );
    refused(
        &["--from", "20,100", "--to", "2000,100", "--length-m", "0.7"],
        &["--to", "320x240", "column first"],
    );
    refused(
        &["--from", "-5,100", "--to", "300,100", "--length-m", "0.7"],
        &["--from: [-5, 100]", "outside the picture"],
    );
    refused(&["--from", "20,100", "--to", "300,100"], &["--length-m"]);
    refused(
        &["--from", "20", "--to", "300,100", "--length-m", "0.7"],
        &["U,V"],
    );
    refused(
        &["--from", "20,100", "--to", "300,100", "--length-m", "0"],
        &["above 0"],
    );
    refused(
        &[],
        &["no scale", "--from U,V --to U,V --length-m L", "--gravity"],
    );
    refused(&with(&["--gravity"]), &["cannot be used with"]);
    refused(&with(&["--edge", "20,100"]), &["--floor"]);
    refused(&with(&["--frame", "100000"]), &["no frame 100000", "0 to"]);
    refused(&with(&["--up", "0,0"]), &["direction"]);
    refused(
        &with(&["--lens", "no/such.json"]),
        &["no/such.json", "no such file"],
    );
    refused(&with(&["--length-std-m", "7"]), &["length_std_m"]);
    refused(
        &with(&["--floor-line", "20,220", "25,220"]),
        &["--floor-line", "5.0 px apart", "far apart"],
    );
    refused(
        &with(&["--floor-line", "220,20", "220,300"]),
        &["--floor-line: [220, 300]", "outside the picture", "column first"],
    );
    refused(&with(&["--floor-line", "20,220"]), &["--floor-line", "2 values"]);
    refused(
        &with(&["--floor-line", "1,2", "90,2", "--floor-line", "1,9", "90,9"]),
        &["multiple times"],
    );
    refused(&["--floor-line", "20,220", "300,220"], &["no scale"]);
    refused(
        &["--floor-line", "20,220", "300", "--gravity"],
        &["--floor-line", "expected U,V in pixels"],
    );
}

/// What `check` would find in the new file is told at once: centimetres given for metres, say.
#[test]
fn a_wrong_unit_is_warned_of() {
    let marks = ["--from", "20,100", "--to", "300,100", "--length-m"];
    ruler(&[&marks[..], &["700"]].concat())
        .assert()
        .success()
        .stderr(contains("warning: scale").and(contains("lengths are metres")));
    ruler(&[&marks[..], &["0.7"]].concat())
        .assert()
        .success()
        .stderr(contains("warning").not());
    // A line that runs up a wall, or row and column exchanged.
    ruler(&["--gravity", "--floor-line", "100,20", "102,220"])
        .assert()
        .success()
        .stderr(contains("warning: floor.line_px").and(contains("column first")));
}

#[test]
fn outputs_that_cannot_be_written_are_told_before_the_work() {
    let dir = tempdir().unwrap();
    fs::create_dir(dir.path().join("folder")).unwrap();
    ruler(&MARKS)
        .arg("--out")
        .arg(dir.path().join("folder"))
        .assert()
        .code(2)
        .stderr(contains("a folder has that name"));
    fs::write(dir.path().join("file"), "").unwrap();
    ruler(&MARKS)
        .arg("--out")
        .arg(dir.path().join("file/my.calib.json"))
        .assert()
        .code(2)
        .stderr(contains("where a folder is needed"));
    // A folder that is missing is made.
    let deep = dir.path().join("new/deep/my.calib.json");
    ruler(&MARKS).arg("--out").arg(&deep).assert().success();
    assert!(deep.exists());
}

/// A calibration that fits the clip, with changes.
fn calib(dir: &Path, changes: Value) -> PathBuf {
    let mut file = json!({
        "schema": "track.calib/1", "image_size_px": [320, 240],
        "scale": {"from_px": [20, 100], "to_px": [300, 100], "length_m": 0.7, "length_std_m": 0.0005, "point_std_px": 0.5},
        "origin_px": [20, 220], "origin_std_px": 0.5, "ball": {"radius_m": 0.02, "mass_kg": 0.2}
    });
    for (key, value) in changes.as_object().unwrap() {
        file[key] = value.clone();
    }
    let path = dir.join("my.calib.json");
    fs::write(&path, file.to_string()).unwrap();
    path
}

#[test]
fn check_says_everything_and_its_status_tells() {
    let dir = tempdir().unwrap();
    let check = |calib: &Path, video: Option<&Path>| {
        let mut command = track();
        command.args(["calibrate", "check"]).arg(calib).args(video);
        command.assert()
    };
    check(&calib(dir.path(), json!({})), None)
        .code(0)
        .stdout(contains("no problems, no remarks"))
        .stderr(is_empty());
    check(&calib(dir.path(), json!({})), Some(clip()))
        .code(0)
        .stdout(contains("no problems, 1 remark"));
    let wrong = json!({"image_size_px": [240, 320], "frame_rate_hz": 77, "radius": 3, "up_px": [0, 1],
                       "ball": {"radius_m": 0.02, "mass_kg": 200}});
    let mut assert = check(&calib(dir.path(), wrong), Some(clip())).code(1);
    for words in [
        "problems",
        "swapped",
        "77 Hz",
        "radius: found an unknown key",
        "points down",
        "kg/m³",
    ] {
        assert = assert.stdout(contains(words));
    }
    check(Path::new("no/such.json"), None)
        .code(2)
        .stdout(is_empty())
        .stderr(contains("no such file"));
    check(&calib(dir.path(), json!({})), Some(Path::new("no/such.mp4")))
        .code(2)
        .stderr(contains("no such file"));
    let text = dir.path().join("text.json");
    fs::write(&text, "{not json").unwrap();
    check(&text, None)
        .code(2)
        .stderr(contains("not readable as JSON"));
}

#[test]
fn show_writes_a_page_for_a_file_old_or_new() {
    let dir = tempdir().unwrap();
    let show = |calib: &Path| {
        let mut command = track();
        command.args(["calibrate", "show"]).arg(calib).arg(clip());
        command.assert()
    };
    let new = dir.path().join("new.calib.json");
    show(&new).success().stdout(contains("new.show.html"));
    assert_eq!(
        names(dir.path()),
        ["new.show.html"],
        "the calibration itself is the user's to save"
    );
    let page = fs::read_to_string(dir.path().join("new.show.html")).unwrap();
    assert!(page.contains("ball.mp4") && page.contains("data:image/jpeg;base64,"));
    show(&calib(dir.path(), json!({}))).success();
    show(&calib(dir.path(), json!({"image_size_px": [640, 480]})))
        .code(2)
        .stderr(contains("640x480").and(contains("320x240")));
    show(&calib(dir.path(), json!({"fps": 3})))
        .code(2)
        .stderr(contains("frame_rate_hz"));
}
