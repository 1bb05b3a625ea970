//! Trouble of this robot's own components: evidence, verdicts, local remedies, conditions.

use alloc::{boxed::Box, collections::BTreeMap, format, string::String, sync::Arc, vec::Vec};
use core::fmt;

use super::{Brain, index::Stir};
use crate::{
    event::Event,
    id::{ComponentKey, Name},
    recover::{CauseStatus, Evidence, Recovery, Remedy, RemedyOutcome, Verdict},
    spec::PolicyBytes,
    time::{Duration, Instant},
};

/// The recovery engine of one system on this robot.
pub(super) struct Engine {
    policy: Arc<PolicyBytes>,
    recovery: Box<dyn Recovery + Send>,
    /// Kept, since it is looked at with every input.
    deadline: Option<Instant>,
}

impl fmt::Debug for Engine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Engine").field("policy", &self.policy.name).finish_non_exhaustive()
    }
}

impl Engine {
    pub(super) fn policy(&self) -> &Arc<PolicyBytes> {
        &self.policy
    }

    fn new(policy: Arc<PolicyBytes>, recovery: Box<dyn Recovery + Send>) -> Self {
        let deadline = recovery.next_deadline();
        Self { policy, recovery, deadline }
    }

    pub(super) fn recovery(&self) -> &dyn Recovery {
        &*self.recovery
    }

    /// Does something that may move the deadline.
    pub(super) fn with<T>(&mut self, act: impl FnOnce(&mut dyn Recovery) -> T) -> T {
        let done = act(&mut *self.recovery);
        self.deadline = self.recovery.next_deadline();
        done
    }

    pub(super) fn next_deadline(&self) -> Option<Instant> {
        self.deadline
    }

    pub(super) fn is_due(&self, now: Instant) -> bool {
        self.next_deadline().is_some_and(|at| now >= at)
    }
}

/// An engine that is asked what it objects to, for all systems of one policy.
#[derive(Debug)]
pub(super) struct Objector {
    pub(super) engine: Engine,
    systems: usize,
}

/// When a component may be started again.
#[derive(Clone, Copy, Debug)]
pub(super) struct RestartPlan {
    pub(super) at: Instant,
}

impl Brain {
    pub(super) fn judge(&mut self, now: Instant) {
        self.judge_due = false;
        let names: Vec<Name> = self.index.my_systems().cloned().collect();
        self.engines.retain(|name, _| names.contains(name));
        self.told.keep(&names);
        for name in names {
            let evidence = self.evidence(&name);
            if !self.ensure_engine(&name) {
                continue;
            }
            self.hold_what_has_no_rule(&name, &evidence);
            let engine = self.engines.get_mut(&name).expect("ensured above");
            for verdict in engine.with(|recovery| recovery.judge(now, &evidence)) {
                self.carry_out(now, &name, verdict);
            }
            self.foresee(now, &name);
            self.ask_programs(now, &name, evidence);
        }
        self.clear_conditions(now);
        self.update_patience();
    }

    /// A fault that the policy says nothing about is told, and nothing is tried.
    fn hold_what_has_no_rule(&mut self, name: &Name, evidence: &[Evidence]) {
        for seen in evidence {
            let Some(fault) = &seen.fault else { continue };
            let engine = &self.engines[name];
            if !engine.recovery().has_rule(&seen.component, fault.cause) {
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
        let policy = Arc::clone(&system.recovery);
        if self.engines.get(name).is_some_and(|engine| engine.policy == policy) {
            return true;
        }
        let Some((recovery, unread)) = self.readable_recovery(&policy) else { return false };
        if let Some(error) = unread {
            let told = self.unreadable.insert(name.clone(), Arc::clone(&policy));
            if told.as_ref() != Some(&policy) {
                self.event("policy-unreadable", format!("{error}; the default goes for {name}"));
            }
        }
        self.engines.insert(name.clone(), Engine::new(policy, recovery));
        true
    }

    /// One more system goes by this policy: robots are asked about it.
    pub(super) fn need_objector(&mut self, policy: &Arc<PolicyBytes>) {
        let mut known = self.objectors.iter_mut();
        match known.find(|objector| objector.engine.policy == *policy) {
            Some(objector) => objector.systems += 1,
            None => {
                let made = self.make_engine(policy);
                self.objectors.extend(made.map(|engine| Objector { engine, systems: 1 }));
            }
        }
    }

    /// One system less goes by it.
    pub(super) fn spare_objector(&mut self, policy: &Arc<PolicyBytes>) {
        let known = self.objectors.iter().position(|known| known.engine.policy == *policy);
        let Some(place) = known else { return };
        self.objectors[place].systems -= 1;
        if self.objectors[place].systems == 0 {
            self.objectors.remove(place);
        }
    }

    pub(super) fn make_engine(&self, policy: &Arc<PolicyBytes>) -> Option<Engine> {
        let (recovery, _) = self.readable_recovery(policy)?;
        Some(Engine::new(Arc::clone(policy), recovery))
    }

    fn carry_out(&mut self, now: Instant, system: &Name, verdict: Verdict) {
        self.stir = Stir::ALL;
        let key = verdict.component.clone();
        let outcome = match verdict.remedy {
            Remedy::Restart { after } => {
                self.restart(now, &verdict, after);
                Some(RemedyOutcome::Done)
            }
            Remedy::LocalStandby => Some(self.switch_here(&verdict)),
            Remedy::StandbyElsewhere | Remedy::LaunchElsewhere => {
                self.ask_for_help(system, &verdict);
                None
            }
            Remedy::Hold => {
                let text = format!("{}: {}", verdict.cause, verdict.reason);
                self.held.insert(key.clone(), text.clone());
                self.event_about("held", &key, text.clone());
                let latched = self.engines.get(system).map(|one| one.recovery.is_latched(&key));
                if latched == Some(true) {
                    self.latch(&key, text);
                }
                None
            }
        };
        if let (Some(outcome), Some(engine)) = (outcome, self.engines.get_mut(system)) {
            engine.with(|recovery| recovery.outcome(now, &key, outcome));
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
        self.end_faulty(key, verdict.cause);
    }

    /// Forgets the trouble of a component that has nothing to do here any more.
    pub(super) fn forget_here(&mut self, key: &ComponentKey) {
        self.restarts.remove(key);
        self.held.remove(key);
        self.failed.remove(key);
        self.faults.remove(key);
        self.said.forget_restarts(key);
        if let Some(engine) = self.engines.get_mut(&key.system) {
            engine.with(|recovery| recovery.forget(key));
        }
    }

    /// Causes that hold here, for status and screens.
    pub(super) fn standing(&self) -> Vec<CauseStatus> {
        self.engines.values().flat_map(|engine| engine.recovery().standing()).collect()
    }
}

pub(super) fn millis(time: Duration) -> f64 {
    time.as_secs_f64() * 1000.0
}

/// Calls for help by component, for waiting and for status.
pub(super) type Calls = BTreeMap<ComponentKey, (Instant, String)>;
