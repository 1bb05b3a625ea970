//! Garbage from all sides: that client gets an error, nobody else notices.

use std::{
    fs,
    io::{Read, Write},
    net::UdpSocket,
    os::unix::net::UnixStream,
    path::Path,
};

use sdr_tests::house::{Agent, House, exploration};
use serde_json::Value;

/// What an HTTP request of these bytes is answered with.
fn ask(socket: &Path, request: &[u8]) -> String {
    let mut stream = UnixStream::connect(socket).unwrap();
    stream.write_all(request).unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    String::from_utf8_lossy(&answer).into_owned()
}

fn health(agent: &Agent) -> Value {
    let answer = ask(&agent.socket(), b"GET /v1/health HTTP/1.0\r\nHost: x\r\n\r\n");
    serde_json::from_str(answer.split("\r\n\r\n").nth(1).unwrap_or("")).unwrap()
}

/// A line on the components' socket that no component would send; the answer.
fn lie_to_component_socket(agent: &Agent) -> String {
    let socket = agent.socket().with_extension("components.sock");
    ask(&socket, b"{\"v\": 1, \"hello\": [nonsense\n")
}

#[test]
fn garbage_on_every_door_disturbs_nobody() {
    let house = House::start(3);
    let file = exploration();
    let deployed = house.agents[0].sdr(&["deploy", file.to_str().unwrap(), "--wait"]);
    assert!(deployed.status.success(), "{}", house.story());
    let pids: Vec<_> = house.agents.iter().map(|agent| agent.pid()).collect();

    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    for agent in &house.agents {
        for length in [0, 1, 7, 100, 1200, 1201, 9000] {
            let noise: Vec<u8> = (0..=250u8).cycle().step_by(37).take(length).collect();
            socket.send_to(&noise, ("127.0.0.1", agent.port)).unwrap();
        }
        let refused = ask(&agent.socket(), b"POST /v1/deploy HTTP/1.0\r\nContent-Length: 9\r\nContent-Type: application/json\r\n\r\n{\"a\": [}]");
        assert!(refused.contains(" 400 ") && refused.contains("error"), "{refused}");
        let told = lie_to_component_socket(agent);
        assert!(told.contains("error"), "{told}");
    }

    for agent in &house.agents {
        house.wait("all of it counted", |_| {
            let health = health(agent);
            health["bad_input"]["datagrams_unsealed"].as_u64() >= Some(7)
                && health["bad_input"]["component_lines_bad"].as_u64() >= Some(1)
        });
    }
    house.wait("still running", |house| (0..3).all(|number| house.is_running(number)));
    let again: Vec<_> = house.agents.iter().map(|agent| agent.pid()).collect();
    assert_eq!(pids, again);
    for name in ["fisheye", "anomaly", "camera", "controller", "position"] {
        let component = house.component(name).unwrap();
        assert_eq!((component.epoch, component.run, component.restarts), (1, 1, 0), "{name}");
    }
}

#[test]
fn a_corrupt_state_file_is_kept_aside_and_the_mesh_tells_the_rest() {
    let mut house = House::start(3);
    let file = exploration();
    let deployed = house.agents[0].sdr(&["deploy", file.to_str().unwrap(), "--wait"]);
    assert!(deployed.status.success(), "{}", house.story());

    house.agents[1].stop();
    let state = house.agents[1].state();
    let spoil = |name: &str| {
        let path = state.join(name);
        let mut bytes = fs::read(&path).ok()?;
        let middle = bytes.len() / 2;
        *bytes.get_mut(middle)? ^= 0x55;
        fs::write(&path, bytes).ok()
    };
    let names: Vec<String> = fs::read_dir(&state)
        .unwrap()
        .flatten()
        .filter(|entry| entry.path().is_file())
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    assert!(names.iter().filter_map(|name| spoil(name)).count() > 0, "no state file: {names:?}");
    house.agents[1].start();

    house.wait("running again", |house| (0..3).all(|number| house.is_running(number)));
    assert!(!house.agents[1].events("state-corrupt").is_empty(), "{}", house.story());
}

#[test]
fn a_bad_system_file_is_refused_whole_with_its_place() {
    let house = House::start(1);
    let file = house.folder().join("bad.yaml");
    let text = "system: bad\ncomponents:\n  camera:\n    run: { native: camera }\n    rat: 15Hz\nconnections:\n  - camera.image -> ghost.image\n";
    fs::write(&file, text).unwrap();

    let output = house.agents[0].sdr(&["deploy", file.to_str().unwrap()]);
    let told = String::from_utf8_lossy(&output.stderr).into_owned()
        + &String::from_utf8_lossy(&output.stdout);

    assert_eq!(output.status.code(), Some(1), "{told}");
    assert!(told.contains("bad.yaml:5:5"), "{told}");
    assert!(told.contains("rat") && told.contains("did you mean `rate`"), "{told}");
    assert!(house.status(0).unwrap().systems.is_empty());
}
