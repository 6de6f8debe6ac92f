//! What recordings outside of a laboratory have, as the simulator renders it: motion out of the calibrated plane, slanted and
//! hand-held cameras, clocks of files that are not the camera's, shadows on walls, second balls.

use serde_json::{Value, json};
use track::simulate::scene::{EffectsChoice, Switch};
use track::simulate::truth::{CentreTruth, Truth};
use track::simulate::{Scene, SimulatedRecording, calibration, write};

/// A small scene without noise with `changes` by section; only the effects `names` are on.
fn recorded(changes: &Value, names: &[&str]) -> SimulatedRecording {
    let mut text = json!({
        "schema": "track.scene/1", "seed": 3,
        "contact": {"model": "mu_e", "restitution": 0.78, "friction": 0.07},
        "camera": {"image_size_px": [320, 200], "origin_px": [40, 170], "metres_per_pixel": 0.001, "codec": "lossless"},
        "look": {"shading": 0}
    });
    for (section, keys) in changes.as_object().unwrap() {
        if !text[section].is_object() {
            text[section] = json!({});
        }
        let into = text[section].as_object_mut().unwrap();
        into.extend(keys.as_object().unwrap().clone());
    }
    let mut scene = Scene::from_json(&text.to_string()).unwrap();
    scene.effects = EffectsChoice::all(Switch::Off);
    for name in names {
        scene.effects.named.insert((*name).to_owned(), Switch::On);
    }
    SimulatedRecording::new(&scene).unwrap()
}

fn complaint(camera: &Value, more: &str) -> String {
    let text = format!(
        r#"{{"schema": "track.scene/1", "contact": {{"model": "mu_e", "restitution": 0.78, "friction": 0.07}}, "camera": {camera}{more}}}"#
    );
    Scene::from_json(&text).unwrap_err().to_string()
}

fn grey(recording: &SimulatedRecording, frame: usize, u: f64, v: f64) -> u8 {
    recording.frame(frame).row(v.round() as usize)[u.round() as usize]
}

/// Estimate of the effect `name`, and whether it is used.
fn decided(recording: &SimulatedRecording, name: &str) -> (f64, bool) {
    let d = recording.decisions().iter().find(|d| d.name == name).unwrap();
    (d.estimate.amount, d.used)
}

