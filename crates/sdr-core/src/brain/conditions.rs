//! Calls for help: what a home in trouble publishes, and when it takes it back.

use alloc::{format, vec::Vec};

use super::{Brain, index::Stir};
use crate::{
    event::Event,
    id::{ComponentKey, Name},
    lifecycle::LifecycleState,
    mesh::{AuthorKey, Push},
    recover::{Cause, CauseStatus, RemedyOutcome, Verdict},
    report::{ConditionReport, Report},
    time::{Duration, Instant},
};

/// A condition nobody could help with for so long counts as refused, so the ladder goes on.
const HELP_WAIT: Duration = Duration::from_secs(5);

impl Brain {
    /// A component is tried here again: it need not leave for an event of before.
    pub(super) fn call_off(&mut self, key: &ComponentKey) {
        let mut conditions = core::mem::take(&mut self.conditions);
        for ((system, cause), condition) in &mut conditions {
            if *system == key.system && self.is_event(key, *cause) {
                condition.components.retain(|name| *name != key.name);
            }
        }
        self.conditions = conditions;
    }

    /// Publishes that components should leave; the coordinator acts.
    pub(super) fn ask_for_help(&mut self, system: &Name, verdict: &Verdict) {
        let place = (system.clone(), verdict.cause);
        let name = verdict.component.name.clone();
        let over = self.handled_at.since(verdict.held_over_at);
        let condition = self.conditions.entry(place).or_insert_with(|| ConditionReport {
            system: system.clone(),
            cause: verdict.cause,
            components: Vec::new(),
            remedy: verdict.remedy,
            reason: verdict.reason.clone(),
            held_over_ms: 0,
            foreseen: true,
        });
        if core::mem::take(&mut condition.foreseen) {
            condition.components.clear();
            condition.reason.clone_from(&verdict.reason);
            condition.held_over_ms = u64::try_from(over.as_millis()).unwrap_or(u64::MAX);
        }
        condition.remedy = verdict.remedy;
        let raised = format!("{}: {}", verdict.cause, verdict.reason);
        self.said.note_condition(&verdict.component, &raised, self.handled_at);
        if condition.components.contains(&name) {
            return;
        }
        condition.components.push(name);
        let event = Event::new("condition-raised", &self.me, raised);
        let event = event.about(&verdict.component);
        self.push_event(event.number("held_over_ns", nanos(verdict.held_over_at)));
    }

    /// Publishes what will have to leave if nothing changes, so that its next home gets ready.
    pub(super) fn foresee(&mut self, now: Instant, system: &Name) {
        let Some(engine) = self.engines.get(system) else { return };
        for seen in engine.recovery().foreseen() {
            let place = (system.clone(), seen.cause);
            let condition =
                self.conditions.entry(place.clone()).or_insert_with(|| ConditionReport {
                    system: system.clone(),
                    cause: seen.cause,
                    components: Vec::new(),
                    remedy: seen.remedy,
                    reason: seen.reason.clone(),
                    held_over_ms: 0,
                    foreseen: true,
                });
            if !condition.foreseen {
                continue;
            }
            if !condition.components.contains(&seen.component.name) {
                self.stir.fleet = true;
                condition.components.push(seen.component.name.clone());
            }
            // a figure that jumps about its bar starts nothing twice
            self.foreseen_until.insert(place, now + seen.hold);
        }
        self.foreseen_until.retain(|_, until| now < *until);
    }

    /// Takes conditions back whose components left, or whose cause is over; says the others.
    pub(super) fn clear_conditions(&mut self, now: Instant) {
        let standing: Vec<CauseStatus> =
            self.engines.values().flat_map(|engine| engine.recovery().standing()).collect();
        let mut conditions = core::mem::take(&mut self.conditions);
        let foreseen = &self.foreseen_until;
        let mut over = Vec::new();
        for ((system, cause), condition) in &mut conditions {
            condition.components.retain(|name| {
                let key = ComponentKey::new(system, name);
                let here = self.home(&key) == Some(&self.me);
                let active = self
                    .current(&key)
                    .is_some_and(|id| self.instances[&id].state == LifecycleState::Active);
                here && match (condition.foreseen, self.is_event(&key, *cause)) {
                    (true, _) => foreseen.contains_key(&(system.clone(), *cause)),
                    (false, true) => !active,
                    (false, false) => still_raised(&standing, &key, *cause),
                }
            });
            if condition.components.is_empty() {
                over.push(((system.clone(), *cause), condition.foreseen));
            }
        }
        for (place, foreseen) in over {
            conditions.remove(&place);
            self.foreseen_until.remove(&place);
            self.stir = Stir::ALL;
            self.mesh.retract(&AuthorKey::condition(&place.0, place.1));
            if !foreseen {
                let text = format!("{} of {}", place.1, place.0);
                self.event("condition-cleared", text);
            }
        }
        self.conditions = conditions;
        if !self.conditions.is_empty() {
            self.index.troubled.insert(self.me.clone());
        }
        for condition in self.conditions.values() {
            self.mesh.report(&Report::Condition(condition.clone()), Push::Now);
        }
        self.give_up_waiting(now);
    }

    /// Tells the engines of components whose call for help nobody answered.
    fn give_up_waiting(&mut self, now: Instant) {
        for key in self.said.unanswered(now, HELP_WAIT) {
            let here = self.home(&key) == Some(&self.me);
            let waits = |condition: &ConditionReport| {
                self.is_event(&key, condition.cause) && condition.components.contains(&key.name)
            };
            if !here || !self.conditions.values().any(waits) {
                continue;
            }
            if let Some(engine) = self.engines.get_mut(&key.system) {
                engine.with(|recovery| recovery.outcome(now, &key, RemedyOutcome::Refused));
                self.judge_due = true;
            }
        }
    }

    /// Whether a cause is an event of a component rather than a figure over time.
    fn is_event(&self, key: &ComponentKey, cause: Cause) -> bool {
        let engine = self.engines.get(&key.system);
        engine.map_or(cause.is_event(), |engine| engine.recovery().is_event(key, cause))
    }

    /// Whether local attempts at a component ended: it is held, or waits to leave.
    pub(super) fn is_given_up(&self, key: &ComponentKey) -> bool {
        let leaves = |condition: &ConditionReport| {
            condition.system == key.system
                && self.is_event(key, condition.cause)
                && condition.components.contains(&key.name)
        };
        self.held.contains_key(key)
            || self.failed.contains(key)
            || self.conditions.values().any(leaves)
    }
}

fn still_raised(standing: &[CauseStatus], key: &ComponentKey, cause: Cause) -> bool {
    let same =
        |status: &&CauseStatus| status.component == *key && status.cause == cause && status.raised;
    standing.iter().find(same).is_some()
}

#[expect(
    clippy::cast_precision_loss,
    reason = "clocks stay below 2^53 ns for 104 days, then lose ns"
)]
fn nanos(at: Instant) -> f64 {
    at.as_nanos() as f64
}
