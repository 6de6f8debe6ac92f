//! A scene: a ball, a floor, a launch, a camera. The JSON of `contract.md`, checked.

use super::effects;
use super::reader::{ANY, FACTOR, FRACTION, GREY, NOT_NEGATIVE, POSITIVE, Section, nearest, shown};
use crate::calibration::INERTIA;
pub use crate::calibration::View;
use crate::rebound::{Contact, ModelName};
use nalgebra::{Vector2, Vector3};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// The schema this program reads.
pub const SCHEMA: &str = "track.scene/1";

/// What can be wrong with a scene.
#[derive(Debug, Error)]
pub enum SceneError {
    /// The file could not be read.
    #[error("scene {}: cannot be read; give the path of a scene file", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is not JSON.
    #[error("scene: not valid JSON at line {}, column {}; compare it with the example in the README", source.line(), source.column())]
    NotJson {
        /// Where and why.
        #[from]
        source: serde_json::Error,
    },
    /// A key that no scene has.
    #[error("scene: unknown key {key:?}{}; known here: {known}", nearest.as_ref().map_or(String::new(), |n| format!(", did you mean {n:?}?")))]
    UnknownKey {
        /// Dotted name.
        key: String,
        /// The nearest known key.
        nearest: Option<String>,
        /// All known keys of that object.
        known: String,
    },
    /// A key that every scene must have.
    #[error("scene: {key} is missing; accepted: {accepted}; add it")]
    Missing {
        /// Dotted name.
        key: String,
        /// What it may be.
        accepted: String,
    },
    /// A value that makes no sense.
    #[error("scene: {key} is {found}; accepted: {accepted}; {hint}")]
    Invalid {
        /// Dotted name.
        key: String,
        /// The value.
        found: String,
        /// What it may be.
        accepted: String,
        /// What to try.
        hint: String,
    },
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
    /// R ω / u_o about x, y, z.
    pub spin_ratio: [f64; 3],
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
    /// Angle by which the camera is rolled about its optical axis, rad: above 0 the world's "up" leans to the right in the
    /// picture. Said of the picture without it: `origin_px`.
    pub roll_rad: f64,
    /// How it swings with the table after an impact.
    pub bump: Option<SceneBump>,
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
    /// Standard deviation of the background's texture, grey.
    pub texture_grey: f64,
    /// Share of the ball's light that the floor mirrors.
    pub reflection: f64,
    /// Darkening of the floor right below a ball that touches it.
    pub shadow: f64,
    /// Fall of the light from the brightest to the darkest corner, as a share.
    pub unevenness: f64,
    /// Relative amplitude of the light's flicker.
    pub flicker: f64,
    /// Its frequency, Hz.
    pub flicker_hz: f64,
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

impl Scene {
    /// Reads a scene file.
    ///
    /// # Errors
    /// As [`Scene::from_json`], and where the file cannot be read.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        let text = std::fs::read_to_string(path).map_err(|source| SceneError::Unreadable {
            path: path.to_owned(),
            source,
        })?;
        Self::from_json(&text)
    }

    /// Reads a scene.
    ///
    /// # Errors
    /// Names the key, what was found, what is accepted and what to try.
    pub fn from_json(text: &str) -> Result<Self, SceneError> {
        let value: Value = serde_json::from_str(text)?;
        let root = Section::root(
            &value,
            &[
                "schema",
                "seed",
                "gravity_m_s2",
                "ball",
                "contact",
                "floor",
                "launch",
                "air",
                "camera",
                "look",
                "stop",
                "tolerance_px",
                "tolerance_grey",
                "effects",
            ],
        )?;
        check_schema(&root)?;
        let gravity_m_s2 = root.number("gravity_m_s2", 9.81, POSITIVE)?;
        let ball = read_ball(&root)?;
        let scene = Self {
            seed: root.whole("seed", 1, 0, u64::MAX)?,
            gravity_m_s2,
            ball,
            contact: read_contact(&root)?,
            floor: read_floor(&root)?,
            launch: read_launch(&root, &ball, gravity_m_s2)?,
            air: read_air(&root)?,
            camera: read_camera(&root)?,
            look: read_look(&root)?,
            stop: read_stop(&root)?,
            tolerance_px: root.number("tolerance_px", 0.02, POSITIVE)?,
            tolerance_grey: root.number("tolerance_grey", 0.5, POSITIVE)?,
            effects: read_effects(&root)?,
        };
        scene.check_together()?;
        Ok(scene)
    }

    /// That the ball is not pressed flat: Hertz's law is for small dents, δ = (15 m v² / (16 E* √R))^(2/5) (Johnson 1985, 11.1),
    /// and beyond δ = R there is no ball left to have one.
    fn check_contact(&self) -> Result<(), SceneError> {
        if self.effects.of("contact_time") == Switch::Off {
            return Ok(());
        }
        // Along the floor's normal.
        let (launch, floor) = (&self.launch, effects::Plane::sloping(self.floor.slope_rad));
        let velocity_m_s = Vector3::new(launch.speed_m_s, 0.0, launch.rise_speed_m_s);
        let fall_m = floor.clearance_m(0.0, launch.drop_height_m, self.ball.radius_m);
        let squared = floor.along_normal(&velocity_m_s).powi(2)
            + 2.0 * floor.gravity_towards(self.gravity_m_s2) * fall_m;
        let least_pa = 15.0 * self.ball.mass_kg * squared / (16.0 * self.ball.radius_m.powi(3));
        if self.ball.contact_modulus_pa > least_pa {
            return Ok(());
        }
        Err(SceneError::Invalid {
            key: "ball.contact_modulus_pa".into(),
            found: format!(
                "{:e}, with which the ball is pressed flat",
                self.ball.contact_modulus_pa
            ),
            accepted: format!("above {least_pa:.3e} for this mass, size and fall"),
            hint: "7e10 is steel on glass, 1e7 a superball; or switch effects.contact_time off".into(),
        })
    }

    /// That a sloping floor is below the ball at the launch and where it is first seen on its bench.
    fn check_above_floor(&self) -> Result<(), SceneError> {
        let floor = effects::Plane::sloping(self.floor.slope_rad);
        let (launch, radius_m) = (&self.launch, self.ball.radius_m);
        if floor.is_level() {
            return Ok(());
        }
        let seen_s = launch.bench.map_or(0.0, |bench| bench.seen_s);
        let lowest = |x_m: f64| floor.clearance_m(x_m, launch.drop_height_m, radius_m);
        let gap_m = lowest(0.0).min(lowest(-launch.speed_m_s * seen_s));
        if gap_m > 0.0 {
            return Ok(());
        }
        let least_m = launch.drop_height_m - gap_m / self.floor.slope_rad.cos();
        Err(SceneError::Invalid {
            key: "launch.drop_height_m".into(),
            found: format!(
                "{}, in or on a floor that rises by {} degrees",
                launch.drop_height_m,
                self.floor.slope_rad.to_degrees()
            ),
            accepted: format!("above {least_m:.6}"),
            hint: "raise it, or lower floor.slope_deg or launch.bench.seen_s".into(),
        })
    }

    /// What only several keys together can get wrong.
    fn check_together(&self) -> Result<(), SceneError> {
        if self.launch.drop_height_m == 0.0 && self.launch.rise_speed_m_s <= 0.0 {
            return Err(SceneError::Invalid {
                key: "launch.drop_height_m".into(),
                found: "0 without a rise_speed_m_s".into(),
                accepted: "a height above 0, or a rise_speed_m_s above 0".into(),
                hint: "a ball that lies on the floor never lands on it".into(),
            });
        }
        self.check_above_floor()?;
        let interval_s = 1.0 / self.camera.frame_rate_hz;
        let durations = [
            ("camera.exposure_s", self.camera.exposure_s),
            ("camera.readout_s", self.camera.readout_s),
        ];
        if let Some((key, found)) = durations.into_iter().find(|(_, s)| *s > interval_s) {
            return Err(SceneError::Invalid {
                key: key.into(),
                found: found.to_string(),
                accepted: format!("at most 1 / frame_rate_hz = {interval_s:.6}"),
                hint: "shorten it or lower the frame rate".into(),
            });
        }
        self.check_contact()?;
        let radius_px = self.ball.radius_m / self.camera.metres_per_pixel;
        if radius_px > LARGEST_RADIUS_PX {
            return Err(SceneError::Invalid {
                key: "camera.metres_per_pixel".into(),
                found: format!(
                    "{}, a ball {:.0} px across",
                    self.camera.metres_per_pixel,
                    2.0 * radius_px
                ),
                accepted: format!(
                    "what makes the ball at most {:.0} px across",
                    2.0 * LARGEST_RADIUS_PX
                ),
                hint: "check the units of ball.radius_m and camera.metres_per_pixel, both metres".into(),
            });
        }
        let nearest_m = match self.camera.view {
            View::Side => self.camera.plane_offset_m.max(0.0) + self.ball.radius_m,
            View::Top => self.launch.drop_height_m + 2.0 * self.ball.radius_m,
        };
        match self.camera.distance_m {
            Some(distance_m) if distance_m <= nearest_m => Err(SceneError::Invalid {
                key: "camera.distance_m".into(),
                found: distance_m.to_string(),
                accepted: format!("above {nearest_m:.3}, beyond the ball"),
                hint: "move the camera away, or give null for one infinitely far".into(),
            }),
            _ => Ok(()),
        }
    }
}

