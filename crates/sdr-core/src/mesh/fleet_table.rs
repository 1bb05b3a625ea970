//! What the fleet agrees on: key -> (version, value), merged by greatest version.

use alloc::{
    collections::{BTreeMap, BTreeSet},
    string::String,
    vec::Vec,
};

use serde::{Deserialize, Serialize};

use super::{
    fleet_tree::{FleetTree, range_of},
    wire::{FleetEntries, SECTION_BYTES_MAX},
};
use crate::{
    effect::StoredRecord,
    order::{Version, hash64},
    planted::{self, Defect},
    record::{FleetKey, FleetValue, RECORD_BYTES_MAX, RecordKind},
};

/// Most records; more are refused.
const RECORDS_MAX: usize = 65_536;
/// Longest name of a key.
const KEY_BYTES_MAX: usize = 100;

/// One shared fact with its version.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FleetRecord {
    /// What it is about.
    pub key: FleetKey,
    /// Which of two values stays.
    pub version: Version,
    /// The value, encoded.
    pub value: Vec<u8>,
}

impl FleetRecord {
    /// The record of `value` under `kind` and `name`.
    pub fn new(kind: RecordKind, name: String, version: Version, value: &FleetValue) -> Self {
        Self { key: FleetKey { kind, name }, version, value: value.encode() }
    }

    /// Orders two records of one key: version, then hash, then bytes.
    fn rank(&self) -> (&Version, u64, &[u8]) {
        (&self.version, hash64(&self.value), &self.value)
    }

    /// Bytes in a datagram, at most.
    pub(super) fn wire_len(&self) -> usize {
        let epoch = self.version.epoch.as_ref();
        let epoch = epoch.map_or(1, |epoch| epoch.minted_by.as_str().len() + 12);
        let version = epoch + 20 + self.version.author.as_str().len() + 1;
        self.value.len() + self.key.name.len() + version + 6
    }

    fn stamp(&self) -> u32 {
        let bytes = postcard::to_allocvec(&self.version).expect("plain data");
        fold(hash64(&bytes) ^ hash64(&self.value).rotate_left(17))
    }
}

/// What came of merging a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Merge {
    /// It is greater than what was known.
    News,
    /// It is what was known.
    Known,
    /// Something greater is known.
    Older,
    /// It cannot be read, is too long, or there is no room.
    Refused,
}

/// The fleet table of one robot.
#[derive(Clone, Debug, Default)]
pub struct FleetTable {
    records: BTreeMap<FleetKey, (FleetRecord, FleetValue)>,
    /// (key hash, key) of all records.
    hashes: BTreeSet<(u32, FleetKey)>,
    tree: FleetTree,
}

impl FleetTable {
    /// The table as it was on disk; records that cannot be read are left out.
    pub fn from_stored(stored: Vec<StoredRecord>) -> Self {
        let mut table = Self::default();
        for StoredRecord { key, version, value } in stored {
            table.merge(FleetRecord { key, version, value });
        }
        table
    }

    /// The table as it should be on disk.
    pub fn to_stored(&self) -> Vec<StoredRecord> {
        let stored = |record: &FleetRecord| StoredRecord {
            key: record.key.clone(),
            version: record.version.clone(),
            value: record.value.clone(),
        };
        self.records.values().map(|(record, _)| stored(record)).collect()
    }

    /// Takes `record` when it is greater than what is known.
    pub fn merge(&mut self, record: FleetRecord) -> Merge {
        if record.value.len() > RECORD_BYTES_MAX
            || record.key.name.len() > KEY_BYTES_MAX
            || record.wire_len() > SECTION_BYTES_MAX
        {
            return Merge::Refused;
        }
        let Ok(value) = FleetValue::decode(record.key.kind, &record.value) else {
            return Merge::Refused;
        };
        if self.is_outdated(&record) {
            return Merge::Older;
        }
        match self.records.get(&record.key) {
            Some((known, _)) if *known == record => return Merge::Known,
            Some((known, _))
                if known.rank() > record.rank() && !planted::is(Defect::NoVersionOrder) =>
            {
                return Merge::Older;
            }
            None if self.records.len() >= RECORDS_MAX => return Merge::Refused,
            Some(_) | None => {}
        }
        let system = match &value {
            FleetValue::System(_) => Some((record.key.name.clone(), record.version.clone())),
            FleetValue::Component(_)
            | FleetValue::Connection(_)
            | FleetValue::Allocation(_)
            | FleetValue::Recovery(_)
            | FleetValue::Assignment(_)
            | FleetValue::Role(_)
            | FleetValue::RolePolicy(_)
            | FleetValue::Latch(_)
            | FleetValue::Unknown => None,
        };
        self.put(record, value);
        if planted::is(Defect::TombstoneDropped) {
            self.drop_tombstones();
        }
        if let Some((name, version)) = system {
            self.drop_parts_before(&name, &version);
        }
        Merge::News
    }

