//! Balls drawn here, ray by ray, with known rates.

use super::map_value::sum_of_products;
use super::*;
use crate::test_noise::TestNoise;
use nalgebra::Rotation3;

const INTERVAL_S: f64 = 1.0 / 240.0;
const NOISE_GREY: f64 = 1.5;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Marks {
    Dots,
    Line,
    Halves,
    /// Two dots opposite each other on the equator: after half a turn about the line of sight they look alike.
    Pair,
    Plain,
}

impl Marks {
    fn albedo(self, n: &Vector3<f64>) -> f64 {
        let near = |x: f64, y: f64, z: f64, degrees: f64| {
            n.dot(&Vector3::new(x, y, z).normalize()) > degrees.to_radians().cos()
        };
        let dark = match self {
            Self::Dots => {
                near(1.0, 0.2, 0.1, 14.0)
                    || near(-0.3, 1.0, 0.2, 14.0)
                    || near(0.1, -0.4, 1.0, 14.0)
                    || near(-1.0, -0.5, 0.3, 14.0)
                    || near(0.3, -1.0, -0.4, 14.0)
                    || near(0.2, 0.5, -1.0, 14.0)
            }
            Self::Line => n.dot(&Vector3::new(1.0, 0.3, 0.1).normalize()).abs() < 0.12,
            Self::Halves => n.dot(&Vector3::new(1.0, 0.3, 0.2).normalize()) < 0.0,
            Self::Pair => near(1.0, 0.0, -0.5, 16.0) || near(-1.0, 0.0, -0.5, 16.0),
            Self::Plain => false,
        };
        if dark { 0.35 } else { 1.0 }
    }
}

/// A shaded ball of `radius_px` in `frames` frames, 3 × 3 rays a pixel; `drift` is by how much its lamp moves around it, rad/s.
fn views(
    marks: Marks,
    radius_px: f64,
    frames: usize,
    rate_rad_s: Vector3<f64>,
    drift_rad_s: f64,
    seed: u64,
) -> Vec<BallView> {
    let mut noise = TestNoise(seed);
    let turned = [(); 3].map(|()| noise.between(-3.0, 3.0));
    let first = if marks == Marks::Pair {
        Rotation3::identity()
    } else {
        Rotation3::new(turned.into())
    };
    let view = |i: usize| {
        let time_s = i as f64 * INTERVAL_S;
        let turn = Rotation3::new(time_s * rate_rad_s) * first;
        let lamp = Rotation3::new(Vector3::z() * drift_rad_s * time_s) * LAMP;
        let centre = [noise.uniform(), noise.uniform()];
        let mut pixels = picture(marks, radius_px, centre, &turn, &lamp, SHARP);
        for p in &mut pixels {
            p.grey = (p.grey + NOISE_GREY * noise.normal()).round().clamp(0.0, 255.0);
        }
        BallView {
            time_s,
            sight: Rotation3::identity(),
            pixels,
        }
    };
    (0..frames).map(view).collect()
}

/// Where the lamp is.
const LAMP: Vector3<f64> = Vector3::new(-0.520_266, -0.728_373, -0.624_320);

/// Rays a side, and the width of the square that they are spread over, px.
#[derive(Clone, Copy)]
struct Rays(i32, f64);

/// As a pixel alone blurs, and as a lens does with it.
const SHARP: Rays = Rays(3, 1.0);
const SOFT: Rays = Rays(7, 2.5);

impl Rays {
    /// Standard deviation of their blur along each axis, px.
    fn blur_px(self) -> f64 {
        self.1 / 12.0_f64.sqrt()
    }
}

/// The pixels of a ball turned by `turn` at `centre`, without noise.
fn picture(
    marks: Marks,
    radius_px: f64,
    centre: [f64; 2],
    turn: &Rotation3<f64>,
    lamp: &Vector3<f64>,
    Rays(rays, width_px): Rays,
) -> Vec<BallPixel> {
    let back = turn.inverse();
    let reach = radius_px.ceil() as i32;
    let at = |k: i32| (f64::from(k) + 0.5 - 0.5 * f64::from(rays)) * width_px / (f64::from(rays) * radius_px);
    let places = (-reach..=reach).flat_map(|v| (-reach..=reach).map(move |u| [u, v]));
    let places = places.map(|[u, v]| {
        [
            (f64::from(u) - centre[0]) / radius_px,
            (f64::from(v) - centre[1]) / radius_px,
        ]
    });
    let inside = places.filter(|p| p[0].hypot(p[1]) <= 1.0 - (0.6 + width_px) / radius_px);
    inside
        .map(|place| {
            let mut grey = 0.0;
            for k in 0..rays * rays {
                let (a, b) = (place[0] + at(k % rays), place[1] + at(k / rays));
                let n = Vector3::new(a, b, -(1.0 - a * a - b * b).max(0.0).sqrt());
                let light = 0.45 + 0.55 * n.dot(lamp).max(0.0);
                grey += 200.0 * light * marks.albedo(&(back * n)) / f64::from(rays * rays);
            }
            BallPixel { place, grey }
        })
        .collect()
}

