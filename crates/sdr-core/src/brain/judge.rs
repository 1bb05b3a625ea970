//! Trouble of this robot's own components: evidence, verdicts, local remedies, conditions.

use alloc::{boxed::Box, collections::BTreeMap, format, string::String, vec::Vec};
use core::fmt;

use super::Brain;
use crate::{
    event::Event,
    id::{ComponentKey, Name, RobotId},
    lifecycle::LifecycleState,
    mesh::{AuthorKey, Push},
    recover::{
        Cause, CauseStatus, Evidence, Recovery, Remedy, RemedyOutcome, RobotEvidence, Verdict,
    },
    report::{ConditionReport, LinkReport, Report},
    spec::PolicyBytes,
    time::{Duration, Instant},
    units::Permille,
};

/// A condition nobody could help with for so long counts as refused, so the ladder goes on.
const HELP_WAIT: Duration = Duration::from_secs(5);

/// The recovery engine of one system on this robot.
pub(super) struct Engine {
    policy: PolicyBytes,
    pub(super) recovery: Box<dyn Recovery + Send>,
}

impl fmt::Debug for Engine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Engine").field("policy", &self.policy.name).finish_non_exhaustive()
    }
}

impl Engine {
    pub(super) fn next_deadline(&self) -> Option<Instant> {
        self.recovery.next_deadline()
    }

    pub(super) fn is_due(&self, now: Instant) -> bool {
        self.next_deadline().is_some_and(|at| now >= at)
    }
}

/// When a component may be started again.
#[derive(Clone, Copy, Debug)]
pub(super) struct RestartPlan {
    pub(super) at: Instant,
}

impl Brain {
    pub(super) fn judge(&mut self, now: Instant) {
        self.judge_due = false;
        let names: Vec<Name> = self.systems.keys().cloned().collect();
        self.engines.retain(|name, _| names.contains(name));
        for name in names {
            let evidence = self.evidence(&name);
            if !self.ensure_engine(&name) {
                continue;
            }
            self.hold_what_has_no_rule(&name, &evidence);
            let engine = self.engines.get_mut(&name).expect("ensured above");
            for verdict in engine.recovery.judge(now, &evidence) {
                self.carry_out(now, &name, verdict);
            }
        }
        self.clear_conditions(now);
    }

    /// A fault that the policy says nothing about is told, and nothing is tried.
    fn hold_what_has_no_rule(&mut self, name: &Name, evidence: &[Evidence]) {
        for seen in evidence {
            let Some(fault) = &seen.fault else { continue };
            let engine = &self.engines[name];
            if !engine.recovery.has_rule(fault.cause) {
                let text = format!(
                    "no rule for {} in recovery `{}`: {}",
                    fault.cause, engine.policy.name, fault.reason
                );
                self.held.insert(seen.component.clone(), text.clone());
                self.event_about("held", &seen.component, text);
            }
        }
    }

    /// Makes the engine of a system when there is none for its present policy.
    fn ensure_engine(&mut self, name: &Name) -> bool {
        let Some(system) = self.systems.get(name) else { return false };
        let policy = system.recovery.clone();
        if self.engines.get(name).is_some_and(|engine| engine.policy == policy) {
            return true;
        }
        match (self.seams.recovery)(&policy) {
            Ok(recovery) => {
                self.engines.insert(name.clone(), Engine { policy, recovery });
                true
            }
            Err(error) => {
                let text = format!("recovery `{}`: {error}", policy.name);
                let told = self.unreadable.insert(name.clone(), policy);
                if told.as_ref() != self.unreadable.get(name) {
                    self.event("policy-unreadable", text);
                }
                false
            }
        }
    }

    pub(super) fn make_engine(&self, policy: &PolicyBytes) -> Option<Engine> {
        let recovery = (self.seams.recovery)(policy).ok()?;
        Some(Engine { policy: policy.clone(), recovery })
    }

    /// What is seen of the components whose home is here.
    fn evidence(&mut self, name: &Name) -> Vec<Evidence> {
        let Some(system) = self.systems.get(name) else { return Vec::new() };
        let mut evidence = Vec::new();
        for spec in &system.components {
            let component = system.key(&spec.name);
            if self.home(&component) != Some(&self.me) {
                continue;
            }
            let fault = self.faults.remove(&component);
            let usage = self.current(&component).map(|id| self.instances[&id].usage);
            let usage = usage.unwrap_or_default();
            evidence.push(Evidence {
                fault,
                actuator: spec.actuator,
                standby_here: false,
                standby_elsewhere: false,
                memory: usage.memory,
                cpu: usage.cpu,
                cpu_limit: spec.needs.cpu,
                robot: self.robot_evidence(&component),
                component,
            });
        }
        evidence
    }

