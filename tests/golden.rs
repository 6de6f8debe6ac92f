//! Golden results: what the program wrote when they were last refreshed, number by number.
//!
//! They say nothing about what is right (the truth tests do); they hold still what a change should not touch.
//!
//! ```sh
//! cargo test --test all golden::     # compares
//! make golden                        # writes them anew and says what moved
//! ```
//!
//! Each case is a scene, rendered and measured by the built binary as a user would, or a series, or pictures of a board.
//! Scenes are small and stored without loss, so that no encoder has a say in them.

mod compare;

use crate::boards::{Board, Camera, Gaussian, Look, careful_views, render, write_png};
use assert_cmd::Command;
use compare::{differences_csv, differences_json};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::{TempDir, tempdir};
use track::frames;

fn golden_dir(case: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("fixtures/golden")
        .join(case)
}

/// Whether golden files are written in place of being compared with.
fn refreshing() -> bool {
    std::env::var_os("TRACK_GOLDEN").is_some_and(|v| v == "refresh")
}

/// What a case has made, compared file by file; all differences are told at once.
struct Case {
    name: &'static str,
    dir: TempDir,
    differences: Vec<String>,
    /// The mean scale of the picture, to read a point's standard uncertainty in metres; 0 before a result is seen.
    metres_per_pixel: f64,
}

