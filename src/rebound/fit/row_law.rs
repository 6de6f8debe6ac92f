//! A row against a model: the nearest motion that the model allows, and how far it is.
//!
//! The relations are those of [`crate::rebound`] in the x-z plane, written as equations F = 0 between the numbers of a row
//! (a, b, w as in [`super::observation`], P the tangential impulse per mass, primes after the impact):
//!
//! ```text
//! velocities   v'z − e b = 0      v'x − a + P = 0      R ω' − w − P/k = 0 (where it was measured)
//! angles       (a − P) cos φ − e b sin φ = 0
//! distances    x − 2 e (x0/u) (a − P) = 0
//!
//! grip         P = s (1 + e_x) (a − w)        e_x = 0 in the μ-e model      where s (1 + e_x) |a − w| <= Λ b
//! sliding      P = ± μ (1 + e) b                                            where s (1 + e_x) |a − w| >= Λ b
//! limit        Λ = μ_o (1 + e), with μ_o = μ where the two are one
//! ```
//!
//! Every number of a row has an error, so none of them is *the* abscissa. χ² of a row is the least (z − ẑ)ᵀ Σ⁻¹ (z − ẑ)
//! over all ẑ that fulfil the model's equations: the true values are profiled out, incident ones and rebound ones alike,
//! with their correlations. It is found by Lagrange's multipliers on the equations linearised at ẑ (exact at once where they
//! are linear, as for velocities). The regime belongs to ẑ, not to the measured z: a row beside the transition may be on
//! either side of it, or (where both would step across) on the edge, which is one equation more. So χ² is continuous
//! in the parameters although the model jumps.

pub(super) mod averaged;
mod equations;

use super::observation::{Kinematics, Observation, SLOTS, SPIN_OUT, Slots};
use super::series::ColumnSet;
use crate::rebound::ModelName;
use crate::rebound::model::{Incidence, ReboundModel, TangentialImpulse};
use equations::{Equations, MOST, backward, cholesky, dot, forward, relative_move};

pub(super) use crate::rebound::parameter::{E, E_X, KAPPA, MU, PARAMETERS, RATIO, Theta};

/// A friction that is enough for anything, a stiffness that leaves nothing to give way.
pub(super) const WITHOUT_LIMIT: f64 = 1e9;

/// A model as it is searched for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Variant {
    pub model: ModelName,
    pub regimes: Regimes,
    /// Which parameters move.
    pub free: [bool; PARAMETERS],
}

/// μ (1 + e): the tangential over the incident normal speed that sliding takes.
pub(super) fn friction_share(theta: &Theta) -> f64 {
    theta[MU] * (1.0 + theta[E])
}

impl Variant {
    /// The same in other regimes.
    pub fn with(self, regimes: Regimes) -> Self {
        Self { regimes, ..self }
    }
}

/// What a ball may do in a model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Regimes {
    /// Every row grips (with e_x = 0: leaves rolling).
    Grip,
    /// Every row slides.
    Slide,
    /// Grip up to the limit, sliding beyond, one friction for both.
    Continuous,
    /// The limit is Λ, friction in sliding below it: the outcome jumps.
    Jump(f64),
    /// The limit is Λ and so is μ (1 + e).
    Pinned(f64),
}

/// What a row does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RowState {
    /// Grips, or leaves rolling.
    Grip,
    /// Slides.
    Slide,
    /// Grips, at the limit exactly.
    GripEdge,
    /// Slides, at the limit exactly.
    SlideEdge,
}

impl RowState {
    pub fn slides(self) -> bool {
        matches!(self, Self::Slide | Self::SlideEdge)
    }

    pub fn on_edge(self) -> bool {
        matches!(self, Self::GripEdge | Self::SlideEdge)
    }
}

