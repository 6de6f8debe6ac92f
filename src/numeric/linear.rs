//! Linear least squares: one QR factorisation gives the solution, its covariance and the rank.
//!
//! min |b − A x|², A = Q R S with S the lengths of A's columns. With columns of unit length a small pivot means that the rows do
//! not tell a parameter, whatever its unit: that is the rank test. What is not determined has no number: solution and
//! covariance are `None` then, never infinite and never zero.

use nalgebra::{DMatrix, DVector};

/// Smallest pivot of a determined parameter, columns being of unit length: normal equations would have lost it altogether.
pub(super) const PIVOT: f64 = 1e-10;

/// A factorised problem.
#[derive(Debug, Clone)]
pub struct Factorisation {
    r: DMatrix<f64>,
    /// The part of Qᵀb that a solution can explain.
    right: DVector<f64>,
    scale: Vec<f64>,
}

impl Factorisation {
    /// Of `matrix` x = `right`, rows whitened. `None` where a column is empty or not finite.
    #[must_use]
    pub fn new(matrix: &DMatrix<f64>, right: &DVector<f64>) -> Option<Self> {
        let scale: Vec<f64> = matrix.column_iter().map(|c| c.norm()).collect();
        if scale.iter().any(|&s| !(s > 0.0 && s.is_finite())) {
            return None;
        }
        let mut scaled = matrix.clone();
        for (mut column, s) in scaled.column_iter_mut().zip(&scale) {
            column /= *s;
        }
        let qr = scaled.qr();
        let r = qr.r();
        let mut explained = right.clone();
        qr.q_tr_mul(&mut explained);
        let right = explained.rows(0, r.nrows()).into_owned();
        Some(Self { r, right, scale })
    }

    /// How many parameters the rows determine together.
    #[must_use]
    pub fn rank(&self) -> usize {
        let pivots = self.r.nrows().min(self.r.ncols());
        (0..pivots).filter(|&i| self.r[(i, i)].abs() >= PIVOT).count()
    }

    fn is_full(&self) -> bool {
        self.rank() == self.r.ncols()
    }

    /// The x of least squares; `None` where it is not determined.
    #[must_use]
    pub fn solution(&self) -> Option<DVector<f64>> {
        if !self.is_full() {
            return None;
        }
        let mut solution = self.r.solve_upper_triangular(&self.right)?;
        for (x, s) in solution.iter_mut().zip(&self.scale) {
            *x /= s;
        }
        solution.iter().all(|x| x.is_finite()).then_some(solution)
    }

    /// (AᵀA)⁻¹, the covariance of x for rows of unit variance; `None` where it is not determined.
    #[must_use]
    pub fn covariance(&self) -> Option<DMatrix<f64>> {
        if !self.is_full() {
            return None;
        }
        let n = self.r.ncols();
        let inverse = self.r.solve_upper_triangular(&DMatrix::identity(n, n))?;
        let mut covariance = &inverse * inverse.transpose();
        for i in 0..n {
            for j in 0..n {
                covariance[(i, j)] /= self.scale[i] * self.scale[j];
            }
        }
        Some(covariance)
    }
}

/// Solution and covariance at once; `None` where they are not determined.
#[must_use]
pub fn solve(matrix: &DMatrix<f64>, right: &DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let factorisation = Factorisation::new(matrix, right)?;
    Some((factorisation.solution()?, factorisation.covariance()?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{dmatrix, dvector};

    #[test]
    fn a_line_through_points_whatever_its_units() {
        for unit in [1.0, 1e-9, 1e9] {
            let matrix = dmatrix![1.0, 0.0; 1.0, unit; 1.0, 2.0 * unit; 1.0, 3.0 * unit];
            let (x, c) = solve(&matrix, &dvector![2.0, 5.0, 8.0, 11.0]).unwrap();
            assert!((x[0] - 2.0).abs() < 1e-12 && (x[1] * unit - 3.0).abs() < 1e-12);
            assert!((c[(0, 0)] - 0.7).abs() < 1e-12 && (c[(1, 1)] * unit * unit - 0.2).abs() < 1e-12);
        }
    }

    #[test]
    fn what_rows_do_not_tell_has_no_number() {
        let matrix = dmatrix![1.0, 2.0; 2.0, 4.0; 3.0, 6.0];
        let same = Factorisation::new(&matrix, &dvector![1.0, 2.0, 3.0]).unwrap();
        assert_eq!(same.rank(), 1);
        assert!(same.solution().is_none() && same.covariance().is_none());
        let wide = Factorisation::new(&dmatrix![1.0, 2.0], &dvector![1.0]).unwrap();
        assert!(wide.rank() == 1 && wide.solution().is_none());
        assert!(Factorisation::new(&dmatrix![1.0, 0.0], &dvector![1.0]).is_none());
    }
}
