//! The models fitted to the rows of a group, each in the variant that the rows ask for. Which there are follows from how
//! friction ends grip in the model:
//!
//! | limit of friction | e.g. | variants, from the simplest |
//! |---|---|---|
//! | at static friction | μ-e | all rows leave rolling (e); some slide, μ_o = μ (e, μ); the outcome jumps (e, μ, μ_o) |
//! | never | e-e, compliant | one law (e, e_x; e, μ, κ) |
//! | at friction | grip-slide | all rows grip (e, e_x); all slide (e, μ); some do either (e, e_x, μ) |
//!
//! A larger variant has to earn its parameter. That some rows slide, or grip, has to show ([`SHOWS`]): otherwise the row
//! nearest to the limit would give a coefficient made of its own noise. And rows whose slip before the bounce is nothing but error (a ball that rolls
//! already) tell neither friction nor e_x.

use super::criteria::{self, InformationCriteria, chi2_quantile};
use super::group_data::{GroupData, friction_demand};
use super::observation::Observation;
use super::row_law::{
    E, E_X, KAPPA, MU, PARAMETERS, RATIO, Regimes, Theta, Variant, WITHOUT_LIMIT, friction_share,
};
use super::search::{Minimum, Task, distinct};
use super::series::{ColumnSet, Weights};
use super::springs_of_rows;
use super::starts::{self, FOLLOWED};
use super::stuck_contact;
use super::transition::Profile;
use crate::numeric::robust::median;
use crate::rebound::model::FrictionLimit;
use crate::rebound::{ModelName, Parameter};
use std::sync::Arc;

/// By how much AICc has to fall for another regime to be believed: χ² falls by 10.8 then, which chance does in one of a thousand
/// series.
const SHOWS: f64 = 8.8;

/// By how much AICc has to fall for a jump to be believed; χ² falls by 8 then. The interval of static friction allows for
/// one in any case.
const JUMPS: f64 = 6.0;

/// Deviations of a row that a jump has to exceed to be one: less is as well a transition that is a little rounded, or
/// deviations a little wrong, which very many rows show.
const SEEN: f64 = 1.0;

/// Probability that rows without slip seem to have some.
const NO_SLIP: f64 = 0.001;

/// Standard deviations by which e_x from 0 to 1 has to move the rebounds, all rows together, for slip to tell anything.
const TELLING: f64 = 2.0;

/// χ² of equations that are fulfilled: what a search leaves of them.
const FULFILLED: f64 = 1e-6;

/// A model in one variant at its best.
#[derive(Debug, Clone)]
pub(super) struct Solution {
    pub variant: Variant,
    pub best: Minimum,
    /// Other local minima of χ²: the same model with a row more or less that slides, or in another valley of a law that bends.
    pub local_minima: Vec<Minimum>,
    pub determined: [bool; PARAMETERS],
    /// Independent combinations of the parameters that the rows determine.
    pub rank: usize,
    /// Whether any row is seen to slip before the bounce.
    pub slips: bool,
    /// μ-e with every row rolling off, where every row sliding would do as well: e is one number then or another.
    pub one_incidence: bool,
    pub criteria: InformationCriteria,
    /// What the model's table has e_x too large by, by the rows' index in the series; `None` of a model without, and where it is not known.
    pub table_errors: Option<Arc<[f64]>>,
}

impl Solution {
    fn new(data: &GroupData, variant: Variant, best: Minimum) -> Self {
        let task = Task::of(
            data,
            variant,
            (data.sample.len() < data.rows.len()).then_some(&data.sample),
        );
        let (determined, rank) = task.unit_r_factor(&best.theta).determined(&variant.free);
        let limit = usize::from(matches!(variant.regimes, Regimes::Jump(_)));
        Self {
            variant,
            determined,
            rank,
            criteria: InformationCriteria::new(data, best.chi2, rank + limit, 1.0),
            local_minima: Vec::new(),
            slips: true,
            one_incidence: false,
            table_errors: None,
            best,
        }
    }

