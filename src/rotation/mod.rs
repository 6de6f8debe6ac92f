//! How a ball turns in flight, seen from the marks on it.
//!
//! ```text
//! pixels well inside of the outline (view) -> what a still picture leaves over (fit::still)
//!     -> rates up to the alias limit that bring the marks into each other (search) -> each fitted by likelihood to some of the pixels,
//!     then brought on by all of them (fit)
//! ```
//!
//! Assumed: a ball that turns steadily about an axis that stays (free flight), whose light is the same wherever it flies in the frames
//! given, but for a brightness that changes smoothly, and marks that stay. A ball without marks leaves nothing but noise beside its light,
//! and what is left of one whose light drifts is explained by that: neither has a rotation here. Nor has one that turns by less than
//! [`LEAST_TURNS`], unless its light is [known](RotationSearch::light) from another flight: else its marks are not told from its light.
//!
//! Rates beyond half a turn a frame are seen as slower ones the other way round; those a little beyond are given as rivals
//! (`BEYOND_ALIAS`). A pattern that looks alike after a part of a turn has several rates, all of which are given.
//!
//! Rates beyond what a ball of its speed can have ([`RateLimit`]) are fitted only where no other suits the pictures better, and else no more than listed.
//!
//! A picture's blur is even in its own plane and uneven on the ball, which to second order the fit knows. How far that moves a rate says how
//! far what is beyond second order may: most where a few marks turn about an axis near them, or one far from the line of sight.

pub mod cube_map;
pub mod disc_map;
pub mod fit;
pub mod map_fit;
pub mod map_value;
pub mod search;
#[cfg(test)]
mod tests;
pub mod view;

pub use fit::RotationFit;
pub use map_fit::BallMaps;
pub use view::{BallPixel, BallSamples, BallView};

use crate::numeric::robust::median;
use fit::{FitGrids, RoughFit};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use search::LagProducts;
use std::f64::consts::{PI, TAU};
use std::sync::OnceLock;

/// Frames with fewer pictures of the ball show no rate: any two can be turned into each other.
const LEAST_FRAMES: usize = 4;

/// A ball on which this many times the noise is left over by a still picture carries marks, perhaps.
const LEAST_MARKS: f64 = 1.5;

/// Part of what a still picture leaves over, beside noise, that a rotation must explain. A codec's own noise, which nobody knows, is in that.
const LEAST_EXPLAINED: f64 = 0.25;

/// Marks that change a ball's brightness by this part of it, root mean square over its picture, are drawn: a codec's traces, which go along with the ball
/// from frame to frame, are less.
const DRAWN: f64 = 0.1;

/// Rates that are fitted, at most.
const MOST_FITTED: usize = 12;

/// Rates that are fitted side by side, before those near to what they led to are left out.
const FITTED_AT_ONCE: usize = 2;

/// Frames by which rates are searched for and rivals told apart, at most: those in the middle. The rest then makes the rate exact.
pub const SEARCH_FRAMES: usize = 32;

/// Pixels of a flight by which a rate is fitted, at most; all of them then bring it on by a step.
const MOST_PIXELS: usize = 40_000;

/// Pixels by which rates are searched for and told apart, about, at most: the rest then makes them exact.
const SEARCH_PIXELS: usize = 8000;

/// A rate that explains less than this part of what the best explains by those will not be its rival by all ([`RIVAL_EXPLAINED`]).
const PERHAPS_RIVAL: f64 = 0.6;

/// Candidates of less than this part of the best score are no rivals.
const LEAST_SCORE: f64 = 0.6;

/// Candidates that leave more than this many times Σ of squares of the best are no rivals; those that turn the ends of the arc within so
/// little of each other are one, rad.
const ROUGH_RIVAL: f64 = 1.7;
const ONE_START_RAD: f64 = 0.05;

/// Rates whose likelihoods are within this of the best are rivals (twice the logarithm).
const RIVAL: f64 = 9.0;

/// A rate that explains this part of what the best explains is a rival: what the best leaves over is not noise but what the model lacks (a codec,
/// centres, light), and that may be as much in favour of the one as of the other.
const RIVAL_EXPLAINED: f64 = 0.75;

