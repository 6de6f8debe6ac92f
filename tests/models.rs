//! The rebound relations against the paper's values (`val_*`) and their own symmetries.

use nalgebra::{Rotation3, Vector3};
use proptest::prelude::*;
use track::rebound::{
    Regime, RigidMotion, SOLID_SPHERE, apply_impulse, azimuth_rad, e_e, grip_slide, itf, launch, mu_e,
    slip_share,
};

const G: f64 = 9.81;

fn launch_at(angle_deg: f64, spin_ratio: f64) -> RigidMotion {
    // u_o = 1 m/s, as in the paper.
    RigidMotion {
        velocity_m_s: Vector3::new(1.0, 0.0, -1.0 / angle_deg.to_radians().tan()),
        surface_spin_m_s: Vector3::new(0.0, spin_ratio, 0.0),
    }
}

fn close(found: f64, expected: f64, tolerance: f64, what: &str) {
    assert!(
        (found - expected).abs() <= tolerance,
        "{what}: {found} is not within {tolerance} of {expected}"
    );
}

const STEEL_ON_CERAMIC: mu_e::Parameters = mu_e::Parameters {
    restitution: 0.78,
    friction: 0.07,
    static_friction: 0.07,
};
const GOLF_ON_CERAMIC: mu_e::Parameters = mu_e::Parameters {
    restitution: 0.90,
    friction: 0.12,
    static_friction: 0.12,
};
const STEEL_ON_WOOD: mu_e::Parameters = mu_e::Parameters {
    restitution: 0.52,
    friction: 0.10,
    static_friction: 0.15,
};
const SUPERBALL: e_e::Parameters = e_e::Parameters {
    restitution: 0.96,
    tangential_restitution_x: 0.5,
    tangential_restitution_y: 0.5,
};

#[test]
fn val_transition_angles_of_the_paper() {
    let angle = |p| mu_e::transition_angle_rad(&p, 0.0, SOLID_SPHERE).to_degrees();
    close(angle(STEEL_ON_CERAMIC), 23.6, 0.05, "steel on ceramic");
    close(angle(GOLF_ON_CERAMIC), 38.6, 0.05, "golf on ceramic");
    close(
        angle(STEEL_ON_WOOD),
        38.6,
        0.05,
        "steel on wood by the static coefficient",
    );
    let by_dynamic = mu_e::Parameters {
        static_friction: 0.10,
        ..STEEL_ON_WOOD
    };
    close(
        angle(by_dynamic),
        28.0,
        0.05,
        "steel on wood by the dynamic coefficient",
    );
    let grip = grip_slide::Parameters {
        restitution: 0.96,
        tangential_restitution_x: 0.5,
        friction: 0.95,
    };
    close(
        grip_slide::transition_angle_rad(&grip, 0.0, SOLID_SPHERE).to_degrees(),
        77.0,
        0.05,
        "superball on wood",
    );
}

#[test]
fn val_regimes_change_at_the_transition_angle() {
    for p in [STEEL_ON_CERAMIC, GOLF_ON_CERAMIC, STEEL_ON_WOOD] {
        for spin in [-0.5, 0.0, 0.6, 1.6] {
            let at = mu_e::transition_angle_rad(&p, spin, SOLID_SPHERE).to_degrees();
            let below = mu_e::impact(&launch_at(at - 0.01, spin), &p, SOLID_SPHERE).1;
            let above = mu_e::impact(&launch_at(at + 0.01, spin), &p, SOLID_SPHERE).1;
            assert_eq!(
                (below, above),
                (Regime::Nonsliding, Regime::Sliding),
                "{p:?} {spin}"
            );
        }
    }
}

#[test]
fn val_fig_3_tangents() {
    for angle_deg in [5.0, 12.0, 20.0, 30.0, 45.0, 60.0_f64] {
        let tangent = angle_deg.to_radians().tan();
        for p in [STEEL_ON_CERAMIC, GOLF_ON_CERAMIC] {
            let (out, regime) = mu_e::impact(&launch_at(angle_deg, 0.0), &p, SOLID_SPHERE);
            let expected = match regime {
                Regime::Nonsliding => 5.0 / (7.0 * p.restitution) * tangent,
                _ => tangent / p.restitution - p.friction * (1.0 + p.restitution) / p.restitution,
            };
            close(out.angle_rad().tan(), expected, 1e-12, "Fig. 3a, b");
        }
        let (out, _) = e_e::impact(&launch_at(angle_deg, 0.0), &SUPERBALL, SOLID_SPHERE);
        close(out.angle_rad().tan() / tangent, 0.595, 0.0005, "Fig. 3c slope");
    }
    // Forcing the nonsliding relation on the superball's slope gives an e above 1.
    close(5.0 / 7.0 / 0.5952, 1.2, 0.001, "impossible restitution");
}

