//! Which processes belong to which instance, shared between supervisor and sampler.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use sdr_core::{
    id::ComponentKey, input::InstanceId, lifecycle::LifecycleState, order::Token,
    recording::ComponentSample, report::Usage, time::Instant,
};

use crate::clock;
use crate::record::{RecordSender, stamp};

/// The list of watched instances; cheap to clone.
#[derive(Clone, Debug, Default)]
pub(crate) struct Watch(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    list: Mutex<List>,
    nudge: Condvar,
}

#[derive(Debug, Default)]
struct List {
    instances: BTreeMap<InstanceId, Watched>,
    changed: BTreeSet<InstanceId>,
    closed: bool,
}

/// What is known of one instance, for samples of the recording.
#[derive(Clone, Debug)]
struct Watched {
    pid: u32,
    component: ComponentKey,
    state: &'static str,
    token: Option<Token>,
    usage: Usage,
}

/// What a round of sampling looks at.
#[derive(Debug, Default)]
pub(super) struct Round {
    /// Root process of each instance.
    pub(super) roots: BTreeMap<InstanceId, u32>,
    /// Instances that changed their state since the last round.
    pub(super) changed: BTreeSet<InstanceId>,
}

impl Watch {
    /// A new process of `component`.
    pub(crate) fn add(&self, instance: InstanceId, pid: u32, component: &ComponentKey) {
        let watched = Watched {
            pid,
            component: component.clone(),
            state: "created",
            token: None,
            usage: Usage::default(),
        };
        let mut list = self.lock();
        list.instances.insert(instance, watched);
        list.changed.insert(instance);
        self.0.nudge.notify_one();
    }

    /// It is in this state now; recorded at once, measured at once.
    pub(crate) fn state(
        &self,
        instance: InstanceId,
        state: LifecycleState,
        token: Option<&Token>,
        record: &RecordSender,
    ) {
        let mut list = self.lock();
        let Some(watched) = list.instances.get_mut(&instance) else { return };
        watched.state = word(state);
        watched.token = token.cloned();
        watched.record(record);
        list.changed.insert(instance);
        self.0.nudge.notify_one();
    }

    /// Its process is gone.
    pub(crate) fn remove(&self, instance: InstanceId, record: &RecordSender) {
        let mut list = self.lock();
        if let Some(mut watched) = list.instances.remove(&instance) {
            watched.state = "ended";
            watched.usage = Usage::default();
            watched.record(record);
        }
        // What it took is free: say so at once.
        list.changed.insert(instance);
        self.0.nudge.notify_one();
    }

    /// Ends the sampler's wait for good.
    pub(crate) fn close(&self) {
        self.lock().closed = true;
        self.0.nudge.notify_one();
    }

    /// Waits until `until` or until something changed; `None` once closed.
    pub(super) fn wait(&self, until: Instant) -> Option<Round> {
        let mut list = self.lock();
        loop {
            if list.closed {
                return None;
            }
            let patience = until.since(clock::now());
            if !list.changed.is_empty() || patience.is_zero() {
                let roots = list.instances.iter().map(|(id, watched)| (*id, watched.pid)).collect();
                return Some(Round { roots, changed: std::mem::take(&mut list.changed) });
            }
            let waited = self.0.nudge.wait_timeout(list, patience);
            list = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Keeps figures for the next samples of the recording.
    pub(super) fn keep(&self, usage: &[(InstanceId, Usage)]) {
        let mut list = self.lock();
        for (instance, usage) in usage {
            if let Some(watched) = list.instances.get_mut(instance) {
                watched.usage = *usage;
            }
        }
    }

    /// One sample of each instance into the recording.
    pub(super) fn record_all(&self, record: &RecordSender) {
        for watched in self.lock().instances.values() {
            watched.record(record);
        }
    }

    fn lock(&self) -> MutexGuard<'_, List> {
        self.0.list.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Watched {
    fn record(&self, record: &RecordSender) {
        let now = clock::now().as_nanos();
        let message = ComponentSample {
            stamp: stamp(),
            monotonic_ns: now,
            robot: record.robot().into(),
            system: self.component.system.to_string(),
            component: self.component.name.to_string(),
            state: self.state.into(),
            epoch: self.token.as_ref().map_or(0, |token| token.epoch.number),
            run: self.token.as_ref().map_or(0, |token| token.run),
            memory_bytes: self.usage.memory.0,
            cpu_permille: self.usage.cpu.0,
        };
        record.record(now, &message);
    }
}

fn word(state: LifecycleState) -> &'static str {
    match state {
        LifecycleState::Created => "created",
        LifecycleState::Inactive => "inactive",
        LifecycleState::Active => "active",
        LifecycleState::Error => "error",
        LifecycleState::Finalized => "finalized",
    }
}
