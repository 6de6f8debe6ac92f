//! The arcs of a flight fitted together: each with its own place and velocity, all with the same gravity and drag.
//!
//! ```text
//! r'' = a - β |v| r'          h'' = -g - β |v| h'          |v| = √(r'² + h'²)
//! ```
//!
//! a, the acceleration along r, is what gravity has there where "up" of the picture is not quite the plane's: the fall leans
//! by atan(a/g). What is known of that beforehand is a prior of a ([`VerticalPrior`]).
//!
//! with place and velocity of arc k at its mean time t_k ([`PlanarArcs`]). Without drag (β = 0) that is the exact parabola and
//! the fit is linear. With drag (β = ρ C_D π R² / 2m) the fit is Gauss-Newton; drag is a small part, so three steps settle
//! it. β comes with a prior, and with the way it changes with the speed, where the ball's mass and size are known; otherwise
//! it is the same at all speeds, and anything from none to that of a light ball.
//!
//! Weighted least squares by QR of the whitened rows; times are centred, so nothing is lost at late times. The
//! covariance is that of the QR, times the reduced chi squared (never below 1).

use super::drag::{Drag, DragLaw, USUAL_LIGHT_DRAG};
use super::overhead::{self, Overhead};
use super::planar::PlanarArcs;
pub use super::planar::{ACROSS, ARCS, DRAG, GRAVITY, Motion};
use super::segment::{Gravity, TrackSample};
use nalgebra::{DMatrix, DVector};

/// A point for the fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitPoint {
    /// The arc it belongs to.
    pub arc: usize,
    /// Time, place, weight.
    pub sample: TrackSample,
}

/// How well the direction of "up" is known without the fall: the standard uncertainty of the angle by which the fall may lean,
/// rad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VerticalPrior {
    /// rad; infinite where only the fall tells, 0 where the fall is taken not to lean unless it does by more than is tolerated.
    pub std_rad: f64,
    /// A fall that leans by less does not contradict what is known, rad.
    pub tolerated_rad: f64,
}

impl VerticalPrior {
    /// Nothing is known: the fall alone tells.
    pub const UNKNOWN: Self = Self {
        std_rad: f64::INFINITY,
        tolerated_rad: 0.0,
    };

    /// A camera that stands level, as far as rough centres tell: while arcs are looked for, so that what is no ball's path does not
    /// pass for one that leans.
    pub const LEVEL_CAMERA: Self = Self {
        std_rad: 0.0,
        tolerated_rad: 0.035,
    };

    /// Known to a standard uncertainty.
    #[must_use]
    pub const fn known_to(std_rad: f64) -> Self {
        Self {
            std_rad,
            tolerated_rad: 0.0,
        }
    }
}

/// What is known of the forces on the ball in flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Forces {
    /// Gravity is fitted; drag where the flight shows it.
    Fall(VerticalPrior),
    /// Gravity is fitted; this is known of drag.
    FallWithDrag(VerticalPrior, Drag),
    /// None that shows: a top view from far away.
    None,
    /// Towards the floor, which a camera above sees by perspective.
    Overhead(Overhead),
}

impl Forces {
    /// Whether gravity acts in the plane.
    #[must_use]
    pub fn falls(self) -> bool {
        matches!(self, Self::Fall(_) | Self::FallWithDrag(..))
    }

    /// What is known of "up" where gravity acts in the plane.
    #[must_use]
    pub fn vertical(&self) -> Option<VerticalPrior> {
        match self {
            Self::Fall(upright) | Self::FallWithDrag(upright, _) => Some(*upright),
            Self::None | Self::Overhead(_) => None,
        }
    }

    /// The same with another prior of "up".
    #[must_use]
    pub fn with_vertical(self, upright: VerticalPrior) -> Self {
        match self {
            Self::Fall(_) => Self::Fall(upright),
            Self::FallWithDrag(_, drag) => Self::FallWithDrag(upright, drag),
            other => other,
        }
    }

    /// The same where nothing is known of the ball's drag: none to that of a light ball of this `radius`, plane units.
    /// Without that a lean of the fall would take the place of what drag does along the path.
    #[must_use]
    pub fn with_unknown_drag(self, radius: f64) -> Self {
        match self {
            Self::Fall(upright) if radius > 0.0 => {
                Self::FallWithDrag(upright, Drag::unknown(USUAL_LIGHT_DRAG / radius))
            }
            other => other,
        }
    }

