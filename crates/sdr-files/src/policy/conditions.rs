//! How a rule sees its cause: a fact, a bar, a time.

use std::time::Duration;

use schemars::{Schema, SchemaGenerator, json_schema};
use sdr_core::recover::Cause;
use sdr_recovery::{Bar, Clear, Condition, Fact, Level, MEDIAN_OVER_MAX, Trigger, Unit};

use super::recovery_file::RuleChanges;
use crate::{
    problem::Mark,
    read::{At, Read, Reader, choices},
    tree::{Body, Node},
    units::{self, UnitError},
};

/// A level whose unit depends on the fact.
#[derive(Clone, Debug)]
pub(crate) struct LevelText(pub(crate) String);

impl Read for LevelText {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        match &node.body {
            Body::Text(text) => Some(Self(text.clone())),
            Body::Int(number) => Some(Self(number.to_string())),
            Body::Float(number) => Some(Self(number.to_string())),
            Body::Nothing | Body::Bool(_) | Body::List(_) | Body::Table(_) => {
                reader.wrong(node, "a level such as 200MB, 95%, -80dBm or 200ms");
                None
            }
        }
    }

    fn schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "pattern": "^-?[0-9]" })
    }
}

/// `200MB for 5s`: a level and a time.
#[derive(Clone, Debug)]
pub(crate) struct ClearText {
    level: String,
    hold: Duration,
}

impl Read for ClearText {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        let LevelText(text) = LevelText::read(node, reader)?;
        let Some((level, hold)) = text.split_once(" for ") else {
            return Some(Self { level: text, hold: Duration::ZERO });
        };
        match units::duration(hold.trim()) {
            Ok(hold) => Some(Self { level: level.trim().to_owned(), hold }),
            Err(error) => {
                let help = String::from("allowed: a level and a time such as 200MB for 5s");
                reader.problem(node.mark, error.to_string(), Some(help));
                None
            }
        }
    }

    fn schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "pattern": "^-?[0-9][^ ]*( for [0-9].*)?$" })
    }
}

/// A time; counting periods comes later.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HoldTime(Duration);

impl Read for HoldTime {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        if let Body::Text(text) = &node.body
            && text.ends_with(" periods")
        {
            reader.later(node.mark, "periods", "counting a component's periods");
            return None;
        }
        Duration::read(node, reader).map(Self)
    }

    fn schema(generator: &mut SchemaGenerator) -> Schema {
        Duration::schema(generator)
    }
}

/// What a component's CPU is compared to.
#[derive(Clone, Copy, Debug)]
pub(crate) enum CpuOf {
    Limit,
    Core,
}

/// The word `median`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Median;

choices! {
    CpuOf { "limit" => Self::Limit, "core" => Self::Core, }
}

impl Read for Median {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        let later = [("worst", "the worst link"), ("best", "the best link")];
        reader.choice(node, &["median"], &later).map(|_| Self)
    }

    fn schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "const": "median" })
    }
}

/// The fact by which `cause` is seen; `None` for causes that are reported as faults.
fn fact_of(cause: Cause) -> Option<Fact> {
    match cause {
        Cause::MemoryShort => Some(Fact::RobotMemoryFree),
        Cause::ComponentCpuHigh => Some(Fact::ComponentCpuOfLimit),
        Cause::BatteryLow => Some(Fact::RobotBattery),
        Cause::RobotCpuHigh => Some(Fact::RobotCpu),
        Cause::RssiLow => Some(Fact::RobotRssi),
        Cause::DelayHigh => Some(Fact::LinksDelay),
        Cause::JitterHigh => Some(Fact::LinksJitter),
        Cause::LossHigh => Some(Fact::LinksLoss),
        Cause::Exited
        | Cause::Hung
        | Cause::Error
        | Cause::HardwareLost
        | Cause::AbnormalBehaviour
        | Cause::EmergencyStop
        | Cause::RobotGone => None,
    }
}

