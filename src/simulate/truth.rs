//! `truth.json`: what a measurement of the recording should find.
//!
//! Conventions: frame i is exposed centred on t = i / frame_rate_hz (a rolling shutter's middle row); the clip begins at
//! t = 0: the launch, or where the ball is first seen on its bench (`launch` then says when it leaves that). Velocities are those of the centre just before and after an impact; an impact's time is the first
//! touch. Ratios, friction and angles refer to the floor's normal and
//! tangent, velocities to x, y and z: over a level floor that is the same. Angles are in the x-z plane, from the normal,
//! positive along the incident direction. `u_px`, `v_px` is the image of the ball's centre with all geometric effects
//! (perspective, camera roll, lens, bump, pan, rolling shutter); `x_m`, `y_m`, `z_m` its
//! place in the world at the frame's time.
//!
//! Of a ball whose plane of motion is turned from the calibrated one (`launch.azimuth_deg`), places and velocities
//! along x are their components along the calibrated plane, which is what a camera sees; y is away from it. Angles, ratios, friction,
//! e, e_x, spins and the distances x0 and x are those of the motion in its own vertical plane: of the ball and its floor, wherever they
//! are seen from.
//!
//! Rotations: the world's axes are x along the calibrated plane to the right, y away from a camera at the side, z up. An `orientation`
//! is a unit quaternion [w, x, y, z] that takes a direction fixed to the ball into those: v_world = q v_ball q*. With a rolling shutter it is that
//! of the time when the row of the ball's centre is exposed. At the launch it is the scene's `turned_deg` (after `launch.azimuth_deg`).
//! A spin is ω in rad/s: y is above 0 where the top of the ball moves along +x.
//!
//! A frame is one that the camera took, at its true time; `stored_frame` says where the file has it (`camera.clock`).

use super::camera::{along_calibrated, camera_from_motion, rolled};
use super::effects::Plane;
use super::effects::{Decision, Unit};
use super::flight::{Impact, Trajectory};
use super::render::{OtherBall, Renderer};
use super::scene::Scene;
use super::{SimulatedRecording, frame_times_s};
use crate::Build;
use crate::config::made_by::MadeBy;
use crate::geometry::PixelPoint;
use crate::rebound::azimuth_rad;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector2, Vector3};
use schemars::JsonSchema;
use serde::Serialize;

/// The schema written.
pub const SCHEMA: &str = "track.truth/1";

/// All of it.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Truth {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// The program that rendered it.
    #[serde(flatten)]
    pub build: Build,
    /// One line for each effect.
    pub effects: Vec<EffectTruth>,
    /// How the ball leaves the bench; `null` where it is not seen on one.
    pub launch: Option<LaunchTruth>,
    /// By how much the floor rises along +x, degrees.
    pub floor_slope_deg: f64,
    /// The flights from the launch or an impact to the next, or to the recording's end.
    pub arcs: Vec<ArcTruth>,
    /// The impacts within the recording.
    pub bounces: Vec<BounceTruth>,
    /// What takes directions of the world into those of the picture (right, up, towards the camera), row by row; of a ball with marks.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera_from_world: Option<[[f64; 3]; 3]>,
    /// From the edge to the first impact, along x of the ball's own plane of motion, m.
    pub x0_m: Option<f64>,
    /// From the first impact to the second, along the same, m; also where that is after the recording's end.
    pub x_m: Option<f64>,
    /// One for each frame that the camera took.
    pub centres: Vec<CentreTruth>,
    /// The other ball in the picture.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub second_ball: Option<SecondBallTruth>,
    /// In the file: that the program wrote it, and the digest of the video, so that it may replace them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub made_by: Option<MadeBy>,
}

/// Another ball, by the clock and in the place of the first.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct SecondBallTruth {
    /// When it is launched, s: before 0 where it flies already as the recording begins.
    pub start_s: f64,
    /// m.
    pub radius_m: f64,
    /// The impacts within the recording.
    pub bounces: Vec<BounceTruth>,
    /// One for each frame that the camera took.
    pub centres: Vec<CentreTruth>,
}

/// Whether an effect was simulated. An estimate is in px or in grey levels; the other pair is `null`.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct EffectTruth {
    /// Its name.
    pub name: &'static str,
    /// Shift, px.
    pub estimate_px: Option<f64>,
    /// Tolerance, px.
    pub tolerance_px: Option<f64>,
    /// Change of grey levels.
    pub estimate_grey: Option<f64>,
    /// Tolerance in grey levels.
    pub tolerance_grey: Option<f64>,
    /// Whether it was simulated.
    pub used: bool,
    /// Why.
    pub reason: String,
}

