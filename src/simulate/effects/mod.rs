//! What a recording is more than a parabola, a rigid impact and a sharp picture: a file an effect.
//!
//! Each file holds the effect's *estimate* (by how many px it would move a centre, or by how many grey levels it would
//! change the picture, from the scene alone) and its *action* (one of the hooks of [`Action`]). [`decide`] compares
//! the estimates with the scene's tolerances; an effect that is not used has no action anywhere, so it cannot be
//! evaluated, and [`Decision::evaluations`] counts to prove it.
//!
//! To add one: write its file and put it into [`ALL`].
//!
//! # The decision
//!
//! Effects below the tolerance add up. `auto` therefore leaves out effects from the smallest estimate on as long as
//! the *sum* of what is left out, with a margin of [`MARGIN`], stays within `tolerance_px`: then centres with `auto` are
//! within the tolerance of centres with `all`. Grey levels do not add up to a centre's shift and are decided one by one.

mod bench;
mod bump;
mod buoyancy;
mod camera_roll;
mod clock;
mod codec;
mod contact_time;
mod defocus;
mod deviation;
mod drag;
mod exposure;
mod flicker;
mod floor_slope;
mod lens;
mod magnus;
mod marks;
mod noise;
mod pan;
mod perspective;
mod reflection;
mod rolling_shutter;
mod rotation_blur;
mod second_ball;
mod shading;
mod shadow;
mod shot_noise;
mod texture;
mod uneven_light;
mod wall_shadow;

use super::camera::{
    BallOutline, Ellipse, Facing, PictureEdge, PictureOf, camera_from_motion, picture_shift_px,
};
use super::flight::{BallState, Perturbations, Trajectory};
use super::marks::BallMarks;
use super::marks_in_picture::SeenMarks;
use super::render::{Backdrop, FineGrid};
use super::scene::{EffectsChoice, Scene, SceneClock, SceneError, SceneSecondBall, Switch};
use crate::geometry::PixelPoint;
use crate::rebound::RigidMotion;
use nalgebra::{Matrix3, UnitQuaternion, Vector2, Vector3};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

pub use clock::StoredFrame;
pub use contact_time::Dip;
pub use deviation::{Disturbance, Jump, LargestDeviation};
pub use drag::drag_coefficient;
pub use floor_slope::Plane;

/// All effects, in the order in which they act.
pub static ALL: [&dyn Effect; 28] = [
    &bench::Bench,
    &floor_slope::SlopingFloor,
    &drag::AirDrag,
    &magnus::Magnus,
    &buoyancy::Buoyancy,
    &contact_time::ContactTime,
    &perspective::Perspective,
    &camera_roll::CameraRoll,
    &lens::LensDistortion,
    &bump::Bump,
    &pan::Pan,
    &exposure::ExposureBlur,
    &rotation_blur::RotationBlur,
    &rolling_shutter::RollingShutter,
    &defocus::Defocus,
    &shading::Shading,
    &marks::MarkedBall,
    &texture::Texture,
    &shadow::Shadow,
    &wall_shadow::WallShadow,
    &reflection::Reflection,
    &second_ball::SecondBall,
    &uneven_light::UnevenLight,
    &flicker::Flicker,
    &noise::ReadNoise,
    &shot_noise::ShotNoise,
    &codec::Compression,
    &clock::Clock,
];

/// Margin on the sum of what is left out: estimates are first order along the undisturbed path.
pub const MARGIN: f64 = 1.25;

/// The names of all effects, as scenes say them.
#[must_use]
pub fn names() -> Vec<&'static str> {
    ALL.iter().map(|e| e.name()).collect()
}

/// An effect: one file, one implementation.
pub trait Effect: Sync {
    /// As scenes, `--explain` and `truth.json` say it.
    fn name(&self) -> &'static str;

    /// How much it matters, from the scene and its ideal flight alone.
    fn estimate(&self, scene: &Scene, ideal: &Ideal) -> EffectEstimate;

    /// Whether it belongs to what the scene is rather than to what reality adds: then the ideal flight, along which the
    /// others are estimated, has it, unless it is switched off.
    fn is_of_the_ideal(&self) -> bool {
        false
    }

