//! `fit` on series whose truth is known: the paper's balls and launches, published data, exactness, agreement with an
//! independent solution, what intervals and preferences are worth, and what breaks such programs.

use crate::noise::Noise;
use crate::series::{
    self, Deviations, EXACT, Maker, TRACK, Truth, angles, bounce, distances, e_e, fitted, grip_slide,
    is_null, model, mu_e, near, sound, spread, value, velocities,
};
use rayon::prelude::*;
use track::rebound::fit::{
    self, Column, Fitted, GroupFit, ModelName, Options, Parameter, Preferred, Row, RowRegime, Series, Weights,
};
use track::rebound::{SOLID_SPHERE, grip_slide as grip_slide_model, mu_e as mu_e_model};

const SETS: [(&str, Maker); 3] = [
    ("velocities", velocities),
    ("angles", angles),
    ("distances", distances),
];

fn transition_deg(truth: &Truth, spin_ratio: f64) -> Option<f64> {
    match truth {
        Truth::MuE(p) => Some(mu_e_model::transition_angle_rad(p, spin_ratio, SOLID_SPHERE).to_degrees()),
        Truth::GripSlide(p) => {
            Some(grip_slide_model::transition_angle_rad(p, spin_ratio, SOLID_SPHERE).to_degrees())
        }
        Truth::EE(_) | Truth::Compliant(_) => None,
    }
}

#[test]
fn val_fig_3_three_balls() {
    for seed in 0..12 {
        let mut noise = Noise(seed);
        for (name, truth, preferred) in [
            ("steel", mu_e(0.78, 0.07, 0.07), ModelName::MuE),
            ("golf", mu_e(0.90, 0.12, 0.12), ModelName::MuE),
            ("superball", e_e(0.96, 0.50), ModelName::EE),
        ] {
            let group = fitted(&series::series(
                &truth,
                &spread(12.0, 60.0, 8),
                0.0,
                velocities,
                TRACK,
                &mut noise,
            ));
            sound(&group);
            let what = format!("{name}, seed {seed}: {}", group.reason);
            assert_eq!(group.preferred, Preferred::Model(preferred), "{what}");
            let fit = model(&group, preferred);
            match truth {
                Truth::MuE(p) => {
                    near(value(fit, Parameter::Restitution), p.restitution, 0.002, &what);
                    near(value(fit, Parameter::Friction), p.friction, 0.003, &what);
                    let angle = fit.transition.angle_rad.quantity().unwrap().value.to_degrees();
                    near(angle, transition_deg(&truth, 0.0).unwrap(), 0.5, &what);
                }
                Truth::EE(p) => {
                    near(value(fit, Parameter::Restitution), p.restitution, 0.002, &what);
                    near(
                        value(fit, Parameter::TangentialRestitution),
                        p.tangential_restitution_x,
                        0.005,
                        &what,
                    );
                    // (The compliant contact has an e_x that stays only for one friction.)
                    for name in ModelName::ALL
                        .into_iter()
                        .filter(|name| *name != ModelName::Compliant)
                    {
                        is_null(model(&group, name), Parameter::Friction);
                    }
                }
                Truth::GripSlide(_) | Truth::Compliant(_) => unreachable!(),
            }
        }
    }
}

#[test]
fn val_fig_4_five_launches() {
    let truth = mu_e(0.78, 0.07, 0.07);
    for seed in 0..6 {
        for (set, make) in [SETS[0], SETS[2]] {
            let mut noise = Noise(40 + seed);
            for (name, spin) in [
                ("S1", 1.60),
                ("S2", 1.09),
                ("Sr", 0.0),
                ("Ss", -0.21),
                ("So", 1.0),
            ] {
                let mut made = series::series(&truth, &spread(14.0, 58.0, 9), spin, make, TRACK, &mut noise);
                if name == "Ss" {
                    // Struck by a cue ball: nobody knows its spin.
                    for row in &mut made.rows {
                        row.set(Column::SpinIn, None);
                        row.set(Column::SpinRatio, None);
                    }
                }
                let group = fitted(&made);
                sound(&group);
                let fit = model(&group, ModelName::MuE);
                let what = format!("{name} by {set}, seed {seed}: {}", group.reason);
                let e = fit.parameter(Parameter::Restitution).quantity().unwrap();
                // Of Ss, distances hold e only through the rows that slide.
                near(
                    e.value,
                    0.78,
                    0.002_f64.max(3.0 * e.std_uncertainty.unwrap()),
                    &what,
                );
                if matches!(name, "S2" | "So") {
                    is_null(fit, Parameter::Friction);
                    continue;
                }
                let mu = fit.parameter(Parameter::Friction).quantity().unwrap();
                near(
                    mu.value,
                    0.07,
                    0.003_f64.max(3.0 * mu.std_uncertainty.unwrap()),
                    &what,
                );
                let angle = fit.transition.angle_rad.quantity().unwrap().value.to_degrees();
                let std = fit
                    .transition
                    .without_jump_rad
                    .map_or(0.0, |q| q.std_uncertainty.unwrap().to_degrees());
                near(
                    angle,
                    transition_deg(&truth, spin).unwrap(),
                    0.5_f64.max(3.0 * std),
                    &what,
                );
                if name == "Ss" {
                    let ratio = fit.parameter(Parameter::SpinRatio).quantity().unwrap();
                    near(ratio.value, -0.21, 3.5 * ratio.std_uncertainty.unwrap(), &what);
                    assert!(ratio.std_uncertainty.unwrap() < 0.03, "{what}");
                } else {
                    is_null(fit, Parameter::SpinRatio);
                }
            }
        }
    }
}

/// What the paper's figures hold: e, μ, e_x, and the transition in degrees.
#[test]
fn val_the_fixtures_give_the_papers_figures_back() {
    const STEEL: (f64, f64) = (0.78, 0.07);
    let groups = |name: &str| fit::fit(&fixture(name), &Options::default()).groups;
    let all: Vec<GroupFit> = ["fig3", "fig4"].into_iter().flat_map(groups).collect();
    assert_eq!(all.len(), 8);
    for group in &all {
        let name = group.name.as_str();
        let what = format!("{name}: {}", group.reason);
        assert!(group.rows_set_aside.is_empty(), "{what}");
        let (e, mu, spin) = match name {
            "superball" => {
                let preferred = [ModelName::EE, ModelName::GripSlide].map(Preferred::Model);
                assert!(preferred.contains(&group.preferred), "{what}");
                let fit = group.shown().unwrap();
                near(value(fit, Parameter::Restitution), 0.96, 0.002, &what);
                near(value(fit, Parameter::TangentialRestitution), 0.5, 0.005, &what);
                group
                    .models
                    .iter()
                    .for_each(|fit| is_null(fit, Parameter::Friction));
                continue;
            }
            "golf ball" => (0.90, 0.12, 0.0),
            "S1" => (STEEL.0, STEEL.1, 1.60),
            "S2" => (STEEL.0, STEEL.1, 1.09),
            "Ss" => (STEEL.0, STEEL.1, -0.21),
            "So" => (STEEL.0, STEEL.1, 1.00),
            _ => (STEEL.0, STEEL.1, 0.0),
        };
        let fit = model(group, ModelName::MuE);
        near(value(fit, Parameter::Restitution), e, 0.002, &what);
        if matches!(name, "S2" | "So") {
            // These two balls never slide.
            is_null(fit, Parameter::Friction);
            continue;
        }
        assert_eq!(group.preferred, Preferred::Model(ModelName::MuE), "{what}");
        near(value(fit, Parameter::Friction), mu, 0.003, &what);
        let angle = fit.transition.angle_rad.quantity().unwrap().value.to_degrees();
        near(angle, transition_deg(&mu_e(e, mu, mu), spin).unwrap(), 0.5, &what);
    }
}

