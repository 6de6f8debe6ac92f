//! What a χ² is worth: likelihood, AICc, BIC, probability, and the spread of the rows.
//!
//! With stated deviations the likelihood of the rows, their true values profiled out, is exp(−χ²/2) times a constant that
//! is the same for every model. Without, the deviation σ is a parameter like the others: σ² = χ²/N at the highest
//! likelihood, N the number of equations.
//!
//! ```text
//! AICc = −2 ln L + 2 p + 2 p (p + 1) / (N − p − 1)        BIC = −2 ln L + p ln N
//! ```

use super::group_data::GroupData;
use super::series::Weights;
use statrs::distribution::{ChiSquared, ContinuousCDF as _, FisherSnedecor, Normal, StudentsT};
use std::f64::consts::TAU;
use std::sync::LazyLock;

/// Probability of a χ² at least this large below which a model counts as not describing the data.
pub const LEAST_PROBABILITY: f64 = 0.01;

/// How well a model does on a set of rows, its parameters counted.
#[derive(Debug, Clone, Copy)]
pub(super) struct InformationCriteria {
    /// N.
    pub equations: usize,
    /// p, with the scale where it is fitted.
    pub parameters: usize,
    pub log_likelihood: Option<f64>,
    pub aicc: Option<f64>,
    pub bic: Option<f64>,
}

impl InformationCriteria {
    /// For `chi2` reached with `rank` parameters; `spread` divides χ² where the rows scatter more than their deviations say.
    pub fn new(data: &GroupData, chi2: f64, rank: usize, spread: f64) -> Self {
        let n = data.equations();
        let parameters = rank + usize::from(data.weights == Weights::Unit);
        let twice = match data.weights {
            Weights::Stated => Some(chi2 / spread + constant(data)),
            Weights::Unit => (n > 0).then(|| {
                // No scatter at all would be an infinite likelihood; the numbers' own rounding is scatter enough.
                let variance = (chi2 / n as f64).max(data.rounding).max(f64::MIN_POSITIVE);
                n as f64 * ((TAU * variance).ln() + 1.0)
            }),
        };
        let p = parameters as f64;
        let room = n as f64 - p - 1.0;
        Self {
            equations: n,
            parameters,
            log_likelihood: twice.map(|t| -0.5 * t),
            aicc: twice
                .filter(|_| room > 0.0)
                .map(|t| t + 2.0 * p + 2.0 * p * (p + 1.0) / room),
            bic: twice.filter(|_| n > 0).map(|t| t + p * (n as f64).ln()),
        }
    }

    /// What variants of one model are compared by: with known deviations AIC, which is exact for any number of rows then;
    /// else AICc.
    pub fn criterion(&self, weights: Weights) -> Option<f64> {
        match weights {
            Weights::Stated => self
                .log_likelihood
                .map(|l| -2.0 * l + 2.0 * self.parameters as f64),
            Weights::Unit => self.aicc,
        }
    }

    /// By how much `self` is better than `other`; nothing where that cannot be told.
    pub fn gain_over(&self, other: &Self, weights: Weights) -> f64 {
        let both = self.criterion(weights).zip(other.criterion(weights));
        both.map_or(0.0, |(here, there)| there - here)
    }
}

/// −2 ln of the part of the likelihood that no model changes: ln |2π Σ| of what was measured.
fn constant(data: &GroupData) -> f64 {
    data.rows
        .iter()
        .map(|row| {
            let measured = row.variance.iter().filter(|v| **v > 0.0);
            measured.map(|v| (TAU * v).ln()).sum::<f64>() + row.log_correlation
        })
        .sum()
}

/// More degrees of freedom than this, and the series behind χ² no longer come to their end: a million rows had a quantile of
/// infinity. The cube root of χ² is Gaussian then (Wilson and Hilferty 1931), to 1e-8 of χ².
const MANY: usize = 20_000;

/// Standard deviation of the cube root of χ² over its degrees of freedom, whose mean is one less its square.
fn cube_root_width(freedom: usize) -> f64 {
    (2.0 / (9.0 * freedom as f64)).sqrt()
}

