//! How the arcs of a motion model are found in what moves: the other half of the seam of [`super::motion_model`].

use super::free_flight::Flight;
use super::linking::{LinkedSpots, Spot, Track};
use super::motion_model::MotionModel;
use super::parabola::Gravity;

/// A motion model that finds its flights among tracks.
pub trait FlightSearch: MotionModel {
    /// What speaks for a track (its `spots`) being the ball's; `None` where nothing on it moves as a ball does. `leaning`: whether
    /// its fall may lean.
    fn candidate(&self, spots: &[Spot], leaning: bool) -> Option<TrackCandidate>;

    /// The `best` candidate's `track`, then the same with others that are the same ball before or after it (it left the picture, or was
    /// hidden), one more each time. Without any by default.
    fn with_continuations(
        &self,
        _linked: &LinkedSpots,
        track: &Track,
        _best: &TrackCandidate,
        _leaning: bool,
    ) -> Vec<Track> {
        vec![track.clone()]
    }

    /// The flight along a track (its `spots`) by a first idea of its fall: the track is cut into arcs, these are fitted and judged until they
    /// hold together. `None` where they do not.
    fn flight_along(&self, spots: &[Spot], gravity: Gravity, interval_s: f64) -> Option<Flight>;
}

/// A track that may be the ball's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackCandidate {
    /// The common fall of its arcs.
    pub gravity: Gravity,
    /// How much speaks for it: the candidate with the most is the ball's.
    pub evidence: f64,
    /// First and last time of its arcs, s.
    pub span: (f64, f64),
}

/// Falls that differ by less than this part cut a track alike: half a second of fall, 1.2 m, then ends within 2 mm.
const SAME_FALL: f64 = 0.002;

/// Times that a track is cut again.
const FALL_ROUNDS: usize = 4;

/// The flight along a track, from a first idea of the fall: where the arcs then show another fall, they are cut again
/// with that.
pub(super) fn flight_with_its_fall(
    model: &dyn FlightSearch,
    spots: &[Spot],
    gravity: Gravity,
    interval_s: f64,
) -> Option<Flight> {
    let mut flight = model.flight_along(spots, gravity, interval_s)?;
    let mut known = gravity;
    for _ in 0..FALL_ROUNDS {
        let shown = flight.fit.acceleration();
        let change = (shown.down - known.down).hypot(shown.across - known.across);
        if change <= SAME_FALL * known.down.abs() {
            break;
        }
        known = shown;
        match model.flight_along(spots, known, interval_s) {
            Some(again) if again.used() >= flight.used() => flight = again,
            _ => break,
        }
    }
    Some(flight)
}
