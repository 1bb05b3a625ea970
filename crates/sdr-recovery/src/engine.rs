//! The engine of one system: each component goes to those that have the same rules.

use alloc::{
    boxed::Box,
    collections::{BTreeMap, BTreeSet},
    format,
    string::String,
    vec,
    vec::Vec,
};
use core::time::Duration;

use sdr_core::{
    id::ComponentKey,
    recover::{
        Cause, CauseStatus, Evidence, Foresight, GuardPolicy, HangLimit, Program, Recovery,
        RemedyOutcome, RobotEvidence, Verdict,
    },
    spec::PolicyBytes,
    time::Instant,
};

use crate::{
    group::Group,
    policy::{Policy, Trigger},
};

/// Makes the engine of a policy, as the brain takes it; the error is for people.
pub fn make(policy: &PolicyBytes) -> Result<Box<dyn Recovery + Send>, String> {
    match Policy::decode(policy) {
        Ok(read) => Ok(Box::new(Engine::new(read))),
        Err(error) => Err(format!("recovery policy `{}`: {error}", policy.name)),
    }
}

/// Judges the components of one system by a policy.
#[derive(Debug)]
pub struct Engine {
    /// The first is for all without exceptions.
    groups: Vec<Group>,
    /// Components with exceptions, and their group.
    exceptions: BTreeMap<String, usize>,
}

impl Engine {
    /// An engine at rest.
    pub fn new(policy: Policy) -> Self {
        let mut groups = vec![Group::new(policy.for_component(""))];
        let mut exceptions = BTreeMap::new();
        for exception in &policy.parts().exceptions {
            exceptions.insert(exception.component.clone(), groups.len());
            groups.push(Group::new(policy.for_component(&exception.component)));
        }
        Self { groups, exceptions }
    }

    fn number(&self, component: &ComponentKey) -> usize {
        self.exceptions.get(component.name.as_str()).copied().unwrap_or(0)
    }

    fn group(&self, component: &ComponentKey) -> &Group {
        &self.groups[self.number(component)]
    }

    fn group_mut(&mut self, component: &ComponentKey) -> &mut Group {
        let number = self.number(component);
        &mut self.groups[number]
    }

    fn trigger(&self, component: &ComponentKey, cause: Cause) -> Option<&Trigger> {
        let rules = &self.group(component).policy().parts().rules;
        rules.iter().find(|rule| rule.cause == cause).map(|rule| &rule.trigger)
    }
}

impl Recovery for Engine {
    fn judge(&mut self, now: Instant, evidence: &[Evidence]) -> Vec<Verdict> {
        if let [only] = self.groups.as_mut_slice() {
            return only.judge(now, evidence);
        }
        let mut parts: Vec<Vec<Evidence>> = vec![Vec::new(); self.groups.len()];
        for one in evidence {
            parts[self.number(&one.component)].push(one.clone());
        }
        let judged = self.groups.iter_mut().zip(&parts);
        judged.flat_map(|(group, part)| group.judge(now, part)).collect()
    }

    fn outcome(&mut self, now: Instant, component: &ComponentKey, outcome: RemedyOutcome) {
        self.group_mut(component).outcome(now, component, outcome);
    }

    fn forget(&mut self, component: &ComponentKey) {
        self.group_mut(component).forget(component);
    }

    fn next_deadline(&self) -> Option<Instant> {
        self.groups.iter().filter_map(Group::next_deadline).min()
    }

    fn standing(&self) -> Vec<CauseStatus> {
        self.groups.iter().flat_map(Group::standing).collect()
    }

    fn foreseen(&self) -> Vec<Foresight> {
        self.groups.iter().flat_map(Group::foreseen).collect()
    }

    fn has_rule(&self, component: &ComponentKey, cause: Cause) -> bool {
        self.trigger(component, cause).is_some()
    }

    fn is_latched(&self, component: &ComponentKey) -> bool {
        self.group(component).is_latched(component)
    }

    fn hang_limit(&self, component: &ComponentKey) -> Option<HangLimit> {
        match self.trigger(component, Cause::Hung)? {
            Trigger::Silent(limit) => Some(*limit),
            Trigger::Fault
            | Trigger::Condition(_)
            | Trigger::Lost(_)
            | Trigger::Expression(..)
            | Trigger::Program(..) => None,
        }
    }

    fn is_impatient(&self) -> bool {
        let rules = self.groups.iter().flat_map(|group| &group.policy().parts().rules);
        rules.into_iter().any(|rule| matches!(rule.trigger, Trigger::Lost(_)))
    }

    fn lost_after(&self, component: &ComponentKey) -> Option<Duration> {
        match self.trigger(component, Cause::RobotGone)? {
            Trigger::Lost(time) => Some(*time),
            Trigger::Fault
            | Trigger::Condition(_)
            | Trigger::Silent(_)
            | Trigger::Expression(..)
            | Trigger::Program(..) => None,
        }
    }

    fn programs(&self, component: &ComponentKey) -> Vec<(Program, Vec<Cause>)> {
        let mut programs: BTreeMap<Program, BTreeSet<Cause>> = BTreeMap::new();
        for rule in &self.group(component).policy().parts().rules {
            if let Trigger::Program(program, _) = &rule.trigger {
                programs.entry(program.clone()).or_default().insert(rule.cause);
            }
        }
        programs.into_iter().map(|(program, causes)| (program, Vec::from_iter(causes))).collect()
    }

    fn is_event(&self, component: &ComponentKey, cause: Cause) -> bool {
        let trigger = self.trigger(component, cause);
        trigger.is_none_or(|trigger| trigger.condition().is_none())
    }

    fn objection(&self, robot: &RobotEvidence) -> Option<(Cause, String)> {
        self.groups[0].objection(robot)
    }

    fn not_back_for(&self, component: &ComponentKey) -> Duration {
        self.group(component).policy().parts().limits.not_back_for
    }

    fn guard(&self) -> GuardPolicy {
        self.groups[0].policy().parts().limits.guard
    }
}
