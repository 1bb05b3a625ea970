//! Every robot's part: what should be here against what is.

use alloc::{format, vec::Vec};

use super::{Brain, instances::Told};
use crate::{
    effect::Command,
    event::Event,
    id::ComponentKey,
    input::InstanceId,
    lifecycle::LifecycleState,
    order::{Epoch, Token},
    planted::{self, Defect},
    time::Instant,
};

/// What this robot owes a component.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Duty {
    /// Nothing.
    None,
    /// Run it, active under this epoch.
    Home(Epoch),
    /// Keep it prepared, inactive.
    Standby,
    /// It moved away as planned; go on until its consumers have switched.
    Drain(Epoch),
}

impl Brain {
    pub(super) fn reconcile(&mut self, now: Instant) {
        self.update_readiness(now);
        for key in self.mine() {
            match self.duty(&key) {
                Duty::None if planted::is(Defect::UnwantedGoesOn) => {}
                Duty::None if self.is_left_alone(&key) => {}
                Duty::None => self.leave(&key),
                Duty::Home(epoch) => self.be_home(now, &key, &epoch),
                Duty::Standby => self.be_standby(now, &key),
                Duty::Drain(epoch) => self.drain(now, &key, &epoch),
            }
        }
    }

    pub(super) fn duty(&self, key: &ComponentKey) -> Duty {
        let Some((version, assignment)) = self.wanted(key) else { return Duty::None };
        let Some(epoch) = version.epoch.clone() else { return Duty::None };
        if let (true, Some(token)) = (planted::is(Defect::NoEpochCheck), self.active_token(key)) {
            return Duty::Home(token.epoch);
        }
        if assignment.home == self.me {
            Duty::Home(epoch)
        } else if self.keeps_instances(key).any(|robot| *robot == self.me) {
            Duty::Standby
        } else if assignment.drains.as_ref() == Some(&self.me) {
            Duty::Drain(epoch)
        } else {
            Duty::None
        }
    }

    /// The token under which a process here was told to be active.
    fn active_token(&self, key: &ComponentKey) -> Option<Token> {
        match &self.instances[&self.current(key)?].told {
            Told::Activate(token) => Some(token.clone()),
            Told::Nothing | Told::Deactivate | Told::Finish => None,
        }
    }

    fn be_home(&mut self, now: Instant, key: &ComponentKey, epoch: &Epoch) {
        self.drains.remove(key);
        let Some(id) = self.current(key) else {
            self.launch_when_due(now, key);
            return;
        };
        if self.is_old_edition(id, key) && !planted::is(Defect::OldEditionRuns) {
            self.event_about("respecified", key, "its spec or wiring changed");
            self.finish(id);
            return;
        }
        if self.latched(key).is_some() {
            self.be_latched(id, key);
            return;
        }
        if !self.may_act(now, key) {
            self.be_silent(now, id, key);
            return;
        }
        let instance = &self.instances[&id];
        let fits = match &instance.told {
            // an older life's run: this robot had forgotten how often it had lived
            Told::Activate(token) => {
                let of_this_life = token.run > self.first_run() || instance.is_adopted();
                token.epoch == *epoch && of_this_life
            }
            Told::Nothing | Told::Deactivate | Told::Finish => false,
        };
        let able = matches!(instance.state, LifecycleState::Inactive | LifecycleState::Active);
        // what failed waits for its ladder's word, with a spare as without; and only what was
        // adopted is there before this robot may begin (rule 7)
        let waits = self.failed.contains(key) || !self.began;
        if !fits && able && !waits && self.predecessors_active(key) {
            self.activate(id, key, epoch);
        }
        if !self.is_left_alone(key) {
            self.keep_spare(now, key);
        }
    }

    /// It is the home, and must not act while nobody hears it.
    fn be_silent(&mut self, now: Instant, id: InstanceId, key: &ComponentKey) {
        if self.instances[&id].is_told_to_act() {
            self.instances.get_mut(&id).expect("listed by the caller").told = Told::Deactivate;
            self.command(id, Command::Deactivate);
            self.stop_isolated(now, key);
        }
    }

