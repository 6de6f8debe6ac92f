//! The table for people on stdout. Warnings are not in it: `cli` prints them on stderr.

pub use super::words::format_quantity;

use super::escape::on_one_line;
use super::words;
use crate::impact::compliant_reading::CompliantReading;
use crate::impact::{Bounce, Distances, Readings};
use crate::pipeline::{CameraSeen, Measurement, Outcome, ShownMotion};
use crate::quantity::Quantity;
use std::fmt::Write as _;

/// Bounces side by side: as many as fit into a hundred columns.
const BOUNCES_A_ROW: usize = 3;

/// The table, ready to print, with a newline at its end.
#[must_use]
pub fn table(measurement: &Measurement) -> String {
    let mut text = String::new();
    file_lines(&mut text, measurement);
    if let Outcome::Rejected { reason } = &measurement.outcome {
        line(&mut text, "REJECTED", reason);
    }
    for (i, launch) in measurement.each_launch().iter().enumerate() {
        if !measurement.launches.is_empty() {
            text.push('\n');
            line(
                &mut text,
                &format!("LAUNCH {}", i + 1),
                &words::seen_flying(launch),
            );
        }
        launch_lines(&mut text, launch);
    }
    text
}

/// What was measured of one launch.
fn launch_lines(text: &mut String, launch: &Measurement) {
    if launch.outcome == Outcome::Measured {
        line(text, "gravity", &format_quantity(launch.gravity_m_s2, "m/s²"));
        scene_lines(text, launch);
        bounce_lines(text, &launch.bounces);
        distance_lines(text, &launch.distances);
    }
    if let Some(readings) = &launch.readings {
        reading_lines(text, readings);
    }
}

/// A row of the per-bounce table, shared with the page: what it is, its symbol, its unit, and where it stands.
pub(super) struct BounceRow {
    /// In words.
    pub name: &'static str,
    /// As in the paper.
    pub symbol: &'static str,
    /// Empty for a pure number.
    pub unit: &'static str,
    /// Whether a group of rows starts with it: place, before, after, coefficients, spin.
    pub starts_part: bool,
    /// The quantity of a bounce, in that unit.
    pub quantity: fn(&Bounce) -> Option<Quantity>,
}

/// Rows that some recordings have, and others cannot have.
const ROWS_OF_SOME: [&str; 5] = [
    "azimuth",
    "friction, at least",
    "spin before, seen",
    "spin after, seen",
    "inertia factor",
];

/// The rows of the per-bounce table in reading order.
pub(super) const BOUNCE_ROWS: [BounceRow; 19] = [
    row("time", "t", "s", |b| b.time_s),
    row("place", "x", "m", |b| b.x_m),
    first(row("x velocity before", "v_ox", "m/s", |b| b.incident.vx_m_s)),
    row("z velocity before", "v_oz", "m/s", |b| b.incident.vz_m_s),
    row("incident angle", "θ", "°", |b| {
        words::degrees(b.incident.angle_rad)
    }),
    first(row("x velocity after", "v_x", "m/s", |b| b.rebound.vx_m_s)),
    row("z velocity after", "v_z", "m/s", |b| b.rebound.vz_m_s),
    row("rebound angle", "φ", "°", |b| {
        words::degrees(b.rebound.angle_rad)
    }),
    row("azimuth", "α", "°", |b| words::degrees(b.azimuth_rad)),
    first(row("restitution", "e", "", |b| b.restitution)),
    row("tangential ratio", "v_x/v_ox", "", |b| b.tangential_ratio),
    row("friction", "μ", "", |b| b.friction),
    row("friction, at least", "μ", "", |b| b.friction_at_least),
    row("tang. restitution", "e_x", "", |b| b.tangential_restitution),
    first(row("spin before", "Rω_o", "m/s", |b| b.spin_in_m_s)),
    row("spin after", "Rω", "m/s", |b| b.spin_out_m_s),
    row("spin before, seen", "Rω_o", "m/s", |b| b.measured_spin_in_m_s),
    row("spin after, seen", "Rω", "m/s", |b| b.measured_spin_out_m_s),
    row("inertia factor", "k", "", |b| b.inertia_factor),
];

const fn row(
    name: &'static str,
    symbol: &'static str,
    unit: &'static str,
    quantity: fn(&Bounce) -> Option<Quantity>,
) -> BounceRow {
    BounceRow {
        name,
        symbol,
        unit,
        starts_part: false,
        quantity,
    }
}

/// The first row of its group.
const fn first(row: BounceRow) -> BounceRow {
    BounceRow {
        starts_part: true,
        ..row
    }
}

