//! Spin by the marks on the ball, whole recordings against their truth: rates and axes, what becomes of them at the bounces, and that a plain
//! ball, a symmetric pattern and too few turns never give a rate that is not there.

use crate::rendered::Rendered;
use serde_json::{Value, json};
use track::detect::centre::Accuracy;
use track::edits::Edits;
use track::impact::seen_spin::SpinSource;
use track::pipeline::{MeasureSettings, Measurement, Outcome, SpinSearch, measure_edited};

/// A hard ball of 12.5 mm, `radius_px` large, that grips a level floor twice.
fn scene(marks: &Value, radius_px: f64, spin_rad_s: [f64; 3], codec: &Value) -> Value {
    let metres_per_pixel = 0.0125 / radius_px;
    let even = |metres: f64| 2 * (metres / metres_per_pixel / 2.0).round() as usize;
    let mut camera = json!({
        "image_size_px": [even(0.50), even(0.26)], "origin_px": [even(0.05), even(0.23)],
        "metres_per_pixel": metres_per_pixel, "frame_rate_hz": 240, "exposure_s": 0.0005, "blur_px": 0.7, "noise_grey": 2.0
    });
    for (key, value) in codec.as_object().unwrap() {
        camera[key] = value.clone();
    }
    json!({
        "schema": "track.scene/1", "seed": 7,
        "ball": {"radius_m": 0.0125, "mass_kg": 0.064, "inertia_factor": 0.4},
        "contact": {"model": "e_e", "restitution": 0.8, "tangential_restitution_x": 0.4},
        "launch": {"drop_height_m": 0.14, "speed_m_s": 0.8, "spin_rad_s": spin_rad_s},
        "camera": camera,
        "look": {"background_grey": 40, "ball_grey": 200, "shading": 0.4, "marks": marks},
        "stop": {"bounces": 2, "tail_s": 0.08}
    })
}

fn measured(recording: &Rendered, spin: SpinSearch) -> Measurement {
    let settings = MeasureSettings {
        accuracy: Accuracy::Standard,
        spin,
    };
    let m = measure_edited(
        &recording.video,
        &recording.calibration,
        "a",
        settings,
        &Edits::default(),
        &mut |_| {},
    );
    let m = m.unwrap();
    assert_eq!(m.outcome, Outcome::Measured);
    m
}

/// The true rates about x, y and z of each arc.
fn true_rates(truth: &Value) -> Vec<[f64; 3]> {
    let arc = |arc: &Value| ["x_rad_s", "y_rad_s", "z_rad_s"].map(|key| arc["spin"][key].as_f64().unwrap());
    truth["arcs"].as_array().unwrap().iter().map(arc).collect()
}

const H264: [(&str, u64); 2] = [("h264", 14), ("h264", 20)];

#[test]
fn rates_spins_and_the_inertia_factor_of_a_ball_with_dots_are_true() {
    let dots = json!({"pattern": "dots", "count": 8, "radius_deg": 14, "grey": 50});
    for ((codec, crf), radius_px) in H264.into_iter().zip([9.0, 15.0]) {
        let codec = json!({"codec": codec, "crf": crf});
        let recording = Rendered::new(&scene(&dots, radius_px, [0.0, 95.0, 0.0], &codec));
        let m = measured(&recording, SpinSearch::Auto);
        for (arc, truth) in m.arcs.iter().zip(true_rates(&recording.truth)).take(2) {
            let rate = arc.spin.as_ref().unwrap().rate_rad_s.unwrap()[1];
            let (off, std) = (rate.value - truth[1], rate.std_uncertainty.unwrap());
            assert!(
                off.abs() < 4.0 * std && 0.0125 * off.abs() < 0.002,
                "{off} ± {std} of {truth:?}"
            );
            assert!(std < 0.3, "{std}");
        }
        let bounce = &m.bounces[0];
        assert_eq!(bounce.spin_in_source, Some(SpinSource::Measured));
        assert_eq!(bounce.spin_in_m_s, bounce.measured_spin_in_m_s);
        let k = bounce.inertia_factor.unwrap();
        assert!((k.value - 0.4).abs() < 0.01, "{k:?}");
        let e_x = bounce.tangential_restitution.unwrap();
        let off = (e_x.value - 0.4).abs();
        assert!(off < 0.005 && off < 4.0 * e_x.std_uncertainty.unwrap(), "{e_x:?}");
    }
}

#[test]
fn an_axis_far_from_the_line_of_sight_is_found() {
    let marks = json!({"pattern": "dots", "count": 8, "radius_deg": 14, "grey": 50});
    let recording = Rendered::new(&scene(
        &marks,
        15.0,
        [70.0, 80.0, -50.0],
        &json!({"codec": "lossless"}),
    ));
    let m = measured(&recording, SpinSearch::Auto);
    let rates = m.arcs[0].spin.as_ref().unwrap().rate_rad_s.unwrap();
    for (rate, truth) in rates.iter().zip(true_rates(&recording.truth)[0]) {
        let (off, std) = (rate.value - truth, rate.std_uncertainty.unwrap());
        assert!(
            off.abs() < 4.0 * std && off.abs() < 1.5,
            "{off} ± {std} of {truth}"
        );
    }
}

#[test]
fn a_plain_ball_has_no_spin_and_nobody_looks_where_nobody_asks() {
    let none = json!({"pattern": "none"});
    let plain = Rendered::new(&scene(
        &none,
        12.0,
        [0.0, 95.0, 0.0],
        &json!({"codec": "h264", "crf": 20}),
    ));
    let m = measured(&plain, SpinSearch::Auto);
    for spin in m.arcs.iter().filter_map(|arc| arc.spin.as_ref()) {
        assert!(
            spin.rate_rad_s.is_none() && spin.candidates_rad_s.is_empty(),
            "{:?}",
            spin.rate_rad_s
        );
    }
    assert!(
        m.bounces
            .iter()
            .all(|b| b.measured_spin_in_m_s.is_none() && b.inertia_factor.is_none())
    );
    let dots = json!({"pattern": "dots", "count": 8, "radius_deg": 14, "grey": 50});
    let marked = Rendered::new(&scene(
        &dots,
        12.0,
        [0.0, 95.0, 0.0],
        &json!({"codec": "lossless"}),
    ));
    let m = measured(&marked, SpinSearch::Off);
    assert!(m.arcs.iter().all(|arc| arc.spin.is_none()));
}

#[test]
fn a_line_round_the_ball_has_the_true_rate_among_its_candidates() {
    let line = json!({"pattern": "line", "grey": 40});
    let recording = Rendered::new(&scene(
        &line,
        14.0,
        [0.0, 60.0, 0.0],
        &json!({"codec": "lossless"}),
    ));
    let m = measured(&recording, SpinSearch::Auto);
    let truth = true_rates(&recording.truth)[0][1];
    let spin = m.arcs[0].spin.as_ref().unwrap();
    // It looks alike after half a turn. What is left after the ball's own speed may be one.
    let near = |rate: &f64| (rate - truth).abs() < 0.5;
    let is_candidate = spin.candidates_rad_s.iter().any(near);
    let is_told = spin.rate_rad_s.is_some_and(|rate| near(&rate[1].value));
    assert!(is_candidate && (is_told || spin.rate_rad_s.is_none()), "{spin:?}");
    assert!(spin.reason.as_ref().unwrap().contains("suit the pictures alike"));
}
