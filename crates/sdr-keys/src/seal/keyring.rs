//! Several keys open, one seals.

use std::{collections::BTreeMap, fmt, time::Duration};

use sdr_core::time::Instant;

use super::Refusal;
use crate::mesh_key::{KeyId, MeshKey};

/// From when on a key that was just learnt seals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Begin {
    /// Others seal with it already.
    Now,
    /// After the grace, so that the others learn it too.
    AfterGrace,
}

/// The mesh keys of one robot, each with the moment from which it may seal.
///
/// A key opens as soon as it is known; when a newer one has been sealing for a grace, it
/// opens no more.
#[derive(Clone)]
pub struct Keyring {
    grace: Duration,
    held: BTreeMap<KeyId, Held>,
}

#[derive(Clone)]
struct Held {
    key: MeshKey,
    /// From when on it may seal.
    since: Instant,
}

impl Keyring {
    /// Keys known at the start: the newest seals at once, older ones open for a grace.
    ///
    /// # Panics
    /// When there is none.
    pub(super) fn new(
        keys: impl IntoIterator<Item = MeshKey>,
        grace: Duration,
        now: Instant,
    ) -> Self {
        let held = keys.into_iter().map(|key| (key.id(), Held { key, since: now }));
        let held: BTreeMap<KeyId, Held> = held.collect();
        assert!(!held.is_empty(), "a seal needs a key");
        Self { grace, held }
    }

    /// Takes a key that was just learnt; one of the same number stays as it is.
    pub(super) fn add(&mut self, now: Instant, key: MeshKey, begin: Begin) {
        let since = match begin {
            Begin::Now => now,
            Begin::AfterGrace => now + self.grace,
        };
        self.held.entry(key.id()).or_insert(Held { key, since });
        self.drop_retired(now);
    }

    /// The key that seals now: the newest whose grace is over, else the oldest.
    pub(super) fn sealing(&self, now: Instant) -> &MeshKey {
        let ready = self.held.values().rev().find(|held| held.since <= now);
        &ready.or_else(|| self.held.values().next()).expect("there is always a key").key
    }

    /// The key `id`, when it opens now.
    pub(super) fn opening(&self, now: Instant, id: KeyId) -> Result<&MeshKey, Refusal> {
        let newer = self.held.range(id..).filter(|(other, _)| **other != id);
        let retired = newer.into_iter().any(|(_, held)| held.since + self.grace <= now);
        match self.held.get(&id) {
            Some(held) if !retired => Ok(&held.key),
            Some(_) => Err(Refusal::Retired(id)),
            None if retired || id < self.newest() => Err(Refusal::Retired(id)),
            None => Err(Refusal::NoKey(id)),
        }
    }

    /// The greatest number.
    pub fn newest(&self) -> KeyId {
        *self.held.keys().next_back().expect("there is always a key")
    }

    /// The number of the key that seals at `now`.
    pub fn seals_with(&self, now: Instant) -> KeyId {
        self.sealing(now).id()
    }

    fn drop_retired(&mut self, now: Instant) {
        let retired: Vec<KeyId> =
            self.held.keys().filter(|id| self.opening(now, **id).is_err()).copied().collect();
        for id in retired {
            self.held.remove(&id);
        }
    }
}

impl fmt::Debug for Keyring {
    /// Numbers only.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_set().entries(self.held.keys().map(|id| id.0)).finish()
    }
}
