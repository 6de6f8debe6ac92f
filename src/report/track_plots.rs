//! The plots of the page: a coordinate against time, and below it what is left after the arcs are taken away.
//!
//! A dot is a centre in use, a cross one that is not; dashed lines are impacts, numbered as in the tables.

use super::drawing_geometry;
use super::figure::{
    self, ARC, Area, Axis, Dashes, FINE, IMPACT, INK, Panel, PanelAxes, PlotError, PlotUse, UNUSED,
    error_bar, panel, span, text_style,
};
use crate::pipeline::{ArcTrace, Measurement, PointUse, TrackPoint, View};
use plotters::prelude::*;
use std::ops::Range;

/// Design size, screen pixels.
const MAIN_HEIGHT: u32 = 250;
const RESIDUAL_HEIGHT: u32 = 130;
const TIME_AXIS_HEIGHT: u32 = 44;
/// At most this many points are drawn a panel; of a longer track every n-th.
const MAX_POINTS: usize = 400;

const BAND: RGBColor = RGBColor(228, 228, 228);

/// Which coordinate is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coordinate {
    /// x along the launch; the column u without a scale.
    Along,
    /// z, or y in a top view; the row v without a scale.
    Up,
}

/// A finished plot.
#[derive(Debug, Clone, PartialEq)]
pub struct Plot {
    /// A complete `<svg>` element, for a page.
    pub svg: String,
    /// What is drawn, for the caption: "x", "z", "y", "u" or "v".
    pub symbol: &'static str,
    /// Every how many-th point is drawn; 1 for all.
    pub every: usize,
    /// Whether there is a residual panel.
    pub residuals: bool,
}

/// One coordinate of the track against time with its residuals below; `None` without points.
///
/// # Errors
/// See [`PlotError`].
pub fn coordinate_plot(
    measurement: &Measurement,
    coordinate: Coordinate,
    goes: PlotUse,
) -> Result<Option<Plot>, PlotError> {
    let Some(data) = CoordinateData::of(measurement, coordinate, goes) else {
        return Ok(None);
    };
    let residuals = data.residual_reach.is_some();
    let main_height = MAIN_HEIGHT + if residuals { 0 } else { TIME_AXIS_HEIGHT };
    let height = main_height
        + if residuals {
            RESIDUAL_HEIGHT + TIME_AXIS_HEIGHT
        } else {
            0
        };
    let attributes = goes.attributes(&format!("{} against time", data.symbol), height);
    let svg = figure::svg((goes.width(), height), &attributes, |root| {
        let (main, below) = root.split_vertically(main_height * FINE);
        main_panel(&main, &data, !residuals)?;
        match data.residual_reach {
            Some(reach) => residual_panel(&below, &data, reach),
            None => Ok(()),
        }
    })?;
    Ok(Some(Plot {
        svg,
        symbol: data.symbol,
        every: data.every,
        residuals,
    }))
}

/// What is drawn, in the units of the axes.
struct CoordinateData {
    symbol: &'static str,
    unit: &'static str,
    residual_unit: &'static str,
    points: Vec<TimePoint>,
    /// Polylines.
    arcs: Vec<Vec<(f64, f64)>>,
    impacts: Vec<(usize, f64)>,
    time: Range<f64>,
    /// From the lower end of the axis to the upper; rows of the picture run downwards.
    value: Range<f64>,
    /// Half the height of the residual panel; `None` where there are no residuals.
    residual_reach: Option<f64>,
    /// What a centre scatters by.
    band: Option<f64>,
    every: usize,
    /// Ticks wanted along the time.
    time_ticks: usize,
}

struct TimePoint {
    time_s: f64,
    value: f64,
    used: bool,
    residual: Option<f64>,
    std: Option<f64>,
}

