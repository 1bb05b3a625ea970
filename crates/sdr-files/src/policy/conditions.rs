//! How a rule sees its cause: as it is reported, or a fact, a bar, a time.

use std::time::Duration;

use sdr_core::recover::{Cause, HangLimit};
use sdr_recovery::{
    Condition, Expression, Fact, HANG_MIN, LOST_MIN, MEDIAN_OVER_MAX, Trigger, Unit,
};

use super::{
    bar::{bar, check_outside, clear, release_time},
    condition_words::{CpuOf, HoldTime},
    recovery_file::RuleChanges,
};
use crate::{
    problem::Mark,
    read::{At, Reader},
};

/// How `cause` is seen after `changes`; `before` is how it was seen, for changed rules.
pub(super) fn trigger(
    cause: At<Cause>,
    changes: &RuleChanges,
    before: Option<&Trigger>,
    reader: &mut Reader,
) -> Option<Trigger> {
    refuse_strays(cause.value, changes, reader);
    if let Some(source) = &changes.when {
        return expression(&cause, source, changes, before, reader);
    }
    match (usual_fact(cause.value), before) {
        (Some(usual), before) => {
            let fact = fact(cause.value, usual, changes, before, reader);
            measured(&cause, fact, changes, before, reader)
        }
        (None, _) => reported(cause, changes, before, reader),
    }
}

/// The fact by which `cause` is seen unless a rule says otherwise; `None` for causes that are
/// reported, and for own ones.
fn usual_fact(cause: Cause) -> Option<Fact> {
    match cause {
        Cause::MemoryShort => Some(Fact::RobotMemoryFree),
        Cause::ComponentCpuHigh => Some(Fact::ComponentCpuOfLimit),
        Cause::BatteryLow => Some(Fact::RobotBattery),
        Cause::RobotCpuHigh => Some(Fact::RobotCpu),
        Cause::RssiLow => Some(Fact::RobotRssi),
        Cause::DelayHigh => Some(Fact::LinksDelay),
        Cause::JitterHigh => Some(Fact::LinksJitter),
        Cause::LossHigh => Some(Fact::LinksLoss),
        Cause::DeadlineMissed => Some(Fact::DeadlineMisses),
        Cause::Exited
        | Cause::Hung
        | Cause::Error
        | Cause::HardwareLost
        | Cause::AbnormalBehaviour
        | Cause::EmergencyStop
        | Cause::RobotGone
        | Cause::Own(_) => None,
    }
}

/// Causes that are events, own ones of a fact, and silences.
fn reported(
    cause: At<Cause>,
    changes: &RuleChanges,
    before: Option<&Trigger>,
    reader: &mut Reader,
) -> Option<Trigger> {
    match cause.value {
        Cause::Own(_) => {
            let own = changes.fact.as_ref().and_then(|word| own_fact(word, changes, reader));
            let known = before.and_then(Trigger::condition);
            match (own, before) {
                (Some(fact), _) => return measured(&cause, fact, changes, before, reader),
                (None, Some(Trigger::Condition(condition))) => {
                    return measured(&cause, condition.fact, changes, before, reader);
                }
                (None, Some(Trigger::Expression(..) | Trigger::Program(..))) => {
                    let told = told(changes, known, reader)?;
                    return before.map(|before| with_condition(before, told));
                }
                (None, Some(Trigger::Fault | Trigger::Silent(_) | Trigger::Lost(_)) | None) => {}
            }
            if changes.fact.is_some() {
                return None;
            }
        }
        Cause::Hung => {
            if let Some(time) = &changes.r#for {
                let others = RuleChanges { r#for: None, ..changes.clone() };
                refuse_condition(cause.value, &others, reader);
                return hang_limit(time, reader).map(Trigger::Silent);
            }
        }
        Cause::RobotGone => {
            if let Some(time) = &changes.lost_after {
                refuse_condition(cause.value, changes, reader);
                check_least(time.value, LOST_MIN, time.mark, reader);
                return Some(Trigger::Lost(time.value));
            }
        }
        Cause::MemoryShort
        | Cause::ComponentCpuHigh
        | Cause::Exited
        | Cause::Error
        | Cause::HardwareLost
        | Cause::AbnormalBehaviour
        | Cause::EmergencyStop
        | Cause::BatteryLow
        | Cause::RobotCpuHigh
        | Cause::RssiLow
        | Cause::DelayHigh
        | Cause::JitterHigh
        | Cause::LossHigh
        | Cause::DeadlineMissed => {}
    }
    refuse_condition(cause.value, changes, reader);
    Some(before.cloned().unwrap_or(Trigger::Fault))
}

