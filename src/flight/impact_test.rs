//! Whether two fitted arcs meet in an impact, for a camera that sees the plane of the flight from the side or from
//! afar; `near_top_view::impact_test` is the same for one that is near above.

use super::motion_model::ArcFit;

/// A bounce may turn spin into speed, but not make much: kinetic energy after over before, at most.
pub(super) const MOST_ENERGY_GAIN: f64 = 1.15;

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
    let loses = after * after <= MOST_ENERGY_GAIN * (before + noise) * (before + noise);
    // A floor gives back no more of the fall than there was: what rises faster is another thing (a shadow, a reflection)
    // that met the ball there.
    let falls = m.vh < 0.0 && n.vh > 0.0 && n.vh - m.vh > (n.vr - m.vr).abs();
    let rises_less = !falls || n.vh * n.vh <= MOST_ENERGY_GAIN * (m.vh.abs() + noise).powi(2);
    (in_between && close && loses && rises_less).then_some(t)
}
