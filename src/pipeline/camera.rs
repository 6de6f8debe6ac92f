//! The camera as the calibration has it, with what its distance and the ball's own facts say of the motion in the picture:
//! a ball's centre is not that of its outline, from above it is not over the point against which it is seen, and the air
//! brakes it.

use super::measurement::Warning;
use super::readout::Readout;
use super::warnings::warning;
use crate::calibration::{
    Calibration, CalibrationError, Optics, Rectification, ScaleEvidence, Silhouettes, View, Viewpoint,
};
use crate::detect::ShownMotion;
use crate::detect::background::{Background, UnseenMotion};
use crate::detect::colour::ColourChoice;
use crate::flight::Flight;
use crate::flight::bend::CameraFacts;
use crate::flight::distant_top_view::{self, DistantTopView};
use crate::flight::drag::Drag;
use crate::flight::flight_search::FlightSearch;
use crate::flight::motion_model::VerticalPrior;
use crate::flight::near_top_view::NearTopView;
use crate::flight::planar::GRAVITY;
use crate::flight::side_view::SideView;
use crate::frames::RowOrder;
use crate::geometry::{PixelPoint, PlanePoint};
use crate::impact::error_budget::{AXIS_PART, DISTANCE_RELATIVE_STD, SPHERE_DRAG_RELATIVE_STD};
use crate::impact::motion::falling_share;
use crate::quantity::Quantity;

/// A ball's speed where nothing is seen of it yet, m/s: drag hardly depends on it.
const USUAL_SPEED_M_S: f64 = 2.0;

/// A camera whose distance nobody says stands so many widths (or heights) of the picture away, to a factor whose logarithm has this standard uncertainty: from a
/// wide phone to a long lens.
const USUAL_DISTANCE_PICTURES: f64 = 2.2;
const USUAL_DISTANCE_LN_STD: f64 = 0.5;

/// Gravity and the scale are known to this part at best, as far as lengths are told by them.
const LEAST_FALL_RELATIVE_STD: f64 = 5e-4;

/// The same for a ball of which nobody says what it weighs.
const UNKNOWN_BALL_FALL_RELATIVE_STD: f64 = 3e-3;

/// A calibrated camera and its pictures.
#[derive(Debug, Clone)]
pub struct CalibratedCamera<'a> {
    /// What is known of it.
    pub calibration: &'a Calibration,
    /// From the reference picture to the calibrated plane.
    pub map: Rectification,
    /// Columns and rows of its pictures.
    pub size_px: (usize, usize),
    /// Whether it stands still, but for swings.
    pub stands_still: bool,
    /// How well it is known where a frame looks, the first one above all, whose pixels are those of the calibration, px; 0 where it stands still.
    pub shift_std_px: f64,
    /// Which motions of it the scene shows; `None` where there is no picture.
    pub shown_motion: Option<ShownMotion>,
    /// How it may move beyond what its frames were registered by; none where it stands still.
    pub unseen_motions: Vec<UnseenMotion>,
    /// How well it is known where chroma lies against luma, as far as the ball is seen by it, px; 0 where it is seen by luma alone.
    pub chroma_std_px: f64,
    /// Part of the ball's contrast that is chroma's.
    pub chroma_share: f64,
    /// When its rows are exposed.
    pub readout: Readout,
}

impl<'a> CalibratedCamera<'a> {
    /// For pictures of `size_px` whose stored rows run in `row_order`.
    ///
    /// # Errors
    /// A calibration that maps no plane.
    pub fn new(
        calibration: &'a Calibration,
        size_px: (usize, usize),
        row_order: RowOrder,
        stands_still: bool,
    ) -> Result<Self, CalibrationError> {
        Ok(Self {
            calibration,
            map: calibration.rectification()?,
            size_px,
            stands_still,
            shift_std_px: 0.0,
            shown_motion: None,
            unseen_motions: Vec::new(),
            chroma_std_px: 0.0,
            chroma_share: 0.0,
            readout: Readout::global(size_px, row_order).of(calibration.readout_s.unwrap_or(0.0), 0.0),
        })
    }

    /// The same of which the scene tells where a frame looks as far as `background` says.
    #[must_use]
    pub fn seen_by(self, background: &Background) -> Self {
        Self {
            shift_std_px: background.shift_std_px,
            shown_motion: Some(background.shown_motion),
            unseen_motions: background.unseen_motions.clone(),
            ..self
        }
    }

    /// The same that sees the ball by what `colour` says.
    #[must_use]
    pub fn with_colour(self, colour: Option<&ColourChoice>) -> Self {
        Self {
            chroma_std_px: colour.map_or(0.0, |c| c.place_std_px.0.max(c.place_std_px.1)),
            chroma_share: colour.map_or(0.0, |c| c.chroma_share),
            ..self
        }
    }

    /// The same with a readout of `whole_s` ± `std_s`.
    #[must_use]
    pub fn with_readout(&self, whole_s: f64, std_s: f64) -> Self {
        Self {
            readout: self.readout.of(whole_s, std_s),
            ..self.clone()
        }
    }

