//! The sending half.

use super::{
    Chance,
    header::{COUNTER_MAX, Header, Kind, Start, SubKey},
};
use crate::mesh_key::MeshKey;

/// Seals under one start after the other.
pub(super) struct Sealer {
    start: Start,
    counter: u64,
    sub_key: Option<SubKey>,
}

impl Sealer {
    /// Seals under a new start.
    pub(super) fn new(chance: &mut Chance) -> Self {
        let mut start = Start::default();
        chance(&mut start);
        Self { start, counter: 0, sub_key: None }
    }

    /// Names the present start.
    pub(super) fn start(&self) -> &Start {
        &self.start
    }

    /// One datagram. After 2^40 of them a new start begins, which others challenge anew.
    pub(super) fn seal(
        &mut self,
        key: &MeshKey,
        kind: Kind,
        bytes: &[u8],
        chance: &mut Chance,
    ) -> Vec<u8> {
        if self.counter == COUNTER_MAX {
            *self = Self::new(chance);
        }
        self.counter += 1;
        let header = Header { kind, key: key.id(), start: self.start, counter: self.counter };
        let known = self.sub_key.take().filter(|sub_key| sub_key.id == key.id());
        let sub_key = known.unwrap_or_else(|| SubKey::new(key, &self.start));
        let datagram = sub_key.seal(&header, bytes);
        self.sub_key = Some(sub_key);
        datagram
    }

    #[cfg(test)]
    pub(super) fn set_counter(&mut self, counter: u64) {
        self.counter = counter;
    }
}
