//! What policies can say beyond bars: rates, expressions, programs, rules of single
//! components; and what drives a body.

use std::time::Duration;

use sdr_core::{
    id::ComponentKey,
    input::{Finding, Input, InstanceNews},
    lifecycle::LifecycleState,
    recover::Cause,
    report::RobotFacts,
    spec::{PolicyBytes, Qos, SystemSpec},
    units::Bytes,
};
use sdr_lab::sim::Process;
use sdr_tests::{
    fleet::{Behaviour, Fleet},
    systems::{allocation, component, connection, name, single},
};

const LONG: Duration = Duration::from_secs(30);

/// A policy as it would stand in a file.
fn policy(text: &str) -> PolicyBytes {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("mine.yaml");
    std::fs::write(&file, text).unwrap();
    let read = sdr_files::load_recovery(&file).unwrap_or_else(|problems| panic!("{problems}"));
    read.encode()
}

/// One component, on the first robot that fits: the receiver.
fn alone(recovery: PolicyBytes) -> SystemSpec {
    SystemSpec { allocation: allocation("exploration"), recovery, ..single(100) }
}

fn running(robots: usize, seed: u64, system: &SystemSpec) -> Fleet {
    let mut fleet = Fleet::new(robots, seed);
    fleet.run(Duration::from_secs(2));
    fleet.deploy(0, system);
    let named = system.name.to_string();
    fleet.run_until(LONG, "running", |fleet| fleet.is_running(&named));
    fleet
}

fn worker() -> ComponentKey {
    ComponentKey::new(&name("alone"), &name("worker"))
}

fn home(fleet: &Fleet) -> Option<String> {
    fleet.home("alone", "worker")
}

fn state(fleet: &Fleet) -> Option<LifecycleState> {
    fleet.component("alone", "worker")?.state
}

/// Goes to its error state by an emergency stop soon after each activation.
fn stopping() -> Behaviour {
    let stop = Some((Duration::from_millis(300), Cause::EmergencyStop));
    Behaviour { fail_after: stop, ..Behaviour::default() }
}

fn stopped_actuator(seed: u64) -> Fleet {
    let mut system = alone(PolicyBytes::default());
    system.components[0].actuator = true;
    let mut fleet = Fleet::new(3, seed);
    for robot in &mut fleet.robots {
        robot.behaviours.insert("worker".into(), stopping());
    }
    fleet.run(Duration::from_secs(2));
    fleet.deploy(0, &system);
    fleet.run_until(LONG, "stopped", |fleet| state(fleet) == Some(LifecycleState::Error));
    fleet.run(Duration::from_secs(2));
    for robot in &mut fleet.robots {
        robot.behaviours.clear();
    }
    fleet
}

#[test]
fn an_emergency_stop_of_an_actuator_holds_until_any_agent_is_told_to_reset_it() {
    let mut fleet = stopped_actuator(41);
    fleet.run(Duration::from_secs(60));
    assert_eq!(state(&fleet), Some(LifecycleState::Error), "{}", fleet.story());
    assert_eq!(fleet.events("restart"), [], "{}", fleet.story());
    let reason = fleet.component("alone", "worker").unwrap().reason;
    assert!(reason.starts_with("latched until `sdr reset`: emergency-stop"), "{reason}");

    fleet.tell(2, Input::Reset { request: 1, component: worker() });
    fleet.run_until(LONG, "active again", |fleet| fleet.is_running("alone"));

    let after = fleet.component("alone", "worker").unwrap();
    assert_eq!((after.home.as_deref(), after.epoch), (Some("robot-1"), 1), "{}", fleet.story());
    assert!(after.run > 1, "another activation has another run");
}

#[test]
fn a_latched_actuator_is_started_neither_by_its_agents_restart_nor_elsewhere() {
    let mut fleet = stopped_actuator(42);
    fleet.switch_off(0);
    fleet.run(Duration::from_secs(40));
    assert_eq!(fleet.active_on("worker"), [], "{}", fleet.story());
    assert_eq!(home(&fleet).as_deref(), Some("robot-1"), "{}", fleet.story());

    fleet.switch_on(0);
    fleet.run(Duration::from_secs(30));
    assert_eq!(fleet.active_on("worker"), [], "{}", fleet.story());
    assert_eq!(state(&fleet), Some(LifecycleState::Inactive), "{}", fleet.story());

    fleet.tell(1, Input::Reset { request: 1, component: worker() });
    fleet.run_until(LONG, "active again", |fleet| fleet.is_running("alone"));
}

#[test]
fn a_component_that_was_given_up_is_tried_anew_after_a_reset() {
    let mut fleet = running(
        1,
        43,
        &alone(policy(
            "recovery: mine\nextends: default\nladders: { once: [hold] }\noverride: { exited: { ladder: once } }\n",
        )),
    );
    fleet.kill(0, "worker");
    fleet.run(Duration::from_secs(30));
    assert!(!fleet.is_running("alone"), "{}", fleet.story());

    fleet.tell(0, Input::Reset { request: 1, component: worker() });
    fleet.run_until(LONG, "active again", |fleet| fleet.is_running("alone"));
}

