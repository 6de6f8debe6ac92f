//! What the ball of a recording looks like, learned from a few dozen of its frames together.
//!
//! RadiusSource, blur, exposure and the light on the ball are the same in all frames, but for nuisance of the light. So they
//! are fitted to the pixels of many frames at once, with the centres of those frames fitted in turn (as star pictures
//! are, from many dithered stars: Anderson and King 2000, PASP 112, 1360). A shift that all centres share is fitted
//! with the appearance: it is what the outline alone decides, and so nothing of the light can hide in it.
//!
//! How many terms the light needs is decided by the pixels (Akaike's criterion). The light's nuisance get the
//! scatter that the frames show beyond their own uncertainty.

mod joint_fit;

use super::ball::{DIPOLE, TERM_LEVELS, norm};
use super::known_ball::{self, Appearance, FitSettings, NUISANCES, SIZE};
use super::{Disc, Patch};
use crate::quantity::median;
use joint_fit::{JointFit, gather_bands};
use rayon::prelude::*;

/// A frame to learn from.
#[derive(Debug, Clone)]
pub struct AppearanceFrame<'a> {
    /// The pixels around the ball.
    pub patch: Patch<'a>,
    /// The ball, roughly.
    pub disc: Disc,
    /// Its velocity, px/s.
    pub velocity_px_s: [f64; 2],
    /// The frame's brightness over the usual one.
    pub gain: f64,
    /// How many times larger than usual the ball is seen, as it is nearer to the camera; 1 where that does not change.
    pub magnification: f64,
}

/// How much to learn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AppearanceSettings {
    /// Frames to learn from, about.
    pub frames: usize,
    /// Pixels of an example, at most.
    pub most_pixels: usize,
    /// Rounds of appearance and centres in turn.
    pub rounds: usize,
    /// How the examples' centres are fitted.
    pub fit: FitSettings,
}

/// Where the ball's radius comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RadiusSource {
    /// From the pixels, where they tell one that is near that of the outlines.
    Fitted,
    /// The median of the outlines'.
    Outlines,
}

/// Fewer frames tell too little.
const LEAST_FRAMES: usize = 3;

/// A sweep shorter than this hardly differs from a little more blur, px.
const LEAST_SWEEP_PX: f64 = 0.7;

/// An exposure is real when the fit with it is better by this many noise variances.
const EXPOSURE_GAIN: f64 = 30.0;

/// A first guess of the blur, px: a lens in focus and the pixel's own square.
const USUAL_BLUR_PX: f64 = 0.9;

