//! Starting processes: when, with which wiring, under which run.

use alloc::{boxed::Box, sync::Arc, vec::Vec};

use super::{
    Brain,
    instances::{Instance, RUNS_RESERVED, RunBook},
};
use crate::{
    effect::{Effect, InputWiring, LaunchOrder},
    id::ComponentKey,
    input::InstanceId,
    order::{Run, hash64},
    planted::{self, Defect},
    spec::{ComponentSpec, Qos, port_path},
    time::Instant,
};

/// Lives are so many runs apart. What the disk remembers goes on behind it in any case; a life
/// after a lost disk begins many lives further on.
const RUNS_PER_LIFE: u64 = 1 << 8;

impl Brain {
    /// Starts a process unless something speaks against it for now.
    pub(super) fn launch_when_due(&mut self, now: Instant, key: &ComponentKey) {
        if planted::is(Defect::NoRestart) && self.runs.get(key).is_some_and(|book| book.last > 0) {
            return;
        }
        let due = self.restarts.get(key).is_none_or(|restart| now >= restart.at);
        let ending = self.instances.values().any(|instance| instance.component == *key);
        if !due || ending || !self.may_begin(now) || self.is_given_up(key) {
            return;
        }
        if self.refuse_without_device(key) {
            return;
        }
        self.restarts.remove(key);
        self.launch(key);
    }

    /// Starts one more process.
    pub(super) fn launch(&mut self, key: &ComponentKey) {
        let Some((spec, inputs, output_depth)) = self.shape_parts(key) else { return };
        self.reserve_runs(key);
        self.instance_last += 1;
        let instance = self.instance_last;
        let shape = shape_hash(&spec, &inputs);
        self.instances.insert(instance, Instance::new(key.clone(), shape));
        self.reindex(key);
        let order = LaunchOrder { instance, component: key.clone(), spec, inputs, output_depth };
        self.effects.push_back(Effect::Launch(Box::new(order)));
    }

    /// Whether a process was started from another spec or wiring than its component has now.
    pub(super) fn is_old_edition(&mut self, id: InstanceId, key: &ComponentKey) -> bool {
        let Some(system) = self.systems.get(&key.system) else { return false };
        let seen = self.instances[&id].fits.as_ref();
        if seen.is_some_and(|seen| Arc::ptr_eq(seen, system)) {
            return false;
        }
        let system = Arc::clone(system);
        let parts = self.shape_parts(key);
        let shape = parts.map(|(spec, inputs, _)| shape_hash(&spec, &inputs));
        let Some(instance) = self.instances.get_mut(&id) else { return false };
        let old = shape.is_some_and(|shape| shape != instance.shape);
        instance.fits = (!old).then_some(system);
        old
    }

    fn shape_parts(&self, key: &ComponentKey) -> Option<(ComponentSpec, Vec<InputWiring>, u8)> {
        let system = self.systems.get(&key.system)?;
        let spec = system.component(&key.name)?.clone();
        let incoming = system.connections.iter().filter(|c| c.to.component == key.name);
        let inputs = incoming
            .map(|connection| InputWiring {
                port: connection.to.port.clone(),
                connection: connection.index,
                path: port_path(&system.key(&connection.from.component), &connection.from.port),
                message_type: connection.message_type.clone(),
                qos: connection.qos,
            })
            .collect();
        let outgoing = system.connections.iter().filter(|c| c.from.component == key.name);
        let depth = outgoing.map(|connection| connection.qos.depth).max();
        Some((spec, inputs, depth.unwrap_or(Qos::default().depth)))
    }

    /// Keeps a block of runs reserved on disk.
    fn reserve_runs(&mut self, key: &ComponentKey) {
        let first = self.first_run();
        let book = self.runs.entry(key.clone()).or_insert_with(RunBook::fresh);
        book.begin_at(first);
        if book.last + RUNS_RESERVED / 2 >= book.reserved {
            book.reserved = book.last.saturating_add(RUNS_RESERVED);
            self.desk.mark_urgent();
        }
    }

    /// Runs of this life are greater than those of all lives before, also when the disk that
    /// knew them is gone: others remember the life (rule 7).
    pub(super) fn first_run(&self) -> Run {
        if planted::is(Defect::RunNotReserved) {
            return 0;
        }
        let lives = self.mesh.incarnation().counter.saturating_sub(1);
        u32::try_from(lives.saturating_mul(RUNS_PER_LIFE)).unwrap_or(Run::MAX - RUNS_RESERVED * 64)
    }

    /// The next run, when it is on disk that it may have been used.
    pub(super) fn next_run(&mut self, key: &ComponentKey) -> Option<Run> {
        let first = self.first_run();
        let book = self.runs.entry(key.clone()).or_insert_with(RunBook::fresh);
        book.begin_at(first);
        let next = book.last.saturating_add(1);
        if next > book.stored {
            book.reserved = book.reserved.max(next.saturating_add(RUNS_RESERVED));
            self.desk.mark_urgent();
            return None;
        }
        book.last = next;
        Some(next)
    }
}

/// Hash of what a process is started with; the place in the file does not matter.
pub(super) fn shape_hash(spec: &ComponentSpec, inputs: &[InputWiring]) -> u64 {
    let mut spec = spec.clone();
    spec.index = 0;
    let bytes = postcard::to_allocvec(&(spec, inputs)).expect("writing plain data cannot fail");
    hash64(&bytes)
}