/// Part of Σ of squares by which the same maps differ that lie otherwise on their grids.
const GRID_PART: f64 = 0.05;

/// Rates up to this many times half a turn a frame are thought possible.
const BEYOND_ALIAS: f64 = 1.25;

/// Standard uncertainty of the axis' direction over (blur / radius)².
const AXIS_STD: f64 = 0.5;

/// The part that is not known of what a blur does to the rate that is even in the picture and uneven on the ball.
const UNEVEN_PART: f64 = 0.7;

/// Turns in a flight below which marks are not told from the light: it moves the rates of slower balls by many times their uncertainties.
pub const LEAST_TURNS: f64 = 1.25;

/// Rounds of light and rates.
const COMMON_ROUNDS: usize = 3;

/// Turns in all flights together that teach the light on the ball.
pub const TEACHING_TURNS: f64 = 2.0;

/// A known light leaves marks over that stand out as much as those of the flight it is known from, to this factor.
const AS_MARKED: f64 = 3.0;

/// How fast a ball may turn.
#[derive(Debug, Clone, Copy)]
pub struct RateLimit {
    /// The axis about which that is said: a unit vector, camera axes (right, down, away).
    pub axis: Vector3<f64>,
    /// The fastest rate about it, rad/s.
    pub most_rad_s: f64,
}

impl RateLimit {
    /// Whether a ball may turn so.
    #[must_use]
    pub fn allows(&self, rate_rad_s: &Vector3<f64>) -> bool {
        self.axis.dot(rate_rad_s).abs() <= self.most_rad_s
    }
}

/// Rates among which those that an arc shows are.
#[derive(Debug, Clone)]
pub struct RateCandidates {
    /// Those that the ball may have first, the most likely first; then faster ones that suit the pictures better. One at least.
    fits: Vec<RotationFit>,
    /// Faster ones that suit them about as well, roughly, rad/s, camera axes.
    too_fast_rad_s: Vec<Vector3<f64>>,
}

impl RateCandidates {
    /// The most likely of those that the ball may have, if it may have any.
    ///
    /// # Panics
    /// Never: there is one at least.
    #[must_use]
    pub fn first(&self) -> &RotationFit {
        &self.fits[0]
    }
}

/// The rates that suit the pictures of an arc about as well.
#[derive(Debug, Clone)]
pub struct SuitingRates {
    /// Those that the ball may have, the most likely first. One that alone suits is among them however fast it is.
    pub possible: Vec<RotationFit>,
    /// Those beyond the limit, roughly, rad/s, camera axes.
    pub too_fast_rad_s: Vec<Vector3<f64>>,
    /// Mean square that the most likely of them leaves, of the logarithm of brightness.
    pub left: f64,
}

impl SuitingRates {
    /// How many they are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.possible.len() + self.too_fast_rad_s.len()
    }
}

/// What is known of a ball's pictures, to find how it turns.
#[derive(Debug, Clone, Copy)]
pub struct RotationSearch<'a> {
    /// Standard deviation of a pixel's noise, grey levels.
    pub noise_grey: f64,
    /// Standard deviation of the pictures' blur, pixels' own area included, px.
    pub blur_px: f64,
    /// The ball's radius, px.
    pub radius_px: f64,
    /// Standard uncertainty of what all centres of a flight are off by, along each axis of the picture, px: it turns the ball's axis by that over the radius.
    pub centre_std_px: f64,
    /// Standard uncertainty of what the centres are off by that turns with the ball, px: marks draw them to and fro.
    pub turning_std_px: f64,
    /// Standard uncertainty of the radius, px: what moves across the line of sight seems as much faster as the ball seems smaller, while its turns are
    /// counted, so that the axis leans.
    pub radius_std_px: f64,
    /// What another flight of the same ball in the same light showed.
    pub light: Option<&'a BallMaps>,
    /// How fast it may turn.
    pub limit: RateLimit,
}

/// Why no rate was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoRate {
    /// There are too few pictures.
    FewFrames,
    /// Nothing on the ball stands out from noise and light.
    Plain,
    /// Something does, and no steady rotation explains it.
    Unexplained,
    /// The ball turns too little ([`LEAST_TURNS`]): its marks are not told from its light.
    TooFewTurns,
}