    /// How it disturbs the ball's path, where it does: other effects' estimates may depend on where the ball goes.
    fn disturbance(&self, _scene: &Scene) -> Option<Box<dyn Disturbance>> {
        None
    }

    /// What it does. [`Action::Nothing`] where the scene has nothing for it to do (no lens, no `distance_m`).
    fn action(&self, scene: &Scene) -> Action;
}

/// How much an effect matters.
#[derive(Debug, Clone, PartialEq)]
pub struct EffectEstimate {
    /// In what `unit` says.
    pub amount: f64,
    /// By how much it may change what other effects do, in the same unit; counts in the decision only.
    pub coupling: f64,
    /// Of what.
    pub unit: Unit,
    /// The formula with its source, and its numbers where they help.
    pub formula: String,
}

/// What an estimate counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// Shift of a centre (or of an edge), px.
    Px,
    /// Change of a grey level.
    Grey,
}

impl EffectEstimate {
    /// A shift in the picture.
    #[must_use]
    pub fn px(amount: f64, formula: impl Into<String>) -> Self {
        Self {
            amount,
            coupling: 0.0,
            unit: Unit::Px,
            formula: formula.into(),
        }
    }

    /// The shift of a disturbance, to first order along the ideal path; and its coupling: the others' work goes with the
    /// speed squared at most, so that twice its share of the speed is what it may change in that, and a later impact makes
    /// the camera swing later.
    #[must_use]
    pub fn path(
        scene: &Scene,
        ideal: &Ideal,
        disturbance: &dyn Disturbance,
        formula: impl Into<String>,
    ) -> Self {
        let alone = ideal.deviation(scene, disturbance);
        Self {
            coupling: ideal.coupling_px(scene, alone.speed_share, alone.impact_late_s),
            ..Self::px(alone.shift_px, formula)
        }
    }

    /// What the decision goes by.
    #[must_use]
    pub fn at_most(&self) -> f64 {
        self.amount + self.coupling
    }

    /// A change of grey levels.
    #[must_use]
    pub fn grey(amount: f64, formula: impl Into<String>) -> Self {
        Self {
            amount,
            coupling: 0.0,
            unit: Unit::Grey,
            formula: formula.into(),
        }
    }
}

/// Where an effect acts: one hook of the flight, the impact, the camera or the picture.
pub enum Action {
    /// Nowhere in this scene.
    Nothing,
    /// In flight.
    Force(Box<dyn Force>),
    /// At an impact.
    Contact(Box<dyn ContactLaw>),
    /// Before the launch.
    Bench {
        /// How long the ball is seen on it, s.
        seen_s: f64,
        /// What the picture shows of it.
        board: Option<Box<dyn Fixture>>,
    },
    /// Where the floor is.
    SceneFloor(Plane),
    /// Between the ideal picture and the real one.
    Warp(Box<dyn Warp>),
    /// The camera moves.
    PictureShift(Box<dyn PictureShift>),
    /// The exposure is a time average over so many seconds.
    Exposure(f64),
    /// The ball turns during so many seconds of exposure.
    RotationBlur(f64),
    /// Rows are exposed one after the other, over so many seconds.
    Readout(f64),
    /// Optical blur with this standard deviation, px.
    Blur(f64),
    /// How bright the ball's surface is.
    Surface(Box<dyn Surface>),
    /// What is drawn on it.
    Marks(Box<BallMarks>),
    /// What is behind the ball, added to its plain grey.
    BackdropPattern(Box<dyn BackdropPattern>),
    /// What the ball does to the picture around itself.
    Layer(Box<dyn Layer>),
    /// Light over the picture.
    LightField(Box<dyn LightField>),
    /// Light over time.
    Lamp(Box<dyn Lamp>),
    /// Noise of the sensor.
    SensorNoise(Box<dyn SensorNoise>),
    /// The file is compressed with loss, with this constant rate factor.
    Lossy(u8),
    /// What the file stores of the frames, and when it says that they were taken.
    Clock(Box<SceneClock>),
    /// Another ball is in the picture.
    SecondBall(SceneSecondBall),
}

