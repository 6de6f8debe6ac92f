//! Rows that no model can explain.
//!
//! A row is set aside only if it lies beyond chance in *every* model that describes the bulk of the rows, each fitted
//! robustly, the jumping variant of μ-e among them; so a row that merely tells the models apart stays, since the right model
//! explains it. Where no model describes the bulk (two thirds of the rows), none is set aside: then it is the models that
//! fail, and the test of fit says so. Nor is any set aside where those that stick out stand side by side on the same side
//! of the model more than chance would have it: that is a law which the models lack, not a mishap.
//!
//! The robust fit is least trimmed squares (Rousseeuw 1984) over three fifths of the rows, with concentration steps from many
//! starts, then all rows within reach of the fit; each of the others is taken back if the fit with it is no worse than
//! chance.

use super::criteria::{self, MEDIANS, TAIL_RATIOS, chi2_quantile, f_quantile};
use super::data::{Data, demand};
use super::law::{E, E_X, MU, Nearest, PARAMETERS, RATIO, Regimes, State, Theta};
use super::models::Solution;
use super::observation::Observation;
use super::result::ModelName;
use super::search::{Found, Task};
use super::series::{ColumnSet, Series, Weights};
use super::starts;

/// Fewer rows have no bulk that one could stand out from.
const LEAST_ROWS: usize = 5;

/// Part of the rows of the trimmed fit.
const CORE: f64 = 0.6;

/// Of fewer rows than this, a fifth may be set aside, and only if the rest fits as its deviations say: a model with three
/// parameters describes most of a handful of rows even where it is wrong.
const HANDFUL: usize = 15;

/// Part of more rows that may be set aside.
const MOST_OUT: f64 = 1.0 / 3.0;

/// Probability that a good series loses a row.
const FALSE_ALARM: f64 = 0.001;

/// Probability below which rows side by side are no chance.
const SIDE_BY_SIDE: f64 = 0.05;

/// Rows up to which each one that sticks out is tried in the fit.
const TRIED: usize = 200;

/// What was found.
#[derive(Debug, Default)]
pub(super) struct Outliers {
    /// Index into the data, and why.
    pub out: Vec<(usize, String)>,
    /// Indices that stick out but stay, as they stand side by side.
    pub systematic: Vec<usize>,
}

/// A robust fit of one model.
struct Robust {
    name: ModelName,
    regimes: Regimes,
    free: [bool; PARAMETERS],
    theta: Theta,
    /// Share of each row of the sample in χ².
    shares: Vec<f64>,
}

/// Looks for rows that no model explains. `solutions` are the plain fits to all rows.
pub(super) fn find(series: &Series, data: &Data, solutions: &[Solution]) -> Outliers {
    if data.rows.len() < LEAST_ROWS || solutions.iter().any(|s| describes_all(data, s)) {
        return Outliers::default();
    }
    let mut fits: Vec<Vec<Robust>> = variants(data)
        .into_iter()
        .map(|(name, regimes, free)| {
            robust(
                data,
                name,
                regimes,
                free,
                starts::candidates(data, &data.sample, &free),
            )
        })
        .collect();
    fits.push(robust_jumps(data));
    let spread = fits
        .iter()
        .flatten()
        .map(|fit| spread_of(data, fit))
        .fold(f64::INFINITY, f64::min);
    if !spread.is_finite() {
        return Outliers::default();
    }
    // Many fits share their core; the one that reaches furthest beyond it is the model's.
    let cap = spread * chi2_quantile(FALSE_ALARM / data.rows.len() as f64, 1);
    let cost = |fit: &Robust| fit.shares.iter().map(|share| share.min(cap)).sum::<f64>();
    let mut fits: Vec<Robust> = fits
        .into_iter()
        .filter_map(|of_a_model| of_a_model.into_iter().min_by(|a, b| cost(a).total_cmp(&cost(b))))
        .collect();
    for fit in &mut fits {
        place_limit(data, fit, cap);
    }
    let mut described: Vec<(Robust, Vec<bool>)> = Vec::new();
    for mut fit in fits {
        let Some(out) = sticking_out(data, &mut fit, spread) else {
            continue;
        };
        described.push((fit, out));
    }
    let Some((fit, common)) = agreed(described) else {
        return Outliers::default();
    };
    let found: Vec<usize> = (0..data.rows.len()).filter(|&i| common[i]).collect();
    if found.is_empty() {
        return Outliers::default();
    }
    let task = fit.task(data, None);
    if side_by_side(data, &task, &fit.theta, &found) {
        return Outliers {
            out: Vec::new(),
            systematic: found,
        };
    }
    let out = found
        .into_iter()
        .map(|i| (i, reason(series, data, &fit, i, spread)))
        .collect();
    Outliers {
        out,
        systematic: Vec::new(),
    }
}

