//! The errors of a setting in few numbers (rms, bias, scatter, bounds), and the repeats of a time (quartiles).

use schemars::JsonSchema;
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF as _};

/// Standard deviations to a side that hold 95 % of a normal distribution.
const NORMAL_95: f64 = 1.959_963_984_540_054;

/// How sure [`ErrorStatistics::bound_95`] is.
const CONFIDENCE: f64 = 0.95;

/// Repeats of one thing: the least, the quartiles.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Quartiles {
    /// The least.
    pub min: f64,
    /// A quarter is below.
    pub q1: f64,
    /// Half is below.
    pub median: f64,
    /// Three quarters are below.
    pub q3: f64,
    /// How many repeats.
    pub repeats: usize,
}

impl Quartiles {
    /// Of `values`; `None` without any, or where one is no number.
    #[must_use]
    pub fn of(values: &[f64]) -> Option<Self> {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        (!sorted.is_empty() && sorted.iter().all(|x| x.is_finite())).then(|| Self {
            min: sorted[0],
            q1: quantile(&sorted, 0.25),
            median: quantile(&sorted, 0.5),
            q3: quantile(&sorted, 0.75),
            repeats: sorted.len(),
        })
    }

    /// What is the same in every repeat.
    #[must_use]
    pub fn exact(value: f64) -> Self {
        Self {
            min: value,
            q1: value,
            median: value,
            q3: value,
            repeats: 1,
        }
    }
}

/// The `part` quantile of what is sorted and not empty, linear between the values.
fn quantile(sorted: &[f64], part: f64) -> f64 {
    let at = part * (sorted.len() - 1) as f64;
    let below = at.floor() as usize;
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + (at - below as f64) * (sorted[above] - sorted[below])
}

/// Differences to the truth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct ErrorStatistics {
    /// How many.
    pub count: usize,
    /// Root of their mean square.
    pub rms: f64,
    /// Magnitude of their mean.
    pub bias: f64,
    /// Standard deviation about their mean; 0 of a single one.
    pub scatter: f64,
    /// 95 % of the magnitudes that were seen are below.
    pub p95: f64,
    /// 95 % of all errors to come are below, to 95 % confidence if they are normal about 0; and no error that was seen is
    /// above. With few errors it is far above [`Self::p95`]: that is what few errors tell.
    pub bound_95: f64,
}

impl ErrorStatistics {
    /// Of signed differences; `None` without any, or where one is no number.
    #[must_use]
    pub fn of(differences: &[f64]) -> Option<Self> {
        Self::of_groups(&[differences])
    }

    /// The same over several coordinates: the bias is that of the worse one, the scatter is about each one's own mean.
    #[must_use]
    pub fn of_groups(groups: &[&[f64]]) -> Option<Self> {
        let mut sizes: Vec<f64> = groups.iter().flat_map(|g| g.iter()).map(|x| x.abs()).collect();
        if sizes.is_empty() || !sizes.iter().all(|x| x.is_finite()) {
            return None;
        }
        sizes.sort_by(f64::total_cmp);
        let n = sizes.len() as f64;
        let rms = (sizes.iter().map(|x| x * x).sum::<f64>() / n).sqrt();
        let filled = || groups.iter().filter(|g| !g.is_empty());
        let mean = |g: &[f64]| g.iter().sum::<f64>() / g.len() as f64;
        let bias = filled().map(|g| mean(g).abs()).fold(0.0, f64::max);
        let squares: f64 = filled()
            .map(|g| g.iter().map(|x| (x - mean(g)).powi(2)).sum::<f64>())
            .sum();
        let freedom: usize = filled().map(|g| g.len() - 1).sum();
        Some(Self {
            count: sizes.len(),
            rms,
            bias,
            scatter: (squares / freedom.max(1) as f64).sqrt(),
            p95: quantile(&sizes, 0.95),
            bound_95: (NORMAL_95 * rms * widening(n)).max(sizes[sizes.len() - 1]),
        })
    }
}

