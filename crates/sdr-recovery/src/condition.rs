//! A condition: a fact, the bar it must not cross, and for how long.

use core::time::Duration;

use serde::{Deserialize, Serialize};

use crate::{
    fact::{Fact, Over},
    level::{Level, Unit},
};

/// A bar; both kinds include it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Bar {
    /// The fault is there at this value and below.
    AtMost(Level),
    /// The fault is there at this value and above.
    AtLeast(Level),
}

impl Bar {
    /// The value of the bar.
    pub fn level(self) -> Level {
        match self {
            Self::AtMost(level) | Self::AtLeast(level) => level,
        }
    }

    /// Whether `found` is at the bar or on the bad side of it.
    pub(crate) fn holds(self, found: i64) -> bool {
        match self {
            Self::AtMost(level) => found <= level.raw(),
            Self::AtLeast(level) => found >= level.raw(),
        }
    }

    /// Whether `found` is at the release level `clear` or on the good side of it.
    pub(crate) fn released(self, clear: Level, found: i64) -> bool {
        match self {
            Self::AtMost(_) => found >= clear.raw(),
            Self::AtLeast(_) => found <= clear.raw(),
        }
    }
}

/// When a raised cause is over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Clear {
    /// The value that must be reached, bar included, on the good side.
    pub level: Level,
    /// For how long without a break.
    pub hold: Duration,
}

/// A fact over time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Condition {
    /// What is watched.
    pub fact: Fact,
    /// Where the fault begins.
    pub bar: Bar,
    /// How long without a break it must last before the cause is raised (`for`).
    pub hold: Duration,
    /// When it is over; `None`: as soon as the bar is not met.
    pub clear: Option<Clear>,
    /// The median of the samples of this window is judged; zero judges each sample.
    pub median_over: Duration,
    /// Which link counts, for facts of links.
    pub over: Over,
    /// The time in which is counted, for facts that are rates.
    pub per: Duration,
}

/// The window over which a noisy radio level is smoothed unless the policy says otherwise.
pub const RSSI_MEDIAN_OVER: Duration = Duration::from_secs(1);

impl Condition {
    /// A condition that raises after `hold`, is over as soon as the bar is not met any more,
    /// and smooths as the fact needs it: the radio level over [`RSSI_MEDIAN_OVER`], others not.
    pub fn new(fact: Fact, bar: Bar, hold: Duration) -> Self {
        let median_over = match fact.unit() {
            Unit::Signal => RSSI_MEDIAN_OVER,
            Unit::Memory | Unit::Share | Unit::Time | Unit::Rate | Unit::Flag => Duration::ZERO,
        };
        let (over, per) = (Over::default(), Duration::ZERO);
        Self { fact, bar, hold, clear: None, median_over, over, per }
    }

    /// At least `count` times within `per`.
    pub fn rate(fact: Fact, count: u32, per: Duration) -> Self {
        let bar = Bar::AtLeast(Level::Count(count));
        Self { per, ..Self::new(fact, bar, Duration::ZERO) }
    }

    /// What an expression or a program says, for `hold`; over when it said otherwise for
    /// `clear`.
    pub fn told(hold: Duration, clear: Duration) -> Self {
        let bar = Bar::AtLeast(Level::Flag(true));
        Self::new(Fact::Told, bar, hold).clear(Level::Flag(false), clear)
    }

    /// The same, over only when `level` was met for `hold`.
    pub fn clear(self, level: Level, hold: Duration) -> Self {
        Self { clear: Some(Clear { level, hold }), ..self }
    }
}
