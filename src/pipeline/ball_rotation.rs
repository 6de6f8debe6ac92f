//! How the ball turns on each arc of a flight, from its pictures at the refined centres.
//!
//! Each picture is taken from well inside of the ball's outline, undone of what the camera draws out (perspective, lens, rolling shutter), of
//! the frame's light and of the black level. The arcs' rates are searched for one by one; an arc that shows none by itself, or
//! makes too few turns, is looked at once more in the light that all arcs have in common.
//!
//! Assumed: the light on the ball is the same along its path but for a smooth change of brightness. A ball without marks costs a look at some
//! [`SEARCH_FRAMES`] of its pictures.

use super::ball_model::{self, BallPictures};
use super::camera::CalibratedCamera;
use super::decode::Decoded;
use super::in_metres::WorldFrame;
use super::measurement::{ArcSpin, BallTurning, TurnedFrame};
use super::refine::Refined;
use super::spots::{BallCentre, with_id};
use crate::flight::{Flight, SpotUse};
use crate::geometry::PlanePoint;
use crate::impact::error_budget::{EDGE_STD_PX, MARKED_COMMON_PART, MARKED_RADIUS_PART};
use crate::impact::seen_spin::SeenSpin;
use crate::impact::spin_candidates::{ChosenSpin, MOST_SPEEDS, SpinEvidence, SpinUntold, SurfaceSpin};
use crate::quantity::Quantity;
use crate::rotation::{
    self, BallPixel, BallView, NoRate, RateCandidates, RateLimit, RotationFit, RotationSearch, SEARCH_FRAMES,
    SampledBall, SuitingRates, common_light,
};
use nalgebra::{Matrix3, Vector2, Vector3};
use rayon::prelude::*;
use std::sync::Arc;

/// Balls larger than twice this radius are looked at in blocks of pixels, px.
const FINE_RADIUS_PX: f64 = 16.0;

/// A ball of fewer pixels shows nothing, px.
const LEAST_RADIUS_PX: f64 = 5.0;

/// Blur of a picture whose ball was not learned, px.
const USUAL_BLUR_PX: f64 = 0.9;

/// How far inside of the outline pixels show nothing of what is behind the ball: so many times the blur, and px.
const CLEAR_BLURS: f64 = 2.0;
const CLEAR_PX: f64 = 0.3;

/// A rotation that leaves over so many times as much of an arc's pictures (mean square) as those of another arc leave of theirs does not explain them:
/// the ball, its marks and the camera are the same.
const MOST_LEFT: f64 = 10.0;

/// Noise that rounding alone makes, grey levels.
const LEAST_NOISE_GREY: f64 = 0.3;

/// What the pictures of an arc show.
#[derive(Debug, Clone)]
pub struct ArcRotation {
    /// First and last time of its pictures, s.
    pub span_s: (f64, f64),
    /// The frames of its pictures.
    pub frames: Vec<usize>,
    /// Their times, s.
    pub times_s: Vec<f64>,
    /// The rates, or why there is none.
    pub rates: Result<SuitingRates, NoRate>,
}

impl ArcRotation {
    /// The most likely of the rates that the ball may have.
    fn likeliest(&self) -> Option<&RotationFit> {
        self.rates.as_ref().ok()?.possible.first()
    }
}

/// A centre, and when the ball was there, s.
type TimedCentre = (BallCentre, f64);

/// The pictures of an arc: the centres that they are taken around, and the ball's pixels, if they were taken.
struct ArcPictures {
    centres: Vec<TimedCentre>,
    ball: Option<SampledBall>,
}

impl ArcPictures {
    /// First and last time of its pictures, s.
    fn span_s(&self) -> (f64, f64) {
        let time_s = |c: Option<&TimedCentre>| c.map_or(f64::NAN, |(_, t)| *t);
        (time_s(self.centres.first()), time_s(self.centres.last()))
    }
}

/// The pictures of a refined flight.
struct FlightPictures<'a> {
    decoded: &'a Decoded,
    pictures: BallPictures<'a>,
    refined: &'a Refined,
    /// Pixels along each side of a block that is taken as one.
    block: usize,
    blur_px: f64,
}

