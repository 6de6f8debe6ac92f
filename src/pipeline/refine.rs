//! The flight once more, with centres by what the recording has in common.
//!
//! The ball's radius, blur and exposure follow from its pixels where the centres are known; centres are found with those held,
//! near where the flight has the ball; the flight follows from the centres; and the scale, where the ball tells it, from the
//! radius, which then tells the camera's angles and the drag. So they are found in turn ([`refinement`]), until nothing is left
//! to gain.

use super::ball_model::{BallLesson, BallModel, BallPictures};
use super::camera::CalibratedCamera;
use super::centres::BallSearch;
use super::clock::Clocked;
use super::decode::Decoded;
use super::measurement::Warning;
use super::spots::BallCentre;
use super::track::{Tracked, spots_of};
use super::warnings::of_track;
use crate::detect::centre::Accuracy;
use crate::detect::centre::appearance::RadiusSource;
use crate::detect::centre::attached_shadow::AttachedShadow;
use crate::flight::flight_search::FlightSearch;
use crate::flight::linking::LinkedSpots;
use crate::flight::{self, Flight, NoFlight};
use std::ops::Range;

/// Part of the first look's points that must be found again for the second look to count.
const KEPT_PART: f64 = 0.75;

/// Part of the first look's points that must be found again for the thing to be a ball.
const BALL_PART: f64 = 0.5;

/// Balls smaller than this may be measured by their outline alone, px.
const SMALL_BALL_PX: f64 = 6.0;

/// Rounds of appearance, centres and flight, at most.
const MOST_ROUNDS: usize = 2;

/// The flight by the best centres.
#[derive(Debug)]
pub struct Refined {
    /// The flight and its centres.
    pub tracked: Tracked,
    /// What all frames share; `None` where the centres are as they were tracked.
    pub ball: Option<BallModel>,
    /// Whether the centres' radii are the ball's, as the picture or the calibration has it.
    pub radius_is_seen: bool,
    /// What the centres are by, in words: where the ball's appearance could not be learned, its outline had to do.
    pub method: &'static str,
    /// What makes the centres less sure.
    pub warnings: Vec<Warning>,
}

/// A recording to refine the flight of.
#[derive(Debug, Clone, Copy)]
pub struct Refinement<'a> {
    /// By what it was taken.
    pub camera: &'a CalibratedCamera<'a>,
    /// Its pixels.
    pub decoded: &'a Decoded,
    /// Its times.
    pub clocked: &'a Clocked,
    /// The centre method asked for.
    pub accuracy: Accuracy,
    /// The frames in which the flight is looked for: those of its launch.
    pub within: &'a Range<usize>,
    /// Times at which a person says that there is no impact, s.
    pub not_impacts_s: &'a [f64],
}

/// The flight of `first` with the best centres that the pixels give.
///
/// # Errors
/// [`NoFlight`] where what was tracked shows to be no ball.
pub fn refined(recording: &Refinement<'_>, first: Tracked) -> Result<Refined, NoFlight> {
    let asked = recording.accuracy;
    let pictures = BallPictures::new(recording.decoded, recording.camera, first.optics);
    let shadow = pictures.shadow_of(&first);
    let pictures = pictures.with_shadow(shadow.as_ref());
    let start = RefinementStart {
        first: &first,
        pictures,
        lesson: BallLesson::new(&pictures, &first, asked),
    };
    // A radius that the pixels seem to tell may be a false one, and a ball that looks too different from frame to frame has no
    // one appearance: the outlines' radius has to do, or the outline itself.
    let attempts = [
        (asked, Some(RadiusSource::Fitted)),
        (asked, Some(RadiusSource::Outlines)),
        (asked.possible(false), None),
    ];
    let needs_appearance = asked.method().appearance().is_some();
    let attempts = &attempts[if needs_appearance { 0 } else { 2 }..];
    let mut stands = false;
    let mut refused = None;
    let mut radius_fitted = true;
    for &(accuracy, radius) in attempts {
        if stands && accuracy != asked {
            break;
        }
        // Where no radius was fitted it has been the outlines' already.
        if !radius_fitted && accuracy == asked {
            continue;
        }
        let attempt = recording.refinement(&start, accuracy, radius);
        radius_fitted = attempt.radius_fitted;
        match attempt.found {
            Ok(Some((tracked, ball))) => return Ok(recording.with_warnings(tracked, Some(ball))),
            Ok(None) => stands = true,
            Err(reason) => refused = Some(reason),
        }
    }
    match refused.filter(|_| !stands) {
        Some(reason) => Err(reason),
        None => Ok(recording.with_warnings(first, None)),
    }
}

