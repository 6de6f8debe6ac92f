//! The three models fitted to the rows of a group, each in the variant that the rows ask for.
//!
//! | model | variants, from the simplest |
//! |---|---|
//! | μ-e | all rows leave rolling (e); some slide, μ_o = μ (e, μ); the outcome jumps (e, μ, μ_o) |
//! | e-e | (e, e_x) |
//! | grip-slide | all rows grip (e, e_x); some slide (e, e_x, μ) |
//!
//! A larger variant has to earn its parameter. Sliding has to show ([`SHOWS`]): otherwise the row nearest to the limit would
//! give a friction made of its own noise.

use super::criteria::Marks;
use super::data::Data;
use super::law::{E, E_X, MU, PARAMETERS, RATIO, Regimes, Theta};
use super::result::ModelName;
use super::search::{Found, Task};
use super::starts;
use super::transition::Profile;

/// By how much AICc has to fall for sliding to be believed: χ² falls by 10.8 then, which chance does in one of a thousand
/// series.
const SHOWS: f64 = 8.8;

/// By how much AICc has to fall for a jump to be believed.
const JUMPS: f64 = 2.0;

/// Starts that are followed to their end.
const FOLLOWED: usize = 6;

/// A model in one variant at its best.
#[derive(Debug, Clone)]
pub(super) struct Solution {
    pub name: ModelName,
    pub regimes: Regimes,
    pub free: [bool; PARAMETERS],
    pub found: Found,
    pub determined: [bool; PARAMETERS],
    /// Independent combinations of the parameters that the rows determine.
    pub rank: usize,
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
    let e_e = e_e(data);
    [mu_e(data), e_e.clone(), grip_slide(data, e_e.as_ref())]
        .into_iter()
        .flatten()
        .collect()
}

fn mu_e(data: &Data) -> Option<Solution> {
    let name = ModelName::MuE;
    let rolling = solve(data, name, Regimes::Grip, free(data, false, false), &[]);
    let free = free(data, false, true);
    let from: Vec<Theta> = rolling.iter().map(|r| r.found.theta).collect();
    let sliding = solve(data, name, Regimes::Continuous, free, &from);
    let (Some(rolling), Some(sliding)) = (&rolling, &sliding) else {
        return sliding.or(rolling);
    };
    let jump = Profile::new(data, free, sliding.found.theta)
        .best()
        .map(|(limit, found)| Solution::new(data, name, Regimes::Jump(limit), free, found))
        // A friction above the limit is the continuous model, pinned.
        .filter(|s| s.jump() > Some(s.found.theta[MU] * (1.0 + s.found.theta[E])))
        .filter(|s| sliding.marks.criterion() - s.marks.criterion() > JUMPS && slides(data, s) > 0);
    let larger = jump.unwrap_or_else(|| sliding.clone());
    Some(if shows(data, rolling, &larger) { larger } else { rolling.clone() })
}

fn e_e(data: &Data) -> Option<Solution> {
    solve(data, ModelName::EE, Regimes::Grip, free(data, true, false), &[])
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
    let testable = data.weights == super::series::Weights::Stated || freedom > 0;
    testable && slides(data, with) > 0 && without.marks.criterion() - with.marks.criterion() > SHOWS
}

/// Rows that slide.
fn slides(data: &Data, solution: &Solution) -> usize {
    let task = solution.task(data);
    let theta = &solution.found.theta;
    let state = |row| task.nearest(row, theta).is_some_and(|n| n.state.slides());
    task.rows().filter(|row| state(row)).count()
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
    Some(Solution::new(data, name, regimes, free, found))
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
