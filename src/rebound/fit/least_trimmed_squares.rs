//! Robust fits of the models: what the bulk of the rows says, whatever some of them do.
//!
//! Least trimmed squares (Rousseeuw 1984) over three fifths of the rows, with concentration steps from many starts; then all
//! rows within reach of the fit; and each of the others is taken back if the fit with it is no worse than chance.

use super::criteria::{self, MEDIANS, TAIL_RATIOS, chi2_quantile, f_quantile};
use super::group_data::{GroupData, friction_demand};
use super::observation::Observation;
use super::row_law::{NearestMotion, PARAMETERS, Regimes, Theta, Variant, friction_share};
use super::search::{Minimum, Task};
use super::series::Weights;
use super::starts;
use crate::rebound::ModelName;
use crate::rebound::model::FrictionLimit;

/// Probability that a good series loses a row.
pub(super) const FALSE_ALARM: f64 = 0.001;

/// Part of the rows of the trimmed fit.
const CORE: f64 = 0.6;

/// With fewer equations than this, a fifth of the rows may be set aside, and only if the rest fits as its deviations say: a
/// model with three parameters describes most of a handful of rows even where it is wrong.
const HANDFUL: usize = 20;

/// Part of more rows that may be set aside.
const MOST_OUT: f64 = 1.0 / 3.0;

/// Rows up to which each one that sticks out is tried in the fit.
const TRIED: usize = 200;

/// A robust fit of one model.
pub(super) struct RobustFit {
    pub variant: Variant,
    pub theta: Theta,
    /// Share of each row of the sample in χ².
    shares: Vec<f64>,
}

/// Each model's robust fit, those with a jump apart, and by how much the bulk of the rows scatters around the best of them
/// (a factor on variances; without deviations, their variance).
pub(super) fn best_fits(data: &GroupData) -> Option<(Vec<RobustFit>, f64)> {
    let mut fits: Vec<Vec<RobustFit>> = variants(data)
        .map(|variant| {
            let starts = starts::candidates(data, &data.sample, &variant.free);
            robust(data, variant, starts, 6)
        })
        .collect();
    let may_jump = |v: &Variant| v.model.facts().friction_limit == FrictionLimit::AtStaticFriction;
    fits.extend(
        variants(data)
            .filter(may_jump)
            .map(|variant| robust_jumps(data, variant)),
    );
    let spread = fits
        .iter()
        .flatten()
        .map(|fit| spread_of(data, fit))
        .fold(f64::INFINITY, f64::min);
    if !spread.is_finite() {
        return None;
    }
    // Many fits share their core; the one that reaches furthest beyond it is the model's.
    let cap = spread * chi2_quantile(FALSE_ALARM / data.rows.len() as f64, 1);
    let cost = |fit: &RobustFit| fit.shares.iter().map(|share| share.min(cap)).sum::<f64>();
    let mut fits: Vec<RobustFit> = fits
        .into_iter()
        .filter_map(|of_a_model| of_a_model.into_iter().min_by(|a, b| cost(a).total_cmp(&cost(b))))
        .collect();
    for fit in &mut fits {
        place_limit(data, fit, cap);
    }
    Some((fits, spread))
}

/// Every model as the bulk of the rows is fitted with it.
fn variants(data: &GroupData) -> impl Iterator<Item = Variant> {
    ModelName::ALL.into_iter().map(|model| Variant {
        model,
        regimes: if model.has_friction_limit() {
            Regimes::Continuous
        } else {
            Regimes::Grip
        },
        free: data.searched(model),
    })
}

impl RobustFit {
    /// Static friction is not below friction.
    fn is_possible(&self) -> bool {
        match self.variant.regimes {
            Regimes::Jump(limit) => friction_share(&self.theta) <= limit,
            _ => true,
        }
    }

    pub fn task<'a>(&self, data: &'a GroupData, chosen: Option<&'a [usize]>) -> Task<'a> {
        Task {
            rows: &data.rows,
            chosen,
            variant: self.variant,
            table_errors: None,
        }
    }
}

fn core_size(rows: usize) -> usize {
    ((CORE * rows as f64).ceil() as usize).clamp(1, rows.max(1))
}

/// Least trimmed squares on the sample, from the best of the starts.
fn robust(data: &GroupData, variant: Variant, starts: Vec<Theta>, followed: usize) -> Vec<RobustFit> {
    let task = Task::of(data, variant, Some(&data.sample));
    let starts = starts::best(&task, starts, CORE, followed);
    starts
        .into_iter()
        .filter_map(|start| concentrate(data, &task, start))
        .map(|(theta, shares)| RobustFit {
            variant,
            theta,
            shares,
        })
        .collect()
}

