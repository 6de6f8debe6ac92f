//! Where the ball is at any time: the exact parabola, or a numerical flight where forces beyond gravity act; impacts
//! where the centre is R from the floor between them.
//!
//! # Parabola
//!
//! z(t) = z_0 + v_z t − g t²/2 meets the floor at height h below its start after t = (v_z + d)/g for v_z ≥ 0,
//! t = 2 h / (d − v_z) otherwise, with d = sqrt(v_z² + 2 g h): neither subtracts nearly equal numbers. It lands with
//! exactly −d. Over a sloping floor the same holds along its normal, with g cos s ([`Plane`]).
//!
//! # Bench
//!
//! Where the ball is seen on a bench, t = 0 is the beginning of that: at constant height and speed until it is launched from
//! x = 0.
//!
//! # Forces
//!
//! (m + m_a) a = m g + ΣF, with the added mass m_a of the air that moves along. Integrated by Dormand-Prince 8(5,3)
//! (Hairer, Nørsett, Wanner, Solving ODEs I, II.5) whose dense output gives nodes; between nodes position, velocity and
//! acceleration at both ends fix a quintic, whose root is the impact.
//!
//! # Spin
//!
//! Between impacts the spin stays as it is, about an axis that stays in the world; the rotation follows (`turning`). While
//! ball and floor touch it changes evenly from what it was to what it will be.
//!
//! # Piling up
//!
//! A ball with e < 1 bounces infinitely often in finite time (Zeno). A hop shorter than [`SHORTEST_HOP_S`], 12 nm
//! high, is no longer followed: the ball stays on the floor and keeps its horizontal velocity; on a slope it rolls downhill.

use super::effects::{Acting, ContactLaw, Dip, Force, Loads, Plane};
use super::scene::{Scene, SceneError};
use super::turning::Turning;
use crate::rebound::{Regime, RigidMotion};
use nalgebra::{UnitQuaternion, Vector3, Vector6};
use ode_solvers::{Dop853, OutputType, System};

/// Hops shorter than this are not followed, s; their height g t²/8 is 12 nm.
pub const SHORTEST_HOP_S: f64 = 1e-4;
/// A ball that flies longer than this counts as never landing, s.
pub const LONGEST_FLIGHT_S: f64 = 60.0;
/// Relative tolerance of the integrator; a path of 10 m is good to far below 1e-6 px.
pub const RELATIVE_TOLERANCE: f64 = 1e-11;
/// Length (m) and speed (m/s) below which the tolerance is absolute.
const ABSOLUTE_M: f64 = 0.01;
/// Nodes a flight between two impacts, and their largest distance: between them a quintic is exact to 1e-13 m.
const NODES_PER_HOP: f64 = 48.0;
const LONGEST_NODE_S: f64 = 2e-3;

/// An impact on the floor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Impact {
    /// When the ball touches, s.
    pub time_s: f64,
    /// Its centre then, m; R from the floor.
    pub place_m: Vector3<f64>,
    /// Just before.
    pub incident: RigidMotion,
    /// Just after.
    pub rebound: RigidMotion,
    /// What the contact point did.
    pub regime: Regime,
    /// How long they touch, s; 0 for a rigid impact.
    pub contact_s: f64,
}

/// Position and velocity of the centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BallState {
    /// m.
    pub position_m: Vector3<f64>,
    /// m/s.
    pub velocity_m_s: Vector3<f64>,
}

/// The whole way of the ball from t = 0 on: the launch, or the beginning of what is seen of the bench.
#[derive(Debug, Clone)]
pub struct Trajectory {
    floor: Plane,
    launch_s: f64,
    phases: Vec<FlightPhase>,
    impacts: Vec<Impact>,
    end_s: f64,
}

#[derive(Debug, Clone)]
struct FlightPhase {
    start_s: f64,
    start: BallState,
    path: PhasePath,
    turning: Turning,
}

/// A flight between two impacts, or from the launch to the first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpinningArc {
    /// When it begins, s.
    pub from_s: f64,
    /// When it ends, or the recording does, s.
    pub to_s: f64,
    /// ω, about the axes of the ball's own plane of motion, rad/s.
    pub spin_rad_s: Vector3<f64>,
}

