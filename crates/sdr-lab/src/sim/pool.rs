//! One copy of what all brains of a fleet hold equal, so that a thousand of them fit in memory.

use std::{
    collections::HashMap,
    hash::{BuildHasher, BuildHasherDefault, DefaultHasher, Hash},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use sdr_core::mesh::{AuthorKey, Commons, Fact, FleetRecord, Saying};

/// When so many entries came since the last look, those that nobody holds any more go.
const TIDY_AFTER: usize = 4096;

/// Facts and sayings of a fleet. It decides nothing: what it gives equals what was asked for.
#[derive(Debug, Default)]
pub(crate) struct Pool {
    facts: Mutex<Shelf<Fact>>,
    sayings: Mutex<Shelf<Saying>>,
}

/// Things by their hash; of two that share one only the latest is kept.
#[derive(Debug)]
struct Shelf<T> {
    kept: HashMap<u64, Arc<T>, BuildHasherDefault<DefaultHasher>>,
    came: usize,
}

impl<T> Default for Shelf<T> {
    fn default() -> Self {
        Self { kept: HashMap::default(), came: 0 }
    }
}

impl<T> Shelf<T> {
    fn find(&self, hash: u64, is_it: impl Fn(&T) -> bool) -> Option<Arc<T>> {
        self.kept.get(&hash).filter(|kept| is_it(kept)).cloned()
    }

    fn keep(&mut self, hash: u64, thing: &Arc<T>) {
        if self.kept.get(&hash).is_some_and(|kept| Arc::ptr_eq(kept, thing)) {
            return;
        }
        self.kept.insert(hash, Arc::clone(thing));
        self.came += 1;
        if self.came > TIDY_AFTER.max(self.kept.len()) {
            self.came = 0;
            self.kept.retain(|_, kept| Arc::strong_count(kept) > 1);
        }
    }
}

impl Commons for Pool {
    fn fact(&self, record: &FleetRecord) -> Option<Arc<Fact>> {
        lock(&self.facts).find(hash_of_record(record), |fact| fact.record() == record)
    }

    fn keep_fact(&self, fact: &Arc<Fact>) {
        lock(&self.facts).keep(hash_of_record(fact.record()), fact);
    }

    fn saying(&self, key: &AuthorKey, value: &[u8]) -> Option<Arc<Saying>> {
        let is_it = |saying: &Saying| saying.key() == key && saying.value() == value;
        lock(&self.sayings).find(hash_of((key, value)), is_it)
    }

    fn keep_saying(&self, saying: &Arc<Saying>) {
        lock(&self.sayings).keep(hash_of((saying.key(), saying.value())), saying);
    }
}

fn lock<T>(shelf: &Mutex<Shelf<T>>) -> MutexGuard<'_, Shelf<T>> {
    shelf.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Values differ nearly always: keys need not be looked at.
fn hash_of_record(record: &FleetRecord) -> u64 {
    hash_of((&record.key.name, &record.value, record.version.revision))
}

fn hash_of(thing: impl Hash) -> u64 {
    BuildHasherDefault::<DefaultHasher>::default().hash_one(thing)
}
