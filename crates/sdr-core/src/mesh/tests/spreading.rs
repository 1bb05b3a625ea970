//! How far and how fast news goes.

use alloc::{format, string::String, vec};
use core::time::Duration;

use super::{super::*, Bench, host, mesh, robot, role};
use crate::{
    order::Version,
    record::{FleetKey, RecordKind},
    report::LinkReport,
    units::Bytes,
};

#[test]
fn what_one_robot_says_reaches_all_others_through_heavy_loss() {
    let mut bench = Bench::new(6, 300);
    bench.run(Duration::from_secs(3));

    bench.mesh(0).report(&host(42), Push::Now);
    bench.mesh(3).publish(vec![role(3, 5)]);
    bench.run(Duration::from_secs(6));

    for number in 0..6 {
        assert_eq!(bench.host_seen(number, 0).unwrap().memory_used, Bytes(42));
        let held = bench.mesh(number).fleet().get(RecordKind::ROLE, "").unwrap().0.term;
        assert_eq!(held, 5, "robot-{number}");
        assert_eq!(bench.mesh(number).alive().count(), 5);
    }
}

#[test]
fn many_records_of_one_author_arrive_in_order_and_whole() {
    let mut bench = Bench::new(2, 0);
    let links = |number: usize| Report::Link(robot(100 + number), LinkReport::default());
    for number in 0..300 {
        bench.mesh(0).report(&links(number), Push::WithGossip);
    }
    bench.run(Duration::from_secs(10));

    let seen = bench.meshes[1].as_ref().unwrap().authors().author(&robot(0)).unwrap();
    assert_eq!(seen.reports().count(), 300);
}

#[test]
fn the_greater_version_stays_wherever_it_is_met_first() {
    let mut bench = Bench::new(2, 1000);
    bench.mesh(0).publish(vec![role(0, 3)]);
    bench.mesh(1).publish(vec![role(1, 2)]);
    bench.run(Duration::from_secs(1));
    assert_eq!(bench.mesh(1).fleet().get(RecordKind::ROLE, "").unwrap().0.term, 2);

    bench.loss = 0;
    bench.run(Duration::from_secs(2));
    for number in 0..2 {
        assert_eq!(bench.mesh(number).fleet().get(RecordKind::ROLE, "").unwrap().0.term, 3);
    }
}

#[test]
fn a_robot_that_lost_its_disk_is_heard_again() {
    let mut bench = Bench::new(3, 0);
    bench.meshes[2] = Some(mesh(2, 3, 9));
    bench.mesh(2).report(&host(1), Push::Now);
    bench.run(Duration::from_secs(2));
    bench.meshes[2] = Some(mesh(2, 3, 1));
    bench.mesh(2).report(&host(2), Push::Now);
    bench.run(Duration::from_secs(3));

    assert_eq!(bench.host_seen(0, 2).unwrap().memory_used, Bytes(2));
    assert!(bench.mesh(2).incarnation().counter > 9);
}

#[test]
fn one_seed_is_enough_to_find_everybody() {
    let mut bench = Bench::new(12, 0);
    for number in 0..12 {
        bench.meshes[number] = Some(mesh(number, 1, 1));
    }
    bench.run(Duration::from_secs(8));
    for number in 0..12 {
        assert_eq!(bench.mesh(number).alive().count(), 11, "robot-{number}");
        assert_eq!(bench.mesh(number).peer_addresses().len(), 11, "robot-{number}");
    }
}

#[test]
fn a_robot_that_comes_from_another_address_is_answered_there() {
    let mut bench = Bench::new(4, 0);
    bench.run(Duration::from_secs(2));
    bench.places[3] = 50;
    bench.run(Duration::from_secs(3));
    for number in 0..3 {
        let known = bench.mesh(number).peer_addresses();
        assert!(known.contains(&super::address(50)) && !known.contains(&super::address(3)));
    }
}

fn thing(number: usize) -> FleetRecord {
    let key = FleetKey { kind: RecordKind(200), name: format!("thing-{number}") };
    let version = Version { epoch: None, revision: 1, term: 0, author: robot(0) };
    FleetRecord { key, version, value: vec![7; 60] }
}

