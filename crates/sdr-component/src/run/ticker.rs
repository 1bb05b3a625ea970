//! When to call `on_execute`: absolute deadlines, no drift, and how well they were kept.

use crate::protocol::{Beat, ExecutionSetup};

/// Least period, nanoseconds.
const PERIOD_MIN_NS: u64 = 100_000;
/// `on_error` is called no more often than this.
const ERROR_PERIOD_NS: u64 = 100_000_000;

/// The deadlines of one component; pure, times are given.
#[derive(Clone, Debug)]
pub(super) struct Ticker {
    period_ns: Option<u64>,
    next_ns: u64,
    last_ns: Option<u64>,
    beat: Beat,
}

impl Ticker {
    pub(super) fn new(execution: ExecutionSetup) -> Self {
        let mut ticker = Self { period_ns: None, next_ns: 0, last_ns: None, beat: Beat::default() };
        ticker.set(execution);
        ticker
    }

    /// Another period, from the next tick on.
    pub(super) fn set(&mut self, execution: ExecutionSetup) {
        self.period_ns = match execution {
            ExecutionSetup::Periodic { period_us } => {
                Some(period_us.saturating_mul(1000).max(PERIOD_MIN_NS))
            }
            ExecutionSetup::OnData => None,
        };
    }

    pub(super) fn period_ns(&self) -> Option<u64> {
        self.period_ns
    }

    /// The state changed: the first tick of a periodic one is due now.
    pub(super) fn start(&mut self, now_ns: u64) {
        self.next_ns = now_ns;
        self.last_ns = None;
    }

    /// When the next tick is due; `None` when only data makes it so.
    pub(super) fn due_ns(&self, is_error: bool) -> Option<u64> {
        if is_error || self.period_ns.is_some() { Some(self.next_ns) } else { None }
    }

    /// A tick begins.
    pub(super) fn begin(&mut self, now_ns: u64, is_error: bool) {
        let period_ns = match (self.period_ns, is_error) {
            (Some(period), false) => Some(period),
            (Some(period), true) => Some(period.max(ERROR_PERIOD_NS)),
            (None, true) => Some(ERROR_PERIOD_NS),
            (None, false) => None,
        };
        if let Some(last) = self.last_ns {
            let period = now_ns.saturating_sub(last);
            self.beat.period_worst_ns = self.beat.period_worst_ns.max(period);
        }
        self.last_ns = Some(now_ns);
        self.beat.ticks += 1;
        if let Some(period_ns) = period_ns {
            let behind = now_ns.saturating_sub(self.next_ns);
            let skipped = behind / period_ns;
            if !is_error {
                let is_late = behind % period_ns > period_ns / 2;
                self.beat.late += skipped + u64::from(is_late);
            }
            // The grid of deadlines stays where it is; those already over are left out.
            self.next_ns += period_ns.saturating_mul(skipped + 1);
        }
    }

    /// The tick that began is over.
    pub(super) fn end(&mut self, now_ns: u64) {
        if let Some(start) = self.last_ns {
            let took = now_ns.saturating_sub(start);
            self.beat.execute_worst_ns = self.beat.execute_worst_ns.max(took);
        }
    }

    pub(super) fn ticks(&self) -> u64 {
        self.beat.ticks
    }

    /// The figures; the worst ones start anew with this call.
    pub(super) fn take_beat(&mut self) -> Beat {
        let beat = self.beat;
        self.beat.period_worst_ns = 0;
        self.beat.execute_worst_ns = 0;
        beat
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const MS: u64 = 1_000_000;

    fn every_20_ms() -> Ticker {
        let mut ticker = Ticker::new(ExecutionSetup::Periodic { period_us: 20_000 });
        ticker.start(100 * MS);
        ticker
    }

    #[test]
    fn a_tick_that_begins_late_does_not_shift_those_after_it() {
        let mut ticker = every_20_ms();
        for now in [100, 125, 140] {
            ticker.begin(now * MS, false);
        }
        assert_eq!(ticker.due_ns(false), Some(160 * MS));
        assert_eq!(ticker.take_beat().late, 0);
    }

    #[test]
    fn skipped_periods_are_late_and_not_made_up_for() {
        let mut ticker = every_20_ms();
        ticker.begin(100 * MS, false);
        ticker.begin(195 * MS, false);

        let beat = ticker.take_beat();
        assert_eq!((beat.ticks, beat.late, beat.period_worst_ns), (2, 4, 95 * MS));
        assert_eq!(ticker.due_ns(false), Some(200 * MS));
    }

    #[test]
    fn on_error_is_called_ten_times_a_second_at_most() {
        let mut fast = every_20_ms();
        fast.begin(100 * MS, true);
        assert_eq!(fast.due_ns(true), Some(200 * MS));

        let mut on_data = Ticker::new(ExecutionSetup::OnData);
        on_data.start(0);
        on_data.begin(0, true);
        assert_eq!((on_data.due_ns(true), on_data.due_ns(false)), (Some(100 * MS), None));
    }

    proptest! {
        #[test]
        fn the_next_tick_is_never_in_the_past_and_always_on_the_grid(
            steps in prop::collection::vec(0..200_u64, 1..50),
        ) {
            let mut ticker = every_20_ms();
            let mut now = 100 * MS;
            for step in steps {
                now = now.max(ticker.due_ns(false).unwrap()) + step * MS;
                ticker.begin(now, false);
                let due = ticker.due_ns(false).unwrap();
                prop_assert!(due > now && due <= now + 20 * MS);
                prop_assert_eq!((due - 100 * MS) % (20 * MS), 0);
            }
        }
    }
}
