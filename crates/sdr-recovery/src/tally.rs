//! Counting what happens within a time.

use alloc::collections::VecDeque;
use core::time::Duration;

use sdr_core::time::Instant;

/// Most moments that are kept apart; older ones are taken together.
const MARKS_MAX: usize = 128;

/// How often something happened within the last `per`.
#[derive(Clone, Debug)]
pub(crate) struct Tally {
    per: Duration,
    /// When, and how often then.
    marks: VecDeque<(Instant, u32)>,
}

impl Tally {
    pub(crate) fn new(per: Duration) -> Self {
        Self { per, marks: VecDeque::new() }
    }

    /// It happened `count` times just now.
    pub(crate) fn note(&mut self, now: Instant, count: u32) {
        if count == 0 {
            return;
        }
        self.marks.push_back((now, count));
        if self.marks.len() > MARKS_MAX
            && let Some((_, oldest)) = self.marks.pop_front()
            && let Some((_, next)) = self.marks.front_mut()
        {
            // Counted for longer rather than forgotten.
            *next = next.saturating_add(oldest);
        }
    }

    /// How often it happened since `per` ago.
    pub(crate) fn count(&mut self, now: Instant) -> u32 {
        while self.marks.front().is_some_and(|(at, _)| *at + self.per <= now) {
            self.marks.pop_front();
        }
        self.marks.iter().fold(0, |sum, (_, count)| sum.saturating_add(*count))
    }

    /// When [`Self::count`] falls next if nothing more happens.
    pub(crate) fn falls_at(&self) -> Option<Instant> {
        self.marks.front().map(|(at, _)| *at + self.per)
    }

    /// Counts from nothing.
    pub(crate) fn clear(&mut self) {
        self.marks.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_last_while_counts() {
        let at = |seconds: u64| Instant::from_millis(seconds * 1000);
        let mut tally = Tally::new(Duration::from_secs(60));
        for second in [0, 10, 20] {
            tally.note(at(second), 1);
        }
        assert_eq!((tally.count(at(59)), tally.falls_at()), (3, Some(at(60))));
        assert_eq!((tally.count(at(60)), tally.falls_at()), (2, Some(at(70))));
        assert_eq!((tally.count(at(80)), tally.falls_at()), (0, None));
    }

    #[test]
    fn a_flood_is_counted_in_bounded_memory() {
        let mut tally = Tally::new(Duration::from_secs(60));
        for milli in 0..10_000 {
            tally.note(Instant::from_millis(milli), 2);
        }
        assert!(tally.marks.len() <= MARKS_MAX);
        assert_eq!(tally.count(Instant::from_millis(10_000)), 20_000);
    }
}
