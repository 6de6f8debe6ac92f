//! `track batch` as its user calls it: what it takes, what it measures again, what it leaves when it or a recording is killed,
//! hangs, or finds no room.

use assert_cmd::Command;
use predicates::prelude::*;
use predicates::str::contains;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant, SystemTime};
use tempfile::{TempDir, tempdir};
use track::frames::{Coding, Luma, VideoOptions, VideoWriter};
use track::simulate::{Scene, SimulatedRecording};

const BINARY: &str = env!("CARGO_BIN_EXE_track");

/// Small pictures and one bounce, so that a measurement takes part of a second.
fn scene(seed: usize, speed_m_s: f64) -> String {
    let drop_m = 0.06 + 0.05 * seed as f64;
    format!(
        r#"{{"schema": "track.scene/1", "seed": {seed},
            "ball": {{"radius_m": 0.02, "mass_kg": 0.2, "inertia_factor": 0.4}},
            "contact": {{"model": "mu_e", "restitution": 0.78, "friction": 0.07}},
            "launch": {{"drop_height_m": {drop_m}, "speed_m_s": {speed_m_s}}},
            "camera": {{"image_size_px": [256, 160], "frame_rate_hz": 120, "exposure_s": 0.0005,
                       "metres_per_pixel": 0.0025, "origin_px": [20, 145], "noise_grey": 2}},
            "stop": {{"bounces": 1, "tail_s": 0.12}}}}"#
    )
}

const CLIPS: [&str; 3] = ["a", "b", "c"];

/// Three clips with their calibrations, rendered into a folder of this name.
fn rendered(folder: &str, speed_m_s: f64) -> PathBuf {
    let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join(folder);
    let _ = fs::remove_dir_all(&dir);
    for (i, name) in CLIPS.iter().enumerate() {
        let scene = Scene::from_json(&scene(i + 1, speed_m_s)).unwrap();
        let recording = SimulatedRecording::new(&scene).unwrap();
        track::simulate::write(&recording, name, &dir, |_| ()).unwrap();
    }
    dir
}

/// A folder of one's own with clips of launched balls, next to `out`.
fn lab() -> (TempDir, PathBuf, PathBuf) {
    static DIR: OnceLock<PathBuf> = OnceLock::new();
    lab_of(DIR.get_or_init(|| rendered("batch-launched", 1.0)))
}

/// The same with balls that are let go: they tell e alone, so that the series is fitted and drawn in no time, where each process
/// works out anew what compliant contacts do. For tests of what becomes of recordings and files, whatever was measured.
fn lab_of_drops() -> (TempDir, PathBuf, PathBuf) {
    static DIR: OnceLock<PathBuf> = OnceLock::new();
    lab_of(DIR.get_or_init(|| rendered("batch-dropped", 0.0)))
}

/// Nobody writes into `clips`.
fn lab_of(clips: &Path) -> (TempDir, PathBuf, PathBuf) {
    let dir = tempdir().unwrap();
    let (lab, out) = (dir.path().join("lab"), dir.path().join("out"));
    fs::create_dir(&lab).unwrap();
    for entry in fs::read_dir(clips).unwrap() {
        let path = entry.unwrap().path();
        fs::copy(&path, lab.join(path.file_name().unwrap())).unwrap();
    }
    (dir, lab, out)
}

/// `track batch PATH... --out OUT`.
fn batch(paths: &[&Path], out: &Path) -> Command {
    let mut command = Command::new(BINARY);
    command
        .timeout(Duration::from_secs(300))
        .arg("batch")
        .args(paths)
        .arg("--out")
        .arg(out);
    command
}

/// The same, started and left running.
fn started(paths: &[&Path], out: &Path, more: &[&str]) -> Child {
    std::process::Command::new(BINARY)
        .arg("batch")
        .args(paths)
        .arg("--out")
        .arg(out)
        .args(more)
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

/// Every file below `dir`, with what is in it.
fn contents(dir: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    let mut folders = vec![dir.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).into_iter().flatten() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                all.insert(
                    path.strip_prefix(dir).unwrap().to_owned(),
                    fs::read(&path).unwrap(),
                );
            }
        }
    }
    all
}

fn same(a: &BTreeMap<PathBuf, Vec<u8>>, b: &BTreeMap<PathBuf, Vec<u8>>) {
    assert_eq!(
        a.keys().collect::<Vec<_>>(),
        b.keys().collect::<Vec<_>>(),
        "other files"
    );
    for (path, bytes) in a {
        assert!(bytes == &b[path], "{} differs", path.display());
    }
}