fn with_condition(before: &Trigger, condition: Condition) -> Trigger {
    match before.clone() {
        Trigger::Expression(expression, _) => Trigger::Expression(expression, condition),
        Trigger::Program(program, _) => Trigger::Program(program, condition),
        Trigger::Condition(_) => Trigger::Condition(condition),
        other @ (Trigger::Fault | Trigger::Silent(_) | Trigger::Lost(_)) => other,
    }
}

fn hang_limit(time: &At<HoldTime>, reader: &mut Reader) -> Option<HangLimit> {
    match time.value {
        HoldTime::Periods(periods) => Some(HangLimit::Periods(periods)),
        HoldTime::Time(limit) => {
            check_least(limit, HANG_MIN, time.mark, reader);
            Some(HangLimit::Time(limit))
        }
    }
}

fn check_least(found: Duration, least: Duration, mark: Mark, reader: &mut Reader) {
    if found < least {
        let help = format!("allowed: {least:?} or more");
        reader.problem(mark, format!("a silence of {found:?} is no sign of anything"), Some(help));
    }
}

/// A fact over time.
fn measured(
    cause: &At<Cause>,
    fact: Fact,
    changes: &RuleChanges,
    before: Option<&Trigger>,
    reader: &mut Reader,
) -> Option<Trigger> {
    let before = before.and_then(Trigger::condition).filter(|one| one.fact.unit() == fact.unit());
    let (bar, per) = bar(cause, fact, changes, before, reader)?;
    let hold = match &changes.r#for {
        Some(time) => Some(plain_time(time, reader)?),
        None => None,
    };
    let clear = match &changes.clear {
        Some(given) => Some(clear(given, fact, bar, per, reader)?),
        None => before.and_then(|before| before.clear),
    };
    let mut condition = Condition::new(fact, bar, Duration::ZERO);
    condition.hold = hold.or(before.map(|before| before.hold)).unwrap_or_default();
    condition.clear = clear;
    condition.per = per;
    if let Some(before) = before {
        condition.median_over = before.median_over;
        condition.over = before.over;
    }
    if let Some(over) = &changes.over {
        condition.over = over.value;
    }
    if let Some(window) = &changes.median_over {
        if window.value > MEDIAN_OVER_MAX {
            let message = format!("median over {:?}", window.value);
            let help = format!("allowed: 0s to {MEDIAN_OVER_MAX:?}");
            reader.problem(window.mark, message, Some(help));
        }
        condition.median_over = window.value;
    }
    if changes.clear.is_none()
        && let Some(clear) = condition.clear
    {
        check_outside(clear.level, bar, cause.mark, reader);
    }
    Some(Trigger::Condition(condition))
}

fn plain_time(time: &At<HoldTime>, reader: &mut Reader) -> Option<Duration> {
    match time.value {
        HoldTime::Time(time) => Some(time),
        HoldTime::Periods(_) => {
            let help = String::from("allowed: a time such as 5s; periods count for `hung`");
            reader.problem(time.mark, "only hangs are counted in periods", Some(help));
            None
        }
    }
}

/// What an expression or a program says, over time.
pub(super) fn told(
    changes: &RuleChanges,
    before: Option<Condition>,
    reader: &mut Reader,
) -> Option<Condition> {
    let hold = match &changes.r#for {
        Some(time) => plain_time(time, reader)?,
        None => before.map(|before| before.hold).unwrap_or_default(),
    };
    let clear = match &changes.clear {
        Some(given) => release_time(given, reader)?,
        None => before.and_then(|before| before.clear).map(|clear| clear.hold).unwrap_or_default(),
    };
    Some(Condition::told(hold, clear))
}

fn expression(
    cause: &At<Cause>,
    source: &At<String>,
    changes: &RuleChanges,
    before: Option<&Trigger>,
    reader: &mut Reader,
) -> Option<Trigger> {
    if !matches!(cause.value, Cause::Own(_)) {
        let message = format!("{} is not seen by an expression", cause.value);
        let help = String::from("allowed: a cause with a name of your own, such as `too-warm`");
        reader.problem(source.mark, message, Some(help));
        return None;
    }
    let bars = [&changes.at_most, &changes.at_least].into_iter().flatten().map(|at| at.mark);
    for mark in changes.fact.iter().map(|at| at.mark).chain(bars) {
        let help = String::from("allowed: one of them");
        reader.problem(mark, "a fact with a bar, and `when`", Some(help));
    }
    let condition = told(changes, before.and_then(Trigger::condition), reader);
    match Expression::new(&source.value) {
        Ok(expression) => condition.map(|told| Trigger::Expression(expression, told)),
        Err(error) => {
            let (mark, place) = reader.within(source.mark, &source.value, (error.at, error.width));
            let message = format!("{}{place}", error.message);
            reader.problem(mark, message, Some(format!("allowed: {}", error.help)));
            None
        }
    }
}

