//! What a fit of arcs says of a ball seen from above, beside its motion.

use super::{Overhead, fit, flying, nadir};
use crate::flight::fit::{ArcFit, FitPoint, Forces};
use crate::geometry::PlanePoint;

impl ArcFit {
    /// Seen by a camera above.
    pub(in crate::flight) fn overhead(points: &[FitPoint], arcs: usize, known: Overhead) -> Option<Self> {
        let found = fit::fit(points, arcs, &known)?;
        Some(Self {
            times: found.times,
            parameters: found.parameters,
            covariance: found.covariance,
            reduced_chi: found.reduced_chi,
            autocorrelation_inflation: found.autocorrelation_inflation,
            forces: Forces::Overhead(known),
        })
    }

    /// What of the camera's height the ball is up on arc `k` at time `t`; 0 where the camera is not above.
    #[must_use]
    pub fn nearness(&self, k: usize, t: f64) -> f64 {
        match &self.forces {
            Forces::Overhead(known) => flying(known, self.parameters.as_slice(), &self.times, k, t).zeta,
            _ => 0.0,
        }
    }

    /// How many times larger than in the calibrated plane the ball is seen on arc `k` at time `t`: 1 where the camera is not
    /// above. With its height ζ and radius c, both over the camera's height, 1/√((1 − ζ)² − c²).
    #[must_use]
    pub fn magnification(&self, k: usize, t: f64) -> f64 {
        let Forces::Overhead(known) = &self.forces else {
            return 1.0;
        };
        let contact = known.contact.unwrap_or(0.0);
        let left = 1.0 - self.nearness(k, t);
        (1.0 / (left * left - contact * contact).max(0.0).sqrt()).min(MOST_MAGNIFIED)
    }

    /// The point of the calibrated plane that a ball seen against `place` is at (of a camera above: over), on arc `k` at
    /// time `t`.
    #[must_use]
    pub fn place_in_plane(&self, place: PlanePoint, k: usize, t: f64) -> PlanePoint {
        if !matches!(self.forces, Forces::Overhead(_)) {
            return place;
        }
        let nadir = nadir(self.parameters.as_slice(), &self.times);
        let part = 1.0 - self.nearness(k, t);
        PlanePoint::new(
            nadir.right + part * (place.right - nadir.right),
            nadir.up + part * (place.up - nadir.up),
        )
    }
}

/// A ball seen this many times larger fills any picture: what is nearer the camera is another thing.
const MOST_MAGNIFIED: f64 = 20.0;
