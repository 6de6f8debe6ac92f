//! How a ball turns in flight, seen from the marks on it.
//!
//! ```text
//! pixels well inside of the outline (view) -> what a still picture leaves over (fit::still)
//!     -> rates up to the alias limit that bring the marks into each other (search) -> each fitted by likelihood (fit)
//! ```
//!
//! Assumed: a ball that turns steadily about an axis that stays (free flight), whose light is the same wherever it flies in the frames
//! given, but for a brightness that changes smoothly, and marks that stay. A ball without marks leaves nothing but noise beside its light,
//! and what is left of one whose light drifts is explained by that: neither has a rotation here. Nor has one that turns by less than its
//! marks are wide, unless its light is [known](RotationSearch::light) from another flight: else its marks cannot be told from its light.
//!
//! Rates beyond half a turn a frame are seen as slower ones the other way round; those a little beyond are given as rivals
//! ([`BEYOND_ALIAS`]). A pattern that looks alike after a part of a turn has several rates, all of which are given.
//!
//! The direction of an axis far from the line of sight has an error of the order of (blur over radius)², [`TILTED_AXIS_STD`]: its uncertainty holds that.

pub mod cube_map;
pub mod disc_map;
pub mod fit;
pub mod search;
#[cfg(test)]
mod tests;
pub mod view;

pub use fit::{BallMaps, RotationFit};
pub use view::{BallPixel, BallSamples, BallView};

use crate::numeric::robust::median;
use fit::FitGrids;
use nalgebra::{Matrix3, Vector3};
use search::LagProducts;
use std::f64::consts::{PI, TAU};

/// Frames with fewer pictures of the ball show no rate: any two can be turned into each other.
const LEAST_FRAMES: usize = 4;

/// A ball on which this many times the noise is left over by a still picture carries marks, perhaps.
const LEAST_MARKS: f64 = 1.5;

/// Part of what a still picture leaves over, beside noise, that a rotation must explain.
const LEAST_EXPLAINED: f64 = 0.7;

/// Rates that are fitted, at most.
const MOST_FITTED: usize = 12;

/// Frames by which rates are searched for and rivals told apart, at most: those in the middle. The rest then makes the rate exact.
pub const SEARCH_FRAMES: usize = 40;

/// Rates whose likelihoods are within this of the best are rivals (twice the logarithm).
const RIVAL: f64 = 9.0;

/// Part of Σ of squares by which the same maps differ that lie otherwise on their grids.
const GRID_PART: f64 = 0.05;

/// Rates up to this many times half a turn a frame are thought possible.
const BEYOND_ALIAS: f64 = 1.25;

/// Standard uncertainty of the axis' direction over (blur / radius)², any way; and of its angle from the line of sight, over that and the
/// sine of twice the angle: the blur of a picture, which is even in its own plane, is uneven on the ball.
const AXIS_STD: f64 = 0.5;
const TILTED_AXIS_STD: f64 = 1.5;

/// A known light leaves marks over that stand out as much as those of the flight it is known from, to this factor.
const AS_MARKED: f64 = 3.0;

/// What is known of a ball's pictures, to find how it turns.
#[derive(Debug, Clone, Copy)]
pub struct RotationSearch<'a> {
    /// Standard deviation of a pixel's noise, grey levels.
    pub noise_grey: f64,
    /// Standard deviation of the pictures' blur, pixels' own area included, px.
    pub blur_px: f64,
    /// The ball's radius, px.
    pub radius_px: f64,
    /// What another flight of the same ball in the same light showed.
    pub light: Option<&'a BallMaps>,
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
}