#[test]
fn val_fig_4_launches() {
    let s1 = launch::track_spin_ratio(0.0064, 0.01).unwrap();
    let s2 = launch::track_spin_ratio(0.0125, 0.01).unwrap();
    close(s1, 1.60, 0.005, "S1");
    close(s2, 1.09, 0.005, "S2");
    for spin in [s1, s2, 0.0, -0.21, 1.0] {
        for x0_m in [0.05, 0.10, 0.15, 0.20, 0.30, 0.40] {
            let incoming = RigidMotion {
                velocity_m_s: Vector3::new(1.0, 0.0, -G * x0_m),
                surface_spin_m_s: Vector3::new(0.0, spin, 0.0),
            };
            let (out, regime) = mu_e::impact(&incoming, &STEEL_ON_CERAMIC, SOLID_SPHERE);
            let flown = out.velocity_m_s.x * 2.0 * out.velocity_m_s.z / G;
            let expected = match regime {
                Regime::Nonsliding => launch::nonsliding_distance_m(x0_m, 0.78, spin, SOLID_SPHERE),
                _ => launch::sliding_distance_m(x0_m, 1.0, 0.78, 0.07, launch::Slip::of_spin_ratio(spin), G),
            };
            close(flown, expected, 1e-12, "Fig. 4");
            if spin == 1.0 {
                close(flown, launch::rolling_distance_m(x0_m, 0.78), 1e-12, "So");
            }
        }
    }
    // Intercepts of the nonsliding lines, 2 e [(1 - s) + s R w/u].
    close(
        launch::nonsliding_distance_m(1.0, 0.78, 0.0, SOLID_SPHERE),
        1.114,
        0.001,
        "Sr",
    );
    close(
        launch::nonsliding_distance_m(1.0, 0.78, -0.21, SOLID_SPHERE),
        1.021,
        0.001,
        "Ss",
    );
    // Slope of the sliding lines: 2 e mu (1 + e) g / u^2.
    let fall = launch::sliding_distance_m(0.1, 1.0, 0.78, 0.07, launch::Slip::Forward, G) / 0.1;
    close((1.56 - fall) / 0.1, 1.907, 0.001, "slope of Sr");
}

#[test]
fn val_fig_5_spins() {
    let (out, regime) = mu_e::impact(&launch_at(10.0, 0.0), &STEEL_ON_WOOD, SOLID_SPHERE);
    assert_eq!(regime, Regime::Nonsliding);
    close(out.surface_spin_m_s.y, 5.0 / 7.0, 1e-12, "line a");
    let (out, _) = e_e::impact(&launch_at(40.0, 0.0), &SUPERBALL, SOLID_SPHERE);
    close(out.surface_spin_m_s.y, 1.07, 0.002, "line b");
    let (out, regime) = mu_e::impact(&launch_at(50.0, 0.0), &STEEL_ON_WOOD, SOLID_SPHERE);
    assert_eq!(regime, Regime::Sliding);
    let line_c = 2.5 * 0.10 * 1.52 / 50.0_f64.to_radians().tan();
    close(out.surface_spin_m_s.y, line_c, 1e-12, "line c");
}

#[test]
fn val_fig_6_golf_ball_and_superball() {
    let golf = mu_e::Parameters {
        restitution: 0.90,
        friction: 0.18,
        static_friction: 0.22,
    };
    let angle = mu_e::transition_angle_rad(&golf, 0.0, SOLID_SPHERE);
    close(angle.tan(), 3.5 * 0.22 * 1.9, 1e-12, "golf, Eq. 16");
    let superball = grip_slide::Parameters {
        restitution: 0.96,
        tangential_restitution_x: 0.5,
        friction: 1.0,
    };
    let angle = grip_slide::transition_angle_rad(&superball, 0.0, SOLID_SPHERE);
    close(angle.tan(), 3.5 * 1.96 / 1.5, 1e-12, "superball");
}

