//! The R factor of a whitened Jacobian, taken in a row at a time: R and Qᵀr are all that a fit needs of its QR.
//!
//! Why Givens rotations and not the library's Householder QR: rows go in one by one, the heaviest first, so each row
//! loses to rounding no more than its own share, even where weights span twelve orders of magnitude (Cox and Higham 1998).
//! Householder QR without row sorting and normal equations do not survive that. Rows need not be kept, and R factors of
//! parts of the rows, found on several processors, are taken in like rows.
//!
//! What the rows do not determine shows as a direction along which no row changes. The test for it takes every row and
//! every parameter at unit length, so that it asks what the rows *could* tell, whatever they weigh.
//!
//! N is the number of parameters; one that is held has an empty column.

use nalgebra::{DMatrix, SMatrix, SVector};

/// A direction with less than this part of the longest counts as one along which nothing changes. Equations that are
/// truly dependent come out near 1e-10 (the nearest points are found to that), measured spins that differ by a thousandth
/// at 1e-3.
const RANK: f64 = 1e-7;

/// Share of a parameter in an undetermined direction from which on it is itself undetermined.
const SHARE: f64 = 1e-6;

/// R, Qᵀr and what is left of r.
#[derive(Debug, Clone, Copy)]
pub struct RFactor<const N: usize> {
    r: [[f64; N]; N],
    right: [f64; N],
}

impl<const N: usize> Default for RFactor<N> {
    fn default() -> Self {
        Self {
            r: [[0.0; N]; N],
            right: [0.0; N],
        }
    }
}

impl<const N: usize> RFactor<N> {
    /// Takes in a row of the Jacobian and its residual.
    pub fn push(&mut self, mut row: [f64; N], mut residual: f64) {
        for j in 0..N {
            if row[j] == 0.0 {
                continue;
            }
            let (a, b) = (self.r[j][j], row[j]);
            let length = a.hypot(b);
            let (cos, sin) = (a / length, b / length);
            self.r[j][j] = length;
            row[j] = 0.0;
            for (above, below) in self.r[j].iter_mut().zip(&mut row).skip(j + 1) {
                (*above, *below) = (cos * *above + sin * *below, cos * *below - sin * *above);
            }
            let (upper, lower) = (self.right[j], residual);
            self.right[j] = cos * upper + sin * lower;
            residual = cos * lower - sin * upper;
        }
    }

    /// Takes in all rows that `other` took in.
    pub fn take_in(&mut self, other: &Self) {
        for (row, residual) in other.r.iter().zip(&other.right) {
            self.push(*row, *residual);
        }
    }

    /// Length of each column: how much the rows say of each parameter.
    pub fn lengths(&self) -> [f64; N] {
        std::array::from_fn(|j| (0..=j).map(|i| self.r[i][j].powi(2)).sum::<f64>().sqrt())
    }

    /// The step that makes |r + J δ|² + |D δ|² least, with D = `damping` a parameter. A parameter of which nothing is known
    /// stays.
    pub fn step(&self, damping: &[f64; N]) -> [f64; N] {
        let mut damped = *self;
        for (j, d) in damping.iter().enumerate() {
            let mut row = [0.0; N];
            row[j] = *d;
            damped.push(row, 0.0);
        }
        let mut step = [0.0; N];
        for j in (0..N).rev() {
            let known: f64 = (j + 1..N).map(|k| damped.r[j][k] * step[k]).sum();
            let pivot = damped.r[j][j];
            step[j] = if pivot == 0.0 {
                0.0
            } else {
                -(damped.right[j] + known) / pivot
            };
        }
        step
    }

    /// |J δ|: by how much a step moves the residuals.
    pub fn effect(&self, step: &[f64; N]) -> f64 {
        let line = |i: usize| (i..N).map(|k| self.r[i][k] * step[k]).sum::<f64>();
        (0..N).map(|i| line(i).powi(2)).sum::<f64>().sqrt()
    }

    /// Which of the parameters in `free` the rows determine, and how many independent combinations of them. `self` is of
    /// rows of unit length.
    pub fn determined(&self, free: &[bool; N]) -> ([bool; N], usize) {
        let lengths = self.lengths();
        let used: Vec<usize> = (0..N).filter(|&j| free[j] && lengths[j] > 0.0).collect();
        let mut determined = [false; N];
        if used.is_empty() {
            return (determined, 0);
        }
        let mut scaled = DMatrix::<f64>::zeros(N, N);
        for (column, &j) in used.iter().enumerate() {
            for i in 0..N {
                scaled[(i, column)] = self.r[i][j] / lengths[j];
            }
        }
        let svd = scaled.svd(false, true);
        let longest = svd.singular_values.max();
        let rank = svd
            .singular_values
            .iter()
            .filter(|s| **s > RANK * longest)
            .count();
        let Some(directions) = svd.v_t else {
            return (determined, 0);
        };
        for (column, &j) in used.iter().enumerate() {
            determined[j] = (0..N)
                .filter(|&i| !(svd.singular_values[i] > RANK * longest))
                .all(|i| directions[(i, column)].abs() < SHARE);
        }
        (determined, rank)
    }

