//! What the ball of a recording looks like, estimated from a few dozen of its frames together.
//!
//! Radius, blur, exposure and the light on the ball are the same in all frames, but for a few nuisance parameters of each. So
//! they are fitted to the pixels of many frames at once (`joint_fit`), in turn with the centres of those frames, as the
//! point-spread function of a telescope is from many dithered stars (Anderson and King 2000, PASP 112, 1360). A shift that
//! all centres share is fitted with them: it is what the outline alone decides, so that nothing of the light can hide in it.
//!
//! How many terms the light needs is decided by the pixels (Akaike's criterion). The nuisance parameters get the standard
//! deviations that the frames show beyond their own uncertainty.
//!
//! No number of terms draws a highlight. In a small ball it lies within what the light is fitted by, and bends the terms, and through them shifts all
//! centres (by up to 0.03 px of balls of R 4 to 10 px): the shift is as uncertain as the choice of terms leaves it, and as places on the ball that are
//! off by the same in all frames do.
//!
//! Centres are found as if grey levels were proportional to light. By how much the ball's radius is another where they are not, or where the camera
//! sharpens, is estimated beside that (`tone_curve`, `sharpening`).
//!
//! Assumed: one rigid ball that looks alike in all frames up to the nuisance parameters, before a known background. A ball
//! that does not has no estimate, or one whose tilt of the light is free.

mod joint_fit;
mod parameters;
mod sharpening;
mod tone_curve;

pub use parameters::{AppearanceFrame, AppearanceSettings};

use super::ball::TERM_LEVELS;
use super::disc::{Disc, bent_px};
use super::edge_likelihood::{self, Appearance, NUISANCES, SIZE};
use super::overexposure::Overexposure;
use crate::frames::LumaRange;
use crate::numeric::robust::{STD_OF_MEDIAN, median};
use crate::quantity::Quantity;
use joint_fit::{FrameBand, JointFit, UNKNOWN_SHIFT_STD_PX, gather_bands};
use parameters::{FrameEstimate, LEAST_FRAMES, SharedParameters};
use rayon::prelude::*;
use tone_curve::ToneCurve;

/// Where the ball's radius comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RadiusSource {
    /// From the pixels, where they tell one that is near that of the outlines.
    Fitted,
    /// The median of the outlines'.
    Outlines,
}

/// A sweep shorter than this hardly differs from a little more blur, px.
const LEAST_SWEEP_PX: f64 = 0.7;

/// An exposure is real when the fit with it is better by this many noise variances.
const EXPOSURE_GAIN: f64 = 30.0;

/// A shutter may be open longer than is thought by what a clock is off, as a factor.
const LONGEST_EXPOSURE: f64 = 1.1;

/// Exposures that the search for a sweep starts from, as parts of the time from frame to frame.
const SWEEPS_TRIED: [f64; 4] = [0.08, 0.25, 0.6, 1.0];

/// Frames that tell what a camera makes of light, about.
const LIGHT_FRAMES: usize = 12;

/// A first guess of the blur, px: a lens in focus and the pixel's own square.
const USUAL_BLUR_PX: f64 = 0.9;

/// A radius further than this from the outlines' is no radius, px and part of it.
const FAR_FROM_OUTLINE_PX: f64 = 1.0;
const FAR_FROM_OUTLINE: f64 = 0.2;

/// Standard deviations of the nuisance parameters before anything is known: of the strength by 30 %, of the tilt by 30 grey
/// levels.
const LOOSE_STRENGTH: f64 = 0.3;
const LOOSE_TILT_GREY: f64 = 30.0;
/// And of the radius by this part.
const LOOSE_SIZE: f64 = 0.03;

/// An estimate of what the ball looks like, begun: what all that is fitted later starts from.
#[derive(Debug)]
pub struct Estimation<'a> {
    frames: Vec<AppearanceFrame<'a>>,
    settings: AppearanceSettings,
    /// Blur, exposure and light, by the radius of the outlines, which is held.
    start: SharedParameters,
    nuisance_std: [f64; NUISANCES],
    /// The outlines' median radius, px.
    outline_px: f64,
    /// What the recording means by black and white; `None` where pixels are no grey levels of light.
    luma_range: Option<LumaRange>,
}

