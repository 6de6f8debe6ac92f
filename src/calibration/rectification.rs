//! From a point of the picture to the plane of motion and back.
//!
//! The lens comes first: p = undistort(seen). Then either
//!
//! * a rotation and shift, which is all that a camera square to the plane needs: with o the undistorted origin
//!   pixel (or (0, 0)), `up` = (a, b) the unit vector `up_px` and `right` = (−b, a), which is `up` turned clockwise as
//!   the picture shows it, the plane point is (`right` · (p − o), `up` · (p − o)) in undistorted pixels; or
//! * a homography: (x w, up w, w) = H · (u, v, 1), in metres. Its own axes are the world's, so `origin_px` and
//!   `up_px` have no say beside it.
//!
//! A homography has a horizon, the line w = 0; what lies beyond it is behind the camera and is `None`. The side that
//! counts is the one with the picture's centre (from `image_size_px`; without it the lens's principal point;
//! without either the pixel of the world's origin).

use super::json::rows_text;
use super::lens::Lens;
use crate::config::FileProblem;
use crate::geometry::{PixelPoint, PlanePoint};
use nalgebra::{Matrix2, Matrix3, Vector3};

/// Below this relative determinant (of the rows, over their norms' product) a homography cannot be inverted in f64.
const SMALLEST_RELATIVE_DETERMINANT: f64 = 1e-12;
/// Ratio of the smallest to the largest scale in the picture's middle. It is the sine of the angle between the line of
/// sight and the plane: 1e-4 is 0.006 degrees, a plane seen edge on.
const SMALLEST_SCALE_RATIO: f64 = 1e-4;

/// What a plane unit is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlaneUnit {
    /// A pixel of the undistorted picture; [`metres_per_unit`](super::Calibration::metres_per_unit) makes it metres.
    UndistortedPixel,
    /// A metre, from a homography.
    Metre,
}

/// The map between the picture and the plane of motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Rectification {
    lens: Option<Lens>,
    map: PlaneTransform,
}

#[derive(Debug, Clone, PartialEq)]
enum PlaneTransform {
    Rotation {
        origin: PixelPoint,
        up: [f64; 2],
    },
    Homography {
        /// Scaled so that w > 0 on the side that counts.
        plane_from_pixel: Matrix3<f64>,
        /// Scaled so that w > 0 there too.
        pixel_from_plane: Matrix3<f64>,
    },
}

impl Rectification {
    /// Of a camera square to the plane: "up" along `up_px`, the origin at `origin_px` (as seen, before undistortion).
    pub(super) fn square(
        lens: Option<&Lens>,
        origin_px: Option<PixelPoint>,
        up_px: [f64; 2],
    ) -> Result<Self, FileProblem> {
        Ok(Self {
            lens: lens.cloned(),
            map: rotation(lens, origin_px, up_px)?,
        })
    }

    /// Of a camera anywhere, by its homography to metres; which side of the horizon counts follows from the picture's size.
    pub(super) fn projective(
        lens: Option<&Lens>,
        world_from_pixel: &Matrix3<f64>,
        image_size_px: Option<(usize, usize)>,
    ) -> Result<Self, FileProblem> {
        Ok(Self {
            lens: lens.cloned(),
            map: homography(world_from_pixel, reference_pixel(lens, image_size_px))?,
        })
    }

    /// What a plane unit is.
    #[must_use]
    pub const fn unit(&self) -> PlaneUnit {
        match self.map {
            PlaneTransform::Rotation { .. } => PlaneUnit::UndistortedPixel,
            PlaneTransform::Homography { .. } => PlaneUnit::Metre,
        }
    }

    /// The plane point that the picture shows at `p`; `None` beyond the lens model's reach or the horizon.
    #[must_use]
    pub fn plane_from_pixel(&self, p: PixelPoint) -> Option<PlanePoint> {
        self.plane_from_ideal(self.undistort(p)?)
    }

    /// The same for a point of the undistorted picture.
    pub(super) fn plane_from_ideal(&self, p: PixelPoint) -> Option<PlanePoint> {
        let point = match &self.map {
            PlaneTransform::Rotation { origin, up: [a, b] } => {
                let (u, v) = (p.u_px - origin.u_px, p.v_px - origin.v_px);
                PlanePoint::new(a * v - b * u, a * u + b * v)
            }
            PlaneTransform::Homography { plane_from_pixel, .. } => {
                let (right, up) = apply(plane_from_pixel, p.u_px, p.v_px)?;
                PlanePoint::new(right, up)
            }
        };
        (point.right.is_finite() && point.up.is_finite()).then_some(point)
    }

    /// Where the picture shows the plane point `p`, inside the picture or not; `None` beyond the lens model's reach or
    /// behind the camera.
    #[must_use]
    pub fn pixel_from_plane(&self, p: PlanePoint) -> Option<PixelPoint> {
        let ideal = self.ideal_from_plane(p)?;
        let seen = match &self.lens {
            Some(lens) => lens.distort(ideal)?,
            None => ideal,
        };
        (seen.u_px.is_finite() && seen.v_px.is_finite()).then_some(seen)
    }

