//! The coordinator role, simple form: the fittest alive takes it when nobody alive holds it.

use alloc::{format, string::String, vec};

use super::Brain;
use crate::{
    event::Event,
    id::RobotId,
    mesh::FleetRecord,
    order::Version,
    planted::{self, Defect},
    record::{FleetValue, RecordKind, RoleRecord},
    report::RolePreference,
    time::Instant,
};

impl Brain {
    pub(super) fn role(&self) -> Option<&RoleRecord> {
        match self.mesh.fleet().get(RecordKind::ROLE, "")? {
            (_, FleetValue::Role(role)) => Some(role),
            (_, _) => None,
        }
    }

    pub(super) fn term(&self) -> u64 {
        self.role().map_or(0, |role| role.term)
    }

    pub(super) fn is_coordinator(&self) -> bool {
        self.role().is_some_and(|role| role.holder == self.me)
    }

    /// Takes the role when it is free, or held by one that should give way, and this robot
    /// is the fittest of those alive.
    pub(super) fn consider_role(&mut self, now: Instant) {
        if self.desk.is_minting() || self.desk.is_broken() || !self.may_stand(now) {
            return;
        }
        let holder = self.role().map(|role| role.holder.clone());
        let free = match &holder {
            None => true,
            Some(holder) if *holder == self.me => return,
            Some(holder) if self.mesh.is_alive(holder) => self.gives_way(holder),
            Some(_) => self.has_witness() && !planted::is(Defect::RoleNeverTaken),
        };
        let fittest = self.fittest().as_ref() == Some(&self.me);
        if !free || !(fittest || planted::is(Defect::RoleTakenByAll)) {
            return;
        }
        let term = self.term() + 1;
        let fitness = self.fitness(&self.me);
        let value = FleetValue::Role(RoleRecord { holder: self.me.clone(), term, fitness });
        let version = Version { epoch: None, revision: 0, term, author: self.me.clone() };
        let record = FleetRecord::new(RecordKind::ROLE, String::new(), version, &value);
        let text = match holder {
            Some(holder) => format!("term {term}, after {holder}"),
            None => format!("term {term}, fittest of {}", self.alive_robots().len()),
        };
        #[expect(clippy::cast_precision_loss, reason = "terms are small")]
        let event = Event::new("role-taken", &self.me, text).number("term", term as f64);
        self.push_event(event);
        self.mint(vec![record], None);
    }

    /// Rule 3: a robot speaks for another only when it hears somebody besides, unless the
    /// fleet is too small for that.
    pub(super) fn has_witness(&self) -> bool {
        let known = self.mesh.authors().robots().count();
        known <= 2 || self.mesh.alive().count() >= 1
    }

    /// Whether it is known enough of the others to compare.
    fn may_stand(&self, now: Instant) -> bool {
        if self.config.facts.role == RolePreference::Forbidden {
            return false;
        }
        let known = self.alive_robots().iter().all(|robot| self.facts(robot).is_some());
        let others = self.config.seeds.iter().filter(|seed| Some(**seed) != self.config.listen);
        let all_heard = self.mesh.alive().count() >= others.count();
        let waited = now >= self.started_at + self.config.rejoin_wait;
        known && (all_heard || waited)
    }

    /// A holder without preference gives way to one that is preferred.
    fn gives_way(&self, holder: &RobotId) -> bool {
        let preference = |robot: &RobotId| self.facts(robot).map(|facts| facts.role);
        preference(holder).is_some_and(|role| role != RolePreference::Preferred)
            && self.config.facts.role == RolePreference::Preferred
    }

    fn fittest(&self) -> Option<RobotId> {
        let robots = self.alive_robots();
        let able = robots.into_iter().filter(|robot| {
            self.facts(robot).is_some_and(|facts| facts.role != RolePreference::Forbidden)
        });
        // the first of equals by name, on every robot
        able.max_by(|a, b| self.fitness(a).cmp(&self.fitness(b)).then_with(|| b.cmp(a)))
    }

    /// Preference, then battery and radio in coarse steps, so that noise decides nothing.
    fn fitness(&self, robot: &RobotId) -> u32 {
        let preferred =
            self.facts(robot).is_some_and(|facts| facts.role == RolePreference::Preferred);
        let host = self.host_of(robot).copied().unwrap_or_default();
        let battery = host.battery.map_or(10, |battery| battery.0 / 100).min(10);
        let radio = host.rssi.map_or(10, |rssi| {
            u32::try_from((i32::from(rssi.tenths()) + 1000).clamp(0, 500) / 100).unwrap_or(0)
        });
        u32::from(preferred) * 1000 + battery * 10 + radio
    }
}
