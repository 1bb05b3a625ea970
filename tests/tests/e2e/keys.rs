//! Keys with real agents: who is let in, who is refused, and a fleet that changes its keys.

use std::{
    fs,
    io::{Read, Write},
    net::{TcpStream, UdpSocket},
    time::Duration,
};

use sdr_tests::house::{Agent, House, exploration, wait_for};

/// What `sdr --agent 127.0.0.1:PORT --keys DIR ARGUMENTS` says: success, all its words.
fn remote(house: &House, keys: &str, arguments: &[&str]) -> (bool, String) {
    let agent = &house.agents[0];
    let address = format!("127.0.0.1:{}", agent.api_port);
    let keys = house.folder().join(keys);
    let keys = ["--agent", &address, "--keys", keys.to_str().unwrap()];
    let output = agent.sdr_anywhere(&[&keys[..], arguments].concat());
    let told = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    (output.status.success(), told.into_owned())
}

fn operator(house: &House, name: &str, role: &str) {
    let out = house.folder().join(name);
    house.keys(&["operator", name, "--role", role, "--out", out.to_str().unwrap()]);
}

/// Words of all bad input that an agent told of.
fn told(agent: &Agent) -> String {
    agent.events("bad-input").iter().map(|view| view.event.reason.clone() + "\n").collect()
}

fn key_of(agent: &Agent) -> u64 {
    agent.health()["keys"]["newest"].as_u64().unwrap_or(0)
}

#[test]
fn operators_do_what_their_role_allows_and_others_are_refused_with_a_reason() {
    let house = House::start(1);
    operator(&house, "anna", "view");
    operator(&house, "ben", "operate");
    let system = exploration();
    let deploy = ["deploy", system.to_str().unwrap()];

    let (fine, said) = remote(&house, "anna", &["status"]);
    assert!(said.contains("robot-1"), "{fine} {said}");
    let (fine, said) = remote(&house, "anna", &deploy);
    assert!(!fine && said.contains("view/anna may look and not POST /v1/deploy"), "{said}");
    let (fine, said) = remote(&house, "ben", &deploy);
    assert!(fine, "{said}");
    let (fine, said) = remote(&house, "r1/keys", &["status"]);
    assert!(!fine && said.contains("these are the keys of robot robot-1"), "{said}");

    house.keys(&["revoke", "ben"]);
    let pushed = house.agents[0].sdr(&[
        "keys",
        "push",
        "--authority",
        house.folder().join("authority").to_str().unwrap(),
    ]);
    assert!(pushed.status.success(), "{pushed:?}");
    let (fine, said) = remote(&house, "ben", &["status"]);
    assert!(!fine && said.contains("it refused operate/ben: revoked"), "{said}");
    assert!(told(&house.agents[0]).contains("api: operate/ben was revoked"), "{}", house.story());

    let mut plain = TcpStream::connect(("127.0.0.1", house.agents[0].api_port)).unwrap();
    plain.write_all(b"GET /v1/status HTTP/1.0\r\nHost: x\r\n\r\n").unwrap();
    let mut answer = Vec::new();
    // An alert and the end, or the end alone.
    let _ = plain.read_to_end(&mut answer);
    assert!(!answer.windows(4).any(|word| word == b"HTTP"), "{answer:?}");

    let strangers = House::build(0);
    operator(&strangers, "eve", "operate");
    let keys = strangers.folder().join("eve");
    let (fine, said) = remote(&house, keys.to_str().unwrap(), &["status"]);
    assert!(!fine && said.contains("a certificate of another authority"), "{said}");
}

#[test]
fn a_fleet_changes_its_key_while_it_runs_and_the_revoked_robot_never_learns_it() {
    let house = House::start(3);
    let authority = house.folder().join("authority");
    let push = |number: usize| {
        let arguments = ["keys", "push", "--authority", authority.to_str().unwrap()];
        let pushed = house.agents[number].sdr(&arguments);
        assert!(pushed.status.success(), "{pushed:?}");
    };

    house.keys(&["rotate"]);
    push(1);
    house.wait("all robots seal with key 2", |house| {
        house.agents.iter().all(|agent| agent.health()["keys"]["seals_with"] == 2)
    });
    for agent in &house.agents {
        assert!(agent.events("robot-gone").is_empty(), "{}", house.story());
        assert_eq!(agent.events("key-learned").len(), 1, "{}", house.story());
    }

    house.keys(&["revoke", "robot-3"]);
    push(0);
    house.wait("robot-1 and robot-2 have key 3, and robot-3 is gone", |house| {
        [0, 1].into_iter().all(|number| key_of(&house.agents[number]) == 3 && house.sees(number, 2))
    });
    assert_eq!(key_of(&house.agents[2]), 2);
    house.wait("the revoked robot is refused and named", |house| {
        [0, 1].into_iter().any(|number| {
            let told = told(&house.agents[number]);
            told.contains("stream: robot/robot-3 was revoked")
                && told.contains("was retired")
                && house.agents[number].bad_input("certificates_refused") > 0
                && house.agents[number].bad_input("datagrams_retired_key") > 0
        })
    });
}

#[test]
fn robots_of_other_keys_and_recorded_datagrams_are_refused_counted_and_named() {
    let mut house = House::build(3);
    // A socket that robot-1 takes for a robot, and that keeps what it hears.
    let recorder = UdpSocket::bind("127.0.0.1:0").unwrap();
    recorder.set_read_timeout(Some(Duration::from_millis(100))).unwrap();
    house.add_seed(0, recorder.local_addr().unwrap().port());
    let strangers = House::build(3);
    fs::remove_dir_all(house.agents[2].keys()).unwrap();
    fs::rename(strangers.agents[2].keys(), house.agents[2].keys()).unwrap();

    house.agents.iter_mut().for_each(Agent::start);
    house.wait("robot-1 and robot-2 see each other", |house| {
        [0, 1].into_iter().all(|number| house.sees(number, 2))
    });
    house.wait("the stranger's datagrams are counted", |house| {
        house.agents[0].bad_input("datagrams_forged") > 0
            && told(&house.agents[0]).contains("its seal is broken")
    });

    let mut recorded = Vec::new();
    let mut buffer = [0; 2000];
    let heard = wait_for(sdr_tests::house::LIMIT, || {
        let came = recorder.recv_from(&mut buffer);
        recorded.extend(came.ok().map(|(length, _)| buffer[..length].to_vec()));
        recorded.len() >= 10
    });
    assert!(heard, "{}", house.story());
    house.agents[0].stop();
    house.agents[1].stop();
    house.agents[1].start();
    house.wait("robot-2 is back", |house| house.status(1).is_some());
    let before = house.agents[1].health()["keys"]["opened"].clone();
    for datagram in &recorded {
        recorder.send_to(datagram, ("127.0.0.1", house.agents[1].port)).unwrap();
    }
    recorder.send_to(b"SD\x01 plain words", ("127.0.0.1", house.agents[1].port)).unwrap();

    house.wait("recorded datagrams are refused, counted and named", |house| {
        let agent = &house.agents[1];
        agent.bad_input("datagrams_unproven") >= 10
            && agent.bad_input("datagrams_unsealed") >= 1
            && told(agent).contains("did not prove to live")
    });
    assert_eq!(house.agents[1].health()["keys"]["opened"], before);
}
