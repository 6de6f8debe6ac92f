//! What a measurement of one recording consists of, launch by launch: the shapes that `measure` fills and `report` writes.

pub use crate::calibration::View;
pub use crate::detect::ShownMotion;
use crate::edits::Edits;
use crate::frames::{Chroma, Luma, digest};
use crate::geometry::{PixelPoint, WorldPoint};
use crate::impact::{BenchLaunch, Bounce, Distances, FloorSlope, Readings};
use crate::quantity::Quantity;
use crate::rotation::BallMaps;
use crate::rotation::cube_map::across;
use nalgebra::{Rotation3, Vector3};
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Everything measured on one recording.
#[derive(Debug, Clone)]
pub struct Measurement {
    /// The file.
    pub video: VideoFacts,
    /// The calibration as it was used.
    pub calibration: CalibrationFacts,
    /// What the second coordinate of a [`WorldPoint`] is.
    pub view: View,
    /// Whether it was measured, and why not.
    pub outcome: Outcome,
    /// The ball in every frame where it was seen.
    pub track: Track,
    /// Magnitude of the acceleration in flight, m/s², where the scale does not itself come from gravity.
    pub gravity_m_s2: Option<Quantity>,
    /// How far "up" is from where the calibration has it, in a side view.
    pub up: Option<UpTilt>,
    /// The floor's slope, in a side view.
    pub floor: Option<FloorSlope>,
    /// Where the ball left a bench that it was seen on.
    pub launch: Option<BenchLaunch>,
    /// The impacts on the floor, in time order.
    pub bounces: Vec<Bounce>,
    /// x0 and x.
    pub distances: Distances,
    /// What the models make of the first bounce.
    pub readings: Option<Readings>,
    /// What a person said of the recording, where somebody did.
    pub edits: Option<Edits>,
    /// What the user has to know, in order of appearance.
    pub warnings: Vec<Warning>,
    /// The fitted arcs.
    pub arcs: Vec<ArcTrace>,
    /// Drag β of the arcs, 1/m: the deceleration over the square of the speed.
    pub drag_per_m: Option<Quantity>,
    /// What a stroboscopic picture is made of.
    pub strobe: Option<Strobe>,
    /// Where the recording holds several launches, each of them as a measurement of its own, in time order: what stands above is
    /// then the first's, but for the warnings, which are all of them. Empty where there is one.
    pub launches: Vec<Measurement>,
}

impl Measurement {
    /// Every launch, in time order; of a recording with one, that is the measurement itself.
    #[must_use]
    pub fn each_launch(&self) -> &[Self] {
        if self.launches.is_empty() {
            std::slice::from_ref(self)
        } else {
            &self.launches
        }
    }

    /// Notes the SHA-256 of the recording and of the calibration's file, where they can be read through.
    pub fn note_digests(&mut self, video: &Path, calibration: &Path) {
        self.video.sha256 = digest::of_recording(video).ok();
        self.calibration.sha256 = digest::of_file(calibration).ok();
    }

    /// First and last time at which the ball was seen in free flight, s; `None` where it was not.
    #[must_use]
    pub fn time_span(&self) -> Option<(f64, f64)> {
        let mut flown = self
            .track
            .points
            .iter()
            .filter(|p| matches!(p.use_, PointUse::Used(_)));
        let first = flown.next()?;
        Some((first.time_s, flown.next_back().unwrap_or(first).time_s))
    }
}

/// The recording as a file.
#[derive(Debug, Clone)]
pub struct VideoFacts {
    /// As the user named it.
    pub path: PathBuf,
    /// SHA-256 of its bytes, in hexadecimal digits (of a folder, of its pictures' names and digests); `None` where nobody asked for it.
    pub sha256: Option<String>,
    /// Columns.
    pub width_px: usize,
    /// Rows.
    pub height_px: usize,
    /// Frames read.
    pub frames: u64,
    /// Rate of distinct frames on the time base in use, Hz.
    pub frame_rate_hz: Option<f64>,
    /// Last time minus first, s.
    pub duration_s: f64,
    /// Where times come from.
    pub time_source: TimeSource,
    /// Whether the camera moves, as far as the scene shows; `None` where there is no picture.
    pub camera: Option<CameraSeen>,
}

/// What the scene shows of the camera's motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraSeen {
    /// No motion but swings is seen.
    pub stands_still: bool,
    /// What would be seen.
    pub shown_motion: ShownMotion,
}

