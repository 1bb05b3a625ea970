//! The simulator's fleet as the tests of the brain speak to it.
//!
//! Everything is `sdr_lab::sim`; here are only the words that make a test short: questions
//! to the first robot that is on, waits with a limit, and the story of a failed test.

use std::{
    ops::{Deref, DerefMut},
    time::Duration,
};

use sdr_core::{
    api::{ComponentView, DeployAnswer, StatusView},
    event::Event,
    id::RobotId,
    input::Input,
    report::Usage,
    time::Instant,
    units::{Bytes, Dbm, Permille},
};
use sdr_lab::sim::{Fault, Setup, Way};

pub use sdr_lab::sim::{Behaviour, Robot};

/// Longer than any test.
const FOR_GOOD: Duration = Duration::from_secs(1_000_000);

/// A fleet: `robot-1`, `robot-2`, ..., all switched on.
pub struct Fleet(sdr_lab::sim::Fleet);

impl Deref for Fleet {
    type Target = sdr_lab::sim::Fleet;

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl DerefMut for Fleet {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.0
    }
}

impl Fleet {
    /// `count` robots of 1.9 GB each.
    pub fn new(count: usize, seed: u64) -> Self {
        Self::with_memory(count, seed, Bytes::mega(1900))
    }

    /// `count` robots with this much memory each.
    pub fn with_memory(count: usize, seed: u64, memory: Bytes) -> Self {
        let words = ["fisheye", "anomaly", "camera", "controller", "position", "worker"];
        let setup = Setup {
            memory,
            words: words.map(String::from).into(),
            host_period: Duration::from_millis(100),
            keeps_events: true,
            ..Setup::new(count, seed)
        };
        let mut fleet = sdr_lab::sim::Fleet::new(setup);
        for robot in &mut fleet.robots {
            robot.takes = Some(Usage { memory: Bytes::mega(512), cpu: Permille(50) });
        }
        (0..count).for_each(|number| fleet.switch_on(number));
        Self(fleet)
    }

    /// Lets time pass until `done` or until `limit` has passed; panics then.
    pub fn run_until(&mut self, limit: Duration, what: &str, done: impl Fn(&Self) -> bool) {
        let end = self.now + limit;
        while !done(self) {
            assert!(self.step(end), "{what}: not within {limit:?}\n{}", self.story());
        }
    }

    /// Loses `permille` of all datagrams.
    pub fn lose(&mut self, permille: u16) {
        let loss = f64::from(permille) / 1000.0;
        self.strike(&Fault::Storm { loss, time: FOR_GOOD });
    }

    /// Robots below `first` hear nothing of the others from now on, and the reverse.
    pub fn split(&mut self, first: usize) {
        let inside = (0..first).collect();
        self.strike(&Fault::Cut { inside, way: Way::Both, time: FOR_GOOD });
    }

    /// Undeploys on a robot.
    pub fn undeploy(&mut self, number: usize, system: &str) {
        self.0.undeploy(number, &crate::systems::name(system));
    }

    /// The radio level a robot measures from now on.
    pub fn set_rssi(&mut self, number: usize, dbm: f64) {
        #[expect(clippy::cast_possible_truncation, reason = "radio levels are small")]
        let tenths = (dbm * 10.0) as i16;
        self.robots[number].host.rssi = Some(Dbm::from_tenths(tenths));
    }

    /// A robot carries one more label from now on.
    pub fn label(&mut self, number: usize, label: &str) {
        let mut facts = self.robots[number].facts.clone();
        facts.labels.push(label.into());
        self.robots[number].facts = facts.clone();
        self.tell(number, Input::Facts(Box::new(facts)));
    }

    /// What a robot that is on believes.
    pub fn status_of(&self, number: usize) -> StatusView {
        self.robots[number].status(self.now).expect("the robot is on")
    }

    /// What the first robot that is on believes.
    pub fn status(&self) -> StatusView {
        self.robots.iter().find_map(|robot| robot.status(self.now)).expect("a robot is on")
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

    /// What a robot answered to operators.
    pub fn answers_of(&self, number: usize) -> Vec<&Result<DeployAnswer, String>> {
        self.answers
            .iter()
            .filter(|(robot, _)| *robot == number)
            .map(|(_, answer)| answer)
            .collect()
    }

    /// All events of one kind, in time.
    pub fn events(&self, kind: &str) -> Vec<(Instant, Event)> {
        let told = self.told.iter().filter(|(_, _, event)| event.kind == kind);
        told.map(|(at, _, event)| (*at, event.clone())).collect()
    }

    /// Everything that happened, for a failed test.
    pub fn story(&self) -> String {
        sdr_lab::sim::story(self).join("\n")
    }
}
