//! Impacts at the limits of what a bounce can be: what the models make of them (first part), and what the numeric layer reads
//! off flights with such an impact (second part). The right value within its uncertainty, or nothing; never a number that is
//! not one. The symmetries of the models are in `models.rs`, their digits in `exact.rs`.

use crate::flown::{self, Film, Measured, quantities, sound, truths};
use crate::noise::Noise;
use nalgebra::Vector3;
use track::flight::linking::Spot;
use track::geometry::PixelPoint;
use track::impact::{Bounce, BounceSurface};
use track::quantity::Quantity;
use track::rebound::{ModelName, Regime, RigidMotion, SOLID_SPHERE, THIN_SHELL, e_e, grip_slide, mu_e};

fn moving(vx: f64, vz: f64, spin: f64) -> RigidMotion {
    RigidMotion {
        velocity_m_s: Vector3::new(vx, 0.0, vz),
        surface_spin_m_s: Vector3::new(0.0, spin, 0.0),
    }
}

/// A ball that comes at `angle_deg` with 1.5 m/s downwards, but no faster along the floor than `fastest_m_s`.
fn coming(angle_deg: f64, spin_ratio: f64, fastest_m_s: f64) -> RigidMotion {
    let tangent = angle_deg.to_radians().tan();
    let down = (fastest_m_s / tangent).min(1.5);
    moving(down * tangent, -down, spin_ratio * down * tangent)
}

const fn mu_e(restitution: f64, friction: f64, static_friction: f64) -> mu_e::Parameters {
    mu_e::Parameters {
        restitution,
        friction,
        static_friction,
    }
}

const fn e_e(restitution: f64, e_x: f64) -> e_e::Parameters {
    e_e::Parameters {
        restitution,
        tangential_restitution_x: e_x,
        tangential_restitution_y: e_x,
    }
}

const fn grip_slide(restitution: f64, e_x: f64, friction: f64) -> grip_slide::Parameters {
    grip_slide::Parameters {
        restitution,
        tangential_restitution_x: e_x,
        friction,
    }
}

fn finite(m: &RigidMotion, what: &str) {
    let all = m.velocity_m_s.iter().chain(&m.surface_spin_m_s);
    assert!(all.clone().all(|x| x.is_finite()), "{what}: {m:?}");
}

/// The next number up or down: one unit in the last place.
fn beside(x: f64) -> [f64; 2] {
    [x.next_down(), x.next_up()]
}

// ---------------------------------------------------------------------------------------------------------------- models

const ANGLES_DEG: [f64; 20] = [
    0.0, 1e-300, 1e-12, 1e-6, 1e-3, 0.1, 1.0, 5.0, 15.0, 30.0, 45.0, 60.0, 75.0, 85.0, 88.0, 89.0, 89.5,
    89.9, 89.999, 89.999_999,
];

#[test]
fn incidence_from_vertical_to_grazing_in_every_model() {
    for angle in ANGLES_DEG {
        for spin in [-2.5, -0.21, 0.0, 1.0, 1.6] {
            let before = coming(angle, spin, 1e9);
            let what = format!("{angle} degrees, spin {spin}");
            for (after, e) in [
                (
                    mu_e::impact(&before, &mu_e(0.78, 0.07, 0.1), SOLID_SPHERE).0,
                    0.78,
                ),
                (e_e::impact(&before, &e_e(0.9, 0.5), SOLID_SPHERE).0, 0.9),
                (
                    grip_slide::impact(&before, &grip_slide(0.96, 0.5, 0.9), SOLID_SPHERE).0,
                    0.96,
                ),
            ] {
                finite(&after, &what);
                assert_eq!(
                    after.velocity_m_s.z,
                    e * 1.5_f64.min(-before.velocity_m_s.z),
                    "{what}"
                );
                // Friction takes no more than its limit, and no energy comes from nowhere.
                assert!(
                    after.energy_j_kg(SOLID_SPHERE) <= before.energy_j_kg(SOLID_SPHERE) * (1.0 + 1e-12),
                    "{what}"
                );
            }
        }
    }
}

#[test]
fn a_ball_sideways_at_rest_stays_so() {
    let before = moving(0.0, -2.0, 0.0);
    for after in [
        mu_e::impact(&before, &mu_e(0.5, 0.3, 0.3), SOLID_SPHERE),
        e_e::impact(&before, &e_e(0.5, 0.4), SOLID_SPHERE),
        grip_slide::impact(&before, &grip_slide(0.5, 0.4, 0.3), SOLID_SPHERE),
    ] {
        assert_eq!(after.0, moving(0.0, 1.0, 0.0));
        assert_ne!(after.1, Regime::Sliding);
    }
}

#[test]
fn spin_turns_a_vertical_fall_into_a_rebound_to_the_side() {
    // Grip: v_x = s w; sliding: v_x = μ (1 + e) |v_oz|, whichever way it spins.
    for sign in [1.0, -1.0] {
        let (rolls, regime) =
            mu_e::impact(&moving(0.0, -2.0, sign * 0.7), &mu_e(0.5, 0.3, 0.3), SOLID_SPHERE);
        assert_eq!(regime, Regime::Nonsliding);
        assert!((rolls.velocity_m_s.x - sign * 0.2).abs() < 1e-15, "{rolls:?}");
        let (slides, regime) = mu_e::impact(
            &moving(0.0, -2.0, sign * 50.0),
            &mu_e(0.5, 0.3, 0.3),
            SOLID_SPHERE,
        );
        assert_eq!(regime, Regime::Sliding);
        assert!((slides.velocity_m_s.x - sign * 0.9).abs() < 1e-15, "{slides:?}");
    }
}

