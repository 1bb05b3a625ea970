//! The coordinator's judgement of robots that are not heard any more.

use alloc::{format, string::String, vec::Vec};

use super::Brain;
use crate::{
    event::Event,
    id::{ComponentKey, Name, RobotId},
    planted::{self, Defect},
    recover::{Cause, Evidence, Fault, Remedy, RobotEvidence},
    time::{Duration, Instant},
    units::{Bytes, Permille},
};

impl Brain {
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

    /// Components of `system` whose home is gone and which its policy wants elsewhere.
    pub(super) fn orphans(&self, now: Instant, system: &Name) -> Vec<(ComponentKey, String)> {
        let Some(running) = self.systems.get(system) else { return Vec::new() };
        let mut evidence = Vec::new();
        for spec in &running.components {
            let component = running.key(&spec.name);
            let Some(home) = self.home(&component) else { continue };
            let free = self.lease_is_over(now, home, spec);
            if !self.is_gone(home, now) || !free || !self.succession_is_over(now, &component) {
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
                robot: RobotEvidence::default(),
            });
        }
        if evidence.is_empty() {
            return Vec::new();
        }
        let policy = running.recovery.clone();
        // each look judges the absence anew: the plan, not the ladder, remembers attempts
        let Some(mut engine) = self.make_engine(&policy) else { return Vec::new() };
        let verdicts = engine.recovery.judge(now, &evidence);
        let leaves = verdicts.into_iter().filter(|verdict| match verdict.remedy {
            Remedy::StandbyElsewhere | Remedy::LaunchElsewhere => true,
            Remedy::LocalStandby | Remedy::Restart { .. } | Remedy::Hold => false,
        });
        leaves.map(|verdict| (verdict.component, verdict.reason)).collect()
    }
}
