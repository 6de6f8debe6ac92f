//! The keys of `calib.json` as types, for its JSON Schema (see [`crate::config::schema`]).

use crate::config::made_by::MadeBy;
use crate::config::schema::{Positive, True};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};

/// A calibration: how pixels become metres, and what else is known of the experiment. What is left out or null takes its
/// default; calib/README.md says which.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct CalibrationKeys {
    /// `track.calib/1`.
    pub schema: String,
    /// Where the camera looks: at the plane of motion (the default), or down at the floor.
    #[schemars(extend("enum" = ["side", "top", null]))]
    pub view: Option<String>,
    /// Width and height of the recording's pictures.
    pub image_size_px: Option<[u32; 2]>,
    /// Where metres come from: exactly one kind.
    pub scale: ScaleObjectKeys,
    /// Pixel of the world's origin: x = 0 at the launch edge, z = 0 at the floor.
    pub origin_px: Option<[f64; 2]>,
    /// Standard uncertainty of each of its coordinates.
    pub origin_std_px: Option<Positive>,
    /// Direction of "up" (top view: of y) in the undistorted picture, any length.
    pub up_px: Option<[f64; 2]>,
    /// Standard uncertainty of that direction, degrees.
    pub up_std_deg: Option<Positive>,
    /// Distance of the lens from the calibrated plane along the optical axis, m.
    pub distance_m: Option<Positive>,
    /// Its standard uncertainty, m.
    pub distance_std_m: Option<Positive>,
    /// The lens.
    pub lens: Option<LensKeys>,
    /// How lens and homography may be off together, one standard deviation each, as `track calibrate board` writes it.
    pub deviations: Option<Vec<DeviationKeys>>,
    /// The rate at which the camera captured, Hz.
    pub frame_rate_hz: Option<Positive>,
    /// What is known of the camera.
    pub camera: Option<CameraKeys>,
    /// Acceleration of free fall, m/s².
    pub gravity_m_s2: Option<Positive>,
    /// Its standard uncertainty, m/s².
    pub gravity_std_m_s2: Option<Positive>,
    /// The ball.
    pub ball: Option<BallKeys>,
    /// The launch.
    pub launch: Option<LaunchKeys>,
    /// The floor.
    pub floor: Option<FloorKeys>,
    /// That the program wrote the file: it may then replace it. Not read.
    pub made_by: Option<MadeBy>,
}

/// One of: metres_per_pixel; from_px, to_px and length_m; ball; gravity; world_from_pixel.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct ScaleObjectKeys {
    /// Metres a pixel.
    pub metres_per_pixel: Option<Positive>,
    /// Its standard uncertainty.
    pub std_uncertainty: Option<Positive>,
    /// One end of a known length in the plane of motion, as the picture shows it.
    pub from_px: Option<[f64; 2]>,
    /// The other end.
    pub to_px: Option<[f64; 2]>,
    /// The length between them, m.
    pub length_m: Option<Positive>,
    /// Its standard uncertainty, m.
    pub length_std_m: Option<Positive>,
    /// Standard uncertainty of each coordinate of each end.
    pub point_std_px: Option<Positive>,
    /// The ball's radius over the radius seen.
    pub ball: Option<True>,
    /// The acceleration of free fall over the fall seen.
    pub gravity: Option<True>,
    /// From undistorted pixels to x and up, m: (x w, up w, w) = matrix · (u, v, 1).
    pub world_from_pixel: Option<[[f64; 3]; 3]>,
    /// Relative standard uncertainty of its lengths, 0.001 for 0.1 %.
    pub relative_std: Option<Positive>,
    /// That its origin is not the launch edge at the floor.
    pub origin_unknown: Option<True>,
}

/// A lens by OpenCV's model.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct LensKeys {
    /// [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], px.
    pub camera_matrix: [[f64; 3]; 3],
    /// k1, k2, p1, p2, k3.
    pub distortion: [f64; 5],
    /// Standard uncertainties of fx, fy, cx, cy, px; null where one was not fitted.
    pub camera_std_px: Option<[Option<Positive>; 4]>,
    /// Standard uncertainties of the distortion; null where one was not fitted.
    pub distortion_std: Option<[Option<Positive>; 5]>,
}

/// One way in which lens and homography may be off.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct DeviationKeys {
    /// Changes of fx, fy, cx, cy (px), k1, k2, p1, p2, k3.
    pub lens: Option<[f64; 9]>,
    /// Change of scale.world_from_pixel.
    pub world_from_pixel: Option<[[f64; 3]; 3]>,
}

/// The camera, as far as it is known.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct CameraKeys {
    /// Rolling shutter: the time from the exposure of the first row to that of the last, as stored, s; below 0 where the picture
    /// is stored upside down.
    #[schemars(range(min = -1, max = 1))]
    pub readout_s: Option<f64>,
}

/// The ball, as far as it is known.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct BallKeys {
    /// Half the diameter, m.
    pub radius_m: Option<Positive>,
    /// Its standard uncertainty, m.
    pub radius_std_m: Option<Positive>,
    /// Mass, kg.
    pub mass_kg: Option<Positive>,
    /// I / (m R²): 0.4 for a solid ball, 2/3 for a thin shell.
    #[schemars(extend("maximum" = 0.667))]
    pub inertia_factor: Option<Positive>,
    /// Mass over volume, where the mass is not given, kg/m³.
    pub density_kg_m3: Option<Positive>,
    /// Young's modulus, Pa; only with `poisson_ratio`.
    pub youngs_modulus_pa: Option<Positive>,
    /// Poisson's ratio; only with `youngs_modulus_pa`.
    #[schemars(range(min = -0.9, max = 0.5))]
    pub poisson_ratio: Option<f64>,
}

/// The launch.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct LaunchKeys {
    /// x of the launch edge, m; only with an origin. Null: unknown.
    pub edge_x_m: Option<f64>,
    /// R ω / u before the first impact: 0 none; "rolling": the ball rolls off its bench; null: unknown.
    #[schemars(default, schema_with = "spin_ratio")]
    pub spin_ratio: Option<f64>,
    /// Distance between the two edges that the ball rolls on, m.
    pub track_width_m: Option<Positive>,
}

/// What is known of the floor's slope.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct FloorKeys {
    /// Angle by which the floor rises along +x, degrees.
    #[schemars(range(min = -45, max = 45))]
    pub slope_deg: Option<f64>,
    /// Its standard uncertainty, degrees.
    pub std_deg: Option<Positive>,
    /// Two points on a line along the floor, in the plane of motion, 10 px or more apart.
    pub line_px: Option<[[f64; 2]; 2]>,
    /// Standard uncertainty of each of them across the line.
    pub line_std_px: Option<Positive>,
    /// Young's modulus, Pa; only with `poisson_ratio`.
    pub youngs_modulus_pa: Option<Positive>,
    /// Poisson's ratio; only with `youngs_modulus_pa`.
    #[schemars(range(min = -0.9, max = 0.5))]
    pub poisson_ratio: Option<f64>,
}

fn spin_ratio(_: &mut SchemaGenerator) -> Schema {
    json_schema!({"anyOf": [{"type": ["number", "null"]}, {"const": super::ROLLING}]})
}
