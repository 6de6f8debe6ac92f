//! The paper's figures from a series: which points and curves each holds.

use super::chart::{Chart, Key, LineStyle, PlotPoint, PointMarker};
use super::figure::span;
use crate::numeric::robust::{commonest, median};
use crate::rebound::fit::coordinates::{Coordinates, Mark, Prediction, SAME_SPIN};
use crate::rebound::fit::{GroupFit, ModelFit, ModelName, Parameter, RowRegime, Series};
use crate::rebound::{Contact, SOLID_SPHERE};
use std::f64::consts::FRAC_PI_2;

/// Rows drawn of a group; of more, every n-th.
const MOST_ROWS: usize = 400;

/// Points of a curve.
const STEPS: usize = 240;

/// Which figure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SeriesFigure {
    /// tan φ against tan θ.
    Angles,
    /// x / x_o against x_o.
    Distances,
    /// R ω / u_o against θ.
    Spin,
    /// v_x / v_ox against θ.
    Kept,
    /// R ω_y / v_o against θ.
    SpinOverSpeed,
    /// ψ₂ against ψ₁, with κ/μ of the compliant model.
    Master,
    /// Spin before against θ: where a ball grips and where it slides.
    Regimes,
}

impl SeriesFigure {
    pub const ALL: [Self; 7] = [
        Self::Angles,
        Self::Distances,
        Self::Spin,
        Self::Kept,
        Self::SpinOverSpeed,
        Self::Master,
        Self::Regimes,
    ];

    fn labels(self) -> (&'static str, &'static str) {
        match self {
            Self::Angles => ("tan θ", "tan φ"),
            Self::Distances => ("x₀ / m", "x / x₀"),
            Self::Spin => ("θ / degrees", "Rω / u₀"),
            Self::Kept => ("θ / degrees", "v_x / v_0x"),
            Self::SpinOverSpeed => ("θ / degrees", "Rω / v₀"),
            Self::Master => ("ψ₁ = κ slip / (μ v_z) before", "ψ₂ after"),
            Self::Regimes => ("θ / degrees", "Rω₀ / u₀ before"),
        }
    }

    /// In the name of its file.
    pub fn file_word(self) -> &'static str {
        match self {
            Self::Angles => "angles",
            Self::Distances => "distances",
            Self::Spin => "spin",
            Self::Kept => "tangential_ratio",
            Self::SpinOverSpeed => "spin_over_speed",
            Self::Master => "master_curve",
            Self::Regimes => "regimes",
        }
    }

    /// What it is called on the page.
    pub fn title(self) -> &'static str {
        match self {
            Self::Angles => "Rebound against incidence",
            Self::Distances => "Distances",
            Self::Spin => "Spin after the bounce",
            Self::Kept => "What is left of the speed along the floor",
            Self::SpinOverSpeed => "Spin after the bounce, over the speed before",
            Self::Master => "The compliant contact's master curve: slip after against slip before",
            Self::Regimes => "Where the ball grips and where it slides",
        }
    }

    /// `unit` is κ/μ, for the figure that needs it.
    fn place(self, c: &Coordinates, unit: Option<f64>) -> Option<(Mark, Mark)> {
        let degrees = |mark: Mark| Mark {
            value: mark.value.to_degrees(),
            std: mark.std.map(f64::to_degrees),
        };
        match self {
            Self::Angles => Some((c.incident_tangent, c.rebound_tangent?)),
            Self::Distances => Some((c.x0_m?, c.distance_ratio?)),
            Self::Spin => Some((degrees(c.incident_rad), c.spin_after_ratio?)),
            Self::Kept => Some((degrees(c.incident_rad), c.tangential_ratio?)),
            Self::SpinOverSpeed => Some((degrees(c.incident_rad), c.spin_over_speed?)),
            Self::Master => {
                let unit = unit?;
                let scaled = |mark: Mark| Mark {
                    value: unit * mark.value,
                    std: mark.std.map(|std| unit * std),
                };
                Some((scaled(c.slip_before?), scaled(c.slip_after?)))
            }
            Self::Regimes => Some((degrees(c.incident_rad), c.spin_ratio?)),
        }
    }

    fn predicted(self, p: &Prediction, unit: Option<f64>) -> Option<f64> {
        match self {
            Self::Angles => Some(p.rebound_tangent),
            Self::Distances => Some(p.distance_ratio),
            Self::Spin => Some(p.spin_after_ratio),
            Self::Kept => Some(p.tangential_ratio),
            Self::SpinOverSpeed => Some(p.spin_over_speed),
            Self::Master => Some(unit? * p.slip_after),
            Self::Regimes => None,
        }
    }
}

