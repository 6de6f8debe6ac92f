//! How lens and homography may be off together.
//!
//! A lens's parameters are strongly correlated (a longer focal length with a smaller distortion, a larger distance of the
//! plane with a longer focal length), so that deviations one by one would say far too much. A [`Deviation`] is a joint
//! change by one standard deviation along a principal axis of their covariance; several of them are independent, and
//! the sum of their outer products is the covariance. The variance that a result takes from the calibration is the
//! sum of the squares of what each of them changes in it, with everything else (ruler, origin) worked out anew.

use nalgebra::Matrix3;

/// A joint change of lens and homography by one standard deviation.
#[derive(Debug, Clone, PartialEq)]
pub struct Deviation {
    /// Of fx, fy, cx, cy (px), k1, k2, p1, p2, k3.
    pub lens: [f64; 9],
    /// Of the homography; `None` where the scale is another.
    pub world_from_pixel: Option<Matrix3<f64>>,
}
