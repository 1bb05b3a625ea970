//! A ladder: what to try, in which order, how often, and how long to wait for it to help.

use alloc::vec::Vec;
use core::{num::NonZeroU8, time::Duration};

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// One rung; the order of variants is the order of severity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rung {
    /// Switch to a standby on the same robot; passed over when none is ready.
    LocalStandby,
    /// End the process and start it anew on the same robot.
    Restart(Restart),
    /// Switch to a standby on another robot; passed over when none is ready.
    StandbyElsewhere,
    /// Start it on another robot.
    LaunchElsewhere,
    /// Stop trying, say so.
    Hold,
}

impl Rung {
    /// The word that stands in policies.
    pub fn word(&self) -> &'static str {
        match self {
            Self::LocalStandby => "local-standby",
            Self::Restart(_) => "restart",
            Self::StandbyElsewhere => "standby-elsewhere",
            Self::LaunchElsewhere => "launch-elsewhere",
            Self::Hold => "hold",
        }
    }

    /// Its place in the order of severity.
    pub(crate) fn severity(&self) -> u8 {
        match self {
            Self::LocalStandby => 0,
            Self::Restart(_) => 1,
            Self::StandbyElsewhere => 2,
            Self::LaunchElsewhere => 3,
            Self::Hold => 4,
        }
    }
}

/// How to restart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Restart {
    /// How often within one climb.
    pub tries: NonZeroU8,
    /// Quiet time that counts as healed.
    pub settle: Duration,
    /// Pause before each try but the first.
    pub backoff: Backoff,
}

impl Default for Restart {
    /// Three tries, 10 s, 200 ms to 5 s.
    fn default() -> Self {
        Self {
            tries: NonZeroU8::MIN.saturating_add(2),
            settle: Duration::from_secs(10),
            backoff: Backoff { min: Duration::from_millis(200), max: Duration::from_secs(5) },
        }
    }
}

/// A pause that doubles with each try, between two bounds. The first try of a climb is made at
/// once: what ran well until now most often runs well again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Backoff {
    /// Before the second try.
    pub min: Duration,
    /// Never longer than this.
    pub max: Duration,
}

impl Backoff {
    /// The pause before try `tried` + 1: none, `min`, then twice as long each time, up to `max`.
    pub fn pause(&self, tried: u32) -> Duration {
        let Some(paused) = tried.checked_sub(1) else { return Duration::ZERO };
        // 2^20 times any pause that makes sense is past any bound that does.
        let doubled = self.min.saturating_mul(1 << paused.min(20));
        doubled.min(self.max)
    }
}

/// Rungs from mild to severe; the last is `Hold`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Vec<Rung>", into = "Vec<Rung>")]
pub struct Ladder(Vec<Rung>);

/// Most rungs of one ladder.
pub const RUNGS_MAX: usize = 16;

/// Why rungs are no ladder. The author of the file can mend it. Rungs count from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum LadderError {
    /// Nothing to try.
    #[error("a ladder has at least one rung")]
    Empty,
    /// Too much to try.
    #[error("{found} rungs; at most {RUNGS_MAX}")]
    TooLong {
        /// How many were given.
        found: usize,
    },
    /// Out of order.
    #[error("rung {rung} ({word}) is milder than the one before it")]
    Milder {
        /// Which one.
        rung: usize,
        /// Its word.
        word: &'static str,
    },
    /// The same rung again right behind itself.
    #[error("rung {rung} ({word}) is there twice")]
    Twice {
        /// Which one.
        rung: usize,
        /// Its word.
        word: &'static str,
    },
    /// It would never stop trying.
    #[error("the last rung is {word}; it must be hold")]
    LastNotHold {
        /// Its word.
        word: &'static str,
    },
    /// A pause that shrinks.
    #[error("rung {rung} (restart) has a backoff whose greatest pause is under its least")]
    Backoff {
        /// Which one.
        rung: usize,
    },
}

impl Ladder {
    /// A ladder of `rungs`.
    pub fn new(rungs: Vec<Rung>) -> Result<Self, LadderError> {
        if rungs.len() > RUNGS_MAX {
            return Err(LadderError::TooLong { found: rungs.len() });
        }
        for (index, pair) in rungs.windows(2).enumerate() {
            let (rung, word) = (index + 2, pair[1].word());
            match pair[1].severity().cmp(&pair[0].severity()) {
                core::cmp::Ordering::Less => return Err(LadderError::Milder { rung, word }),
                core::cmp::Ordering::Equal => return Err(LadderError::Twice { rung, word }),
                core::cmp::Ordering::Greater => {}
            }
        }
        for (index, rung) in rungs.iter().enumerate() {
            if let Rung::Restart(restart) = rung
                && restart.backoff.max < restart.backoff.min
            {
                return Err(LadderError::Backoff { rung: index + 1 });
            }
        }
        match rungs.last() {
            None => Err(LadderError::Empty),
            Some(Rung::Hold) => Ok(Self(rungs)),
            Some(last) => Err(LadderError::LastNotHold { word: last.word() }),
        }
    }

    /// From mild to severe.
    pub fn rungs(&self) -> &[Rung] {
        &self.0
    }
}

impl TryFrom<Vec<Rung>> for Ladder {
    type Error = LadderError;

    fn try_from(rungs: Vec<Rung>) -> Result<Self, LadderError> {
        Self::new(rungs)
    }
}

impl From<Ladder> for Vec<Rung> {
    fn from(ladder: Ladder) -> Self {
        ladder.0
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec;

    use super::*;

    #[test]
    fn a_ladder_climbs_and_ends_in_hold() {
        let restart = Rung::Restart(Restart::default());
        assert!(Ladder::new(vec![restart, Rung::LaunchElsewhere, Rung::Hold]).is_ok());
        assert_eq!(Ladder::new(vec![]), Err(LadderError::Empty));
        assert_eq!(
            Ladder::new(vec![Rung::LaunchElsewhere, restart, Rung::Hold]),
            Err(LadderError::Milder { rung: 2, word: "restart" })
        );
        assert_eq!(
            Ladder::new(vec![Rung::LaunchElsewhere]),
            Err(LadderError::LastNotHold { word: "launch-elsewhere" })
        );
        assert_eq!(
            Ladder::new(vec![Rung::Hold, Rung::Hold]),
            Err(LadderError::Twice { rung: 2, word: "hold" })
        );
    }

    #[test]
    fn pauses_double_up_to_their_bound() {
        let backoff = Restart::default().backoff;
        let pauses: Vec<u128> = (0..7).map(|tried| backoff.pause(tried).as_millis()).collect();
        assert_eq!(pauses, [0, 200, 400, 800, 1600, 3200, 5000]);
        assert_eq!(backoff.pause(u32::MAX), Duration::from_secs(5));
    }
}
