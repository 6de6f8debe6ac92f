//! The keys of `calib.json`, one by one.

mod lens;
mod material;
mod schema;
mod write;

pub use schema::CalibrationKeys;

use super::error::CalibrationError;
use super::experiment::ROLLING;
use super::rectification::{HINT_UP, Rectification};
use super::{Ball, Calibration, Floor, FloorLine, Launch, SCHEMA, Scale, View};
use crate::config::{
    Document, FINITE, FileError, FileKind, FileProblem, NumberRange, POSITIVE, Section, array, made_by,
    read_bytes, text,
};
use crate::geometry::PixelPoint;
use lens::{LENS_KEYS, deviations, lens, lens_std};
use material::material;
use serde_json::Value;
use std::f64::consts::PI;
use std::path::Path;

/// A calibration, for messages about a file.
static KIND: FileKind = FileKind {
    what: "calibration",
    form: "one JSON object as in calib/README.md",
    source: "samples are in the folder calib",
    least: "{\"schema\": \"track.calib/1\", \"scale\": {\"gravity\": true}}",
};
/// No calibration comes near it; a video or a photograph named by mistake does.
const LARGEST_FILE_BYTES: u64 = 1_000_000;
/// Larger than any camera's picture.
const LARGEST_SIDE_PX: u64 = 100_000;

const TOP_KEYS: [&str; 20] = [
    "schema",
    "view",
    "image_size_px",
    "scale",
    "origin_px",
    "origin_std_px",
    "up_px",
    "up_std_deg",
    "distance_m",
    "distance_std_m",
    "lens",
    "deviations",
    "frame_rate_hz",
    "camera",
    "gravity_m_s2",
    "gravity_std_m_s2",
    "ball",
    "launch",
    "floor",
    made_by::KEY,
];
const CAMERA_KEYS: [&str; 1] = ["readout_s"];
const BALL_KEYS: [&str; 7] = [
    "radius_m",
    "radius_std_m",
    "mass_kg",
    "inertia_factor",
    "density_kg_m3",
    "youngs_modulus_pa",
    "poisson_ratio",
];
const LAUNCH_KEYS: [&str; 3] = ["edge_x_m", "spin_ratio", "track_width_m"];
const FLOOR_KEYS: [&str; 6] = [
    "slope_deg",
    "std_deg",
    "line_px",
    "line_std_px",
    "youngs_modulus_pa",
    "poisson_ratio",
];

/// Where a key that stands in the wrong place belongs, or what it is called here.
pub(super) fn home_of(name: &str) -> Option<String> {
    let scale = Scale::keys();
    let sections: [(&str, &[&str]); 6] = [
        ("scale", &scale),
        ("lens", &LENS_KEYS),
        ("camera", &CAMERA_KEYS),
        ("ball", &BALL_KEYS),
        ("launch", &LAUNCH_KEYS),
        ("floor", &FLOOR_KEYS),
    ];
    let nested = sections.iter().find_map(|(section, keys)| {
        let leaf = name
            .strip_prefix(section)
            .map_or(name, |rest| rest.trim_start_matches(['_', '.']));
        keys.contains(&leaf).then(|| format!("{section}.{leaf}"))
    });
    match name {
        "fps" | "frame_rate" | "framerate" => Some("frame_rate_hz".into()),
        "camera_distance_m" | "camera_height_m" => Some("distance_m".into()),
        "diameter_m" | "ball_diameter_m" => Some("ball.radius_m (half the diameter)".into()),
        _ if TOP_KEYS.contains(&name) => Some(format!("{name}, at the top level")),
        _ => nested,
    }
}

impl Calibration {
    /// The calibration in the file at `path`.
    ///
    /// # Errors
    /// A file that cannot be read (missing, a directory, above 1 MB, not UTF-8), that is not JSON, or any value that is
    /// not accepted: all of them at once, with the file, the dotted key, what was found, what is accepted, what to try.
    pub fn read(path: &Path) -> Result<Self, CalibrationError> {
        accepted(inspect(path)?, &path.display().to_string())
    }

