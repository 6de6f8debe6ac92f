//! The series of a batch: `series.csv`, a row a bounce, from the results of its recordings.
//!
//! The columns are those of velocities, with the deviations and correlations of each bounce, and more: what `track fit` does
//! not know it leaves alone. A bounce that would mislead a fit stands there all the same, with the reason in `left_out`.
//!
//! Where a recording holds several launches, the rows of all of them stand there, with the launch's number.
//!
//! Rows count as independent in a fit. All bounces of a launch share its floor's slope (those of a recording the calibration's), though, which is often the most of a
//! coefficient's uncertainty: each of n rows has that part of its variance n times, so that the mean of the n is as uncertain as
//! the slope makes it, not 1/√n of that. What is neglected: two bounces of one launch share the arc between them, and all of
//! them the scale.

use super::BatchRecording;
use super::vetting::{DUPLICATE, LeftOut};
use crate::calibration::Calibration;
use crate::impact::{BounceSurface, Speed};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// The rows of a recording.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BounceRows(Vec<Vec<String>>);

/// Where in a row it stands why the bounce is nothing for a fit, and the codes of the recording's warnings.
const LEFT_OUT: usize = 4;
const WARNINGS: usize = 7;

/// What of a calibration stands in the table.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CalibrationNumbers {
    /// R ω_oy / u_o at the launch; `None` where nobody knows.
    pub spin_ratio: Option<f64>,
    /// g, m/s².
    pub gravity_m_s2: f64,
    /// I / (m R²) of the ball.
    pub inertia_factor: f64,
    /// κ, where the materials of ball and floor are given.
    pub stiffness_ratio: Option<f64>,
}

impl From<&Calibration> for CalibrationNumbers {
    fn from(calibration: &Calibration) -> Self {
        Self {
            spin_ratio: calibration.launch.spin_ratio,
            gravity_m_s2: calibration.gravity_m_s2,
            inertia_factor: calibration.ball.inertia_factor,
            stiffness_ratio: calibration.stiffness_ratio(),
        }
    }
}

/// What the table says of a recording beside its result.
#[derive(Debug, Clone, Copy)]
pub struct RowSource<'a> {
    /// Its name and group.
    pub recording: &'a BatchRecording,
    /// Its calibration, with the manifest's changes.
    pub calibration: CalibrationNumbers,
    /// Its page, relative to the table.
    pub page: &'a str,
}

/// Numbers of a bounce: the column, and where its result has it. The velocities are those along the floor and its normal, x and
/// z of the models: a floor that slopes by 0.1 degrees would add 0.0017 to every friction.
const OF_BOUNCE: [(&str, &str); 17] = [
    ("time_s", "/time_s"),
    ("impact_x_m", "/x_m"),
    ("incident_vx_m_s", "/along_floor/incident_tangential_m_s"),
    ("incident_vz_m_s", "/along_floor/incident_normal_m_s"),
    ("rebound_vx_m_s", "/along_floor/rebound_tangential_m_s"),
    ("rebound_vz_m_s", "/along_floor/rebound_normal_m_s"),
    ("spin_in_m_s", "/spin_in_m_s"),
    ("spin_out_m_s", "/spin_out_m_s"),
    ("measured_spin_in_m_s", "/measured_spin_in_m_s"),
    ("measured_spin_out_m_s", "/measured_spin_out_m_s"),
    ("incident_angle_deg", "/incident/angle_deg"),
    ("rebound_angle_deg", "/rebound/angle_deg"),
    ("restitution", "/restitution"),
    ("tangential_ratio", "/tangential_ratio"),
    ("friction", "/friction"),
    ("friction_at_least", "/friction_at_least"),
    ("tangential_restitution", "/tangential_restitution"),
];

/// Those without which a row is none of a fit.
const VELOCITIES: [&str; 4] = [
    "/along_floor/incident_tangential_m_s",
    "/along_floor/incident_normal_m_s",
    "/along_floor/rebound_tangential_m_s",
    "/along_floor/rebound_normal_m_s",
];

/// Numbers of a launch, which stand in the row of its first bounce.
const OF_LAUNCH: [(&str, &str); 2] = [("x0_m", "/x0_m"), ("x_m", "/x_m")];

