//! What the fleet agrees on: key -> (version, value), merged by greatest version.

use alloc::{collections::BTreeMap, string::String, vec, vec::Vec};

use serde::{Deserialize, Serialize};

use super::wire::FleetBucket;
use crate::{
    effect::StoredRecord,
    order::{Version, hash64},
    planted::{self, Defect},
    record::{FleetKey, FleetValue, RECORD_BYTES_MAX, RecordKind},
};

/// Buckets of the digest.
pub(super) const BUCKETS: usize = 16;
/// Most records; more are refused.
const RECORDS_MAX: usize = 16_384;
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
        if record.value.len() > RECORD_BYTES_MAX || record.key.name.len() > KEY_BYTES_MAX {
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
            FleetValue::System(_) => Some((record.key.name.clone(), record.version.revision)),
            FleetValue::Component(_)
            | FleetValue::Connection(_)
            | FleetValue::Allocation(_)
            | FleetValue::Recovery(_)
            | FleetValue::Assignment(_)
            | FleetValue::Role(_)
            | FleetValue::Unknown => None,
        };
        self.records.insert(record.key.clone(), (record, value));
        if planted::is(Defect::TombstoneDropped) {
            self.records.retain(
                |_, (_, value)| !matches!(value, FleetValue::System(system) if !system.wanted),
            );
        }
        if let Some((name, revision)) = system {
            self.drop_parts_before(&name, revision);
        }
        Merge::News
    }

    /// The value under a key.
    pub fn get(&self, kind: RecordKind, name: &str) -> Option<(&Version, &FleetValue)> {
        let key = FleetKey { kind, name: String::from(name) };
        self.records.get(&key).map(|(record, value)| (&record.version, value))
    }

    /// The record under a key.
    pub fn record(&self, key: &FleetKey) -> Option<&FleetRecord> {
        self.records.get(key).map(|(record, _)| record)
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

    /// How many records there are.
    pub fn len(&self) -> usize {
        self.records.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.records.is_empty()
    }

    /// One hash per bucket.
    pub(super) fn digest(&self) -> Vec<u32> {
        let mut buckets = vec![0; BUCKETS];
        for (record, _) in self.records.values() {
            let key = key_hash(&record.key);
            buckets[bucket_of(key)] ^= fold(u64::from(key) << 32 | u64::from(record.stamp()));
        }
        buckets
    }

    /// All of one bucket in pieces of at most `entries_max` entries, by key hash.
    pub(super) fn pieces(
        &self,
        bucket: usize,
        answer: bool,
        entries_max: usize,
    ) -> Vec<FleetBucket> {
        let mut entries: Vec<(u32, u32)> =
            self.in_bucket(bucket).map(|record| (key_hash(&record.key), record.stamp())).collect();
        entries.sort_unstable();
        let number = u8::try_from(bucket).expect("buckets are few");
        let mut pieces = Vec::new();
        let mut low = 0;
        while entries.len() > entries_max {
            let rest = entries.split_off(entries_max);
            let high = rest[0].0.saturating_sub(1);
            pieces.push(FleetBucket { bucket: number, answer, low, high, entries });
            low = rest[0].0;
            entries = rest;
        }
        pieces.push(FleetBucket { bucket: number, answer, low, high: u32::MAX, entries });
        pieces
    }

    /// Records that a sender of `piece` lacks or holds differently.
    pub(super) fn missing_from(&self, piece: &FleetBucket) -> Vec<FleetRecord> {
        self.in_bucket(usize::from(piece.bucket))
            .filter(|record| {
                let key = key_hash(&record.key);
                (piece.low..=piece.high).contains(&key)
                    && piece.entries.binary_search(&(key, record.stamp())).is_err()
            })
            .cloned()
            .collect()
    }

    /// Whether the sender of `piece` holds something that this table lacks or holds differently.
    pub(super) fn lacks_of(&self, piece: &FleetBucket) -> bool {
        let held: Vec<(u32, u32)> = self
            .in_bucket(usize::from(piece.bucket))
            .map(|record| (key_hash(&record.key), record.stamp()))
            .collect();
        piece.entries.iter().any(|entry| !held.contains(entry))
    }

    fn in_bucket(&self, bucket: usize) -> impl Iterator<Item = &FleetRecord> {
        self.records
            .values()
            .map(|(record, _)| record)
            .filter(move |record| bucket_of(key_hash(&record.key)) == bucket)
    }

    /// Whether a greater revision of its system is known.
    fn is_outdated(&self, record: &FleetRecord) -> bool {
        let Some(system) = system_of_part(&record.key) else { return false };
        self.get(RecordKind::SYSTEM, system)
            .is_some_and(|(version, _)| version.revision > record.version.revision)
    }

    fn drop_parts_before(&mut self, system: &str, revision: u64) {
        self.records.retain(|key, (record, _)| {
            system_of_part(key) != Some(system) || record.version.revision >= revision
        });
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

fn key_hash(key: &FleetKey) -> u32 {
    fold(hash64(key.name.as_bytes()) ^ (u64::from(key.kind.0) << 56))
}

fn bucket_of(key_hash: u32) -> usize {
    usize::try_from(key_hash).unwrap_or(0) % BUCKETS
}

/// Folds 64 bits to 32 after mixing, so that similar inputs part.
pub(super) fn fold(hash: u64) -> u32 {
    let mixed = hash.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    u32::try_from((mixed >> 32) & 0xffff_ffff).unwrap_or(0)
}
