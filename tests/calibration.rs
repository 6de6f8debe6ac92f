//! `calib.json` as its users meet it: the samples, the contract's own example, every kind of bad file.

use proptest::prelude::*;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use track::calibration::{
    Calibration, CalibrationError, FileProblem, Floor, FloorLine, Launch, MetresPerPixel, Scale,
    ScaleEvidence, Silhouettes, View,
};
use track::geometry::PixelPoint;
use track::quantity::Quantity;

const EVIDENCE: ScaleEvidence = ScaleEvidence {
    ball_radius_units: Some(Quantity {
        value: 15.0,
        std_uncertainty: Some(0.05),
    }),
    gravity_units_s2: Some(Quantity {
        value: 12262.5,
        std_uncertainty: Some(20.0),
    }),
};

/// Everything that the contract shows, in its numbers.
fn contract() -> Value {
    json!({
        "schema": "track.calib/1",
        "view": "side",
        "image_size_px": [1280, 720],
        "scale": {"metres_per_pixel": 0.0008, "std_uncertainty": 0.000001},
        "origin_px": [120.0, 660.0],
        "up_px": [0.0, -1.0],
        "lens": {
            "camera_matrix": [[1450.0, 0, 640.0], [0, 1450.0, 360.0], [0, 0, 1]],
            "distortion": [-0.12, 0.05, 0.001, -0.0005, 0.0]
        },
        "frame_rate_hz": 240.0,
        "gravity_m_s2": 9.81,
        "ball": {"radius_m": 0.0125, "mass_kg": 0.0639, "inertia_factor": 0.4},
        "launch": {"edge_x_m": 0.0, "spin_ratio": 0.0}
    })
}

fn with_scale(scale: Value) -> Value {
    json!({"schema": "track.calib/1", "scale": scale, "ball": {"radius_m": 0.0125}})
}

fn homography() -> Value {
    with_scale(json!({"world_from_pixel": [[0.0008, 0.0, -0.1], [0.0, -0.0008, 0.53], [0.00004, 0.0, 1.0]]}))
}

/// `file` with the value at the dotted `key` replaced (an array's element by its index).
fn set(mut file: Value, key: &str, value: Value) -> Value {
    let mut place = &mut file;
    for part in key.split('.') {
        place = match part.parse::<usize>() {
            Ok(index) => &mut place[index],
            Err(_) => &mut place[part],
        };
    }
    *place = value;
    file
}

fn without(mut file: Value, key: &str) -> Value {
    file.as_object_mut().unwrap().shift_remove(key).unwrap();
    file
}

fn parse(file: &Value) -> Calibration {
    Calibration::parse(&file.to_string(), "lab.json").unwrap()
}

fn error(text: &str) -> CalibrationError {
    Calibration::parse(text, "lab.json").unwrap_err()
}

/// The problems of a file, with what every message must have checked.
fn problems(file: &Value) -> Vec<FileProblem> {
    let error = error(&file.to_string());
    let problems = error.problems().to_vec();
    assert!(!problems.is_empty(), "{error}");
    assert!(error.to_string().starts_with("lab.json: "), "{error}");
    for p in &problems {
        assert!(
            !p.found.is_empty() && !p.accepted.is_empty() && !p.hint.is_empty(),
            "{p:?}"
        );
        assert!(error.to_string().contains(&p.to_string()), "{error}");
    }
    problems
}

/// One problem, at `key`.
fn refused(file: &Value, key: &str) -> FileProblem {
    let problems = problems(file);
    assert_eq!(
        problems.iter().map(|p| p.key.as_str()).collect::<Vec<_>>(),
        [key],
        "{problems:#?}"
    );
    problems[0].clone()
}

fn samples() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("calib");
    let mut samples: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "json"))
        .collect();
    samples.sort();
    samples
}

#[test]
fn every_sample_is_read_and_works_over_its_whole_picture() {
    assert!(samples().len() >= 6);
    let guide =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("calib/README.md")).unwrap();
    for path in samples() {
        let c = Calibration::read(&path).unwrap();
        assert!(
            guide.contains(path.file_name().unwrap().to_str().unwrap()),
            "{} is not in the guide",
            path.display()
        );
        assert!(
            c.metres_per_unit(&EVIDENCE).unwrap().std_uncertainty.is_some(),
            "{}",
            path.display()
        );
        let (width, height) = c.image_size_px.unwrap_or((1280, 720));
        let r = c.rectification().unwrap();
        for (u, v) in [
            (0, 0),
            (width - 1, 0),
            (0, height - 1),
            (width - 1, height - 1),
            (width / 2, height / 2),
        ] {
            let p = PixelPoint::new(u as f64, v as f64);
            let back = r.pixel_from_plane(r.plane_from_pixel(p).unwrap()).unwrap();
            assert!(back.distance_px(p) < 1e-6, "{} at {p:?}", path.display());
        }
    }
}

#[test]
fn no_sample_has_a_problem() {
    use track::calibration::{Severity, check::check};
    for path in samples() {
        let found = check(&path, None).unwrap();
        assert!(
            found.iter().all(|f| f.severity == Severity::Remark),
            "{}: {found:?}",
            path.display()
        );
    }
}

#[test]
fn the_contracts_example_means_what_it_says() {
    let c = parse(&contract());
    assert_eq!(c.view, View::Side);
    assert_eq!(c.image_size_px, Some((1280, 720)));
    assert_eq!(
        c.scale,
        Scale::MetresPerPixel(MetresPerPixel {
            value: 0.0008,
            std: Some(0.000_001)
        })
    );
    assert_eq!(c.origin_px, Some(PixelPoint::new(120.0, 660.0)));
    assert_eq!(c.up_px, [0.0, -1.0]);
    assert_eq!(c.lens.unwrap().distortion(), [-0.12, 0.05, 0.001, -0.0005, 0.0]);
    assert_eq!(c.frame_rate_hz, Some(240.0));
    assert_eq!(
        (c.ball.radius_m, c.ball.mass_kg, c.ball.inertia_factor),
        (Some(0.0125), Some(0.0639), 0.4)
    );
    assert_eq!((c.launch.edge_x_m, c.launch.spin_ratio), (Some(0.0), Some(0.0)));
}

