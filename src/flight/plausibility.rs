//! Whether fitted arcs are a ball's free flight, and which of them is none: carried, rolling, or chance.

use super::arc_selection::{WEAK_POINTS, goes_far};
use super::free_flight::{Flight, SpotUse};
use super::impact_test::impact_between;
use super::parabola::own_fall;
use super::samples::{FINE_PART, shows_fall};
use super::segment::TrackSample;
use crate::numeric::robust::median;
use std::ops::Range;

/// Least part of a flight's points on arcs whose own curve shows the common fall, or that go far up or down.
const LEAST_CURVED_PART: f64 = 0.6;

/// Least part of the points between a flight's first and last that lie on its arcs. A swinging hand follows a
/// parabola now and then; a ball does nothing else.
const LEAST_FREE_PART: f64 = 0.6;

/// Half of a flight's points are closer to their arcs than this, in the segmentation's standard deviations, ...
pub(super) const MOST_SCATTER: f64 = 2.0;

/// ... or than this part of the arc's sagitta: a ball of few pixels far away, a little nearer to the camera at one end.
const SAGITTA_PART: f64 = 0.015;

/// Nobody holds a camera further from level than this without saying so; what leans more is no fall, rad.
const MOST_LEAN_RAD: f64 = 0.26;

/// An arc whose own fall differs from the common one by this many standard uncertainties, and this part of it (drag), is
/// none. Fewer than for arcs found by their curve: three of a hundred are wrongly let go, which costs a bounce.
const CARRIED_SIGMAS: f64 = 3.0;
const CARRIED_PART: f64 = 0.1;

/// Of so few points an arc shows no fall of its own.
const FEW_POINTS: usize = 8;

/// An impact after so few points turns the velocity by more than this part of it: scatter turns it by some.
const LEAST_TURN: f64 = 0.35;

/// Beyond this, scatter that lasts from frame to frame is a path bent by perspective, a moving camera or air.
const MOST_SCATTER_RATIO: f64 = 4.0;
const MOST_INFLATION: f64 = 3.0;

/// Points behind an arc that tell whether the ball stays down, and squared deviations from one height, in variances, that
/// are level.
const LEVEL_POINTS: usize = 6;
const LEVEL_REDUCED_CHI2: f64 = 4.0;

/// A flight without an impact must show its curve over this many points.
const LEAST_LONE_POINTS: usize = 20;

impl Flight {
    pub(super) fn is_convincing(&self, samples: &[TrackSample], ranges: &[Range<usize>], sigma: f64) -> bool {
        let (from, to) = self.time_span();
        let within = self
            .points
            .iter()
            .filter(|p| p.spot.time_s >= from && p.spot.time_s <= to)
            .count();
        let free = self.used() as f64 >= LEAST_FREE_PART * within as f64;
        let met = self.impacts.iter().any(Option::is_some);
        let mut offs: Vec<f64> = Vec::new();
        let mut near = 0;
        for p in &self.points {
            let SpotUse::Used(k) = p.use_ else { continue };
            let m = self.fit.motion(k, p.spot.time_s);
            let off = (p.spot.place.right - m.r).hypot(p.spot.place.up - m.h);
            near += usize::from(off < (MOST_SCATTER * sigma).max(SAGITTA_PART * self.sagitta(k)));
            offs.push(off);
        }
        // A hand's swing is a parabola only roughly.
        let close = 2 * near > offs.len();
        let off = median(&mut offs).unwrap_or(0.0);
        // The closer the points lie to the arcs, the lower a curve shows.
        let scatter = (2.0 * off).clamp(FINE_PART * sigma, sigma);
        let curved: usize = ranges
            .iter()
            .filter(|r| {
                shows_fall(samples, r, self.fit.gravity(), scatter) || goes_far(&samples[(*r).clone()], sigma)
            })
            .map(ExactSizeIterator::len)
            .sum();
        let all: usize = ranges.iter().map(ExactSizeIterator::len).sum();
        let curved = !self.fit.falls_in_plane() || curved as f64 >= LEAST_CURVED_PART * all as f64;
        let upright = self.fit.lean_rad().abs() < MOST_LEAN_RAD;
        free && close && curved && upright && (met || self.used() >= LEAST_LONE_POINTS)
    }