fn names(dir: &Path) -> Vec<String> {
    contents(dir)
        .keys()
        .map(|p| p.to_str().unwrap().to_owned())
        .collect()
}

/// What a batch of these recordings leaves.
fn expected(recordings: &[&str]) -> Vec<String> {
    let mut all: Vec<String> = ["fit.json", "report.html", "series.csv"]
        .map(str::to_owned)
        .to_vec();
    for name in recordings {
        for ending in ["key.json", "points.csv", "report.html", "result.json"] {
            all.push(format!("results/{name}.{ending}"));
        }
    }
    all.sort();
    all
}

/// A second of nothing but noise.
fn write_noise(path: &Path) {
    let coding = Coding::H264 {
        crf: 14,
        gop: 12,
        b_frames: 2,
    };
    let mut writer = VideoWriter::create_with(path, 64, 48, &VideoOptions::new(30.0, coding)).unwrap();
    let mut state = 1;
    for _ in 0..30 {
        let frame = Luma::from_fn(64, 48, |_, _| (100.0 + 8.0 * uniform(&mut state)) as u8);
        writer.write(&frame).unwrap();
    }
    writer.finish().unwrap();
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

/// Column by name of each row of `series.csv`.
fn column(out: &Path, name: &str) -> Vec<String> {
    let text = fs::read(out.join("series.csv")).unwrap();
    let mut reader = csv::Reader::from_reader(text.as_slice());
    let place = reader.headers().unwrap().iter().position(|n| n == name).unwrap();
    reader
        .records()
        .map(|row| row.unwrap()[place].to_owned())
        .collect()
}

fn modified(out: &Path, name: &str) -> SystemTime {
    fs::metadata(out.join(format!("results/{name}.result.json")))
        .unwrap()
        .modified()
        .unwrap()
}

// What it takes, and what it gives.

#[test]
fn a_folder_a_pattern_and_a_manifest_give_the_same() {
    let (dir, lab, out) = lab();
    let told = batch(&[&lab], &out).assert().code(0);
    told.stdout(contains("3 recordings: 3 measured; 3 of them now").and(contains("restitution")))
        .stderr(contains("measured a").and(contains("wrote").and(contains("series.csv"))));
    assert_eq!(names(&out), expected(&CLIPS));
    assert_eq!(column(&out, "recording"), CLIPS);
    let fit = json(&out.join("fit.json"));
    assert_eq!(fit["schema"], "track.fit/1");
    let e = &fit["groups"][0]["models"][0]["parameters"]["restitution"];
    assert!((e["value"].as_f64().unwrap() - 0.78).abs() < 0.005, "{e}");
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("href=\"results/b.report.html\"") && page.contains("3 measured"));

    let by_pattern = dir.path().join("by_pattern");
    batch(&[&lab.join("*.mp4")], &by_pattern)
        .arg("--jobs=3")
        .assert()
        .code(0);
    same(&contents(&out), &contents(&by_pattern));

    let manifest = lab.join("m.csv");
    fs::write(&manifest, "video\nc.mp4\na.mp4\nb.mp4\n").unwrap();
    let by_manifest = dir.path().join("by_manifest");
    batch(&[], &by_manifest)
        .arg("--manifest")
        .arg(&manifest)
        .arg("--jobs=1")
        .assert()
        .code(0);
    same(&contents(&out), &contents(&by_manifest));
    // And `track fit` on the folder finds what the batch found.
    let again = Command::new(BINARY)
        .arg("fit")
        .arg(&out)
        .arg("--json")
        .assert()
        .code(0);
    let again: Value = serde_json::from_slice(&again.get_output().stdout).unwrap();
    assert_eq!(again["groups"], fit["groups"]);
}

#[test]
fn the_manifest_says_more_of_a_recording() {
    let (_dir, lab, out) = lab();
    fs::rename(lab.join("b.calib.json"), lab.join("other.json")).unwrap();
    fs::write(
        lab.join("m.csv"),
        "video;group;spin_ratio;calib\na.mp4;steel;0,25;\nb.mp4;golf;unknown;other.json\n",
    )
    .unwrap();
    let assert = batch(&[], &out).arg("--manifest").arg(lab.join("m.csv")).assert();
    assert.stdout(contains("2 recordings: 2 measured"));
    assert_eq!(column(&out, "group"), ["steel", "golf"]);
    assert_eq!(column(&out, "spin_ratio"), ["0.25", ""]);
    assert_eq!(column(&out, "spin_in_m_s")[1], "");
    let a = json(&out.join("results/a.result.json"));
    let ratio = a["bounces"][0]["spin_in_m_s"]["value"].as_f64().unwrap()
        / a["bounces"][0]["incident"]["vx_m_s"]["value"].as_f64().unwrap();
    assert!((ratio - 0.25).abs() < 0.001, "{ratio}");
}

