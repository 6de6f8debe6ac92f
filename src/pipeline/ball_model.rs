//! What all frames of a recording share of the ball: its radius, and what it looks like.

use super::camera::CalibratedCamera;
use super::decode::Decoded;
use super::spots::{BallCentre, with_id};
use super::track::Tracked;
use crate::calibration::{Optics, Silhouette, Silhouettes};
use crate::detect::Sighting;
use crate::detect::centre::affine_patch::AffinePatch;
use crate::detect::centre::appearance::{AppearanceFrame, AppearanceSettings, Estimation, RadiusSource};
use crate::detect::centre::attached_shadow::{AttachedShadow, ShadowView};
use crate::detect::centre::edge_likelihood::Appearance;
use crate::detect::centre::{Accuracy, Disc, Patch, ball};
use crate::flight::Flight;
use crate::geometry::{PixelPoint, PlanePoint};
use crate::impact::error_budget::{
    EDGE_STD_PX, FADED_STD_PX, LASTING_PART, LEARNED_COMMON_STD_PX, OUTLINE_COMMON_STD_PX,
    OUTLINE_RADIUS_STD_PX, SHADOW_STD_PX,
};
use crate::numeric::robust::{MEDIAN_STD_OVER_MEAN_STD, median};
use crate::quantity::Quantity;
use nalgebra::{Matrix2, Rotation3, Vector2};

/// A rim that differs from what is behind it by less than this part of where it differs most is faded.
const FADED_PART: f64 = 0.25;

/// An outline this little longer than wide is round, px.
const ROUND_ENOUGH_PX: f64 = 0.01;

/// Rounds to settle at which time a rolling shutter sees the ball: each takes ball's speed over rows' speed off the error.
const READOUT_ROUNDS: usize = 6;

/// What all frames share.
#[derive(Debug, Clone)]
pub struct BallModel {
    /// The usual ball's radius, px: where the optical axis meets the calibrated plane ([`Silhouettes`]). Its uncertainty is without what overexposure
    /// hides ([`BallModel::hidden_std_px`]).
    pub radius_px: Quantity,
    /// The radius that first outlines have, px: of a ball of few pixels it is larger.
    pub outline_px: f64,
    /// What it looks like; `None` where that is not asked for or could not be learned: then its outline has to do.
    pub appearance: Option<Appearance>,
    /// Part of the rim that hardly differs from what is behind it, or differs the other way: where a ball's dark side fades into
    /// the wall.
    faded: f64,
    /// What a shadow changes that goes along beside the ball, over what the ball changes; 0 where there is none.
    shadowed: f64,
}

impl BallModel {
    /// How long the shutter is open, s; 0 where its smear cannot be seen.
    pub fn exposure_s(&self) -> f64 {
        self.appearance.as_ref().map_or(0.0, |a| a.exposure_s)
    }

    /// The radius of the edge that its grey levels have, px, which a camera's tone curve puts elsewhere: what centres are found with.
    pub fn edge_radius_px(&self) -> f64 {
        let appearance = self.appearance.as_ref();
        appearance.map_or(self.outline_px, |a| a.radius_px)
    }

    /// The usual ball's radius with all that it is unsure by, px.
    pub fn whole_radius_px(&self) -> Quantity {
        self.radius_px.with_more_std(self.hidden_std_px())
    }

    /// Standard uncertainty of the radius by what overexposure hides, px.
    pub fn hidden_std_px(&self) -> f64 {
        let appearance = self.appearance.as_ref();
        appearance.map_or(0.0, |a| a.overexposure.radius_std_px())
    }
}

/// Standard deviation of the error that all centres share, px, where a codec or a shaking camera displaces each by
/// `displaced_px`.
pub fn common_std_px(ball: Option<&BallModel>, displaced_px: f64) -> f64 {
    let learned = ball.and_then(|ball| Some((ball, ball.appearance.as_ref()?)));
    learned.map_or(OUTLINE_COMMON_STD_PX, |(ball, a)| {
        a.shift_std_px
            .hypot(LEARNED_COMMON_STD_PX)
            .hypot(LASTING_PART * displaced_px)
            .hypot(FADED_STD_PX * ball.faded)
            .hypot(SHADOW_STD_PX * ball.shadowed)
    })
}

/// The pixels of a recording as its camera draws a ball in them.
#[derive(Debug, Clone, Copy)]
pub struct BallPictures<'a> {
    /// What moves.
    pub decoded: &'a Decoded,
    /// What sees it.
    pub camera: &'a CalibratedCamera<'a>,
    silhouettes: Silhouettes<'a>,
    /// What goes along beside the ball.
    shadow: Option<&'a AttachedShadow>,
}

