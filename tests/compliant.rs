//! The compliant contact against published values, against the same springs worked out in another way, and in its limits.

use nalgebra::Vector3;
use proptest::prelude::*;
use track::rebound::compliant::{self, Parameters, springs, table};
use track::rebound::{Contact, Regime, RigidMotion, SOLID_SPHERE, mu_e, slip_share};
use track::simulate::{Scene, SimulatedRecording};

/// κ of like bodies.
fn like(nu: f64) -> f64 {
    2.0 * (1.0 - nu) / (2.0 - nu)
}

fn parameters(restitution: f64, friction: f64, stiffness_ratio: f64) -> Parameters {
    Parameters {
        restitution,
        friction,
        stiffness_ratio,
    }
}

/// A ball without spin whose ψ₁ is `psi`.
fn at_incidence(parameters: &Parameters, psi: f64, normal_m_s: f64) -> RigidMotion {
    RigidMotion {
        velocity_m_s: Vector3::new(
            psi * parameters.friction * normal_m_s / parameters.stiffness_ratio,
            0.0,
            -normal_m_s,
        ),
        surface_spin_m_s: Vector3::zeros(),
    }
}

fn e_x_of(before: &RigidMotion, after: &RigidMotion) -> f64 {
    -after.slip_m_s().x / before.slip_m_s().x
}

/// What several share saves time and changes nothing.
#[test]
fn several_impacts_are_as_each_by_itself() {
    for (e, mu, kappa) in [(1.0, 0.3, like(0.3)), (0.7, 0.15, 1.5), (0.5, 0.6, 1e6)] {
        let p = parameters(e, mu, kappa);
        let sliding = p.sliding_incidence(SOLID_SPHERE);
        let psi = (0..30).map(|i| (i * 7 % 30) as f64 / 20.0 * sliding.min(8.0));
        let incoming: Vec<RigidMotion> = psi.map(|psi| at_incidence(&p, psi, 2.0)).collect();
        let together = Contact::Compliant(p).impacts(&incoming, SOLID_SPHERE);
        assert_eq!(together.len(), incoming.len());
        for (before, (after, regime)) in incoming.iter().zip(&together) {
            let (alone, same_regime) = compliant::impact(before, &p, SOLID_SPHERE);
            assert_eq!(*regime, same_regime);
            assert!((after.velocity_m_s - alone.velocity_m_s).norm() < 1e-12);
            assert!((after.surface_spin_m_s - alone.surface_spin_m_s).norm() < 1e-12);
        }
    }
}

/// `physics.md`, part two: a sphere, ν 0.3, e 1.
#[test]
fn val_e_x_over_the_incidence() {
    const TABLE: [(f64, f64); 11] = [
        (0.5, -0.096),
        (1.0, 0.060),
        (1.5, 0.285),
        (2.0, 0.419),
        (2.5, 0.465),
        (3.0, 0.460),
        (3.5, 0.422),
        (4.0, 0.359),
        (4.5, 0.271),
        (4.765, 0.210),
        (6.0, -0.039),
    ];
    let law = parameters(1.0, 0.1, like(0.3));
    for (psi, expected) in TABLE {
        let before = at_incidence(&law, psi, 2.0);
        let (after, regime) = compliant::impact(&before, &law, SOLID_SPHERE);
        let e_x = e_x_of(&before, &after);
        println!("psi_1 {psi}: e_x {e_x:.5}, published {expected}, {regime:?}");
        assert!((e_x - expected).abs() < 2e-3, "psi_1 {psi}: {e_x} {expected}");
    }
}

/// The same: friction without end.
#[test]
fn val_e_x_without_slip() {
    for (nu, expected) in [
        (0.0, -0.387),
        (0.23, -0.297),
        (0.3, -0.232),
        (0.4, -0.096),
        (0.5, 0.104),
    ] {
        let law = parameters(1.0, 1e12, like(nu));
        let before = RigidMotion {
            velocity_m_s: Vector3::new(1.0, 0.0, -1.0),
            surface_spin_m_s: Vector3::zeros(),
        };
        let e_x = e_x_of(&before, &compliant::impact(&before, &law, SOLID_SPHERE).0);
        println!("nu {nu}: e_x {e_x:.5}, published {expected}");
        assert!((e_x - expected).abs() < 1e-3, "nu {nu}: {e_x}");
    }
}

