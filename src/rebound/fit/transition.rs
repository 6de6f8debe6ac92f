//! Where grip ends: the limit Λ = μ_o (1 + e) of a model that jumps there, by profile likelihood.
//!
//! χ² as a function of Λ is flat between two rows and rises in steps where Λ crosses one, so a slope leads nowhere. Rows are
//! put in order of the impulse that would stop their slip, the gaps between them are tried one by one, all other
//! parameters fitted anew in each; and the interval reaches out to where the least χ² is exceeded by what chance allows.
//!
//! The values of Λ are compared by the likelihood that is averaged over each row's true incidence ([`row_law::averaged::averaged`]): the
//! least χ² itself is lower for any jump, by a little for each row near it.

use super::group_data::{GroupData, friction_demand};
use super::observation::Observation;
use super::row_law::{self, E, MU, Regimes, Theta, Variant, friction_share};
use super::search::{Minimum, Task};

/// More rows than this are not fitted anew for every Λ: one row more or less on a side then moves nothing else.
const REFITTED: usize = 150;

/// Gaps that are tried in one sweep.
const GAPS: usize = 24;

/// Gaps that are tried between two neighbours of those, of many rows, whose χ² is smooth there.
const FINER: usize = 8;

/// A difference of χ² that decides nothing.
const FLAT: f64 = 0.05;

/// A row that lies further than this many of its own deviations from the limit is on its side for certain.
const FAR: f64 = 8.0;

/// Gaps in a row that have to be out of question before the rest is taken to be.
const OUT: usize = 4;

/// The limit's interval; an end is `None` where the data set none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LimitInterval {
    pub low: Option<f64>,
    pub high: Option<f64>,
}

/// χ² as a function of Λ.
pub(super) struct Profile<'a> {
    data: &'a GroupData,
    variant: Variant,
    /// Where the other parameters start, or stay.
    theta: Theta,
    /// Rows that change with Λ; the others only add a constant.
    rows: Vec<usize>,
    refit: bool,
    /// What χ² is divided by to be that of rows that scatter as chance has it.
    spread: f64,
}

impl<'a> Profile<'a> {
    /// Around `theta`, the fit of `variant`, whatever its regimes; `spread` is the square of the rows' scatter.
    pub fn new(data: &'a GroupData, variant: Variant, theta: Theta, spread: f64) -> Self {
        Self {
            spread,
            data,
            variant,
            theta,
            rows: data.sample.clone(),
            refit: data.rows.len() <= REFITTED,
        }
    }

    /// The fit with the limit at `limit`; friction in sliding does not exceed it.
    fn fitted(&self, limit: f64) -> Option<Minimum> {
        let task = self.task(limit);
        let found = task.search(self.theta)?;
        if friction_share(&found.theta) <= limit {
            return Some(found);
        }
        let mut pinned = task;
        pinned.variant.regimes = Regimes::Pinned(limit);
        pinned.variant.free[MU] = false;
        let mut found = pinned.search(found.theta)?;
        found.theta[MU] = limit / (1.0 + found.theta[E]);
        Some(found)
    }

    /// Least averaged χ² with the limit at `limit`, of the rows that it may move.
    fn chi2(&self, limit: f64) -> f64 {
        let theta = if self.refit {
            match self.fitted(limit) {
                Some(found) => found.theta,
                None => return f64::INFINITY,
            }
        } else {
            self.theta
        };
        self.task(limit).averaged(&theta, self.spread)
    }

