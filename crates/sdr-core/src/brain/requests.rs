//! What operators ask: deploy, undeploy.

use alloc::{
    format,
    string::{String, ToString},
    vec::Vec,
};

use super::Brain;
use crate::{
    api::{Accepted, DeployAnswer},
    blob::{BlobRef, PART_BYTES_MAX},
    effect::Effect,
    event::Event,
    id::Name,
    input::RequestId,
    mesh::FleetRecord,
    order::Version,
    record::{FleetValue, RECORD_BYTES_MAX, RecordKind, SystemRecord},
    spec::SystemSpec,
};

/// More revisions of one system than anybody has deployed.
const FORGOTTEN_REVISIONS: u64 = 1000;

/// Most bytes that the large parts of one system have together.
const SYSTEM_BYTES_MAX: usize = 8 << 20;

/// A part of a system that is too long for a record.
struct LargePart {
    /// Its key, for people.
    what: String,
    name: BlobRef,
    value: FleetValue,
    bytes: Vec<u8>,
}

impl Brain {
    pub(super) fn handle_deploy(&mut self, request: RequestId, system: SystemSpec) {
        if let Err(error) = system.check() {
            return self.refuse(request, error.to_string());
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
                let (records, _) = self.records_of(&system, revision);
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
        let revision = before.unwrap_or_else(|| self.revisions_unseen()) + u64::from(!unchanged);
        let answer = DeployAnswer { system: name.to_string(), revision, changed: !unchanged };
        let answer = Accepted::System(answer);
        if unchanged {
            self.effects.push_back(Effect::Answer { request, result: Ok(answer) });
            return;
        }
        let (records, large) = self.records_of(&system, revision);
        if let Some(long) = records.iter().find(|record| record.value.len() > RECORD_BYTES_MAX) {
            let (what, found) = (&long.key.name, long.value.len());
            let text = format!("{what} takes {found} bytes; at most {RECORD_BYTES_MAX}");
            return self.refuse(request, text);
        }
        let total: usize = large.iter().map(|part| part.bytes.len()).sum();
        if let Some(long) = large.iter().find(|part| part.bytes.len() > self.config.part_bytes_max)
        {
            let text = format!(
                "{} takes {} bytes; a part of a system has at most {} (fewer or shorter parameters{})",
                long.what,
                long.bytes.len(),
                self.config.part_bytes_max,
                if self.config.part_bytes_max < PART_BYTES_MAX {
                    "; more with [mesh] keys"
                } else {
                    ""
                }
            );
            return self.refuse(request, text);
        }
        if total > SYSTEM_BYTES_MAX {
            let text = format!(
                "the large parts of {name} take {total} bytes; a system has at most {SYSTEM_BYTES_MAX}"
            );
            return self.refuse(request, text);
        }
        large.into_iter().for_each(|part| self.blobs.keep(&part.name, part.value, part.bytes));
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
        let revision = revision + 1;
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

    /// Who compared with nobody since its disk was empty may have forgotten revisions that
    /// others hold: what it is told now must not be taken for one of them.
    fn revisions_unseen(&self) -> u64 {
        let compared = self.mesh.is_in_step() || self.is_only_robot();
        if compared { 0 } else { FORGOTTEN_REVISIONS }
    }

    fn system_revision(&self, name: &Name) -> Option<u64> {
        let found = self.mesh.fleet().get(RecordKind::SYSTEM, name.as_str());
        let known = found.map(|(version, _)| version.revision);
        known.max(self.desk.revision_under_way(name))
    }

    fn deployment_version(&self, revision: u64) -> Version {
        Version { epoch: None, revision, term: 0, author: self.me.clone() }
    }

    /// A system as one small record per part, and the parts that are too long for one; the
    /// system's own record comes first.
    fn records_of(&self, system: &SystemSpec, revision: u64) -> (Vec<FleetRecord>, Vec<LargePart>) {
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
                FleetValue::Allocation(system.allocation.clone()),
            ),
            (
                RecordKind::RECOVERY,
                system.name.to_string(),
                FleetValue::Recovery(system.recovery.clone()),
            ),
        ];
        for (index, component) in system.components.iter().enumerate() {
            let mut component = component.clone();
            component.index = count(index);
            let name = format!("{}/{}", system.name, component.name);
            parts.push((RecordKind::COMPONENT, name, FleetValue::Component(component)));
        }
        for (index, connection) in system.connections.iter().enumerate() {
            let mut connection = connection.clone();
            connection.index = count(index);
            let name = format!("{}/{index}", system.name);
            parts.push((RecordKind::CONNECTION, name, FleetValue::Connection(connection)));
        }
        let version = self.deployment_version(revision);
        let mut large = Vec::new();
        let record = |(kind, what, value): (RecordKind, String, FleetValue)| {
            let bytes = value.encode();
            let record = match kind.large().filter(|_| bytes.len() > RECORD_BYTES_MAX) {
                Some(kind) => {
                    let name = BlobRef::of(&bytes);
                    large.push(LargePart { what: what.clone(), name, value, bytes });
                    FleetRecord::new(kind, what, version.clone(), &FleetValue::Large(name))
                }
                None => FleetRecord::new(kind, what, version.clone(), &value),
            };
            record
        };
        let records = parts.into_iter().map(record).collect();
        (records, large)
    }
}