/// A model that may jump, its limit in one gap between rows after the other.
fn robust_jumps(data: &GroupData, variant: Variant) -> Vec<RobustFit> {
    const GAPS: usize = 20;
    let mut demands: Vec<f64> = data
        .sample
        .iter()
        .map(|&i| friction_demand(&data.rows[i], &[0.0; PARAMETERS]))
        .collect();
    demands.retain(|d| d.is_finite());
    demands.sort_by(f64::total_cmp);
    let gaps: Vec<f64> = demands.windows(2).map(|w| 0.5 * (w[0] + w[1])).collect();
    let step = gaps.len().div_ceil(GAPS).max(1);
    let starts = starts::candidates(data, &data.sample, &variant.free);
    gaps.iter()
        .step_by(step)
        .flat_map(|&gap| robust(data, variant.with(Regimes::Jump(gap)), starts.clone(), 2))
        .filter(RobustFit::is_possible)
        .collect()
}

/// Moves the limit of a jumping model to where the rows around it fit best, gap by gap: every row counts, but none more
/// than `cap`.
fn place_limit(data: &GroupData, fit: &mut RobustFit, cap: f64) {
    const GAPS: usize = 30;
    let Regimes::Jump(mut limit) = fit.variant.regimes else {
        return;
    };
    let mut demands: Vec<(f64, usize)> = data
        .rows
        .iter()
        .enumerate()
        .map(|(i, row)| (friction_demand(row, &fit.theta), i))
        .collect();
    demands.retain(|d| d.0.is_finite());
    demands.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut around = 0..demands.len();
    loop {
        let inside = &demands[around.clone()];
        let step = inside.len().div_ceil(GAPS).max(1);
        let rows: Vec<usize> = inside.iter().map(|d| d.1).collect();
        let cost = |limit: f64| {
            let mut task = fit.task(data, Some(&rows));
            task.variant.regimes = Regimes::Jump(limit);
            shares(&task, &fit.theta)
                .iter()
                .map(|share| share.min(cap))
                .sum::<f64>()
        };
        let best = inside
            .windows(2)
            .enumerate()
            .step_by(step)
            .map(|(place, pair)| (place, 0.5 * (pair[0].0 + pair[1].0)))
            .filter(|(_, gap)| *gap >= friction_share(&fit.theta))
            .chain([(0, limit)])
            .map(|(place, gap)| (cost(gap), place, gap))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, place, gap)) = best else { break };
        limit = gap;
        if step == 1 {
            break;
        }
        let place = if inside.get(place).is_some_and(|d| d.0 <= gap) {
            around.start + place
        } else {
            around.start + inside.partition_point(|d| d.0 <= gap)
        };
        let narrower = place.saturating_sub(2 * step)..(place + 2 * step).min(demands.len());
        if narrower.len() >= around.len() {
            break;
        }
        around = narrower;
    }
    fit.variant.regimes = Regimes::Jump(limit);
}

/// Fits the rows that fit best, takes those that then fit best, and so on until they stay.
fn concentrate(data: &GroupData, task: &Task<'_>, start: Theta) -> Option<(Theta, Vec<f64>)> {
    let mut theta = start;
    let mut before: Vec<usize> = Vec::new();
    for _ in 0..10 {
        let shares = shares(task, &theta);
        let mut order: Vec<usize> = (0..shares.len()).collect();
        order.sort_by(|&a, &b| shares[a].total_cmp(&shares[b]));
        let mut core: Vec<usize> = order[..core_size(order.len())]
            .iter()
            .map(|&i| data.sample[i])
            .collect();
        core.sort_unstable();
        if core == before {
            break;
        }
        let inner = Task {
            chosen: Some(&core),
            ..task.clone()
        };
        theta = inner.search(theta)?.theta;
        before = core;
    }
    Some((theta, shares(task, &theta)))
}

fn shares(task: &Task<'_>, theta: &Theta) -> Vec<f64> {
    task.rows()
        .map(|row| task.nearest(row, theta).map_or(f64::INFINITY, |n| n.chi2))
        .collect()
}

/// By how much the bulk of the rows scatters more than stated (a factor on variances); without deviations, their variance.
fn spread_of(data: &GroupData, fit: &RobustFit) -> f64 {
    let mut sorted: Vec<f64> = data
        .sample
        .iter()
        .zip(&fit.shares)
        .map(|(&i, share)| share / MEDIANS[data.rows[i].equations() - 1])
        .collect();
    sorted.sort_by(f64::total_cmp);
    let median = sorted[sorted.len() / 2];
    match data.weights {
        Weights::Stated => median.max(1.0),
        Weights::Unit => median.max(data.rounding),
    }
}

fn few(data: &GroupData) -> bool {
    data.equations() < HANDFUL
}

