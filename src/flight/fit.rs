//! The arcs of a flight fitted together: each with its own place and velocity, all with the same gravity and drag.
//!
//! ```text
//! r'' = -β |v| r'          h'' = -g - β |v| h'          |v| = √(r'² + h'²)
//! ```
//!
//! with place and velocity of arc k at its mean time t_k. Without drag (β = 0) that is the exact parabola and the fit
//! is linear. With drag (Newton's, β = ρ C_d π R² / 2m) the motion is integrated by Runge-Kutta of fourth order and the
//! fit is Gauss-Newton; drag is a small part, so three steps settle it. β comes with a prior where the ball's mass and
//! size are known; otherwise it is fitted where the flight shows it, and zero elsewhere.
//!
//! Weighted least squares by QR of the whitened rows; times are centred, so nothing is lost at late times. The
//! covariance is that of the QR, times the excess of the residuals over the stated uncertainties (never below 1).

use super::overhead::{self, Overhead};
use super::segment::Sample;
use nalgebra::{DMatrix, DVector};

/// A point for the fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitPoint {
    /// The arc it belongs to.
    pub arc: usize,
    /// Time, place, weight.
    pub sample: Sample,
}

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

/// What is known of the forces on the ball in flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Forces {
    /// Gravity is fitted; drag where the flight shows it.
    Fall,
    /// Gravity is fitted; drag β is known to be this ± that, 1 / plane unit.
    FallWithDrag(f64, f64),
    /// None that shows: a top view from far away.
    None,
    /// Towards the floor, which a camera above sees by perspective.
    Overhead(Overhead),
}

impl Forces {
    /// Whether gravity acts in the plane.
    #[must_use]
    pub fn falls(self) -> bool {
        matches!(self, Self::Fall | Self::FallWithDrag(..))
    }
}

/// Index of gravity in the parameters.
pub const GRAVITY: usize = 0;
/// Index of drag in the parameters.
pub const DRAG: usize = 1;
/// Index of the first arc's place in the parameters; four an arc: r, vr, h, vh at the arc's mean time.
pub const ARCS: usize = 2;

/// The fitted arcs.
#[derive(Debug, Clone)]
pub struct ArcFit {
    /// Mean time of each arc, s.
    pub times: Vec<f64>,
    /// g, β, then r, vr, h, vh of each arc at its mean time.
    pub parameters: DVector<f64>,
    /// Their covariance, excess included.
    pub covariance: DMatrix<f64>,
    /// Root mean square residual over stated uncertainty.
    pub excess: f64,
    /// (1 + ρ)/(1 − ρ) for the correlation ρ of successive residuals, 1 where it does not show; in the covariance.
    pub persistence: f64,
    /// The forces that were assumed.
    pub forces: Forces,
}

/// Drag without a prior is believed when it stands out by this many standard uncertainties.
const DRAG_SIGMAS: f64 = 4.0;

/// A step of Gauss-Newton that changes no residual by more than this part of its uncertainty is the last.
const SETTLED: f64 = 1e-6;

impl ArcFit {
    /// Fits `arcs` arcs to `points`; `None` when some arc has too few points, or gravity is not determined.
    #[must_use]
    pub fn new(points: &[FitPoint], arcs: usize, forces: Forces) -> Option<Self> {
        if let Forces::Overhead(known) = forces {
            return Self::overhead(points, arcs, known);
        }
        let plain = Self::with(points, arcs, forces, None)?;
        match forces {
            Forces::None | Forces::Overhead(_) => Some(plain),
            Forces::FallWithDrag(..) => Self::with(points, arcs, forces, Some(&plain)),
            Forces::Fall => {
                let dragged = Self::with(points, arcs, forces, Some(&plain));
                let shows = |f: &Self| {
                    let std = f.covariance[(DRAG, DRAG)].max(0.0).sqrt();
                    f.drag() > DRAG_SIGMAS * std && f.excess < plain.excess
                };
                Some(dragged.filter(shows).unwrap_or(plain))
            }
        }
    }

