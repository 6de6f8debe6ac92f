//! Scenes: reading, flight, effects and their decision, rendering, files.
#![allow(clippy::unwrap_used)] // helpers of tests, which clippy.toml's exception does not reach

use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use std::path::Path;
use track::models::{SOLID_SPHERE, launch, mu_e};
use track::simulate::effects::{Decision, drag_coefficient};
use track::simulate::scene::{Codec, Contact, EffectsChoice, Switch, View};
use track::simulate::{Recording, Scene, SceneError, write};

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
fn apart_px(one: &Recording, two: &Recording) -> f64 {
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
            let auto = match Recording::new(&with_effects(&scene, Switch::Auto)) {
                Ok(auto) => auto,
                Err(error) => {
                    // Or, thrown aside by its spin, it flies into the camera.
                    let told = ["never enters the picture", "camera.distance_m"];
                    let error = error.to_string();
                    prop_assert!(told.iter().any(|t| error.contains(t)), "{error}");
                    return Err(TestCaseError::reject("never seen"));
                }
            };
            let all = Recording::new(&with_effects(&scene, Switch::On)).unwrap();
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
            launch.spin_ratio,
            launch.rise_speed_m_s
        ),
        (0.10, 1.0, [0.0; 3], 0.0)
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
        Ok(scene) => match Recording::new(&scene) {
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
        (bad(r#""camra": {}"#), &["camra", "did you mean \"camera\""]),
        (
            bad(r#""ball": {"radius": 0.01}"#),
            &["ball.radius", "did you mean \"radius_m\""],
        ),
        (
            bad(r#""effects": {"drga": "on"}"#),
            &["effects.drga", "did you mean \"drag\""],
        ),
        (bad(r#""effects": "al""#), &["effects", "did you mean \"all\""]),
        (
            bad(r#""ball": {"radius_m": -0.01}"#),
            &["ball.radius_m is -0.01", "above 0"],
        ),
        (
            bad(r#""ball": {"mass_kg": "heavy"}"#),
            &["ball.mass_kg is \"heavy\"", "above 0"],
        ),
        (
            bad(r#""camera": {"frame_rate_hz": 0}"#),
            &["camera.frame_rate_hz is 0", "above 0"],
        ),
        (
            bad(r#""camera": {"view": "front"}"#),
            &["camera.view is \"front\"", "side, top"],
        ),
        (
            bad(r#""camera": {"exposure_s": 0.01}"#),
            &["camera.exposure_s is 0.01", "at most", "shorten"],
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
            bad(r#""camera": {"blur_px": 1e4}"#),
            &["camera.blur_px is 10000.0", "from 0 to 50"],
        ),
        (
            bad(
                r#""launch": {"rise_speed_m_s": 5}, "camera": {"view": "top", "distance_m": 1, "origin_px": [120, 360]}"#,
            ),
            &["camera.distance_m is 1", "beyond the ball"],
        ),
        (bad(r#""stop": {"bounces": 0}"#), &["stop.bounces is 0", "from 1"]),
        (
            bad(r#""launch": {"drop_height_m": 0}"#),
            &["launch.drop_height_m", "rise_speed_m_s"],
        ),
        (
            bad(r#""launch": {"spin_ratio": [0, 1]}"#),
            &["launch.spin_ratio is [0,1]", "3 numbers"],
        ),
        (
            scene_text(
                r#"{"model": "mu_e", "restitution": 0.8, "friction": 0.3, "static_friction": 0.2}"#,
                "",
            ),
            &["contact.static_friction is 0.2", "at least friction, 0.3"],
        ),
        (
            scene_text(r#"{"model": "mu_e", "restitution": 1.01, "friction": 0.3}"#, ""),
            &["contact.restitution is 1.01", "from 0 to 1", "gains energy"],
        ),
        (
            scene_text(r#"{"model": "e_e", "restitution": 0.9, "friction": 0.3}"#, ""),
            &["contact.friction", "unknown key"],
        ),
        (
            scene_text(r#"{"model": "e_e", "restitution": 0.9}"#, ""),
            &["contact.tangential_restitution_x is missing", "from -1 to 1"],
        ),
        (
            r#"{"schema": "track.scene/1"}"#.into(),
            &["contact is missing", "mu_e"],
        ),
        (
            r#"{"schema": "track.scene/2"}"#.into(),
            &["schema is \"track.scene/2\"", "track.scene/1"],
        ),
        ("{".into(), &["not valid JSON", "line 1"]),
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
fn a_missing_file_is_named() {
    let error = Scene::read(Path::new("/nowhere/to/be.scene.json")).unwrap_err();
    assert!(matches!(error, SceneError::Unreadable { .. }));
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

fn decision(recording: &Recording, name: &str) -> Decision {
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
        let recording = Recording::new(&drop_scene(ball, 0.02)).unwrap();
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
        let (without, with) = (Recording::new(&scene).unwrap(), Recording::new(&with).unwrap());
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
    let amount = decision(&Recording::new(&drop_scene(STEEL_20_MM, 0.02)).unwrap(), "drag")
        .estimate
        .amount;
    let used = |tolerance_px: f64| {
        decision(
            &Recording::new(&drop_scene(STEEL_20_MM, tolerance_px)).unwrap(),
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
        let recording = Recording::new(&drop_scene(ball, tolerance_px)).unwrap();
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
        "look": {"texture_grey": 3, "reflection": 0.2, "shadow": 0.5, "flicker": 0.05, "unevenness": 0.2}"#;
    let scene = scene_with(STEEL, small);
    let none = Recording::new(&with_effects(&scene, Switch::Off)).unwrap();
    let all = Recording::new(&with_effects(&scene, Switch::On)).unwrap();
    for recording in [&none, &all] {
        let _ = recording.frame(10);
        let _ = recording.truth();
    }
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

fn rigid(contact: &str, more: &str) -> Recording {
    Recording::new(&with_effects(&scene_with(contact, more), Switch::Off)).unwrap()
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
        let recording = Recording::new(&scene).unwrap();
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
    let recording = Recording::new(&scene_with(contact, superball)).unwrap();
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
    let near = Recording::new(&near).unwrap();
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
    let (one, two) = (Recording::new(&scene).unwrap(), Recording::new(&scene).unwrap());
    let forward: Vec<_> = one.frames().take(12).collect();
    for i in (0..12).rev() {
        assert_eq!(two.frame(i), forward[i]);
    }
    let other = Recording::new(&Scene { seed: 2, ..scene }).unwrap();
    assert_ne!(other.frame(3), forward[3]);
    assert_ne!(forward[3].data, forward[4].data);
}

#[test]
fn noise_has_the_spread_of_the_scene() {
    let spread = |camera: &str| {
        let camera =
            format!(r#""camera": {{"image_size_px": [320, 200], "origin_px": [160, 120], {camera}}}"#);
        let frame = Recording::new(&scene_with(STEEL, &camera)).unwrap().frame(0);
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
    let recording = Recording::new(&scene_with(STEEL, SMALL)).unwrap();
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
    let recording = Recording::new(&scene).unwrap();
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
    let recording = Recording::new(&scene_with(STEEL, SMALL)).unwrap();
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
    ] {
        let small = format!(r#""camera": {{"image_size_px": [320, 200], "origin_px": [60, 180], {camera}}}"#);
        let recording = Recording::new(&scene_with(STEEL, &small)).unwrap();
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
    let recording = Recording::new(&scene_with(STEEL, more)).unwrap();
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
        let recording = Recording::new(&scene_with(&contact, &more)).unwrap();
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
        let recording = Recording::new(&Scene::read(&path).unwrap());
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
        (-25.0, r#""distance_m": 1.5"#.to_owned()),
        (40.0, r#""distance_m": null"#.to_owned()),
        (0.0, format!(r#""distance_m": 1.5, {lens}"#)),
    ] {
        let scene = scene_with(STEEL, &format!(r#""camera": {{"tilt_deg": {tilt}, {more}}}"#));
        let recording = Recording::new(&with_effects(&scene, Switch::On)).unwrap();
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
    let calib = track::simulate::calibration(&Recording::new(&scene).unwrap()).to_string();
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