fn most_out(data: &GroupData) -> usize {
    let rows = data.rows.len();
    if few(data) {
        rows / 5
    } else {
        (MOST_OUT * rows as f64) as usize
    }
}

/// The rows that lie beyond chance of the robust fit, which is improved on the way; `None` where the model does not
/// describe the bulk of them.
pub(super) fn outlying_rows(data: &GroupData, fit: &mut RobustFit, spread: f64) -> Option<Vec<bool>> {
    let mut out = vec![false; data.rows.len()];
    let mut spread = spread;
    for _ in 0..6 {
        let limit = reach(data, &out, spread, fit);
        let now = beyond(data, fit, limit);
        let count = now.iter().filter(|o| **o).count();
        if count > most_out(data) {
            return None;
        }
        let same = now == out;
        out = now;
        // Of many rows, a sample tells what the bulk does.
        let kept: Vec<usize> = data.sample.iter().copied().filter(|&i| !out[i]).collect();
        let found = fit.task(data, Some(&kept)).search(fit.theta)?;
        fit.theta = found.theta;
        spread = spread_of_kept(data, &kept, &found, fit);
        if data.weights == Weights::Stated && few(data) && spread > 1.0 {
            return None;
        }
        if same {
            break;
        }
    }
    if !fit.is_possible() {
        return None;
    }
    if data.rows.len() <= TRIED {
        take_back(data, fit, &mut out, spread);
    }
    Some(out)
}

/// The rows whose χ² is beyond `limit`, for one equation.
fn beyond(data: &GroupData, fit: &RobustFit, limit: f64) -> Vec<bool> {
    let outside =
        |row: &Observation, near: &NearestMotion| !(near.chi2 <= limit * TAIL_RATIOS[row.equations() - 1]);
    fit.task(data, None)
        .of_nearest(&fit.theta, outside)
        .unwrap_or_else(|| vec![true; data.rows.len()])
}

/// The scatter of the rows that a fit was made on.
fn spread_of_kept(data: &GroupData, kept: &[usize], found: &Minimum, fit: &RobustFit) -> f64 {
    let equations: usize = kept.iter().map(|&i| data.rows[i].equations()).sum();
    let freedom = equations.saturating_sub(fit.variant.free.iter().filter(|f| **f).count());
    criteria::scatter(data, found.chi2, freedom).map_or(f64::INFINITY, |s| s * s)
}

/// χ² of a row from which on it is beyond chance, for one equation.
fn reach(data: &GroupData, out: &[bool], spread: f64, fit: &RobustFit) -> f64 {
    let tail = FALSE_ALARM / data.rows.len() as f64;
    match data.weights {
        Weights::Stated => spread * chi2_quantile(tail, 1),
        Weights::Unit => {
            let kept = data.rows.iter().zip(out).filter(|(_, out)| !**out);
            let equations: usize = kept.map(|(row, _)| row.equations()).sum();
            let parameters = fit.variant.free.iter().filter(|f| **f).count() + 1;
            spread * f_quantile(tail, 1, equations.saturating_sub(parameters))
        }
    }
}

/// Takes rows back one by one, the nearest first, if a fit with them is no worse than chance: a row that alone fixes a
/// parameter is far from a fit that does not know it.
fn take_back(data: &GroupData, fit: &mut RobustFit, out: &mut [bool], spread: f64) {
    loop {
        let kept: Vec<usize> = (0..out.len()).filter(|&i| !out[i]).collect();
        let Some(without) = fit.task(data, Some(&kept)).search(fit.theta) else {
            return;
        };
        fit.theta = without.theta;
        let limit = reach(data, out, spread, fit);
        let nearest = (0..out.len())
            .filter(|&i| out[i])
            .filter_map(|i| {
                let mut with = kept.clone();
                with.insert(with.partition_point(|&k| k < i), i);
                let found = best_with(data, fit, &with, without.theta)?;
                let costs = (found.chi2 - without.chi2) / TAIL_RATIOS[data.rows[i].equations() - 1];
                Some((costs, i, found.theta))
            })
            .min_by(|a, b| a.0.total_cmp(&b.0));
        match nearest {
            Some((costs, i, theta)) if costs <= limit => {
                out[i] = false;
                fit.theta = theta;
            }
            _ => return,
        }
    }
}

/// The fit with a row more, from where it was, and (for few rows) from everywhere.
fn best_with(data: &GroupData, fit: &RobustFit, rows: &[usize], from: Theta) -> Option<Minimum> {
    if rows.len() <= 40 && !matches!(fit.variant.regimes, Regimes::Jump(_)) {
        super::variants::search(data, rows, fit.variant, &[from])
    } else {
        fit.task(data, Some(rows)).search(from)
    }
}
