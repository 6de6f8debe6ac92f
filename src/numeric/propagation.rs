//! Propagation of a covariance through any function, by differences.
//!
//! Every reported number is a function of the same vector: the arcs' parameters and the calibration's. So one
//! covariance carries what they share: both arcs of an impact have one scale and one "up", and e does not suffer from
//! either.

use crate::quantity::Quantity;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// The vector that everything measured depends on, with its covariance.
#[derive(Debug, Clone)]
pub struct InputQuantities {
    /// Best estimates.
    pub values: DVector<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
}

/// Values of some outputs with their joint covariance.
#[derive(Debug, Clone)]
pub struct OutputQuantities {
    values: Vec<f64>,
    covariance: DMatrix<f64>,
}

impl InputQuantities {
    /// The outputs of `function` at the best estimate, with their covariance from central differences a tenth of a
    /// standard deviation to each side: far above rounding, far below where a quotient bends.
    #[must_use]
    pub fn outputs(&self, function: impl Fn(&[f64]) -> Vec<f64> + Sync) -> OutputQuantities {
        let values = function(self.values.as_slice());
        let slopes = |j: usize| -> Option<Vec<f64>> {
            let step = 0.1 * self.covariance[(j, j)].max(0.0).sqrt();
            let at = |step: f64| {
                let mut at = self.values.clone();
                at[j] += step;
                function(at.as_slice())
            };
            (step > 0.0).then(|| {
                let (above, below) = (at(step), at(-step));
                above
                    .iter()
                    .zip(&below)
                    .map(|(a, b)| (a - b) / (2.0 * step))
                    .collect()
            })
        };
        let mut jacobian = DMatrix::zeros(values.len(), self.values.len());
        let columns: Vec<Option<Vec<f64>>> = (0..self.values.len()).into_par_iter().map(slopes).collect();
        for (mut column, slopes) in jacobian.column_iter_mut().zip(columns) {
            if let Some(slopes) = slopes {
                column.copy_from_slice(&slopes);
            }
        }
        OutputQuantities {
            covariance: &jacobian * &self.covariance * jacobian.transpose(),
            values,
        }
    }
}

impl OutputQuantities {
    /// Output `i`; `None` unless finite.
    #[must_use]
    pub fn quantity(&self, i: usize) -> Option<Quantity> {
        Quantity::new(self.values[i], self.std(i))
    }

    /// Best estimate of output `i`.
    #[must_use]
    pub fn value(&self, i: usize) -> f64 {
        self.values[i]
    }

    /// Standard uncertainty of output `i`.
    #[must_use]
    pub fn std(&self, i: usize) -> f64 {
        self.covariance[(i, i)].max(0.0).sqrt()
    }

    /// Correlation of the errors of outputs `i` and `j`; `None` where one has none, or is no number.
    #[must_use]
    pub fn correlation(&self, i: usize, j: usize) -> Option<f64> {
        let scale = self.std(i) * self.std(j);
        let known = self.values[i].is_finite() && self.values[j].is_finite();
        let value = self.covariance[(i, j)] / scale;
        (known && scale > 0.0 && value.is_finite()).then(|| value.clamp(-1.0, 1.0))
    }

    /// Whether output `i` differs from zero by more than `sigmas` standard uncertainties.
    #[must_use]
    pub fn stands_out(&self, i: usize, sigmas: f64) -> bool {
        self.values[i].abs() > sigmas * self.std(i)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quotient_of_correlated_numbers_loses_what_they_share() {
        // a and b share their scale: 10 % together, nothing apart.
        let inputs = InputQuantities {
            values: DVector::from_vec(vec![2.0, 4.0]),
            covariance: DMatrix::from_row_slice(2, 2, &[0.04, 0.08, 0.08, 0.16]),
        };
        let out = inputs.outputs(|p| vec![p[0] / p[1], p[0] + p[1]]);
        assert!(out.std(0) < 1e-4, "{}", out.std(0));
        assert!((out.std(1) - 0.6).abs() < 1e-9);
        assert!(out.quantity(1).is_some());
        assert_eq!(inputs.outputs(|p| vec![p[0], p[1], 7.0]).correlation(0, 2), None);
        let same = inputs.outputs(|p| vec![p[0], -p[1]]);
        assert!((same.correlation(0, 1).unwrap() + 1.0).abs() < 1e-9);
    }
}
