//! Systems that should run, put together from their records.

use alloc::{collections::BTreeMap, format, string::ToString, vec::Vec};

use super::Brain;
use crate::{
    id::{ComponentKey, Name, RobotId},
    order::Version,
    record::{Assignment, FleetValue, RecordKind, SystemRecord},
    spec::{ComponentSpec, ConnectionSpec, PolicyBytes},
};

/// A wanted system whose records are all here.
#[derive(Clone, Debug)]
pub(super) struct SystemNow {
    pub(super) name: Name,
    pub(super) revision: u64,
    /// Homes chosen before this revision are void.
    pub(super) since: u64,
    pub(super) receiver: RobotId,
    /// In the order of the file.
    pub(super) components: Vec<ComponentSpec>,
    /// In the order of the file.
    pub(super) connections: Vec<ConnectionSpec>,
    pub(super) allocation: PolicyBytes,
    pub(super) recovery: PolicyBytes,
}

impl SystemNow {
    pub(super) fn key(&self, name: &Name) -> ComponentKey {
        ComponentKey::new(&self.name, name)
    }

    pub(super) fn keys(&self) -> impl Iterator<Item = ComponentKey> {
        self.components.iter().map(|component| self.key(&component.name))
    }

    pub(super) fn component(&self, name: &Name) -> Option<&ComponentSpec> {
        self.components.iter().find(|component| component.name == *name)
    }
}

/// Whether a record of this kind is part of a [`SystemNow`].
pub(super) fn shapes_systems(kind: RecordKind) -> bool {
    kind != RecordKind::ASSIGNMENT && kind != RecordKind::ROLE
}

impl Brain {
    /// Puts all wanted systems together anew; incomplete ones keep their last whole form.
    pub(super) fn refresh_systems(&mut self) {
        let mut systems = BTreeMap::new();
        let fleet = self.mesh.fleet();
        for (_, version, value) in fleet.of_kind(RecordKind::SYSTEM) {
            let FleetValue::System(record) = value else { continue };
            if !record.wanted {
                continue;
            }
            match self.assemble(version.revision, record) {
                Some(system) => systems.insert(record.name.clone(), system),
                None => match self.systems.get(&record.name) {
                    Some(before) => systems.insert(record.name.clone(), before.clone()),
                    None => None,
                },
            };
        }
        let before = core::mem::replace(&mut self.systems, systems);
        let redeployed = |system: &&SystemNow| {
            before.get(&system.name).is_some_and(|old| old.revision != system.revision)
        };
        let keys: Vec<ComponentKey> = self
            .systems
            .values()
            .filter(redeployed)
            .flat_map(|s| s.keys().collect::<Vec<_>>())
            .collect();
        // an operator's new revision is a fresh chance for what was given up
        keys.iter().for_each(|key| self.forget_here(key));
    }

    fn assemble(&self, revision: u64, record: &SystemRecord) -> Option<SystemNow> {
        let fleet = self.mesh.fleet();
        let prefix = format!("{}/", record.name);
        let current = |key: &crate::record::FleetKey, version: &Version| {
            key.name.starts_with(&prefix) && version.revision == revision
        };
        let mut components = Vec::new();
        for (key, version, value) in fleet.of_kind(RecordKind::COMPONENT) {
            if let (true, FleetValue::Component(spec)) = (current(key, version), value) {
                components.push(spec.clone());
            }
        }
        let mut connections = Vec::new();
        for (key, version, value) in fleet.of_kind(RecordKind::CONNECTION) {
            if let (true, FleetValue::Connection(spec)) = (current(key, version), value) {
                connections.push(spec.clone());
            }
        }
        let policy = |kind| match fleet.get(kind, record.name.as_str()) {
            Some((version, FleetValue::Allocation(policy) | FleetValue::Recovery(policy)))
                if version.revision == revision =>
            {
                Some(policy.clone())
            }
            Some(_) | None => None,
        };
        let whole = components.len() == usize::from(record.components)
            && connections.len() == usize::from(record.connections);
        if !whole {
            return None;
        }
        components.sort_by_key(|component| component.index);
        connections.sort_by_key(|connection| connection.index);
        Some(SystemNow {
            name: record.name.clone(),
            revision,
            since: record.since,
            receiver: record.receiver.clone(),
            components,
            connections,
            allocation: policy(RecordKind::ALLOCATION)?,
            recovery: policy(RecordKind::RECOVERY)?,
        })
    }

    /// Where a wanted component should run, as far as somebody decided it.
    pub(super) fn assignment(&self, key: &ComponentKey) -> Option<(&Version, &Assignment)> {
        match self.mesh.fleet().get(RecordKind::ASSIGNMENT, &key.to_string())? {
            (version, FleetValue::Assignment(assignment)) => Some((version, assignment)),
            (_, _) => None,
        }
    }

    /// The assignment of a component whose system is wanted and whose home is chosen.
    pub(super) fn wanted(&self, key: &ComponentKey) -> Option<(&Version, &Assignment)> {
        let system = self.systems.get(&key.system)?;
        system.component(&key.name)?;
        self.assignment(key).filter(|(_, assignment)| assignment.deployment >= system.since)
    }

    pub(super) fn home(&self, key: &ComponentKey) -> Option<&RobotId> {
        self.wanted(key).map(|(_, assignment)| &assignment.home)
    }

    /// What `robot` says of its instance of a component.
    pub(super) fn reported(
        &self,
        robot: &RobotId,
        key: &ComponentKey,
    ) -> Option<&crate::report::InstanceReport> {
        self.mesh.authors().author(robot)?.reports().find_map(|report| match report {
            crate::report::Report::Instance(instance) if instance.component == *key => {
                Some(instance)
            }
            crate::report::Report::Instance(_)
            | crate::report::Report::Facts(_)
            | crate::report::Report::Host(_)
            | crate::report::Report::Link(..)
            | crate::report::Report::Condition(_)
            | crate::report::Report::Homeless(_) => None,
        })
    }

    pub(super) fn facts(&self, robot: &RobotId) -> Option<&crate::report::RobotFacts> {
        self.mesh.authors().author(robot)?.reports().find_map(|report| match report {
            crate::report::Report::Facts(facts) => Some(facts),
            crate::report::Report::Instance(_)
            | crate::report::Report::Host(_)
            | crate::report::Report::Link(..)
            | crate::report::Report::Condition(_)
            | crate::report::Report::Homeless(_) => None,
        })
    }

    pub(super) fn host_of(&self, robot: &RobotId) -> Option<&crate::report::HostReport> {
        self.mesh.authors().author(robot)?.reports().find_map(|report| match report {
            crate::report::Report::Host(host) => Some(host),
            crate::report::Report::Instance(_)
            | crate::report::Report::Facts(_)
            | crate::report::Report::Link(..)
            | crate::report::Report::Condition(_)
            | crate::report::Report::Homeless(_) => None,
        })
    }

    /// Robots alive, this one included, by name.
    pub(super) fn alive_robots(&self) -> Vec<RobotId> {
        let robots = self.mesh.authors().robots();
        robots.filter(|robot| self.mesh.is_alive(robot)).cloned().collect()
    }
}
