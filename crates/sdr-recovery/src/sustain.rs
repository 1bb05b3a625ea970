//! A condition over time: it must hold for long before it is raised, and be gone for long
//! before it is over.

use alloc::string::String;
use core::time::Duration;

use sdr_core::time::Instant;

use crate::{
    condition::{Clear, Condition},
    level::Level,
    smooth::Smoother,
};

/// One condition being watched.
#[derive(Clone, Debug)]
pub(crate) struct Sustain {
    condition: Condition,
    smoother: Smoother,
    stage: Stage,
    /// Why it holds, where the figure does not say it.
    pub(crate) note: String,
}

/// How far it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stage {
    /// The bar is not met.
    Calm,
    /// The bar is met, not yet for long enough.
    Pending {
        /// Since when.
        since: Instant,
    },
    /// It is met for long enough and not over.
    Raised {
        /// Since when the bar is met.
        since: Instant,
        /// Since when the release level is reached, if it is.
        clearing: Option<Instant>,
    },
}

impl Sustain {
    pub(crate) fn new(condition: Condition) -> Self {
        let smoother = Smoother::new(condition.median_over);
        Self { condition, smoother, stage: Stage::Calm, note: String::new() }
    }

    /// Takes a fresh figure; `None` when nobody can tell.
    pub(crate) fn feed(&mut self, now: Instant, found: Option<Level>) {
        self.smoother.feed(now, found.map(Level::raw));
        let before = self.stage;
        self.stage = self.next_stage(now);
        if core::mem::discriminant(&before) != core::mem::discriminant(&self.stage) {
            // In the moment of change the next stage may begin to end already.
            self.stage = self.next_stage(now);
        }
    }

    /// When it should be fed again at the latest, if the figure stays as it is.
    pub(crate) fn deadline(&self, now: Instant) -> Option<Instant> {
        let bar = self.condition.bar;
        let bar_flips = || self.smoother.flips_at(now, |found| bar.holds(found));
        match (self.stage, self.condition.clear) {
            (Stage::Calm, _) | (Stage::Raised { .. }, None) => bar_flips(),
            (Stage::Pending { since }, _) => {
                Some(since + self.condition.hold).into_iter().chain(bar_flips()).min()
            }
            (Stage::Raised { clearing, .. }, Some(Clear { level, hold })) => {
                let flips = self.smoother.flips_at(now, |found| bar.released(level, found));
                clearing.map(|since| since + hold).into_iter().chain(flips).min()
            }
        }
    }

    pub(crate) fn stage(&self) -> Stage {
        self.stage
    }

    pub(crate) fn raised(&self) -> bool {
        matches!(self.stage, Stage::Raised { .. })
    }

    /// When it had held for its whole time, once raised.
    pub(crate) fn held_over_at(&self) -> Option<Instant> {
        match self.stage {
            Stage::Raised { since, .. } => Some(since + self.condition.hold),
            Stage::Calm | Stage::Pending { .. } => None,
        }
    }

    /// When it will have held for its whole time, while it is pending.
    pub(crate) fn raised_at(&self) -> Option<Instant> {
        match self.stage {
            Stage::Pending { since } => Some(since + self.condition.hold),
            Stage::Calm | Stage::Raised { .. } => None,
        }
    }

    /// The figure as it is judged.
    pub(crate) fn found(&self, now: Instant) -> Option<Level> {
        let raw = self.smoother.median(now)?;
        Some(self.condition.bar.level().with_raw(raw))
    }

    pub(crate) fn condition(&self) -> &Condition {
        &self.condition
    }

    fn next_stage(&self, now: Instant) -> Stage {
        match self.stage {
            Stage::Calm | Stage::Pending { .. } if !self.bar_holds(now) => Stage::Calm,
            Stage::Calm => self.held(now, now),
            Stage::Pending { since } => self.held(now, since),
            Stage::Raised { since, clearing } => match self.clear_hold(now) {
                None => Stage::Raised { since, clearing: None },
                Some(hold) => {
                    let clear_since = clearing.unwrap_or(now);
                    if now.since(clear_since) >= hold {
                        Stage::Calm
                    } else {
                        Stage::Raised { since, clearing: Some(clear_since) }
                    }
                }
            },
        }
    }

    fn bar_holds(&self, now: Instant) -> bool {
        self.smoother.mostly(now, |found| self.condition.bar.holds(found))
    }

    fn held(&self, now: Instant, since: Instant) -> Stage {
        if now.since(since) >= self.condition.hold {
            Stage::Raised { since, clearing: None }
        } else {
            Stage::Pending { since }
        }
    }

