//! The centre of a ball whose appearance is known: a likelihood fit of the pixels around its edge.
//!
//! The pixels follow the model of [`ball`] with the recording's [`Appearance`]. Free in each frame are the centre and four
//! nuisance parameters: the light's strength, a tilt of it along u and along v, and the ball's size (it comes nearer or goes
//! away). Each of the four has a normal prior of the standard deviation that it shows over the recording. Where the ball looks
//! alike in all frames the prior holds the tilt, and the centre is as exact as the pixels allow; where the ball has seams that
//! turn or passes through uneven light, the tilt is free, and the uncertainty says so.
//!
//! Gauss-Newton with Tukey's biweight. Sectors of the outline whose residuals stand out as a whole (a shadow, a reflection, a
//! hand) are left out as outliers, and the fit is repeated. Covariances take residuals for independent.

use super::ball::{self, BandLimits, BandPixel, Edge, RadialTable, SweptBall, norm};
use super::disc::{Centre, Disc};
use super::overexposure::Overexposure;
use super::patch::Patch;
use crate::detect::noise::ROUNDING_STD_GREY;
use crate::geometry::PixelPoint;
use crate::numeric::least_squares::{Damping, NormalEquations, Problem, Termination, Trial, minimise};
use crate::numeric::robust::{STD_OF_MEDIAN, TUKEY, lower_median, tukey_weight};
use crate::quantity::Quantity;
use nalgebra::SVector;
use std::borrow::Cow;

/// What all frames of a recording have in common.
#[derive(Debug, Clone)]
pub struct Appearance {
    /// Radius of the edge that grey levels have, px: what centres are found with.
    pub radius_px: f64,
    /// Whether the pixels told it; else it is that of the outlines.
    pub radius_fitted: bool,
    /// Standard uncertainty of the radius, px.
    pub radius_std_px: Option<f64>,
    /// How much larger the ball is, px: by the edge that light has, before the camera's sharpening and tone curve. `None` where the radius is not fitted,
    /// or the pixels do not tell.
    pub larger_in_light_px: Option<Quantity>,
    /// Standard uncertainty of a shift that all centres found with it share, root mean square of the two coordinates, px.
    pub shift_std_px: f64,
    /// Standard deviation of the edge's blur (optics and pixel together), px.
    pub blur_px: f64,
    /// How long the shutter is open, s; 0 where its smear cannot be seen.
    pub exposure_s: f64,
    /// The radial profiles of ball and light.
    pub table: RadialTable,
    /// The terms of its light.
    pub terms: Vec<f64>,
    /// Standard deviations of the nuisance parameters over the frames: relative strength of the light, its tilt along u and
    /// along v (grey levels), the radius (px).
    pub nuisance_std: [f64; NUISANCES],
    /// Typical residual, grey levels.
    pub residual_grey: f64,
    /// How much of it, or of the wall, is overexposed: the uncertainty of the shift has that, those of the radii have not.
    pub overexposure: Overexposure,
}

/// By this part of the blur a tone curve moves the edge of a ball, where the pixels do not tell by how much. (Half a white ball before a dark wall with γ =
/// 2.2, none with 1.)
const TONE_BLURS: f64 = 0.3;

impl Appearance {
    /// The ball's radius, px; `None` where there is no number.
    #[must_use]
    pub fn ball_radius_px(&self) -> Option<Quantity> {
        let edge = Quantity::new(self.radius_px, self.radius_std_px.unwrap_or(f64::NAN))?;
        let (larger_px, std_px) = self
            .larger_in_light_px
            .map_or((0.0, None), |by| (by.value, by.std_uncertainty));
        let by_light = Quantity {
            value: edge.value + larger_px,
            ..edge
        };
        Some(by_light.with_more_std(std_px.unwrap_or(TONE_BLURS * self.blur_px)))
    }

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

/// Nuisance parameters of a frame.
pub const NUISANCES: usize = 4;
/// The place of the radius among them.
pub const SIZE: usize = 3;
const FREE: usize = 2 + NUISANCES;

/// How much work a fit may take.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitSettings {
    /// How far inwards from the edge pixels are taken, as a part of the radius; at least as far as the blur reaches.
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
    pub fn band_limits(&self, radius_px: f64, blur_px: f64, points: usize) -> BandLimits {
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
        self.profiles_of(radius_px, Edge::blurred(blur_px))
    }

    /// The same of a ball with such an edge.
    #[must_use]
    pub fn profiles_of(&self, radius_px: f64, edge: Edge) -> RadialTable {
        RadialTable::profiles(radius_px, edge, self.profiles_inside_px(radius_px, edge.blur_px))
    }

