//! Top views by near cameras, rendered and measured: the azimuth asked for to 0.2°, whatever the spin, the direction, the
//! place in the picture and the camera's distance, and with it e; what an uncorrected perspective is called; what stays unknown.

use crate::rendered::{Rendered, standard};
use assert_cmd::Command;
use serde_json::{Value, json};
use std::sync::OnceLock;
use track::calibration::{Calibration, Lens, Scale};
use track::impact::Bounce;
use track::pipeline::{Measurement, Outcome};
use track::quantity::Quantity;

/// Half of the 95 % interval is two of them; of a dozen comparisons none is beyond three.
const MOST_SIGMAS: f64 = 3.0;

/// Asked for, degrees.
const AZIMUTH_LIMIT_DEG: f64 = 0.2;

/// A launch seen from above: small pictures, a shaded ball of 8 px with its shadow.
struct Top {
    distance_m: f64,
    contact: Value,
    drop_m: f64,
    speed_m_s: f64,
    spin: [f64; 3],
    origin_px: [f64; 2],
}

impl Top {
    fn scene(&self, seed: usize) -> Value {
        json!({
            "schema": "track.scene/1", "seed": seed,
            "ball": {"radius_m": 0.0125, "mass_kg": 0.0639, "inertia_factor": 0.4},
            "contact": self.contact,
            "launch": {"drop_height_m": self.drop_m, "speed_m_s": self.speed_m_s, "spin_ratio": self.spin},
            "camera": {"view": "top", "image_size_px": [560, 320], "frame_rate_hz": 240, "exposure_s": 0.0005,
                       "metres_per_pixel": 0.0015, "origin_px": self.origin_px, "distance_m": self.distance_m,
                       "blur_px": 0.6, "noise_grey": 1.5, "codec": "lossless"},
            "look": {"background_grey": 60, "floor_grey": 70, "ball_grey": 200, "shading": 0.4, "shadow": 0.2},
            "stop": {"bounces": 1, "tail_s": 0.2}
        })
    }
}

fn mu_e(restitution: f64, friction: f64) -> Value {
    json!({"model": "mu_e", "restitution": restitution, "friction": friction})
}

fn e_e(restitution: f64, e_x: f64, e_y: f64) -> Value {
    json!({"model": "e_e", "restitution": restitution, "tangential_restitution_x": e_x, "tangential_restitution_y": e_y})
}

/// That nothing is claimed which needs the height of the ball.
fn assert_no_heights(b: &Bounce) {
    assert_eq!(
        (
            b.restitution,
            b.friction,
            b.incident.vz_m_s,
            b.rebound.vz_m_s,
            b.incident.angle_rad
        ),
        (None, None, None, None, None)
    );
}

/// The launch that most tests look at.
fn usual() -> &'static Rendered {
    static RENDERED: OnceLock<Rendered> = OnceLock::new();
    RENDERED.get_or_init(|| {
        let top = Top {
            distance_m: 2.0,
            contact: mu_e(0.78, 0.2),
            drop_m: 0.25,
            speed_m_s: 1.2,
            spin: [-1.0, 0.0, 0.0],
            origin_px: [60.0, 220.0],
        };
        Rendered::new(&top.scene(1))
    })
}

/// What is measured on it.
fn usual_measured() -> &'static Measurement {
    static MEASURED: OnceLock<Measurement> = OnceLock::new();
    MEASURED.get_or_init(|| standard(&usual().video, &usual().calibration))
}

fn azimuth_deg(bounce: &Bounce) -> Quantity {
    bounce.azimuth_rad.unwrap().scaled(180.0 / std::f64::consts::PI)
}

/// That `found` is `truth` within `limit` and its own uncertainty.
fn assert_near(found: Quantity, truth: f64, limit: f64, what: &str) {
    let error = found.value - truth;
    let std = found.std_uncertainty.unwrap();
    println!("{what}: {:.4} ± {std:.4}, error {error:.4}", found.value);
    assert!(error.abs() < limit, "{what}: {} against {truth}", found.value);
    assert!(
        error.abs() < MOST_SIGMAS * std,
        "{what}: {} ± {std} against {truth}",
        found.value
    );
}

