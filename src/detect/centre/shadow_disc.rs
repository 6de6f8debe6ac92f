//! The shadow of a ball on a wall behind it: a disc about as large as the ball, moved aside, with a soft edge.
//!
//! ```text
//! change of grey = d Φ((ρ − |p − o|)/σ)
//! ```
//!
//! with its place o beside the ball's centre, its radius ρ, the width σ of its edge (a lamp is not a point, nor is the lens
//! perfect) and its depth d. What of it lies beside the ball tells the five numbers, by least squares, and so what of it lies behind the ball's
//! rim, where nothing is seen of it.
//!
//! Assumed: a wall about parallel to the plane of motion. What else goes along with a ball (its reflection in a polished wall, a second lamp's
//! shadow) is not told by these numbers and is what [`AttachedShadow`](super::attached_shadow::AttachedShadow) keeps of the picture itself.

use crate::numeric::least_squares::{Damping, Residuals, StopRule, fit};
use nalgebra::DVector;
use rayon::prelude::*;
use std::f64::consts::{FRAC_1_SQRT_2, TAU};

/// A lamp that is not far away, or a wall at an angle, makes the shadow larger or smaller than the ball: the standard uncertainty of the logarithm
/// of their ratio.
const LN_SIZE_STD: f64 = 0.2;

/// Edges of shadows are about so wide, px, to so much in the logarithm.
const USUAL_BLUR_PX: f64 = 2.0;
const LN_BLUR_STD: f64 = 0.8;

/// Further from its edge than so many widths a place is in the shadow or out of it.
const CERTAIN_BLURS: f64 = 9.0;

/// How far aside the search begins, in radii, and in how many directions.
const FIRST_OFFSETS: [f64; 5] = [0.3, 0.6, 1.0, 1.5, 2.0];
const FIRST_DIRECTIONS: usize = 16;

/// The change of the scene at a place beside the ball, grey levels, with its standard uncertainty.
#[derive(Debug, Clone, Copy)]
pub(super) struct Change {
    /// From the ball's centre, px.
    pub(super) place: (f64, f64),
    pub(super) grey: f64,
    pub(super) std: f64,
}

/// The shadow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ShadowDisc {
    offset: (f64, f64),
    radius_px: f64,
    blur_px: f64,
    depth_grey: f64,
}

impl ShadowDisc {
    /// The one that explains `changes` beside a ball of `ball_px` best; `None` where no disc explains anything of them.
    pub(super) fn fitted(changes: &[Change], ball_px: f64) -> Option<Self> {
        let starts = FIRST_OFFSETS.iter().flat_map(|&part| {
            (0..FIRST_DIRECTIONS).map(move |k| {
                let (sin, cos) = (TAU * k as f64 / FIRST_DIRECTIONS as f64).sin_cos();
                Self {
                    offset: (part * ball_px * cos, part * ball_px * sin),
                    radius_px: ball_px,
                    blur_px: USUAL_BLUR_PX,
                    depth_grey: 1.0,
                }
            })
        });
        let starts: Vec<Self> = starts.collect();
        let starts: Vec<_> = starts
            .into_par_iter()
            .map(|start| start.as_deep_as(changes))
            .collect();
        let start = starts
            .into_iter()
            .flatten()
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, start)| start)?;
        let model = Beside { changes, ball_px };
        let found = fit(
            &model,
            start.parameters(),
            &Damping::NIELSEN,
            &StopRule::default(),
        );
        let found = Self::of(&found.parameters);
        found.depth_grey.is_finite().then_some(found)
    }

    /// The change at a place beside the ball's centre, grey levels.
    pub(super) fn at(&self, (du, dv): (f64, f64)) -> f64 {
        self.depth_grey * self.share((du, dv))
    }

    /// The part of the depth.
    fn share(&self, (du, dv): (f64, f64)) -> f64 {
        let inside_px = self.radius_px - (du - self.offset.0).hypot(dv - self.offset.1);
        match inside_px / self.blur_px {
            // As far as numbers go.
            far if far > CERTAIN_BLURS => 1.0,
            far if far < -CERTAIN_BLURS => 0.0,
            near => 0.5 * libm::erfc(-near * FRAC_1_SQRT_2),
        }
    }

    /// The same with the depth that explains `changes` best, and by how much that lowers χ².
    fn as_deep_as(self, changes: &[Change]) -> Option<(f64, Self)> {
        let (mut product, mut square) = (0.0, 0.0);
        for c in changes {
            let share = self.share(c.place) / c.std;
            product += share * c.grey / c.std;
            square += share * share;
        }
        let depth_grey = product / square;
        let told = depth_grey.is_finite() && square > 0.0;
        told.then_some((product * depth_grey, Self { depth_grey, ..self }))
    }

    fn parameters(&self) -> DVector<f64> {
        let (u, v) = self.offset;
        DVector::from_vec(vec![
            u,
            v,
            self.radius_px.ln(),
            self.blur_px.ln(),
            self.depth_grey,
        ])
    }

    fn of(p: &DVector<f64>) -> Self {
        Self {
            offset: (p[0], p[1]),
            radius_px: p[2].exp(),
            blur_px: p[3].exp(),
            depth_grey: p[4],
        }
    }
}

struct Beside<'a> {
    changes: &'a [Change],
    ball_px: f64,
}

impl Residuals for Beside<'_> {
    fn residuals(&self, parameters: &DVector<f64>) -> DVector<f64> {
        let shadow = ShadowDisc::of(parameters);
        let seen = self.changes.iter().map(|c| (c.grey - shadow.at(c.place)) / c.std);
        let size = -(shadow.radius_px / self.ball_px).ln() / LN_SIZE_STD;
        let blur = -(shadow.blur_px / USUAL_BLUR_PX).ln() / LN_BLUR_STD;
        let all: Vec<f64> = seen.chain([size, blur]).collect();
        DVector::from_vec(all)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_behind_the_ball_is_told_by_what_lies_beside_it() {
        let shadow = ShadowDisc {
            offset: (9.0, -4.0),
            radius_px: 11.0,
            blur_px: 1.5,
            depth_grey: -25.0,
        };
        let cells = (-22..=22).flat_map(|v| (-22..=22).map(move |u| (f64::from(u), f64::from(v))));
        let beside = cells.filter(|(u, v)| u.hypot(*v) > 12.0);
        let changes: Vec<Change> = beside
            .map(|place| Change {
                place,
                grey: shadow.at(place) + 0.5 * (37.0 * place.0 + 11.0 * place.1).sin(),
                std: 0.5,
            })
            .collect();
        let found = ShadowDisc::fitted(&changes, 10.0).unwrap();
        for place in [(9.0, 0.0), (8.0, -6.0), (3.0, -9.0), (0.0, 9.0), (5.0, 5.0)] {
            let (is, expected) = (found.at(place), shadow.at(place));
            assert!((is - expected).abs() < 0.7, "{place:?}: {is} {expected}");
        }
    }
}