/// A row to be drawn.
struct DrawnRow {
    coordinates: Coordinates,
    /// `None` where it is not in the fit.
    regime: Option<RowRegime>,
    inertia_factor: f64,
}

/// What is drawn of a group.
pub(super) struct GroupDrawing<'a> {
    group: &'a GroupFit,
    rows: Vec<DrawnRow>,
    /// Of the curves: the one that most rows have, and the rows' own medians.
    spin_ratio: f64,
    inertia_factor: f64,
    /// tan θ times x_o: u_o²/g, the same for all launches at one speed.
    reach_m: Option<f64>,
    /// κ/μ of the compliant model; `None` where the rows do not tell both.
    psi_unit: Option<f64>,
    /// Every how many-th row is drawn.
    pub every: usize,
}

impl<'a> GroupDrawing<'a> {
    pub fn new(series: &Series, group: &'a GroupFit) -> Self {
        let shown = group.shown();
        let restitution = shown.map_or(f64::NAN, |fit| fit.curve.restitution());
        let shared = shown.and_then(|fit| fit.shared_spin_ratio);
        let coordinates = |index: usize| {
            let row = &series.rows[index];
            let c = Coordinates::new(row, series.set, series.weights, restitution, shared)?;
            Some((c, row.inertia_factor()))
        };
        let every = group.row_indices.len().div_ceil(MOST_ROWS).max(1);
        let mut rows: Vec<DrawnRow> = group
            .row_indices
            .iter()
            .enumerate()
            .step_by(every)
            .filter_map(|(place, &index)| {
                let (coordinates, inertia_factor) = coordinates(index)?;
                Some(DrawnRow {
                    coordinates,
                    regime: shown.and_then(|fit| fit.rows.get(place)).map(|row| row.regime),
                    inertia_factor,
                })
            })
            .collect();
        let aside: std::collections::HashSet<usize> = group.rows_set_aside.iter().map(|s| s.row).collect();
        let out = series
            .rows
            .iter()
            .enumerate()
            .filter(|(_, row)| *row.group == *group.name && aside.contains(&row.number));
        rows.extend(out.take(MOST_ROWS).filter_map(|(index, _)| {
            let (coordinates, inertia_factor) = coordinates(index)?;
            Some(DrawnRow {
                coordinates,
                regime: None,
                inertia_factor,
            })
        }));
        let middle = |of: &dyn Fn(&DrawnRow) -> Option<f64>| {
            median(
                &mut rows
                    .iter()
                    .filter_map(of)
                    .filter(|v| v.is_finite())
                    .collect::<Vec<_>>(),
            )
        };
        // A recording's later bounces have each their own spin; the curves are for the launches.
        let mut spins: Vec<f64> = rows
            .iter()
            .filter_map(|d| d.coordinates.spin_ratio)
            .map(|m| m.value)
            .filter(|v| v.is_finite())
            .collect();
        Self {
            spin_ratio: commonest(&mut spins, SAME_SPIN).unwrap_or(0.0),
            inertia_factor: middle(&|d| Some(d.inertia_factor)).unwrap_or(SOLID_SPHERE),
            reach_m: middle(&|d| Some(d.coordinates.x0_m?.value * d.coordinates.incident_tangent.value)),
            psi_unit: psi_unit(group),
            group,
            rows,
            every,
        }
    }

