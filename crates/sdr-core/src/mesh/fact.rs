//! One shared fact: as it travels, and as tables hold it.

use alloc::{borrow::Borrow, collections::BTreeSet, string::String, sync::Arc, vec::Vec};
use core::cmp::Ordering;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::wire::SECTION_BYTES_MAX;
use crate::{
    order::{Version, hash64},
    record::{Assignment, FleetKey, FleetValue, RECORD_BYTES_MAX, RecordKind},
};

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
    pub(super) fn rank(&self, other: &Self) -> Ordering {
        self.version.cmp(&other.version).then_with(|| {
            let hashes = hash64(&self.value).cmp(&hash64(&other.value));
            hashes.then_with(|| self.value.cmp(&other.value))
        })
    }

    /// Bytes in a datagram, at most.
    pub(super) fn wire_len(&self) -> usize {
        let epoch = self.version.epoch.as_ref();
        let epoch = epoch.map_or(1, |epoch| epoch.minted_by.as_str().len() + 12);
        let version = epoch + 20 + self.version.author.as_str().len() + 1;
        self.value.len() + self.key.name.len() + version + 6
    }

    /// Whether it is short enough to travel.
    pub(super) fn fits(&self) -> bool {
        self.value.len() <= RECORD_BYTES_MAX
            && self.key.name.len() <= KEY_BYTES_MAX
            && self.wire_len() <= SECTION_BYTES_MAX
    }
}

/// A record as tables hold it: read, hashed and never changed, so that whoever holds it
/// shares it.
#[derive(Debug, PartialEq, Eq)]
pub struct Fact {
    record: FleetRecord,
    value: FleetValue,
    hash: u32,
    stamp: u32,
}

impl Fact {
    /// `record` with its value read; `None` when it is too long or cannot be read.
    pub fn read(record: FleetRecord) -> Option<Arc<Self>> {
        if !record.fits() {
            return None;
        }
        let value = FleetValue::decode(record.key.kind, &record.value).ok()?;
        let version = postcard::to_allocvec(&record.version).expect("plain data");
        let stamp = fold(hash64(&version) ^ hash64(&record.value).rotate_left(17));
        let hash = key_hash(record.key.kind, &record.key.name);
        Some(Arc::new(Self { record, value, hash, stamp }))
    }

    /// As it travels.
    pub fn record(&self) -> &FleetRecord {
        &self.record
    }

    /// What it is about.
    pub fn key(&self) -> &FleetKey {
        &self.record.key
    }

    /// Which of two values stays.
    pub fn version(&self) -> &Version {
        &self.record.version
    }

    /// What it says.
    pub fn value(&self) -> &FleetValue {
        &self.value
    }

    /// The home it chooses, when it is about one.
    pub fn assignment(&self) -> Option<&Assignment> {
        match &self.value {
            FleetValue::Assignment(assignment) => Some(assignment),
            FleetValue::System(_)
            | FleetValue::Component(_)
            | FleetValue::Connection(_)
            | FleetValue::Allocation(_)
            | FleetValue::Recovery(_)
            | FleetValue::Role(_)
            | FleetValue::RolePolicy(_)
            | FleetValue::Horizon(_)
            | FleetValue::Unknown => None,
        }
    }

    /// Where its key stands in the tree.
    pub(super) fn hash(&self) -> u32 {
        self.hash
    }

    /// Stands for its version and value.
    pub(super) fn stamp(&self) -> u32 {
        self.stamp
    }
}

/// Facts by key, at most one for each.
#[derive(Clone, Debug, Default)]
pub struct Facts(BTreeSet<ByKey>);

#[derive(Clone, Debug)]
struct ByKey(Arc<Fact>);

impl Facts {
    /// Puts a fact in; the one before under its key.
    pub fn put(&mut self, fact: Arc<Fact>) -> Option<Arc<Fact>> {
        self.0.replace(ByKey(fact)).map(|before| before.0)
    }

    /// Takes the fact under a key out.
    pub fn remove(&mut self, key: &FleetKey) -> Option<Arc<Fact>> {
        self.0.take(key).map(|fact| fact.0)
    }

    /// The fact under a key.
    pub fn get(&self, key: &FleetKey) -> Option<&Arc<Fact>> {
        self.0.get(key).map(|fact| &fact.0)
    }

    /// All of them, by key.
    pub fn iter(&self) -> impl Iterator<Item = &Arc<Fact>> {
        self.0.iter().map(|fact| &fact.0)
    }

    /// Those whose keys are not less than this one.
    pub(super) fn from(&self, kind: RecordKind, name: &str) -> impl Iterator<Item = &Arc<Fact>> {
        let from = FleetKey { kind, name: String::from(name) };
        self.0.range(from..).map(|fact| &fact.0)
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl PartialEq for Facts {
    fn eq(&self, other: &Self) -> bool {
        self.iter().eq(other.iter())
    }
}

impl Eq for Facts {}

/// On disk they are what travels, one after the other; those that cannot be read are left out.
impl Serialize for Facts {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.iter().map(|fact| fact.record()))
    }
}

impl<'de> Deserialize<'de> for Facts {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let records = Vec::<FleetRecord>::deserialize(deserializer)?;
        Ok(Self(records.into_iter().filter_map(Fact::read).map(ByKey).collect()))
    }
}

impl Borrow<FleetKey> for ByKey {
    fn borrow(&self) -> &FleetKey {
        self.0.key()
    }
}

impl Ord for ByKey {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.key().cmp(other.0.key())
    }
}

impl PartialOrd for ByKey {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for ByKey {
    fn eq(&self, other: &Self) -> bool {
        self.0.key() == other.0.key()
    }
}

impl Eq for ByKey {}

/// Where a key stands in the tree.
pub(super) fn key_hash(kind: RecordKind, name: &str) -> u32 {
    fold(hash64(name.as_bytes()) ^ (u64::from(kind.0) << 56))
}

/// Folds 64 bits to 32 after mixing, so that similar inputs part.
pub(super) fn fold(hash: u64) -> u32 {
    let mixed = hash.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    u32::try_from((mixed >> 32) & 0xffff_ffff).unwrap_or(0)
}
