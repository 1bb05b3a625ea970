//! What happens to one component, counted: for rules that are rates, and for expressions.

use alloc::{collections::BTreeMap, format, string::String};
use core::time::Duration;

use sdr_core::{
    recover::{Cause, Evidence},
    time::Instant,
};

use crate::{
    expression::Counted,
    fact::Fact,
    level::{Level, Unit},
    policy::{Rule, Trigger},
    tally::Tally,
};

/// Expressions see what happened within this time.
const MINUTE: Duration = Duration::from_secs(60);

/// What is counted of one component.
#[derive(Debug)]
pub(crate) struct Counts {
    /// By rule: each counts anew after its own remedies.
    rules: BTreeMap<usize, Tally>,
    /// For expressions, when there are any.
    minute: BTreeMap<Kind, Tally>,
    /// Counters as they were seen last.
    deadlines_missed: Counter,
    inputs_late: Counter,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Exits,
    Hangs,
    Errors,
    DeadlineMisses,
    InputsLate,
}

const KINDS: [Kind; 5] =
    [Kind::Exits, Kind::Hangs, Kind::Errors, Kind::DeadlineMisses, Kind::InputsLate];

/// A counter that begins anew with each instance.
#[derive(Clone, Copy, Debug, Default)]
struct Counter(Option<u64>);

impl Counter {
    /// How much it grew; nothing at the first look.
    fn grew(&mut self, now: u64) -> u32 {
        let before = self.0.replace(now);
        let grew = match before {
            None => 0,
            Some(before) if now >= before => now - before,
            Some(_) => now,
        };
        u32::try_from(grew).unwrap_or(u32::MAX)
    }
}

impl Default for Counts {
    fn default() -> Self {
        let counter = Counter::default();
        Self {
            rules: BTreeMap::new(),
            minute: BTreeMap::new(),
            deadlines_missed: counter,
            inputs_late: counter,
        }
    }
}

impl Counts {
    /// Counts what `seen` shows, for the `rules` that want it.
    pub(crate) fn feed(&mut self, now: Instant, seen: &Evidence, rules: &[Rule]) {
        let missed = self.deadlines_missed.grew(seen.deadlines_missed);
        let late = self.inputs_late.grew(seen.inputs_late);
        let fault = seen.fault.as_ref().map(|fault| fault.cause);
        let of_kind = |kind: Kind| match kind {
            Kind::Exits => u32::from(fault == Some(Cause::Exited)),
            Kind::Hangs => u32::from(fault == Some(Cause::Hung)),
            Kind::Errors => u32::from(fault.is_some_and(is_error)),
            Kind::DeadlineMisses => missed,
            Kind::InputsLate => late,
        };
        for (index, rule) in rules.iter().enumerate() {
            match &rule.trigger {
                Trigger::Condition(condition) => {
                    if let Some(kind) = kind_of(condition.fact) {
                        let fresh = || Tally::new(condition.per);
                        let tally = self.rules.entry(index).or_insert_with(fresh);
                        tally.note(now, of_kind(kind));
                    }
                }
                Trigger::Expression(..) if self.minute.is_empty() => {
                    self.minute = KINDS.map(|kind| (kind, Tally::new(MINUTE))).into();
                }
                Trigger::Expression(..)
                | Trigger::Fault
                | Trigger::Silent(_)
                | Trigger::Lost(_)
                | Trigger::Program(..) => {}
            }
        }
        for (kind, tally) in &mut self.minute {
            tally.note(now, of_kind(*kind));
        }
    }

    /// How often it happened, for a rule that is a rate.
    pub(crate) fn level(&mut self, now: Instant, rule: usize) -> Level {
        Level::Count(self.rules.get_mut(&rule).map_or(0, |tally| tally.count(now)))
    }

    /// What an expression or a program says, and in which words.
    pub(crate) fn told(
        &mut self,
        now: Instant,
        rule: &Rule,
        seen: &Evidence,
    ) -> (Option<bool>, String) {
        match &rule.trigger {
            Trigger::Expression(expression, _) => {
                let counted = self.counted(now);
                let holds = expression.holds(&|named| named.read(seen, &counted));
                (holds, String::from(expression.source()))
            }
            Trigger::Program(program, _) => {
                let said = seen.told.iter().find(|told| told.cause == rule.cause);
                let program = program.command.first().map_or("", String::as_str);
                match said {
                    None => (None, format!("{program} has not answered")),
                    Some(said) => (said.holds, format!("{program}: {}", said.reason)),
                }
            }
            Trigger::Fault | Trigger::Condition(_) | Trigger::Silent(_) | Trigger::Lost(_) => {
                (None, String::new())
            }
        }
    }

    /// When a count falls next.
    pub(crate) fn falls_at(&self) -> Option<Instant> {
        self.rules.values().chain(self.minute.values()).filter_map(Tally::falls_at).min()
    }

    /// What `rule` counts begins from nothing.
    pub(crate) fn clear(&mut self, rule: usize) {
        if let Some(tally) = self.rules.get_mut(&rule) {
            tally.clear();
        }
    }

    fn counted(&mut self, now: Instant) -> Counted {
        let mut of = |kind| {
            let tally = self.minute.get_mut(&kind);
            tally.map_or(0, |tally| i64::from(tally.count(now)))
        };
        Counted {
            exits: of(Kind::Exits),
            hangs: of(Kind::Hangs),
            errors: of(Kind::Errors),
            deadline_misses: of(Kind::DeadlineMisses),
            inputs_late: of(Kind::InputsLate),
        }
    }
}

fn kind_of(fact: Fact) -> Option<Kind> {
    debug_assert_eq!(fact.unit() == Unit::Rate, of_fact(fact).is_some(), "{}", fact.word());
    of_fact(fact)
}

fn of_fact(fact: Fact) -> Option<Kind> {
    match fact {
        Fact::ComponentExits => Some(Kind::Exits),
        Fact::ComponentHangs => Some(Kind::Hangs),
        Fact::ComponentErrors => Some(Kind::Errors),
        Fact::DeadlineMisses => Some(Kind::DeadlineMisses),
        Fact::InputsLate => Some(Kind::InputsLate),
        Fact::RobotMemoryFree
        | Fact::RobotCpu
        | Fact::RobotBattery
        | Fact::RobotRssi
        | Fact::ComponentCpuOfLimit
        | Fact::ComponentCpuOfCore
        | Fact::ComponentMemory
        | Fact::LinksDelay
        | Fact::LinksJitter
        | Fact::LinksLoss
        | Fact::Told => None,
    }
}

/// The error state, with a reason or without.
fn is_error(cause: Cause) -> bool {
    match cause {
        Cause::Error
        | Cause::HardwareLost
        | Cause::AbnormalBehaviour
        | Cause::EmergencyStop
        | Cause::Own(_) => true,
        Cause::MemoryShort
        | Cause::ComponentCpuHigh
        | Cause::Exited
        | Cause::Hung
        | Cause::BatteryLow
        | Cause::RobotCpuHigh
        | Cause::RssiLow
        | Cause::DelayHigh
        | Cause::JitterHigh
        | Cause::LossHigh
        | Cause::RobotGone
        | Cause::DeadlineMissed => false,
    }
}
