//! What one connection counts.

use crate::protocol::InputCounters;

/// Periods that the median looks at.
const PERIODS: usize = 64;

/// Counts the samples of one connection; pure, times are given.
#[derive(Clone, Debug)]
pub struct Statistics {
    counters: InputCounters,
    deadline_ns: Option<u64>,
    /// Since when the next sample is waited for; `None` before the first one, and while
    /// nobody listens.
    waits_since_ns: Option<u64>,
    /// Deadlines counted as missed since then.
    missed: u64,
    sequence: Option<u64>,
    periods: [u64; PERIODS],
    periods_count: usize,
}

impl Statistics {
    /// Counts for a connection of that index, with or without a deadline.
    pub fn new(connection: u16, deadline_ns: Option<u64>) -> Self {
        let counters = InputCounters {
            connection,
            accepted: 0,
            lost: 0,
            fenced: 0,
            late: 0,
            broken: 0,
            first_ns: 0,
            last_ns: 0,
            gap_max_ns: 0,
            period_median_ns: 0,
            epoch: 0,
        };
        Self {
            counters,
            deadline_ns: deadline_ns.filter(|deadline| *deadline > 0),
            waits_since_ns: None,
            missed: 0,
            sequence: None,
            periods: [0; PERIODS],
            periods_count: 0,
        }
    }

    /// A sample was accepted. `sequence` continues the one before unless the token is new.
    ///
    /// A sequence that goes back (a bridge that began anew) is no loss.
    pub fn accept(&mut self, now_ns: u64, epoch: u64, sequence: u64, token_is_new: bool) {
        self.count_missed(now_ns);
        (self.waits_since_ns, self.missed) = (Some(now_ns), 0);
        let counters = &mut self.counters;
        if let Some(before) = self.sequence
            && !token_is_new
            && sequence > before
        {
            counters.lost = counters.lost.saturating_add(sequence - before - 1);
        }
        if counters.accepted == 0 {
            counters.first_ns = now_ns;
        } else {
            let period = now_ns.saturating_sub(counters.last_ns);
            counters.gap_max_ns = counters.gap_max_ns.max(period);
            self.periods[self.periods_count % PERIODS] = period;
            self.periods_count += 1;
        }
        counters.accepted += 1;
        counters.last_ns = now_ns;
        counters.epoch = epoch;
        self.sequence = Some(sequence);
    }

    /// A sample of an old token was refused.
    pub fn refuse(&mut self) {
        self.counters.fenced += 1;
    }

    /// A sample was not what the port carries.
    pub fn break_off(&mut self) {
        self.counters.broken += 1;
    }

    /// What comes next does not continue what came last: nobody listens in between.
    pub fn pause(&mut self) {
        self.sequence = None;
        self.waits_since_ns = None;
    }

    /// The figures; the longest gap starts anew with this call.
    pub fn take(&mut self, now_ns: u64) -> InputCounters {
        self.count_missed(now_ns);
        let mut counters = self.counters.clone();
        counters.period_median_ns = self.median();
        self.counters.gap_max_ns = 0;
        counters
    }

    /// Each deadline that passes without a sample counts, also while none comes at all.
    fn count_missed(&mut self, now_ns: u64) {
        let (Some(deadline), Some(since)) = (self.deadline_ns, self.waits_since_ns) else { return };
        let missed = now_ns.saturating_sub(since).saturating_sub(1) / deadline;
        self.counters.late += missed.saturating_sub(self.missed);
        self.missed = self.missed.max(missed);
    }

    fn median(&self) -> u64 {
        let mut periods = self.periods;
        let known = &mut periods[..self.periods_count.min(PERIODS)];
        if known.is_empty() {
            return 0;
        }
        let middle = known.len() / 2;
        *known.select_nth_unstable(middle).1
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn gaps_in_the_sequence_are_losses_except_across_tokens() {
        let mut statistics = Statistics::new(0, None);
        for (sequence, token_is_new) in
            [(5, true), (6, false), (9, false), (40, true), (41, false), (1, false), (2, false)]
        {
            statistics.accept(1, 1, sequence, token_is_new);
        }
        assert_eq!(statistics.take(1).lost, 2);
    }

    #[test]
    fn the_longest_gap_belongs_to_its_window_and_late_ones_are_counted() {
        let mut statistics = Statistics::new(0, Some(15));
        for now in [100, 110, 120, 150] {
            statistics.accept(now, 1, now, false);
        }

        let window = statistics.take(150);
        assert_eq!((window.first_ns, window.last_ns), (100, 150));
        assert_eq!((window.gap_max_ns, window.period_median_ns, window.late), (30, 10, 1));
        assert_eq!(statistics.take(150).gap_max_ns, 0);
    }

    #[test]
    fn deadlines_are_missed_one_by_one_while_nothing_comes_and_somebody_listens() {
        let mut statistics = Statistics::new(0, Some(10));
        assert_eq!(statistics.take(1000).late, 0);
        statistics.accept(1000, 1, 1, true);
        for (now, late) in [(1010, 0), (1011, 1), (1025, 2), (1031, 3)] {
            assert_eq!(statistics.take(now).late, late, "at {now}");
        }

        statistics.accept(1035, 1, 2, false);
        assert_eq!(statistics.take(1040).late, 3);

        statistics.pause();
        statistics.accept(9000, 1, 3, false);
        assert_eq!(statistics.take(9005).late, 3);
    }

    #[test]
    fn the_median_forgets_all_but_the_last_64() {
        let mut statistics = Statistics::new(0, None);
        let mut now = 0;
        for period in std::iter::repeat_n(1000, 100).chain(std::iter::repeat_n(7, 64)) {
            now += period;
            statistics.accept(now, 1, 0, false);
        }
        assert_eq!(statistics.take(now).period_median_ns, 7);
    }

    proptest! {
        #[test]
        fn what_was_sent_under_one_token_is_accepted_or_lost(
            mask in prop::collection::vec(any::<bool>(), 1..200),
        ) {
            let mut statistics = Statistics::new(0, None);
            let arrived: Vec<u64> =
                (1..).zip(&mask).filter(|(_, kept)| **kept).map(|(sequence, _)| sequence).collect();
            for sequence in &arrived {
                statistics.accept(1, 1, *sequence, false);
            }
            let counters = statistics.take(1);
            if let (Some(first), Some(last)) = (arrived.first(), arrived.last()) {
                prop_assert_eq!(counters.accepted + counters.lost, last - first + 1);
            }
        }
    }
}
