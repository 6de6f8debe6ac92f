//! Calibrations at the limits of what a camera can be: the right metres, or a refusal that names its reason. What each key may
//! hold is in `calibration.rs`.

use crate::flown::{Film, G, Measured, quantities, sound, truths};
use nalgebra::{Matrix3, Vector3};
use track::calibration::{Calibration, Lens, MetresPerPixel, Ruler, Scale, ScaleEvidence};
use track::geometry::{PixelPoint, PlanePoint};
use track::rebound::{RigidMotion, SOLID_SPHERE, mu_e};

const STEEL: mu_e::Parameters = mu_e::Parameters {
    restitution: 0.78,
    friction: 0.07,
    static_friction: 0.07,
};

/// A fall of 180 px at `metres_per_px`, at 45 degrees.
fn film(metres_per_px: f64) -> Film {
    let fall_s = (2.0 * 180.0 * metres_per_px / G).sqrt();
    let before = RigidMotion {
        velocity_m_s: Vector3::new(G * fall_s, 0.0, -G * fall_s),
        surface_spin_m_s: Vector3::zeros(),
    };
    Film {
        metres_per_px,
        fall_s,
        rate_hz: 36.0 / fall_s,
        ..Film::new(before, mu_e::impact(&before, &STEEL, SOLID_SPHERE).0, Some(0.0))
    }
}

/// That the truth is within 4.5 standard uncertainties of what was measured.
fn holds(film: &Film, m: &Measured, what: &str) {
    sound(m, what);
    assert_eq!(m.bounces.len(), 1, "{what}");
    for ((name, q), (_, truth)) in quantities(&m.bounces[0]).into_iter().zip(truths(film)) {
        let q = q.unwrap_or_else(|| panic!("{what}: {name} is null"));
        let (std, truth) = (q.std_uncertainty.unwrap_or(1e-12), truth.unwrap());
        assert!(
            (q.value - truth).abs() < 4.5 * std,
            "{what}: {name} is {q:?}, not {truth}"
        );
    }
    let g = m.gravity_m_s2.unwrap();
    assert!(
        (g.value - G).abs() < 4.5 * g.std_uncertainty.unwrap(),
        "{what}: g is {g:?}"
    );
}

#[test]
fn from_a_micrometre_to_ten_metres_a_pixel() {
    for metres_per_px in [1e-6, 1e-5, 1e-4, 8e-4, 1e-2, 0.1, 1.0, 10.0] {
        let film = film(metres_per_px);
        holds(
            &film,
            &film.measured().unwrap(),
            &format!("{metres_per_px} m a pixel"),
        );
    }
}

#[test]
fn scales_over_thirty_orders_are_exact() {
    for exponent in -15..=15 {
        let size = 10.0_f64.powi(exponent);
        let per_pixel = Calibration::new(Scale::MetresPerPixel(MetresPerPixel {
            value: size,
            std: None,
        }));
        let found = per_pixel.metres_per_unit(&ScaleEvidence::default()).unwrap();
        assert_eq!(found.value, size);
        let ruler = Calibration::new(Scale::Ruler(Ruler {
            from: PixelPoint::new(3.0, 4.0),
            to: PixelPoint::new(603.0, 804.0),
            length_m: size,
            length_std_m: None,
            point_std_px: Some(0.5),
        }));
        let found = ruler.metres_per_unit(&ScaleEvidence::default()).unwrap();
        assert!((found.value / (1e-3 * size) - 1.0).abs() < 1e-15);
        // Two ends of half a pixel over a thousand.
        let relative = found.std_uncertainty.unwrap() / found.value;
        assert!((relative - 0.5e-3 * 2.0_f64.sqrt()).abs() < 1e-12, "{relative}");
    }
}

#[test]
fn an_origin_far_outside_the_picture_shifts_x_and_nothing_else() {
    let near = Film {
        seed: 4,
        ..film(8e-4)
    };
    let at_home = near.measured().unwrap();
    for far_px in [1e3, -1e5, 1e7, -1e9] {
        let film = Film {
            origin_px: [far_px, -0.3 * far_px],
            ..near
        };
        let m = film.measured().unwrap();
        let what = format!("origin at {far_px} px");
        holds(&film, &m, &what);
        for ((name, a), (_, b)) in quantities(&m.bounces[0])
            .into_iter()
            .zip(quantities(&at_home.bounces[0]))
        {
            if name == "x" {
                continue;
            }
            // A place of 1e9 px is rounded to 1e-7 px, a part of 1e-5 of a centre's deviation; differences of such places have
            // no more. Their uncertainties are asked to a percent.
            let (a, b) = (a.unwrap(), b.unwrap());
            let std = b.std_uncertainty.unwrap_or(1e-9);
            assert!(
                (a.value - b.value).abs() < 1e-3 * std,
                "{what}: {name} {a:?} {b:?}"
            );
            let stds = (a.std_uncertainty.unwrap_or(1.0), b.std_uncertainty.unwrap_or(1.0));
            assert!((stds.0 / stds.1 - 1.0).abs() < 0.01, "{what}: {name} {a:?} {b:?}");
        }
    }
}