/// The nearest motion that a model allows.
#[derive(Debug, Clone, Copy)]
pub(super) struct NearestMotion {
    pub state: RowState,
    pub chi2: f64,
    /// ẑ.
    #[cfg(test)]
    pub z: Slots,
    /// Equations in use.
    pub equations: usize,
    /// Whitened residuals; χ² is their sum of squares.
    pub residuals: [f64; MOST],
    /// Their derivatives by the parameters.
    pub jacobian: [[f64; PARAMETERS]; MOST],
    /// For a state off the edge: s (1 + e_x) σ (a − w) − Λ b at ẑ.
    pub margin: f64,
    /// Whether friction is at its limit throughout.
    pub slides: bool,
    /// The motion before the impact at ẑ.
    pub incidence: Incidence,
}

/// μ (1 + e), or what it is pinned to, with its derivatives.
#[derive(Clone, Copy)]
struct FrictionShare {
    value: f64,
    by_parameter: [f64; PARAMETERS],
}

impl FrictionShare {
    fn fixed(value: f64) -> Self {
        Self {
            value,
            by_parameter: [0.0; PARAMETERS],
        }
    }

    fn of_friction(theta: &Theta) -> Self {
        let mut by_parameter = [0.0; PARAMETERS];
        by_parameter[E] = theta[MU];
        by_parameter[MU] = 1.0 + theta[E];
        Self {
            value: friction_share(theta),
            by_parameter,
        }
    }
}

impl Regimes {
    /// Friction in sliding and the limit of grip.
    fn shares(self, theta: &Theta) -> (FrictionShare, FrictionShare) {
        let friction = FrictionShare::of_friction(theta);
        match self {
            Self::Grip | Self::Slide | Self::Continuous => (friction, friction),
            Self::Jump(limit) => (friction, FrictionShare::fixed(limit)),
            Self::Pinned(limit) => (FrictionShare::fixed(limit), FrictionShare::fixed(limit)),
        }
    }
}

/// The nearest motion to a row under a model; `None` where there is no such thing (numbers that overflow). `table_error` is that of
/// [`Incidence`].
pub(super) fn nearest(
    row: &Observation,
    variant: &Variant,
    theta: &Theta,
    table_error: f64,
) -> Option<NearestMotion> {
    let (mut law, here) = RowLaw::new(row, variant, theta);
    law.table_error = table_error;
    let regimes = variant.regimes;
    match regimes {
        Regimes::Grip => return law.solve(RowState::Grip),
        Regimes::Slide => return law.solve(RowState::Slide),
        _ => {}
    }
    let (margin, variance) = law.margin(&here);
    let (first, second) = if margin <= 0.0 {
        (RowState::Grip, RowState::Slide)
    } else {
        (RowState::Slide, RowState::Grip)
    };
    let found = law.solve(first)?;
    let first_stands = found.stands();
    // Crossing over costs at least what the measured incidence is away from the edge.
    if first_stands && (variance == 0.0 || found.chi2 <= margin * margin / variance) {
        return Some(found);
    }
    if variance == 0.0 {
        // The incidence is exact, and so is its side.
        return Some(found);
    }
    let other = law.solve(second)?;
    let mut best: Option<NearestMotion> = None;
    let mut offer = |candidate: Option<NearestMotion>| {
        if let Some(candidate) = candidate
            && best.is_none_or(|b| candidate.chi2 < b.chi2)
        {
            best = Some(candidate);
        }
    };
    if first_stands {
        offer(Some(found));
    }
    if other.stands() {
        offer(Some(other));
    }
    // On the edge a continuous model has one outcome, a jump two.
    let jumps = matches!(regimes, Regimes::Jump(_));
    if !first_stands && (jumps || !other.stands()) {
        offer(law.solve(edge_of(first)));
    }
    if !other.stands() && jumps {
        offer(law.solve(edge_of(second)));
    }
    best.or(Some(found))
}

/// How far beyond the limit Λ a row was measured, s (1 + e_x) |a − w| − Λ b, and the deviation of that.
pub(super) fn margin(row: &Observation, variant: &Variant, limit: f64, theta: &Theta) -> (f64, f64) {
    let (law, here) = RowLaw::new(row, &variant.with(Regimes::Jump(limit)), theta);
    let (margin, variance) = law.margin(&here);
    (margin, variance.sqrt())
}