    /// Without drag, or with it from the fit without.
    fn with(points: &[FitPoint], arcs: usize, forces: Forces, plain: Option<&Self>) -> Option<Self> {
        let times = mean_times(points, arcs)?;
        let drag = plain.is_some();
        let mut parameters = plain.map_or_else(|| DVector::zeros(ARCS + 4 * arcs), |p| p.parameters.clone());
        let held = [!forces.falls(), !drag];
        let mut covariance = None;
        let mut chi2 = f64::NAN;
        // Linear without drag: one step is the solution, the second shows that nothing moves.
        for _ in 0..if drag { 8 } else { 1 } {
            let (matrix, right) = system(points, &times, &parameters, forces, held);
            let (step, inverse) = solve(&matrix, &right)?;
            parameters += &step;
            covariance = Some(inverse);
            let change = &matrix * &step;
            if change.amax() < SETTLED {
                break;
            }
        }
        let (_, right) = system(points, &times, &parameters, forces, held);
        let rows = 2 * points.len();
        if right.iter().all(|x| x.is_finite()) {
            chi2 = right.norm_squared();
        }
        let fitted = ARCS + 4 * arcs - held.iter().filter(|&&h| h).count();
        let freedom = rows.saturating_sub(fitted);
        let excess = if freedom > 0 {
            (chi2 / freedom as f64).sqrt()
        } else {
            1.0
        };
        let persistence = persistence(points, &right);
        let mut covariance = covariance? * (excess.max(1.0).powi(2) * persistence);
        for (i, _) in held.iter().enumerate().filter(|(_, h)| **h) {
            covariance[(i, i)] = 0.0;
        }
        excess.is_finite().then_some(Self {
            times,
            parameters,
            covariance,
            excess,
            persistence,
            forces,
        })
    }

    /// How the parameters follow, to first order, when each of the fit's `points` moves by its shift along r and h (plane
    /// units). `None` where these points do not determine them.
    #[must_use]
    pub fn response(&self, points: &[FitPoint], shifts: &[(f64, f64)]) -> Option<DVector<f64>> {
        if let Forces::Overhead(known) = &self.forces {
            return overhead::fit::response(points, self.arcs(), known, &self.parameters, shifts);
        }
        // What was held has no variance.
        let held = [GRAVITY, DRAG].map(|i| self.covariance[(i, i)] == 0.0);
        let (matrix, mut right) = system(points, &self.times, &self.parameters, self.forces, held);
        right.fill(0.0);
        for (i, (p, (dr, dh))) in points.iter().zip(shifts).enumerate() {
            let w = p.sample.weight.sqrt();
            right[2 * i] = w * dr;
            right[2 * i + 1] = w * dh;
        }
        solve(&matrix, &right).map(|(change, _)| change)
    }

    /// Number of arcs.
    #[must_use]
    pub fn arcs(&self) -> usize {
        self.times.len()
    }

    /// Fitted gravity, plane units/s².
    #[must_use]
    pub fn gravity(&self) -> f64 {
        self.parameters[GRAVITY]
    }

    /// Drag β in use, 1 / plane unit.
    #[must_use]
    pub fn drag(&self) -> f64 {
        self.parameters[DRAG]
    }

    /// Motion on arc `k` at time `t` with the fitted parameters, as the plane shows it: what spots are compared with.
    #[must_use]
    pub fn motion(&self, k: usize, t: f64) -> Motion {
        let p = self.parameters.as_slice();
        match &self.forces {
            Forces::Overhead(known) => overhead::seen(
                known,
                p,
                &self.times,
                &overhead::flying(known, p, &self.times, k, t),
            ),
            _ => motion(p, &self.times, k, t),
        }
    }

    /// Speed on arc `k` at time `t`, plane units a second.
    #[must_use]
    pub fn speed(&self, k: usize, t: f64) -> f64 {
        let p = self.parameters.as_slice();
        match &self.forces {
            Forces::Overhead(known) => known.speed(&overhead::flying(known, p, &self.times, k, t)),
            _ => {
                let m = motion(p, &self.times, k, t);
                m.vr.hypot(m.vh)
            }
        }
    }

