//! `fit` on tables as people make them: wrong units, angles from the floor, columns interchanged; and on long ones.

use crate::noise::Noise;
use crate::series::{
    self, Deviations, EXACT, Maker, TRACK, Truth, angles, compliant, distances, e_e, fitted, grip_slide,
    mu_e, series as made, spread, velocities,
};
use track::rebound::ModelName;
use track::rebound::fit::{self, Column, GroupFit, Options, Parameter, Preferred, Reading, Row, Series};

/// What a table looks wrong by.
const CODES: [&str; 3] = [
    "units_look_wrong",
    "angles_look_from_floor",
    "columns_look_interchanged",
];

fn suspicions(group: &GroupFit) -> Vec<(&'static str, String)> {
    let notes = group.notes.iter().filter(|note| CODES.contains(&note.code));
    notes.map(|note| (note.code, note.message.clone())).collect()
}

/// With `factor` on the numbers of some columns and on their deviations.
fn scaled(series: &Series, columns: &[Column], factor: f64) -> Series {
    changed(series, |row| {
        for &column in columns {
            let reading = row.reading(column).map(|reading| Reading {
                value: factor * reading.value,
                std: reading.std.map(|std| factor * std),
            });
            row.set(column, reading);
        }
    })
}

fn changed(series: &Series, change: impl Fn(&mut Row)) -> Series {
    let mut rows = series.rows.clone();
    rows.iter_mut().for_each(change);
    Series::new("changed", rows, Vec::new()).expect("rows as before")
}

fn table(truth: &Truth, make: Maker, deviations: Deviations) -> Series {
    made(
        truth,
        &spread(12.0, 80.0, 24),
        0.0,
        make,
        deviations,
        &mut Noise(7),
    )
}

/// Balls of the paper and of hard contacts.
fn truths() -> [Truth; 6] {
    [
        mu_e(0.78, 0.07, 0.07),
        mu_e(0.78, 0.2, 0.2),
        mu_e(0.9, 0.12, 0.16),
        grip_slide(0.96, 0.5, 0.4),
        e_e(0.9, 0.5),
        compliant(0.95, 0.12, 0.9),
    ]
}

#[track_caller]
fn assert_told(series: &Series, code: &str, words: &[&str]) {
    let found = suspicions(&fitted(series));
    let [(told, message)] = &found[..] else {
        panic!("{found:?}");
    };
    assert_eq!(*told, code, "{message}");
    for word in words {
        assert!(message.contains(word), "{message}");
    }
}

#[test]
fn millimetres_for_metres_are_told() {
    for truth in truths() {
        let right = table(&truth, distances, TRACK);
        let wrong = scaled(&right, &[Column::X0, Column::X], 1000.0);
        assert_told(&wrong, "units_look_wrong", &["km", "x0_m and x_m in mm", "0.001"]);
        let all = [Column::X0, Column::X, Column::LaunchSpeed];
        assert_told(
            &scaled(&right, &all, 1000.0),
            "units_look_wrong",
            &["x0_m and x_m in mm"],
        );
        let speed = scaled(&right, &[Column::LaunchSpeed], 1000.0);
        assert_told(&speed, "units_look_wrong", &["launch_speed_m_s in mm/s"]);
    }
    let right = table(&mu_e(0.78, 0.2, 0.2), velocities, TRACK);
    let all = [
        Column::IncidentVx,
        Column::IncidentVz,
        Column::ReboundVx,
        Column::ReboundVz,
    ];
    assert_told(
        &scaled(&right, &all, 1000.0),
        "units_look_wrong",
        &["millimetres a second"],
    );
}

#[test]
fn radians_for_degrees_are_told() {
    for truth in truths() {
        let wrong = scaled(
            &table(&truth, angles, TRACK),
            &[Column::IncidentAngle, Column::ReboundAngle],
            1_f64.to_radians(),
        );
        assert_told(&wrong, "units_look_wrong", &["radians", "57.29578"]);
    }
}

fn from_floor(series: &Series) -> Series {
    changed(series, |row| {
        for column in [Column::IncidentAngle, Column::ReboundAngle] {
            let reading = row.reading(column).map(|reading| Reading {
                value: 90.0 - reading.value,
                ..reading
            });
            row.set(column, reading);
        }
    })
}

#[test]
fn angles_from_the_floor_are_told() {
    for truth in truths() {
        for deviations in [TRACK, EXACT] {
            let wrong = from_floor(&table(&truth, angles, deviations));
            if matches!(truth, Truth::EE(_)) {
                // Rows that all grip have tan φ in one proportion to tan θ, and so have the angles from the floor.
                continue;
            }
            assert_told(&wrong, "angles_look_from_floor", &["90 less each angle"]);
        }
    }
}

#[test]
fn distances_interchanged_are_told() {
    for truth in truths() {
        let wrong = changed(&table(&truth, distances, TRACK), |row| {
            let (x0, x) = (row.reading(Column::X0), row.reading(Column::X));
            row.set(Column::X0, x);
            row.set(Column::X, x0);
        });
        if matches!(truth, Truth::EE(_)) {
            // Rows that all grip have x in one proportion to x0.
            continue;
        }
        assert_told(&wrong, "columns_look_interchanged", &["x0_m", "x_m"]);
    }
}

