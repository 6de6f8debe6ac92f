//! The stroboscopic picture: the ball at even intervals along its path, as in the paper's photographs, with the fitted
//! arcs and the impacts drawn in.
//!
//! The photograph is an embedded JPEG; lines and labels are vectors over it and stay sharp at any size.

use super::drawing_geometry::{self, ImpactMark};
use super::jpeg;
use super::words;
use crate::frames::{Chroma, Luma};
use crate::geometry::PixelPoint;
use crate::pipeline::{ArcTrace, Measurement, PointUse, Strobe, StrobeBall};
use base64::Engine as _;
use std::fmt::Write as _;
use thiserror::Error;

/// The embedded photograph is made no wider than this, px.
const MAX_WIDTH_PX: usize = 1600;
/// It is compressed harder until it is no larger than this (a third more as base64), bytes; ...
const MAX_JPEG_BYTES: usize = 700_000;
/// ... those of several launches on one page together no larger than this.
const MAX_PAGE_BYTES: usize = 3_000_000;
/// Two discs whose centres are this many of their radii (with the rim) apart share 15 % of their area:
/// (2/π)(acos t − t √(1 − t²)) = 0.15 at t = 0.745, and the centres are 2 t radii apart.
const APART_RADII: f64 = 1.49;
/// A cut-out reaches this far beyond the ball's radius, px, so that the edge's blur comes with it.
const RIM_PX: f64 = 1.5;
/// Share of the flight that may be slower than the speed for which the interval is chosen. Slower stretches (near the
/// apex) are thinned out, faster ones show their gaps.
const SLOW_SHARE: f64 = 0.35;

/// Why there is no picture although there is material for one.
#[derive(Debug, Error)]
pub enum StrobeError {
    /// The background's size and its data disagree.
    #[error(
        "the strobe background has {found} pixels where {width} × {height} are needed (a fault of track)"
    )]
    Size {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Pixels there are.
        found: usize,
    },
    /// OpenCV could not shrink or encode the photograph.
    #[error("the strobe picture could not be encoded as JPEG")]
    Encode(#[from] opencv::Error),
}

/// The finished picture and how it was made.
#[derive(Debug, Clone, PartialEq)]
pub struct StrobePicture {
    /// A complete `<svg>` element, for a page.
    pub svg: String,
    /// Balls in it.
    pub shown: usize,
    /// Balls there were to choose from.
    pub available: usize,
    /// Time between two "flashes", s; near an apex some are left out.
    pub interval_s: Option<f64>,
}

/// The picture of one launch, of `pictures` on its page; `None` where there is nothing to make it of.
///
/// # Errors
/// See [`StrobeError`].
pub fn strobe_picture(
    measurement: &Measurement,
    pictures: usize,
) -> Result<Option<StrobePicture>, StrobeError> {
    let Some(strobe) = &measurement.strobe else {
        return Ok(None);
    };
    let Luma { width, height, data } = &*strobe.background;
    if width * height == 0 || data.len() != width * height {
        return Err(StrobeError::Size {
            width: *width,
            height: *height,
            found: data.len(),
        });
    }
    let impacts = drawing_geometry::impacts(measurement);
    let choice = choose(&flashes(measurement, strobe), &impacts);
    let photograph = composite(strobe, &choice.balls);
    let most_bytes = MAX_JPEG_BYTES.min(MAX_PAGE_BYTES / pictures.max(1));
    let chroma = strobe
        .chroma
        .as_ref()
        .map(|scene| composite_chroma(strobe, scene, &choice.balls));
    let colour = chroma.as_ref().map(|chroma| (chroma, strobe.luma_shares));
    let jpeg = jpeg::jpeg(&photograph, colour, MAX_WIDTH_PX, most_bytes)?;
    Ok(Some(StrobePicture {
        svg: svg(measurement, &jpeg, &impacts),
        shown: choice.balls.len(),
        available: strobe.balls.len(),
        interval_s: choice.interval_s,
    }))
}

/// A ball that could be shown.
#[derive(Debug, Clone, Copy)]
struct Flash {
    /// Index into [`Strobe::balls`].
    ball: usize,
    time_s: f64,
    arc: usize,
    centre: PixelPoint,
    /// Radius of the disc that is laid in.
    disc_px: f64,
}

