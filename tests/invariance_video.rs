//! What must not change a measurement: where in the picture and when it happens, the unit of length, the camera's turn,
//! frames stored twice. (Mirrored clips: `leftward_is_as_good_as_rightward` in `truth.rs`.)
//!
//! Each tolerance is in standard uncertainties of the numbers compared, with where it comes from.

use crate::hard::{self, Clip, HONEST_SIGMAS, scene};
use std::sync::OnceLock;
use track::calibration::{MetresPerPixel, Scale};
use track::frames::Luma;
use track::geometry::PixelPoint;
use track::pipeline::Measurement;
use track::quantity::Quantity;

fn usual() -> Clip {
    static CLIP: OnceLock<Clip> = OnceLock::new();
    CLIP.get_or_init(|| Clip::of(&scene(900))).clone()
}

fn of_usual() -> &'static Measurement {
    static MEASURED: OnceLock<Measurement> = OnceLock::new();
    MEASURED.get_or_init(|| usual().measured().found.unwrap())
}

/// Dimensions of a number: powers of length and time.
type Dimension = (i32, i32);

/// All numbers of a measurement by name, with their dimensions.
fn numbers(m: &Measurement) -> Vec<(String, Quantity, Dimension)> {
    let mut all = Vec::new();
    let mut add = |name: String, q: Option<Quantity>, dimension| {
        all.extend(q.map(|q| (name, q, dimension)));
    };
    add("gravity".into(), m.gravity_m_s2, (1, -2));
    add("x0".into(), m.distances.x0_m, (1, 0));
    add("x".into(), m.distances.x_m, (1, 0));
    for (i, b) in m.bounces.iter().enumerate() {
        add(format!("time {i}"), b.time_s, (0, 1));
        add(format!("place {i}"), b.x_m, (1, 0));
        add(format!("e {i}"), b.restitution, (0, 0));
        add(format!("friction {i}"), b.friction, (0, 0));
        add(format!("ratio {i}"), b.tangential_ratio, (0, 0));
        add(format!("e_x {i}"), b.tangential_restitution, (0, 0));
        add(format!("spin in {i}"), b.spin_in_m_s, (1, -1));
        add(format!("spin out {i}"), b.spin_out_m_s, (1, -1));
        for (leg, name) in [(b.incident, "incident"), (b.rebound, "rebound")] {
            add(format!("{name} vx {i}"), leg.vx_m_s, (1, -1));
            add(format!("{name} vz {i}"), leg.vz_m_s, (1, -1));
            add(format!("{name} angle {i}"), leg.angle_rad, (0, 0));
        }
    }
    all
}

/// That both have the same numbers, to `sigmas` of the first one's uncertainties; `factor` is what lengths of the second
/// are multiplied by.
fn assert_same(a: &Measurement, b: &Measurement, factor: f64, sigmas: f64) {
    let (left, right) = (numbers(a), numbers(b));
    let names = |all: &[(String, Quantity, Dimension)]| all.iter().map(|n| n.0.clone()).collect::<Vec<_>>();
    assert!(left.len() > 20 && a.bounces.len() == 2);
    assert_eq!(names(&left), names(&right));
    for ((name, p, (length, _)), (_, q, _)) in left.iter().zip(&right) {
        let unit = factor.powi(*length);
        let std = p.std_uncertainty.unwrap_or(1e-9 * p.value.abs() + 1e-12);
        let off = (q.value / unit - p.value) / std;
        assert!(
            off.abs() <= sigmas,
            "{name}: {p:?} and {q:?}, {off} standard uncertainties apart"
        );
        if let Some(other) = q.std_uncertainty {
            let ratio = other / unit / std;
            assert!(
                (ratio - 1.0).abs() <= 0.1 + sigmas,
                "{name}: uncertainties {std} and {other}"
            );
        }
    }
}

/// The clip with each picture redrawn as `picture` has it, and calibration pixels moved by `place`.
fn redrawn(clip: &Clip, picture: impl Fn(&Luma) -> Luma, place: impl Fn(PixelPoint) -> PixelPoint) -> Clip {
    let mut other = clip.clone();
    other.frames = clip.frames.iter().map(picture).collect();
    let (width, height) = (other.frames[0].width, other.frames[0].height);
    other.calibration.image_size_px = other.calibration.image_size_px.map(|_| (width, height));
    other.calibration.origin_px = clip.calibration.origin_px.map(place);
    other
}

/// Rows and columns of noise-free wall around a picture.
fn padded(luma: &Luma, left: usize, top: usize) -> Luma {
    let (width, height) = (luma.width + left, luma.height + top);
    let mut data = vec![60; width * height];
    for v in 0..luma.height {
        let at = (v + top) * width + left;
        data[at..at + luma.width].copy_from_slice(luma.row(v));
    }
    Luma { width, height, data }
}

#[test]
fn a_shift_of_the_picture_shifts_nothing_else() {
    // The ball's pixels are the same, but blocks (2 px), the pixels that follow the light and the noise of the whole are
    // others: brightness is followed to 1e-4 of the contrast, an edge's place to 1e-4 of its width, far below a tenth of a
    // centre's uncertainty (0.02 px); points at the verge of being set aside may be another.
    for (left, top) in [(16, 8), (7, 3)] {
        let shifted = redrawn(
            &usual(),
            |f| padded(f, left, top),
            |p| PixelPoint::new(p.u_px + left as f64, p.v_px + top as f64),
        );
        assert_same(of_usual(), &shifted.measured().found.unwrap(), 1.0, 0.5);
    }
}

