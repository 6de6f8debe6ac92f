//! `track points`: centres that another program found, as tables of several forms, through the built binary.

use assert_cmd::Command;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

const G: f64 = 9.81;
const SCALE: f64 = 0.0012;
const RADIUS_M: f64 = 0.012;
const ORIGIN_PX: (f64, f64) = (80.0, 600.0);
const RATE_HZ: f64 = 240.0;
const RESTITUTION: f64 = 0.8;
/// vx before and after the first impact, m/s.
const SPEEDS: [f64; 3] = [1.0, 0.85, 0.8];
const DROP_M: f64 = 0.25;

/// Centre (x, z) at a time after the launch from the edge x = 0, m.
fn centre(t: f64) -> (f64, f64) {
    let fall_s = (2.0 * DROP_M / G).sqrt();
    if t < fall_s {
        return (SPEEDS[0] * t, RADIUS_M + DROP_M - 0.5 * G * t * t);
    }
    let mut at = (fall_s, SPEEDS[0] * fall_s);
    let mut up = RESTITUTION * G * fall_s;
    for vx in &SPEEDS[1..] {
        let since = t - at.0;
        let lasts = 2.0 * up / G;
        if since < lasts {
            return (at.1 + vx * since, RADIUS_M + up * since - 0.5 * G * since * since);
        }
        at = (at.0 + lasts, at.1 + vx * lasts);
        up *= RESTITUTION;
    }
    (at.1, RADIUS_M)
}

/// Frames to the middle of the third flight.
fn frames() -> usize {
    let fall_s = (2.0 * DROP_M / G).sqrt();
    ((fall_s + 2.0 * RESTITUTION * fall_s + RESTITUTION * RESTITUTION * fall_s) * RATE_HZ) as usize
}

/// Numbers that look like noise: the same each time, normal enough (a sum of twelve), of standard deviation 1.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        let mut uniform = || {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    }
}

/// Centres in the picture with noise of `std_px`.
fn pixels(seed: u64, std_px: f64) -> Vec<(usize, f64, f64)> {
    let mut noise = Noise(seed);
    for _ in 0..3 {
        noise.next();
    }
    (0..frames())
        .map(|frame| {
            let (x, z) = centre(frame as f64 / RATE_HZ);
            let (u, v) = (ORIGIN_PX.0 + x / SCALE, ORIGIN_PX.1 - z / SCALE);
            (frame, u + std_px * noise.next(), v + std_px * noise.next())
        })
        .collect()
}

struct Lab(tempfile::TempDir);