impl Flash {
    /// Whether two discs share no more than 15 % of their area.
    fn apart(&self, other: &Self) -> bool {
        self.centre.distance_px(other.centre) >= APART_RADII * 0.5 * (self.disc_px + other.disc_px)
    }
}

/// The cut-outs with their times and arcs, in time order. One whose frame is not among the used points is left out.
fn flashes(measurement: &Measurement, strobe: &Strobe) -> Vec<Flash> {
    let points = &measurement.track.points;
    let mut flashes: Vec<Flash> = strobe
        .balls
        .iter()
        .enumerate()
        .filter_map(|(ball, cut)| {
            let point = &points[points.binary_search_by_key(&cut.frame, |p| p.frame).ok()?];
            let PointUse::Used(arc) = point.use_ else {
                return None;
            };
            Some(Flash {
                ball,
                time_s: point.time_s,
                arc,
                centre: cut.centre,
                disc_px: cut.radius_px + RIM_PX,
            })
        })
        .collect();
    flashes.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    flashes
}

/// Which balls are shown.
struct ChosenBalls {
    /// Indices into [`Strobe::balls`], in time order.
    balls: Vec<usize>,
    interval_s: Option<f64>,
}

/// The time between two flashes.
#[derive(Debug, Clone, Copy)]
struct FlashInterval {
    flash_s: f64,
    frame_s: f64,
}

/// Balls at even intervals, counted from the first impact: first those nearest the impacts, which always stay, then
/// each whose disc is clear of the shown ones just before and after it, and of the path of earlier arcs: of a ball that
/// falls and rises along one line the first fall is shown, with its even flashes, and not a mixture.
fn choose(flashes: &[Flash], impacts: &[ImpactMark]) -> ChosenBalls {
    let interval = interval(flashes);
    let mut shown: Vec<usize> = impacts
        .iter()
        .filter_map(|impact| nearest(flashes, impact.time_s))
        .collect();
    shown.sort_unstable();
    shown.dedup();
    let start_s = shown.first().map_or_else(
        || flashes.first().map_or(0.0, |flash| flash.time_s),
        |&first| flashes[first].time_s,
    );
    for candidate in ticks(flashes, start_s, interval) {
        let place = shown.partition_point(|&other| other < candidate);
        let clear = |neighbour: Option<&usize>| {
            neighbour.is_none_or(|&n| n != candidate && flashes[n].apart(&flashes[candidate]))
        };
        let flash = &flashes[candidate];
        let hides_another = flashes[..candidate]
            .iter()
            .any(|other| other.arc < flash.arc && !other.apart(flash));
        if !hides_another
            && clear(place.checked_sub(1).and_then(|before| shown.get(before)))
            && clear(shown.get(place))
        {
            shown.insert(place, candidate);
        }
    }
    ChosenBalls {
        balls: shown.iter().map(|&index| flashes[index].ball).collect(),
        interval_s: interval.map(|interval| interval.flash_s),
    }
}

/// The time in which the ball moves by 2.2 radii of its disc (so that most discs stand clear of each other) at a speed that
/// [`SLOW_SHARE`] of the flight stays below: a whole number of frames, as any other would look uneven.
fn interval(flashes: &[Flash]) -> Option<FlashInterval> {
    let pairs = || flashes.windows(2).filter(|pair| pair[0].arc == pair[1].arc);
    let frame_s = quantile(pairs().map(|pair| pair[1].time_s - pair[0].time_s), 0.5)?;
    let discs_a_second = pairs().map(|pair| {
        pair[0].centre.distance_px(pair[1].centre) / pair[0].disc_px / (pair[1].time_s - pair[0].time_s)
    });
    let wanted_s = 2.2 / quantile(discs_a_second, SLOW_SHARE)?;
    Some(FlashInterval {
        flash_s: (wanted_s / frame_s).round().max(1.0) * frame_s,
        frame_s,
    })
}