    /// Whether the rows' spins before differ, so that one curve is not that of all of them.
    pub fn spins_differ(&self) -> bool {
        let spins = self.rows.iter().filter_map(|d| d.coordinates.spin_ratio);
        let (least, most) = spins.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), m| {
            (least.min(m.value), most.max(m.value))
        });
        most - least > 0.05
    }

    /// The figure; `None` where the rows hold no such numbers.
    pub fn figure(&self, figure: SeriesFigure) -> Option<Chart> {
        let shown = self.group.shown()?;
        let dots: Vec<PlotPoint> = self
            .rows
            .iter()
            .filter_map(|row| dot(figure, row, self.psi_unit))
            .collect();
        let used = || dots.iter().filter(|dot| dot.marker != PointMarker::Cross);
        used().next()?;
        let (x_label, y_label) = figure.labels();
        let x = axis(used().map(|d| (d.x, d.x_std)), figure)?;
        let curves: Vec<(ModelName, Vec<(f64, f64)>)> = self
            .group
            .models
            .iter()
            .flat_map(|fit| {
                self.curve(figure, fit, &x)
                    .into_iter()
                    .map(|line| (fit.name, line))
            })
            .collect();
        let y = if figure == SeriesFigure::Regimes {
            regime_axis(used().map(|d| d.y))
        } else {
            span(used().map(|d| d.y), 0.12)?
        };
        let residuals = match figure {
            SeriesFigure::Regimes => Vec::new(),
            _ => self
                .rows
                .iter()
                .filter_map(|row| self.residual(figure, row, shown))
                .collect(),
        };
        let mut curves: Vec<(LineStyle, Vec<(f64, f64)>)> = curves
            .into_iter()
            .map(|(name, line)| (stroke(name), line))
            .collect();
        // The broad one lies below.
        curves.sort_by_key(|(stroke, _)| *stroke != LineStyle::Broad);
        let transition = self.transition(figure, shown);
        Some(Chart {
            residual_label: "residual",
            name: format!("{y_label} against {x_label}, group {}", self.group.name),
            x_label: x_label.to_owned(),
            y_label: y_label.to_owned(),
            words: regime_words(figure, &curves, &x, &y),
            legend: legend(&dots, &curves, transition.is_some()),
            transitions: transition.into_iter().collect(),
            x,
            y,
            curves,
            dots,
            residuals,
        })
    }

    /// The curve of a model, in pieces where it jumps.
    fn curve(&self, figure: SeriesFigure, fit: &ModelFit, x: &std::ops::Range<f64>) -> Vec<Vec<(f64, f64)>> {
        if figure == SeriesFigure::Regimes {
            return self.border(&fit.curve);
        }
        let tangent = |abscissa: f64| {
            Some(match figure {
                SeriesFigure::Angles => abscissa,
                SeriesFigure::Distances => self.reach_m? / abscissa,
                SeriesFigure::Master => abscissa / (self.psi_unit? * (1.0 - self.spin_ratio).abs()),
                _ => abscissa.to_radians().tan(),
            })
        };
        let mut places: Vec<f64> = (0..=STEPS)
            .map(|i| x.start + (x.end - x.start) * (i as f64 + 1e-6) / STEPS as f64)
            .collect();
        let kink = self.transition(figure, fit);
        if let Some(kink) = kink.filter(|k| x.contains(k)) {
            let step = 1e-9 * (x.end - x.start);
            places.extend([kink - step, kink + step]);
            places.sort_by(f64::total_cmp);
        }
        let (places, tangents): (Vec<f64>, Vec<f64>) =
            places.into_iter().filter_map(|x| Some((x, tangent(x)?))).unzip();
        let predicted = fit
            .curve
            .predictions(&tangents, self.spin_ratio, self.inertia_factor);
        let at =
            |(x, p): (&f64, &Option<Prediction>)| Some((*x, figure.predicted(p.as_ref()?, self.psi_unit)?));
        let points: Vec<(f64, f64)> = places.iter().zip(&predicted).filter_map(at).collect();
        let cut = kink.unwrap_or(f64::INFINITY);
        let side = |upper: bool| {
            points
                .iter()
                .copied()
                .filter(|p| (p.0 > cut) == upper)
                .collect::<Vec<_>>()
        };
        [side(false), side(true)]
            .into_iter()
            .filter(|piece| piece.len() > 1)
            .collect()
    }

    /// Abscissa at which sliding begins.
    fn transition(&self, figure: SeriesFigure, fit: &ModelFit) -> Option<f64> {
        let angle = fit.curve.transition_rad(self.spin_ratio, self.inertia_factor)?;
        if !(angle > 0.0 && angle < FRAC_PI_2) {
            return None;
        }
        match figure {
            SeriesFigure::Angles => Some(angle.tan()),
            SeriesFigure::Distances => Some(self.reach_m? / angle.tan()),
            SeriesFigure::Spin | SeriesFigure::Kept | SeriesFigure::SpinOverSpeed => Some(angle.to_degrees()),
            SeriesFigure::Master => Some(self.psi_unit? * angle.tan() * (1.0 - self.spin_ratio).abs()),
            SeriesFigure::Regimes => None,
        }
    }

    /// θ_L over all spins before.
    fn border(&self, curve: &Contact) -> Vec<Vec<(f64, f64)>> {
        let spins = (0..=2 * STEPS).map(|i| -5.0 + 12.0 * i as f64 / (2.0 * STEPS as f64));
        let line: Vec<(f64, f64)> = spins
            .filter_map(|r| Some((curve.transition_rad(r, self.inertia_factor)?.to_degrees(), r)))
            .collect();
        if line.is_empty() { Vec::new() } else { vec![line] }
    }

    fn residual(&self, figure: SeriesFigure, row: &DrawnRow, fit: &ModelFit) -> Option<PlotPoint> {
        let place = dot(figure, row, self.psi_unit)?;
        let spin = row.coordinates.spin_ratio.map_or(self.spin_ratio, |m| m.value);
        let tangent = row.coordinates.incident_tangent.value;
        let p = fit.curve.predict(tangent, spin, row.inertia_factor)?;
        Some(PlotPoint {
            y: place.y - figure.predicted(&p, self.psi_unit)?,
            ..place
        })
    }
}