impl Lab {
    fn new() -> Self {
        let lab = Self(tempfile::tempdir().unwrap());
        lab.calib(json!({"frame_rate_hz": RATE_HZ}));
        lab
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn calib(&self, changes: Value) {
        let mut calib = json!({
            "schema": "track.calib/1", "view": "side",
            "scale": {"metres_per_pixel": SCALE}, "origin_px": [ORIGIN_PX.0, ORIGIN_PX.1],
            "gravity_m_s2": G, "ball": {"radius_m": RADIUS_M, "mass_kg": 0.056},
            "launch": {"edge_x_m": 0.0, "spin_ratio": 0.0}
        });
        for (key, value) in changes.as_object().unwrap() {
            calib[key] = value.clone();
        }
        fs::write(self.path("calib.json"), calib.to_string()).unwrap();
    }

    fn track(&self, table: &str, args: &[&str]) -> std::process::Output {
        fs::write(self.path("points.csv"), table).unwrap();
        Command::cargo_bin("track")
            .unwrap()
            .current_dir(self.0.path())
            .args(["points", "points.csv", "--calib", "calib.json"])
            .args(args)
            .output()
            .unwrap()
    }

    fn measured(&self, table: &str) -> Value {
        let output = self.track(table, &["--json"]);
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        serde_json::from_slice(&output.stdout).unwrap()
    }
}

fn q(value: &Value) -> (f64, f64) {
    (
        value["value"].as_f64().unwrap(),
        value["std_uncertainty"].as_f64().unwrap(),
    )
}

fn table(header: &str, rows: impl Iterator<Item = String>) -> String {
    rows.fold(format!("{header}\n"), |mut text, row| {
        let _ = writeln!(text, "{row}");
        text
    })
}

/// A ball in the air is slowed a little, which these centres are not: what the steel ball's drag does to them, m/s and so on, is far below the noise.
#[test]
fn centres_of_another_program_are_measured_with_uncertainties_that_hold() {
    let (lab, mut held, mut all) = (Lab::new(), 0, 0);
    for seed in 0..20 {
        let rows = pixels(seed, 0.15)
            .into_iter()
            .map(|(n, u, v)| format!("{n},{u},{v}"));
        let result = lab.measured(&table("frame,u_px,v_px", rows));
        let first = &result["bounces"][0];
        let fall_s = (2.0 * DROP_M / G).sqrt();
        for (found, truth) in [
            (q(&first["restitution"]), RESTITUTION),
            (q(&first["tangential_ratio"]), SPEEDS[1] / SPEEDS[0]),
            (q(&result["x0_m"]), SPEEDS[0] * fall_s),
            (q(&result["x_m"]), SPEEDS[1] * 2.0 * RESTITUTION * fall_s),
        ] {
            let pull = (found.0 - truth) / found.1;
            assert!(pull.abs() < 4.5, "seed {seed}: {found:?} for {truth}");
            held += usize::from(pull.abs() < 1.96);
            all += 1;
        }
        assert_eq!(result["track"]["points"].as_array().unwrap().len(), frames());
        assert!(
            result["track"]["method"]
                .as_str()
                .unwrap()
                .contains("another program")
        );
    }
    assert!(
        (72..=80).contains(&held),
        "{held} of {all} intervals of 95 % hold the truth"
    );
}

#[test]
fn every_form_of_table_says_the_same() {
    let lab = Lab::new();
    let points = pixels(7, 0.05);
    let own = lab.measured(&table(
        "frame,u_px,v_px",
        points.iter().map(|(n, u, v)| format!("{n},{u},{v}")),
    ));
    let time = |n: usize| n as f64 / RATE_HZ;
    let world = |u: f64, v: f64| ((u - ORIGIN_PX.0) * SCALE, (ORIGIN_PX.1 - v) * SCALE);
    let forms = [
        // trackpy's, with its index and what else it tells.
        table(
            ",y,x,mass,frame,particle",
            points.iter().map(|(n, u, v)| format!("0,{v},{u},99,{n},0")),
        ),
        // Tracker's export.
        "mass A\t\t\n".to_owned()
            + &table(
                "t\tx\ty",
                points.iter().map(|(n, u, v)| {
                    let (x, z) = world(*u, *v);
                    format!("{}\t{x}\t{z}", time(*n))
                }),
            ),
        // A spreadsheet of half the world.
        table(
            "time_ms;x_m;z_m",
            points.iter().map(|(n, u, v)| {
                let (x, z) = world(*u, *v);
                format!("{};{x};{z}", 1e3 * time(*n)).replace('.', ",")
            }),
        ),
    ];
    for form in forms {
        let again = lab.measured(&form);
        for key in ["restitution", "tangential_ratio", "time_s", "x_m"] {
            let (a, b) = (q(&own["bounces"][0][key]), q(&again["bounces"][0][key]));
            assert!(
                (a.0 - b.0).abs() < 1e-3 * a.1 && (a.1 / b.1 - 1.0).abs() < 1e-3,
                "{key}: {a:?} {b:?}"
            );
        }
    }
}

#[test]
fn stated_uncertainties_count() {
    let lab = Lab::new();
    lab.calib(json!({"frame_rate_hz": RATE_HZ, "camera": {"readout_s": 0}}));
    let rows = |std: f64| {
        let rows = pixels(3, 0.02)
            .into_iter()
            .map(move |(n, u, v)| format!("{n},{u},{v},{std}"));
        lab.measured(&table("frame,u_px,v_px,std_px", rows))
    };
    let (sure, unsure) = (rows(0.02), rows(0.5));
    let std = |r: &Value| q(&r["bounces"][0]["restitution"]).1;
    assert!(
        std(&unsure) > 10.0 * std(&sure),
        "{} {}",
        std(&sure),
        std(&unsure)
    );
}

#[test]
fn without_a_radius_none_is_reported() {
    let lab = Lab::new();
    lab.calib(json!({"frame_rate_hz": RATE_HZ, "ball": {"inertia_factor": 0.4}}));
    let rows = pixels(1, 0.05)
        .into_iter()
        .map(|(n, u, v)| format!("{n},{u},{v}"));
    let result = lab.measured(&table("frame,u_px,v_px", rows));
    assert_eq!(result["track"]["radius_px"], Value::Null);
    assert!((q(&result["bounces"][0]["restitution"]).0 - RESTITUTION).abs() < 0.01);
}

#[test]
fn what_cannot_be_measured_is_told_and_leaves_nothing() {
    let lab = Lab::new();
    let fails = |table: &str, status: i32, words: &[&str]| {
        let output = lab.track(table, &["--out", "out"]);
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(status), "{stderr}");
        for word in words {
            assert!(stderr.contains(word), "{word} in {stderr}");
        }
    };
    fails(
        "a,b\n1,2\n",
        2,
        &["points.csv", "no columns of a place", "u_px with v_px"],
    );
    fails(
        "frame,u_px,v_px\n0,1,nonsense\n",
        2,
        &["line 2, column v_px", "nonsense"],
    );
    assert!(!lab.path("out").exists());
    let held = table(
        "frame,u_px,v_px",
        (0..40).map(|n| format!("{n},{},300", 100.0 + 0.01 * f64::from(n))),
    );
    fails(&held, 1, &["rejected"]);
    lab.calib(json!({}));
    fails(
        &table(
            "frame,u_px,v_px",
            pixels(1, 0.1).into_iter().map(|(n, u, v)| format!("{n},{u},{v}")),
        ),
        2,
        &["frame_rate_hz"],
    );
}

