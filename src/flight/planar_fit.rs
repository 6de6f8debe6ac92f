//! The arcs of a ball in the calibrated plane fitted together: each with its own place and velocity, all with the same
//! gravity and drag.
//!
//! ```text
//! r'' = a - β |v| r'          h'' = -g - β |v| h'          |v| = √(r'² + h'²)
//! ```
//!
//! with place and velocity of arc k at its mean time t_k ([`PlanarArcs`]). a, the acceleration along r, is what gravity has
//! there where "up" of the picture is not quite the plane's: the fall leans by atan(a/g). Without drag (β = 0) an arc is the
//! exact parabola and the fit is linear. With drag (β = ρ C_D π R² / 2m) Gauss-Newton settles in three steps: the rows have the arcs' own derivatives
//! ([`PlanarArcs::motions`]).
//!
//! Weighted least squares by QR of the whitened rows; times are centred, so nothing is lost at late times. The
//! covariance is that of the QR, times the reduced chi squared (never below 1) and the autocorrelation inflation.

use super::drag::{Drag, DragLaw};
use super::motion_model::{
    ArcFit, FitPoint, MotionModel, VerticalPrior, autocorrelation_inflation, mean_times,
};
use super::planar::{ACROSS, ARCS, BEND_POWERS, BENDS, DRAG, GRAVITY, PlanarArcs};
use super::samples::middle_and_extent;
use super::scale_change::{SCALE_CHANGES, ScaleChange};
use super::segment::TrackSample;
use crate::numeric::blocks::{BlockFactorisation, BlockRows};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// A step of Gauss-Newton that changes no residual by more than this part of its uncertainty is the last.
const SETTLED: f64 = 1e-6;

/// Times that a step is halved, at most, and the part by which rounding changes a sum of squares.
const MOST_HALVINGS: usize = 12;
const ROUNDING: f64 = 1e-12;

/// What is known beforehand of the forces in the plane.
#[derive(Debug, Clone, Copy)]
pub(super) struct PlanarPriors {
    /// Of "up"; `None` where nothing falls in the plane.
    pub(super) vertical: Option<VerticalPrior>,
    /// Of drag; `None` where nothing is.
    pub(super) drag: Option<Drag>,
    /// How far arcs may be bent, a part of their way.
    pub(super) bend: Option<f64>,
    /// How the scale changes, where it does.
    pub(super) scale_change: Option<ScaleChange>,
}

impl PlanarPriors {
    fn law(&self) -> DragLaw {
        self.drag.map_or_else(DragLaw::default, |d| d.law)
    }

    /// The common parameters that keep their value.
    fn held(&self, drag_is_fitted: bool) -> [bool; ARCS] {
        let mut held = [false; ARCS];
        held[GRAVITY] = self.vertical.is_none();
        held[DRAG] = !drag_is_fitted;
        held[ACROSS] = self.vertical.is_none_or(|v| v.std_rad == 0.0);
        held
    }

    /// Which parameter is known, its value, its standard uncertainty.
    fn rows(
        &self,
        points: &[FitPoint],
        times: &[f64],
        parameters: &DVector<f64>,
        held: [bool; ARCS],
    ) -> Vec<(usize, f64, f64)> {
        let mut rows = self
            .bend
            .map_or_else(Vec::new, |part| bend_rows(points, times, part));
        if let Some(change) = self.scale_change {
            let from = parameters.len() - SCALE_CHANGES;
            let known = change.known.iter().enumerate();
            rows.extend(known.map(|(i, (value, std))| (from + i, *value, *std)));
            rows.extend(change.fall.map(|(g, std)| (GRAVITY, g, std)));
        }
        if let Some(drag) = self.drag.filter(|_| !held[DRAG]) {
            rows.push((DRAG, drag.beta, drag.std));
        }
        let lean = self.vertical.map(|v| v.std_rad * parameters[GRAVITY].abs());
        // Before gravity is known there is no scale for it; the round that follows has it.
        if let Some(std) = lean.filter(|&std| std > 0.0 && std.is_finite() && !held[ACROSS]) {
            rows.push((ACROSS, 0.0, std));
        }
        rows
    }
}

/// What is known of the arcs' bends: none, to the `part` of the arc's way at its ends.
fn bend_rows(points: &[FitPoint], times: &[f64], part: f64) -> Vec<(usize, f64, f64)> {
    let mut rows = Vec::new();
    for (k, time) in times.iter().enumerate() {
        let arc = || points.iter().filter(move |p| p.arc == k).map(|p| &p.sample);
        let extent = |of: fn(&TrackSample) -> f64| middle_and_extent(arc().map(of)).1;
        let way = extent(|s| s.r).hypot(extent(|s| s.h));
        let half_s = arc().map(|s| (s.t - time).abs()).fold(0.0, f64::max);
        for (i, power) in BEND_POWERS.iter().chain(&BEND_POWERS).enumerate() {
            let std = part * way / half_s.powi(*power);
            rows.push((ARCS + 4 * times.len() + BENDS * k + i, 0.0, std));
        }
    }
    rows
}

