//! The coordinator's judgement of robots that are not heard any more.

use alloc::{collections::BTreeSet, format, string::String, sync::Arc, vec::Vec};

use super::Brain;
use crate::{
    event::Event,
    id::{ComponentKey, Name, RobotId},
    planted::{self, Defect},
    record::{FleetKey, RecordKind},
    recover::{Cause, Evidence, Fault, Remedy, RobotEvidence},
    time::{Duration, Instant},
    units::{Bytes, Permille},
};

/// Answers to a question about a home are waited for so long ...
const ANSWERS_FOR: Duration = Duration::from_millis(250);
/// ... and when nobody answered, it is asked again.
const ASK_AGAIN: Duration = Duration::from_millis(100);
/// Older answers are none.
const ANSWERS_KEPT: Duration = Duration::from_secs(3);

/// Who chose a home heard it: whoever learns of the choice gives the home so long to be heard
/// here too, before it is judged by older news.
const HOME_SPEAKS_WITHIN: Duration = Duration::from_secs(2);

impl Brain {
    /// Another robot chose a home.
    pub(super) fn note_home(&mut self, now: Instant, key: &FleetKey) {
        if key.kind != RecordKind::ASSIGNMENT {
            return;
        }
        let Some(fact) = self.mesh.fleet().fact(key) else { return };
        if let Some(assignment) = fact.assignment()
            && fact.version().author != self.me
            && !self.mesh.is_alive(&assignment.home)
        {
            self.homes_told.retain(|_, until| now < *until);
            self.homes_told.insert(assignment.component.clone(), now + HOME_SPEAKS_WITHIN);
        }
    }

    pub(super) fn note_gone(&mut self, now: Instant, robot: &RobotId) {
        let age = self.mesh.age(robot, now).unwrap_or(Duration::ZERO);
        let text = format!("no fresh news of {robot} for {} ms", age.as_millis());
        let event = Event::new("robot-gone", &self.me, text);
        self.push_event(event.number("silent_ms", age.as_secs_f64() * 1000.0));
    }

    /// Whether a robot was heard and is silent now; one that was never heard since the start
    /// gets the same time to speak.
    pub(super) fn is_gone(&self, robot: &RobotId, now: Instant) -> bool {
        if planted::is(Defect::GoneIgnored) {
            return false;
        }
        let waited = now >= self.started_at + self.config.gone_after;
        !self.mesh.is_alive(robot) && (waited || self.mesh.age(robot, now).is_some())
    }

    /// Whether a home that somebody else chose lately still has time to speak.
    fn is_just_told(&self, component: &ComponentKey, now: Instant) -> bool {
        self.homes_told.get(component).is_some_and(|until| now < *until)
    }

    /// Rule 3: whether others were asked, and none has fresher news of this home.
    fn is_missed_by_all(&mut self, now: Instant, home: &RobotId) -> bool {
        if self.mesh.alive().next().is_none() {
            return true;
        }
        let inquiry = self.mesh.inquiry(home);
        let inquiry = inquiry.filter(|one| now.since(one.asked_at) < ANSWERS_KEPT);
        let waited = inquiry.map(|one| now.since(one.asked_at));
        let answered = inquiry.map_or(0, |one| one.answered);
        let all = inquiry.is_some_and(|one| one.answered >= one.asked);
        if answered > 0 && (all || waited >= Some(ANSWERS_FOR)) {
            return true;
        }
        if waited.is_none_or(|waited| waited >= ASK_AGAIN) {
            self.mesh.ask_about(now, home);
        }
        self.look_at = self.look_at.min(now + ASK_AGAIN);
        false
    }

    /// Orphans whose homes others miss, too.
    pub(super) fn missed_orphans(
        &mut self,
        now: Instant,
        system: &Name,
    ) -> Vec<(ComponentKey, String)> {
        let mut orphans = self.orphans(now, system);
        let homes: BTreeSet<RobotId> =
            orphans.iter().filter_map(|(key, _)| self.home(key).cloned()).collect();
        let missed: BTreeSet<RobotId> =
            homes.into_iter().filter(|home| self.is_missed_by_all(now, home)).collect();
        orphans.retain(|(key, _)| self.home(key).is_some_and(|home| missed.contains(home)));
        orphans
    }

    /// Components of `system` whose home is gone and which its policy wants elsewhere.
    fn orphans(&self, now: Instant, system: &Name) -> Vec<(ComponentKey, String)> {
        let Some(running) = self.systems.get(system) else { return Vec::new() };
        let mut evidence = Vec::new();
        for spec in &running.components {
            let component = running.key(&spec.name);
            let Some(home) = self.home(&component) else { continue };
            let gone = self.is_gone(home, now) && !self.is_just_told(&component, now)
                || self.is_lost(now, &component, home);
            let free = self.lease_is_over(now, home, spec);
            if !gone || !free || !self.succession_is_over(now, &component) {
                continue;
            }
            // What drives a body stays where it stopped until somebody resets it.
            if self.latched(&component).is_some() {
                continue;
            }
            let reason = format!("{home} is not heard any more");
            let backed = !self.ready_standbys(&component).is_empty();
            evidence.push(Evidence {
                component,
                actuator: spec.actuator,
                fault: Some(Fault { cause: Cause::RobotGone, reason }),
                standby_here: false,
                standby_elsewhere: backed,
                memory: Bytes(0),
                cpu: Permille(0),
                cpu_limit: spec.needs.cpu,
                deadlines_missed: 0,
                inputs_late: 0,
                told: Vec::new(),
                robot: RobotEvidence::default(),
            });
        }
        if evidence.is_empty() {
            return Vec::new();
        }
        let policy = Arc::clone(&running.recovery);
        // each look judges the absence anew: the plan, not the ladder, remembers attempts
        let Some(mut engine) = self.make_engine(&policy) else { return Vec::new() };
        let verdicts = engine.with(|recovery| recovery.judge(now, &evidence));
        let leaves = verdicts.into_iter().filter(|verdict| match verdict.remedy {
            Remedy::StandbyElsewhere | Remedy::LaunchElsewhere => true,
            Remedy::LocalStandby | Remedy::Restart { .. } | Remedy::Hold => false,
        });
        leaves.map(|verdict| (verdict.component, verdict.reason)).collect()
    }
}
