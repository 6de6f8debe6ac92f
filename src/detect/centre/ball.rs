//! The model of a ball's pixels: what each pixel near the outline holds, as a function of where the centre is.
//!
//! Seen from the centre a pixel stands at (x, y) = r (cos φ, sin φ). With B the background behind it,
//!
//! ```text
//! grey = B (1 - c) + m                        both averaged over the path swept during the exposure
//! c(r)    = the disc of radius R, blurred by σ: the covered part of the pixel
//! m(r, φ) = Σ a_k F_k(r) h_k(φ)               the ball's own light
//! F_k     = f_k(ρ) [ρ < 1], blurred by σ,     ρ = r/R',  R' = R - σ²/(2R),  f = 1, ζ, ρ, ρζ, ρ²
//! h_k     = 1, cos φ, sin φ, cos 2φ, sin 2φ
//! ```
//!
//! (ρ cos φ, ρ sin φ, ζ = √(1 - ρ²)) is the normal of the sphere, so the first four terms hold the half-Lambert
//! shading of a distant lamp exactly, all eight hold a matt sphere under any distant light to 1 % (Ramamoorthi and
//! Hanrahan 2001). More terms would fit the skirts of a highlight, but also noise: tried, they shifted the centre by three
//! times the error that they removed. R' is where a blurred disc of radius R has half its height. The terms
//! are blurred with the disc: the steep fall of ζ at the rim would otherwise pass for a shift of the edge. The
//! background behind each pixel is known, so texture does not pull the centre.
//!
//! Limits: R below about 1.5 px (no inside is left to tell brightness from size); a swept path above 4 R.

use super::disc::Disc;
use super::patch::Patch;
use crate::geometry::PixelPoint;

/// Radial functions in a row of a table.
const RADIAL: usize = 6;

/// Angular factors.
const HARMONICS: usize = 5;

/// Terms of the ball's light at most.
const MOST_TERMS: usize = 8;

/// Numbers of terms to choose from; see the module's head.
pub const TERM_LEVELS: [usize; 3] = [1, 4, MOST_TERMS];

/// Radial profile of each term, by its place in f.
const PROFILE: [usize; MOST_TERMS] = [0, 1, 2, 2, 3, 3, 4, 4];
/// Angular factor of each term, by its place in h.
const HARMONIC: [usize; MOST_TERMS] = [0, 0, 1, 2, 1, 2, 3, 4];

/// The terms of light that grows evenly across the ball.
pub const DIPOLE: std::ops::Range<usize> = 2..4;

/// Range of blurs that a fit may take, px (a pixel's square alone is 0.29).
pub const BLUR_RANGE_PX: (f64, f64) = (0.25, 6.0);

/// The ball's brightness at its rim, by the `terms` of its light, in so many directions around it, grey levels.
#[must_use]
pub fn rim_grey(terms: &[f64]) -> [f64; RIM_DIRECTIONS] {
    std::array::from_fn(|i| {
        let phi = std::f64::consts::TAU * i as f64 / RIM_DIRECTIONS as f64;
        let angular = [1.0, phi.cos(), phi.sin(), (2.0 * phi).cos(), (2.0 * phi).sin()];
        // At the rim ζ is 0 and ρ is 1.
        let at_rim = [1.0, 0.0, 1.0, 0.0, 1.0];
        let of = |(k, a): (usize, &f64)| a * at_rim[PROFILE[k]] * angular[HARMONIC[k]];
        terms.iter().enumerate().map(of).sum()
    })
}

/// Directions around the rim.
pub const RIM_DIRECTIONS: usize = 36;

/// What optics, pixels and camera make of a sharp edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Edge {
    /// Standard deviation of the blur, px.
    pub blur_px: f64,
    /// How many times what a picture differs by from one that is blurred by `SHARPENING_PX` more was added to it (unsharp mask).
    pub sharpening: f64,
}

/// Standard deviation of the blur that a camera sharpens by, px: a usual one.
const SHARPENING_PX: f64 = 1.5;

impl Edge {
    /// That of a camera that does not sharpen.
    #[must_use]
    pub fn blurred(blur_px: f64) -> Self {
        Self {
            blur_px,
            sharpening: 0.0,
        }
    }