#[test]
fn what_is_left_out_or_null_has_its_default() {
    let least = parse(&json!({"schema": "track.calib/1", "scale": {"gravity": true}}));
    assert_eq!(least, Calibration::new(Scale::Gravity));
    assert_eq!((least.gravity_m_s2, least.ball.inertia_factor), (9.81, 0.4));
    assert_eq!(
        (least.launch.edge_x_m, least.launch.spin_ratio),
        (None, Some(0.0))
    );
    let nulls = json!({
        "schema": "track.calib/1", "scale": {"gravity": true, "ball": null}, "view": null, "image_size_px": null,
        "origin_px": null, "up_px": null, "lens": null, "frame_rate_hz": null, "gravity_m_s2": null, "ball": null,
        "launch": null, "up_std_deg": null, "origin_std_px": null, "gravity_std_m_s2": null,
        "distance_m": null, "distance_std_m": null, "floor": null
    });
    assert_eq!(parse(&nulls), least);
    let nulls = json!({
        "schema": "track.calib/1", "scale": {"gravity": true}, "launch": {"track_width_m": null},
        "floor": {"slope_deg": null, "std_deg": null, "line_px": null, "line_std_px": null}
    });
    assert_eq!(parse(&nulls), least);
}

/// What a file does not say is left to the fall, or has the uncertainty of what people do not say.
#[test]
fn up_and_gravity_are_given_only_where_the_file_says_so() {
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
    let least = parse(&json!({"schema": "track.calib/1", "scale": {"gravity": true}}));
    assert!(!least.up_given && !least.gravity_given);
    near(least.upright_std_rad(), 5_f64.to_radians());
    near(least.gravity_uncertainty_m_s2(), 0.003 * 9.81);
    // The defaults, written out, are statements.
    let said = parse(&json!({
        "schema": "track.calib/1", "scale": {"gravity": true}, "up_px": [0, -1], "gravity_m_s2": 9.81
    }));
    assert!(said.up_given && said.gravity_given);
    near(said.upright_std_rad(), 0.3_f64.to_radians());
    near(said.gravity_uncertainty_m_s2(), 1e-4 * 9.81);
    let sure = parse(&json!({
        "schema": "track.calib/1", "scale": {"gravity": true}, "up_std_deg": 0.1, "gravity_std_m_s2": 0.005
    }));
    near(sure.upright_std_rad(), 0.1_f64.to_radians());
    near(sure.gravity_uncertainty_m_s2(), 0.005);
    // A homography has its own up, and is no less sure of it than a person.
    for c in [
        parse(&homography()),
        parse(&set(homography(), "up_px", json!([0, -1]))),
    ] {
        assert!(!c.up_given);
        near(c.upright_std_rad(), 0.3_f64.to_radians());
    }
    for c in [&least, &said, &sure] {
        let written = c.to_json();
        assert_eq!(written.get("up_px").is_some(), c.up_given, "{written}");
        assert_eq!(
            written.get("gravity_m_s2").is_some(),
            c.gravity_given,
            "{written}"
        );
        assert_eq!(parse(&written), *c);
    }
    let hint = refused(&set(contract(), "up_px", json!([0, 0])), "up_px").hint;
    assert!(hint.contains("leave it out: the fall tells"), "{hint}");
}

/// The contract's file with a rolling ball on a track of that width.
fn rolling(track_width_m: Value) -> Value {
    set(
        contract(),
        "launch",
        json!({"spin_ratio": "rolling", "track_width_m": track_width_m}),
    )
}

#[test]
fn a_ball_may_roll_off_a_bench_or_a_track() {
    let bench = parse(&rolling(Value::Null)).launch;
    assert_eq!(
        bench,
        Launch {
            edge_x_m: Some(0.0),
            spin_ratio: Some(1.0),
            rolling: true,
            track_width_m: None
        }
    );
    // R = 12.5 mm on edges 15 mm apart: the axis is 10 mm above them.
    let track = parse(&rolling(json!(0.015))).launch;
    assert_eq!((track.rolling, track.track_width_m), (true, Some(0.015)));
    assert!((track.spin_ratio.unwrap() - 1.25).abs() < 1e-12);
    for file in [rolling(Value::Null), rolling(json!(0.015))] {
        let c = parse(&file);
        let written = c.to_json();
        assert_eq!(written["launch"]["spin_ratio"], "rolling");
        assert_eq!(
            written["launch"]
                .get("track_width_m")
                .cloned()
                .unwrap_or(Value::Null),
            file["launch"]["track_width_m"]
        );
        assert_eq!(parse(&written), c);
    }
    // One that rolls is not one that is said to turn as fast.
    let number = parse(&set(contract(), "launch.spin_ratio", json!(1)));
    assert!(!number.launch.rolling);
    assert_eq!(number.to_json()["launch"]["spin_ratio"], 1.0);
}

#[test]
fn tracks_that_carry_no_ball() {
    for wide in [0.025, 0.03, 25.0] {
        let p = refused(&rolling(json!(wide)), "launch.track_width_m");
        assert!(p.found.contains("falls"), "{p}");
    }
    refused(&rolling(json!(0)), "launch.track_width_m");
    refused(&rolling(json!("15 mm")), "launch.track_width_m");
    for spin in [json!(1), json!(0), Value::Null] {
        let p = refused(
            &set(rolling(json!(0.015)), "launch.spin_ratio", spin),
            "launch.track_width_m",
        );
        assert!(p.hint.contains("\"rolling\""), "{p}");
    }
    let p = refused(
        &set(rolling(json!(0.015)), "launch.spin_ratio", json!("Rolling")),
        "launch.spin_ratio",
    );
    assert!(p.accepted.contains("\"rolling\" or null"), "{p}");
    let p = refused(
        &set(contract(), "launch.spin_ratio", json!("0.5")),
        "launch.spin_ratio",
    );
    assert!(p.hint.contains("without quotes"), "{p}");
    // How fast it turns on a track depends on its radius; on a bench it does not.
    let p = refused(&without(rolling(json!(0.015)), "ball"), "ball.radius_m");
    assert!(p.found.contains("track_width_m"), "{p}");
    parse(&without(rolling(Value::Null), "ball"));
    refused(
        &set(rolling(json!(0.015)), "ball.radius_m", json!(-1)),
        "ball.radius_m",
    );
}

