//! `calib.json`, and from a pixel to a metre: the only place where that happens.
//!
//! A recording's pixel goes to a point of the plane of motion by [`Rectification`] (lens, then rotation or
//! homography; see there) and from there to metres by [`Calibration::metres_per_unit`] (the scale, which may rest on the
//! ball or on the fall as the recording shows them). The calibration's part of a result's uncertainty is the standard
//! uncertainty of that scale, [`Calibration::up_std_rad`] and [`Calibration::origin_std_px`].
//!
//! How far the camera stands ([`Calibration::distance_m`]) makes it a pinhole at a place, a [`Viewpoint`]: then what is
//! nearer than the plane can be put right. For the outline of a ball off the optical axis the lens is enough ([`Optics`],
//! [`Silhouettes`]).
//!
//! The file's keys and defaults are in `calib/README.md`. Additions to the contract, all optional: `origin_std_px`,
//! `floor.line_px`, `floor.line_std_px`, `distance_m`, `distance_std_m`, `gravity_std_m_s2`, `ball.radius_std_m`, `deviations`, in `lens`
//! `camera_std_px` and `distortion_std`, and in `scale` `length_std_m` and `point_std_px` (ruler), `relative_std` and
//! `origin_unknown` (homography).
//!
//! Rules beside a homography, which has its own origin and axes: `origin_px` and an `up_px` other than the default are
//! errors, because they would either do nothing or contradict it.

mod blurred_edge;
pub mod board;
pub mod check;
mod deviation;
mod error;
mod file;
mod lens;
mod rectification;
pub mod ruler;
mod scale;
mod silhouette;
mod viewpoint;

pub use deviation::Deviation;
pub use error::{CalibrationError, Problem};
pub(crate) use file::{FINITE, INERTIA, POSITIVE};
pub use lens::Lens;
pub use rectification::{PlaneUnit, Rectification};
pub use scale::{Homography, ROUNDED_PIXEL_STD_PX, Scale, ScaleEvidence};
pub use silhouette::{Silhouette, Silhouettes};
pub use viewpoint::{Optics, Viewpoint};

use crate::geometry::PixelPoint;
use crate::quantity::Quantity;
use nalgebra::Matrix3;
use std::path::Path;

/// The schema this version reads and writes.
pub const SCHEMA: &str = "track.calib/1";

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
}