#[test]
fn rebounds_straight_up_and_backwards() {
    // [19] with e_x = 0: v_x = (5 + 2 ρ)/7 v_ox, straight up for ρ = −5/2.
    for (spin, expected) in [(-2.5, 0.0), (-3.0, -1.0 / 7.0), (-6.0, -1.0)] {
        let (after, regime) = mu_e::impact(&moving(1.0, -3.0, spin), &mu_e(0.9, 2.0, 2.0), SOLID_SPHERE);
        assert_eq!(regime, Regime::Nonsliding);
        assert!((after.velocity_m_s.x - expected).abs() < 1e-15);
        assert!((after.angle_rad() - expected.atan2(2.7)).abs() < 1e-15);
        let tangent = mu_e::nonsliding_rebound_tangent(0.9, 1.0 / 3.0, spin, SOLID_SPHERE).unwrap();
        assert!((tangent - expected / 2.7).abs() < 1e-15);
    }
}

#[test]
fn rolling_exactly_and_within_1e_12_of_it() {
    let p = mu_e(0.78, 0.07, 0.07);
    for ratio in [
        1.0,
        1.0 + 1e-12,
        1.0 - 1e-12,
        1.0_f64.next_up(),
        1.0_f64.next_down(),
    ] {
        let before = moving(1.0, -2.0, ratio);
        for (after, regime) in [
            mu_e::impact(&before, &p, SOLID_SPHERE),
            e_e::impact(&before, &e_e(0.78, 0.5), SOLID_SPHERE),
            grip_slide::impact(&before, &grip_slide(0.78, 0.5, 0.07), SOLID_SPHERE),
        ] {
            assert_ne!(regime, Regime::Sliding, "{ratio}");
            // No more changes than there is slip, up to a unit in the last place of 1.
            let slip = (1.0 - ratio).abs();
            assert!(
                (after.velocity_m_s.x - 1.0).abs() <= slip + f64::EPSILON,
                "{ratio}: {after:?}"
            );
            assert!(
                (after.surface_spin_m_s.y - ratio).abs() <= 2.0 * slip + f64::EPSILON,
                "{ratio}: {after:?}"
            );
        }
        let angle = mu_e::transition_angle_rad(&p, ratio, SOLID_SPHERE);
        let short = std::f64::consts::FRAC_PI_2 - angle;
        // cot θ_L = s |1 − ρ| / (μ_o (1 + e)): 2.3 times the slip.
        assert!(
            (0.0..=3.0 * (1.0 - ratio).abs() + 1e-16).contains(&short),
            "{ratio}: {angle}"
        );
    }
}

#[test]
fn friction_turns_round_with_the_slip() {
    let p = mu_e(0.78, 0.07, 0.07);
    for off in [1e-9, 0.01, 0.5, 3.0] {
        let [slower, faster] = [1.0 - off, 1.0 + off]
            .map(|ratio| mu_e::impact(&moving(2.0, -1.0, 2.0 * ratio), &p, SOLID_SPHERE))
            .map(|(after, regime)| (after.velocity_m_s.x - 2.0, regime));
        assert_eq!(slower.1, faster.1, "{off}");
        assert!(slower.0 < 0.0 && faster.0 > 0.0, "{off}");
        assert!(
            (slower.0 + faster.0).abs() <= 4.0 * f64::EPSILON,
            "{off}: {slower:?} {faster:?}"
        );
    }
    // Sliding keeps the slip's direction, grip turns it, and e_x = 0 ends it.
    for (e_x, expected) in [(-0.5, 0.5), (0.0, 0.0), (0.5, -0.5)] {
        let after = e_e::impact(&moving(1.0, -1.0, 0.0), &e_e(0.9, e_x), SOLID_SPHERE).0;
        assert!((after.slip_m_s().x - expected).abs() < 1e-15, "{e_x}");
    }
}

#[test]
fn restitution_from_0_to_1() {
    for e in [0.0, 5e-324, 1e-300, 1e-12, 0.5, 1.0_f64.next_down(), 1.0] {
        for before in [
            moving(1.0, -2.0, 0.0),
            moving(0.0, -2.0, 0.0),
            moving(1.0, -2.0, 1.0),
        ] {
            for (after, _) in [
                mu_e::impact(&before, &mu_e(e, 0.07, 0.07), SOLID_SPHERE),
                e_e::impact(&before, &e_e(e, 0.5), SOLID_SPHERE),
                grip_slide::impact(&before, &grip_slide(e, 0.5, 0.07), SOLID_SPHERE),
            ] {
                finite(&after, "restitution");
                assert_eq!(after.velocity_m_s.z, 2.0 * e);
            }
        }
        for tangent in [0.0, 0.14, 0.5, 1e6] {
            let all = [
                mu_e::sliding_rebound_tangent(&mu_e(e, 0.07, 0.07), tangent, 0.0),
                mu_e::nonsliding_rebound_tangent(e, tangent, 0.0, SOLID_SPHERE),
                e_e::rebound_tangent(&e_e(e, 0.5), tangent, 0.0, SOLID_SPHERE),
            ];
            for found in all {
                assert!(found.is_none_or(f64::is_finite), "{e}: {found:?}");
                // A ball that stays down leaves at no angle.
                assert!(found.is_none() || e > 0.0, "{e}");
                assert!(found.is_some() || e < 1e-300, "{e}");
            }
        }
    }
}