#[test]
fn what_is_said_of_the_floor_comes_back() {
    let degree = 1_f64.to_radians();
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
    let with = |floor: Value| set(contract(), "floor", floor);
    let line = json!([[100, 650], [1200, 640.5]]);
    // What is given, slope and its uncertainty in degrees, the line's in px.
    let cases = [
        (json!({}), false, 0.0, 0.1, None),
        (json!({"slope_deg": 1.5}), true, 1.5, 0.1, None),
        (json!({"slope_deg": 0}), true, 0.0, 0.1, None),
        (json!({"std_deg": 2}), true, 0.0, 2.0, None),
        (
            json!({"slope_deg": -0.5, "std_deg": 0.02}),
            true,
            -0.5,
            0.02,
            None,
        ),
        (json!({"line_px": line}), false, 0.0, 0.1, Some(1.0)),
        (
            json!({"line_px": line, "line_std_px": 0.3}),
            false,
            0.0,
            0.1,
            Some(0.3),
        ),
        (
            json!({"slope_deg": 1, "std_deg": 1, "line_px": line, "line_std_px": 2}),
            true,
            1.0,
            1.0,
            Some(2.0),
        ),
    ];
    for (floor, given, slope_deg, std_deg, line_std_px) in cases {
        let c = parse(&with(floor.clone()));
        assert_eq!(c.floor.given, given, "{floor}");
        near(c.floor.slope_rad, slope_deg * degree);
        near(c.floor.std_rad, std_deg * degree);
        assert_eq!(c.floor.line.map(|l| l.std_px), line_std_px, "{floor}");
        if let Some(line) = c.floor.line {
            assert!((line.length_px() - 1100_f64.hypot(9.5)).abs() < 1e-9);
            assert_eq!(
                (line.from, line.to),
                (PixelPoint::new(100.0, 650.0), PixelPoint::new(1200.0, 640.5))
            );
        }
        let written = c.to_json();
        assert_eq!(
            written.get("floor").is_some(),
            given || line_std_px.is_some(),
            "{written}"
        );
        assert!(alike(&parse(&written).to_json(), &written), "{written}");
    }
    assert_eq!(parse(&contract()).floor, Floor::default());
}

#[test]
fn a_line_along_the_floor_rises_to_the_right() {
    let mut c = Calibration::new(Scale::Gravity);
    let (left, right) = (PixelPoint::new(100.0, 500.0), PixelPoint::new(500.0, 490.0));
    for (from, to) in [(left, right), (right, left)] {
        let line = FloorLine {
            from,
            to,
            std_px: 0.5,
        };
        let rise = line.rise_rad(&c.rectification().unwrap()).unwrap();
        assert!((rise.tan() - 10.0 / 400.0).abs() < 1e-12, "{rise}");
        assert!((line.std_rad() - 0.5 * 2_f64.sqrt() / 400_f64.hypot(10.0)).abs() < 1e-12);
    }
    // On its side, the picture's down is to the right.
    c.up_px = [1.0, 0.0];
    let line = FloorLine {
        from: PixelPoint::new(50.0, 100.0),
        to: PixelPoint::new(60.0, 500.0),
        std_px: 1.0,
    };
    let rise = line.rise_rad(&c.rectification().unwrap()).unwrap();
    assert!((rise.tan() - 10.0 / 400.0).abs() < 1e-12, "{rise}");
}

#[test]
fn floors_that_are_refused() {
    let line = json!([[100, 650], [1200, 640]]);
    let bad = [
        ("slope_deg", json!("1")),
        ("slope_deg", json!(50)),
        ("slope_deg", json!(true)),
        ("std_deg", json!(0)),
        ("std_deg", json!(-0.1)),
        ("std_deg", json!([0.1])),
        ("line_px", json!([100, 650, 1200, 640])),
        ("line_px", json!([[100, 650]])),
        ("line_px", json!([[100, 650], [1200, 640], [3, 4]])),
        ("line_px", json!([[100, 650], [1200, "640"]])),
        ("line_px", json!([[100, 650], [1200, 1e300]])),
        ("line_px", json!("level")),
        ("line_px", json!([[100, 650], [100, 650]])),
        ("line_px", json!([[100, 650], [109, 650]])),
        ("line_px", json!([[100, 650], [1300, 640]])),
        ("line_px", json!([[650, 1200], [640, 100]])),
        ("line_std_px", json!(0)),
        ("line_std_px", json!("1")),
        ("line_std_px", json!(2000)),
    ];
    for (key, value) in bad {
        let mut floor = json!({"line_px": line});
        floor[key] = value;
        let file = set(contract(), "floor", floor);
        refused(&file, &format!("floor.{key}"));
    }
    let with = |floor: Value| set(contract(), "floor", floor);
    let p = refused(
        &with(json!({"line_px": [[100, 650], [109, 650]]})),
        "floor.line_px",
    );
    assert!(p.found.contains("9.0 px") && p.accepted.contains("10 px"), "{p}");
    let p = refused(
        &with(json!({"line_px": [[100, 650], [1300, 640]]})),
        "floor.line_px",
    );
    assert!(p.found.contains("[1300, 640], outside the picture"), "{p}");
    let p = refused(&with(json!({"line_std_px": 1})), "floor.line_std_px");
    assert!(p.found.contains("no line_px"), "{p}");
    // Beyond the fold of a lens, and beyond a plane's horizon.
    let folding = set(contract(), "lens.distortion", json!([-3.0, 0, 0, 0, 0]));
    let file = set(
        without(without(folding, "image_size_px"), "origin_px"),
        "floor",
        json!({"line_px": [[640, 360], [5000, 360]]}),
    );
    refused(&file, "floor.line_px");
    let file = set(
        homography(),
        "floor",
        json!({"line_px": [[640, 360], [-30000, 360]]}),
    );
    let p = refused(&file, "floor.line_px");
    assert!(p.found.contains("horizon"), "{p}");
}

#[test]
fn the_two_nulls_that_mean_unknown() {
    let c = parse(&set(
        set(contract(), "launch.spin_ratio", Value::Null),
        "launch.edge_x_m",
        Value::Null,
    ));
    assert_eq!((c.launch.edge_x_m, c.launch.spin_ratio), (None, None));
}

#[test]
fn the_launch_edge_needs_an_origin() {
    let c = parse(&without(contract(), "origin_px"));
    assert_eq!(c.launch.edge_x_m, None);
    let file = set(without(contract(), "origin_px"), "launch.edge_x_m", json!(0.1));
    refused(&file, "launch.edge_x_m");
    let built = Calibration::new(Scale::Gravity).with_origin(PixelPoint::new(1.0, 2.0));
    assert_eq!(
        parse(&json!({"schema": "track.calib/1", "scale": {"gravity": true}, "origin_px": [1, 2]})),
        built
    );
    assert_eq!(parse(&homography()).launch.edge_x_m, Some(0.0));
    assert!(parse(&homography()).has_origin());
}