/// The fit with drag or without.
pub(super) fn fit(
    points: &[FitPoint],
    arcs: usize,
    priors: &PlanarPriors,
    drag_is_fitted: bool,
    model: Arc<dyn MotionModel>,
) -> Option<ArcFit> {
    let times = mean_times(points, arcs)?;
    let held = priors.held(drag_is_fitted);
    let SettledArcs {
        parameters,
        factors,
        residuals,
    } = settled(points, &times, priors, drag_is_fitted)?;
    // Bends are held by what is known of them, and take from the points' freedom no more than their part.
    let not_free = priors.bend.map_or(0, |_| BENDS * arcs) + priors.scale_change.map_or(0, |_| SCALE_CHANGES);
    let fitted = parameters.len() - not_free - held.iter().filter(|&&h| h).count();
    let freedom = (2 * points.len()).saturating_sub(fitted);
    let reduced_chi = if freedom > 0 {
        (residuals.norm_squared() / freedom as f64).sqrt()
    } else {
        1.0
    };
    let autocorrelation_inflation = autocorrelation_inflation(points, &residuals);
    let deviance = deviance(
        points,
        &residuals,
        factors.ln_determinant(),
        &priors.rows(points, &times, &parameters, held),
    );
    let inverse = factors.covariance(&places(arcs, priors))?;
    let mut covariance = inverse * (reduced_chi.max(1.0).powi(2) * autocorrelation_inflation);
    for (i, _) in held.iter().enumerate().filter(|(_, h)| **h) {
        covariance[(i, i)] = 0.0;
    }
    let finite = residuals.iter().all(|x| x.is_finite()) && reduced_chi.is_finite();
    finite.then_some(ArcFit {
        times,
        parameters,
        covariance,
        reduced_chi,
        autocorrelation_inflation,
        model,
        deviance,
    })
}

/// Parameters from which Gauss-Newton goes no further.
struct SettledArcs {
    parameters: DVector<f64>,
    /// Those of the last step.
    factors: BlockFactorisation,
    residuals: DVector<f64>,
}

fn settled(
    points: &[FitPoint],
    times: &[f64],
    priors: &PlanarPriors,
    drag_is_fitted: bool,
) -> Option<SettledArcs> {
    let held = priors.held(drag_is_fitted);
    let bends = priors.bend.map_or(0, |_| BENDS * times.len());
    let mut parameters = match priors.scale_change {
        // A scale that changes bends arcs much as drag does: one that was found without drag would be a false start.
        Some(change) => {
            let one_scale = PlanarPriors {
                scale_change: None,
                ..*priors
            };
            let plain = settled(points, times, &one_scale, drag_is_fitted)?.parameters;
            let known = change.known.map(|(value, _)| value);
            let all = plain.iter().copied().chain(known);
            DVector::from_iterator(plain.len() + SCALE_CHANGES, all)
        }
        None if drag_is_fitted => settled(points, times, priors, false)?.parameters,
        None => DVector::zeros(ARCS + 4 * times.len() + bends),
    };
    // Linear without drag: one step is the solution. A prior of the lean goes with gravity, which the first step finds.
    let rounds = match priors.vertical {
        _ if priors.scale_change.is_some() => 20,
        _ if drag_is_fitted => 8,
        Some(vertical) if vertical.std_rad.is_finite() => 2,
        _ => 1,
    };
    let system_at = |parameters: &DVector<f64>| PlanarSystem::new(points, times, parameters, priors, held);
    let mut system = system_at(&parameters);
    let mut last = None;
    for _ in 0..rounds {
        let (factors, mut step) = system.step()?;
        last = Some(factors);
        keep(&mut step, held);
        let mut there = system_at(&(&parameters + &step));
        if priors.scale_change.is_some() {
            // A step that makes the residuals larger is halved.
            let most = system.residuals.norm_squared() * (1.0 + ROUNDING);
            for _ in 0..MOST_HALVINGS {
                if there.residuals.norm_squared() <= most {
                    break;
                }
                step *= 0.5;
                there = system_at(&(&parameters + &step));
            }
        }
        let is_settled = system.largest_change(&step) < SETTLED;
        parameters += &step;
        system = there;
        if is_settled {
            break;
        }
    }
    Some(SettledArcs {
        parameters,
        factors: last?,
        residuals: system.residuals,
    })
}

