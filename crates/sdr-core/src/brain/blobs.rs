//! Large parts of systems: which are named, which are here, and whom to ask for the others.

use alloc::{collections::BTreeMap, format, string::String, sync::Arc, vec::Vec};
use core::net::SocketAddr;

use super::{Brain, parts::LargePart, systems::Changed};
use crate::{
    blob::{Blob, BlobHash, BlobRef, PARTS_BYTES_MAX},
    effect::Effect,
    id::RobotId,
    input::StoreTicket,
    mesh::FleetRecord,
    order::hash64,
    record::{FleetValue, RecordKind},
    time::{Duration, Instant},
};

/// Robots that are asked, one after the other, before the brain is told that nobody had it.
const ASKED_MAX: usize = 4;
/// Transfers under way at a time.
const FETCHES_MAX: usize = 4;
/// Pause after nobody had it, doubled each time.
const RETRY_MIN: Duration = Duration::from_millis(500);
/// Longest pause.
const RETRY_MAX: Duration = Duration::from_secs(8);
/// A transfer that is not answered for so long is forgotten; its answer still counts.
const ANSWER_MAX: Duration = Duration::from_secs(120);

/// A part that is here.
#[derive(Clone, Debug)]
struct Here {
    /// `None` when its bytes are no part: whoever made it wrote nonsense.
    part: Option<FleetValue>,
    length: usize,
    /// Its bytes, until they are on the disk.
    unsaved: Option<Arc<Vec<u8>>>,
}

/// A part that is named and not here.
#[derive(Clone, Debug)]
struct Missing {
    name: BlobRef,
    kind: RecordKind,
    /// What it is a part of, for people.
    what: String,
    author: RobotId,
    tries: u32,
    /// Under way since then.
    asked_at: Option<Instant>,
    retry_at: Instant,
}

/// All large parts that records name.
#[derive(Clone, Debug, Default)]
pub(super) struct BlobDesk {
    here: BTreeMap<BlobHash, Here>,
    missing: BTreeMap<BlobHash, Missing>,
    /// Which store order has what was unsaved then.
    saving: Option<(StoreTicket, Vec<BlobHash>)>,
    refused_told: bool,
}

impl BlobDesk {
    /// The part that `name` stands for, when it is here.
    pub(super) fn part(&self, name: &BlobRef) -> Option<&FleetValue> {
        self.here.get(&name.hash)?.part.as_ref()
    }

    /// Keeps a part that was made here.
    pub(super) fn keep(&mut self, part: LargePart) {
        let LargePart { name, value, bytes, .. } = part;
        let length = bytes.len();
        self.missing.remove(&name.hash);
        self.here.entry(name.hash).or_insert_with(|| Here {
            part: Some(value),
            length,
            unsaved: Some(Arc::new(bytes)),
        });
    }

    /// What goes to the disk with the order `ticket`.
    pub(super) fn unsaved(&mut self, ticket: StoreTicket) -> Vec<Blob> {
        let unsaved = self.here.iter().filter_map(|(hash, here)| {
            here.unsaved.as_ref().map(|bytes| Blob { hash: *hash, bytes: bytes.clone() })
        });
        let blobs: Vec<Blob> = unsaved.collect();
        self.saving = Some((ticket, blobs.iter().map(|blob| blob.hash).collect()));
        blobs
    }

    /// The order `ticket` reached the disk.
    pub(super) fn saved(&mut self, ticket: StoreTicket) {
        if let Some((_, hashes)) = self.saving.take_if(|(saving, _)| *saving <= ticket) {
            for hash in hashes {
                if let Some(here) = self.here.get_mut(&hash) {
                    here.unsaved = None;
                }
            }
        }
    }

    /// When somebody is to be asked again.
    pub(super) fn next_deadline(&self) -> Option<Instant> {
        let due = |missing: &Missing| match missing.asked_at {
            Some(at) => at + ANSWER_MAX,
            None => missing.retry_at,
        };
        self.missing.values().map(due).min()
    }

    fn bytes_named(&self) -> usize {
        let here = self.here.values().map(|here| here.length);
        let missing = self.missing.values().map(|missing| length(&missing.name));
        here.chain(missing).sum()
    }
}

fn length(name: &BlobRef) -> usize {
    usize::try_from(name.length).unwrap_or(usize::MAX)
}

