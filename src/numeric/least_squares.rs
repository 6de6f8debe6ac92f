//! Nonlinear least squares: Gauss-Newton and Levenberg-Marquardt as one loop.
//!
//! A step δ solves (JᵀJ + λ D²) δ = Jᵀr with r what is left to explain (observed − predicted, whitened) and
//! J = ∂predicted/∂parameters. λ = 0 is Gauss-Newton (right from a start within the basin), D = 1 Levenberg's damping, D = the
//! lengths of J's columns Marquardt's, which does not depend on units. A step that lowers the cost is taken and λ falls, by a
//! factor or by how well the linear model foretold the gain (Nielsen 1999, IMM-REP-1999-05); otherwise λ grows. See
//! [`super`] for which of the forms to use.
//!
//! The loop finds the local minimum of the basin in which it starts. A cost that is not finite is never accepted, the
//! number of steps is limited, and [`Termination`] says why it ended.

use super::linear::Factorisation;
use nalgebra::{DMatrix, DVector, SMatrix, SVector};
use std::cell::OnceCell;
use std::marker::PhantomData;

/// How λ falls after a step that was taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Easing {
    /// By a factor, less than 1.
    Factor(f64),
    /// By 1 − (2 g − 1)³ within these limits, g the cost's fall over [`Problem::predicted_fall`].
    Nielsen {
        /// Least factor.
        least: f64,
        /// Largest factor: a step much worse than foretold damps the next one more.
        most: f64,
    },
}

/// Which steps are taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Acceptance {
    /// Every one: plain Gauss-Newton, and reweighted fits whose costs cannot be compared.
    Always,
    /// Those that lower the cost.
    Lower,
    /// Those that do not raise it by more than this part of it (0: by nothing).
    NotHigher(f64),
}

impl Acceptance {
    fn takes(self, before: f64, after: f64) -> bool {
        match self {
            Self::Always => true,
            Self::Lower => after < before,
            Self::NotHigher(slack) => after.is_finite() && after <= before * (1.0 + slack),
        }
    }
}

/// The damping policy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Damping {
    /// λ of the first step.
    pub first: f64,
    /// λ never falls below this.
    pub least: f64,
    /// Beyond this λ the search has nowhere to go.
    pub most: f64,
    /// How λ falls.
    pub easing: Easing,
    /// What λ is multiplied by after a step that was not taken.
    pub growth: f64,
    /// Whether that factor itself doubles with each further one in a row (Nielsen).
    pub growth_doubles: bool,
    /// After a step that was not taken λ is at least this.
    pub least_after_failure: f64,
    /// What λ is multiplied by where the equations cannot be solved; `None`: that is the end.
    pub where_singular: Option<f64>,
    /// Which steps are taken.
    pub acceptance: Acceptance,
}

impl Damping {
    /// Gauss-Newton: no damping, every step is taken.
    pub const NONE: Self = Self {
        first: 0.0,
        least: 0.0,
        most: f64::INFINITY,
        easing: Easing::Factor(1.0),
        growth: 1.0,
        growth_doubles: false,
        least_after_failure: 0.0,
        where_singular: None,
        acceptance: Acceptance::Always,
    };

    /// Fixed factors, as Marquardt (1963) has them.
    pub const MARQUARDT: Self = Self {
        first: 1e-3,
        most: 1e9,
        easing: Easing::Factor(0.2),
        growth: 10.0,
        acceptance: Acceptance::NotHigher(0.0),
        ..Self::NONE
    };

    /// Nielsen's rule: few wasted steps where the linear model is good, quick growth where it is not.
    pub const NIELSEN: Self = Self {
        first: 1e-6,
        least: 1e-14,
        most: 1e12,
        easing: Easing::Nielsen {
            least: 0.1,
            most: 2.0,
        },
        growth: 2.0,
        growth_doubles: true,
        acceptance: Acceptance::Lower,
        ..Self::NONE
    };
}

/// Why a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Termination {
    /// A further step would not matter.
    Settled,
    /// No step lowers the cost, however short: a minimum within rounding, or a kink.
    NoBetterStep,
    /// The equations cannot be solved.
    Singular,
    /// As many steps as are allowed.
    StepLimit,
}

/// What can be said of a step before it is tried.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outlook {
    /// Nothing: try it.
    Open,
    /// It would not matter: the search is at its end.
    Settled,
    /// It is short only because it is damped: try it, and go on with λ times this.
    Held(f64),
}

