//! What is read, what is set aside, what is refused.

use super::*;
use crate::rebound::fit::Weights;
use proptest::prelude::*;

fn series(text: &str) -> Series {
    parse(text.as_bytes(), "s.csv").unwrap()
}

fn error(text: &str) -> String {
    parse(text.as_bytes(), "s.csv").unwrap_err().to_string()
}

#[test]
fn columns_go_by_name_in_any_order() {
    let s = series(
        "# a comment\nrebound_angle_deg,note,Group,incident_angle_deg,rebound_angle_deg_std,incident_angle_deg_std\n\
         28,dropped,steel,30,0.1,0.2\n\n 33 , ,, 35 ,0.1,0.2\n",
    );
    assert_eq!((s.set, s.weights), (ColumnSet::Angles, Weights::Stated));
    assert_eq!(s.groups, ["steel", "all"]);
    assert_eq!(s.rows[0].reading(Column::IncidentAngle).unwrap().std, Some(0.2));
    assert_eq!(s.rows[1].value(Column::ReboundAngle), Some(33.0));
    assert_eq!(s.rows[1].number, 2, "a blank line is no row");
}

#[test]
fn spreadsheets_of_all_countries_are_read() {
    let dots = series("x0_m,x_m,launch_speed_m_s\n0.2,0.25,1\n");
    for text in [
        "\u{feff}x0_m;x_m;launch_speed_m_s\r\n0,2;0,25;1\r\n",
        "x0_m\tx_m\tlaunch_speed_m_s\n0.2\t0.25\t1\n",
        "\"x0_m\",\"x_m\",\"launch_speed_m_s\"\n\"0.2\",0.25,1e0\n",
    ] {
        let other = series(text);
        assert_eq!(
            other.rows[0].value(Column::X0),
            dots.rows[0].value(Column::X0),
            "{text}"
        );
        assert_eq!(other.rows[0].value(Column::X), Some(0.25));
    }
    assert_eq!(
        series("incident_angle_deg,rebound_angle_deg\n\u{2212}30,\u{2212}28\n").rows[0]
            .value(Column::IncidentAngle),
        Some(-30.0)
    );
}

#[test]
fn a_missing_column_is_named_and_so_is_the_slip_of_the_pen() {
    let text = error("incident_vx_m_s,incident_vz_m_s,rebound_vx_m_s,rebound_vz_ms\n1,-1,1,1\n");
    assert!(text.contains("it lacks rebound_vz_m_s"), "{text}");
    assert!(
        text.contains("is rebound_vz_ms meant to be rebound_vz_m_s?"),
        "{text}"
    );
    assert!(
        text.contains("s.csv") && text.contains("launch_speed_m_s"),
        "{text}"
    );
    let text = error("time,speed\n1,2\n");
    assert!(
        text.contains("none of the columns") && text.contains("time, speed"),
        "{text}"
    );
}

#[test]
fn what_is_no_series_is_told() {
    for (bytes, word) in [
        (b"".as_slice(), "empty"),
        (b" \n\n", "empty"),
        (b"\xff\xfea\0", "UTF-16"),
        (b"PK\x03\x04rest", "workbook"),
        (b"\0\0\0\x18ftyp", "not text"),
        (b"x0_m,x_m,launch_speed_m_s\n", "no rows"),
        (b"x0_m,x_m,x_m,launch_speed_m_s\n1,1,1,1\n", "twice"),
        (
            b"x0_m,x_m,launch_speed_m_s,spin_ratio_std\n1,1,1,1\n",
            "belongs to",
        ),
    ] {
        let text = parse(bytes, "s.csv").unwrap_err().to_string();
        assert!(text.contains(word) && text.contains("s.csv"), "{word}: {text}");
    }
    assert!(
        read(Path::new("/no/such/file.csv"))
            .unwrap_err()
            .to_string()
            .contains("/no/such/file.csv")
    );
    let folder = tempfile::tempdir().unwrap();
    assert!(
        read(folder.path())
            .unwrap_err()
            .to_string()
            .contains("track batch")
    );
}

