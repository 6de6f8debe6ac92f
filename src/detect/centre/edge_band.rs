//! A likelihood fit of the ball's blurred, moving outline to the pixels of its edge.
//!
//! Each pixel near the outline is modelled as
//!
//! ```text
//! grey = background · (1 - B_0) + Σ a_k B_k
//! B_k  = mean over the exposure of  F_k(r) · A_k(φ)      (r, φ): the pixel seen from the centre at that moment
//! F_k  = f_k(ρ) · [ρ < 1], blurred by a Gaussian σ       ρ = r/R', R' = R - σ²/(2R)
//! ```
//!
//! `B_0` is the covered part of the pixel: a disc blurred by σ (R' is where a blurred disc of radius R has half its
//! height) averaged along the path swept while the shutter is open. The other terms are the ball's own brightness,
//! free in every direction: low spherical harmonics of the visible hemisphere, n = (ξ, η, ζ = √(1 - ξ² - η²)), which
//! hold the shading of a matt sphere under any distant light to 1 % (Ramamoorthi and Hanrahan 2001). They are blurred
//! with the disc: the steep fall of ζ at the rim would otherwise pass for a shift of the edge. So a bright side does
//! not pull the centre, and neither does background texture, since the background behind each pixel is known. A
//! highlight lies inside the band's inner rim or is cut off by the weights.
//!
//! ξζ and ηζ (the light's edge crossing the ball) look much like a shift of a small disc, so they cost precision:
//! they enter, like the terms of second order, only where the pixels ask for them.
//!
//! Weights are Tukey's biweight; sectors of the outline whose residuals stand out as a whole (a shadow, a reflection,
//! a hand) are left out and the fit repeated. The covariance is the fit's own, scaled by the residuals found.
//!
//! Limits: R below about 1.5 px (no inside is left to tell brightness from size); a swept path above 4 R.

use super::{Centre, Disc, Patch};
use nalgebra::{DMatrix, DVector};

/// What the fit may change besides the centre and the brightness.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Freedom {
    /// Fit the radius; otherwise the start's radius stands.
    pub radius: bool,
    /// Fit the blur; otherwise this value stands, px.
    pub blur_px: Option<f64>,
    /// Fit the length swept along the start's direction; otherwise the start's stands.
    pub swept: bool,
    /// How much work to spend.
    pub effort: Effort,
}

/// How much work to spend on a centre.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effort {
    /// A thinned band and a loose end: to tell what is round and where, to a tenth of a pixel.
    Look,
    /// Every pixel of the band, to convergence.
    Measure,
}

impl Effort {
    /// Pixels of the band at most, when each costs `points` of the swept path; a larger band is thinned evenly.
    fn most_pixels(self, points: usize) -> usize {
        match self {
            Self::Look => (5000 / points).clamp(300, 700),
            Self::Measure => (30_000 / points).clamp(1000, 3000),
        }
    }

    /// The centre has converged when a step moves it by less, px.
    const fn converged_px(self) -> f64 {
        match self {
            Self::Look => 0.01,
            Self::Measure => CONVERGED_PX,
        }
    }

    /// Times that sectors may be left out and the fit repeated.
    const fn rounds(self) -> usize {
        match self {
            Self::Look => 1,
            Self::Measure => 2,
        }
    }

    /// Steps of Gauss-Newton at most.
    const fn steps(self) -> usize {
        match self {
            Self::Look => 14,
            Self::Measure => 25,
        }
    }
}

/// Terms of the ball's brightness: 1, ζ, ξ, η, ξη, ξ² - η², ξζ, ηζ.
const SHADES: usize = 8;

/// Numbers of terms to try, each for as long as the one before gained.
const SHADE_LEVELS: [usize; 3] = [4, 6, 8];

/// Drop of the squared residuals, in noise variances, for which two more terms are let in: chance gives 14 once in a
/// thousand.
const SHADE_GAIN: f64 = 14.0;

/// The centre has converged when it moves by less, px; a hundredth of the best uncertainty in reach.
const CONVERGED_PX: f64 = 1e-5;

/// Steps that take every pixel; then outliers lose their say.
const SETTLING: usize = 5;

