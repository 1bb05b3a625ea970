//! Standbys with real processes: a crash, a hang, a robot that vanishes.

use sdr_core::lifecycle::LifecycleState;
use sdr_tests::house::{House, is_running, kill};

/// `fisheye` on robot-1 feeds `anomaly`, which has one standby.
fn deployed(place: &str) -> House {
    let house = House::start(3);
    let file = house.folder().join("backed.yaml");
    let text = format!(
        "system: backed
defaults: {{ needs: {{ memory: 60MB, cpu: 10% }} }}
components:
  fisheye: {{ run: {{ native: fisheye }}, rate: 20Hz, devices: [fisheye], place: {{ robot: robot-1 }} }}
  anomaly:
    run: {{ native: anomaly }}
    execute: on-data
    place: {{ apart_from: [fisheye] }}
    standby: {{ count: 1, where: {place} }}
connections:
  - fisheye.image -> anomaly.image
"
    );
    std::fs::write(&file, text).unwrap();
    let output = house.agents[0].sdr(&["deploy", file.to_str().unwrap(), "--wait"]);
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{told}\n{}", house.story());
    house
}

fn number(robot: &str) -> usize {
    robot.strip_prefix("robot-").and_then(|number| number.parse::<usize>().ok()).unwrap() - 1
}

#[test]
fn a_killed_component_is_followed_by_its_second_process_without_a_restart() {
    let house = deployed("same-robot");
    let home = number(&house.component("anomaly").unwrap().home.unwrap());
    let spare_inactive = |house: &House| {
        let inactive = house.agents[home].events("inactive");
        inactive.iter().filter(|one| names(&one.event, "anomaly")).count() == 2
    };
    house.wait("a second process, ready", spare_inactive);
    let pids = house.agents[home].component_pids("anomaly");
    let before = house.component("anomaly").unwrap();

    kill(pids[0]);

    house.wait("the second one is active and heard", |house| {
        house.component("anomaly").is_some_and(|now| now.run > before.run) && house.is_running(0)
    });
    let after = house.component("anomaly").unwrap();
    assert_eq!((after.home, after.epoch), (before.home, before.epoch));
    assert!(is_running(pids[1]), "{}", house.story());
    assert!(house.agents[home].events("restart").is_empty(), "{}", house.story());
    assert_eq!(house.agents[home].events("local-standby").len(), 1, "{}", house.story());
    house.wait("another spare", |house| house.agents[home].component_pids("anomaly").len() == 3);
}

#[test]
fn a_vanished_robot_is_followed_by_the_standby_elsewhere() {
    let mut house = deployed("other-robot");
    house.wait("a standby, ready", |house| {
        house.component("anomaly").is_some_and(|anomaly| {
            let ready = |robot: &String| {
                let inactive = house.agents[number(robot)].events("inactive");
                inactive.iter().any(|one| names(&one.event, "anomaly"))
            };
            anomaly.standbys.first().is_some_and(ready)
        })
    });
    let before = house.component("anomaly").unwrap();
    let (home, standby) = (before.home.unwrap(), before.standbys[0].clone());
    let launched = house.agents[number(&standby)].component_pids("anomaly");

    let pid = house.agents[number(&home)].component_pid("anomaly").unwrap();
    house.agents[number(&home)].kill();
    kill(pid);

    house.wait("the standby is the home, active and heard", |house| {
        house.status(number(&standby)).is_some_and(|status| {
            let view = &status.systems[0];
            let anomaly = view.components.iter().find(|one| one.name == "anomaly").unwrap();
            anomaly.home.as_ref() == Some(&standby)
                && anomaly.state == Some(LifecycleState::Active)
                && view.connections[0].heard
        })
    });
    let promoted = house.agents[number(&standby)].events("promoted");
    assert_eq!(promoted.len(), 1, "{}", house.story());
    let now = house.agents[number(&standby)].component_pids("anomaly");
    assert_eq!(now, launched, "nothing had to be started\n{}", house.story());
}

fn names(event: &sdr_core::event::Event, component: &str) -> bool {
    event.component.as_ref().is_some_and(|name| name.as_str() == component)
}
