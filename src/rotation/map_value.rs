//! What maps have at their nodes: a number, or three at once.
//!
//! In single precision: logarithms of brightness, which noise leaves known to a few thousandths. Sums over many pixels are made side by side, or in double.

use nalgebra::Vector3;
use std::ops::{Add, AddAssign, Mul, Sub, SubAssign};

/// What a map has at its nodes.
pub trait MapValue:
    Copy + Default + Add<Output = Self> + Sub<Output = Self> + Mul<f32, Output = Self> + AddAssign + SubAssign
{
    /// Each number times that of `other`.
    #[must_use]
    fn times(self, other: Self) -> Self;

    /// Each number over that of `other`; 0 where that is not positive.
    #[must_use]
    fn over(self, other: Self) -> Self;

    /// Whether each number is at most `part` of that of `other`.
    fn is_at_most(self, part: f32, other: Self) -> bool;
}

impl MapValue for f32 {
    #[inline]
    fn times(self, other: Self) -> Self {
        self * other
    }

    #[inline]
    fn over(self, other: Self) -> Self {
        if other > 0.0 { self / other } else { 0.0 }
    }

    fn is_at_most(self, part: f32, other: Self) -> bool {
        self <= part * other
    }
}

/// Three numbers, and a fourth that stays 0: together they fill a register, which the compiler sees of an array that lies as one does in memory.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[repr(align(16))]
pub struct Three(pub [f32; 4]);

impl Three {
    /// The components of a vector.
    #[must_use]
    pub fn of(v: &Vector3<f64>) -> Self {
        Self([v.x as f32, v.y as f32, v.z as f32, 0.0])
    }

    /// The vector with these components.
    #[must_use]
    pub fn vector(self) -> Vector3<f64> {
        let [x, y, z, _] = self.0.map(f64::from);
        Vector3::new(x, y, z)
    }

    /// The vector product.
    #[inline]
    #[must_use]
    pub fn cross(self, Self([x, y, z, _]): Self) -> Self {
        let [a, b, c, _] = self.0;
        Self([b * z - c * y, c * x - a * z, a * y - b * x, 0.0])
    }

    /// Σ of the products of their numbers.
    #[inline]
    #[must_use]
    pub fn dot(self, other: Self) -> f32 {
        self.times(other).0.iter().sum()
    }

    #[inline]
    fn with(self, other: Self, of: impl Fn(f32, f32) -> f32) -> Self {
        Self(std::array::from_fn(|k| of(self.0[k], other.0[k])))
    }
}

impl Add for Three {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        self.with(other, |a, b| a + b)
    }
}

impl Sub for Three {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        self.with(other, |a, b| a - b)
    }
}

impl Mul<f32> for Three {
    type Output = Self;
    #[inline]
    fn mul(self, factor: f32) -> Self {
        Self(self.0.map(|a| a * factor))
    }
}

impl AddAssign for Three {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl SubAssign for Three {
    #[inline]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl MapValue for Three {
    #[inline]
    fn times(self, other: Self) -> Self {
        self.with(other, |a, b| a * b)
    }

    #[inline]
    fn over(self, other: Self) -> Self {
        self.with(other, f32::over)
    }

    fn is_at_most(self, part: f32, other: Self) -> bool {
        self.0.iter().zip(other.0).all(|(a, b)| a.is_at_most(part, b))
    }
}

/// Sums that are made side by side: one alone would wait for itself at every step.
const SIDE_BY_SIDE: usize = 8;

/// Σ of the products of pairs.
pub fn sum_of_products<T: MapValue>(a: &[T], b: &[T]) -> T {
    let mut sums = [T::default(); SIDE_BY_SIDE];
    let (a, b) = (a.chunks_exact(SIDE_BY_SIDE), b.chunks_exact(SIDE_BY_SIDE));
    let rest = a.remainder().iter().zip(b.remainder());
    for (a, b) in a.zip(b) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a.times(*b);
        }
    }
    rest.map(|(a, b)| a.times(*b))
        .chain(sums)
        .fold(T::default(), |sum, x| sum + x)
}
