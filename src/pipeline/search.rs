//! The search for the flight: first with the centres as they were first seen, then with what the recording has in common.

use super::refine::{self, BallCentre, BallModel};
use super::{Recording, is_used, pairs};
use crate::detect::centre::Accuracy;
use crate::detect::centre::appearance::RadiusSource;
use crate::flight::fit::{Forces, VerticalPrior};
use crate::flight::linking::Spot;
use crate::flight::{self, Flight, NoFlight};

/// Part of the first look's points that must be found again for the second look to count.
const KEPT_PART: f64 = 0.75;

/// Part of the first look's points that must be found again for the thing to be a ball.
const BALL_PART: f64 = 0.5;

/// Balls smaller than this may be measured by their outline alone, px.
const SMALL_BALL_PX: f64 = 6.0;

impl Recording<'_> {
    /// The flight, with the time of frames that its impacts show to be missing.
    pub(super) fn find_flight(&mut self) -> Result<Flight, NoFlight> {
        let flight = self.find_flight_as_timed()?;
        let skips = flight::dropped_frames::at_impacts(&flight);
        if skips.is_empty() {
            return Ok(flight);
        }
        let before = (
            self.base.clone(),
            self.found.clone(),
            self.shared.clone(),
            self.optics,
        );
        self.base = self.base.clone().with_skips(&pairs(&skips));
        self.found.clear();
        let moved = self.find_flight_as_timed();
        // Where that is what was missing, the impacts are where they were, and their arcs meet.
        match moved {
            Ok(moved)
                if moved.used() >= flight.used() && flight::dropped_frames::at_impacts(&moved).is_empty() =>
            {
                self.note_file();
                Ok(moved)
            }
            _ => {
                (self.base, self.found, self.shared, self.optics) = before;
                Ok(flight)
            }
        }
    }

    /// The flight: first with centres found freely, then with what the recording has in common held.
    fn find_flight_as_timed(&mut self) -> Result<Flight, NoFlight> {
        let spots = self.first_spots();
        let forces = if self.falls() {
            Forces::Fall(VerticalPrior::LEVEL_CAMERA)
        } else {
            self.overhead(None, None).map_or(Forces::None, Forces::Overhead)
        };
        let flight = flight::find(&spots, forces)?;
        for p in &flight.points {
            if let Some(centre) = self.seen.sightings[p.spot.id].centre {
                self.found.push(BallCentre {
                    sighting: p.spot.id,
                    centre,
                });
            }
        }
        let first_found = self.found.clone();
        // A radius that the pixels seem to tell may be a false one, and a ball that looks too different from frame to frame
        // has no one appearance: the outlines' radius has to do, or the outline itself.
        let looks = [
            (self.accuracy, RadiusSource::Fitted),
            (self.accuracy, RadiusSource::Outlines),
            (Accuracy::Fast, RadiusSource::Outlines),
        ];
        let looks = if self.accuracy == Accuracy::Fast {
            &looks[2..]
        } else {
            &looks[..]
        };
        let mut as_first_seen = Err(NoFlight::NothingFalls {
            longest: flight.points.len(),
        });
        for &(accuracy, radius) in looks {
            if as_first_seen.is_ok() && accuracy != self.accuracy {
                break;
            }
            match self.refined(&flight, accuracy, radius) {
                Ok(better) if self.shared.is_some() => return Ok(better),
                outcome => {
                    as_first_seen = as_first_seen.or(outcome);
                    self.found.clone_from(&first_found);
                    self.shared = None;
                }
            }
        }
        as_first_seen
    }

    fn pictures(&self) -> refine::BallPictures<'_> {
        refine::BallPictures {
            seen: &self.seen,
            map: &self.map,
            silhouettes: self.silhouettes(),
        }
    }

    fn frames(&self) -> refine::FrameTimes<'_> {
        refine::FrameTimes {
            times_s: &self.base.times_s,
            skip: &self.repeats,
        }
    }

    /// The flight once more with centres by the method of `accuracy`: first where the first flight leads, then where
    /// the better arcs do.
    fn refined(
        &mut self,
        first: &Flight,
        accuracy: Accuracy,
        radius: RadiusSource,
    ) -> Result<Flight, NoFlight> {
        let mut flight = first.clone();
        let above = matches!(first.fit.forces, Forces::Overhead(_));
        self.shared = None;
        for round in 0..2 {
            // Seen from above, a better flight is a better size of the ball in every frame.
            let again = accuracy == Accuracy::Fine || above;
            let learned = self.shared.clone().filter(|_| !again);
            let pictures = self.pictures();
            let learn = || refine::shared(&pictures, &self.found, &flight, accuracy, radius);
            let Some(shared) = learned.or_else(learn) else {
                break;
            };
            // What was found with the same appearance stays; a new one is a new measurement.
            let known: &[BallCentre] = if round > 0 && !again { &self.found } else { &[] };
            let found = refine::centres(&pictures, &flight, &shared, &self.frames(), known, accuracy);
            let scale = self.metres_per_unit(&flight, Some(shared.radius_px)).ok();
            self.optics = self.optics_at(scale);
            let forces = self.forces(&flight, &shared);
            let refitted = flight::again(&self.spots_of(&found), &flight, forces);
            let kept = self.kept_part(&found, first);
            match refitted {
                Some(better) if kept >= KEPT_PART && is_as_full(&better, first) => {
                    (flight, self.found) = if above {
                        (better, found)
                    } else {
                        self.extended(better, found, &shared, forces, accuracy)
                    };
                    self.shared = Some(shared);
                }
                // A ball of a few pixels may be too blurred for its edge to be fitted: its outline has to do. A
                // larger thing without the outline of a ball is no ball.
                refitted
                    if shared.radius_px.value > SMALL_BALL_PX && (refitted.is_none() || kept < BALL_PART) =>
                {
                    return Err(NoFlight::NothingFalls {
                        longest: first.points.len(),
                    });
                }
                _ => break,
            }
        }
        Ok(flight)
    }

    /// The part of the points used in `first` in whose frames the ball was found again.
    fn kept_part(&self, found: &[BallCentre], first: &Flight) -> f64 {
        let frames: Vec<usize> = found
            .iter()
            .map(|f| self.seen.sightings[f.sighting].frame)
            .collect();
        let again = first
            .points
            .iter()
            .filter(|p| is_used(p.use_) && frames.binary_search(&p.spot.frame).is_ok());
        again.count() as f64 / first.used().max(1) as f64
    }

    /// The flight with arcs before and after it, that the first look had too few points for, now that the ball's size
    /// is known.
    fn extended(
        &self,
        flight: Flight,
        mut found: Vec<BallCentre>,
        shared: &BallModel,
        forces: Forces,
        accuracy: Accuracy,
    ) -> (Flight, Vec<BallCentre>) {
        let (from, to) = flight.time_span();
        let within = |t: f64| t >= from && t <= to;
        let times_s = &self.base.times_s;
        found.retain(|f| within(times_s[self.seen.sightings[f.sighting].frame]));
        found.extend(refine::of_that_size(
            &self.pictures(),
            &flight,
            shared,
            &self.frames(),
            accuracy,
            within,
        ));
        found.sort_by_key(|f| f.sighting);
        match flight::find(&self.spots_of(&found), forces) {
            Ok(longer) if longer.used() >= flight.used() => (longer, found),
            _ => {
                found.retain(|f| within(times_s[self.seen.sightings[f.sighting].frame]));
                (flight, found)
            }
        }
    }

    /// Gravity, and drag where the ball's size and mass tell it.
    fn forces(&self, flight: &Flight, shared: &BallModel) -> Forces {
        let scale = self.metres_per_unit(flight, Some(shared.radius_px)).ok();
        let scale = scale.map(|s| s.value);
        if !self.falls() {
            return self
                .overhead(scale, Some(flight))
                .map_or(Forces::None, Forces::Overhead);
        }
        self.drag(scale, flight.mean_speed())
            .map_or(Forces::Fall(VerticalPrior::LEVEL_CAMERA), |drag| {
                Forces::FallWithDrag(VerticalPrior::LEVEL_CAMERA, drag)
            })
    }

    /// The flight under everything that is not known of it: how "up" leans by what the calibration knows alone, and the drag
    /// of a ball of which nothing is said. (While arcs are looked for in rough centres, so much freedom would let them
    /// follow what is no ball's.)
    pub(super) fn with_all_unknowns(&self, flight: Flight) -> Flight {
        let upright = VerticalPrior::known_to(self.calibration.upright_std_rad());
        let forces = flight
            .fit
            .forces
            .with_vertical(upright)
            .with_unknown_drag(flight.radius());
        if forces == flight.fit.forces {
            return flight;
        }
        flight.under(forces).unwrap_or(flight)
    }

    fn spots_of(&self, found: &[BallCentre]) -> Vec<Spot> {
        found
            .iter()
            .filter_map(|f| self.spot(f.sighting, &f.centre))
            .collect()
    }
}

/// Whether `better` uses the points of `first` within its own time: at the ends better centres may show that what looked
/// like an arc was a ball that rolls.
fn is_as_full(better: &Flight, first: &Flight) -> bool {
    let (from, to) = better.time_span();
    let within = |p: &&flight::FlightPoint| is_used(p.use_) && p.spot.time_s >= from && p.spot.time_s <= to;
    better.used() as f64 >= KEPT_PART * first.points.iter().filter(within).count() as f64
}
