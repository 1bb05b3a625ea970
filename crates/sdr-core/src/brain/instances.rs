//! Processes of components on this robot, as far as the brain knows them.

use alloc::{
    collections::BTreeMap,
    format,
    string::{String, ToString},
    sync::Arc,
    vec::Vec,
};

use super::{Brain, index::Stir, judge::RestartPlan, systems::SystemNow};
use crate::{
    effect::Command,
    event::Event,
    id::ComponentKey,
    input::{InstanceId, InstanceNews},
    lifecycle::LifecycleState,
    order::{Run, Token},
    recover::{Cause, Fault, HangLimit},
    report::Usage,
    time::{Duration, Instant},
};

/// Runs reserved on disk at a time, so that no fsync lies on the way to an activation.
pub(super) const RUNS_RESERVED: Run = 16;
/// A prepared instance counts as ready so long after it became inactive, matched or not.
const MATCH_WAIT: Duration = Duration::from_millis(500);

/// Pause before a prepared instance that failed is started again.
pub(super) const PREPARE_AGAIN: Duration = Duration::from_millis(500);

/// What this robot told an instance last.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Told {
    Nothing,
    Activate(Token),
    Deactivate,
    Finish,
}

/// Where a process comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Origin {
    /// This agent started it.
    Started,
    /// It outlived the agent before; its state is known once it has greeted.
    Adopted { pid: u32, greeted: bool },
}

/// One started process.
#[derive(Clone, Debug)]
pub(super) struct Instance {
    pub(super) component: ComponentKey,
    pub(super) origin: Origin,
    /// Hash of its spec and wiring: another one needs another process.
    pub(super) shape: u64,
    /// The edition of its system that it was last found to fit.
    pub(super) fits: Option<Arc<SystemNow>>,
    pub(super) state: LifecycleState,
    pub(super) token: Option<Token>,
    pub(super) told: Told,
    pub(super) inactive_at: Option<Instant>,
    pub(super) ready: bool,
    pub(super) usage: Usage,
    pub(super) heard: BTreeMap<u16, Token>,
    /// Late samples by input connection, as it counts them.
    pub(super) late: BTreeMap<u16, u64>,
    /// Deadlines of readers here that its outputs missed.
    pub(super) deadlines_missed: u64,
    /// Deadlines that its inputs from other robots missed.
    pub(super) inputs_late: u64,
    /// The silence after which its keeper takes it for hung.
    pub(super) patience: Option<HangLimit>,
}

impl Instance {
    pub(super) fn new(component: ComponentKey, shape: u64) -> Self {
        Self {
            component,
            origin: Origin::Started,
            shape,
            fits: None,
            state: LifecycleState::Created,
            token: None,
            told: Told::Nothing,
            inactive_at: None,
            ready: false,
            usage: Usage::default(),
            heard: BTreeMap::new(),
            late: BTreeMap::new(),
            deadlines_missed: 0,
            inputs_late: 0,
            patience: None,
        }
    }

    pub(super) fn is_told_to_act(&self) -> bool {
        matches!(self.told, Told::Activate(_))
    }

    pub(super) fn is_ending(&self) -> bool {
        self.told == Told::Finish
    }

    pub(super) fn is_adopted(&self) -> bool {
        matches!(self.origin, Origin::Adopted { .. })
    }
}

/// Runs of one component on this robot: used, and reserved on disk.
#[derive(Clone, Copy, Debug)]
pub(super) struct RunBook {
    pub(super) last: Run,
    pub(super) reserved: Run,
    pub(super) stored: Run,
}

impl RunBook {
    /// After a start: everything reserved may have been used.
    pub(super) fn from_disk(reserved: Run) -> Self {
        Self { last: reserved, reserved, stored: reserved }
    }

    /// Runs up to `first` belong to other lives.
    pub(super) fn begin_at(&mut self, first: Run) {
        self.last = self.last.max(first);
    }

    pub(super) fn fresh() -> Self {
        Self::from_disk(0)
    }
}

impl Brain {
    /// The instance of a component that acts, or will act first, and is not on its way out.
    pub(super) fn current(&self, key: &ComponentKey) -> Option<InstanceId> {
        let acts = |id: &InstanceId| self.instances[id].is_told_to_act();
        self.staying(key).find(acts).or_else(|| self.staying(key).next())
    }

