//! The key `look.marks` of a scene.

use super::marks::{BallMap, BallMarks, MarkPattern};
use super::scene::GREY;
use crate::config::{FINITE, NumberRange, Section, array};
use crate::error_chain;
use crate::frames::open_picture;
use nalgebra::{UnitQuaternion, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde_json::Value;
use std::path::Path;

/// What marks are drawn with, besides their own keys.
pub(super) struct MarkDrawing<'a> {
    /// Of the scene.
    pub seed: u64,
    /// What a picture's name is relative to.
    pub folder: &'a Path,
}

/// The patterns, as the files say them.
#[derive(Clone, Copy)]
enum PatternName {
    None,
    Dots,
    Line,
    Halves,
    Seam,
    Picture,
}

/// The words for them.
pub(super) const PATTERNS: [&str; 6] = ["none", "dots", "line", "halves", "seam", "picture"];
const NAMES: [PatternName; 6] = [
    PatternName::None,
    PatternName::Dots,
    PatternName::Line,
    PatternName::Halves,
    PatternName::Seam,
    PatternName::Picture,
];

/// Most dots or lines.
const MOST_DIRECTIONS: u64 = 200;
const RADIUS_DEG: NumberRange = NumberRange {
    accepted: "a number above 0, at most 90",
    holds: |x| x > 0.0 && x <= 90.0,
    hint: "it is half the angle that a dot covers, seen from the ball's centre; 15 is a good felt-pen dot",
};
const WIDTH_DEG: NumberRange = NumberRange {
    accepted: "a number above 0, at most 90",
    holds: |x| x > 0.0 && x <= 90.0,
    hint: "it is the angle across the line, seen from the ball's centre; 10 is a good felt-pen line",
};

/// The marks, where the scene has any, on a ball of `ball_grey`.
pub(super) fn read_marks(look: &Section<'_>, ball_grey: f64, drawing: &MarkDrawing<'_>) -> Option<BallMarks> {
    let value = look.get("marks")?;
    let Value::Object(keys) = value else {
        look.refuse_value(
            "marks",
            "an object such as {\"pattern\": \"dots\", \"count\": 6, \"radius_deg\": 15, \"grey\": 60}",
            "leave it out for a plain ball",
        );
        return None;
    };
    // Which keys it may have depends on the pattern.
    let unchecked = look.inner(look.key("marks"), keys);
    let quoted = PATTERNS.map(|word| format!("{word:?}")).join(" or ");
    if unchecked.get("pattern").is_none() {
        unchecked.refuse_value("pattern", quoted, "say what is drawn on the ball");
        return None;
    }
    let choices: Vec<(&str, PatternName)> = PATTERNS.into_iter().zip(NAMES).collect();
    let name = unchecked.choice("pattern", &choices, "take one of these words")?;
    let own: &[&str] = match name {
        PatternName::None => &[],
        PatternName::Dots => &["count", "directions", "radius_deg", "grey"],
        PatternName::Line => &["directions", "width_deg", "grey"],
        PatternName::Halves => &["directions", "grey"],
        PatternName::Seam => &["width_deg", "grey"],
        PatternName::Picture => &["file"],
    };
    let s = look.section("marks", &[&["pattern", "turned_deg"], own].concat())?;
    let turned_deg = s.numbers("turned_deg", FINITE, "a list of 3 numbers");
    let turned_rad = Vector3::from(turned_deg.unwrap_or([0.0; 3])).map(f64::to_radians);
    let pattern = match name {
        PatternName::None => return None,
        PatternName::Dots => MarkPattern::Dots {
            directions: match directions(&s, MOST_DIRECTIONS) {
                Some(given) => given,
                None => scattered(s.whole("count", 1..=MOST_DIRECTIONS).unwrap_or(6), drawing.seed),
            },
            radius_rad: s.number("radius_deg", RADIUS_DEG).unwrap_or(15.0).to_radians(),
        },
        PatternName::Line => MarkPattern::Lines {
            poles: directions(&s, MOST_DIRECTIONS).unwrap_or_else(|| vec![Vector3::x()]),
            width_rad: width_rad(&s),
        },
        PatternName::Halves => MarkPattern::Half {
            pole: directions(&s, 1).map_or_else(Vector3::x, |given| given[0]),
        },
        PatternName::Seam => MarkPattern::Seam {
            width_rad: width_rad(&s),
        },
        PatternName::Picture => MarkPattern::Picture(picture(&s, drawing.folder)?),
    };
    Some(BallMarks {
        pattern,
        albedo: albedo(&s, ball_grey)?,
        at_launch: UnitQuaternion::from_scaled_axis(turned_rad),
    })
}