#[test]
fn what_cannot_be_run_says_so_and_leaves_nothing() {
    let (dir, lab, out) = lab_of_drops();
    let manifest = |text: &str| {
        let path = dir.path().join("m.csv");
        fs::write(&path, text).unwrap();
        path
    };
    let refused = |mut command: Command, words: &[&str]| {
        let mut assert = command.assert().code(2).stdout("");
        for word in words {
            assert = assert.stderr(contains(*word));
        }
        assert!(!out.exists());
    };
    refused(batch(&[], &out), &["no recordings given", "--manifest"]);
    refused(batch(&[&lab.join("no.mp4")], &out), &["no.mp4", "no such file"]);
    refused(
        batch(&[&lab.join("*.avi")], &out),
        &["*.avi", "no file or folder has such a name"],
    );
    let mut command = batch(&[], &out);
    let path = manifest("video,grop\na.mp4,x\n");
    command.arg("--manifest").arg(&path);
    refused(
        command,
        &["m.csv", "line 1", "column grop", "did you mean group?"],
    );
    let mut command = batch(&[], &out);
    command
        .arg("--manifest")
        .arg(manifest("video,spin_ratio\na.mp4,0\nb.mp4,much\n"));
    refused(command, &["line 3", "column spin_ratio", "\"much\""]);
    let file = dir.path().join("file");
    fs::write(&file, "").unwrap();
    batch(&[&lab], &file).assert().code(2).stderr(contains("folder"));
}

#[test]
fn a_bad_recording_costs_itself() {
    let (_dir, lab, out) = lab_of_drops();
    fs::write(
        lab.join("text.mp4"),
        "this is no video at all, whatever it is called",
    )
    .unwrap();
    fs::copy(lab.join("a.calib.json"), lab.join("text.calib.json")).unwrap();
    let whole = fs::read(lab.join("b.mp4")).unwrap();
    fs::write(lab.join("cut.mp4"), &whole[..whole.len() / 3]).unwrap();
    fs::copy(lab.join("a.calib.json"), lab.join("cut.calib.json")).unwrap();
    fs::write(
        lab.join("a.calib.json"),
        r#"{"schema": "track.calib/1", "scael": 1}"#,
    )
    .unwrap();
    fs::remove_file(lab.join("c.calib.json")).unwrap();
    let fifo = lab.join("pipe.mp4");
    let made = std::process::Command::new("mkfifo").arg(&fifo).status().unwrap();
    assert!(made.success());
    fs::copy(lab.join("b.calib.json"), lab.join("pipe.calib.json")).unwrap();
    // Rejected, not failed: it is read, and shows nothing.
    write_noise(&lab.join("empty.mp4"));
    fs::write(
        lab.join("empty.calib.json"),
        r#"{"schema": "track.calib/1", "scale": {"metres_per_pixel": 0.001}}"#,
    )
    .unwrap();
    let run = || batch(&[&lab, &fifo], &out).assert().code(1);
    let told = run().stdout(
        contains("7 recordings: 1 measured, 1 rejected, 5 failed; 5 of them now")
            .and(contains("failed a: ").and(contains("was \"scale\" meant").or(contains("scale"))))
            .and(contains("failed c: it has no calibration").and(contains("c.calib.json")))
            .and(contains("failed cut: cannot read"))
            .and(contains("failed pipe: cannot read").and(contains("a device or a pipe")))
            .and(contains("failed text: cannot read").and(contains("not a video")))
            .and(contains("rejected empty: ")),
    );
    drop(told);
    assert_eq!(names(&out), expected(&["b", "empty"]));
    assert_eq!(json(&out.join("results/empty.result.json"))["status"], "rejected");
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("6 recordings not measured") && page.contains("not a video"));
    assert!(page.contains("href=\"results/empty.report.html\"") && !page.contains("href=\"results/text"));
    // What failed is tried again; what was rejected stands.
    let before = contents(&out);
    run().stdout(contains("3 of them now"));
    same(&before, &contents(&out));
}

