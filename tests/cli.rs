//! The built binary as its user calls it: exit statuses, what goes to stdout and what to stderr, and what is left on
//! the disk.

use crate::small::SCENE;
use assert_cmd::Command;
use assert_cmd::assert::Assert;
use predicates::prelude::*;
use predicates::str::{contains, is_empty, starts_with};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use tempfile::{TempDir, tempdir};
use track::frames::{Coding, Luma, Timing, VideoOptions, VideoWriter, open};
use track::simulate::{Scene, SimulatedRecording};

const BINARY: &str = env!("CARGO_BIN_EXE_track");

/// What each file of a measurement ends in.
const REPORTS: [&str; 4] = ["overlay.mp4", "points.csv", "report.html", "result.json"];

fn track() -> Command {
    let mut command = Command::new(BINARY);
    command.timeout(std::time::Duration::from_secs(300));
    command
}

/// `track VIDEO --calib CALIB`.
fn measure(video: &Path, calib: &Path) -> Command {
    let mut command = track();
    command.arg(video).arg("--calib").arg(calib);
    command
}

/// The rendered scene, made once for all tests: `ball.mp4`, `ball.calib.json`.
fn clip() -> &'static (PathBuf, PathBuf) {
    static CLIP: OnceLock<(PathBuf, PathBuf)> = OnceLock::new();
    CLIP.get_or_init(|| {
        let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join("cli");
        let recording = SimulatedRecording::new(&Scene::from_json(SCENE).unwrap()).unwrap();
        let written = track::simulate::write(&recording, "ball", &dir, |_| ()).unwrap();
        (written.video, written.calib)
    })
}

fn read_json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

/// The clip's calibration with `changes` on top, in `dir`.
fn calib_with(dir: &Path, changes: Value) -> PathBuf {
    let mut calib = read_json(&clip().1);
    for (key, value) in changes.as_object().unwrap() {
        calib[key] = value.clone();
    }
    let path = dir.join("changed.calib.json");
    fs::write(&path, calib.to_string()).unwrap();
    path
}

/// Everything below `dir`, sorted.
fn names(dir: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(dir)
        .map(|entries| {
            entries
                .map(|e| e.unwrap().file_name().into_string().unwrap())
                .collect()
        })
        .unwrap_or_default();
    names.sort();
    names
}

/// It could not run: status 2, `words` on stderr in an error of one voice, nothing on stdout.
fn refused(assert: Assert, words: &[&str]) {
    let mut assert = assert
        .code(2)
        .stdout(is_empty())
        .stderr(contains("panicked").not());
    for word in words {
        assert = assert.stderr(contains(*word));
    }
}

/// `track VIDEO --calib CALIB --out DIR` is refused with `words` and leaves no trace of DIR.
fn refused_without_trace(video: &Path, calib: &Path, words: &[&str]) {
    let dir = tempdir().unwrap();
    let out = dir.path().join("new/out");
    let assert = measure(video, calib).arg("--out").arg(&out).assert();
    refused(assert.stderr(starts_with("error: ")), words);
    assert_eq!(names(dir.path()), [""; 0], "something is left");
}

/// A recording that is refused, with the clip's own calibration.
fn refused_video(video: &Path, words: &[&str]) {
    let name = video.to_str().unwrap();
    refused_without_trace(video, &clip().1, &[&[name], words].concat());
}

/// A calibration that is refused.
fn refused_calib(text: &str, words: &[&str]) {
    let dir = tempdir().unwrap();
    let calib = dir.path().join("my.calib.json");
    fs::write(&calib, text).unwrap();
    refused_without_trace(&clip().0, &calib, &[&["my.calib.json"], words].concat());
}

/// A picture of noise about grey 100, the same for the same `seed`.
fn noise(width: usize, height: usize, seed: u64) -> Luma {
    // Knuth's MMIX generator; four of its bytes make a hump about as wide as a camera's noise.
    let mut state = seed;
    Luma::from_fn(width, height, |_, _| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let sum: u32 = state.to_be_bytes()[..4].iter().map(|&b| u32::from(b)).sum();
        (100 + sum / 64) as u8
    })
}

fn write_video(path: &Path, frames: &[Luma], rate_hz: f64, coding: Coding, index_first: bool) {
    let options = VideoOptions {
        timing: Timing::Constant,
        index_first,
        ..VideoOptions::new(rate_hz, coding)
    };
    let mut writer = VideoWriter::create_with(path, frames[0].width, frames[0].height, &options).unwrap();
    for frame in frames {
        writer.write(frame).unwrap();
    }
    writer.finish().unwrap();
}

