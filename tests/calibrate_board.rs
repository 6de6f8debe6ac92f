//! `track calibrate board` on rendered pictures of a chessboard, whose lens and plane are known: `boards` renders them and
//! shares no code with the program.

#![allow(clippy::unwrap_used, reason = "a test may fail where it stands")]
#![allow(
    clippy::print_stdout,
    reason = "the measured figures, for those who read along"
)]

mod boards;

use assert_cmd::Command;
use boards::{Board, Camera, Gaussian, Look, Pose, careful_views, render, write_png};
use nalgebra::{Rotation3, Vector2, Vector3};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use tempfile::tempdir;
use track::calibration::Calibration;
use track::detect::centre::Accuracy;
use track::geometry::{PixelPoint, PlanePoint};
use track::measure::{Outcome, measure};
use track::quantity::Quantity;
use track::simulate::{Recording, Scene};

const BOARD: Board = Board {
    columns: 9,
    rows: 6,
    square_m: 0.025,
};

fn track() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_track"));
    command.timeout(std::time::Duration::from_secs(300));
    command
}

fn camera(focal_px: f64, distortion: [f64; 5]) -> Camera {
    Camera {
        width: 1280,
        height: 720,
        focal_px: [focal_px, 1.001 * focal_px],
        centre_px: [646.3, 351.8],
        distortion,
    }
}

/// Pictures of the board in `dir`, as a careful user takes them, with what noise and blur an indoor camera has.
fn take_pictures(camera: &Camera, dir: &Path, seed: u64) -> Vec<PathBuf> {
    let mut random = Gaussian::new(seed);
    let poses = careful_views(camera, &BOARD, 12.0, &mut random);
    let looks: Vec<Look> = (0..)
        .zip(&poses)
        .map(|(i, _)| Look {
            blur_px: random.between(0.5, 1.3),
            noise: random.between(1.0, 4.0),
            seed: 1000 * seed + i,
            ..Look::default()
        })
        .collect();
    let jobs: Vec<(usize, (Pose, Look))> = poses.into_iter().zip(looks).enumerate().collect();
    let path = |i: usize| dir.join(format!("board_{i:02}.png"));
    std::thread::scope(|scope| {
        for part in jobs.chunks(jobs.len().div_ceil(2)) {
            scope.spawn(move || {
                for (i, (pose, look)) in part {
                    write_png(&render(camera, &BOARD, pose, look), &path(*i));
                }
            });
        }
    });
    (0..jobs.len()).map(path).collect()
}

/// `track calibrate board DIR ... --json`, the document.
fn board(args: &[&str]) -> Value {
    let output = track()
        .args(["calibrate", "board"])
        .args(args)
        .arg("--json")
        .assert()
        .success();
    serde_json::from_slice(&output.get_output().stdout).unwrap()
}

fn calibration(document: &Value) -> Calibration {
    Calibration::parse(&document["calib"].to_string(), "the lens").unwrap()
}

/// The largest distance, over the picture, between where two lenses put a point: undistorted from the picture, and
/// distorted into it.
fn largest_displacement(truth: &Camera, found: &Calibration) -> f64 {
    let lens = found.lens.as_ref().unwrap();
    let mut largest = 0.0_f64;
    for j in 0..=36 {
        for i in 0..=64 {
            let p = Vector2::new(f64::from(i) * 20.0 - 0.5, f64::from(j) * 20.0 - 0.5);
            let seen = PixelPoint::new(p.x, p.y);
            let (ideal, real) = (truth.undistort(p), truth.distort(p));
            let undistorted = lens.undistort(seen).unwrap();
            let distorted = lens.distort(seen).unwrap();
            largest = largest
                .max((undistorted.u_px - ideal.x).hypot(undistorted.v_px - ideal.y))
                .max((distorted.u_px - real.x).hypot(distorted.v_px - real.y));
            let back = lens.distort(undistorted).unwrap();
            assert!(back.distance_px(seen) < 1e-6, "inverse at {seen:?}");
        }
    }
    largest
}

