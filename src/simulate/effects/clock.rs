//! The clock of the file: which frames of the camera it stores, how often, and with which stamps.
//!
//! A camera takes frames at `frame_rate_hz`. The file has a place every 1/`stored_hz`: place k shows the camera's frame
//! ⌊k a/b + phase⌋ at a and b Hz, so that a slower file leaves frames out in regular places and a faster one repeats them (pulldown).
//! Then single places are left out without a trace, and single places are filled with the picture before. Stamps are even, at
//! `stamped_hz`, whatever the frames were; a container that cuts them to steps cuts them downwards.

use super::{Action, Effect, EffectEstimate, Ideal};
use crate::simulate::scene::{Scene, SceneClock};

/// Clock of the file.
pub(super) struct Clock;

/// A quotient this near below a whole number is that: 25 places of 30 Hz frames are 30 frames.
const WHOLE: f64 = 1e-9;

/// A frame of the file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StoredFrame {
    /// The camera's frame that it shows.
    pub shows: usize,
    /// Its stamp, s.
    pub stamp_s: f64,
}

impl SceneClock {
    /// Rate of the stamps, Hz, of a camera of `frame_rate_hz`.
    #[must_use]
    pub fn stamped_hz(&self, frame_rate_hz: f64) -> f64 {
        self.stamped_hz.or(self.stored_hz).unwrap_or(frame_rate_hz)
    }

    /// What the file has of a camera's `frames` frames, in order.
    #[must_use]
    pub fn stored(&self, frames: usize, frame_rate_hz: f64) -> Vec<StoredFrame> {
        let stored_hz = self.stored_hz.unwrap_or(frame_rate_hz);
        let shown_at =
            |place: usize| (place as f64 * frame_rate_hz / stored_hz + self.phase + WHOLE) as usize;
        let places = (0..).map(shown_at).take_while(|shows| *shows < frames);
        let mut shown: Vec<usize> = Vec::new();
        for (place, shows) in places.enumerate() {
            if self.left_out_places.contains(&place) {
                continue;
            }
            let before = shown
                .last()
                .copied()
                .filter(|_| self.filled_places.contains(&place));
            shown.push(before.unwrap_or(shows));
        }
        let stamped_hz = self.stamped_hz(frame_rate_hz);
        let stamp_s = |i: usize| {
            let even_s = i as f64 / stamped_hz;
            self.stamp_step_s
                .map_or(even_s, |step_s| (even_s / step_s + WHOLE).floor() * step_s)
        };
        shown
            .into_iter()
            .enumerate()
            .map(|(i, shows)| StoredFrame {
                shows,
                stamp_s: stamp_s(i),
            })
            .collect()
    }
}

impl Effect for Clock {
    fn name(&self) -> &'static str {
        "clock"
    }

    fn estimate(&self, scene: &Scene, ideal: &Ideal) -> EffectEstimate {
        let rate_hz = scene.camera.frame_rate_hz;
        let late_s = scene.camera.clock.as_ref().map_or(0.0, |clock| {
            let frames = (ideal.trajectory.end_s() * rate_hz) as usize + 1;
            let late_s = |f: &StoredFrame| (f.stamp_s - f.shows as f64 / rate_hz).abs();
            clock
                .stored(frames, rate_hz)
                .iter()
                .map(late_s)
                .fold(0.0, f64::max)
        });
        let shift = if late_s > 0.0 {
            ideal.top_speed_px_s(scene) * late_s
        } else {
            0.0
        };
        EffectEstimate::px(shift, "the largest speed × the largest error of a stamp")
    }

    fn action(&self, scene: &Scene) -> Action {
        scene
            .camera
            .clock
            .clone()
            .map_or(Action::Nothing, |clock| Action::Clock(Box::new(clock)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(clock: &SceneClock, frames: usize, rate_hz: f64) -> Vec<usize> {
        clock.stored(frames, rate_hz).iter().map(|f| f.shows).collect()
    }

    #[test]
    fn slower_files_leave_frames_out_and_faster_ones_repeat_them() {
        let at = |stored_hz: f64| SceneClock {
            stored_hz: Some(stored_hz),
            ..SceneClock::default()
        };
        assert_eq!(shown(&at(25.0), 13, 30.0), [0, 1, 2, 3, 4, 6, 7, 8, 9, 10, 12]);
        assert_eq!(shown(&at(60.0), 5, 48.0), [0, 0, 1, 2, 3, 4, 4]);
        let later = SceneClock {
            phase: 0.5,
            ..at(25.0)
        };
        assert_eq!(shown(&later, 8, 30.0), [0, 1, 2, 4, 5, 6, 7]);
        let stamps: Vec<f64> = at(25.0).stored(4, 30.0).iter().map(|f| f.stamp_s).collect();
        assert_eq!(stamps, [0.0, 0.04, 0.08, 0.12]);
    }

    #[test]
    fn single_places_are_left_out_or_filled_and_stamps_are_cut() {
        let clock = SceneClock {
            left_out_places: vec![2],
            filled_places: vec![4],
            stamp_step_s: Some(0.001),
            ..SceneClock::default()
        };
        assert_eq!(shown(&clock, 7, 240.0), [0, 1, 3, 3, 5, 6]);
        let stamps: Vec<f64> = clock.stored(5, 240.0).iter().map(|f| f.stamp_s).collect();
        let cut = [0.0, 0.004, 0.008, 0.012];
        assert!(
            stamps.iter().zip(cut).all(|(a, b)| (a - b).abs() < 1e-12),
            "{stamps:?}"
        );
        assert_eq!(shown(&SceneClock::default(), 3, 240.0), [0, 1, 2]);
    }
}