    /// Motion on arc `k` at time `t` for any parameters of this fit's layout, in the calibrated plane (of a ball seen by
    /// a camera above: over the floor).
    #[must_use]
    pub fn in_plane(&self, parameters: &[f64], k: usize, t: f64) -> Motion {
        match &self.forces {
            Forces::Overhead(known) => overhead::flying(known, parameters, &self.times, k, t).ground,
            _ => motion(parameters, &self.times, k, t),
        }
    }

    /// Time of the impact between arcs `k` and `k + 1` for any parameters of this fit's layout, s; `None` when the two
    /// do not part, or `k` is the last arc.
    #[must_use]
    pub fn impact_time(&self, parameters: &[f64], k: usize) -> Option<f64> {
        if k + 1 >= self.arcs() {
            return None;
        }
        match &self.forces {
            Forces::Overhead(_) => Some(parameters[overhead::Layout::new(self.arcs()).impact(k)]),
            _ => meeting(parameters, &self.times, k, k + 1).map(|m| m.0),
        }
    }
}

/// Factor on a covariance for errors that last from point to point (a codec's, a lamp's): (1 + ρ)/(1 − ρ) with ρ the
/// correlation of successive residuals of one arc; 1 where it does not show.
pub(super) fn persistence(points: &[FitPoint], residuals: &DVector<f64>) -> f64 {
    let (mut product, mut square, mut pairs) = (0.0, 0.0, 0.0);
    for (i, w) in points.windows(2).enumerate() {
        if w[0].arc == w[1].arc {
            for k in 0..2 {
                let (a, b) = (residuals[2 * i + k], residuals[2 * i + 2 + k]);
                product += a * b;
                square += 0.5 * (a * a + b * b);
                pairs += 1.0;
            }
        }
    }
    if !(pairs > 8.0 && square > 0.0) {
        return 1.0;
    }
    // Chance alone gives 1/√pairs; the fit itself takes a little correlation away.
    let rho = (product / square).clamp(0.0, MOST_PERSISTENT);
    if rho < 1.0 / f64::sqrt(pairs) {
        1.0
    } else {
        (1.0 + rho) / (1.0 - rho)
    }
}

/// A path that is no parabola (perspective, a drifting camera) leaves residuals that hang together over a whole arc; at
/// this correlation some 60 points count for one.
const MOST_PERSISTENT: f64 = 0.97;

/// Mean time of each arc's points; `None` when one has fewer than two.
pub(super) fn mean_times(points: &[FitPoint], arcs: usize) -> Option<Vec<f64>> {
    let start = points.first()?.sample.t;
    let mut sums = vec![(0.0, 0.0); arcs];
    for p in points {
        sums[p.arc].0 += p.sample.t - start;
        sums[p.arc].1 += 1.0;
    }
    let enough = sums.iter().all(|s| s.1 >= 2.0) && 2 * points.len() > 4 * arcs;
    enough.then(|| sums.iter().map(|s| start + s.0 / s.1).collect())
}

/// Whitened Jacobian and residuals at `parameters`; a parameter that is held gets a row of its own.
fn system(
    points: &[FitPoint],
    times: &[f64],
    parameters: &DVector<f64>,
    forces: Forces,
    held: [bool; 2],
) -> (DMatrix<f64>, DVector<f64>) {
    let prior = match forces {
        Forces::FallWithDrag(value, std) if !held[DRAG] => Some((value, std)),
        _ => None,
    };
    let extra = held.iter().filter(|&&h| h).count() + usize::from(prior.is_some());
    let rows = 2 * points.len() + extra;
    let mut matrix = DMatrix::zeros(rows, parameters.len());
    let mut right = DVector::zeros(rows);
    for (i, p) in points.iter().enumerate() {
        let t = p.sample.t - times[p.arc];
        let w = p.sample.weight.sqrt();
        let c = ARCS + 4 * p.arc;
        let m = motion(parameters.as_slice(), times, p.arc, p.sample.t);
        right[2 * i] = w * (p.sample.r - m.r);
        right[2 * i + 1] = w * (p.sample.h - m.h);
        matrix[(2 * i, c)] = w;
        matrix[(2 * i, c + 1)] = w * t;
        matrix[(2 * i + 1, c + 2)] = w;
        matrix[(2 * i + 1, c + 3)] = w * t;
        if !held[GRAVITY] {
            matrix[(2 * i + 1, GRAVITY)] = -0.5 * w * t * t;
        }
        if !held[DRAG] {
            let (dr, dh) = drag_shift(parameters.as_slice(), times, p.arc, p.sample.t);
            matrix[(2 * i, DRAG)] = w * dr;
            matrix[(2 * i + 1, DRAG)] = w * dh;
        }
    }
    let mut row = 2 * points.len();
    for (i, _) in held.iter().enumerate().filter(|(_, h)| **h) {
        matrix[(row, i)] = 1.0;
        row += 1;
    }
    if let Some((value, std)) = prior {
        matrix[(row, DRAG)] = 1.0 / std;
        right[row] = (value - parameters[DRAG]) / std;
    }
    (matrix, right)
}

