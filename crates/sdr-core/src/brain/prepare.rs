//! Getting ready for what is only foreseen: the next home prepares while a condition is still
//! held, so that the end of its time finds a target that only has to be activated.

use alloc::{format, string::String, vec::Vec};

use super::{
    Brain,
    decide::{leaving_reason, placed_reason},
    moves::MoveWatch,
    plans::{Asked, Purpose},
};
use crate::{
    allocate::Plan,
    id::{ComponentKey, RobotId},
    lifecycle::LifecycleState,
    recover::Cause,
    time::Instant,
};

/// What a home says of a component that has a target elsewhere.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Call {
    /// It must leave now.
    Due { cause: Cause, reason: String },
    /// It may have to leave soon.
    Foreseen,
    /// Nothing, or nothing any more.
    Over,
}

impl Brain {
    /// Names targets for what may have to leave.
    pub(super) fn prepare(&mut self, now: Instant, asked: &Asked, plan: &Plan) {
        let Purpose::Prepare { from, .. } = &asked.purpose else { return };
        let mut records = Vec::new();
        for placement in &plan.placements {
            let key = &placement.component;
            // what does not run cannot be handed over
            let runs = self
                .instance_report(from, key)
                .is_some_and(|report| report.state == LifecycleState::Active);
            let reason = placed_reason(asked, placement);
            let target = &placement.robot;
            let Some(record) = self.with_target(key, target, &reason).filter(|_| runs) else {
                continue;
            };
            records.push(record);
            self.moves.insert(key.clone(), MoveWatch::foreseen(now, from));
            let text = format!("{from} -> {}: {reason}", placement.robot);
            self.event_about("move-foreseen", key, text);
        }
        if !records.is_empty() {
            self.mint(records, None);
        }
    }

    /// How urgent it is that a component leaves its home.
    pub(super) fn call_for(&self, key: &ComponentKey) -> Call {
        let Some(home) = self.home(key) else { return Call::Over };
        let mut call = Call::Over;
        for (robot, condition) in self.calls_for_help(&key.system) {
            if robot != *home || !condition.components.contains(&key.name) {
                continue;
            }
            if !condition.foreseen {
                return Call::Due { cause: condition.cause, reason: condition.reason };
            }
            call = Call::Foreseen;
        }
        call
    }

    /// A foreseen move became due: from here on it is a move like any other.
    pub(super) fn start_foreseen(
        &mut self,
        now: Instant,
        key: &ComponentKey,
        target: &RobotId,
        reason: &str,
    ) {
        let Some(from) = self.home(key).cloned() else { return };
        let until = now + self.not_back_for(key);
        self.left.insert((key.clone(), from.clone()), until);
        self.event_about("move-started", key, format!("{from} -> {target}: {reason}"));
    }

    /// The reason of an assignment whose target was prepared early, with what is true now.
    pub(super) fn reason_now(&self, key: &ComponentKey) -> String {
        let said = self.wanted(key).map(|(_, assignment)| assignment.reason.clone());
        let said = said.unwrap_or_default();
        match (self.call_for(key), self.home(key), said.split_once("; ")) {
            (Call::Due { cause, reason }, Some(from), Some((_, rest))) => {
                leaving_reason(from, cause, &reason) + rest
            }
            (Call::Due { .. } | Call::Foreseen | Call::Over, _, _) => said,
        }
    }
}
