//! The freely falling path among all that moves; its arcs, and the impacts between them.
//!
//! 1. [`linking`]: round things of successive frames become tracks.
//! 2. [`segment`]: each track is cut into arcs with free parabolas. The arcs of a flight share one fall; a hand, a
//!    person, a swinging cloth do not. The track with the most evidence of one common fall is the ball's (`candidate`).
//! 3. With that fall the track is cut again (`cut`), and arcs that are one flight are joined (`join`, `chain`).
//! 4. [`fit`]: all arcs together, with one gravity. Outliers are left out, with the reason (`outliers`).
//!    What moves straight in between (on a bench, on the floor) is no arc; where it leads into the first one the ball was
//!    launched ([`launch`]).
//! 5. Two arcs that meet between the last point of one and the first of the next are an impact (`meeting`, `impacts`).
//! 6. What is no ball's flight is refused (`judge`), and points at the ends of arcs that may be another's go (`ends`).
//!
//! In a top view from far away nothing falls: arcs are straight lines, and the longest track of such lines is the
//! ball's. From a camera whose height is known they bend; that is [`overhead`].

mod arc_ends;
mod arc_search;
mod arc_selection;
mod candidate;
pub mod clock;
pub mod drag;
pub mod dropped_frames;
pub mod duplicate_frames;
pub mod extra_variance;
pub mod fit;
mod impact_test;
mod impacts;
pub mod launch;
pub mod linking;
mod merge_arcs;
mod outliers;
pub mod overhead;
pub mod planar;
mod plausibility;
mod samples;
pub mod segment;
pub mod shake;

use crate::geometry::PlanePoint;
use crate::quantity;
use arc_search::build;
use candidate::{TrackCandidate, with_continuations};
use extra_variance::ExtraVariance;
use fit::{ArcFit, FitPoint, Forces};
use launch::PlaneLaunch;
use linking::{Spot, Track};
use outliers::{fit_point, refitted, variance};

/// The flight found.
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

/// Finds the flight among `spots` (in time order) under `forces`.
///
/// # Errors
///
/// [`NoFlight`] with what was found instead.
pub fn find(spots: &[Spot], forces: Forces) -> Result<Flight, NoFlight> {
    let upright = find_leaning(spots, forces, false);
    let leans = |f: &Flight| f.fit.lean_rad().abs() > LEAST_LEAN_RAD;
    if !forces.falls() || upright.as_ref().is_ok_and(|f| !leans(f)) {
        return upright;
    }
    // A camera that is rolled by degrees bends every path along r, too: arcs then have a curve of their own there.
    match (find_leaning(spots, forces, true), upright) {
        (Ok(leaning), Ok(upright)) if leaning.used() <= upright.used() => Ok(upright),
        (Ok(leaning), _) => Ok(leaning),
        (Err(_), upright) => upright,
    }
}

/// A fall that leans by more than this is looked for as one, rad.
const LEAST_LEAN_RAD: f64 = 0.035;

/// The flight where the fall may lean or not.
fn find_leaning(spots: &[Spot], forces: Forces, leaning: bool) -> Result<Flight, NoFlight> {
    let tracks = linking::link(spots);
    let longest = tracks.first().map_or(0, Vec::len);
    if longest < 4 {
        return Err(NoFlight::NothingRound { spots: spots.len() });
    }
    let best = tracks
        .iter()
        .filter(|t| t.len() >= 4)
        .filter_map(|t| TrackCandidate::new(spots, t, forces, leaning))
        .max_by(|a, b| a.evidence.total_cmp(&b.evidence))
        .ok_or(NoFlight::NothingFalls { longest })?;
    let interval_s = interval(&best.track.iter().map(|&i| spots[i].time_s).collect::<Vec<_>>());
    let whole = with_continuations(spots, &tracks, &best, forces, leaning);
    build(spots, &whole, best.gravity, forces, interval_s).ok_or(NoFlight::NothingFalls { longest })
}

/// Fits again the same spots' flight with better places: `points` as [`Flight::points`] with refined spots and any
/// that were found since; arcs are found anew with the fall known.
#[must_use]
pub fn again(spots: &[Spot], flight: &Flight, forces: Forces) -> Option<Flight> {
    let track: Track = (0..spots.len()).collect();
    build(
        spots,
        &track,
        flight.fit.acceleration(),
        forces,
        flight.interval_s,
    )
}

/// Median time between successive frames.
fn interval(times: &[f64]) -> f64 {
    let mut steps: Vec<f64> = times
        .windows(2)
        .map(|w| w[1] - w[0])
        .filter(|d| *d > 0.0)
        .collect();
    quantity::median(&mut steps).unwrap_or(f64::INFINITY)
}

fn median(values: &mut [f64]) -> f64 {
    quantity::median(values).unwrap_or(0.0)
}

impl Flight {
    /// Time of the first and the last point in use, s.
    #[must_use]
    pub fn time_span(&self) -> (f64, f64) {
        let from = self.spans.iter().map(|s| s.0).fold(f64::INFINITY, f64::min);
        let to = self.spans.iter().map(|s| s.1).fold(f64::NEG_INFINITY, f64::max);
        (from, to)
    }