/// The positive value that `share` of the others lie below.
fn quantile(values: impl Iterator<Item = f64>, share: f64) -> Option<f64> {
    let mut sorted: Vec<f64> = values.filter(|value| value.is_finite() && *value > 0.0).collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get((sorted.len() as f64 * share) as usize).copied()
}

/// The flashes nearest to even instants before and after `start_s`, in time order; all of them without an interval. Where
/// a frame is missing its neighbour stands in; where more are, there is a gap.
fn ticks(flashes: &[Flash], start_s: f64, interval: Option<FlashInterval>) -> Vec<usize> {
    let Some(FlashInterval { flash_s, frame_s }) = interval else {
        return (0..flashes.len()).collect();
    };
    let mut chosen: Vec<(i64, f64, usize)> = Vec::new();
    for (index, flash) in flashes.iter().enumerate() {
        let instant = ((flash.time_s - start_s) / flash_s).round();
        let off_s = (flash.time_s - start_s - instant * flash_s).abs();
        match chosen.last_mut() {
            _ if off_s > 1.1 * frame_s => {}
            Some(last) if last.0 == instant as i64 => {
                if off_s < last.1 {
                    *last = (instant as i64, off_s, index);
                }
            }
            _ => chosen.push((instant as i64, off_s, index)),
        }
    }
    chosen.into_iter().map(|(_, _, index)| index).collect()
}

fn nearest(flashes: &[Flash], time_s: f64) -> Option<usize> {
    let off = |index: &usize| (flashes[*index].time_s - time_s).abs();
    (0..flashes.len()).min_by(|a, b| off(a).total_cmp(&off(b)))
}

/// The empty scene with the chosen balls laid in, each within its outline.
fn composite(strobe: &Strobe, balls: &[usize]) -> Luma {
    let mut picture = Luma::clone(&strobe.background);
    for ball in balls.iter().filter_map(|&index| strobe.balls.get(index)) {
        lay_in(&mut picture, ball);
    }
    picture
}

fn lay_in(picture: &mut Luma, ball: &StrobeBall) {
    let cut = &ball.luma;
    if cut.data.len() != cut.width * cut.height {
        return;
    }
    for row in 0..cut.height {
        for column in 0..cut.width {
            let (u, v) = (ball.corner_px.0 + column as i64, ball.corner_px.1 + row as i64);
            let (Ok(u_index), Ok(v_index)) = (usize::try_from(u), usize::try_from(v)) else {
                continue;
            };
            if u_index >= picture.width || v_index >= picture.height {
                continue;
            }
            let share = ball_share(ball, u, v);
            let old = &mut picture.data[v_index * picture.width + u_index];
            let new = f64::from(cut.data[row * cut.width + column]);
            *old = (share * new + (1.0 - share) * f64::from(*old)).round() as u8;
        }
    }
}

/// The chroma of the same picture, at half its columns and rows: that of the pixel at the top left of each sample's four.
fn composite_chroma(strobe: &Strobe, scene: &Chroma, balls: &[usize]) -> Chroma {
    let mut picture = scene.clone();
    let width = picture.u.width;
    for ball in balls.iter().filter_map(|&index| strobe.balls.get(index)) {
        let Some(colours) = ball.chroma.as_ref().filter(|c| c.len() == ball.luma.data.len()) else {
            continue;
        };
        for (i, colour) in colours.iter().enumerate() {
            let (column, row) = (i % ball.luma.width, i / ball.luma.width);
            let (u, v) = (ball.corner_px.0 + column as i64, ball.corner_px.1 + row as i64);
            let (Ok(x), Ok(y)) = (usize::try_from(u), usize::try_from(v)) else {
                continue;
            };
            if x % 2 == 1 || y % 2 == 1 || x / 2 >= width || y / 2 >= picture.u.height {
                continue;
            }
            let share = ball_share(ball, u, v);
            let planes = [&mut picture.u, &mut picture.v];
            for (plane, new) in planes.into_iter().zip(colour) {
                let old = &mut plane.data[y / 2 * width + x / 2];
                *old = (share * f64::from(*new) + (1.0 - share) * f64::from(*old)).round() as u8;
            }
        }
    }
    picture
}

