//! A move is: prepare, choose the new home under a new epoch, let the old one drain.
//!
//! The state of a move lives in the assignments (the target stands there), so
//! that a new coordinator goes on where the last one stopped.

use alloc::{
    format,
    string::{String, ToString},
    vec::Vec,
};

use super::{
    Brain,
    decide::placed_reason,
    plans::{Asked, Purpose},
    prepare::Call,
};
use crate::{
    allocate::Plan,
    event::Event,
    id::{ComponentKey, RobotId},
    lifecycle::LifecycleState,
    mesh::FleetRecord,
    order::{Epoch, Version},
    planted::{self, Defect},
    record::{Assignment, FleetValue, RecordKind},
    time::{Duration, Instant},
};

/// A move this coordinator watches.
#[derive(Clone, Debug)]
pub(super) struct MoveWatch {
    since: Instant,
    from: Option<RobotId>,
    /// Set once the new home is chosen: done when it is active and heard.
    epoch: Option<Epoch>,
    /// Its cause stands; before, the target only gets ready.
    started: bool,
}

impl MoveWatch {
    /// A move whose cause stands; the new home is chosen already when there is an epoch.
    pub(super) fn started(now: Instant, from: &RobotId, epoch: Option<Epoch>) -> Self {
        Self { since: now, from: Some(from.clone()), epoch, started: true }
    }

    pub(super) fn foreseen(now: Instant, from: &RobotId) -> Self {
        Self { since: now, from: Some(from.clone()), epoch: None, started: false }
    }
}

/// What the home before does when it hears of the new one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Old {
    /// Goes on until the consumers have switched.
    Drains,
    /// Stops its output at once.
    Stops,
}

impl Brain {
    /// Gives homes under new epochs at once: nobody runs these components now.
    pub(super) fn assign(&mut self, asked: &Asked, plan: &Plan) {
        let records: Vec<FleetRecord> = plan
            .placements
            .iter()
            .filter_map(|placement| {
                self.new_home(
                    &placement.component,
                    &placement.robot,
                    placed_reason(asked, placement),
                    Old::Stops,
                )
            })
            .collect();
        if !records.is_empty() {
            self.mint(records, None);
        }
    }

    /// Names the targets, so that they prepare.
    pub(super) fn begin_move(&mut self, now: Instant, asked: &Asked, plan: &Plan) {
        let Purpose::Move { from, .. } = &asked.purpose else { return };
        let mut records = Vec::new();
        for placement in &plan.placements {
            let key = &placement.component;
            let reason = placed_reason(asked, placement);
            // a component that does not run cannot be handed over: it just starts elsewhere
            let runs = self
                .instance_report(from, key)
                .is_some_and(|report| report.state == LifecycleState::Active);
            let record = match runs {
                true => self.with_target(key, &placement.robot, &reason),
                false => self.new_home(key, &placement.robot, reason.clone(), Old::Stops),
            };
            let Some(record) = record else { continue };
            let epoch = record.version.epoch.clone().filter(|_| !runs);
            records.push(record);
            let until = now + self.not_back_for(key);
            self.left.insert((key.clone(), from.clone()), until);
            self.moves.insert(key.clone(), MoveWatch::started(now, from, epoch));
            let text = format!("{from} -> {}: {reason}", placement.robot);
            self.event_about("move-started", key, text);
        }
        if !records.is_empty() {
            self.mint(records, None);
        }
    }

    /// Chooses new homes whose targets are ready, gives up on those that are not, and says
    /// which moves are done.
    pub(super) fn advance_moves(&mut self, now: Instant) {
        self.finish_moves(now);
        let moving: Vec<ComponentKey> = self.index.moving.iter().cloned().collect();
        let preparing: Vec<(ComponentKey, RobotId)> = moving
            .into_iter()
            .filter_map(|key| {
                let (_, assignment) = self.wanted(&key)?;
                Some((key, assignment.target.clone()?))
            })
            .collect();
        let (mut due, mut ready) = (0, Vec::new());
        let (mut lost, mut called_off) = (Vec::new(), Vec::new());
        for (key, target) in preparing {
            let report = self.instance_report(&target, &key);
            let is_ready = report.is_some_and(|report| report.ready);
            let watch = self.watch_of(now, &key);
            let late = now >= watch.since + self.config.prepare_max;
            let place = (key.clone(), target.clone());
            if !self.mesh.is_alive(&target) || (late && !is_ready) {
                lost.push(place);
                continue;
            }
            match self.call_for(&key) {
                Call::Foreseen if !watch.started => continue,
                Call::Over if !watch.started => {
                    called_off.push(place);
                    continue;
                }
                Call::Due { reason, .. } if !watch.started => {
                    self.start_foreseen(now, &key, &target, &reason);
                    let started = MoveWatch { since: now, started: true, ..watch };
                    self.moves.insert(key, started);
                }
                Call::Due { .. } | Call::Foreseen | Call::Over => {}
            }
            due += 1;
            ready.extend(is_ready.then_some(place));
        }
        if !lost.is_empty() {
            self.cancel(now, &lost);
        } else if !called_off.is_empty() {
            self.call_off_moves(&called_off);
        } else if due > 0 && ready.len() == due {
            self.switch(&ready);
        }
    }

    /// What is watched of a move; one that another coordinator began is watched from now on.
    fn watch_of(&mut self, now: Instant, key: &ComponentKey) -> MoveWatch {
        let from = self.home(key).cloned();
        let watch = self.moves.entry(key.clone());
        watch.or_insert(MoveWatch { since: now, from, epoch: None, started: false }).clone()
    }