/// What each way of looking for the best centres starts from.
struct RefinementStart<'a> {
    first: &'a Tracked,
    pictures: BallPictures<'a>,
    /// `None` where the ball has no outline.
    lesson: Option<BallLesson<'a>>,
}

/// What came of looking for the best centres in one way.
struct Attempt {
    /// Whether the pixels ever told the ball's radius.
    radius_fitted: bool,
    /// `None` where nothing is better than what it started from.
    found: Result<Option<(Tracked, BallModel)>, NoFlight>,
}

impl Refinement<'_> {
    /// Appearance, whose radius is from there, centres, scale and flight in turn, from `start`. It ends after [`MOST_ROUNDS`], or
    /// where the ball cannot be learned, or is not found again in enough frames.
    fn refinement(
        &self,
        start: &RefinementStart<'_>,
        accuracy: Accuracy,
        radius: Option<RadiusSource>,
    ) -> Attempt {
        let Self { camera, clocked, .. } = *self;
        let RefinementStart { first, .. } = *start;
        // Seen from above, a better flight is a better size of the ball in every frame.
        let above = first.flight.fit.model.resolves_height();
        let learns_again = accuracy.method().appearance().is_some_and(|a| a.again) || above;
        let mut best: Option<(Tracked, BallModel)> = None;
        let mut radius_fitted = false;
        for _ in 0..MOST_ROUNDS {
            let relearned;
            // What was found with the same appearance stays; a new one is a new measurement.
            let (now, pictures, known) = match &best {
                None => (first, start.pictures, None),
                Some((now, ball)) => {
                    let pictures = BallPictures::new(self.decoded, camera, now.optics);
                    // First outlines are drawn towards a shadow beside the ball: it is learned once more of the centres that
                    // know of it, and the ball with it.
                    let shaded = start.pictures.shadow().is_some();
                    relearned = shaded.then(|| pictures.shadow_of(now)).flatten();
                    let known = Some(ball).filter(|_| !shaded && !learns_again);
                    (now, pictures.with_shadow(relearned.as_ref()), known)
                }
            };
            let relearn = || BallLesson::new(&pictures, now, accuracy)?.ball(radius);
            let ball = match (&best, known) {
                (None, _) => start.lesson.as_ref().and_then(|lesson| lesson.ball(radius)),
                (_, Some(ball)) => Some(ball.clone()),
                (_, None) => relearn(),
            };
            let known = known.map_or(&[][..], |_| &now.centres);
            let Some(ball) = ball else {
                break;
            };
            radius_fitted |= ball.appearance.as_ref().is_some_and(|a| a.radius_fitted);
            let centres = self.search(&pictures, &ball, accuracy).along(&now.flight, known);
            let scale = camera
                .metres_per_unit(&now.flight, Some(ball.whole_radius_px()))
                .ok();
            let optics = camera.optics(scale);
            let model = camera.motion_model(Some(&now.flight), scale);
            let spots = spots_of(camera, clocked, &centres, optics);
            let mut flight = flight::find_again(&spots, &now.flight, &*model);
            if let Some(flight) = &mut flight {
                flight.deny_impacts(self.not_impacts_s);
            }
            let kept = kept_part(&centres, &first.flight);
            match flight {
                Some(flight) if kept >= KEPT_PART && is_as_full(&flight, &first.flight) => {
                    let found = Tracked {
                        flight,
                        centres,
                        optics,
                        first_look: first.first_look.clone(),
                        others: first.others.clone(),
                    };
                    let found = if above {
                        found
                    } else {
                        self.extended(found, &ball, &*model, accuracy, pictures.shadow())
                    };
                    best = Some((found, ball));
                }
                // A ball of a few pixels may be too blurred for its edge to be fitted: its outline has to do. A larger thing
                // without the outline of a ball is no ball.
                flight if ball.edge_radius_px() > SMALL_BALL_PX && (flight.is_none() || kept < BALL_PART) => {
                    let longest = first.flight.points.len();
                    let found = Err(NoFlight::NothingFalls { longest });
                    return Attempt { radius_fitted, found };
                }
                _ => break,
            }
        }
        let found = Ok(best);
        Attempt { radius_fitted, found }
    }

    fn search<'s>(
        &'s self,
        pictures: &BallPictures<'s>,
        ball: &'s BallModel,
        accuracy: Accuracy,
    ) -> BallSearch<'s> {
        BallSearch {
            pictures: *pictures,
            frames: self.clocked.frames(),
            within: self.within,
            ball,
            accuracy,
        }
    }

    /// The flight with arcs before and after it, that the first look had too few points for, now that the ball's size is known.
    fn extended(
        &self,
        found: Tracked,
        ball: &BallModel,
        model: &dyn FlightSearch,
        accuracy: Accuracy,
        shadow: Option<&AttachedShadow>,
    ) -> Tracked {
        let Tracked {
            flight,
            centres,
            optics,
            first_look,
            others,
        } = found;
        let (from, to) = flight.time_span();
        let within = |t: f64| t >= from && t <= to;
        let times_s = &self.clocked.base.times_s;
        let exposed_s = |c: &BallCentre| times_s[c.frame] + self.camera.readout.delay_s(c.centre.disc.centre);
        let (inside, _): (Vec<_>, Vec<_>) = centres.into_iter().partition(|c| within(exposed_s(c)));
        let pictures = BallPictures::new(self.decoded, self.camera, optics).with_shadow(shadow);
        let around = self.search(&pictures, ball, accuracy).around(&flight, within);
        let mut all = [&inside[..], &around[..]].concat();
        all.sort_by_key(|c| c.id);
        all.dedup_by_key(|c| c.id);
        let spots = spots_of(self.camera, self.clocked, &all, optics);
        match flight::find(&LinkedSpots::new(spots), model) {
            Ok(mut longer) if longer.used() >= flight.used() => {
                longer.deny_impacts(self.not_impacts_s);
                Tracked {
                    flight: longer,
                    centres: all,
                    optics,
                    first_look,
                    others,
                }
            }
            _ => Tracked {
                flight,
                centres: inside,
                optics,
                first_look,
                others,
            },
        }
    }

    fn with_warnings(&self, tracked: Tracked, ball: Option<BallModel>) -> Refined {
        let learned = ball.as_ref().is_some_and(|b| b.appearance.is_some());
        let method = self.accuracy.possible(learned);
        let flight = &tracked.flight;
        let flown: Vec<usize> = flight.used_points().map(|p| p.spot.frame).collect();
        let warnings = [
            of_track::not_learned(self.accuracy, method),
            ball.as_ref().and_then(of_track::overexposed),
            of_track::light(self.decoded, &flown),
            of_track::lingering(flight, self.decoded.stamps_s.len()),
            of_track::others(&tracked.others, self.camera),
        ];
        Refined {
            warnings: warnings.into_iter().flatten().collect(),
            tracked,
            ball,
            radius_is_seen: true,
            method: method.method().words().description,
        }
    }
}

/// The part of the points used in `first` in whose frames the ball was found again.
fn kept_part(centres: &[BallCentre], first: &Flight) -> f64 {
    let again = first
        .used_points()
        .filter(|p| centres.binary_search_by_key(&p.spot.frame, |c| c.frame).is_ok());
    again.count() as f64 / first.used().max(1) as f64
}

/// Whether `better` uses the points of `first` within its own time: at the ends better centres may show that what looked like an
/// arc was a ball that rolls.
fn is_as_full(better: &Flight, first: &Flight) -> bool {
    let (from, to) = better.time_span();
    let within = first
        .used_points()
        .filter(|p| p.spot.time_s >= from && p.spot.time_s <= to);
    better.used() as f64 >= KEPT_PART * within.count() as f64
}
