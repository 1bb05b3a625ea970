//! What the bridge did, route by route.

use std::{
    collections::BTreeMap,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicU64, Ordering::Relaxed},
    },
};

use super::transport::Way;

macro_rules! counters {
    ($($(#[$doc:meta])* $name:ident,)*) => {
        /// One route's counts since it was made.
        #[derive(Clone, Debug, Default, PartialEq, Eq)]
        pub(crate) struct RouteCounters {
            $($(#[$doc])* pub(crate) $name: u64,)*
        }

        impl RouteCounters {
            /// All of them with their names.
            pub(crate) fn named(&self) -> impl Iterator<Item = (&'static str, u64)> {
                [$((stringify!($name), self.$name),)*].into_iter()
            }
        }

        /// The same, while they grow.
        #[derive(Debug, Default)]
        pub(crate) struct Counts {
            $(pub(crate) $name: Count,)*
        }

        impl Counts {
            fn read(&self) -> RouteCounters {
                RouteCounters { $($name: self.$name.0.load(Relaxed),)* }
            }
        }
    };
}

counters! {
    /// Remote endpoints joined to it now.
    matched,
    /// Samples handed to the network.
    forwarded,
    /// Their bytes.
    forwarded_bytes,
    /// Samples put into this robot's shared memory.
    injected,
    /// Their bytes.
    injected_bytes,
    /// Not forwarded: they carried another token than the active instance's.
    refused_token,
    /// Not forwarded: a bridge had put them here.
    refused_injected,
    /// Kept for a moment, because the robot that minted their epoch was not known yet.
    held,
    /// Dropped: that robot stayed unknown, or too many were held.
    dropped_unnamed,
    /// Dropped: larger than may cross robots.
    dropped_large,
    /// Dropped: more bytes a second than a reliable port may carry.
    dropped_rate,
    /// Dropped: the network's side refused them.
    dropped_unsent,
    /// Dropped: no shared memory for them.
    dropped_memory,
    /// Dropped: sent by a DDS program that is no bridge, or in another encoding.
    dropped_foreign,
}

/// One growing or set number.
#[derive(Debug, Default)]
pub(crate) struct Count(AtomicU64);

impl Count {
    pub(crate) fn add(&self, more: u64) {
        self.0.fetch_add(more, Relaxed);
    }

    pub(crate) fn set(&self, value: u64) {
        self.0.store(value, Relaxed);
    }
}

/// Which counts belong to which route; shared by the bridge and those who ask.
#[derive(Debug, Default)]
pub(crate) struct Ledger(Mutex<BTreeMap<(String, Way), Arc<Counts>>>);

impl Ledger {
    /// Fresh counts for a route.
    pub(crate) fn open(&self, path: &str, way: Way) -> Arc<Counts> {
        let counts = Arc::new(Counts::default());
        self.lock().insert((path.to_owned(), way), Arc::clone(&counts));
        counts
    }

    pub(crate) fn close(&self, path: &str, way: Way) {
        self.lock().remove(&(path.to_owned(), way));
    }

    /// What each route did so far.
    pub(crate) fn read(&self) -> Vec<(String, Way, RouteCounters)> {
        let lock = self.lock();
        lock.iter().map(|((path, way), counts)| (path.clone(), *way, counts.read())).collect()
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, BTreeMap<(String, Way), Arc<Counts>>> {
        // A map of counters is whole after each call, whoever panicked between them.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