#[derive(Debug, Clone)]
enum PhasePath {
    Parabola {
        gravity_m_s2: f64,
    },
    Nodes {
        step_s: f64,
        nodes: Vec<PathNode>,
    },
    /// In the floor's frame.
    Contact {
        dip: Dip,
        floor: Plane,
    },
    /// On the bench or on the floor, with this acceleration, m/s².
    Held {
        along: Vector3<f64>,
    },
}

/// Position, velocity and acceleration at a time.
#[derive(Debug, Clone, Copy)]
struct PathNode {
    position: Vector3<f64>,
    velocity: Vector3<f64>,
    acceleration: Vector3<f64>,
}

/// What acts on the ball beyond gravity and the rigid impact.
#[derive(Default)]
pub struct Perturbations {
    /// In flight.
    pub forces: Vec<Acting<dyn Force>>,
    /// At the impact.
    pub contact: Option<Acting<dyn ContactLaw>>,
    /// How long the ball is seen on a bench before the launch, s.
    pub bench_s: Option<Acting<f64>>,
    /// The floor, where it is not level.
    pub floor: Option<Acting<Plane>>,
}

/// How a flight with forces is integrated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Integration {
    /// Error that a step may have, relative to position and speed.
    pub relative_tolerance: f64,
    /// Steps of this length whatever their error, s: to see the method's order. `None`: as long as the tolerance lets them
    /// be.
    pub fixed_step_s: Option<f64>,
}

impl Default for Integration {
    fn default() -> Self {
        Self {
            relative_tolerance: RELATIVE_TOLERANCE,
            fixed_step_s: None,
        }
    }
}

impl Trajectory {
    /// Follows the ball of `scene` under `acts` until the recording ends, and at least to the second impact.
    ///
    /// # Errors
    /// [`SceneError::NeverLands`].
    pub fn new(scene: &Scene, acts: &Perturbations) -> Result<Self, SceneError> {
        Self::integrated(scene, acts, Integration::default())
    }

    /// As [`Trajectory::new`], integrated as `integration` says.
    ///
    /// # Errors
    /// [`SceneError::NeverLands`].
    pub fn integrated(
        scene: &Scene,
        acts: &Perturbations,
        integration: Integration,
    ) -> Result<Self, SceneError> {
        let follower = FlightFollower {
            scene,
            acts,
            floor: acts.floor.as_ref().map_or(Plane::LEVEL, |f| *f.apply()),
            integration,
            first_orientation: first_orientation(scene, acts),
            phases: Vec::new(),
            impacts: Vec::new(),
        };
        follower.run()
    }

    /// Impacts in time order: all of the recording, and the second one even where it is later.
    #[must_use]
    pub fn impacts(&self) -> &[Impact] {
        &self.impacts
    }

    /// When the recording ends, s.
    #[must_use]
    pub fn end_s(&self) -> f64 {
        self.end_s
    }

    /// When the ball is launched, s: 0 where it is not seen on a bench before.
    #[must_use]
    pub fn launch_s(&self) -> f64 {
        self.launch_s
    }

    /// The floor on which it bounces.
    #[must_use]
    pub fn floor(&self) -> &Plane {
        &self.floor
    }

    /// Whether the ball lies or rolls at `time_s`, on the bench or on the floor.
    #[must_use]
    pub fn is_held(&self, time_s: f64) -> bool {
        matches!(self.phase(time_s).path, PhasePath::Held { .. })
    }

    /// Position and velocity at `time_s`; before t = 0 the first phase, parabola or bench, is continued backwards.
    #[must_use]
    pub fn state(&self, time_s: f64) -> BallState {
        self.phase(time_s).state(time_s)
    }

    /// The rotation that takes directions fixed to the ball into the axes of its own plane of motion (x along the launch, z up) at
    /// `time_s`. At the launch it is that of the scene's marks, or none.
    #[must_use]
    pub fn orientation(&self, time_s: f64) -> UnitQuaternion<f64> {
        let phase = self.phase(time_s);
        phase.turning.at(time_s - phase.start_s)
    }

    /// ω in the same axes at `time_s`, rad/s: y is above 0 where the top of the ball moves along +x.
    #[must_use]
    pub fn spin_rad_s(&self, time_s: f64) -> Vector3<f64> {
        let phase = self.phase(time_s);
        phase.turning.spin_at(time_s - phase.start_s)
    }