/// The calibration as it was used.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CalibrationFacts {
    /// As the user named its file.
    pub name: String,
    /// SHA-256 of that, in hexadecimal digits; `None` where nobody asked for it.
    pub sha256: Option<String>,
    /// Length of a pixel near the ball; `None` where nothing told it.
    pub metres_per_pixel: Option<Quantity>,
    /// The world's origin in the picture.
    pub origin_px: Option<PixelPoint>,
    /// Direction of "up" in the picture, (du, dv), as the calibration has it.
    pub up_px: [f64; 2],
    /// The true capture rate, where the calibration gives it, Hz.
    pub frame_rate_hz: Option<f64>,
}

/// The direction of "up" in use.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UpTilt {
    /// Angle from the calibration's "up" (straight up in the picture where it has none) to the one in use, rad; positive to
    /// the right in the picture.
    pub tilt_rad: Quantity,
    /// What tells it more closely.
    pub source: UpSource,
}

/// What tells "up".
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UpSource {
    /// The calibration.
    Calibration,
    /// The direction in which all arcs fall.
    Fall,
}

/// Where times come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TimeSource {
    /// The file's own presentation time stamps.
    Stamps,
    /// `frame_rate_hz` of the calibration.
    Calibration,
}

/// Measured, or not and why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// There are bounces.
    Measured,
    /// There is nothing to trust.
    Rejected {
        /// Why, and what to try, in a sentence or two.
        reason: String,
    },
}

/// The ball's centres.
#[derive(Debug, Clone)]
pub struct Track {
    /// The centre method.
    pub method: String,
    /// Frames in which the ball was seen.
    pub detected: usize,
    /// Typical standard uncertainty of a centre in each coordinate as the flight's residuals show it, px.
    pub centre_std_px: Option<f64>,
    /// The ball's radius, px.
    pub radius_px: Option<Quantity>,
    /// A row for every frame in which the ball was seen, in time order.
    pub points: Vec<TrackPoint>,
}

/// One centre.
#[derive(Debug, Clone)]
pub struct TrackPoint {
    /// Frame in presentation order, from 0.
    pub frame: usize,
    /// Time on the time base in use, s.
    pub time_s: f64,
    /// Centre in that frame's own picture.
    pub pixel: PixelPoint,
    /// Standard uncertainty of each coordinate, px.
    pub std_px: Option<f64>,
    /// Centre in the world, `None` without a scale.
    pub world: Option<WorldPoint>,
    /// The arc it belongs to and was used for, or why it was not used.
    pub use_: PointUse,
    /// Residual to its arc (measured − fitted): along x and along up, m; `None` when it belongs to no arc.
    pub residual_m: Option<WorldPoint>,
}

/// Whether a point entered a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PointUse {
    /// Used for the arc with this index.
    Used(usize),
    /// Not used, and why.
    Unused(UnusedReason),
}

/// Why a point entered no fit. As text, a short phrase with its number: "off its arc by 2.31 mm".
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum UnusedReason {
    /// On the bench, in a hand, or after the flights that were measured.
    NotFree,
    /// The ball touches the floor, or may.
    Contact,
    /// Off its arc by more than its scatter allows.
    OffArc {
        /// How far, m.
        by_m: f64,
    },
    /// A person said that the frame is not to be used.
    Excluded,
}

impl UnusedReason {
    /// A word without numbers, the same from version to version.
    #[must_use]
    pub const fn code(self) -> &'static str {
        match self {
            Self::NotFree => "not_free",
            Self::Contact => "contact",
            Self::OffArc { .. } => "off_arc",
            Self::Excluded => "excluded",
        }
    }

    /// The same for people, without numbers.
    #[must_use]
    pub const fn phrase(self) -> &'static str {
        match self {
            Self::NotFree => "not in free flight",
            Self::Contact => "touches the floor",
            Self::OffArc { .. } => "off its arc",
            Self::Excluded => "excluded by a person",
        }
    }

    /// How far the point is off its arc, where that is why, m.
    #[must_use]
    pub const fn off_arc_m(self) -> Option<f64> {
        match self {
            Self::OffArc { by_m } => Some(by_m),
            Self::NotFree | Self::Contact | Self::Excluded => None,
        }
    }
}

impl fmt::Display for UnusedReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.phrase())?;
        self.off_arc_m()
            .map_or(Ok(()), |by_m| write!(f, " by {:.2} mm", 1e3 * by_m))
    }
}