/// What the pixels show, however few turns that is of.
fn suiting(search: &RotationSearch<'_>, views: &[BallView]) -> Result<SuitingRates, NoRate> {
    let ball = search.sampled(views)?;
    let evidence = search.evidence(&ball)?;
    evidence.by_all(&evidence.candidates(f64::INFINITY)?)
}

fn rivals(search: &RotationSearch<'_>, views: &[BallView]) -> Result<Vec<RotationFit>, NoRate> {
    Ok(suiting(search, views)?.possible)
}

const ANY_RATE: RateLimit = RateLimit {
    axis: Vector3::new(0.0, 0.0, 1.0),
    most_rad_s: f64::INFINITY,
};

fn search(radius_px: f64) -> RotationSearch<'static> {
    RotationSearch {
        noise_grey: NOISE_GREY,
        blur_px: 0.29,
        radius_px,
        centre_std_px: 0.0,
        turning_std_px: 0.0,
        radius_std_px: 0.0,
        light: None,
        limit: ANY_RATE,
    }
}

/// Rate about the line of sight: off by how much, and its standard uncertainty.
fn in_plane(fit: &RotationFit, rate_rad_s: Vector3<f64>) -> (f64, f64) {
    (fit.rate_rad_s.z - rate_rad_s.z, fit.covariance[(2, 2)].sqrt())
}

#[test]
fn a_ball_that_turns_about_the_line_of_sight_has_its_rate_whatever_its_marks() {
    for (marks, radius_px, turns_s, seed) in [
        (Marks::Dots, 8.0, 20.0, 11),
        (Marks::Line, 10.0, -33.0, 12),
        (Marks::Halves, 8.0, 9.0, 13),
        (Marks::Dots, 15.0, -57.0, 14),
    ] {
        let rate = Vector3::new(0.0, 0.0, TAU * turns_s);
        let views = views(marks, radius_px, 20, rate, 0.0, seed);
        let fits = rivals(&search(radius_px), &views);
        let fits = fits.unwrap_or_else(|reason| panic!("{marks:?}: {reason:?}"));
        let (off, std) = in_plane(&fits[0], rate);
        assert_eq!(fits.len(), 1, "{marks:?}");
        assert!(
            off.abs() < 0.004 * rate.norm() && off.abs() < 4.0 * std,
            "{marks:?}: {off} ± {std}"
        );
        assert!(std < 0.01 * rate.norm(), "{marks:?}: {std}");
    }
}

#[test]
fn centres_that_marks_draw_to_and_fro_make_a_rate_less_sure() {
    let (radius_px, off_px) = (16.0, 0.3);
    let rate = TAU * 9.0 * Vector3::new(0.8, 0.0, 0.6);
    let views = views(Marks::Halves, radius_px, 20, rate, 0.0, 17);
    let unsure = |axis: Vector3<f64>, turning_std_px: f64| {
        let mut views = views.clone();
        for view in &mut views {
            let off = Rotation3::new(view.time_s * rate) * axis * (off_px / radius_px);
            for p in &mut view.pixels {
                p.place = [p.place[0] + off.x, p.place[1] + off.y];
            }
        }
        let search = RotationSearch {
            turning_std_px,
            ..search(radius_px)
        };
        let fits = rivals(&search, &views).unwrap();
        let off = fits[0].rate_rad_s - rate;
        let chol = fits[0].covariance.cholesky().unwrap();
        (off.dot(&chol.solve(&off)) / 3.0).sqrt()
    };
    for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
        let (taken_as_right, honest) = (unsure(axis, 0.0), unsure(axis, off_px));
        assert!(
            honest < 2.0 && taken_as_right > 1.5 * honest,
            "{taken_as_right} {honest}"
        );
    }
}