    /// The flights of the recording, in their order.
    pub fn arcs(&self) -> impl Iterator<Item = SpinningArc> + '_ {
        let ends = self.phases.iter().skip(1).map(|next| next.start_s);
        let flies = |p: &FlightPhase| matches!(p.path, PhasePath::Parabola { .. } | PhasePath::Nodes { .. });
        (self.phases.iter())
            .zip(ends.chain([f64::INFINITY]))
            .filter(move |(phase, _)| flies(phase) && phase.start_s < self.end_s)
            .map(|(phase, end_s)| SpinningArc {
                from_s: phase.start_s,
                to_s: end_s.min(self.end_s),
                spin_rad_s: phase.turning.spin_rad_s,
            })
    }

    fn phase(&self, time_s: f64) -> &FlightPhase {
        let after = self.phases.partition_point(|p| p.start_s <= time_s);
        // There is always a first phase: `FlightFollower::run` starts with one.
        &self.phases[after.saturating_sub(1)]
    }

    /// Where the path has kinks between `from_s` and `to_s`: impacts and the ends of contacts, s.
    pub fn kinks(&self, from_s: f64, to_s: f64) -> impl Iterator<Item = f64> + '_ {
        let first = self.phases.partition_point(|p| p.start_s <= from_s);
        self.phases[first..]
            .iter()
            .map(|p| p.start_s)
            .take_while(move |s| *s < to_s)
    }
}

impl FlightPhase {
    fn state(&self, time_s: f64) -> BallState {
        let t = time_s - self.start_s;
        match &self.path {
            PhasePath::Parabola { gravity_m_s2 } => fall(&self.start, &down(*gravity_m_s2), t),
            PhasePath::Held { along } => fall(&self.start, &-along, t),
            PhasePath::Contact { dip, floor } => {
                let (offset_m, velocity_m_s) = dip.at(t);
                BallState {
                    position_m: self.start.position_m + floor.out_of_frame(&offset_m),
                    velocity_m_s: floor.out_of_frame(&velocity_m_s),
                }
            }
            PhasePath::Nodes { step_s, nodes } => {
                // Before the first and beyond the last node their own quintics are continued.
                let segment = ((t / step_s).floor().max(0.0) as usize).min(nodes.len() - 2);
                quintic(
                    &nodes[segment],
                    &nodes[segment + 1],
                    *step_s,
                    t - segment as f64 * step_s,
                )
            }
        }
    }
}

fn down(gravity_m_s2: f64) -> Vector3<f64> {
    Vector3::new(0.0, 0.0, gravity_m_s2)
}

/// With the constant acceleration −`down`, m/s².
fn fall(start: &BallState, down: &Vector3<f64>, t: f64) -> BallState {
    BallState {
        position_m: start.position_m + start.velocity_m_s * t - down * (0.5 * t * t),
        velocity_m_s: start.velocity_m_s - down * t,
    }
}

/// The quintic through two nodes `step` apart, at `t` after the first.
fn quintic(from: &PathNode, to: &PathNode, step: f64, t: f64) -> BallState {
    // In the basis of Taylor's polynomial at the first node plus s³ (A + B s + C s²), s = t / step.
    let s = t / step;
    let gap = to.position - from.position - from.velocity * step - from.acceleration * (0.5 * step * step);
    let slope = (to.velocity - from.velocity - from.acceleration * step) * step;
    let bend = (to.acceleration - from.acceleration) * (step * step);
    let a = gap * 10.0 - slope * 4.0 + bend * 0.5;
    let b = gap * -15.0 + slope * 7.0 - bend;
    let c = gap * 6.0 - slope * 3.0 + bend * 0.5;
    let cubed = s * s * s;
    BallState {
        position_m: from.position
            + from.velocity * t
            + from.acceleration * (0.5 * t * t)
            + (a + (b + c * s) * s) * cubed,
        velocity_m_s: from.velocity
            + from.acceleration * t
            + (a * 3.0 + (b * 4.0 + c * (5.0 * s)) * s) * (s * s / step),
    }
}

/// Follows a ball from phase to phase.
struct FlightFollower<'a> {
    scene: &'a Scene,
    acts: &'a Perturbations,
    floor: Plane,
    integration: Integration,
    /// World from ball at t = 0.
    first_orientation: UnitQuaternion<f64>,
    phases: Vec<FlightPhase>,
    impacts: Vec<Impact>,
}

