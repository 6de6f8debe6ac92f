//! `track calibrate board` on rendered pictures of a chessboard, whose lens and plane are known: `boards` renders them and
//! shares no code with the program.

use crate::boards::{self, Board, Camera, Gaussian, Look, Pose, careful_views, render, write_png};
use crate::rendered::{Rendered, standard};
use assert_cmd::Command;
use nalgebra::{Rotation3, Vector2, Vector3};
use predicates::prelude::*;
use predicates::str::contains;
use serde_json::{Value, json};
use std::path::Path;
use std::sync::OnceLock;
use tempfile::tempdir;
use track::calibration::{Calibration, Scale};
use track::detect::centre::Accuracy;
use track::frames::{Coding, Luma, VideoWriter};
use track::geometry::{PixelPoint, PlanePoint};
use track::pipeline::{Outcome, PointUse, measure};
use track::quantity::Quantity;
use track::simulate::{Scene, SimulatedRecording};

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
fn take_pictures(camera: &Camera, board: &Board, dir: &Path, seed: u64) {
    let mut random = Gaussian::new(seed);
    let poses = careful_views(camera, board, 12.0, &mut random);
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
            let path = &path;
            scope.spawn(move || {
                for (i, (pose, look)) in part {
                    write_png(&render(camera, board, pose, look), &path(*i));
                }
            });
        }
    });
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
        take_pictures(&camera, &BOARD, dir.path(), seed);
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
const DISTANCE_M: f64 = 1.6;
const METRES_PER_PIXEL: f64 = 0.0008;
const FOCAL_PX: f64 = DISTANCE_M / METRES_PER_PIXEL;
const TILT_DEG: f64 = 10.0;
/// 30 px in the picture's corners.
const BARREL: [f64; 5] = [-0.3, 0.1, 0.0, 0.0, 0.0];
/// A board of 45 by 30 cm, for the lens and for the plane.
const LARGE: Board = Board {
    square_m: 0.05,
    ..BOARD
};

fn scene_camera() -> Camera {
    Camera {
        width: 1280,
        height: 720,
        focal_px: [FOCAL_PX; 2],
        centre_px: [639.5, 359.5],
        distortion: BARREL,
    }
}

/// The board upright in the plane of motion of the scenes, its middle moved by some metres along the plane.
fn board_in_plane(right_m: f64, down_m: f64) -> Pose {
    let turned = Rotation3::from_axis_angle(&Vector3::y_axis(), TILT_DEG.to_radians());
    let half = Vector3::new(right_m - 4.0 * LARGE.square_m, down_m - 2.5 * LARGE.square_m, 0.0);
    Pose {
        rotation: turned,
        at_m: Vector3::new(0.0, 0.0, DISTANCE_M) + turned * half,
    }
}

/// A launch seen squarely by an ideal lens, or obliquely through a barrel lens; no two alike, as a codec's errors repeat
/// with the path's whole pixels.
fn scene(seed: u64, oblique: bool) -> Value {
    let part = |golden: f64| (golden * (seed + 1) as f64).fract();
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
        camera["tilt_deg"] = json!(TILT_DEG);
        let matrix = [[FOCAL_PX, 0.0, 639.5], [0.0, FOCAL_PX, 359.5], [0.0, 0.0, 1.0]];
        camera["lens"] = json!({"camera_matrix": matrix, "distortion": BARREL});
    }
    json!({
        "schema": "track.scene/1", "seed": seed,
        "ball": {"radius_m": 0.012, "mass_kg": 0.0567, "inertia_factor": 0.4},
        "contact": contacts[seed as usize % 3],
        "launch": {"drop_height_m": 0.14 + 0.1 * part(0.618_034), "speed_m_s": 0.75 + 0.3 * part(0.754_878)},
        "camera": camera,
        "look": {"background_grey": 60, "ball_grey": 200, "shading": 0.5},
        "stop": {"bounces": 2, "tail_s": 0.06}
    })
}

