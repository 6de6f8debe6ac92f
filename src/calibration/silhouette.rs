//! The outline of a ball in the picture: an ellipse that depends on where the ball is.
//!
//! Three things make it one. Perspective lengthens the outline away from the optical axis (see [`super::viewpoint`]); the lens
//! stretches the picture there by other factors along the radius than across it; and a plane that is not square to the
//! camera is nearer at one side than at the other. With S(p) the product of the first two, S of determinant 1 but for
//! perspective's part, the outline of a ball seen at p is
//!
//! ```text
//! p + r S(p) (cos φ, sin φ)       r = r_usual · size(p),     size = √det(lens) · depth_usual / depth(p)
//! ```
//!
//! with one r_usual for the recording: the ball's radius in undistorted pixels where the optical axis meets the plane. The
//! depth of a point of the plane is the third component of the homography's (u w, v w, w), but for a factor.
//!
//! Over the ball itself the lens's factors change a little. So the ideal picture's outline is the ellipse nearest to the
//! undistorted one; from its centre perspective leads to that of the ball. (A ball of 15 px in the corner of a barrel lens:
//! 0.02 px; it grows with the radius squared.)

use super::lens::Lens;
use super::rectification::Rectification;
use super::viewpoint::Optics;
use crate::geometry::{PixelPoint, PlanePoint, nearest_ellipse};
use nalgebra::{Matrix2, Matrix3, Rotation3, Vector2, Vector3};

/// The outlines of balls in the calibrated plane.
#[derive(Debug, Clone, Copy)]
pub struct Silhouettes<'a> {
    map: &'a Rectification,
    optics: Option<Optics>,
    /// Where the usual ball is, in the ideal picture.
    usual: PixelPoint,
}

/// The outline of a ball at a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Silhouette {
    /// The linear map that takes a circle to it.
    pub stretch: Matrix2<f64>,
    /// How many times larger than usual that circle is.
    pub size: f64,
}

impl Silhouette {
    /// Long minus short half axis for a circle of radius 1: the difference of the stretch's singular values.
    #[must_use]
    pub fn elongation(&self) -> f64 {
        let m = &self.stretch;
        (m[(0, 0)] - m[(1, 1)]).hypot(m[(0, 1)] + m[(1, 0)])
    }
}

impl<'a> Silhouettes<'a> {
    /// In pictures that `map` takes to the plane, by a camera whose angles are `optics` as far as they are known; without
    /// a lens its axis is taken to go through the picture's `middle`.
    #[must_use]
    pub fn new(map: &'a Rectification, optics: Option<Optics>, middle: PixelPoint) -> Self {
        let usual = map.lens().map_or(middle, Lens::principal_point);
        Self { map, optics, usual }
    }

    /// The outline around the point `seen` of the picture; `None` beyond the map.
    #[must_use]
    pub fn at(&self, seen: PixelPoint) -> Option<Silhouette> {
        let (ideal, back) = self.map.undistort_with_jacobian(seen)?;
        let lens_scale = lens_scale(&back)?;
        let of_lens = back.try_inverse()? / lens_scale;
        let stretch = self
            .optics
            .map_or(of_lens, |o| of_lens * o.outline_stretch(ideal));
        let depths = self.map.depth(self.usual).zip(self.map.depth(ideal));
        let nearer = depths.map_or(1.0, |(usual, here)| usual / here);
        Some(Silhouette {
            stretch,
            size: lens_scale * nearer,
        })
    }

    /// The turn from the camera's own line of sight to that of a ball seen at `seen`, camera axes (right, down, away); none where the camera's
    /// angles are not known.
    #[must_use]
    pub fn sight(&self, seen: PixelPoint) -> Rotation3<f64> {
        let ideal = self.map.undistort(seen);
        self.optics
            .zip(ideal)
            .map_or_else(Rotation3::identity, |(optics, ideal)| optics.sight(ideal))
    }

    /// The plane's axes (right, up, towards the camera) in the camera's (right, down, away). Without a homography and the camera's angles the
    /// plane is taken to be square to the line of sight.
    #[must_use]
    pub fn plane_axes(&self) -> Option<Matrix3<f64>> {
        if let Some(axes) = self.optics.and_then(|o| o.plane_axes()) {
            return Some(axes);
        }
        let j = self.map.jacobian_from_ideal(self.usual)?;
        let axis = |k: usize| Vector3::new(j[(k, 0)], j[(k, 1)], 0.0).try_normalize(0.0);
        Some(Matrix3::from_columns(&[axis(0)?, axis(1)?, -Vector3::z()]))
    }

    /// The plane point of the ball whose outline, `radius_px` wide, is seen around `seen`; `None` where the map ends.
    #[must_use]
    pub fn centre_of_outline(&self, seen: PixelPoint, radius_px: f64) -> Option<PlanePoint> {
        let (middle, radius_px) = if self.map.lens().is_some() {
            self.undistorted(seen, radius_px)?
        } else {
            (seen, radius_px)
        };
        let centre = self.optics.map_or(middle, |o| o.centre_of(middle, radius_px));
        self.map.plane_from_ideal(centre)
    }