impl<'a> BallPictures<'a> {
    /// By a camera whose angles are `optics`, as far as they are known.
    pub fn new(decoded: &'a Decoded, camera: &'a CalibratedCamera<'a>, optics: Option<Optics>) -> Self {
        Self {
            decoded,
            camera,
            silhouettes: camera.silhouettes(optics),
            shadow: None,
        }
    }

    /// The same with what goes along beside the ball.
    pub fn with_shadow(self, shadow: Option<&'a AttachedShadow>) -> Self {
        Self { shadow, ..self }
    }

    /// What goes along beside the ball.
    pub fn shadow(&self) -> Option<&'a AttachedShadow> {
        self.shadow
    }

    /// What goes along beside the ball of a flight.
    pub fn shadow_of(&self, tracked: &Tracked) -> Option<AttachedShadow> {
        let (seen, velocities): (Vec<_>, Vec<_>) = shadow_examples(self, tracked).into_iter().unzip();
        let view = |((s, c), velocity): (&(&'a Sighting, BallCentre), &[f64; 2])| ShadowView {
            patch: self.decoded.detector.patch(&s.blob.crop, &s.registration),
            disc: Disc {
                swept_px: velocity.map(|v| v * tracked.flight.interval_s),
                ..c.centre.disc
            },
        };
        let views: Vec<ShadowView<'_>> = seen.iter().zip(&velocities).map(view).collect();
        let mut contrasts: Vec<f64> = seen.iter().map(|(_, c)| c.centre.contrast_grey).collect();
        AttachedShadow::learned(&views, median(&mut contrasts)?)
    }

    /// The outline of a ball at a place of a sighting's frame.
    fn silhouette(&self, s: &Sighting, p: PixelPoint) -> Option<Silhouette> {
        self.silhouettes.at(s.registration.reference_from_frame(p))
    }

    /// How many times larger than usual a ball of the calibrated plane is there.
    pub fn size(&self, s: &Sighting, p: PixelPoint) -> f64 {
        self.silhouette(s, p).map_or(1.0, |drawn| drawn.size)
    }

    /// The pixels around a sighting, and how the picture draws out a ball like `disc` there that moves with `velocity_px_s`.
    pub fn patch<'s>(&self, s: &'s Sighting, disc: &Disc, velocity_px_s: [f64; 2]) -> Patch<'s>
    where
        'a: 's,
    {
        let drawn = self.drawn(s, disc, velocity_px_s);
        let drawn = drawn.filter(|drawn| drawn.elongation() * disc.radius_px > ROUND_ENOUGH_PX);
        let mut patch = Patch {
            affine: drawn.and_then(|drawn| AffinePatch::new(disc.centre, drawn.stretch)),
            ..self.decoded.detector.patch(&s.blob.crop, &s.registration)
        };
        if let Some(shadow) = self.shadow {
            shadow.cast(&mut patch, disc.centre);
        }
        patch
    }

    /// How the picture draws a ball like `disc` that moves with `velocity_px_s`.
    fn drawn(&self, s: &Sighting, disc: &Disc, velocity_px_s: [f64; 2]) -> Option<Silhouette> {
        let drawn = self.silhouette(s, disc.centre)?;
        let stretch = self.camera.readout.stretch(velocity_px_s)? * drawn.stretch;
        Some(Silhouette { stretch, ..drawn })
    }

    /// The linear map from a circle to the outline of such a ball.
    pub fn stretch(&self, s: &Sighting, disc: &Disc, velocity_px_s: [f64; 2]) -> Option<Matrix2<f64>> {
        Some(self.drawn(s, disc, velocity_px_s)?.stretch)
    }

    /// The turn from the camera's own line of sight to that of a place of a sighting's frame, camera axes (right, down, away).
    pub fn sight(&self, s: &Sighting, p: PixelPoint) -> Rotation3<f64> {
        self.silhouettes.sight(s.registration.reference_from_frame(p))
    }

    /// When and where the arcs say that a sighting's frame, taken at `frame_s`, shows the ball.
    pub fn predicted(&self, flight: &Flight, s: &Sighting, frame_s: f64) -> Option<(f64, PixelPoint)> {
        let at = |t: f64| {
            let m = flight.fit.motion(flight.arc_at(t), t);
            let seen = self.camera.map.pixel_from_plane(PlanePoint::new(m.r, m.h))?;
            Some(s.registration.frame_from_reference(seen))
        };
        let (mut t, mut there) = (frame_s, at(frame_s)?);
        if self.camera.readout.whole_s != 0.0 {
            for _ in 0..READOUT_ROUNDS {
                t = frame_s + self.camera.readout.delay_s(there);
                there = at(t)?;
            }
        }
        Some((t, there))
    }

    /// The velocity with which a frame shows a thing to sweep over its pixels that moves with `velocity_px_s`.
    pub fn seen_velocity_px_s(&self, velocity_px_s: [f64; 2]) -> [f64; 2] {
        let stretch = self.camera.readout.stretch(velocity_px_s);
        stretch.map_or(velocity_px_s, |s| (s * Vector2::from(velocity_px_s)).into())
    }

    /// Acceleration in the picture at `t`, px/s².
    pub fn acceleration_px_s2(&self, flight: &Flight, t: f64) -> Option<[f64; 2]> {
        let k = flight.arc_at(t);
        let dt = 0.5 * flight.interval_s;
        let at = |t: f64| {
            let m = flight.fit.motion(k, t);
            self.camera.map.pixel_from_plane(PlanePoint::new(m.r, m.h))
        };
        let (a, b, c) = (at(t - dt)?, at(t)?, at(t + dt)?);
        let second = |a: f64, b: f64, c: f64| (a - 2.0 * b + c) / (dt * dt);
        Some([second(a.u_px, b.u_px, c.u_px), second(a.v_px, b.v_px, c.v_px)])
    }

    /// Velocity in the picture at `t`, px/s.
    pub fn velocity_px_s(&self, flight: &Flight, t: f64) -> Option<[f64; 2]> {
        let k = flight.arc_at(t);
        let dt = 1e-3 * flight.interval_s;
        let at = |t: f64| {
            let m = flight.fit.motion(k, t);
            self.camera.map.pixel_from_plane(PlanePoint::new(m.r, m.h))
        };
        let (a, b) = (at(t - dt)?, at(t + dt)?);
        Some([(b.u_px - a.u_px) / (2.0 * dt), (b.v_px - a.v_px) / (2.0 * dt)])
    }
}