/// A step that was tried.
#[derive(Debug, Clone, Copy)]
pub struct Trial<'a, S> {
    /// The step.
    pub step: &'a S,
    /// λ with which it was found.
    pub damping: f64,
    /// Whether it was taken.
    pub taken: bool,
}

/// A problem in the loop's general form: any state, any way to find a step. `State` holds parameters and what is worth
/// keeping of their evaluation (cost, equations).
pub trait Problem {
    /// Parameters and what was computed there.
    type State;
    /// A change of them.
    type Step;

    /// The step from `here` with λ = `damping`; `None` where the equations cannot be solved.
    fn step(&mut self, here: &Self::State, damping: f64) -> Option<Self::Step>;

    /// The state after a step; `None` where that is outside the model's domain.
    fn moved(&mut self, here: &Self::State, step: &Self::Step) -> Option<Self::State>;

    /// What is made least. `here` is the state the step starts from, for costs that are weighed there.
    fn cost(&self, of: &Self::State, here: &Self::State) -> f64;

    /// By how much a linear model would lower the cost with this step; only [`Easing::Nielsen`] asks.
    fn predicted_fall(&self, _here: &Self::State, _step: &Self::Step, _damping: f64) -> f64 {
        f64::NAN
    }

    /// Whether a step is worth trying.
    fn outlook(&self, _here: &Self::State, _step: &Self::Step, _damping: f64) -> Outlook {
        Outlook::Open
    }

    /// Whether a step that was tried is the last one worth trying; `here` is where it started.
    fn is_settled(&self, here: &Self::State, trial: &Trial<'_, Self::Step>) -> bool;
}

/// A search under way, for callers with a loop of their own; [`minimise`] for all others.
#[derive(Debug, Clone)]
pub struct Descent<S> {
    /// Where it is.
    pub state: S,
    /// λ of the next step.
    pub damping: f64,
    growth: f64,
    policy: Damping,
}

impl<S> Descent<S> {
    /// A search that starts at `state`.
    pub fn new(state: S, policy: &Damping) -> Self {
        Self {
            state,
            damping: policy.first,
            growth: policy.growth,
            policy: *policy,
        }
    }

    /// Tries a step; why the search has ended, if it has.
    pub fn advance<P: Problem<State = S>>(&mut self, problem: &mut P) -> Option<Termination> {
        let Some(step) = problem.step(&self.state, self.damping) else {
            let Some(factor) = self.policy.where_singular else {
                return Some(Termination::Singular);
            };
            self.damping *= factor;
            return (self.damping > self.policy.most).then_some(Termination::Singular);
        };
        let damping = self.damping;
        match problem.outlook(&self.state, &step, damping) {
            Outlook::Open => {}
            Outlook::Settled => return Some(Termination::Settled),
            Outlook::Held(factor) => self.damping *= factor,
        }
        let before = problem.cost(&self.state, &self.state);
        let next = problem.moved(&self.state, &step).and_then(|next| {
            let after = problem.cost(&next, &self.state);
            self.policy
                .acceptance
                .takes(before, after)
                .then_some((next, after))
        });
        let trial = Trial {
            step: &step,
            damping,
            taken: next.is_some(),
        };
        let settled = problem.is_settled(&self.state, &trial);
        if let Some((next, after)) = next {
            self.damping *= match self.policy.easing {
                Easing::Factor(factor) => factor,
                Easing::Nielsen { least, most } => {
                    let gain = (before - after) / problem.predicted_fall(&self.state, &step, damping);
                    (1.0 - (2.0 * gain - 1.0).powi(3)).clamp(least, most)
                }
            };
            self.damping = self.damping.max(self.policy.least);
            self.growth = self.policy.growth;
            self.state = next;
        } else {
            self.damping = (self.damping * self.growth).max(self.policy.least_after_failure);
            if self.policy.growth_doubles {
                self.growth *= 2.0;
            }
        }
        if settled {
            Some(Termination::Settled)
        } else {
            (self.damping > self.policy.most).then_some(Termination::NoBetterStep)
        }
    }
}

/// The local minimum that `start` leads to, after at most `most_steps` steps, those that were not taken among them.
pub fn minimise<P: Problem>(
    problem: &mut P,
    start: P::State,
    policy: &Damping,
    most_steps: usize,
) -> (P::State, Termination) {
    let mut descent = Descent::new(start, policy);
    for _ in 0..most_steps {
        if let Some(termination) = descent.advance(problem) {
            return (descent.state, termination);
        }
    }
    (descent.state, Termination::StepLimit)
}

/// Plain Gauss-Newton by closures, for fits that weigh their residuals anew at each place, so that costs cannot be compared:
/// `step` finds the step there (`None`: the equations cannot be solved), `moved` takes it, `is_last` says whether it was too
/// short to matter.
pub fn gauss_newton<S, D>(
    start: S,
    most_steps: usize,
    step: impl FnMut(&S) -> Option<D>,
    moved: impl Fn(&S, &D) -> S,
    is_last: impl Fn(&D) -> bool,
) -> (S, Termination) {
    let mut problem = ByClosures {
        step,
        moved,
        is_last,
        of: PhantomData,
    };
    minimise(&mut problem, start, &Damping::NONE, most_steps)
}

struct ByClosures<S, D, F, M, L> {
    step: F,
    moved: M,
    is_last: L,
    of: PhantomData<(S, D)>,
}

impl<S, D, F, M, L> Problem for ByClosures<S, D, F, M, L>
where
    F: FnMut(&S) -> Option<D>,
    M: Fn(&S, &D) -> S,
    L: Fn(&D) -> bool,
{
    type State = S;
    type Step = D;

    fn step(&mut self, here: &S, _damping: f64) -> Option<D> {
        (self.step)(here)
    }

    fn moved(&mut self, here: &S, step: &D) -> Option<S> {
        Some((self.moved)(here, step))
    }

    fn cost(&self, _of: &S, _here: &S) -> f64 {
        0.0
    }

    fn is_settled(&self, _here: &S, trial: &Trial<'_, D>) -> bool {
        (self.is_last)(trial.step)
    }
}

/// A model by its whitened residuals.
pub trait Residuals {
    /// What is left to explain at `parameters`: (observed − predicted) / standard uncertainty.
    fn residuals(&self, parameters: &DVector<f64>) -> DVector<f64>;