/// From ψ₁ = 4χ − 1 on, ψ₂ = ψ₁ − 4χ, and not below.
#[test]
fn val_sliding_throughout_begins_at_4_chi_less_1() {
    for (nu, k) in [(0.0, 0.4), (0.3, 0.4), (0.3, 2.0 / 3.0), (0.5, 0.4)] {
        let law = parameters(1.0, 0.2, like(nu));
        let chi = (1.0 - nu) * (1.0 + 1.0 / k) / (2.0 - nu);
        let limit = 4.0 * chi - 1.0;
        assert!((law.sliding_incidence(k) - limit).abs() < 1e-12);
        for (psi, slides) in [(limit - 0.01, false), (limit + 1e-9, true), (limit + 3.0, true)] {
            let before = at_incidence(&law, psi, 1.0);
            let (after, regime) = compliant::impact(&before, &law, k);
            assert_eq!(regime == Regime::Sliding, slides, "nu {nu} psi_1 {psi}");
            let psi_2 = -psi * e_x_of(&before, &after);
            let within = if slides { 1e-9 } else { 2e-3 };
            assert!(
                (psi_2 - (psi - 4.0 * chi)).abs() < within,
                "nu {nu} psi_1 {psi}: {psi_2}"
            );
        }
        // The springs themselves come to the same there, with nothing said about sliding.
        for psi in [limit, limit + 0.5, limit + 3.0] {
            let lambda = law.stiffness(k);
            let e_x = springs::tangential_restitutions(&[psi], lambda, 1.0)[0];
            assert!((-psi * e_x - (psi - 4.0 * chi)).abs() < 1e-3, "{e_x}");
        }
    }
}

/// The springs by the plainest of schemes, in metres and seconds: Euler's steps, independent springs side by side.
fn plain_springs(law: &Parameters, before: &RigidMotion, k: f64, springs: usize, steps: usize) -> f64 {
    let (mass_kg, radius_m, modulus_pa) = (0.01, 0.012, 3e9);
    let (mut d, mut v_n) = (0.0, before.velocity_m_s.z.abs());
    let (mut v_t, mut w) = (before.velocity_m_s.x, before.surface_spin_m_s.y);
    let deepest = (15.0 / 16.0 * mass_kg * v_n * v_n / (modulus_pa * f64::sqrt(radius_m))).powf(0.4);
    let reach = 1.01 * f64::sqrt(deepest * radius_m);
    let dx = reach / springs as f64;
    let dt = 2.95 * deepest / v_n / steps as f64;
    let mut forces = vec![0.0; springs];
    loop {
        let falls = if v_n < 0.0 { law.restitution.powi(2) } else { 1.0 };
        let (mut normal, mut along) = (0.0, 0.0);
        for (i, force) in forces.iter_mut().enumerate() {
            let x = (i as f64 + 0.5) * dx;
            let pressed = (d - x * x / radius_m).max(0.0);
            // Both sides of the line.
            let f_z = 2.0 * falls * modulus_pa * pressed * dx;
            *force -= 2.0 * law.stiffness_ratio * modulus_pa * dx * (v_t - w) * dt;
            *force = f64::clamp(*force, -law.friction * f_z, law.friction * f_z);
            normal += f_z;
            along += *force;
        }
        v_n -= normal / mass_kg * dt;
        v_t += along / mass_kg * dt;
        w -= along / (k * mass_kg) * dt;
        d += v_n * dt;
        if d <= 0.0 {
            return -(v_t - w) / (before.velocity_m_s.x - before.surface_spin_m_s.y);
        }
    }
}