    /// Standard deviation of the widest blur in it, px.
    fn widest_px(self) -> f64 {
        if self.sharpening == 0.0 {
            self.blur_px
        } else {
            self.softer_px()
        }
    }

    fn softer_px(self) -> f64 {
        norm(self.blur_px, SHARPENING_PX)
    }

    /// The profiles of a ball of `radius_px` at r.
    fn profile_row(self, r: f64, radius_px: f64) -> [f64; RADIAL] {
        let blurred =
            |blur_px: f64| profile_row(r, radius_px - half_height_shift(radius_px, blur_px), blur_px);
        let mut row = blurred(self.blur_px);
        if self.sharpening != 0.0 {
            let softer = blurred(self.softer_px());
            for (own, softer) in row.iter_mut().zip(softer) {
                *own += self.sharpening * (*own - softer);
            }
        }
        row
    }
}

/// Radial functions on equal steps of r, with slopes.
#[derive(Debug, Clone)]
pub struct RadialTable {
    first_px: f64,
    steps_a_px: f64,
    rows: Vec<[f64; RADIAL]>,
}

/// Rows of the table for each standard deviation of blur: the parabola between three rows is then good to 1e-4.
const ROWS_A_BLUR: f64 = 10.0;

/// Nodes of the blur integral over ±5 standard deviations.
const NODES: usize = 24;

impl RadialTable {
    /// The profiles F for a disc of `radius_px` with such an edge, from `inside_px` within the rim outwards.
    #[must_use]
    pub fn profiles(radius_px: f64, edge: Edge, inside_px: f64) -> Self {
        let rim = radius_px - half_height_shift(radius_px, edge.blur_px);
        let step_px = edge.blur_px / ROWS_A_BLUR;
        let first_px = (rim - inside_px - 1.0).max(0.0) - 2.0 * step_px;
        let count = ((rim + 6.0 * edge.widest_px() - first_px) / step_px).ceil() as usize + 3;
        let rows = (0..count)
            .map(|i| edge.profile_row(first_px + i as f64 * step_px, radius_px))
            .collect();
        Self {
            first_px,
            steps_a_px: 1.0 / step_px,
            rows,
        }
    }

    /// The profiles of a ball of another radius or edge on the grid of these.
    fn on_same_grid(&self, radius_px: f64, edge: Edge) -> Self {
        let row = |i: usize| edge.profile_row(self.first_px + i as f64 / self.steps_a_px, radius_px);
        Self {
            rows: (0..self.rows.len()).map(row).collect(),
            ..*self
        }
    }

    /// The table of a whole ball from the profiles: c, then the sums that go with 1, cos φ, sin φ, cos 2φ, sin 2φ.
    #[must_use]
    pub fn of_ball(&self, terms: &[f64]) -> Self {
        let rows = self.rows.iter().map(|f| {
            let mut row = [f[0], 0.0, 0.0, 0.0, 0.0, 0.0];
            for (k, a) in terms.iter().enumerate() {
                row[1 + HARMONIC[k]] += a * f[PROFILE[k]];
            }
            row
        });
        Self {
            rows: rows.collect(),
            ..*self
        }
    }

    /// Beyond this all is 0, px.
    #[inline]
    fn reach_px(&self) -> f64 {
        self.first_px + (self.rows.len() - 2) as f64 / self.steps_a_px
    }

    /// The three rows nearest to r, and how far it is from the middle one, in rows; `None` beyond the last, where all is 0.
    #[inline]
    fn rows_near(&self, r: f64) -> Option<(f64, [&[f64; RADIAL]; 3])> {
        let x = (r - self.first_px) * self.steps_a_px;
        let last = self.rows.len() - 2;
        if x > last as f64 {
            return None;
        }
        let i = ((x + 0.5).max(1.0) as usize).min(last);
        Some((
            x - i as f64,
            [&self.rows[i - 1], &self.rows[i], &self.rows[i + 1]],
        ))
    }