/// The launch from a bench, with the keys of a result's launch as plain numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct LaunchTruth {
    /// When the ball's centre is above the edge, s.
    pub time_s: f64,
    /// u_o, m/s.
    pub speed_m_s: f64,
    /// How long it is seen on the bench before, s.
    pub rolled_s: f64,
    /// Where the edge is, m.
    pub edge_x_m: f64,
    /// Of the ball's lowest point above z = 0, m.
    pub drop_height_m: f64,
}

/// Velocity and angle before or after an impact.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct LegTruth {
    /// Along the launch, m/s.
    pub vx_m_s: f64,
    /// Sideways, m/s.
    pub vy_m_s: f64,
    /// Up, m/s.
    pub vz_m_s: f64,
    /// In the x-z plane, from the floor's normal, positive along the incident direction, degrees.
    pub angle_deg: f64,
}

/// An impact, with the keys of a result's bounces as plain numbers. `null` where a quantity does not exist: a ratio to
/// a velocity of 0.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct BounceTruth {
    /// First touch, s.
    pub time_s: f64,
    /// Place, m.
    pub x_m: f64,
    /// Place sideways, m.
    pub y_m: f64,
    /// Before.
    pub incident: LegTruth,
    /// After.
    pub rebound: LegTruth,
    /// e.
    pub restitution: Option<f64>,
    /// v_t after / v_t before.
    pub tangential_ratio: Option<f64>,
    /// |change of v_t| / (|v_n| (1 + e)).
    pub friction: Option<f64>,
    /// e_x.
    pub tangential_restitution: Option<f64>,
    /// R ω_y before, m/s.
    pub spin_in_m_s: f64,
    /// R ω_y after, m/s.
    pub spin_out_m_s: f64,
    /// Deviation of the rebound in the floor plane, degrees; in every view.
    pub azimuth_deg: Option<f64>,
    /// `sliding`, `nonsliding`, `ordinary` or `grip`.
    pub regime: &'static str,
    /// How long ball and floor touched, s.
    pub contact_s: f64,
    /// When the arcs before and after would meet in height above the floor, s: what a fit of two arcs finds. With a contact of τ it is
    /// (e v τ + g τ²/2) / ((1 + e) v + g τ) after the first touch.
    pub arcs_meet_s: f64,
}

/// A flight between impacts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct ArcTruth {
    /// s.
    pub from_s: f64,
    /// s.
    pub to_s: f64,
    /// How the ball spins.
    pub spin: SpinTruth,
}

/// Angular velocity ω about the world's axes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct SpinTruth {
    /// About the paper's axis: above 0 where the top of the ball moves along +x, rad/s.
    pub y_rad_s: f64,
    /// About x, rad/s.
    pub x_rad_s: f64,
    /// About the vertical, rad/s: above 0 where the side towards a camera at the side moves along +x.
    pub z_rad_s: f64,
}

/// The ball's centre in a frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct CentreTruth {
    /// From 0.
    pub frame: usize,
    /// The first frame of the file that shows it; `null` where the file leaves it out.
    pub stored_frame: Option<usize>,
    /// s.
    pub time_s: f64,
    /// m.
    pub x_m: f64,
    /// m.
    pub y_m: f64,
    /// m.
    pub z_m: f64,
    /// px.
    pub u_px: f64,
    /// px.
    pub v_px: f64,
    /// Whether the picture shows any of the ball.
    pub visible: bool,
    /// World from ball, a unit quaternion [w, x, y, z] with w not below 0; of a ball with marks.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub orientation: Option<[f64; 4]>,
}

impl Truth {
    /// Of `recording`.
    #[must_use]
    pub fn of(recording: &SimulatedRecording) -> Self {
        let impacts = recording.trajectory().impacts();
        let end_s = recording.trajectory().end_s();
        let floor = recording.trajectory().floor();
        Self {
            schema: SCHEMA,
            build: Build::THIS,
            effects: recording.decisions().iter().map(effect).collect(),
            launch: launch(recording),
            floor_slope_deg: floor.slope_rad().to_degrees(),
            bounces: impacts
                .iter()
                .take_while(|i| i.time_s <= end_s)
                .map(|i| bounce(i, floor, recording.scene()))
                .collect(),
            arcs: (recording.trajectory().arcs())
                .map(|arc| {
                    let spin = along_calibrated(&recording.scene().camera, &arc.spin_rad_s);
                    ArcTruth {
                        from_s: arc.from_s,
                        to_s: arc.to_s,
                        spin: SpinTruth {
                            y_rad_s: spin.y,
                            x_rad_s: spin.x,
                            z_rad_s: spin.z,
                        },
                    }
                })
                .collect(),
            camera_from_world: recording.uses("marks").then(|| camera_from_world(recording)),
            x0_m: impacts.first().map(|first| first.place_m.x),
            x_m: impacts
                .get(1)
                .map(|second| second.place_m.x - impacts[0].place_m.x),
            centres: centres(recording, recording.trajectory(), recording.renderer(), 0.0),
            second_ball: recording
                .renderer()
                .second()
                .map(|other| second_ball(recording, other)),
            made_by: None,
        }
    }
}

