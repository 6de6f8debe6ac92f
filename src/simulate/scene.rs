//! A scene: a ball, a floor, a launch, a camera. The JSON of `contract.md`, checked.

use super::effects;
use super::marks::BallMarks;
use super::scene_marks::{MarkDrawing, read_marks};
use crate::calibration::INERTIA;
pub use crate::calibration::View;
use crate::config::{
    Closeness, Document, FINITE, FileError, FileKind, FileProblem, NumberRange, POSITIVE, Section, array,
    nearest, read_bytes,
};
use crate::frames::ChromaSiting;
use crate::rebound::{Contact, ModelName};
use nalgebra::{Vector2, Vector3};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use thiserror::Error;

/// The schema this program reads.
pub const SCHEMA: &str = "track.scene/1";

/// What can be wrong with a scene.
#[derive(Debug, Error)]
pub enum SceneError {
    /// The file could not be read, or values in it make no sense.
    #[error(transparent)]
    File(#[from] FileError),
    /// The ball stays in the air.
    #[error(
        "scene: the ball never lands: {found}; accepted: a ball that falls to the floor within {limit_s} s; \
         make it heavier or launch it lower"
    )]
    NeverLands {
        /// What it does instead.
        found: String,
        /// The longest flight, s.
        limit_s: f64,
    },
    /// No frame shows the ball.
    #[error(
        "scene: the ball never enters the picture: it stays within u {u_from_px:.0} to {u_to_px:.0}, v {v_from_px:.0} to \
         {v_to_px:.0} px of a picture of {width_px}x{height_px}; change camera.origin_px, camera.metres_per_pixel \
         or camera.image_size_px"
    )]
    NeverSeen {
        /// Where its centre goes, px.
        u_from_px: f64,
        /// Where its centre goes, px.
        u_to_px: f64,
        /// Where its centre goes, px.
        v_from_px: f64,
        /// Where its centre goes, px.
        v_to_px: f64,
        /// Columns.
        width_px: usize,
        /// Rows.
        height_px: usize,
    },
}

impl SceneError {
    /// A value that only turns out to make no sense when the scene is put together.
    pub(super) fn invalid(problem: FileProblem) -> Self {
        Self::File(FileError::Invalid {
            name: "scene".into(),
            problems: vec![problem],
        })
    }
}

/// A scene, checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Of all that is random.
    pub seed: u64,
    /// g, m/s².
    pub gravity_m_s2: f64,
    /// The ball.
    pub ball: SceneBall,
    /// What the floor does to it.
    pub contact: Contact,
    /// Where the floor is.
    pub floor: SceneFloor,
    /// How it starts.
    pub launch: SceneLaunch,
    /// What it flies through.
    pub air: SceneAir,
    /// What else flies.
    pub second_ball: Option<SceneSecondBall>,
    /// What looks at it.
    pub camera: Camera,
    /// What that sees.
    pub look: SceneLook,
    /// When the recording ends.
    pub stop: Stop,
    /// What an effect must move a centre by to be worth simulating, px.
    pub tolerance_px: f64,
    /// What an effect must change a grey level by, grey. Half a code value by default: less is lost in rounding.
    pub tolerance_grey: f64,
    /// Which effects to simulate.
    pub effects: EffectsChoice,
}

/// The ball.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneBall {
    /// R, m.
    pub radius_m: f64,
    /// m, kg.
    pub mass_kg: f64,
    /// k = I / (m R²).
    pub inertia_factor: f64,
    /// Effective Young's modulus E* of ball and floor, Pa: 1/E* = (1 − ν₁²)/E₁ + (1 − ν₂²)/E₂. 7e10 is steel on
    /// ceramic; 1e7 a superball on anything.
    pub contact_modulus_pa: f64,
    /// Drag over that of a smooth sphere: felt and seams have more.
    pub drag_factor: f64,
    /// Magnus lift over that of a tennis ball.
    pub lift_factor: f64,
}

/// The floor: a plane through x = 0, z = 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneFloor {
    /// s, the angle by which it rises along +x, rad.
    pub slope_rad: f64,
}

/// The launch from x = 0, y = 0: at t = 0, or after what is seen of the bench.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneLaunch {
    /// Height of the ball's lowest point above z = 0, m.
    pub drop_height_m: f64,
    /// u_o, along x, m/s.
    pub speed_m_s: f64,
    /// R ω about x, y, z, m/s.
    pub surface_spin_m_s: Vector3<f64>,
    /// Speed upwards, m/s.
    pub rise_speed_m_s: f64,
    /// What it rolls along before, where that is seen.
    pub bench: Option<SceneBench>,
}

/// A level bench along which the ball is seen to roll or slide at the launch speed until it leaves the edge at x = 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneBench {
    /// How long it is seen there, s.
    pub seen_s: f64,
    /// Width of the track whose edges carry the ball, m; `None`: it rolls on a plane.
    pub track_width_m: Option<f64>,
    /// Grey of the bench in a side view; `None`: not drawn.
    pub bench_grey: Option<f64>,
}

/// A second ball, with the first's contact and density, and without spin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneSecondBall {
    /// When it is launched, s; below 0 it flies already as the recording begins.
    pub start_s: f64,
    /// Where, along x, m.
    pub x_m: f64,
    /// Height of its lowest point above z = 0 at x = 0, m.
    pub drop_height_m: f64,
    /// Along x, m/s; below 0 against it.
    pub speed_m_s: f64,
    /// Speed upwards, m/s.
    pub rise_speed_m_s: f64,
    /// R, m.
    pub radius_m: f64,
    /// As `look.ball_grey`.
    pub ball_grey: f64,
}

/// The air.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneAir {
    /// ρ, kg/m³.
    pub density_kg_m3: f64,
    /// Dynamic viscosity, Pa s.
    pub viscosity_pa_s: f64,
}

/// How the recording is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Codec {
    /// H.264 with this constant rate factor.
    H264 {
        /// 0 lossless, 51 worst.
        crf: u8,
    },
    /// Every grey level as rendered.
    Lossless,
}

/// A lens by OpenCV's model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneLens {
    /// [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], px.
    pub camera_matrix: [[f64; 3]; 3],
    /// k1, k2, p1, p2, k3.
    pub distortion: [f64; 5],
}