#[test]
fn another_scheme_in_other_units_comes_to_the_same() {
    for (e, mu, nu, k) in [
        (1.0, 0.3, 0.3, 0.4),
        (0.8, 0.1, 0.3, 0.4),
        (0.6, 0.5, 0.1, 2.0 / 3.0),
    ] {
        let law = parameters(e, mu, like(nu));
        for psi in [0.4, 0.9, 1.6, 2.4, 3.4, 4.4, 6.0] {
            for normal_m_s in [0.7, 5.0] {
                let mut before = at_incidence(&law, psi, normal_m_s);
                // The same slip, some of it from spin.
                before.surface_spin_m_s.y = -0.3 * before.velocity_m_s.x;
                before.velocity_m_s.x *= 0.7;
                let after = compliant::impact(&before, &law, k).0;
                let (found, plain) = (
                    -(after.velocity_m_s.x - after.surface_spin_m_s.y)
                        / (before.velocity_m_s.x - before.surface_spin_m_s.y),
                    plain_springs(&law, &before, k, 400, 4000),
                );
                assert!(
                    (found - plain).abs() < 3e-3,
                    "{law:?} psi_1 {psi}: {found} {plain}"
                );
            }
        }
    }
}

/// The error falls with the square of the number of steps (and of springs, which is the same).
#[test]
fn the_springs_converge_with_the_second_order() {
    let psi: springs::Lanes = [0.3, 0.7, 1.3, 1.8, 2.3, 3.1, 3.8, 4.4];
    for (lambda, e) in [(3.5 * like(0.3), 1.0), (3.5 * like(0.3), 0.8), (8.0, 0.9)] {
        let at = |steps: usize| springs::run(&psi, lambda, e, &springs::Line::new(steps), |_| ());
        let best = springs::in_steps(&psi, lambda, e, 1024);
        let error = |steps: usize| {
            let end = at(steps);
            let off = (0..springs::LANES).map(|i| -end[i] / psi[i] - best[i]);
            (off.map(|x| x * x).sum::<f64>() / springs::LANES as f64).sqrt()
        };
        let errors = [32, 64, 128, 256].map(error);
        let orders: Vec<f64> = errors.windows(2).map(|w| (w[0] / w[1]).log2()).collect();
        println!("lambda {lambda:.3} e {e}: errors {errors:?}, orders {orders:?}");
        assert!(
            orders.iter().all(|order| (1.6..2.5).contains(order)),
            "{orders:?}"
        );
        // What the program takes: extrapolated.
        let taken = springs::tangential_restitutions(&psi, lambda, e);
        let worst = taken
            .iter()
            .zip(&best)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        println!(
            "    extrapolated from {} and twice: {worst:.1e}",
            springs::steps(lambda, 1.0)
        );
        assert!(worst < 3e-5, "{worst}");
    }
}

/// For κ → ∞ it is the μ-e model.
#[test]
fn a_stiff_contact_is_mu_e() {
    let incidences = [5.0, 15.0, 25.0, 32.0, 40.0, 60.0_f64];
    let mut before_worst = f64::INFINITY;
    for kappa in [30.0, 300.0, 2000.0, 1e6] {
        let law = parameters(0.8, 0.1, kappa);
        let rigid = mu_e::Parameters {
            restitution: 0.8,
            friction: 0.1,
            static_friction: 0.1,
        };
        let worst = incidences
            .iter()
            .map(|angle| {
                let motion = RigidMotion {
                    velocity_m_s: Vector3::new(angle.to_radians().sin(), 0.0, -angle.to_radians().cos()),
                    surface_spin_m_s: Vector3::zeros(),
                };
                let found = compliant::impact(&motion, &law, SOLID_SPHERE).0;
                (found.velocity_m_s - mu_e::impact(&motion, &rigid, SOLID_SPHERE).0.velocity_m_s).norm()
            })
            .fold(0.0, f64::max);
        println!("kappa {kappa}: {worst:.1e} m/s from mu_e");
        assert!(worst < before_worst, "{kappa}: {worst} {before_worst}");
        before_worst = worst;
    }
    assert!(before_worst < 1e-12, "{before_worst}");
}

