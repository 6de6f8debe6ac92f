//! Centres once the flight is known: one appearance of the ball for the whole recording, each fit started where the arcs
//! say the ball is. Frames in which the ball's outline was not found at first (it touched its shadow, a
//! hand, another thing) are looked at again there.

use super::decode::Decoded;
use crate::calibration::{Rectification, Silhouette, Silhouettes};
use crate::detect::centre::affine_patch::AffinePatch;
use crate::detect::centre::appearance::{self, AppearanceFrame, AppearanceSettings, RadiusSource};
use crate::detect::centre::known_ball::{self, Appearance, FitSettings};
use crate::detect::centre::{Accuracy, Centre, Disc, Patch, ball, fast, fine, outline, standard};
use crate::detect::{LEAST_AGREEMENT, Sighting};
use crate::flight::linking::Spot;
use crate::flight::{Flight, SpotUse};
use crate::geometry::PixelPoint;
use crate::quantity::{Quantity, median};
use rayon::prelude::*;

/// What all frames share.
#[derive(Debug, Clone)]
pub struct BallModel {
    /// The usual ball's radius, px: where the optical axis meets the calibrated plane ([`Silhouettes`]).
    pub radius_px: Quantity,
    /// The radius that first outlines have, px: of a ball of few pixels it is larger.
    pub outline_px: f64,
    /// What it looks like; `None` where that is not asked for or could not be learned: then its outline has to do.
    pub appearance: Option<Appearance>,
    /// Part of the rim that hardly differs from what is behind it, or differs the other way: where a ball's dark side fades into
    /// the wall.
    pub faded: f64,
}

impl BallModel {
    /// How long the shutter is open, s; 0 where its smear cannot be seen.
    fn exposure_s(&self) -> f64 {
        self.appearance.as_ref().map_or(0.0, |a| a.exposure_s)
    }
}

/// Standard deviation of the error that all centres share, px, where a codec or a shaking camera displaces each by
/// `displaced_px`.
#[must_use]
pub fn common_std_px(shared: Option<&BallModel>, displaced_px: f64) -> f64 {
    shared
        .and_then(|s| s.appearance.as_ref())
        .map_or(OUTLINE_COMMON_STD_PX, |a| {
            a.shift_std_px
                .hypot(LEARNED_COMMON_STD_PX)
                .hypot(LASTING_PART * displaced_px)
                .hypot(FADED_STD_PX * shared.map_or(0.0, |s| s.faded))
        })
}

/// What the model of the ball leaves out (a highlight's shape, the optics' real blur) shifts all centres by this, px.
const LEARNED_COMMON_STD_PX: f64 = 0.005;

/// Where the rim fades into the wall the outline says little of that side, and the light has to: of a ball with half of its rim
/// faded the centre is off by about this times a half, px.
const FADED_STD_PX: f64 = 0.12;

/// A rim that differs from what is behind it by less than this part of where it differs most is faded.
const FADED_PART: f64 = 0.25;

/// The part of a ball's rim that is faded, with light of these `terms`, before a scene of `behind_grey`.
fn faded_part(terms: &[f64], behind_grey: f64) -> f64 {
    let contrast = ball::rim_grey(terms).map(|grey| grey - behind_grey);
    let most = contrast
        .into_iter()
        .max_by(|a, b| a.abs().total_cmp(&b.abs()))
        .unwrap_or(0.0);
    let faded = contrast.iter().filter(|c| *c / most < FADED_PART).count();
    faded as f64 / contrast.len() as f64
}

/// Part of what a codec displaces each centre by that lasts: it leaves the ball where it was predicted, in one direction while
/// the ball flies in one.
const LASTING_PART: f64 = 0.15;

/// Standard deviation of what differs of that error between the places of two impacts (uneven light, another direction of
/// motion), px.
#[must_use]
pub fn places_std_px(displaced_px: f64) -> f64 {
    PLACES_STD_PX.hypot(LASTING_PART * displaced_px)
}

/// The same where nothing displaces the centres, px.
const PLACES_STD_PX: f64 = 0.002;

/// A shaded ball's outline is off towards the light by about this, px.
const OUTLINE_COMMON_STD_PX: f64 = 0.1;