/// What the pictures of each arc of `refined` show of the ball's rotation.
pub fn of_arcs(camera: &CalibratedCamera<'_>, decoded: &Decoded, refined: &Refined) -> Vec<ArcRotation> {
    let tracked = &refined.tracked;
    let flight = &tracked.flight;
    let radius = match &refined.ball {
        Some(ball) => ball.whole_radius_px(),
        None => return Vec::new(),
    };
    let radius_px = radius.value;
    if !camera.falls() || radius_px < LEAST_RADIUS_PX {
        return Vec::new();
    }
    let block = (radius_px / FINE_RADIUS_PX).max(1.0) as usize;
    let appearance = refined.ball.as_ref().and_then(|ball| ball.appearance.as_ref());
    let own_blur_px = appearance.map_or(USUAL_BLUR_PX, |a| a.blur_px);
    let pictures = FlightPictures {
        decoded,
        pictures: BallPictures::new(decoded, camera, tracked.optics),
        refined,
        block,
        blur_px: own_blur_px,
    };
    let size = block as f64;
    let displaced_px = flight.displaced_std() / camera.units_per_px();
    let off_px = flight.centre_std() / camera.units_per_px();
    let search = RotationSearch {
        noise_grey: decoded.detector.background.noise_grey.max(LEAST_NOISE_GREY) / size,
        blur_px: own_blur_px.hypot(((size * size - 1.0) / 12.0).sqrt()),
        radius_px,
        centre_std_px: ball_model::common_std_px(refined.ball.as_ref(), displaced_px)
            .hypot(MARKED_COMMON_PART * off_px),
        turning_std_px: off_px,
        radius_std_px: radius
            .std_uncertainty
            .unwrap_or(EDGE_STD_PX)
            .hypot(MARKED_RADIUS_PART * off_px),
        light: None,
        limit: rate_limit(camera, refined, radius_px),
    };
    let shown: Vec<(ArcPictures, ArcRotation)> = (0..flight.fit.arcs())
        .into_par_iter()
        .map(|k| {
            let (arc, rates) = pictures.likelier_rates(flight, k, &search);
            let centres = &arc.centres;
            let rotation = ArcRotation {
                span_s: arc.span_s(),
                frames: centres.iter().map(|(c, _)| c.frame).collect(),
                times_s: centres.iter().map(|(_, t)| *t).collect(),
                rates,
            };
            (arc, rotation)
        })
        .collect();
    let (arcs, mut found): (Vec<ArcPictures>, Vec<ArcRotation>) = shown.into_iter().unzip();
    pictures.settle_slow(arcs, &search, &mut found);
    drop_unlike_others(&mut found);
    found
}

/// How fast a ball of `radius_px` may turn about the normal of the plane that it flies in: its surface moves at [`MOST_SPEEDS`] times the fastest speed of
/// its centre at most.
fn rate_limit(camera: &CalibratedCamera<'_>, refined: &Refined, radius_px: f64) -> RateLimit {
    let flight = &refined.tracked.flight;
    let ends = flight.spans.iter().enumerate();
    let ends = ends.flat_map(|(k, s)| [(k, s.0), (k, s.1)]);
    let speed = |(k, t)| {
        let m = flight.fit.motion(k, t);
        m.vr.hypot(m.vh)
    };
    let fastest = ends.map(speed).fold(0.0, f64::max);
    let normal = plane_from_camera(camera, refined).map(|to_plane| to_plane.row(2).transpose());
    RateLimit {
        axis: normal.unwrap_or_else(Vector3::z),
        most_rad_s: MOST_SPEEDS * fastest / (radius_px * camera.ball_units_per_px()),
    }
}

/// Drops the rates of arcs whose pictures they explain far less well than those of the other arcs ([`MOST_LEFT`]).
fn drop_unlike_others(found: &mut [ArcRotation]) {
    let left = |r: &ArcRotation| Some(r.rates.as_ref().ok()?.left);
    let least = found.iter().filter_map(left).fold(f64::INFINITY, f64::min);
    for r in found {
        if left(r).is_some_and(|left| left > MOST_LEFT * least) {
            r.rates = Err(NoRate::Unexplained);
        }
    }
}

/// No more than [`SEARCH_FRAMES`] of an arc, spread over it.
fn sparse(arc: &[TimedCentre]) -> Vec<TimedCentre> {
    let step = arc.len().div_ceil(SEARCH_FRAMES).max(1);
    arc.iter().step_by(step).copied().collect()
}

