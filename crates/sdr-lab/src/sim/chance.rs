//! Chance of the simulator: one seed, separate streams for separate purposes.

use std::time::Duration;

use crate::noise::Noise;

/// Seeded chance for one purpose.
#[derive(Debug, Clone)]
pub struct Chance(Noise);

impl Chance {
    /// Depends on `seed` only.
    pub fn new(seed: u64) -> Self {
        Self(Noise::new(seed))
    }

    /// Independent of the other streams of the same seed.
    pub fn stream(seed: u64, stream: u64) -> Self {
        Self(Noise::stream(seed, stream))
    }

    /// 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0.bits()
    }

    /// A number below `bound`; 0 when `bound` is 0.
    pub fn below(&mut self, bound: usize) -> usize {
        let bound = bound.max(1) as u64;
        usize::try_from(self.0.bits() % bound).unwrap_or(0)
    }

    /// A number from `low` to `high`, both included.
    pub fn between(&mut self, low: usize, high: usize) -> usize {
        low + self.below(high.saturating_sub(low) + 1)
    }

    /// A time from `low` to `high`.
    pub fn time(&mut self, low: Duration, high: Duration) -> Duration {
        low + high.saturating_sub(low).mul_f64(self.0.uniform())
    }

    /// True in this share of cases.
    pub fn happens(&mut self, share: f64) -> bool {
        self.0.uniform() < share
    }

    /// A time with this mean, at most 12 times as long.
    pub fn exponential(&mut self, mean: Duration) -> Duration {
        mean.mul_f64((-(1.0 - self.0.uniform()).ln()).min(12.0))
    }

    /// Uniform in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        self.0.uniform()
    }
}
