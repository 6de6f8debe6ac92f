//! Linear least squares of blocks that share some unknowns: each row tells of one block's own unknowns and of the shared ones, or of the
//! shared ones alone.
//!
//! ```text
//! | A₁       B₁ |
//! |    A₂    B₂ |     each block:  [A B] = Q | R T |     the shared unknowns from the rows | S | of all blocks and B₀
//! |       …   … |                            | 0 S |
//! |          B₀ |
//! ```
//!
//! Each block is factorised by itself, so that the work grows with the number of blocks and not with its cube. Solution, covariance and
//! rank are those of [`super::linear`] on the whole: columns are scaled to unit length, and what the rows do not determine has no number.

use super::linear::PIVOT;
use nalgebra::{DMatrix, DVector};

/// Rows, whitened: a block's own columns, then the shared ones.
#[derive(Debug, Clone)]
pub struct BlockRows {
    /// The rows.
    pub matrix: DMatrix<f64>,
    /// Their right sides.
    pub right: DVector<f64>,
}

/// A block's own unknowns: R own = right − T shared.
#[derive(Debug, Clone)]
struct Eliminated {
    r: DMatrix<f64>,
    t: DMatrix<f64>,
    right: DVector<f64>,
    scale: Vec<f64>,
}

/// A factorised problem.
#[derive(Debug, Clone)]
pub struct BlockFactorisation {
    blocks: Vec<Eliminated>,
    shared: Eliminated,
}

impl BlockFactorisation {
    /// Of `blocks`, and rows that tell of the shared unknowns alone. `None` where they do not determine all.
    #[must_use]
    pub fn new(blocks: &[BlockRows], shared: &BlockRows) -> Option<Self> {
        let count = shared.matrix.ncols();
        let mut squares = vec![0.0; count];
        let of_shared = |b: &BlockRows| b.matrix.columns(b.matrix.ncols() - count, count).into_owned();
        for rows in blocks.iter().chain([shared]) {
            for (sum, column) in squares.iter_mut().zip(of_shared(rows).column_iter()) {
                *sum += column.norm_squared();
            }
        }
        let shared_scale = scales(squares.into_iter())?;
        let mut eliminated = Vec::with_capacity(blocks.len());
        let mut rest: Vec<(DMatrix<f64>, DVector<f64>)> = Vec::with_capacity(blocks.len() + 1);
        for block in blocks {
            let own = block.matrix.ncols() - count;
            let own_columns = block.matrix.columns(0, own);
            let own_scale = scales(own_columns.column_iter().map(|c| c.norm_squared()))?;
            let all = [&own_scale[..], &shared_scale[..]].concat();
            let (r, right) = triangle(block, &all);
            let left = r.nrows().checked_sub(own)?;
            let part = Eliminated {
                r: r.view((0, 0), (own, own)).into_owned(),
                t: r.view((0, own), (own, count)).into_owned(),
                right: right.rows(0, own).into_owned(),
                scale: own_scale,
            };
            if !part.is_determined() {
                return None;
            }
            eliminated.push(part);
            let below = r.view((own, own), (left, count)).into_owned();
            rest.push((below, right.rows(own, left).into_owned()));
        }
        let mut alone = shared.matrix.clone();
        for (mut column, s) in alone.column_iter_mut().zip(&shared_scale) {
            column /= *s;
        }
        rest.push((alone, shared.right.clone()));
        let rows = rest.iter().map(|(m, _)| m.nrows()).sum();
        let mut stacked = BlockRows {
            matrix: DMatrix::zeros(rows, count),
            right: DVector::zeros(rows),
        };
        let mut row = 0;
        for (matrix, right) in &rest {
            stacked.matrix.rows_mut(row, matrix.nrows()).copy_from(matrix);
            stacked.right.rows_mut(row, right.nrows()).copy_from(right);
            row += matrix.nrows();
        }
        let (r, right) = triangle(&stacked, &vec![1.0; count]);
        if r.nrows() < count {
            return None;
        }
        let shared = Eliminated {
            r,
            t: DMatrix::zeros(count, 0),
            right: right.rows(0, count).into_owned(),
            scale: shared_scale,
        };
        shared.is_determined().then_some(Self {
            blocks: eliminated,
            shared,
        })
    }

