//! robot.toml of the lab's robots.

use std::path::{Path, PathBuf};

use sdr_core::id::RobotId;
use sdr_files::{Scenario, scenario::RobotSetup};
use sdr_lab::{bed, bed::BodyPaths, world::RobotPaths};

use crate::demo::quoted;

/// What the agent keeps for the system itself; robots have so much more memory.
pub(super) const RESERVE_BYTES: u64 = 150_000_000;
/// Where agents listen on wlan0.
const PORT: u16 = 7600;
/// The DDS domain: every robot has a network of its own.
const DOMAIN: u16 = 1;

/// Where things of one robot are.
#[derive(Clone, Debug)]
pub(super) struct Places {
    /// All of them.
    pub(super) own: PathBuf,
    /// Its configuration.
    pub(super) config: PathBuf,
    /// Its API.
    pub(super) socket: PathBuf,
    /// Its certificate and mesh key.
    pub(super) keys: PathBuf,
    /// What it keeps; a disk of its own is mounted there.
    pub(super) state: PathBuf,
    /// What it records.
    pub(super) recordings: PathBuf,
    /// What its components write.
    pub(super) logs: PathBuf,
    /// What it writes.
    pub(super) log: PathBuf,
    /// Orders for its component `faulty`.
    pub(super) orders: PathBuf,
}

impl Places {
    /// Short names: a Unix socket's path has at most 107 bytes.
    pub(super) fn new(folder: &Path, index: usize) -> Self {
        let own = folder.join((index + 1).to_string());
        let below = |name: &str| own.join(name);
        Self {
            config: below("robot.toml"),
            socket: below("a.sock"),
            keys: below("keys"),
            state: below("state"),
            recordings: below("recordings"),
            logs: below("logs"),
            log: below("agent.log"),
            orders: below("orders"),
            own,
        }
    }

    /// Folders that must be there before anything starts.
    pub(super) fn folders(&self) -> [&Path; 5] {
        [&self.own, &self.state, &self.recordings, &self.logs, &self.orders]
    }
}

/// The text of robot.toml for the robot at `index`; `world` is where its devices are.
pub(super) fn text(
    scenario: &Scenario,
    index: usize,
    places: &Places,
    programs: &Path,
    world: Option<&RobotPaths>,
) -> String {
    let robot = &scenario.robots[index];
    let body = BodyPaths::new(&places.own);
    let address = |index: usize| format!("\"{}:{PORT}\"", bed::ip(number(index)));
    let others = (0..scenario.robots.len()).filter(|other| *other != index);
    let seeds: Vec<String> = others.map(address).collect();
    let preference =
        if scenario.coordinator.as_ref() == Some(&robot.name) { "preferred" } else { "able" };
    let death = if scenario.components_stay { "keep" } else { "stop" };
    let mesh_times =
        [("gone_after", scenario.gone_after), ("gossip_period", scenario.gossip_period)];
    let mesh_times: String = mesh_times
        .into_iter()
        .filter_map(|(key, time)| Some(format!("{key} = \"{}ms\"\n", time?.as_millis())))
        .collect();
    format!(
        r#"# Written by `sdr lab run` for one run on one machine.
[robot]
name = "{name}"
labels = [{labels}]
devices = {{ {devices} }}
[capacity]
reserve_memory = "{RESERVE_BYTES}B"
{cpu}[mesh]
keys = {keys}
listen = {listen}
seeds = [{seeds}]
{mesh_times}[radio]
interface = "wlan0"
rssi = {{ file = {wireless} }}
[sensors]
battery = {{ file = {battery} }}
position = {{ file = {position} }}
[components]
path = [{programs}]
on_agent_death = "{death}"
[ros]
domain_id = {DOMAIN}
[coordinator]
preference = "{preference}"
[api]
socket = {socket}
[storage]
state = {state}
recordings = {{ dir = {recordings}, ports = ["exploration.position.odometry"] }}
logs = {{ dir = {logs} }}
"#,
        name = robot.name,
        labels = robot.labels.iter().map(|word| format!("{word:?}")).collect::<Vec<_>>().join(", "),
        devices = devices(robot, places, world),
        cpu = robot.cpu.map(|cpu| format!("cpu = \"{}%\"\n", cpu.0 / 10)).unwrap_or_default(),
        keys = quoted(&places.keys),
        listen = address(index),
        seeds = seeds.join(", "),
        wireless = quoted(&body.wireless),
        battery = quoted(&body.battery),
        position = quoted(&body.position),
        programs = quoted(programs),
        socket = quoted(&places.socket),
        state = quoted(&places.state),
        recordings = quoted(&places.recordings),
        logs = quoted(&places.logs),
    )
}

/// Those of the world, and those without a file, which are given one.
fn devices(robot: &RobotSetup, places: &Places, world: Option<&RobotPaths>) -> String {
    let mut devices = Vec::new();
    if let Some(world) = world {
        for (name, path) in
            [("fisheye", &world.fisheye), ("camera", &world.camera), ("wheels", &world.wheels)]
        {
            devices.push(format!("{name} = {}", quoted(path)));
        }
    }
    for name in &robot.devices {
        devices.push(format!("{name} = {}", quoted(&places.own.join(format!("device-{name}")))));
    }
    devices.join(", ")
}

/// The number of a robot in the bed.
pub(super) fn number(index: usize) -> u16 {
    u16::try_from(index).unwrap_or(u16::MAX)
}

/// A name as one of the scenario's.
pub(super) fn index_of(scenario: &Scenario, robot: &RobotId) -> usize {
    let found = scenario.robots.iter().position(|one| one.name == *robot);
    found.expect("a scenario names only its own robots")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_robots_file_is_one_that_an_agent_accepts() {
        let text = "scenario: s\ncoordinator: robot-2\nrobots:\n  robot-1: { labels: [left], devices: [arm] }\n  \
                    robot-2: { cpu: 150% }\nmesh: { gone_after: 3s }\ntimeline: []\n";
        let scenario = sdr_files::parse_scenario("s.yaml", text, Path::new(".")).unwrap();
        let folder = tempfile::tempdir().unwrap();
        for index in 0..2 {
            let places = Places::new(folder.path(), index);
            std::fs::create_dir_all(&places.own).unwrap();
            let world = RobotPaths::new(folder.path(), "r");
            let text = super::text(&scenario, index, &places, Path::new("/opt/x"), Some(&world));
            std::fs::write(&places.config, text).unwrap();

            let config = sdr_files::load_robot(&places.config).unwrap();

            assert_eq!(config.mesh.listen.ip().to_string(), format!("10.77.0.{}", index + 1));
            assert_eq!(config.mesh.gone_after, std::time::Duration::from_secs(3));
            assert_eq!(config.devices.len(), 4 - index);
        }
    }
}