    /// A change of parameter `i` for differences, at `parameters`.
    fn difference(&self, i: usize, parameters: &DVector<f64>) -> f64 {
        // The cube root of the rounding of a number balances it against the third derivative.
        6e-6 * parameters[i].abs().max(1e-3)
    }

    /// ∂predicted/∂parameters and what is left to explain, row for row. Instead of these rows any others with the same
    /// JᵀJ and Jᵀr may be given (fewer, by a QR of one's own).
    fn system(&self, parameters: &DVector<f64>) -> (DMatrix<f64>, DVector<f64>) {
        let residuals = self.residuals(parameters);
        let mut jacobian = DMatrix::zeros(residuals.len(), parameters.len());
        let mut moved = parameters.clone();
        for i in 0..parameters.len() {
            let by = self.difference(i, parameters);
            moved[i] = parameters[i] + by;
            let ahead = self.residuals(&moved);
            moved[i] = parameters[i] - by;
            let behind = self.residuals(&moved);
            moved[i] = parameters[i];
            jacobian.set_column(i, &((behind - ahead) / (2.0 * by)));
        }
        (jacobian, residuals)
    }

    /// What is made least.
    fn cost(&self, parameters: &DVector<f64>) -> f64 {
        self.residuals(parameters).norm_squared()
    }
}

/// When a fit by [`Residuals`] ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StopRule {
    /// Steps at most.
    pub steps: usize,
    /// A step that would lower the cost by less than this part of it (or of 1, where that is more) does not matter.
    pub settled: f64,
}

impl Default for StopRule {
    fn default() -> Self {
        Self {
            steps: 200,
            settled: 1e-12,
        }
    }
}

/// What a fit found.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The parameters.
    pub parameters: DVector<f64>,
    /// Σ of squared whitened residuals there.
    pub cost: f64,
    /// (JᵀJ)⁻¹; `None` where the rows do not determine all parameters.
    pub covariance: Option<DMatrix<f64>>,
    /// How many parameters the rows determine together.
    pub rank: usize,
    /// Why it ended.
    pub termination: Termination,
}

