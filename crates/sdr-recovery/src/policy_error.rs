//! Whether the parts of a policy fit together.

use alloc::{
    format,
    string::{String, ToString},
};

use sdr_core::{
    recover::{Cause, HangLimit},
    units::Permille,
};
use thiserror::Error;

use crate::{
    condition::{Bar, Condition},
    level::Unit,
    policy::{
        EVERY_MIN, HANG_MIN, LADDERS_MAX, LOST_MIN, Limits, MEDIAN_OVER_MAX, PER_MAX, PolicyParts,
        RULES_MAX, Rule, Trigger,
    },
    wire::POLICY_VERSION,
};

/// Why a policy is none. The author of the file can mend it; nothing was changed.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum PolicyError {
    /// Not bytes that [`crate::Policy::encode`] made.
    #[error("the bytes of the policy cannot be read")]
    Unreadable,
    /// Made by a later version.
    #[error("policy version {found}; this agent reads version {POLICY_VERSION}")]
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
    /// Two exceptions for one component.
    #[error("component `{0}` has two exceptions")]
    ExceptionTwice(String),
    /// Too much to climb.
    #[error("{0} ladders; at most {LADDERS_MAX}")]
    TooManyLadders(usize),
    /// Too much to watch.
    #[error("{0} rules for one component; at most {RULES_MAX}")]
    TooManyRules(usize),
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
    /// A time that cannot be kept, or makes no sense.
    #[error("{cause}: {what}")]
    Time {
        /// The rule.
        cause: Cause,
        /// What was found and what is allowed.
        what: String,
    },
    /// A trigger that belongs to another cause.
    #[error("{cause} is not seen that way")]
    Trigger {
        /// The rule.
        cause: Cause,
    },
    /// More than the whole hold time.
    #[error("limits: prepare_after is {} %; at most 100 %", .0.0 / 10)]
    PrepareAfter(Permille),
    /// The greatest pause is under the least.
    #[error("limits: the greatest pause of retry is under its least, or the least is zero")]
    Retry,
}

pub(crate) fn check(parts: &PolicyParts) -> Result<(), PolicyError> {
    if parts.ladders.len() > LADDERS_MAX {
        return Err(PolicyError::TooManyLadders(parts.ladders.len()));
    }
    for (index, (name, _)) in parts.ladders.iter().enumerate() {
        if parts.ladders[..index].iter().any(|(other, _)| other == name) {
            return Err(PolicyError::LadderTwice(name.clone()));
        }
    }
    check_rules(&parts.rules, parts)?;
    check_limits(&parts.limits)?;
    for (index, exception) in parts.exceptions.iter().enumerate() {
        if parts.exceptions[..index].iter().any(|other| other.component == exception.component) {
            return Err(PolicyError::ExceptionTwice(exception.component.clone()));
        }
        check_rules(&exception.rules, parts)?;
        if parts.rules.len() + exception.rules.len() > RULES_MAX {
            return Err(PolicyError::TooManyRules(parts.rules.len() + exception.rules.len()));
        }
        exception.limits.as_ref().map_or(Ok(()), check_limits)?;
    }
    Ok(())
}

fn check_rules(rules: &[Rule], parts: &PolicyParts) -> Result<(), PolicyError> {
    if rules.len() > RULES_MAX {
        return Err(PolicyError::TooManyRules(rules.len()));
    }
    for (index, rule) in rules.iter().enumerate() {
        if rules[..index].iter().any(|other| other.cause == rule.cause) {
            return Err(PolicyError::CauseTwice(rule.cause));
        }
        for ladder in core::iter::once(&rule.ladder).chain(&rule.actuator) {
            if !parts.ladders.iter().any(|(name, _)| name == ladder) {
                let (cause, ladder) = (rule.cause, ladder.clone());
                return Err(PolicyError::UnknownLadder { cause, ladder });
            }
        }
        check_trigger(rule)?;
    }
    Ok(())
}

fn check_trigger(rule: &Rule) -> Result<(), PolicyError> {
    let cause = rule.cause;
    let wants = |fits: bool, what: String| {
        if fits { Ok(()) } else { Err(PolicyError::Time { cause, what }) }
    };
    let belongs = |fits: bool| if fits { Ok(()) } else { Err(PolicyError::Trigger { cause }) };
    match &rule.trigger {
        Trigger::Fault => {}
        Trigger::Silent(limit) => {
            belongs(cause == Cause::Hung)?;
            match limit {
                HangLimit::Periods(periods) => {
                    wants(*periods > 0, String::from("0 periods; at least 1"))?;
                }
                HangLimit::Time(time) => {
                    wants(*time >= HANG_MIN, format!("{time:?}; at least {HANG_MIN:?}"))?;
                }
            }
        }
        Trigger::Lost(time) => {
            belongs(cause == Cause::RobotGone)?;
            wants(*time >= LOST_MIN, format!("lost after {time:?}; at least {LOST_MIN:?}"))?;
        }
        Trigger::Expression(..) => belongs(matches!(cause, Cause::Own(_)))?,
        Trigger::Program(program, _) => {
            belongs(matches!(cause, Cause::Own(_)) && !program.command.is_empty())?;
            let (every, limit) = (program.every, program.limit);
            wants(every >= EVERY_MIN, format!("every {every:?}; at least {EVERY_MIN:?}"))?;
            wants(!limit.is_zero(), String::from("a limit of nothing"))?;
        }
        Trigger::Condition(_) => {}
    }
    rule.trigger.condition().map_or(Ok(()), |condition| check_condition(cause, &condition))
}

