//! What concerns whom, kept up to date record by record, so that no decision has to look at
//! the whole fleet's systems.

use alloc::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
    vec::Vec,
};

use super::Brain;
use crate::{
    id::{ComponentKey, Name, RobotId},
    input::Input,
    mesh::Fact,
    order::Version,
    record::Assignment,
};

/// Components by what they are to this robot and to the coordinator.
#[derive(Clone, Debug, Default)]
pub(super) struct Index {
    /// This robot is home, standby or old home, or runs an instance.
    pub(super) mine: BTreeSet<ComponentKey>,
    /// How many of a system's components are mine.
    my_systems: BTreeMap<Name, usize>,
    /// They have a target somewhere.
    pub(super) moving: BTreeSet<ComponentKey>,
    /// They wish for standbys, or have some.
    pub(super) backed: BTreeSet<ComponentKey>,
    /// They are wanted and have no home: by system.
    unplaced: BTreeMap<Name, BTreeSet<Name>>,
    /// Homes of wanted components, as their assignments say: by system, by component.
    placed: BTreeMap<Name, Vec<Arc<Fact>>>,
    /// The same by home, by component.
    at: BTreeMap<RobotId, Vec<Arc<Fact>>>,
    /// By robots that keep an instance, or the place for one, beside the home.
    beside: BTreeMap<RobotId, Vec<Arc<Fact>>>,
    /// Homes that are not alive.
    pub(super) absent: BTreeSet<RobotId>,
    /// Robots that may have told of trouble since they were looked at.
    pub(super) troubled: BTreeSet<RobotId>,
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
        self.at.get(robot).into_iter().flatten().filter_map(component_of)
    }

    /// Components with a standby or a target on `robot`, their home elsewhere.
    pub(super) fn beside(&self, robot: &RobotId) -> impl Iterator<Item = &ComponentKey> {
        self.beside.get(robot).into_iter().flatten().filter_map(component_of)
    }

    /// Whether `robot` is home to something.
    pub(super) fn is_home(&self, robot: &RobotId) -> bool {
        self.at.contains_key(robot)
    }

    /// Systems with a component that concerns this robot, by name.
    pub(super) fn my_systems(&self) -> impl Iterator<Item = &Name> {
        self.my_systems.keys()
    }

    /// Whether a component of `system` concerns this robot.
    pub(super) fn touches(&self, system: &Name) -> bool {
        self.my_systems.contains_key(system)
    }

    /// Systems with a component that has no home, by name.
    pub(super) fn unplaced(&self) -> impl Iterator<Item = &Name> {
        self.unplaced.keys()
    }

    /// The home of a wanted component.
    pub(super) fn placed(&self, key: &ComponentKey) -> Option<(&Version, &Assignment)> {
        let there = self.placed.get(&key.system)?;
        let fact = there.iter().find(|fact| component_of(fact) == Some(key))?;
        Some((fact.version(), fact.assignment()?))
    }

    fn forget(&mut self, key: &ComponentKey) {
        if self.mine.remove(key) {
            count_down(&mut self.my_systems, &key.system);
        }
        self.moving.remove(key);
        self.backed.remove(key);
        if let Some(names) = self.unplaced.get_mut(&key.system) {
            names.remove(&key.name);
            if names.is_empty() {
                self.unplaced.remove(&key.system);
            }
        }
        if let Some(fact) = take(&mut self.placed, &key.system, key)
            && let Some(assignment) = fact.assignment()
        {
            take(&mut self.at, &assignment.home, key);
            for robot in assignment.others() {
                take(&mut self.beside, robot, key);
            }
            if !self.at.contains_key(&assignment.home) {
                self.absent.remove(&assignment.home);
            }
        }
    }

    fn claim(&mut self, key: &ComponentKey) {
        if self.mine.insert(key.clone()) {
            *self.my_systems.entry(key.system.clone()).or_default() += 1;
        }
    }

    fn place(&mut self, key: &ComponentKey, assignment: &Assignment, fact: &Arc<Fact>) {
        if assignment.target.is_some() {
            self.moving.insert(key.clone());
        }
        put(self.placed.entry(key.system.clone()).or_default(), key, fact);
        put(self.at.entry(assignment.home.clone()).or_default(), key, fact);
        for robot in assignment.others() {
            put(self.beside.entry(robot.clone()).or_default(), key, fact);
        }
    }
}

