//! Where in the picture the board was seen, and how sure the lens is there and elsewhere.

use super::lens_fit::{LensFit, lens};
use super::projection::CameraParameters;
use crate::geometry::PixelPoint;
use nalgebra::{SMatrix, SVector};

/// Columns and rows of the picture's division.
pub const CELLS: (usize, usize) = (12, 8);

/// Coverage of the picture, and the uncertainty of the undistorted place of each of its points.
#[derive(Debug, Clone, PartialEq)]
pub struct Coverage {
    /// Row by row: whether the cell holds a corner in use.
    pub cells: Vec<bool>,
    /// Standard uncertainty of the distortion at the middle of each cell, px.
    pub std_px: Vec<f64>,
    /// The same at its worst place, which is at the rim.
    pub worst_std_px: f64,
    /// That place.
    pub worst_at: PixelPoint,
}

impl Coverage {
    pub(super) fn new(
        size: (usize, usize),
        corners: impl Iterator<Item = PixelPoint>,
        fit: &LensFit,
    ) -> Self {
        let (width, height) = (size.0 as f64, size.1 as f64);
        let mut cells = vec![false; CELLS.0 * CELLS.1];
        for p in corners {
            let at = |x: f64, size: f64, cells: usize| {
                (((x + 0.5) / size * cells as f64).floor().max(0.0) as usize).min(cells - 1)
            };
            cells[at(p.v_px, height, CELLS.1) * CELLS.0 + at(p.u_px, width, CELLS.0)] = true;
        }
        let place = |part_u: f64, part_v: f64| PixelPoint::new(part_u * width - 0.5, part_v * height - 0.5);
        let std_px = (0..cells.len())
            .map(|k| {
                let (column, row) = ((k % CELLS.0) as f64 + 0.5, (k / CELLS.0) as f64 + 0.5);
                std_at(fit, place(column / CELLS.0 as f64, row / CELLS.1 as f64))
            })
            .collect();
        let rim = (0..=16).flat_map(|i| {
            let part = f64::from(i) / 16.0;
            [
                place(part, 0.0),
                place(part, 1.0),
                place(0.0, part),
                place(1.0, part),
            ]
        });
        let (worst_std_px, worst_at) =
            rim.map(|p| (std_at(fit, p), p))
                .fold((0.0, place(0.5, 0.5)), |worst, here| {
                    if here.0 > worst.0 { here } else { worst }
                });
        Self {
            cells,
            std_px,
            worst_std_px,
            worst_at,
        }
    }

    /// Part of the picture's cells that hold a corner.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.cells.iter().filter(|&&c| c).count() as f64 / self.cells.len() as f64
    }
}

/// Standard uncertainty of the undistorted place of `seen`, px: the larger half axis of its ellipse.
fn std_at(fit: &LensFit, seen: PixelPoint) -> f64 {
    let Some(by_camera) = undistortion_by_camera(&fit.camera, seen) else {
        return f64::INFINITY;
    };
    let covariance = by_camera * fit.covariance * by_camera.transpose();
    covariance.symmetric_eigenvalues().max().max(0.0).sqrt()
}

/// d(undistorted u, v)/d(camera) at a point of the picture, by differences.
pub(super) fn undistortion_by_camera(
    camera: &CameraParameters,
    seen: PixelPoint,
) -> Option<SMatrix<f64, 2, 9>> {
    let mut by_camera = SMatrix::<f64, 2, 9>::zeros();
    for i in 0..9 {
        // Pixels and coefficients: both displace by some px a unit of this step.
        let step = if i < 4 { 1e-2 } else { 1e-6 };
        let at = |h: f64| {
            let mut c = *camera;
            c[i] += h;
            let p = lens(&c)?.undistort(seen)?;
            Some(SVector::from([p.u_px, p.v_px]))
        };
        let slope: SVector<f64, 2> = (at(step)? - at(-step)?) / (2.0 * step);
        by_camera.set_column(i, &slope);
    }
    Some(by_camera)
}
