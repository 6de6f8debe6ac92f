//! `<stem>.report.html`: the page for people.
//!
//! One file with everything in it: no script, no font, no address. It prints on A4 and reads on a phone. Whatever comes
//! from outside (names, reasons, messages) goes through `escape`.

use super::strobe::{self, StrobePicture};
use super::table::{BOUNCE_ROWS, BounceRow, format_quantity};
use super::track_plots::{self, Coordinate, Plot};
use super::words::{self, NO_VALUE, WrittenQuantity};
use crate::impact::{Bounce, Readings, XSource};
use crate::pipeline::{Measurement, Outcome, View, Warning};
use crate::quantity::Quantity;
use crate::rebound::Preferred;
use std::fmt::Write as _;
use thiserror::Error;

/// The page's style sheet, put into the page itself.
pub(super) const STYLE: &str = include_str!("page.css");
/// Bounces side by side in the table: what fits across an A4 page.
const BOUNCES_A_TABLE: usize = 3;

/// Why a page could not be made.
#[derive(Debug, Error)]
pub enum PageError {
    /// A plot failed.
    #[error(transparent)]
    Plot(#[from] track_plots::PlotError),
    /// The picture failed.
    #[error(transparent)]
    Strobe(#[from] strobe::StrobeError),
}

/// The page of one recording, complete.
///
/// # Errors
/// See [`PageError`].
pub fn report_html(measurement: &Measurement) -> Result<String, PageError> {
    let picture = strobe::strobe_picture(measurement)?;
    let along = track_plots::coordinate_plot(measurement, Coordinate::Along)?;
    let up = track_plots::coordinate_plot(measurement, Coordinate::Up)?;
    let name = escape(&words::file_name(measurement));
    let mut page = String::new();
    let _ = write!(
        page,
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{name}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n"
    );
    header(&mut page, measurement, &name);
    if let Some(picture) = &picture {
        picture_section(&mut page, measurement, picture);
    }
    if measurement.outcome == Outcome::Measured {
        main_numbers(&mut page, measurement);
    }
    warnings(&mut page, &measurement.warnings);
    // Numbers of a recording that is not to be trusted would be read all the same.
    let trusted = measurement.outcome == Outcome::Measured;
    if let Some(readings) = measurement.readings.as_ref().filter(|_| trusted) {
        models(&mut page, readings);
    }
    plot_section(&mut page, measurement, &[along, up]);
    if trusted {
        scene_section(&mut page, measurement);
        bounce_section(&mut page, measurement);
    }
    track_section(&mut page, measurement);
    provenance(&mut page, measurement);
    page.push_str("</body>\n</html>\n");
    Ok(page)
}

/// Text as it may stand in HTML, in an attribute, too.
pub(super) fn escape(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            // A control character has no place in HTML; a file name may hold one.
            c if c.is_control() && c != '\n' => safe.push('\u{fffd}'),
            c => safe.push(c),
        }
    }
    safe
}

/// A symbol like `v_ox` or `v_x/v_ox` with its indices lowered.
pub(super) fn symbol_html(symbol: &str) -> String {
    symbol
        .split('/')
        .map(|part| match part.split_once('_') {
            Some((letter, index)) => format!("<i>{letter}</i><span class=\"sub\">{index}</span>"),
            None => format!("<i>{part}</i>"),
        })
        .collect::<Vec<_>>()
        .join(" / ")
}

fn header(page: &mut String, measurement: &Measurement, name: &str) {
    let _ = writeln!(page, "<header>\n<h1>{name}</h1>");
    match &measurement.outcome {
        Outcome::Measured => {
            let bounces = words::counted(measurement.bounces.len() as u64, "bounce");
            let (used, _) = words::point_counts(measurement);
            let _ = writeln!(
                page,
                "<p><span class=\"status\">✓ measured</span> — {bounces}, {used} centres in use</p>"
            );
        }
        Outcome::Rejected { reason } => {
            let _ = writeln!(
                page,
                "<div class=\"rejected\"><strong>✗ Not measured</strong>\n<p>{}</p></div>",
                escape(reason)
            );
        }
    }
    page.push_str("</header>\n");
}

fn picture_section(page: &mut String, measurement: &Measurement, picture: &StrobePicture) {
    let interval = picture.interval_s.map_or_else(String::new, |interval| {
        format!(
            " about every {} ms (fewer where one would hide another)",
            words::trimmed(1e3 * interval, if interval < 0.01 { 1 } else { 0 })
        )
    });
    let impacts = if measurement.bounces.is_empty() {
        ""
    } else {
        "; triangles: the impacts, numbered as in the table"
    };
    let _ = writeln!(
        page,
        "<figure>\n{}<figcaption>The ball cut out of its frames at {} of {} instants,{interval}. Lines: the fitted \
         arcs of free flight{impacts}.</figcaption>\n</figure>",
        picture.svg, picture.shown, picture.available,
    );
}