#[test]
fn right_tables_are_not_suspected() {
    let coarse = Deviations {
        velocity: 0.02,
        angle_deg: 1.0,
        distance_m: 2e-3,
    };
    for truth in truths() {
        for make in [velocities as Maker, angles, distances] {
            for deviations in [TRACK, coarse, EXACT] {
                let spin_ratio = if deviations.velocity == TRACK.velocity {
                    1.2
                } else {
                    0.0
                };
                let noise = &mut Noise(1);
                let series = made(
                    &truth,
                    &spread(12.0, 80.0, 16),
                    spin_ratio,
                    make,
                    deviations,
                    noise,
                );
                let found = suspicions(&fitted(&series));
                assert!(
                    found.is_empty(),
                    "{truth:?} {deviations:?} {spin_ratio}: {found:?}"
                );
            }
        }
    }
}

#[test]
fn published_tables_are_not_suspected() {
    for name in ["fig3", "fig4", "kharaz2001"] {
        let path = format!("{}/fixtures/series/{name}.csv", env!("CARGO_MANIFEST_DIR"));
        let series = fit::csv::read(path.as_ref()).unwrap();
        for group in fit::fit(&series, &Options::default()).groups {
            let found = suspicions(&group);
            assert!(found.is_empty(), "{name} {}: {found:?}", group.name);
        }
    }
}

/// A long table, as text: μ-e, with the noise that its deviations say.
fn long_table(rows: usize) -> String {
    let truth = mu_e(0.78, 0.2, 0.2);
    let noise = &mut Noise(3);
    let mut text =
        "incident_angle_deg,incident_angle_deg_std,rebound_angle_deg,rebound_angle_deg_std,spin_ratio,recording\n"
            .to_owned();
    for angle_deg in spread(8.0, 75.0, rows) {
        let row = angles(
            1,
            &series::bounce(&truth, 1.0, angle_deg, 0.0),
            TRACK,
            true,
            noise,
        );
        let cells = [Column::IncidentAngle, Column::ReboundAngle].map(|column| {
            let reading = row.reading(column);
            reading.map_or_else(String::new, |r| {
                format!("{:.5},{}", r.value, r.std.unwrap_or(0.0))
            })
        });
        text.push_str(&format!(
            "{},{},0,day2/launch-at-{angle_deg:.3}.mp4\n",
            cells[0], cells[1]
        ));
    }
    text
}

/// What `docs/accuracy.md` shows for a million rows.
#[test]
fn a_long_table_is_fitted_right() {
    const ROWS: usize = 20_000;
    let text = long_table(ROWS);
    assert!(text.len() > 1 << 20, "it is read in several parts");
    let series = fit::csv::parse(text.as_bytes(), "long.csv").unwrap();
    assert_eq!(
        series.rows[ROWS - 1].recording(),
        Some("day2/launch-at-75.000.mp4")
    );
    let group = fitted(&series);
    assert_eq!(group.rows_used.len(), ROWS);
    assert_eq!(
        group.preferred,
        Preferred::Model(ModelName::MuE),
        "{}",
        group.reason
    );
    let model = group.model(ModelName::MuE).unwrap();
    for (parameter, truth) in [(Parameter::Restitution, 0.78), (Parameter::Friction, 0.2)] {
        let quantity = model.parameter(parameter).quantity().unwrap();
        let std = quantity.std_uncertainty.unwrap();
        assert!(
            (quantity.value - truth).abs() < 4.0 * std,
            "{parameter:?} {quantity:?}"
        );
        assert!(std < 1e-4, "{parameter:?} {quantity:?}");
    }
    assert!(model.p_value.unwrap() > 1e-3);
    // Sliding begins at tan θ = 3.5 · 0.2 · 1.78: 51.25 of the 8 to 75 degrees.
    let sliding = model.sliding as f64 / ROWS as f64;
    assert!((sliding - (75.0 - 51.25) / 67.0).abs() < 0.01, "{sliding}");
}

/// Refuted recordings of a batch come in on request, but for bounces that no fit could use.
#[test]
fn refuted_rows_are_kept_on_request() {
    let left_out = format!("its fall contradicts g; {}", fit::csv::KEPT_ON_REQUEST);
    let text = format!(
        "incident_angle_deg,rebound_angle_deg,left_out\n30,35,\n40,45,{left_out}\n50,55,its floor is not known\n"
    );
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("series.csv");
    std::fs::write(&path, text).unwrap();
    let numbers = |series: &Series| series.rows.iter().map(|row| row.number).collect::<Vec<_>>();
    let series = fit::csv::read(&path).unwrap();
    assert_eq!(numbers(&series), [1]);
    assert_eq!(series.set_aside[0].reason, left_out);
    let series = fit::csv::read_with(&path, fit::csv::RefutedRecordings::Kept).unwrap();
    assert_eq!(numbers(&series), [1, 2]);
    assert!(series.notes.iter().any(|note| note.code == "refuted_rows"));
}