#[test]
fn up_becomes_a_unit_vector() {
    let c = parse(&set(contract(), "up_px", json!([3, -4])));
    assert!((c.up_px[0] - 0.6).abs() < 1e-15 && (c.up_px[1] + 0.8).abs() < 1e-15);
    let c = parse(&set(contract(), "up_std_deg", json!(0.5)));
    assert!((c.up_std_rad.unwrap() - 0.5_f64.to_radians()).abs() < 1e-15);
}

#[test]
fn top_level_values_that_are_refused() {
    let bad = [
        ("view", json!("front")),
        ("view", json!(1)),
        ("image_size_px", json!([1280.5, 720])),
        ("image_size_px", json!([1280])),
        ("image_size_px", json!([1280, 720, 3])),
        ("image_size_px", json!([0, 720])),
        ("image_size_px", json!([-1280, 720])),
        ("image_size_px", json!(["1280", "720"])),
        ("image_size_px", json!("1280x720")),
        ("origin_px", json!([1])),
        ("origin_px", json!([1, "2"])),
        ("origin_px", json!([1, null])),
        ("origin_px", json!({"u": 1, "v": 2})),
        ("origin_std_px", json!(0)),
        ("up_px", json!([0, 0])),
        ("up_px", json!([0, 0, 1])),
        ("up_std_deg", json!(90)),
        ("up_std_deg", json!(-1)),
        ("distance_m", json!(0)),
        ("distance_m", json!(-2)),
        ("distance_m", json!("2 m")),
        ("distance_m", json!(0.025)),
        ("frame_rate_hz", json!(0)),
        ("frame_rate_hz", json!(-240)),
        ("frame_rate_hz", json!("240")),
        ("frame_rate_hz", json!(1e300)),
        ("gravity_m_s2", json!(-9.81)),
        ("gravity_m_s2", json!(true)),
        ("gravity_std_m_s2", json!(10)),
        ("scale", json!(0.0008)),
        ("ball", json!(0.0125)),
        ("launch", json!([])),
        ("floor", json!(0.1)),
        ("floor", json!([[1, 2], [3, 4]])),
        ("lens", json!("wide")),
    ];
    for (key, value) in bad {
        refused(&set(contract(), key, value), key);
    }
}

#[test]
fn the_cameras_distance_and_its_uncertainty() {
    let far = set(contract(), "distance_m", json!(2.5));
    let c = parse(&set(far.clone(), "distance_std_m", json!(0.01)));
    assert_eq!((c.distance_m, c.distance_std_m), (Some(2.5), Some(0.01)));
    assert_eq!(parse(&far).distance_std_m, None);
    assert_eq!(parse(&contract()).distance_m, None);
    refused(&set(far.clone(), "distance_std_m", json!(3)), "distance_std_m");
    refused(&set(far, "distance_std_m", json!(0)), "distance_std_m");
    let alone = refused(&set(contract(), "distance_std_m", json!(0.01)), "distance_std_m");
    assert!(alone.found.contains("no distance_m"), "{alone}");
    let mut homography = set(homography(), "image_size_px", json!([1280, 720]));
    homography = set(homography, "distance_m", json!(2.0));
    assert!(Calibration::parse(&homography.to_string(), "lab.json").is_ok());
    refused(&set(homography, "distance_m", json!(1000.0)), "distance_m");
}

#[test]
fn nested_values_that_are_refused() {
    let bad = [
        ("scale.metres_per_pixel", json!(0)),
        ("scale.metres_per_pixel", json!(-0.0008)),
        ("scale.metres_per_pixel", json!("0.0008")),
        ("scale.metres_per_pixel", json!([0.0008])),
        ("scale.std_uncertainty", json!(0)),
        ("scale.std_uncertainty", json!(0.1)),
        ("ball.radius_m", json!(0)),
        ("ball.radius_m", json!(-0.01)),
        ("ball.radius_m", json!("12.5 mm")),
        ("ball.radius_std_m", json!(0.1)),
        ("ball.mass_kg", json!(0)),
        ("ball.inertia_factor", json!(0)),
        ("ball.inertia_factor", json!(0.7)),
        ("ball.inertia_factor", json!(-0.4)),
        ("launch.edge_x_m", json!("edge")),
        ("launch.spin_ratio", json!("roling")),
        ("launch.spin_ratio", json!("0.5")),
        ("launch.spin_ratio", json!([1])),
        ("launch.track_width_m", json!(0.01)),
        ("lens.distortion", json!([0.1, 0.2, 0.0, 0.0])),
        ("lens.distortion", json!([0.1, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])),
        ("lens.distortion", json!([0.1, "0.2", 0.0, 0.0, 0.0])),
        ("lens.distortion", Value::Null),
        ("lens.camera_matrix", Value::Null),
        ("lens.camera_matrix", json!([[1, 0, 0], [0, 1, 0]])),
        ("lens.camera_matrix", json!([1450, 1450, 640, 360])),
    ];
    for (key, value) in bad {
        refused(&set(contract(), key, value), key);
    }
    for (element, value) in [
        ("0.0", json!(0)),
        ("1.1", json!(-1450)),
        ("0.1", json!(2)),
        ("2.2", json!(0)),
    ] {
        refused(
            &set(contract(), &format!("lens.camera_matrix.{element}"), value),
            "lens.camera_matrix",
        );
    }
    let p = refused(
        &set(contract(), "ball.radius_m", json!("0.0125")),
        "ball.radius_m",
    );
    assert_eq!(
        (p.found.as_str(), p.hint.as_str()),
        ("\"0.0125\"", "write the number without quotes")
    );
}

#[test]
fn a_thin_shell_may_be_written_rounded() {
    for factor in [2.0 / 3.0, 0.6667, 0.667] {
        let c = parse(&set(contract(), "ball.inertia_factor", json!(factor)));
        assert!(c.ball.inertia_factor <= 2.0 / 3.0);
    }
}

#[test]
fn schemas_that_are_not_this_one() {
    refused(&without(contract(), "schema"), "schema");
    refused(&set(contract(), "schema", Value::Null), "schema");
    refused(&set(contract(), "schema", json!(1)), "schema");
    let newer = refused(&set(contract(), "schema", json!("track.calib/2")), "schema");
    assert!(newer.hint.contains("version"), "{newer}");
    let scene = refused(&set(contract(), "schema", json!("track.scene/1")), "schema");
    assert!(scene.hint.contains("another"), "{scene}");
}

