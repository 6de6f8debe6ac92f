//! Flights that are not the model: a camera that pans, a plane seen at a slant, a ball that nears, air that is not still.
//!
//! Whatever bends a path slowly, the speed at an impact is a local quantity. Each arc may therefore depart from what gravity and
//! drag make of it by a smooth curve of its own, Σ c_n (t − t_k)ⁿ with n = 2, 3 along both axes ([`super::planar::BEND_POWERS`]), of
//! which it is known that it is about 0, to a part of the arc's way. That part is one more free number. With 0 the arcs are
//! parabolas; the larger it is, the fewer points beside an impact count for the velocities there, and the larger are their uncertainties: a
//! window that is as long as the path allows.
//!
//! A change of scale ([`super::scale_change`]) bends all arcs in one way, with three numbers for all, of which the ball's size in the picture
//! tells.
//!
//! Which of these it is the likelihood of all points tells, with the numbers integrated out and the centres' scatter found anew for each
//! ([`ArcFit::deviance`](super::motion_model::ArcFit::deviance)). Where none is clearly likelier than the plain arcs nothing changes.
//!
//! Assumed: the bend is smooth over an arc. What departs faster (a hand that shakes the camera by frames) is scatter.

use super::free_flight::{Flight, SpotUse};
use super::impacts::flight_from_fit;
use super::linking::Spot;
use super::motion_model::MotionModel;
use super::outliers::fit_without_outliers;
use super::planar::{ACROSS, ARCS, GRAVITY};
use super::samples::middle_and_extent;
use super::scale_change::ScaleChange;
use super::segment::DROP_COST;
use crate::geometry::PlanePoint;
use crate::numeric::linear::solve;
use crate::numeric::propagation::InputQuantities;
use crate::numeric::robust::median;
use nalgebra::{DMatrix, DVector};

/// Parts of an arc's way that are tried: a tenth of a pixel in 100 to a path that only its ends resemble a parabola.
const PARTS: [f64; 5] = [0.001, 0.003, 0.01, 0.03, 0.1];

/// By how much a departure must be likelier than none, in −2 ln L: odds of seven to one for a camera that moves, which is seldom square to the
/// plane; a hundred and fifty to one for one that stands on its tripod.
const LEAST_GAIN: f64 = 4.0;
const LEAST_GAIN_ON_TRIPOD: f64 = 10.0;

/// How the ball's size in the picture changes: over its way up, over its way to the right, and from the first sighting to the last; each a part of its
/// size, with its standard uncertainty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SizeTrend {
    /// From the lowest place to the highest.
    pub up: (f64, f64),
    /// From the leftmost place to the rightmost.
    pub right: (f64, f64),
    /// From the first time to the last.
    pub time: (f64, f64),
}

/// Fewer sightings than this tell of no trend in three directions.
const LEAST_SIGHTINGS: usize = 8;

impl SizeTrend {
    /// That of a ball's sightings, each with its own radius; `None` where they do not tell it.
    #[must_use]
    pub fn of(spots: &[Spot]) -> Option<Self> {
        if spots.len() < LEAST_SIGHTINGS {
            return None;
        }
        let of: [fn(&Spot) -> f64; 3] = [|s| s.place.up, |s| s.place.right, |s| s.time_s];
        let ranges = of.map(|of| middle_and_extent(spots.iter().map(of)));
        let held: Vec<usize> = (0..3).filter(|&k| !(ranges[k].1 > 0.0)).collect();
        // Beforehand a size changes by no more than about this; directions that the path does not tell apart share what they see.
        let rows = spots.len() + 3;
        let (mut matrix, mut right) = (DMatrix::zeros(rows, 4), DVector::zeros(rows));
        for (i, s) in spots.iter().enumerate() {
            let weight = 1.0 / (s.std / s.radius).max(LEAST_SIZE_SCATTER);
            matrix[(i, 0)] = weight;
            right[i] = weight * s.radius.ln();
            for k in (0..3).filter(|k| !held.contains(k)) {
                matrix[(i, k + 1)] = weight * (of[k](s) - ranges[k].0) / ranges[k].1;
            }
        }
        for k in 0..3 {
            matrix[(spots.len() + k, k + 1)] = 1.0 / USUAL_CHANGE;
        }
        let (found, inverse) = solve(&matrix, &right)?;
        let left = (right - &matrix * &found).norm_squared();
        let variance = (left / (spots.len() - 1) as f64).max(1.0);
        let trend = |k: usize| (found[k], (variance * inverse[(k, k)]).sqrt());
        Some(Self {
            up: trend(1),
            right: trend(2),
            time: trend(3),
        })
    }
}

/// An outline's size scatters by this part of it at least.
const LEAST_SIZE_SCATTER: f64 = 0.01;

/// What a flight's arcs are beyond those of its motion model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Departure {
    /// Each bent by a curve of its own, about this part of its way.
    Bent(f64),
    /// Seen with a scale that changes.
    ScaleChanges,
}

/// The ball's outline tells its size to this part, beside its scatter: it is blurred where it is fast.
const SIZE_STD: f64 = 0.02;