    /// Which model.
    pub fn name(&self) -> ModelName {
        self.variant.model
    }

    /// Whether the search moved a parameter.
    pub fn is_free(&self, parameter: usize) -> bool {
        self.variant.free[parameter]
    }

    /// The same numbers as those of another model, which says the same of these rows.
    fn as_model(&self, model: ModelName) -> Self {
        let mut same = self.clone();
        same.variant.model = model;
        same.best.theta = self.as_special_case();
        same
    }

    /// The same as a model says it that also has friction, or gives way sideways, which this one does not: as much as it takes.
    fn as_special_case(&self) -> Theta {
        let mut theta = self.best.theta;
        for (j, value) in theta.iter_mut().enumerate() {
            if matches!(j, MU | KAPPA) && !self.is_free(j) && *value == 0.0 {
                *value = WITHOUT_LIMIT;
            }
        }
        theta
    }

    /// Degrees of freedom that it leaves the rows.
    pub fn freedom(&self) -> usize {
        let parameters = self.rank + usize::from(self.jump().is_some());
        self.criteria.equations.saturating_sub(parameters)
    }

    /// What standard uncertainties are multiplied by; `None` where the rows leave no scatter to tell it from.
    pub fn scatter(&self, data: &GroupData) -> Option<f64> {
        criteria::scatter(data, self.best.chi2, self.freedom())
    }

    /// Λ where the model jumps.
    pub fn jump(&self) -> Option<f64> {
        match self.variant.regimes {
            Regimes::Jump(limit) => Some(limit),
            _ => None,
        }
    }

    /// The same at the minimum that the model has where its table has no errors.
    fn settled_on_springs(mut self, data: &GroupData) -> Self {
        let found = springs_of_rows::settled(&self.task(data), self.best, &self.determined);
        if let Some((best, errors)) = found {
            self.best = best;
            self.table_errors = Some(errors.into());
            self.criteria = InformationCriteria::new(data, best.chi2, self.criteria.parameters, 1.0);
        }
        self
    }

    /// The search's own terms, on all rows.
    pub fn task<'a>(&'a self, data: &'a GroupData) -> Task<'a> {
        Task {
            table_errors: self.table_errors.as_deref(),
            ..Task::of(data, self.variant, None)
        }
    }
}

/// A model in the variant with these parameters of its own; `mu` goes with rows that slide.
fn variant(data: &GroupData, model: ModelName, regimes: Regimes, mu: bool) -> Variant {
    let mut free = data.searched(model);
    free[MU] &= mu;
    Variant { model, regimes, free }
}

/// A model with every row below the limit of friction.
fn gripping(data: &GroupData, model: ModelName) -> Variant {
    // Where friction limits nothing, it is a parameter of the model's one law, if it has any.
    variant(data, model, Regimes::Grip, !model.has_friction_limit())
}

/// A model with every row sliding, whether or not it can: no tangential restitution shows then.
fn sliding(data: &GroupData, model: ModelName) -> Variant {
    let mut slide = variant(data, model, Regimes::Slide, true);
    slide.free[E_X] = false;
    slide
}

/// All models, in the order of the results; a model that cannot be fitted is left out.
pub(super) fn all(data: &GroupData) -> Vec<Solution> {
    of_models(data, &ModelName::ALL)
}