const H264: Coding = Coding::H264 {
    crf: 14,
    gop: 12,
    b_frames: 2,
};

/// The clip's frames.
fn frames_of_clip() -> Vec<Luma> {
    let mut source = open(&clip().0).unwrap();
    let mut frames = Vec::new();
    while let Some(frame) = source.next_frame().unwrap() {
        frames.push(frame.luma);
    }
    frames
}

/// The clip's frames as numbered images in a folder, `dir/series`.
fn images_of_clip(dir: &Path) -> PathBuf {
    let folder = dir.join("series");
    fs::create_dir(&folder).unwrap();
    for (i, frame) in frames_of_clip().iter().enumerate() {
        let mut pgm = format!("P5\n{} {}\n255\n", frame.width, frame.height).into_bytes();
        pgm.extend(&frame.data);
        fs::write(folder.join(format!("frame_{i:04}.pgm")), pgm).unwrap();
    }
    folder
}

fn measured_json(video: &Path, calib: &Path) -> Value {
    let output = measure(video, calib).arg("--json").assert().code(0);
    serde_json::from_slice(&output.get_output().stdout).unwrap()
}

fn value(quantity: &Value) -> f64 {
    quantity["value"].as_f64().unwrap()
}

fn std_uncertainty(quantity: &Value) -> f64 {
    quantity["std_uncertainty"].as_f64().unwrap()
}

/// A result says what it was made from, and what it takes to draw its curves again.
#[test]
fn a_result_stands_alone() {
    let (video, calib) = clip();
    let result = measured_json(video, calib);
    let digest = |path: &Path| track::frames::digest::of_file(path).unwrap();
    assert_eq!(result["video"]["sha256"], digest(video));
    let used = &result["calibration"];
    assert_eq!(used["path"], calib.display().to_string());
    assert_eq!(used["sha256"], digest(calib));
    let given = read_json(calib);
    let scale = given["scale"]["metres_per_pixel"].as_f64().unwrap();
    assert!((value(&used["metres_per_pixel"]) / scale - 1.0).abs() < 1e-12);
    assert_eq!(used["origin_px"], given["origin_px"]);

    // With gravity, "up" and drag each arc's numbers give the places of its points.
    let gravity = value(&result["gravity_m_s2"]);
    let lean = value(&result["up"]["tilt_deg"]).to_radians();
    let drag = value(&result["drag_per_m"]);
    let arcs = result["arcs"].as_array().unwrap();
    assert!(arcs.len() > 1);
    let mut checked = 0;
    for point in result["track"]["points"].as_array().unwrap() {
        let Some(arc) = point["arc"].as_u64().map(|k| &arcs[k as usize]) else {
            continue;
        };
        let at = |key: &str| arc[key].as_f64().unwrap();
        let t = point["time_s"].as_f64().unwrap() - at("time_s");
        assert!(point["time_s"].as_f64().unwrap() <= at("to_s") + 1e-3);
        let speed = at("vx_m_s").hypot(at("vz_m_s"));
        let curve = |place: f64, velocity: f64, pull: f64| {
            place + velocity * t + 0.5 * (pull - drag * speed * velocity) * t * t
        };
        // x and z are turned so that the fall is along z.
        assert!(lean.abs() < 0.1);
        let off_x = curve(at("x_m"), at("vx_m_s"), 0.0) - point["x_m"].as_f64().unwrap();
        let off_z = curve(at("z_m"), at("vz_m_s"), -gravity) - point["z_m"].as_f64().unwrap();
        assert!(off_x.hypot(off_z) < 5e-4, "{off_x} {off_z} at {point}");
        checked += 1;
    }
    assert!(checked > 10);
}

// The command line itself.

#[test]
fn help_and_version_are_results() {
    for flag in ["--help", "-h"] {
        let help = track().arg(flag).assert().code(0).stderr(is_empty());
        help.stdout(
            contains("Usage: track")
                .and(contains("simulate"))
                .and(contains("--calib")),
        );
    }
    let build = track::Build::THIS;
    let version = format!("track {} ({})\n", build.version, build.commit);
    track()
        .arg("--version")
        .assert()
        .code(0)
        .stderr(is_empty())
        .stdout(version);
}