#[test]
fn an_axis_far_from_the_line_of_sight_is_found() {
    let rate = TAU * 18.0 * Vector3::new(0.7, -0.5, 0.5);
    for marks in [Marks::Dots, Marks::Halves] {
        let views = views(marks, 15.0, 24, rate, 0.0, 5);
        let fits = rivals(&search(15.0), &views).unwrap();
        let off = fits[0].rate_rad_s - rate;
        assert_eq!(fits.len(), 1, "{marks:?}");
        assert!(off.norm() < 0.01 * rate.norm(), "{marks:?}: {off}");
        let chi2 = off.dot(&(fits[0].covariance.try_inverse().unwrap() * off));
        assert!(chi2 < 25.0, "{marks:?}: {chi2}");
    }
}

#[test]
fn the_rate_of_a_long_flight_scatters_by_little_more_than_the_pixels_noise_allows() {
    let (radius_px, frames) = (18.0, 120);
    let rate = Vector3::new(0.0, 0.0, TAU * 12.0);
    let middle_s = 0.5 * (frames - 1) as f64 * INTERVAL_S;
    let mut places = TestNoise(31);
    let centres: Vec<[f64; 2]> = (0..frames)
        .map(|_| [places.uniform(), places.uniform()])
        .collect();
    let clean = |i: usize, on_rad: f64| {
        let turn = Rotation3::new((i as f64 * INTERVAL_S) * rate + Vector3::z() * on_rad);
        picture(Marks::Dots, radius_px, centres[i], &turn, &LAMP, SOFT)
    };
    // What a frame whose ball is known tells of its angle: by how much its pixels change, over their noise, where it is turned by half a pixel at the rim.
    let half_rad = 0.25 / radius_px;
    let told_of_angle = |i: usize| -> f64 {
        let both = [clean(i, -half_rad), clean(i, half_rad)];
        let change = both[0].iter().zip(&both[1]);
        let squares: f64 = change.map(|(a, b)| (b.grey - a.grey).powi(2)).sum();
        squares / (2.0 * half_rad * NOISE_GREY).powi(2)
    };
    let told = |i: usize| told_of_angle(i) * (i as f64 * INTERVAL_S - middle_s).powi(2);
    let some_frames = 8;
    let told: f64 = (0..frames).step_by(some_frames).map(told).sum();
    let bound = (some_frames as f64 * told).sqrt().recip();
    let pictures: Vec<Vec<BallPixel>> = (0..frames).map(|i| clean(i, 0.0)).collect();
    let search = RotationSearch {
        blur_px: SOFT.blur_px(),
        ..search(radius_px)
    };
    let off = |seed: u64| {
        let mut noise = TestNoise(seed);
        let view = |(i, pixels): (usize, &Vec<BallPixel>)| BallView {
            time_s: i as f64 * INTERVAL_S,
            sight: Rotation3::identity(),
            pixels: pixels
                .iter()
                .map(|p| BallPixel {
                    grey: (p.grey + NOISE_GREY * noise.normal()).round(),
                    ..*p
                })
                .collect(),
        };
        let views: Vec<BallView> = pictures.iter().enumerate().map(view).collect();
        let from = (frames - SEARCH_FRAMES) / 2;
        let some = search.sampled(&views[from..from + SEARCH_FRAMES]).unwrap();
        let candidates = search.evidence(&some).unwrap().candidates(f64::INFINITY).unwrap();
        let all = search.sampled(&views).unwrap();
        let found = search.evidence(&all).unwrap().by_all(&candidates).unwrap();
        in_plane(&found.possible[0], rate).0
    };
    let off: Vec<f64> = (0..24).map(off).collect();
    let bias = off.iter().sum::<f64>() / off.len() as f64;
    let squares: f64 = off.iter().map(|x| (x - bias).powi(2)).sum();
    let scatter = (squares / (off.len() - 1) as f64).sqrt();
    assert!(scatter < 1.5 * bound, "{scatter} of {bound}");
    assert!(bias.abs() < 3.0 * bound, "{bias} of {bound}");
}

