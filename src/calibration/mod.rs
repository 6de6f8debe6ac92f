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

mod altered;
mod blurred_edge;
pub mod board;
pub mod check;
mod deviation;
mod error;
mod experiment;
mod file;
mod finding;
mod json;
mod lens;
mod rectification;
pub mod ruler;
mod scale;
mod silhouette;
mod viewpoint;

pub use crate::config::FileProblem;
pub use deviation::Deviation;
pub use error::CalibrationError;
pub use experiment::{BENCH_STD_RAD, Ball, Floor, FloorLine, Launch, View};
pub use file::CalibrationKeys;
pub(crate) use file::INERTIA;
pub use finding::{Finding, Severity};
pub use lens::Lens;
pub use rectification::{PlaneUnit, Rectification};
pub use scale::{Homography, MetresPerPixel, ROUNDED_PIXEL_STD_PX, Ruler, Scale, ScaleEvidence};
pub use silhouette::{Silhouette, Silhouettes};
pub use viewpoint::{Optics, Viewpoint};

use crate::geometry::PixelPoint;
use crate::quantity::Quantity;
use crate::rebound::compliant::stiffness::stiffness_ratio;
use scale::ScaleContext;

/// The schema this version reads and writes.
pub const SCHEMA: &str = "track.calib/1";

/// A phone or camera whose "up" is given without an uncertainty was levelled to this: 0.3 degrees.
pub const LEVELLED_STD_RAD: f64 = 0.3 * std::f64::consts::PI / 180.0;

/// A camera of which nothing is said is held to this standard deviation about its line of sight: 5 degrees. The fall tells
/// far better.
const HELD_STD_RAD: f64 = 5.0 * std::f64::consts::PI / 180.0;

/// Part by which g differs from 9.81 m/s² anywhere on Earth (9.764 to 9.834), and by which it differs from what somebody looked
/// up for his place.
const ANYWHERE_PART: f64 = 3e-3;
const LOCAL_PART: f64 = 1e-4;

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
    /// Rolling shutter: the time from the exposure of the stored picture's first row to that of its last, s; `None`: nothing is
    /// said of it, and all rows are taken as exposed at once unless the flight shows otherwise.
    pub readout_s: Option<f64>,
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

/// A fall contradicts gravity where it is off by more than this many standard uncertainties.
const CONTRADICTS_SIGMAS: f64 = 4.0;

impl Calibration {
    /// κ = G*/E* of ball and floor, where the file says what both are made of.
    #[must_use]
    pub fn stiffness_ratio(&self) -> Option<f64> {
        Some(stiffness_ratio(&self.ball.material?, &self.floor.material?))
    }

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
            readout_s: None,
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

    /// Whether the world's origin is known, by `origin_px` or by a homography; otherwise the floor is found from the
    /// impacts and x = 0 is the first tracked centre.
    #[must_use]
    pub fn has_origin(&self) -> bool {
        self.origin_px.is_some() || self.scale.has_origin()
    }

    /// Whether the file says where "up" is, by `up_px` or by a scale that has the world's axes.
    #[must_use]
    pub fn has_up(&self) -> bool {
        self.up_given || self.scale.has_axes()
    }

    /// Standard uncertainty of the direction of "up" before the fall is looked at, rad: as given; else that of a levelled camera
    /// where a direction (or a homography, which has one) is given, and next to nothing where none is.
    #[must_use]
    pub fn upright_std_rad(&self) -> f64 {
        let otherwise = if self.has_up() {
            LEVELLED_STD_RAD
        } else {
            HELD_STD_RAD
        };
        self.up_std_rad.unwrap_or(otherwise)
    }

    /// By what part the `fall` of a ball (m/s²) is off gravity, where it contradicts it.
    #[must_use]
    pub fn gravity_mismatch(&self, fall: Quantity) -> Option<f64> {
        let off = (fall.value - self.gravity_m_s2).abs();
        let std = fall.std_uncertainty.unwrap_or(0.0);
        let contradicts = off > CONTRADICTS_SIGMAS * std.hypot(self.gravity_uncertainty_m_s2());
        contradicts.then(|| (fall.value / self.gravity_m_s2).ln().abs())
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

    /// Points read off the picture that must lie in it, with their keys: ends of a ruler and of a line along the floor.
    fn marks(&self) -> Vec<(&'static str, PixelPoint)> {
        let mut marks = self.scale.marks();
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
        match self.scale.homography() {
            Some(h) => Rectification::projective(self.lens.as_ref(), &h.world_from_pixel, self.image_size_px),
            None => Rectification::square(self.lens.as_ref(), self.origin_px, self.up_px),
        }
        .map_err(CalibrationError::of)
    }

    /// Metres per plane unit from whichever scale the file names, with its standard uncertainty (1 and the homography's
    /// `relative_std` where the plane unit is the metre already). The rules of the uncertainty:
    /// relative variances add, and a number given without an uncertainty counts as exact beside one that has it.
    ///
    /// # Errors
    /// A scale that rests on the ball or on gravity, where `evidence` has no such measurement.
    pub fn metres_per_unit(&self, evidence: &ScaleEvidence) -> Result<Quantity, CalibrationError> {
        let plane = || self.rectification();
        self.scale
            .metres_per_unit(&self.scale_context(self.image_size_px, &plane), evidence)
    }

    /// What is odd about the scale, for pictures of `image_size_px`.
    fn scale_findings(&self, image_size_px: Option<(usize, usize)>) -> Vec<Finding> {
        let plane = || self.rectification();
        self.scale.findings(&self.scale_context(image_size_px, &plane))
    }

    fn scale_context<'a>(
        &'a self,
        image_size_px: Option<(usize, usize)>,
        plane: &'a dyn Fn() -> Result<Rectification, CalibrationError>,
    ) -> ScaleContext<'a> {
        ScaleContext {
            ball: &self.ball,
            gravity_m_s2: self.gravity_m_s2,
            gravity_std_m_s2: self.gravity_uncertainty_m_s2(),
            frame_rate_hz: self.frame_rate_hz,
            image_size_px,
            plane,
        }
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
            Some(distance_m) => {
                let map = self.rectification()?;
                Viewpoint::new(&map, distance_m / metres_per_unit, image_size_px)
                    .map(Some)
                    .map_err(CalibrationError::of)
            }
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
