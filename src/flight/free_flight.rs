//! The ball's free flight as it was found: the points of its track, the fitted arcs, the impacts between them.

use super::extra_variance::ExtraVariance;
use super::linking::Spot;
use super::motion_model::{ArcFit, FitPoint};
use crate::geometry::PlanePoint;
use crate::numeric::robust::median;
use crate::quantity::Quantity;

/// A flight.
#[derive(Debug, Clone)]
pub struct Flight {
    /// The spots of the ball's track in time order, each with its use.
    pub points: Vec<FlightPoint>,
    /// The fitted arcs.
    pub fit: ArcFit,
    /// What centres scatter by beyond their own uncertainty.
    pub extra: ExtraVariance,
    /// First and last time of a used point of each arc, s.
    pub spans: Vec<(f64, f64)>,
    /// Between arcs k and k + 1: the impact, or `None` where they do not meet (a catch, a gap too long).
    pub impacts: Vec<Option<f64>>,
    /// Frame interval, s.
    pub interval_s: f64,
    /// Where the ball left a bench that it was seen moving along, before the first arc.
    pub launch: Option<PlaneLaunch>,
}

/// A spot of the track and what became of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlightPoint {
    /// The spot.
    pub spot: Spot,
    /// The arc it serves, or why it serves none.
    pub use_: SpotUse,
}

/// Whether a spot serves the fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SpotUse {
    /// For this arc.
    Used(usize),
    /// Before the first or after the last free arc, or between arcs that are not free flight.
    NotFree,
    /// At the time of an impact: the ball touches the floor.
    Contact,
    /// Off its arc by this many plane units.
    Outlier(f64),
}

impl FlightPoint {
    /// The arc that it is used for.
    #[must_use]
    pub fn arc(&self) -> Option<usize> {
        self.use_.arc()
    }
}

impl SpotUse {
    /// The arc that the spot is used for.
    #[must_use]
    pub fn arc(self) -> Option<usize> {
        match self {
            Self::Used(arc) => Some(arc),
            _ => None,
        }
    }
}

/// Something else that flies while the ball does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OtherFlight {
    /// First time that it is seen in flight, s.
    pub from_s: f64,
    /// Last time, s.
    pub to_s: f64,
    /// Where it is then first, plane units.
    pub place: PlanePoint,
    /// Whether it keeps its place beside the ball: a shadow, a reflection, or a second ball that was launched with it.
    pub moves_along: bool,
    /// Its usual brightness over the background, grey levels.
    pub contrast_grey: f64,
}

/// Why there is no flight.
#[derive(Debug, Clone, PartialEq)]
pub enum NoFlight {
    /// Nothing round moved in enough frames: how many round things there were.
    NothingRound {
        /// Spots in all.
        spots: usize,
    },
    /// Round things moved, but none fell freely.
    NothingFalls {
        /// Length of the longest track, frames.
        longest: usize,
    },
}

/// The launch from a bench: where and when the straight line along it and the first arc part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneLaunch {
    /// t_e, s.
    pub time_s: f64,
    /// First time at which the ball was seen on the line, s.
    pub from_s: f64,
    /// s: the rate of y on the line, plane units a second, with its standard uncertainty.
    pub rate: (f64, f64),
    /// Height of the line where they part (against y), plane units, with its standard uncertainty.
    pub height: (f64, f64),
    /// The arc's y there less the line's, plane units, with the line's part of its standard uncertainty.
    pub gap: (f64, f64),
    /// How far the ball moved along the line while it was seen on it, in its radii.
    pub moved_radii: f64,
}

/// A ball that moves less than this along the line, in its radii, is held.
const LEAST_MOVED_RADII: f64 = 0.15;

impl PlaneLaunch {
    /// Whether the ball moved along the line; else it was held, and let go.
    #[must_use]
    pub fn is_rolled(&self) -> bool {
        self.moved_radii > LEAST_MOVED_RADII
    }
}

/// An impact that a person denies is told to so many frames.
const DENIED_FRAMES: f64 = 2.5;

impl Flight {
    /// Time of the first and the last point in use, s.
    #[must_use]
    pub fn time_span(&self) -> (f64, f64) {
        let from = self.spans.iter().map(|s| s.0).fold(f64::INFINITY, f64::min);
        let to = self.spans.iter().map(|s| s.1).fold(f64::NEG_INFINITY, f64::max);
        (from, to)
    }

    /// The points in use.
    pub fn used_points(&self) -> impl Iterator<Item = &FlightPoint> {
        self.points.iter().filter(|p| p.arc().is_some())
    }