    /// How far within the rim they begin, px.
    #[must_use]
    pub fn profiles_inside_px(&self, radius_px: f64, blur_px: f64) -> f64 {
        self.band_limits(radius_px, blur_px, 1).inside_px + 2.0
    }
}

/// A fitted centre.
#[derive(Debug, Clone, Copy)]
pub struct CentreFit {
    /// The centre.
    pub centre: Centre,
    /// The nuisance parameters found.
    pub nuisance: [f64; NUISANCES],
    /// Their variances by the pixels alone, without the priors.
    pub nuisance_variances: [f64; NUISANCES],
}

/// Least part of the outline that fixes a centre.
pub const LEAST_OUTLINE: f64 = 0.3;

/// Pixels that the ball covers by between these parts tell how bright it is at its edge. (Of a streak of more than three radii, that is all of it that
/// is near the edge: less will do.)
const LEAST_COVER: f64 = 0.3;
const MOST_COVER: f64 = 0.99;

/// A sector is an outlier where its mean square residual is this many times the typical one: mean squares of some ten pixels
/// scatter by a half.
const OUTLIER_SECTOR: f64 = 6.0;

/// The model is no better than this part of the edge's height: real lenses, sharpening and codecs see to it.
const MODEL_ERROR: f64 = 0.05;

/// The pixels are chosen anew where the centre has moved by more since, px.
const BAND_FOLLOWS_PX: f64 = 0.7;

/// The centre near `start` (its swept path is taken as given, its radius as the first guess); `gain` is the frame's brightness
/// over the usual one. `None` where the pixels do not hold it.
#[must_use]
pub fn fit(
    patch: &Patch<'_>,
    ball: &Appearance,
    start: &Disc,
    gain: f64,
    settings: &FitSettings,
) -> Option<CentreFit> {
    let mut here = FrameParameters {
        disc: *start,
        nuisance: [0.0, 0.0, 0.0, start.radius_px - ball.radius_px],
    };
    let mut search = CentreSearch::new(patch, ball, start, gain, settings);
    for round in 0.. {
        let end;
        (here, end) = minimise(&mut search, here, &Damping::NONE, settings.steps);
        // A fit that still wanders is no centre; the last thousandths do not matter.
        let near = search.moved_px < 0.02_f64.max(3.0 * settings.converged_px);
        if end == Termination::Singular || !near {
            return None;
        }
        let outliers = search.outlier_sectors();
        let again = outliers.iter().zip(&search.usable).any(|(&o, &u)| o && u);
        if !again || round >= settings.rounds {
            break;
        }
        let left: Vec<bool> = search
            .usable
            .iter()
            .zip(&outliers)
            .map(|(&u, &o)| u && !o)
            .collect();
        let share = left.iter().filter(|&&u| u).count() as f64 / left.len() as f64;
        if share < LEAST_OUTLINE {
            // This ball does not look like the others, all around: the centre is as unsure as the residuals say.
            search.inflate();
            break;
        }
        search.usable = left;
    }
    search.centre_fit(&here)
}

/// The free parameters.
struct FrameParameters {
    disc: Disc,
    nuisance: [f64; NUISANCES],
}

/// The search for the centre, with what it last computed: residuals and equations where its last step began.
struct CentreSearch<'a> {
    patch: &'a Patch<'a>,
    ball: &'a Appearance,
    start: &'a Disc,
    gain: f64,
    settings: &'a FitSettings,
    points: usize,
    /// Sectors of the outline that are no outliers.
    usable: Vec<bool>,
    pixels: Vec<BandPixel>,
    /// The centre around which those were chosen.
    band_centre: Option<PixelPoint>,
    rows: Vec<SVector<f64, FREE>>,
    residuals: Vec<f64>,
    magnitudes: Vec<f32>,
    std_grey: f64,
    /// Mean brightness step across the edge and its mean magnitude, grey levels.
    contrast_grey: (f64, f64),
    /// Without the priors.
    equations: NormalEquations<FREE>,
    /// Length of the last step, px; infinite where that led out of the model's domain.
    moved_px: f64,
    steps: usize,
}