    /// The same in the undistorted picture.
    pub(super) fn ideal_from_plane(&self, p: PlanePoint) -> Option<PixelPoint> {
        Some(match &self.map {
            PlaneTransform::Rotation { origin, up: [a, b] } => PixelPoint::new(
                origin.u_px - b * p.right + a * p.up,
                origin.v_px + a * p.right + b * p.up,
            ),
            PlaneTransform::Homography { pixel_from_plane, .. } => {
                let (u, v) = apply(pixel_from_plane, p.right, p.up)?;
                PixelPoint::new(u, v)
            }
        })
    }

    /// The homography's matrix from the plane to undistorted pixels, w > 0 where it is seen; `None` for a rotation.
    pub(super) const fn ideal_from_plane_matrix(&self) -> Option<&Matrix3<f64>> {
        match &self.map {
            PlaneTransform::Rotation { .. } => None,
            PlaneTransform::Homography { pixel_from_plane, .. } => Some(pixel_from_plane),
        }
    }

    /// d(right, up)/d(u, v) at `p`, plane units per pixel of the picture; `None` where [`Self::plane_from_pixel`] is.
    #[must_use]
    pub fn jacobian(&self, p: PixelPoint) -> Option<Matrix2<f64>> {
        let (ideal, lens) = self.undistort_with_jacobian(p)?;
        let jacobian = self.jacobian_from_ideal(ideal)? * lens;
        jacobian.iter().all(|d| d.is_finite()).then_some(jacobian)
    }

    /// The same for a point of the undistorted picture, per pixel of that.
    pub(super) fn jacobian_from_ideal(&self, p: PixelPoint) -> Option<Matrix2<f64>> {
        match &self.map {
            PlaneTransform::Rotation { up: [a, b], .. } => Some(Matrix2::new(-b, *a, *a, *b)),
            PlaneTransform::Homography { plane_from_pixel, .. } => {
                jacobian_of(plane_from_pixel, p.u_px, p.v_px)
            }
        }
    }

    /// How far from the camera along its axis the point of the plane is that the undistorted picture shows at `p`, in
    /// some unit; `None` where that is not seen.
    pub(super) fn depth(&self, p: PixelPoint) -> Option<f64> {
        match &self.map {
            PlaneTransform::Rotation { .. } => Some(1.0),
            PlaneTransform::Homography { plane_from_pixel, .. } => {
                // The third component of H⁻¹ (x, up, 1) is one over that of H (u, v, 1).
                let w = (plane_from_pixel * Vector3::new(p.u_px, p.v_px, 1.0))[2];
                (w > 0.0 && w.is_finite()).then(|| 1.0 / w)
            }
        }
    }

    /// The lens by which the picture is undistorted first.
    pub(super) const fn lens(&self) -> Option<&Lens> {
        self.lens.as_ref()
    }

    /// The undistorted point and d(undistorted)/d(seen).
    pub(super) fn undistort_with_jacobian(&self, p: PixelPoint) -> Option<(PixelPoint, Matrix2<f64>)> {
        match &self.lens {
            Some(lens) => lens.undistort_with_jacobian(p),
            None => Some((p, Matrix2::identity())),
        }
    }

    pub(super) fn undistort(&self, p: PixelPoint) -> Option<PixelPoint> {
        match &self.lens {
            Some(lens) => lens.undistort(p),
            None => Some(p),
        }
    }

    /// The problem of a point that the lens model cannot undistort.
    pub(super) fn beyond_lens(key: &str, p: PixelPoint) -> FileProblem {
        FileProblem::new(
            key,
            format!("[{}, {}], which the lens model cannot undistort", p.u_px, p.v_px),
            "a pixel within the region where the distortion is one to one",
            "check the point and lens.distortion (a fit with large k3 fails in the corners of the picture)",
        )
    }
}

/// What to do about an `up_px` that is none.
pub(super) const HINT_UP: &str =
    "leave it out: the fall tells; or give the direction of a plumb line, upwards";

fn rotation(
    lens: Option<&Lens>,
    origin_px: Option<PixelPoint>,
    [a, b]: [f64; 2],
) -> Result<PlaneTransform, FileProblem> {
    let norm = a.hypot(b);
    if !(norm.is_finite() && norm > 0.0) {
        return Err(FileProblem::new(
            "up_px",
            format!("[{a}, {b}]"),
            "a direction [du, dv] that is not zero",
            HINT_UP,
        ));
    }
    let origin = match (origin_px, lens) {
        (Some(seen), Some(lens)) => lens
            .undistort(seen)
            .ok_or_else(|| Rectification::beyond_lens("origin_px", seen))?,
        (Some(seen), None) => seen,
        (None, _) => PixelPoint::new(0.0, 0.0),
    };
    Ok(PlaneTransform::Rotation {
        origin,
        up: [a / norm, b / norm],
    })
}