#[test]
fn val_e_e_components_19_to_22() {
    let incoming = RigidMotion {
        velocity_m_s: Vector3::new(2.0, 0.0, -3.0),
        surface_spin_m_s: Vector3::new(0.7, -0.4, 0.3),
    };
    let p = e_e::Parameters {
        restitution: 0.9,
        tangential_restitution_x: 0.3,
        tangential_restitution_y: -0.6,
    };
    let (out, _) = e_e::impact(&incoming, &p, SOLID_SPHERE);
    let (s, r) = (2.0 / 7.0, 5.0 / 7.0);
    close(
        out.velocity_m_s.x,
        (r - s * 0.3) * 2.0 + s * 1.3 * -0.4,
        1e-12,
        "[19]",
    );
    close(out.velocity_m_s.y, -s * 0.4 * 0.7, 1e-12, "[20]");
    close(
        out.surface_spin_m_s.y,
        r * 1.3 * 2.0 + (s - r * 0.3) * -0.4,
        1e-12,
        "[21]",
    );
    close(out.surface_spin_m_s.x, (s + r * 0.6) * 0.7, 1e-12, "[22]");
    close(out.surface_spin_m_s.z, 0.3, 0.0, "w_z unchanged");
    let alpha = azimuth_rad(&incoming, &out).unwrap();
    close(
        alpha.tan(),
        out.velocity_m_s.y / out.velocity_m_s.x,
        1e-12,
        "[23]",
    );
}

#[test]
fn val_friction_free_readings_28_to_31() {
    let x0_m = 0.2;
    let incoming = RigidMotion {
        velocity_m_s: Vector3::new(1.0, 0.0, -G * x0_m),
        surface_spin_m_s: Vector3::zeros(),
    };
    let (out, _) = mu_e::impact(&incoming, &STEEL_ON_CERAMIC, SOLID_SPHERE);
    let pair = launch::DistancePair {
        x0_m,
        x_m: launch::sliding_distance_m(x0_m, 1.0, 0.78, 0.07, launch::Slip::Forward, G),
        rolling_x0_m: 0.31,
        rolling_x_m: launch::rolling_distance_m(0.31, 0.78),
    };
    let reading = launch::friction_free_reading(&pair, 1.0, 0.0, SOLID_SPHERE, G).unwrap();
    close(reading.vx_m_s, out.velocity_m_s.x, 1e-12, "[28]");
    close(reading.vz_m_s, out.velocity_m_s.z, 1e-12, "[29]");
    close(reading.surface_spin_m_s, out.surface_spin_m_s.y, 1e-12, "[30]");
    close(
        reading.tangential_impulse_m_s,
        out.velocity_m_s.x - 1.0,
        1e-12,
        "[31]",
    );
}

#[test]
fn val_itf_court_pace_rating() {
    close(
        itf::court_pace_rating(0.81, 0.6, 23.0),
        40.0,
        1e-9,
        "neutral court",
    );
    close(itf::court_pace_rating(0.85, 0.7, 23.0), 24.0, 1e-9, "slow court");
    close(itf::court_pace_rating(0.80, 0.6, 30.0), 44.65, 1e-9, "warm court");
    for (rating, class) in [
        (29.0, itf::Pace::Slow),
        (30.0, itf::Pace::MediumSlow),
        (39.4, itf::Pace::Medium),
        (44.0, itf::Pace::MediumFast),
        (44.65, itf::Pace::Fast),
    ] {
        assert_eq!(itf::pace(rating), class, "{rating}");
    }
}

#[test]
fn a_rolling_ball_feels_no_friction_and_never_reaches_the_transition() {
    let incoming = launch_at(70.0, 1.0);
    let (out, _) = mu_e::impact(&incoming, &STEEL_ON_CERAMIC, SOLID_SPHERE);
    assert_eq!(out.velocity_m_s.x, 1.0);
    assert_eq!(out.surface_spin_m_s, incoming.surface_spin_m_s);
    let angle = mu_e::transition_angle_rad(&STEEL_ON_CERAMIC, 1.0, SOLID_SPHERE);
    assert_eq!(angle, std::f64::consts::FRAC_PI_2);
}

#[test]
fn frictionless_limits_leave_the_horizontal_motion_alone() {
    let incoming = RigidMotion {
        velocity_m_s: Vector3::new(1.3, -0.2, -2.0),
        surface_spin_m_s: Vector3::new(0.4, -0.9, 0.5),
    };
    let smooth = mu_e::Parameters {
        restitution: 1.0,
        friction: 0.0,
        static_friction: 0.0,
    };
    let elastic = e_e::Parameters {
        restitution: 1.0,
        tangential_restitution_x: -1.0,
        tangential_restitution_y: -1.0,
    };
    for (out, _) in [
        mu_e::impact(&incoming, &smooth, SOLID_SPHERE),
        e_e::impact(&incoming, &elastic, SOLID_SPHERE),
    ] {
        assert_eq!(out.velocity_m_s, Vector3::new(1.3, -0.2, 2.0));
        assert_eq!(out.surface_spin_m_s, incoming.surface_spin_m_s);
    }
}

