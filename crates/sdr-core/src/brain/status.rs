//! What this robot believes, for people and scripts.

use alloc::{
    format,
    string::{String, ToString},
    vec::Vec,
};

use super::{Brain, systems::SystemNow};
use crate::{
    allocate::Refusal,
    api::{ComponentView, ConditionView, ConnectionView, RobotView, StatusView, SystemView},
    id::{ComponentKey, RobotId},
    report::Report,
    spec::ComponentSpec,
    time::{Duration, Instant},
};

impl Brain {
    pub(super) fn status_view(&self, now: Instant) -> StatusView {
        StatusView {
            seen_from: self.me.to_string(),
            coordinator: self.role().map(|role| role.holder.to_string()),
            term: self.term(),
            role: self.role_view(),
            robots: self.mesh.authors().robots().map(|robot| self.robot_view(robot, now)).collect(),
            systems: self.systems.values().map(|system| self.system_view(system)).collect(),
            conditions: self.condition_views(now),
        }
    }

    fn robot_view(&self, robot: &RobotId, now: Instant) -> RobotView {
        let facts = self.facts(robot);
        let mine = (*robot == self.me).then_some(self.host).flatten();
        let host = mine.or_else(|| self.host_of(robot).copied()).unwrap_or_default();
        let capacity = facts.map(|facts| facts.memory_capacity).unwrap_or_default();
        let link = self.mesh.link(robot);
        let author = self.mesh.authors().author(robot);
        let conditions = author.into_iter().flat_map(|author| author.reports());
        RobotView {
            name: robot.to_string(),
            alive: self.mesh.is_alive(robot),
            seen_ms: whole_ms(self.mesh.age(robot, now).unwrap_or_default()),
            coordinator: self.role().is_some_and(|role| role.holder == *robot),
            cpu_permille: host.cpu_used.0,
            memory_free_bytes: capacity.less(host.memory_used).0,
            memory_capacity_bytes: capacity.0,
            battery_permille: host.battery.map(|battery| battery.0),
            rssi_dbm: host.rssi.map(|rssi| rssi.as_f64()),
            rtt_ms: link.map(|link| link.rtt.as_secs_f64() * 1000.0),
            api: facts.map(|facts| facts.api.clone()).unwrap_or_default(),
            conditions: conditions
                .filter_map(|report| match report {
                    Report::Condition(condition) => (!condition.foreseen)
                        .then(|| format!("{}: {}", condition.cause, condition.reason)),
                    Report::Facts(_)
                    | Report::Host(_)
                    | Report::Link(..)
                    | Report::Instance(_)
                    | Report::Succession(_)
                    | Report::Homeless(_)
                    | Report::Stored(_) => None,
                })
                .collect(),
        }
    }

    fn system_view(&self, system: &SystemNow) -> SystemView {
        let connections = system.connections.iter().map(|connection| {
            let producer = system.key(&connection.from.component);
            let consumer = system.key(&connection.to.component);
            let homes = (self.home(&producer), self.home(&consumer));
            let epoch = self.assignment(&producer).and_then(|(version, _)| version.epoch.clone());
            let alive = |home: &&RobotId| self.mesh.is_alive(home);
            let both = homes.0.filter(alive).and(homes.1.filter(alive));
            let report = both.and_then(|home| self.instance_report(home, &consumer));
            let heard = report.zip(epoch).is_some_and(|(report, epoch)| {
                let heard = report.heard.iter().find(|(index, _)| *index == connection.index);
                heard.is_some_and(|(_, token)| token.epoch >= epoch)
            });
            ConnectionView { name: connection.label(), heard, remote: homes.0 != homes.1 }
        });
        SystemView {
            name: system.name.to_string(),
            revision: system.revision,
            connections: connections.collect(),
            components: system
                .components
                .iter()
                .map(|component| self.component_view(system, component))
                .collect(),
        }
    }

    fn component_view(&self, system: &SystemNow, spec: &ComponentSpec) -> ComponentView {
        let key = system.key(&spec.name);
        let wanted = self.wanted(&key);
        let home = wanted.map(|(_, assignment)| assignment.home.clone());
        let alive = home.as_ref().is_some_and(|home| self.mesh.is_alive(home));
        let report = home.as_ref().filter(|_| alive);
        let report = report.and_then(|home| self.instance_report(home, &key));
        let epoch = wanted.and_then(|(version, _)| version.epoch.clone());
        let usage = report.as_ref().map(|report| report.usage).unwrap_or_default();
        let token = report.as_ref().and_then(|report| report.token.clone());
        let refusals = self.refusals_of(&key);
        let restarts = match home.as_ref() == Some(&self.me) {
            true => Some(self.said.restarts_of(&key)),
            false => report.as_ref().map(|report| report.restarts),
        };
        let gone = home.as_ref().filter(|_| !alive).map(|home| format!("{home} is not heard"));
        let why = wanted.map(|(_, assignment)| assignment.reason.clone());
        let held = self.held.get(&key).map(|held| format!("held: {held}"));
        let call = self.is_given_up(&key).then(|| self.call_of(&key)).flatten();
        ComponentView {
            name: spec.name.to_string(),
            home: home.map(|home| home.to_string()),
            state: report.as_ref().map(|report| report.state),
            epoch: epoch.as_ref().map_or(0, |epoch| epoch.number),
            epoch_minted_by: epoch.map(|epoch| epoch.minted_by.to_string()),
            run: token.map_or(0, |token| token.run),
            restarts: restarts.map_or(0, u32::from),
            memory_bytes: usage.memory.0,
            cpu_permille: usage.cpu.0,
            standbys: wanted
                .map(|(_, assignment)| {
                    let target = assignment.target.iter();
                    let target = target.filter(|robot| !assignment.standbys.contains(robot));
                    assignment.standbys.iter().chain(target).map(ToString::to_string).collect()
                })
                .unwrap_or_default(),
            reason: held
                .or(call)
                .or(gone)
                .or(why)
                .unwrap_or_else(|| String::from("not placed yet")),
            refusals,
        }
    }

    /// Why a component has no home, as the coordinator says.
    fn refusals_of(&self, key: &ComponentKey) -> Vec<Refusal> {
        if self.is_coordinator() {
            return self.plans.refusals.get(key).cloned().unwrap_or_default();
        }
        let author = self.role().and_then(|role| self.mesh.authors().author(&role.holder));
        let mut reports = author.into_iter().flat_map(|author| author.reports());
        let found = reports.find_map(|report| match report {
            Report::Homeless(homeless) if homeless.component == *key => Some(&homeless.refusals),
            Report::Homeless(_)
            | Report::Stored(_)
            | Report::Succession(_)
            | Report::Facts(_)
            | Report::Host(_)
            | Report::Link(..)
            | Report::Instance(_)
            | Report::Condition(_) => None,
        });
        found.cloned().unwrap_or_default()
    }

    fn condition_views(&self, now: Instant) -> Vec<ConditionView> {
        let views = self.standing().into_iter().map(|status| ConditionView {
            system: status.component.system.to_string(),
            component: status.component.name.to_string(),
            cause: status.cause.to_string(),
            held_ms: whole_ms(now.since(status.since)),
            hold_ms: whole_ms(status.hold),
            raised: status.raised,
            reason: status.reason,
        });
        views.collect()
    }
}

fn whole_ms(time: Duration) -> u64 {
    u64::try_from(time.as_millis()).unwrap_or(u64::MAX)
}
