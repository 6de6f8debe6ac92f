//! The paper's coefficients through the whole chain: launches rendered as in Figs. 3 and 4 (with the air, coded by H.264),
//! measured by `track batch`, fitted as one series. Every group's coefficients, transition and verdict are compared with what
//! the scenes were made with.

use assert_cmd::Command;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::fs;
use std::path::Path;
use std::time::Duration;
use track::rebound::mu_e::Parameters;
use track::rebound::{SOLID_SPHERE, mu_e};
use track::simulate::{Scene, SimulatedRecording};

/// A ball and how it is launched.
struct Group {
    name: &'static str,
    contact: Value,
    radius_m: f64,
    mass_kg: f64,
    spin_ratio: f64,
    /// Incident angles, degrees.
    angles_deg: &'static [f64],
}

const STEEL: Parameters = Parameters {
    restitution: 0.78,
    friction: 0.07,
    static_friction: 0.07,
};
const GOLF: Parameters = Parameters {
    restitution: 0.90,
    friction: 0.12,
    static_friction: 0.12,
};
const SUPERBALL_E: f64 = 0.96;
const SUPERBALL_E_X: f64 = 0.50;

/// Both sides of where steel begins to slide (23.6 degrees without spin).
const STEEL_ANGLES: &[f64] = &[19.5, 22.0, 25.5, 30.0, 37.0, 46.0];

fn steel(name: &'static str, spin_ratio: f64, angles_deg: &'static [f64]) -> Group {
    Group {
        name,
        contact: json!({"model": "mu_e", "restitution": 0.78, "friction": 0.07}),
        radius_m: 0.0125,
        mass_kg: 0.0639,
        spin_ratio,
        angles_deg,
    }
}

fn groups() -> Vec<Group> {
    vec![
        // Fig. 3.
        steel("steel", 0.0, STEEL_ANGLES),
        Group {
            name: "golf",
            contact: json!({"model": "mu_e", "restitution": 0.90, "friction": 0.12}),
            radius_m: 0.0213,
            mass_kg: 0.0456,
            spin_ratio: 0.0,
            angles_deg: &[24.0, 31.0, 37.0, 41.0, 46.0, 52.0],
        },
        Group {
            name: "superball",
            contact: json!({"model": "e_e", "restitution": SUPERBALL_E, "tangential_restitution_x": SUPERBALL_E_X}),
            radius_m: 0.0230,
            mass_kg: 0.0464,
            spin_ratio: 0.0,
            angles_deg: &[20.0, 26.0, 32.0, 38.0, 44.0, 50.0],
        },
        // Fig. 4; S1 begins to slide at 36 degrees, Ss at 19.8, S2 at 78, So never.
        steel("S1", 1.60, &[22.0, 29.0, 34.0, 39.0, 43.0, 48.0]),
        steel("S2", 1.09, &[19.5, 25.0, 31.0, 37.0, 43.0, 48.0]),
        steel("Sr", 0.0, &[20.5, 22.5, 24.5, 28.0, 33.0, 41.0]),
        steel("Ss", -0.21, &[18.4, 19.3, 21.0, 25.0, 31.0, 40.0]),
        steel("So", 1.0, &[19.5, 25.0, 31.0, 37.0, 43.0, 48.0]),
    ]
}

/// A launch at 1 m/s that lands at `angle_deg`.
fn scene(group: &Group, index: usize) -> Value {
    let angle_rad = group.angles_deg[index].to_radians();
    let drop_m = 1.0 / (angle_rad.tan().powi(2) * 2.0 * 9.81);
    json!({
        "schema": "track.scene/1", "seed": index + 1,
        "ball": {"radius_m": group.radius_m, "mass_kg": group.mass_kg, "inertia_factor": 0.4},
        "contact": group.contact,
        "launch": {"drop_height_m": drop_m, "speed_m_s": 1.0, "spin_ratio": [0, group.spin_ratio, 0]},
        "camera": {"image_size_px": [512, 320], "origin_px": [24, 300], "metres_per_pixel": 0.0018,
                   "frame_rate_hz": 180},
        "stop": {"bounces": 2, "tail_s": 0.03}
    })
}

/// Renders every launch of every group and writes the manifest.
fn render(groups: &[Group], dir: &Path) {
    let launches: Vec<(&Group, usize)> = groups
        .iter()
        .flat_map(|g| (0..g.angles_deg.len()).map(move |i| (g, i)))
        .collect();
    launches.par_iter().for_each(|&(group, i)| {
        let recording =
            SimulatedRecording::new(&Scene::from_json(&scene(group, i).to_string()).unwrap()).unwrap();
        track::simulate::write(&recording, &format!("{}-{}", group.name, i + 1), dir, |_| ()).unwrap();
    });
    let mut manifest = String::from("video,group\n");
    for (group, i) in launches {
        manifest.push_str(&format!("{0}-{1}.mp4,{0}\n", group.name, i + 1));
    }
    fs::write(dir.join("launches.csv"), manifest).unwrap();
}

