//! Scenes rendered with known truth: a road to the numbers that shares nothing with `detect`, `flight` or `bounce`.
//!
//! [`scene`] (what there is) → [`effects`] (what of it matters) → [`flight`] (where the ball is) → [`camera`] and
//! [`render`] (what the camera sees) → [`truth`] and the files.
//!
//! Same scene, same seed: same bytes of frames.

pub mod camera;
mod colour;
mod coverage;
pub mod effects;
pub mod flight;
pub mod marks;
mod marks_in_picture;
mod quadrature;
pub mod render;
pub mod scene;
mod scene_marks;
mod scene_schema;
mod second_ball;
pub mod truth;
mod turning;
mod write;

use crate::config::FileProblem;
use crate::frames::{Luma, Yuv420};
use colour::ChromaRenderer;
use effects::{Decision, Ideal, StoredFrame};
use flight::Trajectory;
use render::Renderer;
pub use scene::{EffectsChoice, Scene, SceneError};
pub use scene_schema::SceneKeys;
use truth::Truth;
pub use write::{SimulatedFiles, SimulationWriteError, calibration, files_of, write};

/// A scene with its flight computed, ready to be rendered.
pub struct SimulatedRecording {
    scene: Scene,
    decisions: Vec<Decision>,
    trajectory: Trajectory,
    renderer: Renderer,
    chroma: Option<ChromaRenderer>,
    lossy_crf: Option<u8>,
    clock: Option<scene::SceneClock>,
}

impl SimulatedRecording {
    /// Decides on the effects of `scene` and flies its ball.
    ///
    /// # Errors
    /// [`SceneError::NeverLands`], [`SceneError::NeverSeen`], or a recording of more than [`MOST_FRAMES`] frames.
    pub fn new(scene: &Scene) -> Result<Self, SceneError> {
        check_length(
            scene,
            &Trajectory::new(scene, &effects::ChosenEffects::of_the_ideal(scene).acts)?,
        )?;
        let ideal = Ideal::new(scene)?;
        let (decisions, mut chosen) = effects::decide(scene, &scene.effects, &ideal);
        let trajectory = Trajectory::new(scene, &chosen.acts)?;
        chosen.acts = flight::Perturbations::default();
        check_in_front(scene, &trajectory)?;
        let second = chosen.second_ball.take();
        let second = second
            .map(|second| second_ball::fly(scene, second.apply(), &decisions, trajectory.end_s()))
            .transpose()?;
        let recording = Self {
            scene: scene.clone(),
            chroma: ChromaRenderer::new(scene, &decisions, &trajectory)?,
            decisions,
            lossy_crf: chosen.lossy_crf.as_ref().map(|crf| *crf.apply()),
            clock: chosen.clock.as_ref().map(|clock| clock.apply().clone()),
            renderer: Renderer::new(scene, chosen, *trajectory.floor()).with_second(second),
            trajectory,
        };
        check_length(scene, &recording.trajectory)?;
        recording.check_seen()?;
        Ok(recording)
    }

    /// The scene.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The table of effects.
    #[must_use]
    pub fn decisions(&self) -> &[Decision] {
        &self.decisions
    }

    /// The way of the ball.
    #[must_use]
    pub fn trajectory(&self) -> &Trajectory {
        &self.trajectory
    }

    fn renderer(&self) -> &Renderer {
        &self.renderer
    }

    /// What the file has of the frames, in order; without a `camera.clock` each of them once.
    #[must_use]
    pub fn stored_frames(&self) -> Vec<StoredFrame> {
        let rate_hz = self.scene.camera.frame_rate_hz;
        let clock = self.clock.clone().unwrap_or_default();
        clock.stored(self.frame_count(), rate_hz)
    }

    /// How many frames the camera takes.
    #[must_use]
    pub fn frame_count(&self) -> usize {
        frame_times_s(&self.scene, &self.trajectory).len()
    }

    /// The frame with number `index`, exposed centred on `index` / frame rate.
    #[must_use]
    pub fn frame(&self, index: usize) -> Luma {
        self.renderer.frame(&self.trajectory, index)
    }

    /// The same in its colours; `None` where the scene has none.
    #[must_use]
    pub fn colour_frame(&self, index: usize) -> Option<Yuv420> {
        let chroma = self.chroma.as_ref()?;
        Some(chroma.coloured(self.frame(index), &self.trajectory, index))
    }

