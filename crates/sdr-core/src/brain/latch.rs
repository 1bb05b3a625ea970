//! Emergency stops of what drives a body: they hold until somebody resets the component,
//! through restarts of agents and losses of robots. A reset is a record too, so that any
//! agent takes it and the home hears of it.

use alloc::{
    format,
    string::{String, ToString},
    vec,
    vec::Vec,
};

use super::{
    Brain,
    instances::{Instance, Told},
};
use crate::{
    api::{Accepted, ResetAnswer},
    effect::Command,
    id::ComponentKey,
    input::{InstanceId, RequestId},
    lifecycle::LifecycleState,
    mesh::FleetRecord,
    order::Version,
    record::{FleetKey, FleetValue, Latch, RecordKind},
};

/// Longest reason that the record carries, in characters.
const REASON_MAX: usize = 160;

impl Brain {
    /// Why a component must not act until it is reset.
    pub(super) fn latched(&self, key: &ComponentKey) -> Option<&str> {
        self.latches.get(key).map(String::as_str)
    }

    /// What the fleet's table says of latches, when nothing of it is known yet.
    pub(super) fn read_latches(&mut self) {
        let records = self.mesh.fleet().of_kind(RecordKind::LATCH);
        let latches = records.filter_map(|(_, _, value)| {
            let FleetValue::Latch(latch) = value else { return None };
            latch.latched.then(|| (latch.component.clone(), latch.reason.clone()))
        });
        self.latches = latches.collect();
    }

    /// Says to the fleet that a component stays as it is.
    pub(super) fn latch(&mut self, key: &ComponentKey, reason: String) {
        if self.latched(key).is_some() {
            return;
        }
        let reason = reason.chars().take(REASON_MAX).collect();
        let record = self.latch_record(key, true, reason);
        self.mint(vec![record], None);
    }

    /// It is latched: it does not act, whoever activated it before.
    pub(super) fn be_latched(&mut self, id: InstanceId, key: &ComponentKey) {
        let instance = self.instances.get_mut(&id).expect("listed by the caller");
        if instance.is_told_to_act() && instance.state == LifecycleState::Active {
            instance.told = Told::Deactivate;
            self.command(id, Command::Deactivate);
            self.event_about("latched", key, "stops until it is reset");
        }
    }

    pub(super) fn handle_reset(&mut self, request: RequestId, key: &ComponentKey) {
        let known = self.systems.get(&key.system).and_then(|one| one.component(&key.name));
        if known.is_none() {
            let all: Vec<String> = self
                .systems
                .values()
                .flat_map(|one| one.keys())
                .map(|key| key.to_string())
                .collect();
            let text = format!("no component `{key}` is deployed; deployed: [{}]", all.join(", "));
            return self.refuse(request, text);
        }
        if self.desk.is_broken() {
            return self.refuse(request, format!("{} cannot write to its disk", self.me));
        }
        let was = self.latched(key).map(String::from);
        let text = was.clone().unwrap_or_else(|| String::from("by hand"));
        self.event_about("reset", key, text);
        let record = self.latch_record(key, false, String::new());
        let answer = ResetAnswer { component: key.to_string(), was };
        self.mint(vec![record], Some((request, Accepted::Reset(answer))));
    }

    /// A latch or a reset is known now.
    pub(super) fn take_latch(&mut self, key: &FleetKey) {
        if key.kind != RecordKind::LATCH {
            return;
        }
        let Some((_, FleetValue::Latch(latch))) = self.mesh.fleet().get(key.kind, &key.name) else {
            return;
        };
        let (component, latched) = (latch.component.clone(), latch.latched);
        if latched {
            self.latches.insert(component, latch.reason.clone());
            return;
        }
        self.latches.remove(&component);
        if self.home(&component) == Some(&self.me) {
            self.reset_here(&component);
        }
    }

    /// Forgets what held a component here, and has it leave its error state.
    pub(super) fn reset_here(&mut self, key: &ComponentKey) {
        self.forget_here(key);
        self.call_off(key);
        let Some(id) = self.current(key) else { return };
        let instance: &mut Instance =
            self.instances.get_mut(&id).expect("found in the line before");
        if instance.state == LifecycleState::Error {
            // It is activated anew, under a new run, once it says that it is inactive.
            instance.told = Told::Nothing;
            self.command(id, Command::Reset);
        }
    }

    fn latch_record(&self, key: &ComponentKey, latched: bool, reason: String) -> FleetRecord {
        let name = key.to_string();
        let known = self.mesh.fleet().get(RecordKind::LATCH, &name);
        let revision = known.map_or(0, |(version, _)| version.revision) + 1;
        let version = Version { epoch: None, revision, term: 0, author: self.me.clone() };
        let value = FleetValue::Latch(Latch { component: key.clone(), latched, reason });
        FleetRecord::new(RecordKind::LATCH, name, version, &value)
    }
}