/// What acts on the ball in flight, summed over all forces.
#[derive(Debug, Clone, Copy)]
pub struct Loads {
    /// N.
    pub force_n: Vector3<f64>,
    /// Mass of the air that moves along, kg.
    pub added_mass_kg: f64,
}

/// A force in flight.
pub trait Force: Send + Sync {
    /// Adds its own to `loads`, for a ball in `state` with surface speed `spin_m_s` (R ω).
    fn act(&self, state: &BallState, spin_m_s: &Vector3<f64>, loads: &mut Loads);
}

/// An impact that takes time.
pub trait ContactLaw: Send + Sync {
    /// How the centre moves while ball and floor touch, of motions in the floor's frame; `None` where they part at once.
    fn dip(&self, incident: &RigidMotion, rebound: &RigidMotion) -> Option<Dip>;
}

/// A step between the ideal picture (parallel light, no lens) and the real one.
pub trait Warp: Send + Sync {
    /// Where a ball at `ball_m`, so far at `outline`, goes.
    fn warp(&self, ball_m: &Vector3<f64>, outline: &BallOutline) -> BallOutline;

    /// Where a straight edge of the backdrop goes. The floor line of the ideal picture stands for that of the real one, so
    /// that only what turns the whole picture moves it.
    fn warp_line(&self, line: &PictureEdge) -> PictureEdge {
        *line
    }

    /// How a ball at `ball_m` lies in its outline, where it is not seen in parallel light.
    fn facing(&self, _ball_m: &Vector3<f64>) -> Option<Facing> {
        None
    }
}

/// A camera that moves.
pub trait PictureShift: Send + Sync {
    /// How far the whole picture is shifted (right, down) in the frame at `time_s`, px.
    fn shift_px(&self, trajectory: &Trajectory, time_s: f64) -> Vector2<f64>;
}

/// A thing of one grey that stands before background and floor, above the floor line.
pub trait Fixture: Send + Sync {
    /// Its grey.
    fn grey(&self) -> f64;

    /// The straight edges between which it is, their normals outward.
    fn sides(&self, picture: &PictureOf) -> Vec<PictureEdge>;
}

/// How bright the ball's surface is.
pub trait Surface: Send + Sync {
    /// Grey where the outward normal is (right, up in the picture, towards the camera).
    fn grey(&self, normal: &Vector3<f64>) -> f64;

    /// The same at places inside the ball's outline (right, down; the rim at 1), into `greys`. One call for many places, so
    /// that a surface's formula is worked out for as many of them at once as the machine can.
    fn greys_inside(&self, right: &[f64], down: &[f64], greys: &mut [f32]) {
        for ((grey, x), y) in greys.iter_mut().zip(right).zip(down) {
            let towards = (1.0 - (x * x + y * y).min(1.0)).sqrt();
            *grey = self.grey(&Vector3::new(*x, -*y, towards)) as f32;
        }
    }
}

/// What is behind the ball.
pub trait BackdropPattern: Send + Sync {
    /// Adds to the plain grey of a row of the picture at `v_px`, whose points lie at `u_px`, from left to right.
    fn add_to_row(&self, u_px: &[f64], v_px: f64, row: &mut [f64]);
}

/// A ball at a moment, for what it does to the picture around itself.
pub struct BallMoment<'a> {
    /// Its centre, m.
    pub ball_m: Vector3<f64>,
    /// Its outline.
    pub outline: BallOutline,
    /// The way into the picture.
    pub picture: &'a PictureOf,
    /// Its surface.
    pub surface: &'a dyn Surface,
    /// What is drawn on it, and the rotation from the ball into its plane of motion.
    pub marks: Option<(&'a BallMarks, UnitQuaternion<f64>)>,
}

