use super::*;
use crate::calibration::{Calibration, MetresPerPixel, Scale};
use proptest::prelude::*;

fn pixels() -> Calibration {
    Calibration::new(Scale::MetresPerPixel(MetresPerPixel {
        value: 0.001,
        std: None,
    }))
}

fn with_homography(h: Matrix3<f64>) -> Calibration {
    Calibration::new(Scale::Homography(h.into()))
}

fn lens() -> Lens {
    let camera = Matrix3::new(900.0, 0.0, 642.0, 0.0, 905.0, 357.5, 0.0, 0.0, 1.0);
    Lens::new(camera, [-0.12, 0.05, 0.001, -0.0007, 0.01]).unwrap()
}

/// An oblique view: 1 m of the plane is 800 px in the middle, and the horizon is at u = −25000.
fn oblique() -> Matrix3<f64> {
    Matrix3::new(
        0.0008, 0.00001, -0.1026, 0.00002, -0.00082, 0.5388, 0.00004, -0.00001, 1.0,
    )
}

fn differences(r: &Rectification, p: PixelPoint) -> Matrix2<f64> {
    let h = 1e-3;
    let at = |du: f64, dv: f64| {
        r.plane_from_pixel(PixelPoint::new(p.u_px + du, p.v_px + dv))
            .unwrap()
    };
    let (e, w, s, n) = (at(h, 0.0), at(-h, 0.0), at(0.0, h), at(0.0, -h));
    Matrix2::new(e.right - w.right, s.right - n.right, e.up - w.up, s.up - n.up) / (2.0 * h)
}

#[test]
fn up_is_up_and_right_is_right() {
    let mut c = pixels();
    c.origin_px = Some(PixelPoint::new(120.0, 660.0));
    let r = c.rectification().unwrap();
    assert_eq!(r.unit(), PlaneUnit::UndistortedPixel);
    assert_eq!(
        r.plane_from_pixel(PixelPoint::new(130.0, 640.0)),
        Some(PlanePoint::new(10.0, 20.0))
    );
    // A phone on its side: "up" points to the right of the picture, and right is down.
    c.up_px = [1.0, 0.0];
    let r = c.rectification().unwrap();
    assert_eq!(
        r.plane_from_pixel(PixelPoint::new(140.0, 670.0)),
        Some(PlanePoint::new(10.0, 20.0))
    );
}

#[test]
fn the_origin_is_undistorted_too() {
    let mut c = pixels();
    c.lens = Some(lens());
    c.origin_px = Some(PixelPoint::new(40.0, 700.0));
    let zero = c
        .rectification()
        .unwrap()
        .plane_from_pixel(PixelPoint::new(40.0, 700.0))
        .unwrap();
    assert!(zero.right.abs() < 1e-6 && zero.up.abs() < 1e-6);
}

#[test]
fn a_homography_gives_metres_where_its_points_say() {
    let r = with_homography(oblique()).rectification().unwrap();
    assert_eq!(r.unit(), PlaneUnit::Metre);
    let (u, v) = (700.0, 300.0);
    let w = 0.00004 * u - 0.00001 * v + 1.0;
    let p = r.plane_from_pixel(PixelPoint::new(u, v)).unwrap();
    assert!((p.right - (0.0008 * u + 0.00001 * v - 0.1026) / w).abs() < 1e-12);
    assert!((p.up - (0.00002 * u - 0.00082 * v + 0.5388) / w).abs() < 1e-12);
}

#[test]
fn the_sign_and_size_of_a_homography_do_not_matter() {
    let p = PixelPoint::new(700.0, 300.0);
    let at = |factor: f64| {
        with_homography(oblique() * factor)
            .rectification()
            .unwrap()
            .plane_from_pixel(p)
            .unwrap()
    };
    for factor in [-1.0, 1e12, -1e-12] {
        assert!((at(factor).right - at(1.0).right).abs() < 1e-12);
    }
}

#[test]
fn beyond_the_horizon_there_is_nothing() {
    // A floor seen from a low camera: the horizon is the row v = 200.
    let floor = Matrix3::new(0.01, 0.0, -6.4, 0.0, 0.0, 20.0, 0.0, 0.02, -4.0);
    let mut c = with_homography(floor);
    c.image_size_px = Some((1280, 720));
    let r = c.rectification().unwrap();
    assert!(r.plane_from_pixel(PixelPoint::new(640.0, 201.0)).is_some());
    for v in [200.0, 199.0, 0.0] {
        assert_eq!(r.plane_from_pixel(PixelPoint::new(640.0, v)), None);
        assert_eq!(r.jacobian(PixelPoint::new(640.0, v)), None);
    }
    // Behind the camera (up < 0): it would show above the horizon.
    assert!(r.pixel_from_plane(PlanePoint::new(0.0, 10.0)).is_some());
    assert_eq!(r.pixel_from_plane(PlanePoint::new(0.0, -10.0)), None);
    // Where the picture is the other side of the same matrix, that side counts.
    c.image_size_px = Some((1280, 200));
    let r = c.rectification().unwrap();
    assert!(r.plane_from_pixel(PixelPoint::new(640.0, 100.0)).is_some());
    assert_eq!(r.plane_from_pixel(PixelPoint::new(640.0, 300.0)), None);
}

