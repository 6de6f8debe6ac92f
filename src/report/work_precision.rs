//! Work-precision diagrams: error upwards, work to the right, both logarithmic.
//!
//! Markers and dashes tell the curves apart, so that grey print loses nothing. The Pareto front is a broad grey line
//! behind them, floors are dashed lines with their names, the default setting is ringed, bars are quartiles, and what
//! failed is a cross at the edge.

use super::track_plots::{ARC, FINE, GRID, IMPACT, INK, PlotError};
use super::words::superscript;
use crate::cost::{Diagram, Run};
use plotters::coord::Shift;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::prelude::*;
use std::ops::Range;

/// Design size, screen pixels.
pub(super) const WIDTH: u32 = 720;
pub(super) const HEIGHT: u32 = 380;
const LEGEND_WIDTH: u32 = 196;
const TITLE_HEIGHT: u32 = 26;
const FRONT: RGBColor = RGBColor(200, 200, 200);
const LIGHT_GRID: RGBColor = RGBColor(240, 240, 240);
const FLOOR: RGBColor = RGBColor(90, 90, 90);
/// Half the size of a marker.
const SIZE: i32 = 42;
/// Widths of lines that [`compact`] makes dashes of; plotters itself would draw every dash as a line of its own, which
/// makes a page several times larger. Nothing else has these widths.
const SOLID: u32 = 13;
const DASHED: u32 = 14;
const DOTTED: u32 = 15;
const FLOOR_LINE: u32 = 11;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type LogPanel<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<LogAxis, LogAxis>>;

/// A logarithmic axis; values are decimal logarithms.
struct LogAxis {
    range: Range<f64>,
    bold: Vec<f64>,
    light: Vec<f64>,
    /// Whether labels are powers of ten.
    powers: bool,
}

impl LogAxis {
    fn new(range: Range<f64>) -> Self {
        let (first, last) = (range.start.floor() as i32, range.end.ceil() as i32);
        let inside = |x: &f64| (range.start..=range.end).contains(x);
        let decades: Vec<f64> = (first..=last).map(f64::from).filter(inside).collect();
        let parts = |digits: &[f64]| -> Vec<f64> {
            (first..=last)
                .flat_map(|decade| digits.iter().map(move |d| f64::from(decade) + d.log10()))
                .filter(inside)
                .collect()
        };
        let mut light = parts(&[2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]);
        let bold = if decades.len() > 7 {
            let every = decades.len().div_ceil(7);
            light.clone_from(&decades);
            decades.into_iter().step_by(every).collect()
        } else if decades.len() >= 3 {
            decades
        } else {
            let choices: [&[f64]; 2] = [&[1.0, 2.0, 5.0], &[1.0, 2.0, 3.0, 5.0, 7.0]];
            let fits = choices.into_iter().map(parts).find(|ticks| ticks.len() >= 3);
            fits.unwrap_or_else(|| parts(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]))
        };
        let powers = range.start < -4.0 || range.end > 5.0;
        Self {
            range,
            bold,
            light,
            powers,
        }
    }
}

impl Ranged for LogAxis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (low, high): (i32, i32)) -> i32 {
        let share = (value - self.range.start) / (self.range.end - self.range.start);
        low + (share * f64::from(high - low)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if hint.weight().allow_light_points() {
            self.light.clone()
        } else {
            self.bold.clone()
        }
    }

    fn range(&self) -> Range<f64> {
        self.range.clone()
    }
}

impl ValueFormatter<f64> for LogAxis {
    fn format_ext(&self, value: &f64) -> String {
        let decade = (value + 1e-9).floor() as i32;
        let digit = 10_f64.powf(value - f64::from(decade)).round() as i32;
        match (self.powers, digit) {
            (true, 1) => format!("10{}", superscript(decade)),
            (true, _) => format!("{digit}·10{}", superscript(decade)),
            (false, _) => format!(
                "{:.*}",
                usize::try_from(-decade).unwrap_or(0),
                f64::from(digit) * 10_f64.powi(decade)
            ),
        }
    }
}

/// The diagram as a complete `<svg>` element.
///
/// # Errors
/// See [`PlotError`].
pub(super) fn svg(diagram: &Diagram, runs: &[Run], caption: &str) -> Result<String, PlotError> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, (WIDTH * FINE, HEIGHT * FINE)).into_drawing_area();
        draw(&root, diagram, runs, caption)?;
        root.present()?;
    }
    let size = format!(r#"width="{}" height="{}""#, WIDTH * FINE, HEIGHT * FINE);
    let name = format!(
        r#"class="plot" role="img" aria-label="{}""#,
        super::page::escape(&diagram.title)
    );
    Ok(compact(&svg.replacen(&size, &name, 1)))
}