    /// Values and slopes at r: a parabola through the three nearest rows.
    #[inline]
    fn at(&self, r: f64) -> ([f64; RADIAL], [f64; RADIAL]) {
        let (mut value, mut slope) = ([0.0; RADIAL], [0.0; RADIAL]);
        let Some((t, [a, b, c])) = self.rows_near(r) else {
            return (value, slope);
        };
        for k in 0..RADIAL {
            let rise = 0.5 * (c[k] - a[k]);
            let bend = c[k] - 2.0 * b[k] + a[k];
            value[k] = b[k] + t * (rise + 0.5 * t * bend);
            slope[k] = (rise + t * bend) * self.steps_a_px;
        }
        (value, slope)
    }
}

/// The profiles at r: ∫ f(ρ) N(r - ρR'; σ) dρR' over the disc. With ρ = sin θ the root of ζ at the rim becomes smooth,
/// and the midpoint rule converges faster than any power.
fn profile_row(r: f64, rim: f64, blur_px: f64) -> [f64; RADIAL] {
    let low = ((r - 5.0 * blur_px) / rim).clamp(-1.0, 1.0).asin();
    let high = ((r + 5.0 * blur_px) / rim).clamp(-1.0, 1.0).asin();
    let width = (high - low) / NODES as f64;
    let mut row = [0.0; RADIAL];
    for k in 0..NODES {
        let (rho, zeta) = (low + (k as f64 + 0.5) * width).sin_cos();
        let z = (r - rho * rim) / blur_px;
        let weight = width * zeta * rim / blur_px * (-0.5 * z * z).exp() * FRAC_1_SQRT_TAU;
        let rho = rho.abs();
        for (f, value) in row[1..].iter_mut().zip([zeta, rho, rho * zeta, rho * rho]) {
            *f += weight * value;
        }
    }
    // The edge itself exactly: it is what the centre hangs on.
    row[0] = 0.5 * libm::erfc((r - rim) / blur_px * std::f64::consts::FRAC_1_SQRT_2);
    row
}

const FRAC_1_SQRT_TAU: f64 = 0.398_942_280_401_432_7;

/// A disc of radius R blurred by σ has half its height at R - σ²/(2R), to first order in σ/R.
fn half_height_shift(radius_px: f64, blur_px: f64) -> f64 {
    (blur_px * blur_px / (2.0 * radius_px)).min(0.25 * radius_px)
}

/// The angular factors from cos φ and sin φ.
#[inline]
fn harmonics(c: f64, s: f64) -> [f64; HARMONICS] {
    [1.0, c, s, c * c - s * s, 2.0 * c * s]
}

/// What a pixel holds of the ball, averaged over the swept path, and how that changes with the pixel's place.
#[derive(Debug, Clone, Copy, Default)]
pub struct PixelModel {
    /// Covered part.
    pub cover: f64,
    /// Slope of `cover` along u and v, 1/px.
    pub cover_slope: [f64; 2],
    /// PixelModel of the ball, grey levels.
    pub ball: f64,
    /// Slope of `ball` along u and v, grey levels/px.
    pub ball_slope: [f64; 2],
    /// `cover` times (x, y)/R, averaged.
    pub dipole: [f64; 2],
    /// Slope of `cover` and `ball` outwards, averaged: change with a smaller ball, 1/px and grey levels/px.
    pub outward: [f64; 2],
    /// Slopes along the path, times the place on it (-½ … ½), averaged: change with a longer path, for `cover` and
    /// `ball`.
    pub lengthening: [f64; 2],
}

/// A ball that moves while the shutter is open.
#[derive(Debug, Clone, Copy)]
pub struct SweptBall {
    /// The table's radius, px.
    pub radius_px: f64,
    /// How much larger than the table's the ball is, px.
    pub larger_px: f64,
    /// Displacement during the exposure, px.
    pub swept_px: [f64; 2],
    /// Half of the acceleration times the exposure squared, px: at the part s of the exposure from its middle the ball is
    /// s swept + s² bent from where it is there.
    pub bent_px: [f64; 2],
    /// Places on that path.
    pub points: usize,
}

/// Of fewer places of a path all are looked at.
const LEAST_CUT: usize = 4;