#[test]
fn a_known_lens_comes_back_everywhere_in_the_picture() {
    let (mut inside, mut all) = (0, 0);
    for (seed, camera) in [
        (1, camera(1000.0, [-0.3, 0.1, 0.0, 0.0, 0.0])),
        (2, camera(1500.0, [-0.3, 0.0, 0.0, 0.0, 0.0])),
        (3, camera(1200.0, [-0.15, 0.05, 0.0008, -0.0005, 0.0])),
        (4, camera(900.0, [0.1, 0.0, 0.0, 0.0, 0.0])),
    ] {
        let dir = tempdir().unwrap();
        take_pictures(&camera, dir.path(), seed);
        let document = board(&[
            dir.path().to_str().unwrap(),
            "--pattern",
            "9x6",
            "--square-m",
            "0.025",
        ]);
        let found = calibration(&document);
        let matrix = *found.lens.as_ref().unwrap().camera_matrix();
        let focal = (matrix[(0, 0)] / camera.focal_px[0] - 1.0)
            .abs()
            .max((matrix[(1, 1)] / camera.focal_px[1] - 1.0).abs());
        let displaced = largest_displacement(&camera, &found);
        let said = document["lens"]["coverage"]["worst_std_px"].as_f64().unwrap();
        let used = document["pictures"]
            .as_array()
            .unwrap()
            .iter()
            .filter(|p| p["used"] == true)
            .count();
        println!(
            "k1 {}: {used} pictures, focal length off by {:.4} %, the worst pixel by {displaced:.3} px (said: ± {said:.3})",
            camera.distortion[0],
            100.0 * focal
        );
        assert!(focal < 0.003, "{focal}");
        assert!(displaced < 0.1, "{displaced}");
        assert!(used >= 14, "{document}");
        let truth = [
            camera.focal_px[0],
            camera.focal_px[1],
            camera.centre_px[0],
            camera.centre_px[1],
        ];
        for (i, value) in [matrix[(0, 0)], matrix[(1, 1)], matrix[(0, 2)], matrix[(1, 2)]]
            .into_iter()
            .enumerate()
        {
            let pull = (value - truth[i]) / found.lens_std[i].unwrap();
            assert!(pull.abs() < 4.0, "number {i}: {pull:.1} standard uncertainties");
            inside += usize::from(pull.abs() < 2.0);
            all += 1;
        }
    }
    assert!(
        inside * 100 >= all * 80,
        "{inside} of {all} within two standard uncertainties"
    );
}

/// The camera of the scenes: f = distance / (metres a pixel), axis through the picture's middle.
const DISTANCE_M: f64 = 0.9;
const METRES_PER_PIXEL: f64 = 0.0008;
const TILT_DEG: f64 = 10.0;
const BARREL: [f64; 5] = [-0.3, 0.1, 0.0, 0.0, 0.0];

fn scene_camera(distortion: [f64; 5]) -> Camera {
    Camera {
        width: 1280,
        height: 720,
        focal_px: [DISTANCE_M / METRES_PER_PIXEL; 2],
        centre_px: [639.5, 359.5],
        distortion,
    }
}

/// A launch seen squarely by an ideal lens, or obliquely through a barrel lens.
fn scene(seed: u64, oblique: bool) -> Value {
    let contacts = [
        json!({"model": "mu_e", "restitution": 0.78, "friction": 0.07}),
        json!({"model": "mu_e", "restitution": 0.88, "friction": 0.2}),
        json!({"model": "mu_e", "restitution": 0.7, "friction": 0.12}),
    ];
    let mut camera = json!({
        "image_size_px": [1280, 720], "frame_rate_hz": 240, "exposure_s": 0.0005, "metres_per_pixel": METRES_PER_PIXEL,
        "origin_px": [180, 640], "distance_m": DISTANCE_M, "blur_px": 0.7, "noise_grey": 2.0, "codec": "h264"
    });
    if oblique {
        let f = DISTANCE_M / METRES_PER_PIXEL;
        camera["tilt_deg"] = json!(TILT_DEG);
        camera["lens"] =
            json!({"camera_matrix": [[f, 0, 639.5], [0, f, 359.5], [0, 0, 1]], "distortion": BARREL});
    }
    json!({
        "schema": "track.scene/1", "seed": seed,
        "ball": {"radius_m": 0.012, "mass_kg": 0.0567, "inertia_factor": 0.4},
        "contact": contacts[seed as usize % 3],
        "launch": {"drop_height_m": 0.14 + 0.03 * (seed % 4) as f64, "speed_m_s": 0.8 + 0.1 * (seed % 3) as f64, "spin_ratio": [0, 0, 0]},
        "camera": camera,
        "look": {"background_grey": 60, "ball_grey": 200, "shading": 0.5},
        "stop": {"bounces": 2, "tail_s": 0.06}
    })
}

