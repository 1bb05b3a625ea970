//! A noisy figure made calm: the median over a window of time.
//!
//! A sample counts for as long as it was the newest one, not for being a sample, so more
//! frequent looks at the same world give the same median.

use alloc::{collections::VecDeque, vec::Vec};
use core::time::Duration;

use sdr_core::time::Instant;

/// Most samples that are kept; older ones go first.
const SAMPLES_MAX: usize = 1024;

/// The samples of one window.
#[derive(Clone, Debug)]
pub(crate) struct Smoother {
    window: Duration,
    /// When each value began to hold; `None` where nobody could tell.
    samples: VecDeque<(Instant, Option<i64>)>,
}

impl Smoother {
    pub(crate) fn new(window: Duration) -> Self {
        Self { window, samples: VecDeque::new() }
    }

    /// From `now` on the figure is `value`.
    pub(crate) fn feed(&mut self, now: Instant, value: Option<i64>) {
        if self.samples.back().is_none_or(|(_, newest)| *newest != value) {
            self.samples.push_back((now, value));
        }
        let start = now - self.window;
        // The newest sample from before the window still holds at its beginning.
        while self.samples.get(1).is_some_and(|(at, _)| *at <= start)
            || self.samples.len() > SAMPLES_MAX
        {
            self.samples.pop_front();
        }
    }

    /// The median at `now`; `None` when nothing is known.
    pub(crate) fn median(&self, now: Instant) -> Option<i64> {
        let mut spans: Vec<(i64, u128)> = self
            .spans(now)
            .into_iter()
            .filter_map(|span| span.value.map(|value| (value, span.lasts.as_nanos())))
            .collect();
        let known: u128 = spans.iter().map(|(_, lasts)| lasts).sum();
        if known == 0 {
            return self.newest();
        }
        spans.sort_unstable();
        let mut seen = 0;
        let reached = |(_, lasts): &&(i64, u128)| {
            seen += lasts;
            seen * 2 >= known
        };
        spans.iter().find(reached).map(|(value, _)| *value)
    }

    /// Whether the figure met `test` for at least half of the window's known time.
    pub(crate) fn mostly(&self, now: Instant, test: impl Fn(i64) -> bool) -> bool {
        match self.lead(now, &test) {
            Some(lead) => lead >= 0,
            None => self.newest().is_some_and(test),
        }
    }

    /// When [`Self::mostly`] changes its answer if the newest value stays.
    pub(crate) fn flips_at(&self, now: Instant, test: impl Fn(i64) -> bool) -> Option<Instant> {
        let holds = self.mostly(now, &test);
        let mut lead = self.lead(now, &test)?;
        let sign = |value: Option<i64>| -> i128 {
            match value.map(&test) {
                Some(true) => 1,
                Some(false) => -1,
                None => 0,
            }
        };
        let comes = sign(self.newest());
        let fills = (self.samples.front()?.0 + self.window).since(now);
        let spans = self.spans(now).into_iter().map(|span| (span.lasts, sign(span.value)));
        let mut at = now;
        // Once the window is full its far edge moves over the spans, one after the other.
        for (lasts, goes) in core::iter::once((fills, 0)).chain(spans) {
            let (nanos, slope) = (nanos(lasts), comes - goes);
            let after = match slope.signum() {
                1 if !holds => (-lead + slope - 1) / slope,
                -1 if holds => lead / -slope + 1,
                _ => i128::MAX,
            };
            if after <= nanos {
                return Some(at + Duration::from_nanos(u64::try_from(after).unwrap_or(u64::MAX)));
            }
            (lead, at) = (lead + slope * nanos, at + lasts);
        }
        (holds && self.newest().is_none()).then_some(at)
    }

    fn newest(&self) -> Option<i64> {
        self.samples.back().and_then(|(_, value)| *value)
    }

    /// Time within the window that meets the test less known time that does not; `None` when
    /// no known time lies in it.
    fn lead(&self, now: Instant, test: &impl Fn(i64) -> bool) -> Option<i128> {
        let mut lead = None;
        for span in self.spans(now) {
            let lasts = nanos(span.lasts);
            if let Some(value) = span.value.filter(|_| lasts > 0) {
                let signed = if test(value) { lasts } else { -lasts };
                lead = Some(lead.unwrap_or(0) + signed);
            }
        }
        lead
    }