fn component_of(fact: &Arc<Fact>) -> Option<&ComponentKey> {
    fact.assignment().map(|assignment| &assignment.component)
}

/// Puts an assignment in its place by component.
fn put(facts: &mut Vec<Arc<Fact>>, key: &ComponentKey, fact: &Arc<Fact>) {
    let place = facts.binary_search_by(|held| component_of(held).cmp(&Some(key)));
    match place {
        Ok(place) => facts[place] = Arc::clone(fact),
        Err(place) => facts.insert(place, Arc::clone(fact)),
    }
}

/// Takes an assignment out, and its list when that is empty then.
fn take<K: Ord>(
    lists: &mut BTreeMap<K, Vec<Arc<Fact>>>,
    list: &K,
    key: &ComponentKey,
) -> Option<Arc<Fact>> {
    let facts = lists.get_mut(list)?;
    let place = facts.binary_search_by(|held| component_of(held).cmp(&Some(key))).ok()?;
    let taken = facts.remove(place);
    if facts.is_empty() {
        lists.remove(list);
    }
    Some(taken)
}

fn count_down(counts: &mut BTreeMap<Name, usize>, name: &Name) {
    if let Some(count) = counts.get_mut(name) {
        *count -= 1;
        if *count == 0 {
            counts.remove(name);
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
            | Input::Hold { .. }
            | Input::Planned { .. }
            | Input::Fetched { .. }
            | Input::Stored { .. }
            | Input::StoreFailed { .. } => self.stir = Stir::ALL,
        }
    }

    /// Looks anew at where a component stands.
    pub(super) fn reindex(&mut self, key: &ComponentKey) {
        self.index.forget(key);
        let runs_here = self.instances.values().any(|instance| instance.component == *key);
        let system = self.systems.get(&key.system);
        let known = system.and_then(|system| Some((system.component(&key.name)?, system.since)));
        let wishes = known.is_some_and(|(spec, _)| spec.standby.count > 0);
        let since = known.map(|(_, since)| since);
        let fact = since.and_then(|since| self.current_assignment(key, since)).cloned();
        let assignment = fact.as_ref().and_then(|fact| fact.assignment());
        let here = assignment.is_some_and(|assignment| assignment.concerns(&self.me));
        if runs_here || here {
            self.index.claim(key);
        }
        match (&fact, assignment) {
            (Some(fact), Some(assignment)) => {
                if wishes || !assignment.standbys.is_empty() {
                    self.index.backed.insert(key.clone());
                }
                self.index.place(key, assignment, fact);
                if !self.mesh.is_alive(&assignment.home) {
                    self.index.absent.insert(assignment.home.clone());
                }
            }
            (None, _) | (_, None) if since.is_some() => {
                let unplaced = self.index.unplaced.entry(key.system.clone()).or_default();
                unplaced.insert(key.name.clone());
            }
            (None, _) | (_, None) => {}
        }
    }

    /// The assignment of a component, when it was made since revision `since`.
    fn current_assignment(&self, key: &ComponentKey, since: u64) -> Option<&Arc<Fact>> {
        let fact = self.assignment_fact(key)?;
        let assignment = fact.assignment().filter(|of| of.component == *key)?;
        (assignment.deployment >= since).then_some(fact)
    }

    /// A robot is alive from now on, or is not any more.
    pub(super) fn note_presence(&mut self, robot: &RobotId) {
        if self.index.is_home(robot) && !self.mesh.is_alive(robot) {
            self.index.absent.insert(robot.clone());
        } else {
            self.index.absent.remove(robot);
        }
    }

    /// Components that concern this robot, now.
    pub(super) fn mine(&self) -> Vec<ComponentKey> {
        self.index.mine.iter().cloned().collect()
    }
}