    /// The unknowns of least squares: each block's own, then the shared ones. `None` where they are not finite.
    #[must_use]
    pub fn solution(&self) -> Option<(Vec<DVector<f64>>, DVector<f64>)> {
        let shared = self.shared.r.solve_upper_triangular(&self.shared.right)?;
        let own = |b: &Eliminated| -> Option<DVector<f64>> {
            let scaled = b.r.solve_upper_triangular(&(&b.right - &b.t * &shared))?;
            Some(unscaled(scaled, &b.scale))
        };
        let blocks: Vec<DVector<f64>> = self.blocks.iter().map(own).collect::<Option<_>>()?;
        let shared = unscaled(shared.clone(), &self.shared.scale);
        let finite = blocks
            .iter()
            .chain([&shared])
            .all(|x| x.iter().all(|x| x.is_finite()));
        finite.then_some((blocks, shared))
    }

    /// (AᵀA)⁻¹ of the whole, the covariance for rows of unit variance, in the order in which `places` puts each block's unknowns, and then
    /// the shared ones. `None` where it is not finite.
    #[must_use]
    pub fn covariance(&self, places: &[Vec<usize>]) -> Option<DMatrix<f64>> {
        let inverse = |r: &DMatrix<f64>| r.solve_upper_triangular(&DMatrix::identity(r.nrows(), r.nrows()));
        let of_shared = inverse(&self.shared.r)?;
        // A block's own unknowns are what its own rows scatter them by, and −R⁻¹ T times the error of the shared ones.
        let mut own = Vec::with_capacity(self.blocks.len() + 1);
        for b in &self.blocks {
            let alone = inverse(&b.r)?;
            let follows = -(&alone * &b.t) * &of_shared;
            own.push((Some(&alone * alone.transpose()), follows, &b.scale));
        }
        own.push((None, of_shared, &self.shared.scale));
        let n = places.iter().map(Vec::len).sum();
        let mut covariance = DMatrix::zeros(n, n);
        for (k, (alone, a, scale_a)) in own.iter().enumerate() {
            for (l, (_, b, scale_b)) in own.iter().enumerate().take(k + 1) {
                let mut part = a * b.transpose();
                if let Some(alone) = alone.as_ref().filter(|_| k == l) {
                    part += alone;
                }
                for (i, &row) in places[k].iter().enumerate() {
                    for (j, &column) in places[l].iter().enumerate() {
                        let value = part[(i, j)] / (scale_a[i] * scale_b[j]);
                        covariance[(row, column)] = value;
                        covariance[(column, row)] = value;
                    }
                }
            }
        }
        covariance
            .iter()
            .all(|c: &f64| c.is_finite())
            .then_some(covariance)
    }

    /// ln det (AᵀA)⁻¹.
    #[must_use]
    pub fn ln_determinant(&self) -> f64 {
        let of = |b: &Eliminated| {
            let pivots = b.r.diagonal();
            let pairs = pivots.iter().zip(&b.scale);
            pairs.map(|(p, s)| -2.0 * (p * s).abs().ln()).sum::<f64>()
        };
        self.blocks.iter().chain([&self.shared]).map(of).sum()
    }
}

impl Eliminated {
    fn is_determined(&self) -> bool {
        self.r.diagonal().iter().all(|p| p.abs() >= PIVOT)
    }
}

/// Lengths of columns by their squares; `None` where one is empty or not finite.
fn scales(squares: impl Iterator<Item = f64>) -> Option<Vec<f64>> {
    let lengths: Vec<f64> = squares.map(f64::sqrt).collect();
    let fine = lengths.iter().all(|&s| s > 0.0 && s.is_finite());
    fine.then_some(lengths)
}