/// The pixels of the views of one flight, with the grids of their maps.
#[derive(Debug)]
pub struct SampledBall {
    /// All of them, where they are more than [`MOST_PIXELS`].
    all: Option<BallSamples>,
    /// No more than that.
    samples: BallSamples,
    grids: FitGrids,
    /// About [`SEARCH_PIXELS`] of them; made when they are asked for.
    thin: OnceLock<(BallSamples, FitGrids)>,
}

impl SampledBall {
    /// As many of the pixels as a search needs.
    fn thinned(&self) -> &(BallSamples, FitGrids) {
        let thinned = || {
            let step = self.samples.values.len().div_ceil(SEARCH_PIXELS).max(1);
            let thin = self.samples.thinned(step);
            let grids = self.grids.coarser(&thin, step);
            (thin, grids)
        };
        self.thin.get_or_init(thinned)
    }

    fn duration_s(&self) -> f64 {
        let times_s = &self.samples.times_s;
        times_s
            .last()
            .zip(times_s.first())
            .map_or(0.0, |(to, from)| to - from)
    }
}

/// What of a ball's pixels speaks for marks.
#[derive(Debug)]
pub struct RotationEvidence<'a> {
    search: RotationSearch<'a>,
    ball: &'a SampledBall,
    /// What the light leaves over.
    left: Vec<f32>,
    /// The light.
    maps: BallMaps,
    /// Mean square of what is left over by a light that drifts, and what noise is of that.
    drifting: f64,
    noise: f64,
}

