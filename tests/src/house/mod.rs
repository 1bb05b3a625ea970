//! Real agents, real component processes, on loopback.
//!
//! Programs are built before they are used, in the profile of the tests, so that no test
//! runs a stale one. Every process started is ended by its own id; waits are for conditions.

mod agent;
mod programs;
mod wait;

use std::{
    net::{Ipv4Addr, UdpSocket},
    path::{Path, PathBuf},
    time::Duration,
};

use sdr_core::api::{ComponentView, StatusView};
use sdr_lab::world::{World, WorldConfig, WorldHandle};
use tempfile::TempDir;

pub use agent::{Agent, is_running, kill};
pub use programs::{Programs, programs};
pub use wait::wait_for;

/// Longest wait for anything; only a broken fleet takes it.
pub const LIMIT: Duration = Duration::from_secs(90);

/// Some robots and their world.
pub struct House {
    /// By number, from 0: `robot-1`, `robot-2`, ...
    pub agents: Vec<Agent>,
    /// The rovers, the tunnel, the radio.
    pub world: WorldHandle,
    folder: TempDir,
}

impl House {
    /// A fleet of `count` robots that see each other and have a coordinator.
    pub fn start(count: usize) -> Self {
        let mut house = Self::build(count);
        house.agents.iter_mut().for_each(Agent::start);
        house.wait("a fleet with a coordinator", |house| {
            (0..count).all(|number| house.sees(number, count))
        });
        house
    }

    /// As [`House::start`], and no agent is started yet.
    pub fn build(count: usize) -> Self {
        let programs = programs();
        let folder = tempfile::Builder::new().prefix("sdr").tempdir().expect("a folder");
        let names: Vec<String> =
            (1..=count.max(3)).map(|number| format!("robot-{number}")).collect();
        let followers: Vec<&str> =
            names.iter().map(String::as_str).filter(|name| *name != "robot-2").collect();
        let config = WorldConfig::convoy(folder.path(), "robot-2", &followers, 7);
        let world = World::start(config).expect("the world starts");
        let (ports, domain) = (free_ports(count), free_domain());
        let mut agents: Vec<Agent> = Vec::new();
        for (number, name) in names.iter().take(count).enumerate() {
            let mut agent = Agent::new(folder.path(), name, programs);
            agent.configure(number, &ports, domain, folder.path());
            agents.push(agent);
        }
        let house = Self { agents, world, folder };
        house.keys(&["init", "--fleet", "house"]);
        for agent in &house.agents {
            let out = agent.keys();
            house.keys(&["add", &agent.name, "--out", out.to_str().expect("a plain path")]);
        }
        house
    }

    /// Gives an agent that was not started a seed that is none of the house.
    pub fn add_seed(&mut self, number: usize, port: u16) {
        let seeds = format!("seeds = [\"127.0.0.1:{port}\", ");
        self.agents[number].rewrite("seeds = [", &seeds);
    }

    /// Whether that agent sees `count` living robots and a coordinator.
    pub fn sees(&self, number: usize, count: usize) -> bool {
        self.status(number).is_some_and(|status| {
            status.coordinator.is_some()
                && status.robots.iter().filter(|robot| robot.alive).count() == count
        })
    }

    /// Runs `sdr keys ARGUMENTS -o json` with the authority of this house.
    pub fn keys(&self, arguments: &[&str]) -> serde_json::Value {
        let mut command = std::process::Command::new(programs().sdr());
        command.args(["-o", "json", "keys", "--authority"]).arg(self.folder().join("authority"));
        let output = command.args(arguments).output().expect("sdr runs");
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "sdr keys {arguments:?}: {told}");
        serde_json::from_slice(&output.stdout).expect("JSON alone")
    }

    /// Waits until `done`; panics with all logs when it takes too long.
    pub fn wait(&self, what: &str, done: impl Fn(&Self) -> bool) {
        if !wait_for(LIMIT, || done(self)) {
            panic!("not within {LIMIT:?}: {what}\n{}", self.story());
        }
    }

    /// What a robot's agent believes; `None` while it does not answer.
    pub fn status(&self, number: usize) -> Option<StatusView> {
        self.agents[number].status()
    }

    /// A component of `exploration` as the first agent that answers sees it.
    pub fn component(&self, name: &str) -> Option<ComponentView> {
        let status = (0..self.agents.len()).find_map(|number| self.status(number))?;
        let components = status.systems.into_iter().flat_map(|system| system.components);
        components.into_iter().find(|component| component.name == name)
    }

    /// Whether an agent sees all of its systems active and heard.
    pub fn is_running(&self, number: usize) -> bool {
        let Some(status) = self.status(number) else { return false };
        !status.systems.is_empty()
            && status.systems.iter().all(|system| {
                let active = Some(sdr_core::lifecycle::LifecycleState::Active);
                system.components.iter().all(|component| component.state == active)
                    && system.connections.iter().all(|connection| connection.heard)
            })
    }

    /// A folder that ends with the house.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Logs of all agents, for a failed test.
    pub fn story(&self) -> String {
        self.agents.iter().map(Agent::story).collect()
    }
}

/// The system file of the paper.
pub fn exploration() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../systems/exploration.yaml")
}

/// UDP ports of loopback that are free now.
fn free_ports(count: usize) -> Vec<u16> {
    let bind = || UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).expect("a free port");
    let sockets: Vec<UdpSocket> = (0..count).map(|_| bind()).collect();
    let port = |socket: &UdpSocket| socket.local_addr().expect("bound").port();
    sockets.iter().map(port).collect()
}

/// A DDS domain whose first ports are free, so that parallel tests do not meet.
fn free_domain() -> u16 {
    let start = u16::try_from(std::process::id() % 60).expect("below 60");
    let free = |domain: &u16| {
        let base = 7400 + 250 * domain;
        (0..30).all(|offset| UdpSocket::bind((Ipv4Addr::UNSPECIFIED, base + offset)).is_ok())
    };
    (0..60).map(|step| 10 + (start + step * 7) % 60).find(free).expect("a free DDS domain")
}
