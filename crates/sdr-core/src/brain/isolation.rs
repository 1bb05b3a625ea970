//! Rule 8: isolation is a lease. A home whose component must not act alone asks others for a
//! sign that they hear it; without one for long enough it deactivates, and whoever gives the
//! component a new home waits longer than that.

use alloc::format;

use super::Brain;
use crate::{
    id::{ComponentKey, RobotId},
    planted::{self, Defect},
    spec::{ComponentSpec, IsolationAction},
    time::{Duration, Instant},
};

/// Signs are asked for so often within the time that may pass without one.
const ASKS_PER_LEASE: u32 = 3;
/// Fastest asking.
const ASK_EVERY_MIN: Duration = Duration::from_millis(300);
/// A question that nobody answered is asked again.
const ASK_AGAIN: Duration = Duration::from_millis(400);
/// Answers are looked for so long after the question.
const ANSWERS_AFTER: [Duration; 2] = [Duration::from_millis(60), Duration::from_millis(200)];
/// After isolation, signs must have come for so long: a new home may have been chosen.
const REGAIN: Duration = Duration::from_secs(2);
/// What was adopted while it acts may go on so long without a first sign: its component went
/// on for at most as long without an agent, and a successor waits for [`MARGIN`].
const ADOPTION_GRACE: Duration = Duration::from_millis(400);
/// A successor waits so much longer than the lease: clocks drift, timers are late.
const MARGIN: Duration = Duration::from_secs(1);

/// The lease of this robot.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Lease {
    asked_at: Option<Instant>,
    /// When it said the last that others are known to have heard.
    acked_at: Option<Instant>,
    /// Since when signs come without a gap, after one that was too long.
    since: Option<Instant>,
    pub(super) wake_at: Option<Instant>,
}

impl Lease {
    fn is_answered(&self) -> bool {
        self.asked_at.is_some() && self.acked_at >= self.asked_at
    }

    /// From one question to the next.
    fn pause(&self, after: Duration) -> Duration {
        let every = (after / ASKS_PER_LEASE).max(ASK_EVERY_MIN);
        if self.is_answered() { every } else { every.min(ASK_AGAIN) }
    }

    /// When to look for answers: a home that waits for its first sign should not wait longer.
    fn answers_at(&self) -> impl Iterator<Item = Instant> + use<> {
        let asked_at = self.asked_at.filter(|_| !self.is_answered());
        asked_at.into_iter().flat_map(|at| ANSWERS_AFTER.map(|after| at + after))
    }
}

impl Brain {
    /// Asks for signs while a component here depends on them.
    pub(super) fn keep_lease(&mut self, now: Instant) {
        self.lease.wake_at = None;
        let Some(after) = self.shortest_lease() else {
            self.lease = Lease::default();
            return;
        };
        self.take_sign(now, after);
        let pause = self.lease.pause(after);
        let due = self.lease.asked_at.map_or(now, |at| at + pause);
        if now >= due {
            self.lease.asked_at = Some(now);
            let me = self.me.clone();
            self.mesh.ask_about(now, &me);
        }
        let next = self.lease.asked_at.map_or(now, |at| at + self.lease.pause(after));
        let answers = self.lease.answers_at();
        let ends = self.lease.acked_at.map(|at| at + after);
        let regained = self.lease.since.map(|at| at + REGAIN);
        let first = self.lease.acked_at.is_none().then(|| self.started_at + ADOPTION_GRACE);
        let ahead = ends.into_iter().chain(regained).chain(answers).chain(first);
        let ahead = ahead.filter(|at| *at > now);
        self.lease.wake_at = ahead.chain([next]).min();
    }

    fn take_sign(&mut self, now: Instant, after: Duration) {
        let Some(inquiry) = self.mesh.inquiry(&self.me) else { return };
        if inquiry.answered == 0 || self.lease.acked_at.is_some_and(|at| at >= inquiry.asked_at) {
            return;
        }
        // the first sign of all is no return: what is remembered was compared before (`may_begin`)
        if self.lease.acked_at.is_some_and(|at| now >= at + after) {
            self.lease.since = Some(now);
        }
        self.lease.acked_at = Some(inquiry.asked_at);
    }

    /// The shortest time that a component here may act without a sign of others.
    fn shortest_lease(&self) -> Option<Duration> {
        let mine = self.index.at(&self.me).filter_map(|key| self.leased_for(key));
        mine.min()
    }

    /// How long a component may act without a sign of others; `None`: as long as it likes.
    fn leased_for(&self, key: &ComponentKey) -> Option<Duration> {
        let spec = self.systems.get(&key.system)?.component(&key.name)?;
        leased_for(spec)
    }

    /// Whether a component whose home is here may act now.
    pub(super) fn may_act(&self, now: Instant, key: &ComponentKey) -> bool {
        let Some(after) = self.leased_for(key).filter(|_| !self.is_only_robot()) else {
            return true;
        };
        let acked = self.lease.acked_at.is_some_and(|at| now < at + after)
            || planted::is(Defect::LeaseNeverEnds);
        // the first sign after an isolation is not enough
        let lasting = self.lease.since.is_none_or(|at| now >= at + REGAIN);
        let acts = self.current(key).is_some_and(|id| self.instances[&id].is_told_to_act());
        let graced = self.lease.acked_at.is_none() && now < self.started_at + ADOPTION_GRACE;
        (acked && (acts || lasting)) || (acts && graced)
    }

    /// A fleet of one: nobody could take over.
    pub(super) fn is_only_robot(&self) -> bool {
        self.seeds_of_others == 0 && self.mesh.authors().count() <= 1
    }

    /// A fleet of one for ever: it looks for nobody either.
    pub(super) fn is_surely_alone(&self) -> bool {
        self.is_only_robot() && self.config.group.is_none()
    }

    /// Stops what must not act alone.
    pub(super) fn stop_isolated(&mut self, now: Instant, key: &ComponentKey) {
        let silent = self.lease.acked_at.map(|at| now.since(at).as_millis());
        let text = match silent {
            Some(silent) => format!("no sign of others for {silent} ms: deactivated"),
            None => "no sign of others yet: stays inactive".into(),
        };
        self.event_about("isolated-deactivated", key, text);
    }

    /// Whether a home has been silent for so long that its lease is over for certain.
    pub(super) fn lease_is_over(&self, now: Instant, home: &RobotId, spec: &ComponentSpec) -> bool {
        let Some(after) = leased_for(spec).filter(|_| !planted::is(Defect::LeaseNotAwaited)) else {
            return true;
        };
        let silent = self.mesh.age(home, now).unwrap_or_else(|| now.since(self.started_at));
        silent >= after + MARGIN
    }
}

fn leased_for(spec: &ComponentSpec) -> Option<Duration> {
    match spec.on_isolation.action {
        IsolationAction::Deactivate => Some(spec.on_isolation.after),
        IsolationAction::Continue => None,
    }
}