#[test]
fn recordings_of_one_name_are_kept_apart() {
    let (dir, lab, out) = lab_of_drops();
    let day2 = dir.path().join("day2");
    fs::create_dir(&day2).unwrap();
    for (from, to) in [("b.mp4", "a.mp4"), ("b.calib.json", "a.calib.json")] {
        fs::copy(lab.join(from), day2.join(to)).unwrap();
    }
    batch(&[&lab.join("a.mp4"), &day2], &out).assert().code(0);
    assert_eq!(names(&out), expected(&["day2-a", "lab-a"]));
    // Results of recordings that are not given stay where they are, and outside the series.
    let told = batch(&[&lab.join("c.mp4")], &out).assert().code(0);
    told.stderr(
        contains("warning: other_results: ").and(contains("2 results").and(contains("day2-a, lab-a"))),
    );
    assert_eq!(names(&out), expected(&["c", "day2-a", "lab-a"]));
    assert_eq!(column(&out, "recording"), ["c"]);
}

// What is measured again.

#[test]
fn a_second_run_measures_what_has_changed_and_nothing_else() {
    let (_dir, lab, out) = lab_of_drops();
    batch(&[&lab], &out).assert().code(0);
    let before = contents(&out);
    let times = || CLIPS.map(|name| modified(&out, name));
    let first = times();
    let run = |measured: &[&str], more: &[&str]| {
        let mut command = batch(&[&lab], &out);
        let assert = command.args(more).assert().code(0);
        let stderr = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
        for name in CLIPS {
            let told = stderr.contains(&format!("measured {name}\n"));
            assert_eq!(told, measured.contains(&name), "{name}: {stderr}");
        }
        assert.stdout(contains(format!("{} of them now", measured.len())));
    };
    run(&[], &[]);
    assert_eq!(times(), first);
    same(&before, &contents(&out));

    // A touched or copied file is the same recording.
    fs::write(lab.join("a.mp4"), fs::read(lab.join("a.mp4")).unwrap()).unwrap();
    run(&[], &[]);

    let calib = lab.join("b.calib.json");
    let text = fs::read_to_string(&calib).unwrap();
    assert!(text.contains("0.0025"));
    fs::write(&calib, text.replace("0.0025", "0.00250001")).unwrap();
    run(&["b"], &[]);
    let now = times();
    assert_eq!((now[0], now[2]), (first[0], first[2]));
    assert_ne!(now[1], first[1]);
    fs::write(&calib, text).unwrap();
    run(&["b"], &[]);
    same(&before, &contents(&out));

    // Results that somebody has changed or taken away.
    let mut page = before[Path::new("results/a.report.html")].clone();
    page.truncate(1000);
    fs::write(out.join("results/a.report.html"), page).unwrap();
    fs::remove_file(out.join("results/c.points.csv")).unwrap();
    run(&["a", "c"], &[]);
    same(&before, &contents(&out));

    fs::copy(lab.join("a.mp4"), lab.join("c.mp4")).unwrap();
    run(&["c"], &[]);
    run(&CLIPS, &["--accuracy", "fast"]);
    run(&CLIPS, &["--accuracy", "fast", "--again"]);
}

#[test]
fn copies_count_once_and_what_gravity_refutes_is_left_out_and_said_at_the_top() {
    let (_dir, lab, out) = lab();
    for file in ["mp4", "calib.json"] {
        fs::copy(lab.join(format!("a.{file}")), lab.join(format!("z.{file}"))).unwrap();
    }
    let calib = lab.join("b.calib.json");
    let text = fs::read_to_string(&calib).unwrap();
    fs::write(&calib, text.replace("0.0025", "0.005")).unwrap();

    batch(&[&lab], &out)
        .assert()
        .code(0)
        .stderr(contains("1 recording contradicts g: b (left out"))
        .stderr(contains("duplicate_recording: 1 recording is a copy of another"))
        .stderr(contains("z is a."));
    assert_eq!(column(&out, "recording"), ["a", "b", "c", "z"]);
    let left_out = column(&out, "left_out");
    assert_eq!((left_out[0].as_str(), left_out[2].as_str()), ("", ""));
    assert!(left_out[1].contains("gravity_mismatch") && left_out[3].contains("duplicate_recording"));
    let warnings = column(&out, "warnings");
    assert!(warnings[1].split(' ').any(|code| code == "gravity_mismatch"));
    assert!(warnings[3].ends_with("duplicate_recording"));
    let fit = json(&out.join("fit.json"));
    assert_eq!(fit["groups"][0]["rows_used"], serde_json::json!([1, 3]));
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    let place = |text: &str| page.find(text).unwrap();
    assert!(place("1 recording contradicts g: b") < place("<section"));

    batch(&[&lab], &out)
        .arg("--keep-refuted")
        .assert()
        .code(0)
        .stderr(contains("in the fit all the same"))
        .stdout(contains("0 of them now"));
    assert_eq!(column(&out, "left_out")[1], "");

    // A result that another build has left behind.
    let key = out.join("results/c.key.json");
    let text = fs::read_to_string(&key).unwrap();
    let version = format!("\"version\": \"{}\"", env!("CARGO_PKG_VERSION"));
    assert!(text.contains(&version), "{text}");
    fs::write(&key, text.replace(&version, "\"version\": \"0.0.1\"")).unwrap();
    batch(&[&lab], &out)
        .assert()
        .code(0)
        .stderr(contains("several_builds"))
        .stderr(contains("track 0.0.1 ("))
        .stdout(contains("1 of them now"));
}