impl RotationEvidence<'_> {
    /// Whether what nothing explains is as strong as what is drawn on a ball.
    fn is_drawn(&self) -> bool {
        self.drifting - self.noise > DRAWN * DRAWN
    }

    /// The part that a rotation explains of what else nothing does.
    fn explained_by(&self, fit: &RotationFit) -> f64 {
        self.explained_of(fit.cross_validated / fit.pixels as f64)
    }

    /// The same of one that leaves this mean square.
    fn explained_of(&self, left: f64) -> f64 {
        (self.drifting - left) / (self.drifting - self.noise)
    }

    /// Those of `rates`, found in a light that is thought known, that explain what no light does that stays on the ball, or drifts.
    ///
    /// # Errors
    /// [`NoRate::TooFewTurns`] where there is none.
    pub fn told_from_light(&self, mut rates: SuitingRates) -> Result<SuitingRates, NoRate> {
        rates.possible.retain(|f| self.is_explained_by(f));
        if rates.possible.is_empty() {
            return Err(NoRate::TooFewTurns);
        }
        Ok(rates)
    }

    fn is_explained_by(&self, fit: &RotationFit) -> bool {
        self.explained_by(fit) > LEAST_EXPLAINED
    }

    /// Rates among which those that such views show are, by some of their pixels. The views are in time order, no more than [`SEARCH_FRAMES`], of an arc
    /// that lasts `arc_s`. Where the ball turns too little in that ([`LEAST_TURNS`]) in a light that is free, no others are looked for than likelier ones: it
    /// will not be told by these views.
    ///
    /// # Errors
    /// Why there is none.
    pub fn candidates(&self, arc_s: f64) -> Result<RateCandidates, NoRate> {
        let (limit, lit) = (self.search.limit, self.search.light.is_some());
        let interval_s = interval_s(&self.ball.samples.times_s).ok_or(NoRate::FewFrames)?;
        // Nodes this far apart do not tell how the blur is uneven.
        let (samples, grids) = self.ball.thinned();
        let samples = &samples.evenly_blurred();
        let starts = self.starts(interval_s, samples)?;
        let is_untold = |rate: &Vector3<f64>| !lit && rate.norm() * arc_s < TAU * LEAST_TURNS;
        let (untold, starts): (Vec<_>, Vec<_>) = starts.into_iter().partition(|s| is_untold(&s.rate_rad_s));
        let (mut possible, too_fast): (Vec<_>, Vec<_>) =
            starts.into_iter().partition(|s| limit.allows(&s.rate_rad_s));
        let fit_all = |starts, fits| self.fitted(starts, fits, samples);
        let mut fits = fit_all(untold, Vec::new());
        if let Some(slow) = self.likeliest(&fits).filter(|f| is_untold(&f.rate_rad_s)) {
            possible.retain(|s| s.cross_validated < slow.cross_validated);
        }
        fits = fit_all(possible, fits);
        let best = self.likeliest(&fits).map_or(f64::INFINITY, |f| f.cross_validated);
        let (better, worse): (Vec<_>, Vec<_>) = too_fast.into_iter().partition(|s| s.cross_validated < best);
        fits = fit_all(better, fits);
        let best = self.likeliest(&fits).ok_or(NoRate::Unexplained)?.rate_rad_s;
        let is_new = |rate: &Vector3<f64>| {
            let off = |f: &RotationFit| (rate - f.rate_rad_s).norm();
            fits.iter().all(|f| off(f) > grids.longest_step(samples))
        };
        let others = [other_way(best, interval_s), self.slow_way(best, interval_s)];
        let (others, beyond): (Vec<_>, Vec<_>) = others
            .into_iter()
            .flatten()
            .filter(is_new)
            .partition(|rate| limit.allows(rate) || !limit.allows(&best));
        let fitted = |rate| fit::fit(samples, grids, &self.maps, rate, lit);
        fits.extend(others.into_iter().filter_map(fitted));
        fits.sort_by(by_likelihood);
        fits.retain(|f| self.is_explained_by(f));
        let least = PERHAPS_RIVAL * self.explained_by(&fits[0]);
        fits.retain(|f| self.explained_by(f) >= least);
        let mut fits = each_once(fits);
        // (A stable sort: the most likely of each first.)
        fits.sort_by_key(|f| !limit.allows(&f.rate_rad_s));
        let pixels = samples.values.len() as f64;
        let is_rival = |s: &&RoughFit| self.explained_of(s.cross_validated / pixels) >= least;
        let worse = worse.iter().filter(is_rival).map(|s| s.rate_rad_s);
        let mut too_fast_rad_s: Vec<Vector3<f64>> = Vec::new();
        for rate in beyond.into_iter().chain(worse) {
            let is_apart = |other: &Vector3<f64>| (rate - other).norm() * interval_s > search::ONE_PEAK;
            if too_fast_rad_s.iter().all(is_apart) {
                too_fast_rad_s.push(rate);
            }
        }
        Ok(RateCandidates { fits, too_fast_rad_s })
    }

    /// Rates from which a fit to the thinned `samples` may be worth while, the most likely first; then the slower one that looks like the most likely.
    fn starts(&self, interval_s: f64, samples: &BallSamples) -> Result<Vec<RoughFit>, NoRate> {
        let (lit, grids) = (self.search.light.is_some(), &self.ball.thinned().1);
        let pixel = 1.0 / self.search.radius_px;
        let products = LagProducts::new(&self.ball.samples, &self.left, interval_s, pixel, lit);
        let found = products.ok_or(NoRate::Plain)?.best(MOST_FITTED);
        let least = LEAST_SCORE * found.first().map_or(0.0, |best| best.score);
        let rough = |rate| fit::rough(samples, grids, &self.maps, rate, lit);
        let likely = found.par_iter().filter(|c| c.score > least.max(0.0));
        let likely = likely.map(|c| rough(c.rate_rad_s)).collect();
        let mut starts = starts(likely, samples.longest_s());
        let slow = starts
            .first()
            .and_then(|s| self.slow_way(s.rate_rad_s, interval_s));
        starts.extend(slow.map(rough));
        Ok(starts)
    }

    /// The rate that is slower by half a turn a frame, where it makes so few turns that a search would hardly find it beside a light that is free: of
    /// marks that are taken half for light, what is even under half a turn goes with the one as with the other.
    fn slow_way(&self, rate_rad_s: Vector3<f64>, interval_s: f64) -> Option<Vector3<f64>> {
        let angle = rate_rad_s.norm() * interval_s;
        let slow = rate_rad_s * (1.0 - PI / angle);
        (slow.norm() * self.ball.duration_s() < TAU * LEAST_TURNS).then_some(slow)
    }

    /// The most likely of `fits` that explain what the ball shows.
    fn likeliest<'f>(&self, fits: &'f [RotationFit]) -> Option<&'f RotationFit> {
        let explaining = fits.iter().filter(|f| self.is_explained_by(f));
        explaining.min_by(|a, b| by_likelihood(a, b))
    }

    /// `fits` with those that `starts`, the most likely first, lead to beside them, by the thinned `samples`.
    fn fitted(
        &self,
        mut starts: Vec<RoughFit>,
        mut fits: Vec<RotationFit>,
        samples: &BallSamples,
    ) -> Vec<RotationFit> {
        let (lit, grids) = (self.search.light.is_some(), &self.ball.thinned().1);
        loop {
            // What is a step from a minimum, or in its valley, leads to it.
            let apart = |start: &RoughFit, f: &RotationFit| {
                (start.rate_rad_s - f.rate_rad_s).norm() > grids.longest_step(samples)
                    && !f.has_in_valley(start)
            };
            starts.retain(|start| fits.iter().all(|f| apart(start, f)));
            if starts.is_empty() {
                return fits;
            }
            let some: Vec<RoughFit> = starts.drain(..starts.len().min(FITTED_AT_ONCE)).collect();
            let fitted = |s: &RoughFit| fit::fit(samples, grids, &self.maps, s.rate_rad_s, lit);
            fits.par_extend(some.par_iter().filter_map(fitted));
        }
    }

    /// What `candidates`, found in some of a flight's views, become by all of them.
    ///
    /// # Errors
    /// Why there is none.
    pub fn by_all(&self, candidates: &RateCandidates) -> Result<SuitingRates, NoRate> {
        let lit = self.search.light.is_some();
        let samples = &self.ball.samples;
        let mut fits = candidates.fits.clone();
        // Maps of other frames lie otherwise: first by some of the pixels, of which those that the search was by were fewer.
        if fits.iter().any(|f| f.maps.gains.len() != samples.frames()) {
            let (thin, grids) = self.ball.thinned();
            let by_some = |f: &RotationFit| fit::fit(thin, grids, &f.maps, f.rate_rad_s, lit);
            fits = fits.par_iter().filter_map(by_some).collect();
            let explained = |f: &RotationFit| self.explained_by(f);
            let best = fits.iter().map(explained).fold(0.0, f64::max);
            fits.retain(|f| explained(f) >= PERHAPS_RIVAL * best);
        }
        let grids = &self.ball.grids;
        let mut too_fast_rad_s = candidates.too_fast_rad_s.clone();
        let is_possible = |f: &RotationFit| self.search.limit.allows(&f.rate_rad_s);
        if fits.len() + too_fast_rad_s.len() > 1 && !fits.iter().all(is_possible) {
            let rivals = each_once(self.likely_of(fits.clone())?);
            if rivals.len() + too_fast_rad_s.len() > 1 {
                let too_fast = rivals.iter().filter(|f| !is_possible(f));
                too_fast_rad_s.splice(..0, too_fast.map(|f| f.rate_rad_s));
                if !rivals.iter().any(is_possible) {
                    return Ok(SuitingRates {
                        possible: Vec::new(),
                        too_fast_rad_s,
                        left: fit::left_at(samples, grids, &rivals[0], lit) / samples.values.len() as f64,
                    });
                }
                fits.retain(is_possible);
            }
        }
        let by_all = |f: &RotationFit| fit::fit_on(samples, grids, f, lit);
        let mut possible: Vec<RotationFit> = Vec::new();
        for f in self.likely_of(fits.par_iter().filter_map(by_all).collect())? {
            if possible.iter().all(|other| other.differs_from(&f)) {
                possible.extend(self.with_shares(f));
            }
        }
        let left = possible.first().ok_or(NoRate::Unexplained)?.residual.powi(2);
        Ok(SuitingRates {
            possible,
            too_fast_rad_s,
            left,
        })
    }

    /// The rates that views of one flight, no more than [`SEARCH_FRAMES`], show if the light on the ball is as smooth as on a matt one. They have to explain
    /// what no light of any shape does that stays, or drifts.
    ///
    /// # Errors
    /// Why there is none.
    pub fn in_smooth_light(&self) -> Result<SuitingRates, NoRate> {
        if !self.is_drawn() {
            return Err(NoRate::TooFewTurns);
        }
        let light = fit::smooth_light(&self.ball.samples, &self.ball.grids);
        let lit = RotationSearch {
            light: Some(&light),
            ..self.search
        };
        self.told_from_light(lit.rivals(self.ball)?)
    }

    /// The best of `fits` and its rivals, of those that explain what the ball shows, the most likely first.
    ///
    /// # Errors
    /// [`NoRate::Unexplained`] where none does.
    fn likely_of(&self, mut fits: Vec<RotationFit>) -> Result<Vec<RotationFit>, NoRate> {
        fits.retain(|f| self.is_explained_by(f));
        fits.sort_by(by_likelihood);
        let best = fits.first().ok_or(NoRate::Unexplained)?;
        let unit = best.sum_squares / best.pixels as f64 * best.scatter.powi(2);
        let most = (1.0 + GRID_PART) * best.cross_validated + RIVAL * unit;
        let likely = RIVAL_EXPLAINED * self.explained_by(best);
        fits.retain(|f| f.cross_validated <= most || self.explained_by(f) > likely);
        Ok(fits)
    }

    /// The fit with the share of the blur in its covariance: what it is uneven on the ball moves the rate, and is known in part. With that of the
    /// centres: pixels that are placed on the ball by a centre that is off are those of a ball that is turned about an axis in the picture; and marks draw
    /// them to and fro. And with that of the radius, and of a light that is thought known: how far the rate is from where it would be with the light
    /// fitted along; `None` where that cannot be said.
    fn with_shares(&self, mut fit: RotationFit) -> Option<RotationFit> {
        let search = &self.search;
        let lit = search.light.is_some();
        if let Some(all) = &self.ball.all {
            fit = fit::brought_on(all, &self.ball.grids.of_samples(all), &fit, lit);
        }
        let rate = fit.rate_rad_s;
        let (thin, grids) = self.ball.thinned();
        let evenly = &thin.evenly_blurred();
        let to_rate_of = |samples: &BallSamples| fit.distance_to_rate_of(samples, grids, lit);
        let ((by_thin, by_evenly), (by_turning_centres, freely)) = rayon::join(
            || rayon::join(|| to_rate_of(thin), || to_rate_of(evenly)),
            || {
                rayon::join(
                    || self.by_turning_centres(&fit, evenly),
                    || lit.then(|| fit::fit_on(thin, grids, &fit, false)),
                )
            },
        );
        let moved = by_evenly - by_thin;
        let blur = search.blur_px / search.radius_px;
        let unit = blur * blur * rate.norm();
        let mut shares = UNEVEN_PART.powi(2) * moved * moved.transpose();
        if let Some(axis) = rate.try_normalize(0.0) {
            let across = Matrix3::identity() - axis * axis.transpose();
            shares += (AXIS_STD * unit).powi(2) * across;
            let leaning =
                search.radius_std_px / search.radius_px * (across * Vector3::new(rate.x, rate.y, 0.0));
            shares += leaning * leaning.transpose();
        }
        let turned_std_rad = search.centre_std_px / search.radius_px;
        for picture_axis in [Vector3::x(), Vector3::y()] {
            let turned = turned_std_rad * picture_axis.cross(&rate);
            shares += turned * turned.transpose();
        }
        shares += by_turning_centres;
        if let Some(freely) = freely {
            let off = freely?.rate_rad_s - (rate + by_thin);
            shares += off * off.transpose();
        }
        // Parts of the disc disagree by those, too.
        fit.covariance += shares + positive(fit.by_parts - shares);
        Some(fit)
    }

    /// Covariance of the rate by centres that are off with the marks: as points of the ball are that turn with it. (What is off along the axis stays: the
    /// common part of the centres has that.) `evenly`: the thinned pixels as if the blur were even.
    fn by_turning_centres(&self, fit: &RotationFit, evenly: &BallSamples) -> Matrix3<f64> {
        let (lit, (_, grids)) = (self.search.light.is_some(), self.ball.thinned());
        let off_radii = self.search.turning_std_px / self.search.radius_px;
        let stays = fit.step_to_rate_of(evenly, grids, lit);
        let moved_by = |axis: Vector3<f64>| {
            let around = evenly.around(off_radii * axis, &fit.rate_rad_s);
            let moved = fit.step_to_rate_of(&around, &grids.of_samples(&around), lit) - stays;
            moved * moved.transpose()
        };
        let one = cube_map::across(&fit.rate_rad_s);
        let (one, other) = rayon::join(
            || moved_by(one),
            || moved_by(fit.rate_rad_s.cross(&one).normalize()),
        );
        one + other
    }
}

