//! What concerns whom, kept up to date record by record, so that no decision has to look at
//! the whole fleet's systems.

use alloc::{
    collections::{BTreeMap, BTreeSet},
    vec::Vec,
};

use super::Brain;
use crate::id::{ComponentKey, RobotId};

/// Components by what they are to this robot and to the coordinator.
#[derive(Clone, Debug, Default)]
pub(super) struct Index {
    /// This robot is home, standby or old home, or runs an instance.
    pub(super) mine: BTreeSet<ComponentKey>,
    /// They have a target or standby somewhere.
    pub(super) standing_by: BTreeSet<ComponentKey>,
    /// They are wanted and have no home.
    pub(super) homeless: BTreeSet<ComponentKey>,
    homes: BTreeMap<ComponentKey, RobotId>,
    /// Home -> components.
    at: BTreeMap<RobotId, BTreeSet<ComponentKey>>,
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

    /// Robots that are home to something.
    pub(super) fn homes(&self) -> impl Iterator<Item = &RobotId> {
        self.at.keys()
    }

    fn forget(&mut self, key: &ComponentKey) {
        self.mine.remove(key);
        self.standing_by.remove(key);
        self.homeless.remove(key);
        if let Some(home) = self.homes.remove(key)
            && let Some(there) = self.at.get_mut(&home)
        {
            there.remove(key);
            if there.is_empty() {
                self.at.remove(&home);
            }
        }
    }
}

impl Brain {
    /// Looks anew at where a component stands.
    pub(super) fn reindex(&mut self, key: &ComponentKey) {
        self.index.forget(key);
        let runs_here = self.instances.values().any(|instance| instance.component == *key);
        let known = self.systems.get(&key.system).and_then(|system| system.component(&key.name));
        let found = self.wanted(key).map(|(_, assignment)| {
            let here = assignment.home == self.me
                || assignment.standbys.contains(&self.me)
                || assignment.drains.as_ref() == Some(&self.me);
            (assignment.home.clone(), here, !assignment.standbys.is_empty())
        });
        if runs_here || found.as_ref().is_some_and(|(_, here, _)| *here) {
            self.index.mine.insert(key.clone());
        }
        match found {
            Some((home, _, stands_by)) => {
                if stands_by {
                    self.index.standing_by.insert(key.clone());
                }
                self.index.at.entry(home.clone()).or_default().insert(key.clone());
                self.index.homes.insert(key.clone(), home);
            }
            None if known.is_some() => {
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