/// The names of the columns.
fn header() -> Vec<String> {
    let mut names: Vec<String> = [
        "group",
        "recording",
        "launch",
        "bounce",
        "left_out",
        "regime",
        "edited",
        "warnings",
    ]
    .map(str::to_owned)
    .to_vec();
    let mut with_std = |name: &str| names.extend([name.to_owned(), format!("{name}_std")]);
    for (name, _) in OF_BOUNCE.iter().chain(&OF_LAUNCH) {
        with_std(name);
    }
    with_std("launch_speed_m_s");
    with_std("measured_gravity_m_s2");
    with_std("floor_slope_deg");
    names.extend(["spin_ratio", "gravity_m_s2", "inertia_factor", "stiffness_ratio"].map(str::to_owned));
    names.extend(pairs().map(|pair| format!("{pair}_corr")));
    names.push("page".to_owned());
    names
}

/// The names of the correlations, as results have them.
fn pairs() -> impl Iterator<Item = String> {
    let name = |i: usize| Speed::ALL[i].name();
    index_pairs().map(move |(i, j)| format!("{}__{}", name(i), name(j)))
}

/// The same as places in [`Speed::ALL`].
fn index_pairs() -> impl Iterator<Item = (usize, usize)> {
    let count = Speed::ALL.len();
    (0..count).flat_map(move |i| (i + 1..count).map(move |j| (i, j)))
}

impl BounceRows {
    /// The bounces of a recording's `result`.
    #[must_use]
    pub fn of(result: &Value, source: &RowSource<'_>) -> Self {
        let inertia_factor = source.calibration.inertia_factor;
        let bounces = |launch: &Value| on_floor(launch).count();
        let edited = result["edits"].is_object();
        let codes = warning_codes(result).join(" ");
        let of_launch = |all: usize, (n, launch): (usize, &Value)| -> Vec<Vec<String>> {
            // A slope that the impacts tell is the launch's own.
            let own = launch
                .pointer("/floor/source")
                .is_some_and(|source| source == "impacts");
            let sharing = if own { bounces(launch) } else { all };
            with_shared_slope(launch, sharing, inertia_factor)
                .iter()
                .enumerate()
                .map(|(i, bounce)| row(launch, source, (n + 1, i), bounce, (edited, &codes)))
                .collect()
        };
        // A recording of one launch is that launch.
        let launches = match result["launches"].as_array() {
            Some(launches) if !launches.is_empty() => launches.as_slice(),
            _ => std::slice::from_ref(result),
        };
        let all = launches.iter().map(bounces).sum();
        let rows = launches
            .iter()
            .enumerate()
            .flat_map(|launch| of_launch(all, launch));
        Self(rows.collect())
    }

    /// The rows of a recording that is no part of the fit as a whole.
    #[must_use]
    pub fn left_out(mut self, left_out: &LeftOut) -> Self {
        for row in &mut self.0 {
            // A bounce that no fit could use is none when refuted recordings are kept, either.
            if row[LEFT_OUT].is_empty() || matches!(left_out, LeftOut::Duplicate(_)) {
                row[LEFT_OUT] = left_out.reason();
            }
            if matches!(left_out, LeftOut::Duplicate(_)) {
                let codes = std::mem::take(&mut row[WARNINGS]);
                row[WARNINGS] = format!("{codes} {DUPLICATE}").trim_start().to_owned();
            }
        }
        self
    }

    /// How many bounces there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

/// The whole table, with its header.
///
/// # Errors
/// Whatever the `csv` crate refuses; into memory it refuses nothing.
pub fn table<'a>(
    recordings: impl Iterator<Item = (&'a BounceRows, Option<&'a LeftOut>)>,
) -> Result<Vec<u8>, ::csv::Error> {
    let mut writer = ::csv::Writer::from_writer(Vec::new());
    writer.write_record(header())?;
    for (rows, left_out) in recordings {
        let vetted = left_out.map(|left_out| rows.clone().left_out(left_out));
        for row in &vetted.as_ref().unwrap_or(rows).0 {
            writer.write_record(row)?;
        }
    }
    writer
        .into_inner()
        .map_err(|error| ::csv::Error::from(error.into_error()))
}