/// What a fit says of a group.
struct Verdict<'a>(&'a Value);

impl Verdict<'_> {
    fn preferred(&self) -> &str {
        self.0["preferred"].as_str().unwrap()
    }

    fn model(&self, name: &str) -> &Value {
        let models = self.0["models"].as_array().unwrap();
        models.iter().find(|m| m["name"] == name).unwrap()
    }

    fn parameter(&self, model: &str, name: &str) -> Option<f64> {
        self.model(model)["parameters"][name]["value"].as_f64()
    }

    /// Where sliding begins, and for which spin before the bounce.
    fn transition(&self, model: &str) -> Option<(f64, f64)> {
        let model = self.model(model);
        Some((
            model["transition_angle_deg"]["value"].as_f64()?,
            model["transition_spin_ratio"].as_f64()?,
        ))
    }
}

/// A figure, what was found, what is true, and how far it may be off.
fn check(what: &str, found: Option<f64>, truth: f64, most: f64) {
    let found = found.unwrap_or_else(|| panic!("{what} is not there"));
    println!(
        "| {what} | {found:.5} | {truth:.5} | {:+.5} | {most} |",
        found - truth
    );
    assert!((found - truth).abs() < most, "{what}: {found} against {truth}");
}

#[test]
fn val_figs_3_and_4_coefficients_through_batch_and_fit() {
    let dir = tempfile::tempdir().unwrap();
    let groups = groups();
    render(&groups, dir.path());
    let out = dir.path().join("out");
    let assert = Command::new(env!("CARGO_BIN_EXE_track"))
        .timeout(Duration::from_secs(1200))
        .arg("batch")
        .arg("--manifest")
        .arg(dir.path().join("launches.csv"))
        .arg("--out")
        .arg(&out)
        .assert()
        .code(0);
    println!("{}", String::from_utf8_lossy(&assert.get_output().stdout));
    let fit: Value = serde_json::from_slice(&fs::read(out.join("fit.json")).unwrap()).unwrap();
    println!("| group, coefficient | found | truth | off by | the test's limit |\n|---|---|---|---|---|");
    let of = |name: &str| {
        Verdict(
            fit["groups"]
                .as_array()
                .unwrap()
                .iter()
                .find(|g| g["name"] == name)
                .unwrap(),
        )
    };
    for (name, truth, spin) in [
        ("steel", STEEL, 0.0),
        ("golf", GOLF, 0.0),
        ("S1", STEEL, 1.60),
        ("Sr", STEEL, 0.0),
        ("Ss", STEEL, -0.21),
    ] {
        let group = of(name);
        check(
            &format!("{name} e"),
            group.parameter("mu_e", "restitution"),
            truth.restitution,
            0.002,
        );
        check(
            &format!("{name} μ"),
            group.parameter("mu_e", "friction"),
            truth.friction,
            0.003,
        );
        let (angle_deg, at_spin) = group.transition("mu_e").unwrap();
        check(&format!("{name} spin of the launches"), Some(at_spin), spin, 0.01);
        let expected = mu_e::transition_angle_rad(&truth, spin, SOLID_SPHERE).to_degrees();
        check(&format!("{name} θ_L / degrees"), Some(angle_deg), expected, 0.5);
        assert_eq!(group.preferred(), "mu_e", "{name}: {}", group.0["reason"]);
    }
    // They slip so little that they always end rolling: e is all they tell.
    for name in ["S2", "So"] {
        let group = of(name);
        check(
            &format!("{name} e"),
            group.parameter("mu_e", "restitution"),
            STEEL.restitution,
            0.002,
        );
        assert_eq!(group.parameter("mu_e", "friction"), None, "{name}");
        assert!(
            group.model("mu_e")["not_determined"]["friction"].is_string(),
            "{name}"
        );
    }
    let superball = of("superball");
    check(
        "superball e",
        superball.parameter("e_e", "restitution"),
        SUPERBALL_E,
        0.002,
    );
    check(
        "superball e_x",
        superball.parameter("e_e", "tangential_restitution"),
        SUPERBALL_E_X,
        0.005,
    );
    assert!(
        ["e_e", "grip_slide"].contains(&superball.preferred()),
        "{}",
        superball.0["reason"]
    );
    for model in ["mu_e", "grip_slide"] {
        assert_eq!(superball.parameter(model, "friction"), None, "{model}");
    }
}