    /// The calibration in `text`; `name` stands for the file in messages.
    ///
    /// # Errors
    /// As [`Self::read`], but for the file system's.
    pub fn parse(text: &str, name: &str) -> Result<Self, CalibrationError> {
        accepted(inspect_bytes(text.as_bytes(), name)?, name)
    }

    /// The calibration in the file's form: [`Self::parse`] reads the same back.
    #[must_use]
    pub fn to_json(&self) -> Value {
        write::to_json(self)
    }
}

/// What can be made of the file, and every problem in it.
pub(super) fn inspect(path: &Path) -> Result<Inspected, CalibrationError> {
    let bytes = read_bytes(path, &KIND, LARGEST_FILE_BYTES)?;
    inspect_bytes(&bytes, &path.display().to_string())
}

/// A calibration with defaults in place of what is wrong (`None` without a scale), and what is wrong.
pub(super) type Inspected = (Option<Calibration>, Vec<FileProblem>);

fn accepted((calibration, problems): Inspected, name: &str) -> Result<Calibration, CalibrationError> {
    match calibration {
        Some(calibration) if problems.is_empty() => Ok(calibration),
        _ => Err(CalibrationError::File(FileError::Invalid {
            name: name.to_owned(),
            problems,
        })),
    }
}

fn inspect_bytes(bytes: &[u8], name: &str) -> Result<Inspected, CalibrationError> {
    let document = Document::from_bytes(bytes, name, &KIND, home_of)?;
    let calibration = calibration(&document.top(&TOP_KEYS));
    let mut problems = document.problems.into_vec();
    if let Some(calibration) = &calibration {
        problems.extend(geometry_problems(calibration));
    }
    Ok((calibration, problems))
}

/// `None` where the scale itself is missing or wrong; other problems leave the default in place.
fn calibration(top: &Section<'_>) -> Option<Calibration> {
    schema(top);
    let view = view(top);
    let image_size_px = image_size(top);
    let scale = Scale::read(top);
    let origin_px = top.pixel("origin_px");
    let origin_std_px = top.number(
        "origin_std_px",
        POSITIVE.or_try("leave it out where it is not known"),
    );
    let up_px = up(top);
    let up_std_rad = top.number("up_std_deg", UP_STD).map(f64::to_radians);
    let (distance_m, distance_std_m) = distance(top);
    let lens = lens(top);
    let lens_std = lens_std(top);
    let homography = scale.as_ref().is_some_and(Scale::has_axes);
    let deviations = deviations(top, lens.is_some(), homography);
    let frame_rate_hz = top.number(
        "frame_rate_hz",
        POSITIVE.or_try(
            "give the rate at which the camera captured, or leave it out to use the file's time stamps",
        ),
    );
    let readout_s = readout(top, frame_rate_hz);
    let gravity_m_s2 = top
        .number("gravity_m_s2", POSITIVE.or_try("leave it out for 9.81"))
        .unwrap_or(9.81);
    let gravity_std_m_s2 = top.std_uncertainty("gravity_std_m_s2", Some(gravity_m_s2));
    let ball = ball(top, scale.as_ref());
    check_outside_ball(top, distance_m, &ball);
    let has_origin = top.get("origin_px").is_some() || scale.as_ref().is_some_and(Scale::has_origin);
    let launch = launch(top, has_origin, &ball);
    let floor = floor(top);
    if homography {
        check_beside_homography(top, up_px);
    }
    if origin_std_px.is_some() && !has_origin {
        top.refuse(
            "origin_std_px",
            "no origin_px beside it",
            "only with origin_px (or world_from_pixel)",
            "give origin_px or remove it",
        );
    }
    Some(Calibration {
        view,
        image_size_px,
        scale: scale?,
        origin_px,
        origin_std_px,
        up_px,
        up_given: !homography && top.get("up_px").is_some(),
        up_std_rad,
        distance_m,
        distance_std_m,
        lens,
        lens_std,
        deviations,
        frame_rate_hz,
        readout_s,
        gravity_m_s2,
        gravity_given: top.get("gravity_m_s2").is_some(),
        gravity_std_m_s2,
        ball,
        launch,
        floor,
    })
}

