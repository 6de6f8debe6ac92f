//! How a spinning ball is pushed aside in flight (Magnus), as far as its impacts tell the spin.
//!
//! Lift l × v beside the drag −β |v| v, with C_L = 1/(2 + v/Rω) (Štěpánek 1988; Cross and Lindsey 2014):
//!
//! ```text
//! l = (β/C_D) Rω v/(v + 2 |Rω|)
//! ```
//!
//! An impact changes the horizontal velocity by P, against the slip c of the ball's lowest point, and the spin with it
//! (Domenech 2005; s = k/(1 + k)):
//!
//! ```text
//! c = −f P/s        f = 1 where the ball leaves rolling, 1/(1 + e_x) where it grips, above 1 where it slides
//! c_r = v_r − Rω_h    c_h = v_h + Rω_r        Rω_r' = Rω_r + P_h/k    Rω_h' = Rω_h − P_r/k
//! ```
//!
//! So the spin about the vertical stays unknown, and the others are as sure as f. Where drag is not known, neither is lift.

use super::camera::NearTopView;
use super::kinematics::{SpatialLayout, spatial_motion};

/// What is known of an arc's lift beforehand: right, up, towards the camera, 1/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LiftPrior {
    /// Expected.
    pub mean: [f64; 3],
    /// Standard deviations.
    pub std: [f64; 3],
}

/// C_D of a sphere where balls fly.
const SPHERE_DRAG: f64 = 0.45;

/// f: from grip with e_x = 0.7 to a slip of twice what friction could stop.
const SLIP: f64 = 1.2;

/// Relative standard uncertainty of the lift of a known spin: of f, and of C_L from ball to ball.
const LIFT_STD_PART: f64 = 0.5;

/// Lift over drag is 0 ± this where the spin is not known: it grows with the spin, to about 2/3.
const UNKNOWN_SPIN: f64 = 0.4;

/// The same beside a spin that follows from an impact: smooth balls may have much less lift, or a slip that friction hardly
/// changed.
const KNOWN_SPIN: f64 = 0.2;

/// The lift of each arc under `drag` β, its motion being about that of `parameters` (by [`SpatialLayout`]).
pub(super) fn expected(view: &NearTopView, parameters: &[f64], times: &[f64], drag: f64) -> Vec<LiftPrior> {
    let arcs = times.len();
    let height = view.camera_height();
    let spins = (0..arcs - 1).map(|k| spins(view, parameters, times, k));
    let spins: Vec<[[f64; 2]; 2]> = spins.collect();
    (0..arcs)
        .map(|k| {
            let m = spatial_motion(view, parameters, times, k, times[k]);
            // A ball that hardly moves has some, too, so that it is determined.
            let speed = m.speed(height).max(0.01 * view.fastest_per_s() * height);
            // The spin after the impact before, and before the impact after: in flight it stays.
            let known_spins: Vec<[f64; 2]> = k
                .checked_sub(1)
                .map(|before| spins[before][1])
                .into_iter()
                .chain(spins.get(k).map(|s| s[0]))
                .collect();
            let plain = UNKNOWN_SPIN * drag * speed;
            if known_spins.is_empty() || view.drag.is_none() {
                return LiftPrior {
                    mean: [0.0; 3],
                    std: [plain; 3],
                };
            }
            let share = 1.0 / known_spins.len() as f64;
            let spin = known_spins
                .iter()
                .fold([0.0; 2], |sum, s| [sum[0] + share * s[0], sum[1] + share * s[1]]);
            let size = spin[0].hypot(spin[1]);
            let each = drag / SPHERE_DRAG * speed / (speed + 2.0 * size);
            let std = (LIFT_STD_PART * each * size).hypot(KNOWN_SPIN * drag * speed);
            LiftPrior {
                mean: [each * spin[0], each * spin[1], 0.0],
                std: [std, std, plain],
            }
        })
        .collect()
}

/// Rω (right, up) before and after impact `k`, plane units a second.
fn spins(view: &NearTopView, parameters: &[f64], times: &[f64], k: usize) -> [[f64; 2]; 2] {
    let t = parameters[SpatialLayout::new(times.len()).impact(k)];
    let at = |k: usize| spatial_motion(view, parameters, times, k, t).ground;
    let (before, after) = (at(k), at(k + 1));
    let push = [after.vr - before.vr, after.vh - before.vh];
    let inertia = view.inertia_factor;
    let slip = push.map(|p| -SLIP * p * (1.0 + inertia) / inertia);
    let incoming = [slip[1] - before.vh, before.vr - slip[0]];
    let leaving = [incoming[0] + push[1] / inertia, incoming[1] - push[0] / inertia];
    [incoming, leaving]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::drag::{Drag, DragLaw};
    use crate::geometry::PlanePoint;

    #[test]
    fn a_push_to_the_side_tells_the_spin_that_made_it() {
        let view = NearTopView {
            nadir: PlanePoint::new(0.0, 0.0),
            nadir_std: 1.0,
            fall_per_s2: 4.9,
            fall_relative_std: 0.01,
            height: Some(2000.0),
            contact: Some(0.005),
            drag: Some(Drag {
                beta: 1e-5,
                std: 1e-6,
                law: DragLaw::default(),
            }),
            inertia_factor: 0.4,
        };
        let times = [0.1, 0.3];
        let layout = SpatialLayout::new(2);
        let mut p = vec![0.0; layout.count()];
        // Along r at 1000, then at 800 and 300 to the left; at the impact neither bends.
        (p[layout.ground(0) + 1], p[layout.ground(1) + 1]) = (1000.0, 800.0);
        p[layout.ground(1) + 3] = 300.0;
        p[layout.impact(0)] = 0.2;
        let [before, after] = spins(&view, &p, &times, 0);
        // The lowest point slid forwards and to the right.
        assert!((before[0] + SLIP * 300.0 * 3.5).abs() < 1e-9, "{before:?}");
        assert!(
            (before[1] - (1000.0 - SLIP * 200.0 * 3.5)).abs() < 1e-9,
            "{before:?}"
        );
        assert!((after[0] - before[0] - 750.0).abs() < 1e-9 && (after[1] - before[1] - 500.0).abs() < 1e-9);
        let lifts = expected(&view, &p, &times, 1e-5);
        assert!(lifts[0].mean[0] < 0.0 && lifts[0].mean[0].abs() < 0.5 * 1e-5 / SPHERE_DRAG * 1100.0);
        // Nothing known of drag: nothing of lift.
        let open = NearTopView { drag: None, ..view };
        assert_eq!(expected(&open, &p, &times, 1e-5)[0].mean, [0.0; 3]);
    }
}
