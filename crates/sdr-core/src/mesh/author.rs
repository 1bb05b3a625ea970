//! One robot as it describes itself: keyed records with sequence numbers.

use alloc::{collections::BTreeMap, format, string::String, vec::Vec};

use serde::{Deserialize, Serialize};

use crate::{
    id::{ComponentKey, Name, RobotId},
    mesh::{fleet_table::fold, wire::AuthorDelta},
    order::hash64,
    recover::Cause,
    report::Report,
};

/// Most records of one author.
const RECORDS_MAX: usize = 2048;
/// Longest record of an author, so that a delta of one fits a datagram.
pub(super) const VALUE_BYTES_MAX: usize = 900;
/// Longest key of a record: a word, a component's key and a cause.
const KEY_BYTES_MAX: usize = 140;
/// Most bytes that frame the records of a delta.
const DELTA_FRAME_BYTES: usize = 80;

/// Which life of a robot speaks: counter first, then nonce.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
pub struct Incarnation {
    /// Grows with each start.
    pub counter: u64,
    /// Random, so that two robots of one name are told apart.
    pub nonce: u32,
}

/// The number that stands for (robot, incarnation) where a name would be too long.
pub(super) fn robot_id(robot: &RobotId, incarnation: Incarnation) -> u32 {
    let mut bytes = Vec::from(robot.as_str().as_bytes());
    bytes.extend_from_slice(&incarnation.counter.to_le_bytes());
    bytes.extend_from_slice(&incarnation.nonce.to_le_bytes());
    fold(hash64(&bytes))
}

/// Names one record of an author.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct AuthorKey(String);

impl AuthorKey {
    /// The key of an instance's report.
    pub fn instance(component: &ComponentKey) -> Self {
        Self(format!("i/{component}"))
    }

    /// The key of a condition.
    pub fn condition(system: &Name, cause: Cause) -> Self {
        Self(format!("c/{system}/{cause}"))
    }

    /// The key of what the coordinator says of a component without a home.
    pub fn homeless(component: &ComponentKey) -> Self {
        Self(format!("n/{component}"))
    }

    /// The key of what the coordinator says of its successors.
    pub fn succession() -> Self {
        Self(String::from("s"))
    }

    /// The key of what a robot says of its disk.
    pub fn stored() -> Self {
        Self(String::from("d"))
    }

    /// The key of what was measured of the link to `robot`.
    pub fn link(robot: &RobotId) -> Self {
        Self(format!("l/{robot}"))
    }

    pub(super) fn of(report: &Report) -> Self {
        match report {
            Report::Facts(_) => Self(String::from("f")),
            Report::Host(_) => Self(String::from("h")),
            Report::Link(robot, _) => Self::link(robot),
            Report::Instance(instance) => Self::instance(&instance.component),
            Report::Condition(condition) => Self::condition(&condition.system, condition.cause),
            Report::Succession(_) => Self::succession(),
            Report::Homeless(homeless) => Self::homeless(&homeless.component),
            Report::Stored(_) => Self::stored(),
        }
    }
}

#[derive(Clone, Debug)]
struct Entry {
    /// 0 for a record that was not released yet.
    sequence: u64,
    value: Vec<u8>,
    /// `None` for a record taken back, or of a later version.
    report: Option<Report>,
}

/// What came of a delta.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Learned {
    /// At least one record is new.
    pub(super) records: bool,
    /// Records before these are lacking: ask for them.
    pub(super) gap: bool,
    /// Records that could not be taken.
    pub(super) refused: u64,
}

/// One robot as it describes itself.
#[derive(Clone, Debug)]
pub struct Author {
    pub(super) robot: RobotId,
    pub(super) incarnation: Incarnation,
    pub(super) id: u32,
    sequence: u64,
    entries: BTreeMap<AuthorKey, Entry>,
    order: BTreeMap<u64, AuthorKey>,
}

impl Author {
    pub(super) fn new(robot: RobotId, incarnation: Incarnation) -> Self {
        let id = robot_id(&robot, incarnation);
        let (entries, order) = (BTreeMap::new(), BTreeMap::new());
        Self { robot, incarnation, id, sequence: 0, entries, order }
    }

    /// All it says at present, by key.
    pub fn reports(&self) -> impl Iterator<Item = &Report> {
        self.entries.values().filter_map(|entry| entry.report.as_ref())
    }

