//! The equations against the models' own functions, their derivatives against differences.

use super::*;
use crate::rebound::fit::group_data::GroupData;
use crate::rebound::fit::observation::Spin;
use crate::rebound::fit::series::{Column, Row, Series};
use crate::rebound::{RigidMotion, e_e, grip_slide, mu_e};
use nalgebra::Vector3;

/// Every parameter free, e_x among them.
fn of(regimes: Regimes) -> Variant {
    Variant {
        model: ModelName::GripSlide,
        regimes,
        free: [true; PARAMETERS],
    }
}

const THETA: Theta = [0.8, 0.3, 0.12, 0.2, 0.0];

/// Rows of every kind: the three sets, each way to know the spin, correlated errors.
fn rows() -> Vec<Observation> {
    let velocities = |vz: f64| {
        Row::new(1, "all")
            .with(Column::IncidentVx, 1.02, Some(0.02))
            .with(Column::IncidentVz, vz, Some(0.03))
            .with(Column::ReboundVx, 0.7, Some(0.025))
            .with(Column::ReboundVz, -0.78 * vz, Some(0.015))
    };
    let angles = |theta: f64, phi: f64| {
        Row::new(1, "all")
            .with(Column::IncidentAngle, theta, Some(1.0))
            .with(Column::ReboundAngle, phi, Some(0.7))
    };
    let distances = |x0: f64, x: f64| {
        Row::new(1, "all")
            .with(Column::X0, x0, Some(0.004))
            .with(Column::X, x, Some(0.006))
            .with(Column::LaunchSpeed, 1.0, Some(0.02))
            .with(Column::Gravity, 9.8, Some(0.05))
    };
    let mut made = Vec::new();
    for vz in [-0.5, -1.6, -4.0] {
        let plain = velocities(vz);
        made.push(vec![
            plain.clone().with(Column::SpinIn, 0.1, Some(0.05)),
            plain.clone().with(Column::SpinRatio, 0.3, Some(0.02)),
            plain
                .clone()
                .with(Column::SpinIn, 2.5, None)
                .with(Column::SpinOut, 0.8, Some(0.03)),
            plain.clone().with(Column::SpinOut, 0.9, Some(0.03)),
            plain
                .clone()
                .with(Column::SpinRatio, 0.0, None)
                .with_correlation(Column::IncidentVx, Column::ReboundVx, 0.8)
                .with_correlation(Column::IncidentVz, Column::ReboundVz, -0.6),
            plain,
        ]);
    }
    for (theta, phi) in [(20.0, 17.0), (50.0, 52.0), (-35.0, -30.0)] {
        made.push(vec![
            angles(theta, phi).with(Column::SpinRatio, 0.1, Some(0.05)),
            angles(theta, phi),
        ]);
    }
    for (x0, x) in [(0.06, 0.08), (0.3, 0.3)] {
        made.push(vec![
            distances(x0, x).with(Column::SpinRatio, -0.4, None),
            distances(x0, x),
        ]);
    }
    let observed = |rows: Vec<Row>| {
        let series = Series::new("made", rows, Vec::new()).unwrap();
        let indices: Vec<usize> = (0..series.rows.len()).collect();
        let (data, aside) = GroupData::new(&series, &indices, None);
        assert!(aside.is_empty() && series.set_aside.is_empty());
        data.rows
    };
    made.into_iter()
        .flatten()
        .flat_map(|row| observed(vec![row]))
        .collect()
}

fn regimes() -> [Regimes; 5] {
    [
        Regimes::Grip,
        Regimes::Slide,
        Regimes::Continuous,
        Regimes::Jump(0.3),
        Regimes::Pinned(0.2),
    ]
}

#[test]
fn derivatives_are_those_of_chi2() {
    for row in rows() {
        for regimes in regimes() {
            let near = nearest(&row, &of(regimes), &THETA, 0.0).unwrap();
            for p in 0..PARAMETERS {
                let gradient: f64 = (0..near.equations)
                    .map(|i| 2.0 * near.residuals[i] * near.jacobian[i][p])
                    .sum();
                let step = 1e-5;
                let at = |sign: f64| {
                    let mut theta = THETA;
                    theta[p] += sign * step;
                    nearest(&row, &of(regimes), &theta, 0.0).unwrap().chi2
                };
                let difference = (at(1.0) - at(-1.0)) / (2.0 * step);
                let size = 1.0 + near.chi2 + gradient.abs();
                assert!(
                    (gradient - difference).abs() < 1e-4 * size,
                    "{:?} {:?} {regimes:?} parameter {p}: {gradient} {difference}",
                    row.set,
                    row.spin
                );
            }
        }
    }
}