impl Problem for CentreSearch<'_> {
    type State = FrameParameters;
    type Step = SVector<f64, FREE>;

    fn step(&mut self, here: &FrameParameters, _damping: f64) -> Option<Self::Step> {
        self.linearise(here)?;
        // Far from the minimum outliers are what leads there: the first step weighs all alike.
        let cut = if self.steps == 0 {
            f64::INFINITY
        } else {
            TUKEY * self.std_grey
        };
        self.steps += 1;
        self.equations = NormalEquations::default();
        for ((row, &residual), p) in self.rows.iter().zip(&self.residuals).zip(&self.pixels) {
            let weight = tukey_weight(residual, cut);
            if weight > 0.0 && self.usable[usize::from(p.sector)] {
                self.equations.push(row, residual, weight);
            }
        }
        self.with_priors(&here.nuisance).step(0.0, 0.0)
    }

    fn moved(&mut self, here: &FrameParameters, step: &Self::Step) -> Option<FrameParameters> {
        let moved_px = norm(step[0], step[1]);
        self.moved_px = f64::INFINITY;
        let part = (0.5 * self.ball.radius_px.max(2.0) / moved_px).min(1.0);
        let nuisance: [f64; NUISANCES] = std::array::from_fn(|i| here.nuisance[i] + part * step[2 + i]);
        let mut disc = here.disc;
        disc.centre.u_px += part * step[0];
        disc.centre.v_px += part * step[1];
        disc.radius_px = self.ball.radius_px + nuisance[SIZE];
        let near = nuisance[SIZE].abs() < 0.5 * self.ball.radius_px
            && disc.centre.distance_px(self.start.centre) < 0.7 * self.ball.radius_px + 1.0;
        if near {
            self.moved_px = moved_px;
        }
        near.then_some(FrameParameters { disc, nuisance })
    }

    fn cost(&self, _of: &FrameParameters, _here: &FrameParameters) -> f64 {
        // Weights change from step to step: costs cannot be compared, and every step is taken.
        0.0
    }

    fn is_settled(&self, _here: &FrameParameters, trial: &Trial<'_, Self::Step>) -> bool {
        !trial.taken || self.moved_px < self.settings.converged_px
    }
}

impl<'a> CentreSearch<'a> {
    fn new(
        patch: &'a Patch<'a>,
        ball: &'a Appearance,
        start: &'a Disc,
        gain: f64,
        settings: &'a FitSettings,
    ) -> Self {
        Self {
            patch,
            ball,
            start,
            gain,
            settings,
            points: ball::path_points(start.swept_px, ball.blur_px),
            usable: vec![true; ball::sector_count(ball.radius_px)],
            pixels: Vec::new(),
            band_centre: None,
            rows: Vec::new(),
            residuals: Vec::new(),
            magnitudes: Vec::new(),
            std_grey: 0.0,
            contrast_grey: (0.0, 0.0),
            equations: NormalEquations::default(),
            moved_px: f64::INFINITY,
            steps: 0,
        }
    }

    /// Standard deviation of residuals that are rounding and noise alone.
    fn least_std_grey(&self) -> f64 {
        self.patch.noise_grey.max(ROUNDING_STD_GREY)
    }

    /// Residuals and slopes of the pixels around the outline `here`; `None` where these are too few.
    fn linearise(&mut self, here: &FrameParameters) -> Option<()> {
        let (ball, disc) = (self.ball, &here.disc);
        if !self
            .band_centre
            .is_some_and(|c| c.distance_px(disc.centre) <= BAND_FOLLOWS_PX)
        {
            let limits = self
                .settings
                .band_limits(ball.radius_px, ball.blur_px, self.points);
            self.pixels = ball::band(self.patch, disc, ball.blur_px, limits, self.usable.len());
            self.band_centre = Some(disc.centre);
        }
        if self.pixels.len() < 4 * FREE {
            return None;
        }
        let strength = self.gain + here.nuisance[0];
        let swept = SweptBall {
            radius_px: ball.radius_px,
            larger_px: here.nuisance[SIZE],
            swept_px: disc.swept_px,
            bent_px: disc.bent_px,
            points: self.points,
        };
        let length_px = norm(disc.swept_px[0], disc.swept_px[1]);
        // The longest that the ball is over a place, as a part of the exposure.
        let longest = (2.0 * ball.radius_px / length_px).min(1.0);
        let least_cover = LEAST_COVER.min(0.5 * longest);
        let (mut sum, mut magnitude, mut count) = (0.0, 0.0, 0.0);
        self.rows.clear();
        self.residuals.clear();
        for p in &self.pixels {
            let l = ball::pixel_model(&ball.table, &swept, ball::offset(disc.centre, p));
            let tilt = here.nuisance[1] * l.dipole[0] + here.nuisance[2] * l.dipole[1];
            let grey = p.background * (1.0 - l.cover) + strength * l.ball + tilt;
            self.residuals.push(p.grey - grey);
            // The pixel's place in the ball moves against the centre.
            self.rows.push(SVector::from([
                p.background * l.cover_slope[0] - strength * l.ball_slope[0],
                p.background * l.cover_slope[1] - strength * l.ball_slope[1],
                l.ball,
                l.dipole[0],
                l.dipole[1],
                p.background * l.outward[0] - strength * l.outward[1],
            ]));
            if l.cover > least_cover && l.cover < MOST_COVER {
                let step = strength * l.ball / l.cover - p.background;
                sum += step;
                magnitude += step.abs();
                count += 1.0;
            }
        }
        let n = f64::max(count, 1.0);
        self.contrast_grey = (sum / n, magnitude / n);
        self.magnitudes.clear();
        let residuals = self.residuals.iter().zip(&self.pixels);
        let usable = residuals.filter(|(_, p)| self.usable[usize::from(p.sector)]);
        self.magnitudes.extend(usable.map(|(r, _)| r.abs() as f32));
        let std_grey = STD_OF_MEDIAN * f64::from(lower_median(&mut self.magnitudes));
        self.std_grey = std_grey.max(self.least_std_grey());
        Some(())
    }

