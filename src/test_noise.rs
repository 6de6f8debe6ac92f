//! Random numbers for tests, the same in every run: Knuth's 64-bit linear congruential generator (The Art of Computer
//! Programming 2, 3.3.4), of which the upper 53 bits are used.

/// A stream that its seed decides.
pub struct TestNoise(pub u64);

impl TestNoise {
    /// From 0 to 1.
    pub fn uniform(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// From `low` to `high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// 0 to `count` - 1.
    pub fn below(&mut self, count: u8) -> u8 {
        (f64::from(count) * self.uniform()) as u8
    }

    /// Of mean 0 and standard deviation 1: sums of twelve uniform numbers are normal enough for a test.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}