impl SceneLens {
    /// Focal length, px; of pixels that are not square the geometric mean.
    #[must_use]
    pub fn focal_px(&self) -> f64 {
        (self.camera_matrix[0][0] * self.camera_matrix[1][1]).sqrt()
    }
}

/// The camera. Its calibrated plane is the plane of motion y = 0 in a side view, the floor z = 0 in a top view.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// Which way it looks.
    pub view: View,
    /// Columns.
    pub width_px: usize,
    /// Rows.
    pub height_px: usize,
    /// Frames a second.
    pub frame_rate_hz: f64,
    /// Exposure of a frame, centred on the frame's time, s.
    pub exposure_s: f64,
    /// Scale in the calibrated plane, of the picture without lens distortion.
    pub metres_per_pixel: f64,
    /// Where x = 0, z = 0 (side) or x = 0, y = 0 (top) is in that picture, px.
    pub origin_px: [f64; 2],
    /// From the optical centre to the calibrated plane, m; `None` is infinitely far. A lens says it, where the scene does not:
    /// with a focal length of f px a metre of the plane is 1/q px at f q.
    pub distance_m: Option<f64>,
    /// How much nearer to the camera than the calibrated plane the ball is launched, m (side view).
    pub plane_offset_m: f64,
    /// Angle by which the camera is turned about the picture's vertical from looking at the plane squarely, rad: above 0
    /// the right side of the plane is the nearer one. The point of the plane in the picture's middle stays there.
    pub tilt_rad: f64,
    /// Angle by which the camera is pitched about the picture's horizontal, rad: above 0 it looks down, and the top of the plane is
    /// the nearer. The point of the plane in the picture's middle stays there. The calibration does not say it.
    pub pitch_rad: f64,
    /// Angle by which the ball's plane of motion is turned from the calibrated one about the vertical through x = y = 0, rad: above 0
    /// the ball comes nearer (side view). `launch.azimuth_deg` says it.
    pub motion_azimuth_rad: f64,
    /// Angle by which the camera is rolled about its optical axis, rad: above 0 the world's "up" leans to the right in the
    /// picture. Said of the picture without it: `origin_px`.
    pub roll_rad: f64,
    /// How it swings with the table after an impact.
    pub bump: Option<SceneBump>,
    /// How it is panned, or held by hand.
    pub pan: Option<ScenePan>,
    /// What the file makes of its frames' times; `None`: each frame once, with its time.
    pub clock: Option<SceneClock>,
    /// The lens.
    pub lens: Option<SceneLens>,
    /// From the exposure of the first row to that of the last, s; the middle row has the frame's time.
    pub readout_s: f64,
    /// Standard deviation of the optical blur, px.
    pub blur_px: f64,
    /// Standard deviation of the read noise, grey.
    pub noise_grey: f64,
    /// Electrons a grey level: shot noise has variance grey / this. `None`: no shot noise.
    pub electrons_per_grey: Option<f64>,
    /// Storage.
    pub codec: Codec,
    /// Where a coloured recording's samples of chroma lie.
    pub chroma_siting: ChromaSiting,
}

/// How table and camera swing after an impact: amplitude · sin(2π f t) exp(−t/τ).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneBump {
    /// Shift of the picture (right, down) after the first impact, px; after others by their speed along the floor's normal.
    pub amplitude_px: Vector2<f64>,
    /// f, Hz.
    pub frequency_hz: f64,
    /// τ, s.
    pub decay_s: f64,
}

/// A pan and a hand's wander; the picture is shifted by 0 at t = 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScenePan {
    /// Of the whole picture (right, down), px/s.
    pub velocity_px_s: Vector2<f64>,
    /// Standard deviation of the wander along each axis, px.
    pub wander_px: f64,
}

/// The clock of the file, see the effect `clock`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SceneClock {
    /// Places for frames a second; `None`: the frame rate.
    pub stored_hz: Option<f64>,
    /// Where between two frames of the camera the first place is, 0 to 1.
    pub phase: f64,
    /// Places left out without a trace, from 0.
    pub left_out_places: Vec<usize>,
    /// Places that show what the one before shows.
    pub filled_places: Vec<usize>,
    /// Rate of the stamps, Hz; `None`: that of the places.
    pub stamped_hz: Option<f64>,
    /// What stamps are cut to, s; `None`: they are as fine as the container's.
    pub stamp_step_s: Option<f64>,
}

/// The shadow of the ball on a wall behind it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneWallShadow {
    /// From the ball's centre (right, down), px.
    pub offset_px: Vector2<f64>,
    /// How much darker the wall is in it, grey.
    pub depth_grey: f64,
    /// Standard deviation of its soft edge, px.
    pub blur_px: f64,
}

/// What the picture looks like.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneLook {
    /// Behind the ball, grey.
    pub background_grey: f64,
    /// Below the floor line of a side view, grey.
    pub floor_grey: f64,
    /// The ball where it is brightest, without highlight, grey.
    pub ball_grey: f64,
    /// 0 flat, 1 black on the side away from the light.
    pub shading: f64,
    /// Height of the specular highlight, grey.
    pub highlight_grey: f64,
    /// Chroma [U, V] of the ball where it is brightest, from that of grey, code values.
    pub ball_colour: [f64; 2],
    /// The same behind the ball.
    pub background_colour: [f64; 2],
    /// The same below the floor line.
    pub floor_colour: [f64; 2],
    /// Standard deviation of the background's texture, grey.
    pub texture_grey: f64,
    /// Share of the ball's light that the floor mirrors.
    pub reflection: f64,
    /// Darkening of the floor right below a ball that touches it.
    pub shadow: f64,
    /// What the ball throws on the wall behind it.
    pub wall_shadow: Option<SceneWallShadow>,
    /// Fall of the light from the brightest to the darkest corner, as a share.
    pub unevenness: f64,
    /// Relative amplitude of the light's flicker.
    pub flicker: f64,
    /// Its frequency, Hz.
    pub flicker_hz: f64,
    /// What is drawn on the ball.
    pub marks: Option<BallMarks>,
}

impl SceneLook {
    /// Whether something in it is not grey.
    #[must_use]
    pub fn is_coloured(&self) -> bool {
        let colours = [self.ball_colour, self.background_colour, self.floor_colour];
        colours.as_flattened().iter().any(|c| *c != 0.0)
    }
}