fn check_schema(root: &Section<'_>) -> Result<(), SceneError> {
    match root.get("schema") {
        Some(Value::String(s)) if s == SCHEMA => Ok(()),
        Some(other) => Err(root.invalid(
            "schema",
            other,
            &format!("{SCHEMA:?}"),
            "this program reads that version",
        )),
        None => Err(SceneError::Missing {
            key: "schema".into(),
            accepted: format!("{SCHEMA:?}"),
        }),
    }
}

fn read_ball(root: &Section<'_>) -> Result<SceneBall, SceneError> {
    let s = root.section(
        "ball",
        &[
            "radius_m",
            "mass_kg",
            "inertia_factor",
            "contact_modulus_pa",
            "drag_factor",
            "lift_factor",
        ],
    )?;
    Ok(SceneBall {
        radius_m: s.number("radius_m", 0.0125, POSITIVE)?,
        mass_kg: s.number("mass_kg", 0.0639, POSITIVE)?,
        inertia_factor: s.number(
            "inertia_factor",
            0.4,
            super::reader::NumberRange {
                words: INERTIA.accepted,
                test: INERTIA.holds,
                hint: "0.4 is a solid sphere, 0.667 a thin shell",
            },
        )?,
        contact_modulus_pa: s.number("contact_modulus_pa", 7e10, POSITIVE)?,
        drag_factor: s.number("drag_factor", 1.0, FACTOR)?,
        lift_factor: s.number("lift_factor", 1.0, FACTOR)?,
    })
}

