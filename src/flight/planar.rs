//! Motion of a ball seen from the side: parabolas, or what drag makes of them.

use super::drag::DragLaw;
use nalgebra::{Matrix2, SMatrix, Vector2};

/// State of a free flight at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Plane units.
    pub r: f64,
    /// Plane units.
    pub h: f64,
    /// Plane units a second.
    pub vr: f64,
    /// Plane units a second.
    pub vh: f64,
}

impl Motion {
    /// This motion and `s` times a `slope` of it.
    pub fn along(&self, slope: &Self, s: f64) -> Self {
        Self {
            r: self.r + s * slope.r,
            h: self.h + s * slope.h,
            vr: self.vr + s * slope.vr,
            vh: self.vh + s * slope.vh,
        }
    }
}

/// A step `s` of the Runge-Kutta method of fourth order from `m`, whose slope is `rate`; `along` adds a part of a slope.
pub(super) fn runge_kutta_step<M>(
    m: &M,
    s: f64,
    rate: impl Fn(&M) -> M,
    along: impl Fn(&M, &M, f64) -> M,
) -> M {
    let a = rate(m);
    let b = rate(&along(m, &a, 0.5 * s));
    let c = rate(&along(m, &b, 0.5 * s));
    let d = rate(&along(m, &c, s));
    let m = along(m, &a, s / 6.0);
    let m = along(&m, &b, s * 2.0 / 6.0);
    let m = along(&m, &c, s * 2.0 / 6.0);
    along(&m, &d, s / 6.0)
}

/// Index of gravity in the parameters.
pub const GRAVITY: usize = 0;
/// Index of drag in the parameters.
pub const DRAG: usize = 1;
/// Index of the acceleration along r, which all arcs share as they share gravity: the fall of a picture whose "up" is not
/// quite the plane's.
pub const ACROSS: usize = 2;
/// Index of the first arc's place in the parameters; four an arc: r, vr, h, vh at the arc's mean time.
pub const ARCS: usize = 3;

/// Along r and h, by each of the parameters of an arc's place that are not the place itself: its velocity along r and h, then those that all arcs
/// share.
pub type PlaceSlopes = SMatrix<f64, 2, { 2 + ARCS }>;

/// Powers of the time from an arc's mean one, in which a bent arc departs from what gravity and drag make of it.
pub const BEND_POWERS: [i32; 2] = [2, 3];

/// Steps of an integration from an arc's mean time.
const PARTS: usize = 8;

/// Steps to where two arcs meet at most, and the part of the time between them below which the next one is the last: each is a hundredth or less of the
/// one before.
const MOST_STEPS_TO_IMPACT: usize = 6;
const IMPACT_SETTLED_PART: f64 = 1e-6;

/// Parameters of an arc's bend: the coefficients of [`BEND_POWERS`] along r, then along h.
pub const BENDS: usize = 2 * BEND_POWERS.len();

/// A motion, and how its velocity and its place follow the parameters.
#[derive(Clone, Copy)]
struct ArcState {
    motion: Motion,
    rates: PlaceSlopes,
    places: PlaceSlopes,
}

/// The arcs of a parameter vector: g (down along h), β, the acceleration along r, then r, vr, h, vh of each arc at its mean
/// time; where arcs are bent, then [`BENDS`] coefficients of each.
#[derive(Debug, Clone, Copy)]
pub struct PlanarArcs<'a> {
    /// The parameters; there may be more behind them.
    pub parameters: &'a [f64],
    /// Mean time of each arc, s.
    pub times: &'a [f64],
    /// How drag changes with the speed.
    pub law: DragLaw,
    /// Whether the arcs are bent.
    pub bent: bool,
}

