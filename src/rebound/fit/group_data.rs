//! The rows of a group, ready for the searches: heaviest first, with a sample of those where they are many.

use super::observation::{Observation, Spin};
use super::row_law::{KAPPA, PARAMETERS, RATIO, Regimes, Theta, Variant, nearest};
use super::series::{Column, ColumnSet, Series, SetAside, Weights};
use crate::rebound::ModelName;
use rayon::prelude::*;
use std::cmp::Ordering;

/// More rows than this are searched by a sample first; the last steps take them all.
pub(super) const SAMPLE: usize = 600;

/// Rows that are worth a processor of their own.
const PART: usize = 512;

/// So many of those parts are made at once.
const PARTS: usize = 64;

/// A measured spin after that is this much closer to the impulse balance than its own deviation was computed from it.
const COMPUTED: f64 = 1e-3;

/// Rows of a group.
#[derive(Debug, Clone)]
pub(super) struct GroupData {
    /// Heaviest first.
    pub rows: Vec<Observation>,
    /// Every row, or so many of them, spread evenly over the incidence; ascending.
    pub sample: Vec<usize>,
    pub weights: Weights,
    /// Whether the spin of some rows is to be fitted.
    pub shared_spin: bool,
    /// Whether the stiffness ratio of some rows is to be fitted.
    pub fitted_stiffness: bool,
    /// Square of what counts as no scatter at all, in the units of χ²: the rounding of the numbers themselves.
    pub rounding: f64,
}

impl GroupData {
    /// The rows of a group, at `indices` of the series, and those that cannot be weighted; κ is `stiffness_ratio` where a row
    /// does not give its own.
    pub fn new(series: &Series, indices: &[usize], stiffness_ratio: Option<f64>) -> (Self, Vec<SetAside>) {
        let spin_out = series.set == ColumnSet::Velocities && spin_was_measured(series, indices);
        let mut rows = Vec::with_capacity(indices.len());
        let mut set_aside = Vec::new();
        // A part after the other, so that only one of them is there twice.
        for part in indices.chunks(PARTS * PART) {
            let made: Vec<Result<Observation, String>> = part
                .par_iter()
                .with_min_len(PART)
                .map(|&index| {
                    let mut row = Observation::new(series, index, spin_out)?;
                    row.stiffness_ratio = row.stiffness_ratio.or(stiffness_ratio);
                    weighable(&row).map(|()| row)
                })
                .collect();
            for (made, &index) in made.into_iter().zip(part) {
                match made {
                    Ok(row) => rows.push(row),
                    Err(reason) => set_aside.push(SetAside {
                        row: series.rows[index].number,
                        group: series.rows[index].group.to_string(),
                        reason,
                    }),
                }
            }
        }
        (Self::of_rows(rows, series.weights), set_aside)
    }

    fn of_rows(mut rows: Vec<Observation>, weights: Weights) -> Self {
        let heaviest = |row: &Observation| {
            let positive = row.variance.iter().filter(|v| **v > 0.0);
            positive.fold(f64::INFINITY, |least, v| least.min(*v))
        };
        // By the row's own number in the end, so that the order is one.
        rows.par_sort_unstable_by(|a, b| heaviest(a).total_cmp(&heaviest(b)).then(a.row.cmp(&b.row)));
        let sample = sample(&rows);
        Self {
            shared_spin: rows.iter().any(|row| row.spin == Spin::Shared),
            fitted_stiffness: rows.iter().any(|row| row.stiffness_ratio.is_none()),
            rounding: rounding(&rows, weights),
            sample,
            rows,
            weights,
        }
    }

    /// Takes out the rows that are marked in `out`.
    pub fn leave_out(&mut self, out: &[bool]) {
        let mut rows = std::mem::take(&mut self.rows);
        let mut marks = out.iter();
        rows.retain(|_| marks.next() != Some(&true));
        *self = Self::of_rows(rows, self.weights);
    }