fn read_contact(root: &Section<'_>) -> Result<Contact, SceneError> {
    let choices = ModelName::ALL.map(|name| (name.name(), name));
    if root.get("contact").is_none() {
        let names = choices.map(|(name, _)| format!("\"{name}\""));
        return Err(SceneError::Missing {
            key: "contact".into(),
            accepted: format!("{{\"model\": {}, \"restitution\": ..., ...}}", names.join(" | ")),
        });
    }
    let keys = |name: ModelName| name.facts().coefficients.iter().map(|c| c.key);
    let mut every_key = vec!["model"];
    for key in ModelName::ALL.into_iter().flat_map(keys) {
        if !every_key.contains(&key) {
            every_key.push(key);
        }
    }
    let name = root.section("contact", &every_key)?.choice("model", &choices)?;
    every_key.retain(|key| *key == "model" || keys(name).any(|own| own == *key));
    let s = root.section("contact", &every_key)?;
    let mut values: Vec<f64> = Vec::new();
    for coefficient in name.facts().coefficients {
        let accept = super::reader::NumberRange {
            words: coefficient.range.accepted,
            test: coefficient.range.holds,
            hint: coefficient.range.hint,
        };
        let same_as = coefficient
            .same_as
            .and_then(|other| keys(name).position(|key| key == other));
        values.push(match same_as {
            Some(place) => s.number(coefficient.key, values[place], accept)?,
            None => s.required_number(coefficient.key, accept)?,
        });
    }
    name.with_coefficients(&values)
        .map_err(|contradiction| SceneError::Invalid {
            key: s.name(contradiction.key),
            found: keys(name)
                .position(|key| key == contradiction.key)
                .map_or_else(String::new, |place| values[place].to_string()),
            accepted: contradiction.accepted,
            hint: contradiction.hint.into(),
        })
}