    /// Instances of a component that are not on their way out, the eldest first.
    pub(super) fn staying(&self, key: &ComponentKey) -> impl Iterator<Item = InstanceId> {
        let stays = |instance: &Instance| instance.component == *key && !instance.is_ending();
        self.instances.iter().filter(move |(_, instance)| stays(instance)).map(|(id, _)| *id)
    }

    pub(super) fn handle_usage(&mut self, figures: Vec<(InstanceId, Usage)>) {
        for (id, usage) in figures {
            if let Some(instance) = self.instances.get_mut(&id) {
                instance.usage = usage;
            }
        }
    }

    pub(super) fn handle_instance(&mut self, now: Instant, id: InstanceId, news: InstanceNews) {
        if let InstanceNews::Adopted(adoption) = news {
            return self.take_over(id, *adoption);
        }
        let Some(instance) = self.instances.get(&id) else { return };
        let key = instance.component.clone();
        match news {
            InstanceNews::Adopted(_) => {}
            InstanceNews::Started { pid } => {
                let event = Event::new("started", &self.me, format!("process {pid}")).about(&key);
                self.push_event(event.number("pid", f64::from(pid)));
            }
            InstanceNews::LaunchFailed { reason } => self.lose(id, &key, Cause::Exited, reason),
            InstanceNews::Exited { reason } => self.lose(id, &key, Cause::Exited, reason),
            InstanceNews::OutOfMemory { reason } => {
                self.event_about("out-of-memory", &key, reason.clone());
                self.lose(id, &key, Cause::Exited, reason);
            }
            InstanceNews::Hung { .. } if instance.is_ending() => self.kill_again(id),
            InstanceNews::Hung { reason } => {
                self.event_about("hung", &key, reason.clone());
                self.raise(id, &key, Fault { cause: Cause::Hung, reason });
                self.kill(id);
            }
            InstanceNews::State { state, token, fault } => {
                self.handle_state(now, id, (state, token));
                let ending = self.instances.get(&id).is_none_or(Instance::is_ending);
                if let Some((cause, reason)) = fault.filter(|_| !ending) {
                    self.event_about("error", &key, format!("{cause}: {reason}"));
                    self.raise(id, &key, Fault { cause, reason });
                }
            }
            InstanceNews::Heard { connection, token } => self.handle_heard(id, connection, token),
            InstanceNews::Late { connection, count } => self.handle_late(id, connection, count),
        }
    }

    fn handle_state(
        &mut self,
        now: Instant,
        id: InstanceId,
        (state, token): (LifecycleState, Option<Token>),
    ) {
        let Some(instance) = self.instances.get_mut(&id) else { return };
        let changed = instance.state != state || instance.token != token;
        let acted =
            matches!(&instance.told, Told::Activate(told) if Some(told) == instance.token.as_ref());
        if acted && state == LifecycleState::Inactive {
            // it stopped by itself, without an agent for too long: what it was told is over
            instance.told = Told::Nothing;
        }
        instance.state = state;
        instance.token.clone_from(&token);
        if matches!(state, LifecycleState::Inactive | LifecycleState::Active) {
            instance.inactive_at.get_or_insert(now);
        }
        let key = instance.component.clone();
        self.welcome(id);
        if !changed {
            return;
        }
        let kind = match state {
            LifecycleState::Created => "created",
            LifecycleState::Inactive => "inactive",
            LifecycleState::Active => "active",
            LifecycleState::Error => "in-error",
            LifecycleState::Finalized => "finalized",
        };
        let mut event = Event::new(kind, &self.me, format!("{key} is {state}")).about(&key);
        if let Some(token) = &token {
            event = event.under(token);
        }
        self.push_event(event);
    }

    fn handle_heard(&mut self, id: InstanceId, connection: u16, token: Token) {
        let Some(instance) = self.instances.get_mut(&id) else { return };
        instance.heard.insert(connection, token.clone());
        let key = instance.component.clone();
        let label = self
            .systems
            .get(&key.system)
            .and_then(|system| system.connections.iter().find(|c| c.index == connection))
            .map_or_else(|| connection.to_string(), |c| c.label());
        let event = Event::new("heard", &self.me, label).about(&key).under(&token);
        self.push_event(event.number("connection", f64::from(connection)));
    }