#[test]
fn a_file_needs_exactly_one_scale() {
    refused(&without(contract(), "scale"), "scale");
    refused(&set(contract(), "scale", Value::Null), "scale");
    refused(&with_scale(json!({})), "scale");
    let two = refused(
        &with_scale(json!({"metres_per_pixel": 0.0008, "ball": true})),
        "scale",
    );
    assert!(two.found.contains("metres_per_pixel and ball"), "{two}");
    refused(
        &with_scale(json!({"metres_per_pixel": 0.0008, "length_m": 1})),
        "scale",
    );
    refused(&with_scale(json!({"gravity": true, "ball": false})), "scale");
    refused(&with_scale(json!({"ball": false})), "scale.ball");
    refused(&with_scale(json!({"ball": 0.0125})), "scale.ball");
    refused(&with_scale(json!({"gravity": 9.81})), "scale.gravity");
    let stray = refused(
        &with_scale(json!({"gravity": true, "std_uncertainty": 0.1})),
        "scale.std_uncertainty",
    );
    assert!(stray.found.contains("another scale"), "{stray}");
}

#[test]
fn the_ball_as_scale_needs_its_radius() {
    let bare = json!({"schema": "track.calib/1", "scale": {"ball": true}});
    refused(&bare, "ball.radius_m");
    refused(
        &set(bare.clone(), "ball", json!({"mass_kg": 0.01})),
        "ball.radius_m",
    );
    // A radius that is wrong is one problem, not two.
    refused(&set(bare, "ball", json!({"radius_m": -1})), "ball.radius_m");
}

#[test]
fn rulers_that_measure_nothing() {
    let ruler = |from: Value, to: Value, length: Value| {
        with_scale(json!({"from_px": from, "to_px": to, "length_m": length}))
    };
    parse(&ruler(json!([1, 2]), json!([3, 4]), json!(0.1)));
    refused(&ruler(json!([1, 2]), json!([1, 2]), json!(0.1)), "scale.to_px");
    refused(&ruler(json!([1, 2]), json!([3, 4]), json!(0)), "scale.length_m");
    refused(
        &ruler(json!([1, 2]), json!([3, 4]), Value::Null),
        "scale.length_m",
    );
    refused(&ruler(json!([1, 2]), Value::Null, json!(0.1)), "scale.to_px");
    refused(
        &ruler(json!([1, 2, 3]), json!([3, 4]), json!(0.1)),
        "scale.from_px",
    );
    let outside = set(
        ruler(json!([1, 2]), json!([700, 1200]), json!(0.1)),
        "image_size_px",
        json!([1280, 720]),
    );
    let p = refused(&outside, "scale.to_px");
    assert!(p.found.contains("outside the picture"), "{p}");
}

#[test]
fn homographies_that_map_nothing() {
    let h = |rows: Value| with_scale(json!({"world_from_pixel": rows}));
    for rows in [
        json!([[1, 0, 0], [0, 1, 0], [0, 0, 0]]),
        json!([[1, 2, 3], [2, 4, 6], [0, 0, 1]]),
        json!([[0, 0, 0], [0, 0, 0], [0, 0, 0]]),
        json!([[1, 0, 0], [0, 1, 0]]),
        json!([[1, 0, 0], [0, 1], [0, 0, 1]]),
        json!([[1, 0, 0], [0, "1", 0], [0, 0, 1]]),
        json!([1, 0, 0, 0, 1, 0, 0, 0, 1]),
        json!("identity"),
    ] {
        refused(&h(rows), "scale.world_from_pixel");
    }
}

#[test]
fn origin_and_up_have_no_place_beside_a_homography() {
    refused(&set(homography(), "origin_px", json!([1, 2])), "origin_px");
    refused(&set(homography(), "up_px", json!([1, 0])), "up_px");
    parse(&set(homography(), "up_px", json!([0, -2])));
}

#[test]
fn a_homography_may_say_that_its_origin_is_not_the_worlds() {
    assert!(parse(&homography()).has_origin());
    let marked = parse(&set(homography(), "origin_std_px", json!(0.7)));
    assert_eq!(marked.origin_std_px, Some(0.7));
    let unknown = set(homography(), "scale.origin_unknown", json!(true));
    let c = parse(&unknown);
    assert!(!c.has_origin());
    assert_eq!(c.launch.edge_x_m, None);
    assert_eq!(Calibration::parse(&c.to_json().to_string(), "again").unwrap(), c);
    refused(
        &set(homography(), "scale.origin_unknown", json!(1)),
        "scale.origin_unknown",
    );
    refused(&set(unknown, "origin_std_px", json!(0.7)), "origin_std_px");
}

#[test]
fn deviations_come_back_and_belong_to_lens_and_homography() {
    let lens = json!({
        "camera_matrix": [[900, 0, 640], [0, 900, 360], [0, 0, 1]], "distortion": [-0.1, 0, 0, 0, 0],
        "camera_std_px": [1, 1.1, 0.5, 0.4], "distortion_std": [0.001, 0.002, null, null, null]
    });
    let one = json!({"lens": [1, 1, 0, 0, 0.001, 0, 0, 0, 0], "world_from_pixel": [[1e-6, 0, 0], [0, 1e-6, 0], [0, 0, 0]]});
    let file = set(set(homography(), "lens", lens), "deviations", json!([one, one]));
    let c = parse(&file);
    assert_eq!(c.deviations.len(), 2);
    assert_eq!(c.lens_std[5], Some(0.002));
    assert_eq!(c.lens_std[6], None);
    assert_eq!(Calibration::parse(&c.to_json().to_string(), "again").unwrap(), c);
    let off = &c.deviated()[0];
    assert_eq!(off.lens.as_ref().unwrap().camera_matrix()[(0, 0)], 901.0);
    let single = set(file.clone(), "deviations", json!([one]));
    refused(&without(single, "lens"), "deviations[0].lens");
    refused(
        &set(file.clone(), "deviations", json!([{"lens": [1, 2]}])),
        "deviations[0].lens",
    );
    refused(
        &set(file.clone(), "deviations", json!([{"lense": []}])),
        "deviations[0].lense",
    );
    refused(&set(file.clone(), "deviations", json!(3)), "deviations");
    refused(
        &set(file.clone(), "lens.camera_std_px", json!([1, 1, 1])),
        "lens.camera_std_px",
    );
    refused(
        &set(file, "lens.distortion_std", json!([0, 1, 1, 1, 1])),
        "lens.distortion_std",
    );
}