/// The rotation from the ball's own plane of motion into the world's axes.
fn world_from_motion(scene: &Scene) -> Rotation3<f64> {
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| along_calibrated(&scene.camera, &axis));
    Rotation3::from_matrix_unchecked(Matrix3::from_columns(&axes))
}

/// The rotation from the world's axes into the picture's (right, up, towards the camera), which is rolled where that is simulated.
fn camera_from_world(recording: &SimulatedRecording) -> [[f64; 3]; 3] {
    let scene = recording.scene();
    let upright = camera_from_motion(&scene.camera) * world_from_motion(scene).inverse();
    let roll_rad = if recording.uses("camera_roll") {
        scene.camera.roll_rad
    } else {
        0.0
    };
    // It acts on (right, down).
    let turn = rolled(roll_rad);
    let turn = Matrix3::new(
        turn[(0, 0)],
        -turn[(0, 1)],
        0.0,
        -turn[(1, 0)],
        turn[(1, 1)],
        0.0,
        0.0,
        0.0,
        1.0,
    );
    let rows = turn * upright.matrix();
    [0, 1, 2].map(|i| [rows[(i, 0)], rows[(i, 1)], rows[(i, 2)]])
}

/// As a list [w, x, y, z] with w not below 0.
fn listed(q: UnitQuaternion<f64>) -> [f64; 4] {
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    [q.w, q.i, q.j, q.k].map(|part| sign * part)
}

fn second_ball(recording: &SimulatedRecording, other: &OtherBall) -> SecondBallTruth {
    let (scene, floor) = (recording.scene(), other.trajectory.floor());
    let in_recording = |i: &Impact| {
        let own = bounce(i, floor, scene);
        BounceTruth {
            time_s: own.time_s + other.start_s,
            arcs_meet_s: own.arcs_meet_s + other.start_s,
            x_m: own.x_m + other.x_m,
            ..own
        }
    };
    let impacts = other.trajectory.impacts().iter().map(in_recording);
    let mut centres = centres(recording, &other.trajectory, &other.renderer, other.start_s);
    for centre in &mut centres {
        centre.x_m += other.x_m;
    }
    SecondBallTruth {
        start_s: other.start_s,
        radius_m: other.radius_m,
        bounces: impacts
            .filter(|b| b.time_s >= 0.0 && b.time_s <= recording.trajectory().end_s())
            .collect(),
        centres,
    }
}

fn effect(decision: &Decision) -> EffectTruth {
    let of = |unit: Unit, x: f64| (decision.estimate.unit == unit).then_some(x);
    EffectTruth {
        name: decision.name,
        estimate_px: of(Unit::Px, decision.estimate.amount),
        tolerance_px: of(Unit::Px, decision.tolerance),
        estimate_grey: of(Unit::Grey, decision.estimate.amount),
        tolerance_grey: of(Unit::Grey, decision.tolerance),
        used: decision.used,
        reason: decision.reason.clone(),
    }
}

fn launch(recording: &SimulatedRecording) -> Option<LaunchTruth> {
    let launch = &recording.scene().launch;
    let rolled_s = recording.trajectory().launch_s();
    recording.uses("bench").then_some(LaunchTruth {
        time_s: rolled_s,
        speed_m_s: launch.speed_m_s * recording.scene().camera.motion_azimuth_rad.cos(),
        rolled_s,
        edge_x_m: 0.0,
        drop_height_m: launch.drop_height_m,
    })
}

