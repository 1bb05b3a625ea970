//! An agent dies, its processes do not: the next brain goes on with them.

use std::time::Duration;

use sdr_tests::{
    fleet::Fleet,
    systems::{exploration, single},
};

const LONG: Duration = Duration::from_secs(30);

fn deployed(seed: u64) -> Fleet {
    let mut fleet = Fleet::new(3, seed);
    fleet.run(Duration::from_secs(2));
    fleet.deploy(0, &exploration());
    fleet.run_until(LONG, "all active", |fleet| fleet.is_running("exploration"));
    fleet.run(Duration::from_secs(2));
    fleet
}

fn launches(fleet: &Fleet) -> usize {
    fleet.robots.iter().map(|robot| robot.launches).sum()
}

#[test]
fn what_outlived_its_agent_keeps_epoch_run_and_process() {
    let mut fleet = deployed(1);
    let before = fleet.component("exploration", "camera").unwrap();
    let launched = launches(&fleet);
    fleet.kill_agent(1);
    fleet.run(Duration::from_millis(300));
    assert_eq!(fleet.active_on("camera").len(), 1, "it goes on alone");

    fleet.start_agent(1);
    fleet.run_until(LONG, "adopted", |fleet| fleet.events("adopted").len() == 2);
    fleet.run(Duration::from_secs(10));

    let after = fleet.component("exploration", "camera").unwrap();
    assert_eq!((after.epoch, after.run), (before.epoch, before.run), "{}", fleet.story());
    assert_eq!(launches(&fleet), launched, "{}", fleet.story());
    assert!(fleet.is_running("exploration"), "{}", fleet.story());
}

#[test]
fn nothing_of_it_waits_for_a_peer() {
    let mut fleet = Fleet::new(1, 2);
    fleet.deploy(0, &single(100));
    fleet.run_until(LONG, "active", |fleet| fleet.is_running("alone"));
    fleet.run(Duration::from_secs(2));
    fleet.kill_agent(0);
    fleet.run(Duration::from_secs(5));

    fleet.start_agent(0);
    let started = fleet.now;
    fleet.run_until(LONG, "adopted", |fleet| !fleet.events("adopted").is_empty());

    assert!(fleet.now.since(started) < Duration::from_millis(50));
    fleet.run(Duration::from_secs(10));
    assert_eq!((launches(&fleet), fleet.active_on("worker").len()), (1, 1), "{}", fleet.story());
}

#[test]
fn a_home_that_moved_while_its_agent_was_dead_is_fenced_and_ends() {
    let mut fleet = deployed(3);
    fleet.kill_agent(2);
    fleet.run_until(LONG, "moved", |fleet| {
        fleet.home("exploration", "position").is_some_and(|home| home != "robot-3")
            && fleet.is_running("exploration")
    });
    assert_eq!(fleet.active_on("position").len(), 2, "both sides run it");

    fleet.start_agent(2);
    fleet.run_until(LONG, "one is left", |fleet| fleet.active_on("position").len() == 1);

    fleet.run(Duration::from_secs(5));
    let position = fleet.component("exploration", "position").unwrap();
    assert_eq!(position.epoch, 2, "{}", fleet.story());
    assert!(!fleet.robots[2].has_active("position"), "{}", fleet.story());
    assert!(!fleet.events("fenced").is_empty(), "{}", fleet.story());
}

#[test]
fn what_was_undeployed_while_its_agent_was_dead_ends() {
    let mut fleet = deployed(4);
    fleet.kill_agent(2);
    fleet.run(Duration::from_millis(500));
    fleet.undeploy(0, "exploration");
    fleet.run(Duration::from_secs(2));
    assert_eq!(fleet.active_on("position").len(), 1, "nobody is there to end it");

    fleet.start_agent(2);
    fleet.run_until(LONG, "nothing runs", |fleet| fleet.active_on("position").is_empty());

    fleet.run(Duration::from_secs(5));
    assert_eq!(fleet.robots[2].processes().count(), 0, "{}", fleet.story());
}

#[test]
fn what_died_meanwhile_is_started_under_a_greater_run_of_the_same_epoch() {
    let mut fleet = deployed(5);
    let before = fleet.component("exploration", "camera").unwrap();
    fleet.kill_agent(1);
    fleet.run(Duration::from_millis(100));
    fleet.kill(1, "camera");

    fleet.start_agent(1);
    fleet.run_until(LONG, "running under a greater run", |fleet| {
        let now = fleet.component("exploration", "camera");
        now.is_some_and(|now| now.run > before.run) && fleet.is_running("exploration")
    });

    let after = fleet.component("exploration", "camera").unwrap();
    assert_eq!(after.epoch, before.epoch, "{}", fleet.story());
}