/// The first bounce against the truth.
fn assert_first_bounce(m: &Measurement, truth: &Value, what: &str) {
    assert_eq!(m.outcome, Outcome::Measured, "{what}");
    let (b, t) = (&m.bounces[0], &truth["bounces"][0]);
    let of = |v: &Value| v.as_f64().unwrap();
    let speed = |leg: &Value| of(&leg["vx_m_s"]).hypot(of(&leg["vy_m_s"]));
    let azimuth = of(&t["azimuth_deg"]);
    assert_near(
        azimuth_deg(b),
        azimuth,
        AZIMUTH_LIMIT_DEG,
        &format!("{what}: azimuth"),
    );
    let before = speed(&t["incident"]);
    let along = speed(&t["rebound"]) * azimuth.to_radians().cos();
    assert_near(
        b.incident.vx_m_s.unwrap(),
        before,
        0.02,
        &format!("{what}: speed before"),
    );
    assert_near(
        b.rebound.vx_m_s.unwrap(),
        along,
        0.02,
        &format!("{what}: speed after"),
    );
    assert_near(
        b.time_s.unwrap(),
        of(&t["time_s"]),
        0.001,
        &format!("{what}: time"),
    );
}

/// Numbers that are the same every time.
struct Chance(u64);

impl Chance {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * ((self.0 >> 11) as f64 / (1_u64 << 53) as f64)
    }
}

/// A launch of a ball of the lab (1 to 8 g/cm³) with any spin to the side, over any part of the floor, seen from 0.8 to 3 m above.
fn any_launch(seed: usize) -> Value {
    let mut c = Chance(seed as u64);
    (0..8).for_each(|_| _ = c.between(0.0, 1.0));
    let (distance_m, radius_m) = (c.between(0.8, 3.0), c.between(0.009, 0.018));
    let restitution = c.between(0.5, 0.92);
    let contact = if c.between(0.0, 1.0) < 0.5 {
        mu_e(restitution, c.between(0.05, 0.35))
    } else {
        let tangential = c.between(-0.3, 0.6);
        e_e(restitution, tangential, tangential)
    };
    let drop_m = c.between(0.08, f64::min(0.4, 0.35 * distance_m));
    let fall_s = (2.0 * drop_m / 9.81_f64).sqrt();
    let top = Top {
        distance_m,
        contact,
        drop_m,
        speed_m_s: c.between(0.6, 0.4 / fall_s).min(2.0),
        // Little about the vertical: no impact tells it, and it turns a light ball.
        spin: [c.between(-1.5, 1.5), c.between(-1.0, 1.0), c.between(-0.3, 0.3)],
        origin_px: [c.between(40.0, 80.0), c.between(80.0, 240.0)],
    };
    let mut scene = top.scene(seed);
    let mass_kg = c.between(1000.0, 8000.0) * 4.189 * radius_m.powi(3);
    scene["ball"] = json!({"radius_m": radius_m, "mass_kg": mass_kg, "inertia_factor": 0.4});
    scene["camera"]["blur_px"] = json!(c.between(0.4, 1.0));
    scene["camera"]["noise_grey"] = json!(c.between(0.5, 2.5));
    scene["camera"]["exposure_s"] = json!(c.between(0.0003, 0.0015));
    scene["look"]["shading"] = json!(c.between(0.0, 0.5));
    scene["look"]["shadow"] = json!(c.between(0.0, 0.3));
    scene["stop"]["tail_s"] = json!(c.between(0.12, 0.2));
    scene
}

fn near_cameras(seeds: std::ops::Range<usize>) {
    for seed in seeds {
        let scene = any_launch(seed);
        let r = Rendered::new(&scene);
        let m = standard(&r.video, &r.calibration);
        let what = format!("scene {seed}, {:.2} m", scene["camera"]["distance_m"]);
        assert_first_bounce(&m, &r.truth, &what);
        assert_no_heights(&m.bounces[0]);
        assert!(m.warnings.iter().all(|w| w.code != "distance_mismatch"));
    }
}

// Two, so that they run side by side.
#[test]
fn near_cameras_give_the_azimuth() {
    near_cameras(1..7);
}

#[test]
fn near_cameras_give_the_azimuth_of_others() {
    near_cameras(7..13);
}

#[test]
fn the_sample_scene_is_measured() {
    let scene: Value =
        serde_json::from_str(&std::fs::read_to_string("fixtures/scenes/top_sidespin.scene.json").unwrap())
            .unwrap();
    let r = Rendered::new(&scene);
    let m = standard(&r.video, &r.calibration);
    assert_first_bounce(&m, &r.truth, "top_sidespin");
}