fn with_devices(fleet: &Fleet, robot: usize, words: &[&str]) -> Input {
    let devices = words.iter().map(|word| name(word)).collect();
    Input::Facts(Box::new(RobotFacts { devices, ..fleet.robots[robot].facts.clone() }))
}

fn needing_a_camera(robots: usize, seed: u64) -> Fleet {
    let mut system = alone(PolicyBytes::default());
    system.components[0].devices = vec![name("camera")];
    let mut fleet = Fleet::new(robots, seed);
    for robot in 0..robots {
        let input = with_devices(&fleet, robot, &["camera"]);
        fleet.tell(robot, input);
    }
    fleet.run(Duration::from_secs(2));
    fleet.deploy(0, &system);
    fleet.run_until(LONG, "running", |fleet| fleet.is_running("alone"));
    fleet
}

#[test]
fn what_needs_a_device_that_is_gone_leaves_for_a_robot_that_has_one() {
    let mut fleet = needing_a_camera(2, 44);
    assert_eq!(home(&fleet).as_deref(), Some("robot-1"));

    let without = with_devices(&fleet, 0, &[]);
    fleet.tell(0, without);
    fleet.run_until(LONG, "moved", |fleet| {
        home(fleet).as_deref() == Some("robot-2") && fleet.is_running("alone")
    });

    let raised = fleet.events("condition-raised");
    assert!(raised[0].1.reason.contains("hardware-lost: device camera is gone"), "{raised:?}");
}

#[test]
fn what_finds_no_other_robot_goes_on_here_when_its_device_is_back() {
    let mut fleet = needing_a_camera(1, 45);
    let without = with_devices(&fleet, 0, &[]);
    fleet.tell(0, without);
    fleet.run(Duration::from_secs(20));
    assert_eq!(fleet.active_on("worker"), [], "{}", fleet.story());

    // Its body was told after its start.
    let before = fleet.events("device-back").len();
    let again = with_devices(&fleet, 0, &["camera"]);
    fleet.tell(0, again);
    fleet.run_until(LONG, "running again", |fleet| fleet.is_running("alone"));
    assert_eq!(fleet.events("device-back").len(), before + 1);
}

#[test]
fn a_rate_of_exits_sends_a_component_away_that_restarts_alone_would_keep() {
    let mut fleet = running(
        2,
        46,
        &alone(policy(
            "recovery: mine\nextends: default\nrules:\n  - { cause: crash-loop, fact: component.exits, \
         at_least: 3 per 1min, ladder: elsewhere }\n",
        )),
    );
    for exits in 1..=3 {
        fleet.kill(0, "worker");
        fleet.run(Duration::from_millis(100));
        if exits < 3 {
            fleet.run_until(LONG, "restarted", |fleet| fleet.is_running("alone"));
        }
    }

    fleet.run_until(LONG, "moved", |fleet| home(fleet).as_deref() == Some("robot-2"));
    let raised = fleet.events("condition-raised");
    assert!(raised[0].1.reason.contains("exits 3 in 60.0 s, bar 3"), "{raised:?}");
}

#[test]
fn an_expression_moves_a_component_with_its_text_as_the_reason() {
    let mut fleet = running(
        2,
        47,
        &alone(policy(
            "recovery: mine\nextends: default\nrules:\n  - cause: starved\n    when: robot.memory_free \
         < 1300.0 * MB && component.memory > 400.0 * MB\n    for: 3s\n    ladder: elsewhere\n",
        )),
    );
    fleet.run(Duration::from_secs(10));
    assert_eq!(home(&fleet).as_deref(), Some("robot-1"), "{}", fleet.story());

    fleet.robots[0].host.memory_used = Bytes::mega(300);
    fleet.run_until(LONG, "moved", |fleet| home(fleet).as_deref() == Some("robot-2"));
    let reason = &fleet.events("condition-raised")[0].1.reason;
    assert!(reason.starts_with("starved: robot.memory_free < 1300.0 * MB"), "{reason}");
    assert!(reason.ends_with("held 3.0 s"), "{reason}");
}

const WITH_PROGRAM: &str = "recovery: mine\nextends: default\nrules:\n  - cause: { exec: ./mine.py, \
                            every: 1s, causes: [cooking] }\n    for: 2s\n    ladder: elsewhere\n";