// In shards.

/// `--shard I/N`.
fn shard(lab: &Path, out: &Path, part: &str) -> Command {
    let mut command = batch(&[lab], out);
    command.args(["--jobs", "1", "--shard", part]);
    command
}

fn merge(out: &Path) -> Command {
    let mut command = batch(&[], out);
    command.arg("--merge");
    command
}

/// The clips under more names, so that every shard of three has some; copies but for a byte after the film.
fn more_clips(lab: &Path) {
    for i in 0..6 {
        let from = CLIPS[i % CLIPS.len()];
        let mut bytes = fs::read(lab.join(format!("{from}.mp4"))).unwrap();
        // A box of MP4 that readers skip.
        bytes.extend([0, 0, 0, 9]);
        bytes.extend(b"free");
        bytes.push(i as u8);
        fs::write(lab.join(format!("more-{i}.mp4")), bytes).unwrap();
        fs::copy(
            lab.join(format!("{from}.calib.json")),
            lab.join(format!("more-{i}.calib.json")),
        )
        .unwrap();
    }
}

/// All but the records of the shards, which a run that was not divided does not have.
fn without_records(out: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = contents(out);
    all.retain(|path, _| !path.starts_with("shards"));
    all
}

#[test]
fn shards_that_run_at_once_one_killed_and_run_again_leave_the_bytes_of_one_run() {
    let (dir, lab, out) = lab();
    more_clips(&lab);
    // One that fails has a part in the page as well.
    fs::write(lab.join("text.mp4"), "this is no video at all").unwrap();
    fs::copy(lab.join("a.calib.json"), lab.join("text.calib.json")).unwrap();
    let whole = dir.path().join("whole");
    batch(&[&lab], &whole).assert().code(1);

    let parts = ["1/3", "2/3", "3/3"];
    let mut running: Vec<Child> = parts
        .iter()
        .map(|part| started(&[&lab], &out, &["--jobs", "1", "--shard", part]))
        .collect();
    // The second is killed while it measures.
    let begun = Instant::now();
    while children(running[1].id()).is_empty() && begun.elapsed() < Duration::from_secs(30) {
        std::thread::sleep(Duration::from_millis(2));
    }
    // While it runs, nobody else measures it, merges, or divides otherwise.
    assert!(signal(Signal::STOP, running[1].id()));
    shard(&lab, &out, "2/3")
        .assert()
        .code(2)
        .stderr(contains("shard 2/3 is being measured"));
    shard(&lab, &out, "1/2")
        .assert()
        .code(2)
        .stderr(contains("/3 is being measured").and(contains("--shard I/3")));
    merge(&out)
        .assert()
        .code(2)
        .stderr(contains("another track batch is writing"));
    running[1].kill().unwrap();
    for child in &mut running {
        child.wait().unwrap();
    }
    merge(&out).assert().code(2).stdout("").stderr(
        contains("shard 2/3 was begun and has not ended")
            .and(contains("its recordings are "))
            .and(contains("--shard 2/3")),
    );
    assert!(!out.join("series.csv").exists());

    drop(shard(&lab, &out, "2/3").assert());
    merge(&out)
        .assert()
        .code(1)
        .stdout(contains("10 recordings: 9 measured, 1 failed; 0 of them now").and(contains("failed text")));
    same(&contents(&whole), &without_records(&out));
    // Again, by one run of all: nothing is left to do but what failed.
    batch(&[&lab], &out)
        .assert()
        .code(1)
        .stdout(contains("1 of them now"));
    same(&contents(&whole), &without_records(&out));
}

