//! How well a clock suits what moves: the likelihood by which clocks compete.
//!
//! A clock says when each frame was taken and which frames show the one before once more. Under it the sightings of what falls
//! are divided into arcs of parabolas and points that belong to none ([`super::segment`]); the squared residuals with a price for each arc
//! and each point left out are −2 ln L of that clock, up to a constant ([`Explained`]). Under a wrong clock arcs break, or
//! their points lie off them. A frame that repeats another has its ball where that has it, else it counts as left out.
//!
//! Clocks of a family with two free numbers are many. Which of them are worth that division is told by the third divided
//! difference of four successive places, which is 0 on a parabola whatever its fall ([`MovingTracks::step_misfit`]).
//!
//! Assumed: something falls, or moves straight, through several arcs or through one that is long. Where nothing does, all
//! clocks explain as much and the stamps stand.

use super::flight_search::FlightSearch;
use super::linking::{LinkedSpots, Spot, median_radius};
use super::path::{FINE_SCATTERS, divided, variance};
use super::segment::DROP_COST;

/// When the frames were taken, and which show nothing new.
#[derive(Debug, Clone, Copy)]
pub struct FrameTimes<'a> {
    /// Time of each, s, of its middle row; that of the frame before for one that repeats it.
    pub times_s: &'a [f64],
    /// Those that show the one before once more.
    pub duplicates: &'a [bool],
}

impl FrameTimes<'_> {
    /// Those of `spots` that show something new, at their times.
    #[must_use]
    pub fn distinct(&self, spots: &[Spot]) -> Vec<Spot> {
        let new = spots.iter().filter(|s| !self.duplicates[s.frame]);
        let timed = |s: &Spot| Spot {
            time_s: self.times_s[s.frame],
            ..*s
        };
        new.map(timed).collect()
    }
}

/// Shorter tracks are not asked.
const LEAST_TRACK: usize = 8;

/// What moves, as it was linked frame by frame whatever the clock: the data by which clocks compete.
#[derive(Debug)]
pub struct MovingTracks<'a> {
    spots: &'a [Spot],
    tracks: Vec<Vec<Spot>>,
}

/// Tracks that are asked: those that sweep the largest area, which noise that is linked at random does not.
const MOST_TRACKS: usize = 4;

impl<'a> MovingTracks<'a> {
    /// Those of `linked`, of all frames, repeats included.
    #[must_use]
    pub fn new(linked: &'a LinkedSpots) -> Self {
        Self {
            spots: &linked.spots,
            tracks: linked.sweeping(LEAST_TRACK, MOST_TRACKS),
        }
    }

    /// Those that have arcs of a ball under `frames`.
    #[must_use]
    pub fn falling(&self, frames: FrameTimes<'_>, model: &dyn FlightSearch) -> Vec<bool> {
        let falls = |t: &Vec<Spot>| model.candidate(&frames.distinct(t), false).is_some();
        self.tracks.iter().map(falls).collect()
    }

    /// What `frames` explain of the tracks `asked`.
    #[must_use]
    pub fn explained(&self, frames: FrameTimes<'_>, asked: &[bool]) -> Explained {
        let repeats = RepeatedSpots::new(self.spots, frames);
        let asked = self.tracks.iter().zip(asked).filter(|(_, asked)| **asked);
        let mut all = Explained {
            gain: 0.0,
            room: 0.0,
            fall: None,
        };
        let mut most = 0.0;
        for (track, _) in asked {
            let distinct = frames.distinct(track);
            let seen = divided(&distinct, None, &FINE_SCATTERS);
            let (again, could) = repeats.of(&distinct);
            all.gain += seen.gain + again;
            all.room += seen.room + could - again;
            if seen.gain > most {
                most = seen.gain;
                all.fall = seen.fall.map(|fall| (fall.down, median_radius(track)));
            }
        }
        all
    }
}

/// What a clock explains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Explained {
    /// 2 ln L over that of a clock under which nothing is explained.
    pub gain: f64,
    /// By how much another clock may gain at most.
    pub room: f64,
    /// The fall of what is explained best, plane units/s², and its radius, plane units.
    pub fall: Option<(f64, f64)>,
}

/// The sightings in frames that repeat others.
struct RepeatedSpots<'a> {
    /// For each frame its sightings.
    spots: Vec<&'a [Spot]>,
    duplicates: &'a [bool],
}

impl<'a> RepeatedSpots<'a> {
    fn new(spots: &'a [Spot], frames: FrameTimes<'a>) -> Self {
        let mut of_frame: Vec<&[Spot]> = vec![&[]; frames.duplicates.len()];
        for part in spots.chunk_by(|a, b| a.frame == b.frame) {
            of_frame[part[0].frame] = part;
        }
        Self {
            spots: of_frame,
            duplicates: frames.duplicates,
        }
    }

