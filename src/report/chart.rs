//! Figures of a series: points with error bars, curves, and what is left below.
//!
//! Shapes, dashes and widths carry the meaning; colour only helps, so that grey print loses nothing.

use super::figure::{
    self, ARC, Area, Axis, Dashes, FINE, IMPACT, INK, Panel, PanelAxes, PlotError, PlotUse, Symbol,
    SymbolShape, UNUSED, clipped, error_bar, panel, text_style,
};
use plotters::coord::CoordTranslate;
use plotters::prelude::*;
use std::ops::Range;

/// Design size, screen pixels.
const MAIN_HEIGHT: u32 = 300;
const RESIDUAL_HEIGHT: u32 = 110;
const AXIS_HEIGHT: u32 = 46;
const GREY: RGBColor = RGBColor(186, 186, 186);

/// Of the legend, screen pixels: a line of it, where it begins, a marker or a piece of line with its room, and a letter.
const LEGEND_LINE: u32 = 22;
const LEGEND_LEFT: u32 = 10;
const KEY_WIDTH: u32 = 44;
const LETTER: u32 = 8;

/// How a curve is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum LineStyle {
    /// Thin and unbroken.
    Solid,
    /// Dashed.
    Dashed,
    /// Broad and light, so that a thin one on top of it shows.
    Broad,
    /// Dots.
    Dotted,
    /// Fine dashes, for what is not a curve of the ordinate: a transition.
    Fine,
}

/// How a point is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PointMarker {
    /// ●
    Disc,
    /// ○
    Ring,
    /// ▲
    Triangle,
    /// □
    Square,
    /// ■
    Block,
    /// △
    OpenTriangle,
    /// ×
    Cross,
}

/// A point with its error bars.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PlotPoint {
    pub x: f64,
    pub y: f64,
    pub x_std: Option<f64>,
    pub y_std: Option<f64>,
    pub marker: PointMarker,
}

/// What a legend explains.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Key {
    Marker(PointMarker),
    Line(LineStyle),
}

/// A figure.
#[derive(Debug, Clone)]
pub(super) struct Chart {
    /// For those who cannot see it.
    pub name: String,
    pub x_label: String,
    pub y_label: String,
    pub x: Range<f64>,
    pub y: Range<f64>,
    /// Drawn in this order, below the points.
    pub curves: Vec<(LineStyle, Vec<(f64, f64)>)>,
    pub dots: Vec<PlotPoint>,
    /// Abscissae of transitions.
    pub transitions: Vec<f64>,
    /// Words in the figure: where, what.
    pub words: Vec<(f64, f64, String)>,
    /// Observed minus computed; none for no panel.
    pub residuals: Vec<PlotPoint>,
    /// What stands at their axis.
    pub residual_label: &'static str,
    /// In words what markers and lines are: above the figure where that stands alone; a page has it in words of its own.
    pub legend: Vec<(Key, String)>,
}

impl Chart {
    /// The figure as a complete `<svg>` element.
    pub fn svg(&self, goes: PlotUse) -> Result<String, PlotError> {
        let below = !self.residuals.is_empty();
        let main_height = MAIN_HEIGHT + if below { 0 } else { AXIS_HEIGHT };
        let legend = self.legend_lines(goes);
        let above = LEGEND_LINE * legend.len() as u32;
        let height = above + main_height + if below { RESIDUAL_HEIGHT + AXIS_HEIGHT } else { 0 };
        figure::svg(
            (goes.width(), height),
            &goes.attributes(&self.name, height),
            |root| {
                let (key, figure) = root.split_vertically(above * FINE);
                draw_legend(&key, &legend)?;
                let (main, rest) = figure.split_vertically(main_height * FINE);
                self.main(&main, !below, goes)?;
                if below { self.residual(&rest, goes) } else { Ok(()) }
            },
        )
    }

    /// The lines of the legend, each entry with its place from the left, screen pixels.
    fn legend_lines(&self, goes: PlotUse) -> Vec<Vec<(u32, Key, &str)>> {
        let mut lines: Vec<Vec<(u32, Key, &str)>> = Vec::new();
        if goes == PlotUse::Page {
            return lines;
        }
        let mut left = u32::MAX;
        for (key, words) in &self.legend {
            let width = KEY_WIDTH + LETTER * words.chars().count() as u32;
            if left.saturating_add(width) > goes.width() {
                lines.push(Vec::new());
                left = LEGEND_LEFT;
            }
            if let Some(line) = lines.last_mut() {
                line.push((left, *key, words.as_str()));
            }
            left += width;
        }
        lines
    }