#[test]
fn a_large_table_is_caught_up_with_from_one_peer() {
    let mut bench = Bench::new(2, 50);
    bench.mesh(0).publish((0..3000).map(thing).collect());
    bench.run(Duration::from_secs(30));

    assert_eq!(bench.mesh(1).fleet().len(), 3000);
    assert!(bench.mesh(1).is_in_step());
    bench.run(Duration::from_secs(2));
    let before = bench.mesh(0).counters().sent_bytes;
    bench.run(Duration::from_secs(10));
    let idle = bench.mesh(0).counters().sent_bytes - before;
    assert!(idle < 10_000, "{idle} bytes in ten seconds in step");
}

#[test]
fn reports_that_may_wait_are_told_as_they_are_in_their_turn() {
    let mut bench = Bench::new(3, 0);
    bench.run(Duration::from_secs(2));
    for step in 0..100 {
        bench.mesh(0).report(&host(step), Push::WithGossip);
        bench.run(Duration::from_millis(50));
    }
    bench.run(Duration::from_secs(4));

    assert_eq!(bench.host_seen(1, 0).unwrap().memory_used, Bytes(99));
    let own = bench.mesh(0).authors().author(&robot(0)).unwrap().sequence();
    assert!(own <= 6, "{own} turns in 5 s");
}

#[test]
fn what_nobody_here_understands_is_passed_on() {
    let mut bench = Bench::new(3, 0);
    bench.run(Duration::from_secs(1));
    bench.mesh(0).publish(vec![thing(1)]);
    bench.run(Duration::from_secs(1));
    let key = FleetKey { kind: RecordKind(200), name: String::from("thing-1") };
    assert_eq!(bench.mesh(2).fleet().record(&key), Some(&thing(1)));
}

fn system(revision: u64, wanted: bool, author: usize) -> FleetRecord {
    let name = crate::id::Name::new("mapping").unwrap();
    let value = crate::record::FleetValue::System(crate::record::SystemRecord {
        name: name.clone(),
        receiver: robot(author),
        components: 8 * u16::from(wanted),
        connections: 0,
        wanted,
        since: revision,
    });
    let version = Version { epoch: None, revision, term: 0, author: robot(author) };
    FleetRecord::new(RecordKind::SYSTEM, "mapping".into(), version, &value)
}

fn policy_part(revision: u64, name: &str, kind: RecordKind, author: usize) -> FleetRecord {
    let value = crate::record::FleetValue::Recovery(alloc::sync::Arc::default());
    let version = Version { epoch: None, revision, term: 0, author: robot(author) };
    FleetRecord::new(kind, name.into(), version, &value)
}

#[test]
fn what_was_undeployed_behind_a_split_is_gone_everywhere_after_it() {
    let mut bench = Bench::new(3, 0);
    bench.run(Duration::from_secs(3));
    let parts = [RecordKind::RECOVERY, RecordKind::ALLOCATION];
    let mut records = vec![system(1, true, 1)];
    records.extend(parts.map(|kind| policy_part(1, "mapping", kind, 1)));
    // so many that they differ in more branches than one answer tells of
    let parts = (0..30).map(|number| format!("mapping/p{number}"));
    records.extend(parts.map(|name| policy_part(1, &name, RecordKind::RECOVERY, 1)));
    bench.mesh(1).publish(records);
    bench.run(Duration::from_secs(3));
    bench.silence(1);
    bench.run(Duration::from_secs(2));
    bench.mesh(1).publish(vec![system(2, false, 1)]);
    bench.mesh(0).publish(vec![role(0, 2)]);
    bench.run(Duration::from_secs(10));
    bench.cut.clear();
    bench.run(Duration::from_secs(10));

    let lengths: Vec<usize> = (0..3).map(|number| bench.mesh(number).fleet().len()).collect();
    assert_eq!(lengths, [2, 2, 2]);
}

#[test]
fn what_is_lacking_arrives_while_something_else_changes_all_the_time() {
    let mut bench = Bench::new(2, 0);
    bench.run(Duration::from_secs(2));
    bench.silence(1);
    bench.mesh(0).publish(vec![role(0, 5)]);
    bench.run(Duration::from_secs(2));
    bench.cut.clear();

    for revision in 1..=100 {
        bench.mesh(1).publish(vec![system(revision, true, 1)]);
        bench.run(Duration::from_millis(100));
    }

    assert_eq!(bench.mesh(1).fleet().role().map(|role| role.term), Some(5));
}