    /// Whether the ball falls in the picture.
    pub fn falls(&self) -> bool {
        self.calibration.view == View::Side
    }

    /// Where the camera's axis meets the plane, as far as that is the middle of the picture.
    pub fn axis(&self) -> PlanePoint {
        let (width, height) = self.size_px;
        let middle = PixelPoint::new(0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0));
        self.map
            .plane_from_pixel(middle)
            .unwrap_or(PlanePoint::new(0.0, 0.0))
    }

    /// What a change of scale depends on, where a plane unit is `metres_per_unit` long.
    pub fn facts(&self, metres_per_unit: Quantity) -> CameraFacts {
        let (c, unit_m) = (self.calibration, metres_per_unit.value);
        let (width, height) = self.size_px;
        let picture = width.max(height) as f64 * self.units_per_px();
        let scale = metres_per_unit.std_uncertainty.unwrap_or(0.0) / unit_m;
        let gravity = c.gravity_uncertainty_m_s2() / c.gravity_m_s2;
        CameraFacts {
            axis: self.axis(),
            stands_still: self.stands_still,
            distance: c.distance_m.map_or(
                (USUAL_DISTANCE_PICTURES * picture, USUAL_DISTANCE_LN_STD),
                |distance_m| {
                    let relative = c.distance_std_m.map_or(DISTANCE_RELATIVE_STD, |s| s / distance_m);
                    (distance_m / unit_m, relative)
                },
            ),
            fall: (!c.scale.rests_on_fall()).then(|| {
                let air = match c.ball.mass_kg {
                    Some(_) => LEAST_FALL_RELATIVE_STD,
                    None => UNKNOWN_BALL_FALL_RELATIVE_STD,
                };
                let fall = falling_share(&c.ball) * c.gravity_m_s2 / unit_m;
                (fall, gravity.hypot(scale).hypot(air) * fall)
            }),
        }
    }

    /// Length of a pixel in the middle of the picture, plane units.
    pub fn units_per_px(&self) -> f64 {
        let (width, height) = self.size_px;
        let middle = PixelPoint::new(width as f64 / 2.0, height as f64 / 2.0);
        self.map
            .jacobian(middle)
            .map_or(1.0, |j| j.determinant().abs().sqrt())
    }

    /// Length of a pixel of the usual ball's radius, plane units.
    pub fn ball_units_per_px(&self) -> f64 {
        self.silhouettes(None).units_per_px().unwrap_or(1.0)
    }

    /// How the pictures draw the ball, as far as the camera's angles are known.
    pub fn silhouettes(&self, optics: Option<Optics>) -> Silhouettes<'_> {
        Silhouettes::new(&self.map, optics, self.middle())
    }

    /// The middle of the picture.
    pub fn middle(&self) -> PixelPoint {
        let middle = |size: usize| 0.5 * (size as f64 - 1.0);
        PixelPoint::new(middle(self.size_px.0), middle(self.size_px.1))
    }

    /// The camera's angles, where its lens, or its distance and the scale are known.
    pub fn optics(&self, metres_per_unit: Option<Quantity>) -> Option<Optics> {
        self.calibration
            .optics(metres_per_unit.map(|q| q.value), self.size_px)
    }

    /// Metres a plane unit, as far as the calibration alone tells: a scale that rests on the recording itself has to wait for
    /// the ball.
    pub fn metres_per_unit_before_flight(&self) -> Option<Quantity> {
        self.calibration.metres_per_unit(&ScaleEvidence::default()).ok()
    }

    /// Metres a plane unit without the fall: by the calibration, or, where the ball is its scale, by the `radius` of what falls, plane units.
    pub fn metres_per_unit_by_radius(&self, radius: f64) -> Option<f64> {
        let c = self.calibration;
        if c.scale.rests_on_ball() {
            Some(c.ball.radius_m? / radius)
        } else {
            self.metres_per_unit_before_flight().map(|q| q.value)
        }
    }

    /// Metres a plane unit, from whatever scale the calibration names.
    ///
    /// # Errors
    /// Where what that scale rests on was not measured.
    pub fn metres_per_unit(
        &self,
        flight: &Flight,
        radius_px: Option<Quantity>,
    ) -> Result<Quantity, CalibrationError> {
        let units = self.ball_units_per_px();
        let g = flight.fit.gravity();
        self.calibration.metres_per_unit(&ScaleEvidence {
            ball_radius_units: radius_px.map(|r| r.scaled(units)),
            gravity_units_s2: (g > 0.0)
                .then(|| Quantity::new(g, flight.fit.covariance[(GRAVITY, GRAVITY)].max(0.0).sqrt()))
                .flatten(),
        })
    }

    /// How the ball moves, by the calibration and the `flight` found so far, if any: the one place where a motion model is
    /// chosen. Drag is in it where the ball's size and mass tell it.
    pub fn motion_model(
        &self,
        flight: Option<&Flight>,
        metres_per_unit: Option<Quantity>,
    ) -> Box<dyn FlightSearch> {
        let scale = metres_per_unit.map(|s| s.value);
        if self.falls() {
            return Box::new(SideView {
                vertical: VerticalPrior::LEVEL_CAMERA,
                drag: flight.and_then(|f| self.drag(scale, f.mean_speed())),
                bend: None,
                scale_change: None,
                ball_radius: self.ball_radius(),
            });
        }
        match self.near_top_view(scale, flight) {
            Some(near) => Box::new(near),
            None => Box::new(DistantTopView {
                drag: flight.and_then(|f| {
                    let along = distant_top_view::drag_along_floor;
                    along(f.mean_speed(), scale?, |speed| self.drag(scale, speed))
                }),
            }),
        }
    }

    /// The ball's radius as the calibration has it, plane units; `None` where the flight or the ball itself tells lengths.
    pub fn ball_radius(&self) -> Option<f64> {
        let known_m = self.calibration.ball.radius_m;
        let known_m = known_m.filter(|_| !self.calibration.scale.rests_on_ball())?;
        Some(known_m / self.metres_per_unit_before_flight()?.value)
    }

    /// Where the camera stands over the plane, as far as `metres_per_unit` is known.
    fn viewpoint(&self, metres_per_unit: f64) -> Option<Viewpoint> {
        self.calibration
            .viewpoint(metres_per_unit, self.size_px)
            .ok()
            .flatten()
    }

    /// Drag, where the ball's size and mass tell it. `speed` is that of the flight, plane units a second.
    pub fn drag(&self, metres_per_unit: Option<f64>, speed: f64) -> Option<Drag> {
        let (ball, scale) = (&self.calibration.ball, metres_per_unit?);
        Some(Drag::of_sphere(
            (ball.radius_m?, ball.mass_kg?),
            scale,
            speed,
            SPHERE_DRAG_RELATIVE_STD,
        ))
    }

    /// The camera above the floor, where its distance is known; without `metres_per_unit` as far as other scales tell.
    /// `flight` is what was found of it so far.
    fn near_top_view(&self, metres_per_unit: Option<f64>, flight: Option<&Flight>) -> Option<NearTopView> {
        let c = self.calibration;
        let scale = metres_per_unit.or_else(|| Some(self.metres_per_unit_before_flight()?.value));
        // Foot and height in metres are the same whatever a pixel measures.
        let unit = scale.unwrap_or(1.0);
        let camera = self.viewpoint(unit)?;
        let height_m = camera.height * unit;
        let distance = c.distance_std_m.map_or(DISTANCE_RELATIVE_STD, |s| s / height_m);
        let speed = flight.map_or(USUAL_SPEED_M_S / unit, Flight::mean_speed);
        let gravity = c.gravity_std_m_s2.map_or(0.0, |s| s / c.gravity_m_s2);
        Some(NearTopView {
            nadir: camera.foot,
            nadir_std: AXIS_PART * self.size_px.0 as f64 * self.units_per_px(),
            fall_per_s2: c.gravity_m_s2 / height_m,
            fall_relative_std: distance.hypot(gravity),
            height: scale.map(|_| camera.height),
            contact: c.ball.radius_m.map(|r| r / height_m),
            drag: self.drag(scale, speed),
            inertia_factor: c.ball.inertia_factor,
        })
    }

    /// A top view whose camera is not known to be far; a rolling shutter that the flight shows.
    pub fn warnings(&self) -> Vec<Warning> {
        self.near_unsaid()
            .into_iter()
            .chain(self.rolls_unsaid())
            .collect()
    }

    fn rolls_unsaid(&self) -> Option<Warning> {
        let (whole_s, std_s) = (self.readout.whole_s, self.readout.std_s);
        (self.calibration.readout_s.is_none() && whole_s != 0.0).then(|| {
            let way = if whole_s > 0.0 { "last" } else { "last, which comes first" };
            warning!(
                "rolling_shutter",
                "the flight shows that the rows of a picture are not exposed at once: from the first stored row to the {way}, {:.2} ± {:.2} ms pass. Each centre was given its row's time, and the uncertainties hold what is not known of it. Set \"camera\": {{\"readout_s\": {:.5}}} in the calibration, better as measured of this camera and mode (a lamp that flashes, or a recording that shows it clearly).",
                1e3 * whole_s.abs(), 1e3 * std_s, whole_s
            )
        })
    }

    fn near_unsaid(&self) -> Option<Warning> {
        let c = self.calibration;
        (c.view == View::Top && c.distance_m.is_none()).then(|| {
            warning!(
                "perspective_uncorrected",
                "seen from above, the ball nears the camera as it rises, which bends its path in the picture and turns its directions: without the camera's distance that is not corrected. The uncertainties have as much of it as the bend of the path leaves open. With the camera D above the floor and the ball H high, directions may be off by about H/D times the ball's distance from the picture's middle over the length of its path. Set \"distance_m\" to the distance from the lens to the floor."
            )
        })
    }
}
