//! What each robot says of itself: (robot, incarnation) -> heartbeat and keyed records with
//! sequence numbers.

use alloc::{
    collections::{BTreeMap, BTreeSet},
    format,
    string::String,
    vec::Vec,
};

use serde::{Deserialize, Serialize};

use super::wire::{AuthorDelta, AuthorStamp};
use crate::{
    id::{ComponentKey, Name, RobotId},
    recover::Cause,
    report::Report,
};

/// Most authors known; more are refused.
pub(super) const AUTHORS_MAX: usize = 2000;
/// Most records of one author.
const RECORDS_MAX: usize = 2048;
/// Longest record of an author, so that a delta of one fits a datagram.
pub(super) const VALUE_BYTES_MAX: usize = 900;

/// Most bytes of an encoded stamp with what frames it.
pub(super) const STAMP_BYTES_MAX: usize = 80;

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

    fn of(report: &Report) -> Self {
        match report {
            Report::Facts(_) => Self(String::from("f")),
            Report::Host(_) => Self(String::from("h")),
            Report::Link(robot, _) => Self(format!("l/{robot}")),
            Report::Instance(instance) => Self::instance(&instance.component),
            Report::Condition(condition) => Self::condition(&condition.system, condition.cause),
            Report::Homeless(homeless) => Self::homeless(&homeless.component),
        }
    }
}

#[derive(Clone, Debug)]
struct Entry {
    sequence: u64,
    value: Vec<u8>,
    /// `None` for a record taken back, or of a later version.
    report: Option<Report>,
}

/// One robot as it describes itself.
#[derive(Clone, Debug)]
pub struct Author {
    incarnation: Incarnation,
    heartbeat: u64,
    sequence: u64,
    entries: BTreeMap<AuthorKey, Entry>,
}

impl Author {
    fn new(incarnation: Incarnation) -> Self {
        Self { incarnation, heartbeat: 0, sequence: 0, entries: BTreeMap::new() }
    }

    /// All it says at present, by key.
    pub fn reports(&self) -> impl Iterator<Item = &Report> {
        self.entries.values().filter_map(|entry| entry.report.as_ref())
    }
}

/// What came of a stamp or delta.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Learned {
    /// The author lives: its heartbeat or records advanced.
    pub(super) fresh: bool,
    /// At least one record is new.
    pub(super) records: bool,
    /// Records before these are lacking: ask for them.
    pub(super) gap: bool,
    /// Records that could not be taken.
    pub(super) refused: u64,
}

/// All authors, this robot among them.
#[derive(Clone, Debug)]
pub struct AuthorTable {
    me: RobotId,
    authors: BTreeMap<RobotId, Author>,
}

impl AuthorTable {
    pub(super) fn new(me: RobotId, own: Incarnation) -> Self {
        let authors = BTreeMap::from([(me.clone(), Author::new(own))]);
        Self { me, authors }
    }

    /// All robots ever heard of, this one included, by name.
    pub fn robots(&self) -> impl Iterator<Item = &RobotId> {
        self.authors.keys()
    }

    /// What `robot` says at present.
    pub fn author(&self, robot: &RobotId) -> Option<&Author> {
        self.authors.get(robot)
    }

    pub(super) fn beat(&mut self, heartbeat: u64) {
        self.own().heartbeat = heartbeat;
    }

    /// Speaks under a greater incarnation from now on; everything is said anew.
    pub(super) fn reincarnate(&mut self, incarnation: Incarnation) {
        let own = self.own();
        own.incarnation = incarnation;
        let mut sequence = 0;
        for entry in own.entries.values_mut() {
            sequence += 1;
            entry.sequence = sequence;
        }
        own.sequence = sequence;
    }

    /// Whether the record changed.
    pub(super) fn set_own(&mut self, report: &Report) -> bool {
        let value = postcard::to_allocvec(report).expect("writing plain data cannot fail");
        let own = self.own();
        let key = AuthorKey::of(report);
        if value.len() > VALUE_BYTES_MAX
            || own.entries.get(&key).is_some_and(|entry| entry.value == value)
        {
            return false;
        }
        own.sequence += 1;
        let entry = Entry { sequence: own.sequence, value, report: Some(report.clone()) };
        own.entries.insert(key, entry);
        true
    }

    /// Whether there was something to take back.
    pub(super) fn remove_own(&mut self, key: &AuthorKey) -> bool {
        let own = self.own();
        let sequence = own.sequence + 1;
        match own.entries.get_mut(key) {
            Some(entry) if !entry.value.is_empty() => {
                *entry = Entry { sequence, value: Vec::new(), report: None };
                own.sequence = sequence;
                true
            }
            Some(_) | None => false,
        }
    }

    /// How far each author is known.
    pub(super) fn stamps(&self) -> impl Iterator<Item = AuthorStamp> {
        self.authors.iter().map(|(robot, author)| stamp(robot, author, author.sequence))
    }