#[test]
fn rates_of_plain_balls_are_never_found() {
    for seed in 0..12 {
        let rate = Vector3::new(0.0, 0.0, 60.0);
        let drift = if seed % 2 == 0 { 0.0 } else { 6.0 };
        let views = views(Marks::Plain, 9.0, 20, rate, drift, seed);
        let search = search(9.0);
        let ball = search.sampled(&views).unwrap();
        let found = search.rivals(&ball).map(|f| f.count());
        assert!(found.is_err(), "seed {seed}: {found:?}");
        // Nor in the light that is tried where a ball turns too little.
        let evidence = search.evidence(&ball);
        let found = evidence.and_then(|e| Ok(e.in_smooth_light()?.count()));
        assert!(found.is_err(), "seed {seed}, smooth light: {found:?}");
    }
}

#[test]
fn a_ball_that_hardly_turns_is_found_beside_one_that_makes_half_a_turn_a_frame() {
    // The search alone finds what half a turn a frame more would show as well.
    let rate = Vector3::new(0.0, 0.0, -24.0);
    for seed in [0, 1, 2, 4] {
        let views = views(Marks::Halves, 14.0, 10, rate, 0.0, seed);
        let search = search(14.0);
        let ball = search.sampled(&views).unwrap();
        let found = search.evidence(&ball).unwrap().candidates(f64::INFINITY).unwrap();
        let rates: Vec<f64> = found.fits.iter().map(|f| f.rate_rad_s.z).collect();
        assert!(
            rates.iter().any(|z| (z - rate.z).abs() < 5.0),
            "{seed}: {rates:?}"
        );
    }
}

#[test]
fn a_pattern_that_looks_alike_after_half_a_turn_has_rivals() {
    let rate = Vector3::new(0.0, 0.0, TAU * 30.0);
    let views = views(Marks::Pair, 14.0, 20, rate, 0.0, 3);
    let fits = rivals(&search(14.0), &views).unwrap();
    assert!(
        fits.len() > 1,
        "{:?}",
        fits.iter().map(|f| f.rate_rad_s).collect::<Vec<_>>()
    );
    assert!(
        fits.iter()
            .any(|f| (f.rate_rad_s - rate).norm() < 0.02 * rate.norm())
    );
}

#[test]
fn a_rate_near_half_a_turn_a_frame_has_the_other_way_round_as_rival() {
    let rate = Vector3::new(0.0, 0.0, TAU * 115.0);
    let views = views(Marks::Dots, 12.0, 20, rate, 0.0, 8);
    let fits = rivals(&search(12.0), &views).unwrap();
    assert_eq!(fits.len(), 2);
    assert!(
        fits.iter()
            .any(|f| (f.rate_rad_s.z - rate.z).abs() < 0.01 * rate.z)
    );
    assert!(fits.iter().any(|f| f.rate_rad_s.z < 0.0));
}

#[test]
fn rates_that_no_ball_of_its_speed_has_are_listed_and_no_more_unless_one_stands_alone() {
    let near = |found: f64, rate: f64| (found - rate).abs() < 0.01 * rate.abs();
    let up_to = |most_rad_s: f64| RotationSearch {
        limit: RateLimit {
            most_rad_s,
            ..ANY_RATE
        },
        ..search(12.0)
    };
    let rate = TAU * 115.0;
    let views_at = |rate: f64| views(Marks::Dots, 12.0, 20, Vector3::new(0.0, 0.0, rate), 0.0, 8);
    let other = rate - TAU / INTERVAL_S;
    // (The other way round is faster.)
    let one = suiting(&up_to(0.5 * (rate - other)), &views_at(rate)).unwrap();
    assert_eq!(one.count(), 2, "{one:?}");
    assert!(near(one.possible[0].rate_rad_s.z, rate));
    assert!(near(one.too_fast_rad_s[0].z, other));
    let none = suiting(&up_to(0.9 * rate), &views_at(rate)).unwrap();
    assert!(none.possible.is_empty());
    for rate in [rate, other] {
        assert!(
            none.too_fast_rad_s.iter().any(|found| near(found.z, rate)),
            "{none:?}"
        );
    }
    let slower = 0.5 * rate;
    let alone = suiting(&up_to(0.9 * slower), &views_at(slower)).unwrap();
    assert_eq!(alone.count(), 1, "{alone:?}");
    assert!(near(alone.possible[0].rate_rad_s.z, slower));
}

