//! The centre of a ball whose appearance is known: two coordinates, and how much its light differs from usual.
//!
//! The pixels of the band follow [`ball`]'s picture with the recording's `Appearance`; free in each frame
//! are the centre and four nuisance: the light's strength, a tilt of it along u and v, and the ball's size (it comes
//! nearer or goes away), each held to what it scatters by over the recording. Where the ball looks alike in all frames the tilt is held, and the centre is as
//! exact as the pixels allow; where it has seams that turn or passes uneven light, the tilt is free, and the
//! uncertainty says so.
//!
//! Gauss-Newton with Tukey's biweight; sectors of the outline whose residuals stand out as a whole (a shadow, a
//! reflection, a hand) are left out and the fit repeated.

use super::ball::{self, BandLimits, BandPixel, RadialTable, SweptBall, norm};
use super::{Centre, Disc, Patch};
use crate::detect::background::ROUNDING_STD_GREY;
use nalgebra::{SMatrix, SVector};
use std::borrow::Cow;

/// What all frames of a recording have in common.
#[derive(Debug, Clone)]
pub struct Appearance {
    /// RadiusSource, px.
    pub radius_px: f64,
    /// Standard uncertainty of the radius, px.
    pub radius_std_px: Option<f64>,
    /// Standard uncertainty of a shift that all centres found with it share, root mean square of the two coordinates, px.
    pub shift_std_px: f64,
    /// Standard deviation of the edge's blur (optics and pixel together), px.
    pub blur_px: f64,
    /// How long the shutter is open, s; 0 where its smear cannot be seen.
    pub exposure_s: f64,
    /// The ball's picture.
    pub table: RadialTable,
    /// The terms of its light.
    pub terms: Vec<f64>,
    /// What a frame departs by: relative strength of the light, its tilt along u and along v (grey levels), the radius
    /// (px); standard deviations.
    pub scatter: [f64; NUISANCES],
    /// Typical residual, grey levels.
    pub residual_grey: f64,
}

impl Appearance {
    /// The same ball nearer to the camera or farther from it, so that it is `times` as large.
    #[must_use]
    pub fn magnified(&self, times: f64, settings: &FitSettings) -> Cow<'_, Self> {
        if times == 1.0 {
            return Cow::Borrowed(self);
        }
        let radius_px = times * self.radius_px;
        Cow::Owned(Self {
            radius_px,
            table: settings.profiles(radius_px, self.blur_px).of_ball(&self.terms),
            ..self.clone()
        })
    }
}

/// Departures of a frame from what is usual.
pub const NUISANCES: usize = 4;
/// The place of the radius among them.
pub const SIZE: usize = 3;
const FREE: usize = 2 + NUISANCES;

/// How much work a fit may spend.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitSettings {
    /// Inwards from the edge, as a part of the radius; at least the blur's own reach.
    pub inside: f64,
    /// Pixels times points of the swept path, at most.
    pub most_lookups: usize,
    /// Gauss-Newton steps at most.
    pub steps: usize,
    /// Converged when a step moves the centre by less, px.
    pub converged_px: f64,
    /// Times that sectors may be left out and the fit repeated.
    pub rounds: usize,
}

/// Blurs from the edge to where nothing of it is left.
pub const EDGE_BLURS: f64 = 3.5;

impl FitSettings {
    /// The band for a ball of this size.
    #[must_use]
    pub fn reach(&self, radius_px: f64, blur_px: f64, points: usize) -> BandLimits {
        let edge = EDGE_BLURS * blur_px + 1.0;
        BandLimits {
            inside_px: edge.max(self.inside * radius_px),
            outside_px: edge,
            most_pixels: (self.most_lookups / points).max(200),
        }
    }

    /// The profiles of a ball of this size, as far inwards as the band goes.
    #[must_use]
    pub fn profiles(&self, radius_px: f64, blur_px: f64) -> RadialTable {
        let inside_px = self.reach(radius_px, blur_px, 1).inside_px;
        RadialTable::profiles(radius_px, blur_px, inside_px + 2.0)
    }
}