impl PlanarArcs<'_> {
    /// What the bend of arc `k` adds to its motion `dt` after its mean time.
    fn bend(&self, k: usize, dt: f64) -> Motion {
        let from = ARCS + 4 * self.times.len() + BENDS * k;
        let (along_r, along_h) = self.parameters[from..from + BENDS].split_at(BEND_POWERS.len());
        let sum =
            |c: &[f64], of: &dyn Fn(i32) -> f64| c.iter().zip(BEND_POWERS).map(|(c, n)| c * of(n)).sum();
        let place = |n: i32| dt.powi(n);
        let rate = |n: i32| f64::from(n) * dt.powi(n - 1);
        Motion {
            r: sum(along_r, &place),
            vr: sum(along_r, &rate),
            h: sum(along_h, &place),
            vh: sum(along_h, &rate),
        }
    }

    /// r, vr, h, vh of arc `k` at its mean time.
    fn arc(&self, k: usize) -> &[f64] {
        &self.parameters[ARCS + 4 * k..ARCS + 4 * k + 4]
    }

    /// What an acceleration `field` of the velocity (along r and h) adds to the motion on arc `k` from its mean time to `t`: the way of a ball that it
    /// acts on less that of one that it does not, both in the same air.
    #[must_use]
    pub fn pushed_by(&self, k: usize, t: f64, field: impl Fn(f64, f64) -> (f64, f64)) -> Motion {
        let free = self.start(k);
        let dt = (t - self.times[k]) / PARTS as f64;
        let (free, pushed) = (0..PARTS).fold((free, free), |(free, pushed), _| {
            (
                self.integrated(free, dt, |_, _| (0.0, 0.0)),
                self.integrated(pushed, dt, &field),
            )
        });
        pushed.along(&free, -1.0)
    }

    /// Motion on arc `k` at time `t`.
    #[must_use]
    pub fn motion(&self, k: usize, t: f64) -> Motion {
        let straight = self.motion_without_bend(k, t);
        if self.bent {
            straight.along(&self.bend(k, t - self.times[k]), 1.0)
        } else {
            straight
        }
    }

    fn motion_without_bend(&self, k: usize, t: f64) -> Motion {
        let (g, across) = (self.parameters[GRAVITY], self.parameters[ACROSS]);
        let a = self.arc(k);
        let dt = t - self.times[k];
        if self.parameters[DRAG] == 0.0 {
            return Motion {
                r: a[0] + (a[1] + 0.5 * across * dt) * dt,
                h: a[2] + (a[3] - 0.5 * g * dt) * dt,
                vr: a[1] + across * dt,
                vh: a[3] - g * dt,
            };
        }
        self.integrate(self.start(k), dt)
    }

    /// Motion on arc `k` at its mean time, but for a bend, which adds nothing there.
    fn start(&self, k: usize) -> Motion {
        let a = self.arc(k);
        Motion {
            r: a[0],
            vr: a[1],
            h: a[2],
            vh: a[3],
        }
    }

    /// Motions on arc `k` at `times`, as [`motion`](Self::motion) gives them one by one, and how each place follows the parameters (that of drag only where
    /// `pushed`): all in one pass from the mean time to both ends, in steps no longer than there.
    #[must_use]
    pub fn motions(&self, k: usize, times: &[f64], pushed: bool) -> Vec<(Motion, PlaceSlopes)> {
        if !pushed && self.parameters[DRAG] == 0.0 {
            let free = |&t: &f64| {
                let dt = t - self.times[k];
                let (velocity, force) = (dt, 0.5 * dt * dt);
                let mut slopes = PlaceSlopes::zeros();
                slopes.fixed_columns_mut::<2>(0).fill_diagonal(velocity);
                slopes[(1, 2 + GRAVITY)] = -force;
                slopes[(0, 2 + ACROSS)] = force;
                (self.motion(k, t), slopes)
            };
            return times.iter().map(free).collect();
        }
        let mean_s = self.times[k];
        let longest_s = times
            .iter()
            .fold(0.0, |most: f64, t| most.max((t - mean_s).abs()))
            / PARTS as f64;
        let start = ArcState {
            motion: self.start(k),
            rates: PlaceSlopes::identity(),
            places: PlaceSlopes::zeros(),
        };
        let mut order: Vec<usize> = (0..times.len()).collect();
        order.sort_by(|&a, &b| times[a].total_cmp(&times[b]));
        let later = order.partition_point(|&i| times[i] < mean_s);
        let mut found = vec![(start.motion, start.places); times.len()];
        let (before, after) = order.split_at(later);
        let mut along = |way: &mut dyn Iterator<Item = usize>| {
            let (mut now, mut at_s) = (start, mean_s);
            for i in way {
                let parts = ((times[i] - at_s).abs() / longest_s).ceil().max(1.0);
                let s = (times[i] - at_s) / parts;
                for _ in 0..parts as usize {
                    now = self.step(&now, s);
                }
                at_s = times[i];
                let bent = if self.bent {
                    now.motion.along(&self.bend(k, times[i] - mean_s), 1.0)
                } else {
                    now.motion
                };
                found[i] = (bent, now.places);
            }
        };
        along(&mut before.iter().rev().copied());
        along(&mut after.iter().copied());
        found
    }

    /// A step `s` of a motion and of its slopes: these by the implicit midpoint rule, whose error, of the third order, is one of the small part that drag
    /// has in them.
    fn step(&self, now: &ArcState, s: f64) -> ArcState {
        let (g, beta, across) = (
            self.parameters[GRAVITY],
            self.parameters[DRAG],
            self.parameters[ACROSS],
        );
        let m = &now.motion;
        let motion = if beta == 0.0 {
            Motion {
                r: m.r + (m.vr + 0.5 * across * s) * s,
                h: m.h + (m.vh - 0.5 * g * s) * s,
                vr: m.vr + across * s,
                vh: m.vh - g * s,
            }
        } else {
            self.integrated(*m, s, |_, _| (0.0, 0.0))
        };
        // −β κ(v) v **v** by the velocity, and by β.
        let middle = 0.5 * Vector2::new(m.vr + motion.vr, m.vh + motion.vh);
        let speed = middle.norm();
        let (at, slope) = self.law.at_and_slope(speed);
        let along = middle.unscale(speed.max(f64::MIN_POSITIVE));
        let more = (at + slope) * speed * along * along.transpose();
        let by_velocity = -beta * (at * speed * Matrix2::identity() + more);
        let mut by_parameters = PlaceSlopes::zeros();
        by_parameters[(1, 2 + GRAVITY)] = -1.0;
        by_parameters[(0, 2 + ACROSS)] = 1.0;
        by_parameters.set_column(2 + DRAG, &(-at * speed * middle));
        let half = 0.5 * s * by_velocity;
        let back = Matrix2::identity() - half;
        let rates = (now.rates + half * now.rates) + s * by_parameters;
        let rates = back.try_inverse().map_or(rates, |inverse| inverse * rates);
        ArcState {
            motion,
            places: now.places + 0.5 * s * (now.rates + rates),
            rates,
        }
    }

    /// Runge-Kutta of fourth order over `dt` in eight steps: with drag a tenth of gravity the error is below 1e-7 of the
    /// way.
    fn integrate(&self, start: Motion, dt: f64) -> Motion {
        (0..PARTS).fold(start, |m, _| {
            self.integrated(m, dt / PARTS as f64, |_, _| (0.0, 0.0))
        })
    }

    /// One such step, `s` long, under an acceleration `field` of the velocity beside. The drag coefficient, which hardly changes in it, is that of
    /// its middle.
    fn integrated(&self, m: Motion, s: f64, field: impl Fn(f64, f64) -> (f64, f64)) -> Motion {
        let (g, beta) = (self.parameters[GRAVITY], self.parameters[DRAG]);
        let across = self.parameters[ACROSS];
        let rate = |m: &Motion, beta: f64| {
            let slow = -beta * speed(m.vr, m.vh);
            let (along_r, along_h) = field(m.vr, m.vh);
            Motion {
                r: m.vr,
                h: m.vh,
                vr: slow * m.vr + across + along_r,
                vh: slow * m.vh - g + along_h,
            }
        };
        let beta = beta * self.law.at(speed(m.vr + 0.5 * across * s, m.vh - 0.5 * g * s));
        runge_kutta_step(&m, s, |m| rate(m, beta), Motion::along)
    }

    /// When and how closely arcs `a` and `b` meet: (time, distance there). `None` when the two
    /// have the same velocity.
    ///
    /// With one gravity and no drag the difference of two arcs is linear in time, so the time of least distance is a
    /// quotient, without a root; drag is settled by repeating it.
    #[must_use]
    pub fn intersection(&self, a: usize, b: usize) -> Option<(f64, f64)> {
        let mut t = 0.5 * (self.times[a] + self.times[b]);
        if self.parameters[DRAG] != 0.0 || self.bent {
            // A single step of integration goes on from where the arcs are once they were followed to the middle between them: what it is off by is
            // gone with the last step, of which the arcs are followed from their mean times.
            let mut motions = [a, b].map(|k| self.motion_without_bend(k, t));
            for _ in 0..MOST_STEPS_TO_IMPACT {
                let mut seen = motions;
                if self.bent {
                    for (m, k) in seen.iter_mut().zip([a, b]) {
                        *m = m.along(&self.bend(k, t - self.times[k]), 1.0);
                    }
                }
                let (step, _) = closest_approach(&seen[0], &seen[1])?;
                motions = motions.map(|m| self.integrated(m, step, |_, _| (0.0, 0.0)));
                t += step;
                if !(step.abs() > IMPACT_SETTLED_PART * (self.times[b] - self.times[a]).abs()) {
                    break;
                }
            }
        }
        let (step, gap) = closest_approach(&self.motion(a, t), &self.motion(b, t))?;
        t += step;
        (t.is_finite() && gap.is_finite()).then_some((t, gap))
    }

    /// Time after `t` at which arc `k`, rising at `t`, is back at its height of then; NaN when it does not rise.
    #[must_use]
    pub fn return_time(&self, k: usize, t: f64) -> f64 {
        let start = self.motion(k, t);
        let g = self.parameters[GRAVITY];
        if !(g > 0.0 && start.vh > 0.0) {
            return f64::NAN;
        }
        let mut duration = 2.0 * start.vh / g;
        if self.parameters[DRAG] != 0.0 || self.bent {
            for _ in 0..6 {
                let m = self.motion(k, t + duration);
                duration -= (m.h - start.h) / m.vh;
            }
        }
        duration
    }
}

