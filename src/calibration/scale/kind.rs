//! What every kind of scale has to say, and what it may ask for.

use crate::calibration::error::CalibrationError;
use crate::calibration::experiment::Ball;
use crate::calibration::finding::Finding;
use crate::calibration::rectification::Rectification;
use crate::geometry::PixelPoint;
use crate::quantity::Quantity;
use nalgebra::Matrix3;
use serde_json::Value;
use std::fmt::Debug;

/// `{"world_from_pixel": [[..], [..], [..]], "relative_std": ..., "origin_unknown": true}`.
#[derive(Debug, Clone, PartialEq)]
pub struct Homography {
    /// (x w, up w, w) = matrix · (u, v, 1).
    pub world_from_pixel: Matrix3<f64>,
    /// Relative standard uncertainty of lengths (of the board's squares, say), 0.001 for 0.1 %.
    pub relative_std: Option<f64>,
    /// Whether its origin is the world's (floor and launch edge), or just some point of the plane.
    pub origin_known: bool,
}

impl From<Matrix3<f64>> for Homography {
    fn from(world_from_pixel: Matrix3<f64>) -> Self {
        Self {
            world_from_pixel,
            relative_std: None,
            origin_known: true,
        }
    }
}

/// What a recording itself says about its scale, in plane units.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ScaleEvidence {
    /// The ball's radius, plane units.
    pub ball_radius_units: Option<Quantity>,
    /// The acceleration of its fall, plane units / s².
    pub gravity_units_s2: Option<Quantity>,
}

/// The rest of the calibration, as far as scales ask for it.
pub(in crate::calibration) struct ScaleContext<'a> {
    /// The ball.
    pub ball: &'a Ball,
    /// Acceleration of free fall, m/s².
    pub gravity_m_s2: f64,
    /// Its standard uncertainty, m/s².
    pub gravity_std_m_s2: f64,
    /// The capture rate, where the calibration gives it, Hz.
    pub frame_rate_hz: Option<f64>,
    /// Width and height of the pictures, as far as they are known.
    pub image_size_px: Option<(usize, usize)>,
    /// The map from the picture to the plane of motion.
    pub plane: &'a dyn Fn() -> Result<Rectification, CalibrationError>,
}

/// The keys by which the file names a kind of scale.
pub(in crate::calibration) struct ScaleKeys {
    /// How messages name the kind.
    pub name: &'static str,
    /// The keys that say it is this kind.
    pub marks: &'static [&'static str],
    /// The keys that may stand beside them.
    pub beside: &'static [&'static str],
    /// The object with its required keys, as messages show it.
    pub example: &'static str,
}

/// Why a scale gives no metres.
pub(in crate::calibration) enum NoScale {
    /// The recording does not have what the scale rests on.
    NoEvidence(&'static str),
    /// Something else is wrong.
    Calibration(CalibrationError),
}

impl From<CalibrationError> for NoScale {
    fn from(error: CalibrationError) -> Self {
        Self::Calibration(error)
    }
}

/// A kind of scale.
///
/// The first three methods differ in all of them; the rest is what some kinds have to add.
pub(in crate::calibration) trait ScaleKind: Debug {
    /// Its keys.
    fn keys(&self) -> &'static ScaleKeys;

    /// Metres per plane unit; `None` where its numbers give no finite one above 0.
    ///
    /// # Errors
    /// Evidence that the recording does not have, or a map that cannot be made.
    fn metres_per_unit(
        &self,
        context: &ScaleContext<'_>,
        evidence: &ScaleEvidence,
    ) -> Result<Option<Quantity>, NoScale>;

    /// The object under `scale` in the file.
    fn to_json(&self) -> Value;

    /// The homography to metres, where the scale is one: then the plane has the world's axes and unit already.
    fn homography(&self) -> Option<&Homography> {
        None
    }

    /// Whether metres come from the ball as the recording shows it.
    fn rests_on_ball(&self) -> bool {
        false
    }

    /// Whether metres come from the fall as the recording shows it.
    fn rests_on_fall(&self) -> bool {
        false
    }

    /// Where metres come from, in words, for a scale that has no number of its own before the recording is measured.
    fn in_words(&self) -> Option<&'static str> {
        None
    }

    /// A length between two marks, m.
    fn known_length_m(&self) -> Option<f64> {
        None
    }

    /// The key that holds its uncertainty.
    fn uncertainty_key(&self) -> &'static str {
        "scale.std_uncertainty"
    }

    /// Points read off the picture, with their keys.
    fn marks(&self) -> Vec<(&'static str, PixelPoint)> {
        Vec::new()
    }

    /// What is odd about it.
    fn findings(&self, _context: &ScaleContext<'_>) -> Vec<Finding> {
        Vec::new()
    }
}

/// `value` with the root of the sum of the squares of those relative standard uncertainties that are known.
pub(super) fn quantity(value: f64, relative: &[Option<f64>]) -> Option<Quantity> {
    let variance: f64 = relative.iter().flatten().map(|r| r * r).sum();
    Quantity::new(value, value * variance.sqrt())
}

/// `given / seen`. Where the measured one's uncertainty is unknown, so is the ratio's: it is the larger part.
pub(super) fn ratio(given: f64, given_relative: Option<f64>, seen: Quantity) -> Option<Quantity> {
    match seen.std_uncertainty {
        Some(std) => quantity(given / seen.value, &[given_relative, Some(std / seen.value)]),
        None => Quantity::undetermined(given / seen.value),
    }
}

/// What was measured, where it can be divided by.
pub(super) fn usable(seen: Option<Quantity>) -> Option<Quantity> {
    seen.filter(|q| q.value > 0.0 && q.value.is_finite())
}