/// See [`ArcFit::deviance`]: `determined` is the logarithm of the covariance's determinant, `known` are the parameters with a prior.
fn deviance(
    points: &[FitPoint],
    residuals: &DVector<f64>,
    determined: f64,
    known: &[(usize, f64, f64)],
) -> Option<f64> {
    let weights: f64 = points.iter().map(|p| 2.0 * p.sample.weight.ln()).sum();
    let priors: f64 = known.iter().map(|(_, _, std)| 2.0 * std.ln()).sum();
    let all = residuals.norm_squared() - weights + priors - determined;
    all.is_finite().then_some(all)
}

/// See [`MotionModel::response`].
pub(super) fn response(
    fit: &ArcFit,
    points: &[FitPoint],
    shifts: &[(f64, f64)],
    priors: &PlanarPriors,
) -> Option<DVector<f64>> {
    // What was held has no variance.
    let held = [GRAVITY, DRAG, ACROSS].map(|i| fit.covariance[(i, i)] == 0.0);
    let mut system = PlanarSystem::new(points, &fit.times, &fit.parameters, priors, held);
    system.residuals.fill(0.0);
    for (i, (p, (dr, dh))) in points.iter().zip(shifts).enumerate() {
        let w = p.sample.weight.sqrt();
        system.residuals[2 * i] = w * dr;
        system.residuals[2 * i + 1] = w * dh;
    }
    for rows in system.blocks.iter_mut().chain([&mut system.shared]) {
        rows.right.fill(0.0);
    }
    system.take_residuals();
    let (_, mut change) = system.step()?;
    keep(&mut change, held);
    Some(change)
}

/// Where the parameters of each arc are: place and velocity, and its bend; then those that all arcs share.
fn places(arcs: usize, priors: &PlanarPriors) -> Vec<Vec<usize>> {
    let bends = |k: usize| {
        let from = ARCS + 4 * arcs + BENDS * k;
        priors.bend.map_or(from..from, |_| from..from + BENDS)
    };
    let own = |k: usize| (ARCS + 4 * k..ARCS + 4 * k + 4).chain(bends(k)).collect();
    let mut places: Vec<Vec<usize>> = (0..arcs).map(own).collect();
    let behind: usize = ARCS + places.iter().map(Vec::len).sum::<usize>();
    let changes = priors.scale_change.map_or(0, |_| SCALE_CHANGES);
    places.push((0..ARCS).chain(behind..behind + changes).collect());
    places
}

/// Whitened Jacobian and residuals at some parameters.
struct PlanarSystem {
    /// See [`places`].
    places: Vec<Vec<usize>>,
    /// Of each arc: two rows for each of its points, then what is known of its own parameters.
    blocks: Vec<BlockRows>,
    /// What is known of the shared parameters; one that is held has a row of its own.
    shared: BlockRows,
    /// The points of each arc.
    points: Vec<Vec<usize>>,
    /// Two residuals for each point, then those of all that is known.
    residuals: DVector<f64>,
}