    /// The equations with the priors of the `nuisance` parameters, in units of the residuals' variance.
    fn with_priors(&self, nuisance: &[f64; NUISANCES]) -> NormalEquations<FREE> {
        let mut equations = self.equations;
        for (i, (value, std)) in nuisance.iter().zip(self.ball.nuisance_std).enumerate() {
            equations.push_prior(2 + i, -value, (self.std_grey / std.max(1e-9)).powi(2));
        }
        equations
    }

    /// Takes the root mean square residual for the typical one, where that is larger.
    fn inflate(&mut self) {
        let (mut sum, mut n) = (0.0, 0.0);
        for (r, p) in self.residuals.iter().zip(&self.pixels) {
            if self.usable[usize::from(p.sector)] {
                sum += r * r;
                n += 1.0;
            }
        }
        self.std_grey = self.std_grey.max((sum / f64::max(n, 1.0)).sqrt());
    }

    /// Sectors whose pixels at the edge and beyond differ as a group from the model.
    fn outlier_sectors(&self) -> Vec<bool> {
        let sectors = self.usable.len();
        let (mut count, mut square) = (vec![0.0; sectors], vec![0.0; sectors]);
        for (p, r) in self.pixels.iter().zip(&self.residuals) {
            // The inside may carry a seam or a highlight; the edge and the ground beyond it decide.
            if p.at_edge {
                count[usize::from(p.sector)] += 1.0;
                square[usize::from(p.sector)] += r * r;
            }
        }
        let typical_grey = self.ball.residual_grey.max(self.least_std_grey());
        let limit = OUTLIER_SECTOR
            * (self.std_grey.max(typical_grey).powi(2) + (MODEL_ERROR * self.contrast_grey.1).powi(2));
        count
            .iter()
            .zip(&square)
            .map(|(&n, &s)| n > 2.0 && s / n > limit)
            .collect()
    }

    /// Part of the outline that has usable pixels on both sides of the edge.
    fn outline_used(&self, disc: &Disc) -> f64 {
        let mut inner = vec![false; self.usable.len()];
        let mut outer = inner.clone();
        for p in &self.pixels {
            let (x, y) = ball::nearest_offset(disc, p.u, p.v);
            let side = if norm(x, y) < disc.radius_px {
                &mut inner
            } else {
                &mut outer
            };
            side[usize::from(p.sector)] = true;
        }
        let used = (0..self.usable.len()).filter(|&i| self.usable[i] && inner[i] && outer[i]);
        used.count() as f64 / self.usable.len() as f64
    }

    /// The centre where the search ended; `None` where it is unsure, or its edge does not stand out.
    fn centre_fit(&self, here: &FrameParameters) -> Option<CentreFit> {
        let variance = self.std_grey * self.std_grey;
        let covariance = self.with_priors(&here.nuisance).covariance()?;
        let by_pixels = self.equations.covariance();
        let (step, magnitude) = self.contrast_grey;
        let centre = Centre {
            disc: here.disc,
            covariance_px2: (variance * covariance.fixed_view::<2, 2>(0, 0)).into(),
            outline_used: self.outline_used(&here.disc),
            residual_grey: self.std_grey,
            contrast_grey: magnitude * f64::signum(step),
        };
        let sure = centre.std_px() < 0.25 * self.ball.radius_px && centre.outline_used >= LEAST_OUTLINE;
        // An edge that does not stand out of its own residuals is no edge.
        (sure && magnitude > self.std_grey).then_some(CentreFit {
            centre,
            nuisance: here.nuisance,
            nuisance_variances: std::array::from_fn(|i| {
                by_pixels.map_or(f64::INFINITY, |c| variance * c[(2 + i, 2 + i)])
            }),
        })
    }
}
