//! Where the camera stands over the calibrated plane, and what follows for a ball that is not a point in that plane.
//!
//! A pinhole at height H over the plane, straight above its point A (the camera's foot). A point h above the plane's
//! point q (towards the camera) is seen against the plane at
//!
//! ```text
//! p = A + (q − A) · H/(H − h)
//! ```
//!
//! A sphere of radius R whose centre is Z along the optical axis and ρ off it (camera axes, focal length f) has an
//! elliptical outline, the cone of its tangents cut by the picture plane:
//!
//! ```text
//! image of its centre      f ρ / Z
//! centre of the outline    f ρ Z / (Z² − R²)          half axis across ρ: τ = f R / √(Z² − R²)
//! ```
//!
//! so that the one is f²/(f² + τ²) of the other, from the optical axis: neither R nor Z need be known. (Wong, Schnieders
//! and Li, IEEE TPAMI 2008.) It is small: a ball of 15 px at 500 px from the axis of a lens of 1200 px is seen 0.08 px
//! too far out.
//!
//! f is the lens's where only that is known. The optical axis goes through the lens's principal point, without a lens through the picture's middle. In a camera
//! square to the plane, which a scale without a homography supposes, that is where A is seen, and f = H in undistorted
//! pixels. A homography K [r1 r2 t], with square pixels (or the lens's ratio) and the distance given, says how the camera
//! is turned: (K⁻¹ h1, K⁻¹ h2, K⁻¹ h3) = λ (r1, r2, t), λ from the depth of the plane on the axis, f from |r1| = |r2| = 1.

use super::lens::Lens;
use super::rectification::Rectification;
use crate::config::FileProblem;
use crate::geometry::{PixelPoint, PlanePoint};
use nalgebra::{Matrix2, Matrix3, Rotation3, Vector2, Vector3};

/// Where the camera stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Viewpoint {
    /// The plane's point straight below the camera, plane units.
    pub foot: PlanePoint,
    /// Height of the camera over the plane, plane units.
    pub height: f64,
    /// Its pinhole and picture.
    pub optics: Optics,
}

/// The angles at which a pinhole sees what is in its undistorted picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Optics {
    /// Where the optical axis goes through the picture.
    axis: PixelPoint,
    /// Focal length, px; of pixels that are not square the geometric mean of both ways.
    focal_px: f64,
    /// √(fx/fy): 1 where pixels are square.
    wide: f64,
    /// The plane's axes (right, up, out of it) in the camera's (right, down, away), where a homography tells them.
    plane_axes: Option<Matrix3<f64>>,
}

