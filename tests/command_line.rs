//! What the program says and how much, what it replaces, what it leaves behind.

use crate::small::SCENE;
use assert_cmd::Command;
use predicates::prelude::*;
use predicates::str::{contains, is_empty, starts_with};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use tempfile::tempdir;

const BINARY: &str = env!("CARGO_BIN_EXE_track");

fn track(arguments: &[&str]) -> Command {
    let mut command = Command::new(BINARY);
    command
        .timeout(std::time::Duration::from_secs(300))
        .args(arguments);
    command
}

/// The folder of the rendered scene: `ball.mp4`, `ball.calib.json`, `ball.truth.json`, made by the program itself.
fn rendered() -> &'static Path {
    static DIR: OnceLock<PathBuf> = OnceLock::new();
    DIR.get_or_init(|| {
        let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join("command_line");
        let _ = fs::remove_dir_all(&dir);
        fs::create_dir_all(&dir).unwrap();
        render(&dir, &[]).success();
        dir
    })
}

/// `track simulate` of the scene into `dir`.
fn render(dir: &Path, more: &[&str]) -> assert_cmd::assert::Assert {
    let scene = dir.join("ball.scene.json");
    fs::write(&scene, SCENE).unwrap();
    let (scene, out) = (scene.to_str().unwrap(), dir.to_str().unwrap());
    track(&["simulate", scene, "--out", out]).args(more).assert()
}

fn path_of(dir: &Path, name: &str) -> String {
    dir.join(name).to_str().unwrap().to_owned()
}