#[test]
fn usage_errors_have_status_2_and_name_what_is_wrong() {
    refused(track().assert(), &["<VIDEO>", "--calib", "--help"]);
    refused(track().arg("ball.mp4").assert(), &["--calib"]);
    refused(track().args(["--calib", "c.json"]).assert(), &["VIDEO"]);
    refused(
        track().args(["ball.mp4", "--calibre", "c.json"]).assert(),
        &["--calibre", "--calib"],
    );
    refused(track().args(["simulate", "scene.json"]).assert(), &["--out"]);
}

// Recordings that are none.

#[test]
fn a_missing_recording_is_refused() {
    refused_video(Path::new("no/such/clip.mp4"), &["no such file"]);
}

#[test]
fn a_folder_without_images_is_refused() {
    let dir = tempdir().unwrap();
    fs::write(dir.path().join("notes.txt"), "nothing").unwrap();
    refused_video(dir.path(), &["no images"]);
}

#[test]
fn an_empty_file_is_refused() {
    let dir = tempdir().unwrap();
    let path = dir.path().join("empty.mp4");
    fs::write(&path, "").unwrap();
    refused_video(&path, &["empty", "0 bytes"]);
}

#[test]
fn a_text_named_mp4_is_refused() {
    let dir = tempdir().unwrap();
    let path = dir.path().join("text.mp4");
    fs::write(&path, "Dear diary, today the ball bounced.\n".repeat(100)).unwrap();
    refused_video(&path, &["not a video"]);
}

#[test]
fn sound_alone_is_refused() {
    let dir = tempdir().unwrap();
    let path = dir.path().join("sound.wav");
    // 0.1 s of silence: mono, 8000 Hz, 16 bits.
    let samples = 1600_u32;
    let mut wav = b"RIFF".to_vec();
    wav.extend((36 + samples).to_le_bytes());
    wav.extend(b"WAVEfmt ");
    wav.extend(16_u32.to_le_bytes());
    wav.extend([1, 0, 1, 0]);
    wav.extend(8000_u32.to_le_bytes());
    wav.extend(16_000_u32.to_le_bytes());
    wav.extend([2, 0, 16, 0]);
    wav.extend(b"data");
    wav.extend(samples.to_le_bytes());
    wav.resize(wav.len() + samples as usize, 0);
    fs::write(&path, wav).unwrap();
    refused_video(&path, &["no video stream", "sound"]);
}

#[test]
fn a_cut_mp4_without_its_index_is_refused() {
    let dir = tempdir().unwrap();
    let whole = fs::read(&clip().0).unwrap();
    let path = dir.path().join("cut.mp4");
    fs::write(&path, &whole[..whole.len() * 6 / 10]).unwrap();
    refused_video(&path, &["moov", "cut short"]);
}

#[test]
fn a_cut_mp4_with_its_index_in_front_is_measured_as_far_as_it_goes() {
    let dir = tempdir().unwrap();
    let frames = frames_of_clip();
    let path = dir.path().join("cut.mp4");
    write_video(&path, &frames, 120.0, H264, true);
    let whole = fs::read(&path).unwrap();
    fs::write(&path, &whole[..whole.len() * 8 / 10]).unwrap();
    let output = measure(&path, &clip().1).arg("--json").assert().code(0);
    let output = output
        .stderr(contains("warning: file_cut_short").and(contains(format!("of {}", frames.len()))))
        .get_output()
        .clone();
    let result: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(result["status"], "measured");
    let read = result["video"]["frames"].as_u64().unwrap() as usize;
    assert!(read > frames.len() / 2 && read < frames.len(), "{read}");
}

#[test]
fn a_recording_of_one_frame_is_refused() {
    let dir = tempdir().unwrap();
    let path = dir.path().join("one.mp4");
    write_video(&path, &[noise(320, 240, 1)], 30.0, H264, false);
    refused_video(&path, &["1 frame"]);
}

#[test]
fn a_recording_without_a_ball_is_rejected_with_the_reason() {
    let dir = tempdir().unwrap();
    let path = dir.path().join("noise.mp4");
    let frames: Vec<Luma> = (0..40).map(|i| noise(320, 240, i)).collect();
    write_video(&path, &frames, 120.0, H264, false);
    let out = dir.path().join("out");
    let output = measure(&path, &clip().1)
        .arg("--json")
        .arg("--out")
        .arg(&out)
        .assert()
        .code(1);
    let output = output
        .stderr(contains("rejected: no ball was found"))
        .get_output()
        .clone();
    let result: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(result["status"], "rejected");
    assert!(result["reason"].as_str().unwrap().contains("no ball"));
    assert_eq!(result["bounces"], json!([]));
    assert_eq!(names(&out), REPORTS.map(|ending| format!("noise.{ending}")));
    assert_eq!(read_json(&out.join("noise.result.json")), result);
    // The table says so, too.
    let table = measure(&path, &clip().1).assert().code(1);
    table.stdout(contains("REJECTED")).stderr(contains("rejected: "));
}

