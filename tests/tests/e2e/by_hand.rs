//! A deployment by hand, and everything that may be killed under it.

use sdr_tests::house::{House, exploration, is_running, kill};

fn deployed() -> House {
    let house = House::start(3);
    deploy(&house, 0);
    house
}

fn deploy(house: &House, number: usize) {
    let file = exploration();
    let file = file.to_str().unwrap();
    let output = house.agents[number].sdr(&["deploy", file, "--wait", "--timeout", "80s"]);
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{told}\n{errors}\n{}", house.story());
}

#[test]
fn a_killed_component_runs_again_at_home() {
    let house = deployed();
    let before = house.component("camera").unwrap();
    assert_eq!(before.home.as_deref(), Some("robot-2"), "{}", house.story());
    let pid = house.agents[1].component_pid("camera").unwrap();

    kill(pid);

    house.wait("camera under a greater run", |house| {
        house.component("camera").is_some_and(|camera| camera.run > before.run)
            && house.is_running(0)
    });
    let after = house.component("camera").unwrap();
    assert_eq!((after.home, after.epoch), (before.home, before.epoch));
    let exited = &house.agents[1].events("exited")[0].event.reason;
    assert!(exited.contains("signal") && exited.contains('9'), "{exited}");
}

#[test]
fn a_robot_that_stays_away_loses_its_components_to_the_others() {
    let mut house = deployed();
    let pid = house.agents[2].component_pid("position").unwrap();
    house.agents[2].kill();
    kill(pid);

    house.wait("position elsewhere", |house| {
        house.component("position").is_some_and(|position| {
            position.home.as_deref().is_some_and(|home| home != "robot-3") && position.epoch == 2
        }) && house.is_running(0)
    });
}

#[test]
fn the_coordinators_agent_may_die_in_the_middle_of_a_deployment() {
    let mut house = House::start(3);
    let coordinator = house.status(0).unwrap().coordinator.unwrap();
    let number = house.agents.iter().position(|agent| agent.name == coordinator).unwrap();
    let other = (number + 1) % 3;
    let file = exploration();
    let output = house.agents[other].sdr(&["deploy", file.to_str().unwrap()]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));

    house.agents[number].kill();
    house.agents[number].start();

    house.wait("all of it runs", |house| (0..3).all(|number| house.is_running(number)));
}

#[test]
fn logs_are_found_from_any_robot_and_undeploy_leaves_no_process() {
    let house = deployed();
    let logs = house.agents[0].sdr(&["logs", "position"]);
    assert!(logs.status.success(), "{}", String::from_utf8_lossy(&logs.stderr));
    let pids: Vec<u32> = ["fisheye", "anomaly"]
        .iter()
        .filter_map(|name| house.agents[0].component_pid(name))
        .collect();
    assert_eq!(pids.len(), 2);

    let output = house.agents[1].sdr(&["undeploy", "exploration", "--wait"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    house.wait("no process", |_| !pids.iter().any(|pid| is_running(*pid)));
}

#[test]
fn a_component_that_only_dies_is_seen_with_its_last_words_and_laddered() {
    let house = House::start(1);
    let script = r#"#!/bin/sh
if [ "$1" = --describe ]; then
  echo '{"name": "grumpy", "inputs": [], "outputs": []}'
  exit 0
fi
echo I will not start >&2
exit 3
"#;
    house.agents[0].install_script("grumpy", script);
    let file = house.folder().join("grumpy.yaml");
    let text = "system: grumpy\ncomponents:\n  grumpy:\n    run: { native: grumpy }\n    needs: { memory: 10MB, cpu: 5% }\n";
    std::fs::write(&file, text).unwrap();

    let output = house.agents[0].sdr(&["deploy", file.to_str().unwrap()]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));

    house.wait("restarts and then another rung", |house| {
        house.agents[0].events("restart").len() >= 3
            && !house.agents[0].events("condition-raised").is_empty()
    });
    let exited = &house.agents[0].events("exited")[0].event.reason;
    assert!(exited.contains('3') && exited.contains("I will not start"), "{exited}");
}

#[test]
fn a_component_that_never_connects_is_seen_ended_and_laddered() {
    let house = House::start(1);
    let script = r#"#!/bin/sh
if [ "$1" = --describe ]; then
  echo '{"name": "mute", "inputs": [], "outputs": []}'
  exit 0
fi
exec sleep 1000
"#;
    house.agents[0].install_script("mute", script);
    let file = house.folder().join("mute.yaml");
    let text = "system: mute\ncomponents:\n  mute:\n    run: { native: mute }\n    needs: { memory: 10MB, cpu: 5% }\n";
    std::fs::write(&file, text).unwrap();
    let output = house.agents[0].sdr(&["deploy", file.to_str().unwrap()]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    house.wait("a process", |house| house.agents[0].component_pid("mute").is_some());
    let first = house.agents[0].component_pid("mute").unwrap();

    house.wait("hung, then restarted", |house| {
        !house.agents[0].events("hung").is_empty() && !house.agents[0].events("restart").is_empty()
    });
    house.wait("the mute process ended", |_| !is_running(first));
}
