//! The ball among all that moves: the flight by the centres as they were first seen, or were given.

use super::camera::CalibratedCamera;
use super::clock::Clocked;
use super::spots::{BallCentre, first_spots, with_id};
use crate::calibration::Optics;
use crate::flight::linking::{LinkedSpots, Spot};
use crate::flight::{self, Flight, NoFlight};

/// A flight and the centres that it is made of.
#[derive(Debug, Clone)]
pub struct Tracked {
    /// The arcs and their points.
    pub flight: Flight,
    /// The ball in each frame, in the order of their ids.
    pub centres: Vec<BallCentre>,
    /// The camera's angles that the spots were made with.
    pub optics: Option<Optics>,
}

/// The ball among `centres`, which may be of anything.
///
/// # Errors
/// [`NoFlight`] with what was found instead.
pub fn tracked(
    camera: &CalibratedCamera<'_>,
    clocked: &Clocked,
    centres: &[BallCentre],
    optics: Option<Optics>,
) -> Result<Tracked, NoFlight> {
    let spots = first_spots(camera, centres, clocked.frames(), optics);
    let model = camera.motion_model(None, None);
    let flight = flight::find(&LinkedSpots::new(spots), &*model)?;
    let of_ball = flight.points.iter().filter_map(|p| with_id(centres, p.spot.id));
    Ok(Tracked {
        centres: of_ball.copied().collect(),
        flight,
        optics,
    })
}

/// The spots of `centres` in the plane.
pub fn spots_of(
    camera: &CalibratedCamera<'_>,
    clocked: &Clocked,
    centres: &[BallCentre],
    optics: Option<Optics>,
) -> Vec<Spot> {
    let spot = |c: &BallCentre| c.spot(camera, optics, &clocked.base.times_s);
    centres.iter().filter_map(spot).collect()
}