#[test]
fn what_needs_the_height_stays_unknown() {
    let r = usual();
    let m = usual_measured();
    assert_first_bounce(m, &r.truth, "usual");
    let x0 = r.truth["x0_m"].as_f64().unwrap();
    assert_near(m.distances.x0_m.unwrap(), x0, 0.001, "x0");
    let output = Command::cargo_bin("track")
        .unwrap()
        .arg(&r.video)
        .arg("--calib")
        .arg(&r.calibration_file)
        .arg("--json")
        .output()
        .unwrap();
    assert!(output.status.success());
    let result: Value = serde_json::from_slice(&output.stdout).unwrap();
    let bounce = &result["bounces"][0];
    for key in [
        "/tangential_restitution",
        "/spin_in_m_s",
        "/spin_out_m_s",
        "/restitution",
        "/friction",
    ] {
        assert!(bounce.pointer(key).unwrap().is_null(), "{key}: {bounce}");
    }
    assert_no_heights(&m.bounces[0]);
    assert!(result["gravity_m_s2"].is_null() && result["models"].is_null());
    // Points are over the floor, not where the picture shows them against it.
    for (row, truth) in result["track"]["points"]
        .as_array()
        .unwrap()
        .iter()
        .zip(r.truth["centres"].as_array().unwrap())
    {
        assert!(row["z_m"].is_null());
        if row["used"] == true {
            for (key, limit) in [("x_m", 0.001), ("y_m", 0.001), ("u_px", 0.1), ("v_px", 0.1)] {
                let (found, truth) = (row[key].as_f64().unwrap(), truth[key].as_f64().unwrap());
                assert!((found - truth).abs() < limit, "{key}: {found} {truth} in {row}");
            }
        }
    }
}

#[test]
fn a_camera_far_away_with_its_distance_is_as_good() {
    let r = Rendered::new(
        &Top {
            distance_m: 40.0,
            contact: e_e(0.9, 0.4, 0.4),
            drop_m: 0.06,
            speed_m_s: 1.1,
            spin: [-0.8, 0.3, 0.0],
            origin_px: [50.0, 160.0],
        }
        .scene(2),
    );
    let m = standard(&r.video, &r.calibration);
    assert_first_bounce(&m, &r.truth, "from 40 m");
    assert_no_heights(&m.bounces[0]);
}

#[test]
fn without_the_distance_the_perspective_is_named_as_a_limit() {
    let r = usual();
    let mut unknown = r.calibration.clone();
    unknown.distance_m = None;
    let m = standard(&r.video, &unknown);
    let named = m
        .warnings
        .iter()
        .find(|w| w.code == "perspective_uncorrected")
        .unwrap();
    assert!(named.message.contains("\"distance_m\""), "{}", named.message);
    // It is right to say so: with the path's bend as it is the direction is off by degrees, and nothing tells the heights.
    let b = &m.bounces[0];
    let truth = r.truth["bounces"][0]["azimuth_deg"].as_f64().unwrap();
    assert!((azimuth_deg(b).value - truth).abs() > 1.0);
    assert_eq!((b.restitution, b.friction, b.incident.vz_m_s), (None, None, None));
    // So no uncertainty is claimed, and a number says how bent the path is.
    assert_eq!(azimuth_deg(b).std_uncertainty, None);
    assert_eq!(b.incident.vx_m_s.unwrap().std_uncertainty, None);
    let bent = m.warnings.iter().find(|w| w.code == "paths_bend").unwrap();
    assert!(bent.message.contains("degrees"), "{}", bent.message);
    let known = usual_measured();
    assert!(known.warnings.iter().all(|w| w.code != "perspective_uncorrected"));
}