/// Several diagrams below each other, two in a row, as an SVG file of its own.
///
/// # Errors
/// See [`PlotError`].
pub(super) fn overview(diagrams: &[(&Diagram, &[Run], String)]) -> Result<String, PlotError> {
    let rows = diagrams.len().div_ceil(2).max(1) as u32;
    let columns = diagrams.len().clamp(1, 2) as u32;
    let (width, height) = (columns * WIDTH, rows * HEIGHT);
    let mut svg = String::new();
    {
        let size = (width * FINE, height * FINE);
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        root.fill(&WHITE)?;
        let areas = root.split_evenly((rows as usize, columns as usize));
        for (area, (diagram, runs, caption)) in areas.iter().zip(diagrams) {
            draw(area, diagram, runs, caption)?;
        }
        root.present()?;
    }
    let size = format!(r#"width="{}" height="{}""#, width * FINE, height * FINE);
    let shown = format!(
        r#"width="{width}" height="{height}" font-family="Helvetica, Arial, 'Liberation Sans', sans-serif""#
    );
    Ok(compact(&svg.replacen(&size, &shown, 1)))
}

/// Without what says nothing, and with lines of certain widths as dashes.
fn compact(svg: &str) -> String {
    let mut svg = svg
        .replace(" opacity=\"1\"", "")
        .replace(" font-family=\"sans-serif\"", "");
    for (width, dash) in [(DASHED, "90 50"), (DOTTED, "30 40"), (FLOOR_LINE, "120 50")] {
        let (mark, stroke) = (
            format!("stroke-width=\"{width}\""),
            format!("stroke-width=\"{width}\" stroke-dasharray=\"{dash}\""),
        );
        svg = svg.replace(&mark, &stroke);
    }
    svg
}

fn draw(area: &Area<'_>, diagram: &Diagram, runs: &[Run], caption: &str) -> Result<(), PlotError> {
    let (title, below) = area.split_vertically(TITLE_HEIGHT * FINE);
    let style = ("sans-serif", 18 * FINE)
        .into_font()
        .style(FontStyle::Bold)
        .color(&INK);
    title.draw(&Text::new(
        caption.to_owned(),
        (8 * FINE as i32, 6 * FINE as i32),
        style,
    ))?;
    let (main, legend) = below.split_horizontally((WIDTH - LEGEND_WIDTH) * FINE);
    let Some(view) = LogRanges::of(diagram, runs) else {
        let style = ("sans-serif", 15 * FINE).into_font().color(&INK);
        let at = (80 * FINE as i32, 120 * FINE as i32);
        main.draw(&Text::new("nothing was measured".to_owned(), at, style))?;
        return Ok(());
    };
    let mut panel = view.panel(&main, diagram)?;
    view.draw_front(&mut panel, diagram, runs)?;
    view.draw_floors(&mut panel, diagram)?;
    for (i, curve) in diagram.curves.iter().enumerate() {
        view.draw_curve(&mut panel, i, diagram, &curve.runs, runs)?;
    }
    view.draw_failures(&mut panel, diagram, runs)?;
    draw_legend(&legend, diagram, runs)
}

/// What is seen of a diagram, in decimal logarithms.
struct LogRanges {
    work: Range<f64>,
    error: Range<f64>,
}

impl LogRanges {
    /// Room for every point, its bars and the floors; `None` without points.
    fn of(diagram: &Diagram, runs: &[Run]) -> Option<Self> {
        let all = || diagram.curves.iter().flat_map(|c| &c.runs);
        let points: Vec<(f64, f64)> = all()
            .filter_map(|&i| runs[i].place(&diagram.error, &diagram.work))
            .collect();
        if points.is_empty() {
            return None;
        }
        let works = all()
            .filter_map(|&i| runs[i].work(diagram.work.name))
            .flat_map(|s| [s.q1, s.median, s.q3]);
        let least = points.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
        // A floor far below everything would press the points together.
        let floors = diagram
            .floors
            .iter()
            .map(|f| f.error)
            .filter(|f| *f > 1e-4 * least);
        Some(Self {
            work: span(works, 0.04)?,
            error: span(points.iter().map(|p| p.1).chain(floors), 0.08)?,
        })
    }

    fn panel<'a, 'b>(&self, area: &'a Area<'b>, diagram: &Diagram) -> Result<LogPanel<'a, 'b>, PlotError> {
        let mut chart = ChartBuilder::on(area)
            .margin_top(8 * FINE)
            .margin_right(6 * FINE)
            .margin_left(4 * FINE)
            .set_label_area_size(LabelAreaPosition::Left, 82 * FINE)
            .set_label_area_size(LabelAreaPosition::Bottom, 46 * FINE)
            .build_cartesian_2d(LogAxis::new(self.work.clone()), LogAxis::new(self.error.clone()))?;
        let text = ("sans-serif", 17 * FINE).into_font().color(&INK);
        chart
            .configure_mesh()
            .light_line_style(LIGHT_GRID.stroke_width(6))
            .bold_line_style(GRID.stroke_width(9))
            .axis_style(INK.stroke_width(9))
            .label_style(text.clone())
            .axis_desc_style(text)
            .set_all_tick_mark_size(4 * FINE)
            .x_desc(diagram.work.axis())
            .y_desc(diagram.error.axis())
            .draw()?;
        Ok(chart)
    }

    /// A staircase: what can be had for a given work.
    fn draw_front(
        &self,
        panel: &mut LogPanel<'_, '_>,
        diagram: &Diagram,
        runs: &[Run],
    ) -> Result<(), PlotError> {
        for front in diagram.fronts(runs) {
            let front: Vec<(f64, f64)> = front
                .into_iter()
                .filter_map(|i| runs[i].place(&diagram.error, &diagram.work))
                .map(logarithms)
                .collect();
            let mut stairs = Vec::new();
            if let Some(first) = front.first() {
                stairs.push((first.0, self.error.end));
            }
            for (i, here) in front.iter().enumerate() {
                stairs.push(*here);
                let next = front.get(i + 1).map_or(self.work.end, |next| next.0);
                stairs.push((next, here.1));
            }
            panel.draw_series(LineSeries::new(stairs, FRONT.stroke_width(70)))?;
        }
        Ok(())
    }

    fn draw_floors(&self, panel: &mut LogPanel<'_, '_>, diagram: &Diagram) -> Result<(), PlotError> {
        let style = ("sans-serif", 15 * FINE)
            .into_font()
            .style(FontStyle::Italic)
            .color(&FLOOR);
        for floor in &diagram.floors {
            let y = floor.error.log10();
            if !self.error.contains(&y) {
                continue;
            }
            let line = [(self.work.start, y), (self.work.end, y)];
            panel.draw_series(LineSeries::new(line, FLOOR.stroke_width(FLOOR_LINE)))?;
            let at = (4 * FINE as i32, -15 * FINE as i32);
            panel.draw_series([
                EmptyElement::at((self.work.start, y)) + Text::new(floor.name.clone(), at, style.clone())
            ])?;
        }
        Ok(())
    }

    fn draw_curve(
        &self,
        panel: &mut LogPanel<'_, '_>,
        number: usize,
        diagram: &Diagram,
        indices: &[usize],
        runs: &[Run],
    ) -> Result<(), PlotError> {
        let style = CurveStyle::of(number);
        let placed: Vec<(usize, (f64, f64))> = indices
            .iter()
            .filter_map(|&i| Some((i, logarithms(runs[i].place(&diagram.error, &diagram.work)?))))
            .collect();
        let line = placed.iter().map(|(_, at)| *at);
        panel.draw_series(LineSeries::new(line, style.ink.stroke_width(style.line)))?;
        for (i, at) in placed {
            if let Some(spread) = runs[i].work(diagram.work.name)
                && spread.q3 > spread.q1
                && spread.q1 > 0.0
            {
                let ends = [(spread.q1.log10(), at.1), (spread.q3.log10(), at.1)];
                panel.draw_series([PathElement::new(ends, style.ink.stroke_width(9))])?;
            }
            panel.plotting_area().draw(&style.marker(at))?;
            if runs[i].is_default {
                panel.draw_series([Circle::new(at, 90, INK.stroke_width(12))])?;
            }
        }
        Ok(())
    }

    /// At the upper edge, above the work that it took; at the right one if that is not known.
    fn draw_failures(
        &self,
        panel: &mut LogPanel<'_, '_>,
        diagram: &Diagram,
        runs: &[Run],
    ) -> Result<(), PlotError> {
        let top = self.error.end - 0.03 * (self.error.end - self.error.start);
        for curve in &diagram.curves {
            for run in curve
                .runs
                .iter()
                .map(|&i| &runs[i])
                .filter(|r| r.failed.is_some())
            {
                let work = run.work(diagram.work.name).map(|s| s.median);
                let x = work
                    .filter(|w| *w > 0.0)
                    .map_or(self.work.end, |w| w.log10().clamp(self.work.start, self.work.end));
                panel.draw_series([Cross::new((x, top), SIZE, IMPACT.stroke_width(12))])?;
            }
        }
        Ok(())
    }
}

fn logarithms((work, error): (f64, f64)) -> (f64, f64) {
    (work.log10(), error.log10())
}

/// The decimal logarithms of what is above 0, with `margin` of the whole at each end, and of half a decade at least.
fn span(values: impl Iterator<Item = f64>, margin: f64) -> Option<Range<f64>> {
    const LEAST: f64 = 0.5;
    let (least, most) = values
        .filter(|x| *x > 0.0 && x.is_finite())
        .map(f64::log10)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| {
            (a.min(x), b.max(x))
        });
    if !(least.is_finite() && most.is_finite()) {
        return None;
    }
    let room = (margin * (most - least))
        .max(0.5 * (LEAST - (most - least)))
        .max(0.03);
    Some(least - room..most + room)
}

