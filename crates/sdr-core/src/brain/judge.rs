//! Trouble of this robot's own components: evidence, verdicts, local remedies, conditions.

use alloc::{boxed::Box, collections::BTreeMap, format, string::String, vec::Vec};
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
    policy: PolicyBytes,
    pub(super) recovery: Box<dyn Recovery + Send>,
}

impl fmt::Debug for Engine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Engine").field("policy", &self.policy.name).finish_non_exhaustive()
    }
}

impl Engine {
    pub(super) fn policy(&self) -> &PolicyBytes {
        &self.policy
    }

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
        let mut names: Vec<Name> = self.index.mine.iter().map(|key| key.system.clone()).collect();
        names.dedup();
        self.engines.retain(|name, _| names.contains(name));
        self.told.keep(&names);
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
            if !engine.recovery.has_rule(&seen.component, fault.cause) {
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
        let Some((recovery, unread)) = self.readable_recovery(&policy) else { return false };
        if let Some(error) = unread {
            let told = self.unreadable.insert(name.clone(), policy.clone());
            if told.as_ref() != Some(&policy) {
                self.event("policy-unreadable", format!("{error}; the default goes for {name}"));
            }
        }
        self.engines.insert(name.clone(), Engine { policy, recovery });
        true
    }

    /// Keeps one engine for each policy in use.
    pub(super) fn update_objectors(&mut self) {
        let in_use = |policy: &PolicyBytes| self.systems.values().any(|s| s.recovery == *policy);
        let mut objectors = core::mem::take(&mut self.objectors);
        objectors.retain(|engine| in_use(&engine.policy));
        for system in self.systems.values() {
            if !objectors.iter().any(|engine| engine.policy == system.recovery) {
                objectors.extend(self.make_engine(&system.recovery));
            }
        }
        self.objectors = objectors;
    }

    pub(super) fn make_engine(&self, policy: &PolicyBytes) -> Option<Engine> {
        let (recovery, _) = self.readable_recovery(policy)?;
        Some(Engine { policy: policy.clone(), recovery })
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
            engine.recovery.forget(key);
        }
    }

    /// Causes that hold here, for status and screens.
    pub(super) fn standing(&self) -> Vec<CauseStatus> {
        self.engines.values().flat_map(|engine| engine.recovery.standing()).collect()
    }
}

pub(super) fn millis(time: Duration) -> f64 {
    time.as_secs_f64() * 1000.0
}

/// Calls for help by component, for waiting and for status.
pub(super) type Calls = BTreeMap<ComponentKey, (Instant, String)>;