    fn main(&self, area: &Area<'_>, axis: bool, goes: PlotUse) -> Result<(), PlotError> {
        let mut panel = self.panel(area, Axis::new(self.y.clone(), 6), &self.y_label, axis, goes)?;
        self.draw_transitions(&mut panel, &self.y)?;
        for (stroke, points) in &self.curves {
            for piece in clipped(points, &self.x, &self.y) {
                draw_curve(&mut panel, *stroke, &piece)?;
            }
        }
        for dot in &self.dots {
            draw_dot(&mut panel, dot, &self.x, &self.y)?;
        }
        let style = text_style(16, FontStyle::Italic, &INK);
        for (x, y, text) in &self.words {
            panel
                .draw_series([EmptyElement::at((*x, *y)) + Text::new(text.clone(), (0, 0), style.clone())])?;
        }
        Ok(())
    }

    fn residual(&self, area: &Area<'_>, goes: PlotUse) -> Result<(), PlotError> {
        let used = self
            .residuals
            .iter()
            .filter(|dot| dot.marker != PointMarker::Cross);
        let reach = used
            .map(|dot| dot.y.abs() + dot.y_std.unwrap_or(0.0))
            .filter(|r| r.is_finite())
            .fold(0.0, f64::max);
        let reach = if reach > 0.0 { 1.15 * reach } else { 1.0 };
        let range = -reach..reach;
        let mut panel = self.panel(area, Axis::new(range.clone(), 4), self.residual_label, true, goes)?;
        self.draw_transitions(&mut panel, &range)?;
        panel.draw_series(LineSeries::new(
            [(self.x.start, 0.0), (self.x.end, 0.0)],
            INK.stroke_width(8),
        ))?;
        for dot in &self.residuals {
            if dot.y.abs() <= reach {
                draw_dot(&mut panel, &PlotPoint { x_std: None, ..*dot }, &self.x, &range)?;
            } else if self.x.contains(&dot.x) {
                let size = 5 * FINE as i32 * if dot.y > 0.0 { 1 } else { -1 };
                let at = (dot.x, 0.9 * reach.copysign(dot.y));
                panel.draw_series([TriangleMarker::new(at, size, UNUSED.filled())])?;
            }
        }
        Ok(())
    }

    fn panel<'a, 'b>(
        &self,
        area: &'a Area<'b>,
        y: Axis,
        y_label: &str,
        axis: bool,
        goes: PlotUse,
    ) -> Result<Panel<'a, 'b>, PlotError> {
        let axes = PanelAxes {
            x: Axis::new(self.x.clone(), goes.ticks()),
            y,
            x_label: axis.then_some(self.x_label.as_str()),
            y_label,
            above: 10,
            left: 74,
            below: AXIS_HEIGHT,
            right: 14,
            font: 16,
            light_lines: false,
        };
        panel(area, axes)
    }

    fn draw_transitions(&self, panel: &mut Panel<'_, '_>, y: &Range<f64>) -> Result<(), PlotError> {
        for &x in self.transitions.iter().filter(|x| self.x.contains(x)) {
            draw_curve(panel, LineStyle::Fine, &[(x, y.start), (x, y.end)])?;
        }
        Ok(())
    }
}

fn draw_legend(area: &Area<'_>, lines: &[Vec<(u32, Key, &str)>]) -> Result<(), PlotError> {
    let fine = |pixels: u32| (pixels * FINE) as i32;
    let text = text_style(16, FontStyle::Normal, &INK);
    for (number, line) in lines.iter().enumerate() {
        let top = fine(LEGEND_LINE) * number as i32;
        let middle = top + fine(LEGEND_LINE) / 2;
        for &(left, key, words) in line {
            let left = fine(left);
            match key {
                Key::Marker(marker) => draw_marker(area, marker, (left + fine(18), middle))?,
                Key::Line(stroke) => {
                    let ends = vec![(left, middle), (left + fine(32), middle)];
                    area.draw(&PathElement::new(ends, line_style(stroke)))?;
                }
            }
            let at = (left + fine(36), top + fine(5));
            area.draw(&Text::new(words.to_owned(), at, text.clone()))?;
        }
    }
    Ok(())
}