/// How much of a pixel of the picture is a ball's cut-out: full inside, gone within the last 1.5 px, for a seam would look like an outline
/// that is not in the data.
fn ball_share(ball: &StrobeBall, u: i64, v: i64) -> f64 {
    let from_centre = (u as f64 - ball.centre.u_px).hypot(v as f64 - ball.centre.v_px);
    ((ball.radius_px + RIM_PX - from_centre) / 1.5 + 0.5).clamp(0.0, 1.0)
}

/// The photograph with its drawing. One unit is a pixel of the recording; (0, 0) is the centre of the first.
fn svg(measurement: &Measurement, jpeg: &[u8], impacts: &[ImpactMark]) -> String {
    let (width, height) = match &measurement.strobe {
        Some(strobe) => (strobe.background.width as f64, strobe.background.height as f64),
        None => (0.0, 0.0),
    };
    // What a screen pixel is here when the picture fills its place on the page, 900 × 720 screen pixels.
    let unit = (width / 900.0).max(height / 720.0);
    let mut text = String::new();
    let _ = write!(
        text,
        r#"<svg class="strobe" xmlns="http://www.w3.org/2000/svg" viewBox="-0.5 -0.5 {width} {height}" role="img" aria-label="The ball along its path">
<image x="-0.5" y="-0.5" width="{width}" height="{height}" preserveAspectRatio="none" href="data:image/jpeg;base64,{}"/>
"#,
        base64::engine::general_purpose::STANDARD.encode(jpeg)
    );
    draw_arcs(&mut text, &measurement.arcs, unit);
    let radius_px = measurement
        .track
        .radius_px
        .map_or(4.0 * unit, |radius| radius.value);
    for (centre, label) in impact_labels(impacts, 22.0 * unit) {
        draw_impact(&mut text, centre, &label, radius_px, unit, height);
    }
    if let Some(scale) = drawing_geometry::uniform_scale(&measurement.arcs) {
        draw_scale_bar(&mut text, scale, unit, (width, height));
    }
    text.push_str("</svg>\n");
    text
}

/// Each arc twice: a light band under a dark line shows on any background, in grey print, too.
fn draw_arcs(text: &mut String, arcs: &[ArcTrace], unit: f64) {
    for arc in arcs.iter().filter(|arc| arc.samples.len() > 1) {
        let mut points = String::new();
        for sample in &arc.samples {
            let _ = write!(points, "{:.2},{:.2} ", sample.pixel.u_px, sample.pixel.v_px);
        }
        let points = points.trim_end();
        let _ = writeln!(
            text,
            r##"<g class="arc" fill="none" stroke-linejoin="round"><polyline points="{points}" stroke="#fff" stroke-opacity="0.55" stroke-width="{:.2}"/><polyline points="{points}" stroke="#12408a" stroke-width="{:.2}"/></g>"##,
            3.2 * unit,
            1.3 * unit,
        );
    }
}

/// Where impacts are marked, and their numbers: those closer than `near_px` (a ball dropped straight down) share a mark.
fn impact_labels(impacts: &[ImpactMark], near_px: f64) -> Vec<(PixelPoint, String)> {
    let mut groups: Vec<(PixelPoint, Vec<usize>)> = Vec::new();
    for (number, centre) in impacts
        .iter()
        .filter_map(|mark| Some((mark.number, mark.centre?)))
    {
        match groups
            .iter_mut()
            .find(|(place, _)| place.distance_px(centre) < near_px)
        {
            Some((_, numbers)) => numbers.push(number),
            None => groups.push((centre, vec![number])),
        }
    }
    groups
        .into_iter()
        .map(|(centre, numbers)| {
            let in_a_row = numbers.windows(2).all(|pair| pair[1] == pair[0] + 1);
            let label = match numbers.as_slice() {
                [first, _, .., last] if in_a_row => format!("{first}–{last}"),
                _ => numbers
                    .iter()
                    .map(usize::to_string)
                    .collect::<Vec<_>>()
                    .join(", "),
            };
            (centre, label)
        })
        .collect()
}