    fn median_of_used(&self, of: impl Fn(&Spot) -> f64) -> f64 {
        let mut values: Vec<f64> = self.used_points().map(|p| of(&p.spot)).collect();
        median(&mut values).unwrap_or(0.0)
    }

    /// Standard uncertainty of a spot's coordinates with what such frames scatter by, plane units.
    #[must_use]
    pub fn std(&self, spot: &Spot) -> f64 {
        self.extra.variance_of(spot).sqrt()
    }

    /// Standard uncertainty of the used centres, plane units.
    #[must_use]
    pub fn centre_std(&self) -> f64 {
        self.median_of_used(|s| self.std(s))
    }

    /// What the used centres scatter by beyond what their own pixels tell, plane units: how far a codec or a shaking camera
    /// displaces the ball.
    #[must_use]
    pub fn displaced_std(&self) -> f64 {
        self.median_of_used(|s| self.extra.more(s.coded).sqrt())
    }

    /// How many times more the used centres scatter than their own pixels tell.
    #[must_use]
    pub fn scatter_ratio(&self) -> f64 {
        self.median_of_used(|s| self.std(s) / s.std).max(1.0)
    }

    /// Radius of the ball in use, plane units.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.median_of_used(|s| s.radius)
    }

    /// Number of points in use.
    #[must_use]
    pub fn used(&self) -> usize {
        self.used_points().count()
    }

    /// The points in use as the fit had them.
    #[must_use]
    pub fn fit_points(&self) -> Vec<FitPoint> {
        let fit_point = |p: &FlightPoint| Some(self.extra.fit_point(&p.spot, p.arc()?));
        self.points.iter().filter_map(fit_point).collect()
    }

    /// Takes none of the impacts for one that is within some frames of one of `times_s`.
    pub fn deny_impacts(&mut self, times_s: &[f64]) {
        let near = |t: f64| {
            times_s
                .iter()
                .any(|denied| (t - denied).abs() < DENIED_FRAMES * self.interval_s)
        };
        for impact in &mut self.impacts {
            *impact = impact.filter(|t| !near(*t));
        }
    }

    /// The arc that holds at `t`: up to an impact (or the middle of the gap, where two arcs do not meet) the one before, after it the one
    /// behind; beyond the ends the nearest.
    #[must_use]
    pub fn arc_at(&self, t: f64) -> usize {
        let parts_s = |k: usize| self.impacts[k].unwrap_or(0.5 * (self.spans[k].1 + self.spans[k + 1].0));
        (0..self.impacts.len()).take_while(|&k| t > parts_s(k)).count()
    }

    /// How many times larger than in the calibrated plane the ball is seen at `t`.
    #[must_use]
    pub fn magnification_at(&self, t: f64) -> f64 {
        self.fit.magnification(self.arc_at(t), t)
    }

    /// The point of the calibrated plane that `p` is at; `None` where only a fit would tell and there is none.
    #[must_use]
    pub fn place_of(&self, p: &FlightPoint) -> Option<PlanePoint> {
        let known = !self.fit.model.resolves_height() || p.use_ != SpotUse::NotFree;
        let t = p.spot.time_s;
        known.then(|| self.fit.place_in_plane(p.spot.place, self.arc_at(t), t))
    }

    /// Where the ball is first, in the calibrated plane.
    #[must_use]
    pub fn first_place(&self) -> Option<PlanePoint> {
        let first = if self.fit.model.resolves_height() {
            self.used_points().next()
        } else {
            self.points.first()
        };
        self.place_of(first?)
    }

    /// The fall that the flight itself shows, over the one that its motion model was given; see
    /// [`MotionModel::fall_ratio`](super::motion_model::MotionModel::fall_ratio).
    #[must_use]
    pub fn fall_ratio(&self) -> Option<Quantity> {
        self.fit.model.fall_ratio(&self.fit_points(), self.fit.arcs())
    }

    /// Mean speed over the ends and middles of the arcs, plane units/s.
    #[must_use]
    pub fn mean_speed(&self) -> f64 {
        let speeds: Vec<f64> = self
            .spans
            .iter()
            .enumerate()
            .flat_map(|(k, s)| [s.0, 0.5 * (s.0 + s.1), s.1].map(|t| (k, t)))
            .map(|(k, t)| self.fit.speed(k, t))
            .collect();
        speeds.iter().sum::<f64>() / speeds.len() as f64
    }
}
