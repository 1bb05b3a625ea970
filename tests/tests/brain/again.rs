//! An operator's next word is a fresh chance for what was given up.

use std::time::Duration;

use sdr_core::{
    input::Input,
    spec::{Launch, SystemSpec},
    units::Bytes,
};
use sdr_tests::{
    fleet::{Behaviour, Fleet},
    systems::single,
};

const LONG: Duration = Duration::from_secs(60);

fn broken() -> Behaviour {
    Behaviour { crash_after: Some(Duration::from_millis(100)), ..Behaviour::default() }
}

/// The same system with another argument of its worker: another edition.
fn corrected() -> SystemSpec {
    let mut system = single(100);
    let Launch::Native { arguments, .. } = &mut system.components[0].launch;
    arguments.push("--well".into());
    system
}

/// One robot, on which the worker was tried and given up.
fn given_up(seed: u64) -> Fleet {
    let mut fleet = Fleet::new(1, seed);
    fleet.run(Duration::from_secs(3));
    fleet.robots[0].behaviours.insert("worker".into(), broken());
    fleet.deploy(0, &single(100));
    fleet.run_until(LONG, "given up", |fleet| !fleet.events("condition-raised").is_empty());
    fleet.run(Duration::from_secs(2));
    assert_eq!(fleet.robots[0].processes().count(), 0, "{}", fleet.story());
    fleet.robots[0].behaviours.clear();
    fleet
}

#[test]
fn a_corrected_file_starts_what_was_given_up() {
    let mut fleet = given_up(1);
    fleet.deploy(0, &corrected());
    fleet.run_until(Duration::from_secs(5), "runs", |fleet| fleet.is_running("alone"));

    fleet.run(Duration::from_secs(30));
    assert!(fleet.is_running("alone"), "{}", fleet.story());
    assert!(!fleet.events("condition-cleared").is_empty(), "{}", fleet.story());
    assert_eq!(fleet.component("alone", "worker").unwrap().restarts, 0);
}

#[test]
fn what_was_undeployed_and_deployed_again_starts() {
    for pause_ms in [1, 50, 100, 3000] {
        let mut fleet = given_up(2);
        fleet.undeploy(0, "alone");
        fleet.run(Duration::from_millis(pause_ms));
        fleet.deploy(0, &single(100));
        fleet.run_until(Duration::from_secs(5), "runs", |fleet| fleet.is_running("alone"));
    }
}

#[test]
fn a_refused_placement_is_asked_again_at_once_when_the_file_changes() {
    let mut fleet = Fleet::new(1, 3);
    fleet.run(Duration::from_secs(3));
    fleet.deploy(0, &single(5000));
    fleet.run(LONG);
    assert!(!fleet.events("homeless").is_empty(), "{}", fleet.story());
    fleet.deploy(0, &single(100));
    fleet.run_until(Duration::from_secs(1), "placed", |fleet| {
        fleet.home("alone", "worker").is_some()
    });
}

#[test]
fn memory_that_others_use_is_not_given_away() {
    let mut fleet = Fleet::new(2, 4);
    let mut host = fleet.robots[0].host;
    host.memory_used = Bytes::mega(1600);
    host.memory_other = Bytes::mega(1588);
    fleet.robots[0].host = host;
    fleet.tell(0, Input::Host(host));
    fleet.run(Duration::from_secs(3));
    fleet.deploy(0, &single(300));
    fleet.run_until(LONG, "placed", |fleet| fleet.home("alone", "worker").is_some());

    assert_eq!(fleet.home("alone", "worker").as_deref(), Some("robot-2"), "{}", fleet.story());
}
