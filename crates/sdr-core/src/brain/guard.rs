//! Beats between a home and its standbys, and the succession when they stop.
//!
//! ```text
//!   home ──beat, beat, beat──▶ first standby, second standby, ...
//!                                │ silent for one window (two for the second, ...)
//!                                ├──has anybody fresher news of it?──▶ others
//!                                └──no──▶ next epoch, home here, active; the coordinator follows
//! ```
//!
//! Rule 3 of the order: a standby mints only when somebody else answered it since, nobody who
//! answered has fresher news of the home, and its own loop was on time.

use alloc::{
    collections::{BTreeMap, BTreeSet},
    format,
    vec::Vec,
};

use super::{Brain, moves::Old};
use crate::{
    fitness::{Alone, misses_at},
    id::{ComponentKey, RobotId},
    mesh::{BeatsFor, FleetRecord},
    planted::{self, Defect},
    recover::GuardPolicy,
    time::{Duration, Instant},
};

/// Answers to a question are waited for so long once one came.
const ANSWERS_FOR: Duration = Duration::from_millis(100);
/// A question that nobody answered is asked again.
const ASK_AGAIN: Duration = Duration::from_millis(80);
/// While a home is suspect it is looked at so often.
const LOOK_EVERY: Duration = Duration::from_millis(10);
/// After all windows the coordinator waits this much longer before it decides for a standby.
const COORDINATOR_AFTER: Duration = Duration::from_secs(1);

/// What a standby remembers of the homes it follows.
#[derive(Clone, Debug, Default)]
pub(super) struct GuardDesk {
    looked_at: Option<Instant>,
    /// Silence counts from here at the earliest: the own loop was late before.
    on_time_since: Instant,
    suspects: BTreeMap<RobotId, Instant>,
    pub(super) wake_at: Option<Instant>,
}

/// A component whose home is elsewhere and that stands by here.
struct Followed {
    key: ComponentKey,
    home: RobotId,
    /// Standbys before this one, as far as they live.
    place: u32,
    window: Duration,
    policy: GuardPolicy,
}

impl Brain {
    /// The beats that this robot owes those who stand by for what runs here.
    pub(super) fn keep_beats(&mut self) {
        let mut beats: BTreeMap<RobotId, Duration> = BTreeMap::new();
        for key in self.index.at(&self.me) {
            let Some((_, assignment)) = self.wanted(key) else { continue };
            let standbys = assignment.standbys.iter().filter(|robot| **robot != self.me);
            for robot in standbys {
                let period = self.guard_policy(key).period;
                let known = beats.entry(robot.clone()).or_insert(period);
                *known = period.min(*known);
            }
        }
        self.mesh.beat_to(BeatsFor::Standbys, beats);
    }

    fn guard_policy(&self, key: &ComponentKey) -> GuardPolicy {
        let system = self.systems.get(&key.system);
        let made = system.and_then(|system| {
            let mut objectors = self.objectors.iter();
            objectors.find(|objector| *objector.engine.policy() == system.recovery)
        });
        made.map_or_else(GuardPolicy::default, |objector| objector.engine.recovery().guard())
    }

    /// Looks at the homes that this robot follows.
    pub(super) fn watch_homes(&mut self, now: Instant) {
        if self.guard.wake_at.is_some_and(|at| now < at) {
            return;
        }
        let followed = self.followed();
        let Some(period) = followed.iter().map(|one| one.policy.period).min() else {
            self.guard = GuardDesk::default();
            return;
        };
        let late = self.guard.looked_at.is_none_or(|at| now.since(at) > period * 3 / 2);
        if late || self.mesh.is_isolated() {
            self.guard.on_time_since = now;
        }
        self.guard.looked_at = Some(now);
        self.guard.wake_at = Some(now + period);
        let homes: BTreeSet<&RobotId> = followed.iter().map(|one| &one.home).collect();
        self.guard.suspects.retain(|robot, _| homes.contains(robot));
        let due: Vec<&Followed> = followed.iter().filter(|one| self.is_due(now, one)).collect();
        if !due.is_empty() {
            self.promote(now, &due);
        }
    }

    /// What stands by here, its instance ready or only its place kept.
    fn followed(&self) -> Vec<Followed> {
        let keys = self.index.beside(&self.me);
        // What drives a body and stopped stays where it is.
        let keys = keys.filter(|key| self.latched(key).is_none());
        keys.filter_map(|key| {
            let (_, assignment) = self.wanted(key)?;
            let place = assignment.standbys.iter().position(|robot| *robot == self.me)?;
            let before = assignment.standbys[..place].iter();
            let lives = |robot: &&RobotId| **robot != assignment.home && self.mesh.is_alive(robot);
            let policy = self.guard_policy(key);
            Some(Followed {
                key: key.clone(),
                home: assignment.home.clone(),
                place: u32::try_from(before.filter(lives).count()).unwrap_or(u32::MAX),
                window: self.guard_window(&assignment.home, policy),
                policy,
            })
        })
        .collect()
    }

