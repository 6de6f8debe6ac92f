//! From the plane to the world, for points and drawing.

use crate::calibration::{Calibration, View};
use crate::geometry::{PlanePoint, WorldPoint};
use crate::impact::Bounce;
use crate::impact::motion::MeasuredMotion;
use crate::quantity::Quantity;

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
        metres_per_unit: Quantity,
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
            metres_per_unit: metres_per_unit.value,
            zero: motion.zero,
            lean: motion.lean_rad().sin_cos(),
            floor_m,
        }
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
