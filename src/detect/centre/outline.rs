//! A first circle through the ball's outline.
//!
//! Rays leave a point inside; along each, the places where the difference from the background falls off are
//! candidate edges. A circle through three of them that most rays agree with (RANSAC, Fischler and Bolles 1981) is
//! fitted geometrically. A highlight, a seam or a shadow gives candidates too, but not on one circle; a centre of
//! mass would follow them.

use super::disc::Disc;
use super::patch::Patch;
use crate::geometry::PixelPoint;
use crate::numeric::least_squares::{NormalEquations, gauss_newton};
use nalgebra::Vector3;

/// A circle and how much of the outline it explains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outline {
    /// The circle (not swept).
    pub disc: Disc,
    /// Part of the rays with an edge on the circle, 0..1.
    pub agreement: f64,
}

/// Rays looked along.
pub const RAYS: usize = 64;

/// Trials of three rays: with 40 % of the candidates on the circle, a good triple is missed with probability 1e-4.
const TRIALS: usize = 140;

/// The smallest circle looked for, px.
const SMALLEST_RADIUS_PX: f64 = 1.2;

/// An edge candidate: place in the crop and the ray it lies on.
#[derive(Debug, Clone, Copy)]
struct EdgePoint {
    u: f64,
    v: f64,
    ray: usize,
}

/// The circle through the outline of what covers the background around `inside` (a point of the frame within the
/// ball), with a radius near `radius_px` (within a fifth) where one is known.
#[must_use]
pub fn find(patch: &Patch<'_>, inside: PixelPoint, radius_px: Option<f64>) -> Option<Outline> {
    let change = smoothed_change(patch);
    let (u0, v0) = (patch.crop.u as f64, patch.crop.v as f64);
    let mut from = (inside.u_px - u0, inside.v_px - v0);
    let mut best: Option<(Circle, f64)> = None;
    // The second look starts from the circle found, so that the rays meet the outline evenly and at right angles.
    for _ in 0..2 {
        let edges = edges_along_rays(patch, &change, from, 0.0..f64::INFINITY);
        let found = agree(&edges, patch, radius_px)?;
        from = (found.0.u, found.0.v);
        best = Some(found);
    }
    let (circle, agreement) = best?;
    Some(Outline {
        disc: Disc {
            centre: PixelPoint::new(circle.u + u0, circle.v + v0),
            radius_px: circle.r,
            swept_px: [0.0, 0.0],
            bent_px: [0.0, 0.0],
        },
        agreement,
    })
}

/// |difference from the background|, smoothed by [1 2 1]²/16 against noise.
#[must_use]
pub fn smoothed_change(patch: &Patch<'_>) -> Vec<f32> {
    let (w, h) = (patch.crop.luma.width, patch.crop.luma.height);
    let raw: Vec<f32> = patch
        .crop
        .luma
        .data
        .iter()
        .zip(&patch.background)
        .map(|(&i, &b)| (f32::from(i) - b).abs())
        .collect();
    let mut rows = raw.clone();
    for v in 0..h {
        for u in 1..w.saturating_sub(1) {
            let i = v * w + u;
            rows[i] = 0.25 * raw[i - 1] + 0.5 * raw[i] + 0.25 * raw[i + 1];
        }
    }
    let mut out = rows.clone();
    for v in 1..h.saturating_sub(1) {
        for u in 0..w {
            let i = v * w + u;
            out[i] = 0.25 * rows[i - w] + 0.5 * rows[i] + 0.25 * rows[i + w];
        }
    }
    out
}

/// On each ray from `from` the edge nearest to `radius_px`, within `gate_px` of it. Points are of the frame, or of the affine
/// patch where there is one. `change` by [`smoothed_change`].
#[must_use]
pub fn edges_near(
    patch: &Patch<'_>,
    change: &[f32],
    from: PixelPoint,
    radius_px: f64,
    gate_px: f64,
) -> Vec<PixelPoint> {
    let (u0, v0) = (patch.crop.u as f64, patch.crop.v as f64);
    let seen = patch.affine.map_or(from, |d| d.frame_from_patch(from));
    let start = (seen.u_px - u0, seen.v_px - v0);
    let within_px = if patch.affine.is_some() {
        0.0..f64::INFINITY
    } else {
        radius_px - gate_px..radius_px + gate_px
    };
    let mut nearest: [Option<(f64, PixelPoint)>; RAYS] = [None; RAYS];
    for e in edges_along_rays(patch, change, start, within_px) {
        let edge = PixelPoint::new(e.u + u0, e.v + v0);
        let (edge, r) = match patch.affine {
            Some(affine) => {
                let (u, v) = affine.patch_from_frame(edge.u_px, edge.v_px);
                let edge = PixelPoint::new(u, v);
                (edge, edge.distance_px(from))
            }
            None => (edge, ((e.u - start.0).powi(2) + (e.v - start.1).powi(2)).sqrt()),
        };
        let off = (r - radius_px).abs();
        if off < gate_px && nearest[e.ray].is_none_or(|(best, _)| off < best) {
            nearest[e.ray] = Some((off, edge));
        }
    }
    nearest.into_iter().flatten().map(|(_, p)| p).collect()
}

