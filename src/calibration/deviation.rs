//! How lens and homography may be off together.
//!
//! A lens's parameters are strongly correlated (a longer focal length with a smaller distortion, a larger distance of the
//! plane with a longer focal length), so that deviations one by one would say far too much. A [`Deviation`] is a joint
//! change by one standard deviation along a principal axis of their covariance; several of them are independent, and
//! the sum of their outer products is the covariance. The variance that a result takes from the calibration is the
//! sum of the squares of what each of them changes in it, with everything else (ruler, origin) worked out anew.

use super::{Calibration, Lens, Scale};
use nalgebra::Matrix3;

/// A joint change of lens and homography by one standard deviation.
#[derive(Debug, Clone, PartialEq)]
pub struct Deviation {
    /// Of fx, fy, cx, cy (px), k1, k2, p1, p2, k3.
    pub lens: [f64; 9],
    /// Of the homography; `None` where the scale is another.
    pub world_from_pixel: Option<Matrix3<f64>>,
}

impl Calibration {
    /// The calibration once off by each of its [`Deviation`]s. One that makes no calibration is left out (it would take
    /// a lens whose uncertainty is as large as itself).
    #[must_use]
    pub fn deviated(&self) -> Vec<Self> {
        self.deviations.iter().filter_map(|d| self.off_by(d)).collect()
    }

    fn off_by(&self, deviation: &Deviation) -> Option<Self> {
        let mut off = self.clone();
        off.deviations.clear();
        if let Some(lens) = &self.lens {
            let mut matrix = *lens.camera_matrix();
            let mut distortion = lens.distortion();
            for (i, at) in [(0, 0), (1, 1), (0, 2), (1, 2)].into_iter().enumerate() {
                matrix[at] += deviation.lens[i];
            }
            distortion
                .iter_mut()
                .zip(&deviation.lens[4..])
                .for_each(|(k, d)| *k += d);
            off.lens = Some(Lens::new(matrix, distortion).ok()?);
        }
        if let (Scale::Homography(homography), Some(change)) = (&mut off.scale, &deviation.world_from_pixel) {
            homography.world_from_pixel += change;
        }
        off.rectification().is_ok().then_some(off)
    }
}