    /// Figures of a robot as it reports them; links are its own matter.
    pub(super) fn figures_of(&self, robot: &RobotId) -> Option<RobotEvidence> {
        let facts = self.facts(robot)?;
        let mine = (*robot == self.me).then_some(self.host).flatten();
        let host = mine.or_else(|| self.host_of(robot).copied())?;
        let capacity = facts.cpu_capacity.0.max(1);
        Some(RobotEvidence {
            memory_free: Some(facts.memory_capacity.less(host.memory_used)),
            cpu: Some(Permille(host.cpu_used.0.saturating_mul(1000) / capacity)),
            battery: host.battery,
            rssi: host.rssi,
            ..RobotEvidence::default()
        })
    }

    /// The same with the links that a component's connections use; none, when none crosses.
    fn robot_evidence(&self, component: &ComponentKey) -> RobotEvidence {
        if self.host.is_none() {
            return RobotEvidence::default();
        }
        let partners = self.partners(component);
        let used: Vec<LinkReport> = self
            .mesh
            .links()
            .filter(|(robot, _)| self.mesh.is_alive(robot) && partners.contains(robot))
            .map(|(_, link)| link)
            .collect();
        RobotEvidence {
            delay: median(used.iter().map(|link| link.rtt / 2).collect()),
            jitter: median(used.iter().map(|link| link.jitter).collect()),
            loss: median(used.iter().map(|link| link.loss).collect()),
            ..self.figures_of(&self.me).unwrap_or_default()
        }
    }

    /// Homes of the components that a component talks with.
    fn partners(&self, component: &ComponentKey) -> Vec<RobotId> {
        let Some(system) = self.systems.get(&component.system) else { return Vec::new() };
        let others = system.connections.iter().filter_map(|wire| {
            let (from, to) = (&wire.from.component, &wire.to.component);
            match (*from == component.name, *to == component.name) {
                (true, false) => Some(to),
                (false, true) => Some(from),
                (true, true) | (false, false) => None,
            }
        });
        others.filter_map(|name| self.home(&system.key(name)).cloned()).collect()
    }

    fn carry_out(&mut self, now: Instant, system: &Name, verdict: Verdict) {
        let key = verdict.component.clone();
        let outcome = match verdict.remedy {
            Remedy::Restart { after } => {
                self.restart(now, &verdict, after);
                Some(RemedyOutcome::Done)
            }
            // standbys on this robot are none yet: the ladder goes on
            Remedy::LocalStandby => Some(RemedyOutcome::Refused),
            Remedy::StandbyElsewhere | Remedy::LaunchElsewhere => {
                self.ask_for_help(system, &verdict);
                None
            }
            Remedy::Hold => {
                let text = format!("{}: {}", verdict.cause, verdict.reason);
                self.held.insert(key.clone(), text.clone());
                self.event_about("held", &key, text);
                None
            }
        };
        if let (Some(outcome), Some(engine)) = (outcome, self.engines.get_mut(system)) {
            engine.recovery.outcome(now, &key, outcome);
            self.judge_due |= outcome == RemedyOutcome::Refused;
        }
    }

    fn restart(&mut self, now: Instant, verdict: &Verdict, after: Duration) {
        let key = &verdict.component;
        self.held.remove(key);
        self.failed.remove(key);
        self.call_off(key);
        let text = format!("{}: {}", verdict.cause, verdict.reason);
        let event = Event::new("restart", &self.me, text).about(key);
        self.push_event(event.number("after_ms", millis(after)));
        self.restarts.insert(key.clone(), RestartPlan { at: now + after });
        self.said.count_restart(key);
        if let Some(id) = self.current(key) {
            if verdict.cause == Cause::Hung {
                self.kill(id);
            } else {
                self.finish(id);
            }
        }
    }

    /// A component is tried here again: it need not leave for an event of before.
    fn call_off(&mut self, key: &ComponentKey) {
        for ((system, cause), condition) in &mut self.conditions {
            if is_event(*cause) && *system == key.system {
                condition.components.retain(|name| *name != key.name);
            }
        }
    }

