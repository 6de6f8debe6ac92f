//! Centres once the flight is known: each is looked for where the arcs say the ball is, with what the recording shares of it
//! held. Frames in which the ball's outline was not found at first (it touched its shadow, a hand, another thing) are looked
//! at again there.

use super::ball_model::{BallModel, BallPictures};
use super::spots::{BallCentre, with_id};
use crate::detect::LEAST_AGREEMENT;
use crate::detect::centre::disc::bent_px;
use crate::detect::centre::{Accuracy, Centre, CentreInput, Disc, outline};
use crate::flight::Flight;
use crate::flight::clock::FrameTimes;
use crate::geometry::PixelPoint;
use rayon::prelude::*;
use std::ops::Range;

/// How long before and after the flight found at first the ball may have been missed, s.
const AROUND_S: f64 = 1.5;

/// Of a ball on no arc yet: where the shutter rolls it is fitted as if it stood.
const UNKNOWN_VELOCITY: [f64; 2] = [0.0; 2];

/// A search for a ball of known size and looks in the frames of a recording.
#[derive(Debug, Clone, Copy)]
pub struct BallSearch<'a> {
    /// Where.
    pub pictures: BallPictures<'a>,
    /// When.
    pub frames: FrameTimes<'a>,
    /// In these frames only.
    pub within: &'a Range<usize>,
    /// Of what.
    pub ball: &'a BallModel,
    /// How.
    pub accuracy: Accuracy,
}

