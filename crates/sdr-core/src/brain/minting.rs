//! Disk before wire: what this robot makes is stored before anybody hears of it.

use alloc::{
    collections::{BTreeMap, BTreeSet},
    format,
    string::String,
    sync::Arc,
    vec::Vec,
};
use core::net::SocketAddr;

use super::Brain;
use crate::{
    api::Accepted,
    effect::{Effect, StoredChange},
    id::{ComponentKey, Name},
    input::{RequestId, StoreTicket},
    mesh::{Fact, FleetRecord, FleetTable, Merge, TableChange},
    order::Run,
    planted::{self, Defect},
    record::{FleetKey, FleetValue, RecordKind},
    time::{Duration, Instant},
};

/// Pause after a failed store.
const DISK_RETRY: Duration = Duration::from_secs(1);

/// Records of others are gathered for so long before they are stored in one go.
const GATHER: Duration = Duration::from_millis(200);

/// Records that wait for the disk.
#[derive(Clone, Debug)]
struct Mint {
    ticket: StoreTicket,
    records: Vec<FleetRecord>,
    answer: Option<(RequestId, Accepted)>,
}

/// What is on its way to the disk.
#[derive(Clone, Debug, Default)]
pub(super) struct Desk {
    last: StoreTicket,
    in_flight: Option<StoreTicket>,
    dirty: bool,
    mints: Vec<Mint>,
    /// What this life made something of, at most as many as the table holds.
    made: BTreeSet<FleetKey>,
    runs_in_flight: BTreeMap<ComponentKey, Run>,
    epochs_in_flight: BTreeMap<ComponentKey, u64>,
    spoken: bool,
    broken_at: Option<Instant>,
    /// What others made is stored at this time at the latest.
    dirty_since: Option<Instant>,
    urgent: bool,
    /// The shell holds all that was ordered: the next order says what changed since.
    told: bool,
    /// Peers as they were ordered last.
    peers: Vec<SocketAddr>,
}

impl Desk {
    /// Something of others is worth storing; a burst is stored once.
    pub(super) fn mark_dirty(&mut self) {
        self.dirty = true;
    }

    /// Something here waits for the disk.
    pub(super) fn mark_urgent(&mut self) {
        self.dirty = true;
        self.urgent = true;
    }

    /// When what was gathered is stored.
    pub(super) fn store_at(&self) -> Option<Instant> {
        self.dirty_since.map(|since| since + GATHER)
    }

    /// Mute until the new incarnation is on disk (or the disk is known to be broken).
    pub(super) fn may_speak(&self) -> bool {
        self.spoken
    }

    /// Whether something made here is not in the table yet.
    pub(super) fn is_minting(&self) -> bool {
        !self.mints.is_empty()
    }

    /// The revision of a system that waits for the disk.
    pub(super) fn revision_under_way(&self, system: &Name) -> Option<u64> {
        let records = self.mints.iter().flat_map(|mint| &mint.records);
        let own = records.filter(|record| {
            record.key.kind == RecordKind::SYSTEM && record.key.name == system.as_str()
        });
        own.map(|record| record.version.revision).max()
    }

    /// Whether this life made something of what stands under `key`.
    pub(super) fn made(&self, key: &FleetKey) -> bool {
        self.made.contains(key)
    }

    pub(super) fn note_made(&mut self, key: FleetKey) {
        self.made.insert(key);
    }

    /// When to try a broken disk again.
    pub(super) fn retry_at(&self) -> Option<Instant> {
        self.broken_at.map(|at| at + DISK_RETRY)
    }

    /// A robot that cannot store makes nothing.
    pub(super) fn is_broken(&self) -> bool {
        self.broken_at.is_some()
    }
}

impl Brain {
    /// Stores `records`, then publishes them, then answers.
    pub(super) fn mint(
        &mut self,
        records: Vec<FleetRecord>,
        answer: Option<(RequestId, Accepted)>,
    ) {
        if planted::is(Defect::WireBeforeDisk) {
            self.mesh.publish(records.clone());
        }
        self.desk.made.extend(records.iter().map(|record| record.key.clone()));
        let ticket = self.desk.last + 1;
        self.desk.mints.push(Mint { ticket, records, answer });
        self.store_now();
    }

    pub(super) fn store_if_dirty(&mut self, now: Instant) {
        if !self.desk.dirty {
            return;
        }
        let rests = self.desk.retry_at().is_some_and(|at| now < at);
        let since = *self.desk.dirty_since.get_or_insert(now);
        let due = self.desk.urgent || now >= since + GATHER;
        if due && self.desk.in_flight.is_none() && !rests {
            self.store_now();
        }
    }

    pub(super) fn store_now(&mut self) {
        self.desk.last += 1;
        self.desk.in_flight = Some(self.desk.last);
        self.desk.dirty = false;
        self.desk.urgent = false;
        self.desk.dirty_since = None;
        let change = self.change_to_store();
        self.desk.runs_in_flight.extend(change.runs.iter().cloned());
        self.desk.epochs_in_flight.extend(change.epochs.iter().cloned());
        self.effects.push_back(Effect::Store { ticket: self.desk.last, change });
    }