// Calibrations that are none.

#[test]
fn a_missing_calibration_is_refused() {
    refused_without_trace(
        &clip().0,
        Path::new("no/such/calib.json"),
        &["no/such/calib.json", "calibration"],
    );
}

#[test]
fn a_calibration_for_another_size_is_refused() {
    let dir = tempdir().unwrap();
    let calib = calib_with(dir.path(), json!({"image_size_px": [640, 480]}));
    refused_without_trace(
        &clip().0,
        &calib,
        &["changed.calib.json", "640x480", "320x240", "scaled by 0.5"],
    );
}

#[test]
fn an_unknown_key_is_refused_with_the_nearest_known_one() {
    refused_calib(
        r#"{"schema": "track.calib/1", "scale": {"metres_per_pixel": 0.0025}, "frame_rate": 120}"#,
        &["frame_rate", "did you mean frame_rate_hz?"],
    );
    refused_calib(
        r#"{"schema": "track.calib/1", "scale": {"meters_per_pixel": 0.0025}}"#,
        &["scale.meters_per_pixel", "did you mean scale.metres_per_pixel?"],
    );
}

#[test]
fn nan_is_refused() {
    refused_calib(
        r#"{"schema": "track.calib/1", "scale": {"metres_per_pixel": NaN}}"#,
        &["NaN"],
    );
    refused_calib(
        r#"{"schema": "track.calib/1", "scale": {"metres_per_pixel": "NaN"}}"#,
        &["scale.metres_per_pixel", "NaN", "number"],
    );
}

#[test]
fn a_singular_homography_is_refused() {
    refused_calib(
        r#"{"schema": "track.calib/1", "scale": {"world_from_pixel": [[0.001, 0, 0], [0.002, 0, 0], [0, 0, 1]]}}"#,
        &["scale.world_from_pixel", "singular"],
    );
}

#[test]
fn a_calibration_that_is_not_json_is_refused() {
    refused_calib("metres_per_pixel = 0.0025\n", &["JSON", "line 1"]);
    refused_calib("", &["empty"]);
}

// Places that cannot be written to.

#[test]
fn a_file_in_place_of_the_output_folder_is_told_and_kept() {
    let dir = tempdir().unwrap();
    let file = dir.path().join("file");
    fs::write(&file, "mine").unwrap();
    for out in [file.clone(), file.join("below")] {
        let assert = measure(&clip().0, &clip().1).arg("--out").arg(&out).assert();
        refused(assert, &[out.to_str().unwrap(), "there is a file", "--out"]);
    }
    assert_eq!(fs::read(&file).unwrap(), b"mine");
    assert_eq!(names(dir.path()), ["file"]);
}

/// Runs `script` under sh, `$track`, `$video`, `$calib` and `$out` set, in a mount namespace of its own when it
/// `mounts`; there it is root, and what it mounts goes with it. `None` where the system grants no such namespace.
fn shell(script: &str, out: &Path, mounts: bool) -> Option<Assert> {
    const NAMESPACE: [&str; 3] = ["--user", "--map-root-user", "--mount"];
    let mut command = if mounts {
        let granted = Command::new("unshare")
            .args(NAMESPACE)
            .args(["mount", "-t", "tmpfs", "tmpfs"])
            .arg(out)
            .output();
        if !granted.is_ok_and(|o| o.status.success()) {
            println!("skipped: this system lets no test mount a file system of its own (unshare, mount)");
            return None;
        }
        let mut command = Command::new("unshare");
        command.args(NAMESPACE).arg("sh");
        command
    } else {
        Command::new("sh")
    };
    command.timeout(std::time::Duration::from_secs(300));
    let (video, calib) = clip();
    command.args(["-c", script]);
    command
        .env("track", BINARY)
        .env("video", video)
        .env("calib", calib)
        .env("out", out);
    Some(command.assert())
}

#[test]
fn a_read_only_output_folder_is_told() {
    let dir = tempdir().unwrap();
    let script =
        "mount -t tmpfs -o ro tmpfs \"$out\" && exec \"$track\" \"$video\" --calib \"$calib\" --out \"$out\"";
    if let Some(assert) = shell(script, dir.path(), true) {
        refused(
            assert,
            &[dir.path().to_str().unwrap(), "may not write there", "--out"],
        );
    }
}

