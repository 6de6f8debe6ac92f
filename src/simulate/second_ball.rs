//! The flight of the second ball of a recording (`effects::second_ball`): a scene of its own, seen by the same camera.

use super::effects::{self, Decision, Ideal};
use super::flight::{Perturbations, Trajectory};
use super::render::{OtherBall, Renderer};
use super::scene::{EffectsChoice, Scene, SceneError, SceneSecondBall, Stop, Switch};
use nalgebra::Vector3;

/// Effects that are of the first ball alone, or of the whole picture and file: those come from the first.
const NOT_ITS_OWN: [&str; 10] = [
    "bench",
    "bump",
    "pan",
    "shadow",
    "wall_shadow",
    "reflection",
    "marks",
    "rotation_blur",
    "second_ball",
    "clock",
];

/// Flies `second` through `scene` with the effects that `decisions` use, until the recording's end at `end_s`.
///
/// # Errors
/// [`SceneError::NeverLands`], or a ball that flies into the camera.
pub fn fly(
    scene: &Scene,
    second: &SceneSecondBall,
    decisions: &[Decision],
    end_s: f64,
) -> Result<OtherBall, SceneError> {
    let alone = alone(scene, second, end_s);
    let named = decisions.iter().map(|d| {
        let used = d.used && !NOT_ITS_OWN.contains(&d.name);
        (d.name.to_owned(), if used { Switch::On } else { Switch::Off })
    });
    let choice = EffectsChoice {
        default: Switch::Off,
        named: named.collect(),
    };
    let (_, mut chosen) = effects::decide(&alone, &choice, &Ideal::new(&alone)?);
    let trajectory = Trajectory::new(&alone, &chosen.acts)?;
    chosen.acts = Perturbations::default();
    super::check_in_front(&alone, &trajectory)?;
    Ok(OtherBall {
        start_s: second.start_s,
        x_m: second.x_m,
        radius_m: second.radius_m,
        renderer: Renderer::new(&alone, chosen, *trajectory.floor()),
        trajectory,
    })
}

/// The scene of the second ball alone: its own x = 0 is where it is launched.
fn alone(scene: &Scene, second: &SceneSecondBall, end_s: f64) -> Scene {
    let mut alone = scene.clone();
    let grows = second.radius_m / scene.ball.radius_m;
    alone.ball.radius_m = second.radius_m;
    alone.ball.mass_kg *= grows.powi(3);
    alone.look.ball_grey = second.ball_grey;
    alone.look.marks = None;
    alone.launch.drop_height_m = second.drop_height_m;
    alone.launch.speed_m_s = second.speed_m_s;
    alone.launch.rise_speed_m_s = second.rise_speed_m_s;
    alone.launch.surface_spin_m_s = Vector3::zeros();
    alone.launch.bench = None;
    alone.camera.bump = None;
    alone.camera.pan = None;
    alone.second_ball = None;
    // The floor goes on through its origin.
    let q = scene.camera.metres_per_pixel;
    alone.camera.origin_px[0] += second.x_m / q;
    alone.camera.origin_px[1] -= second.x_m * scene.floor.slope_rad.tan() / q;
    alone.stop = Stop {
        bounces: 1,
        tail_s: end_s + second.start_s.abs(),
    };
    alone.effects = EffectsChoice::all(Switch::Off);
    alone
}
