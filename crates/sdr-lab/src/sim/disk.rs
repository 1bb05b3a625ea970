//! The disk of one robot: takes its time, may be full, and a crash may come in between.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
    time::Duration,
};

use sdr_core::{
    blob::{Blob, BlobHash},
    effect::{StoredChange, StoredState},
    input::StoreTicket,
};

/// Time a write takes on a healthy disk.
pub(crate) const STORE_TIME: Duration = Duration::from_millis(3);

/// An order to store: what changed up to a ticket.
#[derive(Debug)]
pub(crate) struct Order {
    ticket: StoreTicket,
    changes: Vec<StoredChange>,
}

impl Order {
    pub(crate) fn new(ticket: StoreTicket, change: StoredChange) -> Self {
        Self { ticket, changes: vec![change] }
    }
}

/// One order is written at a time; those that wait are written together.
#[derive(Debug)]
pub(crate) struct Disk {
    held: Option<StoredState>,
    blobs: BTreeMap<BlobHash, Arc<Vec<u8>>>,
    /// Changes that did not get there: the next write brings them too.
    failed: Vec<StoredChange>,
    writing: Option<Order>,
    waiting: Option<Order>,
    /// Whether the robot will ever read it; a state that nobody reads is not kept.
    pub(crate) is_read: bool,
    pub(crate) full: bool,
    pub(crate) time: Duration,
}

impl Disk {
    pub(crate) fn new() -> Self {
        Self {
            held: None,
            blobs: BTreeMap::new(),
            failed: Vec::new(),
            writing: None,
            waiting: None,
            is_read: true,
            full: false,
            time: STORE_TIME,
        }
    }

    /// Takes an order; true when its write begins now.
    pub(crate) fn order(&mut self, order: Order) -> bool {
        if self.writing.is_none() {
            self.writing = Some(order);
            return true;
        }
        match &mut self.waiting {
            Some(waiting) => {
                waiting.ticket = order.ticket;
                waiting.changes.extend(order.changes);
            }
            None => self.waiting = Some(order),
        }
        false
    }

    /// The write under way is over; true when the next one begins.
    pub(crate) fn finish(&mut self) -> (Option<StoreTicket>, bool) {
        let Some(order) = self.writing.take() else { return (None, false) };
        let ticket = order.ticket;
        self.write(order, !self.full);
        self.writing = self.waiting.take();
        (Some(ticket), self.writing.is_some())
    }

    fn write(&mut self, order: Order, succeeds: bool) {
        if !self.is_read {
            // others may ask for what is on it all the same
            let changes = order.changes.into_iter().filter(|_| succeeds);
            changes.for_each(|change| self.keep(change.blobs));
            return;
        }
        self.failed.extend(order.changes);
        if succeeds {
            for mut change in std::mem::take(&mut self.failed) {
                self.keep(std::mem::take(&mut change.blobs));
                self.held.get_or_insert_default().take(change);
            }
            self.sweep();
        }
    }

    fn keep(&mut self, blobs: Vec<Blob>) {
        self.blobs.extend(blobs.into_iter().map(|blob| (blob.hash, blob.bytes)));
    }

    /// What the state does not name any more goes.
    fn sweep(&mut self) {
        if let (Some(held), false) = (&self.held, self.blobs.is_empty()) {
            let named: BTreeSet<BlobHash> = held.blobs().collect();
            self.blobs.retain(|hash, _| named.contains(hash));
        }
    }

    /// A blob that is here.
    pub(crate) fn blob(&self, hash: &BlobHash) -> Option<&Arc<Vec<u8>>> {
        self.blobs.get(hash)
    }

    /// Power is lost; what was being written is there or not.
    pub(crate) fn crash(&mut self, written: Written) {
        self.waiting = None;
        if let Some(order) = self.writing.take() {
            self.write(order, written == Written::Whole && !self.full);
        }
        self.failed.clear();
    }

    pub(crate) fn wipe(&mut self) {
        *self = Self { is_read: self.is_read, ..Self::new() };
    }

    pub(crate) fn held(&self) -> Option<&StoredState> {
        self.held.as_ref()
    }
}

/// What a crash leaves of the write under way; a file is replaced as a whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Written {
    Whole,
    NotAtAll,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn order(ticket: StoreTicket) -> Order {
        Order::new(ticket, StoredChange { incarnation: ticket, ..StoredChange::default() })
    }

    fn held(disk: &Disk) -> Option<u64> {
        disk.held().map(|state| state.incarnation)
    }

    #[test]
    fn the_newest_of_those_that_wait_is_written_next() {
        let mut disk = Disk::new();
        assert!(disk.order(order(1)) && !disk.order(order(2)) && !disk.order(order(3)));
        assert_eq!((disk.finish(), held(&disk)), ((Some(1), true), Some(1)));
        assert_eq!((disk.finish(), held(&disk)), ((Some(3), false), Some(3)));
    }

    #[test]
    fn a_crash_keeps_the_old_state_or_the_new_one() {
        for (written, left) in [(Written::NotAtAll, 1), (Written::Whole, 2)] {
            let mut disk = Disk::new();
            disk.order(order(1));
            disk.finish();
            disk.order(order(2));
            disk.order(order(3));
            disk.crash(written);
            assert_eq!((held(&disk), disk.finish().0), (Some(left), None));
        }
    }
}