/// What is learned of the ball, and how hard each centre is looked for.
fn method(accuracy: Accuracy) -> Option<(&'static AppearanceSettings, &'static FitSettings)> {
    match accuracy {
        Accuracy::Fast => None,
        Accuracy::Standard => Some((&standard::APPEARANCE, &standard::FIT)),
        Accuracy::Fine => Some((&fine::APPEARANCE, &fine::FIT)),
    }
}

/// A ball found: the sighting and its centre.
#[derive(Debug, Clone, Copy)]
pub struct BallCentre {
    /// Index into the observation's sightings.
    pub sighting: usize,
    /// The centre.
    pub centre: Centre,
}

/// When the frames were taken, and which not to look at.
#[derive(Debug, Clone, Copy)]
pub struct FrameTimes<'a> {
    /// Time of each, s.
    pub times_s: &'a [f64],
    /// Those that repeat the one before.
    pub skip: &'a [bool],
}

/// A recording as its camera sees it.
#[derive(Debug, Clone, Copy)]
pub struct BallPictures<'a> {
    /// What moves.
    pub seen: &'a Decoded,
    /// From the reference picture to the calibrated plane.
    pub map: &'a Rectification,
    /// How the picture draws a ball.
    pub silhouettes: Silhouettes<'a>,
}

impl BallPictures<'_> {
    /// The outline of a ball at a place of a sighting's frame.
    fn silhouette(&self, s: &Sighting, p: PixelPoint) -> Option<Silhouette> {
        self.silhouettes.at(s.registration.reference_from_frame(p))
    }

    /// How many times larger than usual a ball of the calibrated plane is there.
    fn size(&self, s: &Sighting, p: PixelPoint) -> f64 {
        self.silhouette(s, p).map_or(1.0, |drawn| drawn.size)
    }

    /// The pixels around a sighting, and how the picture draws out a ball like `disc` there.
    fn patch<'a>(&self, s: &'a Sighting, disc: &Disc) -> Patch<'a> {
        let drawn = self
            .silhouette(s, disc.centre)
            .filter(|drawn| drawn.elongation() * disc.radius_px > ROUND_ENOUGH_PX);
        Patch {
            affine: drawn.and_then(|drawn| AffinePatch::new(disc.centre, drawn.stretch)),
            ..self.seen.detector.patch(&s.blob.crop, &s.registration)
        }
    }
}

/// An outline this little longer than wide is round, px.
const ROUND_ENOUGH_PX: f64 = 0.01;

/// How many times larger than in the calibrated plane the ball is seen at `t`.
fn magnification(flight: &Flight, t: f64) -> f64 {
    flight.fit.magnification(arc_at(flight, t), t)
}

/// The one of `found` (in the order of sightings, as all lists of them are) that is of this sighting.
#[must_use]
pub fn of_sighting(found: &[BallCentre], sighting: usize) -> Option<&BallCentre> {
    found
        .binary_search_by_key(&sighting, |f| f.sighting)
        .ok()
        .map(|i| &found[i])
}