impl<'a> Estimation<'a> {
    /// Of the ball in all of `frames`; no shutter is open longer than `longest_exposure_s`. `None` where they have no one appearance.
    #[must_use]
    pub fn begun(
        frames: Vec<AppearanceFrame<'a>>,
        longest_exposure_s: f64,
        luma_range: Option<LumaRange>,
        settings: &AppearanceSettings,
    ) -> Option<Self> {
        if frames.len() < LEAST_FRAMES {
            return None;
        }
        let mut radii: Vec<f64> = frames
            .iter()
            .map(|f| f.disc.radius_px / f.magnification)
            .collect();
        let outline_px = median(&mut radii)?;
        let mut offs: Vec<f64> = radii.iter().map(|r| (r - outline_px).abs()).collect();
        let size_std_px = STD_OF_MEDIAN * median(&mut offs).unwrap_or(0.0);
        // Radius and blur of a small ball in noise have false local minima; with the outline's radius held, blur and light
        // lead into the right one.
        let still = SharedParameters {
            radius_px: outline_px,
            radius_held: true,
            blur_px: USUAL_BLUR_PX,
            sharpening: 0.0,
            exposure_s: 0.0,
            longest_exposure_s: LONGEST_EXPOSURE * longest_exposure_s,
            terms: vec![0.0; TERM_LEVELS[1]],
            tone: None,
        };
        let start = {
            let frames: Vec<FrameEstimate> = frames.iter().map(FrameEstimate::new).collect();
            with_or_without_smear(&frames, &still, settings)?
        };
        Some(Self {
            frames,
            settings: *settings,
            start,
            nuisance_std: [
                LOOSE_STRENGTH,
                LOOSE_TILT_GREY,
                LOOSE_TILT_GREY,
                size_std_px.max(LOOSE_SIZE * outline_px),
            ],
            outline_px,
            luma_range,
        })
    }

    /// The appearance, with the radius from there where that is possible.
    #[must_use]
    pub fn by(&self, radius: RadiusSource) -> Option<Appearance> {
        let fitted = || self.fitted(RadiusSource::Fitted);
        let fitted = (radius == RadiusSource::Fitted).then(fitted).flatten();
        let off_px = |fit: &BallFit<'_>| (fit.ball.radius_px - self.outline_px).abs();
        // A small, shaded ball in noise may also be taken for a smaller one with a dim rim. The outline speaks against that;
        // its radius is then the better one.
        let far_px = FAR_FROM_OUTLINE_PX.max(FAR_FROM_OUTLINE * self.outline_px);
        match fitted {
            Some(near) if off_px(&near) < far_px => Some(self.with_light(near)),
            far => self.fitted(RadiusSource::Outlines).map(|held| {
                let held = self.with_light(held);
                Appearance {
                    // (Of a small, blurred ball it is the outline that is too wide: either may be.)
                    radius_std_px: held
                        .radius_std_px
                        .map(|std| std.hypot(far.as_ref().map_or(0.0, off_px) / std::f64::consts::SQRT_2)),
                    ..held
                }
            }),
        }
    }