#[test]
fn friction_from_none_at_all() {
    let before = moving(1.0, -2.0, -0.5);
    for (p, slides) in [
        (mu_e(0.8, 0.0, 0.0), true),
        (mu_e(0.8, 0.0, 0.01), true),
        (mu_e(0.8, 0.0, 9.0), false),
    ] {
        let (after, regime) = mu_e::impact(&before, &p, SOLID_SPHERE);
        assert_eq!(regime == Regime::Sliding, slides);
        if slides {
            assert_eq!(after.velocity_m_s.x, 1.0);
            assert_eq!(after.surface_spin_m_s, before.surface_spin_m_s);
        }
    }
    let p = grip_slide(0.8, 0.3, 0.0);
    assert_eq!(
        grip_slide::impact(&before, &p, SOLID_SPHERE).0.velocity_m_s.x,
        1.0
    );
    assert_eq!(
        mu_e::transition_angle_rad(&mu_e(0.8, 0.0, 0.0), 0.0, SOLID_SPHERE),
        0.0
    );
    assert_eq!(grip_slide::transition_angle_rad(&p, 0.0, SOLID_SPHERE), 0.0);
}

#[test]
fn exactly_at_the_transition_and_one_ulp_beside_it() {
    // k = 1 and round numbers, so that s |c| = μ_o (1 + e)|v_oz| holds to the bit: 0.5 · 1.5 = 0.25 · 1.5 · 2.
    let (k, at) = (1.0, 1.5);
    let [below, above] = beside(at);
    let run = |friction, vx| mu_e::impact(&moving(vx, -2.0, 0.0), &mu_e(0.5, friction, 0.25), k);
    for friction in [0.25, 0.2] {
        let jump = (0.25 - friction) * 1.5 * 2.0;
        assert_eq!(run(friction, at).1, Regime::Nonsliding, "{friction}");
        assert_eq!(run(friction, below).1, Regime::Nonsliding, "{friction}");
        assert_eq!(run(friction, above).1, Regime::Sliding, "{friction}");
        // With μ_o = μ the outcome is continuous; with more it jumps by the difference of the two, no more.
        let step = run(friction, above).0.velocity_m_s.x - run(friction, at).0.velocity_m_s.x;
        assert!((step - jump).abs() <= 2.0 * f64::EPSILON, "{friction}: {step}");
        let step = run(friction, at).0.velocity_m_s.x - run(friction, below).0.velocity_m_s.x;
        assert!(step.abs() <= 2.0 * f64::EPSILON, "{friction}: {step}");
    }
    // The angle that the closed form gives is where the outcome changes, to rounding.
    for (e, mu, ratio) in [
        (0.78, 0.07, 0.0),
        (0.52, 0.15, -0.21),
        (0.9, 0.12, 1.6),
        (0.96, 1.0, 0.999),
    ] {
        let p = mu_e(e, mu, mu);
        let angle = mu_e::transition_angle_rad(&p, ratio, SOLID_SPHERE);
        // 8 ulp for the angle's own rounding, the tangent's condition number 1/(sin θ cos θ) on top.
        let reach = 8.0 * f64::EPSILON / (angle.sin() * angle.cos());
        let regime = |factor: f64| {
            let tangent = angle.tan() * factor;
            mu_e::impact(&moving(tangent, -1.0, ratio * tangent), &p, SOLID_SPHERE).1
        };
        assert_eq!(regime(1.0 - reach), Regime::Nonsliding);
        assert_eq!(regime(1.0 + reach), Regime::Sliding);
    }
}

#[test]
fn tangential_restitution_from_minus_1_to_1() {
    let before = moving(1.0, -2.0, -0.3);
    let mut last: Option<RigidMotion> = None;
    for i in 0..=200 {
        let e_x = -1.0 + 0.01 * f64::from(i);
        let (after, regime) = e_e::impact(&before, &e_e(0.9, e_x), SOLID_SPHERE);
        finite(&after, "e_x");
        assert_eq!(regime, e_e::regime(e_x));
        if let Some(last) = last {
            // v_x changes by s |c| a unit of e_x, everywhere: no step where the regime changes.
            let step = (last.velocity_m_s.x - after.velocity_m_s.x) / 0.01;
            assert!((step - 2.0 / 7.0 * 1.3).abs() < 1e-12, "{e_x}: {step}");
        }
        last = Some(after);
    }
    let free = e_e::impact(&before, &e_e(0.9, -1.0), SOLID_SPHERE).0;
    assert_eq!(
        (free.velocity_m_s.x, free.surface_spin_m_s),
        (1.0, before.surface_spin_m_s)
    );
    for e_x in beside(0.0) {
        assert_ne!(e_e::regime(e_x), Regime::Nonsliding);
    }
    // Slip that stays as it is never meets the limit of friction.
    assert_eq!(
        e_e::grip_limit_angle_rad(0.9, -1.0, 0.1, 0.0, SOLID_SPHERE),
        std::f64::consts::FRAC_PI_2
    );
}

