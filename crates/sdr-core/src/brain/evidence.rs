//! What is seen of the components whose home is here, and of robots.

use alloc::{collections::BTreeSet, vec::Vec};

use super::Brain;
use crate::{
    id::{ComponentKey, Name, RobotId},
    recover::{Evidence, RobotEvidence, Spread},
    report::LinkReport,
    units::Permille,
};

impl Brain {
    /// What is seen of the components whose home is here.
    pub(super) fn evidence(&mut self, name: &Name) -> Vec<Evidence> {
        let Some(system) = self.systems.get(name) else { return Vec::new() };
        let mut evidence = Vec::new();
        for spec in &system.components {
            let component = system.key(&spec.name);
            if self.home(&component) != Some(&self.me) {
                continue;
            }
            let fault = self.faults.remove(&component);
            let current = self.current(&component).map(|id| &self.instances[&id]);
            let usage = current.map(|instance| instance.usage).unwrap_or_default();
            let inputs_late = current.map_or(0, |instance| instance.inputs_late);
            let deadlines_missed = current.map_or(0, |instance| instance.deadlines_missed);
            let told = self.told.of(&component);
            evidence.push(Evidence {
                fault,
                actuator: spec.actuator,
                standby_here: self.spare_is_ready(&component),
                standby_elsewhere: !self.ready_standbys(&component).is_empty(),
                memory: usage.memory,
                cpu: usage.cpu,
                cpu_limit: spec.needs.cpu,
                deadlines_missed,
                inputs_late,
                told,
                robot: self.robot_evidence(&component),
                component,
            });
        }
        evidence
    }

    /// Figures of a robot as it reports them; links are its own matter.
    pub(super) fn figures_of(&self, robot: &RobotId) -> Option<RobotEvidence> {
        let facts = self.facts(robot)?;
        let mine = (*robot == self.me).then_some(self.host).flatten();
        let host = mine.or_else(|| self.host_of(robot).copied())?;
        let capacity = facts.cpu_capacity.0.max(1);
        Some(RobotEvidence {
            memory_free: Some(facts.memory_capacity.less(host.memory_used)),
            cpu: Some(Permille(host.cpu_used.0.saturating_mul(1000) / capacity)),
            battery: host.battery,
            rssi: host.rssi,
            ..RobotEvidence::default()
        })
    }

    /// The same with the links that a component's connections use; none, when none crosses.
    fn robot_evidence(&self, component: &ComponentKey) -> RobotEvidence {
        if self.host.is_none() {
            return RobotEvidence::default();
        }
        let partners: BTreeSet<RobotId> = self.partners(component).into_iter().collect();
        let living = partners.iter().filter(|robot| self.mesh.is_alive(robot));
        let used: Vec<LinkReport> = living.filter_map(|robot| self.mesh.link(robot)).collect();
        RobotEvidence {
            delay: Spread::over(used.iter().map(|link| link.rtt / 2).collect()),
            jitter: Spread::over(used.iter().map(|link| link.jitter).collect()),
            loss: Spread::over(used.iter().map(|link| link.loss).collect()),
            ..self.figures_of(&self.me).unwrap_or_default()
        }
    }

    /// Homes of the components that a component talks with.
    pub(super) fn partners(&self, component: &ComponentKey) -> Vec<RobotId> {
        let Some(system) = self.systems.get(&component.system) else { return Vec::new() };
        let others = system.connections.iter().filter_map(|wire| {
            let (from, to) = (&wire.from.component, &wire.to.component);
            match (*from == component.name, *to == component.name) {
                (true, false) => Some(to),
                (false, true) => Some(from),
                (true, true) | (false, false) => None,
            }
        });
        others.filter_map(|name| self.home(&system.key(name)).cloned()).collect()
    }
}