/// What goes to Tracker comes back: the places to 1e-9 px, and with them the measurement.
#[test]
fn a_measurement_goes_to_tracker_and_back() {
    let lab = Lab::new();
    let rows = pixels(11, 0.1)
        .into_iter()
        .map(|(n, u, v)| format!("{n},{u},{v}"));
    let output = lab.track(
        &table("frame,u_px,v_px", rows),
        &["--out", "out", "--formats", "json,trk"],
    );
    assert!(output.status.success());
    assert!(!lab.path("out/points.report.html").exists());
    let first: Value =
        serde_json::from_slice(&fs::read(lab.path("out/points.result.json")).unwrap()).unwrap();
    let tracker = |args: &[&str]| {
        let mut command = Command::cargo_bin("track").unwrap();
        command
            .current_dir(lab.0.path())
            .args(["calibrate", "tracker"])
            .args(args)
            .output()
            .unwrap()
    };
    let radius = RADIUS_M.to_string();
    let output = tracker(&[
        "out/points.trk",
        "--out",
        "back.json",
        "--points",
        "back.csv",
        "--ball-radius-m",
        &radius,
        "--ball-mass-kg",
        "0.056",
    ]);
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        output.status.success() && stderr.contains("Tracker's step"),
        "{stderr}"
    );
    let calib: Value = serde_json::from_slice(&fs::read(lab.path("back.json")).unwrap()).unwrap();
    assert!((calib["scale"]["metres_per_pixel"].as_f64().unwrap() / SCALE - 1.0).abs() < 1e-12);
    assert!((calib["origin_px"][0].as_f64().unwrap() - ORIGIN_PX.0).abs() < 1e-9);
    assert!((calib["frame_rate_hz"].as_f64().unwrap() / RATE_HZ - 1.0).abs() < 1e-9);
    fs::copy(lab.path("back.json"), lab.path("calib.json")).unwrap();
    let back = fs::read_to_string(lab.path("back.csv")).unwrap();
    let points = first["track"]["points"].as_array().unwrap();
    let used: Vec<&Value> = points.iter().filter(|p| p["used"] == true).collect();
    assert_eq!(back.lines().count(), used.len() + 1);
    for (line, point) in back.lines().skip(1).zip(used) {
        let cells: Vec<f64> = line.split(',').map(|c| c.parse().unwrap()).collect();
        assert!((cells[2] - point["u_px"].as_f64().unwrap()).abs() < 1e-9);
        assert!((cells[3] - point["v_px"].as_f64().unwrap()).abs() < 1e-9);
    }
    let again = lab.measured(&back);
    let (a, b) = (
        q(&first["bounces"][0]["restitution"]),
        q(&again["bounces"][0]["restitution"]),
    );
    assert!((a.0 - b.0).abs() < 0.3 * a.1, "{a:?} {b:?}");
    // What Tracker does not have is told.
    fs::write(lab.path("cut.trk"), "<object class=\"x\">").unwrap();
    let output = tracker(&["cut.trk"]);
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        output.status.code() == Some(2) && stderr.contains("cut.trk"),
        "{stderr}"
    );
    let output = lab.track(
        "frame,u_px,v_px\n0,1,2\n",
        &["--out", "out", "--formats", "overlay"],
    );
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn what_track_writes_it_reads() {
    let lab = Lab::new();
    let rows = pixels(5, 0.1).into_iter().map(|(n, u, v)| format!("{n},{u},{v}"));
    let output = lab.track(&table("frame,u_px,v_px", rows), &["--out", "out"]);
    assert!(output.status.success());
    for name in ["result.json", "points.csv", "report.html"] {
        assert!(lab.path(&format!("out/points.{name}")).exists(), "{name}");
    }
    let first: Value =
        serde_json::from_slice(&fs::read(lab.path("out/points.result.json")).unwrap()).unwrap();
    let again = lab.measured(&fs::read_to_string(lab.path("out/points.points.csv")).unwrap());
    for key in ["restitution", "time_s"] {
        let (a, b) = (q(&first["bounces"][0][key]), q(&again["bounces"][0][key]));
        assert!((a.0 - b.0).abs() < 0.3 * a.1, "{key}: {a:?} {b:?}");
    }
}
