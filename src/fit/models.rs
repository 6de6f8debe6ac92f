//! The three models fitted to the rows of a group, each in the variant that the rows ask for.
//!
//! | model | variants, from the simplest |
//! |---|---|
//! | μ-e | all rows leave rolling (e); some slide, μ_o = μ (e, μ); the outcome jumps (e, μ, μ_o) |
//! | e-e | (e, e_x) |
//! | grip-slide | all rows grip (e, e_x); some slide (e, e_x, μ) |
//!
//! A larger variant has to earn its parameter. Sliding has to show ([`SHOWS`]): otherwise the row nearest to the limit would
//! give a friction made of its own noise. And rows whose slip before the bounce is nothing but error (a ball that rolls
//! already) tell neither friction nor e_x.

use super::criteria::{Marks, chi2_quantile};
use super::data::{Data, demand};
use super::law::{E, E_X, MU, PARAMETERS, RATIO, Regimes, Theta};
use super::result::ModelName;
use super::search::{Found, Task};
use super::series::Weights;
use super::starts;
use super::transition::Profile;

/// By how much AICc has to fall for sliding to be believed: χ² falls by 10.8 then, which chance does in one of a thousand
/// series.
const SHOWS: f64 = 8.8;

/// By how much AICc has to fall for a jump to be believed; χ² falls by 8 then. The interval of static friction allows for
/// one in any case.
const JUMPS: f64 = 6.0;

/// Probability that rows without slip seem to have some.
const NO_SLIP: f64 = 0.001;

/// Starts that are followed to their end.
pub(super) const FOLLOWED: usize = 8;

/// A model in one variant at its best.
#[derive(Debug, Clone)]
pub(super) struct Solution {
    pub name: ModelName,
    pub regimes: Regimes,
    pub free: [bool; PARAMETERS],
    pub found: Found,
    /// Other valleys of χ², not much higher: the same model with a row more or less that slides.
    pub valleys: Vec<Found>,
    pub determined: [bool; PARAMETERS],
    /// Independent combinations of the parameters that the rows determine.
    pub rank: usize,
    /// Whether any row is seen to slip before the bounce.
    pub slips: bool,
    pub marks: Marks,
}

impl Solution {
    fn new(data: &Data, name: ModelName, regimes: Regimes, free: [bool; PARAMETERS], found: Found) -> Self {
        let task = Task {
            rows: &data.rows,
            chosen: (data.sample.len() < data.rows.len()).then_some(&data.sample),
            regimes,
            free,
        };
        let (determined, rank) = task.unit_triangle(&found.theta).determined(&free);
        let limit = usize::from(matches!(regimes, Regimes::Jump(_)));
        Self {
            name,
            regimes,
            free,
            determined,
            rank,
            marks: Marks::new(data, found.chi2, rank + limit, 1.0),
            valleys: Vec::new(),
            slips: true,
            found,
        }
    }

    /// Λ where the model jumps.
    pub fn jump(&self) -> Option<f64> {
        match self.regimes {
            Regimes::Jump(limit) => Some(limit),
            _ => None,
        }
    }

    /// The search's own terms, on all rows.
    pub fn task<'a>(&self, data: &'a Data) -> Task<'a> {
        Task {
            rows: &data.rows,
            chosen: None,
            regimes: self.regimes,
            free: self.free,
        }
    }
}

/// The parameters of a variant.
fn free(data: &Data, e_x: bool, mu: bool) -> [bool; PARAMETERS] {
    let mut free = [false; PARAMETERS];
    free[E] = true;
    free[E_X] = e_x;
    free[MU] = mu;
    free[RATIO] = data.shared_spin;
    free
}

/// All models, in the order of the results; a model that cannot be fitted is left out.
pub(super) fn all(data: &Data) -> Vec<Solution> {
    let rolling = solve(data, ModelName::MuE, Regimes::Grip, free(data, false, false), &[]);
    if let Some(rolling) = rolling.as_ref().filter(|rolling| !slips(data, rolling)) {
        let as_model = |name| Solution {
            name,
            slips: false,
            ..rolling.clone()
        };
        return ModelName::ALL.map(as_model).to_vec();
    }
    let e_e = solve(data, ModelName::EE, Regimes::Grip, free(data, true, false), &[]);
    let grip_slide = grip_slide(data, e_e.as_ref());
    [mu_e(data, rolling), e_e, grip_slide]
        .into_iter()
        .flatten()
        .collect()
}

/// Whether the balls are seen to slip before the bounce.
fn slips(data: &Data, rolling: &Solution) -> bool {
    let spread = match data.weights {
        Weights::Stated => 1.0,
        Weights::Unit => {
            let freedom = rolling.marks.equations.saturating_sub(rolling.rank);
            (rolling.found.chi2 / freedom.max(1) as f64).max(data.rounding)
        }
    };
    let (mut chi2, mut rows) = (0.0, 0);
    for row in &data.rows {
        let (slip, variance) = row.slip(rolling.found.theta[RATIO]);
        if slip == 0.0 {
            continue;
        }
        chi2 += slip * slip / (variance * spread).max(f64::MIN_POSITIVE);
        rows += 1;
    }
    rows > 0 && chi2 > chi2_quantile(NO_SLIP, rows)
}