#[test]
fn a_ball_that_hardly_turns_needs_the_light_of_another_flight() {
    let turning = views(Marks::Dots, 12.0, 20, Vector3::new(10.0, 0.0, 110.0), 0.0, 2);
    let fits = rivals(&search(12.0), &turning).unwrap();
    let rate = Vector3::new(0.0, 0.0, 1.0);
    let still = views(Marks::Dots, 12.0, 20, rate, 0.0, 2);
    assert!(rivals(&search(12.0), &still).is_err());
    let lit = RotationSearch {
        light: Some(&fits[0].maps),
        ..search(12.0)
    };
    let fits = rivals(&lit, &still).unwrap();
    let (off, std) = in_plane(&fits[0], rate);
    assert!(
        off.abs() < 0.2 && off.abs() < 4.0 * std.max(0.02),
        "{off} ± {std}"
    );
}

#[test]
fn a_longer_flight_makes_the_rate_more_exact() {
    let rate = Vector3::new(0.0, 0.0, 90.0);
    let views = views(Marks::Dots, 9.0, 60, rate, 0.0, 21);
    let search = search(9.0);
    let few = &views[10..10 + SEARCH_FRAMES];
    let some = search.sampled(few).unwrap();
    let candidates = search.evidence(&some).unwrap().candidates(f64::INFINITY).unwrap();
    let few = rivals(&search, few).unwrap();
    let ball = search.sampled(&views).unwrap();
    let all = search
        .evidence(&ball)
        .unwrap()
        .by_all(&candidates)
        .unwrap()
        .possible;
    let ((off_few, std_few), (off, std)) = (in_plane(&few[0], rate), in_plane(&all[0], rate));
    assert!(off_few.abs() < 4.0 * std_few && off.abs() < 4.0 * std && std < 0.7 * std_few);
}

#[test]
fn three_pictures_are_too_few() {
    let views = views(Marks::Dots, 12.0, 3, Vector3::new(0.0, 0.0, 50.0), 0.0, 1);
    assert_eq!(rivals(&search(12.0), &views).err(), Some(NoRate::FewFrames));
}

#[test]
fn wherever_a_fit_begins_it_ends_at_the_same_rate() {
    // A quarter of a turn of two halves in a known light: turned about the halves' own axis they change little, and their map has to tell by how much.
    let radius_px = 19.0;
    let search = search(radius_px);
    let plain = search
        .sampled(&views(Marks::Plain, radius_px, 12, Vector3::zeros(), 0.0, 1))
        .unwrap();
    let (_, light) = fit::still(&plain.samples, &plain.grids);
    let truth = Vector3::new(17.0, -28.0, -4.0);
    let ball = search
        .sampled(&views(Marks::Halves, radius_px, 12, truth, 0.0, 2))
        .unwrap();
    let found = [-8.0, 0.0, 8.0].map(|off| {
        let start = truth + Vector3::new(off, off, off);
        fit::fit(&ball.samples, &ball.grids, &light, start, true).unwrap()
    });
    for one in &found {
        let off = one.rate_rad_s - found[1].rate_rad_s;
        let std = one.covariance.diagonal().map(f64::sqrt);
        assert!(off.component_div(&std).amax() < 1.0, "{off:?} of {std:?}");
        let off = one.rate_rad_s - truth;
        assert!(off.norm() < 2.5, "{off:?}");
    }
}

#[test]
fn maps_take_as_much_of_noise_as_they_say() {
    let radius_px = 15.0;
    for (frames, rate) in [(30, 40.0), (8, 40.0), (8, 2.0)] {
        let views = views(
            Marks::Dots,
            radius_px,
            frames,
            rate * Vector3::new(0.2, -0.6, 0.77),
            0.0,
            3,
        );
        let ball = search(radius_px).sampled(&views).unwrap();
        let (samples, grids) = (&ball.samples, &ball.grids);
        let turned = fit::turned(samples, grids.grid, &(rate * Vector3::new(0.2, -0.6, 0.77)));
        let seen = fit::weights_of(&turned.cells, grids.grid.nodes(), grids.grid.side());
        let problem = grids.map_problem(samples, &turned, &seen, false, fit::EXACT);
        let mut noise = TestNoise(4);
        let pixels: Vec<f32> = samples.values.iter().map(|_| noise.normal() as f32).collect();
        let mut left = pixels.clone();
        problem.solve(&mut left, &vec![0.0; grids.grid.nodes()]);
        let dot = |a: &[f32]| f64::from(sum_of_products(a, &pixels));
        let others = dot(&left) / dot(&pixels);
        assert!(
            (others - problem.others_part()).abs() < 0.1,
            "{others} {}",
            problem.others_part()
        );
    }
}