/// As [`all`], of some models: with each the special cases that it is fitted from.
pub(super) fn of_models(data: &GroupData, names: &[ModelName]) -> Vec<Solution> {
    let rolling = solve(data, rolling(data), &[]);
    if let Some(rolling) = rolling.as_ref().filter(|rolling| !slips(data, rolling)) {
        let as_model = |&name| Solution {
            slips: false,
            ..rolling.as_model(name)
        };
        return names.iter().map(as_model).collect();
    }
    let mut solutions: Vec<Solution> = Vec::new();
    for &name in names {
        let solution = match name.facts().friction_limit {
            FrictionLimit::Never => {
                let from: Vec<Theta> = solutions
                    .iter()
                    .filter(|s| name.special_cases().any(|case| case == s.name()))
                    .map(Solution::as_special_case)
                    .collect();
                let solution = solve(data, gripping(data, name), &from);
                solution.map(|solution| solution.settled_on_springs(data))
            }
            FrictionLimit::AtFriction => with_limit(data, name, &solutions),
            FrictionLimit::AtStaticFriction => {
                with_jump(data, name, rolling.as_ref().map(|r| r.as_model(name)))
            }
        };
        solutions.extend(solution);
    }
    solutions
}

/// Every row leaves rolling: what all models say where there is no slip.
fn rolling(data: &GroupData) -> Variant {
    let mut rolling = gripping(data, ModelName::ALL[0]);
    rolling.free = [false; PARAMETERS];
    rolling.free[E] = true;
    rolling.free[RATIO] = data.shared_spin;
    rolling
}

/// Whether the balls are seen to slip before the bounce.
fn slips(data: &GroupData, rolling: &Solution) -> bool {
    let spread = match data.weights {
        Weights::Stated => 1.0,
        Weights::Unit => {
            let freedom = rolling.criteria.equations.saturating_sub(rolling.rank);
            (rolling.best.chi2 / freedom.max(1) as f64).max(data.rounding)
        }
    };
    // Slip that is known well, but too small to move the rebound, tells nothing either.
    let mut with_e_x = rolling.task(data);
    with_e_x.variant.free[E_X] = true;
    let moves = with_e_x
        .linear(&rolling.best.theta)
        .map_or(0.0, |l| l.r_factor.lengths()[E_X]);
    if !(moves > TELLING * spread.sqrt()) {
        return false;
    }
    let (mut chi2, mut rows) = (0.0, 0);
    for row in &data.rows {
        let (slip, variance) = row.slip(rolling.best.theta[RATIO]);
        if slip == 0.0 {
            continue;
        }
        chi2 += slip * slip / (variance * spread).max(f64::MIN_POSITIVE);
        rows += 1;
    }
    rows > 0 && chi2 > chi2_quantile(NO_SLIP, rows)
}

/// A model whose outcome may jump at the limit of static friction; `rolling` is its fit with every row below that.
fn with_jump(data: &GroupData, name: ModelName, rolling: Option<Solution>) -> Option<Solution> {
    let continuous = variant(data, name, Regimes::Continuous, true);
    let jumping = |limit: f64| continuous.with(Regimes::Jump(limit));
    let from: Vec<Theta> = rolling.iter().map(|r| r.best.theta).collect();
    let sliding = solve(data, continuous, &from);
    let (Some(rolling), Some(sliding)) = (&rolling, &sliding) else {
        return sliding.or(rolling);
    };
    let spread = sliding.scatter(data).unwrap_or(0.0).powi(2);
    let averaged = |solution: &Solution| {
        let chi2 = solution.task(data).averaged(&solution.best.theta, spread);
        let limit = usize::from(solution.jump().is_some());
        InformationCriteria::new(data, chi2, solution.rank + limit, 1.0)
    };
    let without = averaged(sliding);
    let jump = Profile::new(data, continuous, sliding.best.theta, spread)
        .best(friction_share(&sliding.best.theta), 0.5 * JUMPS)
        .map(|(limit, found)| Solution::new(data, jumping(limit), found))
        // A friction above the limit is the continuous model, pinned.
        .filter(|s| s.jump() > Some(friction_share(&s.best.theta)))
        .filter(|s| averaged(s).gain_over(&without, data.weights) > JUMPS)
        .filter(|s| jump_in_deviations(data, s).is_some_and(|jump| jump > SEEN * spread.sqrt()));
    let larger = jump.unwrap_or_else(|| sliding.clone());
    // A spin that is fitted makes any single row one that grips; that has to show, too.
    let throughout = data
        .shared_spin
        .then(|| solve(data, self::sliding(data, name), &[sliding.best.theta]))
        .flatten()
        .filter(|slide| !(larger.criteria.gain_over(&slide.criteria, data.weights) > SHOWS));
    let larger = throughout.unwrap_or(larger);
    Some(if shows(data, rolling, &larger) {
        larger
    } else if may_slide(data, name, rolling) {
        let mut rolling = rolling.clone();
        rolling.determined[E] = false;
        rolling.one_incidence = true;
        rolling
    } else {
        rolling.clone()
    })
}