fn bounce(impact: &Impact, floor: &Plane, scene: &Scene) -> BounceTruth {
    let (incident, rebound) = (
        floor.motion_in_frame(&impact.incident),
        floor.motion_in_frame(&impact.rebound),
    );
    let (before, after) = (incident.velocity_m_s, rebound.velocity_m_s);
    let (spin_in, spin_out) = (
        impact.incident.surface_spin_m_s.y,
        impact.rebound.surface_spin_m_s.y,
    );
    let ratio = |a: f64, b: f64| Some(a / b).filter(|q| q.is_finite());
    let forward = if before.x < 0.0 { -1.0 } else { 1.0 };
    let leg = |world: Vector3<f64>, framed: Vector3<f64>| {
        let world = along_calibrated(&scene.camera, &world);
        LegTruth {
            vx_m_s: world.x,
            vy_m_s: world.y,
            vz_m_s: world.z,
            angle_deg: (forward * framed.x).atan2(framed.z.abs()).to_degrees(),
        }
    };
    let place_m = along_calibrated(&scene.camera, &impact.place_m);
    BounceTruth {
        time_s: impact.time_s,
        x_m: place_m.x,
        y_m: place_m.y,
        incident: leg(impact.incident.velocity_m_s, before),
        rebound: leg(impact.rebound.velocity_m_s, after),
        restitution: ratio(after.z, before.z.abs()),
        tangential_ratio: ratio(after.x, before.x),
        friction: ratio((after.x - before.x).abs(), before.z.abs() + after.z),
        tangential_restitution: ratio(-(after.x - spin_out), before.x - spin_in),
        spin_in_m_s: spin_in,
        spin_out_m_s: spin_out,
        azimuth_deg: azimuth_rad(&incident, &rebound).map(f64::to_degrees),
        regime: impact.regime.name(),
        contact_s: impact.contact_s,
        arcs_meet_s: impact.time_s
            + meeting_s(
                before.z.abs(),
                after.z,
                impact.contact_s,
                floor.gravity_towards(scene.gravity_m_s2),
            ),
    }
}

/// How long after the first touch the arcs meet, s: −v t − g t²/2 = e v (t − τ) − g (t − τ)²/2, all along the floor's normal.
fn meeting_s(down_m_s: f64, up_m_s: f64, contact_s: f64, gravity_m_s2: f64) -> f64 {
    let fall = gravity_m_s2 * contact_s;
    (up_m_s + 0.5 * fall) * contact_s / (down_m_s + up_m_s + fall)
}

/// Of the ball on `trajectory`, launched at `start_s`, as `renderer` shows it.
fn centres(
    recording: &SimulatedRecording,
    trajectory: &Trajectory,
    renderer: &Renderer,
    start_s: f64,
) -> Vec<CentreTruth> {
    let mut stored_frame = vec![None; recording.frame_count()];
    for (k, stored) in recording.stored_frames().iter().enumerate() {
        stored_frame[stored.shows].get_or_insert(k);
    }
    frame_times_s(recording.scene(), recording.trajectory())
        .zip(stored_frame)
        .enumerate()
        .map(|(frame, (time_s, stored_frame))| {
            let shift_px = recording.renderer().shift_px(recording.trajectory(), time_s);
            // It lies still before its launch.
            let own_s = if start_s == 0.0 {
                time_s
            } else {
                (time_s - start_s).max(0.0)
            };
            let camera = &recording.scene().camera;
            let at_m = along_calibrated(camera, &trajectory.state(own_s).position_m);
            let (seen, seen_s) = apparent_centre(trajectory, renderer, shift_px, own_s);
            let orientation = renderer.shows_marks().then(|| {
                let turned = world_from_motion(recording.scene()) * trajectory.orientation(seen_s);
                listed(UnitQuaternion::from_rotation_matrix(&turned.to_rotation_matrix()))
            });
            let radius_px = renderer.radius_px();
            CentreTruth {
                frame,
                stored_frame,
                time_s,
                x_m: at_m.x,
                y_m: at_m.y,
                z_m: at_m.z,
                u_px: seen.u_px,
                v_px: seen.v_px,
                visible: renderer.picture().shows(seen, radius_px),
                orientation,
            }
        })
        .collect()
}

/// Image of the ball's centre in the frame of `time_s`: at the time when a rolling shutter exposes its row, and shifted with
/// the picture; and that time, s.
fn apparent_centre(
    trajectory: &Trajectory,
    renderer: &Renderer,
    shift_px: Vector2<f64>,
    time_s: f64,
) -> (PixelPoint, f64) {
    let at = |t: f64| {
        let centre = renderer.picture().outline(&trajectory.state(t).position_m).centre;
        PixelPoint::new(centre.u_px + shift_px.x, centre.v_px + shift_px.y)
    };
    let (mut seen, mut seen_s) = (at(time_s), time_s);
    // Contracts by speed × readout / height each turn, far below 1; ten turns end below 1e-9 px.
    for _ in 0..10 {
        seen_s = time_s + renderer.row_delay_s(seen.v_px);
        let again = at(seen_s);
        if again == seen {
            break;
        }
        seen = again;
    }
    (seen, seen_s)
}