impl PlanarSystem {
    fn new(
        points: &[FitPoint],
        times: &[f64],
        parameters: &DVector<f64>,
        priors: &PlanarPriors,
        held: [bool; ARCS],
    ) -> Self {
        let planar = PlanarArcs {
            parameters: parameters.as_slice(),
            times,
            law: priors.law(),
            bent: priors.bend.is_some(),
        };
        let places = places(times.len(), priors);
        let known = priors.rows(points, times, parameters, held);
        let holds = held.iter().enumerate().filter(|(_, h)| **h);
        // Which parameter, its residual, its weight.
        let known: Vec<(usize, f64, f64)> = holds
            .map(|(i, _)| (i, 0.0, 1.0))
            .chain(
                known
                    .into_iter()
                    .map(|(i, value, std)| (i, (value - parameters[i]) / std, 1.0 / std)),
            )
            .collect();
        let mut of_arc = vec![Vec::new(); times.len()];
        for (i, p) in points.iter().enumerate() {
            of_arc[p.arc].push(i);
        }
        let mut residuals = DVector::zeros(2 * points.len() + known.len());
        for (i, (_, residual, _)) in known.iter().enumerate() {
            residuals[2 * points.len() + i] = *residual;
        }
        let all_shared = places[times.len()].len();
        let mut blocks = Vec::with_capacity(times.len());
        for (k, own) in of_arc.iter().enumerate() {
            let known = known_of(&places[k], &known);
            let columns = places[k].len();
            let mut block = BlockRows {
                matrix: DMatrix::zeros(2 * own.len() + known.len(), columns + all_shared),
                right: DVector::zeros(2 * own.len() + known.len()),
            };
            let times_s: Vec<f64> = own.iter().map(|&i| points[i].sample.t).collect();
            let motions = planar.motions(k, &times_s, !held[DRAG]);
            for (row, (&i, (m, slopes))) in own.iter().zip(motions).enumerate() {
                let sample = &points[i].sample;
                let w = sample.weight.sqrt();
                let t = sample.t - times[k];
                let mut rows = block.matrix.rows_mut(2 * row, 2);
                let seen = priors.scale_change.map_or(m, |change| {
                    change.seen(ScaleChange::of(parameters.as_slice()), sample.t, &m)
                });
                residuals[2 * i] = w * (sample.r - seen.r);
                residuals[2 * i + 1] = w * (sample.h - seen.h);
                rows[(0, 0)] = w;
                rows[(1, 2)] = w;
                for (c, column) in [1, 3].into_iter().enumerate() {
                    rows.set_column(column, &(w * slopes.column(c)));
                }
                if priors.bend.is_some() {
                    for (n, power) in BEND_POWERS.iter().enumerate() {
                        rows[(0, 4 + n)] = w * t.powi(*power);
                        rows[(1, 4 + BEND_POWERS.len() + n)] = w * t.powi(*power);
                    }
                }
                for shared in (0..ARCS).filter(|&i| !held[i]) {
                    rows.set_column(columns + shared, &(w * slopes.column(2 + shared)));
                }
                if let Some(change) = priors.scale_change {
                    let now = ScaleChange::of(parameters.as_slice());
                    let in_plane = change.jacobian(now, sample.t, &m) * &rows;
                    rows.copy_from(&in_plane);
                    for (j, (dr, dh)) in change.slopes(now, sample.t, &m).into_iter().enumerate() {
                        rows[(0, columns + ARCS + j)] = w * dr;
                        rows[(1, columns + ARCS + j)] = w * dh;
                    }
                }
            }
            for (row, (column, residual, weight)) in known.into_iter().enumerate() {
                block.matrix[(2 * own.len() + row, column)] = weight;
                block.right[2 * own.len() + row] = residual;
            }
            blocks.push(block);
        }
        let known = known_of(&places[times.len()], &known);
        let mut shared = BlockRows {
            matrix: DMatrix::zeros(known.len(), all_shared),
            right: DVector::zeros(known.len()),
        };
        for (row, (column, residual, weight)) in known.into_iter().enumerate() {
            shared.matrix[(row, column)] = weight;
            shared.right[row] = residual;
        }
        let mut system = Self {
            places,
            blocks,
            shared,
            points: of_arc,
            residuals,
        };
        system.take_residuals();
        system
    }

    /// Puts the points' residuals into their rows.
    fn take_residuals(&mut self) {
        for (block, own) in self.blocks.iter_mut().zip(&self.points) {
            for (row, i) in own.iter().enumerate() {
                for c in 0..2 {
                    block.right[2 * row + c] = self.residuals[2 * i + c];
                }
            }
        }
    }

    /// The factors, and the step that they lead to.
    fn step(&self) -> Option<(BlockFactorisation, DVector<f64>)> {
        let factors = BlockFactorisation::new(&self.blocks, &self.shared)?;
        let (own, shared) = factors.solution()?;
        let mut step = DVector::zeros(self.places.iter().map(Vec::len).sum());
        for (values, places) in own.iter().chain([&shared]).zip(&self.places) {
            for (value, &place) in values.iter().zip(places) {
                step[place] = *value;
            }
        }
        Some((factors, step))
    }

    /// The largest change of a residual that a `step` makes, to first order.
    fn largest_change(&self, step: &DVector<f64>) -> f64 {
        let of = |places: &[usize]| DVector::from_iterator(places.len(), places.iter().map(|&i| step[i]));
        let (own, shared) = self.places.split_at(self.blocks.len());
        let shared = of(&shared[0]);
        let change = |(block, places): (&BlockRows, &Vec<usize>)| {
            let own = places.len();
            let (a, b) = (
                block.matrix.columns(0, own),
                block.matrix.columns(own, shared.len()),
            );
            (a * of(places) + b * &shared).amax()
        };
        let alone = if self.shared.right.is_empty() {
            0.0
        } else {
            (&self.shared.matrix * &shared).amax()
        };
        self.blocks.iter().zip(own).map(change).fold(alone, f64::max)
    }
}

/// Of what is `known`, that of the parameters at `places`, by their place among these.
fn known_of(places: &[usize], known: &[(usize, f64, f64)]) -> Vec<(usize, f64, f64)> {
    let at = |i: usize| places.iter().position(|&p| p == i);
    let own = known
        .iter()
        .filter_map(|&(i, residual, weight)| Some((at(i)?, residual, weight)));
    own.collect()
}

/// Takes from a step what rounding puts into a parameter that is held. The others do not feel its row; but a drag of
/// 1e-11 in place of none, times the square of a ball's speed in pixels, is a force.
fn keep(step: &mut DVector<f64>, held: [bool; ARCS]) {
    for (i, _) in held.iter().enumerate().filter(|(_, held)| **held) {
        step[i] = 0.0;
    }
}