/// A fitted centre.
#[derive(Debug, Clone, Copy)]
pub struct CentreFit {
    /// The centre; its covariance takes residuals for independent.
    pub centre: Centre,
    /// The nuisance found.
    pub nuisance: [f64; NUISANCES],
    /// Their variances by the fit, without what was known beforehand.
    pub nuisance_variances: [f64; NUISANCES],
}

/// Least part of the outline that fixes a centre.
pub const LEAST_OUTLINE: f64 = 0.3;

/// A sector whose mean square residual is this many times the typical one is spoilt: mean squares of some ten pixels
/// scatter by a half.
const SPOILT: f64 = 6.0;

/// The model is no better than this part of the edge's height: real lenses, sharpening and codecs see to it.
const UNLIKE: f64 = 0.05;

/// Tukey's constant: 95 % efficiency for normal residuals.
const TUKEY: f64 = 4.685;

/// The centre near `start` (its swept path is taken as given, its radius as the first guess); `gain` is the frame's brightness over the usual one.
/// `None` where the pixels do not hold it.
#[must_use]
pub fn fit(
    patch: &Patch<'_>,
    ball: &Appearance,
    start: &Disc,
    gain: f64,
    settings: &FitSettings,
) -> Option<CentreFit> {
    let points = ball::path_points(start.swept_px, ball.blur_px);
    let reach = settings.reach(ball.radius_px, ball.blur_px, points);
    let mut here = FrameParameters {
        disc: *start,
        nuisance: [0.0, 0.0, 0.0, start.radius_px - ball.radius_px],
    };
    let mut usable = vec![true; ball::sector_count(ball.radius_px)];
    let mut pixels = ball::band(patch, &here.disc, ball.blur_px, reach, usable.len());
    let mut gathered_at = here.disc.centre;
    let floor_grey = patch.noise_grey.max(ROUNDING_STD_GREY);
    for round in 0.. {
        let mut system = None;
        let mut moved = f64::INFINITY;
        for step in 0..settings.steps {
            if here.disc.centre.distance_px(gathered_at) > 0.7 {
                pixels = ball::band(patch, &here.disc, ball.blur_px, reach, usable.len());
                gathered_at = here.disc.centre;
            }
            let mut now = Linearisation::build(&pixels, &here, ball, gain, points, &usable, floor_grey)?;
            // Far from the place, outliers are what leads there.
            now.weigh(round == 0 && step == 0);
            let change = now.solve(ball)?;
            moved = norm(change[0], change[1]);
            let most = 0.5 * ball.radius_px.max(2.0);
            let part = (most / moved).min(1.0);
            here.disc.centre.u_px += part * change[0];
            here.disc.centre.v_px += part * change[1];
            for (d, c) in here.nuisance.iter_mut().zip(change.iter().skip(2)) {
                *d += part * c;
            }
            here.disc.radius_px = ball.radius_px + here.nuisance[SIZE];
            if !(here.nuisance[SIZE].abs() < 0.5 * ball.radius_px) {
                return None;
            }
            if !(here.disc.centre.distance_px(start.centre) < 0.7 * ball.radius_px + 1.0) {
                return None;
            }
            system = Some(now);
            if moved < settings.converged_px {
                break;
            }
        }
        // A fit that still wanders is no centre; the last thousandths do not matter.
        if !(moved < 0.02_f64.max(3.0 * settings.converged_px)) {
            return None;
        }
        let system = system?;
        let spoilt = system.spoilt(&pixels, usable.len(), ball.residual_grey.max(floor_grey));
        let again = spoilt.iter().zip(&usable).any(|(&s, &u)| s && u);
        if !again || round >= settings.rounds {
            return system.fitted(&pixels, &here, ball, &usable);
        }
        let left: Vec<bool> = usable.iter().zip(&spoilt).map(|(&u, &s)| u && !s).collect();
        let share = left.iter().filter(|&&u| u).count() as f64 / left.len() as f64;
        if share < LEAST_OUTLINE {
            // This ball does not look like the others, all around: the centre is as unsure as the residuals say.
            return system.inflated().fitted(&pixels, &here, ball, &usable);
        }
        usable = left;
    }
    None
}

struct FrameParameters {
    disc: Disc,
    nuisance: [f64; NUISANCES],
}