#[test]
fn cells_that_are_not_known_and_cells_that_are_wrong() {
    let s = series(
        "incident_vx_m_s,incident_vx_m_s_std,incident_vz_m_s,rebound_vx_m_s,rebound_vz_m_s,rebound_vz_m_s_std,spin_in_m_s\n\
         1,0.01,-2,0.8,1.5,0.01,\n1,0.01,-2,0.8,1.5,0.01,?\n1,0.01,-2,nan,1.5,0.01,0\n1,0.01,-2,abc,1.5,0.01,0\n1,0.01,-2,0.8,1.5,-0.01,0\n\
         1,0.01,2,0.8,1.5,0.01,0\n1,0.01,-2,0.8,-1.5,0.01,0\n1,0.01,-2,inf,1.5,0.01,0\n1,0.01,-2,0.8,1.5,,0\n1,0.01,-2,0.8\n1,0.01,-2,0.8,1.5,0.01,0,7\n",
    );
    assert_eq!(s.rows.len(), 2);
    assert!(s.rows.iter().all(|row| row.value(Column::SpinIn).is_none()));
    let reasons: Vec<&str> = s.set_aside.iter().map(|a| a.reason.as_str()).collect();
    for (i, words) in [
        "rebound_vx_m_s is empty",
        "\"abc\", not a number",
        "rebound_vz_m_s_std is negative",
        "goes down",
        "goes up",
        "not a finite number",
        "rebound_vz_m_s_std is empty",
        "rebound_vz_m_s is empty",
        "8 cells",
    ]
    .iter()
    .enumerate()
    {
        assert!(reasons[i].contains(words), "{words}: {}", reasons[i]);
        assert_eq!(s.set_aside[i].row, i + 3);
    }
    let codes: Vec<&str> = s.notes.iter().map(|n| n.code).collect();
    assert_eq!(codes, ["taken_as_exact"], "the spin column is there, if empty");
}

#[test]
fn no_word_of_the_spin_means_none_and_is_said() {
    let s = series("incident_angle_deg,rebound_angle_deg,spin_ration\n30,28,0.5\n");
    assert_eq!(s.rows[0].value(Column::SpinRatio), Some(0.0));
    let codes: Vec<&str> = s.notes.iter().map(|n| n.code).collect();
    assert_eq!(codes, ["no_deviations", "spin_taken_as_zero", "column_not_used"]);
    assert!(s.notes[2].message.contains("spin_ratio"));
}

#[test]
fn the_set_is_the_first_that_has_numbers() {
    // A batch writes the columns of velocities even where a view from above leaves those of z empty.
    let s = series(
        "incident_vx_m_s,incident_vz_m_s,rebound_vx_m_s,rebound_vz_m_s,incident_angle_deg,rebound_angle_deg\n\
         1,,0.8,,30,28\n",
    );
    assert_eq!(s.set, ColumnSet::Angles);
}

proptest! {
    #[test]
    fn nothing_that_is_read_panics(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        let mut text = b"incident_angle_deg,rebound_angle_deg,rebound_angle_deg_std\n30,28,0.1\n".to_vec();
        text.extend(&bytes);
        let _ = parse(&text, "s.csv");
        let _ = parse(&bytes, "s.csv");
    }

    #[test]
    fn numbers_come_back(theta in -89.0..89.0_f64, phi in -89.0..89.0_f64, std in 0.0..1.0_f64) {
        let s = series(&format!(
            "incident_angle_deg,rebound_angle_deg,rebound_angle_deg_std\n{theta},{phi},{std}\n"
        ));
        prop_assert_eq!(s.rows[0].value(Column::IncidentAngle), Some(theta));
        prop_assert_eq!(s.rows[0].reading(Column::ReboundAngle).unwrap().std, Some(std));
    }
}

#[test]
fn a_recording_goes_by_either_name() {
    for name in ["recording", "video"] {
        let text = format!(
            "{name},page,incident_angle_deg,rebound_angle_deg\nclip.mp4,results/clip.report.html,30,28\n"
        );
        let series = parse(text.as_bytes(), "s.csv").unwrap();
        assert_eq!(series.rows[0].recording(), Some("clip.mp4"));
        assert_eq!(series.rows[0].page(), Some("results/clip.report.html"));
    }
}

#[test]
fn deviations_that_leave_a_relation_exact_are_not_used() {
    let text = "x0_m,x_m,launch_speed_m_s,launch_speed_m_s_std\n0.3,0.3,1,0.01\n0.2,0.2,1,0.01\n";
    let series = parse(text.as_bytes(), "s.csv").unwrap();
    assert_eq!(series.weights, Weights::Unit);
    let note = series
        .notes
        .iter()
        .find(|n| n.code == "deviations_not_used")
        .unwrap();
    assert!(note.message.contains("x0_m and x_m"), "{}", note.message);
}

#[test]
fn spins_that_were_seen_stand_in_place_of_computed_ones() {
    let s = series(
        "incident_vx_m_s,incident_vz_m_s,rebound_vx_m_s,rebound_vz_m_s,spin_in_m_s,spin_in_m_s_std,spin_out_m_s,\
         measured_spin_in_m_s,measured_spin_in_m_s_std,measured_spin_out_m_s,measured_spin_out_m_s_std\n\
         1,-2,0.7,1.6,0,0.1,0.75,0.1,0.002,0.86,0.003\n\
         1,-2,0.7,1.6,0,0.1,0.75,,,,\n",
    );
    let spin = |row: usize, column| s.rows[row].reading(column).map(|r| (r.value, r.std));
    assert_eq!(spin(0, Column::SpinIn), Some((0.1, Some(0.002))));
    assert_eq!(spin(0, Column::SpinOut), Some((0.86, Some(0.003))));
    assert_eq!(spin(1, Column::SpinIn), Some((0.0, Some(0.1))));
    assert_eq!(spin(1, Column::SpinOut), None);
}
