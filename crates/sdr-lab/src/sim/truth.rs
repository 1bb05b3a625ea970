//! What is so, whatever the robots believe: who can hear whom, who runs what.

use std::{collections::BTreeSet, sync::Arc, time::Duration};

use sdr_core::{
    id::ComponentKey,
    mesh::{Fact, FleetTable},
    record::{FleetValue, RecordKind},
    spec::{ComponentSpec, IsolationAction, StandbyKind},
    time::Instant,
    units::Bytes,
};

use super::{air::Way, fleet::Fleet};

impl Fleet {
    /// Groups of robots that are on and can reach each other; a deaf robot is alone.
    pub fn sides(&self) -> Vec<Vec<usize>> {
        let mut sides: Vec<(Vec<bool>, Vec<usize>)> = Vec::new();
        let mut alone = Vec::new();
        for robot in (0..self.robots.len()).filter(|robot| self.robots[*robot].is_on()) {
            if self.air.deaf_since(robot, self.now).is_some() {
                alone.push(vec![robot]);
                continue;
            }
            let place: Vec<bool> = self.air.cuts.iter().map(|cut| cut.inside[robot]).collect();
            match sides.iter_mut().find(|(other, _)| *other == place) {
                Some((_, members)) => members.push(robot),
                None => sides.push((place, vec![robot])),
            }
        }
        sides.into_iter().map(|(_, members)| members).chain(alone).collect()
    }

    /// Whether nothing but whole cuts has disturbed the fleet for `time`.
    pub fn is_steady_for(&self, time: Duration) -> bool {
        self.now >= self.steady_since + time
            && self.air.cuts.iter().all(|cut| cut.way == Way::Both && self.now >= cut.since + time)
    }

    /// The last moment from which on everything was steady; may lie ahead.
    pub fn steady_since(&self) -> Instant {
        self.steady_since
    }

    /// Whether some robots are cut off from others now.
    pub fn is_cut(&self) -> bool {
        !self.air.cuts.is_empty()
    }

    /// How long the present separation of two robots lasts in all, from its beginning to its
    /// end: deafness, cuts, agents that stand still. `None` when nothing is between them.
    pub fn apart_for(&self, a: usize, b: usize) -> Option<Duration> {
        let deaf = [a, b].into_iter().filter_map(|robot| self.air.deaf_for(robot, self.now));
        let cuts = self.air.cuts.iter().filter(|cut| cut.inside[a] != cut.inside[b]);
        let cuts = cuts.map(|cut| cut.until.since(cut.since));
        let paused = [a, b].into_iter().map(|robot| &self.robots[robot]);
        let paused = paused
            .filter(|robot| self.now < robot.paused_until)
            .map(|robot| robot.paused_until.since(robot.paused_at));
        deaf.chain(cuts).chain(paused).max()
    }

    /// Since when nobody can both hear a robot and be heard by it; `None` when somebody can,
    /// or it is off, or the only one there is.
    pub fn alone_since(&self, robot: usize) -> Option<Instant> {
        let on_since = self.robots[robot].is_on().then_some(self.robots[robot].on_since)?;
        let others = (0..self.robots.len()).filter(|other| *other != robot);
        let apart: Option<Vec<Instant>> =
            others.map(|other| self.apart_since(robot, other)).collect();
        apart?.into_iter().max().map(|since| since.max(on_since))
    }

    /// Since when one thing keeps two robots from hearing each other.
    pub fn apart_since(&self, a: usize, b: usize) -> Option<Instant> {
        let other = &self.robots[b];
        let off = other.off_since.filter(|_| !other.is_on());
        let deaf = [a, b].into_iter().filter_map(|robot| self.air.deaf_since(robot, self.now));
        let cuts = self.air.cuts.iter().filter(|cut| cut.stops(a, b) || cut.stops(b, a));
        let paused = (self.now < other.paused_until).then_some(other.paused_at);
        deaf.chain(cuts.map(|cut| cut.since)).chain(off).chain(paused).min()
    }

    /// Whether a robot's agent stood still at any time since then.
    pub fn was_paused_since(&self, robot: usize, since: Instant) -> bool {
        self.robots[robot].paused_until > since
    }

    /// Whether a robot's radio was deaf at any time since then.
    pub fn was_deaf_since(&self, robot: usize, since: Instant) -> bool {
        self.air.was_deaf_since(robot, since)
    }

    /// The robot that believes itself coordinator under the greatest term.
    pub fn highest_coordinator(&self) -> Option<usize> {
        let holders = self.robots.iter().filter(|robot| robot.is_coordinator());
        let term = |robot: &&super::Robot| robot.coordinator().map(|(id, term)| (term, id.clone()));
        holders.max_by_key(term).map(|robot| robot.number)
    }

    /// Components that should run, as the tables of these robots say.
    pub fn wanted(&self, robots: &[usize]) -> Vec<ComponentKey> {
        let mut wanted: Vec<ComponentKey> = Vec::new();
        // of a large fleet a few robots speak for all
        let tables = robots.iter().take(SPEAKERS).filter_map(|robot| self.table(*robot));
        // the table with the greatest version of a system decides
        let mut systems = std::collections::BTreeMap::new();
        for table in tables {
            for (key, version, value) in table.of_kind(RecordKind::SYSTEM) {
                let FleetValue::System(system) = value else { continue };
                let entry = systems.entry(key.name.clone()).or_insert((
                    version.clone(),
                    system.clone(),
                    table,
                ));
                if *version > entry.0 {
                    *entry = (version.clone(), system.clone(), table);
                }
            }
        }
        for (version, system, table) in systems.into_values() {
            if !system.wanted {
                continue;
            }
            let prefix = format!("{}/", system.name);
            for (_, part, value) in table.below(RecordKind::COMPONENT, &prefix) {
                let FleetValue::Component(spec) = value else { continue };
                if *part == version {
                    wanted.push(ComponentKey::new(&system.name, &spec.name));
                }
            }
        }
        wanted
    }

