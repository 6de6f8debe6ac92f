//! One fit of what all frames share: radius, blur, exposure, the terms of the light, and a shift of all centres. Grey levels are mixed, or light where
//! there is a tone curve ([`ToneCurve`]).
//!
//! Levenberg-Marquardt ([`least_squares`]) with Tukey's weights: in a small ball radius, blur and the light's fall towards the
//! rim can hardly be told apart, and undamped steps ran away. Jᵀ W J is summed frame by frame, in the frames' order, so that
//! every run gives the same sums.

use super::parameters::{AppearanceSettings, FrameEstimate, LEAST_FRAMES, OUTLINE_STD_PX, SharedParameters};
use super::tone_curve::ToneCurve;
use crate::detect::centre::ball::{
    self, BandLimits, BandPixel, LinearisedTable, PixelModel, SweptBall, norm,
};
use crate::detect::centre::edge_likelihood::SIZE;
use crate::detect::noise::ROUNDING_STD_GREY;
use crate::geometry::PixelPoint;
use crate::numeric::least_squares::{
    Acceptance, Damping, Easing, Outlook, Problem, Termination, Trial, minimise,
};
use crate::numeric::robust::{STD_OF_MEDIAN, TUKEY, lower_median, tukey_cost, tukey_weight};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// What was fitted.
pub struct JointFit {
    pub shared: SharedParameters,
    /// Shift that all centres share, px.
    pub shift: [f64; 2],
    /// Its standard uncertainty, root mean square of the two coordinates, px.
    pub shift_std_px: f64,
    pub radius_std_px: Option<f64>,
    /// Robust standard deviation of the residuals, grey levels.
    pub residual_std_grey: f64,
    /// Of all pixels, grey levels.
    residuals: Vec<f64>,
    /// Covariance of the shift, then the light's terms, the residuals taken for independent; `None` where the equations do not tell.
    light_covariance: Option<DMatrix<f64>>,
}

/// Place of the light's terms in that covariance, behind the shift's two coordinates.
const LIGHT: usize = 2;

/// Places in the vector of unknowns; the shift is at 0 and 1.
const RADIUS: usize = 2;
const BLUR: usize = 3;
const EXPOSURE: usize = 4;
const TERMS: usize = 5;

/// Steps at most, those that led nowhere among them.
const STEPS: usize = 24;

/// The pixels are chosen anew after so many steps, which lead near the minimum.
const STEPS_BEFORE_NEW_PIXELS: usize = 3;

/// Converged when radius, blur and shift move by less, px; or where a step promises to lower χ² by less: it moves no parameter by more
/// than a hundredth of its standard uncertainty.
const CONVERGED_PX: f64 = 5e-4;
const CONVERGED_CHI2: f64 = 1e-4;

/// Damping of the normal equations, whose columns are scaled to one. It never vanishes: terms that a small ball cannot tell
/// apart must not run away.
const DAMPING: Damping = Damping {
    first: 1e-4,
    least: 1e-7,
    most: 1e3,
    easing: Easing::Factor(0.1),
    growth: 10.0,
    least_after_failure: 1e-4,
    acceptance: Acceptance::NotHigher(0.0),
    ..Damping::NONE
};

/// Standard uncertainty of a shift whose own the equations do not tell, px.
pub const UNKNOWN_SHIFT_STD_PX: f64 = 0.1;

/// A frame and its pixels around the outline.
pub type FrameBand<'a> = (&'a FrameEstimate<'a>, Vec<BandPixel>);

/// The parameters where a search stands.
#[derive(Debug, Clone)]
struct JointParameters {
    shared: SharedParameters,
    shift: [f64; 2],
}

