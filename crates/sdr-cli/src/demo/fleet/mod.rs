//! Three agents in a temporary folder. Dropping the fleet ends them and all they started.

mod agent;
mod config;
mod folder;
mod ports;

use std::{
    fs, io,
    path::Path,
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};

use sdr_core::id::RobotId;
use sdr_keys::authority::Authority;
use sdr_lab::world::RobotPaths;

use super::ROBOTS;
use crate::{failure::Failure, locate};

pub(crate) use agent::Agent;
pub(crate) use config::quoted;
use config::{Common, Places};
pub(crate) use folder::Folder;

/// How long agents may take to end what runs and to finish their recordings.
const END_WITHIN: Duration = Duration::from_secs(4);

/// See the module.
pub(crate) struct Fleet {
    /// The agents, in the order of [`ROBOTS`].
    pub(crate) agents: Vec<Agent>,
}

impl Fleet {
    /// Writes the robots' files and starts their agents; bodies are in the order of [`ROBOTS`].
    pub(crate) fn start(
        folder: &Path,
        bodies: &[RobotPaths],
        coordinator: Option<&str>,
    ) -> Result<Self, Failure> {
        let (program, programs) = (locate::agent()?, locate::folder()?);
        let tell = |what: &str, error: &dyn std::fmt::Display| {
            Failure::new(format!("cannot {what}: {error}"))
        };
        let ports = ports::free_udp_ports(ROBOTS.len())
            .map_err(|error| tell("find free UDP ports on 127.0.0.1", &error))?;
        let domain = ports::free_domain(std::process::id()).ok_or_else(|| {
            tell("find a free DDS domain", &"UDP ports of the domains 1 to 99 are all in use")
        })?;
        let authority = authority(folder)?;
        let common = Common { ports: &ports, domain, programs: &programs, coordinator };
        let mut started = Self { agents: Vec::new() };
        for (index, (robot, body)) in ROBOTS.into_iter().zip(bodies).enumerate() {
            let places = Places::new(folder, index);
            let name = RobotId::new(robot).expect("ROBOTS are names");
            authority.add_robot(&name, &places.keys)?;
            let text = config::text(&common, index, &places, body);
            write(&places.config, &text)
                .map_err(|error| tell(&format!("write {}", places.config.display()), &error))?;
            // Dropping what was started so far ends it when a later one fails.
            started.agents.push(Agent::start(robot, &program, &places)?);
        }
        Ok(started)
    }

    /// The agent of `robot`, which is one of [`ROBOTS`].
    pub(crate) fn agent(&self, robot: &str) -> &Agent {
        let agent = self.agents.iter().find(|agent| agent.robot == robot);
        agent.expect("every name in ROBOTS has an agent once the fleet has started")
    }

    /// Ends all agents and everything they started. Doing it again does nothing.
    pub(crate) fn stop(&mut self) {
        self.agents.iter_mut().for_each(Agent::ask_to_end);
        let deadline = Instant::now() + END_WITHIN;
        for mut agent in self.agents.drain(..) {
            agent.end(deadline);
        }
    }
}

impl Drop for Fleet {
    fn drop(&mut self) {
        self.stop();
    }
}

/// Keys for one run; other demos on this machine have others.
fn authority(folder: &Path) -> Result<Authority, Failure> {
    let fleet = RobotId::new(&format!("demo-{:x}", std::process::id())).expect("a short name");
    let wall = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let (authority, _) = Authority::init(&folder.join("authority"), &fleet, wall)?;
    Ok(authority)
}

fn write(path: &Path, text: &str) -> io::Result<()> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    fs::write(path, text)
}
