//! The key `scale`: exactly one kind, and what may stand beside it.

use super::reader::{POSITIVE, Reader, Section};
use super::{PAIR, deviation, pixel};
use crate::calibration::{Homography, Scale};

/// A kind of scale: how messages name it, the keys that say it is this one, the keys that may stand beside them.
struct Kind {
    name: &'static str,
    marks: &'static [&'static str],
    beside: &'static [&'static str],
}

const KINDS: [Kind; 5] = [
    Kind {
        name: "metres_per_pixel",
        marks: &["metres_per_pixel"],
        beside: &["std_uncertainty"],
    },
    Kind {
        name: "ruler (from_px, to_px, length_m)",
        marks: &["from_px", "to_px", "length_m"],
        beside: &["length_std_m", "point_std_px"],
    },
    Kind {
        name: "ball",
        marks: &["ball"],
        beside: &[],
    },
    Kind {
        name: "gravity",
        marks: &["gravity"],
        beside: &[],
    },
    Kind {
        name: "world_from_pixel",
        marks: &["world_from_pixel"],
        beside: &["relative_std", "origin_unknown"],
    },
];

pub(super) const SCALE_KEYS: [&str; 12] = [
    "metres_per_pixel",
    "std_uncertainty",
    "from_px",
    "to_px",
    "length_m",
    "length_std_m",
    "point_std_px",
    "ball",
    "gravity",
    "world_from_pixel",
    "relative_std",
    "origin_unknown",
];
const ONE_SCALE: &str = "exactly one of {\"metres_per_pixel\": m}, {\"from_px\": [u, v], \"to_px\": [u, v], \"length_m\": m}, \
                         {\"ball\": true}, {\"gravity\": true}, {\"world_from_pixel\": [[..], [..], [..]]}";
/// The scale; `None` where it is missing or wrong.
pub(super) fn scale(reader: &mut Reader, top: &Section<'_>) -> Option<Scale> {
    if top.get("scale").is_none() {
        let hint = "measure a known length in the picture, or let the fall be the scale: \"scale\": {\"gravity\": true}";
        reader.refuse("scale".into(), "nothing", ONE_SCALE, hint);
        return None;
    }
    let section = reader.section(top, "scale", &SCALE_KEYS)?;
    let given = |keys: &[&str]| keys.iter().any(|key| section.get(key).is_some());
    let kinds: Vec<&Kind> = KINDS.iter().filter(|kind| given(kind.marks)).collect();
    let [kind] = kinds[..] else {
        let names: Vec<&str> = kinds.iter().map(|kind| kind.name).collect();
        let (found, hint) = match names.len() {
            0 => ("none of the scales".to_owned(), "name one of them"),
            _ => (
                format!("{} scales: {}", names.len(), names.join(" and ")),
                "keep the one you trust most",
            ),
        };
        reader.refuse("scale".into(), found, ONE_SCALE, hint);
        return None;
    };
    let strays = KINDS
        .iter()
        .flat_map(|k| k.beside)
        .filter(|key| !kind.beside.contains(key) && given(&[key]));
    for stray in strays {
        let accepted = match kind.beside {
            [] => format!("nothing beside {}", kind.name),
            beside => format!("beside {}: {}", kind.name, beside.join(", ")),
        };
        reader.refuse(
            section.key(stray),
            "a key of another scale",
            accepted,
            "remove or replace it",
        );
    }
    scale_of_kind(reader, &section, kind)
}

fn scale_of_kind(reader: &mut Reader, section: &Section<'_>, kind: &Kind) -> Option<Scale> {
    match kind.marks[0] {
        "metres_per_pixel" => {
            let hint = "a known length in metres over its length in pixels";
            let value = reader.number(section, "metres_per_pixel", POSITIVE, hint);
            let std = deviation(reader, section, "std_uncertainty", value);
            Some(Scale::MetresPerPixel { value: value?, std })
        }
        "from_px" => ruler(reader, section),
        "ball" => {
            let hint =
                "to use another scale, replace the key; the ball's facts belong in ball, at the top level";
            reader.flag(section, "ball", hint).map(|()| Scale::Ball)
        }
        "gravity" => {
            let hint =
                "to use another scale, replace the key; the number belongs in gravity_m_s2, at the top level";
            reader.flag(section, "gravity", hint).map(|()| Scale::Gravity)
        }
        _ => {
            let form = "three rows of three numbers [[..], [..], [..]], from undistorted pixels to metres";
            let matrix =
                reader.required_matrix(section, "world_from_pixel", form, "write the matrix row by row");
            let relative_std = deviation(reader, section, "relative_std", Some(1.0));
            let unknown = section.get("origin_unknown").is_some();
            if unknown {
                let hint = "leave it out where the matrix's origin is the launch edge at the floor";
                reader.flag(section, "origin_unknown", hint);
            }
            Some(Scale::Homography(Homography {
                world_from_pixel: matrix?,
                relative_std,
                origin_known: !unknown,
            }))
        }
    }
}

fn ruler(reader: &mut Reader, section: &Section<'_>) -> Option<Scale> {
    let mut end = |name: &str| {
        if section.get(name).is_none() {
            reader.refuse(
                section.key(name),
                "nothing",
                PAIR,
                "a ruler has two ends: give from_px and to_px",
            );
        }
        pixel(reader, section, name)
    };
    let (from, to) = (end("from_px"), end("to_px"));
    let length_m = reader.required_number(
        section,
        "length_m",
        POSITIVE,
        "the length between the two ends, in metres",
    );
    let length_std_m = deviation(reader, section, "length_std_m", length_m);
    let point_std_px = reader.number(
        section,
        "point_std_px",
        POSITIVE,
        "leave it out for the rounding to whole pixels",
    );
    let (from, to) = (from?, to?);
    let apart = from.distance_px(to) >= 1.0;
    if !apart {
        reader.refuse(
            section.key("to_px"),
            format!("[{}, {}], less than 1 px from from_px", to.u_px, to.v_px),
            "two ends at least 1 px apart",
            "choose marks as far apart as the picture allows",
        );
        return None;
    }
    Some(Scale::Ruler {
        from,
        to,
        length_m: length_m?,
        length_std_m,
        point_std_px,
    })
}