/// Whether rows that all seem to roll off may as well all slide, as one incidence has it: tan φ or x holds e with the regime
/// only, and any e goes with some μ. (Velocities hold e by themselves.) Rows at several incidences that lie on the line of
/// rolling do not lie on one of sliding by chance.
fn may_slide(data: &GroupData, name: ModelName, rolling: &Solution) -> bool {
    let by_itself = |row: &Observation| row.set == ColumnSet::Velocities;
    if !rolling.determined[E] || data.rows.first().is_none_or(by_itself) {
        return false;
    }
    // Rows from θ to 2θ leave e under sliding, a slope beside an intercept, 5 times as uncertain as under rolling; from θ to
    // 1.4 θ this many times.
    const LEVER: f64 = 10.0;
    let Some(sliding) = sliding_throughout(data, name) else {
        return false;
    };
    if rolling.criteria.gain_over(&sliding.criteria, data.weights) > SHOWS {
        return false;
    }
    let variance = |of: &Solution| {
        let r_factor = &of.best.r_factor;
        r_factor.covariance(&of.determined, &of.variant.free, of.rank)[(E, E)]
    };
    let vague = variance(&sliding);
    !sliding.determined[E]
        || vague > LEVER.powi(2) * variance(rolling)
        || vague * sliding.scatter(data).unwrap_or(0.0).powi(2) > Parameter::Restitution.vague_std().powi(2)
}

/// By how many deviations of a row the outcome jumps, from the rows that slide next to the limit; `None` where none slides.
fn jump_in_deviations(data: &GroupData, solution: &Solution) -> Option<f64> {
    const NEXT: usize = 5;
    let theta = &solution.best.theta;
    let jump = solution.jump()? / (1.0 + theta[E]) - theta[MU];
    let task = solution.task(data);
    let sliding = task.of_nearest(theta, |row, near| {
        near.state.slides().then(|| {
            let by_friction = near.jacobian[..near.equations]
                .iter()
                .map(|line| line[MU].powi(2));
            (friction_demand(row, theta), by_friction.sum::<f64>().sqrt())
        })
    })?;
    let mut rows: Vec<(f64, f64)> = sliding.into_iter().flatten().collect();
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut next: Vec<f64> = rows.iter().take(NEXT).map(|row| row.1 * jump).collect();
    median(&mut next)
}

/// A model whose outcome is continuous at the limit of friction; `before` are those of its special cases that are fitted.
fn with_limit(data: &GroupData, name: ModelName, before: &[Solution]) -> Option<Solution> {
    // That of its special cases that knows no limit is the same with every row below it.
    let unlimited = before
        .iter()
        .find(|s| name.special_cases().any(|case| case == s.name()) && !s.name().has_friction_limit());
    let from: Vec<Theta> = unlimited.iter().map(|s| s.best.theta).collect();
    let both = solve(data, variant(data, name, Regimes::Continuous, true), &from);
    let throughout = worth_all_rows(data, name, unlimited)
        .then(|| solve(data, sliding(data, name), &[]))
        .flatten();
    // Of two as good the one that has no limit to be beyond.
    let simple = unlimited
        .map(|s| s.as_model(name))
        .into_iter()
        .chain(throughout)
        .reduce(|grips, slides| {
            if slides.criteria.gain_over(&grips.criteria, data.weights) > 0.0 {
                slides
            } else {
                grips
            }
        });
    let (Some(simple), Some(both)) = (&simple, &both) else {
        return both.or(simple);
    };
    Some(if shows(data, simple, both) {
        both.clone()
    } else {
        simple.clone()
    })
}

