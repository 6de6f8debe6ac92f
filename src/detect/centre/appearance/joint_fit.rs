//! One fit of what all frames share: radius, blur, exposure, light, and a shift of all centres, by damped Gauss-Newton steps
//! (Levenberg and Marquardt: radius, blur and the light's fall towards the rim can hardly be told apart in a small ball, and
//! undamped steps ran away).

use super::{AppearanceSettings, FrameEstimate, LEAST_FRAMES, OUTLINE_STD_PX, SharedParameters};
use crate::detect::background::{ROUNDING_STD_GREY, median_in_place};
use crate::detect::centre::ball::{self, BandPixel, PixelModel, RadialTable, SweptBall, norm};
use crate::detect::centre::known_ball::SIZE;
use crate::geometry::PixelPoint;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// What was fitted.
pub struct JointFit {
    /// Covariance of the light's terms, grey levels²; `None` where the equations do not tell.
    light: Option<DMatrix<f64>>,
    /// Shift that all centres share, px.
    pub shift: [f64; 2],
    /// Its standard uncertainty, root mean square of the two coordinates, px.
    pub shift_std_px: f64,
    /// Of all pixels, grey levels.
    pub residuals: Vec<f64>,
    /// Robust standard deviation of the residuals, grey levels.
    pub scale: f64,
    /// Standard uncertainty of the radius.
    pub radius_std_px: Option<f64>,
}

/// Places in the vector of unknowns.
const RADIUS: usize = 2;
const BLUR: usize = 3;
const EXPOSURE: usize = 4;
const TERMS: usize = 5;

/// Steps at most, those that led nowhere among them.
const STEPS: usize = 24;

/// The pixels are chosen anew after this step, which is near the place.
const NEAR: usize = 3;

/// Converged when radius, blur and shift move by less, px.
const CONVERGED_PX: f64 = 5e-4;

/// Damping of the scaled normal equations: the least (terms that a small ball cannot tell apart must not run away), that of the
/// start, and where the search has nowhere to go.
const LEAST_DAMPING: f64 = 1e-7;
const DAMPING: f64 = 1e-4;
const STUCK: f64 = 1e3;

/// Of a shift whose uncertainty the equations do not tell, px.
const UNKNOWN_SHIFT_STD_PX: f64 = 0.1;

const TUKEY: f64 = 4.685;

/// A frame and its pixels around the outline.
pub type FrameBand<'a> = (&'a FrameEstimate<'a>, Vec<BandPixel>);

/// Where a fit stands.
#[derive(Debug, Clone)]
struct Iterate {
    shared: SharedParameters,
    shift: [f64; 2],
}

impl Iterate {
    /// Moved by a step; `None` where that is no ball any more.
    fn moved(&self, change: &DVector<f64>, begin_radius_px: f64) -> Option<Self> {
        let mut to = self.clone();
        let clip = |x: f64, most: f64| x.clamp(-most, most);
        for (s, c) in to.shift.iter_mut().zip(change.iter()) {
            *s += clip(*c, 1.0);
        }
        let s = &mut to.shared;
        s.radius_px += clip(change[RADIUS], 0.2 * s.radius_px);
        s.blur_px = (s.blur_px + clip(change[BLUR], 0.5 * s.blur_px))
            .clamp(ball::BLUR_RANGE_PX.0, ball::BLUR_RANGE_PX.1);
        s.exposure_s += clip(change[EXPOSURE], 0.5 * s.exposure_s);
        for (t, c) in s.terms.iter_mut().zip(change.iter().skip(TERMS)) {
            *t += c;
        }
        let plausible = s.radius_px > 0.4 * begin_radius_px
            && s.radius_px < 2.0 * begin_radius_px
            && norm(to.shift[0], to.shift[1]) < 0.7 * begin_radius_px;
        plausible.then_some(to)
    }
}

