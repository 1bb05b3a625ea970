//! Homes that a policy takes for gone sooner than the mesh does (`lost_after`).
//!
//! ```text
//!   home ──beat, beat──▶ coordinator, and those who follow it
//!                          │ silent for `lost_after`
//!                          ├──has anybody fresher news of it?──▶ others
//!                          └──no──▶ its components are placed anew, under new epochs
//! ```
//!
//! Rule 3 of the order: only when a third robot answered since, nobody who answered has
//! fresher news (that would end the silence), and the own loop was on time (the mesh moves its
//! windows after a pause). Of two robots the one left can ask nobody: it waits for the mesh.

use alloc::{
    collections::{BTreeMap, BTreeSet},
    format,
    string::String,
};

use super::Brain;
use crate::{
    event::Event,
    id::{ComponentKey, RobotId},
    mesh::BeatsFor,
    time::{Duration, Instant},
};

/// Answers to a question are waited for so long once one came.
const ANSWERS_FOR: Duration = Duration::from_millis(100);
/// A question that nobody answered is asked again.
const ASK_AGAIN: Duration = Duration::from_millis(150);
/// While a home is suspect it is looked at so often.
const LOOK_EVERY: Duration = Duration::from_millis(25);
/// Beats within the time after which a home is lost: some may be.
const BEATS_PER_LOSS: u32 = 5;
/// Fastest beats.
const BEAT_MIN: Duration = Duration::from_millis(50);
/// Followers of the coordinator that hear the beats, too: one of them takes over.
const FOLLOWERS_MAX: usize = 2;

/// Homes that are silent for longer than a policy wants.
#[derive(Clone, Debug, Default)]
pub(super) struct LostDesk {
    suspects: BTreeMap<RobotId, Instant>,
    lost: BTreeSet<RobotId>,
    pub(super) wake_at: Option<Instant>,
}

impl LostDesk {
    /// Homes that are lost by some policy.
    pub(super) fn doubted(&self) -> impl Iterator<Item = &RobotId> {
        self.lost.iter()
    }

    fn hear(&mut self, home: &RobotId) {
        self.suspects.remove(home);
        self.lost.remove(home);
    }

    fn wake_at(&mut self, at: Instant) {
        self.wake_at = Some(self.wake_at.map_or(at, |before| before.min(at)));
    }
}

impl Brain {
    /// The beats that this robot owes the coordinator for what is at home here.
    pub(super) fn beat_to_coordinator(&mut self) {
        let asked = self.objectors.iter().any(|one| one.engine.recovery().is_impatient());
        let keys = self.index.at(&self.me).filter(|_| asked);
        let shortest = keys.filter_map(|key| self.lost_after(key)).min();
        let mut beats: BTreeMap<RobotId, Duration> = BTreeMap::new();
        if let Some(after) = shortest {
            let period = (after / BEATS_PER_LOSS).max(BEAT_MIN);
            let holder = self.role().map(|role| role.holder.clone());
            let followers = self.succession().map(|said| said.order.clone()).unwrap_or_default();
            let heard = holder.into_iter().chain(followers.into_iter().take(FOLLOWERS_MAX));
            beats.extend(heard.filter(|robot| *robot != self.me).map(|robot| (robot, period)));
        }
        self.mesh.beat_to(BeatsFor::Coordinator, beats);
    }

    /// When the home of a component counts as gone for it, when its policy says so.
    pub(super) fn lost_after(&self, key: &ComponentKey) -> Option<Duration> {
        let system = self.systems.get(&key.system)?;
        let mut objectors = self.objectors.iter();
        let objector = objectors.find(|one| *one.engine.policy() == system.recovery)?;
        objector.engine.recovery().lost_after(key)
    }

    /// Looks at homes of systems whose policies are impatient.
    pub(super) fn watch_lost(&mut self, now: Instant) {
        self.lost.wake_at = None;
        let mut impatient: BTreeMap<RobotId, Duration> = BTreeMap::new();
        let asked = self.objectors.iter().any(|one| one.engine.recovery().is_impatient());
        let systems = self.systems.values().filter(|_| asked);
        for key in systems.flat_map(|system| system.keys()) {
            let Some(after) = self.lost_after(&key) else { continue };
            if let Some(home) = self.home(&key).filter(|home| **home != self.me) {
                let shortest = impatient.entry(home.clone()).or_insert(after);
                *shortest = after.min(*shortest);
            }
        }
        self.lost.suspects.retain(|home, _| impatient.contains_key(home));
        self.lost.lost.retain(|home| impatient.contains_key(home));
        for (home, after) in impatient {
            self.watch_home(now, &home, after);
        }
    }

    /// Whether a home is lost by the policy of a component.
    pub(super) fn is_lost(&self, now: Instant, key: &ComponentKey, home: &RobotId) -> bool {
        let silent = self.mesh.age(home, now);
        let after = self.lost_after(key);
        let late = after.zip(silent).is_some_and(|(after, silent)| silent >= after);
        late && self.lost.lost.contains(home)
    }

    /// Why nothing should go to robots that are alive for the mesh only.
    pub(super) fn lost_robots(&self) -> impl Iterator<Item = (RobotId, String)> + '_ {
        self.lost.lost.iter().map(|robot| (robot.clone(), String::from("is not heard")))
    }

    fn watch_home(&mut self, now: Instant, home: &RobotId, after: Duration) {
        let pair = self.mesh.authors().robots().count() <= 2;
        let Some(silent) = self.mesh.age(home, now).filter(|_| !pair) else { return };
        if silent < after {
            self.lost.hear(home);
            self.lost.wake_at(now + (after - silent));
            return;
        }
        if self.lost.lost.contains(home) || !self.mesh.is_alive(home) {
            return;
        }
        self.lost.wake_at(now + LOOK_EVERY);
        let Some(since) = self.lost.suspects.get(home).copied() else {
            self.lost.suspects.insert(home.clone(), now);
            self.mesh.ask_about(now, home);
            return;
        };
        if self.nobody_heard(now, home, since) && !self.mesh.is_isolated() {
            self.lost.lost.insert(home.clone());
            let text =
                format!("no news of {home} for {} ms, nobody knows more", silent.as_millis());
            let event = Event::new("robot-lost", &self.me, text);
            self.push_event(event.number("silent_ms", silent.as_secs_f64() * 1000.0));
        }
    }

    /// Whether others answered since; fresher news would have ended the silence.
    fn nobody_heard(&mut self, now: Instant, home: &RobotId, since: Instant) -> bool {
        let Some(inquiry) = self.mesh.inquiry(home).filter(|one| one.asked_at >= since) else {
            self.mesh.ask_about(now, home);
            return false;
        };
        let waited = now.since(inquiry.asked_at);
        if inquiry.answered == 0 && waited >= ASK_AGAIN {
            self.mesh.ask_about(now, home);
        }
        inquiry.answered > 0 && (inquiry.answered >= inquiry.asked || waited >= ANSWERS_FOR)
    }
}