impl Default for Ball {
    fn default() -> Self {
        Self {
            radius_m: None,
            radius_std_m: None,
            mass_kg: None,
            inertia_factor: 0.4,
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

/// A phone or camera whose "up" is given without an uncertainty was levelled to this: 0.3 degrees.
pub const LEVELLED_STD_RAD: f64 = 0.3 * std::f64::consts::PI / 180.0;

/// A camera of which nothing is said is held to this standard deviation about its line of sight: 5 degrees. The fall tells
/// far better.
const HELD_STD_RAD: f64 = 5.0 * std::f64::consts::PI / 180.0;

/// Part by which g differs from 9.81 m/s² anywhere on Earth (9.764 to 9.834), and by which it differs from what somebody looked
/// up for his place.
const ANYWHERE_PART: f64 = 3e-3;
const LOCAL_PART: f64 = 1e-4;

impl Default for Floor {
    fn default() -> Self {
        Self {
            slope_rad: 0.0,
            std_rad: BENCH_STD_RAD,
            given: false,
            line: None,
        }
    }
}

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

/// A calibration, checked. Built by hand (by the simulator, say) it starts from [`Calibration::new`].
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// Where the camera looks.
    pub view: View,
    /// Width and height of the pictures it is for, after the rotation tag.
    pub image_size_px: Option<(usize, usize)>,
    /// Where metres come from.
    pub scale: Scale,
    /// The world's origin in the picture (as seen, before undistortion).
    pub origin_px: Option<PixelPoint>,
    /// Standard uncertainty of each coordinate of the origin, px.
    pub origin_std_px: Option<f64>,
    /// Direction of "up" in the undistorted picture, (du, dv), a unit vector.
    pub up_px: [f64; 2],
    /// Whether the file says so; else it is a first guess, and the fall tells. Never beside a homography, which has its own.
    pub up_given: bool,
    /// Standard uncertainty of that direction, rad; [`Self::upright_std_rad`] says what holds where there is none.
    pub up_std_rad: Option<f64>,
    /// Distance of the camera (its pinhole) from the calibrated plane along the optical axis, m; `None`: not known, the
    /// picture is taken as that of a camera far away.
    pub distance_m: Option<f64>,
    /// Its standard uncertainty, m; `None`: 1 % where it matters, as where in its lens a camera has its pinhole is not
    /// known to better.
    pub distance_std_m: Option<f64>,
    /// Lens distortion.
    pub lens: Option<Lens>,
    /// Standard uncertainties of fx, fy, cx, cy (px), k1, k2, p1, p2, k3, for people: the uncertainty that
    /// results take from the lens is in `deviations`. `None` where a number was not fitted.
    pub lens_std: [Option<f64>; 9],
    /// How lens and homography may be off together; empty where nobody determined it.
    pub deviations: Vec<Deviation>,
    /// True capture rate, Hz, where the file's time stamps are not to be believed.
    pub frame_rate_hz: Option<f64>,
    /// Acceleration of free fall, m/s².
    pub gravity_m_s2: f64,
    /// Whether the file says so.
    pub gravity_given: bool,
    /// Its standard uncertainty, m/s², where the file says one; [`Self::gravity_uncertainty_m_s2`] says what holds without.
    pub gravity_std_m_s2: Option<f64>,
    /// The ball.
    pub ball: Ball,
    /// How it starts.
    pub launch: Launch,
    /// What it bounces on.
    pub floor: Floor,
}

impl Calibration {
    /// A side view with `scale` and every default of the file.
    #[must_use]
    pub fn new(scale: Scale) -> Self {
        let edge_x_m = scale.has_origin().then_some(0.0);
        Self {
            view: View::Side,
            image_size_px: None,
            scale,
            origin_px: None,
            origin_std_px: None,
            up_px: [0.0, -1.0],
            up_given: false,
            up_std_rad: None,
            distance_m: None,
            distance_std_m: None,
            lens: None,
            lens_std: [None; 9],
            deviations: Vec::new(),
            frame_rate_hz: None,
            gravity_m_s2: 9.81,
            gravity_given: false,
            gravity_std_m_s2: None,
            ball: Ball::default(),
            launch: Launch {
                edge_x_m,
                ..Launch::default()
            },
            floor: Floor::default(),
        }
    }

    /// The same with the world's origin at `origin_px`, where the launch edge is unless it is set otherwise.
    #[must_use]
    pub fn with_origin(self, origin_px: PixelPoint) -> Self {
        let launch = Launch {
            edge_x_m: Some(0.0),
            ..self.launch
        };
        Self {
            origin_px: Some(origin_px),
            launch,
            ..self
        }
    }

    /// The calibration in the file at `path`.
    ///
    /// # Errors
    /// A file that cannot be read (missing, a directory, above 1 MB, not UTF-8), that is not JSON, or any value that is
    /// not accepted: all of them at once, with the file, the dotted key, what was found, what is accepted, what to try.
    pub fn read(path: &Path) -> Result<Self, CalibrationError> {
        file::read(path)
    }

    /// The calibration in `text`; `name` stands for the file in messages.
    ///
    /// # Errors
    /// As [`Self::read`], but for the file system's.
    pub fn parse(text: &str, name: &str) -> Result<Self, CalibrationError> {
        file::parse(text, name)
    }

    /// The calibration in the file's form: [`Self::parse`] reads the same back.
    #[must_use]
    pub fn to_json(&self) -> serde_json::Value {
        file::to_json(self)
    }

    /// Whether the world's origin is known, by `origin_px` or by a homography; otherwise the floor is found from the
    /// impacts and x = 0 is the first tracked centre.
    #[must_use]
    pub const fn has_origin(&self) -> bool {
        self.origin_px.is_some() || self.scale.has_origin()
    }

    /// Standard uncertainty of the direction of "up" before the fall is looked at, rad: as given; else that of a levelled camera
    /// where a direction (or a homography, which has one) is given, and next to nothing where none is.
    #[must_use]
    pub fn upright_std_rad(&self) -> f64 {
        let given = self.up_given || matches!(self.scale, Scale::Homography(_));
        self.up_std_rad
            .unwrap_or(if given { LEVELLED_STD_RAD } else { HELD_STD_RAD })
    }

    /// Standard uncertainty of gravity, m/s²: as given; else what a number that somebody looked up has, or what 9.81 has anywhere
    /// on Earth.
    #[must_use]
    pub fn gravity_uncertainty_m_s2(&self) -> f64 {
        let part = if self.gravity_given {
            LOCAL_PART
        } else {
            ANYWHERE_PART
        };
        self.gravity_std_m_s2.unwrap_or(part * self.gravity_m_s2)
    }

    /// That the recording's pictures (after the rotation tag) have the size the calibration is for, if it names one.
    ///
    /// # Errors
    /// Another size: both sizes, and what may have happened (rotated, scaled, cropped).
    pub fn check_image_size(&self, width: usize, height: usize) -> Result<(), CalibrationError> {
        match self.image_size_px {
            Some(calibrated) if calibrated != (width, height) => Err(CalibrationError::ImageSize {
                calibrated,
                found: (width, height),
                hint: size_hint(calibrated, (width, height)),
            }),
            _ => Ok(()),
        }
    }

    /// The same for the camera turned a little, so that what was at p is at p + (`du_px`, `dv_px`). The lens, which turns
    /// with the camera, is taken along, as if the picture were shifted: for shifts that are small against the picture.
    #[must_use]
    pub fn shifted(&self, du_px: f64, dv_px: f64) -> Self {
        let moved = |p: PixelPoint| PixelPoint::new(p.u_px + du_px, p.v_px + dv_px);
        let back = Matrix3::new(1.0, 0.0, -du_px, 0.0, 1.0, -dv_px, 0.0, 0.0, 1.0);
        let mut there = self.clone();
        there.origin_px = self.origin_px.map(moved);
        there.floor.line = self.floor.line.map(|line| FloorLine {
            from: moved(line.from),
            to: moved(line.to),
            ..line
        });
        match &mut there.scale {
            Scale::Ruler { from, to, .. } => (*from, *to) = (moved(*from), moved(*to)),
            Scale::Homography(h) => h.world_from_pixel *= back,
            Scale::MetresPerPixel { .. } | Scale::Ball | Scale::Gravity => {}
        }
        for change in there
            .deviations
            .iter_mut()
            .filter_map(|d| d.world_from_pixel.as_mut())
        {
            *change *= back;
        }
        there.lens = self.lens.as_ref().map(|lens| {
            let mut matrix = *lens.camera_matrix();
            matrix[(0, 2)] += du_px;
            matrix[(1, 2)] += dv_px;
            // A lens remains one wherever its axis is.
            Lens::new(matrix, lens.distortion()).unwrap_or_else(|_| lens.clone())
        });
        there
    }

    /// Points read off the picture that must lie in it, with their keys: ends of a ruler and of a line along the floor.
    fn marks(&self) -> Vec<(&'static str, PixelPoint)> {
        let mut marks = Vec::new();
        if let Scale::Ruler { from, to, .. } = self.scale {
            marks.extend([("scale.from_px", from), ("scale.to_px", to)]);
        }
        if let Some(line) = self.floor.line {
            marks.extend([line.from, line.to].map(|end| ("floor.line_px", end)));
        }
        marks
    }

    /// The map between the picture and the plane of motion.
    ///
    /// # Errors
    /// A singular homography, a zero `up_px` or an origin that cannot be undistorted; a calibration that was read from
    /// a file has none of them.
    pub fn rectification(&self) -> Result<Rectification, CalibrationError> {
        Rectification::new(self)
    }

    /// Metres per plane unit from whichever scale the file names, with its standard uncertainty (1 and the homography's
    /// `relative_std` where the plane unit is the metre already). The rules of the uncertainty are those of [`Scale`]:
    /// relative variances add, and a number given without an uncertainty counts as exact beside one that has it.
    ///
    /// # Errors
    /// A scale that rests on the ball or on gravity, where `evidence` has no such measurement.
    pub fn metres_per_unit(&self, evidence: &ScaleEvidence) -> Result<Quantity, CalibrationError> {
        scale::metres_per_unit(self, evidence)
    }

    /// The angles at which the camera sees, for pictures of `image_size_px` and a plane whose units are `metres_per_unit`
    /// metres long (as far as that is known): by its distance, or by its lens; `None` where neither is given.
    #[must_use]
    pub fn optics(&self, metres_per_unit: Option<f64>, image_size_px: (usize, usize)) -> Option<Optics> {
        let placed = metres_per_unit.and_then(|m| self.viewpoint(m, image_size_px).ok().flatten());
        let of_lens = || self.lens.as_ref().map(Optics::of_lens);
        placed.map(|v| v.optics).or_else(of_lens)
    }

    /// Where the camera stands over the plane, whose units are `metres_per_unit` metres long, in pictures of
    /// `image_size_px`; `None` without [`Self::distance_m`].
    ///
    /// # Errors
    /// As [`Self::rectification`], and a distance that no camera with this homography can have.
    pub fn viewpoint(
        &self,
        metres_per_unit: f64,
        image_size_px: (usize, usize),
    ) -> Result<Option<Viewpoint>, CalibrationError> {
        match self.distance_m {
            Some(distance_m) => Viewpoint::new(self, distance_m / metres_per_unit, image_size_px).map(Some),
            None => Ok(None),
        }
    }
}

fn size_hint(calibrated: (usize, usize), found: (usize, usize)) -> String {
    let (cw, ch) = (calibrated.0 as f64, calibrated.1 as f64);
    let (fw, fh) = (found.0 as f64, found.1 as f64);
    let factor = fw / cw;
    // Encoders round to even sizes: two pixels off is still the same picture, scaled.
    let scaled = (fw - cw * fh / ch).abs() <= 2.0 && (fh - ch * factor).abs() <= 2.0;
    if calibrated == (found.1, found.0) {
        "width and height are swapped: the sizes are meant after the file's rotation tag, so read the pixels of the \
         calibration off a picture as a player shows it"
            .into()
    } else if scaled {
        format!(
            "the recording looks like a version scaled by {factor:.4}: calibrate on this recording, or use the original \
             (scaling by hand: metres_per_pixel times {:.4}; origin_px, from_px, to_px, camera_matrix times {factor:.4})",
            1.0 / factor
        )
    } else {
        "the shape differs too, as after a crop or with another camera: calibrate on this recording".into()
    }
}

/// A matrix as the file writes it.
fn rows_text(m: &Matrix3<f64>) -> String {
    let row = |i: usize| format!("[{}, {}, {}]", m[(i, 0)], m[(i, 1)], m[(i, 2)]);
    format!("[{}, {}, {}]", row(0), row(1), row(2))
}