    /// The value under a key.
    pub fn get(&self, kind: RecordKind, name: &str) -> Option<(&Version, &FleetValue)> {
        let key = FleetKey { kind, name: String::from(name) };
        self.records.get(&key).map(|(record, value)| (&record.version, value))
    }

    /// The record under a key, and its value.
    pub fn entry(&self, key: &FleetKey) -> Option<&(FleetRecord, FleetValue)> {
        self.records.get(key)
    }

    /// The record under a key.
    pub fn record(&self, key: &FleetKey) -> Option<&FleetRecord> {
        self.records.get(key).map(|(record, _)| record)
    }

    /// What makes an offered record of this key old: the greater one, or that of its system.
    pub(super) fn newer_than(&self, key: &FleetKey) -> Option<&FleetRecord> {
        let system = || {
            let name = String::from(system_of_part(key)?);
            self.record(&FleetKey { kind: RecordKind::SYSTEM, name })
        };
        self.record(key).or_else(system)
    }

    /// All records, by key.
    pub fn records(&self) -> impl Iterator<Item = (&FleetRecord, &FleetValue)> {
        self.records.values().map(|(record, value)| (record, value))
    }

    /// All values of a kind, by name.
    pub fn of_kind(
        &self,
        kind: RecordKind,
    ) -> impl Iterator<Item = (&FleetKey, &Version, &FleetValue)> {
        let from = FleetKey { kind, name: String::new() };
        self.records
            .range(from..)
            .take_while(move |(key, _)| key.kind == kind)
            .map(|(key, (record, value))| (key, &record.version, value))
    }

