//! The likelihood of a path: how well a row of sightings is explained by arcs that meet.
//!
//! The sightings are divided into arcs with one fall, straight stretches and points that belong to none ([`super::segment`]): squared
//! residuals, a price for each arc and each point left out, and how far successive arcs miss each other. By it clocks compete
//! ([`super::clock`]), and tracks for being one thing.
//!
//! Assumed: centres scatter by one of a few multiples of what they say.

use super::linking::Spot;
use super::parabola::{self, Fall, Gravity};
use super::segment::{ARC_COST, DROP_COST, Stretch, StretchKind, TrackSample};
use rayon::prelude::*;
use std::ops::Range;

/// A first centre is not known better than to this part of the radius: shading, texture, what is behind.
const PART_OF_RADIUS: f64 = 0.02;

/// The centres' scatter is one of these times what they say: the likelier counts. A hand-held camera, a coarse codec.
pub const SCATTERS: [f64; 3] = [1.0, 2.5, 6.0];

/// The same where it may be less: of a large ball before a plain wall.
pub const FINE_SCATTERS: [f64; 5] = [0.16, 0.4, 1.0, 2.5, 6.0];

/// Arcs whose own fall is tried for all.
const MOST_FALLS: usize = 4;

/// How well a path is explained.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathLikelihood {
    /// 2 ln L over that of a path of which nothing is explained.
    pub gain: f64,
    /// By how much it may grow at most.
    pub room: f64,
    /// The common fall; `None` where each arc has its own.
    pub fall: Option<Gravity>,
}

/// The likelihood of a `track`'s spots as a path of arcs, with this fall where it is known, whose centres scatter by one of `scatters`.
#[must_use]
pub fn divided(track: &[Spot], known: Option<Gravity>, scatters: &[f64]) -> PathLikelihood {
    let most = DROP_COST * track.len() as f64;
    let nothing = PathLikelihood {
        gain: 0.0,
        room: most,
        fall: None,
    };
    let with_scatter = |&scatter: &f64| {
        let mut least = nothing;
        let sample = |s: &Spot| TrackSample::of_spot(s, 1.0 / (scatter * scatter * variance(s)));
        let samples: Vec<TrackSample> = track.iter().map(sample).collect();
        if let Some(g) = known {
            let (stretches, cost) = parabola::division(&samples, Fall::Known(g));
            return least.or(most, &samples, &stretches, cost, Some(g), scatter);
        }
        let free = parabola::division(&samples, Fall::Free { leaning: true });
        let mut arcs: Vec<Range<usize>> = free.0.iter().map(|s| s.range.clone()).collect();
        arcs.sort_by_key(|r| std::cmp::Reverse(r.len()));
        let falls = arcs.iter().take(MOST_FALLS);
        let falls = falls.filter_map(|r| Some(parabola::own_gravity(&samples[r.clone()])?.0));
        let common = falls.map(|g| (Some(g), parabola::division(&samples, Fall::Known(g))));
        for (fall, (stretches, cost)) in std::iter::once((None, free)).chain(common) {
            least = least.or(most, &samples, &stretches, cost, fall, scatter);
        }
        least
    };
    let each: Vec<PathLikelihood> = scatters.par_iter().map(with_scatter).collect();
    // Of equals the first.
    let more =
        |best: PathLikelihood, other: PathLikelihood| if other.gain > best.gain { other } else { best };
    each.into_iter().fold(nothing, more)
}

impl PathLikelihood {
    /// This, or what a division of the `samples` at a `cost` explains, where that is more.
    fn or(
        self,
        most: f64,
        samples: &[TrackSample],
        stretches: &[Stretch],
        cost: f64,
        fall: Option<Gravity>,
        scatter: f64,
    ) -> Self {
        let used: usize = stretches.iter().map(|s| s.range.len()).sum();
        let own = if fall.is_some() {
            0.0
        } else {
            OWN_FALL_COST * stretches.len() as f64
        };
        // Of two coordinates each.
        let off = cost + own + jumps(samples, stretches, fall);
        let width = |scatter: f64| 4.0 * used as f64 * scatter.ln();
        let gain = most - off - width(scatter);
        if gain > self.gain {
            Self {
                gain,
                room: off + width(scatter.max(1.0)) - ARC_COST * stretches.len() as f64,
                fall,
            }
        } else {
            self
        }
    }
}

/// What it costs an arc to have a fall of its own, in squared standard deviations: two numbers with a margin.
const OWN_FALL_COST: f64 = 12.0;

/// −2 ln of the likelihood of how far successive stretches miss each other in between. A thing does not jump: where an arc ends the next
/// begins. (Cauchy's: what is drawn on to the impact is off by more than its points.)
fn jumps(samples: &[TrackSample], stretches: &[Stretch], fall: Option<Gravity>) -> f64 {
    let missed = |pair: &[Stretch]| -> Option<f64> {
        let (a, b) = (&samples[pair[0].range.clone()], &samples[pair[1].range.clone()]);
        let g = |part: &[TrackSample], kind: StretchKind| match (kind, fall) {
            (StretchKind::Straight, _) => Some(Gravity::NONE),
            (StretchKind::Falling, Some(g)) => Some(g),
            (StretchKind::Falling, None) => Some(parabola::own_gravity(part)?.0),
        };
        let (before, after) = (g(a, pair[0].kind)?, g(b, pair[1].kind)?);
        let (from, to) = (a[a.len() - 1].t, b[0].t);
        let apart = |k: u32| -> Option<f64> {
            let t = from + (to - from) * f64::from(k) / f64::from(JUMP_STEPS);
            let (p, q) = (parabola::place(a, before, t)?, parabola::place(b, after, t)?);
            Some((p.0 - q.0).hypot(p.1 - q.1))
        };
        let least = (0..=JUMP_STEPS).filter_map(apart).fold(f64::INFINITY, f64::min);
        let off = least * b[0].weight.sqrt() / JUMP_SIGMAS;
        Some(3.0 * (off * off).ln_1p())
    };
    stretches.windows(2).filter_map(missed).sum()
}

/// Times between two stretches at which they may meet.
const JUMP_STEPS: u32 = 8;

/// Stretches miss each other by about so many standard deviations of a point.
const JUMP_SIGMAS: f64 = 1.5;

/// Of a coordinate of a first centre, plane units².
#[must_use]
pub fn variance(s: &Spot) -> f64 {
    s.std * s.std + (PART_OF_RADIUS * s.radius).powi(2)
}
