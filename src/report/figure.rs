//! The figure layer over plotters that every plot is made of: the SVG itself, panels with axes and ticks at round numbers,
//! lines with dashes, error bars, symbols, words.
//!
//! plotters places everything on whole units, so the drawing is made `FINE` times larger than it is meant and the page
//! scales it down. Shapes and dashes carry the meaning; colour only helps, so that grey print loses nothing.
//!
//! Made here because plotters has it otherwise: ticks (its own are not labelled with the decimals that they need, and its
//! logarithmic ones are whole decades only), and dashes (it draws every dash as a line of its own, which makes a page
//! several times larger: see `Dashes`).

use super::drawing_geometry;
use super::words::superscript;
use plotters::coord::Shift;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::prelude::*;
use std::ops::Range;
use thiserror::Error;

/// Units of the drawing a screen pixel of its design.
pub(super) const FINE: u32 = 10;
/// Design size, screen pixels.
pub(super) const WIDTH: u32 = 760;
pub(super) const INK: RGBColor = RGBColor(34, 34, 34);
pub(super) const GRID: RGBColor = RGBColor(224, 224, 224);
pub(super) const UNUSED: RGBColor = RGBColor(140, 140, 140);
pub(super) const ARC: RGBColor = RGBColor(38, 96, 176);
pub(super) const IMPACT: RGBColor = RGBColor(156, 28, 28);

/// Why a plot could not be drawn.
#[derive(Debug, Error)]
#[error("a plot could not be drawn: {0} (a fault of track)")]
pub struct PlotError(String);

impl<E: std::error::Error + Send + Sync> From<DrawingAreaErrorKind<E>> for PlotError {
    fn from(error: DrawingAreaErrorKind<E>) -> Self {
        Self(error.to_string())
    }
}

pub(super) type Panel<'a, 'b, A = Axis> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<A, A>>;
pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// What `draw` makes of an area of `width` × `height` screen pixels, as an `<svg>` element with `attributes` in place of
/// its size.
pub(super) fn svg(
    (width, height): (u32, u32),
    attributes: &str,
    draw: impl FnOnce(&Area<'_>) -> Result<(), PlotError>,
) -> Result<String, PlotError> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, (width * FINE, height * FINE)).into_drawing_area();
        draw(&root)?;
        root.present()?;
    }
    let size = format!(r#"width="{}" height="{}""#, width * FINE, height * FINE);
    let mut svg = svg.replacen(&size, attributes, 1).replace(" opacity=\"1\"", "");
    for dashes in Dashes::ALL {
        svg = svg.replace(
            &format!(" opacity=\"{}\"", dashes.code()),
            &format!(" stroke-dasharray=\"{}\"", dashes.array()),
        );
    }
    Ok(svg)
}

/// Attributes of a figure for a page, which gives it its size: `name` is for those who cannot see it.
pub(super) fn for_a_page(name: &str) -> String {
    let name = super::escape::escape(name);
    format!(r#"class="plot" role="img" aria-label="{name}""#)
}

/// Where a plot goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlotUse {
    /// Onto a page, which gives it its size.
    Page,
    /// Into a column of 8 cm.
    Column,
}

/// Design width of a plot for a column, screen pixels: words of 16 of them, which plotters writes as 12.9, are 8.2 points where 356 are 80 mm.
const COLUMN_WIDTH: u32 = 356;

/// Of a column, mm.
const COLUMN_MM: f64 = 80.0;

impl PlotUse {
    /// Design width, screen pixels.
    pub fn width(self) -> u32 {
        match self {
            Self::Page => WIDTH,
            Self::Column => COLUMN_WIDTH,
        }
    }

    /// Ticks at most along it.
    pub fn ticks(self) -> usize {
        match self {
            Self::Page => 9,
            Self::Column => 5,
        }
    }

    /// The drawing's attributes, whatever its height.
    pub fn attributes(self, name: &str, height: u32) -> String {
        match self {
            Self::Page => for_a_page(name),
            Self::Column => {
                let height_mm = COLUMN_MM * f64::from(height) / f64::from(COLUMN_WIDTH);
                format!(r#"width="80mm" height="{height_mm:.2}mm" style="background:#fff""#)
            }
        }
    }
}

/// How a line is broken. Lengths are units of the drawing: dash, gap.
///
/// plotters knows no dashes of SVG: a line is drawn with an opacity that nothing else has, and [`svg`] writes its dashes in
/// place of that.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Dashes {
    Long,
    Middle,
    Wide,
    Short,
    Dotted,
    Fine,
}

