//! From a recovery policy as written to the checked one.

use std::{ops::RangeInclusive, time::Duration};

use sdr_core::{
    recover::{Cause, GuardPolicy},
    units::Permille,
};
use sdr_recovery::{Ladder, LadderError, Limits, Policy, PolicyParts, Rule, Rung, Trigger};

use super::{
    cause_words::{CauseEntry, cause_of},
    conditions::{told, trigger},
    find::{Finder, Finding, PolicyEntry, PolicyFile},
    recovery_file::{
        GuardTable, LimitsTable, RecoveryFile, RuleChanges, RuleTable, RulesEntry, UnknownFact,
    },
};
use crate::read::{At, Map, Reader};

/// Shortest and longest time between two beats of a home.
const GUARD_PERIOD_MIN: Duration = Duration::from_millis(10);
const GUARD_PERIOD_MAX: Duration = Duration::from_secs(1);
/// Beats that may be missed.
const GUARD_MISSES: RangeInclusive<u8> = 2..=20;

impl PolicyFile for RecoveryFile {
    type Policy = Policy;
    const KIND: &'static str = "recovery";
    const BUILT_IN: &'static [(&'static str, &'static str)] = &[
        ("default", include_str!("../../../../policies/recovery/default.yaml")),
        ("exploration", include_str!("../../../../policies/recovery/exploration.yaml")),
    ];

    fn standard() -> Policy {
        Policy::default()
    }

    fn checked(self, at: Finding<'_>, reader: &mut Reader) -> Option<Policy> {
        let name = at.name(self.recovery.clone(), "recovery", reader);
        let base = match &self.extends {
            Some(extends) => Some(at.finder.named::<Self>(extends, reader)?.parts().clone()),
            None => None,
        };
        let mut parts = self.over(base, reader);
        parts.name = name?;
        if !reader.is_clean() {
            return None;
        }
        Policy::new(parts)
            .map_err(|error| reader.problem(at.tree.mark, error.to_string(), None))
            .ok()
    }
}

impl RecoveryFile {
    /// What the file makes of the policy that it extends.
    fn over(self, base: Option<PolicyParts>, reader: &mut Reader) -> PolicyParts {
        let extended = base.is_some();
        let mut parts = base.unwrap_or_else(|| PolicyParts {
            name: String::new(),
            ladders: Vec::new(),
            rules: Vec::new(),
            limits: Limits::default(),
            exceptions: Vec::new(),
        });
        if let Some(changes) = &self.r#override
            && !extended
        {
            let help = String::from("allowed: `extends: default`, or the rules under `rules`");
            reader.problem(changes.mark, "`override` without `extends`", Some(help));
        }
        ladders(self.ladders, &mut parts, reader);
        let changes = self.r#override.map(|changes| changes.value.0).unwrap_or_default();
        let changed = change_rules(changes, &mut parts, reader);
        match self.rules {
            None => {}
            Some(At { value: RulesEntry::Only, mark }) => {
                if changed.is_empty() {
                    let message =
                        "`rules: only` keeps the rules under `override`, and none is there";
                    reader.problem(mark, message, None);
                }
                parts.rules.retain(|rule| changed.contains(&rule.cause));
            }
            Some(At { value: RulesEntry::List(rules), .. }) => {
                add_rules(rules, &mut parts, reader);
            }
        }
        if let Some(limits) = self.limits {
            apply_limits(limits, &mut parts.limits, reader);
        }
        match self.unknown.map(|at| at.value) {
            // What the rules do by themselves; the key says it to the reader.
            Some(UnknownFact) | None => {}
        }
        parts
    }
}

