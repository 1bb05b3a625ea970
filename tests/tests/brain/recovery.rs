//! Trouble: crashes, hangs, fading radio, vanished robots.

use std::time::Duration;

use sdr_core::recover::Cause;
use sdr_tests::{
    fleet::{Behaviour, Fleet},
    systems::{allocation, exploration, recovery, single},
};

const LONG: Duration = Duration::from_secs(30);

fn deployed(seed: u64) -> Fleet {
    let mut fleet = Fleet::new(3, seed);
    (0..3).for_each(|number| fleet.set_rssi(number, -47.0));
    fleet.run(Duration::from_secs(2));
    fleet.deploy(0, &exploration());
    fleet.run_until(LONG, "all active", |fleet| fleet.is_running("exploration"));
    fleet.run(Duration::from_secs(2));
    fleet
}

#[test]
fn a_fading_radio_moves_both_components_together_to_the_relaxed_home() {
    let mut fleet = deployed(1);
    fleet.set_rssi(0, -55.0);
    let faded = fleet.now;
    fleet.run_until(LONG, "moved", |fleet| {
        fleet.home("exploration", "fisheye").as_deref() == Some("robot-3")
            && fleet.is_running("exploration")
    });

    let (raised, _) = fleet.events("condition-raised")[0].clone();
    assert!(raised.since(faded) >= Duration::from_secs(6), "{}", fleet.story());
    assert_eq!(fleet.home("exploration", "anomaly").as_deref(), Some("robot-3"));
    let fisheye = fleet.component("exploration", "fisheye").unwrap();
    assert_eq!(fisheye.epoch, 2);
    let anomaly = fleet.component("exploration", "anomaly").unwrap();
    assert!(anomaly.reason.contains("310 MB left (relaxed tier)"), "{}", anomaly.reason);
    for stays in ["camera", "controller", "position"] {
        assert_eq!(fleet.component("exploration", stays).unwrap().epoch, 1);
    }
    fleet.run(Duration::from_secs(3));
    assert_eq!(fleet.active_on("fisheye").len(), 1, "{}", fleet.story());
    let launches: usize = fleet.robots.iter().map(|robot| robot.launches).sum();
    assert_eq!(launches, 7, "{}", fleet.story());
}

#[test]
fn the_next_home_is_ready_when_the_time_of_a_condition_is_over() {
    let mut fleet = deployed(21);
    for robot in &mut fleet.robots {
        let slow = Behaviour { initialise: Duration::from_secs(2), ..Behaviour::default() };
        robot.behaviours.insert("fisheye".into(), slow);
    }
    fleet.set_rssi(0, -55.0);
    fleet.run_until(LONG, "moved", |fleet| fleet.events("moved").len() == 2);

    let at = |kind| fleet.events(kind)[0].0;
    let story = fleet.story();
    assert!(at("move-foreseen") < at("condition-raised"), "{story}");
    assert!(at("moved").since(at("condition-raised")) < Duration::from_secs(1), "{story}");
    let anomaly = fleet.component("exploration", "anomaly").unwrap();
    assert!(anomaly.reason.contains("held 6."), "{}", anomaly.reason);
}

#[test]
fn a_prepared_target_is_connected_and_sent_nothing_until_it_is_home() {
    let mut fleet = deployed(23);
    assert_eq!(fleet.robots[0].sends("exploration/fisheye/image"), None);
    fleet.set_rssi(0, -55.0);
    fleet.run_until(LONG, "prepared", |fleet| fleet.robots[2].processes().count() == 3);
    fleet.run(Duration::from_secs(1));

    let story = fleet.story();
    assert_eq!(fleet.events("condition-raised"), [], "{story}");
    assert_eq!(fleet.robots[0].sends("exploration/fisheye/image"), Some(false), "{story}");
    assert_eq!(fleet.robots[0].sends("exploration/anomaly/danger"), Some(true), "{story}");
    fleet.run_until(LONG, "sent to the new home", |fleet| {
        fleet.robots[0].sends("exploration/fisheye/image") == Some(true)
    });
    fleet.run_until(LONG, "moved", |fleet| fleet.events("moved").len() == 2);
    fleet.run(Duration::from_secs(3));
    // Both are on one robot again: what they say to each other stays there.
    assert_eq!(fleet.robots[2].sends("exploration/fisheye/image"), None, "{}", fleet.story());
}

