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
use super::planar::GRAVITY;
use super::samples::middle_and_extent;
use super::scale_change::{DISTANCE, ScaleChange, WHOLE};
use super::segment::DROP_COST;
use crate::geometry::PlanePoint;
use crate::numeric::linear::solve;
use crate::numeric::propagation::InputQuantities;
use crate::numeric::robust::median;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

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
    pub fn of(spots: &[Spot], camera_stands_still: bool) -> Option<Self> {
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
        for (k, usual) in usual_changes(camera_stands_still).into_iter().enumerate() {
            matrix[(spots.len() + k, k + 1)] = 1.0 / usual;
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
    /// Perhaps seen with a scale that changes.
    ScaleChanges {
        /// Of that rather than plain arcs, from 0 to 1.
        probability: f64,
    },
}

impl Departure {
    /// Nothing: no scale that changes.
    pub const NONE: Self = Self::ScaleChanges { probability: 0.0 };

    /// Standard deviation of the part by which the scale may change over the path.
    #[must_use]
    pub fn slant_std(&self) -> f64 {
        match self {
            Self::Bent(_) => USUAL_CHANGE,
            Self::ScaleChanges { probability } => USUAL_CHANGE * probability.sqrt(),
        }
    }

    /// Whether there is likelier one than none.
    #[must_use]
    pub fn is_likely(&self) -> bool {
        match self {
            Self::Bent(_) => true,
            Self::ScaleChanges { probability } => *probability > 0.5,
        }
    }
}

/// What is known of the camera beside its map of the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraFacts {
    /// Where its axis meets the plane.
    pub axis: PlanePoint,
    /// Whether it stands still: then nothing bends a path, and only the scale may change.
    pub stands_still: bool,
    /// How far it stands from the plane, plane units, and the standard uncertainty of that one's logarithm.
    pub distance: (f64, f64),
    /// Gravity with its standard uncertainty, plane units/s²; `None` where the scale itself rests on the fall.
    pub fall: Option<(f64, f64)>,
}

/// The ball's outline tells its size to this part, beside its scatter: it is blurred where it is fast.
const SIZE_STD: f64 = 0.02;

/// The standard uncertainty of a number that is not to change.
const HELD: f64 = 1e-12;

/// The scale changes by about this part over a path, where the ball's size does not tell.
const USUAL_CHANGE: f64 = 0.1;

/// And by this part in time alone, where the camera stands still. A ball that leaves the plane goes on in a plane of its own: its scale changes with its way,
/// before an impact and after it. A camera in a hand comes nearer as it likes.
const USUAL_CHANGE_IN_TIME: f64 = 0.02;

fn usual_changes(camera_stands_still: bool) -> [f64; 3] {
    let in_time = if camera_stands_still {
        USUAL_CHANGE_IN_TIME
    } else {
        USUAL_CHANGE
    };
    [USUAL_CHANGE, USUAL_CHANGE, in_time]
}

/// A fall that is off gravity by more standard uncertainties than this is not one that a slant explains.
const FALL_SIGMAS: f64 = 4.0;

/// A change of scale that is less likely than this is left out: what it adds to no uncertainty shows.
const LEAST_WEIGHT: f64 = 1e-3;

impl Flight {
    /// What this flight's arcs are likeliest beyond its motion model. `first_look` are the ball's sightings, each with its own size.
    #[must_use]
    pub fn likeliest_departure(&self, first_look: &[Spot], camera: &CameraFacts) -> Departure {
        self.departure(first_look, camera).unwrap_or(Departure::NONE)
    }

    /// This flight with a departure from its motion model, which may have been judged of points that lift was taken from.
    ///
    /// Where the points do not tell whether the scale changes, the flight is the mean of both readings, each with its weight, and its uncertainty spans them.
    #[must_use]
    pub fn departing(&self, departure: Departure, first_look: &[Spot], camera: &CameraFacts) -> Option<Self> {
        match departure {
            Departure::Bent(part) => {
                let model = self.fit.model.with_bend(part)?;
                let anew = self.with_outliers_judged_anew(&*model);
                anew.or_else(|| self.under(&*model))
            }
            Departure::ScaleChanges { probability } => (probability > LEAST_WEIGHT)
                .then(|| self.seen_with(self.scale_change(first_look, camera), camera, probability))?,
        }
    }

    /// By how much this flight is likelier with a scale that changes, as the logarithm of the odds; negative where it is less likely.
    #[must_use]
    pub fn ln_odds_of_scale_change(&self, first_look: &[Spot], camera: &CameraFacts) -> Option<f64> {
        let none = self.under(&*self.fit.model)?.fit.deviance?;
        let change = self.scale_change(first_look, camera);
        Some(0.5 * self.gain_under(&*self.fit.model.with_scale_change(change)?, none)?)
    }

    /// By how much the points are likelier under `model` than where their deviance is `none`, in −2 ln L: what lasts from frame to frame
    /// counts once.
    fn gain_under(&self, model: &dyn MotionModel, none: f64) -> Option<f64> {
        let fit = self.under(model)?.fit;
        Some((none - fit.deviance?) / fit.autocorrelation_inflation.max(1.0))
    }

