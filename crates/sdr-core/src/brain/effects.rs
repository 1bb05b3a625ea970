//! Small helpers that put effects in the queue.

use alloc::string::String;

use super::Brain;
use crate::{
    effect::{Command, Effect},
    event::Event,
    id::ComponentKey,
    input::InstanceId,
};

impl Brain {
    pub(super) fn event(&mut self, kind: &str, reason: impl Into<String>) {
        self.push_event(Event::new(kind, &self.me, reason));
    }

    pub(super) fn event_about(&mut self, kind: &str, about: &ComponentKey, why: impl Into<String>) {
        self.push_event(Event::new(kind, &self.me, why).about(about));
    }

    pub(super) fn push_event(&mut self, event: Event) {
        self.effects.push_back(Effect::Event(event));
    }

    pub(super) fn command(&mut self, instance: InstanceId, command: Command) {
        self.effects.push_back(Effect::Command { instance, command });
    }
}