impl FlightPictures<'_> {
    /// The centres that arc `k` was fitted to, with their times.
    fn of_arc(&self, flight: &Flight, k: usize) -> Vec<TimedCentre> {
        let used = flight.points.iter().filter(|p| p.use_ == SpotUse::Used(k));
        let kept = |c: &BallCentre| !self.decoded.sightings[c.id].blob.crop.luma.data.is_empty();
        used.filter_map(|p| {
            let centre = with_id(&self.refined.tracked.centres, p.spot.id).filter(|c| kept(c))?;
            Some((*centre, p.spot.time_s))
        })
        .collect()
    }

    /// The pictures of arc `k`, and the rates that these show: around the measured centres, or those of the arc itself, whichever leave the
    /// pictures less unexplained. Marks that turn draw a measured centre to and fro with them, by a tenth of a pixel; where the camera swings the
    /// ball is where it was measured.
    fn likelier_rates(
        &self,
        flight: &Flight,
        k: usize,
        search: &RotationSearch<'_>,
    ) -> (ArcPictures, Result<SuitingRates, NoRate>) {
        let measured = self.of_arc(flight, k);
        let (some, candidates) = match self.candidates(&measured, search) {
            Ok(found) => found,
            Err(reason) => {
                let (centres, ball) = (measured, None);
                return (ArcPictures { centres, ball }, Err(reason));
            }
        };
        // Which it is, some of the pictures tell.
        let on_arc = self.on_arc(flight, k, &measured).filter(|_| {
            let left = |ball: &SampledBall| search.left_by(ball, candidates.first());
            let there = self.on_arc(flight, k, &some.centres);
            let there = there.and_then(|there| self.sampled(&there, search).ok());
            let here = some.ball.as_ref();
            there
                .zip(here)
                .is_some_and(|(there, here)| left(&there) < left(here))
        });
        let is_all = on_arc.is_none() && some.centres.len() == measured.len();
        let centres = on_arc.unwrap_or(measured);
        let ball = some.ball.filter(|_| is_all);
        let mut arc = ArcPictures { centres, ball };
        // Those that turn too little are looked for once more, in the light of all arcs.
        let (from_s, to_s) = arc.span_s();
        let first = candidates.first();
        let rates = if first.turns_too_little(to_s - from_s) {
            self.ball_of(&mut arc, search).map(|_| SuitingRates {
                possible: vec![first.clone()],
                too_fast_rad_s: Vec::new(),
                left: first.residual.powi(2),
            })
        } else {
            self.rates_among(&mut arc, &candidates, search)
        };
        (arc, rates)
    }

    /// The same with the centres where the arc has them; `None` where that cannot be said of each.
    fn on_arc(&self, flight: &Flight, k: usize, measured: &[TimedCentre]) -> Option<Vec<TimedCentre>> {
        let map = &self.pictures.camera.map;
        let of = |(centre, t): &TimedCentre| {
            let point = flight.points.iter().find(|p| p.spot.id == centre.id)?;
            let m = flight.fit.motion(k, *t);
            let there = map.pixel_from_plane(PlanePoint::new(m.r, m.h))?;
            let here = map.pixel_from_plane(flight.place_of(point)?)?;
            let mut moved = *centre;
            moved.centre.disc.centre.u_px += there.u_px - here.u_px;
            moved.centre.disc.centre.v_px += there.v_px - here.v_px;
            Some((moved, *t))
        };
        measured.iter().map(of).collect()
    }

    /// Rates that some of an arc's pictures, which are given with them, show.
    fn candidates(
        &self,
        arc: &[TimedCentre],
        search: &RotationSearch<'_>,
    ) -> Result<(ArcPictures, RateCandidates), NoRate> {
        let spare = arc.len().saturating_sub(SEARCH_FRAMES);
        let arc_s = arc
            .last()
            .zip(arc.first())
            .map_or(0.0, |(to, from)| to.1 - from.1);
        let of = |some: Vec<TimedCentre>| {
            let ball = self.sampled(&some, search)?;
            let found = search.evidence(&ball)?.candidates(arc_s)?;
            let pictures = ArcPictures {
                centres: some,
                ball: Some(ball),
            };
            Ok((pictures, found))
        };
        match of(arc[spare / 2..arc.len() - spare.div_ceil(2)].to_vec()) {
            // What turns too slowly to show it within those.
            Err(_) if spare > 0 => of(sparse(arc)),
            found => found,
        }
    }

    /// The rates that an arc shows.
    fn rates(&self, arc: &mut ArcPictures, search: &RotationSearch<'_>) -> Result<SuitingRates, NoRate> {
        if arc.centres.len() <= SEARCH_FRAMES {
            return search.rivals(self.ball_of(arc, search)?);
        }
        let (_, candidates) = self.candidates(&arc.centres, search)?;
        self.rates_among(arc, &candidates, search)
    }

    /// The rates that `candidates` become by all pictures of an arc.
    fn rates_among(
        &self,
        arc: &mut ArcPictures,
        candidates: &RateCandidates,
        search: &RotationSearch<'_>,
    ) -> Result<SuitingRates, NoRate> {
        search.evidence(self.ball_of(arc, search)?)?.by_all(candidates)
    }

    /// The ball's pixels on an arc.
    fn ball_of<'a>(
        &self,
        arc: &'a mut ArcPictures,
        search: &RotationSearch<'_>,
    ) -> Result<&'a SampledBall, NoRate> {
        let ball = match arc.ball.take() {
            Some(ball) => ball,
            None => self.sampled(&arc.centres, search)?,
        };
        Ok(arc.ball.insert(ball))
    }

    /// Looks once more at the arcs that showed no rate, or made too few turns for their marks to be told from the light: in the light that all
    /// arcs have in common, or else in a smooth one.
    fn settle_slow(
        &self,
        mut arcs: Vec<ArcPictures>,
        search: &RotationSearch<'_>,
        found: &mut [ArcRotation],
    ) {
        let is_open = |r: &ArcRotation| {
            let slow = |f: &RotationFit| f.turns_too_little(r.span_s.1 - r.span_s.0);
            r.rates.is_err() || r.likeliest().is_some_and(slow)
        };
        if !found.iter().any(is_open) || found.iter().all(|r| r.rates.is_err()) {
            return;
        }
        let shown = arcs.iter().zip(found.iter());
        let shown = shown.filter_map(|(arc, r)| arc.ball.as_ref().zip(r.likeliest()));
        let light = common_light(&shown.collect::<Vec<_>>());
        let each = arcs.par_iter_mut().zip(found).filter(|(_, found)| is_open(found));
        each.for_each(|(arc, found)| {
            let lit = light.as_ref().map(|light| RotationSearch {
                light: Some(light),
                ..*search
            });
            let again = lit.and_then(|lit| {
                let rates = self.rates(arc, &lit).ok()?;
                // What stands out from a light of other flights may be that this one's differs, which stays as a ball does that hardly turns.
                let evidence = search.evidence(arc.ball.as_ref()?).ok()?;
                evidence.told_from_light(rates).ok()
            });
            let again = again.or_else(|| {
                if arc.centres.len() > SEARCH_FRAMES {
                    let (centres, ball) = (sparse(&arc.centres), None);
                    *arc = ArcPictures { centres, ball };
                }
                let ball = self.ball_of(arc, search).ok()?;
                search.evidence(ball).ok()?.in_smooth_light().ok()
            });
            let without = || match &found.rates {
                Ok(_) => Err(NoRate::TooFewTurns),
                Err(reason) => Err(*reason),
            };
            found.rates = again.map_or_else(without, Ok);
        });
    }

    fn sampled(&self, arc: &[TimedCentre], search: &RotationSearch<'_>) -> Result<SampledBall, NoRate> {
        let views: Vec<BallView> = arc.par_iter().filter_map(|(c, t)| self.view(c, *t)).collect();
        search.sampled(&views)
    }

    /// The ball's pixels around a centre; `None` where memory had no room for them.
    fn view(&self, centre: &BallCentre, time_s: f64) -> Option<BallView> {
        let s = &self.decoded.sightings[centre.id];
        let crop = &s.blob.crop;
        if crop.luma.data.is_empty() {
            return None;
        }
        let disc = centre.centre.disc;
        let velocity = self
            .pictures
            .velocity_px_s(&self.refined.tracked.flight, time_s)?;
        let back = self.pictures.stretch(s, &disc, velocity)?.try_inverse()?;
        let black = f64::from(self.decoded.info.luma_range.black);
        let sweep_px = disc.swept_px[0].hypot(disc.swept_px[1]);
        // (The disc's is the radius of the edge that grey levels have.)
        let ball = self.refined.ball.as_ref()?;
        let radius_px = disc.radius_px * ball.radius_px.value / ball.edge_radius_px();
        let inside = 1.0 - (CLEAR_BLURS * self.blur_px + CLEAR_PX + 0.5 * sweep_px) / radius_px;
        let n = self.block;
        let reach = disc.radius_px * 1.5 + n as f64;
        let from = |centre: f64, corner: usize| ((centre - reach - corner as f64).floor().max(0.0)) as usize;
        let to = |centre: f64, corner: usize, size: usize| {
            ((centre + reach - corner as f64).ceil().max(0.0) as usize).min(size)
        };
        let (u, v) = (disc.centre.u_px, disc.centre.v_px);
        let columns = from(u, crop.u)..to(u, crop.u, crop.luma.width);
        let rows = from(v, crop.v)..to(v, crop.v, crop.luma.height);
        let gain = s.registration.gain.max(f64::MIN_POSITIVE);
        let mut pixels = Vec::new();
        for row in rows.clone().step_by(n).filter(|r| r + n <= rows.end) {
            for column in columns.clone().step_by(n).filter(|c| c + n <= columns.end) {
                let middle = 0.5 * (n as f64 - 1.0);
                let off = Vector2::new(
                    (crop.u + column) as f64 + middle - u,
                    (crop.v + row) as f64 + middle - v,
                );
                let place = back * off / radius_px;
                if place.norm() > inside {
                    continue;
                }
                let block = (row..row + n).flat_map(|r| &crop.luma.row(r)[column..column + n]);
                let sum: f64 = block.map(|&p| f64::from(p)).sum();
                let grey = sum / (n * n) as f64;
                pixels.push(BallPixel {
                    place: [place.x, place.y],
                    grey: (grey - s.registration.offset_grey) / gain - black,
                });
            }
        }
        Some(BallView {
            time_s,
            sight: self.pictures.sight(s, disc.centre),
            pixels,
        })
    }
}