    /// Takes the news in a stamp: a greater heartbeat is a sign of life.
    pub(super) fn hear(&mut self, heard: &AuthorStamp) -> Learned {
        let Some(author) = self.admit(heard) else { return Learned::default() };
        let fresh = heard.incarnation == author.incarnation && heard.heartbeat > author.heartbeat;
        if fresh {
            author.heartbeat = heard.heartbeat;
        }
        Learned { fresh, ..Learned::default() }
    }

    /// Takes records; those not newer than what is known are skipped.
    pub(super) fn learn(&mut self, delta: &AuthorDelta) -> Learned {
        let mut learned = self.hear(&delta.stamp);
        let Some(author) = self.admit(&delta.stamp) else { return learned };
        if delta.stamp.incarnation != author.incarnation {
            return learned;
        }
        if delta.since > author.sequence {
            learned.gap = true;
            return learned;
        }
        for (sequence, key, value) in &delta.records {
            if *sequence <= author.sequence {
                continue;
            }
            if value.len() > VALUE_BYTES_MAX || author.entries.len() >= RECORDS_MAX {
                learned.refused += 1;
                continue;
            }
            let report = postcard::take_from_bytes(value).ok().map(|(report, _later)| report);
            let entry = Entry { sequence: *sequence, value: value.clone(), report };
            author.entries.insert(AuthorKey(key.clone()), entry);
            learned.records = true;
        }
        if delta.stamp.sequence > author.sequence {
            author.sequence = delta.stamp.sequence;
            learned.fresh = true;
        }
        learned
    }

    /// Records of `robot` that somebody at `known` lacks, as many as fit `room` bytes.
    pub(super) fn delta(
        &self,
        robot: &RobotId,
        known: Option<&AuthorStamp>,
        room: usize,
    ) -> Option<AuthorDelta> {
        let author = self.authors.get(robot)?;
        let since = match known {
            Some(known) if known.incarnation > author.incarnation => return None,
            Some(known) if known.incarnation == author.incarnation => known.sequence,
            Some(_) | None => 0,
        };
        let behind = known.is_none_or(|known| known.incarnation < author.incarnation);
        if !behind && since >= author.sequence {
            return None;
        }
        delta_since(robot, author, since, room)
    }

    /// Records of this robot made after `since`.
    pub(super) fn own_delta(&self, since: u64, room: usize) -> Option<AuthorDelta> {
        delta_since(&self.me, self.authors.get(&self.me)?, since, room)
    }

    /// The greatest sequence of this robot's records.
    pub(super) fn own_sequence(&self) -> u64 {
        self.authors.get(&self.me).map_or(0, |own| own.sequence)
    }

    /// Whether `heard` goes further than what is known of that author.
    pub(super) fn is_behind(&self, heard: &AuthorStamp) -> bool {
        heard.robot != self.me
            && self.authors.get(&heard.robot).is_none_or(|author| {
                (heard.incarnation, heard.sequence) > (author.incarnation, author.sequence)
            })
    }

    /// How far one author is known.
    pub(super) fn stamp_of(&self, robot: &RobotId) -> Option<AuthorStamp> {
        self.authors.get(robot).map(|author| stamp(robot, author, author.sequence))
    }

    /// The author a stamp speaks of, made new for a greater incarnation; `None` for this
    /// robot itself and when there is no room.
    fn admit(&mut self, heard: &AuthorStamp) -> Option<&mut Author> {
        if heard.robot == self.me {
            return None;
        }
        let full = self.authors.len() >= AUTHORS_MAX;
        if full && !self.authors.contains_key(&heard.robot) {
            return None;
        }
        let author = self
            .authors
            .entry(heard.robot.clone())
            .or_insert_with(|| Author::new(heard.incarnation));
        if heard.incarnation > author.incarnation {
            *author = Author::new(heard.incarnation);
        }
        Some(author)
    }

    fn own(&mut self) -> &mut Author {
        self.authors.get_mut(&self.me).expect("this robot is an author from the start")
    }
}

/// Records after `since`, oldest first, as many as fit `room` bytes.
fn delta_since(robot: &RobotId, author: &Author, since: u64, room: usize) -> Option<AuthorDelta> {
    let lacking: BTreeSet<(u64, &AuthorKey)> = author
        .entries
        .iter()
        .filter(|(_, entry)| entry.sequence > since)
        .map(|(key, entry)| (entry.sequence, key))
        .collect();
    let mut records: Vec<(u64, String, Vec<u8>)> = Vec::new();
    let mut used = STAMP_BYTES_MAX;
    let mut reached = author.sequence;
    for (sequence, key) in lacking {
        let value = &author.entries[key].value;
        used += value.len() + key.0.len() + 16;
        if used > room {
            reached = records.last().map(|(sequence, ..)| *sequence)?;
            break;
        }
        records.push((sequence, key.0.clone(), value.clone()));
    }
    Some(AuthorDelta { stamp: stamp(robot, author, reached), since, records })
}

fn stamp(robot: &RobotId, author: &Author, sequence: u64) -> AuthorStamp {
    AuthorStamp {
        robot: robot.clone(),
        incarnation: author.incarnation,
        heartbeat: author.heartbeat,
        sequence,
    }
}