    /// Whether these robots hold all parts of the revision of `system` that the greatest of
    /// their tables wants: before, nobody there can know what to run.
    pub fn is_whole(&self, system: &str, robots: &[usize]) -> bool {
        let tables = || robots.iter().take(SPEAKERS).filter_map(|robot| self.table(*robot));
        let records = tables().filter_map(|table| table.get(RecordKind::SYSTEM, system));
        let Some((version, FleetValue::System(record))) =
            records.max_by_key(|(version, _)| *version)
        else {
            return false;
        };
        if !record.wanted {
            return true;
        }
        let held = |kind, name: &str| -> usize {
            let parts = tables().flat_map(|table| table.below(kind, name));
            let parts = parts.filter(|(_, part, _)| *part == version).map(|(key, ..)| &key.name);
            parts.collect::<BTreeSet<_>>().len()
        };
        let policy = |kind| {
            let mut held = tables().filter_map(|table| table.get(kind, system));
            held.any(|(part, _)| part == version)
        };
        let prefix = format!("{system}/");
        held(RecordKind::COMPONENT, &prefix) >= usize::from(record.components)
            && held(RecordKind::CONNECTION, &prefix) >= usize::from(record.connections)
            && policy(RecordKind::ALLOCATION)
            && policy(RecordKind::RECOVERY)
    }

    /// Whether no robot holds anything that the fleet ever agreed on, running or on disk: from
    /// here on it is a new fleet.
    pub fn remembers_nothing(&self) -> bool {
        self.robots.iter().all(|robot| {
            let stored = robot.disk.held().is_none_or(|stored| stored.fleet.is_empty());
            stored && robot.brain().is_none_or(|brain| brain.mesh().fleet().len() == 0)
        })
    }

    /// Whether one of these robots may and can run a component beside what it runs now.
    pub fn is_feasible(&self, key: &ComponentKey, side: &[usize]) -> bool {
        let Some(spec) = self.spec(key, side) else { return false };
        side.iter().map(|robot| &self.robots[*robot]).any(|robot| {
            let host = robot.measured();
            let memory = robot.facts.memory_capacity.less(host.memory_used).less(spec.needs.memory);
            let cpu = robot.facts.cpu_capacity.less(host.cpu_used).less(spec.needs.cpu);
            spec.place.robot.as_ref().is_none_or(|only| *only == robot.id)
                && memory >= MEMORY_LEFT
                && cpu.0 * 5 >= robot.facts.cpu_capacity.0
        })
    }

    /// How long a component may act while nobody hears its robot; `None`: for ever.
    pub fn lease(&self, key: &ComponentKey, side: &[usize]) -> Option<Duration> {
        let isolation = self.spec(key, side)?.on_isolation;
        (isolation.action == IsolationAction::Deactivate).then_some(isolation.after)
    }

    /// How many standbys a component wishes for, and whether they are hot.
    pub fn standbys(&self, key: &ComponentKey, side: &[usize]) -> Option<(bool, usize)> {
        let wish = &self.spec(key, side)?.standby;
        Some((wish.kind == StandbyKind::Hot, usize::from(wish.count)))
    }

    /// The latest spec of a component that these robots hold.
    fn spec(&self, key: &ComponentKey, side: &[usize]) -> Option<&ComponentSpec> {
        let name = format!("{}/{}", key.system, key.name);
        let specs = side.iter().take(SPEAKERS).filter_map(|robot| {
            let (version, value) = self.table(*robot)?.get(RecordKind::COMPONENT, &name)?;
            let FleetValue::Component(spec) = value else { return None };
            Some((version, spec))
        });
        specs.max_by_key(|(version, _)| *version).map(|(_, spec)| &**spec)
    }

    /// How many components were ever seen.
    pub fn components(&self) -> usize {
        self.keys.len()
    }

    /// Active processes of a component by number.
    pub fn active_of(&self, component: usize) -> &[super::ActiveProcess] {
        &self.actives[component]
    }

    /// A component that feeds this process and whose present token it has not accepted.
    pub fn unheard(&self, process: &super::Process) -> Option<&ComponentKey> {
        let deaf = process.inputs.iter().find(|(wiring, producer)| {
            let [active] = self.actives[*producer].as_slice() else { return false };
            process.heard.get(&wiring.connection) != Some(&active.token)
        })?;
        Some(&self.keys[deaf.1])
    }

    /// The fleet table of a robot that is on.
    pub fn table(&self, robot: usize) -> Option<&FleetTable> {
        self.robots[robot].brain().map(|brain| brain.mesh().fleet())
    }
}

/// What the default allocation wants left free.
const MEMORY_LEFT: Bytes = Bytes::mega(200);
/// Robots whose tables are looked at for what is wanted.
const SPEAKERS: usize = 12;

/// Whether two tables hold the same, whatever their own hashes say.
pub fn same_table(one: &FleetTable, other: &FleetTable) -> bool {
    let same = |(one, other): (&Arc<Fact>, &Arc<Fact>)| Arc::ptr_eq(one, other) || one == other;
    one.len() == other.len() && one.facts().iter().zip(other.facts().iter()).all(same)
}