fn fixture(name: &str) -> Series {
    let path = format!("{}/fixtures/series/{name}.csv", env!("CARGO_MANIFEST_DIR"));
    fit::csv::read(path.as_ref()).unwrap()
}

#[test]
fn val_kharaz_2001_slides_above_32_degrees() {
    let mut all = fixture("kharaz2001");
    all.rows.retain(|row| {
        let (x, z) = (
            row.value(Column::IncidentVx).unwrap(),
            row.value(Column::IncidentVz).unwrap(),
        );
        (x / -z).atan().to_degrees() > 32.0
    });
    assert_eq!(all.rows.len(), 3);
    let group = fitted(&all);
    let fit = model(&group, ModelName::MuE);
    println!("{:?}", fit.parameter(Parameter::Friction));
    near(value(fit, Parameter::Friction), 0.092, 0.003, "sliding friction");
    assert_eq!((fit.sliding, fit.gripping), (3, 0));
    assert_eq!(
        group.preferred,
        Preferred::Model(ModelName::MuE),
        "{}",
        group.reason
    );
    is_null(fit, Parameter::StaticFriction);
    assert!(fit.transition.angle_rad.reason().is_some());
}

#[test]
fn val_kharaz_2001_fits_no_model_with_constant_coefficients() {
    let group = fitted(&fixture("kharaz2001"));
    assert_eq!(
        group.rows_used.len(),
        8,
        "no row is to blame: {:?}",
        group.rows_set_aside
    );
    // The one that does is that of tests/compliant_fit.rs.
    for fit in &group.models {
        let fits = fit.p_value.unwrap() >= fit::LEAST_PROBABILITY;
        assert_eq!(fits, fit.name == ModelName::Compliant, "{:?}", fit.name);
    }
}

#[test]
fn exact_rows_return_the_parameters() {
    let cases = [
        (mu_e(0.78, 0.07, 0.07), spread(10.0, 60.0, 9), 0.0),
        (mu_e(0.90, 0.12, 0.12), spread(10.0, 60.0, 9), 0.0),
        (mu_e(0.78, 0.07, 0.07), spread(10.0, 60.0, 9), 1.6),
        (mu_e(0.52, 0.10, 0.15), spread(20.0, 65.0, 12), 0.0),
        (mu_e(0.78, 0.2, 0.2), spread(10.0, 80.0, 9), -0.5),
        (grip_slide(0.96, 0.5, 0.25), spread(10.0, 65.0, 12), 0.0),
        (grip_slide(0.7, -0.4, 0.1), spread(10.0, 65.0, 12), 0.1),
        (e_e(0.96, 0.5), spread(10.0, 65.0, 8), 0.3),
    ];
    for (truth, at, spin) in cases {
        for (set, make) in SETS {
            for stated in [false, true] {
                let mut noise = Noise(1);
                let rows: Vec<Row> = at
                    .iter()
                    .enumerate()
                    .map(|(i, &angle)| {
                        // Angles and distances hold e and e_x apart only in rows with different spins.
                        let other = matches!(truth, Truth::EE(_)) && i % 2 == 0;
                        let b = bounce(&truth, 1.0, angle, if other { -0.5 } else { spin });
                        let exact = make(i + 1, &b, EXACT, false, &mut noise);
                        let deviated = make(i + 1, &b, TRACK, true, &mut noise);
                        if stated {
                            with_deviations_of(&exact, &deviated)
                        } else {
                            exact
                        }
                    })
                    .collect();
                let group = fitted(&Series::new("exact", rows, Vec::new()).unwrap());
                let what = format!("{truth:?} by {set}, stated {stated}: {}", group.reason);
                sound(&group);
                assert!(
                    group.rows_set_aside.is_empty(),
                    "{what} {:?}",
                    group.rows_set_aside
                );
                let (e, mu, e_x, name) = match truth {
                    Truth::MuE(p) => (p.restitution, Some(p.friction), None, ModelName::MuE),
                    Truth::GripSlide(p) => (
                        p.restitution,
                        Some(p.friction),
                        Some(p.tangential_restitution_x),
                        ModelName::GripSlide,
                    ),
                    Truth::EE(p) => (
                        p.restitution,
                        None,
                        Some(p.tangential_restitution_x),
                        ModelName::EE,
                    ),
                    Truth::Compliant(_) => unreachable!(),
                };
                assert_eq!(group.preferred, Preferred::Model(name), "{what}");
                let fit = model(&group, name);
                near(value(fit, Parameter::Restitution), e, 1e-9, &what);
                if let Some(mu) = mu {
                    near(value(fit, Parameter::Friction), mu, 1e-9, &what);
                }
                if let Some(e_x) = e_x {
                    near(value(fit, Parameter::TangentialRestitution), e_x, 1e-9, &what);
                }
                if let Truth::MuE(p) = truth {
                    let interval = fit.transition.angle_rad.estimate().unwrap().interval_95;
                    let angle = transition_deg(&truth, spin).unwrap().to_radians();
                    assert!(
                        interval.0.unwrap() <= angle + 1e-9 && interval.1.unwrap() >= angle - 1e-9,
                        "{what}: {interval:?} {angle} {p:?}"
                    );
                }
            }
        }
    }
}

/// The numbers of one row with the deviations of another.
fn with_deviations_of(numbers: &Row, deviations: &Row) -> Row {
    let mut row = numbers.clone();
    for column in Column::ALL {
        if let (Some(mut reading), Some(other)) = (numbers.reading(column), deviations.reading(column)) {
            reading.std = other.std;
            row.set(column, Some(reading));
        }
    }
    row
}

#[test]
fn e_e_needs_rows_with_two_spins_where_the_columns_hold_only_a_product() {
    let truth = e_e(0.96, 0.5);
    for (set, make) in [SETS[1], SETS[2]] {
        let mut noise = Noise(3);
        let mut rows = Vec::new();
        for (i, angle) in spread(10.0, 60.0, 10).into_iter().enumerate() {
            let spin = if i % 2 == 0 { 0.0 } else { 0.8 };
            rows.push(make(
                i + 1,
                &bounce(&truth, 1.0, angle, spin),
                TRACK,
                true,
                &mut noise,
            ));
        }
        let one_spin: Vec<Row> = rows.iter().step_by(2).cloned().collect();
        let group = fitted(&Series::new("two spins", rows, Vec::new()).unwrap());
        let fit = model(&group, ModelName::EE);
        near(value(fit, Parameter::Restitution), 0.96, 0.01, set);
        near(value(fit, Parameter::TangentialRestitution), 0.5, 0.02, set);
        let group = fitted(&Series::new("one spin", one_spin, Vec::new()).unwrap());
        sound(&group);
        let fit = model(&group, ModelName::EE);
        is_null(fit, Parameter::Restitution);
        is_null(fit, Parameter::TangentialRestitution);
        // The paper's own argument: rolling would need e = 1.2.
        if set == "angles" {
            assert!(
                model(&group, ModelName::MuE)
                    .impossible
                    .as_ref()
                    .unwrap()
                    .contains("1.2"),
                "{:?}",
                group.models
            );
            assert_eq!(
                group.preferred,
                Preferred::Model(ModelName::EE),
                "{}",
                group.reason
            );
        }
    }
}

