//! Brains of several robots in virtual time.
//!
//! Everything is drawn from one seed; nothing here looks at a clock. Processes pretend:
//! they take a while to initialise and do what they are told, and samples flow where the
//! routes and tokens allow it, through a fence as every consumer has it.

mod process;
mod robot;
mod wire;

use std::time::Duration;

use sdr_core::{
    api::{ComponentView, StatusView},
    event::Event,
    id::RobotId,
    input::Input,
    rng::Rng,
    spec::SystemSpec,
    time::Instant,
    units::{Bytes, Dbm},
};

pub use process::Behaviour;
pub use robot::Robot;
use wire::Wire;

/// Time between two host samples and two looks at the data flow.
const SAMPLE: Duration = Duration::from_millis(100);
const FLOW: Duration = Duration::from_millis(20);

/// A fleet: `robot-1`, `robot-2`, ...
pub struct Fleet {
    /// The present.
    pub now: Instant,
    /// By number, from 0.
    pub robots: Vec<Robot>,
    wire: Wire,
    sample_at: Instant,
    flow_at: Instant,
    requests: u64,
}

impl Fleet {
    /// `count` robots of 1.9 GB each, all switched on.
    pub fn new(count: usize, seed: u64) -> Self {
        Self::with_memory(count, seed, Bytes::mega(1900))
    }

    /// `count` robots with this much memory each.
    pub fn with_memory(count: usize, seed: u64, memory: Bytes) -> Self {
        let now = Instant::from_millis(1000);
        let robots = (0..count).map(|number| Robot::new(number, count, memory)).collect();
        let wire = Wire::new(Rng::new(seed), count);
        let mut fleet = Self { now, robots, wire, sample_at: now, flow_at: now, requests: 0 };
        (0..count).for_each(|number| fleet.switch_on(number));
        fleet
    }

    /// Lets time pass.
    pub fn run(&mut self, time: Duration) {
        let end = self.now + time;
        while self.step(end) {}
        self.now = end;
    }

    /// Lets time pass until `done` or until `limit` has passed; panics then.
    pub fn run_until(&mut self, limit: Duration, what: &str, done: impl Fn(&Self) -> bool) {
        let end = self.now + limit;
        while !done(self) {
            assert!(self.step(end), "{what}: not within {limit:?}\n{}", self.story());
        }
    }

    /// One event; false when none is due before `end`.
    fn step(&mut self, end: Instant) -> bool {
        let dues = self.robots.iter().filter_map(Robot::next_due);
        let due = dues.chain(self.wire.next_due()).chain([self.sample_at, self.flow_at]).min();
        let due = due.unwrap_or(end);
        if due > end {
            return false;
        }
        self.now = self.now.max(due);
        if self.now >= self.sample_at {
            self.sample_at = self.now + SAMPLE;
            for robot in &mut self.robots {
                robot.sample(self.now);
            }
        }
        if self.now >= self.flow_at {
            self.flow_at = self.now + FLOW;
            self.flow();
        }
        for (to, from, bytes) in self.wire.arrived(self.now) {
            self.robots[to].give(self.now, Input::Datagram { from, bytes });
        }
        for number in 0..self.robots.len() {
            self.robots[number].work(self.now);
            for (to, bytes) in self.robots[number].take_sent() {
                self.wire.send(self.now, number, to, bytes);
            }
        }
        true
    }

    /// Samples travel: each active consumer hears each active producer that reaches it.
    fn flow(&mut self) {
        let outputs: Vec<_> = self.robots.iter().flat_map(Robot::outputs).collect();
        for number in 0..self.robots.len() {
            for output in &outputs {
                let linked = self.wire.is_linked(output.robot, number);
                self.robots[number].offer_sample(self.now, number, output, linked);
            }
        }
    }

