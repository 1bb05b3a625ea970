//! What a policy may say about trouble: rules, ladders, limits; checked once, at the door.

use alloc::{string::String, vec::Vec};
use core::time::Duration;

use sdr_core::{
    recover::{Cause, GuardPolicy},
    spec::PolicyBytes,
    units::Permille,
};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::{
    condition::{Bar, Condition},
    ladder::{Backoff, Ladder},
    table_iii,
};

/// First byte of an encoded policy; raised when fields change.
pub const POLICY_VERSION: u8 = 3;

/// Longest window over which samples are smoothed; it bounds what is kept.
pub const MEDIAN_OVER_MAX: Duration = Duration::from_secs(60);

/// A checked recovery policy.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "PolicyParts", into = "PolicyParts")]
pub struct Policy(PolicyParts);

/// The parts of a policy before they are checked.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PolicyParts {
    /// Its name, for reasons and reports.
    pub name: String,
    /// Ladders by name.
    pub ladders: Vec<(String, Ladder)>,
    /// What to watch, at most one rule for each cause. When several causes of one component
    /// stand at once, the one whose ladder begins with the most severe rung wins, then the
    /// earlier rule.
    pub rules: Vec<Rule>,
    /// Bounds over all rules.
    pub limits: Limits,
}

/// One row of the table: a cause, how it is seen, and what to climb.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rule {
    /// What is wrong.
    pub cause: Cause,
    /// How it is seen.
    pub trigger: Trigger,
    /// The ladder's name.
    pub ladder: String,
    /// Another ladder for what moves a body.
    pub actuator: Option<String>,
}

/// How a cause is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Trigger {
    /// It is reported as a fault: exit, hang, error state, robot gone.
    Fault,
    /// A fact crosses a bar for some time.
    Condition(Condition),
}

impl Rule {
    /// `cause`, reported as a fault, climbs `ladder`.
    pub fn on_fault(cause: Cause, ladder: &str) -> Self {
        Self { cause, trigger: Trigger::Fault, ladder: ladder.into(), actuator: None }
    }

    /// `cause`, seen by `condition`, climbs `ladder`.
    pub fn on_condition(cause: Cause, condition: Condition, ladder: &str) -> Self {
        let trigger = Trigger::Condition(condition);
        Self { cause, trigger, ladder: ladder.into(), actuator: None }
    }

    /// The same, but what moves a body climbs `ladder`.
    pub fn actuator(self, ladder: &str) -> Self {
        Self { actuator: Some(ladder.into()), ..self }
    }
}

/// Bounds over all rules.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Limits {
    /// Moves to another robot, per component within any hour.
    pub moves_per_hour: u16,
    /// Restarts and local switches, per component within any hour.
    pub restarts_per_hour: u16,
    /// Whether what moved away comes back.
    pub returns: Return,
    /// How long a component must not come back to a robot that it left for a cause.
    pub not_back_for: Duration,
    /// Quiet time that counts as healed, for rungs without their own.
    pub settle: Duration,
    /// Pause before a remedy that was refused is asked for again.
    pub retry: Backoff,
    /// Share of a condition's hold time after which another robot gets ready for what would
    /// leave; all of it: never before.
    pub prepare_after: Permille,
    /// How fast a standby on another robot follows a silent home.
    pub guard: GuardPolicy,
}

