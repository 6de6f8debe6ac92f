//! What `none`, `auto` and `all` cost: the README's table. `cargo run --release --example effects_cost`
#![allow(clippy::print_stdout)] // that is what it is for

use anyhow::Result;
use std::time::Instant;
use track::simulate::scene::{EffectsChoice, Switch};
use track::simulate::{Scene, SimulatedRecording};

/// Name, ball, contact.
const BALLS: [(&str, &str, &str); 5] = [
    (
        "steel, 25 mm",
        r#"{"radius_m": 0.0125, "mass_kg": 0.0639}"#,
        r#"{"model": "mu_e", "restitution": 0.78, "friction": 0.07}"#,
    ),
    (
        "golf",
        r#"{"radius_m": 0.0213, "mass_kg": 0.0456, "contact_modulus_pa": 2e8}"#,
        r#"{"model": "mu_e", "restitution": 0.90, "friction": 0.12}"#,
    ),
    (
        "superball",
        r#"{"radius_m": 0.023, "mass_kg": 0.0464, "contact_modulus_pa": 1e7}"#,
        r#"{"model": "e_e", "restitution": 0.96, "tangential_restitution_x": 0.5}"#,
    ),
    (
        "table tennis",
        r#"{"radius_m": 0.02, "mass_kg": 0.0027, "inertia_factor": 0.667, "contact_modulus_pa": 3e7}"#,
        r#"{"model": "grip_slide", "restitution": 0.90, "tangential_restitution_x": 0.1, "friction": 0.25}"#,
    ),
    (
        "tennis",
        r#"{"radius_m": 0.033, "mass_kg": 0.0577, "inertia_factor": 0.55, "contact_modulus_pa": 2e6}"#,
        r#"{"model": "grip_slide", "restitution": 0.75, "tangential_restitution_x": 0.2, "friction": 0.6}"#,
    ),
];

/// A good camera on a good day: every effect is there, many of them too small to matter.
const REST: &str = r#""tolerance_px": 0.05,
    "camera": {"distance_m": 5.0, "readout_s": 2e-6, "electrons_per_grey": 2000,
        "lens": {"camera_matrix": [[6250, 0, 639.5], [0, 6250, 359.5], [0, 0, 1]], "distortion": [-0.001, 0, 0, 0, 0]}},
    "look": {"texture_grey": 0.3, "reflection": 0.001, "shadow": 0.005, "flicker": 0.001, "unevenness": 0.001}"#;

fn main() -> Result<()> {
    println!("| ball | effects | used | flight, ms | frames | rendering, ms a frame |");
    println!("|---|---|---|---|---|---|");
    for (name, ball, contact) in BALLS {
        for (word, switch) in [("none", Switch::Off), ("auto", Switch::Auto), ("all", Switch::On)] {
            let text =
                format!(r#"{{"schema": "track.scene/1", "ball": {ball}, "contact": {contact}, {REST}}}"#);
            let scene = Scene {
                effects: EffectsChoice::all(switch),
                ..Scene::from_json(&text)?
            };
            let start = Instant::now();
            let recording = SimulatedRecording::new(&scene)?;
            let flight_ms = start.elapsed().as_secs_f64() * 1e3;
            let start = Instant::now();
            let frames = recording.frames().count();
            let frame_ms = start.elapsed().as_secs_f64() * 1e3 / frames as f64;
            let used = recording.decisions().iter().filter(|d| d.used).count();
            println!("| {name} | {word} | {used} | {flight_ms:.1} | {frames} | {frame_ms:.1} |");
        }
    }
    Ok(())
}
