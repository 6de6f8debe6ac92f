//! What the ball of a recording looks like, learned from a few dozen of its frames together.
//!
//! Radius, blur, exposure and the light on the ball are the same in all frames, but for departures of the light. So they
//! are fitted to the pixels of many frames at once, with the centres of those frames fitted in turn (as star pictures
//! are, from many dithered stars: Anderson and King 2000, PASP 112, 1360). A shift that all centres share is fitted
//! with the appearance: it is what the outline alone decides, and so nothing of the light can hide in it.
//!
//! How many terms the light needs is decided by the pixels (Akaike's criterion). The light's departures get the
//! scatter that the frames show beyond their own uncertainty.

mod pool;

use super::ball::{DIPOLE, TERM_LEVELS, norm};
use super::known_ball::{self, Appearance, DEPARTURES, Effort, SIZE};
use super::{Disc, Patch};
use crate::quantity::median;
use pool::{Pool, gather};
use rayon::prelude::*;

/// A frame to learn from.
#[derive(Debug, Clone)]
pub struct Example<'a> {
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
pub struct Lesson {
    /// Frames to learn from, about.
    pub examples: usize,
    /// Pixels of an example, at most.
    pub most_pixels: usize,
    /// Rounds of appearance and centres in turn.
    pub rounds: usize,
    /// How the examples' centres are fitted.
    pub effort: Effort,
}

/// Where the ball's radius comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Radius {
    /// From the pixels, where they tell one that is near that of the outlines.
    Fitted,
    /// The median of the outlines'.
    Outlines,
}

/// Fewer frames tell too little.
const LEAST_EXAMPLES: usize = 3;

/// A sweep shorter than this hardly differs from a little more blur, px.
const LEAST_SWEEP_PX: f64 = 0.7;

/// An exposure is real when the fit with it is better by this many noise variances.
const EXPOSURE_GAIN: f64 = 30.0;

/// A first guess of the blur, px: a lens in focus and the pixel's own square.
const USUAL_BLUR_PX: f64 = 0.9;

