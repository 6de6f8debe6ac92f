//! Numbers of 1000 bits, in which every relation can be evaluated without a thought for rounding, and the comparison of a
//! fast formula with that.

use dashu_float::FBig;
use dashu_float::round::mode::HalfEven;
use std::ops::{Add, Div, Mul, Neg, Sub};

type Big = FBig<HalfEven, 2>;

/// Sums of numbers between 1e-100 and 1e100 (665 bits apart) keep all digits of both, and products of two.
const BITS: usize = 1000;

/// A number as good as exact.
#[derive(Clone, Debug)]
pub struct N(Big);

/// The double `x`, exactly.
pub fn n(x: f64) -> N {
    N(Big::try_from(x).unwrap().with_precision(BITS).value())
}

macro_rules! operator {
    ($trait:ident, $method:ident) => {
        impl $trait<&N> for &N {
            type Output = N;
            fn $method(self, other: &N) -> N {
                N((&self.0).$method(&other.0))
            }
        }
        impl $trait<N> for N {
            type Output = N;
            fn $method(self, other: N) -> N {
                (&self).$method(&other)
            }
        }
        impl $trait<&N> for N {
            type Output = N;
            fn $method(self, other: &N) -> N {
                (&self).$method(other)
            }
        }
        impl $trait<N> for &N {
            type Output = N;
            fn $method(self, other: N) -> N {
                self.$method(&other)
            }
        }
    };
}
operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);

impl Neg for N {
    type Output = N;
    fn neg(self) -> N {
        N(-self.0)
    }
}

impl N {
    pub fn is_zero(&self) -> bool {
        self.0 == Big::ZERO
    }

    pub fn is_positive(&self) -> bool {
        self.0 > Big::ZERO
    }

    pub fn abs(&self) -> N {
        if self.is_positive() {
            self.clone()
        } else {
            -self.clone()
        }
    }

    pub fn sqrt(&self) -> N {
        if self.is_zero() {
            self.clone()
        } else {
            N(self.0.sqrt())
        }
    }

    pub fn hypot(&self, other: &N) -> N {
        (self * self + other * other).sqrt()
    }

    pub fn atan2(&self, x: &N) -> N {
        N(self.0.atan2(&x.0))
    }

    /// The nearest double.
    pub fn rounded(&self) -> f64 {
        self.0.to_f64().value()
    }
}

/// How a relation is known to a test.
pub struct Relation {
    pub name: &'static str,
    /// Largest error found, relative to what is allowed.
    pub worst: f64,
    /// How many evaluations were compared.
    pub count: usize,
}

impl Relation {
    pub fn new(name: &'static str) -> Self {
        Self {
            name,
            worst: 0.0,
            count: 0,
        }
    }

    /// Compares `fast` with `exact` at `inputs`. Allowed is 1e-12 of the value, or four units in the last place of every input
    /// (ε |x ∂f/∂x| each: the condition number times 4 ulp), whichever is larger. That is no less than what a rounding of the
    /// inputs themselves does to the exact value. Numbers below the normal range have fewer digits: they may be off by
    /// the least of them.
    pub fn compare(&mut self, inputs: &[f64], fast: f64, exact: impl Fn(&[N]) -> N) {
        let at: Vec<N> = inputs.iter().map(|&x| n(x)).collect();
        let value = exact(&at);
        if !(value.abs().rounded() < 1e300) {
            return; // Beyond the range of doubles nothing is promised.
        }
        // By differences so small (2^-300 of each) that the relation is straight over them.
        let h = n(2.0_f64.powi(-300));
        let mut allowed = (value.abs() * n(1e-12)).rounded();
        let mut sway = n(0.0);
        for (i, x) in at.iter().enumerate() {
            let mut moved = at.clone();
            moved[i] = x + &(x * &h);
            sway = sway + (exact(&moved) - &value).abs();
        }
        allowed = allowed.max(4.0 * f64::EPSILON * (sway / &h).rounded()) + f64::MIN_POSITIVE;
        assert!(fast.is_finite(), "{}: {fast} at {inputs:?}", self.name);
        let error = (n(fast) - &value).abs().rounded();
        assert!(
            error <= allowed,
            "{} at {inputs:?}: {fast:e} where {:e} is exact: off by {error:e}, allowed {allowed:e}",
            self.name,
            value.rounded()
        );
        self.worst = self.worst.max(error / allowed);
        self.count += 1;
    }
}