/// A pixel seen from the ball at one place of its path.
struct PathPlace {
    /// From the ball's centre, px.
    x: f64,
    y: f64,
    r: f64,
    /// The angular factors.
    h: [f64; HARMONICS],
    /// By how much the ball is further on there where the exposure is longer, over its part, px.
    longer: [f64; 2],
}

impl SweptBall {
    /// The places of the path, as a pixel `offset` from its middle has them: at least those from which it is no further than `reach_px`.
    #[inline]
    fn places(&self, offset: (f64, f64), reach_px: f64) -> impl Iterator<Item = PathPlace> {
        let Self {
            swept_px,
            bent_px,
            points,
            ..
        } = *self;
        self.within(offset, reach_px).map(move |k| {
            let s = (k as f64 + 0.5) / points as f64 - 0.5;
            let x = offset.0 - s * (swept_px[0] + s * bent_px[0]);
            let y = offset.1 - s * (swept_px[1] + s * bent_px[1]);
            let r = (x * x + y * y).sqrt().max(1e-6);
            PathPlace {
                x,
                y,
                r,
                h: harmonics(x / r, y / r),
                // The bend grows as the square of the exposure.
                longer: [0, 1].map(|i| s * (swept_px[i] + 2.0 * s * bent_px[i])),
            }
        })
    }

    /// The places that a pixel may be within reach of: where a line meets a circle, widened by what the path bends.
    #[inline]
    fn within(&self, offset: (f64, f64), reach_px: f64) -> std::ops::Range<usize> {
        let [a, b] = self.swept_px;
        let length2 = a * a + b * b;
        if self.points < LEAST_CUT || length2 == 0.0 {
            return 0..self.points;
        }
        let reach_px = reach_px + 0.25 * norm(self.bent_px[0], self.bent_px[1]);
        let middle = (offset.0 * a + offset.1 * b) / length2;
        let beside2 = offset.0 * offset.0 + offset.1 * offset.1 - middle * middle * length2;
        let half2 = (reach_px * reach_px - beside2) / length2;
        if half2 < 0.0 {
            return 0..0;
        }
        let place = |s: f64| ((s + 0.5) * self.points as f64).clamp(0.0, self.points as f64);
        let half = half2.sqrt();
        // (Whole places, and one for rounding.)
        let from = (place(middle - half) - 1.0).max(0.0) as usize;
        let to = (place(middle + half) + 1.0) as usize;
        from..to.min(self.points)
    }
}

/// Sums that go with the angular factors, from the second of a row on.
#[inline]
fn lit(row: &[f64], h: &[f64; HARMONICS]) -> f64 {
    row[1..].iter().zip(h).map(|(f, h)| f * h).sum()
}

impl PixelModel {
    /// Adds what the pixel holds at one place, with values `f` and slopes `d` of the ball's table there.
    #[inline]
    fn add(&mut self, at: &PathPlace, f: &[f64], d: &[f64; RADIAL]) {
        let PathPlace { x, y, r, h, longer } = at;
        let (c, t) = (x / r, y / r);
        let by_r = lit(d, h);
        let by_phi = f[3] * h[1] - f[2] * h[2] + 2.0 * (f[5] * h[3] - f[4] * h[4]);
        let across = by_phi / r;
        let (bu, bv) = (by_r * c - across * t, by_r * t + across * c);
        let (cu, cv) = (d[0] * c, d[0] * t);
        self.cover += f[0];
        self.cover_slope[0] += cu;
        self.cover_slope[1] += cv;
        self.ball += lit(&f[..RADIAL], h);
        self.ball_slope[0] += bu;
        self.ball_slope[1] += bv;
        self.outward[0] += d[0];
        self.outward[1] += by_r;
        self.dipole[0] += f[0] * x;
        self.dipole[1] += f[0] * y;
        self.lengthening[0] -= cu * longer[0] + cv * longer[1];
        self.lengthening[1] -= bu * longer[0] + bv * longer[1];
    }