/// Whether what moved away comes back by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Return {
    /// Not by itself.
    Never,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            moves_per_hour: 6,
            restarts_per_hour: 10,
            returns: Return::Never,
            not_back_for: Duration::from_secs(120),
            settle: Duration::from_secs(10),
            retry: Backoff { min: Duration::from_secs(1), max: Duration::from_secs(30) },
            prepare_after: Permille(500),
            guard: GuardPolicy::default(),
        }
    }
}

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
    /// Two ladders of one name.
    #[error("ladder `{0}` is there twice")]
    LadderTwice(String),
    /// Two rules for one cause.
    #[error("cause {0} has two rules")]
    CauseTwice(Cause),
    /// A rule climbs a ladder that is not there.
    #[error("{cause} climbs `{ladder}`, which is no ladder of this policy")]
    UnknownLadder {
        /// The rule.
        cause: Cause,
        /// The name that it gives.
        ladder: String,
    },
    /// The bar is in another unit than the fact.
    #[error("{cause}: {fact} is {wanted}, found {found}")]
    Unit {
        /// The rule.
        cause: Cause,
        /// The fact.
        fact: &'static str,
        /// What it is measured in.
        wanted: &'static str,
        /// What was given.
        found: String,
    },
    /// The release level lies on the bad side of the bar.
    #[error("{cause}: clear at {clear} is inside the fault ({bar})")]
    ClearInside {
        /// The rule.
        cause: Cause,
        /// The release level.
        clear: String,
        /// The bar.
        bar: String,
    },
    /// A window that would keep too many samples.
    #[error("{cause}: median over {found_ms} ms; at most {} ms", MEDIAN_OVER_MAX.as_millis())]
    MedianTooLong {
        /// The rule.
        cause: Cause,
        /// What was given.
        found_ms: u64,
    },
    /// More than the whole hold time.
    #[error("limits: prepare_after is {} %; at most 100 %", .0.0 / 10)]
    PrepareAfter(Permille),
    /// The greatest pause is under the least.
    #[error("limits: the greatest pause of retry is under its least, or the least is zero")]
    Retry,
}

impl Policy {
    /// The policy of these parts, when they fit together.
    pub fn new(parts: PolicyParts) -> Result<Self, PolicyError> {
        for (index, (name, _)) in parts.ladders.iter().enumerate() {
            if parts.ladders[..index].iter().any(|(other, _)| other == name) {
                return Err(PolicyError::LadderTwice(name.clone()));
            }
        }
        for (index, rule) in parts.rules.iter().enumerate() {
            if parts.rules[..index].iter().any(|other| other.cause == rule.cause) {
                return Err(PolicyError::CauseTwice(rule.cause));
            }
            for ladder in core::iter::once(&rule.ladder).chain(&rule.actuator) {
                if !parts.ladders.iter().any(|(name, _)| name == ladder) {
                    let (cause, ladder) = (rule.cause, ladder.clone());
                    return Err(PolicyError::UnknownLadder { cause, ladder });
                }
            }
            match &rule.trigger {
                Trigger::Fault => {}
                Trigger::Condition(condition) => check_condition(rule.cause, condition)?,
            }
        }
        let retry = parts.limits.retry;
        if retry.min.is_zero() || retry.max < retry.min {
            return Err(PolicyError::Retry);
        }
        let share = parts.limits.prepare_after;
        if share.0 > 1000 {
            return Err(PolicyError::PrepareAfter(share));
        }
        Ok(Self(parts))
    }

    /// The policy in `policy`; empty bytes mean [`Policy::default`].
    pub fn decode(policy: &PolicyBytes) -> Result<Self, PolicyError> {
        let Some((version, rest)) = policy.bytes.split_first() else {
            return Ok(Self::default());
        };
        if *version != POLICY_VERSION {
            return Err(PolicyError::Version { found: *version });
        }
        let parts: PolicyParts = postcard::from_bytes(rest).map_err(|_| PolicyError::Unreadable)?;
        Self::new(parts)
    }

    /// The policy as systems carry it: a version byte, then postcard.
    pub fn encode(&self) -> PolicyBytes {
        let mut bytes = alloc::vec![POLICY_VERSION];
        bytes.extend(
            postcard::to_allocvec(&self.0).expect("writing plain data to memory cannot fail"),
        );
        PolicyBytes { name: self.0.name.clone(), bytes }
    }

    /// Its parts, to read or to make another policy from.
    pub fn parts(&self) -> &PolicyParts {
        &self.0
    }

    /// The ladder that a component climbs by `rule`.
    pub fn ladder(&self, rule: &Rule, actuator: bool) -> &Ladder {
        let name = rule.actuator.as_ref().filter(|_| actuator).unwrap_or(&rule.ladder);
        let found = self.0.ladders.iter().find(|(other, _)| other == name);
        &found.expect("a checked policy has the ladders that its rules name").1
    }
}

impl Default for Policy {
    /// The paper's Table III; `policies/recovery/default.yaml` says the same.
    fn default() -> Self {
        table_iii::policy()
    }
}