fn read_floor(root: &Section<'_>) -> Result<SceneFloor, SceneError> {
    let s = root.section("floor", &["slope_deg"])?;
    let slope_deg = s.number(
        "slope_deg",
        0.0,
        super::reader::NumberRange {
            words: "a number from -20 to 20",
            test: |x| (-STEEPEST_FLOOR_DEG..=STEEPEST_FLOOR_DEG).contains(&x),
            hint: "0 is level; above 0 the floor rises along the launch",
        },
    )?;
    Ok(SceneFloor {
        slope_rad: slope_deg.to_radians(),
    })
}

fn read_launch(root: &Section<'_>, ball: &SceneBall, gravity_m_s2: f64) -> Result<SceneLaunch, SceneError> {
    let s = root.section(
        "launch",
        &[
            "drop_height_m",
            "speed_m_s",
            "spin_ratio",
            "rise_speed_m_s",
            "bench",
        ],
    )?;
    let bench = read_bench(&s, ball.radius_m)?;
    let rolling = bench.map_or(0.0, |bench| bench.rolling_ratio(ball.radius_m));
    let launch = SceneLaunch {
        drop_height_m: s.number("drop_height_m", 0.10, NOT_NEGATIVE)?,
        speed_m_s: s.number("speed_m_s", 1.0, NOT_NEGATIVE)?,
        spin_ratio: s.numbers("spin_ratio", [0.0, rolling, 0.0], ANY)?,
        rise_speed_m_s: s.number("rise_speed_m_s", 0.0, ANY)?,
        bench,
    };
    if bench.is_some() {
        check_leaves_bench(&launch, ball.radius_m, gravity_m_s2)?;
    }
    Ok(launch)
}

impl SceneBench {
    /// R ω_y / u_o of a ball of `radius_m` that rolls without slipping: on a track's edges it rolls on a smaller radius.
    fn rolling_ratio(&self, radius_m: f64) -> f64 {
        let half_share = self.track_width_m.unwrap_or(0.0) / (2.0 * radius_m);
        1.0 / (1.0 - half_share * half_share).sqrt()
    }
}