fn schema(top: &Section<'_>) {
    let hint = match top.get("schema") {
        Some(Value::String(schema)) if schema == SCHEMA => return,
        Some(Value::String(schema)) if schema.starts_with("track.calib/") => {
            "this version of track reads schema track.calib/1 only: use the version that wrote the file, or rewrite it"
        }
        Some(Value::String(schema)) if schema.starts_with("track.") => {
            "this is another of track's files: name the calib.json"
        }
        _ => "begin the file with \"schema\": \"track.calib/1\"",
    };
    let found = top.get("schema").map_or("nothing".to_owned(), text);
    top.refuse("schema", found, format!("\"{SCHEMA}\""), hint);
}

fn view(top: &Section<'_>) -> View {
    match top.get("view") {
        None => View::Side,
        Some(Value::String(view)) if view == "side" => View::Side,
        Some(Value::String(view)) if view == "top" => View::Top,
        Some(other) => {
            top.refuse(
                "view",
                text(other),
                "\"side\" or \"top\"",
                "side: the camera looks at the plane of motion; top: it looks down at the floor",
            );
            View::Side
        }
    }
}

fn image_size(top: &Section<'_>) -> Option<(usize, usize)> {
    let value = top.get("image_size_px")?;
    let side = |x: &Value| {
        let side = x
            .as_f64()
            .filter(|x| x.fract() == 0.0 && (1.0..=LARGEST_SIDE_PX as f64).contains(x))?;
        Some(side as usize)
    };
    let size = array::<_, 2>(value, side);
    if size.is_none() {
        top.refuse(
            "image_size_px",
            text(value),
            format!("two whole numbers [width, height], 1 to {LARGEST_SIDE_PX}"),
            "give the size of the recording's pictures, after the rotation tag",
        );
    }
    size.map(|[width, height]| (width, height))
}

/// A unit vector, the default where the key is missing or wrong.
fn up(top: &Section<'_>) -> [f64; 2] {
    const DEFAULT: [f64; 2] = [0.0, -1.0];
    let Some([du, dv]) = top.numbers("up_px", FINITE.or_try(HINT_UP), "a direction [du, dv]") else {
        return DEFAULT;
    };
    let norm = du.hypot(dv);
    if norm >= 1e-9 {
        return [du / norm, dv / norm];
    }
    top.refuse(
        "up_px",
        format!("[{du}, {dv}], which has no direction"),
        "a direction [du, dv] that is not zero",
        HINT_UP,
    );
    DEFAULT
}

/// How far the camera is from the calibrated plane, m, and its standard uncertainty.
fn distance(top: &Section<'_>) -> (Option<f64>, Option<f64>) {
    let hint = "the distance in metres from the lens to the calibrated plane, along the optical axis; leave it out \
                where it is not known";
    let distance_m = top.number("distance_m", POSITIVE.or_try(hint));
    let distance_std_m = top.std_uncertainty("distance_std_m", distance_m);
    if distance_std_m.is_some() && top.get("distance_m").is_none() {
        top.refuse(
            "distance_std_m",
            "no distance_m beside it",
            "only with distance_m",
            "give distance_m or remove it",
        );
    }
    (distance_m, distance_std_m)
}

/// How long the camera takes to read a picture, s; `None`: all rows at once.
fn readout(top: &Section<'_>, frame_rate_hz: Option<f64>) -> Option<f64> {
    let section = top.section("camera", &CAMERA_KEYS)?;
    let readout_s = section.number("readout_s", READOUT)?;
    let longest_s = frame_rate_hz.map_or(f64::INFINITY, |rate| 1.0 / rate);
    if readout_s.abs() > LONGEST_READOUT * longest_s {
        section.refuse(
            section.key("readout_s"),
            format!("{readout_s}, longer than a frame ({longest_s:.6} s by frame_rate_hz)"),
            "at most the time from frame to frame",
            "give seconds, and the rate at which the camera captured as frame_rate_hz",
        );
    }
    Some(readout_s)
}