/// Residuals, slopes and weights of one step.
struct Linearisation {
    rows: Vec<[f64; FREE]>,
    residuals: Vec<f64>,
    weights: Vec<f64>,
    usable: Vec<bool>,
    scale: f64,
    normal: SMatrix<f64, FREE, FREE>,
    contrast: (f64, f64, f64),
    nuisance: [f64; NUISANCES],
}

impl Linearisation {
    fn build(
        pixels: &[BandPixel],
        here: &FrameParameters,
        ball: &Appearance,
        gain: f64,
        points: usize,
        usable: &[bool],
        floor_grey: f64,
    ) -> Option<Self> {
        if pixels.len() < 4 * FREE {
            return None;
        }
        let mut rows = Vec::with_capacity(pixels.len());
        let mut residuals = Vec::with_capacity(pixels.len());
        let mut contrast = (0.0, 0.0, 0.0);
        let strength = gain + here.nuisance[0];
        let swept = SweptBall {
            radius_px: ball.radius_px,
            larger_px: here.nuisance[SIZE],
            swept_px: here.disc.swept_px,
            points,
        };
        for p in pixels {
            let at = ball::offset(here.disc.centre, p);
            let l = ball::pixel_model(&ball.table, &swept, at);
            let tilt = here.nuisance[1] * l.dipole[0] + here.nuisance[2] * l.dipole[1];
            let grey = p.background * (1.0 - l.cover) + strength * l.ball + tilt;
            residuals.push(p.grey - grey);
            // The pixel's place in the ball moves against the centre.
            rows.push([
                p.background * l.cover_slope[0] - strength * l.ball_slope[0],
                p.background * l.cover_slope[1] - strength * l.ball_slope[1],
                l.ball,
                l.dipole[0],
                l.dipole[1],
                p.background * l.outward[0] - strength * l.outward[1],
            ]);
            if l.cover > 0.3 && l.cover < 0.99 {
                let step = strength * l.ball / l.cover - p.background;
                contrast.0 += step;
                contrast.1 += step.abs();
                contrast.2 += 1.0;
            }
        }
        let mut magnitudes: Vec<f32> = residuals
            .iter()
            .zip(pixels)
            .filter(|(_, p)| usable[usize::from(p.sector)])
            .map(|(r, _)| r.abs() as f32)
            .collect();
        let scale =
            (1.4826 * f64::from(super::super::background::median_in_place(&mut magnitudes))).max(floor_grey);
        Some(Self {
            rows,
            weights: vec![0.0; residuals.len()],
            residuals,
            usable: pixels.iter().map(|p| usable[usize::from(p.sector)]).collect(),
            scale,
            normal: SMatrix::zeros(),
            contrast,
            nuisance: here.nuisance,
        })
    }

    /// Weights by the biweight, or all alike.
    fn weigh(&mut self, alike: bool) {
        let cut = TUKEY * self.scale;
        for ((w, r), usable) in self.weights.iter_mut().zip(&self.residuals).zip(&self.usable) {
            let x = r / cut;
            *w = match (usable, alike) {
                (false, _) => 0.0,
                (true, true) => 1.0,
                (true, false) if x.abs() < 1.0 => (1.0 - x * x).powi(2),
                _ => 0.0,
            };
        }
    }

    /// What is known of the nuisance beforehand, in units of the residuals' variance.
    fn known(&self, ball: &Appearance) -> [f64; NUISANCES] {
        ball.scatter.map(|s| (self.scale / s.max(1e-9)).powi(2))
    }

    fn solve(&mut self, ball: &Appearance) -> Option<SVector<f64, FREE>> {
        let mut normal = SMatrix::<f64, FREE, FREE>::zeros();
        let mut right = SVector::<f64, FREE>::zeros();
        for ((row, r), &w) in self.rows.iter().zip(&self.residuals).zip(&self.weights) {
            if w == 0.0 {
                continue;
            }
            for i in 0..FREE {
                let wi = w * row[i];
                right[i] += wi * r;
                for j in 0..=i {
                    normal[(i, j)] += wi * row[j];
                }
            }
        }
        for i in 0..FREE {
            for j in 0..i {
                normal[(j, i)] = normal[(i, j)];
            }
        }
        self.normal = normal;
        for (i, k) in self.known(ball).into_iter().enumerate() {
            normal[(2 + i, 2 + i)] += k;
            right[2 + i] -= k * self.nuisance[i];
        }
        let change = normal.cholesky()?.solve(&right);
        change.iter().all(|x| x.is_finite()).then_some(change)
    }

