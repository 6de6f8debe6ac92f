//! What the ball of a recording looks like, learned from a few dozen of its frames together.
//!
//! Radius, blur, exposure and the light on the ball are the same in all frames, but for departures of the light. So they
//! are fitted to the pixels of many frames at once, with the centres of those frames fitted in turn (as star pictures
//! are, from many dithered stars: Anderson and King 2000, PASP 112, 1360). A shift that all centres share is fitted
//! with the appearance: it is what the outline alone decides, and so nothing of the light can hide in it.
//!
//! How many terms the light needs is decided by the pixels (Schwarz's criterion). The light's departures get the
//! scatter that the frames show beyond their own uncertainty.

use super::ball::{self, BandPixel, Pose, RadialTable, TERM_LEVELS, norm};
use super::known_ball::{self, Appearance, DEPARTURES, Effort, SIZE};
use super::{Disc, Patch};
use crate::quantity::median;
use nalgebra::{DMatrix, DVector};
use std::collections::{BTreeMap, BTreeSet};

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
pub fn learn(examples: &[Example<'_>], longest_exposure_s: f64, lesson: &Lesson) -> Option<Appearance> {
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
    learn_with(examples, &radii, longest_exposure_s, lesson, false)
        .filter(near)
        .or_else(|| learn_with(examples, &radii, longest_exposure_s, lesson, true))
}

/// A radius further than this from the outlines' is no radius, px and part of it.
const FAR_FROM_OUTLINE_PX: f64 = 1.0;
const FAR_FROM_OUTLINE: f64 = 0.2;

/// An outline is at half of the edge's height, which shading and blur put up to this far from the rim, px.
const OUTLINE_STD_PX: f64 = 0.2;

/// The same with the median of the outlines' `radii` held or not.
fn learn_with(
    examples: &[Example<'_>],
    radii: &[f64],
    longest_exposure_s: f64,
    lesson: &Lesson,
    radius_held: bool,
) -> Option<Appearance> {
    let start = Shared {
        radius_px: median(&mut radii.to_vec())?,
        radius_held,
        blur_px: USUAL_BLUR_PX,
        exposure_s: 0.0,
        terms: vec![0.0; TERM_LEVELS[0]],
    };
    let spread_px = spread_px(radii, start.radius_px);
    let loose_size_px = spread_px.max(LOOSE_SIZE * start.radius_px);
    let mut frames: Vec<Studied> = examples.iter().map(Studied::new).collect();
    let mut shared = first_look(&frames, &start, longest_exposure_s, lesson)?;
    let mut scatter = [LOOSE_STRENGTH, LOOSE_TILT_GREY, LOOSE_TILT_GREY, loose_size_px];
    let mut best = None;
    for round in 0..lesson.rounds {
        let mut pool = Pool::settle(&frames, &mut shared, lesson)?;
        if round + 1 == lesson.rounds || round == 1 {
            pool = richer(&frames, &mut shared, lesson, pool)?;
        }
        for f in &mut frames {
            f.disc.centre.u_px += pool.shift[0];
            f.disc.centre.v_px += pool.shift[1];
        }
        let ball = shared.appearance(&pool, scatter, lesson);
        let spread = study(&mut frames, &ball, lesson);
        scatter = spread.scatter;
        // The usual ball is the middle one; its picture is learned again with that.
        if !radius_held {
            shared.radius_px += spread.middle_size_px;
            for f in &mut frames {
                f.departures[SIZE] -= spread.middle_size_px;
            }
        }
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
}

/// Finds whether the shutter's smear shows, and the appearance to start with.
fn first_look(
    frames: &[Studied<'_>],
    start: &Shared,
    longest_exposure_s: f64,
    lesson: &Lesson,
) -> Option<Shared> {
    let mut still = start.clone();
    let without = Pool::settle(frames, &mut still, lesson)?;
    let top = frames.iter().map(Studied::speed_px_s).fold(0.0, f64::max);
    let mut best: Option<(Pool, Shared)> = None;
    // Longer sweeps first fit what shorter ones start from too badly; each start finds its own valley.
    for part in [0.08, 0.25, 0.6, 1.0] {
        let exposure_s = part * longest_exposure_s;
        let sweep_px = top * exposure_s;
        if sweep_px < LEAST_SWEEP_PX || sweep_px > 4.0 * start.radius_px {
            continue;
        }
        let mut shared = Shared {
            exposure_s,
            ..start.clone()
        };
        let Some(pool) = Pool::settle(frames, &mut shared, lesson) else {
            continue;
        };
        if best.as_ref().is_none_or(|(b, _)| pool.scale < b.scale) {
            best = Some((pool, shared));
        }
    }
    if let Some((pool, shared)) = best {
        let common = pool.scale.min(without.scale);
        let gain = without.cost(common) - pool.cost(common);
        let shows = shared.exposure_s > 0.0
            && top * shared.exposure_s > LEAST_SWEEP_PX
            && shared.exposure_s <= 1.1 * longest_exposure_s
            && gain > EXPOSURE_GAIN;
        if shows {
            return Some(shared);
        }
    }
    Some(still)
}

/// More terms of the light, as long as each level pays.
fn richer(frames: &[Studied<'_>], shared: &mut Shared, lesson: &Lesson, pool: Pool) -> Option<Pool> {
    let mut best = pool;
    for level in TERM_LEVELS {
        if level <= shared.terms.len() {
            continue;
        }
        let mut more = shared.clone();
        more.terms.resize(level, 0.0);
        let Some(pool) = Pool::settle(frames, &mut more, lesson) else {
            break;
        };
        let gain = best.cost(best.scale) - pool.cost(best.scale);
        let price = (level - shared.terms.len()) as f64 * (best.residuals.len() as f64).ln();
        if gain < price {
            break;
        }
        *shared = more;
        best = pool;
    }
    Some(best)
}

/// What the frames' departures are like.
struct Spread {
    scatter: [f64; DEPARTURES],
    /// Median departure of the radius, px.
    middle_size_px: f64,
}

/// Fits each frame's centre and departures with the appearance known; the departures' spread over the frames.
fn study(frames: &mut [Studied<'_>], ball: &Appearance, lesson: &Lesson) -> Spread {
    let mut found: Vec<([f64; DEPARTURES], [f64; DEPARTURES])> = Vec::new();
    for f in frames.iter_mut() {
        let ball = ball.magnified(f.example.magnification, &lesson.effort);
        let start = Disc {
            centre: f.disc.centre,
            radius_px: ball.radius_px + f.departures[SIZE],
            swept_px: f.example.velocity_px_s.map(|v| v * ball.exposure_s),
        };
        let fitted = known_ball::fit(&f.example.patch, &ball, &start, f.example.gain, &lesson.effort);
        f.good = fitted.is_some();
        if let Some(fitted) = fitted {
            f.disc.centre = fitted.centre.disc.centre;
            f.departures = fitted.departures;
            found.push((fitted.departures, fitted.departure_variances));
        }
    }
    let mut sizes: Vec<f64> = found.iter().map(|(d, _)| d[SIZE]).collect();
    let middle_size_px = median(&mut sizes).unwrap_or(0.0);
    let middle = [0.0, 0.0, 0.0, middle_size_px];
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
    Spread {
        scatter,
        middle_size_px,
    }
}

/// One fit of what all frames share.
struct Pool {
    /// Shift that all centres share, px.
    shift: [f64; 2],
    residuals: Vec<f64>,
    /// Robust standard deviation of the residuals, grey levels.
    scale: f64,
    radius_std_px: Option<f64>,
}

/// Places in the vector of unknowns.
const RADIUS: usize = 2;
const BLUR: usize = 3;
const EXPOSURE: usize = 4;
const TERMS: usize = 5;

/// Gauss-Newton steps at most.
const STEPS: usize = 12;

/// Converged when radius, blur and shift move by less, px.
const CONVERGED_PX: f64 = 5e-4;

const TUKEY: f64 = 4.685;

impl Pool {
    /// Fits `shared` (and a common shift) to the frames.
    fn settle(frames: &[Studied<'_>], shared: &mut Shared, lesson: &Lesson) -> Option<Self> {
        let begin = shared.radius_px;
        let mut bands: Vec<(&Studied<'_>, Vec<BandPixel>)> = Vec::new();
        let mut shift = [0.0; 2];
        let mut scale = f64::INFINITY;
        let mut last = None;
        for step in 0..STEPS {
            if step == 0 || step == 3 {
                bands = gather(frames, shared, lesson);
            }
            if bands.len() < LEAST_EXAMPLES {
                return None;
            }
            let first = step == 0 && shared.terms.iter().all(|&t| t == 0.0);
            let mut equations = Equations::build(&bands, shared, shift, lesson, scale);
            if first {
                // Without a brightness the edge has no sign: the first step finds the light alone.
                equations.hold(&[0, 1, RADIUS, BLUR, EXPOSURE]);
            } else if shared.exposure_s == 0.0 {
                equations.hold(&[EXPOSURE]);
            }
            if shared.radius_held {
                equations.hold(&[RADIUS]);
            }
            let change = equations.solve()?;
            scale = equations.scale;
            let clip = |x: f64, most: f64| x.clamp(-most, most);
            shift[0] += clip(change[0], 1.0);
            shift[1] += clip(change[1], 1.0);
            shared.radius_px += clip(change[RADIUS], 0.2 * shared.radius_px);
            shared.blur_px = (shared.blur_px + clip(change[BLUR], 0.5 * shared.blur_px))
                .clamp(ball::BLUR_RANGE_PX.0, ball::BLUR_RANGE_PX.1);
            shared.exposure_s += clip(change[EXPOSURE], 0.5 * shared.exposure_s);
            for (t, c) in shared.terms.iter_mut().zip(change.iter().skip(TERMS)) {
                *t += c;
            }
            let plausible = shared.radius_px > 0.4 * begin
                && shared.radius_px < 2.0 * begin
                && norm(shift[0], shift[1]) < 0.7 * begin;
            if !plausible {
                return None;
            }
            let moved = [0, 1, RADIUS, BLUR]
                .iter()
                .map(|&i| change[i].abs())
                .fold(0.0, f64::max);
            last = Some(equations);
            if !first && step > 1 && moved < CONVERGED_PX {
                break;
            }
        }
        let equations = last?;
        Some(Self {
            shift,
            radius_std_px: if shared.radius_held {
                Some(OUTLINE_STD_PX)
            } else {
                equations.std(RADIUS)
            },
            residuals: equations.residuals,
            scale,
        })
    }

    /// The biweight's cost at `scale`: squared residuals in variances, levelling off for outliers.
    fn cost(&self, scale: f64) -> f64 {
        let cut = TUKEY * scale;
        let cost = |r: f64| {
            let x = 1.0 - (r / cut).powi(2).min(1.0);
            TUKEY * TUKEY / 3.0 * (1.0 - x * x * x)
        };
        self.residuals.iter().map(|&r| cost(r)).sum()
    }
}

fn gather<'a, 'b>(
    frames: &'b [Studied<'a>],
    shared: &Shared,
    lesson: &Lesson,
) -> Vec<(&'b Studied<'a>, Vec<BandPixel>)> {
    frames
        .iter()
        .filter(|f| f.good)
        .map(|f| {
            let disc = f.disc_with(shared);
            let radius_px = shared.radius_px * f.example.magnification;
            let mut reach = lesson.effort.reach(radius_px, shared.blur_px, 1);
            reach.most_pixels = lesson.most_pixels;
            let pixels = ball::band(&f.example.patch, &disc, shared.blur_px, reach, 1);
            (f, pixels)
        })
        .filter(|(_, pixels)| pixels.len() > 20)
        .collect()
}

/// The ball's picture at one magnification, and what it is with a slightly larger radius or blur.
struct Tables {
    magnification: f64,
    profiles: RadialTable,
    table: RadialTable,
    wider: RadialTable,
    softer: RadialTable,
}

/// Sizes of a class differ by no more than this part, which [`Pose::larger_px`] bridges.
const SIZE_CLASS: f64 = 0.02;

/// The class of a magnification; that of 1 is exact.
fn size_class(magnification: f64) -> i32 {
    (magnification.ln() / SIZE_CLASS).round() as i32
}

/// The tables of every class of sizes that the frames have. Slopes by radius and blur are the model's own, by differences.
fn tables(
    bands: &[(&Studied<'_>, Vec<BandPixel>)],
    shared: &Shared,
    step_px: f64,
    lesson: &Lesson,
) -> BTreeMap<i32, Tables> {
    let classes: BTreeSet<i32> = bands
        .iter()
        .map(|(f, _)| size_class(f.example.magnification))
        .collect();
    let of_class = |class: i32| {
        let magnification = (SIZE_CLASS * f64::from(class)).exp();
        let profiles =
            |radius_px: f64, blur_px: f64| lesson.effort.profiles(magnification * radius_px, blur_px);
        let usual = profiles(shared.radius_px, shared.blur_px);
        Tables {
            magnification,
            table: usual.of_ball(&shared.terms),
            wider: profiles(shared.radius_px + step_px, shared.blur_px).of_ball(&shared.terms),
            softer: profiles(shared.radius_px, shared.blur_px + step_px).of_ball(&shared.terms),
            profiles: usual,
        }
    };
    classes.into_iter().map(|c| (c, of_class(c))).collect()
}

/// The normal equations of one step.
struct Equations {
    normal: DMatrix<f64>,
    right: DVector<f64>,
    residuals: Vec<f64>,
    scale: f64,
    /// Each frame's pull, for the uncertainty: residuals of a frame are not independent.
    pulls: Vec<DVector<f64>>,
}

impl Equations {
    fn build(
        bands: &[(&Studied<'_>, Vec<BandPixel>)],
        shared: &Shared,
        shift: [f64; 2],
        lesson: &Lesson,
        last_scale: f64,
    ) -> Self {
        let terms = shared.terms.len();
        let n = TERMS + terms;
        let step_px = 1e-3 * shared.radius_px.min(1.0);
        let tables = tables(bands, shared, step_px, lesson);
        let mut normal = DMatrix::zeros(n, n);
        let mut right = DVector::zeros(n);
        let mut residuals = Vec::new();
        let mut pulls = Vec::with_capacity(bands.len());
        let mut row = vec![0.0; n];
        let cut = TUKEY * last_scale;
        for (f, pixels) in bands {
            let mut disc = f.disc_with(shared);
            disc.centre.u_px += shift[0];
            disc.centre.v_px += shift[1];
            let Some(Tables {
                magnification,
                profiles,
                table,
                wider,
                softer,
            }) = tables.get(&size_class(f.example.magnification))
            else {
                continue;
            };
            let pose = Pose {
                radius_px: shared.radius_px * magnification,
                larger_px: f.departures[SIZE] + shared.radius_px * (f.example.magnification - magnification),
                swept_px: disc.swept_px,
                points: ball::path_points(disc.swept_px, shared.blur_px),
            };
            let strength = f.example.gain + f.departures[0];
            let mut pull = DVector::zeros(n);
            for p in pixels {
                let at = ball::offset(disc.centre, p);
                let see = |t: &RadialTable| ball::light(t, &pose, at);
                let l = see(table);
                let tilt = f.departures[1] * l.dipole[0] + f.departures[2] * l.dipole[1];
                let residual = p.grey - (p.background * (1.0 - l.cover) + strength * l.ball + tilt);
                residuals.push(residual);
                let x = residual / cut;
                let weight = if !cut.is_finite() {
                    1.0
                } else if x.abs() < 1.0 {
                    (1.0 - x * x).powi(2)
                } else {
                    continue;
                };
                row[0] = p.background * l.cover_slope[0] - strength * l.ball_slope[0];
                row[1] = p.background * l.cover_slope[1] - strength * l.ball_slope[1];
                let slope = |other: &RadialTable| {
                    let o = see(other);
                    (strength * (o.ball - l.ball) - p.background * (o.cover - l.cover)) / step_px
                };
                row[RADIUS] = slope(wider);
                row[BLUR] = slope(softer);
                row[EXPOSURE] = if shared.exposure_s > 0.0 {
                    (strength * l.lengthening[1] - p.background * l.lengthening[0]) / shared.exposure_s
                } else {
                    0.0
                };
                ball::term_shares(profiles, &pose, at, &mut row[TERMS..]);
                for share in &mut row[TERMS..] {
                    *share *= strength;
                }
                for i in 0..n {
                    let wi = weight * row[i];
                    let pull_i = wi * residual;
                    right[i] += pull_i;
                    pull[i] += pull_i;
                    for j in 0..=i {
                        normal[(i, j)] += wi * row[j];
                    }
                }
            }
            pulls.push(pull);
        }
        for i in 0..n {
            for j in 0..i {
                normal[(j, i)] = normal[(i, j)];
            }
        }
        let mut magnitudes: Vec<f32> = residuals.iter().map(|r: &f64| r.abs() as f32).collect();
        let scale = 1.4826 * f64::from(super::super::background::median_in_place(&mut magnitudes));
        Self {
            normal,
            right,
            residuals,
            scale: scale.max(0.29),
            pulls,
        }
    }

    /// Keeps these unknowns as they are.
    fn hold(&mut self, unknowns: &[usize]) {
        for &i in unknowns {
            self.normal.row_mut(i).fill(0.0);
            self.normal.column_mut(i).fill(0.0);
            self.normal[(i, i)] = 1.0;
            self.right[i] = 0.0;
        }
    }

    /// Columns scaled to one, with a whisper of damping: terms that a small ball cannot tell apart must not run away.
    fn inverse(&self) -> Option<DMatrix<f64>> {
        let n = self.normal.nrows();
        let scale: Vec<f64> = (0..n).map(|i| self.normal[(i, i)].max(1e-30).sqrt()).collect();
        let scaled = DMatrix::from_fn(n, n, |i, j| {
            self.normal[(i, j)] / (scale[i] * scale[j]) + if i == j { 1e-7 } else { 0.0 }
        });
        let inverse = scaled.cholesky()?.inverse();
        Some(DMatrix::from_fn(n, n, |i, j| {
            inverse[(i, j)] / (scale[i] * scale[j])
        }))
    }

    fn solve(&self) -> Option<DVector<f64>> {
        let change = self.inverse()? * &self.right;
        change.iter().all(|x| x.is_finite()).then_some(change)
    }

    /// Standard uncertainty of an unknown, the residuals of a frame taken as one.
    fn std(&self, unknown: usize) -> Option<f64> {
        let inverse = self.inverse()?;
        let row = inverse.row(unknown);
        let n = self.pulls.len() as f64;
        let variance: f64 =
            self.pulls.iter().map(|p| (row * p)[(0, 0)].powi(2)).sum::<f64>() * n / (n - 1.0).max(1.0);
        (variance.is_finite() && variance > 0.0).then(|| variance.sqrt())
    }
}