impl<'a> RotationSearch<'a> {
    /// The pixels of `views` of one flight, in time order.
    ///
    /// # Errors
    /// [`NoRate::FewFrames`].
    pub fn sampled(&self, views: &[BallView]) -> Result<SampledBall, NoRate> {
        let blur = self.blur_px / self.radius_px;
        let all = BallSamples::new(views, self.noise_grey, blur, LEAST_FRAMES).ok_or(NoRate::FewFrames)?;
        let (all, samples) = match all.values.len().div_ceil(MOST_PIXELS) {
            0..=1 => (None, all),
            step => {
                let some = all.thinned(step);
                (Some(all), some)
            }
        };
        Ok(SampledBall {
            all,
            grids: FitGrids::new(&samples, 1.0 / self.radius_px),
            samples,
            thin: OnceLock::new(),
        })
    }

    /// What of a `ball` speaks for marks.
    ///
    /// # Errors
    /// Why nothing does.
    pub fn evidence<'b>(&self, ball: &'b SampledBall) -> Result<RotationEvidence<'b>, NoRate>
    where
        'a: 'b,
    {
        let (samples, grids) = (&ball.samples, &ball.grids);
        let (left, maps) = match self.light {
            Some(light) => fit::lit_as(samples, grids, light),
            None => fit::still(samples, grids),
        };
        let noise = samples.noise.powi(2);
        let mean_square = |squares: f64| squares / samples.values.len() as f64;
        let squares = fit::sum_of_squares(&left);
        if mean_square(squares) < LEAST_MARKS * LEAST_MARKS * noise {
            return Err(NoRate::Plain);
        }
        if let Some(light) = self.light.filter(|light| light.contrast() > 0.0) {
            let as_marked = mean_square(squares).sqrt() / light.contrast();
            if !(1.0 / AS_MARKED..AS_MARKED).contains(&as_marked) {
                return Err(NoRate::Unexplained);
            }
        }
        let drift = match self.light {
            Some(_) => 0.0,
            None => fit::explained_by_drift(samples, grids, &left),
        };
        let drifting = mean_square(squares - drift);
        if drifting < LEAST_MARKS * LEAST_MARKS * noise {
            return Err(NoRate::Plain);
        }
        Ok(RotationEvidence {
            search: *self,
            ball,
            left,
            maps,
            drifting,
            noise,
        })
    }

    /// The rates that a `ball` shows in no more than [`SEARCH_FRAMES`]: the most likely first, rivals behind it.
    ///
    /// # Errors
    /// Why there is none.
    pub fn rivals(&self, ball: &SampledBall) -> Result<SuitingRates, NoRate> {
        let evidence = self.evidence(ball)?;
        let candidates = evidence.candidates(ball.duration_s())?;
        if self.light.is_none() && candidates.first().turns_too_little(ball.duration_s()) {
            return Err(NoRate::TooFewTurns);
        }
        evidence.by_all(&candidates)
    }

    /// Mean square that a ball that turns as `candidate`, found in views of the same frames, leaves of the pixels of this `ball`.
    #[must_use]
    pub fn left_by(&self, ball: &SampledBall, candidate: &RotationFit) -> f64 {
        let (samples, grids) = ball.thinned();
        fit::left_at(samples, grids, candidate, self.light.is_some()) / samples.values.len() as f64
    }
}