fn mu_e(data: &Data, rolling: Option<Solution>) -> Option<Solution> {
    let name = ModelName::MuE;
    let free = free(data, false, true);
    let from: Vec<Theta> = rolling.iter().map(|r| r.found.theta).collect();
    let sliding = solve(data, name, Regimes::Continuous, free, &from);
    let (Some(rolling), Some(sliding)) = (&rolling, &sliding) else {
        return sliding.or(rolling);
    };
    let jump = Profile::new(data, free, sliding.found.theta)
        .best(
            sliding.found.theta[MU] * (1.0 + sliding.found.theta[E]),
            0.5 * JUMPS,
        )
        .map(|(limit, found)| Solution::new(data, name, Regimes::Jump(limit), free, found))
        // A friction above the limit is the continuous model, pinned.
        .filter(|s| s.jump() > Some(s.found.theta[MU] * (1.0 + s.found.theta[E])))
        .filter(|s| sliding.marks.criterion() - s.marks.criterion() > JUMPS && slides(data, s));
    let larger = jump.unwrap_or_else(|| sliding.clone());
    Some(if shows(data, rolling, &larger) {
        larger
    } else {
        rolling.clone()
    })
}

fn grip_slide(data: &Data, e_e: Option<&Solution>) -> Option<Solution> {
    let name = ModelName::GripSlide;
    let from: Vec<Theta> = e_e.iter().map(|s| s.found.theta).collect();
    let sliding = solve(data, name, Regimes::Continuous, free(data, true, true), &from);
    let gripping = e_e.map(|s| Solution { name, ..s.clone() });
    let (Some(gripping), Some(sliding)) = (&gripping, &sliding) else {
        return sliding.or(gripping);
    };
    Some(if shows(data, gripping, sliding) {
        sliding.clone()
    } else {
        gripping.clone()
    })
}

/// Whether the rows show that some slide.
fn shows(data: &Data, without: &Solution, with: &Solution) -> bool {
    let freedom = data.equations().saturating_sub(with.rank);
    let testable = data.weights == Weights::Stated || freedom > 0;
    testable && slides(data, with) && without.marks.criterion() - with.marks.criterion() > SHOWS
}

/// Whether some row slides.
fn slides(data: &Data, solution: &Solution) -> bool {
    let task = solution.task(data);
    let theta = &solution.found.theta;
    task.rows()
        .any(|row| task.nearest(row, theta).is_some_and(|n| n.state.slides()))
}

fn solve(
    data: &Data,
    name: ModelName,
    regimes: Regimes,
    free: [bool; PARAMETERS],
    from: &[Theta],
) -> Option<Solution> {
    let found = search(data, &data.sample, regimes, free, from)?;
    let found = if data.sample.len() < data.rows.len() {
        let all = Task {
            rows: &data.rows,
            chosen: None,
            regimes,
            free,
        };
        all.search(found.theta)?
    } else {
        found
    };
    let mut solution = Solution::new(data, name, regimes, free, found);
    through_the_order(data, &mut solution);
    Some(solution)
}

/// More rows than this: one of them on another side moves nothing.
const FEW: usize = 150;

/// Rows beside the transition that are tried on its other side.
const BESIDE: usize = 3;

/// Goes through the ways to part the rows near the transition. Each leads to a valley of its own; the lowest becomes the
/// solution, the others are kept.
fn through_the_order(data: &Data, solution: &mut Solution) {
    if solution.regimes != Regimes::Continuous || data.rows.len() > FEW {
        return;
    }
    let task = solution.task(data);
    let theta = solution.found.theta;
    let mut order: Vec<(f64, bool)> = data
        .rows
        .iter()
        .map(|row| {
            let slides = task.nearest(row, &theta).is_some_and(|n| n.state.slides());
            (demand(row, &theta), slides)
        })
        .collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let gripping = order.iter().filter(|(_, slides)| !slides).count();
    let mut valleys = vec![solution.found];
    for below in gripping.saturating_sub(BESIDE)..=(gripping + BESIDE).min(order.len()) {
        let limit = match below {
            0 => 0.5 * order[0].0,
            _ if below == order.len() => 2.0 * order[below - 1].0,
            _ => 0.5 * (order[below - 1].0 + order[below].0),
        };
        let parted = Task {
            regimes: Regimes::Jump(limit * (1.0 + theta[E_X])),
            ..task.clone()
        };
        let valley = parted.search(theta).and_then(|parted| task.search(parted.theta));
        let is_new = |found: &Found| {
            valleys
                .iter()
                .all(|v| (v.chi2 - found.chi2).abs() > 1e-6 * (1e-3 + found.chi2))
        };
        if let Some(found) = valley.filter(is_new) {
            valleys.push(found);
        }
    }
    valleys.sort_by(|a, b| a.chi2.total_cmp(&b.chi2));
    let lowest = valleys.remove(0);
    *solution = Solution {
        valleys,
        ..Solution::new(data, solution.name, solution.regimes, solution.free, lowest)
    };
}

/// The least χ² of the `chosen` rows from many starts.
pub(super) fn search(
    data: &Data,
    chosen: &[usize],
    regimes: Regimes,
    free: [bool; PARAMETERS],
    from: &[Theta],
) -> Option<Found> {
    let task = Task {
        rows: &data.rows,
        chosen: Some(chosen),
        regimes,
        free,
    };
    let mut starts = starts::candidates(data, chosen, &free);
    starts.extend(from);
    starts::best(&task, starts, 1.0, FOLLOWED)
        .into_iter()
        .filter_map(|start| task.search(start))
        .min_by(|a, b| a.chi2.total_cmp(&b.chi2))
}

/// The μ-e model with every row sliding, whether or not it can.
pub(super) fn sliding_throughout(data: &Data) -> Option<Solution> {
    solve(data, ModelName::MuE, Regimes::Slide, free(data, false, true), &[])
}
