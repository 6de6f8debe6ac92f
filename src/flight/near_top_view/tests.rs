use super::*;
use crate::flight::drag::{Drag, DragLaw};
use crate::flight::find;
use crate::flight::planar::DRAG;
use crate::test_noise::TestNoise;
use proptest::prelude::*;

/// 1 mm a unit, a ball of 12 mm, a camera `height` mm up.
fn known(height: f64) -> NearTopView {
    NearTopView {
        nadir: PlanePoint::new(400.0, 250.0),
        nadir_std: 5.0,
        fall_per_s2: 9810.0 / height,
        fall_relative_std: 0.01,
        height: Some(height),
        contact: Some(12.0 / height),
        drag: Some(Drag {
            beta: 2e-6,
            std: 4e-7,
            law: DragLaw::default(),
        }),
        inertia_factor: 0.4,
    }
}

/// Two bounces: dropped from 250 mm with `v`, turned by `turn` at the first impact, e = 0.8, 240 Hz; without air.
fn spots(camera: &NearTopView, v: [f64; 2], turn: f64, sigma: f64, noise: &mut TestNoise) -> Vec<Spot> {
    let (g, drop, height) = (9810.0_f64, 250.0_f64, camera.camera_height());
    let hit = (2.0 * drop / g).sqrt();
    let up = 0.8 * g * hit;
    let (sin, cos) = turn.sin_cos();
    let after = [0.8 * (cos * v[0] - sin * v[1]), 0.8 * (sin * v[0] + cos * v[1])];
    let again = hit + 2.0 * up / g;
    (0..150)
        .map(|frame| {
            let t = frame as f64 / 240.0;
            let (z, s) = if t < hit {
                (drop - 0.5 * g * t * t, [v[0] * t, v[1] * t])
            } else {
                let dt = t - hit;
                let place = [v[0] * hit + after[0] * dt, v[1] * hit + after[1] * dt];
                if t < again {
                    (up * dt - 0.5 * g * dt * dt, place)
                } else {
                    (0.8 * up * (t - again) - 0.5 * g * (t - again).powi(2), place)
                }
            };
            let near = 1.0 / (1.0 - (z + 12.0) / height);
            let nadir = camera.nadir;
            let at = PlanePoint::new(
                nadir.right + (100.0 + s[0] - nadir.right) * near + sigma * noise.normal(),
                nadir.up + (200.0 + s[1] - nadir.up) * near + sigma * noise.normal(),
            );
            Spot {
                coded: crate::frames::Coded::Whole,
                id: frame as usize,
                frame: frame as usize,
                time_s: t,
                place: at,
                std: sigma,
                radius: 12.0 * near * (1.0 + 0.01 * noise.normal()),
                contrast_grey: 100.0,
            }
        })
        .collect()
}

/// Turn of the path over the floor at the first impact, and its standard uncertainty.
fn turn_of(flight: &Flight) -> (f64, f64) {
    let turn = |p: &[f64]| {
        let t = flight.fit.impact_time(p, 0).unwrap();
        let (a, b) = (flight.fit.in_plane(p, 0, t), flight.fit.in_plane(p, 1, t));
        (a.vr * b.vh - a.vh * b.vr).atan2(a.vr * b.vr + a.vh * b.vh)
    };
    let p = flight.fit.parameters.as_slice().to_vec();
    let slopes = DVector::from_fn(p.len(), |i, _| {
        let step = 1e-3 * flight.fit.covariance[(i, i)].sqrt().max(1e-12);
        let mut q = p.clone();
        q[i] += step;
        (turn(&q) - turn(&p)) / step
    });
    let variance = (slopes.transpose() * &flight.fit.covariance * &slopes)[0];
    (turn(&p), variance.sqrt())
}

#[test]
fn the_turn_is_found_within_its_uncertainty() {
    // The interval holds the truth, and leaves room for what these spots do not have: light, shade and air.
    let mut noise = TestNoise(7);
    let (mut inside, mut squares, mut all) = (0, 0.0, 0);
    for height in [1000.0, 2000.0, 5000.0] {
        let camera = known(height);
        for _ in 0..14 {
            let angle = 0.6 * (noise.uniform() - 0.5);
            let truth = 1.2 * (noise.uniform() - 0.5);
            let v = [900.0 * angle.cos(), 900.0 * angle.sin()];
            let flight = find(
                &LinkedSpots::new(spots(&camera, v, truth, 0.02, &mut noise)),
                &camera,
            )
            .unwrap();
            let (turn, std) = turn_of(&flight);
            let error = turn - truth;
            let limit = 0.2_f64.to_radians();
            assert!(error.abs() < limit, "{height} mm: {error} ± {std}");
            inside += usize::from(error.abs() < 1.96 * std);
            squares += (error / std).powi(2);
            all += 1;
        }
    }
    let pull = (squares / f64::from(all)).sqrt();
    println!("{inside} of {all} inside, root mean square pull {pull:.2}");
    assert!(
        inside * 100 >= 92 * all as usize && pull < 1.2,
        "{inside} of {all}, {pull}"
    );
}