/// What a ball's radius and appearance are learned from: some of the flight's used points, spread over it.
#[derive(Debug)]
pub struct BallLesson<'a> {
    outlines: Quantity,
    /// `None` where an appearance is not asked for, or the frames have no one.
    estimation: Option<Estimation<'a>>,
    /// What is behind the ball, grey levels.
    behind_grey: Option<f64>,
    shadowed: f64,
}

impl<'a> BallLesson<'a> {
    /// Of what was tracked; `None` where there is no outline.
    pub fn new(pictures: &BallPictures<'a>, tracked: &Tracked, accuracy: Accuracy) -> Option<Self> {
        let outlines = outline_radius(pictures, &tracked.flight)?;
        let settings = accuracy.method().appearance();
        let settings = settings.filter(|_| !mostly_let_go(pictures, tracked));
        let examples = settings.map_or(Vec::new(), |settings| examples(pictures, tracked, settings));
        let behind = examples.iter().filter_map(|e| e.patch.background.first());
        let behind_grey = median(&mut behind.map(|&b| f64::from(b)).collect::<Vec<_>>());
        let longest_exposure_s = tracked.flight.interval_s;
        let decoded = pictures.decoded;
        let luma_range = decoded.colour.is_none().then_some(decoded.info.luma_range);
        Some(Self {
            outlines,
            estimation: settings.and_then(|s| Estimation::begun(examples, longest_exposure_s, luma_range, s)),
            behind_grey,
            shadowed: pictures.shadow.map_or(0.0, AttachedShadow::part_of_contrast),
        })
    }

    /// The ball, with an appearance whose radius is from there, or by its outlines alone.
    pub fn ball(&self, appearance: Option<RadiusSource>) -> Option<BallModel> {
        let appearance = appearance.and_then(|radius| self.estimation.as_ref()?.by(radius));
        let radius_px = match &appearance {
            Some(a) => a.ball_radius_px()?,
            None => self.outlines,
        };
        Some(BallModel {
            radius_px: radius_px.with_more_std(EDGE_STD_PX),
            outline_px: self.outlines.value,
            faded: appearance
                .as_ref()
                .zip(self.behind_grey)
                .map_or(0.0, |(a, behind)| faded_part(&a.terms, behind)),
            shadowed: self.shadowed,
            appearance,
        })
    }
}

/// Whether memory had no room for the pixels of most of the flight: its centres are those of the first look, and an appearance
/// would not speak for them.
fn mostly_let_go(pictures: &BallPictures<'_>, tracked: &Tracked) -> bool {
    let used = || tracked.flight.used_points();
    let gone = used().filter(|p| {
        let sighting = &pictures.decoded.sightings[p.spot.id];
        sighting.blob.crop.luma.data.is_empty()
    });
    2 * gone.count() > used().count()
}

