//! Whether two fitted arcs meet in an impact, for a camera that sees the plane of the flight from the side or from
//! afar; `near_top_view::impact_test` is the same for one that is near above.

use super::motion_model::ArcFit;

/// Kinetic energy after over before, at most, where nothing shows that spin may have added to it; the same of a fall and the rise after it.
pub(super) const MOST_ENERGY_GAIN: f64 = 1.15;

/// Friction is no more than this part of the force across the floor: what rubber reaches on rubber. So much of a spin may become speed.
const MOST_FRICTION: f64 = 1.5;

/// Two arcs meet in an impact when they come together between their points, within what is known of them.
pub(super) fn impact_between(
    fit: &ArcFit,
    spans: &[(f64, f64)],
    a: usize,
    b: usize,
    interval_s: f64,
) -> Option<f64> {
    let (t, gap) = fit.planar(fit.parameters.as_slice()).intersection(a, b)?;
    let slack = 1.5 * interval_s;
    let in_between = t > spans[a].1 - slack && t < spans[b].0 + slack;
    let m = fit.motion(a, t);
    let n = fit.motion(b, t);
    let jump = (n.vr - m.vr).hypot(n.vh - m.vh);
    // Within a frame's motion the arcs may miss each other (a soft contact, a hand-held camera), not by more.
    let close = gap < 1.5 * jump * interval_s;
    // Measured as speed at one height: the two arcs are compared at the same place.
    let (before, after) = (m.vr.hypot(m.vh), n.vr.hypot(n.vh));
    let noise = gap / interval_s;
    let gives_back = |after: f64, before: f64| after * after <= MOST_ENERGY_GAIN * (before + noise).powi(2);
    // A floor gives back no more of the fall than there was: what rises faster is another thing (a shadow, a reflection)
    // that met the ball there. Along the floor a ball with spin may leave faster than it came.
    let turns_up = m.vh < 0.0 && n.vh > 0.0 && MOST_FRICTION * (n.vh - m.vh) > (n.vr - m.vr).abs();
    let loses = if turns_up && fit.falls_in_plane() {
        gives_back(n.vh, m.vh.abs())
    } else {
        gives_back(after, before)
    };
    (in_between && close && loses).then_some(t)
}
