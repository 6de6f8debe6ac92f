//! Numerical flight against closed forms.

use super::*;
use nalgebra::Vector2;

const G: f64 = 9.81;
/// The relative tolerance, of the 100 m from which these balls start.
const FAR: f64 = 100.0 * 1e-10;

/// −c v, N.
struct LinearDrag(f64);
/// −c v |v|, N.
struct QuadraticDrag(f64);
/// c (Rω × v), N.
struct ConstantLift(f64);
/// Nothing.
struct None_;

impl Force for LinearDrag {
    fn act(&self, state: &BallState, _: &Vector3<f64>, loads: &mut Loads) {
        loads.force_n -= state.velocity_m_s * self.0;
    }
}
impl Force for QuadraticDrag {
    fn act(&self, state: &BallState, _: &Vector3<f64>, loads: &mut Loads) {
        loads.force_n -= state.velocity_m_s * (self.0 * state.velocity_m_s.norm());
    }
}
impl Force for ConstantLift {
    fn act(&self, state: &BallState, spin: &Vector3<f64>, loads: &mut Loads) {
        loads.force_n += spin.cross(&state.velocity_m_s) * self.0;
    }
}
impl Force for None_ {
    fn act(&self, _: &BallState, _: &Vector3<f64>, _: &mut Loads) {}
}

fn scene(gravity_m_s2: f64) -> Scene {
    let text = r#"{"schema": "track.scene/1", "contact": {"model": "mu_e", "restitution": 0.9, "friction": 0.1},
                   "ball": {"mass_kg": 1.0}}"#;
    Scene {
        gravity_m_s2,
        ..Scene::from_json(text).unwrap()
    }
}

/// The state after `time_s` of flight from 100 m, far from the floor.
fn flown(
    gravity_m_s2: f64,
    force: Box<dyn Force>,
    velocity: Vector3<f64>,
    spin: Vector3<f64>,
    time_s: f64,
    relative_tolerance: f64,
    steps: f64,
) -> BallState {
    let scene = scene(gravity_m_s2);
    let forces = [Acting::of(force)];
    let equations = MotionEquations {
        scene: &scene,
        forces: &forces,
        spin,
        floor: Plane::LEVEL,
        integration: Integration {
            relative_tolerance,
            fixed_step_s: None,
        },
    };
    let start = BallState {
        position_m: Vector3::new(0.0, 0.0, 100.0),
        velocity_m_s: velocity,
    };
    let step_s = time_s / steps;
    let nodes = equations.integrate(&start, step_s, time_s * 1.5).unwrap();
    let path = FlightPhase {
        start_s: 0.0,
        start,
        path: PhasePath::Nodes { step_s, nodes },
        turning: Turning {
            start: UnitQuaternion::identity(),
            spin_rad_s: spin,
            change_rad_s2: Vector3::zeros(),
        },
    };
    path.state(time_s)
}

fn tight(
    gravity: f64,
    force: Box<dyn Force>,
    velocity: Vector3<f64>,
    spin: Vector3<f64>,
    time_s: f64,
) -> BallState {
    flown(gravity, force, velocity, spin, time_s, RELATIVE_TOLERANCE, 100.3)
}

#[test]
fn val_stokes_drag() {
    // m v' = -m g - c v from (3, 0, 4): exponentials with 1/c.
    let (c, t) = (0.7, 1.3);
    let end = tight(
        G,
        Box::new(LinearDrag(c)),
        Vector3::new(3.0, 0.0, 4.0),
        Vector3::zeros(),
        t,
    );
    let left = (-c * t).exp();
    let sinking = G / c;
    let x = 3.0 / c * (1.0 - left);
    let z = 100.0 - sinking * t + (4.0 + sinking) / c * (1.0 - left);
    assert!((end.position_m - Vector3::new(x, 0.0, z)).norm() < 1e-10);
    assert!((end.velocity_m_s.x - 3.0 * left).abs() < 1e-10);
}

#[test]
fn val_quadratic_drag_in_vertical_fall() {
    let (c, t) = (0.3_f64, 1.7);
    let terminal = (G / c).sqrt();
    let end = tight(
        G,
        Box::new(QuadraticDrag(c)),
        Vector3::zeros(),
        Vector3::zeros(),
        t,
    );
    let landed = -terminal * (G * t / terminal).tanh();
    assert!(
        (end.velocity_m_s.z - landed).abs() < FAR,
        "{} {landed}",
        end.velocity_m_s.z
    );
    let fallen = terminal * terminal / G * (G * t / terminal).cosh().ln();
    assert!((end.position_m.z - (100.0 - fallen)).abs() < 1e-10);
}

