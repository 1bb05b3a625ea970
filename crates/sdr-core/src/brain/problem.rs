//! From beliefs to a problem for an allocator.

use alloc::{collections::BTreeMap, string::String, vec::Vec};

use super::{Brain, systems::SystemNow};
use crate::{
    allocate::{Item, Pair, Problem, RobotOffer, Settled, Tier, Wire},
    id::{ComponentKey, Name, RobotId},
    report::{InstanceReport, LinkReport, Usage},
    spec::{self, ComponentSpec, Needs, launch_hash},
    units::Bytes,
};

/// Robots a component must not go to, with reasons.
pub(super) type Avoid = Vec<(RobotId, String)>;

/// What becomes of the place that a component has already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// It leaves it.
    Given,
    /// It keeps it: a standby comes beside.
    Kept,
}

/// A question about some components of one system.
pub(super) struct Asking<'a> {
    pub(super) names: &'a [Name],
    pub(super) tier: Tier,
    pub(super) place: Place,
    pub(super) avoid: &'a BTreeMap<Name, Avoid>,
}

/// Where a component may go: what it says itself, and what those say of it that stay.
fn wishes(system: &SystemNow, spec: &ComponentSpec, names: &[Name]) -> spec::Place {
    let mut place = spec.place.clone();
    let stays = |other: &&alloc::sync::Arc<ComponentSpec>| !names.contains(&other.name);
    for other in system.components.iter().filter(stays) {
        if other.place.apart_from.contains(&spec.name) && !place.apart_from.contains(&other.name) {
            place.apart_from.push(other.name.clone());
        }
    }
    place
}

impl Brain {
    /// The question where to put some components of `system`.
    pub(super) fn problem(&self, system: &SystemNow, asking: &Asking<'_>) -> Problem {
        let Asking { names, tier, place, avoid } = *asking;
        let leaving: Vec<ComponentKey> = match place {
            Place::Given => names.iter().map(|name| system.key(name)).collect(),
            Place::Kept => Vec::new(),
        };
        let robots = self.alive_robots();
        let mut running = self.running_on(&robots, &system.name);
        let chosen = system.components.iter().filter(|component| names.contains(&component.name));
        let items = chosen
            .map(|spec| {
                let component = system.key(&spec.name);
                Item {
                    needs: self.needs(system, spec),
                    launch: launch_hash(spec.launch.name()),
                    devices: spec.devices.clone(),
                    place: wishes(system, spec, names),
                    running_on: running.remove(&component).unwrap_or_default(),
                    avoid: avoid.get(&spec.name).cloned().unwrap_or_default(),
                    component,
                }
            })
            .collect();
        let settled = system.components.iter().filter(|spec| !names.contains(&spec.name));
        Problem {
            tier,
            policy: self.readable_allocation(system),
            receiver: system.receiver.clone(),
            robots: robots.iter().filter_map(|robot| self.offer(robot, &leaving)).collect(),
            items,
            settled: settled
                .filter_map(|spec| {
                    let home = self.home(&system.key(&spec.name))?.clone();
                    Some(Settled { name: spec.name.clone(), home })
                })
                .collect(),
            connections: system
                .connections
                .iter()
                .map(|c| Wire { from: c.from.component.clone(), to: c.to.component.clone() })
                .collect(),
            pairs: self.pairs(&robots),
        }
    }

    /// The larger of declared and measured need.
    fn needs(&self, system: &SystemNow, spec: &ComponentSpec) -> Needs {
        let key = system.key(&spec.name);
        let measured = self.home(&key).and_then(|home| self.instance_report(home, &key));
        match measured {
            Some(report) => Needs {
                memory: spec.needs.memory.max(report.usage.memory),
                cpu: spec.needs.cpu.max(report.usage.cpu),
            },
            None => spec.needs,
        }
    }

    /// What a robot has left beside all that is or will be there, without `items`.
    fn offer(&self, robot: &RobotId, items: &[ComponentKey]) -> Option<RobotOffer> {
        let facts = self.facts(robot)?;
        let mine = (*robot == self.me).then_some(self.host).flatten();
        let host = mine.or_else(|| self.host_of(robot).copied()).unwrap_or_default();
        let mut memory = facts.memory_capacity.less(host.memory_other);
        let mut cpu = facts.cpu_capacity.less(host.cpu_other);
        for needs in self.taken(robot, items) {
            memory = memory.less(needs.memory);
            cpu = cpu.less(needs.cpu);
        }
        Some(RobotOffer {
            robot: robot.clone(),
            memory_free: memory,
            cpu_capacity: facts.cpu_capacity,
            cpu_free: cpu,
            battery: host.battery,
            rssi: host.rssi,
            position: host.position,
            labels: facts.labels.clone(),
            devices: facts.devices.clone(),
            launchables: facts.launchables.clone(),
        })
    }

