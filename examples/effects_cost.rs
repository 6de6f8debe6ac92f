//! What effects cost the simulator: the tables of docs/accuracy.md. `cargo run --release --example effects_cost`
//!
//! Times are those of one core, of the thread that renders: on a machine that does other things besides they are longer by what
//! caches and clock lose to those, not by the time that those take.
#![allow(clippy::print_stdout)] // that is what it is for

use anyhow::Result;
use std::sync::OnceLock;
use std::time::Instant;
use track::simulate::effects::names;
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

/// The demo's ball before a camera and with a look that every effect finds something to do in.
const EVERYTHING: &str = r#""schema": "track.scene/1", "ball": {"radius_m": 0.0125, "mass_kg": 0.0639},
    "contact": {"model": "mu_e", "restitution": 0.78, "friction": 0.07}, "floor": {"slope_deg": 0.15},
    "launch": {"drop_height_m": 0.08, "speed_m_s": 1.0, "bench": {"seen_s": 0.15, "bench_grey": 110}},
    "second_ball": {"start_s": 0.02, "x_m": 0.75, "drop_height_m": 0.2, "speed_m_s": -0.5, "radius_m": 0.011},
    "camera": {"origin_px": [260, 660], "distance_m": 5.0, "readout_s": 0.003, "electrons_per_grey": 2000, "roll_deg": 0.5,
        "bump": {"amplitude_px": [1.0, 2.0]}, "pan": {"velocity_px_s": [3, 1]}, "clock": {},
        "lens": {"camera_matrix": [[6250, 0, 639.5], [0, 6250, 359.5], [0, 0, 1]], "distortion": [-0.02, 0, 0, 0, 0]}},
    "look": {"texture_grey": 3, "reflection": 0.15, "shadow": 0.4, "flicker": 0.01, "unevenness": 0.1,
        "wall_shadow": {"depth_grey": 20, "offset_px": [30, 12], "blur_px": 3}, "marks": {"pattern": "line"}}"#;

/// Frames of a recording that are timed, evenly over it, and how often: the least counts.
const TIMED_FRAMES: usize = 15;
const TIMES: usize = 3;

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
            let (frames, frame_ms) = (recording.frame_count(), frame_ms(&scene, usize::MAX)?);
            let used = recording.decisions().iter().filter(|d| d.used).count();
            println!("| {name} | {word} | {used} | {flight_ms:.1} | {frames} | {frame_ms:.1} |");
        }
    }
    println!();
    each()
}

/// Those that move the camera: the empty picture is then made anew for every frame, beside which the others' costs are lost.
const MOVES_CAMERA: [&str; 2] = ["bump", "pan"];

/// What each effect adds to none of them, and what it adds where all others are on.
fn each() -> Result<()> {
    let scene = Scene::from_json(&format!("{{{EVERYTHING}}}"))?;
    let with = |default: Switch, exception: Option<(&str, Switch)>| {
        let mut effects = EffectsChoice::all(default);
        let still = MOVES_CAMERA.map(|name| (name, Switch::Off));
        let named = still.into_iter().chain(exception);
        effects
            .named
            .extend(named.map(|(name, switch)| (name.to_owned(), switch)));
        Scene {
            effects,
            ..scene.clone()
        }
    };
    let none_ms = frame_ms(&with(Switch::Off, None), TIMED_FRAMES)?;
    let all_ms = frame_ms(&with(Switch::On, None), TIMED_FRAMES)?;
    println!("| effect | adds to none, ms a frame | adds to all others, ms a frame |");
    println!("|---|---|---|");
    println!("| | none: {none_ms:.1} | all: {all_ms:.1} |");
    for name in names() {
        let alone = with(Switch::Off, Some((name, Switch::On)));
        let recording = SimulatedRecording::new(&alone)?;
        if !recording.decisions().iter().any(|d| d.name == name && d.used) {
            continue;
        }
        let adds_ms = frame_ms(&alone, TIMED_FRAMES)? - none_ms;
        let adds_to_others_ms = if MOVES_CAMERA.contains(&name) {
            frame_ms(&with(Switch::On, Some((name, Switch::On))), TIMED_FRAMES)? - all_ms
        } else {
            all_ms - frame_ms(&with(Switch::On, Some((name, Switch::Off))), TIMED_FRAMES)?
        };
        println!("| {name} | {adds_ms:.1} | {adds_to_others_ms:.1} |");
    }
    Ok(())
}

/// Time for a frame, ms, in the mean over at most `frames` frames: the least of some times.
fn frame_ms(scene: &Scene, frames: usize) -> Result<f64> {
    let mut least = f64::INFINITY;
    for _ in 0..TIMES {
        // Made anew, so that what is made once for a recording is counted with its frames.
        let recording = SimulatedRecording::new(scene)?;
        let step = recording.frame_count().div_ceil(frames).max(1);
        let start_s = busy_s();
        let mut rendered = 0;
        for i in (0..recording.frame_count()).step_by(step) {
            std::hint::black_box(recording.frame(i));
            rendered += 1;
        }
        least = least.min((busy_s() - start_s) * 1e3 / f64::from(rendered));
    }
    Ok(least)
}

/// Time that this thread has had a core for, s; where the system does not say (other than Linux), the time of day.
fn busy_s() -> f64 {
    static START: OnceLock<Instant> = OnceLock::new();
    let start = *START.get_or_init(Instant::now);
    std::fs::read_to_string("/proc/thread-self/schedstat")
        .ok()
        .and_then(|text| text.split(' ').next()?.parse::<f64>().ok())
        .map_or_else(|| start.elapsed().as_secs_f64(), |ns| ns * 1e-9)
}