/// Errors of e, mu and both angles (degrees) of the first bounce.
fn errors(r: &Rendered, calibration: &Calibration) -> [f64; 4] {
    let m = standard(&r.video, calibration);
    assert_eq!(m.outcome, Outcome::Measured);
    let (b, t) = (&m.bounces[0], &r.truth["bounces"][0]);
    let degrees = |q: Option<Quantity>| q.unwrap().value.to_degrees();
    let of = |v: &Value| v.as_f64().unwrap();
    [
        b.restitution.unwrap().value - of(&t["restitution"]),
        // Of a bounce that did not slide the change of speed is a lower limit for friction; the truth has that same ratio.
        b.friction.or(b.friction_at_least).unwrap().value - of(&t["friction"]),
        degrees(b.incident.angle_rad) - of(&t["incident"]["angle_deg"]),
        degrees(b.rebound.angle_rad) - of(&t["rebound"]["angle_deg"]),
    ]
}

/// Where the oblique picture shows the world's origin, as a user may read it off: to half a pixel.
fn origin_read_off() -> String {
    let recording = SimulatedRecording::new(&Scene::from_json(&scene(0, true).to_string()).unwrap()).unwrap();
    let truth = Calibration::parse(&track::simulate::calibration(&recording).to_string(), "truth").unwrap();
    let map = truth.rectification().unwrap();
    let p = map.pixel_from_plane(PlanePoint::new(0.0, 0.0)).unwrap();
    format!(
        "{:.1},{:.1}",
        (2.0 * p.u_px).round() / 2.0,
        (2.0 * p.v_px).round() / 2.0
    )
}

/// Lens and plane of the oblique scenes from rendered pictures of the board, through the program.
fn oblique_calibration() -> &'static (Calibration, Value) {
    static MADE: OnceLock<(Calibration, Value)> = OnceLock::new();
    MADE.get_or_init(|| make_oblique_calibration(tempdir().unwrap().path()))
}

fn make_oblique_calibration(dir: &Path) -> (Calibration, Value) {
    let pictures = dir.join("board");
    std::fs::create_dir(&pictures).unwrap();
    take_pictures(&scene_camera(), &LARGE, &pictures, 7);
    let plane = dir.join("plane.png");
    write_png(
        &render(
            &scene_camera(),
            &LARGE,
            &board_in_plane(0.0, 0.0),
            &Look::default(),
        ),
        &plane,
    );
    let calib = dir.join("oblique.calib.json");
    let text = |p: &Path| p.to_str().unwrap().to_owned();
    let document = board(&[
        &text(&pictures),
        "--plane",
        &text(&plane),
        "--pattern",
        "9x6",
        "--square-m",
        "0.05",
        "--origin",
        &origin_read_off(),
        "--ball-radius-m",
        "0.012",
        "--ball-mass-kg",
        "0.0567",
        "--out",
        &text(&calib),
    ]);
    assert!(dir.join("oblique.marks.png").exists());
    (Calibration::read(&calib).unwrap(), document)
}

/// Root mean squares of the errors of many recordings: straight, oblique with the exact calibration and with that of a
/// board, and what these two are apart.
fn rms_errors(seeds: u64, board: &Calibration) -> [[f64; 4]; 4] {
    let of_seed = |seed: u64| {
        let (straight, oblique) = (
            Rendered::new(&scene(seed, false)),
            Rendered::new(&scene(seed, true)),
        );
        let exact = errors(&oblique, &oblique.calibration);
        let found = errors(&oblique, board);
        let apart = std::array::from_fn(|i| found[i] - exact[i]);
        [errors(&straight, &straight.calibration), exact, found, apart]
    };
    let seeds: Vec<u64> = (0..seeds).collect();
    let each: Vec<[[f64; 4]; 4]> = std::thread::scope(|scope| {
        let part = |part: &[u64]| part.iter().map(|&seed| of_seed(seed)).collect::<Vec<_>>();
        let halves: Vec<_> = seeds
            .chunks(seeds.len().div_ceil(2))
            .map(|half| scope.spawn(move || part(half)))
            .collect();
        halves.into_iter().flat_map(|h| h.join().unwrap()).collect()
    });
    let mean_square =
        |k: usize, i: usize| each.iter().map(|e| e[k][i].powi(2)).sum::<f64>() / each.len() as f64;
    std::array::from_fn(|k| std::array::from_fn(|i| mean_square(k, i).sqrt()))
}

