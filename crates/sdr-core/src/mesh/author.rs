//! One robot as it describes itself: keyed records with sequence numbers.

use alloc::{string::String, sync::Arc, vec::Vec};

use serde::{Deserialize, Serialize};

use super::{
    commons::Commons,
    fact::fold,
    saying::{AuthorKey, KEY_BYTES_MAX, Saying, Spoken, shared},
    wire::AuthorDelta,
};
use crate::{
    id::RobotId,
    order::hash64,
    report::{
        ConditionReport, HostReport, InstanceReport, LinkReport, Report, RobotFacts,
        SuccessionReport,
    },
};

/// Most records of one author.
const RECORDS_MAX: usize = 2048;
/// Longest record of an author, so that a delta of one fits a datagram.
pub(super) const VALUE_BYTES_MAX: usize = 900;
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

#[derive(Clone, Debug)]
struct Entry {
    /// 0 for a record that was not released yet.
    sequence: u64,
    saying: Arc<Saying>,
}

/// What came of a delta.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Learned {
    /// At least one record is new.
    pub(super) records: bool,
    /// What they are about.
    pub(super) spoken: Spoken,
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
    /// By key.
    entries: Vec<Entry>,
}

impl Author {
    pub(super) fn new(robot: RobotId, incarnation: Incarnation) -> Self {
        let id = robot_id(&robot, incarnation);
        Self { robot, incarnation, id, sequence: 0, entries: Vec::new() }
    }

    /// All it says at present, by key.
    pub fn reports(&self) -> impl Iterator<Item = &Report> {
        self.entries.iter().filter_map(|entry| entry.saying.report())
    }

    /// Its body and limits.
    pub fn facts(&self) -> Option<&RobotFacts> {
        match self.report("f")? {
            Report::Facts(facts) => Some(facts),
            Report::Host(_)
            | Report::Link(..)
            | Report::Instance(_)
            | Report::Condition(_)
            | Report::Homeless(_)
            | Report::Succession(_)
            | Report::Stored(_) => None,
        }
    }

    /// Its figures.
    pub fn host(&self) -> Option<&HostReport> {
        match self.report("h")? {
            Report::Host(host) => Some(host),
            Report::Facts(_)
            | Report::Link(..)
            | Report::Instance(_)
            | Report::Condition(_)
            | Report::Homeless(_)
            | Report::Succession(_)
            | Report::Stored(_) => None,
        }
    }

    /// Who follows it in the coordinator role.
    pub fn succession(&self) -> Option<&SuccessionReport> {
        match self.last().filter(|last| last.key().as_str() == "s")?.report()? {
            Report::Succession(said) => Some(said),
            Report::Facts(_)
            | Report::Host(_)
            | Report::Link(..)
            | Report::Instance(_)
            | Report::Condition(_)
            | Report::Homeless(_)
            | Report::Stored(_) => None,
        }
    }

    /// Its instances, by component.
    pub fn instances(&self) -> impl Iterator<Item = &InstanceReport> {
        self.below("i/").filter_map(|report| match report {
            Report::Instance(instance) => Some(instance),
            Report::Facts(_)
            | Report::Host(_)
            | Report::Link(..)
            | Report::Condition(_)
            | Report::Homeless(_)
            | Report::Succession(_)
            | Report::Stored(_) => None,
        })
    }

    /// Its trouble, by system.
    pub fn conditions(&self) -> impl Iterator<Item = &ConditionReport> {
        self.below("c/").filter_map(|report| match report {
            Report::Condition(condition) => Some(condition),
            Report::Facts(_)
            | Report::Host(_)
            | Report::Link(..)
            | Report::Instance(_)
            | Report::Homeless(_)
            | Report::Succession(_)
            | Report::Stored(_) => None,
        })
    }

    /// Its links, by the other robot.
    pub fn links(&self) -> impl Iterator<Item = (&RobotId, &LinkReport)> {
        self.below("l/").filter_map(|report| match report {
            Report::Link(robot, link) => Some((robot, link)),
            Report::Facts(_)
            | Report::Host(_)
            | Report::Instance(_)
            | Report::Condition(_)
            | Report::Homeless(_)
            | Report::Succession(_)
            | Report::Stored(_) => None,
        })
    }

    /// Looked at with every input: its key is the greatest of all.
    fn last(&self) -> Option<&Saying> {
        self.entries.last().map(|entry| &*entry.saying)
    }

    fn report(&self, key: &str) -> Option<&Report> {
        let place = self.place(key).ok()?;
        self.entries[place].saying.report()
    }

    /// What it says under keys that begin with `prefix`.
    fn below<'a>(&'a self, prefix: &'a str) -> impl Iterator<Item = &'a Report> {
        let first = self.place(prefix).unwrap_or_else(|first| first);
        let some = self.entries[first..].iter().map(|entry| &entry.saying);
        let some = some.take_while(move |saying| saying.key().as_str().starts_with(prefix));
        some.filter_map(|saying| saying.report())
    }