impl<'a> BallMoment<'a> {
    /// Its marks as the camera sees them, on a grid with cells of `side_px`.
    #[must_use]
    pub fn seen_marks(&self, side_px: f64) -> Option<SeenMarks<'a>> {
        self.marks_seen_at(&self.ball_m, &Matrix3::identity(), &self.outline.ellipse, side_px)
    }

    /// Its marks as the camera sees them in the floor, where the ball's mirror image has the outline `ellipse`.
    #[must_use]
    pub fn mirrored_marks(&self, ellipse: &Ellipse, side_px: f64) -> Option<SeenMarks<'a>> {
        let floor = self.picture.floor();
        let normal = floor.out_of_frame(&Vector3::z());
        let mirror = Matrix3::identity() - normal * normal.transpose() * 2.0;
        self.marks_seen_at(&floor.mirrored(&self.ball_m), &mirror, ellipse, side_px)
    }

    fn marks_seen_at(
        &self,
        place_m: &Vector3<f64>,
        mirror: &Matrix3<f64>,
        ellipse: &Ellipse,
        side_px: f64,
    ) -> Option<SeenMarks<'a>> {
        let (marks, motion_from_ball) = self.marks?;
        let camera_from_motion = camera_from_motion(self.picture.camera());
        let ball_from_camera = motion_from_ball.to_rotation_matrix().matrix().transpose()
            * mirror
            * camera_from_motion.matrix().transpose();
        let facing = self.picture.facing(place_m);
        Some(SeenMarks::new(marks, ball_from_camera, facing, ellipse, side_px))
    }
}

/// What the ball does to the picture around itself, painted before the ball.
pub trait Layer: Send + Sync {
    /// The smallest and largest corner of what it paints, px; `None` where it paints nothing.
    fn extent(&self, moment: &BallMoment<'_>) -> Option<(Vector2<f64>, Vector2<f64>)>;

    /// Paints the rows `rows` of `patch`.
    fn paint(
        &self,
        moment: &BallMoment<'_>,
        backdrop: &Backdrop,
        patch: &mut FineGrid,
        rows: std::ops::Range<usize>,
    );
}

/// Light over the picture.
pub trait LightField: Send + Sync {
    /// Factor at a point of the picture.
    fn gain(&self, at: PixelPoint) -> f64;
}

/// Light over time.
pub trait Lamp: Send + Sync {
    /// Mean factor of an exposure of `exposure_s` centred on `time_s`.
    fn gain(&self, time_s: f64, exposure_s: f64) -> f64;
}

/// Noise of the sensor.
pub trait SensorNoise: Send + Sync {
    /// Variance at a grey level, grey².
    fn variance(&self, grey: f64) -> f64;
}

/// An action in use, which counts how often it is evaluated.
pub struct Acting<T: ?Sized> {
    what: Box<T>,
    evaluations: Arc<AtomicU64>,
}

impl<T: ?Sized> Acting<T> {
    /// An action in use that no effect gave.
    pub fn of(what: Box<T>) -> Self {
        Self {
            what,
            evaluations: Arc::default(),
        }
    }

    /// The action, to evaluate once.
    pub fn apply(&self) -> &T {
        self.evaluations.fetch_add(1, Ordering::Relaxed);
        &self.what
    }
}

/// What the decision rests on: the path of a rigid ball without air, over the scene's bench and floor.
pub struct Ideal {
    /// The path.
    pub trajectory: Trajectory,
    /// The ball in the ideal picture, in each frame that may show any of it.
    pub visible: Vec<IdealFrame>,
    /// How far all disturbances together may take the ball towards the camera or away from it, m.
    pub wander_m: f64,
    /// How far all disturbances together may shift the ball in the picture, px.
    pub total_px: f64,
    /// The picture along which effects are estimated, and the one with every warp.
    pictures: [PictureOf; 2],
    /// How far outside the picture the ideal ball may be while the real one is inside, px, with its radius.
    slack_px: f64,
}

/// A frame of the ideal flight.
#[derive(Debug, Clone, Copy)]
pub struct IdealFrame {
    /// s.
    pub time_s: f64,
    /// The ball.
    pub state: BallState,
    /// Its centre in the ideal picture.
    pub pixel: PixelPoint,
}

impl Ideal {
    /// Flies the ball of `scene` without any effect but those of the ideal, for as long as the recording may last with all of them.
    ///
    /// # Errors
    /// [`SceneError::NeverLands`].
    pub fn new(scene: &Scene) -> Result<Self, SceneError> {
        let rigid = Self::of_length(scene, f64::INFINITY)?;
        let (mut late_s, mut shift_px) = (0.0, 0.0);
        for disturbed in rigid.disturbances(scene) {
            late_s += disturbed.late_s.abs();
            shift_px += disturbed.shift_px;
        }
        shift_px += scene.camera.bump.map_or(0.0, |bump| bump.amplitude_px.norm());
        shift_px += pan::reach_px(scene, rigid.trajectory.end_s() + MARGIN * late_s);
        let mut longer = scene.clone();
        longer.stop.tail_s += MARGIN * late_s;
        let radius_px = scene.ball.radius_m / scene.camera.metres_per_pixel;
        let mut ideal = Self::of_length(&longer, radius_px + MARGIN * shift_px)?;
        let disturbances: Vec<LargestDeviation> = ideal.disturbances(scene).collect();
        ideal.wander_m = disturbances.iter().map(|d| d.depth_m).sum();
        ideal.total_px = disturbances.iter().map(|d| d.shift_px).sum();
        Ok(ideal)
    }