/// The ball meets the floor after `flight_s`, at `state`.
struct Landing {
    flight_s: f64,
    state: BallState,
}

impl FlightFollower<'_> {
    fn run(mut self) -> Result<Trajectory, SceneError> {
        let launch = &self.scene.launch;
        let mut spin = launch.surface_spin_m_s;
        let mut time_s = 0.0;
        let mut state = BallState {
            position_m: Vector3::new(0.0, 0.0, launch.drop_height_m + self.scene.ball.radius_m),
            velocity_m_s: Vector3::new(launch.speed_m_s, 0.0, launch.rise_speed_m_s),
        };
        if let Some(bench_s) = &self.acts.bench_s {
            let bench_s = *bench_s.apply();
            let mut start = state;
            start.position_m.x = -launch.speed_m_s * bench_s;
            let along = Vector3::zeros();
            self.push(time_s, start, PhasePath::Held { along }, spin, Vector3::zeros());
            time_s = bench_s;
        }
        let launch_s = time_s;
        let mut rest_s = None;
        // Bounded: every turn takes at least SHORTEST_HOP_S, or is the last.
        while !self.is_complete(time_s) {
            let Some((path, landing)) = self.fly(&state, spin)? else {
                if self.impacts.is_empty() {
                    return Err(never_lands("it lies on the floor from the start"));
                }
                rest_s = Some(time_s);
                self.lie_down(time_s, state, spin);
                break;
            };
            self.push(time_s, state, path, spin, Vector3::zeros());
            let impact = self.strike(time_s + landing.flight_s, &landing.state, spin);
            (time_s, state) = self.leave(impact);
            spin = impact.rebound.surface_spin_m_s;
        }
        let stopped_s = self.last_counted_s().or(rest_s).unwrap_or(time_s);
        Ok(Trajectory {
            floor: self.floor,
            launch_s,
            end_s: stopped_s + self.scene.stop.tail_s,
            phases: self.phases,
            impacts: self.impacts,
        })
    }

    /// Begins a phase with the surface speed `spin_m_s`, R ω, which grows by `gain_m_s2`.
    fn push(
        &mut self,
        start_s: f64,
        start: BallState,
        path: PhasePath,
        spin_m_s: Vector3<f64>,
        gain_m_s2: Vector3<f64>,
    ) {
        let before = self.phases.last();
        let radius_m = self.scene.ball.radius_m;
        let turning = Turning {
            start: before.map_or(self.first_orientation, |p| p.turning.at(start_s - p.start_s)),
            spin_rad_s: spin_m_s / radius_m,
            change_rad_s2: gain_m_s2 / radius_m,
        };
        self.phases.push(FlightPhase {
            start_s,
            start,
            path,
            turning,
        });
    }

    /// When the impact that `stop.bounces` counts to was over.
    fn last_counted_s(&self) -> Option<f64> {
        self.impacts
            .get(self.scene.stop.bounces - 1)
            .map(|i| i.time_s + i.contact_s)
    }

    /// Whether the recording has ended by `time_s` (a frame's exposure later), and the second impact is known.
    fn is_complete(&self, time_s: f64) -> bool {
        let margin_s = self.scene.stop.tail_s + 1.0 / self.scene.camera.frame_rate_hz;
        self.impacts.len() >= 2 && self.last_counted_s().is_some_and(|last| time_s > last + margin_s)
    }

    /// The path of a flight that starts at `start`, and how it ends; `None` where the hop is too short to follow.
    fn fly(&self, start: &BallState, spin: Vector3<f64>) -> Result<Option<(PhasePath, Landing)>, SceneError> {
        let g = self.scene.gravity_m_s2;
        let (place_m, rise_m_s) = (
            self.floor.along_normal(&start.position_m),
            self.floor.along_normal(&start.velocity_m_s),
        );
        let height_m = (place_m - self.scene.ball.radius_m).max(0.0);
        let (flight_s, landing_speed) = time_to_floor(height_m, rise_m_s, self.floor.gravity_towards(g));
        if flight_s < SHORTEST_HOP_S {
            return Ok(None);
        }
        if !self.acts.forces.is_empty() {
            return self.fly_with_forces(start, spin, flight_s);
        }
        if flight_s > LONGEST_FLIGHT_S {
            return Err(never_lands(&format!("it would fly for {flight_s:.3e} s")));
        }
        let reached = fall(start, &down(g), flight_s);
        let state = BallState {
            position_m: self
                .floor
                .with_normal(&reached.position_m, self.scene.ball.radius_m),
            velocity_m_s: self.floor.with_normal(&reached.velocity_m_s, -landing_speed),
        };
        Ok(Some((
            PhasePath::Parabola { gravity_m_s2: g },
            Landing { flight_s, state },
        )))
    }

    fn fly_with_forces(
        &self,
        start: &BallState,
        spin: Vector3<f64>,
        parabola_s: f64,
    ) -> Result<Option<(PhasePath, Landing)>, SceneError> {
        let equations = MotionEquations {
            scene: self.scene,
            forces: &self.acts.forces,
            spin,
            floor: self.floor,
            integration: self.integration,
        };
        let step_s = (parabola_s / NODES_PER_HOP).min(LONGEST_NODE_S);
        // Forces change the time of flight: longer and longer horizons until the ball is down.
        let mut horizon_s = 1.5 * parabola_s;
        loop {
            let nodes = equations.integrate(start, step_s, horizon_s)?;
            match find_landing(&nodes, step_s, &self.floor, self.scene.ball.radius_m) {
                FlightEnd::Landing(landing) => {
                    return Ok(Some((PhasePath::Nodes { step_s, nodes }, landing)));
                }
                FlightEnd::Graze => return Ok(None),
                FlightEnd::StillFlying if horizon_s < LONGEST_FLIGHT_S => {
                    horizon_s = (2.0 * horizon_s).min(LONGEST_FLIGHT_S);
                }
                FlightEnd::StillFlying => {
                    let place_m = nodes.last().map_or(0.0, |n| self.floor.along_normal(&n.position));
                    let height_m = place_m - self.scene.ball.radius_m;
                    return Err(never_lands(&format!(
                        "after {LONGEST_FLIGHT_S:.0} s it is {height_m:.3} m above the floor"
                    )));
                }
            }
        }
    }

    fn strike(&self, time_s: f64, landed: &BallState, spin: Vector3<f64>) -> Impact {
        let incident = RigidMotion {
            velocity_m_s: landed.velocity_m_s,
            surface_spin_m_s: spin,
        };
        let (rebound, regime) =
            self.floor
                .impact(&self.scene.contact, &incident, self.scene.ball.inertia_factor);
        Impact {
            time_s,
            place_m: landed.position_m,
            incident,
            rebound,
            regime,
            contact_s: 0.0,
        }
    }

    /// Records `impact`, and tells when and how the ball leaves the floor.
    fn leave(&mut self, mut impact: Impact) -> (f64, BallState) {
        let mut leaving = BallState {
            position_m: impact.place_m,
            velocity_m_s: impact.rebound.velocity_m_s,
        };
        let (incident, rebound) = (
            self.floor.motion_in_frame(&impact.incident),
            self.floor.motion_in_frame(&impact.rebound),
        );
        let dip = self
            .acts
            .contact
            .as_ref()
            .and_then(|law| law.apply().dip(&incident, &rebound));
        if let Some(dip) = dip {
            impact.contact_s = dip.duration_s();
            leaving.position_m += self.floor.out_of_frame(&dip.at(impact.contact_s).0);
            leaving.position_m = self
                .floor
                .with_normal(&leaving.position_m, self.scene.ball.radius_m);
            let touching = BallState {
                velocity_m_s: impact.incident.velocity_m_s,
                ..leaving
            };
            self.push(
                impact.time_s,
                BallState {
                    position_m: impact.place_m,
                    ..touching
                },
                PhasePath::Contact {
                    dip,
                    floor: self.floor,
                },
                impact.incident.surface_spin_m_s,
                (impact.rebound.surface_spin_m_s - impact.incident.surface_spin_m_s) / impact.contact_s,
            );
        }
        self.impacts.push(impact);
        (impact.time_s + impact.contact_s, leaving)
    }

    /// The ball stays on the floor and keeps its velocity along it and its spin, but for what a slope adds to both: rolling friction is
    /// not modelled.
    fn lie_down(&mut self, start_s: f64, state: BallState, spin: Vector3<f64>) {
        let lying = BallState {
            position_m: self
                .floor
                .with_normal(&state.position_m, self.scene.ball.radius_m),
            velocity_m_s: self.floor.with_normal(&state.velocity_m_s, 0.0),
        };
        let along = self
            .floor
            .rolling_acceleration(self.scene.gravity_m_s2, self.scene.ball.inertia_factor);
        // v = R ω × n without slip.
        let gain = self.floor.out_of_frame(&Vector3::z()).cross(&along);
        self.push(start_s, lying, PhasePath::Held { along }, spin, gain);
    }
}