/// The bounces of a launch on the floor: a series is of one pair of ball and floor.
fn on_floor(launch: &Value) -> impl Iterator<Item = &Value> {
    let all = launch["bounces"].as_array().into_iter().flatten();
    all.filter(|bounce| bounce["surface"] != BounceSurface::Ceiling.name())
}

/// The bounces of a launch on the floor, each with the shared slope's part of the covariance of its velocities as often as there are
/// bounces that are `sharing` it.
fn with_shared_slope(result: &Value, sharing: usize, inertia_factor: f64) -> Vec<Value> {
    let mut bounces: Vec<Value> = on_floor(result).cloned().collect();
    let slope_std_deg = result
        .pointer("/floor/slope_deg/std_uncertainty")
        .and_then(Value::as_f64);
    let more = (sharing as f64 - 1.0) * slope_std_deg.unwrap_or(0.0).to_radians().powi(2);
    if more.is_nan() || more <= 0.0 {
        return bounces;
    }
    // What a radian more of slope makes of the spin before a bounce: that of the launch nothing.
    let mut of_spin = 0.0;
    for bounce in &mut bounces {
        let value = |place: &str| bounce.pointer(place).and_then(|q| q["value"].as_f64());
        let [
            Some(incident_t),
            Some(incident_n),
            Some(rebound_t),
            Some(rebound_n),
        ] = VELOCITIES.map(value)
        else {
            continue;
        };
        if bounce["spin_in_source"] == "measured" {
            of_spin = 0.0;
        }
        let of_speed = [incident_n, -incident_t, rebound_n, -rebound_t, of_spin];
        of_spin += (incident_n - rebound_n) / inertia_factor;
        let places = [
            VELOCITIES[0],
            VELOCITIES[1],
            VELOCITIES[2],
            VELOCITIES[3],
            "/spin_in_m_s",
        ];
        let stds = places.map(|place| {
            let std = bounce.pointer(place).and_then(|q| q["std_uncertainty"].as_f64());
            std.filter(|&std| std > 0.0)
        });
        let new: [f64; 5] =
            std::array::from_fn(|i| stds[i].map_or(0.0, |std| std.hypot(more.sqrt() * of_speed[i])));
        for (pair, (i, j)) in pairs().zip(index_pairs()) {
            let (Some(a), Some(b)) = (stds[i], stds[j]) else {
                continue;
            };
            let shared = &mut bounce["along_floor"]["correlations"];
            let before = shared[&pair].as_f64().unwrap_or(0.0) * a * b;
            let after = (before + more * of_speed[i] * of_speed[j]) / (new[i] * new[j]);
            if let Some(shared) = shared.as_object_mut() {
                shared.insert(pair, after.clamp(-1.0, 1.0).into());
            }
        }
        for (place, std) in places.iter().zip(new).filter(|(_, std)| *std > 0.0) {
            if let Some(q) = bounce.pointer_mut(place) {
                q["std_uncertainty"] = std.into();
            }
        }
    }
    bounces
}

/// The codes of a result's warnings, each once.
#[must_use]
pub fn warning_codes(result: &Value) -> Vec<String> {
    let mut codes: Vec<String> = Vec::new();
    for warning in result["warnings"].as_array().into_iter().flatten() {
        if let Some(code) = warning["code"].as_str()
            && !codes.iter().any(|known| known == code)
        {
            codes.push(code.to_owned());
        }
    }
    codes
}

