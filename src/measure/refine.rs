//! Centres once the flight is known: one radius, one blur and one exposure for the whole recording, each fit started
//! where the arcs say the ball is. Frames in which the ball's outline was not found at first (it touched its shadow, a
//! hand, another thing) are looked at again there.

use super::observe::Observation;
use crate::calibration::Rectification;
use crate::detect::Sighting;
use crate::detect::centre::edge_band::{Effort, Freedom};
use crate::detect::centre::{Centre, Disc};
use crate::flight::linking::Spot;
use crate::flight::{Flight, SpotUse};
use crate::geometry::PixelPoint;
use crate::quantity::{Quantity, median};

/// What all frames share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shared {
    /// The ball's radius, px.
    pub radius_px: Quantity,
    /// Standard deviation of the edge's blur, px.
    pub blur_px: f64,
    /// How long the shutter is open, s; 0 where its smear cannot be seen.
    pub exposure_s: f64,
}

/// A ball found: the sighting and its centre.
#[derive(Debug, Clone, Copy)]
pub struct Found {
    /// Index into the observation's sightings.
    pub sighting: usize,
    /// The centre.
    pub centre: Centre,
}

/// The one of `found` (in the order of sightings, as all lists of them are) that is of this sighting.
#[must_use]
pub fn of_sighting(found: &[Found], sighting: usize) -> Option<&Found> {
    found
        .binary_search_by_key(&sighting, |f| f.sighting)
        .ok()
        .map(|i| &found[i])
}

/// The exposure is estimated from at most this many frames, the fastest.
const EXPOSURE_FRAMES: usize = 24;

/// A sweep shorter than this hardly differs from a little more blur, px.
const LEAST_SWEEP_PX: f64 = 0.7;

/// Radius, blur and exposure from some of the flight's used points, spread over it.
#[must_use]
pub fn shared(seen: &Observation, found: &[Found], flight: &Flight, map: &Rectification) -> Option<Shared> {
    let used: Vec<(&Sighting, Centre, f64)> = flight
        .points
        .iter()
        .filter(|p| matches!(p.use_, SpotUse::Used(_)))
        .filter_map(|p| {
            let f = of_sighting(found, p.spot.id)?;
            Some((&seen.sightings[f.sighting], f.centre, p.spot.time_s))
        })
        .collect();
    let exposure_s = exposure(seen, flight, map, &used).unwrap_or(0.0);
    let step = used.len().div_ceil(SHARED_FRAMES).max(1);
    let fits: Vec<Centre> = used
        .iter()
        .step_by(step)
        .filter_map(|(s, c, t)| {
            let [a, b] = velocity_px_s(flight, map, *t)?;
            let disc = Disc {
                swept_px: [a * exposure_s, b * exposure_s],
                ..c.disc
            };
            // A smeared ball costs many times more and is no better known for it.
            let effort = if speed(disc.swept_px) > 2.0 {
                Effort::Look
            } else {
                Effort::Measure
            };
            seen.detector
                .guided_centre(&s.blob.crop, &s.registration, &disc, Freedom { effort, ..FREE })
        })
        .collect();
    let whole: Vec<Centre> = fits.iter().copied().filter(|c| c.outline_used > 0.85).collect();
    let good = if whole.len() >= 3 { whole } else { fits };
    let mut blurs: Vec<f64> = good.iter().map(|c| c.blur_px).collect();
    let blur_px = median(&mut blurs)?;
    Some(Shared {
        radius_px: common_radius(&good)?,
        blur_px,
        exposure_s,
    })
}

/// Radius and blur are taken from at most about this many frames.
const SHARED_FRAMES: usize = 40;

/// A fit that finds radius and blur itself.
const FREE: Freedom = Freedom {
    radius: true,
    blur_px: None,
    swept: false,
    effort: Effort::Measure,
};

/// Median radius with the standard error that the radii's own scatter shows.
fn common_radius(good: &[Centre]) -> Option<Quantity> {
    let mut radii: Vec<f64> = good.iter().map(|c| c.disc.radius_px).collect();
    let n = radii.len() as f64;
    let radius = median(&mut radii)?;
    let mut off: Vec<f64> = radii.iter().map(|r| (r - radius).abs()).collect();
    let spread = 1.4826 * median(&mut off)?;
    // 1.2533: the median's standard error over the mean's.
    let std = if n >= 3.0 {
        1.2533 * spread / n.sqrt()
    } else {
        f64::NAN
    };
    Quantity::new(radius, std)
}