/// The least χ² by another road: the true incidence of every row is a parameter like the others, derivatives are
/// differences of the models' own functions, the normal equations are solved whole.
mod independent {
    use nalgebra::{DMatrix, DVector, Vector3};
    use track::rebound::fit::{Column, ColumnSet, Row, Series};
    use track::rebound::{RigidMotion, SOLID_SPHERE, grip_slide};

    /// e, e_x, μ of grip-slide; `free` tells which of them move. μ-e with μ_o = μ is e_x = 0.
    pub fn solve(series: &Series, start: [f64; 3], free: [bool; 3]) -> ([f64; 3], f64) {
        let mut x: Vec<f64> = start.to_vec();
        for row in &series.rows {
            x.extend(latent(series.set, row));
        }
        let moves: Vec<usize> = (0..x.len()).filter(|&i| i >= 3 || free[i]).collect();
        let mut best = residuals(series, &x).norm_squared();
        let mut damping = 1e-9;
        for _ in 0..300 {
            let r = residuals(series, &x);
            let mut jacobian = DMatrix::zeros(r.len(), moves.len());
            for (column, &i) in moves.iter().enumerate() {
                let step = 1e-6 * x[i].abs().max(0.1);
                let at = |sign: f64| {
                    let mut moved = x.clone();
                    moved[i] += sign * step;
                    residuals(series, &moved)
                };
                jacobian.set_column(column, &((at(1.0) - at(-1.0)) / (2.0 * step)));
            }
            let mut normal = jacobian.transpose() * &jacobian;
            for i in 0..moves.len() {
                normal[(i, i)] *= 1.0 + damping;
            }
            let step = normal.lu().solve(&(-jacobian.transpose() * &r)).unwrap();
            let mut moved = x.clone();
            for (&i, s) in moves.iter().zip(step.iter()) {
                moved[i] += s;
            }
            let chi2 = residuals(series, &moved).norm_squared();
            if chi2 <= best {
                let gain = best - chi2;
                (x, best) = (moved, chi2);
                damping = (damping * 0.1).max(1e-12);
                if gain < 1e-13 * (1.0 + best) {
                    break;
                }
            } else {
                damping = (damping * 10.0).max(1e-6);
            }
        }
        ([x[0], x[1], x[2]], best)
    }

    fn latent(set: ColumnSet, row: &Row) -> Vec<f64> {
        let of = |c: Column| row.value(c).unwrap();
        match set {
            ColumnSet::Velocities => vec![of(Column::IncidentVx), of(Column::IncidentVz)],
            ColumnSet::Angles => vec![of(Column::IncidentAngle)],
            ColumnSet::Distances => vec![of(Column::X0), of(Column::LaunchSpeed)],
        }
    }

    fn residuals(series: &Series, x: &[f64]) -> DVector<f64> {
        let model = grip_slide::Parameters {
            restitution: x[0],
            tangential_restitution_x: x[1],
            friction: x[2],
        };
        let per_row = latent(series.set, &series.rows[0]).len();
        let mut r = Vec::new();
        for (i, row) in series.rows.iter().enumerate() {
            let t = &x[3 + per_row * i..3 + per_row * (i + 1)];
            let mut push = |column: Column, computed: f64| {
                let reading = row.reading(column).unwrap();
                r.push((reading.value - computed) / reading.std.unwrap());
            };
            let ratio = row.value(Column::SpinRatio).unwrap_or(0.0);
            let impact = |vx: f64, vz: f64, spin: f64| {
                let incoming = RigidMotion {
                    velocity_m_s: Vector3::new(vx, 0.0, vz),
                    surface_spin_m_s: Vector3::new(0.0, spin, 0.0),
                };
                grip_slide::impact(&incoming, &model, SOLID_SPHERE).0.velocity_m_s
            };
            match series.set {
                ColumnSet::Velocities => {
                    let after = impact(t[0], t[1], row.value(Column::SpinIn).unwrap());
                    push(Column::IncidentVx, t[0]);
                    push(Column::IncidentVz, t[1]);
                    push(Column::ReboundVx, after.x);
                    push(Column::ReboundVz, after.z);
                }
                ColumnSet::Angles => {
                    let (sin, cos) = t[0].to_radians().sin_cos();
                    let after = impact(sin, -cos, ratio * sin);
                    push(Column::IncidentAngle, t[0]);
                    push(Column::ReboundAngle, after.x.atan2(after.z).to_degrees());
                }
                ColumnSet::Distances => {
                    let g = 9.81;
                    let after = impact(t[1], -g * t[0] / t[1], ratio * t[1]);
                    push(Column::X0, t[0]);
                    push(Column::LaunchSpeed, t[1]);
                    push(Column::X, after.x * 2.0 * after.z / g);
                }
            }
        }
        DVector::from_vec(r)
    }
}

#[test]
fn noisy_rows_agree_with_an_independent_solution() {
    let rough = Deviations {
        velocity: 0.01,
        angle_deg: 0.5,
        distance_m: 0.002,
    };
    let mut compared = 0;
    let mut compare = |made: &Series, name: ModelName, truth: [f64; 3], free: [bool; 3], what: &str| {
        let group = fitted(made);
        let fit = model(&group, name);
        // A jump is a model of its own.
        if name == ModelName::MuE && fit.transition.without_jump_rad.is_none() {
            return;
        }
        let parameters = [
            Parameter::Restitution,
            Parameter::TangentialRestitution,
            Parameter::Friction,
        ];
        let found: [f64; 3] = std::array::from_fn(|i| {
            if free[i] {
                value(fit, parameters[i])
            } else {
                truth[i]
            }
        });
        // From the truth, and from where the fit says the least is: the latter stays there only if it is.
        let (best, chi2) = [truth, found]
            .map(|start| independent::solve(made, start, free))
            .into_iter()
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap();
        near(fit.chi2, chi2, 1e-5, what);
        for i in (0..3).filter(|&i| free[i]) {
            near(found[i], best[i], 1e-6, &format!("{what}: {:?}", parameters[i]));
        }
        compared += 1;
    };
    for (set, make) in SETS {
        for (seed, d) in [(1, TRACK), (2, TRACK), (3, rough), (4, rough)] {
            let mut noise = Noise(seed);
            let mut made =
                |truth: &Truth, at: &[f64], spin: f64| series::series(truth, at, spin, make, d, &mut noise);
            let steel = made(&mu_e(0.78, 0.07, 0.07), &spread(12.0, 62.0, 10), 0.0);
            let what = format!("μ-e by {set}, seed {seed}");
            compare(
                &steel,
                ModelName::MuE,
                [0.78, 0.0, 0.07],
                [true, false, true],
                &what,
            );
            let both = made(&grip_slide(0.9, 0.4, 0.2), &spread(12.0, 70.0, 12), 0.1);
            let what = format!("grip-slide by {set}, seed {seed}");
            compare(&both, ModelName::GripSlide, [0.9, 0.4, 0.2], [true; 3], &what);
            if set == "velocities" {
                let superball = made(&e_e(0.96, 0.5), &spread(12.0, 60.0, 8), 0.0);
                let what = format!("e-e by {set}, seed {seed}");
                // A friction that is never reached.
                compare(
                    &superball,
                    ModelName::EE,
                    [0.96, 0.5, 50.0],
                    [true, true, false],
                    &what,
                );
            }
        }
    }
    assert!(compared >= 27, "compared {compared} of 28");
}

/// Series of each scenario. With [`CHANCE`] an interval of 95 % may hold the truth in 89.7 to 100 % of them; one that holds it in 87 % of all
/// cases is caught with a probability of 83 %, one that holds it in 85 % with 95 %.
const SERIES: usize = 150;