/// The light that several flights of the ball have in common, from their pixels and the rates that each showed by itself: light and
/// rates are fitted in turn, since a slow ball's marks pass for light in one flight and not in all. `None` where they do not make
/// [`TEACHING_TURNS`] together.
#[must_use]
pub fn common_light(flights: &[(&SampledBall, &RotationFit)]) -> Option<BallMaps> {
    let turns = |(ball, f): &(&SampledBall, &RotationFit)| f.turns(ball.duration_s());
    if flights.iter().map(turns).sum::<f64>() < TEACHING_TURNS {
        return None;
    }
    let most = flights.iter().max_by(|a, b| turns(a).total_cmp(&turns(b)))?;
    let mut light = most.1.maps.clone();
    let samples: Vec<_> = flights.iter().map(|(ball, _)| ball.thinned()).collect();
    let mut rates: Vec<Vector3<f64>> = flights.iter().map(|(_, f)| f.rate_rad_s).collect();
    for _ in 0..COMMON_ROUNDS {
        let lit = |((samples, grids), &rate): (&&(BallSamples, FitGrids), &Vector3<f64>)| {
            fit::rough(samples, grids, &light, rate, true)
        };
        let fits: Vec<RoughFit> = samples.par_iter().zip(&rates).map(lit).collect();
        rates = fits.iter().map(|f| f.rate_rad_s).collect();
        let mut sums = vec![0.0; light.light.len()];
        let mut all = vec![1e-9; light.light.len()];
        for ((samples, grids), f) in samples.iter().zip(&fits) {
            let (part, weights) = fit::light_beside(samples, grids, f);
            for (k, w) in weights.iter().enumerate() {
                sums[k] += w * part[k];
                all[k] += w;
            }
        }
        light.light = sums.iter().zip(&all).map(|(sum, w)| sum / w).collect();
    }
    Some(light)
}