/// A step in which outliers have no say.
const LATE: usize = usize::MAX;

/// Least part of the outline that fixes a centre.
const LEAST_OUTLINE: f64 = 0.3;

/// A first guess of the blur where none is known, px: a lens in focus and the pixel's own square.
pub const USUAL_BLUR_PX: f64 = 0.9;

/// Range of blurs that the fit may take, px (a pixel's square alone is 0.29).
const BLUR_RANGE_PX: (f64, f64) = (0.25, 6.0);

/// A pixel of the band.
#[derive(Debug, Clone, Copy)]
struct Pixel {
    u: f64,
    v: f64,
    grey: f64,
    background: f64,
    sector: usize,
}

/// The state of the fit.
#[derive(Debug, Clone)]
struct State {
    disc: Disc,
    blur_px: f64,
    shades: [f64; SHADES],
}

/// Refines `start` on `patch`; `None` where the pixels do not hold a centre (too little outline, no convergence).
#[must_use]
pub fn refine(patch: &Patch<'_>, start: &Disc, freedom: Freedom) -> Option<Centre> {
    let blur_px = freedom.blur_px.unwrap_or(USUAL_BLUR_PX);
    let start = State {
        disc: *start,
        blur_px,
        shades: [0.0; SHADES],
    };
    let mut best = settle(patch, &start, freedom, SHADE_LEVELS[0])?;
    let richer = if freedom.effort == Effort::Look {
        &[]
    } else {
        &SHADE_LEVELS[1..]
    };
    for shades in richer.iter().copied() {
        let Some(richer) = settle(patch, &best.1, freedom, shades) else {
            break;
        };
        let scale = best.0.scale;
        let pixels = best.0.residuals.len() as f64;
        if pixels * (best.0.mean_cost(scale) - richer.0.mean_cost(scale)) < SHADE_GAIN {
            break;
        }
        best = richer;
    }
    best.0.centre(&best.1, freedom)
}

/// Fits with the first `shades` terms, leaving out sectors that do not belong, until that is settled.
fn settle(patch: &Patch<'_>, start: &State, freedom: Freedom, shades: usize) -> Option<(Fit, State)> {
    let mut state = start.clone();
    let layout = Layout::new(freedom, shades);
    let mut usable = vec![true; sector_count(start.disc.radius_px)];
    // Leaving out sectors changes the fit, which may clear or condemn others.
    for round in 0.. {
        let fit = Fit::run(patch, &mut state, layout, &usable, freedom.effort)?;
        let spoilt = fit.spoilt_sectors(&state, &usable, patch.noise_grey);
        let again = spoilt.iter().zip(&usable).any(|(&s, &u)| s && u);
        if !again || round == freedom.effort.rounds() {
            return Some((fit, state));
        }
        for (u, s) in usable.iter_mut().zip(spoilt) {
            *u &= !s;
        }
        if share(&usable) < LEAST_OUTLINE {
            return None;
        }
    }
    None
}

fn share(usable: &[bool]) -> f64 {
    usable.iter().filter(|&&u| u).count() as f64 / usable.len() as f64
}

/// A sector is about three pixels of outline.
fn sector_count(radius_px: f64) -> usize {
    ((std::f64::consts::TAU * radius_px / 3.0) as usize).clamp(8, 48)
}

/// Points along the swept path: midpoints of equal parts, so short that the blur hides the steps.
fn path_points(disc: &Disc, blur_px: f64, effort: Effort) -> usize {
    let length = disc.swept_px[0].hypot(disc.swept_px[1]);
    let (part, most) = match effort {
        Effort::Look => (1.8, 16),
        Effort::Measure => (1.2, 48),
    };
    ((length / (part * blur_px)).ceil() as usize).clamp(1, most)
}

/// Radial profiles that the terms share: 1, ζ, ρ, ρ², ρζ.
const PROFILES: usize = 5;

/// The blurred radial profiles F(r) with slope and curvature, tabulated on equal steps.
struct Profiles {
    radius_px: f64,
    blur_px: f64,
    first_px: f64,
    step_px: f64,
    rows: Vec<[f64; PROFILES]>,
}

