//! Parts of systems that are longer than a record: the record first, the bytes when they come.

use std::time::Duration;

use sdr_core::spec::{SystemSpec, Value};
use sdr_lab::sim::{DiskFate, Fault};
use sdr_tests::{
    fleet::Fleet,
    systems::{name, single},
};

const LONG: Duration = Duration::from_secs(30);

/// A system whose one component has a parameter of so many bytes.
fn large(bytes: usize) -> SystemSpec {
    let mut system = single(100);
    system.name = name("large");
    let text = Value::Text("x".repeat(bytes));
    system.components[0].parameters.push(("text".into(), text));
    system
}

fn crash(fleet: &mut Fleet, robot: usize, down: Option<Duration>, disk: DiskFate) {
    fleet.strike(&Fault::Crash { robot, down, disk });
}

/// How many robots that are on see the system whole.
fn whole(fleet: &Fleet) -> usize {
    let on = fleet.robots.iter().filter_map(|robot| robot.status(fleet.now));
    on.filter(|status| status.systems.iter().any(|system| system.name == "large")).count()
}

#[test]
fn all_robots_fetch_a_large_part_and_its_maker_may_die() {
    let mut fleet = Fleet::new(4, 1);
    fleet.run(Duration::from_secs(2));
    fleet.deploy(0, &large(200_000));
    fleet.run_until(LONG, "all have it", |fleet| whole(fleet) == 4 && fleet.is_running("large"));
    assert_eq!(fleet.home("large", "worker").as_deref(), Some("robot-1"));

    crash(&mut fleet, 0, None, DiskFate::Lost);

    fleet.run_until(LONG, "it runs elsewhere", |fleet| {
        fleet.home("large", "worker").is_some_and(|home| home != "robot-1")
            && fleet.is_running("large")
    });
}

#[test]
fn what_is_not_here_yet_is_waited_for_and_never_started_in_pieces() {
    let mut fleet = Fleet::new(3, 2);
    fleet.run(Duration::from_secs(2));
    fleet.deploy(0, &large(500_000));
    // Its record is everywhere, its bytes are under way.
    fleet.run(Duration::from_millis(300));
    assert_eq!(whole(&fleet), 1, "{}", fleet.story());

    crash(&mut fleet, 0, Some(Duration::from_secs(20)), DiskFate::Kept);
    fleet.run(Duration::from_secs(15));
    assert_eq!(whole(&fleet), 0, "{}", fleet.story());
    assert!(!fleet.events("part-missing").is_empty(), "{}", fleet.story());

    fleet.run_until(LONG, "its maker is back", |fleet| {
        whole(fleet) == 3 && fleet.is_running("large")
    });
    let launches: usize = fleet.robots.iter().map(|robot| robot.launches).sum();
    assert!(launches <= 2, "{launches} launches\n{}", fleet.story());
}

#[test]
fn a_robot_with_a_new_disk_gets_it_from_whoever_has_it() {
    let mut fleet = Fleet::new(3, 3);
    fleet.run(Duration::from_secs(2));
    fleet.deploy(0, &large(50_000));
    fleet.run_until(LONG, "all have it", |fleet| whole(fleet) == 3);
    crash(&mut fleet, 0, None, DiskFate::Lost);
    crash(&mut fleet, 2, Some(Duration::from_secs(1)), DiskFate::Lost);

    fleet.run_until(LONG, "both who are left have it", |fleet| {
        whole(fleet) == 2 && fleet.is_running("large")
    });
}

#[test]
fn a_robot_brings_a_large_part_back_from_its_own_disk() {
    let mut fleet = Fleet::new(1, 4);
    fleet.run(Duration::from_secs(8));
    fleet.deploy(0, &large(1_000_000));
    fleet.run_until(LONG, "it runs", |fleet| fleet.is_running("large"));

    crash(&mut fleet, 0, Some(Duration::from_secs(1)), DiskFate::Kept);
    fleet.run(Duration::from_secs(2));

    fleet.run_until(LONG, "it runs again", |fleet| fleet.is_running("large"));
}

#[test]
fn a_part_over_the_bound_is_refused_and_an_equal_system_changes_nothing() {
    let mut fleet = Fleet::new(1, 5);
    fleet.run(Duration::from_secs(8));

    fleet.deploy(0, &large(1_048_576));
    fleet.deploy(0, &large(3000));
    fleet.run(Duration::from_secs(1));
    fleet.deploy(0, &large(3000));
    fleet.run(Duration::from_secs(1));

    let answers = fleet.answers_of(0);
    let Err(refused) = answers[0] else { panic!("{answers:?}") };
    assert!(refused.contains("large/worker takes 1048"), "{refused}");
    assert!(refused.contains("at most 1048576"), "{refused}");
    assert!(matches!(answers[1], Ok(answer) if answer.changed), "{answers:?}");
    assert!(matches!(answers[2], Ok(answer) if !answer.changed), "{answers:?}");
}
