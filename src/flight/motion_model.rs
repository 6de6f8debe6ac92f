//! How a ball moves before a camera: the seam between the points of a picture and the arcs of a flight.
//!
//! | model | file | the arcs |
//! |---|---|---|
//! | side view | `side_view` | parabolas in the calibrated plane, bent by drag; one fall for all |
//! | distant top view | `distant_top_view` | straight lines over the floor |
//! | near top view | `near_top_view` | three dimensions from two: the height bends the path and enlarges the ball |
//!
//! A model says how its arcs move, how they are fitted to points ([`MotionModel`]), and how they are found in what moves
//! ([`FlightSearch`](super::flight_search::FlightSearch)). All other files ask the model, and none asks which one it is. A new
//! model touches three files: its own, which implements both traits; `flight/mod.rs`, which declares it; `pipeline/camera.rs`,
//! where the calibration chooses a model.

use super::drag::DragLaw;
use super::parabola::Gravity;
use super::planar::{ACROSS, DRAG, GRAVITY, Motion, PlanarArcs};
use super::scale_change::ScaleChange;
use super::segment::TrackSample;
use crate::geometry::PlanePoint;
use crate::quantity::Quantity;
use nalgebra::{DMatrix, DVector};
use std::fmt::Debug;
use std::sync::Arc;

/// A point for the fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitPoint {
    /// The arc it belongs to.
    pub arc: usize,
    /// Time, place, weight.
    pub sample: TrackSample,
}

/// How the arcs of one kind of view move. Arcs are given by a vector of `parameters`, of which the first are those of
/// [`PlanarArcs`], and the mean `times` of their points, s. What has a default here is that of a ball which moves in the
/// calibrated plane.
pub trait MotionModel: Debug + Send + Sync {
    /// Fits `arcs` arcs to `points` (in time order); `None` where some arc has too few points, or they do not determine what is
    /// fitted.
    fn fit(&self, points: &[FitPoint], arcs: usize) -> Option<ArcFit>;

    /// How the parameters of `fit` follow, to first order, when each of its `points` moves by its shift along r and h (plane
    /// units). `None` where these points do not determine them.
    fn response(&self, fit: &ArcFit, points: &[FitPoint], shifts: &[(f64, f64)]) -> Option<DVector<f64>>;

    /// The time at which arcs `k` and `k + 1` of `fit`, with points in `spans`, meet in an impact; `None` where they do not.
    fn impact_between(&self, fit: &ArcFit, spans: &[(f64, f64)], k: usize, interval_s: f64) -> Option<f64>;

    /// Whether gravity acts in the plane.
    fn falls_in_plane(&self) -> bool {
        false
    }

    /// Whether nothing bends an arc but drag.
    fn is_straight(&self) -> bool {
        false
    }

    /// Whether the arcs have a height over the plane: then the ball's size in the picture and its place in the plane follow from
    /// its arc, and the arcs have a lift of their own.
    fn resolves_height(&self) -> bool {
        false
    }

    /// What is known of "up" beside the fall; `None` where nothing falls in the plane.
    fn vertical_prior(&self) -> Option<VerticalPrior> {
        None
    }

    /// The same with this prior of "up", and an unknown drag of a ball of this radius (plane units) where nothing is known of it;
    /// `None` where that changes nothing.
    fn with_unknowns(&self, _vertical: VerticalPrior, _ball_radius: f64) -> Option<Arc<dyn MotionModel>> {
        None
    }

    /// How drag changes with the speed of a ball in the plane.
    fn drag_law(&self) -> DragLaw {
        DragLaw::default()
    }

    /// How far arcs may be bent by what the model does not know, a part of their way; `None` where they are not.
    fn bend(&self) -> Option<f64> {
        None
    }

    /// The same with arcs that may be bent by this part of their way; `None` where the model has no such arcs.
    fn with_bend(&self, _part: f64) -> Option<Arc<dyn MotionModel>> {
        None
    }

    /// The same with a scale that changes; `None` where the model has no such scale.
    fn with_scale_change(&self, _change: ScaleChange) -> Option<Arc<dyn MotionModel>> {
        None
    }

    /// Residuals below this part of the ball's radius are not worth a cut between two arcs: drag over a long arc, a drifting
    /// hand-held camera.
    fn segmentation_part_of_radius(&self) -> f64 {
        0.04
    }

    /// Motion on arc `k` at time `t` in the calibrated plane (of a camera above: over the floor).
    fn motion_in_plane(&self, parameters: &[f64], times: &[f64], k: usize, t: f64) -> Motion {
        let planar = PlanarArcs {
            parameters,
            times,
            law: self.drag_law(),
            bent: self.bend().is_some(),
        };
        planar.motion(k, t)
    }

    /// The same as the picture shows it against the plane: what spots are compared with.
    fn motion_in_picture(&self, parameters: &[f64], times: &[f64], k: usize, t: f64) -> Motion {
        self.motion_in_plane(parameters, times, k, t)
    }

    /// Speed on arc `k` at time `t`, plane units a second.
    fn speed(&self, parameters: &[f64], times: &[f64], k: usize, t: f64) -> f64 {
        let m = self.motion_in_plane(parameters, times, k, t);
        m.vr.hypot(m.vh)
    }