/// Gives a component of a system with the policy `base` rules of its own: those of the policy
/// that `entry` names, or `base` with the changes that stand there.
pub(crate) fn own_rules(
    base: &mut Policy,
    component: &str,
    entry: At<PolicyEntry<RecoveryFile>>,
    finder: &Finder,
    reader: &mut Reader,
) {
    let mark = entry.mark;
    let own = match entry.value {
        PolicyEntry::Named(word) => {
            let word = At { value: word, mark };
            let Some(named) = finder.named::<RecoveryFile>(&word, reader) else { return };
            named
        }
        PolicyEntry::Inline(file, _) => {
            for stray in [&file.recovery, &file.extends].into_iter().flatten() {
                let help = String::from(
                    "allowed: rules, override, ladders, limits; or the name of a policy alone",
                );
                let message = "a component's own rules change those of its system";
                reader.problem(stray.mark, message, Some(help));
            }
            let parts = file.over(Some(base.for_component("").parts().clone()), reader);
            if !reader.is_clean() {
                return;
            }
            match Policy::new(parts) {
                Ok(own) => own,
                Err(error) => return reader.problem(mark, error.to_string(), None),
            }
        }
    };
    match base.with_exception(component, &own) {
        Ok(with) => *base = with,
        Err(error) => reader.problem(mark, error.to_string(), None),
    }
}

fn ladders(given: Option<Map<At<Vec<Rung>>>>, parts: &mut PolicyParts, reader: &mut Reader) {
    for (name, rungs) in given.map(|ladders| ladders.0).unwrap_or_default() {
        let ladder = rungs.map(|rungs| Ladder::new(rungs.value)).unwrap_or_else(named_only);
        parts.ladders.retain(|(other, _)| *other != name.value);
        match ladder {
            Ok(ladder) => parts.ladders.push((name.value, ladder)),
            Err(error) => {
                parts.ladders.extend(named_only().map(|ladder| (name.value.clone(), ladder)));
                let message = format!("ladder `{}`: {error}", name.value);
                let help = String::from(
                    "allowed: local-standby, restart, standby-elsewhere, launch-elsewhere in this order, hold last",
                );
                reader.problem(name.mark, message, Some(help));
            }
        }
    }
}

/// Stands for a ladder with a problem that was told: rules that name it are not at fault.
fn named_only() -> Result<Ladder, LadderError> {
    Ladder::new(vec![Rung::Hold])
}

/// Changes rules by cause and tells which causes were named.
fn change_rules(
    changes: Vec<(At<String>, Option<At<RuleChanges>>)>,
    parts: &mut PolicyParts,
    reader: &mut Reader,
) -> Vec<Cause> {
    let mut changed = Vec::new();
    for (word, change) in changes {
        let Some(cause) = cause_of(&word, reader) else { continue };
        let index = parts.rules.iter().position(|rule| rule.cause == cause);
        let Some(index) = index else {
            let known: Vec<String> =
                parts.rules.iter().map(|rule| rule.cause.to_string()).collect();
            let message = format!("the policy under `extends` has no rule for {cause}");
            let help = format!("it has: {}", known.join(", "));
            reader.problem(word.mark, message, Some(help));
            continue;
        };
        changed.push(cause);
        let Some(change) = change else { continue };
        let before = parts.rules[index].trigger.clone();
        let at = At { value: cause, mark: word.mark };
        if let Some(trigger) = trigger(at, &change.value, Some(&before), reader) {
            parts.rules[index].trigger = trigger;
        }
        let names = (change.value.ladder, change.value.actuator);
        if let Some(ladder) = known_ladder(names.0, parts, reader) {
            parts.rules[index].ladder = ladder;
        }
        if let Some(ladder) = known_ladder(names.1, parts, reader) {
            parts.rules[index].actuator = Some(ladder);
        }
    }
    changed
}

fn add_rules(rules: Vec<At<RuleTable>>, parts: &mut PolicyParts, reader: &mut Reader) {
    for rule in rules {
        let (entry, changes) = rule.value.split();
        let seen = seen_by(entry, &changes, reader);
        let Some(first) = seen.first().map(|(cause, _)| cause.clone()) else { continue };
        if changes.ladder.is_none() {
            let message = format!("the rule for {} has no `ladder`", first.value);
            reader.problem(first.mark, message, Some(format!("allowed: {}", names(parts))));
        }
        let ladder = known_ladder(changes.ladder, parts, reader);
        let actuator = known_ladder(changes.actuator, parts, reader);
        for (cause, trigger) in seen {
            if parts.rules.iter().any(|other| other.cause == cause.value) {
                let message = format!("cause {} has two rules", cause.value);
                let help =
                    String::from("one rule for each; under `extends`, change it in `override`");
                reader.problem(cause.mark, message, Some(help));
                continue;
            }
            if let (Some(trigger), Some(ladder)) = (trigger, &ladder) {
                let (ladder, actuator) = (ladder.clone(), actuator.clone());
                parts.rules.push(Rule { cause: cause.value, trigger, ladder, actuator });
            }
        }
    }
}

