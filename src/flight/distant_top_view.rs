//! A ball seen from above by a camera so far away, or at a distance so little known, that nothing falls in its picture: arcs
//! are straight lines over the floor, and the ball's track is the longest of such lines.
//!
//! Assumed: one magnification for all heights. Where the ball comes near enough to matter its arcs are bent, which
//! [`crate::impact`] sees in them.

use super::flight_search::{FlightSearch, TrackCandidate};
use super::free_flight::Flight;
use super::linking::Spot;
use super::motion_model::{ArcFit, FitPoint, MotionModel};
use super::parabola::{self, Fall, Gravity};
use super::planar_fit::{self, PlanarPriors};
use super::samples::{samples_of, segment_sigma};
use super::{arc_search, impact_test};
use nalgebra::DVector;
use std::sync::Arc;

/// Nothing is known of the camera's distance, or it does not matter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DistantTopView;

const PRIORS: PlanarPriors = PlanarPriors {
    vertical: None,
    drag: None,
    bend: None,
    scale_change: None,
};

impl MotionModel for DistantTopView {
    fn fit(&self, points: &[FitPoint], arcs: usize) -> Option<ArcFit> {
        planar_fit::fit(points, arcs, &PRIORS, false, Arc::new(*self))
    }

    fn response(&self, fit: &ArcFit, points: &[FitPoint], shifts: &[(f64, f64)]) -> Option<DVector<f64>> {
        planar_fit::response(fit, points, shifts, &PRIORS)
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