/// The ball's radius and appearance from some of the flight's used points, spread over it.
#[must_use]
pub fn shared(
    pictures: &BallPictures<'_>,
    found: &[BallCentre],
    flight: &Flight,
    accuracy: Accuracy,
    radius: RadiusSource,
) -> Option<BallModel> {
    let BallPictures { seen, map, .. } = *pictures;
    let used: Vec<(&Sighting, Centre, f64)> = flight
        .points
        .iter()
        .filter(|p| matches!(p.use_, SpotUse::Used(_)))
        .filter_map(|p| {
            let f = of_sighting(found, p.spot.id)?;
            let sighting = &seen.sightings[f.sighting];
            let kept = !sighting.blob.crop.luma.data.is_empty();
            kept.then_some((sighting, f.centre, p.spot.time_s))
        })
        .collect();
    let mut behind_grey = None;
    let appearance = method(accuracy).and_then(|(settings, _)| {
        let step = used.len().div_ceil(settings.frames).max(1);
        let examples: Vec<AppearanceFrame<'_>> = used
            .iter()
            .skip(step / 2)
            .step_by(step)
            .filter_map(|(s, centre, t)| {
                let velocity_px_s = velocity_px_s(flight, map, *t)?;
                let patch = pictures.patch(s, &centre.disc);
                let moving = Disc {
                    swept_px: velocity_px_s,
                    ..centre.disc
                };
                let round = patch.affine.map_or(moving, |d| d.disc_in_patch(&moving));
                Some(AppearanceFrame {
                    patch,
                    disc: centre.disc,
                    velocity_px_s: round.swept_px,
                    gain: s.registration.gain,
                    magnification: magnification(flight, *t) * pictures.size(s, centre.disc.centre),
                })
            })
            .collect();
        let mut behind: Vec<f64> = examples
            .iter()
            .filter_map(|e| e.patch.background.first().map(|&b| f64::from(b)))
            .collect();
        behind_grey = median(&mut behind);
        appearance::estimate(&examples, flight.interval_s, settings, radius)
    });
    let faded = appearance
        .as_ref()
        .zip(behind_grey)
        .map_or(0.0, |(a, behind)| faded_part(&a.terms, behind));
    let outlines = common_radius(pictures, flight)?;
    let radius_px = match &appearance {
        Some(a) => Quantity::new(a.radius_px, a.radius_std_px.unwrap_or(f64::NAN))?,
        None => outlines,
    };
    Some(BallModel {
        radius_px,
        outline_px: outlines.value,
        appearance,
        faded,
    })
}

/// Median radius of the outlines with the standard error that their own scatter shows.
fn common_radius(pictures: &BallPictures<'_>, flight: &Flight) -> Option<Quantity> {
    let mut radii: Vec<f64> = flight
        .points
        .iter()
        .filter(|p| matches!(p.use_, SpotUse::Used(_)))
        .filter_map(|p| {
            let sighting = &pictures.seen.sightings[p.spot.id];
            let disc = sighting.centre?.disc;
            let size = pictures.size(sighting, disc.centre);
            Some(disc.radius_px / (size * magnification(flight, p.spot.time_s)))
        })
        .collect();
    let n = radii.len() as f64;
    let radius = median(&mut radii)?;
    let mut off: Vec<f64> = radii.iter().map(|r| (r - radius).abs()).collect();
    let spread = 1.4826 * median(&mut off)?;
    // 1.2533: the median's standard error over the mean's. An outline's own error is common to all.
    let std = if n >= 3.0 {
        (1.2533 * spread / n.sqrt()).hypot(OUTLINE_RADIUS_STD_PX)
    } else {
        f64::NAN
    };
    Quantity::new(radius, std)
}

/// Outlines are at half of the edge's height, which shading and blur put up to this far from the rim, px.
const OUTLINE_RADIUS_STD_PX: f64 = 0.2;

/// The arc that holds at `t`: up to an impact the one before, after it the one behind; beyond the ends the nearest.
#[must_use]
pub fn arc_at(flight: &Flight, t: f64) -> usize {
    flight
        .impacts
        .iter()
        .take_while(|i| i.is_none_or(|impact| t > impact))
        .count()
}

/// Where the arcs say the ball is at `t`, in the reference picture.
#[must_use]
pub fn predicted(flight: &Flight, map: &Rectification, t: f64) -> Option<PixelPoint> {
    let m = flight.fit.motion(arc_at(flight, t), t);
    map.pixel_from_plane(crate::geometry::PlanePoint::new(m.r, m.h))
}

/// Velocity in the picture at `t`, px/s.
fn velocity_px_s(flight: &Flight, map: &Rectification, t: f64) -> Option<[f64; 2]> {
    let k = arc_at(flight, t);
    let dt = 1e-3 * flight.interval_s;
    let at = |t: f64| {
        let m = flight.fit.motion(k, t);
        map.pixel_from_plane(crate::geometry::PlanePoint::new(m.r, m.h))
    };
    let (a, b) = (at(t - dt)?, at(t + dt)?);
    Some([(b.u_px - a.u_px) / (2.0 * dt), (b.v_px - a.v_px) / (2.0 * dt)])
}