/// A small triangle that points at the contact from below (from above where the picture ends), with the number.
fn draw_impact(text: &mut String, centre: PixelPoint, label: &str, radius_px: f64, unit: f64, height: f64) {
    let below = centre.v_px + radius_px + 30.0 * unit < height;
    let side = if below { 1.0 } else { -1.0 };
    let tip = centre.v_px + side * (radius_px + 2.0 * unit);
    let base = tip + side * 9.0 * unit;
    let baseline = if below {
        base + 15.0 * unit
    } else {
        base - 5.0 * unit
    };
    let _ = writeln!(
        text,
        r##"<g class="impact" fill="#9c1c1c" stroke="#fff" stroke-width="{:.2}" paint-order="stroke" stroke-linejoin="round"><path d="M{u:.2} {tip:.2}L{:.2} {base:.2}H{:.2}Z"/><text x="{u:.2}" y="{baseline:.2}" font-size="{:.2}" font-weight="700" text-anchor="middle">{label}</text></g>"##,
        2.6 * unit,
        centre.u_px - 5.5 * unit,
        centre.u_px + 5.5 * unit,
        15.0 * unit,
        u = centre.u_px,
    );
}

/// A round length at the top left, where a ball that bounces on the floor seldom is.
fn draw_scale_bar(text: &mut String, metres_per_pixel: f64, unit: f64, (width, height): (f64, f64)) {
    let length_m = drawing_geometry::round_below(0.25 * width * metres_per_pixel);
    let length_px = length_m / metres_per_pixel;
    let (left, top) = (14.0 * unit, 30.0 * unit);
    if top > 0.5 * height {
        return;
    }
    let label = if length_m < 1.0 {
        format!("{} cm", words::trimmed(100.0 * length_m, 4))
    } else {
        format!("{} m", words::trimmed(length_m, 0))
    };
    let tick = 4.0 * unit;
    let bar = format!(
        "M{left:.2} {:.2}V{:.2}M{left:.2} {top:.2}H{right:.2}M{right:.2} {:.2}V{:.2}",
        top - tick,
        top + tick,
        top - tick,
        top + tick,
        right = left + length_px
    );
    let _ = writeln!(
        text,
        r##"<g class="scale"><path d="{bar}" fill="none" stroke="#fff" stroke-width="{:.2}" stroke-linecap="square"/><path d="{bar}" fill="none" stroke="#111" stroke-width="{:.2}"/><text x="{:.2}" y="{:.2}" font-size="{:.2}" font-weight="600" fill="#111" stroke="#fff" stroke-width="{:.2}" paint-order="stroke" stroke-linejoin="round">{label}</text></g>"##,
        3.6 * unit,
        1.6 * unit,
        left,
        top - 8.0 * unit,
        15.0 * unit,
        3.0 * unit,
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::test_measurements;

    fn chosen(measurement: &Measurement) -> Vec<Flash> {
        let all = flashes(measurement, measurement.strobe.as_ref().unwrap());
        let choice = choose(&all, &drawing_geometry::impacts(measurement));
        choice
            .balls
            .iter()
            .map(|ball| *all.iter().find(|flash| flash.ball == *ball).unwrap())
            .collect()
    }

    #[test]
    fn successive_discs_stay_apart_and_those_at_the_impacts_are_shown() {
        for measurement in [
            test_measurements::two_bounces(),
            test_measurements::leftward(),
            test_measurements::vertical_drop(),
        ] {
            let shown = chosen(&measurement);
            assert!((6..60).contains(&shown.len()), "{}", shown.len());
            let marks = drawing_geometry::impacts(&measurement);
            for pair in shown.windows(2) {
                assert!(pair[0].time_s < pair[1].time_s);
                // Of a vertical drop all impacts are in one place, and all stay.
                let both_impacts = pair[0].arc != pair[1].arc;
                assert!(both_impacts || pair[0].apart(&pair[1]), "{pair:?}");
            }
            let all = flashes(&measurement, measurement.strobe.as_ref().unwrap());
            for mark in &marks {
                let closest = all[nearest(&all, mark.time_s).unwrap()].ball;
                assert!(shown.iter().any(|flash| flash.ball == closest));
            }
        }
    }

    #[test]
    fn impacts_in_one_place_share_a_mark() {
        let labels = |m: &Measurement| -> Vec<String> {
            impact_labels(&drawing_geometry::impacts(m), 22.0)
                .into_iter()
                .map(|(_, label)| label)
                .collect()
        };
        assert_eq!(labels(&test_measurements::two_bounces()), ["1", "2"]);
        let mut drop = test_measurements::vertical_drop();
        assert_eq!(labels(&drop), ["1, 2"]);
        drop.bounces.push(drop.bounces[1].clone());
        assert_eq!(labels(&drop), ["1–3"]);
    }

    #[test]
    fn instants_are_even_where_discs_are_clear() {
        let shown = chosen(&test_measurements::two_bounces());
        let steps: Vec<f64> = shown.windows(2).map(|p| p[1].time_s - p[0].time_s).collect();
        let mut sorted = steps.clone();
        sorted.sort_by(f64::total_cmp);
        let usual = sorted[sorted.len() / 2];
        let even = steps
            .iter()
            .filter(|s| (**s - usual).abs() < 1.01 / 240.0)
            .count();
        assert!(even * 10 >= steps.len() * 6, "{steps:?}");
    }

    #[test]
    fn a_ball_is_laid_in_within_its_outline_only() {
        let measurement = test_measurements::two_bounces();
        let strobe = measurement.strobe.as_ref().unwrap();
        let picture = composite(strobe, &[50]);
        let ball = &strobe.balls[50];
        let (mut inside, mut outside) = (0, 0);
        for v in 0..picture.height {
            for u in 0..picture.width {
                let index = v * picture.width + u;
                if picture.data[index] != strobe.background.data[index] {
                    let r = (u as f64 - ball.centre.u_px).hypot(v as f64 - ball.centre.v_px);
                    if r <= ball.radius_px + RIM_PX + 0.75 {
                        inside += 1;
                    } else {
                        outside += 1;
                    }
                }
            }
        }
        assert_eq!(outside, 0);
        assert!(f64::from(inside) > 0.9 * std::f64::consts::PI * ball.radius_px.powi(2));
    }

    #[test]
    fn a_cut_out_beyond_the_border_is_cut_off() {
        let measurement = test_measurements::two_bounces();
        let mut strobe = measurement.strobe.unwrap();
        strobe.balls[0].corner_px = (-10, -12);
        strobe.balls[0].centre = PixelPoint::new(2.0, 1.0);
        strobe.balls[1].corner_px = (1270, 715);
        strobe.balls[1].centre = PixelPoint::new(1279.0, 719.0);
        composite(&strobe, &[0, 1, 9999]);
    }

    #[test]
    fn the_picture_is_small_complete_and_well_formed() {
        let measurement = test_measurements::two_bounces();
        let picture = strobe_picture(&measurement, 1).unwrap().unwrap();
        assert!(picture.svg.len() < 1_000_000, "{}", picture.svg.len());
        assert_eq!(picture.svg.matches(r#"class="arc""#).count(), 3);
        assert_eq!(picture.svg.matches(r#"class="impact""#).count(), 2);
        assert_eq!(
            picture.svg.matches("<svg").count(),
            picture.svg.matches("</svg>").count()
        );
        assert!(picture.svg.contains("20 cm"), "a scale bar");
        // The photograph's base64 may spell anything.
        let (_, drawing) = picture.svg.split_once("\"/>").unwrap();
        assert!(!drawing.contains("NaN"));
    }

    #[test]
    fn without_material_there_is_no_picture_and_bad_material_is_an_error() {
        assert_eq!(strobe_picture(&test_measurements::rejected(), 1).unwrap(), None);
        let mut measurement = test_measurements::two_bounces();
        std::sync::Arc::make_mut(&mut measurement.strobe.as_mut().unwrap().background)
            .data
            .pop();
        assert!(matches!(
            strobe_picture(&measurement, 1),
            Err(StrobeError::Size { .. })
        ));
    }

    #[test]
    fn without_any_ball_the_scene_is_shown_empty() {
        let mut measurement = test_measurements::two_bounces();
        measurement.strobe.as_mut().unwrap().balls.clear();
        let picture = strobe_picture(&measurement, 1).unwrap().unwrap();
        assert_eq!((picture.shown, picture.interval_s), (0, None));
    }
}