#[test]
fn an_azimuth_brings_the_ball_nearer_and_leaves_its_impact_what_it_is() {
    let far = json!({"distance_m": 0.8});
    let plain = recorded(&json!({"camera": far}), &["perspective"]);
    let aside = recorded(
        &json!({"camera": far, "launch": {"azimuth_deg": 8}}),
        &["perspective"],
    );
    let (a, b): (Truth, Truth) = (plain.truth(), aside.truth());
    let cos = 8_f64.to_radians().cos();
    for (a, b) in a.bounces.iter().zip(&b.bounces) {
        assert_eq!(
            (a.restitution, a.friction, a.regime),
            (b.restitution, b.friction, b.regime)
        );
        assert_eq!(
            (a.incident.angle_deg, a.spin_out_m_s),
            (b.incident.angle_deg, b.spin_out_m_s)
        );
        assert!(
            (b.x_m - a.x_m * cos).abs() < 1e-12
                && (b.incident.vx_m_s - a.incident.vx_m_s * cos).abs() < 1e-12
        );
        assert_eq!(b.incident.vz_m_s, a.incident.vz_m_s);
    }
    assert!((b.x0_m.unwrap() - a.x0_m.unwrap()).abs() < 1e-12);
    // A pinhole 0.8 m away, whose axis goes through the picture's middle.
    let (last, was): (&CentreTruth, &CentreTruth) = (&b.centres[60], &a.centres[60]);
    let nearer = was.x_m * 8_f64.to_radians().sin();
    let grows = 0.8 / (0.8 - nearer);
    assert!(nearer > 0.02);
    assert!((last.u_px - (159.5 + (40.0 + 1000.0 * last.x_m - 159.5) * grows)).abs() < 1e-9);
    assert!((last.v_px - (99.5 + (170.0 - 1000.0 * last.z_m - 99.5) * grows)).abs() < 1e-9);
    assert!(decided(&aside, "perspective").0 > decided(&plain, "perspective").0);
    assert_eq!(calibration(&aside), calibration(&plain));
    let top = complaint(&json!({"view": "top"}), r#", "launch": {"azimuth_deg": 5}"#);
    assert!(
        top.contains("launch.azimuth_deg") && top.contains("0 in a top view"),
        "{top}"
    );
}

#[test]
fn a_pitched_camera_has_a_scale_that_goes_with_the_height_and_a_calibration_without_it() {
    let scene = json!({"camera": {"distance_m": 0.6, "pitch_deg": 10}, "look": {"floor_grey": 120}});
    let r = recorded(&scene, &["perspective"]);
    let (sin, cos) = 10_f64.to_radians().sin_cos();
    for c in &r.truth().centres {
        // From the point of the plane in the picture's middle.
        let (d, h) = (c.x_m - 0.1195, c.z_m - 0.0705);
        let grows = 0.6 / (0.6 - h * sin);
        assert!((c.u_px - (159.5 + 1000.0 * d * grows)).abs() < 1e-9);
        assert!((c.v_px - (99.5 - 1000.0 * h * cos * grows)).abs() < 1e-9);
    }
    let calib = calibration(&r);
    assert_eq!(calib["scale"]["metres_per_pixel"], 0.001);
    // The origin is where it is seen, and the floor's edge is drawn there.
    let v = calib["origin_px"][1].as_f64().unwrap();
    let drop = 0.0705;
    assert!((v - (99.5 + 1000.0 * drop * cos * 0.6 / (0.6 + drop * sin))).abs() < 1e-9);
    assert!(grey(&r, 0, 300.0, v - 1.0) < 70 && grey(&r, 0, 300.0, v + 1.0) > 110);
    // However the ball flies, the floor ends along the calibrated plane: level in the picture.
    let aside = json!({"camera": {"distance_m": 0.6, "pitch_deg": 10}, "look": {"floor_grey": 120}, "launch": {"azimuth_deg": 9}});
    let aside = recorded(&aside, &["perspective"]);
    for u in [5.0, 300.0] {
        assert!(grey(&aside, 0, u, v - 1.0) < 70 && grey(&aside, 0, u, v + 1.0) > 110);
    }
}

#[test]
fn a_pan_shifts_ball_and_backdrop_together_and_the_calibration_is_of_the_first_frame() {
    let scene = |pan: Value| json!({"camera": {"pan": pan}, "look": {"texture_grey": 6}});
    let still = recorded(&scene(json!(null)), &["texture"]);
    // 3 px right, 2 px up in 12 frames of 1/240 s.
    let panned = recorded(&scene(json!({"velocity_px_s": [60, -40]})), &["texture", "pan"]);
    let (a, b) = (still.truth().centres[12], panned.truth().centres[12]);
    assert!((b.u_px - a.u_px - 3.0).abs() < 1e-9 && (b.v_px - a.v_px + 2.0).abs() < 1e-9);
    let (a, b) = (still.frame(12), panned.frame(12));
    for v in 5..190 {
        for u in 5..310 {
            assert!(
                a.row(v)[u].abs_diff(b.row(v - 2)[u + 3]) <= 1,
                "row {v}, column {u}"
            );
        }
    }
    assert_eq!(calibration(&still), calibration(&panned));
    assert_eq!(still.frame(0), panned.frame(0));
    let held = recorded(&scene(json!({"wander_px": 4})), &["texture", "pan"]);
    let off = |i: usize| held.truth().centres[i].u_px - still.truth().centres[i].u_px;
    assert!(off(0) == 0.0 && off(60).abs() > 0.1 && (off(61) - off(60)).abs() < 0.5);
    let most = (0..held.frame_count()).map(|i| off(i).abs()).fold(0.0, f64::max);
    let (estimate, used) = decided(&held, "pan");
    assert!(used && estimate >= most, "{estimate} {most}");
}

#[test]
fn a_shadow_on_the_wall_goes_with_the_ball() {
    let look = json!({"wall_shadow": {"offset_px": [30, 12], "depth_grey": 25, "blur_px": 1.5}});
    let r = recorded(&json!({"look": look}), &["wall_shadow"]);
    let plain = recorded(&json!({"look": look}), &[]);
    for i in [0, 8, 20] {
        let c = r.truth().centres[i];
        let at = |du: f64| grey(&r, i, c.u_px + 30.0 + du, c.v_px + 12.0);
        assert_eq!((at(0.0), at(7.0)), (35, 35), "frame {i}");
        // Half of it at the edge of a ball of R 12.5 px.
        let edge: f64 = (10..=15).map(|k| f64::from(at(f64::from(k)))).sum::<f64>() / 6.0;
        assert!((edge - 47.5).abs() < 2.5, "{edge}");
        assert_eq!(grey(&r, i, c.u_px, c.v_px), grey(&plain, i, c.u_px, c.v_px));
    }
    assert_eq!(r.truth().centres, plain.truth().centres);
    assert_eq!(decided(&r, "wall_shadow"), (25.0, true));
}

#[test]
fn a_second_ball_flies_its_own_way_behind_the_first() {
    let second = json!({"start_s": -0.05, "x_m": 0.2, "drop_height_m": 0.12, "speed_m_s": -0.4, "radius_m": 0.008,
                        "ball_grey": 140});
    let r = recorded(&json!({"second_ball": second}), &["second_ball", "defocus"]);
    let alone = recorded(&json!({}), &["defocus"]);
    let truth = r.truth();
    assert_eq!(
        (&truth.bounces, &truth.centres),
        (&alone.truth().bounces, &alone.truth().centres)
    );
    let other = truth.second_ball.unwrap();
    let fall_s = (2.0 * 0.12 / 9.81_f64).sqrt();
    let first = other.bounces[0];
    assert!((first.time_s - (fall_s - 0.05)).abs() < 1e-9 && (first.x_m - (0.2 - 0.4 * fall_s)).abs() < 1e-9);
    assert_eq!(first.restitution.map(|e| (e * 1e9).round()), Some(0.78e9));
    for i in [0, 10, 20] {
        let c = other.centres[i];
        assert!((c.u_px - (40.0 + 1000.0 * c.x_m)).abs() < 1e-9);
        assert_eq!(grey(&r, i, c.u_px, c.v_px), 140, "frame {i}");
        assert_eq!(grey(&alone, i, c.u_px, c.v_px), 60);
        let own = truth.centres[i];
        assert_eq!(grey(&r, i, own.u_px, own.v_px), 200);
    }
    // Held until its launch.
    let later = json!({"second_ball": {"start_s": 0.1, "x_m": 0.2, "drop_height_m": 0.12}});
    let other = recorded(&later, &["second_ball"]).truth().second_ball.unwrap();
    assert_eq!(
        (other.centres[0].v_px, other.centres[20].v_px),
        (other.centres[24].v_px, other.centres[10].v_px)
    );
    assert!(other.centres[30].v_px > other.centres[24].v_px + 1.0);
}

#[test]
fn a_file_with_a_clock_of_its_own_holds_what_truth_says() {
    let folder = tempfile::tempdir().unwrap();
    let file = |stem: &str, clock: Value| {
        let r = recorded(&json!({"camera": {"clock": clock}}), &["clock"]);
        let written = write(&r, stem, folder.path(), |_| {}).unwrap();
        let mut video = track::frames::open(&written.video).unwrap();
        let mut stamps_s = Vec::new();
        while let Some(frame) = video.next_frame().unwrap() {
            let stored = r.stored_frames()[frame.index];
            assert_eq!(frame.luma, r.frame(stored.shows), "{stem}, frame {}", frame.index);
            stamps_s.push(frame.time_s);
        }
        assert_eq!(stamps_s.len(), written.frames);
        (r, stamps_s)
    };
    let (r, stamps_s) = file("slower", json!({"stored_hz": 200}));
    assert!((stamps_s[5] - 0.025).abs() < 1e-3, "{stamps_s:?}");
    let stored: Vec<Option<usize>> = r.truth().centres.iter().take(8).map(|c| c.stored_frame).collect();
    assert_eq!(
        stored,
        [
            Some(0),
            Some(1),
            Some(2),
            Some(3),
            Some(4),
            None,
            Some(5),
            Some(6)
        ]
    );
    assert!((r.truth().centres[6].time_s - 6.0 / 240.0).abs() < 1e-12);
    let (r, _) = file("pulldown", json!({"stored_hz": 300}));
    let stored: Vec<Option<usize>> = r.truth().centres.iter().take(5).map(|c| c.stored_frame).collect();
    assert_eq!(stored, [Some(0), Some(2), Some(3), Some(4), Some(5)]);
    let (r, stamps_s) = file(
        "gap",
        json!({"left_out_places": [3], "filled_places": [7], "stamp_step_s": 0.001}),
    );
    assert_eq!(
        (
            r.truth().centres[3].stored_frame,
            r.truth().centres[7].stored_frame
        ),
        (None, None)
    );
    assert!((stamps_s[5] - 0.020).abs() < 1e-9, "{stamps_s:?}");
    let refused = complaint(&json!({"clock": {"stored_hz": 9000, "filled_places": [-1]}}), "");
    assert!(refused.contains("camera.clock.filled_places"), "{refused}");
    let refused = complaint(&json!({"clock": {"stamp_step_s": 0.1}}), "");
    assert!(refused.contains("camera.clock.stamp_step_s"), "{refused}");
}
