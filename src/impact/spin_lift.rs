//! What the air does to the ball: the drag to expect, and lift (Magnus), once the bounces tell the spin.
//!
//! F = ½ ρ π R² C_L v² across the motion, C_L = 1 / (2 + v/|Rω|), measured on tennis balls (Štěpánek 1988; Cross and Lindsey
//! 2014 give the same form). The acceleration is (ρ π R²/2m) Rω v / (v + 2|Rω|) times (h', −r'), where a ball of unknown
//! size or mass has the fitted drag over a usual C_D for the first factor: topspin pushes a rising ball forward and a falling
//! one back, so that an arc fitted without it is too fast along x at both of its ends.
//!
//! The arcs are first fitted without lift. Then each point is moved back by what lift did to it, the arcs are fitted again
//! (they now pass through their points, and the centres scatter by less), and lift is added to their motion again. What it did is the way
//! of a ball with lift less that of one without from the arc's mean time on, both with drag: of a light ball with much spin lift also changes the speed that drag
//! and lift go by, so that it is worked out once more along the arcs without it until the points stay where they are. A smooth
//! ball's lift can differ from a tennis ball's by a third (and turn round near the drag crisis, far above these speeds):
//! how many times that law's the lift is, is one more free number, known beforehand to
//! [`KNOWN_SPIN_LIFT_STD`] and told by the points of the arcs where they bend by it
//! ([`SpinLift::told_by`]).
//!
//! Assumed: it is one number for the whole flight, and between none and [`MOST_LIFT`] times the law's. Arcs that ask for more are bent by
//! something else, and keep that bend.

use super::error_budget::{
    KNOWN_SPIN_LIFT_STD, MOST_LIFT, NO_SPIN_LIFT_STD, UNKNOWN_SPIN_LIFT_STD, USUAL_DRAG,
};
use crate::flight::Flight;
use crate::flight::motion_model::FitPoint;
use crate::flight::planar::{DRAG, Motion, PlanarArcs, speed};
use crate::flight::segment::TrackSample;
use nalgebra::DVector;

/// Lift on each arc, by its spin R ω in plane units/s, positive where it turns +r towards −h (rolling along +r).
#[derive(Debug, Clone)]
pub struct SpinLift {
    spins: Vec<Option<f64>>,
    /// How many times the law's it is, with its standard uncertainty.
    times_law: (f64, f64),
}

impl Default for SpinLift {
    fn default() -> Self {
        Self::new(Vec::new())
    }
}

/// The points' weights settle in so many rounds: how far centres scatter shows once lift is gone.
const ROUNDS: usize = 3;

/// Points are moved back so many times at most, until none moves by more than this part of its standard uncertainty.
const PASSES: usize = 5;
const SETTLED_PART: f64 = 0.05;

/// By so many times the law's lift the fit's answer is worked out.
const PROBE: f64 = 0.25;

impl SpinLift {
    /// Arc by arc; `None` where the spin is not known.
    #[must_use]
    pub fn new(spins: Vec<Option<f64>>) -> Self {
        Self {
            spins,
            times_law: (1.0, KNOWN_SPIN_LIFT_STD),
        }
    }

    /// How many times the law's lift is, with its standard uncertainty.
    #[must_use]
    pub const fn times_law(&self) -> (f64, f64) {
        self.times_law
    }

    /// The same with as much lift as the points of `flight` show, beside what is known beforehand.
    #[must_use]
    pub fn told_by(mut self, flight: &Flight) -> Self {
        if !self.acts() {
            return self;
        }
        let (law, law_std) = self.times_law;
        for _ in 0..ROUNDS {
            let times = self.times_law.0;
            let Some((slope, curvature)) = self.misfit(times, flight) else {
                break;
            };
            let information = curvature + law_std.powi(-2);
            let found = times + ((law - times) * law_std.powi(-2) - slope) / information;
            let is_lift = (0.0..=MOST_LIFT).contains(&found);
            let std = if is_lift { information.powf(-0.5) } else { law_std };
            self.times_law = (found.clamp(0.0, MOST_LIFT), std);
        }
        self
    }

