//! robot.toml of the demo's robots.

use std::{
    net::Ipv4Addr,
    path::{Path, PathBuf},
};

use sdr_lab::world::RobotPaths;

use super::super::ROBOTS;

/// What all robots of the fleet share.
pub(super) struct Common<'a> {
    /// UDP ports of the mesh, one for each of [`ROBOTS`].
    pub(super) ports: &'a [u16],
    /// The DDS domain.
    pub(super) domain: u16,
    /// Where the components are.
    pub(super) programs: &'a Path,
    /// Who should hold the coordinator role.
    pub(super) coordinator: Option<&'a str>,
}

/// Where things of one robot are.
pub(super) struct Places {
    /// Its configuration.
    pub(super) config: PathBuf,
    /// Its API.
    pub(super) socket: PathBuf,
    /// Its certificate and mesh key.
    pub(super) keys: PathBuf,
    /// What it keeps.
    pub(super) state: PathBuf,
    /// What it writes.
    pub(super) log: PathBuf,
}

impl Places {
    /// Short names: a Unix socket's path has at most 107 bytes.
    pub(super) fn new(folder: &Path, index: usize) -> Self {
        let own = folder.join((index + 1).to_string());
        Self {
            config: own.join("robot.toml"),
            socket: own.join("a.sock"),
            keys: own.join("keys"),
            state: own.join("state"),
            log: own.join("agent.log"),
        }
    }
}

/// The text of robot.toml for the robot at `index`.
pub(super) fn text(
    common: &Common<'_>,
    index: usize,
    places: &Places,
    body: &RobotPaths,
) -> String {
    let name = ROBOTS[index];
    let address = |port: &u16| format!("\"{}:{port}\"", Ipv4Addr::LOCALHOST);
    let others = common.ports.iter().enumerate().filter(|(other, _)| *other != index);
    let seeds: Vec<String> = others.map(|(_, port)| address(port)).collect();
    let preference = if common.coordinator == Some(name) { "preferred" } else { "able" };
    format!(
        r#"# Written by `sdr demo` for one run on one machine.
[robot]
name = "{name}"
devices = {{ fisheye = {fisheye}, camera = {camera}, wheels = {wheels} }}
[capacity]
memory = "1.9GB"
cpu = "400%"
[mesh]
keys = {keys}
listen = {listen}
seeds = [{seeds}]
[radio]
rssi = {{ file = {wireless} }}
[sensors]
battery = {{ file = {battery} }}
[components]
path = [{programs}]
on_agent_death = "stop"
[ros]
domain_id = {domain}
addresses = ["127.0.0.1"]
[coordinator]
preference = "{preference}"
[api]
socket = {socket}
[storage]
state = {state}
recordings = {{ ports = ["exploration.position.odometry", "exploration.anomaly.danger"] }}
"#,
        fisheye = quoted(&body.fisheye),
        camera = quoted(&body.camera),
        wheels = quoted(&body.wheels),
        keys = quoted(&places.keys),
        listen = address(&common.ports[index]),
        seeds = seeds.join(", "),
        wireless = quoted(&body.wireless),
        battery = quoted(&body.battery),
        programs = quoted(common.programs),
        domain = common.domain,
        socket = quoted(&places.socket),
        state = quoted(&places.state),
    )
}

/// A path as a TOML string.
pub(crate) fn quoted(path: &Path) -> String {
    let mut text = String::from("\"");
    for character in path.to_string_lossy().chars() {
        match character {
            '"' => text.push_str("\\\""),
            '\\' => text.push_str("\\\\"),
            control if control.is_control() => {
                text.push_str(&format!("\\u{:04X}", u32::from(control)));
            }
            plain => text.push(plain),
        }
    }
    text.push('"');
    text
}

#[cfg(test)]
mod tests {
    use sdr_core::report::RolePreference;

    use super::*;

    #[test]
    fn every_robots_file_is_one_that_an_agent_accepts() {
        let folder = tempfile::tempdir().unwrap();
        for (index, robot) in ROBOTS.into_iter().enumerate() {
            let places = Places::new(folder.path(), index);
            let common = Common {
                ports: &[4001, 4002, 4003],
                domain: 17,
                programs: Path::new("/opt/a \"quoted\" folder"),
                coordinator: Some("robot-2"),
            };
            let body = RobotPaths::new(folder.path(), robot);
            std::fs::create_dir_all(places.config.parent().unwrap()).unwrap();
            std::fs::write(&places.config, text(&common, index, &places, &body)).unwrap();

            let config = sdr_files::load_robot(&places.config).unwrap();

            assert_eq!(config.name.as_str(), robot);
            assert_eq!(config.mesh.seeds.len(), 2);
            assert!(!config.mesh.seeds.contains(&config.mesh.listen));
            assert_eq!(config.capacity.memory.unwrap().0, 1_900_000_000);
            assert_eq!(config.api.socket, places.socket);
            assert_eq!(config.components.path, [common.programs]);
            assert_eq!(config.coordinator == RolePreference::Preferred, index == 1);
        }
    }
}