    /// All frames in order, as the camera takes them.
    pub fn frames(&self) -> impl Iterator<Item = Luma> + '_ {
        (0..self.frame_count()).map(|i| self.frame(i))
    }

    /// What a measurement should find.
    #[must_use]
    pub fn truth(&self) -> Truth {
        Truth::of(self)
    }

    /// Constant rate factor, where the file is compressed with loss.
    fn lossy_crf(&self) -> Option<u8> {
        self.lossy_crf
    }

    /// Whether an effect is simulated.
    fn uses(&self, effect: &str) -> bool {
        self.decisions.iter().any(|d| d.name == effect && d.used)
    }

    /// The lens, where its distortion is simulated.
    fn lens(&self) -> Option<scene::SceneLens> {
        self.scene.camera.lens.filter(|_| self.uses("lens"))
    }

    /// How far the camera is, unless it was rendered as if it were not: a perspective that was switched off.
    fn distance_m(&self) -> Option<f64> {
        let wrong = |d: &Decision| {
            // A turned camera's homography has it, or has not.
            let matters = d.estimate.amount > d.tolerance || self.scene.camera.tilt_rad != 0.0;
            d.name == "perspective" && !d.used && matters
        };
        self.scene
            .camera
            .distance_m
            .filter(|_| !self.decisions.iter().any(wrong))
    }

    fn check_seen(&self) -> Result<(), SceneError> {
        let centres = self.truth().centres;
        if centres.iter().any(|c| c.visible) {
            return Ok(());
        }
        let least = |of: fn(&truth::CentreTruth) -> f64| centres.iter().map(of).fold(f64::INFINITY, f64::min);
        let most =
            |of: fn(&truth::CentreTruth) -> f64| centres.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
        Err(SceneError::NeverSeen {
            u_from_px: least(|c| c.u_px),
            u_to_px: most(|c| c.u_px),
            v_from_px: least(|c| c.v_px),
            v_to_px: most(|c| c.v_px),
            width_px: self.scene.camera.width_px,
            height_px: self.scene.camera.height_px,
        })
    }
}

/// The longest recording, frames.
pub const MOST_FRAMES: f64 = 200_000.0;

/// Times of all frames: from the launch, or from where the bench is first seen, to the recording's end.
fn frame_times_s(scene: &Scene, trajectory: &Trajectory) -> impl ExactSizeIterator<Item = f64> + use<> {
    let rate_hz = scene.camera.frame_rate_hz;
    // Finite and not negative: the cast saturates where a recording is far too long, which `check_length` refuses.
    let last = (trajectory.end_s() * rate_hz).floor().min(MOST_FRAMES) as usize;
    (0..last + 1).map(move |i| i as f64 / rate_hz)
}

fn check_length(scene: &Scene, trajectory: &Trajectory) -> Result<(), SceneError> {
    let frames = trajectory.end_s() * scene.camera.frame_rate_hz;
    if frames < MOST_FRAMES {
        return Ok(());
    }
    Err(SceneError::invalid(FileProblem::new(
        "camera.frame_rate_hz",
        format!(
            "{}, which makes {frames:.0} frames of {:.3} s",
            scene.camera.frame_rate_hz,
            trajectory.end_s()
        ),
        format!("what makes at most {MOST_FRAMES:.0} frames"),
        "lower it, or ask for fewer stop.bounces or a shorter stop.tail_s",
    )))
}

/// That the ball stays in front of the camera, where perspective is defined.
fn check_in_front(scene: &Scene, trajectory: &Trajectory) -> Result<(), SceneError> {
    let Some(distance_m) = scene.camera.distance_m else {
        return Ok(());
    };
    let nearest_m = frame_times_s(scene, trajectory)
        .map(|t| camera::nearness_m(&scene.camera, &trajectory.state(t).position_m))
        .fold(f64::NEG_INFINITY, f64::max)
        + scene.ball.radius_m;
    if nearest_m < distance_m {
        return Ok(());
    }
    Err(SceneError::invalid(FileProblem::new(
        "camera.distance_m",
        distance_m.to_string(),
        format!("above {nearest_m:.3}, beyond the ball's nearest place"),
        "move the camera away, or give null for one infinitely far",
    )))
}