#[test]
fn a_merge_says_what_is_missing_and_a_bad_part_what_is_one() {
    let (_dir, lab, out) = lab_of_drops();
    more_clips(&lab);
    merge(&out)
        .assert()
        .code(2)
        .stderr(contains("no record of a shard").and(contains("--shard 1/N")));
    assert!(!out.exists());
    for part in ["1/3", "3/3"] {
        shard(&lab, &out, part).assert().code(0);
    }
    merge(&out)
        .assert()
        .code(2)
        .stdout("")
        .stderr(contains("shard 2/3 has not been run").and(contains("--shard 2/3")));
    // With the recordings named, it says which.
    let of = |part: &str| -> Vec<String> {
        let part: track::batch::Shard = part.parse().unwrap();
        let names = CLIPS.iter().map(|name| (*name).to_owned());
        let names = names.chain((0..6).map(|i| format!("more-{i}")));
        names.filter(|name| part.has(name)).collect()
    };
    batch(&[&lab], &out)
        .arg("--merge")
        .assert()
        .code(2)
        .stderr(contains(format!("its recordings are {}", of("2/3").join(", "))));
    shard(&lab, &out, "2/3").assert().code(0);
    merge(&out).assert().code(0);

    // A result that is gone.
    let gone = &of("3/3")[0];
    fs::remove_file(out.join(format!("results/{gone}.points.csv"))).unwrap();
    merge(&out).assert().code(2).stderr(contains(format!(
        "shard 3/3 are gone or have changed since it ended: {gone}"
    )));
    // A recording that one shard has seen and the others have not.
    shard(&lab, &out, "3/3")
        .assert()
        .code(0)
        .stdout(contains("1 of them now"));
    fs::copy(lab.join("a.mp4"), lab.join("new.mp4")).unwrap();
    fs::copy(lab.join("a.calib.json"), lab.join("new.calib.json")).unwrap();
    shard(&lab, &out, "1/3").assert().code(0);
    merge(&out)
        .assert()
        .code(2)
        .stderr(contains("1/3 of 10 recordings; 2/3, 3/3 of 9 recordings"));
    // Another division takes the place of the one before.
    shard(&lab, &out, "1/1").assert().code(0);
    merge(&out).assert().code(0);

    for (part, words) in [
        ("0/3", "I is from 1 to N, here from 1 to 3"),
        ("4/3", "from 1 to 3"),
        ("1/0", "N is 1 or more"),
        ("two", "accepted is I/N"),
    ] {
        shard(&lab, &out, part).assert().code(2).stderr(contains(words));
    }
    shard(&lab, &out, "1/3")
        .arg("--merge")
        .assert()
        .code(2)
        .stderr(contains("cannot be used with"));
}

// When something goes wrong.

/// The processes that `parent` has started: their ids and what they were started with.
fn children(parent: u32) -> Vec<(u32, String)> {
    let threads = fs::read_dir(format!("/proc/{parent}/task"))
        .into_iter()
        .flatten()
        .flatten();
    threads
        .filter_map(|thread| fs::read_to_string(thread.path().join("children")).ok())
        .flat_map(|ids| ids.split_whitespace().map(str::to_owned).collect::<Vec<_>>())
        .filter_map(|id| {
            let line = fs::read(format!("/proc/{id}/cmdline")).ok()?;
            Some((
                id.parse().ok()?,
                String::from_utf8_lossy(&line).replace('\0', " "),
            ))
        })
        .collect()
}

/// By the system call: the program `kill` (package procps) is not on every machine. `false` where the process is gone.
fn signal(signal: Signal, id: u32) -> bool {
    let pid = i32::try_from(id).ok().and_then(Pid::from_raw).unwrap();
    kill_process(pid, signal).is_ok()
}

/// Whether the process is gone, or dead and not yet buried.
fn is_gone(id: u32) -> bool {
    fs::read_to_string(format!("/proc/{id}/stat")).map_or(true, |stat| {
        let state = stat
            .rsplit(')')
            .next()
            .unwrap_or_default()
            .trim_start()
            .chars()
            .next();
        matches!(state, Some('Z' | 'X') | None)
    })
}

