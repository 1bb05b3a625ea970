//! From beliefs to a problem for an allocator.

use alloc::{collections::BTreeMap, string::String, vec::Vec};

use super::{Brain, systems::SystemNow};
use crate::{
    allocate::{Item, Pair, Problem, RobotOffer, Settled, Tier, Wire},
    id::{ComponentKey, Name, RobotId},
    report::{InstanceReport, Report},
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
    let stays = |other: &&ComponentSpec| !names.contains(&other.name);
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
        let chosen = system.components.iter().filter(|component| names.contains(&component.name));
        let items = chosen
            .map(|spec| {
                let component = system.key(&spec.name);
                let running = |robot: &&RobotId| self.instance_report(robot, &component).is_some();
                Item {
                    needs: self.needs(system, spec),
                    launch: launch_hash(spec.launch.name()),
                    devices: spec.devices.clone(),
                    place: wishes(system, spec, names),
                    running_on: robots.iter().filter(running).cloned().collect(),
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

    /// Needs of all that runs or will run on a robot, except `items` that will leave or come.
    fn taken(&self, robot: &RobotId, items: &[ComponentKey]) -> Vec<Needs> {
        let mut taken: BTreeMap<ComponentKey, Needs> = BTreeMap::new();
        for report in self.instance_reports(robot) {
            let usage = Needs { memory: report.usage.memory, cpu: report.usage.cpu };
            taken.insert(report.component, usage);
        }
        for key in self.index.at(robot).chain(self.index.beside(robot)) {
            let system = self.systems.get(&key.system);
            let Some(spec) = system.and_then(|system| system.component(&key.name)) else {
                continue;
            };
            let needs = taken.entry(key.clone()).or_default();
            needs.memory = needs.memory.max(spec.needs.memory);
            needs.cpu = needs.cpu.max(spec.needs.cpu);
            let twice = self.wanted(key).is_some_and(|(_, assignment)| {
                assignment.home == *robot && assignment.stands_by_at_home()
            });
            if twice {
                needs.memory = Bytes(needs.memory.0.saturating_mul(2));
            }
        }
        taken.into_iter().filter(|(key, _)| !items.contains(key)).map(|(_, needs)| needs).collect()
    }

    fn pairs(&self, robots: &[RobotId]) -> Vec<Pair> {
        let mut pairs: BTreeMap<(RobotId, RobotId), Pair> = BTreeMap::new();
        for robot in robots {
            let Some(author) = self.mesh.authors().author(robot) else { continue };
            for report in author.reports() {
                let Report::Link(other, link) = report else { continue };
                let (a, b) = if robot < other { (robot, other) } else { (other, robot) };
                let pair = pairs.entry((a.clone(), b.clone())).or_insert_with(|| Pair {
                    a: a.clone(),
                    b: b.clone(),
                    jitter: None,
                    delay: None,
                    loss: None,
                });
                // the worse of both ends
                pair.jitter = pair.jitter.max(Some(link.jitter));
                pair.delay = pair.delay.max(Some(link.rtt / 2));
                pair.loss = pair.loss.max(Some(link.loss));
            }
        }
        pairs.into_values().collect()
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

    fn instance_reports(&self, robot: &RobotId) -> Vec<InstanceReport> {
        if *robot == self.me {
            return self.instances.keys().map(|id| self.own_report(*id)).collect();
        }
        let Some(author) = self.mesh.authors().author(robot) else { return Vec::new() };
        let instances = author.reports().filter_map(|report| match report {
            Report::Instance(instance) => Some(instance.clone()),
            Report::Facts(_)
            | Report::Host(_)
            | Report::Link(..)
            | Report::Condition(_)
            | Report::Succession(_)
            | Report::Homeless(_) => None,
        });
        instances.collect()
    }
}
