//! Rule 10: processes that outlived the agent before this one go on under their token.
//!
//! They are told of before anything else, so that nothing is started beside them. Until one
//! has greeted, nothing is known of its state, and it is left alone; until this robot may
//! begin, it is not ended for what the disk alone says.

use alloc::{format, vec::Vec};

use super::{
    Brain,
    instances::{Instance, Origin, Told},
    launch::shape_hash,
};
use crate::{
    event::Event,
    id::ComponentKey,
    input::{Adoption, InstanceId},
    lifecycle::LifecycleState,
    order::Token,
};

impl Brain {
    /// Takes a process over.
    pub(super) fn take_over(&mut self, id: InstanceId, adoption: Adoption) {
        let Adoption { pid, component, spec, inputs } = adoption;
        if self.instances.contains_key(&id) {
            return;
        }
        self.instance_last = self.instance_last.max(id);
        let mut instance = Instance::new(component.clone(), shape_hash(&spec, &inputs));
        instance.origin = Origin::Adopted { pid, greeted: false };
        self.instances.insert(id, instance);
        self.reindex(&component);
    }

    /// An adopted process said for the first time how it is: what it does is what it was told.
    pub(super) fn welcome(&mut self, id: InstanceId) {
        let Some(instance) = self.instances.get_mut(&id) else { return };
        let Origin::Adopted { pid, greeted: false } = instance.origin else { return };
        instance.origin = Origin::Adopted { pid, greeted: true };
        if let (LifecycleState::Active, Some(token), Told::Nothing) =
            (instance.state, &instance.token, &instance.told)
        {
            instance.told = Told::Activate(token.clone());
        }
        let state = instance.state;
        let text = format!("process {pid} outlived its agent and is {state}");
        let mut event = Event::new("adopted", &self.me, text).about(&instance.component);
        if let Some(token) = &instance.token {
            event = event.under(token);
        }
        let key = instance.component.clone();
        self.push_event(event.number("pid", f64::from(pid)));
        self.end_rivals(&key);
    }

    /// The agent before died while one instance followed another: the greater token stays.
    fn end_rivals(&mut self, key: &ComponentKey) {
        let token = |id: &InstanceId| match &self.instances[id].told {
            Told::Activate(token) => Some(token.clone()),
            Told::Nothing | Told::Deactivate | Told::Finish => None,
        };
        let mut acting: Vec<(Token, InstanceId)> =
            self.staying(key).filter_map(|id| Some((token(&id)?, id))).collect();
        acting.sort();
        acting.pop();
        acting.into_iter().for_each(|(_, id)| self.finish(id));
    }

    /// Whether what runs of a component may not be ended yet: it was adopted, and what it does
    /// is not known, or what the fleet wants only from this robot's own disk.
    pub(super) fn is_left_alone(&self, key: &ComponentKey) -> bool {
        self.staying(key).any(|id| match self.instances[&id].origin {
            Origin::Started => false,
            Origin::Adopted { greeted, .. } => !greeted || !self.began,
        })
    }
}