/// How `cause` is seen after `changes`; `before` is how it was seen, for changed rules.
pub(super) fn trigger(
    cause: At<Cause>,
    changes: &RuleChanges,
    before: Option<Trigger>,
    reader: &mut Reader,
) -> Option<Trigger> {
    let Some(usual) = fact_of(cause.value) else {
        refuse_condition(cause.value, changes, reader);
        return Some(Trigger::Fault);
    };
    check_fact(cause.value, usual, changes, reader);
    let before = match before {
        Some(Trigger::Condition(condition)) => Some(condition),
        Some(Trigger::Fault) | None => None,
    };
    let fact = match (changes.of.as_ref().map(|of| of.value), before) {
        (Some(CpuOf::Core), _) => Fact::ComponentCpuOfCore,
        (Some(CpuOf::Limit), _) | (None, None) => usual,
        (None, Some(before)) => before.fact,
    };
    let bar = bar(&cause, fact, changes, before, reader)?;
    let hold = changes.r#for.as_ref().map(|hold| hold.value.0);
    let clear = match &changes.clear {
        Some(clear) => Some(self::clear(clear, fact, bar, reader)?),
        None => before.and_then(|before| before.clear),
    };
    let mut condition = Condition::new(fact, bar, Duration::ZERO);
    condition.hold = hold.or(before.map(|before| before.hold)).unwrap_or_default();
    condition.clear = clear;
    if let Some(before) = before {
        condition.median_over = before.median_over;
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
    for mark in marks.into_iter().flatten() {
        let message = format!("{cause} is reported as it happens, not measured over time");
        reader.problem(mark, message, Some(String::from("allowed: ladder, actuator")));
    }
}

fn check_fact(cause: Cause, usual: Fact, changes: &RuleChanges, reader: &mut Reader) {
    if let Some(fact) = &changes.fact
        && fact.value != usual.word()
    {
        let message = format!("{cause} is not seen by `{}`", fact.value);
        let help = format!("allowed: {}", usual.word());
        reader.problem(fact.mark, message, Some(help));
    }
    if let Some(of) = &changes.of
        && usual != Fact::ComponentCpuOfLimit
    {
        let message = format!("`of` says nothing about {cause}");
        reader.problem(of.mark, message, Some(String::from("allowed for component-cpu-high")));
    }
}

fn bar(
    cause: &At<Cause>,
    fact: Fact,
    changes: &RuleChanges,
    before: Option<Condition>,
    reader: &mut Reader,
) -> Option<Bar> {
    match (&changes.at_most, &changes.at_least, before) {
        (Some(text), None, _) => level(text, &text.value.0, fact, reader).map(Bar::AtMost),
        (None, Some(text), _) => level(text, &text.value.0, fact, reader).map(Bar::AtLeast),
        (None, None, Some(before)) => Some(before.bar),
        (Some(_), Some(second), _) => {
            let message = "both `at_most` and `at_least`";
            reader.problem(second.mark, message, Some(String::from("allowed: one of them")));
            None
        }
        (None, None, None) => {
            let message = format!("{} has no bar", cause.value);
            let help = format!("allowed: at_most or at_least with {}", fact.unit().example());
            reader.problem(cause.mark, message, Some(help));
            None
        }
    }
}

fn clear(at: &At<ClearText>, fact: Fact, bar: Bar, reader: &mut Reader) -> Option<Clear> {
    let level = level(at, &at.value.level, fact, reader)?;
    check_outside(level, bar, at.mark, reader);
    Some(Clear { level, hold: at.value.hold })
}

/// A release level on the bad side of the bar would flap.
fn check_outside(clear: Level, bar: Bar, mark: Mark, reader: &mut Reader) {
    let (inside, side) = match bar {
        Bar::AtMost(level) => (below(clear, level), "or more"),
        Bar::AtLeast(level) => (below(level, clear), "or less"),
    };
    if inside {
        let message = format!("clear at {clear} is inside the fault");
        reader.problem(mark, message, Some(format!("allowed: {} {side}", bar.level())));
    }
}

fn below(a: Level, b: Level) -> bool {
    match (a, b) {
        (Level::Memory(a), Level::Memory(b)) => a < b,
        (Level::Share(a), Level::Share(b)) => a < b,
        (Level::Signal(a), Level::Signal(b)) => a < b,
        (Level::Time(a), Level::Time(b)) => a < b,
        (Level::Memory(_) | Level::Share(_) | Level::Signal(_) | Level::Time(_), _) => false,
    }
}

/// `text` in the unit of `fact`.
fn level<T>(at: &At<T>, text: &str, fact: Fact, reader: &mut Reader) -> Option<Level> {
    let parsed: Result<Level, UnitError> = match fact.unit() {
        Unit::Memory => units::size(text).map(Level::Memory),
        Unit::Share => units::share(text).map(Level::Share),
        Unit::Signal => units::level(text).map(Level::Signal),
        Unit::Time => units::duration(text).map(Level::Time),
    };
    parsed
        .map_err(|error| {
            let help = format!("allowed: {} is {}", fact.word(), fact.unit().example());
            reader.problem(at.mark, error.to_string(), Some(help));
        })
        .ok()
}