#[test]
fn a_far_camera_is_as_good_as_one_without_perspective() {
    let (camera, mut noise) = (known(100_000.0), TestNoise(3));
    let spots = spots(&camera, [900.0, 50.0], -0.4, 0.02, &mut noise);
    let flight = find(&LinkedSpots::new(spots), &camera).unwrap();
    let (turn, std) = turn_of(&flight);
    assert!((turn + 0.4).abs() < 0.002 && std < 0.002, "{turn} ± {std}");
}

#[test]
fn what_the_camera_is_said_to_be_much_nearer_than_is_no_flight() {
    let (camera, mut noise) = (known(2000.0), TestNoise(5));
    let linked = LinkedSpots::new(spots(&camera, [900.0, 50.0], 0.4, 0.05, &mut noise));
    for height in [50.0, 150.0, 400.0] {
        assert!(find(&linked, &known(height)).is_err(), "{height} mm");
    }
}

#[test]
fn the_fall_that_the_flight_shows_tells_a_wrong_height() {
    let (camera, mut noise) = (known(2000.0), TestNoise(9));
    let linked = LinkedSpots::new(spots(&camera, [900.0, 50.0], 0.4, 0.02, &mut noise));
    for said in [1800.0, 2000.0, 2300.0] {
        let flight = find(&linked, &known(said)).unwrap();
        let seen = flight.fall_ratio().unwrap();
        let std = seen.std_uncertainty.unwrap();
        let expected = said / 2000.0;
        assert!(
            (seen.value - expected).abs() < 3.0 * std && std < 0.03,
            "{said}: {seen:?}"
        );
    }
}

#[test]
fn flying_without_air_is_flying_in_very_thin_air() {
    let (times, layout) = (vec![10.0], SpatialLayout::new(1));
    let mut p = vec![0.0; layout.count()];
    p[layout.ground(0)..layout.ground(0) + 4].copy_from_slice(&[100.0, 900.0, 200.0, -300.0]);
    p[layout.rise(0)..layout.rise(0) + 2].copy_from_slice(&[0.1, -0.4]);
    let camera = known(2000.0);
    let exact = spatial_motion(&camera, &p, &times, 0, 10.2);
    p[DRAG] = 1e-15;
    let thin = spatial_motion(&camera, &p, &times, 0, 10.2);
    assert!((exact.ground.r - thin.ground.r).abs() < 1e-7 && (exact.zeta - thin.zeta).abs() < 1e-10);
    // Lift does no work: with s along the up axis the path turns, the speed stays but for the fall.
    p[DRAG] = 0.0;
    p[layout.lift(0) + 2] = 0.5;
    let turned = spatial_motion(&camera, &p, &times, 0, 10.2);
    let speed = turned.ground.vr.hypot(turned.ground.vh);
    assert!((speed - 900.0_f64.hypot(300.0)).abs() < 1e-6, "{speed}");
    let angle = turned.ground.vh.atan2(turned.ground.vr) - (-300.0_f64).atan2(900.0);
    assert!((angle - 0.1).abs() < 1e-9, "{angle}");
}

#[test]
fn the_seen_velocity_is_the_rate_of_the_seen_place() {
    let (times, layout) = (vec![0.0], SpatialLayout::new(1));
    let mut p = vec![0.0; layout.count()];
    p[layout.ground(0)..layout.ground(0) + 4].copy_from_slice(&[100.0, 900.0, 200.0, -300.0]);
    p[layout.rise(0)..layout.rise(0) + 2].copy_from_slice(&[0.1, -0.4]);
    let camera = known(2000.0);
    let at = |t: f64| spatial_motion(&camera, &p, &times, 0, t).seen(camera.nadir);
    let (m, dt) = (at(0.1), 1e-6);
    assert!(((at(0.1 + dt).r - at(0.1 - dt).r) / (2.0 * dt) - m.vr).abs() < 1e-3);
    assert!(((at(0.1 + dt).h - at(0.1 - dt).h) / (2.0 * dt) - m.vh).abs() < 1e-3);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]
    #[test]
    fn a_mirrored_flight_turns_the_other_way(turn in -0.8..0.8_f64, aside in -400.0..400.0_f64, seed in 0..1000_u64) {
        let camera = known(1500.0);
        let there = spots(&camera, [900.0, aside], turn, 0.02, &mut TestNoise(seed));
        let mut camera_back = camera;
        camera_back.nadir.right = -camera.nadir.right;
        let back: Vec<Spot> = there
            .iter()
            .map(|s| Spot { place: PlanePoint::new(-s.place.right, s.place.up), ..*s })
            .collect();
        let (a, _) = turn_of(&find(&LinkedSpots::new(there), &camera).unwrap());
        let (b, std) = turn_of(&find(&LinkedSpots::new(back), &camera_back).unwrap());
        prop_assert!((a + b).abs() < 0.01 * std, "{a} {b} ± {std}");
    }
}