/// The part of a symmetric matrix along its axes of positive value.
fn positive(matrix: Matrix3<f64>) -> Matrix3<f64> {
    let mut eigen = matrix.symmetric_eigen();
    eigen.eigenvalues.apply(|x| *x = x.max(0.0));
    eigen.recompose()
}

fn by_likelihood(a: &RotationFit, b: &RotationFit) -> std::cmp::Ordering {
    a.cross_validated.total_cmp(&b.cross_validated)
}

/// Those of `fits`, the most likely first, that differ from better ones.
fn each_once(fits: Vec<RotationFit>) -> Vec<RotationFit> {
    let mut apart: Vec<RotationFit> = Vec::new();
    for f in fits {
        if apart.iter().all(|other| other.differs_from(&f)) {
            apart.push(f);
        }
    }
    apart
}

/// Those of `rough` rates from which a fit is worth while, each once: no two turn the ends of an arc, `longest_s` from its middle, to the same place.
fn starts(mut rough: Vec<RoughFit>, longest_s: f64) -> Vec<RoughFit> {
    rough.sort_by(|a, b| a.cross_validated.total_cmp(&b.cross_validated));
    let most = ROUGH_RIVAL * rough.first().map_or(0.0, |best| best.cross_validated);
    let mut starts: Vec<RoughFit> = Vec::new();
    for found in rough {
        let apart =
            |other: &RoughFit| (found.rate_rad_s - other.rate_rad_s).norm() * longest_s > ONE_START_RAD;
        if found.cross_validated <= most && starts.iter().all(apart) {
            starts.push(found);
        }
    }
    starts
}

/// From frame to frame, s; `None` of fewer than two.
fn interval_s(times_s: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> = times_s.windows(2).map(|w| w[1] - w[0]).collect();
    median(&mut steps)
}

/// The fastest rate that pictures at these times show, rad/s (`BEYOND_ALIAS`).
#[must_use]
pub fn fastest_rad_s(times_s: &[f64]) -> f64 {
    interval_s(times_s).map_or(f64::INFINITY, |interval_s| BEYOND_ALIAS * PI / interval_s)
}

/// The rate that looks alike at steps of `interval_s`, the other way round, where it is no faster than [`BEYOND_ALIAS`].
fn other_way(rate_rad_s: Vector3<f64>, interval_s: f64) -> Option<Vector3<f64>> {
    let angle = rate_rad_s.norm() * interval_s;
    let other = rate_rad_s * (1.0 - TAU / angle);
    (other.norm() * interval_s < BEYOND_ALIAS * PI).then_some(other)
}