/// The row of a bounce: of this launch of the recording, from 1, and in it, from 0. `result`: what is measured of that launch; `edited`: with what a person said;
/// `warnings`: the recording's.
fn row(
    result: &Value,
    source: &RowSource<'_>,
    (launch, i): (usize, usize),
    bounce: &Value,
    (edited, warnings): (bool, &str),
) -> Vec<String> {
    let RowSource {
        recording,
        calibration,
        page,
    } = source;
    let mut cells = vec![
        recording.group.clone(),
        recording.name.clone(),
        launch.to_string(),
        (i + 1).to_string(),
        left_out(result, calibration, i, bounce).unwrap_or_default(),
        bounce["regime"].as_str().unwrap_or_default().to_owned(),
        edited.to_string(),
        warnings.to_owned(),
    ];
    let first = i == 0;
    let mut quantity = |q: Option<&Value>| {
        let cell = |key| {
            q.and_then(|q| q[key].as_f64())
                .map_or_else(String::new, |x| x.to_string())
        };
        cells.extend([cell("value"), cell("std_uncertainty")]);
    };
    for (_, place) in OF_BOUNCE {
        quantity(bounce.pointer(place));
    }
    for (_, place) in OF_LAUNCH {
        quantity(result.pointer(place).filter(|_| first));
    }
    // The speed along x stays in flight, but for the air.
    let launched = first && !result["x0_m"].is_null();
    quantity(bounce.pointer("/incident/vx_m_s").filter(|_| launched));
    quantity(result.get("gravity_m_s2"));
    quantity(result.pointer("/floor/slope_deg"));
    let number = |x: Option<f64>| x.map_or_else(String::new, |x| x.to_string());
    cells.push(number(calibration.spin_ratio.filter(|_| first)));
    cells.push(number(Some(calibration.gravity_m_s2)));
    cells.push(number(Some(calibration.inertia_factor)));
    cells.push(number(calibration.stiffness_ratio));
    for pair in pairs() {
        cells.push(number(bounce["along_floor"]["correlations"][&pair].as_f64()));
    }
    cells.push((*page).to_owned());
    cells
}