/// An undistorted pixel on the side of the horizon that counts; `None`: the world's origin decides.
fn reference_pixel(lens: Option<&Lens>, image_size_px: Option<(usize, usize)>) -> Option<PixelPoint> {
    match image_size_px {
        Some((width, height)) => {
            let centre = PixelPoint::new(0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0));
            // Only the side matters: where a wild lens cannot undistort the centre, the centre itself will do.
            Some(
                lens.map_or(Some(centre), |l| l.undistort(centre))
                    .unwrap_or(centre),
            )
        }
        None => lens.map(Lens::principal_point),
    }
}

fn homography(given: &Matrix3<f64>, reference: Option<PixelPoint>) -> Result<PlaneTransform, FileProblem> {
    let refuse = |what: &str| {
        FileProblem::new(
            "scale.world_from_pixel",
            format!("{}, {what}", rows_text(given)),
            "an invertible 3x3 matrix from undistorted pixels to metres",
            "fit it again to four or more points of the plane, no three of them on a line",
        )
    };
    let largest = given.amax();
    if !(given.iter().all(|h| h.is_finite()) && largest > 0.0) {
        return Err(refuse("which is zero or not finite"));
    }
    let scaled = given / largest;
    let regular = relative_determinant(&scaled, reference) > SMALLEST_RELATIVE_DETERMINANT;
    if !regular {
        return Err(refuse("which is singular"));
    }
    let inverse = scaled.try_inverse().ok_or_else(|| refuse("which is singular"))?;
    let reference = match reference {
        Some(p) => p,
        // Column 3 of the inverse is the pixel of the world's origin; its own w must not vanish.
        None => {
            let (x, y, w) = (inverse[(0, 2)], inverse[(1, 2)], inverse[(2, 2)]);
            PixelPoint::new(x / w, y / w)
        }
    };
    let terms = scaled
        .row(2)
        .transpose()
        .component_mul(&Vector3::new(reference.u_px, reference.v_px, 1.0));
    let w = terms.sum();
    // A sum that is rounding only has no sign to go by.
    let sided = w.abs() > 1e-9 * terms.abs().sum();
    if !sided {
        return Err(refuse(
            "whose horizon runs through the picture's centre (or the world's origin)",
        ));
    }
    let plane_from_pixel = scaled * w.signum();
    let local = jacobian_of(&plane_from_pixel, reference.u_px, reference.v_px)
        .ok_or_else(|| refuse("whose horizon runs through the picture's centre"))?;
    let singular = local.singular_values();
    if !(singular.min() > SMALLEST_SCALE_RATIO * singular.max() && singular.max().is_finite()) {
        return Err(refuse("which sees the plane edge on"));
    }
    // (x w, up w, w) → (u, v, 1)/w: with w > 0 on the right side, the inverse's third component is positive too.
    Ok(PlaneTransform::Homography {
        plane_from_pixel,
        pixel_from_plane: inverse * w.signum(),
    })
}

/// |det| over the product of the rows' norms, in pixel coordinates centred and scaled to the picture, so that neither
/// the unit of the world nor the size of the picture decides.
fn relative_determinant(h: &Matrix3<f64>, reference: Option<PixelPoint>) -> f64 {
    let centre = reference.unwrap_or(PixelPoint::new(0.0, 0.0));
    // Half a picture; the order of magnitude is enough.
    let half = centre.u_px.abs().max(centre.v_px.abs()).max(500.0);
    let normalise = Matrix3::new(half, 0.0, centre.u_px, 0.0, half, centre.v_px, 0.0, 0.0, 1.0);
    let m = h * normalise;
    let norms = m.row(0).norm() * m.row(1).norm() * m.row(2).norm();
    m.determinant().abs() / norms
}

/// The projective map at (a, b); `None` where w is not positive.
fn apply(h: &Matrix3<f64>, a: f64, b: f64) -> Option<(f64, f64)> {
    let p = h * Vector3::new(a, b, 1.0);
    let point = (p[0] / p[2], p[1] / p[2]);
    (p[2] > 0.0 && point.0.is_finite() && point.1.is_finite()).then_some(point)
}

/// Its Jacobian: (h_ij − X_i h_3j) / w.
fn jacobian_of(h: &Matrix3<f64>, a: f64, b: f64) -> Option<Matrix2<f64>> {
    let (x, y) = apply(h, a, b)?;
    let w = h[(2, 0)] * a + h[(2, 1)] * b + h[(2, 2)];
    Some(
        Matrix2::new(
            h[(0, 0)] - x * h[(2, 0)],
            h[(0, 1)] - x * h[(2, 1)],
            h[(1, 0)] - y * h[(2, 0)],
            h[(1, 1)] - y * h[(2, 1)],
        ) / w,
    )
}

#[cfg(test)]
mod tests;
