//! What the fleet agrees on: key -> (version, value), merged by greatest version.

use alloc::{collections::BTreeSet, string::String, sync::Arc, vec::Vec};

use super::{
    commons::Commons,
    fact::{Fact, Facts, FleetRecord, key_hash},
    fact_index::ByHash,
    fleet_tree::{FleetTree, range_of},
    wire::{FleetEntries, RecordRef},
};
use crate::{
    order::Version,
    planted::{self, Defect},
    record::{FleetKey, FleetValue, HorizonRecord, RecordKind, RoleRecord},
};

/// Most records; more are refused.
pub(super) const RECORDS_MAX: usize = 65_536;
/// Changes kept for the disk; when there are more, all is told anew.
const UNSAVED_MAX: usize = 65_536;

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
    facts: Facts,
    by_hash: ByHash,
    tree: FleetTree,
    /// Looked at with every input.
    role: Option<Arc<Fact>>,
    /// What is buried.
    horizon: Option<Arc<Fact>>,
    /// Systems that were undeployed.
    pub(super) dead: BTreeSet<String>,
    /// What changed since it was told last, for the disk.
    unsaved: Vec<Arc<Fact>>,
    unsaved_all: bool,
    commons: Option<Arc<dyn Commons>>,
}

/// What changed in a table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TableChange {
    /// Facts that are new or greater.
    pub facts: Vec<Arc<Fact>>,
    /// Keys that are gone.
    pub dropped: Vec<FleetKey>,
}

impl FleetTable {
    /// The table that holds `facts`, and shares what it holds with others through `commons`.
    pub fn new(facts: &Facts, commons: Option<Arc<dyn Commons>>) -> Self {
        let mut table = Self { commons, ..Self::default() };
        for fact in facts.iter() {
            table.merge_fact(Arc::clone(fact));
        }
        table
    }

    /// Through what its facts are shared.
    pub(super) fn commons(&self) -> Option<Arc<dyn Commons>> {
        self.commons.clone()
    }

    /// All facts, by key.
    pub fn facts(&self) -> &Facts {
        &self.facts
    }

    /// Takes `record` when it is greater than what is known.
    pub fn merge(&mut self, record: FleetRecord) -> Merge {
        let hash = key_hash(record.key.kind, &record.key.name);
        let known = self.find(hash, record.key.kind, &record.key.name);
        if known.is_some_and(|known| *known.record() == record) {
            return Merge::Known;
        }
        let shared = self.commons.as_ref().and_then(|commons| commons.fact(&record));
        match shared.or_else(|| Fact::read(record)) {
            Some(fact) => self.merge_fact(fact),
            None => Merge::Refused,
        }
    }

    fn merge_fact(&mut self, fact: Arc<Fact>) -> Merge {
        match self.judge(&fact) {
            Merge::News => {}
            Merge::Known => return Merge::Known,
            Merge::Older => return Merge::Older,
            Merge::Refused => return Merge::Refused,
        }
        let system = match fact.value() {
            FleetValue::System(_) => Some((fact.key().name.clone(), fact.version().clone())),
            FleetValue::Component(_)
            | FleetValue::Connection(_)
            | FleetValue::Allocation(_)
            | FleetValue::Recovery(_)
            | FleetValue::Assignment(_)
            | FleetValue::Role(_)
            | FleetValue::RolePolicy(_)
            | FleetValue::Horizon(_)
            | FleetValue::Unknown => None,
        };
        let buries = matches!(fact.value(), FleetValue::Horizon(_));
        if let Some(commons) = &self.commons {
            commons.keep_fact(&fact);
        }
        self.put(fact);
        if buries {
            self.bury();
        }
        self.drop_tombstones();
        if let Some((name, version)) = system {
            self.drop_parts_before(&name, &version);
        }
        Merge::News
    }

    /// What would come of merging a fact.
    pub fn judge(&self, fact: &Fact) -> Merge {
        let buried = || self.is_buried(fact.key(), fact.version(), fact.value());
        if self.is_outdated(fact.record()) || buried() {
            return Merge::Older;
        }
        let known = self.find(fact.hash(), fact.key().kind, &fact.key().name);
        match known.map(|known| (known, known.record().rank(fact.record()))) {
            Some((known, _)) if **known == *fact => Merge::Known,
            Some((_, core::cmp::Ordering::Greater)) if !planted::is(Defect::NoVersionOrder) => {
                Merge::Older
            }
            None if self.facts.len() >= RECORDS_MAX => Merge::Refused,
            Some(_) | None => Merge::News,
        }
    }