/// The rows that stick out of every model that describes the bulk, with a model that describes all others. `None` where
/// there is no such model: each then describes the bulk at the cost of rows that another one explains, and the rows are not
/// to blame.
fn agreed(described: Vec<(Robust, Vec<bool>)>) -> Option<(Robust, Vec<bool>)> {
    let rows = described.first()?.1.len();
    let common: Vec<bool> = (0..rows)
        .map(|i| described.iter().all(|(_, out)| out[i]))
        .collect();
    described.into_iter().find(|(_, out)| *out == common)
}

/// Whether a plain fit already describes every row within its stated deviations.
fn describes_all(data: &Data, solution: &Solution) -> bool {
    let freedom = solution.marks.equations.saturating_sub(solution.rank);
    let fits =
        criteria::chi2_tail(solution.found.chi2, freedom).is_none_or(|p| p >= criteria::LEAST_PROBABILITY);
    let limit = chi2_quantile(FALSE_ALARM / data.rows.len() as f64, 1);
    let task = solution.task(data);
    let within = |row: &Observation| {
        let near = task.nearest(row, &solution.found.theta);
        near.is_some_and(|n| n.chi2 <= limit * TAIL_RATIOS[row.equations() - 1])
    };
    data.weights == Weights::Stated && fits && data.rows.iter().all(within)
}

fn variants(data: &Data) -> Vec<(ModelName, Regimes, [bool; PARAMETERS])> {
    let ratio = data.shared_spin;
    vec![
        (ModelName::MuE, Regimes::Continuous, [true, false, true, ratio]),
        (ModelName::EE, Regimes::Grip, [true, true, false, ratio]),
        (
            ModelName::GripSlide,
            Regimes::Continuous,
            [true, true, true, ratio],
        ),
    ]
}

impl Robust {
    /// Static friction is not below friction.
    fn is_possible(&self) -> bool {
        match self.regimes {
            Regimes::Jump(limit) => self.friction_share() <= limit,
            _ => true,
        }
    }

    /// μ (1 + e).
    fn friction_share(&self) -> f64 {
        self.theta[MU] * (1.0 + self.theta[E])
    }

    fn task<'a>(&self, data: &'a Data, chosen: Option<&'a [usize]>) -> Task<'a> {
        Task {
            rows: &data.rows,
            chosen,
            regimes: self.regimes,
            free: self.free,
        }
    }
}

fn core_size(rows: usize) -> usize {
    ((CORE * rows as f64).ceil() as usize).clamp(1, rows.max(1))
}

/// Least trimmed squares on the sample, from the best of the starts.
fn robust(
    data: &Data,
    name: ModelName,
    regimes: Regimes,
    free: [bool; PARAMETERS],
    starts: Vec<Theta>,
) -> Vec<Robust> {
    let task = Task {
        rows: &data.rows,
        chosen: Some(&data.sample),
        regimes,
        free,
    };
    let starts = starts::best(&task, starts, CORE, 6);
    starts
        .into_iter()
        .filter_map(|start| concentrate(data, &task, start))
        .map(|(theta, shares)| Robust {
            name,
            regimes,
            free,
            theta,
            shares,
        })
        .collect()
}

/// The jumping μ-e model, its limit in one gap between rows after the other.
fn robust_jumps(data: &Data) -> Vec<Robust> {
    const GAPS: usize = 20;
    let free = [true, false, true, data.shared_spin];
    let mut demands: Vec<f64> = data
        .sample
        .iter()
        .map(|&i| demand(&data.rows[i], &[0.0; PARAMETERS]))
        .collect();
    demands.retain(|d| d.is_finite());
    demands.sort_by(f64::total_cmp);
    let gaps: Vec<f64> = demands.windows(2).map(|w| 0.5 * (w[0] + w[1])).collect();
    let step = gaps.len().div_ceil(GAPS).max(1);
    let starts = starts::candidates(data, &data.sample, &free);
    gaps.iter()
        .step_by(step)
        .flat_map(|&gap| robust(data, ModelName::MuE, Regimes::Jump(gap), free, starts.clone()))
        .filter(Robust::is_possible)
        .collect()
}