/// The ball in every frame from the flight's first to its last, looked for where the arcs say, with what is shared
/// held; what is in `known` stands.
#[must_use]
pub fn centres(
    pictures: &BallPictures<'_>,
    flight: &Flight,
    shared: &BallModel,
    frames: &FrameTimes<'_>,
    known: &[BallCentre],
    accuracy: Accuracy,
) -> Vec<BallCentre> {
    let FrameTimes { times_s, skip } = *frames;
    let seen = pictures.seen;
    let (from, to) = reach(flight);
    let wanted: Vec<usize> = (0..seen.sightings.len())
        .filter(|&i| {
            let frame = seen.sightings[i].frame;
            let t = times_s[frame];
            t >= from && t <= to && !skip[frame]
        })
        .collect();
    let each: Vec<Option<BallCentre>> = wanted
        .par_iter()
        .map(|&i| {
            let s = &seen.sightings[i];
            of_sighting(known, i)
                .copied()
                .or_else(|| guided(pictures, flight, shared, i, times_s[s.frame], accuracy))
        })
        .collect();
    let mut found: Vec<BallCentre> = Vec::new();
    for f in each.into_iter().flatten() {
        // Two regions of one frame may both hold the place: the better outline is the ball.
        let frame = |f: &BallCentre| seen.sightings[f.sighting].frame;
        match found.last_mut().filter(|last| frame(last) == frame(&f)) {
            Some(last) => {
                if f.centre.outline_used > last.centre.outline_used {
                    *last = f;
                }
            }
            None => found.push(f),
        }
    }
    found
}

/// Everything that has the ball's outline, near the time of the flight: looked for with its size known, which finds a
/// faint or spoilt ball better than the first look did.
#[must_use]
pub fn of_that_size(
    pictures: &BallPictures<'_>,
    flight: &Flight,
    shared: &BallModel,
    frames: &FrameTimes<'_>,
    accuracy: Accuracy,
    without: impl Fn(f64) -> bool,
) -> Vec<BallCentre> {
    let FrameTimes { times_s, skip } = *frames;
    let (from, to) = reach(flight);
    pictures
        .seen
        .sightings
        .iter()
        .enumerate()
        .filter(|(_, s)| {
            let t = times_s[s.frame];
            !skip[s.frame] && t > from - AROUND_S && t < to + AROUND_S && !without(t)
        })
        .filter_map(|(sighting, s)| {
            let alike = |c: &Centre| {
                let size = pictures.size(s, c.disc.centre);
                (c.disc.radius_px / (size * shared.outline_px) - 1.0).abs() < 0.3
            };
            let first = s.centre.filter(alike);
            let centre = first.map_or(s.blob.centroid, |c| c.disc.centre);
            let start = Disc {
                centre,
                radius_px: shared.radius_px.value * pictures.size(s, centre),
                swept_px: first.map_or([0.0; 2], |c| c.disc.swept_px),
            };
            outlined(pictures, sighting, &start, shared, accuracy)
        })
        .collect()
}

/// How long before and after the flight found at first the ball may have been missed, s.
const AROUND_S: f64 = 1.5;

/// First and last time to look at: a few frames beyond the flight's ends, where the ball may have been hidden by the
/// hand or cut by the border.
fn reach(flight: &Flight) -> (f64, f64) {
    let from = flight.spans.iter().map(|s| s.0).fold(f64::INFINITY, f64::min);
    let to = flight.spans.iter().map(|s| s.1).fold(f64::NEG_INFINITY, f64::max);
    (from - 5.5 * flight.interval_s, to + 5.5 * flight.interval_s)
}

