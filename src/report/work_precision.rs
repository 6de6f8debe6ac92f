//! Work-precision diagrams: error upwards, work to the right, both logarithmic.
//!
//! Markers and dashes tell the curves apart, so that grey print loses nothing. The Pareto front is a broad grey line
//! behind them, floors are dashed lines with their names, the default setting is ringed, bars are quartiles, and what
//! failed is a cross at the edge.

use super::figure::{
    self, ARC, Area, Dashes, FINE, IMPACT, INK, LogAxis, Panel, PanelAxes, PlotError, Symbol, SymbolShape,
    error_bar, log_span, panel, text_style,
};
use crate::cost::{Diagram, Run};
use plotters::prelude::*;
use std::ops::Range;

/// Design size, screen pixels.
pub(super) const WIDTH: u32 = 720;
pub(super) const HEIGHT: u32 = 380;
const LEGEND_WIDTH: u32 = 196;
const TITLE_HEIGHT: u32 = 26;
const FRONT: RGBColor = RGBColor(200, 200, 200);
const FLOOR: RGBColor = RGBColor(90, 90, 90);
/// Half the size of a marker.
const SIZE: i32 = 42;
type LogPanel<'a, 'b> = Panel<'a, 'b, LogAxis>;

/// The diagram as a complete `<svg>` element.
///
/// # Errors
/// See [`PlotError`].
pub(super) fn svg(diagram: &Diagram, runs: &[Run], caption: &str) -> Result<String, PlotError> {
    let name = figure::for_a_page(&diagram.title);
    let svg = figure::svg((WIDTH, HEIGHT), &name, |root| draw(root, diagram, runs, caption))?;
    Ok(in_font_of_page(&svg))
}

/// Several diagrams below each other, two in a row, as an SVG file of its own.
///
/// # Errors
/// See [`PlotError`].
pub(super) fn overview(diagrams: &[(&Diagram, &[Run], String)]) -> Result<String, PlotError> {
    let rows = diagrams.len().div_ceil(2).max(1) as u32;
    let columns = diagrams.len().clamp(1, 2) as u32;
    let (width, height) = (columns * WIDTH, rows * HEIGHT);
    let shown = format!(
        r#"width="{width}" height="{height}" font-family="Helvetica, Arial, 'Liberation Sans', sans-serif""#
    );
    let svg = figure::svg((width, height), &shown, |root| {
        root.fill(&WHITE)?;
        let areas = root.split_evenly((rows as usize, columns as usize));
        for (area, (diagram, runs, caption)) in areas.iter().zip(diagrams) {
            draw(area, diagram, runs, caption)?;
        }
        Ok(())
    })?;
    Ok(in_font_of_page(&svg))
}

/// Letters as those around the diagram, and not whatever is nearest to plotters' own.
fn in_font_of_page(svg: &str) -> String {
    svg.replace(" font-family=\"sans-serif\"", "")
}