#[test]
fn homographies_that_cannot_be_inverted_are_refused() {
    let rank_2 = Matrix3::new(1.0, 2.0, 3.0, 2.0, 4.0, 6.0, 0.0, 0.0, 1.0);
    let rounding_away = Matrix3::new(0.1, 0.2, 0.3, 0.1 + 0.2, 0.6, 0.9, 0.0, 0.0, 1.0);
    let edge_on = Matrix3::new(0.001, 0.0, 0.0, 0.0, -1e-9, 0.0, 0.0, 0.0, 1.0);
    let mut nan = oblique();
    nan[(1, 1)] = f64::NAN;
    for h in [
        rank_2,
        rounding_away,
        edge_on,
        nan,
        Matrix3::zeros(),
        Matrix3::repeat(1.0),
    ] {
        let error = with_homography(h).rectification().unwrap_err();
        assert_eq!(error.problems()[0].key, "scale.world_from_pixel", "{h}");
    }
    let mut c = with_homography(Matrix3::new(
        0.001, 0.0, 0.0, 0.0, -0.001, 0.5, 0.002, 0.0, -1.279,
    ));
    c.image_size_px = Some((1280, 720));
    assert!(c.rectification().unwrap_err().to_string().contains("horizon"));
}

#[test]
fn ordinary_homographies_in_any_unit_are_accepted() {
    for unit in [1e-6, 1.0, 1e6] {
        for shift_m in [0.0, 100.0] {
            let h = Matrix3::new(
                unit * 1e-3,
                0.0,
                shift_m * unit,
                0.0,
                unit * -1e-3,
                0.0,
                0.0,
                0.0,
                1.0,
            );
            with_homography(h).rectification().unwrap();
        }
    }
}

#[test]
fn a_zero_up_is_refused() {
    let mut c = pixels();
    c.up_px = [0.0, 0.0];
    assert_eq!(c.rectification().unwrap_err().problems()[0].key, "up_px");
}

prop_compose! {
    fn any_calibration()(
        kind in 0..2, has_lens: bool, angle in -3.2..3.2_f64, u in -100.0..1400.0, v in -100.0..900.0,
        tilt in (-2e-4..2e-4, -2e-4..2e-4),
    ) -> Calibration {
        let mut c = pixels();
        if kind == 1 {
            let mut h = oblique();
            (h[(2, 0)], h[(2, 1)]) = tilt;
            c = with_homography(h);
        } else {
            c.up_px = [angle.sin(), -angle.cos()];
            c.origin_px = Some(PixelPoint::new(u, v));
        }
        c.image_size_px = Some((1280, 720));
        c.lens = has_lens.then(lens);
        c
    }
}

proptest! {
    #[test]
    fn pixel_to_plane_and_back(c in any_calibration(), u in 0.0..1280.0, v in 0.0..720.0) {
        let r = c.rectification().unwrap();
        let p = PixelPoint::new(u, v);
        let back = r.pixel_from_plane(r.plane_from_pixel(p).unwrap()).unwrap();
        prop_assert!(back.distance_px(p) < 1e-6);
    }

    #[test]
    fn jacobian_is_the_limit_of_differences(c in any_calibration(), u in 0.0..1280.0, v in 0.0..720.0) {
        let r = c.rectification().unwrap();
        let p = PixelPoint::new(u, v);
        let exact = r.jacobian(p).unwrap();
        prop_assert!((exact - differences(&r, p)).norm() < 1e-6 * exact.norm());
    }

    #[test]
    fn a_rotation_keeps_distances_and_handedness(angle in -3.2..3.2_f64, u in 0.0..1280.0, v in 0.0..720.0) {
        let mut c = pixels();
        c.up_px = [angle.sin(), -angle.cos()];
        let jacobian = c.rectification().unwrap().jacobian(PixelPoint::new(u, v)).unwrap();
        prop_assert!((jacobian.determinant() + 1.0).abs() < 1e-12);
        prop_assert!((jacobian * jacobian.transpose() - Matrix2::identity()).norm() < 1e-12);
    }

    #[test]
    fn a_mirrored_picture_mirrors_the_plane(tilt in -0.5..0.5_f64, u in 0.0..1280.0, v in 0.0..720.0) {
        let mut c = pixels();
        c.up_px = [tilt.sin(), -tilt.cos()];
        c.origin_px = Some(PixelPoint::new(120.0, 660.0));
        let mut mirrored = c.clone();
        mirrored.up_px[0] = -c.up_px[0];
        mirrored.origin_px = Some(PixelPoint::new(1279.0 - 120.0, 660.0));
        let p = c.rectification().unwrap().plane_from_pixel(PixelPoint::new(u, v)).unwrap();
        let q = mirrored.rectification().unwrap().plane_from_pixel(PixelPoint::new(1279.0 - u, v)).unwrap();
        prop_assert!((p.right + q.right).abs() < 1e-9 && (p.up - q.up).abs() < 1e-9);
    }
}
