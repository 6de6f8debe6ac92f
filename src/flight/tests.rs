use super::motion_model::VerticalPrior;
use super::side_view::SideView;
use super::*;
use crate::geometry::PlanePoint;
use crate::test_noise::TestNoise;

/// A ball that falls from 125 units with vx, bounces with e = 0.8, friction takes 10 % of vx; 240 Hz, g = 12262.5
/// units/s² (0.8 mm a unit); σ units of noise. Also a hand that moves in arcs of its own, of the same size.
fn scene(frames: usize, vx: f64, sigma: f64, hand: bool) -> Vec<Spot> {
    let g = 12_262.5;
    let hit = (2.0 * 125.0_f64 / g).sqrt();
    let mut noise = TestNoise(5);
    let mut spots = Vec::new();
    for frame in 0..frames {
        let t = frame as f64 / 240.0;
        let mut x = vx * t;
        let mut h = 125.0 - 0.5 * g * t * t;
        let (mut start, mut v, mut speed) = (hit, 0.8 * g * hit, vx);
        while t > start {
            speed *= 0.9;
            let s = t - start;
            let fly = 2.0 * v / g;
            if s <= fly {
                x = vx * hit + (spots_x(vx, hit, v, g, start)) + speed * s;
                h = v * s - 0.5 * g * s * s;
                break;
            }
            start += fly;
            v *= 0.8;
        }
        let mut place = |r: f64, u: f64, id: usize| Spot {
            coded: crate::frames::Coded::Whole,
            id,
            frame,
            time_s: t,
            place: PlanePoint::new(r + sigma * noise.normal(), u + sigma * noise.normal()),
            std: sigma,
            radius: 15.0,
            contrast_grey: 100.0,
        };
        spots.push(place(x, h, 2 * frame));
        if hand {
            let (a, b) = (
                400.0 + 120.0 * (9.0 * t).sin(),
                300.0 + 60.0 * (23.0 * t).cos() + 30.0 * (7.0 * t).sin(),
            );
            spots.push(place(a, b, 2 * frame + 1));
        }
    }
    spots
}

/// Distance covered in whole bounces before `start`.
fn spots_x(vx: f64, hit: f64, _v: f64, g: f64, start: f64) -> f64 {
    let (mut t, mut v, mut speed, mut x) = (hit, 0.8 * g * hit, vx * 0.9, 0.0);
    while t + 1e-12 < start {
        let fly = 2.0 * v / g;
        x += speed * fly;
        t += fly;
        v *= 0.8;
        speed *= 0.9;
    }
    x
}

#[test]
fn bounces_are_found_between_frames() {
    for vx in [1250.0, -1250.0, 0.0] {
        let flight = find(
            &LinkedSpots::new(scene(160, vx, 0.04, false)),
            &SideView::new(VerticalPrior::UNKNOWN),
        )
        .unwrap();
        let truth = (2.0 * 125.0_f64 / 12_262.5).sqrt();
        let first = flight.impacts[0].unwrap();
        assert!((first - truth).abs() < 2e-5, "{first} {truth}");
        assert!((flight.fit.gravity() / 12_262.5 - 1.0).abs() < 1e-3);
        let (a, b) = (flight.fit.motion(0, first), flight.fit.motion(1, first));
        assert!((-b.vh / a.vh - 0.8).abs() < 2e-3, "{}", -b.vh / a.vh);
        assert!((b.vr - 0.9 * vx).abs() < 4.0);
        assert!(flight.impacts.len() >= 2);
        assert!(flight.fit.reduced_chi < 1.3);
    }
}

#[test]
fn a_moving_hand_is_not_the_ball() {
    let flight = find(
        &LinkedSpots::new(scene(160, 1250.0, 0.04, true)),
        &SideView::new(VerticalPrior::UNKNOWN),
    )
    .unwrap();
    assert!(flight.points.iter().all(|p| p.spot.id % 2 == 0));
}