/// A ball that lies in the calibrated plane (on the floor, in a top view) is in front of the camera.
fn check_outside_ball(top: &Section<'_>, distance_m: Option<f64>, ball: &Ball) {
    if let (Some(distance_m), Some(radius_m)) = (distance_m, ball.radius_m)
        && distance_m <= 2.0 * radius_m
    {
        top.refuse(
            "distance_m",
            format!("{distance_m}, within the ball (ball.radius_m is {radius_m})"),
            "more than the ball's diameter",
            "check the unit: metres, from the lens to the calibrated plane",
        );
    }
}

fn ball(top: &Section<'_>, scale: Option<&Scale>) -> Ball {
    let section = top.section("ball", &BALL_KEYS);
    let mut ball = Ball::default();
    if let Some(section) = &section {
        ball.radius_m = section.number("radius_m", POSITIVE.or_try("half the diameter, in metres"));
        ball.radius_std_m = section.std_uncertainty("radius_std_m", ball.radius_m);
        ball.mass_kg = section.number("mass_kg", POSITIVE.or_try("give kilograms, or leave it out"));
        if let Some(factor) = section.number("inertia_factor", INERTIA) {
            ball.inertia_factor = factor.min(2.0 / 3.0);
        }
        ball.material = material(section);
        let density = section.number("density_kg_m3", POSITIVE.or_try("give kg/m³, or leave it out"));
        if let (None, Some(density), Some(radius_m)) = (ball.mass_kg, density, ball.radius_m) {
            ball.mass_kg = Some(density * 4.0 / 3.0 * PI * radius_m.powi(3));
        }
    }
    let given = section.is_some_and(|s| s.get("radius_m").is_some());
    if scale.is_some_and(Scale::rests_on_ball) && !given {
        top.refuse(
            "ball.radius_m",
            "nothing, but the ball is the scale",
            POSITIVE.accepted,
            "measure the ball's diameter and give half of it, in metres",
        );
    }
    ball
}

fn launch(top: &Section<'_>, has_origin: bool, ball: &Ball) -> Launch {
    let default = Launch {
        edge_x_m: has_origin.then_some(0.0),
        ..Launch::default()
    };
    let Some(section) = top.section("launch", &LAUNCH_KEYS) else {
        return default;
    };
    let edge = section.number("edge_x_m", FINITE);
    // The contract's default written out is harmless; another number would have nothing to refer to.
    if !has_origin && edge.is_some_and(|x| x != 0.0) {
        section.refuse(
            section.key("edge_x_m"),
            "no origin_px, so that there is no x axis to place the edge on",
            "only with origin_px (or world_from_pixel)",
            "give origin_px, or remove edge_x_m",
        );
    }
    let word = section.get("spin_ratio").and_then(Value::as_str);
    let rolling = word == Some(ROLLING);
    let track_width_m = section.number(
        "track_width_m",
        POSITIVE.or_try("the distance between the two edges that the ball rolls on, in metres"),
    );
    // Beside a word that is misspelt it is no second problem.
    if track_width_m.is_some() && word.is_none() {
        section.refuse(
            section.key("track_width_m"),
            "a track without a ball that rolls on it",
            "only with \"spin_ratio\": \"rolling\"",
            "write \"spin_ratio\": \"rolling\", or remove track_width_m",
        );
    }
    let spin = if rolling {
        rolling_ratio(&section, track_width_m, ball)
    } else {
        spin_ratio(&section)
    };
    Launch {
        edge_x_m: if section.is_explicit_null("edge_x_m") {
            None
        } else {
            edge.filter(|_| has_origin).or(default.edge_x_m)
        },
        spin_ratio: if section.is_explicit_null("spin_ratio") {
            None
        } else {
            spin.or(default.spin_ratio)
        },
        rolling,
        track_width_m: track_width_m.filter(|_| rolling),
    }
}

