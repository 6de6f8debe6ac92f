//! The search of one model alone, to a tolerance of one's own: for seeing what the tolerance costs and what it gives.

use super::group_data::GroupData;
use super::row_law::{E, E_X, MU, PARAMETERS, Regimes, Theta, Variant};
use super::search::{Minimum, SETTLED, Task};
use super::series::Series;
use super::starts::{self, FOLLOWED};
use crate::rebound::ModelName;

/// The tolerance of the fits: a step that would move all residuals together by less than this part of the scatter of one is
/// not taken.
pub const DEFAULT_TOLERANCE: f64 = SETTLED;

/// Where a search ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SearchOutcome {
    /// e, e_x, μ; what is not searched for is 0.
    pub values: [f64; 3],
    /// Their standard uncertainties; 0 of what is not searched for.
    pub stds: [f64; 3],
    /// χ² there.
    pub chi2: f64,
    /// Steps that were tried, from all starts.
    pub steps: u64,
    /// Whether the best of the searches ended by its tolerance.
    pub converged: bool,
}

/// The rows of a series, ready for searches.
pub struct SingleSearch {
    data: GroupData,
    model: ModelName,
}

impl SingleSearch {
    /// All rows of `series`, whatever their group, in a model whose rows may slide, with a known spin.
    #[must_use]
    pub fn new(series: &Series, model: ModelName) -> Self {
        let indices: Vec<usize> = (0..series.rows.len()).collect();
        Self {
            data: GroupData::new(series, &indices, None).0,
            model,
        }
    }

    /// The least χ² from the starts of the fits, each search to `tolerance`. `None` where no search finds a finite χ².
    #[must_use]
    pub fn search(&self, tolerance: f64) -> Option<SearchOutcome> {
        let task = self.task();
        let candidates = starts::candidates(&self.data, &self.data.sample, &task.variant.free);
        self.from(starts::best(&task, candidates, 1.0, FOLLOWED), tolerance)
    }

    /// The least χ² near `values` (e, e_x, μ), to `tolerance`.
    #[must_use]
    pub fn search_near(&self, values: [f64; 3], tolerance: f64) -> Option<SearchOutcome> {
        let mut start = [0.0; PARAMETERS];
        (start[E], start[E_X], start[MU]) = (values[0], values[1], values[2]);
        self.from(vec![start], tolerance)
    }

    fn task(&self) -> Task<'_> {
        Task {
            rows: &self.data.rows,
            chosen: None,
            variant: Variant {
                model: self.model,
                regimes: Regimes::Continuous,
                free: self.data.searched(self.model),
            },
            table_errors: None,
        }
    }

    fn from(&self, starts: Vec<Theta>, tolerance: f64) -> Option<SearchOutcome> {
        let task = self.task();
        let mut steps = 0;
        let searches: Vec<Minimum> = starts
            .into_iter()
            .filter_map(|start| task.search_to(start, tolerance))
            .map(|(found, tried)| {
                steps += tried;
                found
            })
            .collect();
        let best = searches.into_iter().min_by(|a, b| a.chi2.total_cmp(&b.chi2))?;
        let (determined, rank) = task.unit_r_factor(&best.theta).determined(&task.variant.free);
        let covariance = best.r_factor.covariance(&determined, &task.variant.free, rank);
        let order = [E, E_X, MU];
        Some(SearchOutcome {
            values: order.map(|j| best.theta[j]),
            stds: order.map(|j| covariance[(j, j)].max(0.0).sqrt()),
            chi2: best.chi2,
            steps,
            converged: best.converged,
        })
    }
}