impl Profiles {
    /// Tables from well inside the band to where nothing is left of the disc.
    fn new(state: &State, effort: Effort) -> Self {
        let (radius_px, blur_px) = (state.disc.radius_px, state.blur_px);
        let inside_px = band_inside(state);
        let rim = radius_px - half_height_shift(radius_px, blur_px);
        let (rows_a_blur, nodes) = match effort {
            Effort::Look => (6.0, 12),
            Effort::Measure => (16.0, 32),
        };
        let step_px = blur_px / rows_a_blur;
        let first_px = (rim - inside_px - 1.0).max(0.0) - 2.0 * step_px;
        let last_px = rim + 6.0 * blur_px;
        let count = ((last_px - first_px) / step_px).ceil() as usize + 3;
        let rows = (0..count)
            .map(|i| Self::row(first_px + i as f64 * step_px, rim, blur_px, nodes))
            .collect();
        Self {
            radius_px,
            blur_px,
            first_px,
            step_px,
            rows,
        }
    }

    /// Whether the tables still hold: a change this small moves no edge by a thousandth of a pixel.
    fn serves(&self, state: &State) -> bool {
        (self.radius_px - state.disc.radius_px).abs() < 2e-4 && (self.blur_px - state.blur_px).abs() < 2e-4
    }

    /// The profiles at r: ∫ f(ρ) N(r - ρR'; σ) dρR' over the disc. With ρ = sin θ the root of ζ at the rim becomes
    /// smooth, and the midpoint rule converges faster than any power.
    fn row(r: f64, rim: f64, blur_px: f64, nodes: usize) -> [f64; PROFILES] {
        let low = ((r - 5.0 * blur_px) / rim).clamp(-1.0, 1.0).asin();
        let high = ((r + 5.0 * blur_px) / rim).clamp(-1.0, 1.0).asin();
        let width = (high - low) / nodes as f64;
        let mut row = [0.0; PROFILES];
        for k in 0..nodes {
            let (rho, zeta) = (low + (k as f64 + 0.5) * width).sin_cos();
            let z = (r - rho * rim) / blur_px;
            let weight = width * zeta * rim / blur_px * (-0.5 * z * z).exp() * FRAC_1_SQRT_TAU;
            let rho = rho.abs();
            row[1] += weight * zeta;
            row[2] += weight * rho;
            row[3] += weight * rho * rho;
            row[4] += weight * rho * zeta;
        }
        // The edge itself exactly: it is what the centre hangs on.
        row[0] = normal_cdf((rim - r) / blur_px);
        row
    }

    /// (F, dF/dr, d²F/dr²) of every profile at r: a parabola through the three nearest rows.
    fn at(&self, r: f64, profiles: usize) -> [[f64; 3]; PROFILES] {
        let x = (r - self.first_px) / self.step_px;
        let mut out = [[0.0; 3]; PROFILES];
        let last = self.rows.len() as f64 - 2.0;
        if x > last {
            return out;
        }
        let i = ((x + 0.5).clamp(1.0, last)) as usize;
        let t = x - i as f64;
        let (a, b, c) = (&self.rows[i - 1], &self.rows[i], &self.rows[i + 1]);
        for (k, o) in out.iter_mut().enumerate().take(profiles) {
            let slope = 0.5 * (c[k] - a[k]);
            let bend = c[k] - 2.0 * b[k] + a[k];
            o[0] = b[k] + t * (slope + 0.5 * t * bend);
            o[1] = (slope + t * bend) / self.step_px;
            o[2] = bend / (self.step_px * self.step_px);
        }
        out
    }
}

/// What a pixel would hold of each term, and how the modelled grey changes with the outline's parameters.
#[derive(Debug, Clone, Copy, Default)]
struct Terms {
    basis: [f64; SHADES],
    grey: f64,
    du: f64,
    dv: f64,
    dr: f64,
    dblur: f64,
    dswept: f64,
}

