//! What the mesh brought: which robots live, which records changed.

use alloc::{format, vec::Vec};

use super::{Brain, index::Stir, systems::Changed};
use crate::{
    id::RobotId,
    input::InstanceId,
    mesh::{MeshNews, Spoken},
    planted::{self, Defect},
    time::Instant,
};

/// Addresses that speak under this robot's name, told once each.
const DUPLICATES_TOLD_MAX: usize = 16;

impl Brain {
    pub(super) fn take_news(&mut self, now: Instant) {
        let mut changed = Changed::default();
        while let Some(news) = self.mesh.poll_news() {
            match news {
                MeshNews::Report(robot, spoken) => {
                    self.note_hold(now, &robot);
                    self.note_report(robot, &spoken);
                }
                MeshNews::Record(key) => {
                    self.desk.mark_dirty();
                    self.stir.fleet = true;
                    self.note_home(now, &key);
                    changed.note(&key);
                    self.take_latch(&key);
                }
                MeshNews::Alive(robot) => {
                    self.note_presence(&robot);
                    let text = format!("{robot} is heard");
                    self.event("robot-alive", text);
                    if planted::is(Defect::RestartedByHeal) {
                        let ids: Vec<InstanceId> = self.instances.keys().copied().collect();
                        ids.into_iter().for_each(|id| self.finish(id));
                    }
                    self.plans.retry_soon();
                    self.stir = Stir::ALL;
                }
                // usual on a lossy link, over in a moment, and asked about by the mesh itself
                MeshNews::Quiet(_) => {}
                MeshNews::Isolated => {
                    self.stir = Stir::ALL;
                    self.event("isolated", "hears nobody; decides nothing for others");
                }
                MeshNews::Rejoined => {
                    self.stir = Stir::ALL;
                    self.event("rejoined", "hears others again");
                }
                MeshNews::Gone(robot) => {
                    self.note_presence(&robot);
                    self.stir.fleet = true;
                    self.note_gone(now, &robot);
                }
                MeshNews::DuplicateId(from) => {
                    if self.duplicates_told.len() < DUPLICATES_TOLD_MAX
                        && self.duplicates_told.insert(from)
                    {
                        let text = format!("{from} speaks under this robot's name");
                        self.event("duplicate-robot-id", text);
                    }
                }
            }
        }
        if changed.has_parts() {
            self.note_blobs(now);
        }
        self.refresh(&changed);
    }

    /// Looks at what a report concerns, and at nothing when it is figures alone: those are
    /// looked at when their time comes.
    fn note_report(&mut self, robot: RobotId, spoken: &Spoken) {
        let index = &self.index;
        let moves = !self.moves.is_empty() || !index.moving.is_empty() || !index.backed.is_empty();
        self.stir.fleet |=
            spoken.facts || spoken.conditions || (moves && !spoken.components.is_empty());
        self.stir.here |= spoken.components.iter().any(|key| self.index.touches(&key.system));
        if spoken.conditions {
            self.index.troubled.insert(robot);
        }
    }
}