impl CoordinateData {
    fn of(measurement: &Measurement, coordinate: Coordinate, goes: PlotUse) -> Option<Self> {
        let all = &measurement.track.points;
        let scaled = all.iter().any(|point| point.world.is_some());
        let (symbol, unit, residual_unit) = match (scaled, coordinate, measurement.view) {
            (true, Coordinate::Along, _) => ("x", "m", "mm"),
            (true, Coordinate::Up, View::Side) => ("z", "m", "mm"),
            (true, Coordinate::Up, View::Top) => ("y", "m", "mm"),
            (false, Coordinate::Along, _) => ("u", "px", "px"),
            (false, Coordinate::Up, _) => ("v", "px", "px"),
        };
        // Residual units a pixel.
        let per_pixel = if scaled {
            drawing_geometry::metres_per_pixel(all).map(|m| 1e3 * m)
        } else {
            Some(1.0)
        };
        let read = CoordinateReader { coordinate, scaled };
        let every = all.len().div_ceil(MAX_POINTS).max(1);
        let drawn = all.iter().step_by(every);
        let points: Vec<TimePoint> = drawn
            .filter_map(|point| read.point(point, &measurement.arcs, per_pixel))
            .collect();
        let arcs: Vec<Vec<(f64, f64)>> = measurement.arcs.iter().map(|arc| read.polyline(arc)).collect();
        let places = || {
            let points = points.iter().map(|point| (point.time_s, point.value));
            points.chain(arcs.iter().flatten().copied())
        };
        let time = span(places().map(|place| place.0), 0.02)?;
        let mut value = span(places().map(|place| place.1), 0.07)?;
        if symbol == "v" {
            value = value.end..value.start;
        }
        let centre_std_px = measurement.track.centre_std_px;
        let band = centre_std_px.zip(per_pixel).map(|(std, per)| std * per);
        Some(Self {
            time_ticks: goes.ticks(),
            time,
            value,
            residual_reach: reach(&points, band),
            impacts: drawing_geometry::impacts(measurement)
                .iter()
                .map(|mark| (mark.number, mark.time_s))
                .collect(),
            symbol,
            unit,
            residual_unit,
            points,
            arcs,
            band,
            every,
        })
    }
}

impl CoordinateData {
    /// Radius of a dot, in units of the drawing: smaller where dots would run into each other.
    fn dot(&self) -> u32 {
        if self.points.len() > 120 { 16 } else { 22 }
    }
}

/// How a coordinate is read off the points and the arcs.
#[derive(Clone, Copy)]
struct CoordinateReader {
    coordinate: Coordinate,
    scaled: bool,
}

impl CoordinateReader {
    fn point(self, point: &TrackPoint, arcs: &[ArcTrace], per_pixel: Option<f64>) -> Option<TimePoint> {
        Some(TimePoint {
            time_s: point.time_s,
            value: self.value(point)?,
            used: matches!(point.use_, PointUse::Used(_)),
            residual: self.residual(point, arcs),
            std: point.std_px.zip(per_pixel).map(|(std, per)| std * per),
        })
    }

    fn value(self, point: &TrackPoint) -> Option<f64> {
        let value = match (self.coordinate, self.scaled) {
            (Coordinate::Along, true) => point.world?.x_m,
            (Coordinate::Up, true) => point.world?.up_m,
            (Coordinate::Along, false) => point.pixel.u_px,
            (Coordinate::Up, false) => point.pixel.v_px,
        };
        (value.is_finite() && point.time_s.is_finite()).then_some(value)
    }

    /// In mm as the fit gives it; without a scale in px, from the arc's own samples.
    fn residual(self, point: &TrackPoint, arcs: &[ArcTrace]) -> Option<f64> {
        let residual = match (self.coordinate, self.scaled) {
            (Coordinate::Along, true) => 1e3 * point.residual_m?.x_m,
            (Coordinate::Up, true) => 1e3 * point.residual_m?.up_m,
            (_, false) => {
                let PointUse::Used(index) = point.use_ else {
                    return None;
                };
                let fitted = drawing_geometry::on_arc(arcs.get(index)?, point.time_s, |sample| {
                    match self.coordinate {
                        Coordinate::Along => sample.pixel.u_px,
                        Coordinate::Up => sample.pixel.v_px,
                    }
                })?;
                self.value(point)? - fitted
            }
        };
        residual.is_finite().then_some(residual)
    }

    fn polyline(self, arc: &ArcTrace) -> Vec<(f64, f64)> {
        arc.samples
            .iter()
            .filter_map(|sample| {
                let value = match (self.coordinate, self.scaled) {
                    (Coordinate::Along, true) => sample.world?.x_m,
                    (Coordinate::Up, true) => sample.world?.up_m,
                    (Coordinate::Along, false) => sample.pixel.u_px,
                    (Coordinate::Up, false) => sample.pixel.v_px,
                };
                (value.is_finite() && sample.time_s.is_finite()).then_some((sample.time_s, value))
            })
            .collect()
    }
}

