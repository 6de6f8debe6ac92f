//! What differs when a camera above is near: the ball grows as it rises, so each frame has a radius of its own.
//!
//! With ζ the ball's height and c its radius, both over the camera's height, a ball of R plane units is seen with the
//! radius R/√((1 − ζ)² − c²); see [`crate::calibration::Viewpoint`].

use super::observe::Observation;
use super::refine::{self, Found, Shared};
use super::unstretch::Rounded;
use crate::calibration::{Rectification, Viewpoint};
use crate::detect::Sighting;
use crate::detect::centre::edge_band::{Effort, Freedom};
use crate::detect::centre::{Centre, Disc};
use crate::flight::fit::Forces;
use crate::flight::{Flight, FlightPoint, SpotUse};
use crate::geometry::PixelPoint;
use crate::quantity::{Quantity, median};

/// A radius further than this part from the one expected is that of the ball with its shadow, or another thing's.
const RADIUS_GATE: f64 = 0.05;

/// Frames beyond the flight's ends that are looked at.
const BEYOND_FRAMES: f64 = 5.5;

/// How much larger than on the calibrated plane the ball is seen at `t`.
fn magnification(flight: &Flight, t: f64) -> f64 {
    let contact = match flight.fit.forces {
        Forces::Overhead(known) => known.contact.unwrap_or(0.0),
        _ => 0.0,
    };
    let left = 1.0 - flight.fit.nearness(refine::arc_at(flight, t), t);
    1.0 / (left * left - contact * contact).max(f64::MIN_POSITIVE).sqrt()
}

/// At most about this many frames tell blur and radius.
const SHARED_FRAMES: usize = 40;

/// What all frames share, as `first` has it but for blur and radius, which are fitted anew with the outline that
/// perspective makes; the radius is that in the calibrated plane: each frame's own, divided by its magnification.
#[must_use]
pub fn shared(view: &View<'_>, flight: &Flight, first: Shared, found: &[Found]) -> Option<Shared> {
    let used: Vec<&FlightPoint> = flight
        .points
        .iter()
        .filter(|p| matches!(p.use_, SpotUse::Used(_)))
        .collect();
    let freedom = Freedom {
        radius: true,
        blur_px: None,
        swept: false,
        effort: Effort::Measure,
    };
    let (mut radii, mut blurs) = (Vec::new(), Vec::new());
    for p in used.iter().step_by(used.len().div_ceil(SHARED_FRAMES).max(1)) {
        let (Some(f), t) = (refine::of_sighting(found, p.spot.id), p.spot.time_s) else {
            continue;
        };
        let disc = Disc {
            swept_px: view.swept_px(flight, t, first.exposure_s)?,
            ..f.centre.disc
        };
        let s = &view.seen.sightings[f.sighting];
        if let Some(centre) = view.centre(s, &disc, freedom) {
            radii.push(centre.disc.radius_px / magnification(flight, t));
            blurs.push(centre.blur_px);
        }
    }
    let radius = median(&mut radii)?;
    let mut off: Vec<f64> = radii.iter().map(|r| (r - radius).abs()).collect();
    let spread = 1.4826 * median(&mut off)?;
    // 1.2533: the median's standard error over the mean's.
    let std = 1.2533 * spread / (radii.len() as f64).sqrt();
    Some(Shared {
        radius_px: Quantity::new(radius, std)?,
        blur_px: median(&mut blurs)?,
        ..first
    })
}

