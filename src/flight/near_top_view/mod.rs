//! Flight seen from above by a camera near enough to matter: three dimensions from two.
//!
//! The camera is a pinhole at height D over the floor, straight above the floor's point A (its nadir). A ball above the
//! floor's point q, with its centre at height z = ζ D, is seen against the floor at
//!
//! ```text
//! p = A + (q − A)/(1 − ζ)          (q, D ζ)'' = −(0, 0, g) − β |v| v + s × v          γ = g/D
//! ```
//!
//! ζ, in camera heights, needs no scale: γ is known in 1/s² whatever a pixel measures. So a straight path bends, by
//! (q − A) γ/2 t² for the fall, and by the product of its own speed and the ball's rise. The bend tells the vertical
//! speed of each arc; so does the time between two impacts, at both of which the ball's centre is at z = R.
//!
//! * `camera` is the model's own type; `kinematics` has its parameters and the motion that they are.
//! * `segment_sums` cuts a track into arcs of that shape, helped by the apparent radius, which goes as 1/(1 − ζ).
//! * `fit` fits all arcs together with the impacts between them: `problem` has the points' rows, `priors` those of what is known.
//! * `search` is the way from a track to a [`Flight`]; `impact_test` tells where its arcs meet.
//!
//! Drag β (Newton's) is taken as known where the ball's mass and size are, and fitted elsewhere: it slows the ball along its
//! path and hardly turns it. Lift s × v (Magnus; s along the spin) does turn it: each arc has an s of its own, about what drag
//! and the spin that follows from the impacts make likely; see `lift`.

mod camera;
mod fit;
mod impact_test;
mod kinematics;
mod lift;
mod priors;
mod problem;
mod search;
mod segment_sums;

pub use camera::{NearTopView, SpatialMotion};

use super::flight_search::{FlightSearch, TrackCandidate};
use super::free_flight::Flight;
use super::linking::{LinkedSpots, Spot, Track};
use super::motion_model::{ArcFit, FitPoint, MotionModel};
use super::parabola::Gravity;
use super::planar::Motion;
use crate::geometry::PlanePoint;
use crate::quantity::Quantity;
use kinematics::{SpatialLayout, nadir, seen, spatial_motion};
use nalgebra::DVector;

/// A ball seen this many times larger fills any picture: what is nearer the camera is another thing.
const MOST_MAGNIFIED: f64 = 20.0;

impl NearTopView {
    /// ζ of the ball on arc `k` at time `t`.
    fn height_at(&self, fit: &ArcFit, k: usize, t: f64) -> f64 {
        spatial_motion(self, fit.parameters.as_slice(), &fit.times, k, t).zeta
    }
}

impl MotionModel for NearTopView {
    fn fit(&self, points: &[FitPoint], arcs: usize) -> Option<ArcFit> {
        fit::fit(points, arcs, self)
    }

    fn response(&self, fit: &ArcFit, points: &[FitPoint], shifts: &[(f64, f64)]) -> Option<DVector<f64>> {
        fit::response(points, fit.arcs(), self, &fit.parameters, shifts)
    }

    fn impact_between(&self, fit: &ArcFit, spans: &[(f64, f64)], k: usize, interval_s: f64) -> Option<f64> {
        impact_test::impact_between(fit, self, spans, k, interval_s)
    }

    fn resolves_height(&self) -> bool {
        true
    }

    fn motion_in_plane(&self, parameters: &[f64], times: &[f64], k: usize, t: f64) -> Motion {
        spatial_motion(self, parameters, times, k, t).ground
    }

    fn motion_in_picture(&self, parameters: &[f64], times: &[f64], k: usize, t: f64) -> Motion {
        let motion = spatial_motion(self, parameters, times, k, t);
        seen(self, parameters, times, &motion)
    }

    fn speed(&self, parameters: &[f64], times: &[f64], k: usize, t: f64) -> f64 {
        let motion = spatial_motion(self, parameters, times, k, t);
        motion.speed(self.camera_height())
    }

    /// The time of an impact is one of the parameters.
    fn impact_time(&self, parameters: &[f64], times: &[f64], k: usize) -> Option<f64> {
        Some(parameters[SpatialLayout::new(times.len()).impact(k)])
    }

    /// With the ball's height ζ and radius c, both over the camera's height, 1/√((1 − ζ)² − c²).
    fn magnification(&self, fit: &ArcFit, k: usize, t: f64) -> f64 {
        let contact = self.touching();
        let below = 1.0 - self.height_at(fit, k, t);
        (1.0 / (below * below - contact * contact).max(0.0).sqrt()).min(MOST_MAGNIFIED)
    }

    fn place_in_plane(&self, fit: &ArcFit, place: PlanePoint, k: usize, t: f64) -> PlanePoint {
        let nadir = nadir(fit.parameters.as_slice(), &fit.times);
        let part = 1.0 - self.height_at(fit, k, t);
        PlanePoint::new(
            nadir.right + part * (place.right - nadir.right),
            nadir.up + part * (place.up - nadir.up),
        )
    }

    fn fall_ratio(&self, points: &[FitPoint], arcs: usize) -> Option<Quantity> {
        let open = Self {
            fall_relative_std: OPEN_FALL,
            ..*self
        };
        let fit = fit::fit(points, arcs, &open)?;
        let i = SpatialLayout::new(arcs).fall();
        let (ratio, std) = (fit.parameters[i].exp(), fit.covariance[(i, i)].max(0.0).sqrt());
        // Hardly better than what was assumed: the flight does not tell.
        let shows = std < 0.5 * OPEN_FALL;
        shows.then(|| Quantity::new(ratio, ratio * std))?
    }
}

/// Relative standard deviation of a fall that is as good as unknown.
const OPEN_FALL: f64 = 1.0;

impl FlightSearch for NearTopView {
    fn candidate(&self, spots: &[Spot], _leaning: bool) -> Option<TrackCandidate> {
        search::candidate(spots, self)
    }

    fn with_continuations(
        &self,
        linked: &LinkedSpots,
        track: &Track,
        _best: &TrackCandidate,
        _leaning: bool,
    ) -> Vec<Track> {
        vec![search::with_continuations(linked, track)]
    }

    fn flight_along(&self, spots: &[Spot], _gravity: Gravity, interval_s: f64) -> Option<Flight> {
        search::flight_along(spots, self, interval_s)
    }
}

#[cfg(test)]
mod tests;