#[test]
fn a_program_that_says_so_for_long_enough_moves_a_component() {
    let mut fleet = Fleet::new(2, 48);
    fleet.robots.iter_mut().for_each(|robot| robot.says = Some(vec![]));
    fleet.run(Duration::from_secs(2));
    fleet.deploy(0, &alone(policy(WITH_PROGRAM)));
    fleet.run_until(LONG, "running", |fleet| fleet.is_running("alone"));
    fleet.run(Duration::from_secs(5));

    let cause = Cause::from_word("cooking").ok();
    let finding = Finding { component: name("worker"), cause, reason: "83 degrees".into() };
    fleet.robots[0].says = Some(vec![finding]);
    fleet.run_until(LONG, "moved", |fleet| home(fleet).as_deref() == Some("robot-2"));

    let reason = &fleet.events("condition-raised")[0].1.reason;
    assert_eq!(reason, "cooking: mine.py: 83 degrees, held 2.0 s");
    assert_eq!(fleet.events("program-failed"), []);
}

#[test]
fn a_program_without_an_answer_changes_nothing_and_is_told_of_once() {
    let mut fleet = running(2, 49, &alone(policy(WITH_PROGRAM)));
    fleet.run(Duration::from_secs(20));
    let failed = fleet.events("program-failed");
    assert_eq!(failed.len(), 1, "{}", fleet.story());
    assert!(failed[0].1.reason.contains("nothing is concluded"), "{failed:?}");
    assert_eq!(home(&fleet).as_deref(), Some("robot-1"), "{}", fleet.story());

    let stranger = Finding { component: name("stranger"), cause: None, reason: String::new() };
    fleet.robots[0].says = Some(vec![stranger]);
    fleet.run(Duration::from_secs(5));
    assert_eq!(fleet.events("program-answers"), [], "half an answer is none");

    fleet.robots[0].says = Some(vec![]);
    fleet.run(Duration::from_secs(5));
    assert_eq!(fleet.events("program-answers").len(), 1, "{}", fleet.story());
}

/// A source and a sink on one robot, with a deadline between them.
fn pair() -> SystemSpec {
    let mut wire = connection(("camera", "image"), ("position", "image"));
    wire.qos = Qos { deadline: Some(Duration::from_millis(100)), ..Qos::default() };
    SystemSpec {
        name: name("pair"),
        components: vec![component("camera", 100), component("position", 100)],
        connections: vec![wire],
        ..alone(PolicyBytes::default())
    }
}

#[test]
fn deadlines_that_readers_here_miss_restart_the_writer_and_not_the_reader() {
    let mut fleet = running(1, 50, &pair());
    let is_reader = |process: &Process| process.component.name == name("position");
    let reader = fleet.robots[0].processes().find(|(_, process)| is_reader(process));
    let reader = *reader.unwrap().0;
    for count in 1..=60 {
        let news = InstanceNews::Late { connection: 0, count };
        fleet.tell(0, Input::Instance { instance: reader, news });
        fleet.run(Duration::from_millis(100));
    }

    let restarts = fleet.events("restart");
    assert!(!restarts.is_empty(), "{}", fleet.story());
    let of_camera = |event: &sdr_core::event::Event| event.component == Some(name("camera"));
    assert!(restarts.iter().all(|(_, event)| of_camera(event)), "{restarts:?}");
    assert!(restarts[0].1.reason.contains("deadlines missed"), "{restarts:?}");
}

fn impatient(seed: u64) -> Fleet {
    let mut fleet = running(
        4,
        seed,
        &alone(policy(
            "recovery: mine\nextends: default\noverride: { robot-gone: { lost_after: 1s } }\n",
        )),
    );
    fleet.run(Duration::from_secs(5));
    fleet
}

#[test]
fn a_home_that_is_silent_for_lost_after_is_replaced_long_before_the_mesh_calls_it_gone() {
    for seed in 60..66 {
        let mut fleet = impatient(seed);
        let before = home(&fleet).unwrap();
        let number = (0..4).find(|at| fleet.robots[*at].id.as_str() == before).unwrap();

        fleet.switch_off(number);
        let off = fleet.now;
        fleet.run_until(Duration::from_secs(5), "elsewhere", |fleet| {
            fleet.active_on("worker").iter().any(|robot| robot.as_str() != before)
        });

        assert!(fleet.now.since(off) >= Duration::from_secs(1), "{}", fleet.story());
        assert_eq!(fleet.events("robot-gone"), [], "{}", fleet.story());
    }
}

#[test]
fn nobody_is_lost_while_it_is_heard_not_even_through_a_lossy_radio() {
    for seed in 70..74 {
        let mut fleet = impatient(seed);
        fleet.lose(100);
        fleet.run(Duration::from_secs(120));
        assert_eq!(fleet.events("robot-lost"), [], "{}", fleet.story());
        assert_eq!(fleet.component("alone", "worker").unwrap().epoch, 1, "{}", fleet.story());
    }
}

#[test]
fn a_home_that_only_some_do_not_hear_stays() {
    let mut fleet = impatient(75);
    // Two of four; the home is on one side, and its side has a robot to ask.
    fleet.split(2);
    fleet.run(Duration::from_secs(4));
    fleet.heal();
    fleet.run(Duration::from_secs(20));

    assert_eq!(fleet.active_on("worker").len(), 1, "one remains\n{}", fleet.story());
}