/// A fitted arc: its motion at one time, from which gravity and drag draw the rest, and a fine polyline (24 points or more), ready to draw.
#[derive(Debug, Clone)]
pub struct ArcTrace {
    /// First to last time, s.
    pub samples: Vec<ArcSample>,
    /// In its middle.
    pub motion: ArcMotion,
    /// How the ball turned; `None` where it is plain.
    pub spin: Option<ArcSpin>,
}

/// How the ball turned on an arc, by the marks on it.
#[derive(Debug, Clone)]
pub struct ArcSpin {
    /// Rates about x, y and z, rad/s; about y positive where the top moves along x. `None` where several suit, or none.
    pub rate_rad_s: Option<[Quantity; 3]>,
    /// The rates about y that suit the pictures, where several do or none is stated, rad/s.
    pub candidates_rad_s: Vec<f64>,
    /// Why there is no rate, or how it was told from others.
    pub reason: Option<String>,
    /// Frame by frame, where there is a rate.
    pub turning: Option<BallTurning>,
}

/// A rotation frame by frame, camera axes (right, down, away).
#[derive(Debug, Clone)]
pub struct BallTurning {
    /// Rotation vector, rad/s.
    pub rate_rad_s: [f64; 3],
    /// When the ball lies as its map does, s.
    pub middle_s: f64,
    /// The frames.
    pub frames: Vec<TurnedFrame>,
    /// The ball's albedo and light.
    pub maps: Arc<BallMaps>,
}

impl BallTurning {
    /// Two directions of the ball square to its axis and that axis, as the ball lies in the middle.
    #[must_use]
    pub fn ball_axes(&self) -> [Vector3<f64>; 3] {
        let axis = Vector3::from(self.rate_rad_s)
            .try_normalize(0.0)
            .unwrap_or_else(Vector3::z);
        let one = across(&axis);
        [one, axis.cross(&one), axis]
    }

    /// By what the ball is turned at a time from how it lies in the middle.
    #[must_use]
    pub fn turn_at(&self, time_s: f64) -> Rotation3<f64> {
        Rotation3::new(Vector3::from(self.rate_rad_s) * (time_s - self.middle_s))
    }
}

/// How far the ball had turned in a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TurnedFrame {
    /// The frame in presentation order.
    pub frame: usize,
    /// Its time, s.
    pub time_s: f64,
    /// About the axis by the steady rate, rad.
    pub turned_rad: f64,
    /// By how much more its own pixels have it, rad.
    pub residual_rad: f64,
    /// Standard uncertainty of that, rad.
    pub std_rad: f64,
}

/// Where a ball is and how fast, on an arc.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArcMotion {
    /// When, s.
    pub time_s: f64,
    /// Where, m.
    pub place: WorldPoint,
    /// How fast along x, m/s.
    pub vx_m_s: f64,
    /// How fast along the second coordinate (z, or in a top view y), m/s.
    pub up_m_s: f64,
}

/// A point of a fitted arc.
#[derive(Debug, Clone, Copy)]
pub struct ArcSample {
    /// Time, s.
    pub time_s: f64,
    /// Place in the reference picture.
    pub pixel: PixelPoint,
    /// Place in the world, `None` without a scale.
    pub world: Option<WorldPoint>,
}

/// A word to the user: a stable code and a sentence.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Warning {
    /// Stable, lower case with underscores.
    pub code: &'static str,
    /// What was noticed, with numbers, and what to do.
    pub message: String,
}

/// What a stroboscopic picture is made of: the empty scene, and the ball cut out of its frames.
#[derive(Debug, Clone)]
pub struct Strobe {
    /// The scene without anything that moves, code values stretched to 0..=255; all launches share it.
    pub background: Arc<Luma>,
    /// Its chroma, code values stretched to 0..=255 around 128; `None` for a grey recording.
    pub chroma: Option<Arc<Chroma>>,
    /// The shares of red and blue in luma.
    pub luma_shares: (f64, f64),
    /// Cut-outs of used points, in time order.
    pub balls: Vec<StrobeBall>,
}

/// A ball cut out of its frame.
#[derive(Debug, Clone)]
pub struct StrobeBall {
    /// The frame it comes from.
    pub frame: usize,
    /// Column and row of the cut-out's top-left pixel in the background's picture (may be negative).
    pub corner_px: (i64, i64),
    /// The cut-out, stretched like the background.
    pub luma: Luma,
    /// Chroma [U, V] of each of its pixels, stretched like the background; `None` where there is none.
    pub chroma: Option<Vec<[u8; 2]>>,
    /// Centre in the background's picture.
    pub centre: PixelPoint,
    /// Ball radius, px.
    pub radius_px: f64,
}