    fn place(&self, key: &str) -> Result<usize, usize> {
        self.entries.binary_search_by(|entry| entry.saying.key().as_str().cmp(key))
    }

    /// Puts a record under its key; the sequence it had before, when there was one.
    fn put(&mut self, entry: Entry) {
        match self.place(entry.saying.key().as_str()) {
            Ok(place) => self.entries[place] = entry,
            Err(place) => self.entries.insert(place, entry),
        }
    }

    /// All its records up to this number are known.
    pub(super) fn sequence(&self) -> u64 {
        self.sequence
    }

    /// Puts a record down without telling; whether it changed.
    pub(super) fn stage(&mut self, key: &AuthorKey, report: &Report) -> bool {
        let value = postcard::to_allocvec(report).expect("writing plain data cannot fail");
        let known = self.place(key.as_str()).ok().map(|place| &self.entries[place]);
        let full = known.is_none() && self.entries.len() >= RECORDS_MAX;
        let same = known.is_some_and(|entry| entry.saying.value() == value);
        if full || same || value.len() > VALUE_BYTES_MAX {
            return false;
        }
        let sequence = known.map_or(0, |entry| entry.sequence);
        self.put(Entry { sequence, saying: Saying::of(key.clone(), value, report) });
        true
    }

    /// Takes a record back without telling; whether there was one.
    pub(super) fn unstage(&mut self, key: &AuthorKey) -> bool {
        let Ok(place) = self.place(key.as_str()) else { return false };
        let entry = &mut self.entries[place];
        let stood = !entry.saying.value().is_empty();
        if stood {
            entry.saying = Saying::read(key.clone(), Vec::new());
        }
        stood
    }

    /// Gives the record under `key` the next sequence: from now on others hear of it. Its
    /// bytes on the wire.
    pub(super) fn release(&mut self, key: &AuthorKey) -> usize {
        let Ok(place) = self.place(key.as_str()) else { return 0 };
        self.sequence += 1;
        let entry = &mut self.entries[place];
        entry.sequence = self.sequence;
        entry.saying.value().len() + key.as_str().len() + 4
    }

    /// Speaks under another incarnation from now on; everything is said anew.
    pub(super) fn reincarnate(&mut self, incarnation: Incarnation) {
        self.incarnation = incarnation;
        self.id = robot_id(&self.robot, incarnation);
        self.sequence = 0;
        let mut said: Vec<&mut Entry> =
            self.entries.iter_mut().filter(|entry| entry.sequence > 0).collect();
        said.sort_unstable_by_key(|entry| entry.sequence);
        for entry in said {
            self.sequence += 1;
            entry.sequence = self.sequence;
        }
    }

    /// Takes records of the same incarnation; those not newer than what is known are skipped.
    pub(super) fn learn(&mut self, delta: AuthorDelta, commons: Option<&dyn Commons>) -> Learned {
        let mut learned = Learned::default();
        if delta.since > self.sequence {
            learned.gap = true;
            return learned;
        }
        for (sequence, key, value) in delta.records {
            if sequence <= self.sequence || sequence > delta.sequence {
                continue;
            }
            let place = self.place(&key);
            let before = place.ok().map(|place| self.entries[place].sequence);
            let full = before.is_none() && self.entries.len() >= RECORDS_MAX;
            if full || value.len() > VALUE_BYTES_MAX || key.len() > KEY_BYTES_MAX {
                learned.refused += 1;
                continue;
            }
            if before.is_some_and(|before| before >= sequence) {
                continue;
            }
            let saying = shared(AuthorKey::said(key), value, commons);
            // what is taken back is about what stood there
            let stood = place.ok().map(|place| &self.entries[place].saying);
            stood.into_iter().chain([&saying]).for_each(|saying| learned.spoken.note(saying));
            self.put(Entry { sequence, saying });
            learned.records = true;
        }
        self.sequence = self.sequence.max(delta.sequence);
        learned
    }

    /// Records after `since`, oldest first, as many as fit `room` bytes; `None` when there
    /// are none or not one fits.
    pub(super) fn delta(&self, since: u64, room: usize) -> Option<AuthorDelta> {
        if since >= self.sequence {
            return None;
        }
        let mut fresh: Vec<&Entry> =
            self.entries.iter().filter(|entry| entry.sequence > since).collect();
        fresh.sort_unstable_by_key(|entry| entry.sequence);
        let mut records: Vec<(u64, String, Vec<u8>)> = Vec::with_capacity(fresh.len());
        let mut used = DELTA_FRAME_BYTES;
        let mut reached = self.sequence;
        for Entry { sequence, saying } in fresh {
            used += saying.value().len() + saying.key().as_str().len() + 16;
            if used > room {
                reached = records.last().map(|(sequence, ..)| *sequence)?;
                break;
            }
            records.push((*sequence, saying.key().as_str().into(), saying.value().to_vec()));
        }
        Some(AuthorDelta {
            robot: self.robot.clone(),
            incarnation: self.incarnation,
            since,
            sequence: reached,
            records,
        })
    }
}