/// Shift of the place at `t` by a unit of drag, to first order.
fn drag_shift(parameters: &[f64], times: &[f64], k: usize, t: f64) -> (f64, f64) {
    let m = pushed_by(parameters, times, k, t, |vr, vh| {
        let speed = vr.hypot(vh);
        (-speed * vr, -speed * vh)
    });
    (m.r, m.h)
}

/// What an acceleration `field` of the velocity (along r and h) adds to the motion on arc `k` from its mean time to `t`,
/// to first order: its integrals along the parabola.
#[must_use]
pub fn pushed_by(
    parameters: &[f64],
    times: &[f64],
    k: usize,
    t: f64,
    field: impl Fn(f64, f64) -> (f64, f64),
) -> Motion {
    const PARTS: usize = 12;
    let (g, a) = (parameters[GRAVITY], &parameters[ARCS + 4 * k..ARCS + 4 * k + 4]);
    let dt = (t - times[k]) / PARTS as f64;
    let mut sum = Motion {
        r: 0.0,
        h: 0.0,
        vr: 0.0,
        vh: 0.0,
    };
    // ∫∫ f = ∫ (t - s) f(s) ds: Simpson's rule needs no second integration.
    for i in 0..=PARTS {
        let (fr, fh) = field(a[1], a[3] - g * i as f64 * dt);
        let weight = match i {
            0 | PARTS => 1.0,
            _ if i % 2 == 1 => 4.0,
            _ => 2.0,
        } * dt
            / 3.0;
        let lever = (PARTS - i) as f64 * dt;
        sum.r += weight * lever * fr;
        sum.h += weight * lever * fh;
        sum.vr += weight * fr;
        sum.vh += weight * fh;
    }
    sum
}

/// Motion on arc `k` at time `t` for any parameter vector of [`ArcFit`]'s layout.
#[must_use]
pub fn motion(parameters: &[f64], times: &[f64], k: usize, t: f64) -> Motion {
    let (g, beta) = (parameters[GRAVITY], parameters[DRAG]);
    let a = &parameters[ARCS + 4 * k..ARCS + 4 * k + 4];
    let dt = t - times[k];
    if beta == 0.0 {
        return Motion {
            r: a[0] + a[1] * dt,
            h: a[2] + (a[3] - 0.5 * g * dt) * dt,
            vr: a[1],
            vh: a[3] - g * dt,
        };
    }
    integrate(
        Motion {
            r: a[0],
            vr: a[1],
            h: a[2],
            vh: a[3],
        },
        g,
        beta,
        dt,
    )
}

