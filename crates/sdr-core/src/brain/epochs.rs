//! Epochs that this robot may mint without waiting for its disk (rule 4 of the order).
//!
//! Whoever stands by reserves a block of numbers while it gets ready. Whatever was reserved
//! counts as used after a restart, so that (number, this robot) never names two choices.

use alloc::string::ToString;

use super::Brain;
use crate::{
    id::ComponentKey,
    order::Epoch,
    record::{FleetKey, RecordKind},
};

/// Numbers reserved at a time.
const BLOCK: u64 = 16;
/// The next block is reserved when so few are left.
const LEFT_MIN: u64 = 4;

/// Numbers of one component's epochs: used by this robot, reserved, and that on disk.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct EpochBook {
    last: u64,
    pub(super) reserved: u64,
    pub(super) stored: u64,
}

impl EpochBook {
    /// After a start: everything reserved may have been used.
    pub(super) fn from_disk(reserved: u64) -> Self {
        Self { last: reserved, reserved, stored: reserved }
    }

    /// Numbers up to this one are on disk.
    pub(super) fn note_stored(&mut self, reserved: u64) {
        self.stored = self.stored.max(reserved);
    }
}

impl Brain {
    /// The epoch that this robot mints after `before`.
    pub(super) fn next_epoch(&self, key: &ComponentKey, before: Option<&Epoch>) -> Epoch {
        let used = self.epochs.get(key).map_or(0, |book| book.last);
        let known = match before {
            Some(epoch) => epoch.number.max(used),
            None => self.mesh.fleet().epoch_floor().max(used),
        };
        let number = self.number_after(RecordKind::ASSIGNMENT, &key.to_string(), known);
        Epoch { number, minted_by: self.me.clone() }
    }

    /// Keeps numbers beyond the present epoch reserved.
    pub(super) fn reserve_epochs(&mut self, key: &ComponentKey) {
        let present = self.wanted(key).and_then(|(version, _)| version.epoch.as_ref());
        let Some(present) = present.map(|epoch| epoch.number) else { return };
        let used = self.epochs.get(key).map_or(0, |book| book.last);
        let mut next = present.max(used);
        if self.mesh.may_have_forgotten() {
            // after a lost disk the next number lies a random way further on
            next = self.number_after(RecordKind::ASSIGNMENT, &key.to_string(), next) - 1;
        }
        let book = self.epochs.entry(key.clone()).or_default();
        if next + LEFT_MIN > book.reserved {
            book.reserved = next.saturating_add(BLOCK);
            self.desk.mark_urgent();
        }
    }

    /// Whether this number may be sent at once.
    pub(super) fn is_reserved(&self, key: &ComponentKey, epoch: &Epoch) -> bool {
        self.epochs.get(key).is_some_and(|book| epoch.number <= book.stored)
    }

    pub(super) fn note_minted(&mut self, key: &ComponentKey, epoch: &Epoch) {
        self.desk.note_made(FleetKey { kind: RecordKind::ASSIGNMENT, name: key.to_string() });
        if let Some(book) = self.epochs.get_mut(key) {
            book.last = book.last.max(epoch.number);
        }
    }
}
