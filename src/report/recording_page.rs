//! `<stem>.report.html`: the page for people.

use super::figure::PlotUse;
use super::page::{PageError, document, fact, symbol_html, warning};
use super::spin_section::spin_section;
use super::strobe::{self, StrobePicture};
use super::table::{BOUNCE_ROWS, BounceRow, format_quantity};
use super::track_plots::{self, Coordinate, Plot};
use super::words::{self, NO_VALUE, WrittenQuantity};
use crate::impact::compliant_reading::CompliantReading;
use crate::impact::{Bounce, BounceSurface, Readings, XSource};
use crate::pipeline::{CalibrationFacts, Measurement, Outcome, View, Warning};
use crate::quantity::Quantity;
use crate::rebound::Preferred;
use maud::{Markup, PreEscaped, html};

/// Bounces side by side in the table: what fits across an A4 page.
const BOUNCES_A_TABLE: usize = 3;

/// The page of one recording, complete.
///
/// # Errors
/// See [`PageError`].
pub fn report_html(measurement: &Measurement) -> Result<String, PageError> {
    let name = words::file_name(measurement);
    let launches = &measurement.launches;
    let body = if launches.is_empty() {
        let page = LaunchSections::new(measurement, 1)?;
        html! {
            (header(measurement, &name))
            (page.picture_and_numbers)
            (warnings(&measurement.warnings))
            (page.details)
            (provenance(measurement))
        }
    } else {
        let pages = launches
            .iter()
            .map(|launch| LaunchSections::new(launch, launches.len()));
        let pages = pages.collect::<Result<Vec<_>, _>>()?;
        html! {
            (header(measurement, &name))
            (overview(launches))
            (warnings(&measurement.warnings))
            @for (i, (launch, page)) in launches.iter().zip(&pages).enumerate() {
                div.launch id=(format!("launch-{}", i + 1)) {
                    h1 { "Launch " (i + 1) }
                    p.soft { (words::seen_flying(launch)) }
                    (page.picture_and_numbers)
                    (page.details)
                }
            }
            (provenance(measurement))
        }
    };
    Ok(document(&name, "", &body))
}

/// What the page says of one launch.
struct LaunchSections {
    picture_and_numbers: Markup,
    details: Markup,
}

impl LaunchSections {
    /// Of one of so many `launches` on the page.
    fn new(measurement: &Measurement, launches: usize) -> Result<Self, PageError> {
        let picture = strobe::strobe_picture(measurement, launches)?;
        let along = track_plots::coordinate_plot(measurement, Coordinate::Along, PlotUse::Page)?;
        let up = track_plots::coordinate_plot(measurement, Coordinate::Up, PlotUse::Page)?;
        // Numbers of a recording that is not to be trusted would be read all the same.
        let trusted = measurement.outcome == Outcome::Measured;
        let spin = spin_section(measurement)?;
        Ok(Self {
            picture_and_numbers: html! {
                @if let Some(picture) = &picture { (picture_section(measurement, picture)) }
                @if trusted { (main_numbers(measurement)) }
            },
            details: html! {
                @if let Some(readings) = measurement.readings.as_ref().filter(|_| trusted) { (models(readings)) }
                (plot_section(measurement, &[along, up]))
                @if trusted {
                    (scene_section(measurement))
                    (bounce_section(measurement))
                    (spin)
                }
                (track_section(measurement))
            },
        })
    }
}

fn header(measurement: &Measurement, name: &str) -> Markup {
    let launches = measurement.each_launch();
    let bounces = launches.iter().map(|launch| launch.bounces.len() as u64).sum();
    let used: usize = launches.iter().map(|launch| words::point_counts(launch).0).sum();
    html! {
        header {
            h1 { (name) }
            p.soft {
                "Calibration: " (calibration_words(&measurement.calibration)) ". "
                @if !measurement.warnings.is_empty() {
                    a href="#warnings" { (words::counted(measurement.warnings.len() as u64, "warning")) " to be checked" }
                    ": " (warning_codes(&measurement.warnings)) "."
                }
            }
            @match &measurement.outcome {
                Outcome::Measured => p {
                    span.status { "✓ measured" } " — "
                    @if launches.len() > 1 { (words::counted(launches.len() as u64, "launch")) ", " }
                    (words::counted(bounces, "bounce")) ", " (used) " centres in use"
                },
                Outcome::Rejected { reason } => div.rejected {
                    strong { "✗ Not measured" }
                    p { (reason) }
                },
            }
        }
    }
}