/// When the recording ends: `tail_s` after impact number `bounces`, or after the ball has come to rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stop {
    /// Impacts.
    pub bounces: usize,
    /// After the last of them, s.
    pub tail_s: f64,
}

/// Whether to simulate an effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Switch {
    /// Where its estimate exceeds the tolerance.
    Auto,
    /// Yes.
    On,
    /// No.
    Off,
}

/// Which effects to simulate: one switch for all, and exceptions by name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EffectsChoice {
    /// For effects without an entry in `named`.
    pub default: Switch,
    /// Exceptions.
    pub named: BTreeMap<String, Switch>,
}

impl EffectsChoice {
    /// The same switch for all.
    #[must_use]
    pub fn all(default: Switch) -> Self {
        Self {
            default,
            named: BTreeMap::new(),
        }
    }

    /// The switch of the effect `name`.
    #[must_use]
    pub fn of(&self, name: &str) -> Switch {
        self.named.get(name).copied().unwrap_or(self.default)
    }
}

/// Bounds that keep a scene renderable.
const MOST_BOUNCES: u64 = 1000;
const LONGEST_TAIL_S: f64 = 60.0;
const LONGEST_BENCH_S: f64 = 60.0;
const STEEPEST_FLOOR_DEG: f64 = 20.0;
const LARGEST_ROLL_DEG: f64 = 45.0;
const LARGEST_BUMP_PX: f64 = 500.0;
const LARGEST_PICTURE_PX: f64 = 8192.0;
const LARGEST_RADIUS_PX: f64 = 500.0;
const LARGEST_BLUR_PX: f64 = 50.0;

/// A scene, for messages about a file.
static KIND: FileKind = FileKind {
    what: "scene",
    form: "one JSON object as in fixtures/scenes",
    source: "samples are in the folder fixtures/scenes",
    least: "{\"schema\": \"track.scene/1\", \"contact\": {\"model\": \"mu_e\", \"restitution\": 0.8, \"friction\": 0.1}}",
};
/// No scene comes near it; a video named by mistake does.
const LARGEST_FILE_BYTES: u64 = 1_000_000;

// POSITIVE and FINITE are those of the calibration, which is written beside the recording and has to be accepted.
const NOT_NEGATIVE: NumberRange = NumberRange {
    accepted: "0 or a positive number (to 1e15)",
    holds: |x| (0.0..=1e15).contains(&x),
    hint: "give 0 to leave it out",
};
const CHROMA: NumberRange = NumberRange {
    accepted: "numbers from -127 to 127",
    holds: |x| (-127.0..=127.0).contains(&x),
    hint: "chroma U and V from that of grey, which is [0, 0]; a green ball has about [-40, -45]",
};
const FACTOR: NumberRange = NumberRange {
    accepted: "a number from 0 to 10",
    holds: |x| (0.0..=10.0).contains(&x),
    hint: "1 is the law as it stands",
};
const FRACTION: NumberRange = NumberRange {
    accepted: "a number from 0 to 1",
    holds: |x| (0.0..=1.0).contains(&x),
    hint: "a coefficient of restitution or a share cannot exceed 1: no rebound gains energy",
};
pub(super) const GREY: NumberRange = NumberRange {
    accepted: "a grey level from 0 to 255",
    holds: |x| (0.0..=255.0).contains(&x),
    hint: "0 is black, 255 white",
};
const EVEN_SIDE: NumberRange = NumberRange {
    accepted: "an even whole number from 16 to 8192",
    // Even, because H.264 stores colour for two by two pixels.
    holds: |x| (16.0..=LARGEST_PICTURE_PX).contains(&x) && x % 2.0 == 0.0,
    hint: "give [columns, rows]",
};
const TILT_DEG: NumberRange = NumberRange {
    accepted: "a number from -80 to 80",
    holds: |x| (-80.0..=80.0).contains(&x),
    hint: "0 looks at the plane squarely",
};
const PITCH_DEG: NumberRange = NumberRange {
    accepted: "a number from -60 to 60",
    holds: |x| (-60.0..=60.0).contains(&x),
    hint: "0 looks at the plane squarely; above 0 the camera looks down",
};
const AZIMUTH_DEG: NumberRange = NumberRange {
    accepted: "a number from -60 to 60",
    holds: |x| (-60.0..=60.0).contains(&x),
    hint: "0 moves in the calibrated plane; above 0 the ball comes nearer to the camera",
};
const ROLL_DEG: NumberRange = NumberRange {
    accepted: "a number from -45 to 45",
    holds: |x| (-LARGEST_ROLL_DEG..=LARGEST_ROLL_DEG).contains(&x),
    hint: "0 has up upright in the picture; above 0 it leans to the right",
};
const BLUR: NumberRange = NumberRange {
    accepted: "a number from 0 to 50",
    holds: |x| (0.0..=LARGEST_BLUR_PX).contains(&x),
    hint: "it is the standard deviation; lenses have some 0.5 to 3 px",
};
const BUMP: NumberRange = NumberRange {
    accepted: "from -500 to 500",
    holds: |x| (-LARGEST_BUMP_PX..=LARGEST_BUMP_PX).contains(&x),
    hint: "give [right, down] in px; tables swing by some 0.1 to 5 px",
};
const PAN: NumberRange = NumberRange {
    accepted: "from -10000 to 10000",
    holds: |x| (-10_000.0..=10_000.0).contains(&x),
    hint: "give [right, down] in px/s of the picture, which moves against the camera",
};
const WANDER: NumberRange = NumberRange {
    accepted: "a number from 0 to 500",
    holds: |x| (0.0..=LARGEST_BUMP_PX).contains(&x),
    hint: "it is the standard deviation; hands have some 1 to 10 px",
};
const PHASE: NumberRange = NumberRange {
    accepted: "a number from 0 up to below 1",
    holds: |x| (0.0..1.0).contains(&x),
    hint: "it is a share of a frame",
};
const TAIL: NumberRange = NumberRange {
    accepted: "a number from 0 to 60",
    holds: |x| (0.0..=LONGEST_TAIL_S).contains(&x),
    hint: "ask for more bounces instead",
};
const SLOPE_DEG: NumberRange = NumberRange {
    accepted: "a number from -20 to 20",
    holds: |x| (-STEEPEST_FLOOR_DEG..=STEEPEST_FLOOR_DEG).contains(&x),
    hint: "0 is level; above 0 the floor rises along the launch",
};
const BENCH_SEEN: NumberRange = NumberRange {
    accepted: "a number above 0, at most 60",
    holds: |x| x > 0.0 && x <= LONGEST_BENCH_S,
    hint: "give null for launch.bench where the ball is not seen before the launch",
};