/// The paper's superball: e 0.96, e_x 0.5 up to where friction of 1 ends grip, far beyond its 60 degrees. A contact that is soft
/// sideways does that, give or take what e_x changes with the incidence.
#[test]
fn val_the_papers_superball() {
    let launch = |angle: f64| RigidMotion {
        velocity_m_s: Vector3::new(angle.to_radians().tan(), 0.0, -1.0),
        surface_spin_m_s: Vector3::zeros(),
    };
    let e_x = |kappa: f64| {
        let motion = launch(30.0);
        e_x_of(
            &motion,
            &compliant::impact(&motion, &parameters(0.96, 1.0, kappa), SOLID_SPHERE).0,
        )
    };
    let (mut soft, mut stiff) = (0.4, 0.8);
    assert!(e_x(soft) > 0.5 && e_x(stiff) < 0.5);
    for _ in 0..40 {
        let middle = 0.5 * (soft + stiff);
        if e_x(middle) > 0.5 {
            soft = middle;
        } else {
            stiff = middle;
        }
    }
    let law = parameters(0.96, 1.0, soft);
    println!("kappa {soft:.3}");
    assert!((0.45..0.65).contains(&soft), "{soft}");
    for angle in [10.0, 30.0, 45.0] {
        let motion = launch(angle);
        let (after, regime) = compliant::impact(&motion, &law, SOLID_SPHERE);
        let found = e_x_of(&motion, &after);
        println!("{angle} degrees: e_x {found:.3}, {regime:?}");
        assert!(
            regime == Regime::StickSlip && (found - 0.5).abs() < 0.1,
            "{found}"
        );
    }
    // Garwin's: nothing lost, all of it given back, as stiff as its own period asks for.
    let best = (1..400).map(|i| parameters(1.0, 1e9, 0.005 * f64::from(i)).tangential_restitution(0.0, 0.4));
    assert!(best.fold(-1.0, f64::max) > 0.98);
}

/// Between the knots of the table, against the springs.
#[test]
fn interpolated_e_x_is_that_of_the_springs() {
    let mut state = 88_172_645_463_325_252_u64;
    let mut uniform = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut off = Vec::new();
    let mut slopes = Vec::new();
    for _ in 0..120 {
        let (lambda, e) = (2.3 + 1.7 * uniform(), 0.6 + 0.4 * uniform());
        let end = table::Marks::new(lambda, e).sliding();
        let psi: Vec<f64> = (0..80).map(|_| end * uniform()).collect();
        let exact = springs::tangential_restitutions(&psi, lambda, e);
        for (psi, exact) in psi.iter().zip(exact) {
            let found = table::interpolated(*psi, lambda, e).unwrap();
            off.push((found.e_x - exact).abs());
            // Derivatives are those of what is interpolated.
            let at = |psi: f64, lambda: f64, e: f64| table::interpolated(psi, lambda, e).unwrap().e_x;
            let h = 1e-6;
            if psi * 1.001 < end && e < 0.999 {
                let size =
                    1.0 + found.by_log_psi.abs() + found.by_stiffness.abs() + found.by_restitution.abs();
                for (by, difference) in [
                    (
                        found.by_log_psi,
                        at(psi * (1.0 + h), lambda, e) - at(psi * (1.0 - h), lambda, e),
                    ),
                    (
                        found.by_stiffness,
                        at(*psi, lambda + h, e) - at(*psi, lambda - h, e),
                    ),
                    (
                        found.by_restitution,
                        at(*psi, lambda, e + h) - at(*psi, lambda, e - h),
                    ),
                ] {
                    slopes.push((by - difference / (2.0 * h)).abs() / size);
                }
            }
        }
    }
    off.sort_by(f64::total_cmp);
    slopes.sort_by(f64::total_cmp);
    let (n, m) = (off.len(), slopes.len());
    println!(
        "half within {:.1e}, 90 % {:.1e}, 99 % {:.1e}, all {:.1e}; slopes 99 % within {:.1e}",
        off[n / 2],
        off[n * 9 / 10],
        off[n * 99 / 100],
        off[n - 1],
        slopes[m * 99 / 100]
    );
    assert!(off[n / 2] < 3e-5 && off[n * 99 / 100] < 2e-3 && off[n - 1] < 8e-3);
    assert!(slopes[m * 99 / 100] < 1e-3);
}

fn any_law() -> impl Strategy<Value = Parameters> {
    (0.0..=1.0f64, 0.01..3.0f64, 0.05..20.0f64).prop_map(|(e, mu, kappa)| parameters(e, mu, kappa))
}

