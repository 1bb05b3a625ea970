//! Standbys: where they are kept, who follows whom, how fast.

use std::time::Duration;

use sdr_core::{
    spec::{Standby, StandbyKind, StandbyWhere, SystemSpec},
    units::Bytes,
};
use sdr_lab::sim::Fault;
use sdr_tests::{
    fleet::Fleet,
    systems::{allocation, component, connection, name, single},
};

const LONG: Duration = Duration::from_secs(30);

/// `worker` with standbys, feeding `camera` that stays on the last robot.
fn backed(place: StandbyWhere, count: u8) -> SystemSpec {
    let mut system = single(100);
    system.allocation = allocation("exploration");
    system.components[0].standby = Standby { count, place, ..Standby::default() };
    system.components.push(component("camera", 100));
    system.connections = vec![connection(("worker", "out"), ("camera", "into"))];
    system
}

/// A fleet of `robots`, the system with its worker on robot-1 and its standbys ready.
fn with_standbys(robots: usize, seed: u64, system: &SystemSpec) -> Fleet {
    let mut fleet = Fleet::with_memory(robots, seed, Bytes::mega(4000));
    fleet.run(Duration::from_secs(3));
    fleet.deploy(0, system);
    let wished = usize::from(system.components[0].standby.count);
    fleet.run_until(LONG, "standbys are ready", |fleet| {
        let worker = fleet.component("alone", "worker");
        worker.is_some_and(|worker| worker.standbys.len() == wished) && fleet.is_running("alone")
    });
    fleet.run(Duration::from_secs(3));
    assert_eq!(fleet.home("alone", "worker").as_deref(), Some("robot-1"), "{}", fleet.story());
    fleet
}

fn launches(fleet: &Fleet) -> usize {
    fleet.robots.iter().map(|robot| robot.launches).sum()
}

fn pinned_camera(system: &mut SystemSpec, robot: &str) {
    system.components[1].place.robot = Some(sdr_core::id::RobotId::new(robot).unwrap());
}

#[test]
fn a_hot_standby_elsewhere_follows_a_vanished_home_within_its_windows() {
    let mut system = backed(StandbyWhere::OtherRobot, 1);
    pinned_camera(&mut system, "robot-3");
    let mut fleet = with_standbys(3, 1, &system);
    let standby = fleet.component("alone", "worker").unwrap().standbys[0].clone();
    let before = launches(&fleet);
    fleet.switch_off(0);
    let lost = fleet.now;
    fleet.run_until(LONG, "followed", |fleet| !fleet.active_on("worker").is_empty());

    let took = fleet.now.since(lost);
    assert!(took <= Duration::from_millis(400), "{took:?}\n{}", fleet.story());
    assert!(took >= Duration::from_millis(150), "never before its window: {took:?}");
    assert_eq!(launches(&fleet), before, "nothing had to be started\n{}", fleet.story());
    fleet.run_until(LONG, "heard", |fleet| {
        fleet.robots[1].status(fleet.now).is_some_and(|status| {
            let system = &status.systems[0];
            system.components[0].home.as_ref() == Some(&standby) && system.connections[0].heard
        })
    });
    let promoted = fleet.events("promoted");
    assert_eq!(promoted.len(), 1, "{}", fleet.story());
}

#[test]
fn the_home_that_comes_back_is_fenced_and_nothing_moves_again() {
    let mut fleet = with_standbys(3, 2, &backed(StandbyWhere::OtherRobot, 1));
    fleet.switch_off(0);
    fleet.run(Duration::from_secs(20));
    fleet.switch_on(0);
    fleet.run(Duration::from_secs(20));

    assert_eq!(fleet.active_on("worker").len(), 1, "{}", fleet.story());
    assert_ne!(fleet.home("alone", "worker").as_deref(), Some("robot-1"), "{}", fleet.story());
    assert_eq!(fleet.component("alone", "worker").unwrap().epoch, 2, "{}", fleet.story());
    let worker = fleet.component("alone", "worker").unwrap();
    assert_eq!(worker.standbys.len(), 1, "the used standby is replaced\n{}", fleet.story());
}

