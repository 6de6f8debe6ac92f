//! The keys of a scene as types, for its JSON Schema (see [`crate::config::schema`]).

use super::{effects, scene_marks};
use crate::config::schema::Positive;
use crate::rebound::ModelName;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde_json::{Map, Value, json};

/// A scene: ball, contact, floor, launch, air, camera and look of a recording that `track simulate` renders. What is left out
/// or null takes its default.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct SceneKeys {
    /// `track.scene/1`.
    pub schema: String,
    /// Of all that is random.
    pub seed: Option<u64>,
    /// g, m/s²; 9.81.
    pub gravity_m_s2: Option<Positive>,
    /// The ball.
    pub ball: Option<SceneBallKeys>,
    /// What the floor does to the ball: a rebound model and its coefficients.
    #[schemars(schema_with = "contact")]
    pub contact: Value,
    /// Where the floor is.
    pub floor: Option<SceneFloorKeys>,
    /// How the ball starts.
    pub launch: Option<SceneLaunchKeys>,
    /// What it flies through.
    pub air: Option<SceneAirKeys>,
    /// Another ball in the picture.
    pub second_ball: Option<SecondBallKeys>,
    /// What looks at it.
    pub camera: Option<SceneCameraKeys>,
    /// What that sees.
    pub look: Option<SceneLookKeys>,
    /// When the recording ends.
    pub stop: Option<SceneStopKeys>,
    /// What an effect must move a centre by to be worth simulating, px; 0.02.
    pub tolerance_px: Option<Positive>,
    /// What an effect must change a grey level by; 0.5.
    pub tolerance_grey: Option<Positive>,
    /// Which effects to simulate: one word for all, or a switch for each.
    #[schemars(default, schema_with = "effects_choice")]
    pub effects: Option<Value>,
}

/// The ball; a steel ball of 25 mm where nothing is said.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct SceneBallKeys {
    /// R, m; 0.0125.
    pub radius_m: Option<Positive>,
    /// m, kg; 0.0639.
    pub mass_kg: Option<Positive>,
    /// k = I / (m R²); 0.4.
    #[schemars(extend("maximum" = 0.667))]
    pub inertia_factor: Option<Positive>,
    /// Effective Young's modulus E* of ball and floor, Pa; 7e10, steel on ceramic.
    pub contact_modulus_pa: Option<Positive>,
    /// Drag over that of a smooth sphere; 1.
    #[schemars(range(min = 0, max = 10))]
    pub drag_factor: Option<f64>,
    /// Magnus lift over that of a tennis ball; 1.
    #[schemars(range(min = 0, max = 10))]
    pub lift_factor: Option<f64>,
}

/// The floor: a plane through x = 0, z = 0.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct SceneFloorKeys {
    /// The angle by which it rises along +x, degrees; 0.
    #[schemars(range(min = -20, max = 20))]
    pub slope_deg: Option<f64>,
}

/// The launch from x = 0, y = 0.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct SceneLaunchKeys {
    /// Height of the ball's lowest point above z = 0, m; 0.1.
    #[schemars(range(min = 0))]
    pub drop_height_m: Option<f64>,
    /// u_o, along x, m/s; 1.
    #[schemars(range(min = 0))]
    pub speed_m_s: Option<f64>,
    /// R ω / u_o about x, y, z; none, or rolling on a bench.
    pub spin_ratio: Option<[f64; 3]>,
    /// The same as an angular velocity ω about x, y, z, rad/s, in place of the ratio: also of a ball that is only dropped.
    pub spin_rad_s: Option<[f64; 3]>,
    /// Speed upwards, m/s; 0.
    pub rise_speed_m_s: Option<f64>,
    /// By how much the plane of motion is turned from the calibrated one, degrees: above 0 the ball comes nearer; 0.
    #[schemars(range(min = -60, max = 60))]
    pub azimuth_deg: Option<f64>,
    /// The level bench along which the ball is seen to roll before.
    pub bench: Option<SceneBenchKeys>,
}