#[test]
fn inertia_from_a_point_to_a_shell() {
    let before = moving(1.0, -2.0, -0.4);
    for (name, run) in [
        (
            "mu_e",
            (|m, k| mu_e::impact(m, &mu_e(0.8, 0.05, 0.05), k).0) as fn(&RigidMotion, f64) -> RigidMotion,
        ),
        ("e_e", |m, k| e_e::impact(m, &e_e(0.8, 0.3), k).0),
        ("grip_slide", |m, k| {
            grip_slide::impact(m, &grip_slide(0.8, 0.3, 0.05), k).0
        }),
    ] {
        for k in [0.0, 5e-324, 1e-300, 1e-12, 0.01, SOLID_SPHERE, THIN_SHELL] {
            let after = run(&before, k);
            finite(&after, name);
            let kept = |m: &RigidMotion| m.velocity_m_s.x + k * m.surface_spin_m_s.y;
            assert!((kept(&after) - kept(&before)).abs() < 1e-15, "{name} {k}");
        }
        // All mass in the middle: spin follows the floor at no cost, as it does in the limit.
        let (none, little) = (run(&before, 0.0), run(&before, 1e-13));
        assert_eq!(none.velocity_m_s.x, 1.0, "{name}");
        assert!(
            (none.surface_spin_m_s - little.surface_spin_m_s).norm() < 1e-12,
            "{name}"
        );
        assert!(none.surface_spin_m_s.y >= 1.0, "{name}: {none:?}");
    }
    for angle in [
        mu_e::transition_angle_rad(&mu_e(0.8, 0.0, 0.0), 0.0, 0.0),
        mu_e::transition_angle_rad(&mu_e(0.8, 0.1, 0.1), 0.0, 0.0),
    ] {
        assert_eq!(angle, std::f64::consts::FRAC_PI_2);
    }
}

#[test]
fn to_the_left_is_to_the_right_mirrored_to_the_bit() {
    let mirrored = |m: &RigidMotion| moving(-m.velocity_m_s.x, m.velocity_m_s.z, -m.surface_spin_m_s.y);
    for angle in ANGLES_DEG {
        for spin in [-1.0, 0.0, 0.3, 1.6] {
            let before = coming(angle, spin, 1e9);
            for run in [
                (|m| mu_e::impact(m, &mu_e(0.78, 0.07, 0.1), SOLID_SPHERE).0)
                    as fn(&RigidMotion) -> RigidMotion,
                |m| e_e::impact(m, &e_e(0.9, 0.5), SOLID_SPHERE).0,
                |m| grip_slide::impact(m, &grip_slide(0.96, 0.5, 0.9), SOLID_SPHERE).0,
            ] {
                assert_eq!(run(&mirrored(&before)), mirrored(&run(&before)), "{angle} {spin}");
            }
        }
    }
}

#[test]
fn speeds_beyond_any_laboratory_do_not_overflow_on_the_way() {
    for size in [1e-300, 1e-160, 1.0, 1e160, 1e300] {
        let before = moving(size, -2.0 * size, 0.0);
        for (after, expected) in [
            (mu_e::impact(&before, &mu_e(0.5, 0.05, 0.05), SOLID_SPHERE), 0.85),
            (
                mu_e::impact(&before, &mu_e(0.5, 9.0, 9.0), SOLID_SPHERE),
                5.0 / 7.0,
            ),
            (
                grip_slide::impact(&before, &grip_slide(0.5, 0.5, 0.05), SOLID_SPHERE),
                0.85,
            ),
            (e_e::impact(&before, &e_e(0.5, 0.5), SOLID_SPHERE), 4.0 / 7.0),
        ] {
            let ratio = after.0.velocity_m_s.x / size;
            assert!(
                (ratio - expected).abs() < 1e-15,
                "{size}: {ratio}, not {expected}"
            );
        }
    }
}

// ----------------------------------------------------------------------------------------------- read off flights

/// What friction does in a flight.
#[derive(Debug, Clone, Copy)]
enum Law {
    MuE(f64, f64),
    EE(f64, f64),
}

impl Law {
    fn after(self, before: &RigidMotion, k: f64) -> RigidMotion {
        match self {
            Self::MuE(e, mu) => mu_e::impact(before, &mu_e(e, mu, mu), k).0,
            Self::EE(e, e_x) => e_e::impact(before, &e_e(e, e_x), k).0,
        }
    }
}

/// A hard impact on film, and what is right to say of it.
struct Case {
    name: &'static str,
    before: RigidMotion,
    law: Law,
    inertia_factor: f64,
    /// What the models' readings may say.
    mu_e: &'static [Option<Regime>],
    e_e: &'static [Option<Regime>],
    /// Quantities that must be null.
    null: &'static [&'static str],
}

const STEEL: Law = Law::MuE(0.78, 0.07);
const UNDETERMINED: (&[Option<Regime>], &[Option<Regime>]) = (&[None], &[None]);
const SLIDING: (&[Option<Regime>], &[Option<Regime>]) = (&[Some(Regime::Sliding)], &[Some(Regime::Ordinary)]);
const ROLLING: (&[Option<Regime>], &[Option<Regime>]) =
    (&[Some(Regime::Nonsliding)], &[Some(Regime::Nonsliding)]);
const GRIPS: (&[Option<Regime>], &[Option<Regime>]) = (&[None], &[Some(Regime::Grip)]);