#[test]
fn val_magnus_circle() {
    // Spin along z, no gravity to speak of: the ball circles to the left with m v / (c R w).
    let (c, spin, speed, t) = (0.4, 5.0, 3.0, 2.0);
    let end = tight(
        1e-12,
        Box::new(ConstantLift(c)),
        Vector3::new(speed, 0.0, 0.0),
        Vector3::new(0.0, 0.0, spin),
        t,
    );
    let rate = c * spin;
    let radius = speed / rate;
    let expected = Vector2::new(radius * (rate * t).sin(), radius * (1.0 - (rate * t).cos()));
    assert!(
        (end.position_m.xy() - expected).norm() < 1e-10,
        "{end:?} {expected}"
    );
    assert!((end.velocity_m_s.norm() - speed).abs() < 1e-10);
}

#[test]
fn lift_does_no_work() {
    let velocity = Vector3::new(2.0, -1.0, 5.0);
    let end = tight(
        G,
        Box::new(ConstantLift(0.2)),
        velocity,
        Vector3::new(3.0, -2.0, 1.0),
        1.9,
    );
    let energy = |s: &BallState| 0.5 * s.velocity_m_s.norm_squared() + G * s.position_m.z;
    let start = BallState {
        position_m: Vector3::new(0.0, 0.0, 100.0),
        velocity_m_s: velocity,
    };
    assert!(
        (energy(&end) - energy(&start)).abs() < G * FAR,
        "{} {}",
        energy(&end),
        energy(&start)
    );
}

#[test]
fn without_a_force_the_flight_is_the_parabola() {
    let scene = scene(G);
    let acts = Perturbations {
        forces: vec![Acting::of(Box::new(None_))],
        ..Perturbations::default()
    };
    let numerical = Trajectory::new(&scene, &acts).unwrap();
    let exact = Trajectory::new(&scene, &Perturbations::default()).unwrap();
    for (n, e) in numerical.impacts().iter().zip(exact.impacts()) {
        assert!((n.time_s - e.time_s).abs() < 1e-11, "{} {}", n.time_s, e.time_s);
        assert!((n.incident.velocity_m_s - e.incident.velocity_m_s).norm() < 1e-10);
    }
    for i in 0..200 {
        let t = f64::from(i) * exact.end_s() / 200.0;
        let apart = numerical.state(t).position_m - exact.state(t).position_m;
        assert!(apart.norm() < 1e-11, "{t}: {apart}");
    }
}

#[test]
fn the_error_follows_the_tolerance() {
    // An adaptive method of order 8 keeps the error in proportion to the tolerance: slope 1 in log-log.
    let (c, t) = (0.3_f64, 1.7);
    let terminal = (G / c).sqrt();
    let fallen = terminal * terminal / G * (G * t / terminal).cosh().ln();
    let error = |tolerance: f64| {
        let end = flown(
            G,
            Box::new(QuadraticDrag(c)),
            Vector3::zeros(),
            Vector3::zeros(),
            t,
            tolerance,
            1000.3,
        );
        (end.position_m.z - (100.0 - fallen)).abs()
    };
    let errors = [1e-6, 1e-8, 1e-10].map(error);
    let slope = (errors[0] / errors[2]).log10() / 4.0;
    assert!((0.6..1.5).contains(&slope), "{errors:?}: {slope}");
}

#[test]
fn between_nodes_the_error_is_of_sixth_order() {
    let (c, spin, speed, t) = (0.4, 5.0, 3.0, 2.0);
    let rate = c * spin;
    let radius = speed / rate;
    let error = |steps: f64| {
        let end = flown(
            1e-12,
            Box::new(ConstantLift(c)),
            Vector3::new(speed, 0.0, 0.0),
            Vector3::new(0.0, 0.0, spin),
            t,
            1e-13,
            steps,
        );
        let expected = Vector2::new(radius * (rate * t).sin(), radius * (1.0 - (rate * t).cos()));
        (end.position_m.xy() - expected).norm()
    };
    // Half-way between nodes, where a quintic is at its worst.
    let order = (error(4.5) / error(18.5)).ln() / (18.5_f64 / 4.5).ln();
    assert!((order - 6.0).abs() < 0.4, "{order}");
}
