//! Series at the limits of what a fit can be asked. `fit.rs` has the same by velocities for most of them, and the outliers,
//! regimes, transitions and zero deviations by any columns; here is what it leaves: collinear rows, the other columns, and
//! numbers that no laboratory has.

use crate::noise::Noise;
use crate::series::{
    self, EXACT, Maker, TRACK, angles, bounce, distances, e_e, fitted, grip_slide, is_null, model, mu_e,
    near, sound, spread, value, velocities,
};
use rayon::prelude::*;
use track::rebound::fit::{Column, GroupFit, ModelName, Parameter, Preferred, Row, Series};

const SETS: [(&str, Maker); 3] = [
    ("velocities", velocities),
    ("angles", angles),
    ("distances", distances),
];

fn of_rows(rows: Vec<Row>) -> GroupFit {
    let group = fitted(&Series::new("hard", rows, Vec::new()).unwrap());
    sound(&group);
    group
}

/// That every coefficient that has an uncertainty is within 4.5 of them of the truth.
fn holds(group: &GroupFit, name: ModelName, truths: &[(Parameter, f64)], what: &str) {
    let fit = model(group, name);
    for &(parameter, truth) in truths {
        if let Some(q) = fit.parameter(parameter).quantity() {
            let std = q.std_uncertainty.unwrap_or(1e-6);
            assert!(
                (q.value - truth).abs() <= 4.5 * std,
                "{what}: {parameter:?} is {q:?}, not {truth}"
            );
        }
    }
}

const STEEL: [(Parameter, f64); 2] = [(Parameter::Restitution, 0.78), (Parameter::Friction, 0.07)];

#[test]
fn collinear_rows_give_what_they_hold_and_no_more() {
    // The same incidence at many speeds: every row is a multiple of the first.
    for (name, angle, slides) in [("sliding", 50.0, true), ("rolling", 15.0, false)] {
        for (set, make) in SETS {
            let mut noise = Noise(40);
            let rows: Vec<Row> = (1..=12)
                .map(|i| {
                    let speed = 0.5 + 0.2 * i as f64;
                    make(
                        i,
                        &bounce(&mu_e(0.78, 0.07, 0.07), speed, angle, 0.0),
                        TRACK,
                        true,
                        &mut noise,
                    )
                })
                .collect();
            let group = of_rows(rows);
            let fit = model(&group, ModelName::MuE);
            let what = format!("{name} by {set}");
            holds(&group, ModelName::MuE, &STEEL, &what);
            match (set, slides) {
                // v_z/|v_oz|, and the loss of v_x, each by itself.
                ("velocities", true) => {
                    near(value(fit, Parameter::Restitution), 0.78, 0.003, &what);
                    near(value(fit, Parameter::Friction), 0.07, 0.003, &what);
                }
                ("velocities", false) => {
                    near(value(fit, Parameter::Restitution), 0.78, 0.003, &what);
                    is_null(fit, Parameter::Friction);
                }
                // One number, which e and μ make together, or e alone if the ball rolled off: the rows do not say.
                _ => {
                    is_null(fit, Parameter::Restitution);
                    is_null(fit, Parameter::Friction);
                }
            }
            // Nothing parts the models at one incidence, but that rows slide at all.
            assert_ne!(group.preferred, Preferred::Model(ModelName::GripSlide), "{what}");
        }
    }
}

#[test]
fn one_row_and_equal_rows_by_any_columns() {
    for (set, make) in SETS {
        for angle in [3.0, 15.0, 50.0, 85.0] {
            for (truth, name) in [
                (mu_e(0.78, 0.07, 0.07), ModelName::MuE),
                (e_e(0.9, 0.5), ModelName::EE),
            ] {
                let row = make(1, &bounce(&truth, 1.0, angle, 0.0), TRACK, true, &mut Noise(41));
                for count in [1, 2, 12] {
                    let group = of_rows(vec![row.clone(); count]);
                    let what = format!("{count} by {set} at {angle}");
                    // Equal rows agree with each other better than their deviations say; that decides nothing.
                    assert!(
                        group.preferred == Preferred::Undetermined
                            || group.preferred == Preferred::Model(name),
                        "{what}"
                    );
                    if name == ModelName::MuE {
                        holds(&group, name, &STEEL, &what);
                    }
                }
            }
        }
    }
}

#[test]
fn deviations_over_twelve_orders_by_any_columns() {
    for (set, make) in SETS {
        let mut noise = Noise(42);
        let truth = mu_e(0.78, 0.07, 0.07);
        let rows: Vec<Row> = spread(10.0, 65.0, 14)
            .into_iter()
            .enumerate()
            .map(|(i, angle)| {
                let mut row = make(i + 1, &bounce(&truth, 1.0, angle, 0.0), EXACT, false, &mut noise);
                // From 1e-13 to 0.1 of the number itself.
                let part = 10.0_f64.powf(-13.0 + 12.0 * i as f64 / 13.0);
                for column in Column::ALL {
                    let exact = [Column::SpinIn, Column::SpinRatio, Column::Gravity].contains(&column);
                    if let Some(mut reading) = row.reading(column).filter(|_| !exact) {
                        let std = part * reading.value.abs();
                        reading.value += std * noise.normal();
                        reading.std = Some(std);
                        row.set(column, Some(reading));
                    }
                }
                row
            })
            .collect();
        let group = of_rows(rows);
        let fit = model(&group, ModelName::MuE);
        assert!(fit.p_value.unwrap() > 1e-4, "{set}: {fit:?}");
        for (parameter, truth) in STEEL {
            let q = fit.parameter(parameter).quantity().unwrap();
            near(q.value, truth, 4.5 * q.std_uncertainty.unwrap() + 1e-12, set);
        }
    }
}