impl Case {
    fn new(name: &'static str) -> Self {
        Self {
            name,
            dir: tempdir().unwrap(),
            differences: Vec::new(),
            metres_per_pixel: 0.0,
        }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    /// `track ARGS` in the case's own folder, so that no path of this machine comes into a file. Gives stdout and the
    /// exit status.
    fn track(&self, args: &[&str]) -> (String, i32) {
        let output = Command::new(env!("CARGO_BIN_EXE_track"))
            .args(args)
            .current_dir(self.dir.path())
            .timeout(std::time::Duration::from_secs(300))
            .output()
            .unwrap();
        let status = output.status.code().unwrap();
        assert!(
            status < 2,
            "{args:?}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
        (String::from_utf8(output.stdout).unwrap(), status)
    }

    /// Renders a scene as `ball.*`.
    fn simulate(&self, scene: &Value) {
        fs::write(self.path("ball.scene.json"), scene.to_string()).unwrap();
        self.track(&["simulate", "ball.scene.json", "--out", "."]);
    }

    /// Measures, and compares everything that is written but page and overlay.
    fn measure(&mut self, args: &[&str]) {
        let args: Vec<&str> = args.iter().copied().chain(["--out", "out"]).collect();
        let (table, status) = self.track(&args);
        let stem = Path::new(args[0])
            .file_stem()
            .unwrap()
            .to_str()
            .unwrap()
            .to_owned();
        let mut result = self.json(&format!("out/{stem}.result.json"));
        assert_eq!(status, i32::from(result["status"] == "rejected"));
        // The points are in points.csv.
        let points = result["track"]["points"].as_array().unwrap().clone();
        result["track"]["points"] = points.len().into();
        // Another FFmpeg packs the same pictures into other bytes; tests/cli.rs has the digests.
        result["video"]["sha256"] = Value::Null;
        result["calibration"]["sha256"] = Value::Null;
        self.metres_per_pixel = scale(&points);
        self.compare_json("result.json", &result);
        let points = fs::read_to_string(self.path(&format!("out/{stem}.points.csv"))).unwrap();
        self.compare_csv("points.csv", &points);
        self.compare_text("table.txt", &table);
    }

    fn json(&self, name: &str) -> Value {
        serde_json::from_str(&fs::read_to_string(self.path(name)).unwrap()).unwrap()
    }

    fn compare_json(&mut self, name: &str, now: &Value) {
        // Digests of all that is compared here: they would move with the last digit.
        let mut now = now.clone();
        now.as_object_mut().and_then(|object| object.remove("made_by"));
        let now = &now;
        let text = serde_json::to_string_pretty(now).unwrap() + "\n";
        self.compare(name, &text, |golden, _| {
            differences_json(&serde_json::from_str(golden).unwrap(), now)
        });
    }

    fn compare_csv(&mut self, name: &str, now: &str) {
        let metres_per_pixel = self.metres_per_pixel;
        self.compare(name, now, |golden, now| {
            differences_csv(golden, now, &|column, number| match column {
                "u_px" | "v_px" => number("std_px"),
                "x_m" | "z_m" | "y_m" | "off_arc_m" | "residual_x_m" | "residual_y_m" | "residual_z_m"
                    if number("std_px").is_some() =>
                {
                    Some(number("std_px")? * metres_per_pixel)
                }
                _ => number(&format!("{column}_std")),
            })
        });
    }

    fn compare_text(&mut self, name: &str, now: &str) {
        self.compare(name, now, |golden, now| {
            let lines = golden.lines().zip(now.lines()).filter(|(a, b)| a != b);
            let mut out: Vec<String> = lines.map(|(a, b)| format!("{a:?} -> {b:?}")).collect();
            if golden.lines().count() != now.lines().count() {
                out.push("another number of lines".to_owned());
            }
            out
        });
    }

    fn compare(&mut self, name: &str, now: &str, differences: impl Fn(&str, &str) -> Vec<String>) {
        let file = golden_dir(self.name).join(name);
        let golden = fs::read_to_string(&file).ok();
        let found = golden
            .as_deref()
            .map_or_else(|| vec!["no golden file yet".to_owned()], |g| differences(g, now));
        if refreshing() && (!found.is_empty() || golden.is_none()) {
            fs::create_dir_all(golden_dir(self.name)).unwrap();
            fs::write(&file, now).unwrap();
        }
        self.differences
            .extend(found.into_iter().map(|d| format!("{}/{name}: {d}", self.name)));
    }

    fn finish(self) {
        if refreshing() {
            for d in &self.differences {
                println!("moved: {d}");
            }
            return;
        }
        let shown: Vec<&str> = self.differences.iter().take(40).map(String::as_str).collect();
        assert!(
            shown.is_empty(),
            "{} differences from fixtures/golden (where they are meant: make golden):\n{}",
            self.differences.len(),
            shown.join("\n")
        );
    }
}

/// Metres a pixel along a path.
fn scale(points: &[Value]) -> f64 {
    let range = |key: &str| {
        let values = points.iter().filter_map(|p| p[key].as_f64());
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
            (l.min(x), h.max(x))
        });
        high - low
    };
    let scale = range("x_m") / range("u_px");
    if scale.is_finite() { scale } else { 0.0 }
}

/// A steel ball that falls 8 cm, in a small picture without loss; cases change what they are about.
fn scene(change: impl FnOnce(&mut Value)) -> Value {
    let mut scene = json!({
        "schema": "track.scene/1", "seed": 11,
        "ball": {"radius_m": 0.0125, "mass_kg": 0.0639, "inertia_factor": 0.4},
        "contact": {"model": "mu_e", "restitution": 0.78, "friction": 0.07},
        "launch": {"drop_height_m": 0.08, "speed_m_s": 1.0},
        "camera": {"image_size_px": [480, 240], "frame_rate_hz": 240, "exposure_s": 0.0005, "metres_per_pixel": 0.0012,
                   "origin_px": [60, 220], "noise_grey": 2, "codec": "lossless"},
        "look": {"background_grey": 60, "floor_grey": 90, "ball_grey": 200, "shading": 0.5},
        "stop": {"bounces": 2, "tail_s": 0.06}
    });
    change(&mut scene);
    scene
}

/// A scene, rendered and measured with its own calibration.
fn check_scene(name: &'static str, change: impl FnOnce(&mut Value), args: &[&str]) {
    let mut case = Case::new(name);
    case.simulate(&scene(change));
    let calibration = case.json("ball.calib.json");
    case.compare_json("calib.json", &calibration);
    case.measure(&[&["ball.mkv", "--calib", "ball.calib.json"], args].concat());
    case.finish();
}