    /// Whose fault a missed deadline is: its writer's, when that runs here; else all that is
    /// known is that the reader does not get what it needs.
    fn handle_late(&mut self, id: InstanceId, connection: u16, count: u64) {
        let Some(instance) = self.instances.get_mut(&id) else { return };
        let before = instance.late.insert(connection, count).unwrap_or(0);
        let missed = count.saturating_sub(before);
        let key = instance.component.clone();
        let Some(system) = self.systems.get(&key.system) else { return };
        let wire = system.connections.iter().find(|wire| wire.index == connection);
        let Some(writer) = wire.map(|wire| system.key(&wire.from.component)) else { return };
        if self.home(&writer) != Some(&self.me) {
            self.instances.get_mut(&id).expect("found above").inputs_late += missed;
            return;
        }
        // While it does not run, that is the fault, and it is seen by itself.
        let writer = self.current(&writer).and_then(|id| self.instances.get_mut(&id));
        if let Some(writer) = writer.filter(|one| one.state == LifecycleState::Active) {
            writer.deadlines_missed += missed;
        }
    }

    /// Tells keepers how long the policy lets their components be silent.
    pub(super) fn update_patience(&mut self) {
        let mut changed = Vec::new();
        for (id, instance) in &self.instances {
            let engine = self.engines.get(&instance.component.system);
            let limit = engine.and_then(|one| one.recovery().hang_limit(&instance.component));
            if engine.is_some() && limit != instance.patience {
                changed.push((*id, limit));
            }
        }
        for (id, limit) in changed {
            self.instances.get_mut(&id).expect("listed above").patience = limit;
            self.command(id, Command::Patience(limit));
        }
    }

    /// A process ended or never was; a fault unless it was told to end.
    fn lose(&mut self, id: InstanceId, key: &ComponentKey, cause: Cause, reason: String) {
        let ending = self.instances.get(&id).is_none_or(Instance::is_ending);
        if ending {
            self.event_about("ended", key, reason);
        } else {
            self.event_about("exited", key, reason.clone());
            self.raise(id, key, Fault { cause, reason });
        }
        self.instances.remove(&id);
        self.reindex(key);
    }

    /// Notes a fault of a component for the next judgement; what is only prepared here is
    /// simply tried again after a pause.
    fn raise(&mut self, id: InstanceId, key: &ComponentKey, fault: Fault) {
        if self.home(key) != Some(&self.me) {
            let at = self.handled_at + PREPARE_AGAIN;
            self.restarts.insert(key.clone(), RestartPlan { at });
            return;
        }
        if self.current(key) != Some(id) {
            self.spare_failed(key);
            return;
        }
        self.faults.insert(key.clone(), fault);
        self.failed.insert(key.clone());
        self.judge_due = true;
    }

    /// Ends an instance in good order.
    pub(super) fn finish(&mut self, id: InstanceId) {
        self.end(id, Command::Finish);
    }

    /// Ends an instance that does not listen.
    pub(super) fn kill(&mut self, id: InstanceId) {
        self.end(id, Command::Kill);
    }

    /// It was told to end and hangs on its way.
    fn kill_again(&mut self, id: InstanceId) {
        self.command(id, Command::Kill);
    }

    fn end(&mut self, id: InstanceId, how: Command) {
        let Some(instance) = self.instances.get_mut(&id) else { return };
        if !instance.is_ending() {
            instance.told = Told::Finish;
            self.command(id, how);
        }
    }

    /// Marks prepared instances as ready once their routes are matched, or were waited for
    /// long enough.
    pub(super) fn update_readiness(&mut self, now: Instant) {
        let waiting: Vec<InstanceId> = self
            .instances
            .iter()
            .filter(|(_, instance)| !instance.ready && instance.inactive_at.is_some())
            .map(|(id, _)| *id)
            .collect();
        for id in waiting {
            let instance = &self.instances[&id];
            let waited = instance.inactive_at.is_some_and(|at| now >= at + MATCH_WAIT);
            if waited || self.routes_matched(&instance.component) {
                self.instances.get_mut(&id).expect("listed above").ready = true;
                self.stir = Stir::ALL;
            }
        }
    }

    /// When the next instance counts as ready without being matched.
    pub(super) fn instance_deadlines(&self) -> impl Iterator<Item = Instant> {
        let waiting = self.instances.values().filter(|instance| !instance.ready);
        waiting.filter_map(|instance| instance.inactive_at.map(|at| at + MATCH_WAIT))
    }
}
