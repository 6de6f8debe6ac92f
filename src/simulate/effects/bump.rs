//! The table is bumped: at each impact it swings, and with it the camera, so that the whole picture shifts.
//!
//! ```text
//! shift(t) = amplitude Σ (v_n,i / v_n,1) sin(2π f (t − t_i)) exp(−(t − t_i)/τ)        over the impacts at t_i ≤ t
//! ```
//!
//! with v_n the speed along the floor's normal. A frame is shifted as a whole, by the shift in its middle; noise is of the
//! sensor, and uneven light of the lens: they stay.

use super::{Action, Effect, EffectEstimate, Ideal, PictureShift};
use crate::simulate::flight::{Impact, Trajectory};
use crate::simulate::scene::{self, Scene, Switch};
use nalgebra::Vector2;
use std::f64::consts::PI;

/// Bump.
pub(super) struct Bump;

/// A shift below this is none, px: such frames have the plain backdrop, which is made once.
const LEAST_SHIFT_PX: f64 = 1e-3;

impl Effect for Bump {
    fn name(&self) -> &'static str {
        "bump"
    }

    fn estimate(&self, scene: &Scene, ideal: &Ideal) -> EffectEstimate {
        let formula = "amplitude, times what swings of earlier impacts leave and add";
        let Some(bump) = scene.camera.bump else {
            return EffectEstimate::px(0.0, formula);
        };
        EffectEstimate::px(
            bump.amplitude_px.norm() * envelope(&bump, &ideal.trajectory),
            formula,
        )
    }

    fn action(&self, scene: &Scene) -> Action {
        match scene.camera.bump {
            Some(bump) if bump.amplitude_px.norm() > 0.0 => Action::PictureShift(Box::new(Swing { bump })),
            _ => Action::Nothing,
        }
    }
}

/// The largest value of Σ (v_n,i / v_n,1) exp(−(t − t_i)/τ), which is right after an impact; 1 where swings are over before
/// the next one.
fn envelope(bump: &scene::SceneBump, trajectory: &Trajectory) -> f64 {
    let mut sum = 0.0_f64;
    let mut largest = 0.0_f64;
    let mut last_s = 0.0;
    for (impact, share) in shares(trajectory) {
        sum = sum * ((last_s - impact.time_s) / bump.decay_s).exp() + share;
        largest = largest.max(sum);
        last_s = impact.time_s;
    }
    largest
}

/// The impacts of the recording, each with its speed along the normal over that of the first.
fn shares(trajectory: &Trajectory) -> impl Iterator<Item = (&Impact, f64)> {
    let speed = |i: &Impact| {
        let along = trajectory.floor().along_normal(&i.incident.velocity_m_s);
        along.abs()
    };
    let first = trajectory.impacts().first().map_or(0.0, speed);
    trajectory
        .impacts()
        .iter()
        .take_while(|i| i.time_s <= trajectory.end_s())
        .map(move |i| (i, if first > 0.0 { speed(i) / first } else { 0.0 }))
}

/// The largest speed of the picture, px/s: what makes an impact later shifts it by that for every second.
pub(super) fn top_speed_px_s(scene: &Scene, trajectory: &Trajectory) -> f64 {
    let used = scene.effects.of(Bump.name()) != Switch::Off;
    scene.camera.bump.filter(|_| used).map_or(0.0, |bump| {
        // |d/dt sin(ω t) exp(−t/τ)| is at most sqrt(ω² + 1/τ²).
        let rate = (2.0 * PI * bump.frequency_hz).hypot(1.0 / bump.decay_s);
        bump.amplitude_px.norm() * envelope(&bump, trajectory) * rate
    })
}

struct Swing {
    bump: scene::SceneBump,
}

impl PictureShift for Swing {
    fn shift_px(&self, trajectory: &Trajectory, time_s: f64) -> Vector2<f64> {
        let swing: f64 = shares(trajectory)
            .take_while(|(i, _)| i.time_s <= time_s)
            .map(|(i, share)| {
                let since_s = time_s - i.time_s;
                share
                    * (2.0 * PI * self.bump.frequency_hz * since_s).sin()
                    * (-since_s / self.bump.decay_s).exp()
            })
            .sum();
        let shift_px = self.bump.amplitude_px * swing;
        if shift_px.norm() < LEAST_SHIFT_PX {
            Vector2::zeros()
        } else {
            shift_px
        }
    }
}