    /// All values of a kind whose names begin with `prefix`, by name.
    pub fn below<'a>(
        &'a self,
        kind: RecordKind,
        prefix: &'a str,
    ) -> impl Iterator<Item = (&'a FleetKey, &'a Version, &'a FleetValue)> {
        let from = FleetKey { kind, name: String::from(prefix) };
        self.records
            .range(from..)
            .take_while(move |(key, _)| key.kind == kind && key.name.starts_with(prefix))
            .map(|(key, (record, value))| (key, &record.version, value))
    }

    /// One hash over all records: equal tables have equal ones.
    pub fn root(&self) -> u64 {
        u64::from(self.tree().root())
    }

    /// How many records there are.
    pub fn len(&self) -> usize {
        self.records.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.records.is_empty()
    }

    /// Hashes of the table.
    pub(super) fn tree(&self) -> &FleetTree {
        &self.tree
    }

    /// How many records have a key hash in `low..=high`, counted up to `max`.
    pub(super) fn count_in(&self, low: u32, high: u32, max: usize) -> usize {
        self.in_range(low, high).take(max).count()
    }

    /// All of a node in pieces of at most `entries_max` entries, by key hash.
    pub(super) fn pieces(&self, depth: u8, prefix: u16, entries_max: usize) -> Vec<FleetEntries> {
        let (mut low, high) = range_of(depth, prefix);
        let mut entries: Vec<(u32, u32)> = self
            .in_range(low, high)
            .map(|record| (key_hash(&record.key), record.stamp()))
            .collect();
        let mut pieces = Vec::new();
        while entries.len() > entries_max {
            let rest = entries.split_off(entries_max);
            let next = rest[0].0;
            pieces.push(FleetEntries { low, high: next.saturating_sub(1), entries });
            low = next;
            entries = rest;
        }
        pieces.push(FleetEntries { low, high, entries });
        pieces
    }

    /// Records that a sender of `piece` lacks or holds differently, at most `max`.
    pub(super) fn missing_from(&self, piece: &FleetEntries, max: usize) -> Vec<FleetRecord> {
        let lacking = self.in_range(piece.low, piece.high).filter(|record| {
            piece.entries.binary_search(&(key_hash(&record.key), record.stamp())).is_err()
        });
        lacking.take(max).cloned().collect()
    }

    /// Key hashes of what the sender of `piece` holds and this table lacks or holds
    /// differently.
    pub(super) fn wanted_of(&self, piece: &FleetEntries) -> Vec<u32> {
        let held = self.in_range(piece.low, piece.high);
        let held: BTreeSet<(u32, u32)> =
            held.map(|record| (key_hash(&record.key), record.stamp())).collect();
        let lacking = piece.entries.iter().filter(|entry| !held.contains(entry));
        lacking.map(|(key, _)| *key).collect()
    }

    /// Records by key hash.
    pub(super) fn by_hash(&self, key_hash: u32) -> impl Iterator<Item = &FleetRecord> {
        self.in_range(key_hash, key_hash)
    }

    fn in_range(&self, low: u32, high: u32) -> impl Iterator<Item = &FleetRecord> {
        let from = (low, FleetKey { kind: RecordKind(0), name: String::new() });
        let ordered = (low <= high).then(|| self.hashes.range(from..));
        ordered
            .into_iter()
            .flatten()
            .take_while(move |(hash, _)| *hash <= high)
            .map(|(_, key)| &self.records[key].0)
    }

    fn put(&mut self, record: FleetRecord, value: FleetValue) {
        let hash = key_hash(&record.key);
        self.tree.toggle(hash, record.stamp());
        let key = record.key.clone();
        match self.records.insert(key.clone(), (record, value)) {
            Some((before, _)) => self.tree.toggle(hash, before.stamp()),
            None => {
                self.hashes.insert((hash, key));
            }
        }
    }

    /// What no table may do: see [`Defect::TombstoneDropped`].
    fn drop_tombstones(&mut self) {
        let is_dead = |value: &FleetValue| matches!(value, FleetValue::System(s) if !s.wanted);
        let dead: Vec<FleetKey> = self
            .records
            .iter()
            .filter(|(_, (_, value))| is_dead(value))
            .map(|(key, _)| key.clone())
            .collect();
        dead.iter().for_each(|key| self.drop_record(key));
    }

    fn drop_record(&mut self, key: &FleetKey) {
        if let Some((record, _)) = self.records.remove(key) {
            let hash = key_hash(key);
            self.tree.toggle(hash, record.stamp());
            self.hashes.remove(&(hash, key.clone()));
        }
    }

    /// Whether a greater version of its system is known. Two operators may give a system the
    /// same revision on two robots: parts of the lesser author's are outdated too.
    fn is_outdated(&self, record: &FleetRecord) -> bool {
        let Some(system) = system_of_part(&record.key) else { return false };
        self.get(RecordKind::SYSTEM, system).is_some_and(|(version, _)| *version > record.version)
    }

    fn drop_parts_before(&mut self, system: &str, version: &Version) {
        let kinds = [
            RecordKind::COMPONENT,
            RecordKind::CONNECTION,
            RecordKind::ALLOCATION,
            RecordKind::RECOVERY,
        ];
        let mut outdated = Vec::new();
        for kind in kinds {
            let from = FleetKey { kind, name: String::from(system) };
            let parts = self
                .records
                .range(from..)
                .take_while(|(key, _)| key.kind == kind && key.name.starts_with(system));
            let old = parts.filter(|(key, (record, _))| {
                system_of_part(key) == Some(system) && record.version < *version
            });
            outdated.extend(old.map(|(key, _)| key.clone()));
        }
        for key in outdated {
            self.drop_record(&key);
        }
    }
}

/// The system whose part a record is.
fn system_of_part(key: &FleetKey) -> Option<&str> {
    let part = matches!(
        key.kind,
        RecordKind::COMPONENT
            | RecordKind::CONNECTION
            | RecordKind::ALLOCATION
            | RecordKind::RECOVERY
    );
    part.then(|| key.name.split('/').next().unwrap_or(&key.name))
}

/// Where a key stands in the tree.
fn key_hash(key: &FleetKey) -> u32 {
    fold(hash64(key.name.as_bytes()) ^ (u64::from(key.kind.0) << 56))
}

/// Folds 64 bits to 32 after mixing, so that similar inputs part.
pub(super) fn fold(hash: u64) -> u32 {
    let mixed = hash.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    u32::try_from((mixed >> 32) & 0xffff_ffff).unwrap_or(0)
}
