//! What operators ask: deploy, undeploy.

use alloc::{
    format,
    string::{String, ToString},
    sync::Arc,
    vec::Vec,
};

use super::Brain;
use crate::{
    api::{Accepted, DeployAnswer},
    effect::Effect,
    event::Event,
    id::Name,
    input::RequestId,
    mesh::FleetRecord,
    order::Version,
    record::{FleetValue, RECORD_BYTES_MAX, RecordKind, SystemRecord},
    spec::SystemSpec,
};

impl Brain {
    pub(super) fn handle_deploy(&mut self, request: RequestId, system: SystemSpec) {
        if let Err(error) = system.check() {
            return self.refuse(request, error.to_string());
        }
        if let Some(objection) = self.objection_to_policies(&system) {
            return self.refuse(request, objection);
        }
        if self.desk.is_broken() {
            return self.refuse(request, format!("{} cannot write to its disk", self.me));
        }
        let name = system.name.clone();
        let before = self.system_revision(&name);
        // what was asked a moment ago may still be on its way to the disk
        let settled = self.desk.revision_under_way(&name).is_none();
        let unchanged = settled
            && before.is_some_and(|revision| {
                let records = self.records_of(&system, revision);
                records.iter().all(|record| {
                    record.key.kind == RecordKind::SYSTEM
                        || self
                            .mesh
                            .fleet()
                            .record(&record.key)
                            .is_some_and(|k| k.value == record.value)
                }) && self.systems.get(&name).is_some_and(|now| {
                    now.components.len() == system.components.len()
                        && now.connections.len() == system.connections.len()
                })
            });
        let revision = match before {
            Some(revision) if unchanged => revision,
            Some(_) | None => self.next_revision_of(&name, before),
        };
        let answer = DeployAnswer { system: name.to_string(), revision, changed: !unchanged };
        let answer = Accepted::System(answer);
        if unchanged {
            self.effects.push_back(Effect::Answer { request, result: Ok(answer) });
            return;
        }
        let records = self.records_of(&system, revision);
        if let Some(long) = records.iter().find(|record| record.value.len() > RECORD_BYTES_MAX) {
            let text = format!(
                "{} takes {} bytes; a record has at most {RECORD_BYTES_MAX} (fewer or shorter parameters)",
                long.key.name,
                long.value.len()
            );
            return self.refuse(request, text);
        }
        if !self.mesh.fleet().has_room_for(records.len()) {
            let text = format!("{name} takes {} records; the fleet's table is full", records.len());
            return self.refuse(request, text);
        }
        let text = format!("{name}, revision {revision}, {} components", system.components.len());
        let mut event = Event::new("deployed", &self.me, text);
        event.system = Some(name);
        self.push_event(event);
        self.mint(records, Some((request, answer)));
    }

    pub(super) fn handle_undeploy(&mut self, request: RequestId, name: &Name) {
        let Some(revision) = self.system_revision(name).filter(|_| self.systems.contains_key(name))
        else {
            let known: Vec<&str> = self.systems.keys().map(Name::as_str).collect();
            let text = format!("no system `{name}` is deployed; deployed: [{}]", known.join(", "));
            return self.refuse(request, text);
        };
        let revision = self.next_revision_of(name, Some(revision));
        let value = FleetValue::System(SystemRecord {
            name: name.clone(),
            receiver: self.me.clone(),
            components: 0,
            connections: 0,
            wanted: false,
            since: revision,
        });
        let version = self.deployment_version(revision);
        let record = FleetRecord::new(RecordKind::SYSTEM, name.as_str().into(), version, &value);
        let answer = DeployAnswer { system: name.to_string(), revision, changed: true };
        let answer = Accepted::System(answer);
        let mut event = Event::new("undeployed", &self.me, format!("{name}"));
        event.system = Some(name.clone());
        self.push_event(event);
        self.mint(alloc::vec![record], Some((request, answer)));
    }

    pub(super) fn refuse(&mut self, request: RequestId, reason: String) {
        self.effects.push_back(Effect::Answer { request, result: Err(reason) });
    }

    /// A system that is not wanted now begins above everything that was undeployed: what is
    /// forgotten by all must not be taken for it.
    fn next_revision_of(&self, system: &Name, before: Option<u64>) -> u64 {
        let wanted = self.systems.contains_key(system);
        let floor = if wanted { 0 } else { self.mesh.fleet().revision_floor() };
        let known = before.unwrap_or(0).max(floor);
        self.number_after(RecordKind::SYSTEM, system.as_str(), known)
    }

    fn system_revision(&self, name: &Name) -> Option<u64> {
        let found = self.mesh.fleet().get(RecordKind::SYSTEM, name.as_str());
        let known = found.map(|(version, _)| version.revision);
        known.max(self.desk.revision_under_way(name))
    }

    fn deployment_version(&self, revision: u64) -> Version {
        Version { epoch: None, revision, term: 0, author: self.me.clone() }
    }

    /// A system as one small record per part; the system's own record comes first.
    fn records_of(&self, system: &SystemSpec, revision: u64) -> Vec<FleetRecord> {
        let count = |length: usize| u16::try_from(length).unwrap_or(u16::MAX);
        let own = FleetValue::System(SystemRecord {
            name: system.name.clone(),
            receiver: self.me.clone(),
            components: count(system.components.len()),
            connections: count(system.connections.len()),
            wanted: true,
            since: self.systems.get(&system.name).map_or(revision, |before| before.since),
        });
        let mut parts = alloc::vec![
            (RecordKind::SYSTEM, system.name.to_string(), own),
            (
                RecordKind::ALLOCATION,
                system.name.to_string(),
                FleetValue::Allocation(Arc::new(system.allocation.clone())),
            ),
            (
                RecordKind::RECOVERY,
                system.name.to_string(),
                FleetValue::Recovery(Arc::new(system.recovery.clone())),
            ),
        ];
        for (index, component) in system.components.iter().enumerate() {
            let mut component = component.clone();
            component.index = count(index);
            let name = format!("{}/{}", system.name, component.name);
            parts.push((RecordKind::COMPONENT, name, FleetValue::Component(Arc::new(component))));
        }
        for (index, connection) in system.connections.iter().enumerate() {
            let mut connection = connection.clone();
            connection.index = count(index);
            let name = format!("{}/{index}", system.name);
            parts.push((
                RecordKind::CONNECTION,
                name,
                FleetValue::Connection(Arc::new(connection)),
            ));
        }
        let version = self.deployment_version(revision);
        parts
            .into_iter()
            .map(|(kind, name, value)| FleetRecord::new(kind, name, version.clone(), &value))
            .collect()
    }
}
