//! Where grip ends: the limit Λ = μ_o (1 + e) of a model that jumps there, by profile likelihood.
//!
//! χ² as a function of Λ is flat between two rows and rises in steps where Λ crosses one, so a slope leads nowhere. Rows are
//! put in order of the impulse that would stop their slip, the gaps between them are tried one by one, all other
//! parameters fitted anew in each; and the interval reaches out to where the least χ² is exceeded by what chance allows.

use super::data::{Data, demand};
use super::law::{E, MU, PARAMETERS, Regimes, Theta};
use super::observation::Observation;
use super::search::{Found, Task};

/// More rows than this are not fitted anew for every Λ: one row more or less on a side then moves nothing else.
const REFITTED: usize = 150;

/// Gaps that are tried in one sweep.
const GAPS: usize = 24;

/// Gaps in a row that have to be out of question before the rest is taken to be.
const OUT: usize = 4;

/// The limit's interval; an end is `None` where the data set none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Limits {
    pub low: Option<f64>,
    pub high: Option<f64>,
}

/// χ² as a function of Λ.
pub(super) struct Profile<'a> {
    data: &'a Data,
    free: [bool; PARAMETERS],
    /// Where the other parameters start, or stay.
    theta: Theta,
    /// Rows that change with Λ; the others only add a constant.
    rows: Vec<usize>,
    refit: bool,
}

impl<'a> Profile<'a> {
    /// Around `theta`, the fit with the parameters in `free`.
    pub fn new(data: &'a Data, free: [bool; PARAMETERS], theta: Theta) -> Self {
        Self {
            data,
            free,
            theta,
            rows: data.sample.clone(),
            refit: data.rows.len() <= REFITTED,
        }
    }

    /// The fit with the limit at `limit`; friction in sliding does not exceed it.
    fn fitted(&self, limit: f64) -> Option<Found> {
        let task = Task {
            rows: &self.data.rows,
            chosen: Some(&self.rows),
            regimes: Regimes::Jump(limit),
            free: self.free,
        };
        let found = task.search(self.theta)?;
        if found.theta[MU] * (1.0 + found.theta[E]) <= limit {
            return Some(found);
        }
        let mut free = self.free;
        free[MU] = false;
        let pinned = Task {
            regimes: Regimes::Pinned(limit),
            free,
            ..task
        };
        let mut found = pinned.search(found.theta)?;
        found.theta[MU] = limit / (1.0 + found.theta[E]);
        Some(found)
    }

    /// Least χ² with the limit at `limit`, of the rows that it may move.
    fn chi2(&self, limit: f64) -> f64 {
        if self.refit {
            return self.fitted(limit).map_or(f64::INFINITY, |found| found.chi2);
        }
        let task = Task {
            rows: &self.data.rows,
            chosen: Some(&self.rows),
            regimes: Regimes::Jump(limit),
            free: self.free,
        };
        task.chi2(&self.theta)
    }

    /// Values of Λ in the gaps between rows (at most [`GAPS`], from all over `between`), and below and above all of them.
    fn gaps(&self, between: Option<(f64, f64)>) -> Vec<f64> {
        let mut demands: Vec<f64> = self
            .rows
            .iter()
            .map(|&i| demand(&self.data.rows[i], &self.theta))
            .filter(|d| d.is_finite())
            .filter(|d| between.is_none_or(|(low, high)| (low..=high).contains(d)))
            .collect();
        demands.sort_by(f64::total_cmp);
        let (Some(&first), Some(&last)) = (demands.first(), demands.last()) else {
            return Vec::new();
        };
        let mut gaps: Vec<f64> = demands
            .windows(2)
            .filter(|w| w[1] > w[0])
            .map(|w| 0.5 * (w[0] + w[1]))
            .collect();
        let step = gaps.len().div_ceil(GAPS).max(1);
        gaps = gaps.into_iter().step_by(step).collect();
        let (low, high) = between.unwrap_or((0.5 * first, 2.0 * last));
        gaps.insert(0, low);
        gaps.push(high);
        gaps
    }

