//! Who coordinates.

use std::time::Duration;

use sdr_core::report::RolePreference;
use sdr_tests::{fleet::Fleet, systems::exploration};

const LONG: Duration = Duration::from_secs(30);

fn coordinators(fleet: &Fleet) -> Vec<String> {
    let on = fleet.robots.iter().filter(|robot| robot.is_on());
    let mut names: Vec<String> =
        on.filter_map(|robot| robot.status(fleet.now)?.coordinator).collect();
    names.dedup();
    names
}

#[test]
fn equals_agree_on_the_first_by_name() {
    let mut fleet = Fleet::new(3, 1);
    fleet.run(Duration::from_secs(3));
    assert_eq!(coordinators(&fleet), ["robot-1"]);
    assert_eq!(fleet.status().term, 1, "{}", fleet.story());
}

#[test]
fn a_preferred_robot_holds_the_role_from_the_start() {
    let mut fleet = Fleet::new(3, 2);
    for number in 0..3 {
        fleet.switch_off(number);
    }
    fleet.robots[1].facts.role = RolePreference::Preferred;
    (0..3).for_each(|number| fleet.robots[number].wipe_disk());
    (0..3).for_each(|number| fleet.switch_on(number));
    fleet.run(Duration::from_secs(4));
    assert_eq!(coordinators(&fleet), ["robot-2"], "{}", fleet.story());
}

#[test]
fn a_killed_coordinator_is_followed_under_a_greater_term() {
    let mut fleet = Fleet::new(3, 3);
    fleet.run(Duration::from_secs(2));
    fleet.deploy(1, &exploration());
    fleet.run_until(LONG, "all active", |fleet| fleet.is_running("exploration"));
    fleet.switch_off(0);
    fleet.run_until(LONG, "a new coordinator", |fleet| coordinators(fleet) == ["robot-2"]);

    assert_eq!(fleet.status().term, 2);
}

#[test]
fn each_side_of_a_split_has_one_and_the_greater_term_stays() {
    let mut fleet = Fleet::new(4, 4);
    fleet.run(Duration::from_secs(3));
    fleet.split(2);
    fleet.run_until(LONG, "two coordinators", |fleet| coordinators(fleet).len() == 2);
    fleet.heal();
    fleet.run_until(LONG, "one coordinator", |fleet| coordinators(fleet).len() == 1);
    assert_eq!(coordinators(&fleet), ["robot-3"], "{}", fleet.story());
}

#[test]
fn a_lonely_robot_of_three_mints_no_term() {
    let mut fleet = Fleet::new(3, 5);
    fleet.run(Duration::from_secs(3));
    fleet.split(2);
    fleet.run(Duration::from_secs(30));
    let lonely = fleet.status_of(2);
    assert_eq!((lonely.coordinator.as_deref(), lonely.term), (Some("robot-1"), 1));
}