    fn of_length(scene: &Scene, slack_px: f64) -> Result<Self, SceneError> {
        let mut every = ChosenEffects::default();
        for effect in ALL {
            every.take(effect.action(scene), &Arc::default());
        }
        let base = ChosenEffects::of_the_ideal(scene);
        let mut ideal = Self {
            trajectory: Trajectory::new(scene, &base.acts)?,
            visible: Vec::new(),
            wander_m: 0.0,
            total_px: 0.0,
            pictures: [
                PictureOf::new(scene, base.warps),
                PictureOf::new(scene, every.warps),
            ],
            slack_px,
        };
        ideal.visible = super::frame_times_s(scene, &ideal.trajectory)
            .map(|time_s| {
                let state = ideal.trajectory.state(time_s);
                IdealFrame {
                    time_s,
                    state,
                    pixel: ideal.pictures[0].outline(&state.position_m).centre,
                }
            })
            .filter(|s| ideal.may_show(&s.state.position_m))
            .collect();
        Ok(ideal)
    }

    /// By how much what changes speeds by `speed_share` and impacts by `late_s` may change what others do, px.
    fn coupling_px(&self, scene: &Scene, speed_share: f64, late_s: f64) -> f64 {
        let swing_px_s = bump::top_speed_px_s(scene, &self.trajectory);
        // A grazing impact may be late without bounds, which matters to a camera that swings only.
        let swung_px = if swing_px_s > 0.0 {
            late_s * swing_px_s
        } else {
            0.0
        };
        2.0 * speed_share * self.total_px + swung_px
    }

    /// The rigid flight over another floor.
    fn rigid_over(&self, scene: &Scene, floor: Plane) -> Result<Trajectory, SceneError> {
        let mut acts = ChosenEffects::of_the_ideal(scene).acts;
        acts.floor = Some(Acting::of(Box::new(floor)));
        Trajectory::new(scene, &acts)
    }

    /// Whether the picture may show the ball when its ideal place is `ball_m`.
    fn may_show(&self, ball_m: &Vector3<f64>) -> bool {
        self.pictures
            .iter()
            .any(|p| p.shows(p.outline(ball_m).centre, self.slack_px))
    }

    fn disturbances(&self, scene: &Scene) -> impl Iterator<Item = LargestDeviation> {
        ALL.iter()
            .filter_map(|e| e.disturbance(scene))
            .map(|d| self.deviation(scene, d.as_ref()))
    }

    fn deviation(&self, scene: &Scene, disturbance: &dyn Disturbance) -> LargestDeviation {
        deviation::largest(scene, self, disturbance)
    }

    /// The largest speed, m/s; it is above 0, as the ball lands.
    #[must_use]
    pub fn top_speed_m_s(&self) -> f64 {
        let launch = self
            .trajectory
            .state(self.trajectory.launch_s())
            .velocity_m_s
            .norm();
        let impacts = self.trajectory.impacts().iter();
        impacts
            .map(|i| i.incident.velocity_m_s.norm())
            .fold(launch, f64::max)
    }