/// κ/μ of a group's compliant fit.
fn psi_unit(group: &GroupFit) -> Option<f64> {
    let fit = group.model(ModelName::Compliant)?;
    let value = |parameter| Some(fit.parameter(parameter).quantity()?.value);
    let unit = value(Parameter::StiffnessRatio)? / value(Parameter::Friction)?;
    unit.is_finite().then_some(unit)
}

fn dot(figure: SeriesFigure, row: &DrawnRow, psi_unit: Option<f64>) -> Option<PlotPoint> {
    let (x, y) = figure.place(&row.coordinates, psi_unit)?;
    Some(PlotPoint {
        x: x.value,
        y: y.value,
        x_std: x.std,
        y_std: y.std,
        marker: match row.regime {
            Some(RowRegime::Sliding) => PointMarker::Disc,
            Some(RowRegime::Gripping) => PointMarker::Ring,
            None => PointMarker::Cross,
        },
    })
}

/// Lines that are told apart without colour, in the order of the models.
pub(super) fn stroke(name: ModelName) -> LineStyle {
    const STYLES: [LineStyle; 4] = [
        LineStyle::Solid,
        LineStyle::Dashed,
        LineStyle::Broad,
        LineStyle::Dotted,
    ];
    STYLES[name as usize % STYLES.len()]
}

/// What is drawn, of markers and lines.
fn legend(
    dots: &[PlotPoint],
    curves: &[(LineStyle, Vec<(f64, f64)>)],
    transition: bool,
) -> Vec<(Key, String)> {
    let markers = [
        (PointMarker::Disc, "slides"),
        (PointMarker::Ring, "grips, or leaves rolling"),
        (PointMarker::Cross, "set aside"),
    ];
    let markers = markers
        .into_iter()
        .filter(|(marker, _)| dots.iter().any(|dot| dot.marker == *marker))
        .map(|(marker, words)| (Key::Marker(marker), words));
    let lines = ModelName::ALL
        .map(|name| (stroke(name), name.facts().label))
        .into_iter()
        .filter(|(line, _)| curves.iter().any(|(style, _)| style == line))
        .map(|(line, words)| (Key::Line(line), words));
    let transition = transition.then_some((Key::Line(LineStyle::Fine), "sliding begins"));
    markers
        .chain(lines)
        .chain(transition)
        .map(|(key, words)| (key, words.to_owned()))
        .collect()
}