/// The local minimum near `start`, steps by QR of the rows with Marquardt's damping.
pub fn fit<R: Residuals>(model: &R, start: DVector<f64>, policy: &Damping, stop: &StopRule) -> Fit {
    let start = DenseState {
        cost: model.cost(&start),
        parameters: start,
        system: OnceCell::new(),
    };
    let mut problem = Dense {
        model,
        settled: stop.settled,
    };
    let (state, termination) = minimise(&mut problem, start, policy, stop.steps);
    let (matrix, right) = problem.system(&state);
    let factorisation = Factorisation::new(matrix, right);
    Fit {
        covariance: factorisation.as_ref().and_then(Factorisation::covariance),
        rank: factorisation.as_ref().map_or(0, Factorisation::rank),
        cost: state.cost,
        termination,
        parameters: state.parameters,
    }
}

struct Dense<'a, R> {
    model: &'a R,
    settled: f64,
}

/// Rows only where a step starts: a trial needs the cost alone.
struct DenseState {
    parameters: DVector<f64>,
    cost: f64,
    system: OnceCell<(DMatrix<f64>, DVector<f64>)>,
}

impl<R: Residuals> Dense<'_, R> {
    fn system<'s>(&self, state: &'s DenseState) -> &'s (DMatrix<f64>, DVector<f64>) {
        state.system.get_or_init(|| self.model.system(&state.parameters))
    }
}

impl<R: Residuals> Problem for Dense<'_, R> {
    type State = DenseState;
    type Step = DVector<f64>;

    fn step(&mut self, here: &DenseState, damping: f64) -> Option<DVector<f64>> {
        let (matrix, right) = self.system(here);
        let (m, n) = matrix.shape();
        // λ D² as rows of its own.
        let mut rows = matrix.clone().resize_vertically(m + n, 0.0);
        for (j, column) in matrix.column_iter().enumerate() {
            rows[(m + j, j)] = damping.sqrt() * column.norm();
        }
        Factorisation::new(&rows, &right.clone().resize_vertically(m + n, 0.0))?.solution()
    }

    fn moved(&mut self, here: &DenseState, step: &DVector<f64>) -> Option<DenseState> {
        let parameters = &here.parameters + step;
        let cost = self.model.cost(&parameters);
        cost.is_finite().then_some(DenseState {
            parameters,
            cost,
            system: OnceCell::new(),
        })
    }

    fn cost(&self, of: &DenseState, _here: &DenseState) -> f64 {
        of.cost
    }

    fn predicted_fall(&self, here: &DenseState, step: &DVector<f64>, _damping: f64) -> f64 {
        (&self.system(here).0 * step).norm_squared()
    }

    fn outlook(&self, here: &DenseState, step: &DVector<f64>, damping: f64) -> Outlook {
        let matters = |step: &DVector<f64>| {
            !(self.predicted_fall(here, step, damping) < self.settled * here.cost.max(1.0))
        };
        if matters(step) {
            return Outlook::Open;
        }
        // Without damping the same, or it is only the damping that holds it.
        let (matrix, right) = self.system(here);
        match Factorisation::new(matrix, right).and_then(|f| f.solution()) {
            Some(free) if matters(&free) => Outlook::Held(0.1),
            _ => Outlook::Settled,
        }
    }

    fn is_settled(&self, _here: &DenseState, _trial: &Trial<'_, DVector<f64>>) -> bool {
        false
    }
}

/// JᵀJ, Jᵀr and the cost of a few parameters, summed row by row: for thousands of pixels whose Jacobian nobody keeps.
/// Squares lose half of the digits, so this is for parameters of like size and weights of like order; [`fit`] is not so.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NormalEquations<const N: usize> {
    /// JᵀJ; only its lower triangle is read.
    pub matrix: SMatrix<f64, N, N>,
    /// Jᵀr.
    pub right: SVector<f64, N>,
    /// Σ w r², or what else is made least.
    pub cost: f64,
}

impl<const N: usize> Default for NormalEquations<N> {
    fn default() -> Self {
        Self {
            matrix: SMatrix::zeros(),
            right: SVector::zeros(),
            cost: 0.0,
        }
    }
}

impl<const N: usize> NormalEquations<N> {
    /// Takes in a row of the Jacobian with what is left to explain there and its weight.
    #[inline]
    pub fn push(&mut self, row: &SVector<f64, N>, residual: f64, weight: f64) {
        for i in 0..N {
            let weighted = weight * row[i];
            self.right[i] += weighted * residual;
            for j in 0..=i {
                self.matrix[(i, j)] += weighted * row[j];
            }
        }
        self.cost += weight * residual * residual;
    }

