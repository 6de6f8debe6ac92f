//! The part of a recording's page that shows how the ball turned: rates, the ball unwrapped, angle against time, and its pictures turned
//! back by the fitted rotation, which look alike where it is right.

use super::chart::{Chart, LineStyle, PlotPoint, PointMarker};
use super::figure::{PlotError, PlotUse};
use super::jpeg::jpeg;
use super::words::{NO_VALUE, format_quantity};
use crate::frames::Luma;
use crate::pipeline::{ArcSpin, BallTurning, Measurement, StrobeBall};
use crate::rotation::cube_map::value_at;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use maud::{Markup, PreEscaped, html};
use nalgebra::Vector3;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use thiserror::Error;

/// Pictures of the ball in a row.
const PICTURES: usize = 10;

/// Side of such a picture, and height of the unwrapped ball, px.
const TILE_PX: usize = 64;
const MAP_HEIGHT_PX: usize = 120;

/// Largest size of a picture, bytes.
const MOST_BYTES: usize = 60_000;

/// What is not seen.
const UNSEEN_GREY: f64 = 150.0;

/// Points of an angle's plot.
const MOST_POINTS: usize = 240;

/// Why the pictures of a ball could not be made.
#[derive(Debug, Error)]
pub enum SpinPictureError {
    /// The plot.
    #[error(transparent)]
    Plot(#[from] PlotError),
    /// The encoder.
    #[error("a picture of the ball could not be encoded")]
    Encoder(#[source] opencv::Error),
}

/// The section; nothing where the ball's marks say nothing.
pub(super) fn spin_section(measurement: &Measurement) -> Result<Markup, SpinPictureError> {
    let spins = || {
        measurement
            .arcs
            .iter()
            .enumerate()
            .filter_map(|(k, arc)| Some((k, arc.spin.as_ref()?)))
    };
    let says_something = |spin: &ArcSpin| spin.rate_rad_s.is_some() || !spin.candidates_rad_s.is_empty();
    if !spins().any(|(_, spin)| says_something(spin)) {
        return Ok(Markup::default());
    }
    let figures: Vec<Markup> = spins()
        .filter_map(|(k, spin)| Some(arc_figures(measurement, k, spin.turning.as_ref()?)))
        .collect::<Result<_, _>>()?;
    Ok(html! {
        section {
            h2 { "Spin, from the marks on the ball" }
            div.scroll {
                table.bounces {
                    thead { tr {
                        th scope="col" { "arc" }
                        th scope="col" { "about y: in the plane of motion" }
                        th scope="col" { "turns a second" }
                        th scope="col" { "about x" }
                        th scope="col" { "about z: upright" }
                    } }
                    tbody {
                        @for (k, spin) in spins() { (rates(k, spin)) }
                    }
                }
            }
            @for figure in &figures { (figure) }
            p.soft {
                "Rates are positive about y where the top of the ball moves along x. "
                i { "Rω" } " of the bounces is the radius times the rate about y. "
                "The ball unwrapped: longitude about the axis of rotation to the right, its north pole at the top, what was never seen in plain \
                 grey. Pictures of the ball as they are, and below them the same ones without the light on the ball, turned back by the fitted rotation to the middle of the arc: \
                 where that is right, they look alike."
            }
        }
    })
}

fn rates(k: usize, spin: &ArcSpin) -> Markup {
    let about = |axis: usize| format_quantity(spin.rate_rad_s.map(|rate| rate[axis]), "rad/s");
    let turns = spin.rate_rad_s.map(|rate| rate[1].scaled(1.0 / TAU));
    html! {
        tr {
            th scope="row" { (k + 1) }
            td.v { (about(1)) }
            td.v { (format_quantity(turns, "/s")) }
            td.v { (about(0)) }
            td.v { (about(2)) }
        }
        @if !spin.candidates_rad_s.is_empty() || spin.reason.is_some() {
            tr {
                td {}
                td colspan="4" {
                    (spin.reason.as_deref().unwrap_or(NO_VALUE))
                    @if !spin.candidates_rad_s.is_empty() {
                        ". Candidates about y, rad/s: "
                        (spin.candidates_rad_s.iter().map(|rate| format!("{rate:.1}")).collect::<Vec<_>>().join(", "))
                    }
                }
            }
        }
    }
}

/// What is drawn of an arc.
fn arc_figures(
    measurement: &Measurement,
    k: usize,
    turning: &BallTurning,
) -> Result<Markup, SpinPictureError> {
    let arc = k + 1;
    let chart = angle_chart(turning, arc);
    let plot = chart.map(|chart| chart.svg(PlotUse::Page)).transpose()?;
    let map = picture(&unwrapped(turning), &format!("the ball on arc {arc}, unwrapped"))?;
    let balls = measurement
        .strobe
        .as_ref()
        .map_or(&[][..], |strobe| &strobe.balls);
    let row = turned_back(turning, balls);
    let words = format!("pictures of the ball on arc {arc}, as they are and turned back");
    let row = row.map(|row| picture(&row, &words)).transpose()?;
    Ok(html! {
        h3 { "Arc " (arc) }
        figure { (map) }
        @if let Some(row) = row { figure { (row) } }
        @if let Some(plot) = plot { figure.scroll { (PreEscaped(plot)) } }
    })
}

fn picture(luma: &Luma, words: &str) -> Result<Markup, SpinPictureError> {
    let bytes = jpeg(luma, None, luma.width, MOST_BYTES).map_err(SpinPictureError::Encoder)?;
    let source = format!("data:image/jpeg;base64,{}", STANDARD.encode(bytes));
    Ok(
        html! { img src=(source) alt=(words) width=(luma.width) height=(luma.height) style="max-width:100%;height:auto"; },
    )
}

/// Turned angle against time, with what each picture has beyond the steady rate.
fn angle_chart(turning: &BallTurning, arc: usize) -> Option<Chart> {
    let (first, last) = (turning.frames.first()?, turning.frames.last()?);
    let every = turning.frames.len().div_ceil(MOST_POINTS).max(1);
    let turns = |rad: f64| (rad - first.turned_rad) / TAU;
    let drawn = || turning.frames.iter().step_by(every);
    let point = |x: f64, y: f64, y_std: Option<f64>| PlotPoint {
        x,
        y,
        x_std: None,
        y_std,
        marker: PointMarker::Disc,
    };
    let most = turns(last.turned_rad).max(0.1);
    let room_s = 0.03 * (last.time_s - first.time_s).max(1e-9);
    Some(Chart {
        name: format!("turned angle against time on arc {arc}"),
        x_label: "t (s)".to_owned(),
        y_label: "turns".to_owned(),
        x: first.time_s - room_s..last.time_s + room_s,
        y: -0.06 * most..1.06 * most,
        curves: vec![(
            LineStyle::Solid,
            vec![(first.time_s, 0.0), (last.time_s, turns(last.turned_rad))],
        )],
        dots: drawn()
            .map(|f| point(f.time_s, turns(f.turned_rad + f.residual_rad), None))
            .collect(),
        transitions: Vec::new(),
        words: Vec::new(),
        residuals: drawn()
            .map(|f| {
                point(
                    f.time_s,
                    f.residual_rad.to_degrees(),
                    Some(f.std_rad.to_degrees()),
                )
            })
            .collect(),
        residual_label: "residual (°)",
        legend: Vec::new(),
    })
}

/// The ball's albedo by longitude and latitude about the axis of rotation.
fn unwrapped(turning: &BallTurning) -> Luma {
    let [one, two, axis] = turning.ball_axes();
    let (width, height) = (2 * MAP_HEIGHT_PX, MAP_HEIGHT_PX);
    let mut values = Vec::with_capacity(width * height);
    for row in 0..height {
        let latitude = FRAC_PI_2 - PI * (row as f64 + 0.5) / height as f64;
        for column in 0..width {
            let longitude = TAU * (column as f64 + 0.5) / width as f64;
            let d = latitude.cos() * (longitude.cos() * one + longitude.sin() * two) + latitude.sin() * axis;
            let corners = turning.maps.grid.corners(&d);
            let seen = value_at(&turning.maps.seen, &corners);
            values.push((seen > 0.5).then(|| f64::from(value_at(&turning.maps.albedo, &corners)).exp()));
        }
    }
    stretched(&values, width)
}

/// As a picture from black to white; what has no value in plain grey.
fn stretched(values: &[Option<f64>], width: usize) -> Luma {
    let mut known: Vec<f64> = values.iter().flatten().copied().collect();
    known.sort_by(f64::total_cmp);
    let quantile = |share: f64| {
        known
            .get((share * (known.len().max(1) - 1) as f64) as usize)
            .copied()
            .unwrap_or(0.0)
    };
    let (low, high) = (quantile(0.005), quantile(0.995));
    let grey = |v: f64| 20.0 + 215.0 * ((v - low) / (high - low).max(1e-6)).clamp(0.0, 1.0);
    Luma {
        width,
        height: values.len() / width,
        data: values
            .iter()
            .map(|v| v.map_or(UNSEEN_GREY, grey).round() as u8)
            .collect(),
    }
}

/// Pictures of the ball spread over the arc: as they are in the upper row, in the lower without its light and turned back to the middle.
fn turned_back(turning: &BallTurning, balls: &[StrobeBall]) -> Option<Luma> {
    let ball = |frame: usize| balls.iter().find(|b| b.frame == frame);
    let seen: Vec<_> = turning
        .frames
        .iter()
        .filter_map(|f| Some((f, ball(f.frame)?)))
        .collect();
    if seen.is_empty() {
        return None;
    }
    let count = PICTURES.min(seen.len());
    let chosen: Vec<_> = (0..count)
        .map(|i| seen[i * (seen.len() - 1) / (count - 1).max(1)])
        .collect();
    let width = TILE_PX * count;
    let (mut plain, mut turned) = (vec![None; width * TILE_PX], vec![None; width * TILE_PX]);
    for (i, (f, ball)) in chosen.into_iter().enumerate() {
        let turn = turning.turn_at(f.time_s);
        for k in 0..TILE_PX * TILE_PX {
            let (row, column) = (k / TILE_PX, k % TILE_PX);
            let at = |x: usize| 2.1 * ((x as f64 + 0.5) / TILE_PX as f64 - 0.5);
            let (a, b) = (at(column), at(row));
            let square = a * a + b * b;
            if square > 0.95 {
                continue;
            }
            let place = row * width + TILE_PX * i + column;
            plain[place] = grey_at(ball, [a, b]);
            let there = turn * Vector3::new(a, b, -(1.0 - square).sqrt());
            if there.z < -0.3 {
                let light = value_at(
                    &turning.maps.light,
                    &turning.maps.disc.corners([there.x, there.y]),
                )
                .exp();
                turned[place] = grey_at(ball, [there.x, there.y]).map(|grey| grey / f64::from(light));
            }
        }
    }
    let mut picture = stretched(&plain, width);
    picture.data.extend(stretched(&turned, width).data);
    picture.height *= 2;
    Some(picture)
}

/// Brightness of a cut-out at a place on the ball, radii from its centre; `None` beyond it.
fn grey_at(ball: &StrobeBall, [a, b]: [f64; 2]) -> Option<f64> {
    let u = ball.centre.u_px + a * ball.radius_px - ball.corner_px.0 as f64;
    let v = ball.centre.v_px + b * ball.radius_px - ball.corner_px.1 as f64;
    let (column, row) = (u.floor(), v.floor());
    let inside = column >= 0.0
        && row >= 0.0
        && (column as usize) + 1 < ball.luma.width
        && (row as usize) + 1 < ball.luma.height;
    inside.then(|| {
        let (part_u, part_v) = (u - column, v - row);
        let at = |du: usize, dv: usize| f64::from(ball.luma.row(row as usize + dv)[column as usize + du]);
        let above = at(0, 0) * (1.0 - part_u) + at(1, 0) * part_u;
        let below = at(0, 1) * (1.0 - part_u) + at(1, 1) * part_u;
        above * (1.0 - part_v) + below * part_v
    })
}