impl Dashes {
    const ALL: [Self; 6] = [
        Self::Long,
        Self::Middle,
        Self::Wide,
        Self::Short,
        Self::Dotted,
        Self::Fine,
    ];

    fn array(self) -> &'static str {
        match self {
            Self::Long => "120 50",
            Self::Middle => "90 50",
            Self::Wide => "90 60",
            Self::Short => "50 30",
            Self::Dotted => "30 40",
            Self::Fine => "20 40",
        }
    }

    fn code(self) -> f64 {
        0.991 + 0.001 * f64::from(self as u8)
    }

    /// A line of this kind; unbroken without.
    pub fn style(dashes: Option<Self>, colour: RGBColor, width: u32) -> ShapeStyle {
        colour.mix(dashes.map_or(1.0, Self::code)).stroke_width(width)
    }
}

/// Words in the figure.
pub(super) fn text_style(size: u32, style: FontStyle, colour: &RGBColor) -> TextStyle<'_> {
    ("sans-serif", size * FINE).into_font().style(style).color(colour)
}

/// The outline of a symbol.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum SymbolShape {
    Disc,
    Triangle,
    Square,
    Diamond,
    Flipped,
}

/// What marks a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Symbol {
    pub shape: SymbolShape,
    pub filled: bool,
    /// Half its size, units of the drawing.
    pub size: i32,
    pub ink: RGBColor,
}

impl Symbol {
    /// The symbol at a place of the plot or of the drawing.
    pub fn at<'a, C: Clone + 'a, DB: DrawingBackend + 'a>(self, at: C) -> DynElement<'a, DB, C> {
        const OUTLINE: u32 = 12;
        let fill = if self.filled { self.ink } else { WHITE };
        let outline = self.outline();
        if outline.is_empty() {
            return (EmptyElement::at(at)
                + Circle::new((0, 0), self.size, fill.filled())
                + Circle::new((0, 0), self.size, self.ink.stroke_width(OUTLINE)))
            .into_dyn();
        }
        let closed: Vec<(i32, i32)> = outline.iter().chain(&outline[..1]).copied().collect();
        (EmptyElement::at(at)
            + Polygon::new(outline, fill.filled())
            + PathElement::new(closed, self.ink.stroke_width(OUTLINE)))
        .into_dyn()
    }

    /// Around the place of the point; none for a circle.
    fn outline(self) -> Vec<(i32, i32)> {
        let size = self.size;
        let side = size * 4 / 5;
        match self.shape {
            SymbolShape::Disc => Vec::new(),
            SymbolShape::Triangle => vec![(0, -size), (size, side), (-size, side)],
            SymbolShape::Flipped => vec![(0, size), (size, -side), (-size, -side)],
            SymbolShape::Square => vec![(-side, -side), (side, -side), (side, side), (-side, side)],
            SymbolShape::Diamond => vec![(0, -size * 5 / 4), (size, 0), (0, size * 5 / 4), (-size, 0)],
        }
    }
}

/// A bar from one place to another, such as a standard uncertainty to both sides of a point.
pub(super) fn error_bar<A>(
    panel: &mut Panel<'_, '_, A>,
    ends: [(f64, f64); 2],
    style: ShapeStyle,
) -> Result<(), PlotError>
where
    A: Ranged<ValueType = f64>,
{
    panel.draw_series([PathElement::new(ends, style)])?;
    Ok(())
}

/// From the least to the greatest value with `margin` of the whole at each end; `None` without values.
pub(super) fn span(values: impl Iterator<Item = f64>, margin: f64) -> Option<Range<f64>> {
    let (least, most) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), value| {
        (least.min(value), most.max(value))
    });
    if !(least.is_finite() && most.is_finite()) {
        return None;
    }
    let whole = most - least;
    // A single value still needs an axis around it.
    let room = if whole > 0.0 {
        margin * whole
    } else {
        0.5 * least.abs().max(1e-3)
    };
    Some(least - room..most + room)
}