#[test]
fn derivatives_of_a_law_that_bends_are_those_of_chi2() {
    const AT: Theta = [0.8, 0.0, 0.15, 0.2, 0.85];
    let bends = Variant {
        model: ModelName::Compliant,
        ..of(Regimes::Grip)
    };
    let (mut slides, mut compared, mut agree) = (0, 0, 0);
    // A spin before that comes from the one after leaves several motions near, and the nearest may change.
    for row in rows().into_iter().filter(|row| row.spin != Spin::FromAfter) {
        let near = nearest(&row, &bends, &AT, 0.0).unwrap();
        slides += usize::from(near.slides);
        for p in [E, MU, RATIO, KAPPA] {
            let gradient: f64 = (0..near.equations)
                .map(|i| 2.0 * near.residuals[i] * near.jacobian[i][p])
                .sum();
            let step = 1e-5;
            let at = |sign: f64| {
                let mut theta = AT;
                theta[p] += sign * step;
                nearest(&row, &bends, &theta, 0.0).unwrap().chi2
            };
            let difference = (at(1.0) - at(-1.0)) / (2.0 * step);
            let size = 1.0 + near.chi2 + gradient.abs();
            compared += 1;
            agree += usize::from((gradient - difference).abs() < 1e-2 * size);
        }
    }
    // Beside a bend of the law a difference over both sides of it is no derivative.
    assert!(20 * agree >= 19 * compared, "{agree} of {compared}");
    assert!(slides > 0 && slides < rows().len(), "{slides}");
}

#[test]
fn the_nearest_motion_obeys_the_model() {
    for row in rows() {
        for regimes in regimes() {
            let near = nearest(&row, &of(regimes), &THETA, 0.0).unwrap();
            let k = row.kinematics(&near.z, THETA[RATIO]);
            let incoming = RigidMotion {
                velocity_m_s: Vector3::new(k.a, 0.0, -k.b),
                surface_spin_m_s: Vector3::new(0.0, k.w, 0.0),
            };
            let e_e = e_e::Parameters {
                restitution: THETA[E],
                tangential_restitution_x: THETA[E_X],
                tangential_restitution_y: THETA[E_X],
            };
            let friction = match regimes {
                Regimes::Pinned(limit) => limit / (1.0 + THETA[E]),
                _ => THETA[MU],
            };
            let sliding = mu_e::Parameters {
                restitution: THETA[E],
                friction,
                static_friction: 0.0,
            };
            let after = if near.state.slides() {
                mu_e::impact(&incoming, &sliding, row.inertia_factor).0
            } else {
                e_e::impact(&incoming, &e_e, row.inertia_factor).0
            };
            let v = after.velocity_m_s;
            let off = match row.set {
                ColumnSet::Velocities => (near.z[2] - v.x).hypot(near.z[3] - v.z),
                ColumnSet::Angles => (near.z[1] - v.x.atan2(v.z)).abs(),
                ColumnSet::Distances => (near.z[1] - v.x * 2.0 * v.z / near.z[3]).abs(),
            };
            assert!(off < 1e-9, "{:?} {:?} {regimes:?}: {off}", row.set, row.spin);
            if row.spin_out {
                assert!((near.z[SPIN_OUT] - after.surface_spin_m_s.y).abs() < 1e-9);
            }
            if regimes == Regimes::Continuous && !near.state.on_edge() {
                let both = grip_slide::Parameters {
                    restitution: THETA[E],
                    tangential_restitution_x: THETA[E_X],
                    friction,
                };
                let same = grip_slide::impact(&incoming, &both, row.inertia_factor).0;
                assert!(
                    (same.velocity_m_s - v).norm() < 1e-12,
                    "the side of the limit is the model's"
                );
            }
        }
    }
}