impl Scene {
    /// Reads a scene file.
    ///
    /// # Errors
    /// As [`Scene::from_json`], and where the file cannot be read.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        let bytes = read_bytes(path, &KIND, LARGEST_FILE_BYTES)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        Self::from_bytes(&bytes, &path.display().to_string(), folder)
    }

    /// Reads a scene; files that it names are relative to the working directory.
    ///
    /// # Errors
    /// All that is wrong: for each problem the key, what was found, what is accepted and what to try.
    pub fn from_json(text: &str) -> Result<Self, SceneError> {
        Self::from_bytes(text.as_bytes(), "scene", Path::new(""))
    }

    fn from_bytes(bytes: &[u8], name: &str, folder: &Path) -> Result<Self, SceneError> {
        let document = Document::from_bytes(bytes, name, &KIND, |_| None)?;
        let scene = read_scene(&document.top(&TOP_KEYS), folder);
        // What several keys get wrong together shows only where each of them is right.
        let problems = match (scene, document.problems.into_vec()) {
            (Some(scene), problems) if problems.is_empty() => match scene.problems_together() {
                none if none.is_empty() => return Ok(scene),
                problems => problems,
            },
            (_, problems) => problems,
        };
        Err(SceneError::File(FileError::Invalid {
            name: name.to_owned(),
            problems,
        }))
    }

    /// That the ball is not pressed flat: Hertz's law is for small dents, δ = (15 m v² / (16 E* √R))^(2/5) (Johnson 1985, 11.1),
    /// and beyond δ = R there is no ball left to have one.
    fn pressed_flat(&self) -> Option<FileProblem> {
        if self.effects.of("contact_time") == Switch::Off {
            return None;
        }
        // Along the floor's normal.
        let (launch, floor) = (&self.launch, effects::Plane::sloping(self.floor.slope_rad));
        let velocity_m_s = Vector3::new(launch.speed_m_s, 0.0, launch.rise_speed_m_s);
        let fall_m = floor.clearance_m(0.0, launch.drop_height_m, self.ball.radius_m);
        let squared = floor.along_normal(&velocity_m_s).powi(2)
            + 2.0 * floor.gravity_towards(self.gravity_m_s2) * fall_m;
        let least_pa = 15.0 * self.ball.mass_kg * squared / (16.0 * self.ball.radius_m.powi(3));
        if self.ball.contact_modulus_pa > least_pa {
            return None;
        }
        Some(FileProblem::new(
            "ball.contact_modulus_pa",
            format!(
                "{:e}, with which the ball is pressed flat",
                self.ball.contact_modulus_pa
            ),
            format!("above {least_pa:.3e} for this mass, size and fall"),
            "7e10 is steel on glass, 1e7 a superball; or switch effects.contact_time off",
        ))
    }

    /// That a sloping floor is below the ball at the launch and where it is first seen on its bench.
    fn in_the_floor(&self) -> Option<FileProblem> {
        let floor = effects::Plane::sloping(self.floor.slope_rad);
        let (launch, radius_m) = (&self.launch, self.ball.radius_m);
        if floor.is_level() {
            return None;
        }
        let seen_s = launch.bench.map_or(0.0, |bench| bench.seen_s);
        let lowest = |x_m: f64| floor.clearance_m(x_m, launch.drop_height_m, radius_m);
        let gap_m = lowest(0.0).min(lowest(-launch.speed_m_s * seen_s));
        if gap_m > 0.0 {
            return None;
        }
        let least_m = launch.drop_height_m - gap_m / self.floor.slope_rad.cos();
        Some(FileProblem::new(
            "launch.drop_height_m",
            format!(
                "{}, in or on a floor that rises by {} degrees",
                launch.drop_height_m,
                self.floor.slope_rad.to_degrees()
            ),
            format!("above {least_m:.6}"),
            "raise it, or lower floor.slope_deg or launch.bench.seen_s",
        ))
    }

    /// A ball that lies on the floor and stays there.
    fn lies_on_floor(&self) -> Option<FileProblem> {
        (self.launch.drop_height_m == 0.0 && self.launch.rise_speed_m_s <= 0.0).then(|| {
            FileProblem::new(
                "launch.drop_height_m",
                "0 without a rise_speed_m_s",
                "a height above 0, or a rise_speed_m_s above 0",
                "a ball that lies on the floor never lands on it",
            )
        })
    }

    /// An exposure or a readout that takes longer than a frame.
    fn longer_than_a_frame(&self, key: &str, duration_s: f64) -> Option<FileProblem> {
        let interval_s = 1.0 / self.camera.frame_rate_hz;
        (duration_s > interval_s).then(|| {
            FileProblem::new(
                key,
                duration_s.to_string(),
                format!("at most 1 / frame_rate_hz = {interval_s:.6}"),
                "shorten it or lower the frame rate",
            )
        })
    }

    /// A file that has far more or far fewer places than the camera takes frames, or stamps that are the same.
    fn no_such_clock(&self, clock: &SceneClock) -> Option<FileProblem> {
        let rate_hz = self.camera.frame_rate_hz;
        let stored_hz = clock.stored_hz.unwrap_or(rate_hz);
        if !(0.01..=10.0).contains(&(stored_hz / rate_hz)) {
            return Some(FileProblem::new(
                "camera.clock.stored_hz",
                stored_hz.to_string(),
                format!("from a hundredth to ten times the frame rate of {rate_hz} Hz"),
                "it is how many frames a second the file has",
            ));
        }
        let interval_s = 1.0 / clock.stamped_hz(rate_hz);
        let step_s = clock.stamp_step_s.filter(|step_s| *step_s > interval_s)?;
        Some(FileProblem::new(
            "camera.clock.stamp_step_s",
            step_s.to_string(),
            format!("at most the time between two stamps, {interval_s:.6}"),
            "two frames cannot have the same stamp; 0.001 is what many containers have",
        ))
    }

    /// A second ball that is launched far outside the recording.
    fn flies_too_long(&self, second: &SceneSecondBall) -> Option<FileProblem> {
        (second.start_s.abs() > LONGEST_TAIL_S).then(|| {
            FileProblem::new(
                "second_ball.start_s",
                second.start_s.to_string(),
                format!("from -{LONGEST_TAIL_S} to {LONGEST_TAIL_S}"),
                "the recording begins at 0",
            )
        })
    }

    /// An azimuth in a top view, where x is what the picture says it is.
    fn seen_from_above_and_aside(&self) -> Option<FileProblem> {
        let turned = self.camera.view == View::Top && self.camera.motion_azimuth_rad != 0.0;
        turned.then(|| {
            FileProblem::new(
                "launch.azimuth_deg",
                self.camera.motion_azimuth_rad.to_degrees().to_string(),
                "0 in a top view",
                "it is how the ball nears a camera that looks from the side",
            )
        })
    }

    /// A ball that fills the picture.
    fn too_large(&self) -> Option<FileProblem> {
        let radius_px = self.ball.radius_m / self.camera.metres_per_pixel;
        (radius_px > LARGEST_RADIUS_PX).then(|| {
            let (found_px, most_px) = (2.0 * radius_px, 2.0 * LARGEST_RADIUS_PX);
            FileProblem::new(
                "camera.metres_per_pixel",
                format!("{}, a ball {found_px:.0} px across", self.camera.metres_per_pixel),
                format!("what makes the ball at most {most_px:.0} px across"),
                "check the units of ball.radius_m and camera.metres_per_pixel, both metres",
            )
        })
    }

    /// A ball that begins behind the camera.
    fn behind_camera(&self) -> Option<FileProblem> {
        let nearest_m = match self.camera.view {
            View::Side => self.camera.plane_offset_m.max(0.0) + self.ball.radius_m,
            View::Top => self.launch.drop_height_m + 2.0 * self.ball.radius_m,
        };
        let distance_m = self.camera.distance_m.filter(|d| *d <= nearest_m)?;
        Some(FileProblem::new(
            "camera.distance_m",
            distance_m.to_string(),
            format!("above {nearest_m:.3}, beyond the ball"),
            "move the camera away, or give null for one infinitely far",
        ))
    }

    /// What only several keys together can get wrong.
    fn problems_together(&self) -> Vec<FileProblem> {
        [
            self.launch.bench.and_then(|bench| self.falls_through(&bench)),
            self.launch.bench.and_then(|_| self.stays_on_bench()),
            self.lies_on_floor(),
            self.in_the_floor(),
            self.longer_than_a_frame("camera.exposure_s", self.camera.exposure_s),
            self.longer_than_a_frame("camera.readout_s", self.camera.readout_s),
            self.camera
                .clock
                .as_ref()
                .and_then(|clock| self.no_such_clock(clock)),
            self.second_ball.and_then(|second| self.flies_too_long(&second)),
            self.pressed_flat(),
            self.seen_from_above_and_aside(),
            self.too_large(),
            self.behind_camera(),
        ]
        .into_iter()
        .flatten()
        .collect()
    }

    /// A bench's track that is wider than the ball.
    fn falls_through(&self, bench: &SceneBench) -> Option<FileProblem> {
        let diameter_m = 2.0 * self.ball.radius_m;
        let width_m = bench.track_width_m.filter(|width_m| *width_m >= diameter_m)?;
        Some(FileProblem::new(
            "launch.bench.track_width_m",
            width_m.to_string(),
            format!("below the ball's diameter, {diameter_m}"),
            "a wider track lets the ball through; give null for a plane bench",
        ))
    }

    /// A ball on a bench that does not move along it and fly off its end: it presses on the edge with m (g − v²/R) while it
    /// is slow, and tips round it.
    fn stays_on_bench(&self) -> Option<FileProblem> {
        let launch = &self.launch;
        if launch.rise_speed_m_s != 0.0 {
            return Some(FileProblem::new(
                "launch.rise_speed_m_s",
                launch.rise_speed_m_s.to_string(),
                "0 with a launch.bench, which is level",
                "remove it, or give null for launch.bench",
            ));
        }
        let speed_m_s = launch.speed_m_s;
        let least_m_s = (self.gravity_m_s2 * self.ball.radius_m).sqrt();
        if speed_m_s > 0.0 && speed_m_s >= least_m_s {
            return None;
        }
        Some(FileProblem::new(
            "launch.speed_m_s",
            format!("{speed_m_s}, so slow that the ball tips round the edge of launch.bench"),
            format!("above sqrt(g R) = {least_m_s:.4}"),
            "raise it, or give null for launch.bench",
        ))
    }
}

