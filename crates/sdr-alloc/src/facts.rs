//! What is known of robots and pairs, with the policy's answer put in where nothing is.

use alloc::{collections::BTreeMap, vec::Vec};
use core::time::Duration;

use sdr_core::{
    allocate::{Item, Pair, Problem, RobotOffer},
    id::{Name, RobotId},
    spec::Needs,
    units::{Dbm, Permille},
};

use crate::policy::{IfUnknown, Millimetres, Policy};

/// A problem made ready for many questions. Robots are numbered by name, items as given.
pub(crate) struct Facts<'a> {
    /// The problem as given.
    pub(crate) problem: &'a Problem,
    /// The policy that judges it.
    pub(crate) policy: &'a Policy,
    /// Robots by name, each once.
    pub(crate) robots: Vec<&'a RobotOffer>,
    /// Needs per item, with defaults for what nobody declared or measured.
    pub(crate) needs: Vec<Needs>,
    /// Per item: who it talks to.
    pub(crate) partners: Vec<Vec<Partner>>,
    pairs: BTreeMap<(usize, usize), &'a Pair>,
    worst: Worst,
}

/// The far end of a connection of an item.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Partner {
    /// A component that stays on this robot.
    Settled(usize),
    /// Another item.
    Item(usize),
}

/// What is known of a pair of robots.
#[derive(Clone, Copy, Default)]
pub(crate) struct Link {
    pub(crate) rssi: Option<Dbm>,
    pub(crate) jitter: Option<Duration>,
    pub(crate) distance: Option<Millimetres>,
    pub(crate) delay: Option<Duration>,
    pub(crate) loss: Option<Permille>,
}

/// The worst value that is known of any robot or pair.
#[derive(Default)]
struct Worst {
    battery: Option<Permille>,
    link: Link,
}

impl<'a> Facts<'a> {
    pub(crate) fn new(problem: &'a Problem, policy: &'a Policy) -> Self {
        let mut robots: Vec<&RobotOffer> = problem.robots.iter().collect();
        robots.sort_by(|a, b| a.robot.cmp(&b.robot));
        robots.dedup_by(|a, b| a.robot == b.robot);
        let mut facts = Self {
            problem,
            policy,
            robots,
            needs: problem.items.iter().map(|item| needs(item, policy)).collect(),
            partners: Vec::new(),
            pairs: BTreeMap::new(),
            worst: Worst::default(),
        };
        for pair in &problem.pairs {
            if let (Some(a), Some(b)) = (facts.robot(&pair.a), facts.robot(&pair.b)) {
                facts.pairs.insert((a.min(b), a.max(b)), pair);
            }
        }
        facts.partners = (0..problem.items.len()).map(|item| facts.partners_of(item)).collect();
        facts.worst = facts.find_worst();
        facts
    }

    /// The number of a robot.
    pub(crate) fn robot(&self, id: &RobotId) -> Option<usize> {
        self.robots.binary_search_by(|offer| offer.robot.cmp(id)).ok()
    }

    /// The robot of a component that stays, when that robot is on offer.
    pub(crate) fn settled(&self, name: &Name) -> Option<usize> {
        let settled = self.problem.settled.iter().find(|settled| settled.name == *name)?;
        self.robot(&settled.home)
    }

    /// Charge of a robot, or what the policy puts in its place.
    pub(crate) fn battery(&self, robot: usize) -> Option<Permille> {
        resolve(self.robots[robot].battery, self.policy.unknown.battery, self.worst.battery)
    }

    /// Radio level of a robot, or what the policy puts in its place.
    pub(crate) fn rssi(&self, robot: usize) -> Option<Dbm> {
        resolve(self.robots[robot].rssi, self.policy.unknown.rssi, self.worst.link.rssi)
    }

    /// Distance of two robots, or what the policy puts in its place.
    pub(crate) fn distance(&self, a: usize, b: usize) -> Option<Millimetres> {
        resolve(
            self.measured_distance(a, b),
            self.policy.unknown.distance,
            self.worst.link.distance,
        )
    }

    /// A pair of robots, with what the policy puts in place of unknown facts.
    pub(crate) fn link(&self, a: usize, b: usize) -> Link {
        let pair = self.pairs.get(&(a.min(b), a.max(b)));
        let (unknown, worst) = (&self.policy.unknown, &self.worst.link);
        // Behind one access point a pair has the worse of its two levels.
        let rssi = self.rssi(a).zip(self.rssi(b)).map(|(a, b)| a.min(b));
        let jitter = resolve(pair.and_then(|pair| pair.jitter), unknown.jitter, worst.jitter);
        let delay = resolve(pair.and_then(|pair| pair.delay), unknown.delay, worst.delay);
        let loss = resolve(pair.and_then(|pair| pair.loss), unknown.loss, worst.loss);
        Link { rssi, jitter, distance: self.distance(a, b), delay, loss }
    }

    fn measured_distance(&self, a: usize, b: usize) -> Option<Millimetres> {
        let (a, b) = (self.robots[a].position?, self.robots[b].position?);
        Some(Millimetres(a.distance_mm(b)))
    }

    /// Partners whose robot is gone are left out: there is no link to judge.
    fn partners_of(&self, item: usize) -> Vec<Partner> {
        let items = &self.problem.items;
        let own = &items[item].component;
        let mut partners = Vec::new();
        for wire in &self.problem.connections {
            let far = match (wire.from == own.name, wire.to == own.name) {
                (true, false) => &wire.to,
                (false, true) => &wire.from,
                (true, true) | (false, false) => continue,
            };
            // Copies of `for_each: robot` talk within their own scope.
            let same = |other: &Item| {
                other.component.name == *far
                    && (other.component.scope == own.scope
                        || other.component.scope.is_none()
                        || own.scope.is_none())
            };
            let others = items.iter().enumerate().filter(|(_, other)| same(other));
            partners.extend(others.map(|(index, _)| Partner::Item(index)));
            partners.extend(self.settled(far).map(Partner::Settled));
        }
        partners.sort_unstable();
        partners.dedup();
        partners
    }

    fn find_worst(&self) -> Worst {
        let robots = || self.problem.robots.iter();
        let pairs = || self.pairs.values();
        // All distances of a large fleet are many; they count only when a policy asks.
        let distance = match self.policy.unknown.distance {
            IfUnknown::Worst => (0..self.robots.len())
                .flat_map(|a| (0..a).filter_map(move |b| self.measured_distance(a, b)))
                .max(),
            IfUnknown::Refuse | IfUnknown::Assume(_) => None,
        };
        Worst {
            battery: robots().filter_map(|offer| offer.battery).min(),
            link: Link {
                rssi: robots().filter_map(|offer| offer.rssi).min(),
                jitter: pairs().filter_map(|pair| pair.jitter).max(),
                distance,
                delay: pairs().filter_map(|pair| pair.delay).max(),
                loss: pairs().filter_map(|pair| pair.loss).max(),
            },
        }
    }
}

fn resolve<T: Copy>(known: Option<T>, unknown: IfUnknown<T>, worst: Option<T>) -> Option<T> {
    known.or(match unknown {
        IfUnknown::Refuse => None,
        IfUnknown::Worst => worst,
        IfUnknown::Assume(value) => Some(value),
    })
}

fn needs(item: &Item, policy: &Policy) -> Needs {
    let Needs { mut memory, mut cpu } = item.needs;
    if memory.0 == 0 {
        memory = policy.default_needs.memory;
    }
    if cpu.0 == 0 {
        cpu = policy.default_needs.cpu;
    }
    Needs { memory, cpu }
}