fn names(dir: &Path) -> Vec<String> {
    let entries = fs::read_dir(dir).unwrap();
    let mut names: Vec<String> = entries
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn quiet_leaves_the_result_and_the_warnings() {
    let dir = tempdir().unwrap();
    let (video, calib) = (
        path_of(rendered(), "ball.mp4"),
        path_of(rendered(), "ball.calib.json"),
    );
    let measure = |flags: &[&str]| {
        let out = path_of(dir.path(), "out");
        let output = track(&[&video, "--calib", &calib, "--out", &out])
            .args(flags)
            .assert()
            .success();
        let text = |bytes: &[u8]| String::from_utf8(bytes.to_owned()).unwrap();
        (
            text(&output.get_output().stdout),
            text(&output.get_output().stderr),
        )
    };
    let (usual, quiet, verbose) = (measure(&[]), measure(&["--quiet"]), measure(&["-v"]));
    assert!(
        usual.0 == quiet.0 && usual.0 == verbose.0,
        "the result is the same"
    );
    assert!(
        usual.1.contains("warning: scale_uncertainty_unknown") && usual.1.contains("wrote "),
        "{}",
        usual.1
    );
    let is_warning = |line: &str| line.starts_with("warning: ");
    assert!(
        quiet.1.lines().all(is_warning) && quiet.1.contains("scale_uncertainty_unknown"),
        "{}",
        quiet.1
    );
    for words in [
        "reading",
        "accuracy standard",
        "surveying",
        "fitting",
        "frames in use",
    ] {
        assert!(
            verbose.1.contains(words) && !usual.1.contains(words),
            "{words}: {}",
            verbose.1
        );
    }
    // Before the command too, and not both.
    let out = path_of(dir.path(), "sim");
    let scene = path_of(rendered(), "ball.scene.json");
    track(&["-q", "simulate", &scene, "--out", &out])
        .assert()
        .success()
        .stderr(is_empty());
    track(&["-v", "simulate", &scene, "--out", &out])
        .assert()
        .success()
        .stderr(contains("320 × 240 px"));
    track(&["-q", "-v", "fit", "x.csv"])
        .assert()
        .code(2)
        .stderr(contains("cannot be used with"));
    track(&["-q", "simluate"])
        .assert()
        .code(2)
        .stderr(contains("did you mean simulate?"));
}

/// A terminal by `script`, of util-linux; where it is not there, or has no terminal to give (a chroot without /dev/pts), nothing
/// can be seen of colours.
#[cfg(target_os = "linux")]
#[test]
fn colours_are_for_terminals_that_want_them() {
    let terminal = Command::new("script")
        .args(["-qec", "true", "/dev/null"])
        .output();
    if !terminal.is_ok_and(|output| output.status.success()) {
        return;
    }
    let error = |variable: Option<&str>| {
        let mut shell = Command::new("script");
        shell.args(["-qec", &format!("{BINARY} fit no-such.csv"), "/dev/null"]);
        shell.env_remove("NO_COLOR").env_remove("CI").env("TERM", "xterm");
        variable.map(|name| shell.env(name, "1"));
        shell
            .output()
            .ok()
            .map(|output| String::from_utf8_lossy(&output.stdout).into_owned())
    };
    let Some(coloured) = error(None) else { return };
    assert!(
        coloured.contains("\u{1b}[31merror:\u{1b}[0m no-such.csv"),
        "{coloured:?}"
    );
    let plain = error(Some("NO_COLOR")).unwrap();
    assert!(plain.starts_with("error: no-such.csv"), "{plain:?}");
    track(&["fit", "no-such.csv"])
        .assert()
        .code(2)
        .stderr(starts_with("error: no-such.csv"));
}

#[test]
fn simulate_replaces_what_it_made_and_nothing_else() {
    let dir = tempdir().unwrap();
    render(dir.path(), &[]).success();
    render(dir.path(), &[]).success();
    let calib = dir.path().join("ball.calib.json");
    let made = fs::read_to_string(&calib).unwrap();
    let truth: Value =
        serde_json::from_slice(&fs::read(dir.path().join("ball.truth.json")).unwrap()).unwrap();
    let video = dir.path().join("ball.mp4");
    assert_eq!(
        truth["made_by"]["files"]["ball.mp4"],
        track::frames::digest::of_file(&video).unwrap()
    );
    // Somebody corrects the radius: the file is theirs now.
    let edited = made.replace("0.02", "0.021");
    assert_ne!(edited, made);
    fs::write(&calib, &edited).unwrap();
    render(dir.path(), &[]).code(2).stdout(is_empty()).stderr(
        contains("ball.calib.json would be replaced")
            .and(contains("--force"))
            .and(contains("ball.mp4 would").not()),
    );
    assert_eq!(fs::read_to_string(&calib).unwrap(), edited);
    fs::write(&calib, &made).unwrap();
    // A recording of that name that is somebody's own.
    fs::write(&video, "a recording").unwrap();
    render(dir.path(), &[])
        .code(2)
        .stderr(contains("ball.mp4 would be replaced"));
    assert_eq!(fs::read(&video).unwrap(), b"a recording");
    render(dir.path(), &["--force"]).success();
    assert!(fs::metadata(&video).unwrap().len() > 1000);
    render(dir.path(), &[]).success();
}

#[test]
fn calibrate_replaces_what_it_made_and_nothing_else() {
    let dir = tempdir().unwrap();
    let video = path_of(rendered(), "ball.mp4");
    let calib = path_of(dir.path(), "my.calib.json");
    let ruler = |to: &str, more: &[&str]| {
        let marks = ["--from", "20,20", "--to", to, "--length-m", "0.5"];
        track(&["calibrate", "ruler", &video, "--out", &calib])
            .args(marks)
            .args(more)
            .assert()
    };
    ruler("220,20", &[]).success();
    ruler("240,20", &[]).success();
    assert_eq!(names(dir.path()), ["my.calib.json", "my.marks.png"]);
    let ours = fs::read_to_string(&calib).unwrap();
    let by_hand = r#"{"schema": "track.calib/1", "scale": {"metres_per_pixel": 0.0025}}"#;
    fs::write(&calib, by_hand).unwrap();
    ruler("220,20", &[])
        .code(2)
        .stderr(contains("my.calib.json").and(contains("--force")));
    assert_eq!(fs::read_to_string(&calib).unwrap(), by_hand);
    // A file that was made, and then measured with, is still the program's.
    fs::write(&calib, &ours).unwrap();
    track(&[&video, "--calib", &calib]).assert().success();
    fs::write(dir.path().join("my.marks.png"), "my picture").unwrap();
    ruler("220,20", &[]).code(2).stderr(contains("my.marks.png"));
    ruler("220,20", &["--force"]).success();
    // The page.
    let show = |more: &[&str]| track(&["calibrate", "show", &calib, &video]).args(more).assert();
    show(&[]).success();
    show(&[]).success();
    fs::write(dir.path().join("my.show.html"), "<p>mine").unwrap();
    show(&[])
        .code(2)
        .stderr(contains("my.show.html").and(contains("--force")));
    show(&["--force"]).success();
    // The page of a review.
    let page = path_of(dir.path(), "my.review.html");
    let review = |more: &[&str]| track(&["review", &video, "--out", &page]).args(more).assert();
    review(&[]).success();
    review(&[]).success();
    fs::write(&page, "<p>mine").unwrap();
    review(&[])
        .code(2)
        .stderr(contains("my.review.html").and(contains("--force")));
    review(&["--force"]).success();
}

/// Told to end in the middle of a recording, `simulate` takes along what stands under a temporary name.
#[cfg(target_os = "linux")]
#[test]
fn an_interrupted_simulation_leaves_nothing() {
    use std::os::unix::process::ExitStatusExt as _;
    let dir = tempdir().unwrap();
    let scene = dir.path().join("long.scene.json");
    fs::write(&scene, SCENE.replace("\"tail_s\": 0.1", "\"tail_s\": 60")).unwrap();
    let out = dir.path().join("out");
    let mut process = std::process::Command::new(BINARY)
        .arg("simulate")
        .arg(&scene)
        .arg("--out")
        .arg(&out)
        .spawn()
        .unwrap();
    let is_part = |name: &String| name.ends_with(".part");
    while !(out.is_dir() && names(&out).iter().any(is_part)) {
        assert_eq!(
            process.try_wait().unwrap(),
            None,
            "it ended before it was told to"
        );
        std::thread::yield_now();
    }
    // Not by `kill`, which is a program that not every system has.
    let child = rustix::process::Pid::from_child(&process);
    rustix::process::kill_process(child, rustix::process::Signal::TERM).unwrap();
    assert_eq!(
        process.wait().unwrap().signal(),
        Some(15),
        "a shell sees what ended it"
    );
    assert_eq!(names(&out), [""; 0]);
}

#[test]
fn names_with_line_feeds_stay_on_their_line() {
    let dir = tempdir().unwrap();
    let odd = dir.path().join("a\nwarning: b\u{1b}[2J.mp4");
    fs::copy(rendered().join("ball.mp4"), &odd).unwrap();
    let calib = path_of(rendered(), "ball.calib.json");
    let out = path_of(dir.path(), "out");
    let output = track(&[odd.to_str().unwrap(), "--calib", &calib, "--out", &out])
        .assert()
        .success();
    let output = output
        .stdout(contains("\\nwarning: b\\u{1b}[2J.mp4\"\n"))
        .stderr(contains("a\\nwarning: b\\u{1b}[2J.report.html"));
    for text in [&output.get_output().stdout, &output.get_output().stderr] {
        let text = String::from_utf8_lossy(text);
        assert!(
            !text.contains('\u{1b}') && !text.lines().any(|l| l.starts_with("warning: b")),
            "{text}"
        );
    }
    let missing = dir.path().join("no\nsuch.mp4");
    let output = track(&[missing.to_str().unwrap(), "--calib", &calib])
        .assert()
        .code(2);
    output.stderr(contains("no\\nsuch.mp4").and(contains("no such file")));
    // In a batch: its table, its lines.
    let lab = path_of(dir.path(), "lab");
    let output = track(&["batch", dir.path().to_str().unwrap(), "--out", &lab])
        .assert()
        .code(1);
    let output = output.stdout(contains("failed \"a\\nwarning: b"));
    let told = String::from_utf8_lossy(&output.get_output().stderr).into_owned();
    assert!(!told.lines().any(|l| l.starts_with("warning: b")), "{told}");
}

#[test]
fn a_missing_recording_of_a_manifest_is_said_as_that() {
    let dir = tempdir().unwrap();
    let manifest = path_of(dir.path(), "all.csv");
    fs::write(&manifest, "video,group\nnone.mp4,a\n").unwrap();
    let lab = path_of(dir.path(), "lab");
    let output = track(&["batch", "--manifest", &manifest, "--out", &lab])
        .assert()
        .code(1);
    output.stdout(
        contains("failed none: there is no recording")
            .and(contains("none.mp4; check its name in the manifest"))
            .and(contains("calibration").not()),
    );
}

#[test]
fn too_few_equations_are_too_few_for_aicc() {
    let dir = tempdir().unwrap();
    let series = path_of(dir.path(), "one.csv");
    let columns = "incident_vx_m_s,incident_vz_m_s,rebound_vx_m_s,rebound_vz_m_s";
    fs::write(&series, format!("{columns}\n1,-2,0.8,1.6\n")).unwrap();
    let output = track(&["fit", &series, "--json"]).assert().success();
    let fit: Value = serde_json::from_slice(&output.get_output().stdout).unwrap();
    let reason = fit["groups"][0]["reason"].as_str().unwrap();
    assert!(
        reason.contains("mu_e: 2 equations are too few for AICc, which takes 4 for 2 parameters"),
        "{reason}"
    );
}

#[test]
fn the_reasons_of_points_are_codes() {
    let dir = tempdir().unwrap();
    // On its bench the ball is seen, but does not fly.
    let scene = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/fixtures/scenes/steel_ball.scene.json"
    );
    track(&["simulate", scene, "--out", dir.path().to_str().unwrap()])
        .assert()
        .success();
    let (video, calib) = (
        path_of(dir.path(), "steel_ball.mp4"),
        path_of(dir.path(), "steel_ball.calib.json"),
    );
    let out = path_of(dir.path(), "out");
    track(&[&video, "--calib", &calib, "--out", &out, "--formats", "csv"])
        .assert()
        .success();
    let mut rows = csv::Reader::from_path(Path::new(&out).join("steel_ball.points.csv")).unwrap();
    let header = rows.headers().unwrap().clone();
    let column = |name: &str| header.iter().position(|h| h == name).unwrap();
    let (used, reason, off) = (column("used"), column("reason"), column("off_arc_m"));
    let mut unused = 0;
    for row in rows.records().map(Result::unwrap) {
        match &row[used] {
            "true" => assert_eq!((&row[reason], &row[off]), ("", "")),
            _ => {
                unused += 1;
                assert!(
                    ["not_free", "contact", "off_arc"].contains(&&row[reason]),
                    "{row:?}"
                );
                assert_eq!(
                    &row[reason] == "off_arc",
                    row[off].parse::<f64>().is_ok(),
                    "{row:?}"
                );
            }
        }
    }
    assert!(unused > 0);
}