    /// Publishes that components should leave; the coordinator acts.
    fn ask_for_help(&mut self, system: &Name, verdict: &Verdict) {
        let place = (system.clone(), verdict.cause);
        let name = verdict.component.name.clone();
        let over = self.handled_at.since(verdict.held_over_at);
        let condition = self.conditions.entry(place).or_insert_with(|| ConditionReport {
            system: system.clone(),
            cause: verdict.cause,
            components: Vec::new(),
            remedy: verdict.remedy,
            reason: verdict.reason.clone(),
            held_over_ms: u64::try_from(over.as_millis()).unwrap_or(u64::MAX),
        });
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

    /// Takes conditions back whose components left, or whose cause is over; says the others.
    pub(super) fn clear_conditions(&mut self, now: Instant) {
        let standing: Vec<CauseStatus> =
            self.engines.values().flat_map(|engine| engine.recovery.standing()).collect();
        let mut conditions = core::mem::take(&mut self.conditions);
        let mut over = Vec::new();
        for ((system, cause), condition) in &mut conditions {
            condition.components.retain(|name| {
                let key = ComponentKey::new(system, name);
                let here = self.home(&key) == Some(&self.me);
                let active = self
                    .current(&key)
                    .is_some_and(|id| self.instances[&id].state == LifecycleState::Active);
                here && match is_event(*cause) {
                    true => !active,
                    false => still_raised(&standing, &key, *cause),
                }
            });
            if condition.components.is_empty() {
                over.push((system.clone(), *cause));
            }
        }
        for place in over {
            conditions.remove(&place);
            self.mesh.retract(&AuthorKey::condition(&place.0, place.1));
            let text = format!("{} of {}", place.1, place.0);
            self.event("condition-cleared", text);
        }
        self.conditions = conditions;
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
                is_event(condition.cause) && condition.components.contains(&key.name)
            };
            if !here || !self.conditions.values().any(waits) {
                continue;
            }
            if let Some(engine) = self.engines.get_mut(&key.system) {
                engine.recovery.outcome(now, &key, RemedyOutcome::Refused);
                self.judge_due = true;
            }
        }
    }

    /// Whether local attempts at a component ended: it is held, or waits to leave.
    pub(super) fn is_given_up(&self, key: &ComponentKey) -> bool {
        let leaves = |condition: &ConditionReport| {
            condition.system == key.system
                && is_event(condition.cause)
                && condition.components.contains(&key.name)
        };
        self.held.contains_key(key)
            || self.failed.contains(key)
            || self.conditions.values().any(leaves)
    }

    /// Forgets the trouble of a component that has nothing to do here any more.
    pub(super) fn forget_here(&mut self, key: &ComponentKey) {
        self.restarts.remove(key);
        self.held.remove(key);
        self.failed.remove(key);
        self.faults.remove(key);
        self.said.forget_restarts(key);
        if let Some(engine) = self.engines.get_mut(&key.system) {
            engine.recovery.forget(key);
        }
    }

    /// Causes that hold here, for status and screens.
    pub(super) fn standing(&self) -> Vec<CauseStatus> {
        self.engines.values().flat_map(|engine| engine.recovery.standing()).collect()
    }
}

/// Whether a cause is an event of a component rather than a figure over time.
pub(super) fn is_event(cause: Cause) -> bool {
    match cause {
        Cause::Exited
        | Cause::Hung
        | Cause::Error
        | Cause::HardwareLost
        | Cause::AbnormalBehaviour
        | Cause::EmergencyStop
        | Cause::RobotGone => true,
        Cause::MemoryShort
        | Cause::ComponentCpuHigh
        | Cause::BatteryLow
        | Cause::RobotCpuHigh
        | Cause::RssiLow
        | Cause::DelayHigh
        | Cause::JitterHigh
        | Cause::LossHigh => false,
    }
}

fn still_raised(standing: &[CauseStatus], key: &ComponentKey, cause: Cause) -> bool {
    let same =
        |status: &&CauseStatus| status.component == *key && status.cause == cause && status.raised;
    standing.iter().find(same).is_some()
}

fn median<T: Ord + Copy>(mut values: Vec<T>) -> Option<T> {
    values.sort_unstable();
    values.get(values.len() / 2).copied()
}

#[expect(
    clippy::cast_precision_loss,
    reason = "clocks stay below 2^53 ns for 104 days, then lose ns"
)]
fn nanos(at: Instant) -> f64 {
    at.as_nanos() as f64
}

pub(super) fn millis(time: Duration) -> f64 {
    time.as_secs_f64() * 1000.0
}

/// Calls for help by component, for waiting and for status.
pub(super) type Calls = BTreeMap<ComponentKey, (Instant, String)>;