    /// Time of the impact between arcs `k` and `k + 1`, s; `None` where the two do not part.
    fn impact_time(&self, parameters: &[f64], times: &[f64], k: usize) -> Option<f64> {
        let planar = PlanarArcs {
            parameters,
            times,
            law: self.drag_law(),
            bent: self.bend().is_some(),
        };
        planar.intersection(k, k + 1).map(|m| m.0)
    }

    /// How many times larger than in the calibrated plane the ball of `fit` is seen on arc `k` at time `t`.
    fn magnification(&self, _fit: &ArcFit, _k: usize, _t: f64) -> f64 {
        1.0
    }

    /// The point of the calibrated plane that a ball seen against `place` is at (of a camera above: over), on arc `k` of `fit`
    /// at time `t`.
    fn place_in_plane(&self, _fit: &ArcFit, place: PlanePoint, _k: usize, _t: f64) -> PlanePoint {
        place
    }

    /// Where in the plane of motion a mark lies that the picture shows against `place`, for a ball that passed it at time `t`.
    fn mark_in_plane(&self, _parameters: &[f64], place: PlanePoint, _t: f64) -> PlanePoint {
        place
    }

    /// The fall that the arcs themselves show, over the one that the model was given: a check on the camera's distance and the
    /// clock. `None` where the model was given none, or the points do not determine it.
    fn fall_ratio(&self, _points: &[FitPoint], _arcs: usize) -> Option<Quantity> {
        None
    }
}

/// How well the direction of "up" is known without the fall: the standard uncertainty of the angle by which the fall may lean,
/// rad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VerticalPrior {
    /// rad; infinite where only the fall tells, 0 where the fall is taken not to lean unless it does by more than is tolerated.
    pub std_rad: f64,
    /// A fall that leans by less does not contradict what is known, rad.
    pub tolerated_rad: f64,
}

impl VerticalPrior {
    /// Nothing is known: the fall alone tells.
    pub const UNKNOWN: Self = Self {
        std_rad: f64::INFINITY,
        tolerated_rad: 0.0,
    };

    /// A camera that stands level, as far as rough centres tell: while arcs are looked for, so that what is no ball's path does not
    /// pass for one that leans.
    pub const LEVEL_CAMERA: Self = Self {
        std_rad: 0.0,
        tolerated_rad: 0.035,
    };

    /// Known to a standard uncertainty.
    #[must_use]
    pub const fn known_to(std_rad: f64) -> Self {
        Self {
            std_rad,
            tolerated_rad: 0.0,
        }
    }
}

/// The fitted arcs.
#[derive(Debug, Clone)]
pub struct ArcFit {
    /// Mean time of each arc, s.
    pub times: Vec<f64>,
    /// g, β, the acceleration along r, then r, vr, h, vh of each arc at its mean time; a model may have more behind them.
    pub parameters: DVector<f64>,
    /// Their covariance, reduced chi squared and autocorrelation inflation included.
    pub covariance: DMatrix<f64>,
    /// Reduced chi, √(χ²/ν): root mean square residual over stated uncertainty.
    pub reduced_chi: f64,
    /// (1 + ρ)/(1 − ρ) for the correlation ρ of successive residuals, 1 where it does not show; in the covariance.
    pub autocorrelation_inflation: f64,
    /// The model that was assumed.
    pub model: Arc<dyn MotionModel>,
    /// −2 ln of the likelihood of the points under that model, whatever its parameters (a constant apart that models of the same arcs
    /// share); `None` where the model does not tell.
    pub deviance: Option<f64>,
}

impl ArcFit {
    /// Number of arcs.
    #[must_use]
    pub fn arcs(&self) -> usize {
        self.times.len()
    }

    /// Whether gravity acts in the plane.
    #[must_use]
    pub fn falls_in_plane(&self) -> bool {
        self.model.falls_in_plane()
    }

    /// Size of the fitted gravity, plane units/s².
    #[must_use]
    pub fn gravity(&self) -> f64 {
        match self.parameters[ACROSS] {
            0.0 => self.parameters[GRAVITY],
            across => self.parameters[GRAVITY]
                .hypot(across)
                .copysign(self.parameters[GRAVITY]),
        }
    }

    /// By how much the fall leans along +r, rad: "up" of the plane is turned by so much from that of the picture, towards −r.
    #[must_use]
    pub fn lean_rad(&self) -> f64 {
        lean_rad(self.parameters.as_slice())
    }

    /// Standard uncertainty of the lean, rad.
    #[must_use]
    pub fn lean_std_rad(&self) -> f64 {
        self.covariance[(ACROSS, ACROSS)].max(0.0).sqrt() / self.gravity().abs()
    }

    /// The common acceleration, plane units/s².
    #[must_use]
    pub fn acceleration(&self) -> Gravity {
        Gravity {
            down: self.parameters[GRAVITY],
            across: self.parameters[ACROSS],
        }
    }

    /// Drag β in use, 1 / plane unit.
    #[must_use]
    pub fn drag(&self) -> f64 {
        self.parameters[DRAG]
    }

