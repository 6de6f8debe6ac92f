//! Balls with marks in rendered recordings: how they turn, where the picture has them, what the truth says of it, and what a scene may say.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector2, Vector3};
use track::frames::Luma;
use track::simulate::camera::{axis_px, nearness_m};
use track::simulate::truth::{CentreTruth, Truth};
use track::simulate::{Scene, SimulatedRecording};

const MU_E: &str = r#"{"model": "mu_e", "restitution": 0.8, "friction": 0.2}"#;

fn text(contact: &str, launch: &str, camera: &str, look: &str, more: &str) -> String {
    let origin = if camera.contains("top") { 100 } else { 180 };
    format!(
        r#"{{"schema": "track.scene/1", "contact": {contact}, "launch": {{{launch}}},
            "camera": {{"image_size_px": [320, 200], "origin_px": [60, {origin}], "metres_per_pixel": 0.0008, "noise_grey": 0{camera}}},
            "look": {{{look}}}{more}}}"#
    )
}

fn recording(text: &str) -> SimulatedRecording {
    SimulatedRecording::new(&Scene::from_json(text).unwrap()).unwrap()
}

fn rotation([w, x, y, z]: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
}

fn problems(marks: &str) -> String {
    let text = text(MU_E, "", "", &format!(r#""marks": {marks}"#), "");
    Scene::from_json(&text).unwrap_err().to_string()
}

/// Centroid of how much darker one picture is than the other.
fn dark_spot(plain: &Luma, marked: &Luma) -> Vector2<f64> {
    let (mut sum, mut first) = (0.0, Vector2::zeros());
    for (k, (p, m)) in plain.data.iter().zip(&marked.data).enumerate() {
        let darker = (f64::from(*p) - f64::from(*m)) / f64::from((*p).max(1));
        sum += darker;
        first += Vector2::new((k % plain.width) as f64, (k / plain.width) as f64) * darker;
    }
    first / sum
}

/// Where the point of the ball in a direction (right, up, towards the camera) is in the picture, by the place of the ball's centre in it.
fn image_of(recording: &SimulatedRecording, centre: &CentreTruth, direction: &Vector3<f64>) -> Vector2<f64> {
    let camera = &recording.scene().camera;
    let (middle, ball) = (axis_px(camera), Vector2::new(centre.u_px, centre.v_px));
    let across = Vector2::new(direction.x, -direction.y) * 0.0125;
    let Some(distance_m) = camera.distance_m else {
        return ball + across / camera.metres_per_pixel;
    };
    let focal_px = distance_m / camera.metres_per_pixel;
    let place_m = recording.trajectory().state(centre.time_s).position_m;
    let depth_m = distance_m - nearness_m(camera, &place_m);
    let point = (ball - middle) / focal_px * depth_m + across;
    middle + point * (focal_px / (depth_m - direction.z * 0.0125))
}

#[test]
fn a_ball_without_marks_is_rendered_as_before() {
    let launch = r#""spin_ratio": [0.3, 1, -0.2]"#;
    let plain = recording(&text(MU_E, launch, "", "", ""));
    let none = recording(&text(MU_E, launch, "", r#""marks": {"pattern": "none"}"#, ""));
    // Marks of the ball's own grey: drawn, but not to be seen.
    let same = recording(&text(
        MU_E,
        launch,
        r#", "exposure_s": 0.0005"#,
        r#""marks": {"pattern": "dots", "grey": 200}"#,
        r#", "effects": {"marks": "on", "rotation_blur": "off"}"#,
    ));
    for index in [0, 20, 40] {
        assert_eq!(plain.frame(index), none.frame(index));
        assert_eq!(plain.frame(index), same.frame(index));
    }
    let truth = serde_json::to_value(plain.truth()).unwrap();
    assert!(truth["centres"][0].get("orientation").is_none() && truth.get("camera_from_world").is_none());
    assert!(truth["arcs"][0]["spin"]["y_rad_s"].as_f64().unwrap() > 0.0);
}

#[test]
fn a_dot_is_seen_where_the_truth_has_it() {
    // One dot on a flat ball, in a picture that is turned in every way there is.
    let views = [
        ("", "", [0.2, -0.9, 0.3]),
        (r#", "roll_deg": 20, "distance_m": 0.3"#, "", [0.2, -0.9, 0.3]),
        (r#", "tilt_deg": 25, "roll_deg": -10"#, "", [0.4, -0.9, 0.3]),
        (r#", "pitch_deg": 20, "distance_m": 0.4"#, "", [0.2, -0.8, 0.5]),
        (
            r#", "tilt_deg": -20, "pitch_deg": 15, "distance_m": 0.4"#,
            "",
            [0.0, -0.9, 0.5],
        ),
        (r#", "view": "top""#, "", [0.2, -0.1, 0.9]),
        ("", r#", "azimuth_deg": 15"#, [0.2, -0.9, 0.3]),
        (r#", "readout_s": 0.003"#, "", [0.2, -0.9, 0.3]),
        (
            r#", "lens": {"camera_matrix": [[900, 0, 159.5], [0, 900, 99.5], [0, 0, 1]], "distortion": [-0.15, 0, 0, 0, 0]}"#,
            "",
            [0.2, -0.9, 0.3],
        ),
    ];
    for (camera, azimuth, dot) in views {
        let launch =
            format!(r#""speed_m_s": 0.7, "drop_height_m": 0.08, "spin_ratio": [0.1, 0.15, 0.1]{azimuth}"#);
        let camera = format!(r#"{camera}, "exposure_s": 0"#);
        let look = format!(
            r#""shading": 0, "marks": {{"pattern": "dots", "directions": [{dot:?}], "radius_deg": 9, "grey": 20}}"#
        );
        let marked = recording(&text(MU_E, &launch, &camera, &look, ""));
        let plain = recording(&text(MU_E, &launch, &camera, r#""shading": 0"#, ""));
        let truth = marked.truth();
        let camera_from_world = Matrix3::from(truth.camera_from_world.unwrap()).transpose();
        assert!((camera_from_world * camera_from_world.transpose() - Matrix3::identity()).norm() < 1e-12);
        assert!((camera_from_world.determinant() - 1.0).abs() < 1e-12);
        let mut checked = 0;
        let inside = |u: f64, v: f64| (20.0..300.0).contains(&u) && (20.0..180.0).contains(&v);
        let whole = truth
            .centres
            .iter()
            .filter(|c| inside(c.u_px, c.v_px) && c.frame % 6 == 3);
        for centre in whole {
            let in_world = rotation(centre.orientation.unwrap()) * Vector3::from(dot).normalize();
            let seen = camera_from_world * in_world;
            if seen.z < 0.7 {
                continue;
            }
            let expected = image_of(&marked, centre, &seen);
            let found = dark_spot(&plain.frame(centre.frame), &marked.frame(centre.frame));
            let off_px = (found - expected).norm();
            // The centroid of a round dot's picture is not quite the picture of its middle.
            assert!(
                off_px < 0.2,
                "{camera}{azimuth}, frame {}: {off_px} px",
                centre.frame
            );
            checked += 1;
        }
        assert!(checked >= 2, "{camera}{azimuth}: {checked}");
    }
}

/// Orientation and arcs of the truth fit each other: within an arc the ball turns by ω Δt about the axis of ω.
fn assert_turns_by_its_spin(truth: &Truth) {
    for arc in &truth.arcs {
        let spin = Vector3::new(arc.spin.x_rad_s, arc.spin.y_rad_s, arc.spin.z_rad_s);
        let inside = |t: f64| t >= arc.from_s && t <= arc.to_s;
        let frames: Vec<_> = truth.centres.iter().filter(|c| inside(c.time_s)).collect();
        for pair in frames.windows(2) {
            let [before, after] = [pair[0], pair[1]].map(|c| rotation(c.orientation.unwrap()));
            let turned = UnitQuaternion::from_scaled_axis(spin * (pair[1].time_s - pair[0].time_s));
            assert!(
                (turned * before).angle_to(&after) < 1e-9,
                "frame {}",
                pair[1].frame
            );
        }
    }
}

#[test]
fn the_truth_has_the_spin_of_each_arc_and_the_turning_by_it() {
    let launch = r#""speed_m_s": 0.8, "spin_ratio": [0.5, 1.5, -0.7]"#;
    let look = r#""marks": {"pattern": "line", "turned_deg": [0, 90, 0]}"#;
    let truth = recording(&text(MU_E, launch, "", look, "")).truth();
    let per_ratio = 0.8 / 0.0125;
    let spin = truth.arcs[0].spin;
    for (found, ratio) in [(spin.x_rad_s, 0.5), (spin.y_rad_s, 1.5), (spin.z_rad_s, -0.7)] {
        assert!((found - ratio * per_ratio).abs() < 1e-9);
    }
    assert_eq!(truth.arcs.len(), truth.bounces.len() + 1);
    for (bounce, arcs) in truth.bounces.iter().zip(truth.arcs.windows(2)) {
        assert!((arcs[0].to_s - bounce.time_s).abs() < 1e-12);
        assert!((arcs[1].from_s - bounce.time_s - bounce.contact_s).abs() < 1e-12);
        assert!((arcs[0].spin.y_rad_s * 0.0125 - bounce.spin_in_m_s).abs() < 1e-12);
        assert!((arcs[1].spin.y_rad_s * 0.0125 - bounce.spin_out_m_s).abs() < 1e-12);
    }
    let first = rotation(truth.centres[0].orientation.unwrap());
    assert!(
        first.angle_to(&UnitQuaternion::from_scaled_axis(
            Vector3::y() * 90_f64.to_radians()
        )) < 1e-12
    );
    assert_turns_by_its_spin(&truth);
}

#[test]
fn a_dropped_ball_may_spin() {
    let launch = r#""speed_m_s": 0, "spin_rad_s": [5, -60, 7]"#;
    let dropped = recording(&text(MU_E, launch, "", r#""marks": {"pattern": "dots"}"#, ""));
    let truth = dropped.truth();
    let spin = truth.arcs[0].spin;
    let found = Vector3::new(spin.x_rad_s, spin.y_rad_s, spin.z_rad_s);
    assert!((found - Vector3::new(5.0, -60.0, 7.0)).norm() < 1e-9);
    // Backspin drives it backwards off the floor; there is no ratio that the calibration could say.
    assert!(truth.bounces[0].rebound.vx_m_s < -0.1);
    assert!(track::simulate::calibration(&dropped)["launch"]["spin_ratio"].is_null());
    assert_turns_by_its_spin(&truth);
    let both = text(
        MU_E,
        r#""spin_ratio": [0, 1, 0], "spin_rad_s": [0, 80, 0]"#,
        "",
        "",
        "",
    );
    let message = Scene::from_json(&both).unwrap_err().to_string();
    assert!(
        message.contains("launch.spin_rad_s") && message.contains("one of"),
        "{message}"
    );
}

#[test]
fn a_ball_rolls_on_its_bench_and_is_turned_at_the_launch_as_the_scene_says() {
    let launch = r#""speed_m_s": 0.8, "bench": {"seen_s": 0.1}"#;
    let recording = recording(&text(MU_E, launch, "", r#""marks": {"pattern": "halves"}"#, ""));
    let launch_s = recording.trajectory().launch_s();
    assert!(recording.trajectory().orientation(launch_s).angle() < 1e-12);
    // 0.08 m without slipping.
    let before = recording.trajectory().orientation(0.0);
    let unrolled = UnitQuaternion::from_scaled_axis(-Vector3::y() * (0.08 / 0.0125));
    assert!(before.angle_to(&unrolled) < 1e-9);
    assert!((recording.trajectory().spin_rad_s(0.05).y - 0.8 / 0.0125).abs() < 1e-9);
    assert_turns_by_its_spin(&recording.truth());
}

#[test]
fn a_contact_that_takes_time_turns_the_ball_smoothly() {
    // A superball touches for milliseconds, and its spin reverses meanwhile.
    let contact = r#"{"model": "e_e", "restitution": 0.9, "tangential_restitution_x": 0.5}"#;
    let soft = r#", "ball": {"contact_modulus_pa": 1e7}"#;
    let recording = recording(&text(
        contact,
        r#""spin_ratio": [0, -2, 0]"#,
        "",
        r#""marks": {"pattern": "dots"}"#,
        soft,
    ));
    let trajectory = recording.trajectory();
    let impact = trajectory.impacts()[0];
    assert!(impact.contact_s > 5e-4, "{}", impact.contact_s);
    let (from_s, to_s) = (impact.time_s, impact.time_s + impact.contact_s);
    let turned = trajectory.orientation(to_s) * trajectory.orientation(from_s).inverse();
    let mean = 0.5 * (impact.incident.surface_spin_m_s + impact.rebound.surface_spin_m_s) / 0.0125;
    assert!((turned.scaled_axis() - mean * impact.contact_s).norm() < 1e-9);
    let jump = trajectory
        .orientation(to_s - 1e-9)
        .angle_to(&trajectory.orientation(to_s + 1e-9));
    assert!(jump < 1e-6);
}

/// Friction acts at the lowest point, so that the angular momentum about it stays: n × v + k R ω of the tangential parts; and the spin
/// about the normal has no torque.
#[test]
fn bounces_keep_what_the_laws_keep_of_a_spin_about_any_axis() {
    for contact in [
        MU_E,
        r#"{"model": "e_e", "restitution": 0.9, "tangential_restitution_x": 0.5, "tangential_restitution_y": 0.3}"#,
        r#"{"model": "grip_slide", "restitution": 0.9, "tangential_restitution_x": 0.5, "friction": 0.4}"#,
        r#"{"model": "compliant", "restitution": 0.9, "friction": 0.2, "stiffness_ratio": 0.9}"#,
    ] {
        for slope_deg in [0.0, 4.0] {
            let more = format!(r#", "floor": {{"slope_deg": {slope_deg}}}, "effects": {{"magnus": "off"}}"#);
            let launch = r#""speed_m_s": 0.8, "spin_ratio": [0.9, -1.2, 0.7]"#;
            let recording = recording(&text(contact, launch, "", "", &more));
            let floor = *recording.trajectory().floor();
            let impact = recording.trajectory().impacts()[0];
            let [before, after] = [impact.incident, impact.rebound].map(|motion| {
                let motion = floor.motion_in_frame(&motion);
                let (v, w) = (motion.velocity_m_s, motion.surface_spin_m_s);
                (Vector2::new(-v.y + 0.4 * w.x, v.x + 0.4 * w.y), w.z, v.y)
            });
            assert!(
                (before.0 - after.0).norm() < 1e-12,
                "{contact}: {before:?} {after:?}"
            );
            assert!((before.1 - after.1).abs() < 1e-12, "{contact}");
            // Sidespin throws the ball to its side.
            assert!((after.2 - before.2).abs() > 0.05, "{contact}");
        }
    }
}

#[test]
fn a_picture_is_wrapped_round_the_ball_upright_and_not_mirrored() {
    let folder = tempfile::tempdir().unwrap();
    // 2 degrees a pixel, white, with a black spot 40 degrees to the right of the middle and 20 above it.
    let is_spot = |k: usize| (107..113).contains(&(k % 180)) && (32..38).contains(&(k / 180));
    let mut pgm = b"P5\n180 90\n255\n".to_vec();
    pgm.extend((0..180 * 90).map(|k| if is_spot(k) { 0 } else { 255_u8 }));
    std::fs::write(folder.path().join("logo.pgm"), pgm).unwrap();
    let look = r#""shading": 0, "marks": {"pattern": "picture", "file": "logo.pgm"}"#;
    let scene = folder.path().join("ball.scene.json");
    std::fs::write(&scene, text(MU_E, r#""spin_ratio": [0, 0, 0]"#, "", look, "")).unwrap();
    let marked = SimulatedRecording::new(&Scene::read(&scene).unwrap()).unwrap();
    let plain = recording(&text(MU_E, "", "", r#""shading": 0"#, ""));
    let centre = marked.truth().centres[12];
    let found = dark_spot(&plain.frame(12), &marked.frame(12)) - Vector2::new(centre.u_px, centre.v_px);
    let (longitude, latitude) = (40_f64.to_radians(), 20_f64.to_radians());
    let expected = Vector2::new(longitude.sin() * latitude.cos(), -latitude.sin()) * 15.625;
    assert!((found - expected).norm() < 0.15, "{found:?} {expected:?}");
}

#[test]
fn what_a_scene_says_wrong_of_marks_is_told() {
    for (marks, words) in [
        ("6", &["look.marks", "pattern"][..]),
        ("{}", &["look.marks.pattern", "dots", "picture"]),
        (
            r#"{"pattern": "dotz"}"#,
            &["look.marks.pattern", "did you mean \"dots\"?"],
        ),
        (r#"{"pattern": "line", "count": 3}"#, &["look.marks.count"]),
        (
            r#"{"pattern": "dots", "radius_deg": 100}"#,
            &["look.marks.radius_deg", "at most 90"],
        ),
        (
            r#"{"pattern": "dots", "directions": [[0, 0, 0]]}"#,
            &["look.marks.directions", "[x, y, z]"],
        ),
        (
            r#"{"pattern": "halves", "directions": [[1, 0, 0], [0, 1, 0]]}"#,
            &["look.marks.directions", "1 to 1"],
        ),
        (r#"{"pattern": "picture"}"#, &["look.marks.file", "PNG"]),
        (
            r#"{"pattern": "picture", "file": "there_is_none.png"}"#,
            &["look.marks.file", "there_is_none.png"],
        ),
    ] {
        let message = problems(marks);
        for word in words {
            assert!(message.contains(word), "{marks}: {message}");
        }
    }
    let black = text(
        MU_E,
        "",
        "",
        r#""ball_grey": 0, "marks": {"pattern": "dots"}"#,
        "",
    );
    assert!(
        Scene::from_json(&black)
            .unwrap_err()
            .to_string()
            .contains("look.ball_grey")
    );
}
