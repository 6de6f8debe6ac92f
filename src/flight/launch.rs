//! Where the ball leaves a bench: a straight line of points that leads into the first arc.
//!
//! On a bench the ball keeps its velocity across the fall; in the air it gains g t. With y along the common acceleration
//! a of all arcs and s the rate of y on the bench,
//!
//! ```text
//! y_bench(t) = y_b + s (t − t_m)        y_arc'(t_e) = s        gap = y_arc(t_e) − y_bench(t_e)
//! ```
//!
//! so that line and arc part at t_e, the vertex of the arc where the bench is level, and meet there: gap = 0. A gap that stands
//! out is a ball that was not simply released: it tipped round the edge (slower than √(g R)), was pushed over a step, or
//! left a hand. Then the place of the edge is not reported.
//!
//! Assumed: the bench is straight, and the ball follows it for three frames or more at a steady y; its speed along the
//! bench may change. What does not look like that before the first arc (a rise, a hand's curve) is no bench, and there
//! is no launch.

use super::free_flight::{Flight, FlightPoint, PlaneLaunch, SpotUse};
use super::motion_model::lean_rad;
use super::planar::{ACROSS, GRAVITY};
use crate::quantity::Quantity;

/// Fewer points than this are no line.
const LEAST_POINTS: usize = 3;

/// The last point on the line and the edge are no further apart than so many frames, or s.
const LOST_FRAMES: f64 = 4.0;
const LOST_S: f64 = 0.05;

/// Windows before the edge in which the line is looked for, s: the longest in which the points lie on one.
const WINDOWS_S: [f64; 6] = [1.0, 0.5, 0.25, 0.12, 0.06, 0.03];

/// Points lie on a line where their squared distances are no more than this many times what they should be.
const MOST_SCATTER: f64 = 3.0;

/// The line must explain the points before the edge better than the arc does by so many squared standard deviations.
const LEAST_EVIDENCE: f64 = 25.0;

/// A bench is level to this angle, rad.
const LEVEL_RAD: f64 = 0.15;

/// The launch before the first arc of `flight`; `None` where no straight line leads into it.
#[must_use]
pub fn find(flight: &Flight) -> Option<PlaneLaunch> {
    let fit = &flight.fit;
    let p = fit.parameters.as_slice();
    let size = p[GRAVITY].hypot(p[ACROSS]);
    if !(fit.falls_in_plane() && size > 0.0) {
        return None;
    }
    let (sin, cos) = lean_rad(p).sin_cos();
    let fall = FallAxes { sin, cos };
    // First guess: the vertex of the arc; then where its y changes as the line's does.
    let mut rate = 0.0;
    let mut found = None;
    for _ in 0..4 {
        let time_s = parting_time(flight, &fall, size, rate)?;
        let line = line_before(flight, &fall, time_s)?;
        rate = line.rate.0;
        found = Some((time_s, line));
    }
    let (_, line) = found?;
    let time_s = parting_time(flight, &fall, size, rate)?;
    let there = fit.motion(0, time_s);
    let on_line = line.at(time_s);
    let launch = PlaneLaunch {
        time_s,
        from_s: line.from_s,
        rate: line.rate,
        height: (-on_line.0, on_line.1),
        gap: (fall.down(there.r, there.h) - on_line.0, on_line.1),
        moved_radii: line.moved / line.radius,
    };
    // Along the line, the ball is as fast on the bench as in the air.
    let along = fall.along(there.vr, there.vh);
    let level = line.rate.0.abs() <= LEVEL_RAD * along.abs() + 4.0 * line.rate.1;
    level.then_some(launch)
}

/// When the y of the first arc changes at `rate`.
fn parting_time(flight: &Flight, fall: &FallAxes, size: f64, rate: f64) -> Option<f64> {
    let mut t = flight.fit.times[0];
    // Exact at once without drag, which is a small part.
    for _ in 0..4 {
        let m = flight.fit.motion(0, t);
        t -= (fall.down(m.vr, m.vh) - rate) / size;
    }
    // Far from the arc it says nothing.
    let (from, to) = flight.spans[0];
    (t > from - (to - from) - LOST_S && t < to).then_some(t)
}

