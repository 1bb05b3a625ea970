//! What concerns whom, kept up to date record by record, so that no decision has to look at
//! the whole fleet's systems.

use alloc::{
    collections::{BTreeMap, BTreeSet},
    vec::Vec,
};

use super::Brain;
use crate::{
    id::{ComponentKey, RobotId},
    input::Input,
    record::Assignment,
};

/// Components by what they are to this robot and to the coordinator.
#[derive(Clone, Debug, Default)]
pub(super) struct Index {
    /// This robot is home, standby or old home, or runs an instance.
    pub(super) mine: BTreeSet<ComponentKey>,
    /// They have a target somewhere.
    pub(super) moving: BTreeSet<ComponentKey>,
    /// They wish for standbys, or have some.
    pub(super) backed: BTreeSet<ComponentKey>,
    /// They are wanted and have no home.
    pub(super) homeless: BTreeSet<ComponentKey>,
    homes: BTreeMap<ComponentKey, RobotId>,
    /// Home -> components.
    at: BTreeMap<RobotId, BTreeSet<ComponentKey>>,
    /// Robots that keep an instance, or the place for one, beside the home.
    beside: BTreeMap<RobotId, BTreeSet<ComponentKey>>,
    others: BTreeMap<ComponentKey, Vec<RobotId>>,
}

/// What has to be looked at again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Stir {
    /// What should be here against what is; what is said of it; its routes.
    pub(super) here: bool,
    /// The coordinator's part.
    pub(super) fleet: bool,
}

impl Stir {
    pub(super) const ALL: Self = Self { here: true, fleet: true };

    pub(super) fn any(self) -> bool {
        self.here || self.fleet
    }
}

impl Index {
    /// Components at home on `robot`.
    pub(super) fn at(&self, robot: &RobotId) -> impl Iterator<Item = &ComponentKey> {
        self.at.get(robot).into_iter().flatten()
    }

    /// Components with a standby or a target on `robot`, their home elsewhere.
    pub(super) fn beside(&self, robot: &RobotId) -> impl Iterator<Item = &ComponentKey> {
        self.beside.get(robot).into_iter().flatten()
    }

    /// Robots that are home to something.
    pub(super) fn homes(&self) -> impl Iterator<Item = &RobotId> {
        self.at.keys()
    }

    fn forget(&mut self, key: &ComponentKey) {
        self.mine.remove(key);
        self.moving.remove(key);
        self.backed.remove(key);
        self.homeless.remove(key);
        if let Some(home) = self.homes.remove(key) {
            take_out(&mut self.at, &home, key);
        }
        for robot in self.others.remove(key).unwrap_or_default() {
            take_out(&mut self.beside, &robot, key);
        }
    }

    fn enter(&mut self, key: &ComponentKey, assignment: &Assignment) {
        if assignment.target.is_some() {
            self.moving.insert(key.clone());
        }
        self.at.entry(assignment.home.clone()).or_default().insert(key.clone());
        self.homes.insert(key.clone(), assignment.home.clone());
        let others: Vec<RobotId> = assignment.others().cloned().collect();
        for robot in &others {
            self.beside.entry(robot.clone()).or_default().insert(key.clone());
        }
        if !others.is_empty() {
            self.others.insert(key.clone(), others);
        }
    }
}

fn take_out(
    lists: &mut BTreeMap<RobotId, BTreeSet<ComponentKey>>,
    robot: &RobotId,
    key: &ComponentKey,
) {
    if let Some(there) = lists.get_mut(robot) {
        there.remove(key);
        if there.is_empty() {
            lists.remove(robot);
        }
    }
}

impl Brain {
    /// What an input makes worth looking at; datagrams do so by their news.
    pub(super) fn stir_for(&mut self, input: &Input) {
        match input {
            Input::Tick | Input::Datagram { .. } => {}
            Input::Host(_) | Input::Told { .. } => self.judge_due = true,
            Input::Usage(_) => self.usage_due = true,
            Input::Facts(_)
            | Input::Instance { .. }
            | Input::Route { .. }
            | Input::Deploy { .. }
            | Input::Undeploy { .. }
            | Input::Reset { .. }
            | Input::MoveRole { .. }
            | Input::RolePolicy { .. }
            | Input::Planned { .. }
            | Input::Stored { .. }
            | Input::StoreFailed { .. } => self.stir = Stir::ALL,
        }
    }

    /// Looks anew at where a component stands.
    pub(super) fn reindex(&mut self, key: &ComponentKey) {
        self.index.forget(key);
        let runs_here = self.instances.values().any(|instance| instance.component == *key);
        let spec = self.systems.get(&key.system).and_then(|system| system.component(&key.name));
        let wishes = spec.is_some_and(|spec| spec.standby.count > 0);
        let found = self.wanted(key).map(|(_, assignment)| assignment.clone());
        let here = found.as_ref().is_some_and(|assignment| {
            assignment.home == self.me
                || assignment.others().any(|robot| *robot == self.me)
                || assignment.drains.as_ref() == Some(&self.me)
        });
        if runs_here || here {
            self.index.mine.insert(key.clone());
        }
        match found {
            Some(assignment) => {
                if wishes || !assignment.standbys.is_empty() {
                    self.index.backed.insert(key.clone());
                }
                self.index.enter(key, &assignment);
            }
            None if spec.is_some() => {
                self.index.homeless.insert(key.clone());
            }
            None => {}
        }
    }

    /// Components that concern this robot, now.
    pub(super) fn mine(&self) -> Vec<ComponentKey> {
        self.index.mine.iter().cloned().collect()
    }
}