/// Why a bounce is nothing for a fit.
fn left_out(result: &Value, calibration: &CalibrationNumbers, i: usize, bounce: &Value) -> Option<String> {
    let unknown = |place: &&str| bounce.pointer(place).is_none_or(Value::is_null);
    if VELOCITIES.iter().any(&unknown) {
        return Some("not all of its velocities are known (a view from above has none upwards)".to_owned());
    }
    if !unknown(&"/azimuth_deg") {
        return Some(
            "seen from above: a spin to the side may have turned it, which a series of launches has not"
                .to_owned(),
        );
    }
    let warned = |code: &str| {
        let all = result["warnings"].as_array();
        all.is_some_and(|all| all.iter().any(|w| w["code"] == code))
    };
    if warned("first_impact_unsure") {
        return Some(
            "an impact before the first one seen was missed, so its spin is not known (first_impact_unsure)"
                .to_owned(),
        );
    }
    if !unknown(&"/spin_in_m_s") {
        return None;
    }
    match calibration.spin_ratio {
        Some(_) => Some(
            "its spin is not known: an impact before it was not on the floor, or not one at all".to_owned(),
        ),
        // The fit finds the launch's spin, but not what the bounces before made of it.
        None if i > 0 => Some("its spin is not known, as that of the launch is not (spin_ratio)".to_owned()),
        None => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::CalibrationChanges;
    use crate::calibration::{MetresPerPixel, Scale};
    use crate::rebound::fit::{self, Column, ColumnSet, Weights};
    use serde_json::json;
    use std::path::PathBuf;

    fn calibration() -> Calibration {
        Calibration::new(Scale::MetresPerPixel(MetresPerPixel {
            value: 0.001,
            std: None,
        }))
    }

    fn recording() -> BatchRecording {
        BatchRecording {
            name: "a, \"b\"".to_owned(),
            video: PathBuf::from("a.mp4"),
            calib: None,
            edits: None,
            group: "steel".to_owned(),
            changes: CalibrationChanges::default(),
        }
    }

    fn q(value: f64, std: f64) -> Value {
        json!({"value": value, "std_uncertainty": std})
    }

    fn result() -> Value {
        let bounce = |spin: Value| {
            json!({
                "time_s": q(0.2, 1e-4), "x_m": q(0.2, 1e-4),
                "incident": {"vx_m_s": q(1.0, 0.01), "vz_m_s": q(-2.0, 0.02), "angle_deg": q(26.6, 0.1)},
                "rebound": {"vx_m_s": q(0.8, 0.01), "vz_m_s": q(1.6, 0.02), "angle_deg": q(26.6, 0.1)},
                "restitution": q(0.8, 0.001), "tangential_ratio": q(0.8, 0.001), "friction": q(0.05, 0.001),
                "tangential_restitution": q(0.3, 0.01), "spin_in_m_s": spin, "spin_out_m_s": q(0.5, 0.01),
                "along_floor": {
                    "incident_tangential_m_s": q(1.0, 0.01), "incident_normal_m_s": q(-2.0, 0.02),
                    "rebound_tangential_m_s": q(0.8, 0.01), "rebound_normal_m_s": q(1.6, 0.02),
                    "correlations": {"incident_vx_m_s__rebound_vx_m_s": 0.75}
                },
                "regime": "sliding"
            })
        };
        json!({
            "gravity_m_s2": q(9.8, 0.01), "x0_m": q(0.2, 1e-4), "x_m": q(0.25, 1e-4), "warnings": [],
            "bounces": [bounce(json!({"value": 0.0, "std_uncertainty": null})), bounce(q(0.5, 0.01))]
        })
    }

    fn series(result: &Value, calibration: &Calibration) -> fit::Series {
        let recording = recording();
        let source = RowSource {
            recording: &recording,
            calibration: calibration.into(),
            page: "results/a.report.html",
        };
        let rows = BounceRows::of(result, &source);
        fit::csv::parse(&table([(&rows, None)].into_iter()).unwrap(), "series.csv").unwrap()
    }

    #[test]
    fn a_fit_reads_what_is_written() {
        let s = series(&result(), &calibration());
        assert_eq!((s.set, s.weights), (ColumnSet::Velocities, Weights::Stated));
        assert_eq!((s.rows.len(), s.set_aside.len()), (2, 0));
        assert!(s.notes.is_empty(), "{:?}", s.notes);
        let first = &s.rows[0];
        assert_eq!((&*first.group, first.recording()), ("steel", Some("a, \"b\"")));
        assert_eq!(first.page(), Some("results/a.report.html"));
        let std = |column| first.reading(column).unwrap().std;
        assert_eq!((std(Column::IncidentVx), std(Column::SpinIn)), (Some(0.01), None));
        assert_eq!(
            first.correlations(),
            [(Column::IncidentVx, Column::ReboundVx, 0.75)]
        );
        assert_eq!(first.value(Column::X), Some(0.25));
        assert_eq!(first.value(Column::LaunchSpeed), Some(1.0));
        assert_eq!(first.inertia_factor(), 0.4);
        assert_eq!(s.rows[1].value(Column::X), None, "x belongs to the launch");
        assert_eq!(s.rows[1].value(Column::SpinIn), Some(0.5));
    }

    #[test]
    fn a_recording_that_is_left_out_stands_there_with_reason_and_codes() {
        let mut warned = result();
        warned["warnings"] = json!([
            {"code": "camera_moved", "message": ""}, {"code": "edited", "message": ""}, {"code": "edited", "message": ""}
        ]);
        let (recording, calibration) = (recording(), calibration());
        let source = RowSource {
            recording: &recording,
            calibration: (&calibration).into(),
            page: "a",
        };
        let rows = BounceRows::of(&warned, &source);
        assert_eq!(
            (header()[LEFT_OUT].as_str(), header()[WARNINGS].as_str()),
            ("left_out", "warnings")
        );
        assert_eq!(rows.0[1][WARNINGS], "camera_moved edited");
        let copy = LeftOut::Duplicate("other".to_owned());
        let text = table([(&rows, None), (&rows, Some(&copy))].into_iter()).unwrap();
        let s = fit::csv::parse(&text, "series.csv").unwrap();
        assert_eq!((s.rows.len(), s.set_aside.len()), (2, 2));
        assert!(
            s.set_aside[0].reason.contains("the same as other"),
            "{:?}",
            s.set_aside
        );
        assert!(
            String::from_utf8(text)
                .unwrap()
                .contains("camera_moved edited duplicate_recording")
        );
    }

    #[test]
    fn launches_of_one_recording_have_rows_of_their_own() {
        let one = result();
        let mut several = result();
        let mut second = result();
        second["x0_m"] = q(0.3, 1e-4);
        several["launches"] = json!([one, second]);
        let s = series(&several, &calibration());
        assert_eq!((s.rows.len(), s.set_aside.len()), (4, 0));
        let x0: Vec<Option<f64>> = s.rows.iter().map(|row| row.value(Column::X0)).collect();
        assert_eq!(x0, [Some(0.2), None, Some(0.3), None]);
        let (recording, calibration) = (recording(), calibration());
        let source = RowSource {
            recording: &recording,
            calibration: (&calibration).into(),
            page: "a",
        };
        let place = header().iter().position(|name| name == "launch").unwrap();
        let rows = BounceRows::of(&several, &source);
        let numbers: Vec<&str> = rows.0.iter().map(|row| row[place].as_str()).collect();
        assert_eq!(numbers, ["1", "1", "2", "2"]);
    }

    #[test]
    fn a_slope_that_all_bounces_share_is_as_uncertain_in_their_mean() {
        let mut sloping = result();
        sloping["floor"] = json!({"slope_deg": q(0.0, 0.3)});
        let (alone, shared) = (
            series(&result(), &calibration()),
            series(&sloping, &calibration()),
        );
        let slope_rad = 0.3_f64.to_radians();
        for (row, of_spin) in [(0, 0.0), (1, (-2.0 - 1.6) / 0.4)] {
            let std = |s: &fit::Series, column| s.rows[row].reading(column).unwrap().std;
            for (column, of_speed) in [
                (Column::IncidentVx, -2.0),
                (Column::IncidentVz, -1.0),
                (Column::ReboundVx, 1.6),
                (Column::ReboundVz, -0.8),
                (Column::SpinIn, of_spin),
            ] {
                // Once in the result; once more as there are two bounces.
                let expected = std(&alone, column).map(|before| before.hypot(slope_rad * of_speed));
                let found = std(&shared, column);
                assert_eq!(found.is_some(), expected.is_some());
                assert!(
                    (found.unwrap_or(0.0) - expected.unwrap_or(0.0)).abs() < 1e-12,
                    "{column:?}"
                );
            }
        }
        let between = |s: &fit::Series| {
            let all = s.rows[0].correlations();
            let pair = (Column::IncidentVx, Column::ReboundVx);
            all.iter().find(|c| (c.0, c.1) == pair).unwrap().2
        };
        let stds = [0.01_f64.hypot(slope_rad * 2.0), 0.01_f64.hypot(slope_rad * 1.6)];
        let expected = (0.75e-4 - slope_rad * slope_rad * 2.0 * 1.6) / (stds[0] * stds[1]);
        assert!((between(&alone) - 0.75).abs() < 1e-12);
        assert!(
            (between(&shared) - expected).abs() < 1e-12,
            "{}",
            between(&shared)
        );
    }

    #[test]
    fn what_would_mislead_a_fit_is_left_out_with_its_reason() {
        let mut c = calibration();
        let mut above = result();
        above["bounces"][0]["along_floor"] = Value::Null;
        let s = series(&above, &c);
        assert_eq!((s.rows.len(), s.set_aside[0].row), (1, 1));
        assert!(s.set_aside[0].reason.contains("view from above"));

        let mut near = result();
        near["bounces"][0]["azimuth_deg"] = json!({"value": 3.0, "std_uncertainty": 0.1});
        assert!(series(&near, &c).set_aside[0].reason.contains("seen from above"));

        let mut missed = result();
        missed["warnings"] = json!([{"code": "first_impact_unsure", "message": ""}]);
        let s = series(&missed, &c);
        assert!(s.rows.is_empty() && s.set_aside[1].reason.contains("first_impact_unsure"));

        let mut broken = result();
        broken["bounces"][1]["spin_in_m_s"] = Value::Null;
        let s = series(&broken, &c);
        assert_eq!(s.rows.len(), 1);
        assert!(s.set_aside[0].reason.contains("an impact before it"));

        c.launch.spin_ratio = None;
        broken["bounces"][0]["spin_in_m_s"] = Value::Null;
        let s = series(&broken, &c);
        assert_eq!(s.rows.len(), 1, "the launch's spin is for the fit to find");
        assert_eq!(s.rows[0].value(Column::SpinIn), None);
        assert_eq!(s.rows[0].value(Column::SpinRatio), None);
        assert!(s.set_aside[0].reason.contains("that of the launch is not"));
    }
}