    /// The values within the window and how long each held, oldest first.
    fn spans(&self, now: Instant) -> Vec<Span> {
        let start = now - self.window;
        let ends = self.samples.iter().skip(1).map(|(at, _)| *at).chain([now]);
        let spans = self.samples.iter().zip(ends);
        spans
            .map(|((at, value), end)| Span { value: *value, lasts: end.since((*at).max(start)) })
            .collect()
    }
}

/// A value and how long it held.
struct Span {
    value: Option<i64>,
    lasts: Duration,
}

fn nanos(time: Duration) -> i128 {
    i128::try_from(time.as_nanos()).unwrap_or(i128::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: u64) -> Instant {
        Instant::from_millis(millis)
    }

    fn bad(value: i64) -> bool {
        value <= -525
    }

    /// Fed with (ms, value).
    fn fed(samples: &[(u64, Option<i64>)]) -> Smoother {
        let mut smoother = Smoother::new(Duration::from_secs(1));
        for (millis, value) in samples {
            smoother.feed(at(*millis), *value);
        }
        smoother
    }

    #[test]
    fn a_step_is_believed_after_half_the_window_and_that_moment_is_known_before() {
        let smoother = fed(&[(0, Some(-470)), (5_000, Some(-550))]);

        assert!(!smoother.mostly(at(5_499), bad));
        assert_eq!(smoother.flips_at(at(5_000), bad), Some(at(5_500)));
        assert_eq!(smoother.flips_at(at(5_300), bad), Some(at(5_500)));
        assert!(smoother.mostly(at(5_500), bad));
        assert_eq!(smoother.median(at(5_499)), Some(-470));
        assert_eq!(smoother.median(at(5_500)), Some(-550));
    }

    #[test]
    fn looking_more_often_changes_nothing() {
        let mut often = fed(&[(0, Some(-470))]);
        for millis in (5_000..5_490).step_by(10) {
            often.feed(at(millis), Some(-550));
        }
        assert!(!often.mostly(at(5_490), bad));
        assert_eq!(often.flips_at(at(5_490), bad), Some(at(5_500)));
    }

    #[test]
    fn an_outlier_changes_nothing() {
        let smoother = fed(&[(0, Some(-470)), (5_000, Some(-900)), (5_200, Some(-470))]);
        assert!(!smoother.mostly(at(5_600), bad));
        assert_eq!(smoother.flips_at(at(5_600), bad), None);
    }

    #[test]
    fn the_first_sample_counts_at_once_and_a_gap_counts_for_nobody() {
        let first = fed(&[(3_000, Some(-550))]);
        assert!(first.mostly(at(3_000), bad));

        let gap = fed(&[(0, Some(-470)), (5_000, None), (5_800, Some(-550))]);
        assert!(!gap.mostly(at(5_850), bad));
        assert_eq!(gap.flips_at(at(5_850), bad), Some(at(5_900)));
        assert!(gap.mostly(at(5_900), bad));

        assert!(!fed(&[(0, None)]).mostly(at(500), bad));
    }

    #[test]
    fn the_foretold_moment_is_the_first_one() {
        let patterns: [&[(u64, Option<i64>)]; 4] = [
            &[(0, Some(-470)), (300, Some(-530)), (500, Some(-500)), (900, Some(-560))],
            &[(0, Some(-470)), (700, None), (900, Some(-560))],
            &[(200, Some(-470)), (900, Some(-560))],
            &[(0, None), (400, Some(-470)), (900, Some(-560))],
        ];
        for pattern in patterns {
            let smoother = fed(pattern);
            let told = smoother.flips_at(at(900), bad).unwrap();
            assert!(smoother.mostly(told, bad), "{pattern:?}");
            assert!(!smoother.mostly(told - Duration::from_nanos(1), bad), "{pattern:?}");
        }
    }
}
