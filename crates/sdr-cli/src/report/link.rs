//! One connection as its consumers saw it, one after the other.

use std::collections::BTreeMap;

use sdr_core::recording::ConnectionSample;

/// What a switch may add to two periods without a sample.
const SWITCH_NS: u64 = 200_000_000;

/// A connection over the run.
#[derive(Debug, Default)]
pub(crate) struct Link {
    samples: Vec<ConnectionSample>,
}

/// The pauses of a connection around a moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Pause {
    /// Longest pause between two accepted samples, ns.
    pub(crate) gap_max_ns: u64,
    /// Median period before, ns; `None` when unknown.
    pub(crate) period_median_ns: Option<u64>,
}

impl Pause {
    /// What a pause may be: a sample too many, and the time of a switch.
    pub(crate) fn bar_ns(&self) -> Option<u64> {
        let period = self.period_median_ns?;
        Some(period.saturating_mul(2).saturating_add(SWITCH_NS))
    }

    /// The bar, when the pause is over it.
    pub(crate) fn over_ns(&self) -> Option<u64> {
        self.bar_ns().filter(|bar| self.gap_max_ns > *bar)
    }
}

/// How many samples of a connection arrived, and how many did not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    /// Accepted by consumers.
    pub(crate) received: u64,
    /// Missing in the sequence.
    pub(crate) lost: u64,
    /// Refused because of an old token.
    pub(crate) fenced: u64,
    /// Later than the deadline.
    pub(crate) late: u64,
}

impl Link {
    /// Adds a window; windows come by time.
    pub(super) fn add(&mut self, sample: &ConnectionSample) {
        self.samples.push(sample.clone());
    }

    /// When the first sample of all was accepted.
    pub(crate) fn first_ns(&self) -> Option<u64> {
        self.samples.iter().map(|sample| sample.first_ns).filter(|at| *at > 0).min()
    }

    /// When a consumer had accepted a sample of `epoch` or a later one.
    ///
    /// Exact for an instance that began with it; for one that went on across the change it is
    /// the last sample of the first window that knows the epoch: late by one window at most.
    pub(crate) fn heard_ns(&self, epoch: u64) -> Option<u64> {
        let knows = |sample: &&ConnectionSample| sample.epoch >= epoch && sample.last_ns > 0;
        let sample = self.samples.iter().find(knows)?;
        let before = self.samples.iter().any(|other| {
            other.robot == sample.robot
                && other.monotonic_ns < sample.monotonic_ns
                && other.first_ns == sample.first_ns
        });
        Some(if before { sample.last_ns } else { sample.first_ns.max(1) })
    }

    /// The longest pause that overlaps the time from `from_ns` to `until_ns`, within one instance or
    /// from the last sample of one to the first sample of the next.
    pub(crate) fn pause(&self, from_ns: u64, until_ns: u64) -> Option<Pause> {
        let instances = self.instances();
        let mut longest = None;
        for samples in &instances {
            for sample in samples.iter().filter(|sample| sample.gap_max_ns > 0) {
                let ended_before = sample.monotonic_ns < from_ns;
                let began_after = sample.last_ns.saturating_sub(sample.gap_max_ns) > until_ns;
                if !ended_before && !began_after {
                    longest = longest.max(Some(sample.gap_max_ns));
                }
            }
        }
        for pair in instances.windows(2) {
            let (last, first) = (span(&pair[0]).1, span(&pair[1]).0);
            if last > 0 && first >= from_ns && last <= until_ns {
                longest = longest.max(Some(first.saturating_sub(last)));
            }
        }
        // A pause that has not ended counts as far as it is known.
        if let Some(last) = instances.last().and_then(|samples| samples.last()) {
            let open = last.monotonic_ns.saturating_sub(last.last_ns);
            if last.last_ns <= until_ns && last.monotonic_ns >= from_ns && longest < Some(open) {
                longest = Some(open);
            }
        }
        let period = |sample: &&ConnectionSample| sample.period_median_ns > 0;
        let mut before = self.samples.iter().filter(|sample| sample.monotonic_ns <= from_ns);
        let median = before.rfind(period).or_else(|| self.samples.iter().rfind(period));
        longest.map(|gap_max_ns| Pause {
            gap_max_ns,
            period_median_ns: median.map(|sample| sample.period_median_ns),
        })
    }

    /// Median period at the end.
    pub(crate) fn period_ns(&self) -> Option<u64> {
        let known = self.samples.iter().rfind(|sample| sample.period_median_ns > 0);
        known.map(|sample| sample.period_median_ns)
    }