/// Half the height of the residual panel: room for every used point and for the band. Points that were thrown out may
/// lie beyond it; they are drawn at its edge.
fn reach(points: &[TimePoint], band: Option<f64>) -> Option<f64> {
    let largest = points
        .iter()
        .filter(|point| point.used)
        .filter_map(|point| point.residual)
        .map(f64::abs)
        .reduce(f64::max)?;
    let reach = 1.2 * largest.max(2.0 * band.unwrap_or(0.0));
    Some(if reach > 0.0 { reach } else { 1.0 })
}

fn main_panel(area: &Area<'_>, data: &CoordinateData, time_axis: bool) -> Result<(), PlotError> {
    let label = format!("{} / {}", data.symbol, data.unit);
    let mut panel = time_panel(area, data, data.value.clone(), 6, &label, time_axis)?;
    draw_impacts(&mut panel, data, &data.value, true)?;
    let dot = data.dot();
    for point in &data.points {
        draw_point(&mut panel, (point.time_s, point.value), point.used, dot)?;
    }
    for arc in &data.arcs {
        panel.draw_series(LineSeries::new(arc.iter().copied(), ARC.stroke_width(11)))?;
    }
    Ok(())
}

fn residual_panel(area: &Area<'_>, data: &CoordinateData, reach: f64) -> Result<(), PlotError> {
    let label = format!("residual / {}", data.residual_unit);
    let mut panel = time_panel(area, data, -reach..reach, 4, &label, true)?;
    let time = &data.time;
    if let Some(band) = data.band.filter(|band| *band > 0.0) {
        let band = band.min(reach);
        panel.draw_series([Rectangle::new(
            [(time.start, band), (time.end, -band)],
            BAND.filled(),
        )])?;
    }
    draw_impacts(&mut panel, data, &(-reach..reach), false)?;
    panel.draw_series(LineSeries::new(
        [(time.start, 0.0), (time.end, 0.0)],
        INK.stroke_width(8),
    ))?;
    let dot = data.dot();
    for point in &data.points {
        let Some(residual) = point.residual else {
            continue;
        };
        if residual.abs() > reach {
            let edge = reach.copysign(residual);
            let size = 4 * FINE as i32 * if edge > 0.0 { 1 } else { -1 };
            panel.draw_series([TriangleMarker::new(
                (point.time_s, 0.93 * edge),
                size,
                UNUSED.filled(),
            )])?;
            continue;
        }
        if let Some(std) = point.std.filter(|std| point.used && *std > 0.0) {
            let (low, high) = ((residual - std).max(-reach), (residual + std).min(reach));
            let ends = [(point.time_s, low), (point.time_s, high)];
            error_bar(&mut panel, ends, UNUSED.stroke_width(7))?;
        }
        draw_point(&mut panel, (point.time_s, residual), point.used, dot)?;
    }
    Ok(())
}

fn time_panel<'a, 'b>(
    area: &'a Area<'b>,
    data: &CoordinateData,
    y: Range<f64>,
    ticks: usize,
    y_label: &str,
    time_axis: bool,
) -> Result<Panel<'a, 'b>, PlotError> {
    let axes = PanelAxes {
        x: Axis::new(data.time.clone(), data.time_ticks),
        y: Axis::new(y, ticks),
        x_label: time_axis.then_some("time / s"),
        y_label,
        above: 12,
        left: 66,
        below: TIME_AXIS_HEIGHT,
        right: 14,
        font: 16,
        light_lines: false,
    };
    panel(area, axes)
}

fn draw_impacts(
    panel: &mut Panel<'_, '_>,
    data: &CoordinateData,
    value: &Range<f64>,
    numbered: bool,
) -> Result<(), PlotError> {
    let shown = |time: &f64| data.time.contains(time);
    for (number, time) in data.impacts.iter().filter(|(_, time)| shown(time)) {
        let line = [(*time, value.start), (*time, value.end)];
        let style = Dashes::style(Some(Dashes::Short), IMPACT, 9);
        panel.draw_series(LineSeries::new(line, style))?;
        if numbered {
            let style = text_style(16, FontStyle::Bold, &IMPACT);
            let place = EmptyElement::at((*time, value.end))
                + Text::new(number.to_string(), (4 * FINE as i32, 3 * FINE as i32), style);
            panel.draw_series([place])?;
        }
    }
    Ok(())
}