/// What a distant camera does not see of the fall, drag, lift and the perspective that is left (1/D of 1/60 m, 1/2000 m and none), is in the uncertainties
/// where its distance is not known: speeds had been up to 57 of them off, distances up to 9.
#[test]
fn without_the_distance_what_a_far_camera_does_not_see_is_in_the_uncertainties() {
    let of = |v: &Value| v.as_f64().unwrap();
    let pull = |found: Option<Quantity>, truth: f64| {
        let found = found.unwrap();
        Some((found.value - truth) / found.std_uncertainty?)
    };
    let pulls_of = |seed: usize| -> Vec<(&'static str, f64)> {
        let mut scene = any_launch(seed);
        let distance_m = [json!(60.0), json!(2000.0), Value::Null][seed % 3].clone();
        // Which parts from the ball as that rises, and shifts its centre by up to a tenth of a pixel, is not what this is about.
        scene["look"]["shadow"] = json!(0.0);
        let camera = scene["camera"].as_object_mut().unwrap();
        camera.remove("distance_m");
        if !distance_m.is_null() {
            camera.insert("distance_m".into(), distance_m.clone());
        }
        let r = Rendered::new(&scene);
        let mut unknown = r.calibration.clone();
        unknown.distance_m = None;
        let m = standard(&r.video, &unknown);
        assert_eq!(m.outcome, Outcome::Measured, "scene {seed}");
        assert!(m.warnings.iter().any(|w| w.code == "perspective_uncorrected"));
        let (b, t) = (&m.bounces[0], &r.truth["bounces"][0]);
        let speed = |leg: &Value| of(&leg["vx_m_s"]).hypot(of(&leg["vy_m_s"]));
        let along = speed(&t["rebound"]) * of(&t["azimuth_deg"]).to_radians().cos();
        let pulls = [
            ("time", pull(b.time_s, of(&t["time_s"]))),
            ("speed before", pull(b.incident.vx_m_s, speed(&t["incident"]))),
            ("speed after", pull(b.rebound.vx_m_s, along)),
            ("azimuth", pull(Some(azimuth_deg(b)), of(&t["azimuth_deg"]))),
            ("x0", pull(m.distances.x0_m, of(&r.truth["x0_m"]))),
        ];
        println!("scene {seed}, {distance_m} m: {pulls:.2?}");
        let told = pulls.into_iter().filter_map(|(what, pull)| Some((what, pull?)));
        told.collect()
    };
    let pulls: Vec<(&'static str, f64)> = (100..112).flat_map(pulls_of).collect();
    assert!(pulls.len() >= 40, "{} numbers with an uncertainty", pulls.len());
    let off: Vec<_> = pulls
        .iter()
        .filter(|(_, pull)| pull.abs() > MOST_SIGMAS)
        .collect();
    assert!(off.is_empty(), "{off:?}");
    for what in ["time", "speed before", "speed after", "azimuth", "x0"] {
        let squares: Vec<f64> = pulls.iter().filter(|p| p.0 == what).map(|p| p.1 * p.1).collect();
        let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        assert!(rms < 1.6, "{what}: {rms}");
    }
}

#[test]
fn a_wrong_distance_is_noticed() {
    let r = usual();
    let mut wrong = r.calibration.clone();
    wrong.distance_m = Some(2.3);
    let m = standard(&r.video, &wrong);
    let told = m.warnings.iter().find(|w| w.code == "distance_mismatch").unwrap();
    // "... as for a camera 1.99 ± 0.03 m above the floor ..."
    let after = told.message.split("camera ").nth(1).unwrap();
    let numbers: Vec<f64> = after
        .split(' ')
        .filter_map(|word| word.parse().ok())
        .take(2)
        .collect();
    assert!(
        (numbers[0] - 2.0).abs() < MOST_SIGMAS * numbers[1] && numbers[1] < 0.06,
        "{}",
        told.message
    );
}

#[test]
fn a_distance_beyond_reason_says_what_to_check() {
    let r = usual();
    let mut wrong = r.calibration.clone();
    // Millimetres for metres: nothing falls as slowly as that camera would see.
    wrong.distance_m = Some(0.05);
    let m = standard(&r.video, &wrong);
    let Outcome::Rejected { reason } = &m.outcome else {
        panic!("{:?}", m.bounces);
    };
    assert!(
        reason.contains("\"distance_m\"") && reason.contains("0.05 m"),
        "{reason}"
    );
    assert!(!reason.contains("fall") && !reason.contains("floor"), "{reason}");
}

/// Every frame and the calibration's origin, mirrored.
#[test]
fn a_mirrored_launch_deviates_to_the_other_side() {
    let r = usual();
    let (video, calibration) = r.mirrored();
    let (right, left) = (usual_measured(), &standard(&video, &calibration));
    let (a, b) = (azimuth_deg(&right.bounces[0]), azimuth_deg(&left.bounces[0]));
    let std = a.std_uncertainty.unwrap();
    assert!(
        (a.value + b.value).abs() < std,
        "{} and {} ± {std}",
        a.value,
        b.value
    );
    let truth = r.truth["bounces"][0]["azimuth_deg"].as_f64().unwrap();
    assert_near(b, -truth, AZIMUTH_LIMIT_DEG, "to the left");
    let speed = |m: &Measurement| m.bounces[0].incident.vx_m_s.unwrap().value;
    assert!(speed(left) > 0.0 && (speed(left) - speed(right)).abs() < 0.003);
}

#[test]
fn other_scales_and_less_knowledge_of_the_ball_give_the_same() {
    let r = usual();
    let mut by_ball = r.calibration.clone();
    by_ball.scale = Scale::Ball;
    let m = standard(&r.video, &by_ball);
    assert_first_bounce(&m, &r.truth, "scaled by the ball");
    // The same picture by a homography, in metres.
    let origin = r.calibration.origin_px.unwrap();
    let q = 0.0015;
    let matrix = nalgebra::Matrix3::new(q, 0.0, -q * origin.u_px, 0.0, -q, q * origin.v_px, 0.0, 0.0, 1.0);
    let mut by_homography = r.calibration.clone();
    by_homography.scale = Scale::Homography(matrix.into());
    by_homography.origin_px = None;
    let m = standard(&r.video, &by_homography);
    assert_first_bounce(&m, &r.truth, "by a homography");
    let mut unknown_ball = r.calibration.clone();
    (unknown_ball.ball.radius_m, unknown_ball.ball.mass_kg) = (None, None);
    let m = standard(&r.video, &unknown_ball);
    assert_first_bounce(&m, &r.truth, "ball unknown");
}

#[test]
fn a_ball_off_the_axis_of_a_side_view_is_where_its_centre_is() {
    // A large ball by a near camera: its outline's centre is 0.3 px farther from the axis than its own.
    let r = Rendered::new(&json!({
        "schema": "track.scene/1", "seed": 5,
        "ball": {"radius_m": 0.025, "mass_kg": 0.5, "inertia_factor": 0.4},
        "contact": mu_e(0.8, 0.1),
        "launch": {"drop_height_m": 0.2, "speed_m_s": 1.0, "spin_ratio": [0, 0, 0]},
        "camera": {"image_size_px": [640, 320], "metres_per_pixel": 0.0012, "origin_px": [40, 300], "distance_m": 0.7,
                   "blur_px": 0.6, "noise_grey": 1.0, "codec": "lossless"},
        "look": {"shading": 0, "floor_grey": 60},
        "stop": {"bounces": 1, "tail_s": 0.08}
    }));
    let mut far = r.calibration.clone();
    far.distance_m = None;
    // Mean error away from the axis of the points far from it, px.
    let outward = |calibration: &Calibration| {
        let m = standard(&r.video, calibration);
        assert_eq!(m.outcome, Outcome::Measured);
        let errors: Vec<f64> = m
            .track
            .points
            .iter()
            .filter_map(|p| {
                let truth = &r.truth["centres"][p.frame];
                let (u, v) = (truth["u_px"].as_f64().unwrap(), truth["v_px"].as_f64().unwrap());
                let (du, dv) = (u - 319.5, v - 159.5);
                let off = du.hypot(dv);
                (off > 150.0).then(|| ((p.pixel.u_px - u) * du + (p.pixel.v_px - v) * dv) / off)
            })
            .collect();
        assert!(errors.len() > 20);
        errors.iter().sum::<f64>() / errors.len() as f64
    };
    let mut by_lens = far.clone();
    let focal_px = 0.7 / 0.0012;
    let camera = nalgebra::Matrix3::new(focal_px, 0.0, 319.5, 0.0, focal_px, 159.5, 0.0, 0.0, 1.0);
    by_lens.lens = Some(Lens::new(camera, [0.0; 5]).unwrap());
    let without = outward(&far);
    for (told, calibration) in [("distance", &r.calibration), ("lens", &by_lens)] {
        let with = outward(calibration);
        println!("with the {told} {with:.4} px, without {without:.4} px");
        assert!(
            without > 0.15 && with.abs() < 0.2 * without,
            "{told}: {with} {without}"
        );
    }
}