/// The causes of one rule, and how each is seen.
fn seen_by(
    entry: At<CauseEntry>,
    changes: &RuleChanges,
    reader: &mut Reader,
) -> Vec<(At<Cause>, Option<Trigger>)> {
    match entry.value {
        CauseEntry::Cause(cause) => {
            let at = At { value: cause, mark: entry.mark };
            let trigger = trigger(at.clone(), changes, None, reader);
            vec![(at, trigger)]
        }
        CauseEntry::Program(program, causes) => {
            let marks = [
                changes.fact.as_ref().map(|at| at.mark),
                changes.when.as_ref().map(|at| at.mark),
                changes.at_most.as_ref().map(|at| at.mark),
                changes.at_least.as_ref().map(|at| at.mark),
            ];
            for mark in marks.into_iter().flatten() {
                let help = String::from("allowed: for, clear, ladder, actuator");
                reader.problem(mark, "a program says itself what holds", Some(help));
            }
            let condition = told(changes, None, reader);
            let trigger = condition.map(|told| Trigger::Program(program, told));
            causes.into_iter().map(|cause| (cause, trigger.clone())).collect()
        }
    }
}

fn names(parts: &PolicyParts) -> String {
    let names: Vec<&str> = parts.ladders.iter().map(|(name, _)| name.as_str()).collect();
    names.join(", ")
}

/// The ladder that is named, when it is there.
fn known_ladder(
    given: Option<At<String>>,
    parts: &PolicyParts,
    reader: &mut Reader,
) -> Option<String> {
    let given = given?;
    let names: Vec<&str> = parts.ladders.iter().map(|(name, _)| name.as_str()).collect();
    if !names.contains(&given.value.as_str()) {
        reader.unknown(given.mark, "ladder", &given.value, &names);
        return None;
    }
    Some(given.value)
}

fn apply_limits(given: LimitsTable, limits: &mut Limits, reader: &mut Reader) {
    if let Some(moves) = given.moves {
        limits.moves_per_hour = moves.value.0;
    }
    if let Some(restarts) = given.restarts {
        limits.restarts_per_hour = restarts.value.0;
    }
    if let Some(returns) = given.r#return {
        limits.returns = returns.value;
    }
    if let Some(time) = given.not_back_for {
        limits.not_back_for = time.value;
    }
    if let Some(time) = given.settle {
        limits.settle = time.value;
    }
    if let Some(retry) = given.retry {
        limits.retry = retry.value;
    }
    if let Some(share) = given.prepare_after {
        if share.value > Permille(1000) {
            let message = format!("{} % of the hold time", share.value.0 / 10);
            reader.problem(share.mark, message, Some(String::from("allowed: 0% to 100%")));
        }
        limits.prepare_after = share.value;
    }
    if let Some(guard) = given.guard {
        apply_guard(guard, &mut limits.guard, reader);
    }
}

fn apply_guard(given: GuardTable, guard: &mut GuardPolicy, reader: &mut Reader) {
    if let Some(period) = given.period {
        let found = period.value;
        if !(GUARD_PERIOD_MIN..=GUARD_PERIOD_MAX).contains(&found) {
            let message = format!("a beat each {found:?}");
            reader.problem(period.mark, message, Some(String::from("allowed: 10ms to 1s")));
        }
        guard.period = found;
    }
    if let Some(misses) = given.misses {
        let found = misses.value;
        if !GUARD_MISSES.contains(&found) {
            let message = format!("{found} missed beats");
            reader.problem(misses.mark, message, Some(String::from("allowed: 2 to 20")));
        }
        guard.misses = u32::from(found);
    }
    if let Some(alone) = given.alone {
        guard.alone = alone.value;
    }
}