    /// Takes in what is known of parameter `i` beforehand: `residual` (known − present value) with the weight 1/variance.
    pub fn push_prior(&mut self, i: usize, residual: f64, weight: f64) {
        self.matrix[(i, i)] += weight;
        self.right[i] += weight * residual;
        self.cost += weight * residual * residual;
    }

    /// Keeps parameter `i` as it is.
    pub fn hold(&mut self, i: usize) {
        self.matrix.row_mut(i).fill(0.0);
        self.matrix.column_mut(i).fill(0.0);
        self.matrix[(i, i)] = 1.0;
        self.right[i] = 0.0;
    }

    /// The step with the diagonal times 1 + λ, plus `floor` (which keeps a parameter that no row tells from moving).
    #[must_use]
    pub fn step(&self, damping: f64, floor: f64) -> Option<SVector<f64, N>> {
        let mut matrix = self.matrix;
        for i in 0..N {
            matrix[(i, i)] = matrix[(i, i)] * (1.0 + damping) + floor;
        }
        let step = matrix.cholesky()?.solve(&self.right);
        step.iter().all(|x| x.is_finite()).then_some(step)
    }

    /// (JᵀJ)⁻¹; `None` where the rows do not determine all parameters.
    #[must_use]
    pub fn covariance(&self) -> Option<SMatrix<f64, N, N>> {
        self.matrix.cholesky().map(|c| c.inverse())
    }
}

/// A model that sums its own normal equations.
pub trait Accumulate<const N: usize> {
    /// The equations and the cost at `parameters`.
    fn equations(&self, parameters: &SVector<f64, N>) -> NormalEquations<N>;

    /// Parameters brought back within their limits.
    fn within_limits(&self, parameters: SVector<f64, N>) -> SVector<f64, N> {
        parameters
    }

    /// What every diagonal element is raised by, see [`NormalEquations::step`].
    fn floor(&self) -> f64 {
        0.0
    }

    /// Whether a step that was taken is small enough to be the last.
    fn is_small(&self, step: &SVector<f64, N>) -> bool;
}

/// The local minimum near `start`, with the equations there; steps by Cholesky with Marquardt's damping.
pub fn fit_normal<const N: usize, A: Accumulate<N>>(
    model: &A,
    start: SVector<f64, N>,
    policy: &Damping,
    most_steps: usize,
) -> (SVector<f64, N>, NormalEquations<N>, Termination) {
    let start = (start, model.equations(&start));
    let ((parameters, equations), termination) = minimise(&mut Accumulated(model), start, policy, most_steps);
    (parameters, equations, termination)
}

struct Accumulated<'a, A, const N: usize>(&'a A);

