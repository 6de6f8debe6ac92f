//! By how much a small disturbance moves the ball, to first order along its ideal path.
//!
//! In flight δr' = δv, δv' = a(t), the disturbing acceleration on the undisturbed path; from rest over a fall of
//! height h, drag a = K v² gives K h²/3 and buoyancy a = β g gives β h. At an impact the disturbed ball arrives
//! δt = δz / |v_oz| later (z along the floor's normal), which shifts everything after it (the "saltation matrix": Leine and Nijmeijer, Dynamics and
//! Bifurcations of Non-Smooth Mechanical Systems, 2004, ch. 7):
//!
//! ```text
//! δr⁺ = δr + (v⁻ − v⁺) δt        δv⁺ = V(v⁻ + δv + a⁻ δt) − V(v⁻) − a⁺ δt        V: the rebound model
//! ```

use super::{Ideal, Plane};
use crate::rebound::RigidMotion;
use crate::simulate::camera::{along_axis, picture_shift_px};
use crate::simulate::flight::{BallState, Impact};
use crate::simulate::scene::Scene;
use nalgebra::Vector3;

/// Steps an arc is cut into; each is integrated with the acceleration in its middle, which is good to 1e-4.
const STEPS_PER_ARC: u32 = 128;
/// An impact counts as near the transition of regimes where so many times the deviation crosses it.
const NEAR_TRANSITION: f64 = 4.0;

/// What disturbs the ball.
pub trait Disturbance {
    /// In flight, m/s².
    fn acceleration(&self, _state: &BallState, _spin_m_s: &Vector3<f64>) -> Vector3<f64> {
        Vector3::zeros()
    }

    /// At an impact on `floor`.
    fn jump(&self, _impact: &Impact, _floor: &Plane) -> Jump {
        Jump::default()
    }
}

/// What an impact adds to the deviation.
#[derive(Default)]
pub struct Jump {
    /// How much later the ball leaves, s.
    pub delay_s: f64,
    /// How much further it is when it leaves, m.
    pub shift_m: Vector3<f64>,
    /// Its largest deviation during the contact, m.
    pub transient_m: f64,
}

/// How far a disturbance moves the ball while the picture may show it, at most.
#[derive(Debug, Clone, Copy, Default)]
pub struct LargestDeviation {
    /// In the picture, px: along it, and with perspective also towards the camera.
    pub shift_px: f64,
    /// Towards the camera or away from it, m.
    pub depth_m: f64,
    /// Change of velocity as a share of the largest speed.
    pub speed_share: f64,
    /// How much later or earlier an impact is, at most, s.
    pub impact_late_s: f64,
    /// How much later or earlier the impact is over to which `stop.bounces` counts, s.
    pub late_s: f64,
}

struct PathDeviation {
    position_m: Vector3<f64>,
    velocity_m_s: Vector3<f64>,
    spin_m_s: Vector3<f64>,
}

