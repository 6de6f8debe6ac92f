//! Why nothing was measured, and what to try.

use super::rounded;
use crate::calibration::{Calibration, View};
use crate::flight::{Flight, NoFlight};
use crate::frames::timebase::TimeBase;

/// What was seen of a recording.
#[derive(Debug, Clone, Copy)]
pub struct SeenThings {
    /// Its frames.
    pub frames: usize,
    /// How many things moved in them.
    pub moving: usize,
    /// And what these are, for the sentence: "moving regions".
    pub what: &'static str,
}

/// Why nothing was measured, and what to try.
pub fn no_flight(reason: &NoFlight, seen: SeenThings, base: &TimeBase, calibration: &Calibration) -> String {
    let SeenThings { frames, moving, what } = seen;
    match reason {
        NoFlight::NothingRound { spots } => format!(
            "no ball was found: {moving} {what} in {frames} frames, {spots} of them round. The ball must differ from what is behind it and be seen whole in several frames; the camera must stand still."
        ),
        NoFlight::NothingFalls { longest } if calibration.view == View::Top => {
            let all = format!(
                "{moving} {what} in {frames} frames, and no track of a round thing (the longest: {longest} frames)"
            );
            match calibration.distance_m {
                Some(distance_m) => format!(
                    "nothing bounces as seen from above: {all} follows the path of a bouncing ball as a camera {distance_m} m above it shows it. Are \"distance_m\" (from the lens to the calibrated plane, in metres), the scale and the frame rate right, and does the camera look straight down?"
                ),
                None => format!(
                    "nothing moves in straight lines as seen from above: {all} is made of straight lines with turns between. A camera that is near sees them bent, because the ball nears it as it rises: set \"distance_m\" to the distance from the lens to the calibrated plane."
                ),
            }
        }
        NoFlight::NothingFalls { longest } => format!(
            "nothing falls freely: {moving} {what} in {frames} frames, and no track of a round thing (the longest: {longest} frames) follows parabolas that share one fall. A ball that is held or rolls cannot be measured; is the flight in the clip, and is \"up_px\" right?{}",
            slow_frames(base, calibration.gravity_m_s2)
        ),
    }
}

/// Frames that an arc needs to be found.
const ARC_FRAMES: f64 = 5.0;

/// Rates below which the time between two impacts of a ball in the lab (0.1 s and more) may hold too few frames, Hz.
const FEW_FRAMES_HZ: f64 = 90.0;

/// That arcs may hold too few frames, where frames are slow.
fn slow_frames(base: &TimeBase, gravity_m_s2: f64) -> String {
    let slow = base.interval_s.filter(|&s| s > 1.0 / FEW_FRAMES_HZ);
    slow.map_or(String::new(), |s| {
        format!(
            " An arc needs {ARC_FRAMES} frames: at {} Hz that is {:.2} s from impact to impact, so bounces below {:.0} mm are too short; a higher frame rate helps.",
            rounded(1.0 / s),
            ARC_FRAMES * s,
            // Up and down in that time: g T² / 8.
            1e3 * gravity_m_s2 * (ARC_FRAMES * s).powi(2) / 8.0,
        )
    })
}

/// Why a flight alone is no measurement.
pub fn no_bounce(flight: &Flight, walls: usize, calibration: &Calibration) -> String {
    let frames = flight.used();
    if calibration.view == View::Top {
        return format!(
            "a ball moves freely through {frames} frames, but shows no impact within the clip: seen from above it is a turn of the path between two stretches, so keep recording until after the first one."
        );
    }
    let walls = if walls > 0 {
        format!(", and {walls} impact(s) on something upright")
    } else {
        String::new()
    };
    format!(
        "a ball flies freely through {frames} frames{walls}, but does not bounce on a floor within the clip: keep recording until after the first bounce, with the floor in the picture."
    )
}