/// How a curve looks.
#[derive(Clone, Copy)]
struct CurveStyle {
    shape: MarkerShape,
    filled: bool,
    /// Width of the line, and so its dashes.
    line: u32,
    ink: RGBColor,
}

#[derive(Clone, Copy)]
enum MarkerShape {
    Disc,
    Triangle,
    Square,
    Diamond,
    Flipped,
}

impl CurveStyle {
    /// Of the curve with this number: shape, filling and dashes differ, ink only helps.
    fn of(number: usize) -> Self {
        const SHAPES: [MarkerShape; 5] = [
            MarkerShape::Disc,
            MarkerShape::Triangle,
            MarkerShape::Square,
            MarkerShape::Diamond,
            MarkerShape::Flipped,
        ];
        Self {
            shape: SHAPES[number % 5],
            filled: number.is_multiple_of(2),
            line: [SOLID, DASHED, DOTTED][number % 3],
            ink: [INK, ARC, IMPACT][number % 3],
        }
    }

    /// The marker at a place of the plot or of the drawing.
    fn marker<'a, C: Clone + 'a, DB: DrawingBackend + 'a>(self, at: C) -> DynElement<'a, DB, C> {
        let fill = if self.filled { self.ink } else { WHITE };
        let outline = self.outline();
        if outline.is_empty() {
            return (EmptyElement::at(at)
                + Circle::new((0, 0), SIZE, fill.filled())
                + Circle::new((0, 0), SIZE, self.ink.stroke_width(12)))
            .into_dyn();
        }
        let closed: Vec<(i32, i32)> = outline.iter().chain(&outline[..1]).copied().collect();
        (EmptyElement::at(at)
            + Polygon::new(outline, fill.filled())
            + PathElement::new(closed, self.ink.stroke_width(12)))
        .into_dyn()
    }