    /// How the parameters follow when points move; see [`MotionModel::response`].
    #[must_use]
    pub fn response(&self, points: &[FitPoint], shifts: &[(f64, f64)]) -> Option<DVector<f64>> {
        self.model.response(self, points, shifts)
    }

    /// Adds to the covariance that the `points` may all be off together, by `shifts` times one normal number. Shifts that the points do not follow add
    /// nothing.
    pub fn widen(&mut self, points: &[FitPoint], shifts: &[(f64, f64)]) {
        if let Some(change) = self.response(points, shifts) {
            self.covariance += &change * change.transpose();
        }
    }

    /// Motion on arc `k` at time `t` with the fitted parameters, as the plane shows it: what spots are compared with.
    #[must_use]
    pub fn motion(&self, k: usize, t: f64) -> Motion {
        self.model
            .motion_in_picture(self.parameters.as_slice(), &self.times, k, t)
    }

    /// The motion of any parameters of this fit's layout, seen from the side.
    #[must_use]
    pub fn planar<'a>(&'a self, parameters: &'a [f64]) -> PlanarArcs<'a> {
        PlanarArcs {
            parameters,
            times: &self.times,
            law: self.model.drag_law(),
            bent: self.model.bend().is_some(),
        }
    }

    /// Speed on arc `k` at time `t`, plane units a second.
    #[must_use]
    pub fn speed(&self, k: usize, t: f64) -> f64 {
        self.model.speed(self.parameters.as_slice(), &self.times, k, t)
    }

    /// Motion on arc `k` at time `t` for any parameters of this fit's layout, in the calibrated plane (of a ball seen by
    /// a camera above: over the floor).
    #[must_use]
    pub fn in_plane(&self, parameters: &[f64], k: usize, t: f64) -> Motion {
        self.model.motion_in_plane(parameters, &self.times, k, t)
    }

    /// Time of the impact between arcs `k` and `k + 1` for any parameters of this fit's layout, s; `None` when the two
    /// do not part, or there is no second one (a flight without an impact).
    #[must_use]
    pub fn impact_time(&self, parameters: &[f64], k: usize) -> Option<f64> {
        let met = k + 1 < self.arcs();
        met.then(|| self.model.impact_time(parameters, &self.times, k))?
    }

    /// How many times larger than in the calibrated plane the ball is seen on arc `k` at time `t`.
    #[must_use]
    pub fn magnification(&self, k: usize, t: f64) -> f64 {
        self.model.magnification(self, k, t)
    }

    /// The point of the calibrated plane that a ball seen against `place` is at (of a camera above: over), on arc `k` at
    /// time `t`.
    #[must_use]
    pub fn place_in_plane(&self, place: PlanePoint, k: usize, t: f64) -> PlanePoint {
        self.model.place_in_plane(self, place, k, t)
    }
}

/// The lean of the fall for any parameters, rad; 0 where nothing falls.
#[must_use]
pub fn lean_rad(parameters: &[f64]) -> f64 {
    if parameters[ACROSS] == 0.0 {
        0.0
    } else {
        parameters[ACROSS].atan2(parameters[GRAVITY])
    }
}

/// Factor on a covariance for errors that last from point to point (a codec's, a lamp's): (1 + ρ)/(1 − ρ) with ρ the
/// correlation of successive residuals of one arc; 1 where it does not show.
pub(super) fn autocorrelation_inflation(points: &[FitPoint], residuals: &DVector<f64>) -> f64 {
    let (mut product, mut square, mut pairs) = (0.0, 0.0, 0.0);
    for (i, w) in points.windows(2).enumerate() {
        if w[0].arc == w[1].arc {
            for k in 0..2 {
                let (a, b) = (residuals[2 * i + k], residuals[2 * i + 2 + k]);
                product += a * b;
                square += 0.5 * (a * a + b * b);
                pairs += 1.0;
            }
        }
    }
    if !(pairs > 8.0 && square > 0.0) {
        return 1.0;
    }
    // Chance alone gives 1/√pairs; the fit itself takes a little correlation away.
    let rho = (product / square).clamp(0.0, MOST_CORRELATED);
    if rho < 1.0 / f64::sqrt(pairs) {
        1.0
    } else {
        (1.0 + rho) / (1.0 - rho)
    }
}

/// A path that is no parabola (perspective, a drifting camera) leaves residuals that hang together over a whole arc; at
/// this correlation some 60 points count for one.
const MOST_CORRELATED: f64 = 0.97;

/// Mean time of each arc's points; `None` when one has fewer than two.
pub(super) fn mean_times(points: &[FitPoint], arcs: usize) -> Option<Vec<f64>> {
    let start = points.first()?.sample.t;
    let mut sums = vec![(0.0, 0.0); arcs];
    for p in points {
        sums[p.arc].0 += p.sample.t - start;
        sums[p.arc].1 += 1.0;
    }
    let enough = sums.iter().all(|s| s.1 >= 2.0) && 2 * points.len() > 4 * arcs;
    enough.then(|| sums.iter().map(|s| start + s.0 / s.1).collect())
}