    /// The mean over the path of what was added.
    fn averaged(&self, swept: &SweptBall) -> Self {
        let n = 1.0 / swept.points as f64;
        let both = |a: [f64; 2], by: f64| a.map(|a| a * by);
        Self {
            cover: self.cover * n,
            cover_slope: both(self.cover_slope, n),
            ball: self.ball * n,
            ball_slope: both(self.ball_slope, n),
            dipole: both(self.dipole, n / swept.radius_px),
            outward: both(self.outward, n),
            lengthening: both(self.lengthening, n),
        }
    }
}

/// The model of a pixel `offset` from the middle of the ball's path. `table` by [`RadialTable::of_ball`].
#[inline]
#[must_use]
pub fn pixel_model(table: &RadialTable, swept: &SweptBall, offset: (f64, f64)) -> PixelModel {
    let mut sum = PixelModel::default();
    for at in swept.places(offset, table.reach_px() + swept.larger_px) {
        // A little larger: the same, further out.
        let (f, d) = table.at(at.r - swept.larger_px);
        sum.add(&at, &f, &d);
    }
    sum.averaged(swept)
}

/// The ball's table with those of what else its appearance is fitted by, on one grid: one look serves all.
#[derive(Debug, Clone)]
pub struct LinearisedTable {
    first_px: f64,
    steps_a_px: f64,
    rows: Vec<[f64; COLUMNS]>,
}

/// Columns of a row: the ball's sums, how they change with its radius and with its blur, then the profiles of the light's terms.
const COLUMNS: usize = 3 * RADIAL + PROFILES;
const BY_RADIUS: usize = RADIAL;
const BY_BLUR: usize = 2 * RADIAL;
const OF_TERMS: usize = 3 * RADIAL;

/// Profiles that the terms of the light take, rounded up to pairs of numbers.
const PROFILES: usize = 6;

impl LinearisedTable {
    /// Of a ball of `radius_px` with such an edge and light of these `terms`, from `inside_px` within the rim outwards. Slopes by radius and blur
    /// are differences over `step_px`.
    #[must_use]
    pub fn new(radius_px: f64, edge: Edge, terms: &[f64], inside_px: f64, step_px: f64) -> Self {
        let profiles = RadialTable::profiles(radius_px, edge, inside_px);
        let here = profiles.of_ball(terms);
        let changed = |radius_px, edge| profiles.on_same_grid(radius_px, edge).of_ball(terms);
        let wider = changed(radius_px + step_px, edge);
        let softer = changed(
            radius_px,
            Edge {
                blur_px: edge.blur_px + step_px,
                ..edge
            },
        );
        let row = |i: usize| {
            let mut row = [0.0; COLUMNS];
            for k in 0..RADIAL {
                let value = here.rows[i][k];
                row[k] = value;
                row[BY_RADIUS + k] = (wider.rows[i][k] - value) / step_px;
                row[BY_BLUR + k] = (softer.rows[i][k] - value) / step_px;
            }
            row[OF_TERMS..].copy_from_slice(&profiles.rows[i][..PROFILES]);
            row
        };
        Self {
            first_px: profiles.first_px,
            steps_a_px: profiles.steps_a_px,
            rows: (0..profiles.rows.len()).map(row).collect(),
        }
    }
}

/// What a pixel holds of the ball, averaged over the swept path, and how that changes with all that the ball's appearance is fitted by.
#[derive(Debug, Clone, Copy, Default)]
pub struct LinearisedModel {
    /// What it holds.
    pub model: PixelModel,
    /// Slopes of `cover` and `ball` by the radius, 1/px and grey levels/px.
    pub by_radius: [f64; 2],
    /// And by the blur.
    pub by_blur: [f64; 2],
    /// Slopes of `ball` by the terms of the light.
    pub by_term: [f64; MOST_TERMS],
}