#[test]
fn a_folder_without_permission_is_told() {
    use std::os::unix::fs::PermissionsExt as _;
    let dir = tempdir().unwrap();
    let out = dir.path().join("out");
    fs::create_dir(&out).unwrap();
    fs::set_permissions(&out, fs::Permissions::from_mode(0o555)).unwrap();
    if fs::write(out.join("probe"), "").is_ok() {
        println!("skipped: root may write everywhere");
        return;
    }
    let assert = measure(&clip().0, &clip().1).arg("--out").arg(&out).assert();
    refused(assert, &[out.to_str().unwrap(), "may not write there", "--out"]);
    assert_eq!(names(&out), [""; 0]);
}

/// Sizes in bytes of the files that the clip gives, the largest first.
fn report_sizes() -> Vec<u64> {
    let dir = tempdir().unwrap();
    let assert = measure(&clip().0, &clip().1)
        .arg("--out")
        .arg(dir.path())
        .assert();
    assert.code(0);
    let size = |ending| {
        fs::metadata(dir.path().join(format!("ball.{ending}")))
            .unwrap()
            .len()
    };
    let mut sizes = REPORTS.map(size).to_vec();
    sizes.sort_by(|a, b| b.cmp(a));
    sizes
}

/// Room for nothing; for the proof that a folder can be written to; for nearly all of the results.
#[test]
fn a_full_disk_is_told_and_nothing_is_left() {
    let sizes = report_sizes();
    let nearly_all = sizes.iter().sum::<u64>() - 3000;
    for size in [40_000, 70_000, nearly_all] {
        let dir = tempdir().unwrap();
        // nr_blocks counts pages of 4 kB.
        let script = format!(
            "mount -t tmpfs -o nr_blocks={} tmpfs \"$out\"
             \"$track\" \"$video\" --calib \"$calib\" --out \"$out\"; status=$?
             ls -A \"$out\" >&2 && echo end-of-list >&2
             exit $status",
            size / 4096
        );
        let Some(assert) = shell(&script, dir.path(), true) else {
            return;
        };
        let name = dir.path().to_str().unwrap();
        let full = contains("disk is full").or(contains("No space left"));
        // The list of what is left, between the error and its end, is empty.
        let nothing_left = predicate::str::is_match("error: [^\n]*\nend-of-list\n$").unwrap();
        refused(assert.stderr(full).stderr(nothing_left), &[name]);
    }
}