#[test]
fn points_beyond_the_lens_are_refused() {
    let strong = |key: &str, value: Value| {
        let file = set(contract(), "lens.distortion", json!([-3.0, 0, 0, 0, 0]));
        set(without(file, "image_size_px"), key, value)
    };
    refused(&strong("origin_px", json!([5000, 360])), "origin_px");
    let ruler = json!({"from_px": [640, 360], "to_px": [5000, 360], "length_m": 1});
    refused(
        &set(strong("scale", ruler), "origin_px", Value::Null),
        "scale.to_px",
    );
}

#[test]
fn unknown_keys_name_the_nearest_known_one() {
    let hint = |file: Value, key: &str| refused(&file, key).hint;
    let cases = [
        ("framerate_hz", "frame_rate_hz"),
        ("fps", "frame_rate_hz"),
        ("origin", "origin_px"),
        ("Up_px", "up_px"),
        ("gravity", "scale.gravity"),
        ("radius_m", "ball.radius_m"),
        ("ball_radius_m", "ball.radius_m"),
        ("metres_per_pixel", "scale.metres_per_pixel"),
        ("camera_matrix", "lens.camera_matrix"),
        ("diameter_m", "half the diameter"),
        ("flor", "floor"),
        ("Floor", "floor"),
        ("lanch", "launch"),
        ("launches", "launch"),
        ("slope_deg", "floor.slope_deg"),
        ("floor_slope_deg", "floor.slope_deg"),
        ("floor_line_px", "floor.line_px"),
        ("line_px", "floor.line_px"),
        ("track_width_m", "launch.track_width_m"),
        ("spin_ratio", "launch.spin_ratio"),
    ];
    for (key, meant) in cases {
        let mut file = contract();
        file[key] = json!(1);
        assert!(hint(file, key).contains(meant), "{key}");
    }
    let mut file = contract();
    file["ball"]["radius"] = json!(1);
    assert_eq!(hint(file, "ball.radius"), "did you mean ball.radius_m?");
    for (key, meant) in [
        ("slope", "slope_deg"),
        ("slope_rad", "slope_deg"),
        ("line", "line_px"),
        ("std", "std_deg"),
        ("line_std", "line_std_px"),
    ] {
        let mut file = contract();
        file["floor"] = json!({key: 1});
        let p = refused(&file, &format!("floor.{key}"));
        assert_eq!(p.hint, format!("did you mean floor.{meant}?"));
        assert!(
            p.accepted
                .contains("in floor: slope_deg, std_deg, line_px, line_std_px"),
            "{p}"
        );
    }
    let mut file = contract();
    file["launch"]["track_width"] = json!(0.01);
    assert_eq!(
        hint(file, "launch.track_width"),
        "did you mean launch.track_width_m?"
    );
    let mut file = contract();
    file["lens"]["distorsion"] = json!(1);
    assert_eq!(hint(file, "lens.distorsion"), "did you mean lens.distortion?");
    let mut file = contract();
    file["scale"]["meters_per_pixel"] = json!(1);
    assert_eq!(
        hint(file, "scale.meters_per_pixel"),
        "did you mean scale.metres_per_pixel?"
    );
    let mut file = contract();
    file["zzz"] = json!(1);
    let p = refused(&file, "zzz");
    assert!(
        p.hint.contains("remove") && p.accepted.contains("frame_rate_hz"),
        "{p}"
    );
}

#[test]
fn all_problems_are_told_at_once() {
    let file = json!({
        "schema": "track.calib/1", "view": "up", "frame_rate": 240, "scale": {"metres_per_pixel": -1},
        "ball": {"radius_m": "a", "inertia_factor": 3}, "up_px": [0, 0]
    });
    let keys: Vec<String> = problems(&file).into_iter().map(|p| p.key).collect();
    for key in [
        "frame_rate",
        "view",
        "scale.metres_per_pixel",
        "ball.radius_m",
        "ball.inertia_factor",
        "up_px",
    ] {
        assert!(keys.iter().any(|k| k == key), "{key} in {keys:?}");
    }
    assert!(error(&file.to_string()).to_string().contains("6 problems"));
}

#[test]
fn text_that_is_not_json_says_where_and_why() {
    let said = |text: &str, words: &[&str]| {
        let message = error(text).to_string();
        assert!(message.starts_with("lab.json: "), "{message}");
        for word in words {
            assert!(message.contains(word), "{word} in: {message}");
        }
    };
    said("", &["empty file"]);
    said(" \n\t", &["empty file"]);
    said("\u{feff}", &["empty file"]);
    said("[]", &["not an object"]);
    said("3", &["not an object"]);
    said(
        "{\n\"frame_rate_hz\": NaN}",
        &["line 2", "neither NaN nor Infinity"],
    );
    said("{\"frame_rate_hz\": -Infinity}", &["neither NaN nor Infinity"]);
    said("{\"frame_rate_hz\": 1e999}", &["out of range", "exponent"]);
    said("{\"view\": \"side\",}", &["line 1", "comma"]);
    said("{\"view\": \"side\" // from the side\n}", &["comments"]);
    said("{\"view\": \"side\"", &["bracket"]);
    said(
        "{\"ball\": {\"radius_m\": 1, \"radius_m\": 2}}",
        &["radius_m", "twice"],
    );
    said(&"[".repeat(100_000), &["recursion"]);
}

#[test]
fn a_byte_order_mark_is_no_trouble() {
    Calibration::parse(&format!("\u{feff}{}", contract()), "lab.json").unwrap();
}

#[test]
fn files_that_cannot_be_read() {
    let folder = tempfile::tempdir().unwrap();
    let message = |name: &str, bytes: Option<&[u8]>| {
        let path = folder.path().join(name);
        if let Some(bytes) = bytes {
            std::fs::write(&path, bytes).unwrap();
        }
        let message = Calibration::read(&path).unwrap_err().to_string();
        assert!(message.contains(name), "{message}");
        message
    };
    assert!(message("missing.json", None).contains("check the path"));
    std::fs::create_dir(folder.path().join("folder.json")).unwrap();
    assert!(message("folder.json", None).contains("in that folder"));
    assert!(message("empty.json", Some(b"")).contains("empty"));
    assert!(message("latin1.json", Some(b"{\"view\": \"\xe9\"}")).contains("UTF-8 text, from byte 10"));
    assert!(message("utf16.json", Some(b"\xff\xfe{\0}\0")).contains("UTF-16"));
    assert!(message("huge.json", Some(&vec![b' '; 1_000_001])).contains("above 1 MB"));
    assert!(message("bad.json", Some(b"{\"schema\": \"track.calib/1\"}")).contains("scale: found nothing"));
}