impl Viewpoint {
    /// A camera `distance` plane units from the plane along its optical axis.
    pub(super) fn new(
        map: &Rectification,
        distance: f64,
        image_size_px: (usize, usize),
    ) -> Result<Self, FileProblem> {
        let (width, height) = image_size_px;
        let middle = PixelPoint::new(0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0));
        let axis = map.lens().map_or(middle, Lens::principal_point);
        let viewpoint = match map.ideal_from_plane_matrix() {
            Some(matrix) => {
                let aspect = map.lens().map_or(1.0, Lens::aspect);
                Self::turned(map, matrix, axis, aspect, distance)
            }
            None => map.plane_from_ideal(axis).map(|foot| Self {
                foot,
                height: distance,
                optics: Optics {
                    axis,
                    focal_px: distance,
                    wide: 1.0,
                    plane_axes: None,
                },
            }),
        };
        let sound = |x: f64| x > 0.0 && x.is_finite();
        viewpoint
            .filter(|v| sound(v.height) && sound(v.optics.focal_px))
            .ok_or_else(|| {
                FileProblem::new(
                    "distance_m",
                    format!("{distance}, which no camera with this homography can have"),
                    "the distance from the lens to the plane along the optical axis, in metres",
                    "measure it again, check the unit of world_from_pixel, or leave distance_m out",
                )
            })
    }

    /// From a homography; see the module's head. `aspect` is fy/fx.
    fn turned(
        map: &Rectification,
        ideal_from_plane: &Matrix3<f64>,
        axis: PixelPoint,
        aspect: f64,
        distance: f64,
    ) -> Option<Self> {
        // K⁻¹ without 1/f: rows (u − c_u w, (v − c_v w)/aspect, w).
        let shift = Matrix3::new(
            1.0,
            0.0,
            -axis.u_px,
            0.0,
            1.0 / aspect,
            -axis.v_px / aspect,
            0.0,
            0.0,
            1.0,
        );
        let h = shift * ideal_from_plane;
        let on_axis = map.plane_from_ideal(axis)?;
        let depth = h[(2, 0)] * on_axis.right + h[(2, 1)] * on_axis.up + h[(2, 2)];
        let lambda = depth / distance;
        // |λ r|² = (a² + b²)/f² + w² for both columns; their mean, as neither is better known.
        let focal2 =
            |k: usize| (h[(0, k)].powi(2) + h[(1, k)].powi(2)) / (lambda * lambda - h[(2, k)].powi(2));
        let (one, two) = (focal2(0), focal2(1));
        if !(one > 0.0 && two > 0.0) {
            return None;
        }
        let focal_px = (0.5 * (one + two)).sqrt();
        let column = |k: usize| Vector3::new(h[(0, k)] / focal_px, h[(1, k)] / focal_px, h[(2, k)]) / lambda;
        let (right, up, from) = (column(0), column(1), column(2));
        let normal = right.cross(&up);
        // Camera at 0 = X right + Y up + Z normal + from.
        let place = Matrix3::from_columns(&[right, up, normal]).try_inverse()? * -from;
        Some(Self {
            foot: PlanePoint::new(place.x, place.y),
            height: place.z.abs(),
            optics: Optics {
                axis,
                focal_px: focal_px * aspect.sqrt(),
                wide: 1.0 / aspect.sqrt(),
                plane_axes: Some(Matrix3::from_columns(&[right, up, normal])),
            },
        })
    }

    /// The plane's point against which the camera sees what is `nearness` plane units above the plane's point `below`;
    /// `None` where that is not in front of the camera.
    #[must_use]
    pub fn seen_against(&self, below: PlanePoint, nearness: f64) -> Option<PlanePoint> {
        let left = self.height - nearness;
        let factor = self.height / left;
        (left > 0.0).then(|| {
            PlanePoint::new(
                self.foot.right + factor * (below.right - self.foot.right),
                self.foot.up + factor * (below.up - self.foot.up),
            )
        })
    }
}

impl Optics {
    /// Of a calibrated lens: its principal point and focal length.
    pub(super) fn of_lens(lens: &Lens) -> Self {
        let (fx, fy) = lens.focal_px();
        Self {
            axis: lens.principal_point(),
            focal_px: (fx * fy).sqrt(),
            wide: (fx / fy).sqrt(),
            plane_axes: None,
        }
    }

    /// The turn from the camera's own line of sight to that of a point of the undistorted picture, camera axes (right, down, away).
    pub(super) fn sight(&self, ideal: PixelPoint) -> Rotation3<f64> {
        let there = Vector3::new(
            (ideal.u_px - self.axis.u_px) / self.wide,
            (ideal.v_px - self.axis.v_px) * self.wide,
            self.focal_px,
        );
        Rotation3::rotation_between(&Vector3::z(), &there).unwrap_or_default()
    }

    /// The plane's axes (right, up, out of it) in the camera's (right, down, away), where a homography tells them.
    pub(super) fn plane_axes(&self) -> Option<Matrix3<f64>> {
        self.plane_axes
    }

    /// The image of a ball's centre whose outline, `radius_px` wide, is around `middle`.
    pub(super) fn centre_of(&self, middle: PixelPoint, radius_px: f64) -> PixelPoint {
        let f2 = self.focal_px * self.focal_px;
        let part = f2 / (f2 + radius_px * radius_px);
        PixelPoint::new(
            self.axis.u_px + part * (middle.u_px - self.axis.u_px),
            self.axis.v_px + part * (middle.v_px - self.axis.v_px),
        )
    }