    /// The same with the root mean square residual for the typical one.
    fn inflated(mut self) -> Self {
        let (mut sum, mut n) = (0.0, 0.0);
        for (r, usable) in self.residuals.iter().zip(&self.usable) {
            if *usable {
                sum += r * r;
                n += 1.0;
            }
        }
        self.scale = self.scale.max((sum / f64::max(n, 1.0)).sqrt());
        self
    }

    /// Sectors whose pixels at the edge and beyond depart as a group from the model.
    fn spoilt(&self, pixels: &[BandPixel], sectors: usize, typical_grey: f64) -> Vec<bool> {
        let (mut count, mut square) = (vec![0.0; sectors], vec![0.0; sectors]);
        for (p, r) in pixels.iter().zip(&self.residuals) {
            // The inside may carry a seam or a highlight; the edge and the ground beyond it decide.
            if p.at_edge {
                count[usize::from(p.sector)] += 1.0;
                square[usize::from(p.sector)] += r * r;
            }
        }
        let (_, magnitude, n) = self.contrast;
        let contrast_grey = magnitude / f64::max(n, 1.0);
        let limit = SPOILT * (self.scale.max(typical_grey).powi(2) + (UNLIKE * contrast_grey).powi(2));
        count
            .iter()
            .zip(&square)
            .map(|(&n, &s)| n > 2.0 && s / n > limit)
            .collect()
    }

    fn fitted(
        &self,
        pixels: &[BandPixel],
        here: &FrameParameters,
        ball: &Appearance,
        usable: &[bool],
    ) -> Option<CentreFit> {
        let mut normal = self.normal;
        for (i, k) in self.known(ball).into_iter().enumerate() {
            normal[(2 + i, 2 + i)] += k;
        }
        let inverse = normal.cholesky()?.inverse();
        let variance = self.scale * self.scale;
        let free = self.normal.cholesky().map(|c| c.inverse());
        let covariance_px2 = [
            [variance * inverse[(0, 0)], variance * inverse[(0, 1)]],
            [variance * inverse[(1, 0)], variance * inverse[(1, 1)]],
        ];
        let outline_used = outline_seen(pixels, &here.disc, usable);
        let (step, magnitude, n) = self.contrast;
        let contrast_grey = if n > 0.0 {
            (magnitude / n) * f64::signum(step)
        } else {
            0.0
        };
        let std_px = (0.5 * (covariance_px2[0][0] + covariance_px2[1][1])).sqrt();
        let good = std_px.is_finite() && std_px < 0.25 * ball.radius_px && outline_used >= LEAST_OUTLINE;
        // An edge that does not stand out of its own residuals is no edge.
        (good && contrast_grey.abs() > self.scale).then(|| CentreFit {
            centre: Centre {
                disc: here.disc,
                covariance_px2,
                outline_used,
                residual_grey: self.scale,
                contrast_grey,
            },
            nuisance: here.nuisance,
            nuisance_variances: std::array::from_fn(|i| {
                free.as_ref()
                    .map_or(f64::INFINITY, |c| variance * c[(2 + i, 2 + i)])
            }),
        })
    }
}

/// Part of the outline that has usable pixels on both sides of the edge.
fn outline_seen(pixels: &[BandPixel], disc: &Disc, usable: &[bool]) -> f64 {
    let mut inner = vec![false; usable.len()];
    let mut outer = vec![false; usable.len()];
    for p in pixels {
        let (x, y) = ball::nearest_offset(disc, p.u, p.v);
        if norm(x, y) < disc.radius_px {
            inner[usize::from(p.sector)] = true;
        } else {
            outer[usize::from(p.sector)] = true;
        }
    }
    let seen = (0..usable.len())
        .filter(|&i| usable[i] && inner[i] && outer[i])
        .count();
    seen as f64 / usable.len() as f64
}
