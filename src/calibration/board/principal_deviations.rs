//! From a covariance to the few [`Deviation`]s that matter: principal axes, by what they do to the picture.

use super::projection::CameraParameters;
use crate::calibration::Deviation;
use nalgebra::{DMatrix, DVector, Matrix3};

/// Part of the whole effect (variance) that may be left out.
const LEFT_OUT: f64 = 1e-3;
/// Differences are taken over this part of a standard deviation.
const STEP: f64 = 0.1;

/// Lens and homography.
pub(super) type LensAndHomography = (CameraParameters, Option<Matrix3<f64>>);

/// The deviations of `numbers(θ)` at θ = 0, where θ has `covariance`, ordered by their `effect` (any list of numbers of
/// one unit, such as displacements over the picture). `None` where an effect cannot be computed.
pub(super) fn principal(
    covariance: &DMatrix<f64>,
    numbers: impl Fn(&DVector<f64>) -> Option<LensAndHomography>,
    effect: impl Fn(&LensAndHomography) -> Option<Vec<f64>>,
) -> Option<Vec<Deviation>> {
    let n = covariance.nrows();
    let std = covariance.diagonal().map(|v| v.max(0.0).sqrt());
    let (mut slopes, mut effects) = (Vec::new(), Vec::new());
    for i in 0..n {
        let at = |sign: f64| {
            let mut theta = DVector::zeros(n);
            theta[i] = sign * STEP * std[i];
            let numbers = numbers(&theta)?;
            let effect = DVector::from_vec(effect(&numbers)?);
            Some((flat(&numbers), effect))
        };
        let (above, below) = (at(1.0)?, at(-1.0)?);
        // A unit of θ is a standard deviation from here on.
        slopes.push((above.0 - below.0) / (2.0 * STEP));
        effects.push((above.1 - below.1) / (2.0 * STEP));
    }
    let (slopes, effects) = (DMatrix::from_columns(&slopes), DMatrix::from_columns(&effects));
    let factor = root_of_correlation(covariance, &std);
    let svd = (effects * &factor).svd(false, true);
    let axes = svd.v_t?.transpose();
    let mut order: Vec<usize> = (0..svd.singular_values.len()).collect();
    order.sort_by(|&a, &b| svd.singular_values[b].total_cmp(&svd.singular_values[a]));
    let mut left: f64 = svd.singular_values.norm_squared();
    let limit = LEFT_OUT * left;
    let mut deviations = Vec::new();
    for k in order {
        if left <= limit {
            break;
        }
        left -= svd.singular_values[k].powi(2);
        deviations.push(deviation(&(&slopes * &factor * axes.column(k))));
    }
    Some(deviations)
}

fn flat((camera, homography): &LensAndHomography) -> DVector<f64> {
    let mut numbers: Vec<f64> = camera.iter().copied().collect();
    numbers.extend(
        homography
            .iter()
            .flat_map(|h| h.transpose().iter().copied().collect::<Vec<_>>()),
    );
    DVector::from_vec(numbers)
}

fn deviation(numbers: &DVector<f64>) -> Deviation {
    Deviation {
        lens: std::array::from_fn(|i| numbers[i]),
        world_from_pixel: (numbers.len() > 9).then(|| Matrix3::from_fn(|i, j| numbers[9 + 3 * i + j])),
    }
}

/// C with C Cᵀ the correlation matrix; what has no variance stays out of it.
fn root_of_correlation(covariance: &DMatrix<f64>, std: &DVector<f64>) -> DMatrix<f64> {
    let correlation = DMatrix::from_fn(covariance.nrows(), covariance.ncols(), |i, j| {
        let scale = std[i] * std[j];
        if scale > 0.0 {
            covariance[(i, j)] / scale
        } else {
            0.0
        }
    });
    let eigen = correlation.symmetric_eigen();
    let roots = eigen.eigenvalues.map(|x| x.max(0.0).sqrt());
    eigen.eigenvectors * DMatrix::from_diagonal(&roots)
}