fn read_bench(launch: &Section<'_>, radius_m: f64) -> Result<Option<SceneBench>, SceneError> {
    if launch.get("bench").is_none() {
        return Ok(None);
    }
    let s = launch.section("bench", &["seen_s", "track_width_m", "bench_grey"])?;
    let bench = SceneBench {
        seen_s: s.number(
            "seen_s",
            0.15,
            super::reader::NumberRange {
                words: "a number above 0, at most 60",
                test: |x| x > 0.0 && x <= LONGEST_BENCH_S,
                hint: "give null for launch.bench where the ball is not seen before the launch",
            },
        )?,
        track_width_m: s.optional_number("track_width_m", POSITIVE)?,
        bench_grey: s.optional_number("bench_grey", GREY)?,
    };
    match bench.track_width_m {
        Some(width_m) if width_m >= 2.0 * radius_m => Err(SceneError::Invalid {
            key: s.name("track_width_m"),
            found: width_m.to_string(),
            accepted: format!("below the ball's diameter, {}", 2.0 * radius_m),
            hint: "a wider track lets the ball through; give null for a plane bench".into(),
        }),
        _ => Ok(Some(bench)),
    }
}

/// That a ball on a bench moves along it, and flies off its end: it presses on the edge with m (g − v²/R) else, and tips
/// round it.
fn check_leaves_bench(launch: &SceneLaunch, radius_m: f64, gravity_m_s2: f64) -> Result<(), SceneError> {
    if launch.rise_speed_m_s != 0.0 {
        return Err(SceneError::Invalid {
            key: "launch.rise_speed_m_s".into(),
            found: launch.rise_speed_m_s.to_string(),
            accepted: "0 with a launch.bench, which is level".into(),
            hint: "remove it, or give null for launch.bench".into(),
        });
    }
    let speed_m_s = launch.speed_m_s;
    let least_m_s = (gravity_m_s2 * radius_m).sqrt();
    if speed_m_s > 0.0 && speed_m_s >= least_m_s {
        return Ok(());
    }
    Err(SceneError::Invalid {
        key: "launch.speed_m_s".into(),
        found: format!("{speed_m_s}, so slow that the ball tips round the edge of launch.bench"),
        accepted: format!("above sqrt(g R) = {least_m_s:.4}"),
        hint: "raise it, or give null for launch.bench".into(),
    })
}

fn read_air(root: &Section<'_>) -> Result<SceneAir, SceneError> {
    let s = root.section("air", &["density_kg_m3", "viscosity_pa_s"])?;
    Ok(SceneAir {
        density_kg_m3: s.number("density_kg_m3", 1.204, NOT_NEGATIVE)?,
        viscosity_pa_s: s.number("viscosity_pa_s", 1.81e-5, POSITIVE)?,
    })
}