/// Whether sliding throughout may fit better than `unlimited`, as a sample of many rows has it.
fn worth_all_rows(data: &GroupData, name: ModelName, unlimited: Option<&Solution>) -> bool {
    // Half as much again is no chance in a sample of hundreds.
    const HOPELESS: f64 = 1.5;
    let (Some(unlimited), true) = (unlimited, data.sample.len() < data.rows.len()) else {
        return true;
    };
    let sample = Task {
        chosen: Some(&data.sample),
        ..unlimited.task(data)
    };
    search(data, &data.sample, sliding(data, name), &[])
        .is_some_and(|slide| slide.chi2 < HOPELESS * sample.chi2(&unlimited.best.theta))
}

/// Whether the rows show that some slide.
fn shows(data: &GroupData, without: &Solution, with: &Solution) -> bool {
    slides(data, with) && with.criteria.gain_over(&without.criteria, data.weights) > SHOWS
}

/// Whether some row slides.
fn slides(data: &GroupData, solution: &Solution) -> bool {
    let task = solution.task(data);
    let theta = &solution.best.theta;
    task.rows()
        .any(|row| task.nearest(row, theta).is_some_and(|n| n.state.slides()))
}

fn solve(data: &GroupData, variant: Variant, from: &[Theta]) -> Option<Solution> {
    let mut found = minima(data, &data.sample, variant, from);
    if data.sample.len() < data.rows.len() {
        let all = Task::of(data, variant, None);
        found.truncate(within_reach(data, &found));
        found = distinct(found.iter().filter_map(|m| all.search(m.theta)).collect());
    }
    let mut found = found.into_iter();
    let lowest = with_the_slip(data, variant, found.next()?);
    let mut solution = Solution::new(data, variant, lowest);
    solution.local_minima = found.collect();
    through_the_order(data, &mut solution);
    Some(solution)
}

/// How many of the sample's minima, which come from the lowest up, may be the lowest of all rows or near it. What lies this far
/// above the lowest lies further above it with every row more, and to search it there may take a hundred times through all.
fn within_reach(data: &GroupData, found: &[Minimum]) -> usize {
    // If D is what two minima differ by but for chance, they differ by D ± 2 √D: 30 is D = 10 with 3 deviations to spare.
    const OUT_OF_REACH: f64 = 30.0;
    let Some(lowest) = found.first().map(|m| m.chi2) else {
        return 0;
    };
    let equations: usize = data.sample.iter().map(|&i| data.rows[i].equations()).sum();
    let mean = lowest / equations.max(1) as f64;
    let spread = match data.weights {
        Weights::Stated => mean.max(1.0),
        Weights::Unit => mean.max(data.rounding),
    };
    found.partition_point(|m| m.chi2 <= lowest + OUT_OF_REACH * spread)
}

/// Sliding forwards under a friction that pushes is sliding backwards under one that holds: where the spin is fitted, the
/// slip's direction is that of friction.
fn with_the_slip(data: &GroupData, variant: Variant, found: Minimum) -> Minimum {
    const AS_GOOD: f64 = 1e-6;
    if !(variant.free[RATIO] && variant.free[MU] && found.theta[MU] < 0.0) {
        return found;
    }
    let mut mirrored = found.theta;
    mirrored[MU] = -found.theta[MU];
    mirrored[RATIO] = 2.0 - found.theta[RATIO];
    let task = Task::of(data, variant, None);
    task.search(mirrored)
        .filter(|other| other.chi2 <= found.chi2 + AS_GOOD * (1.0 + found.chi2))
        .unwrap_or(found)
}

/// More rows than this: one of them on another side moves nothing.
pub(super) const FEW: usize = 150;