/// A number, where the file does not say "rolling".
fn spin_ratio(section: &Section<'_>) -> Option<f64> {
    const SPIN: NumberRange = NumberRange {
        accepted: "a finite number (to 1e9), \"rolling\" or null",
        holds: FINITE.holds,
        hint: "R w / u before the first impact: 0 for no spin, \"rolling\" for a ball that rolls off its bench, null for \
               unknown",
    };
    match section.get("spin_ratio") {
        Some(Value::String(word)) if word.parse::<f64>().is_err() => {
            section.refuse(
                section.key("spin_ratio"),
                text(&word.as_str().into()),
                SPIN.accepted,
                SPIN.hint,
            );
            None
        }
        _ => section.number("spin_ratio", SPIN),
    }
}

/// R ω/u of a ball that rolls on its bench or track.
fn rolling_ratio(section: &Section<'_>, track_width_m: Option<f64>, ball: &Ball) -> Option<f64> {
    let Some(width_m) = track_width_m else {
        return Some(1.0);
    };
    let Some(radius_m) = ball.radius_m else {
        // A radius that is wrong is one problem, not two.
        if !section.problems().any_of("ball") {
            section.refuse(
                "ball.radius_m",
                "nothing, but launch.track_width_m is given",
                POSITIVE.accepted,
                "how fast a ball turns on a track depends on its radius: give half of its diameter, in metres",
            );
        }
        return None;
    };
    let ratio = Launch::rolling_ratio(radius_m, width_m);
    if ratio.is_none() {
        section.refuse(
            section.key("track_width_m"),
            format!("{width_m}, through which a ball of radius {radius_m} falls"),
            "less than the ball's diameter",
            "check the unit: metres, between the two edges that the ball rolls on",
        );
    }
    ratio
}

/// How well a point on a line of the picture is read by eye, px.
const LINE_STD_PX: f64 = 1.0;

/// What is known of the floor's slope.
fn floor(top: &Section<'_>) -> Floor {
    let default = Floor::default();
    let Some(section) = top.section("floor", &FLOOR_KEYS) else {
        return default;
    };
    let slope_deg = section.number("slope_deg", SLOPE);
    let std_deg = section.number(
        "std_deg",
        UP_STD.or_try("give degrees, or leave it out for a bench's 0.1"),
    );
    Floor {
        slope_rad: slope_deg.unwrap_or(0.0).to_radians(),
        std_rad: std_deg.map_or(default.std_rad, f64::to_radians),
        given: slope_deg.is_some() || std_deg.is_some(),
        line: floor_line(&section),
        material: material(&section),
    }
}

/// A line along the floor.
fn floor_line(section: &Section<'_>) -> Option<FloorLine> {
    let key = section.key("line_px");
    let hint = "read two pixels off a picture, far apart on a line along the floor in the plane of motion";
    let Some(value) = section.get("line_px") else {
        if section.get("line_std_px").is_some() {
            section.refuse(
                section.key("line_std_px"),
                "no line_px beside it",
                "only with line_px",
                "give line_px or remove it",
            );
        }
        return None;
    };
    let number = |x: &Value| x.as_f64().filter(|&x| (FINITE.holds)(x));
    let Some([a, b]) = array::<_, 2>(value, |end| array::<_, 2>(end, number)) else {
        section.refuse(key, text(value), "two points [[u, v], [u, v]]", hint);
        return None;
    };
    let mut line = FloorLine {
        from: PixelPoint::new(a[0], a[1]),
        to: PixelPoint::new(b[0], b[1]),
        std_px: LINE_STD_PX,
    };
    let length_px = line.length_px();
    if length_px < FloorLine::LEAST_PX {
        section.refuse(
            key,
            format!("{length_px:.1} px from end to end"),
            format!("two points {} px or more apart", FloorLine::LEAST_PX),
            "take points as far apart as the picture allows",
        );
        return None;
    }
    if let Some(std_px) = section.std_uncertainty("line_std_px", Some(length_px)) {
        line.std_px = std_px;
    }
    Some(line)
}