    /// Centre and radius of an outline in the ideal picture.
    fn undistorted(&self, seen: PixelPoint, radius_px: f64) -> Option<(PixelPoint, f64)> {
        let stretch = self.at(seen)?.stretch;
        let (middle, _) = nearest_ellipse(|d| {
            let rim = radius_px * (stretch * d);
            let ideal = self
                .map
                .undistort(PixelPoint::new(seen.u_px + rim.x, seen.v_px + rim.y))?;
            Some(Vector2::new(ideal.u_px, ideal.v_px))
        })?;
        let (_, back) = self.map.undistort_with_jacobian(seen)?;
        Some((
            PixelPoint::new(middle.x, middle.y),
            radius_px / lens_scale(&back)?,
        ))
    }

    /// Length of a pixel of the usual ball's radius, plane units. A tilted plane is foreshortened one way, the ball is not:
    /// the finer scale is the ball's.
    #[must_use]
    pub fn units_per_px(&self) -> Option<f64> {
        let j = self.map.jacobian_from_ideal(self.usual)?;
        let turned = (j[(0, 0)] + j[(1, 1)]).hypot(j[(1, 0)] - j[(0, 1)]);
        let mirrored = (j[(0, 0)] - j[(1, 1)]).hypot(j[(1, 0)] + j[(0, 1)]);
        let least = 0.5 * (turned - mirrored).abs();
        (least > 0.0 && least.is_finite()).then_some(least)
    }
}