/// The model of a pixel `offset` from the middle of the ball's path, as [`pixel_model`] has it, with its slopes by what all frames share.
#[must_use]
pub fn linearised_model(table: &LinearisedTable, swept: &SweptBall, offset: (f64, f64)) -> LinearisedModel {
    let last = table.rows.len() - 2;
    let mut sum = LinearisedModel::default();
    let reach_px = table.first_px + last as f64 / table.steps_a_px + swept.larger_px;
    for at in swept.places(offset, reach_px) {
        let place = (at.r - swept.larger_px - table.first_px) * table.steps_a_px;
        if place > last as f64 {
            // Beyond the last row all is 0.
            continue;
        }
        // A parabola through the three nearest rows.
        let i = ((place + 0.5).max(1.0) as usize).min(last);
        let t = place - i as f64;
        let weights = [0.5 * t * (t - 1.0), 1.0 - t * t, 0.5 * t * (t + 1.0)];
        let slopes = [t - 0.5, -2.0 * t, t + 0.5].map(|w| w * table.steps_a_px);
        let [a, b, c] = [&table.rows[i - 1], &table.rows[i], &table.rows[i + 1]];
        let f: [f64; COLUMNS] =
            std::array::from_fn(|k| weights[0] * a[k] + weights[1] * b[k] + weights[2] * c[k]);
        let d: [f64; RADIAL] =
            std::array::from_fn(|k| slopes[0] * a[k] + slopes[1] * b[k] + slopes[2] * c[k]);
        sum.model.add(&at, &f, &d);
        sum.by_radius[0] += f[BY_RADIUS];
        sum.by_radius[1] += lit(&f[BY_RADIUS..BY_BLUR], &at.h);
        sum.by_blur[0] += f[BY_BLUR];
        sum.by_blur[1] += lit(&f[BY_BLUR..OF_TERMS], &at.h);
        for (i, slope) in sum.by_term.iter_mut().enumerate() {
            *slope += f[OF_TERMS + PROFILE[i]] * at.h[HARMONIC[i]];
        }
    }
    let n = 1.0 / swept.points as f64;
    LinearisedModel {
        model: sum.model.averaged(swept),
        by_radius: sum.by_radius.map(|slope| slope * n),
        by_blur: sum.by_blur.map(|slope| slope * n),
        by_term: sum.by_term.map(|slope| slope * n),
    }
}

/// Points along the swept path: midpoints of equal parts, so short that the blur hides the steps.
#[must_use]
pub fn path_points(swept_px: [f64; 2], blur_px: f64) -> usize {
    ((norm(swept_px[0], swept_px[1]) / (1.2 * blur_px)).ceil() as usize).clamp(1, 48)
}

/// A pixel of the band around the outline.
#[derive(Debug, Clone, Copy)]
pub struct BandPixel {
    /// Column.
    pub u: f64,
    /// Row.
    pub v: f64,
    /// What it holds, grey levels.
    pub grey: f64,
    /// What is behind the ball there, grey levels.
    pub background: f64,
    /// The part of the outline it belongs to.
    pub sector: u16,
    /// Within a blur or so of the edge, or beyond: these pixels tell whether the sector is an outlier.
    pub at_edge: bool,
}

/// How far a band extends from the outline, and how many pixels it may have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BandLimits {
    /// Inwards, px.
    pub inside_px: f64,
    /// Outwards, px.
    pub outside_px: f64,
    /// A larger band is thinned.
    pub most_pixels: usize,
}

/// Sectors of the outline, about three pixels each.
#[must_use]
pub fn sector_count(radius_px: f64) -> usize {
    ((std::f64::consts::TAU * radius_px / 3.0) as usize).clamp(8, 48)
}

/// Half width of an edge's slope in blurs: beyond it lies 0.5 % of the information on the centre.
const SLOPE_BLURS: f64 = 2.0;
/// The largest part of a thinned band's pixels that is on the slope.
const SLOPE_PART: f64 = 0.6;