#[test]
fn a_recording_that_crashes_or_hangs_costs_itself_and_is_tried_again() {
    let (dir, lab, out) = lab_of_drops();
    let undisturbed = dir.path().join("undisturbed");
    batch(&[&lab], &undisturbed).assert().code(0);
    let child = started(&[&lab], &out, &["--timeout-s", "10", "--jobs", "3"]);
    // A hang is a process that stands still; a crash is the signal that a bad codec gets.
    let mut left = vec![(Signal::STOP, "/lab/a.mp4"), (Signal::SEGV, "/lab/b.mp4")];
    let begun = Instant::now();
    while !left.is_empty() && begun.elapsed() < Duration::from_secs(60) {
        for (id, line) in children(child.id()) {
            left.retain(|(how, video)| {
                !(line.contains("batch-recording") && line.contains(video) && signal(*how, id))
            });
        }
    }
    let output = child.wait_with_output().unwrap();
    assert!(left.is_empty(), "not caught in time: {left:?}");
    assert_eq!(output.status.code(), Some(1));
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(told.contains("1 measured, 2 failed"), "{told}");
    assert!(
        told.contains("failed a: it was not done after 10 s and was stopped"),
        "{told}"
    );
    assert!(
        told.contains("failed b: its process crashed (signal 11, SIGSEGV"),
        "{told}"
    );
    assert_eq!(names(&out), expected(&["c"]));
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("not done after 10 s") && page.contains("SIGSEGV"));
    batch(&[&lab], &out)
        .assert()
        .code(0)
        .stdout(contains("2 of them now"));
    same(&contents(&undisturbed), &contents(&out));
}

#[test]
fn figures_of_the_series_are_files_where_they_are_asked_for() {
    let (_dir, lab, out) = lab();
    let told = batch(&[&lab], &out).arg("--formats=svg").assert().code(0);
    told.stderr(contains("angles.svg"));
    let figure = fs::read_to_string(out.join("angles.svg")).unwrap();
    assert!(figure.contains("<svg") && figure.trim_end().ends_with("</svg>"));
    assert!(out.join("fit.json").exists() && out.join("report.html").exists());
}

#[test]
fn a_lack_of_memory_is_told_as_one() {
    let (_dir, lab, out) = lab_of_drops();
    let assert = batch(&[&lab.join("a.mp4")], &out)
        .arg("--memory-mb=24")
        .assert()
        .code(1);
    let told = String::from_utf8_lossy(&assert.get_output().stdout).into_owned();
    println!("{told}");
    assert!(told.contains("failed a: "), "{told}");
    assert!(told.contains("emory") && told.contains("24 MB"), "{told}");
    assert_eq!(names(&out), expected(&[]));
    let fit = json(&out.join("fit.json"));
    assert_eq!(fit["groups"], Value::Array(Vec::new()));
    batch(&[&lab.join("a.mp4")], &out)
        .assert()
        .code(0)
        .stdout(contains("1 of them now"));
}

