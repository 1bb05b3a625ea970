//! When the brain wants to be woken.

use super::{Brain, judge::Engine};
use crate::time::Instant;

impl Brain {
    /// When `Input::Tick` is due at the latest.
    pub fn next_deadline(&self) -> Option<Instant> {
        let timer = self.timer_at.into_iter();
        timer.chain([self.mesh.next_deadline(), self.look_at]).min()
    }

    /// The next thing that is to be done at some time; a timer that is already past was acted
    /// on and waits for something else.
    pub(super) fn next_timer(&self) -> Option<Instant> {
        self.timers().filter(|at| *at > self.handled_at).min()
    }

    /// All that is to be done at some time.
    fn timers(&self) -> impl Iterator<Item = Instant> {
        let restarts = self.restarts.values().map(|restart| restart.at);
        let drains = self.drains.values().map(|since| *since + self.config.drain_max);
        restarts
            .chain(drains)
            .chain(self.engines.values().filter_map(Engine::next_deadline))
            .chain(self.plans.next_deadline())
            .chain(self.instance_deadlines())
            .chain(self.move_deadlines())
            .chain(self.desk.retry_at())
            .chain(self.desk.store_at())
            .chain(self.desk_of_role.wake_at)
            .chain(self.lease.wake_at)
            .chain(self.blobs.next_deadline())
            .chain(self.guard.wake_at)
            .chain(self.lost.wake_at)
            .chain(self.told.next_deadline())
            .chain(self.spare_plans.values().map(|plan| plan.at))
            .chain((!self.began).then(|| self.begin_deadline()))
            .chain(self.newborn_deadline())
    }
}