#[test]
fn side() {
    check_scene("side", |_| {}, &[]);
}

#[test]
fn fast() {
    check_scene("fast", |_| {}, &["--accuracy", "fast"]);
}

#[test]
fn fine() {
    check_scene("fine", |_| {}, &["--accuracy", "fine"]);
}

#[test]
fn bench_and_slope() {
    check_scene(
        "bench",
        |s| {
            s["launch"]["bench"] = json!({"seen_s": 0.1, "track_width_m": 0.0195, "bench_grey": 110});
            s["camera"]["origin_px"] = json!([160, 220]);
            s["floor"] = json!({"slope_deg": 0.3});
            s["stop"]["tail_s"] = 0.1.into();
        },
        &[],
    );
}

#[test]
fn top() {
    check_scene(
        "top",
        |s| {
            s["contact"]["friction"] = 0.2.into();
            s["launch"] = json!({"drop_height_m": 0.25, "speed_m_s": 1.2, "spin_ratio": [-1.0, 0, 0]});
            s["camera"]["view"] = "top".into();
            s["camera"]["image_size_px"] = json!([560, 320]);
            s["camera"]["metres_per_pixel"] = 0.0015.into();
            s["camera"]["origin_px"] = json!([60, 200]);
            s["look"]["shadow"] = 0.2.into();
            s["stop"] = json!({"bounces": 1, "tail_s": 0.2});
        },
        &[],
    );
}

#[test]
fn near_top() {
    check_scene(
        "near_top",
        |s| {
            s["contact"]["friction"] = 0.2.into();
            s["launch"] = json!({"drop_height_m": 0.25, "speed_m_s": 1.2, "spin_ratio": [0, 0, 0]});
            s["camera"]["view"] = "top".into();
            s["camera"]["image_size_px"] = json!([560, 320]);
            s["camera"]["metres_per_pixel"] = 0.0015.into();
            s["camera"]["origin_px"] = json!([60, 160]);
            s["camera"]["distance_m"] = 1.0.into();
            s["stop"] = json!({"bounces": 1, "tail_s": 0.2});
        },
        &[],
    );
}

#[test]
fn lens_and_tilt() {
    check_scene(
        "lens",
        |s| {
            let matrix = json!([[900, 0, 239.5], [0, 900, 119.5], [0, 0, 1]]);
            s["camera"]["lens"] = json!({"camera_matrix": matrix, "distortion": [-0.25, 0.08, 0, 0, 0]});
            s["camera"]["distance_m"] = 1.1.into();
            s["camera"]["tilt_deg"] = 8.0.into();
        },
        &[],
    );
}

#[test]
fn blurred() {
    check_scene("blurred", |s| s["camera"]["exposure_s"] = 0.004.into(), &[]);
}

#[test]
fn small() {
    check_scene(
        "small",
        |s| {
            s["camera"]["metres_per_pixel"] = 0.0035.into();
            s["camera"]["image_size_px"] = json!([240, 120]);
            s["camera"]["origin_px"] = json!([30, 110]);
        },
        &[],
    );
}

#[test]
fn textured() {
    check_scene(
        "textured",
        |s| {
            for (key, value) in [
                ("texture_grey", 6.0),
                ("reflection", 0.15),
                ("shadow", 0.4),
                ("flicker", 0.03),
            ] {
                s["look"][key] = value.into();
            }
        },
        &[],
    );
}

/// A clip that is kept with its scene: libx264 (0.164, in Debian 12) reads a few bytes past its own buffers, so that two
/// H.264 files of the same frames need not be the same to the bit.
#[test]
fn superball_in_h264() {
    let mut case = Case::new("superball");
    for name in ["ball.mp4", "calib.json"] {
        fs::copy(golden_dir("superball").join(name), case.path(name)).unwrap();
    }
    case.measure(&["ball.mp4", "--calib", "calib.json"]);
    case.finish();
}