#[test]
fn any_up_reads_the_same_impact() {
    let level = Film {
        seed: 9,
        ..film(8e-4)
    };
    for tilt_rad in [
        1e-9,
        0.02,
        0.8,
        std::f64::consts::FRAC_PI_2,
        2.5,
        std::f64::consts::PI,
        -1.1,
    ] {
        let film = Film { tilt_rad, ..level };
        holds(
            &film,
            &film.measured().unwrap(),
            &format!("up turned by {tilt_rad}"),
        );
    }
}

#[test]
fn how_long_up_is_written_does_not_matter() {
    let place = |length: f64| {
        let mut c = Calibration::new(Scale::MetresPerPixel(MetresPerPixel {
            value: 1.0,
            std: None,
        }));
        c.up_px = [0.6 * length, -0.8 * length];
        c.rectification()
            .unwrap()
            .plane_from_pixel(PixelPoint::new(700.0, 300.0))
            .unwrap()
    };
    let one = place(1.0);
    for length in [5e-300, 1e-9, 1e9, 1e300] {
        let found = place(length);
        assert!(
            (found.right - one.right).abs() < 1e-12 && (found.up - one.up).abs() < 1e-12,
            "{length}"
        );
    }
}

/// The middle of a picture of 1280 × 720 px.
const MIDDLE: PixelPoint = PixelPoint::new(639.5, 359.5);

/// A camera at 1 m from the plane's middle, 1000 px focal length, that looks at it `slant` radians off its normal.
fn slanted(slant: f64) -> Matrix3<f64> {
    // Pixel from plane: the plane turns about its vertical, so that x goes to depth.
    let (sin, cos) = slant.sin_cos();
    let (u, v) = (MIDDLE.u_px, MIDDLE.v_px);
    let pixel_from_plane = Matrix3::new(1000.0 * cos + u * sin, 0.0, u, v * sin, -1000.0, v, sin, 0.0, 1.0);
    pixel_from_plane.try_inverse().unwrap_or_else(Matrix3::zeros)
}

#[test]
fn a_plane_seen_ever_more_edge_on_is_right_until_it_is_refused() {
    let mut refused = false;
    for i in 0..=120 {
        // From square to edge on: cos = 1 ... 1e-6.
        let slant = (10.0_f64.powf(-f64::from(i) / 20.0)).acos();
        let mut c = Calibration::new(Scale::Homography(slanted(slant).into()));
        c.image_size_px = Some((1280, 720));
        let what = format!("{} degrees", slant.to_degrees());
        match c.rectification() {
            Err(error) => {
                let message = error.to_string();
                assert!(
                    message.contains("edge on") || message.contains("singular"),
                    "{what}: {message}"
                );
                assert!(slant.cos() < 1.5e-4, "{what}: {message}");
                refused = true;
            }
            Ok(map) => {
                assert!(!refused, "{what}: accepted again");
                for (u, v) in [(640.0, 360.0), (640.5, 361.0), (641.0, 300.0), (600.0, 500.0)] {
                    let pixel = PixelPoint::new(u, v);
                    let Some(place) = map.plane_from_pixel(pixel) else {
                        continue;
                    };
                    assert!(place.right.is_finite() && place.up.is_finite(), "{what}");
                    // What rounding does to a pixel of 1000 grows as the plane is foreshortened, 1/cos.
                    let back = map.pixel_from_plane(place).unwrap();
                    assert!(
                        back.distance_px(pixel) < 64.0 * f64::EPSILON * 1000.0 / slant.cos(),
                        "{what}: {back:?}"
                    );
                }
                let middle = map.plane_from_pixel(MIDDLE).unwrap();
                assert!(
                    middle.right.abs() < 1e-8 && middle.up.abs() < 1e-8,
                    "{what}: {middle:?}"
                );
            }
        }
    }
    assert!(refused);
}