/// The ball in every frame from the flight's first to its last and a little beyond, looked for where the arcs say and as
/// large as they say, with blur and exposure held. `times_s` of all frames, `skip` the frames not to look at.
#[must_use]
pub fn centres(
    view: &View<'_>,
    flight: &Flight,
    shared: &Shared,
    times_s: &[f64],
    skip: &[bool],
    effort: Effort,
) -> Vec<Found> {
    let sightings = &view.seen.sightings;
    let (from, to) = flight.time_span();
    let beyond = BEYOND_FRAMES * flight.interval_s;
    let mut found: Vec<Found> = Vec::new();
    for (sighting, s) in sightings.iter().enumerate() {
        let t = times_s[s.frame];
        if t < from - beyond || t > to + beyond || skip[s.frame] {
            continue;
        }
        let Some(centre) = view.guided(flight, shared, s, t, effort) else {
            continue;
        };
        // Two regions of one frame may both hold the place: the better outline is the ball.
        match found
            .last_mut()
            .filter(|f| sightings[f.sighting].frame == s.frame)
        {
            Some(last) if centre.outline_used > last.centre.outline_used => {
                *last = Found { sighting, centre }
            }
            Some(_) => {}
            None => found.push(Found { sighting, centre }),
        }
    }
    found
}

/// The recording and where the camera stands.
pub struct View<'a> {
    pub seen: &'a Observation,
    pub map: &'a Rectification,
    pub camera: Option<Viewpoint>,
}

impl View<'_> {
    /// How far the ball moves in the picture while the shutter is open, px.
    fn swept_px(&self, flight: &Flight, t: f64, exposure_s: f64) -> Option<[f64; 2]> {
        let step_s = 1e-3 * flight.interval_s;
        let at = refine::predicted(flight, self.map, t)?;
        let soon = refine::predicted(flight, self.map, t + step_s)?;
        let steps = exposure_s / step_s;
        Some([(soon.u_px - at.u_px) * steps, (soon.v_px - at.v_px) * steps])
    }

    fn guided(
        &self,
        flight: &Flight,
        shared: &Shared,
        s: &Sighting,
        t: f64,
        effort: Effort,
    ) -> Option<Centre> {
        let there = s
            .registration
            .frame_from_reference(refine::predicted(flight, self.map, t)?);
        let radius_px = shared.radius_px.value * magnification(flight, t);
        if !(radius_px.is_finite() && s.blob.crop.contains(there, -0.3 * radius_px)) {
            return None;
        }
        let gate = 0.5 * radius_px + 2.0;
        let swept_px = self.swept_px(flight, t, shared.exposure_s)?;
        let fit = |centre: PixelPoint, radius: bool| {
            let start = Disc {
                centre,
                radius_px,
                swept_px,
            };
            let freedom = Freedom {
                radius,
                blur_px: Some(shared.blur_px),
                swept: false,
                effort,
            };
            self.centre(s, &start, freedom)
                .filter(|c| c.disc.centre.distance_px(there) < gate)
        };
        let alike = |c: &Centre| (c.disc.radius_px / radius_px - 1.0).abs() < RADIUS_GATE;
        let first = s.centre.map(|c| c.disc.centre);
        let start = first.filter(|c| c.distance_px(there) < gate).unwrap_or(there);
        // With its shadow the ball may look larger, and its centre be off: then its size is what it must be.
        fit(start, true).filter(alike).or_else(|| fit(there, false))
    }

    /// The centre near `start`: of the outline as it is, or, where perspective draws it out, of the circle that it is
    /// after that is undone; `disc.radius_px` is the half axis across.
    fn centre(&self, s: &Sighting, start: &Disc, freedom: Freedom) -> Option<Centre> {
        let detector = &self.seen.detector;
        let stretch = self
            .camera
            .map(|v| v.outline_stretch(s.registration.reference_from_frame(start.centre)));
        match stretch.filter(|m| (m.determinant() - 1.0) * start.radius_px > ROUND_ENOUGH_PX) {
            None => detector.guided_centre(&s.blob.crop, &s.registration, start, freedom),
            Some(stretch) => {
                let patch = detector.patch(&s.blob.crop, &s.registration);
                Rounded::new(&patch, start, stretch)?.centre(start, freedom)
            }
        }
    }
}

/// An outline this little longer than wide counts as round, px.
const ROUND_ENOUGH_PX: f64 = 0.01;