impl Brain {
    /// Compares what records name with what is here: what nobody names goes, what is missing
    /// is asked for.
    pub(super) fn note_blobs(&mut self, now: Instant) {
        let mut named: BTreeMap<BlobHash, (RecordKind, String, RobotId, BlobRef)> = BTreeMap::new();
        for (fact, name) in self.mesh.fleet().facts().large() {
            let (key, author) = (fact.key(), fact.version().author.clone());
            named.insert(name.hash, (key.kind, key.name.clone(), author, *name));
        }
        let minted: Vec<BlobHash> = self.desk.minted().filter_map(hash_in).collect();
        self.blobs.here.retain(|hash, _| named.contains_key(hash) || minted.contains(hash));
        self.blobs.missing.retain(|hash, _| named.contains_key(hash));
        for (hash, (kind, what, author, name)) in named {
            if self.blobs.here.contains_key(&hash) || self.blobs.missing.contains_key(&hash) {
                continue;
            }
            let fits = self.blobs.bytes_named().saturating_add(length(&name)) <= PARTS_BYTES_MAX;
            if !name.is_allowed() || !fits {
                self.refuse_blob(&what, &name);
                continue;
            }
            let missing =
                Missing { name, kind, what, author, tries: 0, asked_at: None, retry_at: now };
            self.blobs.missing.insert(hash, missing);
        }
    }

    fn refuse_blob(&mut self, what: &str, name: &BlobRef) {
        if !core::mem::replace(&mut self.blobs.refused_told, true) {
            let text = format!(
                "{what} has {} bytes; a part has at most {}, all together at most {PARTS_BYTES_MAX}",
                name.length,
                crate::blob::PART_BYTES_MAX
            );
            self.event("part-refused", text);
        }
    }

    /// Asks for what is missing and due.
    pub(super) fn fetch_blobs(&mut self, now: Instant) {
        if self.blobs.missing.is_empty() {
            return;
        }
        for missing in self.blobs.missing.values_mut() {
            missing.asked_at.take_if(|at| now.since(*at) >= ANSWER_MAX);
        }
        let under_way = self.blobs.missing.values().filter(|one| one.asked_at.is_some()).count();
        let waits = |one: &&Missing| one.asked_at.is_none() && one.retry_at <= now;
        let due: Vec<Missing> = self.blobs.missing.values().filter(waits).cloned().collect();
        for missing in due.into_iter().take(FETCHES_MAX.saturating_sub(under_way)) {
            let from = self.holders_of(&missing);
            if let Some(entry) = self.blobs.missing.get_mut(&missing.name.hash) {
                entry.asked_at = Some(now);
            }
            let Missing { name, .. } = missing;
            self.effects.push_back(Effect::Fetch { blob: name, from });
        }
    }

    /// Who may have it: its author first, then others, another part of them each time.
    fn holders_of(&self, missing: &Missing) -> Vec<SocketAddr> {
        let mut robots: Vec<&RobotId> = self.mesh.alive().collect();
        robots.sort();
        if !robots.is_empty() {
            // robots that miss it at the same time should not all ask the same one
            let salt = usize::try_from(hash64(self.me.as_str().as_bytes()) & 0xffff).unwrap_or(0);
            let tries = usize::try_from(missing.tries).unwrap_or(0);
            let turn = salt.wrapping_add(tries * (ASKED_MAX - 1)) % robots.len();
            robots.rotate_left(turn);
        }
        robots.sort_by_key(|robot| **robot != missing.author);
        robots.into_iter().filter_map(|robot| self.mesh.address(robot)).take(ASKED_MAX).collect()
    }

    /// What came of [`Effect::Fetch`].
    pub(super) fn handle_fetched(
        &mut self,
        now: Instant,
        blob: BlobRef,
        result: Result<Vec<u8>, String>,
    ) {
        let Some(missing) = self.blobs.missing.get_mut(&blob.hash) else { return };
        let result = result.and_then(|bytes| match blob.is_of(&bytes) {
            true => Ok(bytes),
            false => Err(format!("{} bytes that are not it", bytes.len())),
        });
        match result {
            Ok(bytes) => {
                let what = missing.what.clone();
                let part = FleetValue::decode(missing.kind.of_large(), &bytes).ok();
                let length = bytes.len();
                let readable = part.is_some();
                self.blobs.missing.remove(&blob.hash);
                let here = Here { part, length, unsaved: Some(Arc::new(bytes)) };
                self.blobs.here.insert(blob.hash, here);
                if !readable {
                    self.event("part-refused", format!("{what}: {length} bytes that are no part"));
                }
                self.desk.mark_dirty();
                // several systems may have the same policy
                let mut changed = Changed::default();
                let of = self.mesh.fleet().facts().large();
                of.filter(|(_, name)| name.hash == blob.hash)
                    .for_each(|(fact, _)| changed.note(fact.key()));
                self.refresh(&changed);
            }
            Err(reason) => {
                missing.asked_at = None;
                let pause = RETRY_MIN.saturating_mul(1 << missing.tries.min(5)).min(RETRY_MAX);
                missing.retry_at = now + pause;
                missing.tries = missing.tries.saturating_add(1);
                if missing.tries == 2 {
                    let text = format!("{}, {} bytes: {reason}", missing.what, blob.length);
                    self.event("part-missing", text);
                }
            }
        }
    }
}

/// What a record names.
fn hash_in(record: &FleetRecord) -> Option<BlobHash> {
    match FleetValue::decode(record.key.kind, &record.value) {
        Ok(FleetValue::Large(name)) => Some(name.hash),
        Ok(_) | Err(_) => None,
    }
}