/// A camera stands about so many lengths of the path away: more than most do, so that what its slant shortens is not made too small.
const DISTANCE_PATHS: f64 = 8.0;

/// Nothing is shortened by more than this part without being seen to be.
const MOST_FORESHORTENED: f64 = 0.1;

/// The scale changes by about this part over a path, where the ball's size does not tell.
const USUAL_CHANGE: f64 = 0.1;

impl Flight {
    /// This flight with what its arcs are beyond its motion model, where its points show that; `None` where they are as they should be.
    /// `first_look` are the ball's sightings, each with its own size; `axis` is where the camera's axis meets the plane. A camera that stands still bends no path: then only the scale may change.
    #[must_use]
    pub fn departing(
        &self,
        first_look: &[Spot],
        axis: PlanePoint,
        camera_stands_still: bool,
    ) -> Option<(Self, Departure)> {
        let straight = self.under(&*self.fit.model)?;
        let none = straight.fit.deviance?;
        let model = &self.fit.model;
        let change = self.scale_change(first_look, axis);
        let parts = if camera_stands_still { &[][..] } else { &PARTS };
        let bent = parts
            .iter()
            .map(|&part| (Departure::Bent(part), model.with_bend(part)));
        let changed = std::iter::once((Departure::ScaleChanges, model.with_scale_change(change)));
        let tried = bent.chain(changed).filter_map(|(departure, model)| {
            let model = model?;
            let flight = self.under(&*model)?;
            // What lasts from frame to frame counts once.
            let gain = (none - flight.fit.deviance?) / flight.fit.autocorrelation_inflation.max(1.0);
            let gain = match departure {
                Departure::Bent(_) => gain - 2.0 * (PARTS.len() as f64).ln(),
                Departure::ScaleChanges => gain,
            };
            Some((gain, departure, model))
        });
        let (gain, departure, model) = tried.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let least = if camera_stands_still {
            LEAST_GAIN_ON_TRIPOD
        } else {
            LEAST_GAIN
        };
        if gain < least {
            return None;
        }
        let anew = self.with_outliers_judged_anew(&*model);
        let mut flight = anew.or_else(|| self.under(&*model))?;
        if departure == Departure::ScaleChanges {
            flight.foreshorten(axis);
        }
        Some((flight, departure))
    }

    /// Lengths along a slant are seen shorter by the cosine of its angle, which the path does not tell: into the covariance.
    fn foreshorten(&mut self, axis: PlanePoint) {
        let used = || self.used_points().map(|p| &p.spot);
        let extent = |of: fn(&Spot) -> f64| middle_and_extent(used().map(of)).1;
        let [up, right, _] = ScaleChange::of(self.fit.parameters.as_slice());
        // The change over the path is the slant's tangent times the path over the distance.
        let shorter = |slope: f64, extent: f64| {
            (0.5 * (DISTANCE_PATHS * slope * extent).powi(2)).min(MOST_FORESHORTENED)
        };
        let parts = [
            shorter(right, extent(|s| s.place.right)),
            shorter(up, extent(|s| s.place.up)),
        ];
        let p = self.fit.parameters.clone();
        for (along, part) in parts.into_iter().enumerate() {
            let mut change = DVector::zeros(p.len());
            let fall = [ACROSS, GRAVITY][along];
            change[fall] = p[fall];
            let middle = [axis.right, axis.up][along];
            for k in 0..self.fit.arcs() {
                let at = ARCS + 4 * k + 2 * along;
                change[at] = p[at] - middle;
                change[at + 1] = p[at + 1];
            }
            self.fit.covariance += (part * part) * &change * change.transpose();
        }
    }

    /// This flight without the first points of its first arc, where they are those of a hand that lets go: as long as each costs no more than a
    /// point that is left out.
    #[must_use]
    pub fn without_held_points(&self) -> Option<Self> {
        let none = self.under(&*self.fit.model)?.fit.deviance?;
        let first: Vec<usize> = (0..self.points.len())
            .filter(|&i| self.points[i].arc() == Some(0))
            .collect();
        let most = first
            .len()
            .saturating_sub(LEAST_FREE_POINTS)
            .min(MOST_HELD_POINTS);
        let without = |count: usize| -> Option<(f64, Self)> {
            let mut points = self.points.clone();
            for &i in &first[..count] {
                points[i].use_ = SpotUse::NotFree;
            }
            let mut flight = self.refitted(points, &*self.fit.model)?;
            flight.spans[0].0 = self.points[first[count]].spot.time_s;
            let left_out = |i: &usize| DROP_COST + 2.0 * flight.extra.variance_of(&self.points[*i].spot).ln();
            let price: f64 = first[..count].iter().map(left_out).sum();
            let gain = (none - flight.fit.deviance? - price) / flight.fit.autocorrelation_inflation.max(1.0);
            Some((gain, flight))
        };
        let best = (1..=most).filter_map(without).max_by(|a, b| a.0.total_cmp(&b.0));
        let (_, flight) = best.filter(|(gain, _)| *gain > LEAST_HELD_GAIN)?;
        flight.under(&*self.fit.model)
    }

