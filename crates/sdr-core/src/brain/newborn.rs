//! Rule 7: after the loss of its disk a robot starts nothing until others could tell it how
//! often it has lived. Who finds nobody that knows it is new.

use super::Brain;
use crate::time::{Duration, Instant};

/// In step with a peer for so long without a correction: nobody knew it from before.
const CORRECTED_WITHIN: Duration = Duration::from_millis(500);
/// Who meets nobody waits so long.
pub(super) const ALONE_AFTER: Duration = Duration::from_secs(5);

/// The fleet's table names it, and nobody who knew it is left to say how often it lived: more
/// lives than any robot has had.
const FORGOTTEN_LIVES: u64 = 1000;

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
        if self.is_only_robot() || self.newborn_deadline().is_some_and(|at| now >= at) {
            let named = self.role().is_some_and(|role| role.holder == self.me)
                || self.index.at(&self.me).next().is_some();
            // who met nobody cannot know either
            let unknown = named || (self.met_at.is_none() && !self.is_only_robot());
            self.mesh.grow_up(if unknown { FORGOTTEN_LIVES } else { 0 });
            self.desk.mark_urgent();
        }
    }

    pub(super) fn newborn_deadline(&self) -> Option<Instant> {
        let alone = self.started_at + ALONE_AFTER;
        let met = self.met_at.map_or(alone, |at| (at + CORRECTED_WITHIN).min(alone));
        self.is_newborn().then_some(met)
    }
}