const TOP_KEYS: [&str; 15] = [
    "schema",
    "seed",
    "gravity_m_s2",
    "ball",
    "contact",
    "floor",
    "launch",
    "air",
    "second_ball",
    "camera",
    "look",
    "stop",
    "tolerance_px",
    "tolerance_grey",
    "effects",
];

/// The scene, with defaults in place of what is wrong; `None` without a contact. Files that it names are relative to `folder`.
fn read_scene(top: &Section<'_>, folder: &Path) -> Option<Scene> {
    check_schema(top);
    let contact = read_contact(top);
    let ball = read_ball(top);
    let (launch, motion_azimuth_rad) = read_launch(top, &ball);
    let seed = top.whole("seed", 0..=u64::MAX).unwrap_or(1);
    let look = read_look(top, &MarkDrawing { seed, folder });
    Some(Scene {
        seed,
        gravity_m_s2: top.number("gravity_m_s2", POSITIVE).unwrap_or(9.81),
        ball,
        floor: read_floor(top),
        launch,
        air: read_air(top),
        second_ball: read_second_ball(top, &ball, &look),
        camera: Camera {
            motion_azimuth_rad,
            ..read_camera(top)
        },
        look,
        stop: read_stop(top),
        tolerance_px: top.number("tolerance_px", POSITIVE).unwrap_or(0.02),
        tolerance_grey: top.number("tolerance_grey", POSITIVE).unwrap_or(0.5),
        effects: read_effects(top),
        // Last, so that all other problems are noted where it is missing.
        contact: contact?,
    })
}

