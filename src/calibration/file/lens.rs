//! The lens, and how lens and homography may be off.

use crate::calibration::{Deviation, Lens};
use crate::config::{FINITE, POSITIVE, Section, text};
use serde_json::Value;

pub(super) const LENS_KEYS: [&str; 4] = ["camera_matrix", "distortion", "camera_std_px", "distortion_std"];
const DEVIATION_KEYS: [&str; 2] = ["lens", "world_from_pixel"];

pub(super) fn lens(top: &Section<'_>) -> Option<Lens> {
    let section = top.section("lens", &LENS_KEYS)?;
    let matrix = section.required_matrix(
        "camera_matrix",
        "[[fx, 0, cx], [0, fy, cy], [0, 0, 1]], in px",
        "copy the camera matrix row by row",
    );
    let distortion = section.required_numbers("distortion", FINITE.or_try("OpenCV's order; write 0 for a coefficient that is not used (models of 8 or more are not supported)"), "five numbers [k1, k2, p1, p2, k3]");
    match Lens::new(matrix?, distortion?) {
        Ok(lens) => Some(lens),
        Err(problems) => {
            section.problems().extend(problems);
            None
        }
    }
}

/// Uncertainties of the lens's nine numbers; null where one was not fitted.
pub(super) fn lens_std(top: &Section<'_>) -> [Option<f64>; 9] {
    let mut all = [None; 9];
    // Whatever is wrong with the section itself has been reported already.
    let Some(Value::Object(keys)) = top.get("lens") else {
        return all;
    };
    let section = top.inner("lens", keys);
    let (camera, distortion) = all.split_at_mut(4);
    for (name, form, numbers) in [
        ("camera_std_px", "four numbers [fx, fy, cx, cy]", camera),
        ("distortion_std", "five numbers [k1, k2, p1, p2, k3]", distortion),
    ] {
        let Some(value) = section.get(name) else { continue };
        let element = |x: &Value| match x {
            Value::Null => Some(None),
            x => x.as_f64().filter(|&x| (POSITIVE.holds)(x)).map(Some),
        };
        let read: Option<Vec<Option<f64>>> = value.as_array().and_then(|a| a.iter().map(element).collect());
        match read.filter(|read| read.len() == numbers.len()) {
            Some(read) => numbers.copy_from_slice(&read),
            None => section.refuse(
                section.key(name),
                text(value),
                format!("{form}, each above 0 or null"),
                "leave it out where it is not known",
            ),
        }
    }
    all
}

/// A file has no more: lens and homography have 15 numbers together.
const MOST_DEVIATIONS: usize = 32;

pub(super) fn deviations(top: &Section<'_>, lens: bool, homography: bool) -> Vec<Deviation> {
    let Some(value) = top.get("deviations") else {
        return Vec::new();
    };
    let accepted = "a list of {\"lens\": [9 numbers], \"world_from_pixel\": [[..], [..], [..]]}, as track calibrate board writes it";
    let entries = match value {
        Value::Array(entries) if entries.len() <= MOST_DEVIATIONS => entries,
        other => {
            top.refuse("deviations", text(other), accepted, "copy it, or remove it");
            return Vec::new();
        }
    };
    let mut deviations = Vec::new();
    for (i, entry) in entries.iter().enumerate() {
        let name = format!("deviations[{i}]");
        let Value::Object(keys) = entry else {
            top.refuse(name, text(entry), accepted, "copy it, or remove it");
            continue;
        };
        let section = top.inner(name, keys);
        section.check_keys(&DEVIATION_KEYS);
        let hint = "the lens of which it is the uncertainty is gone: remove it";
        for (key, there) in [("lens", lens), ("world_from_pixel", homography)] {
            if let Some(value) = section.get(key).filter(|_| !there) {
                let of = if key == "lens" {
                    "lens"
                } else {
                    "scale.world_from_pixel"
                };
                section.refuse(section.key(key), text(value), format!("only with {of}"), hint);
            }
        }
        let numbers = section.numbers::<9>(
            "lens",
            FINITE.or_try("copy them, or remove the entry"),
            "nine numbers",
        );
        let matrix = section
            .get("world_from_pixel")
            .is_some()
            .then(|| section.required_matrix("world_from_pixel", "three rows of three numbers", "copy them"));
        deviations.push(Deviation {
            lens: numbers.unwrap_or_default(),
            world_from_pixel: matrix.flatten(),
        });
    }
    deviations
}