    /// Deploys on a robot; panics when it is refused.
    pub fn deploy(&mut self, number: usize, system: &SystemSpec) {
        self.requests += 1;
        let input = Input::Deploy { request: self.requests, system: system.clone() };
        self.robots[number].give(self.now, input);
        self.robots[number].work(self.now);
    }

    /// Undeploys on a robot.
    pub fn undeploy(&mut self, number: usize, system: &str) {
        self.requests += 1;
        let system = crate::systems::name(system);
        let input = Input::Undeploy { request: self.requests, system };
        self.robots[number].give(self.now, input);
        self.robots[number].work(self.now);
    }

    /// Starts a robot's agent from what is on its disk.
    pub fn switch_on(&mut self, number: usize) {
        self.robots[number].switch_on(self.now);
    }

    /// The robot vanishes: agent, processes, radio.
    pub fn switch_off(&mut self, number: usize) {
        self.robots[number].switch_off();
    }

    /// Loses `permille` of all datagrams.
    pub fn lose(&mut self, permille: usize) {
        self.wire.loss = permille;
    }

    /// Robots below `first` hear nothing of the others from now on, and the reverse.
    pub fn split(&mut self, first: usize) {
        self.wire.split_at = Some(first);
    }

    /// All hear all again.
    pub fn heal(&mut self) {
        self.wire.split_at = None;
    }

    /// The radio level a robot measures from now on.
    pub fn set_rssi(&mut self, number: usize, dbm: f64) {
        #[expect(clippy::cast_possible_truncation, reason = "radio levels are small")]
        let tenths = (dbm * 10.0) as i16;
        self.robots[number].host.rssi = Some(Dbm::from_tenths(tenths));
    }

    /// What a robot believes; of the first one that is on.
    pub fn status(&self) -> StatusView {
        let on = self.robots.iter().find(|robot| robot.is_on()).expect("a robot is on");
        on.status(self.now)
    }

    /// A component as the first robot that is on sees it.
    pub fn component(&self, system: &str, component: &str) -> Option<ComponentView> {
        let status = self.status();
        let system = status.systems.into_iter().find(|view| view.name == system)?;
        system.components.into_iter().find(|view| view.name == component)
    }

    /// Where a component's home is.
    pub fn home(&self, system: &str, component: &str) -> Option<String> {
        self.component(system, component)?.home
    }

    /// Whether all components of a system are active and all connections heard.
    pub fn is_running(&self, system: &str) -> bool {
        let status = self.status();
        status.systems.iter().any(|view| {
            view.name == system
                && view.components.iter().all(|component| {
                    component.state == Some(sdr_core::lifecycle::LifecycleState::Active)
                })
                && view.connections.iter().all(|connection| connection.heard)
        })
    }

    /// Robots (by name) on which a process of this component is active.
    pub fn active_on(&self, component: &str) -> Vec<RobotId> {
        let active = self.robots.iter().filter(|robot| robot.has_active(component));
        active.map(|robot| robot.id.clone()).collect()
    }

    /// All events of one kind, in time.
    pub fn events(&self, kind: &str) -> Vec<(Instant, Event)> {
        let mut events: Vec<(Instant, Event)> = self
            .robots
            .iter()
            .flat_map(|robot| &robot.events)
            .filter(|(_, event)| event.kind == kind)
            .cloned()
            .collect();
        events.sort_by_key(|(at, _)| *at);
        events
    }

    /// Everything that happened, for a failed test.
    pub fn story(&self) -> String {
        let mut events: Vec<&(Instant, Event)> =
            self.robots.iter().flat_map(|robot| &robot.events).collect();
        events.sort_by_key(|(at, _)| *at);
        let line = |(at, event): &&(Instant, Event)| {
            let component = event.component.as_ref().map(ToString::to_string).unwrap_or_default();
            let seconds = at.as_nanos() as f64 / 1e9;
            format!("{seconds:9.3} {} {} {component}: {}\n", event.robot, event.kind, event.reason)
        };
        events.iter().map(line).collect()
    }
}