/// Standard deviations that a share may be off by: few, as the seeds are fixed.
const CHANCE: f64 = 3.0;

/// Counts of intervals that hold the truth, and of their number.
#[derive(Default)]
struct Tally(std::collections::BTreeMap<&'static str, (usize, usize)>);

impl Tally {
    fn put(&mut self, name: &'static str, fitted: &Fitted, truth: f64) {
        if let Some(estimate) = fitted.estimate() {
            let (low, high) = estimate.interval_95;
            let holds = low.is_none_or(|l| l <= truth) && high.is_none_or(|h| h >= truth);
            let entry = self.0.entry(name).or_default();
            entry.0 += usize::from(holds);
            entry.1 += 1;
        }
    }

    /// Within what 95 % gives by chance: [`CHANCE`] standard deviations of a binomial. `wide` intervals may hold it more often.
    fn check(&self, what: &str, wide: &[&str]) {
        for (name, &(held, of)) in &self.0 {
            let n = of as f64;
            let share = held as f64 / n;
            let chance = CHANCE * (0.95 * 0.05 / n).sqrt();
            println!("{what} {name}: {:.1} % of {of}", 100.0 * share);
            assert!(share > 0.95 - chance, "{what}: {name} held in {held} of {of}");
            assert!(
                wide.contains(name) || share < 0.95 + chance,
                "{what}: {name} held in {held} of {of}"
            );
        }
    }
}

/// A scenario of many series.
struct Scenario<'a> {
    name: &'a str,
    truth: Truth,
    model: ModelName,
    angles: (f64, f64, usize),
    spin: f64,
    make: Maker,
    weights: Weights,
    series: usize,
}

/// One of its series.
fn one_series(scenario: &Scenario<'_>, noise: &mut Noise) -> Series {
    let (from, to, count) = scenario.angles;
    let mut at = spread(from, to, count);
    for angle in &mut at {
        *angle += (noise.uniform() - 0.5) * (to - from) / count as f64;
    }
    let stated = scenario.weights == Weights::Stated;
    let deviations = if stated {
        TRACK
    } else {
        // Without stated deviations all velocities scatter the same.
        Deviations {
            velocity: 0.0,
            ..TRACK
        }
    };
    let rows: Vec<Row> = at
        .iter()
        .enumerate()
        .map(|(i, &angle)| {
            let b = bounce(&scenario.truth, 1.0, angle, scenario.spin);
            let mut row = (scenario.make)(i + 1, &b, deviations, stated, noise);
            if !stated {
                for column in [
                    Column::IncidentVx,
                    Column::IncidentVz,
                    Column::ReboundVx,
                    Column::ReboundVz,
                ] {
                    let noisy = row.value(column).unwrap() + 2e-3 * noise.normal();
                    row = row.with(column, noisy, None);
                }
            }
            row
        })
        .collect();
    Series::new(scenario.name, rows, Vec::new()).unwrap()
}

fn run(scenario: &Scenario<'_>) {
    let Scenario {
        name, truth, spin, ..
    } = scenario;
    let mut noise = Noise(2005);
    let made: Vec<Series> = (0..scenario.series)
        .map(|_| one_series(scenario, &mut noise))
        .collect();
    let fits: Vec<GroupFit> = made.par_iter().map(fitted).collect();
    let mut tally = Tally::default();
    let (mut preferred, mut set_aside, mut failed) = (0, 0, 0);
    for group in &fits {
        sound(group);
        preferred += usize::from(group.preferred == Preferred::Model(scenario.model));
        set_aside += group.rows_set_aside.len();
        let fit = model(group, scenario.model);
        failed += usize::from(fit.p_value.is_some_and(|p| p < fit::LEAST_PROBABILITY));
        let (e, e_x, mu, mu_o, kappa) = match truth {
            Truth::MuE(p) => (
                p.restitution,
                None,
                Some(p.friction),
                Some(p.static_friction),
                None,
            ),
            Truth::EE(p) => (p.restitution, Some(p.tangential_restitution_x), None, None, None),
            Truth::GripSlide(p) => (
                p.restitution,
                Some(p.tangential_restitution_x),
                Some(p.friction),
                None,
                None,
            ),
            Truth::Compliant(p) => (
                p.restitution,
                None,
                Some(p.friction),
                None,
                Some(p.stiffness_ratio),
            ),
        };
        tally.put("e", fit.parameter(Parameter::Restitution), e);
        for (name, parameter, truth) in [
            ("e_x", Parameter::TangentialRestitution, e_x),
            ("mu", Parameter::Friction, mu),
            ("mu_o", Parameter::StaticFriction, mu_o),
            ("kappa", Parameter::StiffnessRatio, kappa),
        ] {
            if let Some(truth) = truth {
                tally.put(name, fit.parameter(parameter), truth);
            }
        }
        if let Some(angle) = transition_deg(truth, *spin) {
            tally.put("transition", &fit.transition.angle_rad, angle.to_radians());
        }
    }
    let n = scenario.series as f64;
    println!("{name}: preferred {preferred}, {set_aside} rows set aside, {failed} fail the test of fit");
    assert!(preferred as f64 >= 0.95 * n, "{name}: {preferred} of {n}");
    assert!(
        set_aside as f64 <= 0.01 * n,
        "{name}: {set_aside} good rows set aside"
    );
    assert!(
        (failed as f64) < 0.01 * n + CHANCE * (0.01 * n).sqrt(),
        "{name}: {failed} good fits fail"
    );
    // Static friction may be above friction wherever no row tells; its bounds allow for that.
    tally.check(name, &["mu_o", "transition"]);
}

#[test]
fn intervals_cover_and_the_true_model_is_preferred_by_velocities() {
    for (name, truth, model, angles, spin) in [
        (
            "steel",
            mu_e(0.78, 0.07, 0.07),
            ModelName::MuE,
            (10.0, 60.0, 8),
            0.0,
        ),
        (
            "golf",
            mu_e(0.90, 0.12, 0.12),
            ModelName::MuE,
            (10.0, 60.0, 8),
            0.0,
        ),
        ("superball", e_e(0.96, 0.5), ModelName::EE, (10.0, 60.0, 8), 0.0),
        (
            "grip-slide",
            grip_slide(0.96, 0.5, 0.25),
            ModelName::GripSlide,
            (10.0, 70.0, 10),
            0.0,
        ),
        (
            "wood",
            mu_e(0.52, 0.10, 0.15),
            ModelName::MuE,
            (25.0, 60.0, 12),
            0.0,
        ),
        ("S1", mu_e(0.78, 0.07, 0.07), ModelName::MuE, (10.0, 60.0, 8), 1.6),
    ] {
        run(&Scenario {
            name,
            truth,
            model,
            angles,
            spin,
            make: velocities,
            weights: Weights::Stated,
            series: SERIES,
        });
    }
}

fn steel_and_grip_slide(set: &str, make: Maker) {
    for (name, truth, model, angles) in [
        ("steel", mu_e(0.78, 0.07, 0.07), ModelName::MuE, (10.0, 60.0, 8)),
        (
            "grip-slide",
            grip_slide(0.96, 0.5, 0.25),
            ModelName::GripSlide,
            (10.0, 70.0, 10),
        ),
    ] {
        run(&Scenario {
            name: &format!("{name}, {set}"),
            truth,
            model,
            angles,
            spin: 0.0,
            make,
            weights: Weights::Stated,
            series: SERIES,
        });
    }
}

#[test]
fn intervals_cover_and_the_true_model_is_preferred_by_angles() {
    steel_and_grip_slide("angles", angles);
}