    /// How drag changes with the speed.
    #[must_use]
    pub fn drag_law(&self) -> DragLaw {
        match self {
            Self::FallWithDrag(_, drag) => drag.law,
            _ => DragLaw::default(),
        }
    }
}

/// The fitted arcs.
#[derive(Debug, Clone)]
pub struct ArcFit {
    /// Mean time of each arc, s.
    pub times: Vec<f64>,
    /// g, β, the acceleration along r, then r, vr, h, vh of each arc at its mean time.
    pub parameters: DVector<f64>,
    /// Their covariance, reduced chi squared and autocorrelation inflation included.
    pub covariance: DMatrix<f64>,
    /// Reduced chi, √(χ²/ν): root mean square residual over stated uncertainty.
    pub reduced_chi: f64,
    /// (1 + ρ)/(1 − ρ) for the correlation ρ of successive residuals, 1 where it does not show; in the covariance.
    pub autocorrelation_inflation: f64,
    /// The forces that were assumed.
    pub forces: Forces,
}

/// Drag without a prior is believed when it stands out by this many standard uncertainties.
const DRAG_SIGMAS: f64 = 4.0;

/// What is known of "up" is contradicted by a fall that leans by more than this many standard uncertainties.
const CONTRADICTS_SIGMAS: f64 = 4.0;

/// And whatever is tolerated, by one that leans by more than this many.
const CERTAIN_SIGMAS: f64 = 8.0;

/// A step of Gauss-Newton that changes no residual by more than this part of its uncertainty is the last.
const SETTLED: f64 = 1e-6;

impl ArcFit {
    /// Fits `arcs` arcs to `points`; `None` when some arc has too few points, or gravity is not determined. What is known of
    /// "up" counts unless the fall contradicts it.
    #[must_use]
    pub fn new(points: &[FitPoint], arcs: usize, forces: Forces) -> Option<Self> {
        let free = || Self::as_known(points, arcs, forces.with_vertical(VerticalPrior::UNKNOWN));
        let known = || Self::as_known(points, arcs, forces);
        match forces.vertical() {
            Some(upright) if upright.std_rad.is_finite() => {
                let seen = free().filter(|f| f.lean_contradicts(upright));
                seen.or_else(known)
            }
            _ => known(),
        }
    }

