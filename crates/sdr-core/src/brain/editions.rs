//! On disk a system stays whole: while a newer edition arrives part by part, the last whole one
//! stands there, so that power may fail at any moment and this robot still brings its own
//! components back alone.

use alloc::{
    collections::{BTreeMap, BTreeSet},
    format,
    string::{String, ToString},
    sync::Arc,
    vec::Vec,
};

use super::{Brain, systems::SystemNow};
use crate::{
    mesh::{Fact, FleetRecord, TableChange},
    record::{FleetKey, FleetValue, RecordKind, SystemRecord},
};

/// Keys of the edition on disk that may not be in the table any more, by system.
type OnDisk = BTreeMap<String, BTreeSet<FleetKey>>;

/// Newer editions on their way to the disk.
#[derive(Clone, Debug, Default)]
pub(super) struct Editions {
    /// Parts are missing: nothing of them is written.
    arriving: OnDisk,
    /// All is here: the next write puts it in place of the one on disk.
    arrived: OnDisk,
}

impl Editions {
    /// Some of a newer edition is here, and a whole one was before.
    pub(super) fn begin(&mut self, system: &str) {
        let parts = self.arrived.remove(system).unwrap_or_default();
        self.arriving.entry(system.into()).or_insert(parts);
    }

    /// Whether some of what is known is kept from the disk.
    pub(super) fn are_arriving(&self) -> bool {
        !self.arriving.is_empty()
    }

    /// All of it is here, or nobody wants the system any more.
    pub(super) fn end(&mut self, system: &str) {
        if let Some(parts) = self.arriving.remove(system) {
            self.arrived.insert(system.into(), parts);
        }
    }
}

impl Brain {
    /// Takes out of a change what is to stay as it is on disk, and adds what is whole now.
    pub(super) fn keep_editions(&mut self, change: &mut TableChange) {
        let editions = &mut self.editions;
        if editions.arriving.is_empty() && editions.arrived.is_empty() {
            return;
        }
        let arriving = |key: &FleetKey, arriving: &OnDisk| {
            system_of(key).is_some_and(|system| arriving.contains_key(system))
        };
        change.facts.retain(|fact| !arriving(fact.key(), &editions.arriving));
        let dropped = core::mem::take(&mut change.dropped);
        for key in dropped {
            match system_of(&key).and_then(|system| editions.arriving.get_mut(system)) {
                Some(parts) => {
                    parts.insert(key);
                }
                None => change.dropped.push(key),
            }
        }
        let fleet = self.mesh.fleet();
        for (system, parts) in core::mem::take(&mut editions.arrived) {
            change.dropped.extend(parts.into_iter().filter(|key| fleet.fact(key).is_none()));
            let own = FleetKey { kind: RecordKind::SYSTEM, name: system.clone() };
            change.facts.extend(fleet.fact(&own).cloned());
            for kind in PARTS {
                let keys = fleet.below(kind, &system).map(|(key, ..)| key);
                let parts = keys.filter(|key| system_of(key) == Some(&system));
                change.facts.extend(parts.filter_map(|key| fleet.fact(key).cloned()));
            }
        }
    }

    /// All that belongs on the disk of the table: of systems of which a newer edition arrives,
    /// the last whole one.
    pub(super) fn whole_editions(&mut self) -> Vec<Arc<Fact>> {
        self.editions.arrived.clear();
        let fleet = self.mesh.fleet();
        let stays = |fact: &&Arc<Fact>| {
            let system = system_of(fact.key());
            !system.is_some_and(|system| self.editions.arriving.contains_key(system))
        };
        let mut facts: Vec<Arc<Fact>> = fleet.facts().iter().filter(stays).cloned().collect();
        for (name, parts) in &mut self.editions.arriving {
            let system = self.systems.values().find(|system| system.name.as_str() == name);
            let records = system.into_iter().flat_map(|system| records_of(system));
            for fact in records.filter_map(Fact::read) {
                parts.insert(fact.key().clone());
                facts.push(fact);
            }
        }
        facts
    }
}

/// Kinds of records that make up a system beside its own.
const PARTS: [RecordKind; 4] =
    [RecordKind::COMPONENT, RecordKind::CONNECTION, RecordKind::ALLOCATION, RecordKind::RECOVERY];

/// The system that a record, or a part of it, is of.
fn system_of(key: &FleetKey) -> Option<&str> {
    let is_of_system = key.kind == RecordKind::SYSTEM || PARTS.contains(&key.kind);
    is_of_system.then(|| key.name.split('/').next().unwrap_or(&key.name))
}

/// The records that a whole system was put together from.
fn records_of(system: &SystemNow) -> Vec<FleetRecord> {
    let count = |length: usize| u16::try_from(length).unwrap_or(u16::MAX);
    let own = FleetValue::System(SystemRecord {
        name: system.name.clone(),
        receiver: system.receiver.clone(),
        components: count(system.components.len()),
        connections: count(system.connections.len()),
        wanted: true,
        since: system.since,
    });
    let name = system.name.to_string();
    let mut parts = alloc::vec![
        (RecordKind::SYSTEM, name.clone(), own),
        (RecordKind::ALLOCATION, name.clone(), FleetValue::Allocation(system.allocation.clone())),
        (RecordKind::RECOVERY, name.clone(), FleetValue::Recovery(system.recovery.clone())),
    ];
    parts.extend(system.components.iter().map(|spec| {
        let name = format!("{name}/{}", spec.name);
        (RecordKind::COMPONENT, name, FleetValue::Component(spec.clone()))
    }));
    parts.extend(system.connections.iter().map(|spec| {
        let name = format!("{name}/{}", spec.index);
        (RecordKind::CONNECTION, name, FleetValue::Connection(spec.clone()))
    }));
    let record = |(kind, name, value)| FleetRecord::new(kind, name, system.version.clone(), &value);
    parts.into_iter().map(record).collect()
}