/// A table that is struck at the impact, so that the camera swings.
#[test]
fn shaken() {
    check_scene(
        "shaken",
        |s| {
            s["camera"]["bump"] = json!({"amplitude_px": [1.0, 2.0]});
            s["look"]["texture_grey"] = 4.0.into();
        },
        &[],
    );
}

/// The scale from the ball, floor and edge unknown.
#[test]
fn ball_as_scale() {
    let mut case = Case::new("ball_as_scale");
    case.simulate(&scene(|_| {}));
    let calib = json!({"schema": "track.calib/1", "scale": {"ball": true}, "ball": {"radius_m": 0.0125}});
    fs::write(case.path("calib.json"), calib.to_string()).unwrap();
    case.measure(&["ball.mkv", "--calib", "calib.json"]);
    case.finish();
}

/// The scale from the fall, the frame rate from the calibration.
#[test]
fn gravity_as_scale() {
    let mut case = Case::new("gravity_as_scale");
    case.simulate(&scene(|_| {}));
    let calib = json!({"schema": "track.calib/1", "scale": {"gravity": true}, "frame_rate_hz": 240,
                       "ball": {"radius_m": 0.0125}});
    fs::write(case.path("calib.json"), calib.to_string()).unwrap();
    case.measure(&["ball.mkv", "--calib", "calib.json"]);
    case.finish();
}

/// The frames as numbered images in `frames/`, those of them that `numbers` names, in its order.
fn as_images(case: &Case, numbers: impl Fn(usize) -> Vec<usize>) {
    fs::create_dir(case.path("frames")).unwrap();
    let mut source = frames::open(&case.path("ball.mkv")).unwrap();
    let mut pictures = Vec::new();
    while let Some(frame) = source.next_frame().unwrap() {
        pictures.push(frame.luma);
    }
    for (i, n) in numbers(pictures.len()).into_iter().enumerate() {
        write_png(&pictures[n], &case.path(&format!("frames/{i:04}.png")));
    }
    let mut calib = case.json("ball.calib.json");
    calib["frame_rate_hz"] = 240.into();
    fs::write(case.path("calib.json"), calib.to_string()).unwrap();
}

#[test]
fn images() {
    let mut case = Case::new("images");
    case.simulate(&scene(|_| {}));
    as_images(&case, |n| (0..n).collect());
    case.measure(&["frames", "--calib", "calib.json"]);
    case.finish();
}

/// A frame missing, and another twice.
#[test]
fn images_dropped_and_duplicated() {
    let mut case = Case::new("images_dropped");
    case.simulate(&scene(|_| {}));
    as_images(&case, |n| {
        let kept = (0..n).filter(|i| *i != 20);
        kept.flat_map(|i| std::iter::repeat_n(i, if i == 62 { 2 } else { 1 }))
            .collect()
    });
    case.measure(&["frames", "--calib", "calib.json"]);
    case.finish();
}

/// Nothing bounces: the recording ends before the floor.
#[test]
fn rejected() {
    let mut case = Case::new("rejected");
    case.simulate(&scene(|_| {}));
    as_images(&case, |_| (0..12).collect());
    case.measure(&["frames", "--calib", "calib.json"]);
    case.finish();
}

fn check_series(name: &'static str) {
    let mut case = Case::new(name);
    let series = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/series");
    fs::copy(series.join(format!("{name}.csv")), case.path("series.csv")).unwrap();
    let (table, _) = case.track(&["fit", "series.csv", "--out", "out"]);
    let fit = case.json("out/fit.json");
    case.compare_json("fit.json", &fit);
    case.compare_text("table.txt", &table);
    case.finish();
}

#[test]
fn series_fig3() {
    check_series("fig3");
}