#[test]
fn a_crash_is_taken_over_on_the_same_robot_under_the_next_run() {
    let mut fleet = with_standbys(2, 3, &backed(StandbyWhere::SameRobot, 1));
    let before = launches(&fleet);
    fleet.kill(0, "worker");
    let lost = fleet.now;
    fleet.run_until(LONG, "seen", |fleet| !fleet.events("local-standby").is_empty());
    assert_eq!(launches(&fleet), before, "{}", fleet.story());
    fleet.run_until(LONG, "taken over", |fleet| !fleet.active_on("worker").is_empty());

    let took = fleet.now.since(lost);
    assert!(took <= Duration::from_millis(5), "{took:?}\n{}", fleet.story());
    fleet.run(Duration::from_secs(1));
    let worker = fleet.component("alone", "worker").unwrap();
    assert_eq!((worker.epoch, worker.run), (1, 2), "{}", fleet.story());
    assert_eq!(launches(&fleet), before + 1, "one new spare\n{}", fleet.story());
    assert!(fleet.events("restart").is_empty(), "{}", fleet.story());
}

#[test]
fn a_hang_is_killed_and_its_spare_acts_at_once() {
    let mut fleet = with_standbys(2, 4, &backed(StandbyWhere::SameRobot, 1));
    fleet.hang(0, "worker");
    fleet.run_until(LONG, "seen", |fleet| !fleet.events("hung").is_empty());
    let seen = fleet.events("hung")[0].0;
    fleet.run_until(LONG, "taken over", |fleet| {
        fleet.component("alone", "worker").is_some_and(|worker| worker.run == 2)
    });

    assert!(fleet.now.since(seen) <= Duration::from_millis(20), "{}", fleet.story());
    assert_eq!(fleet.events("local-standby").len(), 1, "{}", fleet.story());
    fleet.run(Duration::from_secs(2));
    assert_eq!(fleet.robots[0].processes().count(), 3, "{}", fleet.story());
}

#[test]
fn a_spare_that_keeps_failing_never_troubles_the_one_that_acts() {
    let mut fleet = with_standbys(2, 5, &backed(StandbyWhere::SameRobot, 1));
    for _ in 0..5 {
        let spare = fleet.robots[0]
            .processes()
            .find(|(_, process)| {
                process.component.name == name("worker") && process.token.is_none()
            })
            .map(|(id, _)| *id);
        if let Some(spare) = spare {
            fleet.end_process(0, spare);
        }
        fleet.run(Duration::from_secs(3));
    }

    let worker = fleet.component("alone", "worker").unwrap();
    assert_eq!((worker.epoch, worker.run, worker.restarts), (1, 1, 0), "{}", fleet.story());
    assert!(fleet.events("local-standby").is_empty(), "{}", fleet.story());
}

#[test]
fn a_move_for_a_cause_goes_to_the_standby_and_starts_nothing() {
    let mut system = backed(StandbyWhere::OtherRobot, 1);
    system.recovery = sdr_tests::systems::recovery("exploration");
    let mut fleet = Fleet::new(3, 6);
    (0..3).for_each(|number| fleet.set_rssi(number, -47.0));
    fleet.run(Duration::from_secs(3));
    fleet.deploy(0, &system);
    fleet.run_until(LONG, "a standby", |fleet| !fleet.events("standby-placed").is_empty());
    fleet.run(Duration::from_secs(3));
    let standby = fleet.component("alone", "worker").unwrap().standbys[0].clone();
    fleet.set_rssi(0, -55.0);
    fleet.run_until(LONG, "moved", |fleet| {
        fleet.events("moved").iter().any(|(_, event)| {
            event.component.as_ref().is_some_and(|name| name.as_str() == "worker")
        })
    });

    assert_eq!(fleet.home("alone", "worker"), Some(standby), "{}", fleet.story());
    let raised = fleet.events("condition-raised")[0].0;
    let moved = fleet.events("moved")[0].0;
    assert!(moved.since(raised) < Duration::from_millis(500), "{}", fleet.story());
}

#[test]
fn a_standby_that_hears_nobody_never_usurps() {
    let mut fleet = with_standbys(4, 7, &backed(StandbyWhere::OtherRobot, 1));
    let standby = fleet.component("alone", "worker").unwrap().standbys[0].clone();
    let number = usize::from(standby.as_bytes()[6] - b'1');
    fleet.strike(&Fault::Deaf { robot: number, time: Duration::from_secs(8) });
    fleet.run(Duration::from_secs(20));

    assert!(fleet.events("promoted").is_empty(), "{}", fleet.story());
    assert_eq!(fleet.component("alone", "worker").unwrap().epoch, 1, "{}", fleet.story());
}

