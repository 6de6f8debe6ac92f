use super::super::outliers::fit_without_outliers;
use super::super::pattern::Pattern;
use super::super::views::{BoardView, BoardViews, ViewUse};
use super::*;
use crate::test_noise::TestNoise;
use nalgebra::Vector2;

const SIZE: (usize, usize) = (1280, 720);
const NOISE_PX: f64 = 0.05;

/// Views of a board of 9 by 6 corners all over the picture, their corners off by noise.
fn views(
    camera: &CameraParameters,
    count: usize,
    turn: f64,
    noise_px: f64,
    random: &mut TestNoise,
) -> Vec<Vec<CornerObservation>> {
    let mut views = Vec::new();
    while views.len() < count {
        let z = random.between(0.3, 0.5);
        let (x, y) = (
            random.between(-0.8, 0.8) * 0.71 * z,
            random.between(-0.8, 0.8) * 0.4 * z,
        );
        let rotation = Rotation3::from_euler_angles(
            random.between(-turn, turn),
            random.between(-turn, turn),
            random.between(-0.4, 0.4),
        );
        let pose = Pose {
            rotation,
            shift_m: Vector3::new(x, y, z) - rotation * Vector3::new(0.1, 0.0625, 0.0),
        };
        let view: Vec<CornerObservation> = (0..54)
            .filter_map(|i| {
                let board_m = Vector2::new(f64::from(i % 9), f64::from(i / 9)) * 0.025;
                let at = project(camera, &pose, &board_m)?.at;
                let mut off = || noise_px * random.normal();
                Some(CornerObservation {
                    board_m,
                    at: PixelPoint::new(at.x + off(), at.y + off()),
                    std_px: 0.2 * NOISE_PX,
                })
            })
            .collect();
        let inside =
            |s: &CornerObservation| (10.0..1270.0).contains(&s.at.u_px) && (10.0..710.0).contains(&s.at.v_px);
        if view.len() == 54 && view.iter().all(inside) {
            views.push(view);
        }
    }
    views
}

fn barrel() -> CameraParameters {
    CameraParameters::from([900.0, 901.0, 645.0, 352.0, -0.28, 0.09, 0.0006, -0.0004, 0.0])
}

#[test]
fn exact_corners_give_the_lens_back() {
    for camera in [
        barrel(),
        CameraParameters::from([1400.0, 1400.0, 639.5, 359.5, 0.1, 0.0, 0.0, 0.0, 0.0]),
    ] {
        let fit = fit(SIZE, &views(&camera, 8, 0.6, 0.0, &mut TestNoise(1))).unwrap();
        let off = fit.camera - camera;
        assert!(off.rows(0, 4).amax() < 0.01, "{off}");
        assert!(off.rows(4, 5).amax() < 1e-4, "{off}");
        assert!(fit.rms_px < 1e-4, "{} {:?}", fit.rms_px, fit.terms);
    }
}

/// The figure behind "uncertainties cover": pulls over many calibrations with noisy corners.
#[test]
fn uncertainties_of_lens_and_pose_cover() {
    let (mut inside, mut all, mut squares) = (0.0, 0.0, 0.0);
    let (mut displaced, mut places) = (0.0, 0.0);
    let mut posed = 0.0;
    let runs = 60;
    for seed in 0..runs {
        let mut r = TestNoise(100 + seed);
        let truth = CameraParameters::from([
            r.between(1000.0, 1500.0),
            r.between(1000.0, 1500.0),
            r.between(600.0, 680.0),
            r.between(330.0, 390.0),
            r.between(-0.25, 0.1),
            r.between(0.0, 0.08),
            r.between(-1e-3, 1e-3),
            r.between(-1e-3, 1e-3),
            0.0,
        ]);
        let fit = fit(SIZE, &views(&truth, 10, 0.6, NOISE_PX, &mut r)).unwrap();
        // k3 is 0 in truth and drawn to 0: it would flatter.
        for i in 0..8 {
            let pull = (fit.camera[i] - truth[i]) / fit.covariance[(i, i)].sqrt();
            inside += f64::from(u8::from(pull.abs() < 1.96));
            squares += pull * pull;
            all += 1.0;
        }
        let (true_lens, lens) = (lens(&truth).unwrap(), fit.lens().unwrap());
        for k in 0..24 {
            let p = PixelPoint::new(f64::from(k % 6) * 255.8, f64::from(k / 6) * 239.6);
            let by_camera = super::super::coverage::undistortion_by_camera(&fit.camera, p).unwrap();
            let covariance = by_camera * fit.covariance * by_camera.transpose();
            let (a, b) = (true_lens.undistort(p).unwrap(), lens.undistort(p).unwrap());
            let off = Vector2::new(b.u_px - a.u_px, b.v_px - a.v_px);
            let distance2 = (off.transpose() * covariance.try_inverse().unwrap() * off)[0];
            // 95 % of a normal distribution in two dimensions are within 5.99.
            displaced += f64::from(u8::from(distance2 < 5.99));
            places += 1.0;
        }
        posed += f64::from(u8::from(
            fit.joint_covariance(0).unwrap().symmetric_eigenvalues().min() > -1e-12,
        ));
    }
    let (share, width, region) = (inside / all, (squares / all).sqrt(), displaced / places);
    println!("{share:.3} of parameters, pulls of width {width:.3}, {region:.3} of places");
    assert!((0.92..0.985).contains(&share), "{share}");
    assert!((0.85..1.12).contains(&width), "{width}");
    assert!((0.90..0.995).contains(&region), "{region}");
    assert_eq!(posed, f64::from(runs as u32));
}