/// Rows beside the transition that are tried on its other side.
const BESIDE: usize = 3;

/// Goes through the ways to part the rows near the transition. Each leads to a local minimum of its own; the lowest becomes the
/// solution, the others are kept.
fn through_the_order(data: &GroupData, solution: &mut Solution) {
    if solution.variant.regimes != Regimes::Continuous || data.rows.len() > FEW {
        return;
    }
    let task = solution.task(data);
    let theta = solution.best.theta;
    let mut order: Vec<(f64, bool)> = data
        .rows
        .iter()
        .map(|row| {
            let slides = task.nearest(row, &theta).is_some_and(|n| n.state.slides());
            (friction_demand(row, &theta), slides)
        })
        .collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let gripping = order.iter().filter(|(_, slides)| !slides).count();
    let mut minima = vec![solution.best];
    for below in gripping.saturating_sub(BESIDE)..=(gripping + BESIDE).min(order.len()) {
        let limit = match below {
            0 => 0.5 * order[0].0,
            _ if below == order.len() => 2.0 * order[below - 1].0,
            _ => 0.5 * (order[below - 1].0 + order[below].0),
        };
        let mut parted = task.clone();
        parted.variant.regimes = Regimes::Jump(limit * (1.0 + theta[E_X]));
        let minimum = parted.search(theta).and_then(|parted| task.search(parted.theta));
        let is_new = |found: &Minimum| {
            minima
                .iter()
                .all(|v| (v.chi2 - found.chi2).abs() > 1e-6 * (1e-3 + found.chi2))
        };
        if let Some(found) = minimum.filter(is_new) {
            minima.push(found);
        }
    }
    minima.sort_by(|a, b| a.chi2.total_cmp(&b.chi2));
    let lowest = minima.remove(0);
    *solution = Solution {
        local_minima: minima,
        ..Solution::new(data, solution.variant, lowest)
    };
}

/// The least χ² of the `chosen` rows from many starts.
pub(super) fn search(
    data: &GroupData,
    chosen: &[usize],
    variant: Variant,
    from: &[Theta],
) -> Option<Minimum> {
    minima(data, chosen, variant, from).into_iter().next()
}

/// The least χ² of the `chosen` rows from many starts; after it, for a law that bends, its other local minima.
fn minima(data: &GroupData, chosen: &[usize], variant: Variant, from: &[Theta]) -> Vec<Minimum> {
    let task = Task::of(data, variant, Some(chosen));
    let mut starts = starts::candidates(data, chosen, &variant.free);
    starts.extend(from);
    let bends = !variant.model.model().grip_is_linear();
    // Where e stands in no column of its own, a law that bends has more valleys.
    let velocities = data
        .rows
        .first()
        .is_none_or(|row| row.set == ColumnSet::Velocities);
    let followed = if bends && !velocities {
        3 * FOLLOWED
    } else {
        FOLLOWED
    };
    // Fewer equations than parameters: a whole curve fulfils them, and one place on it says as much as any.
    let equations: usize = chosen.iter().map(|&i| data.rows[i].equations()).sum();
    let any_will_do = equations < variant.free.iter().filter(|free| **free).count();
    let mut found = Vec::new();
    for start in starts::best(&task, starts, 1.0, followed) {
        match task.search(start) {
            Some(minimum) if any_will_do && minimum.chi2 < FULFILLED => return vec![minimum],
            minimum => found.extend(minimum),
        }
    }
    if bends && variant.free[MU] {
        // Searches that went for a friction without limit come to no end; that valley is gone through by itself.
        found.retain(|minimum| minimum.converged);
        found.extend(stuck_contact::minima(data, chosen, variant));
    }
    let mut found = distinct(found);
    if !bends {
        found.truncate(1);
    }
    found
}

/// A model with every row sliding, whether or not it can.
pub(super) fn sliding_throughout(data: &GroupData, model: ModelName) -> Option<Solution> {
    solve(data, sliding(data, model), &[])
}