fn file_lines(text: &mut String, measurement: &Measurement) {
    let video = &measurement.video;
    let rate = video.frame_rate_hz.map_or_else(
        || "rate unknown".to_owned(),
        |hz| format!("{} Hz", words::trimmed(hz, 3)),
    );
    line(text, "file", &on_one_line(&video.path.display().to_string()));
    line(
        text,
        "",
        &format!(
            "{} × {} px, {} in {} s, {rate}; times from {}",
            video.width_px,
            video.height_px,
            words::counted(video.frames, "frame"),
            words::trimmed(video.duration_s, 4),
            words::time_source(video.time_source),
        ),
    );
    let unsure = |seen: &&CameraSeen| seen.shown_motion != ShownMotion::All;
    if let Some(seen) = video.camera.as_ref().filter(unsure) {
        line(text, "camera", &words::camera(seen));
    }
    let track = &measurement.track;
    let launches = measurement.each_launch();
    let used: usize = launches.iter().map(|launch| words::point_counts(launch).0).sum();
    let detected: usize = launches.iter().map(|launch| launch.track.detected).sum();
    let std = track.centre_std_px.map_or_else(
        || "uncertainty of a centre unknown".to_owned(),
        |std| format!("a centre to ± {} px", words::two_digits(std)),
    );
    line(
        text,
        "ball",
        &format!(
            "seen in {}, used in {used}; radius {}; {std}",
            words::counted(detected as u64, "frame"),
            format_quantity(track.radius_px, "px"),
        ),
    );
    if launches.len() > 1 {
        let bounces = launches.iter().map(|launch| launch.bounces.len() as u64).sum();
        let launches = words::counted(launches.len() as u64, "launch");
        line(
            text,
            "launches",
            &format!("{launches}, {}", words::counted(bounces, "bounce")),
        );
    }
}

/// Launch, floor and "up" as they were found.
fn scene_lines(text: &mut String, measurement: &Measurement) {
    if let Some(launch) = &measurement.launch {
        line(text, "launch", &words::launch(launch));
    }
    if let Some(floor) = &measurement.floor {
        let slope = format_quantity(words::degrees(Some(floor.slope_rad)), "°");
        line(
            text,
            "floor",
            &format!("slope {slope} along x ({})", words::floor_source(floor.source)),
        );
    }
    if let Some(up) = &measurement.up {
        line(text, "up", &words::up(up));
    }
}

fn bounce_lines(text: &mut String, bounces: &[Bounce]) {
    for (block, chunk) in bounces.chunks(BOUNCES_A_ROW).enumerate() {
        let cells: Vec<Vec<String>> = chunk
            .iter()
            .map(|bounce| {
                BOUNCE_ROWS
                    .iter()
                    .map(|row| format_quantity((row.quantity)(bounce), row.unit))
                    .collect()
            })
            .collect();
        let width = cells
            .iter()
            .flatten()
            .map(|cell| cell.chars().count())
            .max()
            .unwrap_or(0)
            .max(8);
        text.push('\n');
        let mut heading = String::new();
        for (index, bounce) in chunk.iter().enumerate() {
            let name = words::bounce_name(block * BOUNCES_A_ROW + index + 1, bounce);
            let _ = write!(heading, "  {name:<width$}");
        }
        let _ = writeln!(text, "{:<LABEL$}{:<SYMBOL$}{}", "", "", heading.trim_end());
        for (index, row) in BOUNCE_ROWS.iter().enumerate() {
            let no_bounce_has_it = bounces.iter().all(|bounce| (row.quantity)(bounce).is_none());
            if no_bounce_has_it && ROWS_OF_SOME.contains(&row.name) {
                continue; // A side view has no azimuth, a plain ball shows no spin: a dash there would look like a failure.
            }
            let mut values = String::new();
            for column in &cells {
                let _ = write!(values, "  {:<width$}", column[index]);
            }
            let _ = writeln!(
                text,
                "{:<LABEL$}{:<SYMBOL$}{}",
                row.name,
                row.symbol,
                values.trim_end()
            );
        }
        let mut regimes = String::new();
        for bounce in chunk {
            let _ = write!(regimes, "  {:<width$}", words::slip(bounce.slip));
        }
        let _ = writeln!(text, "{:<LABEL$}{:<SYMBOL$}{}", "regime", "", regimes.trim_end());
    }
}

fn distance_lines(text: &mut String, distances: &Distances) {
    let x0 = format_quantity(distances.x0_m, "m");
    let x = format_quantity(distances.x_m, "m");
    let source = words::x_source(distances.x_source);
    text.push('\n');
    line(text, "x0", &format!("{x0}   launch edge to first impact"));
    line(text, "x", &format!("{x}   first to second impact ({source})"));
}

fn reading_lines(text: &mut String, readings: &Readings) {
    text.push('\n');
    let e = format_quantity(readings.restitution, "");
    for (name, reading) in &readings.models {
        let model = name.model();
        let own = format_quantity(reading.quantity, "");
        let numbers = format!("e = {e},  {} = {own}", reading.parameter.symbol());
        line(text, &format!("{} model", name.facts().label), &numbers);
        let regime = words::regime_name(reading.regime);
        line(
            text,
            "",
            &format!("{regime}: {}", model.regime_words(reading.regime)),
        );
    }
    if let Some(reading) = &readings.compliant {
        compliant_lines(text, reading);
    }
    line(text, "preferred", words::preferred(readings.preferred));
}