impl JointParameters {
    fn new(shared: &SharedParameters) -> Self {
        Self {
            shared: shared.clone(),
            shift: [0.0; 2],
        }
    }

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
        s.exposure_s = s.exposure_s.min(s.longest_exposure_s);
        for (t, c) in s.terms.iter_mut().zip(change.iter().skip(TERMS)) {
            *t += c;
        }
        let plausible = s.radius_px > 0.4 * begin_radius_px
            && s.radius_px < 2.0 * begin_radius_px
            && norm(to.shift[0], to.shift[1]) < 0.7 * begin_radius_px;
        plausible.then_some(to)
    }

    /// The unknowns that are at an end of their range and would leave it downhill: they stay there, and the others find their minimum with them.
    fn at_their_ends(&self, downhill: &DVector<f64>) -> Vec<usize> {
        let SharedParameters {
            blur_px,
            exposure_s,
            longest_exposure_s,
            ..
        } = self.shared;
        let (least, most) = ball::BLUR_RANGE_PX;
        let ends = [
            (BLUR, blur_px, least, most),
            (EXPOSURE, exposure_s, 0.0, longest_exposure_s),
        ];
        let leaves = |&(unknown, value, least, most): &(usize, f64, f64, f64)| {
            (value >= most && downhill[unknown] > 0.0) || (value <= least && downhill[unknown] < 0.0)
        };
        ends.iter().filter(|end| leaves(end)).map(|end| end.0).collect()
    }
}

impl JointFit {
    /// Fits what the frames share, and a common shift, from `start` on.
    pub fn of_frames(
        frames: &[FrameEstimate<'_>],
        start: &SharedParameters,
        settings: &AppearanceSettings,
    ) -> Option<Self> {
        let rough = gather_bands(frames, start, settings);
        let start = JointParameters::new(start);
        let (near, _) = descend(&rough, start, settings, STEPS_BEFORE_NEW_PIXELS)?;
        // Pixels are chosen around the frames' own centres; the common shift is small beside the band.
        let bands = gather_bands(frames, &near.shared, settings);
        let (parameters, equations) = descend(&bands, near, settings, STEPS)?;
        Some(Self::at(parameters, equations))
    }

    /// The same on these pixels.
    pub fn of_pixels(
        bands: &[FrameBand<'_>],
        start: &SharedParameters,
        settings: &AppearanceSettings,
    ) -> Option<Self> {
        let (parameters, equations) = descend(bands, JointParameters::new(start), settings, STEPS)?;
        Some(Self::at(parameters, equations))
    }

    fn at(JointParameters { shared, shift }: JointParameters, equations: JointEquations) -> Self {
        Self {
            light_covariance: equations.light_covariance(),
            shift,
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
            residual_std_grey: equations.residual_std_grey,
            residuals: equations.residuals,
            shared,
        }
    }

    /// What it costs to do with the first `count` of the light's terms alone, in noise variances, to first order: the others
    /// over their uncertainty, squared (Wald's test). 0 where there are no others, or their uncertainty is unknown.
    #[must_use]
    pub fn cost_without(&self, count: usize) -> f64 {
        let others = self.shared.terms.get(count..).unwrap_or_default();
        let others = DVector::from_row_slice(others);
        self.weighed_by_light(count)
            .map_or(0.0, |(weighed, _)| others.dot(&weighed))
    }

    /// How much further the shift is than with the first `count` of the light's terms alone, to first order, root mean square of the two
    /// coordinates, px; `None` where the equations do not tell.
    #[must_use]
    pub fn shift_by_terms_from(&self, count: usize) -> Option<f64> {
        let (weighed, covariance) = self.weighed_by_light(count)?;
        let [u, v] = [0, 1].map(|i| -> f64 {
            (0..weighed.len())
                .map(|k| covariance[(i, LIGHT + count + k)] * weighed[k])
                .sum()
        });
        Some((0.5 * (u * u + v * v)).sqrt())
    }

    /// The terms of the light from `count` on by the inverse of their covariance, and the whole covariance; `None` where there are none, or it is unknown.
    fn weighed_by_light(&self, count: usize) -> Option<(DVector<f64>, &DMatrix<f64>)> {
        let others = self
            .shared
            .terms
            .get(count..)
            .filter(|others| !others.is_empty())?;
        let covariance = self.light_covariance.as_ref()?;
        let from = LIGHT + count;
        let block = covariance.view((from, from), (others.len(), others.len()));
        let weighed = block
            .into_owned()
            .cholesky()?
            .solve(&DVector::from_row_slice(others));
        Some((weighed, covariance))
    }

    /// The biweight's cost where residuals have this standard deviation: their squares in variances, levelling off for outliers.
    #[must_use]
    pub fn cost(&self, std_grey: f64) -> f64 {
        cost(&self.residuals, std_grey)
    }
}

fn cost(residuals: &[f64], std_grey: f64) -> f64 {
    let cut = TUKEY * std_grey;
    residuals.iter().map(|&r| tukey_cost(r, cut)).sum()
}

/// The search for the minimum on these pixels.
struct JointProblem<'a> {
    bands: &'a [FrameBand<'a>],
    settings: &'a AppearanceSettings,
    begin_radius_px: f64,
}