    /// How perspective stretches the outline of a ball seen at `p`: the matrix that makes it of a circle, longer along the
    /// line from the optical axis by √(1 + (ρ/Z)²).
    pub(super) fn outline_stretch(&self, p: PixelPoint) -> Matrix2<f64> {
        // As square pixels would have it.
        let away = Vector2::new(
            (p.u_px - self.axis.u_px) / self.wide,
            (p.v_px - self.axis.v_px) * self.wide,
        );
        let tangent2 = away.norm_squared() / (self.focal_px * self.focal_px);
        // √(1 + x) − 1 without its cancellation.
        let longer = tangent2 / (1.0 + (1.0 + tangent2).sqrt());
        let square = away.try_normalize(0.0).map_or_else(Matrix2::identity, |d| {
            Matrix2::identity() + longer * d * d.transpose()
        });
        Matrix2::new(self.wide, 0.0, 0.0, 1.0 / self.wide) * square
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::{Calibration, MetresPerPixel, Scale};
    use proptest::prelude::*;

    const SIZE: (usize, usize) = (1280, 720);

    fn pixels(distance_m: f64) -> Calibration {
        let mut c = Calibration::new(Scale::MetresPerPixel(MetresPerPixel {
            value: 0.001,
            std: None,
        }));
        c.distance_m = Some(distance_m);
        c
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        /// A camera anywhere, turned anyhow, with the homography that it has: its place comes back.
        #[test]
        fn a_homography_and_the_distance_give_the_cameras_place(
            tilt in -0.5..0.5_f64, roll in -3.0..3.0_f64, lean in -0.5..0.5_f64,
            x in -1.0..1.0_f64, y in -1.0..1.0_f64, height in 0.5..5.0_f64, focal_px in 500.0..3000.0_f64,
        ) {
            // Camera axes right, down, forward; looking down at the floor, then turned.
            let down = Matrix3::new(1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0);
            let turn = Rotation3::from_euler_angles(tilt, lean, roll).matrix() * down;
            let camera = Vector3::new(x, y, height);
            let from = -(turn * camera);
            let k = Matrix3::new(focal_px, 0.0, 639.5, 0.0, focal_px, 359.5, 0.0, 0.0, 1.0);
            let h = k * Matrix3::from_columns(&[turn.column(0).into_owned(), turn.column(1).into_owned(), from]);
            let distance = -camera.z / turn.row(2)[2];
            let mut c = Calibration::new(Scale::Homography(h.try_inverse().unwrap().into()));
            c.image_size_px = Some(SIZE);
            c.distance_m = Some(distance);
            let v = c.viewpoint(1.0, SIZE).unwrap().unwrap();
            prop_assert!((v.foot.right - x).hypot(v.foot.up - y) < 1e-6 * height, "{v:?}");
            prop_assert!((v.height / height - 1.0).abs() < 1e-6 && (v.optics.focal_px / focal_px - 1.0).abs() < 1e-6);
            // And a point above the plane is seen where the camera sees it.
            let (point, seen) = (Vector3::new(0.2, -0.1, 0.2 * height), PlanePoint::new(0.2, -0.1));
            let ray = turn * (point - camera);
            let map = c.rectification().unwrap();
            let there = map
                .plane_from_pixel(PixelPoint::new(639.5 + focal_px * ray.x / ray.z, 359.5 + focal_px * ray.y / ray.z));
            let expected = v.seen_against(seen, 0.2 * height).unwrap();
            if let Some(there) = there {
                prop_assert!((there.right - expected.right).hypot(there.up - expected.up) < 1e-6 * height);
            }
        }
    }

    #[test]
    fn a_camera_square_to_the_plane_stands_over_the_principal_point() {
        let mut c = pixels(2.0).with_origin(PixelPoint::new(100.0, 420.0));
        let v = c.viewpoint(0.001, SIZE).unwrap().unwrap();
        assert_eq!((v.foot, v.height), (PlanePoint::new(539.5, 60.5), 2000.0));
        let camera = Matrix3::new(2000.0, 0.0, 600.0, 0.0, 2000.0, 300.0, 0.0, 0.0, 1.0);
        c.lens = Some(Lens::new(camera, [-0.1, 0.0, 0.0, 0.0, 0.0]).unwrap());
        let foot = c.viewpoint(0.001, SIZE).unwrap().unwrap().foot;
        let origin = c
            .rectification()
            .unwrap()
            .plane_from_pixel(PixelPoint::new(600.0, 300.0));
        assert_eq!(Some(foot), origin);
        c.distance_m = None;
        assert_eq!(c.viewpoint(0.001, SIZE).unwrap(), None);
    }

    #[test]
    fn a_distance_that_the_homography_contradicts_is_refused() {
        // Strongly tilted: the plane cannot be that far.
        let h = Matrix3::new(0.001, 0.0, -0.64, 0.0, -0.001, 0.36, 0.0, 0.0005, 1.0);
        let mut c = Calibration::new(Scale::Homography(h.into()));
        c.image_size_px = Some(SIZE);
        c.distance_m = Some(50.0);
        let error = c.viewpoint(1.0, SIZE).unwrap_err().to_string();
        assert!(error.contains("distance_m") && error.contains("50"), "{error}");
    }
}