#[test]
fn what_was_foreseen_and_did_not_come_is_taken_back_without_a_move() {
    let mut fleet = deployed(22);
    fleet.set_rssi(0, -55.0);
    fleet.run_until(LONG, "foreseen", |fleet| fleet.events("move-foreseen").len() == 2);
    fleet.run(Duration::from_millis(500));
    fleet.set_rssi(0, -47.0);
    fleet.run_until(LONG, "taken back", |fleet| fleet.events("move-called-off").len() == 2);
    fleet.run(Duration::from_secs(30));

    let story = fleet.story();
    assert_eq!(fleet.events("condition-raised"), [], "{story}");
    assert_eq!(fleet.home("exploration", "fisheye").as_deref(), Some("robot-1"), "{story}");
    assert_eq!(fleet.component("exploration", "fisheye").unwrap().epoch, 1, "{story}");
    assert_eq!(fleet.active_on("fisheye").len(), 1, "{story}");
    assert_eq!(fleet.robots[2].processes().count(), 1, "only position is left\n{story}");
}

#[test]
fn the_old_home_goes_on_until_the_new_one_is_heard() {
    let mut fleet = deployed(2);
    fleet.set_rssi(0, -55.0);
    fleet.run_until(LONG, "old home drained", |fleet| fleet.events("drained").len() == 2);

    let drained = fleet.events("drained")[0].0;
    let heard = fleet
        .events("heard")
        .iter()
        .filter(|(_, event)| event.token.as_ref().is_some_and(|token| token.epoch.number == 2))
        .map(|(at, _)| *at)
        .min()
        .unwrap();
    assert!(heard <= drained, "{}", fleet.story());
}

#[test]
fn what_must_be_apart_stays_apart_whichever_of_the_two_says_so() {
    let mut fleet = Fleet::new(3, 31);
    (0..3).for_each(|number| fleet.set_rssi(number, -47.0));
    fleet.run(Duration::from_secs(2));
    let mut pair = exploration();
    pair.components.truncate(2);
    pair.connections.truncate(1);
    let other = pair.components[0].name.clone();
    pair.components[1].place.apart_from.push(other);
    fleet.deploy(0, &pair);
    fleet.run_until(LONG, "all active", |fleet| fleet.is_running("exploration"));
    assert_eq!(fleet.home("exploration", "anomaly").as_deref(), Some("robot-2"));

    fleet.set_rssi(0, -55.0);
    fleet.run_until(LONG, "moved", |fleet| !fleet.events("moved").is_empty());

    assert_eq!(fleet.home("exploration", "fisheye").as_deref(), Some("robot-3"));
}

#[test]
fn nothing_comes_back_by_itself_when_the_radio_is_fine_again() {
    let mut fleet = deployed(3);
    fleet.set_rssi(0, -55.0);
    fleet.run_until(LONG, "moved", |fleet| !fleet.events("moved").is_empty());
    fleet.set_rssi(0, -47.0);
    fleet.run(Duration::from_secs(60));

    assert_eq!(fleet.home("exploration", "fisheye").as_deref(), Some("robot-3"));
    assert_eq!(fleet.events("moved").len(), 2, "{}", fleet.story());
}

#[test]
fn a_crash_is_restarted_at_home_under_the_same_epoch_and_a_greater_run() {
    let mut fleet = deployed(4);
    fleet.kill(1, "camera");
    fleet.run(Duration::from_millis(10));
    fleet.run_until(LONG, "active again", |fleet| fleet.is_running("exploration"));

    let camera = fleet.component("exploration", "camera").unwrap();
    assert_eq!((camera.home.as_deref(), camera.epoch, camera.run), (Some("robot-2"), 1, 2));
    let launches: usize = fleet.robots.iter().map(|robot| robot.launches).sum();
    assert_eq!(launches, 6, "one start for one crash\n{}", fleet.story());
    let restarts = fleet.events("restart");
    assert_eq!(restarts[0].1.numbers["after_ms"], 0.0, "the first try comes at once");
}