fn compliant_lines(text: &mut String, reading: &CompliantReading) {
    let kappa = words::trimmed(reading.stiffness_ratio, 3);
    let friction = format_quantity(reading.friction, "");
    line(text, "compliant", &format!("κ = {kappa},  μ = {friction}"));
    line(text, "", &words::compliant(reading));
    for (symbol, unit, foretold) in [
        ("e_x", "", &reading.tangential_restitution),
        ("v_t after", "m/s", &reading.tangential_m_s),
        ("Rω after", "m/s", &reading.spin_out_m_s),
    ] {
        let (predicted, measured) = (
            format_quantity(foretold.predicted, unit),
            format_quantity(foretold.measured, unit),
        );
        let off = words::sigmas(foretold.sigmas());
        line(
            text,
            "",
            &format!("{symbol}: predicted {predicted}, measured {measured}, off by {off}"),
        );
    }
}

/// Columns of the names at the left, and of the symbols beside them.
const LABEL: usize = 19;
const SYMBOL: usize = 9;

/// A name and what follows it, broken at words within a hundred columns.
pub(super) fn line(text: &mut String, name: &str, content: &str) {
    const CONTENT: usize = 88;
    const NAME: usize = 12;
    let mut lead = name;
    let mut current = String::new();
    for word in content.split(' ') {
        let length = current.chars().count() + 1 + word.chars().count();
        if length > CONTENT && !current.trim().is_empty() {
            let _ = writeln!(text, "{lead:<NAME$}{}", current.trim_end());
            (lead, current) = ("", String::new());
        }
        if !current.is_empty() {
            current.push(' ');
        }
        current.push_str(word);
    }
    let _ = writeln!(text, "{lead:<NAME$}{}", current.trim_end());
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::test_measurements;

    #[test]
    fn every_measured_number_stands_with_its_uncertainty() {
        let text = table(&test_measurements::two_bounces());
        for expected in [
            "gravity     9.806 ± 0.011 m/s²",
            "0.7804 ± 0.0013",
            "bounce 1",
            "bounce 2",
            "x0          0.32150 ± 0.00031 m",
            "both impacts seen",
            "sliding: the ball slid",
            "ordinary: e_x below 0",
            "radius 13.900 ± 0.021 px",
            "a centre to ± 0.050 px",
            "240 Hz",
        ] {
            assert!(text.contains(expected), "{expected}\n{text}");
        }
        assert!(!text.contains("NaN") && !text.contains("azimuth"), "{text}");
        assert!(!text.contains("dropped_frames"), "warnings go to stderr");
        assert!(text.lines().all(|line| line.chars().count() <= 100), "{text}");
    }

    #[test]
    fn columns_line_up() {
        let text = table(&test_measurements::two_bounces());
        let column = |line: &str| line.char_indices().filter(|(_, c)| *c == '±').count();
        let rows: Vec<&str> = text.lines().filter(|line| column(line) == 2).collect();
        assert!(rows.len() >= 8, "{text}");
        let second =
            |line: &str| line.chars().count() - line.chars().rev().collect::<String>().find("  ").unwrap();
        assert!(second(rows[1]) > 40);
    }

    #[test]
    fn a_rejected_recording_prints_its_reason() {
        for measurement in [test_measurements::rejected(), test_measurements::nothing_seen()] {
            let text = table(&measurement);
            assert!(text.contains("REJECTED"), "{text}");
            assert!(!text.contains("gravity"), "{text}");
            assert!(!text.contains("bounce 1"), "{text}");
        }
    }

    #[test]
    fn many_bounces_are_broken_into_blocks() {
        let mut measurement = test_measurements::two_bounces();
        let bounce = measurement.bounces[0].clone();
        measurement.bounces = vec![bounce; 7];
        let text = table(&measurement);
        assert!(text.contains("bounce 7"));
        assert!(text.lines().all(|line| line.chars().count() <= 100), "{text}");
    }

    #[test]
    fn several_launches_follow_each_other() {
        let text = table(&test_measurements::three_launches());
        assert!(text.contains("launches    3 launches, 6 bounces"), "{text}");
        for n in 1..=3 {
            assert!(
                text.contains(&format!("LAUNCH {n}    seen flying from")),
                "{text}"
            );
        }
        assert_eq!(text.matches("preferred").count(), 3);
        assert!(text.lines().all(|line| line.chars().count() <= 100), "{text}");
    }

    #[test]
    fn a_top_view_shows_the_azimuth() {
        let text = table(&test_measurements::top_view());
        assert!(text.contains("azimuth"), "{text}");
        assert!(text.contains("12.03 ± 0.23°"), "{text}");
    }
}