    /// The rows of the sample alone, where that is not all.
    pub fn preview(&self) -> Option<Self> {
        let rows = || self.sample.iter().map(|&i| self.rows[i].clone()).collect();
        (self.sample.len() < self.rows.len()).then(|| Self::of_rows(rows(), self.weights))
    }

    /// Which parameters of a model a search moves.
    pub fn searched(&self, model: ModelName) -> [bool; PARAMETERS] {
        let mut free = model.searched(self.shared_spin);
        free[KAPPA] &= self.fitted_stiffness;
        free
    }

    /// Equations in all.
    pub fn equations(&self) -> usize {
        self.rows.iter().map(Observation::equations).sum()
    }
}

/// s |a − w| / b: the impulse that would stop the slip, for each of the normal impulse before restitution; what rows are
/// in order of, from grip to sliding.
pub(super) fn friction_demand(row: &Observation, theta: &Theta) -> f64 {
    let k = row.kinematics(&row.z, theta[RATIO]);
    row.slip_share * (k.a - k.w).abs() / k.b
}

/// Whether the errors of the row leave no equation without any.
fn weighable(row: &Observation) -> Result<(), String> {
    let theta = [0.7, 0.0, 0.1, 0.3, 1.0];
    // The errors' place in the equations is the same in every model.
    let rolls = Variant {
        model: ModelName::ALL[0],
        regimes: Regimes::Grip,
        free: [true; PARAMETERS],
    };
    match nearest(row, &rolls, &theta, 0.0) {
        Some(_) => Ok(()),
        None => Err("its standard deviations are 0, so it cannot be weighed against the others".to_owned()),
    }
}

/// Whether the spins after were measured, and not computed from the velocities, which would make them tell the same
/// thing twice.
fn spin_was_measured(series: &Series, indices: &[usize]) -> bool {
    let off = |&i: &usize| {
        let row = &series.rows[i];
        let after = row.reading(Column::SpinOut)?;
        let (before, vx) = (row.value(Column::IncidentVx)?, row.reading(Column::ReboundVx)?);
        let ratio = row.value(Column::SpinRatio).map(|r| r * before);
        let spin_in = row.value(Column::SpinIn).or(ratio)?;
        let balance = spin_in + (before - vx.value) / row.inertia_factor();
        let scale = before.abs().max(vx.value.abs()).max(after.value.abs());
        let std = after.std.filter(|s| *s > 0.0).unwrap_or(1e-3 * scale);
        Some((after.value - balance).abs() > (COMPUTED * std).max(1e-9 * scale))
    };
    let mut measured = indices.iter().filter_map(off).peekable();
    // Where the spin before is not known in any row, the spin after is all there is.
    measured.peek().is_none() || measured.any(|off| off)
}

fn sample(rows: &[Observation]) -> Vec<usize> {
    if rows.len() <= SAMPLE {
        return (0..rows.len()).collect();
    }
    let zero = [0.0; PARAMETERS];
    let mut order: Vec<(f64, usize)> = rows
        .iter()
        .enumerate()
        .map(|(i, r)| (friction_demand(r, &zero), i))
        .collect();
    order.sort_by(|a, b| a.partial_cmp(b).unwrap_or(Ordering::Equal));
    let mut chosen: Vec<usize> = (0..SAMPLE)
        .map(|i| order[i * (rows.len() - 1) / (SAMPLE - 1)].1)
        .collect();
    chosen.sort_unstable();
    chosen.dedup();
    chosen
}

/// Without deviations nothing says what scatter is small; the last digits of the numbers do.
fn rounding(rows: &[Observation], weights: Weights) -> f64 {
    const DIGITS: f64 = 1e-10;
    match weights {
        Weights::Stated => 0.0,
        Weights::Unit => {
            let size = rows
                .iter()
                .flat_map(|r| r.z[..4].iter())
                .fold(0.0_f64, |m, z| m.max(z.abs()));
            (DIGITS * size).powi(2)
        }
    }
}