/// Frames that what goes along beside the ball is learned from, at most.
const SHADOW_FRAMES: usize = 32;

/// Sightings of the ball, evenly over the flight, with their velocity in the picture, px/s.
fn shadow_examples<'a>(
    pictures: &BallPictures<'a>,
    tracked: &Tracked,
) -> Vec<((&'a Sighting, BallCentre), [f64; 2])> {
    let flight = &tracked.flight;
    let step = flight.used().div_ceil(SHADOW_FRAMES).max(1);
    let some = flight.used_points().step_by(step);
    some.filter_map(|p| {
        let c = with_id(&tracked.centres, p.spot.id)?;
        let s = &pictures.decoded.sightings[c.id];
        let velocity = pictures.velocity_px_s(flight, p.spot.time_s)?;
        (!s.blob.crop.luma.data.is_empty()).then_some(((s, *c), velocity))
    })
    .collect()
}

/// Frames to learn from: used points whose pixels were kept, evenly over the flight.
fn examples<'a>(
    pictures: &BallPictures<'a>,
    tracked: &Tracked,
    settings: &AppearanceSettings,
) -> Vec<AppearanceFrame<'a>> {
    let flight = &tracked.flight;
    let used: Vec<(&Sighting, &BallCentre, f64)> = flight
        .used_points()
        .filter_map(|p| {
            let c = with_id(&tracked.centres, p.spot.id)?;
            let sighting = &pictures.decoded.sightings[c.id];
            let kept = !sighting.blob.crop.luma.data.is_empty();
            kept.then_some((sighting, c, p.spot.time_s))
        })
        .collect();
    let step = used.len().div_ceil(settings.frames).max(1);
    used.iter()
        .skip(step / 2)
        .step_by(step)
        .filter_map(|&(s, c, t)| {
            let disc = c.centre.disc;
            let velocity_px_s = pictures.velocity_px_s(flight, t)?;
            let patch = pictures.patch(s, &disc, velocity_px_s);
            let moving = Disc {
                swept_px: pictures.seen_velocity_px_s(velocity_px_s),
                bent_px: pictures.acceleration_px_s2(flight, t)?,
                ..disc
            };
            let round = patch.affine.map_or(moving, |d| d.disc_in_patch(&moving));
            Some(AppearanceFrame {
                patch,
                disc,
                velocity_px_s: round.swept_px,
                acceleration_px_s2: round.bent_px,
                gain: s.registration.gain,
                magnification: flight.magnification_at(t) * pictures.size(s, disc.centre),
            })
        })
        .collect()
}

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

/// Median radius of the outlines with the standard error that their own scatter shows.
fn outline_radius(pictures: &BallPictures<'_>, flight: &Flight) -> Option<Quantity> {
    let mut radii: Vec<f64> = flight
        .used_points()
        .filter_map(|p| {
            let sighting = &pictures.decoded.sightings[p.spot.id];
            let disc = sighting.centre?.disc;
            let size = pictures.size(sighting, disc.centre);
            Some(disc.radius_px / (size * flight.magnification_at(p.spot.time_s)))
        })
        .collect();
    let n = radii.len() as f64;
    let radius = median(&mut radii)?;
    let mut off: Vec<f64> = radii.iter().map(|r| (r - radius).abs()).collect();
    let spread = 1.4826 * median(&mut off)?;
    // An outline's own error is common to all.
    let std = if n >= 3.0 {
        (MEDIAN_STD_OVER_MEAN_STD * spread / n.sqrt()).hypot(OUTLINE_RADIUS_STD_PX)
    } else {
        f64::NAN
    };
    Quantity::new(radius, std)
}

/// The ball's radius: common to all frames, or (a ball of a few pixels) the outlines' median.
pub fn radius_px(
    camera: &CalibratedCamera<'_>,
    tracked: &Tracked,
    ball: Option<&BallModel>,
) -> Option<Quantity> {
    let outlines = || {
        let silhouettes = camera.silhouettes(tracked.optics);
        let usual = |c: &BallCentre| {
            let drawn = silhouettes.at(c.in_reference());
            c.centre.disc.radius_px / drawn.map_or(1.0, |drawn| drawn.size)
        };
        let mut radii: Vec<f64> = tracked.centres.iter().map(usual).collect();
        Quantity::undetermined(median(&mut radii)?)
    };
    ball.map(BallModel::whole_radius_px).or_else(outlines)
}