fn terms(state: &State, profiles: &Profiles, points: usize, shades: usize, p: &Pixel) -> Terms {
    let d = &state.disc;
    let a = &state.shades;
    let mut sum = Terms::default();
    let length = d.swept_px[0].hypot(d.swept_px[1]).max(1e-9);
    // The first four terms need the first three profiles.
    let needed = if shades <= SHADE_LEVELS[0] { 3 } else { PROFILES };
    for k in 0..points {
        let s = (k as f64 + 0.5) / points as f64 - 0.5;
        let x = p.u - d.centre.u_px - s * d.swept_px[0];
        let y = p.v - d.centre.v_px - s * d.swept_px[1];
        let r = (x * x + y * y).sqrt().max(1e-9);
        let (c, t) = (x / r, y / r);
        let f = profiles.at(r, needed);
        let (c2, s2) = (c * c - t * t, c * t);
        // Angular factor, its derivative by φ, and the profile of each term.
        let angular: [(f64, f64, usize); SHADES] = [
            (1.0, 0.0, 0),
            (1.0, 0.0, 1),
            (c, -t, 2),
            (t, c, 2),
            (s2, c2, 3),
            (c2, -4.0 * s2, 3),
            (c, -t, 4),
            (t, c, 4),
        ];
        let (mut by_r, mut by_phi, mut bend) = (0.0, 0.0, 0.0);
        for (i, &(value, slope, profile)) in angular.iter().enumerate().take(shades) {
            // The background shows where the disc is not: it goes with the first term, negative.
            let amount = if i == 0 { a[0] - p.background } else { a[i] };
            let [f0, f1, f2] = f[profile];
            sum.basis[i] += f0 * value;
            sum.grey += amount * f0 * value;
            by_r += amount * f1 * value;
            by_phi += amount * f0 * slope;
            bend += amount * f2 * value;
        }
        let (gu, gv) = (by_r * c - by_phi * t / r, by_r * t + by_phi * c / r);
        sum.du -= gu;
        sum.dv -= gv;
        // A larger disc moves the profile outwards; blur obeys the heat equation, dF/dσ = σ d²F/dr².
        sum.dr -= by_r;
        sum.dblur += state.blur_px * bend;
        sum.dswept -= s * (gu * d.swept_px[0] + gv * d.swept_px[1]) / length;
    }
    let n = points as f64;
    for b in &mut sum.basis {
        *b /= n;
    }
    Terms {
        grey: p.background + sum.grey / n,
        du: sum.du / n,
        dv: sum.dv / n,
        dr: sum.dr / n,
        dblur: sum.dblur / n,
        dswept: sum.dswept / n,
        ..sum
    }
}

/// A disc of radius R blurred by σ has half its height at R - σ²/(2R), to first order in σ/R.
fn half_height_shift(radius_px: f64, blur_px: f64) -> f64 {
    (blur_px * blur_px / (2.0 * radius_px)).min(0.25 * radius_px)
}

const FRAC_1_SQRT_TAU: f64 = 0.398_942_280_401_432_7;

/// The normal distribution function by W. J. Cody's rational erfc (error below 1.2e-7: Numerical Recipes' Chebyshev
/// form), far below a grey level.
fn normal_cdf(z: f64) -> f64 {
    let x = z.abs() * std::f64::consts::FRAC_1_SQRT_2;
    let t = 1.0 / (1.0 + 0.5 * x);
    let poly = -1.265_512_23
        + t * (1.000_023_68
            + t * (0.374_091_96
                + t * (0.096_784_18
                    + t * (-0.186_288_06
                        + t * (0.278_868_07
                            + t * (-1.135_203_98
                                + t * (1.488_515_87 + t * (-0.822_152_23 + t * 0.170_872_77))))))));
    let erfc = t * (-x * x + poly).exp();
    if z >= 0.0 { 1.0 - 0.5 * erfc } else { 0.5 * erfc }
}

/// Length of (x, y); pixels neither over- nor underflow, and `hypot` is five times slower.
fn norm(x: f64, y: f64) -> f64 {
    (x * x + y * y).sqrt()
}