#[test]
fn homographies_on_the_way_to_singular_are_right_or_refused() {
    // The second row turns into the first: what is left of the determinant is `part`.
    for exponent in 0..=30 {
        let part = 10.0_f64.powf(-f64::from(exponent) / 2.0);
        let h = Matrix3::new(
            1e-3,
            2e-3,
            0.1,
            1e-3 + part * 1e-3,
            2e-3 - part * 2e-3,
            0.1 + part,
            0.0,
            0.0,
            1.0,
        );
        let c = Calibration::new(Scale::Homography(h.into()));
        match c.rectification() {
            Err(error) => assert!(part < 1e-2, "{part}: {error}"),
            Ok(map) => {
                let pixel = PixelPoint::new(500.0, 400.0);
                let place = map.plane_from_pixel(pixel).unwrap();
                let back = map.pixel_from_plane(place).unwrap();
                // 1/part for the inverse, 1e3 px in size.
                assert!(
                    back.distance_px(pixel) < 64.0 * f64::EPSILON * 1e3 / part,
                    "{part}: {back:?}"
                );
            }
        }
    }
}

#[test]
fn beyond_the_horizon_nothing_has_a_place() {
    let mut c = Calibration::new(Scale::Homography(slanted(1.3).into()));
    c.image_size_px = Some((1280, 720));
    let map = c.rectification().unwrap();
    // x → −∞ on the plane comes towards the camera and passes it; +∞ is the vanishing line.
    let mut seen: Vec<Option<PlanePoint>> = Vec::new();
    for u in -4000..4000 {
        seen.push(map.plane_from_pixel(PixelPoint::new(f64::from(u), 360.0)));
    }
    let some: Vec<f64> = seen.iter().flatten().map(|p| p.right).collect();
    assert!(!some.is_empty() && some.len() < seen.len());
    assert!(
        some.windows(2).all(|w| w[0] < w[1]),
        "places go on to one side only"
    );
    // In one piece: never back from beyond.
    let changes = seen
        .windows(2)
        .filter(|w| w[0].is_some() != w[1].is_some())
        .count();
    assert_eq!(changes, 1);
}

#[test]
fn along_a_ray_distortion_has_an_inverse_up_to_a_place_and_none_beyond() {
    let camera = Matrix3::new(900.0, 0.0, 640.0, 0.0, 900.0, 360.0, 0.0, 0.0, 1.0);
    for distortion in [
        [-0.5, 0.0, 0.0, 0.0, 0.0],
        [-0.32, 0.11, 0.0, 0.0, -0.05],
        [0.0, 0.0, 0.0, 0.0, -3.0],
        [-5.0, 0.0, 0.0, 0.0, 0.0],
        [-1e3, 0.0, 0.0, 0.0, 0.0],
        [-1e8, 0.0, 0.0, 0.0, 0.0],
        [1e8, 0.0, 0.0, 0.0, 0.0],
        [0.3, -0.9, 0.02, -0.03, 0.4],
    ] {
        let lens = Lens::new(camera, distortion).unwrap();
        let (mut last, mut gone) = (-1.0, false);
        for i in 0..4000 {
            let seen = PixelPoint::new(640.0 + 0.5 * f64::from(i), 360.0);
            match lens.undistort(seen) {
                None => gone = true,
                Some(ideal) => {
                    assert!(!gone, "{distortion:?}: an answer again at {i}");
                    let radius = (ideal.u_px - 640.0).hypot(ideal.v_px - 360.0);
                    assert!(radius > last, "{distortion:?}: back towards the middle at {i}");
                    last = radius;
                    let again = lens.distort(ideal).unwrap();
                    // To 1e-9 px in the undistorted picture, which the lens stretches by 1 + 3 k1 s + ... again.
                    let s = (radius / 900.0).powi(2);
                    let stretch = 1.0 + 3.0 * distortion[0].max(0.0) * s;
                    assert!(
                        again.distance_px(seen) < 1e-6 + 2e-9 * stretch,
                        "{distortion:?} at {i}: {again:?}"
                    );
                }
            }
        }
        // A barrel lens folds within four picture widths; one that stretches does not.
        assert!(gone || distortion[0] > 0.0, "{distortion:?}");
    }
}

#[test]
fn an_origin_that_the_lens_cannot_show_is_refused() {
    let camera = Matrix3::new(900.0, 0.0, 640.0, 0.0, 900.0, 360.0, 0.0, 0.0, 1.0);
    let mut c = Calibration::new(Scale::MetresPerPixel(MetresPerPixel {
        value: 1e-3,
        std: None,
    }));
    c.lens = Some(Lens::new(camera, [-0.5, 0.0, 0.0, 0.0, 0.0]).unwrap());
    for (u, known) in [(900.0, true), (1100.0, true), (1200.0, false), (1e8, false)] {
        c.origin_px = Some(PixelPoint::new(u, 360.0));
        match c.rectification() {
            Ok(_) => assert!(known, "{u}"),
            Err(error) => assert!(!known && error.to_string().contains("undistort"), "{u}: {error}"),
        }
    }
}
