//! What moves in a recording, whatever its calibration: for a person to look at.
//!
//! Everything is in pixels: round things are linked to tracks as the flight search links them, with a pixel as the unit of length.

use super::decode::{Progress, decode};
use super::error::MeasureError;
use super::spots::first_centres;
use crate::flight::linking::{LinkedSpots, Spot};
use crate::frames::{self, LumaRange};
use crate::geometry::{PixelPoint, PlanePoint};
use crate::impact::error_budget::LEAST_CENTRE_STD_PX;
use std::path::Path;

/// A recording, looked through.
#[derive(Debug, Clone)]
pub struct LookedThrough {
    /// Columns.
    pub width_px: usize,
    /// Rows.
    pub height_px: usize,
    /// Code values of black and white.
    pub luma_range: LumaRange,
    /// Shares of red and blue in luma.
    pub luma_shares: (f64, f64),
    /// Time of each frame, s; of a recording without a clock its number.
    pub times_s: Vec<f64>,
    /// Every round thing in every frame, in frame order.
    pub things: Vec<RoundThing>,
    /// The tracks that leave their place, by their numbers, the one that sweeps the largest area first.
    pub moving: Vec<usize>,
}

/// A round thing in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RoundThing {
    /// Frame in presentation order, from 0.
    pub frame: usize,
    /// Its centre in that frame's own picture.
    pub centre: PixelPoint,
    /// px.
    pub radius_px: f64,
    /// The same number has the same thing in other frames; `None` where it was seen once.
    pub track: Option<usize>,
}

/// Tracks shorter than this are not told.
const LEAST_TRACK: usize = 4;

/// Tracks whose thing leaves its place that are told, at most.
const MOST_MOVING: usize = 8;

/// Looks `video` through.
///
/// # Errors
/// What stops the decoder, or a recording with too few frames.
pub fn look_through(video: &Path, progress: &mut dyn FnMut(Progress)) -> Result<LookedThrough, MeasureError> {
    let decoded = decode(video, frames::open(video)?, progress)?;
    let centres = first_centres(&decoded.sightings);
    let spots = centres.iter().map(|c| {
        let seen = c.in_reference();
        Spot {
            id: c.id,
            frame: c.frame,
            time_s: decoded.stamps_s[c.frame],
            place: PlanePoint::new(seen.u_px, -seen.v_px),
            std: c.centre.std_px().max(LEAST_CENTRE_STD_PX),
            coded: c.coded,
            radius: c.centre.disc.radius_px,
            contrast_grey: c.centre.contrast_grey,
        }
    });
    let linked = LinkedSpots::new(spots.collect());
    let mut tracks = vec![None; centres.len()];
    let long = linked.tracks.iter().filter(|t| t.len() >= LEAST_TRACK);
    for (number, track) in long.enumerate() {
        for &i in track {
            tracks[i] = Some(number);
        }
    }
    let number_of = |spots: &Vec<Spot>| {
        let i = linked.spots.iter().position(|s| s.id == spots[0].id)?;
        tracks[i]
    };
    let sweeping = linked.sweeping(LEAST_TRACK, MOST_MOVING);
    let moving = sweeping.iter().filter_map(number_of).collect();
    let thing = |(c, track): (&super::spots::BallCentre, &Option<usize>)| RoundThing {
        frame: c.frame,
        centre: c.centre.disc.centre,
        radius_px: c.centre.disc.radius_px,
        track: *track,
    };
    let things = centres.iter().zip(&tracks).map(thing).collect();
    Ok(LookedThrough {
        width_px: decoded.info.width_px,
        height_px: decoded.info.height_px,
        luma_range: decoded.info.luma_range,
        luma_shares: decoded.info.luma_shares,
        things,
        moving,
        times_s: decoded.stamps_s,
    })
}
