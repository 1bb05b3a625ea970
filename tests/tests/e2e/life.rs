//! Components outlive their agent: what the next one finds, under load, and what it makes of it.

use std::{fs, process::Command};

use sdr_core::api::EventView;
use sdr_tests::house::{House, exploration, is_running, kill};

fn deployed(count: usize) -> House {
    let house = House::start(count);
    let file = exploration();
    let file = file.to_str().unwrap();
    let output = house.agents[0].sdr(&["deploy", file, "--wait", "--timeout", "80s"]);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{errors}\n{}", house.story());
    house
}

/// Events of a component of one kind, by its agent.
fn events_of(house: &House, number: usize, kind: &str, component: &str) -> Vec<EventView> {
    let all = house.agents[number].events(kind).into_iter();
    let of =
        |view: &EventView| view.event.component.as_ref().is_some_and(|c| c.as_str() == component);
    all.filter(of).collect()
}

#[test]
fn a_killed_agents_components_go_on_and_are_adopted() {
    let mut house = deployed(3);
    let before = house.component("position").unwrap();
    assert_eq!(before.home.as_deref(), Some("robot-3"), "{}", house.story());
    let pid = house.agents[2].component_pid("position").unwrap();

    house.agents[2].kill();
    assert!(is_running(pid));
    house.agents[2].start();

    house.wait("position adopted", |house| {
        !events_of(house, 2, "adopted", "position").is_empty()
            && (0..3).all(|number| house.is_running(number))
    });
    assert!(is_running(pid), "the same process");
    let after = house.component("position").unwrap();
    assert_eq!((after.epoch, after.run), (before.epoch, before.run), "{}", house.story());
    assert!(house.agents[2].events("started").is_empty(), "{}", house.story());
    let logs = house.agents[2].sdr(&["logs", "position"]);
    assert!(logs.status.success(), "{}", String::from_utf8_lossy(&logs.stderr));

    kill(pid);
    house.wait("position restarted by the agent that adopted it", |house| {
        house.component("position").is_some_and(|position| position.run > before.run)
            && house.is_running(0)
    });
    let exited = &events_of(&house, 2, "exited", "position")[0].event.reason;
    assert!(exited.contains("signal 9") || exited.contains("unknown"), "{exited}");
}

#[test]
fn a_component_that_died_without_an_agent_is_started_again() {
    let mut house = deployed(3);
    let (anomaly, fisheye) = (
        house.agents[0].component_pid("anomaly").unwrap(),
        house.agents[0].component_pid("fisheye").unwrap(),
    );

    house.agents[0].kill();
    kill(anomaly);
    house.agents[0].start();

    house.wait("all of it runs", |house| house.is_running(0));
    assert!(is_running(fisheye));
    let unwatched = house.agents[0].events("ended-unwatched");
    assert_eq!(unwatched.len(), 1, "{}", house.story());
    assert!(unwatched[0].event.reason.contains(&anomaly.to_string()));
    assert_eq!(house.component("anomaly").unwrap().epoch, 1);
}

#[test]
fn an_adopted_home_that_was_moved_meanwhile_is_fenced_and_ends() {
    let mut house = deployed(3);
    let pid = house.agents[2].component_pid("position").unwrap();
    house.agents[2].kill();
    house.wait("position elsewhere", |house| {
        house.status(0).is_some_and(|status| {
            let components = status.systems.iter().flat_map(|system| &system.components);
            let mut moved = components.filter(|one| one.name == "position" && one.epoch == 2);
            moved.any(|one| one.home.as_deref() != Some("robot-3"))
        }) && house.is_running(0)
    });
    assert!(is_running(pid), "nobody is there to end it");

    house.agents[2].start();

    house.wait("fenced and gone", |house| {
        !is_running(pid) && !house.agents[2].events("fenced").is_empty()
    });
    house.wait("the others go on", |house| (0..3).all(|number| house.is_running(number)));
    assert_eq!(house.component("position").unwrap().epoch, 2, "{}", house.story());
}

#[test]
fn an_upgrade_in_place_keeps_the_process_and_its_components() {
    let house = deployed(3);
    let agent = &house.agents[0];
    let pids: Vec<u32> =
        ["anomaly", "fisheye"].iter().map(|name| agent.component_pid(name).unwrap()).collect();
    let started = agent.events("agent-started")[0].wall_ms;

    let hangup = Command::new("kill").args(["-HUP", &agent.pid().to_string()]).status().unwrap();
    assert!(hangup.success());

    house.wait("a successor under the same number", |house| {
        house.agents[0].events("agent-started").first().is_some_and(|now| now.wall_ms > started)
            && house.is_running(0)
    });
    assert!(pids.iter().all(|pid| is_running(*pid)), "{}", house.story());
    kill(pids[0]);
    house.wait("how it ended is known: it stayed the agent's child", |house| {
        let exited = events_of(house, 0, "exited", "anomaly");
        exited.first().is_some_and(|view| view.event.reason.contains("signal 9"))
    });
}

#[test]
fn stop_ends_components_and_agent_and_what_was_decided_stays() {
    let mut house = deployed(3);
    let names = ["fisheye", "anomaly", "camera", "controller", "position"];
    let pids: Vec<u32> =
        names.iter().filter_map(|name| house.agents[0].component_pid(name)).collect();
    assert!(!pids.is_empty());

    let output = house.agents[0].sdr(&["stop", "-o", "json"]);

    let told: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(told["done"], true, "{told}");
    assert!(!pids.iter().any(|pid| is_running(*pid)));
    house.agents[0].stop();
    house.agents[0].start();
    house.wait("what was deployed runs again", |house| house.is_running(0));
}

#[test]
fn components_that_are_to_stop_end_with_their_agent() {
    let mut house = House::build(1);
    let file = house.agents[0].folder.join("robot.toml");
    let text = fs::read_to_string(&file).unwrap();
    let text = text.replace("[components]\n", "[components]\non_agent_death = \"stop\"\n");
    fs::write(&file, text).unwrap();
    house.agents[0].start();
    house.wait("an agent", |house| house.sees(0, 1));
    let system = "system: two\ndefaults: { needs: { memory: 50MB, cpu: 5% } }\ncomponents:\n  \
                  goes: { run: { native: fisheye }, devices: [fisheye] }\n  \
                  stays: { run: { native: camera }, devices: [camera], on_agent_death: keep }\n";
    let path = house.folder().join("two.yaml");
    fs::write(&path, system).unwrap();
    let output = house.agents[0].sdr(&["deploy", path.to_str().unwrap(), "--wait"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let goes = house.agents[0].component_pid("goes").unwrap();
    let stays = house.agents[0].component_pid("stays").unwrap();

    house.agents[0].kill();

    house.wait("one of them ended by itself", |_| !is_running(goes));
    assert!(is_running(stays));
    house.agents[0].start();
    house.wait("both again", |house| house.is_running(0));
    assert!(is_running(stays), "{}", house.story());
}
