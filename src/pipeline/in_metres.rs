//! What the flight says in metres, and the frame of the world that points are drawn in.

use super::measurement::{ArcSpin, UpTilt, Warning};
use crate::calibration::{Calibration, View};
use crate::flight::Flight;
use crate::flight::shake::Shake;
use crate::geometry::{PlanePoint, WorldPoint};
use crate::impact::motion::MeasuredMotion;
use crate::impact::{BenchLaunch, Bounce, Distances, FloorSlope, Readings};
use crate::quantity::Quantity;
use nalgebra::Matrix3;

/// What the flight says in metres.
#[derive(Debug)]
pub struct Impacts {
    /// The flight under everything that is not known of it.
    pub flight: Flight,
    /// From the plane to the world.
    pub frame: WorldFrame,
    /// Length of a pixel near the ball.
    pub metres_per_px: Option<Quantity>,
    /// Drag β, 1/m.
    pub drag_per_m: Option<Quantity>,
    /// The ball's radius, px.
    pub radius_px: Option<Quantity>,
    /// The same as given or as seen, m.
    pub radius_m: Option<f64>,
    /// What the ball's marks say of its spin, arc by arc; `None` of a plain ball.
    pub spins: Vec<Option<ArcSpin>>,
    /// A swing that the ball alone shows.
    pub shake: Option<Shake>,
    /// Magnitude of the acceleration, where it can be checked.
    pub gravity_m_s2: Option<Quantity>,
    /// How far "up" is from where the calibration has it.
    pub up: Option<UpTilt>,
    /// The floor's slope.
    pub floor: Option<FloorSlope>,
    /// Where the ball left a bench.
    pub launch: Option<BenchLaunch>,
    /// Impacts on the floor, in time order, with the arc before each.
    pub bounces: Vec<(usize, Bounce)>,
    /// Impacts on something upright.
    pub walls: usize,
    /// x0 and x.
    pub distances: Distances,
    /// Both models' readings of the first bounce.
    pub readings: Option<Readings>,
    /// What does not fit the calibration, or is doubtful.
    pub warnings: Vec<Warning>,
}

/// From the plane to the world, for points and drawing (values only; uncertainties are [`MeasuredMotion`]'s).
#[derive(Debug, Clone, Copy)]
pub struct WorldFrame {
    x_sign: f64,
    pub metres_per_unit: f64,
    zero: PlanePoint,
    /// Sine and cosine of the angle by which the fall leans.
    lean: (f64, f64),
    floor_m: f64,
}

impl WorldFrame {
    /// Without an origin the floor is where the impacts are: the centre touches at z = R.
    pub fn new(
        motion: &MeasuredMotion<'_>,
        bounces: &[(usize, Bounce)],
        radius_m: Option<f64>,
        calibration: &Calibration,
    ) -> Self {
        let floor_m = if calibration.has_origin() || calibration.view == View::Top {
            0.0
        } else {
            let lowest = bounces
                .iter()
                .filter_map(|(k, b)| Some(motion.place_m(*k, b.time_s?.value).1))
                .fold(f64::INFINITY, f64::min);
            if lowest.is_finite() {
                lowest - radius_m.unwrap_or(0.0)
            } else {
                0.0
            }
        };
        Self {
            x_sign: motion.x_sign,
            metres_per_unit: motion.metres_per_unit.value,
            zero: motion.zero(),
            lean: motion.lean_rad().sin_cos(),
            floor_m,
        }
    }

    /// Velocity along x and the second coordinate, m/s, of one in the plane, plane units/s.
    pub fn velocity_m_s(&self, right: f64, up: f64) -> (f64, f64) {
        let (sin, cos) = self.lean;
        (
            self.x_sign * self.metres_per_unit * (right * cos + up * sin),
            self.metres_per_unit * (up * cos - right * sin),
        )
    }

    /// The turn from the plane's axes (right, up, towards the camera) to the world's (x along the launch, y, z up).
    pub fn turn_from_plane(&self) -> Matrix3<f64> {
        let (sin, cos) = self.lean;
        let x = self.x_sign;
        Matrix3::new(x * cos, x * sin, 0.0, 0.0, 0.0, -x, -sin, cos, 0.0)
    }

    pub fn world(&self, right: f64, up: f64) -> WorldPoint {
        let (right, up) = (right - self.zero.right, up - self.zero.up);
        let (sin, cos) = self.lean;
        WorldPoint {
            x_m: self.x_sign * self.metres_per_unit * (right * cos + up * sin),
            up_m: self.metres_per_unit * (up * cos - right * sin) - self.floor_m,
        }
    }
}
