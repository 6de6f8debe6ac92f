//! The paper's figures through the whole program: launches rendered with the models' relations, measured by `track`,
//! compared with the closed forms of Figs. 3-5. Rigid impacts and no air, as in the paper.

use assert_cmd::Command;
use serde_json::Value;
use track::rebound::{SOLID_SPHERE, e_e, launch, mu_e};
use track::simulate::{Scene, SimulatedRecording, write};

const STEEL: mu_e::Parameters = mu_e::Parameters {
    restitution: 0.78,
    friction: 0.07,
    static_friction: 0.07,
};
const STEEL_JSON: &str = r#"{"model": "mu_e", "restitution": 0.78, "friction": 0.07}"#;
const SUPERBALL_JSON: &str = r#"{"model": "e_e", "restitution": 0.96, "tangential_restitution_x": 0.5}"#;

/// What `track` finds on a launch at 1 m/s from `height_m` with `spin_ratio`.
fn measured(contact: &str, height_m: f64, spin_ratio: f64) -> Value {
    let text = format!(
        r#"{{"schema": "track.scene/1", "contact": {contact},
            "launch": {{"drop_height_m": {height_m}, "spin_ratio": [0, {spin_ratio}, 0]}},
            "camera": {{"codec": "lossless", "image_size_px": [640, 320], "origin_px": [30, 300],
                       "metres_per_pixel": 0.00125}},
            "look": {{"texture_grey": 4}},
            "effects": {{"drag": "off", "magnus": "off", "buoyancy": "off", "contact_time": "off"}}}}"#
    );
    let folder = tempfile::tempdir().unwrap();
    let recording = SimulatedRecording::new(&Scene::from_json(&text).unwrap()).unwrap();
    let written = write(&recording, "launch", folder.path(), |_| {}).unwrap();
    let output = Command::cargo_bin("track")
        .unwrap()
        .arg(&written.video)
        .arg("--calib")
        .arg(&written.calib)
        .arg("--json")
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    serde_json::from_slice(&output.stdout).unwrap()
}

/// The number at a JSON pointer.
fn at(result: &Value, pointer: &str) -> f64 {
    result
        .pointer(pointer)
        .and_then(|q| q["value"].as_f64())
        .unwrap_or_else(|| panic!("{pointer} is missing: {result:#}"))
}

#[test]
fn val_fig_3_angles_through_track() {
    for height_m in [0.02, 0.12, 0.30] {
        let steel = measured(STEEL_JSON, height_m, 0.0);
        let tangent = at(&steel, "/bounces/0/incident/angle_deg").to_radians().tan();
        let sliding = tangent.atan() > mu_e::transition_angle_rad(&STEEL, 0.0, SOLID_SPHERE);
        let expected = if sliding {
            mu_e::sliding_rebound_tangent(&STEEL, tangent, 0.0).unwrap()
        } else {
            mu_e::nonsliding_rebound_tangent(0.78, tangent, 0.0, SOLID_SPHERE).unwrap()
        };
        let found = at(&steel, "/bounces/0/rebound/angle_deg").to_radians().tan();
        assert!(
            (found - expected).abs() < 2e-3,
            "steel, {height_m} m: {found} {expected}"
        );

        let superball = measured(SUPERBALL_JSON, height_m, 0.0);
        let tangent = at(&superball, "/bounces/0/incident/angle_deg").to_radians().tan();
        let found = at(&superball, "/bounces/0/rebound/angle_deg").to_radians().tan();
        assert!(
            (found / tangent - 0.595).abs() < 1e-3,
            "superball, {height_m} m: {}",
            found / tangent
        );
        let e_x = at(&superball, "/bounces/0/tangential_restitution");
        assert!((e_x - 0.5).abs() < 5e-3, "{e_x}");
    }
}

#[test]
fn val_fig_4_distances_through_track() {
    for (name, spin) in [
        ("S1", 1.60),
        ("S2", 1.09),
        ("Sr", 0.0),
        ("Ss", -0.21),
        ("So", 1.0),
    ] {
        for height_m in [0.02, 0.20] {
            let result = measured(STEEL_JSON, height_m, spin);
            let (x0_m, x_m) = (at(&result, "/x0_m"), at(&result, "/x_m"));
            let incident = at(&result, "/bounces/0/incident/angle_deg").to_radians();
            let expected = if incident > mu_e::transition_angle_rad(&STEEL, spin, SOLID_SPHERE) {
                launch::sliding_distance_m(x0_m, 1.0, 0.78, 0.07, launch::Slip::of_spin_ratio(spin), 9.81)
            } else {
                launch::nonsliding_distance_m(x0_m, 0.78, spin, SOLID_SPHERE)
            };
            assert!(
                (x_m - expected).abs() < 2e-4,
                "{name}, {height_m} m: {x_m} {expected}"
            );
        }
    }
}

#[test]
fn val_fig_5_spin_through_track() {
    // Steel on wood, nonsliding: R w / u_o = 5/7. Superball, grip: 1.07.
    let wood = r#"{"model": "mu_e", "restitution": 0.52, "friction": 0.10, "static_friction": 0.15}"#;
    let spin = at(&measured(wood, 0.30, 0.0), "/bounces/0/spin_out_m_s");
    assert!((spin - 5.0 / 7.0).abs() < 3e-3, "{spin}");
    let spin = at(&measured(SUPERBALL_JSON, 0.12, 0.0), "/bounces/0/spin_out_m_s");
    assert!((spin - 1.0714).abs() < 3e-3, "{spin}");
    let limit = e_e::grip_limit_angle_rad(0.96, 0.5, 0.95, 0.0, SOLID_SPHERE).to_degrees();
    assert!((limit - 77.0).abs() < 0.05, "{limit}");
}