/// By how much the rms of `n` normal errors about 0 may be below the true one: sqrt(n / χ²) at the lower tail of χ².
fn widening(n: f64) -> f64 {
    ChiSquared::new(n).map_or(f64::INFINITY, |chi2| {
        (n / chi2.inverse_cdf(1.0 - CONFIDENCE)).sqrt()
    })
}

/// Slope of a straight line through the logarithms of `points` by least squares; `None` for fewer than two.
#[must_use]
pub fn logarithmic_slope(points: &[(f64, f64)]) -> Option<f64> {
    let logs: Vec<(f64, f64)> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let n = logs.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| logs.iter().map(of).sum::<f64>() / n;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let (mut cross, mut square) = (0.0, 0.0);
    for p in &logs {
        cross += (p.0 - x) * (p.1 - y);
        square += (p.0 - x).powi(2);
    }
    let slope = cross / square;
    slope.is_finite().then_some(slope)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quartiles_of_five_repeats_are_the_sorted_ones() {
        let spread = Quartiles::of(&[5.0, 1.0, 4.0, 2.0, 3.0]).unwrap();
        assert_eq!(
            (spread.min, spread.q1, spread.median, spread.q3, spread.repeats),
            (1.0, 2.0, 3.0, 4.0, 5)
        );
        assert!(Quartiles::of(&[]).is_none() && Quartiles::of(&[1.0, f64::NAN]).is_none());
    }

    #[test]
    fn errors_keep_bias_and_scatter_apart() {
        let e = ErrorStatistics::of(&[1.0, -1.0, 1.0, -1.0]).unwrap();
        assert_eq!((e.count, e.rms, e.bias), (4, 1.0, 0.0));
        assert!((e.scatter - (4.0_f64 / 3.0).sqrt()).abs() < 1e-12);
        let e = ErrorStatistics::of_groups(&[&[0.3, 0.3], &[-0.5, -0.5]]).unwrap();
        assert!((e.bias - 0.5).abs() < 1e-12, "of the worse coordinate");
        assert!(e.scatter < 1e-12, "about each coordinate's own mean");
        assert!(ErrorStatistics::of(&[]).is_none() && ErrorStatistics::of(&[f64::NAN]).is_none());
    }

    #[test]
    fn val_widening_by_the_tables_of_chi_square() {
        // Lower 5 % points of χ²: 1.635 for 6 degrees of freedom, 10.851 for 20.
        assert!((widening(6.0) - (6.0_f64 / 1.635).sqrt()).abs() < 1e-3);
        assert!((widening(20.0) - (20.0_f64 / 10.851).sqrt()).abs() < 1e-3);
    }

    #[test]
    fn the_bound_holds_95_percent_of_new_errors_in_95_percent_of_the_cases() {
        use rand_chacha::ChaCha8Rng;
        use rand_chacha::rand_core::{Rng as _, SeedableRng as _};
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut normal = || {
            // Irwin-Hall of twelve: close enough to normal for a quantile at 95 %.
            (0..12)
                .map(|_| random.next_u64() as f64 / u64::MAX as f64)
                .sum::<f64>()
                - 6.0
        };
        let holds = |n: usize, normal: &mut dyn FnMut() -> f64| {
            let errors: Vec<f64> = (0..n).map(|_| normal()).collect();
            ErrorStatistics::of(&errors).unwrap().bound_95 >= NORMAL_95
        };
        for n in [3, 6, 12] {
            let held = (0..2000).filter(|_| holds(n, &mut normal)).count();
            assert!((1860..=1995).contains(&held), "{held} of 2000 with {n} errors");
        }
    }

    #[test]
    fn a_power_law_has_its_exponent_as_slope() {
        let points: Vec<(f64, f64)> = [1.0_f64, 2.0, 4.0]
            .iter()
            .map(|&x| (x, 3.0 * x.powi(-8)))
            .collect();
        assert!((logarithmic_slope(&points).unwrap() + 8.0).abs() < 1e-12);
        assert!(logarithmic_slope(&points[..1]).is_none());
    }
}