#[test]
fn intervals_cover_and_the_true_model_is_preferred_by_distances() {
    steel_and_grip_slide("distances", distances);
}

#[test]
fn without_deviations_the_scatter_gives_intervals_that_cover() {
    run(&Scenario {
        name: "steel, no deviations",
        truth: mu_e(0.78, 0.07, 0.07),
        model: ModelName::MuE,
        angles: (10.0, 60.0, 10),
        spin: 0.0,
        make: velocities,
        weights: Weights::Unit,
        // With these the bound is that of 300 within four standard deviations.
        series: 171,
    });
}

#[test]
fn a_hundred_thousand_rows() {
    let mut noise = Noise(8);
    let truth = mu_e(0.52, 0.10, 0.15);
    let at: Vec<f64> = (0..100_000).map(|_| 15.0 + 50.0 * noise.uniform()).collect();
    let group = fitted(&series::series(&truth, &at, 0.0, velocities, TRACK, &mut noise));
    sound(&group);
    assert_eq!(
        group.preferred,
        Preferred::Model(ModelName::MuE),
        "{}",
        group.reason
    );
    let fit = model(&group, ModelName::MuE);
    assert!(fit.p_value.unwrap() > 0.001, "{fit:?}");
    assert!(group.rows_set_aside.len() < 3);
    for (parameter, truth, within) in [
        (Parameter::Restitution, 0.52, 2e-5),
        (Parameter::Friction, 0.10, 5e-5),
        (Parameter::StaticFriction, 0.15, 1e-3),
    ] {
        near(value(fit, parameter), truth, within, "of many rows");
    }
}

#[test]
fn a_third_of_outliers_is_set_aside_and_nothing_else() {
    for (name, truth, preferred) in [
        ("steel", mu_e(0.78, 0.07, 0.07), ModelName::MuE),
        ("superball", e_e(0.96, 0.5), ModelName::EE),
        ("wood", mu_e(0.52, 0.10, 0.15), ModelName::MuE),
    ] {
        for (count, seed) in [(30, 1), (30, 2), (60, 3), (900, 4)] {
            let mut noise = Noise(seed);
            let mut made = series::series(
                &truth,
                &spread(15.0, 62.0, count),
                0.0,
                velocities,
                TRACK,
                &mut noise,
            );
            let mut spoilt = Vec::new();
            for row in &mut made.rows {
                if noise.uniform() < 0.3 && 10 * (spoilt.len() + 1) <= 3 * count {
                    let column = if noise.uniform() < 0.7 {
                        Column::ReboundVx
                    } else {
                        Column::ReboundVz
                    };
                    let mut reading = row.reading(column).unwrap();
                    let off = 0.05 + 0.4 * noise.uniform();
                    reading.value *= 1.0 + if noise.uniform() < 0.5 { off } else { -off };
                    row.set(column, Some(reading));
                    spoilt.push(row.number);
                }
            }
            let group = fitted(&made);
            sound(&group);
            let found: Vec<usize> = group.rows_set_aside.iter().map(|a| a.row).collect();
            let what = format!("{name} of {count}: {}", group.reason);
            assert_eq!(found, spoilt, "{what}");
            assert_eq!(group.preferred, Preferred::Model(preferred), "{what}");
            assert!(
                group.rows_set_aside.iter().all(|a| a.reason.contains("expected")),
                "{what}"
            );
            let fit = model(&group, preferred);
            assert!(fit.p_value.unwrap() > 1e-4, "{what}");
        }
    }
}

#[test]
fn rows_that_tell_the_models_apart_stay() {
    let mut noise = Noise(11);
    // One row that leaves rolling, one that slides, rows between friction and static friction.
    let mostly_sliding = [spread(30.0, 60.0, 9), vec![15.0]].concat();
    let mostly_rolling = [spread(8.0, 22.0, 9), vec![55.0]].concat();
    let beside_the_jump = [spread(29.0, 38.0, 5), spread(40.0, 60.0, 7)].concat();
    for (truth, at) in [
        (mu_e(0.78, 0.07, 0.07), &mostly_sliding),
        (mu_e(0.78, 0.07, 0.07), &mostly_rolling),
        (grip_slide(0.96, 0.5, 0.2), &mostly_sliding),
        (grip_slide(0.96, 0.5, 0.2), &mostly_rolling),
        (mu_e(0.52, 0.10, 0.15), &beside_the_jump),
    ] {
        for (set, make) in SETS {
            let group = fitted(&series::series(&truth, at, 0.0, make, TRACK, &mut noise));
            assert!(
                group.rows_set_aside.is_empty(),
                "{truth:?} by {set}: {:?}",
                group.rows_set_aside
            );
        }
    }
}

/// Tangential velocity ratio of Kharaz 2001, straight between its points: e_x rises and falls with the angle.
fn compliant(angle_deg: f64) -> f64 {
    const POINTS: [(f64, f64); 8] = [
        (1.84, 0.79344),
        (3.703, 0.74533),
        (9.496, 0.67257),
        (20.012, 0.59691),
        (30.127, 0.68756),
        (39.382, 0.77148),
        (49.694, 0.84761),
        (60.02, 0.90142),
    ];
    let pair = POINTS.windows(2).find(|p| angle_deg <= p[1].0).unwrap();
    let share = (angle_deg - pair[0].0) / (pair[1].0 - pair[0].0);
    pair[0].1 + share * (pair[1].1 - pair[0].1)
}

#[test]
fn a_law_that_the_models_lack_is_no_mishap() {
    // Most rows slide as μ-e has it; those below 30 degrees follow a law of their own.
    for below in [4, 8, 12] {
        let mut noise = Noise(22);
        let at = [spread(3.0, 24.0, below), spread(33.0, 59.0, 24)].concat();
        let rows: Vec<Row> = at
            .iter()
            .enumerate()
            .map(|(i, &angle)| {
                let (sin, cos) = angle.to_radians().sin_cos();
                let (vx, vz) = (3.9 * sin, 3.9 * cos);
                let mut row = Row::new(i + 1, "all").with(Column::SpinIn, 0.0, None);
                for (column, v) in [
                    (Column::IncidentVx, vx),
                    (Column::IncidentVz, -vz),
                    (Column::ReboundVx, compliant(angle) * vx),
                    (Column::ReboundVz, 0.98 * vz),
                ] {
                    row = row.with(column, v + 0.01 * noise.normal(), Some(0.01));
                }
                row
            })
            .collect();
        let group = fitted(&Series::new("compliant", rows, Vec::new()).unwrap());
        sound(&group);
        assert!(
            group.rows_set_aside.is_empty(),
            "{below}: {:?}",
            group.rows_set_aside
        );
        let codes: Vec<&str> = group.notes.iter().map(|n| n.code).collect();
        // Of four, one e_x makes a fair job; the compliant contact is this very law, but for how it was digitised.
        let fits_a_bend = group.preferred == Preferred::Model(ModelName::Compliant);
        assert!(
            below == 4 || fits_a_bend || codes.contains(&"no_model_fits"),
            "{below}: {codes:?} {}",
            group.reason
        );
    }
}