fn read_camera(root: &Section<'_>) -> Result<Camera, SceneError> {
    let s = root.section(
        "camera",
        &[
            "view",
            "image_size_px",
            "frame_rate_hz",
            "exposure_s",
            "metres_per_pixel",
            "origin_px",
            "distance_m",
            "plane_offset_m",
            "tilt_deg",
            "roll_deg",
            "bump",
            "lens",
            "readout_s",
            "blur_px",
            "noise_grey",
            "electrons_per_grey",
            "codec",
            "crf",
        ],
    )?;
    let size = s.numbers(
        "image_size_px",
        [1280.0, 720.0],
        super::reader::NumberRange {
            words: "an even whole number from 16 to 8192",
            // Even, because H.264 stores colour for two by two pixels.
            test: |x| (16.0..=LARGEST_PICTURE_PX).contains(&x) && x % 2.0 == 0.0,
            hint: "give [columns, rows]",
        },
    )?;
    let crf = s.whole("crf", 14, 0, 51)?;
    let lens = read_lens(&s)?;
    let metres_per_pixel = s.number("metres_per_pixel", 0.0008, POSITIVE)?;
    let lossy = s.choice("codec", &[("h264", true), ("lossless", false)])?;
    Ok(Camera {
        view: s.choice("view", &[("side", View::Side), ("top", View::Top)])?,
        // Checked above: whole, and far inside usize.
        width_px: size[0] as usize,
        height_px: size[1] as usize,
        frame_rate_hz: s.number("frame_rate_hz", 240.0, POSITIVE)?,
        exposure_s: s.number("exposure_s", 0.0005, NOT_NEGATIVE)?,
        metres_per_pixel,
        origin_px: s.numbers("origin_px", [120.0, 660.0], ANY)?,
        distance_m: s
            .optional_number("distance_m", POSITIVE)?
            .or(lens.map(|l| l.focal_px() * metres_per_pixel)),
        plane_offset_m: s.number("plane_offset_m", 0.0, ANY)?,
        tilt_rad: s
            .number(
                "tilt_deg",
                0.0,
                super::reader::NumberRange {
                    words: "a number from -80 to 80",
                    test: |x| (-80.0..=80.0).contains(&x),
                    hint: "0 looks at the plane squarely",
                },
            )?
            .to_radians(),
        roll_rad: s
            .number(
                "roll_deg",
                0.0,
                super::reader::NumberRange {
                    words: "a number from -45 to 45",
                    test: |x| (-LARGEST_ROLL_DEG..=LARGEST_ROLL_DEG).contains(&x),
                    hint: "0 has up upright in the picture; above 0 it leans to the right",
                },
            )?
            .to_radians(),
        bump: read_bump(&s)?,
        lens,
        readout_s: s.number("readout_s", 0.0, NOT_NEGATIVE)?,
        blur_px: s.number(
            "blur_px",
            0.7,
            super::reader::NumberRange {
                words: "a number from 0 to 50",
                test: |x| (0.0..=LARGEST_BLUR_PX).contains(&x),
                hint: "it is the standard deviation; lenses have some 0.5 to 3 px",
            },
        )?,
        noise_grey: s.number("noise_grey", 2.0, NOT_NEGATIVE)?,
        electrons_per_grey: s.optional_number("electrons_per_grey", POSITIVE)?,
        codec: if lossy {
            Codec::H264 { crf: crf as u8 }
        } else {
            Codec::Lossless
        },
    })
}

fn read_bump(camera: &Section<'_>) -> Result<Option<SceneBump>, SceneError> {
    const SHIFT: super::reader::NumberRange = super::reader::NumberRange {
        words: "from -500 to 500",
        test: |x| (-LARGEST_BUMP_PX..=LARGEST_BUMP_PX).contains(&x),
        hint: "give [right, down] in px; tables swing by some 0.1 to 5 px",
    };
    if camera.get("bump").is_none() {
        return Ok(None);
    }
    let s = camera.section("bump", &["amplitude_px", "frequency_hz", "decay_s"])?;
    if s.get("amplitude_px").is_none() {
        return Err(SceneError::Missing {
            key: s.name("amplitude_px"),
            accepted: format!("a list of 2 numbers, each {}", SHIFT.words),
        });
    }
    Ok(Some(SceneBump {
        amplitude_px: Vector2::from(s.numbers("amplitude_px", [0.0; 2], SHIFT)?),
        frequency_hz: s.number("frequency_hz", 20.0, POSITIVE)?,
        decay_s: s.number("decay_s", 0.015, POSITIVE)?,
    }))
}

fn read_lens(camera: &Section<'_>) -> Result<Option<SceneLens>, SceneError> {
    if camera.get("lens").is_none() {
        return Ok(None);
    }
    let s = camera.section("lens", &["camera_matrix", "distortion"])?;
    let wrong = |found: &Value| {
        s.invalid(
            "camera_matrix",
            found,
            "[[fx, 0, cx], [0, fy, cy], [0, 0, 1]] with fx, fy above 0, px",
            "copy it from a calib.json",
        )
    };
    let value = s.get("camera_matrix").ok_or_else(|| SceneError::Missing {
        key: s.name("camera_matrix"),
        accepted: "[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]".into(),
    })?;
    let matrix: [[f64; 3]; 3] = serde_json::from_value(value.clone()).map_err(|_| wrong(value))?;
    let [[fx, skew, _], [zero, fy, _], bottom] = matrix;
    let fine = fx > 0.0 && fy > 0.0 && skew == 0.0 && zero == 0.0 && bottom == [0.0, 0.0, 1.0];
    if !fine {
        return Err(wrong(value));
    }
    Ok(Some(SceneLens {
        camera_matrix: matrix,
        distortion: s.numbers("distortion", [0.0; 5], ANY)?,
    }))
}

