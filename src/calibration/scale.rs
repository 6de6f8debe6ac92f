//! Metres per plane unit, with its standard uncertainty, from whichever scale the file names.
//!
//! | scale | metres per unit | standard uncertainty from |
//! |---|---|---|
//! | metres per pixel | as given | `std_uncertainty` |
//! | ruler | length / distance of its ends in undistorted pixels | `length_std_m`, `point_std_px` |
//! | ball | radius in metres / measured radius | the measured radius, `ball.radius_std_m` |
//! | gravity | g / measured fall | the measured fall, [`Calibration::gravity_uncertainty_m_s2`] |
//! | homography | 1 | `relative_std` |
//!
//! Relative variances add. What the file gives without an uncertainty counts as exact beside what has one; where
//! nothing has one, the result is "not determined". The exception is a ruler's ends: whoever reads a point off a
//! picture knows it to a pixel at best, so without `point_std_px` each coordinate has 1/√12 px, the deviation of
//! rounding to whole pixels. (That is a floor. A mark that is 3 px wide wants `point_std_px` of about 1.)

use super::error::CalibrationError;
use super::rectification::Rectification;
use super::{Calibration, Problem};
use crate::geometry::PixelPoint;
use crate::quantity::Quantity;
use nalgebra::{Matrix3, Vector2};

/// Standard deviation of a coordinate rounded to whole pixels, px: 1/√12.
pub const ROUNDED_PIXEL_STD_PX: f64 = 0.288_675_134_594_812_9;

/// Where metres come from.
#[derive(Debug, Clone, PartialEq)]
pub enum Scale {
    /// `{"metres_per_pixel": ..., "std_uncertainty": ...}`, of undistorted pixels.
    MetresPerPixel {
        /// m/px, above 0.
        value: f64,
        /// Standard uncertainty, m/px.
        std: Option<f64>,
    },
    /// `{"from_px": [u, v], "to_px": [u, v], "length_m": ..., "length_std_m": ..., "point_std_px": ...}`: two marks in
    /// the plane of motion, in pixels of the picture, and the length between them.
    Ruler {
        /// One end, as the picture shows it.
        from: PixelPoint,
        /// The other end.
        to: PixelPoint,
        /// Length between them, m.
        length_m: f64,
        /// Standard uncertainty of the length, m; `None`: taken as exact.
        length_std_m: Option<f64>,
        /// Standard uncertainty of each coordinate of each end, px; `None`: [`ROUNDED_PIXEL_STD_PX`].
        point_std_px: Option<f64>,
    },
    /// `{"ball": true}`: `ball.radius_m` against the radius measured on the recording.
    Ball,
    /// `{"gravity": true}`: `gravity_m_s2` against the fall measured on the recording.
    Gravity,
    /// `{"world_from_pixel": [[..], [..], [..]], "relative_std": ..., "origin_unknown": true}`.
    Homography(Homography),
}

/// A homography from undistorted pixels to the world's x and up, in metres.
#[derive(Debug, Clone, PartialEq)]
pub struct Homography {
    /// (x w, up w, w) = matrix · (u, v, 1).
    pub world_from_pixel: Matrix3<f64>,
    /// Relative standard uncertainty of lengths (of the board's squares, say), 0.001 for 0.1 %.
    pub relative_std: Option<f64>,
    /// Whether its origin is the world's (floor and launch edge), or just some point of the plane.
    pub origin_known: bool,
}

