//! Scenes: reading, flight, effects and their decision, rendering, files.

use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use std::path::Path;
use track::config::FileError;
use track::rebound::{Contact, SOLID_SPHERE, launch, mu_e};
use track::simulate::effects::{Decision, drag_coefficient};
use track::simulate::scene::{Codec, EffectsChoice, Switch, View};
use track::simulate::{Scene, SceneError, SimulatedRecording, write};

const STEEL: &str = r#"{"model": "mu_e", "restitution": 0.78, "friction": 0.07}"#;

fn scene_text(contact: &str, more: &str) -> String {
    let comma = if more.is_empty() { "" } else { ", " };
    format!(r#"{{"schema": "track.scene/1", "contact": {contact}{comma}{more}}}"#)
}

/// A scene with `contact` and more keys.
fn scene_with(contact: &str, more: &str) -> Scene {
    Scene::from_json(&scene_text(contact, more)).unwrap()
}

fn with_effects(scene: &Scene, switch: Switch) -> Scene {
    Scene {
        effects: EffectsChoice::all(switch),
        ..scene.clone()
    }
}

/// A ball of the issue: JSON of `ball`, JSON of `contact` by its restitution, friction and e_x.
fn any_scene() -> impl Strategy<Value = String> {
    let ball = prop_oneof![
        // Steel bearing on ceramic.
        (0.006..0.015f64).prop_map(|r| (r, 7850.0 * 4.189 * r.powi(3), 0.4, 7e10, 0.78, "mu_e")),
        // Golf ball, superball, table-tennis ball, tennis ball.
        Just((0.0213, 0.0456, 0.4, 2e8, 0.90, "mu_e")),
        Just((0.0230, 0.0464, 0.4, 1e7, 0.96, "e_e")),
        Just((0.0200, 0.0027, 2.0 / 3.0, 3e7, 0.90, "grip_slide")),
        Just((0.0330, 0.0577, 0.55, 2e6, 0.75, "grip_slide")),
    ];
    let motion = (0.05..2.0f64, 0.0..10.0f64, prop::array::uniform3(-2.0..2.0f64));
    let camera = (
        0.2e-3..2e-3f64,
        60.0..480.0f64,
        0.0..1.0f64,
        0.0..1.0f64,
        any::<bool>(),
    );
    let rest = (
        0.05..0.5f64,
        -0.5..0.8f64,
        1..4u32,
        prop_oneof![Just(0.02), 0.005..0.5f64],
    );
    (ball, motion, camera, rest).prop_map(|(ball, motion, camera, rest)| {
        let (radius, mass, k, modulus, e, model) = ball;
        let (height, speed, spin) = motion;
        let (scale, rate, far, readout, top) = camera;
        let (friction, e_x, bounces, tolerance) = rest;
        let contact = match model {
            "mu_e" => format!(r#""friction": {friction}, "static_friction": {}"#, friction * (1.0 + readout * 0.5)),
            "e_e" => format!(r#""tangential_restitution_x": {e_x}"#),
            _ => format!(r#""tangential_restitution_x": {e_x}, "friction": {friction}"#),
        };
        // Far enough for the ball; a third of the cameras are infinitely far.
        let distance = if far < 0.3 { "null".into() } else { (height + 0.3 + 20.0 * (far - 0.3)).to_string() };
        let view = if top { "top" } else { "side" };
        format!(
            r#"{{"schema": "track.scene/1", "tolerance_px": {tolerance},
            "ball": {{"radius_m": {radius}, "mass_kg": {mass}, "inertia_factor": {k}, "contact_modulus_pa": {modulus}}},
            "contact": {{"model": "{model}", "restitution": {e}, {contact}}},
            "launch": {{"drop_height_m": {height}, "speed_m_s": {speed}, "spin_ratio": [{}, {}, {}]}},
            "camera": {{"view": "{view}", "metres_per_pixel": {scale}, "frame_rate_hz": {rate}, "exposure_s": 0.0005,
                        "distance_m": {distance}, "readout_s": {}, "origin_px": [20, 700]}},
            "stop": {{"bounces": {bounces}, "tail_s": 0.03}}}}"#,
            spin[0], spin[1], spin[2], readout * readout * 0.002
        )
    })
}

/// The largest distance of centres between two recordings of a scene, px, over frames in which both show the ball.
fn apart_px(one: &SimulatedRecording, two: &SimulatedRecording) -> f64 {
    one.truth()
        .centres
        .iter()
        .zip(&two.truth().centres)
        .filter(|(a, b)| a.visible && b.visible)
        .map(|(a, b)| (a.u_px - b.u_px).hypot(a.v_px - b.v_px))
        .fold(0.0, f64::max)
}

#[test]
fn centres_with_auto_are_within_tolerance_of_centres_with_all() {
    let mut runner = TestRunner::new_with_rng(
        Config {
            cases: 200,
            failure_persistence: None,
            ..Config::default()
        },
        prop::test_runner::TestRng::from_seed(prop::test_runner::RngAlgorithm::ChaCha, &[7; 32]),
    );
    let (mut used, mut left_out, mut nearest) = (0, 0, 0.0_f64);
    let mut seen = 0;
    let counts = std::cell::RefCell::new((&mut used, &mut left_out, &mut nearest, &mut seen));
    runner
        .run(&any_scene(), |text| {
            let scene = Scene::from_json(&text).unwrap();
            // A picture of 0.2 mm/px is 26 cm wide: some balls never enter it, and say so.
            let auto = match SimulatedRecording::new(&with_effects(&scene, Switch::Auto)) {
                Ok(auto) => auto,
                Err(error) => {
                    // Or, thrown aside by its spin, it flies into the camera.
                    let told = ["never enters the picture", "camera.distance_m"];
                    let error = error.to_string();
                    prop_assert!(told.iter().any(|t| error.contains(t)), "{error}");
                    return Err(TestCaseError::reject("never seen"));
                }
            };
            let all = SimulatedRecording::new(&with_effects(&scene, Switch::On)).unwrap();
            let apart = apart_px(&auto, &all);
            prop_assert!(
                apart <= scene.tolerance_px,
                "{apart} px apart, tolerance {}",
                scene.tolerance_px
            );
            let mut counts = counts.borrow_mut();
            *counts.3 += 1;
            *counts.2 = counts.2.max(apart / scene.tolerance_px);
            for d in auto.decisions() {
                prop_assert!(
                    d.used || d.evaluations() == 0,
                    "{} is off, and was evaluated",
                    d.name
                );
                let geometric = [
                    "drag",
                    "magnus",
                    "buoyancy",
                    "contact_time",
                    "perspective",
                    "rolling_shutter",
                ];
                if geometric.contains(&d.name) {
                    *(if d.used { &mut *counts.0 } else { &mut *counts.1 }) += 1;
                }
            }
            Ok(())
        })
        .unwrap();
    println!(
        "{seen} scenes; geometric effects used {used}, left out {left_out}; at worst {nearest:.3} of the tolerance"
    );
    // The test would prove nothing if everything were simulated.
    assert!(left_out > 100 && used > 100);
}

// ---------------------------------------------------------------------------------------------- reading

#[test]
fn a_minimal_scene_has_the_defaults_of_the_contract() {
    let scene = scene_with(STEEL, "");
    assert_eq!(
        (
            scene.seed,
            scene.ball.radius_m,
            scene.ball.mass_kg,
            scene.ball.inertia_factor
        ),
        (1, 0.0125, 0.0639, 0.4)
    );
    let steel = mu_e::Parameters {
        restitution: 0.78,
        friction: 0.07,
        static_friction: 0.07,
    };
    assert_eq!(scene.contact, Contact::MuE(steel));
    let launch = scene.launch;
    assert_eq!(
        (
            launch.drop_height_m,
            launch.speed_m_s,
            launch.surface_spin_m_s.norm(),
            launch.rise_speed_m_s
        ),
        (0.10, 1.0, 0.0, 0.0)
    );
    assert_eq!(
        (scene.air.density_kg_m3, scene.air.viscosity_pa_s),
        (1.204, 1.81e-5)
    );
    let camera = &scene.camera;
    assert_eq!(
        (camera.view, camera.width_px, camera.height_px),
        (View::Side, 1280, 720)
    );
    assert_eq!((camera.frame_rate_hz, camera.exposure_s), (240.0, 0.0005));
    assert_eq!(
        (camera.metres_per_pixel, camera.origin_px),
        (0.0008, [120.0, 660.0])
    );
    assert_eq!(
        (camera.distance_m, camera.lens, camera.readout_s),
        (None, None, 0.0)
    );
    assert_eq!((camera.blur_px, camera.noise_grey), (0.7, 2.0));
    assert_eq!(camera.codec, Codec::H264 { crf: 14 });
    let look = &scene.look;
    assert_eq!(
        (look.background_grey, look.ball_grey, look.shading),
        (60.0, 200.0, 0.5)
    );
    assert_eq!(
        (look.texture_grey, look.reflection, look.flicker),
        (0.0, 0.0, 0.0)
    );
    assert_eq!((launch.bench, scene.floor.slope_rad), (None, 0.0));
    assert_eq!((camera.roll_rad, camera.bump), (0.0, None));
    assert_eq!((scene.stop.bounces, scene.stop.tail_s), (2, 0.05));
    assert_eq!(
        (scene.tolerance_px, &scene.effects),
        (0.02, &EffectsChoice::all(Switch::Auto))
    );
}

#[test]
fn an_effect_can_be_switched_by_name() {
    let scene = scene_with(STEEL, r#""effects": {"drag": "on", "noise": "off"}"#);
    assert_eq!(scene.effects.of("drag"), Switch::On);
    assert_eq!(scene.effects.of("noise"), Switch::Off);
    assert_eq!(scene.effects.of("magnus"), Switch::Auto);
}

/// The whole message of what is wrong with a scene.
fn complaint(text: &str) -> String {
    let error = match Scene::from_json(text) {
        Err(error) => error,
        Ok(scene) => match SimulatedRecording::new(&scene) {
            Err(error) => error,
            Ok(_) => panic!("accepted: {text}"),
        },
    };
    error.to_string()
}

#[test]
fn bad_scenes_say_what_is_wrong_and_what_to_try() {
    let bad = |more: &str| scene_text(STEEL, more);
    let cases: Vec<(String, &[&str])> = vec![
        (bad(r#""camra": {}"#), &["camra", "did you mean camera?"]),
        (
            bad(r#""ball": {"radius": 0.01}"#),
            &["ball.radius", "did you mean ball.radius_m?"],
        ),
        (
            bad(r#""effects": {"drga": "on"}"#),
            &["effects.drga", "did you mean effects.drag?"],
        ),
        (bad(r#""effects": "al""#), &["effects", "did you mean \"all\""]),
        (
            bad(r#""ball": {"radius_m": -0.01}"#),
            &["ball.radius_m: found -0.01", "above 0"],
        ),
        (
            bad(r#""ball": {"mass_kg": "heavy"}"#),
            &["ball.mass_kg: found \"heavy\"", "above 0"],
        ),
        (
            bad(r#""camera": {"frame_rate_hz": 0}"#),
            &["camera.frame_rate_hz: found 0", "above 0"],
        ),
        (
            bad(r#""camera": {"view": "front"}"#),
            &["camera.view: found \"front\"", "\"side\" or \"top\""],
        ),
        (
            bad(r#""camera": {"exposure_s": 0.01}"#),
            &["camera.exposure_s: found 0.01", "at most", "shorten"],
        ),
        (
            bad(r#""camera": {"image_size_px": [1279, 720]}"#),
            &["camera.image_size_px", "even"],
        ),
        (
            bad(r#""camera": {"distance_m": 0.01}"#),
            &["camera.distance_m", "beyond the ball"],
        ),
        (
            bad(r#""camera": {"metres_per_pixel": 8e-6}"#),
            &["camera.metres_per_pixel", "px across", "metres"],
        ),
        (
            bad(r#""floor": {"slop_deg": 1}"#),
            &["floor.slop_deg", "did you mean floor.slope_deg?"],
        ),
        (
            bad(r#""floor": {"slope_deg": 25}"#),
            &["floor.slope_deg: found 25", "from -20 to 20"],
        ),
        (
            bad(r#""floor": {"slope_deg": -10}, "launch": {"bench": {"seen_s": 0.6}}"#),
            &["launch.drop_height_m: found 0.1", "above 0.10", "slope_deg"],
        ),
        (
            bad(r#""floor": {"slope_deg": 10}, "launch": {"drop_height_m": 1e-4}"#),
            &["launch.drop_height_m: found 0.0001", "above 0.000193"],
        ),
        (
            bad(r#""launch": {"bench": {"bench_gray": 60}}"#),
            &["launch.bench.bench_gray", "did you mean launch.bench.bench_grey?"],
        ),
        (
            bad(r#""launch": {"bench": {"seen_s": 0}}"#),
            &["launch.bench.seen_s: found 0", "above 0", "null"],
        ),
        (
            bad(r#""launch": {"bench": {"track_width_m": 0.025}}"#),
            &[
                "launch.bench.track_width_m: found 0.025",
                "below the ball's diameter, 0.025",
            ],
        ),
        (
            bad(r#""launch": {"bench": {}, "rise_speed_m_s": 0.1}"#),
            &["launch.rise_speed_m_s: found 0.1", "0 with a launch.bench"],
        ),
        (
            bad(r#""launch": {"bench": {}, "speed_m_s": 0.35}"#),
            &[
                "launch.speed_m_s: found 0.35",
                "tips round the edge",
                "above sqrt(g R) = 0.3502",
            ],
        ),
        (
            bad(r#""camera": {"roll_deg": 50}"#),
            &["camera.roll_deg: found 50", "from -45 to 45"],
        ),
        (
            bad(r#""camera": {"bump": {}}"#),
            &["camera.bump.amplitude_px: found nothing", "2 numbers"],
        ),
        (
            bad(r#""camera": {"bump": {"amplitude_px": [1, 2], "decay_s": 0}}"#),
            &["camera.bump.decay_s: found 0", "above 0"],
        ),
        (
            bad(r#""camera": {"blur_px": 1e4}"#),
            &["camera.blur_px: found 10000.0", "from 0 to 50"],
        ),
        (
            bad(
                r#""launch": {"rise_speed_m_s": 5}, "camera": {"view": "top", "distance_m": 1, "origin_px": [120, 360]}"#,
            ),
            &["camera.distance_m: found 1", "beyond the ball"],
        ),
        (
            bad(r#""stop": {"bounces": 0}"#),
            &["stop.bounces: found 0", "from 1"],
        ),
        (
            bad(r#""launch": {"drop_height_m": 0}"#),
            &["launch.drop_height_m", "rise_speed_m_s"],
        ),
        (
            bad(r#""launch": {"spin_ratio": [0, 1]}"#),
            &["launch.spin_ratio: found [0,1]", "3 numbers"],
        ),
        (
            scene_text(
                r#"{"model": "mu_e", "restitution": 0.8, "friction": 0.3, "static_friction": 0.2}"#,
                "",
            ),
            &["contact.static_friction: found 0.2", "at least friction, 0.3"],
        ),
        (
            scene_text(r#"{"model": "mu_e", "restitution": 1.01, "friction": 0.3}"#, ""),
            &["contact.restitution: found 1.01", "from 0 to 1", "gains energy"],
        ),
        (
            scene_text(r#"{"model": "e_e", "restitution": 0.9, "friction": 0.3}"#, ""),
            &["contact.friction", "unknown key"],
        ),
        (
            scene_text(r#"{"model": "e_e", "restitution": 0.9}"#, ""),
            &["contact.tangential_restitution_x: found nothing", "from -1 to 1"],
        ),
        (
            r#"{"schema": "track.scene/1"}"#.into(),
            &["contact: found nothing", "mu_e"],
        ),
        (
            r#"{"schema": "track.scene/2"}"#.into(),
            &["schema: found \"track.scene/2\"", "track.scene/1"],
        ),
        ("{".into(), &["not readable as JSON", "line 1"]),
        // A balloon: lighter than air.
        (
            bad(r#""ball": {"radius_m": 0.1, "mass_kg": 0.003}"#),
            &["never lands", "m above the floor"],
        ),
        (bad(r#""launch": {"rise_speed_m_s": 1000}"#), &["never lands"]),
        (
            bad(r#""camera": {"origin_px": [5000, 660]}"#),
            &["never enters the picture", "camera.origin_px"],
        ),
        (
            bad(r#""camera": {"frame_rate_hz": 1e9, "exposure_s": 0}"#),
            &["camera.frame_rate_hz", "frames"],
        ),
    ];
    for (text, parts) in cases {
        let message = complaint(&text);
        for part in parts {
            assert!(message.contains(part), "{part:?} is not in {message:?}");
        }
    }
}

#[test]
fn all_problems_of_a_scene_come_at_once() {
    let text = scene_text(
        r#"{"model": "e_e", "restitution": 2}"#,
        r#""ball": {"radius": 1}, "camera": {"exposure_s": -1, "view": "front"}, "stop": {"bounces": 0.5}"#,
    );
    let message = complaint(&text);
    for part in [
        "6 problems",
        "contact.restitution: found 2",
        "contact.tangential_restitution_x: found nothing",
        "ball.radius: found an unknown key",
        "camera.exposure_s: found -1",
        "camera.view: found \"front\"",
        "stop.bounces: found 0.5",
    ] {
        assert!(message.contains(part), "{part:?} is not in {message:?}");
    }
    // So do those that several keys make together, and a key that stands there twice.
    let message = complaint(&scene_text(
        STEEL,
        r#""camera": {"exposure_s": 1, "readout_s": 1}"#,
    ));
    assert!(
        message.contains("camera.exposure_s") && message.contains("camera.readout_s"),
        "{message}"
    );
    let message = complaint(&scene_text(STEEL, r#""seed": 1, "seed": 2"#));
    assert!(
        message.contains("twice") && message.contains("fixtures/scenes"),
        "{message}"
    );
}

#[test]
fn a_missing_file_is_named() {
    let error = Scene::read(Path::new("/nowhere/to/be.scene.json")).unwrap_err();
    assert!(matches!(error, SceneError::File(FileError::Unreadable { .. })));
    assert!(error.to_string().contains("/nowhere/to/be.scene.json"));
}

proptest! {
    #[test]
    fn no_text_panics(text in ".{0,80}") {
        let _ = Scene::from_json(&text);
    }

    #[test]
    fn no_value_panics(
        key in prop::sample::select(vec!["seed", "ball", "contact", "launch", "camera", "look", "stop", "effects"]),
        value in prop::sample::select(vec!["null", "-1", "1e999", "\"x\"", "[]", "{}", "[[1]]", "true", "{\"x\": 1}"]),
    ) {
        let _ = Scene::from_json(&format!(r#"{{"schema": "track.scene/1", "{key}": {value}}}"#));
    }
}

// ---------------------------------------------------------------------------------------------- decision

fn decision(recording: &SimulatedRecording, name: &str) -> Decision {
    recording
        .decisions()
        .iter()
        .find(|d| d.name == name)
        .unwrap()
        .clone()
}

/// A ball dropped 0.5 m before a camera of 1 mm a pixel, so that an estimate in px is one in mm.
fn drop_scene(ball: &str, tolerance_px: f64) -> Scene {
    scene_with(
        r#"{"model": "mu_e", "restitution": 0.8, "friction": 0.1}"#,
        &format!(
            r#""ball": {ball}, "launch": {{"drop_height_m": 0.5, "speed_m_s": 0}}, "stop": {{"bounces": 1, "tail_s": 0}},
               "camera": {{"metres_per_pixel": 0.001}}, "tolerance_px": {tolerance_px}"#
        ),
    )
}

const STEEL_20_MM: &str = r#"{"radius_m": 0.010, "mass_kg": 0.0329}"#;
const TABLE_TENNIS: &str = r#"{"radius_m": 0.020, "mass_kg": 0.0027, "inertia_factor": 0.667}"#;

#[test]
fn val_drag_and_buoyancy_of_a_dropped_ball() {
    for (ball, drag_mm, buoyancy_mm) in [(STEEL_20_MM, 0.2, 0.12), (TABLE_TENNIS, 9.0, 11.0)] {
        let recording = SimulatedRecording::new(&drop_scene(ball, 0.02)).unwrap();
        let drag = decision(&recording, "drag").estimate.amount;
        let buoyancy = decision(&recording, "buoyancy").estimate.amount;
        assert!((drag / drag_mm - 1.0).abs() < 0.15, "{ball}: drag {drag} mm");
        assert!(
            (buoyancy / buoyancy_mm - 1.0).abs() < 0.15,
            "{ball}: buoyancy {buoyancy} mm"
        );
    }
}

#[test]
fn an_estimate_is_what_the_effect_does() {
    // Against the simulated effect alone, where it is small: first order is then all there is.
    for (ball, name) in [
        (STEEL_20_MM, "drag"),
        (STEEL_20_MM, "buoyancy"),
        (TABLE_TENNIS, "buoyancy"),
    ] {
        let scene = Scene {
            effects: EffectsChoice::all(Switch::Off),
            ..drop_scene(ball, 0.02)
        };
        let mut with = scene.clone();
        with.effects.named.insert(name.into(), Switch::On);
        let (without, with) = (
            SimulatedRecording::new(&scene).unwrap(),
            SimulatedRecording::new(&with).unwrap(),
        );
        let last = scene.camera.frame_rate_hz.recip() * (without.frame_count() - 1) as f64;
        let moved =
            (without.trajectory().state(last).position_m - with.trajectory().state(last).position_m).norm();
        let estimate = decision(&with, name).estimate.amount * 1e-3;
        assert!(
            moved <= estimate && moved > 0.8 * estimate,
            "{name} of {ball}: {moved} m, estimate {estimate} m"
        );
    }
}

#[test]
fn the_decision_flips_with_the_tolerance() {
    let amount = decision(
        &SimulatedRecording::new(&drop_scene(STEEL_20_MM, 0.02)).unwrap(),
        "drag",
    )
    .estimate
    .amount;
    let used = |tolerance_px: f64| {
        decision(
            &SimulatedRecording::new(&drop_scene(STEEL_20_MM, tolerance_px)).unwrap(),
            "drag",
        )
        .used
    };
    assert!(used(0.99 * amount));
    // All that is left out must fit: the others are smaller or of the same size.
    assert!(!used(6.0 * amount));
    // At 1 mm a table-tennis ball needs both, a steel ball neither; at 100 mm neither does.
    for (ball, tolerance_px, expected) in [
        (TABLE_TENNIS, 1.0, true),
        (STEEL_20_MM, 1.0, false),
        (TABLE_TENNIS, 100.0, false),
    ] {
        let recording = SimulatedRecording::new(&drop_scene(ball, tolerance_px)).unwrap();
        for name in ["drag", "buoyancy"] {
            assert_eq!(
                decision(&recording, name).used,
                expected,
                "{name} of {ball} at {tolerance_px} px"
            );
        }
    }
}

#[test]
fn what_is_off_is_never_evaluated() {
    let small = r#""camera": {"image_size_px": [320, 200], "origin_px": [60, 180], "distance_m": 2, "readout_s": 0.001,
        "electrons_per_grey": 100, "lens": {"camera_matrix": [[900,0,160],[0,900,100],[0,0,1]], "distortion": [-0.1,0,0,0,0]}},
        "look": {"texture_grey": 3, "reflection": 0.2, "shadow": 0.5, "flicker": 0.05, "unevenness": 0.2},
        "launch": {"bench": {"seen_s": 0.02, "bench_grey": 90}}, "floor": {"slope_deg": 3}"#
        .replace(
            r#""readout_s""#,
            r#""roll_deg": 4, "bump": {"amplitude_px": [1, 2]}, "pan": {"wander_px": 2}, "clock": {"stored_hz": 300}, "readout_s""#,
        )
        .replace(
            r#""shadow": 0.5"#,
            r#""shadow": 0.5, "marks": {"pattern": "dots"}, "wall_shadow": {"offset_px": [20, 9]}"#,
        )
        .replace(
            r#""floor""#,
            r#""second_ball": {"x_m": 0.1}, "floor""#,
        );
    let scene = scene_with(STEEL, &small);
    let none = SimulatedRecording::new(&with_effects(&scene, Switch::Off)).unwrap();
    let all = SimulatedRecording::new(&with_effects(&scene, Switch::On)).unwrap();
    for recording in [&none, &all] {
        let _ = recording.frame(10);
        let _ = recording.truth();
    }
    assert_eq!(none.decisions().len(), 28);
    for d in none.decisions() {
        assert!(!d.used && d.evaluations() == 0, "{}", d.name);
    }
    for d in all.decisions() {
        assert!(d.used && d.evaluations() > 0, "{}", d.name);
    }
}

#[test]
fn val_drag_curve() {
    // The standard curve (Clift, Grace, Weber 1978, table 5.2), which the formula follows within 6 %.
    for (reynolds, standard) in [
        (0.1, 244.0),
        (1.0, 27.3),
        (10.0, 4.32),
        (100.0, 1.09),
        (1e3, 0.472),
        (1e4, 0.405),
        (1e5, 0.48),
    ] {
        let found = drag_coefficient(reynolds);
        assert!(
            (found / standard - 1.0).abs() < 0.10,
            "Re {reynolds}: {found}, {standard}"
        );
    }
}

// ---------------------------------------------------------------------------------------------- flight

fn rigid(contact: &str, more: &str) -> SimulatedRecording {
    SimulatedRecording::new(&with_effects(&scene_with(contact, more), Switch::Off)).unwrap()
}

#[test]
fn val_fig_4_launches_as_flights() {
    for spin in [1.60, 1.09, 0.0, -0.21, 1.0] {
        for height_m in [0.02, 0.1, 0.3_f64] {
            let more = format!(r#""launch": {{"drop_height_m": {height_m}, "spin_ratio": [0, {spin}, 0]}}"#);
            let truth = rigid(STEEL, &more).truth();
            let (x0_m, x_m) = (truth.x0_m.unwrap(), truth.x_m.unwrap());
            let expected = if truth.bounces[0].regime == "nonsliding" {
                launch::nonsliding_distance_m(x0_m, 0.78, spin, SOLID_SPHERE)
            } else {
                launch::sliding_distance_m(x0_m, 1.0, 0.78, 0.07, launch::Slip::of_spin_ratio(spin), 9.81)
            };
            assert!((x0_m - (2.0 * height_m / 9.81).sqrt()).abs() < 1e-12);
            assert!(
                (x_m - expected).abs() < 1e-12,
                "spin {spin}, height {height_m}: {x_m} {expected}"
            );
        }
    }
}

#[test]
fn truth_has_the_conventions_of_a_result() {
    let truth = rigid(
        r#"{"model": "e_e", "restitution": 0.9, "tangential_restitution_x": 0.5}"#,
        "",
    )
    .truth();
    let b = truth.bounces[0];
    assert!(b.incident.vz_m_s < 0.0 && b.rebound.vz_m_s > 0.0);
    assert!((b.incident.angle_deg - 1.0_f64.atan2(-b.incident.vz_m_s).to_degrees()).abs() < 1e-12);
    assert!((b.restitution.unwrap() - 0.9).abs() < 1e-12);
    assert!((b.tangential_restitution.unwrap() - 0.5).abs() < 1e-12);
    assert!((b.spin_out_m_s - (1.0 - b.rebound.vx_m_s) / 0.4).abs() < 1e-12);
    assert_eq!(b.azimuth_deg, Some(0.0));
    assert_eq!(truth.centres[7].time_s, 7.0 / 240.0);
    let touch = truth.centres.iter().map(|c| c.z_m).fold(f64::INFINITY, f64::min);
    assert!(touch >= 0.0125);
}

#[test]
fn backspin_that_turns_the_ball_back_has_a_negative_angle() {
    let truth = rigid(
        r#"{"model": "mu_e", "restitution": 0.5, "friction": 0.9}"#,
        r#""launch": {"drop_height_m": 1.0, "speed_m_s": 0.5, "spin_ratio": [0, -20, 0]}, "camera": {"metres_per_pixel": 0.002}"#,
    )
    .truth();
    let b = truth.bounces[0];
    assert!(b.rebound.vx_m_s < 0.0 && b.rebound.angle_deg < 0.0 && b.tangential_ratio.unwrap() < 0.0);
    assert!((b.azimuth_deg.unwrap().abs() - 180.0).abs() < 1e-9);
    // The next impact goes the other way, which is then its own incident direction.
    assert!(truth.bounces[1].incident.angle_deg > 0.0);
}

proptest! {
    // No ball passes the floor and no scene runs forever, however the impacts pile up.
    #[test]
    fn no_ball_passes_the_floor(
        e in prop_oneof![Just(0.0), Just(1.0), 0.0..1.0f64], height in prop_oneof![1e-6..1e-3f64, 0.01..0.5f64],
        bounces in 1..200u32, air in any::<bool>()
    ) {
        let contact = format!(r#"{{"model": "mu_e", "restitution": {e}, "friction": 0.1}}"#);
        let more = format!(
            r#""launch": {{"drop_height_m": {height}, "speed_m_s": 0}}, "stop": {{"bounces": {bounces}, "tail_s": 0.1}}"#
        );
        let scene = with_effects(&scene_with(&contact, &more), Switch::Off);
        let scene = if air { Scene { effects: EffectsChoice {
            default: Switch::Off,
            named: [("drag".to_owned(), Switch::On), ("buoyancy".to_owned(), Switch::On)].into(),
        }, ..scene } } else { scene };
        let recording = SimulatedRecording::new(&scene).unwrap();
        let path = recording.trajectory();
        for i in 0..=2000 {
            let z = path.state(path.end_s() * f64::from(i) / 2000.0).position_m.z;
            prop_assert!(z >= 0.0125 - 1e-9, "{z}");
        }
        if e < 1.0 && !air {
            // First fall, then (2 v / g) e / (1 - e) until all has piled up.
            let fall_s = (2.0 * height / 9.81).sqrt();
            let zeno_s = fall_s * (1.0 + 2.0 * e / (1.0 - e));
            prop_assert!(path.end_s() <= zeno_s + 0.1 + 1e-3, "{} {zeno_s}", path.end_s());
        }
    }
}

#[test]
fn a_contact_is_a_delay_and_a_dip() {
    let superball = r#""ball": {"radius_m": 0.023, "mass_kg": 0.0464, "contact_modulus_pa": 1e7},
        "effects": {"drag": "off", "magnus": "off", "buoyancy": "off", "contact_time": "on"}"#;
    let contact = r#"{"model": "e_e", "restitution": 0.96, "tangential_restitution_x": 0.5}"#;
    let recording = SimulatedRecording::new(&scene_with(contact, superball)).unwrap();
    let impact = recording.trajectory().impacts()[0];
    let v = impact.incident.velocity_m_s.z.abs();
    let hertz_s = 2.87 * (0.0464_f64.powi(2) / (0.023 * 1e14 * v)).powf(0.2);
    assert!(
        (impact.contact_s / hertz_s - 0.5 * (1.0 + 1.0 / 0.96)).abs() < 1e-9,
        "{}",
        impact.contact_s
    );
    let at = |t: f64| recording.trajectory().state(impact.time_s + t);
    let deepest = 0.023 - at(0.5 * hertz_s).position_m.z;
    let hertz_m = (15.0 * 0.0464 * v * v / (16.0 * 0.023_f64.sqrt() * 1e7)).powf(0.4);
    assert!((deepest / hertz_m - 1.0).abs() < 0.08, "{deepest} {hertz_m}");
    // The arcs before and after, continued, have the same height when they meet.
    let truth = recording.truth().bounces[0];
    let into = truth.arcs_meet_s - impact.time_s;
    let out = into - impact.contact_s;
    let arc = |v: f64, t: f64| v * t - 0.5 * 9.81 * t * t;
    let (before, after) = (
        arc(impact.incident.velocity_m_s.z, into),
        arc(impact.rebound.velocity_m_s.z, out),
    );
    assert!(
        (before - after).abs() < 1e-12 && into > 0.0 && out < 0.0,
        "{before} {after}"
    );
    // Position and velocity are continuous at both ends.
    let tiny = 1e-9;
    for t in [0.0, impact.contact_s] {
        let jump = at(t + tiny).velocity_m_s - at(t - tiny).velocity_m_s;
        assert!(jump.norm() < 1e-3, "{jump}");
        assert!((at(t + tiny).position_m - at(t - tiny).position_m).norm() < 1e-7);
    }
}

// ---------------------------------------------------------------------------------------------- top view

#[test]
fn sidespin_turns_the_rebound_aside_and_a_top_view_shows_it() {
    let recording = rigid(
        r#"{"model": "mu_e", "restitution": 0.8, "friction": 0.2}"#,
        r#""launch": {"speed_m_s": 1.5, "spin_ratio": [-1.2, 0, 0]},
           "camera": {"view": "top", "origin_px": [120, 360]}"#,
    );
    let truth = recording.truth();
    let impact = truth.bounces[0];
    let azimuth = impact.azimuth_deg.unwrap();
    assert!(azimuth > 5.0, "{azimuth}");
    let seen: Vec<_> = truth
        .centres
        .iter()
        .filter(|c| c.time_s > impact.time_s && c.time_s < truth.bounces[1].time_s)
        .collect();
    let (first, last) = (seen[0], seen[seen.len() - 1]);
    // y is up in the picture: a ball that turns to the left goes up.
    let found = (first.v_px - last.v_px)
        .atan2(last.u_px - first.u_px)
        .to_degrees();
    assert!((found - azimuth).abs() < 1e-6, "{found} {azimuth}");
}

#[test]
fn a_ball_that_rises_looks_larger_from_above() {
    let recording = rigid(STEEL, r#""camera": {"view": "top", "origin_px": [120, 360]}"#);
    let mut near = with_effects(recording.scene(), Switch::Off);
    near.camera.distance_m = Some(0.5);
    near.effects.named.insert("perspective".into(), Switch::On);
    let near = SimulatedRecording::new(&near).unwrap();
    let (far, near) = (recording.truth(), near.truth());
    let (a, b, z_m) = (far.centres[0], near.centres[0], far.centres[0].z_m);
    // At x = 0, u = 120: D / (D - z) times as far from the middle.
    let magnified = (b.u_px - 639.5) / (a.u_px - 639.5);
    assert!((magnified - 0.5 / (0.5 - z_m)).abs() < 1e-12, "{magnified}");
}

// ---------------------------------------------------------------------------------------------- frames, files

const SMALL: &str = r#""camera": {"image_size_px": [320, 200], "origin_px": [60, 180], "codec": "lossless"},
    "look": {"texture_grey": 4, "reflection": 0.2, "shadow": 0.5, "flicker": 0.03}"#;

#[test]
fn the_same_seed_gives_the_same_bytes_in_any_order() {
    let scene = scene_with(STEEL, SMALL);
    let (one, two) = (
        SimulatedRecording::new(&scene).unwrap(),
        SimulatedRecording::new(&scene).unwrap(),
    );
    let forward: Vec<_> = one.frames().take(12).collect();
    for i in (0..12).rev() {
        assert_eq!(two.frame(i), forward[i]);
    }
    let other = SimulatedRecording::new(&Scene { seed: 2, ..scene }).unwrap();
    assert_ne!(other.frame(3), forward[3]);
    assert_ne!(forward[3].data, forward[4].data);
}

#[test]
fn noise_has_the_spread_of_the_scene() {
    let spread = |camera: &str| {
        let camera =
            format!(r#""camera": {{"image_size_px": [320, 200], "origin_px": [160, 120], {camera}}}"#);
        let frame = SimulatedRecording::new(&scene_with(STEEL, &camera))
            .unwrap()
            .frame(0);
        // The lower right corner, far from the ball.
        let values: Vec<f64> = (150..200)
            .flat_map(|v| frame.row(v)[220..].to_vec())
            .map(f64::from)
            .collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / values.len() as f64;
        (mean, variance.sqrt())
    };
    // Rounding adds 1/12 to the variance; 5000 values fix a deviation to 1 %.
    let (mean, std) = spread(r#""noise_grey": 2.0"#);
    assert!(
        (mean - 60.0).abs() < 0.15 && (std - (4.0 + 1.0 / 12.0_f64).sqrt()).abs() < 0.08,
        "{mean} {std}"
    );
    let (_, std) = spread(r#""noise_grey": 0, "electrons_per_grey": 10"#);
    assert!((std - (6.0 + 1.0 / 12.0_f64).sqrt()).abs() < 0.1, "{std}");
    let (_, std) = spread(r#""noise_grey": 0"#);
    assert_eq!(std, 0.0);
}

#[test]
fn files_appear_and_the_lossless_video_holds_every_grey_level() {
    let folder = tempfile::tempdir().unwrap();
    let recording = SimulatedRecording::new(&scene_with(STEEL, SMALL)).unwrap();
    let mut heard = 0;
    let written = write(&recording, "steel", folder.path(), |done| heard = done).unwrap();
    assert_eq!(written.video, folder.path().join("steel.mkv"));
    assert_eq!(
        (heard, written.frames),
        (recording.frame_count(), recording.frame_count())
    );
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 3);

    let mut video = track::frames::open(&written.video).unwrap();
    let mut read = 0;
    while let Some(frame) = video.next_frame().unwrap() {
        assert_eq!(frame.luma, recording.frame(frame.index), "frame {}", frame.index);
        assert!((frame.time_s - frame.index as f64 / 240.0).abs() < 1e-9);
        read += 1;
    }
    assert_eq!(read, recording.frame_count());

    let truth: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(&written.truth).unwrap()).unwrap();
    assert_eq!(truth["schema"], "track.truth/1");
    assert_eq!(truth["centres"].as_array().unwrap().len(), read);
    assert_eq!(
        truth["effects"].as_array().unwrap().len(),
        recording.decisions().len()
    );
    let calib: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(&written.calib).unwrap()).unwrap();
    assert_eq!(calib["schema"], "track.calib/1");
    assert_eq!(calib["origin_px"], serde_json::json!([60.0, 180.0]));
}

#[test]
fn h264_stays_near_the_frames() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene_with(STEEL, &SMALL.replace("lossless", "h264"));
    let recording = SimulatedRecording::new(&scene).unwrap();
    let written = write(&recording, "steel", folder.path(), |_| {}).unwrap();
    assert_eq!(written.video.extension().unwrap(), "mp4");
    let mut video = track::frames::open(&written.video).unwrap();
    let frame = video.next_frame().unwrap().unwrap();
    let truth = recording.frame(0);
    let squares: f64 = frame
        .luma
        .data
        .iter()
        .zip(&truth.data)
        .map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2))
        .sum();
    let rms = (squares / truth.data.len() as f64).sqrt();
    assert!(rms < 2.0, "{rms}");
}

#[test]
fn an_unwritable_folder_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    let recording = SimulatedRecording::new(&scene_with(STEEL, SMALL)).unwrap();
    let error = write(&recording, "steel", &file.join("out"), |_| {}).unwrap_err();
    assert!(error.to_string().contains("file/out"), "{error}");
}

#[test]
fn the_calibration_puts_the_true_centres_where_they_are() {
    let lens = r#""lens": {"camera_matrix": [[900,0,160],[0,900,100],[0,0,1]], "distortion": [-0.2,0.05,0.001,0,0]}"#;
    for camera in [
        r#""view": "side""#,
        r#""view": "top", "origin_px": [60, 100]"#,
        lens,
        r#""roll_deg": 12"#,
        r#""view": "top", "origin_px": [60, 100], "roll_deg": -30"#,
        &format!(r#"{lens}, "roll_deg": 7"#),
    ] {
        let origin = if camera.contains("origin_px") {
            ""
        } else {
            r#""origin_px": [60, 180], "#
        };
        let small = format!(r#""camera": {{"image_size_px": [320, 200], {origin}{camera}}}"#);
        let recording = SimulatedRecording::new(&scene_with(STEEL, &small)).unwrap();
        let text = track::simulate::calibration(&recording).to_string();
        let calibration = track::calibration::Calibration::parse(&text, "calib.json").unwrap();
        let rectification = calibration.rectification().unwrap();
        let top = recording.scene().camera.view == View::Top;
        for centre in recording.truth().centres.iter().filter(|c| c.visible) {
            let at = track::geometry::PixelPoint::new(centre.u_px, centre.v_px);
            let plane = rectification.plane_from_pixel(at).unwrap();
            let scale = recording.scene().camera.metres_per_pixel;
            let up_m = if top { centre.y_m } else { centre.z_m };
            assert!((plane.right * scale - centre.x_m).abs() < 1e-9, "{camera}");
            assert!((plane.up * scale - up_m).abs() < 1e-9, "{camera}");
        }
    }
}

#[test]
fn a_long_exposure_is_rendered_in_bounded_time_and_memory() {
    // 10 m/s over 30 ms: a smear of 375 px.
    let more = r#""launch": {"speed_m_s": 10}, "camera": {"frame_rate_hz": 30, "exposure_s": 0.03, "noise_grey": 0},
                  "effects": {"shading": "off"}"#;
    let recording = SimulatedRecording::new(&scene_with(STEEL, more)).unwrap();
    let frame = recording.frame(1);
    let light: f64 = frame.data.iter().map(|g| f64::from(*g) - 60.0).sum();
    let area_px = std::f64::consts::PI * 15.625 * 15.625;
    assert!((light / (140.0 * area_px) - 1.0).abs() < 0.02, "{light}");
}

proptest! {
    // Whatever the restitution, the contact is short, stays below the floor's touch, and ends as the impact says.
    #[test]
    fn a_contact_is_short_and_continuous(e in 1e-3..1.0f64, speed in 0.0..3.0f64) {
        let contact = format!(r#"{{"model": "mu_e", "restitution": {e}, "friction": 0.2}}"#);
        let more = format!(
            r#""launch": {{"speed_m_s": {speed}}}, "ball": {{"contact_modulus_pa": 1e7}}, "stop": {{"bounces": 1}},
               "effects": {{"drag": "off", "magnus": "off", "buoyancy": "off", "contact_time": "on"}}"#
        );
        let recording = SimulatedRecording::new(&scene_with(&contact, &more)).unwrap();
        let path = recording.trajectory();
        let impact = path.impacts()[0];
        prop_assert!(impact.contact_s > 0.0 && impact.contact_s < 0.02);
        for i in 0..=40 {
            let t = impact.time_s + impact.contact_s * (f64::from(i) + 1e-6) / 40.001;
            prop_assert!(path.state(t).position_m.z <= 0.0125 + 1e-12);
        }
        let before_end = path.state(impact.time_s + impact.contact_s * (1.0 - 1e-9));
        let after_end = path.state(impact.time_s + impact.contact_s * (1.0 + 1e-9));
        prop_assert!((before_end.position_m - after_end.position_m).norm() < 1e-9);
        prop_assert!((before_end.velocity_m_s - after_end.velocity_m_s).norm() < 1e-5);
    }
}

#[test]
fn every_sample_scene_is_accepted() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/scenes");
    let mut count = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let recording = SimulatedRecording::new(&Scene::read(&path).unwrap());
        assert!(recording.is_ok(), "{}: {:?}", path.display(), recording.err());
        count += 1;
    }
    assert!(count >= 4);
}

#[test]
fn a_turned_camera_comes_with_the_homography_that_undoes_it() {
    use track::calibration::Calibration;
    use track::geometry::PixelPoint;
    let lens = r#""lens": {"camera_matrix": [[1900, 0, 639.5], [0, 1900, 359.5], [0, 0, 1]], "distortion": [-0.3, 0.1, 0, 0, 0]}"#;
    for (tilt, more) in [
        (10.0, format!(r#""distance_m": 1.5, {lens}"#)),
        (15.0, format!(r#""distance_m": 1.5, {lens}, "roll_deg": 8"#)),
        (-25.0, r#""distance_m": null, "roll_deg": -12"#.to_owned()),
        (0.0, format!(r#""distance_m": 1.5, {lens}, "roll_deg": -20"#)),
        (-25.0, r#""distance_m": 1.5"#.to_owned()),
        (40.0, r#""distance_m": null"#.to_owned()),
        (0.0, format!(r#""distance_m": 1.5, {lens}"#)),
    ] {
        let scene = scene_with(STEEL, &format!(r#""camera": {{"tilt_deg": {tilt}, {more}}}"#));
        let recording = SimulatedRecording::new(&with_effects(&scene, Switch::On)).unwrap();
        let calib = track::simulate::calibration(&recording).to_string();
        let c = Calibration::parse(&calib, "scene").unwrap();
        let map = c.rectification().unwrap();
        let metres = if tilt == 0.0 {
            scene.camera.metres_per_pixel
        } else {
            1.0
        };
        assert!(c.has_origin());
        for centre in recording.truth().centres.iter().filter(|c| c.visible) {
            let p = map
                .plane_from_pixel(PixelPoint::new(centre.u_px, centre.v_px))
                .unwrap();
            let off = (metres * p.right - centre.x_m).hypot(metres * p.up - centre.z_m);
            assert!(off < 1e-9, "{tilt}: {off}");
        }
    }
    // Above 0 the right side is nearer: a pixel there is fewer metres.
    let scene = scene_with(STEEL, r#""camera": {"tilt_deg": 20, "distance_m": 1.5}"#);
    let calib = track::simulate::calibration(&SimulatedRecording::new(&scene).unwrap()).to_string();
    let map = Calibration::parse(&calib, "scene")
        .unwrap()
        .rectification()
        .unwrap();
    let size = |u: f64| {
        map.jacobian(PixelPoint::new(u, 360.0))
            .unwrap()
            .determinant()
            .abs()
    };
    assert!(size(1200.0) < 0.9 * size(80.0));
    let error = Scene::from_json(&scene_text(STEEL, r#""camera": {"tilt_deg": 90}"#)).unwrap_err();
    assert!(error.to_string().contains("tilt_deg"), "{error}");
}

// ---------------------------------------------------------------------------------------------- bench, slope, roll, bump

/// No effect but those named.
fn only(scene: &Scene, names: &[&str]) -> Scene {
    let mut only = with_effects(scene, Switch::Off);
    for name in names {
        only.effects.named.insert((*name).to_owned(), Switch::On);
    }
    only
}

/// A recording of a scene with no effect but those named.
fn recorded(contact: &str, more: &str, names: &[&str]) -> SimulatedRecording {
    SimulatedRecording::new(&only(&scene_with(contact, more), names)).unwrap()
}

#[test]
fn bench_slope_roll_and_bump_are_left_out_where_there_is_none() {
    let more =
        r#""floor": {"slope_deg": 0}, "launch": {"bench": null}, "camera": {"roll_deg": 0, "bump": null}"#;
    let scene = scene_with(STEEL, more);
    let recording = SimulatedRecording::new(&scene).unwrap();
    let none = SimulatedRecording::new(&with_effects(&scene, Switch::On)).unwrap();
    for name in ["bench", "floor_slope", "camera_roll", "bump"] {
        let found = decision(&recording, name);
        assert!(!found.used && found.estimate.amount == 0.0, "{name}");
        assert!(decision(&none, name).reason.contains("nothing for it to do"));
    }
    let truth = recording.truth();
    assert_eq!((truth.launch, truth.floor_slope_deg), (None, 0.0));
    let plain = SimulatedRecording::new(&scene_with(STEEL, "")).unwrap();
    assert_eq!(recording.frame(20), plain.frame(20));
    assert_eq!(recording.truth(), plain.truth());
}

#[test]
fn centres_with_auto_are_within_tolerance_over_a_slope_and_after_a_bump() {
    use serde_json::json;
    let small = || {
        (-7.0..0.7f64, any::<bool>()).prop_map(|(p, up)| if up { 10f64.powf(p) } else { -(10f64.powf(p)) })
    };
    let more = (small(), small(), small(), 0.02..0.2f64, any::<bool>());
    let mut runner = TestRunner::new_with_rng(
        Config {
            cases: 100,
            failure_persistence: None,
            ..Config::default()
        },
        prop::test_runner::TestRng::from_seed(prop::test_runner::RngAlgorithm::ChaCha, &[8; 32]),
    );
    let counts = std::cell::RefCell::new([[0_u32; 2]; 4]);
    runner
        .run(
            &(any_scene(), more),
            |(text, (slope, roll, bump, seen_s, bench))| {
                let mut scene: serde_json::Value = serde_json::from_str(&text).unwrap();
                scene["floor"] = json!({"slope_deg": slope});
                scene["camera"]["roll_deg"] = json!(roll);
                scene["camera"]["bump"] = json!({"amplitude_px": [bump, 0.5 * bump]});
                if bench && scene["launch"]["speed_m_s"].as_f64().unwrap() > 0.6 {
                    scene["launch"]["bench"] = json!({"seen_s": seen_s});
                }
                let both = Scene::from_json(&scene.to_string()).and_then(|scene| {
                    let auto = SimulatedRecording::new(&with_effects(&scene, Switch::Auto))?;
                    Ok((
                        auto,
                        SimulatedRecording::new(&with_effects(&scene, Switch::On))?,
                        scene,
                    ))
                });
                let (auto, all, scene) = match both {
                    Ok(both) => both,
                    Err(error) => {
                        let told = [
                            "never enters the picture",
                            "camera.distance_m",
                            "in or on a floor",
                        ];
                        let error = error.to_string();
                        prop_assert!(told.iter().any(|t| error.contains(t)), "{error}");
                        return Err(TestCaseError::reject("never seen"));
                    }
                };
                let apart = apart_px(&auto, &all);
                prop_assert!(
                    apart <= scene.tolerance_px,
                    "{apart} px apart, tolerance {}",
                    scene.tolerance_px
                );
                let names = ["bench", "floor_slope", "camera_roll", "bump"];
                for (name, count) in names.into_iter().zip(counts.borrow_mut().iter_mut()) {
                    count[usize::from(decision(&auto, name).used)] += 1;
                }
                Ok(())
            },
        )
        .unwrap();
    let counts = counts.into_inner();
    // A bench is used or not there.
    assert!(
        counts.iter().all(|[out, used]| *out > 10 && *used > 10),
        "{counts:?}"
    );
}

#[test]
fn a_ball_rolls_along_its_bench_until_the_launch() {
    for (bench, ratio) in [
        (r#""bench": {"seen_s": 0.1}"#, 1.0),
        (
            r#""bench": {"seen_s": 0.1, "track_width_m": 0.01}"#,
            0.0125 / (0.0125_f64.powi(2) - 0.01_f64.powi(2) / 4.0).sqrt(),
        ),
        (r#""bench": {"seen_s": 0.1}, "spin_ratio": [0, 0.3, 0.2]"#, 0.3),
    ] {
        let recording = recorded(STEEL, &format!(r#""launch": {{{bench}}}"#), &["bench"]);
        // At 1 m/s.
        assert!((recording.scene().launch.surface_spin_m_s.y - ratio).abs() < 1e-15);
        let truth = recording.truth();
        let launch = truth.launch.unwrap();
        assert_eq!((launch.time_s, launch.rolled_s, launch.edge_x_m), (0.1, 0.1, 0.0));
        assert_eq!((launch.speed_m_s, launch.drop_height_m), (1.0, 0.1));
        assert_eq!(truth.centres[0].x_m, -0.1);
        for c in &truth.centres {
            let flown_s = (c.time_s - 0.1).max(0.0);
            if c.time_s < truth.bounces[0].time_s {
                assert!((c.x_m - (c.time_s - 0.1)).abs() < 1e-12, "{}", c.time_s);
                assert!(
                    (c.z_m - (0.1125 - 0.5 * 9.81 * flown_s * flown_s)).abs() < 1e-12,
                    "{}",
                    c.time_s
                );
            }
        }
        let fall_s = (0.2_f64 / 9.81).sqrt();
        let first = truth.bounces[0];
        assert!((first.time_s - 0.1 - fall_s).abs() < 1e-12 && (first.spin_in_m_s - ratio).abs() < 1e-12);
        // Without the bench the clip begins at the launch.
        let bare = SimulatedRecording::new(&only(recording.scene(), &[]))
            .unwrap()
            .truth();
        assert_eq!((bare.launch, bare.centres[0].x_m), (None, 0.0));
        assert!((bare.bounces[0].time_s - fall_s).abs() < 1e-12);
        assert_eq!(truth.centres.len(), bare.centres.len() + 24);
    }
}

#[test]
fn a_clip_without_its_bench_is_the_flight_alone() {
    let with = recorded(
        STEEL,
        &format!(r#"{SMALL}, "launch": {{"bench": {{"bench_grey": 90}}}}"#),
        &["shading"],
    );
    let flight = recorded(
        STEEL,
        &format!(r#"{SMALL}, "launch": {{"spin_ratio": [0, 1, 0]}}"#),
        &["shading"],
    );
    assert_eq!(with.frame_count(), flight.frame_count());
    for i in [0, 7, 30] {
        assert_eq!(with.frame(i), flight.frame(i));
    }
    let (with, flight) = (with.truth(), flight.truth());
    assert!(with.centres == flight.centres && with.bounces == flight.bounces);
}

#[test]
fn a_bench_is_drawn_below_the_ball_and_ends_at_the_edge() {
    let look = r#""look": {"background_grey": 60, "floor_grey": 80},
        "camera": {"image_size_px": [320, 200], "origin_px": [100, 180], "metres_per_pixel": 0.001}"#;
    let frame = |bench: &str| {
        recorded(
            STEEL,
            &format!(r#"{look}, "launch": {{"bench": {bench}}}"#),
            &["bench"],
        )
        .frame(0)
    };
    // Its top 100 px above the floor, 30 px thick, its end in column 100.
    let drawn = frame(r#"{"seen_s": 0.05, "bench_grey": 120}"#);
    for (v, u, grey) in [
        (77, 95, 60),
        (83, 95, 120),
        (107, 5, 120),
        (113, 95, 60),
        (95, 97, 120),
        (95, 103, 60),
        (183, 50, 80),
        (177, 50, 60),
    ] {
        assert_eq!(drawn.row(v)[u], grey, "row {v}, column {u}");
    }
    let bare = frame(r#"{"seen_s": 0.05}"#);
    assert_eq!(bare.row(95)[95], 60);
    // The ball rests on it, at x = -0.05.
    assert_eq!((drawn.row(77)[50], bare.row(77)[50]), (200, 200));
    let low = recorded(
        STEEL,
        &format!(r#"{look}, "launch": {{"drop_height_m": 0.01, "bench": {{"bench_grey": 120}}}}"#),
        &["bench"],
    );
    assert_eq!((low.frame(0).row(175)[20], low.frame(0).row(183)[20]), (120, 80));
}

#[test]
fn val_flight_over_a_slope() {
    let (g, radius, height, speed, e, mu) = (9.81_f64, 0.0125, 0.1, 1.2, 0.78, 0.07);
    for slope_deg in [-15.0_f64, -2.0, 0.1, 6.0, 20.0] {
        let more = format!(
            r#""floor": {{"slope_deg": {slope_deg}}}, "launch": {{"speed_m_s": {speed}, "spin_ratio": [0, -1, 0]}},
               "stop": {{"bounces": 4}}"#
        );
        let recording = recorded(STEEL, &more, &["floor_slope"]);
        let truth = recording.truth();
        assert!((truth.floor_slope_deg - slope_deg).abs() < 1e-12);
        let (sin, cos) = slope_deg.to_radians().sin_cos();
        let along = |x: f64, z: f64| (x * cos + z * sin, z * cos - x * sin);
        // Along the normal g cos s pulls, and the ball starts with -v sin s.
        let clearance = (height + radius) * cos - radius;
        let arrival = ((speed * sin).powi(2) + 2.0 * g * cos * clearance).sqrt();
        let mut time_s = (arrival - speed * sin) / (g * cos);
        let mut down = arrival;
        assert_eq!(truth.bounces.len(), 4);
        for (b, impact) in truth.bounces.iter().zip(recording.trajectory().impacts()) {
            assert!(
                (b.time_s - time_s).abs() < 1e-12,
                "{slope_deg}: {} {time_s}",
                b.time_s
            );
            // The lowest point along the normal is on the plane.
            let (x, z) = (impact.place_m.x + radius * sin, impact.place_m.z - radius * cos);
            assert!((z - x * sin / cos).abs() < 1e-12, "{slope_deg}");
            let (before_t, before_n) = along(b.incident.vx_m_s, b.incident.vz_m_s);
            let (after_t, after_n) = along(b.rebound.vx_m_s, b.rebound.vz_m_s);
            assert!((before_n + down).abs() < 1e-12 && (after_n - e * down).abs() < 1e-12);
            assert!((b.restitution.unwrap() - e).abs() < 1e-12);
            assert!((b.tangential_ratio.unwrap() - after_t / before_t).abs() < 1e-12);
            assert!((b.incident.angle_deg - before_t.abs().atan2(down).to_degrees()).abs() < 1e-9);
            let gained = (before_t - after_t) / 0.4;
            assert!((b.spin_out_m_s - b.spin_in_m_s - gained).abs() < 1e-12);
            if b.regime == "sliding" {
                assert!((b.friction.unwrap() - mu).abs() < 1e-12);
            }
            // What it loses is what friction and restitution take: nothing tangential is lost without slip.
            let slip = before_t - b.spin_in_m_s;
            let left = after_t - b.spin_out_m_s;
            let tangential = 0.5 * (slip * slip - left * left) / (1.0 + 1.0 / 0.4);
            let energy = |vt: f64, vn: f64, w: f64| 0.5 * (vt * vt + vn * vn + 0.4 * w * w);
            let lost = energy(before_t, before_n, b.spin_in_m_s) - energy(after_t, after_n, b.spin_out_m_s);
            assert!((lost - 0.5 * down * down * (1.0 - e * e) - tangential).abs() < 1e-12);
            down *= e;
            time_s += 2.0 * down / (g * cos);
        }
        assert_eq!(truth.bounces[0].regime, "sliding");
    }
}

#[test]
fn slopes_to_both_sides_are_mirror_images() {
    let path = |slope_deg: f64| {
        let more = format!(
            r#""floor": {{"slope_deg": {slope_deg}}}, "launch": {{"speed_m_s": 0}}, "camera": {{"origin_px": [600, 660]}},
               "ball": {{"contact_modulus_pa": 1e7}}"#
        );
        recorded(STEEL, &more, &["floor_slope", "contact_time", "drag"])
    };
    let (left, right) = (path(7.0), path(-7.0));
    for (a, b) in left.truth().centres.iter().zip(&right.truth().centres) {
        assert!(
            (a.x_m + b.x_m).abs() < 1e-12 && (a.z_m - b.z_m).abs() < 1e-12,
            "{}",
            a.time_s
        );
    }
    // A ball on a floor that rises to the right leaves to the left, to where its own drop was turned by 2 s.
    let b = left.truth().bounces[0];
    assert!(b.rebound.vx_m_s < -0.1);
}

#[test]
fn a_slope_without_drag_is_the_same_integrated() {
    for slope_deg in [-10.0, 3.0, 20.0] {
        let more = format!(
            r#""floor": {{"slope_deg": {slope_deg}}}, "ball": {{"drag_factor": 0}}, "stop": {{"bounces": 3}}"#
        );
        let exact = recorded(STEEL, &more, &["floor_slope"]);
        let integrated = recorded(STEEL, &more, &["floor_slope", "drag"]);
        let pairs = exact
            .trajectory()
            .impacts()
            .iter()
            .zip(integrated.trajectory().impacts());
        for (a, b) in pairs {
            assert!(
                (a.time_s - b.time_s).abs() < 1e-11,
                "{slope_deg}: {} {}",
                a.time_s,
                b.time_s
            );
            assert!((a.place_m - b.place_m).norm() < 1e-11);
            assert!((a.incident.velocity_m_s - b.incident.velocity_m_s).norm() < 1e-10);
        }
        for i in 0..=300 {
            let t = exact.trajectory().end_s() * f64::from(i) / 300.0;
            let apart = exact.trajectory().state(t).position_m - integrated.trajectory().state(t).position_m;
            assert!(apart.norm() < 1e-10, "{slope_deg} {t}: {apart}");
        }
    }
}

#[test]
fn a_contact_on_a_slope_dips_along_the_normal() {
    let superball = r#""ball": {"radius_m": 0.023, "mass_kg": 0.0464, "contact_modulus_pa": 1e7}, "floor": {"slope_deg": 12}"#;
    let contact = r#"{"model": "e_e", "restitution": 0.96, "tangential_restitution_x": 0.5}"#;
    let recording = recorded(contact, superball, &["floor_slope", "contact_time"]);
    let path = recording.trajectory();
    let impact = path.impacts()[0];
    let (sin, cos) = 12.0_f64.to_radians().sin_cos();
    let gap = |t: f64| {
        let p = path.state(impact.time_s + t).position_m;
        p.z * cos - p.x * sin - 0.023
    };
    assert!(impact.contact_s > 1e-4);
    for i in 1..20 {
        assert!(gap(impact.contact_s * f64::from(i) / 20.0) < 0.0, "{i}");
    }
    for t in [0.0, impact.contact_s] {
        assert!(gap(t).abs() < 1e-12, "{t}: {}", gap(t));
        let (before, after) = (
            path.state(impact.time_s + t - 1e-9),
            path.state(impact.time_s + t + 1e-9),
        );
        assert!((after.velocity_m_s - before.velocity_m_s).norm() < 1e-3);
        assert!((after.position_m - before.position_m).norm() < 1e-7);
    }
    // The arcs have the same height above the floor when they meet.
    let into = recording.truth().bounces[0].arcs_meet_s - impact.time_s;
    let out = into - impact.contact_s;
    let arc = |v: track::rebound::RigidMotion, t: f64| {
        (v.velocity_m_s.z * cos - v.velocity_m_s.x * sin) * t - 0.5 * 9.81 * cos * t * t
    };
    assert!((arc(impact.incident, into) - arc(impact.rebound, out)).abs() < 1e-12);
}

#[test]
fn a_ball_that_stays_down_rolls_downhill() {
    let recording = recorded(
        r#"{"model": "mu_e", "restitution": 0, "friction": 0.3}"#,
        r#""floor": {"slope_deg": 5}, "stop": {"bounces": 2, "tail_s": 0.2}"#,
        &["floor_slope"],
    );
    let path = recording.trajectory();
    let impact = path.impacts()[0];
    let (sin, cos) = 5.0_f64.to_radians().sin_cos();
    let after = impact.rebound.velocity_m_s;
    let along = |t: f64| {
        let moved = path.state(impact.time_s + t).position_m - impact.place_m;
        (moved.x * cos + moved.z * sin, moved.z * cos - moved.x * sin)
    };
    for t in [0.01, 0.1, 0.2] {
        let expected = (after.x * cos + after.z * sin) * t - 0.5 * 9.81 * sin / 1.4 * t * t;
        let (moved, risen) = along(t);
        assert!((moved - expected).abs() < 1e-12 && risen.abs() < 1e-12, "{t}");
    }
}

proptest! {
    // Whatever slope, restitution and effects, the ball stays above the floor.
    #[test]
    fn no_ball_passes_a_sloping_floor(
        e in 0.0..1.0f64, slope_deg in -20.0..20.0f64, speed in 0.0..4.0f64, bounces in 1..60u32, air in any::<bool>()
    ) {
        let contact = format!(r#"{{"model": "mu_e", "restitution": {e}, "friction": 0.1}}"#);
        let more = format!(
            r#""floor": {{"slope_deg": {slope_deg}}}, "launch": {{"speed_m_s": {speed}}},
               "stop": {{"bounces": {bounces}, "tail_s": 0.1}}, "camera": {{"origin_px": [640, 360]}}"#
        );
        let names: &[&str] = if air { &["floor_slope", "drag", "buoyancy"] } else { &["floor_slope"] };
        let recording = recorded(&contact, &more, names);
        let path = recording.trajectory();
        let (sin, cos) = slope_deg.to_radians().sin_cos();
        for i in 0..=1000 {
            let p = path.state(path.end_s() * f64::from(i) / 1000.0).position_m;
            prop_assert!(p.z * cos - p.x * sin >= 0.0125 - 1e-9, "{p}");
        }
    }
}

#[test]
fn a_sloping_floor_is_drawn_with_its_slope() {
    let camera = r#""camera": {"image_size_px": [320, 200], "origin_px": [100, 150], "metres_per_pixel": 0.001},
        "look": {"background_grey": 60, "floor_grey": 100, "ball_grey": 200}"#;
    let frame = |slope_deg: f64| {
        let more = format!(r#"{camera}, "floor": {{"slope_deg": {slope_deg}}}"#);
        recorded(STEEL, &more, &["floor_slope"]).frame(0)
    };
    let rises = 10.0_f64.to_radians().tan();
    for (slope_deg, rise) in [(10.0, rises), (-10.0, -rises), (0.0, 0.0)] {
        let frame = frame(slope_deg);
        for u in [10, 180, 300] {
            let row = 150.0 - rise * (u as f64 - 100.0);
            let above = frame.row((row - 2.0) as usize)[u];
            let below = frame.row((row + 3.0) as usize)[u];
            assert_eq!((above, below), (60, 100), "{slope_deg}, column {u}");
        }
    }
}

#[test]
fn a_rolled_camera_turns_the_picture_about_its_axis() {
    for (roll_deg, camera) in [
        (10.0_f64, r#""distance_m": 2"#),
        (
            -35.0,
            r#""distance_m": 2, "view": "top", "origin_px": [120, 360]"#,
        ),
        (
            5.0,
            r#""lens": {"camera_matrix": [[1900, 0, 600], [0, 1900, 300], [0, 0, 1]]}, "plane_offset_m": 0.1"#,
        ),
    ] {
        let scene = scene_with(
            STEEL,
            &format!(r#""camera": {{{camera}, "roll_deg": {roll_deg}}}"#),
        );
        let upright = SimulatedRecording::new(&only(&scene, &["perspective"])).unwrap();
        let rolled = SimulatedRecording::new(&only(&scene, &["perspective", "camera_roll"])).unwrap();
        let (sin, cos) = roll_deg.to_radians().sin_cos();
        let axis = scene.camera.lens.map_or((639.5, 359.5), |_| (600.0, 300.0));
        let mut farthest = 0.0_f64;
        for (a, b) in upright.truth().centres.iter().zip(&rolled.truth().centres) {
            let (u, v) = (a.u_px - axis.0, a.v_px - axis.1);
            let expected = (axis.0 + u * cos - v * sin, axis.1 + u * sin + v * cos);
            assert!((b.u_px - expected.0).hypot(b.v_px - expected.1) < 1e-9);
            farthest = farthest.max((b.u_px - a.u_px).hypot(b.v_px - a.v_px));
        }
        let estimate = decision(&rolled, "camera_roll").estimate.amount;
        assert!(
            estimate >= 0.5 * farthest && farthest > 10.0,
            "{estimate} {farthest}"
        );
        let calib = track::simulate::calibration(&rolled);
        assert!((calib["up_px"][0].as_f64().unwrap() - sin).abs() < 1e-15);
        assert!((calib["up_px"][1].as_f64().unwrap() + cos).abs() < 1e-15);
        assert!(track::simulate::calibration(&upright).get("up_px").is_none());
    }
}

#[test]
fn cameras_rolled_to_both_sides_see_mirror_images() {
    let frame = |roll_deg: f64, i: usize| {
        let more = format!(
            r#""camera": {{"image_size_px": [320, 200], "origin_px": [159.5, 180], "roll_deg": {roll_deg}}},
               "look": {{"background_grey": 60, "floor_grey": 90, "ball_grey": 200, "reflection": 0.3}},
               "launch": {{"speed_m_s": 0}}"#
        );
        recorded(STEEL, &more, &["camera_roll", "defocus", "reflection"]).frame(i)
    };
    for i in [0, 30, 34] {
        let (left, right) = (frame(-8.0, i), frame(8.0, i));
        for v in 0..200 {
            let mirrored: Vec<u8> = right.row(v).iter().rev().copied().collect();
            let most = left
                .row(v)
                .iter()
                .zip(&mirrored)
                .map(|(a, b)| a.abs_diff(*b))
                .max()
                .unwrap();
            assert!(most <= 1, "frame {i}, row {v}: {most}");
        }
        // Rolled to the right, up leans to the right: the floor falls to the right.
        assert_eq!((right.row(178)[10], right.row(178)[310]), (90, 60));
    }
}

const BUMPED: &str = r#""look": {"texture_grey": 6, "reflection": 0.3, "shadow": 0.5, "floor_grey": 90, "unevenness": 0},
    "stop": {"bounces": 1, "tail_s": 0.05}, "launch": {"bench": {"seen_s": 0.02, "bench_grey": 110}, "speed_m_s": 0.6}"#;

fn bumped(amplitude_px: [f64; 2], more: &str, switch: Switch) -> SimulatedRecording {
    let camera = format!(
        r#""camera": {{"image_size_px": [320, 200], "origin_px": [60, 170], "codec": "lossless", "noise_grey": 0,
            "bump": {{"amplitude_px": [{}, {}]}} {more}}}"#,
        amplitude_px[0], amplitude_px[1]
    );
    let mut scene = scene_with(STEEL, &format!("{BUMPED}, {camera}"));
    scene.effects.named.insert("bump".into(), switch);
    // How much `auto` has of these goes with the amplitude: a later impact makes the camera swing later.
    for name in ["drag", "magnus", "buoyancy", "contact_time"] {
        scene.effects.named.insert(name.into(), Switch::On);
    }
    SimulatedRecording::new(&scene).unwrap()
}

/// The shift that truth says frame `i` has, px.
fn shift_px(bumped: &SimulatedRecording, still: &SimulatedRecording, i: usize) -> (f64, f64) {
    let (a, b) = (bumped.truth().centres[i], still.truth().centres[i]);
    (a.u_px - b.u_px, a.v_px - b.v_px)
}

#[test]
fn a_bump_shifts_ball_and_backdrop_together() {
    let still = bumped([1.0, 1.0], "", Switch::Off);
    let impact_s = still.truth().bounces[0].time_s;
    let i = (impact_s * 240.0).ceil() as usize + 1;
    let (unit, _) = shift_px(&bumped([1.0, 0.0], "", Switch::On), &still, i);
    let since_s = i as f64 / 240.0 - impact_s;
    let expected = (2.0 * std::f64::consts::PI * 20.0 * since_s).sin() * (-since_s / 0.015).exp();
    assert!((unit - expected).abs() < 1e-9, "{unit} {expected}");
    // By whole pixels the picture is the unbumped one, moved.
    let moved = bumped([5.0 / unit, -3.0 / unit], "", Switch::On);
    let (du, dv) = shift_px(&moved, &still, i);
    assert!((du - 5.0).abs() < 1e-9 && (dv + 3.0).abs() < 1e-9, "{du} {dv}");
    let (a, b) = (still.frame(i), moved.frame(i));
    let mut differing = 0;
    for v in 3..200 {
        for u in 0..315 {
            let apart = a.row(v)[u].abs_diff(b.row(v - 3)[u + 5]);
            assert!(apart <= 1, "row {v}, column {u}: {apart}");
            differing += u32::from(apart);
        }
    }
    // Grey levels that were within rounding of a half.
    assert!(differing < 20, "{differing}");
    assert_ne!(a, b);
    // Before the impact nothing moves.
    assert_eq!(still.frame(i - 6), moved.frame(i - 6));
}

#[test]
fn bumps_go_with_the_speeds_of_the_impacts_and_add_up() {
    let more = r#""stop": {"bounces": 3}, "camera": {"bump": {"amplitude_px": [0.5, 2], "frequency_hz": 30, "decay_s": 0.4}}"#;
    let scene = scene_with(STEEL, more);
    let still = SimulatedRecording::new(&only(&scene, &[])).unwrap();
    let shaken = SimulatedRecording::new(&only(&scene, &["bump"])).unwrap();
    let impacts: Vec<(f64, f64)> = still
        .truth()
        .bounces
        .iter()
        .map(|b| (b.time_s, -b.incident.vz_m_s))
        .collect();
    let mut most = 0.0_f64;
    for (a, b) in still.truth().centres.iter().zip(&shaken.truth().centres) {
        let swing: f64 = impacts
            .iter()
            .filter(|(t, _)| *t <= a.time_s)
            .map(|(t, v)| {
                let since = a.time_s - t;
                v / impacts[0].1 * (60.0 * std::f64::consts::PI * since).sin() * (-since / 0.4).exp()
            })
            .sum();
        let (du, dv) = (b.u_px - a.u_px, b.v_px - a.v_px);
        let expected = if swing.abs() * 2.0 < 9e-4 { 0.0 } else { swing };
        assert!(
            (du - 0.5 * expected).abs() < 1e-9 && (dv - 2.0 * expected).abs() < 1e-9,
            "{}",
            a.time_s
        );
        assert_eq!((a.x_m, a.z_m), (b.x_m, b.z_m));
        most = most.max(du.hypot(dv));
    }
    let estimate = decision(&shaken, "bump").estimate.amount;
    assert!(estimate >= most && estimate < 3.0 * 2.1, "{estimate} {most}");
}

#[test]
fn a_shaken_picture_is_read_out_row_by_row_where_its_rows_are() {
    // A rolling shutter and a bump of whole rows: the ball is exposed when the rows it is in are.
    let still = bumped([0.0, 1.0], r#", "readout_s": 0.004"#, Switch::Off);
    let i = (still.truth().bounces[0].time_s * 240.0).ceil() as usize + 1;
    let shaken = bumped([0.0, 20.0], r#", "readout_s": 0.004"#, Switch::On);
    let (_, dv) = shift_px(&shaken, &still, i);
    let (centre, frame) = (shaken.truth().centres[i], shaken.frame(i));
    assert!(dv.abs() > 3.0, "{dv}");
    // The brightest row is that of the ball's lit half; its middle by the columns beyond the background.
    let row = frame.row(centre.v_px.round() as usize);
    let lit: Vec<f64> = (0..320_u16)
        .filter(|u| row[usize::from(*u)] > 125)
        .map(f64::from)
        .collect();
    let middle = 0.5 * (lit[0] + lit[lit.len() - 1]);
    assert!((middle - centre.u_px).abs() < 1.5, "{middle} {}", centre.u_px);
}