    /// Standard uncertainty of a spot's coordinates with what such frames scatter by, plane units.
    #[must_use]
    pub fn std(&self, spot: &Spot) -> f64 {
        variance(spot, &self.extra).sqrt()
    }

    /// What the used centres scatter by beyond what their own pixels tell, plane units: how far a codec or a shaking camera
    /// displaces the ball.
    #[must_use]
    pub fn displaced_std(&self) -> f64 {
        let used = self.points.iter().filter(|p| matches!(p.use_, SpotUse::Used(_)));
        let mut beyond: Vec<f64> = used.map(|p| self.extra.more(p.spot.coded).sqrt()).collect();
        median(&mut beyond)
    }

    /// How many times more the used centres scatter than their own pixels tell.
    #[must_use]
    pub fn scatter_ratio(&self) -> f64 {
        let mut ratios: Vec<f64> = self
            .points
            .iter()
            .filter(|p| matches!(p.use_, SpotUse::Used(_)))
            .map(|p| self.std(&p.spot) / p.spot.std)
            .collect();
        median(&mut ratios).max(1.0)
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

    /// The points in use as the fit had them.
    #[must_use]
    pub fn fit_points(&self) -> Vec<FitPoint> {
        let used = self.points.iter().filter_map(|p| match p.use_ {
            SpotUse::Used(arc) => Some((arc, &p.spot)),
            _ => None,
        });
        used.map(|(arc, spot)| fit_point(spot, arc, &self.extra))
            .collect()
    }

    /// The same points, each in use moved by the `shift` of it and its arc (along right and up, plane units), with the
    /// arcs and the centres' scatter found anew. `None` where the points do not determine them.
    #[must_use]
    pub fn moved(&self, shift: impl Fn(&Spot, usize) -> (f64, f64)) -> Option<Self> {
        let mut points = self.points.clone();
        for p in &mut points {
            if let SpotUse::Used(arc) = p.use_ {
                let (right, up) = shift(&p.spot, arc);
                p.spot.place.right += right;
                p.spot.place.up += up;
            }
        }
        self.refitted(points, self.fit.forces)
    }

    /// The same points under other `forces`; `None` where they do not determine the arcs.
    #[must_use]
    pub fn under(&self, forces: Forces) -> Option<Self> {
        let mut flight = self.refitted(self.points.clone(), forces)?;
        for (k, impact) in flight.impacts.iter_mut().enumerate() {
            let p = flight.fit.parameters.as_slice();
            *impact = impact.and_then(|_| flight.fit.impact_time(p, k));
        }
        flight.launch = launch::find(&flight);
        Some(flight)
    }

    fn refitted(&self, points: Vec<FlightPoint>, forces: Forces) -> Option<Self> {
        let spots: Vec<Spot> = points.iter().map(|p| p.spot).collect();
        let uses: Vec<SpotUse> = points.iter().map(|p| p.use_).collect();
        let track: Track = (0..spots.len()).collect();
        let (fit, extra) = refitted(&spots, &track, &uses, self.fit.arcs(), forces, self.extra)?;
        Some(Self {
            points,
            fit,
            extra,
            ..self.clone()
        })
    }

    /// Radius of the ball in use, plane units.
    #[must_use]
    pub fn radius(&self) -> f64 {
        let used = self.points.iter().filter(|p| matches!(p.use_, SpotUse::Used(_)));
        median(&mut used.map(|p| p.spot.radius).collect::<Vec<_>>())
    }

    /// The points in use.
    pub fn used_points(&self) -> impl Iterator<Item = &FlightPoint> {
        let used = |p: &&FlightPoint| matches!(p.use_, SpotUse::Used(_));
        self.points.iter().filter(used)
    }

    /// The arc that holds at `t`: up to an impact the one before, after it the one behind; beyond the ends the nearest.
    #[must_use]
    pub fn arc_at(&self, t: f64) -> usize {
        let before = |i: &&Option<f64>| i.is_none_or(|impact| t > impact);
        self.impacts.iter().take_while(before).count()
    }

    /// How many times larger than in the calibrated plane the ball is seen at `t`.
    #[must_use]
    pub fn magnification_at(&self, t: f64) -> f64 {
        self.fit.magnification(self.arc_at(t), t)
    }

    /// The point of the calibrated plane that `p` is at; `None` where only a fit would tell and there is none.
    #[must_use]
    pub fn place_of(&self, p: &FlightPoint) -> Option<PlanePoint> {
        let above = matches!(self.fit.forces, Forces::Overhead(_));
        let t = p.spot.time_s;
        (!above || p.use_ != SpotUse::NotFree)
            .then(|| self.fit.place_in_plane(p.spot.place, self.arc_at(t), t))
    }

    /// Where the ball is first, in the calibrated plane.
    #[must_use]
    pub fn first_place(&self) -> Option<PlanePoint> {
        let first = match self.fit.forces {
            Forces::Overhead(_) => self.used_points().next(),
            _ => self.points.first(),
        };
        self.place_of(first?)
    }

    /// Number of points in use.
    #[must_use]
    pub fn used(&self) -> usize {
        self.points
            .iter()
            .filter(|p| matches!(p.use_, SpotUse::Used(_)))
            .count()
    }
}

#[cfg(test)]
mod tests;