    /// Around the place of the point, in units of the drawing; none for a circle.
    fn outline(self) -> Vec<(i32, i32)> {
        match self.shape {
            MarkerShape::Disc => Vec::new(),
            MarkerShape::Triangle => vec![(0, -SIZE), (SIZE, SIZE * 4 / 5), (-SIZE, SIZE * 4 / 5)],
            MarkerShape::Flipped => vec![(0, SIZE), (SIZE, -SIZE * 4 / 5), (-SIZE, -SIZE * 4 / 5)],
            MarkerShape::Square => vec![
                (-SIZE * 4 / 5, -SIZE * 4 / 5),
                (SIZE * 4 / 5, -SIZE * 4 / 5),
                (SIZE * 4 / 5, SIZE * 4 / 5),
                (-SIZE * 4 / 5, SIZE * 4 / 5),
            ],
            MarkerShape::Diamond => vec![(0, -SIZE * 5 / 4), (SIZE, 0), (0, SIZE * 5 / 4), (-SIZE, 0)],
        }
    }
}

/// What each curve and sign means, right of the panel.
fn draw_legend(area: &Area<'_>, diagram: &Diagram, runs: &[Run]) -> Result<(), PlotError> {
    const ROW: i32 = 21 * FINE as i32;
    const LEFT: i32 = 8 * FINE as i32;
    const LINE: i32 = 34 * FINE as i32;
    let text = ("sans-serif", 16 * FINE).into_font().color(&INK);
    let mut y = 16 * FINE as i32;
    let word = |y: i32, what: &str| {
        let at = (LEFT + LINE + 8 * FINE as i32, y - 9 * FINE as i32);
        area.draw(&Text::new(what.to_owned(), at, text.clone()))
    };
    for (i, curve) in diagram.curves.iter().enumerate() {
        let style = CurveStyle::of(i);
        let ends = [(LEFT, y), (LEFT + LINE, y)];
        area.draw(&PathElement::new(ends, style.ink.stroke_width(style.line)))?;
        area.draw(&style.marker((LEFT + LINE / 2, y)))?;
        word(y, &curve.name)?;
        y += ROW;
    }
    y += ROW / 3;
    let shown = || diagram.curves.iter().flat_map(|c| &c.runs).map(|&i| &runs[i]);
    let ends = [(LEFT, y), (LEFT + LINE, y)];
    area.draw(&PathElement::new(ends, FRONT.stroke_width(70)))?;
    word(y, "Pareto front")?;
    y += ROW;
    if shown().any(|r| r.is_default) {
        area.draw(&Circle::new((LEFT + LINE / 2, y), 80, INK.stroke_width(12)))?;
        word(y, "default")?;
        y += ROW;
    }
    if shown().any(|r| r.failed.is_some()) {
        area.draw(&Cross::new((LEFT + LINE / 2, y), SIZE, IMPACT.stroke_width(12)))?;
        word(y, "failed, or in part")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::stats::{ErrorStatistics, Quartiles};
    use crate::cost::{ErrorFloor, Metric, SettingCurve};

    fn diagram() -> (Diagram, Vec<Run>) {
        let run = |work: Option<[f64; 2]>, error: Option<f64>| Run {
            settings: Vec::new(),
            errors: error
                .and_then(|e| ErrorStatistics::of(&[e]))
                .map(|e| ("e", e))
                .into_iter()
                .collect(),
            work: work
                .and_then(|w| Quartiles::of(&w))
                .map(|s| ("s", s))
                .into_iter()
                .collect(),
            counts: Vec::new(),
            failed: error.is_none().then(|| "why".to_owned()),
            is_default: error == Some(0.01),
        };
        let runs = vec![
            run(Some([0.9, 1.1]), Some(0.1)),
            run(Some([9.0, 11.0]), Some(0.01)),
            run(Some([90.0, 110.0]), None),
            run(None, None),
        ];
        let measure = |name, unit| Metric {
            name,
            words: "a < b",
            unit,
        };
        let diagram = Diagram {
            title: "error < work".to_owned(),
            error: measure("e", "px"),
            work: measure("s", "s"),
            floors: vec![ErrorFloor {
                name: "bound".to_owned(),
                error: 0.005,
            }],
            alternatives: true,
            overview: false,
            curves: vec![SettingCurve {
                name: "one".to_owned(),
                runs: vec![0, 1, 2, 3],
            }],
        };
        (diagram, runs)
    }

    #[test]
    fn front_floor_ring_and_crosses_are_all_there() {
        let (diagram, runs) = diagram();
        let svg = svg(&diagram, &runs, "A").unwrap();
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
        for expected in [
            "bound",
            "Pareto front",
            "default",
            "failed, or in part",
            "a &lt; b / px",
        ] {
            assert!(svg.contains(expected), "{expected}");
        }
        // Two discs and the legend's, each with its outline; the ring and the legend's.
        assert_eq!(svg.matches("<circle").count(), 8);
        assert!(svg.contains("stroke-dasharray"), "the floor");
        let crosses = svg.matches("#9C1C1C").count();
        assert_eq!(crosses, 6, "two strokes for each of two failures and the legend");
    }

    #[test]
    fn a_diagram_without_points_says_so() {
        let (diagram, mut runs) = diagram();
        for run in &mut runs {
            run.errors.clear();
        }
        assert!(
            svg(&diagram, &runs, "A")
                .unwrap()
                .contains("nothing was measured")
        );
    }

    #[test]
    fn ticks_are_round_numbers_however_wide_the_range() {
        let labels = |range: Range<f64>| {
            let axis = LogAxis::new(range);
            axis.bold.iter().map(|x| axis.format_ext(x)).collect::<Vec<_>>()
        };
        assert_eq!(labels(-2.1..0.1), ["0.01", "0.1", "1"]);
        assert_eq!(labels(0.25..1.4), ["2", "5", "10", "20"]);
        assert_eq!(labels(3.1..3.6), ["2000", "3000"]);
        assert_eq!(labels(-13.2..-9.8), ["10⁻¹³", "10⁻¹²", "10⁻¹¹", "10⁻¹⁰"]);
        assert!((3..=7).contains(&labels(-16.0..2.0).len()));
        assert_eq!(labels(-6.9..-6.2), ["2·10⁻⁷", "3·10⁻⁷", "5·10⁻⁷"]);
    }

    #[test]
    fn no_two_of_thirty_curves_look_alike() {
        let looks: std::collections::HashSet<(u32, bool, u32)> = (0..30)
            .map(CurveStyle::of)
            .map(|l| (l.shape as u32, l.filled, l.line))
            .collect();
        assert_eq!(looks.len(), 30);
    }
}
