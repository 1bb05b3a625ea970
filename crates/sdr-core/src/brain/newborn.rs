//! Rule 7: after the loss of its disk a robot starts nothing until others could tell it how
//! often it has lived. Who finds nobody that knows it is new; who cannot be sure makes no
//! number that it may have made before.

use alloc::string::String;

use super::Brain;
use crate::{
    mesh::Memory,
    order::hash64,
    planted::{self, Defect},
    record::{FleetKey, RecordKind},
    time::{Duration, Instant},
};

/// In step with a peer, a newborn waits so long for the others it was to begin with.
const MET_WITHIN: Duration = Duration::from_millis(1500);
/// Who meets nobody waits so long.
pub(super) const ALONE_AFTER: Duration = Duration::from_secs(5);
/// The first number that a forgetful robot makes of something lies up to so far behind the
/// greatest it knows.
const FORGOTTEN_NUMBERS: u64 = 1 << 24;

impl Brain {
    /// It has no life of its own yet: its disk was empty, and nobody corrected it so far.
    pub(super) fn is_newborn(&self) -> bool {
        self.mesh.incarnation().counter == 0
    }

    pub(super) fn consider_growing_up(&mut self, now: Instant) {
        if !self.is_newborn() {
            return;
        }
        if self.mesh.is_in_step() {
            self.met_at.get_or_insert(now);
        }
        let alone = self.is_surely_alone();
        let waited = self.newborn_deadline().is_some_and(|at| now >= at);
        if alone || waited || self.mesh.has_met_seeds() {
            let is_new = (alone || self.mesh.is_new()) && !self.is_remembered();
            self.mesh.grow_up(if is_new { Memory::Whole } else { Memory::Lost });
            self.desk.mark_urgent();
        }
    }

    pub(super) fn newborn_deadline(&self) -> Option<Instant> {
        let alone = self.started_at + ALONE_AFTER;
        let met = self.met_at.map_or(alone, |at| (at + MET_WITHIN).min(alone));
        self.is_newborn().then_some(met)
    }

    /// Whether the fleet table knows this robot by something that it did not make just now.
    fn is_remembered(&self) -> bool {
        let records = self.mesh.fleet().records();
        let made = records.map(|(record, _)| record).filter(|record| {
            let minted = record.version.epoch.as_ref().map(|epoch| &epoch.minted_by);
            record.version.author == self.me || minted == Some(&self.me)
        });
        self.index.at(&self.me).next().is_some()
            || made.into_iter().any(|record| !self.desk.made(&record.key))
    }

    /// The number after `known` of what stands under a key: of a system's revisions, of terms,
    /// of a component's epochs and their revisions.
    ///
    /// A robot that lost its disk may have made the next ones already, and others may hold
    /// them: its first one lies a random way further on.
    pub(super) fn number_after(&self, kind: RecordKind, name: &str, known: u64) -> u64 {
        let forgot = self.mesh.may_have_forgotten() && !self.is_surely_alone();
        let key = FleetKey { kind, name: if forgot { name.into() } else { String::new() } };
        if !forgot || self.desk.made(&key) || planted::is(Defect::ForgottenReused) {
            return known.saturating_add(1);
        }
        let life = hash64(&self.config.seed.to_le_bytes());
        let chance = hash64(key.name.as_bytes()).rotate_left(32) ^ life;
        known.saturating_add(1 + hash64(&chance.to_le_bytes()) % FORGOTTEN_NUMBERS)
    }
}