/// From the camera's axes to the plane's: right, up, towards the camera.
fn plane_from_camera(camera: &CalibratedCamera<'_>, refined: &Refined) -> Option<Matrix3<f64>> {
    let axes = camera.silhouettes(refined.tracked.optics).plane_axes()?;
    axes.try_inverse()
}

/// The surface spins that the pictures of the arcs show of a ball of `radius_m`.
pub fn seen_spins(
    camera: &CalibratedCamera<'_>,
    refined: &Refined,
    rotations: &[ArcRotation],
    radius_m: f64,
) -> Vec<SeenSpin> {
    let Some(to_plane) = plane_from_camera(camera, refined) else {
        return Vec::new();
    };
    let about = |axis: Vector3<f64>, f: &RotationFit| {
        let std = (axis.dot(&(f.covariance * axis))).max(0.0).sqrt();
        Quantity::new(radius_m * axis.dot(&f.rate_rad_s), radius_m * std)
    };
    let spin = |f: &RotationFit| {
        Some(SurfaceSpin {
            y_m_s: about(-to_plane.row(2).transpose(), f)?,
            z_m_s: about(to_plane.row(1).transpose(), f)?,
        })
    };
    let arc = |r: &ArcRotation| SeenSpin {
        span_s: r.span_s,
        candidates: r
            .rates
            .iter()
            .flat_map(|s| &s.possible)
            .filter_map(spin)
            .collect(),
        too_fast: r.rates.as_ref().map_or(0, |s| s.too_fast_rad_s.len()),
        fastest_m_s: radius_m * rotation::fastest_rad_s(&r.times_s),
    };
    rotations.iter().map(arc).collect()
}