    /// A change of scale about the camera's axis and the middle of this flight's time, known by the ball's size.
    fn scale_change(&self, first_look: &[Spot], axis: PlanePoint) -> ScaleChange {
        let used = || self.used_points().map(|p| &p.spot);
        let range = |of: fn(&Spot) -> f64| middle_and_extent(used().map(of));
        let (up, right, time) = (
            range(|s| s.place.up),
            range(|s| s.place.right),
            range(|s| s.time_s),
        );
        let trend = SizeTrend::of(first_look);
        // What is behind a small ball changes its outline as much as its place does.
        let mut roughness: Vec<f64> = first_look.iter().map(|s| s.std / s.radius).collect();
        let rough = median(&mut roughness).unwrap_or(0.0);
        let known = |trend: Option<(f64, f64)>, range: f64| match trend {
            _ if !(range > 0.0) => (0.0, f64::MIN_POSITIVE.sqrt()),
            Some((change, std)) if std < USUAL_CHANGE => {
                (-change / range, std.hypot(SIZE_STD).hypot(rough) / range)
            }
            _ => (0.0, USUAL_CHANGE / range),
        };
        ScaleChange {
            place: (axis.right, axis.up),
            time_s: time.0,
            known: [
                known(trend.map(|t| t.up), up.1),
                known(trend.map(|t| t.right), right.1),
                known(trend.map(|t| t.time), time.1),
            ],
        }
    }

    /// The same points under another model; those that are off its arcs are left out, those that are off no longer come back.
    fn with_outliers_judged_anew(&self, model: &dyn MotionModel) -> Option<Self> {
        let spots: Vec<Spot> = self.points.iter().map(|p| p.spot).collect();
        let mut uses: Vec<SpotUse> = self.points.iter().map(|p| p.use_).collect();
        let fit = fit_without_outliers(&spots, &mut uses, self.fit.arcs(), model)?;
        let flight = flight_from_fit(&spots, uses, fit, self.interval_s);
        let met = |f: &Self| f.impacts.iter().flatten().count();
        (met(&flight) >= met(self)).then_some(Self {
            launch: super::launch::find(&flight),
            ..flight
        })
    }

    /// This flight without the points beside its impacts that their arcs, fitted without them, do not lead to: frames whose shutter was open
    /// while the ball touched, or that show it pressed flat. So near to an impact a point draws its arc along, and does not stand out from
    /// it.
    #[must_use]
    pub fn without_touching_points(&self) -> Option<Self> {
        let mut beside = Vec::new();
        for (k, t) in self.impacts.iter().enumerate() {
            let Some(t) = *t else { continue };
            let near = |i: &usize| (self.points[*i].spot.time_s - t).abs() < TOUCHING_PART * self.interval_s;
            let of = |arc: usize| (0..self.points.len()).filter(move |&i| self.points[i].arc() == Some(arc));
            beside.extend(of(k).next_back().filter(near).map(|i| (i, k)));
            beside.extend(of(k + 1).next().filter(near).map(|i| (i, k + 1)));
        }
        let mut points = self.points.clone();
        for &(i, _) in &beside {
            points[i].use_ = SpotUse::Contact;
        }
        let without = self
            .refitted(points.clone(), &*self.fit.model)
            .filter(|_| !beside.is_empty())?;
        let fit = &without.fit;
        let inputs = InputQuantities {
            values: fit.parameters.clone(),
            covariance: fit.covariance.clone(),
        };
        let mut touches = false;
        for (i, k) in beside {
            let spot = &self.points[i].spot;
            let led = inputs.outputs(|p| {
                let m = fit.model.motion_in_picture(p, &fit.times, k, spot.time_s);
                vec![m.r, m.h]
            });
            let off = |at: usize, place: f64| -> Option<f64> {
                let q = led.quantity(at)?;
                let variance = q.std_uncertainty?.powi(2) + without.extra.variance_of(spot);
                Some((q.value - place).powi(2) / variance)
            };
            let off = off(0, spot.place.right).unwrap_or(0.0) + off(1, spot.place.up).unwrap_or(0.0);
            if off < TOUCHING_SIGMAS * TOUCHING_SIGMAS {
                points[i].use_ = self.points[i].use_;
            } else {
                touches = true;
            }
        }
        let flight = self.refitted(points, &*self.fit.model).filter(|_| touches)?;
        flight.under(&*self.fit.model)
    }
}

/// Points of a hand before it lets go, at most, and points of the first arc that are left, at least.
const MOST_HELD_POINTS: usize = 8;
const LEAST_FREE_POINTS: usize = 4;

/// By how much leaving them out must be likelier.
const LEAST_HELD_GAIN: f64 = 16.0;

/// A point within this part of a frame's time of an impact may be of a frame in which the ball touches, and is one where it is off by so many
/// standard deviations.
const TOUCHING_PART: f64 = 0.35;
const TOUCHING_SIGMAS: f64 = 4.0;
