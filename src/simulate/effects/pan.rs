//! The camera is panned or held by hand: its picture drifts by a constant velocity and wanders smoothly about that.
//!
//! ```text
//! shift(t) = velocity t + Σ a_k (sin(2π f_k t + φ_k) − sin φ_k)
//! ```
//!
//! with three slow oscillations for each axis, whose rates and phases the seed draws and whose sizes go as 1/f, so that all of them
//! together have the standard deviation that the scene asks for. It is 0 at t = 0: calibration and origin are those of the first
//! frame. A frame is shifted as a whole, by the shift in its middle, without the smear that a fast pan has in a long exposure.

use super::{Action, Effect, EffectEstimate, Ideal, PictureShift};
use crate::simulate::flight::Trajectory;
use crate::simulate::scene::{Scene, ScenePan};
use nalgebra::Vector2;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::f64::consts::{SQRT_2, TAU};

/// Pan.
pub(super) struct Pan;

/// What a hand does: drift and sway, Hz. Tremor (8 to 12 Hz) is far smaller.
const RATES_HZ: [f64; 3] = [0.4, 1.1, 2.7];
/// By how much of itself the seed changes each rate.
const RATE_SPREAD: f64 = 0.2;
/// The stream of random numbers beyond those of all frames.
const STREAM: u64 = u64::MAX;

impl Effect for Pan {
    fn name(&self) -> &'static str {
        "pan"
    }

    fn estimate(&self, scene: &Scene, ideal: &Ideal) -> EffectEstimate {
        let wander = scene.camera.pan.map(|pan| Wander::new(&pan, scene.seed));
        let shift = wander.map_or(0.0, |wander| ideal.largest(|s| wander.at(s.time_s).norm()));
        EffectEstimate::px(
            shift,
            "velocity × time, and what the hand adds, at most while the ball is seen",
        )
    }

    fn action(&self, scene: &Scene) -> Action {
        match scene.camera.pan {
            Some(pan) if pan.velocity_px_s != Vector2::zeros() || pan.wander_px > 0.0 => {
                Action::PictureShift(Box::new(Wander::new(&pan, scene.seed)))
            }
            _ => Action::Nothing,
        }
    }
}

/// How far the picture may be from where it began within `duration_s`, px.
pub(super) fn reach_px(scene: &Scene, duration_s: f64) -> f64 {
    scene.camera.pan.map_or(0.0, |pan| {
        let swings = &Wander::new(&pan, scene.seed).swings;
        let swing_px: f64 = swings.iter().map(|s| 2.0 * s.amplitude_px.norm()).sum();
        pan.velocity_px_s.norm() * duration_s + swing_px
    })
}

struct Wander {
    velocity_px_s: Vector2<f64>,
    swings: Vec<Sway>,
}

/// One oscillation along one axis.
struct Sway {
    amplitude_px: Vector2<f64>,
    rate_hz: f64,
    phase_rad: f64,
}

impl Wander {
    fn new(pan: &ScenePan, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(STREAM);
        let mut share = || f64::from(random.next_u32()) / f64::from(u32::MAX);
        // Σ a_k²/2 over the oscillations of an axis is the variance.
        let norm = RATES_HZ.iter().map(|f| f.powi(-2)).sum::<f64>().sqrt();
        let axes = [Vector2::x(), Vector2::y()];
        let swings = axes
            .into_iter()
            .flat_map(|axis| RATES_HZ.map(|rate_hz| (axis, rate_hz)))
            .map(|(axis, rate_hz)| Sway {
                amplitude_px: axis * (SQRT_2 * pan.wander_px / (rate_hz * norm)),
                rate_hz: rate_hz * (1.0 + RATE_SPREAD * (2.0 * share() - 1.0)),
                phase_rad: TAU * share(),
            })
            .collect();
        Self {
            velocity_px_s: pan.velocity_px_s,
            swings,
        }
    }

    fn at(&self, time_s: f64) -> Vector2<f64> {
        let swung = self
            .swings
            .iter()
            .map(|s| s.amplitude_px * ((TAU * s.rate_hz * time_s + s.phase_rad).sin() - s.phase_rad.sin()));
        self.velocity_px_s * time_s + swung.sum::<Vector2<f64>>()
    }
}

impl PictureShift for Wander {
    fn shift_px(&self, _trajectory: &Trajectory, time_s: f64) -> Vector2<f64> {
        self.at(time_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_begins_where_the_calibration_was_made_and_has_its_spread() {
        let pan = ScenePan {
            velocity_px_s: Vector2::zeros(),
            wander_px: 3.0,
        };
        let (mut sum, mut squares, mut count) = (0.0, 0.0, 0.0);
        for seed in 0..20 {
            let wander = Wander::new(&pan, seed);
            assert_eq!(wander.at(0.0), Vector2::zeros());
            let rest: f64 = wander.swings[..3]
                .iter()
                .map(|s| s.amplitude_px.x * s.phase_rad.sin())
                .sum();
            for i in 0..2000 {
                let u = wander.at(0.05 * f64::from(i)).x + rest;
                sum += u;
                squares += u * u;
                count += 1.0;
            }
        }
        let mean: f64 = sum / count;
        let std = (squares / count - mean * mean).sqrt();
        assert!(mean.abs() < 0.1 && (std - 3.0).abs() < 0.1, "{mean} {std}");
    }

    #[test]
    fn a_steady_pan_goes_with_time() {
        let pan = ScenePan {
            velocity_px_s: Vector2::new(40.0, -10.0),
            wander_px: 0.0,
        };
        let shift = Wander::new(&pan, 1).at(0.5);
        assert!((shift - Vector2::new(20.0, -5.0)).norm() < 1e-12);
    }
}
