//! What operators ask: deploy, undeploy.

use alloc::{
    format,
    string::{String, ToString},
    vec::Vec,
};

use super::{Brain, parts::Parts};
use crate::{
    api::{Accepted, DeployAnswer},
    effect::Effect,
    event::Event,
    id::Name,
    input::RequestId,
    mesh::FleetRecord,
    order::Version,
    record::{FleetValue, RecordKind, SystemRecord},
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
                let parts = self.parts_of(&system, revision);
                parts.records.iter().all(|record| {
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
        let parts = self.parts_of(&system, revision);
        if let Some(objection) = parts.objection(self.config.part_bytes_max) {
            return self.refuse(request, objection);
        }
        parts.large.into_iter().for_each(|part| self.blobs.keep(part));
        let text = format!("{name}, revision {revision}, {} components", system.components.len());
        let mut event = Event::new("deployed", &self.me, text);
        event.system = Some(name);
        self.push_event(event);
        self.mint(parts.records, Some((request, answer)));
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

    fn next_revision_of(&self, system: &Name, before: Option<u64>) -> u64 {
        self.number_after(RecordKind::SYSTEM, system.as_str(), before.unwrap_or(0))
    }

    fn system_revision(&self, name: &Name) -> Option<u64> {
        let found = self.mesh.fleet().get(RecordKind::SYSTEM, name.as_str());
        let known = found.map(|(version, _)| version.revision);
        known.max(self.desk.revision_under_way(name))
    }

    fn deployment_version(&self, revision: u64) -> Version {
        Version { epoch: None, revision, term: 0, author: self.me.clone() }
    }

    fn parts_of(&self, system: &SystemSpec, revision: u64) -> Parts {
        let since = self.systems.get(&system.name).map_or(revision, |before| before.since);
        Parts::of(system, &self.me, since, &self.deployment_version(revision))
    }
}