fn guided(
    pictures: &BallPictures<'_>,
    flight: &Flight,
    shared: &BallModel,
    sighting: usize,
    t: f64,
    accuracy: Accuracy,
) -> Option<BallCentre> {
    let map = pictures.map;
    let s = &pictures.seen.sightings[sighting];
    let there = s.registration.frame_from_reference(predicted(flight, map, t)?);
    let radius_px = shared.radius_px.value * magnification(flight, t) * pictures.size(s, there);
    if !s.blob.crop.contains(there, -0.3 * radius_px) {
        return None;
    }
    let swept_px = velocity_px_s(flight, map, t)?.map(|v| v * shared.exposure_s());
    // Near the prediction the first look's own centre is the better start; far from it, it is another thing.
    let gate = 0.5 * radius_px + 2.0;
    let start = s
        .centre
        .map(|c| c.disc.centre)
        .filter(|c| c.distance_px(there) < gate)
        .unwrap_or(there);
    let disc = Disc {
        centre: start,
        radius_px,
        swept_px,
    };
    let close = |f: &BallCentre, to: PixelPoint, gate: f64| f.centre.disc.centre.distance_px(to) < gate;
    fitted(pictures, sighting, &disc, shared, accuracy)
        .or_else(|| {
            outlined(pictures, sighting, &disc, shared, accuracy).filter(|f| close(f, start, 0.5 * radius_px))
        })
        .filter(|f| close(f, there, gate))
}

/// The centre near `start` by the method of `accuracy`.
fn fitted(
    pictures: &BallPictures<'_>,
    sighting: usize,
    start: &Disc,
    shared: &BallModel,
    accuracy: Accuracy,
) -> Option<BallCentre> {
    let s = &pictures.seen.sightings[sighting];
    let patch = pictures.patch(s, start);
    let round = patch.affine.map_or(*start, |d| d.disc_in_patch(start));
    let centre = match (&shared.appearance, method(accuracy)) {
        (Some(ball), Some((_, effort))) => {
            let ball = ball.magnified(start.radius_px / shared.radius_px.value, effort);
            known_ball::fit(&patch, &ball, &round, s.registration.gain, effort)?.centre
        }
        _ => fast::centre(&patch, &round, s.blob.contrast_grey)?,
    };
    let centre = patch.affine.map_or(centre, |d| d.centre_in_frame(&centre));
    Some(BallCentre { sighting, centre })
}

/// The centre wherever around `start` the patch holds an outline of the ball's size.
fn outlined(
    pictures: &BallPictures<'_>,
    sighting: usize,
    start: &Disc,
    shared: &BallModel,
    accuracy: Accuracy,
) -> Option<BallCentre> {
    let patch = pictures.patch(&pictures.seen.sightings[sighting], start);
    let outline_px = shared.outline_px * start.radius_px / shared.radius_px.value;
    let found = outline::find(&patch, start.centre, Some(outline_px))?;
    let disc = Disc {
        centre: found.disc.centre,
        ..*start
    };
    (found.agreement >= LEAST_AGREEMENT)
        .then(|| fitted(pictures, sighting, &disc, shared, accuracy))
        .flatten()
}

/// The spot of a centre found in `frame`: in the plane, with its uncertainty there. `fixed`: whether the camera stands still,
/// but for swings.
#[must_use]
pub fn spot(
    (map, fixed): (&Rectification, bool),
    s: &Sighting,
    centre: &Centre,
    id: usize,
    time_s: f64,
) -> Option<Spot> {
    let reference = s.registration.reference_from_frame(centre.disc.centre);
    let place = map.plane_from_pixel(reference)?;
    let unit = map.jacobian(reference)?.determinant().abs().sqrt();
    Some(Spot {
        id,
        frame: s.frame,
        time_s,
        place,
        std: unit * centre.std_px().max(LEAST_STD_PX).hypot(swing_std_px(s, fixed)),
        coded: s.coded,
        radius: unit * centre.disc.radius_px,
        contrast_grey: centre.contrast_grey,
    })
}

/// Standard deviation of each coordinate of a centre in a picture that swings, px: how well its edges tell by how much, which the
/// codec draws anew, and a part of the swing for what turns or smears in it.
fn swing_std_px(s: &Sighting, fixed: bool) -> f64 {
    if fixed && !s.registration.is_still() {
        SWING_STD_PX.hypot(SWING_PART * s.registration.shift_px())
    } else {
        0.0
    }
}

const SWING_STD_PX: f64 = 0.08;
const SWING_PART: f64 = 0.05;

/// No centre is better than this: rounding to 8 bits and the optics see to it, px.
const LEAST_STD_PX: f64 = 0.002;