/// What `examples` have in common; no shutter is open longer than `longest_exposure_s`. `None` where they have no one
/// appearance.
#[must_use]
pub fn learn(
    examples: &[Example<'_>],
    longest_exposure_s: f64,
    lesson: &Lesson,
    radius: Radius,
) -> Option<Appearance> {
    if examples.len() < LEAST_EXAMPLES {
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
    let with = |radius| learn_with(examples, &radii, longest_exposure_s, lesson, radius);
    let fitted = || with(Radius::Fitted).filter(near);
    let fitted = (radius == Radius::Fitted).then(fitted).flatten();
    fitted.or_else(|| with(Radius::Outlines))
}

/// A radius further than this from the outlines' is no radius, px and part of it.
const FAR_FROM_OUTLINE_PX: f64 = 1.0;
const FAR_FROM_OUTLINE: f64 = 0.2;

/// An outline is at half of the edge's height, which shading and blur put up to this far from the rim, px.
const OUTLINE_STD_PX: f64 = 0.2;

/// The same with this `radius`, of outlines of `radii`.
fn learn_with(
    examples: &[Example<'_>],
    radii: &[f64],
    longest_exposure_s: f64,
    lesson: &Lesson,
    radius: Radius,
) -> Option<Appearance> {
    // Radius and blur of a small ball in noise have false valleys; with the outline's radius held, blur and light lead
    // into the right one.
    let start = Shared {
        radius_px: median(&mut radii.to_vec())?,
        radius_held: true,
        blur_px: USUAL_BLUR_PX,
        exposure_s: 0.0,
        terms: vec![0.0; TERM_LEVELS[1]],
    };
    let spread_px = spread_px(radii, start.radius_px);
    let loose_size_px = spread_px.max(LOOSE_SIZE * start.radius_px);
    let mut frames: Vec<Studied> = examples.iter().map(Studied::new).collect();
    let mut shared = first_look(&frames, &start, longest_exposure_s, lesson)?;
    shared.radius_held = radius == Radius::Outlines;
    let mut scatter = [LOOSE_STRENGTH, LOOSE_TILT_GREY, LOOSE_TILT_GREY, loose_size_px];
    let mut best = None;
    for round in 0..lesson.rounds {
        let mut pool = Pool::settle(&frames, &mut shared, lesson)?;
        if round > 0 {
            pool = fitting_terms(&frames, &mut shared, lesson)?;
        }
        for f in &mut frames {
            f.disc.centre.u_px += pool.shift[0];
            f.disc.centre.v_px += pool.shift[1];
        }
        let ball = shared.appearance(&pool, scatter, lesson);
        let spread = study(&mut frames, &ball, lesson);
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
struct Studied<'a> {
    example: &'a Example<'a>,
    disc: Disc,
    departures: [f64; DEPARTURES],
    /// Fitted in the last round.
    good: bool,
}

impl<'a> Studied<'a> {
    fn new(example: &'a Example<'a>) -> Self {
        Self {
            example,
            disc: example.disc,
            departures: [0.0; DEPARTURES],
            good: true,
        }
    }

    fn disc_with(&self, shared: &Shared) -> Disc {
        Disc {
            centre: self.disc.centre,
            radius_px: shared.radius_px * self.example.magnification + self.departures[SIZE],
            swept_px: self.example.velocity_px_s.map(|v| v * shared.exposure_s),
        }
    }

    fn speed_px_s(&self) -> f64 {
        norm(self.example.velocity_px_s[0], self.example.velocity_px_s[1])
    }
}

/// What is fitted to all frames.
#[derive(Debug, Clone)]
struct Shared {
    radius_px: f64,
    /// The radius is not fitted.
    radius_held: bool,
    blur_px: f64,
    exposure_s: f64,
    terms: Vec<f64>,
}

impl Shared {
    fn appearance(&self, pool: &Pool, scatter: [f64; DEPARTURES], lesson: &Lesson) -> Appearance {
        Appearance {
            radius_px: self.radius_px,
            radius_std_px: pool.radius_std_px,
            shift_std_px: pool.shift_std_px,
            blur_px: self.blur_px,
            exposure_s: self.exposure_s,
            table: lesson
                .effort
                .profiles(self.radius_px, self.blur_px)
                .of_ball(&self.terms),
            terms: self.terms.clone(),
            scatter,
            residual_grey: pool.scale,
        }
    }

    /// Takes the `middle` departure of all frames into what they share: the usual ball is the middle one, and a light that
    /// all frames have is the light's.
    fn take_in(&mut self, frames: &mut [Studied<'_>], mut middle: [f64; DEPARTURES]) {
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
            for (d, m) in f.departures.iter_mut().zip(&middle) {
                *d -= m;
            }
        }
    }
}

/// Finds whether the shutter's smear shows, and the appearance to start with.
fn first_look(
    frames: &[Studied<'_>],
    start: &Shared,
    longest_exposure_s: f64,
    lesson: &Lesson,
) -> Option<Shared> {
    let still = || {
        let mut shared = start.clone();
        Pool::settle(frames, &mut shared, lesson).map(|_| shared)
    };
    let top = frames.iter().map(Studied::speed_px_s).fold(0.0, f64::max);
    // Longer sweeps first fit what shorter ones start from too badly; each start finds its own valley.
    let from = |part: f64| {
        let exposure_s = part * longest_exposure_s;
        let sweep_px = top * exposure_s;
        if sweep_px < LEAST_SWEEP_PX || sweep_px > 4.0 * start.radius_px {
            return None;
        }
        let mut shared = Shared {
            exposure_s,
            ..start.clone()
        };
        Some((Pool::settle(frames, &mut shared, lesson)?, shared))
    };
    let sweeps = [0.08, 0.25, 0.6, 1.0].into_par_iter().filter_map(from);
    let (still, found) = rayon::join(still, || sweeps.collect::<Vec<(Pool, Shared)>>());
    let still = still?;
    let best = found
        .into_iter()
        .min_by(|(a, _), (b, _)| a.scale.total_cmp(&b.scale));
    let moving = best.map(|(_, shared)| shared).filter(|s| {
        let in_reach = top * s.exposure_s > LEAST_SWEEP_PX && s.exposure_s <= 1.1 * longest_exposure_s;
        in_reach && gain(frames, &still, s, lesson).is_some_and(|g| g > EXPOSURE_GAIN)
    });
    Some(moving.unwrap_or(still))
}

/// By how much, in noise variances, `new` fits better than `old`, on the same pixels.
fn gain(frames: &[Studied<'_>], old: &Shared, new: &Shared, lesson: &Lesson) -> Option<f64> {
    let bands = gather(frames, new, lesson);
    let old = Pool::settle_on(&bands, &mut old.clone(), lesson)?;
    let new = Pool::settle_on(&bands, &mut new.clone(), lesson)?;
    let common = new.scale.min(old.scale);
    Some(old.cost(common) - new.cost(common))
}

/// Terms whose lack costs so many noise variances, to first order, are needed: they may cost two each.
const HOPELESS: f64 = 200.0;

/// As many terms of the light as pay, all tried on the same pixels (Akaike's criterion: a term left out that is there
/// pulls the centre, one too many only makes it a little less sure).
fn fitting_terms(frames: &[Studied<'_>], shared: &mut Shared, lesson: &Lesson) -> Option<Pool> {
    let bands = gather(frames, shared, lesson);
    let mut tried: Vec<(Pool, Shared)> = Vec::new();
    // The most first: what they say themselves may settle that fewer will not do, and those take the most steps.
    for &level in TERM_LEVELS.iter().rev() {
        let hopeless = |(pool, more): &(Pool, Shared)| pool.cost_without(&more.terms, level) > HOPELESS;
        if tried.iter().any(hopeless) {
            continue;
        }
        let mut shared = shared.clone();
        shared.terms.resize(level, 0.0);
        if let Some(pool) = Pool::settle_on(&bands, &mut shared, lesson) {
            tried.push((pool, shared));
        }
    }
    let common = tried.iter().map(|(p, _)| p.scale).fold(f64::INFINITY, f64::min);
    let score = |(pool, shared): &(Pool, Shared)| pool.cost(common) + 2.0 * shared.terms.len() as f64;
    let (pool, chosen) = tried.into_iter().min_by(|a, b| score(a).total_cmp(&score(b)))?;
    *shared = chosen;
    Some(pool)
}

/// What the frames' departures are like.
struct Spread {
    scatter: [f64; DEPARTURES],
    /// The middle departures.
    middle: [f64; DEPARTURES],
}

/// Fits each frame's centre and departures with the appearance known; the departures' spread over the frames.
fn study(frames: &mut [Studied<'_>], ball: &Appearance, lesson: &Lesson) -> Spread {
    let found = frames.par_iter_mut().filter_map(|f| {
        let ball = ball.magnified(f.example.magnification, &lesson.effort);
        let start = Disc {
            centre: f.disc.centre,
            radius_px: ball.radius_px + f.departures[SIZE],
            swept_px: f.example.velocity_px_s.map(|v| v * ball.exposure_s),
        };
        let fitted = known_ball::fit(&f.example.patch, &ball, &start, f.example.gain, &lesson.effort);
        f.good = fitted.is_some();
        let fitted = fitted?;
        f.disc.centre = fitted.centre.disc.centre;
        f.departures = fitted.departures;
        Some((fitted.departures, fitted.departure_variances))
    });
    let found: Vec<([f64; DEPARTURES], [f64; DEPARTURES])> = found.collect();
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
    Spread { scatter, middle }
}