#[test]
fn a_hang_is_killed_and_restarted() {
    let mut fleet = deployed(5);
    fleet.hang(1, "controller");
    fleet.run(Duration::from_millis(1010));
    fleet.run_until(LONG, "active again", |fleet| fleet.is_running("exploration"));
    assert_eq!(fleet.component("exploration", "controller").unwrap().run, 2);
}

fn crashing() -> Behaviour {
    Behaviour { crash_after: Some(Duration::from_millis(200)), ..Behaviour::default() }
}

#[test]
fn a_crash_loop_climbs_from_restarts_to_another_robot() {
    let mut fleet = Fleet::new(2, 6);
    fleet.run(Duration::from_secs(2));
    fleet.robots[0].behaviours.insert("worker".into(), crashing());
    fleet.deploy(0, &pinned_first());
    fleet.run_until(LONG, "first home", |fleet| fleet.home("alone", "worker").is_some());
    assert_eq!(fleet.home("alone", "worker").as_deref(), Some("robot-1"));
    fleet.run_until(Duration::from_secs(60), "settled on robot-2", |fleet| {
        fleet.home("alone", "worker").as_deref() == Some("robot-2") && fleet.is_running("alone")
    });

    assert_eq!(fleet.events("restart").len(), 3, "{}", fleet.story());
    assert_eq!(fleet.robots[0].launches, 4, "{}", fleet.story());
    fleet.run(Duration::from_secs(30));
    assert!(fleet.is_running("alone"), "{}", fleet.story());
}

/// A system whose policy takes the first robot that fits: the receiver.
fn pinned_first() -> sdr_core::spec::SystemSpec {
    let mut system = single(100);
    system.allocation = allocation("exploration");
    system
}

#[test]
fn what_fails_on_every_robot_visits_each_once_and_stays() {
    let mut fleet = Fleet::new(3, 16);
    fleet.run(Duration::from_secs(2));
    for robot in &mut fleet.robots {
        robot.behaviours.insert("worker".into(), crashing());
    }
    fleet.deploy(0, &pinned_first());
    fleet.run(Duration::from_secs(100));

    let tried = fleet.robots.iter().filter(|robot| robot.launches > 0).count();
    assert_eq!(tried, 3, "{}", fleet.story());
    assert_eq!(fleet.events("move-started").len(), 2, "no way back for 2 min\n{}", fleet.story());
}

#[test]
fn an_error_without_a_rule_is_held_and_said() {
    let mut fleet = Fleet::new(2, 17);
    fleet.run(Duration::from_secs(2));
    let failing = Behaviour {
        fail_after: Some((Duration::from_millis(300), Cause::AbnormalBehaviour)),
        ..Behaviour::default()
    };
    fleet.robots[0].behaviours.insert("worker".into(), failing);
    let mut system = pinned_first();
    system.recovery = only_rssi();
    fleet.deploy(0, &system);
    fleet.run(Duration::from_secs(10));

    let held = fleet.events("held");
    assert_eq!(held.len(), 1, "{}", fleet.story());
    assert!(held[0].1.reason.contains("no rule for abnormal-behaviour"), "{}", held[0].1.reason);
    let worker = fleet.component("alone", "worker").unwrap();
    assert!(worker.reason.contains("no rule"), "{}", worker.reason);
}

/// A policy that knows nothing but the radio.
fn only_rssi() -> sdr_core::spec::PolicyBytes {
    let read = sdr_recovery::Policy::decode(&recovery("exploration")).unwrap();
    let mut parts = read.parts().clone();
    parts.rules.retain(|rule| rule.cause == Cause::RssiLow);
    sdr_recovery::Policy::new(parts).unwrap().encode()
}