    fn activate(&mut self, id: InstanceId, key: &ComponentKey, epoch: &Epoch) {
        let Some(run) = self.next_run(key) else { return };
        let token = Token { epoch: epoch.clone(), run };
        self.instances.get_mut(&id).expect("listed by the caller").told =
            Told::Activate(token.clone());
        self.command(id, Command::Activate(token));
    }

    fn be_standby(&mut self, now: Instant, key: &ComponentKey) {
        self.drains.remove(key);
        let Some(id) = self.current(key) else {
            self.launch_when_due(now, key);
            return;
        };
        if !self.is_left_alone(key) {
            self.keep_spare(now, key);
        }
        self.reserve_epochs(key);
        if self.is_old_edition(id, key) {
            self.finish(id);
        } else if self.instances[&id].is_told_to_act() {
            self.instances.get_mut(&id).expect("listed above").told = Told::Deactivate;
            self.command(id, Command::Deactivate);
            self.event_about("fenced", key, "another robot is its home now");
        }
    }

    /// The old home of a planned move ends once the new one is active and heard, or after
    /// `drain_max`.
    fn drain(&mut self, now: Instant, key: &ComponentKey, epoch: &Epoch) {
        if self.current(key).is_none() {
            return;
        }
        let since = *self.drains.entry(key.clone()).or_insert(now);
        let late = now >= since + self.config.drain_max;
        if (late || self.switched(key, epoch)) && !planted::is(Defect::DrainForever) {
            let reason = match late {
                true => format!("drained for {} ms", now.since(since).as_millis()),
                false => "the new home is active and heard".into(),
            };
            self.event_about("drained", key, reason);
            self.forget_here(key);
            self.finish_all(key);
        }
    }

    fn leave(&mut self, key: &ComponentKey) {
        self.drains.remove(key);
        let Some(id) = self.current(key) else {
            self.forget_here(key);
            return;
        };
        let instance = &self.instances[&id];
        let greater = self.wanted(key).and_then(|(version, _)| version.epoch.clone());
        if let (Told::Activate(token), Some(epoch)) = (&instance.told, greater)
            && epoch > token.epoch
        {
            let event = Event::new("fenced", &self.me, "a greater epoch lives elsewhere");
            let event = event.about(key).under(token);
            self.push_event(event);
        }
        self.forget_here(key);
        self.finish_all(key);
    }

    fn finish_all(&mut self, key: &ComponentKey) {
        let all: Vec<InstanceId> = self.staying(key).collect();
        all.into_iter().for_each(|id| self.finish(id));
    }

    /// Whether the home under `epoch` is active and all its living consumers heard it.
    pub(super) fn switched(&self, key: &ComponentKey, epoch: &Epoch) -> bool {
        let Some(home) = self.home(key) else { return false };
        let under = |token: &Option<Token>| token.as_ref().is_some_and(|t| t.epoch >= *epoch);
        let active = self
            .instance_report(home, key)
            .is_some_and(|report| report.state == LifecycleState::Active && under(&report.token));
        active && self.consumers_heard(key, epoch)
    }

    /// Whether every consumer of a component, as far as it is active, heard this epoch.
    pub(super) fn consumers_heard(&self, key: &ComponentKey, epoch: &Epoch) -> bool {
        let Some(system) = self.systems.get(&key.system) else { return false };
        let outgoing = system.connections.iter().filter(|c| c.from.component == key.name);
        outgoing.into_iter().all(|connection| {
            let consumer = system.key(&connection.to.component);
            let Some(home) = self.home(&consumer) else { return true };
            let Some(report) = self.instance_report(home, &consumer) else { return false };
            let heard = report.heard.iter().find(|(index, _)| *index == connection.index);
            heard.is_some_and(|(_, token)| token.epoch >= *epoch)
        })
    }

    fn predecessors_active(&self, key: &ComponentKey) -> bool {
        let Some(system) = self.systems.get(&key.system) else { return false };
        let Some(spec) = system.component(&key.name) else { return false };
        spec.after.iter().all(|before| {
            let before = system.key(before);
            let report = self.home(&before).and_then(|home| self.instance_report(home, &before));
            report.is_some_and(|report| report.state == LifecycleState::Active)
        })
    }
}