#[test]
fn an_oblique_recording_through_a_barrel_lens_is_nearly_as_good_as_a_straight_one() {
    let (calibration, document) = oblique_calibration();
    let tilt = document["plane"]["tilt_deg"].as_f64().unwrap();
    let distance = document["plane"]["distance_m"].as_f64().unwrap();
    let lean = document["plane"]["lean_deg"].as_f64().unwrap();
    assert!((tilt - TILT_DEG).abs() < 0.02, "{tilt}");
    // What calib.json calls distance_m: along the optical axis, as the scene says it.
    assert!((distance - DISTANCE_M).abs() < 0.001, "{distance}");
    assert!(lean.abs() < 1.0, "{lean}");
    let [straight, exact, board, apart] = rms_errors(6, calibration);
    for (i, name) in ["e", "mu", "incident angle", "rebound angle"].iter().enumerate() {
        println!(
            "{name}: rms error {:.6} straight, {:.6} oblique ({:.2} times), {:.6} by a board's calibration ({:.2} times; \
             {:.6} from the exact one's)",
            straight[i],
            exact[i],
            exact[i] / straight[i],
            board[i],
            board[i] / straight[i],
            apart[i]
        );
        assert!(exact[i] < 2.0 * straight[i], "{name}");
        assert!(board[i] < 2.0 * straight[i], "{name}");
    }
}

