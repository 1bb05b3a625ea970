//! Systems that should run, put together from their records.

use alloc::{
    collections::BTreeSet,
    format,
    string::{String, ToString},
    sync::Arc,
    vec::Vec,
};

use super::Brain;
use crate::{
    id::{ComponentKey, Name, RobotId},
    mesh::Fact,
    order::Version,
    record::{Assignment, FleetKey, FleetValue, RecordKind, SystemRecord},
    report::{HostReport, InstanceReport, RobotFacts},
    spec::{ComponentSpec, ConnectionSpec, PolicyBytes},
};

/// A wanted system whose records are all here.
#[derive(Clone, Debug)]
pub(super) struct SystemNow {
    pub(super) name: Name,
    /// Of its record and of all its parts.
    pub(super) version: Version,
    pub(super) revision: u64,
    /// Homes chosen before this revision are void.
    pub(super) since: u64,
    pub(super) receiver: RobotId,
    /// In the order of the file.
    pub(super) components: Vec<Arc<ComponentSpec>>,
    /// In the order of the file.
    pub(super) connections: Vec<Arc<ConnectionSpec>>,
    pub(super) allocation: Arc<PolicyBytes>,
    pub(super) recovery: Arc<PolicyBytes>,
}

impl SystemNow {
    pub(super) fn key(&self, name: &Name) -> ComponentKey {
        ComponentKey::new(&self.name, name)
    }

    pub(super) fn keys(&self) -> impl Iterator<Item = ComponentKey> {
        self.components.iter().map(|component| self.key(&component.name))
    }

    pub(super) fn component(&self, name: &Name) -> Option<&ComponentSpec> {
        self.components.iter().find(|component| component.name == *name).map(|spec| &**spec)
    }
}

/// Records that changed, by what has to be put together anew.
#[derive(Clone, Debug, Default)]
pub(super) struct Changed {
    systems: BTreeSet<String>,
    assignments: BTreeSet<String>,
    /// Systems may have been dropped from the table.
    buried: bool,
}

impl Changed {
    pub(super) fn note(&mut self, key: &FleetKey) {
        match key.kind {
            RecordKind::ASSIGNMENT => {
                self.assignments.insert(key.name.clone());
            }
            RecordKind::HORIZON => self.buried = true,
            RecordKind::SYSTEM
            | RecordKind::COMPONENT
            | RecordKind::CONNECTION
            | RecordKind::ALLOCATION
            | RecordKind::RECOVERY => {
                let system = key.name.split('/').next().unwrap_or(&key.name);
                self.systems.insert(system.into());
            }
            _ => {}
        }
    }
}

impl Brain {
    /// Puts everything together from the records.
    pub(super) fn refresh_all_systems(&mut self) {
        let mut changed = Changed::default();
        for kind in [RecordKind::SYSTEM, RecordKind::ASSIGNMENT] {
            self.mesh.fleet().of_kind(kind).for_each(|(key, _, _)| changed.note(key));
        }
        self.refresh(&changed);
    }

    /// Puts together anew what changed.
    pub(super) fn refresh(&mut self, changed: &Changed) {
        let mut keys: BTreeSet<ComponentKey> = BTreeSet::new();
        if changed.buried {
            self.leave_buried(&mut keys);
        }
        for name in &changed.systems {
            self.refresh_system(name, &mut keys);
        }
        for name in &changed.assignments {
            let found = self.mesh.fleet().get(RecordKind::ASSIGNMENT, name);
            if let Some((_, FleetValue::Assignment(assignment))) = found {
                keys.insert(assignment.component.clone());
            }
        }
        for key in keys {
            let touched = self.index.touches(&key.system);
            self.reindex(&key);
            self.stir.here |= touched || self.index.touches(&key.system);
        }
        if !changed.systems.is_empty() {
            self.unsay_unwanted();
        }
    }

    /// Systems that this robot alone did not know to be dead.
    fn leave_buried(&mut self, keys: &mut BTreeSet<ComponentKey>) {
        let fleet = self.mesh.fleet();
        let is_known = |name: &Name| fleet.get(RecordKind::SYSTEM, name.as_str()).is_some();
        let buried: Vec<Name> =
            self.systems.keys().filter(|name| !is_known(name)).cloned().collect();
        for name in buried {
            self.editions.end(name.as_str());
            if let Some(system) = self.systems.remove(&name) {
                keys.extend(system.keys());
                self.spare_objector(&system.recovery);
            }
        }
    }