impl Problem for JointProblem<'_> {
    type State = (JointParameters, JointEquations);
    type Step = DVector<f64>;

    fn step(&mut self, (here, equations): &Self::State, damping: f64) -> Option<DVector<f64>> {
        let held = here.at_their_ends(&equations.sums.right);
        if held.is_empty() {
            return equations.sums.solve(damping);
        }
        let mut sums = equations.sums.clone();
        sums.hold(&held);
        sums.solve(damping)
    }

    fn moved(&mut self, (here, equations): &Self::State, step: &DVector<f64>) -> Option<Self::State> {
        let to = here.moved(step, self.begin_radius_px)?;
        let equations = JointEquations::build(self.bands, &to, self.settings, equations.residual_std_grey);
        Some((to, equations))
    }

    fn cost(&self, (_, of): &Self::State, (_, here): &Self::State) -> f64 {
        cost(&of.residuals, here.weighed_at)
    }

    fn outlook(&self, (_, here): &Self::State, step: &DVector<f64>, _damping: f64) -> Outlook {
        let promised = step.dot(&here.sums.right) / here.weighed_at.powi(2);
        if promised < CONVERGED_CHI2 {
            Outlook::Settled
        } else {
            Outlook::Open
        }
    }

    fn is_settled(&self, (here, _): &Self::State, trial: &Trial<'_, DVector<f64>>) -> bool {
        // A blur at the end of its range goes no further, whatever the step.
        let blur_px = here.shared.blur_px;
        let (least, most) = ball::BLUR_RANGE_PX;
        let blur_step_px = (blur_px + trial.step[BLUR]).clamp(least, most) - blur_px;
        let [u, v, radius] = [0, 1, RADIUS].map(|i| trial.step[i]);
        let px = [u, v, radius, blur_step_px].map(f64::abs);
        px.into_iter().fold(0.0, f64::max) < CONVERGED_PX
    }
}

/// Up to `steps` steps downhill from `start`; the parameters there and their equations. `None` where that leads away from any
/// ball.
fn descend(
    bands: &[FrameBand<'_>],
    mut start: JointParameters,
    settings: &AppearanceSettings,
    steps: usize,
) -> Option<(JointParameters, JointEquations)> {
    if bands.len() < LEAST_FRAMES {
        return None;
    }
    let begin_radius_px = start.shared.radius_px;
    if start.shared.terms.iter().all(|&t| t == 0.0) {
        // Without a brightness the edge has no sign: the first step finds the light alone.
        let mut light = JointEquations::build(bands, &start, settings, f64::INFINITY);
        light.sums.hold(&[0, 1, RADIUS, BLUR, EXPOSURE]);
        start = start.moved(&light.sums.solve(DAMPING.least)?, begin_radius_px)?;
    }
    // Weights of the first step by the root mean square: what the median would call outliers is what leads there.
    let residuals = residuals(bands, &start, settings);
    let sum: f64 = residuals.iter().map(|r| r * r).sum();
    let rms_grey = (sum / residuals.len().max(1) as f64).sqrt();
    let equations = JointEquations::build(bands, &start, settings, rms_grey.max(ROUNDING_STD_GREY));
    let mut problem = JointProblem {
        bands,
        settings,
        begin_radius_px,
    };
    let (found, end) = minimise(&mut problem, (start, equations), &DAMPING, steps);
    (end != Termination::Singular).then_some(found)
}

/// The pixels around the outline, of every frame that could be fitted.
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
        .filter(|f| f.fitted)
        .map(|f| {
            let disc = f.disc_with(shared);
            let radius_px = shared.radius_px * f.input.magnification;
            let limits = BandLimits {
                most_pixels: settings.most_pixels,
                ..settings.fit.band_limits(radius_px, shared.blur_px, 1)
            };
            let pixels = ball::band(&f.input.patch, &disc, shared.blur_px, limits, 1);
            (f, pixels)
        })
        .filter(|(_, pixels)| pixels.len() > 20)
        .collect()
}