fn check_schema(top: &Section<'_>) {
    if top.get("schema").and_then(Value::as_str) != Some(SCHEMA) {
        top.refuse_value(
            "schema",
            format!("{SCHEMA:?}"),
            "this version of track reads that schema: begin the file with it",
        );
    }
}

fn read_ball(top: &Section<'_>) -> SceneBall {
    let keys = [
        "radius_m",
        "mass_kg",
        "inertia_factor",
        "contact_modulus_pa",
        "drag_factor",
        "lift_factor",
    ];
    let s = top.section_or_empty("ball", &keys);
    SceneBall {
        radius_m: s.number("radius_m", POSITIVE).unwrap_or(0.0125),
        mass_kg: s.number("mass_kg", POSITIVE).unwrap_or(0.0639),
        inertia_factor: s.number("inertia_factor", INERTIA).unwrap_or(0.4),
        contact_modulus_pa: s.number("contact_modulus_pa", POSITIVE).unwrap_or(7e10),
        drag_factor: s.number("drag_factor", FACTOR).unwrap_or(1.0),
        lift_factor: s.number("lift_factor", FACTOR).unwrap_or(1.0),
    }
}

fn read_contact(top: &Section<'_>) -> Option<Contact> {
    let choices = ModelName::ALL.map(|name| (name.name(), name));
    let Some(Value::Object(keys)) = top.get("contact") else {
        let names = choices.map(|(name, _)| format!("\"{name}\""));
        top.refuse_value(
            "contact",
            format!("{{\"model\": {}, \"restitution\": ..., ...}}", names.join(" | ")),
            "say what the floor does to the ball: it has no default",
        );
        return None;
    };
    // Which keys it may have depends on the model.
    let unchecked = top.inner("contact", keys);
    let name = match unchecked.get("model") {
        None => choices[0].1,
        Some(_) => unchecked.choice("model", &choices, "take one of these words")?,
    };
    let coefficients = name.facts().coefficients;
    let own = coefficients.iter().map(|c| c.key);
    let s = top.section("contact", &["model"].into_iter().chain(own).collect::<Vec<_>>())?;
    let mut values: Vec<Option<f64>> = Vec::new();
    for coefficient in coefficients {
        let (key, range) = (coefficient.key, coefficient.range);
        let same_as = coefficients
            .iter()
            .position(|other| Some(other.key) == coefficient.same_as);
        values.push(match same_as {
            Some(place) => s.number(key, range).or(values[place]),
            None => s.required_number(key, range),
        });
    }
    let values: Vec<f64> = values.into_iter().collect::<Option<_>>()?;
    let contradiction = match name.with_coefficients(&values) {
        Ok(contact) => return Some(contact),
        Err(contradiction) => contradiction,
    };
    let place = coefficients.iter().position(|c| c.key == contradiction.key);
    s.refuse(
        s.key(contradiction.key),
        place.map_or_else(String::new, |place| values[place].to_string()),
        contradiction.accepted,
        contradiction.hint,
    );
    None
}

fn read_floor(top: &Section<'_>) -> SceneFloor {
    let s = top.section_or_empty("floor", &["slope_deg"]);
    SceneFloor {
        slope_rad: s.number("slope_deg", SLOPE_DEG).unwrap_or(0.0).to_radians(),
    }
}

/// The launch, and how its plane is turned from the calibrated one, rad.
fn read_launch(top: &Section<'_>, ball: &SceneBall) -> (SceneLaunch, f64) {
    let keys = [
        "drop_height_m",
        "speed_m_s",
        "azimuth_deg",
        "spin_ratio",
        "spin_rad_s",
        "rise_speed_m_s",
        "bench",
    ];
    let s = top.section_or_empty("launch", &keys);
    let bench = read_bench(&s);
    let rolling = bench.map_or(0.0, |bench| bench.rolling_ratio(ball.radius_m));
    let azimuth_rad = s.number("azimuth_deg", AZIMUTH_DEG).unwrap_or(0.0).to_radians();
    let speed_m_s = s.number("speed_m_s", NOT_NEGATIVE).unwrap_or(1.0);
    let spin = |key: &str| s.numbers(key, FINITE, "a list of 3 numbers").map(Vector3::from);
    let surface_spin_m_s = match (spin("spin_ratio"), spin("spin_rad_s")) {
        (Some(_), Some(_)) => {
            let accepted = "one of spin_ratio and spin_rad_s";
            s.refuse_value("spin_rad_s", accepted, "remove the other: they say the same");
            Vector3::zeros()
        }
        (None, Some(rad_s)) => rad_s * ball.radius_m,
        (ratio, None) => ratio.unwrap_or(Vector3::y() * rolling) * speed_m_s,
    };
    let launch = SceneLaunch {
        drop_height_m: s.number("drop_height_m", NOT_NEGATIVE).unwrap_or(0.10),
        speed_m_s,
        surface_spin_m_s,
        rise_speed_m_s: s.number("rise_speed_m_s", FINITE).unwrap_or(0.0),
        bench,
    };
    (launch, azimuth_rad)
}

impl SceneLaunch {
    /// ω of a ball of `radius_m`, rad/s.
    #[must_use]
    pub fn spin_rad_s(&self, radius_m: f64) -> Vector3<f64> {
        self.surface_spin_m_s / radius_m
    }
}

impl SceneBench {
    /// R ω_y / u_o of a ball of `radius_m` that rolls without slipping: on a track's edges it rolls on a smaller radius.
    fn rolling_ratio(&self, radius_m: f64) -> f64 {
        let half_share = self.track_width_m.unwrap_or(0.0) / (2.0 * radius_m);
        1.0 / (1.0 - half_share * half_share).sqrt()
    }
}

fn read_bench(launch: &Section<'_>) -> Option<SceneBench> {
    let s = launch.section("bench", &["seen_s", "track_width_m", "bench_grey"])?;
    Some(SceneBench {
        seen_s: s.number("seen_s", BENCH_SEEN).unwrap_or(0.15),
        track_width_m: s.number("track_width_m", POSITIVE),
        bench_grey: s.number("bench_grey", GREY),
    })
}