/// What `examples` have in common; no shutter is open longer than `longest_exposure_s`. `None` where they have no one
/// appearance.
#[must_use]
pub fn estimate(
    examples: &[AppearanceFrame<'_>],
    longest_exposure_s: f64,
    settings: &AppearanceSettings,
    radius: RadiusSource,
) -> Option<Appearance> {
    if examples.len() < LEAST_FRAMES {
        return None;
    }
    let mut radii: Vec<f64> = examples
        .iter()
        .map(|e| e.disc.radius_px / e.magnification)
        .collect();
    let outline_px = median(&mut radii)?;
    // A small, shaded ball in noise may also be taken for a smaller one with a dim rim. The outline speaks against that;
    // its radius is then the better one.
    let near = |a: &Appearance| {
        (a.radius_px - outline_px).abs() < FAR_FROM_OUTLINE_PX.max(FAR_FROM_OUTLINE * outline_px)
    };
    let with = |radius| estimate_with(examples, &radii, longest_exposure_s, settings, radius);
    let fitted = || with(RadiusSource::Fitted).filter(near);
    let fitted = (radius == RadiusSource::Fitted).then(fitted).flatten();
    fitted.or_else(|| with(RadiusSource::Outlines))
}

/// A radius further than this from the outlines' is no radius, px and part of it.
const FAR_FROM_OUTLINE_PX: f64 = 1.0;
const FAR_FROM_OUTLINE: f64 = 0.2;

/// An outline is at half of the edge's height, which shading and blur put up to this far from the rim, px.
const OUTLINE_STD_PX: f64 = 0.2;

/// The same with this `radius`, of outlines of `radii`.
fn estimate_with(
    examples: &[AppearanceFrame<'_>],
    radii: &[f64],
    longest_exposure_s: f64,
    settings: &AppearanceSettings,
    radius: RadiusSource,
) -> Option<Appearance> {
    // RadiusSource and blur of a small ball in noise have false valleys; with the outline's radius held, blur and light lead
    // into the right one.
    let start = SharedParameters {
        radius_px: median(&mut radii.to_vec())?,
        radius_held: true,
        blur_px: USUAL_BLUR_PX,
        exposure_s: 0.0,
        terms: vec![0.0; TERM_LEVELS[1]],
    };
    let spread_px = spread_px(radii, start.radius_px);
    let loose_size_px = spread_px.max(LOOSE_SIZE * start.radius_px);
    let mut frames: Vec<FrameEstimate> = examples.iter().map(FrameEstimate::new).collect();
    let mut shared = first_look(&frames, &start, longest_exposure_s, settings)?;
    shared.radius_held = radius == RadiusSource::Outlines;
    let mut scatter = [LOOSE_STRENGTH, LOOSE_TILT_GREY, LOOSE_TILT_GREY, loose_size_px];
    let mut best = None;
    for round in 0..settings.rounds {
        let mut joint = JointFit::of_frames(&frames, &mut shared, settings)?;
        if round > 0 {
            joint = fitting_terms(&frames, &mut shared, settings)?;
        }
        for f in &mut frames {
            f.disc.centre.u_px += joint.shift[0];
            f.disc.centre.v_px += joint.shift[1];
        }
        let ball = shared.appearance(&joint, scatter, settings);
        let spread = fit_frames(&mut frames, &ball, settings);
        scatter = spread.scatter;
        shared.take_in(&mut frames, spread.middle);
        best = Some(Appearance { scatter, ..ball });
    }
    best
}

/// Departures before anything is known: of the strength by 30 %, of the tilt by 30 grey levels.
const LOOSE_STRENGTH: f64 = 0.3;
const LOOSE_TILT_GREY: f64 = 30.0;
/// And of the radius by this part.
const LOOSE_SIZE: f64 = 0.03;

/// Robust standard deviation of radii about their median.
fn spread_px(radii: &[f64], middle: f64) -> f64 {
    let mut offs: Vec<f64> = radii.iter().map(|r| (r - middle).abs()).collect();
    1.4826 * median(&mut offs).unwrap_or(0.0)
}

/// An example with what was found so far.
struct FrameEstimate<'a> {
    input: &'a AppearanceFrame<'a>,
    disc: Disc,
    nuisance: [f64; NUISANCES],
    /// CentreFit in the last round.
    good: bool,
}

impl<'a> FrameEstimate<'a> {
    fn new(input: &'a AppearanceFrame<'a>) -> Self {
        Self {
            input,
            disc: input.disc,
            nuisance: [0.0; NUISANCES],
            good: true,
        }
    }

    fn disc_with(&self, shared: &SharedParameters) -> Disc {
        Disc {
            centre: self.disc.centre,
            radius_px: shared.radius_px * self.input.magnification + self.nuisance[SIZE],
            swept_px: self.input.velocity_px_s.map(|v| v * shared.exposure_s),
        }
    }

    fn speed_px_s(&self) -> f64 {
        norm(self.input.velocity_px_s[0], self.input.velocity_px_s[1])
    }
}

/// What is fitted to all frames.
#[derive(Debug, Clone)]
struct SharedParameters {
    radius_px: f64,
    /// The radius is not fitted.
    radius_held: bool,
    blur_px: f64,
    exposure_s: f64,
    terms: Vec<f64>,
}

impl SharedParameters {
    fn appearance(
        &self,
        joint: &JointFit,
        scatter: [f64; NUISANCES],
        settings: &AppearanceSettings,
    ) -> Appearance {
        Appearance {
            radius_px: self.radius_px,
            radius_std_px: joint.radius_std_px,
            shift_std_px: joint.shift_std_px,
            blur_px: self.blur_px,
            exposure_s: self.exposure_s,
            table: settings
                .fit
                .profiles(self.radius_px, self.blur_px)
                .of_ball(&self.terms),
            terms: self.terms.clone(),
            scatter,
            residual_grey: joint.scale,
        }
    }

    /// Takes the `middle` departure of all frames into what they share: the usual ball is the middle one, and a light that
    /// all frames have is the light's.
    fn take_in(&mut self, frames: &mut [FrameEstimate<'_>], mut middle: [f64; NUISANCES]) {
        if self.radius_held {
            middle[SIZE] = 0.0;
        }
        self.radius_px += middle[SIZE];
        self.terms.resize(self.terms.len().max(DIPOLE.end), 0.0);
        for t in &mut self.terms {
            *t *= 1.0 + middle[0];
        }
        for (t, m) in self.terms[DIPOLE].iter_mut().zip(&middle[1..]) {
            *t += m;
        }
        for f in frames {
            for (d, m) in f.nuisance.iter_mut().zip(&middle) {
                *d -= m;
            }
        }
    }
}

/// Finds whether the shutter's smear shows, and the appearance to start with.
fn first_look(
    frames: &[FrameEstimate<'_>],
    start: &SharedParameters,
    longest_exposure_s: f64,
    settings: &AppearanceSettings,
) -> Option<SharedParameters> {
    let still = || {
        let mut shared = start.clone();
        JointFit::of_frames(frames, &mut shared, settings).map(|_| shared)
    };
    let top = frames.iter().map(FrameEstimate::speed_px_s).fold(0.0, f64::max);
    // Longer sweeps first fit what shorter ones start from too badly; each start finds its own valley.
    let from = |part: f64| {
        let exposure_s = part * longest_exposure_s;
        let sweep_px = top * exposure_s;
        if sweep_px < LEAST_SWEEP_PX || sweep_px > 4.0 * start.radius_px {
            return None;
        }
        let mut shared = SharedParameters {
            exposure_s,
            ..start.clone()
        };
        Some((JointFit::of_frames(frames, &mut shared, settings)?, shared))
    };
    let sweeps = [0.08, 0.25, 0.6, 1.0].into_par_iter().filter_map(from);
    let (still, found) = rayon::join(still, || sweeps.collect::<Vec<(JointFit, SharedParameters)>>());
    let still = still?;
    let best = found
        .into_iter()
        .min_by(|(a, _), (b, _)| a.scale.total_cmp(&b.scale));
    let moving = best.map(|(_, shared)| shared).filter(|s| {
        let in_reach = top * s.exposure_s > LEAST_SWEEP_PX && s.exposure_s <= 1.1 * longest_exposure_s;
        in_reach && gain(frames, &still, s, settings).is_some_and(|g| g > EXPOSURE_GAIN)
    });
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
    let old = JointFit::on_pixels(&bands, &mut old.clone(), settings)?;
    let new = JointFit::on_pixels(&bands, &mut new.clone(), settings)?;
    let common = new.scale.min(old.scale);
    Some(old.cost(common) - new.cost(common))
}

/// Terms whose lack costs so many noise variances, to first order, are needed: they may cost two each.
const HOPELESS: f64 = 200.0;

/// As many terms of the light as pay, all tried on the same pixels (Akaike's criterion: a term left out that is there
/// pulls the centre, one too many only makes it a little less sure).
fn fitting_terms(
    frames: &[FrameEstimate<'_>],
    shared: &mut SharedParameters,
    settings: &AppearanceSettings,
) -> Option<JointFit> {
    let bands = gather_bands(frames, shared, settings);
    let mut tried: Vec<(JointFit, SharedParameters)> = Vec::new();
    // The most first: what they say themselves may of_frames that fewer will not do, and those take the most steps.
    for &level in TERM_LEVELS.iter().rev() {
        let hopeless =
            |(joint, more): &(JointFit, SharedParameters)| joint.cost_without(&more.terms, level) > HOPELESS;
        if tried.iter().any(hopeless) {
            continue;
        }
        let mut shared = shared.clone();
        shared.terms.resize(level, 0.0);
        if let Some(joint) = JointFit::on_pixels(&bands, &mut shared, settings) {
            tried.push((joint, shared));
        }
    }
    let common = tried.iter().map(|(p, _)| p.scale).fold(f64::INFINITY, f64::min);
    let score =
        |(joint, shared): &(JointFit, SharedParameters)| joint.cost(common) + 2.0 * shared.terms.len() as f64;
    let (joint, chosen) = tried.into_iter().min_by(|a, b| score(a).total_cmp(&score(b)))?;
    *shared = chosen;
    Some(joint)
}

/// What the frames' nuisance are like.
struct NuisanceSpread {
    scatter: [f64; NUISANCES],
    /// The middle nuisance.
    middle: [f64; NUISANCES],
}

/// Fits each frame's centre and nuisance with the appearance known; the nuisance' spread over the frames.
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
        };
        let fitted = known_ball::fit(&f.input.patch, &ball, &start, f.input.gain, &settings.fit);
        f.good = fitted.is_some();
        let fitted = fitted?;
        f.disc.centre = fitted.centre.disc.centre;
        f.nuisance = fitted.nuisance;
        Some((fitted.nuisance, fitted.nuisance_variances))
    });
    let found: Vec<([f64; NUISANCES], [f64; NUISANCES])> = found.collect();
    let middle = std::array::from_fn(|k| {
        let mut of_all: Vec<f64> = found.iter().map(|(d, _)| d[k]).collect();
        median(&mut of_all).unwrap_or(0.0)
    });
    let scatter = std::array::from_fn(|k| {
        let mut squares: Vec<f64> = found.iter().map(|(d, _)| (d[k] - middle[k]).powi(2)).collect();
        let mut own: Vec<f64> = found.iter().map(|(_, v)| v[k]).collect();
        // Nine in ten of a normal variable's squares lie below 2.706 variances. The light may have two states, so the
        // middle of them would say nothing.
        squares.sort_by(f64::total_cmp);
        let seen = squares.get(squares.len() * 9 / 10).copied().unwrap_or(0.0) / 2.706;
        let own = median(&mut own).unwrap_or(0.0);
        // A variance from n frames is itself uncertain by √(2/n), this one by twice that: less beyond the fit's own is
        // nothing.
        let doubt = 2.0 * (2.0 / found.len().max(1) as f64).sqrt();
        (1.5 * (seen - own * (1.0 + doubt))).max(0.02 * own).sqrt()
    });
    NuisanceSpread { scatter, middle }
}