/// World from ball at t = 0: that of the launch, turned back by what it rolled on the bench.
fn first_orientation(scene: &Scene, acts: &Perturbations) -> UnitQuaternion<f64> {
    let at_launch =
        (scene.look.marks.as_ref()).map_or_else(UnitQuaternion::identity, |marks| marks.at_launch);
    let bench_s = acts.bench_s.as_ref().map_or(0.0, |bench| *bench.apply());
    let turned = scene.launch.spin_rad_s(scene.ball.radius_m) * -bench_s;
    UnitQuaternion::from_scaled_axis(turned) * at_launch
}

/// Time from `height_m` above the floor with `rise_m_s` upwards to the floor, s, and the speed there, m/s.
fn time_to_floor(height_m: f64, rise_m_s: f64, gravity_m_s2: f64) -> (f64, f64) {
    let landing_speed = (rise_m_s * rise_m_s + 2.0 * gravity_m_s2 * height_m).sqrt();
    let time_s = if rise_m_s >= 0.0 {
        (rise_m_s + landing_speed) / gravity_m_s2
    } else {
        2.0 * height_m / (landing_speed - rise_m_s)
    };
    (time_s, landing_speed)
}

fn never_lands(found: &str) -> SceneError {
    SceneError::NeverLands {
        found: found.to_owned(),
        limit_s: LONGEST_FLIGHT_S,
    }
}

