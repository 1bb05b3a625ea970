//! Which ports cross robots, seen from here.

use alloc::{collections::BTreeSet, sync::Arc, vec::Vec};

use super::{Brain, instances::Told, reconcile::Duty, systems::SystemNow};
use crate::{
    effect::{Direction, Effect, Route},
    id::{ComponentKey, Name, RobotId},
    order::Token,
    planted::{self, Defect},
    spec::{ConnectionSpec, Qos, Reliability, port_path},
};

impl Brain {
    /// Tells the data plane when the wanted set changed.
    pub(super) fn update_routes(&mut self) {
        let mut routes = Vec::new();
        let names = self.index.my_systems();
        for system in names.filter_map(|name| self.systems.get(name)) {
            self.routes_of(system, &mut routes);
        }
        if routes != self.routes {
            self.matched.retain(|path, _| routes.iter().any(|route| route.path == *path));
            self.routes.clone_from(&routes);
            self.effects.push_back(Effect::Routes(routes));
        }
    }

    fn routes_of(&self, system: &SystemNow, routes: &mut Vec<Route>) {
        let mine = |name: &Name| self.index.mine.contains(&system.key(name));
        let touching =
            system.connections.iter().filter(|c| mine(&c.from.component) || mine(&c.to.component));
        let outputs: BTreeSet<_> = touching.map(|c| c.from.clone()).collect();
        for output in outputs {
            let producer = system.key(&output.component);
            let wires: Vec<&ConnectionSpec> =
                system.connections.iter().filter(|c| c.from == output).map(|c| &**c).collect();
            let producers = self.places(&producer, Side::Producer);
            let consumers: BTreeSet<RobotId> = wires
                .iter()
                .flat_map(|wire| self.places(&system.key(&wire.to.component), Side::Consumer))
                .collect();
            let path = port_path(&producer, &output.port);
            let route = |direction, peers: Vec<RobotId>| Route {
                path: path.clone(),
                message_type: wires[0].message_type.clone(),
                qos: widest(&wires),
                direction,
                peers,
            };
            let far = |places: &BTreeSet<RobotId>| -> Vec<RobotId> {
                places.iter().filter(|robot| **robot != self.me).cloned().collect()
            };
            if producers.contains(&self.me) && !far(&consumers).is_empty() {
                let heard = wires.iter().any(|wire| self.runs_afar(&wire.to.component, system));
                let active = self.forwarded(&producer).filter(|_| heard);
                routes.push(route(Direction::Out { active }, far(&consumers)));
            }
            if consumers.contains(&self.me) && !far(&producers).is_empty() {
                routes.push(route(Direction::In, far(&producers)));
            }
        }
    }

    /// Robots where a component runs or is prepared; a draining producer still feeds.
    fn places(&self, key: &ComponentKey, side: Side) -> BTreeSet<RobotId> {
        let Some((version, assignment)) = self.wanted(key) else { return BTreeSet::new() };
        let mut places: BTreeSet<RobotId> = self.keeps_instances(key).cloned().collect();
        places.insert(assignment.home.clone());
        let draining = assignment.drains.clone().filter(|_| match (&version.epoch, side) {
            (Some(epoch), Side::Producer) => !self.switched(key, epoch),
            (Some(_), Side::Consumer) => self.current(key).is_some(),
            (None, _) => false,
        });
        places.extend(draining);
        places
    }

    /// Whether a consumer runs on another robot. One that only stands by there is connected,
    /// but it would throw away what it is sent, and the radio has better things to carry.
    fn runs_afar(&self, consumer: &Name, system: &SystemNow) -> bool {
        let Some((_, assignment)) = self.wanted(&system.key(consumer)) else { return false };
        let mut running = assignment.drains.iter().chain([&assignment.home]);
        running.any(|robot| *robot != self.me)
    }

    /// The token whose samples go out from here: that of the home, or of the old home while
    /// it drains.
    fn forwarded(&self, key: &ComponentKey) -> Option<Token> {
        match self.duty(key) {
            Duty::Home(_) | Duty::Drain(_) if planted::is(Defect::SilentRoute) => None,
            Duty::Home(_) | Duty::Drain(_) => {
                let id = self.current(key)?;
                match &self.instances[&id].told {
                    Told::Activate(token) => Some(token.clone()),
                    Told::Nothing | Told::Deactivate | Told::Finish => None,
                }
            }
            Duty::Standby | Duty::None => None,
        }
    }

    /// Whether the routes of a prepared instance have found their peers.
    pub(super) fn routes_matched(&self, key: &ComponentKey) -> bool {
        let Some(system) = self.systems.get(&key.system) else { return true };
        let touches = |wire: &&Arc<ConnectionSpec>| {
            wire.from.component == key.name || wire.to.component == key.name
        };
        system.connections.iter().filter(touches).all(|wire| {
            let path = port_path(&system.key(&wire.from.component), &wire.from.port);
            let mut routes = self.routes.iter().filter(|route| route.path == path);
            routes.all(|route| {
                let wanted = match route.direction {
                    Direction::Out { .. } => route.peers.len(),
                    Direction::In => 1,
                };
                self.matched.get(&path).is_some_and(|matched| usize::from(*matched) >= wanted)
            })
        })
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Side {
    Producer,
    Consumer,
}

/// What serves all consumers of one output.
fn widest(wires: &[&ConnectionSpec]) -> Qos {
    let reliable = wires.iter().any(|wire| wire.qos.reliability == Reliability::Reliable);
    Qos {
        reliability: if reliable { Reliability::Reliable } else { Reliability::BestEffort },
        depth: wires.iter().map(|wire| wire.qos.depth).max().unwrap_or(1),
        deadline: None,
    }
}