fn line_style(stroke: LineStyle) -> ShapeStyle {
    match stroke {
        LineStyle::Solid => Dashes::style(None, ARC, 12),
        LineStyle::Broad => Dashes::style(None, GREY, 50),
        LineStyle::Dashed => Dashes::style(Some(Dashes::Wide), INK, 13),
        LineStyle::Dotted => Dashes::style(Some(Dashes::Dotted), INK, 16),
        LineStyle::Fine => Dashes::style(Some(Dashes::Fine), IMPACT, 11),
    }
}

fn draw_curve(panel: &mut Panel<'_, '_>, stroke: LineStyle, points: &[(f64, f64)]) -> Result<(), PlotError> {
    let style = line_style(stroke);
    panel.draw_series(LineSeries::new(points.iter().copied(), style))?;
    Ok(())
}

fn draw_dot(
    panel: &mut Panel<'_, '_>,
    dot: &PlotPoint,
    x: &Range<f64>,
    y: &Range<f64>,
) -> Result<(), PlotError> {
    let at = (dot.x, dot.y);
    if !(x.contains(&dot.x) && (y.start..=y.end).contains(&dot.y)) {
        return Ok(());
    }
    let ink = if dot.marker == PointMarker::Cross {
        UNUSED
    } else {
        INK
    };
    if let Some(std) = dot.x_std {
        let ends = [
            ((dot.x - std).max(x.start), dot.y),
            ((dot.x + std).min(x.end), dot.y),
        ];
        error_bar(panel, ends, ink.stroke_width(8))?;
    }
    if let Some(std) = dot.y_std {
        let ends = [
            (dot.x, (dot.y - std).max(y.start)),
            (dot.x, (dot.y + std).min(y.end)),
        ];
        error_bar(panel, ends, ink.stroke_width(8))?;
    }
    draw_marker(panel.plotting_area(), dot.marker, at)
}

fn draw_marker<C: CoordTranslate>(
    area: &DrawingArea<SVGBackend<'_>, C>,
    marker: PointMarker,
    at: C::From,
) -> Result<(), PlotError>
where
    C::From: Clone,
{
    const SIZE: i32 = 34;
    let symbol = |shape, filled| Symbol {
        shape,
        filled,
        size: SIZE,
        ink: INK,
    };
    let symbol = match marker {
        PointMarker::Disc => symbol(SymbolShape::Disc, true),
        PointMarker::Ring => symbol(SymbolShape::Disc, false),
        PointMarker::Triangle => symbol(SymbolShape::Triangle, true),
        PointMarker::OpenTriangle => symbol(SymbolShape::Triangle, false),
        PointMarker::Block => symbol(SymbolShape::Square, true),
        PointMarker::Square => symbol(SymbolShape::Square, false),
        PointMarker::Cross => {
            area.draw(&Cross::new(at, SIZE, UNUSED.stroke_width(13)))?;
            return Ok(());
        }
    };
    area.draw(&symbol.at(at))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_marker_is_drawn() {
        let markers = [
            PointMarker::Disc,
            PointMarker::Ring,
            PointMarker::Triangle,
            PointMarker::OpenTriangle,
            PointMarker::Square,
            PointMarker::Block,
            PointMarker::Cross,
        ];
        let dots: Vec<PlotPoint> = markers
            .iter()
            .enumerate()
            .map(|(i, &marker)| PlotPoint {
                x: i as f64,
                y: 0.5,
                x_std: Some(0.1),
                y_std: Some(0.1),
                marker,
            })
            .collect();
        let chart = Chart {
            name: "a < b".to_owned(),
            x_label: "x".to_owned(),
            y_label: "y".to_owned(),
            x: -1.0..8.0,
            y: 0.0..1.0,
            curves: vec![(LineStyle::Dashed, vec![(0.0, 0.0), (8.0, 2.0)])],
            residuals: dots.clone(),
            residual_label: "residual",
            dots,
            transitions: vec![3.0],
            words: Vec::new(),
            legend: vec![
                (Key::Marker(PointMarker::Ring), "what is measured".to_owned()),
                (
                    Key::Line(LineStyle::Dashed),
                    "what is computed from it".to_owned(),
                ),
            ],
        };
        // The legend goes with a figure that stands alone; it has two lines here.
        let column = chart.svg(PlotUse::Column).unwrap();
        let page = chart.svg(PlotUse::Page).unwrap();
        assert!(column.contains("what is measured") && !page.contains("what is measured"));
        assert_eq!(chart.legend_lines(PlotUse::Column).len(), 2);
        let svg = page;
        assert!(svg.contains("a &lt; b") && !svg.contains("NaN"));
        assert!(svg.matches("<circle").count() >= 4 && svg.matches("<polygon").count() >= 8);
    }
}