/// The decimal logarithms of what is above 0, with `margin` of the whole at each end, and of half a decade at least.
pub(super) fn log_span(values: impl Iterator<Item = f64>, margin: f64) -> Option<Range<f64>> {
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

/// Where a value lies between the ends of an axis, units of the drawing.
fn place(range: &Range<f64>, value: f64, (low, high): (i32, i32)) -> i32 {
    let share = (value - range.start) / (range.end - range.start);
    low + (share * f64::from(high - low)).round() as i32
}

/// An axis whose ticks are round numbers, labelled with the decimals that they need. The range may run either way.
pub(super) struct Axis {
    range: Range<f64>,
    ticks: Vec<f64>,
    decimals: usize,
}

impl Axis {
    /// About `wanted` ticks.
    pub fn new(range: Range<f64>, wanted: usize) -> Self {
        let (ticks, decimals) = round_ticks(&range, wanted);
        Self {
            range,
            ticks,
            decimals,
        }
    }
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (low, high): (i32, i32)) -> i32 {
        place(&self.range, *value, (low, high))
    }

    fn key_points<Hint: KeyPointHint>(&self, _hint: Hint) -> Vec<f64> {
        self.ticks.clone()
    }

    fn range(&self) -> Range<f64> {
        self.range.clone()
    }
}

impl ValueFormatter<f64> for Axis {
    fn format_ext(&self, value: &f64) -> String {
        number(*value, self.decimals)
    }
}

/// Multiples of a round step within a range (either way round), about `wanted` of them, and the decimals they need.
fn round_ticks(range: &Range<f64>, wanted: usize) -> (Vec<f64>, usize) {
    let (low, high) = (range.start.min(range.end), range.start.max(range.end));
    let raw = (high - low) / wanted as f64;
    if !(raw.is_finite() && raw > 0.0) {
        return (vec![low], 3);
    }
    // One step up from the round number below, unless that one is it.
    let below = drawing_geometry::round_below(raw);
    let above = drawing_geometry::round_below(2.5 * below);
    let ends = |step: f64| ((low / step).ceil() as i64, (high / step).floor() as i64);
    let (first, last) = ends(above);
    // One tick alone tells no scale.
    let step = if below >= raw * (1.0 - 1e-9) || last <= first {
        below
    } else {
        above
    };
    let (first, last) = ends(step);
    let decimals = (-(step.log10() + 1e-9).floor()).max(0.0) as usize;
    // Hardly more than `wanted` by construction; the limit guards against a range too narrow for its place on the axis.
    (
        (first..=last.min(first + 50)).map(|i| i as f64 * step).collect(),
        decimals,
    )
}

/// A tick's label, with a true minus sign and no minus zero.
fn number(value: f64, decimals: usize) -> String {
    let text = format!("{:.decimals$}", value + 0.0);
    match text.strip_prefix('-') {
        Some(digits) if digits.bytes().any(|b| (b'1'..=b'9').contains(&b)) => format!("−{digits}"),
        Some(digits) => digits.to_owned(),
        None => text,
    }
}

/// A logarithmic axis; values are decimal logarithms.
pub(super) struct LogAxis {
    range: Range<f64>,
    bold: Vec<f64>,
    light: Vec<f64>,
    /// Whether labels are powers of ten.
    powers: bool,
}

impl LogAxis {
    pub fn new(range: Range<f64>) -> Self {
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
        place(&self.range, *value, (low, high))
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

/// What a panel shows, and how much room its labels take in screen pixels.
pub(super) struct PanelAxes<'a, A> {
    pub x: A,
    pub y: A,
    /// `None` where another panel below has it.
    pub x_label: Option<&'a str>,
    pub y_label: &'a str,
    pub above: u32,
    pub left: u32,
    pub below: u32,
    pub right: u32,
    /// Size of the labels, screen pixels.
    pub font: u32,
    /// Lines at the light ticks too.
    pub light_lines: bool,
}

/// PanelAxes, ticks at round numbers and their labels.
pub(super) fn panel<'a, 'b, A>(
    area: &'a Area<'b>,
    axes: PanelAxes<'_, A>,
) -> Result<Panel<'a, 'b, A>, PlotError>
where
    A: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    const LIGHT_GRID: RGBColor = RGBColor(240, 240, 240);
    let below = if axes.x_label.is_some() { axes.below } else { 0 };
    let mut chart = ChartBuilder::on(area)
        .margin_top(axes.above * FINE)
        .margin_right(axes.right * FINE)
        .margin_left(4 * FINE)
        .set_label_area_size(LabelAreaPosition::Left, axes.left * FINE)
        .set_label_area_size(LabelAreaPosition::Bottom, below * FINE)
        .build_cartesian_2d(axes.x, axes.y)?;
    let text = text_style(axes.font, FontStyle::Normal, &INK);
    let mut mesh = chart.configure_mesh();
    if axes.light_lines {
        mesh.light_line_style(LIGHT_GRID.stroke_width(6))
            .bold_line_style(GRID.stroke_width(9));
    } else {
        mesh.max_light_lines(1)
            .light_line_style(GRID.stroke_width(0))
            .bold_line_style(GRID.stroke_width(8));
    }
    mesh.axis_style(INK.stroke_width(9))
        .label_style(text.clone())
        .axis_desc_style(text)
        .set_all_tick_mark_size(4 * FINE)
        .y_desc(axes.y_label);
    if let Some(label) = axes.x_label {
        mesh.x_desc(label);
    }
    mesh.draw()?;
    Ok(chart)
}