/// The codes of the warnings, each once.
fn warning_codes(warnings: &[Warning]) -> String {
    let mut codes: Vec<&str> = Vec::new();
    for w in warnings {
        if !codes.contains(&w.code) {
            codes.push(w.code);
        }
    }
    codes.join(", ")
}

/// A row a launch, with what its first bounce says.
fn overview(launches: &[Measurement]) -> Markup {
    html! {
        section {
            h2 { "The launches" }
            div.scroll {
                table.bounces.launches {
                    thead {
                        tr {
                            th scope="col" { "launch" }
                            @for head in ["from", "bounces"] { th scope="col" { (head) } }
                            @for column in words::LAUNCH_COLUMNS {
                                th scope="col" colspan="2" { (symbol_html(column.symbol)) @if !column.unit.is_empty() { " (" (column.unit) ")" } }
                            }
                        }
                    }
                    tbody {
                        @for (i, launch) in launches.iter().enumerate() {
                            tr {
                                th scope="row" { a href=(format!("#launch-{}", i + 1)) { (i + 1) } }
                                td.v { (launch.time_span().map_or_else(|| NO_VALUE.to_owned(), |s| format!("{} s", words::trimmed(s.0, 3)))) }
                                td.v { (launch.bounces.len()) }
                                @for column in words::LAUNCH_COLUMNS { (value_cells((column.quantity)(launch))) }
                            }
                        }
                    }
                }
            }
            p.soft {
                "Coefficients and the angle are the first bounce’s of each launch. Each launch is measured by itself: its own fall, "
                "ball and floor; all share the camera and its clock."
            }
        }
    }
}

/// A quantity in two cells of a table: its value, and its uncertainty.
fn value_cells(quantity: Option<Quantity>) -> Markup {
    html! {
        @match words::written(quantity) {
            None => { td.v { (NO_VALUE) } td.u {} },
            Some(WrittenQuantity { value, uncertainty, power: None }) => {
                td.v { (value) }
                td.u { "± " (uncertainty) }
            },
            Some(_) => td.v colspan="2" { (format_quantity(quantity, "")) },
        }
    }
}

fn picture_section(measurement: &Measurement, picture: &StrobePicture) -> Markup {
    let interval = picture.interval_s.map_or_else(String::new, |interval| {
        format!(
            " about every {} ms (fewer where one would hide another)",
            words::trimmed(1e3 * interval, if interval < 0.01 { 1 } else { 0 })
        )
    });
    html! {
        figure {
            (PreEscaped(&picture.svg))
            figcaption {
                "The ball cut out of its frames at " (picture.shown) " of " (picture.available) " instants," (interval)
                ". Lines: the fitted arcs of free flight"
                @if !measurement.bounces.is_empty() { "; triangles: the impacts, numbered as in the table" }
                "."
            }
        }
    }
}

