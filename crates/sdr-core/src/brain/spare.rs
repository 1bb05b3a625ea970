//! A second instance on the home itself: ready to act when the first one fails.

use alloc::{format, vec::Vec};

use super::{Brain, instances::PREPARE_AGAIN};
use crate::{
    event::Event,
    id::ComponentKey,
    input::InstanceId,
    lifecycle::LifecycleState,
    recover::{Cause, RemedyOutcome, Verdict},
    time::{Duration, Instant},
};

/// Longest pause before a spare that keeps failing is started again.
const PAUSE_MAX: Duration = Duration::from_secs(30);

/// When the next spare may be started.
#[derive(Clone, Copy, Debug)]
pub(super) struct SparePlan {
    pub(super) at: Instant,
    pause: Duration,
}

impl Brain {
    /// Whether a second instance should be ready here.
    fn wants_spare(&self, key: &ComponentKey) -> bool {
        let here = self.wanted(key).is_some_and(|(_, assignment)| {
            assignment.home == self.me && assignment.stands_by_at_home()
        });
        here && self.stands_by_hot(key)
    }

    /// Instances beside the one that acts.
    fn spares(&self, key: &ComponentKey) -> Vec<InstanceId> {
        let current = self.current(key);
        self.staying(key).filter(|id| Some(*id) != current).collect()
    }

    /// Keeps a second instance ready, or none.
    pub(super) fn keep_spare(&mut self, now: Instant, key: &ComponentKey) {
        let spares = self.spares(key);
        if !self.wants_spare(key) {
            self.spare_plans.remove(key);
            spares.into_iter().for_each(|id| self.finish(id));
            return;
        }
        for id in spares {
            if self.is_old_edition(id, key) {
                self.finish(id);
            }
        }
        // the one that takes over goes first
        let acts = self.current(key).is_some_and(|id| {
            let instance = &self.instances[&id];
            instance.is_told_to_act() && instance.state == LifecycleState::Active
        });
        let due = self.spare_plans.get(key).is_none_or(|plan| now >= plan.at);
        // the one before still takes its memory until it has ended
        let alone = self.instances.values().filter(|one| one.component == *key).count() == 1;
        if acts && due && alone {
            self.launch(key);
        }
    }

    /// Whether an instance here could act at once in place of one that failed.
    pub(super) fn spare_is_ready(&self, key: &ComponentKey) -> bool {
        let able = |id: InstanceId| {
            let instance = &self.instances[&id];
            let idle = !instance.is_told_to_act() && instance.state == LifecycleState::Inactive;
            idle && instance.ready
        };
        self.wants_spare(key) && self.staying(key).any(able)
    }

    /// A second instance ended or failed by itself; the first one is well.
    pub(super) fn spare_failed(&mut self, key: &ComponentKey) {
        let pause = match self.spare_plans.get(key) {
            Some(plan) => (plan.pause * 2).min(PAUSE_MAX),
            None => PREPARE_AGAIN,
        };
        let at = self.handled_at + pause;
        self.spare_plans.insert(key.clone(), SparePlan { at, pause });
    }

    /// The faulty instance ends, the spare takes over: the next look at what should be here
    /// activates it.
    pub(super) fn switch_here(&mut self, verdict: &Verdict) -> RemedyOutcome {
        let key = &verdict.component;
        if !self.spare_is_ready(key) {
            return RemedyOutcome::Refused;
        }
        self.held.remove(key);
        self.failed.remove(key);
        self.call_off(key);
        self.end_faulty(key, verdict.cause);
        let text = format!("{}: {}", verdict.cause, verdict.reason);
        self.push_event(Event::new("local-standby", &self.me, text).about(key));
        RemedyOutcome::Done
    }

    /// Ends the instance that is in trouble; one that only stands by stays.
    pub(super) fn end_faulty(&mut self, key: &ComponentKey, cause: Cause) {
        let in_trouble = |id: &InstanceId| {
            let instance = &self.instances[id];
            instance.is_told_to_act() || instance.state == LifecycleState::Error
        };
        let faulty = self.staying(key).find(in_trouble);
        let only = self.current(key).filter(|_| !self.wants_spare(key));
        if let Some(id) = faulty.or(only) {
            if cause == Cause::Hung {
                self.kill(id);
            } else {
                self.finish(id);
            }
        }
    }
}