    /// The appearance with the radius from there, as if grey levels were light.
    fn fitted(&self, radius: RadiusSource) -> Option<BallFit<'_>> {
        let settings = &self.settings;
        let mut nuisance_std = self.nuisance_std;
        let mut frames: Vec<FrameEstimate> = self.frames.iter().map(FrameEstimate::new).collect();
        let mut shared = SharedParameters {
            radius_held: radius == RadiusSource::Outlines,
            ..self.start.clone()
        };
        let mut best: Option<Appearance> = None;
        for round in 0..settings.rounds {
            let mut joint = JointFit::of_frames(&frames, &shared, settings)?;
            if round > 0 {
                joint = with_needed_terms(&frames, &joint.shared, settings)?;
            }
            for f in &mut frames {
                f.disc.centre.u_px += joint.shift[0];
                f.disc.centre.v_px += joint.shift[1];
            }
            let ball = appearance(&joint, nuisance_std, settings);
            let spread = fit_frames(&mut frames, &ball, settings);
            nuisance_std = spread.std;
            shared = joint.shared;
            shared.absorb(&mut frames, spread.median);
            best = Some(Appearance { nuisance_std, ..ball });
        }
        best.map(|ball| BallFit { ball, frames, shared })
    }

    /// That appearance with what white and a tone curve do to it.
    fn with_light(&self, fit: BallFit<'_>) -> Appearance {
        let BallFit { ball, frames, shared } = fit;
        let bands = gather_bands(&frames, &shared, &self.settings);
        let seen: Vec<_> = bands
            .iter()
            .map(|(frame, pixels)| (frame.disc_with(&shared), &pixels[..]))
            .collect();
        // A mixture of planes keeps clear of the ends of its range: of it nothing is overexposed.
        let white_grey = self.luma_range.map_or(u8::MAX, |range| range.white);
        let overexposure = Overexposure::of(&seen, shared.blur_px, white_grey);
        Appearance {
            shift_std_px: ball.shift_std_px.hypot(overexposure.shift_std_px()),
            larger_in_light_px: if shared.radius_held {
                None
            } else {
                self.larger_in_light_px(&bands, &shared)
            },
            overexposure,
            ..ball
        }
    }

    /// How much larger the ball is than grey levels have it, px, for what a camera makes of light: sharpening and a tone curve, as far as these pixels
    /// and what is known of cameras tell them; `None` where they do not tell.
    fn larger_in_light_px(&self, bands: &[FrameBand<'_>], by_grey: &SharedParameters) -> Option<Quantity> {
        let range = self.luma_range?;
        // What limits this is not noise, which a few frames leave little enough of.
        let step = bands.len().div_ceil(LIGHT_FRAMES).max(1);
        let few: Vec<FrameBand<'_>> = bands.iter().step_by(step).cloned().collect();
        let fit = |sharpening: f64, log_gamma: f64| {
            let tone = ToneCurve::new(log_gamma.exp(), range, &by_grey.terms);
            let start = SharedParameters {
                terms: tone.terms(&by_grey.terms),
                tone: Some(tone),
                sharpening,
                ..by_grey.clone()
            };
            JointFit::of_pixels(&few, &start, &self.settings)
        };
        let [none, some, most] = tone_curve::LOG_GAMMAS.map(|log_gamma| fit(0.0, log_gamma));
        let curved = [&none?, &some?, &most?];
        let by_tone = tone_curve::by_tone(costs(curved), larger_px(curved), few.len())?;
        // What a tone curve does to an edge is no sharpening: under the curve that suits it best.
        let by_sharpening = || {
            let of_curves = costs(curved);
            let best = (0..curved.len()).min_by(|&a, &b| of_curves[a].total_cmp(&of_curves[b]))?;
            let [some, most] = [1, 2].map(|i| fit(sharpening::TRIED[i], tone_curve::LOG_GAMMAS[best]));
            let sharpened = [curved[best], &some?, &most?];
            sharpening::by_sharpening(costs(sharpened), larger_px(sharpened))
        };
        Some(by_sharpening().map_or(by_tone, |more| {
            let both = Quantity {
                value: by_tone.value + more.value,
                ..by_tone
            };
            both.with_more_std(more.std_uncertainty.unwrap_or(0.0))
        }))
    }
}

/// What three fits to the same pixels cost, in noise variances.
fn costs(fits: [&JointFit; 3]) -> [f64; 3] {
    let stds = fits.map(|joint| joint.residual_std_grey);
    let common = stds.into_iter().fold(f64::INFINITY, f64::min);
    fits.map(|joint| joint.cost(common))
}

/// By how much the ball is larger than by the first of them, px.
fn larger_px(fits: [&JointFit; 3]) -> [f64; 3] {
    fits.map(|joint| joint.shared.radius_px - fits[0].shared.radius_px)
}

/// An appearance with the frames as it was fitted to them.
struct BallFit<'a> {
    ball: Appearance,
    frames: Vec<FrameEstimate<'a>>,
    shared: SharedParameters,
}