/// Probability of a χ² of at least `chi2` with `freedom` degrees of freedom.
pub(super) fn chi2_tail(chi2: f64, freedom: usize) -> Option<f64> {
    if freedom == 0 || !(chi2.is_finite() && chi2 >= 0.0) {
        return None;
    }
    if freedom > MANY {
        let width = cube_root_width(freedom);
        let z = ((chi2 / freedom as f64).cbrt() - (1.0 - width * width)) / width;
        return Some(Normal::standard().sf(z));
    }
    let distribution = ChiSquared::new(freedom as f64).ok()?;
    Some(distribution.sf(chi2).clamp(0.0, 1.0))
}

/// The χ² that is exceeded with probability `tail`.
pub(super) fn chi2_quantile(tail: f64, freedom: usize) -> f64 {
    if freedom > MANY {
        let width = cube_root_width(freedom);
        let z = -Normal::standard().inverse_cdf(tail);
        return freedom as f64 * (1.0 - width * width + z * width).powi(3);
    }
    ChiSquared::new(freedom.max(1) as f64).map_or(f64::INFINITY, |d| d.inverse_cdf(1.0 - tail))
}

/// Medians of χ² with one to four degrees of freedom.
pub(super) static MEDIANS: LazyLock<[f64; 4]> =
    LazyLock::new(|| std::array::from_fn(|i| chi2_quantile(0.5, i + 1)));

/// How much further χ² of one to four equations reaches than that of one, far out in its tail.
pub(super) static TAIL_RATIOS: LazyLock<[f64; 4]> = LazyLock::new(|| {
    const TAIL: f64 = 1e-5;
    std::array::from_fn(|i| chi2_quantile(TAIL, i + 1) / chi2_quantile(TAIL, 1))
});

/// The ratio of two mean squares that is exceeded with probability `tail`.
pub(super) fn f_quantile(tail: f64, above: usize, below: usize) -> f64 {
    if below == 0 {
        return f64::INFINITY;
    }
    if below > MANY {
        return chi2_quantile(tail, above) / above.max(1) as f64;
    }
    FisherSnedecor::new(above.max(1) as f64, below as f64)
        .map_or(f64::INFINITY, |d| d.inverse_cdf(1.0 - tail))
}

/// Standard uncertainties to either side that hold 95 %.
pub(super) fn coverage_factor(weights: Weights, freedom: usize) -> f64 {
    const TAIL: f64 = 0.975;
    match weights {
        Weights::Stated => Normal::standard().inverse_cdf(TAIL),
        Weights::Unit => {
            StudentsT::new(0.0, 1.0, freedom.max(1) as f64).map_or(f64::INFINITY, |d| d.inverse_cdf(TAIL))
        }
    }
}

/// What standard uncertainties are multiplied by: 1 where the rows scatter as their deviations say; more where they
/// scatter more than chance allows (Birge's ratio); without deviations whatever the scatter is, `None` where a fit leaves
/// none.
pub(super) fn scatter(data: &GroupData, chi2: f64, freedom: usize) -> Option<f64> {
    match data.weights {
        Weights::Stated => {
            let improbable = chi2_tail(chi2, freedom).is_some_and(|p| p < LEAST_PROBABILITY);
            Some(if improbable {
                (chi2 / freedom as f64).sqrt().max(1.0)
            } else {
                1.0
            })
        }
        // Rows that agree to their last digit are not known better than that digit.
        Weights::Unit => (freedom > 0).then(|| (chi2 / freedom as f64).max(data.rounding).sqrt()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_and_tails_go_on_where_there_are_many_rows() {
        for tail in [0.5, 0.01, 0.001] {
            let exact = ChiSquared::new((MANY + 1) as f64)
                .unwrap()
                .inverse_cdf(1.0 - tail);
            let gaussian = chi2_quantile(tail, MANY + 1);
            assert!(
                (gaussian / exact - 1.0).abs() < 1e-6,
                "{tail}: {gaussian} for {exact}"
            );
            for freedom in [MANY - 1, MANY + 1, 1_000_000, 30_000_000] {
                let there_and_back = chi2_tail(chi2_quantile(tail, freedom), freedom).unwrap();
                assert!(
                    (there_and_back / tail - 1.0).abs() < 1e-3,
                    "{tail}, {freedom}: {there_and_back}"
                );
            }
        }
        // Mean and standard deviation of χ² of a million: 10⁶, 1414; 3.09 of them to the thousandth.
        let thousandth = chi2_quantile(0.001, 1_000_000);
        assert!((thousandth - 1_004_373.0).abs() < 10.0, "{thousandth}");
        assert!(f_quantile(0.001, 1, 1_000_000).is_finite());
    }
}