/// The ball's model at one magnification, with its slopes by what all frames share.
struct ProfileTables {
    magnification: f64,
    table: LinearisedTable,
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
    fn new(magnification: f64, shared: &SharedParameters, settings: &AppearanceSettings) -> Self {
        let radius_px = magnification * shared.radius_px;
        // Slopes by radius and blur are the model's own, by differences.
        let step_px = 1e-3 * shared.radius_px.min(1.0);
        let inside_px = settings.fit.profiles_inside_px(radius_px, shared.blur_px);
        Self {
            magnification,
            table: LinearisedTable::new(radius_px, shared.edge(), &shared.terms, inside_px, step_px),
        }
    }
}

/// Sums over all pixels: the normal equations.
#[derive(Clone)]
struct JointSums {
    /// Jᵀ W J.
    normal: DMatrix<f64>,
    /// Jᵀ W r.
    right: DVector<f64>,
}

/// Those of one step, with what else is known there.
struct JointEquations {
    sums: JointSums,
    residuals: Vec<f64>,
    /// The standard deviation of residuals that the weights are for.
    weighed_at: f64,
    /// That of these residuals.
    residual_std_grey: f64,
    /// Each frame's share of the right side, for the uncertainty: residuals of a frame are not independent, ...
    right_of_frames: Vec<DVector<f64>>,
    /// ... nor are those of a place on the ball, in all frames: there the ball looks otherwise than its model can.
    right_of_places: Vec<DVector<f64>>,
    /// The column of a radius that is held.
    radius_column: Option<DVector<f64>>,
}

/// One frame's share of them.
struct FrameEquations {
    /// Row by row.
    normal: Vec<f64>,
    right: Vec<f64>,
    /// The share of each place on the ball in the right side, one after the other.
    right_of_places: Vec<f64>,
    residuals: Vec<f64>,
}

/// A place on the ball is an octant of a ring around its middle: where the rings end, blurs beyond the rim.
const RING_ENDS_BLURS: [f64; 6] = [-4.0, -2.5, -1.2, 0.0, 1.2, 2.5];
const OCTANTS: usize = 8;
const PLACES: usize = (RING_ENDS_BLURS.len() + 1) * OCTANTS;

/// The place of a pixel so far from the middle of a ball of this radius: the ring, and the octant in it.
fn place_on_ball((x, y): (f64, f64), radius_px: f64, blur_px: f64) -> usize {
    let beyond = (norm(x, y) - radius_px) / blur_px;
    let ring = RING_ENDS_BLURS.iter().filter(|end| beyond > **end).count();
    let octant = usize::from(x < 0.0) + 2 * usize::from(y < 0.0) + 4 * usize::from(x.abs() < y.abs());
    ring * OCTANTS + octant
}

/// The model of one frame's pixels: of grey levels, or of light where there is a tone curve.
struct FrameModel {
    centre: PixelPoint,
    swept: SweptBall,
    strength: f64,
    tilt: [f64; 2],
    tone: Option<ToneCurve>,
}

/// What the model has of a pixel.
struct ModelledPixel {
    /// What the pixel has beyond it, grey levels.
    residual: f64,
    /// The wall behind the ball, grey level or light.
    wall: f64,
    /// How the grey level changes with what is mixed, grey level or light.
    slope: f64,
}