    /// How long nothing had been accepted when the newest instance was last looked at.
    pub(crate) fn silent_ns(&self) -> Option<u64> {
        let last = self.instances().last().and_then(|samples| samples.last().copied())?;
        Some(last.monotonic_ns.saturating_sub(last.last_ns))
    }

    /// Over all instances.
    pub(crate) fn counts(&self) -> Counts {
        self.instances().iter().filter_map(|samples| samples.last()).fold(
            Counts::default(),
            |sum, last| Counts {
                received: sum.received + last.accepted,
                lost: sum.lost + last.lost,
                fenced: sum.fenced + last.fenced,
                late: sum.late + last.late,
            },
        )
    }

    /// The windows of each consuming instance that accepted anything, oldest instance first.
    fn instances(&self) -> Vec<Vec<&ConnectionSample>> {
        let mut instances: BTreeMap<(u64, &str), Vec<&ConnectionSample>> = BTreeMap::new();
        for sample in self.samples.iter().filter(|sample| sample.first_ns > 0) {
            instances.entry((sample.first_ns, &sample.robot)).or_default().push(sample);
        }
        instances.into_values().collect()
    }
}

/// First and last sample accepted by one instance.
fn span(samples: &[&ConnectionSample]) -> (u64, u64) {
    let first = samples.first().map_or(0, |sample| sample.first_ns);
    (first, samples.iter().map(|sample| sample.last_ns).max().unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn window(robot: &str, at_ms: u64, first_ms: u64, gap_ms: u64, epoch: u64) -> ConnectionSample {
        ConnectionSample {
            robot: robot.to_owned(),
            monotonic_ns: at_ms * MS,
            first_ns: first_ms * MS,
            last_ns: (at_ms - 5) * MS,
            gap_max_ns: gap_ms * MS,
            period_median_ns: 66 * MS,
            accepted: at_ms,
            lost: 1,
            epoch,
            ..ConnectionSample::default()
        }
    }

    fn link(windows: &[ConnectionSample]) -> Link {
        let mut link = Link::default();
        windows.iter().for_each(|window| link.add(window));
        link
    }

    #[test]
    fn a_pause_across_two_consumers_counts_from_the_last_to_the_first() {
        let link = link(&[
            window("robot-1", 1000, 100, 70, 1),
            window("robot-1", 1200, 100, 71, 1),
            window("robot-3", 1600, 1495, 60, 2),
        ]);

        let pause = link.pause(1100 * MS, 2000 * MS).unwrap();

        assert_eq!(pause.gap_max_ns, 300 * MS);
        assert_eq!(pause.period_median_ns, Some(66 * MS));
        assert_eq!(link.counts().received, 2800);
        assert_eq!(link.counts().lost, 2);
        assert_eq!(link.first_ns(), Some(100 * MS));
    }

    #[test]
    fn consumers_that_overlap_make_no_pause() {
        let link = link(&[
            window("robot-1", 1200, 100, 70, 1),
            window("robot-3", 1300, 1100, 60, 2),
            window("robot-1", 1400, 100, 70, 1),
        ]);
        assert_eq!(link.pause(1000 * MS, 2000 * MS).unwrap().gap_max_ns, 70 * MS);
    }

    #[test]
    fn a_new_producer_is_heard_at_the_first_sample_of_its_epoch() {
        let moved = link(&[window("robot-3", 1600, 1495, 60, 2)]);
        assert_eq!(moved.heard_ns(2), Some(1495 * MS));

        let stayed =
            link(&[window("robot-2", 1400, 100, 70, 1), window("robot-2", 1600, 100, 120, 2)]);
        assert_eq!(stayed.heard_ns(2), Some(1595 * MS));
        assert_eq!(stayed.heard_ns(3), None);
    }

    #[test]
    fn a_pause_that_has_not_ended_counts() {
        let mut silent = window("robot-2", 5000, 100, 0, 1);
        silent.last_ns = 1195 * MS;
        let link = link(&[window("robot-2", 1200, 100, 70, 1), silent]);
        let pause = link.pause(1000 * MS, 2000 * MS).unwrap();
        assert_eq!(pause.gap_max_ns, 3805 * MS);
        assert_eq!(link.silent_ns(), Some(3805 * MS));
        assert_eq!(pause.over_ns(), Some(332 * MS));
        assert_eq!(Pause { gap_max_ns: 332 * MS, ..pause }.over_ns(), None);
        assert_eq!(Pause { period_median_ns: None, ..pause }.over_ns(), None);
    }

    #[test]
    fn nothing_accepted_is_no_pause_of_zero() {
        assert_eq!(Link::default().pause(0, u64::MAX), None);
        assert_eq!(link(&[window("robot-1", 9, 0, 0, 0)]).pause(0, u64::MAX), None);
    }
}