#[test]
fn another_picture_size_names_both_and_what_may_have_happened() {
    let c = parse(&contract());
    c.check_image_size(1280, 720).unwrap();
    let said = |width, height| c.check_image_size(width, height).unwrap_err().to_string();
    let swapped = said(720, 1280);
    assert!(swapped.contains("1280x720") && swapped.contains("720x1280") && swapped.contains("rotation tag"));
    let scaled = said(640, 360);
    assert!(
        scaled.contains("scaled by 0.5") && scaled.contains("times 2.0"),
        "{scaled}"
    );
    assert!(said(1280, 700).contains("crop"));
    parse(&without(contract(), "image_size_px"))
        .check_image_size(3, 4)
        .unwrap();
}

/// JSON numbers may change in the last digit on their way through text.
fn alike(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Number(_), Value::Number(_)) => {
            let (a, b) = (a.as_f64().unwrap(), b.as_f64().unwrap());
            (a - b).abs() <= 1e-14 * a.abs().max(b.abs())
        }
        (Value::Array(a), Value::Array(b)) => a.len() == b.len() && a.iter().zip(b).all(|(a, b)| alike(a, b)),
        (Value::Object(a), Value::Object(b)) => {
            a.len() == b.len() && a.iter().all(|(key, a)| b.get(key).is_some_and(|b| alike(a, b)))
        }
        _ => a == b,
    }
}

#[test]
fn samples_survive_writing_and_reading() {
    for path in samples() {
        let c = Calibration::read(&path).unwrap();
        let written = c.to_json();
        assert!(alike(&parse(&written).to_json(), &written), "{}", path.display());
    }
}

fn maybe<T: std::fmt::Debug + Clone + 'static>(
    value: impl Strategy<Value = T> + 'static,
) -> impl Strategy<Value = Option<T>> {
    proptest::option::of(value)
}

fn any_ruler() -> impl Strategy<Value = Value> {
    let point = || (0.0..1279.0, 0.0..719.0);
    (
        point(),
        point(),
        0.01..10.0_f64,
        maybe(1e-4..1e-3),
        maybe(0.1..3.0),
    )
        .prop_map(|(from, to, length, s, p)| {
            // Two points that happen to coincide are no ruler.
            let to = if f64::abs(from.0 - to.0) > 2.0 {
                to
            } else {
                ((from.0 + 600.0) % 1279.0, to.1)
            };
            json!({"from_px": from, "to_px": to, "length_m": length, "length_std_m": s, "point_std_px": p})
        })
}

fn any_scale() -> impl Strategy<Value = Value> {
    prop_oneof![
        (1e-6..1.0_f64, maybe(1e-4..0.1)).prop_map(|(m, relative)| {
            json!({"metres_per_pixel": m, "std_uncertainty": relative.map(|r| r * m)})
        }),
        any_ruler(),
        Just(json!({"ball": true})),
        Just(json!({"gravity": true})),
        (-1e-4..1e-4, -1e-4..1e-4, maybe(1e-4..0.1)).prop_map(|(p, q, s)| {
            json!({"world_from_pixel": [[8e-4, 1e-5, -0.1], [2e-5, -8e-4, 0.5], [p, q, 1.0]], "relative_std": s})
        }),
    ]
}

/// "spin_ratio" and "track_width_m".
fn any_spin() -> impl Strategy<Value = (Value, Value)> {
    prop_oneof![
        maybe(-2.0..2.0).prop_map(|spin| (json!(spin), Value::Null)),
        maybe(1e-4..0.024).prop_map(|track| (json!("rolling"), json!(track))),
    ]
}

prop_compose! {
    fn any_floor()(
        slope in maybe(-40.0..40.0), std in maybe(0.01..10.0), line in maybe((0.0..500.0, 0.0..719.0, 600.0..1279.0, 0.0..719.0)),
        line_std in maybe(0.1..5.0),
    ) -> Value {
        let ends = line.map(|(a, b, c, d)| json!([[a, b], [c, d]]));
        json!({"slope_deg": slope, "std_deg": std, "line_std_px": line_std.filter(|_| ends.is_some()), "line_px": ends})
    }
}

prop_compose! {
    fn any_file()(
        scale in any_scale(), top: bool, size: bool, origin in maybe((0.0..1279.0, 0.0..719.0)), angle in -3.2..3.2_f64,
        stds in (maybe(0.1..5.0), maybe(0.01..5.0), maybe(1e-3..0.1), maybe(1e-5..1e-3)), lens: bool,
        rate in maybe(1.0..1e4), gravity in 9.0..10.0, mass in maybe(1e-3..1.0), inertia in 0.1..0.66,
        edge in maybe(-1.0..1.0), spin in any_spin(), given: (bool, bool), floor in maybe(any_floor()), distance in maybe(0.5..1.0), doubt in maybe(1e-3..0.1),
    ) -> Value {
        let mut file = contract();
        let homography = scale.get("world_from_pixel").is_some();
        file["scale"] = scale;
        file["view"] = json!(if top { "top" } else { "side" });
        file["origin_px"] = if homography { Value::Null } else { json!(origin) };
        file["origin_std_px"] = if file["origin_px"].is_null() { Value::Null } else { json!(stds.0) };
        file["up_px"] = if homography || !given.0 { Value::Null } else { json!([angle.sin(), -angle.cos()]) };
        file["up_std_deg"] = json!(stds.1);
        // A homography's tilt leaves only some distances possible.
        file["distance_m"] = json!(distance.filter(|_| !homography));
        file["distance_std_m"] = if file["distance_m"].is_null() { Value::Null } else { json!(doubt) };
        file["gravity_m_s2"] = if given.1 { json!(gravity) } else { Value::Null };
        file["gravity_std_m_s2"] = json!(stds.2);
        file["frame_rate_hz"] = json!(rate);
        file["ball"] = json!({"radius_m": 0.0125, "radius_std_m": stds.3, "mass_kg": mass, "inertia_factor": inertia});
        let has_origin = homography || origin.is_some();
        let (spin, track) = spin;
        file["launch"] = json!({"edge_x_m": edge.filter(|_| has_origin), "spin_ratio": spin, "track_width_m": track});
        file["floor"] = json!(floor);
        if !size { file["image_size_px"] = Value::Null; }
        if !lens { file["lens"] = Value::Null; }
        file
    }
}