    fn as_known(points: &[FitPoint], arcs: usize, forces: Forces) -> Option<Self> {
        if let Forces::Overhead(known) = forces {
            return Self::overhead(points, arcs, known);
        }
        let plain = Self::with(points, arcs, forces, None)?;
        match forces {
            Forces::None | Forces::Overhead(_) => Some(plain),
            Forces::FallWithDrag(_, drag) => {
                let dragged = Self::with(points, arcs, forces, Some(&plain));
                // No ball is driven by the air: where nothing is known of its drag and the points show less than none, it has none.
                let drives = |f: &Self| drag.beta == 0.0 && !(f.drag() > 0.0);
                match dragged {
                    Some(f) if drives(&f) => Some(plain),
                    other => other,
                }
            }
            Forces::Fall(_) => {
                let dragged = Self::with(points, arcs, forces, Some(&plain));
                let shows = |f: &Self| {
                    let std = f.covariance[(DRAG, DRAG)].max(0.0).sqrt();
                    f.drag() > DRAG_SIGMAS * std && f.reduced_chi < plain.reduced_chi
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
        let stands = forces.vertical().is_none_or(|u| u.std_rad == 0.0);
        let held = [!forces.falls(), !drag, stands];
        let mut covariance = None;
        let mut chi2 = f64::NAN;
        // Linear without drag: one step is the solution, the second shows that nothing moves.
        // A prior of the lean goes with gravity, which the first step finds.
        let rounds = match (drag, forces.vertical()) {
            (true, _) => 8,
            (false, Some(upright)) if upright.std_rad.is_finite() => 2,
            (false, _) => 1,
        };
        for _ in 0..rounds {
            let (matrix, right) = system(points, &times, &parameters, forces, held);
            let (mut step, inverse) = solve(&matrix, &right)?;
            keep(&mut step, held);
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
        let reduced_chi = if freedom > 0 {
            (chi2 / freedom as f64).sqrt()
        } else {
            1.0
        };
        let autocorrelation_inflation = autocorrelation_inflation(points, &right);
        let mut covariance = covariance? * (reduced_chi.max(1.0).powi(2) * autocorrelation_inflation);
        for (i, _) in held.iter().enumerate().filter(|(_, h)| **h) {
            covariance[(i, i)] = 0.0;
        }
        reduced_chi.is_finite().then_some(Self {
            times,
            parameters,
            covariance,
            reduced_chi,
            autocorrelation_inflation,
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
        let held = [GRAVITY, DRAG, ACROSS].map(|i| self.covariance[(i, i)] == 0.0);
        let (matrix, mut right) = system(points, &self.times, &self.parameters, self.forces, held);
        right.fill(0.0);
        for (i, (p, (dr, dh))) in points.iter().zip(shifts).enumerate() {
            let w = p.sample.weight.sqrt();
            right[2 * i] = w * dr;
            right[2 * i + 1] = w * dh;
        }
        let (mut change, _) = solve(&matrix, &right)?;
        keep(&mut change, held);
        Some(change)
    }

    /// Number of arcs.
    #[must_use]
    pub fn arcs(&self) -> usize {
        self.times.len()
    }

    /// Size of the fitted gravity, plane units/s².
    #[must_use]
    pub fn gravity(&self) -> f64 {
        match self.parameters[ACROSS] {
            0.0 => self.parameters[GRAVITY],
            across => self.parameters[GRAVITY]
                .hypot(across)
                .copysign(self.parameters[GRAVITY]),
        }
    }

    /// By how much the fall leans along +r, rad: "up" of the plane is turned by so much from that of the picture, towards −r.
    #[must_use]
    pub fn lean_rad(&self) -> f64 {
        lean_rad(self.parameters.as_slice())
    }

    /// Standard uncertainty of the lean, rad.
    #[must_use]
    pub fn lean_std_rad(&self) -> f64 {
        self.covariance[(ACROSS, ACROSS)].max(0.0).sqrt() / self.gravity().abs()
    }

    /// Whether the lean of these points contradicts what is `known` of "up".
    fn lean_contradicts(&self, known: VerticalPrior) -> bool {
        let std = self.lean_std_rad().hypot(known.std_rad);
        // What stands out as much as that is no chance, however small it is.
        let tolerated = known.tolerated_rad.min(CERTAIN_SIGMAS * std);
        self.lean_rad().abs() > (CONTRADICTS_SIGMAS * std).max(tolerated)
    }

    /// The common acceleration, plane units/s².
    #[must_use]
    pub fn acceleration(&self) -> Gravity {
        Gravity {
            down: self.parameters[GRAVITY],
            across: self.parameters[ACROSS],
        }
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
            _ => self.planar(p).motion(k, t),
        }
    }

    /// The motion of any parameters of this fit's layout, seen from the side.
    #[must_use]
    pub fn planar<'a>(&'a self, parameters: &'a [f64]) -> PlanarArcs<'a> {
        PlanarArcs {
            parameters,
            times: &self.times,
            law: self.forces.drag_law(),
        }
    }

    /// Speed on arc `k` at time `t`, plane units a second.
    #[must_use]
    pub fn speed(&self, k: usize, t: f64) -> f64 {
        let p = self.parameters.as_slice();
        match &self.forces {
            Forces::Overhead(known) => known.speed(&overhead::flying(known, p, &self.times, k, t)),
            _ => {
                let m = self.planar(p).motion(k, t);
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
            _ => self.planar(parameters).motion(k, t),
        }
    }

    /// Time of the impact between arcs `k` and `k + 1` for any parameters of this fit's layout, s; `None` when the two
    /// do not part, or there is no second one (a flight without an impact).
    #[must_use]
    pub fn impact_time(&self, parameters: &[f64], k: usize) -> Option<f64> {
        if k + 1 >= self.arcs() {
            return None;
        }
        match &self.forces {
            Forces::Overhead(_) => Some(parameters[overhead::OverheadLayout::new(self.arcs()).impact(k)]),
            _ => self.planar(parameters).intersection(k, k + 1).map(|m| m.0),
        }
    }
}

/// The lean of the fall for any parameters, rad; 0 where nothing falls.
#[must_use]
pub fn lean_rad(parameters: &[f64]) -> f64 {
    if parameters[ACROSS] == 0.0 {
        0.0
    } else {
        parameters[ACROSS].atan2(parameters[GRAVITY])
    }
}

/// Factor on a covariance for errors that last from point to point (a codec's, a lamp's): (1 + ρ)/(1 − ρ) with ρ the
/// correlation of successive residuals of one arc; 1 where it does not show.
pub(super) fn autocorrelation_inflation(points: &[FitPoint], residuals: &DVector<f64>) -> f64 {
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
    let rho = (product / square).clamp(0.0, MOST_CORRELATED);
    if rho < 1.0 / f64::sqrt(pairs) {
        1.0
    } else {
        (1.0 + rho) / (1.0 - rho)
    }
}

/// A path that is no parabola (perspective, a drifting camera) leaves residuals that hang together over a whole arc; at
/// this correlation some 60 points count for one.
const MOST_CORRELATED: f64 = 0.97;

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
    held: [bool; ARCS],
) -> (DMatrix<f64>, DVector<f64>) {
    let priors = priors(parameters, forces, held);
    let planar = PlanarArcs {
        parameters: parameters.as_slice(),
        times,
        law: forces.drag_law(),
    };
    let extra = held.iter().filter(|&&h| h).count() + priors.len();
    let rows = 2 * points.len() + extra;
    let mut matrix = DMatrix::zeros(rows, parameters.len());
    let mut right = DVector::zeros(rows);
    for (i, p) in points.iter().enumerate() {
        let t = p.sample.t - times[p.arc];
        let w = p.sample.weight.sqrt();
        let c = ARCS + 4 * p.arc;
        let m = planar.motion(p.arc, p.sample.t);
        right[2 * i] = w * (p.sample.r - m.r);
        right[2 * i + 1] = w * (p.sample.h - m.h);
        matrix[(2 * i, c)] = w;
        matrix[(2 * i, c + 1)] = w * t;
        matrix[(2 * i + 1, c + 2)] = w;
        matrix[(2 * i + 1, c + 3)] = w * t;
        if !held[GRAVITY] {
            matrix[(2 * i + 1, GRAVITY)] = -0.5 * w * t * t;
        }
        if !held[ACROSS] {
            matrix[(2 * i, ACROSS)] = 0.5 * w * t * t;
        }
        if !held[DRAG] {
            let (dr, dh) = planar.drag_shift(p.arc, p.sample.t);
            matrix[(2 * i, DRAG)] = w * dr;
            matrix[(2 * i + 1, DRAG)] = w * dh;
        }
    }
    let mut row = 2 * points.len();
    for (i, _) in held.iter().enumerate().filter(|(_, h)| **h) {
        matrix[(row, i)] = 1.0;
        row += 1;
    }
    for (i, value, std) in priors {
        matrix[(row, i)] = 1.0 / std;
        right[row] = (value - parameters[i]) / std;
        row += 1;
    }
    (matrix, right)
}

/// What is known beforehand: which parameter, its value, its standard uncertainty.
fn priors(parameters: &DVector<f64>, forces: Forces, held: [bool; ARCS]) -> Vec<(usize, f64, f64)> {
    let mut priors = Vec::new();
    if let Forces::FallWithDrag(_, drag) = forces
        && !held[DRAG]
    {
        priors.push((DRAG, drag.beta, drag.std));
    }
    let lean = forces.vertical().map(|u| u.std_rad * parameters[GRAVITY].abs());
    // Before gravity is known there is no scale for it; the round that follows has it.
    if let Some(std) = lean.filter(|&std| std > 0.0 && std.is_finite() && !held[ACROSS]) {
        priors.push((ACROSS, 0.0, std));
    }
    priors
}

/// Takes from a step what rounding puts into a parameter that is held. The others do not feel its row; but a drag of
/// 1e-11 in place of none, times the square of a ball's speed in pixels, is a force.
fn keep(step: &mut DVector<f64>, held: [bool; ARCS]) {
    for (i, _) in held.iter().enumerate().filter(|(_, held)| **held) {
        step[i] = 0.0;
    }
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