#[test]
fn a_standby_whose_own_link_to_the_home_broke_asks_and_waits() {
    let mut fleet = with_standbys(4, 8, &backed(StandbyWhere::OtherRobot, 1));
    fleet.lose(150);
    fleet.run(Duration::from_secs(60));

    assert!(fleet.events("promoted").is_empty(), "{}", fleet.story());
}

#[test]
fn the_second_standby_follows_when_home_and_first_are_lost_together() {
    let mut fleet = with_standbys(5, 9, &backed(StandbyWhere::OtherRobot, 2));
    let standbys = fleet.component("alone", "worker").unwrap().standbys;
    let number = |robot: &str| usize::from(robot.as_bytes()[6] - b'1');
    fleet.switch_off(0);
    fleet.switch_off(number(&standbys[0]));
    let lost = fleet.now;
    fleet.run_until(LONG, "followed", |fleet| !fleet.active_on("worker").is_empty());

    let took = fleet.now.since(lost);
    assert!(took <= Duration::from_secs(1), "{took:?}\n{}", fleet.story());
    assert_eq!(fleet.active_on("worker")[0].as_str(), standbys[1], "{}", fleet.story());
}

#[test]
fn a_standby_does_not_share_the_rack_of_its_home() {
    let mut system = backed(StandbyWhere::OtherRobot, 1);
    system.components[0].standby.apart = vec!["rack".into()];
    let mut fleet = Fleet::new(3, 10);
    for (number, rack) in ["rack=a", "rack=a", "rack=b"].into_iter().enumerate() {
        fleet.label(number, rack);
    }
    fleet.run(Duration::from_secs(3));
    fleet.deploy(0, &system);
    fleet.run_until(LONG, "a standby", |fleet| !fleet.events("standby-placed").is_empty());

    let placed = &fleet.events("standby-placed")[0].1.reason;
    assert!(placed.starts_with("on robot-3"), "{placed}");
    assert!(placed.contains("rack=a"), "says why not robot-2: {placed}");
}

#[test]
fn a_wish_that_no_robot_can_fulfil_is_said_once_and_the_component_runs() {
    let mut system = backed(StandbyWhere::OtherRobot, 1);
    system.components[0].needs.memory = Bytes::mega(900);
    system.components[1].needs.memory = Bytes::mega(900);
    let mut fleet = Fleet::new(2, 11);
    fleet.run(Duration::from_secs(3));
    fleet.deploy(0, &system);
    fleet.run_until(LONG, "runs", |fleet| fleet.is_running("alone"));
    fleet.run(Duration::from_secs(60));

    let missing = fleet.events("standby-missing");
    assert_eq!(missing.len(), 1, "{}", fleet.story());
    assert!(missing[0].1.reason.contains("memory_free"), "{}", missing[0].1.reason);
}

#[test]
fn a_cold_standby_starts_nothing_until_its_home_is_lost() {
    let mut system = backed(StandbyWhere::OtherRobot, 1);
    system.components[0].standby.kind = StandbyKind::Cold;
    let mut fleet = with_standbys(3, 12, &system);
    let before = launches(&fleet);
    assert_eq!(before, 2, "{}", fleet.story());
    fleet.switch_off(0);
    let lost = fleet.now;
    fleet.run_until(LONG, "followed", |fleet| !fleet.active_on("worker").is_empty());

    let took = fleet.now.since(lost);
    assert!(took <= Duration::from_millis(600), "{took:?}\n{}", fleet.story());
}

#[test]
fn a_standby_that_runs_already_becomes_the_home_of_a_new_deployment_without_a_start() {
    let mut fleet = with_standbys(3, 13, &backed(StandbyWhere::OtherRobot, 1));
    fleet.switch_off(0);
    fleet.run_until(LONG, "followed", |fleet| !fleet.active_on("worker").is_empty());
    let before = launches(&fleet);
    let home = fleet.active_on("worker")[0].clone();
    let mut next = backed(StandbyWhere::OtherRobot, 1);
    next.components.push(component("fisheye", 100));
    fleet.deploy(1, &next);
    fleet.run_until(LONG, "the new one runs", |fleet| {
        fleet.component("alone", "fisheye").is_some_and(|one| one.run == 1)
    });

    assert_eq!(fleet.active_on("worker"), [home], "{}", fleet.story());
    assert!(launches(&fleet) <= before + 2, "fisheye, and one standby\n{}", fleet.story());
}