/// Places along each ray where the change falls through half of what it was just inside: all of those at least within so
/// many px of its start.
fn edges_along_rays(
    patch: &Patch<'_>,
    change: &[f32],
    from: (f64, f64),
    within_px: std::ops::Range<f64>,
) -> Vec<EdgePoint> {
    const STEP_PX: f64 = 0.5;
    /// Edges are blurred over about this length.
    const REACH: usize = 5;
    let (w, h) = (patch.crop.luma.width, patch.crop.luma.height);
    // Below this a fall is noise: the smoothing leaves 3/8 of a pixel's standard deviation.
    let least = (4.0 * 0.375 * patch.noise_grey).max(2.0);
    // A fall lies between two steps of the profile, and is judged by the levels within reach of it.
    let first = ((within_px.start / STEP_PX) as usize).max(1);
    let last = ((within_px.end / STEP_PX) as usize).saturating_add(1);
    let (begin, end) = (first.saturating_sub(REACH), last.saturating_add(REACH));
    let mut edges = Vec::new();
    let mut profile = Vec::new();
    // As `bilinear`, but for the last column and row, whose neighbours would have to be looked for.
    let (most_u, most_v) = (w.saturating_sub(1) as f64, h.saturating_sub(1) as f64);
    let sample = |u: f64, v: f64| {
        if !(u >= 0.0 && v >= 0.0 && u < most_u && v < most_v) {
            return None;
        }
        let (iu, iv) = (u as usize, v as usize);
        let (fu, fv) = (u - iu as f64, v - iv as f64);
        let from = iv * w + iu;
        let &[a, b] = change.get(from..)?.first_chunk()?;
        let &[c, d] = change.get(from + w..)?.first_chunk()?;
        let top = f64::from(a) * (1.0 - fu) + f64::from(b) * fu;
        let bottom = f64::from(c) * (1.0 - fu) + f64::from(d) * fu;
        Some(top * (1.0 - fv) + bottom * fv)
    };
    if sample(from.0, from.1).is_none() {
        return edges;
    }
    for ray in 0..RAYS {
        let angle = std::f64::consts::TAU * ray as f64 / RAYS as f64;
        let (s, c) = angle.sin_cos();
        profile.clear();
        while begin + profile.len() < end
            && let Some(value) = {
                let r = STEP_PX * (begin + profile.len()) as f64;
                sample(from.0 + r * c, from.1 + r * s)
            }
        {
            profile.push(value);
        }
        for i in first - begin..profile.len().min(last.saturating_add(1) - begin) {
            // (What falls from less than half of what a fall has to be at least falls too little, whatever is around it.)
            if profile[i] >= profile[i - 1] || profile[i - 1] <= 0.5 * least {
                continue;
            }
            let inner = profile[i.saturating_sub(REACH)..i]
                .iter()
                .copied()
                .fold(0.0, f64::max);
            let outer = profile[i..(i + REACH).min(profile.len())]
                .iter()
                .copied()
                .fold(f64::MAX, f64::min);
            let middle = 0.5 * (inner + outer);
            let crossing = profile[i - 1] > middle && profile[i] <= middle;
            // A fall counts when it loses at least half of the level and stands above the noise.
            if crossing && inner - outer > least && outer < 0.6 * inner {
                let share = (profile[i - 1] - middle) / (profile[i - 1] - profile[i]);
                let r = STEP_PX * ((begin + i) as f64 - 1.0 + share);
                edges.push(EdgePoint {
                    u: from.0 + r * c,
                    v: from.1 + r * s,
                    ray,
                });
            }
        }
    }
    edges
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Circle {
    u: f64,
    v: f64,
    r: f64,
}

impl Circle {
    fn through(a: EdgePoint, b: EdgePoint, c: EdgePoint) -> Option<Self> {
        let (bx, by, cx, cy) = (b.u - a.u, b.v - a.v, c.u - a.u, c.v - a.v);
        let d = 2.0 * (bx * cy - by * cx);
        if d.abs() < 1e-6 {
            return None;
        }
        let (b2, c2) = (bx * bx + by * by, cx * cx + cy * cy);
        let (x, y) = ((cy * b2 - by * c2) / d, (bx * c2 - cx * b2) / d);
        Some(Self {
            u: a.u + x,
            v: a.v + y,
            r: x.hypot(y),
        })
    }

    fn residual(&self, e: &EdgePoint) -> f64 {
        let (u, v) = (e.u - self.u, e.v - self.v);
        (u * u + v * v).sqrt() - self.r
    }

    fn tolerance(&self) -> f64 {
        (0.06 * self.r).max(0.6)
    }
}

/// The circle that most rays agree with, and the part of the rays that do.
fn agree(edges: &[EdgePoint], patch: &Patch<'_>, radius_px: Option<f64>) -> Option<(Circle, f64)> {
    if edges.len() < 5 {
        return None;
    }
    let largest = 0.75 * patch.crop.luma.width.max(patch.crop.luma.height) as f64;
    let allowed = radius_px.map_or((SMALLEST_RADIUS_PX, largest), |r| (0.8 * r, 1.2 * r));
    let mut random = SplitMix(0x9E37_79B9_7F4A_7C15);
    let mut best: Option<(Circle, usize)> = None;
    for _ in 0..TRIALS {
        let [a, b, c] = [0; 3].map(|_| edges[random.below(edges.len())]);
        if a.ray == b.ray || b.ray == c.ray || a.ray == c.ray {
            continue;
        }
        let Some(circle) = Circle::through(a, b, c) else {
            continue;
        };
        if !(circle.r >= allowed.0 && circle.r <= allowed.1) {
            continue;
        }
        let count = rays_on(edges, &circle);
        if best.is_none_or(|(_, n)| count > n) {
            best = Some((circle, count));
        }
    }
    let (circle, _) = best?;
    let fitted = geometric_fit(edges, circle);
    if !(fitted.r >= allowed.0 && fitted.r <= allowed.1) {
        return None;
    }
    let count = rays_on(edges, &fitted);
    Some((fitted, count as f64 / RAYS as f64))
}

fn rays_on(edges: &[EdgePoint], circle: &Circle) -> usize {
    // Squares of distances will do: most of a search's time goes into this loop.
    let tolerance = circle.tolerance();
    let (least, most) = (
        (circle.r - tolerance).max(0.0).powi(2),
        (circle.r + tolerance).powi(2),
    );
    let mut seen = 0_u64;
    for e in edges {
        let (u, v) = (e.u - circle.u, e.v - circle.v);
        let square = u * u + v * v;
        seen |= u64::from(square > least && square < most) << e.ray;
    }
    seen.count_ones() as usize
}

/// Least squares of the distances to the circle (no algebraic shortcut: those are biased on short arcs), over the
/// edges that lie on it.
fn geometric_fit(edges: &[EdgePoint], start: Circle) -> Circle {
    let step = |circle: &Circle| {
        let mut equations = NormalEquations::default();
        for e in edges {
            let residual = circle.residual(e);
            let d = residual + circle.r;
            if residual.abs() < circle.tolerance() && d > 1e-9 {
                let row = Vector3::new((e.u - circle.u) / d, (e.v - circle.v) / d, 1.0);
                equations.push(&row, residual, 1.0);
            }
        }
        equations.step(0.0, 0.0)
    };
    let moved = |circle: &Circle, step: &Vector3<f64>| Circle {
        u: circle.u + step[0],
        v: circle.v + step[1],
        r: circle.r + step[2],
    };
    let (circle, _) = gauss_newton(start, 8, step, moved, |step| step.norm() < 1e-4);
    if circle.r.is_finite() && circle.r > 0.0 {
        circle
    } else {
        start
    }
}

/// SplitMix64 (Steele, Lea, Flood 2014): the same trials every time, for the same result every time.
struct SplitMix(u64);

impl SplitMix {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) % n as u64) as usize
    }
}
