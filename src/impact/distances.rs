//! x0 from the launch edge to the first bounce, x from there to the second.

use super::inputs::InputValues;
use super::motion::MeasuredMotion;
use super::{Bounce, BounceSurface, Distances, XSource, top_view};
use crate::calibration::View;
use crate::quantity::Quantity;

impl MeasuredMotion<'_> {
    /// x0 from the edge to the first bounce, x from the first to the second (seen, or where the rebound's arc comes
    /// down to the first impact's height). `bounces` by [`Self::bounces`].
    #[must_use]
    pub fn distances(&self, bounces: &[(usize, Bounce)]) -> Distances {
        let found = self.distances_of(bounces);
        if self.bend().is_some() {
            return Distances {
                x0_m: found.x0_m.and_then(top_view::undetermined),
                x_m: found.x_m.and_then(top_view::undetermined),
                ..found
            };
        }
        found
    }

    fn distances_of(&self, bounces: &[(usize, Bounce)]) -> Distances {
        let mut floors = bounces.iter().filter(|(_, b)| b.surface == BounceSurface::Floor);
        let Some(&(first, _)) = floors.next() else {
            return Distances::default();
        };
        // Not the first after the edge: x from it is not the one meant.
        if !self.launch_seen {
            return Distances::default();
        }
        // Where the ball touches, as the time is when it does.
        let place = |p: &InputValues<'_>, k: usize| self.impact(p, k).1.r;
        let x0_m = self.edge_distance(first, &place);
        let apart = |p: &InputValues<'_>| p.errors.place_right * self.scale(p);
        // Seen, when the very next impact is on the floor too.
        let (x_m, x_source) = match floors.next() {
            Some(&(second, _)) if second == first + 1 => {
                let seen = |p: &InputValues<'_>| place(p, second) - place(p, first) + apart(p);
                (self.inputs.quantity(seen), XSource::Observed)
            }
            // Nothing comes down through a ceiling.
            _ if self.calibration.view == View::Top
                || self.surface(first + 1) == Some(BounceSurface::Ceiling) =>
            {
                return Distances {
                    x0_m,
                    ..Distances::default()
                };
            }
            _ => {
                let continued = self.inputs.quantity(|p| {
                    let (t, touch, _) = self.impact(p, first);
                    let down = self.back_at(p, first + 1, t, (touch.r, touch.h));
                    self.world(p, first + 1, down).r - touch.r + apart(p)
                });
                (continued, XSource::Extrapolated)
            }
        };
        Distances {
            x0_m,
            x_m,
            x_source: x_m.map(|_| x_source),
        }
    }

    /// When arc `k`, rising about `t`, comes down to the floor through the place (x, z) of the touch before, lift included: the
    /// rebound's own arc is still below that then, as the ball stays down for a while.
    fn back_at(&self, p: &InputValues<'_>, k: usize, t: f64, (x, z): (f64, f64)) -> f64 {
        let slope = self.slope(p).tan();
        let mut down = t + self.flight.fit.planar(p.arcs).return_time(k, t);
        for _ in 0..5 {
            let m = self.world(p, k, down);
            down -= (m.h - z - slope * (m.r - x)) / (m.vh - slope * m.vr);
        }
        down
    }

    /// Whether the arc before the first impact can have begun at the edge: followed back to there, it is not below the
    /// floor. If it is, an impact before was missed.
    pub(super) fn comes_from(&self, edge_m: f64, first: usize) -> bool {
        if self.calibration.view == View::Top {
            return true;
        }
        let p = &self.inputs.best();
        let (t, before, _) = self.impact(p, first);
        if first != 0 || !(before.vr.abs() > 1e-9) {
            return first == 0;
        }
        let back_s = (before.r - edge_m) / before.vr;
        let there = self.world(p, 0, t - back_s);
        // A tenth of the fall's height for what extrapolation and drag make of it.
        let fall_m = before.vh * before.vh / (2.0 * p.fall() * self.scale(p));
        !(back_s > 0.0) || there.h > before.h - 0.1 * fall_m
    }

    fn edge_distance(
        &self,
        first: usize,
        place: &(impl Fn(&InputValues<'_>, usize) -> f64 + Sync),
    ) -> Option<Quantity> {
        if let Some(edge_m) = self.calibration.launch.edge_x_m {
            let distance = || self.inputs.quantity(|p| place(p, first) - edge_m);
            return self.comes_from(edge_m, first).then(distance).flatten();
        }
        if self.calibration.has_origin() || self.calibration.view == View::Top || first != 0 {
            return None;
        }
        if self.flight.launch.is_some() {
            // Both places are the ball's: what all centres share is in neither.
            self.bench_launch()?.edge_x_m?;
            return self.inputs.quantity(|p| {
                let apart = p.errors.place_right * self.scale(p);
                place(p, first) - self.edge_place(p).map_or(f64::NAN, |e| e.r) + apart
            });
        }
        // A horizontal launch is level where it begins, and fast: the apex is the edge.
        let apex = |p: &InputValues<'_>| self.vertex_s(p);
        let start = self.flight.spans[0].0;
        let best = apex(&self.inputs.best());
        // A ball that leaves an edge more slowly than √(g R) tips round it: slower ones were dropped by a hand.
        let p = &self.inputs.best();
        let (speed, fall) = (self.world(p, 0, best).vr.abs(), p.fall() * self.scale(p));
        let tips_m_s = (fall * self.flight.radius() * self.scale(p)).sqrt();
        let level = (best - start).abs() < 2.0 * self.flight.interval_s && speed > tips_m_s;
        let distance = || {
            self.inputs
                .quantity(|p| place(p, first) - self.world(p, 0, apex(p)).r)
        };
        level.then(distance).flatten()
    }
}