#[test]
fn what_no_row_tells_is_null_with_a_reason() {
    let mut noise = Noise(12);
    let steel = mu_e(0.78, 0.07, 0.07);
    let mut at = |from: f64, to: f64| {
        fitted(&series::series(
            &steel,
            &spread(from, to, 10),
            0.0,
            velocities,
            TRACK,
            &mut noise,
        ))
    };
    let rolling = at(5.0, 19.0);
    for name in ModelName::ALL {
        is_null(model(&rolling, name), Parameter::Friction);
        is_null(model(&rolling, name), Parameter::StaticFriction);
    }
    assert_eq!(rolling.preferred, Preferred::Undetermined, "{}", rolling.reason);
    let sliding = at(35.0, 60.0);
    let fit = model(&sliding, ModelName::MuE);
    near(value(fit, Parameter::Friction), 0.07, 0.003, "sliding throughout");
    is_null(fit, Parameter::StaticFriction);
    is_null(
        model(&sliding, ModelName::GripSlide),
        Parameter::TangentialRestitution,
    );
    assert!(fit.transition.angle_rad.reason().unwrap().contains("slides"));
    // Far from the transition on both sides: friction is known, static friction only between wide bounds.
    let far = [spread(5.0, 10.0, 5), spread(50.0, 60.0, 5)].concat();
    let group = fitted(&series::series(&steel, &far, 0.0, velocities, TRACK, &mut noise));
    let fit = model(&group, ModelName::MuE);
    near(
        value(fit, Parameter::Friction),
        0.07,
        0.003,
        "far from the transition",
    );
    is_null(fit, Parameter::StaticFriction);
    let reason = fit.parameter(Parameter::StaticFriction).reason().unwrap();
    assert!(reason.contains("no row near the transition"), "{reason}");
    let one_angle = fitted(&series::series(
        &steel,
        &[45.0; 10],
        0.0,
        velocities,
        TRACK,
        &mut noise,
    ));
    assert_eq!(
        one_angle.preferred,
        Preferred::Undetermined,
        "{}",
        one_angle.reason
    );
}

#[test]
fn spin_unknown_in_every_row() {
    for (truth, spin) in [
        (mu_e(0.78, 0.07, 0.07), -0.3),
        (e_e(0.96, 0.5), 0.0),
        (mu_e(0.78, 0.07, 0.07), 2.2),
    ] {
        let mut noise = Noise(13);
        let mut made = series::series(
            &truth,
            &spread(8.0, 60.0, 14),
            spin,
            velocities,
            TRACK,
            &mut noise,
        );
        for row in &mut made.rows {
            row.set(Column::SpinIn, None);
        }
        let group = fitted(&made);
        sound(&group);
        is_null(model(&group, ModelName::EE), Parameter::TangentialRestitution);
        match truth {
            Truth::MuE(_) => {
                let fit = model(&group, ModelName::MuE);
                near(value(fit, Parameter::SpinRatio), spin, 0.04, "fitted spin");
                near(value(fit, Parameter::Friction), 0.07, 0.003, "friction");
                assert_eq!(
                    group.preferred,
                    Preferred::Model(ModelName::MuE),
                    "{}",
                    group.reason
                );
            }
            // Rolling with backspin or a gripping superball: the velocities do not tell.
            _ => assert_eq!(group.preferred, Preferred::Undetermined, "{}", group.reason),
        }
    }
}

#[test]
fn a_measured_spin_after_tells_the_spin_before() {
    let truth = e_e(0.9, 0.3);
    let mut noise = Noise(14);
    let rows: Vec<Row> = spread(15.0, 60.0, 10)
        .into_iter()
        .enumerate()
        .map(|(i, angle)| {
            let b = bounce(&truth, 1.0, angle, [-0.4, 0.0, 0.7][i % 3]);
            let mut row = velocities(i + 1, &b, TRACK, true, &mut noise);
            row.set(Column::SpinIn, None);
            row.with(
                Column::SpinOut,
                b.after.surface_spin_m_s.y + 2e-3 * noise.normal(),
                Some(2e-3),
            )
        })
        .collect();
    let group = fitted(&Series::new("spins", rows, Vec::new()).unwrap());
    sound(&group);
    let fit = model(&group, ModelName::EE);
    near(value(fit, Parameter::TangentialRestitution), 0.3, 0.01, "e_x");
    assert_eq!(
        group.preferred,
        Preferred::Model(ModelName::EE),
        "{}",
        group.reason
    );
}

#[test]
fn a_spin_that_was_computed_adds_nothing() {
    let truth = e_e(0.9, 0.3);
    let mut noise = Noise(15);
    let plain = series::series(&truth, &spread(15.0, 60.0, 8), 0.2, velocities, TRACK, &mut noise);
    let mut computed = plain.clone();
    for row in &mut computed.rows {
        let vx = row.value(Column::IncidentVx).unwrap() - row.value(Column::ReboundVx).unwrap();
        let after = row.value(Column::SpinIn).unwrap() + vx / 0.4;
        *row = row.clone().with(Column::SpinOut, after, Some(3e-3));
    }
    let (plain, computed) = (fitted(&plain), fitted(&computed));
    let of = |g: &GroupFit| {
        model(g, ModelName::EE)
            .parameter(Parameter::TangentialRestitution)
            .clone()
    };
    assert_eq!(of(&plain), of(&computed));
    assert_eq!(
        plain.models[1].degrees_of_freedom,
        computed.models[1].degrees_of_freedom
    );
    // One that was measured apart does add.
    let mut measured = fit_series_with_spin(&truth, &mut noise);
    let with = fitted(&measured);
    for row in &mut measured.rows {
        row.set(Column::SpinOut, None);
    }
    let without = fitted(&measured);
    let std = |g: &GroupFit| of(g).quantity().unwrap().std_uncertainty.unwrap();
    assert!(
        std(&with) < 0.9 * std(&without),
        "{} {}",
        std(&with),
        std(&without)
    );
    assert_eq!(
        with.models[1].degrees_of_freedom,
        without.models[1].degrees_of_freedom + 8
    );
}

fn fit_series_with_spin(truth: &Truth, noise: &mut Noise) -> Series {
    let rows: Vec<Row> = spread(15.0, 60.0, 8)
        .into_iter()
        .enumerate()
        .map(|(i, angle)| {
            let b = bounce(truth, 1.0, angle, 0.2);
            let after = b.after.surface_spin_m_s.y + 2e-3 * noise.normal();
            velocities(i + 1, &b, TRACK, true, noise).with(Column::SpinOut, after, Some(2e-3))
        })
        .collect();
    Series::new("spins", rows, Vec::new()).unwrap()
}

#[test]
fn correlated_errors_are_weighed_as_such() {
    // A scale that is off by as much before and after a bounce leaves e alone: with b = |v_z|, σ the same and ρ the
    // correlation of v_z with v'_z (of the other sign), var(v'z − e b) = σ² (1 + e² + 2 ρ e), for each row.
    let mut noise = Noise(16);
    let truth = e_e(0.8, 0.2);
    for rho in [-0.9, 0.0, 0.6] {
        let (std, mut rows, mut information) = (0.004, Vec::new(), 0.0);
        for (i, angle) in spread(20.0, 60.0, 9).into_iter().enumerate() {
            let b = bounce(&truth, 1.0, angle, 0.0);
            let mut row = Row::new(i + 1, "all").with(Column::SpinIn, 0.0, None);
            for (column, v) in [
                (Column::IncidentVx, b.before.velocity_m_s.x),
                (Column::IncidentVz, b.before.velocity_m_s.z),
                (Column::ReboundVx, b.after.velocity_m_s.x),
                (Column::ReboundVz, b.after.velocity_m_s.z),
            ] {
                row = row.with(column, v + 1e-9 * noise.normal(), Some(std));
            }
            rows.push(row.with_correlation(Column::IncidentVz, Column::ReboundVz, rho));
            information += (b.before.velocity_m_s.z / std).powi(2) / (1.0 + 0.64 + 2.0 * rho * 0.8);
        }
        let group = fitted(&Series::new("correlated", rows, Vec::new()).unwrap());
        let e = model(&group, ModelName::EE)
            .parameter(Parameter::Restitution)
            .quantity()
            .unwrap();
        near(
            e.std_uncertainty.unwrap(),
            information.sqrt().recip(),
            1e-7,
            &format!("ρ = {rho}"),
        );
    }
    let row = Row::new(1, "all")
        .with(Column::IncidentAngle, 30.0, Some(0.1))
        .with(Column::ReboundAngle, 28.0, Some(0.1))
        .with_correlation(Column::IncidentAngle, Column::ReboundAngle, 1.5);
    let made = Series::new("impossible", vec![row], Vec::new()).unwrap();
    assert!(
        made.set_aside[0].reason.contains("between -1 and 1"),
        "{:?}",
        made.set_aside
    );
}