    /// How long a home may be silent: its beats, with what its link loses, delays and jitters.
    fn guard_window(&self, home: &RobotId, policy: GuardPolicy) -> Duration {
        let link = self.mesh.link(home).unwrap_or_default();
        policy.period * misses_at(policy.misses, link.loss) + link.rtt / 2 + link.jitter * 4
    }

    /// Whether the time to follow a home has come, after asking others for news of it.
    fn is_due(&mut self, now: Instant, one: &Followed) -> bool {
        if let Some(until) = self.held_until(now, &one.home) {
            self.guard.suspects.remove(&one.home);
            self.wake_guard(until);
            return false;
        }
        // a planned restart of its agent: its components go on
        if let Some(until) = self.held_until(now, &one.home) {
            self.guard.suspects.remove(&one.home);
            self.wake_guard(until);
            return false;
        }
        let age = self.mesh.age(&one.home, now).unwrap_or_else(|| now.since(self.started_at));
        let silent = age.min(now.since(self.guard.on_time_since));
        let pair = self.mesh.authors().count() <= 2;
        let window = if pair { self.mesh.patience().0 } else { one.window };
        if silent < window {
            self.guard.suspects.remove(&one.home);
            self.wake_guard(now + (window - silent));
            return false;
        }
        self.wake_guard(now + LOOK_EVERY);
        let Some(since) = self.guard.suspects.get(&one.home).copied() else {
            self.guard.suspects.insert(one.home.clone(), now);
            self.mesh.ask_about(now, &one.home);
            return false;
        };
        let turn = since + window * one.place;
        let Some(spec) = self.spec_of(&one.key) else { return false };
        let free = self.lease_is_over(now, &one.home, spec) && self.may_begin(now);
        let able = !self.desk.is_broken() && self.may_follow(&one.key);
        if now < turn || !free || !able {
            return false;
        }
        match (pair, planted::is(Defect::NoWitness)) {
            (_, true) => true,
            (true, false) => one.policy.alone == Alone::Promote && !self.mesh.is_isolated(),
            (false, false) => self.nobody_knows_better(now, &one.home, since),
        }
    }

    /// A hot standby follows when its instance is ready, a cold one when it may launch.
    fn may_follow(&self, key: &ComponentKey) -> bool {
        !self.stands_by_hot(key) || self.current(key).is_some_and(|id| self.instances[&id].ready)
    }

    /// Whether others answered since, and none of them had fresher news (that would have ended
    /// the silence).
    fn nobody_knows_better(&mut self, now: Instant, home: &RobotId, since: Instant) -> bool {
        let inquiry = self.mesh.inquiry(home).filter(|one| one.asked_at >= since);
        let Some(inquiry) = inquiry else {
            self.mesh.ask_about(now, home);
            return false;
        };
        let waited = now.since(inquiry.asked_at);
        if inquiry.answered == 0 && waited >= ASK_AGAIN {
            self.mesh.ask_about(now, home);
        }
        inquiry.answered > 0 && (inquiry.answered >= inquiry.asked || waited >= ANSWERS_FOR)
    }

    fn wake_guard(&mut self, at: Instant) {
        self.guard.wake_at = Some(self.guard.wake_at.map_or(at, |before| before.min(at)));
    }

    /// Becomes the home: at once when its epochs are reserved, else when they are on disk.
    fn promote(&mut self, now: Instant, due: &[&Followed]) {
        let mut records: Vec<FleetRecord> = Vec::new();
        let mut reserved = true;
        for one in due {
            let silent = self.mesh.age(&one.home, now).unwrap_or_default().as_millis();
            let text = format!("{} is silent for {silent} ms; standby here", one.home);
            let me = self.me.clone();
            let Some(record) = self.new_home(&one.key, &me, text.clone(), Old::Stops) else {
                continue;
            };
            let epoch =
                record.version.epoch.clone().unwrap_or_else(|| self.next_epoch(&one.key, None));
            reserved &= self.is_reserved(&one.key, &epoch) || planted::is(Defect::EpochNotReserved);
            self.note_minted(&one.key, &epoch);
            let event = self.event_of_promotion(&one.key, text);
            #[expect(clippy::cast_precision_loss, reason = "silences are short")]
            let silent_ms = silent as f64;
            self.push_event(event.number("silent_ms", silent_ms));
            records.push(record);
        }
        if reserved {
            self.mesh.publish(records);
            self.desk.mark_urgent();
            self.take_news(now);
        } else {
            self.mint(records, None);
        }
        // every home that was left needs a new silence
        self.guard.on_time_since = now;
    }

    /// Whether all standbys of a gone home had their turn, so that the coordinator may choose.
    pub(super) fn succession_is_over(&self, now: Instant, key: &ComponentKey) -> bool {
        let Some((_, assignment)) = self.wanted(key) else { return true };
        let others = assignment.standbys.iter().filter(|robot| **robot != assignment.home);
        let living = others.filter(|robot| self.mesh.is_alive(robot)).count();
        let Ok(living) = u32::try_from(living) else { return true };
        let window = self.guard_window(&assignment.home, self.guard_policy(key));
        let age = self.mesh.age(&assignment.home, now);
        let silent = age.unwrap_or_else(|| now.since(self.started_at));
        living == 0 || silent >= window * (living + 1) + COORDINATOR_AFTER
    }
}