    fn departure(&self, first_look: &[Spot], camera: &CameraFacts) -> Option<Departure> {
        let model = &self.fit.model;
        let none = self.under(&**model)?.fit.deviance?;
        let (parts, least) = if camera.stands_still {
            (&[][..], LEAST_GAIN_ON_TRIPOD)
        } else {
            (&PARTS[..], LEAST_GAIN)
        };
        let bent = parts.iter().filter_map(|&part| {
            let gain = self.gain_under(&*model.with_bend(part)?, none)?;
            Some((gain - 2.0 * (PARTS.len() as f64).ln(), part))
        });
        let bent = bent.max_by(|a, b| a.0.total_cmp(&b.0));
        let change = self.scale_change(first_look, camera);
        let by_scale = model
            .with_scale_change(change)
            .and_then(|m| self.gain_under(&*m, none));
        let by_scale = by_scale.unwrap_or(f64::NEG_INFINITY);
        Some(match bent.filter(|(gain, _)| *gain > by_scale.max(least)) {
            Some((_, part)) => Departure::Bent(part),
            None => Departure::ScaleChanges {
                probability: 1.0 / (1.0 + (0.5 * (least - by_scale)).exp()),
            },
        })
    }

    /// This flight where the scale changes with a probability of `weight`.
    fn seen_with(&self, change: ScaleChange, camera: &CameraFacts, weight: f64) -> Option<Self> {
        let model = &self.fit.model;
        let held = model.with_scale_change(change)?;
        let flight = (weight > 0.5)
            .then(|| self.with_outliers_judged_anew(&*held))
            .flatten();
        let flight = flight.or_else(|| self.under(&*held))?;
        // The calibrated length was measured somewhere along the path.
        let extent = |of: fn(&Spot) -> f64| middle_and_extent(flight.used_points().map(|p| of(&p.spot))).1;
        let [up, right, ..] = ScaleChange::of(flight.fit.parameters.as_slice());
        let whole_std = 0.5 * (up * extent(|s| s.place.up)).hypot(right * extent(|s| s.place.right));
        let mut open = change;
        open.known[WHOLE] = (0.0, whole_std.max(HELD));
        open.known[DISTANCE] = (0.0, camera.distance.1.max(HELD));
        let free = flight.under(&*model.with_scale_change(open)?)?;
        let changed = match camera.fall.filter(|&fall| free.falls_with(fall)) {
            Some(fall) => {
                open.fall = Some(fall);
                flight.under(&*model.with_scale_change(open)?)?
            }
            None => free,
        };
        let plain = changed.under(&**model)?;
        Some(changed.averaged(weight, &plain))
    }

    fn falls_with(&self, (gravity, std): (f64, f64)) -> bool {
        let found_std = self.fit.covariance[(GRAVITY, GRAVITY)].max(0.0).sqrt();
        (self.fit.gravity() - gravity).abs() < FALL_SIGMAS * found_std.hypot(std)
    }

    /// The mean of this flight, seen with a scale that changes, with a `weight`, and of the same points' `plain` one with the rest.
    fn averaged(mut self, weight: f64, plain: &Self) -> Self {
        let count = self.fit.parameters.len();
        let parameters = plain.fit.parameters.clone().resize_vertically(count, 0.0);
        let covariance = plain.fit.covariance.clone().resize(count, count, 0.0);
        let apart = &self.fit.parameters - &parameters;
        let rest = 1.0 - weight;
        self.fit.covariance =
            weight * &self.fit.covariance + rest * covariance + (weight * rest) * &apart * apart.transpose();
        self.fit.parameters = parameters + weight * apart;
        for (k, impact) in self.impacts.iter_mut().enumerate() {
            let p = self.fit.parameters.as_slice();
            *impact = impact.and_then(|_| self.fit.impact_time(p, k));
        }
        self
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
        let tried: Vec<(f64, Self)> = (1..=most).into_par_iter().filter_map(without).collect();
        let best = tried.into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
        let (_, flight) = best.filter(|(gain, _)| *gain > LEAST_HELD_GAIN)?;
        flight.under(&*self.fit.model)
    }

    /// A change of scale about the camera's axis and the middle of this flight's time, known by the ball's size; lengths are those across the axis
    /// there, and the camera is as far as it is known to be.
    fn scale_change(&self, first_look: &[Spot], camera: &CameraFacts) -> ScaleChange {
        let used = || self.used_points().map(|p| &p.spot);
        let range = |of: fn(&Spot) -> f64| middle_and_extent(used().map(of));
        let (up, right, time) = (
            range(|s| s.place.up),
            range(|s| s.place.right),
            range(|s| s.time_s),
        );
        let trend = SizeTrend::of(first_look, camera.stands_still);
        let usual = usual_changes(camera.stands_still);
        // What is behind a small ball changes its outline as much as its place does.
        let mut roughness: Vec<f64> = first_look.iter().map(|s| s.std / s.radius).collect();
        let rough = median(&mut roughness).unwrap_or(0.0);
        let known = |trend: Option<(f64, f64)>, range: f64, usual: f64| match trend {
            _ if !(range > 0.0) => (0.0, HELD),
            Some((change, std)) if std < usual => (
                -change / range,
                std.hypot(SIZE_STD).hypot(rough).min(usual) / range,
            ),
            _ => (0.0, usual / range),
        };
        ScaleChange {
            place: (camera.axis.right, camera.axis.up),
            time_s: time.0,
            distance: camera.distance.0,
            known: [
                known(trend.map(|t| t.up), up.1, usual[0]),
                known(trend.map(|t| t.right), right.1, usual[1]),
                known(trend.map(|t| t.time), time.1, usual[2]),
                (0.0, HELD),
                (0.0, HELD),
            ],
            fall: None,
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