/// Along the fall and across it.
struct FallAxes {
    sin: f64,
    cos: f64,
}

impl FallAxes {
    /// y: along the common acceleration.
    fn down(&self, r: f64, h: f64) -> f64 {
        r * self.sin - h * self.cos
    }

    fn along(&self, r: f64, h: f64) -> f64 {
        r * self.cos + h * self.sin
    }
}

/// A straight line in y against time.
struct BenchLine {
    from_s: f64,
    middle_s: f64,
    /// y at the middle, and its standard uncertainty.
    y: (f64, f64),
    rate: (f64, f64),
    moved: f64,
    radius: f64,
}

impl BenchLine {
    /// y at a time, with its standard uncertainty.
    fn at(&self, t: f64) -> (f64, f64) {
        let dt = t - self.middle_s;
        (self.y.0 + self.rate.0 * dt, self.y.1.hypot(self.rate.1 * dt))
    }
}

/// The line that leads to `time_s`.
fn line_before(flight: &Flight, fall: &FallAxes, time_s: f64) -> Option<BenchLine> {
    let lost_s = LOST_S.max(LOST_FRAMES * flight.interval_s);
    let mut run: Vec<&FlightPoint> = Vec::new();
    let mut last_s = time_s;
    for p in flight.points.iter().rev() {
        let elsewhere = matches!(p.use_, SpotUse::Used(k) if k > 0);
        if p.spot.time_s >= time_s || elsewhere {
            continue;
        }
        if last_s - p.spot.time_s > lost_s {
            break;
        }
        last_s = p.spot.time_s;
        run.push(p);
    }
    run.reverse();
    WINDOWS_S.iter().find_map(|window_s| {
        let from = run.partition_point(|p| p.spot.time_s < time_s - window_s);
        straight(flight, fall, &run[from..])
    })
}

/// The line through `run`, where its points lie on one and not on the first arc.
fn straight(flight: &Flight, fall: &FallAxes, run: &[&FlightPoint]) -> Option<BenchLine> {
    let (first, last) = (run.first()?, run.last()?);
    if run.len() < LEAST_POINTS {
        return None;
    }
    let y = |p: &FlightPoint| fall.down(p.spot.place.right, p.spot.place.up);
    let weight = |p: &FlightPoint| 1.0 / flight.extra.variance_of(&p.spot);
    let sum = |of: &dyn Fn(&FlightPoint) -> f64| run.iter().map(|p| of(p)).sum::<f64>();
    let all = sum(&weight);
    let middle_s = first.spot.time_s + sum(&|p| weight(p) * (p.spot.time_s - first.spot.time_s)) / all;
    let mean = y(first) + sum(&|p| weight(p) * (y(p) - y(first))) / all;
    let t = |p: &FlightPoint| p.spot.time_s - middle_s;
    let spread = sum(&|p| weight(p) * t(p) * t(p));
    let rate = sum(&|p| weight(p) * t(p) * (y(p) - mean)) / spread;
    let off_line = sum(&|p| weight(p) * (y(p) - mean - rate * t(p)).powi(2));
    let off_arc = sum(&|p| {
        let m = flight.fit.motion(0, p.spot.time_s);
        weight(p) * (y(p) - fall.down(m.r, m.h)).powi(2)
    });
    let freedom = run.len().saturating_sub(2).max(1) as f64;
    // Errors that last from frame to frame make a line of few points better than it is.
    let scatter = (off_line / freedom).max(1.0) * flight.fit.autocorrelation_inflation.max(1.0);
    let is_line = off_line < MOST_SCATTER * MOST_SCATTER * freedom && off_arc - off_line > LEAST_EVIDENCE;
    let q = |value: f64, information: f64| Quantity::new(value, (scatter / information).sqrt());
    let (y, rate) = (q(mean, all)?, q(rate, spread)?);
    let along = |p: &FlightPoint| fall.along(p.spot.place.right, p.spot.place.up);
    is_line.then_some(BenchLine {
        from_s: first.spot.time_s,
        middle_s,
        y: (y.value, y.std_uncertainty?),
        rate: (rate.value, rate.std_uncertainty?),
        moved: (along(last) - along(first)).abs(),
        radius: last.spot.radius,
    })
}