impl JointFit {
    /// Fits `shared` (and a common shift) to the frames.
    pub fn of_frames(
        frames: &[FrameEstimate<'_>],
        shared: &mut SharedParameters,
        settings: &AppearanceSettings,
    ) -> Option<Self> {
        let rough = gather_bands(frames, shared, settings);
        let mut iterate = Iterate {
            shared: shared.clone(),
            shift: [0.0; 2],
        };
        descend(&rough, &mut iterate, settings, NEAR)?;
        // Pixels are chosen around the frames' own centres; the common shift is small beside the band.
        let near = gather_bands(frames, &iterate.shared, settings);
        let equations = descend(&near, &mut iterate, settings, STEPS)?;
        Some(Self::of(equations, iterate, shared))
    }

    /// The same on these pixels.
    pub fn on_pixels(
        bands: &[FrameBand<'_>],
        shared: &mut SharedParameters,
        settings: &AppearanceSettings,
    ) -> Option<Self> {
        let mut iterate = Iterate {
            shared: shared.clone(),
            shift: [0.0; 2],
        };
        let equations = descend(bands, &mut iterate, settings, STEPS)?;
        Some(Self::of(equations, iterate, shared))
    }

    fn of(equations: NormalEquations, iterate: Iterate, shared: &mut SharedParameters) -> Self {
        *shared = iterate.shared;
        Self {
            light: equations.light_covariance(),
            shift: iterate.shift,
            shift_std_px: equations
                .std(0)
                .zip(equations.std(1))
                .map_or(UNKNOWN_SHIFT_STD_PX, |(u, v)| (0.5 * (u * u + v * v)).sqrt())
                .hypot(equations.shift_std_by_radius()),
            radius_std_px: if shared.radius_held {
                Some(OUTLINE_STD_PX)
            } else {
                equations.std(RADIUS)
            },
            scale: equations.scale,
            residuals: equations.residuals,
        }
    }

    /// What it costs to do with the first `left` of the `terms` that were fitted alone, in noise variances, to first order: the
    /// others over their uncertainty, squared (Wald's test). 0 where there are no others, or their uncertainty is unknown.
    #[must_use]
    pub fn cost_without(&self, terms: &[f64], left: usize) -> f64 {
        let others = terms.get(left..).unwrap_or_default();
        let cost = |light: &DMatrix<f64>| {
            let block = light.view((left, left), (others.len(), others.len()));
            let others = DVector::from_row_slice(others);
            Some(others.dot(&block.into_owned().cholesky()?.solve(&others)))
        };
        self.light
            .as_ref()
            .filter(|_| !others.is_empty())
            .and_then(cost)
            .unwrap_or(0.0)
    }

    /// The biweight's cost at `scale`: squared residuals in variances, levelling off for outliers.
    #[must_use]
    pub fn cost(&self, scale: f64) -> f64 {
        cost(&self.residuals, scale)
    }
}

fn root_mean_square(residuals: &[f64]) -> f64 {
    let sum: f64 = residuals.iter().map(|r| r * r).sum();
    (sum / residuals.len().max(1) as f64)
        .sqrt()
        .max(ROUNDING_STD_GREY)
}

fn cost(residuals: &[f64], scale: f64) -> f64 {
    let cut = TUKEY * scale;
    let cost = |r: f64| {
        let x = 1.0 - (r / cut).powi(2).min(1.0);
        TUKEY * TUKEY / 3.0 * (1.0 - x * x * x)
    };
    residuals.iter().map(|&r| cost(r)).sum()
}

/// Up to `steps` steps downhill from `iterate`; the equations there. `None` where that
/// leads away from any ball.
fn descend(
    bands: &[FrameBand<'_>],
    iterate: &mut Iterate,
    settings: &AppearanceSettings,
    steps: usize,
) -> Option<NormalEquations> {
    if bands.len() < LEAST_FRAMES {
        return None;
    }
    let begin_radius_px = iterate.shared.radius_px;
    if iterate.shared.terms.iter().all(|&t| t == 0.0) {
        // Without a brightness the edge has no sign: the first step finds the light alone.
        let mut light = NormalEquations::build(bands, iterate, settings, f64::INFINITY);
        light.hold(&[0, 1, RADIUS, BLUR, EXPOSURE]);
        *iterate = iterate.moved(&light.solve(LEAST_DAMPING)?, begin_radius_px)?;
    }
    // The first step is led by what the median of the residuals would call outliers.
    let scale = root_mean_square(&residuals(bands, iterate, settings));
    let mut now = NormalEquations::build(bands, iterate, settings, scale);
    let mut damping = DAMPING;
    for _ in 0..steps {
        now.hold_fixed_parameters(&iterate.shared);
        let change = now.solve(damping)?;
        let before = cost(&now.residuals, now.weighed_at);
        let better = iterate.moved(&change, begin_radius_px).and_then(|to| {
            let next = NormalEquations::build(bands, &to, settings, now.scale);
            (cost(&next.residuals, now.weighed_at) <= before).then_some((to, next))
        });
        let px = [0, 1, RADIUS, BLUR].map(|i| change[i].abs());
        match better {
            Some((to, next)) => {
                (*iterate, now) = (to, next);
                damping = (0.1 * damping).max(LEAST_DAMPING);
            }
            None => damping = (10.0 * damping).max(DAMPING),
        }
        if px.into_iter().fold(0.0, f64::max) < CONVERGED_PX || damping > STUCK {
            break;
        }
    }
    now.hold_fixed_parameters(&iterate.shared);
    Some(now)
}

/// The pixels of every good frame's band.
pub fn gather_bands<'a, 'b>(
    frames: &'b [FrameEstimate<'a>],
    shared: &SharedParameters,
    settings: &AppearanceSettings,
) -> Vec<FrameBand<'b>>
where
    'a: 'b,
{
    frames
        .iter()
        .filter(|f| f.good)
        .map(|f| {
            let disc = f.disc_with(shared);
            let radius_px = shared.radius_px * f.input.magnification;
            let mut reach = settings.fit.reach(radius_px, shared.blur_px, 1);
            reach.most_pixels = settings.most_pixels;
            let pixels = ball::band(&f.input.patch, &disc, shared.blur_px, reach, 1);
            (f, pixels)
        })
        .filter(|(_, pixels)| pixels.len() > 20)
        .collect()
}

/// The ball's picture at one magnification, and what it is with a slightly larger radius or blur.
struct ProfileTables {
    magnification: f64,
    profiles: RadialTable,
    table: RadialTable,
    wider: RadialTable,
    softer: RadialTable,
}

/// Sizes of a class differ by no more than this part, which [`SweptBall::larger_px`] bridges.
const SIZE_CLASS: f64 = 0.02;

/// The class of a magnification; that of 1 is exact.
fn size_class(magnification: f64) -> i32 {
    (magnification.ln() / SIZE_CLASS).round() as i32
}

/// What `make` makes of the magnification of every class of sizes that the frames have, by class.
fn by_class<T: Send>(bands: &[FrameBand<'_>], make: impl Fn(f64) -> T + Sync) -> BTreeMap<i32, T> {
    let classes: BTreeSet<i32> = bands
        .iter()
        .map(|(e, _)| size_class(e.input.magnification))
        .collect();
    let of_class = |class: i32| (class, make((SIZE_CLASS * f64::from(class)).exp()));
    classes.into_par_iter().map(of_class).collect()
}

impl ProfileTables {
    /// Slopes by radius and blur are the model's own, by differences.
    fn new(
        magnification: f64,
        shared: &SharedParameters,
        step_px: f64,
        settings: &AppearanceSettings,
    ) -> Self {
        let profiles =
            |radius_px: f64, blur_px: f64| settings.fit.profiles(magnification * radius_px, blur_px);
        let usual = || profiles(shared.radius_px, shared.blur_px);
        let wider = || profiles(shared.radius_px + step_px, shared.blur_px).of_ball(&shared.terms);
        let softer = || profiles(shared.radius_px, shared.blur_px + step_px).of_ball(&shared.terms);
        let (profiles, (wider, softer)) = rayon::join(usual, || rayon::join(wider, softer));
        Self {
            magnification,
            table: profiles.of_ball(&shared.terms),
            wider,
            softer,
            profiles,
        }
    }
}

/// The normal equations of one step.
struct NormalEquations {
    normal: DMatrix<f64>,
    right: DVector<f64>,
    residuals: Vec<f64>,
    /// The scale that the weights were made for.
    weighed_at: f64,
    /// The residuals' own.
    scale: f64,
    /// Each frame's pull, for the uncertainty: residuals of a frame are not independent.
    pulls: Vec<DVector<f64>>,
    /// The column of a radius that is held.
    by_radius: Option<DVector<f64>>,
}

/// One frame's share in them.
struct FrameEquations {
    /// Row by row.
    normal: Vec<f64>,
    pull: Vec<f64>,
    residuals: Vec<f64>,
}

/// How one frame sees the ball where the fit stands.
struct FrameModel {
    centre: PixelPoint,
    swept: SweptBall,
    strength: f64,
    tilt: [f64; 2],
}

impl FrameModel {
    fn new(frame: &FrameEstimate<'_>, iterate: &Iterate, tables_magnification: f64) -> Self {
        let shared = &iterate.shared;
        let mut disc = frame.disc_with(shared);
        disc.centre.u_px += iterate.shift[0];
        disc.centre.v_px += iterate.shift[1];
        let magnification = frame.input.magnification;
        Self {
            centre: disc.centre,
            swept: SweptBall {
                radius_px: shared.radius_px * tables_magnification,
                larger_px: frame.nuisance[SIZE] + shared.radius_px * (magnification - tables_magnification),
                swept_px: disc.swept_px,
                points: ball::path_points(disc.swept_px, shared.blur_px),
            },
            strength: frame.input.gain + frame.nuisance[0],
            tilt: [frame.nuisance[1], frame.nuisance[2]],
        }
    }

    /// What a pixel that holds the ball's light `l` has beyond that, grey levels.
    fn residual(&self, p: &BandPixel, l: &PixelModel) -> f64 {
        let tilt = self.tilt[0] * l.dipole[0] + self.tilt[1] * l.dipole[1];
        p.grey - (p.background * (1.0 - l.cover) + self.strength * l.ball + tilt)
    }
}

/// The residuals where the fit stands, grey levels.
fn residuals(bands: &[FrameBand<'_>], iterate: &Iterate, settings: &AppearanceSettings) -> Vec<f64> {
    let shared = &iterate.shared;
    let tables = by_class(bands, |times| {
        let profiles = settings.fit.profiles(times * shared.radius_px, shared.blur_px);
        (times, profiles.of_ball(&shared.terms))
    });
    let of_band = |(frame, pixels): &FrameBand<'_>| -> Vec<f64> {
        let Some((times, table)) = tables.get(&size_class(frame.input.magnification)) else {
            return Vec::new();
        };
        let view = FrameModel::new(frame, iterate, *times);
        let light = |p| ball::pixel_model(table, &view.swept, ball::offset(view.centre, p));
        pixels.iter().map(|p| view.residual(p, &light(p))).collect()
    };
    let each: Vec<Vec<f64>> = bands.par_iter().map(of_band).collect();
    each.concat()
}

impl FrameEquations {
    fn build(
        frame: &FrameEstimate<'_>,
        pixels: &[BandPixel],
        iterate: &Iterate,
        tables: &ProfileTables,
        step_px: f64,
        scale: f64,
    ) -> Self {
        let shared = &iterate.shared;
        let view = FrameModel::new(frame, iterate, tables.magnification);
        let FrameModel { swept, strength, .. } = view;
        let n = TERMS + shared.terms.len();
        let mut part = Self {
            normal: vec![0.0; n * n],
            pull: vec![0.0; n],
            residuals: Vec::with_capacity(pixels.len()),
        };
        let cut = TUKEY * scale;
        let mut row = vec![0.0; n];
        for p in pixels {
            let at = ball::offset(view.centre, p);
            let l = ball::pixel_model(&tables.table, &swept, at);
            let residual = view.residual(p, &l);
            part.residuals.push(residual);
            let x = residual / cut;
            if x.abs() >= 1.0 {
                continue;
            }
            let weight = (1.0 - x * x).powi(2);
            row[0] = p.background * l.cover_slope[0] - strength * l.ball_slope[0];
            row[1] = p.background * l.cover_slope[1] - strength * l.ball_slope[1];
            let others = ball::shares(
                [&tables.wider, &tables.softer],
                &tables.profiles,
                &swept,
                at,
                &mut row[TERMS..],
            );
            let [wider, softer] = others.map(|[cover, ball]| {
                (strength * (ball - l.ball) - p.background * (cover - l.cover)) / step_px
            });
            (row[RADIUS], row[BLUR]) = (wider, softer);
            row[EXPOSURE] = if shared.exposure_s > 0.0 {
                (strength * l.lengthening[1] - p.background * l.lengthening[0]) / shared.exposure_s
            } else {
                0.0
            };
            for share in &mut row[TERMS..] {
                *share *= strength;
            }
            part.add(&row, weight, residual);
        }
        part
    }

    fn add(&mut self, row: &[f64], weight: f64, residual: f64) {
        let lines = self.normal.chunks_exact_mut(row.len());
        for ((&x, pull), line) in row.iter().zip(&mut self.pull).zip(lines) {
            let wx = weight * x;
            *pull += wx * residual;
            // Whole lines rather than half of them: the compiler takes several numbers at once.
            for (sum, &y) in line.iter_mut().zip(row) {
                *sum += wx * y;
            }
        }
    }
}

impl NormalEquations {
    /// The equations where the fit stands, weighed for residuals of this scale.
    fn build(bands: &[FrameBand<'_>], iterate: &Iterate, settings: &AppearanceSettings, scale: f64) -> Self {
        let n = TERMS + iterate.shared.terms.len();
        let step_px = 1e-3 * iterate.shared.radius_px.min(1.0);
        let tables = by_class(bands, |times| {
            ProfileTables::new(times, &iterate.shared, step_px, settings)
        });
        // In the frames' order, whichever core is first: sums are then the same in every run.
        let parts: Vec<FrameEquations> = bands
            .par_iter()
            .filter_map(|(frame, pixels)| {
                let tables = tables.get(&size_class(frame.input.magnification))?;
                Some(FrameEquations::build(
                    frame, pixels, iterate, tables, step_px, scale,
                ))
            })
            .collect();
        let mut normal = DMatrix::zeros(n, n);
        let mut right = DVector::zeros(n);
        let mut residuals = Vec::with_capacity(parts.iter().map(|p| p.residuals.len()).sum());
        let mut pulls = Vec::with_capacity(parts.len());
        for part in parts {
            normal += DMatrix::from_row_slice(n, n, &part.normal);
            let pull = DVector::from_vec(part.pull);
            right += &pull;
            residuals.extend(part.residuals);
            pulls.push(pull);
        }
        let mut magnitudes: Vec<f32> = residuals.iter().map(|r: &f64| r.abs() as f32).collect();
        let own_scale = 1.4826 * f64::from(median_in_place(&mut magnitudes));
        Self {
            normal,
            right,
            residuals,
            weighed_at: scale,
            scale: own_scale.max(ROUNDING_STD_GREY),
            pulls,
            by_radius: None,
        }
    }

    fn hold_fixed_parameters(&mut self, shared: &SharedParameters) {
        if shared.exposure_s == 0.0 {
            self.hold(&[EXPOSURE]);
        }
        if shared.radius_held && self.by_radius.is_none() {
            self.by_radius = Some(self.normal.column(RADIUS).clone_owned());
            self.hold(&[RADIUS]);
        }
    }

    /// What the held radius' own doubt does to the shift, px, root mean square of the two coordinates: where the ball's far
    /// side does not stand out from the wall, the near one places the centre at the radius' distance.
    fn shift_std_by_radius(&self) -> f64 {
        let Some(column) = &self.by_radius else {
            return 0.0;
        };
        let mut column = column.clone();
        column[RADIUS] = 0.0;
        let response = self.inverse(LEAST_DAMPING).map(|inverse| inverse * column);
        response.map_or(UNKNOWN_SHIFT_STD_PX, |r| {
            OUTLINE_STD_PX * (0.5 * (r[0] * r[0] + r[1] * r[1])).sqrt()
        })
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

    /// Columns scaled to one, damped.
    fn inverse(&self, damping: f64) -> Option<DMatrix<f64>> {
        let n = self.normal.nrows();
        let scale: Vec<f64> = (0..n).map(|i| self.normal[(i, i)].max(1e-30).sqrt()).collect();
        let scaled = DMatrix::from_fn(n, n, |i, j| {
            self.normal[(i, j)] / (scale[i] * scale[j]) + if i == j { damping } else { 0.0 }
        });
        let inverse = scaled.cholesky()?.inverse();
        Some(DMatrix::from_fn(n, n, |i, j| {
            inverse[(i, j)] / (scale[i] * scale[j])
        }))
    }

    fn solve(&self, damping: f64) -> Option<DVector<f64>> {
        let change = self.inverse(damping)? * &self.right;
        change.iter().all(|x| x.is_finite()).then_some(change)
    }

    /// Covariance of the light's terms, the residuals taken for independent.
    fn light_covariance(&self) -> Option<DMatrix<f64>> {
        let inverse = self.inverse(LEAST_DAMPING)?;
        let n = inverse.nrows() - TERMS;
        Some(inverse.view((TERMS, TERMS), (n, n)) * self.scale.powi(2))
    }

    /// Standard uncertainty of an unknown, the residuals of a frame taken as one.
    fn std(&self, unknown: usize) -> Option<f64> {
        let inverse = self.inverse(LEAST_DAMPING)?;
        let row = inverse.row(unknown);
        let n = self.pulls.len() as f64;
        let variance: f64 =
            self.pulls.iter().map(|p| (row * p)[(0, 0)].powi(2)).sum::<f64>() * n / (n - 1.0).max(1.0);
        (variance.is_finite() && variance > 0.0).then(|| variance.sqrt())
    }
}