    /// Whether a record that came says what is known.
    pub(super) fn holds(&self, record: &RecordRef<'_>) -> bool {
        let hash = key_hash(record.kind(), record.name());
        let known = self.find(hash, record.kind(), record.name());
        known.is_some_and(|known| record.is(known)) && !planted::is(Defect::EndlessEcho)
    }

    /// The value under a key.
    pub fn get(&self, kind: RecordKind, name: &str) -> Option<(&Version, &FleetValue)> {
        let fact = self.find(key_hash(kind, name), kind, name)?;
        Some((fact.version(), fact.value()))
    }

    /// Who holds the coordinator role.
    pub fn role(&self) -> Option<&RoleRecord> {
        match self.role.as_ref()?.value() {
            FleetValue::Role(role) => Some(role),
            FleetValue::System(_)
            | FleetValue::Component(_)
            | FleetValue::Connection(_)
            | FleetValue::Allocation(_)
            | FleetValue::Recovery(_)
            | FleetValue::Assignment(_)
            | FleetValue::RolePolicy(_)
            | FleetValue::Horizon(_)
            | FleetValue::Unknown => None,
        }
    }

    /// What was buried last.
    pub fn horizon(&self) -> Option<&HorizonRecord> {
        match self.horizon.as_ref()?.value() {
            FleetValue::Horizon(horizon) => Some(horizon),
            FleetValue::System(_)
            | FleetValue::Component(_)
            | FleetValue::Connection(_)
            | FleetValue::Allocation(_)
            | FleetValue::Recovery(_)
            | FleetValue::Assignment(_)
            | FleetValue::Role(_)
            | FleetValue::RolePolicy(_)
            | FleetValue::Unknown => None,
        }
    }

    /// The fact under a key.
    pub fn fact(&self, key: &FleetKey) -> Option<&Arc<Fact>> {
        self.find(key_hash(key.kind, &key.name), key.kind, &key.name)
    }

    /// The record under a key.
    pub fn record(&self, key: &FleetKey) -> Option<&FleetRecord> {
        self.fact(key).map(|fact| fact.record())
    }

    /// What makes an offered record of this key old: the greater one, or that of its system.
    pub(super) fn newer_than(&self, key: &FleetKey) -> Option<&FleetRecord> {
        let system = || {
            let name = system_of_part(key)?;
            self.find(key_hash(RecordKind::SYSTEM, name), RecordKind::SYSTEM, name)
        };
        let horizon = || self.find(key_hash(RecordKind::HORIZON, ""), RecordKind::HORIZON, "");
        self.fact(key).or_else(system).or_else(horizon).map(|fact| fact.record())
    }

    /// All records, by key.
    pub fn records(&self) -> impl Iterator<Item = (&FleetRecord, &FleetValue)> {
        self.facts.iter().map(|fact| (fact.record(), fact.value()))
    }

    /// All values of a kind, by name.
    pub fn of_kind(
        &self,
        kind: RecordKind,
    ) -> impl Iterator<Item = (&FleetKey, &Version, &FleetValue)> {
        self.below(kind, "")
    }