#[test]
fn a_shift_in_time_shifts_nothing_else() {
    // Stamps are whole microseconds, and counted from the first: the same numbers.
    let clip = usual();
    let stamps = |start_s: f64| -> Vec<f64> {
        clip.times_s
            .iter()
            .map(|t| start_s + (t * 1e6).round() / 1e6)
            .collect()
    };
    let (now, later) = (clip.stamped(&stamps(0.0)), clip.stamped(&stamps(1e6)));
    assert_same(&now.found.unwrap(), &later.found.unwrap(), 1.0, 1e-3);
}

#[test]
fn metres_and_millimetres_are_the_same() {
    // Air and contact know the metre by the ball's mass, so it is left out; all else is a ratio, good to rounding (1e-9 of
    // a number is some 1e-5 of its uncertainty).
    let mut metres = usual();
    metres.calibration.ball.mass_kg = None;
    let mut millimetres = metres.clone();
    let calibration = &mut millimetres.calibration;
    let Scale::MetresPerPixel(MetresPerPixel { value, std }) = &calibration.scale else {
        panic!("{:?}", calibration.scale)
    };
    calibration.scale = Scale::MetresPerPixel(MetresPerPixel {
        value: 1e3 * value,
        std: std.map(|s| 1e3 * s),
    });
    calibration.gravity_m_s2 *= 1e3;
    calibration.ball.radius_m = calibration.ball.radius_m.map(|r| 1e3 * r);
    let (a, b) = (
        metres.measured().found.unwrap(),
        millimetres.measured().found.unwrap(),
    );
    assert_same(&a, &b, 1e3, 1e-3);
}

#[test]
fn a_camera_on_its_side_sees_the_same() {
    // A quarter turn moves whole pixels: only the order of sums and of thinned-out pixels changes, which picks other
    // pixels of large outlines; a ball of 8 px has all of them.
    let mut turned = redrawn(
        &usual(),
        |f| Luma::from_fn(f.height, f.width, |u, v| f.data[(f.height - 1 - u) * f.width + v]),
        |p| PixelPoint::new(239.0 - p.v_px, p.u_px),
    );
    turned.calibration.up_px = [1.0, 0.0];
    // Rows that may have times of their own are those of the camera, and lie otherwise across the flight.
    let mut upright = usual();
    for clip in [&mut upright, &mut turned] {
        clip.calibration.readout_s = Some(0.0);
    }
    let [upright, turned] = [upright, turned].map(|clip| clip.measured().found.unwrap());
    assert_same(&upright, &turned, 1.0, 0.5);
}

#[test]
fn a_tilted_camera_sees_the_same() {
    // Resampling mixes the noise of four pixels anew, so the errors are partly others: the difference of two numbers that
    // are each off by their uncertainty stays within four of both together. It also blurs the edge, which the ball's
    // appearance learns.
    let angle = 10_f64.to_radians();
    let (sin, cos) = angle.sin_cos();
    let (middle_u, middle_v) = (159.5, 119.5);
    let turn = |p: PixelPoint| {
        let (x, y) = (p.u_px - middle_u, p.v_px - middle_v);
        PixelPoint::new(199.5 + cos * x - sin * y, 159.5 + sin * x + cos * y)
    };
    let mut tilted = redrawn(
        &usual(),
        |f| {
            let back = |u: f64, v: f64| {
                let (x, y) = (u - 199.5, v - 159.5);
                (middle_u + cos * x + sin * y, middle_v - sin * x + cos * y)
            };
            Luma::from_fn(400, 320, |u, v| {
                let (u, v) = back(u as f64, v as f64);
                hard::bilinear(f, u, v).unwrap_or(60.0).round() as u8
            })
        },
        turn,
    );
    tilted.calibration.up_px = [sin, -cos];
    let found = tilted.measured();
    let lies = found.lies(HONEST_SIGMAS);
    assert!(lies.is_empty(), "{lies:#?}");
    for ((name, p, _), (other, q, _)) in numbers(of_usual())
        .iter()
        .zip(numbers(found.found.as_ref().unwrap()))
    {
        assert_eq!(*name, other);
        let both = p
            .std_uncertainty
            .unwrap_or(0.0)
            .hypot(q.std_uncertainty.unwrap_or(0.0));
        assert!(
            (p.value - q.value).abs() <= HONEST_SIGMAS * both + 1e-12,
            "{name}: {p:?} and {q:?}"
        );
    }
}

#[test]
fn frames_stored_twice_tell_nothing_more() {
    // The same pictures count, but the empty scene is the median of fifteen others: where it differs, it does by the noise
    // of a median, a third of a pixel's, behind the outline's pixels; their mean moves a centre by a part of its own
    // uncertainty, and 120 of them average to less.
    let mut doubled = usual();
    doubled.frames = doubled
        .frames
        .iter()
        .flat_map(|f| [f.clone(), f.clone()])
        .collect();
    doubled.rate_hz *= 2.0;
    assert_same(of_usual(), &doubled.measured().found.unwrap(), 1.0, 1.0);
}