/// A level bench.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct SceneBenchKeys {
    /// How long the ball is seen there, s; 0.15.
    #[schemars(extend("maximum" = 60))]
    pub seen_s: Option<Positive>,
    /// Width of the track whose edges carry the ball, m; null: it rolls on a plane.
    pub track_width_m: Option<Positive>,
    /// Grey of the bench in a side view; null: not drawn.
    #[schemars(range(min = 0, max = 255))]
    pub bench_grey: Option<f64>,
}

/// The air.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct SceneAirKeys {
    /// ρ, kg/m³; 1.204.
    #[schemars(range(min = 0))]
    pub density_kg_m3: Option<f64>,
    /// Dynamic viscosity, Pa s; 1.81e-5.
    pub viscosity_pa_s: Option<Positive>,
}

/// The camera.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct SceneCameraKeys {
    /// At the plane of motion (the default), or down at the floor.
    #[schemars(extend("enum" = ["side", "top", null]))]
    pub view: Option<String>,
    /// Columns and rows, even, 16 to 8192; [1280, 720].
    pub image_size_px: Option<[u32; 2]>,
    /// Frames a second; 240.
    pub frame_rate_hz: Option<Positive>,
    /// Exposure of a frame, s; 0.0005.
    #[schemars(range(min = 0))]
    pub exposure_s: Option<f64>,
    /// Scale in the calibrated plane; 0.0008.
    pub metres_per_pixel: Option<Positive>,
    /// Where x = 0, z = 0 (side) or x = 0, y = 0 (top) is; [120, 660].
    pub origin_px: Option<[f64; 2]>,
    /// From the optical centre to the calibrated plane, m; null: infinitely far, or as the lens says.
    pub distance_m: Option<Positive>,
    /// How much nearer to the camera than that plane the ball is launched, m; 0.
    pub plane_offset_m: Option<f64>,
    /// Turned about the picture's vertical by, degrees; 0.
    #[schemars(range(min = -80, max = 80))]
    pub tilt_deg: Option<f64>,
    /// Pitched about the picture's horizontal by, degrees: above 0 it looks down; 0. The calibration does not say it.
    #[schemars(range(min = -60, max = 60))]
    pub pitch_deg: Option<f64>,
    /// Rolled about the optical axis by, degrees; 0.
    #[schemars(range(min = -45, max = 45))]
    pub roll_deg: Option<f64>,
    /// How table and camera swing after an impact.
    pub bump: Option<SceneBumpKeys>,
    /// How the camera is panned, or held by hand.
    pub pan: Option<ScenePanKeys>,
    /// What the file makes of the frames' times.
    pub clock: Option<SceneClockKeys>,
    /// The lens by OpenCV's model.
    pub lens: Option<SceneLensKeys>,
    /// From the exposure of the first row to that of the last, s; 0.
    #[schemars(range(min = 0))]
    pub readout_s: Option<f64>,
    /// Standard deviation of the optical blur, px; 0.7.
    #[schemars(range(min = 0, max = 50))]
    pub blur_px: Option<f64>,
    /// Standard deviation of the read noise, grey; 2.
    #[schemars(range(min = 0))]
    pub noise_grey: Option<f64>,
    /// Electrons a grey level; null: no shot noise.
    pub electrons_per_grey: Option<Positive>,
    /// How the recording is stored; h264.
    #[schemars(extend("enum" = ["h264", "lossless", null]))]
    pub codec: Option<String>,
    /// Constant rate factor of H.264; 14.
    #[schemars(range(min = 0, max = 51))]
    pub crf: Option<u8>,
    /// Where the samples of chroma lie in a coloured recording: at the left of two columns (H.264's custom) or between them (JPEG's); left.
    #[schemars(extend("enum" = ["left", "centre", null]))]
    pub chroma_siting: Option<String>,
}

/// amplitude · sin(2π f t) exp(−t/τ) after an impact.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct SceneBumpKeys {
    /// Shift of the picture (right, down) after the first impact, px.
    pub amplitude_px: [f64; 2],
    /// f, Hz; 20.
    pub frequency_hz: Option<Positive>,
    /// τ, s; 0.015.
    pub decay_s: Option<Positive>,
}