/// A fault is reported, not measured.
fn refuse_condition(cause: Cause, changes: &RuleChanges, reader: &mut Reader) {
    let marks = [
        changes.fact.as_ref().map(|at| at.mark),
        changes.at_most.as_ref().map(|at| at.mark),
        changes.at_least.as_ref().map(|at| at.mark),
        changes.r#for.as_ref().map(|at| at.mark),
        changes.clear.as_ref().map(|at| at.mark),
        changes.of.as_ref().map(|at| at.mark),
        changes.over.as_ref().map(|at| at.mark),
        changes.median_over.as_ref().map(|at| at.mark),
    ];
    let (message, help) = if matches!(cause, Cause::Own(_)) {
        (
            format!("{cause} without `fact` or `when` is reported by a component"),
            "ladder, actuator, or a fact with a bar, or `when`",
        )
    } else {
        (
            format!("{cause} is reported as it happens, not measured over time"),
            "ladder, actuator; how often it happens is a cause of your own, such as `cause: crash-loop` with `fact: component.exits` and `at_least: 3 per 1min`",
        )
    };
    for mark in marks.into_iter().flatten() {
        reader.problem(mark, message.clone(), Some(format!("allowed: {help}")));
    }
}

/// Keys that say something about one cause only.
fn refuse_strays(cause: Cause, changes: &RuleChanges, reader: &mut Reader) {
    if let Some(lost) = &changes.lost_after
        && cause != Cause::RobotGone
    {
        let message = format!("`lost_after` says nothing about {cause}");
        reader.problem(lost.mark, message, Some(String::from("allowed for robot-gone")));
    }
}

/// The fact of a known cause, after `changes`.
fn fact(
    cause: Cause,
    usual: Fact,
    changes: &RuleChanges,
    before: Option<&Trigger>,
    reader: &mut Reader,
) -> Fact {
    if let Some(fact) = &changes.fact
        && fact.value != usual.word()
    {
        let message = format!("{cause} is not seen by `{}`", fact.value);
        let help = format!("allowed: {}; a cause of your own may look at any fact", usual.word());
        reader.problem(fact.mark, message, Some(help));
    }
    check_links(usual, changes, reader);
    let before = before.and_then(Trigger::condition).map(|before| before.fact);
    of_core(usual, changes, reader).or(before).unwrap_or(usual)
}

fn own_fact(word: &At<String>, changes: &RuleChanges, reader: &mut Reader) -> Option<Fact> {
    let Some(fact) = Fact::ALL.into_iter().find(|fact| fact.word() == word.value) else {
        let mut words = Fact::ALL.map(Fact::word).to_vec();
        words.dedup();
        reader.unknown(word.mark, "fact", &word.value, &words);
        return None;
    };
    check_links(fact, changes, reader);
    Some(of_core(fact, changes, reader).unwrap_or(fact))
}

/// What `of` makes of the CPU of a component.
fn of_core(fact: Fact, changes: &RuleChanges, reader: &mut Reader) -> Option<Fact> {
    let of = changes.of.as_ref()?;
    if fact.word() != Fact::ComponentCpuOfCore.word() {
        let message = format!("`of` says nothing about {}", fact.word());
        reader.problem(of.mark, message, Some(String::from("allowed for component.cpu")));
    }
    Some(match of.value {
        CpuOf::Core => Fact::ComponentCpuOfCore,
        CpuOf::Limit => Fact::ComponentCpuOfLimit,
    })
}

fn check_links(fact: Fact, changes: &RuleChanges, reader: &mut Reader) {
    let of_links = matches!(fact, Fact::LinksDelay | Fact::LinksJitter | Fact::LinksLoss);
    if let Some(over) = changes.over.as_ref().filter(|_| !of_links) {
        let message = format!("`over` says nothing about {}", fact.word());
        reader.problem(over.mark, message, Some(String::from("allowed for facts of links")));
    }
    let counted = fact.unit() == Unit::Rate;
    if let Some(window) = changes.median_over.as_ref().filter(|_| counted) {
        let message = format!("{} is counted, not smoothed", fact.word());
        reader.problem(window.mark, message, Some(String::from("take it out")));
    }
}
