//! `--accuracy fast`, for screening: a circle of the recording's radius through the edge points along 64 rays.
//!
//! Edges are where the change against the background falls through half of its local height, so that shading moves
//! them little; their distances to the circle are made least with Tukey's weights. Error: about 0.05 to 0.1 px (half of
//! that for balls above R 20 px); smear and uneven light add to it. Cost: 0.03 ms a frame.

use super::disc::{Centre, Disc};
use super::edge_likelihood::LEAST_OUTLINE;
use super::method::{CentreInput, CentreMethod, MethodWords};
use super::outline::{self, RAYS};
use super::patch::Patch;
use crate::geometry::PixelPoint;
use crate::numeric::least_squares::{NormalEquations, Termination, gauss_newton};
use crate::numeric::robust::{TUKEY, std_from_magnitudes, tukey_weight};
use nalgebra::Vector2;

/// Rounds of rays from the centre found before.
const ROUNDS: usize = 3;

/// Edge points scatter by this at least, px: pixels are that coarse.
const LEAST_SCATTER_PX: f64 = 0.03;

/// The method.
#[derive(Debug)]
pub struct EdgeCircle;

impl CentreMethod for EdgeCircle {
    fn words(&self) -> MethodWords {
        MethodWords {
            name: "fast",
            help: "A circle through edge points: for screening",
            description: "fast: circle through edge points",
        }
    }

    fn centre(&self, input: &CentreInput<'_>) -> Option<Centre> {
        centre(input.patch, &input.start, input.contrast_grey)
    }
}

/// The centre near `start`, whose radius is the ball's. `None` where too little of the outline is seen.
fn centre(patch: &Patch<'_>, start: &Disc, contrast_grey: f64) -> Option<Centre> {
    let radius_px = start.radius_px;
    let change = outline::smoothed_change(patch);
    let mut at = start.centre;
    // What the first guess and the smear may be off by.
    let sweep = start.swept_px[0].hypot(start.swept_px[1]);
    let mut gate_px = (0.3 * radius_px).max(2.0) + 0.5 * sweep;
    let mut last = None;
    for _ in 0..ROUNDS {
        let edges = outline::edges_near(patch, &change, at, radius_px, gate_px);
        let fit = circle_of(&edges, at, radius_px)?;
        at = fit.centre;
        gate_px = (5.0 * fit.scatter_px).max(1.0) + 0.5 * sweep;
        last = Some(fit);
    }
    let fit = last?;
    let outline_used = fit.points as f64 / RAYS as f64;
    let near = at.distance_px(start.centre) < 0.7 * radius_px + 1.0;
    (near && outline_used >= LEAST_OUTLINE).then_some(Centre {
        disc: Disc { centre: at, ..*start },
        covariance_px2: fit.covariance_px2,
        outline_used,
        residual_grey: patch.noise_grey,
        contrast_grey,
    })
}

struct CircleFit {
    centre: PixelPoint,
    covariance_px2: [[f64; 2]; 2],
    scatter_px: f64,
    points: usize,
}

/// The centre of a circle of known radius through `edges`.
fn circle_of(edges: &[PixelPoint], start: PixelPoint, radius_px: f64) -> Option<CircleFit> {
    const STEPS: usize = 6;
    let (mut scatter_px, mut points) = (f64::INFINITY, 0);
    let mut equations = NormalEquations::default();
    let step = |centre: &PixelPoint| {
        let off = |e: &PixelPoint| centre.distance_px(*e) - radius_px;
        let mut sizes: Vec<f64> = edges.iter().map(|e| off(e).abs()).collect();
        scatter_px = std_from_magnitudes(&mut sizes)?.max(LEAST_SCATTER_PX);
        (equations, points) = (NormalEquations::default(), 0);
        for e in edges {
            let off = off(e);
            let weight = tukey_weight(off, TUKEY * scatter_px);
            if weight > 0.0 {
                points += 1;
                let along = Vector2::new(e.u_px - centre.u_px, e.v_px - centre.v_px) / (off + radius_px);
                equations.push(&along, off, weight);
            }
        }
        equations.step(0.0, 0.0)
    };
    let moved = |at: &PixelPoint, step: &Vector2<f64>| PixelPoint::new(at.u_px + step[0], at.v_px + step[1]);
    let (centre, end) = gauss_newton(start, STEPS, step, moved, |step| step.norm() < 1e-3);
    let covariance = equations.covariance().filter(|_| end != Termination::Singular)?;
    Some(CircleFit {
        centre,
        covariance_px2: (scatter_px * scatter_px * covariance).into(),
        scatter_px,
        points,
    })
}