/// The equations of motion of one flight; the spin stays as it is.
#[derive(Clone, Copy)]
struct MotionEquations<'a> {
    scene: &'a Scene,
    forces: &'a [Acting<dyn Force>],
    spin: Vector3<f64>,
    floor: Plane,
    integration: Integration,
}

impl MotionEquations<'_> {
    fn acceleration(&self, state: &BallState) -> Vector3<f64> {
        let mass_kg = self.scene.ball.mass_kg;
        let mut loads = Loads {
            force_n: Vector3::new(0.0, 0.0, -self.scene.gravity_m_s2 * mass_kg),
            added_mass_kg: 0.0,
        };
        for force in self.forces {
            force.apply().act(state, &self.spin, &mut loads);
        }
        loads.force_n / (mass_kg + loads.added_mass_kg)
    }

    /// Nodes `step_s` apart from `start` on, until the ball is below the floor or `horizon_s` is over; two or more.
    fn integrate(&self, start: &BallState, step_s: f64, horizon_s: f64) -> Result<Vec<PathNode>, SceneError> {
        let initial = join(start.position_m, start.velocity_m_s);
        let end_s = horizon_s.max(3.0 * step_s);
        let mut solver = match self.integration.fixed_step_s {
            None => {
                let tolerance = self.integration.relative_tolerance;
                Dop853::new(
                    *self,
                    0.0,
                    end_s,
                    step_s,
                    initial,
                    tolerance,
                    tolerance * ABSOLUTE_M,
                )
            }
            // Any error will do, so that every step is as long as it may be. The rest are the solver's own defaults.
            Some(fixed_s) => {
                const ANY: f64 = 1e30;
                Dop853::from_param(
                    *self,
                    0.0,
                    end_s,
                    step_s,
                    initial,
                    ANY,
                    ANY,
                    0.9,
                    0.0,
                    0.333,
                    6.0,
                    fixed_s,
                    fixed_s,
                    100_000,
                    1000,
                    OutputType::Dense,
                )
            }
        };
        solver
            .integrate()
            .map_err(|stuck| never_lands(&format!("the integration stopped: {stuck}")))?;
        Ok(solver
            .y_out()
            .iter()
            .zip(0_u32..)
            // The solver ends with a node at the horizon, which is not a whole number of steps away.
            .take_while(|(_, i)| f64::from(*i) * step_s <= horizon_s)
            .map(|(y, _)| {
                let (position, velocity) = split(y);
                let state = BallState {
                    position_m: position,
                    velocity_m_s: velocity,
                };
                PathNode {
                    position,
                    velocity,
                    acceleration: self.acceleration(&state),
                }
            })
            .collect())
    }
}