    /// Who runs which components of a system, in the order of `robots`.
    fn running_on(
        &self,
        robots: &[RobotId],
        system: &Name,
    ) -> BTreeMap<ComponentKey, Vec<RobotId>> {
        let mut running: BTreeMap<ComponentKey, Vec<RobotId>> = BTreeMap::new();
        for robot in robots {
            for (component, _) in self.usages(robot) {
                let stays = *robot != self.me || self.current(component).is_some();
                if component.system == *system && stays {
                    let there = running.entry(component.clone()).or_default();
                    if there.last() != Some(robot) {
                        there.push(robot.clone());
                    }
                }
            }
        }
        running
    }

    /// Needs of all that runs or will run on a robot, except `items` that will leave or come.
    fn taken(&self, robot: &RobotId, items: &[ComponentKey]) -> Vec<Needs> {
        let mut taken: BTreeMap<&ComponentKey, Needs> = BTreeMap::new();
        for (component, usage) in self.usages(robot) {
            taken.insert(component, Needs { memory: usage.memory, cpu: usage.cpu });
        }
        for key in self.index.at(robot).chain(self.index.beside(robot)) {
            let system = self.systems.get(&key.system);
            let Some(spec) = system.and_then(|system| system.component(&key.name)) else {
                continue;
            };
            let needs = taken.entry(key).or_default();
            needs.memory = needs.memory.max(spec.needs.memory);
            needs.cpu = needs.cpu.max(spec.needs.cpu);
            let twice = self.wanted(key).is_some_and(|(_, assignment)| {
                assignment.home == *robot && assignment.stands_by_at_home()
            });
            if twice {
                needs.memory = Bytes(needs.memory.0.saturating_mul(2));
            }
        }
        taken.into_iter().filter(|(key, _)| !items.contains(*key)).map(|(_, needs)| needs).collect()
    }

    fn pairs(&self, robots: &[RobotId]) -> Vec<Pair> {
        let mut ends: Vec<(&RobotId, &RobotId, &LinkReport)> = Vec::new();
        for robot in robots {
            let author = self.mesh.authors().author(robot).into_iter();
            ends.extend(author.flat_map(|author| author.links()).map(|(other, link)| {
                if robot < other { (robot, other, link) } else { (other, robot, link) }
            }));
        }
        ends.sort_by_key(|(a, b, _)| (*a, *b));
        let same = |one: &(&RobotId, &RobotId, _), other: &(&RobotId, &RobotId, _)| {
            (one.0, one.1) == (other.0, other.1)
        };
        let pair = |ends: &[(&RobotId, &RobotId, &LinkReport)]| Pair {
            a: ends[0].0.clone(),
            b: ends[0].1.clone(),
            // the worse of both ends
            jitter: ends.iter().map(|(_, _, link)| link.jitter).max(),
            delay: ends.iter().map(|(_, _, link)| link.rtt / 2).max(),
            loss: ends.iter().map(|(_, _, link)| link.loss).max(),
        };
        ends.chunk_by(same).map(pair).collect()
    }

    /// What `robot` runs of a component; of this robot, as it is now.
    pub(super) fn instance_report(
        &self,
        robot: &RobotId,
        key: &ComponentKey,
    ) -> Option<InstanceReport> {
        match *robot == self.me {
            true => self.current(key).map(|id| self.own_report(id)),
            false => self.reported(robot, key).cloned(),
        }
    }

    /// What each instance on a robot takes; of this robot, as it is now.
    fn usages(&self, robot: &RobotId) -> impl Iterator<Item = (&ComponentKey, Usage)> {
        let here = *robot == self.me;
        let own = self.instances.values().filter(move |_| here);
        let author = self.mesh.authors().author(robot).filter(|_| !here).into_iter();
        let theirs = author.flat_map(|author| author.instances());
        let own = own.map(|instance| (&instance.component, instance.usage));
        own.chain(theirs.map(|report| (&report.component, report.usage)))
    }
}