/// What is reported of an arc's `rotation`, of which the bounces left the candidate `chosen`, if any; `None` of a plain ball.
pub fn arc_spin(
    camera: &CalibratedCamera<'_>,
    refined: &Refined,
    frame: &WorldFrame,
    rotation: &ArcRotation,
    chosen: Result<ChosenSpin, SpinUntold>,
) -> Option<ArcSpin> {
    let (rates, too_fast_rad_s) = match &rotation.rates {
        Ok(rates) => (&rates.possible[..], &rates.too_fast_rad_s[..]),
        Err(NoRate::Plain) => return None,
        Err(_) => (&[][..], &[][..]),
    };
    let to_world = frame.turn_from_plane() * plane_from_camera(camera, refined)?;
    let world = |f: &RotationFit| -> Option<[Quantity; 3]> {
        let rate = to_world * f.rate_rad_s;
        let covariance = to_world * f.covariance * to_world.transpose();
        let one = |k: usize| Quantity::new(rate[k], covariance[(k, k)].max(0.0).sqrt());
        Some([one(0)?, one(1)?, one(2)?])
    };
    let all = || rates.iter().map(|f| &f.rate_rad_s).chain(too_fast_rad_s);
    let fit = chosen.ok().and_then(|c| rates.get(c.index));
    let in_doubt = all().count() > 1 || fit.is_none();
    Some(ArcSpin {
        rate_rad_s: fit.and_then(world),
        candidates_rad_s: if in_doubt {
            all().map(|rate| (to_world * rate).y).collect()
        } else {
            Vec::new()
        },
        reason: reason(rotation, chosen),
        turning: fit.map(|f| turning(rotation, f)),
    })
}