impl FrameModel {
    fn new(frame: &FrameEstimate<'_>, parameters: &JointParameters, tables_magnification: f64) -> Self {
        let shared = &parameters.shared;
        let mut disc = frame.disc_with(shared);
        disc.centre.u_px += parameters.shift[0];
        disc.centre.v_px += parameters.shift[1];
        let magnification = frame.input.magnification;
        let (strength, tilt) = (
            frame.input.gain + frame.nuisance[0],
            [frame.nuisance[1], frame.nuisance[2]],
        );
        let of_light = |tone: ToneCurve| (tone.strength(strength), tilt.map(|t| tone.tilt(t)));
        let (strength, tilt) = shared.tone.map_or((strength, tilt), of_light);
        Self {
            centre: disc.centre,
            swept: SweptBall {
                radius_px: shared.radius_px * tables_magnification,
                larger_px: frame.nuisance[SIZE] + shared.radius_px * (magnification - tables_magnification),
                swept_px: disc.swept_px,
                bent_px: disc.bent_px,
                points: ball::path_points(disc.swept_px, shared.blur_px),
            },
            strength,
            tilt,
            tone: shared.tone,
        }
    }

    /// Pixel `p`, of which the ball has this.
    fn pixel(&self, p: &BandPixel, l: &PixelModel) -> ModelledPixel {
        let tilt = self.tilt[0] * l.dipole[0] + self.tilt[1] * l.dipole[1];
        let mixed = |wall: f64| wall * (1.0 - l.cover) + self.strength * l.ball + tilt;
        let Some(tone) = self.tone else {
            return ModelledPixel {
                residual: p.grey - mixed(p.background),
                wall: p.background,
                slope: 1.0,
            };
        };
        let wall = tone.light(p.background);
        let (grey, slope) = tone.grey(mixed(wall));
        ModelledPixel {
            residual: p.grey - grey,
            wall,
            slope,
        }
    }
}

/// The residuals alone, grey levels.
fn residuals(
    bands: &[FrameBand<'_>],
    parameters: &JointParameters,
    settings: &AppearanceSettings,
) -> Vec<f64> {
    let shared = &parameters.shared;
    let tables = by_class(bands, |times| {
        let profiles = settings.fit.profiles_of(times * shared.radius_px, shared.edge());
        (times, profiles.of_ball(&shared.terms))
    });
    let of_band = |(frame, pixels): &FrameBand<'_>| -> Vec<f64> {
        let Some((times, table)) = tables.get(&size_class(frame.input.magnification)) else {
            return Vec::new();
        };
        let model = FrameModel::new(frame, parameters, *times);
        let of_ball = |p| ball::pixel_model(table, &model.swept, ball::offset(model.centre, p));
        pixels
            .iter()
            .map(|p| model.pixel(p, &of_ball(p)).residual)
            .collect()
    };
    let each: Vec<Vec<f64>> = bands.par_iter().map(of_band).collect();
    each.concat()
}

impl FrameEquations {
    fn build(
        frame: &FrameEstimate<'_>,
        pixels: &[BandPixel],
        parameters: &JointParameters,
        tables: &ProfileTables,
        std_grey: f64,
    ) -> Self {
        let shared = &parameters.shared;
        let model = FrameModel::new(frame, parameters, tables.magnification);
        let FrameModel { swept, strength, .. } = model;
        let n = TERMS + shared.terms.len();
        let mut sums = Self {
            normal: vec![0.0; n * n],
            right: vec![0.0; n],
            right_of_places: vec![0.0; PLACES * n],
            residuals: Vec::with_capacity(pixels.len()),
        };
        let cut = TUKEY * std_grey;
        let mut row = vec![0.0; n];
        for p in pixels {
            let at = ball::offset(model.centre, p);
            let linearised = ball::linearised_model(&tables.table, &swept, at);
            let l = &linearised.model;
            let ModelledPixel {
                residual,
                wall,
                slope,
            } = model.pixel(p, l);
            sums.residuals.push(residual);
            let weight = tukey_weight(residual, cut);
            if weight == 0.0 {
                continue;
            }
            let by = |[cover, ball]: [f64; 2]| slope * (strength * ball - wall * cover);
            // The pixel's place in the ball moves against the centre.
            row[0] = -by([l.cover_slope[0], l.ball_slope[0]]);
            row[1] = -by([l.cover_slope[1], l.ball_slope[1]]);
            // The whole ball is larger by the magnification, for a pixel of the usual one.
            row[RADIUS] = tables.magnification * by(linearised.by_radius);
            row[BLUR] = by(linearised.by_blur);
            row[EXPOSURE] = if shared.exposure_s > 0.0 {
                by(l.lengthening) / shared.exposure_s
            } else {
                0.0
            };
            for (column, by_term) in row[TERMS..].iter_mut().zip(linearised.by_term) {
                *column = by([0.0, by_term]);
            }
            sums.add(&row, weight, residual);
            let place = place_on_ball(at, swept.radius_px, shared.blur_px);
            for (sum, x) in sums.right_of_places[place * n..].iter_mut().zip(&row) {
                *sum += weight * x * residual;
            }
        }
        sums
    }