    /// All its records up to this number are known.
    pub(super) fn sequence(&self) -> u64 {
        self.sequence
    }

    /// Puts a record down without telling; whether it changed.
    pub(super) fn stage(&mut self, key: &AuthorKey, report: &Report) -> bool {
        let value = postcard::to_allocvec(report).expect("writing plain data cannot fail");
        let known = self.entries.get(key);
        let full = known.is_none() && self.entries.len() >= RECORDS_MAX;
        if full || value.len() > VALUE_BYTES_MAX || known.is_some_and(|entry| entry.value == value)
        {
            return false;
        }
        let sequence = known.map_or(0, |entry| entry.sequence);
        let entry = Entry { sequence, value, report: Some(report.clone()) };
        self.entries.insert(key.clone(), entry);
        true
    }

    /// Takes a record back without telling; whether there was one.
    pub(super) fn unstage(&mut self, key: &AuthorKey) -> bool {
        match self.entries.get_mut(key) {
            Some(entry) if !entry.value.is_empty() => {
                *entry = Entry { sequence: entry.sequence, value: Vec::new(), report: None };
                true
            }
            Some(_) | None => false,
        }
    }

    /// Gives the record under `key` the next sequence: from now on others hear of it. Its
    /// bytes on the wire.
    pub(super) fn release(&mut self, key: &AuthorKey) -> usize {
        let Some(entry) = self.entries.get_mut(key) else { return 0 };
        self.order.remove(&entry.sequence);
        self.sequence += 1;
        entry.sequence = self.sequence;
        self.order.insert(self.sequence, key.clone());
        entry.value.len() + key.0.len() + 4
    }

    /// Speaks under another incarnation from now on; everything is said anew.
    pub(super) fn reincarnate(&mut self, incarnation: Incarnation) {
        self.incarnation = incarnation;
        self.id = robot_id(&self.robot, incarnation);
        let keys = core::mem::take(&mut self.order);
        self.sequence = 0;
        for key in keys.into_values() {
            if let Some(entry) = self.entries.get_mut(&key) {
                self.sequence += 1;
                entry.sequence = self.sequence;
                self.order.insert(self.sequence, key);
            }
        }
    }

    /// Takes records of the same incarnation; those not newer than what is known are skipped.
    pub(super) fn learn(&mut self, delta: &AuthorDelta) -> Learned {
        let mut learned = Learned::default();
        if delta.since > self.sequence {
            learned.gap = true;
            return learned;
        }
        for (sequence, key, value) in &delta.records {
            if *sequence <= self.sequence || *sequence > delta.sequence {
                continue;
            }
            let key = AuthorKey(key.clone());
            let before = self.entries.get(&key).map(|entry| entry.sequence);
            let full = before.is_none() && self.entries.len() >= RECORDS_MAX;
            if full || value.len() > VALUE_BYTES_MAX || key.0.len() > KEY_BYTES_MAX {
                learned.refused += 1;
                continue;
            }
            if before.is_some_and(|before| before >= *sequence) {
                continue;
            }
            before.and_then(|before| self.order.remove(&before));
            let report = postcard::take_from_bytes(value).ok().map(|(report, _later)| report);
            let entry = Entry { sequence: *sequence, value: value.clone(), report };
            self.entries.insert(key.clone(), entry);
            self.order.insert(*sequence, key);
            learned.records = true;
        }
        self.sequence = self.sequence.max(delta.sequence);
        learned
    }

    /// Records after `since`, oldest first, as many as fit `room` bytes; `None` when there
    /// are none or not one fits.
    pub(super) fn delta(&self, since: u64, room: usize) -> Option<AuthorDelta> {
        let mut records: Vec<(u64, String, Vec<u8>)> = Vec::new();
        let mut used = DELTA_FRAME_BYTES;
        let mut reached = self.sequence;
        for (sequence, key) in self.order.range(since.saturating_add(1)..) {
            let value = &self.entries[key].value;
            used += value.len() + key.0.len() + 16;
            if used > room {
                reached = records.last().map(|(sequence, ..)| *sequence)?;
                break;
            }
            records.push((*sequence, key.0.clone(), value.clone()));
        }
        (since < self.sequence).then(|| AuthorDelta {
            robot: self.robot.clone(),
            incarnation: self.incarnation,
            since,
            sequence: reached,
            records,
        })
    }
}
