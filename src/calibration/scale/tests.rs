use super::*;
use crate::calibration::Calibration;
use nalgebra::Matrix3;

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-12 * b.abs()
}

fn ruler(length_std_m: Option<f64>, point_std_px: Option<f64>) -> Calibration {
    Calibration::new(Scale::Ruler(Ruler {
        from: PixelPoint::new(100.0, 500.0),
        to: PixelPoint::new(700.0, 1300.0),
        length_m: 2.0,
        length_std_m,
        point_std_px,
    }))
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
        &Calibration::new(Scale::MetresPerPixel(MetresPerPixel {
            value: 0.0008,
            std: Some(1e-6),
        })),
        ScaleEvidence::default(),
    );
    assert_eq!(q.value, 0.0008);
    assert!(near(q.std_uncertainty.unwrap(), 1e-6));
    let c = Calibration::new(Scale::MetresPerPixel(MetresPerPixel {
        value: 0.0008,
        std: None,
    }));
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
        let c = Calibration::new(Scale::MetresPerPixel(MetresPerPixel { value, std: None }));
        assert!(c.metres_per_unit(&ScaleEvidence::default()).is_err());
    }
}