#[test]
fn views_that_are_all_square_do_not_fix_a_focal_length() {
    let views = views(&barrel(), 8, 0.0, NOISE_PX, &mut TestNoise(3));
    match fit(SIZE, &views) {
        Ok(fit) => assert!(fit.covariance[(0, 0)].sqrt() > 0.02 * fit.camera[0]),
        Err(error) => assert!(matches!(error, BoardError::NotDetermined { .. }), "{error}"),
    }
}

#[test]
fn bad_corners_count_less() {
    let mut views = views(&barrel(), 10, 0.6, NOISE_PX, &mut TestNoise(4));
    let mut r = TestNoise(5);
    // Two views blurred: their corners say so.
    for seen in views[..2].iter_mut().flatten() {
        seen.at.u_px += 0.5 * r.normal();
        seen.at.v_px += 0.5 * r.normal();
        seen.std_px = 0.5;
    }
    let weighted = fit(SIZE, &views).unwrap();
    let blind: Vec<Vec<CornerObservation>> = views
        .iter()
        .map(|v| {
            v.iter()
                .map(|s| CornerObservation { std_px: 0.01, ..*s })
                .collect()
        })
        .collect();
    let unweighted = fit(SIZE, &blind).unwrap();
    assert!(weighted.covariance[(0, 0)] < 0.4 * unweighted.covariance[(0, 0)]);
    let pull = (weighted.camera[0] - 900.0) / weighted.covariance[(0, 0)].sqrt();
    assert!(pull.abs() < 3.5, "{pull}");
}

/// A set of sharp pictures with one whose corners miss by 0.06 px, as one from farther away does: it stays, and does no harm. One
/// that misses by forty times the others' is no view of the board.
#[test]
fn a_sound_picture_among_sharper_ones_is_kept() {
    const SHARP_PX: f64 = 0.015;
    let mut squares = [0.0; 2];
    for seed in 0..12 {
        let mut off = [0.0; 2];
        for (k, noise_px) in [0.06 / std::f64::consts::SQRT_2, 40.0 * SHARP_PX]
            .into_iter()
            .enumerate()
        {
            let mut r = TestNoise(300 + seed);
            let mut seen = views(&barrel(), 11, 0.6, SHARP_PX, &mut r);
            seen.extend(views(&barrel(), 1, 0.6, noise_px, &mut r));
            let mut all = BoardViews::new(Pattern::new((9, 6), 0.025, None).unwrap());
            all.size = Some(SIZE);
            all.views = seen
                .into_iter()
                .enumerate()
                .map(|(i, mut seen)| {
                    seen.iter_mut().for_each(|s| s.std_px = 0.005);
                    BoardView {
                        name: i.to_string(),
                        use_: ViewUse::Found,
                        seen,
                    }
                })
                .collect();
            let mut used: Vec<usize> = (0..12).collect();
            let fit = fit_without_outliers(&mut all, &mut used, SIZE).unwrap();
            let kept = used.contains(&11);
            assert_eq!(kept, k == 0, "{noise_px} {:?}", all.views[11].use_);
            if kept {
                let worst = fit.view_rms_px.last().copied().unwrap();
                assert!((0.04..0.08).contains(&worst), "{worst}");
            }
            off[k] = fit.camera[0] - barrel()[0];
            assert!(off[k].abs() < 4.0 * fit.covariance[(0, 0)].sqrt(), "{off:?}");
        }
        (0..2).for_each(|k| squares[k] += off[k] * off[k]);
    }
    // The focal length is as good with the picture as without it, or better.
    assert!(squares[0] < 1.2 * squares[1], "{squares:?}");
}