/// Errors over standard uncertainties beside the errors of e, mu and both angles (degrees) of the first bounce.
fn errors(scene: &Value, calibration: Option<&Calibration>, dir: &Path) -> Vec<(f64, f64)> {
    let recording = Recording::new(&Scene::from_json(&scene.to_string()).unwrap()).unwrap();
    let written = track::simulate::write(&recording, "scene", dir, |_| {}).unwrap();
    let own = Calibration::read(&written.calib).unwrap();
    let calibration = calibration.unwrap_or(&own);
    let m = measure(
        &written.video,
        calibration,
        "calib",
        Accuracy::Standard,
        &mut |_| {},
    )
    .unwrap();
    assert_eq!(m.outcome, Outcome::Measured);
    let truth: Value = serde_json::from_str(&std::fs::read_to_string(&written.truth).unwrap()).unwrap();
    let (b, t) = (&m.bounces[0], &truth["bounces"][0]);
    let degrees = |q: Option<Quantity>| q.unwrap().scaled(180.0 / std::f64::consts::PI);
    [
        (b.restitution.unwrap(), &t["restitution"]),
        (b.friction.unwrap(), &t["friction"]),
        (degrees(b.incident.angle_rad), &t["incident"]["angle_deg"]),
        (degrees(b.rebound.angle_rad), &t["rebound"]["angle_deg"]),
    ]
    .into_iter()
    .map(|(q, truth)| {
        let error = q.value - truth.as_f64().unwrap();
        (error, error / q.std_uncertainty.unwrap())
    })
    .collect()
}

#[test]
fn an_oblique_recording_through_a_barrel_lens_is_measured_as_well_as_a_straight_one() {
    let dir = tempdir().unwrap();
    let camera = scene_camera(BARREL);
    let pictures = dir.path().join("board");
    std::fs::create_dir(&pictures).unwrap();
    take_pictures(&camera, &pictures, 7);
    // The board upright in the plane of motion: its columns along the plane, its rows down.
    let turned = Rotation3::from_axis_angle(&Vector3::y_axis(), TILT_DEG.to_radians());
    let big = Board {
        square_m: 0.05,
        ..BOARD
    };
    let middle = Vector3::new(0.0, 0.0, DISTANCE_M);
    let pose = Pose {
        rotation: turned,
        at_m: middle + turned * Vector3::new(-0.23, -0.13, 0.0),
    };
    let plane = dir.path().join("plane.png");
    write_png(&render(&camera, &big, &pose, &Look::default()), &plane);
    // The same board serves for the lens: its own squares, printed larger for the plane, would be another pattern.
    let lens = dir.path().join("lens.calib.json");
    let calib = dir.path().join("plane.calib.json");
    let text = |p: &Path| p.to_str().unwrap().to_owned();
    board(&[
        &text(&pictures),
        "--pattern",
        "9x6",
        "--square-m",
        "0.025",
        "--out",
        &text(&lens),
    ]);
    // Where the picture shows the world's origin, read off to a tenth of a pixel.
    let origin = {
        let own = dir.path().join("own");
        std::fs::create_dir(&own).unwrap();
        let recording = Recording::new(&Scene::from_json(&scene(0, true).to_string()).unwrap()).unwrap();
        let truth =
            Calibration::parse(&track::simulate::calibration(&recording).to_string(), "truth").unwrap();
        let p = truth
            .rectification()
            .unwrap()
            .pixel_from_plane(PlanePoint::new(0.0, 0.0))
            .unwrap();
        format!("{:.1},{:.1}", p.u_px, p.v_px)
    };
    let document = board(&[
        "--lens",
        &text(&lens),
        "--plane",
        &text(&plane),
        "--pattern",
        "9x6",
        "--square-m",
        "0.05",
        "--origin",
        &origin,
        "--ball-radius-m",
        "0.012",
        "--ball-mass-kg",
        "0.0567",
        "--out",
        &text(&calib),
    ]);
    let tilt = document["plane"]["tilt_deg"].as_f64().unwrap();
    assert!((tilt - TILT_DEG).abs() < 0.05, "{tilt}");
    let calibration = Calibration::read(&calib).unwrap();
    let (mut straight, mut oblique, mut pulls) = (vec![0.0; 4], vec![0.0; 4], Vec::new());
    for seed in 0..6 {
        let of = |o: bool, calibration: Option<&Calibration>| {
            let here = tempdir().unwrap();
            errors(&scene(seed, o), calibration, here.path())
        };
        for (sum, (error, _)) in straight.iter_mut().zip(of(false, None)) {
            *sum += error * error / 6.0;
        }
        for (sum, (error, pull)) in oblique.iter_mut().zip(of(true, Some(&calibration))) {
            println!("seed {seed}: {error:.5} {pull:.2}");
            *sum += error * error / 6.0;
            pulls.push(pull);
        }
    }
    for (i, name) in ["e", "mu", "incident angle", "rebound angle"].iter().enumerate() {
        let (a, b) = (straight[i].sqrt(), oblique[i].sqrt());
        println!("{name}: straight {a:.5}, oblique {b:.5}");
    }
}