/// A drift of the whole picture, 0 at t = 0.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct ScenePanKeys {
    /// Velocity (right, down), px/s; [0, 0].
    pub velocity_px_s: Option<[f64; 2]>,
    /// Standard deviation of a hand's slow wander along each axis, px; 0.
    #[schemars(range(min = 0, max = 500))]
    pub wander_px: Option<f64>,
}

/// Place k of the file shows the camera's frame floor(k frame_rate_hz / stored_hz + phase).
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct SceneClockKeys {
    /// Places a second: below the frame rate frames are left out in regular places, above they are repeated; the frame rate.
    pub stored_hz: Option<Positive>,
    /// 0 up to below 1; 0.
    #[schemars(range(min = 0, max = 1))]
    pub phase: Option<f64>,
    /// Places left out without a trace.
    pub left_out_places: Option<Vec<u32>>,
    /// Places that show what the one before shows.
    pub filled_places: Option<Vec<u32>>,
    /// Rate of the even stamps, Hz; `stored_hz`.
    pub stamped_hz: Option<Positive>,
    /// What stamps are cut to, s; null: as fine as the container's.
    pub stamp_step_s: Option<Positive>,
}

/// A second ball, with the first's contact and density, without spin.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct SecondBallKeys {
    /// When it is launched, s: below 0 it flies already as the recording begins; 0.
    #[schemars(range(min = -60, max = 60))]
    pub start_s: Option<f64>,
    /// Where, along x, m; 0.
    pub x_m: Option<f64>,
    /// Height of its lowest point, m; 0.1.
    pub drop_height_m: Option<Positive>,
    /// Along x, m/s; below 0 against it; 0.
    pub speed_m_s: Option<f64>,
    /// Upwards, m/s; 0.
    pub rise_speed_m_s: Option<f64>,
    /// R, m; as the first.
    pub radius_m: Option<Positive>,
    /// As `look.ball_grey`.
    #[schemars(range(min = 0, max = 255))]
    pub ball_grey: Option<f64>,
}

/// The ball's shadow on a wall behind it.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct WallShadowKeys {
    /// From the ball's centre (right, down), px.
    pub offset_px: [f64; 2],
    /// How much darker the wall is, grey; 20.
    #[schemars(range(min = 0, max = 255))]
    pub depth_grey: Option<f64>,
    /// Standard deviation of its soft edge, px; 2.
    #[schemars(range(min = 0, max = 50))]
    pub blur_px: Option<f64>,
}

/// A lens by OpenCV's model.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct SceneLensKeys {
    /// [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], px.
    pub camera_matrix: [[f64; 3]; 3],
    /// k1, k2, p1, p2, k3; none.
    pub distortion: Option<[f64; 5]>,
}

/// What the picture looks like, grey levels from 0 to 255.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct SceneLookKeys {
    /// Behind the ball; 60.
    #[schemars(range(min = 0, max = 255))]
    pub background_grey: Option<f64>,
    /// Below the floor line of a side view; as the background.
    #[schemars(range(min = 0, max = 255))]
    pub floor_grey: Option<f64>,
    /// The ball where it is brightest, without highlight; 200.
    #[schemars(range(min = 0, max = 255))]
    pub ball_grey: Option<f64>,
    /// Chroma [U, V] of the ball where it is brightest, from that of grey, code values from -127 to 127; [0, 0], grey.
    pub ball_colour: Option<[f64; 2]>,
    /// The same behind the ball; [0, 0].
    pub background_colour: Option<[f64; 2]>,
    /// The same below the floor line; as the background.
    pub floor_colour: Option<[f64; 2]>,
    /// 0 flat, 1 black on the side away from the light; 0.5.
    #[schemars(range(min = 0, max = 1))]
    pub shading: Option<f64>,
    /// Height of the specular highlight; 80 times the shading.
    #[schemars(range(min = 0, max = 255))]
    pub highlight_grey: Option<f64>,
    /// Standard deviation of the background's texture; 0.
    #[schemars(range(min = 0, max = 255))]
    pub texture_grey: Option<f64>,
    /// Share of the ball's light that the floor mirrors; 0.
    #[schemars(range(min = 0, max = 1))]
    pub reflection: Option<f64>,
    /// Darkening of the floor right below a ball that touches it; 0.
    #[schemars(range(min = 0, max = 1))]
    pub shadow: Option<f64>,
    /// What the ball throws on a wall behind it; null: nothing.
    pub wall_shadow: Option<WallShadowKeys>,
    /// Fall of the light from the brightest to the darkest corner, as a share; 0.
    #[schemars(range(min = 0, max = 1))]
    pub unevenness: Option<f64>,
    /// Relative amplitude of the light's flicker; 0.
    #[schemars(range(min = 0, max = 1))]
    pub flicker: Option<f64>,
    /// Its frequency, Hz; 100.
    pub flicker_hz: Option<Positive>,
    /// What is drawn on the ball; null: nothing.
    pub marks: Option<BallMarkKeys>,
}