    /// Half of χ² of the arcs without so many `times` the law's lift: how it follows that number, and how that follows it. Errors that last
    /// from point to point count once.
    fn misfit(&self, times: f64, flight: &Flight) -> Option<(f64, f64)> {
        let without = |times: f64| {
            let law = Self {
                times_law: (times, 0.0),
                ..self.clone()
            };
            law.taken_from(flight)
        };
        let (less, more) = rayon::join(|| without(times), || without(times + PROBE));
        let (less, more) = (less?, more?);
        let (mut slope, mut curvature) = (0.0, 0.0);
        for (p, q) in less.fit_points().iter().zip(more.fit_points()) {
            let residual = |flight: &Flight, s: &TrackSample| {
                let m = flight.fit.motion(p.arc, s.t);
                (s.r - m.r, s.h - m.h)
            };
            let (here, there) = (residual(&less, &p.sample), residual(&more, &q.sample));
            let by = ((there.0 - here.0) / PROBE, (there.1 - here.1) / PROBE);
            slope += p.sample.weight * (here.0 * by.0 + here.1 * by.1);
            curvature += p.sample.weight * (by.0 * by.0 + by.1 * by.1);
        }
        let scatter = less.fit.reduced_chi.max(1.0).powi(2) * less.fit.autocorrelation_inflation;
        Some((slope / scatter, curvature / scatter))
    }

    /// Whether there is lift on any arc.
    #[must_use]
    pub fn acts(&self) -> bool {
        self.spins.iter().flatten().any(|&s| s != 0.0)
    }

    fn spin(&self, arc: usize) -> Option<f64> {
        self.spins.get(arc).copied().flatten()
    }

    /// What so many `times` the law's lift adds to the motion without it on `arc` from the arc's mean time to `t`.
    #[must_use]
    pub fn motion(&self, planar: &PlanarArcs<'_>, arc: usize, t: f64, times: f64) -> Motion {
        let spin = self.spin(arc).unwrap_or(0.0);
        if spin == 0.0 {
            return Motion {
                r: 0.0,
                h: 0.0,
                vr: 0.0,
                vh: 0.0,
            };
        }
        // What is fitted as drag has some of the lift in it, as long as that is in the points.
        let fitted = || planar.parameters[DRAG] / USUAL_DRAG;
        let air = planar.law.air().unwrap_or_else(fitted);
        planar.pushed_by(arc, t, |vr, vh| {
            let speed = speed(vr, vh);
            let share = speed + 2.0 * spin.abs();
            let push = times * air * spin * speed / share;
            (push * vh, -push * vr)
        })
    }

    /// `flight` with its points moved back by what lift did to them; `None` where those have no arcs.
    #[must_use]
    pub fn taken_from(&self, flight: &Flight) -> Option<Flight> {
        if !self.bends(flight) {
            return Some(flight.clone());
        }
        let times = self.times_law.0;
        let moved = |along: &Flight| flight.moved(|spot, arc| self.way_back(along, arc, spot.time_s, times));
        let mut free = moved(flight)?;
        let mut before = flight.clone();
        for _ in 1..PASSES {
            let is_settled = flight.used_points().all(|p| {
                let Some(arc) = p.arc() else { return true };
                let way = |along: &Flight| self.way_back(along, arc, p.spot.time_s, times);
                let ((r, h), (r_before, h_before)) = (way(&free), way(&before));
                (r - r_before).hypot(h - h_before) < SETTLED_PART * p.spot.std
            });
            if is_settled {
                break;
            }
            let next = moved(&free)?;
            before = std::mem::replace(&mut free, next);
        }
        Some(free)
    }