    /// How long the release must last, when the figure is at the release level.
    fn clear_hold(&self, now: Instant) -> Option<Duration> {
        let bar = self.condition.bar;
        let (gone, hold) = match self.condition.clear {
            Some(Clear { level, hold }) => {
                (self.smoother.mostly(now, |found| bar.released(level, found)), hold)
            }
            // Without a release level it is over when the bar is surely not met.
            None => {
                let known = self.smoother.median(now).is_some();
                (known && !self.bar_holds(now), Duration::ZERO)
            }
        };
        gone.then_some(hold)
    }
}

#[cfg(test)]
mod tests {
    use sdr_core::units::{Bytes, Dbm};

    use super::*;
    use crate::{condition::Bar, fact::Fact};

    fn at(millis: u64) -> Instant {
        Instant::from_millis(millis)
    }

    fn memory(mega: u64) -> Option<Level> {
        Some(Level::Memory(Bytes::mega(mega)))
    }

    /// Table VI's first row with a release level.
    fn short() -> Sustain {
        let bar = Bar::AtMost(Level::Memory(Bytes::mega(200)));
        let level = Level::Memory(Bytes::mega(250));
        let condition = Condition::new(Fact::RobotMemoryFree, bar, Duration::from_secs(2));
        Sustain::new(condition.clear(level, Duration::from_secs(5)))
    }

    #[test]
    fn it_is_raised_after_its_hold_and_over_after_its_release() {
        let mut sustain = short();
        sustain.feed(at(0), memory(201));
        assert_eq!((sustain.stage(), sustain.deadline(at(0))), (Stage::Calm, None));

        sustain.feed(at(1_000), memory(200));
        assert_eq!(sustain.deadline(at(1_000)), Some(at(3_000)));
        sustain.feed(at(2_999), memory(150));
        assert!(!sustain.raised());
        sustain.feed(at(3_000), memory(150));
        assert_eq!(sustain.held_over_at(), Some(at(3_000)));

        sustain.feed(at(4_000), memory(249));
        assert!(sustain.raised() && sustain.deadline(at(4_000)).is_none());
        sustain.feed(at(5_000), memory(250));
        assert_eq!(sustain.deadline(at(5_000)), Some(at(10_000)));
        sustain.feed(at(6_000), memory(240));
        sustain.feed(at(7_000), memory(300));
        sustain.feed(at(11_999), memory(300));
        assert!(sustain.raised());
        sustain.feed(at(12_000), memory(300));
        assert_eq!(sustain.stage(), Stage::Calm);
    }

    #[test]
    fn a_break_begins_the_hold_anew() {
        let mut sustain = short();
        sustain.feed(at(0), memory(150));
        sustain.feed(at(1_900), memory(210));
        sustain.feed(at(2_000), memory(150));
        sustain.feed(at(3_900), memory(150));
        assert!(!sustain.raised());
        sustain.feed(at(4_000), memory(150));
        assert!(sustain.raised());
    }

    #[test]
    fn what_nobody_knows_raises_nothing_and_clears_nothing() {
        let mut sustain = short();
        sustain.feed(at(0), memory(150));
        sustain.feed(at(1_000), None);
        sustain.feed(at(9_000), None);
        assert_eq!(sustain.stage(), Stage::Calm);

        sustain.feed(at(10_000), memory(150));
        sustain.feed(at(12_000), memory(150));
        sustain.feed(at(13_000), None);
        sustain.feed(at(99_000), None);
        assert!(sustain.raised());
    }

    #[test]
    fn a_fading_radio_is_raised_half_a_window_and_a_hold_after_the_step() {
        let bar = Bar::AtMost(Level::Signal(Dbm::from_tenths(-525)));
        let condition = Condition::new(Fact::RobotRssi, bar, Duration::from_secs(6));
        let mut sustain = Sustain::new(condition);
        let level = |tenths| Some(Level::Signal(Dbm::from_tenths(tenths)));
        sustain.feed(at(0), level(-470));
        sustain.feed(at(107_000), level(-550));

        // Nothing but the deadlines wakes it.
        let mut now = at(107_000);
        while !sustain.raised() {
            now = sustain.deadline(now).expect("a bad figure leads somewhere");
            sustain.feed(now, level(-550));
        }

        assert_eq!(now, at(113_500));
        assert_eq!(sustain.held_over_at(), Some(at(113_500)));
    }
}