/// R of the rows, columns divided by `scale`, and what of the right side they can explain.
fn triangle(rows: &BlockRows, scale: &[f64]) -> (DMatrix<f64>, DVector<f64>) {
    let mut scaled = rows.matrix.clone();
    for (mut column, s) in scaled.column_iter_mut().zip(scale) {
        column /= *s;
    }
    let qr = scaled.qr();
    let mut right = rows.right.clone();
    qr.q_tr_mul(&mut right);
    let r = qr.unpack_r();
    let right = right.rows(0, r.nrows()).into_owned();
    (r, right)
}

fn unscaled(mut x: DVector<f64>, scale: &[f64]) -> DVector<f64> {
    for (x, s) in x.iter_mut().zip(scale) {
        *x /= s;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::linear::solve;
    use crate::test_noise::TestNoise;

    /// Blocks of rows with unknowns of their own, and rows of the shared unknowns alone.
    fn random_blocks(units: &[f64]) -> (Vec<BlockRows>, BlockRows) {
        let mut random = TestNoise(3);
        let mut rows = |count: usize, columns: usize| BlockRows {
            matrix: DMatrix::from_fn(count, columns, |_, j| units[j % units.len()] * random.normal()),
            right: DVector::from_fn(count, |_, _| random.normal()),
        };
        let blocks = [9, 4, 20].map(|count| rows(count, 4)).to_vec();
        (blocks, rows(1, 2))
    }

    #[test]
    fn blocks_give_what_the_whole_gives() {
        for units in [[1.0, 1.0], [1e-6, 1e5]] {
            let (blocks, shared) = random_blocks(&units);
            // The whole: shared unknowns first, as a caller may have them.
            let count = blocks.iter().chain([&shared]).map(|b| b.right.nrows()).sum();
            let mut matrix = DMatrix::zeros(count, 8);
            let mut right = DVector::zeros(count);
            let mut row = 0;
            for (k, b) in blocks.iter().chain([&shared]).enumerate() {
                let n = b.right.nrows();
                let own = b.matrix.ncols() - 2;
                matrix
                    .view_mut((row, 0), (n, 2))
                    .copy_from(&b.matrix.columns(own, 2));
                matrix
                    .view_mut((row, 2 + 2 * k.min(2)), (n, own))
                    .copy_from(&b.matrix.columns(0, own));
                right.rows_mut(row, n).copy_from(&b.right);
                row += n;
            }
            let (x, c) = solve(&matrix, &right).unwrap();
            let by_blocks = BlockFactorisation::new(&blocks, &shared).unwrap();
            let (own, of_shared) = by_blocks.solution().unwrap();
            let found: Vec<f64> = of_shared.iter().chain(own.iter().flatten()).copied().collect();
            let places = [vec![2, 3], vec![4, 5], vec![6, 7], vec![0, 1]];
            let covariance = by_blocks.covariance(&places).unwrap();
            for i in 0..8 {
                assert!((found[i] - x[i]).abs() < 1e-9 * c[(i, i)].sqrt());
                for j in 0..8 {
                    let off = covariance[(i, j)] - c[(i, j)];
                    assert!(off.abs() < 1e-9 * (c[(i, i)] * c[(j, j)]).sqrt());
                }
            }
            let whole: f64 = c
                .cholesky()
                .unwrap()
                .l()
                .diagonal()
                .iter()
                .map(|d| 2.0 * d.ln())
                .sum();
            assert!((by_blocks.ln_determinant() - whole).abs() < 1e-8);
        }
    }

    #[test]
    fn what_rows_do_not_tell_has_no_number() {
        let (mut blocks, shared) = random_blocks(&[1.0]);
        let same = blocks[1].matrix.column(0).into_owned();
        blocks[1].matrix.set_column(1, &same);
        assert!(BlockFactorisation::new(&blocks, &shared).is_none());
        blocks[1].matrix.column_mut(1).fill(0.0);
        assert!(BlockFactorisation::new(&blocks, &shared).is_none());
        // Fewer rows than unknowns of its own.
        let (mut blocks, shared) = random_blocks(&[1.0]);
        blocks[0].matrix = blocks[0].matrix.rows(0, 1).into_owned();
        blocks[0].right = blocks[0].right.rows(0, 1).into_owned();
        assert!(BlockFactorisation::new(&blocks, &shared).is_none());
    }
}