/// A main number: name, symbol, quantity, unit.
type Tile = (&'static str, &'static str, Option<Quantity>, &'static str);

fn main_numbers(measurement: &Measurement) -> Markup {
    let (tiles, note) = match measurement.view {
        View::Side => (
            side_tiles(measurement),
            "; angles are from the floor's normal. Gravity checks scale and time base: it should agree with the local \
             value, about 9.8 m/s² (a dash where the scale itself was taken from gravity)",
        ),
        View::Top => (top_tiles(measurement), ""),
    };
    html! {
        section {
            h2 { "The first bounce" }
            dl.tiles { @for tile in tiles { (tile_html(tile)) } }
            p.soft { "± is one standard uncertainty (k = 1)" (note) "." }
        }
    }
}

fn side_tiles(measurement: &Measurement) -> Vec<Tile> {
    let first = measurement.bounces.first();
    let distances = &measurement.distances;
    let second_impact = match distances.x_source {
        Some(XSource::Extrapolated) => "impact 1 to 2, extrapolated",
        Some(XSource::Observed) | None => "impact 1 to impact 2",
    };
    let incident = first.and_then(|b| words::degrees(b.incident.angle_rad));
    let rebound = first.and_then(|b| words::degrees(b.rebound.angle_rad));
    let e_x = first.and_then(|b| b.tangential_restitution);
    vec![
        ("restitution", "e", first.and_then(|b| b.restitution), ""),
        ("incident angle", "θ", incident, "°"),
        ("rebound angle", "φ", rebound, "°"),
        friction_tile(first),
        ("tangential restitution", "e_x", e_x, ""),
        ("launch edge to impact 1", "x_0", distances.x0_m, "m"),
        (second_impact, "x", distances.x_m, "m"),
        ("gravity from the flight", "g", measurement.gravity_m_s2, "m/s²"),
    ]
}

/// μ of a ball that slid; of another what friction was at least.
fn friction_tile(bounce: Option<&Bounce>) -> Tile {
    match bounce {
        Some(b) if b.friction.is_none() && b.friction_at_least.is_some() => {
            ("friction, at least", "μ", b.friction_at_least, "")
        }
        _ => ("friction", "μ", bounce.and_then(|b| b.friction), ""),
    }
}

fn top_tiles(measurement: &Measurement) -> Vec<Tile> {
    let first = measurement.bounces.first();
    let azimuth = first.and_then(|b| words::degrees(b.azimuth_rad));
    vec![
        (
            "tangential ratio",
            "v_x/v_ox",
            first.and_then(|b| b.tangential_ratio),
            "",
        ),
        ("azimuth of the rebound", "α", azimuth, "°"),
        (
            "velocity before",
            "v_ox",
            first.and_then(|b| b.incident.vx_m_s),
            "m/s",
        ),
        (
            "velocity after",
            "v_x",
            first.and_then(|b| b.rebound.vx_m_s),
            "m/s",
        ),
    ]
}

fn tile_html((name, symbol, quantity, unit): Tile) -> Markup {
    let (value, uncertainty) = match words::written(quantity) {
        None => (NO_VALUE.to_owned(), "not measured".to_owned()),
        Some(WrittenQuantity {
            value,
            uncertainty,
            power,
        }) => {
            let power = power.map_or_else(String::new, |power| format!("×10{}", words::superscript(power)));
            let value = words::with_unit(format!("{value}{power}"), unit);
            let uncertainty = if uncertainty == "?" {
                "± not determined".to_owned()
            } else {
                words::with_unit(format!("± {uncertainty}{power}"), unit)
            };
            (value, uncertainty)
        }
    };
    html! {
        div.tile {
            dt { (name) " " span.symbol { (symbol_html(symbol)) } }
            dd { span.value { (value) } span.pm { (uncertainty) } }
        }
    }
}

fn warnings(warnings: &[Warning]) -> Markup {
    html! {
        @if !warnings.is_empty() {
            section {
                h2 id="warnings" { "To be checked" }
                @for w in warnings { (warning(w.code, &w.message)) }
            }
        }
    }
}

fn models(readings: &Readings) -> Markup {
    let number =
        |symbol: &str, quantity| html! { (symbol_html(symbol)) " = " (format_quantity(quantity, "")) };
    html! {
        section {
            h2 { "What the models make of it" }
            div.models {
                @for (name, reading) in &readings.models {
                    @let model = name.model();
                    @let is_preferred = readings.preferred == Preferred::Model(*name);
                    div.model.preferred[is_preferred] {
                        h3 { (name.facts().label) " model: " (name.facts().summary) @if is_preferred { " — ✓ preferred" } }
                        p.numbers {
                            (number("e", readings.restitution)) br;
                            (number(reading.parameter.symbol(), reading.quantity))
                        }
                        p {
                            b { (words::regime_name(reading.regime)) } " — "
                            (with_symbols(model.regime_words(reading.regime))) "."
                        }
                    }
                }
            }
            @if let Some(reading) = &readings.compliant { (compliant(reading)) }
            p { "Comparison: " (words::preferred(readings.preferred)) "." }
        }
    }
}

/// The compliant model's reading, number beside number.
fn compliant(reading: &CompliantReading) -> Markup {
    let rows = [
        ("e_x", "", reading.tangential_restitution),
        ("v_t after", "m/s", reading.tangential_m_s),
        ("Rω after", "m/s", reading.spin_out_m_s),
    ];
    html! {
        h3 { "Compliant contact, κ = " (words::trimmed(reading.stiffness_ratio, 3)) " from what ball and floor are made of" }
        p { (words::compliant(reading)) "." }
        div.scroll {
            table.bounces {
                thead { tr { @for head in ["", "predicted", "measured", "off by"] { th scope="col" { (head) } } }
                }
                tbody {
                    @for (symbol, unit, foretold) in rows {
                        tr {
                            th scope="row" { (symbol_html(symbol)) }
                            td.v { (format_quantity(foretold.predicted, unit)) }
                            td.v { (format_quantity(foretold.measured, unit)) }
                            td.v { (words::sigmas(foretold.sigmas())) }
                        }
                    }
                }
            }
        }
        p.soft { (words::COMPLIANT_IS_FOR) "." }
    }
}

/// A sentence in which e_x is written as a symbol.
fn with_symbols(text: &str) -> Markup {
    html! {
        @for (i, part) in text.split("e_x").enumerate() {
            @if i > 0 { (symbol_html("e_x")) }
            (part)
        }
    }
}

fn plot_section(measurement: &Measurement, plots: &[Option<Plot>]) -> Markup {
    let plots: Vec<&Plot> = plots.iter().flatten().collect();
    let Some(first) = plots.first() else {
        return Markup::default();
    };
    let (used, unused) = words::point_counts(measurement);
    html! {
        section {
            h2 { "Path against time" }
            @for plot in &plots { figure.scroll { (PreEscaped(&plot.svg)) } }
            p.soft {
                @if used > 0 { "● centre in use \u{a0} " }
                @if !unused.is_empty() { "× centre not used \u{a0} " }
                @if !measurement.arcs.is_empty() { "line: fitted arc \u{a0} " }
                @if !measurement.bounces.is_empty() { "dashed: impact" }
                @if first.residuals {
                    br;
                    "Below each: measured minus fitted; bars: each centre's own standard uncertainty; grey band: ± the \
                     standard deviation of a centre as these residuals show it; ▲ beyond the panel."
                }
                @if first.every > 1 {
                    br;
                    "Of this long track one centre in " (first.every) " is drawn."
                }
            }
        }
    }
}

/// Launch, floor and "up", which every angle and coefficient rests on.
fn scene_section(measurement: &Measurement) -> Markup {
    if measurement.floor.is_none() && measurement.launch.is_none() && measurement.up.is_none() {
        return Markup::default();
    }
    html! {
        section {
            h2 { "Launch, floor and up" }
            table.facts {
                @if let Some(launch) = &measurement.launch {
                    (fact("launch edge", format_quantity(launch.edge_x_m, "m")))
                    (fact("left it at", format_quantity(launch.time_s, "s")))
                    (fact("launch speed", format_quantity(launch.speed_m_s, "m/s")))
                    (fact("drop to the first impact", format_quantity(launch.drop_height_m, "m")))
                    (fact("seen on the bench for", format!("{} s", words::trimmed(launch.rolled_s, 3))))
                }
                @if let Some(floor) = &measurement.floor {
                    (fact("slope of the floor along x", format!(
                        "{} ({})",
                        format_quantity(words::degrees(Some(floor.slope_rad)), "°"),
                        words::floor_source(floor.source)
                    )))
                }
                @if let Some(up) = &measurement.up { (fact("up", words::up(up))) }
            }
            p.soft {
                "Angles, restitution and friction are along the floor and its normal; velocities along x and straight up."
            }
        }
    }
}

fn bounce_section(measurement: &Measurement) -> Markup {
    let bounces = &measurement.bounces;
    if bounces.is_empty() {
        return Markup::default();
    }
    // A quantity that no bounce of this recording has (the azimuth of a side view) would be a row of dashes.
    let has_one = |row: &&BounceRow| bounces.iter().any(|b| (row.quantity)(b).is_some());
    let spins = bounces.iter().any(|bounce| bounce.spin_out_m_s.is_some());
    html! {
        section {
            h2 { "Every bounce" }
            @for (block, chunk) in bounces.chunks(BOUNCES_A_TABLE).enumerate() {
                div.scroll {
                    table.bounces {
                        thead {
                            tr {
                                th scope="row" colspan="3" { "bounce" }
                                @for (index, bounce) in chunk.iter().enumerate() {
                                    th scope="col" colspan="2" {
                                        (block * BOUNCES_A_TABLE + index + 1)
                                        @if bounce.surface == BounceSurface::Ceiling { " (ceiling)" }
                                    }
                                }
                            }
                        }
                        tbody {
                            @for row in BOUNCE_ROWS.iter().filter(has_one) { (bounce_row(row, chunk)) }
                            tr.part {
                                th scope="row" { "regime" }
                                td.symbol {}
                                td.unit {}
                                @for bounce in chunk { td.v colspan="2" { (words::slip(bounce.slip)) } }
                            }
                        }
                    }
                }
            }
            p.soft {
                "“Before” and “after” are just before and after the impact"
                @if spins {
                    "; " (symbol_html("Rω")) " is the surface speed from spin. It and " (symbol_html("e_x"))
                    " follow from the change of " (symbol_html("v_x")) ", for the spin before the bounce as measured, given or assumed"
                }
                "."
            }
        }
    }
}

fn bounce_row(row: &BounceRow, bounces: &[Bounce]) -> Markup {
    html! {
        tr class=[row.starts_part.then_some("part")] {
            th scope="row" { (row.name) }
            td.symbol { (symbol_html(row.symbol)) }
            td.unit { (row.unit) }
            @for quantity in bounces.iter().map(row.quantity) { (value_cells(quantity)) }
        }
    }
}

fn track_section(measurement: &Measurement) -> Markup {
    let track = &measurement.track;
    let (used, unused) = words::point_counts(measurement);
    let reasons = html! {
        @if unused.is_empty() { "none" }
        @for (i, (reason, count)) in unused.iter().enumerate() {
            @if i > 0 { br; }
            (count) " × " (reason)
        }
    };
    let std = track.centre_std_px.map_or_else(
        || NO_VALUE.to_owned(),
        |std| format!("± {} px in each coordinate", words::two_digits(std)),
    );
    html! {
        section {
            h2 { "The track" }
            table.facts {
                (fact("method of the centre", &track.method))
                (fact("ball seen in", words::counted(track.detected as u64, "frame")))
                (fact("centres in use", used))
                (fact("centres not used", reasons))
                (fact("radius of the ball", format_quantity(track.radius_px, "px")))
                (fact("uncertainty of a centre", std))
            }
        }
    }
}

/// The calibration's file, and what it makes of the picture.
fn calibration_words(facts: &CalibrationFacts) -> String {
    let scale = facts
        .metres_per_pixel
        .map(|s| format!("a pixel near the ball is {}", format_quantity(Some(s), "m")));
    let origin = facts
        .origin_px
        .map(|p| format!("origin at ({:.1}, {:.1}) px", p.u_px, p.v_px));
    let rate = facts
        .frame_rate_hz
        .map(|hz| format!("{} Hz", words::trimmed(hz, 3)));
    let name = (!facts.name.is_empty()).then(|| facts.name.clone());
    [name, scale, origin, rate]
        .into_iter()
        .flatten()
        .collect::<Vec<_>>()
        .join("; ")
}

fn provenance(measurement: &Measurement) -> Markup {
    let video = &measurement.video;
    let rate = video.frame_rate_hz.map_or_else(
        || "unknown".to_owned(),
        |hz| format!("{} Hz", words::trimmed(hz, 3)),
    );
    let frames = format!(
        "{} in {} s, distinct frames at {rate}",
        video.frames,
        words::trimmed(video.duration_s, 4)
    );
    let view = match measurement.view {
        View::Side => "from the side: x along the launch, z up",
        View::Top => "from above: x along the launch, y sideways",
    };
    html! {
        section {
            h2 { "Where it comes from" }
            table.facts {
                (fact("file", video.path.to_string_lossy()))
                (fact("picture", format!("{} × {} px", video.width_px, video.height_px)))
                (fact("frames", frames))
                (fact("times from", words::time_source(video.time_source)))
                @if let Some(seen) = &video.camera {
                    (fact("camera", words::camera(seen)))
                }
                (fact("view", view))
                (fact("SHA-256", video.sha256.as_deref().unwrap_or(NO_VALUE)))
                (fact("calibration", calibration_words(&measurement.calibration)))
                (fact("its SHA-256", measurement.calibration.sha256.as_deref().unwrap_or(NO_VALUE)))
                (fact("program", crate::Build::THIS.to_string()))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::page::tests::assert_well_formed;
    use crate::report::test_measurements;

    /// The page but for the base64 of its photographs, which may spell anything.
    fn without_photographs(page: &str) -> String {
        let mut parts = page.split("base64,");
        let first = parts.next().unwrap().to_owned();
        parts.fold(first, |text, part| text + part.split_once('"').unwrap().1)
    }

    #[test]
    fn every_kind_of_measurement_gives_a_whole_page() {
        for measurement in [
            test_measurements::two_bounces(),
            test_measurements::three_launches(),
            test_measurements::leftward(),
            test_measurements::vertical_drop(),
            test_measurements::rejected(),
            test_measurements::nothing_seen(),
            test_measurements::no_scale(),
            test_measurements::top_view(),
        ] {
            let page = report_html(&measurement).unwrap();
            assert_well_formed(&page);
            let text = without_photographs(&page);
            assert!(!text.contains("NaN") && !text.contains(">inf"));
            assert!(page.len() < 1_500_000, "{}", page.len());
        }
    }

    #[test]
    fn it_needs_nothing_from_outside_and_no_script() {
        let page = report_html(&test_measurements::two_bounces()).unwrap();
        for forbidden in ["<script", "src=\"http", "href=\"http", "url(", "@import"] {
            assert!(!page.contains(forbidden), "{forbidden}");
        }
    }

    #[test]
    fn what_comes_from_outside_is_escaped() {
        let mut measurement = test_measurements::two_bounces();
        measurement.video.path = "a/<script>alert('1')</script>\u{7}&\".mp4".into();
        measurement.track.method = "<b>circle</b>".to_owned();
        measurement.warnings[0].message = "set \"frame_rate_hz\" <now>".to_owned();
        let page = report_html(&measurement).unwrap();
        assert_well_formed(&page);
        for forbidden in ["<script>", "<b>circle", "<now>", "\u{7}"] {
            assert!(!page.contains(forbidden), "{forbidden}");
        }
        assert!(page.contains("set &quot;frame_rate_hz&quot; &lt;now&gt;"));
        let mut rejected = test_measurements::rejected();
        rejected.outcome = Outcome::Rejected {
            reason: "<i>no</i>".to_owned(),
        };
        assert!(report_html(&rejected).unwrap().contains("&lt;i&gt;no&lt;/i&gt;"));
    }

    #[test]
    fn the_numbers_stand_with_their_uncertainties() {
        let page = report_html(&test_measurements::two_bounces()).unwrap();
        for expected in [
            "0.7804",
            "± 0.0013",
            "28.184°",
            "± 0.035°",
            "9.806 m/s²",
            "dropped_frames",
            "sliding",
            "ordinary",
            "× touches the floor",
            "240 Hz",
            "✓ measured",
        ] {
            assert!(page.contains(expected), "{expected}");
        }
    }

    #[test]
    fn each_launch_of_several_has_its_part() {
        let page = report_html(&test_measurements::three_launches()).unwrap();
        assert!(page.contains("3 launches, 6 bounces"), "the header");
        assert_eq!(page.matches("<h2>The first bounce</h2>").count(), 3);
        assert_eq!(page.matches("class=\"strobe\"").count(), 3);
        for n in 1..=3 {
            assert!(
                page.contains(&format!("href=\"#launch-{n}\""))
                    && page.contains(&format!("id=\"launch-{n}\""))
            );
        }
        // Named at the top, told below.
        assert_eq!(page.matches("dropped_frames").count(), 2);
    }

    #[test]
    fn a_rejected_recording_says_why_and_shows_no_numbers() {
        let page = report_html(&test_measurements::rejected()).unwrap();
        assert!(page.contains("Not measured") && page.contains("no free flight"));
        assert!(!page.contains("The first bounce") && !page.contains("class=\"strobe\""));
        // Not even where some were found on the way.
        let mut doubtful = test_measurements::two_bounces();
        doubtful.outcome = test_measurements::rejected().outcome;
        let page = report_html(&doubtful).unwrap();
        assert!(page.contains("Not measured") && !page.contains("0.7804"));
    }

    /// Writes the pages to look at: `TRACK_PAGES=/tmp/x cargo test --lib show_pages -- --ignored`.
    #[test]
    #[ignore = "writes files to look at"]
    fn show_pages() {
        let dir = std::path::PathBuf::from(std::env::var("TRACK_PAGES").unwrap());
        for (name, measurement) in [
            ("two", test_measurements::two_bounces()),
            ("launches", test_measurements::three_launches()),
            ("left", test_measurements::leftward()),
            ("drop", test_measurements::vertical_drop()),
            ("rejected", test_measurements::rejected()),
            ("nothing", test_measurements::nothing_seen()),
            ("noscale", test_measurements::no_scale()),
            ("top", test_measurements::top_view()),
        ] {
            std::fs::write(
                dir.join(format!("{name}.html")),
                report_html(&measurement).unwrap(),
            )
            .unwrap();
        }
    }
}