#[test]
fn garwins_superball_keeps_its_energy() {
    let ideal = e_e::Parameters {
        restitution: 1.0,
        tangential_restitution_x: 1.0,
        tangential_restitution_y: 1.0,
    };
    let incoming = launch_at(40.0, -0.8);
    let (out, _) = e_e::impact(&incoming, &ideal, SOLID_SPHERE);
    close(
        out.energy_j_kg(SOLID_SPHERE),
        incoming.energy_j_kg(SOLID_SPHERE),
        1e-12,
        "energy",
    );
}

#[derive(Debug, Clone, Copy)]
enum Model {
    MuE(mu_e::Parameters),
    EE(e_e::Parameters),
    GripSlide(grip_slide::Parameters),
}

impl Model {
    fn impact(&self, incoming: &RigidMotion, k: f64) -> RigidMotion {
        match self {
            Self::MuE(p) => mu_e::impact(incoming, p, k).0,
            Self::EE(p) => e_e::impact(incoming, p, k).0,
            Self::GripSlide(p) => grip_slide::impact(incoming, p, k).0,
        }
    }
}

fn any_model() -> impl Strategy<Value = Model> {
    let coefficient = 0.0..=1.0f64;
    prop_oneof![
        (coefficient.clone(), 0.0..=1.5f64, 0.0..=0.5f64).prop_map(|(restitution, friction, more)| {
            Model::MuE(mu_e::Parameters {
                restitution,
                friction,
                static_friction: friction + more,
            })
        }),
        (coefficient.clone(), -1.0..=1.0f64, -1.0..=1.0f64).prop_map(|(restitution, x, y)| Model::EE(
            e_e::Parameters {
                restitution,
                tangential_restitution_x: x,
                tangential_restitution_y: y
            }
        )),
        (coefficient, -1.0..=1.0f64, 0.0..=1.5f64).prop_map(|(restitution, x, friction)| Model::GripSlide(
            grip_slide::Parameters {
                restitution,
                tangential_restitution_x: x,
                friction
            }
        )),
    ]
}

fn any_motion() -> impl Strategy<Value = RigidMotion> {
    (
        [-10.0..10.0f64, -10.0..10.0f64, -10.0..-0.01f64],
        prop::array::uniform3(-20.0..20.0f64),
    )
        .prop_map(|(v, w)| RigidMotion {
            velocity_m_s: Vector3::from(v),
            surface_spin_m_s: Vector3::from(w),
        })
}