impl RotationSearch<'_> {
    /// The rates that `rivals`, found in [the middle](SEARCH_FRAMES) of a flight, become by all its views.
    ///
    /// # Errors
    /// Why there is none.
    pub fn by_all(&self, views: &[BallView], rivals: &[RotationFit]) -> Result<Vec<RotationFit>, NoRate> {
        let (samples, grids) = self.samples(views)?;
        let again = |f: &RotationFit| fit::fit(&samples, &grids, &f.maps, f.rate_rad_s, self.light.is_some());
        let fits = rivals.iter().filter_map(again).map(|f| self.with_axis_std(f));
        let fits = told_apart(fits.collect(), &samples);
        if fits.is_empty() {
            return Err(NoRate::Unexplained);
        }
        Ok(fits)
    }

    fn samples(&self, views: &[BallView]) -> Result<(BallSamples, FitGrids), NoRate> {
        let blur = self.blur_px / self.radius_px;
        let samples =
            BallSamples::new(views, self.noise_grey, blur, LEAST_FRAMES).ok_or(NoRate::FewFrames)?;
        let grids = FitGrids::new(&samples, 1.0 / self.radius_px);
        Ok((samples, grids))
    }

    /// The rates that views of one flight show, in time order and no more than [`SEARCH_FRAMES`]: the most likely first, rivals behind it.
    ///
    /// # Errors
    /// Why there is none.
    pub fn rivals(&self, views: &[BallView]) -> Result<Vec<RotationFit>, NoRate> {
        let (samples, grids) = self.samples(views)?;
        let (left, maps) = match self.light {
            Some(light) => fit::lit_as(&samples, &grids, light),
            None => fit::still(&samples, &grids),
        };
        let variance = |sum_squares: f64| sum_squares / samples.values.len() as f64;
        let left_squares: f64 = left.iter().map(|r| r * r).sum();
        let noise = samples.noise.powi(2);
        let still = variance(left_squares);
        if still < LEAST_MARKS * LEAST_MARKS * noise {
            return Err(NoRate::Plain);
        }
        let marks = self.light.map(BallMaps::contrast);
        let as_marked = marks.is_none_or(|m| (1.0 / AS_MARKED..AS_MARKED).contains(&(still.sqrt() / m)));
        let mut steps: Vec<f64> = samples.times_s.windows(2).map(|w| w[1] - w[0]).collect();
        let interval_s = median(&mut steps)
            .filter(|_| as_marked)
            .ok_or(NoRate::Unexplained)?;
        let products = LagProducts::new(
            &samples,
            &left,
            interval_s,
            1.0 / self.radius_px,
            self.light.is_some(),
        );
        let products = products.ok_or(NoRate::Plain)?;
        let fitted = |start: Vector3<f64>| fit::fit(&samples, &grids, &maps, start, self.light.is_some());
        let candidates = products.best(MOST_FITTED);
        let likely = candidates.iter().filter(|c| c.score > 0.0);
        let mut fits: Vec<RotationFit> = likely.filter_map(|c| fitted(c.rate_rad_s)).collect();
        fits.sort_by(|a, b| a.sum_squares.total_cmp(&b.sum_squares));
        let other_way = fits
            .first()
            .and_then(|best| other_way(best.rate_rad_s, interval_s));
        fits.extend(other_way.and_then(fitted));
        // What a light that drifts leaves over is what speaks for marks.
        let drift = match self.light {
            Some(_) => 0.0,
            None => fit::explained_by_drift(&samples, &grids, &left),
        };
        let drifting = variance(left_squares - drift);
        let likely =
            |f: &RotationFit| drifting - variance(f.sum_squares) > LEAST_EXPLAINED * (drifting - noise);
        if drifting < LEAST_MARKS * LEAST_MARKS * noise {
            return Err(NoRate::Plain);
        }
        let fits: Vec<RotationFit> = fits
            .into_iter()
            .filter(likely)
            .map(|f| self.with_axis_std(f))
            .collect();
        if fits.is_empty() {
            return Err(NoRate::Unexplained);
        }
        Ok(told_apart(fits, &samples))
    }

    /// The fit with the share of the axis' direction in its covariance.
    fn with_axis_std(&self, mut fit: RotationFit) -> RotationFit {
        let rate = fit.rate_rad_s;
        let Some(axis) = rate.try_normalize(0.0) else {
            return fit;
        };
        let blur = self.blur_px / self.radius_px;
        let unit = blur * blur * rate.norm();
        let across = Matrix3::identity() - axis * axis.transpose();
        fit.covariance += (AXIS_STD * unit).powi(2) * across;
        let third = axis.cross(&Vector3::z());
        if let Some(towards) = axis.cross(&third).try_normalize(0.0) {
            let std = TILTED_AXIS_STD * unit * 2.0 * third.norm() * axis.z;
            fit.covariance += std * std * towards * towards.transpose();
        }
        fit
    }
}

/// The rate that looks alike at steps of `interval_s`, the other way round, where it is no faster than [`BEYOND_ALIAS`].
fn other_way(rate_rad_s: Vector3<f64>, interval_s: f64) -> Option<Vector3<f64>> {
    let angle = rate_rad_s.norm() * interval_s;
    let other = rate_rad_s * (1.0 - TAU / angle);
    (other.norm() * interval_s < BEYOND_ALIAS * PI).then_some(other)
}

/// The best of `fits` and its rivals, each once.
fn told_apart(mut fits: Vec<RotationFit>, samples: &BallSamples) -> Vec<RotationFit> {
    fits.sort_by(|a, b| a.sum_squares.total_cmp(&b.sum_squares));
    let Some(best) = fits.first() else {
        return fits;
    };
    let unit = best.sum_squares / samples.values.len() as f64 * best.scatter.powi(2);
    let most = (1.0 + GRID_PART) * best.sum_squares + RIVAL * unit;
    let mut rivals: Vec<RotationFit> = Vec::new();
    for f in fits {
        if f.sum_squares <= most && rivals.iter().all(|r| r.differs_from(&f)) {
            rivals.push(f);
        }
    }
    rivals
}