impl TryFrom<PolicyParts> for Policy {
    type Error = PolicyError;

    fn try_from(parts: PolicyParts) -> Result<Self, PolicyError> {
        Self::new(parts)
    }
}

impl From<Policy> for PolicyParts {
    fn from(policy: Policy) -> Self {
        policy.0
    }
}

fn check_condition(cause: Cause, condition: &Condition) -> Result<(), PolicyError> {
    let bar = condition.bar.level();
    let clear = condition.clear.map(|clear| clear.level);
    for level in core::iter::once(bar).chain(clear) {
        if level.unit() != condition.fact.unit() {
            return Err(PolicyError::Unit {
                cause,
                fact: condition.fact.word(),
                wanted: condition.fact.unit().example(),
                found: alloc::format!("{level}"),
            });
        }
    }
    if let Some(clear) = clear {
        let inside = match condition.bar {
            Bar::AtMost(_) => clear.raw() < bar.raw(),
            Bar::AtLeast(_) => clear.raw() > bar.raw(),
        };
        if inside {
            let (clear, bar) = (alloc::format!("{clear}"), alloc::format!("{bar}"));
            return Err(PolicyError::ClearInside { cause, clear, bar });
        }
    }
    if condition.median_over > MEDIAN_OVER_MAX {
        let found_ms = u64::try_from(condition.median_over.as_millis()).unwrap_or(u64::MAX);
        return Err(PolicyError::MedianTooLong { cause, found_ms });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use alloc::{format, vec};

    use sdr_core::units::{Bytes, Dbm};

    use super::*;
    use crate::{
        condition::{Fact, Level},
        ladder::Rung,
    };

    fn one_rule(rule: Rule) -> Result<Policy, PolicyError> {
        Policy::new(PolicyParts {
            name: "one".into(),
            ladders: vec![("stop".into(), Ladder::new(vec![Rung::Hold]).unwrap())],
            rules: vec![rule],
            limits: Limits::default(),
        })
    }

    fn rssi(bar: Level) -> Condition {
        Condition::new(Fact::RobotRssi, Bar::AtMost(bar), Duration::from_secs(6))
    }

    #[test]
    fn a_policy_survives_the_wire_and_fits_a_fleet_record() {
        let policy = Policy::default();
        let encoded = policy.encode();

        assert!(encoded.bytes.len() < 600, "{} bytes", encoded.bytes.len());
        assert_eq!(Policy::decode(&encoded), Ok(policy));
        assert_eq!(Policy::decode(&PolicyBytes::default()), Ok(Policy::default()));
    }

    #[test]
    fn broken_and_later_bytes_are_refused() {
        let mut bytes = Policy::default().encode();
        bytes.bytes[0] = 7;
        assert_eq!(Policy::decode(&bytes), Err(PolicyError::Version { found: 7 }));

        bytes.bytes[0] = POLICY_VERSION;
        bytes.bytes.truncate(40);
        assert_eq!(Policy::decode(&bytes), Err(PolicyError::Unreadable));
    }

    #[test]
    fn a_rule_needs_its_ladder_its_unit_and_a_release_outside_the_fault() {
        let lost = Rule::on_fault(Cause::Exited, "up");
        let text = format!("{}", one_rule(lost).unwrap_err());
        assert_eq!(text, "exited climbs `up`, which is no ladder of this policy");

        let size = rssi(Level::Memory(Bytes::mega(5)));
        let text =
            format!("{}", one_rule(Rule::on_condition(Cause::RssiLow, size, "stop")).unwrap_err());
        assert_eq!(text, "rssi-low: robot.rssi is a level such as -80dBm, found 5.0 MB");

        let level = |tenths| Level::Signal(Dbm::from_tenths(tenths));
        let inside = rssi(level(-525)).clear(level(-526), Duration::from_secs(1));
        let text = format!(
            "{}",
            one_rule(Rule::on_condition(Cause::RssiLow, inside, "stop")).unwrap_err()
        );
        assert_eq!(text, "rssi-low: clear at -52.6 dBm is inside the fault (-52.5 dBm)");
    }
}