fn check_limits(limits: &Limits) -> Result<(), PolicyError> {
    let retry = limits.retry;
    if retry.min.is_zero() || retry.max < retry.min {
        return Err(PolicyError::Retry);
    }
    if limits.prepare_after.0 > 1000 {
        return Err(PolicyError::PrepareAfter(limits.prepare_after));
    }
    Ok(())
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
                found: level.to_string(),
            });
        }
    }
    if let Some(clear) = clear {
        let inside = match condition.bar {
            Bar::AtMost(_) => clear.raw() < bar.raw(),
            Bar::AtLeast(_) => clear.raw() > bar.raw(),
        };
        if inside {
            let (clear, bar) = (clear.to_string(), bar.to_string());
            return Err(PolicyError::ClearInside { cause, clear, bar });
        }
    }
    if condition.median_over > MEDIAN_OVER_MAX {
        let found_ms = u64::try_from(condition.median_over.as_millis()).unwrap_or(u64::MAX);
        return Err(PolicyError::MedianTooLong { cause, found_ms });
    }
    let per = condition.per;
    let is_rate = condition.fact.unit() == Unit::Rate;
    if is_rate && (per.is_zero() || per > PER_MAX || bar.raw() < 1) {
        let what = format!("{bar} per {per:?}; at least 1, per at most {PER_MAX:?}");
        return Err(PolicyError::Time { cause, what });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use alloc::{vec, vec::Vec};
    use core::time::Duration;

    use sdr_core::units::{Bytes, Dbm};

    use super::*;
    use crate::{
        fact::Fact,
        ladder::{Ladder, Rung},
        level::Level,
        policy::{Exception, Policy},
    };

    fn parts(rules: Vec<Rule>) -> PolicyParts {
        PolicyParts {
            name: "one".into(),
            ladders: vec![("stop".into(), Ladder::new(vec![Rung::Hold]).unwrap())],
            rules,
            limits: Limits::default(),
            exceptions: vec![],
        }
    }

    fn refusal(rule: Rule) -> String {
        Policy::new(parts(vec![rule])).unwrap_err().to_string()
    }

    fn rssi(bar: Level) -> Condition {
        Condition::new(Fact::RobotRssi, Bar::AtMost(bar), Duration::from_secs(6))
    }

    #[test]
    fn a_rule_needs_its_ladder_its_unit_and_a_release_outside_the_fault() {
        let lost = Rule::on_fault(Cause::Exited, "up");
        assert_eq!(refusal(lost), "exited climbs `up`, which is no ladder of this policy");

        let size = rssi(Level::Memory(Bytes::mega(5)));
        let text = refusal(Rule::on_condition(Cause::RssiLow, size, "stop"));
        assert_eq!(text, "rssi-low: robot.rssi is a level such as -80dBm, found 5.0 MB");

        let level = |tenths| Level::Signal(Dbm::from_tenths(tenths));
        let inside = rssi(level(-525)).clear(level(-526), Duration::from_secs(1));
        let text = refusal(Rule::on_condition(Cause::RssiLow, inside, "stop"));
        assert_eq!(text, "rssi-low: clear at -52.6 dBm is inside the fault (-52.5 dBm)");
    }

    #[test]
    fn a_rate_needs_a_number_and_a_time_that_can_be_kept() {
        let rate = |count, per| {
            let rate = Condition::rate(Fact::ComponentExits, count, Duration::from_secs(per));
            let cause = Cause::from_word("crash-loop").unwrap();
            Policy::new(parts(vec![Rule::on_condition(cause, rate, "stop")]))
        };
        assert!(rate(3, 60).is_ok() && rate(1, 3600).is_ok());
        for (count, per) in [(0, 60), (3, 0), (3, 3601)] {
            assert!(rate(count, per).is_err(), "{count} per {per} s");
        }
    }

    #[test]
    fn silence_belongs_to_hangs_and_to_robots_and_is_not_too_short() {
        let silent = |cause, trigger| {
            let rule = Rule { trigger, ..Rule::on_fault(cause, "stop") };
            Policy::new(parts(vec![rule])).is_ok()
        };
        let millis = Duration::from_millis;
        assert!(silent(Cause::Hung, Trigger::Silent(HangLimit::Periods(5))));
        assert!(silent(Cause::Hung, Trigger::Silent(HangLimit::Time(millis(300)))));
        assert!(silent(Cause::RobotGone, Trigger::Lost(millis(1000))));
        assert!(!silent(Cause::Hung, Trigger::Silent(HangLimit::Time(millis(299)))));
        assert!(!silent(Cause::Exited, Trigger::Silent(HangLimit::Periods(5))));
        assert!(!silent(Cause::Hung, Trigger::Lost(millis(1000))));
        assert!(!silent(Cause::RobotGone, Trigger::Lost(millis(10))));
    }

    #[test]
    fn an_exception_is_checked_like_the_rest() {
        let exception = |component: &str, ladder: &str| Exception {
            component: component.into(),
            rules: vec![Rule::on_fault(Cause::Exited, ladder)],
            without: vec![],
            limits: None,
        };
        let with = |exceptions| Policy::new(PolicyParts { exceptions, ..parts(vec![]) });
        assert!(with(vec![exception("camera", "stop"), exception("eye", "stop")]).is_ok());
        assert!(with(vec![exception("camera", "up")]).is_err());
        assert!(with(vec![exception("camera", "stop"), exception("camera", "stop")]).is_err());
    }
}