/// Numbers between 0 and 1 from SplitMix64.
fn uniform(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

#[test]
fn killed_at_twenty_moments_and_resumed_it_leaves_the_same_bytes_and_no_process() {
    let (dir, lab, out) = lab_of_drops();
    fs::remove_file(lab.join("c.mp4")).unwrap();
    fs::write(lab.join("text.mp4"), "this is no video at all").unwrap();
    fs::copy(lab.join("a.calib.json"), lab.join("text.calib.json")).unwrap();
    let undisturbed = dir.path().join("undisturbed");
    let begun = Instant::now();
    batch(&[&lab], &undisturbed).arg("--jobs=1").assert().code(1);
    let whole_s = begun.elapsed().as_secs_f64();
    let undisturbed = contents(&undisturbed);
    // Another seed each time would be as good; this one makes a failure come back.
    let mut state = 20_050_731;
    let mut half_done = 0;
    for round in 0..20 {
        let mut child = started(&[&lab], &out, &["--jobs", "1"]);
        std::thread::sleep(Duration::from_secs_f64(whole_s * uniform(&mut state)));
        let processes = children(child.id());
        child.kill().unwrap();
        child.wait().unwrap();
        // Whatever lies there under its own name is whole.
        for (path, bytes) in contents(&out) {
            let name = path.to_str().unwrap();
            if !name.contains("/.") && !name.starts_with('.') && name.ends_with(".json") {
                assert!(
                    serde_json::from_slice::<Value>(&bytes).is_ok(),
                    "round {round}: half of {name}"
                );
            }
        }
        let done = contents(&out)
            .keys()
            .filter(|p| p.to_string_lossy().ends_with("key.json"))
            .count();
        half_done += usize::from(done == 1);
        batch(&[&lab], &out).assert().code(1);
        for (id, line) in processes {
            assert!(is_gone(id), "round {round}: process {id} stayed behind: {line}");
        }
        same(&undisturbed, &contents(&out));
        fs::remove_dir_all(&out).unwrap();
    }
    println!("{half_done} of 20 kills came when one result stood and the other did not");
}

#[test]
fn killed_again_and_again_it_comes_to_the_same_end() {
    let (dir, lab, out) = lab();
    let undisturbed = dir.path().join("undisturbed");
    let begun = Instant::now();
    batch(&[&lab], &undisturbed).arg("--jobs=1").assert().code(0);
    let whole_s = begun.elapsed().as_secs_f64();
    let mut state = 7;
    for _ in 0..6 {
        let mut child = started(&[&lab], &out, &["--jobs", "1"]);
        std::thread::sleep(Duration::from_secs_f64(0.7 * whole_s * uniform(&mut state)));
        child.kill().unwrap();
        child.wait().unwrap();
    }
    batch(&[&lab], &out).assert().code(0);
    same(&contents(&undisturbed), &contents(&out));
}

#[test]
fn two_batches_do_not_write_into_one_folder() {
    let (_dir, lab, out) = lab_of_drops();
    let mut first = started(&[&lab], &out, &[]);
    let begun = Instant::now();
    while children(first.id()).is_empty() && begun.elapsed() < Duration::from_secs(30) {
        std::thread::sleep(Duration::from_millis(2));
    }
    assert!(signal(Signal::STOP, first.id()));
    batch(&[&lab], &out)
        .assert()
        .code(2)
        .stderr(contains("another track batch is writing into this folder"));
    first.kill().unwrap();
    first.wait().unwrap();
    batch(&[&lab], &out).assert().code(0);
}

/// In a name space of its own, where a small disk may be mounted and goes with its last process.
#[test]
fn a_full_disk_is_told_and_leaves_no_half_file() {
    let (dir, lab, out) = lab_of_drops();
    batch(&[&lab], &out).assert().code(0);
    let sizes = |ending: &str| -> u64 {
        let all = contents(&out);
        let of = all.iter().filter(|(p, _)| p.to_string_lossy().contains(ending));
        of.map(|(_, bytes)| bytes.len() as u64).sum()
    };
    let whole = sizes("");
    let one = sizes("results/a.");
    let mount = dir.path().join("disk");
    fs::create_dir(&mount).unwrap();
    let mut seen_full = 0;
    // From hardly anything to nearly enough.
    for bytes in [
        100_000,
        one / 2 + 100_000,
        2 * one,
        whole - one / 2,
        whole - 20_000,
    ] {
        let script = r#"mount -t tmpfs -o size="$4" tmpfs "$2" || exit 77
            "$1" batch "$3" --out "$2/out" --jobs 1 >"$5/stdout" 2>"$5/stderr"; code=$?
            mkdir "$5/left" && cp -r "$2/." "$5/left" && exit $code"#;
        let kept = tempdir().unwrap();
        let status = std::process::Command::new("unshare")
            .args(["--map-root-user", "--mount", "sh", "-c", script, "sh", BINARY])
            .args([&mount, &lab])
            .arg(bytes.to_string())
            .arg(kept.path())
            .stderr(Stdio::null())
            .status();
        let Some(code) = status
            .ok()
            .and_then(|s| s.code())
            .filter(|_| kept.path().join("left").exists())
        else {
            println!("skipped: this system lets no user mount a disk of their own (unshare, tmpfs)");
            return;
        };
        let told = ["stdout", "stderr"]
            .map(|name| fs::read_to_string(kept.path().join(name)).unwrap())
            .concat();
        println!("{bytes} of {whole} bytes: status {code}");
        assert!(code == 1 || code == 2, "{told}");
        assert!(told.contains("the disk is full"), "{told}");
        assert!(!told.contains("panicked"), "{told}");
        seen_full += usize::from(code == 2);
        let left = kept.path().join("left/out");
        let reference = contents(&out);
        for (path, contents) in contents(&left) {
            let name = path.to_str().unwrap().to_owned();
            assert!(
                !name.contains(".tmp") && !name.contains(".work"),
                "{name} is left"
            );
            if name.starts_with("results/") {
                assert!(contents == reference[&path], "{name} is not whole");
            } else if name.ends_with(".json") {
                assert!(
                    serde_json::from_slice::<Value>(&contents).is_ok(),
                    "half of {name}"
                );
            } else {
                let end: &[u8] = if name.ends_with("html") {
                    b"</html>\n"
                } else {
                    b"\n"
                };
                assert!(contents.ends_with(end), "half of {name}");
            }
        }
    }
    assert!(seen_full > 0);
}
