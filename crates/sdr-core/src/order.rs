//! Rules 1 and 2 of the order: epochs, runs, fence tokens, versions.

use core::fmt;

use serde::{Deserialize, Serialize};

use crate::id::RobotId;

/// One choice of a home for one component: (number, minting robot), compared in that order.
///
/// Number 0 means "never chosen". Robots compare by name, so equal numbers minted on two
/// sides of a split still have one order everywhere.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Epoch {
    /// Grows by at least one with each choice.
    pub number: u64,
    /// The robot that minted this number.
    pub minted_by: RobotId,
}

impl Epoch {
    /// The epoch that `robot` mints after this one.
    pub fn next(&self, robot: &RobotId) -> Self {
        Self { number: self.number.saturating_add(1), minted_by: robot.clone() }
    }

    /// The first epoch of a component, minted by `robot`.
    pub fn first(robot: &RobotId) -> Self {
        Self { number: 1, minted_by: robot.clone() }
    }
}

impl fmt::Display for Epoch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}@{}", self.number, self.minted_by)
    }
}

/// Counts activations within an epoch; only the home mints it. From 1.
pub type Run = u32;

/// What every sample carries: the epoch and run of the instance that made it.
///
/// The tokens that one consumer accepts never decrease.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Token {
    /// The choice of home under which the instance is active.
    pub epoch: Epoch,
    /// The activation within that epoch.
    pub run: Run,
}

impl fmt::Display for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.epoch, self.run)
    }
}

/// Orders two values of the same shared fact; the greater one stays.
///
/// One type serves all kinds, unused parts being zero or empty: an assignment uses all of
/// (epoch, revision, term, author), a deployment (revision, author), the role (term, author
/// = holder). Equal versions with different bytes are settled by the greater hash.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Version {
    /// The choice of home, for assignments.
    pub epoch: Option<Epoch>,
    /// Grows with each change that does not choose a new home.
    pub revision: u64,
    /// The coordinator's term under which the value was made.
    pub term: u64,
    /// The robot that made the value.
    pub author: RobotId,
}

/// FNV-1a, 64 bits: the hash used for digests and for settling equal versions.
///
/// Not for secrets. <https://www.rfc-editor.org/rfc/rfc9923>
pub fn hash64(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot(word: &str) -> RobotId {
        RobotId::new(word).unwrap()
    }

    #[test]
    fn a_new_home_outranks_any_run_revision_or_term_of_the_old_one() {
        let old = Epoch::first(&robot("robot-9"));
        let new = old.next(&robot("robot-1"));
        assert!(Token { epoch: new.clone(), run: 1 } > Token { epoch: old.clone(), run: 99 });

        let version = |epoch: &Epoch, revision, term| Version {
            epoch: Some(epoch.clone()),
            revision,
            term,
            author: robot("robot-1"),
        };
        assert!(version(&new, 0, 0) > version(&old, 7, 7));
        assert!(version(&old, 8, 0) > version(&old, 7, 7));
    }

    #[test]
    fn equal_numbers_from_two_sides_of_a_split_have_one_order() {
        let here = Epoch::first(&robot("robot-1"));
        let there = Epoch::first(&robot("robot-2"));
        assert!(there > here);
    }
}