#[test]
fn deviations_over_twelve_orders() {
    let truth = mu_e(0.78, 0.07, 0.07);
    for upwards in [true, false] {
        let mut noise = Noise(17);
        let rows: Vec<Row> = (0..20)
            .map(|i| {
                let order = if upwards { i } else { 19 - i };
                let std = 10_f64.powf(-12.0 + 11.0 * f64::from(order) / 19.0);
                let b = bounce(&truth, 1.0, 12.0 + 2.5 * f64::from(i), 0.0);
                let mut row = Row::new(i as usize + 1, "all").with(Column::SpinIn, 0.0, None);
                for (column, v) in [
                    (Column::IncidentVx, b.before.velocity_m_s.x),
                    (Column::IncidentVz, b.before.velocity_m_s.z),
                    (Column::ReboundVx, b.after.velocity_m_s.x),
                    (Column::ReboundVz, b.after.velocity_m_s.z),
                ] {
                    row = row.with(column, v + std * noise.normal(), Some(std));
                }
                row
            })
            .collect();
        let group = fitted(&Series::new("orders", rows, Vec::new()).unwrap());
        sound(&group);
        let fit = model(&group, ModelName::MuE);
        assert!(fit.p_value.unwrap() > 1e-3, "{fit:?}");
        for (parameter, truth) in [(Parameter::Restitution, 0.78), (Parameter::Friction, 0.07)] {
            let q = fit.parameter(parameter).quantity().unwrap();
            near(
                q.value,
                truth,
                4.0 * q.std_uncertainty.unwrap() + 1e-13,
                "over twelve orders",
            );
        }
        assert!(
            fit.parameter(Parameter::Restitution)
                .quantity()
                .unwrap()
                .std_uncertainty
                .unwrap()
                < 1e-10
        );
    }
}

#[test]
fn few_and_equal_rows() {
    let mut noise = Noise(18);
    let truth = mu_e(0.78, 0.07, 0.07);
    let row =
        |angle: f64, noise: &mut Noise| velocities(1, &bounce(&truth, 1.0, angle, 0.0), TRACK, true, noise);
    let one = fitted(&Series::new("one", vec![row(50.0, &mut noise)], Vec::new()).unwrap());
    sound(&one);
    assert_eq!(one.preferred, Preferred::Undetermined);
    let fit = model(&one, ModelName::MuE);
    near(
        value(fit, Parameter::Friction),
        0.07,
        0.005,
        "one row that slides",
    );
    assert_eq!(fit.degrees_of_freedom, 0);
    let equal = fitted(&Series::new("equal", vec![row(50.0, &mut noise); 12], Vec::new()).unwrap());
    sound(&equal);
    assert_eq!(equal.preferred, Preferred::Undetermined, "{}", equal.reason);
    let bare: Vec<Row> = (1..=12)
        .map(|i| velocities(i, &bounce(&truth, 1.0, 50.0, 0.0), EXACT, false, &mut noise))
        .collect();
    let bare = fitted(&Series::new("equal and bare", bare, Vec::new()).unwrap());
    sound(&bare);
    near(
        value(model(&bare, ModelName::MuE), Parameter::Restitution),
        0.78,
        1e-9,
        "equal rows",
    );
}

#[test]
fn a_ball_that_rolls_already_tells_nothing_of_friction() {
    for spin in [1.0, 1.0 + 1e-12, 1.0 - 1e-12] {
        for (set, make) in SETS {
            let mut noise = Noise(19);
            let group = fitted(&series::series(
                &mu_e(0.78, 0.07, 0.07),
                &spread(10.0, 60.0, 9),
                spin,
                make,
                TRACK,
                &mut noise,
            ));
            sound(&group);
            for fit in &group.models {
                is_null(fit, Parameter::Friction);
                is_null(fit, Parameter::TangentialRestitution);
                near(value(fit, Parameter::Restitution), 0.78, 0.003, set);
            }
            assert_eq!(group.preferred, Preferred::Undetermined);
        }
    }
}

/// The rows of one set, `count` of them, between two angles.
fn rows_between(truth: &Truth, from: f64, to: f64, count: usize, make: Maker, seed: u64) -> Series {
    series::series(
        truth,
        &spread(from, to, count),
        0.0,
        make,
        TRACK,
        &mut Noise(seed),
    )
}

#[test]
fn all_rows_in_one_regime_by_any_columns() {
    let steel = mu_e(0.78, 0.07, 0.07);
    for (set, make) in SETS {
        let rolling = fitted(&rows_between(&steel, 5.0, 19.0, 10, make, 31));
        sound(&rolling);
        let fit = model(&rolling, ModelName::MuE);
        near(value(fit, Parameter::Restitution), 0.78, 0.004, set);
        is_null(fit, Parameter::Friction);
        is_null(fit, Parameter::StaticFriction);
        assert_eq!((fit.sliding, fit.gripping), (0, 10), "{set}");
        let sliding = fitted(&rows_between(&steel, 33.0, 65.0, 10, make, 32));
        sound(&sliding);
        let fit = model(&sliding, ModelName::MuE);
        assert_eq!((fit.sliding, fit.gripping), (10, 0), "{set}");
        for (parameter, truth) in [(Parameter::Restitution, 0.78), (Parameter::Friction, 0.07)] {
            let q = fit.parameter(parameter).quantity().unwrap();
            near(q.value, truth, 4.0 * q.std_uncertainty.unwrap(), set);
        }
        is_null(fit, Parameter::StaticFriction);
        assert!(fit.transition.angle_rad.reason().is_some(), "{set}");
    }
}

#[test]
fn a_transition_between_two_rows_lies_between_them() {
    // No row from 18 to 30 degrees, where sliding begins at 23.6; with a jump, 38.6 between 33 and 45.
    for (truth, low, high) in [
        (mu_e(0.78, 0.07, 0.07), [10.0, 18.0], [30.0, 60.0]),
        (mu_e(0.52, 0.10, 0.15), [15.0, 33.0], [45.0, 60.0]),
    ] {
        let angle = transition_deg(&truth, 0.0).unwrap();
        for (set, make) in SETS {
            let at = [spread(low[0], low[1], 5), spread(high[0], high[1], 5)].concat();
            let group = fitted(&series::series(&truth, &at, 0.0, make, TRACK, &mut Noise(33)));
            sound(&group);
            let fit = model(&group, ModelName::MuE);
            let what = format!("{truth:?} by {set}: {:?}", fit.transition);
            assert_eq!((fit.sliding, fit.gripping), (5, 5), "{what}");
            let (from, to) = fit.transition.angle_rad.estimate().unwrap().interval_95;
            let (from, to) = (from.unwrap().to_degrees(), to.unwrap().to_degrees());
            assert!(from <= angle && angle <= to, "{what}");
            assert!(from > low[1] - 1.0 && to < high[0] + 1.0, "{what}");
        }
    }
}

