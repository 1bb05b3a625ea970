//! Why a policy may be none: what no single field can say.

use alloc::string::String;

use sdr_core::id::RobotId;
use thiserror::Error;

use super::{Bars, POLICY_VERSION, Policy, StartWith, Weight, Weights};

/// Why a policy is none. The author of the file can mend it; nothing was changed.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum PolicyError {
    /// Not bytes that [`Policy::encode`] made.
    #[error("the bytes of the policy cannot be read")]
    Unreadable,
    /// Made by a later version.
    #[error("policy version {found}; this agent reads up to {POLICY_VERSION}")]
    Version {
        /// The version found.
        found: u8,
    },
    /// A share over the whole.
    #[error("{key} is {found}; at most {bar}")]
    TooGreat {
        /// Which one.
        key: &'static str,
        /// What was given.
        found: String,
        /// What is allowed.
        bar: String,
    },
    /// The second tier wants more than the first.
    #[error("relaxed {key} is stricter than the first tier's")]
    RelaxedStricter {
        /// Which bar.
        key: &'static str,
    },
    /// A robot stands twice in the list.
    #[error("start_with names {0} twice")]
    RobotTwice(RobotId),
}

impl Policy {
    /// Checks what no single field can say; [`Policy::decode`] does so too.
    pub fn check(&self) -> Result<(), PolicyError> {
        check_bars(&self.strict)?;
        if let Some(relaxed) = &self.relaxed {
            check_bars(relaxed)?;
            check_tiers(&self.strict, relaxed)?;
        }
        let Weights { memory_left, cpu_left, battery, link_quality, nearness, stay } = self.weights;
        for weight in [memory_left, cpu_left, battery, link_quality, nearness, stay] {
            if weight > Weight::MAX {
                return Err(PolicyError::TooGreat {
                    key: "a weight",
                    found: alloc::format!("{}.{:03}", weight.0 / 1000, weight.0 % 1000),
                    bar: String::from("1000.0"),
                });
            }
        }
        match &self.start_with {
            StartWith::Receiver | StartWith::Nearest => Ok(()),
            StartWith::List(robots) => check_list(robots),
        }
    }
}

fn check_list(robots: &[RobotId]) -> Result<(), PolicyError> {
    for (index, robot) in robots.iter().enumerate() {
        if robots[..index].contains(robot) {
            return Err(PolicyError::RobotTwice(robot.clone()));
        }
    }
    Ok(())
}

fn check_bars(bars: &Bars) -> Result<(), PolicyError> {
    let shares = [
        ("cpu_used", bars.cpu_used_at_most),
        ("battery", bars.battery_at_least.map(|bar| bar.at_least)),
        ("loss", bars.loss_at_most),
    ];
    for (key, share) in shares {
        if let Some(share) = share.filter(|share| share.0 > 1000) {
            let (found, bar) = (alloc::format!("{share}"), String::from("100 %"));
            return Err(PolicyError::TooGreat { key, found, bar });
        }
    }
    Ok(())
}

/// A second tier that wants more than the first would never help, so it is a slip of the pen.
fn check_tiers(strict: &Bars, relaxed: &Bars) -> Result<(), PolicyError> {
    fn more<T: Ord>(relaxed: Option<T>, strict: Option<T>) -> bool {
        matches!((relaxed, strict), (Some(relaxed), Some(strict)) if relaxed > strict)
    }
    let battery = |bars: &Bars| bars.battery_at_least.map(|bar| bar.at_least);
    let slips = [
        ("cpu_used", more(strict.cpu_used_at_most, relaxed.cpu_used_at_most)),
        ("memory_free", more(relaxed.memory_free_at_least, strict.memory_free_at_least)),
        ("battery", more(battery(relaxed), battery(strict))),
        ("rssi", more(relaxed.rssi_at_least, strict.rssi_at_least)),
        ("jitter", more(strict.jitter_at_most, relaxed.jitter_at_most)),
        ("distance", more(strict.distance_at_most, relaxed.distance_at_most)),
        ("delay", more(strict.delay_at_most, relaxed.delay_at_most)),
        ("loss", more(strict.loss_at_most, relaxed.loss_at_most)),
    ];
    match slips.into_iter().find(|(_, slip)| *slip) {
        Some((key, _)) => Err(PolicyError::RelaxedStricter { key }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use sdr_core::units::{Bytes, Permille};

    use super::*;

    #[test]
    fn a_relaxed_bar_may_not_be_the_stricter_one() {
        let relaxed = Bars { memory_free_at_least: Some(Bytes::mega(201)), ..Bars::none() };
        let policy = Policy { relaxed: Some(relaxed), ..Policy::default() };

        assert_eq!(policy.check(), Err(PolicyError::RelaxedStricter { key: "memory_free" }));
    }

    #[test]
    fn a_share_over_the_whole_is_refused() {
        let mut policy = Policy::default();
        policy.strict.cpu_used_at_most = Some(Permille(1001));

        let text = alloc::format!("{}", policy.check().unwrap_err());

        assert_eq!(text, "cpu_used is 100.1 %; at most 100 %");
    }
}
