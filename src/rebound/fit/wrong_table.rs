//! Whether a table looks as if it were made by one of the mistakes that tables are made by: millimetres for metres, radians for
//! degrees, angles from the floor in place of from its normal, x_o and x interchanged.
//!
//! Nothing is put right; a note says what seems to be the matter, by which numbers, and how to mend it.
//!
//! * **Units of lengths and speeds** show in the fall itself, whatever the bounce does: a launch at u_o that lands at x_o fell from
//!   h = g x_o² / (2 u_o²), and came in at tan θ = u_o² / (g x_o). Lengths in millimetres make 20 cm 200 km. The units that would
//!   make the fall one of a laboratory are named.
//! * **Radians** show in that no angle exceeds π/2.
//! * **Angles from the floor, and distances interchanged**, have plausible values. There the rows are fitted as they stand and as
//!   they would be without the mistake: numbers of the same kind with the same errors, so that χ² compares the two. A table is
//!   taken for a wrong one only where the models (one of which need not be right) describe it far better the other way around, or
//!   only then with coefficients that a bounce can have.

use super::estimate;
use super::group_data::GroupData;
use super::series::{Column, ColumnSet, GRAVITY_M_S2, Note, Reading, Row, Series, Weights};
use super::variants;
use crate::numeric::robust::median;
use crate::rebound::ModelName;
use std::f64::consts::FRAC_PI_2;

/// Models that are quick to fit.
const QUICK: [ModelName; 3] = [ModelName::MuE, ModelName::EE, ModelName::GripSlide];

/// Rows that are looked at; of more, every n-th.
const ROWS: usize = 120;

/// Fewer rows are described by any law.
const LEAST_ROWS: usize = 6;

/// Heights of a fall that a camera may see: a ball that drops from higher is no longer in free fall (a golf ball is at three
/// quarters of its final speed after 100 m), and below the least it moves by less than a pixel.
const HEIGHTS_M: std::ops::RangeInclusive<f64> = 1e-4..=100.0;

/// Heights and tangents of incidence of launches in a laboratory, for the units to be guessed by.
const USUAL_HEIGHTS_M: std::ops::RangeInclusive<f64> = 2e-3..=10.0;
const USUAL_TANGENTS: std::ops::RangeInclusive<f64> = 0.02..=60.0;

/// Tangent of incidence above which no ball comes in: 0.3 degrees from grazing.
const MOST_TANGENT: f64 = 200.0;

/// The speed of sound: no ball of a laboratory is faster.
const MOST_SPEED_M_S: f64 = 340.0;

/// By how much χ² has to fall for the other reading of a table to be believed, and what it has to be of the degrees of freedom
/// as the table stands, for something to be the matter at all.
const BETTER: f64 = 4.0;
const POOR: f64 = 2.0;

/// What seems to be the matter with the rows of a group, at `indices` of the series.
pub(super) fn look(series: &Series, indices: &[usize]) -> Vec<Note> {
    let step = indices.len().div_ceil(ROWS).max(1);
    let rows: Vec<&Row> = indices.iter().step_by(step).map(|&i| &series.rows[i]).collect();
    let found = match series.set {
        ColumnSet::Velocities => too_fast(&rows),
        ColumnSet::Angles => radians(&rows).or_else(|| from_the_floor(series, &rows)),
        ColumnSet::Distances => units_of_launches(&rows).or_else(|| interchanged(series, &rows)),
    };
    found.into_iter().collect()
}

fn values<'a>(rows: &'a [&Row], column: Column) -> impl Iterator<Item = f64> + 'a {
    rows.iter().filter_map(move |row| row.value(column))
}

fn middle(numbers: impl Iterator<Item = f64>) -> Option<f64> {
    median(&mut numbers.collect::<Vec<_>>())
}

fn too_fast(rows: &[&Row]) -> Option<Note> {
    let fast = |column: &Column| {
        let speed = middle(values(rows, *column).map(f64::abs))?;
        (speed > MOST_SPEED_M_S).then_some((column.name(), speed))
    };
    let fast: Vec<(&str, f64)> = ColumnSet::Velocities.required().iter().filter_map(fast).collect();
    let (_, speed) = fast.first()?;
    let names: Vec<&str> = fast.iter().map(|(name, _)| *name).collect();
    Some(Note {
        code: "units_look_wrong",
        message: format!(
            "half of the rows are faster than {speed:.0} m/s ({}), above the speed of sound. Are these millimetres a second? The \
             columns are in m/s: multiply by 0.001, and so their deviations.",
            names.join(", ")
        ),
    })
}