    /// The rows that the limit may move, under a model that jumps at `limit`.
    fn task(&self, limit: f64) -> Task<'_> {
        Task::of(
            self.data,
            self.variant.with(Regimes::Jump(limit)),
            Some(&self.rows),
        )
    }

    /// Values of Λ in the gaps between rows (at most [`GAPS`], from all over `between`), and below and above all of them.
    fn gaps(&self, between: Option<(f64, f64)>) -> Vec<f64> {
        let mut demands: Vec<f64> = self
            .rows
            .iter()
            .map(|&i| friction_demand(&self.data.rows[i], &self.theta))
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
        let most = if self.refit || between.is_none() {
            GAPS
        } else {
            FINER
        };
        let step = gaps.len().div_ceil(most).max(1);
        gaps = gaps.into_iter().step_by(step).collect();
        let (low, high) = between.unwrap_or((0.5 * first, 2.0 * last));
        gaps.insert(0, low);
        gaps.push(high);
        gaps
    }

    /// The best Λ with its fit to all rows. Any value in its gap is as good; it is the middle. `None` where χ² is no lower
    /// there than at `without`, by `gain` at least, and so needs no fit of many rows to find out.
    pub fn best(&mut self, without: f64, gain: f64) -> Option<(f64, Minimum)> {
        // The other parameters of many rows stay where they are while Λ moves; so both take turns.
        const TURNS: usize = 6;
        let all: Vec<usize> = (0..self.data.rows.len()).collect();
        let sample = self.rows.clone();
        let mut best: Option<(f64, Minimum)> = None;
        for turn in 0..TURNS {
            self.rows.clone_from(&sample);
            let limit = self.best_gap()?;
            if turn == 0 && !self.refit {
                // The rows between the two are those that change.
                self.narrow((without.min(limit), without.max(limit)));
                if !(self.chi2(without) - self.chi2(limit) > gain) {
                    return None;
                }
            }
            if best.as_ref().is_some_and(|(last, _)| *last == limit) {
                break;
            }
            let whole = Profile {
                rows: all.clone(),
                refit: true,
                data: self.data,
                variant: self.variant,
                theta: self.theta,
                spread: self.spread,
            };
            let found = whole.fitted(limit)?;
            let worse = |(last, before): &(f64, Minimum)| {
                let chi2 = |limit, theta| whole.task(limit).averaged(theta, self.spread);
                chi2(limit, &found.theta) >= chi2(*last, &before.theta)
            };
            if best.as_ref().is_some_and(worse) {
                break;
            }
            best = Some((limit, found));
            if self.refit {
                break;
            }
            self.theta = found.theta;
        }
        best
    }

    /// The best Λ of all gaps, coarsely at first.
    fn best_gap(&mut self) -> Option<f64> {
        let mut gaps = self.gaps(None);
        let mut best = self.best_of(&gaps).0?;
        while self.thinned(&gaps) {
            // Again, in the gaps between the neighbours of the best.
            let between = neighbours(&gaps, best.0);
            self.narrow(between);
            let finer = self.gaps(Some(between));
            if finer.len() < 2 || finer == gaps {
                break;
            }
            gaps = finer;
            let (Some(found), flat) = self.best_of(&gaps) else {
                break;
            };
            best = found;
            // Once rows' own errors blur what is left, no gap is better than the next.
            if !self.refit && flat <= FLAT * self.spread {
                break;
            }
        }
        Some(best.0)
    }

    /// Whether `gaps` are not all there are between the first and the last of them.
    fn thinned(&self, gaps: &[f64]) -> bool {
        let (Some(&low), Some(&high)) = (gaps.first(), gaps.last()) else {
            return false;
        };
        let within = |row: &Observation| (low..=high).contains(&friction_demand(row, &self.theta));
        self.data.rows.iter().filter(|row| within(row)).count() > gaps.len()
    }

    /// The best gap with its χ², and how far above it the worst of all is.
    fn best_of(&self, gaps: &[f64]) -> (Option<(f64, f64)>, f64) {
        let tried: Vec<(f64, f64)> = gaps
            .iter()
            .map(|&gap| (gap, self.chi2(gap)))
            .filter(|(_, chi2)| chi2.is_finite())
            .collect();
        let best = tried.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1));
        let worst = tried
            .iter()
            .map(|tried| tried.1)
            .fold(f64::NEG_INFINITY, f64::max);
        (best, best.map_or(0.0, |best| worst - best.1))
    }

    /// Takes in all rows that a limit between `low` and `high` may move, and leaves the others out, where there are many.
    fn narrow(&mut self, (low, high): (f64, f64)) {
        if self.refit {
            return;
        }
        let rows = &self.data.rows;
        self.rows = (0..rows.len())
            .filter(|&i| {
                let (least, std) = row_law::margin(&rows[i], &self.variant, high, &self.theta);
                let (most, _) = row_law::margin(&rows[i], &self.variant, low, &self.theta);
                least <= FAR * std && most >= -FAR * std
            })
            .collect();
    }

    /// All Λ whose χ² exceeds that at `best` by less than `level`, from the lowest to the highest.
    pub fn limits(&mut self, best: f64, level: f64) -> LimitInterval {
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

    fn reach(&self, best: f64, level: f64) -> LimitInterval {
        let ceiling = self.chi2(best) + level;
        let mut gaps = self.gaps(None);
        gaps.retain(|g| *g != best);
        let split = gaps.partition_point(|g| *g < best);
        let (below, above) = gaps.split_at(split);
        LimitInterval {
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
