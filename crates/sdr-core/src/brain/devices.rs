//! Parts of the body that come and go: what needs one that is gone has lost its hardware.

use alloc::{format, string::String, vec::Vec};

use super::{Brain, instances::Instance};
use crate::{
    event::Event,
    id::{ComponentKey, Name},
    input::InstanceId,
    recover::{Cause, Fault},
    report::RobotFacts,
};

impl Brain {
    /// The body or its limits changed.
    pub(super) fn take_facts(&mut self, facts: RobotFacts) {
        let before = core::mem::replace(&mut self.config.facts, facts);
        self.say_facts();
        self.plans.retry_soon();
        let now = self.config.facts.devices.clone();
        let gone = before.devices.iter().filter(|device| !now.contains(device));
        for device in gone {
            self.device_lost(device);
        }
        for device in now.iter().filter(|device| !before.devices.contains(device)) {
            self.device_back(device);
        }
    }

    /// The first device that a component needs and that is not there.
    pub(super) fn lacking_device(&self, key: &ComponentKey) -> Option<&Name> {
        let spec = self.systems.get(&key.system)?.component(&key.name)?;
        spec.devices.iter().find(|device| !self.config.facts.devices.contains(device))
    }

    /// What is at home here and lacks a device is not started, and its ladder is climbed once.
    pub(super) fn refuse_without_device(&mut self, key: &ComponentKey) -> bool {
        let Some(device) = self.lacking_device(key) else { return false };
        if self.home(key) == Some(&self.me) {
            let reason = format!("device {device} is not there");
            self.lose_hardware(key, reason);
        }
        true
    }

    fn device_lost(&mut self, device: &Name) {
        let text = format!("device {device} is gone");
        self.push_event(Event::new("device-lost", &self.me, text.clone()));
        for key in self.needing(device) {
            self.lose_hardware(&key, text.clone());
            let of = |(_, instance): &(&InstanceId, &Instance)| instance.component == key;
            let ids: Vec<InstanceId> =
                self.instances.iter().filter(of).map(|(id, _)| *id).collect();
            ids.into_iter().for_each(|id| self.finish(id));
        }
    }

    fn lose_hardware(&mut self, key: &ComponentKey, reason: String) {
        self.faults.insert(key.clone(), Fault { cause: Cause::HardwareLost, reason });
        self.failed.insert(key.clone());
        self.judge_due = true;
    }

    /// What could not leave meanwhile is tried here again.
    fn device_back(&mut self, device: &Name) {
        let text: String = format!("device {device} is there");
        self.push_event(Event::new("device-back", &self.me, text));
        for key in self.needing(device) {
            if self.lacking_device(&key).is_none() && self.is_given_up(&key) {
                self.reset_here(&key);
            }
        }
    }

    /// Components at home here that need a device.
    fn needing(&self, device: &Name) -> Vec<ComponentKey> {
        let needs = |key: &&ComponentKey| {
            let system = self.systems.get(&key.system);
            let spec = system.and_then(|system| system.component(&key.name));
            spec.is_some_and(|spec| spec.devices.contains(device))
        };
        self.index.at(&self.me).filter(needs).cloned().collect()
    }
}
