//! Questions to an allocator that are under way, and what to do with the answers.

use alloc::{
    collections::BTreeMap,
    string::{String, ToString},
    vec::Vec,
};

use crate::{
    allocate::{Plan, Refusal},
    id::{ComponentKey, Name, RobotId},
    input::PlanId,
    order::Version,
    recover::Cause,
    time::{Duration, Instant},
};

/// First pause after a plan that placed not everything.
const RETRY_MIN: Duration = Duration::from_millis(500);
/// Longest pause.
const RETRY_MAX: Duration = Duration::from_secs(10);

/// An answer that takes longer is not waited for.
const ANSWER_MAX: Duration = Duration::from_secs(10);

/// Why a plan was asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    /// Components that never had a home.
    Deploy,
    /// Components that should leave a robot that still works.
    Move { from: RobotId, cause: Cause, reason: String },
    /// Components that may have to leave it soon: their next home gets ready.
    Prepare { from: RobotId, cause: Cause, reason: String },
    /// Components whose home is gone.
    Rehome { reason: String },
    /// Components that wish for one more standby.
    Standby(Side),
}

/// Where a standby should be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    /// On the robot of its home.
    SameRobot,
    /// On another one.
    OtherRobot,
}

/// A question under way.
#[derive(Clone, Debug)]
pub(super) struct Asked {
    pub(super) plan: PlanId,
    pub(super) at: Instant,
    pub(super) system: Name,
    pub(super) purpose: Purpose,
    /// Versions of the items' assignments when the question was asked; a changed one makes
    /// the answer stale.
    pub(super) versions: Vec<(ComponentKey, Option<Version>)>,
}

/// When to ask again.
#[derive(Clone, Copy, Debug)]
struct Retry {
    at: Instant,
    pause: Duration,
}

/// Questions and answers of the coordinator.
#[derive(Clone, Debug, Default)]
pub(super) struct PlanDesk {
    last: PlanId,
    pub(super) asked: Option<Asked>,
    retries: BTreeMap<String, Retry>,
    pub(super) refusals: BTreeMap<ComponentKey, Vec<Refusal>>,
}

impl PlanDesk {
    pub(super) fn next_id(&mut self) -> PlanId {
        self.last += 1;
        self.last
    }

    /// Gives up on an answer that does not come.
    pub(super) fn give_up_late(&mut self, now: Instant) {
        self.asked.take_if(|asked| now.since(asked.at) >= ANSWER_MAX);
    }

    /// Whether a question about this may be asked now.
    pub(super) fn is_due(&self, system: &Name, purpose: &Purpose, now: Instant) -> bool {
        self.retries.get(&topic(system, purpose)).is_none_or(|retry| now >= retry.at)
    }

    /// A question was answered; when not all were placed, the next one waits longer.
    pub(super) fn answered(&mut self, asked: &Asked, plan: Option<&Plan>, now: Instant) {
        let topic = topic(&asked.system, &asked.purpose);
        if plan.is_some_and(|plan| plan.homeless.is_empty()) {
            self.retries.remove(&topic);
            return;
        }
        let pause = match self.retries.get(&topic) {
            Some(retry) => (retry.pause * 2).min(RETRY_MAX),
            None => RETRY_MIN,
        };
        self.retries.insert(topic, Retry { at: now + pause, pause });
    }

    /// The fleet changed: what did not fit may fit now.
    pub(super) fn retry_soon(&mut self) {
        self.retries.clear();
    }

    /// A system is another one now: what was refused before says nothing.
    pub(super) fn forget(&mut self, system: &Name) {
        let of_system = |topic: &String| topic.split('/').next() == Some(system.as_str());
        self.retries.retain(|topic, _| !of_system(topic));
    }

    /// Asks nothing for a while.
    pub(super) fn pause(&mut self, now: Instant) {
        for retry in self.retries.values_mut() {
            retry.at = now + retry.pause;
        }
    }

    pub(super) fn next_deadline(&self) -> Option<Instant> {
        let late = self.asked.as_ref().map(|asked| asked.at + ANSWER_MAX);
        self.retries.values().map(|retry| retry.at).chain(late).min()
    }
}

fn topic(system: &Name, purpose: &Purpose) -> String {
    let mut topic = system.to_string();
    match purpose {
        Purpose::Deploy => topic.push_str("/deploy"),
        Purpose::Move { from, cause, .. } => {
            topic.push_str("/move/");
            topic.push_str(from.as_str());
            topic.push_str(cause.word());
        }
        Purpose::Prepare { from, cause, .. } => {
            topic.push_str("/prepare/");
            topic.push_str(from.as_str());
            topic.push_str(cause.word());
        }
        Purpose::Rehome { .. } => topic.push_str("/rehome"),
        Purpose::Standby(Side::SameRobot) => topic.push_str("/standby/here"),
        Purpose::Standby(Side::OtherRobot) => topic.push_str("/standby"),
    }
    topic
}