/// From the nearest point of the swept path to the pixel.
fn nearest_offset(disc: &Disc, u: f64, v: f64) -> (f64, f64) {
    let (x, y) = (u - disc.centre.u_px, v - disc.centre.v_px);
    let [a, b] = disc.swept_px;
    let length2 = a * a + b * b;
    if length2 < 1e-12 {
        return (x, y);
    }
    let s = ((x * a + y * b) / length2).clamp(-0.5, 0.5);
    (x - s * a, y - s * b)
}

/// Where parameters stand in the vector: centre first, then what is free, then the shades.
#[derive(Debug, Clone, Copy)]
struct Layout {
    radius: Option<usize>,
    blur: Option<usize>,
    swept: Option<usize>,
    shades: usize,
    count: usize,
}

impl Layout {
    fn new(freedom: Freedom, shades: usize) -> Self {
        let mut next = 2;
        let mut place = |free: bool| {
            free.then(|| {
                next += 1;
                next - 1
            })
        };
        let radius = place(freedom.radius);
        let blur = place(freedom.blur_px.is_none());
        let swept = place(freedom.swept);
        Self {
            radius,
            blur,
            swept,
            shades: next,
            count: next + shades,
        }
    }
}

/// One converged fit.
struct Fit {
    pixels: Vec<Pixel>,
    residuals: Vec<f64>,
    /// Robust standard deviation of the residuals, grey levels.
    scale: f64,
    covariance: DMatrix<f64>,
    layout: Layout,
    outline_used: f64,
}

impl Fit {
    fn run(
        patch: &Patch<'_>,
        state: &mut State,
        layout: Layout,
        usable: &[bool],
        effort: Effort,
    ) -> Option<Self> {
        let begin = state.disc;
        // From a fit that has settled, a few steps do; from nothing, the first ones find what the ball looks like.
        let first = if state.shades[0] == 0.0 { 0 } else { SETTLING };
        let mut pixels = gather(patch, state, usable.len(), effort);
        let mut profiles = Profiles::new(state, effort);
        let mut scale = f64::INFINITY;
        let mut residuals = Vec::new();
        let mut converged = false;
        for step in first..effort.steps() {
            if step == 3 || step == SETTLING {
                pixels = gather(patch, state, usable.len(), effort);
            }
            if pixels.len() < 3 * layout.count {
                return None;
            }
            if !profiles.serves(state) {
                profiles = Profiles::new(state, effort);
            }
            let system = System::build(&pixels, state, layout, usable, scale, step, (&profiles, effort));
            // Without a brightness the edge has no sign: the first step finds the shades alone.
            let change = if step == 0 {
                system.solve_shades(layout)?
            } else {
                system.solve()?
            };
            apply(state, &change, layout);
            if !plausible(state, &begin) {
                return None;
            }
            residuals = system.residuals;
            scale = robust_scale(&residuals, &pixels, usable).max(patch.noise_grey);
            let moved = change[0].hypot(change[1]);
            if step > SETTLING && moved < effort.converged_px() {
                converged = true;
                break;
            }
        }
        if !converged {
            // The last steps may still shuffle a pixel across the weights' rim; far from settled is no centre.
            if !profiles.serves(state) {
                profiles = Profiles::new(state, effort);
            }
            let system = System::build(&pixels, state, layout, usable, scale, LATE, (&profiles, effort));
            let change = system.solve()?;
            if change[0].hypot(change[1]) > 0.02_f64.max(3.0 * effort.converged_px()) {
                return None;
            }
        }
        if !profiles.serves(state) {
            profiles = Profiles::new(state, effort);
        }
        let system = System::build(&pixels, state, layout, usable, scale, LATE, (&profiles, effort));
        let covariance = system.covariance(scale)?;
        residuals.clone_from(&system.residuals);
        let outline_used = outline_seen(&pixels, state, usable);
        Some(Self {
            pixels,
            residuals,
            scale,
            covariance,
            layout,
            outline_used,
        })
    }

    /// Mean of the biweight's cost at `scale`: the squared residual in variances, levelling off for outliers.
    fn mean_cost(&self, scale: f64) -> f64 {
        let cut = 4.685 * scale;
        let cost = |r: f64| {
            let x = 1.0 - (r / cut).powi(2).min(1.0);
            4.685 * 4.685 / 3.0 * (1.0 - x * x * x)
        };
        self.residuals.iter().map(|&r| cost(r)).sum::<f64>() / self.residuals.len().max(1) as f64
    }