/// The pixels of the band around `disc`, whose outline is counted in so many `sectors`.
#[must_use]
pub fn band(
    patch: &Patch<'_>,
    disc: &Disc,
    blur_px: f64,
    limits: BandLimits,
    sectors: usize,
) -> Vec<BandPixel> {
    let (w, h) = (patch.crop.luma.width, patch.crop.luma.height);
    let (u0, v0) = (patch.crop.u as f64, patch.crop.v as f64);
    let beyond = disc.radius_px + limits.outside_px;
    // The rows and columns gone through are the frame's, in which the disc may be an ellipse.
    let (middle, most) = patch.affine.map_or((disc.centre, 1.0), |d| {
        (d.frame_from_patch(disc.centre), d.largest_stretch())
    });
    let span = |centre: f64, reach: f64, n: usize| {
        let low = (centre - reach).floor().max(0.0) as usize;
        let high = ((centre + reach).ceil() + 1.0).clamp(0.0, n as f64) as usize;
        low.min(high)..high
    };
    let length = norm(disc.swept_px[0], disc.swept_px[1]);
    let along = |swept_px: f64| if most > 1.0 { length } else { swept_px.abs() };
    let rows = span(
        middle.v_px - v0,
        most * (beyond + 0.5 * along(disc.swept_px[1])),
        h,
    );
    let columns = span(
        middle.u_px - u0,
        most * (beyond + 0.5 * along(disc.swept_px[0])),
        w,
    );
    let outline_px = std::f64::consts::TAU * disc.radius_px + 2.0 * length;
    let wide = limits.inside_px + limits.outside_px;
    // Pixels on the slope of the edge tell the centre, the others only the light: those are thinned first.
    let slope_px = SLOPE_BLURS * blur_px;
    let (on_slope, off_slope) = (2.0 * slope_px * outline_px, (wide - 2.0 * slope_px) * outline_px);
    let budget = limits.most_pixels as f64;
    let slope_share = (budget * SLOPE_PART / on_slope).max(budget / (on_slope + off_slope));
    let share = (budget - (slope_share * on_slope).min(on_slope)) / off_slope;
    let (inner, outer) = (
        (disc.radius_px - limits.inside_px).max(0.0).powi(2),
        beyond * beyond,
    );
    let (slope_from, slope_to) = (
        (disc.radius_px - slope_px).max(0.0).powi(2),
        (disc.radius_px + slope_px).powi(2),
    );
    let edge2 = (disc.radius_px - 2.0 * blur_px).max(0.0).powi(2);
    let mut pixels = Vec::with_capacity((rows.len() * columns.len()).min(limits.most_pixels) + 16);
    // An even share of a large band: a golden-ratio sequence over the pixels' order.
    let mut turns = [0.0, 0.0];
    for row in rows {
        for column in columns.clone() {
            let (u, v) = (u0 + column as f64, v0 + row as f64);
            let (u, v) = patch.affine.map_or((u, v), |d| d.patch_from_frame(u, v));
            let (x, y) = nearest_offset(disc, u, v);
            let r2 = x * x + y * y;
            if r2 < inner || r2 > outer {
                continue;
            }
            let sloping = r2 > slope_from && r2 < slope_to;
            let turn = &mut turns[usize::from(sloping)];
            *turn += 0.618_033_988_749_894_9;
            if *turn > 1.0 {
                *turn -= 1.0;
            }
            if *turn > (if sloping { slope_share } else { share }) {
                continue;
            }
            let i = row * w + column;
            let around = y.atan2(x) / std::f64::consts::TAU + 0.5;
            pixels.push(BandPixel {
                u,
                v,
                grey: f64::from(patch.crop.luma.data[i]),
                background: f64::from(patch.background[i]),
                sector: ((around * sectors as f64) as usize).min(sectors - 1) as u16,
                at_edge: r2 > edge2,
            });
        }
    }
    pixels
}

/// From the nearest point of the swept path to the pixel.
#[must_use]
pub fn nearest_offset(disc: &Disc, u: f64, v: f64) -> (f64, f64) {
    let (x, y) = (u - disc.centre.u_px, v - disc.centre.v_px);
    let [a, b] = disc.swept_px;
    let length2 = a * a + b * b;
    if length2 < 1e-12 {
        return (x, y);
    }
    let s = ((x * a + y * b) / length2).clamp(-0.5, 0.5);
    (x - s * a, y - s * b)
}

/// From the middle of the path to a pixel.
#[inline]
#[must_use]
pub fn offset(centre: PixelPoint, p: &BandPixel) -> (f64, f64) {
    (p.u - centre.u_px, p.v - centre.v_px)
}

/// Length of (x, y); pixels neither over- nor underflow, and `hypot` is five times slower.
#[must_use]
pub fn norm(x: f64, y: f64) -> f64 {
    (x * x + y * y).sqrt()
}