/// A homography has its own origin and axes.
fn check_beside_homography(top: &Section<'_>, up_px: [f64; 2]) {
    let reason = "nothing beside world_from_pixel, which has its own origin and axes";
    if let Some(value) = top.get("origin_px") {
        top.refuse(
            "origin_px",
            text(value),
            reason,
            "remove it, or move the homography's origin",
        );
    }
    if up_px != [0.0, -1.0] {
        let found = top.get("up_px").map_or("nothing".to_owned(), text);
        top.refuse("up_px", found, reason, "remove it, or turn the homography");
    }
}

const UP_STD: NumberRange = NumberRange {
    accepted: "a number above 0 (1e-15) and below 45, in degrees",
    holds: |x| (1e-15..45.0).contains(&x),
    hint: "give degrees, or leave it out",
};
const READOUT: NumberRange = NumberRange {
    accepted: "a number from -1 to 1, in seconds",
    holds: |x| (-1.0..=1.0).contains(&x),
    hint: "the time from the first row's exposure to the last row's, of the order of 0.01; below 0 where the picture is stored \
           upside down; leave it out for a global shutter",
};
/// A readout may be longer than a frame by what a rate is rounded by.
const LONGEST_READOUT: f64 = 1.01;
const SLOPE: NumberRange = NumberRange {
    accepted: "a number from -45 to 45, in degrees",
    holds: |x| (-45.0..=45.0).contains(&x),
    hint: "the angle by which the floor rises along the launch, in degrees; 0 for level",
};
/// To 0.667, as people write 2/3.
pub(crate) const INERTIA: NumberRange = NumberRange {
    accepted: "a number above 0 (1e-6), at most 2/3",
    holds: |x| (1e-6..=0.667).contains(&x),
    hint: "I / (m R^2): 0.4 for a solid ball, 0.6667 for a thin shell such as a table tennis ball",
};

/// What only shows when the parts come together: points the lens cannot undistort, ends of a ruler or of a line along the
/// floor outside the picture, a homography that cannot be inverted.
fn geometry_problems(c: &Calibration) -> Vec<FileProblem> {
    let of = |error: Option<CalibrationError>| error.map_or(Vec::new(), |e| e.problems().to_vec());
    let mut problems = of(c.rectification().err());
    if let (true, Some(size)) = (c.scale.has_axes(), c.image_size_px)
        && problems.is_empty()
    {
        problems.extend(of(c.viewpoint(1.0, size).err()));
    }
    let map = c.rectification().ok();
    for (key, end) in c.marks() {
        // A pixel reaches half a pixel beyond its centre; another half for the care of who reads it.
        let inside = |x: f64, size: usize| x >= -1.0 && x <= size as f64;
        if c.image_size_px
            .is_some_and(|(w, h)| !(inside(end.u_px, w) && inside(end.v_px, h)))
        {
            problems.push(FileProblem::new(
                key,
                format!("[{}, {}], outside the picture", end.u_px, end.v_px),
                "a pixel inside image_size_px",
                "check the order: column u first, then row v",
            ));
        } else if c.lens.as_ref().is_some_and(|lens| lens.undistort(end).is_none()) {
            problems.push(Rectification::beyond_lens(key, end));
        } else if map
            .as_ref()
            .is_some_and(|map| map.plane_from_pixel(end).is_none())
        {
            problems.push(FileProblem::new(
                key,
                format!("[{}, {}], beyond the plane's horizon", end.u_px, end.v_px),
                "a pixel that shows the plane of motion",
                "check the point and scale.world_from_pixel",
            ));
        }
    }
    problems
}