    /// Sectors whose pixels near the edge depart as a group from the model.
    fn spoilt_sectors(&self, state: &State, usable: &[bool], noise_grey: f64) -> Vec<bool> {
        let n = usable.len();
        let (mut count, mut square) = (vec![0.0; n], vec![0.0; n]);
        for (p, r) in self.pixels.iter().zip(&self.residuals) {
            let (x, y) = nearest_offset(&state.disc, p.u, p.v);
            // The inside may carry a seam or a highlight; the edge and the ground beyond it decide.
            if norm(x, y) > state.disc.radius_px - 2.0 * state.blur_px {
                count[p.sector] += 1.0;
                square[p.sector] += r * r;
            }
        }
        let mean: Vec<f64> = count
            .iter()
            .zip(&square)
            .map(|(&c, &s)| if c > 0.0 { s / c } else { f64::NAN })
            .collect();
        let mut good: Vec<f32> = mean
            .iter()
            .zip(usable)
            .filter(|(m, u)| m.is_finite() && **u)
            .map(|(&m, _)| m as f32)
            .collect();
        let typical = f64::from(super::super::background::median_in_place(&mut good));
        let limit = typical.max(noise_grey * noise_grey);
        // Mean squares of some ten pixels scatter by a half; six times the typical is not chance.
        mean.iter().map(|&m| m.is_finite() && m > 6.0 * limit).collect()
    }

    fn centre(&self, state: &State, freedom: Freedom) -> Option<Centre> {
        let c = &self.covariance;
        let covariance_px2 = [[c[(0, 0)], c[(0, 1)]], [c[(1, 0)], c[(1, 1)]]];
        let radius_std_px = self.layout.radius.map(|i| c[(i, i)].sqrt());
        let std_px = (0.5 * (c[(0, 0)] + c[(1, 1)])).sqrt();
        let good = std_px.is_finite()
            && std_px < 0.25 * state.disc.radius_px
            && self.outline_used >= LEAST_OUTLINE
            && freedom.blur_px.is_none_or(|b| b > 0.0);
        let contrast_grey = self.contrast(state);
        // An edge that does not stand out of its own residuals is no edge.
        (good && contrast_grey.abs() > self.scale).then_some(Centre {
            disc: state.disc,
            covariance_px2,
            radius_std_px,
            blur_px: state.blur_px,
            outline_used: self.outline_used,
            residual_grey: self.scale,
            contrast_grey,
        })
    }

    /// Mean height of the edge, with the sign of most of it: what the model says a full pixel just inside the rim
    /// has over its background.
    fn contrast(&self, state: &State) -> f64 {
        let profiles = Profiles::new(state, Effort::Look);
        let points = path_points(&state.disc, state.blur_px, Effort::Look);
        let shades = self.layout.count - self.layout.shades;
        let (mut sum, mut magnitude, mut n) = (0.0, 0.0, 0.0);
        for p in &self.pixels {
            let (x, y) = nearest_offset(&state.disc, p.u, p.v);
            if (norm(x, y) - state.disc.radius_px).abs() < 1.5 {
                let t = terms(state, &profiles, points, shades, p);
                let step = (t.grey - p.background) / t.basis[0].max(0.05);
                sum += step;
                magnitude += step.abs();
                n += 1.0;
            }
        }
        if n > 0.0 {
            (magnitude / n) * f64::signum(sum)
        } else {
            0.0
        }
    }
}

/// How far the band reaches inwards from the rim, px.
fn band_inside(state: &State) -> f64 {
    (0.5 * state.disc.radius_px).max(3.5 * state.blur_px + 1.0)
}