/// Exposure time: the length of the smear over the speed, in the fastest frames; `None` where it does not show.
fn exposure(
    seen: &Observation,
    flight: &Flight,
    map: &Rectification,
    used: &[(&Sighting, Centre, f64)],
) -> Option<f64> {
    let mut fast: Vec<(&Sighting, Centre, [f64; 2])> = used
        .iter()
        .filter_map(|(s, c, t)| Some((*s, *c, velocity_px_s(flight, map, *t)?)))
        .collect();
    fast.sort_by(|a, b| speed(b.2).total_cmp(&speed(a.2)));
    fast.truncate(EXPOSURE_FRAMES);
    let top = speed(fast.first()?.2);
    // No shutter is open longer than a frame.
    let longest = flight.interval_s;
    let mut times: Vec<f64> = Vec::new();
    for (s, c, v) in &fast {
        let start_s = (0.3 * longest).min(2.0 * c.disc.radius_px / speed(*v));
        let disc = Disc {
            swept_px: [v[0] * start_s, v[1] * start_s],
            ..c.disc
        };
        let freedom = Freedom {
            swept: true,
            effort: Effort::Look,
            ..FREE
        };
        if let Some(fit) = seen
            .detector
            .guided_centre(&s.blob.crop, &s.registration, &disc, freedom)
        {
            times.push(speed(fit.disc.swept_px) / speed(*v));
        }
    }
    if times.len() < 3 {
        return None;
    }
    let exposure_s = median(&mut times)?.min(longest);
    let mut off: Vec<f64> = times.iter().map(|t| (t - exposure_s).abs()).collect();
    let spread = 1.4826 * median(&mut off)?;
    (exposure_s * top > LEAST_SWEEP_PX && spread < 0.5 * exposure_s).then_some(exposure_s)
}

fn speed(v: [f64; 2]) -> f64 {
    v[0].hypot(v[1])
}

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
/// held. `times_s` of all frames, `skip` the frames not to look at (repeats).
#[must_use]
pub fn centres(
    seen: &Observation,
    flight: &Flight,
    map: &Rectification,
    shared: &Shared,
    times_s: &[f64],
    skip: &[bool],
    effort: Effort,
) -> Vec<Found> {
    let (from, to) = reach(flight);
    let mut found: Vec<Found> = Vec::new();
    let mut best_frame = None;
    for (i, s) in seen.sightings.iter().enumerate() {
        let t = times_s[s.frame];
        if t < from || t > to || skip[s.frame] {
            continue;
        }
        let Some(centre) = guided(seen, flight, map, shared, s, t, effort) else {
            continue;
        };
        // Two regions of one frame may both hold the place: the better outline is the ball.
        if best_frame == Some(s.frame) {
            if let Some(last) = found.last_mut()
                && centre.outline_used > last.centre.outline_used
            {
                *last = Found { sighting: i, centre };
            }
            continue;
        }
        best_frame = Some(s.frame);
        found.push(Found { sighting: i, centre });
    }
    found
}

/// Everything that has the ball's outline, near the time of the flight: looked for with radius and blur held, which
/// finds a faint or spoilt ball better than the first look did.
#[must_use]
pub fn of_that_size(
    seen: &Observation,
    flight: &Flight,
    shared: &Shared,
    times_s: &[f64],
    skip: &[bool],
    without: impl Fn(f64) -> bool,
) -> Vec<Found> {
    let (from, to) = reach(flight);
    let freedom = Freedom {
        radius: false,
        blur_px: Some(shared.blur_px),
        swept: false,
        effort: Effort::Look,
    };
    seen.sightings
        .iter()
        .enumerate()
        .filter(|(_, s)| {
            let t = times_s[s.frame];
            !skip[s.frame] && t > from - AROUND_S && t < to + AROUND_S && !without(t)
        })
        .filter_map(|(sighting, s)| {
            let first = s
                .centre
                .filter(|c| (c.disc.radius_px / shared.radius_px.value - 1.0).abs() < 0.3);
            let start = Disc {
                centre: first.map_or(s.blob.centroid, |c| c.disc.centre),
                radius_px: shared.radius_px.value,
                swept_px: first.map_or([0.0; 2], |c| c.disc.swept_px),
            };
            let centre = seen
                .detector
                .outlined_centre(&s.blob.crop, &s.registration, &start, freedom)?;
            Some(Found { sighting, centre })
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
    seen: &Observation,
    flight: &Flight,
    map: &Rectification,
    shared: &Shared,
    s: &Sighting,
    t: f64,
    effort: Effort,
) -> Option<Centre> {
    let there = s.registration.frame_from_reference(predicted(flight, map, t)?);
    let radius_px = shared.radius_px.value;
    if !s.blob.crop.contains(there, -0.3 * radius_px) {
        return None;
    }
    let [a, b] = velocity_px_s(flight, map, t)?;
    let swept_px = [a * shared.exposure_s, b * shared.exposure_s];
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
    let freedom = Freedom {
        radius: false,
        blur_px: Some(shared.blur_px),
        swept: false,
        effort,
    };
    let centre = seen
        .detector
        .guided_centre(&s.blob.crop, &s.registration, &disc, freedom)?;
    (centre.disc.centre.distance_px(there) < gate).then_some(centre)
}

/// The spot of a centre found in `frame`: in the plane, with its uncertainty there.
#[must_use]
pub fn spot(map: &Rectification, s: &Sighting, centre: &Centre, id: usize, time_s: f64) -> Option<Spot> {
    let reference = s.registration.reference_from_frame(centre.disc.centre);
    let place = map.plane_from_pixel(reference)?;
    let unit = map.jacobian(reference)?.determinant().abs().sqrt();
    Some(Spot {
        id,
        frame: s.frame,
        time_s,
        place,
        std: unit * centre.std_px().max(LEAST_STD_PX),
        radius: unit * centre.disc.radius_px,
        contrast_grey: centre.contrast_grey,
    })
}

/// No centre is better than this: rounding to 8 bits and the optics see to it, px.
const LEAST_STD_PX: f64 = 0.002;