impl BallSearch<'_> {
    /// The ball in every frame from the flight's first to its last, looked for where the arcs say; what is in `known` stands.
    pub fn along(&self, flight: &Flight, known: &[BallCentre]) -> Vec<BallCentre> {
        let FrameTimes { times_s, duplicates } = self.frames;
        let sightings = &self.pictures.decoded.sightings;
        let (from, to) = reach(flight);
        let wanted: Vec<usize> = (0..sightings.len())
            .filter(|&i| {
                let frame = sightings[i].frame;
                let t = times_s[frame];
                t >= from && t <= to && !duplicates[frame] && self.within.contains(&frame)
            })
            .collect();
        let each: Vec<Option<BallCentre>> = wanted
            .par_iter()
            .map(|&i| {
                let t = times_s[sightings[i].frame];
                with_id(known, i).copied().or_else(|| self.guided(flight, i, t))
            })
            .collect();
        let mut centres: Vec<BallCentre> = Vec::new();
        for c in each.into_iter().flatten() {
            // Two regions of one frame may both hold the place: the better outline is the ball.
            match centres.last_mut().filter(|last| last.frame == c.frame) {
                Some(last) => {
                    if c.centre.outline_used > last.centre.outline_used {
                        *last = c;
                    }
                }
                None => centres.push(c),
            }
        }
        centres
    }

    /// Everything that has the ball's outline, near the time of the flight and not `within` it: looked for with its size known,
    /// which finds a faint or spoilt ball better than the first look did.
    pub fn around(&self, flight: &Flight, within: impl Fn(f64) -> bool + Sync) -> Vec<BallCentre> {
        let FrameTimes { times_s, duplicates } = self.frames;
        let (from, to) = reach(flight);
        let sightings = self.pictures.decoded.sightings.par_iter().enumerate();
        sightings
            .filter(|(_, s)| {
                let t = times_s[s.frame];
                let asked = !duplicates[s.frame] && self.within.contains(&s.frame);
                asked && t > from - AROUND_S && t < to + AROUND_S && !within(t)
            })
            .filter_map(|(i, s)| {
                let alike = |c: &Centre| {
                    let size = self.pictures.size(s, c.disc.centre);
                    (c.disc.radius_px / (size * self.ball.outline_px) - 1.0).abs() < 0.3
                };
                let first = s.centre.filter(alike);
                let centre = first.map_or(s.blob.centroid, |c| c.disc.centre);
                let start = Disc {
                    centre,
                    radius_px: self.ball.edge_radius_px() * self.pictures.size(s, centre),
                    swept_px: first.map_or([0.0; 2], |c| c.disc.swept_px),
                    bent_px: [0.0; 2],
                };
                self.outlined(i, &start, UNKNOWN_VELOCITY)
            })
            .collect()
    }

    /// The ball in a sighting of a frame taken at `t`, near the place where the flight has it.
    fn guided(&self, flight: &Flight, id: usize, t: f64) -> Option<BallCentre> {
        let pictures = &self.pictures;
        let s = &pictures.decoded.sightings[id];
        let (t, there) = pictures.predicted(flight, s, t)?;
        let radius_px = self.ball.edge_radius_px() * flight.magnification_at(t) * pictures.size(s, there);
        // Near the prediction the first look's own centre is the better start; far from it, it is another thing.
        let gate = 0.5 * radius_px + 2.0;
        let first = s.centre.filter(|c| c.disc.centre.distance_px(there) < gate);
        // Where memory had no room for its pixels, that is all there is.
        if s.blob.crop.luma.data.is_empty() {
            return first.map(|c| BallCentre::new(id, s, c));
        }
        if !s.blob.crop.contains(there, -0.3 * radius_px) {
            return None;
        }
        let velocity_px_s = pictures.velocity_px_s(flight, t)?;
        let swept_px = pictures
            .seen_velocity_px_s(velocity_px_s)
            .map(|v| v * self.ball.exposure_s());
        let start = first.map_or(there, |c| c.disc.centre);
        let disc = Disc {
            centre: start,
            radius_px,
            swept_px,
            bent_px: bent_px(pictures.acceleration_px_s2(flight, t)?, self.ball.exposure_s()),
        };
        let close = |c: &BallCentre, to: PixelPoint, gate: f64| c.centre.disc.centre.distance_px(to) < gate;
        self.fitted(id, &disc, velocity_px_s)
            .or_else(|| {
                self.outlined(id, &disc, velocity_px_s)
                    .filter(|c| close(c, start, 0.5 * radius_px))
            })
            .filter(|c| close(c, there, gate))
    }

    /// The centre near `start` of a ball of this velocity.
    fn fitted(&self, id: usize, start: &Disc, velocity_px_s: [f64; 2]) -> Option<BallCentre> {
        let s = &self.pictures.decoded.sightings[id];
        let patch = self.pictures.patch(s, start, velocity_px_s);
        let round = patch.affine.map_or(*start, |d| d.disc_in_patch(start));
        let appearance = self.ball.appearance.as_ref();
        let method = self.accuracy.possible(appearance.is_some()).method();
        let centre = method.centre(&CentreInput {
            patch: &patch,
            start: round,
            appearance,
            magnification: start.radius_px / self.ball.edge_radius_px(),
            gain: s.registration.gain,
            contrast_grey: s.blob.contrast_grey,
        })?;
        let mut centre = patch.affine.map_or(centre, |d| d.centre_in_frame(&centre));
        if let Some(colour) = &self.pictures.decoded.colour {
            // A fit takes the noise of its pixels for independent.
            for c in centre.covariance_px2.as_flattened_mut() {
                *c *= colour.noise_area;
            }
        }
        Some(BallCentre::new(id, s, centre))
    }

    /// The centre wherever around `start` the patch holds an outline of the ball's size.
    fn outlined(&self, id: usize, start: &Disc, velocity_px_s: [f64; 2]) -> Option<BallCentre> {
        let s = &self.pictures.decoded.sightings[id];
        let outline_px = self.ball.outline_px * start.radius_px / self.ball.edge_radius_px();
        let found = outline::find(
            &self.pictures.patch(s, start, velocity_px_s),
            start.centre,
            Some(outline_px),
        )?;
        let disc = Disc {
            centre: found.disc.centre,
            ..*start
        };
        (found.agreement >= LEAST_AGREEMENT)
            .then(|| self.fitted(id, &disc, velocity_px_s))
            .flatten()
    }
}

/// First and last time to look at: a few frames beyond the flight's ends, where the ball may have been hidden by the hand or cut
/// by the border.
fn reach(flight: &Flight) -> (f64, f64) {
    let (from, to) = flight.time_span();
    (from - 5.5 * flight.interval_s, to + 5.5 * flight.interval_s)
}