/// The incidence of a row's motion.
pub(super) fn incidence(row: &Observation, k: &Kinematics) -> Incidence {
    Incidence {
        slip_m_s: k.a - k.w,
        normal_m_s: k.b,
        slip_share: row.slip_share,
        stiffness_ratio: row.stiffness_ratio,
        table_error: 0.0,
    }
}

fn edge_of(state: RowState) -> RowState {
    if state.slides() {
        RowState::SlideEdge
    } else {
        RowState::GripEdge
    }
}

impl NearestMotion {
    /// Whether ẑ lies on its own side of the limit.
    fn stands(&self) -> bool {
        match self.state {
            RowState::Grip => self.margin <= 0.0,
            RowState::Slide => self.margin >= 0.0,
            RowState::GripEdge | RowState::SlideEdge => true,
        }
    }
}

/// One row under one set of parameters.
struct RowLaw<'a> {
    row: &'a Observation,
    model: &'static dyn ReboundModel,
    theta: &'a Theta,
    friction: FrictionShare,
    limit: FrictionShare,
    /// Direction of the slip.
    sign: f64,
    /// That of [`Incidence`].
    table_error: f64,
}

/// The nearest point, with what was worked out on the way.
struct ClosestPoint<'a> {
    #[cfg(test)]
    z: &'a Slots,
    residuals: &'a [f64; MOST],
    /// L of J Σ Jᵀ.
    lower: &'a [[f64; MOST]; MOST],
    /// Σ Jᵀ.
    spread: &'a [Slots; MOST],
    /// At the point.
    equations: &'a Equations,
    kinematics: &'a Kinematics,
}

impl ClosestPoint<'_> {
    fn chi2(&self) -> f64 {
        self.residuals[..self.equations.count].iter().map(|r| r * r).sum()
    }
}

/// Most steps to the nearest point; the worst seen (30 % outliers on angles) takes 25.
const STEPS: usize = 60;

impl<'a> RowLaw<'a> {
    /// With the motion as it was measured.
    fn new(row: &'a Observation, variant: &Variant, theta: &'a Theta) -> (Self, Kinematics) {
        let (friction, limit) = variant.regimes.shares(theta);
        let here = row.kinematics(&row.z, theta[RATIO]);
        let sign = if here.a - here.w < 0.0 { -1.0 } else { 1.0 };
        let law = Self {
            row,
            model: variant.model.model(),
            theta,
            friction,
            limit,
            sign,
            table_error: 0.0,
        };
        (law, here)
    }

    /// How far beyond the limit the motion is, and the variance of that.
    fn margin(&self, k: &Kinematics) -> (f64, f64) {
        let mut equations = Equations::empty();
        self.edge(k, &mut equations);
        let slope = equations.by_slot[0];
        (equations.f[0], dot(&slope, &self.row.covariance_times(&slope)))
    }

    fn solve(&self, state: RowState) -> Option<NearestMotion> {
        self.closest(state, |at| self.finish(state, at))
    }