    /// The largest speed of the centre in the picture, px/s.
    #[must_use]
    pub fn top_speed_px_s(&self, scene: &Scene) -> f64 {
        self.largest(|s| picture_shift_px(&scene.camera, &s.state.position_m, &s.state.velocity_m_s))
    }

    /// The largest `of` over all frames that show the ball, 0 where none does.
    pub fn largest(&self, of: impl Fn(&IdealFrame) -> f64) -> f64 {
        self.visible.iter().map(of).fold(0.0, f64::max)
    }
}

/// One line of the table.
#[derive(Debug, Clone)]
pub struct Decision {
    /// The effect.
    pub name: &'static str,
    /// How much it matters.
    pub estimate: EffectEstimate,
    /// What it is compared with, in the estimate's unit.
    pub tolerance: f64,
    /// Whether it is simulated.
    pub used: bool,
    /// Why.
    pub reason: String,
    evaluations: Arc<AtomicU64>,
}

impl Decision {
    /// How often the effect's action has been evaluated so far.
    #[must_use]
    pub fn evaluations(&self) -> u64 {
        self.evaluations.load(Ordering::Relaxed)
    }
}

/// The actions of the effects in use, each at its hook.
#[derive(Default)]
pub struct ChosenEffects {
    /// Flight and impact.
    pub acts: Perturbations,
    /// Camera geometry.
    pub warps: Vec<Acting<dyn Warp>>,
    /// Motion of the camera.
    pub shakes: Vec<Acting<dyn PictureShift>>,
    /// In front of the background.
    pub fixtures: Vec<Acting<dyn Fixture>>,
    /// s.
    pub exposure_s: Option<Acting<f64>>,
    /// s.
    pub rotation_blur_s: Option<Acting<f64>>,
    /// s.
    pub readout_s: Option<Acting<f64>>,
    /// px.
    pub blur_px: Option<Acting<f64>>,
    /// Brightness of the ball.
    pub surface: Option<Acting<dyn Surface>>,
    /// Drawn on the ball.
    pub marks: Option<Acting<BallMarks>>,
    /// Background.
    pub textures: Vec<Acting<dyn BackdropPattern>>,
    /// Around the ball.
    pub layers: Vec<Acting<dyn Layer>>,
    /// Over the picture.
    pub lights: Vec<Acting<dyn LightField>>,
    /// Over time.
    pub lamps: Vec<Acting<dyn Lamp>>,
    /// Sensor.
    pub noises: Vec<Acting<dyn SensorNoise>>,
    /// Constant rate factor of lossy storage.
    pub lossy_crf: Option<Acting<u8>>,
    /// The file's clock.
    pub clock: Option<Acting<SceneClock>>,
    /// Another ball.
    pub second_ball: Option<Acting<SceneSecondBall>>,
}

impl ChosenEffects {
    /// The effects of the ideal flight and picture, but those that are switched off.
    pub fn of_the_ideal(scene: &Scene) -> Self {
        let mut base = Self::default();
        for effect in ALL {
            if effect.is_of_the_ideal() && scene.effects.of(effect.name()) != Switch::Off {
                base.take(effect.action(scene), &Arc::default());
            }
        }
        base
    }