/// The band's pixels: from well inside the edge to well outside.
fn gather(patch: &Patch<'_>, state: &State, sectors: usize, effort: Effort) -> Vec<Pixel> {
    let d = &state.disc;
    let outside = 3.5 * state.blur_px + 1.0;
    let inside = band_inside(state);
    let (w, h) = (patch.crop.luma.width, patch.crop.luma.height);
    let reach_u = d.radius_px + outside + 0.5 * d.swept_px[0].abs();
    let reach_v = d.radius_px + outside + 0.5 * d.swept_px[1].abs();
    let (u0, v0) = (patch.crop.u as f64, patch.crop.v as f64);
    let span = |centre: f64, reach: f64, n: usize| {
        let low = (centre - reach).floor().max(0.0) as usize;
        let high = ((centre + reach).ceil() + 1.0).clamp(0.0, n as f64) as usize;
        low..high.max(low)
    };
    let mut pixels = Vec::new();
    // An even share of a large band: a golden-ratio sequence over the pixels' order.
    let band = std::f64::consts::TAU * d.radius_px * (inside + outside)
        + 2.0 * d.swept_px[0].hypot(d.swept_px[1]) * (inside + outside);
    let share = effort.most_pixels(path_points(d, state.blur_px, effort)) as f64 / band;
    let mut turn = 0.0;
    for row in span(d.centre.v_px - v0, reach_v, h) {
        for column in span(d.centre.u_px - u0, reach_u, w) {
            let (u, v) = (u0 + column as f64, v0 + row as f64);
            let (x, y) = nearest_offset(d, u, v);
            let distance = norm(x, y) - d.radius_px;
            if distance > -inside && distance < outside {
                turn += 0.618_033_988_749_894_9;
                if turn % 1.0 > share {
                    continue;
                }
                let i = row * w + column;
                let value = patch.crop.luma.data[i];
                // A clipped pixel only says "at least"; inside a saturated ball that is the truth of the picture,
                // so clipped pixels stay, and the brightness fitted is the clipped one.
                let around = y.atan2(x) / std::f64::consts::TAU + 0.5;
                let sector = ((around * sectors as f64) as usize).min(sectors - 1);
                pixels.push(Pixel {
                    u,
                    v,
                    grey: f64::from(value),
                    background: f64::from(patch.background[i]),
                    sector,
                });
            }
        }
    }
    pixels
}

/// Part of the outline that has usable pixels on both sides of the edge.
fn outline_seen(pixels: &[Pixel], state: &State, usable: &[bool]) -> f64 {
    let mut inner = vec![false; usable.len()];
    let mut outer = vec![false; usable.len()];
    for p in pixels {
        let (x, y) = nearest_offset(&state.disc, p.u, p.v);
        let distance = norm(x, y) - state.disc.radius_px;
        if distance < 0.0 {
            inner[p.sector] = true;
        } else {
            outer[p.sector] = true;
        }
    }
    let seen = (0..usable.len())
        .filter(|&i| usable[i] && inner[i] && outer[i])
        .count();
    seen as f64 / usable.len() as f64
}

/// 1.4826 × the median absolute residual of the usable pixels.
fn robust_scale(residuals: &[f64], pixels: &[Pixel], usable: &[bool]) -> f64 {
    let mut magnitudes: Vec<f32> = residuals
        .iter()
        .zip(pixels)
        .filter(|(_, p)| usable[p.sector])
        .map(|(r, _)| r.abs() as f32)
        .collect();
    1.4826 * f64::from(super::super::background::median_in_place(&mut magnitudes))
}

fn apply(state: &mut State, change: &DVector<f64>, layout: Layout) {
    let limit = 0.5 * state.blur_px.max(0.1 * state.disc.radius_px);
    let clip = |x: f64| x.clamp(-limit, limit);
    state.disc.centre.u_px += clip(change[0]);
    state.disc.centre.v_px += clip(change[1]);
    if let Some(i) = layout.radius {
        state.disc.radius_px = (state.disc.radius_px + clip(change[i])).max(0.5);
    }
    if let Some(i) = layout.blur {
        let step = change[i].clamp(-0.5 * state.blur_px, state.blur_px);
        state.blur_px = (state.blur_px + step).clamp(BLUR_RANGE_PX.0, BLUR_RANGE_PX.1);
    }
    if let Some(i) = layout.swept {
        let [a, b] = state.disc.swept_px;
        let length = a.hypot(b).max(1e-9);
        let longer = (length + change[i].clamp(-0.5 * length, 0.5 * length + 0.5)).max(0.05);
        state.disc.swept_px = [a * longer / length, b * longer / length];
    }
    for (shade, step) in state.shades.iter_mut().zip(change.iter().skip(layout.shades)) {
        *shade += step;
    }
}