    /// How far arc `k` bends from the straight line between its ends, plane units.
    fn sagitta(&self, k: usize) -> f64 {
        let (from, to) = self.spans[k];
        self.fit.gravity() * (to - from).powi(2) / 8.0
    }

    /// Whether arc `k` is a few points that make impacts on something upright of what is one impact without them: the rest
    /// of a ball that something hides.
    pub(super) fn is_detour(&self, k: usize) -> bool {
        let points = self.points.iter().filter(|p| p.use_ == SpotUse::Used(k)).count();
        let on_floor = |a: usize| {
            self.impacts[a].is_none_or(|t| {
                let (m, n) = (self.fit.motion(a, t), self.fit.motion(a + 1, t));
                n.vh - m.vh > (n.vr - m.vr).abs()
            })
        };
        let direct = || impact_between(&self.fit, &self.spans, k - 1, k + 1, self.interval_s);
        let falls = self.fit.falls_in_plane() && points <= WEAK_POINTS;
        falls && !(on_floor(k - 1) && on_floor(k)) && direct().is_some()
    }

    /// Whether arc `k`, of few points, leads into the next with hardly a turn: a bench that ends there, not an impact.
    pub(super) fn hardly_turns(&self, k: usize) -> bool {
        let points = self.points.iter().filter(|p| p.use_ == SpotUse::Used(k)).count();
        let turn = self.impacts[k].map(|t| {
            let (m, n) = (self.fit.motion(k, t), self.fit.motion(k + 1, t));
            let fastest = m.vr.hypot(m.vh).max(n.vr.hypot(n.vh));
            (n.vr - m.vr).hypot(n.vh - m.vh) / fastest
        });
        points <= FEW_POINTS && turn.is_some_and(|turn| turn < LEAST_TURN)
    }

    /// Whether the points of the first or last arc `k`, cut from `cut` of the track, contradict its fall as precisely as their centres are
    /// known: a ball on its bench, one that stays down after an impact, or a row of bounces that frames do not resolve, lies
    /// close to a short parabola.
    pub(super) fn is_carried(&self, k: usize, cut: usize) -> bool {
        // Where the whole flight is no parabola to the precision of the centres, no arc of it is.
        let precise =
            self.scatter_ratio() < MOST_SCATTER_RATIO || self.fit.autocorrelation_inflation < MOST_INFLATION;
        if !self.fit.falls_in_plane() || !precise {
            return false;
        }
        let used = self.points.iter().filter(|p| p.use_ == SpotUse::Used(k));
        let arc: Vec<TrackSample> = used.map(|p| self.extra.fit_point(&p.spot, k).sample).collect();
        let (lasting, g) = (
            self.fit.autocorrelation_inflation.max(1.0).sqrt(),
            self.fit.gravity(),
        );
        let own = own_fall(&arc)
            .is_some_and(|(own, std)| (own - g).abs() > CARRIED_SIGMAS * lasting * std + CARRIED_PART * g);
        let few = (arc.len() as f64) < LEAST_FREE_PART * cut as f64;
        few || own || self.stays_level(k, &arc)
    }

    /// Whether the ball stays at one height on arc `k` and on after it.
    fn stays_level(&self, k: usize, arc: &[TrackSample]) -> bool {
        let end = self.spans[k].1;
        let behind = self.points.iter().filter(|p| p.spot.time_s > end);
        let heights: Vec<(f64, f64)> = behind
            .take(LEVEL_POINTS)
            .map(|p| (p.spot.place.up, 1.0 / self.extra.variance_of(&p.spot)))
            .chain(arc.iter().map(|s| (s.h, s.weight)))
            .collect();
        if heights.len() < arc.len() + LEVEL_POINTS {
            return false;
        }
        let weights: f64 = heights.iter().map(|h| h.1).sum();
        let mean = heights.iter().map(|h| h.0 * h.1).sum::<f64>() / weights;
        let chi2: f64 = heights.iter().map(|h| (h.0 - mean).powi(2) * h.1).sum();
        chi2 < LEVEL_REDUCED_CHI2 * heights.len() as f64
    }
}
