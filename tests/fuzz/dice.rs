//! Numbers to choose by, the same in every run.

use crate::noise::Noise;

/// Thrown with a seed.
pub struct Dice(Noise);

impl Dice {
    pub fn new(seed: u64) -> Self {
        Self(Noise(
            seed.wrapping_mul(0x2545_f491_4f6c_dd1d) ^ 0x9e37_79b9_7f4a_7c15,
        ))
    }

    /// 0 up to, not including, `end`; 0 where `end` is.
    pub fn below(&mut self, end: usize) -> usize {
        if end == 0 {
            0
        } else {
            (self.0.next() % end as u64) as usize
        }
    }

    pub fn uniform(&mut self) -> f64 {
        self.0.uniform()
    }

    pub fn one_in(&mut self, sides: usize) -> bool {
        self.below(sides) == 0
    }

    pub fn of<'a, T>(&mut self, all: &'a [T]) -> &'a T {
        &all[self.below(all.len())]
    }

    /// A number that breaks things.
    pub fn number(&mut self) -> f64 {
        const HARD: [f64; 24] = [
            0.0,
            -0.0,
            1.0,
            -1.0,
            0.5,
            2.0,
            5e-324,
            f64::MIN_POSITIVE,
            f64::EPSILON,
            1e-300,
            1e-15,
            1e-9,
            1e-6,
            1e6,
            1e9,
            1e15,
            1e16,
            1e154,
            1e300,
            f64::MAX,
            -1e300,
            -1e9,
            90.0,
            0.6666666666666667,
        ];
        match self.below(3) {
            0 => *self.of(&HARD),
            1 => {
                let size = 10.0_f64.powf(self.uniform() * 40.0 - 20.0);
                if self.one_in(3) { -size } else { size }
            }
            _ => (self.uniform() - 0.3) * 10.0,
        }
    }
}