/// The appearance that a joint fit found.
fn appearance(joint: &JointFit, nuisance_std: [f64; NUISANCES], settings: &AppearanceSettings) -> Appearance {
    let shared = &joint.shared;
    let profiles = settings.fit.profiles(shared.radius_px, shared.blur_px);
    Appearance {
        radius_px: shared.radius_px,
        radius_fitted: !shared.radius_held,
        radius_std_px: joint.radius_std_px,
        larger_in_light_px: None,
        shift_std_px: joint.shift_std_px,
        blur_px: shared.blur_px,
        exposure_s: shared.exposure_s,
        table: profiles.of_ball(&shared.terms),
        terms: shared.terms.clone(),
        nuisance_std,
        residual_grey: joint.residual_std_grey,
        overexposure: Overexposure::default(),
    }
}

/// The shared parameters to start with, from those without smear: with an exposure time where the shutter's smear shows.
fn with_or_without_smear(
    frames: &[FrameEstimate<'_>],
    start: &SharedParameters,
    settings: &AppearanceSettings,
) -> Option<SharedParameters> {
    let top = frames.iter().map(FrameEstimate::speed_px_s).fold(0.0, f64::max);
    // Each length of the sweep has a local minimum of its own, which is found only from a start near it.
    let from = |part: f64| {
        let exposure_s = part / LONGEST_EXPOSURE * start.longest_exposure_s;
        let sweep_px = top * exposure_s;
        if sweep_px < LEAST_SWEEP_PX || sweep_px > 4.0 * start.radius_px {
            return None;
        }
        let start = SharedParameters {
            exposure_s,
            ..start.clone()
        };
        JointFit::of_frames(frames, &start, settings)
    };
    let sweeps = SWEEPS_TRIED.into_par_iter().filter_map(from);
    let (still, found) = rayon::join(
        || JointFit::of_frames(frames, start, settings),
        || sweeps.collect::<Vec<JointFit>>(),
    );
    let still = still?.shared;
    // (A sweep that has vanished is none, and one of the longest exposure would be longer still.)
    let in_reach =
        |s: &SharedParameters| top * s.exposure_s > LEAST_SWEEP_PX && s.exposure_s < s.longest_exposure_s;
    let best = found
        .into_iter()
        .filter(|joint| in_reach(&joint.shared))
        .min_by(|a, b| a.residual_std_grey.total_cmp(&b.residual_std_grey));
    let gains = |s: &SharedParameters| gain(frames, &still, s, settings).is_some_and(|g| g > EXPOSURE_GAIN);
    let moving = best.map(|joint| joint.shared).filter(gains);
    Some(moving.unwrap_or(still))
}

/// By how much, in noise variances, `new` fits better than `old`, on the same pixels.
fn gain(
    frames: &[FrameEstimate<'_>],
    old: &SharedParameters,
    new: &SharedParameters,
    settings: &AppearanceSettings,
) -> Option<f64> {
    let bands = gather_bands(frames, new, settings);
    let old = JointFit::of_pixels(&bands, old, settings)?;
    let new = JointFit::of_pixels(&bands, new, settings)?;
    let common = new.residual_std_grey.min(old.residual_std_grey);
    Some(old.cost(common) - new.cost(common))
}

/// What a highlight leaves of the light bends either description of it, with few terms or with more, and with them the shift: its standard uncertainty has
/// this part of what they differ by. (108 coordinates of rendered balls with highlights, R 4 to 14 px, of which 46 were not looked at before: with it the error
/// is 0.9 of its uncertainty, root mean square, without it 1.1 to 1.3.)
const OTHER_LIGHT_PART: f64 = 0.4;

/// Terms whose lack costs so many noise variances, to first order, are needed: they may cost two each.
const HOPELESS: f64 = 200.0;

/// The fit with as many terms of the light as pay, all tried on the same pixels (Akaike's criterion: a term left out that is
/// there pulls the centre, one too many only makes it a little less sure).
fn with_needed_terms(
    frames: &[FrameEstimate<'_>],
    shared: &SharedParameters,
    settings: &AppearanceSettings,
) -> Option<JointFit> {
    let bands = gather_bands(frames, shared, settings);
    let mut tried: Vec<JointFit> = Vec::new();
    // The most first: their own uncertainties may settle that fewer will not do, and fits with few take the most steps.
    for &level in TERM_LEVELS.iter().rev() {
        if tried.iter().any(|more| more.cost_without(level) > HOPELESS) {
            continue;
        }
        let mut shared = shared.clone();
        shared.terms.resize(level, 0.0);
        tried.extend(JointFit::of_pixels(&bands, &shared, settings));
    }
    let stds = tried.iter().map(|joint| joint.residual_std_grey);
    let common = stds.fold(f64::INFINITY, f64::min);
    let score = |joint: &JointFit| joint.cost(common) + 2.0 * joint.shared.terms.len() as f64;
    let best = (0..tried.len()).min_by(|&a, &b| score(&tried[a]).total_cmp(&score(&tried[b])))?;
    let [none, sides, most] = TERM_LEVELS;
    // A light without sides shifts no centres. Where the fit with most terms found no minimum, nobody knows what it would shift.
    let std_by_choice_px = if tried[best].shared.terms.len() == none {
        0.0
    } else {
        let with_most = tried.iter().find(|joint| joint.shared.terms.len() == most);
        with_most
            .and_then(|joint| joint.shift_by_terms_from(sides))
            .map_or(UNKNOWN_SHIFT_STD_PX, |px| OTHER_LIGHT_PART * px)
    };
    let mut best = tried.swap_remove(best);
    best.shift_std_px = best.shift_std_px.hypot(std_by_choice_px);
    Some(best)
}

/// The frames' nuisance parameters: standard deviation and median.
struct NuisanceSpread {
    std: [f64; NUISANCES],
    median: [f64; NUISANCES],
}

/// Fits each frame's centre and nuisance parameters with the appearance known.
fn fit_frames(
    frames: &mut [FrameEstimate<'_>],
    ball: &Appearance,
    settings: &AppearanceSettings,
) -> NuisanceSpread {
    let found = frames.par_iter_mut().filter_map(|f| {
        let ball = ball.magnified(f.input.magnification, &settings.fit);
        let start = Disc {
            centre: f.disc.centre,
            radius_px: ball.radius_px + f.nuisance[SIZE],
            swept_px: f.input.velocity_px_s.map(|v| v * ball.exposure_s),
            bent_px: bent_px(f.input.acceleration_px_s2, ball.exposure_s),
        };
        let fitted = edge_likelihood::fit(&f.input.patch, &ball, &start, f.input.gain, &settings.fit);
        f.fitted = fitted.is_some();
        let fitted = fitted?;
        f.disc.centre = fitted.centre.disc.centre;
        f.nuisance = fitted.nuisance;
        Some((fitted.nuisance, fitted.nuisance_variances))
    });
    let found: Vec<([f64; NUISANCES], [f64; NUISANCES])> = found.collect();
    let medians = std::array::from_fn(|k| {
        let mut of_all: Vec<f64> = found.iter().map(|(n, _)| n[k]).collect();
        median(&mut of_all).unwrap_or(0.0)
    });
    let std = std::array::from_fn(|k| {
        let mut squares: Vec<f64> = found.iter().map(|(n, _)| (n[k] - medians[k]).powi(2)).collect();
        let mut own: Vec<f64> = found.iter().map(|(_, v)| v[k]).collect();
        // Nine in ten of a normal variable's squares lie below 2.706 variances. The light may have two states, of which a
        // median of the squares would see one only.
        squares.sort_by(f64::total_cmp);
        let seen = squares.get(squares.len() * 9 / 10).copied().unwrap_or(0.0) / 2.706;
        let own = median(&mut own).unwrap_or(0.0);
        // A variance from n frames has a relative standard uncertainty of √(2/n), this one of twice that: what exceeds the
        // fit's own variance by less is nothing.
        let relative_std = 2.0 * (2.0 / found.len().max(1) as f64).sqrt();
        (1.5 * (seen - own * (1.0 + relative_std))).max(0.02 * own).sqrt()
    });
    NuisanceSpread { std, median: medians }
}