    /// All values of a kind whose names begin with `prefix`, by name.
    pub fn below<'a>(
        &'a self,
        kind: RecordKind,
        prefix: &'a str,
    ) -> impl Iterator<Item = (&'a FleetKey, &'a Version, &'a FleetValue)> {
        self.facts
            .from(kind, prefix)
            .take_while(move |fact| fact.key().kind == kind && fact.key().name.starts_with(prefix))
            .map(|fact| (fact.key(), fact.version(), fact.value()))
    }

    /// What changed since the last call; `None` when it is too much to tell apart.
    pub fn take_change(&mut self) -> Option<TableChange> {
        let mut touched = core::mem::take(&mut self.unsaved);
        if core::mem::take(&mut self.unsaved_all) {
            return None;
        }
        touched.sort_by(|a, b| (a.hash(), a.key()).cmp(&(b.hash(), b.key())));
        touched.dedup_by(|a, b| a.key() == b.key());
        let mut change = TableChange::default();
        for fact in touched {
            match self.find(fact.hash(), fact.key().kind, &fact.key().name) {
                Some(now) => change.facts.push(Arc::clone(now)),
                None => change.dropped.push(fact.key().clone()),
            }
        }
        Some(change)
    }

    /// One hash over all records: equal tables have equal ones.
    pub fn root(&self) -> u64 {
        u64::from(self.tree().root())
    }

    /// How many records there are.
    pub fn len(&self) -> usize {
        self.facts.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.facts.is_empty()
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
        let mut entries: Vec<(u32, u32)> =
            self.in_range(low, high).map(|fact| (fact.hash(), fact.stamp())).collect();
        entries.sort_unstable();
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
        let lacking = self
            .in_range(piece.low, piece.high)
            .filter(|fact| piece.entries.binary_search(&(fact.hash(), fact.stamp())).is_err());
        lacking.take(max).map(|fact| fact.record().clone()).collect()
    }

    /// Key hashes of what the sender of `piece` holds and this table lacks or holds
    /// differently.
    pub(super) fn wanted_of(&self, piece: &FleetEntries) -> Vec<u32> {
        let held = self.in_range(piece.low, piece.high);
        let held: BTreeSet<(u32, u32)> = held.map(|fact| (fact.hash(), fact.stamp())).collect();
        let lacking = piece.entries.iter().filter(|entry| !held.contains(entry));
        lacking.map(|(key, _)| *key).collect()
    }

    /// Records by key hash.
    pub(super) fn by_hash(&self, key_hash: u32) -> impl Iterator<Item = &FleetRecord> {
        self.in_range(key_hash, key_hash).map(|fact| fact.record())
    }

    /// Parts of a system of versions before this one.
    pub fn parts_before(&self, system: &str, version: &Version) -> Vec<FleetKey> {
        let kinds = [
            RecordKind::COMPONENT,
            RecordKind::CONNECTION,
            RecordKind::ALLOCATION,
            RecordKind::RECOVERY,
        ];
        let mut outdated = Vec::new();
        for kind in kinds {
            let parts = self.below(kind, system);
            let old = parts
                .filter(|(key, known, _)| system_of_part(key) == Some(system) && *known < version);
            outdated.extend(old.map(|(key, _, _)| key.clone()));
        }
        outdated
    }

    fn find(&self, hash: u32, kind: RecordKind, name: &str) -> Option<&Arc<Fact>> {
        self.by_hash.find(hash, |fact| fact.key().kind == kind && fact.key().name == name)
    }

    fn in_range(&self, low: u32, high: u32) -> impl Iterator<Item = &Fact> {
        self.by_hash.range(low, high).map(|fact| &**fact)
    }

    fn put(&mut self, fact: Arc<Fact>) {
        self.tree.toggle(fact.hash(), fact.stamp());
        self.by_hash.put(&fact);
        if fact.key().kind == RecordKind::ROLE && fact.key().name.is_empty() {
            self.role = Some(Arc::clone(&fact));
        }
        if fact.key().kind == RecordKind::HORIZON && fact.key().name.is_empty() {
            self.horizon = Some(Arc::clone(&fact));
        }
        if let FleetValue::System(system) = fact.value() {
            match system.wanted {
                true => self.dead.remove(&fact.key().name),
                false => self.dead.insert(fact.key().name.clone()),
            };
        }
        self.note_unsaved(&fact);
        if let Some(before) = self.facts.put(fact) {
            self.tree.toggle(before.hash(), before.stamp());
        }
    }

    fn note_unsaved(&mut self, fact: &Arc<Fact>) {
        if self.unsaved.len() < UNSAVED_MAX {
            self.unsaved.push(Arc::clone(fact));
        } else {
            self.unsaved_all = true;
        }
    }

    pub(super) fn drop_fact(&mut self, key: &FleetKey) {
        if let Some(fact) = self.facts.remove(key) {
            self.tree.toggle(fact.hash(), fact.stamp());
            self.by_hash.remove(&fact);
            if fact.key().kind == RecordKind::SYSTEM {
                self.dead.remove(&fact.key().name);
            }
            self.note_unsaved(&fact);
        }
    }

    /// Whether a greater version of its system is known. Two operators may give a system the
    /// same revision on two robots: parts of the lesser author's are outdated too.
    fn is_outdated(&self, record: &FleetRecord) -> bool {
        let Some(system) = system_of_part(&record.key) else { return false };
        self.get(RecordKind::SYSTEM, system).is_some_and(|(version, _)| *version > record.version)
    }

    fn drop_parts_before(&mut self, system: &str, version: &Version) {
        for key in self.parts_before(system, version) {
            self.drop_fact(&key);
        }
    }
}

/// The system whose part a record is.
pub(super) fn system_of_part(key: &FleetKey) -> Option<&str> {
    let part = matches!(
        key.kind,
        RecordKind::COMPONENT
            | RecordKind::CONNECTION
            | RecordKind::ALLOCATION
            | RecordKind::RECOVERY
    );
    part.then(|| key.name.split('/').next().unwrap_or(&key.name))
}
