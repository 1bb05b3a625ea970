//! What robot.toml means.

use std::path::{Path, PathBuf};

use super::*;

fn places() -> Places {
    Places {
        folder: PathBuf::from("/fleet/robot-1"),
        home: Some(PathBuf::from("/home/sdr")),
        host_name: String::from("robot-9"),
        state: PathBuf::from("/var/lib/sdr"),
        run: PathBuf::from("/run/sdr"),
    }
}

fn parse(text: &str) -> Result<RobotConfig, Problems> {
    parse_robot("robot.toml", text, &places())
}

#[test]
fn the_shortest_file_takes_every_default() {
    let config = parse("[mesh]\nunsealed = true\n").unwrap();

    assert_eq!(config.name.as_str(), "robot-9");
    assert_eq!(config.mesh.listen.to_string(), "127.0.0.1:7600");
    assert_eq!(config.api.socket, Path::new("/run/sdr/agent.sock"));
    assert_eq!(config.storage.logs.dir, Path::new("/var/lib/sdr/logs"));
    assert_eq!(config.radio.rssi, RssiSource::Auto);
    assert_eq!(config.components.on_agent_death, OnAgentDeath::Keep);
}

#[test]
fn relative_paths_count_from_the_file() {
    let config = parse(
        r#"
        [robot]
        name = "robot-1"
        devices = { camera = "/dev/video0" }
        [mesh]
        unsealed = true
        listen = "127.0.0.1:0"
        seeds = ["127.0.0.1:7602"]
        [radio]
        rssi = { file = "wireless" }
        [components]
        path = ["~/ws/install", "bin"]
        [storage]
        recordings = { dir = "out", max = "1GB", ports = ["exploration.position.odometry"] }
        "#,
    )
    .unwrap();

    assert_eq!(config.radio.rssi, RssiSource::File(PathBuf::from("/fleet/robot-1/wireless")));
    let expected = [PathBuf::from("/home/sdr/ws/install"), PathBuf::from("/fleet/robot-1/bin")];
    assert_eq!(config.components.path, expected);
    let recordings = config.storage.recordings.unwrap();
    assert_eq!(recordings.dir, Path::new("/fleet/robot-1/out"));
    assert_eq!(recordings.ports[0].to_string(), "exploration.position.odometry");
}

#[test]
fn plain_datagrams_stay_on_loopback() {
    let text = parse("[mesh]\nunsealed = true\nlisten = \"0.0.0.0:7600\"\n").unwrap_err();

    let text = text.to_string();
    assert!(text.starts_with("robot.toml:3:10: `0.0.0.0:7600` is not loopback"), "{text}");
}

#[test]
fn every_problem_is_told_at_once() {
    let problems = parse(
        "[robot]\nnmae = \"x\"\n[mesh]\nunsealed = true\ndiscovery = 5\n[capacity]\nmemory = \"2\"\n",
    )
    .unwrap_err();

    let lines: Vec<u32> = problems.as_slice().iter().map(|problem| problem.line).collect();
    assert_eq!(lines, [2, 5, 7], "{problems}");
}

#[test]
fn a_mesh_with_keys_listens_everywhere_and_its_api_where_it_is_told() {
    let config = parse("[mesh]\nkeys = \"keys\"\n[api]\nlisten = \"0.0.0.0\"\n").unwrap();

    assert_eq!(config.mesh.seal, Seal::Keys(PathBuf::from("/fleet/robot-1/keys")));
    assert_eq!(config.mesh.listen.to_string(), "0.0.0.0:7600");
    assert_eq!(config.api.listen.unwrap().to_string(), "0.0.0.0:7601");
    assert_eq!(config.mesh.fleet, None);
}

#[test]
fn plain_datagrams_go_anywhere_only_when_asked_for_in_so_many_words() {
    let config = parse("[mesh]\nunsealed = \"anywhere\"\nlisten = \"0.0.0.0\"\n").unwrap();

    assert_eq!(config.mesh.seal, Seal::Plain);
}