/// Length of a velocity. A ball's speed is nowhere near what a number can hold, which is all that `hypot` takes its time for.
#[must_use]
pub fn speed(vr: f64, vh: f64) -> f64 {
    (vr * vr + vh * vh).sqrt()
}

/// In how long two straight motions are closest, and their distance then. `None` when they have the same velocity.
#[must_use]
pub fn closest_approach(p: &Motion, q: &Motion) -> Option<(f64, f64)> {
    let (dr, dh) = (q.r - p.r, q.h - p.h);
    let (dvr, dvh) = (q.vr - p.vr, q.vh - p.vh);
    let speed2 = dvr * dvr + dvh * dvh;
    let step = -(dr * dvr + dh * dvh) / speed2;
    (speed2 > 0.0).then(|| (step, (dr + dvr * step).hypot(dh + dvh * step)))
}

#[cfg(test)]
mod tests {
    use super::super::drag::Drag;
    use super::*;

    #[test]
    fn slopes_are_how_places_follow_the_parameters() {
        // A table tennis ball, which the air slows as much as gravity pulls.
        let drag = Drag::of_sphere((0.02, 0.0027), 1.0, 6.0, 0.1);
        let times_s = [-0.3, -0.1, 0.02, 0.25];
        let places = |parameters: &[f64], law: DragLaw| {
            let arcs = PlanarArcs {
                parameters,
                times: &[0.01],
                law,
                bent: false,
            };
            arcs.motions(0, &times_s, true)
        };
        for (beta, law) in [(drag.beta, drag.law), (0.1, DragLaw::default()), (0.0, drag.law)] {
            let parameters = [9.81, beta, 0.3, 1.0, 8.0, 0.5, -3.0];
            let here = places(&parameters, law);
            let columns = [4, 6, GRAVITY, DRAG, ACROSS];
            for (column, i) in [0, 1, 2 + GRAVITY, 2 + DRAG, 2 + ACROSS].into_iter().zip(columns) {
                let step = 1e-4;
                let mut there = parameters;
                there[i] += step;
                for ((m, slopes), (moved, _)) in here.iter().zip(places(&there, law)) {
                    let found = Vector2::new(moved.r - m.r, moved.h - m.h) / step;
                    let slope = slopes.column(column);
                    assert!(
                        (slope - found).norm() < 0.015 * slope.norm().max(0.01),
                        "β {beta}, parameter {i}: {slope} for {found}"
                    );
                }
            }
        }
    }
}