fn width_rad(s: &Section<'_>) -> f64 {
    s.number("width_deg", WIDTH_DEG).unwrap_or(10.0).to_radians()
}

/// The marks' grey over the ball's; `None` on a black ball, which no factor makes brighter.
fn albedo(s: &Section<'_>, ball_grey: f64) -> Option<f64> {
    if ball_grey > 0.0 {
        let grey = s.number("grey", GREY).unwrap_or(0.3 * ball_grey);
        return Some(grey / ball_grey);
    }
    s.refuse(
        "look.ball_grey",
        "0, with look.marks",
        "above 0",
        "marks scale the ball's own grey: a ball of 10 with marks of 200 looks as good as black",
    );
    None
}

/// The directions given, 1 to `most`, with the length 1; `None` where there are none.
fn directions(s: &Section<'_>, most: u64) -> Option<Vec<Vector3<f64>>> {
    let value = s.get("directions")?;
    let component = |x: &Value| x.as_f64().filter(|x| (FINITE.holds)(*x));
    let direction = |row: &Value| Vector3::from(array::<_, 3>(row, component)?).try_normalize(1e-12);
    let list = value.as_array().map(|rows| rows.iter().map(direction).collect());
    let given: Option<Vec<Vector3<f64>>> = list.flatten();
    let sound = given.filter(|given| (1..=most).contains(&(given.len() as u64)));
    if sound.is_none() {
        s.refuse_value(
            "directions",
            format!("a list of 1 to {most} directions [x, y, z] from the ball's centre"),
            "at the launch x is along it, y away from a camera at the side, z up; [0, -1, 0] faces that camera",
        );
    }
    sound
}

/// Candidates for a place, of which the one that is farthest from all others is taken.
const CANDIDATES: usize = 24;

/// `count` directions that are irregular but not close to each other, by `seed`: the best candidate of Mitchell (1991).
fn scattered(count: u64, seed: u64) -> Vec<Vector3<f64>> {
    // Another key than that of the noise.
    let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0x006d_6172_6b73);
    let mut share = move || random.next_u32() as f64 / f64::from(u32::MAX);
    // Even in z and in longitude is even on the sphere (Archimedes).
    let mut anywhere = move || {
        let (z, longitude) = (2.0 * share() - 1.0, std::f64::consts::TAU * share());
        let across = (1.0 - z * z).max(0.0).sqrt();
        Vector3::new(across * longitude.cos(), across * longitude.sin(), z)
    };
    let mut places: Vec<Vector3<f64>> = Vec::new();
    for _ in 0..count {
        let mut best = (f64::INFINITY, Vector3::z());
        for _ in 0..CANDIDATES {
            let candidate = anywhere();
            let nearest = places.iter().map(|p| p.dot(&candidate)).fold(-1.0, f64::max);
            if nearest < best.0 {
                best = (nearest, candidate);
            }
        }
        places.push(best.1);
    }
    places
}

/// The picture that is named.
fn picture(s: &Section<'_>, folder: &Path) -> Option<BallMap> {
    let accepted = "the name of a PNG, PGM or other image, relative to the scene";
    let hint =
        "its columns are longitudes, its rows latitudes from the top down; white leaves the ball as it is";
    let Some(name) = s.get("file").and_then(Value::as_str) else {
        s.refuse_value("file", accepted, hint);
        return None;
    };
    match open_picture(&folder.join(name)) {
        Ok(luma) => BallMap::new(&luma),
        Err(error) => {
            s.refuse(s.key("file"), error_chain(&error), accepted, hint);
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scattered_dots_keep_apart_and_depend_on_the_seed() {
        let places = scattered(12, 5);
        for (i, a) in places.iter().enumerate() {
            assert!((a.norm() - 1.0).abs() < 1e-12);
            for b in &places[..i] {
                assert!(a.angle(b).to_degrees() > 30.0, "{a} {b}");
            }
        }
        assert_eq!(places, scattered(12, 5));
        assert_ne!(places, scattered(12, 6));
    }
}