fn case(
    name: &'static str,
    (before, law): (RigidMotion, Law),
    (mu_e, e_e): (&'static [Option<Regime>], &'static [Option<Regime>]),
    null: &'static [&'static str],
) -> Case {
    Case {
        name,
        before,
        law,
        inertia_factor: SOLID_SPHERE,
        mu_e,
        e_e,
        null,
    }
}

fn cases() -> Vec<Case> {
    let at = |angle, spin, law| (coming(angle, spin, 12.0), law);
    // s |c| = μ (1 + e) |v_oz| for STEEL at 1.5 m/s.
    let transition = 3.5 * 0.07 * 1.78;
    let beside = |factor: f64| (moving(1.5 * transition * factor, -1.5, 0.0), STEEL);
    let thin = |k: f64, c: Case| Case {
        inertia_factor: k,
        ..c
    };
    vec![
        // Straight down there is no slip, and noise over noise is no e_x.
        case(
            "straight down",
            at(0.0, 0.0, STEEL),
            UNDETERMINED,
            &["tangential ratio", "tangential restitution"],
        ),
        case(
            "a thousandth of a degree",
            at(1e-3, 0.0, STEEL),
            UNDETERMINED,
            &["tangential ratio", "tangential restitution"],
        ),
        case("steep", at(3.0, 0.0, STEEL), ROLLING, &[]),
        case("sliding", at(45.0, 0.0, STEEL), SLIDING, &[]),
        case("70 degrees", at(70.0, 0.0, STEEL), SLIDING, &[]),
        case("85 degrees", at(85.0, 0.0, STEEL), SLIDING, &[]),
        case("88 degrees", at(88.0, 0.0, STEEL), SLIDING, &[]),
        case("89.5 degrees", at(89.5, 0.0, STEEL), SLIDING, &[]),
        case("89.9 degrees", at(89.9, 0.0, STEEL), SLIDING, &[]),
        case("straight up", at(20.0, -2.5, Law::EE(0.8, 0.0)), ROLLING, &[]),
        case("backwards", at(20.0, -4.0, Law::EE(0.8, 0.0)), ROLLING, &[]),
        case(
            "backwards, slipping",
            at(10.0, -6.0, Law::MuE(0.8, 0.12)),
            SLIDING,
            &[],
        ),
        case(
            "rolling already",
            at(30.0, 1.0, STEEL),
            UNDETERMINED,
            &["tangential restitution"],
        ),
        case(
            "rolling to 1e-12",
            at(30.0, 1.0 + 1e-12, STEEL),
            UNDETERMINED,
            &["tangential restitution"],
        ),
        case("slip backwards", at(45.0, 1.6, STEEL), SLIDING, &[]),
        // What leaves has 1.6 times the kinetic energy of what came, from its spin.
        case("topspin that grips", at(20.0, 6.0, Law::EE(0.8, 0.4)), GRIPS, &[]),
        case(
            "topspin that slips",
            at(20.0, 8.0, Law::MuE(0.8, 0.3)),
            SLIDING,
            &[],
        ),
        case("slip forwards", at(45.0, 0.4, STEEL), SLIDING, &[]),
        case("at the transition", beside(1.0), ROLLING, &[]),
        case("an ulp below it", beside(1.0 - f64::EPSILON), ROLLING, &[]),
        case("an ulp above it", beside(1.0 + f64::EPSILON), ROLLING, &[]),
        case("no friction", at(30.0, 0.0, Law::MuE(0.8, 0.0)), SLIDING, &[]),
        case("e_x = -1", at(30.0, 0.5, Law::EE(0.8, -1.0)), SLIDING, &[]),
        case("e_x = 1", at(30.0, 0.0, Law::EE(0.95, 1.0)), GRIPS, &[]),
        case("elastic", at(30.0, 0.0, Law::MuE(1.0, 0.05)), SLIDING, &[]),
        case(
            "hardly elastic",
            at(20.0, 0.0, Law::MuE(0.25, 0.05)),
            SLIDING,
            &[],
        ),
        thin(
            THIN_SHELL,
            case("a thin shell", at(45.0, 0.0, STEEL), SLIDING, &[]),
        ),
        thin(
            1e-3,
            case(
                "nearly all mass in the middle",
                at(45.0, 0.0, STEEL),
                ROLLING,
                &[],
            ),
        ),
    ]
}

fn film_of(c: &Case) -> Film {
    let v = c.before.velocity_m_s;
    let after = c.law.after(&c.before, c.inertia_factor);
    let ratio = if v.x == 0.0 {
        0.0
    } else {
        c.before.surface_spin_m_s.y / v.x
    };
    Film {
        inertia_factor: c.inertia_factor,
        ..Film::new(c.before, after, Some(ratio))
    }
}