    /// What is explained of the repeats of a `track`'s sightings, and could be.
    fn of(&self, track: &[Spot]) -> (f64, f64) {
        let (mut gain, mut most) = (0.0, 0.0);
        for first in track {
            let repeats = self.duplicates[first.frame + 1..].iter().take_while(|d| **d);
            for here in &self.spots[first.frame + 1..][..repeats.count()] {
                let off = |s: &Spot| {
                    let (dr, du) = (s.place.right - first.place.right, s.place.up - first.place.up);
                    (dr * dr + du * du) / (variance(s) + variance(first))
                };
                // Where the ball is not found again nothing tells.
                if let Some(off) = here.iter().map(off).min_by(f64::total_cmp) {
                    gain += DROP_COST - off.min(DROP_COST);
                    most += DROP_COST;
                }
            }
        }
        (gain, most)
    }
}

impl MovingTracks<'_> {
    /// −2 ln L of `frames` by all windows of four successive pictures, and by what repeats another: a first look at many clocks. The
    /// likelihood is Cauchy's: an impact is far off under any clock.
    #[must_use]
    pub fn step_misfit(&self, frames: FrameTimes<'_>) -> f64 {
        let mut sum = 0.0;
        for track in &self.tracks {
            let mut last: [Option<&Spot>; 3] = [None; 3];
            for s in track.iter().take(MOST_WINDOWS) {
                if frames.duplicates[s.frame] {
                    if let Some(first) =
                        last[2].filter(|f| frames.times_s[f.frame] == frames.times_s[s.frame])
                    {
                        let (dr, du) = (s.place.right - first.place.right, s.place.up - first.place.up);
                        sum += 3.0 * ((dr * dr + du * du) / (variance(s) + variance(first))).ln_1p();
                    }
                    continue;
                }
                if let [Some(a), Some(b), Some(c)] = last
                    && let Some(square) = third_difference([a, b, c, s], frames.times_s)
                {
                    sum += 3.0 * square.ln_1p();
                }
                last = [last[1], last[2], Some(s)];
            }
        }
        sum
    }
}

/// Points of a track that are looked at first, at most.
const MOST_WINDOWS: usize = 300;

/// Squared third divided difference in variances, of both coordinates; `None` where times do not increase.
fn third_difference(s: [&Spot; 4], times_s: &[f64]) -> Option<f64> {
    let t = s.map(|p| times_s[p.frame]);
    if t.windows(2).any(|p| !(p[1] > p[0])) {
        return None;
    }
    let (mut right, mut up, mut squares) = (0.0, 0.0, 0.0);
    for (i, p) in s.iter().enumerate() {
        let others = (0..4).filter(|j| *j != i);
        let c = 1.0 / others.map(|j| t[i] - t[j]).product::<f64>();
        right += c * p.place.right;
        up += c * p.place.up;
        squares += c * c * variance(p);
    }
    let square = (right * right + up * up) / squares;
    square.is_finite().then_some(square)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::PlanePoint;

    /// A bouncing ball as frames that were `taken` at these times show it.
    fn clip(taken: impl Fn(usize) -> f64) -> Vec<Spot> {
        let spots = (0..60).map(|frame| {
            let t = taken(frame);
            let phase = (t + 0.25) % 0.5;
            Spot {
                coded: crate::frames::Coded::Whole,
                id: frame,
                frame,
                time_s: frame as f64 / 120.0,
                place: PlanePoint::new(300.0 * t, 4000.0 * 0.5 * phase * (0.5 - phase)),
                std: 0.05,
                radius: 8.0,
                contrast_grey: 100.0,
            }
        });
        spots.collect()
    }

    #[test]
    fn the_clock_of_the_flight_explains_more_and_suits_better() {
        let even = |i: usize| i as f64 / 120.0;
        let stored = |i: usize| (i + i / 4) as f64 / 150.0;
        let duplicates = &[false; 60][..];
        for (taken, other) in [
            (&even as &dyn Fn(usize) -> f64, &stored as &dyn Fn(usize) -> f64),
            (&stored, &even),
        ] {
            let spots = clip(taken);
            let linked = LinkedSpots::new(spots);
            let moving = MovingTracks::new(&linked);
            let of = |clock: &dyn Fn(usize) -> f64| {
                let times_s: &[f64] = &(0..60).map(clock).collect::<Vec<_>>();
                let frames = FrameTimes { times_s, duplicates };
                (moving.explained(frames, &[true; 4]), moving.step_misfit(frames))
            };
            let ((right, near), (wrong, far)) = (of(taken), of(other));
            assert!(right.gain > wrong.gain + 100.0, "{right:?} {wrong:?}");
            assert!(right.room < 20.0 && wrong.room > 100.0, "{right:?} {wrong:?}");
            assert!(near < far);
        }
    }

    #[test]
    fn a_frame_that_repeats_another_has_its_ball_there() {
        let (times_s, duplicates): (Vec<f64>, Vec<bool>) =
            (0..60).map(|i| ((i / 2) as f64 / 60.0, i % 2 == 1)).unzip();
        let twice = clip(|i| (i / 2) as f64 / 60.0);
        let frames = FrameTimes {
            times_s: &times_s,
            duplicates: &duplicates,
        };
        let once = clip(|i| i as f64 / 120.0);
        let of = |spots: Vec<Spot>| {
            let linked = LinkedSpots::new(spots);
            MovingTracks::new(&linked).explained(frames, &[true; 4])
        };
        let (right, wrong) = (of(twice), of(once));
        assert!(right.gain > wrong.gain + 300.0, "{right:?} {wrong:?}");
    }
}