/// Moves the limit of a jumping model to where the rows around it fit best, gap by gap: every row counts, but none more
/// than `cap`.
fn place_limit(data: &Data, fit: &mut Robust, cap: f64) {
    const GAPS: usize = 30;
    let Regimes::Jump(mut limit) = fit.regimes else {
        return;
    };
    let mut demands: Vec<(f64, usize)> = data
        .rows
        .iter()
        .enumerate()
        .map(|(i, row)| (demand(row, &fit.theta), i))
        .collect();
    demands.retain(|d| d.0.is_finite());
    demands.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut around = 0..demands.len();
    loop {
        let inside = &demands[around.clone()];
        let step = inside.len().div_ceil(GAPS).max(1);
        let rows: Vec<usize> = inside.iter().map(|d| d.1).collect();
        let cost = |limit: f64| {
            let task = Task {
                regimes: Regimes::Jump(limit),
                ..fit.task(data, Some(&rows))
            };
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
            .filter(|(_, gap)| *gap >= fit.friction_share())
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
    fit.regimes = Regimes::Jump(limit);
}

/// Fits the rows that fit best, takes those that then fit best, and so on until they stay.
fn concentrate(data: &Data, task: &Task<'_>, start: Theta) -> Option<(Theta, Vec<f64>)> {
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
fn spread_of(data: &Data, fit: &Robust) -> f64 {
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

fn few(data: &Data) -> bool {
    data.rows.len() < HANDFUL
}

fn most_out(rows: usize) -> usize {
    if rows < HANDFUL {
        rows / 5
    } else {
        (MOST_OUT * rows as f64) as usize
    }
}

/// The rows that lie beyond chance of the robust fit, which is improved on the way; `None` where the model does not
/// describe the bulk of them.
fn sticking_out(data: &Data, fit: &mut Robust, spread: f64) -> Option<Vec<bool>> {
    let all: Vec<usize> = (0..data.rows.len()).collect();
    let mut out = vec![false; data.rows.len()];
    let mut spread = spread;
    for _ in 0..6 {
        let task = fit.task(data, None);
        let limit = reach(data, &out, spread, fit);
        let now: Vec<bool> = shares(&task, &fit.theta)
            .iter()
            .zip(&data.rows)
            .map(|(share, row)| !(*share <= limit * TAIL_RATIOS[row.equations() - 1]))
            .collect();
        let count = now.iter().filter(|o| **o).count();
        if count > most_out(now.len()) {
            return None;
        }
        let same = now == out;
        out = now;
        let kept: Vec<usize> = all.iter().copied().filter(|&i| !out[i]).collect();
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

/// The scatter of the rows that a fit was made on.
fn spread_of_kept(data: &Data, kept: &[usize], found: &Found, fit: &Robust) -> f64 {
    let equations: usize = kept.iter().map(|&i| data.rows[i].equations()).sum();
    let freedom = equations.saturating_sub(fit.free.iter().filter(|f| **f).count());
    criteria::scatter(data, found.chi2, freedom).map_or(f64::INFINITY, |s| s * s)
}

/// χ² of a row from which on it is beyond chance, for one equation.
fn reach(data: &Data, out: &[bool], spread: f64, fit: &Robust) -> f64 {
    let tail = FALSE_ALARM / data.rows.len() as f64;
    match data.weights {
        Weights::Stated => spread * chi2_quantile(tail, 1),
        Weights::Unit => {
            let kept = data.rows.iter().zip(out).filter(|(_, out)| !**out);
            let equations: usize = kept.map(|(row, _)| row.equations()).sum();
            let parameters = fit.free.iter().filter(|f| **f).count() + 1;
            spread * f_quantile(tail, 1, equations.saturating_sub(parameters))
        }
    }
}

/// Takes rows back one by one, the nearest first, if a fit with them is no worse than chance: a row that alone fixes a
/// parameter is far from a fit that does not know it.
fn take_back(data: &Data, fit: &mut Robust, out: &mut [bool], spread: f64) {
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
fn best_with(data: &Data, fit: &Robust, rows: &[usize], from: Theta) -> Option<Found> {
    if rows.len() <= 40 && !matches!(fit.regimes, Regimes::Jump(_)) {
        super::models::search(data, rows, fit.regimes, fit.free, &[from])
    } else {
        fit.task(data, Some(rows)).search(from)
    }
}

/// Which equation a row violates most, and to which side.
fn side(near: &Nearest) -> (usize, bool) {
    // The edge is no measured quantity; it comes last.
    let measured = near.equations - usize::from(near.state.on_edge());
    let largest = (0..measured)
        .max_by(|&a, &b| near.residuals[a].abs().total_cmp(&near.residuals[b].abs()))
        .unwrap_or(0);
    (largest, near.residuals[largest] > 0.0)
}

/// Whether the rows at `found` stand next to each other in incidence, off to the same side, more often than chance.
fn side_by_side(data: &Data, task: &Task<'_>, theta: &Theta, found: &[usize]) -> bool {
    if found.len() < 2 {
        return false;
    }
    let mut order: Vec<(f64, usize)> = (0..data.rows.len())
        .map(|i| (demand(&data.rows[i], theta), i))
        .collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let sides: Vec<(usize, Option<(usize, bool)>)> = order
        .iter()
        .enumerate()
        .filter(|(_, (_, i))| found.binary_search(i).is_ok())
        .map(|(place, &(_, i))| (place, task.nearest(&data.rows[i], theta).as_ref().map(side)))
        .collect();
    let neighbours = |places: &[usize], sides: &[Option<(usize, bool)>]| {
        let pairs = places.windows(2).zip(sides.windows(2));
        pairs
            .filter(|(p, s)| p[1] == p[0] + 1 && s[0].is_some() && s[0] == s[1])
            .count()
    };
    let places: Vec<usize> = sides.iter().map(|s| s.0).collect();
    let mut tags: Vec<Option<(usize, bool)>> = sides.iter().map(|s| s.1).collect();
    let seen = neighbours(&places, &tags);
    if seen == 0 {
        return false;
    }
    // The same rows dealt out at random, many times: of many rows fewer times tell as much.
    let times = (200_000 / found.len()).clamp(20, 2000);
    let mut deal = Deal(0x9e37_79b9_7f4a_7c15);
    let mut as_many = 0;
    for _ in 0..times {
        let places = deal.places(found.len(), data.rows.len());
        deal.shuffle(&mut tags);
        as_many += usize::from(neighbours(&places, &tags) >= seen);
    }
    (as_many as f64) < SIDE_BY_SIDE * times as f64
}

/// Random places and orders, the same every time (Marsaglia's xorshift).
struct Deal(u64);

impl Deal {
    fn below(&mut self, limit: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as usize % limit.max(1)
    }

    /// So many different places, ascending (Floyd's way).
    fn places(&mut self, count: usize, of: usize) -> Vec<usize> {
        let mut chosen = std::collections::BTreeSet::new();
        for top in of - count..of {
            let place = self.below(top + 1);
            if !chosen.insert(place) {
                chosen.insert(top);
            }
        }
        chosen.into_iter().collect()
    }

    fn shuffle<T>(&mut self, items: &mut [T]) {
        for i in (1..items.len()).rev() {
            items.swap(i, self.below(i + 1));
        }
    }
}

/// Why the row at `index` is set aside, with numbers.
fn reason(series: &Series, data: &Data, fit: &Robust, index: usize, spread: f64) -> String {
    let row = &data.rows[index];
    let task = fit.task(data, None);
    let Some(near) = task.nearest(row, &fit.theta) else {
        return "no model gives its numbers".to_owned();
    };
    let far = (near.chi2 / spread).sqrt();
    let others = match data.weights {
        Weights::Stated => {
            format!("it lies {far:.1} standard deviations from every model that describes the other rows")
        }
        Weights::Unit => format!(
            "it lies {far:.1} times the scatter of the other rows from every model that describes them"
        ),
    };
    let (equation, _) = side(&near);
    match expected(series, row, &near, &fit.theta, equation) {
        Some(text) => format!("{others}: {text} by {}", fit.name.name()),
        None => others,
    }
}

/// What was measured, and what the model expects for the measured incidence.
fn expected(
    series: &Series,
    row: &Observation,
    near: &Nearest,
    theta: &Theta,
    equation: usize,
) -> Option<String> {
    let e = theta[E];
    let k = row.kinematics(&row.z, theta[RATIO]);
    let slip = k.a - k.w;
    let impulse = if matches!(near.state, State::Slide | State::SlideEdge) {
        slip.signum() * theta[MU] * (1.0 + e) * k.b
    } else {
        row.slip_share * (1.0 + theta[E_X]) * slip
    };
    let after = k.a - impulse;
    let (name, unit, measured, expected) = match (series.set, equation) {
        (ColumnSet::Velocities, 0) => ("rebound_vz_m_s", "m/s", row.z[3], e * k.b),
        (ColumnSet::Velocities, 1) => ("rebound_vx_m_s", "m/s", row.z[2], after),
        (ColumnSet::Velocities, _) => (
            "spin_out_m_s",
            "m/s",
            row.z[5],
            k.w + impulse / row.inertia_factor,
        ),
        (ColumnSet::Angles, _) => (
            "rebound_angle_deg",
            "degrees",
            row.z[1].to_degrees(),
            after.atan2(e * k.b).to_degrees(),
        ),
        (ColumnSet::Distances, _) => ("x_m", "m", row.z[1], 2.0 * e * row.z[0] / row.z[2] * after),
    };
    expected
        .is_finite()
        .then(|| format!("{name} is {measured:.4} {unit}, expected {expected:.4}"))
}