#[test]
fn series_fig4() {
    check_series("fig4");
}

#[test]
fn series_kharaz2001() {
    check_series("kharaz2001");
}

/// Four recordings of a ball at two speeds and two heights, as a batch.
#[test]
fn batch() {
    let mut case = Case::new("batch");
    for (i, (drop_m, speed)) in [(0.06, 0.8), (0.06, 1.1), (0.1, 0.8), (0.1, 1.1)]
        .into_iter()
        .enumerate()
    {
        case.simulate(&scene(|s| {
            s["seed"] = (30 + i).into();
            s["launch"] = json!({"drop_height_m": drop_m, "speed_m_s": speed});
        }));
        for kind in ["mkv", "calib.json"] {
            fs::rename(
                case.path(&format!("ball.{kind}")),
                case.path(&format!("run{i}.{kind}")),
            )
            .unwrap();
        }
    }
    let videos: Vec<String> = (0..4).map(|i| format!("run{i}.mkv")).collect();
    let args: Vec<&str> = ["batch"]
        .into_iter()
        .chain(videos.iter().map(String::as_str))
        .chain(["--out", "out"])
        .collect();
    let (table, _) = case.track(&args);
    let fit = case.json("out/fit.json");
    case.compare_json("fit.json", &fit);
    let series = fs::read_to_string(case.path("out/series.csv")).unwrap();
    case.compare_csv("series.csv", &series);
    case.compare_text("table.txt", &table);
    case.finish();
}

const BOARD: Board = Board {
    columns: 9,
    rows: 6,
    square_m: 0.025,
};

/// Pictures of a board by a camera, as a careful user takes them, and `calibrate board` with them.
fn check_board(name: &'static str, distortion: [f64; 5], seed: u64) {
    let mut case = Case::new(name);
    let camera = Camera {
        width: 640,
        height: 360,
        focal_px: [520.0, 520.5],
        centre_px: [323.1, 175.9],
        distortion,
    };
    let mut random = Gaussian::new(seed);
    let poses = careful_views(&camera, &BOARD, 6.0, &mut random);
    fs::create_dir(case.path("board")).unwrap();
    for (i, pose) in (0..).zip(&poses) {
        let look = Look {
            seed: 1000 * seed + i,
            ..Look::default()
        };
        write_png(
            &render(&camera, &BOARD, pose, &look),
            &case.path(&format!("board/{i:02}.png")),
        );
    }
    let args = [
        "calibrate",
        "board",
        "board",
        "--pattern",
        "9x6",
        "--square-m",
        "0.025",
        "--plane",
        "board/08.png",
        "--origin",
        "100,300",
        "--ball-radius-m",
        "0.0125",
        "--out",
        "calib.json",
        "--json",
    ];
    let (document, _) = case.track(&args);
    let calib = case.json("calib.json");
    case.compare_json("calib.json", &calib);
    case.compare_json("board.json", &serde_json::from_str(&document).unwrap());
    case.finish();
}

#[test]
fn board_barrel() {
    check_board("board_barrel", [-0.28, 0.09, 0.0, 0.0, 0.0], 3);
}

#[test]
fn board_mild() {
    check_board("board_mild", [-0.05, 0.02, 0.0008, -0.0005, 0.0], 4);
}

#[test]
fn ruler() {
    let mut case = Case::new("ruler");
    case.simulate(&scene(|_| {}));
    let args = [
        "calibrate",
        "ruler",
        "ball.mkv",
        "--from",
        "60,180",
        "--to",
        "420,180",
        "--length-m",
        "0.432",
        "--origin",
        "60,220",
        "--ball-radius-m",
        "0.0125",
        "--out",
        "calib.json",
    ];
    case.track(&args);
    let calib = case.json("calib.json");
    case.compare_json("calib.json", &calib);
    case.measure(&["ball.mkv", "--calib", "calib.json"]);
    case.finish();
}
