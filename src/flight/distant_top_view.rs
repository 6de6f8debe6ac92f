//! A ball seen from above by a camera so far away, or at a distance so little known, that nothing falls in its picture: arcs
//! are straight lines over the floor but for drag, and the ball's track is the longest of such lines.
//!
//! Drag slows the ball by its whole speed v, of which the fall is not seen: along the floor it is as if −β (v/u) u **u** held, u being the speed there
//! and v/u one number for the flight.
//!
//! Assumed: one magnification for all heights. Where the ball comes near enough to matter its arcs are bent, which
//! [`crate::impact`] sees in them. Falls are those of a lab (from 5 to 50 cm). What the air does beyond that mean is in the uncertainties
//! (`pipeline/unseen_fall.rs`).

use super::drag::{Drag, DragLaw, USUAL_LIGHT_DRAG};
use super::flight_search::{FlightSearch, TrackCandidate};
use super::free_flight::Flight;
use super::linking::Spot;
use super::motion_model::{ArcFit, FitPoint, MotionModel, VerticalPrior};
use super::parabola::{self, Fall, Gravity};
use super::planar_fit::{self, PlanarPriors};
use super::samples::{samples_of, segment_sigma};
use super::{arc_search, impact_test};
use nalgebra::DVector;
use std::sync::Arc;

/// Mean speeds of falls and rises from 5 cm and 50 cm, m/s: between them are those that are not seen.
const UNSEEN_FALL_M_S: [f64; 2] = [0.5, 1.6];

/// Nothing is known of the camera's distance, or it does not matter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DistantTopView {
    /// Drag along the floor; `None` where nothing tells it.
    pub drag: Option<Drag>,
}

/// Drag along the floor at `speed` there, plane units a second, where the ball's own is as `at` its whole speed.
pub fn drag_along_floor(speed: f64, metres_per_unit: f64, at: impl Fn(f64) -> Option<Drag>) -> Option<Drag> {
    let along_floor = |fall_m_s: f64| {
        let whole = speed.hypot(fall_m_s / metres_per_unit);
        let times = whole / speed;
        at(whole).map(|drag| (times * drag.beta, times * drag.std))
    };
    let [slow, fast] = UNSEEN_FALL_M_S;
    let ((least, _), (most, std)) = (along_floor(slow)?, along_floor(fast)?);
    most.is_finite().then(|| Drag {
        beta: 0.5 * (least + most),
        std: (0.5 * (most - least)).hypot(std),
        law: DragLaw::default(),
    })
}

impl DistantTopView {
    fn priors(&self) -> PlanarPriors {
        PlanarPriors {
            vertical: None,
            drag: self.drag,
            bend: None,
            scale_change: None,
        }
    }
}

impl MotionModel for DistantTopView {
    fn fit(&self, points: &[FitPoint], arcs: usize) -> Option<ArcFit> {
        let fit = |drag_is_fitted: bool| {
            planar_fit::fit(points, arcs, &self.priors(), drag_is_fitted, Arc::new(*self))
        };
        match self.drag {
            // As in a side view: no ball is driven by the air.
            Some(prior) if prior.beta == 0.0 => fit(true).filter(|f| f.drag() > 0.0).or_else(|| fit(false)),
            known => fit(known.is_some()),
        }
    }

    fn response(&self, fit: &ArcFit, points: &[FitPoint], shifts: &[(f64, f64)]) -> Option<DVector<f64>> {
        planar_fit::response(fit, points, shifts, &self.priors())
    }

    fn with_unknowns(&self, _vertical: VerticalPrior, ball_radius: f64) -> Option<Arc<dyn MotionModel>> {
        let light = (ball_radius > 0.0).then(|| Drag::unknown(USUAL_LIGHT_DRAG / ball_radius));
        let drag = light.filter(|_| self.drag.is_none())?;
        Some(Arc::new(Self { drag: Some(drag) }))
    }

    fn impact_between(&self, fit: &ArcFit, spans: &[(f64, f64)], k: usize, interval_s: f64) -> Option<f64> {
        impact_test::impact_between(fit, spans, k, k + 1, interval_s)
    }

    fn is_straight(&self) -> bool {
        true
    }

    /// A ball that rises towards a camera at an unknown distance bends the straight path.
    fn segmentation_part_of_radius(&self) -> f64 {
        0.2
    }
}

impl FlightSearch for DistantTopView {
    fn candidate(&self, spots: &[Spot], _leaning: bool) -> Option<TrackCandidate> {
        let sigma = segment_sigma(spots, self.segmentation_part_of_radius());
        let samples = samples_of(spots, sigma);
        let arcs = parabola::arcs(&samples, Fall::Known(Gravity::NONE));
        let covered: usize = arcs.iter().map(ExactSizeIterator::len).sum();
        let (first, last) = (samples.first()?, samples.last()?);
        let path = (last.r - first.r).hypot(last.h - first.h);
        let moves = path > 10.0 * sigma && covered >= 6;
        moves.then(|| TrackCandidate {
            gravity: Gravity::NONE,
            evidence: covered as f64 * path / sigma,
            span: (first.t, last.t),
        })
    }

    fn flight_along(&self, spots: &[Spot], gravity: Gravity, interval_s: f64) -> Option<Flight> {
        arc_search::flight_along(spots, gravity, self, interval_s)
    }
}