impl<const N: usize, A: Accumulate<N>> Problem for Accumulated<'_, A, N> {
    type State = (SVector<f64, N>, NormalEquations<N>);
    type Step = SVector<f64, N>;

    fn step(&mut self, here: &Self::State, damping: f64) -> Option<Self::Step> {
        here.1.step(damping, self.0.floor())
    }

    fn moved(&mut self, here: &Self::State, step: &Self::Step) -> Option<Self::State> {
        let parameters = self.0.within_limits(here.0 + step);
        Some((parameters, self.0.equations(&parameters)))
    }

    fn cost(&self, of: &Self::State, _here: &Self::State) -> f64 {
        of.1.cost
    }

    fn is_settled(&self, _here: &Self::State, trial: &Trial<'_, Self::Step>) -> bool {
        trial.taken && self.0.is_small(trial.step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{dvector, vector};

    /// y = a exp(−b t).
    struct Decay {
        seen: Vec<(f64, f64)>,
    }

    impl Decay {
        fn of(a: f64, b: f64) -> Self {
            let seen = (0..20)
                .map(|i| {
                    let t = 0.2 * f64::from(i);
                    (t, a * (-b * t).exp())
                })
                .collect();
            Self { seen }
        }
    }

    impl Residuals for Decay {
        fn residuals(&self, p: &DVector<f64>) -> DVector<f64> {
            let rest = |(t, y): &(f64, f64)| y - p[0] * (-p[1] * t).exp();
            DVector::from_iterator(self.seen.len(), self.seen.iter().map(rest))
        }
    }

    impl Accumulate<2> for Decay {
        fn equations(&self, p: &SVector<f64, 2>) -> NormalEquations<2> {
            let mut equations = NormalEquations::default();
            for (t, y) in &self.seen {
                let e = (-p[1] * t).exp();
                equations.push(&vector![e, -p[0] * t * e], y - p[0] * e, 1.0);
            }
            equations
        }

        fn is_small(&self, step: &SVector<f64, 2>) -> bool {
            step.norm() < 1e-9
        }
    }

    #[test]
    fn both_forms_find_the_same_minimum_by_every_policy() {
        let decay = Decay::of(2.0, 0.5);
        for policy in [Damping::NIELSEN, Damping::MARQUARDT] {
            let found = fit(&decay, dvector![1.0, 1.0], &policy, &StopRule::default());
            assert!(
                (found.parameters - dvector![2.0, 0.5]).norm() < 1e-5,
                "{policy:?}"
            );
            assert_eq!((found.rank, found.termination), (2, Termination::Settled));
            if policy == Damping::MARQUARDT {
                let (p, equations, _) = fit_normal(&decay, vector![1.0, 1.0], &policy, 100);
                assert!((p - vector![2.0, 0.5]).norm() < 1e-8);
                let (a, b) = (equations.covariance().unwrap(), found.covariance.unwrap());
                assert!((a[(1, 1)] / b[(1, 1)] - 1.0).abs() < 1e-4);
            }
        }
        // Near the minimum Gauss-Newton needs no damping.
        let (p, _, end) = fit_normal(&decay, vector![1.9, 0.45], &Damping::NONE, 20);
        assert!((p - vector![2.0, 0.5]).norm() < 1e-9 && end == Termination::Settled);
    }

    #[test]
    fn differences_are_the_derivative() {
        let p = dvector![2.0, 0.5];
        let (jacobian, _) = Decay::of(1.0, 1.0).system(&p);
        for (i, (t, _)) in Decay::of(1.0, 1.0).seen.iter().enumerate() {
            let e = (-0.5 * t).exp();
            assert!((jacobian[(i, 0)] - e).abs() < 1e-9 && (jacobian[(i, 1)] + 2.0 * t * e).abs() < 1e-9);
        }
    }

    /// Rosenbrock's curved narrow minimum, from the usual start.
    #[test]
    fn a_curved_narrow_minimum_is_followed_to_its_end() {
        struct Rosenbrock;
        impl Residuals for Rosenbrock {
            fn residuals(&self, p: &DVector<f64>) -> DVector<f64> {
                dvector![-10.0 * (p[1] - p[0] * p[0]), -(1.0 - p[0])]
            }
        }
        let found = fit(
            &Rosenbrock,
            dvector![-1.2, 1.0],
            &Damping::NIELSEN,
            &StopRule::default(),
        );
        assert!(
            (found.parameters - dvector![1.0, 1.0]).norm() < 1e-5,
            "{:?}",
            found.termination
        );
    }

    #[test]
    fn what_no_row_tells_ends_as_singular_and_has_no_covariance() {
        struct Sum;
        impl Residuals for Sum {
            fn residuals(&self, p: &DVector<f64>) -> DVector<f64> {
                dvector![1.0 - p[0] - p[1], 2.0 - p[0] - p[1]]
            }
        }
        let found = fit(&Sum, dvector![0.0, 0.0], &Damping::NIELSEN, &StopRule::default());
        assert!(found.covariance.is_none() && found.rank == 1);
        let (_, end) = minimise(
            &mut Accumulated(&Nothing),
            (vector![0.0], Nothing.equations(&vector![0.0])),
            &Damping::MARQUARDT,
            5,
        );
        assert_eq!(end, Termination::Singular);
    }

    struct Nothing;
    impl Accumulate<1> for Nothing {
        fn equations(&self, _: &SVector<f64, 1>) -> NormalEquations<1> {
            NormalEquations::default()
        }
        fn is_small(&self, _: &SVector<f64, 1>) -> bool {
            false
        }
    }

    #[test]
    fn a_cost_that_is_no_number_is_never_accepted() {
        struct Root;
        impl Residuals for Root {
            fn residuals(&self, p: &DVector<f64>) -> DVector<f64> {
                dvector![0.1 - p[0].sqrt()]
            }
            fn difference(&self, _: usize, _: &DVector<f64>) -> f64 {
                1e-7
            }
        }
        let found = fit(&Root, dvector![4.0], &Damping::NIELSEN, &StopRule::default());
        assert!(
            (found.parameters[0] - 0.01).abs() < 1e-6,
            "{}",
            found.parameters[0]
        );
    }
}
