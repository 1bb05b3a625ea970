//! What a policy may say about trouble: rules, ladders, limits; checked once, at the door.

use alloc::{string::String, vec::Vec};
use core::time::Duration;

use sdr_core::{
    recover::{Cause, GuardPolicy, HangLimit, Program},
    units::Permille,
};
use serde::{Deserialize, Serialize};

use crate::{
    condition::Condition,
    expression::Expression,
    ladder::{Backoff, Ladder},
    policy_error::{PolicyError, check},
    table_iii,
};

/// Longest window over which samples are smoothed; it bounds what is kept.
pub const MEDIAN_OVER_MAX: Duration = Duration::from_secs(60);
/// Longest time in which is counted.
pub const PER_MAX: Duration = Duration::from_secs(3600);
/// Most ladders of a policy.
pub const LADDERS_MAX: usize = 32;
/// Most rules for one component.
pub const RULES_MAX: usize = 64;
/// The least silence of an execution thread that can be told from a busy machine.
pub const HANG_MIN: Duration = Duration::from_millis(300);
/// The least silence of a robot that can be told from a lossy link.
pub const LOST_MIN: Duration = Duration::from_millis(300);
/// The least time between two runs of a program.
pub const EVERY_MIN: Duration = Duration::from_millis(200);

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
    /// What differs for single components.
    pub exceptions: Vec<Exception>,
}

/// What differs for one component.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Exception {
    /// Its name within the system.
    pub component: String,
    /// Rules that it has instead of those of the same cause, or besides.
    pub rules: Vec<Rule>,
    /// Causes for which it has no rule.
    pub without: Vec<Cause>,
    /// Its own bounds.
    pub limits: Option<Limits>,
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
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Trigger {
    /// It is reported as a fault: exit, hang, error state, robot gone.
    Fault,
    /// A fact crosses a bar for some time.
    Condition(Condition),
    /// The execution thread is silent for longer than this; for [`Cause::Hung`].
    Silent(HangLimit),
    /// Its robot is silent for longer than this; for [`Cause::RobotGone`].
    Lost(Duration),
    /// An expression is true for some time.
    Expression(Expression, Condition),
    /// A program says so for some time.
    Program(Program, Condition),
}

impl Trigger {
    /// What is watched over time; `None` for what is reported as it happens.
    pub fn condition(&self) -> Option<Condition> {
        match self {
            Self::Fault | Self::Silent(_) | Self::Lost(_) => None,
            Self::Condition(condition)
            | Self::Expression(_, condition)
            | Self::Program(_, condition) => Some(*condition),
        }
    }
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

    /// Whether the fault lies with the robot or its links: then other robots are asked for
    /// ever.
    pub fn is_of_robot(&self) -> bool {
        match &self.trigger {
            Trigger::Fault | Trigger::Lost(_) => self.cause == Cause::RobotGone,
            Trigger::Silent(_) | Trigger::Program(..) => false,
            Trigger::Condition(condition) => condition.fact.is_of_robot(),
            Trigger::Expression(expression, _) => expression.is_of_robot(),
        }
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

impl Policy {
    /// The policy of these parts, when they fit together.
    pub fn new(parts: PolicyParts) -> Result<Self, PolicyError> {
        check(&parts)?;
        Ok(Self(parts))
    }

    /// The rules and bounds of one component, without exceptions.
    pub fn for_component(&self, component: &str) -> Self {
        let mut parts = self.0.clone();
        for exception in core::mem::take(&mut parts.exceptions) {
            if exception.component != component {
                continue;
            }
            parts.rules.retain(|rule| !exception.without.contains(&rule.cause));
            for rule in exception.rules {
                match parts.rules.iter_mut().find(|other| other.cause == rule.cause) {
                    Some(other) => *other = rule,
                    None => parts.rules.push(rule),
                }
            }
            parts.limits = exception.limits.unwrap_or(parts.limits);
        }
        // Every part of it was checked with the whole.
        Self(parts)
    }

    /// The same, and `component` has the rules and bounds of `own`.
    pub fn with_exception(&self, component: &str, own: &Self) -> Result<Self, PolicyError> {
        let mut parts = self.0.clone();
        // A ladder of the same name that is another one needs another name.
        let mut names: Vec<(&String, String)> = Vec::new();
        for (name, ladder) in &own.0.ladders {
            let known = parts.ladders.iter().find(|(other, _)| other == name);
            let renamed = match known {
                Some((_, other)) if other == ladder => name.clone(),
                Some(_) => alloc::format!("{name} of {component}"),
                None => name.clone(),
            };
            let is_climbed = own
                .0
                .rules
                .iter()
                .any(|rule| rule.ladder == *name || rule.actuator.as_ref() == Some(name));
            if is_climbed && !parts.ladders.iter().any(|(other, _)| *other == renamed) {
                parts.ladders.push((renamed.clone(), ladder.clone()));
            }
            names.push((name, renamed));
        }
        let renamed = |name: &String| {
            let found = names.iter().find(|(other, _)| *other == name);
            found.map_or_else(|| name.clone(), |(_, renamed)| renamed.clone())
        };
        let rules = own.0.rules.iter().map(|rule| Rule {
            ladder: renamed(&rule.ladder),
            actuator: rule.actuator.as_ref().map(renamed),
            ..rule.clone()
        });
        let has = |cause: Cause| own.0.rules.iter().any(|rule| rule.cause == cause);
        parts.exceptions.push(Exception {
            component: component.into(),
            rules: rules.filter(|rule| !self.0.rules.contains(rule)).collect(),
            without: self.0.rules.iter().map(|one| one.cause).filter(|one| !has(*one)).collect(),
            limits: (own.0.limits != self.0.limits).then_some(own.0.limits),
        });
        Self::new(parts)
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