/// Why there is no rate, or how it was told from its rivals.
fn reason(rotation: &ArcRotation, chosen: Result<ChosenSpin, SpinUntold>) -> Option<String> {
    let frames = rotation.frames.len();
    let rates = rotation.rates.as_ref().map(SuitingRates::count);
    match (rates, chosen) {
        (Ok(_), Err(SpinUntold::Contradicted)) => Some(
            "what the pictures of this arc show does not go with what those of the arc beside it do: no bounce between them turns a ball so, for inertia factors from 0.2 to 0.67. One of the two is wrong. Larger marks, several of them, or a higher frame rate tell more"
                .to_owned(),
        ),
        (Ok(rates @ 2..), Ok(chosen)) => Some(format!(
            "{rates} rates suit the pictures alike; {}",
            match chosen.told_by {
                SpinEvidence::Bounce =>
                    "of these the bounce allows this one alone, for inertia factors from 0.2 to 0.67".to_owned(),
                _ => format!(
                    "with the others the ball's surface would be more than {MOST_SPEEDS} times as fast as the ball itself"
                ),
            }
        )),
        (Ok(rates @ 2..), Err(_)) => Some(format!(
            "{rates} rates suit the pictures alike: the marks look the same after a part of a turn, or the ball makes about half a turn a frame. A mark that stands alone, or a higher frame rate, tells them apart"
        )),
        (Ok(_), _) => None,
        (Err(NoRate::FewFrames), _) => Some(format!("{frames} pictures of the ball on this arc are too few")),
        (Err(NoRate::TooFewTurns), _) => Some(
            "the ball makes too few turns while it is seen (1.25 on an arc, or 2 on several together, are the least), so that its marks are not told from the light on it"
                .to_owned(),
        ),
        (Err(NoRate::Plain | NoRate::Unexplained), _) => Some(
            "something on the ball changes from frame to frame, but no steady rotation explains it: marks that are too faint or too small, reflections, or a rotation too fast for the frame rate"
                .to_owned(),
        ),
    }
}

/// The turning frame by frame.
fn turning(rotation: &ArcRotation, fit: &RotationFit) -> BallTurning {
    let rate = fit.rate_rad_s.norm();
    let axis = fit.rate_rad_s.try_normalize(0.0).unwrap_or_else(Vector3::z);
    let middle_s = rotation.times_s.iter().sum::<f64>() / rotation.times_s.len() as f64;
    // Of pictures without pixels nothing is known.
    let all_seen =
        fit.off_rad.len() == rotation.frames.len() && fit.off_std_rad.len() == rotation.frames.len();
    let seen = if all_seen { 0..rotation.frames.len() } else { 0..0 };
    let frame = |i: usize| TurnedFrame {
        frame: rotation.frames[i],
        time_s: rotation.times_s[i],
        turned_rad: rate * (rotation.times_s[i] - middle_s),
        residual_rad: fit.off_rad[i].dot(&axis),
        std_rad: fit.off_std_rad[i].component_mul(&axis).norm(),
    };
    BallTurning {
        rate_rad_s: fit.rate_rad_s.into(),
        middle_s,
        frames: seen.map(frame).collect(),
        maps: Arc::new(fit.maps.clone()),
    }
}