#[test]
fn a_rescue_does_not_go_where_recovery_would_act_at_once() {
    let mut fleet = deployed(18);
    fleet.set_rssi(0, -55.0);
    fleet.run_until(LONG, "moved", |fleet| fleet.events("moved").len() == 2);
    fleet.switch_off(1);
    fleet.run(Duration::from_secs(40));

    for word in ["camera", "controller"] {
        assert_ne!(
            fleet.home("exploration", word).as_deref(),
            Some("robot-1"),
            "{}",
            fleet.story()
        );
    }
    let homeless = fleet.events("homeless");
    assert!(
        homeless.iter().any(|(_, event)| event.reason.contains("rssi-low")),
        "{}",
        fleet.story()
    );
}

#[test]
fn nothing_on_a_silent_robot_counts_as_active() {
    let mut fleet = deployed(19);
    fleet.switch_off(2);
    // each of the two judges for itself
    fleet.run_until(LONG, "gone", |fleet| fleet.events("robot-gone").len() == 2);
    let position = fleet.component("exploration", "position").unwrap();
    assert_eq!(position.state, None, "{}", position.reason);
}

#[test]
fn figures_of_components_are_known_on_every_robot() {
    let fleet = deployed(20);
    for robot in &fleet.robots {
        for component in &robot.status(fleet.now).unwrap().systems[0].components {
            assert_eq!(component.memory_bytes, 512_000_000, "{}: {}", robot.id, component.name);
        }
    }
}

#[test]
fn lost_hardware_leaves_the_robot_without_a_local_attempt() {
    let mut fleet = Fleet::new(2, 7);
    fleet.run(Duration::from_secs(2));
    let failing = Behaviour {
        fail_after: Some((Duration::from_millis(300), Cause::HardwareLost)),
        ..Behaviour::default()
    };
    fleet.robots[0].behaviours.insert("worker".into(), failing.clone());
    let mut system = single(100);
    system.components[0].place.robot = None;
    fleet.deploy(0, &system);
    fleet.run_until(LONG, "runs on robot-2", |fleet| {
        fleet.home("alone", "worker").as_deref() == Some("robot-2") && fleet.is_running("alone")
    });
    assert!(fleet.events("restart").is_empty(), "{}", fleet.story());
}

#[test]
fn components_of_a_vanished_robot_find_new_homes() {
    let mut fleet = deployed(8);
    fleet.switch_off(2);
    fleet.run_until(LONG, "position elsewhere", |fleet| {
        fleet.home("exploration", "position").is_some_and(|home| home != "robot-3")
            && fleet.is_running("exploration")
    });
    let position = fleet.component("exploration", "position").unwrap();
    assert_eq!(position.epoch, 2);

    fleet.switch_on(2);
    fleet.run(Duration::from_secs(10));
    assert_eq!(fleet.active_on("position").len(), 1, "{}", fleet.story());
    assert!(fleet.is_running("exploration"));
}

#[test]
fn a_restarted_agent_brings_its_own_components_back_alone() {
    let mut fleet = Fleet::new(1, 9);
    fleet.run(Duration::from_secs(3));
    fleet.deploy(0, &single(100));
    fleet.run_until(LONG, "active", |fleet| fleet.is_running("alone"));
    fleet.switch_off(0);
    fleet.run(Duration::from_secs(5));
    fleet.switch_on(0);
    fleet.run_until(LONG, "active again", |fleet| fleet.is_running("alone"));

    let worker = fleet.component("alone", "worker").unwrap();
    assert_eq!(worker.epoch, 1);
    assert!(worker.run > 1, "runs never go back through a restart");
}

#[test]
fn a_split_runs_both_sides_and_one_home_remains_after_the_heal() {
    let mut fleet = deployed(10);
    fleet.split(1);
    fleet.run(Duration::from_secs(30));
    assert!(!fleet.active_on("fisheye").is_empty(), "{}", fleet.story());

    fleet.heal();
    fleet.run_until(LONG, "whole again", |fleet| {
        let words = ["fisheye", "anomaly", "camera", "controller", "position"];
        fleet.is_running("exploration") && words.iter().all(|word| fleet.active_on(word).len() == 1)
    });
}