    /// Puts `action` at its hook; whether it does anything.
    fn take(&mut self, action: Action, evaluations: &Arc<AtomicU64>) -> bool {
        fn acting<T: ?Sized>(what: Box<T>, evaluations: &Arc<AtomicU64>) -> Acting<T> {
            Acting {
                what,
                evaluations: Arc::clone(evaluations),
            }
        }
        match action {
            Action::Nothing => return false,
            Action::Force(x) => self.acts.forces.push(acting(x, evaluations)),
            Action::Contact(x) => self.acts.contact = Some(acting(x, evaluations)),
            Action::Bench { seen_s, board } => {
                self.acts.bench_s = Some(acting(Box::new(seen_s), evaluations));
                self.fixtures.extend(board.map(|x| acting(x, evaluations)));
            }
            Action::SceneFloor(x) => self.acts.floor = Some(acting(Box::new(x), evaluations)),
            Action::PictureShift(x) => self.shakes.push(acting(x, evaluations)),
            Action::Warp(x) => self.warps.push(acting(x, evaluations)),
            Action::Exposure(s) => self.exposure_s = Some(acting(Box::new(s), evaluations)),
            Action::RotationBlur(s) => self.rotation_blur_s = Some(acting(Box::new(s), evaluations)),
            Action::Readout(s) => self.readout_s = Some(acting(Box::new(s), evaluations)),
            Action::Blur(px) => self.blur_px = Some(acting(Box::new(px), evaluations)),
            Action::Surface(x) => self.surface = Some(acting(x, evaluations)),
            Action::Marks(x) => self.marks = Some(acting(x, evaluations)),
            Action::BackdropPattern(x) => self.textures.push(acting(x, evaluations)),
            Action::Layer(x) => self.layers.push(acting(x, evaluations)),
            Action::LightField(x) => self.lights.push(acting(x, evaluations)),
            Action::Lamp(x) => self.lamps.push(acting(x, evaluations)),
            Action::SensorNoise(x) => self.noises.push(acting(x, evaluations)),
            Action::Lossy(crf) => self.lossy_crf = Some(acting(Box::new(crf), evaluations)),
            Action::Clock(x) => self.clock = Some(acting(x, evaluations)),
            Action::SecondBall(x) => self.second_ball = Some(acting(Box::new(x), evaluations)),
        }
        true
    }
}

/// Decides on every effect by `choice`, and gives the table and the actions in use.
#[must_use]
pub fn decide(scene: &Scene, choice: &EffectsChoice, ideal: &Ideal) -> (Vec<Decision>, ChosenEffects) {
    let estimates: Vec<EffectEstimate> = ALL.iter().map(|e| e.estimate(scene, ideal)).collect();
    let left_out_px = left_out(scene, choice, &estimates);
    let mut chosen = ChosenEffects::default();
    let table = ALL
        .iter()
        .zip(estimates)
        .map(|(effect, estimate)| {
            let evaluations = Arc::new(AtomicU64::new(0));
            let (mut used, mut reason) = judge(scene, choice.of(effect.name()), &estimate, left_out_px);
            if used && !chosen.take(effect.action(scene), &evaluations) {
                used = false;
                reason = "the scene has nothing for it to do".to_owned();
            }
            Decision {
                name: effect.name(),
                tolerance: match estimate.unit {
                    Unit::Px => scene.tolerance_px,
                    Unit::Grey => scene.tolerance_grey,
                },
                estimate,
                used,
                reason,
                evaluations,
            }
        })
        .collect();
    (table, chosen)
}

/// The largest estimate (px) that `auto` still leaves out: see the module's head. Negative where nothing is.
fn left_out(scene: &Scene, choice: &EffectsChoice, estimates: &[EffectEstimate]) -> f64 {
    let mut shifts: Vec<f64> = ALL
        .iter()
        .zip(estimates)
        .filter(|(effect, e)| e.unit == Unit::Px && choice.of(effect.name()) == Switch::Auto)
        .map(|(_, e)| e.at_most())
        .collect();
    shifts.sort_by(f64::total_cmp);
    let mut sum = 0.0;
    shifts
        .into_iter()
        .take_while(|shift| {
            sum += shift;
            sum * MARGIN <= scene.tolerance_px
        })
        .last()
        .unwrap_or(-1.0)
}

/// Whether to use an effect, and why.
fn judge(scene: &Scene, switch: Switch, estimate: &EffectEstimate, left_out_px: f64) -> (bool, String) {
    match (switch, estimate.unit) {
        (Switch::On, _) => (true, "on by request".to_owned()),
        (Switch::Off, _) => (false, "off by request".to_owned()),
        (Switch::Auto, Unit::Grey) if estimate.amount > scene.tolerance_grey => {
            (true, "above the tolerance".to_owned())
        }
        (Switch::Auto, Unit::Px) if estimate.amount > scene.tolerance_px => {
            (true, "above the tolerance".to_owned())
        }
        (Switch::Auto, Unit::Px) if estimate.at_most() > left_out_px => (
            true,
            format!(
                "with what else is left out, couplings and a margin of {MARGIN} it would exceed the tolerance"
            ),
        ),
        (Switch::Auto, _) => (false, "below the tolerance".to_owned()),
    }
}