fn radians(rows: &[&Row]) -> Option<Note> {
    let largest = [Column::IncidentAngle, Column::ReboundAngle]
        .into_iter()
        .flat_map(|column| values(rows, column))
        .fold(0.0, |most: f64, angle| most.max(angle.abs()));
    (rows.len() > 1 && largest > 0.0 && largest <= FRAC_PI_2).then(|| Note {
        code: "units_look_wrong",
        message: format!(
            "no angle exceeds {largest:.3}, so that all balls would come and go within {largest:.1} degrees of the vertical. Are \
             these radians (of which a right angle has 1.571)? The columns are in degrees: multiply by 57.29578, and so their \
             deviations."
        ),
    })
}

/// Height of the fall and tangent of incidence of a launch.
fn fall(row: &Row) -> Option<(f64, f64)> {
    let (x0, speed) = (row.value(Column::X0)?, row.value(Column::LaunchSpeed)?);
    let gravity = row.value(Column::Gravity).unwrap_or(GRAVITY_M_S2);
    Some((
        0.5 * gravity * (x0 / speed).powi(2),
        speed * speed / (gravity * x0),
    ))
}

fn units_of_launches(rows: &[&Row]) -> Option<Note> {
    const UNITS: [(f64, &str); 3] = [(1.0, "m"), (1e-2, "cm"), (1e-3, "mm")];
    /// Where launches are likeliest, for the nearest units to be named.
    const TYPICAL_HEIGHT_M: f64 = 0.3;
    const TYPICAL_TANGENT: f64 = 1.0;
    let falls: Vec<(f64, f64)> = rows.iter().filter_map(|row| fall(row)).collect();
    let height = middle(falls.iter().map(|fall| fall.0))?;
    let tangent = middle(falls.iter().map(|fall| fall.1))?;
    if HEIGHTS_M.contains(&height) && tangent <= MOST_TANGENT {
        return None;
    }
    let pairs = UNITS
        .iter()
        .flat_map(|length| UNITS.iter().map(move |speed| (length, speed)));
    let likeliest = pairs
        .map(|(length, speed)| {
            let ratio = length.0 / speed.0;
            let (h, tan) = (height * ratio * ratio, tangent * speed.0 / ratio);
            (length, speed, h, tan)
        })
        .filter(|(.., h, tan)| USUAL_HEIGHTS_M.contains(h) && USUAL_TANGENTS.contains(tan))
        .min_by(|a, b| {
            let off =
                |h: f64, tan: f64| (h / TYPICAL_HEIGHT_M).ln().abs() + (tan / TYPICAL_TANGENT).ln().abs();
            off(a.2, a.3).total_cmp(&off(b.2, b.3))
        });
    let mend = match likeliest {
        Some((length, speed, h, _)) => {
            let mut columns = Vec::new();
            if length.0 < 1.0 {
                columns.push(format!(
                    "x0_m and x_m in {} (multiply by {}, and so their deviations)",
                    length.1, length.0
                ));
            }
            if speed.0 < 1.0 {
                columns.push(format!(
                    "launch_speed_m_s in {}/s (multiply by {}, and so its deviation)",
                    speed.1, speed.0
                ));
            }
            format!("Are {}? That would be {h:.3} m", columns.join(" and "))
        }
        None => "Check the units of x0_m (m), launch_speed_m_s (m/s) and gravity_m_s2 (m/s²)".to_owned(),
    };
    let angle = tangent.atan().to_degrees();
    Some(Note {
        code: "units_look_wrong",
        message: format!(
            "by x0_m and launch_speed_m_s the balls fell {} before they landed, coming in at {angle:.2} degrees from the \
             vertical (the middle of the rows), which no launch in a laboratory does. {mend}.",
            in_words(height)
        ),
    })
}

fn in_words(metres: f64) -> String {
    match metres {
        m if m >= 1000.0 => format!("{:.3} km", m / 1000.0),
        m if m >= 0.01 => format!("{m:.3} m"),
        m => format!("{:.2e} mm", 1000.0 * m),
    }
}