/// The largest deviation while the picture may show the ball.
pub(super) fn largest(scene: &Scene, ideal: &Ideal, disturbance: &dyn Disturbance) -> LargestDeviation {
    let end_s = ideal.trajectory.end_s();
    let mut spin = scene.launch.surface_spin_m_s;
    let mut now = PathDeviation {
        position_m: Vector3::zeros(),
        velocity_m_s: Vector3::zeros(),
        spin_m_s: Vector3::zeros(),
    };
    let top_speed = ideal.top_speed_m_s();
    let mut most = LargestDeviation::default();
    let mut see = |time_s: f64, now: &PathDeviation, transient_m: f64| {
        let at_m = ideal.trajectory.state(time_s).position_m;
        let deviation_m = &now.position_m;
        if ideal.may_show(&at_m) {
            most.speed_share = most.speed_share.max(now.velocity_m_s.norm() / top_speed);
            let transient_px = transient_m / scene.camera.metres_per_pixel;
            most.shift_px = most
                .shift_px
                .max(picture_shift_px(&scene.camera, &at_m, deviation_m) + transient_px);
            most.depth_m = most.depth_m.max(along_axis(&scene.camera, deviation_m).abs());
        }
    };
    let floor = *ideal.trajectory.floor();
    // On a bench nothing disturbs the ball.
    let mut from_s = ideal.trajectory.launch_s();
    let (mut late_s, mut impact_late_s) = (0.0, 0.0_f64);
    let impacts = ideal.trajectory.impacts().iter().zip(1..).map(Some);
    for impact in impacts.chain([None]) {
        let to_s = impact.map_or(end_s, |(i, _)| i.time_s.min(end_s));
        let step_s = (to_s - from_s) / f64::from(STEPS_PER_ARC);
        for i in 0..STEPS_PER_ARC {
            let middle_s = from_s + (f64::from(i) + 0.5) * step_s;
            let state = ideal.trajectory.state(middle_s);
            let lies_on = ideal.trajectory.is_held(middle_s).then_some(floor);
            let acceleration = disturbance.acceleration(&state, &spin);
            fly(&mut now, acceleration, step_s, lies_on);
            see(middle_s + 0.5 * step_s, &now, 0.0);
        }
        let Some((impact, number)) = impact.filter(|(i, _)| i.time_s < end_s) else {
            break;
        };
        let jump = disturbance.jump(impact, &floor);
        see(to_s, &now, jump.transient_m);
        let late_by_s =
            floor.along_normal(&now.position_m) / floor.along_normal(&impact.incident.velocity_m_s);
        impact_late_s = impact_late_s.max(late_by_s.abs());
        let delay_s = strike(&mut now, impact, scene, &floor, &jump);
        if number == scene.stop.bounces {
            late_s = delay_s;
        }
        spin = impact.rebound.surface_spin_m_s;
        from_s = to_s;
    }
    LargestDeviation {
        late_s,
        impact_late_s,
        ..most
    }
}

/// A step of `step_s` under the disturbing acceleration `a`, m/s²; of a ball that lies, on the floor `lies_on`.
fn fly(now: &mut PathDeviation, mut a: Vector3<f64>, step_s: f64, lies_on: Option<Plane>) {
    if let Some(floor) = lies_on {
        // The floor holds it.
        a = floor.with_normal(&a, 0.0);
        now.position_m = floor.with_normal(&now.position_m, 0.0);
        now.velocity_m_s = floor.with_normal(&now.velocity_m_s, 0.0);
    }
    now.position_m += now.velocity_m_s * step_s + a * (0.5 * step_s * step_s);
    now.velocity_m_s += a * step_s;
}

/// How much later the ball leaves the floor, s.
fn strike(now: &mut PathDeviation, impact: &Impact, scene: &Scene, floor: &Plane, jump: &Jump) -> f64 {
    let down = Vector3::new(0.0, 0.0, -scene.gravity_m_s2);
    let (before, after) = (impact.incident.velocity_m_s, impact.rebound.velocity_m_s);
    // A grazing impact has no |v_oz| to divide by; its deviation is then as large as it gets.
    let late_s = -floor.along_normal(&now.position_m) / floor.along_normal(&before).min(-f64::MIN_POSITIVE);
    let disturbed = |times: f64| {
        let motion = RigidMotion {
            velocity_m_s: before + (now.velocity_m_s + down * late_s) * times,
            surface_spin_m_s: impact.incident.surface_spin_m_s + now.spin_m_s * times,
        };
        floor.impact(&scene.contact, &motion, scene.ball.inertia_factor)
    };
    // Where static friction exceeds dynamic friction the rebound jumps at the transition: near it, all disturbances
    // together may cause what one alone does not.
    let (rebound, _) = [NEAR_TRANSITION, -NEAR_TRANSITION]
        .map(disturbed)
        .into_iter()
        .find(|(_, regime)| *regime != impact.regime)
        .unwrap_or_else(|| disturbed(1.0));
    let delay_s = late_s + jump.delay_s;
    now.position_m += before * late_s - after * delay_s + jump.shift_m;
    now.velocity_m_s = rebound.velocity_m_s - after - down * delay_s;
    now.spin_m_s = rebound.surface_spin_m_s - impact.rebound.surface_spin_m_s;
    delay_s
}