/// A main number: name, symbol, quantity, unit.
type Tile = (&'static str, &'static str, Option<Quantity>, &'static str);

fn main_numbers(page: &mut String, measurement: &Measurement) {
    let (tiles, note) = match measurement.view {
        View::Side => (
            side_tiles(measurement),
            "; angles are from the floor's normal. Gravity checks scale and time base: it should agree with the local \
             value, about 9.8 m/s² (a dash where the scale itself was taken from gravity)",
        ),
        View::Top => (top_tiles(measurement), ""),
    };
    page.push_str("<section>\n<h2>The first bounce</h2>\n<dl class=\"tiles\">\n");
    for (name, symbol, quantity, unit) in tiles {
        tile(page, name, symbol, quantity, unit);
    }
    let _ = writeln!(
        page,
        "</dl>\n<p class=\"soft\">± is one standard uncertainty (k = 1){note}.</p>\n</section>"
    );
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

fn tile(page: &mut String, name: &str, symbol: &str, quantity: Option<Quantity>, unit: &str) {
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
    let _ = writeln!(
        page,
        "<div class=\"tile\"><dt>{} <span class=\"symbol\">{}</span></dt><dd><span class=\"value\">{value}</span>\
         <span class=\"pm\">{uncertainty}</span></dd></div>",
        escape(name),
        symbol_html(symbol),
    );
}

fn warnings(page: &mut String, warnings: &[Warning]) {
    if warnings.is_empty() {
        return;
    }
    page.push_str("<section>\n<h2>To be checked</h2>\n");
    for warning in warnings {
        let _ = writeln!(
            page,
            "<p class=\"warning\"><code>⚠ {}</code><br>{}</p>",
            escape(warning.code),
            escape(&warning.message)
        );
    }
    page.push_str("</section>\n");
}

fn models(page: &mut String, readings: &Readings) {
    let number =
        |symbol: &str, quantity| format!("{} = {}", symbol_html(symbol), format_quantity(quantity, ""));
    let e = number("e", readings.restitution);
    page.push_str("<section>\n<h2>What the two models make of it</h2>\n<div class=\"models\">\n");
    for (name, reading) in &readings.models {
        let model = name.model();
        let title = format!("{} model: {}", name.facts().label, name.facts().summary);
        let second = number(reading.parameter.symbol(), reading.quantity);
        let regime = words::regime_name(reading.regime);
        let meaning = model.regime_words(reading.regime);
        let is_preferred = readings.preferred == Preferred::Model(*name);
        let meaning = meaning.replace("e_x", &symbol_html("e_x"));
        let (class, mark) = if is_preferred {
            (" preferred", " — ✓ preferred")
        } else {
            ("", "")
        };
        let _ = writeln!(
            page,
            "<div class=\"model{class}\"><h3>{title}{mark}</h3>\n<p class=\"numbers\">{e}<br>{second}</p>\n\
             <p><b>{regime}</b> — {meaning}.</p></div>"
        );
    }
    let _ = writeln!(
        page,
        "</div>\n<p>Comparison: {}.</p>\n</section>",
        words::preferred(readings.preferred)
    );
}

fn plot_section(page: &mut String, measurement: &Measurement, plots: &[Option<Plot>]) {
    let plots: Vec<&Plot> = plots.iter().flatten().collect();
    let Some(first) = plots.first() else {
        return;
    };
    page.push_str("<section>\n<h2>Path against time</h2>\n");
    for plot in &plots {
        let _ = writeln!(page, "<figure class=\"scroll\">\n{}</figure>", plot.svg);
    }
    let (used, unused) = words::point_counts(measurement);
    page.push_str("<p class=\"soft\">");
    if used > 0 {
        page.push_str("● centre in use &nbsp; ");
    }
    if !unused.is_empty() {
        page.push_str("× centre not used &nbsp; ");
    }
    if !measurement.arcs.is_empty() {
        page.push_str("line: fitted arc &nbsp; ");
    }
    if !measurement.bounces.is_empty() {
        page.push_str("dashed: impact");
    }
    if first.residuals {
        page.push_str(
            "<br>Below each: measured minus fitted; bars: each centre's own standard uncertainty; grey band: ± the \
             standard deviation of a centre as these residuals show it; ▲ beyond the panel.",
        );
    }
    if first.every > 1 {
        let _ = write!(
            page,
            "<br>Of this long track one centre in {} is drawn.",
            first.every
        );
    }
    page.push_str("</p>\n</section>\n");
}

/// Launch, floor and "up", which every angle and coefficient rests on.
fn scene_section(page: &mut String, measurement: &Measurement) {
    if measurement.floor.is_none() && measurement.launch.is_none() && measurement.up.is_none() {
        return;
    }
    page.push_str("<section>\n<h2>Launch, floor and up</h2>\n<table class=\"facts\">\n");
    if let Some(launch) = &measurement.launch {
        fact(page, "launch edge", &format_quantity(launch.edge_x_m, "m"));
        fact(page, "left it at", &format_quantity(launch.time_s, "s"));
        fact(page, "launch speed", &format_quantity(launch.speed_m_s, "m/s"));
        fact(
            page,
            "drop to the first impact",
            &format_quantity(launch.drop_height_m, "m"),
        );
        fact(
            page,
            "seen on the bench for",
            &format!("{} s", words::trimmed(launch.rolled_s, 3)),
        );
    }
    if let Some(floor) = &measurement.floor {
        let slope = format_quantity(words::degrees(Some(floor.slope_rad)), "°");
        fact(
            page,
            "slope of the floor along x",
            &format!("{slope} ({})", words::floor_source(floor.source)),
        );
    }
    if let Some(up) = &measurement.up {
        fact(page, "up", &words::up(up));
    }
    page.push_str(
        "</table>\n<p class=\"soft\">Angles, restitution and friction are along the floor and its normal; velocities along x and \
         straight up.</p>\n</section>\n",
    );
}

fn bounce_section(page: &mut String, measurement: &Measurement) {
    let bounces = &measurement.bounces;
    if bounces.is_empty() {
        return;
    }
    page.push_str("<section>\n<h2>Every bounce</h2>\n");
    for (block, chunk) in bounces.chunks(BOUNCES_A_TABLE).enumerate() {
        page.push_str(
            "<div class=\"scroll\"><table class=\"bounces\">\n<thead><tr><th scope=\"row\" colspan=\"3\">bounce</th>",
        );
        for index in 0..chunk.len() {
            let _ = write!(
                page,
                "<th scope=\"col\" colspan=\"2\">{}</th>",
                block * BOUNCES_A_TABLE + index + 1
            );
        }
        page.push_str("</tr></thead>\n<tbody>\n");
        // A quantity that no bounce of this recording has (the azimuth of a side view) would be a row of dashes.
        for row in BOUNCE_ROWS
            .iter()
            .filter(|row| bounces.iter().any(|b| (row.quantity)(b).is_some()))
        {
            bounce_row(page, row, chunk);
        }
        page.push_str("<tr class=\"part\"><th scope=\"row\">regime</th><td class=\"symbol\"></td><td class=\"unit\"></td>");
        for bounce in chunk {
            let _ = write!(
                page,
                "<td class=\"v\" colspan=\"2\">{}</td>",
                words::slip(bounce.slip)
            );
        }
        page.push_str("</tr>\n</tbody></table></div>\n");
    }
    page.push_str("<p class=\"soft\">“Before” and “after” are just before and after the impact");
    if bounces.iter().any(|bounce| bounce.spin_out_m_s.is_some()) {
        let (spin, e_x, v_x) = (symbol_html("Rω"), symbol_html("e_x"), symbol_html("v_x"));
        let _ = write!(
            page,
            "; {spin} is the surface speed from spin. It and {e_x} follow from the change of {v_x}, for the spin before \
             the bounce as given or assumed"
        );
    }
    page.push_str(".</p>\n</section>\n");
}

fn bounce_row(page: &mut String, row: &BounceRow, bounces: &[Bounce]) {
    let part = if row.starts_part { " class=\"part\"" } else { "" };
    let _ = write!(
        page,
        "<tr{part}><th scope=\"row\">{}</th><td class=\"symbol\">{}</td><td class=\"unit\">{}</td>",
        row.name,
        symbol_html(row.symbol),
        row.unit
    );
    for bounce in bounces {
        let quantity = (row.quantity)(bounce);
        let _ = match words::written(quantity) {
            None => write!(page, "<td class=\"v\">{NO_VALUE}</td><td class=\"u\"></td>"),
            Some(WrittenQuantity {
                value,
                uncertainty,
                power: None,
            }) => {
                write!(
                    page,
                    "<td class=\"v\">{value}</td><td class=\"u\">± {uncertainty}</td>"
                )
            }
            Some(_) => write!(
                page,
                "<td class=\"v\" colspan=\"2\">{}</td>",
                format_quantity(quantity, "")
            ),
        };
    }
    page.push_str("</tr>\n");
}

fn track_section(page: &mut String, measurement: &Measurement) {
    let track = &measurement.track;
    let (used, unused) = words::point_counts(measurement);
    page.push_str("<section>\n<h2>The track</h2>\n<table class=\"facts\">\n");
    fact(page, "method of the centre", &escape(&track.method));
    fact(
        page,
        "ball seen in",
        &words::counted(track.detected as u64, "frame"),
    );
    fact(page, "centres in use", &used.to_string());
    let reasons: Vec<String> = unused
        .iter()
        .map(|(reason, count)| format!("{count} × {}", escape(reason)))
        .collect();
    let reasons = if reasons.is_empty() {
        "none".to_owned()
    } else {
        reasons.join("<br>")
    };
    fact(page, "centres not used", &reasons);
    fact(
        page,
        "radius of the ball",
        &format_quantity(track.radius_px, "px"),
    );
    let std = track.centre_std_px.map_or_else(
        || NO_VALUE.to_owned(),
        |std| format!("± {} px in each coordinate", words::two_digits(std)),
    );
    fact(page, "uncertainty of a centre", &std);
    page.push_str("</table>\n</section>\n");
}

fn provenance(page: &mut String, measurement: &Measurement) {
    let video = &measurement.video;
    page.push_str("<section>\n<h2>Where it comes from</h2>\n<table class=\"facts\">\n");
    fact(page, "file", &escape(&video.path.to_string_lossy()));
    fact(
        page,
        "picture",
        &format!("{} × {} px", video.width_px, video.height_px),
    );
    let rate = video.frame_rate_hz.map_or_else(
        || "unknown".to_owned(),
        |hz| format!("{} Hz", words::trimmed(hz, 3)),
    );
    fact(
        page,
        "frames",
        &format!(
            "{} in {} s, distinct frames at {rate}",
            video.frames,
            words::trimmed(video.duration_s, 4)
        ),
    );
    fact(page, "times from", words::time_source(video.time_source));
    let view = match measurement.view {
        View::Side => "from the side: x along the launch, z up",
        View::Top => "from above: x along the launch, y sideways",
    };
    fact(page, "view", view);
    fact(page, "program", concat!("track ", env!("CARGO_PKG_VERSION")));
    page.push_str("</table>\n</section>\n");
}

/// A line of facts; `content` is HTML already.
fn fact(page: &mut String, name: &str, content: &str) {
    let _ = writeln!(page, "<tr><th scope=\"row\">{name}</th><td>{content}</td></tr>");
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::report::test_measurements;

    /// Every tag is closed in order; a page that is cut off or interleaved fails.
    pub(in crate::report) fn assert_well_formed(page: &str) {
        const VOID: [&str; 2] = ["meta", "br"];
        let mut open: Vec<String> = Vec::new();
        let body = page.strip_prefix("<!DOCTYPE html>").unwrap();
        for piece in body.split('<').skip(1) {
            let tag = piece.split('>').next().unwrap();
            assert!(piece.contains('>'), "an open bracket: {piece:.60}");
            if let Some(name) = tag.strip_prefix('/') {
                assert_eq!(open.pop().as_deref(), Some(name), "closing {name}");
            } else if !tag.ends_with('/') {
                let name = tag.split_whitespace().next().unwrap();
                if !VOID.contains(&name) {
                    open.push(name.to_owned());
                }
            }
        }
        assert!(open.is_empty(), "{open:?}");
    }

    /// The page but for the base64 of its photograph, which may spell anything.
    fn without_photograph(page: &str) -> String {
        match page.split_once("base64,") {
            Some((before, rest)) => before.to_owned() + rest.split_once('"').unwrap().1,
            None => page.to_owned(),
        }
    }

    #[test]
    fn every_kind_of_measurement_gives_a_whole_page() {
        for measurement in [
            test_measurements::two_bounces(),
            test_measurements::leftward(),
            test_measurements::vertical_drop(),
            test_measurements::rejected(),
            test_measurements::nothing_seen(),
            test_measurements::no_scale(),
            test_measurements::top_view(),
        ] {
            let page = report_html(&measurement).unwrap();
            assert_well_formed(&page);
            let text = without_photograph(&page);
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
        measurement.track.points[0].use_ =
            crate::pipeline::PointUse::Unused("<img src=x onerror=alert(1)>".to_owned());
        measurement.warnings[0].message = "set \"frame_rate_hz\" <now>".to_owned();
        let page = report_html(&measurement).unwrap();
        assert_well_formed(&page);
        for forbidden in ["<script>", "<img", "<b>circle", "<now>", "\u{7}"] {
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
            "× in contact with the floor",
            "240 Hz",
            "✓ measured",
        ] {
            assert!(page.contains(expected), "{expected}");
        }
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

    #[test]
    fn symbols_get_their_indices() {
        assert_eq!(symbol_html("v_ox"), "<i>v</i><span class=\"sub\">ox</span>");
        assert!(symbol_html("v_x/v_ox").contains(" / "));
    }

    /// Writes the pages to look at: `TRACK_PAGES=/tmp/x cargo test --lib show_pages -- --ignored`.
    #[test]
    #[ignore = "writes files to look at"]
    fn show_pages() {
        let dir = std::path::PathBuf::from(std::env::var("TRACK_PAGES").unwrap());
        for (name, measurement) in [
            ("two", test_measurements::two_bounces()),
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