    /// What changed since the last order, and what waits for the disk to be said.
    fn change_to_store(&mut self) -> StoredChange {
        let known = self.mesh.take_change().filter(|_| self.desk.told);
        self.desk.told = true;
        let whole = known.is_none();
        let TableChange { mut facts, mut dropped } = match known {
            Some(mut change) => {
                self.keep_editions(&mut change);
                change
            }
            None => TableChange { facts: self.whole_editions(), dropped: Vec::new() },
        };
        self.add_mints(&mut facts, &mut dropped);
        facts.retain(|fact| is_stored(fact.key().kind));
        let runs = self.runs.iter().filter(|(_, book)| whole || book.stored < book.reserved);
        let runs = runs.map(|(key, book)| (key.clone(), book.reserved)).collect();
        let epochs = self.epochs.iter().filter(|(_, book)| whole || book.stored < book.reserved);
        let epochs = epochs.map(|(key, book)| (key.clone(), book.reserved)).collect();
        let peers = self.mesh.peer_addresses();
        let peers = (whole || peers != self.desk.peers).then_some(peers);
        if let Some(peers) = &peers {
            self.desk.peers.clone_from(peers);
        }
        let incarnation = self.mesh.incarnation().counter;
        let robots = self.robots_to_store(whole);
        self.burial.root_in_flight = self.root_to_store();
        StoredChange { whole, incarnation, facts, dropped, runs, epochs, peers, robots }
    }

    /// What is made here belongs on the disk before it is in the table.
    fn add_mints(&self, facts: &mut Vec<Arc<Fact>>, dropped: &mut Vec<FleetKey>) {
        let fleet = self.mesh.fleet();
        let mut minted = FleetTable::default();
        for record in self.desk.mints.iter().flat_map(|mint| &mint.records) {
            minted.merge(record.clone());
        }
        for fact in minted.facts().iter().filter(|fact| fleet.judge(fact) == Merge::News) {
            if let FleetValue::System(_) = fact.value() {
                let old = fleet.parts_before(&fact.key().name, fact.version());
                facts.retain(|fact| !old.contains(fact.key()));
                dropped.extend(old);
            }
        }
        let news = minted.facts().iter().filter(|fact| fleet.judge(fact) == Merge::News);
        facts.extend(news.cloned());
    }

    pub(super) fn handle_stored(&mut self, ticket: StoreTicket) {
        self.desk.spoken = true;
        if self.desk.broken_at.take().is_some() {
            self.event("minting-resumed", "the disk takes what is decided again");
        }
        if self.desk.in_flight == Some(ticket) {
            self.desk.in_flight = None;
            for (key, number) in core::mem::take(&mut self.desk.epochs_in_flight) {
                if let Some(book) = self.epochs.get_mut(&key) {
                    book.note_stored(number);
                }
            }
            if let Some(root) = self.burial.root_in_flight.take() {
                self.burial.root_stored = Some(root);
            }
            for (key, run) in core::mem::take(&mut self.desk.runs_in_flight) {
                if let Some(book) = self.runs.get_mut(&key) {
                    book.stored = book.stored.max(run);
                }
            }
        }
        let (done, waiting) =
            core::mem::take(&mut self.desk.mints).into_iter().partition(|m| m.ticket <= ticket);
        self.desk.mints = waiting;
        for mint in done {
            self.mesh.publish(mint.records);
            if let Some((request, answer)) = mint.answer {
                self.effects.push_back(Effect::Answer { request, result: Ok(answer) });
            }
        }
    }

    /// Keeps running, mints nothing, says so.
    pub(super) fn handle_store_failed(&mut self, ticket: StoreTicket, reason: &str) {
        self.desk.spoken = true;
        // what could not be stored was not made: the disk must not bring it back
        self.desk.told = false;
        self.desk.broken_at = Some(self.handled_at);
        if self.desk.in_flight == Some(ticket) {
            self.desk.in_flight = None;
        }
        let (lost, waiting): (Vec<Mint>, Vec<Mint>) =
            core::mem::take(&mut self.desk.mints).into_iter().partition(|m| m.ticket <= ticket);
        self.desk.mints = waiting;
        for mint in lost {
            if let Some((request, _)) = mint.answer {
                let text = format!("{} could not store it: {reason}", self.me);
                self.effects.push_back(Effect::Answer { request, result: Err(text) });
            }
        }
        self.event("minting-paused", String::from(reason));
        self.plans.pause(self.handled_at);
        self.desk.dirty = true;
    }
}

/// All kinds are, but for planted defects.
fn is_stored(kind: RecordKind) -> bool {
    match kind {
        RecordKind::ROLE => !planted::is(Defect::TermNotStored),
        RecordKind::ASSIGNMENT if planted::is(Defect::HomesNotStored) => false,
        _ => !planted::is(Defect::SystemNotStored),
    }
}