/// From zero, where the paper's axes begin, unless the points lie on the other side of it.
fn axis(
    points: impl Iterator<Item = (f64, Option<f64>)>,
    figure: SeriesFigure,
) -> Option<std::ops::Range<f64>> {
    let mut least = f64::INFINITY;
    let ends = points.flat_map(|(x, std)| {
        least = least.min(x);
        let std = std.unwrap_or(0.0);
        [x - std, x + std]
    });
    let range = span(ends, 0.06)?;
    let start = if least >= 0.0 { 0.0 } else { range.start.max(-90.0) };
    let end = match figure {
        SeriesFigure::Spin | SeriesFigure::Kept | SeriesFigure::SpinOverSpeed => range.end.min(90.0),
        SeriesFigure::Regimes => 90.0,
        _ => range.end,
    };
    Some(start..end.max(start + 1e-9))
}

/// Around no spin and pure rolling, wider where the points are.
fn regime_axis(spins: impl Iterator<Item = f64>) -> std::ops::Range<f64> {
    let (low, high) = spins.fold((0.0_f64, 2.0_f64), |(low, high), r| (low.min(r), high.max(r)));
    low - 0.5..high + 0.5
}

fn regime_words(
    figure: SeriesFigure,
    curves: &[(LineStyle, Vec<(f64, f64)>)],
    x: &std::ops::Range<f64>,
    y: &std::ops::Range<f64>,
) -> Vec<(f64, f64, String)> {
    if figure != SeriesFigure::Regimes || curves.is_empty() {
        return Vec::new();
    }
    let across = |share: f64| x.start + share * (x.end - x.start);
    let up = |share: f64| y.start + share * (y.end - y.start);
    vec![
        (across(0.02), up(0.55), "grips, or leaves rolling".to_owned()),
        (across(0.86), up(0.97), "slides".to_owned()),
        (across(0.86), up(0.08), "slides".to_owned()),
    ]
}

/// The figures that show all groups.
pub(super) const OF_ALL_GROUPS: [SeriesFigure; 3] =
    [SeriesFigure::Angles, SeriesFigure::Distances, SeriesFigure::Spin];

/// All groups in one figure, as the paper's Fig. 4: a marker for each, and the curve of its model.
pub(super) fn overview(drawings: &[GroupDrawing<'_>], figure: SeriesFigure) -> Option<Chart> {
    let mut dots = Vec::new();
    for (i, drawing) in drawings.iter().enumerate() {
        let used = drawing.rows.iter().filter(|row| row.regime.is_some());
        dots.extend(
            used.filter_map(|row| dot(figure, row, drawing.psi_unit))
                .map(|d| PlotPoint {
                    marker: group_marker(i),
                    ..d
                }),
        );
    }
    let x = axis(dots.iter().map(|d| (d.x, d.x_std)), figure)?;
    let y = span(dots.iter().map(|d| d.y), 0.08)?;
    let curves = drawings
        .iter()
        .filter_map(|d| Some((d, d.group.shown()?)))
        .flat_map(|(d, fit)| d.curve(figure, fit, &x))
        .map(|line| (LineStyle::Solid, line))
        .collect();
    let (x_label, y_label) = figure.labels();
    Some(Chart {
        name: format!("{y_label} against {x_label}, all groups"),
        x_label: x_label.to_owned(),
        y_label: y_label.to_owned(),
        x,
        y,
        curves,
        dots,
        transitions: Vec::new(),
        words: Vec::new(),
        residuals: Vec::new(),
        residual_label: "residual",
        legend: drawings
            .iter()
            .enumerate()
            .map(|(i, drawing)| (Key::Marker(group_marker(i)), drawing.group.name.clone()))
            .collect(),
    })
}

/// The marker of a group in the overview.
pub(super) fn group_marker(index: usize) -> PointMarker {
    const MARKERS: [PointMarker; 6] = [
        PointMarker::Disc,
        PointMarker::Ring,
        PointMarker::Triangle,
        PointMarker::Square,
        PointMarker::OpenTriangle,
        PointMarker::Block,
    ];
    MARKERS[index % MARKERS.len()]
}