fn any_motion() -> impl Strategy<Value = RigidMotion> {
    let speed = || -5.0..5.0f64;
    (speed(), speed(), 0.05..5.0f64, speed(), speed()).prop_map(|(x, y, z, wx, wy)| RigidMotion {
        velocity_m_s: Vector3::new(x, y, -z),
        surface_spin_m_s: Vector3::new(wx, wy, 0.3),
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    #[test]
    fn energy_is_never_gained(law in any_law(), incoming in any_motion(), k in 0.2..1.0f64) {
        let after = compliant::impact(&incoming, &law, k).0;
        let (before, after) = (incoming.energy_j_kg(k), after.energy_j_kg(k));
        prop_assert!(after <= before * (1.0 + 1e-9), "{before} {after}");
    }

    #[test]
    fn friction_is_never_exceeded(law in any_law(), incoming in any_motion(), k in 0.2..1.0f64) {
        let after = compliant::impact(&incoming, &law, k).0;
        let tangential = (after.velocity_m_s - incoming.velocity_m_s).xy().norm();
        let normal = (1.0 + law.restitution) * incoming.velocity_m_s.z.abs();
        prop_assert!(tangential <= law.friction * normal * (1.0 + 1e-6) + 1e-9, "{tangential} {normal}");
    }

    #[test]
    fn speed_does_not_matter(law in any_law(), incoming in any_motion(), factor in 0.01..100.0f64) {
        let faster = RigidMotion {
            velocity_m_s: incoming.velocity_m_s * factor,
            surface_spin_m_s: incoming.surface_spin_m_s * factor,
        };
        let (slow, regime) = compliant::impact(&incoming, &law, SOLID_SPHERE);
        let (fast, same) = compliant::impact(&faster, &law, SOLID_SPHERE);
        prop_assert!((fast.velocity_m_s - slow.velocity_m_s * factor).norm() < 1e-6 * factor);
        prop_assert!(regime == same || (law.incidence(incoming.slip_m_s().norm(), -incoming.velocity_m_s.z) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn only_psi_1_matters(e in 0.3..1.0f64, mu in 0.05..1.0f64, kappa in 0.3..3.0f64, psi in 0.05..4.0f64, times in 0.2..5.0f64) {
        let (a, b) = (parameters(e, mu, kappa), parameters(e, mu * times, kappa));
        let e_x = |law: &Parameters| {
            let before = at_incidence(law, psi, 1.0);
            e_x_of(&before, &compliant::impact(&before, law, SOLID_SPHERE).0)
        };
        prop_assert!((e_x(&a) - e_x(&b)).abs() < 1e-6);
    }

    #[test]
    fn a_turned_and_mirrored_impact_is_the_impact_turned_and_mirrored(law in any_law(), incoming in any_motion(), turn in -3.0..3.0f64) {
        let rotation = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), turn);
        let turned = |m: &RigidMotion| RigidMotion {
            velocity_m_s: rotation * m.velocity_m_s,
            surface_spin_m_s: rotation * m.surface_spin_m_s,
        };
        // y → −y; spin is an axial vector.
        let mirrored = |m: &RigidMotion| RigidMotion {
            velocity_m_s: Vector3::new(m.velocity_m_s.x, -m.velocity_m_s.y, m.velocity_m_s.z),
            surface_spin_m_s: Vector3::new(-m.surface_spin_m_s.x, m.surface_spin_m_s.y, -m.surface_spin_m_s.z),
        };
        let after = compliant::impact(&incoming, &law, SOLID_SPHERE).0;
        for (before, expected) in [(turned(&incoming), turned(&after)), (mirrored(&incoming), mirrored(&after))] {
            let found = compliant::impact(&before, &law, SOLID_SPHERE).0;
            prop_assert!((found.velocity_m_s - expected.velocity_m_s).norm() < 1e-6);
            prop_assert!((found.surface_spin_m_s - expected.surface_spin_m_s).norm() < 1e-5);
        }
    }

    #[test]
    fn angular_momentum_about_the_contact_is_kept(law in any_law(), incoming in any_motion(), k in 0.2..1.0f64) {
        let about = |m: &RigidMotion| {
            let (v, w) = (m.velocity_m_s, m.surface_spin_m_s);
            (v.x + k * w.y, v.y - k * w.x)
        };
        let (a, b) = (about(&incoming), about(&compliant::impact(&incoming, &law, k).0));
        prop_assert!((a.0 - b.0).abs() < 1e-9 && (a.1 - b.1).abs() < 1e-9);
    }
}

#[test]
fn what_has_no_slip_keeps_its_spin() {
    let law = parameters(0.9, 0.2, 0.8);
    let rolling = RigidMotion {
        velocity_m_s: Vector3::new(1.0, 0.0, -1.0),
        surface_spin_m_s: Vector3::new(0.0, 1.0, 0.0),
    };
    let after = compliant::impact(&rolling, &law, SOLID_SPHERE).0;
    assert!((after.velocity_m_s - Vector3::new(1.0, 0.0, 0.9)).norm() < 1e-12);
    assert!((slip_share(SOLID_SPHERE) * law.stiffness(SOLID_SPHERE) - 0.8).abs() < 1e-12);
}

/// The simulator's contact: Hertz's time, a path that is continuous, friction that does what the springs say.
#[test]
fn a_simulated_contact_takes_its_time_and_ends_in_the_rebound() {
    for (e, mu, kappa) in [(1.0, 0.3, 0.82), (0.8, 0.1, 0.82), (0.95, 1.0, 0.5)] {
        let scene = format!(
            r#"{{"schema": "track.scene/1",
            "ball": {{"radius_m": 0.023, "mass_kg": 0.0464, "contact_modulus_pa": 1e7}},
            "contact": {{"model": "compliant", "restitution": {e}, "friction": {mu}, "stiffness_ratio": {kappa}}},
            "launch": {{"drop_height_m": 0.2, "speed_m_s": 1.0}},
            "effects": {{"drag": "off", "magnus": "off", "buoyancy": "off", "contact_time": "on"}},
            "stop": {{"bounces": 1}}}}"#
        );
        let recording = SimulatedRecording::new(&Scene::from_json(&scene).unwrap()).unwrap();
        let impact = recording.trajectory().impacts()[0];
        let v = impact.incident.velocity_m_s.z.abs();
        let hertz_s = 2.87 * (0.0464_f64.powi(2) / (0.023 * 1e14 * v)).powf(0.2);
        let expected_s = hertz_s * 0.5 * (1.0 + 1.0 / e);
        assert!(
            (impact.contact_s / expected_s - 1.0).abs() < 2e-3,
            "{} {expected_s}",
            impact.contact_s
        );
        let (law, mut before) = (parameters(e, mu, kappa), impact.incident);
        before.velocity_m_s.z = -v;
        let after = compliant::impact(&before, &law, SOLID_SPHERE).0;
        assert!((after.velocity_m_s - impact.rebound.velocity_m_s).norm() < 1e-9);
        let at = |t: f64| recording.trajectory().state(impact.time_s + t);
        let hertz_m = (15.0 * 0.0464 * v * v / (16.0 * 0.023_f64.sqrt() * 1e7)).powf(0.4);
        let deepest = (0..=400)
            .map(|i| 0.023 - at(impact.contact_s * f64::from(i) / 400.0).position_m.z)
            .fold(0.0, f64::max);
        assert!((deepest / hertz_m - 1.0).abs() < 1e-3, "{deepest} {hertz_m}");
        for t in [0.0, impact.contact_s] {
            let tiny = 1e-9;
            let jump = at(t + tiny).velocity_m_s - at(t - tiny).velocity_m_s;
            assert!(jump.norm() < 2e-3, "e {e} at {t}: {jump}");
        }
        // Velocity is the rate of the place all along.
        for i in 1..40 {
            let t = impact.contact_s * f64::from(i) / 40.0;
            let h = 1e-5 * impact.contact_s;
            let rate = (at(t + h).position_m - at(t - h).position_m) / (2.0 * h);
            assert!(
                (rate - at(t).velocity_m_s).norm() < 2e-3,
                "{rate} {}",
                at(t).velocity_m_s
            );
        }
    }
}
