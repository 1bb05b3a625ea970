//! How often something may be done within any hour.

use alloc::collections::VecDeque;
use core::time::Duration;

use sdr_core::time::Instant;

/// The window of all budgets.
pub(crate) const HOUR: Duration = Duration::from_secs(3600);

/// What was done within the last hour.
#[derive(Clone, Debug, Default)]
pub(crate) struct Budget {
    done: VecDeque<Instant>,
}

impl Budget {
    /// Counts one more, at most `limit` are remembered.
    pub(crate) fn spend(&mut self, now: Instant, limit: u16) {
        self.forget_old(now);
        self.done.push_back(now);
        while self.done.len() > usize::from(limit) {
            self.done.pop_front();
        }
    }

    /// Whether one more may be done.
    pub(crate) fn has_room(&mut self, now: Instant, limit: u16) -> bool {
        self.forget_old(now);
        self.done.len() < usize::from(limit)
    }

    /// When one more may be done, if that is not now.
    pub(crate) fn frees_at(&self) -> Option<Instant> {
        self.done.front().map(|oldest| *oldest + HOUR)
    }

    /// Whether nothing was done within the last hour.
    pub(crate) fn is_idle(&mut self, now: Instant) -> bool {
        self.forget_old(now);
        self.done.is_empty()
    }

    fn forget_old(&mut self, now: Instant) {
        while self.done.front().is_some_and(|oldest| *oldest + HOUR <= now) {
            self.done.pop_front();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_window_slides() {
        let at = |seconds: u64| Instant::from_millis(seconds * 1000);
        let mut budget = Budget::default();
        for second in [0, 600] {
            assert!(budget.has_room(at(second), 2));
            budget.spend(at(second), 2);
        }
        assert!(!budget.has_room(at(3_599), 2));
        assert_eq!(budget.frees_at(), Some(at(3_600)));
        assert!(budget.has_room(at(3_600), 2));
        assert!(!budget.is_idle(at(4_199)) && budget.is_idle(at(4_200)));
        assert!(!budget.has_room(at(0), 0));
    }
}
