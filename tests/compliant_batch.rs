//! Launches onto a compliant contact through the whole chain: rendered (with the air and a contact that takes its time, coded by H.264),
//! measured by `track batch`, fitted as one series; and one recording whose calibration says what ball and floor are made of.

use assert_cmd::Command;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::fs;
use std::time::Duration;
use track::rebound::compliant::stiffness::{Material, stiffness_ratio};
use track::simulate::{Scene, SimulatedRecording};

const RESTITUTION: f64 = 0.90;
const FRICTION: f64 = 0.30;
/// Glass on glass, by its Poisson number.
const NU: f64 = 0.22;

fn kappa() -> f64 {
    let glass = Material {
        youngs_modulus_pa: 7e10,
        poisson_ratio: NU,
    };
    stiffness_ratio(&glass, &glass)
}

/// A launch at 0.7 m/s that lands at `angle_deg`.
fn scene(angle_deg: f64, seed: usize) -> Value {
    let drop_m = 0.49 / (angle_deg.to_radians().tan().powi(2) * 2.0 * 9.81);
    json!({
        "schema": "track.scene/1", "seed": seed,
        "ball": {"radius_m": 0.0125, "mass_kg": 0.0205, "inertia_factor": 0.4, "contact_modulus_pa": 3.7e10},
        "contact": {"model": "compliant", "restitution": RESTITUTION, "friction": FRICTION,
                    "stiffness_ratio": kappa()},
        "launch": {"drop_height_m": drop_m, "speed_m_s": 0.7, "spin_ratio": [0, 0, 0]},
        "camera": {"image_size_px": [512, 320], "origin_px": [24, 300], "metres_per_pixel": 0.0014,
                   "frame_rate_hz": 240},
        "effects": {"contact_time": "on"},
        "stop": {"bounces": 2, "tail_s": 0.03}
    })
}

#[test]
fn kappa_comes_back_through_the_whole_chain() {
    const ANGLES: [f64; 9] = [16.0, 18.0, 20.5, 23.0, 26.0, 30.0, 34.0, 39.0, 45.0];
    let dir = tempfile::tempdir().unwrap();
    let mut manifest = String::from("video\n");
    let launches: Vec<(usize, f64)> = ANGLES.into_iter().enumerate().collect();
    launches.par_iter().for_each(|&(i, angle)| {
        let scene = Scene::from_json(&scene(angle, i + 1).to_string()).unwrap();
        let recording = SimulatedRecording::new(&scene).unwrap();
        track::simulate::write(&recording, &format!("launch-{i}"), dir.path(), |_| ()).unwrap();
    });
    for (i, _) in &launches {
        // The calibration as a lab writes it: with what ball and floor are made of, in one of them.
        manifest.push_str(&format!("launch-{i}.mp4\n"));
    }
    fs::write(dir.path().join("launches.csv"), manifest).unwrap();
    let out = dir.path().join("out");
    Command::new(env!("CARGO_BIN_EXE_track"))
        .timeout(Duration::from_secs(900))
        .arg("batch")
        .arg("--manifest")
        .arg(dir.path().join("launches.csv"))
        .arg("--out")
        .arg(&out)
        .assert()
        .code(0);
    let fit: Value = serde_json::from_slice(&fs::read(out.join("fit.json")).unwrap()).unwrap();
    let group = &fit["groups"][0];
    println!("{}: {}", group["preferred"], group["reason"]);
    let models = group["models"].as_array().unwrap();
    let model = models.iter().find(|m| m["name"] == "compliant").unwrap();
    let value = |name: &str| model["parameters"][name]["value"].as_f64().unwrap();
    for name in ["restitution", "friction", "stiffness_ratio"] {
        println!("{name}: {}", model["parameters"][name]);
    }
    assert_eq!(group["preferred"], "compliant");
    assert!((value("stiffness_ratio") / kappa() - 1.0).abs() < 0.05);
    assert!((value("restitution") - RESTITUTION).abs() < 0.003);
    assert!((value("friction") / FRICTION - 1.0).abs() < 0.05);
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("master curve") && page.contains("like, elastic bodies"));
}

#[test]
fn one_recording_says_what_the_model_foretells() {
    let dir = tempfile::tempdir().unwrap();
    let made = Scene::from_json(&scene(30.0, 5).to_string()).unwrap();
    let recording = SimulatedRecording::new(&made).unwrap();
    track::simulate::write(&recording, "one", dir.path(), |_| ()).unwrap();
    let calib = dir.path().join("one.calib.json");
    let mut calibration: Value = serde_json::from_slice(&fs::read(&calib).unwrap()).unwrap();
    let measure = |calibration: &Value| -> (Value, String) {
        fs::write(&calib, calibration.to_string()).unwrap();
        let out = dir.path().join("out");
        let done = Command::new(env!("CARGO_BIN_EXE_track"))
            .timeout(Duration::from_secs(300))
            .args(["--json", "--out"])
            .arg(&out)
            .arg(dir.path().join("one.mp4"))
            .arg("--calib")
            .arg(&calib)
            .assert()
            .code(0);
        let result = serde_json::from_slice(&done.get_output().stdout).unwrap();
        (result, fs::read_to_string(out.join("one.report.html")).unwrap())
    };
    let (result, _) = measure(&calibration);
    assert!(result["models"]["compliant"].is_null());
    for body in ["ball", "floor"] {
        if !calibration[body].is_object() {
            calibration[body] = json!({});
        }
        calibration[body]["youngs_modulus_pa"] = json!(7e10);
        calibration[body]["poisson_ratio"] = json!(NU);
    }
    let (result, page) = measure(&calibration);
    let compliant = &result["models"]["compliant"];
    println!("{compliant:#}");
    assert!((compliant["stiffness_ratio"].as_f64().unwrap() - kappa()).abs() < 1e-9);
    // Between sticking and sliding two frictions give this e_x: neither is named.
    assert!(compliant["friction"].is_null() && compliant["incidence"].is_null());
    assert_eq!(compliant["regime"], "undetermined");
    for key in ["tangential_restitution", "rebound_tangential_m_s", "spin_out_m_s"] {
        let off = compliant["off_sigmas"][key].as_f64().unwrap();
        assert!(off.abs() < 3.5, "{key}: {off}");
        assert!(compliant["predicted"][key]["value"].is_number());
    }
    assert!(page.contains("Compliant contact"));
}