fn any_json() -> impl Strategy<Value = Value> {
    let leaf = prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        any::<f64>().prop_map(Value::from),
        any::<i64>().prop_map(Value::from),
        Just(json!(0)),
        "[a-z_\u{e9}\u{1F3C0}]{0,12}".prop_map(Value::from),
    ];
    leaf.prop_recursive(3, 24, 5, |inner| {
        prop_oneof![
            prop::collection::vec(inner.clone(), 0..5).prop_map(Value::from),
            prop::collection::vec((any_key(), inner), 0..5).prop_map(|entries| entries.into_iter().collect()),
        ]
    })
}

fn any_key() -> impl Strategy<Value = String> {
    let known = prop::sample::select(vec![
        "schema",
        "view",
        "image_size_px",
        "scale",
        "origin_px",
        "up_px",
        "lens",
        "ball",
        "launch",
        "floor",
        "spin_ratio",
        "track_width_m",
        "slope_deg",
        "line_px",
        "line_std_px",
        "metres_per_pixel",
        "from_px",
        "to_px",
        "length_m",
        "gravity",
        "world_from_pixel",
        "camera_matrix",
        "distortion",
        "radius_m",
    ]);
    prop_oneof![known.prop_map(str::to_owned), ".{0,20}"]
}

/// Every dotted path of a value, its own "" excluded.
fn paths(value: &Value, prefix: &str, found: &mut Vec<String>) {
    let mut visit = |key: String, value: &Value| {
        let path = if prefix.is_empty() {
            key
        } else {
            format!("{prefix}.{key}")
        };
        paths(value, &path, found);
        found.push(path);
    };
    match value {
        Value::Array(elements) => elements
            .iter()
            .enumerate()
            .for_each(|(i, v)| visit(i.to_string(), v)),
        Value::Object(entries) => entries.iter().for_each(|(key, v)| visit(key.clone(), v)),
        _ => {}
    }
}

/// Reads it, and if it is accepted, uses everything it offers: no panic, no number that is not one.
fn use_all(text: &str) -> Result<(), TestCaseError> {
    let c = match Calibration::parse(text, "lab.json") {
        Ok(c) => c,
        Err(error) => {
            prop_assert!(!error.to_string().is_empty());
            return Ok(());
        }
    };
    let r = c.rectification().unwrap();
    let scale = c.metres_per_unit(&EVIDENCE).unwrap();
    prop_assert!(scale.value.is_finite() && scale.value > 0.0);
    prop_assert!(scale.std_uncertainty.is_none_or(|s| s.is_finite() && s > 0.0));
    let viewpoint = c.viewpoint(scale.value, (1280, 720)).ok().flatten();
    for p in [(0.0, 0.0), (640.0, 360.0), (1279.0, 719.0), (-1e9, 1e9)] {
        let p = PixelPoint::new(p.0, p.1);
        if let Some(q) = r.plane_from_pixel(p) {
            prop_assert!(q.right.is_finite() && q.up.is_finite());
            let optics = viewpoint.map(|v| v.optics);
            let silhouettes = Silhouettes::new(&r, optics, PixelPoint::new(639.5, 359.5));
            let centre = silhouettes.centre_of_outline(p, 20.0);
            prop_assert!(centre.is_none_or(|c| c.right.is_finite() && c.up.is_finite()));
            let drawn = silhouettes.at(p);
            prop_assert!(
                drawn.is_none_or(|s| s.size > 0.0 && s.size.is_finite() && s.elongation().is_finite())
            );
            if let Some(back) = r.pixel_from_plane(q) {
                prop_assert!(back.u_px.is_finite() && back.v_px.is_finite());
            }
        }
        prop_assert!(r.jacobian(p).is_none_or(|j| j.iter().all(|d| d.is_finite())));
    }
    Ok(())
}

proptest! {
    #[test]
    fn any_valid_file_survives_writing_and_reading(file in any_file()) {
        let c = Calibration::parse(&file.to_string(), "lab.json").map_err(|e| TestCaseError::fail(e.to_string()))?;
        let written = c.to_json();
        let again = Calibration::parse(&written.to_string(), "lab.json")
            .map_err(|e| TestCaseError::fail(e.to_string()))?;
        prop_assert_eq!((again.up_given, again.gravity_given), (c.up_given, c.gravity_given));
        prop_assert_eq!((again.launch, again.floor.given, again.floor.line), (c.launch, c.floor.given, c.floor.line));
        prop_assert_eq!(c.up_given, !file["up_px"].is_null());
        prop_assert_eq!(c.gravity_given, !file["gravity_m_s2"].is_null());
        prop_assert!(alike(&again.to_json(), &written), "{written}\n{}", again.to_json());
        use_all(&file.to_string())?;
    }

    #[test]
    fn an_enlarged_picture_has_fewer_metres_a_pixel(ruler in any_ruler(), factor in 0.5..4.0) {
        let metres_per_pixel = |by: f64| {
            let mut ruler = ruler.clone();
            for end in ["from_px", "to_px"] {
                let enlarged = |axis: usize| ruler[end][axis].as_f64().unwrap() * by;
                ruler[end] = json!([enlarged(0), enlarged(1)]);
            }
            parse(&with_scale(ruler)).metres_per_unit(&ScaleEvidence::default()).unwrap().value
        };
        prop_assert!((metres_per_pixel(factor) * factor / metres_per_pixel(1.0) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn arbitrary_json_never_panics(value in any_json()) {
        use_all(&value.to_string())?;
    }

    #[test]
    fn arbitrary_text_never_panics(text in "\\PC*") {
        use_all(&text)?;
    }

    #[test]
    fn a_valid_file_with_one_value_replaced_never_panics(
        file in any_file(), place in any::<prop::sample::Index>(), value in any_json(),
    ) {
        let mut all = Vec::new();
        paths(&file, "", &mut all);
        use_all(&set(file, place.get::<String>(&all), value).to_string())?;
    }

    #[test]
    fn a_valid_file_with_damaged_text_never_panics(
        file in any_file(), place in any::<prop::sample::Index>(), insert in "[-0-9eE.,:\"\\[\\]{}a-z]{0,4}", cut in 0..6_usize,
    ) {
        let mut text: Vec<char> = file.to_string().chars().collect();
        let start = place.index(text.len());
        let end = (start + cut).min(text.len());
        text.splice(start..end, insert.chars());
        use_all(&text.into_iter().collect::<String>())?;
    }
}