/// The fit may not wander off: another edge is another thing.
fn plausible(state: &State, begin: &Disc) -> bool {
    let d = &state.disc;
    d.centre.u_px.is_finite()
        && d.centre.v_px.is_finite()
        && d.centre.distance_px(begin.centre) < 0.7 * begin.radius_px + 1.0
        && d.radius_px > 0.4 * begin.radius_px
        && d.radius_px < 2.0 * begin.radius_px
        && d.swept_px[0].hypot(d.swept_px[1]) < 6.0 * begin.radius_px + 1.0
}

/// The weighted normal equations of one step.
struct System {
    normal: DMatrix<f64>,
    right: DVector<f64>,
    residuals: Vec<f64>,
}

impl System {
    fn build(
        pixels: &[Pixel],
        state: &State,
        layout: Layout,
        usable: &[bool],
        scale: f64,
        step: usize,
        (profiles, effort): (&Profiles, Effort),
    ) -> Self {
        let n = layout.count;
        let mut normal = DMatrix::zeros(n, n);
        let mut right = DVector::zeros(n);
        let mut residuals = Vec::with_capacity(pixels.len());
        let points = path_points(&state.disc, state.blur_px, effort);
        let shades = n - layout.shades;
        // The first steps may start a pixel off.
        let cut = if step < SETTLING - 1 || !scale.is_finite() {
            f64::INFINITY
        } else {
            4.685 * scale
        };
        let mut row = vec![0.0; n];
        for p in pixels {
            let t = terms(state, profiles, points, shades, p);
            let residual = p.grey - t.grey;
            residuals.push(residual);
            if !usable[p.sector] || residual.abs() >= cut {
                continue;
            }
            let weight = if cut.is_finite() {
                (1.0 - (residual / cut).powi(2)).powi(2)
            } else {
                1.0
            };
            row[0] = t.du;
            row[1] = t.dv;
            if let Some(i) = layout.radius {
                row[i] = t.dr;
            }
            if let Some(i) = layout.blur {
                row[i] = t.dblur;
            }
            if let Some(i) = layout.swept {
                row[i] = t.dswept;
            }
            row[layout.shades..].copy_from_slice(&t.basis[..n - layout.shades]);
            for i in 0..n {
                let wi = weight * row[i];
                right[i] += wi * residual;
                for j in 0..=i {
                    normal[(i, j)] += wi * row[j];
                }
            }
        }
        for i in 0..n {
            for j in 0..i {
                normal[(j, i)] = normal[(i, j)];
            }
        }
        Self {
            normal,
            right,
            residuals,
        }
    }

    /// The step; a whisper of damping keeps shades that a small ball cannot tell apart from running away.
    fn solve(&self) -> Option<DVector<f64>> {
        let change = self.damped_normal().cholesky()?.solve(&self.right);
        change.iter().all(|x| x.is_finite()).then_some(change)
    }

    /// The step of the shades with everything else held.
    fn solve_shades(&self, layout: Layout) -> Option<DVector<f64>> {
        let n = layout.count;
        let mut held = self.damped_normal();
        let mut right = self.right.clone();
        for i in 0..layout.shades {
            for j in 0..n {
                held[(i, j)] = 0.0;
                held[(j, i)] = 0.0;
            }
            held[(i, i)] = 1.0;
            right[i] = 0.0;
        }
        let change = held.cholesky()?.solve(&right);
        change.iter().all(|x| x.is_finite()).then_some(change)
    }

    fn damped_normal(&self) -> DMatrix<f64> {
        let mut normal = self.normal.clone();
        for i in 0..normal.nrows() {
            normal[(i, i)] = normal[(i, i)] * (1.0 + 1e-9) + 1e-9;
        }
        normal
    }

    fn covariance(&self, scale: f64) -> Option<DMatrix<f64>> {
        Some(self.damped_normal().cholesky()?.inverse() * (scale * scale))
    }
}