/// Runge-Kutta of fourth order over `dt` in eight steps: with drag a tenth of gravity the error is below 1e-7 of the
/// way.
fn integrate(start: Motion, g: f64, beta: f64, dt: f64) -> Motion {
    const PARTS: usize = 8;
    let rate = |m: &Motion| {
        let speed = m.vr.hypot(m.vh);
        Motion {
            r: m.vr,
            h: m.vh,
            vr: -beta * speed * m.vr,
            vh: -g - beta * speed * m.vh,
        }
    };
    let along = |m: &Motion, d: &Motion, s: f64| Motion {
        r: m.r + s * d.r,
        h: m.h + s * d.h,
        vr: m.vr + s * d.vr,
        vh: m.vh + s * d.vh,
    };
    let s = dt / PARTS as f64;
    let mut m = start;
    for _ in 0..PARTS {
        let a = rate(&m);
        let b = rate(&along(&m, &a, 0.5 * s));
        let c = rate(&along(&m, &b, 0.5 * s));
        let d = rate(&along(&m, &c, s));
        for (part, slope) in [(1.0, &a), (2.0, &b), (2.0, &c), (1.0, &d)] {
            m = along(&m, slope, s * part / 6.0);
        }
    }
    m
}

/// When and how closely arcs `a` and `b` meet, for any parameter vector: (time, distance there). `None` when the two
/// have the same velocity.
///
/// With one gravity and no drag the difference of two arcs is linear in time, so the time of least distance is a
/// quotient, without a root; drag is settled by repeating it.
#[must_use]
pub fn meeting(parameters: &[f64], times: &[f64], a: usize, b: usize) -> Option<(f64, f64)> {
    let mut t = 0.5 * (times[a] + times[b]);
    let rounds = if parameters[DRAG] == 0.0 { 1 } else { 6 };
    let mut gap = f64::NAN;
    for _ in 0..rounds {
        let (p, q) = (motion(parameters, times, a, t), motion(parameters, times, b, t));
        let (dr, dh) = (q.r - p.r, q.h - p.h);
        let (dvr, dvh) = (q.vr - p.vr, q.vh - p.vh);
        let speed2 = dvr * dvr + dvh * dvh;
        if !(speed2 > 0.0) {
            return None;
        }
        let step = -(dr * dvr + dh * dvh) / speed2;
        gap = (dr + dvr * step).hypot(dh + dvh * step);
        t += step;
    }
    (t.is_finite() && gap.is_finite()).then_some((t, gap))
}

/// Time after `t` at which arc `k`, rising at `t`, is back at its height of then; NaN when it does not rise.
#[must_use]
pub fn return_time(parameters: &[f64], times: &[f64], k: usize, t: f64) -> f64 {
    let start = motion(parameters, times, k, t);
    let g = parameters[GRAVITY];
    if !(g > 0.0 && start.vh > 0.0) {
        return f64::NAN;
    }
    let mut duration = 2.0 * start.vh / g;
    if parameters[DRAG] != 0.0 {
        for _ in 0..6 {
            let m = motion(parameters, times, k, t + duration);
            duration -= (m.h - start.h) / m.vh;
        }
    }
    duration
}

/// Least squares by QR with scaled columns; the parameters and (AᵀA)⁻¹. `None` when rank-deficient: what is not
/// determined has no number.
pub(super) fn solve(matrix: &DMatrix<f64>, right: &DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let scale: Vec<f64> = matrix.column_iter().map(|c| c.norm()).collect();
    if scale.iter().any(|&s| !(s > 0.0 && s.is_finite())) {
        return None;
    }
    let mut scaled = matrix.clone();
    for (mut column, s) in scaled.column_iter_mut().zip(&scale) {
        column /= *s;
    }
    let qr = scaled.qr();
    let r = qr.r();
    // Relative size of the smallest pivot: columns are of unit length, so this is a plain rank test.
    if (0..r.ncols()).any(|i| r[(i, i)].abs() < 1e-10) {
        return None;
    }
    let mut qtb = right.clone();
    qr.q_tr_mul(&mut qtb);
    let top = qtb.rows(0, r.ncols()).into_owned();
    let mut solution = r.solve_upper_triangular(&top)?;
    let inverse = r.solve_upper_triangular(&DMatrix::identity(r.ncols(), r.ncols()))?;
    let mut covariance = &inverse * inverse.transpose();
    for i in 0..scale.len() {
        solution[i] /= scale[i];
        for j in 0..scale.len() {
            covariance[(i, j)] /= scale[i] * scale[j];
        }
    }
    solution
        .iter()
        .all(|x| x.is_finite())
        .then_some((solution, covariance))
}