    /// All that are prepared change homes together.
    fn switch(&mut self, ready: &[(ComponentKey, RobotId)]) {
        let mut records = Vec::new();
        for (key, target) in ready {
            let reason = self.reason_now(key);
            let Some(record) = self.new_home(key, target, reason, Old::Drains) else {
                continue;
            };
            if let Some(watch) = self.moves.get_mut(key) {
                watch.epoch.clone_from(&record.version.epoch);
            }
            self.event_about("move-prepared", key, format!("{target} is ready"));
            records.push(record);
        }
        self.mint(records, None);
    }

    /// Takes targets back that do not get ready; the components stay where they are.
    fn cancel(&mut self, now: Instant, lost: &[(ComponentKey, RobotId)]) {
        for (key, target) in lost {
            self.event_about("move-failed", key, format!("{target} did not get ready"));
            let until = now + self.not_back_for(key);
            self.left.insert((key.clone(), target.clone()), until);
        }
        self.take_targets_back(lost);
    }

    /// What was foreseen did not come.
    fn call_off_moves(&mut self, called_off: &[(ComponentKey, RobotId)]) {
        for (key, target) in called_off {
            let text = format!("{target} is not needed: the cause is over");
            self.event_about("move-called-off", key, text);
        }
        self.take_targets_back(called_off);
    }

    fn take_targets_back(&mut self, targets: &[(ComponentKey, RobotId)]) {
        let mut records = Vec::new();
        for (key, _) in targets {
            self.moves.remove(key);
            let Some((version, assignment)) = self.wanted(key) else { continue };
            let value = Assignment { target: None, ..assignment.clone() };
            records.push(record(key, self.next_revision(key, version), value));
        }
        self.mint(records, None);
    }

    fn finish_moves(&mut self, now: Instant) {
        let done: Vec<(ComponentKey, MoveWatch)> = self
            .moves
            .iter()
            .filter(|(key, watch)| {
                let epoch = watch.epoch.as_ref();
                epoch.is_some_and(|epoch| self.switched(key, epoch)) || self.home(key).is_none()
            })
            .map(|(key, watch)| (key.clone(), watch.clone()))
            .collect();
        for (key, watch) in done {
            self.moves.remove(&key);
            let Some(home) = self.home(&key).cloned() else { continue };
            if let Some(from) = watch.from {
                let text = format!("{from} -> {home}");
                let event = Event::new("moved", &self.me, text).about(&key);
                let took = now.since(watch.since).as_secs_f64() * 1000.0;
                self.push_event(event.number("took_ms", took));
            }
        }
        self.left.retain(|_, until| now < *until);
    }

    pub(super) fn not_back_for(&self, key: &ComponentKey) -> Duration {
        let engine = self.systems.get(&key.system).and_then(|s| self.make_engine(&s.recovery));
        engine.map_or(Duration::ZERO, |engine| engine.recovery().not_back_for(key))
    }

    /// An assignment under a new epoch.
    pub(super) fn new_home(
        &self,
        key: &ComponentKey,
        home: &RobotId,
        reason: String,
        old: Old,
    ) -> Option<FleetRecord> {
        let deployment = self.systems.get(&key.system)?.revision;
        let before = self.assignment(key).map(|(version, old)| (version.clone(), old.clone()));
        let epoch = match &before {
            Some((Version { epoch: Some(epoch), .. }, _))
                if planted::is(Defect::EpochNotRaised) =>
            {
                epoch.clone()
            }
            Some((version, _)) => self.next_epoch(key, version.epoch.as_ref()),
            None => self.next_epoch(key, None),
        };
        let standbys = self.standbys_after(key, home, old);
        let drains = before
            .map(|(_, before)| before.home)
            .filter(|before| before != home && old == Old::Drains);
        let value = Assignment {
            component: key.clone(),
            home: home.clone(),
            standbys,
            drains,
            deployment,
            reason,
            target: None,
        };
        let version =
            Version { epoch: Some(epoch), revision: 0, term: self.term(), author: self.me.clone() };
        Some(record(key, version, value))
    }

    /// The assignment with a target that is to get ready.
    pub(super) fn with_target(
        &self,
        key: &ComponentKey,
        target: &RobotId,
        reason: &str,
    ) -> Option<FleetRecord> {
        let (version, assignment) = self.wanted(key)?;
        let (target, reason) = (Some(target.clone()), reason.into());
        let value = Assignment { target, reason, ..assignment.clone() };
        Some(record(key, self.next_revision(key, version), value))
    }

    /// The version of a change that chooses no new home.
    pub(super) fn next_revision(&self, key: &ComponentKey, version: &Version) -> Version {
        let name = key.to_string();
        let revision = self.number_after(RecordKind::ASSIGNMENT, &name, version.revision);
        let (term, author) = (self.term(), self.me.clone());
        Version { revision, term, author, ..version.clone() }
    }

    pub(super) fn move_deadlines(&self) -> impl Iterator<Item = Instant> {
        let preparing = self.moves.values().filter(|watch| watch.epoch.is_none());
        preparing.map(|watch| watch.since + self.config.prepare_max)
    }
}

pub(super) fn record(key: &ComponentKey, version: Version, value: Assignment) -> FleetRecord {
    let value = FleetValue::Assignment(value);
    FleetRecord::new(RecordKind::ASSIGNMENT, key.to_string(), version, &value)
}