/// Marks on the ball, which turn with it: they scale its grey. Directions [x, y, z] are from its centre; at the launch x is along it, y away
/// from a camera at the side, z up.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct BallMarkKeys {
    /// Nothing; round dots; lines round the ball; one half of it; the seam of a tennis ball; a picture wrapped round it.
    #[schemars(extend("enum" = scene_marks::PATTERNS))]
    pub pattern: String,
    /// Dots: how many, in places by the seed; 6.
    #[schemars(range(min = 1, max = 200))]
    pub count: Option<u32>,
    /// Dots: their middles, in place of `count`. Line: the poles of one or more great circles; [[1, 0, 0]]. Halves: the pole of the half that is
    /// marked; [[1, 0, 0]].
    #[schemars(length(min = 1, max = 200))]
    pub directions: Option<Vec<[f64; 3]>>,
    /// Dots: half the angle that one covers, seen from the ball's centre, degrees; 15.
    #[schemars(extend("maximum" = 90))]
    pub radius_deg: Option<Positive>,
    /// Line, seam: the angle across it, degrees; 10.
    #[schemars(extend("maximum" = 90))]
    pub width_deg: Option<Positive>,
    /// Grey of a mark where the ball without it would have `ball_grey`; 0.3 times that.
    #[schemars(range(min = 0, max = 255))]
    pub grey: Option<f64>,
    /// Picture: the image, relative to the scene. Columns are longitudes, rows latitudes from the top down, the middle faces a camera at the
    /// side; white leaves the ball as it is.
    pub file: Option<String>,
    /// How the ball is turned at the launch from its plane of motion's axes: an angle in degrees times an axis, [x, y, z]; [0, 0, 0].
    pub turned_deg: Option<[f64; 3]>,
}

/// When the recording ends.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct SceneStopKeys {
    /// After this many impacts (or when the ball has come to rest); 2.
    #[schemars(range(min = 1, max = 1000))]
    pub bounces: Option<u32>,
    /// So long after the last of them, s; 0.05.
    #[schemars(range(min = 0, max = 60))]
    pub tail_s: Option<f64>,
}

/// A form for each rebound model, from its list of coefficients.
fn contact(_: &mut SchemaGenerator) -> Schema {
    let form = |(i, name): (usize, ModelName)| {
        let coefficients = name.facts().coefficients;
        let mut properties = Map::new();
        properties.insert("model".to_owned(), json!({"const": name.name()}));
        for c in coefficients {
            let described = json!({"type": "number", "description": c.range.accepted});
            properties.insert(c.key.to_owned(), described);
        }
        let required = coefficients.iter().filter(|c| c.same_as.is_none()).map(|c| c.key);
        // The first model is the one where none is named.
        let required: Vec<&str> = required.chain((i > 0).then_some("model")).collect();
        json!({"type": "object", "properties": properties, "required": required, "additionalProperties": false})
    };
    let forms: Vec<Value> = ModelName::ALL.into_iter().enumerate().map(form).collect();
    json_schema!({"oneOf": forms})
}

fn effects_choice(_: &mut SchemaGenerator) -> Schema {
    let switch = json!({"enum": ["auto", "on", "off", null]});
    let names = effects::names()
        .into_iter()
        .map(|name| (name.to_owned(), switch.clone()));
    let properties: Map<String, Value> = names.collect();
    json_schema!({"anyOf": [
        {"enum": ["auto", "all", "none", null]},
        {"type": "object", "properties": properties, "additionalProperties": false}
    ]})
}