impl System<f64, Vector6<f64>> for MotionEquations<'_> {
    fn system(&self, _time_s: f64, y: &Vector6<f64>, rates: &mut Vector6<f64>) {
        let (position_m, velocity_m_s) = split(y);
        *rates = join(
            velocity_m_s,
            self.acceleration(&BallState {
                position_m,
                velocity_m_s,
            }),
        );
    }

    fn solout(&mut self, _time_s: f64, y: &Vector6<f64>, _rates: &Vector6<f64>) -> bool {
        let (position_m, velocity_m_s) = split(y);
        self.floor.along_normal(&position_m) < self.scene.ball.radius_m
            && self.floor.along_normal(&velocity_m_s) < 0.0
    }
}

fn split(y: &Vector6<f64>) -> (Vector3<f64>, Vector3<f64>) {
    (y.fixed_rows::<3>(0).into(), y.fixed_rows::<3>(3).into())
}

fn join(first: Vector3<f64>, second: Vector3<f64>) -> Vector6<f64> {
    Vector6::new(first.x, first.y, first.z, second.x, second.y, second.z)
}

enum FlightEnd {
    Landing(Landing),
    /// The ball is down within the first step: too short a hop.
    Graze,
    StillFlying,
}

/// Share of the radius that turning a place into a sloping floor's frame and back may cost.
const TURNED: f64 = 1e-12;

/// The first time the ball's centre comes down to `radius_m` from `floor`.
fn find_landing(nodes: &[PathNode], step_s: f64, floor: &Plane, radius_m: f64) -> FlightEnd {
    let above_m = |place_m: &Vector3<f64>| floor.along_normal(place_m) - radius_m;
    let Some(below) = nodes.iter().skip(1).position(|n| above_m(&n.position) < 0.0) else {
        return FlightEnd::StillFlying;
    };
    let touching_m = if floor.is_level() { 0.0 } else { TURNED * radius_m };
    if below == 0 && above_m(&nodes[0].position) <= touching_m {
        return FlightEnd::Graze;
    }
    let at = |t: f64| quintic(&nodes[below], &nodes[below + 1], step_s, t);
    // Bisection to the last bit: 60 halvings of a bracket that is sure, a few microseconds an impact.
    let (mut above_s, mut below_s) = (0.0, step_s);
    for _ in 0..60 {
        let middle = 0.5 * (above_s + below_s);
        if above_m(&at(middle).position_m) >= 0.0 {
            above_s = middle;
        } else {
            below_s = middle;
        }
    }
    let mut state = at(above_s);
    state.position_m = floor.with_normal(&state.position_m, radius_m);
    FlightEnd::Landing(Landing {
        flight_s: below as f64 * step_s + above_s,
        state,
    })
}

#[cfg(test)]
mod closed_forms;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quintic_reproduces_a_quintic() {
        let p = |t: f64| BallState {
            position_m: Vector3::new(t.powi(5) - t, 2.0 * t.powi(4) + t, 1.0 - t.powi(3)),
            velocity_m_s: Vector3::new(5.0 * t.powi(4) - 1.0, 8.0 * t.powi(3) + 1.0, -3.0 * t * t),
        };
        let node = |t: f64| PathNode {
            position: p(t).position_m,
            velocity: p(t).velocity_m_s,
            acceleration: Vector3::new(20.0 * t.powi(3), 24.0 * t * t, -6.0 * t),
        };
        for t in [0.0, 0.3, 0.77, 1.5] {
            let found = quintic(&node(0.5), &node(2.0), 1.5, t);
            assert!((found.position_m - p(0.5 + t).position_m).norm() < 1e-11, "{t}");
            assert!(
                (found.velocity_m_s - p(0.5 + t).velocity_m_s).norm() < 1e-11,
                "{t}"
            );
        }
    }

    #[test]
    fn the_time_to_the_floor_does_not_cancel() {
        // A hair above the floor, thrown down at 10 m/s: h / v to all digits.
        let (time_s, speed) = time_to_floor(1e-12, -10.0, 9.81);
        assert!((time_s / 1e-13 - 1.0).abs() < 1e-12);
        assert!((speed - 10.0).abs() < 1e-12);
    }
}