    /// Covariance of the parameters in `determined`, the others being held; those in `loose` may take any value.
    ///
    /// (RᵀR)⁻¹ from the columns of R. Where loose parameters are bound to each other, as many of them are left out as are
    /// too many: which, does not matter to the determined ones.
    pub fn covariance(&self, determined: &[bool; N], loose: &[bool; N], rank: usize) -> SMatrix<f64, N, N> {
        let mut columns: Vec<usize> = (0..N).filter(|&j| determined[j]).collect();
        let lengths = self.lengths();
        let others = (0..N).filter(|&j| loose[j] && !determined[j] && lengths[j] > 0.0);
        let room = rank.saturating_sub(columns.len());
        columns.extend(others.take(room));
        // The columns in their new order are no triangle; made one again by the same rotations.
        let mut again = Self::default();
        for i in 0..N {
            let mut row = [0.0; N];
            for (place, &j) in columns.iter().enumerate() {
                row[place] = if i <= j { self.r[i][j] } else { 0.0 };
            }
            again.push(row, 0.0);
        }
        let mut covariance = SMatrix::<f64, N, N>::zeros();
        let n = columns.len();
        let mut inverse = vec![SVector::<f64, N>::zeros(); n];
        for (unit, column) in inverse.iter_mut().enumerate() {
            for i in (0..=unit).rev() {
                let known: f64 = (i + 1..n).map(|k| again.r[i][k] * column[k]).sum();
                let one = if i == unit { 1.0 } else { 0.0 };
                column[i] = (one - known) / again.r[i][i];
            }
        }
        for (p, &i) in columns.iter().enumerate() {
            for (q, &j) in columns.iter().enumerate() {
                if determined[i] && determined[j] {
                    covariance[(i, j)] = inverse.iter().map(|column| column[p] * column[q]).sum();
                }
            }
        }
        covariance
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(rows: &[[f64; 4]]) -> RFactor<4> {
        let mut factor = RFactor::default();
        for row in rows {
            factor.push(*row, 0.0);
        }
        factor
    }

    #[test]
    fn a_line_through_points_is_found_with_its_covariance() {
        // y = 2 + 3 x at x = 0, 1, 2, 3 with unit weights: textbook covariance.
        let mut factor = RFactor::default();
        for x in [0.0, 1.0, 2.0, 3.0] {
            factor.push([1.0, x, 0.0, 0.0], -(2.0 + 3.0 * x));
        }
        let step = factor.step(&[0.0; 4]);
        assert!((step[0] - 2.0).abs() < 1e-14 && (step[1] - 3.0).abs() < 1e-14);
        let free = [true, true, false, false];
        let (determined, rank) = factor.determined(&free);
        assert_eq!((determined, rank), (free, 2));
        let c = factor.covariance(&determined, &free, rank);
        assert!((c[(0, 0)] - 0.7).abs() < 1e-14 && (c[(1, 1)] - 0.2).abs() < 1e-14);
        assert!((c[(0, 1)] + 0.3).abs() < 1e-14);
    }

    #[test]
    fn weights_over_twelve_orders_lose_nothing() {
        let mut factor = RFactor::default();
        // A heavy row fixes the sum to 3, a light one the difference to 1.
        factor.push([1e12, 1e12, 0.0, 0.0], -3e12);
        factor.push([1.0, -1.0, 0.0, 0.0], -1.0);
        let step = factor.step(&[0.0; 4]);
        assert!(
            (step[0] - 2.0).abs() < 1e-11 && (step[1] - 1.0).abs() < 1e-11,
            "{step:?}"
        );
        let free = [true, true, false, false];
        let unit = of(&[[1.0, 1.0, 0.0, 0.0], [1.0, -1.0, 0.0, 0.0]]);
        let (determined, rank) = unit.determined(&free);
        let c = factor.covariance(&determined, &free, rank);
        assert!((c[(0, 0)] - 0.25).abs() < 1e-9, "{c}");
    }

    #[test]
    fn what_no_row_tells_is_not_determined() {
        let free = [true; 4];
        // Only the sum of the second and third is known, the fourth not at all.
        let factor = of(&[[1.0, 0.0, 0.0, 0.0], [0.5, 1.0, 1.0, 0.0], [0.2, 2.0, 2.0, 0.0]]);
        let (determined, rank) = factor.determined(&free);
        assert_eq!((determined, rank), ([true, false, false, false], 2));
        let c = factor.covariance(&determined, &free, rank);
        assert!(c[(0, 0)] > 0.0 && c[(1, 1)] == 0.0 && c.iter().all(|x| x.is_finite()));
    }
}