fn read_look(root: &Section<'_>) -> Result<SceneLook, SceneError> {
    let s = root.section(
        "look",
        &[
            "background_grey",
            "floor_grey",
            "ball_grey",
            "shading",
            "highlight_grey",
            "texture_grey",
            "reflection",
            "shadow",
            "unevenness",
            "flicker",
            "flicker_hz",
        ],
    )?;
    let shading = s.number("shading", 0.5, FRACTION)?;
    let background_grey = s.number("background_grey", 60.0, GREY)?;
    Ok(SceneLook {
        background_grey,
        floor_grey: s.number("floor_grey", background_grey, GREY)?,
        ball_grey: s.number("ball_grey", 200.0, GREY)?,
        shading,
        // A flat ball has no highlight; a shaded one looks painted without it.
        highlight_grey: s.number("highlight_grey", 80.0 * shading, GREY)?,
        texture_grey: s.number("texture_grey", 0.0, GREY)?,
        reflection: s.number("reflection", 0.0, FRACTION)?,
        shadow: s.number("shadow", 0.0, FRACTION)?,
        unevenness: s.number("unevenness", 0.0, FRACTION)?,
        flicker: s.number("flicker", 0.0, FRACTION)?,
        flicker_hz: s.number("flicker_hz", 100.0, POSITIVE)?,
    })
}

fn read_stop(root: &Section<'_>) -> Result<Stop, SceneError> {
    let s = root.section("stop", &["bounces", "tail_s"])?;
    Ok(Stop {
        bounces: s.whole("bounces", 2, 1, MOST_BOUNCES)? as usize,
        tail_s: s.number(
            "tail_s",
            0.05,
            super::reader::NumberRange {
                words: "a number from 0 to 60",
                test: |x| (0.0..=LONGEST_TAIL_S).contains(&x),
                hint: "ask for more bounces instead",
            },
        )?,
    })
}

fn read_effects(root: &Section<'_>) -> Result<EffectsChoice, SceneError> {
    let names = effects::names();
    match root.get("effects") {
        None => Ok(EffectsChoice::all(Switch::Auto)),
        Some(Value::Object(map)) => {
            // Opening the section checks the names.
            let s = root.section("effects", &names)?;
            let words = [("auto", Switch::Auto), ("on", Switch::On), ("off", Switch::Off)];
            let named = map
                .keys()
                .map(|name| Ok((name.clone(), s.choice(name, &words)?)))
                .collect::<Result<_, SceneError>>()?;
            Ok(EffectsChoice {
                default: Switch::Auto,
                named,
            })
        }
        Some(value) => parse_effects_word(value.as_str().unwrap_or_default()).ok_or_else(|| {
            let hint = value
                .as_str()
                .and_then(|word| nearest(word, &["auto", "all", "none"]))
                .map_or_else(
                    || format!("known effects: {}", names.join(", ")),
                    |n| format!("did you mean {n:?}?"),
                );
            SceneError::Invalid {
                key: "effects".into(),
                found: shown(value),
                accepted: "\"auto\", \"all\", \"none\" or {\"<effect>\": \"on\" | \"off\" | \"auto\"}".into(),
                hint,
            }
        }),
    }
}

/// `auto`, `all` or `none`, as the scene and `--effects` say it.
#[must_use]
pub fn parse_effects_word(word: &str) -> Option<EffectsChoice> {
    match word {
        "auto" => Some(EffectsChoice::all(Switch::Auto)),
        "all" => Some(EffectsChoice::all(Switch::On)),
        "none" => Some(EffectsChoice::all(Switch::Off)),
        _ => None,
    }
}