fn read_air(top: &Section<'_>) -> SceneAir {
    let s = top.section_or_empty("air", &["density_kg_m3", "viscosity_pa_s"]);
    SceneAir {
        density_kg_m3: s.number("density_kg_m3", NOT_NEGATIVE).unwrap_or(1.204),
        viscosity_pa_s: s.number("viscosity_pa_s", POSITIVE).unwrap_or(1.81e-5),
    }
}

fn read_camera(top: &Section<'_>) -> Camera {
    let keys = [
        "view",
        "image_size_px",
        "frame_rate_hz",
        "exposure_s",
        "metres_per_pixel",
        "origin_px",
        "distance_m",
        "plane_offset_m",
        "tilt_deg",
        "pitch_deg",
        "roll_deg",
        "bump",
        "pan",
        "clock",
        "lens",
        "readout_s",
        "blur_px",
        "noise_grey",
        "electrons_per_grey",
        "codec",
        "crf",
        "chroma_siting",
    ];
    let s = top.section_or_empty("camera", &keys);
    let [width_px, height_px] = s
        .numbers("image_size_px", EVEN_SIDE, "a list of 2 numbers")
        .unwrap_or([1280.0, 720.0]);
    let crf = s.whole("crf", 0..=51).unwrap_or(14);
    let lens = read_lens(&s);
    let metres_per_pixel = s.number("metres_per_pixel", POSITIVE).unwrap_or(0.0008);
    let words = "take one of these words";
    let views = [("side", View::Side), ("top", View::Top)];
    let lossless = s.choice("codec", &[("h264", false), ("lossless", true)], words);
    let [tilt_rad, pitch_rad, roll_rad] = [
        ("tilt_deg", TILT_DEG),
        ("pitch_deg", PITCH_DEG),
        ("roll_deg", ROLL_DEG),
    ]
    .map(|(key, range)| s.number(key, range).unwrap_or(0.0).to_radians());
    Camera {
        view: s.choice("view", &views, words).unwrap_or(View::Side),
        // Checked above: whole, and far inside usize.
        width_px: width_px as usize,
        height_px: height_px as usize,
        frame_rate_hz: s.number("frame_rate_hz", POSITIVE).unwrap_or(240.0),
        exposure_s: s.number("exposure_s", NOT_NEGATIVE).unwrap_or(0.0005),
        metres_per_pixel,
        origin_px: s
            .numbers("origin_px", FINITE, "a list of 2 numbers")
            .unwrap_or([120.0, 660.0]),
        distance_m: s
            .number("distance_m", POSITIVE)
            .or(lens.map(|l| l.focal_px() * metres_per_pixel)),
        plane_offset_m: s.number("plane_offset_m", FINITE).unwrap_or(0.0),
        tilt_rad,
        pitch_rad,
        motion_azimuth_rad: 0.0,
        roll_rad,
        bump: read_bump(&s),
        pan: read_pan(&s),
        clock: read_clock(&s),
        lens,
        readout_s: s.number("readout_s", NOT_NEGATIVE).unwrap_or(0.0),
        blur_px: s.number("blur_px", BLUR).unwrap_or(0.7),
        noise_grey: s.number("noise_grey", NOT_NEGATIVE).unwrap_or(2.0),
        electrons_per_grey: s.number("electrons_per_grey", POSITIVE),
        codec: if lossless == Some(true) {
            Codec::Lossless
        } else {
            Codec::H264 { crf: crf as u8 }
        },
        chroma_siting: {
            let sitings = [("left", ChromaSiting::Left), ("centre", ChromaSiting::Centre)];
            s.choice("chroma_siting", &sitings, words).unwrap_or_default()
        },
    }
}

fn read_bump(camera: &Section<'_>) -> Option<SceneBump> {
    let s = camera.section("bump", &["amplitude_px", "frequency_hz", "decay_s"])?;
    let amplitude_px = s.required_numbers("amplitude_px", BUMP, "a list of 2 numbers");
    let frequency_hz = s.number("frequency_hz", POSITIVE).unwrap_or(20.0);
    let decay_s = s.number("decay_s", POSITIVE).unwrap_or(0.015);
    Some(SceneBump {
        amplitude_px: Vector2::from(amplitude_px?),
        frequency_hz,
        decay_s,
    })
}

fn read_pan(camera: &Section<'_>) -> Option<ScenePan> {
    let s = camera.section("pan", &["velocity_px_s", "wander_px"])?;
    let velocity_px_s = s.numbers("velocity_px_s", PAN, "a list of 2 numbers");
    Some(ScenePan {
        velocity_px_s: Vector2::from(velocity_px_s.unwrap_or([0.0; 2])),
        wander_px: s.number("wander_px", WANDER).unwrap_or(0.0),
    })
}

fn read_clock(camera: &Section<'_>) -> Option<SceneClock> {
    let keys = [
        "stored_hz",
        "phase",
        "left_out_places",
        "filled_places",
        "stamped_hz",
        "stamp_step_s",
    ];
    let s = camera.section("clock", &keys)?;
    let places = |key: &str| -> Vec<usize> {
        let Some(value) = s.get(key) else {
            return Vec::new();
        };
        let whole = |x: &Value| x.as_u64().and_then(|n| usize::try_from(n).ok());
        let list = value
            .as_array()
            .map(|list| list.iter().map(whole).collect::<Option<_>>());
        list.flatten().unwrap_or_else(|| {
            let hint = "number the frames of the file before any is left out";
            s.refuse_value(key, "a list of whole numbers from 0", hint);
            Vec::new()
        })
    };
    Some(SceneClock {
        stored_hz: s.number("stored_hz", POSITIVE),
        phase: s.number("phase", PHASE).unwrap_or(0.0),
        left_out_places: places("left_out_places"),
        filled_places: places("filled_places"),
        stamped_hz: s.number("stamped_hz", POSITIVE),
        stamp_step_s: s.number("stamp_step_s", POSITIVE),
    })
}