/// How many times larger than the ideal picture the real one is, where `back` leads from it to the ideal.
fn lens_scale(back: &Matrix2<f64>) -> Option<f64> {
    let scale = 1.0 / back.determinant().abs().sqrt();
    (scale > 0.0 && scale.is_finite()).then_some(scale)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::{Calibration, MetresPerPixel, Scale};
    use proptest::prelude::*;

    const SIZE: (usize, usize) = (1280, 720);
    const MIDDLE: PixelPoint = PixelPoint::new(639.5, 359.5);

    /// A camera 1 m from a plane turned by `tilt_rad`, its calibration, and what it does.
    struct TiltedCamera {
        focal_px: [f64; 2],
        lens: Option<Lens>,
        turned: Rotation3<f64>,
    }

    impl TiltedCamera {
        fn new(focal_px: [f64; 2], distortion: Option<[f64; 5]>, tilt_rad: f64) -> Self {
            let [fx, fy] = focal_px;
            let matrix = Matrix3::new(fx, 0.0, MIDDLE.u_px, 0.0, fy, MIDDLE.v_px, 0.0, 0.0, 1.0);
            Self {
                focal_px,
                lens: distortion.map(|d| Lens::new(matrix, d).unwrap()),
                turned: Rotation3::from_euler_angles(0.3 * tilt_rad, tilt_rad, 0.0),
            }
        }

        /// The plane's point in the camera's axes: right, down, away.
        fn place(&self, p: PlanePoint) -> Vector3<f64> {
            self.turned * Vector3::new(p.right, -p.up, 0.0) + Vector3::z()
        }

        fn seen(&self, p: &Vector3<f64>) -> Vector2<f64> {
            let ideal = PixelPoint::new(
                MIDDLE.u_px + self.focal_px[0] * p.x / p.z,
                MIDDLE.v_px + self.focal_px[1] * p.y / p.z,
            );
            let seen = self.lens.as_ref().map_or(ideal, |l| l.distort(ideal).unwrap());
            Vector2::new(seen.u_px, seen.v_px)
        }

        fn calibration(&self) -> Calibration {
            let [fx, fy] = self.focal_px;
            let matrix = Matrix3::new(fx, 0.0, MIDDLE.u_px, 0.0, fy, MIDDLE.v_px, 0.0, 0.0, 1.0);
            let turn = self.turned.matrix();
            let plane = Matrix3::from_columns(&[
                turn.column(0).into_owned(),
                -turn.column(1).into_owned(),
                Vector3::z(),
            ]);
            let h = (matrix * plane).try_inverse().unwrap();
            let mut c = Calibration::new(Scale::Homography(h.into()));
            c.image_size_px = Some(SIZE);
            c.lens.clone_from(&self.lens);
            if self.lens.is_none() {
                c.distance_m = Some(1.0);
            }
            c
        }

        /// The outline of a sphere around `centre`, point by point: the tangents from the pinhole touch it on the circle
        /// where its polar plane cuts it.
        fn outline(&self, centre: &Vector3<f64>, radius_m: f64) -> Vec<Vector2<f64>> {
            let touch = 1.0 - radius_m * radius_m / centre.norm_squared();
            let across = centre.cross(&Vector3::new(0.3, -0.5, 0.8)).normalize();
            let other = centre.cross(&across).normalize();
            (0..2000)
                .map(|i| {
                    let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 2000.0).sin_cos();
                    self.seen(&(touch * centre + radius_m * touch.sqrt() * (cos * across + sin * other)))
                })
                .collect()
        }
    }

    /// The middle of the area within a polygon.
    fn middle_of(corners: &[Vector2<f64>]) -> Vector2<f64> {
        let (mut area, mut moment) = (0.0, Vector2::zeros());
        for (a, b) in corners.iter().zip(corners.iter().cycle().skip(1)) {
            let (a, b) = (a - corners[0], b - corners[0]);
            let triangle = 0.5 * (a.x * b.y - a.y * b.x);
            area += triangle;
            moment += triangle / 3.0 * (a + b);
        }
        corners[0] + moment / area
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        /// The whole chain against a sphere's tangents: any lens, any tilt, square pixels or not.
        #[test]
        fn an_outline_is_where_and_what_the_spheres_tangents_say(
            right in -0.5..0.5_f64, up in -0.25..0.25_f64, radius_m in 0.005..0.03_f64, tilt in -0.3..0.3_f64,
            k1 in -0.3..0.1_f64, aspect in 0.9..1.1_f64, lens in any::<bool>(),
        ) {
            let focal_px = if lens { [1000.0, 1000.0 * aspect] } else { [1000.0; 2] };
            let camera = TiltedCamera::new(focal_px, lens.then_some([k1, 0.05, 0.0005, -0.0004, 0.0]), tilt);
            let c = camera.calibration();
            let map = c.rectification().unwrap();
            let silhouettes = Silhouettes::new(&map, c.optics(Some(1.0), SIZE), MIDDLE);
            let place = PlanePoint::new(right, up);
            let rim = camera.outline(&camera.place(place), radius_m);
            let middle = middle_of(&rim);
            let seen = PixelPoint::new(middle.x, middle.y);
            let drawn = silhouettes.at(seen).unwrap();
            let back = drawn.stretch.try_inverse().unwrap();
            let radii: Vec<f64> = rim.iter().map(|p| (back * (p - middle)).norm()).collect();
            let mean = radii.iter().sum::<f64>() / radii.len() as f64;
            // A circle, but for what bulges by a third of its circumference.
            let out_of_round = radii.iter().map(|r| (r / mean - 1.0).abs()).fold(0.0, f64::max);
            prop_assert!(out_of_round < 0.006, "{out_of_round}");
            // Of the right size: f R / √(Z² − R²) where the axis meets the plane.
            let focal = (focal_px[0] * focal_px[1]).sqrt();
            let usual = focal * radius_m / (1.0 - radius_m * radius_m).sqrt();
            let size = mean / (usual * drawn.size);
            prop_assert!((size - 1.0).abs() < 0.001, "{size}");
            // And it leads to the ball: to a hundredth of a pixel for a ball of 30 px.
            let found = silhouettes.centre_of_outline(seen, mean).unwrap();
            let off_px = 1000.0 * (found.right - right).hypot(found.up - up);
            prop_assert!(off_px < 0.002 + 0.01 * (mean / 30.0).powi(2), "{off_px}");
        }
    }

    #[test]
    fn without_lens_and_distance_a_ball_is_round_and_always_as_large() {
        let c = Calibration::new(Scale::MetresPerPixel(MetresPerPixel {
            value: 0.001,
            std: None,
        }));
        let map = c.rectification().unwrap();
        let silhouettes = Silhouettes::new(&map, None, MIDDLE);
        let p = PixelPoint::new(10.25, 700.125);
        let drawn = silhouettes.at(p).unwrap();
        assert_eq!(
            (drawn.stretch, drawn.size, drawn.elongation()),
            (Matrix2::identity(), 1.0, 0.0)
        );
        assert_eq!(silhouettes.centre_of_outline(p, 20.0), map.plane_from_pixel(p));
        assert_eq!(silhouettes.units_per_px(), Some(1.0));
    }

    #[test]
    fn a_pixel_of_the_ball_is_not_foreshortened() {
        let tilted = TiltedCamera::new([1000.0; 2], None, 0.2).calibration();
        let map = tilted.rectification().unwrap();
        let units = Silhouettes::new(&map, None, MIDDLE).units_per_px().unwrap();
        assert!((units - 0.001).abs() < 1e-9, "{units}");
    }

    #[test]
    fn beyond_the_lens_there_is_no_outline() {
        let camera = TiltedCamera::new([400.0; 2], Some([-0.5, 0.0, 0.0, 0.0, 0.0]), 0.0);
        let map = camera.calibration().rectification().unwrap();
        let silhouettes = Silhouettes::new(&map, None, MIDDLE);
        let far = PixelPoint::new(1279.0, 719.0);
        assert_eq!(silhouettes.at(far), None);
        assert_eq!(silhouettes.centre_of_outline(far, 10.0), None);
    }
}