fn from_the_floor(series: &Series, rows: &[&Row]) -> Option<Note> {
    // From the floor no angle is negative.
    let none_negative = [Column::IncidentAngle, Column::ReboundAngle]
        .into_iter()
        .flat_map(|column| values(rows, column))
        .all(|angle| angle > 0.0);
    if !none_negative {
        return None;
    }
    let turned = |row: &Row| {
        let mut turned = row.clone();
        for column in [Column::IncidentAngle, Column::ReboundAngle] {
            turned.set(
                column,
                row.reading(column).map(|reading| Reading {
                    value: 90.0 - reading.value,
                    ..reading
                }),
            );
        }
        turned
    };
    let why = instead(series, rows, turned)?;
    Some(Note {
        code: "angles_look_from_floor",
        message: format!(
            "{why} if the angles are measured from the floor. The columns are angles from the floor's normal (the vertical): put \
             90 less each angle, and leave the deviations."
        ),
    })
}

fn interchanged(series: &Series, rows: &[&Row]) -> Option<Note> {
    let turned = |row: &Row| {
        let mut turned = row.clone();
        turned.set(Column::X0, row.reading(Column::X));
        turned.set(Column::X, row.reading(Column::X0));
        turned
    };
    if !values(rows, Column::X).all(|x| x > 0.0) {
        return None;
    }
    let why = instead(series, rows, turned)?;
    Some(Note {
        code: "columns_look_interchanged",
        message: format!(
            "{why} if x0_m and x_m are interchanged. x0_m is from the edge of the launch to the first impact, x_m from there to \
             the second: give each column the other's name, and so their deviations."
        ),
    })
}

/// How well the models describe rows.
struct Description {
    /// Least χ² of all, and of those with coefficients that a bounce can have.
    chi2: f64,
    possible: Option<f64>,
    freedom: f64,
    /// χ² of nothing but rounding.
    rounding: f64,
}

/// Why the rows are likelier with `turned` in place of each; `None` where they are not.
fn instead(series: &Series, rows: &[&Row], turned: impl Fn(&Row) -> Row) -> Option<String> {
    if rows.len() < LEAST_ROWS {
        return None;
    }
    let as_it_stands =
        |models: &[ModelName]| description(series, rows.iter().map(|row| (*row).clone()).collect(), models);
    let quick = as_it_stands(&QUICK)?;
    let enough = match series.weights {
        Weights::Stated => POOR * quick.freedom,
        Weights::Unit => 10.0 * quick.rounding,
    };
    if quick.possible.is_some_and(|chi2| chi2 <= enough) {
        return None;
    }
    let other_way = |models: &[ModelName]| {
        let turned = rows.iter().map(|row| turned(row)).collect();
        description(series, turned, models)?.possible
    };
    let likelier = |stated: &Description, other: f64| match stated.possible {
        Some(poor) => BETTER * other < poor,
        None => other <= POOR * stated.chi2,
    };
    if !likelier(&quick, other_way(&QUICK)?) {
        return None;
    }
    // Then all the models, as the rows may follow the one that takes its time.
    let (stated, other) = (as_it_stands(&ModelName::ALL)?, other_way(&ModelName::ALL)?);
    likelier(&stated, other).then(|| match stated.possible {
        Some(poor) => format!(
            "the rows lie {:.1} times nearer to the models",
            (poor / other.max(f64::MIN_POSITIVE)).sqrt().min(999.0)
        ),
        None => "the rows give coefficients that a bounce can have only".to_owned(),
    })
}

/// The rows by some models.
fn description(series: &Series, rows: Vec<Row>, models: &[ModelName]) -> Option<Description> {
    let indices: Vec<usize> = (0..rows.len()).collect();
    let part = Series {
        name: String::new(),
        groups: Vec::new(),
        rows,
        set_aside: Vec::new(),
        notes: Vec::new(),
        ..*series
    };
    let (data, _) = GroupData::new(&part, &indices, None);
    if data.rows.len() < LEAST_ROWS {
        return None;
    }
    let solutions = variants::of_models(&data, models);
    let least = |found: &mut dyn Iterator<Item = f64>| found.min_by(f64::total_cmp);
    Some(Description {
        chi2: least(&mut solutions.iter().map(|s| s.best.chi2))?,
        possible: least(
            &mut solutions
                .iter()
                .filter(|s| estimate::is_possible(&data, s))
                .map(|s| s.best.chi2),
        ),
        freedom: (data.equations() as f64 - 3.0).max(1.0),
        rounding: data.rounding * data.rows.len() as f64,
    })
}