#[test]
fn chi2_is_continuous_where_a_row_changes_sides() {
    let row = &rows()[4];
    let chi2 = |mu: f64| {
        nearest(row, &of(Regimes::Continuous), &[0.8, 0.0, mu, 0.0, 0.0], 0.0)
            .unwrap()
            .chi2
    };
    let mut states = std::collections::HashSet::new();
    let mut before = chi2(0.02);
    for i in 1..4000 {
        let mu = 0.02 + 1e-4 * f64::from(i);
        let now = chi2(mu);
        assert!(
            (now - before).abs() < 0.02 * (1.0 + before),
            "mu {mu}: {before} {now}"
        );
        before = now;
        let near = nearest(row, &of(Regimes::Continuous), &[0.8, 0.0, mu, 0.0, 0.0], 0.0).unwrap();
        states.insert(format!("{:?}", near.state));
    }
    assert!(states.len() >= 2, "{states:?}");
}

#[test]
fn a_row_without_errors_has_no_nearest_motion() {
    let series = Series::new(
        "made",
        vec![
            Row::new(1, "all")
                .with(Column::IncidentAngle, 30.0, Some(0.0))
                .with(Column::ReboundAngle, 30.0, Some(0.0)),
            Row::new(2, "all")
                .with(Column::IncidentAngle, 40.0, Some(0.1))
                .with(Column::ReboundAngle, 40.0, Some(0.1)),
        ],
        Vec::new(),
    )
    .unwrap();
    let (data, aside) = GroupData::new(&series, &[0, 1], None);
    assert_eq!((data.rows.len(), aside.len(), aside[0].row), (1, 1, 1));
    assert!(aside[0].reason.contains("are 0"), "{}", aside[0].reason);
}

/// A row at the limit of a jump at 0.3, give or take a deviation.
fn beside_the_limit(vz: f64) -> Observation {
    let row = Row::new(1, "all")
        .with(Column::IncidentVx, 1.02, Some(0.03))
        .with(Column::IncidentVz, vz, Some(0.02))
        .with(Column::ReboundVx, 0.72, Some(0.05))
        .with(Column::ReboundVz, 1.01, Some(0.015))
        .with(Column::SpinIn, 0.0, None);
    let series = Series::new("one", vec![row], Vec::new()).unwrap();
    GroupData::new(&series, &[0], None).0.rows.remove(0)
}

#[test]
fn the_averaged_likelihood_is_the_integral_over_both_sides() {
    const LIMIT: f64 = 0.3;
    let share = 2.0 / 7.0 * (1.0 + THETA[E_X]);
    for (vz, spread) in [(-1.20, 1.0), (-1.263, 1.0), (-1.263, 4.0), (-1.31, 0.5)] {
        let row = beside_the_limit(vz);
        let chi2 = |a: f64, b: f64, grips: bool| {
            let p = if grips {
                share * a
            } else {
                THETA[MU] * (1.0 + THETA[E]) * b
            };
            let at = [a, b, a - p, THETA[E] * b];
            (0..4)
                .map(|i| (row.z[i] - at[i]).powi(2) / row.variance[i])
                .sum::<f64>()
        };
        let mut sum = 0.0;
        for grips in [true, false] {
            let (mut inside, mut whole, mut least) = (0.0, 0.0, f64::INFINITY);
            for i in -400..=400 {
                for j in -400..=400 {
                    let (a, b) = (1.02 + 0.0009 * f64::from(i), -vz + 0.0006 * f64::from(j));
                    let here = chi2(a, b, grips);
                    least = here.min(least);
                    let weight = (-0.5 * here / spread).exp();
                    whole += weight;
                    if (share * a <= LIMIT * b) == grips {
                        inside += weight;
                    }
                }
            }
            sum += (-0.5 * least / spread).exp() * inside / whole;
        }
        let integral = -2.0 * spread * sum.ln();
        let found = averaged::averaged(&row, &of(Regimes::Jump(LIMIT)), &THETA, spread).unwrap();
        assert!(
            (found - integral).abs() < 0.02,
            "{vz} {spread}: {found} {integral}"
        );
    }
}

#[test]
fn far_from_the_limit_the_averaged_likelihood_is_chi2() {
    for row in rows() {
        for limit in [1e-3, 100.0] {
            let regimes = Regimes::Jump(limit);
            let (beyond, std) = margin(&row, &of(Regimes::Grip), limit, &THETA);
            if beyond.abs() < 10.0 * std {
                continue;
            }
            let chi2 = nearest(&row, &of(regimes), &THETA, 0.0).unwrap().chi2;
            let found = averaged::averaged(&row, &of(regimes), &THETA, 1.0).unwrap();
            assert!(
                (found - chi2).abs() < 1e-6 * (1.0 + chi2),
                "{row:?} {limit}: {found} {chi2}"
            );
        }
    }
}