/// As on a full disk, but it takes no rights: the shell bounds the size of a file.
#[test]
fn a_write_that_fails_half_way_leaves_nothing() {
    // Blocks of 512 bytes: none; enough for the proof that a folder can be written to; too few for the largest file.
    for blocks in [0, 130, report_sizes()[0] / 512 - 1] {
        let dir = tempdir().unwrap();
        let out = dir.path().join("out");
        // Without its signal the bound is an error of write().
        let script = format!(
            "trap '' XFSZ; ulimit -f {blocks}; exec \"$track\" \"$video\" --calib \"$calib\" --out \"$out\""
        );
        let assert = shell(&script, &out, false).unwrap();
        refused(assert, &[out.to_str().unwrap(), "cannot write"]);
        assert_eq!(names(dir.path()), [""; 0], "{blocks} blocks");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_result_that_stdout_does_not_take_is_an_error() {
    let out = tempdir().unwrap();
    for arguments in ["", "--json"] {
        let script = format!("exec \"$track\" \"$video\" --calib \"$calib\" {arguments} > /dev/full");
        let assert = shell(&script, out.path(), false).unwrap();
        refused(assert, &["could not be written to stdout", "No space left"]);
    }
    fs::write(out.path().join("ball.scene.json"), SCENE).unwrap();
    let script = "exec \"$track\" simulate \"$out/ball.scene.json\" --explain --out \"$out\" > /dev/full";
    let assert = shell(script, out.path(), false).unwrap();
    refused(assert, &["could not be written to stdout", "No space left"]);
}

#[test]
fn a_reader_that_has_seen_enough_is_no_error() {
    let dir = tempdir().unwrap();
    let script = "{ \"$track\" \"$video\" --calib \"$calib\"; echo status $? >&2; } | true";
    let assert = shell(script, dir.path(), false).unwrap();
    assert
        .code(0)
        .stderr(contains("status 0").and(contains("panicked").not()));
}

#[test]
fn results_do_not_replace_what_they_must_not() {
    let dir = tempdir().unwrap();
    // A folder where a report should go, and old results beside it.
    fs::create_dir(dir.path().join("ball.report.html")).unwrap();
    fs::write(dir.path().join("ball.result.json"), "old").unwrap();
    let assert = measure(&clip().0, &clip().1)
        .arg("--out")
        .arg(dir.path())
        .assert();
    refused(assert, &["ball.report.html", "folder has that name"]);
    assert_eq!(names(dir.path()), ["ball.report.html", "ball.result.json"]);
    assert_eq!(fs::read(dir.path().join("ball.result.json")).unwrap(), b"old");
    // A folder where the overlay should go.
    let dir = tempdir().unwrap();
    fs::create_dir(dir.path().join("ball.overlay.mp4")).unwrap();
    let assert = measure(&clip().0, &clip().1)
        .arg("--out")
        .arg(dir.path())
        .assert();
    refused(assert, &["ball.overlay.mp4"]);
    assert_eq!(names(dir.path()), ["ball.overlay.mp4"]);
}

// Folders of images.

#[test]
fn a_folder_of_images_needs_a_frame_rate() {
    let dir = tempdir().unwrap();
    let folder = images_of_clip(dir.path());
    refused_without_trace(
        &folder,
        &clip().1,
        &["series", "no time stamps", "\"frame_rate_hz\"", "ball.calib.json"],
    );
}

#[test]
fn a_folder_of_images_with_a_frame_rate_is_measured_as_the_video_is() {
    let dir = tempdir().unwrap();
    let folder = images_of_clip(dir.path());
    let calib = calib_with(dir.path(), json!({"frame_rate_hz": 120}));
    let out = dir.path().join("out");
    let output = measure(&folder, &calib)
        .arg("--json")
        .arg("--out")
        .arg(&out)
        .assert()
        .code(0);
    let images: Value = serde_json::from_slice(&output.get_output().stdout).unwrap();
    let video = measured_json(&clip().0, &clip().1);
    assert_eq!(images["video"]["time_source"], "calibration");
    assert_eq!(video["video"]["time_source"], "stamps");
    for key in ["gravity_m_s2", "x0_m", "x_m"] {
        let (a, b) = (value(&images[key]), value(&video[key]));
        assert!((a - b).abs() < std_uncertainty(&video[key]), "{key}: {a} and {b}");
    }
    assert_eq!(names(&out), REPORTS.map(|ending| format!("series.{ending}")));
}

// A good recording.

#[test]
fn a_good_recording_is_measured_and_every_file_written() {
    let dir = tempdir().unwrap();
    let out = dir.path().join("deep/out");
    let assert = measure(&clip().0, &clip().1)
        .arg("--out")
        .arg(&out)
        .assert()
        .code(0);
    let told = REPORTS.iter().all(|ending| {
        contains(format!("wrote {}", out.join(format!("ball.{ending}")).display()))
            .eval(&String::from_utf8_lossy(&assert.get_output().stderr))
    });
    assert!(told, "each file is named on stderr");
    // The table for people, and nothing else, on stdout.
    let words = contains("restitution")
        .and(contains("gravity"))
        .and(contains("x0"));
    assert.stdout(
        starts_with("file")
            .and(words)
            .and(contains("warning:").not())
            .and(contains("wrote").not()),
    );
    assert_eq!(names(&out), REPORTS.map(|ending| format!("ball.{ending}")));
    for ending in REPORTS {
        let path = out.join(format!("ball.{ending}"));
        assert!(fs::metadata(&path).unwrap().len() > 1000, "{ending}");
    }
    assert!(
        fs::read_to_string(out.join("ball.points.csv"))
            .unwrap()
            .starts_with("frame,")
    );
    assert!(
        fs::read_to_string(out.join("ball.report.html"))
            .unwrap()
            .contains("</html>")
    );
    assert_eq!(open(&out.join("ball.overlay.mp4")).unwrap().info().width_px, 320);
    // Again, over the old files.
    measure(&clip().0, &clip().1)
        .arg("--out")
        .arg(&out)
        .assert()
        .code(0);
    assert_eq!(names(&out).len(), REPORTS.len());
}

/// The truth of the scene: e = 0.78; mu = 0.07; drop of 0.2 m at 1.2 m/s.
#[test]
fn the_json_holds_the_contract_and_the_truth() {
    let dir = tempdir().unwrap();
    let output = measure(&clip().0, &clip().1)
        .arg("--json")
        .arg("--out")
        .arg(dir.path())
        .assert()
        .code(0);
    let result: Value = serde_json::from_slice(&output.get_output().stdout).unwrap();
    assert_eq!(result, read_json(&dir.path().join("ball.result.json")));
    holds_the_contract(&result);
    assert_eq!(result["schema"], "track.result/1");
    assert_eq!(result["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(result["commit"], track::Build::THIS.commit);
    assert_eq!(result["status"], "measured");
    assert_eq!(result["reason"], Value::Null);
    assert_eq!(result["video"]["width_px"], 320);
    assert_eq!(result["x_source"], "observed");
    let bounces = result["bounces"].as_array().unwrap();
    assert_eq!(bounces.len(), 2);
    for bounce in bounces {
        assert!((value(&bounce["restitution"]) - 0.78).abs() < 0.003, "{bounce}");
        assert!(value(&bounce["incident"]["vz_m_s"]) < 0.0);
        assert!(value(&bounce["rebound"]["vz_m_s"]) > 0.0);
    }
    assert!((value(&bounces[0]["friction"]) - 0.07).abs() < 0.01);
    let truth = read_json(&clip().0.with_extension("truth.json"));
    for key in ["x0_m", "x_m"] {
        let error_m = value(&result[key]) - truth[key].as_f64().unwrap();
        assert!(error_m.abs() < 0.5e-3, "{key} is off by {error_m} m");
    }
}

fn holds_the_contract(result: &Value) {
    let has = |value: &Value, keys: &[&str]| {
        for key in keys {
            assert!(value.get(key).is_some(), "no {key} in {value}");
        }
    };
    has(
        result,
        &[
            "schema",
            "version",
            "commit",
            "status",
            "reason",
            "video",
            "track",
            "gravity_m_s2",
            "bounces",
            "x0_m",
            "x_m",
            "x_source",
            "models",
            "warnings",
        ],
    );
    has(
        &result["video"],
        &[
            "path",
            "width_px",
            "height_px",
            "frames",
            "frame_rate_hz",
            "duration_s",
            "time_source",
        ],
    );
    has(
        &result["track"],
        &["method", "detected", "centre_std_px", "radius_px", "points"],
    );
    has(
        &result["track"]["points"][0],
        &["frame", "time_s", "u_px", "v_px", "x_m", "z_m", "used"],
    );
    has(
        &result["bounces"][0],
        &[
            "time_s",
            "x_m",
            "incident",
            "rebound",
            "restitution",
            "tangential_ratio",
            "friction",
            "tangential_restitution",
            "spin_in_m_s",
            "spin_out_m_s",
            "azimuth_deg",
        ],
    );
    for leg in ["incident", "rebound"] {
        has(&result["bounces"][0][leg], &["vx_m_s", "vz_m_s", "angle_deg"]);
    }
    has(&result["models"], &["mu_e", "e_e", "preferred"]);
    has(&result["models"]["mu_e"], &["restitution", "friction", "regime"]);
    has(
        &result["models"]["e_e"],
        &["restitution", "tangential_restitution", "regime"],
    );
    has(&result["x0_m"], &["value", "std_uncertainty"]);
    for warning in result["warnings"].as_array().unwrap() {
        has(warning, &["code", "message"]);
    }
}

/// The same frames with left and right swapped.
fn mirrored(dir: &TempDir) -> (PathBuf, PathBuf) {
    let mut frames = frames_of_clip();
    for frame in &mut frames {
        for row in frame.data.chunks_mut(frame.width) {
            row.reverse();
        }
    }
    let video = dir.path().join("leftward.mkv");
    write_video(&video, &frames, 120.0, Coding::Lossless, false);
    let origin = &read_json(&clip().1)["origin_px"];
    let (u, v) = (origin[0].as_f64().unwrap(), origin[1].as_f64().unwrap());
    let last = frames[0].width as f64 - 1.0;
    let calib = calib_with(dir.path(), json!({"origin_px": [last - u, v]}));
    (video, calib)
}

#[test]
fn leftward_is_as_good_as_rightward() {
    let dir = tempdir().unwrap();
    let (video, calib) = mirrored(&dir);
    let (left, right) = (measured_json(&video, &calib), measured_json(&clip().0, &clip().1));
    let same = |name: &str, a: &Value, b: &Value| {
        let difference = (value(a) - value(b)).abs();
        let std = std_uncertainty(a).max(std_uncertainty(b));
        assert!(difference <= std, "{name}: {a} leftward, {b} rightward");
    };
    for key in ["gravity_m_s2", "x0_m", "x_m"] {
        same(key, &left[key], &right[key]);
    }
    let bounces = |result: &Value| result["bounces"].as_array().unwrap().clone();
    assert_eq!(bounces(&left).len(), 2);
    for (a, b) in bounces(&left).iter().zip(&bounces(&right)) {
        // A bounce that does not slide has no friction, but one that it is at least.
        let friction = if a["friction"].is_null() {
            "friction_at_least"
        } else {
            "friction"
        };
        for key in ["time_s", "x_m", "restitution", "tangential_ratio", friction] {
            same(key, &a[key], &b[key]);
        }
        assert_eq!(a["regime"], b["regime"]);
        for leg in ["incident", "rebound"] {
            for key in ["vx_m_s", "vz_m_s", "angle_deg"] {
                same(key, &a[leg][key], &b[leg][key]);
            }
        }
    }
}

// The other command.

#[test]
fn simulate_writes_what_measuring_needs() {
    let dir = tempdir().unwrap();
    let scene = dir.path().join("tiny.scene.json");
    fs::write(&scene, SCENE).unwrap();
    let out = dir.path().join("out");
    let simulate = || {
        let mut command = track();
        command.arg("simulate").arg(&scene).arg("--out").arg(&out);
        command
    };
    simulate()
        .assert()
        .code(0)
        .stderr(is_empty())
        .stdout(contains("tiny.mp4"));
    assert_eq!(names(&out), ["tiny.calib.json", "tiny.mp4", "tiny.truth.json"]);
    simulate()
        .arg("--explain")
        .assert()
        .code(0)
        .stdout(contains("drag").and(contains("tolerance")));
    measure(&out.join("tiny.mp4"), &out.join("tiny.calib.json"))
        .assert()
        .code(0);
}

#[test]
fn simulate_refuses_bad_scenes_and_places() {
    let dir = tempdir().unwrap();
    let scene = dir.path().join("bad.scene.json");
    let simulate = |out: &Path| track().arg("simulate").arg(&scene).arg("--out").arg(out).assert();
    let out = dir.path().join("out");
    refused(simulate(&out), &["bad.scene.json", "cannot read"]);
    fs::write(&scene, "{").unwrap();
    refused(simulate(&out), &["bad.scene.json", "JSON", "line 1"]);
    fs::write(&scene, SCENE.replace("restitution", "restitutoin")).unwrap();
    refused(
        simulate(&out),
        &["restitutoin", "did you mean contact.restitution?"],
    );
    assert_eq!(names(dir.path()), ["bad.scene.json"]);
    fs::write(&scene, SCENE).unwrap();
    refused(simulate(&scene), &["bad.scene.json", "cannot write"]);
    assert_eq!(names(dir.path()), ["bad.scene.json"]);
}

#[test]
fn bare_track_shows_its_help() {
    let out = track().assert().code(2);
    out.stderr(contains("Usage: track").and(contains("simulate")));
}

#[test]
fn a_mistyped_command_is_told() {
    for (word, meant) in [
        ("simluate", "did you mean simulate?"),
        ("calibrat", "did you mean calibrate?"),
        (
            "weather",
            "commands: batch, calibrate, completions, cost, fit, man, points, review, simulate",
        ),
    ] {
        let out = track().args([word, "scene.json"]).assert().code(2);
        out.stdout(is_empty())
            .stderr(starts_with(format!("error: there is no command \"{word}\"")).and(contains(meant)));
    }
    // What looks like a file is a recording.
    let out = track().arg("ball.mp4").assert().code(2);
    out.stderr(contains("--calib"));
}

#[test]
fn shells_complete_what_there_is() {
    for shell in ["bash", "zsh", "fish"] {
        let out = track().args(["completions", shell]).assert().success();
        out.stdout(contains("simulate").and(contains("calib")))
            .stderr(is_empty());
    }
    let out = track().args(["completions", "dos"]).assert().code(2);
    out.stderr(contains("bash"));
}

#[test]
fn each_command_has_a_manual_page() {
    let dir = tempdir().unwrap();
    let pages = dir.path().join("man1");
    track().arg("man").arg(&pages).assert().success();
    for (name, words) in [
        ("track.1", "bouncing ball"),
        ("track-batch.1", "series"),
        ("track-calibrate-ruler.1", "ruler"),
        ("track-simulate.1", "effects"),
    ] {
        let text = fs::read_to_string(pages.join(name)).unwrap();
        assert!(text.starts_with(".ie") && text.contains(words), "{name}: {text}");
    }
    assert!(!pages.join("track-help.1").exists());
}
