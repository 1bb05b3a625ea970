//! A robot's own clock: begins anywhere, runs a little fast or slow, stands still in sleep.

use std::time::Duration;

use sdr_core::time::Instant;

/// The monotonic clock of one robot against virtual time.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Clock {
    /// Virtual time at which the clock showed `shown`.
    at: Instant,
    shown: Instant,
    /// Millionths by which it runs fast (or slow, below zero).
    drift_ppm: i64,
}

impl Clock {
    /// A clock that shows `shown` at `at`.
    pub(crate) fn new(at: Instant, shown: Instant, drift_ppm: i64) -> Self {
        Self { at, shown, drift_ppm }
    }

    /// What it shows at the virtual moment `now`.
    pub(crate) fn show(&self, now: Instant) -> Instant {
        let passed = now.since(self.at);
        self.shown + scale(passed, 1_000_000 + self.drift_ppm, 1_000_000)
    }

    /// The first virtual moment at which it shows `shown` or more.
    pub(crate) fn when(&self, shown: Instant) -> Instant {
        let passed = shown.since(self.shown);
        self.at + scale(passed, 1_000_000, 1_000_000 + self.drift_ppm) + Duration::from_nanos(1)
    }

    /// Stands still from `now` on for `pause`, as CLOCK_MONOTONIC does while a machine sleeps.
    pub(crate) fn sleep(&mut self, now: Instant, pause: Duration) {
        self.shown = self.show(now);
        self.at = now + pause;
    }
}

fn scale(time: Duration, times: i64, over: i64) -> Duration {
    let nanos = time.as_nanos() * times.unsigned_abs() as u128 / over.unsigned_abs() as u128;
    Duration::from_nanos(u64::try_from(nanos).unwrap_or(u64::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fast_clock_shows_more_and_finds_its_moments_again() {
        let clock = Clock::new(Instant::from_millis(10), Instant::from_millis(5000), 200);
        let later = Instant::from_millis(10_010);
        assert_eq!(clock.show(later), Instant::from_millis(15_002));

        let found = clock.when(clock.show(later));
        assert!(
            found.since(later) < Duration::from_nanos(10) && clock.show(found) >= clock.show(later)
        );
    }

    #[test]
    fn a_clock_that_sleeps_shows_nothing_of_it() {
        let mut clock = Clock::new(Instant::ZERO, Instant::ZERO, 0);
        clock.sleep(Instant::from_millis(100), Duration::from_millis(900));
        assert_eq!(clock.show(Instant::from_millis(500)), Instant::from_millis(100));
        assert_eq!(clock.show(Instant::from_millis(1500)), Instant::from_millis(600));
    }
}