    /// One system as it is now; an incomplete one keeps its last whole form.
    fn refresh_system(&mut self, name: &str, keys: &mut BTreeSet<ComponentKey>) {
        let Some((version, FleetValue::System(record))) =
            self.mesh.fleet().get(RecordKind::SYSTEM, name)
        else {
            return;
        };
        let wanted = record.wanted;
        let name = record.name.clone();
        let whole = wanted.then(|| self.assemble(version, record)).flatten();
        let before = self.systems.get(&name).cloned();
        if wanted && whole.is_none() {
            if before.is_some() {
                self.editions.begin(name.as_str());
            }
            return;
        }
        self.editions.end(name.as_str());
        let redeployed = matches!(
            (&before, &whole), (Some(old), Some(new)) if old.version != new.version
        );
        let new = whole.map(Arc::new);
        keys.extend(before.iter().chain(&new).flat_map(|s| s.keys().collect::<Vec<_>>()));
        if let Some(system) = &new {
            self.need_objector(&system.recovery);
        }
        match new {
            Some(system) => self.systems.insert(name.clone(), system),
            None => self.systems.remove(&name),
        };
        if let Some(system) = &before {
            self.spare_objector(&system.recovery);
        }
        if redeployed || self.systems.contains_key(&name) != before.is_some() {
            self.begin_anew(&name, keys);
        }
    }

    /// What an operator asks for now, or takes back, is a fresh chance for what was given up.
    fn begin_anew(&mut self, system: &Name, keys: &BTreeSet<ComponentKey>) {
        self.plans.forget(system);
        for key in keys.iter().filter(|key| key.system == *system) {
            self.forget_here(key);
            self.call_off(key);
            self.spare_plans.remove(key);
            self.unbacked.remove(key);
        }
        self.judge_due = true;
    }

    fn assemble(&self, of: &Version, record: &SystemRecord) -> Option<SystemNow> {
        let fleet = self.mesh.fleet();
        let policy = |kind| match fleet.get(kind, record.name.as_str()) {
            Some((version, FleetValue::Allocation(policy) | FleetValue::Recovery(policy)))
                if version == of =>
            {
                Some(Arc::clone(policy))
            }
            Some(_) | None => None,
        };
        let allocation = policy(RecordKind::ALLOCATION)?;
        let recovery = policy(RecordKind::RECOVERY)?;
        let prefix = format!("{}/", record.name);
        let current =
            |key: &FleetKey, version: &Version| key.name.starts_with(&prefix) && version == of;
        let mut components = Vec::new();
        for (key, version, value) in fleet.below(RecordKind::COMPONENT, &prefix) {
            if let (true, FleetValue::Component(spec)) = (current(key, version), value) {
                components.push(Arc::clone(spec));
            }
        }
        let mut connections = Vec::new();
        for (key, version, value) in fleet.below(RecordKind::CONNECTION, &prefix) {
            if let (true, FleetValue::Connection(spec)) = (current(key, version), value) {
                connections.push(Arc::clone(spec));
            }
        }
        let whole = components.len() == usize::from(record.components)
            && connections.len() == usize::from(record.connections);
        if !whole {
            return None;
        }
        components.sort_by_key(|component| component.index);
        connections.sort_by_key(|connection| connection.index);
        Some(SystemNow {
            name: record.name.clone(),
            version: of.clone(),
            revision: of.revision,
            since: record.since,
            receiver: record.receiver.clone(),
            components,
            connections,
            allocation,
            recovery,
        })
    }

    /// Where a component should run, as far as somebody decided it.
    pub(super) fn assignment(&self, key: &ComponentKey) -> Option<(&Version, &Assignment)> {
        let fact = self.assignment_fact(key)?;
        Some((fact.version(), fact.assignment()?))
    }

    pub(super) fn assignment_fact(&self, key: &ComponentKey) -> Option<&Arc<Fact>> {
        self.mesh.fleet().fact(&FleetKey { kind: RecordKind::ASSIGNMENT, name: key.to_string() })
    }

    /// The assignment of a component whose system is wanted and whose home is chosen.
    pub(super) fn wanted(&self, key: &ComponentKey) -> Option<(&Version, &Assignment)> {
        self.index.placed(key)
    }

    pub(super) fn home(&self, key: &ComponentKey) -> Option<&RobotId> {
        self.wanted(key).map(|(_, assignment)| &assignment.home)
    }

    /// What `robot` says of its instance of a component.
    pub(super) fn reported(&self, robot: &RobotId, key: &ComponentKey) -> Option<&InstanceReport> {
        let author = self.mesh.authors().author(robot)?;
        author.instances().find(|instance| instance.component == *key)
    }

    pub(super) fn facts(&self, robot: &RobotId) -> Option<&RobotFacts> {
        self.mesh.authors().author(robot)?.facts()
    }

    pub(super) fn host_of(&self, robot: &RobotId) -> Option<&HostReport> {
        self.mesh.authors().author(robot)?.host()
    }

    /// Robots alive, this one included, by name.
    pub(super) fn alive_robots(&self) -> Vec<RobotId> {
        let robots = self.mesh.authors().robots();
        robots.filter(|robot| self.mesh.is_alive(robot)).cloned().collect()
    }
}
