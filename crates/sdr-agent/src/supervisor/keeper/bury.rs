//! The end of a process: reaped, and told once, with what the kernel says of it.

use sdr_core::input::InstanceNews;

use super::Keeper;
use crate::limits;
use crate::supervisor::pidfd::End;

impl Keeper {
    /// Reaps the process and says how it ended.
    pub(super) async fn bury(mut self) {
        let (end, reason) = self.process.reap().await;
        let was_out_of_memory = self.was_out_of_memory(end, &reason);
        if let Some(group) = &self.process.keepsake.cgroup {
            limits::dissolve(group);
        }
        let instance = self.order.instance;
        tracing::debug!(event = "ended", component = %self.order.component, instance, reason);
        self.shared.kept.borrow_mut().remove(&instance);
        self.shared.journal.remove(instance);
        self.shared.outlets.watch.remove(instance, &self.shared.outlets.record);
        let news = match was_out_of_memory {
            true => InstanceNews::OutOfMemory { reason },
            false => InstanceNews::Exited { reason },
        };
        self.shared.tell(instance, news).await;
    }

    /// Whether the kernel, or its limit, took the memory away that it wanted.
    fn was_out_of_memory(&self, end: Option<End>, reason: &str) -> bool {
        let group = self.process.keepsake.cgroup.as_deref();
        let of_group = group.is_some_and(limits::was_out_of_memory);
        // One that we ended ourselves says nothing.
        let by_kernel =
            end == Some(End::Signal(9)) && !self.life.is_ending() && self.shared.oom.is_fresh();
        let refused = self.order.spec.limits.memory.is_some()
            && end != Some(End::Status(0))
            && limits::says_refused(reason);
        of_group || by_kernel || refused
    }
}