#[test]
fn deviations_that_are_all_zero_count_as_none_given() {
    for (set, make) in SETS {
        let at = spread(12.0, 60.0, 10);
        let mut rows = series::series(&mu_e(0.78, 0.07, 0.07), &at, 0.0, make, TRACK, &mut Noise(43)).rows;
        for row in &mut rows {
            for column in Column::ALL {
                if let Some(mut reading) = row.reading(column) {
                    reading.std = reading.std.map(|_| 0.0);
                    row.set(column, Some(reading));
                }
            }
        }
        let series = Series::new("zero", rows, Vec::new()).unwrap();
        assert!(
            series.notes.iter().any(|n| n.code == "deviations_all_zero"),
            "{set}"
        );
        let group = fitted(&series);
        sound(&group);
        assert_eq!(group.rows_used.len(), 10, "{set}");
        holds(&group, ModelName::MuE, &STEEL, set);
        assert!(
            model(&group, ModelName::MuE)
                .parameter(Parameter::Restitution)
                .quantity()
                .is_some(),
            "{set}"
        );
    }
}

#[test]
fn a_spin_unknown_in_every_row_by_any_columns() {
    for (set, make) in SETS {
        for spin in [0.0, 0.4, 1.6] {
            let at = spread(12.0, 62.0, 16);
            let mut rows =
                series::series(&mu_e(0.78, 0.07, 0.07), &at, spin, make, TRACK, &mut Noise(44)).rows;
            for row in &mut rows {
                row.set(Column::SpinIn, None);
                row.set(Column::SpinRatio, None);
            }
            let group = of_rows(rows);
            let what = format!("{set}, spin {spin}");
            // e_x and the spin before are one number then, and the models with it cannot be told from those without.
            let fit = model(&group, ModelName::EE);
            is_null(fit, Parameter::TangentialRestitution);
            let fit = model(&group, ModelName::MuE);
            let all = [
                (Parameter::Restitution, 0.78),
                (Parameter::Friction, 0.07),
                (Parameter::SpinRatio, spin),
            ];
            holds(&group, ModelName::MuE, &all, &what);
            if set == "velocities" {
                near(value(fit, Parameter::Restitution), 0.78, 0.003, &what);
            }
        }
    }
}

#[test]
fn a_hundred_thousand_rows_by_angles_and_distances() {
    for (set, make) in [("angles", angles as Maker), ("distances", distances)] {
        let mut noise = Noise(45);
        let at: Vec<f64> = (0..100_000).map(|_| 12.0 + 50.0 * noise.uniform()).collect();
        let group = fitted(&series::series(
            &grip_slide(0.96, 0.5, 0.2),
            &at,
            0.0,
            make,
            TRACK,
            &mut noise,
        ));
        sound(&group);
        assert_eq!(
            group.preferred,
            Preferred::Model(ModelName::GripSlide),
            "{set}: {}",
            group.reason
        );
        let all = [
            (Parameter::Restitution, 0.96),
            (Parameter::Friction, 0.2),
            (Parameter::TangentialRestitution, 0.5),
        ];
        holds(&group, ModelName::GripSlide, &all, set);
        assert!(group.rows_set_aside.len() < 5, "{set}");
    }
}

#[test]
fn numbers_that_no_laboratory_has_are_used_or_set_aside_with_a_reason() {
    let truth = mu_e(0.78, 0.07, 0.07);
    let at = spread(12.0, 60.0, 8);
    let base = || series::series(&truth, &at, 0.0, velocities, TRACK, &mut Noise(46)).rows;
    let numbers = [
        0.0,
        -0.0,
        5e-324,
        1e-300,
        1e-160,
        1e-30,
        1e-12,
        1e12,
        1e160,
        1e308,
        f64::MAX,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::NAN,
    ];
    let mut numbers: Vec<f64> = numbers.into_iter().flat_map(|x| [x, -x]).collect();
    // Nought, infinity and what is no number are among them with both signs as it is.
    numbers.sort_by(f64::total_cmp);
    numbers.dedup_by_key(|x| {
        if x.is_nan() {
            f64::NAN.to_bits()
        } else {
            x.to_bits()
        }
    });
    numbers.into_par_iter().for_each(|number| {
        for column in Column::ALL {
            for (value, std) in [
                (number, Some(1e-3)),
                (1.0, Some(number)),
                (number, Some(number.abs())),
                (number, None),
            ] {
                with_number(base(), column, value, std);
            }
        }
    });
}

/// A series of which one row has such a number in some column.
fn with_number(mut rows: Vec<Row>, column: Column, value: f64, std: Option<f64>) {
    rows[3] = rows[3].clone().with(column, value, std);
    let Ok(series) = Series::new("hard", rows, Vec::new()) else {
        return;
    };
    let what = format!("{column:?} = {value} ± {std:?}");
    let group = fitted(&series);
    sound(&group);
    assert_eq!(group.rows_used.len() + group.rows_set_aside.len(), 8, "{what}");
    assert!(group.rows_set_aside.iter().all(|a| a.reason.len() > 5));
    // The other seven rows are what they were; a row with so small a deviation that it alone counts, too.
    let ordinary = group.rows_set_aside.iter().any(|a| a.row == 4);
    if ordinary {
        holds(&group, ModelName::MuE, &STEEL, &what);
    }
}
