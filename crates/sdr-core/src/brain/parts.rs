//! A system as records: one small one for each part, and blobs for the parts that are too long
//! for one.

use alloc::{format, string::String, sync::Arc, vec::Vec};

use crate::{
    blob::{BlobRef, PART_BYTES_MAX},
    id::RobotId,
    mesh::FleetRecord,
    order::Version,
    record::{FleetValue, RECORD_BYTES_MAX, RecordKind, SystemRecord},
    spec::SystemSpec,
};

/// Most bytes that the large parts of one system have together.
const SYSTEM_BYTES_MAX: usize = 8 << 20;

/// A part of a system that is too long for a record.
pub(super) struct LargePart {
    /// Its key, for people.
    what: String,
    pub(super) name: BlobRef,
    pub(super) value: FleetValue,
    pub(super) bytes: Vec<u8>,
}

/// All of a system.
pub(super) struct Parts {
    /// The system's own record comes first.
    pub(super) records: Vec<FleetRecord>,
    /// What some of them name.
    pub(super) large: Vec<LargePart>,
}

impl Parts {
    /// The parts of `system`, which `receiver` took, wanted since the revision `since`.
    pub(super) fn of(
        system: &SystemSpec,
        receiver: &RobotId,
        since: u64,
        version: &Version,
    ) -> Self {
        let own = FleetValue::System(SystemRecord {
            name: system.name.clone(),
            receiver: receiver.clone(),
            components: count(system.components.len()),
            connections: count(system.connections.len()),
            wanted: true,
            since,
        });
        let word = system.name.as_str();
        let mut parts = Self { records: Vec::new(), large: Vec::new() };
        let mut put = |kind, name: String, value| parts.put(kind, name, version, value);
        put(RecordKind::SYSTEM, word.into(), own);
        let policy = FleetValue::Allocation(Arc::new(system.allocation.clone()));
        put(RecordKind::ALLOCATION, word.into(), policy);
        let policy = FleetValue::Recovery(Arc::new(system.recovery.clone()));
        put(RecordKind::RECOVERY, word.into(), policy);
        for (index, component) in system.components.iter().enumerate() {
            let mut component = component.clone();
            component.index = count(index);
            let name = format!("{word}/{}", component.name);
            put(RecordKind::COMPONENT, name, FleetValue::Component(Arc::new(component)));
        }
        for (index, connection) in system.connections.iter().enumerate() {
            let mut connection = connection.clone();
            connection.index = count(index);
            let value = FleetValue::Connection(Arc::new(connection));
            put(RecordKind::CONNECTION, format!("{word}/{index}"), value);
        }
        parts
    }

    fn put(&mut self, kind: RecordKind, name: String, version: &Version, value: FleetValue) {
        let bytes = value.encode();
        let large = kind.large().filter(|_| bytes.len() > RECORD_BYTES_MAX);
        let record = match large {
            Some(kind) => {
                let (what, blob) = (name.clone(), BlobRef::of(&bytes));
                self.large.push(LargePart { what, name: blob, value, bytes });
                FleetRecord::new(kind, name, version.clone(), &FleetValue::Large(blob))
            }
            None => FleetRecord::new(kind, name, version.clone(), &value),
        };
        self.records.push(record);
    }

    /// What is too long, when one part may have so many bytes.
    pub(super) fn objection(&self, part_bytes_max: usize) -> Option<String> {
        if let Some(long) = self.records.iter().find(|one| one.value.len() > RECORD_BYTES_MAX) {
            let (what, found) = (&long.key.name, long.value.len());
            return Some(format!("{what} takes {found} bytes; at most {RECORD_BYTES_MAX}"));
        }
        if let Some(long) = self.large.iter().find(|part| part.bytes.len() > part_bytes_max) {
            let (what, found) = (&long.what, long.bytes.len());
            let more = if part_bytes_max < PART_BYTES_MAX { "; more with [mesh] keys" } else { "" };
            return Some(format!(
                "{what} takes {found} bytes; a part of a system has at most {part_bytes_max} (fewer or shorter parameters{more})"
            ));
        }
        let total: usize = self.large.iter().map(|part| part.bytes.len()).sum();
        let name = self.records.first().map_or(String::new(), |own| own.key.name.clone());
        (total > SYSTEM_BYTES_MAX).then(|| {
            format!("the large parts of {name} take {total} bytes; a system has at most {SYSTEM_BYTES_MAX}")
        })
    }
}

fn count(length: usize) -> u16 {
    u16::try_from(length).unwrap_or(u16::MAX)
}