#[test]
fn rows_with_a_deviation_of_zero_among_others_are_set_aside() {
    for (set, make) in SETS {
        let mut made = rows_between(&mu_e(0.78, 0.07, 0.07), 12.0, 60.0, 10, make, 34).rows;
        for column in Column::ALL {
            if let Some(mut reading) = made[4].reading(column) {
                reading.std = reading.std.map(|_| 0.0);
                made[4].set(column, Some(reading));
            }
        }
        let group = fitted(&Series::new("zero", made, Vec::new()).unwrap());
        sound(&group);
        let aside: Vec<usize> = group.rows_set_aside.iter().map(|a| a.row).collect();
        assert_eq!(aside, [5], "{set}");
        assert!(
            group.rows_set_aside[0].reason.contains("deviations are 0"),
            "{set}"
        );
        assert_eq!(group.preferred, Preferred::Model(ModelName::MuE), "{set}");
    }
}

#[test]
fn outliers_by_any_columns() {
    for (set, make) in SETS {
        let mut made = rows_between(&mu_e(0.78, 0.07, 0.07), 12.0, 60.0, 30, make, 35);
        let column = match set {
            "velocities" => Column::ReboundVx,
            "angles" => Column::ReboundAngle,
            _ => Column::X,
        };
        let spoilt = [2, 5, 9, 12, 16, 20, 23, 27, 30];
        for (i, number) in spoilt.into_iter().enumerate() {
            let row = &mut made.rows[number - 1];
            let mut reading = row.reading(column).unwrap();
            reading.value *= [1.2, 0.75, 1.5][i % 3];
            row.set(column, Some(reading));
        }
        let group = fitted(&made);
        sound(&group);
        let found: Vec<usize> = group.rows_set_aside.iter().map(|a| a.row).collect();
        assert_eq!(found, spoilt, "{set}");
        assert_eq!(group.preferred, Preferred::Model(ModelName::MuE), "{set}");
    }
}

#[test]
fn a_row_that_slides_alone_does_not_tell_more_than_it_knows() {
    // Angles hold the slope of sliding only in two rows that slide: of one, e goes with μ.
    let truth = grip_slide(0.96, 0.5, 0.25);
    let at = [spread(12.0, 40.0, 9), vec![64.0]].concat();
    let mut holds = 0;
    for seed in 0..40 {
        let group = fitted(&series::series(&truth, &at, 0.0, angles, TRACK, &mut Noise(seed)));
        sound(&group);
        let fit = model(&group, ModelName::GripSlide);
        holds += usize::from(
            fit.parameter(Parameter::Friction)
                .estimate()
                .is_none_or(|estimate| {
                    let (low, high) = estimate.interval_95;
                    low.is_none_or(|low| low <= 0.25) && high.is_none_or(|high| high >= 0.25)
                }),
        );
    }
    assert!(holds >= 35, "{holds} of 40");
}

/// What does not depend on how a series is written down.
#[test]
fn mirror_order_and_units_change_nothing() {
    let mut noise = Noise(20);
    let plain = series::series(
        &mu_e(0.78, 0.07, 0.07),
        &spread(12.0, 60.0, 10),
        0.3,
        velocities,
        TRACK,
        &mut noise,
    );
    let of = |series: &Series| {
        let group = fitted(series);
        let fit = model(&group, ModelName::MuE).clone();
        let numbers: Vec<f64> = [Parameter::Restitution, Parameter::Friction]
            .into_iter()
            .flat_map(|p| {
                let q = fit.parameter(p).quantity().unwrap();
                [q.value, q.std_uncertainty.unwrap()]
            })
            .chain([fit.chi2, fit.transition.angle_rad.quantity().unwrap().value])
            .collect();
        (numbers, group.preferred)
    };
    let same = |other: &Series, what: &str| {
        let ((a, pa), (b, pb)) = (of(&plain), of(other));
        assert_eq!(pa, pb, "{what}");
        for (x, y) in a.iter().zip(&b) {
            assert!((x - y).abs() <= 1e-7 * x.abs(), "{what}: {x} {y}");
        }
    };
    let changed = |change: &dyn Fn(&mut Row)| {
        let mut other = plain.clone();
        other.rows.iter_mut().for_each(change);
        other
    };
    let horizontal = [Column::IncidentVx, Column::ReboundVx, Column::SpinIn];
    let mirrored = changed(&|row| {
        for column in horizontal {
            let mut reading = row.reading(column).unwrap();
            reading.value = -reading.value;
            row.set(column, Some(reading));
        }
    });
    same(&mirrored, "mirror");
    let millimetres = changed(&|row| {
        for column in [Column::IncidentVz, Column::ReboundVz]
            .into_iter()
            .chain(horizontal)
        {
            let mut reading = row.reading(column).unwrap();
            reading.value *= 1e3;
            reading.std = reading.std.map(|s| s * 1e3);
            row.set(column, Some(reading));
        }
    });
    same(&millimetres, "millimetres");
    let mut reversed = plain.clone();
    reversed.rows.reverse();
    same(&reversed, "order of the rows");
}

#[test]
fn groups_are_fitted_apart() {
    let all = fixture("fig3");
    let together = fit::fit(&all, &Options::default());
    let names: Vec<&str> = together.groups.iter().map(|g| g.name.as_str()).collect();
    assert_eq!(names, ["steel", "golf ball", "superball"]);
    for group in &together.groups {
        let mut alone = all.clone();
        alone.rows.retain(|row| *row.group == *group.name);
        alone.groups = vec![group.name.clone()];
        let alone = fitted(&alone);
        assert_eq!(alone.preferred, group.preferred);
        assert_eq!(alone.models[0].chi2, group.models[0].chi2);
    }
    let fit = |i: usize| together.groups[i].shown().unwrap();
    near(value(fit(0), Parameter::Restitution), 0.78, 0.002, "steel");
    near(value(fit(1), Parameter::Friction), 0.12, 0.003, "golf ball");
    near(
        value(fit(2), Parameter::TangentialRestitution),
        0.5,
        0.005,
        "superball",
    );
}

#[test]
fn a_court_is_rated_and_gripping_is_told() {
    // e 0.85, μ 0.7: 24.00 at 23 °C (CS 01/02), fast and flat enough to slide.
    let mut noise = Noise(21);
    let rate = |truth: &Truth, at: &[f64], noise: &mut Noise| {
        let made = series::series(truth, at, 0.0, velocities, TRACK, noise);
        let options = Options {
            court_temperature_c: Some(23.0),
            ..Options::default()
        };
        fit::fit(&made, &options).groups.remove(0)
    };
    let sliding = rate(&mu_e(0.85, 0.7, 0.7), &[81.0; 8], &mut noise);
    let pace = sliding.court_pace.as_ref().unwrap();
    let rating = pace.rating.estimate().unwrap();
    near(
        rating.quantity.value,
        24.0,
        4.0 * rating.quantity.std_uncertainty.unwrap(),
        "court",
    );
    assert_eq!(pace.class, Some(track::rebound::itf::Pace::Slow));
    assert!(!sliding.notes.iter().any(|n| n.code == "rating_assumes_sliding"));
    assert!(
        sliding.models[0]
            .rows
            .iter()
            .all(|row| row.regime == RowRegime::Sliding)
    );
    let gripping = rate(&mu_e(0.85, 0.7, 0.7), &spread(60.0, 70.0, 8), &mut noise);
    assert!(
        gripping.notes.iter().any(|n| n.code == "rating_assumes_sliding"),
        "{:?}",
        gripping.notes
    );
}