impl Scale {
    /// Whether the scale itself says where the world's origin is.
    pub(super) const fn has_origin(&self) -> bool {
        matches!(self, Self::Homography(h) if h.origin_known)
    }
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

/// Metres per plane unit; see the module's head.
pub(super) fn metres_per_unit(
    calibration: &Calibration,
    evidence: &ScaleEvidence,
) -> Result<Quantity, CalibrationError> {
    let quantity = match &calibration.scale {
        Scale::MetresPerPixel { value, std } => quantity(*value, &[std.map(|s| s / value)]),
        Scale::Ruler {
            from,
            to,
            length_m,
            length_std_m,
            point_std_px,
        } => {
            let (distance, relative) = ruler_distance(calibration, *from, *to, *point_std_px)?;
            quantity(
                length_m / distance,
                &[length_std_m.map(|s| s / length_m), Some(relative)],
            )
        }
        Scale::Ball => {
            let radius_m = calibration.ball.radius_m.ok_or_else(|| {
                missing(
                    "the ball is the scale, but ball.radius_m is not given",
                    "gravity, world_from_pixel",
                )
            })?;
            let seen = usable(evidence.ball_radius_units).ok_or_else(|| {
                missing(
                    "the ball is the scale, but its radius could not be measured on this recording",
                    "gravity, world_from_pixel",
                )
            })?;
            let given = calibration.ball.radius_std_m.map(|s| s / radius_m);
            ratio(radius_m, given, seen)
        }
        Scale::Gravity => {
            let seen = usable(evidence.gravity_units_s2).ok_or_else(|| {
                missing(
                    "gravity is the scale, but no fall could be measured on this recording",
                    "ball, world_from_pixel",
                )
            })?;
            let given = calibration.gravity_uncertainty_m_s2() / calibration.gravity_m_s2;
            ratio(calibration.gravity_m_s2, Some(given), seen)
        }
        Scale::Homography(homography) => quantity(1.0, &[homography.relative_std]),
    };
    quantity
        .filter(|q| q.value > 0.0)
        .ok_or_else(|| CalibrationError::Invalid {
            name: "calibration".into(),
            problems: vec![Problem::new(
                "scale",
                format!("{:?}", calibration.scale),
                "a scale that gives a finite number of metres per unit above 0",
                "check the numbers of the scale",
            )],
        })
}

/// `value` with the root of the sum of the squares of those relative deviations that are known.
fn quantity(value: f64, relative: &[Option<f64>]) -> Option<Quantity> {
    let variance: f64 = relative.iter().flatten().map(|r| r * r).sum();
    Quantity::new(value, value * variance.sqrt())
}

/// `given / seen`. Where the measured one's uncertainty is unknown, so is the ratio's: it is the larger part.
fn ratio(given: f64, given_relative: Option<f64>, seen: Quantity) -> Option<Quantity> {
    match seen.std_uncertainty {
        Some(std) => quantity(given / seen.value, &[given_relative, Some(std / seen.value)]),
        None => Quantity::undetermined(given / seen.value),
    }
}

fn usable(seen: Option<Quantity>) -> Option<Quantity> {
    seen.filter(|q| q.value > 0.0 && q.value.is_finite())
}

fn missing(what: &str, others: &'static str) -> CalibrationError {
    CalibrationError::NoEvidence {
        missing: what.into(),
        others,
    }
}

/// Distance of the ruler's ends in undistorted pixels and its relative standard uncertainty.
fn ruler_distance(
    calibration: &Calibration,
    from: PixelPoint,
    to: PixelPoint,
    point_std_px: Option<f64>,
) -> Result<(f64, f64), CalibrationError> {
    let plane = calibration.rectification()?;
    let end = |key: &str, p: PixelPoint| {
        plane
            .plane_from_pixel(p)
            .zip(plane.jacobian(p))
            .ok_or_else(|| CalibrationError::Invalid {
                name: "calibration".into(),
                problems: vec![Rectification::beyond_lens(&format!("scale.{key}"), p)],
            })
    };
    let (a, at_a) = end("from_px", from)?;
    let (b, at_b) = end("to_px", to)?;
    let along = Vector2::new(b.right - a.right, b.up - a.up);
    let distance = along.norm();
    let direction = along / distance;
    // Uncorrelated coordinates with one deviation: the distance changes by Jᵀ·direction per px of either end.
    let magnification = (at_a.transpose() * direction)
        .norm()
        .hypot((at_b.transpose() * direction).norm());
    let std = point_std_px.unwrap_or(ROUNDED_PIXEL_STD_PX) * magnification;
    Ok((distance, std / distance))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(a: f64, b: f64) -> bool {
        (a - b).abs() < 1e-12 * b.abs()
    }

    fn ruler(length_std_m: Option<f64>, point_std_px: Option<f64>) -> Calibration {
        Calibration::new(Scale::Ruler {
            from: PixelPoint::new(100.0, 500.0),
            to: PixelPoint::new(700.0, 1300.0),
            length_m: 2.0,
            length_std_m,
            point_std_px,
        })
    }

    fn measured(value: f64, std: f64) -> Option<Quantity> {
        Quantity::new(value, std)
    }

    fn scale_of(c: &Calibration, evidence: ScaleEvidence) -> Quantity {
        c.metres_per_unit(&evidence).unwrap()
    }

    #[test]
    fn metres_per_pixel_is_as_given() {
        let q = scale_of(
            &Calibration::new(Scale::MetresPerPixel {
                value: 0.0008,
                std: Some(1e-6),
            }),
            ScaleEvidence::default(),
        );
        assert_eq!(q.value, 0.0008);
        assert!(near(q.std_uncertainty.unwrap(), 1e-6));
        let c = Calibration::new(Scale::MetresPerPixel {
            value: 0.0008,
            std: None,
        });
        assert_eq!(scale_of(&c, ScaleEvidence::default()).std_uncertainty, None);
    }

    #[test]
    fn ruler_adds_the_uncertainty_of_its_ends_and_length() {
        // 600, 800: 1000 px. Two ends of one coordinate each along the ruler: √2 σ.
        let root_2 = 2.0_f64.sqrt();
        let relative = |c: &Calibration| {
            let q = scale_of(c, ScaleEvidence::default());
            assert!(near(q.value, 0.002));
            q.std_uncertainty.unwrap() / q.value
        };
        assert!(near(relative(&ruler(None, Some(0.5))), 0.5e-3 * root_2));
        assert!(near(
            relative(&ruler(None, None)),
            root_2 / 12.0_f64.sqrt() * 1e-3
        ));
        let both = (0.5e-3 * root_2).hypot(0.001);
        assert!(near(relative(&ruler(Some(0.002), Some(0.5))), both));
    }

    #[test]
    fn ruler_is_measured_between_undistorted_points() {
        let camera = Matrix3::new(900.0, 0.0, 400.0, 0.0, 900.0, 900.0, 0.0, 0.0, 1.0);
        let lens = crate::calibration::Lens::new(camera, [-0.1, 0.0, 0.0, 0.0, 0.0]).unwrap();
        let mut c = ruler(None, Some(0.5));
        c.lens = Some(lens.clone());
        let (a, b) = (PixelPoint::new(100.0, 500.0), PixelPoint::new(700.0, 1300.0));
        let distance = lens.undistort(a).unwrap().distance_px(lens.undistort(b).unwrap());
        let q = scale_of(&c, ScaleEvidence::default());
        assert!(distance > 1010.0 && near(q.value, 2.0 / distance));
        // Barrel distortion shrinks the corners, so a pixel there stands for more.
        assert!(q.std_uncertainty.unwrap() / q.value > 0.5 * 2.0_f64.sqrt() / distance);
    }

    #[test]
    fn ball_compares_its_radius_with_the_one_seen() {
        let mut c = Calibration::new(Scale::Ball);
        let seen = ScaleEvidence {
            ball_radius_units: measured(25.0, 0.25),
            gravity_units_s2: None,
        };
        assert!(
            c.metres_per_unit(&seen)
                .unwrap_err()
                .to_string()
                .contains("ball.radius_m")
        );
        c.ball.radius_m = Some(0.02);
        let q = scale_of(&c, seen);
        assert!(near(q.value, 0.0008) && near(q.std_uncertainty.unwrap(), 0.01 * 0.0008));
        c.ball.radius_std_m = Some(0.02 * 0.01);
        assert!(near(
            scale_of(&c, seen).std_uncertainty.unwrap(),
            0.01 * 2.0_f64.sqrt() * 0.0008
        ));
        // The larger part unknown: the whole unknown.
        let vague = ScaleEvidence {
            ball_radius_units: Quantity::undetermined(25.0),
            gravity_units_s2: None,
        };
        assert_eq!(scale_of(&c, vague).std_uncertainty, None);
        for bad in [None, measured(0.0, 0.1), measured(-3.0, 0.1)] {
            let evidence = ScaleEvidence {
                ball_radius_units: bad,
                gravity_units_s2: None,
            };
            assert!(
                c.metres_per_unit(&evidence)
                    .unwrap_err()
                    .to_string()
                    .contains("radius could not be measured")
            );
        }
    }

    #[test]
    fn gravity_compares_the_fall_with_the_one_seen() {
        let mut c = Calibration::new(Scale::Gravity);
        let seen = ScaleEvidence {
            ball_radius_units: None,
            gravity_units_s2: measured(9810.0, 98.1),
        };
        let q = scale_of(&c, seen);
        // 9.81 is good to 0.3 % anywhere, what was looked up for the place to 0.01 %.
        assert!(near(q.value, 0.001) && near(q.std_uncertainty.unwrap(), 1e-3 * 0.01_f64.hypot(0.003)));
        c.gravity_given = true;
        let q = scale_of(&c, seen);
        assert!(near(q.std_uncertainty.unwrap(), 1e-3 * 0.01_f64.hypot(1e-4)));
        c.gravity_std_m_s2 = Some(9.81 * 0.01);
        let q = scale_of(&c, seen);
        assert!(near(q.std_uncertainty.unwrap(), 1e-5 * 2.0_f64.sqrt()));
        assert!(
            c.metres_per_unit(&ScaleEvidence::default())
                .unwrap_err()
                .to_string()
                .contains("fall")
        );
    }

    #[test]
    fn homography_is_in_metres_already() {
        let matrix = Matrix3::new(0.001, 0.0, 0.0, 0.0, -0.001, 0.7, 0.0, 0.0, 1.0);
        let c = Calibration::new(Scale::Homography(matrix.into()));
        assert_eq!(
            scale_of(&c, ScaleEvidence::default()),
            Quantity::undetermined(1.0).unwrap()
        );
        let homography = Homography {
            world_from_pixel: matrix,
            relative_std: Some(0.002),
            origin_known: true,
        };
        let c = Calibration::new(Scale::Homography(homography));
        assert!(near(
            scale_of(&c, ScaleEvidence::default()).std_uncertainty.unwrap(),
            0.002
        ));
    }

    #[test]
    fn a_scale_built_by_hand_with_nonsense_is_an_error() {
        for value in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let c = Calibration::new(Scale::MetresPerPixel { value, std: None });
            assert!(c.metres_per_unit(&ScaleEvidence::default()).is_err());
        }
    }
}