/// Root mean square distance of the centres used from the truth, px.
fn centre_error_px(r: &Rendered, accuracy: Accuracy) -> f64 {
    let m = measure(&r.video, &r.calibration, "calib", accuracy, &mut |_| {}).unwrap();
    let used = m
        .track
        .points
        .iter()
        .filter(|p| matches!(p.use_, PointUse::Used(_)));
    let squares: Vec<f64> = used
        .map(|p| {
            let truth = &r.truth["centres"][p.frame];
            let at = PixelPoint::new(truth["u_px"].as_f64().unwrap(), truth["v_px"].as_f64().unwrap());
            p.pixel.distance_px(at).powi(2)
        })
        .collect();
    assert!(squares.len() > 80, "{}", squares.len());
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

/// Where no noise hides it: a ball of 30 px drawn out by up to 1.5 px has its centre where a round one has it.
#[test]
fn a_drawn_out_ball_has_its_centre_where_a_round_one_has_it_at_every_accuracy() {
    let clear = |oblique: bool| {
        let mut scene = scene(0, oblique);
        scene["camera"]["noise_grey"] = json!(0.3);
        scene["camera"]["codec"] = json!("lossless");
        scene["ball"]["radius_m"] = json!(0.024);
        scene["camera"]["origin_px"] = json!([120, 690]);
        Rendered::new(&scene)
    };
    let (straight, oblique) = (clear(false), clear(true));
    for accuracy in [Accuracy::Fast, Accuracy::Standard, Accuracy::Fine] {
        let [round, drawn_out] = [&straight, &oblique].map(|r| centre_error_px(r, accuracy));
        println!("{accuracy:?}: centres off by {round:.4} px straight, {drawn_out:.4} px oblique");
        assert!(
            drawn_out < 1.2 * round + 0.002,
            "{accuracy:?}: {round} {drawn_out}"
        );
    }
}

#[test]
fn the_plane_is_where_the_board_stood_within_the_stated_deviations() {
    let (calibration, _) = oblique_calibration();
    let recording = SimulatedRecording::new(&Scene::from_json(&scene(0, true).to_string()).unwrap()).unwrap();
    let exact = Calibration::parse(&track::simulate::calibration(&recording).to_string(), "truth").unwrap();
    let maps = |c: &Calibration| c.rectification().unwrap();
    let (found, truth) = (maps(calibration), maps(&exact));
    let deviated: Vec<_> = calibration.deviated().iter().map(maps).collect();
    assert!(!deviated.is_empty() && deviated.len() <= 15);
    // Lengths all over the picture from one place: the origin's own doubt is another number.
    let foot = PixelPoint::new(300.0, 600.0);
    let (mut inside, mut all, mut worst) = (0, 0, 0.0_f64);
    for k in 0..24 {
        let p = PixelPoint::new(f64::from(k % 6) * 240.0 + 40.0, f64::from(k / 6) * 210.0 + 45.0);
        let way = |map: &track::calibration::Rectification| {
            let (a, b) = (
                map.plane_from_pixel(foot).unwrap(),
                map.plane_from_pixel(p).unwrap(),
            );
            [b.right - a.right, b.up - a.up]
        };
        let (ours, theirs) = (way(&found), way(&truth));
        for i in 0..2 {
            let std = deviated
                .iter()
                .map(|d| (way(d)[i] - ours[i]).powi(2))
                .sum::<f64>()
                .sqrt();
            let error = ours[i] - theirs[i];
            worst = worst.max(error.abs());
            assert!(
                error.abs() < 4.0 * std,
                "{p:?}: {error:.2e} m, {:.1} standard uncertainties",
                error / std
            );
            inside += usize::from(error.abs() < 2.0 * std);
            all += 1;
        }
    }
    println!(
        "lengths in the plane are right to {:.3} mm; {inside} of {all} within two standard uncertainties",
        1e3 * worst
    );
    assert!(worst < 2e-4, "{worst}");
    // Not independent (15 numbers lie behind them), but far from all outside.
    assert!(inside * 100 >= all * 75, "{inside} of {all}");
}

#[test]
fn a_lens_once_found_serves_for_another_plane() {
    let dir = tempdir().unwrap();
    let pictures = dir.path().join("board");
    std::fs::create_dir(&pictures).unwrap();
    take_pictures(&scene_camera(), &LARGE, &pictures, 8);
    let text = |p: &Path| p.to_str().unwrap().to_owned();
    let lens = dir.path().join("lens.calib.json");
    let first = board(&[
        &text(&pictures),
        "--pattern",
        "9x6",
        "--square-m",
        "0.05",
        "--out",
        &text(&lens),
    ]);
    assert!(first["plane"].is_null() && !dir.path().join("lens.marks.png").exists());
    assert!(first["warnings"].to_string().contains("scale_from_fall"));
    assert_eq!(calibration(&first).scale, Scale::Gravity);
    // Nobody said where "up" is or how strong gravity: the fall tells, and 9.81 is good to what it is anywhere.
    assert!(first["calib"].get("up_px").is_none() && first["calib"].get("gravity_m_s2").is_none());
    let turned = calibration(&board(&[
        &text(&pictures),
        "--pattern",
        "9x6",
        "--square-m",
        "0.05",
        "--up",
        "2,0",
        "--gravity-m-s2",
        "9.803",
    ]));
    assert_eq!((turned.up_given, turned.up_px), (true, [1.0, 0.0]));
    assert_eq!((turned.gravity_given, turned.gravity_m_s2), (true, 9.803));
    let plane = dir.path().join("plane.png");
    let pose = board_in_plane(-0.2, 0.1);
    write_png(&render(&scene_camera(), &LARGE, &pose, &Look::default()), &plane);
    let second = board(&[
        "--lens",
        &text(&lens),
        "--plane",
        &text(&plane),
        "--pattern",
        "9x6",
        "--square-m",
        "0.05",
    ]);
    assert!(
        (second["plane"]["tilt_deg"].as_f64().unwrap() - TILT_DEG).abs() < 0.05,
        "{second}"
    );
    let c = calibration(&second);
    assert!(!c.has_origin() && !c.deviations.is_empty());
    assert!(!c.up_given && second["calib"].get("up_px").is_none());
    assert_eq!(c.lens, Calibration::read(&lens).unwrap().lens);
    // The lower left inner corner is (0, 0), the upper right one 8 squares to the right and 5 up.
    let seen = boards::corners(&scene_camera(), &LARGE, &pose);
    let map = c.rectification().unwrap();
    for (i, x, z) in [(45, 0.0, 0.0), (8, 0.4, 0.25)] {
        let p = map
            .plane_from_pixel(PixelPoint::new(seen[i].x, seen[i].y))
            .unwrap();
        assert!((p.right - x).abs() < 2e-5 && (p.up - z).abs() < 2e-5, "{p:?}");
    }
    // The ruler takes the lens too.
    let ruled = track()
        .args([
            "calibrate",
            "ruler",
            &text(&plane),
            "--lens",
            &text(&lens),
            "--from",
            "200,600",
            "--to",
            "1000,620",
        ])
        .args(["--length-m", "0.6", "--json"])
        .assert()
        .success();
    let c = Calibration::parse(&String::from_utf8_lossy(&ruled.get_output().stdout), "ruler").unwrap();
    assert!(c.lens.is_some() && !c.deviations.is_empty());
}

/// The program refuses with status 2, says all `words`, and leaves no file.
fn refused(args: &[&str], words: &[&str]) {
    let dir = tempdir().unwrap();
    let out = dir.path().join("never.calib.json");
    let assert = track()
        .args(["calibrate", "board", "--out", out.to_str().unwrap()])
        .args(args)
        .assert()
        .code(2)
        .stdout("")
        .stderr(contains("panicked").not());
    let told = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
    for word in words {
        assert!(told.contains(word), "{word:?} in {told}");
    }
    assert!(std::fs::read_dir(dir.path()).unwrap().next().is_none());
}

/// A small picture of the board, for what does not need precision.
fn small(angles_deg: [f64; 3], right: f64, seed: u64) -> Luma {
    let camera = Camera {
        width: 480,
        height: 320,
        focal_px: [420.0; 2],
        centre_px: [239.5, 159.5],
        distortion: [-0.1, 0.0, 0.0, 0.0, 0.0],
    };
    let middle = Vector3::new(0.05 * right, 0.01 * right, 0.36);
    let look = Look {
        seed,
        ..Look::default()
    };
    render(
        &camera,
        &BOARD,
        &Pose::of_middle(&BOARD, middle, angles_deg),
        &look,
    )
}

#[test]
fn pictures_that_give_no_lens_are_told_what_to_do() {
    let dir = tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let pattern = ["--pattern", "9x6", "--square-m", "0.025"];
    // No board.
    let empty = Luma::from_fn(480, 320, |u, v| ((v * 480 + u) % 251) as u8);
    write_png(&empty, Path::new(&path("empty.png")));
    refused(
        &[&[path("empty.png").as_str()][..], &pattern].concat(),
        &["no board of 9x6 inner corners", "the picture", "10 by 7 squares"],
    );
    // Many of them: what they have in common is said once.
    let many: Vec<String> = (0..5).map(|i| path(&format!("empty_{i}.png"))).collect();
    many.iter().for_each(|name| write_png(&empty, Path::new(name)));
    let many: Vec<&str> = many.iter().map(String::as_str).collect();
    refused(
        &[&many[..], &pattern].concat(),
        &["empty_2.png and 2 more: set aside: no board found"],
    );
    // The number of squares in place of corners, and another wrong one.
    write_png(&small([10.0, 5.0, 3.0], 0.0, 1), Path::new(&path("board.png")));
    for wrong in ["10x7", "8x5"] {
        refused(
            &[
                path("board.png").as_str(),
                "--pattern",
                wrong,
                "--square-m",
                "0.025",
            ],
            &["try --pattern 9x6", "where four squares meet"],
        );
    }
    // All alike: the same place, and the same square view nearer and farther.
    let same: Vec<String> = (0..5_u32)
        .map(|i| {
            let name = path(&format!("same_{i}.png"));
            write_png(
                &small([10.0, 5.0, 3.0], 0.002 * f64::from(i), u64::from(i)),
                Path::new(&name),
            );
            name
        })
        .collect();
    let same: Vec<&str> = same.iter().map(String::as_str).collect();
    refused(
        &[&same[..], &pattern].concat(),
        &[
            "not determined",
            "one usable picture",
            "in the same place as",
            "20 to 40 degrees",
        ],
    );
    let square: Vec<String> = (0..5_u32)
        .map(|i| {
            let name = path(&format!("square_{i}.png"));
            write_png(
                &small([0.0; 3], 0.5 * f64::from(i) - 1.0, u64::from(i)),
                Path::new(&name),
            );
            name
        })
        .collect();
    let square: Vec<&str> = square.iter().map(String::as_str).collect();
    refused(
        &[&square[..], &pattern].concat(),
        &["not determined", "too much alike", "turned by 20 to 40 degrees"],
    );
    // Files and patterns that are none.
    refused(
        &[&["no/such.png"][..], &pattern].concat(),
        &["no/such.png", "no such file"],
    );
    refused(
        &[
            path("board.png").as_str(),
            "--pattern",
            "9",
            "--square-m",
            "0.025",
        ],
        &["9x6"],
    );
    refused(
        &[
            path("board.png").as_str(),
            "--pattern",
            "2x6",
            "--square-m",
            "0.025",
        ],
        &["2x6", "3 to 100"],
    );
    refused(
        &[path("board.png").as_str(), "--pattern", "9x6", "--square-m", "0"],
        &["above 0"],
    );
    std::fs::write(path("text.png"), "not a picture").unwrap();
    refused(
        &[
            &[path("text.png").as_str(), path("board.png").as_str()][..],
            &pattern,
        ]
        .concat(),
        &["text.png: set aside", "cannot be decoded"],
    );
}

#[test]
fn a_plane_without_its_board_is_told() {
    let dir = tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let lens = path("lens.calib.json");
    std::fs::write(
        &lens,
        json!({"schema": "track.calib/1", "image_size_px": [480, 320], "scale": {"gravity": true},
               "lens": {"camera_matrix": [[420, 0, 239.5], [0, 420, 159.5], [0, 0, 1]], "distortion": [-0.1, 0, 0, 0, 0]}})
        .to_string(),
    )
    .unwrap();
    let pattern = ["--pattern", "9x6", "--square-m", "0.025", "--lens", &lens];
    let plane = |picture: &Luma, more: &[&str], words: &[&str]| {
        write_png(picture, Path::new(&path("plane.png")));
        refused(
            &[&["--plane", path("plane.png").as_str()], &pattern[..], more].concat(),
            words,
        );
    };
    let grey = |w: usize, h: usize| Luma {
        width: w,
        height: h,
        data: vec![100; w * h],
    };
    plane(&grey(480, 320), &[], &["--plane", "no board of 9x6"]);
    plane(&grey(640, 320), &[], &["640x320", "480x320", "same mode"]);
    plane(
        &small([0.0, 0.0, 44.0], 0.0, 1),
        &[],
        &["leans by 44", "spirit level"],
    );
    plane(
        &small([0.0, 0.0, 2.0], 0.0, 1),
        &["--floor", "9999,9999"],
        &["--floor", "lens has no place"],
    );
    plane(
        &small([0.0, 0.0, 2.0], 0.0, 1),
        &["--origin", "9999,-9999"],
        &["--origin", "lens has no place"],
    );
    refused(&pattern, &["--plane"]);
    let none = path("none.calib.json");
    std::fs::write(
        &none,
        r#"{"schema": "track.calib/1", "scale": {"gravity": true}}"#,
    )
    .unwrap();
    refused(
        &[
            "--plane",
            &path("plane.png"),
            "--pattern",
            "9x6",
            "--square-m",
            "0.025",
            "--lens",
            &none,
        ],
        &["holds no lens"],
    );
    // Which edge is upright is told by --up: on its side the board leans by nothing.
    write_png(&small([0.0, 0.0, 2.0], 0.0, 1), Path::new(&path("plane.png")));
    for (up, direction) in [("0,-1", [0.0, -1.0]), ("1,0", [1.0, 0.0]), ("-1,0", [-1.0, 0.0])] {
        let document = board(&[&["--plane", path("plane.png").as_str(), "--up", up], &pattern[..]].concat());
        let map = calibration(&document).rectification().unwrap();
        let middle = PixelPoint::new(239.5, 159.5);
        let ahead = PixelPoint::new(
            middle.u_px + 10.0 * direction[0],
            middle.v_px + 10.0 * direction[1],
        );
        let (a, b) = (
            map.plane_from_pixel(middle).unwrap(),
            map.plane_from_pixel(ahead).unwrap(),
        );
        assert!(b.up - a.up > 5.0 * (b.right - a.right).abs(), "{up}: {a:?} {b:?}");
        assert!((document["plane"]["lean_deg"].as_f64().unwrap().abs() - 2.0).abs() < 0.3);
    }
}

#[test]
fn a_video_of_the_board_is_as_good_as_pictures() {
    let dir = tempdir().unwrap();
    let video = dir.path().join("board.mkv");
    let mut writer = VideoWriter::create(&video, 480, 320, 5.0, Coding::Lossless).unwrap();
    for i in 0..12_u32 {
        let turn = 25.0 * f64::from(i).cos();
        let lean = 25.0 * f64::from(i).sin();
        let part = f64::from(i % 3) - 1.0;
        writer
            .write(&small([turn, lean, 4.0 * part], part, u64::from(i)))
            .unwrap();
    }
    writer.finish().unwrap();
    // Down and across exchanged: the same board.
    let document = board(&[video.to_str().unwrap(), "--pattern", "6x9", "--square-m", "0.025"]);
    let used = document["pictures"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|p| p["used"] == true)
        .count();
    assert!(used >= 10, "{document}");
    let name = document["pictures"][3]["name"].as_str().unwrap();
    assert!(name.contains("board.mkv at 0.60 s"), "{name}");
    let matrix = *calibration(&document).lens.unwrap().camera_matrix();
    assert!((matrix[(0, 0)] / 420.0 - 1.0).abs() < 0.01, "{matrix}");
}