fn read_second_ball(top: &Section<'_>, ball: &SceneBall, look: &SceneLook) -> Option<SceneSecondBall> {
    let keys = [
        "start_s",
        "x_m",
        "drop_height_m",
        "speed_m_s",
        "rise_speed_m_s",
        "radius_m",
        "ball_grey",
    ];
    let s = top.section("second_ball", &keys)?;
    let number = |key: &str| s.number(key, FINITE).unwrap_or(0.0);
    Some(SceneSecondBall {
        start_s: number("start_s"),
        x_m: number("x_m"),
        drop_height_m: s.number("drop_height_m", POSITIVE).unwrap_or(0.10),
        speed_m_s: number("speed_m_s"),
        rise_speed_m_s: number("rise_speed_m_s"),
        radius_m: s.number("radius_m", POSITIVE).unwrap_or(ball.radius_m),
        ball_grey: s.number("ball_grey", GREY).unwrap_or(look.ball_grey),
    })
}

fn read_wall_shadow(look: &Section<'_>) -> Option<SceneWallShadow> {
    let s = look.section("wall_shadow", &["offset_px", "depth_grey", "blur_px"])?;
    let offset_px = s.required_numbers("offset_px", BUMP, "a list of 2 numbers");
    Some(SceneWallShadow {
        offset_px: Vector2::from(offset_px?),
        depth_grey: s.number("depth_grey", GREY).unwrap_or(20.0),
        blur_px: s.number("blur_px", BLUR).unwrap_or(2.0),
    })
}

fn read_lens(camera: &Section<'_>) -> Option<SceneLens> {
    let s = camera.section("lens", &["camera_matrix", "distortion"])?;
    let distortion = s
        .numbers("distortion", FINITE, "a list of 5 numbers")
        .unwrap_or([0.0; 5]);
    let element = |x: &Value| x.as_f64();
    let matrix = s
        .get("camera_matrix")
        .and_then(|value| array::<_, 3>(value, |row| array::<_, 3>(row, element)));
    let sound = |m: &[[f64; 3]; 3]| {
        let [[fx, skew, _], [zero, fy, _], bottom] = *m;
        fx > 0.0 && fy > 0.0 && skew == 0.0 && zero == 0.0 && bottom == [0.0, 0.0, 1.0]
    };
    let Some(camera_matrix) = matrix.filter(sound) else {
        s.refuse_value(
            "camera_matrix",
            "[[fx, 0, cx], [0, fy, cy], [0, 0, 1]] with fx, fy above 0, px",
            "copy it from a calib.json",
        );
        return None;
    };
    Some(SceneLens {
        camera_matrix,
        distortion,
    })
}

fn read_look(top: &Section<'_>, drawing: &MarkDrawing<'_>) -> SceneLook {
    let keys = [
        "background_grey",
        "floor_grey",
        "ball_grey",
        "ball_colour",
        "background_colour",
        "floor_colour",
        "shading",
        "highlight_grey",
        "texture_grey",
        "reflection",
        "shadow",
        "wall_shadow",
        "unevenness",
        "flicker",
        "flicker_hz",
        "marks",
    ];
    let s = top.section_or_empty("look", &keys);
    let shading = s.number("shading", FRACTION).unwrap_or(0.5);
    let background_grey = s.number("background_grey", GREY).unwrap_or(60.0);
    let ball_grey = s.number("ball_grey", GREY).unwrap_or(200.0);
    let share = |key: &str| s.number(key, FRACTION).unwrap_or(0.0);
    let colour = |key: &str| s.numbers(key, CHROMA, "a list of 2 numbers");
    let background_colour = colour("background_colour").unwrap_or([0.0; 2]);
    SceneLook {
        background_grey,
        floor_grey: s.number("floor_grey", GREY).unwrap_or(background_grey),
        ball_grey,
        ball_colour: colour("ball_colour").unwrap_or([0.0; 2]),
        background_colour,
        floor_colour: colour("floor_colour").unwrap_or(background_colour),
        shading,
        // A flat ball has no highlight; a shaded one looks painted without it.
        highlight_grey: s.number("highlight_grey", GREY).unwrap_or(80.0 * shading),
        texture_grey: s.number("texture_grey", GREY).unwrap_or(0.0),
        reflection: share("reflection"),
        shadow: share("shadow"),
        wall_shadow: read_wall_shadow(&s),
        unevenness: share("unevenness"),
        flicker: share("flicker"),
        flicker_hz: s.number("flicker_hz", POSITIVE).unwrap_or(100.0),
        marks: read_marks(&s, ball_grey, drawing),
    }
}

fn read_stop(top: &Section<'_>) -> Stop {
    let s = top.section_or_empty("stop", &["bounces", "tail_s"]);
    Stop {
        bounces: s.whole("bounces", 1..=MOST_BOUNCES).unwrap_or(2) as usize,
        tail_s: s.number("tail_s", TAIL).unwrap_or(0.05),
    }
}

fn read_effects(top: &Section<'_>) -> EffectsChoice {
    let names = effects::names();
    let automatic = EffectsChoice::all(Switch::Auto);
    match top.get("effects") {
        None => automatic,
        Some(Value::Object(_)) => {
            let s = top.section_or_empty("effects", &names);
            let words = [("auto", Switch::Auto), ("on", Switch::On), ("off", Switch::Off)];
            let switch = |name: &&str| s.choice(name, &words, "take one of these words");
            let named = names
                .iter()
                .filter_map(|name| Some(((*name).to_owned(), switch(name)?)))
                .collect();
            EffectsChoice { named, ..automatic }
        }
        Some(value) => {
            let word = value.as_str().unwrap_or_default();
            parse_effects_word(word).unwrap_or_else(|| {
                let hint = nearest(word, ["auto", "all", "none"], Closeness::Guess).map_or_else(
                    || format!("known effects: {}", names.join(", ")),
                    |n| format!("did you mean {n:?}?"),
                );
                let accepted = "\"auto\", \"all\", \"none\" or {\"<effect>\": \"on\" | \"off\" | \"auto\"}";
                top.refuse_value("effects", accepted, hint);
                automatic
            })
        }
    }
}

/// `auto`, `all` or `none`, as the scene and `--effects` say it.
#[must_use]
fn parse_effects_word(word: &str) -> Option<EffectsChoice> {
    match word {
        "auto" => Some(EffectsChoice::all(Switch::Auto)),
        "all" => Some(EffectsChoice::all(Switch::On)),
        "none" => Some(EffectsChoice::all(Switch::Off)),
        _ => None,
    }
}