#[test]
fn only_a_hand_is_no_flight() {
    let spots: Vec<Spot> = scene(300, 1250.0, 0.3, true)
        .into_iter()
        .filter(|s| s.id % 2 == 1)
        .collect();
    let found = find(
        &LinkedSpots::new(spots),
        &SideView::new(VerticalPrior::LEVEL_CAMERA),
    );
    assert!(
        matches!(found, Err(NoFlight::NothingFalls { .. })),
        "{:?}",
        found.map(|f| (f.fit.acceleration(), f.used(), f.impacts, f.spans))
    );
}

#[test]
fn an_outlier_is_set_aside_with_its_distance() {
    let mut spots = scene(100, 1250.0, 0.04, false);
    spots[15].place.up += 3.0;
    let flight = find(&LinkedSpots::new(spots), &SideView::new(VerticalPrior::UNKNOWN)).unwrap();
    let off = flight.points[15].use_;
    assert!(
        matches!(off, SpotUse::Outlier(d) if (d - 3.0).abs() < 0.3),
        "{off:?}"
    );
    assert!(flight.fit.reduced_chi < 1.3);
}

#[test]
fn late_times_lose_nothing() {
    let early = find(
        &LinkedSpots::new(scene(100, 1250.0, 0.04, false)),
        &SideView::new(VerticalPrior::UNKNOWN),
    )
    .unwrap();
    let mut spots = scene(100, 1250.0, 0.04, false);
    for s in &mut spots {
        s.time_s += 3600.0;
    }
    let late = find(&LinkedSpots::new(spots), &SideView::new(VerticalPrior::UNKNOWN)).unwrap();
    assert!((late.impacts[0].unwrap() - 3600.0 - early.impacts[0].unwrap()).abs() < 1e-9);
    assert!((late.fit.gravity() / early.fit.gravity() - 1.0).abs() < 1e-8);
}

#[test]
fn a_small_ball_that_comes_nearer_still_flies() {
    // Its arcs are off by a tenth of its radius then, which is far less than the height that they span.
    for nearing_per_s in [0.0, 0.05, 0.1] {
        let mut spots = scene(130, 1250.0, 0.02, false);
        for s in &mut spots {
            s.radius = 2.0;
            let size = 1.0 + nearing_per_s * s.time_s;
            let from_axis = (s.place.right - 300.0, s.place.up - 60.0);
            s.place = PlanePoint::new(300.0 + size * from_axis.0, 60.0 + size * from_axis.1);
        }
        let flight = find(&LinkedSpots::new(spots), &SideView::new(VerticalPrior::UNKNOWN)).unwrap();
        assert_eq!(flight.impacts.len(), 2, "{nearing_per_s}: {:?}", flight.spans);
        let first = flight.impacts[0].unwrap();
        assert!((first - 0.14279).abs() < 2e-4, "{nearing_per_s}: {first}");
    }
}

#[test]
fn frames_missing_at_an_impact_and_frames_put_in_too_many_show_in_its_arcs() {
    let hit_s = (2.0 * 125.0_f64 / 12_262.5).sqrt();
    let whole = scene(160, 1250.0, 0.04, false);
    let gone = 2;
    let from = (hit_s * 240.0) as usize;
    // The frames `from` and the next are gone; the clock has put in `put_in` for them.
    for put_in in [0, 1, 3, 4] {
        let shown = whole.iter().filter(|s| !(from..from + gone).contains(&s.frame));
        let spots = shown.map(|s| {
            let (frame, times) = if s.frame < from {
                (s.frame, s.frame)
            } else {
                (s.frame - gone, s.frame - gone + put_in)
            };
            Spot {
                frame,
                time_s: times as f64 / 240.0,
                ..*s
            }
        });
        let flight = find(
            &LinkedSpots::new(spots.collect()),
            &SideView::new(VerticalPrior::UNKNOWN),
        )
        .unwrap();
        let found = dropped_frames::at_impacts(&flight);
        let wanted = gone as isize - put_in as isize;
        assert!(
            found.len() == 1 && found[0].missing == wanted && found[0].frame.abs_diff(from) <= 1,
            "{put_in}: {found:?}"
        );
    }
}