proptest! {
    #[test]
    fn no_impact_gains_energy(model in any_model(), incoming in any_motion(), k in 0.1..1.0f64) {
        let out = model.impact(&incoming, k);
        prop_assert!(out.energy_j_kg(k) <= incoming.energy_j_kg(k) * (1.0 + 1e-12));
        prop_assert!(out.velocity_m_s.z >= 0.0);
    }

    // Friction acts at the contact: about any horizontal line through it, v R and k R (R w) balance.
    #[test]
    fn angular_momentum_about_the_contact_is_kept(model in any_model(), incoming in any_motion(), k in 0.1..1.0f64) {
        let out = model.impact(&incoming, k);
        let about_y = |m: &RigidMotion| m.velocity_m_s.x + k * m.surface_spin_m_s.y;
        let about_x = |m: &RigidMotion| m.velocity_m_s.y - k * m.surface_spin_m_s.x;
        prop_assert!((about_y(&out) - about_y(&incoming)).abs() < 1e-9);
        prop_assert!((about_x(&out) - about_x(&incoming)).abs() < 1e-9);
        prop_assert_eq!(out.surface_spin_m_s.z, incoming.surface_spin_m_s.z);
    }

    #[test]
    fn a_turned_impact_is_the_impact_turned(model in any_model(), incoming in any_motion(), turn in -3.0..3.0f64) {
        let turning = Rotation3::from_axis_angle(&Vector3::z_axis(), turn);
        let turned = |m: &RigidMotion| RigidMotion {
            velocity_m_s: turning * m.velocity_m_s,
            surface_spin_m_s: turning * m.surface_spin_m_s,
        };
        let (one, two) = (model.impact(&turned(&incoming), 0.4), turned(&model.impact(&incoming, 0.4)));
        prop_assert!((one.velocity_m_s - two.velocity_m_s).norm() < 1e-9);
        prop_assert!((one.surface_spin_m_s - two.surface_spin_m_s).norm() < 1e-9);
    }

    // In the mirror y → −y velocities change their y, and spin (an axial vector) its x and z.
    #[test]
    fn a_mirrored_impact_is_the_impact_mirrored(model in any_model(), incoming in any_motion()) {
        let mirrored = |m: &RigidMotion| RigidMotion {
            velocity_m_s: m.velocity_m_s.component_mul(&Vector3::new(1.0, -1.0, 1.0)),
            surface_spin_m_s: m.surface_spin_m_s.component_mul(&Vector3::new(-1.0, 1.0, -1.0)),
        };
        let (one, two) = (model.impact(&mirrored(&incoming), 0.4), mirrored(&model.impact(&incoming, 0.4)));
        prop_assert!((one.velocity_m_s - two.velocity_m_s).norm() < 1e-9);
        prop_assert!((one.surface_spin_m_s - two.surface_spin_m_s).norm() < 1e-9);
    }

    #[test]
    fn with_equal_frictions_the_transition_is_continuous(
        restitution in 0.1..1.0f64, friction in 0.01..1.0f64, spin in -2.0..0.9f64, k in 0.2..0.7f64
    ) {
        let p = mu_e::Parameters { restitution, friction, static_friction: friction };
        let g = grip_slide::Parameters { restitution, tangential_restitution_x: 0.4, friction };
        for (angle, model) in [
            (mu_e::transition_angle_rad(&p, spin, k), Model::MuE(p)),
            (grip_slide::transition_angle_rad(&g, spin, k), Model::GripSlide(g)),
        ] {
            let at = |a: f64| model.impact(&launch_at(a.to_degrees(), spin), k);
            let (below, above) = (at(angle * (1.0 - 1e-9)), at(angle * (1.0 + 1e-9)));
            prop_assert!((below.velocity_m_s.xy() - above.velocity_m_s.xy()).norm() < 1e-6);
        }
    }

    #[test]
    fn without_tangential_restitution_grip_slide_is_mu_e(
        incoming in any_motion(), restitution in 0.0..1.0f64, friction in 0.0..1.0f64
    ) {
        let p = mu_e::Parameters { restitution, friction, static_friction: friction };
        let g = grip_slide::Parameters { restitution, tangential_restitution_x: 0.0, friction };
        prop_assert_eq!(mu_e::impact(&incoming, &p, 0.4), grip_slide::impact(&incoming, &g, 0.4));
    }

    #[test]
    fn closed_forms_agree_with_the_vectors(
        angle_deg in 1.0..85.0f64, spin in -2.0..2.0f64, restitution in 0.1..1.0f64, e_x in -1.0..1.0f64,
        friction in 0.0..1.0f64, k in 0.2..0.7f64
    ) {
        let incoming = launch_at(angle_deg, spin);
        let tangent = angle_deg.to_radians().tan();
        let tan_phi = |m: &RigidMotion| m.velocity_m_s.x / m.velocity_m_s.z;
        let p = mu_e::Parameters { restitution, friction, static_friction: friction };
        let (out, regime) = mu_e::impact(&incoming, &p, k);
        let expected = if regime == Regime::Sliding {
            mu_e::sliding_rebound_tangent(&p, tangent, spin)
        } else {
            mu_e::nonsliding_rebound_tangent(restitution, tangent, spin, k)
        }
        .unwrap();
        prop_assert!((tan_phi(&out) - expected).abs() < 1e-9 * (1.0 + expected.abs()));
        let p = e_e::Parameters { restitution, tangential_restitution_x: e_x, tangential_restitution_y: e_x };
        let (out, _) = e_e::impact(&incoming, &p, k);
        let expected = e_e::rebound_tangent(&p, tangent, spin, k).unwrap();
        prop_assert!((tan_phi(&out) - expected).abs() < 1e-9 * (1.0 + expected.abs()));
        // R w_y = R w_oy + (v_ox - v_x)/k, the spin a recording gives.
        let spin_out = spin + (1.0 - out.velocity_m_s.x) / k;
        prop_assert!((out.surface_spin_m_s.y - spin_out).abs() < 1e-9 * (1.0 + spin_out.abs()));
    }

    #[test]
    fn an_impulse_of_nothing_is_a_mirror(incoming in any_motion()) {
        let out = apply_impulse(&incoming, 1.0, nalgebra::Vector2::zeros(), 0.4);
        prop_assert_eq!(out.velocity_m_s.xy(), incoming.velocity_m_s.xy());
        prop_assert_eq!(out.velocity_m_s.z, -incoming.velocity_m_s.z);
        prop_assert!(slip_share(0.4) > 0.285 && slip_share(0.4) < 0.286);
    }
}