    /// How the arcs' parameters change when the points of a `flight` without lift are moved back once more by the law's lift; `None` where nothing is
    /// to be moved.
    #[must_use]
    pub fn response(&self, flight: &Flight) -> Option<DVector<f64>> {
        if !self.bends(flight) {
            return None;
        }
        let points = flight.fit_points();
        let (times, more) = (self.times_law.0, self.times_law.0 + PROBE);
        let shift = |p: &FitPoint| {
            let way = |times: f64| self.way_back(flight, p.arc, p.sample.t, times);
            let ((r, h), (r_more, h_more)) = (way(times), way(more));
            ((r_more - r) / PROBE, (h_more - h) / PROBE)
        };
        let shifts: Vec<(f64, f64)> = points.iter().map(shift).collect();
        flight.fit.response(&points, &shifts)
    }

    /// Whether lift moves the points of `flight`.
    fn bends(&self, flight: &Flight) -> bool {
        flight.fit.drag() != 0.0 && self.acts()
    }

    /// By what a point of an arc is moved back at a time, plane units, were lift so many `times` the law's and the way without it as `along` has it.
    fn way_back(&self, along: &Flight, arc: usize, time_s: f64, times: f64) -> (f64, f64) {
        let fit = &along.fit;
        let planar = fit.planar(fit.parameters.as_slice());
        let m = self.motion(&planar, arc, time_s, times);
        (-m.r, -m.h)
    }

    /// Standard uncertainty of lift over drag on `arc`, beyond that of the lift that a known spin makes
    /// ([`KNOWN_SPIN_LIFT_STD`]).
    #[must_use]
    pub fn std_over_drag(&self, arc: usize) -> f64 {
        self.spin(arc).map_or(UNKNOWN_SPIN_LIFT_STD, |_| NO_SPIN_LIFT_STD)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::drag::{Drag, DragLaw};

    #[test]
    fn lift_of_a_known_ball_does_not_follow_the_fitted_drag() {
        let drag = Drag::of_sphere((0.012, 0.0082), 1.0, 1.5, 0.1);
        let lift = SpinLift::new(vec![Some(0.3)]);
        let moved = |part: f64| {
            let level = PlanarArcs {
                parameters: &[9.81, part * drag.beta, 0.0, 0.0, 1.5, 0.0, 0.0],
                times: &[0.0],
                law: drag.law,
                bent: false,
            };
            lift.motion(&level, 0, 1e-3, 1.0)
        };
        assert!((moved(1.3).vh / moved(1.0).vh - 1.0).abs() < 1e-3);
        // (ρ π R²/2m) Rω v²/(v + 2 Rω), downwards.
        let air = 1.204 * std::f64::consts::PI * 0.012_f64.powi(2) / (2.0 * 0.0082);
        let expected = -air * 0.3 * 1.5 * 1.5 / 2.1;
        assert!((moved(1.0).vh / 1e-3 / expected - 1.0).abs() < 1e-3);
    }

    #[test]
    fn topspin_pushes_a_rising_ball_forward_and_down() {
        // g, drag, across, then r, vr, h, vh.
        let rising = PlanarArcs {
            parameters: &[9.81, 0.02, 0.0, 0.0, 1.0, 0.0, 2.0],
            times: &[0.0],
            law: DragLaw::default(),
            bent: false,
        };
        let lift = SpinLift::new(vec![Some(1.0)]);
        let m = lift.motion(&rising, 0, 0.05, 1.0);
        assert!(m.vr > 0.0 && m.vh < 0.0 && m.r > 0.0 && m.h < 0.0, "{m:?}");
        let back = SpinLift::new(vec![Some(-1.0)]).motion(&rising, 0, 0.05, 1.0);
        // To first order.
        assert!((m.vr + back.vr).abs() < 0.01 * m.vr && (m.h + back.h).abs() < 0.01 * m.h.abs());
        let none = SpinLift::new(vec![None]).motion(&rising, 0, 0.05, 1.0);
        assert_eq!((none.r, none.vr, none.h, none.vh), (0.0, 0.0, 0.0, 0.0));
        assert!(SpinLift::new(vec![None]).std_over_drag(0) > lift.std_over_drag(0));
    }
}