/// The pieces of a line that lie inside, cut at the edges.
pub(super) fn clipped(points: &[(f64, f64)], x: &Range<f64>, y: &Range<f64>) -> Vec<Vec<(f64, f64)>> {
    let inside = |p: &(f64, f64)| (x.start..=x.end).contains(&p.0) && (y.start..=y.end).contains(&p.1);
    let mut pieces: Vec<Vec<(f64, f64)>> = Vec::new();
    let mut piece: Vec<(f64, f64)> = Vec::new();
    for pair in points.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        match (inside(&a), inside(&b)) {
            (true, true) => {
                if piece.is_empty() {
                    piece.push(a);
                }
                piece.push(b);
            }
            (true, false) => {
                if piece.is_empty() {
                    piece.push(a);
                }
                piece.push(edge(a, b, &inside));
                pieces.push(std::mem::take(&mut piece));
            }
            (false, true) => piece = vec![edge(b, a, &inside), b],
            (false, false) => {}
        }
    }
    pieces.push(piece);
    pieces.retain(|piece| piece.len() > 1);
    pieces
}

/// The last point inside on the way from `from` (inside) to `to` (outside).
fn edge(from: (f64, f64), to: (f64, f64), inside: &impl Fn(&(f64, f64)) -> bool) -> (f64, f64) {
    let at = |t: f64| (from.0 + t * (to.0 - from.0), from.1 + t * (to.1 - from.1));
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..30 {
        let middle = 0.5 * (low + high);
        if inside(&at(middle)) {
            low = middle;
        } else {
            high = middle;
        }
    }
    at(low)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        let (ticks, places) = round_ticks(&(0.03..0.97), 6);
        assert_eq!(places, 1);
        assert_eq!(
            ticks.iter().map(|t| number(*t, places)).collect::<Vec<_>>(),
            ["0.2", "0.4", "0.6", "0.8"]
        );
        let (ticks, places) = round_ticks(&(-0.13..0.13), 4);
        assert_eq!(
            ticks.iter().map(|t| number(*t, places)).collect::<Vec<_>>(),
            ["−0.1", "0.0", "0.1"]
        );
        assert_eq!(round_ticks(&(-0.049..0.049), 4).0.len(), 5);
        let (ticks, places) = round_ticks(&(720.0..0.0), 6);
        assert_eq!((ticks.len(), places), (4, 0));
        assert_eq!(round_ticks(&(3600.0..3600.9), 9).0.len(), 10);
        assert_eq!(round_ticks(&(1.0..1.0), 4).0, [1.0]);
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
    fn a_line_is_cut_at_the_edges() {
        let line = [(0.0, 0.0), (1.0, 2.0), (2.0, 0.0), (3.0, -2.0)];
        let pieces = clipped(&line, &(0.0..3.0), &(-1.0..1.0));
        assert_eq!(pieces.len(), 2);
        assert!((pieces[0][1].0 - 0.5).abs() < 1e-6 && (pieces[0][1].1 - 1.0).abs() < 1e-6);
        assert!((pieces[1][0].0 - 1.5).abs() < 1e-6);
        assert!((pieces[1].last().unwrap().1 + 1.0).abs() < 1e-6);
        assert!(clipped(&line, &(5.0..6.0), &(0.0..1.0)).is_empty());
    }
}