    fn add(&mut self, row: &[f64], weight: f64, residual: f64) {
        let lines = self.normal.chunks_exact_mut(row.len());
        for ((&x, right), line) in row.iter().zip(&mut self.right).zip(lines) {
            let wx = weight * x;
            *right += wx * residual;
            // Whole lines rather than half of them: the compiler takes several numbers at once.
            for (sum, &y) in line.iter_mut().zip(row) {
                *sum += wx * y;
            }
        }
    }
}

impl JointSums {
    /// Keeps these unknowns as they are.
    fn hold(&mut self, unknowns: &[usize]) {
        for &i in unknowns {
            self.normal.row_mut(i).fill(0.0);
            self.normal.column_mut(i).fill(0.0);
            self.normal[(i, i)] = 1.0;
            self.right[i] = 0.0;
        }
    }

    /// Of the normal equations with columns scaled to one, damped.
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
}

impl JointEquations {
    /// The equations at `parameters`, weighed for residuals of this standard deviation; what is not fitted is held.
    fn build(
        bands: &[FrameBand<'_>],
        parameters: &JointParameters,
        settings: &AppearanceSettings,
        std_grey: f64,
    ) -> Self {
        let n = TERMS + parameters.shared.terms.len();
        let tables = by_class(bands, |times| {
            ProfileTables::new(times, &parameters.shared, settings)
        });
        let frames: Vec<FrameEquations> = bands
            .par_iter()
            .filter_map(|(frame, pixels)| {
                let tables = tables.get(&size_class(frame.input.magnification))?;
                Some(FrameEquations::build(frame, pixels, parameters, tables, std_grey))
            })
            .collect();
        let mut normal = DMatrix::zeros(n, n);
        let mut right = DVector::zeros(n);
        let mut residuals = Vec::with_capacity(frames.iter().map(|f| f.residuals.len()).sum());
        let mut right_of_frames = Vec::with_capacity(frames.len());
        let mut right_of_places = vec![0.0; PLACES * n];
        for frame in frames {
            for (sum, share) in right_of_places.iter_mut().zip(&frame.right_of_places) {
                *sum += share;
            }
            normal += DMatrix::from_row_slice(n, n, &frame.normal);
            let share = DVector::from_vec(frame.right);
            right += &share;
            residuals.extend(frame.residuals);
            right_of_frames.push(share);
        }
        let mut magnitudes: Vec<f32> = residuals.iter().map(|r: &f64| r.abs() as f32).collect();
        let residual_std_grey = STD_OF_MEDIAN * f64::from(lower_median(&mut magnitudes));
        let mut equations = Self {
            sums: JointSums { normal, right },
            residuals,
            weighed_at: std_grey,
            residual_std_grey: residual_std_grey.max(ROUNDING_STD_GREY),
            right_of_frames,
            right_of_places: right_of_places
                .chunks_exact(n)
                .filter(|share| share.iter().any(|s| *s != 0.0))
                .map(DVector::from_row_slice)
                .collect(),
            radius_column: None,
        };
        if parameters.shared.exposure_s == 0.0 {
            equations.sums.hold(&[EXPOSURE]);
        }
        if parameters.shared.radius_held {
            equations.radius_column = Some(equations.sums.normal.column(RADIUS).clone_owned());
            equations.sums.hold(&[RADIUS]);
        }
        equations
    }

    /// What the standard uncertainty of a held radius adds to that of the shift, px, root mean square of the two coordinates:
    /// where the ball's far side does not stand out from the wall, the near side places the centre one radius away.
    fn shift_std_by_radius(&self) -> f64 {
        let Some(column) = &self.radius_column else {
            return 0.0;
        };
        let mut column = column.clone();
        column[RADIUS] = 0.0;
        let response = self.sums.inverse(DAMPING.least).map(|inverse| inverse * column);
        response.map_or(UNKNOWN_SHIFT_STD_PX, |r| {
            OUTLINE_STD_PX * (0.5 * (r[0] * r[0] + r[1] * r[1])).sqrt()
        })
    }

    /// Covariance of the shift and the light's terms, the residuals taken for independent.
    fn light_covariance(&self) -> Option<DMatrix<f64>> {
        let inverse = self.sums.inverse(DAMPING.least)?;
        let unknowns: Vec<usize> = (0..LIGHT).chain(TERMS..inverse.nrows()).collect();
        let variance = self.residual_std_grey.powi(2);
        Some(DMatrix::from_fn(unknowns.len(), unknowns.len(), |i, j| {
            variance * inverse[(unknowns[i], unknowns[j])]
        }))
    }

    /// Standard uncertainty of an unknown, allowing for residuals that are correlated in a frame, or at a place on the ball in all frames (each
    /// cluster's share of the equations squared, White 1980 and Liang and Zeger 1986): the larger of the two.
    fn std(&self, unknown: usize) -> Option<f64> {
        let inverse = self.sums.inverse(DAMPING.least)?;
        let row = inverse.row(unknown);
        let squares = |shares: &[DVector<f64>]| -> f64 {
            shares.iter().map(|share| (row * share)[(0, 0)].powi(2)).sum()
        };
        let n = self.right_of_frames.len() as f64;
        let by_frames = squares(&self.right_of_frames) * n / (n - 1.0).max(1.0);
        // There are so few places that the unknowns take much of their freedom.
        let places = self.right_of_places.len() as f64;
        let by_places = squares(&self.right_of_places) * places / (places - row.len() as f64).max(1.0);
        let variance = by_frames.max(by_places);
        (variance.is_finite() && variance > 0.0).then(|| variance.sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::centre::appearance::{AppearanceFrame, USUAL_BLUR_PX};
    use crate::detect::centre::{Disc, Patch, standard};
    use crate::detect::crop::Crop;
    use crate::frames::Luma;

    const RADIUS_PX: f64 = 30.0;

    /// A ball brighter on one side, out of focus by `blur_px`, on a grey ground.
    fn picture(centre: PixelPoint, blur_px: f64) -> Crop {
        let (width, height) = (140, 140);
        let pixel = |i: usize| {
            let (x, y) = ((i % width) as f64 - centre.u_px, (i / width) as f64 - centre.v_px);
            let cover = 0.5 * libm::erfc((norm(x, y) - RADIUS_PX) / (blur_px * std::f64::consts::SQRT_2));
            (60.0 + cover * (120.0 + 40.0 * x / RADIUS_PX)).round() as u8
        };
        Crop {
            u: 0,
            v: 0,
            luma: Luma {
                width,
                height,
                data: (0..width * height).map(pixel).collect(),
            },
        }
    }

    #[test]
    fn equations_are_the_slopes_of_the_squares_of_residuals_with_a_tone_curve_and_without() {
        let crop = picture(PixelPoint::new(70.0, 69.0), 1.1);
        let seen: Vec<AppearanceFrame<'_>> = (0..3)
            .map(|i| AppearanceFrame {
                patch: Patch {
                    crop: &crop,
                    background: vec![60.0; crop.luma.data.len()],
                    noise_grey: 0.5,
                    affine: None,
                },
                disc: Disc {
                    centre: PixelPoint::new(70.3, 68.8),
                    radius_px: RADIUS_PX,
                    swept_px: [0.0; 2],
                    bent_px: [0.0; 2],
                },
                velocity_px_s: [900.0, -400.0],
                acceleration_px_s2: [0.0; 2],
                gain: 1.0 + 0.02 * f64::from(i),
                magnification: 1.0,
            })
            .collect();
        let frames: Vec<FrameEstimate> = seen.iter().map(FrameEstimate::new).collect();
        let grey = vec![150.0, 20.0, 30.0, -10.0];
        let limited = crate::frames::LumaRange {
            black: 16,
            white: 235,
        };
        let tone = ToneCurve::new(2.2, limited, &grey);
        let settings = &standard::METHOD.appearance;
        for (tone, terms, sharpening) in [
            (None, grey.clone(), 0.0),
            (None, grey.clone(), 0.6),
            (Some(tone), tone.terms(&grey), 0.6),
        ] {
            let here = JointParameters::new(&SharedParameters {
                radius_px: RADIUS_PX,
                radius_held: false,
                blur_px: 1.2,
                sharpening,
                exposure_s: 0.004,
                longest_exposure_s: 0.01,
                terms,
                tone,
            });
            let bands = gather_bands(&frames, &here.shared, settings);
            let squares =
                |at: &JointParameters| -> f64 { residuals(&bands, at, settings).iter().map(|r| r * r).sum() };
            let right = JointEquations::build(&bands, &here, settings, f64::INFINITY)
                .sums
                .right;
            for unknown in 0..right.len() {
                let step = match unknown {
                    EXPOSURE => 1e-6,
                    // The profiles are made anew, on a grid that goes with the blur: less would show how they are interpolated.
                    BLUR => 1e-2,
                    _ => 1e-3,
                };
                let moved = |by: f64| {
                    let mut change = DVector::zeros(right.len());
                    change[unknown] = by;
                    squares(&here.moved(&change, RADIUS_PX).unwrap())
                };
                let slope = (moved(step) - moved(-step)) / (2.0 * step);
                let off = (slope + 2.0 * right[unknown]).abs() / slope.abs();
                assert!(off < 0.01, "{tone:?} {unknown}: {slope} {}", right[unknown]);
            }
        }
    }

    #[test]
    fn a_blur_beyond_its_range_stays_at_its_end_and_the_others_find_their_minimum() {
        let most_px = ball::BLUR_RANGE_PX.1;
        let centres: Vec<PixelPoint> = (0..5)
            .map(|i| PixelPoint::new(70.0 + 0.23 * f64::from(i), 69.0 + 0.31 * f64::from(i)))
            .collect();
        let crops: Vec<Crop> = centres.iter().map(|&c| picture(c, 1.5 * most_px)).collect();
        let seen: Vec<AppearanceFrame<'_>> = crops
            .iter()
            .zip(&centres)
            .map(|(crop, c)| AppearanceFrame {
                patch: Patch {
                    crop,
                    background: vec![60.0; crop.luma.data.len()],
                    noise_grey: 0.5,
                    affine: None,
                },
                disc: Disc {
                    centre: PixelPoint::new(c.u_px + 0.4, c.v_px - 0.3),
                    radius_px: RADIUS_PX,
                    swept_px: [0.0; 2],
                    bent_px: [0.0; 2],
                },
                velocity_px_s: [0.0; 2],
                acceleration_px_s2: [0.0; 2],
                gain: 1.0,
                magnification: 1.0,
            })
            .collect();
        let frames: Vec<FrameEstimate> = seen.iter().map(FrameEstimate::new).collect();
        let start = SharedParameters {
            radius_px: RADIUS_PX,
            radius_held: true,
            blur_px: USUAL_BLUR_PX,
            sharpening: 0.0,
            exposure_s: 0.0,
            longest_exposure_s: 0.01,
            terms: vec![0.0; 4],
            tone: None,
        };
        let settings = &standard::METHOD.appearance;
        let bands = gather_bands(&frames, &start, settings);
        let (found, equations) = descend(&bands, JointParameters::new(&start), settings, STEPS).unwrap();
        assert_eq!(found.shared.blur_px, most_px);
        // What χ² could still fall by along each of the other unknowns.
        let JointSums { normal, right } = &equations.sums;
        for i in (0..right.len()).filter(|&i| i != BLUR) {
            let left = right[i].powi(2) / (normal[(i, i)] * equations.residual_std_grey.powi(2));
            assert!(left < 0.05, "unknown {i}: {left}");
        }
    }
}
