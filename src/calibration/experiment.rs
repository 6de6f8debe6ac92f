//! What a calibration says of the experiment: where the camera looks, the ball, how it starts, what it bounces on.

use super::rectification::Rectification;
use crate::geometry::PixelPoint;
use crate::rebound::compliant::stiffness::Material;

/// Where the camera looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum View {
    /// At the plane of motion, square to it: "up" is z.
    #[default]
    Side,
    /// Down at the floor: "up" in the picture is y.
    Top,
}

/// The ball, as far as it is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ball {
    /// Radius R, m.
    pub radius_m: Option<f64>,
    /// Standard uncertainty of the radius, m; `None`: taken as exact.
    pub radius_std_m: Option<f64>,
    /// Mass, kg.
    pub mass_kg: Option<f64>,
    /// I / (m R²), in (0, 2/3]: 0.4 solid, 2/3 a thin shell.
    pub inertia_factor: f64,
    /// What it is made of.
    pub material: Option<Material>,
}

impl Default for Ball {
    fn default() -> Self {
        Self {
            radius_m: None,
            radius_std_m: None,
            mass_kg: None,
            inertia_factor: 0.4,
            material: None,
        }
    }
}

/// What is known of the floor's slope beforehand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Floor {
    /// Angle by which it rises along +x, against the horizontal that gravity tells, rad.
    pub slope_rad: f64,
    /// Its standard uncertainty, rad.
    pub std_rad: f64,
    /// Whether the file says so; else it is a lab's bench, level to [`BENCH_STD_RAD`].
    pub given: bool,
    /// Two points of the picture on a line along the floor, in the plane of motion.
    pub line: Option<FloorLine>,
    /// What it is made of.
    pub material: Option<Material>,
}

/// A line along the floor, read off the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FloorLine {
    /// One point of it.
    pub from: PixelPoint,
    /// Another.
    pub to: PixelPoint,
    /// Standard uncertainty of each across the line, px.
    pub std_px: f64,
}

impl FloorLine {
    /// The same line in a picture shifted by (`du_px`, `dv_px`).
    pub(super) fn shifted(self, du_px: f64, dv_px: f64) -> Self {
        Self {
            from: self.from.shifted(du_px, dv_px),
            to: self.to.shifted(du_px, dv_px),
            ..self
        }
    }

    /// A shorter one tells no direction, px.
    pub const LEAST_PX: f64 = 10.0;

    /// From end to end, px.
    #[must_use]
    pub fn length_px(&self) -> f64 {
        self.from.distance_px(self.to)
    }

    /// Standard uncertainty of its direction in the picture, rad.
    #[must_use]
    pub fn std_rad(&self) -> f64 {
        std::f64::consts::SQRT_2 * self.std_px / self.length_px()
    }

    /// Angle by which it rises to the right, square to the "up" of `map`, rad, between −π/2 and π/2; `None` where lens or
    /// horizon have no place for an end.
    #[must_use]
    pub fn rise_rad(&self, map: &Rectification) -> Option<f64> {
        let (a, b) = (map.plane_from_pixel(self.from)?, map.plane_from_pixel(self.to)?);
        let (right, up) = (b.right - a.right, b.up - a.up);
        // The same line from either end.
        Some(if right < 0.0 {
            (-up).atan2(-right)
        } else {
            up.atan2(right)
        })
    }
}

/// A bench or floor of which nothing is said is level to this standard deviation: 0.1 degrees, 2 mm in a metre.
pub const BENCH_STD_RAD: f64 = 0.1 * std::f64::consts::PI / 180.0;

impl Default for Floor {
    fn default() -> Self {
        Self {
            slope_rad: 0.0,
            std_rad: BENCH_STD_RAD,
            given: false,
            line: None,
            material: None,
        }
    }
}

/// What `launch.spin_ratio` says of a ball that rolls.
pub(super) const ROLLING: &str = "rolling";

/// How the ball starts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Launch {
    /// x of the launch edge, m. Given only where the file gives the world's origin (`origin_px` or a homography), since
    /// without one there is no x axis to place it on; then 0 unless the file says otherwise, `None` for an explicit null.
    pub edge_x_m: Option<f64>,
    /// R ω_oy / u_o before the first impact: 0 unless the file says otherwise, `None` where it says "unknown" (null).
    pub spin_ratio: Option<f64>,
    /// Whether the file says "rolling", which made that ratio.
    pub rolling: bool,
    /// Width of the track that the ball rolls on, m; `None`: a plane.
    pub track_width_m: Option<f64>,
}

impl Launch {
    /// R ω/u of a ball of `radius_m` that rolls without slipping on a track of width a: R/√(R² − a²/4), 1 on a plane. `None` for
    /// a track as wide as the ball.
    #[must_use]
    pub fn rolling_ratio(radius_m: f64, track_width_m: f64) -> Option<f64> {
        let half = 0.5 * track_width_m / radius_m;
        let height = (1.0 - half) * (1.0 + half);
        (height > 0.0).then(|| 1.0 / height.sqrt())
    }
}

impl Default for Launch {
    fn default() -> Self {
        Self {
            edge_x_m: None,
            spin_ratio: Some(0.0),
            rolling: false,
            track_width_m: None,
        }
    }
}