    /// The best Λ with its fit to all rows. Any value in its gap is as good; it is the middle. `None` where χ² is no lower
    /// there than at `without`, by `gain` at least, and so needs no fit of many rows to find out.
    pub fn best(&mut self, without: f64, gain: f64) -> Option<(f64, Found)> {
        let mut gaps = self.gaps(None);
        let mut best = self.best_of(&gaps)?;
        while self.thinned(&gaps) {
            // Again, in the gaps between the neighbours of the best.
            let between = neighbours(&gaps, best.0);
            self.narrow(between);
            let finer = self.gaps(Some(between));
            if finer.len() < 2 || finer == gaps {
                break;
            }
            gaps = finer;
            best = self.best_of(&gaps).unwrap_or(best);
        }
        if !self.refit {
            // The rows between the two are those that change.
            self.narrow((without.min(best.0), without.max(best.0)));
            if !(self.chi2(without) - self.chi2(best.0) > gain) {
                return None;
            }
        }
        let all: Vec<usize> = (0..self.data.rows.len()).collect();
        let whole = Profile {
            rows: all,
            refit: true,
            data: self.data,
            free: self.free,
            theta: self.theta,
        };
        whole.fitted(best.0).map(|found| (best.0, found))
    }

    /// Whether `gaps` are not all there are between the first and the last of them.
    fn thinned(&self, gaps: &[f64]) -> bool {
        let (Some(&low), Some(&high)) = (gaps.first(), gaps.last()) else {
            return false;
        };
        let within = |row: &Observation| (low..=high).contains(&demand(row, &self.theta));
        self.data.rows.iter().filter(|row| within(row)).count() > gaps.len()
    }

    fn best_of(&self, gaps: &[f64]) -> Option<(f64, f64)> {
        gaps.iter()
            .map(|&gap| (gap, self.chi2(gap)))
            .filter(|(_, chi2)| chi2.is_finite())
            .min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Takes in all rows that lie about between `low` and `high`, and leaves the others out, where there are many.
    fn narrow(&mut self, (low, high): (f64, f64)) {
        if self.refit {
            return;
        }
        let margin = 0.5 * (high - low);
        let rows = &self.data.rows;
        self.rows = (0..rows.len())
            .filter(|&i| (low - margin..=high + margin).contains(&demand(&rows[i], &self.theta)))
            .collect();
    }

    /// All Λ whose χ² exceeds that at `best` by less than `level`, from the lowest to the highest.
    pub fn limits(&mut self, best: f64, level: f64) -> Limits {
        if !self.refit {
            // The sample's interval is wider; within it, all rows.
            let wide = self.reach(best, level + 10.0);
            let gaps = self.gaps(None);
            let low = wide.low.or(gaps.first().copied()).unwrap_or(0.0);
            let high = wide.high.or(gaps.last().copied()).unwrap_or(best);
            self.narrow((low.min(best), high.max(best)));
        }
        self.reach(best, level)
    }

    fn reach(&self, best: f64, level: f64) -> Limits {
        let ceiling = self.chi2(best) + level;
        let mut gaps = self.gaps(None);
        gaps.retain(|g| *g != best);
        let split = gaps.partition_point(|g| *g < best);
        let (below, above) = gaps.split_at(split);
        Limits {
            low: self.end(best, below.iter().rev(), ceiling),
            high: self.end(best, above.iter(), ceiling),
        }
    }

    /// Goes outwards from `best`; the place beyond the last value in question at which χ² passes the ceiling.
    fn end<'g>(&self, best: f64, outwards: impl Iterator<Item = &'g f64>, ceiling: f64) -> Option<f64> {
        let mut inside = best;
        let mut outside = None;
        let mut out = 0;
        for &gap in outwards {
            if self.chi2(gap) <= ceiling {
                (inside, outside, out) = (gap, None, 0);
            } else {
                outside = outside.or(Some(gap));
                out += 1;
                if out >= OUT {
                    break;
                }
            }
        }
        let mut outside = outside?;
        // To a hundredth of the distance from the best: an interval needs no more.
        for _ in 0..50 {
            if (outside - inside).abs() <= 1e-2 * (outside - best).abs() {
                break;
            }
            let middle = 0.5 * (inside + outside);
            if self.chi2(middle) <= ceiling {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        Some(outside)
    }
}

/// The gaps beside `at`.
fn neighbours(gaps: &[f64], at: f64) -> (f64, f64) {
    let place = gaps.partition_point(|g| *g < at);
    let low = gaps[place.saturating_sub(1)];
    let high = gaps[(place + 1).min(gaps.len() - 1)];
    (low, high)
}