    /// Goes to the nearest point of `state`, and makes of it what `finish` does.
    #[inline]
    fn closest<T>(&self, state: RowState, finish: impl FnOnce(&ClosestPoint<'_>) -> Option<T>) -> Option<T> {
        let row = self.row;
        let mut z = row.z;
        let linear = row.is_linear() && (state.slides() || self.model.grip_is_linear());
        let mut last_move = f64::INFINITY;
        let mut equations = Equations::empty();
        let mut spread = [[0.0; SLOTS]; MOST];
        let mut lower = [[0.0; MOST]; MOST];
        for step in 0..STEPS {
            self.equations(&z, state, &mut equations);
            let count = equations.count;
            let mut right = equations.f;
            for i in 0..count {
                let slope = &equations.by_slot[i];
                for k in 0..SLOTS {
                    right[i] += slope[k] * (row.z[k] - z[k]);
                }
                spread[i] = row.covariance_times(slope);
            }
            if !cholesky(&equations, &spread, &mut lower) {
                return None;
            }
            let residuals = forward(&lower, right, count);
            let multipliers = backward(&lower, residuals, count);
            let mut next = row.z;
            for i in 0..count {
                for k in 0..SLOTS {
                    next[k] -= spread[i][k] * multipliers[i];
                }
            }
            let moved = relative_move(&z, &next);
            // Each step is shorter than the one before by the ratio of error to curvature, and so is the next.
            let ahead = if step == 0 {
                moved
            } else {
                moved * (moved / last_move).min(1.0)
            };
            let done = linear || ahead <= 1e-8 || (moved <= 1e-6 && moved >= last_move) || step + 1 == STEPS;
            last_move = moved;
            if done {
                let k = self.equations(&next, state, &mut equations);
                return finish(&ClosestPoint {
                    #[cfg(test)]
                    z: &next,
                    residuals: &residuals,
                    lower: &lower,
                    spread: &spread,
                    equations: &equations,
                    kinematics: &k,
                });
            }
            z = next;
            if z.iter().any(|x| !x.is_finite()) {
                return None;
            }
        }
        None
    }

    fn finish(&self, state: RowState, at: &ClosestPoint<'_>) -> Option<NearestMotion> {
        // L⁻¹ times the derivatives, all columns at once.
        let ClosestPoint { equations, lower, .. } = *at;
        let mut jacobian = [[0.0; PARAMETERS]; MOST];
        for i in 0..equations.count {
            let mut line = equations.by_parameter[i];
            for (above, share) in jacobian[..i].iter().zip(&lower[i]) {
                for (entry, known) in line.iter_mut().zip(above) {
                    *entry -= share * known;
                }
            }
            jacobian[i] = line.map(|entry| entry / lower[i][i]);
        }
        let margin = if state.on_edge() {
            0.0
        } else {
            self.margin_at(state, at.kinematics)
        };
        let chi2 = at.chi2();
        chi2.is_finite().then_some(NearestMotion {
            state,
            chi2,
            #[cfg(test)]
            z: *at.z,
            equations: equations.count,
            residuals: *at.residuals,
            jacobian,
            margin,
            slides: state.slides() || self.slides_within_grip(at.kinematics),
            incidence: self.incidence(at.kinematics),
        })
    }

    /// |P of grip| − Λ b of a motion in `state`.
    fn margin_at(&self, state: RowState, k: &Kinematics) -> f64 {
        self.grip(k).value * self.sign_at(state, k) - self.limit.value * k.b
    }

    /// The model's impulse below the limit.
    fn grip(&self, k: &Kinematics) -> TangentialImpulse {
        self.model.grip(&self.incidence(k), self.theta)
    }

    fn slides_within_grip(&self, k: &Kinematics) -> bool {
        self.model.slides_within_grip(&self.incidence(k), self.theta)
    }

    fn incidence(&self, k: &Kinematics) -> Incidence {
        Incidence {
            table_error: self.table_error,
            ..incidence(self.row, k)
        }
    }

    /// Grip knows no direction, so its need is that of |a − w|.
    fn sign_at(&self, state: RowState, k: &Kinematics) -> f64 {
        if state == RowState::Grip {
            if k.a - k.w < 0.0 { -1.0 } else { 1.0 }
        } else {
            self.sign
        }
    }

    /// The equations at `z`, in place of those in `out`; the motion there.
    fn equations(&self, z: &Slots, state: RowState, out: &mut Equations) -> Kinematics {
        let k = self.row.kinematics(z, self.theta[RATIO]);
        let impulse = if state.slides() {
            self.sliding(&k)
        } else {
            self.gripping(&k)
        };
        out.count = 0;
        match self.row.set {
            ColumnSet::Velocities => self.velocities(z, &k, &impulse, out),
            ColumnSet::Angles => self.angles(z, &k, &impulse, out),
            ColumnSet::Distances => self.distances(z, &k, &impulse, out),
        }
        if state.on_edge() {
            self.edge(&k, out);
        }
        k
    }

    /// P of the model, s (1 + e_x) (a − w) of most.
    fn gripping(&self, k: &Kinematics) -> Impulse {
        let grip = self.grip(k);
        let mut by_parameter = grip.by_parameter;
        by_parameter[RATIO] -= grip.by_slip * k.dw_dratio;
        Impulse {
            value: grip.value,
            by_slot: by_slot(&grip, k),
            by_parameter,
        }
    }

    /// P = ± μ (1 + e) b.
    fn sliding(&self, k: &Kinematics) -> Impulse {
        let share = self.sign * self.friction.value;
        Impulse {
            value: share * k.b,
            by_slot: std::array::from_fn(|i| share * k.db[i]),
            by_parameter: self.friction.by_parameter.map(|d| self.sign * d * k.b),
        }
    }

    fn velocities(&self, z: &Slots, k: &Kinematics, p: &Impulse, out: &mut Equations) {
        let e = self.theta[E];
        let (f, by_slot, by_parameter) = out.next();
        *f = z[3] - e * k.b;
        by_slot[3] = 1.0;
        by_slot[1] = -e;
        by_parameter[E] = -k.b;

        let (f, by_slot, by_parameter) = out.next();
        *f = z[2] - k.a + p.value;
        *by_slot = p.by_slot;
        by_slot[2] += 1.0;
        by_slot[0] -= 1.0;
        *by_parameter = p.by_parameter;

        if self.row.spin_out {
            let k_inverse = 1.0 / self.row.inertia_factor;
            let (f, by_slot, by_parameter) = out.next();
            *f = z[SPIN_OUT] - k.w - k_inverse * p.value;
            *by_slot = std::array::from_fn(|i| -k.dw[i] - k_inverse * p.by_slot[i]);
            by_slot[SPIN_OUT] += 1.0;
            *by_parameter = p.by_parameter.map(|d| -k_inverse * d);
            by_parameter[RATIO] -= k.dw_dratio;
        }
    }

    fn angles(&self, z: &Slots, k: &Kinematics, p: &Impulse, out: &mut Equations) {
        let e = self.theta[E];
        let (sin, cos) = z[1].sin_cos();
        let (f, by_slot, by_parameter) = out.next();
        *f = (k.a - p.value) * cos - e * k.b * sin;
        *by_slot = std::array::from_fn(|i| (k.da[i] - p.by_slot[i]) * cos - e * k.db[i] * sin);
        by_slot[1] -= (k.a - p.value) * sin + e * k.b * cos;
        *by_parameter = p.by_parameter.map(|d| -d * cos);
        by_parameter[E] -= k.b * sin;
    }

    fn distances(&self, z: &Slots, k: &Kinematics, p: &Impulse, out: &mut Equations) {
        let e = self.theta[E];
        let (x0, speed) = (z[0], z[2]);
        let reach = 2.0 * e * x0 / speed;
        let after = k.a - p.value;
        let (f, by_slot, by_parameter) = out.next();
        *f = z[1] - reach * after;
        *by_slot = std::array::from_fn(|i| -reach * (k.da[i] - p.by_slot[i]));
        by_slot[0] -= 2.0 * e / speed * after;
        by_slot[1] += 1.0;
        by_slot[2] += reach / speed * after;
        *by_parameter = p.by_parameter.map(|d| reach * d);
        by_parameter[E] -= 2.0 * x0 / speed * after;
    }

    /// |P of grip| − Λ b.
    fn edge(&self, k: &Kinematics, out: &mut Equations) {
        let grip = self.gripping(k);
        let (sign, limit) = (self.sign, self.limit);
        let (f, by_slot, by_parameter) = out.next();
        *f = sign * grip.value - limit.value * k.b;
        *by_slot = std::array::from_fn(|i| sign * grip.by_slot[i] - limit.value * k.db[i]);
        *by_parameter = std::array::from_fn(|j| sign * grip.by_parameter[j] - limit.by_parameter[j] * k.b);
    }
}

/// An impulse's derivatives by the slots of a row.
fn by_slot(impulse: &TangentialImpulse, k: &Kinematics) -> Slots {
    std::array::from_fn(|i| impulse.by_slip * (k.da[i] - k.dw[i]) + impulse.by_normal * k.db[i])
}

/// P and its derivatives.
struct Impulse {
    value: f64,
    by_slot: Slots,
    by_parameter: [f64; PARAMETERS],
}

#[cfg(test)]
mod tests;