fn draw(area: &Area<'_>, diagram: &Diagram, runs: &[Run], caption: &str) -> Result<(), PlotError> {
    let (title, below) = area.split_vertically(TITLE_HEIGHT * FINE);
    let style = text_style(18, FontStyle::Bold, &INK);
    title.draw(&Text::new(
        caption.to_owned(),
        (8 * FINE as i32, 6 * FINE as i32),
        style,
    ))?;
    let (main, legend) = below.split_horizontally((WIDTH - LEGEND_WIDTH) * FINE);
    let Some(view) = LogRanges::of(diagram, runs) else {
        let style = text_style(15, FontStyle::Normal, &INK);
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
            work: log_span(works, 0.04)?,
            error: log_span(points.iter().map(|p| p.1).chain(floors), 0.08)?,
        })
    }

    fn panel<'a, 'b>(&self, area: &'a Area<'b>, diagram: &Diagram) -> Result<LogPanel<'a, 'b>, PlotError> {
        let (x_label, y_label) = (diagram.work.axis(), diagram.error.axis());
        panel(
            area,
            PanelAxes {
                x: LogAxis::new(self.work.clone()),
                y: LogAxis::new(self.error.clone()),
                x_label: Some(&x_label),
                y_label: &y_label,
                above: 8,
                left: 82,
                below: 46,
                right: 6,
                font: 17,
                light_lines: true,
            },
        )
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
        let style = text_style(15, FontStyle::Italic, &FLOOR);
        for floor in &diagram.floors {
            let y = floor.error.log10();
            if !self.error.contains(&y) {
                continue;
            }
            let line = [(self.work.start, y), (self.work.end, y)];
            panel.draw_series(LineSeries::new(
                line,
                Dashes::style(Some(Dashes::Long), FLOOR, 11),
            ))?;
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
        panel.draw_series(LineSeries::new(line, style.line()))?;
        for (i, at) in placed {
            if let Some(spread) = runs[i].work(diagram.work.name)
                && spread.q3 > spread.q1
                && spread.q1 > 0.0
            {
                let ends = [(spread.q1.log10(), at.1), (spread.q3.log10(), at.1)];
                error_bar(panel, ends, style.symbol.ink.stroke_width(9))?;
            }
            panel.plotting_area().draw(&style.symbol.at(at))?;
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

/// How a curve looks.
#[derive(Clone, Copy)]
struct CurveStyle {
    symbol: Symbol,
    dashes: Option<Dashes>,
    /// Width of the line, units of the drawing.
    width: u32,
}

impl CurveStyle {
    /// Of the curve with this number: shape, filling and dashes differ, ink only helps.
    fn of(number: usize) -> Self {
        const SHAPES: [SymbolShape; 5] = [
            SymbolShape::Disc,
            SymbolShape::Triangle,
            SymbolShape::Square,
            SymbolShape::Diamond,
            SymbolShape::Flipped,
        ];
        Self {
            symbol: Symbol {
                shape: SHAPES[number % 5],
                filled: number.is_multiple_of(2),
                size: SIZE,
                ink: [INK, ARC, IMPACT][number % 3],
            },
            dashes: [None, Some(Dashes::Middle), Some(Dashes::Dotted)][number % 3],
            width: [13, 14, 15][number % 3],
        }
    }

    fn line(self) -> ShapeStyle {
        Dashes::style(self.dashes, self.symbol.ink, self.width)
    }
}

/// What each curve and sign means, right of the panel.
fn draw_legend(area: &Area<'_>, diagram: &Diagram, runs: &[Run]) -> Result<(), PlotError> {
    const ROW: i32 = 21 * FINE as i32;
    const LEFT: i32 = 8 * FINE as i32;
    const LINE: i32 = 34 * FINE as i32;
    let text = text_style(16, FontStyle::Normal, &INK);
    let mut y = 16 * FINE as i32;
    let word = |y: i32, what: &str| {
        let at = (LEFT + LINE + 8 * FINE as i32, y - 9 * FINE as i32);
        area.draw(&Text::new(what.to_owned(), at, text.clone()))
    };
    for (i, curve) in diagram.curves.iter().enumerate() {
        let style = CurveStyle::of(i);
        let ends = [(LEFT, y), (LEFT + LINE, y)];
        area.draw(&PathElement::new(ends, style.line()))?;
        area.draw(&style.symbol.at((LEFT + LINE / 2, y)))?;
        word(y, &curve.name)?;
        y += ROW;
    }
    y += ROW / 3;
    if diagram.less_is_better {
        let ends = [(LEFT, y), (LEFT + LINE, y)];
        area.draw(&PathElement::new(ends, FRONT.stroke_width(70)))?;
        word(y, "Pareto front")?;
        y += ROW;
    }
    let shown = || diagram.curves.iter().flat_map(|c| &c.runs).map(|&i| &runs[i]);
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
            less_is_better: true,
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
    fn no_two_of_thirty_curves_look_alike() {
        let looks: std::collections::HashSet<_> = (0..30)
            .map(CurveStyle::of)
            .map(|l| (l.symbol.shape, l.symbol.filled, l.dashes))
            .collect();
        assert_eq!(looks.len(), 30);
    }
}
