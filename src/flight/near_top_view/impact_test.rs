//! Whether two fitted arcs seen from above meet in an impact.

use super::camera::NearTopView;
use super::kinematics::{SpatialLayout, spatial_motion};
use crate::flight::impact_test::MOST_ENERGY_GAIN;
use crate::flight::motion_model::ArcFit;

/// Arcs `a` and `a + 1` meet in an impact when the fit has it between their points, from a fall to a rise, and the
/// ball has not gained by it. What the fit is not sure of is no objection: a far camera hardly shows a fall.
pub(super) fn impact_between(
    fit: &ArcFit,
    view: &NearTopView,
    spans: &[(f64, f64)],
    a: usize,
    interval_s: f64,
) -> Option<f64> {
    let p = fit.parameters.as_slice();
    let t = fit.impact_time(p, a)?;
    let slack = 1.5 * interval_s;
    let in_between = t > spans[a].1 - slack && t < spans[a + 1].0 + slack;
    let (before, after) = (
        spatial_motion(view, p, &fit.times, a, t),
        spatial_motion(view, p, &fit.times, a + 1, t),
    );
    let uncertain = |k: usize| {
        let i = SpatialLayout::new(fit.arcs()).rise(k) + 1;
        SURE_SIGMAS * fit.covariance[(i, i)].max(0.0).sqrt()
    };
    let turns = before.rate < uncertain(a) && after.rate > -uncertain(a + 1);
    let height = view.camera_height();
    let most = before.speed(height) + (uncertain(a) + uncertain(a + 1)) * height;
    let loses = after.speed(height).powi(2) <= MOST_ENERGY_GAIN * most * most;
    (in_between && turns && loses).then_some(t)
}

/// A rate of rise is what it is beyond this many standard uncertainties.
const SURE_SIGMAS: f64 = 4.0;