/// A dot for a point in use, a grey cross for one that is not.
fn draw_point(panel: &mut Panel<'_, '_>, at: (f64, f64), used: bool, dot: u32) -> Result<(), PlotError> {
    if used {
        panel.draw_series([Circle::new(at, dot, INK.filled())])?;
    } else {
        panel.draw_series([Cross::new(at, 30, UNUSED.stroke_width(11))])?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::test_measurements;

    fn plot(measurement: &Measurement, coordinate: Coordinate) -> Plot {
        coordinate_plot(measurement, coordinate, PlotUse::Page)
            .unwrap()
            .unwrap()
    }

    #[test]
    fn every_point_is_drawn_by_its_shape() {
        let measurement = test_measurements::two_bounces();
        let used = measurement
            .track
            .points
            .iter()
            .filter(|p| matches!(p.use_, PointUse::Used(_)))
            .count();
        let plot = plot(&measurement, Coordinate::Up);
        assert_eq!((plot.symbol, plot.every, plot.residuals), ("z", 1, true));
        assert_eq!(
            plot.svg.matches("<circle").count(),
            2 * used,
            "in the panel and in its residuals"
        );
        assert!(plot.svg.contains("z / m") && plot.svg.contains("residual / mm"));
        assert!(plot.svg.contains("time / s"));
        assert!(!plot.svg.contains("NaN"));
        assert!(plot.svg.len() < 250_000, "{}", plot.svg.len());
    }

    #[test]
    fn without_a_scale_pixels_are_drawn_and_rows_run_down() {
        let measurement = test_measurements::no_scale();
        let plot = plot(&measurement, Coordinate::Up);
        assert_eq!((plot.symbol, plot.residuals), ("v", true));
        assert!(plot.svg.contains("v / px") && plot.svg.contains("residual / px"));
        let data = CoordinateData::of(&measurement, Coordinate::Up, PlotUse::Page).unwrap();
        assert!(data.value.start > data.value.end);
        let rms = (data
            .points
            .iter()
            .filter_map(|p| p.residual)
            .map(|r| r * r)
            .sum::<f64>()
            / data.points.iter().filter(|p| p.residual.is_some()).count() as f64)
            .sqrt();
        assert!((0.04..0.06).contains(&rms), "the noise that was put in: {rms}");
    }

    #[test]
    fn a_top_view_draws_y() {
        assert_eq!(plot(&test_measurements::top_view(), Coordinate::Up).symbol, "y");
    }

    #[test]
    fn without_arcs_there_are_no_residuals_and_without_points_no_plot() {
        assert!(!plot(&test_measurements::rejected(), Coordinate::Along).residuals);
        assert_eq!(
            coordinate_plot(
                &test_measurements::nothing_seen(),
                Coordinate::Along,
                PlotUse::Page
            )
            .unwrap(),
            None
        );
        let mut single = test_measurements::rejected();
        single.track.points.truncate(1);
        assert!(plot(&single, Coordinate::Up).svg.contains("<svg"));
    }

    #[test]
    fn a_long_track_is_thinned() {
        let mut measurement = test_measurements::two_bounces();
        let points = measurement.track.points.clone();
        measurement.track.points = points.iter().cycle().take(20_000).cloned().collect();
        let plot = plot(&measurement, Coordinate::Along);
        assert_eq!(plot.every, 50);
        assert!(plot.svg.len() < 400_000, "{}", plot.svg.len());
    }

    #[test]
    fn a_thrown_out_point_far_off_does_not_flatten_the_rest() {
        let mut measurement = test_measurements::two_bounces();
        let outlier = measurement
            .track
            .points
            .iter_mut()
            .find(|p| p.frame == 97)
            .unwrap();
        outlier.residual_m.as_mut().unwrap().x_m = 4.0;
        let data = CoordinateData::of(&measurement, Coordinate::Along, PlotUse::Page).unwrap();
        assert!(data.residual_reach.unwrap() < 0.5, "mm");
    }

    #[test]
    fn values_that_are_not_finite_are_left_out() {
        let mut measurement = test_measurements::two_bounces();
        measurement.track.points[5].world.as_mut().unwrap().x_m = f64::NAN;
        measurement.track.points[6].time_s = f64::NAN;
        assert!(!plot(&measurement, Coordinate::Along).svg.contains("NaN"));
    }
}
