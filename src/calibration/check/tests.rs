use super::*;
use crate::calibration::Severity;
use serde_json::json;
use std::path::PathBuf;

fn recording() -> SourceInfo {
    SourceInfo {
        path: PathBuf::from("clip.mp4"),
        width_px: 1280,
        height_px: 720,
        nominal_rate_hz: Some(30.0),
        frames_expected: None,
        luma_range: crate::frames::LumaRange {
            black: 16,
            white: 235,
        },
        codec: "h264".into(),
        has_time_base: true,
        time_resolution_s: None,
        row_order: crate::frames::RowOrder::Down,
        pixel_aspect: 1.0,
        chroma_grid: None,
        luma_shares: (0.299, 0.114),
    }
}

fn findings(text: &str, recording: Option<&SourceInfo>) -> Vec<Finding> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.calib.json");
    std::fs::write(&path, text).unwrap();
    check(&path, recording).unwrap()
}

fn problems(text: &str, recording: Option<&SourceInfo>) -> Vec<String> {
    let found = findings(text, recording);
    let grave = found.iter().filter(|f| f.severity == Severity::Problem);
    grave.map(|f| format!("{}: {}", f.key, f.message)).collect()
}

fn sound() -> serde_json::Value {
    json!({
        "schema": "track.calib/1",
        "image_size_px": [1280, 720],
        "scale": {"from_px": [100, 600], "to_px": [1100, 600], "length_m": 0.8, "length_std_m": 0.0005, "point_std_px": 0.5},
        "origin_px": [120, 660], "origin_std_px": 0.5,
        "frame_rate_hz": 240,
        "ball": {"radius_m": 0.0125, "mass_kg": 0.0639}
    })
}

#[test]
fn a_sound_file_has_no_problem() {
    assert_eq!(problems(&sound().to_string(), None), [""; 0]);
    let found = findings(&sound().to_string(), Some(&recording()));
    assert!(found.iter().all(|f| f.severity == Severity::Remark), "{found:?}");
    assert!(found[0].message.contains("8.00 times"), "{found:?}");
}

#[test]
fn everything_wrong_is_told_at_once() {
    let mut c = sound();
    c["scale"]["length_m"] = json!("0.8");
    c["up_px"] = json!([0, 1]);
    c["ball"] = json!({"radius_m": 12.5, "mass_kg": 0.06});
    c["fps"] = json!(240);
    c["image_size_px"] = json!([720, 1280]);
    c["frame_rate_hz"] = json!(100);
    let found = problems(&c.to_string(), Some(&recording()));
    for key in ["fps", "scale.length_m"] {
        assert!(found.iter().any(|f| f.starts_with(key)), "{key} in {found:?}");
    }
    // Without a scale there is no calibration to judge further; with one there is.
    c["scale"] = json!({"metres_per_pixel": 0.0008});
    let found = problems(&c.to_string(), Some(&recording()));
    for words in [
        "fps",
        "up_px",
        "ball.radius_m",
        "image_size_px",
        "swapped",
        "frame_rate_hz",
        "3.333",
    ] {
        assert!(found.iter().any(|f| f.contains(words)), "{words} in {found:#?}");
    }
}

#[test]
fn units_give_themselves_away() {
    let told = |change: serde_json::Value, words: &str| {
        let mut c = sound();
        for (key, value) in change.as_object().unwrap() {
            c[key] = value.clone();
        }
        let found = problems(&c.to_string(), None);
        assert!(found.iter().any(|f| f.contains(words)), "{words} in {found:#?}");
    };
    told(
        json!({"scale": {"metres_per_pixel": 0.8}}),
        "longer side would be",
    );
    told(json!({"ball": {"radius_m": 0.0125, "mass_kg": 63.9}}), "kg/m³");
    told(json!({"ball": {"radius_m": 0.4}}), "by the scale");
    let lens =
        json!({"camera_matrix": [[900, 0, 960], [0, 900, 540], [0, 0, 1]], "distortion": [-0.1, 0, 0, 0, 0]});
    told(json!({"lens": lens}), "another size");
    let folding =
        json!({"camera_matrix": [[900, 0, 640], [0, 900, 360], [0, 0, 1]], "distortion": [-0.6, 0, 0, 0, 0]});
    told(json!({"lens": folding}), "corners");
    told(
        json!({"floor": {"line_px": [[300, 100], [310, 700]]}}),
        "a floor is level, nearly",
    );
    let mirrored = json!({"world_from_pixel": [[0.001, 0, 0], [0, 0.001, 0], [0, 0, 1]]});
    let mut c = sound();
    c.as_object_mut().unwrap().retain(|k, _| !k.starts_with("origin"));
    c["scale"] = mirrored;
    assert!(
        problems(&c.to_string(), None)
            .iter()
            .any(|f| f.contains("mirrors"))
    );
}

#[test]
fn a_floor_has_its_say_in_a_side_view() {
    let mut c = sound();
    c["floor"] = json!({"slope_deg": 1, "line_px": [[100, 650], [1200, 640]]});
    let told = |c: &serde_json::Value| {
        let found = findings(&c.to_string(), None);
        found.iter().any(|f| f.key.starts_with("floor"))
    };
    assert!(!told(&c));
    c["view"] = json!("top");
    assert!(told(&c) && problems(&c.to_string(), None).is_empty());
    // Ends outside a recording's picture, where the file names no size.
    let mut c = sound();
    c.as_object_mut().unwrap().remove("image_size_px");
    c["floor"] = json!({"line_px": [[100, 650], [1800, 640]]});
    let found = problems(&c.to_string(), Some(&recording()));
    assert!(found[0].starts_with("floor.line_px: [1800, 640]"), "{found:?}");
}

#[test]
fn a_recording_without_a_clock_needs_a_rate() {
    let mut c = sound();
    c.as_object_mut().unwrap().remove("frame_rate_hz");
    let mut images = recording();
    images.has_time_base = false;
    images.nominal_rate_hz = None;
    assert!(problems(&c.to_string(), Some(&images))[0].contains("no time stamps"));
    let mut wide = recording();
    wide.pixel_aspect = 1.333;
    assert!(problems(&c.to_string(), Some(&wide))[0].contains("as wide as high"));
}