/// Sums of squared deviations in units of their uncertainty.
#[derive(Default)]
struct Pulls(Vec<(&'static str, f64, f64)>);

impl Pulls {
    fn add(&mut self, film: &Film, bounce: &Bounce) {
        for ((name, q), (_, truth)) in quantities(bounce).into_iter().zip(truths(film)) {
            let (Some(q), Some(truth)) = (q, truth) else {
                continue;
            };
            let Some(std) = q.std_uncertainty else { continue };
            let square = ((q.value - truth) / std).powi(2);
            match self.0.iter_mut().find(|p| p.0 == name) {
                Some(p) => (p.1, p.2) = (p.1 + square, p.2 + 1.0),
                None => self.0.push((name, square, 1.0)),
            }
        }
    }

    /// χ² of n deviations above this has a probability of 1e-6 (Wilson and Hilferty): uncertainties that mean what they say
    /// pass, those that are too small by a third do not (n = 12).
    fn hold(&self, what: &str) {
        for &(name, sum, n) in &self.0 {
            let a = 2.0 / (9.0 * n);
            let limit = n * (1.0 - a + 4.75 * a.sqrt()).powi(3);
            assert!(
                sum < limit,
                "{what}: {name} is off by {:.2} standard uncertainties (rms of {n})",
                (sum / n).sqrt()
            );
        }
    }
}

fn one(m: &Measured, what: &str) -> Bounce {
    assert_eq!(m.bounces.len(), 1, "{what}");
    m.bounces[0].clone()
}

#[test]
fn hard_impacts_on_film_are_measured_or_null() {
    for c in cases() {
        let mut film = film_of(&c);
        let mut pulls = Pulls::default();
        for seed in 0..12 {
            film.seed = 77 + seed;
            let m = film.fitted().unwrap_or_else(|| panic!("{}: no fit", c.name));
            sound(&m, c.name);
            let b = one(&m, c.name);
            pulls.add(&film, &b);
            for (name, q) in quantities(&b) {
                if c.null.contains(&name) {
                    assert!(q.is_none(), "{}: {name} is {q:?}", c.name);
                } else {
                    assert!(q.is_some(), "{}: {name} is null", c.name);
                }
            }
            let readings = m.readings.unwrap();
            let (mu_e, e_e) = (
                readings.of(ModelName::MuE).unwrap(),
                readings.of(ModelName::EE).unwrap(),
            );
            assert!(c.mu_e.contains(&mu_e.regime), "{}: {readings:?}", c.name);
            assert!(c.e_e.contains(&e_e.regime), "{}: {readings:?}", c.name);
            assert_eq!(
                mu_e.quantity.is_some(),
                mu_e.regime == Some(Regime::Sliding),
                "{}",
                c.name
            );
        }
        pulls.hold(c.name);
    }
}

#[test]
fn to_the_left_and_with_a_tilted_up_the_same_is_read() {
    for c in cases() {
        for (left, tilt_rad) in [(true, 0.0), (false, 0.3), (true, -1.2), (false, 3.1)] {
            let film = Film {
                left,
                tilt_rad,
                seed: 5,
                ..film_of(&c)
            };
            let what = format!("{}, {tilt_rad} rad", c.name);
            let m = film.fitted().unwrap();
            sound(&m, &what);
            let mut pulls = Pulls::default();
            // To the left x counts to the left, if the ball moves along x at all.
            if film.before.velocity_m_s.x.abs() > 1e-3 || !left {
                pulls.add(&film, &one(&m, &what));
            }
            pulls.hold(&what);
        }
    }
}

#[test]
fn topspin_that_becomes_speed_is_an_impact() {
    // What leaves has 1.4 to 4 times the kinetic energy of what came.
    for (angle_deg, spin_ratio, law) in [
        (20.0, 6.0, Law::EE(0.8, 0.4)),
        (20.0, 8.0, Law::MuE(0.8, 0.5)),
        (45.0, 2.5, Law::EE(0.9, 0.7)),
        (10.0, 25.0, Law::MuE(0.9, 1.2)),
    ] {
        let before = coming(angle_deg, spin_ratio, 12.0);
        let after = law.after(&before, SOLID_SPHERE);
        let energy = |m: &RigidMotion| m.velocity_m_s.norm_squared();
        assert!(energy(&after) > 1.4 * energy(&before));
        for left in [false, true] {
            let film = Film {
                left,
                ..Film::new(before, after, Some(spin_ratio))
            };
            let what = format!("{angle_deg} degrees, spin {spin_ratio}, left {left}");
            let m = film.measured().unwrap();
            sound(&m, &what);
            let mut pulls = Pulls::default();
            pulls.add(&film, &one(&m, &what));
            pulls.hold(&what);
        }
    }
}

#[test]
fn a_ball_that_stays_down_has_no_bounce() {
    for e in [0.0, 1e-12, 1e-3] {
        let before = coming(20.0, 0.0, 12.0);
        let film = Film::new(before, Law::MuE(e, 0.07).after(&before, SOLID_SPHERE), Some(0.0));
        if let Ok(m) = film.measured() {
            sound(&m, "stays down");
            for b in &m.bounces {
                let e = b.restitution.unwrap();
                assert!(e.value.abs() <= 4.0 * e.std_uncertainty.unwrap(), "{e:?}");
            }
        }
    }
}

#[test]
fn little_restitution_is_measured_while_the_rebound_shows() {
    for e in [0.05, 0.1, 0.15, 0.2, 0.3] {
        let before = coming(20.0, 0.0, 12.0);
        let film = Film {
            rate_hz: 1000.0,
            ..Film::new(before, Law::MuE(e, 0.07).after(&before, SOLID_SPHERE), Some(0.0))
        };
        let mut pulls = Pulls::default();
        if let Ok(m) = film.measured() {
            sound(&m, "a low rebound");
            if let Some(b) = m.bounces.first() {
                pulls.add(&film, b);
            }
        }
        pulls.hold(&format!("e = {e}"));
        // 0.2 · 1.5 m/s rises 4.6 mm, 5.7 px.
        assert!(!pulls.0.is_empty() || e < 0.2, "{e}");
    }
}

#[test]
fn an_unknown_spin_leaves_only_spin_and_e_x_open() {
    let before = coming(30.0, 0.4, 12.0);
    let film = Film::new(before, STEEL.after(&before, SOLID_SPHERE), None);
    let m = film.fitted().unwrap();
    let b = one(&m, "unknown spin");
    for (name, q) in quantities(&b) {
        let needs = ["spin before", "spin after", "tangential restitution"].contains(&name);
        assert_eq!(q.is_none(), needs, "{name}: {q:?}");
    }
    assert_eq!(m.readings.unwrap().of(ModelName::MuE).unwrap().regime, None);
}

#[test]
fn inertia_at_its_limits_gives_no_number_that_is_none() {
    let before = coming(30.0, 0.2, 12.0);
    for k in [0.0, 5e-324, 1e-300, 1e-12] {
        let film = Film {
            inertia_factor: k,
            ..Film::new(before, STEEL.after(&before, SOLID_SPHERE), Some(0.2))
        };
        let m = film.fitted().unwrap();
        sound(&m, &format!("k = {k}"));
        let b = one(&m, "k");
        // The velocities are a solid ball's: of one without inertia they would be impossible, and it says so.
        assert!(b.friction.or(b.friction_at_least).is_some() || b.impossible.is_some());
    }
}

/// The quantity of `name` over falls that become vertical, from 45 degrees on; the same noise for all.
fn fading(name: &str, seed: u64) -> Vec<(f64, Option<Quantity>, Option<f64>)> {
    let angles = (0..=60).map(|i| 45.0 * 0.8_f64.powi(i)).chain([0.0]);
    angles
        .map(|angle| {
            let before = coming(angle, 0.0, 12.0);
            let film = Film {
                seed,
                ..Film::new(before, STEEL.after(&before, SOLID_SPHERE), Some(0.0))
            };
            let b = one(&film.fitted().unwrap(), "fading");
            let of = |all: Vec<(&str, Option<Quantity>)>| all.into_iter().find(|q| q.0 == name).unwrap().1;
            let truth = truths(&film).into_iter().find(|t| t.0 == name).unwrap().1;
            (angle, of(quantities(&b)), truth)
        })
        .collect()
}

#[test]
fn friction_fades_without_a_cliff_as_the_fall_becomes_vertical() {
    for seed in 0..6 {
        let mut last: Option<f64> = None;
        for (angle, q, truth) in fading("friction", seed) {
            let q = q.unwrap_or_else(|| panic!("friction is null at {angle} degrees"));
            let (std, truth) = (q.std_uncertainty.unwrap(), truth.unwrap());
            assert!(
                (q.value - truth).abs() < 4.5 * std,
                "{angle} degrees: {q:?}, not {truth}"
            );
            // From one angle to the next (a fifth less) the uncertainty changes by a little, never by a step.
            if let Some(last) = last {
                assert!(
                    (0.9..1.1).contains(&(std / last)),
                    "{angle} degrees: {std} after {last}"
                );
            }
            last = Some(std);
        }
    }
}

#[test]
fn the_tangential_ratio_grows_vague_before_it_is_null() {
    for name in ["tangential ratio", "tangential restitution"] {
        let mut last: Option<f64> = None;
        let mut gone = false;
        for (angle, q, truth) in fading(name, 3) {
            let Some(q) = q else {
                // Where it was vague already: a third of itself or more (e_x: of the slip it is a part of, 1 + e_x over s).
                assert!(
                    gone || last.is_some_and(|l| l > 0.2),
                    "{name} is null at {angle} degrees after ± {last:?}"
                );
                gone = true;
                continue;
            };
            assert!(!gone, "{name} came back at {angle} degrees");
            let std = q.std_uncertainty.unwrap();
            if let Some(truth) = truth {
                assert!(
                    (q.value - truth).abs() < 4.5 * std,
                    "{name} at {angle} degrees: {q:?}, not {truth}"
                );
            }
            if let Some(last) = last {
                assert!(
                    (0.9..1.6).contains(&(std / last)),
                    "{name} at {angle} degrees: {std} after {last}"
                );
            }
            last = Some(std);
        }
        assert!(gone);
    }
}

#[test]
fn a_fall_without_an_impact_has_no_bounce() {
    let before = coming(20.0, 0.0, 12.0);
    let film = Film::new(before, STEEL.after(&before, SOLID_SPHERE), Some(0.0));
    // Up to two frames before the floor; the spin at the launch is known, but there is no impact to take it to.
    let spots: Vec<_> = film
        .spots()
        .into_iter()
        .filter(|s| s.time_s < film.fall_s - 2.0 / film.rate_hz)
        .collect();
    let m = flown::measured(&spots, &film.calibration(), film.metres_per_px).unwrap();
    sound(&m, "a fall");
    assert!(m.bounces.is_empty() && m.readings.is_none() && m.distances.x0_m.is_none());
    let g = m.gravity_m_s2.unwrap();
    assert!((g.value - flown::G).abs() < 4.0 * g.std_uncertainty.unwrap());
}

/// The same seen in a mirror that lies on the floor: z and the spin about y turn round.
fn upside_down(m: &RigidMotion) -> RigidMotion {
    let (v, spin) = (m.velocity_m_s, m.surface_spin_m_s);
    moving(v.x, -v.z, -spin.y)
}

#[test]
fn a_ball_between_two_plates_bounces_on_both() {
    const APART_M: f64 = 0.12;
    let film = Film {
        rate_hz: 960.0,
        ..Film::new(coming(50.0, 0.0, 12.0), coming(50.0, 0.0, 12.0), Some(0.0))
    };
    let dt = 1.0 / film.rate_hz;
    // (time, x, z, motion) of the start, and after each impact: up and down by the formulas of a fall.
    let (mut t, mut x, mut z) = (0.0, 0.0, 0.9 * APART_M);
    let mut m = moving(1.8, -4.0, 0.0);
    let mut truth = Vec::new();
    let mut places = Vec::new();
    for _ in 0..4 {
        let falling = m.velocity_m_s.z < 0.0;
        let plate_m = if falling { 0.0 } else { APART_M };
        let (v, g) = (m.velocity_m_s.z, flown::G);
        let root = (v * v + 2.0 * g * (z - plate_m)).sqrt();
        let flight_s = if falling { (v + root) / g } else { (v - root) / g };
        let mut frame = (t / dt).ceil();
        while frame * dt < t + flight_s {
            let since = frame * dt - t;
            places.push((
                frame,
                x + m.velocity_m_s.x * since,
                z + (v - 0.5 * g * since) * since,
            ));
            frame += 1.0;
        }
        (t, x, z) = (t + flight_s, x + m.velocity_m_s.x * flight_s, plate_m);
        let before = moving(m.velocity_m_s.x, v - g * flight_s, m.surface_spin_m_s.y);
        m = if falling {
            STEEL.after(&before, SOLID_SPHERE)
        } else {
            upside_down(&STEEL.after(&upside_down(&before), SOLID_SPHERE))
        };
        truth.push((falling, t, x, before, m));
    }
    truth.pop(); // The film ends with the flight to the fourth.
    let template = film.spots()[0];
    let map = film.calibration().rectification().unwrap();
    let mut noise = Noise(7);
    let spots: Vec<_> = places
        .iter()
        .enumerate()
        .map(|(id, &(frame, x, z))| {
            let pixel = PixelPoint::new(
                film.hit_px[0] + x / film.metres_per_px + film.noise_px * noise.normal(),
                film.hit_px[1] - z / film.metres_per_px + film.noise_px * noise.normal(),
            );
            Spot {
                id,
                frame: frame as usize,
                time_s: frame * dt,
                place: map.plane_from_pixel(pixel).unwrap(),
                ..template
            }
        })
        .collect();
    let measured = flown::measured(&spots, &film.calibration(), film.metres_per_px).unwrap();
    sound(&measured, "between two plates");
    let times: Vec<f64> = measured
        .bounces
        .iter()
        .filter_map(|b| Some(b.time_s?.value))
        .collect();
    assert_eq!(
        measured.bounces.len(),
        truth.len(),
        "{times:.4?}, arcs meet at {:.4?}, last by {:.3}",
        measured.flight.impacts,
        truth.last().unwrap().1
    );
    for (b, (falling, t, x, before, after)) in measured.bounces.iter().zip(truth) {
        let (surface, up) = if falling {
            (BounceSurface::Floor, 1.0)
        } else {
            (BounceSurface::Ceiling, -1.0)
        };
        assert_eq!(b.surface, surface);
        let (v, w) = (before.velocity_m_s, after.velocity_m_s);
        let (spin, spun) = (before.surface_spin_m_s.y, after.surface_spin_m_s.y);
        let near = |name: &str, q: Option<Quantity>, truth: f64, more: f64| {
            let q = q.unwrap_or_else(|| panic!("no {name} of the {}", surface.name()));
            let off = (q.value - truth).abs();
            let std = q.std_uncertainty.unwrap_or(0.0);
            assert!(
                off < 4.0 * std + more,
                "{name} of the {}: {q:?}, not {truth}",
                surface.name()
            );
        };
        // A contact that takes no time is none of a ball's: the touch is assumed some 1e-5 s earlier.
        near("time", b.time_s, t, 1e-4);
        near("x", b.x_m, x + film.hit_x_m(), 2e-4);
        near("vx", b.incident.vx_m_s, v.x, 0.0);
        near("vz", b.incident.vz_m_s, v.z, 2e-3);
        near("vx after", b.rebound.vx_m_s, w.x, 0.0);
        near("vz after", b.rebound.vz_m_s, w.z, 2e-3);
        near("angle", b.incident.angle_rad, v.x.atan2(-up * v.z), 1e-3);
        near("angle after", b.rebound.angle_rad, w.x.atan2(up * w.z), 1e-3);
        near("restitution", b.restitution, -w.z / v.z, 1e-3);
        near("spin", b.spin_in_m_s, spin, 1e-3);
        near("spin after", b.spin_out_m_s, spun, 1e-3);
        near(
            "friction",
            b.friction.or(b.friction_at_least),
            (v.x - w.x).abs() / (v.z - w.z).abs(),
            1e-3,
        );
        let e_x = -(w.x - up * spun) / (v.x - up * spin);
        near("e_x", b.tangential_restitution, e_x, 5e-3);
    }
    // Nothing comes down through a ceiling, and what the models read is the floor's.
    assert!(measured.distances.x_m.is_none());
}
