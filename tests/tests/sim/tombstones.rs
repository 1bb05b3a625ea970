//! What was undeployed is forgotten when everybody has it on disk, and not before.

use std::time::Duration;

use sdr_core::record::{FleetValue, RecordKind};
use sdr_lab::sim::{DiskFate, Fault, Fleet, Setup, systems};

fn seconds(seconds: u64) -> Duration {
    Duration::from_secs(seconds)
}

/// Three robots that run `system0` and `system1`.
fn running() -> Fleet {
    let mut fleet = Fleet::new(Setup::new(3, 1));
    (0..3).for_each(|robot| fleet.switch_on(robot));
    fleet.run(seconds(3));
    (0..2).for_each(|number| deploy(&mut fleet, number));
    fleet.run(seconds(5));
    fleet
}

fn deploy(fleet: &mut Fleet, number: usize) {
    let needs = systems::fitting(3, 4, fleet.setup().memory, fleet.setup().cpu);
    fleet.deploy(0, &systems::chain(systems::name("system", number), 2, needs));
}

/// Records that speak of a system on a robot: its own, its parts, its homes.
fn traces(fleet: &Fleet, robot: usize, system: &str) -> usize {
    let prefix = format!("{system}/");
    let table = fleet.table(robot).unwrap();
    let of = |name: &str| name == system || name.starts_with(&prefix);
    table.records().filter(|(record, _)| of(&record.key.name)).count()
}

fn revision(fleet: &Fleet, robot: usize, system: &str) -> Option<(u64, bool)> {
    match fleet.table(robot)?.get(RecordKind::SYSTEM, system)? {
        (version, FleetValue::System(record)) => Some((version.revision, record.wanted)),
        (_, _) => None,
    }
}

fn active(fleet: &Fleet, system: &str) -> usize {
    let of = |component: &usize| fleet.key(*component).system.as_str() == system;
    let components = (0..fleet.components()).filter(of);
    components.map(|component| fleet.active_of(component).len()).sum()
}

#[test]
fn what_all_have_on_disk_leaves_no_trace_and_its_name_can_be_used_again() {
    let mut fleet = running();

    fleet.undeploy(1, &systems::name("system", 0));
    fleet.run(seconds(15));
    for robot in 0..3 {
        assert_eq!(traces(&fleet, robot, "system0"), 0);
        assert_eq!(revision(&fleet, robot, "system1"), Some((1, true)));
    }

    deploy(&mut fleet, 0);
    fleet.run(seconds(5));
    assert_eq!((revision(&fleet, 2, "system0"), active(&fleet, "system0")), (Some((3, true)), 2));
    let home = fleet.table(2).unwrap().get(RecordKind::ASSIGNMENT, "system0/c0").unwrap();
    assert_eq!(home.0.epoch.as_ref().map(|epoch| epoch.number), Some(2));
}

#[test]
fn a_robot_that_is_off_keeps_the_tombstone_until_it_knows_too() {
    let mut fleet = running();
    let disk = DiskFate::Kept;
    fleet.strike(&Fault::Crash { robot: 2, down: Some(seconds(90)), disk });

    fleet.undeploy(1, &systems::name("system", 0));
    // the others are restarted and never heard of it in this life
    fleet.run(seconds(20));
    for robot in 0..2 {
        fleet.strike(&Fault::Crash { robot, down: Some(seconds(1)), disk });
    }
    fleet.run(seconds(50));
    assert_eq!(revision(&fleet, 0, "system0"), Some((2, false)));

    fleet.run(seconds(40));
    for robot in 0..3 {
        assert_eq!(traces(&fleet, robot, "system0"), 0);
    }
    assert_eq!((active(&fleet, "system0"), active(&fleet, "system1")), (0, 2));
}

#[test]
fn a_robot_that_everybody_forgot_loses_nothing_and_brings_nothing_back() {
    let mut fleet = running();
    // with their disks the others lose all memory of the third
    fleet.strike(&Fault::Crash { robot: 2, down: Some(seconds(60)), disk: DiskFate::Kept });
    for robot in 0..2 {
        let down = Some(seconds(1 + robot as u64));
        fleet.strike(&Fault::Crash { robot, down, disk: DiskFate::Lost });
    }
    fleet.run(seconds(10));
    deploy(&mut fleet, 0);
    fleet.run(seconds(5));
    fleet.undeploy(1, &systems::name("system", 0));
    fleet.run(seconds(20));
    assert_eq!(revision(&fleet, 0, "system0").map(|(_, wanted)| wanted), Some(false));

    fleet.run(seconds(60));
    for robot in 0..3 {
        assert_eq!(traces(&fleet, robot, "system0"), 0);
    }
    assert_eq!((active(&fleet, "system0"), active(&fleet, "system1")), (0, 2));
}
